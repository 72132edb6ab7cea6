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

A procedure is a generator with one effect. ``heard = yield Send(frame, timeout)`` means "put this
frame on the line, then give me the next symbol, or a Silence when the time is up". A procedure is
written as the program that the manual prints, and composed with ``yield from``. The machine alone
knows of TX_Delay and of the time that characters take.

The machine never reads a clock: every call brings ``now``, seconds of any monotonic clock. A
driving loop (a thread with a port, or a test with a virtual line) does this::

    machine.start(now, port)
    while ...:
        port.write(machine.data_to_send())
        data = port.read(until=machine.next_call)  # but not before machine.spare_time is over
        machine.receive_data(data, now) if data else machine.handle_timeout(now)
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import dataclass
import math
from typing import NamedTuple, Protocol

from abdf1_ros.counters import Counters
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Control, Duplex, Frame, Symbol
from abdf1_ros.df1.packet import begins_good_reply, HEADER_SIZE
from abdf1_ros.df1.receiver import Receiver
from abdf1_ros.df1.sender import Outlet, Reflex, Sender
from abdf1_ros.errors import CommandExpired


class Send(NamedTuple):
    """
    Put ``frame`` on the line, then wait for the next symbol.

    - ``timeout``: seconds after the last byte has left, None for no limit; with 0 the step does
      not wait.
    - ``delay``: seconds before the frame is sent; a longer TX_Delay replaces it.
    - ``at_once``: the frame is sent without ``delay`` and without TX_Delay.
    - ``expires``: clock value (s) after which the frame is not sent any more. CommandExpired is
      then raised at the ``yield``.
    - ``reply_size``: bytes after the header of the expected good reply, 0 if unknown.

    ``reflex`` returns the frame that answers the next symbol, empty for none. The machine sends
    this frame before it hands the symbol to the procedure. The next frame that the procedure sends
    has to be the same frame. The machine does not ask ``reflex`` if there is a TX_Delay, or if
    other bytes still have to be sent.
    """

    frame: bytes
    timeout: float | None = 0.0
    delay: float = 0.0
    expires: float = math.inf
    reply_size: int = 0
    reflex: Reflex | None = None
    at_once: bool = False


class Listen(NamedTuple):
    """
    Wait for the next symbol, for ``timeout`` seconds after our last byte; None for no limit.

    With 0 the step returns only a symbol that has already come. ``is_continued`` keeps the time
    limit of the previous step. ``reflex`` is described at ``Send``.
    """

    timeout: float | None
    reflex: Reflex | None = None
    is_continued: bool = False


class Rest(NamedTuple):
    """
    Wait for ``timeout`` seconds (None: no limit), or until a call of ``Machine.wake``.

    A half-duplex master hears nothing meanwhile. For all other nodes the next symbol ends the
    wait. ``reflex`` is described at ``Send``.
    """

    timeout: float | None = None
    reflex: Reflex | None = None


Step = Send | Listen | Rest
"""The requests of a procedure to the machine."""

LISTEN_ON = Listen(None, is_continued=True)


class Silence(NamedTuple):
    """
    No symbol came before the time of a step was up.

    ``last_byte`` is the last byte that was heard, 0 for none. For a half-duplex master, only bytes
    after its last transmission count. ``is_broken_off`` tells that a message has begun and not
    ended. The line has been quiet for ``seconds``.
    """

    last_byte: int = 0
    is_broken_off: bool = False
    seconds: float = math.inf


# The result of a step that does not wait.
_NOTHING = Silence()

# Longest time (s) that an operating system or USB adapter holds a byte back. No wait for an answer
# is shorter. So Timeout = 0, which S0 allows, means "as short as the equipment can do".
MIN_RESPONSE_TIME = 0.02

# If a call comes this late (s) after a deadline, the process or its host was paused. The age of
# the bytes read next is then unknown.
MOST_LATE = 0.2

# Pauses of the process that are remembered, more than come in one transaction.
_MOST_PAUSES = 20

# After a longer pause of this process (s) the sender of a command may have given the command up.
_PATIENCE_OF_SENDERS = 1.0

# Longest rest (s) of a node that executes commands: without a deadline it would notice no pause.
LONGEST_REST = 1.0

# Seconds in which bytes may still be old bytes of a buffer: after a pause of this process, and at
# the beginning of a connection to a device server.
OLD = 0.5

# A shorter time (s) counts as 0, because no wait is more exact.
MOMENT = 0.0001

# Most characters that a UART passes on together. The last characters of a reply are read as they
# come.
_LAST_CHARACTERS = 16

_XON, _XOFF = b'\x11', b'\x13'

# Responses: a full-duplex node sends them only after it has heard a message or an ENQ to its end.
_RESPONSES = (Control.ACK, Control.NAK)

Heard = Symbol | Silence
Procedure = Generator[Step, Heard, None]


def character_time(baud: int, data_bits: int, parity: str, stop_bits: int) -> float:
    """Return the seconds that a character takes, start bit included."""
    return (1 + data_bits + (parity != 'None') + stop_bits) / baud


@dataclass(frozen=True, slots=True)
class LineTiming:
    """
    The timing of a line.

    ``char_time`` is seconds per character, start and stop bits included (0 if the line has no
    speed of its own). ``tx_delay`` seconds pass before each transmission (S0, TX_Delay).
    """

    char_time: float = 0.0
    tx_delay: float = 0.0


class Background(Protocol):
    """Work to do when it is due, even if the line is busy, and when the procedure ends."""

    def expire(self, now: float) -> None:
        """Do work that needs no line, such as ending commands that have waited too long for it."""

    def next_expiry(self) -> float:
        """Return when there is something to do next (clock value in s), infinite for never."""

    def ended(self, error: Exception | None) -> None:
        """React to the end of the procedure; ``error`` is the reason if it is known."""


class Machine:
    """
    Run one procedure over one line.

    ``procedure`` makes a new generator at every ``start``. With ``forget_on_send`` bytes that were
    heard before a transmission are dropped: for the master of a half-duplex line they cannot be
    the answer. ``counters`` gets the characters in both directions. ``background`` does its work
    even while the line is busy. After a pause of this process that is longer than
    ``senders_patience`` (s), a message ``may_be_old``; infinite where ``serve`` judges its age.

    ``sender`` has the bytes to send, ``receiver`` those that came. ``is_behind`` is set while
    bytes have come that ``receive_data`` is still to be given. ``late`` is the sum of the seconds
    by which calls came more than MOST_LATE after a deadline of the procedure. In this time the
    process, or its host, did not run.
    """

    def __init__(self, procedure: Callable[[Machine], Procedure], *, checksum: Checksum,
                 duplex: Duplex = Duplex.HALF, timing: LineTiming | None = None,
                 counters: Counters | None = None, forget_on_send: bool = False,
                 background: Background | None = None,
                 senders_patience: float = _PATIENCE_OF_SENDERS) -> None:
        self.counters = counters or Counters()
        self.timing = timing or LineTiming()
        self.sender = Sender(checksum, duplex, self.timing.char_time, self.counters)
        self.receiver = Receiver(self.sender, checksum, duplex, self.timing.char_time,
                                 self.counters, is_master=forget_on_send)
        self.now = 0.0
        self.deadline: float | None = None
        self.late = 0.0
        self.is_behind = False
        # of the last pauses, the end and the seconds
        self._pauses = deque[tuple[float, float]](maxlen=_MOST_PAUSES)
        self._old_until = -math.inf
        self._senders_patience = senders_patience
        self._background = background
        self._make_procedure = procedure
        self._forget_on_send = forget_on_send
        self._is_half_duplex = duplex is Duplex.HALF
        self._procedure: Procedure | None = None
        self._step: Step = Rest()
        self._is_listening = False
        self._due = -math.inf  # the deadline, before a message was heard out

    @property
    def next_call(self) -> float | None:
        """Return when to call ``handle_timeout`` (clock value in s), None for never."""
        first = self._background.next_expiry() if self._background else math.inf
        for moment in (self.deadline, self.sender.outgoing.due):
            if moment is not None and moment < first:
                first = moment
        if self.receiver.decoder.in_message:
            first = min(first, self._message_end())
        return None if first == math.inf else first

    @property
    def echoes(self) -> bool:
        """Tell whether the line gives back what is sent."""
        return self.sender.echo.is_heard

    @property
    def may_be_old(self) -> bool:
        """Tell whether a message may have waited, as while this process stood still."""
        return self.now < self._old_until

    @property
    def spare_time(self) -> float:
        """
        Return for how long (s) incoming bytes need not be read, because a long reply is coming in.

        One read of the whole reply avoids most of the wake-ups for single bytes. The read comes
        well before the deadline, because only bytes that have been read postpone it.
        """
        step, char_time, decoder = self._step, self.timing.char_time, self.receiver.decoder
        if not isinstance(step, Send) or not step.reply_size or not decoder.in_message:
            return 0.0
        data = decoder.link_data
        is_faster = self.now - self.sender.free_at < len(data) * char_time
        if is_faster or not begins_good_reply(data):
            return 0.0  # faster than its speed (a simulator's line), or not a good reply
        missing = HEADER_SIZE + step.reply_size - len(data) - _LAST_CHARACTERS
        spare = max(missing, 0) * char_time
        return spare if self.deadline is None else min(
            spare, max(0.0, self.deadline - self.now) / 2)

    def start(self, now: float, outlet: Outlet | None = None) -> None:
        """Start the procedure from its beginning; ``outlet`` is the port of the line."""
        self.stop(None, now)
        self.sender.begin(now, outlet)
        self._procedure = self._make_procedure(self)
        self._resume(None)

    def treat_as_old(self) -> None:
        """Treat the messages of the next half second as messages that may have waited."""
        self._old_until = self.now + OLD

    def stop(self, error: Exception | None, now: float) -> None:
        """
        End the procedure; if there is an ``error``, raise it inside the procedure first.

        A procedure handles the error like the end of its transaction, so each of its commands gets
        a result. ``now`` is when this happens, mostly long after the last call.
        """
        self.now = now
        procedure, self._procedure = self._procedure, None
        self.sender.clear()
        self.receiver.decoder.reset()
        self.deadline, self._is_listening = None, False
        if procedure is None:
            return
        try:
            if error is not None:
                with suppress(StopIteration, type(error)):
                    procedure.throw(error)
            procedure.close()
        finally:
            if self._background is not None:
                self._background.ended(error)

    def came(self, count: int, now: float) -> None:
        """Record a read from a connection, whose bytes come with ``receive_data``, in parts."""

    def receive_data(self, data: bytes, now: float) -> None:
        """Take bytes from the line."""
        self.now = now
        receiver, decoder = self.receiver, self.receiver.decoder
        self.counters.chars_received += len(data)
        receiver.flow_controls += data.count(_XON) + data.count(_XOFF)
        if self._forget_on_send and (self.sender.waiting or not self._is_listening):
            if not self.sender.waiting:
                receiver.count_unheard(data)
            return  # these bytes came before our command left, so they cannot answer it
        if self._is_listening and now - receiver.last_heard > receiver.pause_limit:
            if not decoder.in_message:
                decoder.reset()  # a symbol that broke off must not swallow the next one
            elif now > self._message_end():
                self._resume(receiver.broken_off())
        receiver.last_heard = now
        decoder.feed(data)
        self._deliver_symbols()
        # A message that began in time, and is not too slow, is heard to its end.
        if decoder.in_message and receiver.began_in_time(now, self._due) and self._is_listening \
                and self.deadline is not None and not isinstance(self._step, Rest):
            self.deadline = max(self.deadline, receiver.hears_until)

    def drop(self, count: int, now: float) -> None:
        """Record bytes from the line that came too fast to be of use; the next may be old."""
        self.now = now
        self.receiver.drop(count)
        if self._senders_patience < math.inf:
            self.treat_as_old()

    def _message_end(self) -> float:
        """Return when a message that stops is over, infinite while an answer is waited for."""
        is_idle = self.deadline is None or isinstance(self._step, Rest)
        return self.receiver.last_heard + self.receiver.pause_limit \
            if is_idle and self._is_listening else math.inf

    def handle_timeout(self, now: float) -> None:
        """Do what is due when the clock reads ``now``; nothing before ``next_call``."""
        self.now = now
        # first, before anything sets another deadline
        if self.deadline is not None and now - self.deadline > MOST_LATE:
            self._note_pause(now, now - self.deadline)
        has_expired = self._expire(now)
        due = self.sender.outgoing.due
        if due is not None and now >= due:
            self.sender.next_portion(now)
        receiver, decoder = self.receiver, self.receiver.decoder
        if decoder.in_message and now >= self._message_end():
            self._resume(receiver.broken_off())
        if self.deadline is None or now < self.deadline:
            if has_expired:  # what waited for it may go out now
                self._end_rest()
            return
        step = self._step
        if isinstance(step, Send) and not self._is_listening:  # its delay is over
            self._transmit(step)
        else:
            self._resume(
                Silence(decoder.last_byte, decoder.in_message, now - receiver.last_heard))
        self._deliver_symbols()

    def _note_pause(self, now: float, seconds: float) -> None:
        """Record a pause of the process, which ends now."""
        self.late += seconds
        self._pauses.append((now, seconds))
        if seconds > self._senders_patience:
            self.treat_as_old()

    def _expire(self, now: float) -> bool:
        """Do the work that needs no line; return True if there was some."""
        if self._background is None or now < self._background.next_expiry():
            return False
        self._background.expire(now)
        return True

    def took(self, begun: float, now: float) -> float:
        """Return the seconds from a clock value to now, without pauses of the process."""
        return now - begun - sum(seconds for end, seconds in self._pauses if end > begun)

    def wake(self, now: float) -> None:
        """End a rest early: there may be something new to do."""
        self.now = now
        if self._background is not None and self._procedure is not None:
            self._background.expire(now)
        self._end_rest()

    def _end_rest(self) -> None:
        if self._procedure is not None and isinstance(self._step, Rest):
            self._resume(_NOTHING)
            self._deliver_symbols()

    def data_to_send(self) -> bytes:
        """Return, once, the bytes to put on the line now."""
        return self.sender.data_to_send()

    def withdraw(self, now: float) -> None:
        """
        Take back a command that has become too old since its age was checked.

        If the procedure has already gone on to another step, it gets no error.
        """
        self.now = now
        expires = self.sender.send_before
        self.sender.withdraw(now)
        if isinstance(self._step, Send) and self._step.expires == expires:
            self._resume(_NOTHING, CommandExpired())
            self._deliver_symbols()

    def _deliver_symbols(self) -> None:
        sender, receiver = self.sender, self.receiver
        while self._is_listening and receiver.decoder.waiting \
                and (symbol := receiver.next_symbol()) is not None:
            if self._step.reflex is not None and not self.timing.tx_delay:
                sender.react(self._step.reflex, symbol)
            if self._is_half_duplex:  # a symbol came, so our bytes have left
                sender.free_at = min(sender.free_at, self.now)
            elif symbol in _RESPONSES:
                sender.answered(self.now)
            if isinstance(symbol, Frame):
                sender.embeds |= symbol.has_response and symbol.fault is None
            self._resume(symbol)

    def _resume(self, heard: Heard | None, error: CommandExpired | None = None) -> None:
        """Run the procedure up to a step that has to wait; None starts it."""
        procedure = self._procedure
        while procedure is not None:
            try:
                step = procedure.throw(error) if error else next(procedure) if heard is None \
                    else procedure.send(heard)
            except StopIteration:
                self._procedure, self.deadline, self._is_listening = None, None, False
                return
            heard, error = _NOTHING, None
            self._step = step
            if isinstance(step, Send):
                if self.now > step.expires:
                    error = CommandExpired()
                elif not self._send(step):
                    return
            elif not self._wait(step):
                return
            else:
                heard = self.receiver.next_symbol() or _NOTHING

    def _wait(self, step: Listen | Rest) -> bool:
        """Begin to wait; return True if the step does not wait."""
        if isinstance(step, Listen) and step.is_continued:
            return False
        is_rest = isinstance(step, Rest)
        self._is_listening = not (is_rest and self._forget_on_send)
        begun = self.now if is_rest else max(self.now, self.sender.free_at)
        self._due = begun + (step.timeout or 0.0)
        self.deadline = None if step.timeout is None else self._due
        return step.timeout == 0 and not is_rest

    def _send(self, step: Send, *, is_due: bool = False) -> bool:
        """
        Send a frame, after its delay unless it ``is_due``.

        Return whether the procedure goes on at once.
        """
        sender = self.sender
        if not is_due and not step.at_once and (
                delay := max(step.delay, self.timing.tx_delay)):
            self._is_listening = False
            self.deadline = max(self.now, sender.free_at) + delay
            return False
        self._is_listening = True
        sender.put(step.frame, self.now, step.expires)
        if self._forget_on_send:
            self.receiver.decoder.reset()
        self._due = sender.free_at + (step.timeout or 0.0)
        self.deadline = None if step.timeout is None else self._due
        if step.timeout != 0:
            return False
        if sender.waiting:
            sender.flush()
        return True

    def _transmit(self, step: Send) -> None:
        """Send a frame whose delay is over, unless it has become too old."""
        if self.now > step.expires:
            self._resume(_NOTHING, CommandExpired())
        elif self._send(step, is_due=True):
            self._resume(_NOTHING)
