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
Values that a PLC holds: a message that asks for the same value need not be written.

Rule 27 of docs/heartbeats.md says when. A reply proves that the write was executed then; only a
read proves that the PLC still holds its value.
"""

from __future__ import annotations

from collections.abc import Container, Iterable
from dataclasses import dataclass
import math

from abdf1_ros.driver.record import Claim, WriteListener
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.plan.planner import Block
from abdf1_ros.settings.mapping import Mapping


@dataclass(slots=True)
class _Value:
    """
    A value that a confirmed ``write`` has put into a row.

    Times are clock values (s).

    - ``since``: when the first write of the value was confirmed; only equal writes came after it.
    - ``confirmed``: when the last of these was confirmed.
    - ``shown``: when the last read that has shown the value began.
    """

    write: Write
    since: float
    confirmed: float
    shown: float = -math.inf


class Standing(WriteListener):
    """The values of ``rows`` with Write_Again; a message waits ``patience`` s at most."""

    def __init__(self, rows: Iterable[Mapping], patience: float) -> None:
        self._patience = {row: row.fallback.after / 1000 if row.fallback else patience
                          for row in rows}
        self._values: dict[Mapping, _Value] = {}
        self._settled: dict[Mapping, float] = {}  # no other write can land after it (clock, s)
        self._sharing: dict[Mapping, list[Mapping]] = {}  # cached, as it takes long to find out

    def earlier_may_land(self, stations: Container[int], until: float) -> None:
        """Record no value of these stations before all writes of earlier times have landed."""
        for row in self._patience:
            if row.station in stations:
                self._unsettle(row, until)

    def write_begins(self, claim: Claim) -> None:
        """Forget the values that a write may change."""
        for row in self._disturbed(claim):
            self._values.pop(row, None)

    def write_ended(self, claim: Claim) -> None:
        """Take the value of a confirmed message; forget all values that the write may change."""
        for row in self._disturbed(claim):
            self._unsettle(row, claim.lands_until)
        write, now = claim.write, claim.done
        if write is None or write.is_own or write.mapping not in self._patience:
            return
        row = write.mapping
        if claim.outcome is not Outcome.WRITTEN:
            self._unsettle(row, claim.lands_until)
        elif row in self._values:
            self._values[row].confirmed = now
        elif claim.begun >= self._settled.get(row, -math.inf):
            self._values[row] = _Value(write, now, now)

    def may_land(self, claim: Claim) -> None:
        """Record no value of the words before a write of the driver before has landed."""
        for row in self._patience:
            if claim.meets(row.extent):
                self._unsettle(row, claim.lands_until)

    def _unsettle(self, row: Mapping, until: float) -> None:
        """Forget the value of a row; record none before ``until``, when a write has landed."""
        self._values.pop(row, None)
        self._settled[row] = max(until, self._settled.get(row, -math.inf))

    def _disturbed(self, claim: Claim) -> list[Mapping]:
        """Return the rows whose known value a write may replace by another value."""
        if (write := claim.write) is None or claim.may_restore:
            return [row for row in self._patience if claim.meets(row.extent)]
        sharing = self._sharing.get(write.mapping)
        if sharing is None:
            sharing = self._sharing[write.mapping] = [
                row for row in self._patience if row.shares_words(write.mapping)]
        return [row for row in sharing if not self._is_same(row, write)]

    def _is_same(self, row: Mapping, write: Write) -> bool:
        value = self._values.get(row)
        return not write.is_own and row is write.mapping and (
            value is None or write.equals(value.write))

    def words_read(self, block: Block, data: bytes, started: float) -> None:
        """Take the words of a good read: record that they show a value, or forget the value."""
        for row, value in [*self._values.items()]:
            if started >= value.since and block.extent.holds(row.extent):
                if value.write.is_held(data[block.slice_of(row)]):
                    value.shown = started
                else:
                    del self._values[row]

    def forget(self, station: int | None = None) -> None:
        """Forget the values of a station that may be another PLC now; without a number, of all."""
        for row in [row for row in self._values if station in (None, row.station)]:
            del self._values[row]

    def proof(self, write: Write, now: float) -> str:
        """Return the proof that the PLC holds the value of a message, empty for no proof."""
        row = write.mapping
        value = self._values.get(row)
        if value is None or row.write_again is None or not value.write.equals(write):
            return ''
        again = row.write_again / 1000
        if now >= value.confirmed + again or now >= value.shown + min(again, self._patience[row]):
            return ''
        return f'confirmed {now - value.confirmed:.2f} s ago, read {now - value.shown:.2f} s ago'
