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
Who uses our topics with another message type: DDS connects such ends to nothing.

Fast DDS has no event for it, so the graph is looked at. That costs some microseconds a topic
of the whole domain, and a process may have a hundred nodes, so long looks come seldom.
"""

from __future__ import annotations

from collections.abc import Iterable
from time import thread_time
from typing import Protocol

from abdf1_ros.settings.mapping import Mapping

# Between two looks (s): at least, and as a multiple of the processor time of one.
_LEAST = 2.0
_MULTIPLE = 2000


class Graph(Protocol):
    """What is used of a node."""

    def resolve_topic_name(self, topic: str) -> str:
        """Return the full name of a topic."""

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        """Return every topic of the domain with all its types."""


class TypeWatch:
    """Watches the topics of a map; ``use`` names its rows."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._own: dict[str, str] = {}
        self._told: set[tuple[str, str]] = set()
        self._next_look = 0.0

    def use(self, mappings: Iterable[Mapping]) -> None:
        """Watch the topics of these rows from now on."""
        self._own = {
            self._graph.resolve_topic_name(f'~/{what}/{mapping.topic}'):
            f'std_msgs/msg/{mapping.message_type.message}'
            for mapping in mappings for what, is_there in (
                ('read', mapping.reads), ('write', mapping.writes)) if is_there}
        self._told = set()

    def look(self, now: float) -> list[str]:
        """Return what is new at the clock value ``now`` (s), each once."""
        if now < self._next_look:
            return []
        begun = thread_time()
        found = {(topic, kind) for topic, kinds in self._graph.get_topic_names_and_types()
                 if len(kinds) > 1 and topic in self._own
                 for kind in kinds if kind != self._own[topic]}
        self._next_look = now + max(_LEAST, _MULTIPLE * (thread_time() - begun))
        news, self._told = found - self._told, found
        return [f'{topic} is {self._own[topic]}; somebody uses it as {kind}, and DDS connects '
                'different types to nothing' for topic, kind in sorted(news)]
