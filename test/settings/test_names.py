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

"""Tags and topics become names that ROS takes."""

import re

from abdf1_ros.settings.names import MAX_LENGTH, sanitise
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all

# What rcl accepts as a relative name (ROS.md 4.4).
_LEGAL = re.compile(r'[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)*')


@for_all(('text', 'name'), [
    ('line_speed', 'line_speed'),
    ('N7:0', 'N7_0'),
    ('B3/12', 'B3/t12'),
    ('7seg', 't7seg'),
    ('a-b', 'a_b'),
    ('a b', 'a_b'),
    ('Tank.Level', 'Tank_Level'),
    ('Füllstand', 'F_llstand'),
    ('cell/2/guard', 'cell/t2/guard'),
    ('a//b', 'a/b'),
    ('/a/', 'a'),
    ('a / b', 'a/b'),
    ('__a__b__', 'a_b'),
    ('_hidden', 'hidden'),
    ('~private', 'private'),
    ('{node}', 'node'),
    ('a:::b', 'a_b'),
    ('a/_/b', 'a/b'),
    ('0', 't0'),
    ('CamelCase', 'CamelCase'),
])
def test_name_of_a_text(text: str, name: str) -> None:
    assert sanitise(text) == name


@pytest.mark.parametrize('text', ['', '_', '__', '/', '///', ':', 'ü', '日本', ' - / - '])
def test_nothing_is_left_of_text_without_letter_or_digit(text: str) -> None:
    assert sanitise(text) == ''


@given(st.text())
def test_any_text_becomes_a_legal_name_or_nothing(text: str) -> None:
    name = sanitise(text)
    assert name == '' or _LEGAL.fullmatch(name)
    assert '__' not in name and not name.endswith('_')


@given(st.text())
def test_a_name_stays_as_it_is(text: str) -> None:
    assert sanitise(sanitise(text)) == sanitise(text)


def test_longest_name_fits_with_namespace_and_node_into_what_dds_takes() -> None:
    assert MAX_LENGTH + len('/write/') < 247
