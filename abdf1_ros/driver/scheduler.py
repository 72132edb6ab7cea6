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
The scheduler: which job has the line next.

Writes go first, but after four of their commands in a row a check, probe or read that is due has
its turn; which read that is, and how they share a line that is too slow for them, is told in
``read_queue``. The reads of a
station that is inactive, or acknowledges commands but does not reply to them in time, are set
aside; every now and then one of them goes out as a probe, at a pace that leaves seven eighths
of the line to the others. A write to an inactive station is a probe as well; those that follow
it too soon end unsent.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Container, Iterable
import itertools
import math

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.points import Outcome, Write, WriteResult
from abdf1_ros.driver.read_queue import ReadJob, ReadQueue
from abdf1_ros.messages import Message

MAX_WRITES_IN_A_ROW = 4
MAX_WAITING_WRITES = 1000
_LIVING_SHARE = 7  # times as long as for one probe


def waited_too_long(seconds: float) -> str:
    """Return why a write ends that has waited for more than so many seconds."""
    return f'waited longer than {seconds:g} s for the line'


class Scheduler:
    """
    Keep all jobs.

    ``probe_time`` is the seconds that a probe of a silent station takes; a write that has
    waited longer than ``write_timeout`` seconds is not sent any more. ``report`` gets the
    results of writes that end here. Only ``waiting_writes`` may be asked for by another thread.
    """

    def __init__(self, stations: ActiveStationList, *, probe_time: float, write_timeout: float,
                 report: Callable[[WriteResult], None]) -> None:
        self._stations = stations
        self._probe_interval = probe_time * _LIVING_SHARE
        self._write_timeout = write_timeout
        self._report = report
        self._writes: deque[Write] = deque()
        self._writes_under_way: list[Write] = []
        self._writes_in_a_row = 0
        self._next_expiry = math.inf
        self._reads = ReadQueue()
        self._parked: dict[int, deque[ReadJob]] = {}
        self._next_probe = 0.0
        self._last_probe_was_echo = False
        self._next_write_probe = 0.0

    @property
    def jobs(self) -> frozenset[ReadJob]:
        """Return all read jobs."""
        return frozenset(self._reads.jobs)

    @property
    def waiting_writes(self) -> int:
        """Return how many writes wait."""
        return len(self._writes)

    @property
    def scan_time(self) -> float | None:
        """Return the longest time (s) between the last two good reads of any job."""
        return max((job.interval for job in self.jobs if job.interval is not None),
                   default=None)

    @property
    def longest_scan_time(self) -> float | None:
        """Return the longest time (s) there has ever been between two good reads of a job."""
        return max((job.longest for job in self.jobs if job.longest is not None), default=None)

    def add_reads(self, jobs: Iterable[ReadJob], now: float) -> None:
        """Take new jobs, all due at once."""
        self.replace((), jobs, now)

    def replace(self, old: Iterable[ReadJob], new: Iterable[ReadJob], now: float) -> None:
        """Put ``new`` jobs in the place of ``old`` ones, whose station has just answered."""
        self._reads.replace(old, new, now)

    def begin(self, now: float) -> None:
        """Make all reads due at once: there has been no line for a while."""
        waiting = self._reads.jobs.difference(*self._parked.values())
        for job in sorted(waiting, key=lambda job: (job.due, job.ticket)):
            self._reads.put(job, now)

    @property
    def is_turn_of_writes(self) -> bool:
        """Tell whether writes go before all else that is due."""
        return self._writes_in_a_row < MAX_WRITES_IN_A_ROW

    def next_write(self, now: float, busy: Container[int] = ()) -> Write | None:
        """
        Return the next write.

        Writes to stations in ``busy`` keep waiting, and so does one of words that are being
        written: the packets of two must not mix. Each that is returned ends with
        ``write_ended``.
        """
        self.expire(now)
        write = self._first_free(busy) if self._writes else None
        if write is None:
            return None
        self._writes.remove(write)
        self._writes_under_way.append(write)
        self._writes_in_a_row += 1
        return write

    def write_goes_on(self) -> None:
        """Take note that another packet of a write has the line."""
        self._writes_in_a_row += 1

    def _first_free(self, busy: Container[int]) -> Write | None:
        """Return the first write that need not wait; those of a station keep their order."""
        held_up: set[int] = set()
        for write in self._writes:
            station = write.mapping.station
            if station in busy or station in held_up:
                continue
            if not any(write.overlaps(other) for other in self._writes_under_way):
                return write
            held_up.add(station)
        return None

    def write_ended(self, write: Write) -> None:
        """Take note that a write is not under way any more; the next of its words may go out."""
        self._writes_under_way.remove(write)

    def expire(self, now: float) -> None:
        """End the writes that have waited too long."""
        self._next_expiry = math.inf
        for write in list(self._writes):
            detail = self._hindrance(write, now)
            if detail:
                self._writes.remove(write)
                self._report(write.result(Outcome.NOT_SENT, detail, now))
            else:
                self._next_expiry = min(self._next_expiry, self._expiry(write))

    def next_expiry(self) -> float:
        """Return when ``expire`` has something to do (clock value in s), infinite for never."""
        return self._next_expiry

    def _expiry(self, write: Write) -> float:
        """Return the clock value (s) after which a write is too old."""
        return write.requested + self._write_timeout

    def _hindrance(self, write: Write, now: float) -> str:
        """Return why a write is not to be sent any more, empty if it is."""
        if now >= self._expiry(write):
            return waited_too_long(self._write_timeout)
        station = write.mapping.station
        # A write has just found it inactive, and others want the line.
        if now < self._next_write_probe and station != BROADCAST \
                and not self._stations[station].active:
            return Message.ERR_INACTIVE_STATION.line(station)
        return ''

    def next_read(self, now: float, busy: Container[int] = ()) -> ReadJob | None:
        """Return the next read or probe of a station not in ``busy``, None for nothing due."""
        job = self._take_probe(now, busy) or self._take_read(now, busy)
        if job is not None:
            self._writes_in_a_row = 0
        return job

    def is_read_due(self, now: float) -> bool:
        """Tell whether a read of an active station is due; those of others are set aside."""
        while (job := self._reads.first(now)) is not None:
            if self._stations[job.station].replies_in_time:
                return True
            self._reads.take(now)
            self._park(job)
        return False

    def next_due(self) -> float | None:
        """Return when the next read or probe is due (clock value in s), None for never."""
        due = self._reads.next_due()
        if not self._parked:
            return due
        return self._next_probe if due is None else min(due, self._next_probe)

    def finished(self, job: ReadJob, now: float) -> None:
        """Take a job back, whether it went well or not, unless it has been replaced."""
        if job not in self._reads.jobs:
            return
        station = self._stations[job.station]
        if not station.replies_in_time:
            interval = _LIVING_SHARE * (now - job.started) if station.active \
                else self._probe_interval
            self._next_probe = now + (interval if self._reads else job.block.period)
            self._park(job)
            return
        self.release(job.station, now)
        if job.is_under_way or job.is_to_repeat:
            self._reads.put(job, job.due)
        elif job.started < job.hastened:  # it had begun before the write
            self._reads.put(job, now)
        else:
            self._reads.put(job, max(job.due + job.block.period, job.started))

    def unanswered(self, now: float) -> None:
        """Take note that a write has found its station inactive: the next ones do not try."""
        self._next_write_probe = now + (self._probe_interval if self._reads else 0.0)

    def check_goes(self) -> None:
        """Take note that a check has the line; it does not use up the turn of the reads."""
        if self._writes:
            self._writes_in_a_row = MAX_WRITES_IN_A_ROW

    def probe_from(self, now: float) -> float:
        """
        Return from when (clock value in s) an echo may be a probe; from ``now`` on: it is one.

        Where reads of other inactive stations wait as well, they take turns.
        """
        if now < self._next_probe:
            return self._next_probe
        if self._parked and self._last_probe_was_echo:
            return now + self._probe_interval
        self._last_probe_was_echo = True
        return now

    def probe_failed(self, now: float) -> None:
        """Take note that an echo has found its station silent."""
        self._next_probe = now + (self._probe_interval if self._reads else 0.0)

    def hasten(self, write: Write, now: float) -> None:
        """Make the reads that show what ``write`` changed due at once."""
        self.release(write.mapping.station, now)
        for job in self._reads.jobs:
            if job.covers(write):
                job.is_hastened, job.hastened = True, now
                if job.due > now:
                    self._reads.put(job, now)

    def drop_writes(self, detail: str, now: float) -> None:
        """End every waiting write without sending it."""
        while self._writes:
            write = self._writes.popleft()
            self._report(write.result(Outcome.NOT_SENT, detail, now))

    def add_write(self, write: Write, now: float) -> None:
        """
        Let a write wait, in the place of an older value of its mapping.

        At the end, a topic that never rests would wait for ever. But nothing that was asked for
        in between of the same words is overtaken: then the older value goes out as well, or two
        such topics would put each other off for ever.
        """
        self._next_expiry = min(self._next_expiry, self._expiry(write))
        older = [] if write.is_pulse else [
            old for old in self._writes if old.mapping is write.mapping]
        if not older:
            self._writes.append(write)
            return
        at = self._writes.index(older[-1])
        is_overlapped = any(
            map(write.overlaps, itertools.islice(self._writes, at + 1, None)))
        if len(older) > 1 or not is_overlapped:
            self._writes.remove(older[-1])
            self._report(older[-1].result(Outcome.SUPERSEDED, '', now))
        self._writes.insert(len(self._writes) if is_overlapped else at, write)

    def _take_probe(self, now: float, busy: Container[int]) -> ReadJob | None:
        if not self._parked:
            return None
        for number in list(self._parked):
            if self._stations[number].replies_in_time:  # to a write, or to somebody else
                self.release(number, now)
        station = next((number for number in self._parked if number not in busy), None)
        if station is None or now < self._next_probe:
            return None
        self._last_probe_was_echo = False
        jobs = self._parked.pop(station)
        job = jobs.popleft()
        job.due = now
        if jobs:
            self._parked[station] = jobs  # to the end: the next probe is another station's
        return job

    def _take_read(self, now: float, busy: Container[int]) -> ReadJob | None:
        passed_over = []
        while (job := self._reads.take(now)) is not None:
            if not self._stations[job.station].replies_in_time:
                self._park(job)
            elif job.station in busy:
                passed_over.append(job)
            else:
                break
        for other in passed_over:
            self._reads.put(other, other.due)
        return job

    def release(self, station: int, now: float) -> None:
        """Make the reads of a station that were set aside due at once."""
        for job in self._parked.pop(station, ()):
            self._reads.put(job, now)

    def _park(self, job: ReadJob) -> None:
        job.interrupted()
        self._parked.setdefault(job.station, deque()).append(job)
