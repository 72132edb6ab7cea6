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
Maps made of what other programs export: symbols of RSLogix 500 and 5, tags of KEPServerEX.

KEPServerEX writes a header and a row for each tag. RSLogix writes no header: address, scope,
symbol, then up to five lines of description. A row that cannot become a mapping stays in the
map as a comment, and is named with its line.
"""

from __future__ import annotations

import codecs
from collections.abc import Callable, Iterator, Sequence
import csv
from dataclasses import dataclass, field
import io
from pathlib import Path
import re

from abdf1_ros.numbers import decimal_number, whole_number
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.problems import ConfigurationError, Place, Problem
from abdf1_ros.settings.columns import NEEDED
from abdf1_ros.settings.csv_table import Row
from abdf1_ros.settings.hints import is_export_of_kepserver, looks_like_address
from abdf1_ros.settings.map_row import RowReader
from abdf1_ros.text import printable, shown

_COLUMNS = (*NEEDED, 'Length', 'Type', 'Period', 'Scale', 'Offset', 'Min', 'Max', 'Description')

# What KEPServerEX calls types and access (help of its driver for DF1, "Data Types Description").
_TYPES = {
    'default': '', 'boolean': 'bool', 'short': 'int16', 'word': 'uint16', 'long': 'int32',
    'dword': 'uint32', 'float': 'float32', 'bcd': 'bcd16', 'string': 'string'}
_ACCESS = {'RO': 'Read', 'READ ONLY': 'Read', 'RW': 'ReadWrite', 'R/W': 'ReadWrite',
           'READ/WRITE': 'ReadWrite', 'WO': 'Write', 'WRITE ONLY': 'Write', '': 'ReadWrite'}
_ARRAY = re.compile(r'(?P<address>[^\[]+?)\s*(?P<sizes>(?:\s*\[\d{1,5}\])+)')
_BYTE_ORDERS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)

# Rows of RSLogix about files and rungs, not about addresses.
_OTHER_ROWS = re.compile(r'(?:DFILE|PFILE|LAD|RUNG)', re.IGNORECASE)

Cells = dict[str, str]


@dataclass(frozen=True, slots=True)
class Wanted:
    """
    What is made of each row: one for each of ``stations``, read only, with at least ``period`` ms.

    Of several stations the tags begin with ``station_N/``.
    """

    plc_type: PlcType = PlcType.SLC
    stations: Sequence[int] = (1,)
    read_only: bool = False
    period: int = 0


@dataclass(slots=True)
class Import:
    """The rows of a map: ``lines`` as they are written, ``left_out`` what could not be used."""

    count: int = 0
    lines: list[str] = field(default_factory=list)
    left_out: list[Problem] = field(default_factory=list)

    @property
    def text(self) -> str:
        """Return the map CSV."""
        return '\n'.join([','.join(_COLUMNS), *self.lines, ''])


def import_map(path: str, wanted: Wanted) -> Import:
    """
    Return the map that an export becomes.

    Raises ConfigurationError where the file cannot be read, or is neither of both.
    """
    records = list(_records(path))
    fill = _reader(path, records, wanted)
    result, seen = Import(), dict[str, int]()
    for line, record in records:
        cells = {'PLC_Type': wanted.plc_type.value}
        try:
            fill(record, cells)
            names = [_checked(row, path, line) for row in _rows(cells, wanted)]
            if clash := seen.get(names[0]):
                raise ValueError(f'the name {names[0]} is that of line {clash}')
        except ValueError as error:
            tag = shown(cells.get('Tag', '')) or 'without a name'
            result.left_out.append(Problem(Place(path, line), f'{tag}: {error}'))
            result.lines.append(printable(f'# line {line}: {",".join(record)}: {error}'))
        else:
            seen[names[0]] = line
            result.count += len(names)
            result.lines += map(_csv_line, _rows(cells, wanted))
    return result


def _rows(cells: Cells, wanted: Wanted) -> Iterator[Cells]:
    """Yield the row for each station."""
    for station in wanted.stations:
        head = f'station_{station}/' if len(wanted.stations) > 1 else ''
        yield {**cells, 'Tag': head + cells['Tag'], 'Station': str(station)}


def _checked(cells: Cells, path: str, line: int) -> str:
    """Return the name of a row; ValueError where it is not a good one."""
    reader = RowReader(Row(path, line, line, cells, {}))
    mapping = reader.read()
    if mapping is None:
        raise ValueError('; '.join(fault.words() for fault in reader.faults))
    return mapping.name


def _records(path: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the records of a file, each with its first line."""
    try:
        raw = Path(path).read_bytes()
    except OSError as error:
        raise ConfigurationError([Problem(
            path, f'cannot be read: {error.strerror or error}')]) from None
    try:
        text = raw.decode('utf-16' if raw.startswith(_BYTE_ORDERS) else 'utf-8-sig')
    except UnicodeDecodeError:
        text = raw.decode('cp1252', 'replace')  # as programs on Windows write it
    first = re.sub('"[^"]*"', '', text.lstrip()).partition('\n')[0]
    reader = csv.reader(io.StringIO(text, newline=None), delimiter=max(',;\t', key=first.count))
    line = 1
    try:
        for record in reader:
            cells = [' '.join(re.sub('[\0-\x1f\x7f]', ' ', cell).split()) for cell in record]
            if any(cells):
                yield line, cells
            line = reader.line_num + 1
    except csv.Error as error:
        raise ConfigurationError([Problem(Place(path, line), str(error))]) from None


def _reader(path: str, records: list[tuple[int, list[str]]],
            wanted: Wanted) -> Callable[[Sequence[str], Cells], None]:
    """Return what fills in the cells of a record; a header is taken away."""
    if records and is_export_of_kepserver(records[0][1]):
        names = [name.lower() for name in records.pop(0)[1]]
        return lambda record, cells: _of_kepserver(
            dict(zip(names, record, strict=False)), cells, wanted)
    if any(looks_like_address(record[0].replace('/', ':')) for _, record in records):
        return lambda record, cells: _of_rslogix(record, cells, wanted)
    raise ConfigurationError([Problem(path, (
        'is neither an export of KEPServerEX (File, Export CSV), whose first row begins with "Tag '
        'Name,Address", nor of the symbols of RSLogix, whose rows begin with an address'))])


def _of_rslogix(record: Sequence[str], cells: Cells, wanted: Wanted) -> None:
    address, _, symbol, *descriptions = (*record, '', '', '')
    _fill(cells, Tag=symbol or address, Command='Read', Address=address,
          Period=str(wanted.period or ''),
          Description=' '.join(filter(None, descriptions[:5])))
    if _OTHER_ROWS.match(address):
        raise ValueError('is about a file or a rung')
    if address and not re.search('[./]', address):
        place = parse_address(address, wanted.plc_type)
        if place.file_type.is_structure:  # a symbol of a whole timer: all of its words
            cells['Length'] = str(place.layout.words)


def _fill(cells: Cells, **texts: str) -> None:
    cells.update({column: text for column, text in texts.items() if text})


def _of_kepserver(record: Cells, cells: Cells, wanted: Wanted) -> None:
    # A dot stands between a group and its tags.
    _fill(cells, Tag=record.get('tag name', '').replace('.', '/'))
    kind, access = record.get('data type', '').lower(), record.get('client access', '').upper()
    address, length = record.get('address', ''), 1
    if match := _ARRAY.fullmatch(address):
        address = match['address']
        for size in re.findall(r'\d+', match['sizes']):
            length *= int(size)
    kind = kind.removesuffix(' array')
    if kind not in _TYPES or access not in _ACCESS:
        what = f'Data Type "{shown(record.get("data type", ""))}"' if kind not in _TYPES else \
            f'Client Access "{shown(record.get("client access", ""))}"'
        raise ValueError(f'{what} has no counterpart')
    command = _ACCESS[access]
    if wanted.read_only:
        if command == 'Write':
            raise ValueError('is only written, and --read-only is given')
        command = 'Read'
    unit = record.get('eng units') or record.get('engineering units', '')
    period = record.get('scan rate', '')
    if (whole_number(period) or 0) < wanted.period:
        period = str(wanted.period)
    _fill(cells, Command=command, Address=address, Length=str(length) if length > 1 else '',
          Type=_TYPES[kind], Period='' if command == 'Write' else period,
          Description=' '.join(filter(None, (
              record.get('description', ''), f'[{unit}]' * bool(unit)))),
          **_scaling(record, command))


def _scaling(record: Cells, command: str) -> Cells:
    """Return Scale and Offset of a straight line through both ends, and limits of writes."""
    mode, sign = record.get('scaling', '').lower(), 1.0
    if record.get('negate value', '') not in ('', '0'):
        sign = -1.0
    if mode in ('', 'none'):
        return {'Scale': '-1'} if sign < 0 else {}
    if mode != 'linear':
        raise ValueError(f'Scaling "{shown(record["scaling"])}" has no counterpart; Linear has')
    ends = [decimal_number(record.get(name, '').replace(',', '.')) for name in (
        'raw low', 'raw high', 'scaled low', 'scaled high')]
    raw_low, raw_high, low, high = ends
    if raw_low is None or raw_high is None or low is None or high is None or raw_low == raw_high:
        raise ValueError('Raw Low, Raw High, Scaled Low and Scaled High should be numbers, and '
                         'both raw ones differ')
    scale = sign * (high - low) / (raw_high - raw_low)
    cells = {'Scale': f'{scale:.12g}', 'Offset': f'{sign * low - raw_low * scale:.12g}'}
    if command != 'Read':
        ends_of = ('Min', 'Max') if sign > 0 else ('Max', 'Min')
        for name, column, value in zip(
                ('clamp low', 'clamp high'), ends_of, (low, high), strict=True):
            if record.get(name) == '1':
                cells[column] = f'{sign * value + 0.0:.12g}'  # 0, not -0
    return cells


def _csv_line(cells: Cells) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator='').writerow([cells.get(column, '') for column in _COLUMNS])
    line = out.getvalue()
    # Without quotes a row whose Tag begins with # would be a comment.
    return line.replace(cells['Tag'], f'"{cells["Tag"]}"', 1) if line.startswith('#') else line
