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
Run a faulty line for a day of its time, in every mode, and show that its memory stays flat.

At the end of every hour all is well for a minute, so that the queues are empty; then what is
traced is what is kept. Status 1 when that grows. It takes minutes for each mode.
"""

from __future__ import annotations

import argparse
import gc
from pathlib import Path
import sys
import time
import tracemalloc

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:4])

from soak.faulty_line import FaultyLine, MODES  # noqa: E402

_HOUR = 3600.0

# Bytes by which the second half of the hours may exceed the first one.
_MOST_GROWTH = 50_000


def main() -> int:
    """Run; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('modes', nargs='*', default=MODES, metavar='MODE',
                        help=f'of {", ".join(MODES)}; all unless told')
    parser.add_argument('--hours', type=int, default=24, help='of line time, at least 2 (24)')
    parser.add_argument('--seed', type=int, default=1, help='another one gives other faults')
    arguments = parser.parse_args()
    if unknown := set(arguments.modes) - set(MODES):
        parser.error(f'there is no mode {", ".join(sorted(unknown))}')
    if arguments.hours < 2:
        parser.error('--hours has to be at least 2')
    growths = [_run(mode, arguments.hours, arguments.seed) for mode in arguments.modes]
    return int(max(growths) > _MOST_GROWTH)


def _run(mode: str, hours: int, seed: int) -> int:
    """Return by how many bytes the second half of the hours exceeds the first half."""
    began = time.monotonic()
    tracemalloc.start()
    rig = FaultyLine(mode, seed)
    kept = []
    for hour in range(hours):
        while rig.clock() < (hour + 1) * _HOUR:
            rig.disturb()
        rig.settle()
        rig.check_bounds()
        gc.collect()
        kept.append(tracemalloc.get_traced_memory()[0])
        print(f'{mode:<10} hour {hour + 1:>2}: {kept[-1]:>9,} bytes, {rig.asked:>9,} writes, '
              f'{rig.ear.reads:>8,} values, {sum(rig.faults.values()):>6,} faults', flush=True)
    tracemalloc.stop()
    half = len(kept) // 2
    growth = max(kept[half:]) - max(kept[:half])
    print(f'{mode:<10} growth {growth:,} bytes in {time.monotonic() - began:.0f} s of real time; '
          f'{", ".join(f"{name} {count}" for name, count in rig.faults.items())}', flush=True)
    return growth


if __name__ == '__main__':
    sys.exit(main())
