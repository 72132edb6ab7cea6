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

This is the arithmetic of the read planner; it knows nothing of PLCs. A block is one span of
words that is read by one command. A command costs a good deal by itself and a little for each
word, so it pays to read across gaps that are cheaper than another command.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
import math

_ROUNDING = 1e-9  # what saves less saves nothing


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
        """Tell whether all words of ``other`` are among these."""
        return self.first <= other.first and other.end <= self.end

    def aligned(self, per_element: int) -> Span:
        """Return whole elements, which is what reads of more than one word take."""
        if self.words <= 1:
            return self
        return Span(self.first - self.first % per_element, self.end + -self.end % per_element)


@dataclass(frozen=True, slots=True)
class Draft:
    """A block, and how often it is read: every ``period`` seconds."""

    span: Span
    period: float


class Terms:
    """
    What blocks of an area cost, and which there can be.

    ``costs`` are seconds by number of words, from 0 up to the most that one command reads,
    ``limit``.
    Blocks of more than one word hold whole elements of ``per_element`` words, and none of the
    spans in ``refused`` as a whole.
    """

    def __init__(self, costs: Sequence[float], per_element: int = 1,
                 refused: Iterable[Span] = ()) -> None:
        self.costs = costs
        self.limit = len(costs) - 1
        self.per_element = per_element
        self._refused = sorted(refused, key=lambda span: span.end)
        self._refused_ends = [span.end for span in self._refused]

    def first_allowed(self, end: int) -> int:
        """Return the first word that a block up to ``end`` may begin with."""
        lowest = end - self.limit
        if not self._refused:
            return lowest
        known = self._refused[:bisect_right(self._refused_ends, end)]
        return max([lowest, *(span.first + 1 for span in known)])

    def together(self, one: Span, other: Span) -> Span:
        """Return the shortest block that holds both."""
        if one == other:
            return one
        span = Span(min(one.first, other.first), max(one.end, other.end))
        return span.aligned(self.per_element)

    def cost(self, block: Span) -> float:
        """Return the seconds that a block takes; infinitely many for one that cannot be."""
        if block.first < self.first_allowed(block.end):
            return math.inf
        return self.costs[block.words]


def cheapest(needed: Iterable[Span], terms: Terms) -> list[Span]:
    """
    Return the blocks that hold all ``needed`` at the least cost, in their order.

    Each of ``needed`` has to be a possible block by itself.
    """
    spans = without_contained(needed)
    element = terms.per_element
    starts = [span.first - span.first % element for span in spans]
    least = [0.0]  # for the spans before this one
    begins: list[int] = []
    for last, span in enumerate(spans):
        best, begin = least[last] + terms.costs[span.words], last
        end = span.end + -span.end % element
        first_allowed = terms.first_allowed(end)
        for first in range(last - 1, -1, -1):
            if starts[first] < first_allowed:
                break
            cost = least[first] + terms.costs[end - starts[first]]
            if cost < best:
                best, begin = cost, first
        least.append(best)
        begins.append(begin)
    blocks: list[Span] = []
    rest = len(spans)
    while rest:
        begin = begins[rest - 1]
        blocks.append(terms.together(spans[begin], spans[rest - 1]))
        rest = begin
    return blocks[::-1]


def without_contained(spans: Iterable[Span]) -> list[Span]:
    """Return the spans that no other holds, by first word."""
    kept: list[Span] = []
    for span in sorted(set(spans), key=lambda span: (span.first, -span.end)):
        if not kept or span.end > kept[-1].end:
            kept.append(span)
    return kept


def draft(needed: Mapping[float, Iterable[Span]], terms: Terms, scan_time: float) -> list[Draft]:
    """
    Return blocks for spans that are needed every so many seconds (the keys of ``needed``).

    What is needed seldom may be read along with what is needed often, where that is cheaper.
    No block is taken to be read more often than every ``scan_time`` seconds.
    """
    drafts: list[Draft] = []
    for period in sorted(needed):
        left = (span for span in needed[period]
                if not any(faster.span.holds(span) for faster in drafts))
        drafts += [Draft(span, period) for span in cheapest(left, terms)]
    drafts.sort(key=lambda draft: draft.span)
    while (pair := _best_pair(drafts, terms, scan_time)) is not None:
        one, other = pair
        drafts[drafts.index(one)] = _joined(one, other, terms)
        drafts.remove(other)
        drafts.sort(key=lambda draft: draft.span)
    return drafts


def _joined(one: Draft, other: Draft, terms: Terms) -> Draft:
    return Draft(terms.together(one.span, other.span), min(one.period, other.period))


def _best_pair(drafts: Sequence[Draft], terms: Terms,
               scan_time: float) -> tuple[Draft, Draft] | None:
    """Return the two blocks that save the most of the line's time when read together."""
    def load(draft: Draft) -> float:
        return terms.cost(draft.span) / max(draft.period, scan_time)

    best, most = None, 0.0
    loads = [load(draft) for draft in drafts]
    for index, one in enumerate(drafts):
        for at in range(index + 1, len(drafts)):
            other = drafts[at]
            if other.span.first - one.span.first >= terms.limit:
                break
            saved = loads[index] + loads[at] - load(_joined(one, other, terms))
            if saved > most + _ROUNDING * loads[index]:
                best, most = (one, other), saved
    return best
