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

"""Send bytes on a line, at once or in portions, and know which bytes have left."""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Protocol

from abdf1_ros.counters import Counters
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.echo import LineEcho
from abdf1_ros.df1.frames import ACK, Duplex, NAK, Symbol
from abdf1_ros.df1.outgoing import Outgoing

Reflex = Callable[[Symbol], bytes]


class Outlet(Protocol):
    """The port, to which bytes are written."""

    def write(self, data: bytes) -> None:
        """Put bytes on the line, after all earlier bytes."""

    def unsent(self) -> int:
        """Return how many written bytes have not left yet, as far as this is known."""


class Sender:
    """
    Send the frames of one line, on which a character takes ``char_time`` seconds.

    If there is an outlet, a reflex and flushed bytes go to it. All other bytes are ``waiting`` for
    ``data_to_send``.

    - ``position``: number of bytes given out so far.
    - ``free_at``: when they have left, computed from their number (clock value in s).
    - ``embeds``: the far end embeds responses. A long message is then given out in portions, and a
      response is sent between two portions (M 4-3). Products do the same with Embedded Responses =
      Auto-detect.
    - ``send_before``: clock value (s). After it, call ``withdraw`` in place of ``data_to_send``.
    """

    def __init__(self, checksum: Checksum, duplex: Duplex, char_time: float,
                 counters: Counters) -> None:
        self.position = 0
        self.embeds = False
        self.send_before = math.inf
        self.echo = LineEcho(duplex is Duplex.HALF)
        self.outgoing = Outgoing(checksum, char_time)
        self._char_time = char_time
        self._counters = counters
        self.begin(-math.inf, None)
        self.waiting = b''
        self._fresh = b''  # the last frame of ``waiting``, to be sent before ``send_before``
        self._ahead = b''  # sent by a reflex, but not yet by the procedure

    def begin(self, now: float, outlet: Outlet | None) -> None:
        """Begin on a line that is free."""
        self.free_at = now
        self._write, self._unsent = (outlet.write, outlet.unsent) if outlet else (
            self._keep, lambda: 0)

    def clear(self) -> None:
        """Forget frames that have not been given out, and echoes that may come back."""
        self.waiting, self._ahead, self.send_before = b'', b'', math.inf
        self.outgoing.clear()
        self.embeds = False
        self.echo.forget()

    def put(self, frame: bytes, now: float, expires: float = math.inf) -> None:
        """Send a frame after all waiting bytes, unless a reflex has sent it already."""
        free = max(now, self.free_at)
        is_alone = not self.outgoing.size
        self._fresh = frame
        if self.embeds or not is_alone:
            self._fresh = self._given_out(frame, free)
        ahead, self._ahead = self._ahead, b''
        assert ahead in (b'', frame)
        if not ahead:
            self.waiting += self._fresh
        self.send_before = expires if is_alone else math.inf
        size = len(frame)
        self._counters.chars_sent += size
        self.position += size
        self.free_at = free + size * self._char_time
        self.echo.sent(frame, self.position)

    def _given_out(self, frame: bytes, free: float) -> bytes:
        """Return the part of a frame to send at once; the line is busy until ``free``."""
        if self.outgoing.can_embed and frame in (ACK, NAK):
            return frame  # after the portion of our message on the line, before the rest of it
        return self.outgoing.put(frame, free)

    def react(self, reflex: Reflex, symbol: Symbol) -> None:
        """Send the answer of a reflex to a symbol, unless other bytes still have to be sent."""
        if not self.waiting and not self.outgoing.size and (frame := reflex(symbol)):
            self._ahead = frame
            self._write(frame)

    def flush(self) -> None:
        """Hand out waiting bytes at once, so that they are on the line while other code works."""
        self._write(self.data_to_send())

    def _keep(self, data: bytes) -> None:
        self.waiting += data

    def data_to_send(self) -> bytes:
        """Return, once, the bytes to put on the line now."""
        data, self.waiting, self.send_before = self.waiting, b'', math.inf
        return data

    def next_portion(self, now: float) -> None:
        """Give out the next portion of a long message."""
        self.waiting += self.outgoing.next(now)

    def withdraw(self, now: float) -> None:
        """Take back the last frame, which has not been given out."""
        size = len(self._fresh) + self.outgoing.size
        self.waiting = self.waiting.removesuffix(self._fresh)
        self.outgoing.clear()
        self.echo.withdrawn()
        self._counters.chars_sent -= size
        self.position -= size
        self.free_at, self.send_before = now, math.inf

    @property
    def still_here(self) -> int:
        """Return how many bytes have not left yet, as far as the outlet knows."""
        return self.outgoing.size + len(self.waiting) + self._unsent()

    def has_left(self, position: int) -> bool:
        """Tell whether the bytes up to this ``position`` have left."""
        return self.position - self.still_here >= position

    def answered(self, now: float) -> None:
        """Conclude from an answer that all bytes have left, except bytes that are still here."""
        self.free_at = min(self.free_at, now + self.still_here * self._char_time)
