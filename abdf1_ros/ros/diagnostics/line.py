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

"""How fast a line works, in figures for people."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from statistics import fmean

from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.pccc.link_counters import NO_MEMORY, UNSENT
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ros.diagnostics.status import milliseconds


class LoadMeter:
    """Transactions a second and line load since the last look."""

    def __init__(self) -> None:
        self.transactions = 0.0
        self.load = 0.0
        self._seen = (line_time(), 0, 0)

    def update(self, driver: Driver, now: float) -> None:
        """Measure since the last call, at the clock value ``now`` (s)."""
        before, transactions, characters = self._seen
        total = driver.counters.chars_sent + driver.counters.chars_received
        if now > before:
            self.transactions = (driver.transactions - transactions) / (now - before)
            on_line = (total - characters) * driver.network.timing.char_time
            self.load = min(100.0, 100 * on_line / (now - before))
            self._seen = now, driver.transactions, total


def paces(points: Iterable[ReadPoint]) -> dict[str, str]:
    """Return how late the reads of each period are; Serve rows do not count."""
    found: defaultdict[float, list[float]] = defaultdict(list)
    for point in points:
        if point.mapping.polls:
            found[point.period] += [] if point.interval is None else [point.interval]
    return {f'period {milliseconds(period)}': _pace(period, found[period])
            for period in sorted(found)}


def _pace(period: float, intervals: Sequence[float]) -> str:
    wanted = f'wanted {milliseconds(period)}' if period else 'as often as the line allows'
    if not intervals:
        return f'{wanted}, not yet read twice'
    return f'{wanted}, reads every {milliseconds(fmean(intervals))}'


def unnumbered_counts(driver: Driver) -> dict[str, str]:
    """Return what a radio modem node counts besides the numbered counters, by its name."""
    counters = driver.counters
    return {} if driver.network.mode != 'Radio' else {
        UNSENT: str(counters.unsent_messages), NO_MEMORY: str(counters.refused_for_memory)}


def poll_scans(driver: Driver) -> dict[str, str]:
    """Return last and longest poll cycles of the poll lists, where there are any."""
    return {
        f'{name} poll scan': f'last {milliseconds(times.last)}, '
                             f'longest {milliseconds(times.longest)}'
        for name, times in driver.link.status().scans.items() if times.last is not None}
