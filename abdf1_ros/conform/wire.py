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

"""The line as a case uses it: send bytes, expect a symbol within a time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
import math
from typing import Protocol

from abdf1_ros.conform import codec
from abdf1_ros.conform.codec import BlockCheck, Symbol, SymbolKind
from abdf1_ros.conform.reader import SymbolReader
from abdf1_ros.conform.transcript import Sent, Transcript

_QUIET = 0.2  # s without a byte
_DLE = b'\x10'

# Longest time of restoring the words of the target, in answer times: a late reply, and then a
# command with its reply.
_RESTORING_TIMES = 12


class RawLine(Protocol):
    """The source and target of bytes."""

    def read(self, timeout: float) -> bytes:
        """Return the bytes that come within ``timeout`` s, empty for none."""

    def write(self, data: bytes) -> None:
        """Send bytes."""


class Hear(Protocol):
    """Hears as ``Wire.hear`` does."""

    def __call__(self, within: float | None, *, answers: bool) -> Symbol | None:
        """Return the next symbol; None if no symbol begins within ``within`` s."""


class Failed(Exception):
    """The target has broken the rule."""

    def __init__(self, expected: str, got: str) -> None:
        super().__init__(f'expected {expected}, got {got}')
        self.expected = expected
        self.got = got


def expect_same(first: bytes, second: bytes) -> None:
    """Raise Failed if a repeated message does not have the bytes of the first."""
    if second != first:
        raise Failed(f'the same message again: {first.hex(" ")}', second.hex(' '))


class Skipped(Exception):
    """The rule was not tried, or cannot be judged here; the text says why."""


class Wire:
    """
    One end of a line.

    ``answer_time`` is the longest time (s) of an answer, and the time without bytes that counts as
    silence. It counts from the end of the sent bytes, at ``char_time`` s a byte. With ``is_radio``
    no message has a response, so DLE ENQ gets none. ``transcript`` has the bytes of the case,
    ``reader`` the bytes that are not a symbol yet. ``hear`` returns a response inside a message
    before that message. ``enquired_after`` is the shortest time (s) from a message of the target
    to its DLE ENQ, ``begun`` the time when the line was there. With ``passes_commands`` a command
    of the target itself, such as a MSG of its program, is acknowledged and ignored. Bytes outside
    of any symbol are ignored, as M 4-7 to 4-9 requires, and counted in ``noise``; DLE with a code
    that no symbol has is an answer. By radio a forwarded reply that comes again is ignored, too
    (ML11 517 to 522).
    """

    def __init__(self, line: RawLine, check: BlockCheck, clock: Callable[[], float], *,
                 is_half_duplex: bool, is_radio: bool = False, answer_time: float = 1.0,
                 char_time: float = 0.0, passes_commands: bool = False) -> None:
        self.check = check
        self.is_half_duplex = is_half_duplex
        self._is_radio = is_radio
        self._passes_commands = passes_commands
        self._limit = math.inf
        self.answer_time = answer_time
        self.transcript = Transcript(check, is_half_duplex)
        self.reader = SymbolReader(self._read, clock, check, is_half_duplex=is_half_duplex,
                                   char_time=char_time)
        self.noise = 0
        self._line = line
        self._clock = clock
        self.begun = clock()
        self._char_time = char_time
        self._embedded: deque[Symbol] = deque()
        self._sent_until = 0.0
        self._response = codec.NAK
        self._last_reply = b''
        self._message_at = math.inf
        self.enquired_after = math.inf

    @property
    def now(self) -> float:
        """Return the time (s) on the clock of the transcript."""
        return self._clock()

    @property
    def restoring_time(self) -> float:
        """Return the longest time (s) of restoring the words of the target after a case."""
        return _RESTORING_TIMES * self.answer_time

    def begin(self, limit: float) -> None:
        """Begin a case of at most ``limit`` s; after that time it is Skipped."""
        self.transcript.entries.clear()
        self.allow(limit)

    def allow(self, seconds: float) -> None:
        """Give the case ``seconds`` from now, whatever it has taken."""
        self._limit = self._clock() + seconds

    def _time_left(self) -> float:
        left = self._limit - self._clock()
        if left <= 0:
            raise Skipped('not judged: it takes too long')
        return left

    def send(self, raw: bytes) -> None:
        """Send bytes as they are."""
        self._time_left()
        self.transcript.entries.append(Sent(self._clock(), raw))
        self._sent_until = max(self._clock(), self._sent_until) + len(raw) * self._char_time
        if raw in (codec.ACK, codec.NAK):
            self._response = raw
        self._line.write(raw)

    def forget_reply(self) -> None:
        """Take the next copy of the last reply by radio for an answer: no node forwards it."""
        self._last_reply = b''

    def hear(self, within: float | None = None, *, answers: bool = True) -> Symbol | None:
        """
        Return the next symbol; None if no symbol begins within ``within`` s.

        With ``answers`` a DLE ENQ gets the last response, and is not returned (M 4-5, 4-13).
        """
        end = max(self._clock(), self._sent_until) + (
            self.answer_time if within is None else within)
        symbol = self._next(end)
        while symbol is not None and self._has_passed(symbol, answers):
            symbol = self._next(end) if self._clock() < end else None
        return symbol

    def _has_passed(self, symbol: Symbol, answers: bool) -> bool:
        """Return True for an ignored symbol; answer DLE ENQ, and acknowledge a command."""
        if symbol.kind is SymbolKind.NOISE and symbol.raw[:1] != _DLE:
            self.noise += len(symbol.raw)
            return True
        if self._is_radio and codec.is_reply(symbol):
            before, self._last_reply = self._last_reply, symbol.data
            return symbol.data == before
        if answers and not self._is_radio and symbol.kind is SymbolKind.ENQ:
            self.send(self._response)
            return True
        # In half duplex, ``MasterEnd.poll`` does this, because a slave must be polled again.
        return self._passes_commands and not self.is_half_duplex \
            and self.has_passed_command(symbol)

    def has_passed_command(self, symbol: Symbol) -> bool:
        """If a symbol is a command that is not a copy of ours, acknowledge it and return True."""
        if not codec.is_command(symbol) or self.transcript.has_sent(symbol.raw):
            return False
        if not self._is_radio:
            self.send(codec.ACK)
        return True

    def _next(self, end: float) -> Symbol | None:
        if self._embedded:
            return self._embedded.popleft()
        symbol = self.reader.symbol(end)
        return None if symbol is None else self._take(symbol)

    def _read(self, timeout: float) -> bytes:
        return self._line.read(min(timeout, self._time_left()))

    def _take(self, symbol: Symbol) -> Symbol:
        self.transcript.entries.append(symbol)
        if symbol.kind is SymbolKind.MESSAGE:
            self._response = codec.NAK  # until we send its response
            self._message_at = symbol.at
        elif symbol.kind is SymbolKind.ENQ and symbol.at > self._message_at:
            self.enquired_after = min(self.enquired_after, symbol.at - self._message_at)
        self._embedded.extend(Symbol(kind, b'', at=symbol.at) for kind in symbol.embedded)
        self._embedded.append(symbol)
        return self._embedded.popleft()

    def expect(self, kind: SymbolKind, what: str = '', within: float | None = None,
               hear: Hear | None = None) -> Symbol:
        """Return the next symbol if it is of ``kind`` and good, else raise Failed."""
        expected, noise = what or kind.value, self.noise
        symbol = (hear or self.hear)(within, answers=kind is not SymbolKind.ENQ)
        if symbol is None:
            raise Failed(expected, 'silence' if noise == self.noise else SymbolKind.NOISE.value)
        if symbol.kind is not kind or not symbol.is_good:
            raise Failed(expected, str(symbol))
        return symbol

    def expect_silence(self, what: str, within: float | None = None) -> None:
        """Expect silence; raises Failed for anything else."""
        symbol = self.hear(within)
        if symbol is not None:
            raise Failed(f'silence: {what}', str(symbol))

    def until(self, is_wanted: Callable[[Symbol], bool], what: str,
              within: float) -> Symbol:
        """Return the first symbol that ``is_wanted``, whatever comes before it."""
        end = max(self._clock(), self._sent_until) + within
        while (left := end - self._clock()) > 0:
            symbol = self.hear(left)
            if symbol is not None and is_wanted(symbol):
                return symbol
        raise Failed(what, f'nothing of the kind in {within:g} s')

    def rest(self, seconds: float) -> None:
        """Wait, and keep incoming bytes for the next ``hear``."""
        end = self._clock() + seconds
        while (left := end - self._clock()) > 0:
            self.reader.wait(left)

    def drain(self, limit: float) -> None:
        """Receive and drop symbols until the line is quiet, at most ``limit`` s."""
        end = self._clock() + limit
        while self._clock() < end and self.hear(_QUIET) is not None:
            pass
