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
Where that is unknown, it counts as ours, once: a PLC that gets no response sends it again.
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

_CONTROL_SIZE = 2


class LineEcho:
    """
    Know the echo of one line; ``is_heard`` tells that it gives back what is sent.

    In half duplex everybody waits until what he has sent has come back, before he sends again.
    """

    def __init__(self, is_half_duplex: bool) -> None:
        self.is_heard = False
        self._is_half_duplex = is_half_duplex
        self._expected: deque[tuple[int, bytes]] = deque(maxlen=_MOST_EXPECTED)

    def sent(self, frame: bytes, end: int) -> None:
        """Take note of a frame on its way; ``end`` is the position of its last byte."""
        if self._is_half_duplex and not self.is_heard:
            self._expected.clear()
        elif sum(map(_is_message, self._expected)) >= _MOST_MISSING:
            self.is_heard = False
        self._expected.append((end, frame))

    def withdrawn(self) -> None:
        """Take note that the last frame does not go out after all."""
        self._expected.pop()

    def forget(self) -> None:
        """Expect nothing to come back."""
        self.is_heard = False
        self._expected.clear()

    def take_ours(self, symbol: Symbol, has_left: Callable[[int], bool]) -> bool:
        """
        Take a symbol; tell whether it is our own. ``has_left`` knows positions.

        ACK, NAK and ENQ are alike whoever sends them: they are ours only where an echo is known.
        """
        if not self._expected:
            return False
        beginning = beginning_of(symbol)
        number = next((number for number, (_, frame) in enumerate(self._expected)
                       if beginning and frame.startswith(beginning)), None)
        if number is None:
            if symbol is Control.ACK:
                while self._expected and has_left(self._expected[0][0]):
                    self.is_heard &= not _is_message(self._expected.popleft())
            return False
        passed = [self._expected.popleft() for _ in range(number + 1)]
        if not isinstance(symbol, Control):
            self.is_heard = True
        elif any(map(_is_message, passed)):
            self.is_heard = False  # a message of ours would have come before it
        return self.is_heard


def _is_message(sent: tuple[int, bytes]) -> bool:
    return len(sent[1]) > _CONTROL_SIZE
