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
Measure what dead stations cost the living ones.

Method. A master with one row of ten words per station, all read as often as the line allows,
on one half-duplex line of --baud (see ``paced_line``), Timeout --timeout ms. First one station
is mapped and answers: its read rate alone. Then --stations are mapped and only that one
answers. --settle seconds, in which the dead ones are found out, do not count; --seconds do.
"share" is the live station's rate among the dead, as part of its rate alone; the goal is 80 %.

Run it as "python test/benchmarks/dead_stations.py"; it needs nothing but the package.
"""

from __future__ import annotations

import argparse

from abdf1_ros.settings.network import BAUD_RATES, Network, POLLING_MODES
from paced_line import block_of, measure, simulated, WORDS


def rate(polling: str, mapped: int, options: argparse.Namespace) -> float:
    """Return the reads per second of station 1, one of ``mapped``, when only it answers."""
    network = Network(baud=options.baud, polling=polling, timeout=options.timeout)
    mappings = [block_of(number) for number in range(1, mapped + 1)]
    settle = options.settle if mapped > 1 else 1.0
    seen = measure(network, mappings, [simulated(1, network, options.delay / 1000)],
                   settle, options.seconds)
    return seen.transactions


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--baud', type=int, choices=BAUD_RATES, default=19200)
    parser.add_argument('--timeout', type=int, default=300, metavar='MS')
    parser.add_argument('--delay', type=float, default=0.0, metavar='MS')
    parser.add_argument('--stations', type=int, default=10)
    parser.add_argument('--settle', type=float, default=15.0)
    parser.add_argument('--seconds', type=float, default=30.0)
    options = parser.parse_args()
    print(f'{options.stations} stations of {WORDS} words, {options.stations - 1} of them dead, '
          f'{options.baud} baud, Timeout {options.timeout} ms, {options.seconds:g} s each')
    print('polling   alone, reads/s  among the dead  share')
    for polling in POLLING_MODES:
        alone = rate(polling, 1, options)
        among = rate(polling, options.stations, options)
        print(f'{polling:8}  {alone:14.1f}  {among:14.1f}  {100 * among / alone:4.0f} %',
              flush=True)


if __name__ == '__main__':
    main()
