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
An orderly end: all heartbeats 0, then all fallbacks, and no message any more (rule 5).

The rules have the numbers of docs/heartbeats.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from collections.abc import Mapping as MappingType
import math

from abdf1_ros.driver.kernel.flights import Flights
from abdf1_ros.driver.kernel.own import Conditions
from abdf1_ros.driver.kernel.plc import OwnRow, Plc
from abdf1_ros.driver.write import Outcome
from abdf1_ros.settings.mapping import Mapping


class OrderlyEnd:
    """
    The end of a bridge for good, and of a driver before ~/reload or ~/polling.

    ``plc_of`` has the PLC of each row, ``ours`` the rows of our own table. Only ``wind_down`` and
    ``resume`` may be called from another thread.
    """

    def __init__(self, plc_of: MappingType[OwnRow, Plc], ours: Plc, flights: Flights,
                 conditions: Conditions) -> None:
        self._plc_of, self._ours = plc_of, ours
        self._of_plcs = [row for row, plc in plc_of.items() if plc is not ours]
        self._flights = flights
        self._conditions = conditions
        # stations that answered when the end began
        self._awaited: frozenset[int] = frozenset()
        # rows that stood, or were under way, when the end began: until they are written once more
        self._standing: tuple[OwnRow, ...] = ()

    @property
    def is_asked(self) -> bool:
        """Tell whether the bridge is to end."""
        return self._conditions.is_ending

    @property
    def is_final(self) -> bool:
        """Tell whether the bridge ends for good: nothing can cancel it."""
        return self._conditions.is_final

    @property
    def has_begun(self) -> bool:
        """Tell whether all rows are due."""
        return self._conditions.are_all_due

    def wind_down(self, *, is_final: bool = False) -> None:
        """
        Write heartbeats 0, then fallbacks, and take no more messages (rule 5).

        It counts at once, in any thread. ``resume`` does not cancel an end that ``is_final``, and
        ``take_over`` hands it on.

        Then the caller has to wake the link, and to wait as long as it ``has_to_wait``.
        ``unconfirmed`` returns the rows that are not confirmed then, ``not_repeated`` those that
        were confirmed before.
        """
        if is_final:
            self._conditions.is_final = True
        else:
            self._conditions.is_paused = True

    def resume(self) -> None:
        """Continue after ``wind_down``: the next opening of the port is a first contact."""
        self._conditions.is_paused, self._conditions.ended = False, math.inf
        self._standing = ()

    def take_over(self, before: OrderlyEnd) -> None:
        """Go on with the final end of the driver before: it may have begun during ~/reload."""
        self._conditions.is_final |= before.is_final

    @property
    def is_over(self) -> bool:
        """
        Tell whether all writes of the end are done.

        Stations that were active when the end began have confirmed all their rows. At silent
        stations each row has had its try, and so has each row that stood.
        """
        return not self._plc_of or self.has_begun and not self._is_repeating \
            and not any(row.mapping.station in self._awaited or row.is_under_way
                        or row.tried < self._conditions.ended
                        for row in self._plc_of if not row.is_confirmed)

    @property
    def _is_repeating(self) -> bool:
        """Tell whether a row that stood when the end began has still to be written once more."""
        return any(row.is_under_way or row.tried < self._conditions.ended
                   for row in self._standing)

    def has_to_wait(self, *, is_open: bool,
                    is_meant: Callable[[Mapping], bool] = lambda mapping: True) -> bool:
        """
        Tell whether writes of the end are left that a caller has to wait for (rule 5).

        While the port is lost, these are rows of PLCs that ``is_meant``. Nothing is to wait for if
        no write has gone out since the start.
        """
        if self.is_over:
            return False
        return is_open or self._flights.has_sent and any(
            is_meant(row.mapping) for row in self._unconfirmed_rows())

    @property
    def keeps_line(self) -> bool:
        """
        Tell whether nothing may be read: it is the end, and a PLC that answers has not confirmed.

        A read of a PLC that fails could take all the time that is left, also before a second write
        that is not due yet (rules 5, 10).
        """
        return self.has_begun and (self._is_repeating or any(
            plc.is_active and not row.is_confirmed for row, plc in self._plc_of.items()))

    def _unconfirmed_rows(self) -> Iterator[OwnRow]:
        """Return the rows of PLCs where a command may stand, also while the port is lost."""
        may_begin = self._flights.may_begin
        return (row for row in self._of_plcs
                if not row.is_confirmed or not may_begin(row.mapping))

    def unconfirmed(self, now: float) -> list[str]:
        """Return the tags of rows that are not confirmed at the end, or may be overwritten."""
        tags = [row.mapping.tag for row in self._unconfirmed_rows()]
        held = {row.mapping.tag: row.words.lands_until - now for row in self._of_plcs
                if row.mapping.tag not in tags and row.words.lands_until > -math.inf}
        return [*tags, *(
            f'{tag} (a gateway may hold a write to it for {seconds:.1f} s)' if seconds > 0
            else f'{tag} (a gateway may have delivered a write to it since)'
            for tag, seconds in held.items())]

    def not_repeated(self) -> list[str]:
        """Return the tags of rows that stood when the end began, and were not confirmed again."""
        rows = self._standing if self.has_begun else [
            row for row in self._of_plcs if row.is_confirmed]
        return [row.mapping.tag for row in rows]

    def begin(self, now: float) -> None:
        """Make all rows due that do not surely stand; those that stand are written once more."""
        are_due = {row: row.end(now) for row in self._plc_of}
        self._standing = tuple(row for row in self._of_plcs if not are_due[row])
        self._awaited = frozenset(plc.station for plc in self._plc_of.values() if plc.is_active)
        self._conditions.ended = now
        for plc in {*self._plc_of.values(), self._ours}:
            plc.look_again()

    def begin_anew(self) -> None:
        """Begin again when the port has been opened, if the end has begun: it was lost."""
        self._conditions.ended, self._standing = math.inf, ()

    def to_repeat(self, only_active: bool) -> Iterator[OwnRow]:
        """Return the rows that stood when the end began, and were not sent since."""
        return (row for row in self._standing if row.tried < self._conditions.ended
                and (self._plc_of[row].is_active or not only_active))

    @property
    def waits_for_active(self) -> bool:
        """
        Tell whether silent PLCs have to wait for the reply of a PLC that answers: it is the end.

        They have no later chance, but PLCs that answer go first.
        """
        return self.has_begun and any(
            row.is_under_way and plc.is_active for row, plc in self._plc_of.items())

    def confirmed(self, row: OwnRow, outcome: Outcome) -> None:
        """Record how our last write of a row ended: one that was under way is written again."""
        if outcome is not Outcome.WRITTEN:
            return
        if row.tried < self._conditions.ended < math.inf:
            self._standing += (row,)
        else:
            self.leave_standing(row)

    def leave_standing(self, row: OwnRow) -> None:
        """Record that a row is not to be written once more: it was, or it is due by now."""
        if row in self._standing:  # another thread reads them
            self._standing = tuple(other for other in self._standing if other is not row)
