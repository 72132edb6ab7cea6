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
The one place that decides which job has the line next.

Heartbeats and fallbacks go first. A check or read has its turn after
``OWN_IN_A_ROW`` of them, and after each of them to a silent station. At the end no check or read
goes before all PLCs that answer have confirmed theirs. Then there are three queues:

- ``writes`` go first, but after ``MAX_WRITES_IN_A_ROW`` of their commands a check or read that is
  due has its turn. A word that is rewritten is read and written back without another turn between:
  what a guest wrote meanwhile would be undone.
- ``checks``, such as the question for a station's mode, go before the reads. After a check, all
  reads that were due when it began go before the next check. If rows depend on the modes of
  several stations, one read goes between two of these questions. Before a question is sent again,
  every due read goes first.
- ``reads`` go in the order of ``reads.queue``. Fallbacks that are written again take turns with
  the reads.

``guests`` share the time that heartbeats, fallbacks and writes leave. After a guest's command, due
checks and reads have the line ``OURS_BESIDE_GUESTS`` times as long as the command took, answered
or not. No second guest command is sent while one of our jobs is due.

A probe is a command that asks a silent station whether it answers again. ``df1.probes`` limits the
line time of probes.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass
import math
from operator import attrgetter

from abdf1_ros.df1.probes import Probes
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.checks import Checks
from abdf1_ros.driver.guests import GuestJob, GuestQueue
from abdf1_ros.driver.job_tasks import Job, JobTasks
from abdf1_ros.driver.kernel.gate import Rank
from abdf1_ros.driver.kernel.kernel import Kernel
from abdf1_ros.driver.reads.silent import Reads
from abdf1_ros.driver.write import key_of
from abdf1_ros.driver.writes.jobs import WriteJob, WritesUnderWay
from abdf1_ros.plan.bounds import OURS_BESIDE_GUESTS, OWN_IN_A_ROW

MAX_WRITES_IN_A_ROW = 4

_is_own = attrgetter('is_own')

# On an unheard connection this many questions are sent without a pause, then one in
# QUESTION_PERIOD seconds.
_QUICK_QUESTIONS = 10
QUESTION_PERIOD = 1.0


def _is_rewriting(job: Job) -> bool:
    return isinstance(job, WriteJob) and job.write.is_rewriting


def _checks_from(turns: Probes, is_reads_turn: bool, now: float) -> float:
    """Return from when on (clock value, s) a check may have one of the turns."""
    return now + turns.pause if is_reads_turn and now >= turns.next else turns.next


class _GuestShare:
    """
    The guests' share of the line beside our checks and reads.

    No command of a guest is sent before ``begins`` (clock value in s).
    """

    def __init__(self, stations: ActiveStationList, guests: GuestQueue, tasks: JobTasks) -> None:
        self.begins = -math.inf
        self.owed = 0.0  # seconds of the line for checks and reads, before the next guest
        self.counted: list[Job] = []  # jobs under way: of guests, and our own beside them
        self._stations = stations
        self._line = guests.line
        self._tasks = tasks

    @property
    def is_turn(self) -> bool:
        """Tell whether a guest goes before checks and reads that are due."""
        return self.owed <= 0 and not any(isinstance(job, GuestJob) for job in self.counted)

    def settle(self, now: float) -> None:
        """Count the time of ended commands, of guests and our own."""
        for job in [job for job in self.counted if job not in self._tasks.under_way]:
            self.counted.remove(job)
            took = self._line.took(job.taken, now)
            if isinstance(job, GuestJob):
                # Time that our commands used beyond their share is kept as credit for guests.
                # Guests' time on an idle line is not added up as debt.
                owed = min(self.owed, 0.0) + OURS_BESIDE_GUESTS * took
                self.owed = max(self.owed, owed)
                if job.has_failed and job.station in self._stations:
                    # The next command may fail, too, and hold up jobs that become due meanwhile.
                    self.begins = now + OURS_BESIDE_GUESTS * took
            else:
                self.owed -= took


@dataclass(slots=True)
class _OwnShare:
    """
    Heartbeats and fallbacks that went in a row, without a read between them.

    - ``last_read``: the station of the last read between own writes.
    - ``was_vain``: the station of the last own write is silent, or its row is odd.
    """

    in_a_row: int = 0
    last_read: int | None = None
    was_vain: bool = False


@dataclass(slots=True)
class _Questions:
    """
    The jobs that ask on a connection that has not been heard.

    ``next`` is when another one may be asked after the quick ones (clock value in s).
    """

    asked: int = 0
    next: float = -math.inf  # noqa: A003

    @property
    def are_slow(self) -> bool:
        """Tell whether the quick questions are over."""
        return self.asked >= _QUICK_QUESTIONS

    def ask(self, now: float) -> None:
        """Record a question."""
        self.asked, self.next = self.asked + 1, now + QUESTION_PERIOD


class Agenda:
    """
    Decide which job has the line next: one of a queue, or one under way.

    Jobs under way are in ``tasks``: each packet of a write has a turn of its own.
    """

    def __init__(self, stations: ActiveStationList, kernel: Kernel, writing: WritesUnderWay,
                 checks: Checks, reads: Reads, guests: GuestQueue, tasks: JobTasks) -> None:
        self._stations = stations
        self._kernel, self._writing = kernel, writing
        self._has_own = bool(kernel.rows.plc_of)
        self._messages = kernel.waiting.writes
        self._checks = checks
        self._reads = reads
        self._guests = guests
        self._share = _GuestShare(stations, guests, tasks)
        self._held_until = math.inf  # when a waiting guest may have the line (clock value in s)
        self._tasks = tasks
        self._own = _OwnShare()
        self._questions = _Questions()
        self._writes_in_a_row = 0
        self._has_begun_write = False
        self._last_check = -math.inf
        self._is_reads_turn = False  # after a check, or a fallback that was written again
        self._last_probe_was_check = self._last_odd_was_check = False

    def next(self, now: float, busy: Container[int] = ()) -> Job | None:  # noqa: A003
        """Return the next job for the line, None for none; stations in ``busy`` have to wait."""
        if self._share.counted:
            self._share.settle(now)
        if not self._tasks.is_heard:
            job = self._unheard(now, busy)
        else:
            self._questions.asked = 0
            job = self._own_first(now, busy) if self._has_own else self._usual(now, busy)
        if job is None or job in self._tasks.under_way:
            return job
        return job.start(self._tasks, now)

    def port_lost(self, now: float) -> None:
        """Count the time of the jobs that end with the port: ``next`` is called much later."""
        self._share.settle(now)

    def _unheard(self, now: float, busy: Container[int]) -> Job | None:
        """
        Return the next job on a connection that has not been heard.

        After the first questions only one a second is sent, because the port may store them. A 0
        or a fallback need not wait: it is a safe value even when it arrives late. A message to all
        stations need not wait either where no row names a single station.
        """
        if not any(self._stations) and (write := self._write(now, busy)):
            return write
        if self._questions.are_slow and now < self._questions.next:
            guests = self._guests
            self._held_until = self._questions.next \
                if guests.inbox.items or guests.waiting else math.inf
            return self._has_own and (
                self._tasks.continued(now, busy, _is_own)  # with all its packets
                or self._begin(Rank.OWN, now, busy)
                or self._begin(Rank.REFRESH, now, busy)) or None
        job = self._own_first(now, busy) if self._has_own else self._usual(now, busy)
        if job is not None:
            self._questions.ask(now)
        return job

    def _own_first(self, now: float, busy: Container[int]) -> Job | None:
        """Return the next job: own writes first, not counted as ``writes`` in a row (rule 11)."""
        if self._kernel.end.is_asked:  # no read has a turn now (rule 5)
            self._own.in_a_row, self._own.was_vain = 0, False
        if self._own.in_a_row >= OWN_IN_A_ROW and not self._kernel.turns.is_beats_turn(now):
            if busy and self._own.last_read is not None and self._own.last_read not in busy:
                # Stations take turns: with eight, the read might be for the same one each time.
                self._own.last_read = None
            elif job := self._check_or_read(now, busy):
                self._own.in_a_row, self._own.last_read = 0, job.station
                self._kernel.turns.beats_gave_way()
                return job
        # Remaining packets of a long fallback go first: heartbeats that are always due would keep
        # them waiting. Where the fallback stands, heartbeats count and must not wait for it.
        # A packet to a silent station takes a whole Timeout, and so does a packet of an odd row.
        # So a write to a station that answers goes between.
        own: Job | None = self._own.was_vain and self._begin(Rank.ACTIVE, now, busy) or None
        own = own or self._tasks.continued(now, busy, self._is_urgent)
        if own is None and self._own.was_vain:  # after all packets of such a try
            self._own.was_vain = False
            if job := self._check_or_read(now, busy):
                return job
        own = own or self._begin(Rank.OWN, now, busy)
        own = own or self._tasks.continued(now, busy, self._is_awaited)
        if own is None:
            return self._usual(now, busy)
        self._own.in_a_row += 1
        is_suspect = self._stations.odd.is_suspect(own.key, own.station)
        self._own.was_vain = not self._stations[own.station].active or is_suspect
        return own

    def _begin(self, rank: Rank, now: float, busy: Container[int]) -> WriteJob | None:
        """Return the next write of a rank."""
        turn = self._kernel.next(now, rank, busy)
        return WriteJob(turn, self._writing) if turn is not None else None

    def _is_urgent(self, job: Job) -> bool:
        return isinstance(job, WriteJob) and self._kernel.turns.is_urgent(job.flight)

    def _is_awaited(self, job: Job) -> bool:
        return isinstance(job, WriteJob) and self._kernel.turns.is_awaited(
            job.flight, self._tasks.line.now)

    def _check_or_read(self, now: float, busy: Container[int]) -> Job | None:
        return now >= self._checks.next_due and self._check(now, busy) or self.read(now, busy)

    def _usual(self, now: float, busy: Container[int]) -> Job | None:
        if self._tasks.waiting and (rewriting := self._tasks.continued(now, busy, _is_rewriting)):
            self._writes_in_a_row += 1
            return rewriting
        has_writes = self._messages or self._tasks.waiting
        if has_writes and self._writes_in_a_row < MAX_WRITES_IN_A_ROW \
                and not self._gives_way() and (write := self._write(now, busy)):
            return write
        guests = self._guests
        # At the end a guest could overwrite a fallback that is confirmed already.
        has_guests = (guests.inbox.items or guests.waiting) and not self._kernel.end.is_asked
        is_held = has_guests and now < self._share.begins
        self._held_until = self._share.begins if is_held else math.inf
        has_guests = has_guests and not is_held
        if has_guests and self._share.is_turn and (guest := self._guest(now, busy)):
            return guest
        if self._has_own and self._kernel.end.keeps_line:
            self._is_reads_turn = False
            return self._refresh(now, busy) or has_writes and self._write(now, busy) or None
        if self._stations.probes.died_at > -math.inf and (late := self._after_death(now, busy)):
            return late
        job = now >= self._checks.next_due and self._check(now, busy) \
            or self._has_own and self._refresh(now, busy) or self.read(now, busy)
        if job and self._share.owed > 0:
            self._share.counted.append(job.start(self._tasks, now))
        return job or has_writes and self._write(now, busy) \
            or has_guests and self._guest(now, busy) or None

    def _gives_way(self) -> bool:
        """
        Tell whether reads go before the next message, because one of its row has failed.

        These are the reads that were due when a message got no whole reply last.
        """
        odd, waiting = self._stations.odd, self._messages
        return bool(odd.failed and waiting) \
            and odd.failures(key_of(waiting[0].mapping, is_own=False)) > 0 \
            and self._reads.find_due(odd.message_failed_at)

    def _after_death(self, now: float, busy: Container[int]) -> Job | None:
        """
        Return a job that waited while a station died: a read of a proven station, or a write.

        Otherwise stations that have never answered would all be tried first.
        """
        probes = self._stations.probes
        job, is_kept_waiting = self._reads.next_proven(probes.died_at, busy)
        if job is not None:
            return job
        if not is_kept_waiting:
            probes.caught_up()
        return self._write(now, busy) if self._messages else None

    def _guest(self, now: float, busy: Container[int]) -> Job | None:
        """Return a command of a guest."""
        job = self._guests.next(now, busy, may_write=self._tasks.is_heard)
        if job is None:
            return None
        self._writes_in_a_row = 0
        self._share.counted.append(job.start(self._tasks, now))
        guest = job.asked.guest
        guest.listener.sends(guest, job.command)
        return job

    def _write(self, now: float, busy: Container[int]) -> Job | None:
        """Return a new write or the next packet of a write under way, in turns."""
        under_way = self._tasks.first(busy)
        write = None
        if under_way is None or not self._has_begun_write:
            write = self._begin(Rank.MESSAGE, now, busy)
        if write or under_way:
            self._has_begun_write = write is not None
            self._writes_in_a_row += 1
        if write is not None or under_way is None:
            return write
        if under_way.is_own:  # a fallback that stands takes turns with the reads
            self._is_reads_turn, self._writes_in_a_row = True, MAX_WRITES_IN_A_ROW
        return self._tasks.take(under_way, now)

    def _check(self, now: float, busy: Container[int]) -> Job | None:
        """Return a check that is due; the turn of the reads comes after it."""
        find_read = self._reads.find_due
        are_due = find_read(self._last_check)
        if are_due and self._is_reads_turn:
            return None
        check = self._checks.next(
            now, busy, self._probe_from(now), self._odd_from(now),
            lambda check: not are_due or check.is_planned and not find_read(check.begun))
        if check is None:
            return None
        self._last_check, self._is_reads_turn = now, True
        self._last_probe_was_check |= check.is_probe
        self._last_odd_was_check |= self._stations.odd.is_odd(check.key)
        if self._messages:
            self._writes_in_a_row = MAX_WRITES_IN_A_ROW
        return check

    def _refresh(self, now: float, busy: Container[int]) -> Job | None:
        """Return a fallback to be written again (rule 8); a read has its turn after it."""
        if self._is_reads_turn and self._reads.find_due(now) \
                or self._tasks.first((), _is_own):
            return None
        own = self._begin(Rank.REFRESH, now, busy)
        if own is not None:
            self._is_reads_turn = True
            if not self._reads.find_due(now):  # then the turn of the writes begins again
                self._writes_in_a_row = 0
        return own

    def _probe_from(self, now: float) -> float:
        """
        Return the clock value (s) from which a check may be a probe.

        If reads of silent stations wait as well, checks and reads take turns.
        """
        return _checks_from(
            self._stations.probes, self._last_probe_was_check and self._reads.has_silent, now)

    def _odd_from(self, now: float) -> float:
        """Return the same for a check that fails while its station replies to others."""
        return _checks_from(
            self._stations.odd.turns, self._last_odd_was_check and self._reads.has_odd, now)

    def read(self, now: float, busy: Container[int]) -> Job | None:
        """Return a probe or read that is due."""
        job = self._reads.next(now, busy)
        if job is not None:
            self._last_probe_was_check &= not job.is_probe
            if self._last_odd_was_check:
                self._last_odd_was_check = not self._stations.odd.is_odd(job.key)
            self._is_reads_turn = False
            self._writes_in_a_row = self._own.in_a_row = 0
        return job

    def next_due(self) -> float:
        """Return when the next job is due (clock value in s), infinite for never."""
        if self._has_own and self._kernel.end.keeps_line:
            return self._kernel.turns.next_due()
        due = min(self._reads.next_due(), self._checks.next_due, self._held_until)
        if not self._tasks.is_heard and self._questions.are_slow:
            due = max(due, self._questions.next)
        return min(due, self._kernel.turns.next_due()) if self._has_own else due
