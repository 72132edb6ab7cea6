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

The port of a PLC answers also while its program is stopped. The numbers of rules are those of
docs/heartbeats.md.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
import math

from abdf1_ros.driver.points import ReadPoint
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.plan.interlocks import ANSWERS_IN_TIME


class RunGuard:
    """Permits values while a station answers every ``limit`` s that it is in RUN without fault."""

    def __init__(self, limit: float) -> None:
        self.limit = limit
        self._told = -math.inf
        self._since = math.inf
        self._state = 'its mode is not known'

    def told(self, identity: Identity | None, asked: float) -> None:
        """Take an answer about the mode, None for one that cannot be used."""
        is_running = identity is not None and bool(identity.is_running) and not identity.faults
        if not is_running:
            self._since = math.inf
        elif asked - self._told > self.limit or math.isinf(self._since):
            self._since = asked
        self._told = asked
        if identity is None:
            self._state = 'its mode is not known'
        else:
            self._state = f'it is in {identity.mode_text}'
            if identity.faults:
                self._state += f', {"; ".join(identity.faults)}'

    def why_not(self, started: float, now: float) -> str:
        """Return why a value read from ``started`` on is not to be published, empty if it is."""
        if math.isinf(self._since):
            return f'not in RUN: {self._state}'
        if now - self._told > self.limit:
            return f'it has not told its mode for {now - self._told:.1f} s'
        return '' if started > self._since else 'it has begun to run during this read'


class CounterGuard:
    """Permits values after two changes of a word in ``limit`` s each, until one is overdue."""

    def __init__(self, tag: str, limit: float) -> None:
        self.tag = tag
        self._limit = limit
        self._word: bytes | None = None
        self._changed = -math.inf
        self._since = math.inf  # when the second change in time was seen

    def read(self, word: bytes, now: float) -> None:
        """Take what was read of the word."""
        if self._word is not None and word != self._word:
            is_in_time = now - self._changed <= self._limit
            if not is_in_time:
                self._since = math.inf
            elif math.isinf(self._since):
                self._since = now
            self._changed = now
        self._word = word

    def why_not(self, started: float, now: float) -> str:
        """Return why a value read from ``started`` on is not to be published, empty if it is."""
        if now - self._changed > self._limit:
            self._since = math.inf
        if math.isinf(self._since):
            return f'{self.tag} has not changed twice within {self._limit:g} s'
        return '' if started > self._since else f'{self.tag} has begun to change during this read'


class Guards:
    """The guards of all rows with Publish_While."""

    def __init__(self, points: Iterable[ReadPoint]) -> None:
        self._runs: dict[int, list[RunGuard]] = {}
        self._counters: dict[str, list[CounterGuard]] = {}
        for point in points:
            condition = point.mapping.publish_while
            if condition is None:
                continue
            if condition.tag is None or condition.timeout is None:
                run = RunGuard(point.stale_time)
                self._runs.setdefault(point.mapping.station, []).append(run)
                point.guard = run
            else:
                counter = CounterGuard(condition.tag, condition.timeout / 1000)
                self._counters.setdefault(condition.tag, []).append(counter)
                point.guard = counter

    def status_periods(self) -> dict[int, float]:
        """Return how often (s) stations have to be asked for their mode."""
        return {station: min(guard.limit for guard in guards) / ANSWERS_IN_TIME
                for station, guards in self._runs.items()}

    def mode_told(self, station: int, identity: Identity | None, asked: float) -> None:
        """Take what a station has told about itself; it was ``asked`` at this clock value (s)."""
        for guard in self._runs.get(station, ()):
            guard.told(identity, asked)

    def values_read(self, points: Sequence[ReadPoint], places: Sequence[slice], data: bytes,
                    now: float) -> None:
        """Give the counters among the words that were read to their guards."""
        if not self._counters:
            return
        for point, place in zip(points, places, strict=True):
            for counter in self._counters.get(point.mapping.tag, ()):
                counter.read(data[place], now)
