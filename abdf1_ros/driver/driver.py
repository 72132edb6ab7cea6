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
The driver of one line: carries out jobs one after the other and hands on what comes of them.

It is sans-IO like the link layer below it: ``Driver.machine`` takes bytes and a clock value,
and a ``Listener`` gets values, results and events. ``abdf1_ros.port.LinkThread`` gives it a
port and a clock; the tests give it a virtual line.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Container, Generator, Iterable, Sequence
import math
from typing import Protocol

from abdf1_ros.counters import Counters
from abdf1_ros.df1.machine import Machine, Procedure
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.df1.stations import ActiveStationList, Station
from abdf1_ros.df1.tasks import Task
from abdf1_ros.driver.links import DriverSettings, make_link
from abdf1_ros.driver.mapping import Mapping
from abdf1_ros.driver.network import Network
from abdf1_ros.driver.planner import Block, Planner
from abdf1_ros.driver.points import Outcome, ReadPoint, show, Write, WriteResult
from abdf1_ros.driver.scheduler import ReadJob, Scheduler
from abdf1_ros.driver.served import Served
from abdf1_ros.driver.values import Values
from abdf1_ros.errors import FormatError, LinkError, PortLost, RemoteError
from abdf1_ros.messages import Event
from abdf1_ros.pccc.dialects import DIALECTS
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.status import check_status, is_address_fault, is_local

# What a station takes to answer, for the estimate of the scan time (M 14-2 counts two answers
# for each transaction; PLCs serve the port once per program scan).
_USUAL_RESPONSE = 0.01


Request = tuple[int, bytes]
"""CMD, and what stands behind TNS."""

Steps = Generator[Request, Packet, None]


class Listener(Protocol):
    """Who wants to know; called in the link thread, ``written`` also in that of ``write``."""

    def read(self, mapping: Mapping, values: Values) -> None:
        """Take the values of a good read that are to be published."""

    def unreadable(self, mapping: Mapping, reason: str) -> None:
        """Take note that a station answers, but not with a value; once for each reason."""

    def written(self, result: WriteResult) -> None:
        """Take the one result of a write."""

    def happened(self, event: Event) -> None:
        """Take a numbered error or notice."""

    def station_changed(self, station: Station) -> None:
        """Take note that a station has become active or inactive."""


class Driver:
    """Read and write the mapped addresses over one line, and serve those that are ours."""

    def __init__(self, network: Network, mappings: Sequence[Mapping], settings: DriverSettings,
                 listener: Listener) -> None:
        self.network = network
        self.mappings = tuple(mappings)
        self.counters = Counters()
        self.stations = ActiveStationList(
            (mapping.station for mapping in mappings
             if not mapping.serves and mapping.station != BROADCAST), self._station_changed)
        self.machine = Machine(
            lambda machine: self._run(), checksum=network.checksum, duplex=network.duplex,
            timing=network.timing, counters=self.counters,
            forget_on_send=network.mode == 'Master')
        self.is_online = False
        self.transactions = 0
        self._to_serve: deque[Write] = deque()
        self._tasks: set[_JobTask] = set()
        self._under_way: deque[_JobTask] = deque()
        self._settings = settings
        self._listener = listener
        self._served = Served(PlcType(network.plc_type), mappings, self._serve_written)
        self.link = make_link(network, settings, self.machine, self.stations,
                              self._served.serve, listener.happened)
        self._tns = settings.first_tns
        self._last_tns: dict[int, int] = {}
        self._planner = Planner(
            network.checksum, network.duplex, network.timing.char_time,
            settings.default_period)
        blocks = self._planner.plan(mappings)
        self.expected_scan_time = sum(
            block.line_time + 2 * _USUAL_RESPONSE * len(block.requests) for block in blocks)
        self.points = {mapping: self._point(mapping) for mapping in mappings if mapping.reads}
        self._scheduler = Scheduler(
            self.stations, probe_time=network.timeout / 1000,
            write_timeout=settings.write_timeout, report=listener.written)
        self._scheduler.add_reads(map(self._job, blocks), 0.0)

    @property
    def scan_time(self) -> float | None:
        """Return how long (s) the slowest mapping has waited between its last two reads."""
        return self._scheduler.scan_time

    @property
    def longest_scan_time(self) -> float | None:
        """Return the longest ``scan_time`` (s) there has been, outages not counted."""
        return self._scheduler.longest_scan_time

    @property
    def blocks(self) -> list[Block]:
        """Return what is read together."""
        return [job.block for job in self._scheduler.jobs]

    def write(self, mapping: Mapping, values: Sequence[float] | str, now: float) -> None:
        """
        Ask for a write; may be called from any thread, followed by ``LinkThread.wake``.

        Exactly one WriteResult follows, at once when the request is refused.
        """
        try:
            if self._settings.read_only:
                raise FormatError('this node is read_only')
            if not self.is_online:
                raise FormatError('the port is not open')
            if self._scheduler.is_full:
                raise FormatError('too many writes are waiting')
            write = Write(mapping, values, now)
            if mapping.serves:
                self._to_serve.append(write)
            else:
                self._scheduler.add_write(write)
        except FormatError as error:
            self.refuse(mapping, str(error), values)

    def refuse(self, mapping: Mapping, reason: str, values: Sequence[float] | str) -> None:
        """Report that a request to write was not taken."""
        self._listener.written(
            WriteResult(mapping, Outcome.REFUSED, reason, show(values), 0.0))

    def _point(self, mapping: Mapping) -> ReadPoint:
        if mapping.serves:
            # Without a Period nobody expects the other end to write.
            expected = mapping.period / 1000 if mapping.period else math.inf
            point = ReadPoint(mapping, expected, self._settings.stale_after * expected)
            point.last_good = None if mapping.period else 0.0
            return point
        period = self._settings.default_period if mapping.period is None \
            else mapping.period / 1000
        stale_time = self._settings.stale_after * max(period, self.expected_scan_time)
        return ReadPoint(mapping, period, stale_time)

    def _job(self, block: Block) -> ReadJob:
        return ReadJob(block, [self.points[mapping] for mapping in block.mappings])

    def next_task(self, now: float, busy: Container[int] = ()) -> Task | None:
        """Return the next command: of a write, of a job that is under way, or of a new one."""
        self.expire(now)
        under_way = next((task for task in self._under_way if task.station not in busy), None)
        write = self._scheduler.next_write(now, under_way is not None, busy)
        if write is not None:
            return self._start(write.mapping.station, self._write_steps(write))
        if under_way is not None:
            self._under_way.remove(under_way)
            return under_way
        job = self._scheduler.next_read(now, busy)
        return None if job is None else self._start(job.station, self._read_steps(job, now))

    def next_due(self) -> float | None:
        """Return when the next read is due (clock value in s), None for never."""
        return self._scheduler.next_due()

    def expire(self, now: float) -> None:
        """Do what needs no line: store what we serve, end what has waited too long for it."""
        while self._to_serve:
            self._store(self._to_serve.popleft())
        self._scheduler.expire(now)

    def _station_changed(self, station: Station) -> None:
        if station.active:
            self._scheduler.release(station.number, self.machine.now)
        self._listener.station_changed(station)

    def _store(self, write: Write) -> None:
        """Put values where the other end reads them."""
        self._served.store(write.mapping, write.values)
        self._listener.written(write.result(Outcome.WRITTEN, '', self.machine.now))

    def _serve_written(self, mapping: Mapping, words: bytes) -> None:
        """Hand on what the other end has written to words of ours."""
        self._update(self.points[mapping], words)

    def _run(self) -> Procedure:
        """Work as long as there is a port."""
        self._scheduler.drop_writes('requested while the port was not open', self.machine.now)
        self.is_online = True
        reason = 'internal error, see the log'
        try:
            yield from self.link.run(self)
        except PortLost as error:
            reason = error.args[0]
            raise
        finally:
            self._went_down(PortLost(reason))

    def _went_down(self, error: PortLost) -> None:
        """Leave nothing without a result, and no old command to be sent later."""
        self.is_online = False
        for task in list(self._tasks):
            task.fail(error)
        self._under_way.clear()
        for mapping, point in self.points.items():
            if mapping.polls:
                point.fail(str(error))
        self._scheduler.drop_writes(str(error), self.machine.now)
        while self._to_serve:
            write = self._to_serve.popleft()
            self._listener.written(
                write.result(Outcome.NOT_SENT, str(error), self.machine.now))

    def _start(self, station: int, steps: Steps) -> Task:
        task = _JobTask(self, station, steps)
        self._tasks.add(task)
        return task

    def new_command(self, station: int, request: Request) -> Packet:
        """Return the command for a request, with a transaction number of its own."""
        cmd, data = request
        return Packet(station, self.network.station, cmd, 0, self._next_tns(station), data)

    def advanced(self, task: _JobTask, is_done: bool) -> None:
        """Take note that a task has its next command ready, or is done."""
        if is_done:
            self._tasks.discard(task)
        else:
            self._under_way.append(task)

    def _read_steps(self, job: ReadJob, started: float) -> Steps:
        data = b''
        dialect = job.block.dialect
        try:
            for request in job.block.requests:
                command = dialect.cmd, dialect.read(request.start, request.words)
                reply = check_status((yield command))
                data += dialect.read_data(request.start, request.words, reply)
        except RemoteError as error:
            self.stations[job.station].remote_errors += 1
            self._read_failed(job, str(error), is_address_fault(error))
        except FormatError as error:
            self._read_failed(job, f'unusable reply: {error}', divisible=False)
        except LinkError as error:
            self._link_failed(job.station, job.points, error)
        else:
            job.done(self.machine.now)
            self._distribute(job, data)
        finally:
            self._scheduler.finished(job, started, self.machine.now)

    def _distribute(self, job: ReadJob, data: bytes) -> None:
        for point in job.points:
            self._update(point, job.block.words_of(point.mapping, data))

    def _update(self, point: ReadPoint, words: bytes) -> None:
        try:
            values = point.update(words, self.machine.now)
        except FormatError as error:
            self._unreadable(point, str(error))
        else:
            if values is not None:
                self._listener.read(point.mapping, values)

    def _unreadable(self, point: ReadPoint, reason: str) -> None:
        if point.fail(reason):
            self._listener.unreadable(point.mapping, reason)

    def _read_failed(self, job: ReadJob, reason: str, divisible: bool) -> None:
        """Fail the points; a block with a bad address is divided until that one is alone."""
        job.interrupted()
        is_divided = divisible and len(job.points) > 1
        for point in job.points:
            if is_divided:
                point.fail(f'{reason} (or another address read with it has this fault)')
            else:
                self._unreadable(point, reason)
        if is_divided:
            parts = map(self._job, self._planner.split(job.block))
            self._scheduler.replace(job, parts, self.machine.now)

    def _link_failed(self, station: int, points: Iterable[ReadPoint], error: LinkError) -> None:
        """Fail what the end of a transaction without a reply concerns."""
        if station == BROADCAST:
            return
        self.stations[station].failures += 1
        if not self.stations[station].active:
            points = (point for point in self.points.values()
                      if point.mapping.station == station)
        for point in points:
            point.fail(str(error))

    def _write_steps(self, write: Write) -> Steps:
        station = write.mapping.station
        cmd = DIALECTS[write.mapping.plc_type].cmd
        done = 0
        try:
            for data in write.commands:
                check_status((yield cmd, data))
                done += 1
        except RemoteError as error:
            self.stations[station].remote_errors += 1
            outcome = Outcome.UNKNOWN if is_local(error) else Outcome.FAILED
            self._finish_write(write, outcome, str(error), done)
        except LinkError as error:
            outcome = Outcome.UNKNOWN if error.sent else Outcome.NOT_SENT
            self._finish_write(write, outcome, str(error), done)
            self._link_failed(station, (), error)
            if station != BROADCAST and not self.stations[station].active:
                self._scheduler.unanswered(self.machine.now)
        else:
            is_broadcast = station == BROADCAST
            outcome = Outcome.BROADCAST if is_broadcast else Outcome.WRITTEN
            self._finish_write(write, outcome, '', done)
        if done:
            self._scheduler.hasten(write, self.machine.now)

    def _finish_write(self, write: Write, outcome: Outcome, detail: str, done: int) -> None:
        if 0 < done < len(write.commands):
            outcome = Outcome.PARTLY
            detail += f' (after {done} of {len(write.commands)} packets were written)'
        self._listener.written(write.result(outcome, detail, self.machine.now))

    def _next_tns(self, station: int) -> int:
        """Return the next transaction number, never the one this station had last."""
        self._tns = self._tns + 1 & 0xFFFF
        if self._tns == self._last_tns.get(station):
            self._tns = self._tns + 1 & 0xFFFF
        self._last_tns[station] = self._tns
        return self._tns


class _JobTask:
    """
    A job as the link sees it: one command after the other.

    ``steps`` yields requests and is sent the replies; an error is raised in it.
    """

    def __init__(self, driver: Driver, station: int, steps: Steps) -> None:
        self.sent = False
        self._driver = driver
        self.station = station
        self._steps = steps
        self.command = driver.new_command(station, next(steps))

    def reply(self, packet: Packet) -> None:
        """Take the reply and go on to the next request."""
        self._driver.transactions += 1
        self._advance(lambda: self._steps.send(packet))

    def fail(self, error: LinkError) -> None:
        """Raise ``error`` in the job."""
        error.sent = self.sent
        self._advance(lambda: self._steps.throw(error))

    def _advance(self, resume: Callable[[], Request]) -> None:
        try:
            request = resume()
        except StopIteration:
            self._driver.advanced(self, is_done=True)
            return
        except Exception:  # a bug has ended the job
            self._driver.advanced(self, is_done=True)
            raise
        self.sent = False
        self.command = self._driver.new_command(self.station, request)
        self._driver.advanced(self, is_done=False)
