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

"""The settings of a driver."""

from __future__ import annotations

from dataclasses import dataclass

from abdf1_ros.df1.settings import LinkOptions
from abdf1_ros.plan.forecast import USUAL_STALE_AFTER


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverSettings(LinkOptions):
    """Settings of a driver that are not in the net CSV; times in seconds."""

    default_period: float = 0.1
    """Seconds between two reads of a row without Period."""

    stale_after: float = USUAL_STALE_AFTER
    """Number of periods after which a value is stale."""

    write_timeout: float = 2.0
    """Seconds that a message may wait; after that it is not sent."""

    may_store: bool = False
    """True if the port may store bytes: a device server, while another client has its line."""

    read_only: bool = False
    """True if nothing may be written to a PLC."""

    processor_period: float = 0.0
    """Seconds between two questions for the diagnostic status of a station; 0 for never."""

    first_tns: int = 0
    """
    The first transaction number. It should be random: after a restart of the driver a station may
    take the first command for a duplicate.
    """
