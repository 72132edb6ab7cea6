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
Try for hours what the tests try for minutes, each time with something new.

The parts, each for its share of the time: ``properties`` (all property tests, with new examples),
``tests`` (the tests that are too long for ``make test``), ``simulate`` (plants of any kind),
``stories`` (all pairs of faults of tiny plants), ``explorer`` (the kernel by itself),
``rehearsal`` (hosts that die, and their spares), ``fuzz`` (all targets, from a corpus that is
kept), ``faults`` (each fault of a byte, and pairs),
``noise`` and ``soak`` (every mode, in virtual time), ``bridge`` (node and simulator as processes,
with faults) and ``kills``. What they say is in the folder of ``--work``, with the corpus and the
examples that failed. At the end stands what was tried. The same seed draws the same, as far as
time does not decide. Status 1 when a part failed.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.util import find_spec
import os
from pathlib import Path
import re
import secrets
import signal
import subprocess
import sys
import time

_HERE = Path(__file__).resolve().parent
_ROOT = _HERE.parents[1]

_MODES = ('Message', 'Standard', 'Peer', 'Slave', 'Radio')
_LINKS = ('Master', *_MODES[1:])


@dataclass(slots=True)
class Part:
    """
    A program that is started again with another seed until its share of the time is over.

    ``arguments`` gets a seed and how many seconds are left. ``tried`` finds the numbers in what a
    run says that are to be summed up, each under its name. A run needs ``least`` s.
    """

    share: float
    arguments: Callable[[int, float], list[str]]
    tried: dict[str, str]
    least: float = 1.0
    runs: int = 0
    seconds: float = 0.0
    sums: dict[str, int] = field(default_factory=dict)
    failed: list[int] = field(default_factory=list)

    def run(self, seed: int, seconds: float, log: Path) -> None:
        """Run once; keep what it says."""
        began = time.monotonic()
        process = subprocess.Popen(
            [sys.executable, *self.arguments(seed, seconds)], cwd=_ROOT, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
            env=os.environ | {'ABDF1_ROS_EXAMPLES': 'new', 'PYTHONUNBUFFERED': '1'})
        try:
            said, _ = process.communicate(timeout=2 * seconds + 1200.0)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            said = f'{process.communicate()[0]}\nlong: it does not end'
        with log.open('a', encoding='utf-8') as file:
            file.write(f'seed {seed}\n{said}\n')
        self.runs += 1
        self.seconds += time.monotonic() - began
        for name, pattern in self.tried.items():
            found = sum(int(count.replace(',', '')) for count in re.findall(pattern, said))
            self.sums[name] = self.sums.get(name, 0) + found
        if process.returncode:
            self.failed.append(seed)

    def row(self, name: str) -> str:
        """Return what was tried."""
        tried = ', '.join(f'{count:,} {what}' for what, count in self.sums.items())
        end = f'FAILED with seed {", ".join(map(str, self.failed))}' if self.failed else 'passed'
        return f'{name:<11}{self.runs:>5} runs {self.seconds / 60:>7.1f} min  {end}; {tried}'


def parts(work: Path) -> dict[str, Part]:
    """Return all parts, by name."""
    def script(name: str, *options: str) -> list[str]:
        return [str(_HERE / name), *options]

    return {
        'properties': Part(0.1, lambda seed, left: [
            '-m', 'pytest', '-q', '-m', 'hypothesis', f'--hypothesis-seed={seed}',
            '-p', 'no:cacheprovider', '--hypothesis-show-statistics', '--timeout=3000'],
            {'examples': r'(\d+) passing', 'that failed': r'\d+ passing.*?, (\d+) failing'}),
        'tests': Part(0.05, lambda seed, left: ['-m', 'pytest', '-q', '-m', 'long'],
                      {'tests': r'(\d+) passed'}),
        'simulate': Part(0.1, lambda seed, left: script(
            'simulate/run.py', f'--seed={seed}', f'--seconds={left:.0f}'),
            {'plants': r'(?m)^(\d+) plants', 'values': r'(\d+) values'}),
        'stories': Part(0.1, lambda seed, left: script(
            'stories/walk.py', f'--seed={seed}', '--deviations=2', f'--seconds={left:.0f}'),
            {'stories': r'(?m)^(\d+) stories, '}),
        'explorer': Part(0.05, lambda seed, left: script(
            'explorer/explore.py', f'--seed={seed}', '--steps=7', '--events=3', '--faults=2',
            f'--seconds={left:.0f}'), {'stories': r' states, (\d+) stories'}),
        'rehearsal': Part(0.1, lambda seed, left: script(
            'rehearsal/run.py', f'--seed={seed}', f'--seconds={left:.0f}',
            *['--discovery-server'] * (seed % 2)),
            {'faults': r'(?m)^\w+ +(\d+) times', 'values': r'(\d+) values'}, least=600.0),
        'fuzz': Part(0.2, lambda seed, left: script(
            'fuzz/run.py', f'--seconds={left:.0f}', f'--work={work / "fuzz"}'),
            {'inputs': r'(?m)^\w+ +([\d,]+)[ \d,]+  '}),
        'faults': Part(0.1, lambda seed, left: script(
            'single_faults.py', f'--mode={_LINKS[seed % len(_LINKS)]}',
            f'--check={("CRC", "BCC")[seed // len(_LINKS) % 2]}', f'--seed={seed}',
            f'--seconds={left:.0f}'), {'single faults': r'(?m) ([\d,]+) single',
                                       'pairs': r'(?m) ([\d,]+) pairs'}),
        'noise': Part(0.1, lambda seed, left: script(
            'noise/run.py', _MODES[seed % len(_MODES)],
            f'--check={("CRC", "BCC")[seed // len(_MODES) % 2]}', f'--seed={seed}',
            '--hours=0.3'),
            {'values': r'(?m)^ *\w+ +(?:CRC|BCC) +\w+ +\S+ +\S+ +\S+ +(\d+) '}),
        'soak': Part(0.1, lambda seed, left: script(
            'soak/day.py', _MODES[seed % len(_MODES)], f'--seed={seed}', '--hours=2'),
            {'faults': r'hour  2: .* ([\d,]+) faults', 'writes': r'hour  2: .* ([\d,]+) writes'}),
        'bridge': Part(0.2, lambda seed, left: script(
            'soak/long_run.py', f'--seed={seed}', f'--minutes={max(3.0, left / 60):.1f}'),
            {'writes': r'(?m)^writes +(\d+)', 'values': r'(?m)^values of one topic +(\d+)'},
            least=180.0),
        'kills': Part(0.1, lambda seed, left: script(
            'soak/kills.py', '--rounds=1', f'--seed={seed}'),
            {'deaths': r'(?m)^\w[\w ]+\w +(\d+) +[\d.]+ +[\d.]+ +[\d.]+ '}),
    }


def main() -> int:
    """Run; return the exit status."""
    known = parts(Path())
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--hours', type=float, default=1.0, help='for all parts together (1)')
    parser.add_argument('--seed', type=int, default=secrets.randbelow(1 << 31),
                        help='of the first run of each part (another one each time)')
    parser.add_argument('--only', action='append', choices=tuple(known), help='this part')
    parser.add_argument('--work', type=Path, default=_ROOT / '.long', help='a folder (.long)')
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    chosen = {name: part for name, part in parts(options.work).items()
              if name in (options.only or known)}
    print(f'long: {options.hours:g} hours, --seed {options.seed}, what is said in {options.work}',
          flush=True)
    if 'fuzz' in chosen and find_spec('atheris') is None:
        print('fuzz       not done: there is no atheris here')
        del chosen['fuzz']
    shares = sum(part.share for part in chosen.values())
    for name, part in chosen.items():
        log = options.work / f'{name}.log'
        end = time.monotonic() + options.hours * 3600 * part.share / shares
        while not part.runs or end - time.monotonic() > part.least:
            part.run(options.seed + part.runs, end - time.monotonic(), log)
        print(part.row(name), flush=True)
    return int(any(part.failed for part in chosen.values()))


if __name__ == '__main__':
    sys.exit(main())
