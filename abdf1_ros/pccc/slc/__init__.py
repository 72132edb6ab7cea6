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

"""The SLC 500 and MicroLogix: addresses, commands, and both ends: client and server."""

from __future__ import annotations

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.family import Family
from abdf1_ros.pccc.processor import USUAL
from abdf1_ros.pccc.slc import identity
from abdf1_ros.pccc.slc.address import ADDRESSING, CLOCK
from abdf1_ros.pccc.slc.describe import DESCRIBED
from abdf1_ros.pccc.slc.dialect import BY_PROCESSOR
from abdf1_ros.pccc.slc.file_search import SlcFileSearch
from abdf1_ros.pccc.slc.server import SlcCommands
from abdf1_ros.pccc.status import Meanings

# The meaning of an EXT STS from an SLC or MicroLogix: the same as on DH-485 (M 8-5).
MEANINGS = Meanings(ext_sts={
    0x07: 'memory module is too small',
    0x0B: 'access denied',
    0x0C: 'resource not available',
    0x12: 'bad parameter',
    0x14: 'failed while it was carried out'})

FAMILY = Family(
    ADDRESSING, dict.fromkeys((Access.SLOT, Access.FLAT), BY_PROCESSOR[USUAL]),
    SlcCommands, identity.decode, identity.encode, DESCRIBED, MEANINGS,
    by_processor=BY_PROCESSOR, served_counters=identity.served_counters,
    max_echo=236,  # of an SLC 5/03 and later (M 7-8)
    file_search=SlcFileSearch(), clock=str(CLOCK))
