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
What the driver writes without a message: heartbeats and fallback values, and in which order.

At first contact the heartbeats of a PLC are written as 0. Then its fallback values follow that are
due, and only then do its heartbeats count. The numbers of rules are those of docs/heartbeats.md.
As everywhere in the driver ``now`` is an argument; it has to come from a clock that also counts
while the host sleeps (rule 6). None of this is a safety function.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Sequence
import heapq
import itertools
import math

from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.interlocks.fallback import FallbackCause, FallbackRow
from abdf1_ros.driver.interlocks.heartbeat import BeatState, HeartbeatRow
from abdf1_ros.driver.record import Claim, WriteListener
from abdf1_ros.driver.write import Outcome, Write, WriteResult
from abdf1_ros.driver.writes.queue import WriteQueue
from abdf1_ros.driver.writes.under_way import WriteJob, WritesUnderWay
from abdf1_ros.errors import RemoteError
from abdf1_ros.settings.mapping import Mapping

# So often in a row a PLC has not answered that is taken as out of reach, though its station is
# active: that of a gateway is.
_FAILURES = 2

# Then it is left alone for so long (s) at least; others on the line of a gateway have that for so
# many times as long as the last attempt took: an eighth is left to the silent.
_LEAST_PAUSE = 1.0
_SHARE_OF_OTHERS = 7

OwnRow = HeartbeatRow | FallbackRow
TurnRank = tuple[float, ...]


class OwnWrite(WriteJob):
    """
    A write that no message has asked for.

    It must not be sent after ``expires`` (clock value in s): its value may be wrong by then.
    """

    is_own = True

    def __init__(self, row: OwnRow, write: Write, writing: WritesUnderWay, interlocks: Interlocks,
                 expires: float = math.inf) -> None:
        write.is_own = True
        super().__init__(write, writing)
        # Of a fallback each packet goes out: the PLC may carry out what it does not answer.
        self.goes_on = isinstance(row, FallbackRow)
        self.row = row
        self.expires = expires
        self._interlocks = interlocks

    def ended(self, error: Exception | None) -> None:
        """Tell the row."""
        self._writing.ended(self)
        self._interlocks.ended(self)


class _Plc:
    """
    The rows of one station, and how it has answered our own writes.

    ``due`` is when its rows have to be looked at (clock value in s), infinite while it is
    inactive, ``first_due`` that for first tries, which no pause holds up. ``failures`` counts the
    last ones that it has not answered; from the second on it is left alone up to ``pause_end``.
    """

    def __init__(self, station: int) -> None:
        self.station = station
        self.heartbeats: list[HeartbeatRow] = []
        self.fallbacks: list[FallbackRow] = []
        self.rows: list[OwnRow] = []
        self.due = self.first_due = math.inf
        self.failures = 0
        self.pause_end = -math.inf
        self.is_running: bool | None = None

    @property
    def is_lost(self) -> bool:
        """Tell whether it is out of reach."""
        return self.failures >= _FAILURES

    def plan(self) -> None:
        """Look at its rows again when the first of them wants it."""
        self.due = min([row.due for row in self.rows], default=math.inf)
        self.first_due = min([row.first_due for row in self.rows], default=math.inf)


class Interlocks(WriteListener):
    """
    All heartbeats and fallbacks of a line.

    ``writes`` are the messages that wait or are under way. ``store`` puts the fallback of a Serve
    row into our own table; ``report`` gets the result of each fallback that was written, ``tell``
    why a PLC does not take one, ``warn`` that a heartbeat is not ours. Heartbeats count from
    ``first_beat`` on: two bridges that began together would not see each other if both did from 1.
    Only ``executor_ran``, ``wind_down`` and ``resume`` may be called from another thread.
    ``next_expiry`` is when a fallback of our own table is due (clock value in s), ``is_ending``
    tells of the end.
    """

    def __init__(self, mappings: Sequence[Mapping], stations: ActiveStationList,
                 writes: WriteQueue, writing: WritesUnderWay,
                 store: Callable[[Write], None], report: Callable[[WriteResult], None],
                 tell: Callable[[Mapping, str], None],
                 warn: Callable[[Mapping, str, bool], None], first_beat: int = 1) -> None:
        self._record = writing.record
        self.heartbeats = [HeartbeatRow(self._record.words_of(mapping), first_beat)
                           for mapping in mappings if mapping.heartbeat]
        self.fallbacks = [FallbackRow(self._record.words_of(mapping))
                          for mapping in mappings if mapping.fallback]
        self._ours = _Plc(-1)  # the rows of our own table
        self._plcs: dict[int, _Plc] = {}
        for beat in self.heartbeats:
            self._plc(beat).heartbeats.append(beat)
            self._plc(beat).rows.append(beat)
        for row in self.fallbacks:
            self._plc(row).fallbacks.append(row)
            self._plc(row).rows.append(row)
        self._by_mapping = {row.mapping: row for row in self.fallbacks}
        self._stations = stations
        self._writes = writes
        self._writing = writing
        self._store = store
        self._report = report
        self._tell, self._warn = tell, warn
        self._due = self.next_expiry = math.inf
        self._refreshes: list[tuple[float, int, FallbackRow]] = []
        self._tickets = itertools.count()
        self._held_up: list[OwnRow] = []
        self._messages: dict[str, float] = {}
        self._executor = -math.inf
        self._has_begun = False
        self.is_ending = False
        self._are_all_due = False
        self._awaited: frozenset[int] = frozenset()  # stations that answered when the end began

    def __bool__(self) -> bool:
        """Tell whether there is anything to write by ourselves."""
        return bool(self.heartbeats or self.fallbacks)

    def _plc(self, row: OwnRow) -> _Plc:
        if row.mapping.serves:
            return self._ours
        number = row.mapping.station
        return self._plcs.get(number) or self._plcs.setdefault(number, _Plc(number))

    # What happens

    def executor_ran(self, now: float) -> None:
        """Take note that the executor runs: a hung process must not look alive (rule 3 c)."""
        self._executor = now

    def wind_down(self) -> None:
        """Write 0, then every fallback, and nothing after that (rule 5)."""
        self.is_ending = True

    def resume(self) -> None:
        """Take note that it was not the end: the next opening of the port is a first contact."""
        self.is_ending = self._are_all_due = False
        for plc in (*self._plcs.values(), self._ours):
            for row in plc.rows:
                row.resume()

    @property
    def is_over(self) -> bool:
        """Tell whether all stations that answered at ``wind_down`` have confirmed its writes."""
        return not self or self._are_all_due and not any(
            row.mapping.station in self._awaited for row in self._unconfirmed())

    def unconfirmed(self) -> list[str]:
        """Return the tags of the rows that are not confirmed at the end, or may not stay so."""
        now = self._record.line.now
        held = {row.mapping.tag: row.words.lands_until - now for plc in self._plcs.values()
                for row in plc.rows if row.words.lands_until > now}
        return [*(row.mapping.tag for row in self._unconfirmed()), *(
            f'{tag} (a gateway may hold a write to it for {seconds:.1f} s)'
            for tag, seconds in held.items())]

    def _unconfirmed(self) -> Iterator[OwnRow]:
        yield from (row for row in self.heartbeats if not row.is_over)
        yield from (row for row in self.fallbacks if not row.is_confirmed)

    def begin(self, now: float) -> None:
        """Take note that the port has been opened: a first contact with everybody (rule 2)."""
        for plc in self._plcs.values():
            self._contact(plc, now, is_new=True)
        if not self._has_begun:
            self._record.opened()
            for row in self.fallbacks:
                row.make_due(FallbackCause.START, now)
        self._has_begun = True
        self._plan(*self._plcs.values(), self._ours)

    def contact(self, station: int, now: float) -> None:
        """Take note that a station is active again (rules 2, 8)."""
        if station in self._plcs:
            self._contact(self._plcs[station], now)

    def _contact(self, plc: _Plc, now: float, *, is_new: bool = False) -> None:
        for beat in plc.heartbeats:
            beat.begin(now, is_new=is_new)
        for row in plc.fallbacks if self._has_begun else ():
            if not row.is_fresh(now):
                row.make_due(FallbackCause.RETURN, now)
            else:  # a message that it waits for may be gone with the port
                row.due = -math.inf
        self._plan(plc)

    def mode_seen(self, station: int, is_running: bool, now: float) -> None:
        """Take note of a station's mode; a change to RUN is a first contact (rules 2, 8)."""
        plc = self._plcs.get(station)
        if plc is not None:
            was_running, plc.is_running = plc.is_running, is_running
            if is_running and was_running is False:
                for beat in plc.heartbeats:
                    beat.ran(now)
                for row in plc.fallbacks:
                    row.make_due(FallbackCause.RUN, now)
                self._plan(plc)

    def read_back(self, mapping: Mapping, words: bytes, started: float) -> None:
        """Compare a heartbeat that was read from ``started`` on (clock value, s) (rule 19)."""
        beat = next((beat for beat in self.heartbeats if beat.mapping is mapping), None)
        if beat is None:
            return
        value = int(mapping.codec.decode(words)[0])
        text = beat.read_back(value, started, self._writing.line.now)
        if text:
            self._warn(mapping, text, beat.state is BeatState.CONFLICT)
        self._plan(self._plc(beat))

    def message_came(self, write: Write) -> None:
        """Take note of a message that was accepted (rule 3 d)."""
        topic = write.mapping.topic
        for beat in self.heartbeats:
            if topic in beat.requires:
                if beat.missing(self._messages, write.requested):
                    beat.hold()  # before anybody looked: the line was busy all the time
                self._look_again(beat)
        self._messages[topic] = max(write.requested, self._messages.get(topic, -math.inf))

    def is_overruled(self, write: Write) -> bool:
        """Tell whether a message comes after the end, or before a fallback of its row (5, 9)."""
        row = self._by_mapping.get(write.mapping)
        return row is not None and (self._are_all_due or write.requested <= row.sent)

    def write_ended(self, claim: Claim) -> None:
        """Take note how a write ended, of whomever: fallbacks may wait for that (rules 7, 9)."""
        now = self._record.line.now
        rows: list[OwnRow] = []
        if claim.write is None:
            rows += (row for plc in self._plcs.values() for row in plc.rows
                     if claim.meets(row.mapping.extent))
        elif claim.write.mapping in self._by_mapping and not claim.write.is_own:
            rows.append(self._by_mapping[claim.write.mapping])
        for row in rows:
            row.write_ended(claim, now)
            if isinstance(row, FallbackRow):
                self._written_over(row, now)
        self._look_again(*rows, *self._held_up)
        self._held_up.clear()

    def _written_over(self, row: FallbackRow, now: float) -> None:
        if not row.stands and self._are_all_due:
            row.make_due(FallbackCause.END, now)
        elif row.stands and row.refresh_at <= now:
            self._plan_refresh(row, now)

    def write_expired(self, write: Write) -> None:
        """Take note that a message was too old to have the line: it is no longer waited for."""
        row = self._by_mapping.get(write.mapping)
        if row is not None:
            self._look_again(row)

    def _look_again(self, *rows: OwnRow) -> None:
        for row in rows:
            row.due = -math.inf
        self._plan(*{self._plc(row) for row in rows})

    def _plan(self, *plcs: _Plc) -> None:
        for plc in plcs:
            plc.plan()
        self.next_expiry = self._ours.due if self._has_begun else math.inf
        self._due = min((plc.due for plc in self._plcs.values()), default=math.inf)

    # Who goes next

    def next(self, now: float, busy: Container[int] = ()) -> OwnWrite | None:  # noqa: A003
        """Return what has to be written next, None for nothing."""
        self.expire(now)
        if self._are_all_due:  # there is no later for silent PLCs
            self._stations.probes.none_waits(now)
        if now < self._due:
            return None
        best: tuple[TurnRank, _Plc, OwnRow] | None = None
        youngest = self._writes.youngest()
        for plc in self._plcs.values():
            if plc.due <= now and plc.station not in busy and self._stations[plc.station].active:
                for row in self._ready(plc, youngest, now):
                    rank = self._rank(plc, row, now)
                    if rank is not None and (best is None or rank < best[0]):
                        best = rank, plc, row
                plc.plan()
        self._plan()
        return None if best is None else self._begin(best[1], best[2], youngest, now)

    def _ready(self, plc: _Plc, youngest: dict[Mapping, float], now: float) -> list[OwnRow]:
        """Return the rows of a PLC that want to write now."""
        due = [row for row in plc.fallbacks
               if row.due <= now and row.judge(now, youngest.get(row.mapping, -math.inf))]
        held_up = [row for row in due if not self._record.may_begin(row.mapping)]
        for row in held_up:  # by a write that is under way (rule 9), whose end is reported
            row.due = math.inf
        self._held_up += held_up
        why = self._why_held(plc) if plc.heartbeats else ''
        beats = [beat for beat in plc.heartbeats if beat.judge(
            now, why or self._missing(beat, now), self._executor, self._messages)]
        return [*beats, *(row for row in due if row not in held_up)]

    def _why_held(self, plc: _Plc) -> str:
        """Return why no heartbeat of a PLC may count, empty if it may (rules 3 b, 5)."""
        if self.is_ending:
            return 'the bridge ends'
        return next(filter(None, (row.why_held for row in plc.fallbacks)), '')

    def _missing(self, beat: HeartbeatRow, now: float) -> str:
        topic = beat.missing(self._messages, now)
        return f'no message of {topic} in time' if topic else ''

    def _rank(self, plc: _Plc, row: OwnRow, now: float) -> TurnRank | None:
        """
        Return when a row has its turn, the least first; None where it has to wait (rules 10, 11).

        First tries go at once: the PLC may well carry out what it does not answer. Those that
        answer go before those that do not. Of these the one goes first that was tried the longest
        ago, and those that reply late have the time for probes only.
        """
        is_zero = isinstance(row, HeartbeatRow) and row.wants_zero
        is_beat = isinstance(row, HeartbeatRow) and not row.wants_zero
        is_ill = plc.failures > 0 or not self._stations[plc.station].replies_in_time
        if row.is_first_try and not is_beat:
            return 0, is_ill, not is_zero
        if not is_ill:
            return (2, 0, 0, row.tried) if is_beat else (1, 0, not is_zero, row.tried)
        if now < self._free_from(plc):
            return None
        return 3, plc.pause_end, is_beat, not is_zero, row.tried

    def _free_from(self, plc: _Plc) -> float:
        """Return from when on more than first tries may be written to a PLC (clock value in s)."""
        if self.is_ending:  # there is no later
            return -math.inf
        return max(plc.pause_end, self._stations.next_message(plc.station))

    def _begin(self, plc: _Plc, row: OwnRow, youngest: dict[Mapping, float],
               now: float) -> OwnWrite:
        expires = math.inf
        if isinstance(row, FallbackRow):
            self._writes.drop('fallback', now, row.mapping)
        elif not row.wants_zero:
            expires = self._good_until(plc, row, youngest)
        write = row.take(now)
        row.due = math.inf
        self._plan(plc)
        return OwnWrite(row, write, self._writing, self, expires)

    def _good_until(self, plc: _Plc, row: HeartbeatRow, youngest: dict[Mapping, float]) -> float:
        """Return until when a heartbeat may be sent (clock value in s): later it may be wrong."""
        ends = [fallback.deadline(youngest.get(fallback.mapping, -math.inf))
                for fallback in plc.fallbacks]
        return min([row.executor_until(self._executor), row.topics_until(self._messages), *ends])

    def refresh(self, now: float, busy: Container[int] = ()) -> OwnWrite | None:
        """
        Return a fallback that stands and is to be written again, None for none (rule 8).

        It does not go before messages, and waits while one of its row does, if these are taken.
        """
        passed_over = []
        found = None
        while found is None and self._refreshes and self._refreshes[0][0] <= now:
            entry = heapq.heappop(self._refreshes)
            when, _, row = entry
            if when != row.refresh_at or not row.stands:
                continue
            if row.mapping.station in busy:
                passed_over.append(entry)
                continue
            is_waiting = row.mapping in self._writes.youngest()
            if row.is_under_way or is_waiting and not row.has_failed \
                    or not self._record.may_begin(row.mapping) \
                    or not self._stations[row.mapping.station].replies_in_time:
                self._plan_refresh(row, now + row.after)
                continue
            row.due = math.inf
            found = OwnWrite(row, row.refresh(now), self._writing, self)
        for entry in passed_over:
            heapq.heappush(self._refreshes, entry)
        return found

    def _plan_refresh(self, row: FallbackRow, when: float) -> None:
        row.refresh_at = when
        heapq.heappush(self._refreshes, (when, next(self._tickets), row))

    def ended(self, own: OwnWrite) -> None:
        """Take note how one of our writes ended."""
        row, result, now = own.row, own.result, self._writing.line.now
        plc = self._plc(row)
        outcome = Outcome.NOT_SENT if result is None else result.outcome
        self._judge_reach(plc, own, outcome, now)
        if isinstance(row, HeartbeatRow):
            row.ended(outcome, now)
        else:
            self._fallback_ended(row, own.write, outcome, now)
        for beat in plc.heartbeats:  # they may depend on it (rule 3 b)
            beat.due = min(beat.due, now)
        self._plan(plc)
        if result is not None and outcome is not Outcome.NOT_SENT:
            refusal = '' if outcome is Outcome.WRITTEN else str(result.error)
            if isinstance(result.error, RemoteError) and refusal != row.refusal:
                self._tell(row.mapping, f'not written: {refusal}')
            row.refusal = refusal

    def _judge_reach(self, plc: _Plc, own: OwnWrite, outcome: Outcome, now: float) -> None:
        """
        Leave a PLC that does not answer alone for a while, or it would take the whole line.

        When one answers again that is behind a gateway, it is a first contact, as its station was
        active all the time (rules 2, 8).
        """
        is_behind_gateway = own.row.mapping.via is not None
        if outcome is Outcome.UNKNOWN:
            plc.failures += 1
            if plc.is_lost:
                took = self._writing.line.took(own.begun, now)
                share = _SHARE_OF_OTHERS * took * is_behind_gateway
                plc.pause_end = now + max(_LEAST_PAUSE, share)
        elif outcome is not Outcome.NOT_SENT:
            was_lost, plc.failures, plc.pause_end = plc.is_lost, 0, -math.inf
            if was_lost and is_behind_gateway:
                self._contact(plc, now)

    def _fallback_ended(self, row: FallbackRow, write: Write, outcome: Outcome,
                        now: float) -> None:
        cause = row.cause
        seconds = row.ended(outcome, now)
        if row.stands and not row.mapping.serves:
            self._plan_refresh(row, row.refresh_at)
        if seconds is not None and cause is not None:
            self._report(WriteResult(
                row.mapping, Outcome.FALLBACK, cause.value, write.value, seconds))

    def expire(self, now: float) -> None:
        """Do what needs no line: begin the end, store overdue fallbacks of our own table."""
        if not self._has_begun:
            return
        if self.is_ending and not self._are_all_due:
            self._make_all_due(now)
        if now < self.next_expiry:
            return
        youngest = self._writes.youngest()
        for row in self._ours.fallbacks:
            if row.due <= now and row.judge(now, youngest.get(row.mapping, -math.inf)):
                write = row.take(now)
                self._store(write)
                self._fallback_ended(row, write, Outcome.WRITTEN, now)
                row.judge(now, -math.inf)
        self._plan(self._ours)

    def _make_all_due(self, now: float) -> None:
        for row in self.fallbacks:
            self._writes.drop('fallback', now, row.mapping)
            row.end(now)
        self._awaited = frozenset(
            number for number in self._plcs if self._stations[number].active)
        for beat in self.heartbeats:
            beat.end(now)
        self._are_all_due = True
        self._plan(*self._plcs.values(), self._ours)

    def next_due(self) -> float:
        """Return when there is something to write (clock value in s), infinite for never."""
        due = self._refreshes[0][0] if self._refreshes else math.inf
        for plc in self._plcs.values():
            if plc.due < due and self._stations[plc.station].active:
                due = min(due, plc.first_due, max(plc.due, self._free_from(plc)))
        return due
