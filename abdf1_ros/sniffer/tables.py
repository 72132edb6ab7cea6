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

"""Tables: texts in which the bytes stand in one column, or in one column for each direction."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
import csv
import re

from abdf1_ros.sniffer.columns import NumberColumn, Unfit
from abdf1_ros.sniffer.layouts import agree, CLOSED, is_long, LITERAL, masked, MOST_COLUMNS, Piece
from abdf1_ros.sniffer.notations import Notation, Run

_SEPARATORS = ';', '\t', ',', '|'
# The heading of a column with bytes.
_HEADING = re.compile('data|hex|bytes?|payload|[tr]xd?', re.IGNORECASE)


class TextTable:
    """TextLines of a table: the bytes stand in one column, or in one column for each direction."""

    def __init__(self, notation: Notation, separator: str, columns: Sequence[int],
                 names: Sequence[str], marks: Sequence[int]) -> None:
        self.notation = notation
        self._separator, self._columns = separator, columns
        self._names, self._marks = names, marks
        self._has_begun = False
        self.is_fit, self.is_sure = False, any(map(_HEADING.search, (names[at] for at in columns)))

    def split(self, line: str) -> list[Piece]:
        cells = _cells(line, self._separator)
        if len(cells) < len(self._names):
            cells += [''] * (len(self._names) - len(cells))
        found = [(at, run) for at in self._columns if (run := _of_cell(self.notation, cells[at]))]
        if not found and any(cells[at].strip() for at in self._columns) and (
                self._has_begun or self.notation.runs(masked(line))):
            raise Unfit
        self._has_begun |= bool(found)
        self.is_sure |= any(is_long(self.notation, cells[at], run) for at, run in found)
        if LITERAL.search(line):
            raise Unfit
        data = b''.join(run.data for _, run in found)
        for at, cell in enumerate(cells):
            if at not in self._columns and _has_bytes(self.notation, cell) and not (
                    agree(cell, data)):
                raise Unfit
        text = ' '.join(cells[at] for at in self._marks if at < len(cells))
        if len(self._columns) == 1:
            return [Piece(text, run.data) for _, run in found] or [Piece(text)]
        return [Piece(f'{text} {self._names[at]}', run.data) for at, run in found]

    def end(self) -> list[Piece]:
        return []

    def again(self) -> TextTable:
        return TextTable(self.notation, self._separator, self._columns, self._names, self._marks)

    @property
    def proof(self) -> int:
        return 0

    @property
    def hint(self) -> bool:
        return False

    def describe(self) -> str:
        names = (self._names[at].strip() or f'{at + 1}' for at in self._columns)
        return f'{self.notation.name}, in column {" and ".join(names)} of a table'


def _cells(line: str, separator: str) -> list[str]:
    if separator in ',;':
        with suppress(csv.Error):
            return next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    return [cell.strip(' ') for cell in line.split(separator)]


def _of_cell(notation: Notation, cell: str) -> Run | None:
    """Return the bytes of a cell that has nothing else."""
    try:
        runs = notation.runs(masked(cell))
    except ValueError:
        return None
    if len(runs) == 1 and CLOSED.fullmatch(cell, runs[0].end) and not cell[:runs[0].start].strip(
            ' "\'[{(<'):
        return runs[0]
    return None


def _has_bytes(notation: Notation, cell: str) -> bool:
    """Return True if a text has a long run."""
    shown = masked(cell)
    return any(is_long(notation, shown, run) for run in notation.runs(shown))


def tables(notation: Notation, lines: Sequence[str]) -> Iterator[TextTable]:
    """Yield the tables that a text may be."""
    for separator in _SEPARATORS:
        rows = [_cells(line, separator) for line in lines]
        widths = [len(row) for row in rows]
        width = max(set(widths), key=widths.count, default=0)
        if 1 < width <= MOST_COLUMNS and widths.count(width) > 0.5 * len(widths):
            yield from _tables(notation, separator, [row for row in rows if len(row) == width])


def _tables(notation: Notation, separator: str, rows: Sequence[list[str]]) -> Iterator[TextTable]:
    columns = [*zip(*rows, strict=True)]
    names = rows[0]
    of_bytes = {}
    for at, cells in enumerate(columns):
        runs = [_of_cell(notation, cell) for cell in cells]
        filled = [run is not None for run, cell in zip(runs, cells, strict=True) if cell.strip()]
        if any(filled[:2]) and all(filled[1:]):
            of_bytes[at] = runs
    for chosen in ((at,) for at in of_bytes):
        data = [run.data if run else b'' for run in of_bytes[chosen[0]]]
        if all(_is_explained(cells, data) for at, cells in enumerate(columns)
               if at in of_bytes and at not in chosen):
            marks = [at for at, cells in enumerate(columns)
                     if at not in chosen and not _shows(cells, data)]
            yield TextTable(notation, separator, chosen, names, marks)
    if len(of_bytes) > 1:
        pair = [*of_bytes]
        if not any(all(of_bytes[at][row] for at in pair) for row in range(len(rows))):
            marks = [at for at in range(len(columns)) if at not in of_bytes]
            yield TextTable(notation, separator, pair, names, marks)


def _is_explained(cells: Sequence[str], data: Sequence[bytes]) -> bool:
    column = NumberColumn()
    try:
        for cell, part in zip(cells[1:], data[1:], strict=True):
            if part and cell.strip():
                column.take(cell.strip(), len(part))
    except Unfit:
        return False
    return column.is_proved or 'same' in column.kinds


def _shows(cells: Sequence[str], data: Sequence[bytes]) -> bool:
    """Return True if a column has the bytes as characters."""
    return all(len(cell) <= len(part) + 2 and agree(cell, part)
               for cell, part in zip(cells[1:], data[1:], strict=True) if part)
