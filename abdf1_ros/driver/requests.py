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
Requests to stations, each carried out once, one at a time, without mappings or periods.

They use the same links, with the same rules, as the driver.
"""

from __future__ import annotations

from collections.abc import Callable, Container
from contextlib import suppress
from dataclasses import replace
from typing import TypeVar

from abdf1_ros.counters import Counters
from abdf1_ros.df1.machine import Procedure
from abdf1_ros.df1.mode import LineMode, Report
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import Task, TaskSource
from abdf1_ros.driver.inbox import Inbox
from abdf1_ros.driver.job_tasks import Job, JobTasks
from abdf1_ros.errors import CLOSED, INTERNAL_ERROR, LinkError, PortLost
from abdf1_ros.messages import Event, Message
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.describe import effect_of
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.notation import Effect
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.steps import echo

_Result = TypeVar('_Result')

# Seconds without a poll after which a slave ends its request, because a person waits.
LONGEST_UNPOLLED = 5.0


class _RequestJob(Job):
    """Steps with a station, which report their end; ``fail`` is called if they do not begin."""

    def __init__(self, station: int, work: Steps[None],
                 fail: Callable[[Exception], None]) -> None:
        self.station = station
        self._work, self.give_up = work, fail

    def steps(self, now: float) -> Steps[None]:
        """Return the steps."""
        return self._work

    def ended(self, error: Exception | None) -> None:
        """Do nothing: the steps have reported the end."""


class _Question(Job):
    """An echo before a job; the job goes on after the answer, and fails unsent without one."""

    def __init__(self, job: Job) -> None:
        self.station = job.station
        self._job = job

    def steps(self, now: float) -> Steps[None]:
        """Ask for the echo; a refusal is an answer as well."""
        return echo(b'')

    def ended(self, error: Exception | None) -> None:
        """Let the job go on, or fail."""
        if isinstance(error, LinkError):
            self._job.fail(error)
        else:
            self._tasks.advanced(self._job)


class Requests(TaskSource):
    """
    Carry out requests over a line; ``machine`` is to be run on its port.

    Inactive ``stations`` get one try each until they answer, all others every retry of the line.
    ``first_tns`` should be random, or a station may take our first command for a repetition.
    Commands for us are refused, except an echo and the diagnostic status, which shows a
    ``plc_type``. ``stray`` names the last reply that answers no command, empty for none.
    ``report`` gets every numbered error and notice, in the link thread. If the port ``may_store``
    our bytes, only reads are sent until an answer has come on this connection. The same holds
    after a request without an answer (rule 26 of docs/heartbeats.md).
    """

    def __init__(self, mode: LineMode, line: LinkSettings, stations: ActiveStationList,
                 first_tns: int = 0, plc_type: PlcType = PlcType.PLC5,
                 report: Report = lambda event: None, *, may_store: bool = False) -> None:
        self._told = report
        self._may_store = may_store and not mode.is_polled
        self.counters, self.stations = Counters(), stations
        self.machine = mode.make_machine(line, self._run, self.counters)
        self._tasks = JobTasks(line.station or 0, first_tns, self.machine)
        self._waiting: Inbox[_RequestJob] = Inbox()
        self._taken: list[_RequestJob] = []  # in the link thread; they wait for their stations
        self._lost: LinkError = PortLost('not opened yet')
        self.stray = ''
        # Without DLE NAK, which would make other stations of a line in use drop their replies.
        self._link = mode.make_link(
            self.machine, replace(
                line, nak_on_command_timeout=False, poll_timeout=LONGEST_UNPOLLED), self.stations,
            Server(DataTable(plc_type)).serve, self._report)

    def add(self, station: int, work: Steps[_Result], succeed: Callable[[_Result], None],
            fail: Callable[[Exception], None]) -> None:
        """
        Ask for ``work`` with a station; may be called from any thread, then wake the link.

        Exactly one of ``succeed`` and ``fail`` is called, in the link thread; ``fail`` at once
        while the port is lost, and after ``close``.
        """
        def failed(error: Exception) -> None:
            if self._may_store and isinstance(error, LinkError):
                self._tasks.connect()
            fail(error)

        def reported() -> Steps[None]:
            """Carry out the work and report its end; a bug in it ends no other request."""
            try:
                result = yield from work
            except Exception as error:
                failed(error)
            else:
                succeed(result)

        request = _RequestJob(station, reported(), failed)
        if not self._waiting.put(request):
            _refuse(request, self._lost)

    def close(self) -> None:
        """Refuse all requests, waiting and new ones; to be called when the link has ended."""
        self._end(PortLost(CLOSED))

    def next_task(self, now: float, busy: Container[int] = ()) -> Task | None:
        """Return the next command of the request under way, or of the next request."""
        under_way = self._tasks.first(busy)
        if under_way is not None:
            return self._heard_first(self._tasks.take(under_way, now), now)
        self._taken += self._waiting.take()
        for request in [taken for taken in self._taken if taken.station not in busy]:
            self._taken.remove(request)
            with suppress(StopIteration):  # the request has ended before its first command
                return self._heard_first(request.start(self._tasks, now), now)
        return None

    def _heard_first(self, job: Job, now: float) -> Job:
        """Return a job with a command, or the question before a command that may write."""
        if self._tasks.is_heard or effect_of(job.command) is Effect.READS:
            return job
        return _Question(job).start(self._tasks, now)

    def _report(self, event: Event) -> None:
        self._told(event)
        if event.message is Message.ERR_WRONG_MESSAGE:
            self.stray = str(event)

    def _run(self) -> Procedure:
        if self._may_store:
            self._tasks.connect()
        self._waiting.open()
        try:
            yield from self._link.run(self)
        except Exception as error:  # also a bug
            self._end(error if isinstance(error, PortLost) else PortLost(INTERNAL_ERROR))
            raise

    def _end(self, error: LinkError) -> None:
        """End all requests; later requests end at once."""
        self._lost = error
        self._tasks.fail(error)
        taken, self._taken = self._taken, []
        for request in (*taken, *self._waiting.close()):
            _refuse(request, error)


def _refuse(request: _RequestJob, reason: LinkError) -> None:
    request.give_up(PortLost(*reason.args, sent=False))
