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

"""The results of reads: values to publish, failed rows, other blocks to read instead."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from collections.abc import Mapping as MappingType
import math
from typing import Protocol

from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import LineTime
from abdf1_ros.driver.kernel.kernel import Kernel
from abdf1_ros.driver.reads.demands import ReadAnswer, ReadCall, ReadCalls
from abdf1_ros.driver.reads.guards import Guards
from abdf1_ros.driver.reads.job import ReadJob, ReadTooOld
from abdf1_ros.driver.reads.point import Guard, ReadPoint
from abdf1_ros.driver.reads.silent import Reads
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import WriteResult
from abdf1_ros.errors import (
    CommandTimeout,
    FormatError,
    LinkError,
    NoWholeReply,
    RemoteError,
    StationInactive,
)
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.status import is_address_fault
from abdf1_ros.pccc.values import Values
from abdf1_ros.plan.bounds import mode_periods, own_work
from abdf1_ros.plan.forecast import (
    answer_time,
    block_time,
    line_model,
    period_of,
    poll_cycle,
    stale_times,
    USUAL_RESPONSE_TIME,
)
from abdf1_ros.plan.planner import Block, Planner
from abdf1_ros.plan.refusals import Change, Refusals
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows

# Other commands go between the packets of one read. On a busy line the read may take this many
# times its own time. A slow station may reply to each packet within Cmd_Timeout only. Where
# stations are polled in turn, each packet may take this many scans.
_TURNS_OF_A_READ = 10
_SCANS_OF_A_PACKET = 2


class ValueListener(Protocol):
    """A listener to reads, called in the link thread; methods not overridden do nothing."""

    def read(self, mapping: Mapping, values: Values) -> None:
        """Take the values of a good read that are to be published."""

    def unreadable(self, mapping: Mapping, reason: str) -> None:
        """Take a new reason why a row has no usable value, or why a PLC refuses our write."""

    def written(self, result: WriteResult) -> None:
        """Take the one result of a write."""

    def published_again(self, mapping: Mapping, seconds: float) -> None:
        """Rows are no longer withheld; ``mapping`` was the last of them."""


class Readings:
    """
    The ``points`` of all rows that are published, and the ``reads`` that serve them.

    ``listener`` gets the values, ``kernel`` all words. ``planner`` knows the packets that each
    station accepts. ``mode_periods`` has the stations that have to be asked for their mode, with
    the period (s).
    """

    def __init__(self, network: Network, mappings: Rows, settings: DriverSettings,
                 stations: ActiveStationList, line: LineTime, listener: ValueListener,
                 kernel: Kernel) -> None:
        self.planner = Planner(line_model(network), settings.default_period)
        blocks = self.planner.plan(mappings.repeated)
        self._longest_frames = max((max(block.line_times) for block in blocks), default=0.0)
        self.guards = Guards()
        times = settings.default_period, settings.stale_after
        self.mode_periods = mode_periods(mappings, *times)
        line_of_plan = self.planner.line_model
        stale = stale_times(line_of_plan, blocks, *times, own_work(line_of_plan, mappings, *times),
                            is_heard=network.line_mode.only_listens)
        self.points = _points(mappings, stale, settings, self.guards)
        self.reads = Reads(stations)
        self.demands = ReadCalls(settings.write_timeout)
        self.expected_poll_cycle = poll_cycle(blocks, answer_time(network, blocks))
        self._network = network
        self._stations = stations
        self._line = line
        self._listener = listener
        self._kernel = kernel
        self._refusals = Refusals(self.planner)
        self.reads.replace((), map(self._job, blocks), 0.0)

    def begin(self, now: float) -> None:
        """Read all rows at once, and together what belongs together: the port has been opened."""
        self._stations.odd.forget()
        self._change(self._refusals.forget(self.blocks))
        self.reads.begin(now)

    @property
    def blocks(self) -> list[Block]:
        """Return the blocks that are read again and again."""
        return [job.block for job in self.reads.jobs if not job.is_on_demand]

    def _job(self, block: Block) -> ReadJob:
        mode, line = self._network.line_mode, self._network.line
        scan = mode.undisturbed(line, self._longest_frames, USUAL_RESPONSE_TIME,
                                self._longest_frames, sum(1 for _ in self._stations))
        packet = max(line.cmd_timeout, _SCANS_OF_A_PACKET * scan)
        longest = mode.longest_transaction(line, 0.0) + max(
            _TURNS_OF_A_READ * block_time(block), len(block.requests) * packet)
        points = [self.points[mapping] for mapping in block.mappings if mapping.reads]
        return ReadJob(block, points, self._line, self._packet_ended, longest)

    def take_demands(self, now: float) -> None:
        """Take the rows that other threads want to be read at once."""
        for demand in self.demands.inbox.take():
            self._want(demand, now)

    def _want(self, demand: ReadCall, now: float) -> None:
        """Read a row at once for a call; for one of a silent station the answer is an error."""
        mapping = demand.mapping
        station = self._stations[mapping.station]
        if not station.replies_in_time:
            self._stations.ask_again(mapping.station)
            demand.answer(ReadAnswer(error=str(
                CommandTimeout() if station.active else StationInactive(station.number))))
            return
        job = next((job for job in self.reads.jobs if mapping in job.block.mappings), None) \
            or self._job(self.planner.alone(mapping))
        self.demands.add(demand, now, job.longest_read)
        self.reads.want(job, now)

    def _settle(self, job: ReadJob, words: bytes | None, error: Exception | None) -> None:
        """Answer the calls for a read that has ended, unless it is repeated."""
        if job.is_unfinished or job not in self.reads.jobs:
            return
        waiting = self.demands.waiting
        for point, place in job.points.items():
            if point.mapping in waiting:
                self.demands.settle(
                    point.mapping, self._answer(point, words and words[place], error), job.started)
        if not any(point.mapping in waiting for point in job.points):
            job.wanted = -math.inf

    def _answer(self, point: ReadPoint, words: bytes | None,
                error: Exception | None) -> ReadAnswer:
        if isinstance(error, LinkError):
            return ReadAnswer(error=str(error))
        if text := point.error or point.withheld and f'withheld: {point.withheld}':
            return ReadAnswer(error=text)
        if words is None:
            return ReadAnswer(error=str(error))
        return ReadAnswer(point.values_of(words), self._line.now)

    def _packet_ended(self, job: ReadJob, words: bytes | None, error: Exception | None) -> None:
        try:
            if words is not None:
                self._read(job, words)
            elif isinstance(error, ReadTooOld):
                _fail_periodic(job.points, f'read again: {error}')
            elif isinstance(error, LinkError):
                if isinstance(error, NoWholeReply):
                    self._is_odd(job, error)
                else:
                    self.link_failed(job.station, error, job.points)
            elif isinstance(error, RemoteError):
                self._stations[job.station].remote_errors += 1
                self._failed(job, str(error), is_address_fault(error))
            elif isinstance(error, FormatError):
                self._failed(job, f'unusable reply: {error}', is_refusal=False)
        finally:
            if self.demands.waiting or job.wanted > -math.inf:
                self._settle(job, words, error)
            self.reads.ended(job, self._line.now)

    def _read(self, job: ReadJob, data: bytes) -> None:
        """Update the points for which this read was made."""
        now = self._line.now
        self._kernel.read(job.block, data, job.started)
        if self.guards.counters:
            for point, place in job.points.items():
                self.guards.value_read(point, data[place], now)
        period = job.block.period
        is_refresh = job.refreshed > -math.inf or job.wanted > -math.inf
        for point, place in job.points.items():
            # Points without a longer Period than the block are updated by every read.
            is_rare = point.period > period and not is_refresh
            if is_rare and not point.is_due(now, period):
                continue
            if point.guard is None:
                self._update(point, data[place])
            else:
                self._guarded(point, point.guard, data[place], job.started)
        job.done(now)
        if job.is_on_demand:
            return  # other rows are not read with it
        if job.intervals.last is None:  # the first good read after a failure
            self._change(self._refusals.recovered(job.block, self.blocks))
        elif self._refusals.recovering:
            self._change(self._refusals.read_again(job.block, self.blocks))

    def _guarded(self, point: ReadPoint, guard: Guard, words: bytes, started: float) -> None:
        """Update a point with words that were read from ``started`` on, unless it is withheld."""
        if reason := guard.why_not(point, started, self._line.now):
            if point.mapping.is_on_demand:  # the call gets the reason
                point.withheld, point.error = reason, None
            else:
                self._withhold(point, guard, reason)
        elif point in guard.withheld:
            self._release(point, guard, words)
        else:
            self._update(point, words)

    def heard(self, found: MappingType[ReadPoint, bytes], started: float) -> None:
        """Update points with the words of one read of another node."""
        for point, words in found.items():
            self.guards.value_read(point, words, self._line.now)
        for point, words in found.items():
            if point.guard is None:
                self._update(point, words)
            else:
                self._guarded(point, point.guard, words, started)

    def _withhold(self, point: ReadPoint, guard: Guard, reason: str) -> None:
        """Withhold a value; report it once for all rows with the same condition (rule 15)."""
        is_first = not guard.withheld
        if point.withhold(reason, self._line.now) and is_first:
            count = len(guard.points)
            more = f'; so are all {count} rows that depend on it' if count > 1 else ''
            self._listener.unreadable(point.mapping, f'withheld: {reason}{more}')

    def _release(self, point: ReadPoint, guard: Guard, words: bytes) -> None:
        """Update a withheld point; report it with the last point of the guard."""
        self._update(point, words)
        if not guard.withheld:
            self._listener.published_again(
                point.mapping, self._line.now - point.withheld_since)

    def served(self, mapping: Mapping, words: bytes) -> None:
        """Take words of our own table that a PLC has written."""
        self._update(self.points[mapping], words)

    def _update(self, point: ReadPoint, words: bytes) -> None:
        try:
            values = point.update(words, self._line.now)
        except FormatError as error:
            self.unreadable(point, str(error))
        else:
            if values is not None:
                self._listener.read(point.mapping, values)

    def unreadable(self, point: ReadPoint, reason: str) -> None:
        """Record why a row has no value, and report a new reason."""
        if point.fail(reason):
            self._listener.unreadable(point.mapping, reason)

    def _is_odd(self, job: ReadJob, error: LinkError) -> None:
        """Fail the points of a reply that is never whole, and other points of a silent station."""
        self._stations[job.station].failures += 1
        _fail_periodic((point for point in self._affected(job.station, ())
                        if point not in job.points), str(StationInactive(job.station)))
        self._failed(job, str(error), is_refusal=True, is_odd=True)

    def _failed(self, job: ReadJob, reason: str, is_refusal: bool, *,
                is_odd: bool = False) -> None:
        """Fail the points; read smaller blocks after a refusal, or if no reply is whole."""
        job.interrupted()
        if job.is_on_demand:
            if is_refusal and (shorter := self.planner.split(job.block)):
                self.reads.drop([job], self._line.now)
                self.reads.want(self._job(*shorter), self._line.now)
                return
            is_refusal = False  # other rows are not read with it
        is_news = is_refusal and job in self.reads.jobs
        change = self._refusals.refused(job.block, self.blocks, is_odd=is_odd) \
            if is_news else None
        is_divided = change is not None and list(change.old) == [job.block]
        if is_odd and change is not None and is_divided:
            self._stations.odd.divided(job.key, change.new)
        points = job.points if is_odd else self._affected(job.station, job.points)
        for point in points:
            if is_divided:
                point.fail(f'{reason} (or another address read with it has this fault)')
            else:
                self.unreadable(point, reason)
        self._change(change)

    def _change(self, change: Change | None) -> None:
        """Read the new blocks of a change from now on."""
        if change is not None:
            old = [job for job in self.reads.jobs if job.block in change.old]
            self.reads.replace(old, map(self._job, change.new), self._line.now)

    def told(self, station: int, identity: Identity | None, asked: float) -> None:
        """Use mode and processor of a station ``asked`` at a clock value (s); None: unknown."""
        if late := self.guards.mode_told(station, identity, asked):
            self.reads.go_first(late)
        if identity is not None:
            self._change(self._refusals.processor_told(station, identity.processor, self.blocks))

    def link_failed(self, station: int, error: LinkError,
                    points: Collection[ReadPoint] = ()) -> None:
        """Fail the points of a transaction without a reply."""
        self._stations[station].failures += 1
        _fail_periodic(self._affected(station, points), str(error))

    def _affected(self, station: int, points: Collection[ReadPoint]) -> Collection[ReadPoint]:
        """
        Return the points of a failed transaction; for a silent station all its points.

        Other rows on demand are not among them: no read would end their fault.
        """
        if self._stations[station].replies_in_time:
            return points
        return [point for mapping, point in self.points.items()
                if mapping.extent.station == station
                and (point in points or not mapping.is_on_demand)]

    def station_lost(self, station: int) -> None:
        """Answer all calls for rows of a station that has become inactive."""
        self.demands.fail([mapping for mapping in self.demands.waiting
                           if mapping.station == station], str(StationInactive(station)))

    def port_lost(self, reason: str) -> None:
        """Fail all points that depend on the port: it is lost."""
        self.demands.close(reason)
        self.reads.drop([job for job in self.reads.jobs if job.is_on_demand], self._line.now)
        for job in self.reads.jobs:
            job.interrupted()
        _fail_periodic((point for point in self.points.values() if point.mapping.polls), reason)
        for point in self.points.values():
            point.forget_published()


def _fail_periodic(points: Iterable[ReadPoint], reason: str) -> None:
    """Fail the points that are read periodically: a call gets the reason as its answer."""
    for point in points:
        if not point.mapping.is_on_demand:
            point.fail(reason)


def _points(mappings: Rows, stale: dict[Mapping, float], settings: DriverSettings,
            guards: Guards) -> dict[Mapping, ReadPoint]:
    """Return the points of all mappings that are published, in their order."""
    default = settings.default_period
    # A row on demand is never stale, but the mode for While RUN may be.
    stale |= {mapping: settings.stale_after * period_of(mapping, default)
              for mapping in mappings.on_demand}
    return {mapping: _served_point(mapping, settings) if mapping.serves
            else ReadPoint(mapping, period_of(mapping, default), stale[mapping],
                           guards.of(mapping))
            for mapping in mappings.published}


def _served_point(mapping: Mapping, settings: DriverSettings) -> ReadPoint:
    # Without a Period a PLC may write at any time, or never.
    expected = mapping.period / 1000 if mapping.period else math.inf
    return ReadPoint(mapping, expected, settings.stale_after * expected)
