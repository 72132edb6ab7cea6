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
Files of a line without the names in them, for ``sniff --report --anonymous``.

Only listed columns are kept, and in these columns only cells with a valid value: a text in a wrong
place may be a name.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable
import csv
import io
import json

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.errors import FormatError
from abdf1_ros.numbers import one_of, ValueKind, whole
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.families import FAMILIES, parse_range
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.spellings import family_name
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.columns import MAP_COLUMNS
from abdf1_ros.settings.csv_table import read_table, Row
from abdf1_ros.settings.heartbeats import RUN
from abdf1_ros.settings.mapping import Command
from abdf1_ros.settings.network import DEVICE_SERVERS, FIELDS
from abdf1_ros.settings.station_lists import parse_stations

_UNREADABLE = 'left out: neither a net file nor a map that can be read'
_NO_RESULT = 'left out: not a result of "conform --json"'
# The mark for an unreadable cell: the reported fault may be in this cell.
_LEFT_OUT = '?'

_HEARTBEAT = Command.HEARTBEAT.value.lower()
_STATION = whole(0, BROADCAST)
_FAMILIES = {family.value: family for family in FAMILIES}
_KINDS: dict[str, ValueKind[object]] = {
    'Station': _STATION, 'Via': _STATION, 'PLC_Type': one_of(_FAMILIES, family_name),
    'Access': one_of({way.value: way for way in Access} | {'Read': None}),
    'Processor': one_of({entry.value: entry for entry in Processor})}
# Columns of a map that keep their cells. Names in the columns of _TAGS and _TOPICS become numbers.
_KEPT = ('Command', 'Address', 'Station', 'PLC_Type', 'Length', 'Type', 'Period', 'Publish', 'Min',
         'Max', 'Word_Order', 'Scale', 'Offset', 'Access', 'Processor', 'Fallback_After',
         'While_Timeout', 'Via')
_TAGS, _TOPICS = ('Tag', 'While', 'Confirms'), ('Topic',)
# Keys of a case of conform that are kept; other keys have bytes and values.
_RESULT = ('target', 'check', 'baud', 'parity', 'station', 'abdf1_ros')
_CASE = ('case', 'verdict', 'rule', 'source', 'seconds')


def anonymous_settings(path: str) -> tuple[str, str]:
    """Return a new name for a net or map file, and its rows without names."""
    readers: Iterable[tuple[str, list[str], Callable[[list[Row]], list[list[str]]]]] = (
        ('map', [column.name for column in MAP_COLUMNS], _map_rows),
        ('net', [entry.column for entry in FIELDS.values()], _net_rows))
    found = []
    for name, columns, rows in readers:
        try:
            table = read_table(path, columns)
        except ConfigurationError:
            continue
        used = len(table.rows[0].columns) if table.rows else 0
        found.append((used, name, rows(table.rows) if used else []))
    if not found:
        return 'unread.txt', _UNREADABLE
    _, name, lines = max(found)
    out = io.StringIO()
    csv.writer(out, lineterminator='\n').writerows(lines)
    return f'{name}.csv', out.getvalue().rstrip('\n')


def anonymous_result(text: str) -> str:
    """Return a result of ``conform --json`` without received and expected bytes."""
    try:
        result = json.loads(text)
        cases = [{key: str(case[key]) for key in _CASE} for case in result['cases']]
        facts = {key: str(result[key]) for key in _RESULT if key in result}
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return _NO_RESULT
    known = {name: value for name, value in facts.items() if value.replace('.', '').isalnum()}
    return json.dumps({**known, 'cases': cases}, indent=1)


def _net_rows(rows: list[Row]) -> list[list[str]]:
    fields = [entry for entry in FIELDS.values() if entry.column in rows[0].columns]
    return [[entry.column for entry in fields],
            *([_net_cell(entry.column, row.get(entry.column), entry.kind) for entry in fields]
              for row in rows)]


def _net_cell(column: str, text: str, kind: ValueKind[object]) -> str:
    if not text:
        return ''
    if column in ('Com_Port', 'Listen_Port'):
        scheme = text.partition('://')[0]
        return scheme if scheme in DEVICE_SERVERS else 'device'
    if column == 'Share':
        return f'{len(text.split())} places'
    if column == 'Store_Forward':
        return _LEFT_OUT if parse_stations(text, BROADCAST)[1] else text
    return _LEFT_OUT if kind.read(text) is None else text


def _map_rows(rows: list[Row]) -> list[list[str]]:
    names = {column.name: column for column in MAP_COLUMNS}
    columns = [name for name in names if name in rows[0].columns
               and name in (*_KEPT, *_TAGS, *_TOPICS)]
    numbers: defaultdict[str, dict[str, str]] = defaultdict(dict)
    lines = [columns]
    for row in rows:
        cells = []
        for name in columns:
            text = row.get(name)
            if name in _TAGS or name in _TOPICS:
                # While has topics in a Heartbeat row; RUN or a tag in a Read row.
                has_topics = name == 'While' and row.get('Command').lower() == _HEARTBEAT
                words = text.split() if has_topics else [text] * bool(text)
                kind = 'topic' if has_topics or name in _TOPICS else 'tag'
                cells.append(' '.join(word if (name, word.upper()) == ('While', RUN)
                                      else _number(numbers, kind, word) for word in words))
            elif name == 'Address':
                cells.append(_address(text, row))
            else:
                reader = _KINDS.get(name) or names[name].kind
                is_read = reader is not None and reader.read(text) is not None
                cells.append(text if is_read or not text else _LEFT_OUT)
        lines.append(cells)
    return lines


def _number(numbers: dict[str, dict[str, str]], kind: str, name: str) -> str:
    """Return a text such as ``tag_1``, the same for the same name."""
    names = numbers[kind]
    return names.setdefault(name.lower(), f'{kind}_{len(names) + 1}')


def _address(text: str, row: Row) -> str:
    family = _FAMILIES.get(family_name(row.get('PLC_Type')))
    try:
        if text and family:
            parse_range(text, family)
    except FormatError:
        return _LEFT_OUT
    return text if family else _LEFT_OUT
