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
Publishers that a bridge offers only while it has the line.

Two bridges with the same name on two hosts may wait for one line. If the waiting bridge had topics
and services, they would answer in place of the active bridge.
"""

from __future__ import annotations

from collections import deque
from contextlib import suppress

from abdf1_ros.ros.untyped import RosMessage
from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile


class OfferedPublisher:
    """
    A publisher that exists only while the bridge offers it.

    Without a publisher, the last ``most`` messages wait, because the bridge notices a moment late
    that it has the line. Any thread may call ``publish``; only the executor's thread may call
    ``offer`` and ``withdraw``.
    """

    def __init__(self, node: Node, kind: type, topic: str, qos: QoSProfile | int,
                 most: int) -> None:
        self._node = node
        self._make = kind, topic, qos
        self.waiting: deque[RosMessage] = deque(maxlen=most)
        self._publisher: Publisher | None = None

    def offer(self) -> None:
        """Make the publisher, and publish the waiting messages."""
        self._publisher = self._node.create_publisher(*self._make)
        self._publish_waiting()

    def withdraw(self) -> None:
        """Close the publisher and drop waiting messages: the bridge has lost the line."""
        publisher, self._publisher = self._publisher, None
        if publisher is not None:
            self._node.destroy_publisher(publisher)
        self.waiting.clear()

    def publish(self, message: RosMessage) -> None:
        """Publish a message now, or keep it until the publisher exists."""
        self.waiting.append(message)
        self._publish_waiting()

    def _publish_waiting(self) -> None:
        if (publisher := self._publisher) is None:
            return
        # Another thread may have taken the last message, or have closed the publisher.
        with suppress(IndexError, rclpy_implementation.InvalidHandle):
            while True:
                publisher.publish(self.waiting.popleft())

    def has_subscribers(self) -> bool:
        """Return True if there is a subscriber."""
        publisher = self._publisher  # the executor's thread may withdraw it meanwhile
        with suppress(rclpy_implementation.InvalidHandle):
            return publisher is not None and publisher.get_subscription_count() > 0
        return False

    def wait_for_all_acked(self, patience: float) -> None:
        """Wait until all subscribers have all messages, at most ``patience`` s."""
        if (publisher := self._publisher) is not None:
            publisher.wait_for_all_acked(Duration(seconds=patience))
