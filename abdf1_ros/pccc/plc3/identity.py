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

"""The identity that the port of a PLC-3 reports: 18 bytes (M 10-13)."""

from __future__ import annotations

from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import code_of, Identity, letters, Mode, mode_of, named, word_at

PORT = 0x47  # byte 2: a 1775-KA's RS-232 port (7) of a PLC-3 (4)
MAJOR_FAULT = 0x08  # byte 1
SIZE = 18
MODES = {0: Mode.PROGRAM, 1: Mode.TEST, 2: Mode.RUN}


def decode(data: bytes) -> Identity | None:
    """Read the data of a reply to 06/03; series and revision are the module's."""
    if len(data) < SIZE or data[1] >> 4 != PORT >> 4:
        return None
    mode, mode_text = mode_of(MODES, data[0] & 0x03)
    faults = named({'major processor fault': data[0] & MAJOR_FAULT,
                    'shutdown in effect': data[0] & 0x20})
    remarks = named({'shutdown requested': data[0] & 0x10})
    return Identity(PlcType.PLC3, 'PLC-3', *letters(data[8]), mode, mode_text, faults, remarks,
                    interface=data[1], counter_address=word_at(data, 6))


def encode(emulated: EmulatedProcessor) -> bytes:
    """
    Return the data of the reply of a PLC-3, asked at the RS-232 port of a 1775-KA, to 06/03.

    Fields for memory and programs are 0, because the emulated PLC has none.
    """
    # A PLC-3 has neither remote modes nor a remote run.
    local = {Mode.REMOTE_RUN: Mode.RUN, Mode.REMOTE_PROGRAM: Mode.PROGRAM,
             Mode.REMOTE_TEST: Mode.TEST}
    state = code_of(MODES, local.get(emulated.mode, emulated.mode))
    state |= MAJOR_FAULT * emulated.is_faulted
    return bytes((state, PORT)).ljust(SIZE, b'\0')
