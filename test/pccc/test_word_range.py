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

"""PLC-3: its addresses and answers; word range commands of PLC-3 and PLC-5, and their words."""

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address, AddressRangeError, AddressSyntaxError
from abdf1_ros.pccc.families import dialect_of, parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.word_range.commands import in_line_order, word_on_line
import pytest
from support.cases import for_all
from support.tables import ask, counting, table, words_at

PLC3, PLC5 = PlcType.PLC3, PlcType.PLC5
DIALECTS = {family.value: dialect_of(family, Access.WORD_RANGE) for family in (PLC3, PLC5)}


def at(text: str, family: str = 'PLC3') -> Address:
    return parse_address(text, PlcType(family))


@for_all(('text', 'levels', 'shown', 'offset'), [
    ('B10:0', '#E3.1.8.10.0.0', 'B10:0', 0), ('b260;5/3', 'E3.1.8.260.0.5/3', 'B260:5/03', 5),
    ('N0:9999', 'E3.1.5.0.0.9999', 'N0:9999', 9999), ('D7:1', 'E3.1.7.7.0.1', 'D7:1', 1),
    ('A9:8', 'E3.1.9.9.0.8', 'A9:8', 8), ('S:5', 'E3.1.13.0.0.5', 'S:5', 5),
    ('O:17', 'E3.1.1.0.0.17', 'O:0017', 15), ('I3:7777/17', 'E3.1.2.3.0.7777/17',
                                              'I3:7777/17', 4095),
    ('T:4.ACC', 'E3.1.3.0.4.2', 'T:4.ACC', 14), ('T0:4.2', 'E3.1.3.0.4.2', 'T:4.ACC', 14),
    ('T:4/DN', 'E3.1.3.0.4.0/15', 'T:4.CTL/15', 12), ('T:4.DN', 'E3.1.3.0.4.0/15',
                                                      'T:4.CTL/15', 12),
    ('T:4/15', 'E3.1.3.0.4.0/15', 'T:4.CTL/15', 12),
    ('T:4.CTL/03', 'E3.1.3.0.4.0/03', 'T:4.CTL/03', 12),
    ('C:9999.PRE', 'E3.1.4.0.9999.1', 'C:9999.PRE', 29998)])
def test_both_forms_name_the_same_place(text: str, levels: str, shown: str, offset: int) -> None:
    address = parse_address(text, PLC3)
    assert address == parse_address(levels, PLC3)
    assert (str(address), address.offset) == (shown, offset)


@for_all(('error', 'text', 'right'), [*((AddressSyntaxError, *case) for case in (
    ('N7', 'as in N7:0'), ('020', 'as in N7:0'), ('N:0', 'give the file number, as in N7:0'),
    ('F8:0', 'F is not a file type of a PLC-3'), ('ST9:0', 'ST is not a file type of a PLC-3'),
    ('I:018', 'octal, as in I:017'), ('E3.1.2.0.0.19', 'octal, as in I:017'),
    ('N7:0/8', 'PLC-3 bits are octal'),
    ('N7:0.ACC', 'words of N files have no members'), ('T:4', 'say which word, as in T:0.ACC'),
    ('T:4.POS', 'POS is not a member; members of T: CTL, PRE, ACC, EN, TT, DN'),
    ('T:4/2', 'bit 02 of a T element has no name; bits: EN, TT, DN; words: T:0.ACC'),
    ('T:4.3', '3 is not a member'), ('T:4.ACC/DN', 'PLC-3 bits are octal'),
    ('E3.1.8.10.0', 'or E3.1.8.10.0.5'), ('T:4.DN/3', 'DN is a bit already'))),
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
    longest = '00 00 00 76 00 2C 08 0A 00' + 236 * ' 01'  # 240 with the address
    assert ask(table(PLC3, B10_0='00 00' * 118), longest) == (0, '')


@for_all(('data', 'ext_sts'), [
    ('01 00 00 01 00 2C 10 0A 00 02', '01'), ('01 00 00 01 00 04 08 02', '02'),
    ('01 00 00 01 00 6C 08 0A 00 00 02', '03'), ('01 00 00 01 00 00 41 42 00 02', '04'),
    ('01 00 00 01 00 00 4142434445464748 00 02', '04'),
    ('01 00 00 01 00 00 00 02', '05'), ('01 00 00 01 00 00 414243444546474849 00 02', '05'),
    ('01 00 00 01 00 2C 08 0B 00 02', '06'), ('01 00 00 01 00 2C 08 0A 04 02', '06'),
    ('01 00 00 01 00 2C 06 0A 00 02', '06'), ('01 00 00 01 00 2C 0F 0A 00 02', '06'),
    ('01 00 00 01 00 2D 02 08 0A 00 02', '06'),
    *((f'04 00 00 01 00 {place} 02', '06') for place in ('2C 08 0A 01', '3C 03 00 01 00')),
    ('02 2C 08 0A 04 01 00 00 00', '06'), ('00 00 00 02 00 2C 08 0A 03 01 00 02 00', '07'),
    ('00 00 00 01 00 2C 08 0A 04 01 00', '06'), ('01 04 00 05 00 2C 08 0A 00 02', '09'),
    # malformed, or unknown
    ('01 00 00 01 00 2C 08 0A 00 00', ''), ('01 00 00 01 00 2C 08 0A 00 01', ''),
    ('01 00 00 01 00 2C 08 0A 00 04', ''), ('01 01 00 01 00 2C 08 0A 00 02', ''),
    ('01 00 00 00 00 2C 08 0A 00 02', ''), ('00 00 00 01 00 2C 08 0A 00', ''),
    ('02 2C 08 0A 00 01 00 01 00', ''), ('02 2C 08 0A 00 01 00 00 00 01', ''),
    ('68 00 00 01 00 07 00 07 00 01 00', ''), ('26 2C 08 0A 00 FF FF 01 00', ''),
    ('03 00 00 01 00 0C 08 0A 01 00', '')])
def test_commands_that_are_malformed_or_lead_nowhere(data: str, ext_sts: str) -> None:
    """The codes of M 8-8 (writes), 8-9 (reads) and 8-10 (bit write); a file read names no word."""
    memory = table(PLC3, B10_0=counting(4), T_0_CTL=counting(6))
    assert ask(memory, data) == (0xF0 if ext_sts else 0x10, ext_sts)
    assert words_at(memory, 'B10:0', 4) == '00 00 01 00 02 00 03 00'


@for_all(('text', 'family', 'encoded'), [
    ('N7:5', 'PLC3', '2C 05 07 05'), ('B260:300', 'PLC3', '2C 08 FF 04 01 FF 2C 01'),
    ('T:9.ACC', 'PLC3', '3C 03 00 09 02'), ('C:0.PRE', 'PLC3', '2C 04 00 01'),
    ('I:017', 'PLC3', '2C 02 00 0F'), ('S:3', 'PLC3', '2C 0D 00 03'),
    ('T4:2.ACC', 'PLC5', '0E 04 02 02'), ('T4:2', 'PLC5', '06 04 02'),
    ('B3:300', 'PLC5', '06 03 FF 2C 01'), ('I:012', 'PLC5', '06 01 0A')])
def test_address_is_encoded_for_its_family(text: str, family: str, encoded: str) -> None:
    assert DIALECTS[family].read(at(text, family), 1) == (
        0x0F, bytes.fromhex(f'01 00 00 01 00 {encoded} 02'))


@for_all(('family', 'letters', 'read', 'write'), [
    ('PLC3', 'N', 122, 114), ('PLC3', 'T', 120, 114), ('PLC5', 'N', 122, 116),
    ('PLC5', 'F', 122, 116), ('PLC5', 'T', 120, 114), ('PLC5', 'ST', 84, 84)])
def test_limits_are_whole_elements(family: str, letters: str, read: int, write: int) -> None:
    dialect, kind = DIALECTS[family], FileType(letters)
    assert (dialect.max_read(kind), dialect.max_write(kind)) == (read, write)


@for_all('text', ['N7:0', 'T4:0', 'B3:0', 'ST9:0', 'MG9:0'])
def test_other_words_keep_their_order(text: str) -> None:
    assert in_line_order(at(text, 'PLC5'), b'\1\2\3\4\5\6') == b'\1\2\3\4\5\6'
    assert word_on_line(at(text, 'PLC5')) == at(text, 'PLC5')


def test_only_the_floats_of_a_pid_block_are_exchanged() -> None:
    words = [bytes((n, 0)) for n in range(82)]
    order = [data[0] for data in words]
    for first in (*range(2, 50, 2),):
        order[first], order[first + 1] = order[first + 1], order[first]
    assert list(in_line_order(at('PD10:1', 'PLC5'), b''.join(words))[::2]) == order


@pytest.mark.parametrize('text', ['F8:2', 'PD10:1', 'N7:0'])
def test_one_word_and_many_agree(text: str) -> None:
    address = at(text, 'PLC5')
    data = bytes(range(164))
    line = in_line_order(address, data)
    for n in range(82):
        ours = word_on_line(address.at_offset(address.offset + n)).offset - address.offset
        assert line[2 * n:2 * n + 2] == data[2 * ours:2 * ours + 2]


def test_floats_have_their_high_word_first_and_each_word_can_be_read_alone() -> None:
    memory = table(PLC5, F8_0='00 00 7A 44 00 00 C0 BF')
    assert ask(memory, '01 00 00 04 00 06 08 00 08') == (0, '7A 44 00 00 C0 BF 00 00')
    assert ask(memory, '01 01 00 04 00 06 08 00 04') == (0, '00 00 C0 BF')
    assert ask(memory, '00 01 00 04 00 06 08 00 05 00 20 41 00 01') == (0, '')
    assert ask(memory, '02 06 08 00 01 00 00 40') == (0, '')
    assert words_at(memory, 'F8:0', 4) == '05 00 7B 04 00 01 20 41'
    memory = table(PLC5, F8_0='01 00 02 00 03 00 04 00')
    assert ask(memory, '01 00 00 01 00 06 08 00 02') == (0, '02 00')
    assert ask(memory, '01 00 00 01 00 0E 08 00 01 02') == (0, '01 00')
    assert ask(memory, '01 01 00 02 00 06 08 00 02') == (0, '01 00')
    assert ask(memory, '01 01 00 02 00 0E 08 00 01 02') == (0, '04 00')


def test_structures_are_words_in_the_order_of_storage() -> None:
    memory = table(PLC5, T4_0=counting(9))
    assert ask(memory, '01 00 00 06 00 06 04 01 0C') == (0, '03 00 04 00 05 00 06 00 07 00 08 00')
    assert ask(memory, '01 00 00 01 00 0E 04 01 02 02') == (0, '05 00')
    assert ask(memory, '00 01 00 02 00 0E 04 01 01 FF 00') == (0, '')
    assert words_at(memory, 'T4:1', 3) == '03 00 04 00 FF 00'


@for_all(('data', 'sts', 'ext_sts'), [
    ('01 00 00 01 00 06 09 00 02', 0xF0, '06'), ('01 00 00 05 00 06 07 00 02', 0xF0, '0A'),
    ('01 00 00 01 00 06 07 04 02', 0xF0, '0A'), ('01 00 00 01 00 06 07 00 00', 0xF0, '01'),
    ('01 00 00 02 00 06 07 00 03', 0xF0, '01'), ('01 00 00 01 00 06 07 00 04', 0xF0, '01'),
    ('01 01 00 01 00 06 07 00 02', 0xF0, '01'), ('01 00 00 7B 00 06 07 00 F6', 0xF0, '01'),
    ('00 00 00 01 00 06 07 00', 0xF0, '01'), ('00 00 00 02 00 06 07 03 01 00 02 00', 0xF0, '0A'),
    ('00 00 00 77 00 06 07 00' + ' 00' * 238, 0xF0, '01'), ('02 06 07 04 01 00 00 00', 0xF0, '07'),
    ('01 00 00 01 00 06 07 00 02 01', 0x10, ''), ('01 00 00 01 00 06 07', 0x10, '')])
def test_command_that_a_plc5_refuses_changes_nothing(data: str, sts: int, ext_sts: str) -> None:
    memory = table(PLC5, N7_0=counting(4))
    assert ask(memory, data) == (sts, ext_sts)
    assert words_at(memory, 'N7:0', 4) == '00 00 01 00 02 00 03 00'


@for_all(('command', 'status'), [
    ('01 00 00 01 00 2C 08 0A 00 02', 0), ('01 00 00 01 00 2C 08 0A 00 02 00', 0x10),
    ('02 2C 08 0A 00 01 00 00 00', 0), ('02 2C 08 0A 00 01 00 00 00 00', 0x10)])
def test_plc3_takes_no_byte_too_many(command: str, status: int) -> None:
    """As the adapter of a PLC-3, 1775-KA (its manual, B-5); others take zeros as padding."""
    assert ask(table(PLC3, B10_0='01 00'), command)[0] == status


def test_zeros_after_a_command_are_padding_for_a_plc5() -> None:
    assert ask(table(PLC5, N7_0='01 00'), '01 00 00 01 00 06 07 00 02 00') == (0, '01 00')
