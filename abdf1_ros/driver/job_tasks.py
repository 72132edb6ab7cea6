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
Jobs, and the jobs that are under way: each job is a task for the link.

The steps of a job are a generator: it yields requests and is sent the replies. Without a reply the
error is raised in the generator.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Container, Hashable
from inspect import GEN_CLOSED, getgeneratorstate
import math
from typing import TypeVar

from abdf1_ros.df1.odd import OddCommands
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.df1.probes import Asker
from abdf1_ros.df1.tasks import LineTime
from abdf1_ros.errors import (
    Abdf1Error,
    CommandExpired,
    LinkError,
    StationInactive,
)
from abdf1_ros.pccc.describe import effect_of
from abdf1_ros.pccc.dialect import Request, Steps
from abdf1_ros.pccc.notation import Effect

_With = TypeVar('_With', Packet, LinkError)


class Job(ABC):
    """
    Work with a station, one command at a time; each kind of job has a queue.

    A job is a ``Task`` of the link, with its present ``command``, from ``start`` until it has
    ``ended``; then it may be started again.

    - ``taken``: when the link took the present command (clock value in s).
    - ``reply_size``: bytes after the header of the reply to the first command, 0 if unknown.
    - ``expires``: the first command must not be sent after this clock value (s). Messages and
      guests' commands expire by age. A heartbeat expires when its conditions may have ended. A 0
      and a Fallback never expire. The link checks it for all kinds before it sends; the queues
      also end expired jobs, so that their results are not late.
    - ``patience``: a later command expires this many seconds after the reply to the command
      before it, but not after ``latest`` (clock value in s). A pause of the process counts.
    - ``why_stopped``: why no further command may be sent, empty if it may.
    - ``is_probe``: a silent station is asked whether it answers again.
    - ``is_own``: a heartbeat or a fallback, which no message has asked for.
    - ``key``: what fails if the job fails again and again, None for nothing: see ``df1.odd``.
    - ``is_untested``: commands of its station have begun to fail, and it has not passed since.
    - ``is_suspect``: its station has replied to another command since the last one with this key
      failed; for an untested one, since any failed. So a failure does not blame the station.
    - ``is_whole``: with the reply that has come the job is done; another packet would follow in a
      turn of its own.
    - ``asker``: as what a job that is odd has its turn.
    - ``blames``, ``answer_within``: see ``Task``.
    """

    station: int
    command: Packet
    sent = False
    reply_size = 0
    expires = math.inf
    patience = 0.0
    latest = math.inf
    why_stopped = ''
    is_probe = False
    is_own = False
    is_whole = True
    key: Hashable = None
    is_untested = is_suspect = False
    asker = Asker.IN_TURN
    blames = True
    answer_within = math.inf
    taken: float
    _tasks: JobTasks
    _steps: Steps[None]

    @abstractmethod
    def steps(self, now: float) -> Steps[None]:
        """Return the steps of the job from ``now`` on (clock value in s)."""

    @abstractmethod
    def ended(self, error: Exception | None) -> None:
        """React, once, to the end of the job: by itself, or by an unhandled ``error``."""

    def start(self, tasks: JobTasks, now: float) -> Job:
        """Begin, with the first command; return the job itself."""
        self.sent, self.taken = False, now
        self._has_failed = False
        if self.key is not None:
            odd = tasks.odd
            self._had_failed = bool(odd.failed) and self.key in odd.failed
            self.is_suspect = odd.is_suspect(self.key, self.station) if self._had_failed \
                else self.is_untested and not odd.is_doubtful(self.station)
            self._is_odd = self.is_suspect and odd.is_odd(self.key)
            self.blames = not self.is_suspect
        self._tasks, self._steps = tasks, self.steps(now)
        try:
            request = next(self._steps)
        except Exception as error:  # a bug, or it has ended before its first command
            self.ended(error)
            raise
        self.command = tasks.new_command(self.station, request)
        tasks.under_way.add(self)
        return self

    def reply(self, packet: Packet) -> None:
        """Take the reply and go on to the next request."""
        self._tasks.transactions += 1
        if self.station != BROADCAST:
            self._tasks.is_heard = True
        self._advance(self._steps.send, packet)

    def fail(self, error: LinkError) -> None:
        """Raise ``error`` in the steps, unless they have ended."""
        if getgeneratorstate(self._steps) == GEN_CLOSED:  # closed by the garbage collector
            return
        if self.why_stopped and isinstance(error, CommandExpired):
            error = CommandExpired(self.why_stopped)
        # A copy of the error for this job: a lost port fails all jobs with the same error.
        found = type(error)(*error.args, sent=self.sent, cause=error.cause)
        if self.key is not None:
            found = self._tasks.odd.judge(self.key, self.station, found, self._tasks.line.now,
                                          is_counted=not self._has_failed)
            self._has_failed = True
        self._advance(self._steps.throw, found)

    def _settle(self) -> None:
        """Record the end of the job for the jobs with the same key."""
        if self.key is None:
            return
        odd, line = self._tasks.odd, self._tasks.line
        if self._has_failed and self.key in odd.failed and (
                self.is_suspect or not self._had_failed):
            odd.spent(self.key, line.took(self.taken, line.now), line.now, self.asker,
                      was_odd=self._is_odd)
        if self.is_whole and not self._has_failed:
            odd.passed(self.key)

    def _advance(self, resume: Callable[[_With], Request], what: _With) -> None:
        try:
            request = resume(what)
        except Exception as raised:
            error = None if raised.__class__ is StopIteration else raised
            self._tasks.under_way.discard(self)
            if self._tasks.odd.failed:
                self._settle()
            self.ended(error)
            if error is not None and not isinstance(error, Abdf1Error):
                raise  # a bug
            return
        self.sent, self.reply_size = False, 0
        if self.patience:
            line = self._tasks.line
            replied = self.taken + line.took(self.taken, line.now)
            self.expires = min(self.latest, max(self.expires, replied + self.patience))
        self.command = self._tasks.new_command(self.station, request)
        self._tasks.advanced(self)


class JobTasks:
    """
    All jobs under way, and the transaction numbers of their commands.

    - ``under_way``: all jobs; ``waiting``: the jobs whose next command waits to be sent.
    - ``station``: our own; ``first_tns``: the number before the first.
    - ``line``: its clock; ``odd``: the commands that fail while their station replies to others.
    - ``transactions``: number of replies.
    - ``is_heard``: a reply has come on this connection, or none is needed (rule 26).
    - ``next_expiry``: when the first waiting command expires (clock value in s), infinite for
      never.
    """

    def __init__(self, station: int, first_tns: int, line: LineTime,
                 odd: OddCommands | None = None) -> None:
        self.line = line
        self.odd = OddCommands(lambda number: 0) if odd is None else odd
        self.transactions = 0
        self.is_heard = True
        self._station = station
        self._tns = first_tns
        self._last_tns: dict[int, int] = {}
        self.under_way: set[Job] = set()
        self.waiting: deque[Job] = deque()
        self.next_expiry = math.inf

    def connect(self) -> None:
        """Begin a connection that has to be heard before anything is written."""
        self.is_heard = False

    def first(self, busy: Container[int],
              is_meant: Callable[[Job], bool] = lambda job: True) -> Job | None:
        """Return the first waiting job that ``is_meant``, not for a ``busy`` station."""
        return next((job for job in self.waiting if job.station not in busy and is_meant(job)),
                    None)

    def take(self, job: Job, now: float) -> Job:
        """Return a waiting job whose command is now to be sent."""
        self._stop_waiting(job)
        job.taken = now
        return job

    def continued(self, now: float, busy: Container[int],
                  is_meant: Callable[[Job], bool]) -> Job | None:
        """Return the first waiting job that ``is_meant``: its next command is now to be sent."""
        job = self.first(busy, is_meant)
        return job and self.take(job, now)

    def expire(self, now: float) -> None:
        """End the jobs whose next command has waited too long."""
        for job in [job for job in self.waiting if now >= job.expires]:
            self._stop_waiting(job)
            job.fail(CommandExpired())

    def end_messages(self) -> None:
        """End the messages whose next packet waits: all stations are inactive."""
        for job in [job for job in self.waiting
                    if not job.is_own and effect_of(job.command) is not Effect.READS]:
            self._stop_waiting(job)
            job.fail(StationInactive(job.station))

    def stop(self, is_meant: Callable[[Job], bool], why: str) -> None:
        """Let jobs that are meant send no further command, for the reason ``why``."""
        for job in filter(is_meant, self.under_way):
            job.why_stopped, job.expires, job.latest = why, -math.inf, -math.inf
        self._plan()

    def _stop_waiting(self, job: Job) -> None:
        self.waiting.remove(job)
        self._plan()

    def _plan(self) -> None:
        self.next_expiry = min((job.expires for job in self.waiting), default=math.inf)

    def fail(self, error: LinkError) -> None:
        """End every job with ``error``."""
        for job in list(self.under_way):
            job.fail(error)
        self.waiting.clear()
        self.next_expiry = math.inf

    def new_command(self, station: int, request: Request) -> Packet:
        """
        Return the command for a request.

        Its transaction number differs from the last one of this station.
        """
        cmd, data = request
        self._tns = self._tns + 1 & 0xFFFF
        if self._tns == self._last_tns.get(station):
            self._tns = self._tns + 1 & 0xFFFF
        self._last_tns[station] = self._tns
        return Packet(station, self._station, cmd, 0, self._tns, data)

    def advanced(self, job: Job) -> None:
        """Queue the next command of a job."""
        self.waiting.append(job)
        self.next_expiry = min(self.next_expiry, job.expires)
