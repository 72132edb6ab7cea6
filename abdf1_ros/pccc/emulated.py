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

from abdf1_ros.pccc.identity import Mode
from abdf1_ros.pccc.processor import Processor


class Setting(Enum):
    """The modes and faults that an emulated processor can be set to."""

    RUN = 'run'
    PROGRAM = 'program'
    REMOTE = 'remote'
    TEST = 'test'
    FAULT = 'fault'


# With a fault the program does not run, as in program mode.
_MODES = {
    Setting.RUN: Mode.RUN, Setting.PROGRAM: Mode.REMOTE_PROGRAM, Setting.REMOTE: Mode.REMOTE_RUN,
    Setting.TEST: Mode.REMOTE_TEST, Setting.FAULT: Mode.REMOTE_PROGRAM}


@dataclass(slots=True)
class EmulatedProcessor:
    """
    The processor of an emulated PLC, and its present ``setting``.

    It is an SLC 5/03 (or another ``processor``), a PLC-5/40, a PLC-3 behind the RS-232 port of a
    1775-KA, or a PLC-2 behind a 1771-KG. ``identity`` in the folder of the family has its reply.
    """

    setting: Setting = Setting.REMOTE
    is_full_duplex: bool = False
    processor: Processor | None = None

    @property
    def mode(self) -> Mode:
        """Return the mode in the words of an SLC or PLC-5."""
        return _MODES[self.setting]

    @property
    def is_faulted(self) -> bool:
        """Tell whether there is a major fault."""
        return self.setting is Setting.FAULT
