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

"""
CSV files as spreadsheets write them.

Accepted: UTF-8 with or without byte order mark, any line ends, comma, semicolon or tab between
cells, quoted cells, blank lines, empty cells and columns at the end, column names in any
letter case, spaces around values, and lines starting with # as comments.
"""

from __future__ import annotations

import codecs
from collections.abc import Iterator, Sequence
import csv
from dataclasses import dataclass
import difflib
import io
from pathlib import Path

from abdf1_ros.errors import ConfigurationError, Problem

_DELIMITERS = ',;\t'
# A last line that no file has, as comments are taken out; only an open quote swallows it.
_END = '#'

# Far more than a file with a row for every word of a PLC has.
_LARGEST = 10_000_000


@dataclass(frozen=True, slots=True)
class Row:
    """
    One data row: its place in the file and its cells by column name.

    ``item`` counts data rows from 1, ``line`` lines of the file from 1.
    """

    file: str
    item: int
    line: int
    cells: dict[str, str]
    columns: dict[str, int]

    def where(self, column: str) -> str:
        """Return "file:line:cell (column)", cells counted from 1; no cell where there is none."""
        cell = self.columns.get(column)
        return f'{self.file}:{self.line}' + ('' if cell is None else f':{cell}') + f' ({column})'

    def get(self, column: str) -> str:
        """Return a cell, empty where the file has no such column."""
        return self.cells.get(column, '')


def read_rows(path: str, known: Sequence[str]) -> list[Row]:
    """
    Read all data rows of a file whose header uses ``known`` column names.

    Raises ConfigurationError with every fault of the file as a whole.
    """
    lines = _read_lines(path)
    try:
        return _parse(path, lines, known)
    except csv.Error as error:
        raise ConfigurationError([Problem(path, f'not a CSV file: {error}')]) from None


def _read_lines(path: str) -> list[str]:
    try:
        # A pipe into which nobody writes would hold us up for ever.
        if Path(path).is_fifo():
            raise ConfigurationError([Problem(path, 'is a pipe, not a file')])
        with Path(path).open('rb') as file:
            raw = file.read(_LARGEST + 1).removeprefix(codecs.BOM_UTF8)
    except OSError as error:
        raise ConfigurationError(
            [Problem(path, f'cannot be read: {error.strerror or error}')]) from None
    if len(raw) > _LARGEST:
        raise ConfigurationError([Problem(
            path, f'larger than {_LARGEST // 1_000_000} MB; is it a CSV file?')])
    try:
        text = raw.decode()
    except UnicodeDecodeError as error:
        before = raw[:error.start].replace(b'\r\n', b'\n').replace(b'\r', b'\n')
        line = before.count(b'\n') + 1
        column = len(before) - before.rfind(b'\n')
        raise ConfigurationError([Problem(
            f'{path}:{line}:{column}',
            f'byte 0x{raw[error.start]:02X} is not UTF-8; save the file as "CSV UTF-8"')
        ]) from None
    return list(io.StringIO(text, newline=''))  # str.splitlines knows more ends than CSV


def _parse(path: str, lines: list[str], known: Sequence[str]) -> list[Row]:
    # Comments become blank lines, so that the reader's line numbers stay right.
    content = ['\n' if line.lstrip().startswith('#') else line for line in lines]
    header = next((line for line in content if line.strip(f'{_DELIMITERS} \r\n')), None)
    if header is None:
        raise ConfigurationError([Problem(
            f'{path}:1', f'the file is empty; its first row names columns: {", ".join(known)}')])
    delimiter = max(_DELIMITERS, key=header.count)
    columns: dict[str, int] | None = None
    rows: list[Row] = []
    problems: list[Problem] = []
    for line, cells in _records(path, content, delimiter):
        if columns is None:
            columns = _header(path, line, cells, known, problems)
            continue
        row = Row(path, len(rows) + 1, line, {}, columns)
        row.cells.update({name: cells[number - 1] for name, number in columns.items()
                          if number <= len(cells)})
        rows.append(row)
        for number in range(1, len(cells) + 1):
            if cells[number - 1] and number not in columns.values() and not problems:
                problems.append(Problem(
                    f'{path}:{line}:{number}', f'"{cells[number - 1]}" stands in no column; '
                    'quote a cell that contains the delimiter'))
    if problems:
        raise ConfigurationError(problems)
    return rows


def _records(path: str, lines: list[str],
             delimiter: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the line each record begins on and its stripped cells, blank records left out."""
    reader = csv.reader([*lines, _END], delimiter=delimiter, skipinitialspace=True)
    line = 1
    for record in reader:
        if reader.line_num > len(lines) and record != [_END]:
            raise ConfigurationError([Problem(
                f'{path}:{line}', 'a quote in this row never ends')])
        cells = [cell.strip() for cell in record]
        if any(cells) and record != [_END]:
            yield line, cells
        line = reader.line_num + 1


def _header(path: str, line: int, cells: list[str], known: Sequence[str],
            problems: list[Problem]) -> dict[str, int]:
    """Return the cell number of each column, noting unknown and repeated names."""
    spelling = {name.lower(): name for name in known}
    columns: dict[str, int] = {}
    for number, cell in enumerate(cells, 1):
        where = f'{path}:{line}:{number}'
        name = spelling.get(cell.lower())
        if not cell:
            continue
        if name is None:
            close = difflib.get_close_matches(cell.lower(), spelling, 1)
            hint = f'did you mean {spelling[close[0]]}?' if close else f'known: {", ".join(known)}'
            problems.append(Problem(where, f'unknown column "{cell}"; {hint}'))
        elif name in columns:
            problems.append(Problem(where, f'column {name} stands twice'))
        else:
            columns[name] = number
    return columns
