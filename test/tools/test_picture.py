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

"""Pictures of terminals show what the command has printed, and only when it went well."""

from pathlib import Path
import sys
from xml.etree import ElementTree

import pytest

from tools import picture

TEXT = '{http://www.w3.org/2000/svg}text'


def lines(svg: str) -> list[str]:
    """Return the lines of text in a picture."""
    return [entry.text or '' for entry in ElementTree.fromstring(svg).iter(TEXT)]


def test_every_line_is_drawn_in_its_place() -> None:
    svg = picture.picture('make demo', '1. Reads <&>\n\n    N7:0  5\n')
    assert lines(svg) == ['$ make demo', '1. Reads <&>', '    N7:0  5']
    heights = [int(entry.get('y', '')) for entry in ElementTree.fromstring(svg).iter(TEXT)]
    assert [later - earlier for earlier, later in zip(heights, heights[1:])] == [16, 32]


def test_long_lines_are_cut() -> None:
    assert lines(picture.picture('x', 'long ' * 40))[1] == ('long ' * 40)[:129] + '...'


def test_errors_have_a_colour_of_their_own() -> None:
    svg = picture.picture('x', 'link ERROR: closed\nlink WARN: slow\n  plain')
    fills = [entry.get('fill') for entry in ElementTree.fromstring(svg).iter(TEXT)]
    assert len(set(fills)) == 4


def test_what_a_command_prints_becomes_a_file(tmp_path: Path) -> None:
    file = tmp_path / 'run.svg'
    command = 'import os; print("hello", os.getcwd() + "/config/net.csv")'
    assert picture.main([str(file), 'hello', sys.executable, '-c', command]) == 0
    assert lines(file.read_text(encoding='utf-8')) == ['$ hello', 'hello config/net.csv']


def test_a_command_that_fails_leaves_no_picture(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'run.svg'
    command = [sys.executable, '-c', 'print("no"); raise SystemExit(3)']
    assert picture.main([str(file), 'hello', *command]) == 3
    assert capsys.readouterr().out == 'no\n'
    assert not file.exists()
