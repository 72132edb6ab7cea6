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

"""Mistakes that are drawn from the deciding code, or read from a file."""

import json
from pathlib import Path

import pytest
from stories.drawn import draw, Edit, read_lot

_FILE = 'abdf1_ros/driver/kernel/flights.py'
_CODE = """\
def lands(self, now):
    until = max(self.until, self.opened)
    self.looked = now
    self.forget(now)
    return now < until and self.begun or until is None
"""


def _root(folder: Path) -> Path:
    path = folder / _FILE
    path.parent.mkdir(parents=True)
    path.write_text(_CODE)
    return folder


def _all(root: Path) -> list[Edit]:
    found: dict[str, Edit] = {}
    for seed in range(40):
        found |= {str(edit): edit for edit in draw(root, seed, 3)}
    return [*found.values()]


def test_each_kind_of_mistake_is_drawn(tmp_path: Path) -> None:
    edits = _all(_root(tmp_path))
    lines = {line for edit in edits for line in edit.texts[_FILE].split('\n')}
    lines -= {*_CODE.split('\n')}
    assert lines == {
        '    until = (max([self.until]))', '    until = (max([self.opened]))', '    pass',
        '    return (now >= until) and self.begun or until is None',
        '    return (True) and self.begun or until is None',
        '    return (False) and self.begun or until is None',
        '    return ((now < until)) or until is None',
        '    return ((self.begun)) or until is None',
        '    return ((now < until and self.begun))', '    return ((until is None))',
        '    return now < until and self.begun or (until is not None)'}
    assert {str(edit).partition(',')[0] for edit in edits} == {
        'comparison turned', 'term left out', 'event ignored', 'time not compared'}


def test_seed_draws_the_same_mistakes_again(tmp_path: Path) -> None:
    root = _root(tmp_path)
    assert draw(root, 7, 2) == draw(root, 7, 2) != draw(root, 8, 2)


def test_mistakes_of_a_file_have_to_fit(tmp_path: Path) -> None:
    root, file = _root(tmp_path), _FILE
    lot = tmp_path / 'lot.json'
    mistake = {'name': 'a1', 'what': 'forgets nothing', 'changes': [
        [file, '    self.forget(now)\n', ''], [file, 'self.looked', 'self.seen']]}
    lot.write_text(json.dumps([mistake]))
    edit, = read_lot(root, lot)
    assert str(edit) == 'a1, forgets nothing'
    text = edit.texts[file]
    assert 'forget' not in text and 'seen' in text and 'looked' not in text
    mistake['changes'][0][1] = 'no such text'  # type: ignore[index]
    lot.write_text(json.dumps([mistake]))
    with pytest.raises(SystemExit, match="a1, forgets nothing: .* has 0 times 'no such text'"):
        read_lot(root, lot)
