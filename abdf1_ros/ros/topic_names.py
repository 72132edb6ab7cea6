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

"""The full names of a bridge's topics, after the remaps of the user."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from collections.abc import Mapping as MappingType
from dataclasses import dataclass

from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.text import first, printable

# The topics that belong to no row; only we publish them.
_OWN = ('~/write_results', '~/active_stations', '~/snapshot')


@dataclass(frozen=True, slots=True)
class TopicNames:
    """
    The full name of each topic.

    - ``read``, ``written``: of the rows, by the topic of the row
    - ``own``: of no row
    """

    read: MappingType[str, str]
    written: MappingType[str, str]
    own: tuple[str, ...]

    @classmethod
    def of(cls, resolve: Callable[[str], str], mappings: Iterable[Mapping]) -> TopicNames:
        """
        Return the names of a map's topics; ``resolve`` returns the full name of a topic.

        Raises ConfigurationError if remaps give two topics one name: subscribers could not tell
        the values of two rows apart, and a bridge would write what it reads.
        """
        rows = [*mappings]
        names = cls({row.topic: resolve(f'~/read/{row.topic}') for row in rows if row.reads},
                    {row.topic: resolve(f'~/write/{row.topic}') for row in rows if row.writes},
                    tuple(map(resolve, _OWN)))
        if problems := [*names._doubles()]:
            raise ConfigurationError(problems)
        return names

    @property
    def published(self) -> tuple[str, ...]:
        """Return the topics that only this bridge may publish."""
        return *self.read.values(), *self.own

    def idle(self, our_name: str, remapped: Iterable[str]) -> Iterator[str]:
        """
        Yield why remaps of read and write topics have no effect; ROS does not report this.

        ``remapped``: the names that the user has remapped; ``our_name``: of the node.
        """
        ours = {f'~/read/{topic}' for topic in self.read} | {
            f'~/write/{topic}' for topic in self.written}
        for name in remapped:
            below = name.removeprefix('~').removeprefix(our_name).strip('/')
            right = f'~/{below}'
            if not below.startswith(('read/', 'write/')) or \
                    right in ours and name in (right, f'{our_name}/{below}'):
                continue
            yield f'the remap of {printable(name)} has no effect: ' + (
                f'write {right}' if right in ours else 'no row has this topic')

    def _doubles(self) -> Iterator[Problem]:
        owners = defaultdict[str, list[str]](list)
        for before, names in ('~/read/', self.read), ('~/write/', self.written):
            for topic, name in names.items():
                owners[name].append(before + topic)
        for topic, name in zip(_OWN, self.own, strict=True):
            owners[name].append(topic)
        for name, topics in owners.items():
            if len(topics) > 1:
                yield Problem('remaps', (
                    f'{first(topics)} have one name, {name}; give each topic a name of its own'))
