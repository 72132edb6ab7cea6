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
What the commands of a PLC-2 address: words of data, whatever PLC executes them.

A PLC-2 has one stretch of words. An SLC or MicroLogix executes them on its common interface file.
A PLC-5 executes them on the file that has the number of the sender (M 6-4); file 2 is its S file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.plc2.commands import BasicBitWrite, BasicRead, BasicWrite
from abdf1_ros.pccc.targets import Partner, Reach, Target


def _targets(take: Callable[[Reader], object], reader: Reader,
             partner: Partner) -> Iterator[Target]:
    take(reader)
    is_status = partner.sender == FileType.STATUS.default_file and partner.may_be(PlcType.PLC5)
    yield Target.STATUS if is_status else Target.DATA


def _reach(take: Callable[[Reader], object]) -> Reach:
    return Reach('PLC-2', (Target.DATA, Target.STATUS), partial(_targets, take))


READ = _reach(BasicRead.read)
WRITE = _reach(BasicWrite.read)
BIT_WRITE = _reach(BasicBitWrite.read)
