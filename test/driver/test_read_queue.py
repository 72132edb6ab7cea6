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

"""Which read goes first, and how reads share a line that is too slow for all of them."""

from collections import defaultdict
from functools import cache
from itertools import pairwise
import math
from statistics import fmean

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.reads.job import ReadJob, ReadTooOld
from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.driver.reads.queue import ReadQueue
from abdf1_ros.errors import RemoteError
from abdf1_ros.plan.forecast import block_time, intervals, load
from abdf1_ros.plan.line_model import LineModel
from abdf1_ros.plan.planner import Block, Planner
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest
from support.clock import StillClock
from support.mappings import make_mapping

LINE = LineModel(Checksum.CRC, Duplex.HALF, LineTiming(0.0001))


@cache
def make_block(period: int, text: str, length: int) -> Block:
    block, = Planner(LINE, 0.1).plan([make_mapping(text, plc='SLC', length=length, period=period)])
    return block


def make_job(period: int = 100, text: str = 'N7:0', length: int = 1) -> ReadJob:
    block = make_block(period, text, length)
    return ReadJob(block, [ReadPoint(block.mappings[0], period / 1000, 1.0)], StillClock(),
                   lambda job, words, error: None, math.inf)


TOOK = block_time(make_job().block)
"""Seconds that each of these reads has the line."""


def make_queue(*jobs: ReadJob) -> ReadQueue:
    queue = ReadQueue()
    for job in jobs:  # as stations come, one after the other
        queue.replace((), [job], 0.0)
    return queue


def starts(periods: dict[int, int], seconds: float,
           took: float = TOOK) -> dict[ReadJob, list[float]]:
    """Return when each read starts on a line; ``periods`` says how many there are of each."""
    jobs = [make_job(period) for period, count in periods.items() for _ in range(count)]
    queue, found, now = make_queue(*jobs), defaultdict(list), 0.0
    while now < seconds:
        job = queue.take(now)
        if job is None:
            now = queue.next_due()
            continue
        found[job].append(now)
        queue.put(job, max(job.due + job.block.period, now))
        now += took
    return {job: found[job] for job in jobs}


def mean_intervals(periods: dict[int, int], seconds: float = 60.0) -> dict[int, list[float]]:
    """Return the mean interval (ms) of each read once the line has settled, by period."""
    means = defaultdict(list)
    for job, times in starts(periods, seconds).items():
        settled = [later - earlier for earlier, later in pairwise(times) if earlier > seconds / 4]
        means[round(1000 * job.block.period)].append(1000 * fmean(settled))
    return means


def needed(periods: dict[int, int]) -> float:
    """Return the load of a line with so many reads of each period."""
    return load([make_job(period).block for period, count in periods.items()
                 for _ in range(count)])


def count_for(share: float, period: int) -> int:
    """Return how many reads of a period need that share of the line."""
    return round(share * period / 1000 / TOOK)


def test_earliest_deadline_goes_first() -> None:
    slow, fast, slower = make_job(1000), make_job(100), make_job(2000)
    free = make_job(0)  # its period counts as four cycles of 97 ms
    queue = make_queue(slow, slower, free, fast)
    assert [queue.take(0.0) for _ in range(5)] == [fast, free, slow, slower, None]
    queue.put(slow, 0.5)  # to be read before 1.5
    queue.put(fast, 1.35)  # before 1.45
    queue.put(slower, 0.0)  # before 2.0
    assert [queue.take(1.4) for _ in range(4)] == [fast, slow, slower, None]


def test_starts_are_those_of_a_schedule_made_by_hand() -> None:
    # 40 ms each: one every 100 ms, one every 200 ms, one every 400 ms, 70 % of the line.
    found = starts({100: 1, 200: 1, 400: 1}, 0.79, took=0.04)
    at = [[round(1000 * time) for time in times] for times in found.values()]
    assert at == [[0, 120, 200, 300, 400, 520, 600, 700], [40, 240, 440, 640], [80, 480]]


def test_starts_on_a_line_that_is_too_slow_are_those_of_a_schedule_made_by_hand() -> None:
    # 125 ms each: one every 125 ms, one every 250 ms, 150 % of the line.
    fast, slow = starts({125: 1, 250: 1}, 1.49, took=0.125).values()
    assert [round(8 * time) for time in fast] == [0, 1, 3, 4, 6, 7, 9, 10]
    assert [round(8 * time) for time in slow] == [2, 5, 8, 11]


@pytest.mark.parametrize('share', [0.5, 0.8, 0.95])
def test_periods_are_kept_as_long_as_the_line_is_fast_enough(share: float) -> None:
    periods = {100: 1, 1000: count_for(share - TOOK / 0.1, 1000)}
    assert needed(periods) == pytest.approx(share, abs=0.03)
    for job, times in starts(periods, 30.0).items():
        period = job.block.period
        late = [round(time - number * period, 9) for number, time in enumerate(times)]
        assert 0 <= min(late) <= max(late) <= period
        if period == 0.1:  # a fast one waits for one other only, which has begun
            assert max(late) <= TOOK


@pytest.mark.parametrize('share', [1.25, 1.5, 2.0, 4.0])
def test_line_that_is_too_slow_makes_every_period_longer_by_its_load(share: float) -> None:
    periods = {100: 1, 1000: count_for(share - TOOK / 0.1, 1000)}
    means = mean_intervals(periods)
    for period in periods:  # the fast one waits for what has begun, and for the next turn
        wanted = period * needed(periods)
        assert 0.95 * wanted <= fmean(means[period]) <= wanted + 2000 * TOOK


def test_reads_without_a_period_take_what_the_others_leave() -> None:
    periods = {0: 4, 100: 1, 1000: count_for(0.5, 1000)}
    means = mean_intervals(periods)
    assert fmean(means[100]) == pytest.approx(100, rel=0.01)
    assert fmean(means[1000]) == pytest.approx(1000, rel=0.01)
    left = 1 - needed({100: 1, 1000: periods[1000]})
    assert fmean(means[0]) == pytest.approx(4 * 1000 * TOOK / left, rel=0.05)


@settings(max_examples=20)
@given(st.dictionaries(st.sampled_from([0, 50, 100, 200, 500, 1000, 2000, 5000]),
                       st.integers(1, 25), min_size=1, max_size=3))
def test_forecast_is_what_comes(periods: dict[int, int]) -> None:
    jobs = [make_job(period) for period, count in periods.items() for _ in range(count)]
    expected = intervals(LINE, [job.block for job in jobs])
    for period, means in mean_intervals(periods, 40.0).items():
        assert max(means) <= 2 * 1000 * (expected[make_job(period).block] + TOOK)


def test_job_that_is_put_again_is_there_once() -> None:
    job = make_job(10_000)
    queue = make_queue(job)
    for due in (1.0, 3.0, 2.0):
        queue.put(job, due)
    assert queue.next_due() == 2.0
    assert [queue.take(9.0), queue.take(9.0)] == [job, None]
    assert job.ticket == 0
    queue = make_queue(job)
    queue.replace([job], (), 9.0)
    queue.put(job, 9.0)
    assert queue.take(9.0) is None
    assert not queue


def test_packets_of_a_long_block_go_one_by_one_and_others_between_them() -> None:
    long, fast = make_job(10_000, length=354), make_job(100)
    assert len(long.block.requests) == 3
    queue = make_queue(long, fast)
    order = []
    for number in range(4):
        for job in (queue.take(0.1 * number), queue.take(0.1 * number)):
            if job is long and is_last_packet_read(job, 0.1 * number):
                order.append('done')
            elif job is not None:
                order.append('long' if job is long else 'fast')
                queue.put(job, job.due if job.is_unfinished else job.due + job.block.period)
    assert order == ['fast', 'long', 'fast', 'long', 'fast', 'done', 'fast']


def is_last_packet_read(job: ReadJob, now: float) -> bool:
    """Have a job read its next packet; return whether that was the last one."""
    steps = job.steps(now)
    cmd, _ = next(steps)
    with pytest.raises(StopIteration):
        steps.send(Packet(0, 1, cmd | 0x40, 0, 1, bytes(2 * job.block.requests[0].words)))
    job.ended(None)
    return not job.is_unfinished


def test_packets_that_took_too_long_together_are_no_value() -> None:
    clock = StillClock()
    clock.late = 9.0  # the process stood still, but before the read
    job = ReadJob(make_block(100, 'N7:0', 236), [], clock, lambda job, words, error: None, 0.5)
    assert not is_last_packet_read(job, 1.0)
    clock.now = 1.6
    steps = job.steps(1.6)
    cmd, _ = next(steps)
    with pytest.raises(ReadTooOld, match=r'its packets took 0\.6 s, more than 0\.5 s') as error:
        steps.send(Packet(0, 1, cmd | 0x40, 0, 1, bytes(236)))
    job.ended(error.value)
    assert job.is_unfinished  # due at once, and no call gets this for an answer


def test_packet_that_a_call_wants_leaves_the_others_three_times_its_time() -> None:
    long, other = make_job(length=236), make_job()
    long.wanted = 0.0
    queue = make_queue(make_job(1000), other, long)
    packet, taken = block_time(long.block) / 2, []
    for now in (0.0, 3.9 * packet, 4 * packet):
        taken.append(job := queue.take(now))
        queue.put(job, 0.0)
    assert taken == [long, other, long]


def test_long_read_begins_anew_after_an_error() -> None:
    job = make_job(length=200)
    assert not is_last_packet_read(job, 1.0)
    assert (job.is_unfinished, job.started, job.reply_size) == (True, 1.0, 164)
    next(job.steps(2.0))
    job.ended(RemoteError(0x10, 0, 'refused'))
    assert (job.is_unfinished, job.started) == (False, 1.0)
    assert not is_last_packet_read(job, 3.0)
    assert job.started == 3.0
    job.interrupted()
    assert (job.is_unfinished, job.reply_size) == (False, 236)


def test_words_of_before_an_outage_do_not_go_into_the_read_after_it() -> None:
    taken: list[bytes | None] = []
    job = ReadJob(make_block(100, 'N7:0', 236), [], StillClock(),
                  lambda job, words, error: taken.append(words), math.inf)
    assert not is_last_packet_read(job, 1.0)
    job.interrupted()
    assert not is_last_packet_read(job, 3.0)
    assert job.started == 3.0
    assert is_last_packet_read(job, 3.1)
    assert taken[:2] == [None, None] and taken[2] is not None
    assert len(taken[2]) == 2 * 236
