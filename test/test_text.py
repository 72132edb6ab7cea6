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

"""Text that is shown cannot pass for something else."""

from abdf1_ros.text import by_number, first, printable
from hypothesis import given, strategies
import pytest
from support.cases import ANY_CHARACTER


@pytest.mark.parametrize('text', ['', 'N7:0', 'Größe 5 °C', 'скорость', '速度', 'a "b" \\n'])
def test_what_can_be_seen_stays(text: str) -> None:
    assert printable(text) == text


@pytest.mark.parametrize(('text', 'shown'), [
    ('one\n[FATAL] two', r'one\n[FATAL] two'),
    ('one\r\ntwo', r'one\r\ntwo'),
    ('\x1b[2J', r'\x1b[2J'),          # a terminal would clear its screen
    ('a\x00b\x7fc\x9bd', r'a\x00b\x7fc\x9bd'),
    ('a\u2028b\u2029c\x85d', r'a\u2028b\u2029c\x85d'),  # line ends to some viewers
    ('\u202eabc\u2066', r'\u202eabc\u2066'),            # turns the direction of writing
    ('\u200b\ufeff\xad', r'\u200b\ufeff\xad'),          # shows nothing
    ('\udc80', r'\udc80'),            # what no encoding takes
    ('\U000e0001', r'\U000e0001'),
])
def test_what_cannot_be_seen_is_escaped(text: str, shown: str) -> None:
    assert printable(text) == shown


@given(strategies.text(ANY_CHARACTER))
def test_any_text_is_one_visible_line(text: str) -> None:
    shown = printable(text)
    assert shown.isprintable() and len(shown.splitlines()) <= 1
    assert shown.encode().decode() == shown
    assert printable(shown) == shown


def test_names_are_sorted_by_their_numbers() -> None:
    names = ['line10', 'line2', 'Line1', 'line2b', 'hall/3/press', 'hall/20/press', '7', 'x', '']
    assert sorted(names, key=by_number) == [
        '', '7', 'Line1', 'hall/3/press', 'hall/20/press', 'line2', 'line2b', 'line10', 'x']


def test_of_many_names_the_first_are_shown_and_the_others_counted() -> None:
    assert first(['a', 'b\n'], 2) == r'a, b\n'
    assert first(['a', 'b', 'c', 'd'], 2) == 'a, b and 2 more'
