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
Unconfirmed writes: the next read of their words shows what the PLC holds.

The results of such a write wait for that read, at most as long as a write may wait for the line.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
import math

from abdf1_ros.driver.job_tasks import LineTime
from abdf1_ros.driver.record import Claim, WriteListener
from abdf1_ros.driver.write import Write, WriteResult
from abdf1_ros.plan.planner import Block


class ReadBacks(WriteListener):
    """
    The writes that wait to be read back, for ``patience`` seconds at most.

    ``report`` gets their results, ``line`` has the time. ``next_expiry`` is when the first write
    will have waited too long (clock value in s), infinite for never. Only the link thread may use
    this object.
    """

    def __init__(self, line: LineTime, patience: float,
                 report: Callable[[WriteResult], None]) -> None:
        self._line = line
        self._patience = patience
        self._report = report
        # the result of each write, and when it came (clock value in s)
        self._waiting: dict[Write, tuple[WriteResult, float]] = {}
        self.next_expiry = math.inf

    def add(self, write: Write, result: WriteResult, blocks: Iterable[Block]) -> None:
        """Take a write that ends unconfirmed; report at once if no block reads its words."""
        now = self._line.now
        if any(block.extent.holds(write.mapping.extent) for block in blocks):
            self._waiting[write] = result, now
            self._plan()
        else:
            self._tell(write, result, 'not read back: no row reads all of these words', now)

    def words_read(self, block: Block, data: bytes, started: float) -> None:
        """Compare the data of a block; its read began at ``started`` (clock value, s)."""
        for write, (_, since) in [*self._waiting.items()]:
            if started >= since and block.extent.holds(write.mapping.extent):
                is_held = write.is_held(data[block.slice_of(write.mapping)])
                which = 'the value' if is_held else 'another value'
                self._end(write, f'read back: the PLC holds {which}', self._line.now)

    def write_begins(self, claim: Claim) -> None:
        """End the writes whose words a newer write changes; it is sent now."""
        for write in [*self._waiting]:
            if claim.meets(write.mapping.extent):
                self._end(write, 'not read back: a newer write of these words has gone out',
                          claim.begun)

    def expire(self, now: float) -> None:
        """End the writes that have waited too long."""
        for write, (_, since) in [*self._waiting.items()]:
            if now >= since + self._patience:
                self._end(write, f'not read back within {self._patience:g} s', now)

    def end(self, now: float) -> None:
        """End all writes: the port is lost."""
        for write in [*self._waiting]:
            self._end(write, 'not read back before the line went down', now)

    def _end(self, write: Write, finding: str, now: float) -> None:
        result, _ = self._waiting.pop(write)
        self._plan()
        self._tell(write, result, finding, now)

    def _plan(self) -> None:
        _, first = next(iter(self._waiting.values()), (None, math.inf))
        self.next_expiry = first + self._patience

    def _tell(self, write: Write, result: WriteResult, finding: str, now: float) -> None:
        found = replace(result, detail=f'{result.detail}; {finding}')
        for each in found.of(write.origins, now):
            self._report(each)
