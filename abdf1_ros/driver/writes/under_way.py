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
"""What all writes have in common, whoever asked for them: packets, retries of bits, their end."""

from __future__ import annotations

from collections.abc import Callable

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.job_tasks import Job, LineTime
from abdf1_ros.driver.reads.read_backs import ReadBacks
from abdf1_ros.driver.reads.readings import Readings
from abdf1_ros.driver.write import Write, WriteResult
from abdf1_ros.driver.writes.packets import carry_out
from abdf1_ros.errors import CommandExpired, RemoteError
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.plan.planner import Planner
from abdf1_ros.settings.mapping import Mapping


class WriteJob(Job):
    """A write that has the line; ``result`` is None until it has ended, or where a bug ends it."""

    def __init__(self, write: Write, writing: WritesUnderWay) -> None:
        self.write = write
        self.station = write.mapping.station
        self.result: WriteResult | None = None
        self.begun = write.requested
        self.goes_on = False  # also after a packet that is not confirmed
        self._writing = writing

    def steps(self, now: float) -> Steps[None]:
        """Send every packet."""
        self.begun = now
        self.result = yield from self._writing.carry_out(self.write, now, self.goes_on)


class WritesUnderWay:
    """
    Carries out writes, and takes their ends: in records of stations, read backs and reads.

    ``under_way`` are the writes that have the line: two of the same words never have it together.
    """

    def __init__(self, planner: Planner, stations: ActiveStationList, line: LineTime,
                 readings: Readings, read_backs: ReadBacks) -> None:
        self.under_way: list[Write] = []
        self.line = line
        self._planner = planner
        self._stations = stations
        self._readings = readings
        self._read_backs = read_backs

    def is_held_up(self, mapping: Mapping) -> bool:
        """Tell whether a write has to wait for one of the same words that is under way."""
        return any(mapping.extent.meets(write.mapping.extent) for write in self.under_way)

    def begin(self, write: Write) -> None:
        """Take note that a write is under way, until it has ``ended``."""
        self.under_way.append(write)
        station = write.mapping.station
        write.is_probe = station != BROADCAST and not self._stations[station].replies_in_time

    def carry_out(self, write: Write, now: float, goes_on: bool) -> Steps[WriteResult]:
        """Send every packet of a write, in the packets that its station takes."""
        self._read_backs.overtaken(write, now)
        write.speak(self._planner.dialect(write.mapping))
        return (yield from carry_out(write, lambda: self.line.now, goes_on=goes_on))

    def ended(self, job: WriteJob) -> None:
        """Take note of the end of a write, and read its words at once where they have changed."""
        write, result, station = job.write, job.result, job.station
        self.under_way.remove(write)
        if station != BROADCAST:
            self._stations.tried(station, job.begun, self.line.now, was_silent=write.is_probe,
                                 is_message=True)
        if result is None:
            return
        if isinstance(result.error, RemoteError):
            self._stations[station].remote_errors += 1
        elif result.error is not None and not isinstance(result.error, CommandExpired):
            self._readings.link_failed(station, (), result.error)
        if (result.packets_done or result.is_unconfirmed) and not write.mapping.heartbeat:
            self._readings.reads.refresh(write, self.line.now)

    def report(self, job: WriteJob, report: Callable[[WriteResult], None]) -> None:
        """Report the result of a message, after a read where it is unconfirmed."""
        if job.result is not None and job.result.is_unconfirmed:
            self._read_backs.add(job.write, job.result, self._readings.blocks, self.line.now)
        elif job.result is not None:
            report(job.result)
