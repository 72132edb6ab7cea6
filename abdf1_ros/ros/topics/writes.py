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
Write topics: hand messages to the driver, and notice messages that DDS has dropped.

With Fast DDS, a publisher numbers its messages; another DDS may not. If a number is missing, a
message was dropped: the executor was slower than the publisher, and a queue was full. A missing
number is the only sign: Fast DDS 2.14 has no message-lost event for this case.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
import math
import time
from typing import Protocol

from abdf1_ros.ages import Ages, HostClock, most_ahead, RecentMax, REMEMBERED
from abdf1_ros.driver.driver import Driver, TOO_MANY
from abdf1_ros.driver.kernel.own import Crowd
from abdf1_ros.driver.kernel.waiting import MAX_WAITING_WRITES
from abdf1_ros.errors import FormatError
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ros.callbacks import AnsweringNode
from abdf1_ros.ros.topics.messages import MESSAGES, values_of, write_qos
from abdf1_ros.ros.topics.publishers import (
    count_publishers,
    full_name,
    publisher_names,
    PublisherWatch,
)
from abdf1_ros.ros.untyped import MessageInfo, RosMessage
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.text import printable
from rclpy.subscription import Subscription
from std_msgs.msg import String

_LONGEST_LABEL = 1000  # the full name of a node has up to 255 characters

# Shortest time (s) between two reports of a clock that is ahead.
_REPORT_PERIOD = 2.0

# Most publishers of one topic whose message numbers are followed.
_MOST_PUBLISHERS = 16


class LossCounter:
    """
    Counts the lost messages of a topic.

    rclpy shows the number of a message, but not its publisher. We decide in this order:

    - The number follows the last number of a known publisher: the message is from this publisher.
    - All known numbers are higher, or ``count_publishers`` gives more publishers than are known:
      the message is from a new publisher.
    - Otherwise: it is from the publisher with the nearest lower number, and all messages between
      were lost.
    """

    def __init__(self, count_publishers: Callable[[], int]) -> None:
        self._count_publishers = count_publishers
        self.latest: list[int] = []  # number of the latest message of each publisher

    def lost_before(self, number: int | None) -> int:
        """Record a message's number (None: it has none); return how many were lost before it."""
        if number is None:
            return 0
        latest = self.latest
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


def _request(message: RosMessage, info: MessageInfo) -> str:
    """
    Return the text that identifies a message in its result.

    This is the label in the message's layout, if the publisher has set one. Otherwise it is the
    time of publication (ns), because rclpy does not show the publisher.
    """
    if not isinstance(message, String) and message.layout.dim and message.layout.dim[0].label:
        return printable(message.layout.dim[0].label[:_LONGEST_LABEL])
    return str(info['source_timestamp'] or '')


class WriteTopicListener(Protocol):
    """Is called when something is wrong with the messages of a topic."""

    def lost(self, topic: str, count: int) -> None:
        """Report ``count`` messages that DDS has dropped."""

    def ahead(self, topic: str, seconds: float, nodes: Sequence[str]) -> None:
        """Report that the clock of a publisher among ``nodes`` is ahead by ``seconds``."""


class WriteTopic:
    """
    The mappings that one topic writes to; ``take`` handles one message.

    - ``ages``: finds the age of a message; a message that is too old is refused
    - ``listener``: is called for lost messages, and for publishers whose clock is ahead
    - ``publishers``: returns the names of the nodes that publish now
    - ``wake``: is called when the link has something to do
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

    def crowd(self, crowd: Crowd) -> None:
        """Tell the driver that the topic has, or had, more than one publisher (rule 28)."""
        self._driver.kernel.crowd(self._topic, crowd)
        self._wake()

    def arrived(self, info: MessageInfo) -> None:
        """Report the messages that were lost before this message."""
        if lost := self._losses.lost_before(info['publication_sequence_number']):
            self._listener.lost(self._topic, lost)

    def take(self, message: RosMessage, info: MessageInfo, reject_reason: str = '') -> None:
        """Write a message to every mapping of the topic, or refuse it for a ``reject_reason``."""
        now, wall = line_time(), time.time_ns() / 1e9
        stamps = [stamp / 1e9 for stamp in (
            info['source_timestamp'], info['received_timestamp']) if stamp]
        request = _request(message, info)
        try:
            if reject_reason:
                raise FormatError(reject_reason)
            # The message may have waited while this process was paused or the network was down.
            waited = self._ages.of(stamps, wall, now)
            values = values_of(message)
        except FormatError as error:
            self._driver.refuse(self._mappings, str(error), message.data, request)
        else:
            self._driver.write(self._mappings, values, now - waited, request)
            self._wake()
        if self._ages.is_ahead and now >= self._next_ahead:
            self._next_ahead = now + _REPORT_PERIOD
            self._listener.ahead(self._topic, self._ages.lead, self._publishers())


class WriteTopics:
    """
    The subscriptions of a node; all methods but ``begin`` run in the executor's thread.

    Messages wait here until ``begin``; then they go to the topics set by ``give_to``. ``open`` may
    be called again at a reload. ``taken`` counts the messages handed on. The owner calls
    ``host_clock.look`` ten times a second.
    """

    def __init__(self, node: AnsweringNode) -> None:
        self._node = node
        self._waiting: list[tuple[str, RosMessage, MessageInfo, bool]] = []
        self._has_begun = self.is_open = False
        self._subscriptions: dict[str, tuple[type, Subscription | PublisherWatch]] = {}
        self._topics: dict[str, WriteTopic] = {}
        # Stamp and number of the latest messages of each topic; a busy topic drives out no other.
        self.latest: defaultdict[str, dict[tuple[int, int], None]] = defaultdict(dict)
        self.host_clock = HostClock(0.0)  # open knows better
        self._leads = defaultdict[str, RecentMax](partial(RecentMax, REMEMBERED))  # of topics
        self.taken = 0

    def begin(self) -> None:
        """Hand messages on from now on, waiting ones first; may be called in any thread."""
        if not self._has_begun and self._node.executor is not None:
            self._has_begun = True
            self._node.executor.create_task(self._take_waiting)

    def _take_waiting(self) -> None:
        waiting, self._waiting = self._waiting, []
        self.is_open = True
        for topic, message, info, is_call in waiting:
            self.taken += 1
            try:
                if topic in self._topics:  # a reload may have removed its rows
                    self._topics[topic].take(message, info, self._why_refused(topic, is_call))
            except Exception as error:  # go on with the other messages
                self._node.tell_failure(f'a message on {full_name(topic)}', error)

    def open(self, driver: Driver, patience: float,  # noqa: A003
             listener: WriteTopicListener, wake: Callable[[], None]) -> dict[str, WriteTopic]:
        """Subscribe to a driver's topics and return them; keep existing subscriptions."""
        self.host_clock.offsets.seconds = patience
        wanted: defaultdict[str, list[Mapping]] = defaultdict(list)
        for mapping in driver.mappings:
            if mapping.writes:
                wanted[mapping.topic].append(mapping)
        kinds = {topic: MESSAGES[mappings[0].message_type] for topic, mappings in wanted.items()}
        single = {topic for topic, mappings in wanted.items()
                  if any(mapping.single_publisher for mapping in mappings)}
        for topic, (kind, subscription) in [*self._subscriptions.items()]:
            if kinds.get(topic) is not kind \
                    or isinstance(subscription, PublisherWatch) is not (topic in single):
                self._unsubscribe(topic)
        for topic, kind in kinds.items():
            if topic not in self._subscriptions:
                self._subscriptions[topic] = kind, self._subscribe(
                    topic, kind, is_single=topic in single)
        return {topic: WriteTopic(
            topic, mappings, driver,
            Ages(patience, self.host_clock, most_ahead(topic, driver.mappings),
                 self._leads[topic]),
            listener=listener, publishers=partial(publisher_names, self._node, topic), wake=wake,
            losses=LossCounter(partial(count_publishers, self._node, topic)))
            for topic, mappings in wanted.items()}

    def withdraw(self) -> None:
        """Close all subscriptions."""
        for topic in [*self._subscriptions]:
            self._unsubscribe(topic)
        self._topics = {}

    def give_to(self, topics: dict[str, WriteTopic]) -> None:
        """Hand messages to these topics from now on."""
        self._topics = topics
        for topic in topics:
            if (watch := self._watch(topic)) and (crowd := watch.living.crowd):
                self._crowd(topic, crowd)

    def take(self, topic: str, message: RosMessage, info: MessageInfo, *,
             is_call: bool = False) -> None:
        """
        Count messages lost before a message; then hand it on, let it wait, or refuse it.

        ``is_call``: the message is a call of ~/set.
        """
        if self._came_before(topic, info):
            return
        self._topics[topic].arrived(info)
        if not self.is_open and len(self._waiting) < MAX_WAITING_WRITES:
            self._waiting.append((topic, message, info, is_call))
            return
        self.taken += 1
        self._topics[topic].take(message, info, self._why_refused(topic, is_call))

    def _why_refused(self, topic: str, is_call: bool) -> str:
        """Return why a message is refused without a look at it, empty if it is not."""
        if not self.is_open:
            return TOO_MANY
        if (watch := self._watch(topic)) is None:
            return ''
        watch.living.ask_names_again()
        return watch.living.why_no_call if is_call else ''

    def _watch(self, topic: str) -> PublisherWatch | None:
        """Return the watch of a topic with Single_Publisher, None for other topics."""
        _, subscription = self._subscriptions.get(topic, (None, None))
        return subscription if isinstance(subscription, PublisherWatch) else None

    def _crowd(self, topic: str, crowd: Crowd) -> None:
        if topic in self._topics:
            self._topics[topic].crowd(crowd)

    def _came_before(self, topic: str, info: MessageInfo) -> bool:
        """
        Record a message; return True if DDS has delivered it before.

        DDS does so after a cut of the network, because the reader then treats the publisher as
        new. The publisher repeats all messages that were not acknowledged before the cut.
        Messages of two publishers differ in the time stamp, which counts nanoseconds.
        """
        stamp, number = info['source_timestamp'], info['publication_sequence_number']
        if not stamp or number is None:
            return False
        latest = self.latest[topic]
        came_before = (stamp, number) in latest
        latest[stamp, number] = None
        if len(latest) > MAX_WAITING_WRITES:
            del latest[next(iter(latest))]
        return came_before

    def _subscribe(self, topic: str, kind: type, *,
                   is_single: bool) -> Subscription | PublisherWatch:
        callback: Callable[..., None] = partial(self.take, topic)
        if is_single:
            return PublisherWatch(self._node, kind, topic, callback, partial(self._crowd, topic))
        return self._node.create_subscription(kind, full_name(topic), callback, write_qos())

    def _unsubscribe(self, topic: str) -> None:
        _, subscription = self._subscriptions.pop(topic)
        if isinstance(subscription, PublisherWatch):
            subscription.end()
        else:
            self._node.destroy_subscription(subscription)
