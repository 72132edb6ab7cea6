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
Measure what many lines in one process cost, and what they do to each other.

Method. Each of --lines lines has 10 mappings of one PLC, side by side in one block, all to be
read as often as the line allows, or every --period ms. A process for all PLCs answers on a
pseudo-terminal a line; a reply is handed over when its last character would have come at --baud,
so a line has as many transactions as a real one. "ACK" is the time from then to the ACK of the
bridge, for 50, 99 and 99.9 % of them. "start" is from the start of the process to the line of the
log that all lines run, "end" from SIGINT to the end of the process. Processor time is that of all
threads of the bridge in --seconds, as part of one core, diagnostics included; nobody listens to
values. "fresh / late / stale" is how often lines said in that time that all their mappings were
fresh, that one was late, and that one was stale; they say so once a second, and at each change.

--ways: "one" is one process for all lines, "four" four with a quarter of them each, "each" a
process (the command "node") a line. "bare" is one process that does the same without this
package (bare_lines.py) as often as the line allows, and says nothing.

Run it as "python test/lab/benchmarks/many_lines.py"; it needs ROS, or the wheels of it.
"""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, ExitStack
from dataclasses import dataclass
import heapq
import multiprocessing
from multiprocessing.connection import Connection
import os
from pathlib import Path
import select
import signal
import tempfile
import time
import tty

from abdf1_ros.df1.frames import ACK
from abdf1_ros.df1.machine import Machine
from abdf1_ros.settings.map_file import load_mappings
from diagnostic_msgs.msg import DiagnosticArray
from node_rig import plc_of, Running
from paced_line import BITS
from support.ros import ERROR, EVERYTHING, find_status, Observer, OK, Process, WARN, write_csv

MAPPINGS = 10


class Plc:
    """One PLC on its pseudo-terminal."""

    def __init__(self, descriptor: int, far: Machine, char_time: float) -> None:
        self.latencies: list[float] = []
        self.replies = 0
        self._descriptor = descriptor
        self._far = far
        self._char_time = char_time
        self._free = 0.0
        self._answered: float | None = None
        far.start(time.monotonic())

    def take(self) -> tuple[float, bytes] | None:
        """Take what the bridge has said; return when to answer, and what."""
        data = os.read(self._descriptor, 4096)
        now = time.monotonic()
        if self._answered is not None:
            if data.startswith(ACK):
                self.latencies.append(now - self._answered)
            self._answered = None
        self._far.receive_data(data, now)
        answer = self._far.data_to_send()
        self._free = max(self._free, now) + (len(data) + len(answer)) * self._char_time
        return (self._free, answer) if answer else None

    def say(self, answer: bytes) -> None:
        """Hand over an answer."""
        os.write(self._descriptor, answer)
        if len(answer) > 8:  # a reply, which is acknowledged
            self._answered = time.monotonic()
            self.replies += 1


def run_plcs(descriptors: Sequence[int], machines: Sequence[Machine], char_time: float,
             pipe: Connection) -> None:
    """Be all PLCs; "reset" and "tell" come through the pipe."""
    plcs = {descriptor: Plc(descriptor, machine, char_time)
            for descriptor, machine in zip(descriptors, machines, strict=True)}
    poll = select.epoll()
    for descriptor in [*descriptors, pipe.fileno()]:
        poll.register(descriptor, select.EPOLLIN)
    due: list[tuple[float, int, bytes]] = []
    while True:
        timeout = max(0.0, due[0][0] - time.monotonic()) if due else None
        for descriptor, _ in poll.poll(timeout):
            if descriptor == pipe.fileno():
                if pipe.recv() == 'tell':
                    pipe.send([(plc.latencies, plc.replies) for plc in plcs.values()])
                for plc in plcs.values():
                    plc.latencies, plc.replies = [], 0
            elif answer := plcs[descriptor].take():
                heapq.heappush(due, (answer[0], descriptor, answer[1]))
        while due and due[0][0] <= time.monotonic():
            _, descriptor, data = heapq.heappop(due)
            plcs[descriptor].say(data)


@dataclass(frozen=True, slots=True)
class Rig:
    """Lines with PLCs: their ports, the folder of their files, and the way to ask the PLCs."""

    ports: list[str]
    folder: Path
    pipe: Connection

    def files(self, number: int) -> tuple[Path, Path]:
        """Return both files of a line."""
        return self.folder / f'l{number}_net.csv', self.folder / f'l{number}_map.csv'

    def parameters(self, numbers: Sequence[int], name: str) -> str:
        """Write the parameter file of some lines."""
        path = self.folder / name
        path.write_text(''.join(
            f'/plant/line_{number}:\n  ros__parameters:\n    port: {self.ports[number]}\n'
            f'    net_file: {self.files(number)[0]}\n    map_file: {self.files(number)[1]}\n'
            for number in numbers))
        return str(path)


@contextmanager
def rigged(count: int, baud: int, period: int = 0) -> Iterator[Rig]:
    """Run so many PLCs in a process."""
    with tempfile.TemporaryDirectory(prefix='abdf1_bench_') as name, ExitStack() as stack:
        ours, theirs = multiprocessing.Pipe()
        pairs = [os.openpty() for _ in range(count)]
        for far, near in pairs:
            tty.setraw(far)
            tty.setraw(near)
            stack.callback(os.close, near)
        rig = Rig([os.ttyname(near) for _, near in pairs], Path(name), ours)
        machines = []
        for number in range(count):
            net, table = rig.files(number)
            write_csv(net, 'Baud,Timeout', [f'{baud},1000'])
            write_csv(table, 'Tag,Command,Address,Station,PLC_Type,Period',
                      [f'w{row},Read,N7:{row},1,SLC,{period}' for row in range(MAPPINGS)])
            machines.append(plc_of(load_mappings(str(table))[0]))
        process = multiprocessing.Process(
            target=run_plcs, args=([far for far, _ in pairs], machines, BITS / baud, theirs),
            daemon=True)
        process.start()
        for far, _ in pairs:
            os.close(far)
        try:
            yield rig
        finally:
            process.kill()
            process.join()


@dataclass(frozen=True, slots=True)
class Figures:
    """What a run has shown: s, MiB, cores, transactions a second, s, looks, s."""

    start: float
    memory: float
    processor: float
    transactions: float
    acks: tuple[float, ...]
    looks: tuple[int, ...]
    end: float

    def __str__(self) -> str:
        """Return a line of the table."""
        acks = ' / '.join(f'{value * 1000:.2f}' for value in self.acks)
        looks = ' / '.join(map(str, self.looks))
        return (f'{self.start:6.1f} s {self.memory:7.0f} MiB {self.processor * 100:7.1f} % '
                f'{self.transactions:8.0f}  {acks:>20} ms  {looks:>20} {self.end:6.1f} s')


def measure(rig: Rig, commands: Sequence[tuple[str | Path, Sequence[str], str]],
            options: argparse.Namespace) -> Figures:
    """Run ``commands`` (name, arguments, what they say when they run), and look at them."""
    with Observer() as observer, ExitStack() as stack:
        begun = time.monotonic()
        running = [Running(stack.enter_context(Process(name, *arguments)), 0.0)
                   for name, arguments, _ in commands]
        for one, (_, _, text) in zip(running, commands, strict=True):
            while one.process.is_running and text not in one.process.text:
                time.sleep(0.05)
        start = time.monotonic() - begun
        time.sleep(options.settle)
        rig.pipe.send('reset')
        used, begun = sum(one.used() for one in running), time.monotonic()
        looks = look_on(observer, options.seconds)
        rig.pipe.send('tell')
        told = rig.pipe.recv()
        passed = time.monotonic() - begun
        used = sum(one.used() for one in running) - used
        memory = sum(one.memory() for one in running)
        begun = time.monotonic()
        for one in running:
            one.process.send(signal.SIGINT)
        for one in running:
            one.process.result()
        end = time.monotonic() - begun
    acks = sorted(latency for latencies, _ in told for latency in latencies)
    shares = tuple(acks[int(share * (len(acks) - 1))] for share in (0.5, 0.99, 0.999) if acks)
    return Figures(start, memory, used / passed, sum(count for _, count in told) / passed,
                   shares, looks, end)


def look_on(observer: Observer, seconds: float) -> tuple[int, ...]:
    """Return how often lines say in this time that all is fresh, late, and stale."""
    levels: Counter[bytes] = Counter()

    def take(array: DiagnosticArray) -> None:
        if any(status.name.endswith(': mappings') for status in array.status):
            levels[find_status(array, 'mappings').level] += 1

    subscription = observer.node.create_subscription(
        DiagnosticArray, '/diagnostics', take, EVERYTHING)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        observer.executor.spin_once(timeout_sec=0.1)
    observer.node.destroy_subscription(subscription)
    return levels[OK], levels[WARN], levels[ERROR]


def commands_of(way: str, rig: Rig, count: int) -> list[tuple[str | Path, list[str], str]]:
    """Return what is to be run."""
    numbers = list(range(count))
    if way == 'each':
        return [('node', ['--ros-args', '-r', f'__node:=line_{number}', '-r', '__ns:=/plant',
                          '--params-file', rig.parameters([number], f'{number}.yaml')],
                 f'{rig.ports[number]}: open') for number in numbers]
    if way == 'bare':
        return [(Path(__file__).with_name('bare_lines.py'),
                 [word for number in numbers
                  for word in (rig.ports[number], str(rig.files(number)[1]))],
                 f'{count} of {count} lines run')]
    parts = 4 if way == 'four' else 1
    shares = [numbers[part::parts] for part in range(parts)]
    return [('lines', ['--ros-args', '--params-file',
                       rig.parameters(share, f'lines_{part}.yaml')],
             f'{len(share)} of {len(share)} lines run')
            for part, share in enumerate(shares) if share]


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--lines', type=int, nargs='+', default=[1, 10, 25, 50, 100])
    parser.add_argument('--ways', nargs='+', default=['one'],
                        choices=['one', 'four', 'each', 'bare'])
    parser.add_argument('--baud', type=int, default=19200)
    parser.add_argument('--period', type=int, default=0, metavar='MS')
    parser.add_argument('--settle', type=float, default=5.0)
    parser.add_argument('--seconds', type=float, default=20.0)
    options = parser.parse_args()
    print(f'{MAPPINGS} mappings a line at {options.baud} baud, Period {options.period}, '
          f'{options.seconds:g} s each; load of the machine before {os.getloadavg()[0]:.1f}')
    print('way  lines    start      memory   processor  trans/s   ACK 50 / 99 / 99.9 %'
          '   fresh / late / stale    end')
    for way in options.ways:
        for count in options.lines:
            with rigged(count, options.baud, options.period) as rig:
                print(f'{way:5}{count:5d}  {measure(rig, commands_of(way, rig, count), options)}',
                      flush=True)


if __name__ == '__main__':
    main()
