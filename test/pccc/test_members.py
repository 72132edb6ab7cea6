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

"""The names in structures and where they are."""

from abdf1_ros.pccc import members
from abdf1_ros.pccc.members import Members
import pytest

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


@pytest.mark.parametrize(('table', 'word', 'expected'), [
    (members.TIMER, 0, {'EN': 15, 'TT': 14, 'DN': 13}),
    (members.COUNTER, 0, {'CU': 15, 'CD': 14, 'DN': 13, 'OV': 12, 'UN': 11, 'UA': 10}),
    (members.CONTROL, 0, {'EN': 15, 'EU': 14, 'DN': 13, 'EM': 12, 'ER': 11, 'UL': 10, 'IN': 9,
                          'FD': 8}),
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


@pytest.mark.parametrize(('table', 'expected'), [
    (members.TIMER, {'PRE': 1, 'ACC': 2}), (members.COUNTER, {'PRE': 1, 'ACC': 2}),
    (members.CONTROL, {'LEN': 1, 'POS': 2}), (members.PLC5_SFC, {'PRE': 1, 'TIM': 2}),
    (members.PLC5_BLOCK_TRANSFER, {'RLEN': 1, 'DLEN': 2, 'FILE': 3, 'ELEM': 4, 'RGS': 5}),
    (members.PLC5_MESSAGE, {'ERR': 1, 'RLEN': 2, 'DLEN': 3}), (members.PLC5_PID, {}),
    (members.SLC_MESSAGE, {'RBL': 5, 'LBN': 6, 'RBN': 7, 'CHN': 8, 'NOD': 9, 'MTO': 10,
                           'TFN': 13, 'ELE': 14, 'ERR': 18}),
    (members.SLC_PID, {'SPS': 2, 'KC': 3, 'TI': 4, 'TD': 5, 'MAXS': 7, 'MINS': 8, 'CVH': 11,
                       'CVL': 12, 'SPV': 14, 'CVP': 16})])
def test_named_words_have_their_places(table: Members, expected: dict[str, int]) -> None:
    assert values(table) == expected


def test_floats_of_a_plc5_pid_follow_each_other() -> None:
    floats = {name: member.word for name, member in members.PLC5_PID.items() if member.words == 2}
    assert floats == {name: 2 + 2 * n for n, name in enumerate(PLC5_PID_FLOATS)}
    # The anchors that the manuals give numbers for (P5A).
    anchors = {'SP': 2, 'KP': 4, 'KI': 6, 'KD': 8, 'BIAS': 10, 'PV': 26, 'TIE': 48}
    assert anchors.items() <= floats.items()


def test_what_the_plc_computes_is_read_only() -> None:
    assert not any(members.PLC5_PID[name].writable for name in ('PV', 'ERR', 'OUT', 'TIE', 'EN'))
    assert not any(members.SLC_PID[name].writable for name in ('SPV', 'CVP', 'DN', 'EN'))
    assert members.PLC5_PID['SP'].writable and members.SLC_PID['SPS'].writable
