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

"""The writes that have the line, of messages and our own: how they are sent, and their end."""

from __future__ import annotations

from collections.abc import Sequence

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.df1.probes import Asker
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import LineTime
from abdf1_ros.driver.job_tasks import Job
from abdf1_ros.driver.kernel.flights import Flight
from abdf1_ros.driver.kernel.gate import Turn
from abdf1_ros.driver.kernel.kernel import Kernel
from abdf1_ros.driver.reads.readings import Readings
from abdf1_ros.driver.write import key_of, Outcome, Write, WriteResult
from abdf1_ros.driver.writes.packets import carry_out
from abdf1_ros.errors import (
    CommandExpired,
    INTERNAL_ERROR,
    LinkError,
    PortLost,
    RemoteError,
)
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.extent import Extent
from abdf1_ros.settings.mapping import Mapping


class WriteJob(Job):
    """A write that has the line; ``result`` is final when the write has ended."""

    result: WriteResult

    def __init__(self, turn: Turn, writing: WritesUnderWay) -> None:
        self.flight, self.write = turn.flight, turn.write
        self.station = self.write.mapping.station
        self.is_own = self.write.is_own
        self.key = key_of(self.write.mapping, is_own=self.is_own)
        self.asker = Asker.OWN if self.is_own else Asker.MESSAGE
        self.expires, self.patience, self.latest = turn.expires, turn.patience, turn.latest
        self.is_free = turn.is_free
        self.answer_within = turn.answer_within
        self._writing = writing

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
    """Carry out writes, and report their ends to the ``kernel``, to stations and to reads."""

    def __init__(self, stations: ActiveStationList, line: LineTime, kernel: Kernel,
                 readings: Readings) -> None:
        self._stations, self._line = stations, line
        self._kernel = kernel
        self._readings = readings
        self.spent: dict[Mapping, float] = {}  # line time (s) of each row's messages

    @property
    def is_rewriting(self) -> bool:
        """Tell whether a write under way has read a word to write it back changed."""
        return self._kernel.flights.is_rewriting

    def carry_out(self, write: Write) -> Steps[WriteResult]:
        """Send a write in the packets that its station accepts."""
        write.speak(self._readings.planner.dialect(write.mapping))
        return (yield from carry_out(write))

    def ended(self, job: WriteJob) -> None:
        """Record the end of the write, with its result for each message."""
        write, result, station = job.write, job.result, job.station
        now, begun = self._line.now, job.flight.begun
        if not write.is_own:
            is_read = result.is_unconfirmed and any(
                block.extent.holds(write.mapping.extent) for block in self._readings.blocks)
            self._kernel.told(job.flight, result, is_read=is_read)
        if station != BROADCAST and not (job.is_free and write.is_probe):
            self._stations.tried(station, begun, now, was_silent=write.is_probe, asker=job.asker)
        if isinstance(result.error, RemoteError):
            self._stations[station].remote_errors += 1
        elif result.error is not None and not isinstance(result.error, CommandExpired):
            self._readings.link_failed(station, result.error)
        if not write.is_own:
            took = self._line.took(begun, now)
            self.spent[write.mapping] = self.spent.get(write.mapping, 0.0) + took
        self.landed(job.flight, result.outcome, result.error)

    def begin_guest(self, station: int, extents: Sequence[Extent] | None) -> Flight:
        """Record that a command of a guest has the line; it writes ``extents``, None: unknown."""
        return self._kernel.guest(station, extents)

    def landed(self, flight: Flight, outcome: Outcome,
               error: LinkError | RemoteError | None) -> None:
        """Record how any write has ended: its words are to be read at once."""
        self._kernel.ended(flight, outcome, error)
        self._readings.reads.write_ended(flight)
