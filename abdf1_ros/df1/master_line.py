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
The work of every half-duplex master on its line: deliver, poll, receive, pass on.

The rules come from S0, "Functional Overview", and M 3-12..3-17. The module ``master`` combines
these steps into a transaction, ``polling`` into a polling scan.

A good message is acknowledged even if it is unexpected, because the slave keeps it until the ACK
(M 3-15). A master never asks for a repetition with DLE NAK, which resets all slaves of the line (M
2-7, 3-11).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Container, Generator, Iterator
from contextlib import contextmanager
from functools import cache
import math
from typing import TypeGuard

from abdf1_ros.df1 import frames
from abdf1_ros.df1.accounting import Accounting, count_control, count_fault, wrong_message
from abdf1_ros.df1.frames import Code, Control, Frame, FrameFault, Unknown
from abdf1_ros.df1.link import ack_on_reply, quiet_time
from abdf1_ros.df1.machine import (
    Heard,
    Listen,
    LISTEN_ON,
    Machine,
    MOMENT,
    Procedure,
    Send,
    Silence,
    Step,
)
from abdf1_ros.df1.mode import answer_time
from abdf1_ros.df1.packet import (
    BROADCAST,
    DIAGNOSTIC_REPLY,
    is_local_status,
    Packet,
    REPLY_BIT,
    STS_NOT_DELIVERED,
)
from abdf1_ros.df1.probes import Asker
from abdf1_ros.df1.sender import Reflex
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import Task
from abdf1_ros.errors import CommandExpired, CommandTimeout, StationInactive
from abdf1_ros.messages import Event, Message

# Pause (s) after a broadcast, which no station answers.
BROADCAST_PAUSE = 0.05

# Most messages of slaves that wait to be passed on. A slave that sends one more command gets no
# ACK, and keeps it.
MAX_FORWARDS = 16

# Most commands passed on that are remembered until their replies come; the oldest are dropped
# first.
_MOST_PASSED_ON = 2 * MAX_FORWARDS

# Most messages that a slave may have queued before the reply to our command. The master fetches
# them even after Cmd_Timeout. Otherwise, on a slow line, there would always be an older reply
# before the reply to the last command.
MOST_QUEUED = 8

_ACKNOWLEDGE = Send(frames.ACK)

# Symbols that answer a message, and a poll. Frames also answer a poll.
_MESSAGE_ANSWERS = (Control.ACK, Control.NAK)
_POLL_ANSWERS = (Control.EOT, Control.NAK)


class MasterLine:
    """
    The line of a half-duplex master.

    ``serve`` executes commands of slaves for us and returns their replies; ``report`` is
    called with every numbered error and notice as it happens. ``take_reply`` takes a reply that
    came too late for its poll, and returns whether a command waited for it.
    """

    def __init__(self, machine: Machine, settings: LinkSettings, stations: ActiveStationList,
                 serve: Callable[[Packet], Packet] | None = None,
                 report: Callable[[Event], None] = lambda event: None,
                 take_reply: Callable[[int, Packet], bool] = lambda number, reply: False) -> None:
        self.machine = machine
        self.counters = machine.counters
        self.settings = settings
        self.stations = stations
        self.accounting = Accounting(machine.counters, stations, report, settings.station)
        self.note = self.accounting.note
        self._serve = serve
        self._take_reply = take_reply
        self._timeout = answer_time(settings)
        self._last_code = 0
        # What was wrong with the last message of each station since its last command.
        self.faults: dict[int, Message] = {}
        self.begin()

    def begin(self) -> None:
        """Forget messages that wait to be passed on, and the last message of each station."""
        self.faults.clear()
        self.forwards: deque[Packet] = deque()
        # Commands between slaves, whose replies are passed on as well.
        self._passed_on: deque[Packet] = deque(maxlen=_MOST_PASSED_ON)
        for station in self.stations.records.values():
            station.forget_last()

    def deliver(self, number: int, packet: Packet, expires: float = math.inf,
                reflex: Reflex | None = None, answer_within: float = math.inf
                ) -> Generator[Step, Heard, float]:
        """
        Send a message to a station until it is acknowledged (S0, "Network Reads"; M 3-12).

        Return when the acknowledged transmission began (clock value in s). Raises CommandExpired,
        and StationInactive after the last retry. A station that is a gateway is then polled. If it
        answers, StationInactive names only the station behind it; for a message to the gateway
        itself, the error is CommandTimeout.

        A silent station gets the message only once. A station that has never replied gets it only
        once if its gateway has been heard. Otherwise the other nodes of the gateway would wait for
        all retries. The wait for the answer of a silent station is ``answer_within`` s at most.
        """
        frame = frames.master_frame(number, packet.encode(), self.settings.checksum)
        self.faults.pop(number, None)
        self.accounting.sent(packet)
        if number == BROADCAST:
            self.counters.messages_sent += 1
            begun = self.machine.now
            try:
                yield Send(frame, BROADCAST_PAUSE, expires=expires)
            except CommandExpired as error:
                self.accounting.taken_back(error, was_sent=False)
                raise
            return begun
        station = self.stations.records[packet.dst]
        gateway = self.stations.records[number]
        is_once = not station.active or (
            gateway is not station and gateway.last_heard is not None and not station.replies)
        timeout = self._timeout if station.active else min(self._timeout, answer_within)
        for retry in range(1, self.settings.nak_retries + 2):
            self.counters.messages_sent += 1
            begun = max(self.machine.now, self.machine.sender.free_at) \
                + self.machine.timing.tx_delay
            try:
                answer = yield from self._ask(
                    Send(frame, timeout, expires=expires, reflex=reflex), number,
                    _MESSAGE_ANSWERS)
            except CommandExpired as error:
                self.accounting.taken_back(error, was_sent=retry > 1)
                raise
            if answer is Control.ACK:
                self.stations.heard(number, self.machine.now)
                return begun
            cause = self._note_cause(answer, number, Message.NTC_ACK_EXPECTED)
            if is_once:
                break
            if retry <= self.settings.nak_retries:
                self.accounting.repeated(retry, cause, number)
        else:
            self.accounting.given_up(self.settings.nak_retries, number)
        if gateway.active and len(self.stations.behind(number)) > 1:
            yield from self.probe(number)
            raise CommandTimeout(cause=cause) if packet.dst == number \
                else StationInactive(packet.dst, cause=cause)
        raise StationInactive(number, cause=cause)

    def _note_cause(self, answer: Heard, number: int, expected: Message) -> Message:
        """Note why a frame has to be sent again, by default ``expected``; return the reason."""
        if answer is Control.NAK:
            self.accounting.nak_received(number)
            return Message.ERR_RCVD_NAK_SYMBOL
        if isinstance(answer, Frame) and answer.fault is not None:
            return self._note_fault(answer, number)
        self.note(expected, self._last_code, station=number)
        return expected

    def probe(self, number: int) -> Procedure:
        """
        Poll a station once (S0, "Active Station List").

        Any proper answer makes it active. Raises StationInactive if there is none.
        """
        answer = yield from self.poll_inactive(number)
        if not is_good(answer):
            raise StationInactive(number)
        if isinstance(answer, Frame):
            packet = yield from self.receive(number, answer)
            if packet is not None and not self._take_reply(packet.src, packet):
                self.take_unwanted(packet)

    def poll_inactive(self, number: int) -> Generator[Step, Heard, Heard]:
        """Poll an inactive station; report a bad answer, but not complete silence."""
        answer = yield from self._poll(number)
        if is_good(answer):
            self.stations.heard(number, self.machine.now)
        elif not isinstance(answer, Silence) or self._last_code:
            self._note_cause(answer, number, Message.NTC_EOT_STX_EXPECTED)
        return answer

    def poll_with_retries(self, number: int, pause: float, reply_size: int = 0
                          ) -> Generator[Step, Heard, Control | Frame]:
        """
        Poll until EOT or a good message; raises StationInactive after the last retry.

        ``reply_size`` belongs to the task whose reply is expected.
        """
        for retry in range(1, self.settings.enq_retries + 2):
            answer = yield from self._poll(number, pause, reply_size)
            if answer is Control.EOT or isinstance(answer, Frame) and answer.fault is None:
                self.stations.heard(number, self.machine.now)
                return answer
            pause = 0.0
            cause = self._note_cause(answer, number, Message.NTC_EOT_STX_EXPECTED)
            if retry <= self.settings.enq_retries:
                self.counters.enq_retries += 1
                self.note(Message.NTC_ENQ_RETRY, retry, cause.number, station=number)
        self.counters.enq_limit_exceeded += 1
        self.note(Message.NTC_ENQ_LIMIT_EXCEEDED, self.settings.enq_retries, station=number)
        raise StationInactive(number, cause=self.faults.get(number, cause))

    def _poll(self, number: int, pause: float = 0.0,
              reply_size: int = 0) -> Generator[Step, Heard, Heard]:
        """Poll once; return EOT, NAK, a frame good or bad, or silence."""
        self.counters.polls_sent += 1
        return self._ask(
            Send(frames.poll_frame(number), self._timeout, pause, reply_size=reply_size,
                 reflex=ack_on_reply(number)), number, _POLL_ANSWERS)

    def _ask(self, question: Step, number: int,
             wanted: tuple[Control, ...]) -> Generator[Step, Heard, Heard]:
        """
        Send a question; return a ``wanted`` control symbol, a frame of this station, or silence.

        Other symbols, such as noise or a late answer, are counted and ignored while the time runs.
        """
        self._last_code = 0
        step = question
        while not isinstance(symbol := (yield step), Silence):
            step = LISTEN_ON
            if isinstance(symbol, Control):
                count_control(symbol, self.counters)
                self._last_code = symbol.code
                if symbol in wanted:
                    return symbol
            elif isinstance(symbol, Frame) and symbol.station is None:
                self._last_code = Code.STX
                if symbol.fault is FrameFault.NO_ETX:
                    return (yield from self._hear_rest(symbol, number))
                if symbol.fault is not None or not self._take_late(number, symbol):
                    return symbol
            elif isinstance(symbol, Unknown):
                self._last_code = symbol.byte
                if not symbol.is_misplaced:
                    self.note(Message.NTC_INVALID_SYMBOL, symbol.byte, station=number)
        if symbol.is_broken_off:
            return self.machine.receiver.decoder.broken_off()
        self._last_code = self._last_code or symbol.last_byte
        return symbol

    def _hear_rest(self, broken: Frame, number: int) -> Generator[Step, Heard, Frame]:
        """
        Listen until the line is quiet; return the good frame that follows, or else ``broken``.

        A bit error that looks like a symbol ends the message for us, but its sender goes on
        sending and does not listen. Other symbols in the rest of the message mean nothing.
        """
        quiet = quiet_time(self.machine.timing.char_time)
        end = self.machine.now + quiet + frames.MAX_LINK_DATA * self.machine.timing.char_time
        left = quiet
        while left > MOMENT:
            symbol = yield Listen(left)
            heard = symbol.seconds if isinstance(symbol, Silence) else 0.0
            left = min(quiet - heard, end - self.machine.now)
            if isinstance(symbol, Unknown) and not symbol.is_misplaced:
                self.note(Message.NTC_INVALID_SYMBOL, symbol.byte, station=number)
            elif isinstance(symbol, Frame) and symbol.station is None and symbol.fault is None:
                self._note_fault(broken, number)
                return symbol
        return broken

    def _take_late(self, number: int, frame: Frame) -> bool:
        """
        Take a late message of a station that is not asked now; return False for any other message.

        Such a message answers an earlier poll, whose time was up. We send no ACK: the station
        that we poll now would take the ACK for its own message. So the late message comes again,
        as a repetition.
        """
        src = frame.data[1]
        if src == number or self._speaks_for(number, src) or src not in self.stations:
            return False
        packet = Packet.decode(frame.data)
        station = self.stations[self.stations.via(packet.src)]
        self.counters.messages_received += 1
        self.stations.heard(station.number, self.machine.now)  # maybe a gateway's own reply
        if packet.is_reply and packet.dst == self.settings.station and station.note_new(packet):
            self.accounting.received(packet)
            if not self._take_reply(packet.src, packet):
                self.take_unwanted(packet)
        return True

    def _speaks_for(self, number: int, src: int) -> bool:
        """Tell whether a message of ``src`` may come from station ``number`` of this line."""
        return src == number or self.stations.via(src) == number

    def receive(self, number: int, frame: Frame) -> Generator[Step, Heard, Packet | None]:
        """
        Acknowledge a good message; return it, or None when it is a repetition.

        SRC has to be the station that was polled, or a station behind it, and must not equal DST.
        Wrong addresses come from damage that no check shows (a CRC begins with 0, so it does not
        notice a lost or inserted leading 00). Such a message gets no ACK, unless the station sends
        it again.
        """
        self.counters.messages_received += 1
        packet = Packet.decode(frame.data)
        station = self.stations.records[number]
        is_other = packet.src != number and not self._speaks_for(number, packet.src)
        if is_other or packet.dst == packet.src:
            if frame.data != station.last_refused:
                station.last_refused = frame.data
                self.accounting.wrong(packet, number)
                return None
            self.counters.acks_sent += 1
            yield _ACKNOWLEDGE
            return None
        is_to_keep = self.settings.accept_slave_messages and not packet.cmd & REPLY_BIT
        if is_to_keep and self.is_full and not station.repeats(packet):
            return None  # without an ACK the slave keeps its command; replies are still accepted
        self.counters.acks_sent += 1
        yield _ACKNOWLEDGE
        if not station.note_new(packet):
            self.counters.duplicate_messages += 1
            self.note(Message.NTC_DUPLICATE_MSG_RCVD, number, station=number)
            return None
        self.accounting.received(packet)
        return packet

    def answers(self, packet: Packet, command: Packet) -> bool:
        """Tell whether a message is the reply to ``command``; a gateway may fill in its DST."""
        gateway = self.stations.routes.get(command.dst)
        return packet.answers(command) if gateway is None else \
            self.stations.answers(packet, command, gateway)

    def complete(self, task: Task, reply: Packet, *, keeps_others_waiting: bool) -> None:
        """End a task with the reply to its command."""
        if reply.src in self.stations.routes and not is_local_status(reply.sts) \
                and reply.cmd != DIAGNOSTIC_REPLY:
            # A station without a gateway has been marked as heard when its reply came.
            self.stations.heard(reply.src, self.machine.now)
        self.accounting.complete(task, reply, keeps_others_waiting=keeps_others_waiting)

    def take_unwanted(self, packet: Packet) -> None:
        """
        Take a message that answers no command of ours (S0, DispatchAbDf1Message).

        The message is served, kept to be passed on, or dropped and counted. A reply to another
        node is dropped if it answers no command that we have passed on: its DST is damaged, or it
        is late.
        """
        is_ours = packet.dst == self.settings.station
        is_kept = self.settings.accept_slave_messages
        command = next((command for command in self._passed_on if packet.answers(command)), None)
        if is_kept and command is not None:
            self._passed_on.remove(command)
            self.forwards.append(packet)
        elif packet.is_reply:
            self.accounting.unexpected(packet, self.machine.now)
        elif is_kept and not is_ours:
            self.forwards.append(packet)
        elif is_kept and self._serve is not None:
            self.forwards.append(self._serve(packet))
        else:
            self.counters.invalid_messages += not is_ours
            self.accounting.report(wrong_message(packet, packet.src))

    def forward(self, busy: Container[int] = (),
                collect: Callable[[int, Packet], Procedure] | None = None
                ) -> Generator[Step, Heard, Packet | None]:
        """
        Pass on the first message that is not for a ``busy`` station; return it if it is delivered.

        The link data stay as they are (M 3-2, 3-8). The sender of a command that cannot be
        delivered gets an error reply. ``collect`` polls a station of the line for the reply to a
        command that has been passed on.
        """
        packet = next(packet for packet in self.forwards if packet.dst not in busy)
        self.forwards.remove(packet)
        number = self.stations.via(packet.dst)
        if not self.stations.claim_message(packet.dst, self.machine.now):
            self._refuse(packet)
            return None
        if not packet.is_reply and number != BROADCAST:
            self._passed_on.append(packet)
        with self._probe_of(packet.dst):
            try:
                if number != BROADCAST and not self.stations[number].active:
                    yield from self.probe(number)
                yield from self.deliver(number, packet)
            except (StationInactive, CommandTimeout) as error:
                if isinstance(error, StationInactive):
                    self.accounting.lost(error.number, self.machine.now, error.cause)
                self._refuse(packet)
                return None
            if collect is not None and not packet.is_reply and number != BROADCAST:
                yield from collect(number, packet)
        return packet

    def _refuse(self, packet: Packet) -> None:
        """Let the sender of a command that cannot be passed on get an error reply."""
        if not packet.is_reply and packet.src != self.settings.station:
            self.forwards.append(packet.reply(sts=STS_NOT_DELIVERED))

    @contextmanager
    def _probe_of(self, number: int) -> Iterator[None]:
        """Count the following work as a probe if the station is silent."""
        was_silent, begun = not self.stations[number].replies_in_time, self.machine.now
        try:
            yield
        finally:
            self.stations.tried(
                number, begun, self.machine.now, was_silent=was_silent, asker=Asker.MESSAGE)

    def has_forwards(self, busy: Container[int] = ()) -> bool:
        """Tell whether a message waits to be passed on to a station that is not ``busy``."""
        return any(packet.dst not in busy for packet in self.forwards)

    @property
    def is_full(self) -> bool:
        """Tell whether there is no room for further messages to be passed on."""
        return len(self.forwards) >= MAX_FORWARDS

    def _note_fault(self, frame: Frame, number: int) -> Message:
        """Count and report the fault of a frame; return the message that names it."""
        event = count_fault(frame, self.settings.checksum, self.counters, number)
        self.accounting.report(event)
        self.faults[number] = event.message
        return event.message


@cache
def poll_on_ack(number: int) -> Reflex:
    """Return the reflex to the ACK of a station that is polled for its reply."""
    poll = frames.poll_frame(number)
    return lambda symbol: poll if symbol is Control.ACK else b''


def is_good(answer: Heard) -> TypeGuard[Control | Frame]:
    """Tell whether a poll was answered properly: with EOT or a good message."""
    return answer is Control.EOT or (isinstance(answer, Frame) and answer.fault is None)
