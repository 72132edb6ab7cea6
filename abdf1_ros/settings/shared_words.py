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
"""Which rows of a map may have words of a PLC in common."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Area
from abdf1_ros.settings.mapping import Mapping

_Place = tuple[int, Area, bool]
"""A station, an area of it, and whether it is reached as the common interface file."""


class SharedWords:
    """
    Find the rows with words in common, without a look at each pair of rows.

    Rows of one area are found by their words. Of two different areas it is enough to know whether
    they may be in one file: they seldom are.
    """

    def __init__(self) -> None:
        self._rows: defaultdict[_Place, list[Mapping]] = defaultdict(list)
        self._by_word: defaultdict[_Place, defaultdict[int, list[Mapping]]] = defaultdict(
            lambda: defaultdict(list))

    def add(self, row: Mapping) -> None:
        """Add a row."""
        place = _place(row)
        self._rows[place].append(row)
        for word in range(row.extent.first, row.extent.end):
            self._by_word[place][word].append(row)

    def first(self, row: Mapping) -> Mapping | None:
        """Return the first row that shares words with ``row``."""
        return min(filter(row.shares_words, self._near(row)), key=lambda other: other.item,
                   default=None)

    def _near(self, row: Mapping) -> Iterator[Mapping]:
        mine = _place(row)
        for place, rows in self._rows.items():
            if place == mine and row.access is not Access.CIF:
                words = self._by_word[place]
                for word in range(row.extent.first, row.extent.end):
                    yield from words.get(word, ())
            elif row.may_share_file(rows[0]):
                yield from rows


def _place(row: Mapping) -> _Place:
    return row.extent.station, row.extent.area, row.access is Access.CIF
