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

"""The processor that an emulated PLC claims to be, in the layouts of ``identity``."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from abdf1_ros.pccc import identity
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Mode


class Setting(Enum):
    """What an emulated processor can be set to."""

    RUN = 'run'
    PROGRAM = 'program'
    REMOTE = 'remote'
    TEST = 'test'
    FAULT = 'fault'


# A processor that has faulted stands still as in program mode.
_MODES = {
    Setting.RUN: Mode.RUN, Setting.PROGRAM: Mode.REMOTE_PROGRAM, Setting.REMOTE: Mode.REMOTE_RUN,
    Setting.TEST: Mode.REMOTE_TEST, Setting.FAULT: Mode.REMOTE_PROGRAM}

# SLC fault code: a minor error bit was still set at the end of a scan.
_MAJOR_ERROR = 0x0020

# PLC-2 and PLC-3 know no remote run, a PLC-3 no remote mode at all.
_WITHOUT_REMOTE_RUN = {Mode.REMOTE_RUN: Mode.RUN}
_WITHOUT_REMOTE = _WITHOUT_REMOTE_RUN | {
    Mode.REMOTE_PROGRAM: Mode.PROGRAM, Mode.REMOTE_TEST: Mode.TEST}


@dataclass(slots=True)
class EmulatedProcessor:
    """
    A processor of a family, and what it is set to at the moment.

    It is an SLC 5/03, a PLC-5/40, a PLC-3 behind the RS-232 port of a 1775-KA, or a PLC-2
    behind a 1771-KG. What does not exist here (memory, programs) is 0.
    """

    plc_type: PlcType
    setting: Setting = Setting.REMOTE
    is_full_duplex: bool = False

    def encode(self) -> bytes:
        """Return the data of the reply to 06/03: SLC 24 bytes, PLC-5 36, PLC-3 18, PLC-2 10."""
        return _ENCODERS[self.plc_type](self)

    @property
    def mode(self) -> Mode:
        """Return the mode in the words of an SLC or PLC-5."""
        return _MODES[self.setting]

    @property
    def is_faulted(self) -> bool:
        """Tell whether there is a major fault."""
        return self.setting is Setting.FAULT

    def _slc(self) -> bytes:
        port = identity.FULL_DUPLEX_PORT if self.is_full_duplex else identity.HALF_DUPLEX_PORT
        error = _MAJOR_ERROR if self.is_faulted else 0
        return (
            bytes((0, identity.EXTENDED_SLC, port, identity.SLC_5_03, 0)) + b'5/03'.ljust(11)
            + error.to_bytes(2, 'little')
            + bytes((_code(identity.SLC_MODES, self.mode),
                     identity.MAJOR_ERROR_HALTED * self.is_faulted, 0, 0, 0, _NO_OWNER)))

    def _plc5(self) -> bytes:
        state = _code(identity.PLC5_MODES, self.mode)
        state |= identity.PLC5_MAJOR_FAULT * self.is_faulted
        return bytes((state, identity.EXTENDED_PLC5, identity.PLC_5_40)).ljust(
            identity.PLC5_SIZE, b'\0')

    def _plc3(self) -> bytes:
        state = _code(identity.PLC3_MODES, _WITHOUT_REMOTE.get(self.mode, self.mode))
        state |= identity.PLC3_MAJOR_FAULT * self.is_faulted
        return bytes((state, identity.PLC3_PORT)).ljust(identity.PLC3_SIZE, b'\0')

    def _plc2(self) -> bytes:
        # A PLC-2 that has faulted does not talk to its module.
        state = _code(identity.PLC2_MODES, _WITHOUT_REMOTE_RUN.get(self.mode, self.mode))
        state |= identity.MODULE_ALONE * self.is_faulted
        return bytes((state, identity.KG_OF_PLC2)).ljust(identity.MODULE_SIZE, b'\0')


_NO_OWNER = 0xFC  # byte 24 of an SLC: nobody owns the program

_ENCODERS = {
    PlcType.SLC: EmulatedProcessor._slc, PlcType.PLC5: EmulatedProcessor._plc5,
    PlcType.PLC3: EmulatedProcessor._plc3, PlcType.PLC2: EmulatedProcessor._plc2}


def _code(modes: dict[int, Mode], mode: Mode) -> int:
    return next(code for code, known in modes.items() if known is mode)
