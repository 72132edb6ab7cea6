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

"""The files of an SLC 500 or MicroLogix, and their codes (M 7-17; 8D and above from practice)."""

from __future__ import annotations

from abdf1_ros.pccc import members
from abdf1_ros.pccc.file_types import FileType, Layout

FILES = {
    FileType.OUTPUT: Layout(code=0x8B),
    FileType.INPUT: Layout(code=0x8C),
    FileType.STATUS: Layout(code=0x84),
    FileType.BINARY: Layout(code=0x85),
    FileType.TIMER: Layout(3, 0x86, members.TIMER),
    FileType.COUNTER: Layout(3, 0x87, members.COUNTER),
    FileType.CONTROL: Layout(3, 0x88, members.CONTROL),
    FileType.INTEGER: Layout(code=0x89),
    FileType.FLOAT: Layout(2, 0x8A),
    FileType.STRING: Layout(42, 0x8D),
    FileType.ASCII: Layout(code=0x8E),
    FileType.BCD: Layout(code=0x8F),
    FileType.LONG: Layout(2, 0x91),
    FileType.MESSAGE: Layout(25, 0x92, members.SLC_MESSAGE),
    FileType.PID: Layout(23, 0x93, members.SLC_PID)}

BY_CODE = {layout.code: kind for kind, layout in FILES.items()}
