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
What the node adds to heartbeats and fallback values: the executor, and other publishers.

The numbers of rules are those of docs/heartbeats.md.
"""

from __future__ import annotations

from abdf1_ros.driver.driver import Driver
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ros.topics.writes import count_publishers
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.timer import Timer

# How often (s) the executor tells that it runs: well within the shortest period of a heartbeat.
_LIFE_SIGN = 0.1

# How often (s) publishers to topics with a Fallback are counted.
_LOOK = 2.0


class InterlockWatch:
    """
    Watches over the heartbeats and fallbacks of a driver.

    The timer by which the link knows of the executor exists only while there are heartbeats.
    """

    def __init__(self, node: Node, driver: Driver) -> None:
        self._node = node
        self._interlocks = driver.interlocks
        self._next_look = 0.0
        self._crowded: tuple[str, ...] = ()
        self._timer: Timer | None = None
        self._tell()
        if self._interlocks.heartbeats:
            # Not the node's clock, which may be a simulated one that stands still.
            self._timer = node.create_timer(
                _LIFE_SIGN, self._tell, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def end(self) -> None:
        """End the timer."""
        if self._timer is not None:
            self._node.destroy_timer(self._timer)

    def _tell(self) -> None:
        """Tell the driver that the executor runs (rule 3 c)."""
        self._interlocks.executor_ran(line_time())

    def look(self, now: float) -> tuple[str, ...]:
        """
        Return the topics of Fallback rows that two or more publishers and callers feed (rule 17).

        They are counted every now and then.
        """
        if now >= self._next_look:
            self._next_look = now + _LOOK
            topics = dict.fromkeys(row.mapping.topic for row in self._interlocks.fallbacks)
            self._crowded = tuple(
                topic for topic in topics if count_owners(self._node, topic) > 1)
        return self._crowded


def count_owners(node: Node, topic: str) -> int:
    """Return how many publishers a write topic has, and callers its ~/set."""
    return count_publishers(node, topic) + node.count_clients(
        node.resolve_service_name(f'~/set/{topic}'))
