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
Let publishers die under noise and with a broken receive wire, in each mode.

``deaths.py --deaths 25`` prints a row for each: how many fallbacks were in the PLC within the
bound that ``check`` prints. The status is 1 where more than one in 25 was not.
"""

from __future__ import annotations

import argparse
from pathlib import Path
import sys

if __name__ == '__main__':
    sys.path[:0] = [str(Path(__file__).parents[number]) for number in (1, 2)]

from support.deaths import Death, MODES, overdue, with_broken_wire
from support.virtual_line import Noise

SHARE = 1 / 25  # of deaths that may take longer: noise is more than the retries
AFTER = (0.0, 0.5, 1.0, 2.0, 5.0, 20.0)  # s from the break to the death


def under_noise(deaths: int, seed: int) -> int:
    """Print how many fallbacks came in time, for each mode and noise; return how many too few."""
    missing = 0
    for mode in MODES:
        for share in (0.01, 0.02):
            late = overdue(mode, Noise(flipped=share), range(seed, seed + deaths))
            missing += max(0, len(late) - int(SHARE * deaths))
            print(f'| {mode}, {share:.0%} of characters | {Death(mode).bound:.1f} s | '
                  f'{deaths - len(late)} of {deaths} | {late or ""} |', flush=True)
    return missing


def with_broken_wires() -> int:
    """Print how many PLCs hold fallback and 0; return how many do not."""
    missing = 0
    for mode in MODES:
        for is_behind in {False, mode in ('Master', 'Standard')}:
            safe = 0
            for after in AFTER:
                death = with_broken_wire(mode, after, is_behind=is_behind)
                safe += death.is_safe_after(death.bound) and not death.word(10)
            missing += len(AFTER) - safe
            where = ', behind a gateway' if is_behind else ''
            print(f'| {mode}{where}, receive wire broken | {death.bound:.1f} s | '
                  f'{safe} of {len(AFTER)} | |', flush=True)
    return missing


def main() -> int:
    """Let them die; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--deaths', type=int, default=25, help='for each mode and noise')
    parser.add_argument('--seed', type=int, default=1)
    wanted = parser.parse_args()
    print('| plant | bound | in time | late seeds |\n| --- | --- | --- | --- |')
    return int(under_noise(wanted.deaths, wanted.seed) + with_broken_wires() > 0)


if __name__ == '__main__':
    sys.exit(main())
