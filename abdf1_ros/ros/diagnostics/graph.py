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
What other nodes do that concerns ours: they have its name, or its topics with other types.

DDS has no event for either, so the graph is looked at. That costs some microseconds a topic of the
whole domain, and a process may have a hundred nodes: they share one ``Graph``, which looks for all
of them, and seldom where a look is long.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from collections.abc import Mapping as MappingType
from time import thread_time

from abdf1_ros.ros.diagnostics.log import INFO, News, WARN
from abdf1_ros.settings.mapping import Mapping
from rclpy.node import Node

# s; a node of our name is to be reported before it has taken many of our messages.
_NAMES_PERIOD = 0.25

# After a start others are found in so long (s), mostly in a fifth of that.
DISCOVERY = 0.5

# Between two looks at topics (s): at least, and as a multiple of the processor time of one.
_LEAST = 2.0
_MULTIPLE = 2000

# A node that was killed stays visible for up to 20 s, the lease of its DDS participant. A node of
# our name that is seen for longer (s) is not an earlier run of ours.
_KILLED_IS_SEEN = 30.0


class Graph:
    """The nodes and topics of the domain, as ``source`` sees them; used by one thread."""

    def __init__(self, source: Node) -> None:
        self._source = source
        self._nodes: Counter[tuple[str, str]] = Counter()
        self._clashes: dict[str, list[str]] = {}
        self._next_names = self._next_topics = 0.0

    def nodes(self, name: str, namespace: str, now: float) -> int:
        """Return how many nodes are called so, at the clock value ``now`` (s)."""
        if now >= self._next_names:
            self._next_names = now + _NAMES_PERIOD
            self._nodes = Counter(self._source.get_node_names_and_namespaces())
        return self._nodes[name, namespace]

    def clashes(self, now: float) -> MappingType[str, list[str]]:
        """Return the topics that have more than one type, the same object until the next look."""
        if now >= self._next_topics:
            begun = thread_time()
            self._clashes = {topic: types for topic, types
                             in self._source.get_topic_names_and_types() if len(types) > 1}
            self._next_topics = now + max(_LEAST, _MULTIPLE * (thread_time() - begun))
        return self._clashes


class NameWatch:
    """
    Find out when another node has our name, so that topics and services of both are one.

    ``count`` tells how many nodes of the name there are; ours is one of them. That is said as soon
    as it is seen, before it is known whether it is an earlier run: both may take the next command.
    The first look is at the clock value ``first_look`` (s); ``has_looked`` is true from then on.
    ``renaming`` is the argument that gives another name.
    """

    def __init__(self, name: str, count: Callable[[float], int], first_look: float = 0.0,
                 renaming: str = '-r __node:=line_2') -> None:
        self.text = ''
        self.has_looked = False
        self._name = name
        self._count = count
        self._renaming = renaming
        self._since: float | None = None
        self._next_look = first_look

    def look(self, now: float) -> Iterator[News]:
        """Look now and then; tell when it comes, stays, and goes."""
        if now < self._next_look:
            return
        self._next_look = now + _NAMES_PERIOD
        self.has_looked = True
        if self._count(now) > 1:
            self._since = now if self._since is None else self._since
            stays = now - self._since >= _KILLED_IS_SEEN
            text = f'another node is called {self._name} too' + (
                '' if stays else ', or an earlier run of it was killed less than 20 s ago')
            news = News(WARN, 'the name', f'{text}: both publish and take the same topics; give '
                        f'one another name, as in {self._renaming}')
        else:
            self._since, text = None, ''
            news = News(INFO, 'the name', f'no other node is called {self._name} any more')
        if text != self.text:
            self.text = text
            yield news


class TypeWatch:
    """
    Watches the topics of a map for ends that DDS connects to nothing.

    ``resolve`` makes the full name of a topic.
    """

    def __init__(self, graph: Graph, resolve: Callable[[str], str],
                 mappings: Iterable[Mapping]) -> None:
        self._graph = graph
        self._own = {
            resolve(f'~/{what}/{mapping.topic}'): f'std_msgs/msg/{mapping.message_type.message}'
            for mapping in mappings for what, is_there in (
                ('read', mapping.reads), ('write', mapping.writes)) if is_there}
        self._seen: MappingType[str, list[str]] = {}
        self._told: set[tuple[str, str]] = set()

    def look(self, now: float) -> list[News]:
        """Return what is new at the clock value ``now`` (s), each once."""
        clashes = self._graph.clashes(now)
        if clashes is self._seen:
            return []
        self._seen = clashes
        found = {(topic, kind) for topic in clashes.keys() & self._own.keys()
                 for kind in clashes[topic] if kind != self._own[topic]}
        news, self._told = found - self._told, found
        return [News(WARN, 'types of topics', (
            f'{topic} is {self._own[topic]}; a node uses it as {kind}, and DDS connects '
            'different types to nothing')) for topic, kind in sorted(news)]
