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


"""The symbols of the target, out of the bytes that come in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from abdf1_ros.conform import codec
from abdf1_ros.conform.codec import BlockCheck, Symbol, SymbolKind

# Longest time (s) of a symbol that has begun. On a slow line, it is the time of the longest frame.
_FRAME_TIME = 3.0
_LONGEST_FRAME = 1000  # bytes; twice the largest packet, if every byte of it is doubled

_MOST_UNREAD = 65536


class SymbolReader:
    """
    Read symbols from a line, whose bytes ``read`` returns: those that come within a time (s).

    ``char_time`` is seconds a byte, 0 for a line without a speed. ``has_heard`` tells whether any
    byte came.
    """

    def __init__(self, read: Callable[[float], bytes], clock: Callable[[], float],
                 check: BlockCheck, *, is_half_duplex: bool, char_time: float) -> None:
        self.has_heard = False
        self._read = read
        self._clock = clock
        self._check = check
        self._is_half_duplex = is_half_duplex
        self._longest = max(_FRAME_TIME, _LONGEST_FRAME * char_time)
        self._buffer = b''
        self._begun = 0.0  # when the symbol in the buffer began to come in

    def symbol(self, end: float) -> Symbol | None:
        """
        Return the next symbol, with its time; None if no byte has come by ``end`` (clock value).

        A symbol that has begun is waited for, but not for ever: then its bytes are noise.
        """
        while True:
            symbol = codec.next_symbol(self._buffer, self._check, self._is_half_duplex)
            if symbol is not None:
                return self._taken(symbol)
            limit = max(end, self._begun + self._longest) if self._buffer else end
            left = limit - self._clock()
            if left <= 0:
                noise = Symbol(SymbolKind.NOISE, self._buffer)
                return self._taken(noise) if self._buffer else None
            self.wait(left)

    def wait(self, seconds: float) -> None:
        """Wait for bytes, and keep them for the next symbol."""
        data = self._read(seconds)
        self.has_heard = self.has_heard or bool(data)
        if not self._buffer:
            self._begun = self._clock()
        self._buffer = (self._buffer + data)[-_MOST_UNREAD:]

    def _taken(self, symbol: Symbol) -> Symbol:
        """Return a symbol with its time, without its bytes in the buffer."""
        now = self._begun = self._clock()
        self._buffer = self._buffer[len(symbol.raw):]
        return replace(symbol, at=now)
