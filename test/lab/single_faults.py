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
Try every single fault of a byte in every kind of transaction, then pairs of faults for --seconds.

For each mode, check and kind of transaction a line says how many cases there were, and how many of
them went through the check as another message, which nobody can see. Status 1 when something was
wrong that can be seen: a value that the PLC did not have, a write told wrong or executed twice, an
end that is late, a next transaction that suffers.
"""

import argparse
from pathlib import Path
from random import Random
import secrets
import sys
import time

sys.path[:0] = [str(Path(__file__).resolve().parents[1]), str(Path(__file__).resolve().parents[2])]

from support.single_faults import CHECKS, KINDS, MODES, Tally  # noqa: E402


def main() -> int:
    """Run; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--mode', choices=tuple(MODES), action='append', help='only this mode')
    parser.add_argument('--check', choices=CHECKS, action='append', help='only this check')
    parser.add_argument('--kind', choices=KINDS, action='append', help='only this kind')
    parser.add_argument('--seconds', type=float, default=0.0, help='for pairs, in all (0)')
    parser.add_argument('--seed', type=int, default=secrets.randbelow(1 << 31), help='of pairs')
    options = parser.parse_args()
    print(f'single faults: --seed {options.seed}', flush=True)
    random, has_failed = Random(options.seed), False
    names = [(mode, check, kind) for mode in options.mode or MODES
             for check in options.check or CHECKS for kind in options.kind or KINDS]
    for name in names:
        tally = Tally(*name)
        for fault in tally.all_singles():
            tally.carry_out(fault)
        end = time.monotonic() + options.seconds / len(names)
        while time.monotonic() < end:
            tally.carry_out(*tally.pair(random))
        has_failed |= bool(tally.wrong)
        print(tally, flush=True)
    return int(has_failed)


if __name__ == '__main__':
    sys.exit(main())
