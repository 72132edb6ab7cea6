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

"""The PLC families and the file types of their data tables."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum


class PlcType(Enum):
    """The PLC families; the value is what the CSV files call them (S0, PLC_Type)."""

    PLC2 = 'PLC2'
    PLC3 = 'PLC3'
    PLC5 = 'PLC5'
    SLC = 'SLC'


@dataclass(frozen=True, slots=True)
class Member:
    """A named part of a structure: ``word`` counts from 0; ``bit`` is None for a word."""

    word: int
    bit: int | None = None


@dataclass(frozen=True, slots=True)
class Layout:
    """
    How the elements of a file are built.

    ``words`` is 16-bit words per element as addresses count them; ``plc5_words`` is what a
    PLC-5 typed read returns for one (its timers carry two internal words behind the three).
    ``default_file`` is None where an address must give the file number. ``slc_code`` is the
    file type of the SLC commands (M 7-17; 8D, 8E, 8F, 91 from practice), ``plc5_id`` the data
    type of the typed commands (M 7-28). ``control_words`` are words that the processor keeps.
    """

    words: int = 1
    default_file: int | None = None
    slc_code: int | None = None
    plc5_id: int | None = 4
    plc5_words: int | None = None
    members: dict[str, Member] = field(default_factory=dict)
    control_words: frozenset[int] = frozenset()


def _structure(flags: dict[str, int], second: str, third: str) -> dict[str, Member]:
    words = {'CON': Member(0), second: Member(1), third: Member(2)}
    return words | {name: Member(0, bit) for name, bit in flags.items()}


_CONTROL = frozenset((0,))
_TIMER = _structure({'EN': 15, 'TT': 14, 'DN': 13}, 'PRE', 'ACC')
_COUNTER = _structure(
    {'CU': 15, 'CD': 14, 'DN': 13, 'OV': 12, 'UN': 11, 'UA': 10}, 'PRE', 'ACC')
_CONTROL_BLOCK = _structure(
    {'EN': 15, 'EU': 14, 'DN': 13, 'EM': 12, 'ER': 11, 'UL': 10, 'IN': 9, 'FD': 8},
    'LEN', 'POS')


class FileType(Enum):
    """A file type; the value is its letters in an address (S0; M 13-13)."""

    OUTPUT = 'O'
    INPUT = 'I'
    STATUS = 'S'
    BINARY = 'B'
    TIMER = 'T'
    COUNTER = 'C'
    CONTROL = 'R'
    INTEGER = 'N'
    FLOAT = 'F'
    STRING = 'ST'
    ASCII = 'A'
    BCD = 'D'
    LONG = 'L'

    @property
    def layout(self) -> Layout:
        """Return how the elements of such a file are built."""
        return _LAYOUTS[self]

    @property
    def is_io(self) -> bool:
        """Tell whether this is the input or output image."""
        return self in (FileType.OUTPUT, FileType.INPUT)

    @property
    def is_structure(self) -> bool:
        """Tell whether elements are made of a control word and two values."""
        return bool(self.layout.control_words)

    @property
    def has_bits(self) -> bool:
        """Tell whether single bits of such a file can be addressed."""
        return self.layout.words == 1 or self.is_structure


_LAYOUTS = {
    FileType.OUTPUT: Layout(default_file=0, slc_code=0x8B),
    FileType.INPUT: Layout(default_file=1, slc_code=0x8C),
    FileType.STATUS: Layout(default_file=2, slc_code=0x84),
    FileType.BINARY: Layout(default_file=3, slc_code=0x85),
    FileType.TIMER: Layout(3, 4, 0x86, 5, 5, _TIMER, _CONTROL),
    FileType.COUNTER: Layout(3, 5, 0x87, 6, 3, _COUNTER, _CONTROL),
    FileType.CONTROL: Layout(3, 6, 0x88, 7, 3, _CONTROL_BLOCK, _CONTROL),
    FileType.INTEGER: Layout(default_file=7, slc_code=0x89),
    FileType.FLOAT: Layout(2, 8, 0x8A, 8, 2),
    FileType.STRING: Layout(42, None, 0x8D, 3, 42),
    FileType.ASCII: Layout(slc_code=0x8E),
    FileType.BCD: Layout(slc_code=0x8F),
    FileType.LONG: Layout(2, None, 0x91, None),
}

BY_SLC_CODE = {kind.layout.slc_code: kind for kind in FileType}
