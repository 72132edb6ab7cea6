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
from dataclasses import dataclass, field
import math
from operator import attrgetter

from abdf1_ros.df1.probes import OTHERS_SHARE
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.flights import Flight, Flights
from abdf1_ros.driver.interlocks.fallback import Crowd, FallbackCause, FallbackRow
from abdf1_ros.driver.interlocks.heartbeat import HeartbeatRow
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


@dataclass(slots=True)
class Conditions:
    """
    Conditions that all PLCs of a line depend on.

    Times are clock values (s).

    - ``executor``: when the ROS executor ran last.
    - ``messages``: publication time of the last accepted message of each topic.
    - ``crowds``: the last crowd of each topic of rows with Single_Publisher. The thread of the
      callbacks sets it before it hands on a message that came since.
    - ``is_ending``: the bridge ends; ``ended``: when the end began, infinite before it.
    - ``gave_way``: when heartbeats last gave way to a fallback that stands.
    - ``is_beats_turn``: they have just given way to such a fallback, or to a read.
    """

    executor: float = -math.inf
    messages: dict[str, float] = field(default_factory=dict)
    crowds: dict[str, Crowd] = field(default_factory=dict)
    is_ending: bool = False
    ended: float = math.inf
    gave_way: float = -math.inf
    is_beats_turn: bool = False

    @property
    def are_all_due(self) -> bool:
        """Tell whether the end has begun."""
        return self.ended < math.inf


class Plc:
    """
    The heartbeats and fallbacks of one station, and its answers to our own writes.

    Times are clock values (s).

    - ``due``: when to look at its rows next.
    - ``first_due``: the same for first tries of a 0 or a fallback; a pause does not delay these.
    - ``refresh_due``: when to look for fallbacks to be written again (rule 8).
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
        self.due = self.first_due = self.refresh_due = math.inf
        self.failures = 0
        self.pause_end = -math.inf
        self._is_running: bool | None = None
        self._held_up: list[FallbackRow] = []
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

    def plan(self) -> None:
        """Plan the next look at its rows, at the earliest ``due`` of them."""
        self.due = min([row.due for row in self.rows], default=math.inf)
        self.first_due = min([row.first_due for row in self.rows], default=math.inf)

    def plan_refresh(self, row: FallbackRow) -> None:
        """Plan when a fallback is to be written again, if the PLC holds it."""
        if row.stands:
            self.refresh_due = min(self.refresh_due, row.refresh_at)

    def look_again(self, *rows: OwnRow) -> None:
        """Look at these rows at once."""
        for row in rows:
            row.due = self.due = -math.inf
            self.first_due = min(self.first_due, row.first_due)

    # What happens

    def contact(self, now: float, *, is_new: bool = False) -> None:
        """Begin a contact; it ``is_new`` if it is the first with this port (rules 2, 8)."""
        for beat in self.heartbeats:
            beat.begin(now, is_new=is_new)
        for row in self.fallbacks:
            if not row.is_fresh(now):
                row.make_due(FallbackCause.RETURN, now)
            else:  # the message that delays it may have been lost with the port
                row.due = -math.inf
        self.plan()

    def mode_seen(self, is_running: bool, now: float) -> None:
        """Record its mode; a change to RUN is a first contact (rules 2, 8)."""
        was_running, self._is_running = self._is_running, is_running
        if not is_running or was_running is not False:
            return
        for beat in self.heartbeats:
            beat.ran(now)
        for row in self.fallbacks:
            row.make_due(FallbackCause.RUN, now)
        self.plan()

    def release(self) -> None:
        """Release fallbacks that waited for a write of their words (rule 9)."""
        self.look_again(*self._held_up)
        self._held_up.clear()

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
        due = [row for row in self.fallbacks
               if row.due <= now and row.judge(now, youngest.get(row.mapping, -math.inf))]
        held_up = [row for row in due if not self._flights.may_begin(row.mapping)]
        for row in held_up:  # a write of its words is under way (rule 9); its end is reported
            row.due = math.inf
        self._held_up += held_up
        why, conditions = self._why_held() if self.heartbeats else '', self._conditions
        beats = [beat for beat in self.heartbeats if beat.judge(
            now, why or beat.why_missing(conditions.messages, now), conditions.executor,
            conditions.messages)]
        if not self.is_active:  # an inactive station gets only 0 (rule 4)
            for beat in beats:
                if not beat.wants_zero:
                    beat.due = beat.first_due
            beats = [beat for beat in beats if beat.wants_zero]
        found: list[OwnRow] = [*beats, *(row for row in due if row not in held_up)]
        for own in found:
            own.due = max(own.due, self._again(own))
        self.plan()
        return [own for own in found if own.due <= now]

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
        first because a PLC may execute a write that it does not answer. In (1) PLCs that answer go
        first. In (3) the row with the fewest tries goes first, then the row whose last try is
        oldest. Otherwise a 0 that is due each second would take all turns. Silent PLCs get only
        the time of probes. At the end a silent PLC has one try for each row.

        Heartbeats that are due give way to one fallback that stands, after each of them has had a
        turn. All such fallbacks could take longer than the preset of a PLC.
        """
        conditions = self._conditions
        if self._has_last_try:
            return (1, 1, row.tried) if row.tried < conditions.ended else None
        is_zero = isinstance(row, HeartbeatRow) and row.wants_zero
        is_beat = isinstance(row, HeartbeatRow) and not row.wants_zero
        if row.is_first_try and not is_beat:
            return 0, not self.answers, not is_zero
        if self.answers:
            if isinstance(row, FallbackRow) and row.stands:
                had_turn = now if conditions.is_beats_turn else conditions.gave_way
                return 2, max(row.words.again_at, had_turn), row.tried
            return (2, row.tried) if is_beat else (1, 0, not is_zero, row.tried)
        if now < self._free_from:
            return None
        return 3, is_beat, min(row.tries, _QUICK_TRIES), row.tried

    def to_refresh(self, youngest: MappingType[Mapping, float], now: float) -> FallbackRow | None:
        """Return the next fallback to be written again (rule 8); put off those that must wait."""
        standing = [row for row in self.fallbacks if row.stands]
        for row in sorted(standing, key=_refresh_of):
            if row.refresh_at > now:
                break
            is_put_off = row.mapping in youngest and not row.has_failed
            if not is_put_off and self._flights.may_begin(row.mapping) \
                    and self._stations[self.station].replies_in_time:
                return row
            row.refresh_at = now + min(row.after, LEAST_REFRESH)
        self.refresh_due = min(map(_refresh_of, standing), default=math.inf)
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
        least = min(least, self.refresh_due)
        if self.due >= least:
            return least
        if self._has_last_try:
            return min([least, *(row.due for row in self.rows
                                 if row.tried < self._conditions.ended)])
        return min(least, self.first_due, max(self.due, self._free_from))

    def good_until(self, beat: HeartbeatRow, youngest: MappingType[Mapping, float]) -> float:
        """Return until when a heartbeat may be sent (clock value, s): its conditions end then."""
        ends = [row.deadline(youngest.get(row.mapping, -math.inf)) for row in self.fallbacks]
        return min([beat.executor_until(self._conditions.executor),
                    beat.topics_until(self._conditions.messages), *ends])
