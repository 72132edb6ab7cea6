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

"""Jobs as tasks of the link: requests out, replies in, and the numbers of their commands."""

import math
from unittest.mock import Mock

from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.driver.job_tasks import Job, JobTasks
from abdf1_ros.driver.write import Outcome
from abdf1_ros.errors import CommandExpired, CommandTimeout, PortLost
from abdf1_ros.pccc.dialect import Steps
import pytest
from support.cases import for_all
from support.driver_bench import DriverBench
from support.mappings import make_mapping

OURS = 5
NOW = 50.0
LINE = Mock(now=NOW, took=lambda begun, now: now - begun - 0.5)  # after a pause of 0.5 s


class TwoRequests(Job):
    """Two requests; it keeps what becomes of them."""

    def __init__(self, station: int = 1, expires: float = math.inf, patience: float = 0.0,
                 reply_size: int = 0) -> None:
        self.station, self.reply_size = station, reply_size
        self.expires, self.patience = expires, patience
        self.replies: list[bytes] = []
        self.errors: list[Exception | None] = []
        self.under_way: Steps[None] | None = None

    def steps(self, now: float) -> Steps[None]:
        """Ask twice."""
        self.under_way = self._steps()
        return self.under_way

    def _steps(self) -> Steps[None]:
        for data in (b'a', b'b'):
            self.replies.append((yield 0x0F, data).data)

    def ended(self, error: Exception | None) -> None:
        """Keep it."""
        self.errors.append(error)


def test_job_is_one_command_after_the_other() -> None:
    job, tasks = TwoRequests(reply_size=20), JobTasks(OURS, 0x10, LINE)
    task = job.start(tasks, NOW)
    assert (task.command, task.reply_size) == (Packet(1, OURS, 0x0F, 0, 0x11, b'a'), 20)
    assert tasks.first(()) is None  # whoever has started it sends it
    task.sent = True
    task.reply(task.command.reply(b'one'))
    assert (tasks.first((1,)), tasks.first((2,))) == (None, task)
    assert tasks.take(task, NOW) is task
    assert tasks.first(()) is None
    assert (task.command, task.sent) == (Packet(1, OURS, 0x0F, 0, 0x12, b'b'), False)
    assert task.reply_size == 0  # that of the first command only is known
    task.reply(task.command.reply(b'two'))
    assert (job.replies, job.errors) == ([b'one', b'two'], [None])
    assert (tasks.transactions, tasks.first(())) == (2, None)


@for_all('station', [1, BROADCAST])
def test_reply_of_a_station_is_heard_and_the_end_of_a_broadcast_is_not(station: int) -> None:
    (tasks := JobTasks(OURS, 0, LINE)).connect()
    task = TwoRequests(station).start(tasks, NOW)
    task.reply(task.command.reply())
    assert tasks.is_heard is (station != BROADCAST)


def test_error_ends_the_job_and_says_whether_the_command_was_sent() -> None:
    tasks = JobTasks(OURS, 0, LINE)
    for was_sent in (False, True):
        job = TwoRequests()
        task = job.start(tasks, NOW)
        task.sent = was_sent
        task.fail(CommandTimeout())
        error, = job.errors
        assert isinstance(error, CommandTimeout)
        assert error.sent is was_sent
    assert tasks.transactions == 0


def test_all_jobs_end_with_the_port() -> None:
    jobs, tasks = (TwoRequests(1, NOW + 9.0), TwoRequests(2)), JobTasks(OURS, 0, LINE)
    first, _ = (job.start(tasks, NOW) for job in jobs)
    first.reply(first.command.reply(b'one'))
    tasks.fail(PortLost('unplugged'))
    assert [str(error) for job in jobs for error in job.errors] == ['port lost: unplugged'] * 2
    assert (tasks.first(()), tasks.next_expiry) == (None, math.inf)


@for_all('sent', [False, True])
def test_job_that_is_stopped_sends_no_further_command_and_says_why(sent: bool) -> None:
    jobs, tasks = [TwoRequests(patience=9.0) for _ in range(4)], JobTasks(OURS, 0, LINE)
    for job in jobs:
        job.start(tasks, NOW).sent = sent
    jobs[0].reply(jobs[0].command.reply(b'one'))  # its second command waits
    tasks.stop(lambda job: job not in jobs[2:], 'somebody else')
    assert tasks.next_expiry == -math.inf
    jobs[1].reply(jobs[1].command.reply(b'one'))
    tasks.expire(NOW)
    assert [[*map(str, job.errors)] for job in jobs] == [['somebody else']] * 2 + [[]] * 2
    tasks.stop(lambda job: True, 'somebody else')
    jobs[2].fail(CommandTimeout())  # it was sent, which says more
    assert [type(error) for error in jobs[2].errors] == [CommandTimeout]
    jobs[3].fail(CommandExpired())  # the link was about to send it
    assert [*map(str, jobs[3].errors)] == ['somebody else']


def test_error_in_a_job_ends_it() -> None:
    class Faulty(TwoRequests):

        def _steps(self) -> Steps[None]:
            yield 0x0F, b''
            raise ZeroDivisionError

    job, tasks = Faulty(), JobTasks(OURS, 0, LINE)
    task = job.start(tasks, NOW)
    with pytest.raises(ZeroDivisionError):
        task.reply(task.command.reply())
    tasks.fail(PortLost('unplugged'))  # there is nothing left to be ended
    assert [type(error) for error in job.errors] == [ZeroDivisionError]
    assert tasks.first(()) is None


def test_job_that_fails_before_its_first_command_has_ended_too() -> None:
    mapping = make_mapping('N7:0', 'Write')
    bench = DriverBench([mapping])
    bench.run(1.0)
    bench.driver.readings.planner.dialect = Mock(  # type: ignore[method-assign]
        side_effect=ZeroDivisionError)
    with pytest.raises(ZeroDivisionError):
        bench.write(mapping, [1], run=1.0)
    bench.lose_port('internal error')  # as the link's thread does
    assert bench.listener.outcomes() == [Outcome.UNKNOWN]
    assert not bench.driver.tasks.under_way


def test_transaction_number_is_passed_over_when_a_whole_round_lies_between() -> None:
    tasks = JobTasks(OURS, 7, LINE)

    def number(station: int) -> int:
        return tasks.new_command(station, (0x06, b'')).tns

    first = number(1)
    for _ in range(0xFFFF):
        number(2)
    assert number(1) == (first + 1) & 0xFFFF
    assert number(2) != number(2)


def test_job_that_the_garbage_collector_has_ended_is_left_alone() -> None:
    job, tasks = TwoRequests(), JobTasks(OURS, 0, LINE)
    job.start(tasks, NOW)
    assert job.under_way is not None
    job.under_way.close()
    tasks.fail(PortLost('unplugged'))
    assert job.errors == []


@for_all('expires', [NOW + 1.5, NOW + 9.0])
def test_command_expires_by_the_request_or_by_the_reply_before(expires: float) -> None:
    tasks = JobTasks(OURS, 0, LINE)
    task = TwoRequests(expires=expires, patience=2.0).start(tasks, NOW - 4.0)
    task.reply(task.command.reply())
    assert task.expires == max(expires, NOW - 0.5 + 2.0)
    assert tasks.next_expiry == task.expires


@pytest.mark.parametrize('after, errors', [(-0.001, 0), (0.0, 1), (4.0, 1)])
def test_job_ends_whose_next_command_has_waited_too_long(after: float, errors: int) -> None:
    job, tasks = TwoRequests(expires=NOW + 2.0, patience=2.0), JobTasks(OURS, 0, LINE)
    task = job.start(tasks, NOW)
    task.sent = True
    task.reply(task.command.reply())
    tasks.expire(task.expires + after)
    assert [str(error) for error in job.errors] == ['too old to be sent'] * errors
    assert (tasks.first(()) is None) == bool(errors)
