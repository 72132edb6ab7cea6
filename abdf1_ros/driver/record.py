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
Who writes which words of a PLC, and until when it may still land there: one record for all.

A word of a PLC can be written by a message, by ourselves (heartbeat, fallback), by a guest, by
each of them to all stations at once, and by a copy that a gateway has kept. Each such write is a
``Claim`` from the moment it has the line. The rules of docs/heartbeats.md ask here, whoever
writes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from enum import auto, Enum
import math
from typing import Protocol

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.driver.job_tasks import LineTime
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.pccc.extent import Extent
from abdf1_ros.plan.planner import Block
from abdf1_ros.settings.mapping import Mapping

_CHANGED = (Outcome.WRITTEN, Outcome.PARTLY)


# At an orderly end the second write of rule 10 comes after so many seconds: there are two in all.
_SETTLE_AT_END = 1.0


class _Writer(Enum):
    """Who writes."""

    MESSAGE = auto()
    OURS = auto()
    GUEST = auto()
    GUEST_SOMEWHERE = auto()  # by a command whose effect is not known
    BEFORE = auto()  # whoever had the line before the port was opened


# Who has written, and the values where they are ours.
_Source = tuple[object, ...]


class Claim:
    """
    One write to words of a PLC, under way or done.

    ``extents`` are its words, None where they are not known: any of the ``station``, which may be
    BROADCAST. ``write`` is that of a message or of ours, None for a guest's. It had the line from
    ``begun`` until it was ``done``, and lands up to ``lands_until`` (clock values in s): infinite
    while it is under way, -inf where nothing was written. ``outcome`` is how it ended.
    """

    def __init__(self, station: int, extents: Sequence[Extent] | None,
                 write: Write | None = None, begun: float = -math.inf) -> None:
        self.station = station
        self.extents = extents
        self.write = write
        self.outcome: Outcome | None = None
        self.begun, self.done, self.lands_until = begun, -math.inf, math.inf

    def end(self, outcome: Outcome, now: float, may_land_for: float) -> None:
        """Take note how it ended, and for how long (s) it may land: -inf where it cannot."""
        self.outcome, self.done, self.lands_until = outcome, now, now + may_land_for

    @property
    def has_changed(self) -> bool:
        """Tell whether it has ended, and words may be others by it, now or later."""
        return -math.inf < self.lands_until < math.inf

    def meets(self, extent: Extent) -> bool:
        """Tell whether it may write some of these words."""
        if self.extents is None:
            return self.station in (BROADCAST, extent.station)
        return any(extent.meets(other) for other in self.extents)

    @property
    def source(self) -> _Source:
        """Return whose values it writes, and which if they are ours."""
        if self.write is None:
            return (_Writer.GUEST_SOMEWHERE if self.extents is None else _Writer.GUEST,)
        return (_Writer.OURS, *self.write.raw) if self.write.is_own else (_Writer.MESSAGE,)


class WriteListener:
    """Gets notice of all writes; what is not overridden does nothing."""

    def write_begins(self, claim: Claim) -> None:
        """Take note that a write goes out."""

    def write_ended(self, claim: Claim) -> None:
        """Take note that one has ended."""

    def write_expired(self, write: Write) -> None:
        """Take note that a message was too old to have the line."""


class WordsListener(Protocol):
    """Gets the words of all good reads."""

    def words_read(self, block: Block, data: bytes, started: float) -> None:
        """Take the words of a block whose read ``started`` at that clock value (s)."""


class OwnWords:
    """
    The words of a row that we write by ourselves, and what else may come to stand in them.

    That is what had not landed when the last write of the row began that was confirmed. What we
    write is to be written once more at ``again_at`` (clock value in s): nothing older can land
    then (rule 10).
    """

    def __init__(self, row: Mapping, record: WriteRecord) -> None:
        self.row = row
        self.again_at = math.inf
        self._latest = math.inf  # for that: at the end there is little time
        self._record = record
        self._lands_until: dict[_Source, float] = {}
        self._stands: _Source = ()
        self._guest_done = -math.inf

    def ended(self, claim: Claim) -> None:
        """Take note how a claim of these words ended."""
        if claim.has_changed:
            self.may_land(claim.source, claim.lands_until)
            if claim.source == (_Writer.GUEST,):
                self._guest_done = claim.done
        if claim.write is not None and claim.outcome is Outcome.WRITTEN:
            self._stands = claim.source
            if self._guest_done <= claim.begun:
                self._guest_done = -math.inf
            self._lands_until = {source: until for source, until in self._lands_until.items()
                                 if until > claim.begun}

    def plan_again(self, tried: float) -> None:
        """Take note that what stands was sent at that clock value (s): is it written once more."""
        until = min(self.lands_until, self._latest)
        self.again_at = until if tried < until else math.inf

    def try_again(self, when: float, now: float) -> None:
        """Write it once more then, unless a second write is planned: this one failed."""
        if not now < self.again_at < math.inf:
            self.again_at = when

    def end(self, now: float) -> None:
        """Take note that there is an end."""
        self._latest = now + _SETTLE_AT_END

    def resume(self) -> None:
        """Take note that it was not the end."""
        self._latest = math.inf

    def may_land(self, source: _Source, until: float) -> None:
        """Take note that something of a writer may land up to then (clock value in s)."""
        self._lands_until[source] = max(until, self._lands_until.get(source, -math.inf))

    @property
    def are_guests(self) -> bool:
        """Tell whether what a guest has written may stand in them."""
        return self._guest_done > -math.inf

    def may_hold(self, value: int) -> bool:
        """Tell whether it is a value of ours that may stand in them."""
        return (_Writer.OURS, value) in self._lands_until

    @property
    def lands_until(self) -> float:
        """Return until when something else than stands may land (clock value in s)."""
        if not self._record.may_begin(self.row):
            return math.inf
        return max((until for source, until in self._lands_until.items()
                    if source != self._stands), default=-math.inf)


class WriteRecord:
    """
    All writes of a line.

    What ends without an answer may land for ``settle_time`` s more, as a gateway may hold it.
    Good reads are shown to ``readers``.
    """

    def __init__(self, line: LineTime, settle_time: float) -> None:
        self.line = line
        self._settle_time = settle_time
        self._under_way: list[Claim] = []
        self._words: dict[Mapping, OwnWords] = {}
        self._listeners: tuple[WriteListener, ...] = ()
        self.readers: tuple[WordsListener, ...] = ()

    def connect(self, listeners: tuple[WriteListener, ...],
                readers: tuple[WordsListener, ...]) -> None:
        """Tell ``listeners`` of all writes, and ``readers`` of all good reads, from now on."""
        self._listeners, self.readers = listeners, readers

    def words_of(self, row: Mapping) -> OwnWords:
        """Return the words of a row that we write by ourselves; they are watched from now on."""
        return self._words.setdefault(row, OwnWords(row, self))

    def opened(self) -> None:
        """Take note that the port is open: gateways may hold what was written before."""
        for words in self._words.values():
            if words.row.via is not None:
                words.may_land((_Writer.BEFORE,), self.line.now + self._settle_time)

    def may_begin(self, row: Mapping) -> bool:
        """Tell whether no write of these words is under way: packets of two must not mix."""
        return not any(claim.meets(row.extent) for claim in self._under_way)

    def messages(self) -> Iterator[Write]:
        """Return the messages that are under way."""
        return (claim.write for claim in self._under_way
                if claim.write is not None and not claim.write.is_own)

    def begin(self, station: int, extents: Sequence[Extent] | None,
              write: Write | None = None) -> Claim:
        """Take note that a write has the line, until it has ``ended``."""
        claim = Claim(station, extents, write, begun=self.line.now)
        self._under_way.append(claim)
        for listener in self._listeners:
            listener.write_begins(claim)
        return claim

    def ended(self, claim: Claim, outcome: Outcome, *, may_land: bool = False) -> None:
        """Take note how a write has ended, and whether some of it may land yet."""
        self._under_way.remove(claim)
        landed = 0.0 if outcome in _CHANGED else -math.inf
        may_land |= outcome is Outcome.BROADCAST  # which is not answered
        claim.end(outcome, self.line.now, self._settle_time if may_land else landed)
        for words in self._concerned(claim):
            words.ended(claim)
        for listener in self._listeners:
            listener.write_ended(claim)

    def _concerned(self, claim: Claim) -> Iterable[OwnWords]:
        """Return the words that a claim may have changed: those of its row, all of a guest's."""
        if claim.write is not None:
            return filter(None, (self._words.get(claim.write.mapping),))
        return [words for row, words in self._words.items() if claim.meets(row.extent)]

    def expired(self, write: Write) -> None:
        """Take note that a message was too old to have the line."""
        for listener in self._listeners:
            listener.write_expired(write)
