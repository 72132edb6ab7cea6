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

"""How each family reads and writes words, and what its limits are."""

from __future__ import annotations

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc import plc5, slc
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.dialects import DIALECTS
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.status import check_status
from abdf1_ros.pccc.typed_data import TypedData
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.properties import PROPERTY

PLC5, SLC = PlcType.PLC5, PlcType.SLC
BOTH = (PLC5, SLC)


def at(text: str, family: PlcType) -> Address:
    """Return an address."""
    return Address.parse(text, family)


def read(text: str, family: PlcType, words: int) -> bytes:
    """Return the read of so many words."""
    return DIALECTS[family].read(at(text, family), words)


def serve(table: DataTable, data: bytes) -> bytes:
    """Return the data of the reply of a PLC with this table."""
    command = Packet(1, 5, 0x0F, 0, 1, data)
    return check_status(Server(table).serve(command))


def test_only_the_families_that_can_be_spoken_have_a_dialect() -> None:
    assert set(DIALECTS) == set(BOTH)
    assert {dialect.cmd for dialect in DIALECTS.values()} == {0x0F}


@pytest.mark.parametrize(('text', 'family', 'words', 'encoded'), [
    ('N7:0', PLC5, 10, '68 00 00 0A 00 07 00 07 00 0A 00'),
    ('N7:30', PLC5, 1, '68 00 00 01 00 07 00 07 1E 01 00'),
    ('F8:0', PLC5, 4, '68 00 00 02 00 07 00 08 00 02 00'),
    ('T4:2', PLC5, 3, '68 00 00 01 00 07 00 04 02 01 00'),
    ('T4:2.ACC', PLC5, 1, '68 00 00 01 00 0F 00 04 02 02 01 00'),
    ('T4:2', PLC5, 1, '68 00 00 01 00 0F 00 04 02 00 01 00'),
    ('I:012', PLC5, 2, '68 00 00 02 00 07 00 01 0A 02 00'),
    ('ST9:1', PLC5, 42, '68 00 00 01 00 07 00 09 01 01 00'),
    ('N7:0', SLC, 10, 'A2 14 07 89 00 00'), ('F8:0', SLC, 2, 'A2 04 08 8A 00 00'),
    ('T4:0', SLC, 3, 'A2 06 04 86 00 00'), ('T4:0.ACC', SLC, 1, 'A2 02 04 86 00 02'),
    ('ST9:0', SLC, 42, 'A2 54 09 8D 00 00'), ('O:2.0', SLC, 1, 'A2 02 00 8B 02 00'),
    ('I:1.3', SLC, 2, 'A2 04 01 8C 01 03'), ('N7:255', SLC, 1, 'A2 02 07 89 FF FF 00 00'),
])
def test_read(text: str, family: PlcType, words: int, encoded: str) -> None:
    assert read(text, family, words) == bytes.fromhex(encoded)


@pytest.mark.parametrize(('text', 'family', 'data', 'encoded'), [
    ('N7:10', PLC5, '10 10', '67 00 00 01 00 07 00 07 0A 93 09 42 10 10'),
    ('N7:10', PLC5, '01 00 02 00', '67 00 00 02 00 07 00 07 0A 95 09 42 01 00 02 00'),
    ('B3:0', PLC5, '01 00', '67 00 00 01 00 07 00 03 00 93 09 42 01 00'),
    ('F8:5', PLC5, '00 00 2A 42', '67 00 00 01 00 07 00 08 05 96 09 94 08 00 00 2A 42'),
    ('T4:0.PRE', PLC5, '2C 01', '67 00 00 01 00 0F 00 04 00 01 93 09 42 2C 01'),
    ('F8:1', SLC, '00 00 00 BF', 'AA 04 08 8A 01 00 00 00 00 BF'),
    ('T4:0.PRE', SLC, '2C 01', 'AA 02 04 86 00 01 2C 01'),
    ('O:2.1', SLC, '03 00', 'AA 02 00 8B 02 01 03 00'),
])
def test_write(text: str, family: PlcType, data: str, encoded: str) -> None:
    assert DIALECTS[family].write(at(text, family), bytes.fromhex(data)) == bytes.fromhex(encoded)


@pytest.mark.parametrize(('text', 'family', 'encoded'), [
    ('B3:4', PLC5, '26 07 00 03 04 F7 FE 00 01'), ('T4:1', PLC5, '26 0F 00 04 01 00 F7 FE 00 01'),
    ('B3:4', SLC, 'AB 02 03 85 04 00 08 01 00 01'),
    ('O:2.0', SLC, 'AB 02 00 8B 02 00 08 01 00 01'),
])
def test_write_bits(text: str, family: PlcType, encoded: str) -> None:
    data = DIALECTS[family].write_bits(at(text, family), 0x0108, 0x0100)
    assert data == bytes.fromhex(encoded)


@pytest.mark.parametrize('family', BOTH)
def test_bits_outside_of_the_mask_do_not_count(family: PlcType) -> None:
    dialect, address = DIALECTS[family], at('B3:4', family)
    assert dialect.write_bits(address, 0x0108, 0xFF00) == dialect.write_bits(
        address, 0x0108, 0x0100)


@pytest.mark.parametrize(('letters', 'plc5_words', 'slc_read', 'slc_write'), [
    ('N', 110, 118, 117), ('B', 110, 118, 117), ('F', 110, 118, 116), ('T', 66, 117, 117),
    ('C', 108, 117, 117), ('ST', 84, 84, 84)])
def test_limits_are_whole_elements(letters: str, plc5_words: int, slc_read: int,
                                   slc_write: int) -> None:
    kind = FileType(letters)
    assert DIALECTS[PLC5].max_read(kind) == DIALECTS[PLC5].max_write(kind) == plc5_words
    assert DIALECTS[SLC].max_read(kind) == slc_read
    assert DIALECTS[SLC].max_write(kind) == slc_write


FILES = ['N7:0', 'N900:900', 'B3:0', 'F8:0', 'F900:800', 'T4:0', 'C5:0', 'R6:0', 'ST9:0', 'S:0',
         'I:000', 'O:000', 'A10:0', 'D11:0']


@pytest.mark.parametrize('text', FILES)
def test_largest_read_of_a_plc5_fits_its_packets(text: str) -> None:
    address = at(text, PLC5)
    words = DIALECTS[PLC5].max_read(address.file_type)
    assert words % address.file_type.layout.words == 0
    assert DIALECTS[PLC5].reply_size(address, words) <= 240
    table = DataTable(PLC5)
    table.create(address, words)
    reply = serve(table, DIALECTS[PLC5].read(address, words))
    assert len(reply) == DIALECTS[PLC5].reply_size(address, words)
    assert DIALECTS[PLC5].read_data(address, words, reply) == bytes(2 * words)


@pytest.mark.parametrize('text', [text for text in FILES if text[0] != 'T'])
def test_largest_write_to_a_plc5_fits_its_packets(text: str) -> None:
    address = at(text, PLC5)
    data = bytes(range(1, 221))[:2 * DIALECTS[PLC5].max_write(address.file_type)]
    command = DIALECTS[PLC5].write(address, data)
    assert len(command) - 5 <= 240
    table = DataTable(PLC5)
    table.create(address, len(data) // 2)
    assert serve(table, command) == b''
    assert table.read(address, len(data) // 2) == data


@pytest.mark.parametrize('text', [
    'N7:0', 'F8:0', 'T4:0', 'C5:0', 'ST9:0', 'L10:0', 'I:1.0', 'S:1'])
def test_largest_transfers_of_an_slc(text: str) -> None:
    address, dialect = at(text, SLC), DIALECTS[SLC]
    table = DataTable(SLC)
    table.create(address, 200)
    words = dialect.max_write(address.file_type)
    data = bytes(range(1, 250))[:2 * words]
    assert serve(table, dialect.write(address, data)) == b''
    assert table.read(address, words) == data
    words = dialect.max_read(address.file_type)
    reply = serve(table, dialect.read(address, words))
    assert len(reply) == dialect.reply_size(address, words) == 2 * words <= slc.MAX_READ
    assert dialect.read_data(address, words, reply)[:len(data)] == data[:2 * words]


@PROPERTY
@given(st.sampled_from(BOTH), st.sampled_from(['N7:3', 'B3:3', 'T4:3.PRE', 'C5:3.ACC', 'S:3']),
       st.integers(0, 0xFFFF), st.integers(0, 0xFFFF), st.integers(0, 0xFFFF))
def test_write_read_and_write_bits_come_back(family: PlcType, text: str, value: int, mask: int,
                                             bits: int) -> None:
    address, dialect = at(text, family), DIALECTS[family]
    table = DataTable(family)
    table.create(address, 5)
    assert serve(table, dialect.write(address, value.to_bytes(2, 'little'))) == b''
    assert serve(table, dialect.write_bits(address, mask, bits)) == b''
    data = dialect.read_data(address, 1, serve(table, dialect.read(address, 1)))
    assert int.from_bytes(data, 'little') == value & ~mask | bits & mask
    size = address.file_type.layout.words
    rest = bytearray(table.read(address.at_offset(0), 4 * size))
    del rest[2 * address.offset:2 * address.offset + 2]
    assert not any(rest)


def test_internal_words_of_a_timer_are_left_out() -> None:
    timers = TypedData(5, 10, bytes(range(20))).encode()
    assert DIALECTS[PLC5].read_data(at('T4:0', PLC5), 6, timers) == (
        bytes(range(6)) + bytes(range(10, 16)))


def test_timer_of_six_bytes_is_taken_too() -> None:
    timers = TypedData(5, 6, bytes(range(12))).encode()
    assert DIALECTS[PLC5].read_data(at('T4:0', PLC5), 6, timers) == bytes(range(12))


def test_characters_are_the_words_of_a_string() -> None:
    characters = TypedData(3, 1, bytes(84)).encode()
    assert DIALECTS[PLC5].read_data(at('ST9:0', PLC5), 42, characters) == bytes(84)


@pytest.mark.parametrize(('text', 'words', 'typed'), [
    ('N7:0', 2, TypedData(4, 2, bytes(2))), ('N7:0', 2, TypedData(4, 2, bytes(6))),
    ('N7:0', 2, TypedData(8, 4, bytes(8))), ('F8:0', 2, TypedData(4, 2, bytes(4))),
    ('F8:0', 4, TypedData(8, 4, bytes(4))), ('T4:0', 3, TypedData(5, 10, bytes(20))),
    ('T4:0', 6, TypedData(5, 10, bytes(10))), ('N7:0', 1, TypedData(3, 1, bytes(1)))])
def test_plc5_reply_that_is_not_what_was_asked(text: str, words: int, typed: TypedData) -> None:
    with pytest.raises(FormatError):
        DIALECTS[PLC5].read_data(at(text, PLC5), words, typed.encode())


@pytest.mark.parametrize('size', [0, 2, 5, 8])
def test_slc_reply_that_is_not_what_was_asked(size: int) -> None:
    with pytest.raises(FormatError, match=f'^the reply holds {size} bytes'):
        DIALECTS[SLC].read_data(at('F8:0', SLC), 2, bytes(size))


def test_limit_of_plc5_data_leaves_room_for_the_longest_descriptors() -> None:
    assert plc5.MAX_DATA + 12 + 5 <= plc5.MAX_REPLY
