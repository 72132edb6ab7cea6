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

"""The status ``mappings``: how fresh the values of all rows are."""

from __future__ import annotations

from collections.abc import Sequence

from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.reads.point import Freshness, ReadPoint
from abdf1_ros.problems import Problem
from abdf1_ros.ros.diagnostics.load import FullLine, SlowRows
from abdf1_ros.ros.diagnostics.status import ERROR, Judgement, OK, WARN
from abdf1_ros.settings.columns import BETWEEN_NAMES
from abdf1_ros.text import age_text, counted

# Most faults of left-out rows that each status repeats; ``check`` shows them all.
_MOST_LEFT_OUT = 20

NAMES_OF_BITS = 'names of bits, '
"""Beginning of the keys of topics whose bits have names; the names have | between them."""

FRESHNESS_LEVELS = {
    Freshness.FRESH: OK, Freshness.LATE: WARN, Freshness.WAITING: WARN,
    Freshness.STALE: ERROR, Freshness.FAILED: ERROR, Freshness.WITHHELD: ERROR}


class MappingsStatus:
    """
    The number of fresh rows; which rows are not fresh, and why; which are slow or fill the line.

    ``left_out``: the faults of the rows that were left out of the map.
    """

    name = 'mappings'

    def __init__(self, driver: Driver, port: str, left_out: Sequence[Problem]) -> None:
        self.hardware_id = port
        self._points = driver.points
        self._left_out = left_out
        self._names = {
            f'{NAMES_OF_BITS}{mapping.topic}': BETWEEN_NAMES.join(mapping.named_places())
            for mapping in driver.points if mapping.bits}
        self._slow = SlowRows(driver.points.values(), driver.stations.odd)
        self._full = FullLine(driver.spent)

    def judge(self, now: float) -> Judgement:
        level, text = self._judge_reads(now)
        for found in filter(None, (self._slow.text(now), self._full.text(now))):
            level, text = max(level, WARN), f'{text}; {found}'
        if not self._left_out:
            return level, text
        rows = len({(problem.place.file, problem.place.line) for problem in self._left_out})
        return max(level, WARN), (f'{text}; {counted(rows, "row")} left out of '
                                  f'the map, the first at {self._left_out[0].place}')

    def _judge_reads(self, now: float) -> Judgement:
        found = self._freshness(now)
        if not found:
            return OK, 'no mapping reads'
        states = [f'{count} {state.value}' for state, count in found.items()]
        return (max(FRESHNESS_LEVELS[state] for state in found),
                f'of {sum(found.values())} mappings {", ".join(sorted(states))}')

    def _freshness(self, now: float) -> dict[Freshness, int]:
        """Return the number of mappings in each state."""
        # This runs ten times a second: ``list.count`` takes a third of the time of a Counter.
        states = [point.freshness(now) for point in self._points.values()]
        return {state: states.count(state) for state in Freshness if state in states}

    def values(self, now: float) -> dict[str, str]:
        points, found = self._points.values(), self._freshness(now)
        values = {'total': str(len(points))}
        values |= {state.name.lower(): str(found.get(state, 0)) for state in Freshness}
        left_out = self._left_out[:_MOST_LEFT_OUT]
        values |= {f'left out {number}': str(problem)
                   for number, problem in enumerate(left_out, 1)}
        if more := len(self._left_out) - len(left_out):
            values['left out, more'] = (
                f'{counted(more, "more fault")}; the log and "check" have them all')
        values |= self._names
        for point in points:
            tag = point.mapping.tag
            if point.freshness(now) is not Freshness.FRESH:
                values[f'tag {tag}' if tag in values else tag] = _describe(point, now)
        return values


def _describe(point: ReadPoint, now: float) -> str:
    age = point.age(now)
    text = f'{point.freshness(now).value}: {point.mapping.address} at station ' \
           f'{point.mapping.station}'
    text += ', never read' if age is None else f', last read {age:.1f} s ago'
    if point.withheld:
        text += f'; {point.withheld}, for {age_text(point.withheld_since, now)}; ' \
                f'times withheld: {point.withholdings}'
    return f'{text}; {point.error}' if point.error else text
