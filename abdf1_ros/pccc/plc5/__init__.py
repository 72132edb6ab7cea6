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

"""The PLC-5: addresses, commands, and both ends: client and server."""

from __future__ import annotations

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.family import Family
from abdf1_ros.pccc.plc5 import identity
from abdf1_ros.pccc.plc5.address import ADDRESSING
from abdf1_ros.pccc.plc5.describe import DESCRIBED
from abdf1_ros.pccc.plc5.dialect import PLC5_TYPED, PLC5_WORD_RANGE
from abdf1_ros.pccc.plc5.file_search import Plc5FileSearch
from abdf1_ros.pccc.plc5.server import Plc5Commands

FAMILY = Family(
    ADDRESSING, {Access.TYPED: PLC5_TYPED, Access.WORD_RANGE: PLC5_WORD_RANGE},
    Plc5Commands, identity.decode, identity.encode, DESCRIBED,
    served_counters=lambda mode: identity.COUNTERS, counters_anywhere=True,
    file_search=Plc5FileSearch(), clock='S:18')
