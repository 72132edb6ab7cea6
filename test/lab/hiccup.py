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
Run a command while its processes stand still now and then, as on a busy or sleeping host.

Every --every seconds (by chance between the two) one of its Python processes gets SIGSTOP, and
SIGCONT --still seconds later. One that stands still already is left alone. What fails under it
depends on how prompt the host is. The status is that of the command.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from contextlib import suppress
import os
from pathlib import Path
from random import Random
import signal
import subprocess
import sys
import time


def running_descendants(root: int) -> list[int]:
    """Return the Python processes that come of ``root`` and have neither stopped nor ended."""
    children: defaultdict[str, list[str]] = defaultdict(list)
    states: dict[str, str] = {}
    for file in Path('/proc').glob('[0-9]*/stat'):
        with suppress(OSError):  # it has ended
            state, parent = file.read_text(encoding='utf-8').rpartition(') ')[2].split()[:2]
            states[file.parent.name] = state
            children[parent].append(file.parent.name)
    found, left = [], [*children[str(root)]]
    while left:
        number = left.pop()
        left += children[number]
        with suppress(OSError):
            is_python = b'python' in Path(f'/proc/{number}/cmdline').read_bytes()
            if is_python and states[number] not in 'TZ':
                found.append(int(number))
    return sorted(found)


def main() -> int:
    """Run the command; return its status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--every', type=float, nargs=2, default=(0.5, 3.0), metavar='S')
    parser.add_argument('--still', type=float, nargs=2, default=(0.2, 2.0), metavar='S')
    parser.add_argument('command', nargs='+')
    wanted = parser.parse_args()
    dice, stops = Random(wanted.seed), 0
    with subprocess.Popen(wanted.command) as process:
        while process.poll() is None:
            time.sleep(dice.uniform(*wanted.every))
            numbers = running_descendants(process.pid)
            if not numbers:
                continue
            number = dice.choice(numbers)
            with suppress(OSError):  # it has ended
                os.kill(number, signal.SIGSTOP)
                time.sleep(dice.uniform(*wanted.still))
                os.kill(number, signal.SIGCONT)
                stops += 1
    print(f'hiccup: {stops} stops, seed {wanted.seed}', file=sys.stderr)
    return process.returncode


if __name__ == '__main__':
    sys.exit(main())
