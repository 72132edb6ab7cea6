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

"""The data table of an emulated PLC, places that share words, and every dialect against it."""

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable, NoSuchFile, OutOfRange
from abdf1_ros.pccc.dialect import Dialect, Transfer
from abdf1_ros.pccc.extent import Extent, OUR_TABLE
from abdf1_ros.pccc.families import dialect_of, FAMILIES, parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.processor import Processor
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest
from support.cases import for_all
from support.mappings import make_mapping
from support.tables import replied

SLC = PlcType.SLC


def at(text: str, family: PlcType = SLC) -> Address:
    return parse_address(text, family)


def table(*files: tuple[str, int], family: PlcType = SLC) -> DataTable:
    """Return a table with these files, each of so many words."""
    result = DataTable(family)
    for text, words in files:
        result.create(at(text, family), words)
    return result


def test_words_are_written_and_read_low_byte_first() -> None:
    words = table(('N7:0', 10))
    words.write(at('N7:3'), b'\x34\x12\x78\x56')
    assert words.read(at('N7:4'), 1) == b'\x78\x56'
    assert words.read(at('N7:2'), 4) == bytes.fromhex('00 00 34 12 78 56 00 00')


def test_create_makes_a_file_longer_and_keeps_its_words() -> None:
    words = table(('N7:0', 2))
    words.write(at('N7:1'), b'\x01\x02')
    words.create(at('N7:4'), 2)
    words.create(at('N7:0'), 1)
    assert words.read(at('N7:0'), 6) == b'\x00\x00\x01\x02' + bytes(8)
    with pytest.raises(OutOfRange):
        words.read(at('N7:6'), 1)


@for_all(('text', 'words', 'length'), [
    ('T4:0.ACC', 1, 3), ('T4:1.PRE', 1, 6), ('F8:0', 1, 2), ('ST9:0', 1, 42), ('N7:0', 1, 1)])
def test_file_has_whole_elements(text: str, words: int, length: int) -> None:
    created = table((text, words))
    start = at(text).at_offset(0)
    assert len(created.read(start, length)) == 2 * length
    with pytest.raises(OutOfRange):
        created.read(start, length + 1)


def test_slots_are_files_of_their_own() -> None:
    words = table(('I:1.0', 2), ('I:2.0', 1))
    words.write(at('I:1.1'), b'\xFF\xFF')
    assert words.read(at('I:2.0'), 1) == b'\x00\x00'
    with pytest.raises(OutOfRange):
        words.read(at('I:2.1'), 1)
    with pytest.raises(NoSuchFile):
        words.read(at('I:3.0'), 1)
    assert [(area.file, area.slot) for area in words] == [(1, 1), (1, 2)]


def test_file_number_has_one_type() -> None:
    words = table(('N7:0', 1))
    assert words.file_type(7) is FileType.INTEGER
    with pytest.raises(NoSuchFile, match='type N'):
        words.create(at('B7:0'), 1)
    with pytest.raises(NoSuchFile):
        words.file_type(8)


def test_function_file_has_a_number_of_its_own() -> None:
    words = table(('O:0.0', 1), ('HSC:0', 18), ('EII:0', 4), ('T4:0', 3))
    assert words.file_type(0) is FileType.OUTPUT
    for number, text in enumerate(('O:0.0', 'HSC:0.MOD', 'EII:0.IS', 'T4:0.ACC')):
        words.write(at(text), bytes((number, 0)))
    for number, text in enumerate(('O:0.0', 'HSC:0.MOD', 'EII:0.IS', 'T4:0.ACC')):
        assert replied(words, *dialect_of(SLC).read(at(text), 1)) == bytes((number, 0))


def extent(text: str, length: int = 1, station: int = 1) -> Extent:
    """Return the words of a mapping."""
    return make_mapping(text, 'Write', plc='SLC', length=length, station=station).extent


@for_all(('text', 'length', 'meets', 'holds'), [
    ('N7:5', 2, True, True), ('N7:4', 1, False, False), ('N7:7', 1, False, False),
    ('N7:4', 2, True, False), ('N7:6', 2, True, False), ('N7:4', 9, True, False),
    ('N7:6', 1, True, True), ('N7:5/3', 1, True, True), ('N7:4/15', 2, True, False),
    ('N7:4/14', 2, False, False), ('N9:5', 2, False, False)])
def test_extents_are_by_words(text: str, length: int, meets: bool, holds: bool) -> None:
    here, other = extent('N7:5', 2), extent(text, length)
    assert here.meets(other) is other.meets(here) is meets
    assert here.holds(other) is holds
    elsewhere = extent(text, length, station=2)
    assert not here.meets(elsewhere)
    assert not here.holds(elsewhere)


def test_words_of_a_broadcast_meet_those_of_every_station_from_either_side() -> None:
    area = at('N7:0').area
    for one, other in ((BROADCAST, 2), (2, BROADCAST)):
        assert Extent(one, area, 0, 2).meets(Extent(other, area, 1, 3))
        assert not Extent(one, area, 0, 2).meets(Extent(other, area, 2, 3))
        assert not Extent(one, area, 0, 2).holds(Extent(other, area, 0, 1))
    assert not Extent(BROADCAST, area, 0, 2).meets(Extent(OUR_TABLE, area, 0, 2))


# Every dialect against the emulated PLC that it is for


# Every family and access that the emulated PLC serves, with places of each kind of file. The
# common interface file is one of an SLC, whose words a PLC-2 address names by their number.
PLACES = {
    (PlcType.PLC2, Access.UNPROTECTED): ['000', '020', '77700'],
    (PlcType.PLC2, Access.PROTECTED): ['020'],
    (PlcType.PLC3, Access.WORD_RANGE): [
        'N7:3', 'B300:9000', 'I:017', 'O3:0', 'T:2.PRE', 'C:9.ACC', 'D1:0', 'A1:0', 'S:5'],
    (PlcType.PLC5, Access.TYPED): [
        'N7:3', 'B300:900', 'T4:3.PRE', 'C5:3.ACC', 'S:3', 'I:017', 'A9:1'],
    (PlcType.PLC5, Access.WORD_RANGE): [
        'N7:3', 'B300:900', 'T4:3.PRE', 'C5:3.ACC', 'S:3', 'I:017', 'A9:1'],
    (PlcType.SLC, Access.SLOT): ['N7:3', 'B3:250', 'T4:3.PRE', 'C5:3.ACC', 'S:3', 'O:2.1'],
}
WORDS = [(*key, text) for key, texts in PLACES.items() for text in texts]
FLOATS = [(PlcType.PLC5, Access.TYPED), (PlcType.PLC5, Access.WORD_RANGE),
          (PlcType.SLC, Access.SLOT)]


def bench(family: PlcType, access: Access, text: str,
          words: int = 300) -> tuple[Address, Dialect, DataTable]:
    """Return a place, how to get there, and a table that has words from there on."""
    address = parse_address(text, family)
    table = DataTable(family)
    table.create(address, words)
    return address, dialect_of(family, access), table


@for_all('family', FAMILIES)
def test_every_family_has_a_dialect_for_every_access_it_serves(family: PlcType) -> None:
    assert dialect_of(family) is dialect_of(family, FAMILIES[family].accesses[0])


@for_all(('family', 'access', 'right'), [
    (PlcType.PLC5, Access.SLOT, 'PLC-5 is Typed, WordRange, not Slot'),
    (PlcType.PLC3, Access.TYPED, 'PLC-3 is WordRange, not Typed'),
    (PlcType.PLC2, Access.FLAT, 'PLC-2 is Unprotected, Protected, CIF, not Flat'),
    (PlcType.SLC, Access.CIF, 'SLC is Slot, Flat, not CIF')])
def test_access_of_another_family(family: PlcType, access: Access, right: str) -> None:
    with pytest.raises(FormatError, match=f'^Access of a {right}$'):
        dialect_of(family, access)


@settings(max_examples=40)
@given(st.sampled_from(WORDS), st.integers(0, 0xFFFF), st.integers(0, 0xFFFF),
       st.integers(0, 0xFFFF))
def test_write_read_and_write_bits_come_back(place: tuple[PlcType, Access, str], value: int,
                                             mask: int, bits: int) -> None:
    address, dialect, table = bench(*place, words=5)
    before = address.at_offset(max(0, address.offset - 1))
    assert replied(table, *dialect.write(address, value.to_bytes(2, 'little'))) == b''
    if mask:
        assert replied(table, *dialect.write_bits(address, mask, bits)) == b''
    data = dialect.read_data(address, 1, replied(table, *dialect.read(address, 1)))
    assert int.from_bytes(data, 'little') == value & ~mask | bits & mask
    assert before == address or not any(table.read(before, 1))
    assert not any(table.read(address.at_offset(address.offset + 1), 4))


@for_all('place', [place for place in WORDS if '.' not in place[2]])
def test_largest_packets_are_served(place: tuple[PlcType, Access, str]) -> None:
    address, dialect, table = bench(*place, words=150)
    words = dialect.max_write(address.file_type)
    data = bytes(n % 251 + 1 for n in range(2 * words))
    assert replied(table, *dialect.write(address, data)) == b''
    assert table.read(address, words) == data
    words = dialect.max_read(address.file_type)
    reply = replied(table, *dialect.read(address, words))
    assert len(reply) == dialect.reply_size(address, words)
    assert dialect.read_data(address, words, reply) == table.read(address, words)


@for_all('place', FLOATS)
def test_every_value_of_every_file_type_goes_there_and_back(place: tuple[PlcType, Access]) -> None:
    family, dialect = place[0], dialect_of(*place)
    for kind in FAMILIES[family].file_types:
        file = kind.default_file if kind.default_file is not None else 9
        layout = FAMILIES[family].layout(kind)
        start = Address(FAMILIES[family].addressing, kind, file, 1)
        table = DataTable(family)
        table.create(start, 2 * layout.words)
        stored = bytearray(4 * layout.words)
        for word in filter(layout.value_words, range(layout.words) if kind.is_structure else (0,)):
            address = start.at_offset(start.offset + word)
            words = layout.value_words(word) if kind.is_structure else layout.words
            data = bytes(range(word + 1, word + 1 + 2 * words))
            assert replied(table, *dialect.write(address, data)) == b''
            reply = replied(table, *dialect.read(address, words))
            assert len(reply) == dialect.reply_size(address, words)
            assert dialect.read_data(address, words, reply) == data
            stored[2 * word:2 * (word + words)] = data
        assert table.read(start, 2 * layout.words) == stored
        reply = replied(table, *dialect.read(start, layout.words))
        assert dialect.read_data(start, layout.words, reply) == stored[:2 * layout.words]


def test_processor_is_for_an_slc_only() -> None:
    with pytest.raises(FormatError, match='^a PLC-5 has no Processor$'):
        dialect_of(PlcType.PLC5, None, Processor.SLC_5_03)


@settings(max_examples=40)
@given(st.sampled_from([place for place in WORDS if '.' not in place[2]]),
       st.integers(1, 40), st.integers(1, 15))
def test_parts_of_a_transfer_make_the_whole(place: tuple[PlcType, Access, str], words: int,
                                            step: int) -> None:
    address, dialect, table = bench(*place, words=40)
    data = bytes(n % 251 + 1 for n in range(2 * words))
    whole = Transfer(address, words)
    read = b''
    for first in range(0, words, step):
        count = min(step, words - first)
        part = address.at_offset(address.offset + first)
        packet = data[2 * first:2 * (first + count)]
        assert replied(table, *dialect.write(part, packet, whole)) == b''
        reply = replied(table, *dialect.read(part, count, whole))
        read += dialect.read_data(part, count, reply)
    assert table.read(address, words) == read == data
