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

"""The status ``topics``: other nodes that publish topics of ours, or beside them."""

from __future__ import annotations

from itertools import islice

from abdf1_ros.ros.diagnostics.status import ERROR, Judgement, OK, Seen, WARN
from abdf1_ros.text import first

_MOST_SHOWN = 40  # topics with another publisher that the status shows in its values


class TopicsStatus:
    """Which topics of this bridge other nodes publish, and which names beside ours they use."""

    name = 'topics'

    def __init__(self, port: str, seen: Seen) -> None:
        self.hardware_id = port
        self._seen = seen

    def judge(self, now: float) -> Judgement:
        """Return ERROR for another publisher of our topics, WARN for one beside them."""
        others, strays = self._seen.other_publishers, self._seen.strays
        notes = []
        if others:
            nodes = sorted({node for nodes in others.values() for node in nodes})
            notes.append(f'{first(nodes)} {"publishes" if len(nodes) == 1 else "publish"} '
                         f'{first(sorted(others))} too')
        if strays:
            notes.append(f'used, but not there: {first(sorted(strays))}')
        return ERROR if others else WARN if strays else OK, \
            '; '.join(notes) or 'no other node publishes topics of this bridge'

    def values(self, now: float) -> dict[str, str]:
        others = {
            topic: f'is published by {first(nodes)} too'
            for topic, nodes in islice(sorted(self._seen.other_publishers.items()), _MOST_SHOWN)}
        return {**others, **self._seen.strays}
