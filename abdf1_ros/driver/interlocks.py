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

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from dataclasses import dataclass
import math

from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.fallbacks import FallbackCause, FallbackRow
from abdf1_ros.driver.heartbeats import HeartbeatRow
from abdf1_ros.driver.points import Outcome, Write, WriteResult
from abdf1_ros.driver.writes import WriteQueue
from abdf1_ros.driver.writing import WriteJob, WritesUnderWay
from abdf1_ros.errors import RemoteError
from abdf1_ros.settings.mapping import Mapping

# A stopped executor does not wake the link, so the link looks by itself every so many seconds.
_GLANCE = 0.1

# So often in a row a PLC has not answered that is taken as out of reach, though its station is
# active: that of a gateway is.
_FAILURES = 2

# Then it is left alone for so long (s) at least; others on the line of a gateway have that for so
# many times as long as the last attempt took: an eighth is left to the silent.
_LEAST_PAUSE = 1.0
_SHARE_OF_OTHERS = 7


class OwnWrite(WriteJob):
    """
    A write that no message has asked for.

    It must not be sent after ``expires`` (clock value in s): its value may be wrong by then.
    """

    def __init__(self, row: HeartbeatRow | FallbackRow, write: Write, writing: WritesUnderWay,
                 interlocks: Interlocks, expires: float = math.inf) -> None:
        super().__init__(write, writing)
        self.row = row
        self.expires = expires
        self._interlocks = interlocks
        write.is_own = True
        writing.begin(write)

    def ended(self, error: Exception | None) -> None:
        """Tell the row."""
        self._writing.ended(self)
        self._interlocks.ended(self)


@dataclass(slots=True)
class _Reach:
    """How often in a row a PLC has not answered, and until when it is left alone (clock, s)."""

    failures: int = 0
    pause_end: float = -math.inf

    @property
    def is_lost(self) -> bool:
        """Tell whether it is out of reach."""
        return self.failures >= _FAILURES


class Interlocks:
    """
    All heartbeats and fallbacks of a line.

    ``writes`` are the messages that wait or are under way. ``store`` puts the fallback of a Serve
    row into our own table; ``report`` gets the result of each fallback that was written. Only
    ``executor_ran``, ``wind_down`` and ``resume`` may be called from another thread.
    """

    def __init__(self, mappings: Sequence[Mapping], stations: ActiveStationList,
                 writes: WriteQueue, writing: WritesUnderWay, cmd_timeout: float,
                 store: Callable[[Write], None], report: Callable[[WriteResult], None],
                 tell: Callable[[Mapping, str], None]) -> None:
        self.heartbeats = [HeartbeatRow(mapping) for mapping in mappings if mapping.heartbeat]
        self.fallbacks = [FallbackRow(mapping, cmd_timeout)
                          for mapping in mappings if mapping.fallback]
        self._served = [row for row in self.fallbacks if row.mapping.serves]
        self._numbers = {mapping.station for mapping in mappings
                         if (mapping.heartbeat or mapping.fallback) and not mapping.serves}
        self._by_mapping = {id(row.mapping): row for row in self.fallbacks}
        self._stations = stations
        self._writes = writes
        writes.message_ended = self.message_ended
        self._writing = writing
        self._store = store
        self._report = report
        self._tell = tell
        self._messages: dict[str, float] = {}
        self._executor = -math.inf
        self._is_running: dict[int, bool] = {}
        self._reach: dict[int, _Reach] = {}
        self._has_begun = False
        self._is_ending = False
        self._are_all_due = False

    def __bool__(self) -> bool:
        """Tell whether there is anything to write by ourselves."""
        return bool(self.heartbeats or self.fallbacks)

    # What happens

    def executor_ran(self, now: float) -> None:
        """Take note that the executor runs: a hung process must not look alive (rule 3 c)."""
        self._executor = now

    def wind_down(self) -> None:
        """Write 0, then every fallback, and nothing after that (rule 5)."""
        self._is_ending = True

    def resume(self) -> None:
        """Take note that it was not the end: the next opening of the port is a first contact."""
        self._is_ending = self._are_all_due = False

    @property
    def is_over(self) -> bool:
        """Tell whether all stations that answer have confirmed all writes of ``wind_down``."""
        return not self or self._are_all_due and not any(
            self._stations[row.mapping.station].active for row in self._unconfirmed())

    def unconfirmed(self) -> list[str]:
        """Return the tags of the rows that are not confirmed yet at the end."""
        return [row.mapping.tag for row in self._unconfirmed()]

    def _unconfirmed(self) -> list[HeartbeatRow | FallbackRow]:
        beats = [row for row in self.heartbeats if not row.is_at_rest]
        return [*beats, *(row for row in self.fallbacks if row.cause is not None)]

    def begin(self, now: float) -> None:
        """Take note that the port has been opened: a first contact with everybody (rule 2)."""
        for row in self.heartbeats:
            row.begin(now)
        for fallback in self.fallbacks:
            if not self._has_begun:
                fallback.make_due(FallbackCause.START, now)
            elif not fallback.mapping.serves:
                self._make_due_unless_fresh(fallback, now)
        self._has_begun = True

    def contact(self, station: int, now: float) -> None:
        """Take note that a station is active again (rules 2, 8)."""
        for row in self._heartbeats_of(station):
            row.begin(now)
        for fallback in self._fallbacks_of(station):
            self._make_due_unless_fresh(fallback, now)

    def mode_seen(self, station: int, is_running: bool | None, now: float) -> None:
        """Take note of a station's mode; a change to RUN is a first contact (rules 2, 8)."""
        was_running = self._is_running.get(station)
        if is_running is None:
            return
        self._is_running[station] = is_running
        if is_running and was_running is False:
            for row in self._heartbeats_of(station):
                row.begin(now)
            for fallback in self._fallbacks_of(station):
                fallback.make_due(FallbackCause.RUN, now)

    def _make_due_unless_fresh(self, fallback: FallbackRow, now: float) -> None:
        if not fallback.is_fresh(now):
            fallback.make_due(FallbackCause.RETURN, now)

    def message_came(self, write: Write) -> None:
        """Take note of a message that was accepted (rule 3 d)."""
        topic = write.mapping.topic
        self._messages[topic] = max(write.requested, self._messages.get(topic, -math.inf))

    def is_overruled(self, write: Write) -> bool:
        """Tell whether a message was published before a fallback of its row went out (rule 9)."""
        row = self._by_mapping.get(id(write.mapping))
        return row is not None and write.requested <= row.sent

    def message_ended(self, write: Write, outcome: Outcome) -> None:
        """Take note how a message ended that had the line."""
        row = self._by_mapping.get(id(write.mapping))
        if row is not None:
            row.message_ended(write.requested, outcome)
            row.is_held_up = False

    # Who goes next

    def next(self, now: float, busy: Container[int] = ()) -> OwnWrite | None:  # noqa: A003
        """Return what has to be written next, None for nothing; it ends with ``ended``."""
        if not self:
            return None
        self.expire(now)
        at_once = {number for number in self._numbers if number not in busy
                   and now >= self._free_from(number, is_first_try=True)}
        free = [number for number in at_once if now >= self._free_from(number)]
        late = [number for number in free if not self._stations[number].replies_in_time]
        own = self._first_of({*free}.difference(late), at_once, now)
        # Those that reply late take turns: the one goes first that was tried the longest ago.
        for number in sorted(late, key=self._pause_end):
            own = own or self._first_of({number}, at_once, now)
        return own

    def _first_of(self, free: Container[int], at_once: Container[int],
                  now: float) -> OwnWrite | None:
        """
        Return what has to be written next to one of some stations, None for nothing.

        ``at_once`` are those to which the first try of a fallback may go.
        """
        return self._zero(now, free) or self._fallback(now, free, at_once) \
            or self._beat(now, free)

    def _free_from(self, station: int, is_first_try: bool = False) -> float:
        """
        Return from when on a station may be written to (clock value in s), infinite for never.

        Inactive ones are not probed (rule 4), those that reply late only in the time for probes.
        The end (rule 5) and the first try of a fallback do not wait for that: the PLC may well
        carry out what it does not answer.
        """
        if not self._stations[station].active:
            return math.inf
        is_at_once = self._is_ending or is_first_try
        in_turn = -math.inf if is_at_once else self._stations.next_message(station)
        return max(in_turn, self._pause_end(station))

    def _pause_end(self, station: int) -> float:
        """Return until when a PLC that does not answer is left alone (clock value in s)."""
        reach = self._reach.get(station)
        return reach.pause_end if reach else -math.inf

    def _zero(self, now: float, free: Container[int]) -> OwnWrite | None:
        for row in self.heartbeats:
            if row.mapping.station in free:
                self._judge(row, now)
                if row.wants_zero(row.is_held, now):
                    return self._job(row, row.take(now, is_zero=True))
        return None

    def _judge(self, row: HeartbeatRow, now: float) -> None:
        """Find out whether a heartbeat must not count, and why (rule 3)."""
        row.reason = self._why_held(row, now)
        row.is_held = bool(row.reason)
        if not row.is_held and now >= row.executor_until(self._executor):
            row.reason = 'the executor of the node stands still'  # nothing is written then

    def _why_held(self, row: HeartbeatRow, now: float) -> str:
        if self._is_ending:
            return 'the bridge ends'
        for fallback in self._fallbacks_of(row.mapping.station):
            if fallback.cause is not None:
                return f'the fallback of {fallback.mapping.tag} is not confirmed'
        topic = row.missing(self._messages, now)
        return f'no message of {topic} in time' if topic else ''

    def _fallback(self, now: float, free: Container[int],
                  at_once: Container[int]) -> OwnWrite | None:
        youngest = self._writes.youngest()
        for row in self.fallbacks:
            mapping = row.mapping
            if mapping.serves or mapping.station not in (at_once if row.is_first_try else free) \
                    or row.next_due(youngest.get(id(mapping), -math.inf)) > now:
                continue
            write = row.take(now)
            if self._writing.is_held_up(write):  # by a message that is under way (rule 9)
                row.is_under_way, row.is_held_up = False, True
                continue
            self._writes.drop('fallback', now, mapping)
            return self._job(row, write)
        return None

    def _beat(self, now: float, free: Container[int]) -> OwnWrite | None:
        for row in self.heartbeats:
            if row.mapping.station not in free or not row.wants_beat(now) or row.is_held:
                continue
            if row.reason:
                row.put_off(now + _GLANCE)
            else:
                return self._job(row, row.take(now, is_zero=False), self._good_until(row))
        return None

    def _job(self, row: HeartbeatRow | FallbackRow, write: Write,
             expires: float = math.inf) -> OwnWrite:
        return OwnWrite(row, write, self._writing, self, expires)

    def _good_until(self, row: HeartbeatRow) -> float:
        """Return until when a heartbeat may be sent (clock value in s): later it may be wrong."""
        youngest = self._writes.youngest()
        ends = [fallback.deadline(youngest.get(id(fallback.mapping), -math.inf))
                for fallback in self._fallbacks_of(row.mapping.station)]
        return min([row.executor_until(self._executor), row.topics_until(self._messages), *ends])

    def ended(self, own: OwnWrite) -> None:
        """Take note how one of our writes ended."""
        row, result, now = own.row, own.result, self._writing.line.now
        outcome = Outcome.NOT_SENT if result is None else result.outcome
        self._judge_reach(own, outcome, now)
        if isinstance(row, HeartbeatRow):
            row.ended(outcome, now)
        else:
            self._fallback_ended(row, own.write, outcome, now)
        if result is not None and outcome is not Outcome.NOT_SENT:
            refusal = '' if outcome is Outcome.WRITTEN else str(result.error)
            if isinstance(result.error, RemoteError) and refusal != row.refusal:
                self._tell(row.mapping, f'not written: {refusal}')
            row.refusal = refusal

    def _judge_reach(self, own: OwnWrite, outcome: Outcome, now: float) -> None:
        """
        Leave a PLC that does not answer alone for a while, or it would take the whole line.

        When one answers again that is behind a gateway, it is a first contact, as its station was
        active all the time (rules 2, 8).
        """
        is_behind_gateway = own.row.mapping.via is not None
        if outcome is Outcome.UNKNOWN:
            reach = self._reach.setdefault(own.station, _Reach())
            reach.failures += 1
            if reach.is_lost:
                share = _SHARE_OF_OTHERS * (now - own.write.requested) * is_behind_gateway
                reach.pause_end = now + max(_LEAST_PAUSE, share)
        elif outcome is not Outcome.NOT_SENT:
            reach = self._reach.pop(own.station, _Reach())
            if reach.is_lost and is_behind_gateway:
                self.contact(own.station, now)

    def _fallback_ended(self, row: FallbackRow, write: Write, outcome: Outcome,
                        now: float) -> None:
        cause = row.cause
        seconds = row.ended(outcome, now)
        if seconds is not None and cause is not None:
            self._report(WriteResult(
                row.mapping, Outcome.FALLBACK, cause.value, write.value, seconds))

    def expire(self, now: float) -> None:
        """Make overdue fallbacks due; those of Serve rows are stored at once."""
        if not self._has_begun:
            return
        youngest = self._writes.youngest() if self.fallbacks else {}
        for row in self.fallbacks:
            row.judge(now, youngest.get(id(row.mapping), -math.inf))
            if self._is_ending and row.cause is None and not row.stands:
                row.make_due(FallbackCause.END, now)
                row.is_held_up = False
            if row.mapping.serves and row.cause is not None:
                write = row.take(now)
                self._store(write)
                self._fallback_ended(row, write, Outcome.WRITTEN, now)
        self._are_all_due = self._is_ending

    def next_expiry(self) -> float:
        """Return when a fallback of our own table is due (clock value in s)."""
        if not self._served or not self._has_begun:
            return math.inf
        return min(row.next_due(-math.inf) for row in self._served)

    def next_due(self) -> float:
        """Return when there is something to write (clock value in s), infinite for never."""
        return min(self._moments(), default=math.inf)

    def _moments(self) -> Iterator[float]:
        youngest = self._writes.youngest()
        for fallback in self.fallbacks:
            if not fallback.mapping.serves:
                yield max(fallback.next_due(youngest.get(id(fallback.mapping), -math.inf)),
                          self._free_from(fallback.mapping.station, fallback.is_first_try))
        for row in self.heartbeats:
            yield max(row.next_due(self._messages), self._free_from(row.mapping.station))

    def _heartbeats_of(self, station: int) -> Iterable[HeartbeatRow]:
        return (row for row in self.heartbeats if row.mapping.station == station)

    def _fallbacks_of(self, station: int) -> Iterable[FallbackRow]:
        return (row for row in self.fallbacks
                if row.mapping.station == station and not row.mapping.serves)
