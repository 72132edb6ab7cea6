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
The half-duplex master: one transaction with one station, from probe to reply.

Theory of operation (S0, "Functional Overview"; M 3-12..3-17). The master speaks, a slave
answers. A transaction has three phases, each a generator here::

    probe     only for a station in the list as inactive: one poll. DLE EOT or any message
              makes it active and the transaction proceeds; silence ends it.
    deliver   the command frame, until DLE ACK. Silence or DLE NAK: again, up to NAK_Retries.
    collect   polls, until the reply. DLE EOT means not ready: poll again, until Cmd_Timeout
              has passed since the transaction began. Silence or a damaged frame: again, up to
              ENQ_Retries for each poll.

A station that passes a retry limit becomes inactive. Every good message is acknowledged,
also one that is not wanted, because the slave holds it until then (M 3-15). A master never
asks for a repetition with DLE NAK, which is the reset of the whole line (M 2-7, 3-11).

A transaction therefore ends within (NAK_Retries + 1) x Timeout for delivery, Cmd_Timeout for
polling, and (ENQ_Retries + 1) x Timeout for the last poll. The retries of a phase are never
cut short by Cmd_Timeout: with S0's defaults (both 1000 ms) no retry would ever happen.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import NoReturn, TypeGuard

from abdf1_ros.counters import Counters
from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.faults import count_fault
from abdf1_ros.df1.frames import Code, Control, Fault, Frame, Poll, Symbol, Unknown
from abdf1_ros.df1.machine import LISTEN_ON, Machine, Procedure, Step
from abdf1_ros.df1.packet import Packet, REPLY_BIT
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import TaskSource
from abdf1_ros.errors import CommandTimeout, StationInactive, WrongCommandCode
from abdf1_ros.messages import Event, Message

# What an operating system or USB adapter may hold a byte back; no wait is shorter, so that
# Timeout = 0 (S0 allows it) still means "as short as the equipment can do".
MIN_RESPONSE_TIME = 0.02


@dataclass(frozen=True, slots=True)
class MasterSettings:
    """
    The settings of a half-duplex master, named as in S0; times in seconds.

    ``poll_pause`` passes between an EOT and the next poll, to let the slave finish.
    """

    station: int = 5
    checksum: Checksum = Checksum.CRC
    nak_retries: int = 3
    enq_retries: int = 3
    timeout: float = 1.0
    cmd_timeout: float = 1.0
    nak_on_command_timeout: bool = True
    poll_pause: float = 0.005


class HalfDuplexMaster:
    """
    Carry out transactions on the line of ``machine``.

    ``report`` is called with every numbered error and notice as it happens.
    """

    def __init__(self, machine: Machine, settings: MasterSettings, stations: ActiveStationList,
                 report: Callable[[Event], None] = lambda event: None) -> None:
        self.command_sent = False
        self._machine = machine
        self._settings = settings
        self._stations = stations
        self._report = report
        self._timeout = max(settings.timeout, MIN_RESPONSE_TIME)
        self._last_code = 0

    @property
    def _counters(self) -> Counters:
        return self._machine.counters

    def run(self, source: TaskSource) -> Procedure:
        """Carry out the tasks of ``source``, one after the other, for ever."""
        while True:
            now = self._machine.now
            task = source.next_task(now)
            if task is None:
                due = source.next_due()
                yield Step(None, None if due is None else max(due - now, 0.0))
                continue
            try:
                reply = yield from self.exchange(task.command)
            except (StationInactive, CommandTimeout, WrongCommandCode) as error:
                task.sent = self.command_sent
                task.fail(error)
            except BaseException:  # the end of the line; whoever has the tasks ends them
                task.sent = self.command_sent
                raise
            else:
                task.reply(reply)

    def exchange(self, command: Packet,
                 station: int | None = None) -> Generator[Step, Symbol | None, Packet]:
        """
        Send ``command`` and return the reply to it.

        ``station`` is the address on this line; it differs from the command's DST only behind
        a gateway (M 3-7). While this runs and after it, ``command_sent`` tells whether the
        command has been on the line: without a reply its outcome is then unknown.

        Raises StationInactive, CommandTimeout or WrongCommandCode.
        """
        number = command.dst if station is None else station
        started = self._machine.now
        self.command_sent = False
        if not self._stations[number].active:
            yield from self._probe(number)
        yield from self._deliver(number, command)
        return (yield from self._collect(number, command, started))

    def _probe(self, number: int) -> Generator[Step, Symbol | None, None]:
        """Poll an inactive station once (S0, "Active Station List")."""
        answer = yield from self._poll(number)
        if not _is_good(answer):
            self._fail_inactive(number)
        if isinstance(answer, Frame):
            yield from self._receive(number, answer, None)

    def _deliver(self, number: int, command: Packet) -> Generator[Step, Symbol | None, None]:
        """Send the command until it is acknowledged (S0, "Network Reads"; M 3-12)."""
        frame = frames.master_frame(number, command.encode(), self._settings.checksum)
        self._counters.commands_sent += 1
        for retry in range(1, self._settings.nak_retries + 2):
            self._counters.messages_sent += 1
            self.command_sent = True
            answer = yield from self._ask(frame, number, (Code.ACK, Code.NAK))
            if answer == Control(Code.ACK):
                self._stations.heard(number, self._machine.now)
                return
            cause = self._undelivered(answer, number)
            if retry <= self._settings.nak_retries:
                self._counters.nak_retries += 1
                self._note(Message.NTC_NAK_RETRY, retry, cause.number, station=number)
        self._counters.nak_limit_exceeded += 1
        self._note(Message.NTC_NAK_LIMIT_EXCEEDED, self._settings.nak_retries, station=number)
        self._fail_inactive(number)

    def _undelivered(self, answer: Symbol | None, number: int) -> Message:
        """Note why a command was not acknowledged; return the cause."""
        if answer == Control(Code.NAK):
            self._note(Message.NTC_RCVD_NAK_SYMBOL, station=number)
            self._note(Message.ERR_RCVD_NAK_SYMBOL, station=number)
            return Message.ERR_RCVD_NAK_SYMBOL
        if isinstance(answer, Frame) and answer.fault is not None:
            return self._note_fault(answer, number)
        self._note(Message.NTC_ACK_EXPECTED, self._last_code, station=number)
        return Message.NTC_ACK_EXPECTED

    def _collect(self, number: int, command: Packet,
                 started: float) -> Generator[Step, Symbol | None, Packet]:
        """Poll until the reply to ``command`` is here (S0, "Network Reads"; M 3-13..3-15)."""
        pause = 0.0
        while True:
            answer = yield from self._poll_with_retries(number, pause)
            if isinstance(answer, Frame):
                reply = yield from self._receive(number, answer, command)
                if reply is not None:
                    return reply
            pause = self._settings.poll_pause
            if self._machine.now - started >= self._settings.cmd_timeout:
                yield from self._give_up(number)

    def _poll_with_retries(self, number: int,
                           pause: float) -> Generator[Step, Symbol | None, Symbol]:
        """Poll until EOT or a good message; a station that gives neither becomes inactive."""
        for retry in range(1, self._settings.enq_retries + 2):
            answer = yield from self._poll(number, pause)
            if _is_good(answer):
                return answer
            pause = 0.0
            cause = self._unanswered(answer, number)
            if retry <= self._settings.enq_retries:
                self._counters.enq_retries += 1
                self._note(Message.NTC_ENQ_RETRY, retry, cause.number, station=number)
        self._counters.enq_limit_exceeded += 1
        self._note(Message.NTC_ENQ_LIMIT_EXCEEDED, self._settings.enq_retries, station=number)
        self._fail_inactive(number)

    def _unanswered(self, answer: Symbol | None, number: int) -> Message:
        """Note why a poll has to be repeated; return the cause."""
        if isinstance(answer, Frame):
            return self._note_fault(answer, number)
        self._note(Message.NTC_EOT_STX_EXPECTED, self._last_code, station=number)
        return Message.NTC_EOT_STX_EXPECTED

    def _poll(self, number: int,
              pause: float = 0.0) -> Generator[Step, Symbol | None, Symbol | None]:
        """Poll once; return EOT, a frame good or bad, or None for silence."""
        self._counters.polls_sent += 1
        answer = yield from self._ask(frames.poll_frame(number), number, (Code.EOT,), pause)
        if _is_good(answer):
            self._stations.heard(number, self._machine.now)
        return answer

    def _ask(self, frame: bytes, number: int, wanted: tuple[Code, ...],
             delay: float = 0.0) -> Generator[Step, Symbol | None, Symbol | None]:
        """
        Send ``frame``; return a ``wanted`` control symbol, any slave's frame, or None.

        Other symbols are counted and passed over while the time runs: noise, an answer that
        comes late, or our own frame coming back from a two-wire adapter. Such an echo is
        expected from then on, or that of our ACK would be taken for the next station's.
        """
        self._last_code = 0
        step = Step(frame, self._timeout, delay)
        while (symbol := (yield step)) is not None:
            step = LISTEN_ON
            if isinstance(symbol, Control):
                self._count_control(symbol.code)
                self._last_code = symbol.code
                if symbol.code in wanted:
                    return symbol
            elif isinstance(symbol, Unknown):
                self._last_code = symbol.byte
                self._note(Message.NTC_INVALID_SYMBOL, symbol.byte, station=number)
            elif isinstance(symbol, Frame) and symbol.station is None:
                self._last_code = Code.STX
                return symbol
            elif self._is_echo(symbol, frame):
                self._machine.expect_echo()
        if self._machine.decoder.in_message:
            return Frame(b'', fault=Fault.NO_ETX)
        self._last_code = self._last_code or self._machine.decoder.last_byte
        return None

    def _is_echo(self, symbol: Frame | Poll, frame: bytes) -> bool:
        """Tell whether ``symbol`` is ``frame``, which we have sent ourselves."""
        if isinstance(symbol, Poll):
            return frames.poll_frame(symbol.station) == frame
        assert symbol.station is not None  # a slave's frame is an answer
        return frames.master_frame(
            symbol.station, symbol.data, self._settings.checksum) == frame

    def _receive(self, number: int, frame: Frame,
                 command: Packet | None) -> Generator[Step, Symbol | None, Packet | None]:
        """Acknowledge a good message; return it when it is the reply to ``command``."""
        self._counters.messages_received += 1
        self._counters.acks_sent += 1
        yield Step(frames.ACK, 0)
        packet = Packet.decode(frame.data)
        station = self._stations[number]
        if not station.accepts(packet):
            self._counters.duplicate_messages += 1
            self._note(Message.NTC_DUPLICATE_MSG_RCVD, number, station=number)
            return None
        if packet.is_reply:
            self._counters.replies_received += 1
            self._counters.error_messages_received += packet.sts != 0
        else:
            self._counters.commands_received += 1
        station.last_tns = packet.tns
        if command is None or not packet.answers(command):
            self._unwanted(number, packet)
            return None
        if packet.cmd != command.cmd | REPLY_BIT:
            self._counters.invalid_messages += 1
            details = (number, packet.cmd, command.cmd | REPLY_BIT)
            self._note(Message.ERR_BAD_FUNCTION_CODE, *details, station=number)
            raise WrongCommandCode(*details)
        station.replies += 1
        self._note(Message.NTC_REPLY_MSG_RCVD, number, station=number)
        return packet

    def _unwanted(self, number: int, packet: Packet) -> None:
        """Account for a message that answers nothing outstanding (S0, DispatchAbDf1Message)."""
        ours = packet.dst == self._settings.station and packet.src == number
        if packet.is_reply and ours:
            self._counters.stale_messages += 1
        else:
            self._counters.invalid_messages += not ours
        self._note(Message.ERR_WRONG_MESSAGE, packet.src, packet.dst, packet.tns,
                   station=number)

    def _give_up(self, number: int) -> Generator[Step, Symbol | None, None]:
        """End a transaction whose reply did not come in time (S0, counter 2545)."""
        self._counters.command_timeouts += 1
        self._note(Message.ERR_COMMAND_TIMEOUT, station=number)
        if self._settings.nak_on_command_timeout:
            self._counters.naks_sent += 1
            yield Step(frames.NAK, 0)
        raise CommandTimeout

    def _fail_inactive(self, number: int) -> NoReturn:
        self._stations.lost(number, self._machine.now)
        self._note(Message.ERR_INACTIVE_STATION, number, station=number)
        raise StationInactive(number)

    def _count_control(self, code: Code) -> None:
        self._counters.acks_received += code is Code.ACK
        self._counters.naks_received += code is Code.NAK
        self._counters.eots_received += code is Code.EOT

    def _note_fault(self, frame: Frame, number: int) -> Message:
        """Count and report what is wrong with a frame; return the message that names it."""
        event = count_fault(frame, self._settings.checksum, self._counters, number)
        self._report(event)
        return event.message

    def _note(self, message: Message, *args: int, station: int) -> None:
        self._report(Event(message, args, station))


def _is_good(answer: Symbol | None) -> TypeGuard[Control | Frame]:
    """Tell whether a poll was answered properly: with EOT or a good message."""
    return isinstance(answer, Control) or (isinstance(answer, Frame) and answer.fault is None)
