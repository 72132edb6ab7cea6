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

"""The ends that a script plays: a master, a slave, full-duplex nodes and radio modem nodes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from abdf1_ros.conform import codec
from abdf1_ros.conform.codec import Symbol, SymbolKind
from abdf1_ros.conform.wire import Failed, Skipped, Wire

# Pause (s) between two polls of a station that answers DLE EOT, so that it can finish.
POLL_PAUSE = 0.02

# Longest wait (s) for the next message of a target that sends by itself.
PATIENCE = 30.0

# Longest time (s) that a node may wait for the response to its message before it sends DLE ENQ.
# The defaults of the products are 1 to 4.4 s (M 7-25, 7-27).
LONGEST_ACK_TIMEOUT = 20.0

HIGHEST_LIMIT = 255  # highest setting of any product for repetitions and enquiries


def ack_timeout(wire: Wire) -> float:
    """Return a time (s) in which DLE ENQ comes, from the measured time after a first DLE ENQ."""
    return min(LONGEST_ACK_TIMEOUT, 1.5 * wire.enquired_after + 1.0)


def expect_limit(what: str, comes: Callable[[], bool]) -> None:
    """
    Call ``comes`` until ``what`` does not come any more.

    Raises Failed if that has no end, and Skipped if ``what`` does not come once.
    """
    for times in range(HIGHEST_LIMIT + 1):
        if not comes():
            if not times:
                raise Skipped(f'not tried: {what} has not come')
            return
    raise Failed(f'an end after {HIGHEST_LIMIT} times at the latest, the highest limit of the '
                 'products', f'{what} once more')


def expect_end_of_naks(wire: Wire, message: bytes, patience: float) -> None:
    """Refuse a message each time it comes, and expect an end of that."""
    def comes() -> bool:
        wire.send(codec.NAK)
        symbol = wire.hear(patience)
        return symbol is not None and symbol.data == message

    expect_limit('the message again', comes)


def expect_end_of_enquiries(wire: Wire, message: bytes, patience: float) -> None:
    """Leave a message and DLE ENQ without an answer, and expect an end of them."""
    def comes() -> bool:
        symbol = wire.hear(patience, answers=False)
        return symbol is not None and (
            symbol.kind is SymbolKind.ENQ or symbol.data == message)

    expect_limit('DLE ENQ', comes)


MOST_TRIES = 3  # tries to send to a full sink, and to answer a command before a case
_MOST_COMMANDS = 20  # commands in a row that a slave sends by itself, or a master without a reply

# A reply counts as taken only if a missing reply clearly delays the next command: to more than
# twice the time with a reply, plus this time (s).
_CLEARLY = 0.3

# Longest time of a reply, in answer times.
_REPLY_TIMES = 5


@dataclass(frozen=True, slots=True)
class Words:
    """
    Words of the target for the cases that read and write.

    ``address`` is the first word, in an integer file, such as N7:0. ``count`` words from there on
    may be overwritten (0: none). ``family`` is PLC5 or SLC, empty where it is not known.
    ``why_not`` is why the words cannot be read although it is known, empty if they can.
    """

    file: int = 7
    element: int = 0
    count: int = 0
    family: str = ''
    why_not: str = ''

    @property
    def address(self) -> str:
        """Return the address in its usual form."""
        return f'N{self.file}:{self.element}'


def header(dst: int, src: int, cmd: int, tns: int) -> bytes:
    """Return the six bytes of a command before FNC or data (M 6-3)."""
    return bytes((dst, src, cmd, 0)) + tns.to_bytes(2, 'little')


def check_reply(command: bytes, reply: bytes) -> bytes:
    """
    Return ``reply`` if it answers ``command``, else raise Failed.

    DST and SRC are exchanged, CMD has bit 6, TNS is the same (M 6-3 to 6-8).
    """
    wanted = bytes((command[1], command[0], command[2] | codec.REPLY_BIT)), command[4:6]
    if len(reply) < codec.HEADER_SIZE or (reply[:3], reply[4:6]) != wanted:
        raise Failed(f'a reply {wanted[0].hex(" ")} STS {wanted[1].hex(" ")} to this command',
                     reply.hex(' '))
    return reply


class AskingEnd(ABC):
    """The common part of all ends that send commands to a ``station``; ``own`` is our number."""

    def __init__(self, wire: Wire, station: int, own: int, first_tns: int,
                 words: Words = Words()) -> None:
        self.wire = wire
        self.station = station
        self.own = own
        self.words = words
        # TNS of commands that were acknowledged and not answered yet
        self.owed: set[bytes] = set()
        self._next_tns = first_tns

    @property
    def reply_time(self) -> float:
        """Return the longest time (s) of a reply."""
        return _REPLY_TIMES * self.wire.answer_time

    @property
    def another(self) -> int:
        """Return the number of a node that is neither the target nor we."""
        return next(number for number in (254, 253, 252)
                    if number not in (self.station, self.own))

    def command(self, cmd: int = 0x06, body: bytes = b'\x00', tns: int | None = None) -> bytes:
        """
        Return the link data of a command, by default of an echo without data.

        No two of 65,536 commands in a row have the same TNS.
        """
        if tns is None:
            tns, self._next_tns = self._next_tns & 0xFFFF, self._next_tns + 1
        return header(self.station, self.own, cmd, tns) + body

    @abstractmethod
    def settle(self) -> None:
        """Receive the messages that the target still has to send, before a case begins."""

    def check_target(self) -> None:
        """Send a command if the case has ended without an answer; Skipped if no reply comes."""
        if not self.wire.transcript.is_unanswered:
            return
        for _ in range(MOST_TRIES):
            with suppress(Failed):
                self.carry_out(self.command())
                return
        raise Skipped('not tried: the target answers no command')

    def frame(self, command: bytes) -> bytes:
        """Return the frame of a message."""
        return codec.message(command, self.wire.check)

    def send(self, command: bytes) -> None:
        """Send a message."""
        self.wire.send(self.frame(command))

    def offer(self, command: bytes) -> Symbol | None:
        """Send a message and return the response to it."""
        self.send(command)
        symbol = self.wire.hear()
        if symbol is not None and symbol.kind is SymbolKind.ACK:
            self.owed.add(command[4:6])
        return symbol

    def deliver(self, command: bytes, before: Callable[[], object] = lambda: None) -> None:
        """
        Call ``before``, send a message, and expect DLE ACK; raise Failed without it.

        If a sink is full, a slave is silent (KF2 4-31), and a full-duplex node answers DLE NAK (M
        4-8). Then ``before`` and the message are repeated.
        """
        for _ in range(MOST_TRIES):
            before()
            symbol = self.offer(command)
            is_full = symbol is None if self.wire.is_half_duplex else (
                symbol is not None and symbol.kind is SymbolKind.NAK)
            if not is_full:
                break
        if symbol is None or symbol.kind is not SymbolKind.ACK:
            raise Failed('DLE ACK for a good message', str(symbol or 'silence'))

    def expect_acknowledged(self) -> None:
        """Expect DLE ACK for the first copy of a good message, in one of some tries."""
        for number in range(2 * MOST_TRIES):
            symbol = self.offer(self.command())
            if symbol is not None and symbol.kind is SymbolKind.ACK:
                return
            if number % 2:  # in turns, as a device may lose each n-th answer
                self.settle()  # a message that waits may have filled a buffer
        raise Failed('DLE ACK for a good message', str(symbol or 'silence'))

    @abstractmethod
    def collect(self, acknowledge: bool = True) -> bytes:
        """Wait for a message and acknowledge it; return its link data."""

    @abstractmethod
    def further(self, seconds: float) -> Symbol | None:
        """Return the first answer within ``seconds`` that is not DLE EOT."""

    def expect_nothing(self, what: str) -> None:
        """Expect no answer, not even to a poll; Failed gives the reason for silence, ``what``."""
        self.wire.expect_silence(what)
        symbol = self.further(self.wire.answer_time)
        if symbol is not None:
            raise Failed(f'no answer: {what}', str(symbol))

    def attempt(self, command: bytes) -> bytes | None:
        """Return the reply to a command; None if the command is not accepted."""
        try:
            self.deliver(command)
        except Failed:
            return None
        return check_reply(command, self.collect())

    def carry_out(self, command: bytes, before: Callable[[], object] = lambda: None) -> bytes:
        """Call ``before``, send a command, and return the link data of its reply."""
        self.deliver(command, before)
        return check_reply(command, self.collect())

    def taken(self, symbol: Symbol, acknowledge: bool = True) -> bytes:
        """Acknowledge a message, and return its link data."""
        self.owed.discard(symbol.data[4:6])
        if acknowledge:
            self.wire.send(codec.ACK)
        return symbol.data

    def ask(self, cmd: int, body: bytes, tns: int | None = None) -> bytes:
        """Make a command, with FNC in ``body``; return the link data of its reply."""
        return self.carry_out(self.command(cmd, body, tns))


class MasterEnd(AskingEnd):
    """A half-duplex master that talks to one slave, ``station``; ``own`` is its own address."""

    def settle(self) -> None:
        self.wire.drain(_REPLY_TIMES * self.wire.answer_time)
        end = self.wire.now + _REPLY_TIMES * self.wire.answer_time
        while self.wire.now < end:
            symbol = self.poll()
            if symbol is not None and symbol.kind is SymbolKind.MESSAGE and symbol.is_good:
                self.taken(symbol)
            elif self.owed:  # DLE EOT of a slave that is still busy
                self.wire.rest(POLL_PAUSE)
            else:
                break
        self.owed.clear()

    def frame(self, command: bytes) -> bytes:
        return codec.master_message(self.station, command, self.wire.check)

    def poll(self) -> Symbol | None:
        """Poll and return the answer; acknowledge and skip commands of the slave itself."""
        for _ in range(_MOST_COMMANDS):
            self.wire.send(codec.poll(self.station))
            symbol = self.wire.hear()
            if symbol is None or not self.wire.has_passed_command(symbol):
                return symbol
        return None

    def collect(self, acknowledge: bool = True) -> bytes:
        symbol = self.further(_REPLY_TIMES * self.wire.answer_time)
        if symbol is None:
            raise Failed('the reply, asked for by polls', 'no message')
        if symbol.kind is not SymbolKind.MESSAGE or not symbol.is_good:
            raise Failed('a message or DLE EOT as answer to a poll', str(symbol))
        return self.taken(symbol, acknowledge)

    def further(self, seconds: float) -> Symbol | None:
        end = self.wire.now + seconds
        while self.wire.now < end:
            symbol = self.poll()
            if symbol is not None and symbol.kind is not SymbolKind.EOT:
                return symbol
            self.wire.rest(POLL_PAUSE)
        return None


class PeerEnd(AskingEnd):
    """
    A full-duplex node that sends commands to another node, ``station``.

    A reply may overtake the ACK of its command, as the two are sent independently (M 4-13).
    """

    _early: Symbol | None = None  # a reply that came before its ACK

    def offer(self, command: bytes) -> Symbol | None:
        symbol = super().offer(command)
        if symbol is None or symbol.kind is not SymbolKind.MESSAGE \
                or symbol.data[4:6] != command[4:6]:
            return symbol
        acknowledgement = self.wire.hear()
        if acknowledgement is None or acknowledgement.kind is not SymbolKind.ACK:
            return symbol
        self.owed.add(command[4:6])
        self._early = symbol
        return acknowledgement

    def settle(self) -> None:
        early, self._early = self._early, None
        if early is not None:
            self.taken(early)
        end = self.wire.now + 2 * _REPLY_TIMES * self.wire.answer_time
        while self.wire.now < end:
            symbol = self.wire.hear((_REPLY_TIMES if self.owed else 1) * self.wire.answer_time)
            if symbol is None:
                break
            if symbol.kind is SymbolKind.MESSAGE:
                self.taken(symbol)
        self.owed.clear()

    def collect(self, acknowledge: bool = True) -> bytes:
        symbol, self._early = self._early, None
        if symbol is None:
            symbol = self.wire.expect(SymbolKind.MESSAGE, 'the reply',
                                      _REPLY_TIMES * self.wire.answer_time)
        elif not symbol.is_good:
            raise Failed('the reply', str(symbol))
        return self.taken(symbol, acknowledge)

    def further(self, seconds: float) -> Symbol | None:
        symbol, self._early = self._early, None
        return symbol or self.wire.hear(seconds)


class RadioEnd(PeerEnd):
    """A node of a radio modem network that sends commands to another node, ``station``."""

    def deliver(self, command: bytes, before: Callable[[], object] = lambda: None) -> None:
        before()
        self.send(command)
        self.owed.add(command[4:6])

    def attempt(self, command: bytes) -> bytes | None:
        self.deliver(command)
        symbol = self.further(_REPLY_TIMES * self.wire.answer_time)
        return None if symbol is None else check_reply(command, self.taken(symbol))

    def taken(self, symbol: Symbol, acknowledge: bool = True) -> bytes:
        return super().taken(symbol, acknowledge=False)


Serve = Callable[[bytes], bytes]
"""Executes a command: takes its link data, returns the link data of the reply."""


def is_as_late(answered: float, unanswered: float) -> bool:
    """Tell whether a missing reply does not clearly delay the next command (times in s)."""
    return unanswered < 2 * answered + _CLEARLY


class AnsweringEnd(ABC):
    """
    The common part of all ends that answer commands.

    The target may send further commands before the one in hand has its reply (M 4-6). They are
    acknowledged, and answered after it. ``has_further`` tells whether such a command has come.
    """

    station: int | None = None  # of a master's message

    def __init__(self, wire: Wire, serve: Serve) -> None:
        self.wire = wire
        self.has_further = False
        self._serve = serve
        self._further: deque[Symbol] = deque()
        self._in_hand = bytes(codec.HEADER_SIZE)
        self._why_none: Skipped | None = None  # why no command has come before a case

    def serve(self, command: bytes) -> bytes:
        """Execute a command, and return its reply; raise Failed if it has no whole header."""
        if len(command) < codec.HEADER_SIZE:
            raise Failed(f'a command of {codec.HEADER_SIZE} bytes or more', command.hex(' '))
        return self._serve(command)

    def settle(self) -> None:
        """Answer one command, so that the target does not count us as inactive in the case."""
        self._why_none = None
        for _ in range(MOST_TRIES):
            try:
                self.finish(self.next_command())
            except Failed:  # the case will show it; the target may still be busy
                continue
            except Skipped as reason:  # the case will tell it, without another wait
                self._why_none = reason
            return

    def check_target(self) -> None:  # noqa: B027
        """Do nothing: each case begins with a command of the target."""

    @abstractmethod
    def next_command(self, what: str = '') -> Symbol:
        """Wait for a good command; else raise Failed with ``what``, or Skipped if it is empty."""

    def hear_command(self, is_wanted: Callable[[Symbol], bool], what: str) -> Symbol:
        """Return the first command that ``is_wanted``; raises as ``next_command``."""
        if self._why_none is not None:
            raise self._why_none
        try:
            symbol = self.wire.until(is_wanted, what, PATIENCE)
        except Failed:
            if what:
                raise
            raise Skipped(f'not tried: no command has come within {PATIENCE:g} s') from None
        if not symbol.is_good:
            raise Failed('a message with the right check', symbol.raw.hex(' '))
        self._in_hand = symbol.data
        return symbol

    def keeps(self, symbol: Symbol) -> bool:
        """If a symbol is a further command, acknowledge it, keep it, and return True."""
        if symbol.station != self.station or not codec.is_command(symbol) or \
                symbol.data[4:6] == self._in_hand[4:6] or len(self._further) == _MOST_COMMANDS:
            return False
        self.wire.send(codec.ACK)
        self._further.append(symbol)
        self.has_further = True
        return True

    def hear(self, within: float | None = None, *, answers: bool = True) -> Symbol | None:
        """Return the next symbol that is not a further command; see ``Wire.hear``."""
        symbol = self.wire.hear(within, answers=answers)
        while symbol is not None and self.keeps(symbol):
            symbol = self.wire.hear(within, answers=answers)
        return symbol

    def expect(self, kind: SymbolKind, what: str = '', within: float | None = None) -> Symbol:
        """Return the next symbol that ``hear`` returns; see ``Wire.expect``."""
        return self.wire.expect(kind, what, within, self.hear)

    def acknowledge(self, command: Symbol) -> None:
        """Acknowledge a command, if this discipline has acknowledgements."""
        self.wire.send(codec.ACK)

    @abstractmethod
    def say(self, raw: bytes) -> None:
        """Send a message instead of the reply to an acknowledged command."""

    def expect_taken(self, command: Symbol) -> None:
        """Expect that the target has accepted the reply to a command."""
        self.expect(SymbolKind.ACK, 'DLE ACK for a good reply')

    @abstractmethod
    def finish(self, command: Symbol) -> None:
        """Answer a command to its end: acknowledge, reply, hear the ACK."""

    def reply_to(self, command: Symbol) -> None:
        """Send the reply to a command; on a half-duplex line it must follow a poll."""
        self.wire.send(codec.message(self.serve(command.data), self.wire.check))

    def reply_and_hear(self, command: Symbol, what: str = 'DLE ACK for a good reply') -> None:
        """Send the reply to a command, and hear the ACK; Failed says ``what`` was expected."""
        self.reply_to(command)
        self.expect(SymbolKind.ACK, what)


class SlaveEnd(AnsweringEnd):
    """A slave, ``station``, that a half-duplex master polls and sends commands to."""

    def __init__(self, wire: Wire, station: int, serve: Serve) -> None:
        super().__init__(wire, serve)
        self.station = station

    def next_command(self, what: str = '') -> Symbol:
        """Wait for a good message to us; polls before it get a kept reply, or DLE EOT."""
        def is_command(symbol: Symbol) -> bool:
            if symbol.kind is SymbolKind.POLL and symbol.station == self.station:
                if self._further:
                    self.reply_to(self._further.popleft())
                else:
                    self.wire.send(codec.EOT)
            return symbol.kind is SymbolKind.MASTER_MESSAGE and symbol.station == self.station

        return self.hear_command(is_command, what)

    def say(self, raw: bytes) -> None:
        self.next_poll()
        self.wire.send(raw)

    def next_visit(self, what: str) -> Symbol:
        """Wait for a poll of our station, a message to it, or a reset."""
        return self.wire.until(lambda symbol: symbol.station == self.station
                               or symbol.kind is SymbolKind.NAK, what, PATIENCE)

    def next_poll(self, what: str = 'a poll of our station') -> Symbol:
        """Wait for a poll of our station; raise Failed for the same message or a reset."""
        symbol = self.next_visit(what)
        while self.keeps(symbol):
            symbol = self.next_visit(what)
        if symbol.kind is not SymbolKind.POLL or not symbol.is_good:
            raise Failed(what, str(symbol))
        return symbol

    def finish(self, command: Symbol) -> None:
        self.wire.send(codec.ACK)
        self.next_poll()
        self.reply_and_hear(command)


class ServerEnd(AnsweringEnd):
    """A full-duplex node that answers the commands of another node."""

    def next_command(self, what: str = '') -> Symbol:
        """Send a kept reply, and wait for a good message, which may come before the ACK."""
        heard = set()

        def is_command(symbol: Symbol) -> bool:
            heard.add(symbol.kind)
            return symbol.kind is SymbolKind.MESSAGE

        is_owed = bool(self._further)
        if is_owed:
            self.reply_to(self._further.popleft())
        command = self.hear_command(is_command, what)
        if is_owed and SymbolKind.ACK not in heard:
            self.wire.hear()
        return command

    def say(self, raw: bytes) -> None:
        self.wire.send(raw)

    def finish(self, command: Symbol) -> None:
        self.wire.send(codec.ACK)
        self.reply_and_hear(command)


class RadioServerEnd(ServerEnd):
    """A node of a radio modem network, ``station``, that answers the commands of another node."""

    def __init__(self, wire: Wire, station: int, serve: Serve) -> None:
        super().__init__(wire, serve)
        self.station = station

    def next_command(self, what: str = '') -> Symbol:
        return self.hear_command(lambda heard: heard.kind is SymbolKind.MESSAGE
                                 and not self.keeps(heard), what)

    def keeps(self, symbol: Symbol) -> bool:
        """Pass over commands to another station."""
        return codec.is_command(symbol) and symbol.data[0] != self.station

    def acknowledge(self, command: Symbol) -> None:
        pass

    def expect_taken(self, command: Symbol, within: float = PATIENCE) -> None:
        """
        Expect a new command, and nothing before it.

        Raises Skipped if it comes after more than ``within`` s, or as late as without a reply.
        """
        begun = self.wire.now
        symbol = self.expect(SymbolKind.MESSAGE, 'no symbol before the next command', PATIENCE)
        if symbol.data[4:6] == command.data[4:6]:
            raise Failed('a new command: this one has its reply', symbol.data.hex(' '))
        answered = symbol.at - begun
        following = self.next_command('another command')
        if answered > within or is_as_late(answered, following.at - symbol.at):
            raise Skipped('not judged: the next command comes too late after a reply')
        self.finish(following)

    def finish(self, command: Symbol) -> None:
        self.reply_to(command)
