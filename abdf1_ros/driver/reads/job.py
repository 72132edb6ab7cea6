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

"""A block that is read again and again, in one or more packets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
import math
from typing import NamedTuple

from abdf1_ros.df1.machine import MOST_LATE
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.tasks import LineTime
from abdf1_ros.driver.job_tasks import Job
from abdf1_ros.driver.reads.point import ReadPoint, SMOOTHING
from abdf1_ros.errors import Abdf1Error
from abdf1_ros.pccc.dialect import Request, Steps
from abdf1_ros.pccc.steps import words_in
from abdf1_ros.plan.planner import Block


class ReadTooOld(Abdf1Error):
    """The words of one read differ too much in age; the whole block is due again."""


class Intervals:
    """
    The seconds between good reads: the ``last`` ones, the ``usual`` and the ``longest``.

    An outage of the station does not count.
    """

    def __init__(self) -> None:
        self.last: float | None = None
        self.usual: float | None = None
        self.longest: float | None = None
        self._since: float | None = None

    def good_read(self, now: float) -> None:
        """Record a good read."""
        if self._since is not None:
            self.last = now - self._since
            self.longest = max(self.last, self.longest or 0.0)
            usual = self.last if self.usual is None else self.usual
            self.usual = usual + SMOOTHING * (self.last - usual)
        self._since = now

    def outage(self) -> None:
        """Record that a read has failed."""
        self.last = self._since = None


class _PacketRead(NamedTuple):
    """One request of a block, the size of its reply, and the way to decode the reply."""

    command: Request
    reply_size: int
    words_in: Callable[[Packet], bytes]


class ReadJob(Job):
    """
    A block to be read again and again, and the place of the words of each of its ``points``.

    Times are clock values (s).

    - ``due``: when the block is due.
    - ``refreshed``: when a write last changed words of the block; minus infinity after a later
      read.
    - ``wanted``: when a call last asked for the block; minus infinity after a read if no call
      waits for another one.
    - ``started``: when the read under way, or the last one, began.
    - ``asked``: when its last packet was sent.
    - ``passed``: when the last good read ended, minus infinity before the first.
    - ``longest_read``: seconds within which all packets of a read have to come.
    - ``is_unfinished``: some packets of a read have come, but not all, or the last read was too
      old.
    - ``is_whole``: its last packet has come.
    - ``ticket``: number of its valid entry in the queue, 0 for none.
    - ``take``: called at the end of each packet, with the words after the last packet of a read,
      or with the error.
    """

    def __init__(self, block: Block, points: Sequence[ReadPoint], line: LineTime,
                 take: Callable[[ReadJob, bytes | None, Exception | None], None],
                 longest_read: float) -> None:
        self.block = self.key = block
        self.station = block.station
        self.extent = block.extent
        self.points = {point: block.slice_of(point.mapping) for point in points}
        self.intervals = Intervals()
        self.due = self.started = self.asked = 0.0
        self.refreshed = self.wanted = self.passed = -math.inf
        self.is_on_demand = block.mappings[0].is_on_demand
        self.is_unfinished = False
        self.ticket = 0
        self.longest_read = longest_read
        self._late = 0.0  # ``Machine.late`` when the read began
        self._line = line
        self._take = take
        self._packets = _packet_reads(block)  # needed at every read, and always the same
        self._words: list[bytes] = []
        self.reply_size = self._packets[0].reply_size

    @property
    def is_begun(self) -> bool:
        """Tell whether some packets of a read have come that are still good."""
        return bool(self._words)

    @property
    def is_whole(self) -> bool:  # type: ignore[override]
        return len(self._words) == len(self._packets)

    def steps(self, now: float) -> Steps[None]:
        """Read one packet; raises LinkError, ReadTooOld, and the errors of ``words_in``."""
        self.asked, number = now, len(self._words)
        if not number:
            self.started, self._late = now, self._line.late
        packet = self._packets[number]
        self._words.append(packet.words_in((yield packet.command)))
        # The process may have stood still since the first command, or other commands may have had
        # the line too long. Then words of one value differ too much in age.
        stood_still, spent = self._line.late - self._late, self._line.now - self.started
        if stood_still > MOST_LATE:
            raise ReadTooOld(f'this process, or its host, stood still for {stood_still:.1f} s')
        if len(self._packets) > 1 and spent > self.longest_read:
            raise ReadTooOld(
                f'its packets took {spent:.1f} s, more than {self.longest_read:.1f} s')

    def ended(self, error: Exception | None) -> None:
        """Hand the packet on; after an error the next read begins anew."""
        words = None
        if error is None and len(self._words) == len(self._packets):
            words = b''.join(self._words)
        if error is not None or words is not None:
            self._words.clear()
        self.is_unfinished = bool(self._words) or isinstance(error, ReadTooOld)
        self.reply_size = self._packets[len(self._words)].reply_size
        self._take(self, words, error)

    def done(self, now: float) -> None:
        """Record a good read."""
        if self.started >= self.refreshed:
            self.refreshed = -math.inf
        self.passed = now
        self.intervals.good_read(now)

    def interrupted(self) -> None:
        """Record that a read has failed: the next one begins anew."""
        self.intervals.outage()
        self._words.clear()
        self.is_unfinished = False
        self.reply_size = self._packets[0].reply_size


def _packet_reads(block: Block) -> list[_PacketRead]:
    dialect = block.dialect
    return [_PacketRead(
        dialect.read(request.start, request.words, block.transfer),
        dialect.reply_size(request.start, request.words),
        partial(words_in, start=request.start, words=request.words, dialect=dialect))
        for request in block.requests]
