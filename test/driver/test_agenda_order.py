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

"""Whatever comes in any order, each has the line in the end."""

from __future__ import annotations

from collections import Counter
import itertools

from abdf1_ros.driver.reads.job import ReadJob
from abdf1_ros.driver.write import Write
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize, invariant, precondition, rule, RuleBasedStateMachine
from support.agenda_bench import Bench, make_job, written
from support.mappings import make_mapping


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
        self.bench.kernel.drop('port', self.now)
        assert self.bench.begin_write(self.now) is None

    @invariant()
    def every_write_is_in_one_place(self) -> None:
        assert len(self.accepted) == len(self.sent) + len(self.bench.results) \
            + len(self.bench.waiting.writes)

    @invariant()
    def every_job_is_in_one_place(self) -> None:
        reads = self.bench.reads
        entries = itertools.chain(*reads.queue.heaps.values())
        queued = [job for _, ticket, job in entries
                  if ticket == job.ticket and job in reads.jobs and job not in self.taken]
        parked = [job for jobs in reads.aside.values() for job in jobs]
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
