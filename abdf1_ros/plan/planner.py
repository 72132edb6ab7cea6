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
The read planner: cover all mapped words in the least line time.

Mappings of one station and one area (a file, or one I/O slot) are read together where that is
cheaper than separate reads. ``partition`` finds the cheapest blocks, ``line_model`` their costs. A
mapping that fits in one packet is always read in one packet, so its values belong together. A
longer mapping is a block of its own, read packet by packet.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
import math

from abdf1_ros.pccc.address import Address, Area
from abdf1_ros.pccc.dialect import Dialect, Transfer
from abdf1_ros.pccc.extent import Extent
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.plan.line_model import LineModel
from abdf1_ros.plan.partition import Candidate, CostModel, partition, Span
from abdf1_ros.settings.mapping import Mapping

StationArea = tuple[int, Area, Dialect]
"""Station, area and dialect. All words of a block belong to one such area."""


@dataclass(frozen=True, slots=True)
class Block:
    """
    A block that is read together: one request, or several for one mapping longer than a packet.

    It has the words of all ``mappings``. ``period`` is the shortest of their periods, in seconds.
    ``line_times`` is the seconds that each transaction takes on the line when the station answers
    at once.
    """

    station: int
    requests: tuple[Transfer, ...]
    mappings: tuple[Mapping, ...]
    period: float
    line_times: tuple[float, ...]

    @property
    def line_time(self) -> float:
        """Return the seconds that all its transactions take."""
        return sum(self.line_times)

    @property
    def dialect(self) -> Dialect:
        """Return the family's way to read."""
        return self.mappings[0].dialect

    @property
    def station_area(self) -> StationArea:
        """Return the area that the block lies in."""
        return _station_area(self.mappings[0])

    @property
    def start(self) -> Address:
        """Return the first word of the block."""
        return self.requests[0].start

    @property
    def words(self) -> int:
        """Return the number of words of all requests."""
        return sum(request.words for request in self.requests)

    @property
    def span(self) -> Span:
        """Return the words of the block."""
        return Span(self.start.offset, self.start.offset + self.words)

    @property
    def extent(self) -> Extent:
        """Return where the words of the block are."""
        return Extent(self.station, self.start.area, self.span.first, self.span.end)

    @property
    def transfer(self) -> Transfer:
        """Return the sum of the words of all requests."""
        return Transfer(self.start, self.words)

    def slice_of(self, mapping: Mapping) -> slice:
        """Return where in the block's data the words of ``mapping`` are."""
        at = 2 * (mapping.address.offset - self.start.offset)
        return slice(at, at + 2 * mapping.codec.words)


@dataclass(frozen=True, slots=True)
class _Demand:
    """A mapping needs the words of ``span`` every ``period`` seconds."""

    mapping: Mapping
    span: Span
    period: float


class Planner:
    """
    Plan reads for a line; mappings without a period get ``default_period`` (s).

    ``refuse`` and ``allow`` record which words a station lacks or has. No block holds all words of
    a refused span. ``shorten`` records shorter packets for a span. ``processors`` holds the
    processor that each station has named. The planner keeps to the packets of that processor, even
    if the map allows longer packets.
    """

    def __init__(self, line: LineModel, default_period: float) -> None:
        self.line_model = line
        self.processors: dict[int, Processor] = {}
        self._default_period = default_period
        self._poll_cycle = 0.0  # seconds on a full line, else 0
        self._refused: defaultdict[StationArea, set[Span]] = defaultdict(set)
        # Words per packet, for each span that was refused with longer packets.
        self._limits: defaultdict[StationArea, dict[Span, int]] = defaultdict(dict)
        self._costs: dict[tuple[Dialect, FileType], Sequence[float]] = {}

    def plan(self, mappings: Iterable[Mapping]) -> list[Block]:
        """Return the blocks that serve every mapping that reads, and read heartbeats back."""
        planned = [mapping for mapping in mappings if mapping.is_planned]
        if all(map(self._period, planned)):
            self._poll_cycle = 0.0
            blocks = self.plan_again(planned)
            if sum(block.line_time / block.period for block in blocks) <= 1:
                return blocks
        # On a full line a block is read once in a poll cycle at most. So short fast blocks save
        # less there than their periods promise.
        self._poll_cycle = math.inf
        self._poll_cycle = sum(block.line_time for block in self.plan_again(planned))
        return self.plan_again(planned)

    def plan_again(self, mappings: Iterable[Mapping]) -> list[Block]:
        """Return the blocks that serve some of the mappings that the last ``plan`` was for."""
        areas: defaultdict[StationArea, list[_Demand]] = defaultdict(list)
        for mapping in mappings:
            areas[_station_area(mapping)].append(
                _Demand(mapping, _span(mapping), self._period(mapping)))
        return [block for area, group in areas.items() for block in self._plan_area(area, group)]

    def alone(self, mapping: Mapping) -> Block:
        """Return the block of a row that is read by itself, such as a row on demand."""
        return self._block([mapping], _span(mapping))

    def split(self, block: Block) -> list[Block]:
        """
        Return the blocks to read instead of a refused block.

        If its mappings have several spans, it becomes two blocks, each with half of the spans. If
        all have the same span, it becomes the same block in shorter packets, as long as a
        processor may need them. Otherwise the list is empty.
        """
        spans = sorted(set(map(_span, block.mappings)))
        if len(spans) == 1:
            return self._shortened(block)
        middle = spans[len(spans) // 2]
        halves: tuple[list[Mapping], list[Mapping]] = [], []
        for mapping in block.mappings:
            halves[_span(mapping) >= middle].append(mapping)
        return [self._block(half, _cover(half)) for half in halves]

    def _shortened(self, block: Block) -> list[Block]:
        words = max(request.words for request in block.requests)
        least = block.dialect.sure_read(block.start.file_type)
        if words <= least:
            return []
        return [self._block(block.mappings, block.span, max(least, words // 2))]

    def shorten(self, block: Block) -> None:
        """Record that the words of ``block`` are read in packets as short as its own."""
        self._limits[block.station_area][block.span] = max(
            request.words for request in block.requests)

    def refuse(self, area: StationArea, span: Span) -> None:
        """Record that no read at ``area`` may hold all of ``span``."""
        self._refused[area].add(span)

    def allow(self, area: StationArea, span: Span) -> bool:
        """
        Record that all of ``span`` can be read; return True if a part of it was refused.

        What was refused is then read in packets of full length again.
        """
        wrong = {other for other in self._refused[area] if span.holds(other)}
        self._refused[area] -= wrong
        for other in wrong:
            self._limits[area].pop(other, None)
        return bool(wrong)

    def forget(self, area: StationArea, span: Span) -> None:
        """Forget that ``span`` was refused, and its shorter packets."""
        self._refused[area].discard(span)
        self._limits[area].pop(span, None)

    def dialect(self, mapping: Mapping) -> Dialect:
        """Return the dialect of the station of a mapping, as far as it is known."""
        processor = self.processors.get(mapping.station)
        others = FAMILIES[mapping.plc_type].by_processor
        if processor is None or processor not in others:
            return mapping.dialect
        return min(mapping.dialect, others[processor],
                   key=lambda dialect: dialect.max_read(FileType.INTEGER))

    def _max_words(self, mapping: Mapping) -> int:
        return self.dialect(mapping).max_read(mapping.address.file_type)

    def _period(self, mapping: Mapping) -> float:
        if mapping.period is None:
            return self._default_period
        seconds = mapping.period / 1000
        # A heartbeat is read back twice in a Period (rule 19). So a read comes between two counts,
        # and finds a foreign value whenever it was written.
        return seconds / 2 if mapping.is_heartbeat else seconds

    def _plan_area(self, area: StationArea, demands: Sequence[_Demand]) -> list[Block]:
        """Plan the mappings of one area."""
        model = self._cost_model(
            demands[0].mapping, self._refused[area].union(self._limits[area]))
        alone: defaultdict[Span, list[Mapping]] = defaultdict(list)
        together = []
        for demand in demands:
            if demand.span.first < model.first_allowed(demand.span.end):
                alone[demand.span].append(demand.mapping)
            else:
                together.append(demand)
        needed: defaultdict[float, list[Span]] = defaultdict(list)
        for demand in together:
            needed[demand.period].append(demand.span)
        served = alone | _served(together, partition(needed, model, self._poll_cycle))
        return [self._block(group, span) for span, group in served.items()]

    def _cost_model(self, example: Mapping, refused: Iterable[Span]) -> CostModel:
        """Return the cost model of the area of ``example``."""
        key = self.dialect(example), example.address.file_type
        if key not in self._costs:
            self._costs[key] = _costs_of(self.line_model, example.dialect,
                                         example.address.at_offset(0), self._max_words(example))
        return CostModel(self._costs[key], _per_element(example), refused)

    def _block(self, mappings: Sequence[Mapping], span: Span, limit: int | None = None) -> Block:
        first = mappings[0]
        limit = min(self._max_words(first),
                    limit or self._limits[_station_area(first)].get(span, span.words))
        if span.words > limit:  # a long mapping: no packet ends within a value
            limit -= limit % _whole(mappings)
        requests = tuple(
            Transfer(first.address.at_offset(at), min(limit, span.end - at))
            for at in range(span.first, span.end, limit))
        line_times = tuple(self.line_model.read_time(first.dialect, request, first.station)
                           for request in requests)
        period = min(map(self._period, mappings))
        return Block(first.station, requests, tuple(mappings), period, line_times)


@lru_cache(maxsize=256)
def _costs_of(line: LineModel, dialect: Dialect, start: Address, most: int) -> Sequence[float]:
    """Return the seconds that a read takes, by its number of words, ``most`` at most."""
    per_element, costs = start.layout.words, [0.0] * (most + 1)
    for words in {1, *range(per_element, len(costs), per_element)}:
        costs[words] = line.read_time(dialect, Transfer(start, words))
    value = next((place for place in map(start.at_offset, range(per_element))
                  if place.is_value(2)), None)
    if value is not None:  # a float32 within a structure is read by itself
        costs[2] = line.read_time(dialect, Transfer(value, 2))
    return costs


def _station_area(mapping: Mapping) -> StationArea:
    return mapping.station, mapping.address.area, mapping.dialect


def _whole(mappings: Sequence[Mapping]) -> int:
    """Return the words of the longest value or element, which no packet may divide."""
    return max(_per_element(mappings[0]), *(mapping.codec.element_words for mapping in mappings))


def _per_element(mapping: Mapping) -> int:
    return mapping.address.layout.words


def _span(mapping: Mapping) -> Span:
    """Return the words to read for one mapping."""
    first, words = mapping.address.offset, mapping.codec.words
    span = Span(first, first + words)
    return span if mapping.address.is_value(words) else span.aligned(_per_element(mapping))


def _cover(mappings: Sequence[Mapping]) -> Span:
    """Return the words to read for ``mappings``, which lie in one block."""
    spans = list(map(_span, mappings))
    if len(set(spans)) == 1:
        return spans[0]
    cover = Span(min(span.first for span in spans), max(span.end for span in spans))
    return cover.aligned(_per_element(mappings[0]))


def _served(demands: Iterable[_Demand],
            candidates: Iterable[Candidate]) -> dict[Span, list[Mapping]]:
    """Return the mappings of each block; a mapping is in the slowest block that is fast enough."""
    levels: dict[float, list[Span]] = defaultdict(list)
    for entry in sorted(candidates, key=lambda entry: (-entry.period, entry.span)):
        levels[entry.period].append(entry.span)
    served: dict[Span, list[Mapping]] = {}
    for demand in demands:
        span = next(found for period, spans in levels.items() if period <= demand.period
                    and (found := _holder(spans, demand.span)) is not None)
        served.setdefault(span, []).append(demand.mapping)
    return served


def _holder(spans: Sequence[Span], wanted: Span) -> Span | None:
    """Return the span that holds ``wanted``; ``spans`` are sorted, and none contains another."""
    # Of the spans that begin early enough, the last one also ends last.
    index = bisect_right(spans, wanted.first, key=lambda span: span.first)
    return spans[index - 1] if index and spans[index - 1].holds(wanted) else None
