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


"""When statuses and the snapshot of all values are published."""

from __future__ import annotations

import random

from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.ros.bridge.offer import OfferedPublisher
from abdf1_ros.ros.diagnostics.alarms import Alarms
from abdf1_ros.ros.diagnostics.statuses import Diagnostics
from abdf1_ros.ros.parameters.declared import Parameters
from abdf1_ros.ros.topics.snapshot import Snapshot
from abdf1_ros.ros.untyped import RosPublisher
from abdf1_ros.settings.mapping import Mapping
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node


class StatusPublisher:
    """
    Publish the statuses of a session and the snapshot of its values.

    - ``publisher``: of statuses; ``snapshot``: of values
    - ``levels``: the level of each status as published last
    - ``next_publication``: clock value (s) from which the statuses are due
    """

    def __init__(self, node: Node, publisher: RosPublisher, snapshot: OfferedPublisher,
                 parameters: Parameters, diagnostics: Diagnostics, alarms: Alarms,
                 points: dict[Mapping, ReadPoint]) -> None:
        self.levels: list[bytes] = []
        self.next_publication = self._next_snapshot = 0.0
        self._node = node
        self._publisher = publisher
        self._snapshot_publisher = snapshot
        self._parameters = parameters
        self._diagnostics = diagnostics
        self._alarms = alarms
        self._points = points
        self._snapshot: Snapshot | None = None
        # A random start, so that the nodes of a process do not publish all at the same moment.
        self._phase = random.uniform(0.0, parameters.diagnostics_period)

    def look(self, now: float, *, is_waiting: bool) -> None:
        """Publish what is due, and the statuses if a level has changed."""
        levels = self._diagnostics.levels(now, is_waiting=is_waiting)
        if now >= self.next_publication or levels != self.levels:
            self.levels = levels
            self.publish(now, is_waiting=is_waiting)
        self._publish_snapshot(now)

    def publish(self, now: float, *, is_waiting: bool) -> None:
        """Publish all statuses at the clock value ``now`` (s), of a spare that waits only one."""
        period = self._parameters.diagnostics_period
        self.next_publication = now + period - (now - self._phase) % period
        statuses = self._diagnostics.statuses(now, is_waiting=is_waiting)
        if not is_waiting:
            self._alarms.forget()
        self._send(self._publisher, DiagnosticArray(status=statuses))

    def _publish_snapshot(self, now: float) -> None:
        """Publish all values if it is time and there is a subscriber."""
        period = self._parameters.snapshot_period
        if not period or now < self._next_snapshot:
            return
        self._next_snapshot = now + period
        if self._snapshot_publisher.has_subscribers():
            self._snapshot = self._snapshot or Snapshot(self._points)
            self._send(self._snapshot_publisher, self._snapshot.message(now))

    def _send(self, publisher: RosPublisher, message: DiagnosticArray) -> None:
        # While simulated time is 0, use system time: otherwise this message would sort before all
        # earlier messages.
        now = self._node.get_clock().now()
        stamped = now if now.nanoseconds else Clock(clock_type=ClockType.SYSTEM_TIME).now()
        message.header.stamp = stamped.to_msg()
        publisher.publish(message)
