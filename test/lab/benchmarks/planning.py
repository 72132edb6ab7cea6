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
Compare the read plan of a realistic map with the best there can be, and time the planner.

Method. A map of 500 tags on a line of --baud: integers, bits, floats, members of timers and
counters, and I/O points of a PLC-5 and two SLCs, in clusters with gaps near the beginning of each
file, as people lay out what a robot cell or a panel is to see; periods are from 100 ms to 5 s. It
is always the same. The cost of a plan is the line's time that it needs each second: of each
block the time of its characters, divided by its period (or by the time that the line needs to
read everything once, where that is longer).

The optimum comes from a search of its own: word by word through each file, it keeps the cheapest
way to every set of blocks that are open there, one for each period. What was joined across a
gap that costs more than another command is given up, all else is tried; "nan" says that this was
too much, as it is on fast lines, where commands are cheap beside gaps. "one read per tag" is
the same map without any plan. --timed tags, spread over files and stations, are planned to
measure the planner's own processor time.

Run it as "python test/lab/benchmarks/planning.py"; it needs nothing but the package.
"""

import argparse
from collections import defaultdict
from collections.abc import Sequence
import math
import os
from pathlib import Path
import random
import sys
import time

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:4])

from abdf1_ros.pccc.dialect import Transfer  # noqa: E402
from abdf1_ros.pccc.file_types import PlcType  # noqa: E402
from abdf1_ros.plan.forecast import line_model  # noqa: E402
from abdf1_ros.plan.partition import Span  # noqa: E402
from abdf1_ros.plan.planner import Block, Planner  # noqa: E402
from abdf1_ros.settings import BAUD_RATES  # noqa: E402
from abdf1_ros.settings.mapping import Mapping  # noqa: E402
from abdf1_ros.settings.network import Network  # noqa: E402
from support.mappings import make_mapping  # noqa: E402

PERIODS = (100, 100, 250, 500, 1000, 1000, 5000)
MOST_WAYS = 20_000  # kept at a time
PLACES = (
    (1, PlcType.PLC5, ('N7', 'N7', 'B3', 'B3', 'F8', 'T4', 'C5', 'I', 'O')),
    (2, PlcType.SLC, ('N7', 'N7', 'B3', 'B3', 'F8', 'T4', 'I')),
    (3, PlcType.SLC, ('N7', 'B3', 'C5', 'O')))


def row(number: int, text: str, station: int, plc_type: PlcType, length: int,
        period: int) -> Mapping:
    """Return a row that reads."""
    return make_mapping(text, station=station, plc=plc_type.value, length=length, item=number,
                        tag=f't{number}', period=period)


def realistic_map(tags: int) -> list[Mapping]:
    """Return rows in clusters: what belongs to one machine stands side by side."""
    dice = random.Random(500)
    rows: list[Mapping] = []
    while len(rows) < tags:
        station, plc_type, files = dice.choice(PLACES)
        file = dice.choice(files)
        element = dice.randrange(0, 24)
        usual = dice.choice(PERIODS)
        for _ in range(dice.randrange(5, 25)):
            period = usual if dice.random() < 0.7 else dice.choice(PERIODS)
            text = _address(file, element, plc_type, dice)
            rows.append(row(len(rows), text, station, plc_type, dice.choice((1, 1, 1, 2)), period))
            element += dice.choice((1, 1, 1, 1, 2, 5))
    return rows[:tags]


def _address(file: str, element: int, plc_type: PlcType, dice: random.Random) -> str:
    if file in 'IO':
        point = f'{element // 4 % 32:03o}/{element % 16:o}' if plc_type == PlcType.PLC5 \
            else f'{element // 16 % 4 + 1}.0/{element % 16}'
        return f'{file}:{point}'
    if file[0] == 'B':
        return f'{file}/{8 * element + dice.randrange(8)}'
    if file[0] in 'TC':
        return f'{file}:{element}{dice.choice((".PRE", ".ACC", "/DN"))}'
    return f'{file}:{element}'


def spread_map(tags: int) -> list[Mapping]:
    """Return rows all over the files of four stations."""
    dice = random.Random(10_000)
    return [row(number, f'N{dice.randrange(10, 60)}:{dice.randrange(255)}', 1 + number % 4,
                (PlcType.PLC5, PlcType.SLC)[number % 2], 1, dice.choice(PERIODS))
            for number in range(tags)]


class Search:
    """The cheapest blocks for the rows of one place, found by trying."""

    def __init__(self, planner: Planner, rows: Sequence[Mapping], poll_cycle: float) -> None:
        example = rows[0]
        self._element = example.address.layout.words
        self._limit = example.dialect.max_read(example.address.file_type)
        start = example.address.at_offset(0)
        self._costs = {words: planner.line_model.read_time(
            example.dialect, Transfer(start, words), example.station)
            for words in {1, *range(self._element, self._limit + 1, self._element)}}
        self._needed: dict[Span, float] = {}
        for entry in rows:
            first = entry.address.offset
            span = Span(first, first + entry.codec.words).aligned(self._element)
            rate = 1 / max((entry.period or 0) / 1000, poll_cycle)
            self._needed[span] = max(rate, self._needed.get(span, 0.0))

    def least(self) -> float:
        """Return the cost of the best plan; NaN: there are too many to be tried."""
        rates = sorted(set(self._needed.values()))
        ways: dict[frozenset[tuple[float, Span]], float] = {frozenset(): 0.0}
        for span, rate in sorted(self._needed.items(), key=lambda item: (
                item[0].first, -item[0].end)):
            following: dict[frozenset[tuple[float, Span]], float] = {}
            for opened, cost in ways.items():
                near = frozenset(
                    block for block in opened if span.first - block[1].end < self._limit // 2)
                for blocks, more in self._options(near, span, rate, rates):
                    following[blocks] = min(following.get(blocks, 1e9), cost + more)
            if len(following) > MOST_WAYS:
                return math.nan
            ways = following
        return min(ways.values())

    def _options(self, opened: frozenset[tuple[float, Span]], span: Span, rate: float,
                 rates: list[float]) -> list[tuple[frozenset[tuple[float, Span]], float]]:
        """Return the open blocks, and what is paid for them, for each way to read ``span``."""
        if any(block.holds(span) and often >= rate for often, block in opened):
            return [(opened, 0.0)]
        options = []
        for often in (other for other in rates if other >= rate):
            others = frozenset(entry for entry in opened if entry[0] != often)
            options.append((others | {(often, span)}, often * self._costs[span.words]))
            for _, block in opened - others:
                longer = Span(block.first, max(block.end, span.end))
                longer = longer.aligned(self._element)
                if longer.words <= self._limit:
                    paid = self._costs[longer.words] - self._costs[block.words]
                    options.append((others | {(often, longer)}, often * paid))
        return options


def optimum(planner: Planner, rows: Sequence[Mapping], poll_cycle: float) -> float:
    """Return the cost of the best plan for all rows, none of which is longer than a packet."""
    places = defaultdict(list)
    for entry in rows:
        places[entry.station, entry.address.area].append(entry)
    return sum(Search(planner, group, poll_cycle).least() for group in places.values())


def cost(blocks: Sequence[Block], poll_cycle: float) -> float:
    """Return the part of the line's time that a plan takes."""
    return sum(block.line_time / max(block.period, poll_cycle) for block in blocks)


def main() -> None:
    """Print what was found."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--baud', type=int, choices=BAUD_RATES, default=19200)
    parser.add_argument('--tags', type=int, default=500)
    parser.add_argument('--timed', type=int, nargs='+', default=[1000, 10_000])
    options = parser.parse_args()
    planner = Planner(line_model(Network(baud=options.baud)), 0.1)
    rows = realistic_map(options.tags)
    blocks = planner.plan(rows)
    poll_cycle = sum(block.line_time for block in blocks)
    single = [block for entry in rows for block in planner.plan([entry])]
    planned, best = cost(blocks, poll_cycle), optimum(planner, rows, poll_cycle)
    alone = cost(single, poll_cycle)
    print(f'{len(rows)} tags at {options.baud} baud: {len(blocks)} blocks, '
          f'{poll_cycle:.2f} s of characters in a scan')
    print(f'plan                {planned:7.3f} of the time of the line')
    print(f'optimum             {best:7.3f}, which the plan misses by '
          f'{100 * max(planned / best - 1, 0.0):.1f} %')
    print(f'one read per tag    {alone:7.3f}, {alone / planned:.1f} times the plan; one scan '
          f'{sum(block.line_time for block in single) / poll_cycle:.1f} times')
    print(f'load of the machine {os.getloadavg()[0]:7.1f}')
    for tags in options.timed:
        rows = spread_map(tags)
        used = time.process_time()
        count = len(planner.plan(rows))
        used = time.process_time() - used
        print(f'{tags:6d} tags: {count} blocks, planned in {used:.2f} s of processor time')


if __name__ == '__main__':
    main()
