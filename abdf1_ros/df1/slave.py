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
The half-duplex slave: a station that answers a master (M 3-4, 3-5, 3-9..3-11; KF2 4-31).

A slave only reacts, so it is one method: ``handle`` takes a symbol and returns the bytes to send.
It never sends DLE NAK. If it cannot accept a message, it gives no answer, and the master tries
again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
import math
from typing import Protocol

from abdf1_ros.counters import Counters
from abdf1_ros.df1 import frames
from abdf1_ros.df1.accounting import count_control, count_fault, Tally
from abdf1_ros.df1.frames import Control, Frame, NOISE, Poll, Symbol, Unknown
from abdf1_ros.df1.machine import (
    Heard,
    Listen,
    Machine,
    MOMENT,
    Procedure,
    Rest,
    Send,
    Silence,
    Step,
)
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.errors import LineReset, LinkError, NeverTaken
from abdf1_ros.messages import Event, Message

# Interval (s) at which a slave looks for overdue commands.
TICK = 0.25


class Initiator:
    """Give a slave commands to send, and take their results; this base class has no commands."""

    def polled(self) -> None:
        """Record that the master has polled us."""

    def next_command(self) -> Packet | None:
        """Return a command to send in answer to a poll."""
        return None

    def delivered(self, command: Packet) -> None:
        """Record that the master has acknowledged a command."""

    def undelivered(self, command: Packet, error: LinkError) -> None:
        """Record that a command was given up, and why."""

    def replied(self, reply: Packet) -> None:
        """Take a reply that the master has passed on to us."""


@dataclass(slots=True)
class _Held:
    """A message sent and not yet acknowledged, and how often it has been sent."""

    packet: Packet
    sent: int = 0


class HalfDuplexSlave:
    """
    One station on a half-duplex line.

    ``serve`` executes a command and returns its reply. It is called after the command has been
    accepted, once for each command, never for a repetition. ``initiator`` gives the commands that
    this station sends, if there are any. ``report`` gets the faults of messages for us.

    A stored message may be acknowledged before it is executed (KF2 4-31). So a caller that has a
    line sends the bytes of ``respond`` first, and then calls ``make_use``. ``handle`` does both
    without a line.
    """

    def __init__(self, settings: LinkSettings, serve: Callable[[Packet], Packet],
                 counters: Counters | None = None, initiator: Initiator | None = None,
                 report: Callable[[Event], None] = lambda event: None) -> None:
        self.counters = counters or Counters()
        self._initiator = initiator or Initiator()
        self._tally = Tally(self.counters, report)
        self._settings = settings
        self._serve = serve
        self._queue: deque[Packet] = deque()
        self._held: _Held | None = None
        self._just_sent = False
        self._sent_reply = True
        self._last_key: tuple[int, int, int] | None = None
        self._unused: tuple[Packet, bool] | None = None  # and whether it wants a reply

    def handle(self, symbol: Symbol) -> bytes:
        """Return the bytes that this station sends after ``symbol``, mostly none."""
        response = self.respond(symbol)
        self.make_use()
        return response

    def respond(self, symbol: Symbol) -> bytes:
        """Return the bytes that answer a symbol, and leave its message to ``make_use``."""
        just_sent, self._just_sent = self._just_sent, False
        if isinstance(symbol, Poll):
            return self._polled(symbol)
        if isinstance(symbol, Frame):
            return self._received(symbol)
        count_control(symbol, self.counters)
        if symbol is Control.ACK and just_sent:
            self._release()  # an ACK names no station: it is ours only straight after our message
        elif symbol is Control.NAK:
            self._tally.note(Message.NTC_RCVD_NAK_SYMBOL, station=None)
            self._release(LineReset())
            self._queue.clear()  # a NAK resets all slaves of the line (M 2-7, 3-11)
        elif isinstance(symbol, Unknown) and not symbol.is_misplaced:
            self._tally.note(Message.NTC_INVALID_SYMBOL, symbol.byte, station=None)
        return b''

    def reset(self) -> None:
        """Forget all messages to send, and the last message heard."""
        self._held, self._last_key = None, None
        self._just_sent, self._sent_reply, self._unused = False, True, None
        self._queue.clear()

    def forget_last(self) -> None:
        """Treat the next message as new, whatever its numbers."""
        self._last_key = None

    def withdraw(self) -> None:
        """Do not send a command of our own again; the caller has ended it."""
        if self._held is not None and not self._held.packet.is_reply:
            self._held = None

    @property
    def gives_command(self) -> bool:
        """Tell whether the last response is a command of our own."""
        return self._just_sent and self._held is not None and not self._held.packet.is_reply

    def take_back(self) -> bool:
        """Take back a command before it is sent; return True if an earlier try was sent."""
        held, self._held, self._just_sent = self._held, None, False
        assert held is not None
        was_sent = held.sent > 1
        self.counters.messages_sent -= 1
        if was_sent:
            self.counters.nak_retries -= 1
        else:
            self.counters.commands_sent -= 1
        return was_sent

    def _release(self, error: LinkError | None = None) -> None:
        """Drop the held message; the sender of a command gets the result (KF2 4-31)."""
        held, self._held = self._held, None
        if held is None or held.packet.is_reply:
            return
        if error is None:
            self._initiator.delivered(held.packet)
        else:
            self._initiator.undelivered(held.packet, error)

    def _received(self, frame: Frame) -> bytes:
        """Take a master's frame (KF2 4-31)."""
        if frame.station not in (self._settings.station, BROADCAST):
            return b''
        if frame.fault is not None:
            self._tally.report(count_fault(frame, self._settings.checksum, self.counters))
            return b''
        packet = Packet.decode(frame.data)
        self.counters.messages_received += 1
        if not packet.is_sound or frame.station == 0 != packet.dst:
            self._tally.wrong(packet, packet.src)
            return b''
        if packet.duplicate_key == self._last_key and self._settings.duplicate_detection:
            self.counters.duplicate_messages += 1
            self._tally.note(Message.NTC_DUPLICATE_MSG_RCVD, packet.src, station=packet.src)
            return self._ack(frame)
        wants_reply = frame.station != BROADCAST and not packet.is_reply
        if wants_reply and len(self._queue) >= self._settings.queue_size:
            self.counters.refused_for_memory += 1
            return b''  # sink full: neither acknowledged nor remembered
        self._last_key = packet.duplicate_key
        self._unused = packet, wants_reply
        return self._ack(frame)

    def make_use(self) -> None:
        """Take the reply, or carry out the command, that has been accepted."""
        if self._unused is None:
            return
        (packet, wants_reply), self._unused = self._unused, None
        self._tally.received(packet)
        if packet.is_reply:
            self._initiator.replied(packet)
            return
        reply = self._serve(packet)
        if wants_reply:
            self._queue.append(reply)

    def _ack(self, frame: Frame) -> bytes:
        if frame.station == BROADCAST:
            return b''  # all stations would answer at once (M 3-4)
        self.counters.acks_sent += 1
        return frames.ACK

    def _polled(self, poll: Poll) -> bytes:
        """Answer a poll: the held message again, the next one, or EOT (KF2 4-31)."""
        if not poll.valid or poll.station != self._settings.station:
            return b''
        self.counters.polls_received += 1
        if self._held is not None and self._held.sent > self._settings.nak_retries:
            self._tally.given_up(self._settings.nak_retries, None)
            self._release(NeverTaken(self._settings.nak_retries))
        self._initiator.polled()
        if self._held is None:
            packet = self._next_packet()
            self._held = _Held(packet) if packet is not None else None
        if self._held is not None:
            return self._send(self._held)
        if self._settings.eot_suppression:
            return b''
        self.counters.eots_sent += 1
        return frames.EOT

    def _next_packet(self) -> Packet | None:
        """
        Return a reply that waits, or a command of our own.

        Replies and commands take turns. Otherwise a master that always has a reply to fetch would
        never get our commands.
        """
        if self._sent_reply or not self._queue:
            command = self._initiator.next_command()
            if command is not None:
                self._sent_reply = False
                return command
        self._sent_reply = True
        return self._queue.popleft() if self._queue else None

    def _send(self, held: _Held) -> bytes:
        if held.sent:
            self.counters.nak_retries += 1
        else:
            self._tally.sent(held.packet)
        held.sent += 1
        self.counters.messages_sent += 1
        self._just_sent = True
        return frames.message_frame(held.packet.encode(), self._settings.checksum)


class Responder(Protocol):
    """A party that answers symbols on a line: a slave, or a test slave with wrong behaviour."""

    def handle(self, symbol: Symbol) -> bytes:
        """Return the bytes to send in answer to ``symbol``."""


def answer(machine: Machine, symbol: Symbol, handle: Callable[[Symbol], bytes],
           look: Callable[[], None] = lambda: None,
           expires: Callable[[], float] = lambda: math.inf) -> Generator[Step, Heard, None]:
    """
    Send the answer of ``handle`` to ``symbol`` after TX_Delay; meanwhile call ``look`` repeatedly.

    ``expires`` returns the clock value (s) after which an answer must not be sent. If it is too
    late, CommandExpired is raised.

    A master that has sent another symbol does not wait for the old answer any more. It would
    relate the old answer to the new symbol. So a poll or a message is ignored if another symbol,
    or the beginning of one, has come after it. To ``handle`` it is then NOISE.
    """
    heard: Symbol | None = symbol
    while heard is not None:
        symbol, heard = heard, None
        if _wants_answer(symbol):
            heard = yield from _next_within(machine, machine.timing.tx_delay, look)
            if heard is not None or machine.is_behind or machine.receiver.decoder.has_begun:
                handle(NOISE)  # an ACK after it is not for our last message
                continue
        if data := handle(symbol):
            # An answer with a time limit waits until the caller, who has the port, has checked the
            # limit.
            limit = expires()
            after = yield Send(
                data, 0 if limit == math.inf else MOMENT, expires=limit, at_once=True)
            heard = None if isinstance(after, Silence) else after


def _wants_answer(symbol: Symbol) -> bool:
    """Tell whether a slave may have to answer."""
    return isinstance(symbol, Poll) or (
        isinstance(symbol, Frame) and symbol.station not in (None, BROADCAST))


def _next_within(machine: Machine, seconds: float,
                 look: Callable[[], None]) -> Generator[Step, Heard, Symbol | None]:
    """Return the next symbol, if it is here already or comes within ``seconds``."""
    end = machine.now + seconds
    heard = yield Listen(0)
    while isinstance(heard, Silence) and (left := end - machine.now) > 0:
        heard = yield Rest(min(left, TICK))
        look()
    return None if isinstance(heard, Silence) else heard


def multidrop(stations: Sequence[Responder]) -> Callable[[Machine], Procedure]:
    """Return the procedure of a machine that answers as all ``stations`` of a line."""
    def handle(symbol: Symbol) -> bytes:
        return b''.join(station.handle(symbol) for station in stations)

    def listen(machine: Machine) -> Procedure:
        while True:
            symbol = yield Rest()
            if not isinstance(symbol, Silence):
                yield from answer(machine, symbol, handle)
    return listen
