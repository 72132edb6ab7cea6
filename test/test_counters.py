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

"""The status counters: numbers and mnemonics are those of the specification."""

from abdf1_ros.counters import Counters, numbered
import pytest
from support.vectors import load_tables

SPECIFIED = [(number, name) for number, name in load_tables()['counters']]


def test_exactly_the_specified_counters_exist_in_their_order() -> None:
    assert SPECIFIED == [
        (entry.metadata['number'], entry.metadata['mnemonic']) for entry in numbered()]
    assert len(SPECIFIED) == 29


def test_every_counter_has_a_description() -> None:
    descriptions = {entry.metadata['description'] for entry in numbered()}
    assert '' not in descriptions
    assert len(descriptions) == len(SPECIFIED)


def test_counters_start_at_zero() -> None:
    assert set(Counters().by_mnemonic().values()) == {0}


def test_by_mnemonic_shows_each_counter_under_its_own_name() -> None:
    counters = Counters()
    for entry in numbered():
        setattr(counters, entry.name, entry.metadata['number'])
    assert list(counters.by_mnemonic().items()) == [(name, number) for number, name in SPECIFIED]


def test_misspelt_counter_is_an_error() -> None:
    with pytest.raises(AttributeError):
        setattr(Counters(), 'polls', 1)
