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
room; which ones these are is told. What hangs counts as found. Some survivors change nothing that
anybody could see; the others are missing tests. With --everywhere all other tests run against what
the room has not found.
"""

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

_ROOT = Path(__file__).resolve().parents[3]
sys.path[:0] = [str(_ROOT), str(_ROOT / 'test'), str(_ROOT / 'test' / 'lab')]

from mutation.mutants import Mutant, mutants, mutated  # noqa: E402

from tools import rooms  # noqa: E402

# Every room with a folder; the modules beside the folders are one more.
_TOP = 'top'
ROOMS = (*(room.paths[0] for room in rooms.ROOMS if '.' not in room.paths[0]), _TOP)

# What uses the modules beside the folders that have no tests of their own.
_USERS = ('settings', 'cli', 'test_reference.py')

_SURVIVES = 'SURVIVES'
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
        tests = sorted({test for mutant in sample for test in _tests_of_room(copy, mutant)})
        print(f'without any mistake: {" ".join(tests)}', flush=True)
        if not _passes(copy, tests, is_told=True):
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
                print(f'{len(found):>4} {mutant}\n     {by}', flush=True)
    _report(sample, found, time.monotonic() - began)
    return 0


def _sample(rooms: list[str], count: int, seed: int) -> list[Mutant]:
    every = []
    package = _ROOT / 'abdf1_ros'
    for room in rooms:
        found = package.glob('*.py') if room == _TOP else (package / room).rglob('*.py')
        for path in sorted(found):
            every += mutants(path.relative_to(_ROOT), path.read_text(encoding='utf-8'))
    print(f'{len(every):,} mistakes can be made; {count} of them, seed {seed}')
    return Random(seed).sample(every, min(count, len(every)))


def _room(mutant: Mutant) -> str:
    return _TOP if len(mutant.module.parts) == 2 else mutant.module.parts[1]


def _tests_of_module(copy: Path, mutant: Mutant) -> list[str]:
    folder = copy.joinpath('test', *mutant.module.parts[1:-1])
    # A family of pccc has one file for its folder.
    found = [*folder.glob(f'test_{mutant.module.stem}*.py'),
             *folder.parent.glob(f'test_{folder.name}.py')]
    return sorted(str(test.relative_to(copy)) for test in found)


def _tests_of_room(copy: Path, mutant: Mutant) -> list[str]:
    if _room(mutant) != _TOP:
        return [f'test/{_room(mutant)}']
    return _tests_of_module(copy, mutant) or [f'test/{name}' for name in _USERS]


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
    """Return which tests find a mistake: of its module, its room, others, or none (SURVIVES)."""
    path = copy / mutant.module
    source = path.read_text(encoding='utf-8')
    path.write_text(mutated(mutant, source), encoding='utf-8')
    stages = {'its tests': _tests_of_module(copy, mutant),
              'its room': _tests_of_room(copy, mutant)}
    if everywhere:
        stages['others'] = ['test', f'--ignore=test/{_room(mutant)}']
    try:
        for name, tests in stages.items():
            if tests and not _passes(copy, tests):
                return f'{name}: {" ".join(tests)}'
        return f'{_SURVIVES}: {" ".join(sum(stages.values(), []))}'
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
        _room(mutant) for mutant, by in zip(sample, found, strict=True)
        if not by.startswith(_SURVIVES))
    print()
    for room in ROOMS:
        if made[room]:
            print(f'{room:<9} {caught[room]:>4} of {made[room]:>4} found')
    own = sum(by.startswith('its tests') for by in found)
    print(f'all       {caught.total():>4} of {len(sample):>4} found: '
          f'{caught.total() / len(sample):.0%}, {own} of them by the tests '
          f'of the module itself; {duration / 60:.0f} minutes')
    print('\nnot found:')
    for mutant, by in zip(sample, found, strict=True):
        if by.startswith(_SURVIVES):
            print(f'  {mutant}')


if __name__ == '__main__':
    sys.exit(main())
