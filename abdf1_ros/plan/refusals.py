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
Which blocks replace a block that a station refuses.

A station refuses a whole block for one address that it does not have: of a mapping, or of a gap
between mappings. The block is divided until each part is good or cannot be divided any more. A
long mapping may also be refused because the processor takes only shorter packets than we expect:
then it is tried in shorter ones. But a file may be missing for a moment, and be there again when
shorter packets are tried. So these count only if two searches in a row find them good. The planner
keeps the result, and all mappings of the area are planned again: the good ones together, and never
again with the bad ones.

A block whose reply never arrives whole is divided in the same way. But a good read of a bad part
proves nothing then, because the bytes that do not pass may come back. So parts stay apart until
``forget``. If all parts are good, noise may have been the cause. So only the second search in a
row with this result keeps them apart: they are too long together.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from abdf1_ros.pccc.processor import Processor
from abdf1_ros.plan.partition import Span
from abdf1_ros.plan.planner import Block, Planner, StationArea


@dataclass(frozen=True, slots=True)
class Change:
    """Blocks, and the blocks that take their place."""

    old: Sequence[Block]
    new: Sequence[Block]


class _RefusalSearch:
    """The search for the refused words of one block; with ``is_odd`` no station has refused."""

    def __init__(self, block: Block, *, is_odd: bool) -> None:
        self.whole = block
        self.parts = [block]
        self.is_odd = is_odd
        self._open = 1
        self._divided: list[tuple[Span, Span]] = []  # refused spans, and where each was divided
        self._refused: list[Span] = []
        self._good: list[Span] = []

    def divide(self, block: Block, halves: Sequence[Block]) -> None:
        """Replace a refused block by its halves, or by itself in shorter packets."""
        self.parts.remove(block)
        self.parts += halves
        if len(halves) > 1:
            left, right = (half.span for half in halves)
            gap = Span(left.end - 1, right.first + 1)  # the gap with one word on each side
            self._divided.append((block.span, gap if gap.words > 1 else block.span))
            self._open += 1

    def settle(self, block: Block, is_refused: bool) -> bool:
        """Record the end of one branch; return True if it was the last."""
        (self._refused if is_refused else self._good).append(block.span)
        self._open -= 1
        return self._open == 0

    @property
    def found_nothing(self) -> bool:
        """Tell whether all parts are good."""
        return not self._refused

    def gaps(self) -> list[Span]:
        """
        Return what cannot be read between two sides that can be read.

        If that is good elsewhere, it is all of both sides: they are too long together.
        """
        found: list[Span] = []
        smaller = list(self._refused)
        for span, gap in reversed(self._divided):  # parts before the whole
            if not any(span.holds(other) for other in smaller):
                found.append(span if any(good.holds(gap) for good in self._good) else gap)
            smaller.append(span)
        return found


class Refusals:
    """Choose the blocks to read after a refusal, and report the result to ``planner``."""

    def __init__(self, planner: Planner) -> None:
        self._planner = planner
        self._searches: dict[Block, _RefusalSearch] = {}
        self._shorter: set[Block] = set()  # in shorter packets, and found good by one search
        self._odd: set[tuple[StationArea, Span]] = set()  # kept apart though no station refused
        self._divided_in_vain: set[Block] = set()  # of such blocks all parts were good
        self.recovering: dict[StationArea, Block] = {}  # last recovered block of each area

    def refused(self, block: Block, blocks: Iterable[Block], *,
                is_odd: bool = False) -> Change | None:
        """
        Record that a station has refused a block; return None if it is to be read as before.

        ``blocks`` are all blocks that are read. With ``is_odd`` its reply never arrives whole.
        """
        search = self._searches.pop(block, None)
        halves = self._planner.split(block)
        if not halves:
            # Later plans keep it apart from good blocks, and in these packets, until it is good.
            self._refuse(block.station_area, block.span, is_odd=is_odd)
            self._planner.shorten(block)
            return self._settle(search, block, blocks, is_refused=True) if search else None
        search = search or _RefusalSearch(block, is_odd=is_odd)
        search.divide(block, halves)
        for half in halves:
            self._searches[half] = search
        return Change([block], halves)

    def _refuse(self, area: StationArea, span: Span, *, is_odd: bool) -> None:
        self._planner.refuse(area, span)
        if is_odd:
            self._odd.add((area, span))

    def forget(self, blocks: Iterable[Block]) -> Change:
        """Read again together what was divided because replies did not arrive whole."""
        odd = {block: search for block, search in self._searches.items() if search.is_odd}
        areas = {area for area, _ in self._odd} | {block.station_area for block in odd}
        for area, span in self._odd:
            self._planner.forget(area, span)
        self._odd.clear()
        self._divided_in_vain.clear()
        for block in odd:
            del self._searches[block]
        return self._planned_anew(block for block in blocks if block.station_area in areas)

    def recovered(self, block: Block, blocks: Iterable[Block]) -> Change | None:
        """Record a good read after a bad one; ``blocks`` are all blocks that are read."""
        search = self._searches.pop(block, None)
        is_second = block in self._shorter
        self._shorter = {shorter for shorter in self._shorter
                         if not block.extent.holds(shorter.extent)}
        if search is not None:
            if is_second:
                self._planner.shorten(block)
                if search.is_odd:
                    self._odd.add((block.station_area, block.span))
            elif len(block.requests) > 1:
                self._shorter.add(block)
            return self._settle(search, block, blocks, is_refused=False)
        self._divided_in_vain.discard(block)
        if (block.station_area, block.span) in self._odd:
            return None
        if self._planner.allow(block.station_area, block.span):
            self.recovering[block.station_area] = block
        return None

    def read_again(self, block: Block, blocks: Iterable[Block]) -> Change | None:
        """
        Record another good read of the last recovering block of its area, and plan the area anew.

        By then the other recovering blocks of the area have also been read. So a file that comes
        back is planned only once.
        """
        if self.recovering.get(block.station_area) is not block:
            return None
        del self.recovering[block.station_area]
        return self._planned_anew(_of_the_area(block, blocks))

    def processor_told(self, station: int, processor: Processor | None,
                       blocks: Iterable[Block]) -> Change | None:
        """Record the processor that a station has named; keep to its packets."""
        if processor is None or self._planner.processors.get(station) is processor:
            return None
        self._planner.processors[station] = processor
        change = self._planned_anew(block for block in blocks if block.station == station)
        return change if change.old else None

    def _planned_anew(self, blocks: Iterable[Block]) -> Change:
        """Return the blocks that replace ``blocks``; parts of a running search stay."""
        parts = {part for search in self._searches.values() for part in search.parts}
        old = {block for block in blocks if block not in parts}
        new = set(self._planner.plan_again(sorted(
            (mapping for block in old for mapping in block.mappings),
            key=lambda mapping: mapping.item)))
        return Change([*(old - new)], [*(new - old)])

    def _settle(self, search: _RefusalSearch, block: Block, blocks: Iterable[Block],
                is_refused: bool) -> Change | None:
        if not search.settle(block, is_refused):
            return None
        is_first = search.is_odd and search.found_nothing \
            and search.whole not in self._divided_in_vain
        if is_first:
            self._divided_in_vain.add(search.whole)
        for gap in () if is_first else search.gaps():
            self._refuse(block.station_area, gap, is_odd=search.is_odd)
        return self._planned_anew(_of_the_area(block, blocks))


def _of_the_area(block: Block, blocks: Iterable[Block]) -> Iterable[Block]:
    return (other for other in blocks if other.station_area == block.station_area)
