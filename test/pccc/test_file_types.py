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

from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.slc.address import BY_CODE
import pytest

PLC5, SLC = PlcType.PLC5, PlcType.SLC
FUNCTION = ('HSC', 'PTO', 'PWM', 'STI', 'EII')


@pytest.mark.parametrize(('letters', 'file'), [
    ('O', 0), ('I', 1), ('S', 2), ('B', 3), ('T', 4), ('C', 5), ('R', 6), ('N', 7), ('F', 8),
    ('ST', None), ('A', None), ('D', None), ('L', None), ('PD', None), ('MG', None),
    ('BT', None), ('SC', None)])
def test_default_files_are_those_of_the_specification(letters: str, file: int | None) -> None:
    assert FileType(letters).default_file == file


@pytest.mark.parametrize(('letters', 'code', 'words'), [
    ('S', 0x84, 1), ('B', 0x85, 1), ('T', 0x86, 3), ('C', 0x87, 3), ('R', 0x88, 3),
    ('N', 0x89, 1), ('F', 0x8A, 2), ('HSC', 0xE0, 18), ('STI', 0xE2, 4), ('EII', 0xE3, 4),
    ('PTO', 0xED, 15), ('PWM', 0xEE, 10), ('O', 0x8B, 1), ('I', 0x8C, 1), ('ST', 0x8D, 42),
    ('A', 0x8E, 1), ('D', 0x8F, 1), ('L', 0x91, 2), ('MG', 0x92, 25), ('PD', 0x93, 23)])
def test_slc_codes_and_sizes(letters: str, code: int, words: int) -> None:
    kind = FileType(letters)
    layout = FAMILIES[SLC].layout(kind)
    assert (layout.code, layout.words, layout.wire_words) == (code, words, words)
    assert BY_CODE[code] is kind


@pytest.mark.parametrize(('family', 'missing'), [
    (PLC5, {'L', *FUNCTION}), (SLC, {'BT', 'SC'}),
    (PlcType.PLC3, {'R', 'F', 'ST', 'L', 'PD', 'MG', 'BT', 'SC', *FUNCTION})])
def test_file_types_that_a_family_does_not_have(family: PlcType, missing: set[str]) -> None:
    assert {kind.value for kind in FileType} - {
        kind.value for kind in FAMILIES[family].file_types} == missing
    for letters in missing:
        with pytest.raises(KeyError):
            FAMILIES[family].layout(FileType(letters))


def test_kinds_of_files() -> None:
    assert {kind.value for kind in FileType if kind.is_io} == {'I', 'O'}
    assert {kind.value for kind in FileType if kind.is_structure} == {
        'T', 'C', 'R', 'PD', 'MG', 'BT', 'SC', *FUNCTION}
    assert {kind.value for kind in FileType if kind.is_function} == set(FUNCTION)
    assert {kind.value for kind in FileType if not kind.has_bits} == {'F', 'ST', 'L'}


@pytest.mark.parametrize('family', FAMILIES)
def test_members_are_those_of_structures_and_lie_inside(family: PlcType) -> None:
    for kind in FAMILIES[family].file_types:
        layout = FAMILIES[family].layout(kind)
        assert bool(layout.members) is kind.is_structure
        ends = [member.word + member.words for member in layout.members.values()]
        assert max(ends, default=0) <= layout.words


@pytest.mark.parametrize('family', FAMILIES)
def test_members_do_not_share_bits_or_words(family: PlcType) -> None:
    for kind in FAMILIES[family].file_types:
        members = FAMILIES[family].layout(kind).members.values()
        places = [(member.word, member.bit) for member in members]
        assert len(set(places)) == len(places)
        values = [member.word + n for member in members if member.bit is None
                  for n in range(member.words)]
        assert len(set(values)) == len(values)


@pytest.mark.parametrize('family', FAMILIES)
def test_whole_control_words_are_never_written(family: PlcType) -> None:
    for kind in FAMILIES[family].file_types:
        layout = FAMILIES[family].layout(kind)
        flagged = {member.word for member in layout.members.values() if member.bit is not None}
        assert bool(flagged) is (kind.is_structure and not kind.is_function)
        assert not any(layout.may_write(word) for word in flagged)


def writable(letters: str, family: PlcType) -> str:
    """Return the names of what may be written."""
    members = FAMILIES[family].layout(FileType(letters)).members
    layout = FAMILIES[family].layout(FileType(letters))
    return ' '.join(name for name, member in members.items()
                    if layout.may_write(member.word, member.bit))


@pytest.mark.parametrize(('letters', 'family', 'names'), [
    ('T', PLC5, 'PRE ACC EN TT DN'), ('T', SLC, 'PRE ACC EN TT DN'),
    ('C', SLC, 'PRE ACC CU CD DN OV UN UA'), ('R', PLC5, 'LEN POS EN EU DN EM ER UL IN FD'),
    ('BT', PLC5, 'CO TO'), ('MG', PLC5, 'TO CO'), ('MG', SLC, ''), ('SC', PLC5, 'PRE'),
    ('PD', PLC5, 'CT CL PVT DO SWM CA MO PE SP KP KI KD BIAS MAXS MINS DB SO MAXO MINO UPD '
                 'PVH PVL DVP DVN PVDB DVDB MAXI MINI'),
    ('PD', SLC, 'OL CM AM TM SPS KC TI TD MAXS MINS CVH CVL')])
def test_what_may_be_written(letters: str, family: PlcType, names: str) -> None:
    assert writable(letters, family) == names


@pytest.mark.parametrize(('letters', 'family', 'word', 'bit'), [
    ('T', PLC5, 0, 3), ('MG', PLC5, 0, 15), ('MG', PLC5, 4, None), ('PD', PLC5, 1, 12),
    ('PD', PLC5, 50, None), ('PD', PLC5, 81, 0), ('PD', SLC, 10, None), ('PD', SLC, 17, None),
    ('MG', SLC, 16, 15), ('HSC', SLC, 5, None), ('PWM', SLC, 4, None)])
def test_what_has_no_name_may_not_be_written(letters: str, family: PlcType, word: int,
                                             bit: int | None) -> None:
    assert not FAMILIES[family].layout(FileType(letters)).may_write(word, bit)


def test_both_words_and_single_bits_of_a_writable_value_may_be_written() -> None:
    assert FAMILIES[PLC5].layout(FileType.TIMER).may_write(1, 7)
    assert FAMILIES[PLC5].layout(FileType.PID).may_write(3)
