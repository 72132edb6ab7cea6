"""
A slave that is a driver of its own: it serves the master, and sends commands when it is polled.

Its commands go to other stations by way of the master, which passes them on, and so do the
replies. Nothing leaves before a poll: a slave that is not polled for the poll timeout fails
what it wanted to send, so that no old command is sent when the polls come back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from abdf1_ros.df1.machine import Machine, Procedure, Step
from abdf1_ros.df1.packet import Packet, REPLY_BIT
from abdf1_ros.df1.slave import HalfDuplexSlave, SlaveSettings
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import Task, TaskSource
from abdf1_ros.errors import CommandTimeout, WrongCommandCode
from abdf1_ros.messages import Event, Message

# How often (s) a slave that hears nothing looks what has become overdue.
_TICK = 0.25


@dataclass(slots=True)
class _Outstanding:
    """The command on its way; ``deadline`` (clock value in s) runs from the master's ACK."""

    task: Task
    deadline: float | None = None


class SlaveLink:
    """
    Serve the master on the line of ``machine``, and send the commands of a source.

    ``cmd_timeout`` (s) is how long a command waits for its reply after the master has taken
    it, ``poll_timeout`` (s, 0 for ever) how long we may be left unpolled. ``serve`` and
    ``report`` are those of every link. It is the ``Initiator`` of its own slave.
    """

    def __init__(self, machine: Machine, settings: SlaveSettings, stations: ActiveStationList,
                 serve: Callable[[Packet], Packet], *, cmd_timeout: float, poll_timeout: float,
                 report: Callable[[Event], None] = lambda event: None) -> None:
        self._machine = machine
        self._settings = settings
        self._stations = stations
        self._serve = serve
        self._cmd_timeout = cmd_timeout
        self._poll_timeout = poll_timeout
        self._report = report
        self._source: TaskSource | None = None
        self._outstanding: _Outstanding | None = None
        self._last_poll = 0.0

    def run(self, source: TaskSource) -> Procedure:
        """Answer the master for ever."""
        slave = HalfDuplexSlave(self._settings, self._serve, self._machine.counters, self)
        self._source = source
        self._outstanding = None
        self._last_poll = self._machine.now
        while True:
            symbol = yield Step(None, _TICK)
            if symbol is None:
                self._look_after(source)
                continue
            answer = slave.handle(symbol)
            if answer:
                yield Step(answer, 0)

    def polled(self) -> None:
        """Take note that the master has polled us."""
        self._last_poll = self._machine.now

    def next_command(self) -> Packet | None:
        """Return a command to send now, one at a time."""
        now = self._machine.now
        if self._source is None or self._outstanding is not None:
            return None
        task = self._source.next_task(now)
        if task is None:
            return None
        task.sent = True
        self._outstanding = _Outstanding(task)
        return task.command

    def delivered(self, command: Packet) -> None:
        """Begin to wait for the reply."""
        if self._outstanding is not None:
            self._outstanding.deadline = self._machine.now + self._cmd_timeout

    def undelivered(self, command: Packet) -> None:
        """Fail the command that the master did not take."""
        self._note(Message.NTC_NAK_LIMIT_EXCEEDED, self._settings.retries,
                   station=command.dst)
        self._fail()

    def replied(self, reply: Packet) -> None:
        """Take a reply; one that fits nothing is stale."""
        entry = self._outstanding
        if entry is None or not reply.answers(entry.task.command):
            self._machine.counters.stale_messages += 1
            self._note(Message.ERR_WRONG_MESSAGE, reply.src, reply.dst, reply.tns,
                       station=reply.src)
            return
        self._outstanding = None
        self._stations.heard(reply.src, self._machine.now)
        expected = entry.task.command.cmd | REPLY_BIT
        if reply.cmd != expected:
            self._machine.counters.invalid_messages += 1
            details = reply.src, reply.cmd, expected
            self._note(Message.ERR_BAD_FUNCTION_CODE, *details, station=reply.src)
            entry.task.fail(WrongCommandCode(*details))
            return
        self._stations[reply.src].replies += 1
        self._note(Message.NTC_REPLY_MSG_RCVD, reply.src, station=reply.src)
        entry.task.reply(reply)

    def _look_after(self, source: TaskSource) -> None:
        """End what is overdue."""
        now = self._machine.now
        source.expire(now)
        entry = self._outstanding
        if entry is not None and entry.deadline is not None and now >= entry.deadline:
            self._fail()
        if not self._poll_timeout or now - self._last_poll < self._poll_timeout:
            return
        if self._outstanding is not None:
            self._fail()
        while (task := source.next_task(now)) is not None:
            task.fail(CommandTimeout())

    def _fail(self) -> None:
        entry, self._outstanding = self._outstanding, None
        if entry is None:
            return
        number = entry.task.command.dst
        self._machine.counters.command_timeouts += 1
        self._note(Message.ERR_COMMAND_TIMEOUT, station=number)
        entry.task.fail(CommandTimeout())

    def _note(self, message: Message, *args: int, station: int) -> None:
        self._report(Event(message, args, station))
