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
Find other nodes that publish topics of ours, or that use names beside ours.

A subscriber cannot tell the messages of a second publisher from ours, and DDS has no event that
tells one publisher of another. So we count the publishers of our topics in the ROS graph, each
once a second.
"""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Collection, Iterator, Mapping
from itertools import islice
import math
from typing import NamedTuple

from abdf1_ros.ros.diagnostics.graph import Graph, GraphTopics, UNKNOWN_NODE
from abdf1_ros.ros.diagnostics.log import ERROR, News, WARN
from abdf1_ros.ros.diagnostics.status import Seen
from abdf1_ros.ros.topic_names import TopicNames
from abdf1_ros.text import first

# Longest time (s) between two counts of a topic. A count takes some 10 us. So topics are counted
# in turns: a thousand at once would hold up the link.
_PERIOD = 1.0

# Most topics beside ours that are looked at after a query: any program can make thousands.
_MOST_BESIDE = 40

# Seconds after which the nodes of a topic are asked for again although their number is the same: a
# question takes some 100 us.
_NAMES_LAST = 10.0

# Seconds in which the name of a new node comes, also if its first message is lost: Fast DDS sends
# a message again after 3 s.
_NAME_COMES = 3.5


class _Publishers(NamedTuple):
    """
    The number of publishers of a topic, and their nodes.

    - ``until``: until when (s) the nodes need no further question
    - ``nameless``: since when (s) one of them has no name; infinite if all have a name
    """

    size: int
    nodes: frozenset[str]
    until: float
    nameless: float = math.inf


_NO_PUBLISHERS = _Publishers(0, frozenset(), 0.0)


def _nameless(nodes: Collection[str], before: float, now: float) -> float:
    """Return since when (s) a node has no name, if that was ``before`` at the last look."""
    return min(before, now) if UNKNOWN_NODE in nodes else math.inf


def _told(nodes: Collection[str], nameless: float, now: float) -> set[str]:
    """Return the nodes to tell of: those with a name, and a node whose name does not come."""
    return {*nodes} - ({UNKNOWN_NODE} if now < nameless + _NAME_COMES else set())


class OtherPublisherWatch:
    """
    Reports other nodes that publish topics of ours.

    Nodes of our own full name do not count: an earlier run that was killed, a spare, or what
    ``NameWatch`` reports. A node that has come this moment may have no name yet.
    """

    def __init__(self, graph: Graph, our_name: str, names: TopicNames, seen: Seen) -> None:
        self._graph = graph
        self._our_name = our_name
        self._seen = seen
        self._turns = deque(names.published)
        self._last_look = -math.inf
        self._crowded: dict[str, _Publishers] = {}

    def look(self, now: float) -> list[News]:
        """Return the nodes that are new at the clock value ``now`` (s), each once for a topic."""
        found, new = self._seen.other_publishers, defaultdict[str, list[str]](list)
        for topic in self._due(now):
            before = found.pop(topic, ())
            if nodes := self._others(topic, now):
                found[topic] = nodes
            for node in nodes:
                if node not in before:
                    new[node].append(topic)
        return [News(ERROR, 'other publishers', (
            f'{node} publishes {first(topics)} too: subscribers take its messages for ours. End '
            'it, or give its topics other names')) for node, topics in new.items()]

    def _due(self, now: float) -> Iterator[str]:
        """Yield the topics whose turn it is; a waiting spare publishes none."""
        part = min(1.0, (now - self._last_look) / _PERIOD)
        self._last_look = now
        if self._seen.is_waiting():
            self._seen.other_publishers.clear()
            return
        for _ in range(math.ceil(part * len(self._turns))):
            self._turns.rotate(-1)
            yield self._turns[-1]

    def _others(self, topic: str, now: float) -> tuple[str, ...]:
        """Return the other nodes that publish a topic."""
        before = self._crowded.pop(topic, _NO_PUBLISHERS)
        if (size := self._graph.count_publishers(topic)) < 2:
            return ()
        if size == before.size and now < before.until and before.nameless == math.inf:
            found = before
        else:
            nodes = frozenset(self._graph.publishers(topic))
            found = _Publishers(size, nodes, now + _NAMES_LAST,
                                _nameless(nodes, before.nameless, now))
        self._crowded[topic] = found
        return tuple(sorted(_told(found.nodes, found.nameless, now) - {self._our_name}))


class _Side(NamedTuple):
    """
    What other nodes use of a bridge: its write topics, its read topics, or one kind of services.

    - ``part``: of the names, in ``ROW_PARTS``
    - ``users``: returns the nodes that use a name
    - ``partners``: returns how many nodes take, publish or offer the name
    - ``use``: how the nodes use it, and what is missing
    - ``unknown``: what is wrong with a row that there is not
    - ``names``: the full names by the topic of the row; none for services
    - ``verb``: what the bridge does with these topics
    - ``opposite``: the rows of the other direction, which are ``only`` so
    """

    part: str
    users: Callable[[str], list[str]]
    partners: Callable[[str], int]
    use: tuple[str, str]
    unknown: str
    names: Mapping[str, str] = {}
    verb: str = ''
    opposite: Collection[str] = ()
    only: str = ''

    def reason(self, row: str) -> str:
        """Return what is wrong with a name, from the topic of the row."""
        if row in self.names:
            return f'this bridge {self.verb} {self.names[row]}'
        return f'{row} is only {self.only}' if row in self.opposite else self.unknown


def _sides(graph: Graph, names: TopicNames) -> Iterator[_Side]:
    yield _Side('write', graph.publishers, graph.count_subscribers, ('published', 'not written'),
                'no row writes this topic', names.written, 'takes', names.read, 'read')
    yield _Side('read', graph.subscribers, graph.count_publishers,
                ('subscribed to', 'not published'), 'no row reads this topic',
                names.read, 'publishes', names.written, 'written')
    for part, rows in ('set', 'written rows of one bit'), ('read_now', 'rows that are read'):
        yield _Side(part, graph.clients, graph.count_services, ('called', 'not offered'),
                    f'only {rows} have it, within most_services; none has in Mode Listen')


class StrayWatch:
    """
    Reports nodes that use topics or services that look like ours, and that no node has.

    These are topics below ``~/write/`` without a Write row, published; topics below ``~/read/``
    without a Read row, subscribed to; and both without the name of the node or without the
    namespace. Of the services of rows, these are clients of one that is not offered.
    """

    def __init__(self, graph: Graph, our_name: str, names: TopicNames, seen: Seen) -> None:
        self._graph = graph
        self._our_name = our_name
        self._seen = seen
        self._topics: GraphTopics | None = None
        self._nameless: dict[str, float] = {}
        self._sides = tuple(_sides(graph, names))

    def look(self, now: float) -> list[News]:
        """Return the names that are new at the clock value ``now`` (s), each once."""
        topics = self._graph.topics(now)
        if topics is self._topics:
            return []
        self._topics, before = topics, self._seen.strays
        self._seen.strays = {} if self._seen.is_waiting() else dict(self._strays(topics, now))
        return [News(WARN, 'topics beside ours', f'{topic} {text}')
                for topic, text in self._seen.strays.items() if topic not in before]

    def _strays(self, topics: GraphTopics, now: float) -> Iterator[tuple[str, str]]:
        before, self._nameless = self._nameless, {}
        for side in self._sides:
            done, lacks = side.use
            for name, reason in islice(self._unmet(side, topics), _MOST_BESIDE):
                nodes = side.users(name)
                nameless = _nameless(nodes, before.get(name, math.inf), now)
                self._nameless[name] = nameless
                if told := sorted(_told(nodes, nameless, now)):
                    yield name, f'is {done} by {first(told)}, but {lacks}: {reason}'

    def _unmet(self, side: _Side, topics: GraphTopics) -> Iterator[tuple[str, str]]:
        """Yield names that look like ours, and that no node has; and what is wrong with each."""
        ours = {*side.names.values()}
        namespace = self._our_name.rpartition('/')[0]
        for prefix in dict.fromkeys((self._our_name, '', namespace)):
            is_below = prefix == self._our_name
            for name in topics.below.get((prefix, side.part), ()):
                row = name.removeprefix(f'{prefix}/{side.part}/')
                if name in ours or not (is_below or row in side.names):
                    continue
                # Below our name only we take messages: another subscriber may record them.
                if (is_below and side.part == 'write') or not side.partners(name):
                    yield name, side.reason(row)
