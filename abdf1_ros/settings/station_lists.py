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

"""Stations as people write them: "1,3-5"."""

from __future__ import annotations

from collections.abc import Iterator
import re

from abdf1_ros.df1.stations import MAX_STATION
from abdf1_ros.numbers import whole_number
from abdf1_ros.problems import Problem
from abdf1_ros.settings.csv_table import Row
from abdf1_ros.text import shown

_LEADING_ZERO = re.compile(r'0[0-7]+')


def parse_stations(text: str, most: int = MAX_STATION) -> tuple[tuple[int, ...], list[str]]:
    """Return the stations of a list in its order, each once, and what is wrong with it."""
    stations: list[int] = []
    faults: list[str] = []
    for part in filter(None, map(str.strip, text.split(','))):
        first, dash, last = map(str.strip, part.partition('-'))
        low, high = whole_number(first), whole_number(last if dash else first)
        if low is None or high is None or not 0 <= low <= high <= most:
            faults.append(f'"{shown(part)}" should be a station from 0 to {most}, '
                          'or a range such as 3-5; put commas between them')
        else:
            stations += range(low, high + 1)
    return tuple(dict.fromkeys(stations)), faults


def octal_remarks(row: Row) -> Iterator[Problem]:
    """Yield a remark on a Station with a leading zero: here decimal, on PLC-5 panels octal."""
    text = row.get('Station')
    if octal := octal_of(text):
        yield Problem(row.where('Station'), (
            f'Station = "{text}" is {int(text)}, decimal; an octal {text} would be {octal}'))


def octal_of(text: str) -> int | None:
    """Return the octal value of a number with a leading zero, None if it is the same."""
    octal = int(text, 8) if _LEADING_ZERO.fullmatch(text) else None
    return None if octal is None or octal == int(text) else octal
