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
Write topics: from a message to the driver, and what DDS has dropped before it came to us.

Messages are numbered by their publisher (Fast DDS does it, others may not). Where a number is
missing, a message was dropped: the executor was slower than the publisher, and the history of
either end was full. There is no other sign: Fast DDS 2.14 has no message-lost event for it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
import math
import time
from typing import Any, Protocol

from abdf1_ros.driver.driver import Driver, TOO_MANY
from abdf1_ros.driver.writes.ages import Ages, most_ahead, Standstills
from abdf1_ros.driver.writes.queue import MAX_WAITING_WRITES
from abdf1_ros.errors import FormatError
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ros.callbacks import AnsweringNode
from abdf1_ros.ros.topics.messages import MESSAGES, values_of, write_qos
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.text import printable
from rclpy.node import Node
from std_msgs.msg import String

_LONGEST_LABEL = 100

# A clock that is ahead is reported every so many seconds at most.
_LOOK = 2.0

# Publishers of one topic whose numbers are followed at a time.
_MOST_PUBLISHERS = 16


class LossCounter:
    """
    Tell how many messages of a topic never came.

    rclpy does not tell the publisher of a number. A number that follows the last one of a known
    publisher belongs to that publisher. Otherwise it belongs to a new one, as long as
    ``count_publishers`` gives more than are known. Otherwise messages before it were lost.
    """

    def __init__(self, count_publishers: Callable[[], int]) -> None:
        self._count_publishers = count_publishers
        self._latest: list[int] = []  # number of the latest message of each publisher

    def lost_before(self, number: int | None) -> int:
        """Take the number of a message, None where it has none; return the number of lost ones."""
        if number is None:
            return 0
        latest = self._latest
        if number - 1 in latest:
            latest[latest.index(number - 1)] = number
            return 0
        earlier = [other for other in latest if other < number]
        if not earlier or len(latest) < self._count_publishers():
            if len(latest) == _MOST_PUBLISHERS:
                del latest[0]
            latest.append(number)
            return 0
        nearest = max(earlier)
        latest[latest.index(nearest)] = number
        return number - nearest - 1


def _request(message: Any, info: Any) -> str:
    """
    Return the name of a message for its result, different from all others of its topic.

    That is the label which its publisher has put into the layout, or else the time when it was
    published (ns): rclpy does not tell the publisher.
    """
    if not isinstance(message, String) and message.layout.dim and message.layout.dim[0].label:
        return printable(message.layout.dim[0].label[:_LONGEST_LABEL])
    return str(info['source_timestamp'] or '')


class WriteTopicListener(Protocol):
    """Gets what is wrong with the messages of a topic."""

    def lost(self, topic: str, count: int) -> None:
        """Take note that so many messages were dropped on their way to us."""

    def ahead(self, topic: str, seconds: float, nodes: Sequence[str]) -> None:
        """Take note that the clock of a node that publishes is ahead of ours by so much."""


class WriteTopic:
    """
    The mappings that one topic writes to; ``take`` is the callback of its subscription.

    ``listener`` gets what is wrong: messages that were dropped on their way to us, and nodes among
    ``publishers`` with a clock that is ahead. ``wake`` is called when the link has something to
    do. What is too old by its ``ages`` is refused.
    """

    def __init__(self, topic: str, mappings: Sequence[Mapping], driver: Driver, ages: Ages,
                 *, losses: LossCounter, listener: WriteTopicListener,
                 publishers: Callable[[], Sequence[str]], wake: Callable[[], None]) -> None:
        self._topic = topic
        self._mappings = mappings
        self._driver = driver
        self._ages = ages
        self._losses = losses
        self._listener = listener
        self._publishers = publishers
        self._wake = wake
        self._next_ahead = -math.inf

    def arrived(self, info: Any) -> None:
        """Tell what was lost before a message that has come."""
        if lost := self._losses.lost_before(info['publication_sequence_number']):
            self._listener.lost(self._topic, lost)

    def take(self, message: Any, info: Any, reject_reason: str = '') -> None:
        """Write a message to every mapping of the topic, or refuse it for a ``reject_reason``."""
        now, wall = line_time(), time.time_ns() / 1e9
        stamps = [stamp / 1e9 for stamp in (
            info['source_timestamp'], info['received_timestamp']) if stamp]
        request = _request(message, info)
        try:
            if reject_reason:
                raise FormatError(reject_reason)
            # It may have waited while this process was paused or the network was down.
            waited = self._ages.of(stamps, wall, now)
            values = values_of(message)
        except FormatError as error:
            self._driver.refuse(self._mappings, str(error), message.data, request)
        else:
            self._driver.write(self._mappings, values, now - waited, request)
            self._wake()
        if self._ages.is_ahead and now >= self._next_ahead:
            self._next_ahead = now + _LOOK
            self._listener.ahead(self._topic, self._ages.lead, self._publishers())


class WriteTopics:
    """
    The subscriptions of a node; ``open`` may be called again, in the thread of the executor.

    Messages wait here until ``begin``, and go where ``give_to`` says; ``taken`` counts those.
    ``standstills`` is to look ten times a second.
    """

    def __init__(self, node: AnsweringNode) -> None:
        self._node = node
        self._waiting: list[tuple[str, Any, Any]] = []
        self._has_begun = self._is_open = False
        self._subscriptions: dict[str, tuple[Any, Any]] = {}
        self._topics: dict[str, WriteTopic] = {}
        self.standstills = Standstills()
        self.taken = 0

    def begin(self) -> None:
        """Have messages taken from now on, those that wait first; may be called in any thread."""
        if not self._has_begun and self._node.executor is not None:
            self._has_begun = True
            self._node.executor.create_task(self._take_waiting)

    def _take_waiting(self) -> None:
        waiting, self._waiting = self._waiting, []
        self._is_open = True
        for topic, message, info in waiting:
            self.taken += 1
            try:
                if topic in self._topics:  # a reload may have taken its rows away
                    self._topics[topic].take(message, info)
            except Exception as error:  # the others are taken
                self._node.tell_failure(f'a message on {_name(topic)}', error)

    def open(self, driver: Driver, patience: float,  # noqa: A003
             listener: WriteTopicListener, wake: Callable[[], None]) -> dict[str, WriteTopic]:
        """Subscribe to the topics of a driver, and return them; subscriptions that are, stay."""
        wanted: defaultdict[str, list[Mapping]] = defaultdict(list)
        for mapping in driver.mappings:
            if mapping.writes:
                wanted[mapping.topic].append(mapping)
        kinds = {topic: MESSAGES[mappings[0].message_type] for topic, mappings in wanted.items()}
        for topic, (kind, subscription) in [*self._subscriptions.items()]:
            if kinds.get(topic) is not kind:
                self._node.destroy_subscription(subscription)
                del self._subscriptions[topic]
        for topic, kind in kinds.items():
            if topic not in self._subscriptions:
                self._subscriptions[topic] = kind, self._subscription(topic, kind)
        return {topic: WriteTopic(
            topic, mappings, driver,
            Ages(patience, self.standstills, most_ahead(topic, driver.mappings)),
            listener=listener, publishers=partial(self._publishers, topic), wake=wake,
            losses=LossCounter(partial(count_publishers, self._node, topic)))
            for topic, mappings in wanted.items()}

    def withdraw(self) -> None:
        """Close all subscriptions."""
        self._topics = {}
        for _, subscription in self._subscriptions.values():
            self._node.destroy_subscription(subscription)
        self._subscriptions.clear()

    def give_to(self, topics: dict[str, WriteTopic]) -> None:
        """Give messages to these from now on."""
        self._topics = topics

    def _publishers(self, topic: str) -> list[str]:
        return [f'{end.node_namespace.rstrip("/")}/{end.node_name}'
                for end in self._node.get_publishers_info_by_topic(_name(topic))]

    def take(self, topic: str, message: Any, info: Any) -> None:
        """Take a message, in the thread of the executor."""
        self._topics[topic].arrived(info)
        reject_reason = '' if self._is_open else TOO_MANY
        if reject_reason and len(self._waiting) < MAX_WAITING_WRITES:
            self._waiting.append((topic, message, info))
            return
        self.taken += 1
        self._topics[topic].take(message, info, reject_reason)

    def _subscription(self, topic: str, kind: Any) -> Any:
        callback: Any = partial(self.take, topic)
        return self._node.create_subscription(kind, _name(topic), callback, write_qos())


def count_publishers(node: Node, topic: str) -> int:
    """Return how many publishers a write topic has; rclpy does not remap what it is asked."""
    return node.count_publishers(node.resolve_topic_name(_name(topic)))


def _name(topic: str) -> str:
    return f'~/write/{topic}'
