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

"""Who publishes on the topic of a row with Single_Publisher (rule 28): DDS, and the bridge."""

from collections.abc import Callable, Iterator
import math
from pathlib import Path
import signal
import time
from types import SimpleNamespace
from typing import cast

from abdf1_ros.driver.kernel.own import Crowd
from abdf1_ros.ros.diagnostics.graph import UNKNOWN_NODE
from abdf1_ros.ros.topics.interlocks import InterlockWatch
from abdf1_ros.ros.topics.publishers import LivingPublishers
from abdf1_ros.settings.heartbeats import Fallback
import pytest
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import Int16MultiArray, UInt8MultiArray
from std_srvs.srv import SetBool, Trigger
from support import ros
from support.cases import for_all
from support.commands import Output
from support.driver_bench import DriverBench
from support.mappings import make_mapping

NET = 'NAK_Retries,ENQ_Retries,Cmd_Timeout,Baud,Timeout\n1,1,500,115200,100\n'
MAP = """\
Tag,Command,Address,Station,PLC_Type,Fallback,Fallback_After,Single_Publisher
speed,Write,N10:1,1,SLC,7,60000,Yes
horn,Write,B3:0/0,1,SLC,0,60000,Yes
"""
SIMULATOR = 'Station,PLC_Type,Address,Length\n1,SLC,N10:0,4\n1,SLC,B3:0,1\n'
SPEED = '/abdf1/write/speed'
BOTH = 'not written: refused: more than one publisher: /observer, /player'
PUBLISHER = Path(ros.__file__).with_name('leased_publisher.py')


class Topic:
    """A topic without DDS, whose publishers come and go."""

    def __init__(self) -> None:
        self.names = ['/a', '/b']
        self.total = self.now = self.dead = 0
        self.told: list[Crowd] = []
        self.living = LivingPublishers(lambda: self.now, lambda: self.names, self.told.append)

    def come(self, count: int = 1, gone: int = 0) -> None:
        """Let publishers come and others go, before the executor looks."""
        self.total, self.now = self.total + count, self.now + count - gone
        self.living.matched(SimpleNamespace(total_count=self.total, current_count=self.now))

    def die(self, count: int) -> None:
        """Let so many publishers keep their lease no more."""
        self.dead += count
        self.living.liveliness_changed(SimpleNamespace(not_alive_count=self.dead))

    def is_crowded(self) -> bool:
        return bool(self.told) and self.told[-1].until == math.inf


def test_rule_28_publishers_are_counted_until_they_go_or_lose_their_lease() -> None:
    topic = Topic()
    topic.come()
    assert (topic.told, topic.living.alive) == ([], 1)
    topic.come()
    assert topic.told == [Crowd('more than one publisher: /a, /b')]
    topic.die(1)
    assert (topic.is_crowded(), topic.living.alive, topic.living.crowd) == (False, 1, None)
    assert topic.told[-1].why == 'more than one publisher: /a, /b'
    topic.die(-1)  # it only stood still
    assert topic.is_crowded()
    topic.come(0, gone=1)
    assert not topic.is_crowded()
    assert len(topic.told) == 4


@for_all('is_lease_first', [False, True])
def test_rule_28_publisher_that_dds_drops_after_its_lease_makes_no_crowd(
        is_lease_first: bool) -> None:
    topic = Topic()
    topic.come()
    topic.come()
    topic.die(1)
    told = [*topic.told]
    if is_lease_first:
        topic.now -= 1  # its event is still to come
        topic.die(-1)
        topic.come(0)
    else:
        topic.come(0, gone=1)
        topic.die(-1)
    assert (topic.told, topic.living.alive) == (told, 1)
    topic.come()
    assert topic.is_crowded()


@for_all(('came', 'gone', 'is_momentary'), [(1, 1, True), (0, 1, False), (2, 3, True)])
def test_rule_28_publisher_that_came_and_went_between_two_looks_is_a_crowd_for_a_moment(
        came: int, gone: int, is_momentary: bool) -> None:
    topic = Topic()
    topic.come()
    topic.names = ['/a']
    topic.come(came, gone)
    assert [crowd.why for crowd in topic.told] == [
        'more than one publisher for a moment: /a'] * is_momentary
    assert not topic.is_crowded() and topic.living.crowd is None


def test_rule_28_crowd_is_told_whatever_rclpy_knows_of_names() -> None:
    topic = Topic()
    topic.names = ['/a', UNKNOWN_NODE]
    topic.come(2)
    topic.names = ['/a', '/b']
    for _ in range(2):
        topic.living.ask_names_again()
    assert [crowd.why[25:] for crowd in topic.told] == [f'/a, {UNKNOWN_NODE}', '/a, /b']
    topic.names = None  # type: ignore[assignment]  # it fails
    topic.come()
    assert topic.told[-1] == Crowd(f'more than one publisher: {UNKNOWN_NODE}')
    topic.living.end()
    assert not topic.is_crowded() and topic.living.alive == 0


class Graph:
    """A node that finds two publishers of each topic."""

    def __init__(self) -> None:
        self.names = ['b', 'a']

    def resolve_topic_name(self, name: str) -> str:
        return name

    resolve_service_name = resolve_topic_name

    def count_publishers(self, name: str) -> int:
        return 2

    def count_clients(self, name: str) -> int:
        return 0

    def get_publishers_info_by_topic(self, name: str) -> list[SimpleNamespace]:
        return [SimpleNamespace(node_namespace='/', node_name=name) for name in self.names]


def test_rule_28_log_has_the_names_when_they_are_known_and_rule_17_says_nothing() -> None:
    rows = [make_mapping(f'N7:{number}', 'Write', tag=tag, fallback=Fallback((7,), 1000),
                         single_publisher=tag == 'speed')
            for number, tag in enumerate(('speed', 'other'))]
    graph, interlocks = Graph(), (driver := DriverBench(rows, start=False).driver).kernel
    watch = InterlockWatch(cast(Node, graph), driver)
    assert (watch.look(0.0), watch.refusing(0.0)) == (('other',), {})
    interlocks.crowd('speed', Crowd('two'))
    assert watch.refusing(1.0) == {'speed': '/a, /b'}
    graph.names[0] = '_NODE_NAME_UNKNOWN_'
    interlocks.crowd('speed', Crowd('two', 1.5))
    assert watch.refusing(2.0) == {}
    interlocks.crowd('speed', Crowd('two'))
    assert [watch.refusing(now) for now in (3.0, 3.9, 4.0)] == [
        {}, {}, {'speed': f'/a, {UNKNOWN_NODE}'}]


class Cell(ros.BridgeCell):
    """A bridge with rows that have a single publisher, and the observer as this publisher."""

    def __init__(self, folder: Path, rows: str = MAP) -> None:
        super().__init__(folder, SIMULATOR, rows, NET)

    def word(self) -> int:
        return self.plcs.word('N10:1')

    def until(self, condition: Callable[[], object], what: str) -> None:
        self.ros.until(condition, what)

    def publish(self, publisher: Publisher, value: int) -> str:
        """Publish a value; return its result."""
        self.results.clear()
        publisher.publish(Int16MultiArray(data=[value]))
        return str(self.results.until(
            lambda result: ros.details(result)['value'] == f'[{value}]', 'its result').message)

    def player(self) -> tuple[Node, Publisher]:
        """Return another node with a publisher of the same topic, which DDS has connected."""
        node = Node('player', context=self.ros.context, use_global_arguments=False)
        publisher = node.create_publisher(Int16MultiArray, SPEED, 10)
        end = time.monotonic() + ros.PATIENCE
        while not publisher.get_subscription_count() and time.monotonic() < end:
            time.sleep(0.01)  # the executor of the bridge does not run meanwhile
        return node, publisher


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Cell]:
    with Cell(tmp_path) as made:
        yield made


def test_rule_28_messages_of_two_publishers_are_refused_and_the_row_falls_back(
        cell: Cell, capfd: Output) -> None:
    ours = cell.ros.publisher(Int16MultiArray, SPEED)
    cell.until(lambda: cell.publish(ours, 3) == 'written', 'a message')
    node, other = cell.player()
    assert [cell.publish(publisher, value) for publisher, value in (
        (other, 4), (ours, 5), (other, 6))] == [BOTH] * 3
    cell.until(lambda: cell.word() == 7, 'the fallback value')
    status = ros.until_status(cell.diagnostics, 'interlocks', ros.ERROR)
    assert 'speed: messages are refused: more than one publisher' in status.message
    assert ros.details(status)['speed'].endswith('; more than one publisher: /observer, /player')
    node.destroy_node()
    cell.until(lambda: cell.publish(ours, 8) == 'written', 'a row that accepts again')
    assert cell.word() == 8
    said = capfd.readouterr().err
    assert '[abdf1]: ~/write/speed has more than one publisher: /observer, /player. All' in said
    assert 'its fallback value is not written while' not in said  # rule 17
    ros.until_status(cell.diagnostics, 'interlocks', ros.OK)


def test_rule_28_message_of_a_publisher_that_has_gone_before_the_executor_runs_is_refused(
        cell: Cell) -> None:
    ours = cell.ros.publisher(Int16MultiArray, SPEED)
    cell.until(lambda: cell.publish(ours, 3) == 'written', 'a message')
    for value in 4, 5, 6:
        node, other = cell.player()
        other.publish(Int16MultiArray(data=[value]))
        assert other.wait_for_all_acked(Duration(seconds=ros.PATIENCE))
        node.destroy_node()
    refused = cell.ros.until(lambda: [
        result for result in cell.results if 'refused' in result.message][2:], 'the results')
    assert {ros.details(result)['value'] for result in refused} <= {'[4]', '[5]', '[6]'}
    assert not [result for result in cell.results
                if result.message == 'written' and ros.details(result)['value'] != '[3]']
    cell.until(lambda: cell.word() == 7, 'the fallback value')
    cell.until(lambda: cell.publish(ours, 8) == 'written', 'a row that accepts again')


def test_rule_28_killed_publisher_with_a_lease_counts_no_longer_than_its_lease(
        cell: Cell) -> None:
    with ros.Process(PUBLISHER, SPEED, '1.0', '42') as robot:
        cell.until(lambda: cell.word() == 42, 'a message of the process')
        ours = cell.ros.publisher(Int16MultiArray, SPEED)
        cell.until(lambda: cell.word() == 7, 'the fallback value')
        robot.send(signal.SIGKILL)
        cell.until(lambda: cell.publish(ours, 5) == 'written', 'a row that accepts again')
        # DDS has not dropped it, which takes 20 s.
        assert cell.ros.node.count_publishers(SPEED) == 2
        assert [each.callback_group.can_execute(each) for each in cell.node.subscriptions
                if each.topic_name == SPEED] == [True, False]  # each message is taken once


def test_rule_28_new_files_may_begin_it_and_a_driver_takes_it_over(tmp_path: Path) -> None:
    with Cell(tmp_path, MAP.replace('Yes', 'No')) as cell:
        def reload(rows: str) -> None:
            cell.map.write_text(rows, encoding='utf-8')
            answer = cell.call(Trigger, 'reload', Trigger.Request())
            assert answer.success, answer.message

        ours = cell.ros.publisher(Int16MultiArray, SPEED)
        node, other = cell.player()
        for publisher in ours, other:
            cell.until(lambda who=publisher: cell.publish(who, 3) == 'written', 'a free row')
        reload(MAP)
        cell.until(lambda: cell.publish(ours, 5) == BOTH, 'a crowd that DDS tells again')
        reload(MAP.replace('60000', '50000'))
        assert cell.publish(other, 6) == BOTH
        node.destroy_node()
        cell.until(lambda: cell.publish(ours, 8) == 'written', 'a row that accepts again')


def test_rule_28_call_is_no_second_publisher_and_is_refused_beside_one(cell: Cell) -> None:
    def call() -> str:
        return str(cell.call(SetBool, 'set/horn', SetBool.Request(data=True)).message)

    cell.until(lambda: call() == 'written', 'a call')
    publisher = cell.ros.publisher(UInt8MultiArray, '/abdf1/write/horn')
    cell.results.clear()
    assert call() == 'not written: refused: the topic has a publisher: /observer'
    publisher.publish(UInt8MultiArray(data=[0]))
    cell.until(lambda: [result.message for result in cell.results] == [
        'not written: refused: the topic has a publisher: /observer', 'written'], 'both results')
