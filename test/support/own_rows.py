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


"""A fallback or heartbeat by itself, whose writes begin and end as a test says."""

from __future__ import annotations

import math
from random import Random

from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.kernel.fallback import FallbackRow
from abdf1_ros.driver.kernel.flights import Flight, Flights
from abdf1_ros.driver.kernel.heartbeat import HeartbeatRow
from abdf1_ros.driver.kernel.own import Conditions
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.errors import CommandTimeout
from support.clock import StillClock
from support.interlocks import beat_row, speed_row


class OneRow(StillClock):
    """A row with Fallback by itself, and writes of it that end as they are told."""

    def __init__(self, cmd_timeout: float = 0.5) -> None:
        super().__init__()
        self.mapping = speed_row()
        self.flights = Flights(self, 2 * cmd_timeout, ActiveStationList())
        self.row = FallbackRow(self.flights.words_of(self.mapping), Conditions())

    def message(self, begun: float, done: float, outcome: Outcome) -> None:
        """Let a message end that was published when it began."""
        self.now = begun
        flight = self.flights.begin(1, [self.mapping.extent], Write(self.mapping, [3], begun))
        self._end(flight, done, outcome)
        self.row.write_ended(flight, done)

    def begin(self, write: Write) -> Flight:
        """Let a write of the fallback begin."""
        self.now = write.requested
        self.row.trial = self.flights.begin(1, [self.mapping.extent], write)
        return self.row.trial

    def fallback(self, write: Write, done: float, outcome: Outcome = Outcome.WRITTEN
                 ) -> float | None:
        trial = self.row.trial
        self._end(trial if trial is not None and trial.write is write else self.begin(write),
                  done, outcome)
        confirmed = self.row.ended(outcome, done)
        return confirmed and confirmed.seconds

    def guest(self, now: float) -> None:
        self.now = now
        flight = self.flights.begin(1, [self.mapping.extent])
        self.flights.ended(flight, Outcome.WRITTEN)
        self.row.write_ended(flight, now)

    def _end(self, flight: Flight, done: float, outcome: Outcome) -> None:
        self.now = done
        lost = CommandTimeout() if outcome is Outcome.PARTLY else None
        self.flights.ended(flight, outcome, lost)

    def is_due(self, now: float) -> bool:
        """Tell whether the fallback is to be written now."""
        return self.row.look(now, -math.inf) <= now


class OneBeat(StillClock):
    """A heartbeat by itself, and writes of it that end as they are told."""

    def __init__(self, period: int = 200, cmd_timeout: float = 0.5) -> None:
        super().__init__()
        self.mapping = beat_row(period)
        self.flights = Flights(self, 2 * cmd_timeout, ActiveStationList())
        self.conditions = Conditions()
        self.beat = HeartbeatRow(self.flights.words_of(self.mapping), self.conditions, 1,
                                 Random(0))

    def begin(self, now: float) -> Write:
        """Let its next write begin."""
        self.now = now
        write = self.beat.take(now)
        self.beat.trial = self.flights.begin(1, [self.mapping.extent], write)
        return write

    def end(self, done: float, outcome: Outcome = Outcome.WRITTEN) -> None:
        """Let its write end."""
        self.now = done
        assert self.beat.trial is not None
        self.flights.ended(self.beat.trial, outcome)
        self.beat.ended(done)

    def look(self, now: float, why_held: str = '') -> float:
        """Return when it is to be written, while the executor runs."""
        self.conditions.executor = now
        return self.beat.look(now, why_held)

    def is_due(self, now: float, why_held: str = '') -> bool:
        return self.look(now, why_held) <= now
