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
Who has the line next: one place decides.

Heartbeats and fallbacks (``interlocks``) go first, but after seven of them in a row a read has
its turn. Then there are three queues:

- ``writes`` go first, but after four of their commands in a row a check or read that is due has
  its turn.
- ``checks``, such as the question for a station's mode, go before the reads. After a check, all
  reads that were due when it began go before the next check.
- ``reads`` go in the order of ``read_queue``.

A command that asks a silent station whether it is there again is a probe. Probes get at most an
eighth of the line's time (``df1.probes``).
"""

from __future__ import annotations

from collections.abc import Callable, Container
import math

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.checks import Check, Checks
from abdf1_ros.driver.interlocks import Interlocks, OwnWrite
from abdf1_ros.driver.job_tasks import JobTask, JobTasks
from abdf1_ros.driver.points import Write, WriteResult
from abdf1_ros.driver.read_queue import ReadJob
from abdf1_ros.driver.reads import Reads
from abdf1_ros.driver.writes import WriteQueue

MAX_WRITES_IN_A_ROW = 4
MAX_OWN_IN_A_ROW = 7


class Agenda:
    """
    Decide which of the ``writes``, ``checks`` and ``reads`` has the line next.

    ``tasks`` are those under way: each packet of a write has a turn of its own. ``patience`` and
    ``report`` are for the writes. ``interlocks`` is set later, where the map has heartbeats or
    fallbacks.
    """

    def __init__(self, stations: ActiveStationList, checks: Checks, tasks: JobTasks, *,
                 patience: float, report: Callable[[WriteResult], None]) -> None:
        self._stations = stations
        self._tasks = tasks
        self.checks = checks
        self.reads = Reads(stations)
        self.writes = WriteQueue(stations, patience, report)
        self.interlocks: Interlocks | None = None
        self._own_in_a_row = 0
        self._writes_in_a_row = 0
        self._has_begun_write = False
        self._last_check = -math.inf
        self._last_probe_was_check = False

    def next(self, now: float, busy: Container[int] = (),  # noqa: A003
             ) -> OwnWrite | JobTask | Write | Check | ReadJob | None:
        """Return what has the line next, None for nothing; stations in ``busy`` have to wait."""
        if self.interlocks is None:
            return self._usual(now, busy)
        if self._own_in_a_row < MAX_OWN_IN_A_ROW:
            return self._own(now, busy) or self._usual(now, busy)
        self._own_in_a_row = 0
        return self._read(now, busy) or self._own(now, busy) or self._usual(now, busy)

    def _own(self, now: float, busy: Container[int]) -> OwnWrite | None:
        """Return a heartbeat or fallback; these do not count as writes in a row (rule 11)."""
        own = self.interlocks.next(now, busy) if self.interlocks else None
        if own is not None:
            self.writes.begin_own(own.write)
            self._own_in_a_row += 1
        return own

    def _usual(self, now: float,
               busy: Container[int]) -> JobTask | Write | Check | ReadJob | None:
        if self._writes_in_a_row < MAX_WRITES_IN_A_ROW and (write := self._write(now, busy)):
            return write
        return self._check(now, busy) or self._read(now, busy) or self._write(now, busy)

    def _write(self, now: float, busy: Container[int]) -> JobTask | Write | None:
        """Return a new write, or the next packet of one under way, in turns."""
        under_way = self._tasks.waiting(busy)
        write = None
        if under_way is None or not self._has_begun_write:
            write = self.writes.next(now, busy)
        self._has_begun_write = write is not None
        self._writes_in_a_row += (write or under_way) is not None
        return write or under_way

    def _check(self, now: float, busy: Container[int]) -> Check | None:
        """Return a check that is due; the turn of the reads comes after it."""
        if not self.checks.is_due(now) or self.reads.is_due(self._last_check):
            return None
        check = self.checks.next(now, busy, self._probe_from(now))
        if check is None:
            return None
        self._last_check = now
        self._last_probe_was_check |= check.is_probe
        if self.writes:
            self._writes_in_a_row = MAX_WRITES_IN_A_ROW
        return check

    def _probe_from(self, now: float) -> float:
        """
        Return the clock value (s) from which a check may be a probe.

        Where reads of silent stations wait as well, checks and reads take turns.
        """
        probes = self._stations.probes
        is_reads_turn = self._last_probe_was_check and self.reads.has_silent
        return now + probes.pause if is_reads_turn and now >= probes.next else probes.next

    def _read(self, now: float, busy: Container[int]) -> ReadJob | None:
        """Return a probe or read that is due."""
        job = self.reads.next(now, busy)
        if job is not None:
            self._last_probe_was_check &= not job.is_probe
            self._writes_in_a_row = self._own_in_a_row = 0
        return job

    def next_due(self) -> float | None:
        """Return when there is something to do next (clock value in s), None for never."""
        moments = [moment for moment in (self.reads.next_due(), self.checks.next_due())
                   if moment is not None]
        if self.interlocks is not None and (own := self.interlocks.next_due()) < math.inf:
            moments.append(own)
        return min(moments, default=None)

    def write_ended(self, write: Write, begun: float, now: float) -> None:
        """Take note that a write has ended that had the line from ``begun`` on."""
        self.writes.ended(write)
        if write.mapping.station != BROADCAST:
            self._stations.tried(write.mapping.station, begun, now, was_silent=write.is_probe,
                                 is_message=True)

    def check_ended(self, check: Check, begun: float, now: float) -> None:
        """Take note that a check has ended that had the line from ``begun`` on."""
        self._stations.tried(check.station, begun, now, was_silent=check.is_probe)
