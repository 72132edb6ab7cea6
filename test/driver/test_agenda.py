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

"""Who has the line next, on a clock that the test moves."""

from __future__ import annotations

from collections import Counter
from collections.abc import Container
import itertools
import math

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.probes import Asker
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.agenda import Agenda, MAX_WRITES_IN_A_ROW
from abdf1_ros.driver.checks import Checks
from abdf1_ros.driver.guests import GuestQueue
from abdf1_ros.driver.interlocks.queue import Interlocks
from abdf1_ros.driver.job_tasks import Job, JobTasks
from abdf1_ros.driver.reads.job import ReadJob
from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.driver.reads.readings import Readings
from abdf1_ros.driver.record import Claim, WriteRecord
from abdf1_ros.driver.served import Served
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome, Write, WriteResult
from abdf1_ros.driver.writes.queue import MessageJob, WriteQueue
from abdf1_ros.driver.writes.under_way import WritesUnderWay
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.families import PlcType
from abdf1_ros.plan.line_model import LineModel
from abdf1_ros.plan.planner import Planner
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize, invariant, precondition, rule, RuleBasedStateMachine
import pytest
from support.driver_bench import Recorder
from support.mappings import make_mapping

PROBE_TIME = 0.5
LINE = LineModel(Checksum.CRC, Duplex.HALF, LineTiming(0.001))


class StillClock:
    """The time of a line, which stands still."""

    now = late = 0.0

    def took(self, begun: float, now: float) -> float:
        """Return the seconds between two clock values."""
        return now - begun


def make_job(text: str = 'N7:0', station: int = 1, period: int = 100) -> ReadJob:
    mapping = make_mapping(text, station=station, period=period)
    block, = Planner(LINE, 0.1).plan([mapping])
    return ReadJob(block, [ReadPoint(mapping, period / 1000, 1.0)], StillClock(),
                   lambda job, words, error: None, math.inf)


def written(write: Write, now: float) -> Claim:
    """Return a write that has been confirmed."""
    claim = Claim(write.mapping.station, [write.mapping.extent], write)
    claim.done = claim.lands_until = now
    return claim


class Bench:
    """An agenda without checks, whose jobs are done by hand."""

    def __init__(self, *jobs: ReadJob, write_timeout: float = 2.0) -> None:
        self.results: list[WriteResult] = []
        self.begun: dict[Write, MessageJob] = {}
        self.stations = ActiveStationList([job.station for job in jobs], probe_time=PROBE_TIME)
        self.tasks, line = JobTasks(5, 0), StillClock()
        listener = Recorder(lambda: 0.0)
        self.record = WriteRecord(line, 1.0)
        readings = Readings(Network(), Rows(), DriverSettings(), self.stations, line, listener,
                            self.record)
        writing = WritesUnderWay(self.stations, self.record, readings, write_timeout,
                                 self.results.append)
        self.reads = readings.reads
        self.writes = WriteQueue(self.stations, writing, write_timeout, self.results.append)
        checks = Checks(self.stations, {job.station for job in jobs}, 0.0, line,
                        readings.link_failed, lambda station, identity, asked: None)
        checks.begin(0.0)
        served = Served(PlcType.PLC5, Rows(), readings.served)
        interlocks = Interlocks(Rows(), self.writes, writing, served, listener,
                                lambda mapping, text, is_conflict: None)
        guests = GuestQueue(self.stations, line, 1.0, lambda dst: dst,
                            lambda command, station: [], self.record)
        self.agenda = Agenda(
            self.stations, interlocks, self.writes, checks, self.reads, guests, self.tasks)
        self.reads.replace((), jobs, 0.0)

    def next(self, now: float) -> object:  # noqa: A003
        """Return who has the line next; a write ends at once."""
        job = self.agenda.next(now)
        if not isinstance(job, MessageJob):
            return job
        self.end(job)
        return job.write

    def end(self, job: MessageJob) -> None:
        """Let a write end unsent."""
        self.record.ended(job.claim, Outcome.NOT_SENT)

    def begin_write(self, now: float, busy: Container[int] = ()) -> Write | None:
        """Take the next write, which is under way from then on."""
        job = self.writes.next(now, busy)
        if job is not None:
            self.begun[job.write] = job
        return job and job.write

    def next_write(self, now: float) -> Write | None:
        """Take the next write, which ends at once."""
        write = self.begin_write(now)
        if write is not None:
            self.end(self.begun[write])
        return write

    def next_read(self, now: float, busy: Container[int] = ()) -> ReadJob | None:
        """Take the next probe or read."""
        return self.agenda._read(now, busy)

    def read(self, now: float, took: float = 0.0) -> ReadJob | None:
        """Take the next read and give it back done."""
        job = self.next_read(now)
        if job is not None:
            self.finish(job, now, now + took)
        return job

    def finish(self, job: ReadJob, started: float, now: float) -> None:
        """Give a read back that was made from ``started`` to ``now``."""
        job.started = job.asked = started
        self.reads.ended(job, now)

    def write(self, mapping: Mapping, value: float, now: float) -> Write:
        write = Write(mapping, [value], now)
        self.add(write)
        return write

    def add(self, write: Write) -> None:
        self.writes.add(write, write.requested)

    def outcomes(self) -> list[Outcome]:
        return [result.outcome for result in self.results]


WORD = make_mapping('N7:5', 'Write')
OTHER = make_mapping('N7:6', 'Write')
BIT = make_mapping('B3:0/5', 'Write')


def test_reads_come_when_they_are_due() -> None:
    slow, fast = make_job('N7:0', period=1000), make_job('N9:0', period=100)
    bench = Bench(slow, fast)
    assert [bench.read(0.0), bench.read(0.0), bench.read(0.0)] == [fast, slow, None]
    assert bench.agenda.next_due() == 0.1
    assert bench.read(0.099) is None
    assert bench.read(0.1) is fast
    assert [bench.read(time / 10 + 0.01) for time in range(2, 10)] == [fast] * 8
    assert {bench.read(1.01), bench.read(1.01)} == {slow, fast}


def test_period_counts_from_the_due_time_and_not_from_the_end() -> None:
    job = make_job(period=100)
    bench = Bench(job)
    assert bench.read(0.03, took=0.05) is job
    assert job.due == 0.1


def test_four_writes_in_a_row_and_then_a_read_that_is_due() -> None:
    job = make_job(period=0)
    bench = Bench(job)
    writes = [bench.write(BIT, n % 2, 0.0) for n in range(10)]
    order = []
    for _ in range(12):
        taken = bench.next(0.0)
        order.append(taken)
        if isinstance(taken, ReadJob):
            bench.finish(taken, 0.0, 0.0)
    assert MAX_WRITES_IN_A_ROW == 4
    assert order == [*writes[:4], job, *writes[4:8], job, *writes[8:]]


class NinePackets(Job):
    """As many requests."""

    station = 1

    def steps(self, now: float) -> Steps[None]:
        """Yield them."""
        for _ in range(9):
            yield 0x0F, b''


def test_packets_of_a_long_write_use_up_the_turn_of_writes() -> None:
    read = make_job()
    bench = Bench(read)
    write = bench.write(WORD, 1, 0.0)
    assert bench.next(0.0) is write
    job = NinePackets().start(bench.tasks, 0.0)
    for _ in range(MAX_WRITES_IN_A_ROW - 1):
        job.reply(job.command.reply())
        assert bench.next(0.0) is job
    another = bench.write(WORD, 2, 0.0)
    assert bench.next(0.0) is read
    assert bench.next(0.0) is another


def test_new_writes_and_packets_of_a_long_one_take_turns() -> None:
    bench = Bench()
    job = NinePackets().start(bench.tasks, 0.0)
    job.reply(job.command.reply())
    writes = [bench.write(make_mapping(f'N7:{20 + n}', 'Write'), n, 0.0) for n in range(4)]
    order = []
    for _ in range(8):
        taken = bench.next(0.0)
        order.append(taken)
        if taken is job:
            job.reply(job.command.reply())
    assert order in ([job, writes[0], job, writes[1], job, writes[2], job, writes[3]],
                     [writes[0], job, writes[1], job, writes[2], job, writes[3], job])


def test_packets_of_a_long_write_keep_their_turn_while_their_station_is_polled() -> None:
    """Else new writes to a station take all turns of a line with standard polling."""
    bench = Bench()
    job = NinePackets().start(bench.tasks, 0.0)
    job.reply(job.command.reply())
    order = []
    for number in range(6):
        bench.write(make_mapping(f'N7:{20 + number}', 'Write'), 1, 0.0)
        taken = bench.next(0.0)
        order.append(taken is job)
        if taken is job:
            job.reply(job.command.reply())
        assert bench.agenda.next(0.0, frozenset({1})) is None
    assert order.count(True) == 3


def test_probe_of_an_inactive_station_has_its_turn_among_writes() -> None:
    bench = Bench(make_job(station=9))
    bench.stations.lost(9, 0.0)
    bench.read(0.0)
    assert bench.next_read(0.0) is not None  # the first probe
    late = make_job('N9:0', station=9)
    bench.reads.replace((), [late], 0.0)
    writes = [bench.write(BIT, n % 2, 0.0) for n in range(6)]
    assert [bench.next(0.0) for _ in range(7)] == [*writes[:5], late, *writes[5:]]


def test_waiting_writes_of_a_word_collapse_to_the_newest() -> None:
    bench = Bench()
    old, other, new = (bench.write(WORD, 1, 0.0), bench.write(OTHER, 2, 0.1),
                       bench.write(WORD, 3, 0.2))
    assert [bench.next(0.5), bench.next(0.5), bench.next(0.5)] == [new, other, None]
    result, = bench.results
    assert (result.mapping, result.value, result.outcome, result.latency) == (
        WORD, '[1]', Outcome.SUPERSEDED, 0.2)
    assert str(result) == 'not written: superseded by a newer value'
    assert old is not new


def test_newer_value_does_not_overtake_what_was_asked_for_meanwhile_of_the_same_words() -> None:
    bench, both = Bench(), make_mapping('N7:5', 'Write', length=2)
    old = bench.write(WORD, 1, 0.0)
    between = Write(both, [2, 2], 0.1)
    bench.add(between)
    bench.write(WORD, 3, 0.2)
    new = bench.write(WORD, 4, 0.3)
    taken = [bench.next(0.5) for _ in range(4)]
    assert [taken[0], taken[1:]] == [old, [between, new, None]]
    assert bench.outcomes() == [Outcome.SUPERSEDED]


def test_topics_of_the_same_words_that_never_rest_share_the_line() -> None:
    bench, both = Bench(), make_mapping('N7:5', 'Write', length=2)
    sent = Counter[str]()
    for turn in range(300):
        for mapping in (WORD, both, OTHER):
            bench.add(Write(mapping, [turn] * mapping.length, turn / 10))
        write = bench.next_write(turn / 10)
        assert write is not None
        sent[write.mapping.tag + str(write.mapping.length)] += 1
    assert min(sent.values()) > 60
    assert len(sent) == len({(mapping.tag, mapping.length) for mapping in (WORD, both, OTHER)})


def test_writes_of_the_same_words_are_never_under_way_together() -> None:
    bench, elsewhere = Bench(), make_mapping('N7:0', 'Write', station=2)
    first, second = bench.write(BIT, 1, 0.0), bench.write(BIT, 0, 0.0)
    behind, other = bench.write(WORD, 1, 0.0), bench.write(elsewhere, 1, 0.0)
    assert bench.begin_write(0.0) is first
    assert bench.begin_write(0.0) is other  # but not another of the same station, out of turn
    assert bench.begin_write(0.0) is None
    bench.end(bench.begun[first])
    assert bench.begin_write(0.0) is second
    assert bench.begin_write(0.0) is behind
    assert bench.begin_write(0.0) is None


def test_write_that_has_waited_too_long_is_not_sent() -> None:
    bench = Bench(write_timeout=2.0)
    bench.write(WORD, 1, 0.0)
    young = bench.write(OTHER, 2, 1.0)
    assert bench.next(2.001) is young
    result, = bench.results
    assert str(result) == 'not written: not sent: waited longer than 2 s for the line'
    assert result.latency == 2.001


def test_write_that_was_old_when_it_came_is_not_sent_late_behind_a_younger_one() -> None:
    bench = Bench(write_timeout=2.0)
    young = bench.write(WORD, 1, 1.0)
    bench.write(OTHER, 2, 0.0)
    assert bench.next(2.5) is young
    assert bench.next(2.5) is None
    assert [str(result.mapping.address) for result in bench.results] == ['N7:6']
    assert bench.outcomes() == [Outcome.NOT_SENT]


def test_writes_that_were_too_old_do_not_use_up_the_turn_of_writes() -> None:
    bench = Bench(make_job(), write_timeout=1.0)
    for n in range(5):
        bench.write(BIT, n % 2, 0.0)
    young = [bench.write(BIT, n % 2, 5.0) for n in range(4)]
    assert [bench.next(5.0) for _ in range(4)] == young


def test_dropped_writes_all_have_their_result() -> None:
    bench = Bench()
    bench.write(BIT, 1, 0.0)
    bench.next(0.0)
    for n in range(3):
        bench.write(BIT, n % 2, 0.0)
    bench.begin_write(0.0)
    bench.write(WORD, 1, 0.5)
    bench.writes.drop('the cable is off', 1.0)
    assert bench.outcomes() == [Outcome.NOT_SENT] * 3
    assert {result.detail for result in bench.results} == {'the cable is off'}
    assert [result.latency for result in bench.results] == [1.0, 1.0, 0.5]
    assert bench.next(1.0) is None


def test_reads_of_an_inactive_station_are_set_aside() -> None:
    dead, living = make_job(station=1), make_job('N9:0', station=2)
    bench = Bench(dead, living)
    assert bench.next_read(0.0) is dead
    bench.stations.lost(1, 0.5)
    bench.finish(dead, 0.0, 0.5)
    assert bench.read(0.5) is living
    assert [bench.read(0.5 + n / 10) for n in range(1, 35)] == [living] * 34
    assert bench.read(4.0) is dead  # 7 times the probe time after the last


def _simulate(dead: list[ReadJob], living: list[ReadJob], seconds: float,
              silence: float) -> Counter[int]:
    """Return how often each station was read while it takes ``silence`` s to find some dead."""
    bench = Bench(*dead, *living)
    lost = {job.station for job in dead}
    now, reads = 0.0, Counter[int]()
    while now < seconds:
        job = bench.next_read(now)
        if job is None:
            due = bench.agenda.next_due()
            assert due is not None
            now = max(now + 1e-3, due)
            continue
        started = now
        if job.station in lost:
            now += silence
            bench.stations.lost(job.station, now)
        else:
            now += silence / 25
            bench.stations.heard(job.station, now)
        reads[job.station] += 1
        bench.finish(job, started, now)
    return reads


@pytest.mark.parametrize('silence', [PROBE_TIME, 4 * PROBE_TIME])
def test_dead_stations_take_no_more_than_an_eighth_of_a_busy_line(silence: float) -> None:
    dead = [make_job(f'N{file}:0', station=station) for station in range(1, 6)
            for file in (7, 9, 10)]
    living = [make_job(f'N{file}:0', station=99, period=0) for file in (7, 9)]
    seconds = 800 * silence
    reads = _simulate(dead, living, seconds, silence)
    lost_time = sum(reads[station] for station in range(1, 6)) * silence
    assert 0.9 / 8 < lost_time / seconds < 1.1 / 8
    assert reads[99] * silence / 25 > 0.85 * seconds
    probes = [reads[station] for station in range(1, 6)]
    assert max(probes) - min(probes) <= 1


def test_writes_and_reads_take_turns_at_a_silent_station() -> None:
    silent, living = make_job(station=2, period=0), make_job(period=0)
    bench = Bench(silent, living)
    bench.stations.lost(2, 0.0)
    now, turns = 0.0, ''
    while now < 100:
        bench.write(make_mapping('N7:5', 'Write', station=2), 1, now)
        job, begun = bench.next(now), now
        now += 0.02 if job is living else 1.0
        if isinstance(job, Write):
            bench.stations.tried(
                2, begun, now, was_silent=job.is_probe, asker=Asker.MESSAGE)
            turns += 'w'
        else:
            assert isinstance(job, ReadJob)
            bench.finish(job, begun, now)
            turns += 'r' * (job is silent)
    assert len(turns) > 10
    assert turns in 'wr' * len(turns)


def test_station_that_replies_in_time_again_has_all_its_reads_at_once() -> None:
    late, other, living = make_job(), make_job('N9:0'), make_job(station=2)
    bench = Bench(late, other, living)
    bench.stations[1].overdue = 2
    assert [bench.read(0.0), bench.next_read(0.0)] == [living, late]
    bench.stations[1].overdue = 0
    bench.finish(late, 0.0, 0.02)
    assert bench.next_read(0.02) is other


def test_all_reads_are_due_when_the_line_is_back_and_none_of_them_twice() -> None:
    fast, slow, dead = make_job('N7:0'), make_job('N9:0', period=60000), make_job(station=2)
    bench = Bench(fast, slow, dead)
    bench.stations.lost(2, 0.0)
    assert {bench.read(0.0), bench.read(0.0), bench.read(0.01)} == {fast, slow, dead}
    bench.reads.begin(5.0)
    assert [bench.read(5.0, took=PROBE_TIME), bench.read(5.01), bench.read(5.02)] == [
        dead, fast, slow]
    assert bench.read(5.03) is None


def test_station_that_is_back_is_not_read_twice_for_what_it_has_missed() -> None:
    job = make_job()
    bench = Bench(job)
    bench.stations.lost(1, 0.0)
    assert bench.next_read(0.0) is None
    assert bench.next_read(8.0) is job
    bench.stations.heard(1, 8.01)
    bench.finish(job, 8.0, 8.02)
    assert bench.agenda.next_due() == 8.1


def test_station_that_a_write_has_brought_back_has_its_reads_at_once() -> None:
    job = make_job(station=1)
    bench = Bench(job, make_job(station=2))
    bench.stations.lost(1, 0.0)
    probe = bench.next_read(0.0) or bench.next_read(0.0)
    while probe is not job:
        assert probe is not None
        bench.finish(probe, 0.0, 0.0)
        probe = bench.next_read(0.0)
    bench.finish(job, 0.0, 0.5)
    assert job not in [bench.read(0.6), bench.read(0.6)]
    bench.stations.heard(1, 0.7)  # it refused a write, say
    assert job in [bench.read(0.7), bench.read(0.7)]


def test_read_that_shows_a_write_is_due_at_once() -> None:
    covers, beside = make_job('N7:5', period=10_000), make_job('N9:5', period=10_000)
    elsewhere = make_job('N7:5', station=2, period=10_000)
    bench = Bench(covers, beside, elsewhere)
    for _ in range(3):
        bench.read(0.0)
    write = bench.write(WORD, 1, 1.0)
    assert bench.next(1.0) is write
    bench.reads.write_ended(written(write, 1.5))
    assert bench.agenda.next_due() == 1.5
    assert [bench.read(1.5), bench.read(1.5)] == [covers, None]
    assert bench.read(5.0) is None  # the entry of before is void
    assert covers.due == 11.5
    assert bench.read(11.4) in (beside, elsewhere)


def test_writes_that_refresh_a_slow_read_leave_no_entries() -> None:
    slow, other = make_job('N7:5', period=86_400_000), make_job('N9:5', period=86_400_000)
    bench = Bench(slow, other)
    assert [bench.read(0.0), bench.read(0.0)] == [slow, other]
    for second in range(1, 1000):
        write = bench.write(WORD, 1, float(second))
        assert bench.next(float(second)) is write
        bench.reads.write_ended(written(write, float(second)))
        assert [bench.read(float(second)), bench.read(float(second))] == [slow, None]
        assert len(bench.reads._due._heaps[86_400.0]) <= 8
    assert (slow.due, other.due) == (86_400.0 + 999.0, 86_400.0)
    assert bench.read(86_400.0) is other


def test_reads_of_a_busy_station_are_passed_over_and_stay_due() -> None:
    one, other = make_job(station=1), make_job(station=2)
    bench = Bench(one, other)
    assert bench.next_read(0.0, busy={1}) is other
    assert bench.next_read(0.0, busy={1}) is None
    assert bench.next_read(0.0) is one


def test_parts_replace_a_job() -> None:
    whole, left, right = make_job(), make_job('N7:1'), make_job('N7:2')
    bench = Bench(whole)
    assert bench.next_read(0.0) is whole
    bench.reads.replace([whole], [left, right], 0.0)
    bench.finish(whole, 0.0, 0.0)
    assert bench.reads.jobs == {left, right}
    assert [bench.read(0.0), bench.read(0.0), bench.read(0.0)] == [left, right, None]


def test_poll_cycle_is_that_of_the_slowest_job() -> None:
    one, other = make_job(), make_job('N9:0')
    bench = Bench(one, other)
    one.done(1.0)
    assert bench.reads.poll_cycle is None
    one.done(1.5)
    other.done(1.0)
    other.done(3.0)
    assert bench.reads.poll_cycle == 2.0
    other.done(3.1)
    assert bench.reads.poll_cycle == 0.5
    assert bench.reads.longest_poll_cycle == 2.0


def test_poll_cycle_does_not_count_an_outage() -> None:
    job = make_job()
    bench = Bench(job)
    assert bench.reads.longest_poll_cycle is None
    job.done(1.0)
    job.done(1.5)
    job.interrupted()
    assert bench.reads.poll_cycle is None
    job.done(60.0)
    job.done(60.25)
    assert (bench.reads.poll_cycle, bench.reads.longest_poll_cycle) == (0.25, 0.5)


# Functions, as hypothesis of Ubuntu 24.04 parses the source of a lambda at each step.
def _has_taken(machine: AnyOrder) -> bool:
    return bool(machine.taken)


def _may_split(machine: AnyOrder) -> bool:
    return bool(machine.taken) and machine.spare < 40


class AnyOrder(RuleBasedStateMachine):
    """Whatever happens in whatever order, nothing is lost and nothing is there twice."""

    @initialize()
    def start(self) -> None:
        self.now = 0.0
        self.jobs = [make_job(f'N{file}:0', station, period) for station in (1, 2)
                     for file, period in ((7, 0), (9, 100), (10, 1000))]
        self.bench = Bench(*self.jobs)
        self.taken: list[ReadJob] = []
        self.accepted: list[Write] = []
        self.sent: list[Write] = []
        self.spare = 20

    @rule(seconds=st.sampled_from([0.0, 0.01, 0.1, 0.5, 3.0]))
    def time_passes(self, seconds: float) -> None:
        self.now += seconds

    @rule(busy=st.frozensets(st.integers(1, 2)))
    def take_read(self, busy: frozenset[int]) -> None:
        job = self.bench.next_read(self.now, busy)
        if job is not None:
            assert job not in self.taken
            self.taken.append(job)

    @precondition(_has_taken)
    @rule(answers=st.booleans(), which=st.integers(0, 5))
    def finish_read(self, answers: bool, which: int) -> None:
        job = self.taken.pop(which % len(self.taken))
        self.change_station(job.station, answers)
        self.bench.finish(job, self.now, self.now)

    @precondition(_may_split)
    @rule()
    def replace_read(self) -> None:
        job = self.taken.pop()
        self.jobs.remove(job)
        self.spare += 2
        parts = [make_job(f'N{self.spare + n}:0', job.station) for n in range(2)]
        self.jobs += parts
        self.bench.reads.replace([job], parts, self.now)
        self.bench.finish(job, self.now, self.now)

    @rule(station=st.integers(1, 2), answers=st.booleans())
    def change_station(self, station: int, answers: bool) -> None:
        if answers:
            self.bench.stations.heard(station, self.now)
        else:
            self.bench.stations.lost(station, self.now)

    @rule(text=st.sampled_from(['N7:0', 'N9:0/3', 'N10:0']), station=st.integers(1, 2))
    def ask_for_write(self, text: str, station: int) -> None:
        mapping = make_mapping(text, 'Write', station=station)
        self.accepted.append(self.bench.write(mapping, 1, self.now))

    @rule(worked=st.booleans())
    def take_write(self, worked: bool) -> None:
        write = self.bench.next_write(self.now)
        if write is not None:
            self.sent.append(write)
            if worked:
                self.bench.stations.heard(write.mapping.station, self.now)
                self.bench.reads.write_ended(written(write, self.now))

    @rule()
    def drop(self) -> None:
        self.bench.writes.drop('port', self.now)
        assert self.bench.begin_write(self.now) is None

    @invariant()
    def every_write_is_in_one_place(self) -> None:
        assert len(self.accepted) == len(self.sent) + len(self.bench.results) \
            + len(self.bench.writes)

    @invariant()
    def every_job_is_in_one_place(self) -> None:
        reads = self.bench.reads
        entries = itertools.chain(*reads._due._heaps.values())
        queued = [job for _, ticket, job in entries
                  if ticket == job.ticket and job in reads.jobs and job not in self.taken]
        parked = [job for jobs in reads._aside.values() for job in jobs]
        assert reads.jobs == set(self.jobs)
        # A job that was popped and parked keeps its ticket, but its entry is gone.
        assert Counter(queued + parked + self.taken) == Counter(self.jobs)

    def teardown(self) -> None:
        """Let everything answer: then every job is read again."""
        for job in self.taken:
            self.bench.finish(job, self.now, self.now)
        for station in (1, 2):
            self.bench.stations.heard(station, self.now)
        self.now += 100.0
        seen = set()
        for _ in range(10 * len(self.jobs)):
            job = self.bench.read(self.now)
            seen.add(job)
            self.now += 0.3
        assert seen >= set(self.jobs)


TestAnyOrder = AnyOrder.TestCase
TestAnyOrder.settings = settings(max_examples=25, stateful_step_count=40)
