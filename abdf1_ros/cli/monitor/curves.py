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

"""A small curve of a topic's values: a character for every two seconds."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
import math
from typing import NamedTuple

from abdf1_ros.text import bar, BARS

WIDTH = 12
ASCII = '_.-=*#'

_STEP = 2.0  # s
SECONDS = WIDTH * _STEP
_ELEMENTS = 8  # only the first elements of a long array are used


class _Step(NamedTuple):
    """
    The values of one step; ``low``, ``high`` and ``last`` by element.

    ``time``: clock value (s) of the last value.
    """

    number: int
    time: float
    low: list[float]
    high: list[float]
    last: list[float]


class Curve:
    """
    The last values of an array of numbers; with ``is_bits`` each is 0 or 1.

    Of several elements, the curve shows the first that has changed. If a step has several values,
    the curve shows the least or the greatest, whichever is farther from the point before. So a
    blinking bit is visible.
    """

    def __init__(self, is_bits: bool = False) -> None:
        self._is_bits = is_bits
        self._steps: deque[_Step] = deque(maxlen=WIDTH + 1)

    def take(self, values: Sequence[float], now: float) -> None:
        """Record the values of a message that arrived at the clock value ``now`` (s)."""
        number, last = int(now // _STEP), [float(value) for value in values[:_ELEMENTS]]
        low = high = last
        if self._steps and self._steps[-1].number == number:
            before = self._steps.pop()
            low = [*map(min, before.low, last)]
            high = [*map(max, before.high, last)]
        self._steps.append(_Step(number, now, low, high, last))

    def draw(self, now: float, promised: float | None, bars: str = BARS) -> str:
        """
        Return ``WIDTH`` characters, the newest last; a blank is a time without a good value.

        A value is good for ``promised`` seconds; if that is None, until the next value.
        """
        newest = int(now // _STEP)
        shown = [self._at(number, promised) for number in range(newest - WIDTH + 1, newest + 1)]
        points = [*_points(shown, _changing([step for step in shown if step is not None]))]
        known = [point for point in points if math.isfinite(point)]
        bottom, top = (0.0, 1.0) if self._is_bits or not known else (min(known), max(known))
        return ''.join(bar(point, bottom, top, bars) for point in points)

    def _at(self, number: int, promised: float | None) -> _Step | None:
        """Return the good values in a step; None if there was none."""
        for step in reversed(self._steps):
            if step.number == number:
                return step
            if step.number < number:
                is_good = promised is None or number * _STEP - step.time <= promised
                return step._replace(low=step.last, high=step.last) if is_good else None
        return None


def _changing(steps: Sequence[_Step]) -> int:
    """Return the index of the first element that has changed; 0 for none."""
    count = min((len(step.last) for step in steps), default=0)
    return next((element for element in range(count) if len(
        {value for step in steps for value in (step.low[element], step.high[element])}) > 1), 0)


def _points(steps: Sequence[_Step | None], element: int) -> Iterator[float]:
    """Yield a value for each step; NaN for none."""
    before = math.nan
    for step in steps:
        if step is None or len(step.last) <= element:
            yield math.nan
            continue
        low, high = step.low[element], step.high[element]
        if math.isnan(before):
            before = step.last[element]
        before = low if abs(low - before) > abs(high - before) else high
        yield before
