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
The master with message-based polling: one transaction with one station, then the next.

Theory of operation (S0, "Functional Overview"; M 3-12..3-17). The master speaks, a slave
answers. A transaction has three phases, each a generator::

    probe     only for a station that is inactive in the list: one poll. DLE EOT or any message
              makes the station active, and the transaction proceeds; silence ends it.
    deliver   the command frame, until DLE ACK. Silence or DLE NAK: again, up to NAK_Retries.
    collect   polls, until the reply. DLE EOT means not ready: poll again, until Cmd_Timeout has
              passed since the beginning of the transmission that was acknowledged. Silence,
              DLE NAK or a damaged frame: again, up to ENQ_Retries for each poll.

A station that passes a retry limit becomes inactive.

A transaction therefore ends within (NAK_Retries + 1) x Timeout for delivery, Cmd_Timeout for
polling, and (ENQ_Retries + 1) x Timeout for the last poll. The retries of a phase are never
cut short by Cmd_Timeout: with S0's defaults (both 1000 ms) no retry would ever happen. The time
is also extended for a few messages that the slave had queued before the reply.

Messages between slaves, which the master passes on, take turns with its own transactions.
"""

from __future__ import annotations

from collections.abc import Callable, Generator

from abdf1_ros.df1 import frames
from abdf1_ros.df1.frames import Control, Frame
from abdf1_ros.df1.link import Link
from abdf1_ros.df1.machine import Heard, Machine, Procedure, Rest, Send, Step
from abdf1_ros.df1.master_line import MasterLine, MOST_QUEUED, poll_on_ack
from abdf1_ros.df1.mode import LineMode
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.df1.settings import LinkSettings, PollingSettings
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import Task, TaskSource
from abdf1_ros.errors import CommandExpired, CommandTimeout, StationInactive
from abdf1_ros.messages import Event, Message


class HalfDuplexMaster(Link):
    """
    Carry out transactions on the line of ``machine``.

    ``report`` and ``serve`` are described at ``MasterLine``.
    """

    def __init__(self, machine: Machine, settings: LinkSettings, stations: ActiveStationList,
                 serve: Callable[[Packet], Packet] | None = None,
                 report: Callable[[Event], None] = lambda event: None) -> None:
        self._machine = machine
        self._settings = settings
        self._stations = stations
        self._line = MasterLine(machine, settings, stations, serve, report)

    def run(self, source: TaskSource) -> Procedure:
        """Carry out the tasks of ``source``, one at a time, for ever."""
        self._line.begin()
        while True:
            # Messages of slaves and our own commands take turns. Otherwise slaves that send all
            # the time would block our commands.
            if self._line.forwards:
                yield from self._line.forward(collect=self._collect_for_slave)
            now = self._machine.now
            task = source.next_task(now)
            if task is not None:
                yield from self.carry_out(task)
            elif not self._line.forwards:
                yield Rest(max(source.next_due() - now, 0.0))

    def carry_out(self, task: Task) -> Procedure:
        """Send the command of a task and end the task; for a broadcast, we make a reply."""
        command = task.command
        # The station of this line that is addressed (M 3-7).
        number = self._stations.routes.get(command.dst, command.dst)
        try:
            is_silent = number != BROADCAST and not self._stations.records[number].active
            if is_silent and not task.is_own:
                yield from self._line.probe(number)
            task.sent = True
            started = yield from self._line.deliver(
                number, command, task.expires, poll_on_ack(number), task.answer_within)
            reply = command.reply() if number == BROADCAST else (
                yield from self._collect(number, command, started, task.reply_size,
                                         is_vain=not task.blames))
        except CommandExpired as error:
            task.sent = error.sent
            task.fail(error)
        except StationInactive as error:
            if task.blames:
                self._line.accounting.lost(error.number, self._machine.now, error.cause)
            task.fail(error)
        except CommandTimeout as error:
            yield from self._give_up(task, error.cause)
            task.fail(error)
        else:
            if number == BROADCAST:
                task.reply(reply)
            else:
                self._line.complete(task, reply, keeps_others_waiting=True)

    def _collect_for_slave(self, number: int, command: Packet) -> Procedure:
        """Poll for the reply to a command that was passed on (M 3-8)."""
        station = self._stations[command.dst]
        try:
            reply = yield from self._collect(number, command, self._machine.now, is_vain=True)
        except StationInactive as error:  # the sender of the command has a time-out of its own
            if number not in self._line.faults:  # else it answers, and may reply to others
                self._line.accounting.lost(number, self._machine.now, error.cause)
            return
        except CommandTimeout as error:
            station.overdue += error.cause is None
            return
        station.overdue = 0
        self._line.take_unwanted(reply)

    def _collect(self, number: int, command: Packet, started: float, reply_size: int = 0, *,
                 is_vain: bool = False) -> Generator[Step, Heard, Packet]:
        """
        Poll until the reply to ``command`` comes (S0, "Network Reads"; M 3-13..3-15).

        A station that keeps a damaged reply would send it to the polls of the next command. So the
        polls go on until the station gives it up, if the command ``is_vain``: its failure does not
        make the station inactive.
        """
        pause, passed_over = 0.0, 0
        while True:
            try:
                answer = yield from self._line.poll_with_retries(number, pause, reply_size)
            except StationInactive:
                if self._is_over(started) or not is_vain or number not in self._line.faults:
                    raise
                continue
            if is_vain and answer is Control.EOT and number in self._line.faults:
                raise CommandTimeout(cause=self._line.faults[number])
            packet = None
            if isinstance(answer, Frame):
                packet = yield from self._line.receive(number, answer)
            if packet is not None and self._line.answers(packet, command):
                return packet
            if packet is not None:
                self._line.take_unwanted(packet)
            pause = self._settings.poll_pause
            passed_over += isinstance(answer, Frame)
            may_be_next = isinstance(answer, Frame) and passed_over <= MOST_QUEUED
            if self._is_over(started) and not may_be_next:
                raise CommandTimeout(cause=self._line.faults.get(number))

    def _is_over(self, started: float) -> bool:
        return self._machine.now - started >= self._settings.cmd_timeout

    def _give_up(self, task: Task, cause: Message | None) -> Procedure:
        """Count and report a reply that did not come in time (S0, counter 2545)."""
        self._line.accounting.late(task, keeps_others_waiting=True, cause=cause)
        if self._resets_slaves:
            self._line.counters.naks_sent += 1
            yield Send(frames.NAK)

    @property
    def _resets_slaves(self) -> bool:
        """Tell whether an overdue reply may make all slaves of the line drop what they hold."""
        wanted = self._settings.nak_on_command_timeout
        if wanted is not None:
            return wanted
        polling = self._settings.polling or PollingSettings(())
        named = {*self._stations.records, *polling.priority, *polling.normal}
        return len(named - {self._settings.station, BROADCAST}) <= 1


class MasterMode(LineMode):
    """Master of a half-duplex line with message-based polling."""

    name = 'Master'
    link = HalfDuplexMaster
    polling = 'Message'
    other_words = {'df1halfduplexmaster': 'Master', 'halfduplexmaster': 'Master',
                   'halfduplex': 'Master, or Slave where another is the master'}
    is_master = True
    waits_for_acks = True


MASTER = MasterMode()
