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

"""The names of a bridge's topics, and other nodes that publish them."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

from abdf1_ros.problems import ConfigurationError
from abdf1_ros.ros.diagnostics import log
from abdf1_ros.ros.diagnostics.graph import Graph
from abdf1_ros.ros.diagnostics.other_publishers import OtherPublisherWatch, StrayWatch
from abdf1_ros.ros.diagnostics.status import Seen
from abdf1_ros.ros.diagnostics.topics import TopicsStatus
from abdf1_ros.ros.parameters.arguments import Arguments
from abdf1_ros.ros.topic_names import TopicNames
import pytest
from rclpy.node import NodeNameNonExistentError
from support.cases import for_all
from support.mappings import make_mapping
from support.ros import ERROR, OK, WARN

ROWS = [make_mapping('B3:0/0', topic='door'), make_mapping('B3:1/0', topic='lamps'),
        make_mapping('N7:0', 'ReadWrite', topic='speed'),
        make_mapping('N7:4', 'Write', topic='recipe'),
        make_mapping('N7:9', 'Write', topic='recipe')]  # two rows may share a write topic


def names(**remaps: str) -> TopicNames:
    """Return the names at node /press; ``remaps`` by the names below it."""
    def resolve(name: str) -> str:
        return remaps.get(name.removeprefix('~/').replace('/', '_'), f'/press{name[1:]}')

    return TopicNames.of(resolve, ROWS)


def test_names_of_topics_have_the_remaps_in_them() -> None:
    assert names(read_door='/cell/door', write_recipe='/press/set') == TopicNames(
        {'door': '/cell/door', 'lamps': '/press/read/lamps', 'speed': '/press/read/speed'},
        {'speed': '/press/write/speed', 'recipe': '/press/set'},
        ('/press/write_results', '/press/active_stations', '/press/snapshot'))
    assert names().published == (
        '/press/read/door', '/press/read/lamps', '/press/read/speed', '/press/write_results',
        '/press/active_stations', '/press/snapshot')


@for_all(('remaps', 'topics', 'name'), [
    ({'read_door': '/bits', 'read_lamps': '/bits'}, '~/read/door, ~/read/lamps', '/bits'),
    ({'read_door': '/press/read/lamps'}, '~/read/door, ~/read/lamps', '/press/read/lamps'),
    ({'write_speed': '/set', 'write_recipe': '/set'}, '~/write/speed, ~/write/recipe', '/set'),
    # the bridge would feed the Fallback of one row with what it reads of the other
    ({'read_door': '/x', 'write_speed': '/x'}, '~/read/door, ~/write/speed', '/x'),
    ({'write_speed': '/press/read/speed'}, '~/read/speed, ~/write/speed', '/press/read/speed'),
    ({'read_door': '/press/snapshot'}, '~/read/door, ~/snapshot', '/press/snapshot')])
def test_two_topics_of_one_name_are_a_fault(
        remaps: dict[str, str], topics: str, name: str) -> None:
    try:
        names(**remaps)
    except ConfigurationError as error:
        assert [str(problem) for problem in error.problems] == [
            f'remaps: {topics} have one name, {name}; give each topic a name of its own']
    else:
        raise AssertionError(f'{remaps} are accepted')


@for_all(('remapped', 'reason'), [
    ('~/read/door', ''), ('/press/read/door', ''), ('~/write/speed', ''),
    ('press:~/read/door', ''), ('other:read/door', ''),
    ('/other/read/door', ''), ('__node', ''), ('rosservice://~/read/door', ''), ('~/reload', ''),
    ('read/door', 'write ~/read/door'), ('/read/door', 'write ~/read/door'),
    ('press:read/door', 'write ~/read/door'), ('~read/door', 'write ~/read/door'),
    ('~/write/door', 'no row has this topic'), ('~/read/dor', 'no row has this topic'),
    ('/press/read/dor', 'no row has this topic')])
def test_remap_without_effect_is_told(remapped: str, reason: str) -> None:
    arguments = Arguments.of(['node', '--ros-args', '--remap', f'{remapped}:=/cell/door'])
    name = remapped.rpartition(':')[2]
    assert [*names().idle('/press', arguments.remapped_for('/press'))] == [
        f'the remap of {name} has no effect: {reason}' for _ in range(bool(reason))]


UNKNOWN = '_NODE_NAMESPACE_UNKNOWN_/_NODE_NAME_UNKNOWN_'


class Domain:
    """Publishers and subscribers as a node sees them, by topic; ``counts`` are the queries."""

    def __init__(self, *topics: str) -> None:
        self.publishers: dict[str, list[str]] = {topic: ['/press'] for topic in topics}
        self.subscribers: dict[str, int] = {}
        self.readers: dict[str, list[str]] = {}
        self.services: dict[str, list[str]] = {}  # the nodes that offer each
        self.clients: dict[str, list[str]] = {}
        self.counts: list[str] = []

    def count_publishers(self, topic: str) -> int:
        self.counts.append(topic)
        return len(self.publishers.get(topic, ()))

    def count_subscribers(self, topic: str) -> int:
        return self.subscribers.get(topic, 0)

    def count_services(self, service: str) -> int:
        return len(self.services.get(service, ()))

    def count_clients(self, service: str) -> int:
        return len(self.clients.get(service, ()))

    def get_publishers_info_by_topic(self, topic: str) -> list[SimpleNamespace]:
        return _ends(self.publishers.get(topic, ()))

    def get_subscriptions_info_by_topic(self, topic: str) -> list[SimpleNamespace]:
        return _ends(self.readers.get(topic, ()))

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        return [(topic, ['std_msgs/msg/UInt8MultiArray'])
                for topic in {**self.publishers, **self.subscribers, **self.readers}]

    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]:
        return [(service, ['std_srvs/srv/Trigger'])
                for service in {**self.services, **self.clients}]

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        nodes = {node for nodes in self.clients.values() for node in nodes if node != UNKNOWN}
        return [('gone', '/'), *((end.node_name, end.node_namespace) for end in _ends([*nodes]))]

    def get_client_names_and_types_by_node(
            self, name: str, namespace: str) -> list[tuple[str, list[str]]]:
        if name == 'gone':
            raise NodeNameNonExistentError
        return [(service, []) for service, nodes in self.clients.items()
                if f'{namespace.rstrip("/")}/{name}' in nodes]


def _ends(nodes: Sequence[str]) -> list[SimpleNamespace]:
    parts = [node.rpartition('/') for node in nodes]
    return [SimpleNamespace(node_name=name, node_namespace=namespace or '/')
            for namespace, _, name in parts]


class Bench:
    """Both watches and the status of a bridge /press with ``ROWS`` in a domain."""

    def __init__(self, names: TopicNames) -> None:
        self.domain = Domain(*names.published)
        source: Any = self.domain
        graph = Graph(source)
        self.seen = Seen()
        self.publishers = OtherPublisherWatch(graph, '/press', names, self.seen)
        self.strays = StrayWatch(graph, '/press', names, self.seen)
        self.status = TopicsStatus('/dev/ttyS0', self.seen)

    def told(self, begin: float, end: float) -> list[tuple[float, str]]:
        """Return what the watches tell, ten looks a second, and when (s) they do."""
        times = [number / 10 for number in range(round(10 * begin), round(10 * end))]
        return [(now, news.text) for now in times
                for news in (*self.publishers.look(now), *self.strays.look(now))]


@pytest.fixture
def bench() -> Bench:
    return Bench(names())


DOOR, LAMPS = '/press/read/door', '/press/read/lamps'
IS_TOO = 'too: subscribers take its messages for ours. End it, or give its topics other names'


def test_other_publisher_is_told_once_within_a_second_and_again_when_it_comes_back(
        bench: Bench) -> None:
    assert bench.told(0, 5) == []
    assert bench.status.judge(5) == (OK, 'no other node publishes topics of this bridge')
    bench.domain.publishers[DOOR].append('/cell/stub')
    (now, text), = bench.told(5, 20)
    assert text == f'/cell/stub publishes {DOOR} {IS_TOO}'
    assert 5 <= now < 6
    assert bench.status.judge(20) == (ERROR, f'/cell/stub publishes {DOOR} too')
    assert bench.status.values(20) == {DOOR: 'is published by /cell/stub too'}
    bench.domain.publishers[DOOR].remove('/cell/stub')
    assert bench.told(20, 21.5) == []
    assert bench.status.judge(21.5)[0] == OK
    bench.domain.publishers[DOOR].append('/cell/stub')
    assert len(bench.told(21.5, 23)) == 1


def test_other_publisher_is_an_error_with_all_its_topics_in_one_line(bench: Bench) -> None:
    for topic in bench.domain.publishers:
        bench.domain.publishers[topic] = ['/rosbag2_player', '/press', '/rosbag2_player']
    bench.domain.publishers[DOOR].append('/stub')
    bag, stub = bench.publishers.look(0.0)
    assert bag.severity == stub.severity == log.ERROR
    assert bag.text == (
        f'/rosbag2_player publishes {DOOR}, {LAMPS}, /press/read/speed, /press/write_results, '
        f'/press/active_stations and 1 more {IS_TOO}')
    assert stub.text == f'/stub publishes {DOOR} {IS_TOO}'
    assert bench.status.judge(0.0)[1] == (
        '/rosbag2_player, /stub publish /press/active_stations, /press/read/door, '
        '/press/read/lamps, /press/read/speed, /press/snapshot and 1 more too')
    assert len(bench.status.values(0.0)) == 6


def test_node_that_has_taken_the_place_of_another_is_told(bench: Bench) -> None:
    bench.domain.publishers[DOOR].append('/stub')
    bench.told(0, 2)
    bench.domain.publishers[DOOR][1] = '/bag'  # within a second
    assert [text for _, text in bench.told(2, 15)] == [f'/bag publishes {DOOR} {IS_TOO}']
    assert bench.status.judge(15) == (ERROR, f'/bag publishes {DOOR} too')


def test_publishers_of_our_own_name_do_not_count(bench: Bench) -> None:
    bench.domain.publishers[DOOR] *= 2  # an earlier run that was killed, or a ~/reload
    assert bench.told(0, 5) == []
    bench.domain.publishers[DOOR] += ['/cell/press']
    assert len(bench.told(5, 10)) == 1


def test_program_without_a_node_name_is_told_after_the_time_in_which_names_come(
        bench: Bench) -> None:
    bench.told(0, 1)
    bench.domain.publishers[DOOR] += [UNKNOWN]
    (now, text), = bench.told(1, 9)
    assert text == f'a program without a node name publishes {DOOR} {IS_TOO}'
    assert 4.5 < now < 7
    bench.domain.publishers[DOOR].remove(UNKNOWN)
    bench.told(9, 11)
    bench.domain.publishers[DOOR] += [UNKNOWN]
    assert bench.told(11, 14) == []


@pytest.mark.parametrize('name', ['/stub', '/press'])
def test_node_whose_name_comes_late_is_never_told_without_it(bench: Bench, name: str) -> None:
    bench.told(0, 1)
    bench.domain.publishers[LAMPS] += [UNKNOWN]
    assert bench.told(1, 4.2) == []  # the first message about the node was lost
    bench.domain.publishers[LAMPS][-1] = name
    assert [text for _, text in bench.told(4.2, 9)] == [
        f'/stub publishes {LAMPS} {IS_TOO}'][name == '/press':]


def test_message_that_nobody_takes_is_told_with_a_name_that_comes_late(bench: Bench) -> None:
    bench.domain.publishers |= {'/write/speed': [UNKNOWN], '/press/write/x': [UNKNOWN]}
    assert bench.told(0, 3) == []
    bench.domain.publishers['/write/speed'] = ['/hmi']
    assert [text.partition(', ')[0] for _, text in bench.told(3, 9)] == [
        '/press/write/x is published by a program without a node name',
        '/write/speed is published by /hmi']


def test_publisher_whose_name_cannot_be_read_is_told_too(bench: Bench) -> None:
    def fail(topic: str) -> None:
        raise UnicodeDecodeError('utf-8', b'/\xff', 1, 2, 'invalid start byte')

    source: Any = bench.domain
    source.get_publishers_info_by_topic = fail
    bench.domain.publishers[DOOR] += ['/\xff']
    assert [text for _, text in bench.told(0, 5)] == [
        f'a node whose name cannot be read publishes {DOOR} {IS_TOO}']


def test_each_topic_is_counted_once_a_second_and_not_all_at_once() -> None:
    rows = [make_mapping(f'N7:{number}', topic=f'row{number}') for number in range(1000)]
    bench = Bench(TopicNames.of(lambda name: f'/press{name[1:]}', rows))
    bench.told(0, 1)
    bench.domain.counts.clear()
    bench.publishers.look(1.0)
    assert len(bench.domain.counts) <= 102
    bench.told(1.1, 11)
    counts = [bench.domain.counts.count(f'/press/read/row{number}') for number in (0, 500, 999)]
    assert all(count in (9, 10, 11) for count in counts), counts


def test_spare_that_waits_tells_nothing(bench: Bench) -> None:
    bench.seen.is_waiting = lambda: True
    bench.domain.publishers |= {DOOR: ['/press', '/stub'], '/press/write/door': ['/stub']}
    assert bench.told(0, 5) == []
    bench.seen.is_waiting = lambda: False
    assert len(bench.told(5, 8)) == 2
    bench.seen.is_waiting = lambda: True
    bench.told(8, 12)
    assert bench.status.judge(12)[0] == OK


def demand_told_once(bench: Bench, ends: dict[str, list[str]], topic: str, told: str) -> None:
    """Demand a line of the log and the status while a topic is in ``ends``, and then no more."""
    assert [text for _, text in bench.told(0, 30)] == [f'{topic} {told}']
    assert bench.status.judge(30) == (WARN, f'used, but not there: {topic}')
    assert bench.status.values(30) == {topic: told}
    del ends[topic]
    bench.told(30, 40)
    assert bench.status.judge(40)[0] == OK


@for_all(('topic', 'reason'), [
    ('/press/write/door', 'door is only read'),
    ('/press/write/speeed', 'no row writes this topic'),
    ('/press/write/lamps/write/x', 'no row writes this topic'),
    ('/press/write/recipe', 'this bridge takes /cell/recipe'),  # its remap is not in the program
    ('/write/speed', 'this bridge takes /press/write/speed'),
    ('/write/recipe', 'this bridge takes /cell/recipe')])
def test_message_that_nobody_takes_is_told_once(topic: str, reason: str) -> None:
    bench = Bench(names(write_recipe='/cell/recipe'))
    bench.domain.publishers[topic] = ['/hmi']
    demand_told_once(bench, bench.domain.publishers, topic,
                     f'is published by /hmi, but not written: {reason}')


def test_only_some_of_very_many_topics_beside_ours_are_looked_at(bench: Bench) -> None:
    bench.domain.publishers |= {f'/press/write/x{number}': ['/hmi'] for number in range(1000)}
    bench.told(0, 5)
    assert len(bench.seen.strays) == len(bench.status.values(5)) == 40


@for_all(('topic', 'publishers'), [
    ('/press/write/speed', ['/hmi']), ('/press/write/door', []), ('/write/door', ['/hmi']),
    ('/other/write/speed', ['/hmi']), ('/taken/write/speed', ['/hmi'])])
def test_message_that_a_node_may_take_is_not_told(topic: str, publishers: list[str]) -> None:
    bench = Bench(names())
    bench.domain.publishers[topic] = publishers
    bench.domain.subscribers = {'/press/write/speed': 1, '/press/write/door': 1}
    assert bench.told(0, 30) == []


@for_all(('topic', 'reason'), [
    ('/press/read/dor', 'no row reads this topic'),
    ('/press/read/recipe', 'recipe is only written'),
    ('/press/read/lamps', 'this bridge publishes /cell/lamps'),
    ('/read/door', 'this bridge publishes /press/read/door')])
def test_subscriber_that_no_node_can_serve_is_told_once(topic: str, reason: str) -> None:
    bench = Bench(names(read_lamps='/cell/lamps'))
    bench.domain.readers = {topic: ['/cell/hmi', '/robot'], DOOR: ['/robot']}
    demand_told_once(bench, bench.domain.readers, topic,
                     f'is subscribed to by /cell/hmi, /robot, but not published: {reason}')


@for_all(('topic', 'publishers'), [
    ('/press/read/dor', ['/stub']), ('/read/door', ['/stub']), ('/read/dor', []),
    ('/other/read/door', [])])
def test_subscriber_that_another_node_may_serve_is_not_told(
        topic: str, publishers: list[str]) -> None:
    bench = Bench(names())
    bench.domain.readers, bench.domain.publishers[topic] = {topic: ['/hmi']}, publishers
    assert bench.told(0, 30) == []


@for_all(('service', 'rows'), [
    ('/press/set/speed', 'written rows of one bit'),
    ('/press/read_now/dor', 'rows that are read')])
def test_client_of_a_service_that_is_not_offered_is_told(service: str, rows: str) -> None:
    bench = Bench(names())
    bench.domain.clients = {service: ['/robot'], '/press/read_now/door': ['/robot'],
                            '/other/read_now/dor': ['/robot']}
    bench.domain.services = {'/press/read_now/door': ['/press']}
    assert [text for _, text in bench.told(0, 30)] == [
        f'{service} is called by /robot, but not offered: only {rows} have it, within '
        'most_services; none has in Mode Listen']
    bench.domain.clients = {service: [UNKNOWN]}
    bench.told(30, 40)
    assert 'a program without a node name' in bench.status.values(40)[service]


def test_topic_without_the_name_of_the_node_may_belong_to_another_node() -> None:
    rows = [make_mapping('N7:0', 'Write', topic='speed')]
    source = domain = Domain()
    graph: Any = source
    watch = StrayWatch(Graph(graph), '/cell/press', TopicNames.of(
        lambda name: f'/cell/press{name[1:]}', rows), Seen())
    domain.publishers = {'/write/speed': ['/a'], '/cell/write/speed': ['/b']}
    domain.subscribers = {'/write/speed': 1}
    news, = watch.look(0.0)
    assert news == (log.WARN, 'topics beside ours', (
        '/cell/write/speed is published by /b, but not written: this bridge takes '
        '/cell/press/write/speed'))
