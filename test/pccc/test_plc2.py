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

"""A PLC-2: its addresses, its commands, and what emulated PLCs answer to them."""

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import AddressRangeError, AddressSyntaxError
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.plc2.commands import BasicBitWrite, ByteChange
from abdf1_ros.pccc.plc2.dialect import Plc2Dialect
import pytest
from support.cases import for_all
from support.tables import ask, counting, table, words_at

PLC2, PLC3, PLC5, SLC = PlcType.PLC2, PlcType.PLC3, PlcType.PLC5, PlcType.SLC
UNPROTECTED = Plc2Dialect(Access.UNPROTECTED)
PROTECTED = Plc2Dialect(Access.PROTECTED)
CIF = Plc2Dialect(Access.CIF)
WORD = parse_address('020', PLC2)


@for_all(('text', 'word', 'bit', 'shown'), [
    ('020', 16, None, '020'), ('110/17', 72, 15, '110/17'), ('0', 0, None, '000'),
    ('7/3', 7, 3, '007/03'), ('077777', 0x7FFF, None, '077777'), ('11017', 72, 15, '110/17'),
    ('7777', 0o7777, None, '7777'), ('10000/1', 0o10000, 1, '010000/01'),
    ('$110/0', 72, 0, '110/00')])
def test_words_and_bits_are_octal(text: str, word: int, bit: int | None, shown: str) -> None:
    address = parse_address(text, PLC2)
    assert (address.offset, address.bit, str(address)) == (word, bit, shown)


@for_all('text', ['', 'N7:0', '020:1', '20/', '/1', '018', '20/9', '-1', '٢'])
def test_what_is_no_address(text: str) -> None:
    with pytest.raises(AddressSyntaxError, match='as in 020 or 110/17$'):
        parse_address(text, PLC2)


@pytest.mark.parametrize(('text', 'right'), [
    ('100000', 'words run from 0 to 77777'), ('11020', 'bits run from 0 to 17'),
    ('20/20', 'bits run from 0 to 17')])
def test_out_of_range(text: str, right: str) -> None:
    with pytest.raises(AddressRangeError, match=f'^{right} \\(octal\\)$'):
        parse_address(text, PLC2)


def test_more_than_60_bytes_are_no_bit_write() -> None:
    one = ByteChange(0, 1, 0).encode()
    assert len(BasicBitWrite.read(Reader(one * 60)).changes) == 60
    with pytest.raises(FormatError, match='^61 bytes to modify, 60 are allowed$'):
        BasicBitWrite.read(Reader(one * 61))


@for_all(('mask', 'bits', 'encoded'), [
    (0x0001, 0x0001, '20 00 01 00'), (0x0080, 0x0000, '20 00 00 80'),
    (0x0100, 0x0100, '21 00 01 00'), (0x8000, 0x0000, '21 00 00 80'),
    (0x0180, 0xFF00, '20 00 00 80 21 00 01 00'), (0xFFFF, 0x00FF, '20 00 FF 00 21 00 00 FF')])
@for_all(('dialect', 'cmd'), [(UNPROTECTED, 0x05), (PROTECTED, 0x02)])
def test_bits_from_10_octal_on_are_in_the_odd_byte(dialect: Plc2Dialect, cmd: int, mask: int,
                                                   bits: int, encoded: str) -> None:
    assert dialect.write_bits(WORD, mask, bits) == (cmd, bytes.fromhex(encoded))


def test_common_interface_file_has_no_bit_write() -> None:
    assert (UNPROTECTED.writes_bits, PROTECTED.writes_bits, CIF.writes_bits) == (True, True, False)
    with pytest.raises(FormatError, match='^a common interface file has no bit write$'):
        CIF.write_bits(WORD, 1, 1)


@pytest.mark.parametrize(('dialect', 'read', 'write'), [
    (UNPROTECTED, 122, 121), (PROTECTED, 122, 121), (CIF, 47, 47)])
def test_longest_read_and_write_are_those_of_the_family(
        dialect: Plc2Dialect, read: int, write: int) -> None:
    assert (dialect.max_read(FileType.BINARY), dialect.max_write(FileType.BINARY)) == (read, write)


def words(count: int = 16) -> DataTable:
    """Return a PLC-2 whose words are their numbers."""
    return table(PLC2, **{'000': counting(count)})


def test_largest_packets_are_served_and_larger_ones_refused() -> None:
    memory = words(200)
    assert len(ask(memory, '00 00 F4', 0x01)[1].split()) == 244
    assert ask(memory, '00 00' + ' 01' * 244, 0x08) == (0, '')
    assert ask(memory, '00 00' + ' 00 00 01 00' * 60 + ' 00', 0x05)[0] == 0x10


@for_all(('cmd', 'data', 'sts'), [
    (0x01, '00 00 00', 0x10), (0x01, '00 00 03', 0x10), (0x01, '00 00 F6', 0x10),
    (0x01, '01 00 02', 0x10), (0x01, '20 00 02', 0x50), (0x01, '1E 00 04', 0x50),
    (0x01, '00 00', 0x10), (0x01, '20 00 02 01', 0x10), (0x08, '00 00', 0x10),
    (0x08, '00 00 01', 0x10), (0x08, '1E 00 01 00 02 00', 0x50),
    (0x08, '00 00' + ' 00' * 246, 0x10),
    (0x00, '20 00 01 00', 0x50), (0x05, '00 00 01 01', 0x10), (0x05, '', 0x10),
    (0x05, '20 00 01 00', 0x50), (0x05, '00 00 FF 00 20 00 01 00', 0x50),
    (0x02, '00 00 01', 0x10), (0x0F, '01 00 00 01 00 2C 08 0A 00 02', 0x10), (0x03, '', 0x10)])
def test_command_that_is_refused_changes_nothing(cmd: int, data: str, sts: int) -> None:
    memory = words()
    assert ask(memory, data, cmd) == (sts, '')
    assert words_at(memory, '000', 16) == words_at(words(), '000', 16)


def test_compatibility_file_of_a_plc5_has_the_number_of_the_station_that_asks() -> None:
    memory = table(PLC5, N5_0=counting(8), N6_0='FF FF')
    assert ask(memory, '04 00 04', 0x01) == (0, '02 00 03 00')  # the tests ask as station 5
    assert ask(memory, '04 00 AA BB', 0x00) == (0, '')
    assert ask(memory, '07 00 01 02', 0x02) == (0, '')
    assert words_at(memory, 'N5:2', 2) == 'AA BB 03 01'
    assert words_at(memory, 'N6:0') == 'FF FF'
    # Structures are words, too.
    assert ask(table(PLC5, C5_0=counting(9)), '08 00 04', 0x01) == (0, '04 00 05 00')


def test_compatibility_file_of_a_plc3_is_an_input_file() -> None:
    memory = table(PLC3, I5_0=counting(8), N5_0='FF FF')
    assert ask(memory, '04 00 04', 0x01) == (0, '02 00 03 00')
    assert ask(memory, '05 00 80 00', 0x05) == (0, '')
    assert words_at(memory, 'I5:2') == '02 80'


@pytest.mark.parametrize(('flags', 'read', 'write'), [
    ('00 00', '03 00 04', '02 00 AA BB'), ('00 01', '06 00 04', '04 00 AA BB'),
    ('FF FE', '03 00 04', '02 00 AA BB')])
def test_common_interface_file_counts_words_or_bytes(flags: str, read: str, write: str) -> None:
    memory = table(SLC, N9_0=counting(8), S_0=f'00 00 00 00 {flags}')
    assert ask(memory, read, 0x01) == (0, '03 00 04 00')
    assert ask(memory, write, 0x08) == (0, '')
    assert words_at(memory, 'N9:1', 3) == '01 00 AA BB 03 00'


def test_common_interface_file_gives_an_odd_number_of_bytes() -> None:
    memory = table(SLC, N9_0='01 02 03 04', S_0='00 00 00 00')  # without S:2
    assert ask(memory, '00 00 03', 0x01) == (0, '01 02 03')
    assert ask(memory, '00 00 01 02 03', 0x08) == (0x10, '')
    assert ask(memory, '00 00 05', 0x01) == (0x50, '')


@for_all(('memory', 'cmd', 'data', 'sts'), [
    *((table(SLC, N9_0=counting(200)), cmd, data, 0x10) for cmd, data in (  # an SLC has not
        (0x00, '00 00 01 00'), (0x02, '00 00 01 00'), (0x05, '00 00 01 00'),
        (0x01, '00 00 ED'), (0x08, '00 00' + ' 00' * 236))),
    *((table(family, N7_0='00 00'), cmd, data, 0x50) for family in (PLC3, PLC5, SLC)
      for cmd, data in ((0x01, '00 00 02'), (0x08, '00 00 01 00')))])  # without such a file
def test_what_other_families_refuse(memory: DataTable, cmd: int, data: str, sts: int) -> None:
    assert ask(memory, data, cmd) == (sts, '')
