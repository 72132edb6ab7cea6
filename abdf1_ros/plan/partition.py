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
Stretches of words, and the cheapest way to put them into blocks.

This is the arithmetic of the read planner; it does not depend on PLCs. A block is one span of
words that one command reads. A command costs much by itself and little for each word. So a block
includes a short gap if that is cheaper than another command.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
import math

_ROUNDING = 1e-9  # a smaller saving is a rounding error


@dataclass(frozen=True, slots=True, order=True)
class Span:
    """Words ``first`` up to, not including, ``end`` of an area."""

    first: int
    end: int

    @property
    def words(self) -> int:
        """Return the number of words."""
        return self.end - self.first

    def holds(self, other: Span) -> bool:
        """Tell whether this span has all words of ``other``."""
        return self.first <= other.first and other.end <= self.end

    def aligned(self, per_element: int) -> Span:
        """Return the span in whole elements: a read of more than one value needs them."""
        return Span(self.first - self.first % per_element, self.end + -self.end % per_element)


@dataclass(frozen=True, slots=True)
class Candidate:
    """A possible block; it would be read every ``period`` seconds."""

    span: Span
    period: float


class CostModel:
    """
    The cost of blocks of an area, and which blocks are possible.

    ``costs[n]`` is the seconds that a read of n words takes; the last n is ``limit``, the most
    that one command reads. A block of more than one word has whole elements of ``per_element``
    words, and does not hold all words of any span in ``refused``.
    """

    def __init__(self, costs: Sequence[float], per_element: int = 1,
                 refused: Iterable[Span] = ()) -> None:
        self.costs = costs
        self.limit = len(costs) - 1
        self.per_element = per_element
        by_end = sorted(refused, key=lambda span: span.end)
        self._refused_ends = [span.end for span in by_end]
        self._first_allowed = list(accumulate((span.first + 1 for span in by_end), max))

    def first_allowed(self, end: int) -> int:
        """Return the first word that a block up to ``end`` may begin with."""
        lowest = end - self.limit
        known = bisect_right(self._refused_ends, end)
        return max(lowest, self._first_allowed[known - 1]) if known else lowest

    def together(self, one: Span, other: Span) -> Span:
        """Return the shortest block that holds both."""
        if one == other:
            return one
        span = Span(min(one.first, other.first), max(one.end, other.end))
        return span.aligned(self.per_element)

    def cost(self, block: Span) -> float:
        """Return the seconds that a block takes; infinity for an impossible block."""
        if block.first < self.first_allowed(block.end):
            return math.inf
        return self.costs[block.words]


def cheapest(needed: Iterable[Span], model: CostModel) -> list[Span]:
    """
    Return the blocks that hold all ``needed`` at the least cost, in their order.

    Each of ``needed`` has to be a possible block by itself.
    """
    spans = without_contained(needed)
    element = model.per_element
    starts = [span.first - span.first % element for span in spans]
    least = [0.0]  # least cost of the first spans, by their number
    begins: list[int] = []
    for last, span in enumerate(spans):
        best, begin = least[last] + model.costs[span.words], last
        end = span.end + -span.end % element
        first_allowed = model.first_allowed(end)
        for first in range(last - 1, -1, -1):
            if starts[first] < first_allowed:
                break
            cost = least[first] + model.costs[end - starts[first]]
            if cost < best:
                best, begin = cost, first
        least.append(best)
        begins.append(begin)
    blocks: list[Span] = []
    rest = len(spans)
    while rest:
        begin = begins[rest - 1]
        blocks.append(model.together(spans[begin], spans[rest - 1]))
        rest = begin
    return blocks[::-1]


def without_contained(spans: Iterable[Span]) -> list[Span]:
    """Return the spans that no other span holds, sorted by first word."""
    kept: list[Span] = []
    for span in sorted(set(spans), key=lambda span: (span.first, -span.end)):
        if not kept or span.end > kept[-1].end:
            kept.append(span)
    return kept


def partition(needed: Mapping[float, Iterable[Span]], model: CostModel,
              poll_cycle: float) -> list[Candidate]:
    """
    Return the blocks that hold all spans of ``needed``, whose keys are periods in seconds.

    Spans of a long period may share a block with spans of a short one, where that is cheaper.
    A block is not expected to be read more often than every ``poll_cycle`` seconds.
    """
    candidates: list[Candidate] = []
    for period in sorted(needed):
        left = (span for span in needed[period]
                if not any(faster.span.holds(span) for faster in candidates))
        candidates += [Candidate(span, period) for span in cheapest(left, model)]
    candidates.sort(key=lambda candidate: candidate.span)
    while (pair := _best_pair(candidates, model, poll_cycle)) is not None:
        one, other = pair
        candidates[candidates.index(one)] = _joined(one, other, model)
        candidates.remove(other)
        candidates.sort(key=lambda candidate: candidate.span)
    return candidates


def _joined(one: Candidate, other: Candidate, model: CostModel) -> Candidate:
    return Candidate(model.together(one.span, other.span), min(one.period, other.period))


def _best_pair(candidates: Sequence[Candidate], model: CostModel,
               poll_cycle: float) -> tuple[Candidate, Candidate] | None:
    """Return the two blocks that save the most of the line's time when read together."""
    def load(candidate: Candidate) -> float:
        return model.cost(candidate.span) / max(candidate.period, poll_cycle)

    best, most = None, 0.0
    loads = [load(candidate) for candidate in candidates]
    for index, one in enumerate(candidates):
        for at in range(index + 1, len(candidates)):
            other = candidates[at]
            if other.span.first - one.span.first >= model.limit:
                break
            saved = loads[index] + loads[at] - load(_joined(one, other, model))
            if saved > most + _ROUNDING * loads[index]:
                best, most = (one, other), saved
    return best
