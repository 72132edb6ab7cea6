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

"""What becomes of messages to write topics: dropped on the way, waiting, given to a driver."""

from collections.abc import Callable, Sequence
from functools import partial
import math
import time
from types import SimpleNamespace
from typing import Any, cast

from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.kernel.own import Crowd
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ros.callbacks import AnsweringNode
from abdf1_ros.ros.diagnostics.graph import UNKNOWN_NODE
from abdf1_ros.ros.topics.publishers import count_publishers, PublisherWatch
from abdf1_ros.ros.topics.writes import LossCounter, WriteTopics
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.mapping import Mapping
import pytest
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Float32MultiArray, Int16MultiArray
from support.mappings import make_mapping
from support.ros import Observer


@pytest.mark.parametrize(('numbers', 'publishers', 'lost'), [
    ([1, 2, 3, 4], 1, [0, 0, 0, 0]), ([51, 52, 53], 1, [0, 0, 0]),  # published before we came
    ([1, 2, 5, 6, 10], 1, [0, 0, 2, 0, 3]), ([7, 8, 9, 1, 2, 3, 5], 1, [0, 0, 0, 0, 0, 0, 1]),
    ([1, 101, 2, 102, 103, 3], 2, [0] * 6), ([1, 101, 2, 105, 3, 106], 2, [0, 0, 0, 3, 0, 0]),
    ([1, 2, 5], 2, [0, 0, 0]), ([None, None], 1, [0, 0])])  # a middleware without numbers
def test_messages_that_are_missing_before_each(
        numbers: Sequence[int | None], publishers: int, lost: list[int]) -> None:
    counter = LossCounter(lambda: publishers)
    assert [counter.lost_before(number) for number in numbers] == lost


@pytest.mark.parametrize('publishers', [1, 1000])
def test_numbers_of_a_few_publishers_only_are_kept(publishers: int) -> None:
    counter = LossCounter(lambda: publishers)
    for number in range(10_000, 0, -3):
        assert [counter.lost_before(each) for each in (number, number + 1)] == [0, 0]
    assert counter.latest == [*range(47, 1, -3)]


class Taker:
    """A node and a driver in one, which remembers what it is asked to write or refuse."""

    def __init__(self, *tags: str) -> None:
        self.mappings = [*(make_mapping('N7:0', 'Write', tag=tag) for tag in tags),
                         make_mapping('N7:9', tag='r'), make_mapping('N7:8', 'Heartbeat', tag='h')]
        self.executor, self.tasks, self.said = self, list[Callable[[], None]](), list[str]()
        self.stamps, self.requests = list[str](), list[str]()
        self.callbacks: dict[str, Callable[[Any, Any], None]] = {}
        self.kinds: dict[str, type] = {}
        self.wakes: list[int] = []
        self.events: Any = None  # of a topic with Single_Publisher
        self.kernel, self.panel = self, 'panel_{}'

    def create_subscription(self, kind: Any, name: str, callback: Any, qos: Any,
                            event_callbacks: Any = None) -> str:
        topic = name.rpartition('/')[2]
        self.callbacks[topic], self.kinds[topic] = callback, kind
        self.events = event_callbacks or self.events
        return topic

    def crowd(self, topic: str, crowd: Crowd) -> None:
        self.said.append(f'{topic}: {crowd.why}' + ' until now' * math.isfinite(crowd.until))

    def destroy_subscription(self, subscription: str) -> None:
        self.said.append(f'-{subscription}')

    def count_publishers(self, name: str) -> int:
        return 1

    def resolve_topic_name(self, name: str) -> str:
        return name

    def create_task(self, task: Callable[[], None]) -> None:
        self.tasks.append(task)

    def write(self, mappings: Sequence[Mapping], values: Any, requested: float,
              request: str) -> None:
        if values[0] == 0:
            raise ValueError
        age = line_time() - requested
        self.said.append(f'{mappings[0].tag} {values[0]}' + f' of {age:.1f} s ago' * (age > 0.5))
        self.requests.append(request)

    def tell_failure(self, what: str, error: BaseException) -> None:
        self.said.append(what)

    def refuse(self, mappings: Sequence[Mapping], reason: str, values: Any, request: str) -> None:
        self.said.append(f'{mappings[0].tag} {values[0]}: {reason}')
        self.requests.append(request)

    def publish(self, topic: str, number: int | None, age: float = 0.0, times: int = 1,
                waited: float = 0.0) -> None:
        now = time.time_ns()
        self.stamps.append(str(now - int(age * 1e9)))
        for _ in range(times):
            self.callbacks[topic](Int16MultiArray(data=[7 if number is None else number]), {
                'publication_sequence_number': number, 'source_timestamp': int(self.stamps[-1]),
                'received_timestamp': now - int(waited * 1e9)})

    def get_publishers_info_by_topic(self, name: str) -> list[Any]:
        return [SimpleNamespace(node_namespace='/', node_name=self.panel.format(name[-1]),
                                qos_profile=QoSProfile(depth=1))]

    def lost(self, topic: str, count: int) -> None:
        self.said.append(f'{topic}: {count} lost')

    def ahead(self, topic: str, seconds: float, nodes: Sequence[str]) -> None:
        self.said.append(f'{topic}: {nodes} ahead by {seconds:.1f} s')

    def open(self, topics: WriteTopics, patience: float = 2.0) -> Any:  # noqa: A003
        return topics.open(cast(Driver, self), patience, self, self._woken)

    def _woken(self) -> None:
        self.wakes.append(len(self.said))


@pytest.fixture
def node() -> Taker:
    return Taker('a', 'b')


@pytest.fixture
def topics(node: Taker) -> WriteTopics:
    """Return the topics of a node that has not begun."""
    topics = WriteTopics(cast(AnsweringNode, node))
    topics.give_to(node.open(topics))
    return topics


def test_messages_wait_in_their_order_until_the_node_has_begun(
        node: Taker, topics: WriteTopics, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, 'time_ns', lambda: 1_800_000_000_000_000_000)
    for place in 'test.ros.test_writes', 'abdf1_ros.ros.topics.writes':
        monkeypatch.setattr(f'{place}.line_time', lambda: 100.0)
    node.publish('a', 1)
    node.publish('b', 2, age=3.0)
    for _ in range(2):
        topics.begin()
    node.publish('a', 3)  # the executor has not come to it yet
    assert (node.said, topics.taken) == (['a: 1 lost'], 0)
    task, = node.tasks
    task()
    node.publish('a', 4, age=1.2)
    node.publish('a', 5, waited=0.7)
    node.publish('b', 3, age=7.4)
    node.publish('b', 4, age=-1.5)
    node.publish('b', 5, age=-2.6)
    too_old = ('s after it was published, write_timeout is 2 s; the network is slow, this node '
               'stood still or had just begun, or the clocks differ')
    assert node.said == ['a: 1 lost', 'a 1', f'b 2: it came 3.0 {too_old}', 'a 3',
                         'a 4 of 1.2 s ago', 'a 5 of 0.7 s ago', f'b 3: it came 7.4 {too_old}',
                         'b 4', "b: ['/panel_b'] ahead by 1.5 s",
                         'b 5: its time stamp is 2.6 s ahead of the clock here, write_timeout is '
                         '2 s; the clocks differ, so its age is unknown']
    assert (topics.taken, node.wakes, topics.host_clock.offsets.seconds) == (
        8, [2, 4, 5, 6, 8], 2.0)
    assert node.requests == node.stamps


def test_message_that_dds_delivers_again_after_a_cut_is_not_written_again(
        node: Taker, topics: WriteTopics) -> None:
    topics.begin()
    node.tasks[0]()
    node.publish('a', 1, times=3)
    node.publish('b', 1)
    node.publish('a', 1)  # of another publisher, or of one that began anew
    node.publish('a', 2, age=5.0, times=2)
    node.publish('b', None, times=2)  # calls have no number
    assert (node.said[:3], node.said[4:]) == (['a 1', 'b 1', 'a 1'], ['b 7', 'b 7'])
    for number in range(2, 2000):
        node.publish('a', number, times=2)
    assert len(node.said) == 6 + 1998
    assert {topic: len(latest) for topic, latest in topics.latest.items()} == {'a': 1000, 'b': 1}


def test_messages_that_are_too_many_to_wait_are_refused(node: Taker, topics: WriteTopics) -> None:
    for number in range(1, 1003):
        node.publish('a', number)
    assert node.said == [f'a {number}: too many writes are waiting' for number in (1001, 1002)]
    topics.begin()
    node.tasks[0]()
    # On a busy host some have an age.
    assert [said.split(' of ')[0] for said in node.said[2:]] == [
        f'a {number}' for number in range(1, 1001)]


def test_messages_go_to_the_old_driver_until_the_new_one_has_the_line(
        node: Taker, topics: WriteTopics) -> None:
    topics.begin()
    node.tasks[0]()
    new = Taker('a', 'c')
    new.mappings[0] = make_mapping('N7:0', 'Write', tag='a', fallback=Fallback((7,), 1000))
    opened = new.open(topics)
    node.publish('a', 1, age=-1.5)
    topics.give_to(opened)
    node.publish('a', 2)  # maybe it is 1.5 s old
    assert node.said[:2] == ['-b', 'a 1']
    assert new.said[0].startswith('a 2: time stamps of this topic were 1.')


def test_message_that_waits_for_rows_which_a_reload_takes_away_or_that_fails_ends_nothing(
        node: Taker, topics: WriteTopics) -> None:
    node.publish('b', 1)
    node.publish('a', 0)
    node.publish('a', 1)
    node.mappings[1] = make_mapping('N7:9', 'Write', tag='c', fallback=Fallback((7,), 1000))
    topics.give_to(node.open(topics))
    topics.begin()
    node.tasks[0]()
    assert node.said == ['-b', 'a message on ~/write/a', 'a 1']
    for before in 9.0, 0.0:
        topics.host_clock.look(line_time() - before, 0.0)
    node.publish('c', 1)
    assert node.said[3].startswith('c 1: it came 9.0 s after it was published')


def test_message_that_waits_when_the_line_is_lost_is_never_written(
        node: Taker, topics: WriteTopics) -> None:
    node.publish('a', 1)
    for _ in range(2):
        topics.withdraw()
    topics.begin()
    node.tasks[0]()
    assert node.said == ['-a', '-b']


def test_row_of_another_message_type_has_another_subscription(
        node: Taker, topics: WriteTopics) -> None:
    assert node.kinds == dict.fromkeys('ab', Int16MultiArray)
    node.mappings[0] = make_mapping('F8:0', 'Write', tag='a')
    node.kinds.clear()
    node.open(topics)
    assert node.kinds == {'a': Float32MultiArray}


def test_rule_28_driver_that_has_the_line_is_told_who_publishes(
        node: Taker, topics: WriteTopics) -> None:
    topics.begin()
    node.tasks[0]()
    single = partial(make_mapping, 'N7:0', 'Write', tag='a', single_publisher=True)
    node.mappings[0] = single()
    topics.give_to(node.open(topics))
    node.panel = '_NODE_NAME_UNKNOWN_'
    node.events.matched(SimpleNamespace(total_count=2, current_count=2))
    node.panel = 'panel_{}'
    node.publish('a', 1)
    new = Taker('a', 'b')
    new.mappings[0] = single()
    opened = new.open(topics)  # it has the subscription already
    node.publish('a', 2)
    topics.give_to(opened)
    topics.withdraw()
    crowd = 'a: more than one publisher: /panel_a'
    assert node.said == [
        '-a', crowd.replace('/panel_a', UNKNOWN_NODE), crowd, 'a 1', 'a 2', '-b', '-a']
    assert new.said == [crowd, f'{crowd} until now']
    assert len(node.wakes) == 4 and len(new.wakes) == 2


def test_remapped_topic_has_the_publishers_of_its_new_name() -> None:
    """Else rule 17 warns of no second publisher, and its numbers are taken for losses."""
    with Observer() as observer:
        node = Node('line', context=observer.context, use_global_arguments=False, cli_args=[
            '--ros-args', '-r', '~/write/a:=/cell/door', '-r', '__ns:=/cell'])
        observer.executor.add_node(node)
        for _ in range(2):
            observer.node.create_publisher(Int16MultiArray, '/cell/door', 1)
        observer.node.create_publisher(Int16MultiArray, '/cell/line/write/b', 1)
        assert [count_publishers(node, topic) for topic in ('a', 'b')] == [2, 1]
        told: list[Crowd] = []
        watches = [PublisherWatch(node, Int16MultiArray, topic, told.append, told.append)
                   for topic in ('b', 'a')]

        def has_names() -> bool:
            watches[1].living.ask_names_again()
            return bool(told) and UNKNOWN_NODE not in told[-1].why

        observer.until(has_names, 'a crowd of the first (28)')
        assert told[-1].why == 'more than one publisher: /observer, /observer'
        for watch in watches:
            watch.end()
        assert [math.isinf(crowd.until) for crowd in told[-2:]] == [True, False]
