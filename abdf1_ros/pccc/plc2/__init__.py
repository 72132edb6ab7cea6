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

"""The PLC-2: addresses, commands, and both ends: client and server."""

from __future__ import annotations

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.family import Examples, Family
from abdf1_ros.pccc.plc2 import identity
from abdf1_ros.pccc.plc2.address import ADDRESSING
from abdf1_ros.pccc.plc2.describe import DESCRIBED
from abdf1_ros.pccc.plc2.dialect import Plc2Dialect
from abdf1_ros.pccc.plc2.server import Plc2Commands
from abdf1_ros.pccc.status import Meanings

# The meaning of an STS from the module of a PLC-2 (M 8-5).
MEANINGS = Meanings(sts={
    0x20: 'the PLC has found errors when it verified a command',
    0x30: 'the PLC needs attention: switch, cable or fault',
    0x40: 'error between module and PLC',
    0x50: 'address outside the data table or the window, or no compatibility file',
    0x60: 'function disabled by a switch of the module',
    0x80: 'protected commands are inhibited'})

FAMILY = Family(
    ADDRESSING,
    {way: Plc2Dialect(way) for way in (Access.UNPROTECTED, Access.PROTECTED, Access.CIF)},
    Plc2Commands, identity.decode, identity.encode, DESCRIBED, MEANINGS,
    is_spoken_by_all=True, examples=Examples('020', '020', '020/00', '030', '031'))
