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

"""The generated parts of the documentation are those of the code as it is now."""

from pathlib import Path

from abdf1_ros.counters import numbered
from abdf1_ros.driver.write import Outcome
from abdf1_ros.messages import Message
import pytest

from tools import reference
from tools.explanations import COUNTERS, MESSAGES, OUTCOMES


def test_every_message_has_cause_and_cure() -> None:
    assert list(MESSAGES) == list(Message)
    assert [entry for entry in MESSAGES.values() if not entry.cause or not entry.cure] == []


def test_every_counter_is_explained() -> None:
    assert list(COUNTERS) == [entry.name for entry in numbered()]
    assert all(COUNTERS.values())


def test_every_outcome_of_a_write_is_explained() -> None:
    assert list(OUTCOMES) == list(Outcome)
    assert all(OUTCOMES.values())


def test_numbers_2501_to_2561_are_all_documented() -> None:
    folder = reference.ROOT / reference.REFERENCE
    text = ''.join((folder / name).read_text(encoding='utf-8')
                   for name in ('messages.md', 'counters.md'))
    rows = [line for line in text.splitlines() if line.startswith('| ')]
    for number in range(2501, 2562):
        assert sum(row.startswith((f'| {number} ', f'| <a id="{number}"></a>{number} '))
                   for row in rows) == 1, number


def test_part_goes_between_its_markers() -> None:
    text = 'a\n<!-- generated: x -->\nold\n<!-- end: x -->\nb\n'
    assert reference.filled(text, 'x', 'new') == \
        'a\n<!-- generated: x -->\n\nnew\n\n<!-- end: x -->\nb\n'
    assert reference.filled(reference.filled(text, 'x', 'new'), 'x', 'old') == \
        reference.filled(text, 'x', 'old')


def test_missing_marker_is_named() -> None:
    with pytest.raises(LookupError, match='no markers "generated: y"'):
        reference.filled('text', 'y', 'new')


def test_main_writes_what_has_changed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                      capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'page.md'
    file.write_text('<!-- generated: x -->\n<!-- end: x -->\n', encoding='utf-8')
    monkeypatch.setattr(reference, 'ROOT', tmp_path)
    monkeypatch.setattr(reference, 'PARTS', {('page.md', 'x'): lambda: 'new'})
    assert reference.main() == 0
    assert '\nnew\n' in file.read_text(encoding='utf-8')
    assert reference.main() == 0
    assert capsys.readouterr().out == 'page.md: x\n'
