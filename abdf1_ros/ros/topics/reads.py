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

"""The read topics of one map: one publisher for each, kept if the next map has the same row."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from collections.abc import Mapping as MappingType
from contextlib import suppress
from dataclasses import dataclass
from operator import attrgetter

from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.pccc.values import Values
from abdf1_ros.ros.topics.messages import encoder, MESSAGES, read_qos
from abdf1_ros.ros.untyped import RosMessage
from abdf1_ros.settings.mapping import Mapping
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.publisher import Publisher

# Number of values published at once, while the ACK (two characters) is on the line. All other
# values of a reply are published during the next command, because a hundred values would delay the
# line by 3 ms.
_VALUES_AT_ONCE = 4

# A publisher is kept if the promises of the old and the new row differ by at most this factor. A
# deadline that is a little too short gives no false alarm.
_MARGIN = 1.5

# What decides where the values of a row come from, and what they mean: a late subscriber must not
# get the last value of another PLC, or one in another unit.
_SHAPE = attrgetter('message_type', 'address', 'length', 'station', 'via', 'serves', 'access',
                    'type', 'word_order', 'scaling', 'condition')


@dataclass(frozen=True, slots=True, eq=False)
class ReadTopic:
    """
    A publisher, with the properties of the row that it was made for.

    - ``encode``: turns values into a message
    - ``shape``: all that decides the values of the row, first their message type
    - ``promise``: longest time (s) between two values; infinite if the row promises none
    """

    publisher: Publisher
    encode: Callable[[Values], RosMessage | bytes]
    shape: tuple[object, ...]
    promise: float

    def is_fit_for(self, shape: tuple[object, ...], promise: float) -> bool:
        """Return True if a row can use this publisher and subscribers notice no difference."""
        return shape == self.shape and \
            self.promise / _MARGIN <= promise <= _MARGIN * self.promise


class ReadTopics:
    """
    The publishers of one map. The executor's thread makes them, the link thread publishes.

    At a reload, call ``open`` before the new driver runs, and ``take_over`` after the old driver
    has stopped. Publishers of the old map (``published``) are used again where they fit.
    ``line``: its ports and our own Station. Other ports may lead to other PLCs, and a PLC-5 has
    other words for each station that sends it PLC-2 commands.
    ``latest``: the last values of this connection, by topic.
    """

    def __init__(self, node: Node, published: dict[str, ReadTopic],
                 line: tuple[str, ...] = ()) -> None:
        self._node = node
        self._published = published
        self._line = line
        self._at_once = _VALUES_AT_ONCE
        self._later: deque[tuple[Publisher, RosMessage | bytes]] = deque()
        self.latest: dict[str, Values] = {}
        self._topics: dict[str, ReadTopic] = {}
        self._to_come: list[tuple[Mapping, ReadPoint]] = []

    def offer(self, points: MappingType[Mapping, ReadPoint]) -> None:
        """Make all publishers while the driver runs, and publish the values it has read so far."""
        self._to_come = list(points.items())
        self.take_over()

    def withdraw(self) -> None:
        """Close all publishers; the link may publish a value meanwhile, which is lost."""
        topics = dict(self._topics)
        self._topics.clear()
        self._to_come.clear()
        self._later.clear()
        self.latest.clear()
        self._close(topics, but=self._published)  # of an offer that has failed
        self._close(self._published, but={})
        self._published.clear()

    def _close(self, topics: dict[str, ReadTopic], but: dict[str, ReadTopic]) -> None:
        kept = set(but.values())
        for topic in topics.values():
            if topic not in kept:
                self._node.destroy_publisher(topic.publisher)

    def open(self, points: MappingType[Mapping, ReadPoint]) -> None:  # noqa: A003
        """
        Keep or make a publisher for each row that is read; some rows wait for ``take_over``.

        If a publisher cannot be made, the publishers of the old map remain alone.
        """
        try:
            for mapping, point in points.items():
                earlier = self._published.get(mapping.topic)
                # DDS allows one type for a topic, so the old publisher with another type has to
                # end first.
                if earlier is not None and earlier.shape[0] is not mapping.message_type:
                    self._to_come.append((mapping, point))
                else:
                    self._topics[mapping.topic] = self._topic(mapping, point, earlier)
        except Exception:
            self._close(self._topics, but=self._published)
            raise

    def take_over(self) -> None:
        """Close the unused publishers of the old map; then make the publishers that waited."""
        self._close(self._published, but=self._topics)
        for mapping, point in self._to_come:
            topic = self._topics[mapping.topic] = self._topic(mapping, point, None)
            published = None
            # Again if the link has published newer values meanwhile: the last ones are latched.
            # Not if a later read has failed or was withheld, as when the PLC went to PROGRAM.
            while (latest := self.latest.get(mapping.topic)) is not None \
                    and latest is not published and not (point.error or point.withheld):
                published = latest
                topic.publisher.publish(topic.encode(latest))
        self._to_come.clear()
        self._published.clear()
        self._published.update(self._topics)

    def _topic(self, mapping: Mapping, point: ReadPoint, old: ReadTopic | None) -> ReadTopic:
        shape = *_SHAPE(mapping), self._line
        promise = mapping.promise(point.stale_time)
        if old is not None and old.is_fit_for(shape, promise):
            return old
        # The default callbacks would cost time for every publisher at every turn of the executor.
        quiet = PublisherEventCallbacks(use_default_callbacks=False)
        publisher = self._node.create_publisher(
            MESSAGES[mapping.message_type], f'~/read/{mapping.topic}',
            read_qos(mapping, point.stale_time), event_callbacks=quiet)
        return ReadTopic(publisher, encoder(mapping), shape, promise)

    def read(self, mapping: Mapping, values: Values) -> None:
        """Publish the values of a good read: at once, or when the next command is on the line."""
        self.latest[mapping.topic] = values
        topic = self._topics.get(mapping.topic)
        if topic is None:
            return  # ``take_over`` publishes the value later
        if self._at_once:
            self._at_once -= 1
            with suppress(rclpy_implementation.InvalidHandle):  # ``withdraw`` has just closed it
                topic.publisher.publish(topic.encode(values))
        else:
            self._later.append((topic.publisher, topic.encode(values)))

    def publish_later_values(self) -> None:
        """Publish the postponed values; a command is on the line now."""
        self._at_once = _VALUES_AT_ONCE
        with suppress(IndexError, rclpy_implementation.InvalidHandle):  # ``withdraw`` runs
            while self._later:
                publisher, values = self._later.popleft()
                publisher.publish(values)
