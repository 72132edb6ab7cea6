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
The master with standard polling: every station is polled all the time, commands in between.

Theory of operation (1766-RM001, "Standard polling"; the scan of two lists as in the manuals of
the PLC-5 and Logix masters). One scan is::

    every active station of the priority list
    one inactive station of the priority list
    the next ``group_size`` active stations of the normal list (0: all of them)
    one inactive station of the normal list, when all its active ones have had their turn

A command is sent before the next station is polled ("between stations"), or when the master's own
address is next in the list ("in sequence"). It completes when its station is polled and has the
reply ready. So several stations work on their replies at the same time, and commands complete in
the order of the poll list.

A station that does not answer is polled again up to ENQ_Retries, then becomes inactive; any answer
makes it active. A dead station costs a whole Timeout, and active stations must not wait for it. So
inactive stations are polled once a scan at most, and for at most an eighth of the line's time.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Container, Generator, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
import math

from abdf1_ros.df1.frames import Control, Frame
from abdf1_ros.df1.link import Link, LinkState, quiet_time, ScanTimes
from abdf1_ros.df1.machine import Heard, Machine, Procedure, Rest, Step
from abdf1_ros.df1.master import MasterMode
from abdf1_ros.df1.master_line import is_good, MasterLine, MOST_QUEUED
from abdf1_ros.df1.mode import answer_time, Report, Serve
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.df1.settings import LinkSettings, PollingSettings
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import Outstanding, Task, TaskSource
from abdf1_ros.errors import CommandExpired, CommandTimeout, LinkError, StationInactive
from abdf1_ros.messages import Event

# Most commands between two polls: the manual says "at least four" (1766-RM001).
COMMANDS_BETWEEN_POLLS = 4

# A poll and the EOT that answers it.
_POLL_CHARACTERS = 6

# If several stations behind a gateway have not replied in time, the gateway gets one command at a
# time for this long (s). Maybe it can execute only one command at a time. If it always had more
# commands than it can execute in Cmd_Timeout, every reply would be late.
_SLOW_TIME = 30.0

# Pause between scans in which no station could be polled (s).
_PAUSE = 0.05


@dataclass(slots=True)
class _PollList:
    """One poll list, and the place of the master in it."""

    stations: tuple[int, ...]
    times: ScanTimes = field(default_factory=ScanTimes)
    started: float | None = None
    position: int = 0
    next_inactive: int = 0
    is_kept_waiting: bool = False

    def turn(self, now: float) -> None:
        """Begin the next scan, and record the time of the last scan."""
        if self.started is not None:
            self.times.add(now - self.started)
        self.started = now

    def inactive(self, is_active: Callable[[int], bool]) -> int | None:
        """Return the inactive station whose turn it is, or None when all are active."""
        for step in range(len(self.stations)):
            at = (self.next_inactive + step) % len(self.stations)
            if not is_active(self.stations[at]):
                self.next_inactive = at
                return self.stations[at]
        return None


class StandardPollingMaster:
    """
    Poll all stations and carry out tasks on the line of ``machine``.

    ``report`` and ``serve`` are described at ``MasterLine``.
    """

    def __init__(self, machine: Machine, settings: LinkSettings,
                 stations: ActiveStationList,
                 serve: Callable[[Packet], Packet] | None = None,
                 report: Callable[[Event], None] = lambda event: None) -> None:
        self._machine = machine
        self._settings = settings
        self._polling = polling = settings.polling or PollingSettings(())
        self._stations = stations
        self._line = MasterLine(machine, settings, stations, serve, report, self._take_reply)
        self._priority = _PollList(polling.priority)
        self._normal = _PollList(polling.normal)
        self._outstanding: dict[int, Outstanding] = {}
        self._listed = frozenset((*polling.priority, *polling.normal))
        self._polled = self._listed - {settings.station}
        stations.add(self._polled, are_polled=True)
        # Stations that got a command of another station and have not replied, with the time (clock
        # value, s) until which they may reply. Until then the master passes no second command on
        # to them. Otherwise several senders would soon fill the message sink of the station,
        # because a poll fetches only one message. Our own commands would then find no room.
        self._given: dict[int, float] = {}
        # Stations that have answered a probe, but no command since. Their time on the line counts
        # as time of probes. Otherwise a station that accepts no commands would be probed again at
        # once.
        self._unproven: set[int] = set()
        self._last_probed: _PollList | None = None
        self._slow_until: defaultdict[int, float] = defaultdict(lambda: -math.inf)  # of gateways

    def status(self) -> LinkState:
        """Return the scan times of the lists that have stations."""
        lists = {'normal': self._normal, 'priority': self._priority}
        return LinkState(
            scans={name: each.times for name, each in lists.items() if each.stations})

    def run(self, source: TaskSource) -> Procedure:
        """Poll for ever, and carry out the tasks of ``source`` meanwhile."""
        self._line.begin()
        self._outstanding.clear()
        self._given.clear()
        self._unproven.clear()
        self._priority.started = self._normal.started = None  # no scan lasts across a stop
        begun = self._machine.now
        while True:
            yield from self._scan(source)
            if self._normal.position:
                continue  # a group may hold only silent stations, or ourselves
            if self._machine.now == begun:  # no station can be polled now
                yield from self._between_polls(source)
                yield Rest(_PAUSE)
            begun = self._machine.now

    def _is_active(self, number: int) -> bool:
        """Tell whether an entry of a list has its turn: our own number, or an active station."""
        return number == self._settings.station or self._stations[number].active

    def _scan(self, source: TaskSource) -> Procedure:
        self._priority.turn(self._machine.now)
        for number in self._priority.stations:
            if self._is_active(number):
                yield from self._visit(number, source)
        yield from self._visit_inactive(self._priority, source)
        yield from self._visit_group(source)
        if self._polling.in_sequence and self._settings.station not in self._listed:
            yield from self._send_commands(source)

    def _visit_group(self, source: TaskSource) -> Procedure:
        """Poll the next group of the normal list; at its end, one inactive station."""
        normal = self._normal
        if normal.position == 0:
            normal.turn(self._machine.now)
        group_size = self._polling.group_size or len(normal.stations)
        visited = 0
        while normal.position < len(normal.stations) and visited < group_size:
            number = normal.stations[normal.position]
            normal.position += 1
            if self._is_active(number):
                visited += 1
                yield from self._visit(number, source)
        if normal.position >= len(normal.stations):
            normal.position = 0
            yield from self._visit_inactive(normal, source)

    def _visit_inactive(self, polled: _PollList, source: TaskSource) -> Procedure:
        """Poll one inactive station of a list, if the share of probes allows."""
        number = polled.inactive(self._is_active)
        is_too_early = self._machine.now < self._stations.probes.next
        polled.is_kept_waiting = number is not None and is_too_early
        other = self._normal if polled is self._priority else self._priority
        is_others_turn = other.is_kept_waiting and polled is self._last_probed
        if number is None or polled.is_kept_waiting or is_others_turn:
            return
        polled.next_inactive += 1
        self._last_probed = polled
        yield from self._between_polls(source)
        begun = self._machine.now
        answer = yield from self._line.poll_inactive(number)
        if is_good(answer):
            yield from self._answered(number, answer)
            self._unproven.add(number)
        self._stations.polled_silent(begun, self._machine.now)

    def _visit(self, number: int, source: TaskSource) -> Procedure:
        """Send waiting commands, then poll an active station; do not poll our own number."""
        if number == self._settings.station:
            yield from self._send_commands(source)
            return
        yield from self._between_polls(source)
        begun = self._machine.now
        for answers in range(1, MOST_QUEUED + 1):
            if not self._stations[number].active:
                return
            try:
                answer = yield from self._line.poll_with_retries(
                    number, 0.0, self._reply_size(number))
            except StationInactive as error:
                # If a reply cannot be fetched, commands that do not blame the station are given
                # up first. The next poll shows whether the station answers. A damaged reply is
                # polled for until the station gives it up, or the command is overdue.
                vain = [(station, entry) for station, entry in self._waiting_for(number)
                        if not entry.task.blames]
                for station, entry in vain:
                    if number not in self._line.faults or self._machine.now >= entry.deadline:
                        self._end(station, error)
                if not vain:
                    self._lost(number, begun, error)
                return
            yield from self._answered(number, answer)
            is_more_wanted = isinstance(answer, Frame) and self._polling.multiple \
                and not self._line.is_full and answers < MOST_QUEUED
            if not is_more_wanted:
                yield from self._pace(begun)
                return

    def _waiting_for(self, number: int) -> list[tuple[int, Outstanding]]:
        """Return the commands whose replies a station of the line has for us."""
        return [(station, self._outstanding[station]) for station in self._stations.behind(number)
                if station in self._outstanding]

    def _reply_size(self, number: int) -> int:
        """Return the size of the reply that comes next, 0 if unknown."""
        sizes = [entry.task.reply_size for _, entry in self._waiting_for(number)]
        return sizes[0] if len(sizes) == 1 else 0

    def _pace(self, begun: float) -> Procedure:
        """Poll a line without a real speed, such as TCP, not faster than its Baud setting."""
        rest = begun + _POLL_CHARACTERS * self._machine.timing.char_time - self._machine.now
        if rest > 0:
            yield Rest(rest)

    def _answered(self, number: int, answer: Control | Frame) -> Procedure:
        """Take the answer of a station to a poll."""
        packet = None
        if isinstance(answer, Frame):
            packet = yield from self._line.receive(number, answer)
        if packet is not None and packet.is_reply and packet.dst != self._settings.station:
            self._given.pop(packet.src, None)
        if packet is not None and self._take_reply(number, packet):
            return
        if packet is not None:
            self._line.take_unwanted(packet)
        is_given_up = answer is Control.EOT and number in self._line.faults
        for station, entry in self._waiting_for(number):
            if self._is_over(entry, isinstance(answer, Frame)) \
                    or is_given_up and not entry.task.blames:
                self._overdue(station)

    def _take_reply(self, number: int, packet: Packet) -> bool:
        """Complete the command to which a message is the reply; return False if there is none."""
        entry = self._outstanding.get(packet.src)
        if entry is None or not self._line.answers(packet, entry.task.command):
            return False
        del self._outstanding[packet.src]
        self._line.complete(entry.task, packet, keeps_others_waiting=False)
        return True

    def _is_over(self, entry: Outstanding, is_message: bool) -> bool:
        """Tell whether a command is overdue; if a message came, its reply may be the next one."""
        entry.passed_over += is_message
        return self._machine.now >= entry.deadline and not (
            is_message and entry.passed_over <= MOST_QUEUED)

    def _overdue(self, number: int) -> None:
        """End the command whose reply has not come in time."""
        via, now = self._stations.via(number), self._machine.now
        # Usually all other stations are polled meanwhile. They only wait behind a slow gateway.
        self._line.accounting.overdue(self._outstanding.pop(number).task,
                                      keeps_others_waiting=now < self._slow_until[via],
                                      cause=self._line.faults.get(via))
        behind = self._stations.behind(via)
        if sum(self._stations[other].unanswered > 0 for other in behind) > 1:
            self._slow_until[via] = now + _SLOW_TIME

    def _busy(self) -> Container[int]:
        """Return the stations that get no command now: they, or their slow gateways, have one."""
        gateways = {self._stations.via(number) for number in self._outstanding}
        slow = [self._stations.behind(number) for number in gateways
                if self._machine.now < self._slow_until[number]]
        return {*self._outstanding, *chain(*slow)} if slow else self._outstanding

    def _end(self, number: int, error: LinkError) -> None:
        """End the command that waits for a reply of a station, if there is one."""
        entry = self._outstanding.pop(number, None)
        if entry is not None:
            entry.task.fail(error)

    def _between_polls(self, source: TaskSource) -> Procedure:
        if not self._polling.in_sequence:
            yield from self._send_commands(source)

    def _send_commands(self, source: TaskSource) -> Procedure:
        """Pass messages on, and send commands to stations without a reply outstanding."""
        self._given = {number: until for number, until in self._given.items()
                       if self._is_active(number) and self._machine.now < until}
        while self._line.has_forwards(self._given):
            packet = yield from self._line.forward(self._given)
            if packet is not None and not packet.is_reply \
                    and self._stations.via(packet.dst) in self._listed:
                self._given[packet.dst] = self._machine.now + self._settings.cmd_timeout
        for number, entry in list(self._outstanding.items()):
            if not self._stations[number].active and not entry.is_probe:
                # It did not accept a message that was passed on.
                self._end(number, StationInactive(number))
            elif self._machine.now >= entry.deadline \
                    and self._stations.via(number) not in self._polled:
                self._overdue(number)
        for _ in range(COMMANDS_BETWEEN_POLLS):
            task = source.next_task(self._machine.now, self._busy())
            if task is None or not (yield from self._send(task)):
                return

    def _send(self, task: Task) -> Generator[Step, Heard, bool]:
        """
        Send a command; return False if the next command has to wait for polls.

        A command that no station accepts uses up the time of the polls, unless its wait was short.
        """
        station = task.command.dst
        number = self._stations.via(station)
        if number == BROADCAST:
            task.sent = True
            try:
                yield from self._line.deliver(number, task.command, task.expires)
            except CommandExpired as error:
                task.sent = error.sent
                task.fail(error)
            else:
                task.reply(task.command.reply())
            return True
        was_silent = not self._stations[number].active
        if was_silent and not task.is_own:
            task.fail(StationInactive(number))  # it is polled when its turn comes
            return True
        task.sent = True
        entry = self._outstanding[station] = Outstanding(
            task, is_probe=not self._stations[station].active)
        now = self._machine.now
        try:
            begun = yield from self._line.deliver(
                number, task.command, task.expires, answer_within=task.answer_within)
        except StationInactive as error:
            if task.blames:
                self._lost(error.number, now, error)
            else:
                self._end(station, error)
        except CommandTimeout:
            self._overdue(station)
        except CommandExpired as error:
            task.sent = error.sent
            self._end(station, error)
        else:
            (self._unproven.add if was_silent else self._unproven.discard)(number)
            entry.deadline = begun + self._settings.cmd_timeout
            return True
        return task.answer_within < math.inf  # a last try, which is short

    def _lost(self, number: int, begun: float, error: StationInactive) -> None:
        """Record that a station does not answer any more; it has had the line since ``begun``."""
        self._line.accounting.lost(number, self._machine.now, error.cause)
        for station in self._stations.behind(number):
            self._end(station, error)
        if number in self._unproven:
            self._unproven.remove(number)
            self._stations.polled_silent(begun, self._machine.now)


class StandardPollingMode(MasterMode):
    """Master of a half-duplex line that polls all stations in turns."""

    polling = 'Standard'
    takes_turns = True

    def make_link(self, machine: Machine, line: LinkSettings, stations: ActiveStationList,
                  serve: Serve, report: Report) -> Link:
        """Return the link; it polls every mapped station, because slaves reply only to polls."""
        polling = line.polling or PollingSettings(())
        listed = {*polling.priority, *polling.normal}
        mapped = dict.fromkeys(stations.via(station.number) for station in stations)
        polling = replace(polling, normal=(
            *polling.normal, *(number for number in mapped if number not in listed)))
        return StandardPollingMaster(
            machine, replace(line, polling=polling), stations, serve, report)

    def idle_poll(self, line: LinkSettings) -> float:
        """Return the time of a poll and of the EOT that answers it at once."""
        return _POLL_CHARACTERS * line.timing.char_time + line.timing.tx_delay

    def longest_transaction(self, line: LinkSettings, frames: float, others: float = 0.0,
                            stations: int = 0) -> float:
        """Return the time of message-based polling, plus the time of all other stations."""
        poll = (line.enq_retries + 1) * (
            answer_time(line) + others + quiet_time(line.timing.char_time))
        # The command is sent within one scan. The last poll for its reply is within one scan after
        # Cmd_Timeout.
        return super().longest_transaction(line, frames) + 2 * stations * (
            poll + self.longest_reply(line, others))

    def last_tries(self, line: LinkSettings, frames: Sequence[float],
                   answer_within: float) -> float:
        """Return the time of message-based polling, plus the polls between the commands."""
        in_a_row = 1 if line.polling and line.polling.in_sequence else COMMANDS_BETWEEN_POLLS
        return super().last_tries(line, frames, answer_within) \
            + -(-len(frames) // in_a_row) * self.longest_probe(line)

    def undisturbed(self, line: LinkSettings, frames: float, response_time: float,
                    others: float = 0.0, stations: int = 0) -> float:
        """Return the time of message-based polling, plus a scan that serves every station."""
        poll = self.idle_poll(line) + response_time
        other = super().undisturbed(line, others, response_time)
        return super().undisturbed(line, frames, response_time) + stations * (poll + other)


STANDARD = StandardPollingMode()
