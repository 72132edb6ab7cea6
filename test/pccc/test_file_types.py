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

"""File types, their members, and what processors and families have of them."""

from abdf1_ros.pccc import members
from abdf1_ros.pccc.families import dialect_of, FAMILIES
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.members import Members
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.slc.address import BY_CODE
from abdf1_ros.pccc.spellings import family_advice, family_name, processor_name
import pytest
from support.cases import for_all

PLC5, SLC = PlcType.PLC5, PlcType.SLC
FUNCTION = ('HSC', 'PTO', 'PWM', 'STI', 'EII')  # numbered in this order


@for_all(('letters', 'file'), [
    ('O', 0), ('I', 1), ('S', 2), ('B', 3), ('T', 4), ('C', 5), ('R', 6), ('N', 7), ('F', 8),
    ('ST', None), ('A', None), ('D', None), ('L', None), ('PD', None), ('MG', None),
    ('BT', None), ('SC', None), *((letters, file) for file, letters in enumerate(FUNCTION))])
def test_default_files_are_those_of_the_specification(letters: str, file: int | None) -> None:
    assert FileType(letters).default_file == file


@for_all(('letters', 'code', 'words'), [
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


@for_all('family', FAMILIES)
def test_members_lie_inside_of_structures_apart_from_each_other(family: PlcType) -> None:
    for kind in FAMILIES[family].file_types:
        layout = FAMILIES[family].layout(kind)
        members = layout.members.values()
        assert bool(members) is kind.is_structure
        assert len({(member.word, member.bit) for member in members}) == len(members)
        values = [member.word + n for member in members if member.bit is None
                  for n in range(member.words)]
        assert len(set(values)) == len(values)
        assert max(values, default=0) < layout.words
        # Words of flags are never written as a whole.
        flagged = {member.word for member in members if member.bit is not None}
        assert bool(flagged) is (kind.is_structure and not kind.is_function)
        assert not any(layout.may_write(word) for word in flagged)


def writable(letters: str, family: PlcType) -> str:
    """Return the names of what may be written."""
    members = FAMILIES[family].layout(FileType(letters)).members
    layout = FAMILIES[family].layout(FileType(letters))
    return ' '.join(name for name, member in members.items()
                    if layout.may_write(member.word, member.bit))


@for_all(('letters', 'family', 'names'), [
    ('T', PLC5, 'PRE ACC EN TT DN'), ('T', SLC, 'PRE ACC EN TT DN'),
    ('C', SLC, 'PRE ACC CU CD DN OV UN UA'), ('R', PLC5, 'LEN POS EN EU DN EM ER UL IN FD'),
    *((letters, PlcType.PLC3, 'PRE ACC') for letters in 'TC'),
    ('BT', PLC5, 'CO TO'), ('MG', PLC5, 'TO CO'), ('SC', PLC5, 'PRE'),
    *((letters, SLC, '') for letters in ('MG', *FUNCTION)),
    ('PD', PLC5, 'CT CL PVT DO SWM CA MO PE SP KP KI KD BIAS MAXS MINS DB SO MAXO MINO UPD '
                 'PVH PVL DVP DVN PVDB DVDB MAXI MINI'),
    ('PD', SLC, 'OL CM AM TM SPS KC TI TD MAXS MINS CVH CVL')])
def test_what_may_be_written(letters: str, family: PlcType, names: str) -> None:
    assert writable(letters, family) == names


@for_all(('letters', 'family', 'word', 'bit'), [
    ('T', PLC5, 0, 3), ('MG', PLC5, 0, 15), ('MG', PLC5, 4, None), ('PD', PLC5, 1, 12),
    ('PD', PLC5, 50, None), ('PD', PLC5, 81, 0), ('PD', SLC, 10, None), ('PD', SLC, 17, None),
    ('MG', SLC, 16, 15), ('HSC', SLC, 5, None), ('PWM', SLC, 4, None)])
def test_what_has_no_name_may_not_be_written(letters: str, family: PlcType, word: int,
                                             bit: int | None) -> None:
    assert not FAMILIES[family].layout(FileType(letters)).may_write(word, bit)
    assert FAMILIES[PLC5].layout(FileType.PID).may_write(3)  # its second word


PLC5_PID_FLOATS = (
    'SP', 'KP', 'KI', 'KD', 'BIAS', 'MAXS', 'MINS', 'DB', 'SO', 'MAXO', 'MINO', 'UPD', 'PV',
    'ERR', 'OUT', 'PVH', 'PVL', 'DVP', 'DVN', 'PVDB', 'DVDB', 'MAXI', 'MINI', 'TIE')


def bits(table: Members, word: int) -> dict[str, int]:
    """Return the named bits of one word, from high to low."""
    found = {name: member.bit for name, member in table.items()
             if member.word == word and member.bit is not None}
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def values(table: Members) -> dict[str, int]:
    """Return the values of one word, without those that are control words."""
    return {name: member.word for name, member in table.items()
            if member.bit is None and member.words == 1 and name != 'CON'}


@for_all(('table', 'word', 'expected'), [
    (members.TIMER, 0, {'EN': 15, 'TT': 14, 'DN': 13}),
    (members.COUNTER, 0, {'CU': 15, 'CD': 14, 'DN': 13, 'OV': 12, 'UN': 11, 'UA': 10}),
    (members.CONTROL, 0, {'EN': 15, 'EU': 14, 'DN': 13, 'EM': 12, 'ER': 11, 'UL': 10, 'IN': 9,
                          'FD': 8}),
    (members.PLC3_TIMER, 0, {'EN': 15, 'TT': 14, 'DN': 13}),
    (members.PLC3_COUNTER, 0, {'CU': 15, 'CD': 14, 'DN': 13, 'OV': 12, 'UF': 11}),
    (members.PLC5_SFC, 0, {'SA': 15, 'FS': 14, 'LS': 13, 'OV': 12, 'ER': 11, 'DN': 10}),
    (members.PLC5_BLOCK_TRANSFER, 0, {'EN': 15, 'ST': 14, 'DN': 13, 'ER': 12, 'CO': 11,
                                      'EW': 10, 'NR': 9, 'TO': 8, 'RW': 7}),
    (members.PLC5_MESSAGE, 0, {'NR': 9, 'TO': 8, 'EN': 7, 'ST': 6, 'DN': 5, 'ER': 4, 'CO': 3,
                               'EW': 2}),
    (members.PLC5_PID, 0, {'EN': 15, 'CT': 9, 'CL': 8, 'PVT': 7, 'DO': 6, 'SWM': 4, 'CA': 2,
                           'MO': 1, 'PE': 0}),
    (members.PLC5_PID, 1, {'INI': 12, 'SPOR': 11, 'OLL': 10, 'OLH': 9, 'EWD': 8, 'DVNA': 3,
                           'DVPA': 2, 'PVLA': 1, 'PVHA': 0}),
    (members.SLC_MESSAGE, 17, {'ST': 14, 'DN': 13, 'ER': 12, 'EW': 10, 'R': 0}),
    (members.SLC_PID, 0, {'EN': 15, 'RA': 14, 'DN': 13, 'PV': 12, 'SP': 11, 'LL': 10, 'UL': 9,
                          'DB': 8, 'DA': 7, 'TF': 6, 'SC': 5, 'RG': 4, 'OL': 3, 'CM': 2,
                          'AM': 1, 'TM': 0})])
def test_named_bits_are_told_in_their_order(
        table: Members, word: int, expected: dict[str, int]) -> None:
    assert bits(table, word) == expected
    assert list(bits(table, word)) == list(expected)


@for_all(('table', 'expected'), [
    (members.TIMER, {'PRE': 1, 'ACC': 2}), (members.COUNTER, {'PRE': 1, 'ACC': 2}),
    (members.CONTROL, {'LEN': 1, 'POS': 2}), (members.PLC5_SFC, {'PRE': 1, 'TIM': 2}),
    (members.PLC5_BLOCK_TRANSFER, {'RLEN': 1, 'DLEN': 2, 'FILE': 3, 'ELEM': 4, 'RGS': 5}),
    (members.PLC5_MESSAGE, {'ERR': 1, 'RLEN': 2, 'DLEN': 3}), (members.PLC5_PID, {}),
    (members.SLC_MESSAGE, {'RBL': 5, 'LBN': 6, 'RBN': 7, 'CHN': 8, 'NOD': 9, 'MTO': 10,
                           'TFN': 13, 'ELE': 14, 'ERR': 18}),
    (members.SLC_PID, {'SPS': 2, 'KC': 3, 'TI': 4, 'TD': 5, 'MAXS': 7, 'MINS': 8, 'CVH': 11,
                       'CVL': 12, 'SPV': 14, 'CVP': 16}),
    # A recording of a MicroLogix 1400 confirms EII.IS; of the other places there is no manual.
    (members.HSC, {'PFN': 0, 'ER': 1, 'MOD': 4, 'OMB': 15, 'HPO': 16, 'LPO': 17}),
    (members.STI, {'PFN': 0, 'ER': 1, 'SPM': 3}), (members.EII, {'PFN': 0, 'ER': 1, 'IS': 3}),
    (members.PULSES, {'OUT': 0})])
def test_named_words_have_their_places(table: Members, expected: dict[str, int]) -> None:
    assert values(table) == expected


def test_floats_of_a_plc5_pid_follow_each_other() -> None:
    floats = {name: member.word for name, member in members.PLC5_PID.items() if member.words == 2}
    assert floats == {name: 2 + 2 * n for n, name in enumerate(PLC5_PID_FLOATS)}


SLC_FILES = FAMILIES[PlcType.SLC].file_types


def missing(name: str, file: int = 7) -> set[str]:
    """Return the letters of the files that a processor cannot have as number ``file``."""
    return {kind.value for kind in SLC_FILES if not Processor(name).has_file(file, kind)}


@pytest.mark.parametrize(('names', 'letters'), [
    ('5/01 5/02', {'F', 'ST', 'A', 'D', 'L', *FUNCTION}), ('5/03 5/04 5/05', {'L', *FUNCTION}),
    ('ML1100 ML1200 ML1400 ML1500', set())])
def test_files_that_are_missing(names: str, letters: set[str]) -> None:
    for name in names.split():
        assert missing(name) == missing(name, 255) == set(letters)


def test_files_of_a_micrologix_1000_are_fixed() -> None:
    kinds = {file: {kind.value for kind in SLC_FILES} - missing('ML1000', file)
             for file in range(11)}
    assert kinds == {0: {'O'}, 1: {'I'}, 2: {'S'}, 3: {'B'}, 4: {'T'}, 5: {'C'}, 6: {'R'},
                     7: {'N'}, 8: set(), 9: set(), 10: set()}


def test_what_else_the_processors_differ_in() -> None:
    assert {processor.value: (processor.may_lack_masked_write, processor.has_clock,
                              processor.common_interface_file) for processor in Processor} == {
        '5/01': (True, False, 9), '5/02': (True, False, 9), 'ML1000': (True, False, 7),
        **dict.fromkeys(('5/03', '5/04', '5/05'), (False, True, 9)),
        **dict.fromkeys(('ML1100', 'ML1200', 'ML1400', 'ML1500'), (False, False, 9))}


def test_packet_has_an_element_at_least_so_that_a_plc_that_lacks_the_file_can_refuse_it() -> None:
    for processor in Processor:
        dialect = dialect_of(PlcType.SLC, None, processor)
        for kind in SLC_FILES:
            assert dialect.sure_read(kind) > 0
            assert dialect.max_read(kind) > 0 and dialect.max_write(kind) > 0


@for_all(('text', 'family', 'processor'), [
    ('SLC 500', 'SLC', 'SLC 500'), ('5/03', 'SLC', '5/03'), ('SLC 5/3', 'SLC', '5/03'),
    ('slc-5/04', 'SLC', '5/04'), ('ML1400', 'SLC', 'ML1400'),
    ('MicroLogix 1100', 'SLC', 'ML1100'), ('1747-L531', 'SLC', '5/03'),
    ('1763-L16BWA', 'SLC', 'ML1100'), ('1747-KE', 'SLC', '1747-KE'),
    ('PLC-5', 'PLC5', 'PLC-5'), ('PLC-5/40E', 'PLC5', 'PLC-5/40E'), ('5/40', 'PLC5', '5/40'),
    ('1785-L40B', 'PLC5', '1785-L40B'), ('plc2', 'PLC2', 'plc2'), ('S7', 'S7', 'S7'),
    ('SLC504', 'SLC', '5/04'), ('5/4', 'SLC', '5/04'), ('MLX', 'SLC', 'MLX'),
    ('PLC5-40', 'PLC5', 'PLC5-40'), ('PLC-5E', 'PLC5', 'PLC-5E'), ('5/11', 'PLC5', '5/11'),
    ('PLC-3/10', 'PLC3', 'PLC-3/10'), ('PLC-2/30', 'PLC2', 'PLC-2/30'),
    ('ControlLogix', 'CONTROLLOGIX', 'ControlLogix'), ('1400', '1400', 'ML1400')])
def test_names_of_processors_lead_to_their_family(
        text: str, family: str, processor: str) -> None:
    assert (family_name(text), processor_name(text)) == (family, processor)


@for_all(('text', 'advice'), [
    *((text, 'Map PLC/SLC Messages') for text in (
        'logix', 'Control Logix', 'CompactLogix', 'GuardLogix', 'CLX', '1756-L61', '1769-L32E',
        '5380')),
    ('Micro850', 'no DF1'), *((text, 'a MicroLogix is SLC') for text in (
        'MicroLogix 9', 'RSLogix 500', 'S7', ''))])
def test_name_of_another_family_leads_to_what_to_choose(text: str, advice: str) -> None:
    assert advice in family_advice(text)
