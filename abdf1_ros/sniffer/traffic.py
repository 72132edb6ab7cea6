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

"""From bytes to entries: symbols with sender, receiver, check, and repetitions marked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Code, Control, Duplex, Frame, FrameFault, Poll, Symbol, Unknown
from abdf1_ros.df1.listener import LineKind, ListeningDecoder
from abdf1_ros.df1.packet import BROADCAST, HEADER_SIZE, Packet
from abdf1_ros.pccc.describe import describe
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.conversation import Conversation, Transaction
from abdf1_ros.sniffer.entries import Entry, Kind, Mark

# Seconds of silence after which an unfinished frame is given up, as a receiver does. It is the
# time of some characters, plus the time for which an operating system or a device server may hold
# bytes back.
_PAUSE = 0.15

# Most bytes that a decoder gets at once. It drops bytes beyond MAX_WAITING, and one line of a dump
# can be as long as its file.
_PART = 4096

# After this number of replies without any DLE ACK, NAK or ENQ the line is treated as radio modem.
_RADIO_REPLIES = 3

_POLL = 'poll'  # an awaited answer
_CONTROLS = {
    Code.ACK: (Kind.ACK, ''), Code.NAK: (Kind.NAK, ''),
    Code.EOT: (Kind.EOT, 'nothing to send'), Code.ENQ: (Kind.ENQ, 'asks for the last answer'),
}


class _OneDirection:
    """The bytes of one direction."""

    def __init__(self, kind: LineKind) -> None:
        self.decoder = ListeningDecoder(kind)
        self.last_time: float | None = None
        self._noise_told = 0

    def ends_before(self, chunk: Chunk) -> bool:
        """Return True if a pause, or another recording, ends a frame that is not complete."""
        return chunk.time is not None and self.last_time is not None and (
            not 0 <= chunk.time - self.last_time <= _PAUSE)

    def new_noise(self) -> int:
        """Return the number of bytes of noise since the last call."""
        count = self.decoder.noise - self._noise_told
        self._noise_told = self.decoder.noise
        return count


class TrafficDecoder:
    """
    Decode the traffic of one line; no bytes cause an exception.

    ``feed`` takes chunks in the order of their times, ``finish`` ends the traffic. If check and
    duplex are not given, they are found; ``kind`` has both. Without ``is_certain``, ``checksum``
    is a guess that the frames may prove wrong. On half-duplex lines, an unknown direction is
    inferred: ``>`` is from the master.
    """

    def __init__(self, checksum: Checksum | None = None, duplex: Duplex | None = None, *,
                 is_certain: bool = True) -> None:
        self.kind = LineKind(checksum, duplex, is_certain and checksum is not None)
        self.wires: dict[Direction, _OneDirection] = {}
        self._conversation = Conversation()
        self._station: int | None = None  # the last station that the master sent to
        self._awaited: tuple[Direction, str] | None = None  # asker, and question
        self._last_asker = Direction.OUT
        self._finds_duplex = duplex is None
        self._without_ack = 0  # replies since the last DLE ACK, NAK or ENQ

    def feed(self, chunk: Chunk) -> Iterator[Entry]:
        """Yield the entries that these bytes complete."""
        if chunk.guest:
            self._conversation.note_guest(chunk.guest)
        if chunk.is_message:
            yield self._message(Packet.decode(chunk.data), chunk.time, chunk.direction)
        else:
            yield from self._line(chunk)
        for transaction in self._conversation.expired(chunk.time):
            yield self._unanswered(transaction, chunk.time)

    def _line(self, chunk: Chunk) -> Iterator[Entry]:
        """Yield the symbols that the bytes of a line complete."""
        wire = self.wires.get(chunk.direction)
        if wire is None:
            wire = self.wires[chunk.direction] = _OneDirection(self.kind)
        for direction, other in self.wires.items():
            is_end = other is wire and wire.ends_before(chunk)
            if is_end or other is not wire:  # an answer shows that the check was complete
                yield from self._whole(other, direction, is_end)
        wire.last_time = chunk.time
        for start in range(0, len(chunk.data) or 1, _PART):
            wire.decoder.feed(chunk.data[start:start + _PART])
            while (symbol := wire.decoder.next_symbol()) is not None:
                yield from self._noise(wire, chunk)
                yield from self._entries(symbol, chunk, wire.decoder)

    def finish(self) -> Iterator[Entry]:
        """Yield the entries that remain at the end."""
        for direction, wire in self.wires.items():
            yield from self._whole(wire, direction, is_end=True)
        times = [wire.last_time for wire in self.wires.values() if wire.last_time is not None]
        for transaction in self._conversation.unanswered():
            yield self._unanswered(transaction, max(times, default=None))

    def _whole(self, wire: _OneDirection, direction: Direction, is_end: bool) -> Iterator[Entry]:
        """
        Yield a frame with a right BCC that still waits for more bytes.

        At an end, also yield an unfinished frame.
        """
        symbol = wire.decoder.finish()
        if is_end:
            if symbol is None and wire.decoder.in_message:
                symbol = wire.decoder.broken_off()
            wire.decoder.reset()
        chunk = Chunk(wire.last_time, direction, b'')
        yield from self._noise(wire, chunk)
        if symbol is not None:
            yield from self._entries(symbol, chunk, wire.decoder)

    def _noise(self, wire: _OneDirection, chunk: Chunk) -> Iterator[Entry]:
        count = wire.new_noise()
        if count:
            text = 'a byte outside of any frame' if count == 1 else (
                f'{count} bytes outside of any frame')
            yield Entry(chunk.time, chunk.direction, Kind.NOISE, text, size=count)

    def _unanswered(self, transaction: Transaction, time: float | None) -> Entry:
        command = transaction.command
        return Entry(time, Direction.UNKNOWN, Kind.UNANSWERED,
                     f'{_route(command)}: {describe(command)}', command.dst, packet=command,
                     guest=transaction.guest)

    def _entries(self, symbol: Symbol, chunk: Chunk, decoder: ListeningDecoder) -> Iterator[Entry]:
        direction = self._direction(symbol, chunk.direction)
        yield from self._silence(symbol, chunk.time, direction)
        if isinstance(symbol, Poll):
            entry = self._poll(symbol, chunk.time, direction)
        elif isinstance(symbol, Frame):
            if symbol.station is not None:
                self._station = symbol.station
            entry = self._frame(symbol, chunk.time, direction, decoder.checksum)
        else:
            entry = self._control(symbol, chunk.time, direction)
        yield replace(entry, wire=decoder.wire)

    @property
    def _is_half(self) -> bool:
        return self.kind.duplex is Duplex.HALF

    def _direction(self, symbol: Symbol, direction: Direction) -> Direction:
        """Infer the direction on a half-duplex line: masters and slaves send different symbols."""
        if direction is not Direction.UNKNOWN or not self._is_half:
            return direction
        if _is_masters(symbol):
            return Direction.OUT
        if isinstance(symbol, Control) and symbol.code is Code.ACK:
            if self._awaited is not None and self._awaited[1] == _POLL:
                return self._last_asker  # it is for an answer that was not recorded
            return self._last_asker.opposite
        return direction if isinstance(symbol, Unknown) else Direction.IN

    def _silence(self, symbol: Symbol, time: float | None,
                 direction: Direction) -> Iterator[Entry]:
        """Yield an entry when the master goes on although a slave has not answered."""
        awaited = self._awaited
        if awaited is not None and self._is_half:
            asker, what = awaited
            self._awaited = None
            if direction is asker and _is_masters(symbol):
                yield Entry(time, asker.opposite, Kind.SILENCE, f'no answer to the {what}',
                            self._station)
        if isinstance(symbol, Poll | Frame):
            self._last_asker = direction
        if isinstance(symbol, Poll):
            self._awaited = direction, _POLL
        elif isinstance(symbol, Frame) and symbol.station not in (None, BROADCAST):
            self._awaited = direction, 'message'

    def _poll(self, poll: Poll, time: float | None, direction: Direction) -> Entry:
        self._station = poll.station
        return Entry(time, direction, Kind.POLL, '', poll.station, Checksum.BCC, poll.valid)

    def _control(self, symbol: Control | Unknown, time: float | None,
                 direction: Direction) -> Entry:
        station = self._station if self._is_half else None
        if isinstance(symbol, Unknown):
            return Entry(time, direction, Kind.UNKNOWN, f'DLE {symbol.byte:02X}', station)
        if symbol is not Control.EOT:
            self._without_ack = 0
            self._guess_duplex(Duplex.RADIO, Duplex.FULL)
        kind, text = _CONTROLS[symbol.code]
        if kind is Kind.ACK:
            self._conversation.acknowledge(direction)
        if kind is Kind.NAK:
            text = 'resets all slaves' if self._is_half else 'refuses the message'
        return Entry(time, direction, kind, text, station)

    def _guess_duplex(self, before: Duplex, now: Duplex) -> None:
        """Change the duplex from ``before`` to ``now``, unless an option has set the duplex."""
        if self._finds_duplex and self.kind.duplex is before:
            self.kind.duplex = now

    def _frame(self, frame: Frame, time: float | None, direction: Direction,
               checksum: Checksum) -> Entry:
        if frame.fault is not None:
            return self._damaged(frame, time, direction, checksum)
        entry = self._message(Packet.decode(frame.data), time, direction, frame.station)
        return replace(entry, checksum=checksum, valid=True)

    def _message(self, packet: Packet, time: float | None, direction: Direction,
                 station: int | None = None) -> Entry:
        is_radio = self.kind.duplex is Duplex.RADIO
        facts = self._conversation.take(packet, time, direction, station is not None, is_radio)
        if facts.command is not None and not facts.marks:
            self._without_ack += 1
            if self._without_ack == _RADIO_REPLIES:
                self._guess_duplex(Duplex.FULL, Duplex.RADIO)
        kind = Kind.REPLY if packet.is_reply else Kind.COMMAND
        sender = self._conversation.copies.recorder
        is_recorders = Mark.FORWARDED in facts.marks and direction is Direction.OUT
        by = f', sent on by {sender}' if is_recorders and sender is not None else ''
        return Entry(
            time, direction, kind, f'{_route(packet)}{by}: {describe(packet, facts.command)}',
            self._node(station, packet), packet=packet, latency=facts.latency, marks=facts.marks,
            guest=facts.guest, request=facts.command)

    def _damaged(self, frame: Frame, time: float | None, direction: Direction,
                 checksum: Checksum) -> Entry:
        assert frame.fault is not None
        station = self._station if self._is_half else None
        text = frame.fault.value
        if frame.fault is not FrameFault.BAD_CHECK:
            return Entry(time, direction, Kind.DAMAGED, text, station)
        packet = Packet.decode(frame.data) if len(frame.data) >= HEADER_SIZE else None
        likeness = f'; reads like {_route(packet)}' if packet else ''
        if frame.has_stopped:
            return Entry(time, direction, Kind.DAMAGED,
                         f'broken off before the end of its check{likeness}', station,
                         packet=packet)
        text += f': {frame.received:04X}, right is {frame.expected:04X}{likeness}'
        return Entry(time, direction, Kind.DAMAGED, text, station, checksum, False, packet)

    def _node(self, station: int | None, packet: Packet) -> int:
        """Return the station that the entry is listed under."""
        if station is not None:
            return station
        if self._is_half:
            return packet.src
        return packet.src if packet.is_reply else packet.dst


def _is_masters(symbol: Symbol) -> bool:
    """Return True if only the master of a half-duplex line sends this symbol."""
    if isinstance(symbol, Control):
        return symbol.code is Code.NAK
    return isinstance(symbol, Poll) or isinstance(symbol, Frame) and symbol.station is not None


def _route(packet: Packet) -> str:
    return f'{packet.src} to {packet.dst}, TNS {packet.tns:04X}'
