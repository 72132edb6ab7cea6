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

"""Messages that are sent in portions, so that responses can be sent between two portions."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
import math

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import DLE, ETX, STX

# Line time (s) of a portion of a message. The next portion is given out when the second time (s)
# is left of it. So a response waits for one portion at most, and a thread that is a little late
# leaves no gap.
_AHEAD = 0.03
_LEFT = 0.015

_LEAST_PORTION = 16  # characters


class Outgoing:
    """
    Give a message out in portions, each of whole symbols.

    A response may be embedded only between two data symbols (M 4-3). It must not divide a DLE and
    its partner, or the data and DLE ETX with its check. ``char_time`` is seconds per character. If
    it is 0, or the message is short, the whole message is given out at once. ``due`` is when to
    call ``next`` (clock value in s), None for never.
    """

    def __init__(self, checksum: Checksum, char_time: float) -> None:
        self.due: float | None = None
        self.size = 0
        self._check_size = checksum.size
        self._char_time = char_time
        self._portion = max(_LEAST_PORTION, math.ceil(_AHEAD / char_time)) if char_time else 0
        self._kept: deque[bytes] = deque()
        self._busy_until = 0.0

    @property
    def can_embed(self) -> bool:
        """Tell whether what has been given out so far ends between two data symbols."""
        return len(self._kept) > 1

    def put(self, frame: bytes, free: float) -> bytes:
        """Return the part of a frame to send at once; the line is busy until ``free``."""
        if not self._kept:
            if not frame.startswith(STX) or not 0 < self._portion < len(frame):
                return frame
            self._busy_until = free
        self._kept.extend(self._symbols(frame))
        self.size += len(frame)
        return b'' if self.due is not None else self.next(free)

    def next(self, now: float) -> bytes:  # noqa: A003
        """Return the next portion."""
        portion = bytearray()
        while self._kept and len(portion) < self._portion:
            portion += self._kept.popleft()
        if len(self._kept) == 1:  # DLE ETX and its check: no response may be sent before them
            portion += self._kept.popleft()
        self.size -= len(portion)
        self._busy_until = max(self._busy_until, now) + len(portion) * self._char_time
        self.due = self._busy_until - _LEFT if self._kept else None
        return bytes(portion)

    def clear(self) -> None:
        """Forget all portions that have not been given out."""
        self._kept.clear()
        self.due, self.size = None, 0

    def _symbols(self, frame: bytes) -> Iterator[bytes]:
        """Yield the parts that must not be divided; a frame that is not a message is one part."""
        end = len(frame) - len(ETX) - self._check_size
        if not frame.startswith(STX):
            yield frame
            return
        yield STX
        at = len(STX)
        while at < end:
            size = 2 if frame[at:at + 1] == DLE else 1
            yield frame[at:at + size]
            at += size
        yield frame[end:]
