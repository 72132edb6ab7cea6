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
A node of a DF1 radio modem network: frames without ACK, NAK, ENQ or polls.

Sources: 1747-RM001G 13-76 to 13-80, 1763-RM001C 517 to 522. Any node sends to any other, in the
frames of full duplex. A node takes what has its number or 255 as DST, and drops the rest. A
command is answered by its reply, or by nothing: then we send it again, with the same TNS, so that
a PLC knows it as a repetition.

Ours: a node waits until the line is quiet, and then for a time by chance, before it sends; that
time grows with each try, as everybody may have waited for the same end. A repetition of a command
is answered with the reply that we have given, as that may be what was lost.

A node that stores and forwards sends a packet again, once, if it has both its SRC and its DST in
its table, and not among the last packets.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass
from random import Random

from abdf1_ros.df1 import frames
from abdf1_ros.df1.accounting import count_fault, wrong_message
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Frame
from abdf1_ros.df1.link import EqualNode
from abdf1_ros.df1.machine import (
    Heard,
    LineTiming,
    Machine,
    MIN_RESPONSE_TIME,
    Procedure,
    Silence,
    Step,
)
from abdf1_ros.df1.packet import BROADCAST, is_local_status, Packet
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import Task, TaskSource
from abdf1_ros.errors import CommandExpired, StationInactive
from abdf1_ros.messages import Event, Message

# Packets that a node remembers (1763-RM001C), and for how long (s): some programs always send
# TNS 0.
_MOST_RECENT = 20
_RECENT = 10.0

# Replies and packets of others that wait for a quiet line; with more, the newest are dropped.
_MOST_WAITING = 16

# The line is quiet after a pause of so many characters, besides what equipment holds bytes back.
_QUIET_CHARACTERS = 20

# The time by chance before the first try is up to that of our frame, twice as much before each
# further one, but no more than this many times.
_MOST_BACK_OFF = 8

# A line that is never quiet does not keep us from it for longer (s).
LONGEST_WAIT = 2.0

_SHORT_FRAME = 24  # characters of a command that reads

_MOMENT = 0.0001  # s after the last byte


def usual_wait(timing: LineTiming) -> float:
    """Return the seconds that a first try waits on a quiet line, mostly."""
    most = MIN_RESPONSE_TIME + timing.tx_delay + _SHORT_FRAME * timing.char_time
    return MIN_RESPONSE_TIME + _QUIET_CHARACTERS * timing.char_time + most / 2


def longest_wait(timing: LineTiming, frames_time: float) -> float:
    """Return the seconds until a frame has left, and any that was coming in, at most."""
    return LONGEST_WAIT + timing.tx_delay + 2 * frames_time \
        + MIN_RESPONSE_TIME + _QUIET_CHARACTERS * timing.char_time


@dataclass(frozen=True, slots=True)
class RadioSettings:
    """
    The settings of a node, times in seconds.

    A command is sent again ``retries`` times, each ``cmd_timeout`` after the one before. Packets
    between nodes of ``store_forward`` are sent again; 255 in it stands for broadcasts. ``also``
    are further numbers that are ours: of PLCs that are simulated by one node.
    """

    station: int
    checksum: Checksum = Checksum.CRC
    retries: int = 3
    cmd_timeout: float = 1.0
    store_forward: Collection[int] = ()
    also: Collection[int] = ()

    @property
    def numbers(self) -> set[int]:
        """Return the numbers that this node answers to."""
        return {self.station, *self.also}


@dataclass(slots=True)
class _Recent:
    """A packet that has been heard, when (clock value in s), and our reply to it."""

    data: bytes
    when: float
    reply: Packet | None = None


class RadioNode(EqualNode):
    """
    Carry out tasks on the line of ``machine``, one at a time, and serve commands that come.

    ``serve`` executes a command and returns its reply, if it gives one; it is called once for each
    command.
    ``report`` is called with every numbered error and notice. ``random`` gives times by chance.
    """

    def __init__(self, machine: Machine, settings: RadioSettings, stations: ActiveStationList,
                 serve: Callable[[Packet], Packet | None],
                 report: Callable[[Event], None] = lambda event: None,
                 random: Random | None = None) -> None:
        super().__init__(machine, stations, serve, report)
        self._settings = settings
        self._random = random or Random()
        self._forget()

    def _forget(self) -> None:
        self._waiting: deque[bytes] = deque()  # link data to be sent
        self._recent: deque[_Recent] = deque(maxlen=_MOST_RECENT)
        self._task: Task | None = None

    def run(self, source: TaskSource) -> Procedure:
        """Carry out the tasks of ``source`` and serve others, for ever."""
        self._forget()
        while True:
            # In turns, or others could keep our commands waiting for ever.
            if self._waiting:
                yield from self._send(self._waiting.popleft())
            task = source.next_task(self._machine.now)
            if task is not None:
                yield from self._carry_out(task)
            elif not self._waiting:
                due = source.next_due()
                left = None if due is None else max(due - self._machine.now, 0.0)
                symbol = yield Step(None, left)
                self._hear(symbol)

    def _carry_out(self, task: Task) -> Procedure:
        """Send a command until its reply is here, or until all tries are over."""
        number = task.command.dst
        self._accounting.sent(task.command)
        if number == BROADCAST:
            yield from self._transmit(task, 0)
            if task.sent:
                task.reply(task.command.reply())
            return
        self._task = task
        # A station that did not answer last time gets one try, not a whole cycle of them.
        tries = self._settings.retries + 1 if self._stations[number].active else 1
        for count in range(tries):
            if count:
                self._counters.nak_retries += 1
                self._note(Message.NTC_NAK_RETRY, count, Message.ERR_COMMAND_TIMEOUT.number,
                           station=number)
            yield from self._transmit(task, count)
            yield from self._await_reply()
            if self._task is None:
                return
        self._task = None
        self._accounting.late(number, keeps_others_waiting=True)
        self._stations.lost(number, self._machine.now)
        self._note(Message.ERR_INACTIVE_STATION, number, station=number)
        task.fail(StationInactive(number))

    def _transmit(self, task: Task, count: int) -> Procedure:
        """Send a command when the line is quiet; one that has become too old ends its task."""
        is_sent, task.sent = task.sent, True
        try:
            yield from self._send(task.command.encode(), count, task.expires)
        except CommandExpired as error:
            task.sent = error.sent = is_sent
            self._task = None
            task.fail(error)

    def _await_reply(self) -> Procedure:
        """Wait for the reply to our command; meanwhile others are answered."""
        end = self._machine.free_at + self._settings.cmd_timeout
        while self._task is not None and (left := end - self._machine.now) > 0:
            if self._waiting:
                yield from self._send(self._waiting.popleft())
            else:
                self._hear((yield Step(b'', left)))

    def _send(self, data: bytes, count: int = 0, expires: float = float('inf')) -> Procedure:
        """Send link data when the line has been quiet."""
        machine = self._machine
        frame = frames.message_frame(data, self._settings.checksum)
        quiet = MIN_RESPONSE_TIME + _QUIET_CHARACTERS * machine.char_time
        most = min(1 << count, _MOST_BACK_OFF) * (
            MIN_RESPONSE_TIME + machine.tx_delay + len(frame) * machine.char_time)
        give_up = machine.now + LONGEST_WAIT
        pause = quiet + self._random.uniform(0.0, most)
        begun = machine.now
        while (left := min(begun + pause, give_up) - machine.now) > 0:
            symbol = yield Step(b'', left)
            if isinstance(symbol, Silence):
                begun = max(begun, machine.now - symbol.seconds)
            else:
                self._hear(symbol)
                begun, pause = machine.now, quiet + self._random.uniform(0.0, most)
        self._counters.messages_sent += 1
        self._remember(data)
        try:
            symbol = yield Step(frame, _MOMENT, expires=expires)
        except CommandExpired:
            self._counters.messages_sent -= 1
            raise
        self._hear(symbol)
        while (left := machine.free_at - machine.now) > 0:  # nothing of ours follows before that
            self._hear((yield Step(b'', left)))

    def _remember(self, data: bytes) -> _Recent:
        recent = _Recent(data, self._machine.now)
        self._recent.append(recent)
        return recent

    def _known(self, data: bytes) -> _Recent | None:
        """Return the packet of these link data, if it is among the last ones."""
        return next((recent for recent in self._recent if recent.data == data
                     and self._machine.now - recent.when < _RECENT), None)

    def _hear(self, symbol: Heard) -> None:
        """Take a packet; a symbol of another mode is noise."""
        if not isinstance(symbol, Frame):
            return
        if symbol.fault is not None:
            self._report(count_fault(symbol, self._settings.checksum, self._counters))
            return
        packet = Packet.decode(symbol.data)
        if packet.src in self._settings.numbers:
            return  # ours, sent on by another node
        is_ours = packet.dst in self._settings.numbers
        known = self._known(symbol.data)
        recent = known or self._remember(symbol.data)
        between = {packet.src, packet.dst}
        if known is None and not is_ours and between <= {*self._settings.store_forward}:
            self._put(symbol.data)
        if not is_ours and packet.dst != BROADCAST:
            return
        self._counters.messages_received += 1
        if not packet.is_sound:
            self._counters.invalid_messages += 1
            self._report(wrong_message(packet, packet.src))
        elif packet.is_reply:
            self._take_reply(packet, is_repetition=known is not None)
        elif known is None:
            self._counters.commands_received += 1
            reply = self._serve(packet)
            if packet.dst != BROADCAST:
                recent.reply = reply
                self._answer(recent)
        else:
            self._counters.duplicate_messages += 1
            # What a node has sent on comes soon after the first; a sender waits for longer.
            if self._machine.now - recent.when > self._settings.cmd_timeout / 2:
                recent.when = self._machine.now
                self._answer(recent)

    def _answer(self, recent: _Recent) -> None:
        if recent.reply is not None:
            self._accounting.sent(recent.reply)
            self._put(recent.reply.encode())

    def _put(self, data: bytes) -> None:
        """Let link data wait for the line."""
        if len(self._waiting) < _MOST_WAITING:
            self._waiting.append(data)
        else:
            self._counters.refused_for_memory += 1

    def _take_reply(self, packet: Packet, *, is_repetition: bool) -> None:
        """Give a reply to the command that waits for it."""
        task = self._task
        if task is None or not packet.answers(task.command):
            if is_repetition:
                self._counters.duplicate_messages += 1
            else:
                self._accounting.received(packet)
                self._accounting.stale(packet)
            return
        self._task = None
        self._accounting.received(packet)
        if not is_local_status(packet.sts):
            self._stations.heard(packet.src, self._machine.now)
        self._accounting.complete(task, packet, keeps_others_waiting=True)
