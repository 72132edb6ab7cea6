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

"""All statuses of a node on /diagnostics."""

from __future__ import annotations

from collections.abc import Sequence

from abdf1_ros.driver.driver import Driver
from abdf1_ros.problems import Problem
from abdf1_ros.ros.diagnostics.events import LineEvents
from abdf1_ros.ros.diagnostics.guests import GuestsStatus
from abdf1_ros.ros.diagnostics.interlocks import InterlockStatus
from abdf1_ros.ros.diagnostics.line import LineView
from abdf1_ros.ros.diagnostics.link import CountersStatus, LinkStatus
from abdf1_ros.ros.diagnostics.mappings import MappingsStatus
from abdf1_ros.ros.diagnostics.standby import StandbyStatus
from abdf1_ros.ros.diagnostics.stations import StationStatus
from abdf1_ros.ros.diagnostics.status import message_of, Status, WORDS
from abdf1_ros.ros.diagnostics.topics import TopicsStatus
from abdf1_ros.share.guest_line import GuestPlace
from diagnostic_msgs.msg import DiagnosticStatus


class Diagnostics:
    """
    All statuses of one node, named ``<node>: <status>``.

    - ``node_name``: the full name, so that equal names in two namespaces stay apart
    - ``events``: the listener of the driver
    - ``left_out``: faults of the rows that were left out of the map
    - ``guests``: the places of other programs
    - ``alarms``: the statuses of rows with an alarm
    """

    def __init__(self, node_name: str, driver: Driver, port: str,
                 events: LineEvents, left_out: Sequence[Problem] = (),
                 guests: Sequence[GuestPlace] = (), alarms: Sequence[Status] = ()) -> None:
        self._node_name = node_name
        seen = events.seen
        self.line = LineView(driver)
        self.counters = CountersStatus(self.line, port)
        self._statuses: list[Status] = [
            LinkStatus(self.line, port, seen), self.counters,
            *(StationStatus(self.line, station, port, seen) for station in driver.stations),
            MappingsStatus(driver, port, left_out), events.writes, TopicsStatus(port, seen),
            *alarms]
        if driver.kernel.rows.heartbeats or driver.kernel.rows.fallbacks:
            self._statuses.append(InterlockStatus(self.line, port, seen))
        if guests:
            self._statuses.append(GuestsStatus(guests, port))
        self._waiting: list[Status] = [StandbyStatus(self.line, port, seen)]

    def levels(self, now: float, *, is_waiting: bool = False) -> list[bytes]:
        """Return the level of each status; a waiting spare has only the status ``standby``."""
        return [status.judge(now)[0] for status in self._shown(is_waiting)]

    def statuses(self, now: float, *, is_waiting: bool = False) -> list[DiagnosticStatus]:
        """Return each status; a waiting spare has only the status ``standby``."""
        return [self._message(status, now) for status in self._shown(is_waiting)]

    def _shown(self, is_waiting: bool) -> Sequence[Status]:
        return self._waiting if is_waiting else self._statuses

    def _message(self, status: Status, now: float) -> DiagnosticStatus:
        level, text = status.judge(now)
        return message_of(f'{self._node_name}: {status.name}', level, f'{WORDS[level]}: {text}',
                          status.hardware_id, status.values(now))
