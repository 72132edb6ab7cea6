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

"""The family PLC-3, as it is registered in ``families``."""

from __future__ import annotations

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.family import Family
from abdf1_ros.pccc.plc3 import identity
from abdf1_ros.pccc.plc3.address import ADDRESSING
from abdf1_ros.pccc.plc3.dialect import PLC3
from abdf1_ros.pccc.plc3.server import Plc3Commands
from abdf1_ros.pccc.plc3.status import MEANINGS

FAMILY = Family(
    ADDRESSING, {Access.WORD_RANGE: PLC3},
    Plc3Commands, identity.decode, identity.encode, MEANINGS)
