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
each block is read within its period as long as the line is fast enough. When the line is too slow,
and a read is late by more than its period, three of four turns go to the read that is the most
periods late. So all periods become longer by about the same factor: many slow reads do not make
the fast ones as slow as themselves. The fourth turn still goes to the earliest deadline: a period
that no line can keep does not block the others.

A block of several packets is in the queue once for each packet, so other reads wait for one packet
at most. A read without a period is due again as soon as it has begun. It gets the time that the
others leave: its period counts as four times the time of reading everything once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
import heapq
import itertools
import math

from abdf1_ros.df1.machine import MOST_LATE
from abdf1_ros.driver.job_tasks import Job, LineTime
from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.steps import words_in
from abdf1_ros.plan.forecast import PATIENCE, poll_cycle
from abdf1_ros.plan.planner import Block

_TURNS = 4
_MOST_ENTRIES = 4  # for each read


class ReadJob(Job):
    """
    A block to be read again and again, and the points it serves.

    ``due`` is the clock value (s) from which it wants the line. ``interval`` is the seconds
    between its last two good reads and ``longest`` the greatest of these; an outage of the
    station does not count. ``is_refresh`` tells that a write has changed words of the block, the
    last time at ``refreshed``. ``started`` is when the read under way or the last one began, and
    ``late`` was ``Machine.late`` then; its last packet was ``asked`` for. All packets of a read
    have to come within ``longest_read`` seconds. ``is_under_way`` tells that there are packets
    already, and more to come, ``is_to_repeat`` that the last read was dropped. ``ticket`` is the
    number of its valid entry in the queue. ``take`` is called at the end of each packet.
    """

    def __init__(self, block: Block, points: Sequence[ReadPoint], line: LineTime,
                 take: Callable[[ReadJob, Exception | None], None],
                 longest_read: float = math.inf) -> None:
        self.block = block
        self.station = block.station
        self.points = tuple(points)
        # Needed at every read, and always the same.
        self._commands = block.commands()
        self._dialect = block.dialect
        self.extent = block.extent
        self._reply_sizes = block.reply_sizes()
        self.reply_size, self.is_under_way = self._reply_sizes[0], False
        self.slices = [block.slice_of(point.mapping) for point in points]
        self.heartbeats = [(mapping, block.slice_of(mapping)) for mapping in block.mappings
                           if mapping.heartbeat]
        self.due = 0.0
        self.interval: float | None = None
        self.longest: float | None = None
        self.is_refresh = False
        self.refreshed = -math.inf
        self.started = self.asked = 0.0
        self.late = 0.0
        self.is_to_repeat = False
        self._line = line
        self._take = take
        self._longest_read = longest_read
        self.ticket = 0
        self._last_done: float | None = None
        self._packets: list[bytes] = []

    def steps(self, now: float) -> Steps[None]:
        """Read one packet; raises LinkError, and like ``words_in``."""
        self.asked, number = now, len(self._packets)
        if not number:
            self.started, self.late, self.is_to_repeat = now, self._line.late, False
        reply = yield self._commands[number]
        request = self.block.requests[number]
        self._packets.append(words_in(reply, request.start, request.words, self._dialect))

    def ended(self, error: Exception | None) -> None:
        """Let the packet be made use of; after an error the next read begins anew."""
        if error is not None:
            self._forget()
        self._take(self, error)

    def data(self) -> bytes | None:
        """Return all words after the last packet, None before."""
        if len(self._packets) < len(self._commands):
            self.reply_size, self.is_under_way = self._reply_sizes[len(self._packets)], True
            return None
        data = b''.join(self._packets)
        self._packets.clear()
        self.reply_size, self.is_under_way = self._reply_sizes[0], False
        return data

    def why_too_old(self) -> str:
        """
        Return why the data of this read must be dropped, empty where they are good.

        Since its first command this process has stood still, or other commands had the line for so
        long that words of one value differ too much in age.
        """
        stood_still = self._line.late - self.late
        if stood_still > MOST_LATE:
            return f'this process, or its host, stood still for {stood_still:.1f} s'
        spent = self._line.now - self.started
        if len(self._commands) > 1 and spent > self._longest_read:
            return f'its packets took {spent:.1f} s, more than {self._longest_read:.1f} s'
        return ''

    def begin_anew(self) -> None:
        """Drop the packets that were read; the whole block is due again."""
        self._forget()
        self.is_to_repeat = True

    def _forget(self) -> None:
        self._packets.clear()
        self.reply_size, self.is_under_way = self._reply_sizes[0], False

    def done(self, now: float) -> None:
        """Take note of a good read."""
        self.is_refresh = self.started < self.refreshed
        if self._last_done is not None:
            self.interval = now - self._last_done
            self.longest = max(self.interval, self.longest or 0.0)
        self._last_done = now

    def interrupted(self) -> None:
        """Take note that a read has failed: no interval spans an outage."""
        self.interval = self._last_done = None
        self._forget()


_QueueEntry = tuple[float, int, ReadJob]
"""When a job is due, the ticket of the entry, and the job."""


class ReadQueue:
    """
    All read jobs, those of one period in the order in which they are due.

    ``jobs`` are all of them, also those that are set aside or under way.
    """

    def __init__(self) -> None:
        self.jobs: set[ReadJob] = set()
        self._poll_cycle = 0.0
        self._heaps: dict[float, list[_QueueEntry]] = {}
        self._tickets = itertools.count(1)
        self._turn = 0

    def __bool__(self) -> bool:
        """Tell whether a job waits, due or not."""
        return any(self._heaps.values())

    def replace(self, old: Iterable[ReadJob], new: Iterable[ReadJob], now: float) -> None:
        """Forget ``old`` jobs and add ``new`` ones, all due at once."""
        added, old = list(new), list(old)
        for job in old:
            job.ticket = 0  # of no entry
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
        heap = self._heaps.setdefault(job.block.period, [])
        heapq.heappush(heap, (due, job.ticket, job))
        if len(heap) > _MOST_ENTRIES * len(self.jobs):
            # A refresh of a slow read leaves an old entry, which would stay until it had been due.
            heap[:] = (entry for entry in heap if entry[1] == entry[2].ticket)
            heapq.heapify(heap)

    def take(self, now: float) -> ReadJob | None:
        """Remove and return the job that goes next, None where none is due."""
        heap = self._next_heap(now)
        self._turn = (self._turn + 1) % _TURNS
        return None if heap is None else heapq.heappop(heap)[2]

    def first(self, now: float) -> ReadJob | None:
        """Return the job that goes next, None where none is due."""
        heap = self._next_heap(now)
        return None if heap is None else heap[0][2]

    def next_due(self) -> float | None:
        """Return when the next job is due (clock value in s), None for never."""
        return min((heap[0][0] for heap in self._heaps_due(math.inf)), default=None)

    def _next_heap(self, now: float) -> list[_QueueEntry] | None:
        """Return the heap that begins with the job that goes next."""
        due = self._heaps_due(now)
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
        for heap in self._heaps.values():
            while heap and heap[0][1] != heap[0][2].ticket:
                heapq.heappop(heap)
            if heap and heap[0][0] <= now:
                heaps.append(heap)
        return heaps
