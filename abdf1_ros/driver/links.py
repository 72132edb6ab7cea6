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

"""The settings of a driver, and the machine that its link runs on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from abdf1_ros.counters import Counters
from abdf1_ros.df1.machine import Background, Machine, Procedure
from abdf1_ros.df1.mode import LineMode
from abdf1_ros.df1.settings import LinkOptions, LinkSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverSettings(LinkOptions):
    """Settings of a driver that are not in the net CSV; times in seconds."""

    default_period: float = 0.1
    """Between two reads of a row without Period."""

    stale_after: float = 3.0
    """A value is stale when it is older than so many periods."""

    write_timeout: float = 2.0
    """A message that waits for longer is not sent any more."""

    read_only: bool = False
    """Nothing is written to a PLC."""

    processor_period: float = 0.0
    """Between two questions for the diagnostic status of a station, 0 for never."""

    first_tns: int = 0
    """
    The first transaction number. It should be random: a station could take the first command of a
    restarted driver for a duplicate.
    """


def make_machine(mode: LineMode, line: LinkSettings, run: Callable[[], Procedure],
                 counters: Counters, background: Background | None = None) -> Machine:
    """Return the machine for a line, with ``run`` as its procedure."""
    return Machine(
        lambda machine: run(), checksum=line.checksum, duplex=mode.duplex, timing=line.timing,
        counters=counters, forget_on_send=mode.is_master, background=background)
