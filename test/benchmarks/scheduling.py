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
Measure what comes of periods and writes on a line with little, much and too much to do.

Method. A half-duplex line of --baud with one SLC. Rows of ten words each, one with a period of
100 ms, the others of 500 ms and 2 s, lie in files of their own, so that none is read with
another; there are as many as make the load of the line 50, 100 and 150 %, by the planner's
model. Every 70 to 330 ms, by chance, a word is written; that comes on top. All of it is done on
a virtual line with a virtual clock, where the same numbers come out each time, and on a paced
pseudo-terminal in real time (``answering_line``); the PLC of both answers at once.

Of each period: what the forecast expects, then mean, median, 99th percentile and longest of the
times between two values of a row; "best" and "worst" are the shortest and the longest mean of
one row, which should hardly differ. The first fifth of the time does not count. Of the writes:
how long from the request to the confirmation. A write has to wait for the transaction that has
the line, and then takes its own time: "boundary" is the longest such sum. Only a write that
comes while another one waits may take longer.

Run it as "python test/benchmarks/scheduling.py"; it needs nothing but the package.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import pairwise
import os
from pathlib import Path
import random
from statistics import fmean, median
import sys
import time

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:3])

from abdf1_ros.driver.driver import Driver  # noqa: E402
from abdf1_ros.driver.links import DriverSettings  # noqa: E402
from abdf1_ros.driver.points import WriteResult  # noqa: E402
from abdf1_ros.plan.forecast import block_time, intervals, line_model, load  # noqa: E402
from abdf1_ros.plan.planner import Block, Planner  # noqa: E402
from abdf1_ros.settings.mapping import Command, Mapping  # noqa: E402
from abdf1_ros.settings.network import BAUD_RATES, Network  # noqa: E402
from abdf1_ros.settings.values import Values  # noqa: E402
from paced_line import answering_line, far_end, Listener, WORDS  # noqa: E402
from support.driver_bench import DriverBench  # noqa: E402
from support.mappings import make_mapping  # noqa: E402

STATION = 1
FAST, MIDDLE, SLOW = 100, 500, 2000
PERIODS = (MIDDLE, SLOW, SLOW, SLOW, SLOW)  # in this order, again and again
FIRST_FILE = 9


def row(file: int, period: int | None, command: Command, words: int) -> Mapping:
    """Return a row with a file of its own."""
    return make_mapping(f'N{file}:0', command.value, station=STATION, plc='SLC', length=words,
                        item=file, period=period)


WRITTEN = row(7, None, Command.WRITE, 1)


def plan(rows: Sequence[Mapping], network: Network) -> list[Block]:
    """Return the blocks for rows."""
    return Planner(line_model(network), 0.1).plan(rows)


def rows_for(share: float, network: Network) -> list[Mapping]:
    """Return rows that need the part ``share`` of the line's time, or a little less."""
    rows = [row(FIRST_FILE, FAST, Command.READ, WORDS)]
    while load(plan(rows, network), 0.0) <= share:
        period = PERIODS[len(rows) % len(PERIODS)]
        rows.append(row(FIRST_FILE + len(rows), period, Command.READ, WORDS))
    return rows[:-1]


class Watch(Listener):
    """Notes when values come, and how long writes take."""

    def __init__(self, clock: Callable[[], float]) -> None:
        super().__init__()
        self._clock = clock
        self.times: dict[Mapping, list[float]] = defaultdict(list)
        self.latencies: list[float] = []

    def read(self, mapping: Mapping, values: Values) -> None:
        """Note the time."""
        self.times[mapping].append(self._clock())

    def written(self, result: WriteResult) -> None:
        """Note how long it took."""
        self.latencies.append(result.latency)


def moments(seconds: float) -> list[float]:
    """Return when to write; always the same."""
    dice, found = random.Random(7), [0.3]
    while found[-1] < seconds - 1:
        found.append(found[-1] + dice.uniform(0.07, 0.33))
    return found


def on_virtual_line(rows: Sequence[Mapping], network: Network, seconds: float) -> Watch:
    """Let the driver work in virtual time."""
    watch = Watch(lambda: bench.clock())  # noqa: PLW0108
    bench = DriverBench([*rows, WRITTEN], network=network, start=False, listener=watch)
    bench.plc(STATION, 'SLC', *((f'N{entry.address.file}:0', WORDS) for entry in (*rows, WRITTEN)))
    for when in moments(seconds):
        bench.at(when, lambda: bench.write(WRITTEN, [1]))
    bench.open()
    bench.run(seconds)
    return watch


def on_paced_line(rows: Sequence[Mapping], network: Network, seconds: float) -> Watch:
    """Let the driver work in real time."""
    watch = Watch(time.monotonic)
    driver = Driver(network, [*rows, WRITTEN], DriverSettings(), watch)
    far = far_end(network, STATION, [*rows, WRITTEN])
    with answering_line(driver.machine, far, network.baud) as link:
        begun = time.monotonic()
        for when in moments(seconds):
            time.sleep(max(0.0, begun + when - time.monotonic()))
            driver.write([WRITTEN], [1], time.monotonic())
            link.wake()
        time.sleep(max(0.0, begun + seconds - time.monotonic()))
    return watch


def steps(times: Sequence[float]) -> list[float]:
    """Return the times (s) between values, of those after the first fifth."""
    settled = times[0] + (times[-1] - times[0]) / 5
    return [later - earlier for earlier, later in pairwise(times) if earlier >= settled]


def late(sorted_times: Sequence[float]) -> float:
    """Return the 99th percentile."""
    return sorted_times[int(0.99 * len(sorted_times))]


def show(rows: Sequence[Mapping], network: Network, watch: Watch) -> None:
    """Print what was seen of reads and writes, in ms."""
    blocks = plan(rows, network)
    expected = intervals(blocks, 0.0)
    for period in sorted({entry.period or 0 for entry in rows}):
        each = [steps(watch.times[entry]) for entry in rows if entry.period == period]
        every = sorted(step for group in each for step in group)
        means = [fmean(group) for group in each]
        figures = (expected[period / 1000], fmean(every), median(every), late(every), every[-1],
                   min(means), max(means))
        print(f'  {period:5d} x {len(each):3d}  '
              + '  '.join(f'{1000 * figure:8.1f}' for figure in figures))
    alone, = on_virtual_line([], network, 0.5).latencies
    boundary = alone + max(block_time(block, 0.0) for block in blocks)
    waits = sorted(watch.latencies)
    print(f'  {len(waits)} writes: median {1000 * median(waits):.1f}, 99th percentile '
          f'{1000 * late(waits):.1f}, longest {1000 * waits[-1]:.1f} ms; boundary '
          f'{1000 * boundary:.1f} ms, alone {1000 * alone:.1f} ms; {watch.troubles} troubles',
          flush=True)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--baud', type=int, choices=BAUD_RATES, default=19200)
    parser.add_argument('--loads', type=float, nargs='+', default=[0.5, 1.0, 1.5])
    parser.add_argument('--seconds', type=float, default=120.0, help='of virtual time')
    parser.add_argument('--paced-seconds', type=float, default=30.0)
    options = parser.parse_args()
    network = Network(baud=options.baud, timeout=2000)
    print(f'{options.baud} baud; load of the machine {os.getloadavg()[0]:.1f}; all in ms')
    print('  period, rows  expected      mean    median      99 %   longest      best     worst')
    for name, run, seconds in (('virtual', on_virtual_line, options.seconds),
                               ('paced', on_paced_line, options.paced_seconds)):
        for share in options.loads:
            rows = rows_for(share, network)
            wanted = load(plan(rows, network), 0.0)
            print(f'{name} line, {100 * wanted:.0f} % of it wanted, {seconds:g} s')
            show(rows, network, run(rows, network, seconds))


if __name__ == '__main__':
    main()
