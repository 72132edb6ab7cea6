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

"""The ends that a script plays: a master, a slave, and a full-duplex node."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from abdf1_ros.conform import codec
from abdf1_ros.conform.codec import HeardSymbol, SymbolKind
from abdf1_ros.conform.wire import Failed, Wire

REPLY_BIT = 0x40

# Between two polls of a station that answers DLE EOT (s), so that it can finish.
POLL_PAUSE = 0.02

# A target that sends by itself may take so long (s) to send something.
PATIENCE = 30.0

_MOST_TRIES = 3


@dataclass(frozen=True, slots=True)
class Words:
    """
    Words of the target for the cases that read and write.

    ``address`` is that of an integer file, as N7:0; ``count`` of its words may be overwritten
    (0: none). ``family`` is PLC5 or SLC, empty where it is not known.
    """

    file: int = 7
    element: int = 0
    count: int = 0
    family: str = ''

    @property
    def address(self) -> str:
        """Return the address as people write it."""
        return f'N{self.file}:{self.element}'


class Numbering:
    """The TNS of one command after the other, none twice in a run of 65,536."""

    def __init__(self, first: int) -> None:
        self._next = first

    def take(self) -> int:
        """Return a TNS that has not been used lately."""
        tns, self._next = self._next & 0xFFFF, self._next + 1
        return tns


class Asking(Protocol):
    """An end that sends commands: what the cases of ``data`` need."""

    wire: Wire
    words: Words

    def ask(self, cmd: int, body: bytes, tns: int | None = None) -> bytes:
        """Send a command, FNC included in ``body``, and return the link data of its reply."""


def header(dst: int, src: int, cmd: int, tns: int, sts: int = 0) -> bytes:
    """Return the six bytes before FNC or data (M 6-3)."""
    return bytes((dst, src, cmd, sts)) + tns.to_bytes(2, 'little')


def check_reply(command: bytes, reply: bytes) -> bytes:
    """
    Return ``reply`` if it answers ``command``: raises Failed.

    DST and SRC are exchanged, CMD has bit 6, TNS is the same (M 6-3 to 6-8).
    """
    wanted = bytes((command[1], command[0], command[2] | REPLY_BIT)), command[4:6]
    if len(reply) < codec.HEADER_SIZE or (reply[:3], reply[4:6]) != wanted:
        raise Failed(f'a reply {wanted[0].hex(" ")} STS {wanted[1].hex(" ")} to this command',
                     reply.hex(' '))
    return reply


class _AskingEnd(ABC):
    """What both ends that ask have: whom they ask (``station``), as whom, and with which TNS."""

    def __init__(self, wire: Wire, station: int, own: int, numbering: Numbering,
                 words: Words = Words()) -> None:
        self.wire = wire
        self.station = station
        self.own = own
        self.words = words
        self.numbering = numbering

    def command(self, cmd: int = 0x06, body: bytes = b'\x00', tns: int | None = None) -> bytes:
        """Return the link data of a command: an echo of nothing, if not told otherwise."""
        return header(self.station, self.own, cmd,
                      self.numbering.take() if tns is None else tns) + body

    @abstractmethod
    def deliver(self, command: bytes) -> None:
        """Send a message that has to be acknowledged."""

    @abstractmethod
    def collect(self, acknowledge: bool = True) -> bytes:
        """Return the link data of the reply."""

    def ask(self, cmd: int, body: bytes, tns: int | None = None) -> bytes:
        """Carry out a command."""
        command = self.command(cmd, body, tns)
        self.deliver(command)
        return check_reply(command, self.collect())


class MasterEnd(_AskingEnd):
    """A half-duplex master that talks to one slave, ``station``; ``own`` is its own address."""

    def settle(self) -> None:
        """Fetch all messages that the slave still holds, so that a case begins without any."""
        self.wire.drain()
        for _ in range(16):
            self.wire.send(codec.poll(self.station))
            symbol = self.wire.hear()
            if symbol is None or symbol.kind is SymbolKind.EOT:
                return
            if symbol.kind is SymbolKind.MESSAGE and symbol.is_good:
                self.wire.send(codec.ACK)

    def send(self, command: bytes) -> None:
        """Send a message to the slave."""
        self.wire.send(codec.master_message(self.station, command, self.wire.check))

    def deliver(self, command: bytes) -> None:
        """Send a message that has to be acknowledged; once more after silence."""
        self.send(command)
        symbol = self.wire.hear()
        if symbol is None:
            self.send(command)
            symbol = self.wire.hear()
        if symbol is None or symbol.kind is not SymbolKind.ACK:
            raise Failed('DLE ACK for a good message', str(symbol or 'silence'))

    def poll(self) -> HeardSymbol | None:
        """Poll once and return what comes."""
        self.wire.send(codec.poll(self.station))
        return self.wire.hear()

    def collect(self, acknowledge: bool = True) -> bytes:
        """Poll until a message comes, and acknowledge it; return its link data."""
        end = self.wire.now + 5 * self.wire.answer_time
        while self.wire.now < end:
            symbol = self.poll()
            if symbol is not None and symbol.kind is SymbolKind.MESSAGE and symbol.is_good:
                if acknowledge:
                    self.wire.send(codec.ACK)
                return symbol.data
            if symbol is not None and symbol.kind is not SymbolKind.EOT:
                raise Failed('a message or DLE EOT as answer to a poll', str(symbol))
            self.wire.rest(POLL_PAUSE)
        raise Failed('the reply, asked for by polls', 'no message')


class PeerEnd(_AskingEnd):
    """A full-duplex node that sends commands to another, ``station``."""

    def settle(self) -> None:
        """Acknowledge messages that the other end still sends."""
        end = self.wire.now + 10 * self.wire.answer_time
        while self.wire.now < end and (symbol := self.wire.hear()) is not None:
            if symbol.kind in (SymbolKind.MESSAGE, SymbolKind.ENQ):
                self.wire.send(codec.ACK)

    def send(self, command: bytes) -> None:
        """Send a message."""
        self.wire.send(codec.message(command, self.wire.check))

    def deliver(self, command: bytes) -> None:
        self.send(command)
        self.wire.expect(SymbolKind.ACK, 'DLE ACK for a good message')

    def collect(self, acknowledge: bool = True) -> bytes:
        """Wait for a message and acknowledge it; return its link data."""
        symbol = self.wire.expect(SymbolKind.MESSAGE, 'the reply', 5 * self.wire.answer_time)
        if acknowledge:
            self.wire.send(codec.ACK)
        return symbol.data


Serve = Callable[[bytes], bytes]
"""Executes a command: link data in, link data of the reply out."""


class Answering(Protocol):
    """An end that answers commands: what the cases of ``asking`` need."""

    wire: Wire

    def next_command(self) -> HeardSymbol:
        """Wait for a good command."""

    def finish(self, command: HeardSymbol) -> None:
        """Answer a command to its end."""


def _settle(end: Answering) -> None:
    for _ in range(_MOST_TRIES):
        try:
            end.finish(end.next_command())
        except Failed:  # the case will show it; the target may still be busy
            continue
        return


class SlaveEnd:
    """A slave, ``station``, that a half-duplex master polls and sends commands to."""

    def __init__(self, wire: Wire, station: int, serve: Serve) -> None:
        self.wire = wire
        self.station = station
        self.serve = serve

    def settle(self) -> None:
        """Answer one command, so that no case begins with a master that counts us as inactive."""
        _settle(self)

    def next_command(self, what: str = 'a command for our station') -> HeardSymbol:
        """Wait for a good message to us; polls before it are answered DLE EOT."""
        def is_command(symbol: HeardSymbol) -> bool:
            if symbol.kind is SymbolKind.POLL and symbol.station == self.station:
                self.wire.send(codec.EOT)
            return symbol.kind is SymbolKind.MASTER_MESSAGE and symbol.station == self.station

        symbol = self.wire.until(is_command, what, PATIENCE)
        if not symbol.is_good:
            raise Failed('a message with the right check', symbol.raw.hex(' '))
        return symbol

    def next_poll(self, what: str = 'a poll of our station',
                  within: float = PATIENCE) -> HeardSymbol:
        """Wait for a poll of us; a message before it is a failure."""
        def is_ours(symbol: HeardSymbol) -> bool:
            return symbol.station == self.station

        symbol = self.wire.until(is_ours, what, within)
        if symbol.kind is not SymbolKind.POLL:
            raise Failed(what, str(symbol))
        return symbol

    def reply_to(self, command: HeardSymbol) -> None:
        """Send the reply to a command, as answer to a poll."""
        self.wire.send(codec.message(self.serve(command.data), self.wire.check))

    def finish(self, command: HeardSymbol) -> None:
        """Answer a command to its end: acknowledge, wait for the poll, reply, hear the ACK."""
        self.wire.send(codec.ACK)
        self.next_poll()
        self.reply_to(command)
        self.wire.expect(SymbolKind.ACK, 'DLE ACK for a good reply')


class ServerEnd:
    """A full-duplex node that answers the commands of another."""

    def __init__(self, wire: Wire, serve: Serve) -> None:
        self.wire = wire
        self.serve = serve

    def settle(self) -> None:
        """Answer one command, so that no case begins with a node that counts us as inactive."""
        _settle(self)

    def next_command(self, what: str = 'a command') -> HeardSymbol:
        """Wait for a good message; an enquiry before it is answered DLE NAK."""
        def is_command(symbol: HeardSymbol) -> bool:
            if symbol.kind is SymbolKind.ENQ:
                self.wire.send(codec.NAK)
            return symbol.kind is SymbolKind.MESSAGE

        symbol = self.wire.until(is_command, what, PATIENCE)
        if not symbol.is_good:
            raise Failed('a message with the right check', symbol.raw.hex(' '))
        return symbol

    def reply_to(self, command: HeardSymbol) -> None:
        """Send the reply to a command."""
        self.wire.send(codec.message(self.serve(command.data), self.wire.check))

    def finish(self, command: HeardSymbol) -> None:
        self.wire.send(codec.ACK)
        self.reply_to(command)
        self.wire.expect(SymbolKind.ACK, 'DLE ACK for a good reply')
