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
Compare what a transaction costs the bridge with a large map and with a small one.

Method. The driver on a virtual line, whose time costs nothing; only the processor time inside the
calls of the bridge's machine counts, so that of the simulated PLCs does not. Each pair is two
runs one after the other, and each figure the median of the ratios of --pairs pairs.

"fallbacks": 30 stations are read and written to, with 30 Write rows each; with and without a
Fallback for each row. "guarded": 2000 rows in ten files of one station, each published while a
counter of the PLC runs, and without that condition; the counter stands still for a while.

Run it as "python test/lab/benchmarks/large_maps.py"; it needs nothing but the package.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from statistics import median
import sys
import time
from typing import Any

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:4])

from abdf1_ros.settings.heartbeats import Fallback, While  # noqa: E402
from abdf1_ros.settings.network import Network  # noqa: E402
from support.driver_bench import DriverBench, store  # noqa: E402
from support.mappings import make_mapping  # noqa: E402

NETWORK = Network(baud=115200, timeout=200)
STATIONS, COMMANDS = range(11, 41), 30
ROWS, FILES = 2000, 10
BEAT = 0.15  # s


class Meter:
    """The processor time (s) inside the machine of a bench; ``longest`` of one call of it."""

    def __init__(self, bench: DriverBench) -> None:
        self._total = self.longest = 0.0
        self._driver = bench.driver
        for name in ('receive_data', 'handle_timeout', 'wake'):
            method = getattr(bench.driver.machine, name)
            setattr(bench.driver.machine, name, self._timed(method))

    def _timed(self, method: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any) -> Any:
            begun = time.process_time()
            try:
                return method(*args)
            finally:
                spent = time.process_time() - begun
                self._total += spent
                self.longest = max(self.longest, spent)
        return call

    def measure(self, run: Callable[[], None]) -> tuple[float, float]:
        """Return the time of a transaction, and the longest of one call."""
        self._total = self.longest = 0.0
        before = self._driver.tasks.transactions
        run()
        return self._total / (self._driver.tasks.transactions - before), self.longest


def with_fallbacks(fallback: Fallback | None) -> tuple[float, float]:
    """Return the time of a transaction of the line with 900 Write rows."""
    reads = [make_mapping('N9:0', station=station, tag=f'read{station}') for station in STATIONS]
    writes = [make_mapping(f'N7:{number}', 'Write', station=station, fallback=fallback,
                           tag=f'speed{station}_{number}')
              for station in STATIONS for number in range(COMMANDS)]
    bench = DriverBench([*reads, *writes], network=NETWORK)
    for station in STATIONS:
        bench.plc(station, 'PLC5', ('N7:0', COMMANDS), ('N9:0', 1))
    bench.run(12.0)  # each fallback has been written
    for number in range(100):
        bench.at(12.0 + 0.02 * number, lambda number=number: bench.write(  # type: ignore[misc]
            writes[7 * number % len(writes)], [number]))
    return Meter(bench).measure(lambda: bench.run(2.5))


def with_guards(condition: While | None) -> tuple[float, float]:
    """Return the time of a transaction of the line with 2000 rows."""
    counter = make_mapping('N7:0', tag='alive', period=100)
    rows = [make_mapping(f'N{20 + number % FILES}:{number // FILES}', tag=f'row{number}',
                         period=1000, condition=condition) for number in range(ROWS)]
    bench = DriverBench([counter, *rows], network=NETWORK)
    plc = bench.plc(1, 'PLC5', ('N7:0', 4), *(
        (f'N{20 + number}:0', ROWS // FILES) for number in range(FILES)))
    for begin, beats in ((0.0, 25), (7.0, 10)):
        for beat in range(1, beats):
            bench.at(begin + BEAT * beat,
                     lambda beat=beat: store(plc, 'N7:0', [beat]))  # type: ignore[misc]
    bench.run(2.5)
    return Meter(bench).measure(lambda: bench.run(6.5))


def main() -> None:
    """Print both comparisons."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[1])
    parser.add_argument('--pairs', type=int, default=5)
    pairs = parser.parse_args().pairs
    print('map        us each  without  ratio  longest call (ms)  without')
    for name, measure, option in (('fallbacks', with_fallbacks, Fallback((7,), 60_000)),
                                  ('guarded', with_guards, While(('alive',), 500))):
        found = [(measure(option), measure(None)) for _ in range(pairs)]
        print(f'{name:9}  {median(a[0] for a, b in found) * 1e6:7.0f}  '
              f'{median(b[0] for a, b in found) * 1e6:7.0f}  '
              f'{median(a[0] / b[0] for a, b in found):5.2f}  '
              f'{median(a[1] for a, b in found) * 1e3:17.1f}  '
              f'{median(b[1] for a, b in found) * 1e3:7.1f}')


if __name__ == '__main__':
    main()
