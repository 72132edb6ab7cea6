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
Run every mode on a noisy line for hours of its time, and print what was found.

The same seeds give the same figures. Status 1 when anything was wrong that no check excuses.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
import sys
import time

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:4])

from noise.rig import MODES, Rig  # noqa: E402
from noise.theory import Theory  # noqa: E402
from noise.wire import Kind, LISTED  # noqa: E402

RATES = (1e-5, 1e-4, 1e-3, 1e-2, 2e-2)
_STRETCH = 600.0  # s of noise, then the line recovers and the writes are judged
_HOUR = 3600.0

_HEAD = ('mode', 'check', 'errors', 'rate', 'hours', 'Mchar', 'values', 'damaged', 'refused',
         'unseen', 'theory', 'wrong+', 'wrong', 'writes', 'unknown', 'cmd+', 'twice', 'false',
         'longest', 'bound', 'recovery', 'most')


@dataclass(slots=True)
class Case:
    """One row of the table, and its sums over all rounds."""

    mode: str
    error_code: str
    kinds: tuple[Kind, ...]
    rate: float
    trials: int = 10_000  # of the theory
    hours: float = 0.0
    sums: Counter[str] = field(default_factory=Counter)
    theory: Theory | None = None
    longest: float = 0.0
    bound: float = 0.0
    recoveries: list[float] = field(default_factory=list)

    def run(self, seed: int, hours: float) -> int:
        """Run for a while; return how much was wrong."""
        rig = Rig(self.mode, self.error_code, self.kinds, seed)
        while rig.clock() < hours * _HOUR:
            rig.disturb(self.rate, _STRETCH)
            rig.settle()
        ears, wire = rig.judge.ears, rig.wire
        self.theory = self.theory or Theory(
            wire.samples, rig.network.checksum, rig.network.duplex, self.kinds, self.rate,
            self.trials)
        self.hours += rig.clock() / _HOUR
        self.sums.update(rig.judge.counts)
        self.sums.update({
            'characters': wire.characters, 'singles': wire.singles, 'several': wire.several,
            'refused': sum(ear.refused for ear in ears), 'unseen': rig.judge.unseen})
        self.longest, self.bound = max(self.longest, rig.longest), rig.bound
        self.recoveries += rig.recoveries
        return rig.judge.faults

    def row(self) -> list[str]:
        """Return the figures as text."""
        sums = self.sums
        assert self.theory is not None
        expected = self.theory.expected(
            sums['singles'], sums['several'], sums['refused'] + sums['unseen'])
        errors = 'mixed' if self.kinds == LISTED else self.kinds[0].value
        values = sums['values'] + sums['served']
        return [
            self.mode, self.error_code, errors, f'{self.rate:g}', f'{self.hours:.1f}',
            f'{sums["characters"] / 1e6:.1f}', f'{values}',
            f'{sums["singles"] + sums["several"]}', f'{sums["refused"]}', f'{sums["unseen"]}',
            f'{expected:.1f}', f'{sums["deceived values"] + sums["deceived writes"]}',
            f'{sums["wrong values"]}', f'{sums["writes"]}', f'{sums["UNKNOWN"]}',
            f'{sums["deceived commands"] + sums["deceived results"]}', f'{sums["twice"]}',
            f'{sums["false results"] + sums["results missing"]}', f'{self.longest:.1f}',
            f'{self.bound:.0f}', f'{sum(self.recoveries) / len(self.recoveries):.1f}',
            f'{max(self.recoveries):.1f}']


def main() -> int:
    """Run; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('modes', nargs='*', default=MODES, metavar='MODE',
                        help=f'of {", ".join(MODES)}; all unless told')
    parser.add_argument('--check', choices=('CRC', 'BCC'), action='append')
    parser.add_argument('--rate', type=float, action='append', help='errors a byte')
    parser.add_argument('--kinds', action='store_true', help='each kind of error by itself')
    parser.add_argument('--hours', type=float, default=1.0, help='of line time a round (1)')
    parser.add_argument('--rounds', type=int, default=1, help='with another seed each (1)')
    parser.add_argument('--seed', type=int, default=1, help='of the first round (1)')
    arguments = parser.parse_args()
    if unknown := set(arguments.modes) - set(MODES):
        parser.error(f'there is no mode {", ".join(sorted(unknown))}')
    kinds = [(kind,) for kind in Kind] if arguments.kinds else [LISTED]
    cases = [Case(mode, check, kind, rate) for check, mode, kind, rate in product(
        arguments.check or ('CRC', 'BCC'), arguments.modes, kinds, arguments.rate or RATES)]
    wrong = 0
    for seed in range(arguments.seed, arguments.seed + arguments.rounds):
        began = time.process_time()
        wrong += sum(case.run(seed, arguments.hours) for case in cases)
        print(f'\nseed {seed}, {time.process_time() - began:.0f} s of processor time')
        _print([_HEAD, *(case.row() for case in cases)])
    return int(wrong > 0)


def _print(rows: Sequence[Sequence[str]]) -> None:
    widths = [max(map(len, column)) for column in zip(*rows)]
    for row in rows:
        print(' '.join(f'{cell:>{width}}' for cell, width in zip(row, widths)), flush=True)


if __name__ == '__main__':
    sys.exit(main())
