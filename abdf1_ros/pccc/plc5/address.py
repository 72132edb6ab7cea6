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
Addresses of a PLC-5, in the grammar of ``file_address``; its I/O has octal numbers.

::

    I:017/12      rack and group, bit
"""

from __future__ import annotations

import re

from abdf1_ros.pccc import members
from abdf1_ros.pccc.file_address import FileAddressing
from abdf1_ros.pccc.file_types import FileType, Layout, PlcType

# Data types (M 7-29). A write has to name the file's own type.
_CHARACTERS, _INTEGER, _BCD = 3, 4, 16

# The files of a PLC-5, by the data types of its commands (M 7-28; PD, MG, SC, BT: practice).
FILES = {kind: Layout(code=_INTEGER) for kind in (
    FileType.OUTPUT, FileType.INPUT, FileType.STATUS, FileType.BINARY, FileType.INTEGER)} | {
    FileType.ASCII: Layout(code=_CHARACTERS),
    FileType.BCD: Layout(code=_BCD),
    # The two words after ACC are internal and have no address.
    FileType.TIMER: Layout(3, 5, members.TIMER, typed_words=5),
    FileType.COUNTER: Layout(3, 6, members.COUNTER),
    FileType.CONTROL: Layout(3, 7, members.CONTROL),
    FileType.FLOAT: Layout(2, 8),
    FileType.STRING: Layout(42, _CHARACTERS),
    FileType.PID: Layout(82, 0x15, members.PLC5_PID),
    FileType.MESSAGE: Layout(56, 0x16, members.PLC5_MESSAGE),
    FileType.SFC_STATUS: Layout(3, 0x1D, members.PLC5_SFC),
    FileType.BLOCK_TRANSFER: Layout(6, 0x20, members.PLC5_BLOCK_TRANSFER)}

_SLC_IO = re.compile(r'[#$]?[IO]\d?[:;]\d+\.\d+(?:/\d+)?', re.ASCII)

# Last elements (M 13-13, P5A).
_LAST = {
    FileType.OUTPUT: 0o277, FileType.INPUT: 0o277, FileType.STATUS: 127, FileType.STRING: 779,
    FileType.PID: 398, FileType.MESSAGE: 584}
_LAST_ELEMENT = 1999

USUAL_LAST_ELEMENT = 999
"""
The last element of a file in three sources; in two sources it is 1999 for a PLC-5/40 to 5/80.
"""


class _Plc5Addressing(FileAddressing):
    plc_type = PlcType.PLC5
    files = FILES
    title = 'PLC-5'
    last_file = 999

    def mistaken(self, text: str) -> str | None:
        """Recognise the inputs and outputs of an SLC."""
        return ('this is the form of an SLC; a PLC-5 has rack, group and bit in octal, as in '
                'I:017/12') if _SLC_IO.fullmatch(text) else None

    def is_octal(self, kind: FileType) -> bool:
        return kind.is_io

    def last_element(self, kind: FileType, is_flat: bool = False) -> int:
        return _LAST.get(kind, _LAST_ELEMENT)


ADDRESSING = _Plc5Addressing()
