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
What a target says, byte for byte: to the cases of ``conform``, and to anything else.

Two targets that say the same to some thousand random pieces differ in nothing that a line shows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from random import Random
import signal
import sys
from types import FrameType
from typing import TypeVar

from abdf1_ros.conform import codec
from abdf1_ros.conform.case import Target
from abdf1_ros.conform.codec import BlockCheck, Symbol, SymbolKind
from support.mutated_ends import Wire

_CHAR_TIME = 0.0005  # s
_MOST_TOLD = 32  # bytes
LONGEST_TURN = 2.0  # s of the processor, of an end that does not come back
_PAUSES = (0.001, 0.03, 0.2, 0.9, 1.1, 5.5)  # s
_NODES = (1, 1, 1, 1, 1, 5, 7, 0xFF)  # of an end: 1, of us: 5
_DATA = bytes.fromhex('10 10 03 00 FF 10 15 06 55 AA')


_Result = TypeVar('_Result')


class Ended(Exception):
    """The end has not come back."""


def _stop(number: int, frame: FrameType | None) -> None:
    raise Ended(f'it is busy for more than {LONGEST_TURN:g} s')


class Line:
    """
    A line to an end, at 0.5 ms a byte.

    If the end raises an exception it is dead, and says nothing any more; ``death`` tells why.
    ``log`` has all that was said on it: time (s), bytes, and whether the end has said them.
    """

    def __init__(self, make: Callable[[], Wire]) -> None:
        self._now = 0.0
        self.death = ''
        self.log: list[tuple[float, bytes, bool]] = []
        self._end = self._turn(make)

    def clock(self) -> float:
        """Return the time (s)."""
        return self._now

    def write(self, data: bytes) -> None:
        """Send bytes to the end."""
        self.log.append((self._now, data, False))
        if end := self._end:
            self._turn(lambda: end.write(data))

    def read(self, timeout: float) -> bytes:
        """Let time pass until the end says something, at most ``timeout`` s."""
        until, end = self._now + timeout, self._end
        said = self._turn(lambda: end.read(timeout)) if end else b''
        if not said or end is None:
            self._now = until
            return b''
        end.now += _CHAR_TIME * len(said)
        self._now = end.now
        self.log.append((self._now, said, True))
        return said

    def _turn(self, act: Callable[[], _Result]) -> _Result | None:
        if self.death:
            return None
        before = signal.signal(signal.SIGVTALRM, _stop)
        signal.setitimer(signal.ITIMER_VIRTUAL, LONGEST_TURN)
        try:
            return act()
        except Exception as error:  # whatever a mutation may raise
            self.death = f'{type(error).__name__}: {error}'
            return None
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
            signal.signal(signal.SIGVTALRM, before)


class Stranger:
    """Says anything to a target: what is usual, what is damaged, what belongs elsewhere."""

    def __init__(self, line: Line, target: Target, check: str, family: str, seed: int) -> None:
        self._line, self._target, self._family = line, target, family
        self._check = BlockCheck(check)
        self._random = Random(seed)
        self._asks = target in (Target.SLAVE, Target.PEER, Target.RADIO)
        self._sent = self._command()  # link data
        self._heard: Symbol | None = None
        self._begun = b''

    def talk(self, steps: int) -> None:
        """Say so many pieces, and listen for a while after each; begin with listening."""
        self._hear(self._line.read(1.0))
        for _ in range(steps):
            is_usual = self._random.random() < 0.6
            self._line.write(self._usual() if is_usual else self._random.choice([
                self._message, self._again, self._altered, self._damaged, self._cut, self._noise,
                self._symbol, self._divided, self._poll])())
            until = self._line.clock() + self._random.choice(_PAUSES)
            while (left := until - self._line.clock()) > 0:
                self._hear(self._line.read(left))

    def _hear(self, said: bytes) -> None:
        self._begun += said
        while symbol := codec.next_symbol(
                self._begun, self._check, self._target is Target.MASTER):
            self._begun = self._begun[len(symbol.raw):]
            self._heard = symbol
            if not self._asks and codec.is_command(symbol):
                command = symbol.data
                self._sent = bytes((command[1], command[0], command[2] | codec.REPLY_BIT, 0)) \
                    + command[4:6] + self._random.randbytes(self._random.choice((0, 4, 7)))

    def _usual(self) -> bytes:
        """Return what keeps a conversation going."""
        heard = self._heard and self._heard.kind
        is_new = heard in (SymbolKind.MESSAGE, SymbolKind.MASTER_MESSAGE)
        if is_new and not self._target.is_radio:
            self._heard = None
            return codec.ACK
        if self._target is Target.SLAVE and heard is SymbolKind.ACK:
            return codec.poll(1)
        return self._message()

    def _message(self) -> bytes:
        """Return a new command, or the reply to the last one."""
        if self._asks:
            self._sent = self._command()
        return self._frame(self._sent)

    def _frame(self, data: bytes) -> bytes:
        if self._target is Target.SLAVE:
            return codec.master_message(data[0], data, self._check)
        return codec.message(data, self._check)

    def _command(self) -> bytes:
        draw = self._random
        dst = draw.choice(_NODES)
        cmd, body = draw.choice([
            (0x06, b'\x00' + draw.randbytes(draw.choice((0, 1, 60)))), (0x06, b'\x00' + _DATA),
            (0x06, b'\x03'), (0x06, b'\x01\x00\x00\x1A'), (0x0C, b''), (0x0F, b'\xE7'),
            *[(0x0F, self._typed()) for _ in range(4)]])
        return bytes((dst, draw.choice((5, 5, 5, 1, 7)), cmd, 0)) + draw.randbytes(2) + body

    def _typed(self) -> bytes:
        """Return a read, a write, or a masked write of words, some of which do not exist."""
        draw = self._random
        element, count = draw.choice((0, 2, 3, 17, 19, 20, 300)), draw.choice((1, 1, 2, 4))
        words = draw.choice((draw.randbytes(2 * count), bytes(2 * count)))
        level = bytes((element,)) if element < 255 else b'\xFF' + element.to_bytes(2, 'little')
        if self._family == 'SLC':
            place = draw.choice((b'\x07', b'\x07', b'\x07', b'\x09')) + b'\x89' + level + b'\x00'
            return draw.choice([
                bytes((0xA2, 2 * count)) + place, bytes((0xAA, 2 * count)) + place + words,
                b'\xAB\x02' + place + draw.randbytes(4)])
        place = draw.choice((
            b'\x06\x07' + level, b'\x07\x00\x07' + level, b'\x06\x09' + level,
            b'\x00$N7:' + str(element).encode() + b'\x00'))
        size = count.to_bytes(2, 'little')
        return draw.choice([
            b'\x68\x00\x00' + size + place + size,
            b'\x67\x00\x00' + size + place + bytes((0x99, 0x09, 1 + 2 * count, 0x42)) + words,
            b'\x26' + place + draw.randbytes(4)])

    def _again(self) -> bytes:
        return self._frame(self._sent)

    def _altered(self) -> bytes:
        """Return the last message with another byte in its header, or some bytes short."""
        at = self._random.randrange(8)
        if at > 5:
            return self._frame(self._sent[:at - 2])
        data = bytearray(self._sent)
        data[at] ^= self._random.choice((0x01, 0x04, 0x40))
        return self._frame(bytes(data))

    def _damaged(self) -> bytes:
        return self._random.choice(codec.all_damaged(self._frame(self._sent), self._check))

    def _cut(self) -> bytes:
        frame = self._frame(self._sent)
        return frame[:self._random.randrange(1, len(frame))] + self._random.choice((
            b'', codec.ENQ, codec.EOT))

    def _noise(self) -> bytes:
        return self._random.choice((b'\x55\x00', b'\x00', b'\x10', b'\x10\x03', b'\x10\x01\x01'))

    def _symbol(self) -> bytes:
        return self._random.choice((codec.ACK, codec.NAK, codec.ENQ, codec.EOT))

    def _divided(self) -> bytes:
        """Return a message with a response in it."""
        begun, rest = codec.divided(self._frame(self._sent))
        return begun + self._random.choice((codec.ACK, codec.NAK)) + rest

    def _poll(self) -> bytes:
        """Return a poll, also a wrong one; in other disciplines a message of the next command."""
        if not self._target.is_half_duplex:
            return self._message()
        poll = codec.poll(self._random.choice(_NODES))
        return self._random.choice((poll, poll, codec.damaged(poll)))


def first_difference(one: Line, other: Line) -> str:
    """Return where two conversations differ in what the ends have said; empty if they do not."""
    for at, (left, right) in enumerate(zip(one.log, other.log, strict=False)):
        if left != right:
            sent = next((entry for entry in reversed(one.log[:at]) if not entry[2]), None)
            what = 'nothing' if sent is None else _short(sent[1])
            return f'after {what} it says {_told(right)}, not {_told(left)}'
    return '' if len(one.log) == len(other.log) else 'one of them says more at the end'


def _told(entry: tuple[float, bytes, bool]) -> str:
    at, raw, is_said = entry
    return f'{_short(raw)} at {at:.3f} s' if is_said else 'nothing'


def _short(raw: bytes) -> str:
    return raw[:_MOST_TOLD].hex(' ') + ' ...' * (len(raw) > _MOST_TOLD)


@contextmanager
def reached(*names: str) -> Iterator[set[tuple[str, int]]]:
    """Collect the lines that are executed in files of these names, as (name, line)."""
    lines: set[tuple[str, int]] = set()

    def trace(frame: FrameType, event: str, argument: object) -> object:
        name = frame.f_code.co_filename
        if name not in names:
            return None
        if event == 'line':
            lines.add((name, frame.f_lineno))
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        yield lines
    finally:
        sys.settrace(before)
