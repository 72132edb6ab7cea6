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
    """Between two reads of a row without Period."""

    stale_after: float = USUAL_STALE_AFTER
    """A value is stale when it is older than so many periods."""

    write_timeout: float = 2.0
    """A message that waits for longer is not sent any more."""

    may_store: bool = False
    """The port may store what is sent: a device server, while another client has its line."""

    read_only: bool = False
    """Nothing is written to a PLC."""

    processor_period: float = 0.0
    """Between two questions for the diagnostic status of a station, 0 for never."""

    first_tns: int = 0
    """
    The first transaction number. It should be random: a station could take the first command of a
    restarted driver for a duplicate.
    """
