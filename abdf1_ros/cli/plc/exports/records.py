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

"""The records of a file with cells, in the encodings and with the delimiters of Windows."""

from __future__ import annotations

import codecs
from collections.abc import Iterator
import csv
from dataclasses import dataclass
import io
from pathlib import Path
import re

from abdf1_ros.problems import ConfigurationError, Place, Problem

_BYTE_ORDERS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_DELIMITERS = ',;\t'
_LOOKED_AT = 50  # lines


@dataclass(frozen=True, slots=True)
class Record:
    """The cells of a record, and the line that it begins on."""

    line: int
    cells: tuple[str, ...]

    @property
    def first(self) -> str:
        """Return the first cell."""
        return self.cells[0]


def read_records(path: str) -> list[Record]:
    """Return the records of a CSV file that are not empty; raises ConfigurationError."""
    return list(_records(path, text_of(path)))


def _records(path: str, text: str) -> Iterator[Record]:
    reader = csv.reader(io.StringIO(text, newline=None), delimiter=_delimiter(text),
                        skipinitialspace=True)
    line = 1
    try:
        for record in reader:
            cells = tuple(map(one_line, record))
            if any(cells):
                yield Record(line, cells)
            line = reader.line_num + 1
    except csv.Error as error:
        raise ConfigurationError([Problem(Place(path, line), str(error))]) from None


def one_line(cell: str) -> str:
    """Return a cell with a blank for each run of blanks, line ends and control characters."""
    return ' '.join(re.sub('[\0-\x1f\x7f]', ' ', cell).split())


def text_of(path: str) -> str:
    """Return the text of a file, in the encodings of Windows too."""
    try:
        raw = Path(path).read_bytes()
    except OSError as error:
        raise ConfigurationError([Problem(
            path, f'cannot be read: {error.strerror or error}')]) from None
    try:
        return raw.decode('utf-16' if raw.startswith(_BYTE_ORDERS) else 'utf-8-sig')
    except UnicodeDecodeError:
        return raw.decode('cp1252', 'replace')  # the encoding of programs on Windows


def _delimiter(text: str) -> str:
    """Return the delimiter that most lines have; a comment may begin with a semicolon."""
    lines = [re.sub('"[^"]*"', '', line).lstrip().lstrip(';')
             for line in text[:100_000].splitlines()[:_LOOKED_AT]]
    return max(_DELIMITERS, key=lambda sign: (
        sum(sign in line for line in lines), sum(line.count(sign) for line in lines)))
