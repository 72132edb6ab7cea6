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

"""Who has the line next where stations are silent, or back again."""

from __future__ import annotations

from collections import Counter

from abdf1_ros.df1.probes import Asker
from abdf1_ros.driver.reads.job import ReadJob
from abdf1_ros.driver.write import Write
import pytest
from support.agenda_bench import Bench, make_job, PROBE_TIME
from support.mappings import make_mapping


def test_reads_of_an_inactive_station_are_set_aside() -> None:
    dead, living = make_job(station=1, period=9000), make_job('N9:0', station=2)
    bench = Bench(dead, living)
    assert (bench.read(0.0), bench.next_read(0.0)) == (living, dead)
    for when in (0.1, 0.2):
        dead.done(when)
    bench.stations.lost(1, 0.5)
    bench.finish(dead, 0.0, 0.5)
    assert dead.intervals.last is None  # no read is counted over the outage
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
            now = max(now + 1e-3, bench.agenda.next_due())
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
    assert 0.9 / 8 < sum(reads[station] for station in range(1, 6)) * silence / seconds < 1.1 / 8
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
            bench.stations.tried(2, begun, now, was_silent=job.is_probe, asker=Asker.MESSAGE)
            turns += 'w'
        else:
            assert isinstance(job, ReadJob)
            bench.finish(job, begun, now)
            turns += 'r' * (job is silent)
    assert len(turns) > 10
    assert turns in 'wr' * len(turns)


def test_station_that_has_replied_once_goes_first_after_a_death() -> None:
    bench = Bench(make_job(station=1), proven := make_job(station=2))
    bench.stations[2].replies = 1
    bench.stations.probes.died(PROBE_TIME, 0.0)
    assert bench.agenda.next(0.0, {1, 2}) is None
    assert bench.next(0.0) is proven


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
    job = make_job(period=125)
    bench = Bench(job)
    bench.stations.lost(1, 0.0)
    assert bench.next_read(0.0) is None
    assert bench.read(6.0, took=PROBE_TIME) is job
    assert bench.agenda.next_due() == 6.625  # no station replies: one try in a Period
    assert bench.next_read(8.0) is job
    bench.stations.heard(1, 8.01)
    bench.finish(job, 8.0, 8.02)
    assert bench.agenda.next_due() == 8.125


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
