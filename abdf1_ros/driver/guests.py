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
Commands of guests: programs that share the PLC's port with us, each at a place of its own.

A guest's command waits here for its turn on the line and gets exactly one reply, in time. This is
the reply of the PLC, or our reply with an STS of M 8-2.

- Not sent: 60 (not allowed), F0 with EXT STS 12 (a value outside of a limit), 01 (no buffer, too
  old to be sent, or a pause of ``unanswered``), 04 (the port is not open), 07 (the station is
  silent).
- Sent, without a reply: 02 (the station has become silent), 05 (no reply in time). Whether it was
  executed is then unknown.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Container
from dataclasses import dataclass, field
import math

from abdf1_ros.df1.packet import BROADCAST, is_local_status, Packet
from abdf1_ros.df1.probes import Asker
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import LineTime
from abdf1_ros.driver.guest_rules import GuestRules, ShareAccess
from abdf1_ros.driver.inbox import Inbox
from abdf1_ros.driver.job_tasks import Job
from abdf1_ros.driver.kernel.flights import Flight
from abdf1_ros.driver.unanswered import UnansweredCommands
from abdf1_ros.driver.write import outcome_of
from abdf1_ros.driver.writes.jobs import WritesUnderWay
from abdf1_ros.errors import (
    CommandExpired,
    CommandTimeout,
    LinkError,
    PortLost,
    RemoteError,
    StationInactive,
)
from abdf1_ros.pccc.describe import effect_of
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.notation import Effect
from abdf1_ros.pccc.status import EXT_BAD_PARAMETER, EXTENDED

_MOST_WAITING = 16  # commands of a guest; AbDf1 sends this many before it waits for a reply

_NO_BUFFER, _NOT_ACKNOWLEDGED, _NOT_CONNECTED, _NO_REPLY, _OFF_LINE = 0x01, 0x02, 0x04, 0x05, 0x07
_NOT_ALLOWED = 0x60
_BAD_VALUE = bytes((EXT_BAD_PARAMETER,))


class GuestListener:
    """A listener to guests, in any thread; methods that are not overridden do nothing."""

    def sends(self, guest: Guest, command: Packet) -> None:
        """Take a command that is sent now, with our SRC and TNS."""

    def wrote(self, guest: Guest, command: Packet, flight: Flight) -> None:
        """Take a command that may have changed words of a PLC, and which words."""

    def goes_beyond(self, guest: Guest, command: Packet) -> None:
        """Take a command that only All allows, of a guest that has All."""

    def was_refused(self, guest: Guest, command: Packet, needed: ShareAccess) -> None:
        """Take a command that was not allowed, and the right that it needs."""

    def broke_limit(self, guest: Guest, command: Packet, limit: str) -> None:
        """Take a command whose values were refused, and the limit that they broke."""

    def was_unanswered(self, guest: Guest, command: Packet, sts: int) -> None:
        """Take a command that got an STS of ours in place of a reply of the PLC."""

    def turned_away(self, guest: Guest, other: str, why: str) -> None:
        """Take the address of a program that a place did not take, and why."""


@dataclass(slots=True, eq=False)
class Guest:
    """
    A guest and what it has done; ``name`` is its place.

    - ``refused``: number of commands that were not allowed.
    - ``beyond``: number of commands, allowed or not, that only All allows.
    - ``outside``: number of commands whose values broke a limit.
    - ``unanswered``: number of commands without a reply of the PLC.
    - ``collisions``: number of writes to words that we write too.
    - ``slowest``: longest time (s) to a reply.
    - ``is_connected``: a program has the place.
    """

    name: str
    access: ShareAccess = ShareAccess.READ
    listener: GuestListener = field(default_factory=GuestListener)
    is_connected: bool = False
    commands: int = 0
    refused: int = 0
    beyond: int = 0
    outside: int = 0
    unanswered: int = 0
    slowest: float = 0.0
    collisions: int = 0
    waiting: deque[GuestCommand] = field(default_factory=deque)


@dataclass(frozen=True, slots=True, eq=False)
class GuestCommand:
    """
    A command of a guest, when it came (clock value in s), and the receiver of the reply.

    - ``patience``: longest time (s) that the guest itself waits.
    - ``is_wanted``: tells, in the link's thread, whether the guest that asked is still there.
    """

    guest: Guest
    packet: Packet
    requested: float
    answer: Callable[[Packet], None]
    patience: float = math.inf
    is_wanted: Callable[[], bool] = lambda: True


class GuestJob(Job):
    """A guest's command on the line, with our SRC and TNS."""

    blames = False

    def __init__(self, queue: GuestQueue, asked: GuestCommand, station: int,
                 flight: Flight | None) -> None:
        self.asked = asked
        self.station = station
        self.expires = queue.expiry(asked)
        self.flight = flight
        self.sts = 0  # of the reply
        self.has_failed = False  # no reply came
        self._queue = queue
        self._begun = 0.0

    def steps(self, now: float) -> Steps[None]:
        """Send the command, and hand its reply on."""
        self._begun = now
        packet = self.asked.packet
        reply = yield packet.cmd, packet.data
        self.sts = reply.sts
        self._queue.answered(self, reply)

    def ended(self, error: Exception | None) -> None:
        self._queue.ended(self, self._begun, error)


class GuestQueue:
    """
    The commands of all guests, in turns.

    ``put`` may be called from any thread. A command that has waited ``patience`` s is not sent any
    more. ``rules`` say what is allowed. Each command that may change words is in ``writing``.
    ``fell_silent`` is called when a station that only guests ask has become silent.
    """

    def __init__(self, stations: ActiveStationList, line: LineTime, patience: float,
                 rules: GuestRules, writing: WritesUnderWay,
                 fell_silent: Callable[[], None] = lambda: None) -> None:
        self._stations = stations
        self.line = line
        self._patience = patience
        self._rules = rules
        self._writing = writing
        self._fell_silent = fell_silent
        self._unanswered = UnansweredCommands()
        self.inbox: Inbox[GuestCommand] = Inbox(is_open=False)  # commands not sorted yet
        self.waiting: deque[Guest] = deque()  # guests with commands, the next one first
        self.next_expiry = math.inf  # when ``expire`` has work (clock value in s)

    def put(self, command: GuestCommand) -> None:
        """Take a command, or refuse it at once; then wake the link."""
        guest = command.guest
        guest.commands += 1
        needed = self._rules.right_needed(command.packet)
        guest.beyond += needed is ShareAccess.ALL
        if not guest.access.includes(needed):
            guest.refused += 1
            guest.listener.was_refused(guest, command.packet, needed)
            _refuse(command, _NOT_ALLOWED)
            return
        if needed is ShareAccess.ALL:
            guest.listener.goes_beyond(guest, command.packet)
        if limit := self._rules.limit_broken(command.packet, guest.access):
            guest.outside += 1
            guest.listener.broke_limit(guest, command.packet, limit)
            command.answer(command.packet.reply(_BAD_VALUE, EXTENDED))
            return
        if not self.inbox.put(command):
            self._give_up(command, _NOT_CONNECTED)

    def refuse(self, command: GuestCommand) -> None:
        """Refuse a command that its place cannot keep, or has kept too long."""
        command.guest.commands += 1
        self._give_up(command, _NO_BUFFER)

    def begin(self) -> None:
        """Take commands: the port is open."""
        self.inbox.open()

    def end(self) -> None:
        """Refuse all commands, waiting and new ones: the port is lost."""
        for command in self.inbox.close():
            self._give_up(command, _NOT_CONNECTED)
        for guest in self.waiting:
            while guest.waiting:
                self._give_up(guest.waiting.popleft(), _NOT_CONNECTED)
        self.waiting.clear()
        self._look()

    def next(self, now: float, busy: Container[int], *,  # noqa: A003
             may_write: bool = True) -> GuestJob | None:
        """Return the next command of the guests, in turns; without ``may_write`` only reads."""
        self._sort()
        while (guest := self._first(busy)) is not None:
            command = guest.waiting.popleft()
            self.waiting.remove(guest)
            if guest.waiting:
                self.waiting.append(guest)
            self._look()
            station = self._rules.station_of(command.packet.dst)
            if not command.is_wanted() or not self._unanswered.may_be_sent(
                    station, command.packet, now):
                self._give_up(command, _NO_BUFFER)
                continue
            if self._stations[station].last_heard is None:
                self._silent(station, now)  # maybe no such station: one poll or try at a time
            # A broadcast has no reply.
            is_read = effect_of(command.packet) is Effect.READS
            is_vain = station == BROADCAST if is_read else not may_write
            if not is_vain and self._stations.claim_message(station, now):
                job = GuestJob(self, command, station, self._begin(command.packet, station))
                job.is_probe = not self._stations[station].replies_in_time
                return job
            self._give_up(command, _OFF_LINE)
        return None

    def _first(self, busy: Container[int]) -> Guest | None:
        """
        Return the first guest whose next command is not for a ``busy`` station.

        A broadcast waits while a word is rewritten: it may write this word.
        """
        for guest in self.waiting:
            station = self._rules.station_of(guest.waiting[0].packet.dst)
            if station not in busy and not (station == BROADCAST and self._writing.is_rewriting):
                return guest
        return None

    def _begin(self, packet: Packet, station: int) -> Flight | None:
        """Record a command that may change words."""
        if not effect_of(packet).may_change_words:
            return None
        return self._writing.begin_guest(station, self._rules.words_of(packet, station))

    def expiry(self, command: GuestCommand) -> float:
        """Return the clock value (s) from which a command is too old."""
        return command.requested + min(self._patience, command.patience)

    def expire(self, now: float) -> None:
        """Refuse the commands that have waited too long."""
        self._sort()
        for guest in list(self.waiting):
            while guest.waiting and now >= self.expiry(guest.waiting[0]):
                self._give_up(guest.waiting.popleft(), _NO_BUFFER)
            if not guest.waiting:
                self.waiting.remove(guest)
        self._look()

    def answered(self, job: GuestJob, reply: Packet) -> None:
        """Send a reply to the guest, with the addresses and TNS of its command."""
        command, guest = job.asked, job.asked.guest
        if job.station == BROADCAST:  # no station has confirmed it
            self._give_up(command, _NO_REPLY)
            return
        guest.slowest = max(guest.slowest, self.line.now - command.requested)
        command.answer(command.packet.reply(reply.data, reply.sts))

    def ended(self, job: GuestJob, begun: float, error: Exception | None) -> None:
        """Refuse a command that has no reply; report what it may have changed."""
        command, station = job.asked, job.station
        job.has_failed = error is not None
        was_sent = error is None or getattr(error, 'sent', True)
        self._note_answer(job, begun, error, was_sent)
        if error is not None:
            if was_sent or not isinstance(error, CommandExpired):  # else it was not even asked
                self._silent(station, self.line.now)
            self._give_up(command, _status_of(error, was_sent))
        if (flight := job.flight) is not None:
            fault = _fault_of(job.sts, error)
            self._writing.landed(flight, outcome_of(station, fault), fault)
            if was_sent:
                command.guest.listener.wrote(command.guest, command.packet, flight)
        self._stations.tried(
            station, begun, self.line.now, asker=Asker.MESSAGE, was_silent=True)

    def _note_answer(self, job: GuestJob, begun: float, error: Exception | None,
                     was_sent: bool) -> None:
        """Record whether a command was answered: a silent station says nothing about it."""
        is_answered = error is None and not is_local_status(job.sts)
        if is_answered or was_sent and not job.is_probe and not isinstance(error, PortLost):
            now = self.line.now
            self._unanswered.tried(job.station, job.asked.packet, self.line.took(begun, now), now,
                                   is_answered=is_answered)

    def _silent(self, station: int, now: float) -> None:
        """Treat a station that only guests ask as silent: no other command shows its silence."""
        if station not in self._stations and station != BROADCAST:
            record = self._stations[station]
            was_heard = record.active and record.last_heard is not None
            self._stations.lost(station, now)
            if was_heard:
                self._fell_silent()

    def _look(self) -> None:
        """Find out when the first command has waited too long."""
        self.next_expiry = min((self.expiry(guest.waiting[0]) for guest in self.waiting),
                               default=math.inf)

    def _sort(self) -> None:
        """Sort new commands into the queues of their guests."""
        if not self.inbox.items:
            return
        for command in self.inbox.take():
            guest = command.guest
            if len(guest.waiting) >= _MOST_WAITING:
                self._give_up(command, _NO_BUFFER)
                continue
            guest.waiting.append(command)
            if guest not in self.waiting:
                self.waiting.append(guest)

    @staticmethod
    def _give_up(command: GuestCommand, sts: int) -> None:
        guest = command.guest
        guest.unanswered += 1
        guest.listener.was_unanswered(guest, command.packet, sts)
        _refuse(command, sts)


def _refuse(command: GuestCommand, sts: int) -> None:
    command.answer(command.packet.reply(sts=sts))


def _fault_of(sts: int, error: Exception | None) -> LinkError | RemoteError | None:
    """Return why a command is not confirmed; after a bug it may have been executed."""
    if error is not None:
        return error if isinstance(error, LinkError) else CommandTimeout()
    return RemoteError(sts, None, '') if sts else None


def _status_of(error: Exception, was_sent: bool) -> int:
    if was_sent:
        return _NOT_ACKNOWLEDGED if isinstance(error, StationInactive) else _NO_REPLY
    if isinstance(error, PortLost):
        return _NOT_CONNECTED
    return _NO_BUFFER if isinstance(error, CommandExpired) else _OFF_LINE
