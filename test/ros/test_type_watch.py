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

"""Topics that somebody uses with another message type."""

from __future__ import annotations

from abdf1_ros.ros import type_watch
from abdf1_ros.ros.type_watch import TypeWatch
import pytest
from support.mappings import make_mapping

BITS, WORDS = 'std_msgs/msg/UInt8MultiArray', 'std_msgs/msg/Int16MultiArray'


class Graph:
    """Topics as a node sees them; ``looks`` counts how often."""

    def __init__(self) -> None:
        self.topics: dict[str, list[str]] = {}
        self.looks = 0

    def resolve_topic_name(self, topic: str) -> str:
        return topic.replace('~', '/cell/abdf1')

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        self.looks += 1
        return list(self.topics.items())


@pytest.fixture
def graph() -> Graph:
    return Graph()


@pytest.fixture
def watch(graph: Graph) -> TypeWatch:
    watch = TypeWatch(graph)
    watch.use([make_mapping('B3:0/0', 'ReadWrite', topic='door'), make_mapping('N7:0', topic='n')])
    return watch


def test_other_type_is_told_once_and_again_when_it_comes_back(
        graph: Graph, watch: TypeWatch) -> None:
    graph.topics = {'/cell/abdf1/read/door': [BITS], '/cell/abdf1/read/n': [WORDS],
                    '/cell/abdf1/write/door': ['std_msgs/msg/Bool', BITS],
                    '/other/read/door': [BITS, WORDS]}
    told = [f'/cell/abdf1/write/door is {BITS}; somebody uses it as std_msgs/msg/Bool, and DDS '
            'connects different types to nothing']
    assert [watch.look(now) for now in (10.0, 20.0)] == [told, []]
    graph.topics['/cell/abdf1/write/door'] = [BITS]
    assert watch.look(30.0) == []
    graph.topics['/cell/abdf1/write/door'] = [BITS, 'std_msgs/msg/Bool']
    assert watch.look(40.0) == told


def test_looks_are_as_far_apart_as_they_are_long(
        graph: Graph, watch: TypeWatch, monkeypatch: pytest.MonkeyPatch) -> None:
    times = iter((0.0, 0.006))
    monkeypatch.setattr(type_watch, 'thread_time', lambda: next(times))
    for now in (10.0, 12.1, 21.9):
        watch.look(now)
    assert graph.looks == 1
