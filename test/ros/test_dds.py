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

"""Why no program hears Fast DDS; nodes of our name, and topics with another message type."""

from collections.abc import Iterable
import os
from pathlib import Path
import shutil
import subprocess
import sys
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

from abdf1_ros.ros.diagnostics import graph as graph_module
from abdf1_ros.ros.diagnostics.dds import BEGAN_EARLY, DdsWatch, lost_locks
from abdf1_ros.ros.diagnostics.graph import Graph, NameWatch, TypeWatch
from abdf1_ros.ros.diagnostics.log import News
from abdf1_ros.ros.topic_names import TopicNames
import pytest
from support.mappings import make_mapping
from support.ros import PROFILES_VARIABLE

# A node that uses shared memory, as at the home of a user. It removes its own files.
NODE = """
import os
from abdf1_ros.ros.diagnostics.dds import DdsWatch
import rclpy
rclpy.init()
node = rclpy.create_node('lonely')
files = DdsWatch()
print(repr(files.look(1.0) + files.look(20.0)))
for name in os.listdir('/proc/self/fd'):
    try:
        path = os.readlink(f'/proc/self/fd/{name}')
    except OSError:
        continue
    if path.startswith('/dev/shm/') and path.endswith('_el'):
        os.remove(path)
        os.remove(path.removesuffix('_el'))
print(repr(files.look(40.0)))
print(files.look(60.0))
"""
# How a host gets a network.
NETWORK_COMES = """
import subprocess
from abdf1_ros.ros.diagnostics.dds import has_network
def ip(*words): subprocess.run(['ip', *words], check=True)
print(has_network())
ip('link', 'set', 'lo', 'up')
ip('link', 'add', 'here', 'type', 'veth', 'peer', 'name', 'there')
ip('addr', 'add', '10.74.0.1/24', 'dev', 'here')
print(has_network())
ip('link', 'set', 'here', 'up')
print(has_network())  # the other end is down: no carrier
ip('link', 'set', 'there', 'up')
print(any(has_network() for _ in range(100_000)))  # the system has the carrier a moment later
ip('addr', 'flush', 'dev', 'here')
print(has_network())
"""
UNSET = ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_LOCALHOST_ONLY')
REHEARSAL = Path(__file__).parents[1] / 'lab' / 'rehearsal' / 'run.py'
NEEDS_NAMESPACES = pytest.mark.skipif(
    os.geteuid() or shutil.which('ip') is None or subprocess.run(
        ['unshare', '--net', 'true'], check=False, capture_output=True).returncode,
    reason='namespaces need root')


def test_node_notices_that_its_files_are_gone() -> None:
    environment = os.environ | {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    del environment[PROFILES_VARIABLE]
    done = subprocess.run([sys.executable, '-c', NODE], env=environment, capture_output=True,
                          text=True, check=True, timeout=60)
    before, once, twice = done.stdout.splitlines()
    assert (before, once) == ("''", "''")
    assert twice.startswith('the files of Fast DDS in /dev/shm are gone')


def test_lock_of_a_removed_file_counts_and_no_other() -> None:
    lock = Path(f'/dev/shm/fastrtps_test{os.getpid()}_el')
    with lock.open('w'):
        assert lost_locks() == frozenset()
        lock.unlink()
        assert lost_locks() == {f'{lock} (deleted)'}
    assert lost_locks() == frozenset()


def losses_seen(*lost: Iterable[str]) -> list[bool]:
    """Return at which looks the files count as gone, if these locks are lost one after another."""
    found = iter(map(frozenset, lost))
    files = DdsWatch(lambda: next(found))
    return [bool(files.look(20.0 * number)) for number in range(1, len(lost) + 1)]


def test_port_that_fast_dds_makes_anew_is_no_fault() -> None:
    assert losses_seen('', 'a', '', 'b', 'c', 'cd', 'cd', '') == [False] * 5 + [True, True, False]


def test_looks_are_five_seconds_apart() -> None:
    times: list[float] = []
    files = DdsWatch(lambda: frozenset(str(times.append(now))))
    for now in (1.0, 3.0, 5.9, 6.0, 7.0):
        files.look(now)
    assert times == [1.0, 6.0]


@pytest.fixture
def reaches_other_hosts(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in UNSET:
        monkeypatch.delenv(name, raising=False)


def links_seen(*found: bool) -> list[str]:
    """Return what looks say, 6 s apart, that find a network or none; the first is the start."""
    finds = iter(found)
    links = DdsWatch(has_links=lambda: next(finds))
    return [links.look(6.0 * number) for number in range(1, len(found))]


@pytest.mark.usefixtures('reaches_other_hosts')
def test_network_that_comes_after_the_start_is_told_of_and_no_other() -> None:
    assert links_seen(False, False, True) == ['', BEGAN_EARLY]
    links = DdsWatch(has_links=iter([False, True, False]).__next__)
    assert [links.look(0.0), links.look(2.0), links.look(60.0)] == [BEGAN_EARLY] * 3
    links = DdsWatch(has_links=iter([True]).__next__)
    assert [links.look(1.0), links.look(60.0)] == ['', '']


@pytest.mark.usefixtures('reaches_other_hosts')
@pytest.mark.parametrize(('name', 'value'), [
    ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST'), ('ROS_AUTOMATIC_DISCOVERY_RANGE', 'off'),
    ('ROS_LOCALHOST_ONLY', '1')])
def test_process_for_this_host_needs_no_network(
        monkeypatch: pytest.MonkeyPatch, name: str, value: str) -> None:
    monkeypatch.setenv(name, value)
    assert DdsWatch(has_links=iter([False, True]).__next__).look(1.0) == ''


@NEEDS_NAMESPACES
def test_network_is_a_link_that_is_up_with_a_carrier_and_an_address() -> None:
    done = subprocess.run(['unshare', '--net', sys.executable, '-c', NETWORK_COMES], check=False,
                          capture_output=True, text=True, cwd=Path(__file__).parents[2])
    assert done.stdout.split() == ['False', 'False', 'False', 'True', 'False'], done.stderr


BITS, WORDS = 'std_msgs/msg/UInt8MultiArray', 'std_msgs/msg/Int16MultiArray'
BOOL, TRIGGER = 'std_srvs/srv/SetBool', 'std_srvs/srv/Trigger'


class Domain:
    """Nodes and topics as a node sees them; ``looks`` counts how often."""

    def __init__(self) -> None:
        self.topics: dict[str, list[str]] = {}
        self.names = [('press', '/cell'), ('paint', '/cell')]
        self.users: dict[tuple[str, str], tuple[str, str]] = {}
        self.services: dict[str, list[str]] = {}
        self.looks = 0

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        self.looks += 1
        return self.names

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        self.looks += 1
        return list(self.topics.items())

    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]:
        return list(self.services.items())

    def get_service_names_and_types_by_node(
            self, name: str, namespace: str) -> list[tuple[str, list[str]]]:
        assert (name, namespace) == ('abdf1', '/cell')
        return [('/cell/abdf1/polling', [BOOL])]

    def get_publishers_info_by_topic(self, topic: str) -> list[SimpleNamespace]:
        return [SimpleNamespace(topic_type=kind, node_namespace=namespace, node_name=name)
                for kind in self.topics.get(topic, ())
                for name, namespace in [self.users.get((topic, kind), ('press', '/cell'))]]

    def get_subscriptions_info_by_topic(self, topic: str) -> list[SimpleNamespace]:
        return []


@pytest.fixture
def domain() -> Domain:
    return Domain()


@pytest.fixture
def graph(domain: Domain) -> Graph:
    source: Any = domain
    return Graph(source)


def texts(news: Iterable[News]) -> list[str]:
    return [text for _, _, text in news]


def watch_of(graph: Graph) -> TypeWatch:
    rows = [make_mapping('B3:0/0', 'ReadWrite', topic='door'), make_mapping('N7:0', topic='n')]
    names = TopicNames.of(lambda topic: topic.replace('~', '/cell/abdf1'), rows)
    return TypeWatch(graph, '/cell/abdf1', names, rows)


def test_other_type_is_told_once_and_again_when_it_comes_back(
        domain: Domain, graph: Graph) -> None:
    watch = watch_of(graph)
    domain.topics = {'/cell/abdf1/read/door': [BITS], '/cell/abdf1/read/n': [WORDS],
                     '/cell/abdf1/write/door': ['std_msgs/msg/Bool', BITS],
                     '/cell/abdf1/write/n': [BITS, WORDS], '/other/read/door': [BITS, WORDS]}
    told = [f'/cell/abdf1/write/door is {BITS}; another node uses it as std_msgs/msg/Bool, '
            'and DDS does not connect different types']
    assert [texts(watch.look(now)) for now in (10.0, 20.0)] == [told, []]
    domain.topics = {'/cell/abdf1/write/door': [BITS]}
    assert watch.look(30.0) == []
    domain.topics['/cell/abdf1/write/door'] = [BITS, 'std_msgs/msg/Bool']
    assert texts(watch.look(40.0)) == told


def test_client_of_another_type_is_told_once(domain: Domain, graph: Graph) -> None:
    watch = watch_of(graph)
    domain.services = {'/cell/abdf1/polling': [BOOL, TRIGGER], '/other/polling': [BOOL, TRIGGER],
                       '/cell/abdf1/gone': [BOOL, TRIGGER]}
    told = [f'/cell/abdf1/polling is {BOOL}; another node uses it as {TRIGGER}, and DDS does not '
            'connect different types']
    assert [texts(watch.look(now)) for now in (10.0, 20.0)] == [told, []]


def test_own_last_publisher_is_not_another_node(domain: Domain, graph: Graph) -> None:
    domain.topics = {'/cell/abdf1/read/n': [BITS, WORDS]}
    graph.topics(9.0)
    domain.topics = {'/cell/abdf1/read/n': [WORDS]}
    assert watch_of(graph).look(10.0) == []  # the query is from before the reload
    domain.topics = {'/cell/abdf1/read/n': [BITS, WORDS]}
    domain.users = {('/cell/abdf1/read/n', BITS): ('abdf1', '/cell')}
    watch = watch_of(graph)
    assert watch.look(20.0) == []  # the reload has not come to an end
    domain.users = {('/cell/abdf1/read/n', BITS): ('abdf1', '/')}
    assert len(watch.look(30.0)) == 1


def test_looks_at_topics_are_as_far_apart_as_they_are_long(
        domain: Domain, graph: Graph, monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter((0.0, 0.006))
    monkeypatch.setattr(graph_module, 'thread_time', lambda: next(times))
    for now in (10.0, 12.1, 21.9):
        graph.topics(now)
    assert domain.looks == 1


def test_nodes_of_a_process_share_a_look(domain: Domain, graph: Graph) -> None:
    assert [graph.nodes(name, '/cell', 10.0) for name in ('press', 'paint', 'oven')] == [1, 1, 0]
    first, second = watch_of(graph), watch_of(graph)
    domain.topics = {'/cell/abdf1/read/n': [BITS, WORDS]}
    assert first.look(10.0) == second.look(10.0) != []
    assert domain.looks == 2


def test_each_node_of_a_name_counts(
        domain: Domain, graph: Graph, monkeypatch: pytest.MonkeyPatch) -> None:
    domain.names += [('press', '/cell'), ('press', '/')]
    assert graph.nodes('press', '/cell', 0.0) == 2
    monkeypatch.setattr(graph_module, 'line_time', lambda: 10.0)
    node: Any = Mock(**{'get_name.return_value': 'press', 'get_namespace.return_value': '/cell'})
    for is_spare, told in (False, [False, True]), (True, [False, False]):
        watch = graph.name_watch(node, is_spare=is_spare)
        assert [bool([*watch.look(now)]) for now in (10.4, 10.5)] == told


def changes_of(*counts: int) -> list[tuple[int, str]]:
    """Return what is told, and when (s), where so many nodes are called so, one look a second."""
    watch = NameWatch('/press', lambda now: counts[int(now)])
    return [(now, news.text.partition(':')[0]) for now in range(len(counts))
            for news in (*watch.look(now), *watch.look(now + 0.1))]


MAYBE = 'another node is called /press too, or an earlier run of it was killed less than 20 s ago'
GONE = 'no other node is called /press any more'


def test_other_node_of_our_name_is_told_at_once_and_again_when_it_is_no_earlier_run() -> None:
    assert changes_of(*[2] * 40, *[1] * 5) == [
        (0, MAYBE), (30, 'another node is called /press too'), (40, GONE)]


def test_other_node_of_our_name_may_be_a_spare_that_a_new_name_would_end() -> None:
    (news,) = NameWatch('/press', lambda now: 2, renaming='-r __node:=line_2').look(0.0)
    assert news.text.partition(': ')[2] == (
        'both use the same topics. If one is a spare of the other, set standby on both; if not, '
        'rename one, as in -r __node:=line_2')


def test_earlier_run_that_was_killed_is_forgotten() -> None:
    assert changes_of(*[2] * 25, 1, *[2] * 25, 0) == [(0, MAYBE), (25, GONE), (26, MAYBE),
                                                      (51, GONE)]


@NEEDS_NAMESPACES
@pytest.mark.long  # test_standby.py has both hosts in one
@pytest.mark.parametrize(('fault', 'options'), [
    ('kill ', ()),  # a spare takes over the lines of a host that dies
    ('apart', ('--only', 'apart', '--discovery-server'))])  # no result comes a second time
def test_two_hosts_and_a_fault_between_them(fault: str, options: tuple[str, ...]) -> None:
    done = subprocess.run(
        [sys.executable, str(REHEARSAL), '--hosts', '2', '--lines', '1', '--faults', '1',
         '--seed', '1', *options], check=False, capture_output=True, text=True, timeout=110)
    assert done.returncode == 0, done.stdout + done.stderr
    assert f'{fault}    1 times, all lines read and written to after ' in done.stdout
