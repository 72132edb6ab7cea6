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
The one room that decides what may be written to PLCs.

Events go in, and ``next`` is the only gate to the line for a write. What comes of an event is in
``out``, for the caller to take. Nothing here waits, reads a clock, or knows how a write is sent.
The rules have the numbers of docs/heartbeats.md.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import LineTime
from abdf1_ros.driver.kernel.flights import Flight, Flights
from abdf1_ros.driver.kernel.gate import Gate, Rank, Turn
from abdf1_ros.driver.kernel.own import Crowd
from abdf1_ros.driver.kernel.reasons import WriteReasons
from abdf1_ros.driver.kernel.rows import OwnRows
from abdf1_ros.driver.kernel.turns import OwnTurns
from abdf1_ros.driver.kernel.waiting import WaitingWrites
from abdf1_ros.driver.write import Outcome, Write, WriteResult
from abdf1_ros.errors import LinkError, RemoteError
from abdf1_ros.pccc.extent import Extent, OUR_TABLE
from abdf1_ros.plan.planner import Block
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.rows import Rows

NOT_HEARD = 'nothing has been heard on this connection'


class Connection(Protocol):
    """A connection with PLCs; it ``is_heard`` if a reply has come, or none is needed (rule 26)."""

    is_heard: bool


class OurTable(Protocol):
    """The words of our own table, which PLCs read: see ``driver.served.Served``."""

    def store(self, mapping: Mapping, values: Sequence[float] | str) -> None: ...

    def clear(self) -> None: ...


@dataclass(frozen=True, slots=True)
class Refused:
    """A PLC refuses a heartbeat or fallback; ``text`` says why."""

    mapping: Mapping
    text: str


@dataclass(frozen=True, slots=True)
class ForeignValue:
    """A heartbeat value that is not ours; ``is_conflict`` if not the first lately (rule 19)."""

    mapping: Mapping
    text: str
    is_conflict: bool


News = WriteResult | Refused | ForeignValue


class Kernel:
    """
    What may be written to the PLCs of a line, by messages, by the bridge itself and by guests.

    - ``mappings``: the rows that may be written; ``own``: those that we write by ourselves.
    - ``line``: its present time; ``stations``: whether they answer.
    - ``connection``: whether it has been heard; ``table``: the words that PLCs read from us.
    - ``settle_time``: seconds for which a gateway may hold a write.
    - ``patience``: seconds that a message waits for the line, and its result for a read.
    - ``tx_delay``: seconds before each transmission.
    - ``seed``: a different number in each bridge, see ``OwnRows``.

    - ``flights``, ``waiting``, ``rows``, ``turns``: for questions; only the kernel changes them.
    - ``out``: results and reports since they were last taken, the oldest first.

    Only ``executor_ran`` and ``crowd``, and two methods of ``end``, may be called from another
    thread.
    """

    def __init__(self, mappings: Rows, own: Rows, stations: ActiveStationList, line: LineTime,
                 connection: Connection, table: OurTable, *, settle_time: float, patience: float,
                 tx_delay: float = 0.0, seed: int = 0) -> None:
        self.out: deque[News] = deque()
        self.flights = Flights(line, settle_time, stations, patience, self.out.append)
        for row in mappings:
            if row.write_again:
                self.flights.words_of(row)
        self.waiting = WaitingWrites(stations, self.flights, patience, self.out.append, tx_delay)
        self.rows = OwnRows(own, self.flights, stations, seed)
        self.turns = OwnTurns(self.rows, self.waiting)
        self._gate = Gate(stations, self.flights, self.waiting, self.rows, self.turns)
        self.end = self.rows.end
        self._stations, self._line = stations, line
        self._connection, self._table = connection, table
        self._has_begun = False

    # What happens

    def executor_ran(self, now: float) -> None:
        """Record that the executor runs: a hung process must not look alive (rule 3 c)."""
        self.rows.conditions.executor = now

    def crowd(self, topic: str, crowd: Crowd) -> None:
        """
        Record that a topic has, or had, more than one publisher (rule 28).

        Then the caller has to wake the link. Only the last crowd of a topic is kept: publishers
        that come and go faster than the link looks fill no memory.
        """
        self.rows.conditions.crowds[topic] = crowd

    def opened(self, now: float) -> None:
        """
        Begin a first contact with each station, because the port is open now (rule 2).

        Gateways may hold earlier writes. An end that has lost the port begins anew.
        """
        self.end.begin_anew()
        self.flights.opened()
        self.rows.earlier_may_land(
            {station.number for station in self._stations if station.has_gateway})
        if not self._has_begun:
            self.rows.begin(now)
        self._has_begun = True
        self.rows.contact(now)

    def lost(self, new: Iterable[Write], reason: str, now: float) -> None:
        """End all messages, also ``new`` ones, so that none is sent later: the port is gone."""
        for write in new:
            self._tell(write, Outcome.NOT_SENT, reason)
        self.drop(reason, now)
        self.flights.port_lost()

    def station_changed(self, number: int, now: float, *, is_active: bool) -> None:
        """Record that a station is active, or no longer: it may be another PLC (rules 2, 8)."""
        self.flights.forget(number)
        if is_active and self._has_begun and number in self.rows.plcs:
            self.rows.plcs[number].contact(now)

    def gateway_replied(self, number: int) -> None:
        """Record that a station turned out to be behind a gateway after the port was opened."""
        self.rows.earlier_may_land({number})

    def mode_seen(self, number: int, now: float, *, is_running: bool) -> None:
        """Record the mode of a station; a change to RUN is a first contact (rules 2, 8)."""
        if not is_running:  # a download may follow
            self.flights.forget(number)
        if number in self.rows.plcs:
            self.rows.plcs[number].mode_seen(is_running, now)

    def new_crowds(self, now: float) -> Iterator[tuple[Mapping, str]]:
        """Drop the messages of topics with more than one publisher; yield their rows (28)."""
        if not self._has_begun or self.end.is_asked:
            return
        for row, why in self.rows.new_crowds(now):
            self.drop(why, now, row)
            yield row, why

    def asked(self, write: Write, now: float) -> None:
        """Take a message: it waits for the line, is stored in our table, or is refused."""
        reasons = self._reasons(write, now)
        if not reasons.publishers and not reasons.overruled:
            self.rows.message_came(write, self._line.now)
        if reasons.first:
            self._tell(write, *reasons.first)
        elif not write.mapping.serves:
            self.waiting.add(write, now)
        else:
            self._store(self.flights.begin(OUR_TABLE, (write.mapping.extent,), write))
            self._tell(write, Outcome.WRITTEN)

    def _reasons(self, write: Write, now: float) -> WriteReasons:
        """Return what is against a message that comes to the link's thread."""
        rows, must_be_heard = self.rows, not write.mapping.serves and any(self._stations)
        return WriteReasons(
            publishers=rows.why_refused(write),
            overruled='fallback' if rows.is_overruled(write) else '',
            put_off='fallback' if rows.is_put_off(write) else '',
            waited=self.waiting.why_too_old(write, now),
            unheard=NOT_HEARD if must_be_heard and not self._connection.is_heard else '')

    def guest(self, station: int, extents: Sequence[Extent] | None) -> Flight:
        """Record that a command of a guest has the line; it writes ``extents``, None: unknown."""
        return self.flights.begin(station, extents)

    def ended(self, flight: Flight, outcome: Outcome,
              error: LinkError | RemoteError | None = None) -> None:
        """Record how a write has ended."""
        self.flights.ended(flight, outcome, error)
        confirmed, write = self.rows.write_ended(flight, self._line.now), flight.write
        if write is None or not write.is_own:
            return
        if confirmed is not None:
            self.out.append(WriteResult(write.mapping, Outcome.FALLBACK, confirmed.cause.value,
                                        write.value, confirmed.seconds))
        if refusal := self.rows.row_of[write.mapping].note_refusal(flight):
            self.out.append(Refused(write.mapping, f'not written: {refusal}'))

    def told(self, flight: Flight, result: WriteResult, *, is_read: bool) -> None:
        """Report the result of a message; an unconfirmed one waits for a read of its words."""
        self.flights.tell(flight, result, is_read=is_read)

    def read(self, block: Block, data: bytes, started: float) -> None:
        """Compare the words of a good read that began at ``started`` (rules 19, 27)."""
        if self.flights.unread or self.flights.repeated:
            self.flights.words_read(block, data, started)
        if self.rows.heartbeats:
            for beat, text in self.rows.words_read(block, data, started, self._line.now):
                self.out.append(ForeignValue(beat.mapping, text, beat.is_taken))

    def drop(self, reason: str, now: float, mapping: Mapping | None = None) -> None:
        """End the messages that wait, of one row or all."""
        for row in self.waiting.drop(reason, now, mapping):
            self.rows.look_again(row)

    def forget_served(self) -> None:
        """Serve 0, or the fallback of a row: other bridges may take messages from now on."""
        self._table.clear()
        for row in self.rows.ours.fallbacks:
            self._table.store(row.mapping, row.raw)

    def take_over(self, before: Kernel) -> None:
        """Take what is known of the line before new files: they change nothing on it."""
        self.flights.take_over(before.flights)
        self.end.take_over(before.end)

    def expire(self, now: float) -> None:
        """Do the work that needs no line: end what is too old, write to our own table."""
        self._expire_own(now)
        self._expire_messages(now)
        self.flights.expire(now)

    def _expire_messages(self, now: float) -> None:
        for row in self.waiting.expire(now):
            self.rows.look_again(row)  # a fallback may have waited for the message

    def _expire_own(self, now: float) -> None:
        """Begin the end, and store due fallbacks of our own table."""
        if not self._has_begun:
            return
        if self.end.is_asked and not self.end.has_begun:
            for row in self.rows.fallbacks:
                self.drop('fallback', now, row.mapping)
            self.end.begin(now)
        if now >= self.rows.ours.looks.first:
            for own in self.rows.ours.ready(self.waiting.youngest(), now):
                own.trial = self.flights.begin(
                    OUR_TABLE, (own.mapping.extent,), own.take(now))
                self._store(own.trial)

    def _store(self, flight: Flight) -> None:
        """Carry out a write to our own table."""
        write = flight.write
        assert write is not None
        self._table.store(write.mapping, write.raw)
        self.ended(flight, Outcome.WRITTEN)

    # Who goes next

    def next(self, now: float, rank: Rank, busy: Container[int] = ()) -> Turn | None:  # noqa: A003
        """Return the next write of a rank, which begins now; not for a ``busy`` station."""
        if rank is Rank.MESSAGE:
            self._expire_messages(now)
        elif rank is not Rank.REFRESH:
            self._expire_own(now)
        return self._gate.next(now, rank, busy)

    def _tell(self, write: Write, outcome: Outcome, detail: str = '') -> None:
        self.out.extend(write.result(outcome, detail).of(write.origins, self._line.now))

    @property
    def next_expiry(self) -> float:
        """Return when ``expire`` has work (clock value in s), infinite for never."""
        ours, waiting = self.rows.ours.looks.first, self.waiting.next_expiry
        due = ours if ours < waiting else waiting  # faster than min, and asked for each packet
        return min(due, self.flights.next_expiry) if self.flights.unread else due
