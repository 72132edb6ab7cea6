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

"""
The named parts of the structures in a data table, and which of them may be written.

Members with the target of a transfer, or with the result of an instruction, belong to the
processor. A wrong number in them moves other data, a wrong bit hides a fault. So in message and
block transfer structures only the bits CO and TO may be written, which a program sets too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class Member:
    """
    A named part of a structure.

    ``word`` counts from 0; ``bit`` is None for a value, which has ``words`` words: two are a
    float32, in a function file an int32. ``writable`` tells whether commands from outside may
    change it.
    """

    word: int
    bit: int | None = None
    words: int = 1
    writable: bool = True


Members = dict[str, Member]


def _flags(word: int, **bits: int) -> Members:
    """Return bits of one word."""
    return {name: Member(word, bit) for name, bit in bits.items()}


def _values(first: int, *names: str, words: int = 1) -> Members:
    """Return values that follow each other from word ``first`` on."""
    return {name: Member(first + n * words, None, words) for n, name in enumerate(names)}


def _read_only(members: Members, *names: str) -> Members:
    """Return the members; not writable are the named members, or all if none is named."""
    return {name: replace(member, writable=bool(names) and name not in names)
            for name, member in members.items()}


_CONTROL_WORD = _read_only(_values(0, 'CON'))

# P5A; the same in every family (M 13-13).
TIMER = _CONTROL_WORD | _values(1, 'PRE', 'ACC') | _flags(0, EN=15, TT=14, DN=13)
COUNTER = _CONTROL_WORD | _values(1, 'PRE', 'ACC') | _flags(
    0, CU=15, CD=14, DN=13, OV=12, UN=11, UA=10)
CONTROL = _CONTROL_WORD | _values(1, 'LEN', 'POS') | _flags(
    0, EN=15, EU=14, DN=13, EM=12, ER=11, UL=10, IN=9, FD=8)

# Words: publication 1775-6.5.5 A-15; bits as other drivers for a PLC-3 name them. These drivers
# also say that only the program may change them.
_PLC3_VALUES = _read_only(_values(0, 'CTL')) | _values(1, 'PRE', 'ACC')
PLC3_TIMER = _PLC3_VALUES | _read_only(_flags(0, EN=15, TT=14, DN=13))
PLC3_COUNTER = _PLC3_VALUES | _read_only(_flags(0, CU=15, CD=14, DN=13, OV=12, UF=11))

# P5A. Only the preset of an SFC step is set from outside; all other members follow the program.
PLC5_SFC = _values(1, 'PRE') | _read_only(
    _values(2, 'TIM') | _flags(0, SA=15, FS=14, LS=13, OV=12, ER=11, DN=10))
PLC5_BLOCK_TRANSFER = _flags(0, CO=11, TO=8) | _read_only(
    _flags(0, EN=15, ST=14, DN=13, ER=12, EW=10, NR=9, RW=7)
    | _values(1, 'RLEN', 'DLEN', 'FILE', 'ELEM', 'RGS'))
PLC5_MESSAGE = _flags(0, TO=8, CO=3) | _read_only(
    _flags(0, NR=9, EN=7, ST=6, DN=5, ER=4, EW=2) | _values(1, 'ERR', 'RLEN', 'DLEN'))
# After the floats come four words of addresses and the loop's own data.
PLC5_PID = _read_only(
    _flags(0, EN=15, CT=9, CL=8, PVT=7, DO=6, SWM=4, CA=2, MO=1, PE=0)
    | _values(2, 'SP', 'KP', 'KI', 'KD', 'BIAS', 'MAXS', 'MINS', 'DB', 'SO', 'MAXO', 'MINO',
              'UPD', 'PV', 'ERR', 'OUT', 'PVH', 'PVL', 'DVP', 'DVN', 'PVDB', 'DVDB', 'MAXI',
              'MINI', 'TIE', words=2),
    'EN', 'PV', 'ERR', 'OUT', 'TIE') | _read_only(
    _flags(1, INI=12, SPOR=11, OLL=10, OLH=9, EWD=8, DVNA=3, DVPA=2, PVLA=1, PVHA=0))

# Function files of a MicroLogix; no manual that gives the order of their words was at hand. A
# recording of a 1400 confirms HIP, LOP, OVF and UNF, by the limits of its six counters (7FFFFFFF,
# 80000000). It confirms IS of EII by the inputs 0 to 7 of its interrupts. The places of all other
# members are not confirmed here. The places of the bits are not known, so words 2 and 3 have
# numbers but no names.
HSC = _read_only(_values(0, 'PFN', 'ER') | _values(4, 'MOD')
                 | _values(5, 'ACC', 'HIP', 'LOP', 'OVF', 'UNF', words=2)
                 | _values(15, 'OMB', 'HPO', 'LPO'))
STI = _read_only(_values(0, 'PFN', 'ER') | _values(3, 'SPM'))
EII = _read_only(_values(0, 'PFN', 'ER') | _values(3, 'IS'))
PULSES = _read_only(_values(0, 'OUT'))

# Publication 1762-RM001C 21-4..21-6 (MicroLogix); all other words of the 25 are reserved.
SLC_MESSAGE = _read_only(
    _values(5, 'RBL', 'LBN', 'RBN', 'CHN', 'NOD', 'MTO') | _values(13, 'TFN', 'ELE')
    | _values(18, 'ERR') | _flags(17, ST=14, DN=13, ER=12, EW=10, R=0))
# Words and bits of the control block of 23 words in publication 1747-RM001G 9-5; names of
# values from 1762-RM001C 19-4 and 1766-RM001A 337, which give no numbers.
SLC_PID = _flags(0, OL=3, CM=2, AM=1, TM=0) | _read_only(_flags(
    0, EN=15, RA=14, DN=13, PV=12, SP=11, LL=10, UL=9, DB=8, DA=7, TF=6, SC=5, RG=4)) | _values(
    2, 'SPS', 'KC', 'TI', 'TD') | _values(7, 'MAXS', 'MINS') | _values(11, 'CVH', 'CVL') \
    | _read_only(_values(14, 'SPV') | _values(16, 'CVP'))
