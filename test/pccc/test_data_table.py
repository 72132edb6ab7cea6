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

"""The data table of an emulated PLC, and places that have words in common."""


from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable, NoSuchFile, OutOfRange
from abdf1_ros.pccc.extent import Extent
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
import pytest
from support.cases import for_all
from support.mappings import make_mapping

SLC, PLC5 = PlcType.SLC, PlcType.PLC5


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
