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

PLC5 = PlcType.PLC5
DIALECT = Plc5Dialect()


def at(text: str) -> Address:
    """Return an address."""
    return parse_address(text, PLC5)


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


@pytest.mark.parametrize(('text', 'typed'), [
    ('B3:0', TypedData(2, 2, b'\1\2\3\4')), ('A9:0', TypedData(3, 1, b'\1\2\3\4')),
    ('D9:0', TypedData(0x10, 2, b'\1\2\3\4')), ('S:0', TypedData(4, 2, b'\1\2\3\4'))])
def test_words_may_come_as_bits_characters_or_bcd(text: str, typed: TypedData) -> None:
    assert DIALECT.read_data(at(text), 2, typed.encode()) == b'\1\2\3\4'


@pytest.mark.parametrize(('text', 'words', 'typed'), [
    ('PD9:0.SP', 2, TypedData(4, 2, bytes(4))), ('PD9:0.SP', 2, TypedData(0x15, 164, bytes(164))),
    ('PD9:0', 82, TypedData(8, 4, bytes(164))), ('PD9:0', 1, TypedData(8, 4, bytes(4))),
    ('MG9:0', 56, TypedData(0x16, 112, bytes(224)))])
def test_reply_that_is_no_part_of_a_structure(text: str, words: int, typed: TypedData) -> None:
    with pytest.raises(FormatError):
        DIALECT.read_data(at(text), words, typed.encode())
