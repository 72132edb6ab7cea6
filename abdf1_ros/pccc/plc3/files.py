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

"""The files of a PLC-3, whose words are all the same but in timers and counters."""

from __future__ import annotations

from abdf1_ros.pccc import members
from abdf1_ros.pccc.file_types import FileType, Layout

FILES = {kind: Layout() for kind in (
    FileType.OUTPUT, FileType.INPUT, FileType.INTEGER, FileType.BCD, FileType.BINARY,
    FileType.ASCII, FileType.STATUS)} | {
    FileType.TIMER: Layout(3, members=members.PLC3_TIMER),
    FileType.COUNTER: Layout(3, members=members.PLC3_COUNTER)}
