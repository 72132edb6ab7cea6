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
The real speed of a line, measured from what is sent and heard on it.

Two facts are used. An exchange cannot end before its characters have passed: where most exchanges
do, the line is faster than its setting. And the bytes of a long message follow each other as fast
as its sender and the line can send: where even the fastest of several messages is slower than the
setting, the line is slower. Both need many samples, because an operating system or an adapter may
hold bytes back, and because an answer may be a late one.
"""

from __future__ import annotations

# Samples of each kind before there is a result, and before there is a new one.
EXCHANGES = 32
MESSAGES = 16

# A message is long that has so many characters after its first bytes.
LONG_MESSAGE = 32

# A smaller difference may come from clocks and from the time of waking up.
_FASTER = 1.25
_SLOWER = 0.75


class LineRate:
    """
    The rate of a line on which a character should take ``char_time`` seconds.

    Where it ``is_half_duplex``, nothing is received while something is sent.

    ``seen`` is the measured rate in multiples of the set one, None while both agree. Above 1 it is
    a lower limit; below 1 it is the rate of the bytes of messages.
    """

    def __init__(self, char_time: float, is_half_duplex: bool = True) -> None:
        self.seen: float | None = None
        self._char_time = char_time
        self._is_half_duplex = is_half_duplex
        self._asked: float | None = None
        self._sent = 0
        self._heard = 0
        self._exchanges = 0
        self._fast: list[float] = []
        self._messages: list[float] = []

    def sent(self, characters: int, heard: int, now: float) -> None:
        """Take note of sent characters that want an answer; ``heard`` counts received ones."""
        if self._asked is None:
            self._asked, self._sent, self._heard = now, 0, heard
        self._sent += characters

    def answered(self, heard: int, now: float) -> None:
        """Take note that the last character of an answer has come."""
        if self._asked is None:
            return
        seconds, self._asked = now - self._asked, None
        self._exchanges += 1
        passed = self._sent + (heard - self._heard if self._is_half_duplex else 0)
        needed = passed * self._char_time
        if needed > _FASTER * seconds:
            self._fast.append(needed / max(seconds, 1e-6))
        if self._exchanges < EXCHANGES:
            return
        if 2 * len(self._fast) > EXCHANGES:
            self.seen = sorted(self._fast)[len(self._fast) // 2]
        elif self.seen is not None and self.seen > 1:
            self.seen = None
        self._exchanges, self._fast = 0, []

    def message(self, characters: int, seconds: float) -> None:
        """Take note of a message: ``characters`` came in the ``seconds`` after its first bytes."""
        if characters < LONG_MESSAGE:
            return
        self._messages.append(characters * self._char_time / max(seconds, 1e-6))
        if len(self._messages) < MESSAGES:
            return
        best = max(self._messages)
        if best < _SLOWER:
            self.seen = best
        elif self.seen is not None and self.seen < 1:
            self.seen = None
        self._messages = []

    def forget(self) -> None:
        """Start again: it may be another line."""
        self.seen, self._asked = None, None
        self._exchanges, self._fast, self._messages = 0, [], []
