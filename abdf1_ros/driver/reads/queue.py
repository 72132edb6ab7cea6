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
Which reads are due, and which of them goes first.

The read with the earliest deadline goes first; the deadline is the due time plus one period. So
each block is read within its period as long as the line is fast enough. If the line is too slow, a
read is late by more than its period. Then three of four turns go to the read that is the most
periods late. So all periods become longer by about the same factor: many slow reads do not make
the fast ones as slow as themselves. The fourth turn still goes to the earliest deadline: a period
that is too short for the line does not block other reads.

A read that a call has asked for goes first. Then all other reads have the line three times as long
as one of its packets takes. So calls get a quarter of a full line, however many calls wait.

A block of several packets is in the queue once for each packet, so other reads wait for one packet
at most. A read without a period is due again as soon as it has begun. It gets the time that all
other reads leave: its period counts as four poll cycles.
"""

from __future__ import annotations

from collections.abc import Iterable
import heapq
import itertools
import math

from abdf1_ros.driver.reads.job import ReadJob
from abdf1_ros.plan.forecast import block_time, PATIENCE, poll_cycle

_TURNS = 4
_MOST_ENTRIES = 4  # for each read
_WANTED = -1.0  # in place of a period: the reads that calls have asked for
_OTHERS_BESIDE_WANTED = 3


_QueueEntry = tuple[float, int, ReadJob]
"""When a job is due, the ticket of the entry, and the job."""


class ReadQueue:
    """
    All read jobs; the jobs of one period are in the order in which they are due.

    ``jobs`` are all jobs, also jobs that are set aside or under way. ``heaps`` has the entries by
    period; an entry is void if its job has another ticket.
    """

    def __init__(self) -> None:
        self.jobs: set[ReadJob] = set()
        self._poll_cycle = 0.0
        self._wanted: list[_QueueEntry] = []
        self.heaps: dict[float, list[_QueueEntry]] = {_WANTED: self._wanted}
        self._wanted_from = -math.inf  # until then other due reads go first (clock value in s)
        self._tickets = itertools.count(1)
        self._turn = 0
        self._before_turn = self._turn, self._wanted_from

    def __bool__(self) -> bool:
        """Tell whether a job waits, due or not."""
        return any(self.heaps.values())

    def replace(self, old: Iterable[ReadJob], new: Iterable[ReadJob], now: float) -> None:
        """Forget ``old`` jobs and add ``new`` ones, all due at once."""
        added, old = list(new), list(old)
        for job in old:
            job.ticket = 0  # no entry has this ticket
        self.jobs.difference_update(old)
        self.jobs.update(added)
        self._poll_cycle = poll_cycle(job.block for job in self.jobs)
        for job in added:
            self.put(job, now)

    def put(self, job: ReadJob, due: float) -> None:
        """Let a job wait until it is due at ``due`` (clock value in s), unless it was replaced."""
        if job not in self.jobs:
            return
        job.due, job.ticket = due, next(self._tickets)
        is_wanted = job.wanted > -math.inf
        heap = self.heaps.setdefault(_WANTED if is_wanted else job.block.period, [])
        heapq.heappush(heap, (due, job.ticket, job))
        if len(heap) > _MOST_ENTRIES * len(self.jobs):
            # A refresh of a slow read leaves an old entry, which would stay until its old due
            # time.
            heap[:] = (entry for entry in heap if entry[1] == entry[2].ticket)
            heapq.heapify(heap)

    def waiting(self) -> list[ReadJob]:
        """Return the jobs that wait, due or not."""
        return [job for heap in self.heaps.values() for _, ticket, job in heap
                if ticket == job.ticket]

    def take_early(self, job: ReadJob, now: float) -> None:
        """Remove a job that waits, as if it was due now."""
        job.due, job.ticket = now, 0

    def take(self, now: float) -> ReadJob | None:
        """Remove and return the job that goes next, None where none is due."""
        heap = self._next_heap(now)
        if heap is None:
            return None
        job = heapq.heappop(heap)[2]
        job.ticket = 0
        self._before_turn = self._turn, self._wanted_from
        self._turn = (self._turn + 1) % _TURNS
        if heap is self._wanted:
            packet = block_time(job.block) / len(job.block.requests)
            self._wanted_from = now + (1 + _OTHERS_BESIDE_WANTED) * packet
        return job

    def undo_turn(self) -> None:
        """Let the job that was taken last not count: it does not go on the line now."""
        self._turn, self._wanted_from = self._before_turn

    def first(self, now: float) -> ReadJob | None:
        """Return the job that goes next, None where none is due."""
        heap = self._next_heap(now)
        return None if heap is None else heap[0][2]

    def next_due(self) -> float:
        """Return when the next job is due (clock value in s), infinite for never."""
        return min((heap[0][0] for heap in self._heaps_due(math.inf)), default=math.inf)

    def _next_heap(self, now: float) -> list[_QueueEntry] | None:
        """Return the heap that begins with the job that goes next."""
        due = self._heaps_due(now)
        if len(due) > 1 and due[0] is self._wanted:
            if now >= self._wanted_from:
                return self._wanted
            del due[0]
        if len(due) < 2:
            return due[0] if due else None
        latest = max(due, key=lambda heap: self._periods_late(heap[0], now))
        if self._turn and self._periods_late(latest[0], now) > 1:
            return latest
        return min(due, key=lambda heap: heap[0][0] + self._period(heap[0][2]))

    def _period(self, job: ReadJob) -> float:
        return job.block.period or PATIENCE * self._poll_cycle

    def _periods_late(self, entry: _QueueEntry, now: float) -> float:
        due, _, job = entry
        return (now - due) / self._period(job)

    def _heaps_due(self, now: float) -> list[list[_QueueEntry]]:
        """Return the heaps that begin with a job that is due, each with a valid entry."""
        heaps = []
        for heap in self.heaps.values():
            while heap and heap[0][1] != heap[0][2].ticket:
                heapq.heappop(heap)
            if heap and heap[0][0] <= now:
                heaps.append(heap)
        return heaps
