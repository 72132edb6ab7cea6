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

"""File types: letters, codes and layouts of the manual."""

from __future__ import annotations

from abdf1_ros.pccc.file_types import BY_SLC_CODE, FileType, Member, PlcType
import pytest


@pytest.mark.parametrize(('letters', 'file'), [
    ('O', 0), ('I', 1), ('S', 2), ('B', 3), ('T', 4), ('C', 5), ('R', 6), ('N', 7), ('F', 8),
    ('ST', None), ('A', None), ('D', None), ('L', None)])
def test_default_files_are_those_of_the_specification(letters: str, file: int | None) -> None:
    assert FileType(letters).layout.default_file == file


@pytest.mark.parametrize(('letters', 'code', 'words'), [
    ('S', 0x84, 1), ('B', 0x85, 1), ('T', 0x86, 3), ('C', 0x87, 3), ('R', 0x88, 3),
    ('N', 0x89, 1), ('F', 0x8A, 2), ('O', 0x8B, 1), ('I', 0x8C, 1), ('ST', 0x8D, 42),
    ('A', 0x8E, 1), ('D', 0x8F, 1), ('L', 0x91, 2)])
def test_slc_codes_and_sizes(letters: str, code: int, words: int) -> None:
    kind = FileType(letters)
    assert (kind.layout.slc_code, kind.layout.words) == (code, words)
    assert BY_SLC_CODE[code] is kind


def test_every_file_type_has_its_own_slc_code() -> None:
    assert len(BY_SLC_CODE) == len(FileType) == 13


@pytest.mark.parametrize(('letters', 'type_id', 'size'), [
    ('N', 4, 2), ('B', 4, 2), ('T', 5, 10), ('C', 6, 6), ('R', 7, 6), ('F', 8, 4), ('ST', 3, 84)])
def test_plc5_types_and_element_sizes(letters: str, type_id: int, size: int) -> None:
    layout = FileType(letters).layout
    assert layout.plc5_id == type_id
    assert 2 * (layout.plc5_words or layout.words) == size


def test_plc5_has_no_long_files() -> None:
    assert FileType.LONG.layout.plc5_id is None


@pytest.mark.parametrize(('letters', 'members'), [
    ('T', {'CON': (0, None), 'PRE': (1, None), 'ACC': (2, None), 'EN': (0, 15), 'TT': (0, 14),
           'DN': (0, 13)}),
    ('C', {'CON': (0, None), 'PRE': (1, None), 'ACC': (2, None), 'CU': (0, 15), 'CD': (0, 14),
           'DN': (0, 13), 'OV': (0, 12), 'UN': (0, 11), 'UA': (0, 10)}),
    ('R', {'CON': (0, None), 'LEN': (1, None), 'POS': (2, None), 'EN': (0, 15), 'EU': (0, 14),
           'DN': (0, 13), 'EM': (0, 12), 'ER': (0, 11), 'UL': (0, 10), 'IN': (0, 9),
           'FD': (0, 8)}),
    ('N', {})])
def test_members(letters: str, members: dict[str, tuple[int, int | None]]) -> None:
    assert FileType(letters).layout.members == {
        name: Member(word, bit) for name, (word, bit) in members.items()}


def test_kinds_of_files() -> None:
    assert {kind.value for kind in FileType if kind.is_io} == {'I', 'O'}
    assert {kind.value for kind in FileType if kind.is_structure} == {'T', 'C', 'R'}
    assert {kind.value for kind in FileType if not kind.has_bits} == {'F', 'ST', 'L'}


def test_control_word_of_structures_belongs_to_the_processor() -> None:
    for kind in FileType:
        assert kind.layout.control_words == (frozenset((0,)) if kind.is_structure else set())


def test_families_are_those_of_the_specification() -> None:
    assert [family.value for family in PlcType] == ['PLC2', 'PLC3', 'PLC5', 'SLC']
