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


def test_by_mnemonic_shows_each_counter_under_its_own_name() -> None:
    counters = Counters()
    for entry in numbered():
        setattr(counters, entry.name, entry.metadata['number'])
    assert list(counters.by_mnemonic().items()) == [(name, number) for number, name in SPECIFIED]


def test_counters_are_those_of_the_specification_each_described() -> None:
    assert SPECIFIED == [
        (entry.metadata['number'], entry.metadata['mnemonic']) for entry in numbered()]
    descriptions = {entry.metadata['description'] for entry in numbered()}
    assert '' not in descriptions
    assert len(descriptions) == len(SPECIFIED) == 29
    assert set(Counters().by_mnemonic().values()) == {0}
    with pytest.raises(AttributeError):
        setattr(Counters(), 'polls', 1)


def test_frames_are_damaged_whichever_check_is_wrong() -> None:
    assert Counters(bcc_errors=2, crc_errors=3).damaged_frames == 5
