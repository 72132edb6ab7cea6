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
Fuzz all targets, one after the other, from the stored corpus; status 1 when something is found.

``--work FOLDER`` keeps what is found interesting, and begins with it the next time.
``--store`` puts into the corpus what of that brings coverage, short inputs first.
"""

import argparse
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
import hashlib
import importlib
from pathlib import Path
import random
import re
import subprocess
import sys
import tempfile
from types import FrameType
from typing import Any

_HERE = Path(__file__).resolve().parent
sys.path[:0] = map(str, Path(__file__).resolve().parents[1:4])

from fuzz import corpus  # noqa: E402

# Seconds after which one input counts as endless, MB that a target may use, and bytes of an
# input, which are some frames or rows.
_LONGEST = 20
_MEMORY = 2048
_LENGTH = 1000

# So many inputs are stored for a step from one line of the package to another, as many as there
# are, beside those that are made for the target.
_TIMES = 2
_Step = tuple[str, int, int]  # a file, and two lines
_PACKAGE = str(Path(__file__).resolve().parents[3] / 'abdf1_ros')


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of one target; ``finding`` is empty when it ran and nothing was found."""

    target: str
    executions: int
    seconds: int
    finding: str = ''

    def __str__(self) -> str:
        """Return one line of the table."""
        rate = self.executions // max(1, self.seconds)
        return (f'{self.target:<14}{self.executions:>12,}{self.seconds:>8}{rate:>10,}  '
                f'{self.finding or "nothing found"}')


def main() -> int:
    """Fuzz; return the exit status."""
    arguments = _arguments()
    work = arguments.work or Path(tempfile.mkdtemp(prefix='abdf1_fuzz_'))
    if arguments.store:
        for target in arguments.targets:
            _store(target, work)
        return 0
    seconds = max(1, arguments.seconds // len(arguments.targets))
    print(f'{"target":<14}{"executions":>12}{"seconds":>8}{"a second":>10}')
    found = False
    for target in arguments.targets:
        outcome = _fuzz(target, work, seconds)
        print(outcome, flush=True)
        found |= bool(outcome.finding)
    return int(found)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('targets', nargs='*', default=corpus.TARGETS, metavar='TARGET',
                        help=f'of {", ".join(corpus.TARGETS)}; all unless told')
    parser.add_argument('--seconds', type=int, default=60, help='for all targets together (60)')
    parser.add_argument('--draw', type=int, metavar='N', help='try N of the targets, drawn anew')
    parser.add_argument('--work', type=Path, help='where new inputs are kept')
    parser.add_argument('--store', action='store_true', help='store what brings coverage')
    arguments = parser.parse_args()
    unknown = set(arguments.targets) - set(corpus.TARGETS)
    if unknown:
        parser.error(f'there is no target {", ".join(sorted(unknown))}')
    if arguments.draw is not None:
        arguments.targets = random.sample(
            [*arguments.targets], min(arguments.draw, len(arguments.targets)))
    return arguments


def _fuzz(target: str, work: Path, seconds: int) -> Outcome:
    folder = _write_inputs(target, work)
    findings = work / 'findings'
    findings.mkdir(exist_ok=True)
    said = _fuzzer(target, f'-max_total_time={seconds}', f'-timeout={_LONGEST}',
                   f'-rss_limit_mb={_MEMORY}', '-print_final_stats=1', f'-max_len={_LENGTH}',
                   f'-artifact_prefix={findings}/{target}-', str(folder))
    count = re.search(r'number_of_executed_units: (\d+)', said.stderr)
    done = re.search(r'Done \d+ runs in (\d+) second', said.stderr)
    if said.returncode or count is None or done is None:
        print(said.stdout + said.stderr, file=sys.stderr)
        if count is None:
            return Outcome(target, 0, 0, 'DID NOT RUN: see above')
        return Outcome(target, int(count[1]), seconds,
                       f'FOUND: see above; the input is in {findings}')
    return Outcome(target, int(count[1]), int(done[1]))


def _store(target: str, work: Path) -> None:
    """Replace the stored corpus by those of stored and new inputs that coverage needs."""
    one_input = importlib.import_module(f'fuzz.{target}').one_input
    seeds = {b'', *corpus.seeds(target)}
    found = {path.read_bytes() for path in _write_inputs(target, work).iterdir()} - seeds
    seen: Counter[_Step] = Counter()
    for data in seeds:
        seen.update(_steps(one_input, data))
    kept = []
    for data in sorted(found, key=lambda data: (len(data), data)):
        steps = _steps(one_input, data)
        if any(seen[step] < _TIMES for step in steps):
            kept.append(data)
            seen.update(steps)
    corpus.store(target, kept)
    print(f'{target}: {len(kept)} of {len(found)} inputs stored')


def _steps(one_input: Callable[[bytes], None], data: bytes) -> set[_Step]:
    """Return the steps from line to line that the package takes with an input."""
    steps: set[_Step] = set()

    def trace(frame: FrameType, event: str, argument: object) -> Callable[..., Any] | None:
        if not frame.f_code.co_filename.startswith(_PACKAGE):
            return None
        before = frame.f_lineno

        def trace_lines(frame: FrameType, event: str, argument: object) -> Callable[..., Any]:
            nonlocal before
            steps.add((frame.f_code.co_filename, before, frame.f_lineno))
            before = frame.f_lineno
            return trace_lines

        return trace_lines

    sys.settrace(trace)
    try:
        one_input(data)
    finally:
        sys.settrace(None)
    return steps


def _write_inputs(target: str, work: Path) -> Path:
    """Put seeds and stored inputs beside those that are kept already."""
    folder = work / target
    folder.mkdir(parents=True, exist_ok=True)
    for data in [*corpus.seeds(target), *corpus.stored(target)]:
        (folder / hashlib.sha1(data).hexdigest()).write_bytes(data)
    return folder


def _fuzzer(target: str, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, str(_HERE / 'fuzzer.py'), f'--target={target}', *options],
        capture_output=True, text=True, errors='replace', check=False)


if __name__ == '__main__':
    sys.exit(main())
