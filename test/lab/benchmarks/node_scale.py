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
Measure how long a node takes to start, and what it costs by number of mappings.

Method. The node runs in a process of its own against a PLC on an unthrottled pseudo-terminal,
in a process as well, that answers at once. Its rows are of one word and side by side, a hundred
to a block, each to be read and published every --period ms. "start" is from the start of the
process to the open port, so it has in it what Python and rclpy need for themselves, as the
memory has: what ten mappings take is mostly that. After --settle seconds, in which others find
the new topics, memory is what the process has resident, and "processor" the time of all its
threads in --seconds, as part of one core. The last lines give what a mapping adds, from one size
to the next: where the cost is constant they are alike. The goals: 1000 mappings start in less than
2 s and stay below 150 MiB.

Run it as "python test/lab/benchmarks/node_scale.py"; it needs ROS, or the wheels of it.
"""

import argparse
from dataclasses import dataclass
from itertools import pairwise
import os
import time

from node_rig import files, plc_of, rows, running_node
from paced_line import answering_pty


@dataclass(frozen=True, slots=True)
class Cost:
    """Seconds to start, MiB, and the part of a core."""

    mappings: int
    start: float
    memory: float
    processor: float


def measure(count: int, options: argparse.Namespace) -> Cost:
    """Run a node with so many mappings."""
    with files(rows(count, options.period), 115200) as (net, table, mappings), \
            answering_pty(plc_of(mappings), 0.0) as line, \
            running_node(net, table, os.ttyname(line)) as node:
        time.sleep(options.settle)
        used, begun = node.used(), time.monotonic()
        time.sleep(options.seconds)
        used, passed = node.used() - used, time.monotonic() - begun
        return Cost(count, node.start_time, node.memory(), used / passed)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--mappings', type=int, nargs='+', default=[10, 100, 300, 1000])
    parser.add_argument('--period', type=int, default=1000, metavar='MS')
    parser.add_argument('--settle', type=float, default=3.0)
    parser.add_argument('--seconds', type=float, default=5.0)
    options = parser.parse_args()
    print(f'one read of each mapping every {options.period} ms; '
          f'load of the machine {os.getloadavg()[0]:.1f}')
    print('mappings    start     memory  processor')
    costs = []
    for count in options.mappings:
        cost = measure(count, options)
        costs.append(cost)
        print(f'{count:8d}  {cost.start:5.2f} s  {cost.memory:5.1f} MiB  '
              f'{100 * cost.processor:7.1f} %', flush=True)
    print('from - to    start  memory  processor, each mapping')
    for less, more in pairwise(costs):
        added = more.mappings - less.mappings
        print(f'{less.mappings:4d} - {more.mappings:4d}'
              f'  {1e3 * (more.start - less.start) / added:4.2f} ms'
              f'  {1024 * (more.memory - less.memory) / added:4.0f} KiB'
              f'  {1e6 * (more.processor - less.processor) / added:4.0f} us/s')


if __name__ == '__main__':
    main()
