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
Plant mistakes that a person has written, one at a time, and tell which ones ``make test`` misses.

A lot is a file such as test/lab/planted/137.json: a commit, and for each mistake its file, a text
that occurs there once, what stands there instead, and what a user meets. Whoever writes a lot
reads no test. The commit is made ready in a folder of its own, so a lot can be judged for ever.
Look at the failing test of each mistake: one that fails because the host is busy has found none.
"""

import argparse
import json
from pathlib import Path
import subprocess
import sys
import tempfile

_ROOT = Path(__file__).resolve().parents[2]


def main() -> int:
    """Run; return the exit status: 1 where a mistake does not fit its commit."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('lot', type=Path, help='see above')
    parser.add_argument('--only', nargs='*', help='ids of mistakes (all)')
    options = parser.parse_args()
    lot = json.loads(options.lot.read_text(encoding='utf-8'))
    mistakes = [mistake for mistake in lot['mistakes']
                if not options.only or mistake['id'] in options.only]
    with tempfile.TemporaryDirectory(prefix='abdf1_planted_') as folder:
        tree = Path(folder) / 'tree'
        subprocess.run(['git', 'clone', '--quiet', _ROOT, tree], check=True)
        subprocess.run(['git', 'checkout', '--quiet', lot['commit']], cwd=tree, check=True)
        subprocess.run(['make', 'setup'], cwd=tree, check=True, stdout=subprocess.DEVNULL)
        found = [_judge(tree, mistake) for mistake in mistakes]
    print(f'{options.lot.name}: {found.count(True)} of {len(found)} found')
    return int(None in found)


def _judge(tree: Path, mistake: dict[str, str]) -> bool | None:
    """Return whether ``make test`` finds a mistake; None if it does not fit."""
    path, name = tree / mistake['file'], f'{mistake["id"]} {mistake["file"]}'
    text = path.read_text(encoding='utf-8')
    if text.count(mistake['old']) != 1:
        print(f'{name}: the old text occurs {text.count(mistake["old"])} times', flush=True)
        return None
    path.write_text(text.replace(mistake['old'], mistake['new']), encoding='utf-8')
    run = subprocess.run(['make', 'test', 'PYTEST_ARGS=-x -q'], cwd=tree, check=False,
                         capture_output=True, text=True)
    path.write_text(text, encoding='utf-8')
    tests = [line for line in run.stdout.splitlines() if line.startswith(('FAILED', 'ERROR'))]
    told = '; '.join(tests) or run.stderr.strip()
    print(f'{name}: {told if run.returncode else "MISSED: " + mistake["what"]}', flush=True)
    return run.returncode != 0


if __name__ == '__main__':
    sys.exit(main())
