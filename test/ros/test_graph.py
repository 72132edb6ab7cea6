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

"""Nodes of our name, and topics that somebody uses with another message type."""

from collections.abc import Iterable
from typing import Any

from abdf1_ros.ros.diagnostics import graph as graph_module
from abdf1_ros.ros.diagnostics.graph import Graph, NameWatch, TypeWatch
from abdf1_ros.ros.diagnostics.log import News
import pytest
from support.mappings import make_mapping

BITS, WORDS = 'std_msgs/msg/UInt8MultiArray', 'std_msgs/msg/Int16MultiArray'


class Domain:
    """Nodes and topics as a node sees them; ``looks`` counts how often."""

    def __init__(self) -> None:
        self.topics: dict[str, list[str]] = {}
        self.names = [('press', '/cell'), ('paint', '/cell')]
        self.looks = 0

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        self.looks += 1
        return self.names

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        self.looks += 1
        return list(self.topics.items())


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
    return TypeWatch(graph, lambda topic: topic.replace('~', '/cell/abdf1'), [
        make_mapping('B3:0/0', 'ReadWrite', topic='door'), make_mapping('N7:0', topic='n')])


def test_other_type_is_told_once_and_again_when_it_comes_back(
        domain: Domain, graph: Graph) -> None:
    watch = watch_of(graph)
    domain.topics = {'/cell/abdf1/read/door': [BITS], '/cell/abdf1/read/n': [WORDS],
                     '/cell/abdf1/write/door': ['std_msgs/msg/Bool', BITS],
                     '/other/read/door': [BITS, WORDS]}
    told = [f'/cell/abdf1/write/door is {BITS}; another node uses it as std_msgs/msg/Bool, '
            'and DDS does not connect different types']
    assert [texts(watch.look(now)) for now in (10.0, 20.0)] == [told, []]
    domain.topics['/cell/abdf1/write/door'] = [BITS]
    assert watch.look(30.0) == []
    domain.topics['/cell/abdf1/write/door'] = [BITS, 'std_msgs/msg/Bool']
    assert texts(watch.look(40.0)) == told


def test_looks_at_topics_are_as_far_apart_as_they_are_long(
        domain: Domain, graph: Graph, monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter((0.0, 0.006))
    monkeypatch.setattr(graph_module, 'thread_time', lambda: next(times))
    for now in (10.0, 12.1, 21.9):
        graph.clashes(now)
    assert domain.looks == 1


def test_nodes_of_a_process_share_a_look(domain: Domain, graph: Graph) -> None:
    assert [graph.nodes(name, '/cell', 10.0) for name in ('press', 'paint', 'oven')] == [1, 1, 0]
    first, second = watch_of(graph), watch_of(graph)
    domain.topics = {'/cell/abdf1/read/n': [BITS, WORDS]}
    assert first.look(10.0) == second.look(10.0) != []
    assert domain.looks == 2


def test_each_node_of_a_name_counts(domain: Domain, graph: Graph) -> None:
    domain.names += [('press', '/cell'), ('press', '/')]
    assert graph.nodes('press', '/cell', 0.0) == 2


def changes_of(*counts: int) -> list[tuple[int, str]]:
    """Return what is told, and when (s), where so many nodes are called so, one look a second."""
    watch = NameWatch('/press', lambda now: counts[int(now)])
    return [(now, news.text.partition(':')[0]) for now in range(len(counts))
            for news in (*watch.look(now), *watch.look(now + 0.1))]


MAYBE = 'another node is called /press too, or an earlier run of it was killed less than 20 s ago'
GONE = 'no other node is called /press any more'


def test_other_node_of_our_name_is_told_at_once_and_again_when_it_is_no_earlier_run() -> None:
    assert changes_of(*[1] * 5, *[2] * 40, *[1] * 5) == [
        (5, MAYBE), (35, 'another node is called /press too'), (45, GONE)]


def test_earlier_run_that_was_killed_is_forgotten() -> None:
    assert changes_of(*[2] * 25, 1, *[2] * 25, 0) == [(0, MAYBE), (25, GONE), (26, MAYBE),
                                                      (51, GONE)]
