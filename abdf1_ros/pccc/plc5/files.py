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

"""The files of a PLC-5, by the data types of its commands (M 7-28; PD, MG, SC, BT: practice)."""

from __future__ import annotations

from abdf1_ros.pccc import members
from abdf1_ros.pccc.file_types import FileType, Layout

# Data types (M 7-29). A file's own type has to be named when it is written.
_CHARACTERS, _INTEGER, _BCD = 3, 4, 16

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
