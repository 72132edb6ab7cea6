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

"""The map that is made of a file of another program."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
import csv
from dataclasses import dataclass, field, replace
import io

from abdf1_ros.cli.plc.exports.form import Cells, FoundRow, Ignored, read_row, Wanted
from abdf1_ros.cli.plc.exports.ignition import records_of
from abdf1_ros.cli.plc.exports.records import read_sheet, Record
from abdf1_ros.cli.plc.exports.table import table_of
from abdf1_ros.numbers import is_digits
from abdf1_ros.problems import ConfigurationError, Place, Problem
from abdf1_ros.settings.columns import NEEDED
from abdf1_ros.settings.csv_table import Row
from abdf1_ros.settings.map_file import MOST_ROWS
from abdf1_ros.settings.map_row import RowReader
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.names import sanitise
from abdf1_ros.text import first, is_head_of_values, printable, shown

_LONGEST_HEAD = 200  # characters
_COLUMNS = (*NEEDED, 'Length', 'Type', 'Period', 'Scale', 'Offset', 'Min', 'Max', 'Description')


@dataclass(slots=True)
class Import:
    """
    The rows of a map: ``lines`` of the new file, ``left_out`` the faults of rows left out.

    ``ignored`` counts skipped rows by kind. ``remarks`` counts rows by the remark for the user,
    and ``notes`` are about the whole file.
    """

    columns: Sequence[str] = _COLUMNS
    count: int = 0
    lines: list[str] = field(default_factory=list)
    left_out: list[Problem] = field(default_factory=list)
    ignored: Counter[str] = field(default_factory=Counter)
    remarks: Counter[str] = field(default_factory=Counter)
    notes: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """Return the map CSV."""
        return '\n'.join([','.join(self.columns), *self.lines, ''])


def import_map(path: str, wanted: Wanted) -> Import:
    """
    Return the map that is made of a file.

    Raises ConfigurationError if the file cannot be read, has no known form, or has rows of PLCs
    whose stations are not known.
    """
    _refuse_values(path)
    sheet = read_sheet(path)
    if tags := records_of(sheet.text):
        sheet = replace(sheet, records=tags, is_dot_unclear=False)
    table = table_of(sheet, wanted)
    rows = [(record, entry if isinstance(entry, Ignored) else read_row(
        table.form, entry, wanted)) for record, entry in table.rows]
    stations = _stations(path, [row for _, row in rows if isinstance(row, FoundRow)],
                         table.form.is_open, wanted)
    result, seen = Import(), dict[str, int]()
    if any(isinstance(row, FoundRow) and 'Word_Order' in row.cells for _, row in rows):
        result.columns = (*_COLUMNS, 'Word_Order')
    result.notes += filter(None, [sheet.remark])
    if table.unused:
        result.notes.append(f'columns that are not used: {", ".join(map(shown, table.unused))}')
    for record, row in rows:
        if isinstance(row, Ignored):
            result.ignored[row.what] += bool(row.what)
        elif (there := stations(row)) is None and _name(row):
            result.ignored['rows of other PLCs'] += 1
        elif there is None:
            _leave_out(result, path, record, row.cells, _UNNAMED)
        elif row.fault:
            _leave_out(result, path, record, row.cells, row.fault)
        else:
            _add(result, seen, path, record, row, list(_rows(row, there, wanted)))
        if result.count > MOST_ROWS:
            raise ConfigurationError([Problem(Place(path, record.line), (
                f'the rows up to here make more than {MOST_ROWS} rows of a map, the most that it '
                'can have; divide the file'))])
    return result


def _refuse_values(path: str) -> None:
    """Raise ConfigurationError for a log of values, which may be long."""
    with suppress(OSError), open(path, encoding='utf-8-sig', errors='replace') as file:
        if is_head_of_values(file.readline(_LONGEST_HEAD)):
            raise ConfigurationError([Problem(
                f'{path}:1', 'values, not a list of tags: "plc plot" draws them')])


_UNNAMED = 'names no PLC: fill the cells below a name that a spreadsheet has merged'

_Heads = dict[str, str]
"""The text before the tags of a row, by its station."""


def _stations(path: str, rows: Sequence[FoundRow], is_open: bool,
              wanted: Wanted) -> Callable[[FoundRow], _Heads | None]:
    """
    Return the function that gives the stations of a row, None for a row that is not wanted.

    Raises ConfigurationError if the user named none of several PLCs, or an unknown PLC.
    """
    good = [row for row in rows if not row.fault and _checked(path, 1, {
        **row.cells, 'Station': '1', 'PLC_Type': wanted.plc_type.value})[0]]
    names = dict.fromkeys(_name(row) for row in good)
    listed = first([shown(name) or '""' for name in names])
    for name in wanted.station_of or ([] if wanted.node is None else [wanted.node]):
        if name not in names:
            raise ConfigurationError([Problem(path, f'has no PLC "{shown(name)}"; it has '
                                                    f'{listed}')])
    if wanted.node is not None:
        names = {wanted.node: None}
    has_stations = not wanted.stations and bool(good) and all(
        is_digits(row.station) for row in good)
    # By station, if the file has them: two PLCs of one station are on two lines.
    plcs = {(row.station if has_stations else '', _name(row)) for row in good
            if _name(row) in names}
    if not wanted.station_of and len(plcs) > len({station for station, _ in plcs}):
        raise ConfigurationError([Problem(path, (
            f'has rows of several PLCs: {listed}; choose one with --plc NAME, or give the station '
            'of each with --station-of NAME=N,NAME=N'
            + '; if a column of a list names no PLCs: --ignore COLUMN' * is_open
            + f'; a row {_UNNAMED}' * ('' in names)))])
    heads = _heads_of(good, wanted)

    def of(row: FoundRow) -> _Heads | None:
        name = _name(row)
        if wanted.station_of:
            there = [str(wanted.station_of[name])] if name in wanted.station_of else []
        elif wanted.node is not None and row.node is not None and name != wanted.node:
            there = []
        else:
            there = [row.station] if has_stations else list(map(str, wanted.stations or (1,)))
        if len(there) > 1:
            return {station: f'station_{station}/' for station in there}
        return {station: heads.get(name, '') for station in there} or None
    return of


def _name(row: FoundRow) -> str:
    """Return what tells the PLC of a row from others."""
    return row.node or row.station


def _heads_of(rows: Sequence[FoundRow], wanted: Wanted) -> _Heads:
    """Return the text before tags by PLC, if two PLCs have a tag of one name."""
    plcs: dict[str, set[str]] = {}
    for row in rows:
        name = _name(row)
        if wanted.node in (None, name) and (not wanted.station_of or name in wanted.station_of):
            plcs.setdefault(sanitise(row.cells.get('Tag', '')), set()).add(name)
    names = set().union(*plcs.values())
    if all(len(found) < 2 for found in plcs.values()):
        return {}
    return {name: f'station_{name}/' if is_digits(name) else f'{name}/' for name in names}


def _add(result: Import, seen: dict[str, int], path: str, record: Record, found: FoundRow,
         rows: Sequence[Cells]) -> None:
    """Add the good rows of a record, or the reason why it is left out."""
    names, fault = [], ''
    for row in rows:
        mapping, fault = _checked(path, record.line, row)
        if mapping is None:
            break
        names.append(mapping.name)
    if not fault and (clash := seen.get(names[0])):
        fault = f'the name {names[0]} is that of line {clash}'
    if fault:
        _leave_out(result, path, record, found.cells, fault)
        return
    seen[names[0]] = record.line
    result.count += len(names)
    result.remarks.update(dict.fromkeys(found.remarks, 1))
    result.lines += (_csv_line(cells, result.columns) for cells in rows)


def _checked(path: str, line: int, cells: Cells) -> tuple[Mapping | None, str]:
    """Return the mapping that a row of a map makes, or its faults."""
    reader = RowReader(Row(path, line, line, cells, {}))
    return reader.read(), '; '.join(fault.words() for fault in reader.faults)


def _leave_out(result: Import, path: str, record: Record, cells: Cells, text: str) -> None:
    tag, address = cells.get('Tag', ''), cells.get('Address', '')
    name = (address if tag == sanitise(address) else tag) or 'without a name'
    result.left_out.append(Problem(Place(path, record.line), f'{shown(name)}: {text}'))
    result.lines.append(printable(f'# line {record.line}: {",".join(record.cells)}: {text}'))


def _rows(found: FoundRow, heads: _Heads, wanted: Wanted) -> Iterator[Cells]:
    """Yield the row for each station."""
    tag = found.cells.get('Tag', '')
    for station, head in heads.items():
        yield {'PLC_Type': wanted.plc_type.value, **found.cells, 'Tag': tag and head + tag,
               'Station': station}


def _csv_line(cells: Cells, columns: Sequence[str]) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator='').writerow([cells.get(column, '') for column in columns])
    line = out.getvalue()
    # Without quotes a row whose Tag begins with # would be a comment.
    return line.replace(cells['Tag'], f'"{cells["Tag"]}"', 1) if line.startswith('#') else line
