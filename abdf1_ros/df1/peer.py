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
The full-duplex peer: both ends may send commands and replies at any time (M 4-3..4-13).

Theory of operation. The transmitter sends one message at a time and waits for its response
(M 4-5)::

    DLE ACK   delivered
    DLE NAK   send it again, up to NAK_Retries
    silence   DLE ENQ asks for the response again, up to ENQ_Retries

The receiver answers every message at once with ACK or NAK. It remembers this response, because an
ENQ may ask for it again (M 4-7..4-9). The remembered response is NAK at the start, and after
noise: an old ACK must not count for a new message that got lost.

A response does not name its message. A response that comes before all bytes of our message have
left is not for that message (M 4-5: WAIT follows SEND). After the start, and after a transfer that
needed a second try, there is a short pause. A response in that pause is late, and must not count
for the next message.

An ACK is not a reply. A command waits for its reply up to Cmd_Timeout after the ACK. Several
commands may wait, up to ``max_outstanding``; a reply finds its command by station and TNS. A reply
that overtakes its ACK counts as the ACK, too (M 4-13).

A message may come again, and is then executed only once: see ``df1/duplicates.py``.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Sequence
import math

from abdf1_ros.df1 import frames
from abdf1_ros.df1.accounting import count_control, count_fault
from abdf1_ros.df1.duplicates import DuplicateDetection
from abdf1_ros.df1.frames import Code, Control, Duplex, Frame, FrameFault, Symbol, Unknown
from abdf1_ros.df1.link import ack_on_reply, EqualNode
from abdf1_ros.df1.machine import (
    Heard,
    Listen,
    LONGEST_REST,
    Machine,
    Procedure,
    Rest,
    Send,
    Silence,
    Step,
)
from abdf1_ros.df1.mode import answer_time, LineMode
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import Outstanding, Task, TaskSource
from abdf1_ros.errors import CommandExpired, StationInactive
from abdf1_ros.messages import Event, Message

# Repeated NAKs mostly mean that the far end is out of buffers. From the second NAK on, each
# repetition waits this much longer (s).
_NAK_PAUSE = 0.25

# Most replies that wait for their turn on the line. Further commands are answered with NAK.
MAX_WAITING_REPLIES = 8

# Longest delay (s) of a late response: after its time-out, after another response, or after the
# reply that overtook it.
_LATE_RESPONSE = 0.1

_REFLEX = ack_on_reply()

# Interval (s) at which a peer that waits for a response checks for overdue commands.
_TICK = 0.25


class FullDuplexPeer(EqualNode):
    """
    Carry out tasks on the line of ``machine`` and answer the commands that come in.

    ``serve`` executes a command and returns its reply; it is called once for each command, never
    for a repetition. If it returns None, the caller later adds the reply to ``replies``, from any
    thread, and wakes the machine. Each start makes a new ``replies``. ``report`` is called with
    every numbered error and notice.
    """

    def __init__(self, machine: Machine, settings: LinkSettings, stations: ActiveStationList,
                 serve: Callable[[Packet], Packet | None],
                 report: Callable[[Event], None] = lambda event: None) -> None:
        super().__init__(machine, stations, serve, report, settings.station)
        self._settings = settings
        self._timeout = answer_time(settings)
        self._forget()

    def run(self, source: TaskSource) -> Procedure:
        """Carry out the tasks of ``source`` and serve the far end, for ever."""
        self._forget()
        yield from self._listen()  # a response now is for an earlier process
        while True:
            self._expire()
            # Replies and commands take turns. Otherwise a far end that asks all the time would
            # keep our commands waiting.
            if self.replies:
                yield from self._send_reply(self.replies.popleft())
            task = self._next_task(source)
            if task is not None:
                yield from self._send_command(task)
                continue
            if self.replies:
                continue
            symbol = yield Rest(self._idle_time(source), reflex=_REFLEX)
            if not isinstance(symbol, Silence):
                yield from self._answer(symbol)

    def _forget(self) -> None:
        self.replies: deque[Packet] = deque()
        self._outstanding: dict[tuple[int, int], Outstanding] = {}
        self._last_response = frames.NAK
        self._undelivered_by: Message | None = None  # what was wrong with the last response
        self._duplicates = DuplicateDetection(self._settings)
        self._unused: Packet | None = None

    def _next_task(self, source: TaskSource) -> Task | None:
        if len(self._outstanding) >= self._settings.max_outstanding:
            return None
        return source.next_task(self._machine.now)

    def _idle_time(self, source: TaskSource) -> float:
        """Return the seconds until a reply is overdue or a task is due, at most LONGEST_REST."""
        moments = [self._given_up(entry) for entry in self._outstanding.values()]
        if len(self._outstanding) < self._settings.max_outstanding:
            moments.append(source.next_due())
        return min(max(0.0, min(moments, default=math.inf) - self._machine.now), LONGEST_REST)

    def _send_command(self, task: Task) -> Procedure:
        number = task.command.dst
        key = number, task.command.tns
        entry = self._outstanding[key] = Outstanding(task)
        self._accounting.sent(task.command)
        task.sent = True
        # A station that did not answer last time, or may be absent, gets one try without retries.
        station = self._stations[number]
        is_once = not station.active or not station.replies and self._stations.is_new(number)
        try:
            delivered = yield from self._transfer(
                task.command, lambda: key not in self._outstanding,
                is_once=is_once, expires=task.expires,
                answer_within=math.inf if station.active else task.answer_within)
        except CommandExpired as error:
            if self._outstanding.pop(key, None):
                task.sent = error.sent
                task.fail(error)
            return
        if delivered is not None:
            entry.deadline = delivered + self._settings.cmd_timeout
        elif self._outstanding.pop(key, None):
            if task.blames:
                self._accounting.lost(number, self._machine.now, self._undelivered_by)
            task.fail(StationInactive(number, cause=self._undelivered_by))

    def _send_reply(self, reply: Packet) -> Procedure:
        self._accounting.sent(reply)
        delivered = yield from self._transfer(reply, lambda: False, is_once=False)
        self._duplicates.replied(reply, is_delivered=delivered is not None)

    def _transfer(self, packet: Packet, is_answered: Callable[[], bool],
                  is_once: bool, expires: float = math.inf, answer_within: float = math.inf
                  ) -> Generator[Step, Heard, float | None]:
        """Send a message; return when it was delivered, None if it was not (M 4-5, TRANSFER)."""
        message = frames.message_frame(packet.encode(), self._settings.checksum)
        naks = enqs = 0
        sending = message
        while True:
            self._counters.messages_sent += sending is message
            try:
                response = yield from self._response(
                    sending, is_answered, expires if sending is message else math.inf,
                    min(self._timeout, answer_within))
            except CommandExpired as error:
                self._accounting.taken_back(error, was_sent=naks > 0)
                raise
            if response in (Code.ACK, Code.STX):
                break
            if response is Code.NAK:
                naks += 1
                self._undelivered_by = Message.ERR_RCVD_NAK_SYMBOL
                self._accounting.nak_received(packet.dst)
                if is_once or not self._note_nak(naks, packet.dst):
                    break
                if naks > 1:
                    yield from self._listen((naks - 1) * _NAK_PAUSE)
                sending = message
            else:
                enqs += 1
                self._undelivered_by = Message.NTC_ACK_EXPECTED
                if is_once or not self._note_silence(enqs, packet.dst):
                    break
                sending = frames.ENQ
        delivered = self._machine.now if response in (Code.ACK, Code.STX) else None
        if enqs or naks or response is Code.STX:
            yield from self._listen()
        return delivered

    def _note_nak(self, naks: int, station: int) -> bool:
        """Count and report that a message is sent again, or is given up."""
        if naks > self._settings.nak_retries:
            self._accounting.given_up(self._settings.nak_retries, station)
            return False
        self._accounting.repeated(naks, Message.ERR_RCVD_NAK_SYMBOL, station)
        return True

    def _note_silence(self, enqs: int, station: int) -> bool:
        """Count and report that an ENQ asks for the response, or that the message is given up."""
        if enqs > self._settings.enq_retries:
            self._counters.enq_limit_exceeded += 1
            self._note(Message.NTC_ENQ_LIMIT_EXCEEDED, self._settings.enq_retries, station=station)
            return False
        self._counters.enq_retries += 1
        self._note(Message.NTC_ENQ_RETRY, enqs, Message.NTC_ACK_EXPECTED.number, station=station)
        return True

    def _response(self, sending: bytes, is_answered: Callable[[], bool],
                  expires: float, timeout: float) -> Generator[Step, Heard, Code | None]:
        """Send; return ACK, NAK, STX if the reply came before the ACK, or None for silence."""
        machine = self._machine
        last_byte, begun = 0, machine.now
        symbol = yield Send(sending, min(timeout, _TICK), expires=expires, reflex=_REFLEX)
        end, position = machine.sender.free_at + timeout, machine.sender.position
        while not isinstance(symbol, Silence) or self._left(end) > 0:
            if symbol in (Control.ACK, Control.NAK) and machine.sender.has_left(position):
                assert isinstance(symbol, Control)
                count_control(symbol, self._counters)
                return symbol.code
            if isinstance(symbol, Silence):
                last_byte = self._heard_since(begun, symbol) or last_byte
            else:
                yield from self._answer(symbol)
            if is_answered():
                return Code.STX
            symbol = yield from self._next(end)
        self._note(Message.NTC_ACK_EXPECTED, self._heard_since(begun, symbol) or last_byte,
                   station=None)
        return None

    def _heard_since(self, begun: float, silence: Silence) -> int:
        """Return the last byte heard after a clock value (s), 0 for none."""
        return silence.last_byte if self._machine.now - silence.seconds > begun else 0

    def _listen(self, seconds: float = _LATE_RESPONSE) -> Procedure:
        """Only receive for a while; responses that come now are late and ignored."""
        end = max(self._machine.now, self._machine.sender.free_at) + seconds
        symbol = yield from self._next(end)
        while not isinstance(symbol, Silence) or self._left(end) > 0:
            if not isinstance(symbol, Silence):
                yield from self._answer(symbol)
            symbol = yield from self._next(end)

    def _left(self, end: float) -> float:
        """Return the seconds from now, or from the end of our transmission, up to ``end``."""
        return end - max(self._machine.now, self._machine.sender.free_at)

    def _next(self, end: float) -> Generator[Step, Heard, Heard]:
        """Return the next symbol, or a Silence at ``end`` or after ``_TICK``."""
        self._expire()
        left = self._left(end)
        if left <= 0:
            return Silence()
        return (yield Listen(min(left, _TICK), reflex=_REFLEX))

    def _answer(self, symbol: Symbol) -> Procedure:
        """Send the response to a symbol, and use the message if the symbol is one."""
        response = self._hear(symbol)
        if self._machine.timing.tx_delay:  # the response waits for TX_Delay, the message need not
            self._make_use()
        if response:
            yield Send(response)
        self._make_use()

    def _make_use(self) -> None:
        """Take the reply, or carry out the command, that has been accepted."""
        packet, self._unused = self._unused, None
        if packet is None:
            return
        if packet.is_reply:
            self._take_reply(packet)
        else:
            self._counters.commands_received += 1
            self._stations[packet.src].in_vain = 0
            is_ours = self._settings.station in (None, packet.dst)
            self._counters.invalid_messages += not is_ours
            reply = self._serve(packet)
            if reply is not None:
                self.replies.append(reply)

    def _hear(self, symbol: Symbol) -> bytes:
        """Return the response of the receiver to a symbol (M 4-7..4-9)."""
        if isinstance(symbol, Frame):
            return self._message(symbol)
        if symbol is Control.ENQ:
            self._duplicates.expect_repetition()
            count_control(symbol, self._counters)
            return self._respond(self._last_response)
        count_control(symbol, self._counters)
        if symbol is Control.ACK or symbol is Control.NAK:
            return b''
        self._last_response = frames.NAK
        if isinstance(symbol, Unknown) and not symbol.is_misplaced:
            self._note(Message.NTC_INVALID_SYMBOL, symbol.byte, station=None)
        return b''

    def _message(self, frame: Frame) -> bytes:
        """Judge a message and return the response to it."""
        if frame.fault is not None:
            event = count_fault(frame, self._settings.checksum, self._counters)
            self._accounting.report(event)
            for (_, tns), entry in self._outstanding.items():
                if frame.data[4:6] in (b'', tns.to_bytes(2, 'little')):
                    entry.cause = event.message
                else:
                    entry.is_hindered = True
            is_given_up = frame.fault is FrameFault.NO_ETX and frame.received in (
                Code.STX, Code.ENQ)  # its sender begins again, or sends an ENQ
            if is_given_up or frame.has_stopped:
                self._last_response = frames.NAK
                return b''
            return self._respond(frames.NAK)
        packet = Packet.decode(frame.data)
        self._counters.messages_received += 1
        # On a line with an echo, a command may be our own with damage that no check shows.
        if not packet.is_sound or (self._machine.echoes and not packet.is_reply):
            self._accounting.wrong(packet, packet.src)
            return self._respond(frames.NAK)
        if self._duplicates.is_repetition(packet, self._machine.now):
            self._counters.duplicate_messages += 1
            self._note(Message.NTC_DUPLICATE_MSG_RCVD, packet.src, station=packet.src)
            return self._respond(frames.ACK)
        if not packet.is_reply and self._machine.may_be_old:
            self._last_response = frames.NAK  # a sender that still waits sends it again
            return b''
        if not packet.is_reply and len(self.replies) >= MAX_WAITING_REPLIES:
            self._counters.refused_for_memory += 1
            return self._respond(frames.NAK)  # sink full: not remembered, so it may come again
        self._duplicates.accepted(packet, self._machine.now)
        self._unused = packet
        return self._respond(frames.ACK)

    def _take_reply(self, packet: Packet) -> None:
        """Give a reply to its command, if the command still waits."""
        self._expire(self._machine.receiver.message_begun(self._machine.now))
        self._accounting.received(packet)
        key = packet.src, packet.tns
        entry = self._outstanding.get(key)
        if entry is None or not self._stations.answers(packet, entry.task.command, None):
            # for another node: our reply may follow with the same SRC, CMD and TNS
            if entry is not None:
                self._duplicates.forget_message()
            self._accounting.unexpected(packet, self._machine.now)
            return
        del self._outstanding[key]
        self._stations.heard(packet.src, self._machine.now)
        self._accounting.complete(entry.task, packet, keeps_others_waiting=True)

    def _given_up(self, entry: Outstanding) -> float:
        """Return when a reply is overdue; a reply that began in time is heard to its end."""
        receiver = self._machine.receiver
        is_in_time = receiver.message_begun(self._machine.now) <= entry.deadline
        return max(entry.deadline, receiver.hears_until) if is_in_time else entry.deadline

    def _expire(self, begun: float | None = None) -> None:
        """End the commands whose reply is overdue now, or at ``begun`` (S0, counter 2545)."""
        now = self._machine.now if begun is None else begun
        overdue = [key for key, entry in self._outstanding.items() if self._given_up(entry) <= now]
        for key in overdue:
            entry = self._outstanding.pop(key)
            self._stations[entry.task.command.dst].in_vain += \
                entry.cause is None and not entry.is_hindered
            if entry.is_hindered and entry.cause is None:
                self._accounting.hindered(entry.task)
            else:
                self._accounting.overdue(
                    entry.task, keeps_others_waiting=True, cause=entry.cause)

    def _respond(self, response: bytes) -> bytes:
        self._last_response = response
        if response == frames.NAK:
            self._duplicates.expect_repetition()
            self._counters.naks_sent += 1
        else:
            self._counters.acks_sent += 1
        return response


class PeerMode(LineMode):
    """One of the two ends of a full-duplex line."""

    name = 'Peer'
    link = FullDuplexPeer
    other_words = {'fullduplex': 'Peer', 'full': 'Peer', 'df1fullduplex': 'Peer',
                   'peertopeer': 'Peer'}
    duplex = Duplex.FULL
    has_one_plc = True
    waits_for_acks = True
    answers_by_itself = True

    def longest_transaction(self, line: LinkSettings, frames: float, others: float = 0.0,
                            stations: int = 0) -> float:
        """Return the time of the base class, plus the pauses after NAKs and for late responses."""
        return super().longest_transaction(line, frames) + _pauses(line)

    def last_tries(self, line: LinkSettings, frames: Sequence[float],
                   answer_within: float) -> float:
        """Return the time of the base class, plus the pauses that ignore late responses."""
        return super().last_tries(line, frames, answer_within) \
            + (1 + len(frames)) * _LATE_RESPONSE

    def longest_reply(self, line: LinkSettings, frames: float) -> float:
        """Return how long the transfer of a reply takes: messages, ENQs and pauses."""
        tries = line.nak_retries + line.enq_retries + 1
        # A command that becomes overdue meanwhile is ended within _TICK.
        return tries * answer_time(line) + (line.nak_retries + 1) * frames \
            + _pauses(line) + _TICK


def _pauses(line: LinkSettings) -> float:
    """Return the seconds of all pauses in a transfer with all its repetitions."""
    return _LATE_RESPONSE + _NAK_PAUSE * sum(range(line.nak_retries))


PEER = PeerMode()
