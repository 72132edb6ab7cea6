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

"""Requests to a PLC-5 with typed commands, and its replies."""

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import FAMILIES, parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.plc5.dialect import Plc5Dialect
from abdf1_ros.pccc.typed_data import TypedData
import pytest
from support.cases import for_all
from support.tables import replied
from support.vectors import pair, without_area

PLC5 = PlcType.PLC5
DIALECT = Plc5Dialect()


def at(text: str) -> Address:
    """Return an address."""
    return parse_address(text, PLC5)


@pytest.mark.parametrize(('text', 'words', 'encoded'), [
    ('N7:0', 10, '68 00 00 0A 00 06 07 00 0A 00'),
    ('N7:30', 1, '68 00 00 01 00 06 07 1E 01 00'),
    ('F8:0', 4, '68 00 00 02 00 06 08 00 02 00'),
    ('T4:2', 3, '68 00 00 01 00 06 04 02 01 00'),
    ('T4:2.ACC', 1, '68 00 00 01 00 0E 04 02 02 01 00'),
    ('T4:2', 1, '68 00 00 01 00 0E 04 02 00 01 00'),
    ('I:012', 2, '68 00 00 02 00 06 01 0A 02 00'),
    ('ST9:1', 42, '68 00 00 01 00 06 09 01 01 00'),
    ('PD12:10.SP', 2, '68 00 00 01 00 0E 0C 0A 02 01 00'),
    ('PD12:10', 82, '68 00 00 01 00 06 0C 0A 01 00'),
    ('PD12:10/INI', 1, '68 00 00 01 00 0E 0C 0A 01 01 00'),
    ('MG9:1', 112, '68 00 00 02 00 06 09 01 02 00'),
    ('BT9:1.DLEN', 1, '68 00 00 01 00 0E 09 01 02 01 00'),
    ('SC9:1', 3, '68 00 00 01 00 06 09 01 01 00'),
])
def test_read_is_the_typed_read_of_the_manual(text: str, words: int, encoded: str) -> None:
    assert DIALECT.read(at(text), words) == (0x0F, bytes.fromhex(encoded))


@pytest.mark.parametrize(('text', 'data', 'encoded'), [
    ('N7:10', '10 10', '67 00 00 01 00 06 07 0A 93 09 42 10 10'),
    ('N7:10', '01 00 02 00', '67 00 00 02 00 06 07 0A 95 09 42 01 00 02 00'),
    ('B3:0', '01 00', '67 00 00 01 00 06 03 00 93 09 42 01 00'),
    ('F8:5', '00 00 2A 42', '67 00 00 01 00 06 08 05 96 09 94 08 00 00 2A 42'),
    ('T4:0.PRE', '2C 01', '67 00 00 01 00 0E 04 00 01 93 09 42 2C 01'),
    ('PD12:10.SP', '00 00 2A 42',
     '67 00 00 01 00 0E 0C 0A 02 96 09 94 08 00 00 2A 42'),
    ('SC9:1.PRE', '07 00', '67 00 00 01 00 0E 09 01 01 93 09 42 07 00'),
])
def test_write_is_the_typed_write_of_the_manual(text: str, data: str, encoded: str) -> None:
    assert DIALECT.write(at(text), bytes.fromhex(data)) == (0x0F, bytes.fromhex(encoded))


@pytest.mark.parametrize(('text', 'encoded'), [
    ('B3:4', '26 06 03 04 F7 FE 00 01'), ('T4:1', '26 0E 04 01 00 F7 FE 00 01'),
    ('PD12:10.1', '26 0E 0C 0A 01 F7 FE 00 01'),
])
def test_bits_are_written_with_and_and_or_masks(text: str, encoded: str) -> None:
    request = DIALECT.write_bits(at(text), 0x0108, 0x0100)
    assert request == (0x0F, bytes.fromhex(encoded))


@pytest.mark.parametrize(('letters', 'read', 'written'), [
    ('N', 110, 110), ('B', 110, 110), ('F', 58, 57), ('T', 23, 22), ('C', 39, 38), ('R', 39, 38),
    ('ST', 2, 2), ('PD', 1, 1), ('MG', 2, 2), ('BT', 19, 18), ('SC', 39, 38)])
def test_limits_in_elements(letters: str, read: int, written: int) -> None:
    kind = FileType(letters)
    words = FAMILIES[PLC5].layout(kind).words
    assert DIALECT.max_read(kind) == read * words
    assert DIALECT.max_write(kind) == written * words


FILES = ['N7:0', 'N900:900', 'B3:0', 'F8:0', 'F900:800', 'T4:0', 'C5:0', 'R6:0', 'ST9:0', 'S:0',
         'I:000', 'O:000', 'A10:0', 'D11:0', 'PD9:300', 'MG9:300', 'BT999:900', 'SC900:900']


@for_all('text', FILES)
def test_largest_read_of_a_plc5_fits_its_packets(text: str) -> None:
    address = at(text)
    words = DIALECT.max_read(address.file_type)
    assert words % address.layout.words == 0
    assert DIALECT.reply_size(address, words) <= 240
    table = DataTable(PLC5)
    table.create(address, words)
    reply = replied(table, *DIALECT.read(address, words))
    assert len(reply) == DIALECT.reply_size(address, words)
    assert DIALECT.read_data(address, words, reply) == bytes(2 * words)


@pytest.mark.parametrize('text', [text for text in FILES if text[0] != 'T'])
def test_largest_write_to_a_plc5_fits_its_packets(text: str) -> None:
    address = at(text)
    data = bytes(range(1, 250))[:2 * DIALECT.max_write(address.file_type)]
    cmd, command = DIALECT.write(address, data)
    assert len(command) - 5 <= 240
    table = DataTable(PLC5)
    table.create(address, len(data) // 2)
    assert replied(table, cmd, command) == b''
    assert table.read(address, len(data) // 2) == data


def test_internal_words_of_a_timer_are_left_out() -> None:
    timers = TypedData(5, 10, bytes(range(20))).encode()
    assert DIALECT.read_data(at('T4:0'), 6, timers) == (bytes(range(6)) + bytes(range(10, 16)))


def test_timer_of_six_bytes_is_taken_too() -> None:
    timers = TypedData(5, 6, bytes(range(12))).encode()
    assert DIALECT.read_data(at('T4:0'), 6, timers) == bytes(range(12))


def test_characters_are_the_words_of_a_string() -> None:
    characters = TypedData(3, 1, bytes(84)).encode()
    assert DIALECT.read_data(at('ST9:0'), 42, characters) == bytes(84)


@pytest.mark.parametrize(('text', 'typed'), [
    ('B3:0', TypedData(2, 2, b'\1\2\3\4')), ('A9:0', TypedData(3, 1, b'\1\2\3\4')),
    ('D9:0', TypedData(0x10, 2, b'\1\2\3\4')), ('S:0', TypedData(4, 2, b'\1\2\3\4'))])
def test_words_may_come_as_bits_characters_or_bcd(text: str, typed: TypedData) -> None:
    assert DIALECT.read_data(at(text), 2, typed.encode()) == b'\1\2\3\4'


@pytest.mark.parametrize(('text', 'words', 'typed'), [
    ('N7:0', 2, TypedData(4, 2, bytes(2))), ('N7:0', 2, TypedData(4, 2, bytes(6))),
    ('N7:0', 2, TypedData(8, 4, bytes(8))), ('F8:0', 2, TypedData(4, 2, bytes(4))),
    ('F8:0', 4, TypedData(8, 4, bytes(4))), ('T4:0', 3, TypedData(5, 10, bytes(20))),
    ('T4:0', 6, TypedData(5, 10, bytes(10))), ('N7:0', 1, TypedData(3, 1, bytes(1)))])
def test_plc5_reply_that_is_not_what_was_asked(text: str, words: int, typed: TypedData) -> None:
    with pytest.raises(FormatError):
        DIALECT.read_data(at(text), words, typed.encode())


@pytest.mark.parametrize('text', ['F999:900', 'C999:900', 'SC999:900', 'BT999:900', 'MG999:580'])
def test_one_element_more_would_be_too_large(text: str) -> None:
    address = at(text)
    one = address.layout.words
    assert DIALECT.reply_size(address, DIALECT.max_read(address.file_type) + one) > 240
    data = bytes(2 * (DIALECT.max_write(address.file_type) + one))
    assert len(DIALECT.write(address, data)[1]) - 5 > 240


def test_float_of_a_pid_is_that_of_the_vectors() -> None:
    command, reply = pair('plc5_typed_read_PD_SP')
    address = at('PD12:10.SP')
    assert DIALECT.read(address, 2) == (command.cmd, without_area(command.data))
    assert DIALECT.reply_size(address, 2) == len(reply.data)
    assert DIALECT.read_data(address, 2, reply.data) == bytes.fromhex('00 00 2A 42')


@pytest.mark.parametrize(('text', 'words', 'typed'), [
    ('PD9:0.SP', 2, TypedData(4, 2, bytes(4))), ('PD9:0.SP', 2, TypedData(0x15, 164, bytes(164))),
    ('PD9:0', 82, TypedData(8, 4, bytes(164))), ('PD9:0', 1, TypedData(8, 4, bytes(4))),
    ('MG9:0', 56, TypedData(0x16, 112, bytes(224)))])
def test_reply_that_is_no_part_of_a_structure(text: str, words: int, typed: TypedData) -> None:
    with pytest.raises(FormatError):
        DIALECT.read_data(at(text), words, typed.encode())
