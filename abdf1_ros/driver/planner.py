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
The read planner: cover all mapped words with the fewest characters on the line.

A read costs a fixed number of characters (frames, ACKs, poll, headers) and two for each word,
so it pays to read across a gap that is cheaper than another transaction. Per area (a file, or
one I/O slot) the cheapest split of the mappings into blocks is found by dynamic programming.
A mapping that fits in one packet always lies in one, so its values belong together; a longer
one is a block of its own, read packet by packet.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.packet import HEADER_SIZE
from abdf1_ros.driver.mapping import Mapping
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.dialects import Dialect, DIALECTS


@dataclass(frozen=True, slots=True)
class Request:
    """One read command: ``words`` words from ``start`` on."""

    start: Address
    words: int


@dataclass(frozen=True, slots=True)
class Block:
    """
    What is read together: one request, or several for one mapping longer than a packet.

    ``mappings`` are served by it. ``period`` is in seconds; ``line_time`` is what its
    transactions take on the line when the station answers at once, in seconds.
    """

    station: int
    requests: tuple[Request, ...]
    mappings: tuple[Mapping, ...]
    period: float
    line_time: float

    @property
    def dialect(self) -> Dialect:
        """Return the family's way to read."""
        return DIALECTS[self.mappings[0].plc_type]

    @property
    def start(self) -> Address:
        """Return the first word of the block."""
        return self.requests[0].start

    def words_of(self, mapping: Mapping, data: bytes) -> bytes:
        """Return the words of ``mapping`` in the block's ``data``."""
        at = 2 * (mapping.address.offset - self.start.offset)
        return data[at:at + 2 * mapping.codec.words]


@dataclass(frozen=True, slots=True)
class _Span:
    """Words ``first`` up to, not including, ``end`` of an area."""

    first: int
    end: int

    @property
    def words(self) -> int:
        return self.end - self.first

    def holds(self, other: _Span) -> bool:
        return self.first <= other.first and other.end <= self.end

    def aligned(self, per_element: int) -> _Span:
        """Return whole elements, which is what reads of more than one word take."""
        if self.words <= 1:
            return self
        return _Span(self.first - self.first % per_element, self.end + -self.end % per_element)


class Planner:
    """Plan reads for a line with this check and this time per character (s)."""

    def __init__(self, checksum: Checksum, duplex: Duplex, char_time: float,
                 default_period: float) -> None:
        self._checksum = checksum
        self._duplex = duplex
        self._char_time = char_time
        self._default_period = default_period

    def plan(self, mappings: Iterable[Mapping]) -> list[Block]:
        """Return the blocks that serve every mapping that reads."""
        groups = defaultdict(list)
        for mapping in mappings:
            if mapping.polls:
                key = mapping.station, mapping.address.area, self._period(mapping)
                groups[key].append(mapping)
        return [block for group in groups.values() for block in self._plan_area(group)]

    def split(self, block: Block) -> list[Block]:
        """Return blocks for the same mappings, none with more than half of them."""
        ordered = sorted(block.mappings, key=lambda mapping: mapping.address.offset)
        middle = len(ordered) // 2
        return [self._block(half, _cover(half))
                for half in (ordered[:middle], ordered[middle:])]

    def line_time(self, dialect: Dialect, request: Request) -> float:
        """Return the seconds that a read takes on the line, answered at the first poll."""
        command = bytes(HEADER_SIZE) + dialect.read(request.start, request.words)
        reply = bytes(HEADER_SIZE + dialect.reply_size(request.start, request.words))
        characters = len(frames.message_frame(reply, self._checksum)) + 2 * len(frames.ACK)
        if self._duplex is Duplex.HALF:
            characters += len(frames.master_frame(0, command, self._checksum))
            characters += len(frames.poll_frame(0))
        else:
            characters += len(frames.message_frame(command, self._checksum))
        return characters * self._char_time

    def _period(self, mapping: Mapping) -> float:
        if mapping.period is None:
            return self._default_period
        return mapping.period / 1000

    def _plan_area(self, mappings: list[Mapping]) -> list[Block]:
        """Plan the mappings of one station, area and period."""
        limit = _max_words(mappings[0])
        long = [mapping for mapping in mappings if mapping.codec.words > limit]
        short = [mapping for mapping in mappings if mapping.codec.words <= limit]
        blocks = [self._block([mapping], _cover([mapping])) for mapping in long]
        spans = self._cheapest([_cover([mapping]) for mapping in short], mappings[0], limit)
        for span in spans:
            served = [mapping for mapping in short if span.holds(_cover([mapping]))]
            short = [mapping for mapping in short if mapping not in served]
            blocks.append(self._block(served, span))
        return blocks

    def _cheapest(self, needed: list[_Span], example: Mapping, limit: int) -> list[_Span]:
        """Return the spans of at most ``limit`` words that hold all ``needed`` at least cost."""
        spans = _without_contained(needed)
        fixed, per_word = self._costs(example)
        per_element = example.address.file_type.layout.words
        best = [0.0]
        choice: list[tuple[int, _Span]] = []
        for last in range(len(spans)):
            options = []
            for first in range(last, -1, -1):
                span = _Span(spans[first].first, spans[last].end).aligned(per_element)
                if span.words > limit:
                    break
                options.append((best[first] + fixed + per_word * span.words, first, span))
            cost, first, span = min(options, key=lambda option: option[:2])
            best.append(cost)
            choice.append((first, span))
        chosen: list[_Span] = []
        rest = len(spans)
        while rest:
            rest, span = choice[rest - 1]
            chosen.insert(0, span)
        return chosen

    def _costs(self, mapping: Mapping) -> tuple[float, float]:
        """Return what a read of this area costs, and what each word adds."""
        dialect = DIALECTS[mapping.plc_type]
        start = mapping.address.at_offset(0)
        step = mapping.address.file_type.layout.words
        many = _max_words(mapping)
        one = self.line_time(dialect, Request(start, step))
        per_word = (self.line_time(dialect, Request(start, many)) - one) / max(many - step, 1)
        return one - step * per_word, per_word

    def _block(self, mappings: Sequence[Mapping], span: _Span) -> Block:
        first = mappings[0]
        limit = _max_words(first)
        requests = tuple(
            Request(first.address.at_offset(at), min(limit, span.end - at))
            for at in range(span.first, span.end, limit))
        dialect = DIALECTS[first.plc_type]
        line_time = sum(self.line_time(dialect, request) for request in requests)
        return Block(first.station, requests, tuple(mappings), self._period(first), line_time)


def _max_words(mapping: Mapping) -> int:
    return DIALECTS[mapping.plc_type].max_read(mapping.address.file_type)


def _cover(mappings: Sequence[Mapping]) -> _Span:
    """Return the words to read for ``mappings``."""
    first = min(mapping.address.offset for mapping in mappings)
    end = max(mapping.address.offset + mapping.codec.words for mapping in mappings)
    return _Span(first, end).aligned(mappings[0].address.file_type.layout.words)


def _without_contained(spans: list[_Span]) -> list[_Span]:
    """Return the spans that no other holds, by first word."""
    kept: list[_Span] = []
    for span in sorted(set(spans), key=lambda span: (span.first, -span.end)):
        if not kept or span.end > kept[-1].end:
            kept.append(span)
    return kept
