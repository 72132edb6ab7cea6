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
Addresses of a PLC-5: those of ``file_address``; racks, groups and bits of its I/O are octal.

::

    I:017/12      rack and group, bit
"""

from __future__ import annotations

from abdf1_ros.pccc.file_address import FileAddressing
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.plc5.files import FILES

# Last elements (M 13-13, P5A).
_LAST = {
    FileType.OUTPUT: 0o277, FileType.INPUT: 0o277, FileType.STATUS: 127, FileType.STRING: 779,
    FileType.PID: 398, FileType.MESSAGE: 584}
_LAST_ELEMENT = 999


class _Plc5Addressing(FileAddressing):
    plc_type = PlcType.PLC5
    files = FILES
    last_file = 999

    def is_octal(self, kind: FileType) -> bool:
        return kind.is_io

    def last_element(self, kind: FileType, is_flat: bool = False) -> int:
        return _LAST.get(kind, _LAST_ELEMENT)


ADDRESSING = _Plc5Addressing()
