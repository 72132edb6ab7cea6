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
Jobs, and those of them that are under way: each is a task for the link.

What a job does is a generator that yields requests and is sent the replies; where there is none,
the error is raised in it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Container
from inspect import GEN_CLOSED, getgeneratorstate
import math
from typing import Protocol, TypeVar

from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.errors import Abdf1Error, CommandExpired, LinkError
from abdf1_ros.pccc.dialect import Request, Steps

_With = TypeVar('_With', Packet, LinkError)


class LineTime(Protocol):
    """The clock of a line, such as its machine: see there."""

    now: float
    late: float

    def took(self, begun: float, now: float) -> float: ...


class Job:
    """
    What is done with a station, one command after the other; each kind has a queue.

    It is a ``Task`` of the link, with its present ``command``, from ``start`` until it has
    ``ended``; then it may be started again. ``taken`` is when the link took that command (clock
    value in s). The reply to the first command has ``reply_size`` bytes after its header, 0 where
    that is not known. That command must not be sent after ``expires``; each later one has
    ``patience`` s after the command before it, without that command's own time on the line. The
    link judges this for all kinds alike, when it sends. When that is, each kind says: a message
    and a guest's command get old by the clock, a heartbeat when what it vouches for may no longer
    be so, a 0 and a Fallback never. Queues end what has waited as long, for its result to come in
    time.
    ``is_probe`` tells that a silent station is asked whether it is there again, ``is_own`` that
    no message has asked for it: a heartbeat or a fallback.
    """

    station: int
    command: Packet
    sent = False
    reply_size = 0
    expires = math.inf
    patience = 0.0
    is_probe = False
    is_own = False
    blames = True
    answer_within = math.inf
    taken: float
    _tasks: JobTasks
    _steps: Steps[None]

    def steps(self, now: float) -> Steps[None]:
        """Return what is to be done from ``now`` on (clock value in s)."""
        raise NotImplementedError

    def ended(self, error: Exception | None) -> None:
        """Take note, once, that it has ended, by an error that it has not handled or by itself."""
        raise NotImplementedError

    def start(self, tasks: JobTasks, now: float) -> Job:
        """Begin, with the first command; return the job itself."""
        self.sent, self.taken = False, now
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
        # One of its own: where the port is lost, all jobs are failed with the same.
        self._advance(self._steps.throw, type(error)(*error.args, sent=self.sent))

    def _advance(self, resume: Callable[[_With], Request], what: _With) -> None:
        try:
            request = resume(what)
        except StopIteration:
            self._tasks.under_way.discard(self)
            self.ended(None)
            return
        except Exception as error:
            self._tasks.under_way.discard(self)
            self.ended(error)
            if not isinstance(error, Abdf1Error):
                raise  # a bug
            return
        self.sent, self.reply_size = False, 0
        if self.patience:
            line_time = len(self.command.encode()) * self._tasks.char_time
            self.expires = max(self.expires, self.taken + line_time + self.patience)
        self.command = self._tasks.new_command(self.station, request)
        self._tasks.advanced(self)


class JobTasks:
    """
    All jobs under way, and the transaction numbers of their commands.

    All are in ``under_way``; the next command of those in ``waiting`` waits to be sent.
    ``station`` is our own, ``first_tns`` the number before the first. ``transactions`` counts the
    replies. ``is_heard`` tells whether one has come on this connection, where that matters.
    ``char_time`` is seconds a character. ``next_expiry`` is when a waiting command will have
    waited too long (clock value in s), infinite for never.
    """

    def __init__(self, station: int, first_tns: int, char_time: float = 0.0) -> None:
        self.char_time = char_time
        self.transactions = 0
        self.is_heard = True
        self._station = station
        self._tns = first_tns
        self._last_tns: dict[int, int] = {}
        self.under_way: set[Job] = set()
        self.waiting: deque[Job] = deque()
        self.next_expiry = math.inf

    def connect(self) -> None:
        """Take note of a connection that has to be heard before anything is written."""
        self.is_heard = False

    def first(self, busy: Container[int], is_own: bool = False) -> Job | None:
        """Return the first that waits, but not for a ``busy`` station; only our own if asked."""
        return next((job for job in self.waiting if job.station not in busy
                     and (job.is_own or not is_own)), None)

    def take(self, job: Job, now: float) -> Job:
        """Return a waiting job whose command is now to be sent."""
        self._stop_waiting(job)
        job.taken = now
        return job

    def expire(self, now: float) -> None:
        """End the jobs whose next command has waited too long."""
        for job in [job for job in self.waiting if now >= job.expires]:
            self._stop_waiting(job)
            job.fail(CommandExpired())

    def _stop_waiting(self, job: Job) -> None:
        self.waiting.remove(job)
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

        Its transaction number is never the one that this station had last.
        """
        cmd, data = request
        self._tns = self._tns + 1 & 0xFFFF
        if self._tns == self._last_tns.get(station):
            self._tns = self._tns + 1 & 0xFFFF
        self._last_tns[station] = self._tns
        return Packet(station, self._station, cmd, 0, self._tns, data)

    def advanced(self, job: Job) -> None:
        """Take note that a job has its next command ready."""
        self.waiting.append(job)
        self.next_expiry = min(self.next_expiry, job.expires)
