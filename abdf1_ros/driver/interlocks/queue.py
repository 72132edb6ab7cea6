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
The order of the driver's own writes, which no message has asked for: heartbeats, fallback values.

At first contact the heartbeats of a PLC are written as 0. Then its due fallback values are
written, and only after them its heartbeats count. The rules have the numbers of
docs/heartbeats.md. As everywhere in the driver, ``now`` is an argument. It has to come from a
clock that also counts while the host sleeps (rule 6). None of this is a safety function.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator
import math
from operator import attrgetter
from random import Random

from abdf1_ros.driver.flights import Flight, WriteListener
from abdf1_ros.driver.interlocks.end import OrderlyEnd
from abdf1_ros.driver.interlocks.fallback import FallbackCause, FallbackRow, FallbackState
from abdf1_ros.driver.interlocks.heartbeat import HeartbeatRow, LARGEST
from abdf1_ros.driver.interlocks.own import Conditions, Crowd
from abdf1_ros.driver.interlocks.plc import OwnRow, Plc, TurnRank
from abdf1_ros.driver.job_tasks import Job
from abdf1_ros.driver.reads.readings import ValueListener
from abdf1_ros.driver.served import Served
from abdf1_ros.driver.write import Outcome, Write, WriteResult
from abdf1_ros.driver.writes.queue import WriteQueue
from abdf1_ros.driver.writes.under_way import WriteJob, WritesUnderWay
from abdf1_ros.errors import RemoteError
from abdf1_ros.pccc.extent import OUR_TABLE
from abdf1_ros.plan.planner import Block
from abdf1_ros.settings.heartbeats import LAST_ANSWER
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.rows import Rows

_first_look, _first_refresh = attrgetter('looks.first'), attrgetter('refreshes.first')


class Interlocks(WriteListener):
    """
    All heartbeats and fallbacks of a line.

    - ``writes``: the messages that wait or are under way.
    - ``served``: takes the fallback of a Serve row.
    - ``listener``: gets the result of each fallback that was written, and why a PLC refuses a
      fallback or a heartbeat.
    - ``warn``: gets foreign heartbeat values.
    - ``seed``: a different number in each bridge. Two bridges that began together would not see
      each other if both counted from 1.
    - ``ours``: the rows of our own table; ``expire`` has work when ``ours`` has to be looked at.

    - ``end``: the orderly end.

    Only ``executor_ran`` and ``crowd``, and two methods of ``end``, may be called from another
    thread.
    """

    def __init__(self, mappings: Rows, writes: WriteQueue, writing: WritesUnderWay,
                 served: Served, listener: ValueListener,
                 warn: Callable[[Mapping, str, bool], None], seed: int = 0) -> None:
        flights, dice = writing.flights, Random(seed)
        self.conditions = conditions = Conditions()
        self.heartbeats = [
            HeartbeatRow(flights.words_of(mapping), conditions, 1 + seed % LARGEST, dice)
            for mapping in mappings.heartbeats]
        self.fallbacks = [FallbackRow(flights.words_of(mapping), conditions)
                          for mapping in mappings.fallbacks]
        rows: list[OwnRow] = [*self.heartbeats, *self.fallbacks]
        stations_of = {row: row.mapping.extent.station for row in rows}
        self.plcs = {number: Plc(
            number, [row for row in rows if stations_of[row] == number], writing.stations, flights,
            self.conditions)
            for number in dict.fromkeys((OUR_TABLE, *stations_of.values()))}
        self._plc_of = {row: self.plcs[number] for row, number in stations_of.items()}
        self.ours = self.plcs.pop(OUR_TABLE)
        self._by_mapping = {row.mapping: row for row in self.fallbacks}
        self._single = [row for row in self.fallbacks if row.mapping.single_publisher]
        self._row_of = {row.mapping: row for row in rows}
        self._meeting: dict[Mapping, list[OwnRow]] = {}  # cached, as it takes long to find out
        self._writes = writes
        self._writing, self._line = writing, writing.line
        self._served = served
        self._listener, self._warn = listener, warn
        self._has_begun = False
        self.end = OrderlyEnd(self._plc_of, self.ours, flights, conditions)

    # What happens

    def executor_ran(self, now: float) -> None:
        """Record that the executor runs: a hung process must not look alive (rule 3 c)."""
        self.conditions.executor = now

    def crowd(self, topic: str, crowd: Crowd) -> None:
        """
        Record that a topic has, or had, more than one publisher (rule 28).

        Then the caller has to wake the link. Only the last crowd of a topic is kept: publishers
        that come and go faster than the link looks fill no memory.
        """
        self.conditions.crowds[topic] = crowd

    def begin(self, now: float) -> None:
        """
        Begin a first contact with each station: the port has been opened (rule 2).

        An end that has lost the port begins anew.
        """
        self.end.begin_anew()
        self._writing.flights.opened()
        if not self._has_begun:
            for row in self.fallbacks:
                row.make_due(FallbackCause.START, now)
        self._has_begun = True
        for plc in self.plcs.values():
            plc.contact(now, is_new=True)
        self.ours.look_again()

    def earlier_may_land(self, stations: Container[int]) -> None:
        """Write again what such a write may have replaced (rule 10)."""
        for plc in self.plcs.values():
            if plc.station in stations:
                plc.look_again()

    def forget_served(self) -> None:
        """Serve 0, or the fallback of a row: other bridges may take messages from now on."""
        self._served.clear()
        for row in self.ours.fallbacks:
            self._served.store(row.mapping, row.raw)

    def contact(self, station: int, now: float) -> None:
        """Begin a first contact with a station that is active again (rules 2, 8)."""
        if self._has_begun and station in self.plcs:
            self.plcs[station].contact(now)

    def mode_seen(self, station: int, is_running: bool, now: float) -> None:
        """Record the mode of a station; a change to RUN is a first contact (rules 2, 8)."""
        if station in self.plcs:
            self.plcs[station].mode_seen(is_running, now)

    def words_read(self, block: Block, data: bytes, started: float) -> None:
        """Compare the heartbeats of a block that was read from ``started`` on (rule 19)."""
        for beat in self.heartbeats:
            mapping = beat.mapping
            if mapping in block.mappings:
                value = int(mapping.codec.decode(data[block.slice_of(mapping)])[0])
                if text := beat.read_back(value, started, self._writing.line.now):
                    self._warn(mapping, text, beat.is_taken)
                self._plc_of[beat].look_again(beat)

    def message_came(self, write: Write) -> None:
        """Record an accepted message (rule 3 d)."""
        topic, messages, now = write.mapping.topic, self.conditions.messages, self._line.now
        for beat in self.heartbeats:
            if topic in beat.topics:
                if beat.missing(write.requested):
                    # the time-out passed before a look: the line was busy all the time
                    beat.hold(now)
                self._plc_of[beat].look_again(beat)
        messages[topic] = max(write.requested, messages.get(topic, -math.inf))

    def is_overruled(self, write: Write) -> bool:
        """Tell whether the end has begun, or a fallback was sent after a message (rules 5, 9)."""
        row = self._by_mapping.get(write.mapping)
        return row is not None and (self.end.has_begun or write.requested <= row.sent)

    def why_refused(self, write: Write) -> str:
        """Return why the publishers of a topic forbid a message, empty if they do not (28)."""
        crowd = self.conditions.crowds.get(write.mapping.topic) \
            if write.mapping.single_publisher else None
        return crowd.why if crowd and write.requested <= crowd.until else ''

    def new_crowds(self, now: float) -> Iterator[tuple[Mapping, str]]:
        """Make the fallbacks of new crowds due; yield their rows, each with the reason (28)."""
        if not self._has_begun or self.end.is_asked:
            return
        for row in self._single:
            crowd = self.conditions.crowds.get(row.mapping.topic)
            if crowd is None or crowd.until == row.refused_until:
                continue
            is_new, row.refused_until = crowd.until > row.refused_until, crowd.until
            if is_new:
                row.make_due(FallbackCause.PUBLISHERS, now)
                self._plc_of[row].look_again(row)
                yield row.mapping, crowd.why

    def is_put_off(self, write: Write) -> bool:
        """
        Tell whether a message comes while the fallback of its row is due at a silent PLC (4).

        Otherwise the PLC might execute messages and fallbacks in turns, as long as messages come.
        """
        row = self._by_mapping.get(write.mapping)
        return row is not None and row.cause is not None and not self._plc_of[row].is_active

    def may_stand(self, write: Write) -> bool:
        """Tell whether the state of the row's fallback allows a message to be left out."""
        row = self._by_mapping.get(write.mapping)
        return row is None or row.state is FallbackState.MESSAGE and not row.is_under_way

    def stands(self, write: Write) -> None:
        """Record a message whose value the PLC holds already: it refreshes its row (7)."""
        if row := self._by_mapping.get(write.mapping):
            row.message_ended(write.requested, Outcome.WRITTEN)
            self._plc_of[row].look_again(row)

    def write_ended(self, flight: Flight) -> None:
        """Record how any write ended: fallbacks may wait for its end (rules 7, 9)."""
        now = self._line.now
        if flight.station in self.plcs:
            self.plcs[flight.station].write_ended(flight, now)
        write, rows = flight.write, self._met(flight)
        for row in rows:
            if write is None or flight.is_message_of(row.mapping):
                self._written_by_others(row, flight, now)
        if write is not None and write.is_own:
            self._own_ended(flight, write, now)
        for row in rows:
            self._plc_of[row].look_again(row)

    def _met(self, flight: Flight) -> list[OwnRow]:
        """Return the rows whose words a write may change: some may have waited for its end (9)."""
        if flight.write is None:
            return [row for row in self._plc_of if flight.meets(row.mapping.extent)]
        mapping = flight.write.mapping
        if mapping not in self._meeting:
            self._meeting[mapping] = [
                row for row in self._plc_of if flight.meets(row.mapping.extent)]
        return self._meeting[mapping]

    def _written_by_others(self, row: OwnRow, flight: Flight, now: float) -> None:
        """Record the end of a message to a row, or of a guest's write of its words."""
        row.write_ended(flight, now)
        if not row.is_confirmed:
            self.end.leave_standing(row)
        if isinstance(row, FallbackRow) and not row.stands and self.end.has_begun:
            row.make_due(FallbackCause.END, now)

    def write_expired(self, write: Write) -> None:
        """Let the fallback stop waiting for a message that has ended before it had the line."""
        if write.mapping in self._by_mapping:
            row = self._by_mapping[write.mapping]
            self._plc_of[row].look_again(row)

    # Who goes next

    def next(self, now: float, busy: Container[int] = (), *,  # noqa: A003
             only_active: bool = False) -> WriteJob | None:
        """Return the next own write, None for none; ``only_active``: not for silent PLCs."""
        self.expire(now)
        if not self.end.has_begun:
            return self._first(now, busy, only_active)
        only_active |= self.end.waits_for_active
        self._writing.stations.probes.keep_none_waiting(now)
        return self._first(now, busy, only_active) or self._once_more(now, busy, only_active)

    def _first(self, now: float, busy: Container[int], only_active: bool) -> WriteJob | None:
        """Return the first of all writes that are due."""
        if now < min(map(_first_look, self.plcs.values()), default=math.inf):
            return None
        best: tuple[TurnRank, Plc, OwnRow] | None = None
        youngest: dict[Mapping, float] | None = None
        for plc in self.plcs.values():
            if plc.looks.first > now or plc.station in busy or only_active and not plc.is_active:
                continue
            youngest = self._writes.youngest() if youngest is None else youngest
            for row in plc.ready(youngest, now):
                rank = plc.rank(row, now)
                if rank is not None and (best is None or rank < best[0]):
                    best = rank, plc, row
        if best is None or youngest is None:
            return None
        return self._begin(best[1], best[2], youngest, now)

    def _once_more(self, now: float, busy: Container[int], only_active: bool) -> WriteJob | None:
        """Return the write of a row that stood when the end began: after all else (rule 5)."""
        rows = [row for row in self.end.to_repeat(only_active) if row.mapping.station not in busy]
        if not rows:
            return None
        row = min(rows, key=lambda row: not self._plc_of[row].is_active)
        job = WriteJob(row.refresh(now), self._writing, math.inf,
                       answer_within=self._answer_within(self._plc_of[row]))
        row.repeat = job.flight
        return job

    def _answer_within(self, plc: Plc) -> float:
        """Return for how long (s) at most to wait for an answer: not for long at the end."""
        is_last = self.end.has_begun and not plc.is_active
        return LAST_ANSWER if is_last else math.inf

    def _begin(self, plc: Plc, row: OwnRow, youngest: dict[Mapping, float],
               now: float) -> WriteJob:
        expires, is_again = math.inf, False
        if isinstance(row, FallbackRow):
            self._writes.drop('fallback', now, row.mapping)
            if is_again := row.stands:
                self.conditions.gave_way = now
        elif not row.wants_zero:
            expires = plc.good_until(row, youngest)
        self.conditions.is_beats_turn = is_again
        is_first = row.is_first_try
        job = WriteJob(row.take(now), self._writing, expires, is_free=is_first,
                       answer_within=self._answer_within(plc))
        row.trial = job.flight
        plc.begins(row)
        return job

    def beats_gave_way(self) -> None:
        """Record that heartbeats gave way to a read: they go next."""
        self.conditions.is_beats_turn = True

    def is_beats_turn(self, now: float) -> bool:
        """Tell whether a heartbeat of a PLC that answers is due, and has given way already."""
        return self.conditions.is_beats_turn and any(
            beat.counts and plc.looks.times[beat] <= now and plc.answers
            for plc in self.plcs.values() for beat in plc.heartbeats)

    def refresh(self, now: float, busy: Container[int] = ()) -> WriteJob | None:
        """
        Return the next confirmed fallback that has to be written again; None for none (rule 8).

        It does not go before messages. It waits while a message of its row waits, unless the last
        message of the row was not confirmed.
        """
        due = [plc for plc in self.plcs.values()
               if plc.refreshes.first <= now and plc.station not in busy]
        for plc in sorted(due, key=_first_refresh):
            row = plc.to_refresh(self._writes.youngest(), now)
            if row is not None:
                job = WriteJob(row.refresh(now), self._writing, math.inf)
                row.trial = job.flight
                plc.begins(row)
                return job
        return None

    def is_urgent(self, job: Job) -> bool:
        """Tell whether a job writes a fallback that does not stand: heartbeats wait for it."""
        return isinstance(job, WriteJob) and job.is_own \
            and not self._by_mapping[job.write.mapping].stands

    def is_awaited(self, job: Job) -> bool:
        """Tell whether a job writes a fallback for the second time, or a message waits for it."""
        if not isinstance(job, WriteJob) or not job.is_own:
            return False
        row = self._by_mapping[job.write.mapping]
        return row.again_at <= self._line.now \
            or row.mapping in self._writes.youngest()

    def _own_ended(self, flight: Flight, write: Write, now: float) -> None:
        """Record how one of our own writes ended."""
        assert flight.outcome is not None
        row, outcome = self._row_of[write.mapping], flight.outcome
        if isinstance(row, HeartbeatRow):
            row.ended(now)
        else:
            self._fallback_ended(row, write, outcome, now)
        self.end.confirmed(row, outcome)
        if outcome is not Outcome.NOT_SENT:
            refusal = '' if outcome is Outcome.WRITTEN else str(flight.error)
            if isinstance(flight.error, RemoteError) and refusal != row.refusal:
                self._listener.unreadable(row.mapping, f'not written: {refusal}')
            row.refusal = refusal

    def _fallback_ended(self, row: FallbackRow, write: Write, outcome: Outcome,
                        now: float) -> None:
        cause = row.cause
        seconds = row.ended(outcome, now)
        if seconds is not None and cause is not None:
            self._listener.written(WriteResult(
                row.mapping, Outcome.FALLBACK, cause.value, write.value, seconds))

    def expire(self, now: float) -> None:
        """Do the work that needs no line: begin the end, store due fallbacks of our own table."""
        if not self._has_begun:
            return
        if self.end.is_asked and not self.end.has_begun:
            for row in self.fallbacks:
                self._writes.drop('fallback', now, row.mapping)
            self.end.begin(now)
        if now < self.ours.looks.first:
            return
        flights = self._writing.flights
        for own in self.ours.ready(self._writes.youngest(), now):
            write = own.take(now)
            own.trial = flights.begin(OUR_TABLE, (own.mapping.extent,), write)
            self._served.store(write.mapping, write.raw)
            flights.ended(own.trial, Outcome.WRITTEN)

    def next_due(self) -> float:
        """Return when the next write is due (clock value in s), infinite for never."""
        due, only_active = math.inf, self.end.waits_for_active
        if any(self.end.to_repeat(only_active)):
            return -math.inf
        for plc in self.plcs.values():
            if not only_active or plc.is_active:
                due = plc.next_due(due)
        return due
