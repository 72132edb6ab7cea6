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
from collections.abc import Iterator, Sequence
import csv
from dataclasses import dataclass, field
import io

from abdf1_ros.cli.plc.exports import (
    factorytalk,
    ignition,
    intouch,
    kepserver,
    listing,
    rslogix,
)
from abdf1_ros.cli.plc.exports.form import Cells, FoundRow, Ignored, Unusable, Wanted
from abdf1_ros.cli.plc.exports.records import read_records, Record, text_of
from abdf1_ros.problems import ConfigurationError, Place, Problem
from abdf1_ros.settings.columns import NEEDED
from abdf1_ros.settings.csv_table import Row
from abdf1_ros.settings.hints import looks_like_address
from abdf1_ros.settings.map_file import MOST_ROWS
from abdf1_ros.settings.map_row import RowReader
from abdf1_ros.text import printable, shown

FORMATS = (kepserver.FORMAT, factorytalk.FORMAT, intouch.FORMAT, ignition.FORMAT, listing.FORMAT,
           rslogix.FORMAT)
"""The known formats; the first format that accepts a file reads it."""

_COLUMNS = (*NEEDED, 'Length', 'Type', 'Period', 'Scale', 'Offset', 'Min', 'Max', 'Description')


@dataclass(slots=True)
class Import:
    """
    The rows of a map: ``lines`` of the new file, ``left_out`` the faults of rows left out.

    ``ignored`` counts skipped rows by kind. ``remarks`` counts rows by the remark for the user.
    """

    count: int = 0
    lines: list[str] = field(default_factory=list)
    left_out: list[Problem] = field(default_factory=list)
    ignored: Counter[str] = field(default_factory=Counter)
    remarks: Counter[str] = field(default_factory=Counter)

    @property
    def text(self) -> str:
        """Return the map CSV."""
        return '\n'.join([','.join(_COLUMNS), *self.lines, ''])


def import_map(path: str, wanted: Wanted) -> Import:
    """
    Return the map that is made of a file.

    Raises ConfigurationError if the file cannot be read, or has no known form.
    """
    records = ignition.records_of(text_of(path)) or read_records(path)
    reader = next(filter(None, (entry.reader(path, records, wanted) for entry in FORMATS)), None)
    if reader is None:
        raise ConfigurationError([Problem(path, _not_known(records))])
    read: list[tuple[Record, FoundRow | Ignored | Unusable]] = []
    for record in records:
        try:
            read.append((record, reader(record)))
        except Unusable as error:
            read.append((record, error))
    _check_node(path, [found for _, found in read if isinstance(found, FoundRow)], wanted)
    result, seen = Import(), dict[str, int]()
    for record, found in read:
        if isinstance(found, Ignored):
            result.ignored[found.what] += bool(found.what)
        elif wanted.node is not None and found.node not in (None, wanted.node):
            result.ignored['rows of other PLCs'] += 1
        elif isinstance(found, Unusable):
            _leave_out(result, path, record, found.tag, str(found))
        else:
            _add(result, seen, path, record, found, wanted)
        if result.count > MOST_ROWS:
            raise ConfigurationError([Problem(Place(path, record.line), (
                f'the rows up to here make more than {MOST_ROWS} rows of a map, the most that it '
                'can have; divide the file'))])
    return result


def _not_known(records: Sequence[Record]) -> str:
    """Return why records cannot be read, with advice."""
    if any(record.first.lower() == 'remark' for record in records[:1]):
        return ('has tags of a Logix controller, which are not addresses. Over DF1 the '
                'controller has only the addresses of its "Map PLC/SLC Messages": write these '
                'rows by hand')
    text = 'is none of these: ' + '; '.join(entry.title for entry in FORMATS)
    if any(looks_like_address(cell) for record in records for cell in record.cells):
        text += '; it has addresses, but no first row with names: write one, such as Address,Tag'
    return text


def _check_node(path: str, rows: Sequence[FoundRow], wanted: Wanted) -> None:
    """Raise ConfigurationError if the user named none of several PLCs, or an unknown PLC."""
    nodes = dict.fromkeys(row.node for row in rows)
    named = ', '.join(shown(node) or '""' for node in nodes)
    if wanted.node is None and len(nodes) > 1:
        raise ConfigurationError([Problem(path, f'has rows of several PLCs: {named}; say which '
                                                'is meant with --plc NAME')])
    if wanted.node is not None and wanted.node not in nodes:
        raise ConfigurationError([Problem(path, f'has no PLC "{shown(wanted.node)}"; it has '
                                                f'{named}')])


def _add(result: Import, seen: dict[str, int], path: str, record: Record, found: FoundRow,
         wanted: Wanted) -> None:
    """Add the good rows of a record, or the reason why it is left out."""
    cells = {'PLC_Type': wanted.plc_type.value, **found.cells}
    names, fault = [], ''
    for row in _rows(cells, wanted):
        reader = RowReader(Row(path, record.line, record.line, row, {}))
        if (mapping := reader.read()) is None:
            fault = '; '.join(fault.words() for fault in reader.faults)
            break
        names.append(mapping.name)
    if not fault and (clash := seen.get(names[0])):
        fault = f'the name {names[0]} is that of line {clash}'
    if fault:
        _leave_out(result, path, record, cells.get('Tag', ''), fault)
        return
    seen[names[0]] = record.line
    result.count += len(names)
    result.remarks[found.remark] += bool(found.remark)
    result.lines += map(_csv_line, _rows(cells, wanted))


def _leave_out(result: Import, path: str, record: Record, tag: str, text: str) -> None:
    result.left_out.append(Problem(
        Place(path, record.line), f'{shown(tag) or "without a name"}: {text}'))
    result.lines.append(printable(f'# line {record.line}: {",".join(record.cells)}: {text}'))


def _rows(cells: Cells, wanted: Wanted) -> Iterator[Cells]:
    """Yield the row for each station."""
    for station in wanted.stations:
        head = f'station_{station}/' if 'Tag' in cells and len(wanted.stations) > 1 else ''
        yield {**cells, 'Tag': head + cells.get('Tag', ''), 'Station': str(station)}


def _csv_line(cells: Cells) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator='').writerow([cells.get(column, '') for column in _COLUMNS])
    line = out.getvalue()
    # Without quotes a row whose Tag begins with # would be a comment.
    return line.replace(cells['Tag'], f'"{cells["Tag"]}"', 1) if line.startswith('#') else line
