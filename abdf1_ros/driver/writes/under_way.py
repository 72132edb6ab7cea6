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

"""The writes that have the line, of messages and our own: their begin, sending and end."""

from __future__ import annotations

import math

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.df1.probes import Asker
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.flights import Flight, Flights
from abdf1_ros.driver.job_tasks import Job
from abdf1_ros.driver.reads.readings import Readings
from abdf1_ros.driver.write import key_of, Outcome, Write, WriteResult
from abdf1_ros.driver.writes.packets import carry_out
from abdf1_ros.errors import CommandExpired, INTERNAL_ERROR, PortLost, RemoteError
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.settings.mapping import Mapping


class WriteJob(Job):
    """
    A write that has the line; ``result`` is final when the write has ended.

    With ``is_free`` its time at a silent station does not count as time of probes. ``Job``
    describes the other arguments.
    """

    result: WriteResult

    def __init__(self, write: Write, writing: WritesUnderWay, expires: float, *,
                 patience: float = 0.0, latest: float = math.inf, is_free: bool = False,
                 answer_within: float = math.inf) -> None:
        self.write = write
        self.station = write.mapping.station
        self.is_own = write.is_own
        self.key = key_of(write.mapping, is_own=write.is_own)
        self.asker = Asker.OWN if write.is_own else Asker.MESSAGE
        self.expires, self.patience, self.latest = expires, patience, latest
        self.is_free = is_free
        self.answer_within = answer_within
        self._writing = writing
        self.flight = writing.begin(write)

    def steps(self, now: float) -> Steps[None]:
        """Send every packet."""
        # This result stays only if a bug breaks the write off; the bug also ends the use of the
        # port.
        bug = PortLost(INTERNAL_ERROR)
        self.result = self.write.result(Outcome.UNKNOWN, str(bug), bug)
        self.result = yield from self._writing.carry_out(self.write)

    def ended(self, error: Exception | None) -> None:
        """Report and record the result."""
        self._writing.ended(self)


def is_message_of(row: Mapping, job: Job) -> bool:
    """Tell whether a job writes a message of a row."""
    return isinstance(job, WriteJob) and job.write.mapping is row and not job.is_own


class WritesUnderWay:
    """Carry out writes, and report their ends to ``flights``, to stations and to reads."""

    def __init__(self, stations: ActiveStationList, flights: Flights, readings: Readings) -> None:
        self.flights = flights
        self.line = flights.line
        self.stations = stations
        self._readings = readings
        self.spent: dict[Mapping, float] = {}  # line time (s) of each row's messages

    def begin(self, write: Write) -> Flight:
        """Record that a write is under way, until it has ``ended``."""
        station = write.mapping.station
        write.is_probe = station != BROADCAST and not self.stations[station].replies_in_time
        return self.flights.begin(station, (write.mapping.extent,), write)

    def carry_out(self, write: Write) -> Steps[WriteResult]:
        """Send a write in the packets that its station accepts."""
        write.speak(self._readings.planner.dialect(write.mapping))
        return (yield from carry_out(write))

    def ended(self, job: WriteJob) -> None:
        """Record the end of the write, with its result for each message."""
        write, result, station = job.write, job.result, job.station
        if not write.is_own:
            self.flights.tell(job.flight, result, self._readings.blocks)
        if station != BROADCAST and not (job.is_free and write.is_probe):
            self.stations.tried(station, job.flight.begun, self.line.now,
                                was_silent=write.is_probe, asker=job.asker)
        if isinstance(result.error, RemoteError):
            self.stations[station].remote_errors += 1
        elif result.error is not None and not isinstance(result.error, CommandExpired):
            self._readings.link_failed(station, result.error)
        if not write.is_own:
            took = self.line.took(job.flight.begun, self.line.now)
            self.spent[write.mapping] = self.spent.get(write.mapping, 0.0) + took
        self.flights.ended(job.flight, result.outcome, result.error)
