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
Make one small mistake at a time in the package, and tell which ones no test finds.

A sample of all single mistakes (``mutants.py``) is taken with a fixed seed. Each is made in a copy
of this directory; then the tests of the module run, and where they find nothing, all tests of its
room. What hangs counts as found. Some survivors change nothing that anybody could see; the others
are missing tests. With --everywhere all other tests run against what the room has not found.
"""

from __future__ import annotations

import argparse
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
import os
from pathlib import Path
from queue import SimpleQueue
from random import Random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

_ROOT = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(_ROOT / 'test'))

from mutation.mutants import Mutant, mutants, mutated  # noqa: E402

ROOMS = ('df1', 'pccc', 'settings', 'plan', 'driver', 'ports', 'ros')

_LIMIT = 120  # s for a test; what takes longer hangs
_MOST = 1800  # s for all tests of a mistake


def main() -> int:
    """Run; return the exit status, 1 where the tests fail without any mistake."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('rooms', nargs='*', default=ROOMS, metavar='ROOM', help=(
        f'of {", ".join(ROOMS)}; all unless told'))
    parser.add_argument('--count', type=int, default=200, help='so many mistakes (200)')
    parser.add_argument('--seed', type=int, default=1, help='another one gives another sample')
    parser.add_argument('--jobs', type=int, default=2, help='so many at a time (2)')
    parser.add_argument('--everywhere', action='store_true', help='see above')
    arguments = parser.parse_args()
    if unknown := {*arguments.rooms} - {*ROOMS}:
        parser.error(f'there is no room {", ".join(sorted(unknown))}')
    sample = _sample(arguments.rooms, arguments.count, arguments.seed)
    with tempfile.TemporaryDirectory(prefix='abdf1_mutants_') as folder:
        copies: SimpleQueue[Path] = SimpleQueue()
        for number in range(arguments.jobs):
            copies.put(_copy(Path(folder) / str(number)))
        copy = copies.get()
        rooms = sorted({_room(mutant) for mutant in sample})
        if not _passes(copy, [f'test/{room}' for room in rooms], is_told=True):
            print('these tests fail without any mistake', file=sys.stderr)
            return 1
        copies.put(copy)

        def tell(mutant: Mutant) -> str:
            copy = copies.get()
            try:
                return _found_by(mutant, copy, arguments.everywhere)
            finally:
                copies.put(copy)

        began = time.monotonic()
        with ThreadPoolExecutor(arguments.jobs) as pool:
            found = []
            for mutant, by in zip(sample, pool.map(tell, sample), strict=True):
                found.append(by)
                print(f'{len(found):>4} {by or "SURVIVES":<10} {mutant}', flush=True)
    _report(sample, found, time.monotonic() - began)
    return 0


def _sample(rooms: list[str], count: int, seed: int) -> list[Mutant]:
    every = []
    for room in rooms:
        for path in sorted((_ROOT / 'abdf1_ros' / room).rglob('*.py')):
            every += mutants(path.relative_to(_ROOT), path.read_text(encoding='utf-8'))
    print(f'{len(every):,} mistakes can be made; {count} of them, seed {seed}')
    return Random(seed).sample(every, min(count, len(every)))


def _room(mutant: Mutant) -> str:
    return mutant.module.parts[1]


def _copy(to: Path) -> Path:
    """Copy what the tests need; files that git ignores are left out, bytecode too."""
    names = subprocess.run(['git', 'ls-files', '-z'], cwd=_ROOT, check=True, capture_output=True,
                           text=True).stdout.split('\0')[:-1]
    for name in names:
        with suppress(FileNotFoundError):  # removed, but not for git yet
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(_ROOT / name, to / name)
    subprocess.run([sys.executable, '-m', 'compileall', '-q', 'abdf1_ros', 'test'], cwd=to,
                   check=True)
    return to


def _found_by(mutant: Mutant, copy: Path, everywhere: bool) -> str:
    """Return which tests find a mistake: those of its module, its room, others, or none ('')."""
    path = copy / mutant.module
    source = path.read_text(encoding='utf-8')
    path.write_text(mutated(mutant, source), encoding='utf-8')
    folder = Path('test', *mutant.module.parts[1:-1])
    own = sorted(str(test.relative_to(copy))
                 for test in (copy / folder).glob(f'test_{mutant.module.stem}*.py'))
    stages = {'its tests': own, 'its room': [f'test/{_room(mutant)}']}
    if everywhere:
        stages['others'] = ['test', f'--ignore=test/{_room(mutant)}']
    try:
        return next((name for name, tests in stages.items()
                     if tests and not _passes(copy, tests)), '')
    finally:
        path.write_text(source, encoding='utf-8')


def _passes(copy: Path, tests: list[str], is_told: bool = False) -> bool:
    """Run tests in a copy until the first one fails; tell whether none does."""
    # No new bytecode: that of a mistake could be taken for the next one's of the same second.
    environment = os.environ | {'PYTHONPATH': str(copy), 'PYTHONDONTWRITEBYTECODE': '1'}
    # A test that hangs ends the process: hypothesis would repeat it, without a limit.
    process = subprocess.Popen(
        [sys.executable, '-m', 'pytest', '-q', '-x', '-p', 'no:cacheprovider',
         f'--timeout={_LIMIT}', '--timeout-method=thread', *tests],
        cwd=copy, env=environment, stdout=None if is_told else subprocess.DEVNULL,
        stderr=subprocess.STDOUT, start_new_session=True)
    try:
        return process.wait(_MOST) == 0
    except subprocess.TimeoutExpired:
        return False
    finally:
        with suppress(ProcessLookupError):  # with all that it has started
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _report(sample: list[Mutant], found: list[str], duration: float) -> None:
    made, caught = Counter(map(_room, sample)), Counter(
        _room(mutant) for mutant, by in zip(sample, found, strict=True) if by)
    print()
    for room in ROOMS:
        if made[room]:
            print(f'{room:<9} {caught[room]:>4} of {made[room]:>4} found')
    print(f'all       {caught.total():>4} of {len(sample):>4} found: '
          f'{caught.total() / len(sample):.0%}, {found.count("its tests")} of them by the tests '
          f'of the module itself; {duration / 60:.0f} minutes')
    print('\nnot found:')
    for mutant, by in zip(sample, found, strict=True):
        if not by:
            print(f'  {mutant}')


if __name__ == '__main__':
    sys.exit(main())
