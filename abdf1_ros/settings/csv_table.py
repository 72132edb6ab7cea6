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
letter case, spaces around values, and lines starting with # as comments. A first line such as
sep=; only tells a spreadsheet the separator, and is left out.

A cell must end on the line where it begins, because no column needs more lines. If cells could go
on, a forgotten closing quote would hide all rows up to the next quote, without an error.
"""

from __future__ import annotations

import codecs
from collections.abc import Collection, Mapping, Sequence
import csv
from dataclasses import dataclass, replace
import difflib
import io
from pathlib import Path
import re
from types import MappingProxyType

from abdf1_ros.problems import ConfigurationError, Place, Problem
from abdf1_ros.settings.hints import (
    export_fault,
    hint,
    is_spreadsheet_error,
    pasted,
    row_hint,
    WORKBOOKS,
)
from abdf1_ros.text import shown

_DELIMITERS = {',': 'comma', ';': 'semicolon', '\t': 'tab'}
_BLANK = ''.join(_DELIMITERS) + ' \r\n'
_SEPARATOR_LINE = re.compile(r'"?sep=\W*', re.IGNORECASE)

# The first cells of a line, with the spaces around each, and the comma or line end after it.
_WHOLE_CELLS = r'(?:(?: *+"(?:[^"]|"")*+"[^\S,\r\n]*+| *+(?!")[^,\r\n]*+)(?:,|[\r\n]*\Z))*+'

# Largest size of a file (bytes). A map with a row for each word of a PLC is far smaller.
_LARGEST = 10_000_000
# Most characters of a line: csv.reader has this limit for one cell.
_LONGEST_LINE = 131_072
# Similarity (0 to 1) from which a wrong name counts as a mistyped column.
_ALIKE = 0.7


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

    def where(self, column: str | None = None) -> Place:
        """Return the place of a cell, without its number where the file has no such column."""
        return Place(self.file, self.line, self.columns.get(column or ''), column)

    def get(self, column: str) -> str:
        """Return a cell, empty where the file has no such column."""
        return self.cells.get(column, '')


@dataclass(frozen=True, slots=True)
class Table:
    """
    The rows whose cells fit the columns, and the faults of the file.

    ``faults`` concern the whole file, ``row_faults`` single rows, which are not in ``rows``.
    """

    rows: list[Row]
    faults: list[Problem]
    row_faults: list[Problem]

    @property
    def is_usable(self) -> bool:
        """Tell whether the rows can be trusted; if most are bad, the good rows may be shifted."""
        return not self.faults and len(self.row_faults) <= len(self.rows)


def read_rows(path: str, known: Sequence[str]) -> list[Row]:
    """
    Read all data rows of a file whose header uses ``known`` column names.

    Raises ConfigurationError with every fault of the file.
    """
    table = read_table(path, known)
    if problems := table.faults + table.row_faults:
        raise ConfigurationError(problems)
    return table.rows


def read_table(path: str, known: Sequence[str], needed: Collection[str] = (),
               renamed: Mapping[str, str] = MappingProxyType({})) -> Table:
    """
    Read a file whose header uses ``known`` column names, the ``needed`` ones among them.

    Raises ConfigurationError if there is no header. If a needed column is missing, the table has
    no rows, because each would lack the same cell. A column that was ``renamed`` is a fault, and
    each of its cells, too. These faults give the new name.
    """
    try:
        (first, header), *others = _read_lines(path, known)
        _check_text(Place(path, first), header)
        delimiter = max(_DELIMITERS, key=header.count)
        names = _cells(Place(path, first), header, delimiter)
        if fault := export_fault(path, names):
            raise Problem(path, fault)
        _check_direction(Place(path, first), names, others, known)
        _check_place(Place(path, first), names, others, known)
    except Problem as problem:
        raise ConfigurationError([problem]) from None
    columns, faults = _columns(Place(path, first), names, known, needed, renamed)
    old = {name.lower(): new for name, new in renamed.items()}
    rows: list[Row] = []
    problems: list[Problem] = []
    item = 0
    for line, text in others:
        place = Place(path, line)
        item += 1
        try:
            _check_text(place, text)
            cells = _cells(place, text, delimiter)
            _check_cells(place, cells, names, columns, delimiter)
            faults += _moved(place, cells, names, old)
        except Problem as problem:
            problems.append(problem)
            continue
        if any(cells):
            content = {name: cells[number - 1] for name, number in columns.items()
                       if number <= len(cells)}
            rows.append(Row(path, item, line, content, columns))
        else:
            item -= 1
    return Table(rows if columns.keys() >= set(needed) else [], faults, problems)


def _read_lines(path: str, known: Sequence[str]) -> list[tuple[int, str]]:
    """Return the header and the lines that may be rows, each with its number."""
    # str.splitlines also divides at characters that are not line ends in CSV.
    lines = enumerate(io.StringIO(_read_text(path), newline=''), 1)
    found = [(number, line) for number, line in lines
             if line.strip(_BLANK) and not _is_comment(line)
             and not (number == 1 and _SEPARATOR_LINE.fullmatch(line))]
    if not found:
        raise Problem(Place(path, 1), 'the file is empty; its first row names columns: '
                                      f'{", ".join(known)}')
    return found


def _is_comment(line: str) -> bool:
    """Tell whether a line is a comment: it begins with #, but not with a mark such as #N/A."""
    text = line.lstrip()
    return text.startswith('#') and not is_spreadsheet_error(re.split('[,;\t]', text)[0].rstrip())


def _read_text(path: str) -> str:
    try:
        # Opening a pipe without a writer would block for ever.
        if Path(path).is_fifo():
            raise Problem(path, 'is a pipe, not a file')
        with Path(path).open('rb') as file:
            raw = file.read(_LARGEST + 1)
    except OSError as error:
        is_looked_for = isinstance(error, FileNotFoundError) and not Path(path).is_absolute()
        where = f' in the folder {Path.cwd()}' if is_looked_for else ''
        raise Problem(
            path, f'cannot be read: {error.strerror or error}{where}{pasted(path)}') from None
    if raw.startswith(WORKBOOKS):
        raise Problem(path, 'is a workbook or a project of some program, not text; save what is '
                            'in it as "CSV UTF-8"')
    if len(raw) > _LARGEST:
        raise Problem(path, f'larger than {_LARGEST // 1_000_000} MB; is it a CSV file?')
    return raw.removeprefix(codecs.BOM_UTF8).decode(errors='surrogateescape')


def _check_text(place: Place, line: str) -> None:
    """Raise Problem where a line is not UTF-8 text, or has a zero byte, as UTF-16 has."""
    raw = line.encode(errors='surrogateescape')
    try:
        raw.decode()
        bad = raw.find(0)
    except UnicodeDecodeError as error:
        bad = error.start
    if bad >= 0:
        raise Problem(place, f'byte {bad + 1} of this line, 0x{raw[bad]:02X}, is not text in '
                             'UTF-8; save the file as "CSV UTF-8"')


def _cells(place: Place, line: str, delimiter: str) -> list[str]:
    """Return the stripped cells of a line; raise Problem where it cannot be divided."""
    if len(line) > _LONGEST_LINE:
        raise Problem(place, f'this line has {len(line)} characters, at most {_LONGEST_LINE} are '
                             'allowed')
    # csv.reader reads the second, empty line only if a quote is still open.
    reader = csv.reader([line, ''], delimiter=delimiter, skipinitialspace=True)
    cells = next(reader)
    if reader.line_num > 1:
        raise Problem(replace(place, cell=len(cells)),
                      'the quote that opens this cell is not closed on this line')
    # csv.reader would join the text after a quoted cell to it: "1"0 would be 10.
    whole = re.match(_WHOLE_CELLS.replace(',', delimiter), line)
    if whole and whole.end() < len(line):
        number = len(next(csv.reader([whole[0]], delimiter=delimiter, skipinitialspace=True)))
        raise Problem(replace(place, cell=number), 'text follows the quote that closes this cell; '
                                                   'write "" for a quote inside of quotes')
    return [cell.strip() for cell in cells]


def _check_direction(place: Place, names: list[str], others: list[tuple[int, str]],
                     known: Sequence[str]) -> None:
    """Raise Problem if the names of the columns are below each other, not side by side."""
    spellings = {name.lower() for name in known}
    below = [re.split('[,;\t]', line)[0].strip().lower() in spellings for _, line in others]
    if sum(name.lower() in spellings for name in names) < 2 and len(names) > 1 \
            and len(below) > 1 and all(below):
        raise Problem(place, 'the names of the columns stand below each other here; they belong '
                             'side by side into one row, and the values into the row below it')


def _check_place(place: Place, names: list[str], others: list[tuple[int, str]],
                 known: Sequence[str]) -> None:
    """Raise Problem if the names of the columns stand in a later row, as after a sort."""
    spellings = {name.lower() for name in known}

    def count(cells: Sequence[str]) -> int:
        return sum(cell.strip().lower() in spellings for cell in cells)
    if not count(names):
        for line, text in others:
            if count(re.split('[,;\t]', text)) > 1:
                raise Problem(place, f'the names of the columns stand in line {line}, and belong '
                                     'into the first row; has a spreadsheet sorted the rows?')


def _moved(place: Place, cells: Sequence[str], names: Sequence[str],
           renamed: Mapping[str, str]) -> list[Problem]:
    """Return the faults of the cells of columns that have another name now."""
    return [Problem(replace(place, cell=number),
                    f'write {renamed[name.lower()]} = "{shown(cell)}" instead of {name}')
            for number, (name, cell) in enumerate(zip(names, cells, strict=False), 1)
            if cell and name.lower() in renamed]


def _columns(place: Place, names: list[str], known: Sequence[str], needed: Collection[str],
             renamed: Mapping[str, str]) -> tuple[dict[str, int], list[Problem]]:
    """
    Return the cell number of each column, and the faults of the header.

    Raises ConfigurationError if the first row is not a header.
    """
    spelling = {name.lower(): name for name in known}
    meant = [spelling.get(name.lower()) for name in names]
    if not any(meant):
        raise ConfigurationError([Problem(
            place, f'no column is named here{row_hint(names)}; the first row names them, with '
                   f'comma, semicolon or tab between: {", ".join(known)}')])
    old = {name.lower(): new for name, new in renamed.items()}
    free = [name for name in known if name not in meant]
    listing = f'; known: {", ".join(known)}'
    columns: dict[str, int] = {}
    problems: list[Problem] = []
    strange: list[str] = []
    for number, (name, column) in enumerate(zip(names, meant, strict=True), 1):
        where = replace(place, cell=number)
        if not name:
            continue
        if name.lower() in old:
            problems.append(Problem(where, f'column {name} is called {old[name.lower()]} now'))
        elif column is None:
            close = _close(name, free)
            advice = hint(name) or (f'; did you mean {close}?' if close else listing)
            problems.append(Problem(where, f'unknown column "{shown(name)}"{advice}'))
            if close:
                free.remove(close)
            elif advice == listing:
                listing = ''  # once is enough
            strange += [] if close else [name]
        elif column in columns:
            problems.append(Problem(
                where, f'column {column} stands twice, first in cell {columns[column]}'))
        else:
            columns[column] = number
    if len(strange) > len(names) / 2:
        raise ConfigurationError([Problem(place, (
            f'{len(strange)} of {len(names)} columns are not known here, such as '
            f'"{shown(strange[0])}": is this the right file? Known: {", ".join(known)}'))])
    problems += [Problem(place, f'column {column} is missing, and each row needs it')
                 for column in needed if column in free]
    return columns, problems


def _close(name: str, free: Sequence[str]) -> str | None:
    """Return the column that a wrong name most likely means, None if no column is similar."""
    name, known = _squeezed(name), {_squeezed(column): column for column in free}
    close = difflib.get_close_matches(name, known, 1, _ALIKE) or [
        column for column in known if len(column) > 2 and name.startswith(column)]
    return known[close[0]] if close else None


def _squeezed(name: str) -> str:
    return re.sub(r'[\W_]', '', name).lower()


def _check_cells(place: Place, cells: list[str], names: list[str], columns: dict[str, int],
                 delimiter: str) -> None:
    """Raise Problem where the cells of a row do not lie under the columns."""
    if cells[0].startswith('//'):
        raise Problem(place, 'a comment begins with #')
    if len(columns) > 1 and len(cells) == len(names) and all(
            cell.lower() == name.lower() for cell, name in zip(cells, names, strict=True)):
        raise Problem(place, 'the names of the columns stand here again; once is enough')
    if len(cells) == 1 < len(columns) and any(sign in cells[0] for sign in _DELIMITERS):
        raise Problem(place, 'this row is one cell; its cells need a '
                             f'{_DELIMITERS[delimiter]} between them, outside of quotes')
    for number, cell in enumerate(cells, 1):
        where = replace(place, cell=number)
        if cell and number < len(names) and not names[number - 1]:
            raise Problem(where, f'"{shown(cell)}": this column has no name in the first row; '
                                 'name it, or leave it out (in pandas index=False)')
        if cell and not ''.join(names[number - 1:number]):
            raise Problem(where, f'"{shown(cell)}" has no column; quote a cell that contains the '
                                 'delimiter')
        if is_spreadsheet_error(cell):
            raise Problem(where, f'"{cell}" is what a spreadsheet writes where it has no value')
