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
"""Rows with words in common are found without a look at each pair."""

from __future__ import annotations

from random import Random

from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.shared_words import SharedWords
import pytest
from support.mappings import make_mapping

# Files that have the same number or type, slots, functions, and other names of the same words.
PLACES = [('N7:0', 'SLC'), ('N7:3', 'SLC'), ('B7:1/2', 'SLC'), ('B7:1/3', 'SLC'),
          ('B3/20', 'SLC'), ('B3:1', 'SLC'), ('F8:0', 'SLC'), ('F8:1', 'SLC'), ('O:1.0', 'SLC'),
          ('O:2.0', 'SLC'), ('STI:0.PFN', 'SLC'), ('T4:0.PRE', 'SLC'), ('T4:1', 'SLC'),
          ('N7:1', 'PLC5'), ('O:001', 'PLC5'), ('020', 'PLC2'), ('CIF', 'PLC2')]


def drawn(random: Random, item: int) -> Mapping:
    text, plc = random.choice(PLACES)
    is_cif = text == 'CIF'
    return make_mapping(
        '005' if is_cif else text, 'Write', plc=plc, station=random.choice((1, 1, 2, 255)),
        item=item, length=random.choice((1, 1, 2)), access='CIF' if is_cif else None)


@pytest.mark.parametrize('seed', range(20))
def test_first_row_is_that_of_a_look_at_each(seed: int) -> None:
    random, rows, found = Random(seed), list[Mapping](), SharedWords()
    for item in range(1, 60):
        row = drawn(random, item)
        assert found.first(row) is next(filter(row.shares_words, rows), None)
        if random.random() < 0.5:
            rows.append(row)
            found.add(row)


def test_rows_of_an_area_are_compared_by_their_words(monkeypatch: pytest.MonkeyPatch) -> None:
    found, looks = SharedWords(), list[Mapping]()
    rows = [make_mapping(f'N7:{number}', 'Write', item=number) for number in range(900)]
    shares_words = Mapping.shares_words
    monkeypatch.setattr(Mapping, 'shares_words', lambda row, other: (
        looks.append(other) or shares_words(row, other)))  # type: ignore[func-returns-value]
    for row in rows:
        assert found.first(row) is None
        found.add(row)
    assert looks == []
    assert found.first(rows[7]) is rows[7] and looks == [rows[7]]
