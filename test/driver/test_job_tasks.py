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

from __future__ import annotations

import math

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.job_tasks import JobTasks, Steps
from abdf1_ros.errors import CommandTimeout, LinkError, PortLost
import pytest

OURS = 5
NOW = 50.0


class Job:
    """Two requests; it keeps what becomes of them."""

    def __init__(self) -> None:
        self.replies: list[bytes] = []
        self.errors: list[LinkError] = []

    def steps(self) -> Steps[None]:
        """Ask twice."""
        try:
            for data in (b'a', b'b'):
                self.replies.append((yield 0x0F, data).data)
        except LinkError as error:
            self.errors.append(error)


def test_job_is_one_command_after_the_other() -> None:
    job, tasks = Job(), JobTasks(OURS, 0x10)
    task = tasks.start(1, job.steps(), NOW)
    assert task.command == Packet(1, OURS, 0x0F, 0, 0x11, b'a')
    assert tasks.waiting(()) is None  # whoever has started it sends it
    task.sent = True
    task.reply(task.command.reply(b'one'))
    assert (tasks.waiting((1,)), tasks.waiting((2,))) == (None, task)
    assert tasks.take(task, NOW) is task
    assert tasks.waiting(()) is None
    assert (task.command, task.sent) == (Packet(1, OURS, 0x0F, 0, 0x12, b'b'), False)
    task.reply(task.command.reply(b'two'))
    assert (job.replies, job.errors) == ([b'one', b'two'], [])
    assert (tasks.transactions, tasks.waiting(())) == (2, None)


def test_size_of_the_reply_is_that_of_the_first_command() -> None:
    task = JobTasks(OURS, 0).start(1, Job().steps(), NOW, reply_size=20)
    assert task.reply_size == 20
    task.reply(task.command.reply(bytes(20)))
    assert task.reply_size == 0


def test_error_ends_the_job_and_says_whether_the_command_was_sent() -> None:
    job, tasks = Job(), JobTasks(OURS, 0)
    task = tasks.start(1, job.steps(), NOW)
    task.fail(CommandTimeout())
    assert [error.sent for error in job.errors] == [False]
    other = Job()
    task = tasks.start(1, other.steps(), NOW)
    task.sent = True
    task.fail(CommandTimeout())
    assert [error.sent for error in other.errors] == [True]
    assert tasks.transactions == 0


def test_all_jobs_end_with_the_port() -> None:
    jobs, tasks = (Job(), Job()), JobTasks(OURS, 0)
    first, _ = (tasks.start(station, job.steps(), NOW) for station, job in enumerate(jobs))
    first.reply(first.command.reply(b'one'))
    tasks.fail(PortLost('unplugged'))
    assert [str(error) for job in jobs for error in job.errors] == ['port lost: unplugged'] * 2
    assert tasks.waiting(()) is None


def test_error_in_a_job_ends_it() -> None:
    def steps() -> Steps[None]:
        yield 0x0F, b''
        raise ZeroDivisionError

    tasks = JobTasks(OURS, 0)
    task = tasks.start(1, steps(), NOW)
    with pytest.raises(ZeroDivisionError):
        task.reply(task.command.reply())
    tasks.fail(PortLost('unplugged'))  # there is nothing left to be ended
    assert tasks.waiting(()) is None


def test_transaction_number_is_passed_over_when_a_whole_round_lies_between() -> None:
    tasks = JobTasks(OURS, 7)

    def number(station: int) -> int:
        return tasks.new_command(station, (0x06, b'')).tns

    first = number(1)
    for _ in range(0xFFFF):
        number(2)
    assert number(1) == (first + 1) & 0xFFFF
    assert number(2) != number(2)


def test_job_that_the_garbage_collector_has_ended_is_left_alone() -> None:
    job, tasks = Job(), JobTasks(OURS, 0)
    steps = job.steps()
    tasks.start(1, steps, NOW)
    steps.close()
    tasks.fail(PortLost('unplugged'))
    assert job.errors == []


def test_job_that_nobody_has_asked_for_does_not_expire() -> None:
    tasks = JobTasks(OURS, 0)
    task = tasks.start(1, Job().steps(), NOW)
    task.reply(task.command.reply())
    assert (task.expires, tasks.next_expiry) == (math.inf, math.inf)


def test_command_expires_by_the_request_or_by_the_command_before() -> None:
    tasks = JobTasks(OURS, 0, char_time=0.01)
    task = tasks.start(1, Job().steps(), NOW, expires=NOW + 1.5, patience=2.0)
    size = len(task.command.encode())
    task.reply(task.command.reply())
    assert task.expires == pytest.approx(NOW + 2.0 + 0.01 * size)
    assert tasks.next_expiry == task.expires


@pytest.mark.parametrize('after, errors', [(-0.001, 0), (0.0, 1), (4.0, 1)])
def test_job_ends_whose_next_command_has_waited_too_long(after: float, errors: int) -> None:
    job, tasks = Job(), JobTasks(OURS, 0)
    task = tasks.start(1, job.steps(), NOW, expires=NOW + 2.0, patience=2.0)
    task.sent = True
    task.reply(task.command.reply())
    tasks.expire(task.expires + after)
    assert [str(error) for error in job.errors] == ['too old to be sent'] * errors
    assert (tasks.waiting(()) is None) == bool(errors)
