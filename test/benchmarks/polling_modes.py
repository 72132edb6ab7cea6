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
Measure what standard polling brings on a line of slow stations.

Method. A master with one row of ten words per station, all read as often as the line allows,
against ten simulated SLC stations on one half-duplex line of --baud (see ``paced_line``). A
station that has taken a command answers polls with EOT for --delay ms, then with its reply.
With Polling Message the master waits for that reply before the next command; with Polling
Standard it goes on with the other stations, so their thinking runs side by side. Each mode
runs --seconds; the first two do not count. "poll cycle" is how long the slowest station waited
between its last two reads, averaged over twenty looks a second; "troubles" counts errors and
retries, of which there should be none.

Run it as "python test/benchmarks/polling_modes.py"; it needs nothing but the package.
"""

from __future__ import annotations

import argparse

from abdf1_ros.settings.network import BAUD_RATES, Network, POLLING_MODES
from paced_line import block_of, measure, Measured, simulated, WORDS


def run(polling: str, options: argparse.Namespace) -> Measured:
    """Measure one mode."""
    numbers = range(1, options.stations + 1)
    network = Network(baud=options.baud, polling=polling, cmd_timeout=5000)
    stations = [simulated(number, network, options.delay / 1000) for number in numbers]
    return measure(
        network, [block_of(number) for number in numbers], stations, 2.0, options.seconds)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--baud', type=int, choices=BAUD_RATES, default=19200)
    parser.add_argument('--delay', type=float, default=50.0, metavar='MS')
    parser.add_argument('--stations', type=int, default=10)
    parser.add_argument('--seconds', type=float, default=15.0)
    options = parser.parse_args()
    print(f'{options.stations} stations of {WORDS} words, {options.baud} baud, '
          f'{options.delay:g} ms of thinking per command, {options.seconds:g} s each')
    print('polling   poll cycle   slowest  transactions/s  polls/s   ratio  troubles')
    first = None
    for polling in POLLING_MODES:
        seen = run(polling, options)
        first = first or seen
        print(f'{polling:8}  {1000 * seen.poll_cycle:6.0f} ms  {1000 * seen.slowest_scan:5.0f} ms'
              f'  {seen.transactions:14.1f}  {seen.polls:7.1f}'
              f'  {seen.transactions / first.transactions:6.2f}  {seen.troubles:8d}', flush=True)


if __name__ == '__main__':
    main()
