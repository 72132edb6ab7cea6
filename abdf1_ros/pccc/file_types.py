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

"""The names of PLC families, and the file types of their data tables."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from typing import ClassVar

from abdf1_ros.pccc.members import Members


@dataclass(frozen=True, slots=True)
class PlcType:
    """
    The name of a PLC family; ``value`` is what the CSV files call it (S0, PLC_Type).

    The four families of the specification have names here, for code and tests about one of them.
    ``families`` has all families.
    """

    value: str

    PLC2: ClassVar[PlcType]
    PLC3: ClassVar[PlcType]
    PLC5: ClassVar[PlcType]
    SLC: ClassVar[PlcType]

    def __str__(self) -> str:
        """Return the value."""
        return self.value


PlcType.PLC2 = PlcType('PLC2')
PlcType.PLC3 = PlcType('PLC3')
PlcType.PLC5 = PlcType('PLC5')
PlcType.SLC = PlcType('SLC')


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
    PID = 'PD'
    MESSAGE = 'MG'
    BLOCK_TRANSFER = 'BT'
    SFC_STATUS = 'SC'
    HSC = 'HSC'
    PTO = 'PTO'
    PWM = 'PWM'
    STI = 'STI'
    EII = 'EII'

    @property
    def default_file(self) -> int | None:
        """Return the file number of an address that names none (S0), None if it needs one."""
        return DEFAULT_FILES.get(self, FUNCTION_FILES.get(self))

    @property
    def is_function(self) -> bool:
        """Tell whether this is a function file of a MicroLogix."""
        return self in FUNCTION_FILES

    @property
    def is_io(self) -> bool:
        """Tell whether this is the input or output image."""
        return self in (FileType.OUTPUT, FileType.INPUT)

    @property
    def is_structure(self) -> bool:
        """Tell whether the words of an element have different meanings."""
        return self in _STRUCTURES

    @property
    def has_bits(self) -> bool:
        """Tell whether single bits of such a file can be addressed."""
        return self not in (FileType.FLOAT, FileType.LONG, FileType.STRING)


DEFAULT_FILES = {
    FileType.OUTPUT: 0, FileType.INPUT: 1, FileType.STATUS: 2, FileType.BINARY: 3,
    FileType.TIMER: 4, FileType.COUNTER: 5, FileType.CONTROL: 6, FileType.INTEGER: 7,
    FileType.FLOAT: 8}
# The file numbers that the programming software used when it read a MicroLogix 1400.
FUNCTION_FILES = {
    FileType.HSC: 0, FileType.PTO: 1, FileType.PWM: 2, FileType.STI: 3, FileType.EII: 4}
_STRUCTURES = (
    FileType.TIMER, FileType.COUNTER, FileType.CONTROL, FileType.PID, FileType.MESSAGE,
    FileType.BLOCK_TRANSFER, FileType.SFC_STATUS, *FUNCTION_FILES)


@dataclass(frozen=True, slots=True)
class Layout:
    """
    How the elements of a file are built in one family.

    ``words`` is 16-bit words per element as addresses count them. ``code`` is what commands call
    the file: the data type of a PLC-5 (M 7-28; PD, MG, SC, BT from practice), the file type of an
    SLC (M 7-17; 8D and above from practice), 0 where they do not name it. ``typed_words`` is the
    number of words that a typed read of a PLC-5 returns for an element, if it differs from
    ``words``. ``members`` are empty unless the file type is a structure.
    """

    words: int = 1
    code: int = 0
    members: Members = field(default_factory=dict)
    typed_words: int | None = None

    @property
    def wire_words(self) -> int:
        """Return the words of an element in the data of a typed command."""
        return self.typed_words or self.words

    def value_words(self, word: int) -> int:
        """Return the words of the value that begins at ``word``, 0 within a float32."""
        for member in self.members.values():
            if member.words == 2 and 0 <= word - member.word < 2:
                return 0 if word > member.word else 2
        return 1

    def may_write(self, word: int, bit: int | None = None) -> bool:
        """Tell whether a word of an element, or a bit of it, may be written from outside."""
        parts = [member for member in self.members.values() if member.writable
                 and member.word <= word < member.word + member.words]
        return not self.members or any(part.bit in (None, bit) for part in parts)
