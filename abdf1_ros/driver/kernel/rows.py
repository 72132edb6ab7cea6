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
All rows of a line that the bridge writes by itself, and what happens to them.

At first contact the heartbeats of a PLC are written as 0. Then its due fallback values are
written, and only after them its heartbeats count. The rules have the numbers of
docs/heartbeats.md.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
from random import Random

from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.kernel.end import OrderlyEnd
from abdf1_ros.driver.kernel.fallback import (
    Confirmed,
    FallbackCause,
    FallbackRow,
    FallbackState,
)
from abdf1_ros.driver.kernel.flights import Flight, Flights
from abdf1_ros.driver.kernel.heartbeat import HeartbeatRow, LARGEST
from abdf1_ros.driver.kernel.own import Conditions
from abdf1_ros.driver.kernel.plc import OwnRow, Plc
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.pccc.extent import OUR_TABLE
from abdf1_ros.plan.planner import Block
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.rows import Rows


class OwnRows:
    """
    All heartbeats and fallbacks of a line, by row and by PLC.

    - ``seed``: a different number in each bridge. Two bridges that began together would not see
      each other if both counted from 1.
    - ``plcs``: the PLCs by station; ``ours``: the rows of our own table.
    - ``conditions``: what all of them depend on.
    - ``end``: the orderly end.
    """

    def __init__(self, mappings: Rows, flights: Flights, stations: ActiveStationList,
                 seed: int = 0) -> None:
        dice = Random(seed)
        self.conditions = conditions = Conditions()
        self.heartbeats = [
            HeartbeatRow(flights.words_of(mapping), conditions, 1 + seed % LARGEST, dice)
            for mapping in mappings.heartbeats]
        self.fallbacks = [FallbackRow(flights.words_of(mapping), conditions)
                          for mapping in mappings.fallbacks]
        rows: list[OwnRow] = [*self.heartbeats, *self.fallbacks]
        stations_of = {row: row.mapping.extent.station for row in rows}
        self.plcs = {number: Plc(
            number, [row for row in rows if stations_of[row] == number], stations, flights,
            conditions)
            for number in dict.fromkeys((OUR_TABLE, *stations_of.values()))}
        self.plc_of = {row: self.plcs[number] for row, number in stations_of.items()}
        self.ours = self.plcs.pop(OUR_TABLE)
        self.row_of: dict[Mapping, OwnRow] = {row.mapping: row for row in rows}
        self._fallback_of = {row.mapping: row for row in self.fallbacks}
        self._single = [row for row in self.fallbacks if row.mapping.single_publisher]
        self._meeting: dict[Mapping, list[OwnRow]] = {}  # cached, as it takes long to find out
        self.end = OrderlyEnd(self.plc_of, self.ours, flights, conditions)

    def begin(self, now: float) -> None:
        """Make all fallbacks due: the bridge has the line for the first time (rule 8)."""
        for row in self.fallbacks:
            row.make_due(FallbackCause.START, now)

    def contact(self, now: float) -> None:
        """Begin a first contact with each station: the port has been opened (rule 2)."""
        for plc in self.plcs.values():
            plc.contact(now, is_new=True)
        self.ours.look_again()

    def earlier_may_land(self, stations: set[int]) -> None:
        """Look again at rows of stations whose gateway may hold an earlier write (rule 10)."""
        for plc in self.plcs.values():
            if plc.station in stations:
                plc.look_again()

    def look_again(self, mapping: Mapping) -> None:
        """Look again at a row with Fallback: a message that delayed it has ended."""
        if row := self._fallback_of.get(mapping):
            self.plc_of[row].look_again(row)

    # Messages

    def message_came(self, write: Write, now: float) -> None:
        """Record an accepted message (rule 3 d)."""
        topic, messages = write.mapping.topic, self.conditions.messages
        for beat in self.heartbeats:
            if topic in beat.topics:
                if beat.missing(write.requested):
                    # the time-out passed before a look: the line was busy all the time
                    beat.hold(now)
                self.plc_of[beat].look_again(beat)
        messages[topic] = max(write.requested, messages.get(topic, -math.inf))

    def is_overruled(self, write: Write) -> bool:
        """Tell whether the end has begun, or a fallback was sent after a message (rules 5, 9)."""
        row = self._fallback_of.get(write.mapping)
        return row is not None and (self.end.has_begun or write.requested <= row.sent)

    def is_put_off(self, write: Write) -> bool:
        """
        Tell whether a message comes while the fallback of its row is due at a silent PLC (4).

        Otherwise the PLC might execute messages and fallbacks in turns, as long as messages come.
        """
        row = self._fallback_of.get(write.mapping)
        return row is not None and row.cause is not None and not self.plc_of[row].is_active

    def why_refused(self, write: Write) -> str:
        """Return why the publishers of a topic forbid a message, empty if they do not (28)."""
        crowd = self.conditions.crowds.get(write.mapping.topic) \
            if write.mapping.single_publisher else None
        return crowd.why if crowd and write.requested <= crowd.until else ''

    def new_crowds(self, now: float) -> Iterator[tuple[Mapping, str]]:
        """Make the fallbacks of new crowds due; yield their rows, each with the reason (28)."""
        for row in self._single:
            crowd = self.conditions.crowds.get(row.mapping.topic)
            if crowd is None or crowd.until == row.refused_until:
                continue
            is_new, row.refused_until = crowd.until > row.refused_until, crowd.until
            if is_new:
                row.make_due(FallbackCause.PUBLISHERS, now)
                self.plc_of[row].look_again(row)
                yield row.mapping, crowd.why

    def may_stand(self, write: Write) -> bool:
        """Tell whether the state of the row's fallback allows a message to be left out."""
        row = self._fallback_of.get(write.mapping)
        return row is None or row.state is FallbackState.MESSAGE and not row.is_under_way

    def stands(self, write: Write) -> None:
        """Record a message whose value the PLC holds already: it refreshes its row (7)."""
        if row := self._fallback_of.get(write.mapping):
            row.message_ended(write.requested, Outcome.WRITTEN)
            self.plc_of[row].look_again(row)

    # Writes and reads

    def write_ended(self, flight: Flight, now: float) -> Confirmed | None:
        """
        Record how any write ended: rows may wait for its end (rules 7, 9).

        Return the fallback that it has confirmed, None for none.
        """
        if flight.station in self.plcs:
            self.plcs[flight.station].write_ended(flight, now)
        write, rows, confirmed = flight.write, self._met(flight), None
        for row in rows:
            if write is None or flight.is_message_of(row.mapping):
                self._written_by_others(row, flight, now)
        if write is not None and write.is_own:
            confirmed = self._own_ended(self.row_of[write.mapping], flight, now)
        for row in rows:
            self.plc_of[row].look_again(row)
        return confirmed

    def _met(self, flight: Flight) -> list[OwnRow]:
        """Return the rows whose words a write may change: some may have waited for its end (9)."""
        if flight.write is None:
            return [row for row in self.plc_of if flight.meets(row.mapping.extent)]
        mapping = flight.write.mapping
        if mapping not in self._meeting:
            self._meeting[mapping] = [
                row for row in self.plc_of if flight.meets(row.mapping.extent)]
        return self._meeting[mapping]

    def _written_by_others(self, row: OwnRow, flight: Flight, now: float) -> None:
        """Record the end of a message to a row, or of a guest's write of its words."""
        row.write_ended(flight, now)
        if not row.is_confirmed:
            self.end.leave_standing(row)
        if isinstance(row, FallbackRow) and not row.stands and self.end.has_begun:
            row.make_due(FallbackCause.END, now)

    def _own_ended(self, row: OwnRow, flight: Flight, now: float) -> Confirmed | None:
        """Record how one of our own writes ended."""
        assert flight.outcome is not None
        confirmed = None
        if isinstance(row, HeartbeatRow):
            row.ended(now)
        else:
            confirmed = row.ended(flight.outcome, now)
        self.end.confirmed(row, flight.outcome)
        return confirmed

    def words_read(self, block: Block, data: bytes, started: float,
                   now: float) -> Iterator[tuple[HeartbeatRow, str]]:
        """Compare the heartbeats of a block that was read from ``started`` on; yield news (19)."""
        for beat in self.heartbeats:
            mapping = beat.mapping
            if mapping in block.mappings:
                value = int(mapping.codec.decode(data[block.slice_of(mapping)])[0])
                if text := beat.read_back(value, started, now):
                    yield beat, text
                self.plc_of[beat].look_again(beat)
