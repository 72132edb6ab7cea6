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
import math

from abdf1_ros.driver.agenda import MAX_WRITES_IN_A_ROW, QUESTION_PERIOD
from abdf1_ros.driver.job_tasks import Job
from abdf1_ros.driver.kernel.gate import Rank
from abdf1_ros.driver.reads.job import ReadJob
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.settings.heartbeats import Fallback
import pytest
from support.agenda_bench import Bench, make_job, written
from support.interlocks import FALLBACK
from support.mappings import make_mapping

WORD = make_mapping('N7:5', 'Write')
OTHER = make_mapping('N7:6', 'Write')
BIT = make_mapping('B3:0/5', 'Write')


def test_reads_come_when_they_are_due_and_the_period_counts_from_then() -> None:
    slow, fast = make_job('N7:0', period=1000), make_job('N9:0', period=100)
    bench = Bench(slow, fast)
    assert [bench.read(0.0), bench.read(0.0), bench.read(0.0)] == [fast, slow, None]
    assert bench.agenda.next_due() == 0.1
    assert bench.read(0.099) is None
    assert bench.read(0.1) is fast
    assert [bench.read(time / 10 + 0.01) for time in range(2, 10)] == [fast] * 8
    assert {bench.read(1.01), bench.read(1.01)} == {slow, fast}
    job = make_job(period=100)
    bench = Bench(job)
    assert bench.read(0.03, took=0.05) is job
    assert job.due == 0.1


def test_read_that_is_too_old_each_time_does_not_go_first_each_time() -> None:
    """Its packets always take too long, or the process stands still in each of them."""
    old, others = make_job('N7:0'), [make_job(f'N9:{at}') for at in (0, 50, 100)]
    bench = Bench(old, *others)
    found: Counter[ReadJob | None] = Counter()
    for turn in range(40):
        old.is_unfinished = True  # as after ReadTooOld
        found[bench.read(0.1 * turn, took=0.09)] += 1
    assert found == dict.fromkeys([old, *others], 10)


@pytest.mark.parametrize(('fallback', 'limits'), [
    (None, (3.5, 2.5, math.inf)), (FALLBACK, (2.0, 1.0, 2.0)),
    (Fallback((7,), 9000), (3.5, 2.5, 10.5))])
def test_message_has_its_patience_and_a_fallback_bounds_all_packets(
        fallback: Fallback | None, limits: tuple[float, float, float]) -> None:
    bench, row = Bench(), make_mapping('N7:5', 'Write', fallback=fallback)
    for published in (1.0, 0.75):  # equal ones; the younger counts
        bench.write(row, 1, published)
    turn = bench.kernel.next(1.0, Rank.MESSAGE)
    assert turn is not None and (turn.expires, turn.patience, turn.latest) == limits


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

    def ended(self, error: Exception | None) -> None:
        """Pass over the end."""


def test_connection_that_is_unheard_again_has_its_quick_questions_again() -> None:
    bench = Bench(make_job(period=0))

    def ask() -> bool:
        if (job := bench.next(0.0)) is None:
            return False
        assert isinstance(job, ReadJob)
        bench.finish(job, 0.0, 0.0)
        return True

    for _ in range(2):
        bench.tasks.connect()
        assert ask() and bench.agenda.next_due() == 0.0
        assert [ask() for _ in range(11)] == 9 * [True] + 2 * [False]
        assert bench.agenda.next_due() == QUESTION_PERIOD
        bench.tasks.is_heard = True
        assert ask()


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
    _, other, new = (bench.write(WORD, 1, 0.0), bench.write(OTHER, 2, 0.1),
                     bench.write(WORD, 3, 0.2))
    assert [bench.next(0.5), bench.next(0.5), bench.next(0.5)] == [new, other, None]
    result, = bench.results
    assert (result.mapping, result.value, result.outcome, result.latency) == (
        WORD, '[1]', Outcome.SUPERSEDED, 0.2)
    assert str(result) == 'not written: superseded by a newer value'


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
    bench.add(Write(both, [5, 5], 0.4))
    for value in (6, 7):  # of two values that come after it, the newer one alone
        bench.write(WORD, value, 0.5)
    assert bench.outcomes() == [Outcome.SUPERSEDED] * 2


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


def test_broadcast_keeps_its_place_among_the_writes_of_every_station() -> None:
    bench = Bench()
    writes = [bench.write(make_mapping(text, 'Write', station=station), 1, 0.0)
              for text, station in (('N7:5', 1), ('N7:9', 255), ('N7:0', 2))]
    assert bench.begin_write(0.0, busy={1}) is None
    assert [bench.next_write(0.0) for _ in writes] == writes


def test_youngest_message_is_the_one_published_last() -> None:
    bench, row = Bench(), make_mapping('B3:0/5', 'Write', fallback=Fallback((0,), 500))
    for value, published in ((1, 1.0), (0, 0.5)):
        bench.write(row, value, published)
    assert bench.waiting.youngest() == {row: 1.0}


def test_change_gives_way_to_a_newer_one_after_half_the_time_that_it_may_wait() -> None:
    bench, row = Bench(), make_mapping('B3:0/5', 'Write', fallback=Fallback((0,), 500))
    writes = [bench.write(row, value, 0.0) for value in (1, 0, 1, 0)]
    taken = [bench.next_write(now) for now in (0.125, 0.25, 0.375)]
    assert taken == [writes[0], writes[1], writes[3]]


def test_write_that_has_waited_too_long_is_not_sent() -> None:
    bench = Bench(write_timeout=2.0)
    bench.write(WORD, 1, 0.0)
    young = bench.write(OTHER, 2, 1.0)
    assert bench.next(2.001) is young
    result, = bench.results
    assert str(result) == 'not written: not sent: waited longer than 2 s for the line'
    assert result.latency == 2.001


def test_equal_messages_that_wait_as_one_write_end_each_at_its_time() -> None:
    bench = Bench(write_timeout=2.0)
    for published in (0.0, 0.25, 0.5):
        bench.write(BIT, 1, published)
    for now, ended in ((2.3, 2), (2.5, 3)):
        assert bench.begin_write(now, busy={1}) is None
        assert len(bench.results) == ended


def test_write_that_was_old_when_it_came_is_not_sent_late_behind_a_younger_one() -> None:
    bench = Bench(write_timeout=2.0)
    young = bench.write(WORD, 1, 1.0)
    bench.write(OTHER, 2, 0.0)
    assert bench.begin_write(2.5) is young
    assert bench.begun[young].expires == 1.0 + 2.0 + 2 * 0.25  # TX_Delay comes twice
    assert bench.next(2.5) is None
    assert [str(result.mapping.address) for result in bench.results] == ['N7:6']
    assert bench.outcomes() == [Outcome.NOT_SENT]
    young.stand_for(Write(WORD, [1], 0.5))
    assert (young.requested, young.oldest) == (1.0, 0.5)


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
    bench.kernel.drop('the cable is off', 1.0)
    assert bench.outcomes() == [Outcome.NOT_SENT] * 3
    assert {result.detail for result in bench.results} == {'the cable is off'}
    assert [result.latency for result in bench.results] == [1.0, 1.0, 0.5]
    assert bench.next(1.0) is None


@pytest.mark.parametrize('outcome', [Outcome.WRITTEN, Outcome.PARTLY, Outcome.BROADCAST])
def test_read_that_shows_a_write_is_due_at_once(outcome: Outcome) -> None:
    covers, beside = make_job('N7:5', period=10_000), make_job('N9:5', period=10_000)
    elsewhere = make_job('N7:5', station=2, period=10_000)
    bench = Bench(covers, beside, elsewhere)
    for _ in range(3):
        bench.read(0.0)
    write = bench.write(WORD, 1, 1.0)
    assert bench.next(1.0) is write
    bench.reads.write_ended(written(write, 1.5, outcome))
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
        assert len(bench.reads.queue.heaps[86_400.0]) <= 8
    assert (slow.due, other.due) == (86_400.0 + 999.0, 86_400.0)
    assert bench.read(86_400.0) is other


def test_reads_of_a_busy_station_are_passed_over_and_stay_due() -> None:
    one, other = make_job(station=1), make_job(station=2)
    bench = Bench(one, other)
    assert bench.next_read(0.0, busy={1}) is other
    assert bench.next_read(0.0, busy={1}) is None
    bench.finish(other, 0.0, 0.0)
    bench.stations[1].replies = 1  # the other station has not proven that it answers
    assert bench.reads.next_proven(9.0, busy={1}) == (None, True)
    assert bench.next_read(0.0) is one


def test_poll_cycle_is_that_of_the_slowest_job() -> None:
    one, other = make_job(), make_job('N9:0')
    bench = Bench(one, other)
    one.done(1.0)
    assert bench.reads.poll_cycle is bench.reads.longest_poll_cycle is None
    one.done(1.5)
    other.done(1.0)
    other.done(3.0)
    assert bench.reads.poll_cycle == 2.0
    other.done(3.1)
    assert bench.reads.poll_cycle == 0.5
    assert bench.reads.longest_poll_cycle == 2.0
    for job in (one, other):
        job.interrupted()
    assert bench.reads.poll_cycle is None  # an outage does not count
    one.done(60.0)
    one.done(60.25)
    assert (bench.reads.poll_cycle, bench.reads.longest_poll_cycle) == (0.25, 2.0)
    assert one.intervals.usual == 0.5 + 0.125 * (0.25 - 0.5)


# Functions, as hypothesis of Ubuntu 24.04 parses the source of a lambda at each step.
