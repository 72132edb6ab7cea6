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
The engine under every link procedure: bytes and a clock value in, bytes and a deadline out.

A procedure is a generator with one effect. ``heard = yield Step(frame, timeout)`` means "put
this frame on the line, then give me the next symbol, or a Silence when the time is up". What the
manual writes as a program is written here as the same program, and composed with ``yield
from``. The machine alone knows of TX_Delay and of the time that characters take.

The machine never reads a clock: every call brings ``now``, seconds of any monotonic clock. A
driving loop (a thread with a port, or a test with a virtual line) does this::

    machine.start(now)
    while ...:
        port.write(machine.data_to_send())
        data = port.read(until=machine.next_call)  # but not before machine.spare_time is over
        machine.receive_data(data, now) if data else machine.handle_timeout(now)
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import dataclass
import math
from typing import NamedTuple, Protocol

from abdf1_ros.counters import Counters
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.echo import LineEcho
from abdf1_ros.df1.frames import (
    ACK,
    Control,
    Duplex,
    Frame,
    FrameDecoder,
    MAX_LINK_DATA,
    NAK,
    NOISE,
    Symbol,
)
from abdf1_ros.df1.outgoing import Outgoing
from abdf1_ros.df1.packet import begins_good_reply, HEADER_SIZE
from abdf1_ros.errors import CommandExpired

Reflex = Callable[[Symbol], bytes]


class Step(NamedTuple):
    """
    What a procedure asks of the machine.

    ``frame`` goes on the line (empty: only listen; None: rest until the time is up or
    ``Machine.wake``, deaf to a half-duplex line). ``timeout`` is in seconds from the moment the
    last byte has left (0: do not wait; where there is nothing to send either, hear what is here
    already; None: no limit; KEEP: what is left of the time of the last step). ``delay`` seconds
    pass before the frame goes out, and TX_Delay at least, unless it is AT_ONCE. After ``expires``
    (clock value in s) it does not go out any more: CommandExpired is raised at the ``yield``.
    ``reply_size`` is the bytes after the header of the reply that is expected, if that tells no
    error; 0 where it is not known.

    ``reflex`` gives the frame that answers the next symbol, empty for none. That goes on the line
    before the procedure hears of the symbol, and has to be what the procedure then sends. It is
    not asked where there is a TX_Delay, or something else still has to go out.
    """

    frame: bytes | None
    timeout: float | None
    delay: float = 0.0
    expires: float = math.inf
    reply_size: int = 0
    reflex: Reflex | None = None


class Silence(NamedTuple):
    """
    What was heard when the time of a step was up: no symbol.

    ``last_byte`` is the last byte that was heard, 0 for none (where a transmission forgets what
    was before it: since the last one). ``is_broken_off`` tells that a message had begun. The
    line has been quiet for ``seconds``.
    """

    last_byte: int = 0
    is_broken_off: bool = False
    seconds: float = math.inf


# After a step that was not to wait.
_NOTHING = Silence()

# An operating system or USB adapter may hold a byte back for so long (s). No wait is shorter, so
# Timeout = 0, which S0 allows, means "as short as the equipment can do".
MIN_RESPONSE_TIME = 0.02

# Whoever is called so many seconds after a deadline has not run meanwhile: this process, or its
# host, was paused, and nobody knows how long what comes then has lain in a buffer.
MOST_LATE = 0.2

# What an operating system or a device server may hold bytes of a frame back (s).
HELD_BACK = 0.1

# A message that has begun may take so many times as long as its bytes take at the set speed, but
# no longer than the longest one, and two pauses besides. Without a limit a station that dribbles,
# or never ends, would keep the line from all others.
_SLOWEST = 4
_LONGEST = 2 * MAX_LINK_DATA

# Characters that a UART may hand on at once. The end of a reply is waited for as it comes.
_LAST_CHARACTERS = 16

# What nobody says in full duplex before he has heard a message or an ENQ to its end.
_RESPONSES = (Control.ACK, Control.NAK)

KEEP = -1.0
AT_ONCE = -1.0
LISTEN_ON = Step(b'', KEEP)

Heard = Symbol | Silence
Procedure = Generator[Step, Heard, None]


@dataclass(frozen=True, slots=True)
class LineTiming:
    """
    What the machine must know of the line.

    ``char_time`` is seconds per character, start and stop bits included (0 where the line
    has no speed of its own); ``tx_delay`` seconds pass before each transmission (S0, TX_Delay).
    """

    char_time: float = 0.0
    tx_delay: float = 0.0


class _Incoming(NamedTuple):
    """
    The message that is coming in: when its first bytes came, and how many had come by then.

    ``is_in_time`` tells whether it has begun before the time for it was up.
    """

    number: int = 0
    begun: float = 0.0
    heard: int = 0
    is_in_time: bool = False


class Background(Protocol):
    """What has to be done in time whatever the line is busy with, and at the end."""

    def expire(self, now: float) -> None:
        """Do what needs no line, such as ending what has waited too long for it."""

    def next_expiry(self) -> float:
        """Return when there is something to do next (clock value in s), infinite for never."""

    def ended(self, error: Exception | None) -> None:
        """Take note that the procedure has ended, and why if that is known."""


class Machine:
    """
    Run one procedure over one line.

    ``procedure`` makes the generator, afresh at every ``start``. With ``forget_on_send`` what
    was heard before a transmission is dropped: for the master of a half-duplex line it cannot
    be the answer. ``counters`` gets the characters in both directions.

    A reflex, and a frame after which nothing is waited for, such as an ACK, is handed to
    ``send_at_once`` where that is set, so that it is on the line while the reply is made use of.
    All others come from ``data_to_send``.

    ``unsent`` asks the port how many bytes have still to leave, as far as it can tell;
    ``position`` counts the bytes given out so far. Once the other end ``embeds`` responses, a long
    message is given out in portions, and a response goes between two of them (M 4-3), as products
    do with Embedded Responses = Auto-detect.
    ``send_before`` is the clock value (s) after which ``withdraw`` is due in place of
    ``data_to_send``. ``late`` is the sum of the seconds by which it was called after a deadline of
    its procedure: so long this process, or its host, has not run.
    """

    def __init__(self, procedure: Callable[[Machine], Procedure], *, checksum: Checksum,
                 duplex: Duplex = Duplex.HALF, timing: LineTiming | None = None,
                 counters: Counters | None = None, forget_on_send: bool = False) -> None:
        self.decoder = FrameDecoder(checksum, duplex)
        self.counters = counters or Counters()
        self.now = 0.0
        self.deadline: float | None = None
        self.send_at_once: Callable[[bytes], None] = self._keep
        self.unsent: Callable[[], int] = lambda: 0
        self.background: Background | None = None
        self.late = 0.0
        self._woke, self._slept = -math.inf, 0.0
        self.position = 0
        self.embeds = False
        self.send_before = math.inf
        self._fresh = b''  # the last of what is to be sent, which must leave before that
        self._make_procedure = procedure
        self._timing = timing or LineTiming()
        self._outgoing = Outgoing(checksum, self._timing.char_time)
        self._pause_limit = 20 * self._timing.char_time + HELD_BACK  # inside a frame
        self._forget_on_send = forget_on_send
        self._is_half_duplex = duplex is Duplex.HALF
        self._procedure: Procedure | None = None
        self._out = b''
        self._pending: Step | None = None  # waits for its delay before it goes out
        self._kept_deadline: float | None = None
        self._resting = False
        self._is_listening = False
        self._line_free = -math.inf
        self._reply_size = 0
        self._reflex: Reflex | None = None
        self._ahead = b''  # on the line by reflex, and not yet sent by the procedure
        self._last_heard = -math.inf
        self._echo = LineEcho(duplex is Duplex.HALF)
        self._due = -math.inf  # the deadline, before a message was heard out
        self._message = _Incoming()

    @property
    def next_call(self) -> float | None:
        """Return when to call ``handle_timeout`` (clock value in s), None for never."""
        first = self.background.next_expiry() if self.background else math.inf
        for moment in (self.deadline, self._outgoing.due):
            if moment is not None and moment < first:
                first = moment
        return None if first == math.inf else first

    @property
    def char_time(self) -> float:
        """Return the seconds that a character takes on the line."""
        return self._timing.char_time

    @property
    def tx_delay(self) -> float:
        """Return the seconds that pass before each transmission."""
        return self._timing.tx_delay

    @property
    def free_at(self) -> float:
        """Return when what is being sent has left, by its size (clock value in s)."""
        return self._line_free

    @property
    def echoes(self) -> bool:
        """Tell whether the line gives back what is sent."""
        return self._echo.is_heard

    def has_left(self, position: int) -> bool:
        """Tell whether the bytes up to this ``position`` have left, as far as the port knows."""
        return self.position - self._still_here >= position

    @property
    def _still_here(self) -> int:
        return self._outgoing.size + len(self._out) + self.unsent()

    @property
    def spare_time(self) -> float:
        """
        Return for how long (s) nothing that comes can matter: a reply is coming in, and is long.

        To read it in one go spares most of the wakings that its bytes cost, a few at a time.
        """
        if not self._reply_size or not self.decoder.in_message:
            return 0.0
        data = self.decoder.link_data
        is_faster = self.now - self._line_free < len(data) * self._timing.char_time
        if is_faster or not begins_good_reply(data):
            return 0.0  # it does not have that speed (a simulator's), or the reply is another
        missing = HEADER_SIZE + self._reply_size - len(data) - _LAST_CHARACTERS
        return max(missing, 0) * self._timing.char_time

    def start(self, now: float) -> None:
        """Begin the procedure from its beginning."""
        self.stop()
        self.now = now
        self._line_free = now
        self._procedure = self._make_procedure(self)
        self._resume(None)

    def stop(self, error: Exception | None = None) -> None:
        """
        End the procedure; with ``error``, raise that inside it first.

        A procedure handles the error like the end of its transaction, so nothing it was doing
        is left without a result.
        """
        procedure, self._procedure = self._procedure, None
        self._out, self._ahead, self.send_before = b'', b'', math.inf
        self._outgoing.clear()
        self.embeds = False
        self.decoder.reset()
        self._pending, self._resting, self.deadline = None, False, None
        self._is_listening = False
        self._echo.forget()
        if procedure is None:
            return
        try:
            if error is not None:
                with suppress(StopIteration, type(error)):
                    procedure.throw(error)
            procedure.close()
        finally:
            if self.background is not None:
                self.background.ended(error)

    def receive_data(self, data: bytes, now: float) -> None:
        """Take bytes from the line."""
        self.now = now
        self.counters.chars_received += len(data)
        if self._forget_on_send and (self._out or not self._is_listening):
            return  # it was said before what it would have to answer
        is_idle = self._resting or self.deadline is None
        if is_idle and self._is_listening and now - self._last_heard > self._pause_limit:
            self.decoder.reset()  # what broke off must not swallow what begins now
        self._last_heard = now
        self.decoder.feed(data)
        self._deliver_symbols()
        if self.decoder.in_message:
            self._hear_out(now)

    def _hear_out(self, now: float) -> None:
        """Let a message that has begun in time be heard to its end, unless it pauses or crawls."""
        heard = self.counters.chars_received
        if self._message.number != self.decoder.begun:
            self._message = _Incoming(self.decoder.begun, now, heard, now <= self._due)
        if self.deadline is None or self._resting or not self._message.is_in_time \
                or not self._is_listening:
            return
        characters = min(_SLOWEST * (heard - self._message.heard), _LONGEST)
        limit = self._message.begun + 2 * self._pause_limit + characters * self._timing.char_time
        self.deadline = max(self.deadline, min(now + self._pause_limit, limit))

    def handle_timeout(self, now: float) -> None:
        """Take note that the clock reads ``now``; does nothing before ``next_call``."""
        self.now = now
        if self.background is not None and now >= self.background.next_expiry():
            self.background.expire(now)
        if self._outgoing.due is not None and now >= self._outgoing.due:
            self._out += self._outgoing.next(now)
        if self.deadline is None or now < self.deadline:
            return
        self.late += now - self.deadline
        if now - self.deadline > MOST_LATE:
            self._woke, self._slept = now, now - self.deadline
        if self._pending is not None:
            self._transmit(self._pending)
        else:
            decoder = self.decoder
            self._resume(Silence(decoder.last_byte, decoder.in_message, now - self._last_heard))
        self._deliver_symbols()

    def took(self, begun: float, now: float) -> float:
        """Return the seconds from a clock value to now, but for the last pause."""
        return now - begun - (self._slept if self._woke > begun else 0.0)

    def wake(self, now: float) -> None:
        """End a rest early: there may be something new to do."""
        self.now = now
        if self.background is not None and self._procedure is not None:
            self.background.expire(now)
        if self._resting:
            self._resume(_NOTHING)
            self._deliver_symbols()

    def data_to_send(self) -> bytes:
        """Return, once, the bytes to put on the line now."""
        data, self._out, self.send_before = self._out, b'', math.inf
        return data

    def withdraw(self, now: float) -> None:
        """Take back a command that has become too old since it was looked at."""
        self.now = now
        size = len(self._fresh) + self._outgoing.size
        self._out = self._out.removesuffix(self._fresh)
        self._outgoing.clear()
        self._echo.withdrawn()
        self.counters.chars_sent -= size
        self.position -= size
        self._line_free, self.send_before = now, math.inf
        self._resume(_NOTHING, CommandExpired())
        self._deliver_symbols()

    def _next_symbol(self) -> Symbol | None:
        """
        Return what somebody else has said, None when more bytes are needed.

        A message of ours that comes back is noise in full duplex: a response that was given before
        must not count for it (M 4-8), in case that it is a PLC's after all.
        """
        while (symbol := self.decoder.next_symbol()) is not None:
            # A master sends no frame without a station, and no response before it hears its echo.
            is_slaves = self._forget_on_send and (
                symbol.station is None if isinstance(symbol, Frame)
                else isinstance(symbol, Control) and not self._echo.is_heard)
            if is_slaves or not self._echo.is_ours(symbol, self.has_left):
                break
            if isinstance(symbol, Frame) and not self._is_half_duplex:
                return NOISE
        return symbol

    def _deliver_symbols(self) -> None:
        while self._is_listening and self.decoder.waiting \
                and (symbol := self._next_symbol()) is not None:
            if self._reflex is not None and not (self._out or self._outgoing.size) \
                    and (frame := self._reflex(symbol)):
                self._ahead = frame
                self.send_at_once(frame)
            if self._is_half_duplex:  # what we have sent has left
                self._line_free = min(self._line_free, self.now)
            elif symbol in _RESPONSES:
                self._take_as_answer()
            if isinstance(symbol, Frame):
                self.embeds |= symbol.has_response and symbol.fault is None
            self._resume(symbol)

    def _keep(self, data: bytes) -> None:
        self._out += data

    def _take_as_answer(self) -> None:
        """Conclude from an answer that what we have sent has left, but what is still here."""
        left = self.now + self._still_here * self._timing.char_time
        self._line_free = min(self._line_free, left)

    def _resume(self, heard: Heard | None, error: CommandExpired | None = None) -> None:
        """Run the procedure up to a step that has to wait; None starts it."""
        procedure = self._procedure
        while procedure is not None:
            try:
                # None is what a generator is started with, and no procedure sees it.
                step = procedure.throw(error) if error else procedure.send(
                    heard)  # type: ignore[arg-type]
            except StopIteration:
                self._procedure, self.deadline, self._is_listening = None, None, False
                return
            heard, error = _NOTHING, None
            if self.now > step.expires:
                error = CommandExpired()
            elif not self._take_step(step):
                return
            elif not step.frame:
                heard = self._next_symbol() or _NOTHING

    def _take_step(self, step: Step) -> bool:
        """Carry out a step; return whether the procedure goes on at once."""
        self._resting = step.frame is None
        self._reflex = None if self._timing.tx_delay else step.reflex
        if self._resting:
            self._is_listening = not self._forget_on_send
            self._reply_size, self._due = step.reply_size, self.now + (step.timeout or 0.0)
            self.deadline = None if step.timeout is None else self._due
            return False
        delay = max(step.delay, self._timing.tx_delay) if step.frame else 0.0
        if delay and step.delay != AT_ONCE:
            self._pending, self._kept_deadline, self._is_listening = step, self.deadline, False
            self.deadline = max(self.now, self._line_free) + delay
            return False
        return self._put_on_line(step)

    def _put_on_line(self, step: Step) -> bool:
        self._is_listening = True
        free = max(self.now, self._line_free)
        if step.frame:
            size = len(step.frame)
            is_alone = not self._outgoing.size
            is_divided = self.embeds or not is_alone
            self._fresh = self._given_out(step.frame, free) if is_divided else step.frame
            ahead, self._ahead = self._ahead, b''
            assert ahead in (b'', step.frame)
            self._out += b'' if ahead else self._fresh
            self.send_before = step.expires if is_alone else math.inf
            self.counters.chars_sent += size
            self.position += size
            self._line_free = free = free + size * self._timing.char_time
            self._echo.sent(step.frame, self.position)
            if self._forget_on_send:
                self.decoder.reset()
        if step.timeout != KEEP:
            self._reply_size, self._due = step.reply_size, free + (step.timeout or 0.0)
            self.deadline = None if step.timeout is None else self._due
        if step.timeout != 0:
            return False
        if self._out:
            self.send_at_once(self.data_to_send())
        return True

    def _given_out(self, frame: bytes, free: float) -> bytes:
        """Return what goes out at once of a frame; the line is busy until ``free``."""
        if self._outgoing.can_embed and frame in (ACK, NAK):
            return frame  # after the portion of our message on the line, before the rest of it
        return self._outgoing.put(frame, free)

    def _transmit(self, step: Step) -> None:
        self._pending, self.deadline = None, self._kept_deadline
        if self.now > step.expires:
            self._resume(_NOTHING, CommandExpired())
        elif self._put_on_line(step):
            self._resume(_NOTHING)
