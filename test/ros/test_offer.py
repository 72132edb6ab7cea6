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

"""Publishers that a bridge has only while it has the line, and what is left when it is lost."""

from array import array
from collections.abc import Callable
import math
from types import SimpleNamespace
from typing import Any

from abdf1_ros.ros.bridge.offer import OfferedPublisher
from abdf1_ros.ros.topics.reads import ReadTopic, ReadTopics
from abdf1_ros.settings.heartbeats import While
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.scaling import Scaling
import pytest
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import QoSProfile
from std_msgs.msg import UInt8
from support.cases import for_all
from support.mappings import make_mapping

POINT: Any = SimpleNamespace(stale_time=1.0, error=None, withheld='')


class LostPublisher:
    """A publisher that another thread has closed."""

    def publish(self, message: object) -> None:
        raise rclpy_implementation.InvalidHandle('closed')

    def get_subscription_count(self) -> int:
        raise rclpy_implementation.InvalidHandle('closed')


class StandInNode:
    """A node that makes such publishers."""

    def create_publisher(self, *arguments: object, **options: object) -> LostPublisher:
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
    node: Any = StandInNode()
    topics, row = ReadTopics(node, {}), make_mapping('N7:0')
    topics.open({row: POINT})
    for _ in range(6):
        topics.read(row, array('h', [7]))
    topics.publish_later_values()


def test_last_messages_wait_for_the_line_in_their_order() -> None:
    sent: list[int] = []
    node: Any = SimpleNamespace(create_publisher=lambda *_: SimpleNamespace(
        publish=sent.append, get_subscription_count=lambda: 1))
    offered = OfferedPublisher(node, UInt8, '~/a', 1, most=2)
    for number in range(3):
        offered.publish(number)
    offered.offer()
    assert (sent, offered.has_subscribers()) == ([1, 2], True)


def test_closed_publisher_has_no_subscribers(offered: LosingPublisher) -> None:
    assert not offered.has_subscribers()
    for _ in range(2):  # what waited is of the line that was lost
        offered.publish(UInt8())
        offered.withdraw()
        assert not offered.waiting
    offered.wait_for_all_acked(0.0)


class Recorder:
    """A node that notes which publishers it makes, uses and destroys."""

    def __init__(self) -> None:
        self.notes: list[str] = []

    def create_publisher(self, kind: type, topic: str, qos: object, **options: object) -> Any:
        self.notes.append(f'+{topic}')
        return SimpleNamespace(topic=topic, publish=lambda message: self.notes.append(topic))

    def destroy_publisher(self, publisher: Any) -> None:
        self.notes.append(f'-{publisher.topic}')

    def noted(self, step: Callable[..., object], *args: object) -> list[str]:
        """Return what is noted during a step."""
        self.notes.clear()
        step(*args)
        return [note.replace('~/read/', '') for note in self.notes]


def test_value_that_is_read_while_its_topic_begins_stays_the_last() -> None:
    row, sent, left = make_mapping('N7:0'), list[object](), [array('h', [8])]

    def publish(message: object) -> None:
        if left:
            topics.read(row, left.pop())  # by the link, before the message goes out
        sent.append(message)

    node: Any = SimpleNamespace(create_publisher=lambda *_, **__: SimpleNamespace(publish=publish))
    topics = ReadTopics(node, {})
    topics.read(row, array('h', [7]))
    topics.offer({row: POINT})
    assert sent[0] == sent[-1] != sent[1]


def test_values_of_a_line_that_was_lost_do_not_come_when_it_is_back() -> None:
    node: Any = Recorder()
    points: dict[Mapping, Any] = {make_mapping(f'N7:{number}', tag=f'n{number}'): SimpleNamespace(
        **vars(POINT)) for number in range(6)}
    tags, row = [row.tag for row in points], next(iter(points))
    published: dict[str, ReadTopic] = {}
    topics = ReadTopics(node, published)

    def read_all() -> None:
        for each in points:
            topics.read(each, array('h', [7]))

    assert node.noted(read_all) == []  # it waits for the line
    assert node.noted(topics.offer, points) == [sign + tag for tag in tags for sign in ('+', '')]
    for _ in range(2):
        assert node.noted(read_all) == tags[:4]
        for later in tags[4:], []:
            assert node.noted(topics.publish_later_values) == later
    read_all()
    assert node.noted(topics.withdraw) == [f'-{tag}' for tag in tags]
    assert node.noted(topics.publish_later_values) == []
    assert node.noted(topics.read, row, array('h', [7])) == []
    for number, each in enumerate([*points][1:3]):  # its PLC is in PROGRAM by now, or is silent
        topics.read(each, array('h', [7]))
        vars(points[each]).update([('withheld', 'PROGRAM'), ('error', 'no reply')][number:][:1])
    assert node.noted(topics.offer, points) == ['+n0', 'n0', *(f'+{tag}' for tag in tags[1:])]
    after = ReadTopics(node, published)
    after.open({row: points[row]})
    for gone in [f'-{tag}' for tag in tags[1:]], []:
        assert node.noted(after.take_over) == gone


@for_all(('changed', 'notes'), [
    ({'period': 990, 'description': 'x', 'command': 'ReadWrite'}, []), ({'station': 2}, ['+a']),
    ({'via': 2}, ['+a']), ({'length': 2}, ['+a']), ({'scaling': Scaling(0.1)}, ['+a']),
    ({'access': 'WordRange'}, ['+a']), ({'command': 'Serve'}, ['+a']),
    ({'word_order': 'High'}, ['+a']), ({'condition': While(('RUN',))}, ['+a']),
    ({'kind': 'uint16'}, ['+a'])])
def test_row_with_other_values_has_a_publisher_that_kept_none(
        changed: dict[str, Any], notes: list[str]) -> None:
    node, point = Recorder(), POINT
    published: dict[str, ReadTopic] = {}
    old, new = (make_mapping('N7:0', tag='a', **{'scaling': Scaling(1.8), **more})
                for more in ({}, changed))
    topics: Any = ReadTopics
    topics(node, published, ('/dev/a',)).offer({old: point})
    assert node.noted(topics(node, published, ('/dev/a',)).open, {new: point}) == notes
    other = topics(node, published, ('/dev/a', '/dev/b'))
    assert node.noted(other.open, {new: point}) == ['+a']


@pytest.mark.parametrize(('old', 'new', 'is_fit'), [
    (2.0, 3.0, True), (2.0, 3.1, False), (3.0, 2.0, True), (3.1, 2.0, False),
    (math.inf, 2.0, False), (2.0, math.inf, False), (math.inf, math.inf, True)])
def test_publisher_is_kept_where_the_promise_is_about_the_same(
        old: float, new: float, is_fit: bool) -> None:
    publisher: Any = None
    assert ReadTopic(publisher, publisher, ('a',), old).is_fit_for(('a',), new) is is_fit
