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

"""The PLC-3: addresses, commands, and both ends: client and server."""

from __future__ import annotations

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.family import Family
from abdf1_ros.pccc.plc3 import identity
from abdf1_ros.pccc.plc3.address import ADDRESSING
from abdf1_ros.pccc.plc3.dialect import PLC3
from abdf1_ros.pccc.plc3.server import Plc3Commands
from abdf1_ros.pccc.status import Meanings

# The meaning of an STS and EXT STS from a PLC-3 (M 8-6..8-10).
MEANINGS = Meanings(
    sts={
        0x30: 'a shutdown was requested',
        0x40: 'backplane error',
        0x50: 'file or word not there, or file above 65535 words',
        0x60: 'keyswitch does not allow this'},
    ext_sts={
        0x06: 'file or word not there, or address does not lead to a word',
        0x07: 'words of the transaction are not there',
        0x09: 'past the end of the file',
        0x0A: 'total and word address are above 65535 together'})

FAMILY = Family(
    ADDRESSING, {Access.WORD_RANGE: PLC3},
    Plc3Commands, identity.decode, identity.encode, {}, MEANINGS)
