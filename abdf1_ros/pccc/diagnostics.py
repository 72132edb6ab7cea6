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

"""The diagnostic commands that every node answers: echo and diagnostic status (M 7-6..7-27)."""

from __future__ import annotations

from abdf1_ros.pccc.file_types import PlcType

CMD = 0x06
ECHO = 0x00
STATUS = 0x03

# Remote run, type extender and processor as M 10-3..10-6 (SLC) and M chapter 10 (PLC-5) lay
# them out. What does not exist here (memory, faults, programs) is 0.
_SLC_5_03 = bytes((0x00, 0xEE, 0x34, 0x49, 0x00)) + b'5/03'.ljust(11) + bytes((
    0, 0, 0x06, 0, 0, 0, 0, 0xFC))
_PLC_5_40 = bytes((0x06, 0xEB, 0x15)) + bytes(33)


def identity(plc_type: PlcType) -> bytes:
    """Return the diagnostic status of an emulated processor: SLC 24 bytes, PLC-5 36."""
    return _SLC_5_03 if plc_type is PlcType.SLC else _PLC_5_40
