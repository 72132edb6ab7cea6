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
The echo of our own frames, where TX and RX are connected or the adapter echoes.

A line that echoes gives back all frames in their order, before any station can answer. So a
message is our echo if it equals a message that we sent and that has not come back yet. If a
foreign ACK arrives after our message has left, and before it has come back, the line does not
echo. An equal message that comes later is then from a PLC. As long as it is unknown whether the
line echoes, an equal message counts as our echo, once. If it was from a PLC, the PLC gets no
response and sends it again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from abdf1_ros.df1.frames import beginning_of, Control, Symbol

COMES_BACK = ('our own bytes come back: TX and RX are connected, or the adapter echoes; check '
              'the cable, or use half duplex with an adapter that echoes')

# Most frames that may not have come back yet: some seconds of sending with the shortest Timeout.
_MOST_EXPECTED = 64

# Number of messages without an echo after which the echo has ended. A few echoes may only be late,
# because device servers are far away and Timeout is short.
_MOST_MISSING = 8

_CONTROL_SIZE = 2


class LineEcho:
    """
    Recognize the echo of one line; ``is_heard`` tells that the line echoes.

    In half duplex, a node sends its next frame only after its last frame has come back.
    """

    def __init__(self, is_half_duplex: bool) -> None:
        self.is_heard = False
        self._is_half_duplex = is_half_duplex
        self._expected: deque[tuple[int, bytes]] = deque(maxlen=_MOST_EXPECTED)

    def sent(self, frame: bytes, end: int) -> None:
        """Record a frame on its way; ``end`` is the position of its last byte."""
        if self._is_half_duplex and not self.is_heard:
            self._expected.clear()
        elif sum(map(_is_message, self._expected)) >= _MOST_MISSING:
            self.is_heard = False
        self._expected.append((end, frame))

    def withdrawn(self) -> None:
        """Forget the last frame, because it is not sent after all."""
        self._expected.pop()

    def forget(self) -> None:
        """Expect nothing to come back."""
        self.is_heard = False
        self._expected.clear()

    def take_ours(self, symbol: Symbol, has_left: Callable[[int], bool]) -> bool:
        """
        Take a symbol; tell whether it is our own.

        ``has_left`` tells whether all bytes up to a position have left.

        An ACK, NAK or ENQ does not name its sender: it is ours only if an echo is known.
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
            self.is_heard = False  # no echo: one of our messages would have come back before it
        return self.is_heard


def _is_message(sent: tuple[int, bytes]) -> bool:
    return len(sent[1]) > _CONTROL_SIZE
