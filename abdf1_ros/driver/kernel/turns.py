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
Which of the bridge's own writes has the line next: heartbeats and fallback values.

The rules have the numbers of docs/heartbeats.md. Their clock also counts while the host sleeps
(rule 6). None of this is a safety function.
"""

from __future__ import annotations

from collections.abc import Container
import math
from operator import attrgetter
from typing import NamedTuple

from abdf1_ros.driver.kernel.fallback import FallbackRow
from abdf1_ros.driver.kernel.flights import Flight
from abdf1_ros.driver.kernel.plc import OwnRow, Plc, TurnRank
from abdf1_ros.driver.kernel.rows import OwnRows
from abdf1_ros.driver.kernel.waiting import WaitingWrites
from abdf1_ros.settings.mapping import Mapping

_first_look, _first_refresh = attrgetter('looks.first'), attrgetter('refreshes.first')


class DueRow(NamedTuple):
    """A row that is to be written now, and the youngest message of each row with Fallback."""

    plc: Plc
    row: OwnRow
    youngest: dict[Mapping, float]


class OwnTurns:
    """The turns of our own ``rows``; messages in ``waiting`` may delay a fallback."""

    def __init__(self, rows: OwnRows, waiting: WaitingWrites) -> None:
        self._rows = rows
        self._waiting = waiting
        self._end, self._conditions = rows.end, rows.conditions

    def first(self, now: float, busy: Container[int], *, only_active: bool) -> DueRow | None:
        """Return the first of all writes that are due; ``only_active``: not for silent PLCs."""
        plcs = self._rows.plcs.values()
        if now < min(map(_first_look, plcs), default=math.inf):
            return None
        best: tuple[TurnRank, Plc, OwnRow] | None = None
        youngest: dict[Mapping, float] | None = None
        for plc in plcs:
            if plc.looks.first > now or plc.station in busy or only_active and not plc.is_active:
                continue
            youngest = self._waiting.youngest() if youngest is None else youngest
            for row in plc.ready(youngest, now):
                rank = plc.rank(row, now)
                if rank is not None and (best is None or rank < best[0]):
                    best = rank, plc, row
        if best is None or youngest is None:
            return None
        return DueRow(best[1], best[2], youngest)

    def once_more(self, busy: Container[int], *, only_active: bool) -> DueRow | None:
        """Return a row that stood when the end began: after all else (rule 5)."""
        rows = [row for row in self._end.to_repeat(only_active) if row.mapping.station not in busy]
        if not rows:
            return None
        row = min(rows, key=lambda row: not self._rows.plc_of[row].is_active)
        return DueRow(self._rows.plc_of[row], row, {})

    def refresh(self, now: float, busy: Container[int]) -> DueRow | None:
        """
        Return the next confirmed fallback that has to be written again; None for none (rule 8).

        It does not go before messages. It waits while a message of its row waits, unless the last
        message of the row was not confirmed.
        """
        due = [plc for plc in self._rows.plcs.values()
               if plc.refreshes.first <= now and plc.station not in busy]
        for plc in sorted(due, key=_first_refresh):
            youngest = self._waiting.youngest()
            if row := plc.to_refresh(youngest, now):
                return DueRow(plc, row, youngest)
        return None

    def beats_gave_way(self) -> None:
        """Record that heartbeats gave way to a read: they go next."""
        self._conditions.is_beats_turn = True

    def is_beats_turn(self, now: float) -> bool:
        """Tell whether a heartbeat of a PLC that answers is due, and has given way already."""
        return self._conditions.is_beats_turn and any(
            beat.counts and plc.looks.times[beat] <= now and plc.answers
            for plc in self._rows.plcs.values() for beat in plc.heartbeats)

    def is_urgent(self, flight: Flight) -> bool:
        """Tell whether a write is a fallback that does not stand: heartbeats wait for it."""
        row = self._fallback(flight)
        return row is not None and not row.stands

    def is_awaited(self, flight: Flight, now: float) -> bool:
        """Tell whether a write is the second of a fallback, or a message waits for it."""
        row = self._fallback(flight)
        return row is not None and (
            row.again_at <= now or row.mapping in self._waiting.youngest())

    def _fallback(self, flight: Flight) -> FallbackRow | None:
        """Return the row whose fallback a write is, None for another write."""
        write = flight.write
        row = self._rows.row_of[write.mapping] if write is not None and write.is_own else None
        return row if isinstance(row, FallbackRow) else None

    def next_due(self) -> float:
        """Return when the next write is due (clock value in s), infinite for never."""
        due, only_active = math.inf, self._end.waits_for_active
        if any(self._end.to_repeat(only_active)):
            return -math.inf
        for plc in self._rows.plcs.values():
            if not only_active or plc.is_active:
                due = plc.next_due(due)
        return due
