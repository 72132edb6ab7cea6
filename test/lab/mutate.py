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
Make one small mistake at a time in a part of the package, and tell which ones its tests miss.

mutmut makes the mistakes, in a copy, and runs for each the tests that reach it. It makes none in
properties and tables, and is not for what needs ROS, whose threads do not survive a fork. Some of
the survivors change nothing that anybody could see; the others are missing tests.

A part is a folder or a module, such as driver, pccc/plc2 (--tests test/pccc), or client.py.
"""

import argparse
import json
from pathlib import Path
from random import Random
import shutil
import subprocess
import sys
import tempfile

_ROOT = Path(__file__).resolve().parents[2]
_COUNTING = 'test/driver/test_work.py'  # counts calls: those of mutmut, too
_PATCHING = '*/test_made_up.py'  # patches are for the code without mistakes
_MISSED = (0, 33, None)  # its tests pass, none reaches it, or it was not tried


def main() -> int:
    """Run; return the exit status: 1 where mutmut could not."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('part', help='see above')
    parser.add_argument('--tests', help='those that are run (those of the same folder or name)')
    parser.add_argument('--count', type=int, default=200, help='so many mistakes (%(default)s)')
    parser.add_argument('--seed', type=int, default=1, help='another one gives another sample')
    parser.add_argument('--jobs', type=int, default=2, help='so many at a time (%(default)s)')
    options = parser.parse_args()
    part = Path(options.part)
    tests = options.tests or 'test/' + str(
        part.with_name(f'test_{part.name}') if part.suffix else part)
    with tempfile.TemporaryDirectory(prefix='abdf1_mutants_') as folder:
        copy = Path(folder) / 'copy'
        _copy(copy, f'abdf1_ros/{part}' + ('' if part.suffix else '/*'), tests)
        mutmut = [sys.executable, '-m', 'mutmut']
        run = [*mutmut, 'run', f'--max-children={options.jobs}']
        subprocess.run([*run, 'none'], cwd=copy, check=False)  # makes them, and tries none
        names = sorted(_results(copy))
        print(f'{len(names):,} mistakes can be made; {options.count} of them, seed {options.seed}')
        sample = Random(options.seed).sample(names, min(options.count, len(names)))
        status = subprocess.run([*run, *sample], cwd=copy, check=False).returncode
        found = _results(copy)
        missed = [name for name in sample if found[name] in _MISSED]
        for name in missed:
            subprocess.run([*mutmut, 'show', name], cwd=copy, check=False)
        print(f'\n{options.part}: {len(sample) - len(missed)} of {len(sample)} found')
    return int(status != 0 or not sample)


def _copy(to: Path, modules: str, tests: str) -> None:
    """Copy what git knows, with the settings of mutmut."""
    names = subprocess.run(['git', 'ls-files', '-z'], cwd=_ROOT, check=True, capture_output=True,
                           text=True).stdout.split('\0')[:-1]
    for name in names:
        if (_ROOT / name).exists():  # it may be removed, but not for git yet
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(_ROOT / name, to / name)
    others = sorted({name.split('/')[0] for name in names} - {'abdf1_ros'})
    lines = ['source_paths=abdf1_ros', f'only_mutate={modules}',
             f'pytest_add_cli_args_test_selection={tests}', 'pytest_add_cli_args=',
             f'    --ignore={_COUNTING}', f'    --ignore-glob={_PATCHING}', '    -p',
             '    no:cacheprovider',
             'also_copy=', *(f'    {name}' for name in others)]
    with (to / 'setup.cfg').open('a', encoding='utf-8') as file:
        print('\n[mutmut]', *lines, sep='\n', file=file)


def _results(copy: Path) -> dict[str, int | None]:
    """Return the status of pytest for each mistake, None where it was not tried."""
    found: dict[str, int | None] = {}
    for path in (copy / 'mutants').rglob('*.meta'):
        found |= json.loads(path.read_text(encoding='utf-8'))['exit_code_by_key']
    return found


if __name__ == '__main__':
    sys.exit(main())
