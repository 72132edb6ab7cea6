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

"""Publishers that a bridge offers only while it has the line, in the moment when it loses it."""

from collections import deque
from typing import Any

from abdf1_ros.ros.bridge.offer import OfferedPublisher
import pytest
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import QoSProfile
from std_msgs.msg import UInt8


class LostPublisher:
    """A publisher that another thread has closed."""

    def publish(self, message: object) -> None:
        raise rclpy_implementation.InvalidHandle('closed')

    def get_subscription_count(self) -> int:
        raise rclpy_implementation.InvalidHandle('closed')


class StandInNode:
    """A node that makes such publishers."""

    def create_publisher(self, *arguments: object) -> LostPublisher:
        return LostPublisher()

    def destroy_publisher(self, publisher: object) -> None:
        """Do nothing."""


class LosingPublisher(OfferedPublisher):
    """An offer that ends between the look of the link thread and its publishing."""

    is_losing = False

    def _publish_waiting(self) -> None:
        if self.is_losing:
            self.is_losing = False
            self.withdraw()
        super()._publish_waiting()


@pytest.fixture
def offered() -> LosingPublisher:
    node: Any = StandInNode()
    publisher = LosingPublisher(node, UInt8, '~/a', QoSProfile(depth=1), most=1)
    publisher.offer()
    return publisher


def test_message_that_meets_the_loss_of_the_line_is_no_error(offered: LosingPublisher) -> None:
    offered.is_losing = True
    offered.publish(UInt8())
    assert not offered.is_losing


def test_message_that_another_thread_has_taken_is_no_error(offered: LosingPublisher) -> None:
    class Raced(deque[UInt8]):

        def __bool__(self) -> bool:
            return True  # as the thread saw it a moment ago

    offered.waiting = Raced()
    offered.offer()


def test_closed_publisher_has_no_subscribers(offered: LosingPublisher) -> None:
    assert not offered.has_subscribers()
