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
One PLC: its heartbeats and fallbacks, and which of them goes first.

The rules have the numbers of docs/heartbeats.md.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping as MappingType
import math
from operator import attrgetter

from abdf1_ros.df1.probes import OTHERS_SHARE
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.kernel.fallback import FallbackCause, FallbackRow, FallbackState
from abdf1_ros.driver.kernel.flights import Flight, Flights
from abdf1_ros.driver.kernel.heartbeat import HeartbeatRow
from abdf1_ros.driver.kernel.own import Conditions
from abdf1_ros.driver.write import key_of, Outcome
from abdf1_ros.settings.heartbeats import LEAST_REFRESH
from abdf1_ros.settings.mapping import Mapping

# After this many unanswered writes in a row we treat the PLC as out of reach. Its station may
# still be active, because a gateway answers polls for it.
_FAILURES = 2

# Shortest pause (s) before the next attempt. Behind a gateway the pause is also at least
# OTHERS_SHARE times as long as the last attempt. So a silent PLC takes an eighth of the time.
_LEAST_PAUSE = 1.0

# At silent PLCs the row with fewer tries goes first. Tries after this number are not counted: the
# first tries may have been unlucky.
_QUICK_TRIES = 3

_ANSWERED = (Outcome.WRITTEN, Outcome.PARTLY, Outcome.FAILED)

_refresh_of = attrgetter('refresh_at')

OwnRow = HeartbeatRow | FallbackRow
TurnRank = tuple[float, ...]


class Looks:
    """
    When each row may want to be written, a clock value (s): to ask all rows takes long.

    It is a cache: an event touches the rows that it may concern, and they are asked anew. After a
    change of ``times``, ``plan`` finds the ``first`` of all.
    """

    def __init__(self, rows: Iterable[OwnRow]) -> None:
        self.times: dict[OwnRow, float] = dict.fromkeys(rows, math.inf)
        self.first = math.inf

    def touch(self, *rows: OwnRow) -> None:
        """Ask these rows anew."""
        for row in rows:
            self.times[row] = self.first = -math.inf

    def plan(self) -> None:
        """Find the first of all."""
        self.first = min(self.times.values(), default=math.inf)


class Plc:
    """
    The heartbeats and fallbacks of one station, and its answers to our own writes.

    Times are clock values (s).

    - ``looks``: when to ask its rows; ``refreshes``: the same for fallbacks to be written again
      (rule 8).
    - ``failures``: number of our own writes without an answer since the last answered write. That
      may also be the write of a message or a guest.
    - ``pause_end``: after the second and each later failure, only first tries are sent until then.
    """

    def __init__(self, station: int, rows: Iterable[OwnRow], stations: ActiveStationList,
                 flights: Flights, conditions: Conditions) -> None:
        self.station = station
        self.rows = [*rows]
        self.heartbeats = [row for row in self.rows if isinstance(row, HeartbeatRow)]
        self.fallbacks = [row for row in self.rows if isinstance(row, FallbackRow)]
        self.looks, self.refreshes = Looks(self.rows), Looks(self.fallbacks)
        self.failures = 0
        self.pause_end = -math.inf
        self._is_running: bool | None = None
        self._stations = stations
        self._flights = flights
        self._conditions = conditions

    @property
    def is_lost(self) -> bool:
        """Tell whether the PLC is out of reach."""
        return self.failures >= _FAILURES

    @property
    def is_active(self) -> bool:
        """Tell whether its station is active."""
        return self._stations[self.station].active

    @property
    def answers(self) -> bool:
        """Tell whether it has answered the last of our own writes, and answers in time."""
        return not self.failures and self._stations[self.station].replies_in_time

    def look_again(self, *rows: OwnRow) -> None:
        """Ask these rows anew, or all; each of them may change what its heartbeats may do."""
        self.looks.touch(*(rows or self.rows), *self.heartbeats)
        for row in rows or self.rows:
            if isinstance(row, FallbackRow):
                self.refreshes.times[row] = self._refresh_at(row)
        self.refreshes.plan()

    def begins(self, row: OwnRow) -> None:
        """Ask a row no more: a write of it begins, and its end is an event."""
        self.looks.times[row] = math.inf
        self.looks.plan()
        if isinstance(row, FallbackRow):
            self.refreshes.times[row] = math.inf
            self.refreshes.plan()

    @staticmethod
    def _refresh_at(row: FallbackRow) -> float:
        return row.refresh_at if row.stands and not row.is_under_way else math.inf

    # What happens

    def contact(self, now: float, *, is_new: bool = False) -> None:
        """Begin a contact; it ``is_new`` if it is the first with this port (rules 2, 8)."""
        for beat in self.heartbeats:
            beat.begin(now, is_new=is_new)
        for row in self.fallbacks:
            if not row.is_fresh(now):
                row.make_due(FallbackCause.RETURN, now)
        self.look_again()

    def mode_seen(self, is_running: bool, now: float) -> None:
        """Record its mode; a change to RUN is a first contact (rules 2, 8)."""
        was_running, self._is_running = self._is_running, is_running
        if not is_running or was_running is not False:
            return
        for beat in self.heartbeats:
            beat.ran(now)
        for row in self.fallbacks:
            row.make_due(FallbackCause.RUN, now)
        self.look_again()

    def write_ended(self, flight: Flight, now: float) -> None:
        """
        Record how a write to this PLC ended, also of a guest, and whether the PLC has answered.

        After own writes that the PLC does not answer there is a pause, because they would take the
        whole line otherwise. A PLC behind a gateway that answers again has a first contact,
        because its station was active all the time (rules 2, 8).
        """
        is_behind_gateway = self._stations[self.station].has_gateway
        if flight.outcome in _ANSWERED:
            was_lost, self.failures, self.pause_end = self.is_lost, 0, -math.inf
            if was_lost and is_behind_gateway:
                self.contact(now)
        elif flight.outcome is Outcome.UNKNOWN and (write := flight.write) and write.is_own:
            if self._stations.odd.is_odd(key_of(write.mapping, is_own=True)):
                return  # only this row waits then
            self.failures += 1
            if self.is_lost:
                took = self._flights.line.took(flight.begun, now)
                share = OTHERS_SHARE * took if is_behind_gateway else 0.0
                self.pause_end = now + max(_LEAST_PAUSE, share)

    # Which goes first

    def ready(self, youngest: MappingType[Mapping, float], now: float) -> list[OwnRow]:
        """Return the rows with a due write; ``youngest`` has the youngest message of each row."""
        times = self.looks.times
        for row in self.fallbacks:
            if times[row] <= now:
                times[row] = self._look(row, row.look(
                    now, youngest.get(row.mapping, -math.inf)), now)
        why = self._why_held() if self.heartbeats else ''
        for beat in self.heartbeats:
            times[beat] = self._look(beat, beat.look(now, why or beat.why_missing(now)), now)
        self.looks.plan()
        return [row for row in self.rows if times[row] <= now]

    def _look(self, row: OwnRow, when: float, now: float) -> float:
        """Return when a row that wants to be written may be: not while its words are written."""
        if when > now:
            return when
        if isinstance(row, HeartbeatRow):
            if row.counts and not self.is_active:  # an inactive station gets only 0 (rule 4)
                return self._first_due(row)
        elif not self._flights.may_begin(row.mapping):  # the end of that write is an event (9)
            return math.inf
        return max(when, self._again(row))

    def _first_due(self, row: OwnRow) -> float:
        """Return when a row may want a first try of a 0 or fallback (clock value in s)."""
        if isinstance(row, FallbackRow):
            may_be = row.is_first_try or row.state is FallbackState.MESSAGE
            return self.looks.times[row] if may_be else math.inf
        if row.counts:
            return row.topics_until if row.value and not row.is_under_way else math.inf
        return self.looks.times[row] if row.is_first_try else math.inf

    def _again(self, row: OwnRow) -> float:
        """
        Return from when on a row that is odd may be tried again (clock value, s; rule 29).

        Answers to other writes do not end this pause, as they end the pause of the PLC. A count of
        a heartbeat keeps to the share of odd rows.
        """
        odd = self._stations.odd
        if not odd.failed or row.is_first_try or self._conditions.is_ending:
            return -math.inf
        is_count = isinstance(row, HeartbeatRow) and not row.wants_zero
        is_shared = is_count or self._stations[self.station].has_gateway
        return odd.next_own(key_of(row.mapping, is_own=True), OTHERS_SHARE if is_shared else 0)

    def _why_held(self) -> str:
        """Return why no heartbeat may count, empty if they may (rules 3 b, 5)."""
        if self._conditions.is_ending:
            return 'the bridge ends'
        return next(filter(None, (row.why_held for row in self.fallbacks)), '')

    def rank(self, row: OwnRow, now: float) -> TurnRank | None:
        """
        Return the rank of a row, the least goes first; None if it has to wait (rules 10, 11).

        The order is (1) first tries; (2) PLCs that answer; (3) PLCs that do not. First tries go
        first because a PLC may execute a write that it does not answer. In (1) PLCs that have
        answered the last command go first: an end may have no time for others. In (3) the row with
        the fewest tries goes first, then the row whose last try is oldest. Otherwise a 0 that is
        due each second would take all turns. Silent PLCs get only the time of probes. At the end a
        silent PLC has one try for each row.

        Heartbeats that are due give way to one fallback that stands, after each of them has had a
        turn. All such fallbacks could take longer than the preset of a PLC.
        """
        conditions = self._conditions
        if self._has_last_try:
            return (1, 1, row.tried) if row.tried < conditions.ended else None
        is_zero = isinstance(row, HeartbeatRow) and row.wants_zero
        is_beat = isinstance(row, HeartbeatRow) and not row.wants_zero
        if row.is_first_try and not is_beat:
            is_doubtful = self._stations[self.station].unanswered > 0
            return 0, not self.answers or is_doubtful, not is_zero
        if self.answers:
            if isinstance(row, FallbackRow) and row.stands:
                had_turn = now if conditions.is_beats_turn else conditions.gave_way
                return 2, max(row.again_at, had_turn), row.tried
            return (2, row.tried) if is_beat else (1, 0, not is_zero, row.tried)
        if now < self._free_from:
            return None
        return 3, is_beat, min(row.tries, _QUICK_TRIES), row.tried

    def to_refresh(self, youngest: MappingType[Mapping, float], now: float) -> FallbackRow | None:
        """Return the next fallback to be written again (rule 8); put off those that must wait."""
        times = self.refreshes.times
        due = [row for row in self.fallbacks if times[row] <= now]
        for row in due:
            times[row] = self._refresh_at(row)
        for row in sorted((row for row in due if times[row] <= now), key=_refresh_of):
            is_put_off = row.mapping in youngest and not row.has_failed
            if not is_put_off and self._flights.may_begin(row.mapping) \
                    and self._stations[self.station].replies_in_time:
                return row
            times[row] = now + min(row.after, LEAST_REFRESH)
        self.refreshes.plan()
        return None

    @property
    def _has_last_try(self) -> bool:
        """Tell whether the bridge ends and the PLC is silent."""
        return self._conditions.are_all_due and not self.is_active

    @property
    def _free_from(self) -> float:
        """Return when writes that are not first tries may be sent (clock value in s)."""
        if self._conditions.is_ending:  # after the end there is no later moment
            return -math.inf
        # Probes of an inactive station have their own pause.
        pause_end = self.pause_end if self.is_active else -math.inf
        return max(pause_end, self._stations.next_own(self.station))

    def next_due(self, least: float) -> float:
        """Return when the next write may be sent, if before ``least`` (clock values, s)."""
        least, due = min(least, self.refreshes.first), self.looks.first
        if due >= least:
            return least
        times = self.looks.times
        if self._has_last_try:
            return min([least, *(times[row] for row in self.rows
                                 if row.tried < self._conditions.ended)])
        if (free_from := self._free_from) <= due:
            return due
        return min(least, max(due, free_from), *map(self._first_due, self.rows))

    def good_until(self, beat: HeartbeatRow, youngest: MappingType[Mapping, float]) -> float:
        """Return until when a heartbeat may be sent (clock value, s): its conditions end then."""
        ends = [row.deadline(youngest.get(row.mapping, -math.inf)) for row in self.fallbacks]
        return min([beat.executor_until, beat.topics_until, *ends])
