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

"""Rows that overload the line: reads slower than their Period, and too many writes."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping as MappingType
import math

from abdf1_ros.df1.odd import OddCommands
from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.plan.report import PERIOD_STEPS
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.text import first, milliseconds

# A row becomes slow if more than 1.5 periods lie between its reads; it stays slow while more than
# 1.25 periods do.
_SLOW, _STILL_SLOW = 1.5, 1.25

_LOOK_PERIOD = 1.0  # s

_MOST_NAMED = 3

# The advised Period keeps the line busy for at most this part of the time.
_ADVISED_LOAD = 0.8


# Writes that take at least this part of the line time are reported; measured over ``_SPAN`` s.
_FULL = 0.75
_SPAN = 5.0


class FullLine:
    """The rows whose messages fill the line; ``spent``: seconds of line time, by row."""

    def __init__(self, spent: MappingType[Mapping, float]) -> None:
        self._spent = spent
        self._before: dict[Mapping, float] = {}
        self._looked = -math.inf
        self._text = ''

    def text(self, now: float) -> str:
        """Return the rows that fill the line as a text, empty if none do."""
        if (passed := now - self._looked) >= _SPAN:
            spent = {**self._spent}
            parts = {row: (seconds - self._before.get(row, 0.0)) / passed
                     for row, seconds in spent.items()}
            self._before, self._looked, self._text = spent, now, _filled(parts)
        return self._text


def _filled(parts: MappingType[Mapping, float]) -> str:
    if (whole := sum(parts.values())) < _FULL:
        return ''
    named = [f'{row.tag} ({parts[row]:.0%})' for row in sorted(parts, key=lambda row: -parts[row])]
    advice = '; set Write_Again to leave out unchanged values' \
        if not any(row.write_again for row in parts) else ''
    return f'messages fill {min(whole, 1.0):.0%} of the line: {first(named, _MOST_NAMED)}{advice}'


class SlowRows:
    """
    The rows whose reads do not keep their Period, as measured and not as planned.

    While commands of ``odd`` fail, these are the cause, and no Period is advised.
    """

    def __init__(self, points: Iterable[ReadPoint], odd: OddCommands) -> None:
        self._odd = odd
        self._points = [point for point in points if point.mapping.polls and point.period
                        and not point.mapping.is_on_demand]
        self._slow: dict[ReadPoint, float] = {}
        self._next_look = 0.0

    def text(self, now: float) -> str:
        """Return the slowest rows, and the cause or a Period that can be kept; empty for none."""
        if now >= self._next_look:
            self._next_look = now + _LOOK_PERIOD
            self._slow = self._look(now)
        if not self._slow:
            return ''
        worst = sorted(self._slow, key=lambda point: self._slow[point] / -point.period)
        named = [f'{point.mapping.tag} (Period {milliseconds(point.period)}, kept '
                 f'{milliseconds(self._slow[point])})' for point in worst]
        return f'Period not kept: {first(named, _MOST_NAMED)}{self._advice()}'

    def _look(self, now: float) -> dict[ReadPoint, float]:
        return {point: point.kept for point in self._points
                if point.kept is not None and point.freshness(now).is_usable
                and point.kept > point.period * (_STILL_SLOW if point in self._slow else _SLOW)}

    def _advice(self) -> str:
        if self._odd.failed:
            return '; commands that get no whole reply take time of the line'
        # The line can do the present reads. So it can also read all rows as seldom as the slowest
        # row.
        needed = max(self._slow.values()) / _ADVISED_LOAD * 1000
        period = next((step for step in PERIOD_STEPS if step >= needed), None)
        return '' if period is None else f'; the line can keep Period {period}'
