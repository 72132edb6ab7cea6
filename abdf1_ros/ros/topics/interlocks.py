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

"""
Watch the executor and the publishers for heartbeats and fallbacks: only the node can do so.

docs/heartbeats.md has the numbered rules.
"""

from __future__ import annotations

import math

from abdf1_ros.driver.driver import Driver
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ros.diagnostics.graph import UNKNOWN_NODE
from abdf1_ros.ros.topics.publishers import count_publishers, publisher_names
from abdf1_ros.text import first
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.timer import Timer

# Seconds between two signs of life of the executor: well within the shortest heartbeat period.
_LIFE_SIGN_PERIOD = 0.1

# Seconds between two counts of the publishers to topics with a Fallback.
_COUNT_PERIOD = 2.0

# Seconds in which the name of a new publisher mostly becomes known.
_NAMES_COME = 1.0


class InterlockWatch:
    """
    Watches the executor and the publishers for a driver with heartbeats or fallbacks.

    A timer in the executor proves to the link that the executor runs. It exists only where the map
    has heartbeats.
    """

    def __init__(self, node: Node, driver: Driver) -> None:
        self._node = node
        self._kernel = driver.kernel
        self._next_look = 0.0
        self._crowded: tuple[str, ...] = ()
        self._refusing: dict[str, float] = {}  # topics, and since when (clock value in s)
        rows = [row.mapping for row in self._kernel.rows.fallbacks]
        self._single = {row.topic for row in rows if row.single_publisher}
        self._counted = {row.topic: None for row in rows if row.topic not in self._single}
        self._timer: Timer | None = None
        self._report_executor()
        if self._kernel.rows.heartbeats:
            # The node's clock may be simulated and stand still, so the timer has a clock of its
            # own.
            self._timer = node.create_timer(
                _LIFE_SIGN_PERIOD, self._report_executor,
                clock=Clock(clock_type=ClockType.STEADY_TIME))

    def end(self) -> None:
        """End the timer."""
        if self._timer is not None:
            self._node.destroy_timer(self._timer)

    def _report_executor(self) -> None:
        """Tell the driver that the executor runs (rule 3 c)."""
        self._kernel.executor_ran(line_time())

    def look(self, now: float) -> tuple[str, ...]:
        """
        Return the topics of Fallback rows with two or more publishers and callers (rule 17).

        Between two counts it returns the last result. Topics with Single_Publisher are left out.
        """
        if now >= self._next_look:
            self._next_look = now + _COUNT_PERIOD
            self._crowded = tuple(
                topic for topic in self._counted if count_owners(self._node, topic) > 1)
        return self._crowded

    def refusing(self, now: float) -> dict[str, str]:
        """Return the topics whose publishers are refused, with their names (rule 28)."""
        crowds = self._kernel.rows.conditions.crowds
        topics = [topic for topic in self._single
                  if topic in crowds and crowds[topic].until == math.inf]
        self._refusing = {topic: self._refusing.get(topic, now) for topic in topics}
        names = {topic: publisher_names(self._node, topic) for topic in topics}
        return {topic: first(found) for topic, found in names.items()
                if UNKNOWN_NODE not in found or now >= self._refusing[topic] + _NAMES_COME}


def count_owners(node: Node, topic: str) -> int:
    """Return the number of publishers to a write topic, plus the number of callers of ~/set."""
    return count_publishers(node, topic) + node.count_clients(
        node.resolve_service_name(f'~/set/{topic}'))
