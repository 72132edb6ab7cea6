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
All reads of a line: waiting ones in the order of ``queue``, and reads that are set aside.

The reads of a station are set aside while it is inactive, or while it acknowledges commands
without replying in time. Now and then one of them is sent as a probe.

A read that fails while its station replies to others is kept back (rule 29). So are all reads of
the station that have not passed since: each of them may fail, too. After a failed one the others
have the line as long as it took, so that they wait for one failure only. Those that are odd have
a smaller share.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Container, Iterable, Set
import math

from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.kernel.flights import Flight
from abdf1_ros.driver.reads.job import ReadJob
from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.driver.reads.queue import ReadQueue


class _Trust:
    """How far a read can be expected to pass, by what has failed before (rule 29)."""

    def __init__(self, stations: ActiveStationList) -> None:
        self._stations = stations

    def is_usual(self, job: ReadJob) -> bool:
        """Tell whether a read that is due may be sent as usual."""
        return self._stations.records[job.station].replies_in_time and (
            job.is_unfinished or not self.failures(job) and not self._is_untested(job))

    def _is_untested(self, job: ReadJob) -> bool:
        """Tell whether a read has not passed since others of its station have begun to fail."""
        return not job.is_on_demand and (
            job.passed < self._stations.odd.since(job.station) < math.inf)

    def failures(self, job: ReadJob) -> int:
        """Return how often a read has failed in a row while its station replied to others."""
        return self._stations.odd.failures(job.key)

    def order(self, job: ReadJob) -> tuple[int, float, int]:
        """Return the place of a read among those that are kept back; the least goes first."""
        rank = self._stations.odd.rank(job.key)
        return (rank, 0.0, 0) if rank else (rank, -job.passed, job.block.words)


class Reads:
    """
    Keep all read jobs; ``stations.probes`` decides when a silent station may be read.

    ``queue`` has the jobs that wait for their time, ``aside`` the jobs of silent stations.
    ``kept_back`` has the jobs that are due and have failed, or may fail as others have. The one
    with the fewest failures goes first. Of those without, it is the one that has passed last, or
    the shortest: fewer of its bytes can be bad.
    """

    def __init__(self, stations: ActiveStationList) -> None:
        self._stations = stations
        self._trust = _Trust(stations)
        self.queue = ReadQueue()
        self.aside: dict[int, deque[ReadJob]] = {}
        self.kept_back: deque[ReadJob] = deque()
        self._put_off = 0.0  # no probe before it: no station replies (clock value, s)

    @property
    def jobs(self) -> frozenset[ReadJob]:
        return frozenset(self.queue.jobs)

    @property
    def has_silent(self) -> bool:
        """Tell whether reads of silent stations wait for their probe."""
        return bool(self.aside)

    @property
    def has_odd(self) -> bool:
        """Tell whether odd reads wait for a turn."""
        return any(self._stations.odd.is_odd(job.key) for job in self.kept_back)

    @property
    def poll_cycle(self) -> float | None:
        """Return the longest time (s) between the last two good reads of any job."""
        return max((job.intervals.last for job in self.jobs if job.intervals.last is not None),
                   default=None)

    @property
    def longest_poll_cycle(self) -> float | None:
        """Return the longest time (s) ever between two good reads of a job."""
        return max((job.intervals.longest for job in self.jobs
                    if job.intervals.longest is not None), default=None)

    def replace(self, old: Iterable[ReadJob], new: Iterable[ReadJob], now: float) -> None:
        """Put ``new`` jobs, due at once, in the place of ``old`` ones."""
        old = list(old)
        self.queue.replace(old, new, now)
        for job in old:
            self._stations.odd.passed(job.key)

    def want(self, job: ReadJob, now: float) -> None:
        """Make a read that a call has asked for due at once; add it if it is new."""
        job.wanted = now
        if job not in self.queue.jobs:
            self.queue.replace((), [job], now)
        elif job.ticket:  # else it is under way, or set aside
            self.queue.put(job, now)

    def drop(self, jobs: Iterable[ReadJob], now: float) -> None:
        """Forget reads."""
        self.queue.replace(jobs, (), now)

    def begin(self, now: float) -> None:
        """Make all reads due at once: the port has been opened."""
        self.kept_back.clear()
        waiting = self.queue.jobs.difference(*self.aside.values())
        for job in sorted(waiting, key=lambda job: (job.due, job.ticket)):
            self.queue.put(job, now)

    def next(self, now: float, busy: Container[int] = ()) -> ReadJob | None:  # noqa: A003
        """
        Return a probe if one may be sent, or else the next read that is due.

        The read is for a station that answers and is not ``busy``.
        """
        if self.aside:
            self.find_due(now)  # a station may have become silent by another command
            if job := self._probe(now, busy):
                return job
        if self.kept_back and (job := self._next_kept_back(now, busy, is_free=False)):
            return job
        passed_over, failed = [], self._stations.odd.failed
        while (job := self.queue.take(now)) is not None:
            is_usual = self._trust.is_usual(job) if failed \
                else self._stations.records[job.station].replies_in_time
            if is_usual and job.station not in busy:
                break
            self.queue.undo_turn()
            if is_usual:
                passed_over.append(job)
            else:
                self._keep_back(job)
        if job is not None:
            job.is_probe = job.is_untested = False
        elif self.kept_back:
            job = self._next_kept_back(now, busy, is_free=True)
        for other in passed_over:
            self.queue.put(other, other.due)
        return job

    def next_proven(self, due: float, busy: Container[int]) -> tuple[ReadJob | None, bool]:
        """
        Return the next read of a station that has replied, if it was due then; None for none.

        Return also whether such a read waits for a ``busy`` station.
        """
        passed_over, is_kept_waiting = [], False
        while (job := self.queue.take(due)) is not None:
            station = self._stations.records[job.station]
            is_proven = station.replies > 0 and self._trust.is_usual(job)
            if is_proven and job.station not in busy:
                job.is_probe = job.is_untested = False
                break
            self.queue.undo_turn()
            is_kept_waiting |= is_proven
            passed_over.append(job)
        for other in passed_over:
            self.queue.put(other, other.due)
        return job, is_kept_waiting

    def _probe(self, now: float, busy: Container[int]) -> ReadJob | None:
        """Return the next read of a silent station, None while no probe may be sent."""
        for number in list(self.aside):
            if self._stations[number].replies_in_time:  # e.g. to a write or a guest
                self.release(number, now)
        if now < self._next_probe():
            return None
        station = next((number for number in self.aside
                        if number not in busy and self._stations.may_be_asked(number)), None)
        if station is None:
            return None
        jobs = self.aside.pop(station)
        job = self._instead_of(min(jobs, key=self._trust.order), now)
        if job in jobs:
            jobs.remove(job)
        job.due, job.is_probe, job.is_untested = now, True, False
        if jobs:
            # moved to the end, so that the next probe goes to another station
            self.aside[station] = jobs
        return job

    def _next_kept_back(self, now: float, busy: Container[int], *,
                        is_free: bool) -> ReadJob | None:
        """
        Return the next read of those that are kept back, None while none may be sent.

        If the line ``is_free``, no other read is due, and those that are not odd need no turn.
        """
        odd = self._stations.odd
        for job in list(self.kept_back):
            if not self._stations.records[job.station].replies_in_time:
                self.kept_back.remove(job)
                self._set_aside(job)
            elif self._trust.is_usual(job) or job not in self.queue.jobs:
                self.kept_back.remove(job)
                self.queue.put(job, job.due)
        may_go = [job for job in self.kept_back if job.station not in busy and (
            now >= odd.next(job.key) or is_free and not odd.is_odd(job.key))]
        if not may_go:
            return None
        job = self._instead_of(min(may_go, key=self._trust.order), now)
        if job in self.kept_back:
            self.kept_back.remove(job)
        job.is_probe, job.is_untested = False, not self._trust.failures(job)
        return job

    def _instead_of(self, job: ReadJob, now: float) -> ReadJob:
        """
        Return another read, due or not, if the station has replied to none since a failure.

        It shows whether the station replies. Otherwise one that fails could go first again and
        again, and make the station inactive each time.
        """
        if not self._stations.odd.is_doubtful(job.station):
            return job
        others = [other for other in (*self.queue.waiting(), *self.kept_back)
                  if other.station == job.station and not self._trust.failures(other)]
        if not others:
            return job
        other = min(others, key=self._trust.order)
        if other not in self.kept_back:
            self.queue.take_early(other, now)
        return other

    def _keep_back(self, job: ReadJob) -> None:
        """Keep a read that is not usual until its turn comes."""
        if self._stations.records[job.station].replies_in_time:
            self.kept_back.append(job)
        else:
            self._set_aside(job)

    def find_due(self, now: float) -> bool:
        """Keep reads back that are not usual; return True if another read is due."""
        while (job := self.queue.first(now)) is not None:
            if self._trust.is_usual(job):
                return True
            self.queue.take(now)
            self.queue.undo_turn()
            self._keep_back(job)
        return any(job.due <= now and not self._trust.failures(job) for job in self.kept_back)

    def next_due(self) -> float:
        """Return when the next read or probe is due (clock value in s), infinite for never."""
        due = self.queue.next_due()
        odd = self._stations.odd
        for job in self.kept_back:
            due = min(due, odd.next(job.key) if odd.is_odd(job.key) else job.due)
        if not any(map(self._stations.may_be_asked, self.aside)):
            return due
        return min(due, self._next_probe())

    def _next_probe(self) -> float:
        return max(self._stations.probes.next, self._put_off)

    def ended(self, job: ReadJob, now: float) -> None:
        """Take a job back after a good or failed read, unless it has been replaced."""
        if job not in self.queue.jobs:
            return
        station = self._stations.records[job.station]
        if not station.replies_in_time:
            self._stations.tried(job.station, job.asked, now, was_silent=job.is_probe)
            self._put_off = now if self.queue else now + job.block.period
            self._set_aside(job)
            return
        if self.aside:
            self.release(job.station, now)
        if job.is_unfinished:  # one that begins again is behind those that have waited meanwhile
            self.queue.put(job, job.due if job.is_begun else now)
        elif job.started < job.refreshed or job.started < job.wanted:  # before the write or call
            self.queue.put(job, now)
        elif job.is_on_demand:
            self.drop([job], now)
        else:
            self.queue.put(job, max(job.due + job.block.period, job.started))

    def write_ended(self, flight: Flight) -> None:
        """Make the reads of all words that the write may have changed due at once."""
        now = flight.done
        write = flight.write
        if not flight.has_changed or write is not None and write.mapping.is_heartbeat:
            return
        for job in self.queue.jobs:
            if flight.meets(job.extent):
                job.refreshed = now
                if job.due > now:
                    self.queue.put(job, now)

    def go_first(self, points: Set[ReadPoint]) -> None:
        """Let the waiting reads of these points go before all others."""
        for job in self.queue.waiting():
            if not points.isdisjoint(job.points):
                self.queue.put(job, -math.inf)

    def release(self, station: int, now: float) -> None:
        """Make the reads of a station that were set aside due at once."""
        for job in self.aside.pop(station, ()):
            self.queue.put(job, now)

    def _set_aside(self, job: ReadJob) -> None:
        job.interrupted()
        if job.is_on_demand:  # no call waits for the station to come back
            self.drop([job], job.due)
            return
        self.aside.setdefault(job.station, deque()).append(job)
