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
Run the node against the simulator on a pseudo-terminal, with faults, and show what it costs.

Both are processes of their own; this one publishes writes, counts their results and looks at
the node in /proc every few seconds. Time is divided into rounds. At the end of each the
simulator says what it has counted and goes away with its port, and a new one takes its place.
Every third round is quiet: then the counters of both ends have to be the same, but for the
one transaction that the end of the round cuts off, and one for each repetition that the node
counts, where a busy host answers late. In the other rounds stations fall silent,
are slow, full, noisy, refuse everything or change their mode, the node is stopped and goes
on, and the simulator is killed.

Status 1 when a write has no result or two, a read value was never in the PLC, a thread or a
descriptor is lost, memory grows, counters differ in a quiet round, or the node ends badly.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
import itertools
import os
from pathlib import Path
from random import Random
import signal
import statistics
import sys
import tempfile
import time
from typing import Any

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:4])

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus  # noqa: E402
from std_msgs.msg import Float32MultiArray, Int16MultiArray, UInt8MultiArray  # noqa: E402
from support.fault_rig import SETPOINT  # noqa: E402
from support.ros import details, EVERYTHING, find_status, Observer, Process  # noqa: E402
from support.simulator_process import Files, make_files  # noqa: E402

_STATIONS = (1, 2)
_ROUND = 60.0  # s
_SAMPLE_PERIOD = 5.0
_WRITE_PERIOD = 0.05
_PATIENCE = 30.0  # s for what has to happen

# MiB by which the second half of the run may exceed the first one.
_MOST_GROWTH = 2.0

# What a master counts, and the slaves with it.
_PAIRS = (
    ('CNT_CMD_MSGS_SENT', 'CNT_CMD_MSGS_RCVD'), ('CNT_REPLY_MSGS_RCVD', 'CNT_REPLY_MSGS_SENT'),
    ('CNT_MSG_PACKETS_SENT', 'CNT_MSG_PACKETS_RCVD'),
    ('CNT_MSG_PACKETS_RCVD', 'CNT_MSG_PACKETS_SENT'),
    ('CNT_POLL_MSGS_SENT', 'CNT_POLL_MSGS_RCVD'), ('CNT_ACKS_RCVD', 'CNT_ACKS_SENT'),
    ('CNT_ACKS_SENT', 'CNT_ACKS_RCVD'), ('CNT_EOTS_RCVD', 'CNT_EOTS_SENT'),
    ('CNT_ERROR_MSGS_RCVD', 'CNT_ERROR_MSGS_SENT'))

# By the node's name of a counter, what the node and what the slaves have counted.
_REPETITIONS = ('CNT_NAK_RETRIES', 'CNT_ENQ_RETRIES')

Counts = dict[str, tuple[int, int]]  # of the node, of the simulator

_FAULTS = (
    'silent {}', 'slow {} 3', 'delay {} 150', 'full {}', 'noise {} 0.001', 'noise {} 0.02',
    'error {} 50', 'error {} F0 0B', 'mode {} program')


@dataclass(frozen=True, slots=True)
class Sample:
    """What /proc tells about the node: memory in MiB, CPU in s."""

    memory: float
    threads: int
    descriptors: int
    cpu: float

    @classmethod
    def take(cls, process: int) -> Sample:
        """Look at a process."""
        status = Path(f'/proc/{process}/status').read_text(encoding='ascii')
        fields = dict(line.split(':\t', 1) for line in status.splitlines() if ':\t' in line)
        times = Path(f'/proc/{process}/stat').read_text(encoding='ascii').rpartition(')')[2]
        ticks = sum(map(int, times.split()[11:13]))
        return cls(int(fields['VmRSS'].split()[0]) / 1024, int(fields['Threads']),
                   len(os.listdir(f'/proc/{process}/fd')), ticks / os.sysconf('SC_CLK_TCK'))


class Writer:
    """Publish to write topics, and count the results of each."""

    def __init__(self, observer: Observer, random: Random) -> None:
        self.asked: Counter[str] = Counter()
        self.results: Counter[str] = Counter()
        self.outcomes: Counter[str] = Counter()
        self.slowest = 0.0
        self.reads = self.wrong_values = 0
        self._random = random
        self._asked_values = {SETPOINT}
        self._next_time = 0.0
        self._inbox = observer.node.create_subscription(
            DiagnosticStatus, '/abdf1/write_results', self._take, EVERYTHING)
        self._reading = observer.node.create_subscription(
            Float32MultiArray, '/abdf1/read/setpoint', self._read, EVERYTHING)
        self._publishers: dict[str, tuple[Any, Any, Callable[[], list[Any]]]] = {
            tag: (observer.publisher(kind, f'/abdf1/write/{tag}'), kind, values)
            for tag, kind, values in (
                ('setpoint', Float32MultiArray, self._new_setpoint),
                ('reset', UInt8MultiArray, lambda: [random.randrange(2)]),
                ('recipe', Int16MultiArray, lambda: random.choices(range(1100), k=4)),
                ('flags', UInt8MultiArray, lambda: random.choices(range(2), k=3)))}

    def _new_setpoint(self) -> list[Any]:
        value = self._random.randrange(-400, 1200) / 8  # exact as a float32
        self._asked_values.add(value)
        return [value]

    def _take(self, result: DiagnosticStatus) -> None:
        self.results[result.name] += 1
        self.outcomes[result.message.partition(':')[0]] += 1
        self.slowest = max(self.slowest, float(details(result)['latency_ms']) / 1000)

    def _read(self, message: Any) -> None:
        self.reads += 1
        self.wrong_values += message.data[0] not in self._asked_values

    def work(self) -> None:
        """Publish what is due."""
        now = time.monotonic()
        if now < self._next_time:
            return
        self._next_time = now + self._random.uniform(0.0, 2 * _WRITE_PERIOD)
        tag = self._random.choice(list(self._publishers))
        publisher, kind, values = self._publishers[tag]
        self.asked[tag] += 1
        publisher.publish(kind(data=values()))


class LongRun:
    """The node, the simulator, and what was found."""

    def __init__(self, files: Files, observer: Observer, node: Process, seed: int) -> None:
        self.samples: list[Sample] = []
        self.faults: Counter[str] = Counter()
        self.problems: list[str] = []
        self._files = files
        self._observer = observer
        self._node = node
        self._random = Random(seed)
        self._diagnostics: DiagnosticArray | None = None
        self._next_sample = 0.0
        self._simulator = files.start_simulator()
        self._subscription = observer.node.create_subscription(
            DiagnosticArray, '/diagnostics', self._take_diagnostics, EVERYTHING)
        self.writer = Writer(observer, self._random)

    def __str__(self) -> str:
        """Return how it goes."""
        sample = self.samples[-1]
        return (f'{self.writer.asked.total():>7} writes {self.writer.results.total():>7} results '
                f'{self.writer.reads:>7} values, {sample.memory:.1f} MiB, {sample.threads} '
                f'threads, {sample.descriptors} descriptors, {sample.cpu:.0f} s of CPU')

    @property
    def log_lines(self) -> int:
        """Return how much the node has logged."""
        return len(self._node.lines)

    def _take_diagnostics(self, array: DiagnosticArray) -> None:
        if array.status[0].hardware_id == str(self._files.port):
            self._diagnostics = array

    def run(self, seconds: float, is_writing: bool = True) -> None:
        """Publish and look for a while."""
        end = time.monotonic() + seconds
        self._until(lambda: time.monotonic() >= end, 'the time', seconds + _PATIENCE, is_writing)

    def _until(self, condition: Callable[[], bool], what: str,
               patience: float = _PATIENCE, is_writing: bool = True) -> None:
        give_up = time.monotonic() + patience
        while not condition():
            if is_writing:
                self.writer.work()
            if time.monotonic() >= self._next_sample:
                self._next_sample = time.monotonic() + _SAMPLE_PERIOD
                self.samples.append(Sample.take(self._node.number))
            self._observer.executor.spin_once(timeout_sec=0.01)
            if time.monotonic() > give_up:
                raise AssertionError(f'waited {patience:.0f} s for {what}')

    def _link_is(self, text: str) -> bool:
        return self._diagnostics is not None and \
            text in find_status(self._diagnostics, 'link').message

    def until_well(self) -> None:
        """Wait until everything is read."""
        self._until(lambda: self._link_is('2 of 2 stations have answered'), 'both stations')

    def disturb(self, seconds: float) -> None:
        """Let one fault after the other happen for so long."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            kind = self._random.choice([*_FAULTS, 'kill', 'stop'])
            self.faults[kind.replace(' {}', '')] += 1
            length = min(left, self._random.uniform(0.5, 6.0))
            if kind == 'kill':
                self._kill(length)
            elif kind == 'stop':
                self._stop_node(length)
            else:
                self._spoil(kind, length)
            self.run(min(max(0.0, end - time.monotonic()), self._random.uniform(0.0, 5.0)))

    def clean_up(self) -> None:
        """End the simulator of a run that has failed."""
        if self._simulator.is_running:
            self._simulator.send(signal.SIGTERM)
        self._simulator.result()

    def _spoil(self, kind: str, seconds: float) -> None:
        station = self._random.choice(_STATIONS)
        self._simulator.say(kind.format(station))
        self.run(seconds)
        self._simulator.say(f'normal {station}')
        self._simulator.say(f'mode {station} run')

    def _kill(self, seconds: float) -> None:
        # The name would stay, and soon lead to the terminal of another program.
        self._files.port.unlink(missing_ok=True)
        self._simulator.send(signal.SIGKILL)
        self._simulator.result()
        self.run(seconds)
        self._simulator = self._files.start_simulator()

    def _stop_node(self, seconds: float) -> None:
        self._node.send(signal.SIGSTOP)
        self.run(seconds)
        self._node.send(signal.SIGCONT)

    def end_round(self) -> Counts:
        """
        Take the port away; return what each end has counted until then.

        The simulator counts from its own start, the node from its own.
        """
        self._node.send(signal.SIGSTOP)  # so that both stand still
        theirs = self._their_counters()
        while (again := self._their_counters()) != theirs:
            theirs = again
        self._simulator.end(signal.SIGTERM)
        self._diagnostics = None
        self._node.send(signal.SIGCONT)
        self._until(lambda: self._link_is('open the port'), 'the loss of the port')
        assert self._diagnostics is not None
        ours = details(find_status(self._diagnostics, 'counters'))
        return {name: (int(ours[name]), theirs[other]) for name, other in _PAIRS} | {
            name: (int(ours[name]), 0) for name in _REPETITIONS}

    def _their_counters(self) -> Counter[str]:
        found: Counter[str] = Counter()
        for station in _STATIONS:
            words = self._simulator.say(f'counters {station}').split(': ', 2)[2].split()
            found.update({name: int(count)
                          for name, _, count in (word.partition('=') for word in words)})
        return found

    def begin_round(self) -> float:
        """Bring the port back; return how long (s) it takes until everything is read."""
        self._simulator = self._files.start_simulator()
        began = time.monotonic()
        self.until_well()
        return time.monotonic() - began

    def end(self) -> None:
        """Wait for the last results, then end both processes."""
        writer = self.writer
        self._until(lambda: writer.results.total() >= writer.asked.total(), 'the last results',
                    is_writing=False)
        self.run(1.0, is_writing=False)  # for a result too many
        self._node.end()
        self._simulator.end()


def main() -> int:
    """Run; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--minutes', type=float, default=60.0, help='at least 3 (60)')
    parser.add_argument('--seed', type=int, default=1, help='another one gives other faults')
    parser.add_argument('--log', type=Path, help='a file for all that the node logs')
    options = parser.parse_args()
    if options.minutes < 3:
        parser.error('--minutes has to be at least 3')
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder, Observer() as observer:
        files = make_files(Path(folder))
        with Process('node', *files.args()) as node:
            run = LongRun(files, observer, node, options.seed)
            try:
                recoveries = _rounds(run, began + 60 * options.minutes)
                run.end()
            finally:
                run.clean_up()
                if options.log:
                    options.log.write_text(node.text, encoding='utf-8')
            problems = run.problems + judge(run)
            print(report(run, time.monotonic() - began, recoveries))
    print('\n'.join(problems) or 'nothing was wrong', flush=True)
    return int(bool(problems))


def _rounds(run: LongRun, end: float) -> list[float]:
    """Run until it is time; return how long each return of the port took (s)."""
    recoveries: list[float] = []
    before: Counts = {}
    run.until_well()
    for number in itertools.count(1):
        is_quiet = number % 3 == 0
        if is_quiet:
            run.run(_ROUND)
        else:
            run.disturb(_ROUND)
            run.until_well()
        counts = run.end_round()
        recoveries.append(run.begin_round())
        print(f'round {number:>3} {"quiet" if is_quiet else "faults":<6} {run}, '
              f'port back in {recoveries[-1]:.2f} s', end='')
        if is_quiet:
            worst, repetitions = difference(before, counts)
            print(f', counters differ by {worst}, {repetitions} repetitions', end='')
            if worst > 1 + repetitions:
                run.problems.append(f'round {number}: the counters differ: {before}, {counts}')
        print(flush=True)
        before = counts
        if time.monotonic() >= end:
            break
    return recoveries


def difference(before: Counts, after: Counts) -> tuple[int, int]:
    """Return by how much the counts have moved apart at most, and how much was sent again."""
    apart = {name: abs(ours - before[name][0] - theirs) for name, (ours, theirs) in after.items()}
    repetitions = sum(apart.pop(name, 0) for name in _REPETITIONS)
    return max(apart.values()), repetitions


def judge(run: LongRun) -> list[str]:
    """Return what was wrong."""
    writer, half = run.writer, len(run.samples) // 2
    first, second = run.samples[:half], run.samples[half:]
    problems = [f'{tag}: {writer.asked[tag]} writes, {writer.results[tag]} results'
                for tag in writer.asked | writer.results
                if writer.asked[tag] != writer.results[tag]]
    if writer.wrong_values:
        problems.append(f'{writer.wrong_values} values were read that were never written')
    # A port is opened in a thread of its own, which a sample may meet.
    if max(s.threads for s in second) > max(s.threads for s in first):
        problems.append('the number of threads has grown')
    if max(s.descriptors for s in second) > max(s.descriptors for s in first):
        problems.append('the number of descriptors has grown')
    if growth(run.samples) > _MOST_GROWTH:
        problems.append(f'memory has grown by {growth(run.samples):.1f} MiB')
    return problems


def growth(samples: list[Sample]) -> float:
    """Return by how much (MiB) the last quarter is above the second; the first one warms up."""
    quarter = len(samples) // 4
    early, late = samples[quarter:2 * quarter], samples[-quarter:]
    return statistics.median(sample.memory for sample in late) - \
        statistics.median(sample.memory for sample in early)


def report(run: LongRun, seconds: float, recoveries: list[float]) -> str:
    """Return the figures of a run."""
    writer, samples = run.writer, run.samples
    memory = [sample.memory for sample in samples]
    lines = {
        'duration': f'{seconds / 60:.1f} min',
        'values of one topic': f'{writer.reads}, wrong {writer.wrong_values}',
        'writes': f'{writer.asked.total()}, results {writer.results.total()}, '
                  f'slowest {writer.slowest:.2f} s',
        'results': ', '.join(f'{text} {count}' for text, count in writer.outcomes.most_common()),
        'faults': ', '.join(f'{name} {count}' for name, count in sorted(run.faults.items())),
        'port back': f'{len(recoveries)} times, median {statistics.median(recoveries):.2f} s, '
                     f'slowest {max(recoveries):.2f} s',
        'lines in the log': f'{run.log_lines}',
        'memory': f'{min(memory):.1f} to {max(memory):.1f} MiB, last quarter against second '
                  f'{growth(samples):+.2f} MiB',
        'threads': f'{sorted({sample.threads for sample in samples})}',
        'descriptors': f'{sorted({sample.descriptors for sample in samples})}',
        'CPU': f'{samples[-1].cpu / seconds:.1%} of a core',
    }
    return '\n'.join(f'{name:<20} {text}' for name, text in lines.items())


if __name__ == '__main__':
    sys.exit(main())
