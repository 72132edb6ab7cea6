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

"""The SLC 500 and MicroLogix processors, whose packets and files differ."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from abdf1_ros.pccc.file_types import FileType, FUNCTION_FILES


class Processor(Enum):
    """An SLC 500 or MicroLogix processor; the value is its name in the map file."""

    SLC_5_01 = '5/01'
    SLC_5_02 = '5/02'
    SLC_5_03 = '5/03'
    SLC_5_04 = '5/04'
    SLC_5_05 = '5/05'
    ML1000 = 'ML1000'
    ML1100 = 'ML1100'
    ML1200 = 'ML1200'
    ML1400 = 'ML1400'
    ML1500 = 'ML1500'

    @property
    def max_read(self) -> int:
        """Return the most bytes of data in one reply."""
        return _MODELS[self].max_read

    @property
    def max_write(self) -> int:
        """Return the most bytes of data in one write."""
        return _MODELS[self].max_write

    @property
    def may_lack_masked_write(self) -> bool:
        """Tell whether it may lack the masked write (0F/AB), which no manual lists for it."""
        return _MODELS[self] in (_OLD, _ML1000)

    @property
    def has_clock(self) -> bool:
        """Tell whether S:37 to S:42 are its clock, which can be read and set."""
        return _MODELS[self] is _NEW

    @property
    def common_interface_file(self) -> int:
        """Return the number of the file that the commands of a PLC-2 reach (M 7-31)."""
        return 7 if self is Processor.ML1000 else 9

    @property
    def is_micrologix(self) -> bool:
        """Tell whether this is a MicroLogix."""
        return self.value.startswith('ML')

    def has_file(self, file: int, file_type: FileType) -> bool:
        """Tell whether it can have such a file."""
        model = _MODELS[self]
        if model.has_fixed_files and file != file_type.default_file:
            return False
        return file_type not in model.missing


USUAL = Processor.SLC_5_03
"""The processor that we assume for an SLC whose processor is not known."""

CIF_FILES = frozenset(processor.common_interface_file for processor in Processor)
"""The numbers that the common interface file may have."""


@dataclass(frozen=True, slots=True)
class _Model:
    """The properties that differ between processors."""

    max_read: int
    max_write: int
    missing: frozenset[FileType] = frozenset()
    has_fixed_files: bool = False


# M 7-17, 7-18. The 5/03 was the first to have float, string, A and D files, the MicroLogix the
# first to have long files (1747-RM001G).
_OLD = _Model(82, 82, frozenset((
    FileType.FLOAT, FileType.STRING, FileType.ASCII, FileType.BCD, FileType.LONG,
    *FUNCTION_FILES)))
_NEW = _Model(236, 234, frozenset((FileType.LONG, *FUNCTION_FILES)))
# AG-UM008C 3-38; it has one file each of types O, I, S, B, T, C, R and N.
_ML1000 = _Model(82, 82, frozenset((FileType.FLOAT, *FUNCTION_FILES)), has_fixed_files=True)
# The MicroLogix 1100 accepts 103 words (1763-RM001); the 1200, 1400 and 1500 accept as many or
# more.
_MICROLOGIX = _Model(206, 206)

_MODELS = {
    Processor.SLC_5_01: _OLD, Processor.SLC_5_02: _OLD,
    Processor.SLC_5_03: _NEW, Processor.SLC_5_04: _NEW, Processor.SLC_5_05: _NEW,
    Processor.ML1000: _ML1000, Processor.ML1100: _MICROLOGIX, Processor.ML1200: _MICROLOGIX,
    Processor.ML1400: _MICROLOGIX, Processor.ML1500: _MICROLOGIX}
