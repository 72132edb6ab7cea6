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

"""What fails among many cases is named, and nothing is left out."""

import os
from pathlib import Path
import select
import subprocess
import sys

import pytest
from support.cases import for_all

taken: list[tuple[int, str]] = []


@for_all('number', [1, 2])
@for_all(('text', 'size'), [('a', 1), ('bc', 2)])
def test_every_case_is_taken_with_the_fixtures(tmp_path: Path, number: int, text: str,
                                               size: int) -> None:
    assert tmp_path.is_dir() and len(text) == size
    taken.append((number, text))


def test_all_of_them() -> None:
    assert taken == [(1, 'a'), (1, 'bc'), (2, 'a'), (2, 'bc')]


def test_failure_is_named() -> None:
    @for_all('path', [Path('good.csv'), Path('bad.csv')])
    @for_all('number', [7])
    def check(path: Path, number: int) -> None:
        assert path.name == 'good.csv'

    with pytest.raises(AssertionError) as caught:
        check()
    assert caught.value.__notes__ == ['case: number = 7', 'case: path = bad.csv']

    @for_all('text', ['7', 'a', 'b'])
    def refuse(text: str) -> None:
        with pytest.raises(ValueError):
            int(text)

    with pytest.raises(pytest.fail.Exception) as missing:
        refuse()
    assert missing.value.__notes__ == ["case: text = '7'"]

    @for_all('number', [0, 5, 6])
    def count(number: int) -> None:
        assert not number

    with pytest.raises(BaseExceptionGroup, match='2 of 3 cases') as both:
        count()
    assert [error.__notes__ for error in both.value.exceptions] == [
        ['case: number = 5'], ['case: number = 6']]
    with pytest.raises(AssertionError):  # a table that was renamed would test nothing
        for_all('path', [])


def test_program_ends_with_the_killed_session_that_started_it(tmp_path: Path) -> None:
    (tmp_path / 'endless').write_text(
        'import os, time; print(os.getpid(), flush=True); time.sleep(300)')
    code = (f'from support.forked import *; program = Forked(Path("{tmp_path}/endless"), []);'
            'print(program.stdout.readline(), flush=True); program.wait()')
    with subprocess.Popen([sys.executable, '-c', code], cwd=Path(__file__).parents[1],
                          stdout=subprocess.PIPE) as session:
        ends = os.pidfd_open(int(session.stdout.readline()))  # type: ignore[union-attr]
        session.kill()
    assert select.select([ends], [], [], 20.0)[0]
