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
Guarded reads: values that are published only while the PLC's program runs (rules 13 to 15).

The port of a PLC answers also while its program is stopped. The rules have the numbers of
docs/heartbeats.md.
"""

from __future__ import annotations

import math

from abdf1_ros.driver.reads.point import Guard, ReadPoint
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.settings.mapping import Mapping


class RunGuard(Guard):
    """Permits values while a station says RUN, and the answer is within their stale time."""

    def __init__(self) -> None:
        super().__init__()
        self._told = -math.inf
        self._state = 'its mode is not known'

    def told(self, identity: Identity | None, asked: float) -> set[ReadPoint]:
        """
        Take an answer about the mode, None for an answer that cannot be used.

        If the program runs, return the points for which the previous answer was too old.
        """
        late = {point for point in self.points if asked - self._told > point.patience}
        is_running = identity is not None and bool(identity.is_running) and not identity.faults
        for limit, since in self._since.items():
            if not is_running:
                self._since[limit] = math.inf
            elif asked - self._told > limit or math.isinf(since):
                self._since[limit] = asked
        self._told = asked
        if identity is None:
            self._state = 'its mode is not known'
        elif identity.mode is None:
            self._state = f'{identity} has no mode; does a gateway answer for the PLC?'
        else:
            self._state = f'it is in {identity.mode_text}'
            if identity.faults:
                self._state += f', {"; ".join(identity.faults)}'
        return late if is_running else set()

    def why_not(self, point: ReadPoint, started: float, now: float) -> str:
        """Return why a value read from ``started`` on is not to be published, empty if it is."""
        since = self._since[point.patience]
        if since == math.inf:
            return f'not in RUN: {self._state}'
        if now - self._told > point.patience:
            return f'it has not reported its mode for {now - self._told:.1f} s'
        return '' if started > since else 'it has begun to run during this read'


class CounterGuard(Guard):
    """Permits values after two changes of a word in time, until the next change is overdue."""

    def __init__(self, tag: str) -> None:
        super().__init__()
        self._tag = tag
        self._word: bytes | None = None
        self._changed = -math.inf

    def read(self, word: bytes, now: float) -> None:
        """Take the word as it was read."""
        if self._word is not None and word != self._word:
            for limit, since in self._since.items():
                if now - self._changed > limit:
                    self._since[limit] = math.inf
                elif since == math.inf:
                    self._since[limit] = now  # the second change in time
            self._changed = now
        self._word = word

    def why_not(self, point: ReadPoint, started: float, now: float) -> str:
        """Return why a value read from ``started`` on is not to be published, empty if it is."""
        limit = point.patience
        since = self._since[limit]
        if since == math.inf or now - self._changed > limit:
            return f'{self._tag} has not changed twice within {limit:g} s'
        return '' if started > since else f'{self._tag} has begun to change during this read'


class Guards:
    """The guards of all rows with While; ``counters`` has the guards of counters, by tag."""

    def __init__(self) -> None:
        self._runs: dict[int, RunGuard] = {}
        self.counters: dict[str, CounterGuard] = {}

    def of(self, mapping: Mapping) -> Guard | None:
        """Return the guard of a row, None where it has no condition."""
        if mapping.condition is None:
            return None
        if mapping.needs_run:
            return self._runs.setdefault(mapping.station, RunGuard())
        tag, = mapping.condition.names  # the tag is unique in the map
        return self.counters.setdefault(tag, CounterGuard(tag))

    def mode_told(self, station: int, identity: Identity | None, asked: float) -> set[ReadPoint]:
        """
        Take what a station has reported of itself; it was ``asked`` at this clock value (s).

        Return the points that have to be read before this answer is too old.
        """
        guard = self._runs.get(station)
        return set() if guard is None else guard.told(identity, asked)

    def value_read(self, point: ReadPoint, words: bytes, now: float) -> None:
        """Give the words of a counter to its guard."""
        counter = self.counters.get(point.mapping.tag)
        if counter is not None:
            counter.read(words, now)
