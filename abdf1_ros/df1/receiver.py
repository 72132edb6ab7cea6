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


"""The bytes that come in over a line: symbols of other nodes, and how long a message may take."""

from __future__ import annotations

import math
from typing import NamedTuple

from abdf1_ros.counters import Counters
from abdf1_ros.df1.accounting import count_unheard
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Control, Duplex, Frame, FrameDecoder, MAX_LINK_DATA, NOISE, Symbol
from abdf1_ros.df1.sender import Sender

# Longest time (s) that an operating system or a device server holds bytes of a frame back.
HELD_BACK = 0.1

# Pause, in characters, after which a message has ended or a line is quiet. The time that the
# equipment may hold bytes back is added.
QUIET_CHARACTERS = 20

# A message that has begun may take _SLOWEST times the time of its bytes at the set speed, but at
# most the time of _LONGEST characters. Two pauses are added. Without these limits, a station that
# sends very slowly, or never stops, would block the line for all other stations.
_SLOWEST = 4
_LONGEST = 2 * MAX_LINK_DATA


class _Incoming(NamedTuple):
    """
    The message that is coming in; ``number`` counts all messages up to it.

    ``begun`` is when its first bytes came (clock value in s). ``heard`` counts all bytes that had
    come from the line by then. ``is_in_time`` tells whether the message began before the deadline.
    """

    number: int = 0
    begun: float = 0.0
    heard: int = 0
    is_in_time: bool = False


class Receiver:
    """
    Receive the bytes of one line, on which a character takes ``char_time`` seconds.

    ``sender`` is the sender of the same node, whose bytes may come back as an echo. ``is_master``
    tells that the node is the master of a half-duplex line.

    - ``decoder``: makes symbols of the bytes.
    - ``last_heard``: when the last bytes came (clock value in s).
    - ``pause_limit``: longest pause (s) inside a frame.
    - ``flow_controls``: how many bytes 11 and 13 hex came, which software flow control swallows.
    """

    def __init__(self, sender: Sender, checksum: Checksum, duplex: Duplex, char_time: float,
                 counters: Counters, *, is_master: bool) -> None:
        self.decoder = FrameDecoder(checksum, duplex)
        self.last_heard = -math.inf
        self.flow_controls = 0
        self._sender = sender
        self._checksum = checksum
        self._is_half_duplex = duplex is Duplex.HALF
        self._is_master = is_master
        self._char_time = char_time
        self._counters = counters
        self.pause_limit = QUIET_CHARACTERS * char_time + HELD_BACK
        self._message = _Incoming()

    def count_unheard(self, data: bytes) -> None:
        """Count the symbols of bytes that came while a master does not listen."""
        self.decoder.feed(data)
        while (symbol := self.next_symbol()) is not None:
            count_unheard(symbol, self._checksum, self._counters)

    def drop(self, count: int) -> None:
        """Count bytes that came too fast to be of use."""
        self._counters.chars_received += count
        self.decoder.noise += count
        self.decoder.reset()

    def broken_off(self) -> Frame:
        """Return the message that has stopped, as broken off."""
        message = self.decoder.broken_off()
        self.decoder.reset()
        return message

    def next_symbol(self) -> Symbol | None:
        """
        Return the next symbol of another node, None if more bytes are needed.

        In full duplex the echo of our message is treated as noise: noise clears the last response
        (M 4-8). If the message was from a PLC after all, this PLC then repeats it.
        """
        echo = self._sender.echo
        while (symbol := self.decoder.next_symbol()) is not None:
            # A frame without a station number is from a slave, because a master sends none. Until
            # an echo has been heard, a control symbol is from a slave, too.
            is_slaves = self._is_master and (
                symbol.station is None if isinstance(symbol, Frame)
                else isinstance(symbol, Control) and not echo.is_heard)
            if is_slaves or not echo.take_ours(symbol, self._sender.has_left):
                break
            if isinstance(symbol, Frame) and not self._is_half_duplex:
                return NOISE
        return symbol

    def message_begun(self, now: float) -> float:
        """Return when the last message began to come in; ``now`` if it came in one piece."""
        is_known = self._message.number == self.decoder.begun
        return self._message.begun if is_known else now

    def began_in_time(self, now: float, due: float) -> bool:
        """
        Tell whether the message that is coming in began by ``due``.

        Call this after each read: the first call for a message sets the time of its begin.
        """
        if self._message.number != self.decoder.begun:
            self._message = _Incoming(
                self.decoder.begun, now, self._counters.chars_received, now <= due)
        return self._message.is_in_time

    @property
    def hears_until(self) -> float:
        """Return until when to hear the message that has begun (clock value in s), or -inf."""
        if not self.decoder.in_message:
            return -math.inf
        heard = self._counters.chars_received - self._message.heard
        characters = min(_SLOWEST * heard, _LONGEST)
        return min(self.last_heard + self.pause_limit, self._message.begun
                   + 2 * self.pause_limit + characters * self._char_time)
