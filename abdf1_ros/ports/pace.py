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

"""Pauses for a connection that brings bytes faster than they can be worked on."""

from __future__ import annotations

from collections.abc import Callable
import math

# A useless symbol costs up to 18 us a byte. After a portion, this thread leaves the processor to
# other lines for this many times the time that the portion took. But the pause ends when a line
# would have transmitted the bytes.
_OTHERS = 19

_FASTEST = 10 / 115200  # s per character, if the line has no speed


# A burst becomes a flood after this number of bytes: several of the longest messages. What a
# device server has kept longer is too old to be of use.
_FLOOD = 4096
# The bytes of a flood are only dropped. So up to this number of bytes the rests may be shorter:
# a megabyte of old bytes is over soon, and a flood that goes on for ever leaves time to others.
_OLD_BYTES = 4_000_000
_OTHERS_WHILE_DROPPED = 4


class Pace:
    """
    The rests between the portions of a burst.

    A serial line cannot send such a burst, but a connection to a broken or hostile server can.
    Without rests, the burst would use a whole processor, and keep the interpreter lock from the
    other lines of this process. A burst that ends is processed in the time that it would have
    taken on the line. This time ends at ``line_until`` (clock value, s; minus infinity for no
    burst). ``taken`` is the number of its bytes.
    """

    def __init__(self, clock: Callable[[], float], processor_clock: Callable[[], float]) -> None:
        self.line_until = -math.inf
        self.taken = 0
        self._clock = clock
        self._processor_clock = processor_clock
        self._worked = 0.0  # processor time (s) up to the last portion

    @property
    def is_flood(self) -> bool:
        """Tell whether the next bytes of the burst are to be dropped."""
        return self.line_until > -math.inf and self.taken >= _FLOOD

    def rest_after(self, count: int, char_time: float, now: float) -> float:
        """Return how long (s) to rest after ``count`` characters that had come at ``now``."""
        if self.line_until == -math.inf:
            self.line_until, self.taken = now, 0
        others = _OTHERS_WHILE_DROPPED if _FLOOD <= self.taken < _OLD_BYTES else _OTHERS
        self.taken += count
        self.line_until += count * (char_time or _FASTEST)
        used = self._processor_clock() - self._worked
        return max(0.0, min(others * used, self.line_until - self._clock()))

    def go_on(self) -> None:
        """Begin to measure the processor time of the next portion."""
        self._worked = self._processor_clock()
