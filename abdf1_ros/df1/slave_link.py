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
A slave with a driver: it serves the master, and sends commands when it is polled.

The master passes commands of the slave on to other stations, and passes their replies back.
Nothing is sent before a poll. If no poll has come for the poll timeout, all waiting commands fail,
so that no old command is sent when the polls come back.
"""

from __future__ import annotations

from collections.abc import Callable
import math

from abdf1_ros.df1.accounting import Accounting
from abdf1_ros.df1.frames import Frame, NOISE, Symbol
from abdf1_ros.df1.link import Link, LinkState
from abdf1_ros.df1.machine import Machine, Procedure, Rest, Silence
from abdf1_ros.df1.mode import LineMode
from abdf1_ros.df1.packet import BROADCAST, is_local_status, Packet, STS_NOT_DELIVERED
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import answer, HalfDuplexSlave, Initiator, TICK
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import Outstanding, TaskSource
from abdf1_ros.errors import CommandExpired, CommandTimeout, LinkError
from abdf1_ros.messages import Event


class SlaveLink(Link, Initiator):
    """
    Serve the master on the line of ``machine``, and send the commands of a source.

    A command waits for the next poll, at most Cmd_Timeout. After the master has acknowledged the
    command, the link waits at most Cmd_Timeout for the reply. ``serve`` and ``report`` are the
    same as in every link. The link is the ``Initiator`` of its own slave. ``last_poll`` is the
    clock value (s) of the last poll, or of the start.
    """

    def __init__(self, machine: Machine, settings: LinkSettings, stations: ActiveStationList,
                 serve: Callable[[Packet], Packet],
                 report: Callable[[Event], None] = lambda event: None) -> None:
        self._machine = machine
        self._stations = stations
        self._settings = settings
        self._serve = serve
        self._accounting = Accounting(machine.counters, stations, report, settings.station)
        self._slave = HalfDuplexSlave(
            settings, self._serve_own, machine.counters, self, report)
        self._source: TaskSource | None = None
        self._outstanding: Outstanding | None = None
        self.last_poll = 0.0

    def status(self) -> LinkState:
        """Return when the master has polled us."""
        return LinkState(last_poll=self.last_poll)

    def run(self, source: TaskSource) -> Procedure:
        """Answer the master for ever."""
        self._slave.reset()
        self._source, self._outstanding = source, None
        self.last_poll = self._machine.now
        next_look = self._machine.now + TICK
        while True:
            # Look at fixed times, not after a pause, because the line may never be quiet.
            symbol = yield Rest(max(0.0, next_look - self._machine.now))
            if not isinstance(symbol, Silence):
                try:
                    yield from answer(self._machine, symbol, self._respond,
                                      lambda: self._look_after(source), self._expiry)
                except CommandExpired as error:
                    self._take_back(error)
                self._slave.make_use()
            if self._machine.now >= next_look:
                self._look_after(source)
                next_look = self._machine.now + TICK

    def _respond(self, symbol: Symbol) -> bytes:
        """Return the answer; ignore an old message: a master that still waits repeats it."""
        is_old = isinstance(symbol, Frame) and self._machine.may_be_old
        return self._slave.respond(NOISE if is_old else symbol)

    def _serve_own(self, command: Packet) -> Packet:
        """Execute a command for us; refuse a command for another node: we are not a gateway."""
        if command.dst in (self._settings.station, BROADCAST):
            return self._serve(command)
        self._accounting.wrong(command, command.src)
        return command.reply(sts=STS_NOT_DELIVERED)

    def _expiry(self) -> float:
        """Return when the answer that is given now expires, infinite unless it is a command."""
        entry = self._outstanding
        return math.inf if entry is None or not self._slave.gives_command else entry.task.expires

    def _take_back(self, error: CommandExpired) -> None:
        """End a command that was too old at the moment at which it could be sent."""
        was_sent = self._slave.take_back()
        entry = self._end()
        if entry is not None:
            entry.task.sent = was_sent
            entry.task.fail(error)

    def polled(self) -> None:
        self.last_poll = self._machine.now
        entry = self._outstanding
        if entry is None or entry.is_delivered:
            return
        # The command ends Cmd_Timeout after the last poll, so it does not wait for a master.
        entry.deadline = self.last_poll + self._settings.cmd_timeout
        if self.last_poll > entry.task.expires:
            self._end()
            entry.task.fail(CommandExpired())

    def next_command(self) -> Packet | None:
        """Return a command to send now, one at a time."""
        now = self._machine.now
        if self._source is None or self._outstanding is not None:
            return None
        task = self._source.next_task(now)
        if task is None:
            return None
        task.sent = True
        self._outstanding = Outstanding(task, now + self._settings.cmd_timeout)
        return task.command

    def delivered(self, command: Packet) -> None:
        """Begin to wait for the reply; a broadcast has none and is complete."""
        entry = self._outstanding
        if entry is None:
            return
        if command.dst == BROADCAST:
            self._outstanding = None
            entry.task.reply(command.reply())
            return
        entry.is_delivered = True
        entry.deadline = self._machine.now + self._settings.cmd_timeout

    def undelivered(self, command: Packet, error: LinkError) -> None:
        """Fail the command that the master did not acknowledge."""
        entry = self._end()
        if entry is not None:
            entry.task.fail(error)

    def replied(self, reply: Packet) -> None:
        """Take a reply; a reply that answers no command is stale."""
        entry = self._outstanding
        if entry is None or not reply.answers(entry.task.command):
            if entry is not None and reply.src == entry.task.command.dst:
                # the right reply may follow with the same SRC, CMD and TNS
                self._slave.forget_last()
            self._accounting.unexpected(reply, self._machine.now)
            return
        self._end()  # even if the master's ACK got lost, because the master has had the command
        if not is_local_status(reply.sts):
            self._stations.heard(reply.src, self._machine.now)
        self._accounting.complete(entry.task, reply, keeps_others_waiting=True)

    def _look_after(self, source: TaskSource) -> None:
        """End a command that is overdue; without polls, end all commands."""
        now = self._machine.now
        entry = self._outstanding
        is_overdue = entry is not None and now >= entry.deadline
        is_alone = 0 < self._settings.poll_timeout <= now - self.last_poll
        if is_overdue or is_alone:
            self._fail()
        if not is_alone:
            return
        waiting = []  # take all commands first, because a read that fails is soon due again
        while (task := source.next_task(now)) is not None:
            waiting.append(task)
        for task in waiting:
            task.fail(CommandTimeout())

    def _end(self) -> Outstanding | None:
        """Forget and return the command that waits for a poll or reply; do not send it again."""
        entry, self._outstanding = self._outstanding, None
        self._slave.withdraw()
        return entry

    def _fail(self) -> None:
        entry = self._end()
        if entry is not None:
            self._accounting.overdue(entry.task, keeps_others_waiting=entry.is_delivered)


class SlaveMode(LineMode):
    """A slave: the master polls, and passes commands and replies on."""

    name = 'Slave'
    link = SlaveLink
    other_words = {'df1halfduplexslave': 'Slave', 'halfduplexslave': 'Slave'}
    is_polled = True
    why_unshared = "a slave cannot send a guest's commands"


SLAVE = SlaveMode()
