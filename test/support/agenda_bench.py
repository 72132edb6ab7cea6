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

"""An agenda on a clock that the test moves, whose jobs are done by hand."""

from __future__ import annotations

from collections.abc import Container
import math

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.agenda import Agenda
from abdf1_ros.driver.checks import Checks
from abdf1_ros.driver.guest_rules import GuestRules
from abdf1_ros.driver.guests import GuestQueue
from abdf1_ros.driver.job_tasks import JobTasks
from abdf1_ros.driver.kernel.flights import Flight, Flights
from abdf1_ros.driver.kernel.gate import Rank, Turn
from abdf1_ros.driver.kernel.kernel import Kernel
from abdf1_ros.driver.reads.job import ReadJob
from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.driver.reads.readings import Readings
from abdf1_ros.driver.served import Served
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome, Write, WriteResult
from abdf1_ros.driver.writes.jobs import WriteJob, WritesUnderWay
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.plan.line_model import LineModel
from abdf1_ros.plan.planner import Planner
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from support.clock import StillClock
from support.driver_bench import Recorder
from support.mappings import make_mapping

PROBE_TIME = 0.5
LINE = LineModel(Checksum.CRC, Duplex.HALF, LineTiming(0.001))


def make_job(text: str = 'N7:0', station: int = 1, period: int = 100) -> ReadJob:
    mapping = make_mapping(text, station=station, period=period)
    block, = Planner(LINE, 0.1).plan([mapping])
    return ReadJob(block, [ReadPoint(mapping, period / 1000, 1.0)], StillClock(),
                   lambda job, words, error: None, math.inf)


def written(write: Write, now: float, outcome: Outcome = Outcome.WRITTEN) -> Flight:
    """Return a write that has ended, by default a confirmed one."""
    flights = Flights(StillClock(now), 1.0, ActiveStationList())
    flight = flights.begin(write.mapping.station, [write.mapping.extent], write)
    flights.ended(flight, outcome)
    return flight


class Bench:
    """An agenda without checks, whose jobs are done by hand."""

    def __init__(self, *jobs: ReadJob, write_timeout: float = 2.0) -> None:
        self.begun: dict[Write, Turn] = {}
        self.stations = ActiveStationList([job.station for job in jobs], probe_time=PROBE_TIME)
        self.tasks = JobTasks(5, 0, line := StillClock())
        listener = Recorder(lambda: 0.0)
        served = Served(PlcType.PLC5, Rows(), lambda mapping, words: None)
        self.kernel = Kernel(Rows(), Rows(), self.stations, line, self.tasks, served,
                             settle_time=1.0, patience=write_timeout, tx_delay=0.25)
        self.results = self.kernel.out
        readings = Readings(Network(), Rows(), DriverSettings(), self.stations, line, listener,
                            self.kernel)
        writing = WritesUnderWay(self.stations, line, self.kernel, readings)
        self.reads, self.waiting = readings.reads, self.kernel.waiting
        checks = Checks(self.stations, {job.station for job in jobs}, 0.0, line,
                        readings.link_failed, lambda station, identity, asked: None)
        checks.begin(0.0)
        rules = GuestRules(Network(), Rows(), lambda station: None)
        guests = GuestQueue(self.stations, line, 1.0, rules, writing)
        self.agenda = Agenda(
            self.stations, self.kernel, writing, checks, self.reads, guests, self.tasks)
        self.reads.replace((), jobs, 0.0)

    def next(self, now: float) -> object:  # noqa: A003
        """Return who has the line next; a write ends at once."""
        job = self.agenda.next(now)
        if not isinstance(job, WriteJob):
            return job
        self.end(job)
        return job.write

    def end(self, turn: Turn | WriteJob) -> None:
        """Let a write end unsent."""
        self.kernel.ended(turn.flight, Outcome.NOT_SENT)

    def begin_write(self, now: float, busy: Container[int] = ()) -> Write | None:
        """Take the next write, which is under way from then on."""
        turn = self.kernel.next(now, Rank.MESSAGE, busy)
        if turn is not None:
            self.begun[turn.write] = turn
        return turn.write if turn is not None else None

    def next_write(self, now: float) -> Write | None:
        """Take the next write, which ends at once."""
        write = self.begin_write(now)
        if write is not None:
            self.end(self.begun[write])
        return write

    def next_read(self, now: float, busy: Container[int] = ()) -> ReadJob | None:
        """Take the next probe or read."""
        job = self.agenda.read(now, busy)
        assert job is None or isinstance(job, ReadJob)
        return job

    def read(self, now: float, took: float = 0.0) -> ReadJob | None:
        """Take the next read and give it back done."""
        job = self.next_read(now)
        if job is not None:
            self.finish(job, now, now + took)
        return job

    def finish(self, job: ReadJob, started: float, now: float) -> None:
        """Give a read back that was made from ``started`` to ``now``."""
        job.started = job.asked = started
        self.reads.ended(job, now)

    def write(self, mapping: Mapping, value: float, now: float) -> Write:
        write = Write(mapping, [value], now)
        self.add(write)
        return write

    def add(self, write: Write) -> None:
        self.waiting.add(write, write.requested)

    def outcomes(self) -> list[Outcome]:
        return [result.outcome for result in self.results if isinstance(result, WriteResult)]
