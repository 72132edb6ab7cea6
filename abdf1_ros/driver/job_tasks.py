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
Jobs under way: each is a task for the link, one command after the other.

A job is a generator that yields requests and is sent the replies; where there is none, the
error is raised in it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Container, Generator
from inspect import GEN_CLOSED, getgeneratorstate
import math
from typing import TypeVar

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import CommandExpired, LinkError
from abdf1_ros.pccc.dialect import Request

_Result = TypeVar('_Result')

Steps = Generator[Request, Packet, _Result]
"""What is done with a station: yields requests, is sent the replies, returns the result."""

_With = TypeVar('_With', Packet, LinkError)


class JobTasks:
    """
    All jobs under way, and the transaction numbers of their commands.

    ``station`` is our own, ``first_tns`` the number before the first. ``transactions`` counts
    the replies. ``char_time`` is seconds a character. ``next_expiry`` is when a waiting command
    will have waited too long (clock value in s), infinite for never.
    """

    def __init__(self, station: int, first_tns: int, char_time: float = 0.0) -> None:
        self.char_time = char_time
        self.transactions = 0
        self._station = station
        self._tns = first_tns
        self._last_tns: dict[int, int] = {}
        self._tasks: set[JobTask] = set()
        self._waiting: deque[JobTask] = deque()
        self.next_expiry = math.inf

    def start(self, station: int, steps: Steps[None], now: float, *, reply_size: int = 0,
              expires: float = math.inf, patience: float = 0.0) -> JobTask:
        """
        Return the task of a new job with its first command, whose reply has ``reply_size``.

        The first command must not be sent after ``expires`` (clock value in s). Each later one has
        ``patience`` s after the command before it, without that command's own time on the line.
        """
        task = JobTask(self, station, steps, reply_size, expires)
        task.patience = patience
        task.taken = now
        self._tasks.add(task)
        return task

    def waiting(self, busy: Container[int]) -> JobTask | None:
        """Return a task whose next command waits to be sent, but not to a ``busy`` station."""
        for task in self._waiting:
            if task.station not in busy:
                return task
        return None

    def take(self, task: JobTask, now: float) -> JobTask:
        """Return a waiting task that is now to be sent."""
        self._stop_waiting(task)
        task.taken = now
        return task

    def expire(self, now: float) -> None:
        """End the jobs whose next command has waited too long."""
        for task in [task for task in self._waiting if now >= task.expires]:
            self._stop_waiting(task)
            task.fail(CommandExpired())

    def _stop_waiting(self, task: JobTask) -> None:
        self._waiting.remove(task)
        self.next_expiry = min((task.expires for task in self._waiting), default=math.inf)

    def fail(self, error: LinkError) -> None:
        """End every job with ``error``."""
        for task in list(self._tasks):
            task.fail(error)
        self._waiting.clear()
        self.next_expiry = math.inf

    def new_command(self, station: int, request: Request) -> Packet:
        """Return the command for a request, with a transaction number of its own."""
        cmd, data = request
        return Packet(station, self._station, cmd, 0, self._next_tns(station), data)

    def advanced(self, task: JobTask, is_done: bool) -> None:
        """Take note that a task has its next command ready, or is done."""
        if is_done:
            self._tasks.discard(task)
        else:
            self._waiting.append(task)
            self.next_expiry = min(self.next_expiry, task.expires)

    def _next_tns(self, station: int) -> int:
        """Return the next transaction number, never the one this station had last."""
        self._tns = self._tns + 1 & 0xFFFF
        if self._tns == self._last_tns.get(station):
            self._tns = self._tns + 1 & 0xFFFF
        self._last_tns[station] = self._tns
        return self._tns


class JobTask:
    """A job as the link sees it; ``taken`` is when the link took its command."""

    def __init__(self, tasks: JobTasks, station: int, steps: Steps[None], reply_size: int,
                 expires: float) -> None:
        self.sent = False
        self.reply_size = reply_size
        self.expires = expires
        self.taken = self.patience = 0.0
        self.station = station
        self._tasks = tasks
        self._steps = steps
        self.command = tasks.new_command(station, next(steps))

    def reply(self, packet: Packet) -> None:
        """Take the reply and go on to the next request."""
        self._tasks.transactions += 1
        self._advance(self._steps.send, packet)

    def fail(self, error: LinkError) -> None:
        """Raise ``error`` in the job, unless it has ended."""
        if getgeneratorstate(self._steps) == GEN_CLOSED:  # closed by the garbage collector
            return
        error.sent = self.sent
        self._advance(self._steps.throw, error)

    def _advance(self, resume: Callable[[_With], Request], what: _With) -> None:
        try:
            request = resume(what)
        except StopIteration:
            self._tasks.advanced(self, is_done=True)
            return
        except Exception:  # a bug has ended the job
            self._tasks.advanced(self, is_done=True)
            raise
        self.sent, self.reply_size = False, 0
        if self.patience:
            line_time = len(self.command.encode()) * self._tasks.char_time
            self.expires = max(self.expires, self.taken + line_time + self.patience)
        self.command = self._tasks.new_command(self.station, request)
        self._tasks.advanced(self, is_done=False)
