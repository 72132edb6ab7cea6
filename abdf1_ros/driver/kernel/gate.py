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

"""The gate to the line: each write to a PLC begins here, when its turn has come."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass
from enum import auto, Enum
import math

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.kernel.fallback import FallbackRow
from abdf1_ros.driver.kernel.flights import Flight, Flights
from abdf1_ros.driver.kernel.rows import OwnRows
from abdf1_ros.driver.kernel.turns import DueRow, OwnTurns
from abdf1_ros.driver.kernel.waiting import WaitingWrites
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.settings.heartbeats import LAST_ANSWER


class Rank(Enum):
    """
    Which writes are asked for; the agenda has the order between them.

    - ``OWN``: heartbeats and fallbacks that are due; ``ACTIVE``: the same, but only of PLCs that
      answer.
    - ``MESSAGE``: messages.
    - ``REFRESH``: fallbacks that stand, to be written again (rule 8).
    """

    OWN = auto()
    ACTIVE = auto()
    MESSAGE = auto()
    REFRESH = auto()


@dataclass(frozen=True, slots=True)
class Turn:
    """
    A write that has the line from now on.

    - ``expires``, ``patience``, ``latest``, ``answer_within``: see ``job_tasks.Job``.
    - ``is_free``: its time at a silent station does not count as time of probes.
    """

    flight: Flight
    expires: float = math.inf
    patience: float = 0.0
    latest: float = math.inf
    answer_within: float = math.inf
    is_free: bool = False

    @property
    def write(self) -> Write:
        """Return what is written."""
        assert self.flight.write is not None
        return self.flight.write


class Gate:
    """Begin the write of a message or of an own row; the other rooms of the kernel choose it."""

    def __init__(self, stations: ActiveStationList, flights: Flights, waiting: WaitingWrites,
                 rows: OwnRows, turns: OwnTurns) -> None:
        self._stations = stations
        self._flights, self._waiting = flights, waiting
        self._rows, self._turns = rows, turns

    def next(self, now: float, rank: Rank, busy: Container[int]) -> Turn | None:  # noqa: A003
        """Return the next write of a rank, which begins now; not for a ``busy`` station."""
        if rank is Rank.MESSAGE:
            return self._next_message(now, busy)
        if rank is Rank.REFRESH:
            due = self._turns.refresh(now, busy)
            return due and self._begin_again(due, now)
        end, only_active = self._rows.end, rank is Rank.ACTIVE
        if end.has_begun:
            only_active |= end.waits_for_active
            self._stations.probes.keep_none_waiting(now)
        if due := self._turns.first(now, busy, only_active=only_active):
            return self._begin(due, now)
        if not end.has_begun:
            return None
        due = self._turns.once_more(busy, only_active=only_active)
        return due and self._begin_at_end(due, now)

    def _begin(self, due: DueRow, now: float) -> Turn:
        """Begin the write of a 0, a number or a fallback that is due."""
        plc, row, expires, conditions = due.plc, due.row, math.inf, self._rows.conditions
        is_again = False
        if isinstance(row, FallbackRow):
            self._waiting.drop('fallback', now, row.mapping)
            self._rows.look_again(row.mapping)
            if is_again := row.stands:
                conditions.gave_way = now
        elif not row.wants_zero:
            expires = plc.good_until(row, due.youngest)
        conditions.is_beats_turn = is_again
        is_free = row.is_first_try
        row.trial = self._flight(row.take(now))
        plc.begins(row)
        return Turn(row.trial, expires, answer_within=self._answer_within(due), is_free=is_free)

    def _begin_again(self, due: DueRow, now: float) -> Turn:
        """Begin the write of a fallback that stands (rule 8)."""
        due.row.trial = self._flight(due.row.refresh(now))
        due.plc.begins(due.row)
        return Turn(due.row.trial)

    def _begin_at_end(self, due: DueRow, now: float) -> Turn:
        """Begin the write of a row that stood when the end began (rule 5)."""
        due.row.repeat = self._flight(due.row.refresh(now))
        return Turn(due.row.repeat, answer_within=self._answer_within(due))

    def _answer_within(self, due: DueRow) -> float:
        """Return for how long (s) at most to wait for an answer: not for long at the end."""
        is_last = self._rows.end.has_begun and not due.plc.is_active
        return LAST_ANSWER if is_last else math.inf

    def _next_message(self, now: float, busy: Container[int]) -> Turn | None:
        while (write := self._waiting.first(busy)) is not None:
            if proof := self._proof(write, now):
                self._rows.stands(write)
                self._waiting.end(write, Outcome.STANDS, f'{proof}; not written again', now)
            elif self._waiting.gives_way(write, now):
                self._waiting.end(write, Outcome.SUPERSEDED, '', now)
            else:
                self._waiting.begins(write, now)
                first, all_of_it = self._waiting.good_within(write.mapping)
                return Turn(self._flight(write), write.requested + first, first,
                            write.requested + all_of_it)
        return None

    def _proof(self, write: Write, now: float) -> str:
        """Return the proof that a message need not be written, empty for no proof (rule 27)."""
        if not write.mapping.write_again or not self._rows.may_stand(write):
            return ''
        return self._flights.proof(write, now)

    def _flight(self, write: Write) -> Flight:
        """Begin a write to a PLC."""
        station = write.mapping.station
        write.is_probe = station != BROADCAST and not self._stations[station].replies_in_time
        return self._flights.begin(station, (write.mapping.extent,), write)
