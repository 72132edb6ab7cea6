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
One record of all writes: who writes which words of a PLC, and until when a write may land.

Four writers can write a word of a PLC: a message, the bridge itself (heartbeat, fallback), a
guest, and a gateway that has kept a copy of a write. Each of these writers may also write to all
stations at once. Each write is a ``Claim`` from the moment it has the line. The rules of
docs/heartbeats.md ask this record about all writers.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Sequence
from enum import auto, Enum
import math
from typing import Protocol

from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.job_tasks import LineTime
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.errors import LinkError, RemoteError
from abdf1_ros.pccc.extent import Extent, OUR_TABLE
from abdf1_ros.plan.planner import Block
from abdf1_ros.settings.mapping import Mapping

_CHANGED = (Outcome.WRITTEN, Outcome.PARTLY)


# At an orderly end the second write of rule 10 is sent after this many seconds at most. With
# ~/polling and ~/reload the whole end may take twice that time.
_SETTLE_AT_END = 1.0


class _Writer(Enum):
    """The writer of a claim."""

    MESSAGE = auto()
    OURS = auto()
    NEIGHBOUR = auto()  # a row with other bits of a word that is written back as a whole
    GUEST = auto()
    GUEST_SOMEWHERE = auto()  # by a command whose effect is not known
    ANYBODY = auto()  # any program before the port was opened; counts only behind a gateway


# The writer, and the values if they are ours.
_Source = tuple[object, ...]


class Claim:
    """
    One write to words of a PLC, under way or done.

    Times are clock values (s).

    - ``station``: may be BROADCAST or OUR_TABLE.
    - ``extents``: its words, None if unknown: any words of the station.
    - ``write``: the write of a message or of the bridge itself, None for a guest.
    - ``begun``, ``done``: when it got the line, and when it ended.
    - ``lands_until``: until when it may land. Infinite while it is under way, -inf if nothing was
      written.
    - ``outcome``: how it ended; ``error``: why it is not confirmed.
    """

    def __init__(self, station: int, extents: Sequence[Extent] | None,
                 write: Write | None = None, begun: float = -math.inf) -> None:
        self.station = station
        self.extents = extents
        self.write = write
        self.outcome: Outcome | None = None
        self.error: LinkError | RemoteError | None = None
        self.begun, self.done, self.lands_until = begun, -math.inf, math.inf

    def end(self, outcome: Outcome, now: float, may_land_for: float) -> None:
        """Record how the write ended, and for how long (s) it may land, -inf if it cannot."""
        self.outcome, self.done, self.lands_until = outcome, now, now + may_land_for

    @property
    def has_changed(self) -> bool:
        """Return True if it has ended and may have changed words, now or later."""
        return -math.inf < self.lands_until < math.inf

    @property
    def may_restore(self) -> bool:
        """Tell whether it has ended, and may land later with old values of bits beside its own."""
        return self.write is not None and self.write.mapping.may_rewrite \
            and self.done < self.lands_until < math.inf

    def meets(self, extent: Extent) -> bool:
        """Tell whether the write may change some of these words."""
        if self.extents is None:
            return extent.may_be_in(self.station)
        return any(extent.meets(other) for other in self.extents)

    def source(self, row: Mapping) -> _Source:
        """
        Return who writes the words of a row, with the values if they are ours.

        Values of ours stay ours when new files have another row for the same words.
        """
        if self.write is None:
            return (_Writer.GUEST_SOMEWHERE if self.extents is None else _Writer.GUEST,)
        written = self.write.mapping
        if self.write.is_own and (written.extent, written.codec) == (row.extent, row.codec):
            return (_Writer.OURS, *self.write.raw)
        return (_Writer.MESSAGE if written is row else _Writer.NEIGHBOUR,)


def _key_of(claim: Claim) -> tuple[object, ...]:
    """Return the words of a claim, and its values if they are ours: each of them may land."""
    write = claim.write
    return claim.station, claim.extents, write.raw if write is not None and write.is_own else None


class WriteListener:
    """A listener to all writes; methods that are not overridden do nothing."""

    def earlier_may_land(self, stations: Container[int], until: float) -> None:
        """
        Take the stations whose gateways may hold writes from before the port was opened.

        These writes may land until ``until`` (clock value, s). It may have passed already where a
        gateway shows itself late.
        """

    def write_begins(self, claim: Claim) -> None:
        """Take a write that now has the line."""

    def write_ended(self, claim: Claim) -> None:
        """Take a write that has ended."""

    def write_expired(self, write: Write) -> None:
        """Take a message that has ended before it had the line."""

    def may_land(self, claim: Claim) -> None:
        """Take a write of the driver before, which has ended, but may still land."""


class WordsListener(Protocol):
    """A listener to the words of all good reads."""

    def words_read(self, block: Block, data: bytes, started: float) -> None:
        """Take the words of a block; its read began at ``started`` (clock value, s)."""


class OwnWords:
    """
    The words of a row that the bridge writes by itself, and other writes that may change them.

    It remembers writes that had not landed when the last confirmed write of the row began. At
    ``again_at`` (clock value, s) none of them can land any more; then our value is written a
    second time (rule 10).
    """

    def __init__(self, row: Mapping, record: WriteRecord) -> None:
        self.row = row
        self.again_at = math.inf
        self._latest = math.inf  # latest ``again_at``, finite only at the end
        self._record = record
        self._lands_until: dict[_Source, float] = {}
        self._stands: _Source = ()
        self._guest_done = -math.inf

    def ended(self, claim: Claim) -> None:
        """Record how a claim of these words ended."""
        source = claim.source(self.row)
        if claim.has_changed:
            self.may_land(source, claim.lands_until)
            if source == (_Writer.GUEST,):
                self._guest_done = claim.done
        if claim.write is not None and claim.outcome is Outcome.WRITTEN:
            self._stands = source
            if self._guest_done <= claim.begun:
                self._guest_done = -math.inf
            self._lands_until = {source: until for source, until in self._lands_until.items()
                                 if until > claim.begun}

    def plan_again(self, tried: float) -> None:
        """Plan a second write of the value sent at ``tried`` (s) if a write may land later."""
        until = min(self.lands_until, self._latest)
        self.again_at = until if tried < until else math.inf

    def earlier_may_land(self) -> None:
        """Plan a second write if one from before the port was opened may have landed since."""
        until = self._lands_until.get((_Writer.ANYBODY,), math.inf)
        if until < math.inf:
            self.again_at = min(self.again_at, until, self._latest)

    def try_again(self, when: float, now: float) -> None:
        """Plan another write after a failed one, unless a second write is planned (rule 10)."""
        if not now < self.again_at < math.inf:
            self.again_at = when

    def end(self, now: float) -> None:
        """Bound the time of a second write: the bridge ends."""
        self._latest = now + _SETTLE_AT_END

    def resume(self) -> None:
        """Remove the bound of ``end``: the bridge goes on."""
        self._latest = math.inf

    def may_land(self, source: _Source, until: float) -> None:
        """Record until when a write of this writer may land (clock value in s)."""
        self._lands_until[source] = max(until, self._lands_until.get(source, -math.inf))

    @property
    def are_guests(self) -> bool:
        """Tell whether these words may have a guest's value."""
        return self._guest_done > -math.inf

    def may_hold(self, value: int) -> bool:
        """Tell whether ``value`` is ours and these words may have it."""
        return (_Writer.OURS, value) in self._lands_until

    @property
    def lands_until(self) -> float:
        """Return until when another value than the confirmed one may land (clock value in s)."""
        if not self._record.may_begin(self.row):
            return math.inf
        left_out = self._stands, () if self._record.has_gateway(self.row) else (_Writer.ANYBODY,)
        return max((until for source, until in self._lands_until.items()
                    if source not in left_out), default=-math.inf)


class WriteRecord:
    """
    All writes of a line.

    A write without an answer may land for ``settle_time`` s more, as a gateway may hold it.
    ``stations`` knows which stations are behind a gateway.
    ``readers`` get the words of good reads. ``has_sent`` is set when a write to a PLC has begun,
    also before ~/reload.
    """

    def __init__(self, line: LineTime, settle_time: float, stations: ActiveStationList) -> None:
        self.line = line
        self._settle_time = settle_time
        self._stations = stations
        self.has_sent = False
        self._opened_until = -math.inf
        self._under_way: list[Claim] = []
        self._late: list[Claim] = []  # have ended, and may land; the last one of each _key_of
        self._words: dict[Mapping, OwnWords] = {}
        self._listeners: tuple[WriteListener, ...] = ()
        self.readers: tuple[WordsListener, ...] = ()

    def connect(self, listeners: tuple[WriteListener, ...],
                readers: tuple[WordsListener, ...]) -> None:
        """Send all writes to ``listeners``, and all good reads to ``readers``, from now on."""
        self._listeners, self.readers = listeners, readers

    def words_of(self, row: Mapping) -> OwnWords:
        """Return the words of a row that the bridge writes by itself; watch them from now on."""
        return self._words.setdefault(row, OwnWords(row, self))

    def opened(self) -> None:
        """Record that gateways may hold earlier writes: the port has been opened."""
        behind = {station.number for station in self._stations if station.has_gateway}
        until = self._opened_until = self.line.now + self._settle_time
        for words in self._words.values():  # a gateway may show itself later
            words.may_land((_Writer.ANYBODY,), until)
        for listener in self._listeners:
            listener.earlier_may_land(behind, until)

    def gateway_replied(self, station: int) -> None:
        """Record that a station turned out to be behind a gateway after the port was opened."""
        for listener in self._listeners:
            listener.earlier_may_land({station}, self._opened_until)

    def take_over(self, before: WriteRecord) -> None:
        """Take the writes of the record before that may still land, also of rows that are gone."""
        self.has_sent |= before.has_sent
        self._late = [claim for claim in before._late if claim.lands_until > before.line.now]
        for claim in self._late:
            for row, words in self._words.items():
                if claim.meets(row.extent):
                    words.may_land(claim.source(row), claim.lands_until)
            for listener in self._listeners:
                listener.may_land(claim)

    def has_gateway(self, row: Mapping) -> bool:
        """Tell whether the PLC of a row is known to be behind a gateway."""
        station = row.extent.station
        return station in self._stations and self._stations[station].has_gateway

    def may_begin(self, row: Mapping) -> bool:
        """Tell whether no write of these words is under way: packets of writes must not mix."""
        return not any(claim.meets(row.extent) for claim in self._under_way)

    @property
    def is_rewriting(self) -> bool:
        """Tell whether a write under way has read a word to write it back changed."""
        return any(claim.write is not None and claim.write.is_rewriting
                   for claim in self._under_way)

    def messages(self) -> Iterator[Write]:
        """Return the messages that are under way."""
        return (claim.write for claim in self._under_way
                if claim.write is not None and not claim.write.is_own)

    def begin(self, station: int, extents: Sequence[Extent] | None,
              write: Write | None = None) -> Claim:
        """Record that a write has the line, until it has ``ended``."""
        claim = Claim(station, extents, write, begun=self.line.now)
        self.has_sent |= station != OUR_TABLE
        self._under_way.append(claim)
        for listener in self._listeners:
            listener.write_begins(claim)
        return claim

    def ended(self, claim: Claim, outcome: Outcome,
              error: LinkError | RemoteError | None = None, *, may_land: bool = False) -> None:
        """Record the end of a write; ``may_land`` tells whether a part of it may still land."""
        claim.error = error
        self._under_way.remove(claim)
        landed = 0.0 if outcome in _CHANGED else -math.inf
        may_land |= outcome is Outcome.BROADCAST  # no station answers it
        now = self.line.now
        claim.end(outcome, now, self._settle_time if may_land else landed)
        if may_land:
            self._late = [*(late for late in self._late if late.lands_until > now
                            and _key_of(late) != _key_of(claim)), claim]
        for words in self._concerned(claim):
            words.ended(claim)
        for listener in self._listeners:
            listener.write_ended(claim)

    def _concerned(self, claim: Claim) -> Iterable[OwnWords]:
        """Return the words of a claim's row, or all that it may have changed."""
        if claim.write is not None and not claim.may_restore:
            return filter(None, (self._words.get(claim.write.mapping),))
        return [words for row, words in self._words.items() if claim.meets(row.extent)]

    def expired(self, write: Write) -> None:
        """Tell the listeners that a message has ended before it had the line."""
        for listener in self._listeners:
            listener.write_expired(write)
