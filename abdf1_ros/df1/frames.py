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
Frames and symbols: the bytes on the line.

Three functions encode frames. ``FrameDecoder`` decodes: it turns any bytes, in any chunks, into
symbols, and never raises. A control symbol is a pair DLE x. A data byte equal to DLE is doubled
(M 2-7), but check bytes are never doubled (M 3-5, 5-5).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum, IntEnum
from functools import cache
from typing import Final, NamedTuple

from abdf1_ros.df1.checksum import bcc, Checksum
from abdf1_ros.df1.packet import HEADER_SIZE

# Most bytes of unstuffed link data that we accept. The largest reply is 244 bytes after a header
# (M 7-30..7-40), and no known device sends more than this limit.
MAX_LINK_DATA = 261

# Most bytes that wait while a machine does not listen: some seconds of the fastest line. Further
# bytes are lost, as in a UART.
MAX_WAITING = 65536


class Code(IntEnum):
    """Control characters (M 2-6; NAK is 15 as in M 14-4, tables 2.A and 2.B misprint it)."""

    SOH = 0x01
    STX = 0x02
    ETX = 0x03
    EOT = 0x04
    ENQ = 0x05
    ACK = 0x06
    DLE = 0x10
    NAK = 0x15


_CODES = frozenset(Code)

DLE = bytes((Code.DLE,))
STX = bytes((Code.DLE, Code.STX))
ETX = bytes((Code.DLE, Code.ETX))
ACK = bytes((Code.DLE, Code.ACK))
NAK = bytes((Code.DLE, Code.NAK))
EOT = bytes((Code.DLE, Code.EOT))
ENQ = bytes((Code.DLE, Code.ENQ))
SOH = bytes((Code.DLE, Code.SOH))
_DATA_DLE = DLE + DLE


def stuff(data: bytes) -> bytes:
    """Double every DLE of ``data`` (M 2-7)."""
    return data.replace(DLE, _DATA_DLE)


def message_frame(data: bytes, checksum: Checksum) -> bytes:
    """Return the frame of a slave's or a full-duplex message around link ``data`` (M 5-2)."""
    check = checksum.encode(checksum.of_message(data))
    return STX + stuff(data) + ETX + check


def master_frame(station: int, data: bytes, checksum: Checksum) -> bytes:
    """Return the frame of a master's message to ``station`` (0-255) around ``data`` (M 5-2)."""
    check = checksum.encode(checksum.of_message(data, station))
    return _addressed(station) + stuff(data) + ETX + check


@cache
def _addressed(station: int) -> bytes:
    return SOH + stuff(bytes((station,))) + STX


@cache
def poll_frame(station: int) -> bytes:
    """Return the poll of ``station`` (0-254): its check is a BCC on every line (M 5-3)."""
    return ENQ + stuff(bytes((station,))) + bytes((bcc(b'', station),))


class FrameFault(Enum):
    """The reason why a received frame cannot be used."""

    BAD_CHECK = 'wrong check'
    TOO_SHORT = 'shorter than a header'
    TOO_LONG = 'longer than any message'
    NO_ETX = 'broken off before DLE ETX'


class Control(Enum):
    """DLE ACK, DLE NAK, DLE EOT, or (full duplex) DLE ENQ."""

    ACK = Code.ACK
    NAK = Code.NAK
    EOT = Code.EOT
    ENQ = Code.ENQ

    def __init__(self, code: Code) -> None:
        self.code = code


_CONTROLS = {pair: Control(Code(pair[1])) for pair in (ACK, NAK, EOT, ENQ)}


@dataclass(frozen=True, slots=True)
class Unknown:
    """A pair DLE x that is not a symbol, or not a symbol of this duplex; ``byte`` is x."""

    byte: int

    @property
    def is_misplaced(self) -> bool:
        """Tell whether the pair is a symbol of the opposite duplex (S0, message 2514)."""
        return self.byte in _CODES


# Bytes outside of any symbol since the last message. The decoder gives NOISE before a DLE ENQ,
# because the ENQ then asks for the response to bytes that we have not understood (M 4-8).
NOISE = Unknown(Code.DLE)


@dataclass(frozen=True, slots=True)
class Poll:
    """DLE ENQ STN BCC; ``valid`` tells whether the BCC is right."""

    station: int
    valid: bool


class Frame(NamedTuple):
    """
    A message frame, good or bad.

    ``data`` is the unstuffed link data. ``station`` is the STN of a master's frame, or None for
    any other frame. ``fault`` is None for a good frame.

    For a good frame or a BAD_CHECK, ``received`` and ``expected`` are the check as read and as
    computed. For a NO_ETX, ``received`` is the code after the DLE that interrupted the data. A
    frame ``has_stopped`` if its bytes stopped before its end. ``has_response`` tells that a
    response was embedded (M 4-3).
    """

    data: bytes
    station: int | None = None
    fault: FrameFault | None = None
    received: int = 0
    expected: int = 0
    has_response: bool = False
    has_stopped: bool = False


Symbol = Control | Unknown | Poll | Frame


def beginning_of(symbol: Symbol) -> bytes:
    """Return the bytes of a symbol up to its check; nothing where they are unknown."""
    if isinstance(symbol, Control):
        return bytes((Code.DLE, symbol.code))
    if isinstance(symbol, Poll):
        return poll_frame(symbol.station) if symbol.valid else b''
    if isinstance(symbol, Frame) and symbol.fault in (None, FrameFault.BAD_CHECK):
        start = STX if symbol.station is None else _addressed(symbol.station)
        return start + stuff(symbol.data) + ETX
    return b''


class Duplex(Enum):
    """
    The line discipline that gives DLE ENQ and DLE SOH their meaning (M 2-6..2-8).

    On a radio modem line there are only the messages of full duplex, and no other symbols.
    """

    HALF = 'half duplex'
    FULL = 'full duplex'
    RADIO = 'radio modem'


class Need(Enum):
    """The result of a step of the decoder that needs more bytes."""

    MORE = 'more bytes'


MORE: Final = Need.MORE

Decoded = Symbol | Need | None
"""The result of a step: a symbol, MORE if bytes are missing, or None if the next step follows."""


class Damaged(bytes):
    """
    Characters that the UART has found damaged, by parity or stop bit.

    A message with one of them is dropped, as with a bad check (M 4-7).
    """


class FrameDecoder:
    """
    Turn bytes into symbols.

    ``feed`` takes bytes, ``next_symbol`` gives the symbols one by one, ``reset`` forgets
    everything heard.

    - ``waiting``: bytes that are still to be read.
    - ``noise``: number of bytes outside of any symbol.
    - ``last_byte``: the last byte heard, for reports.
    - ``link_data``: link data received so far of the message that is coming in.
    - ``in_message``: True while a message has begun and not ended.
    - ``begun``: number of messages that have begun.
    """

    def __init__(self, checksum: Checksum, duplex: Duplex) -> None:
        self._checksum = checksum
        self._is_half_duplex = duplex is Duplex.HALF
        self._has_responses = duplex is Duplex.FULL
        self.waiting = bytearray()
        self.link_data = bytearray()
        self._step: Callable[[], Decoded] = self._idle
        self._station: int | None = None
        self.last_byte = 0
        self.noise = 0
        self._noise_told = 0
        self.in_message = False
        self.begun = 0
        self._is_damaged = False  # a character of the message that is coming in
        self._has_response = False

    @property
    def has_begun(self) -> bool:
        """Tell whether a symbol has begun and not ended."""
        return bool(self.waiting) or self._step != self._idle

    def reset(self) -> None:
        """Forget everything heard so far."""
        if self.waiting or self.in_message:
            self.noise += len(self.waiting) + self.in_message
            self.waiting.clear()
            self.in_message = False
        self._step = self._idle
        self.last_byte = 0

    def feed(self, data: bytes) -> None:
        """Take bytes from the line, in any chunks; keep at most ``MAX_WAITING`` unread bytes."""
        if isinstance(data, Damaged):
            self._take_damaged(data)
        elif data:
            self.waiting += data
            self.last_byte = data[-1]
            if len(self.waiting) > MAX_WAITING:
                self.noise += len(self.waiting) - MAX_WAITING
                del self.waiting[MAX_WAITING:]

    def _take_damaged(self, data: Damaged) -> None:
        self.last_byte = data[-1]
        if self.in_message:
            self._is_damaged = True
            if self._step == self._check:
                self.waiting += data  # it counts as a byte of the check
                return
        else:
            self._step = self._idle
        # Drop also the first half of a pair: the byte that follows is not its second half.
        self.noise += len(self.waiting) + len(data)
        self.waiting.clear()

    def broken_off(self) -> Frame:
        """Return the incomplete message as a frame, with the fault of a message that ends here."""
        data = bytes(self.link_data)
        if self._step != self._check:
            return Frame(data, self._station, FrameFault.NO_ETX, has_stopped=True)
        return Frame(data, self._station, FrameFault.BAD_CHECK,
                     int.from_bytes(self.waiting, 'little'),
                     self._checksum.of_message(data, self._station), has_stopped=True)

    def next_symbol(self) -> Symbol | None:
        """Return the next whole symbol, or None when more bytes are needed."""
        while self.waiting:
            result = self._step()
            if result is MORE:
                return None
            if result is not None:
                return result
        return None

    def _idle(self) -> Decoded:
        start = self.waiting.find(DLE)
        if start:
            skipped = len(self.waiting) if start < 0 else start
            self.noise += skipped
            del self.waiting[:skipped]
        if len(self.waiting) < 2:
            return MORE
        pair = bytes(self.waiting[:2])
        if self.noise != self._noise_told and pair == ENQ and not self._is_half_duplex:
            self._noise_told = self.noise
            return NOISE
        del self.waiting[:2]
        return self._begin(pair)

    def _begin(self, pair: bytes) -> Decoded:
        if pair == STX:
            self._begin_data(None)
        elif pair == SOH and self._is_half_duplex:
            self._step = self._soh_station
        elif pair == ENQ and self._is_half_duplex:
            self._step = self._poll_station
        elif pair == _DATA_DLE:
            self.noise += 1  # a data byte of a message; we missed its beginning
        else:
            return _CONTROLS.get(pair) or Unknown(pair[1])
        return None

    def _begin_data(self, station: int | None) -> None:
        self._step = self._link_data
        self.in_message, self._is_damaged, self._has_response = True, False, False
        self.begun += 1
        self._station = station
        self.link_data.clear()

    def _take_station(self, following: Callable[[], Decoded]) -> Decoded:
        """Read STN, which is stuffed like data (M 3-4), and go on to ``following``."""
        if self.waiting[0] != Code.DLE:
            self._station = self.waiting[0]
            del self.waiting[:1]
        elif len(self.waiting) < 2:
            return MORE
        elif self.waiting[1] == Code.DLE:
            self._station = int(Code.DLE)
            del self.waiting[:2]
        else:  # interrupted by another symbol
            self._step = self._idle
            return None
        self._step = following
        return None

    def _soh_station(self) -> Decoded:
        return self._take_station(self._soh_stx)

    def _poll_station(self) -> Decoded:
        # Some masters do not double STN 10 (hex): DLE ENQ 10 F0, where F0 is the BCC.
        if self.waiting[:2] == bytes((Code.DLE, bcc(DLE))):
            del self.waiting[:1]
            self._station = int(Code.DLE)
            self._step = self._poll_check
            return None
        return self._take_station(self._poll_check)

    def _poll_check(self) -> Poll:
        check = self.waiting.pop(0)
        self._step = self._idle
        assert self._station is not None
        return Poll(self._station, check == bcc(b'', self._station))

    def _soh_stx(self) -> Decoded:
        if self.waiting[0] != Code.DLE:
            self._step = self._idle
        elif len(self.waiting) < 2:
            return MORE
        elif self.waiting[1] == Code.STX:
            del self.waiting[:2]
            self._begin_data(self._station)
        else:
            self._step = self._idle
        return None

    def _link_data(self) -> Decoded:
        end = self.waiting.find(DLE)
        if end:
            self._take_data(len(self.waiting) if end < 0 else end)
        if len(self.waiting) < 2:
            return MORE
        pair = bytes(self.waiting[:2])
        if pair == ETX:
            del self.waiting[:2]
            self._step = self._check
            return self._check()
        if pair == _DATA_DLE:
            del self.waiting[:1]
            self._take_data(1)
            return None
        if pair in (ACK, NAK) and self._has_responses:
            del self.waiting[:2]
            self._has_response = True
            return _CONTROLS[pair]  # an embedded response (M 4-3)
        return self._frame(FrameFault.NO_ETX, pair[1])  # the pair is read again as a symbol

    def _take_data(self, count: int) -> None:
        """Take bytes of a message; drop bytes beyond the limit, up to its end (M 4-8)."""
        self.link_data += self.waiting[:min(count, MAX_LINK_DATA + 1 - len(self.link_data))]
        del self.waiting[:count]

    def _check(self) -> Decoded:
        size = self._checksum.size
        if len(self.waiting) < size:
            return MORE
        received = int.from_bytes(self.waiting[:size], 'little')
        del self.waiting[:size]
        if len(self.link_data) > MAX_LINK_DATA:
            return self._frame(FrameFault.TOO_LONG)
        expected = self._checksum.of_message(self.link_data, self._station)
        if received != expected or self._is_damaged:
            return self._frame(FrameFault.BAD_CHECK, received, expected)
        fault = FrameFault.TOO_SHORT if len(self.link_data) < HEADER_SIZE else None
        return self._frame(fault, received, expected)

    def _frame(self, fault: FrameFault | None, received: int = 0, expected: int = 0) -> Frame:
        """End the message."""
        self._step = self._idle
        self.in_message, self._noise_told = False, self.noise
        return Frame(
            bytes(self.link_data), self._station, fault, received, expected, self._has_response)
