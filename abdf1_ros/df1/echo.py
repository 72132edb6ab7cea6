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
What comes back of what we have sent: TX and RX are connected, or the adapter echoes.

A line that echoes gives back all that is sent, in its order, and before anybody can have
answered. So a message that is byte for byte one of ours which has not come back yet is ours,
not a PLC's. When an ACK that cannot be ours comes after a message of ours has left, and that
has not come back before, the line does not echo: an equal message that comes later is a PLC's.
Where nobody can tell, it counts as ours, once: a PLC that gets no response sends it again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from abdf1_ros.df1.frames import beginning_of, Control, Symbol

COMES_BACK = ('what is sent comes back: TX and RX are connected, or the adapter echoes; look at '
              'the cable, and behind an adapter that echoes use half duplex')

# Frames that may not have come back yet: what is sent in some seconds, at the shortest Timeout.
_MOST_EXPECTED = 64

# After so many messages that have not come back the echo has ended. It may only be late: device
# servers are far away, and Timeout is short.
_MOST_MISSING = 8

# The first bytes of a frame, which tell it from an answer.
_HEAD = 2

_CONTROL_SIZE = 2


class LineEcho:
    """
    Know the echo of one line; ``is_heard`` tells that it gives back what is sent.

    Where it is ``bytewise``, an echo that has been heard once is taken off byte by byte, so that
    damage in it does no harm. That is for the master of a half-duplex line: nobody else speaks
    while he does.
    """

    def __init__(self, bytewise: bool) -> None:
        self.is_heard = False
        self._is_bytewise = bytewise
        self._expected: deque[tuple[int, bytes]] = deque(maxlen=_MOST_EXPECTED)
        self._at = 0  # bytewise: so much of the first of them has come

    @property
    def is_expected(self) -> bool:
        """Tell whether something that was sent on a line with an echo has not come back."""
        return self.is_heard and bool(self._expected)

    def sent(self, frame: bytes, end: int) -> None:
        """Take note of a frame on its way; ``end`` is the position of its last byte."""
        if self._is_bytewise and not self.is_heard:
            self._expected.clear()  # only a question tells, not the ACK before it
        elif self._missing() >= _MOST_MISSING:
            self.is_heard = False
        self._expected.append((end, frame))

    def withdrawn(self) -> None:
        """Take note that the last frame does not go out after all."""
        self._expected.pop()

    def forget(self) -> None:
        """Expect nothing to come back."""
        self.is_heard, self._at = False, 0
        self._expected.clear()

    def is_ours(self, symbol: Symbol, has_left: Callable[[int], bool]) -> bool:
        """
        Tell whether a symbol is our own, and nobody's answer; ``has_left`` knows positions.

        ACK, NAK and ENQ are alike whoever sends them: they are ours only where an echo is known.
        """
        if not self._expected or (self._is_bytewise and self.is_heard):
            return False
        beginning = beginning_of(symbol)
        number = next((number for number, (_, frame) in enumerate(self._expected)
                       if beginning and frame.startswith(beginning)), None)
        if number is None:
            if symbol is Control.ACK and not self._is_bytewise:
                self._is_acknowledged(has_left)
            return False
        passed = [self._expected.popleft()[1] for _ in range(number + 1)]
        if not isinstance(symbol, Control):
            self.is_heard = True
        elif any(len(frame) > _CONTROL_SIZE for frame in passed):
            self.is_heard = False  # a message of ours would have come before it
        return self.is_heard

    def _is_acknowledged(self, has_left: Callable[[int], bool]) -> None:
        """Conclude from an ACK that what has left does not come back any more."""
        while self._expected and has_left(self._expected[0][0]):
            _, frame = self._expected.popleft()
            if len(frame) > _CONTROL_SIZE:
                self.is_heard = False

    def _missing(self) -> int:
        """Return how many messages have not come back yet."""
        return sum(len(frame) > _CONTROL_SIZE for _, frame in self._expected)

    def taken_off(self, data: bytes) -> bytes:
        """
        Return ``data`` without the echo, on a line that has one and is ``bytewise``.

        The first two bytes of a frame tell it from an answer: what comes in their place shows that
        the line does not echo any more. Damage in the rest is passed over.
        """
        while self._is_bytewise and self.is_expected and data:
            frame, at = self._expected[0][1], self._at
            if not data.startswith(frame[at:_HEAD][:len(data)]):
                self.forget()
                return frame[:at] + data
            self._at = min(at + len(data), len(frame))
            data = data[self._at - at:]
            if self._at == len(frame):
                self._expected.popleft()
                self._at = 0
        return data
