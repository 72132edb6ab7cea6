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
Compare the poll cycle that is forecast with the one that is measured.

Method. The forecast is ``driver.forecast.poll_cycle``: the characters of all blocks, and the time
that each answer takes. It is made for a map of a PLC-5 with blocks of several sizes that are all
read as often as the line allows. Then the driver reads that map on a line of each speed, half
and full duplex, whose other end begins each answer after --response ms
(``answering_line`` in ``paced_line``). "measured" is the median time between two reads of the
first row, over --seconds; the first two scans, in which all reads are late, do not count. The
goal is a difference below 3 %.

Run it as "python test/benchmarks/poll_cycle.py"; it needs nothing but the package.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path
import statistics
import sys
import time

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:3])

from abdf1_ros.driver.driver import Driver  # noqa: E402
from abdf1_ros.driver.links import DriverSettings  # noqa: E402
from abdf1_ros.plan.forecast import poll_cycle  # noqa: E402
from abdf1_ros.settings.mapping import Mapping  # noqa: E402
from abdf1_ros.settings.network import BAUD_RATES, Network  # noqa: E402
from abdf1_ros.settings.values import Values, ValueType  # noqa: E402
from paced_line import answering_line, far_end, Listener  # noqa: E402
from support.mappings import make_mapping  # noqa: E402

STATION = 1
INT16, UINT16, FLOAT32 = ValueType.INT16, ValueType.UINT16, ValueType.FLOAT32
ROWS = (('N7:0', 60, INT16), ('N9:10', 1, INT16), ('F8:0', 20, FLOAT32), ('B3:0', 8, UINT16),
        ('T4:0', 15, INT16), ('C5:2', 3, INT16), ('I:000', 4, UINT16), ('N10:0', 150, INT16))


class Watch(Listener):
    """Notes when the values of one row come."""

    def __init__(self, row: Mapping) -> None:
        super().__init__()
        self._row = row
        self.times: list[float] = []

    def read(self, mapping: Mapping, values: Values) -> None:
        """Note the time."""
        if mapping is self._row:
            self.times.append(time.monotonic())


def mappings() -> list[Mapping]:
    """Return the map."""
    return [make_mapping(text, station=STATION, length=length, kind=kind.value, item=number,
                         tag=f'row{number}', period=0)
            for number, (text, length, kind) in enumerate(ROWS)]


def measure(network: Network, response: float, seconds: float) -> tuple[float, float, int]:
    """Return forecast and measured poll cycle in seconds, and troubles."""
    rows = mappings()
    watch = Watch(rows[0])
    driver = Driver(network, rows, DriverSettings(processor_period=0.0), watch)
    with answering_line(driver.machine, far_end(network, STATION, rows), network.baud, response):
        end = time.monotonic() + seconds
        while time.monotonic() < end or len(watch.times) < 5:
            time.sleep(0.02)
    times = watch.times[2:]
    steps = [later - earlier for earlier, later in zip(times, times[1:], strict=False)]
    return poll_cycle(driver.blocks, response), statistics.median(steps), watch.troubles


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--baud', type=int, nargs='+', choices=BAUD_RATES,
                        default=[9600, 19200, 38400, 115200])
    parser.add_argument('--response', type=float, nargs='+', default=[0.0, 10.0], metavar='MS')
    parser.add_argument('--seconds', type=float, default=3.0)
    options = parser.parse_args()
    print(f'{len(ROWS)} rows; load of the machine {os.getloadavg()[0]:.1f}')
    print('mode      baud  answers after  forecast   measured  difference  troubles')
    for mode in ('Master', 'Peer'):
        for baud in options.baud:
            for response in options.response:
                network = Network(mode=mode, baud=baud, timeout=2000)
                forecast, measured, troubles = measure(
                    network, response / 1000, options.seconds)
                print(f'{mode:6}  {baud:6d}  {response:10.0f} ms  {1000 * forecast:5.0f} ms'
                      f'  {1000 * measured:6.0f} ms  {100 * (measured / forecast - 1):8.1f} %'
                      f'  {troubles:8d}', flush=True)


if __name__ == '__main__':
    main()
