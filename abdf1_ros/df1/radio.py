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

Sources: 1747-RM001G 13-76 to 13-80, 1763-RM001C 517 to 522. Any node may send to any other node,
in the frames of full duplex. A node accepts packets with its number or 255 as DST, and drops all
other packets. The only answer to a command is its reply. If no reply comes, we send the command
again with the same TNS, so that a PLC recognizes the repetition.

Our own rules: a node waits until the line is quiet, and then for a random time, before it sends.
The random time grows with each try, because several nodes may have waited for the end of the same
packet. A repetition of a command is answered with the reply that we have given, because that reply
may have been lost. If we hear a packet with our number as SRC that we did not send, another node
has our number. We then ignore replies that may belong to its commands.

A node that stores and forwards sends a packet again, once. It does so if SRC and DST are in its
table and the packet is not among the last packets.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math
from random import Random

from abdf1_ros.df1 import frames
from abdf1_ros.df1.accounting import count_control, count_fault
from abdf1_ros.df1.frames import Duplex, Frame, MAX_LINK_DATA
from abdf1_ros.df1.link import EqualNode, LinkState
from abdf1_ros.df1.machine import (
    Heard,
    Listen,
    LONGEST_REST,
    Machine,
    MIN_RESPONSE_TIME,
    MOMENT,
    Procedure,
    Rest,
    Send,
    Silence,
    Step,
)
from abdf1_ros.df1.mode import LineMode
from abdf1_ros.df1.packet import BROADCAST, is_local_status, Packet
from abdf1_ros.df1.receiver import HELD_BACK, QUIET_CHARACTERS
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import Task, TaskSource
from abdf1_ros.errors import CommandExpired, PortLost, StationInactive
from abdf1_ros.messages import Event, Message

# A node does not forward a packet that is among this number of last packets heard (1763-RM001C).
# Older packets (s) are ignored, because some programs always send TNS 0.
_MOST_HEARD = 20
_RECENT = 10.0

# Most packets of ours that are remembered: nodes may forward them back to us.
_MOST_SENT = 256

# Most commands that are remembered: a copy may be forwarded after many newer ones.
_MOST_EXECUTED = 256

# Most replies and forwarded packets that wait for a quiet line. Further packets are dropped.
_MOST_WAITING = 16

# The random time before the first try is at most the line time of our frame. This limit doubles
# with each further try, up to this many times its first value.
_MOST_BACK_OFF = 8

# Longest wait (s) for a quiet line. After it the node sends, even if the line is not quiet.
LONGEST_WAIT = 2.0

# Characters of a read command, and of the longest packet.
_SHORT_FRAME, _LONG_FRAME = 24, MAX_LINK_DATA + 8

# Interval (s) at which a node that waits for replies looks for commands to other stations.
_TICK = 0.05

# Most commands that are under way if the radios avoid collisions. With default settings this
# number of longest replies fills Cmd_Timeout.
MOST_UNDER_WAY = 4


@dataclass(slots=True)
class _Executed:
    """A command for us, our reply, and when it came and was last answered (clock values in s)."""

    command: Packet
    when: float
    answered: float
    reply: Packet | None


@dataclass(slots=True)
class _SentCommand:
    """
    A command that waits for its reply, which is overdue at ``deadline`` (clock value in s).

    It has been sent ``tries`` times, of ``most``. It ``is_doubtful`` if another node with our
    number has asked the same station with the same TNS: a reply may then belong to either command.
    ``cause`` is what was wrong with the last damaged packet that came meanwhile.
    """

    task: Task
    most: int
    tries: int = 0
    deadline: float = -math.inf
    is_doubtful: bool = False
    cause: Message = Message.ERR_COMMAND_TIMEOUT


class RadioNode(EqualNode):
    """
    Carry out tasks on the line of ``machine``, and serve commands that come.

    ``serve`` executes a command and returns its reply, if it gives one; it is called once for each
    command.
    ``report`` is called with every numbered error and notice.
    """

    def __init__(self, machine: Machine, settings: LinkSettings, stations: ActiveStationList,
                 serve: Callable[[Packet], Packet | None],
                 report: Callable[[Event], None] = lambda event: None) -> None:
        super().__init__(machine, stations, serve, report, settings.station)
        self._settings = settings
        self._most_under_way = RADIO.most_under_way(settings)
        # Seconds within which a node of these settings repeats a command.
        self._repetition_time = (settings.nak_retries + 1) * (
            settings.cmd_timeout + 2 * LONGEST_WAIT)
        self._random = Random(settings.seed)
        self._same_number: float | None = None
        self._forget()

    @property
    def _numbers(self) -> set[int | None]:
        return {self._settings.station, *self._settings.also}

    def status(self) -> LinkState:
        """Return when another node with our number was heard."""
        return LinkState(same_number=self._same_number)

    def _forget(self) -> None:
        # Link data to be sent, and until when (clock value in s).
        self._waiting: deque[tuple[bytes, float]] = deque()
        self._heard: deque[tuple[bytes, float]] = deque(maxlen=_MOST_HEARD)  # and when heard
        self._executed: deque[_Executed] = deque(maxlen=_MOST_EXECUTED)
        self._under_way: dict[int, _SentCommand] = {}  # by station
        self._sent: deque[bytes] = deque(maxlen=_MOST_SENT)
        self._begun = self._machine.now

    def run(self, source: TaskSource) -> Procedure:
        """Carry out the tasks of ``source`` and serve other nodes, for ever."""
        self._forget()
        try:
            yield from self._work(source)
        except PortLost:
            machine = self._machine
            self._counters.unsent_messages += not machine.sender.has_left(machine.sender.position)
            raise

    def _work(self, source: TaskSource) -> Procedure:
        while True:
            # Packets, repetitions and new commands take turns, so that none of them waits for
            # ever.
            if self._waiting:
                data, until = self._waiting.popleft()
                yield from self._send(data, until=until)
            if (command := self._overdue()) is not None:
                yield from self._try(command)
            task = self._has_room and source.next_task(self._machine.now, self._under_way)
            if task:
                yield from self._begin(task)
            elif not self._waiting:
                self._hear((yield self._rest(source)))

    @property
    def _has_room(self) -> bool:
        return len(self._under_way) < self._most_under_way

    def _overdue(self) -> _SentCommand | None:
        """Return the command whose reply has been overdue longest, None if no reply is overdue."""
        first = min(self._under_way.values(), key=lambda command: command.deadline, default=None)
        return first if first and first.deadline <= self._machine.now else None

    def _rest(self, source: TaskSource) -> Step:
        """Return the step that waits until a command is overdue or a task is due."""
        if not self._under_way:
            return Rest(min(max(source.next_due() - self._machine.now, 0.0), LONGEST_REST))
        first = min(command.deadline for command in self._under_way.values())
        left = max(first - self._machine.now, 0.0)
        return Listen(min(left, _TICK) if self._has_room else left)

    def _begin(self, task: Task) -> Procedure:
        """Send a command the first time; a broadcast is complete then."""
        number = task.command.dst
        self._accounting.sent(task.command)
        # A station that did not answer last time, or may be absent, gets one try without retries.
        station = self._stations[number]
        keeps_others_waiting = self._most_under_way == 1
        is_once = not station.active or (
            keeps_others_waiting and not station.replies and self._stations.is_new(number))
        most = 1 if is_once else self._settings.nak_retries + 1
        self._under_way[number] = command = _SentCommand(task, most)
        yield from self._try(command)
        if number == BROADCAST and not self._is_over(command):
            del self._under_way[number]
            task.reply(task.command.reply())

    def _try(self, command: _SentCommand) -> Procedure:
        """Send a command, or repeat it; end it after the last try, or when it is too old."""
        task, number = command.task, command.task.command.dst
        if command.tries == command.most:
            del self._under_way[number]
            self._accounting.late(task, keeps_others_waiting=True)
            if self._stations[number].active:  # not after the one try of a probe
                self._accounting.given_up(self._settings.nak_retries, number)
            if task.blames:
                self._accounting.lost(number, self._machine.now, command.cause)
            task.fail(StationInactive(number, cause=command.cause))
            return
        try:
            yield from self._send(task.command.encode(), command)
        except CommandExpired as error:
            task.sent = error.sent
            del self._under_way[number]
            task.fail(error)
            return
        command.tries += 1
        command.deadline = self._machine.sender.free_at + self._settings.cmd_timeout

    def _send(self, data: bytes, command: _SentCommand | None = None,
              until: float = math.inf) -> Procedure:
        """Send link data when the line is quiet, unless it is too late for them by then."""
        frame = frames.message_frame(data, self._settings.checksum)
        yield from self._wait_for_quiet(len(frame), command)
        expires = math.inf
        if self._machine.now > until:
            return
        if command is not None:
            if self._is_over(command):
                return
            if command.tries:
                self._accounting.repeated(command.tries, Message.ERR_COMMAND_TIMEOUT,
                                          command.task.command.dst)
            command.task.sent, expires = True, command.task.expires
        self._counters.messages_sent += 1
        self._sent.append(data)
        try:
            symbol = yield Send(frame, MOMENT, expires=expires)
        except CommandExpired as error:
            self._accounting.taken_back(error, was_sent=command is not None and command.tries > 0)
            raise
        self._hear(symbol)
        # We send nothing more before this frame has left.
        while (left := self._machine.sender.free_at - self._machine.now) > 0:
            self._hear((yield Listen(left)))

    def _wait_for_quiet(self, size: int, command: _SentCommand | None) -> Procedure:
        """Wait until a frame of ``size`` characters may be sent, or its command has ended."""
        machine = self._machine
        if self._settings.avoids_collisions:
            return
        quiet = MIN_RESPONSE_TIME + QUIET_CHARACTERS * machine.timing.char_time
        most = min(1 << command.tries if command else 1, _MOST_BACK_OFF) * (
            MIN_RESPONSE_TIME + machine.timing.tx_delay + size * machine.timing.char_time)
        give_up = machine.now + LONGEST_WAIT
        pause = quiet + self._random.uniform(0.0, most)
        begun = machine.now
        while (left := min(begun + pause, give_up) - machine.now) > 0 \
                and not (command and self._is_over(command)):
            symbol = yield Listen(left)
            if isinstance(symbol, Silence):
                begun = max(begun, machine.now - symbol.seconds)
            else:
                self._hear(symbol)
                begun, pause = machine.now, quiet + self._random.uniform(0.0, most)

    def _is_over(self, command: _SentCommand) -> bool:
        return self._under_way.get(command.task.command.dst) is not command

    def _note_heard(self, data: bytes) -> bool:
        """Keep link data; return True if they were among the last link data heard."""
        now = self._machine.now
        is_known = any(seen == data and now - when < _RECENT for seen, when in self._heard)
        if not is_known:
            self._heard.append((data, now))
        return is_known

    def _hear(self, symbol: Heard) -> None:
        """Take a packet; a symbol of another mode is noise."""
        if not isinstance(symbol, Frame):
            count_control(symbol, self._counters)
            return
        if symbol.fault is not None:
            event = count_fault(symbol, self._settings.checksum, self._counters)
            self._accounting.report(event)
            for command in self._under_way.values():
                command.cause = event.message
            return
        packet = Packet.decode(symbol.data)
        if packet.src in self._numbers:
            self._hear_our_number(packet, symbol.data)
            return
        is_ours = packet.dst in self._numbers
        is_known = self._note_heard(symbol.data)
        between = {packet.src, packet.dst}
        is_new = not is_known and not self._machine.may_be_old
        if is_new and not is_ours and between <= {*self._settings.store_forward}:
            # Later, its sender has repeated it or has sent newer ones.
            self._put(symbol.data, self._machine.now + self._settings.cmd_timeout)
        if not is_ours and packet.dst != BROADCAST:
            return
        self._counters.messages_received += 1
        if not packet.is_sound:
            self._accounting.wrong(packet, packet.src)
        elif packet.is_reply:
            self._take_reply(packet, is_repetition=is_known)
        else:
            self._take_command(packet)

    def _hear_our_number(self, packet: Packet, data: bytes) -> None:
        """Take a packet with our SRC: our own, forwarded, or from a node that has our number."""
        if data in self._sent or self._machine.now < self._begun + _RECENT:
            return  # just after a start it may be a packet of the last run
        self._same_number = self._machine.now
        self._accounting.wrong(packet, packet.dst)
        command = self._under_way.get(packet.dst)
        if command is not None and command.task.command.duplicate_key == packet.duplicate_key:
            command.is_doubtful = True

    def _take_command(self, command: Packet) -> None:
        """Execute a command once; when it is repeated, send its reply again."""
        now, executed = self._machine.now, self._executed
        while executed and now - executed[0].when >= self._repetition_time:
            executed.popleft()
        known = self._repeated(command, now)
        if known is not None:
            self._counters.duplicate_messages += 1
            if not self._may_be_forwarded(known, now):
                known.answered = now
                self._answer(known.reply)
        elif self._machine.may_be_old:
            return  # a sender that still waits repeats it
        elif self._is_full:
            self._counters.refused_for_memory += 1  # not executed: its sender repeats it
        else:
            self._counters.commands_received += 1
            reply = self._serve(command)
            executed.append(_Executed(
                command, now, now, None if command.dst == BROADCAST else reply))
            self._answer(executed[-1].reply)

    def _repeated(self, command: Packet, now: float) -> _Executed | None:
        """
        Return the command that ``command`` repeats, None if it is a new one.

        A sender repeats only its last command with a TNS, so one that uses one TNS for all its
        commands gets each command executed that differs from the one before it. A forwarded packet
        may come after the next command.
        """
        last: _Executed | None = None
        for known in reversed(self._executed):
            if (known.command.src, known.command.tns) == (command.src, command.tns):
                last = last or known
                if known.command == command and (
                        known is last or self._may_be_forwarded(known, now)):
                    return known
        return None

    def _may_be_forwarded(self, known: _Executed, now: float) -> bool:
        """Tell whether a copy of a command comes too soon for a repetition by its sender."""
        return now - known.answered <= self._settings.cmd_timeout / 2

    def _answer(self, reply: Packet | None) -> None:
        if reply is not None:
            self._accounting.sent(reply)
            self._put(reply.encode())

    @property
    def _is_full(self) -> bool:
        return len(self._waiting) >= _MOST_WAITING

    def _put(self, data: bytes, until: float = math.inf) -> None:
        """Add link data to the queue for the line, to be sent ``until`` then, if there is room."""
        if self._is_full:
            self._counters.refused_for_memory += 1
        else:
            self._waiting.append((data, until))

    def _take_reply(self, packet: Packet, *, is_repetition: bool) -> None:
        """Give a reply to the command that waits for it."""
        command = self._under_way.get(packet.src)
        is_ours = command is not None and command.task.sent and not command.is_doubtful
        if command is None or not is_ours or not packet.answers(command.task.command):
            if is_repetition:
                self._counters.duplicate_messages += 1
            else:
                self._accounting.received(packet)
                self._accounting.unexpected(packet, self._machine.now)
            return
        del self._under_way[packet.src]
        self._accounting.received(packet)
        if not is_local_status(packet.sts):
            self._stations.heard(packet.src, self._machine.now)
        self._accounting.complete(command.task, packet, keeps_others_waiting=True)


class RadioMode(LineMode):
    """A node of a network of radio modems."""

    name = 'Radio'
    link = RadioNode
    other_words = {'df1radiomodem': 'Radio', 'radiomodem': 'Radio'}
    duplex = Duplex.RADIO
    answers = 1
    why_unshared = 'in Mode Radio it has not been tried'

    def pause(self, line: LinkSettings) -> float:
        """Return how long a first try usually waits for a quiet line."""
        if line.avoids_collisions:
            return 0.0
        timing = line.timing
        most = MIN_RESPONSE_TIME + timing.tx_delay + _SHORT_FRAME * timing.char_time
        return MIN_RESPONSE_TIME + QUIET_CHARACTERS * timing.char_time + most / 2

    def most_under_way(self, line: LinkSettings) -> int:
        return MOST_UNDER_WAY if line.avoids_collisions else 1

    def longest_transaction(self, line: LinkSettings, frames: float = 0.0, others: float = 0.0,
                            stations: int = 0) -> float:
        """Return the longest time of a transaction, computed with the longest possible frames."""
        char_time = line.timing.char_time
        frame = _LONG_FRAME * char_time
        # An incoming message is heard to its end, also if it breaks off.
        heard = frame + QUIET_CHARACTERS * char_time + HELD_BACK
        wait = 0.0 if line.avoids_collisions else LONGEST_WAIT
        send = wait + line.timing.tx_delay + frame + heard
        # Forwarded packets, repetitions and (if there is room) new commands take turns.
        turns = 3 * MOST_UNDER_WAY if line.avoids_collisions else 2
        return (line.nak_retries + 1) * (turns * send + line.cmd_timeout + heard)

    def undisturbed(self, line: LinkSettings, frames: float, response_time: float,
                    others: float = 0.0, stations: int = 0) -> float:
        """Return the time of the base class, plus the longest random pause before a first try."""
        chance = 0.0 if line.avoids_collisions else MIN_RESPONSE_TIME + frames
        return super().undisturbed(line, frames, response_time) + chance

    def longest_reply(self, line: LinkSettings, frames: float) -> float:
        """Return 0: packets that wait for their turn are part of a transaction."""
        return 0.0

    def last_tries(self, line: LinkSettings, frames: Sequence[float],
                   answer_within: float) -> float:
        """Return the time with Cmd_Timeout for each command: a reply may come that late."""
        return (1 + len(frames)) * self.longest_probe(line) + sum(frames)

    def longest_probe(self, line: LinkSettings) -> float:
        """Return the time of one command without a reply."""
        return line.cmd_timeout + self.pause(line)


RADIO = RadioMode()
