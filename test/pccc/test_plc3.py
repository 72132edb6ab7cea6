# Copyright 2026 abdf1_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A PLC-3: its addresses, as text and on the line, and what an emulated one answers."""

from dataclasses import replace

from abdf1_ros.pccc.address import Address, AddressRangeError, AddressSyntaxError
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.plc3.address import ADDRESSING, SECTIONS
from abdf1_ros.pccc.plc3.commands import ExtendedAddress
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all
from support.tables import ask, counting, table, words_at

PLC3 = PlcType.PLC3


@for_all(('text', 'levels', 'shown', 'offset'), [
    ('B10:0', 'E3.1.8.10.0.0', 'B10:0', 0), ('b260;5/3', 'E3.1.8.260.0.5/3', 'B260:5/03', 5),
    ('N0:9999', 'E3.1.5.0.0.9999', 'N0:9999', 9999), ('D7:1', 'E3.1.7.7.0.1', 'D7:1', 1),
    ('A9:8', 'E3.1.9.9.0.8', 'A9:8', 8), ('S:5', 'E3.1.13.0.0.5', 'S:5', 5),
    ('O:17', 'E3.1.1.0.0.17', 'O:0017', 15), ('I3:7777/17', 'E3.1.2.3.0.7777/17',
                                              'I3:7777/17', 4095),
    ('T:4.ACC', 'E3.1.3.0.4.2', 'T:4.ACC', 14), ('T0:4.2', 'E3.1.3.0.4.2', 'T:4.ACC', 14),
    ('T:4/DN', 'E3.1.3.0.4.0/15', 'T:4.CTL/15', 12), ('T:4.DN', 'E3.1.3.0.4.0/15',
                                                      'T:4.CTL/15', 12),
    ('T:4/15', 'E3.1.3.0.4.0/15', 'T:4.CTL/15', 12),
    ('T:4.CTL/17', 'E3.1.3.0.4.0/17', 'T:4.CTL/17', 12),
    ('C:9999.PRE', 'E3.1.4.0.9999.1', 'C:9999.PRE', 29998)])
def test_both_forms_name_the_same_place(text: str, levels: str, shown: str, offset: int) -> None:
    address = parse_address(text, PLC3)
    assert address == parse_address(levels, PLC3)
    assert (str(address), address.offset) == (shown, offset)


@given(st.sampled_from(list(SECTIONS)), st.data(), st.one_of(st.none(), st.integers(0, 15)))
def test_offset_leads_back_to_its_word(kind: FileType, data: st.DataObject,
                                       bit: int | None) -> None:
    element = data.draw(st.integers(0, ADDRESSING.last_element(kind)))
    word = data.draw(st.integers(0, 2)) if kind.is_structure else 0
    file = 0 if kind.is_structure else data.draw(st.integers(0, 999))
    address = Address(ADDRESSING, kind, file, element, word, bit)
    assert address.offset < address.area_size
    assert address.at_offset(address.offset) == replace(address, bit=None)


@for_all(('error', 'text', 'right'), [*((AddressSyntaxError, *case) for case in (
    ('N7', 'as in N7:0'), ('020', 'as in N7:0'), ('N:0', 'give the file number, as in N7:0'),
    ('F8:0', 'F is not a file type of a PLC-3'), ('ST9:0', 'ST is not a file type of a PLC-3'),
    ('I:018', 'octal, as in I:017'), ('E3.1.2.0.0.18', 'octal, as in I:017'),
    ('N7:0/8', 'PLC-3 bits are octal'),
    ('N7:0.ACC', 'words of N files have no members'), ('T:4', 'say which word, as in T:0.ACC'),
    ('T:4.POS', 'POS is not a member; members of T: CTL, PRE, ACC, EN, TT, DN'),
    ('T:4.3', '3 is not a member'), ('T:4.ACC/DN', 'PLC-3 bits are octal'),
    ('E3.1.8.10.0', 'or E3.1.8.10.0.5'), ('N7:0/DN', 'PLC-3 bits are octal'))),
    *((AddressRangeError, *case) for case in (
        ('E2.1.8.10.0.0', 'only the data table, E3.1, can be read'),
        ('E3.2.8.10.0.0', 'only the data table, E3.1, can be read'),
        ('E3.1.6.0.0.0', 'section 6 is not known; sections: 1 (O), 2 (I), 3 (T)'),
        ('E3.1.8.0.1.0', 'section 8 has no structures'), ('E3.1.3.0.1.3', 'are 0, 1 and 2'),
        ('E3.1.8.1000.0.0', 'files run from 0 to 999'), ('N1000:0', 'files run from 0 to 999'),
        ('T4:0.ACC', 'the T file of a PLC-3 is file 0'), ('E3.1.4.1.0.0', 'the C file of a PLC-3'),
        ('N7:10000', 'elements of N run from 0 to 9999'), ('N7:0/20', 'bits run from 0 to 17'),
        ('E3.1.8.0.0.10000', 'elements of B run from 0 to 9999'),
        ('I:10000', 'elements of I run from 0 to 7777 (octal)')))])
def test_what_is_no_address_or_out_of_range(error: type[Exception], text: str, right: str) -> None:
    with pytest.raises(error) as fault:
        parse_address(text, PLC3)
    assert right in str(fault.value)


@for_all(('address', 'encoded'), [
    (ExtendedAddress(8, 10), '2C 08 0A 00'), (ExtendedAddress(8, 260), '2C 08 FF 04 01 00'),
    (ExtendedAddress(3, 0, 9, 2), '3C 03 00 09 02'), (ExtendedAddress(5, 7, 0, 255),
                                                      '2C 05 07 FF FF 00')])
def test_extended_address_is_encoded_and_read_back(address: ExtendedAddress, encoded: str) -> None:
    assert address.encode() == bytes.fromhex(encoded)
    assert ExtendedAddress.read(Reader(bytes.fromhex(encoded))) == address


def test_file_read_begins_at_the_first_word() -> None:
    assert ask(table(PLC3, B10_0=counting(4)), '04 00 00 01 00 2C 08 0A 01 02') == (0xF0, '06')


def test_files_are_numbered_in_each_section() -> None:
    memory = table(PLC3, B10_0='01 00', N10_0='02 00', O_0='03 00', I_0='04 00')
    assert [ask(memory, f'01 00 00 01 00 0C {section} 02') for section in (
        '08 0A', '05 0A', '01 00', '02 00')] == [
        (0, '01 00'), (0, '02 00'), (0, '03 00'), (0, '04 00')]


def test_timer_is_three_words_of_a_structure() -> None:
    memory = table(PLC3, **{'T_2_CTL': '00 E0 64 00 2A 00'})
    assert ask(memory, '01 00 00 03 00 3C 03 00 02 00 06') == (0, '00 E0 64 00 2A 00')
    assert ask(memory, '01 00 00 01 00 3C 03 00 02 02 02') == (0, '2A 00')
    assert ask(memory, '00 00 00 01 00 3C 03 00 02 01 77 00') == (0, '')
    assert words_at(memory, 'T:2.PRE') == '77 00'


@for_all(('data', 'ext_sts'), [
    ('01 00 00 01 00 2C 10 0A 00 02', '01'), ('01 00 00 01 00 04 08 02', '02'),
    ('01 00 00 01 00 6C 08 0A 00 00 02', '03'), ('01 00 00 01 00 00 41 42 00 02', '04'),
    ('01 00 00 01 00 00 4142434445464748 00 02', '04'),
    ('01 00 00 01 00 00 00 02', '05'), ('01 00 00 01 00 00 414243444546474849 00 02', '05'),
    ('01 00 00 01 00 2C 08 0B 00 02', '06'), ('01 00 00 01 00 2C 08 0A 04 02', '06'),
    ('01 00 00 01 00 2C 06 0A 00 02', '06'), ('01 00 00 01 00 2C 0F 0A 00 02', '06'),
    ('01 00 00 01 00 2D 02 08 0A 00 02', '06'),
    ('02 2C 08 0A 04 01 00 00 00', '06'), ('00 00 00 02 00 2C 08 0A 03 01 00 02 00', '07'),
    ('00 00 00 01 00 2C 08 0A 04 01 00', '06'), ('01 00 00 05 00 2C 08 0A 00 02', '09'),
    # malformed, or unknown
    ('01 00 00 01 00 2C 08 0A 00 00', ''), ('01 00 00 01 00 2C 08 0A 00 01', ''),
    ('01 00 00 01 00 2C 08 0A 00 04', ''), ('01 01 00 01 00 2C 08 0A 00 02', ''),
    ('01 00 00 00 00 2C 08 0A 00 02', ''), ('00 00 00 01 00 2C 08 0A 00', ''),
    ('02 2C 08 0A 00 01 00 01 00', ''), ('68 00 00 01 00 07 00 07 00 01 00', ''),
    ('26 2C 08 0A 00 FF FF 01 00', ''), ('03 00 00 01 00 0C 08 0A 01 00', '')])
def test_commands_that_are_malformed_or_lead_nowhere(data: str, ext_sts: str) -> None:
    """The codes of M 8-8 (writes), 8-9 (reads) and 8-10 (bit write)."""
    memory = table(PLC3, B10_0=counting(4))
    assert ask(memory, data) == (0xF0 if ext_sts else 0x10, ext_sts)
    assert words_at(memory, 'B10:0', 4) == '00 00 01 00 02 00 03 00'
