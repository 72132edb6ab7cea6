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
The graph of the domain; find nodes of our name, or that use our topics with other types.

DDS has no event for such cases, so we query the graph now and then. A query takes some
microseconds for each topic of the domain, and a process may have a hundred nodes. So all its nodes
share one ``Graph``. The longer a query takes, the longer is the pause after it.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator
from collections.abc import Mapping as MappingType
from contextlib import suppress
from functools import partial
from time import thread_time
from typing import NamedTuple

from abdf1_ros.ports.clock import line_time
from abdf1_ros.ros.diagnostics.dds import DdsWatch
from abdf1_ros.ros.diagnostics.log import INFO, News, WARN
from abdf1_ros.ros.topic_names import TopicNames
from abdf1_ros.settings.mapping import Mapping
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.topic_endpoint_info import TopicEndpointInfo

# Seconds between two looks for our name; short, to report a second node with our name before it
# has taken many of our messages.
_NAMES_PERIOD = 0.25

# Longest time (s) that a new node needs to find the nodes that run already; usually a fifth of it
# is enough.
DISCOVERY = 0.5

# Pause between two queries for topics: at least ``_LEAST`` s, and at least ``_MULTIPLE`` times the
# processor time of a query.
_LEAST = 2.0
_MULTIPLE = 2000

# A killed node stays visible for up to 20 s, the lease of its DDS participant. A node with our
# name that is seen for longer than this (s) is not an earlier run of ours.
_KILLED_IS_SEEN = 30.0


# The name that rmw gives a node that it does not know, or not yet.
_UNKNOWN = '_NODE_NAME_UNKNOWN_'
UNKNOWN_NODE = 'a program without a node name'


# The parts of full names between the bridge's name and the row's name: two of topics, two of
# services.
ROW_PARTS = 'write', 'read', 'set', 'read_now'


class GraphTopics(NamedTuple):
    """
    The odd topics of one query.

    - ``clashes``: the types of each topic with more than one
    - ``below``: the names ``<prefix>/<part>/<rest>`` of each part in ``ROW_PARTS``, by both
    - ``services``: the types of each service with more than one: a client uses another
    """

    clashes: MappingType[str, list[str]]
    below: MappingType[tuple[str, str], list[str]]
    services: MappingType[str, list[str]]

    @classmethod
    def of(cls, found: Collection[tuple[str, list[str]]],
           services: Collection[tuple[str, list[str]]]) -> GraphTopics:
        """Return the odd topics among topics and services with their types."""
        below = defaultdict[tuple[str, str], list[str]](list)
        clashes = []
        for names, parts in (found, ROW_PARTS[:2]), (services, ROW_PARTS[2:]):
            clashes.append({name: types for name, types in names if len(types) > 1})
            for name, _ in names:
                for part in parts:
                    if f'/{part}/' in name:
                        below[name.partition(f'/{part}/')[0], part].append(name)
        return cls(clashes[0], below, clashes[1])


class Graph:
    """The nodes and topics of the domain, as the node ``source`` sees them; for one thread."""

    def __init__(self, source: Node) -> None:
        self.dds = DdsWatch()
        self._source = source
        self._nodes: Counter[tuple[str, str]] = Counter()
        self._topics = GraphTopics.of((), ())
        self._next_names = self._next_topics = 0.0

    def name_watch(self, node: Node, renaming: str = '-r __node:=line_2', *,
                   is_spare: bool = False) -> NameWatch:
        """Return a watch for a second node with our name; a spare has our name on purpose."""
        count = partial(self.nodes, node.get_name(), node.get_namespace())
        return NameWatch(node.get_fully_qualified_name(), (lambda now: 1) if is_spare else count,
                         line_time() + DISCOVERY, renaming)

    def nodes(self, name: str, namespace: str, now: float) -> int:
        """Return how many nodes have this name, at the clock value ``now`` (s)."""
        if now >= self._next_names:
            self._next_names = now + _NAMES_PERIOD
            self._nodes = Counter(self._source.get_node_names_and_namespaces())
        return self._nodes[name, namespace]

    def topics(self, now: float) -> GraphTopics:
        """Return the odd topics: the same object until the next query."""
        if now >= self._next_topics:
            begun = thread_time()
            self._topics = GraphTopics.of(self._source.get_topic_names_and_types(),
                                          self._source.get_service_names_and_types())
            self._next_topics = now + max(_LEAST, _MULTIPLE * (thread_time() - begun))
        return self._topics

    def offered(self, node: str) -> dict[str, str]:
        """Return the types of the services of a node, by their full names."""
        namespace, _, name = node.rpartition('/')
        with suppress(NodeNameNonExistentError):  # not known yet
            return {service: types[0] for service, types in
                    self._source.get_service_names_and_types_by_node(name, namespace or '/')}
        return {}

    def count_publishers(self, topic: str) -> int:
        """Return the number of publishers of a topic, by its full name."""
        return self._source.count_publishers(topic)

    def count_subscribers(self, topic: str) -> int:
        """Return the number of subscribers of a topic, by its full name."""
        return self._source.count_subscribers(topic)

    def count_services(self, service: str) -> int:
        """Return how many nodes offer a service, by its full name."""
        return self._source.count_services(service)

    def publishers(self, topic: str) -> list[str]:
        """Return the full names of the nodes that publish a topic, one for each publisher."""
        return _nodes(self._source.get_publishers_info_by_topic, topic)

    def subscribers(self, topic: str) -> list[str]:
        """Return the full names of the nodes that subscribe to a topic."""
        return _nodes(self._source.get_subscriptions_info_by_topic, topic)

    def clients(self, service: str) -> list[str]:
        """Return the full names of the nodes that have a client of a service."""
        found = []
        for name, namespace in self._source.get_node_names_and_namespaces():
            with suppress(NodeNameNonExistentError):  # it has gone
                if service in dict(self._source.get_client_names_and_types_by_node(
                        name, namespace)):
                    found.append(f'{namespace.rstrip("/")}/{name}')
        return found or [UNKNOWN_NODE] * self._source.count_clients(service)

    def has_other(self, topic: str, kind: str, name: str) -> bool:
        """Tell whether a node other than ``name`` has this topic with this type now."""
        try:
            ends = [*self._source.get_publishers_info_by_topic(topic),
                    *self._source.get_subscriptions_info_by_topic(topic)]
        except UnicodeDecodeError:  # rclpy cannot read the name of a node, so it is not ours
            return True
        return any(end.topic_type == kind and node_of(end) != name for end in ends)


def _nodes(ends_of: Callable[[str], list[TopicEndpointInfo]], topic: str) -> list[str]:
    try:
        ends = ends_of(topic)
    except UnicodeDecodeError:  # rclpy cannot read the name of one of them
        return ['a node whose name cannot be read']
    return [*map(node_of, ends)]


def node_of(end: TopicEndpointInfo) -> str:
    """Return the full name of the node that has a publisher or subscriber."""
    return UNKNOWN_NODE if end.node_name == _UNKNOWN \
        else f'{end.node_namespace.rstrip("/")}/{end.node_name}'


class NameWatch:
    """
    Report that another node has our name: both then have the same topics and services.

    Such a node is reported at once, even if it may be an earlier run of ours that was killed.
    Until one of the two ends, both may take the next command.

    - ``count``: returns the number of nodes with our name, our own included
    - ``first_look``: clock value (s) of the first look
    - ``has_looked``: True after the first look
    - ``renaming``: the argument that gives our node another name
    """

    def __init__(self, name: str, count: Callable[[float], int], first_look: float = 0.0,
                 renaming: str = '') -> None:
        self.text = ''
        self.has_looked = False
        self._name = name
        self._count = count
        self._renaming = renaming
        self._since: float | None = None
        self._next_look = first_look

    def look(self, now: float) -> Iterator[News]:
        """Look if it is time; yield news if such a node has come, stays, or has gone."""
        if now < self._next_look:
            return
        self._next_look = now + _NAMES_PERIOD
        self.has_looked = True
        if self._count(now) > 1:
            self._since = now if self._since is None else self._since
            stays = now - self._since >= _KILLED_IS_SEEN
            text = f'another node is called {self._name} too' + (
                '' if stays else ', or an earlier run of it was killed less than 20 s ago')
            news = News(WARN, 'the name', f'{text}: both use the same topics. If one is a spare '
                        f'of the other, set standby on both; if not, rename one, as in '
                        f'{self._renaming}')
        else:
            self._since, text = None, ''
            news = News(INFO, 'the name', f'no other node is called {self._name} any more')
        if text != self.text:
            self.text = text
            yield news


class TypeWatch:
    """
    Watches our topics and services for nodes that use another type: DDS does not connect them.

    ``our_name`` is the full name of our node. Before a reload a topic may have had another type,
    and a query may be older than that.
    """

    def __init__(self, graph: Graph, our_name: str, names: TopicNames,
                 mappings: Iterable[Mapping]) -> None:
        self._graph = graph
        self._our_name = our_name
        self._own = {
            full[mapping.topic]: f'std_msgs/msg/{mapping.message_type.message}'
            for mapping in mappings for full, is_there in (
                (names.read, mapping.reads), (names.written, mapping.writes)) if is_there}
        self._seen: GraphTopics | None = None
        self._told: set[tuple[str, str, str]] = set()

    def look(self, now: float) -> list[News]:
        """Return the wrong types that are new at the clock value ``now`` (s), each once."""
        seen = self._graph.topics(now)
        if seen is self._seen:
            return []
        self._seen = seen
        found = {(topic, kind, own) for topic, kind, own in _others(seen.clashes, self._own)
                 if (topic, kind, own) in self._told
                 or self._graph.has_other(topic, kind, self._our_name)}
        if any(service.startswith(f'{self._our_name}/') for service in seen.services):
            found |= {*_others(seen.services, self._graph.offered(self._our_name))}
        news, self._told = found - self._told, found
        return [News(WARN, 'types of topics', (
            f'{name} is {own}; another node uses it as {kind}, and DDS does not connect different '
            'types')) for name, kind, own in sorted(news)]


def _others(clashes: MappingType[str, list[str]],
            own: MappingType[str, str]) -> Iterator[tuple[str, str, str]]:
    """Yield name, other type and our type of each of our names that has several types."""
    for name in clashes.keys() & own.keys():
        for kind in clashes[name]:
            if kind != own[name]:
                yield name, kind, own[name]
