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
The driver of one line: carries out reads, writes and checks, and reports their results.

It does no input or output itself, like the link layer below it: ``Driver.machine`` takes bytes
and a clock value, and a ``Listener`` gets values, results and events.
``abdf1_ros.ports.link_thread.LinkThread`` gives it a port and a clock; the tests give it a
virtual line.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence
import math
from typing import Protocol

from abdf1_ros.counters import Counters
from abdf1_ros.df1.machine import Procedure
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.df1.stations import ActiveStationList, Station
from abdf1_ros.df1.tasks import Task
from abdf1_ros.driver.agenda import Agenda
from abdf1_ros.driver.checks import Check, CheckKind, Checks
from abdf1_ros.driver.guards import Guards
from abdf1_ros.driver.inbox import Inbox
from abdf1_ros.driver.interlocks import Interlocks, OwnWrite, Urgency
from abdf1_ros.driver.job_tasks import JobTask, JobTasks, Steps
from abdf1_ros.driver.links import DriverSettings, make_link, make_machine
from abdf1_ros.driver.points import Guard, Outcome, ReadPoint, show, Write, WriteResult
from abdf1_ros.driver.read_backs import ReadBacks
from abdf1_ros.driver.read_queue import ReadJob
from abdf1_ros.driver.served import Served
from abdf1_ros.driver.transactions import carry_out
from abdf1_ros.driver.writes import MAX_WAITING_WRITES, patience_of, waited_too_long
from abdf1_ros.errors import CommandExpired, FormatError, LinkError, PortLost, RemoteError
from abdf1_ros.messages import Event
from abdf1_ros.pccc.families import served_counters
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.status import is_address_fault
from abdf1_ros.pccc.values import Values
from abdf1_ros.plan.forecast import (
    block_time,
    line_model,
    longest_probe,
    longest_transaction,
    period_of,
    poll_cycle,
    stale_times,
)
from abdf1_ros.plan.interlocks import MODE_PERIOD, own_load
from abdf1_ros.plan.planner import Block, Planner
from abdf1_ros.plan.refusals import Change, Refusals
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network

# Other commands go between the packets of one read. On a busy line the read may take so many times
# its own time.
_TURNS_OF_A_READ = 10

_NOT_OPEN = 'the port is not open'


class Listener(Protocol):
    """Gets what happens; called in the link thread, ``written`` also in that of ``write``."""

    def read(self, mapping: Mapping, values: Values) -> None:
        """Take the values of a good read that are to be published."""

    def unreadable(self, mapping: Mapping, reason: str) -> None:
        """Take note that a station answers without a usable value; once for each reason."""

    def published_again(self, mapping: Mapping, seconds: float) -> None:
        """Take note that rows are no longer withheld, of which ``mapping`` was the last one."""

    def written(self, result: WriteResult) -> None:
        """Take the one result of a write."""

    def happened(self, event: Event) -> None:
        """Take a numbered error or notice."""

    def station_changed(self, station: Station) -> None:
        """Take note that a station has become active or inactive."""


def _routes(network: Network, mappings: Iterable[Mapping]) -> dict[int, int]:
    """Return the gateway of each station that is behind one; only a master addresses them."""
    return {mapping.station: mapping.via for mapping in mappings
            if mapping.via is not None and network.mode == 'Master'}


class Driver:
    """Read and write the mapped addresses over one line, and serve those that are ours."""

    def __init__(self, network: Network, mappings: Sequence[Mapping], settings: DriverSettings,
                 listener: Listener) -> None:
        self.network = network
        self.mappings = tuple(mappings)
        self.counters = Counters()
        self.stations = ActiveStationList(
            (mapping.station for mapping in mappings
             if not mapping.serves and mapping.station != BROADCAST), self._station_changed,
            _routes(network, mappings), longest_probe(network))
        self.machine = make_machine(network, self._run, self.counters)
        self.is_online = False
        self._inbox: Inbox[Write] = Inbox(is_open=False)
        self._is_ending = False
        self._tasks = JobTasks(
            network.station, settings.first_tns, network.timing.char_time)
        self._settings = settings
        self._listener = listener
        self._served = self._make_served()
        self.machine.background = self
        self.link = make_link(network, settings, self.machine, self.stations,
                              self._serve, listener.happened)
        self._planner = Planner(line_model(network), settings.default_period)
        self._refusals = Refusals(self._planner)
        blocks = self._planner.plan(mappings)
        self.expected_poll_cycle = poll_cycle(blocks)
        self.points = self._make_points(blocks)
        self._guards = Guards(self.points.values())
        self.health = Checks(
            self.stations, {block.station for block in blocks}, settings.processor_period,
            lambda station, error: self._link_failed(station, (), error),
            self._clock, self._status_periods())
        self._agenda = Agenda(
            self.stations, self.health, self._tasks, patience=settings.write_timeout,
            report=listener.written)
        self._reads, self._writes = self._agenda.reads, self._agenda.writes
        self.interlocks = Interlocks(
            () if settings.read_only else mappings, self.stations, self._writes,
            network.cmd_timeout / 1000,
            lambda write: self._served.store(write.mapping, write.raw), listener.written)
        self._agenda.interlocks = self.interlocks if self.interlocks else None
        self._reads.replace((), map(self._job, blocks), 0.0)
        self._read_backs = ReadBacks(settings.write_timeout, listener.written)

    @property
    def transactions(self) -> int:
        """Return how many commands have had a reply."""
        return self._tasks.transactions

    @property
    def poll_cycle(self) -> float | None:
        """Return how long (s) the slowest mapping has waited between its last two reads."""
        return self._reads.poll_cycle

    @property
    def longest_poll_cycle(self) -> float | None:
        """Return the longest ``poll_cycle`` (s) there has been, outages not counted."""
        return self._reads.longest_poll_cycle

    @property
    def blocks(self) -> list[Block]:
        """Return what is read together."""
        return [job.block for job in self._reads.jobs]

    def write(self, mappings: Sequence[Mapping], values: Sequence[float] | str,
              now: float, request: str = '') -> None:
        """
        Ask for values to be written to all ``mappings``, or to none if one of them refuses.

        May be called from any thread, followed by ``LinkThread.wake``. Exactly one WriteResult
        follows for each mapping, at once when the request is refused; ``request`` comes with it.
        """
        reason = self._why_nothing_is_written(len(mappings))
        if reason:
            self.refuse(mappings, reason, values, request)
            return
        writes, reasons = [], {}
        for mapping in mappings:
            try:
                writes.append(Write(mapping, values, now, request))
            except FormatError as error:
                reasons[mapping] = str(error)
        if reasons:
            tags = ', '.join(mapping.tag for mapping in reasons)
            for mapping in mappings:
                self.refuse([mapping], reasons.get(mapping, f'{tags} cannot take it'), values,
                            request)
            return
        for write in writes:
            if not self._inbox.put(write):
                self.refuse([write.mapping], _NOT_OPEN, values, request)

    def _why_nothing_is_written(self, count: int) -> str:
        """Return why no write of ``count`` mappings is taken now, empty where it is."""
        if self._settings.read_only:
            return 'this node is read_only'
        if not self.is_online:
            return _NOT_OPEN
        if self._is_ending:
            return 'this node ends'
        waiting = len(self._inbox) + len(self._writes)
        return 'too many writes are waiting' if waiting + count > MAX_WAITING_WRITES else ''

    def wind_down(self) -> None:
        """
        Write heartbeats 0, then fallbacks, and take no more messages (rule 5).

        May be called from any thread, then wake the link. ``interlocks.is_over`` tells when all
        have been confirmed, ``interlocks.unconfirmed`` which have not.
        """
        self._is_ending = True
        self.interlocks.wind_down()

    def resume(self) -> None:
        """Go on after ``wind_down``, once the port is to be opened again; in any thread."""
        self.interlocks.resume()
        self._is_ending = False

    def request_counters(self, station: int) -> None:
        """
        Ask for the link counters of a station; may be called from any thread, then wake the link.

        ``health`` keeps the answer; without a port nothing is asked.
        """
        self.health.request_counters(station)

    def refuse(self, mappings: Iterable[Mapping], reason: str,
               values: Sequence[float] | str, request: str = '') -> None:
        """Report that values were not taken for any of ``mappings``."""
        for mapping in mappings:
            self._listener.written(
                WriteResult(mapping, Outcome.REFUSED, reason, show(values), 0.0, request))

    def _make_points(self, blocks: Sequence[Block]) -> dict[Mapping, ReadPoint]:
        """Return the points of all mappings that read, in their order."""
        default = self._settings.default_period
        stale = stale_times(blocks, default, self._settings.stale_after,
                            own_load(self.network, self.mappings, default))
        return {mapping: self._served_point(mapping) if mapping.serves
                else ReadPoint(mapping, period_of(mapping, default), stale[mapping])
                for mapping in self.mappings if mapping.reads}

    def _served_point(self, mapping: Mapping) -> ReadPoint:
        # Without a Period the other end may write at any time, or never.
        expected = mapping.period / 1000 if mapping.period else math.inf
        point = ReadPoint(mapping, expected, self._settings.stale_after * expected)
        point.last_good = None if mapping.period else 0.0
        return point

    def _make_served(self) -> Served:
        plc_type, mode = PlcType(self.network.plc_type), self.network.mode
        counters = served_counters(self.counters, plc_type, is_full_duplex=mode == 'Peer',
                                   is_master=mode == 'Master')
        return Served(plc_type, self.mappings, self._serve_written, counters, mode == 'Peer')

    def _job(self, block: Block) -> ReadJob:
        longest = longest_transaction(self.network) + _TURNS_OF_A_READ * block_time(block)
        return ReadJob(block, [self.points[mapping] for mapping in block.mappings], longest)

    def next_task(self, now: float, busy: Container[int] = ()) -> Task | None:
        """Return the command that has the line next, not for a ``busy`` station."""
        self._sort_inbox(now)  # the machine has let expire what has waited too long
        job = self._agenda.next(now, busy)
        if job is None:
            return None
        if isinstance(job, ReadJob):
            return self._tasks.start(
                job.station, self._read_steps(job, now), now, reply_size=job.reply_size)
        if isinstance(job, JobTask):
            return self._tasks.take(job, now)
        if isinstance(job, OwnWrite):
            return self._tasks.start(job.station, self._own_steps(job), now, expires=job.expires)
        if isinstance(job, Write):
            expires, patience = self._time_limits(job)
            return self._tasks.start(job.mapping.station, self._write_steps(job), now,
                                     expires=expires, patience=patience)
        return self._tasks.start(job.station, self._check_steps(job), now)

    def _time_limits(self, write: Write) -> tuple[float, float]:
        """Return until when a message may be sent, and the patience between its packets (s)."""
        # TX_Delay does not count as waiting: it comes before a probe, and before the command.
        wanted = 2 * self.network.timing.tx_delay
        patience = patience_of(write.mapping, self._settings.write_timeout) + wanted
        # With a fallback all packets of a long write have to leave before it is due.
        return write.requested + patience, 0.0 if write.mapping.fallback else patience

    def next_due(self) -> float | None:
        """Return when there is something to do next (clock value in s), None for never."""
        return self._agenda.next_due()

    def expire(self, now: float) -> None:
        """Do what needs no line: store values that we serve, end what has waited too long."""
        self._sort_inbox(now)
        self.interlocks.expire(now)
        self._writes.expire(now)
        self._tasks.expire(now)
        self._read_backs.expire(now)

    def next_expiry(self) -> float:
        """Return when ``expire`` has something to do (clock value in s), infinite for never."""
        return min(self._writes.next_expiry, self._tasks.next_expiry,
                   self.interlocks.next_expiry(), self._read_backs.next_expiry)

    def _clock(self) -> float:
        return self.machine.now

    def _station_changed(self, station: Station) -> None:
        if station.active:
            self._reads.release(station.number, self.machine.now)
            self.interlocks.contact(station.number, self.machine.now)
            self.health.came_back(station.number, self.machine.now)
        else:
            self.health.went_away(station.number)
        self._listener.station_changed(station)

    def _sort_inbox(self, now: float) -> None:
        """Store messages of Serve rows in our table; let all others wait for the line."""
        timeout = self._settings.write_timeout
        for write in self._inbox.take():
            if self.interlocks.is_overruled(write):
                self._end_write(write, Outcome.NOT_SENT, 'fallback')
                continue
            self.interlocks.message_came(write)
            if not write.mapping.serves:
                self._writes.add(write, now)
            elif now - write.requested > timeout:
                self._end_write(write, Outcome.NOT_SENT, waited_too_long(timeout))
            else:
                self._served.store(write.mapping, write.raw)
                self.interlocks.message_ended(write, Outcome.WRITTEN)
                self._end_write(write, Outcome.WRITTEN)

    def _end_write(self, write: Write, outcome: Outcome, detail: str = '') -> None:
        self._listener.written(write.result(outcome, detail, self.machine.now))

    def _serve(self, command: Packet) -> Packet:
        """Execute a command of the other end, after all messages that came before it."""
        self._sort_inbox(self.machine.now)
        return self._served.serve(command)

    def _serve_written(self, mapping: Mapping, words: bytes) -> None:
        """Take words of ours that the other end has written."""
        self._update(self.points[mapping], words)

    def _run(self) -> Procedure:
        """Work as long as there is a port."""
        self._reads.begin(self.machine.now)
        self.health.begin(self.machine.now)
        self.interlocks.begin(self.machine.now)
        self._inbox.open()
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
        """Give everything a result; no old command is to be sent later."""
        self.is_online = False
        self._tasks.fail(error)
        self.health.end(str(error))
        for job in self._reads.jobs:
            job.interrupted()
        for mapping, point in self.points.items():
            if mapping.polls:
                point.fail(str(error))
        for write in self._inbox.close():
            self._end_write(write, Outcome.NOT_SENT, str(error))
        self._writes.drop(str(error), self.machine.now)
        self._read_backs.end(self.machine.now)

    def _read_steps(self, job: ReadJob, now: float) -> Steps[None]:
        """Read one packet of a job."""
        try:
            data = yield from job.read_on(now, self.machine.late)
        except RemoteError as error:
            self.stations[job.station].remote_errors += 1
            self._read_failed(job, str(error), is_address_fault(error))
        except FormatError as error:
            self._read_failed(job, f'unusable reply: {error}', is_refusal=False)
        except LinkError as error:
            self._link_failed(job.station, job.points, error)
        else:
            reason = job.why_too_old(self.machine.now, self.machine.late)
            if reason:
                job.begin_anew()
                for point in job.points:
                    point.fail(f'read again: {reason}')
            elif data is not None:
                self._read_done(job, data)
        finally:
            self._reads.ended(job, self.machine.now)

    def _check_steps(self, check: Check) -> Steps[None]:
        begun = self.machine.now
        try:
            yield from self.health.steps(check)
        finally:
            self._agenda.check_ended(check, begun, self.machine.now)
        if check.kind is CheckKind.STATUS:
            self._status_told(check.station, begun)

    def _status_told(self, station: int, asked: float) -> None:
        """Use what a station has answered: its mode, and which packets it takes."""
        known = self.health.known(station)
        identity = known.identity if known.told is not None and known.told >= asked else None
        self._guards.mode_told(station, identity, asked)
        if identity is not None and identity.is_running is not None:
            self.interlocks.mode_seen(
                station, identity.is_running and not identity.faults, self.machine.now)
        if identity is not None:
            self._change(self._refusals.processor_told(station, identity.processor, self.blocks))

    def _status_periods(self) -> dict[int, float]:
        """Return how often (s) stations have to be asked for their mode."""
        periods = self._guards.status_periods()
        for mapping in () if self._settings.read_only else self.mappings:
            if (mapping.heartbeat or mapping.fallback) and not mapping.serves:
                known = periods.get(mapping.station, math.inf)
                periods[mapping.station] = min(known, MODE_PERIOD)
        return periods

    def _read_done(self, job: ReadJob, data: bytes) -> None:
        """Update the points for which this read was made."""
        now = self.machine.now
        self._read_backs.read(job.block, data, job.started, now)
        self._guards.values_read(job.points, job.slices, data, now)
        has_recovered, period = False, job.block.period
        for point, place in zip(job.points, job.slices, strict=True):
            has_recovered |= point.error is not None
            is_rare = point.period > period and not job.is_refresh  # others are for every read
            if is_rare and not point.is_due(now, period):
                continue
            if point.guard is None:
                self._update(point, data[place])
            else:
                self._guarded(point, point.guard, data[place], job.started)
        job.done(now)
        if has_recovered:
            self._change(self._refusals.recovered(job.block, self.blocks))

    def _guarded(self, point: ReadPoint, guard: Guard, words: bytes, started: float) -> None:
        """
        Update a guarded point, or withhold its value.

        Both are told once for all rows that depend on the same (rule 15).
        """
        now, was_withheld = self.machine.now, point in guard.withheld
        reason, is_first = guard.why_not(point, started, now), not guard.withheld
        if not reason:
            self._update(point, words)
            if was_withheld and not guard.withheld:
                self._listener.published_again(point.mapping, now - point.withheld_since)
        elif point.withhold(reason, now) and is_first:
            count = len(guard.points)
            more = f'; so are all {count} rows that depend on it' if count > 1 else ''
            self._listener.unreadable(point.mapping, f'withheld: {reason}{more}')

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

    def _read_failed(self, job: ReadJob, reason: str, is_refusal: bool) -> None:
        """Fail the points; after a refusal read smaller blocks."""
        job.interrupted()
        is_news = is_refusal and job in self._reads.jobs
        change = self._refusals.refused(job.block) if is_news else None
        is_divided = change is not None and list(change.old) == [job.block]
        for point in self._affected(job.station, job.points):
            if is_divided:
                point.fail(f'{reason} (or another address read with it has this fault)')
            else:
                self._unreadable(point, reason)
        self._change(change)

    def _change(self, change: Change | None) -> None:
        """Read the new blocks of a change from now on."""
        if change is not None:
            old = [job for job in self._reads.jobs if job.block in change.old]
            self._reads.replace(old, map(self._job, change.new), self.machine.now)

    def _link_failed(self, station: int, points: Iterable[ReadPoint], error: LinkError) -> None:
        """Fail the points of a transaction without a reply."""
        if station == BROADCAST:
            return
        self.stations[station].failures += 1
        for point in self._affected(station, points):
            point.fail(str(error))

    def _affected(self, station: int, points: Iterable[ReadPoint]) -> Iterable[ReadPoint]:
        """Return the points of a failed transaction, all of the station where it is silent."""
        if self.stations[station].replies_in_time:
            return points
        return [point for point in self.points.values() if point.mapping.station == station]

    def _write_steps(self, write: Write) -> Steps[None]:
        station, begun = write.mapping.station, self.machine.now
        self._read_backs.overtaken(write, begun)
        try:
            result = yield from self._carry_out(write)
        finally:
            self._agenda.write_ended(write, begun, self.machine.now)
        if result.is_unconfirmed:
            self._read_backs.add(write, result, self.blocks, self.machine.now)
        else:
            self._listener.written(result)
        self._write_failed(station, result.error)
        self.interlocks.message_ended(write, result.outcome)
        if result.packets_done or result.is_unconfirmed:
            self._reads.refresh(write, self.machine.now)

    def _own_steps(self, own: OwnWrite) -> Steps[None]:
        """Write a heartbeat or a fallback."""
        write, outcome, begun = own.write, Outcome.NOT_SENT, self.machine.now
        if own.urgency is Urgency.FALLBACK:
            self._read_backs.overtaken(write, begun)
        try:
            result = yield from self._carry_out(write)
            outcome = result.outcome
        finally:
            self._agenda.write_ended(write, begun, self.machine.now)
            self.interlocks.ended(own, outcome, self.machine.now)
        self._write_failed(own.station, result.error)
        refusal = '' if outcome is Outcome.WRITTEN else str(result.error)
        if isinstance(result.error, RemoteError) and refusal != own.row.refusal:
            self._listener.unreadable(write.mapping, f'not written: {refusal}')
        if outcome is not Outcome.NOT_SENT:
            own.row.refusal = refusal
        if own.urgency is Urgency.FALLBACK and (result.packets_done or result.is_unconfirmed):
            self._reads.refresh(write, self.machine.now)

    def _carry_out(self, write: Write) -> Steps[WriteResult]:
        write.speak(self._planner.dialect(write.mapping))
        return carry_out(write, self._clock)

    def _write_failed(self, station: int, error: LinkError | RemoteError | None) -> None:
        """Count the error that has ended a write early, if any."""
        if isinstance(error, RemoteError):
            self.stations[station].remote_errors += 1
        elif error is not None and not isinstance(error, CommandExpired):
            self._link_failed(station, (), error)
