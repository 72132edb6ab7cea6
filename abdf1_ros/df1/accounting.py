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

"""The counters and reports of every kind of link, and the end of its commands."""

from __future__ import annotations

from collections.abc import Callable

from abdf1_ros.counters import Counters
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Control, Frame, FrameFault, MAX_LINK_DATA, Symbol
from abdf1_ros.df1.packet import DIAGNOSTIC_REPLY, HEADER_SIZE, is_local_status, Packet, REPLY_BIT
from abdf1_ros.df1.stations import ActiveStationList, MOST_OVERDUE
from abdf1_ros.df1.tasks import Task
from abdf1_ros.errors import CommandExpired, CommandTimeout, ReplyHindered, WrongCommandCode
from abdf1_ros.messages import Event, Message

ReportEvent = Callable[[Event], None]


def count_fault(frame: Frame, checksum: Checksum, counters: Counters,
                station: int | None = None) -> Event:
    """Count the fault of ``frame``, heard from ``station``; return the event that names it."""
    if frame.fault is FrameFault.BAD_CHECK:
        values = (*divmod(frame.received, 256), *divmod(frame.expected, 256))
        if checksum is Checksum.BCC:
            counters.bcc_errors += 1
            return Event(Message.ERR_BAD_BCC, values, station)
        counters.crc_errors += 1
        return Event(Message.ERR_BAD_CRC, values, station)
    counters.invalid_messages += 1
    if frame.fault is FrameFault.NO_ETX:
        return Event(Message.NTC_NO_ETX_RCVD, (), station)
    if frame.fault is FrameFault.TOO_SHORT:
        return Event(Message.NTC_RCVD_MSG_TOO_SHORT, (HEADER_SIZE,), station)
    return Event(Message.NTC_RCVD_MSG_TOO_LONG, (MAX_LINK_DATA,), station)


def count_control(symbol: object, counters: Counters) -> None:
    """Count DLE ACK, NAK, EOT and ENQ."""
    counters.acks_received += symbol is Control.ACK
    counters.naks_received += symbol is Control.NAK
    counters.eots_received += symbol is Control.EOT
    counters.enqs_received += symbol is Control.ENQ


def count_unheard(symbol: Symbol, checksum: Checksum, counters: Counters) -> None:
    """Count a symbol of a slave that comes while the master does not wait for an answer."""
    count_control(symbol, counters)
    if isinstance(symbol, Frame) and symbol.station is None:
        if symbol.fault is not None:
            count_fault(symbol, checksum, counters)
            return
        is_reply = Packet.decode(symbol.data).is_reply
        counters.messages_received += 1
        counters.replies_received += is_reply
        counters.stale_messages += is_reply


def wrong_message(packet: Packet, station: int) -> Event:
    """Return the event of a message from ``station`` that is not a reply to any command."""
    return Event(Message.ERR_WRONG_MESSAGE, (packet.src, packet.dst, packet.tns), station)


class Tally:
    """Count the messages of one node, and report its events."""

    def __init__(self, counters: Counters, report: ReportEvent) -> None:
        self.counters = counters
        self.report = report

    def note(self, message: Message, *args: int, station: int | None) -> None:
        """Report a numbered error or notice at a station."""
        self.report(Event(message, args, station))

    def sent(self, packet: Packet) -> None:
        """Count a message of ours, once even if it is sent several times."""
        if packet.cmd & REPLY_BIT:
            self.counters.replies_sent += 1
            self.counters.error_messages_sent += packet.sts != 0
        else:
            self.counters.commands_sent += 1

    def taken_back(self, error: CommandExpired, *, was_sent: bool) -> None:
        """Uncount a try that was too old to be sent; ``was_sent``: there was an earlier try."""
        self.counters.messages_sent -= 1
        self.counters.commands_sent -= not was_sent
        error.sent = was_sent

    def received(self, packet: Packet) -> None:
        """Count a good message that is not a repetition."""
        if packet.cmd & REPLY_BIT:
            self.counters.replies_received += 1
            self.counters.error_messages_received += packet.sts != 0
        else:
            self.counters.commands_received += 1

    def repeated(self, tries: int, cause: Message, station: int | None) -> None:
        """Count and report that a message is sent again, after this number of tries."""
        self.counters.nak_retries += 1
        self.note(Message.NTC_NAK_RETRY, tries, cause.number, station=station)

    def given_up(self, retries: int, station: int | None) -> None:
        """Count and report that a message is not sent again, after this number of repetitions."""
        self.counters.nak_limit_exceeded += 1
        self.note(Message.NTC_NAK_LIMIT_EXCEEDED, retries, station=station)

    def wrong(self, packet: Packet, station: int) -> None:
        """Count and report a message with wrong addresses (S0, counter 2550, message 2510)."""
        self.counters.invalid_messages += 1
        self.report(wrong_message(packet, station))


class Accounting(Tally):
    """
    Update the counters and the records of stations of one link, and report its events.

    ``number`` is our own station, None if messages to any station are ours.
    """

    def __init__(self, counters: Counters, stations: ActiveStationList,
                 report: ReportEvent, number: int | None) -> None:
        super().__init__(counters, report)
        self._stations = stations
        self._number = number

    def unexpected(self, reply: Packet, now: float) -> None:
        """
        Count and report a reply that no command waits for (S0, message 2510).

        A reply that may answer an earlier command is stale (S0, counter 2548). It proves that its
        station answers, unless a node on the way has replied for the station. Any other reply is
        invalid (2550, "incorrect addressing"): not for us, or from a station that we do not ask.
        """
        may_answer = self._number in (None, reply.dst) and reply.src in self._stations
        self.counters.stale_messages += may_answer
        self.counters.invalid_messages += not may_answer
        if may_answer and is_local_status(reply.sts):
            self._stations.gateway_replied(reply.src)
        elif may_answer:
            self._stations.heard(reply.src, now)
        self.report(wrong_message(reply, reply.src))

    def nak_received(self, station: int | None) -> None:
        """Report that a message of ours has been answered with DLE NAK."""
        self.note(Message.NTC_RCVD_NAK_SYMBOL, station=station)
        self.note(Message.ERR_RCVD_NAK_SYMBOL, station=station)

    def complete(self, task: Task, reply: Packet, *, keeps_others_waiting: bool) -> None:
        """
        End a task with the reply to its command, or as WrongCommandCode if CMD differs (S0).

        If a gateway does not reach a PLC, it sends an error reply in its place, maybe after a long
        time. If other commands have to wait for such a reply, it counts in ``overdue`` like a
        missing reply.
        """
        number = reply.src
        expected = task.command.cmd | REPLY_BIT
        if reply.cmd != expected:
            self.counters.invalid_messages += 1
            details = number, reply.cmd, expected
            self.note(Message.ERR_BAD_FUNCTION_CODE, *details, station=number)
            task.fail(WrongCommandCode(*details))
            return
        local_status = reply.sts if reply.sts and is_local_status(reply.sts) else 0
        station = self._stations.records[number]
        if local_status:
            self._stations.gateway_replied(number)
        # A gateway may execute diagnostic commands itself, whatever node they are for.
        is_gateways = reply.cmd == DIAGNOSTIC_REPLY and not local_status and (
            station.local_status or number in self._stations.routes)
        if (task.blames or not local_status) and not is_gateways:
            station.replies += 1
            station.unanswered = station.returns = 0
            station.local_status = local_status
            station.overdue = station.overdue + keeps_others_waiting if local_status else 0
            station.last_tns = reply.tns
        self.report(Event(Message.NTC_REPLY_MSG_RCVD, (number,), number))
        task.reply(reply)

    def late(self, task: Task, *, keeps_others_waiting: bool,
             cause: Message | None = None) -> None:
        """Count and report a reply that has not come within Cmd_Timeout (S0, counter 2545)."""
        self.counters.command_timeouts += 1
        number = task.command.dst
        if task.blames:
            station = self._stations[number]
            if keeps_others_waiting:
                station.overdue = MOST_OVERDUE if self._stations.is_new(number) \
                    else station.overdue + 1
            station.unanswered += 1
            station.unanswered_by = cause
        self.note(Message.ERR_COMMAND_TIMEOUT, station=number)

    def overdue(self, task: Task, *, keeps_others_waiting: bool,
                cause: Message | None = None) -> None:
        """End a task whose reply has not come within Cmd_Timeout."""
        self.late(task, keeps_others_waiting=keeps_others_waiting, cause=cause)
        task.fail(CommandTimeout(cause=cause))

    def hindered(self, task: Task) -> None:
        """End a task that waited for a busy far end; the failure blames no station."""
        self.counters.command_timeouts += 1
        self.note(Message.ERR_COMMAND_TIMEOUT, station=task.command.dst)
        task.fail(ReplyHindered())

    def lost(self, number: int, now: float, cause: Message | None = None) -> None:
        """Make a station inactive, and report it; ``cause`` is what was wrong with its answer."""
        self._stations[number].unanswered_by = cause
        self._stations.lost(number, now)
        self.note(Message.ERR_INACTIVE_STATION, number, station=number)
