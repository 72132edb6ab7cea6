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
All writes of a line that still say something about words of a PLC, each of them one flight.

Four writers can write a word of a PLC: a message, the bridge itself (heartbeat, fallback), a
guest, and a gateway that has kept a copy of a write. Each of these writers may also write to all
stations at once. Each write is a ``Flight`` from the moment it has the line. What the rules of
docs/heartbeats.md ask about words is a question to the flights: what may still land, what a guest
has written over, which value stands, which result waits for a read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import auto, Enum
import math

from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import LineTime
from abdf1_ros.driver.write import Outcome, outcome_of, Write, WriteResult
from abdf1_ros.errors import LinkError, RemoteError
from abdf1_ros.pccc.extent import Extent, OUR_TABLE
from abdf1_ros.plan.planner import Block
from abdf1_ros.settings.mapping import Mapping

_CHANGED = (Outcome.WRITTEN, Outcome.PARTLY)

# At an orderly end the second write of rule 10 is sent after this many seconds at most. With
# ~/polling and ~/reload the whole end may take twice that time.
_SETTLE_AT_END = 1.0


class _Writer(Enum):
    """The writer of a flight."""

    MESSAGE = auto()
    OURS = auto()
    NEIGHBOUR = auto()  # a row with other bits of a word that is written back as a whole
    GUEST = auto()
    GUEST_SOMEWHERE = auto()  # by a command whose effect is not known


# The writer, and the values if they are ours.
_Source = tuple[object, ...]


@dataclass(slots=True, eq=False)
class Flight:
    """
    One write to words of a PLC, from its turn on.

    Times are clock values (s).

    - ``station``: may be BROADCAST or OUR_TABLE.
    - ``extents``: its words, None if unknown: any words of the station.
    - ``write``: the write of a message or of the bridge itself, None for a guest.
    - ``begun``, ``done``: when it got the line, and when it ended.
    - ``lands_until``: until when it may land. Infinite while it is under way, -inf if nothing was
      written.
    - ``outcome``: how it ended; ``error``: why it is not confirmed.
    - ``result``: is what the sender gets; an unconfirmed one waits for a read.
    - ``since``: when the first of equal confirmed writes in a row was confirmed.
    - ``shown``: when the last read that has shown its value began; infinite if the words may have
      changed since.
    - ``is_earlier``: it is of the driver before ~/reload.
    """

    station: int
    extents: Sequence[Extent] | None
    write: Write | None = None
    begun: float = -math.inf
    done: float = -math.inf
    lands_until: float = math.inf
    outcome: Outcome | None = None
    error: LinkError | RemoteError | None = None
    result: WriteResult | None = None
    since: float = math.inf
    shown: float = -math.inf
    is_earlier: bool = False

    def end(self, outcome: Outcome, now: float, settle_time: float,
            error: LinkError | RemoteError | None = None) -> None:
        """Record how the write ended; without an answer it may land for ``settle_time`` s more."""
        self.outcome, self.error, self.done = outcome, error, now
        ended = outcome if error is None else outcome_of(self.station, error)
        if ended in (Outcome.UNKNOWN, Outcome.BROADCAST):  # no station answers a broadcast
            self.lands_until = now + settle_time
        else:
            self.lands_until = now if outcome in _CHANGED else -math.inf

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

    def is_message_of(self, row: Mapping) -> bool:
        """Tell whether it writes a message of a row."""
        return self.write is not None and self.write.mapping is row and not self.write.is_own

    def concerns(self, row: Mapping) -> bool:
        """Tell whether it is a write of the row, or may have changed its words beside others."""
        return self.write is None or self.write.mapping is row or self.may_restore \
            or self.is_earlier

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


def _key_of(flight: Flight) -> tuple[object, ...]:
    """Return the words of a flight, and its values if they are ours: each of them may land."""
    write = flight.write
    return flight.station, flight.extents, write.raw if write is not None and write.is_own else ()


class Words:
    """The words of a row, and the flights that may have changed them."""

    def __init__(self, row: Mapping, flights: Flights) -> None:
        self.row = row
        self._flights = flights
        self.flights: list[Flight] = []  # in the order in which they began

    @property
    def last(self) -> Flight | None:
        """Return the last confirmed write of the row, of a message or our own."""
        return self._last_but(None)

    def _last_but(self, flight: Flight | None) -> Flight | None:
        return next((one for one in reversed(self.flights)
                     if one.outcome is Outcome.WRITTEN and one.write is not None
                     and one.write.mapping is self.row and one is not flight), None)

    def begins(self, flight: Flight) -> None:
        """Take a write that may change these words."""
        last = self.last
        if last is not None and not _continues(last, flight, self.row):
            last.shown = math.inf
        self.flights.append(flight)

    def ended(self, flight: Flight) -> None:
        """Take the end of a write that may have changed these words."""
        if flight not in self.flights:  # it may restore bits beside its own
            self.flights.append(flight)
        last = self.last
        if last is flight:
            before, flight.since = self._last_but(flight), flight.done
            if before is not None and before.shown < math.inf and self._is_settled(before) \
                    and _continues(before, flight, self.row):
                flight.since, flight.shown = before.since, before.shown
        begun = last.begun if last is not None else -math.inf
        self.flights = [one for one in self.flights if one is last or one.outcome is None
                        or one.has_changed and one.lands_until > begun
                        and not self._is_hidden(one, flight)]

    def _is_hidden(self, one: Flight, flight: Flight) -> bool:
        """Tell whether a flight says no more than an unconfirmed one of the same writer."""
        return one is not flight and flight.has_changed and flight is not self.last \
            and one.lands_until <= flight.lands_until \
            and one.source(self.row) == flight.source(self.row)

    def _is_settled(self, last: Flight) -> bool:
        """Tell whether no other write can have landed since the ``last`` one began."""
        opened = self._flights.opened_until if self._flights.has_gateway(self.row) else -math.inf
        return last.begun >= max([opened, *(
            one.lands_until for one in self.flights
            if one is not last and not _continues(last, one, self.row))])

    def again_at(self, ended: float = math.inf) -> float:
        """
        Return when our confirmed value is to be written a second time, infinite for never.

        Then no write that was under way before can land any more (rule 10). It is not later than a
        second after the end of the bridge has begun, at ``ended`` (clock values, s).
        """
        last = self.last
        if last is None:
            return math.inf
        until = min(self._lands([one for one in self.flights if one.done <= last.done]),
                    ended + _SETTLE_AT_END)
        return until if until > last.begun else math.inf

    def are_ours(self, but: Flight | None = None) -> bool:
        """Tell whether our write was confirmed, and no message came after it ``but`` this one."""
        last = self._last_but(but)
        return last is not None and last.write is not None and last.write.is_own and not any(
            one.is_message_of(self.row) and one.has_changed and one.begun >= last.begun
            for one in self.flights if one is not but)

    @property
    def are_guests(self) -> bool:
        """Tell whether these words may have a guest's value."""
        return self._guest_done(is_known=True) > -math.inf

    @property
    def guest_somewhere(self) -> float:
        """Return when a guest wrote unknown words last, maybe these (s); -inf for not since."""
        return self._guest_done(is_known=False)

    def _guest_done(self, *, is_known: bool) -> float:
        """Return when a guest's last write ended since the last confirmed one of the row began."""
        last = self.last
        begun = last.begun if last is not None else -math.inf
        return max((one.done for one in self.flights
                    if one.write is None and (one.extents is not None) is is_known
                    and one.has_changed and one.done > begun), default=-math.inf)

    def may_hold(self, value: int) -> bool:
        """Tell whether ``value`` is ours and these words may have it."""
        return any(one.has_changed and one.source(self.row) == (_Writer.OURS, value)
                   for one in self.flights)

    @property
    def lands_until(self) -> float:
        """Return until when another value than the confirmed one may land (clock value in s)."""
        return self._lands(self.flights) if self._flights.may_begin(self.row) else math.inf

    def _lands(self, flights: Sequence[Flight]) -> float:
        """Return until when another value than the confirmed one may land from these flights."""
        last = self.last
        begun, stands = (-math.inf, ()) if last is None else (last.begun, last.source(self.row))
        found = [one.lands_until for one in flights
                 if one.has_changed and one.concerns(self.row) and one.lands_until > begun
                 and one.source(self.row) != stands]
        if self._flights.has_gateway(self.row) and self._flights.opened_until > begun:
            found.append(self._flights.opened_until)
        return max(found, default=-math.inf)

    def words_read(self, words: bytes, started: float) -> None:
        """Take the words of a good read: they show the value of the last message, or another."""
        last = self.last
        if last is not None and last.write is not None and started >= last.since \
                and last.shown < math.inf:
            last.shown = started if last.write.is_held(words) else math.inf

    def forget(self) -> None:
        """Treat the value as unknown, as the PLC may be another one now."""
        if (last := self.last) is not None:
            last.shown = math.inf

    def proof(self, write: Write, now: float, patience: float) -> str:
        """
        Return what proves that the PLC holds the value of a message, empty for nothing.

        By rule 27, a reply proves that the write was executed then; only a read proves that the
        PLC still holds its value. The last read holds for ``patience`` s at most.
        """
        last, again = self.last, (self.row.write_again or 0) / 1000
        if last is None or last.write is None or last.write.is_own or last.shown == math.inf \
                or not last.write.equals(write) or not self._is_settled(last):
            return ''
        if now >= last.done + again or now >= last.shown + min(again, patience):
            return ''
        return f'confirmed {now - last.done:.2f} s ago, read {now - last.shown:.2f} s ago'


def _continues(last: Flight, flight: Flight, row: Mapping) -> bool:
    """Tell whether a message of a row asks for the value that its last message has written."""
    return flight.is_message_of(row) and last.is_message_of(row) \
        and flight.write is not None and last.write is not None \
        and flight.write.equals(last.write)


class Flights:
    """
    The writes of a line that are under way, that may still land, and that were the last of a row.

    A write without an answer may land for ``settle_time`` s more, as a gateway may hold it.
    ``stations`` knows which stations are behind a gateway. The result of an unconfirmed write
    waits ``patience`` s at most for a read of its words; ``report`` gets it. Only the link thread
    may use this object.

    - ``has_sent``: a write to a PLC has begun, also before ~/reload.
    - ``unread``: writes that have ended, and whose results wait for a read.
    - ``repeated``: the words of rows with Write_Again, whose values may stand.
    - ``opened_until``: until when a gateway may deliver a write from before the port was opened.
    """

    def __init__(self, line: LineTime, settle_time: float, stations: ActiveStationList,
                 patience: float = math.inf,
                 report: Callable[[WriteResult], None] = lambda result: None) -> None:
        self.line = line
        self._settle_time = settle_time
        self._stations = stations
        self._patience = patience
        self._report = report
        self.has_sent = False
        self.opened_until = -math.inf
        self._under_way: list[Flight] = []
        self._late: list[Flight] = []  # have ended, and may land; the last one of each _key_of
        self.unread: list[Flight] = []
        self._words: dict[Mapping, Words] = {}
        self.repeated: list[Words] = []
        self._sharing: dict[Mapping, list[Words]] = {}  # cached, as it takes long to find out

    def words_of(self, row: Mapping) -> Words:
        """Return the words of a row; watch them from now on."""
        if row not in self._words:
            self._words[row] = Words(row, self)
            if row.write_again:
                self.repeated.append(self._words[row])
        return self._words[row]

    # What happens

    def opened(self) -> None:
        """Record that gateways may hold earlier writes: the port has been opened."""
        self.opened_until = self.line.now + self._settle_time

    def take_over(self, before: Flights) -> None:
        """Take the writes of the driver before that may still land, also of rows that are gone."""
        self.has_sent |= before.has_sent
        self._late = [replace(flight, is_earlier=True) for flight in before._late
                      if flight.lands_until > before.line.now]
        for flight in self._late:
            for words in self._words.values():
                if flight.meets(words.row.extent):
                    words.begins(flight)

    def begin(self, station: int, extents: Sequence[Extent] | None,
              write: Write | None = None) -> Flight:
        """Record that a write has the line, until it has ``ended``."""
        flight = Flight(station, extents, write, begun=self.line.now)
        self.has_sent |= station != OUR_TABLE
        self._under_way.append(flight)
        for one in [*self.unread]:
            assert one.write is not None
            if flight.meets(one.write.mapping.extent):  # it is sent now
                self._tell(one, 'not read back: a newer write of these words has gone out')
        for words in self._disturbed(flight):
            words.begins(flight)
        return flight

    def ended(self, flight: Flight, outcome: Outcome,
              error: LinkError | RemoteError | None = None) -> None:
        """Record the end of a write."""
        now = self.line.now
        self._under_way.remove(flight)
        flight.end(outcome, now, self._settle_time, error)
        if flight.lands_until > now:
            self._late = [*(late for late in self._late if late.lands_until > now
                            and _key_of(late) != _key_of(flight)), flight]
        for words in self._disturbed(flight):
            words.ended(flight)

    def _disturbed(self, flight: Flight) -> Iterable[Words]:
        """Return the words that a write may change, or may have changed."""
        if flight.write is None or flight.may_restore:
            return [words for row, words in self._words.items() if flight.meets(row.extent)]
        row = flight.write.mapping
        if row not in self._sharing:
            self._sharing[row] = [words for words in self._words.values() if words.row is row
                                  or words.row.write_again and words.row.shares_words(row)]
        return self._sharing[row]

    # Results that wait for a read

    def tell(self, flight: Flight, result: WriteResult, *, is_read: bool) -> None:
        """
        Report the result of a message; an unconfirmed result waits for a read of its words.

        Its words are all read if it ``is_read``.
        """
        assert flight.write is not None
        flight.result = result
        if not result.is_unconfirmed:
            self._tell(flight)
        elif is_read:
            self.unread.append(flight)
        else:
            self._tell(flight, 'not read back: no row reads all of these words')

    def words_read(self, block: Block, data: bytes, started: float) -> None:
        """Compare the words of a good read that began at ``started`` (clock value, s)."""
        for flight in [*self.unread]:
            assert flight.write is not None
            row = flight.write.mapping
            if started >= flight.done and block.extent.holds(row.extent):
                is_held = flight.write.is_held(data[block.slice_of(row)])
                which = 'the value' if is_held else 'another value'
                self._tell(flight, f'read back: the PLC holds {which}')
        for words in self.repeated:
            if block.extent.holds(words.row.extent):
                words.words_read(data[block.slice_of(words.row)], started)

    def expire(self, now: float) -> None:
        """End the waiting of results that have waited too long for a read."""
        for flight in [*self.unread]:
            if now >= flight.done + self._patience:
                self._tell(flight, f'not read back within {self._patience:g} s')

    @property
    def next_expiry(self) -> float:
        """Return when ``expire`` has work (clock value in s), infinite for never."""
        return self.unread[0].done + self._patience if self.unread else math.inf

    def port_lost(self) -> None:
        """End all waiting for reads; no value is known any more."""
        self.forget()
        for flight in [*self.unread]:
            self._tell(flight, 'not read back before the line went down')

    def _tell(self, flight: Flight, finding: str = '') -> None:
        result = flight.result
        assert flight.write is not None and result is not None
        if finding:
            self.unread = [one for one in self.unread if one is not flight]
            result = replace(result, detail=f'{result.detail}; {finding}')
        for each in result.of(flight.write.origins, self.line.now):
            self._report(each)

    # Values that stand

    def forget(self, station: int | None = None) -> None:
        """Forget the values of a station that may be another PLC now; without a number, of all."""
        for words in self.repeated:
            if station in (None, words.row.station):
                words.forget()

    def proof(self, write: Write, now: float) -> str:
        """Return the proof that the PLC holds the value of a message, empty for no proof."""
        row = write.mapping
        patience = row.fallback.after / 1000 if row.fallback else self._patience
        return self._words[row].proof(write, now, patience) if row in self._words else ''

    # Questions about the line

    def has_gateway(self, row: Mapping) -> bool:
        """Tell whether the PLC of a row is known to be behind a gateway."""
        station = row.extent.station
        return station in self._stations and self._stations[station].has_gateway

    def may_begin(self, row: Mapping) -> bool:
        """Tell whether no write of these words is under way: packets of writes must not mix."""
        return not any(flight.meets(row.extent) for flight in self._under_way)

    @property
    def is_rewriting(self) -> bool:
        """Tell whether a write under way has read a word to write it back changed."""
        return any(flight.write is not None and flight.write.is_rewriting
                   for flight in self._under_way)

    def messages(self) -> Iterator[Write]:
        """Return the messages that are under way."""
        return (flight.write for flight in self._under_way
                if flight.write is not None and not flight.write.is_own)
