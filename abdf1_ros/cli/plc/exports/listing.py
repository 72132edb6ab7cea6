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
Any list whose first row names the columns, such as addresses and tags.

Usual names of columns are found. The user gives other names by options of ``plc import``.
"""

from __future__ import annotations

from collections.abc import Sequence

from abdf1_ros.cli.plc.exports.form import (
    Cells,
    cells_of,
    command_of,
    Format,
    FoundRow,
    Ignored,
    limited,
    READ,
    Reader,
    Unusable,
    Wanted,
    whole_length,
)
from abdf1_ros.cli.plc.exports.records import Record
from abdf1_ros.problems import ConfigurationError, Place, Problem
from abdf1_ros.settings.hints import looks_like_address
from abdf1_ros.text import shown

# Names of columns, the best first.
_NAMES = {
    'tag': ('tag name', 'tagname', 'tag', 'symbol', 'symbol name', 'device tag', 'name',
            'variable', 'signal'),
    'address': ('address', 'plc address', 'device address', 'tag address', 'data address',
                'i/o address', 'io address', 'itemname', 'item name', 'adresse'),
    'type': ('data type', 'datatype'),
    'access': ('access', 'client access', 'access rights', 'read only', 'readonly', 'r/w',
               'read/write')}
_DESCRIPTIONS = ('desc', 'comment', 'beschreibung', 'bemerkung', 'kommentar')
_TYPES = {
    '': '', 'default': '', 'bool': '', 'boolean': '', 'bit': '', 'discrete': '', 'digital': '',
    'short': 'int16', 'int': 'int16', 'int16': 'int16', 'integer': 'int16', 'word': 'uint16',
    'uint': 'uint16', 'uint16': 'uint16', 'long': 'int32', 'dint': 'int32', 'int32': 'int32',
    'dword': 'uint32', 'udint': 'uint32', 'uint32': 'uint32', 'float': 'float32',
    'real': 'float32', 'float32': 'float32', 'single': 'float32', 'bcd': 'bcd16',
    'bcd16': 'bcd16', 'string': 'string', 'timer': '', 'counter': '', 'control': '', 'pid': '',
    'message': ''}
_COMMENTS = ('#', ';', 'sep=')
_OURS = {'tag', 'command', 'address', 'station', 'plc_type'}


def _reader(path: str, records: Sequence[Record], wanted: Wanted) -> Reader | None:
    head = next((record for record in records if not record.first.startswith(_COMMENTS)), None)
    if head is None or any(map(looks_like_address, head.cells)):
        return None
    names = [name.lower() for name in head.cells]
    if set(names) >= _OURS:
        raise ConfigurationError([Problem(path, 'is a map already')])
    columns = _columns(path, head, names, wanted)
    if columns is None:
        return None
    described = [column for column, name in enumerate(names) if name.startswith(_DESCRIPTIONS)] \
        if 'description' not in columns else [columns['description']]

    def read(record: Record) -> FoundRow | Ignored:
        if record.line <= head.line or record.first.startswith(_COMMENTS):
            return Ignored()
        cells = dict(enumerate(record.cells))
        texts = {role: cells.get(column, '') for role, column in columns.items()}
        access = head.cells[columns['access']] if 'access' in columns else ''
        description = ' '.join(cells[column] for column in described if cells.get(column))
        return _found(texts, access, description, wanted)
    return read


FORMAT = Format('a list whose first row names its columns (--tag COLUMN --address COLUMN)',
                _reader)


def _columns(path: str, head: Record, names: list[str], wanted: Wanted) -> dict[str, int] | None:
    """Return the columns by role; None if the head names neither tags nor addresses."""
    columns: dict[str, int] = {}
    for role, name in wanted.columns.items():
        if name.lower() not in names:
            raise ConfigurationError([Problem(Place(path, head.line), (
                f'--{role} "{shown(name)}" is not a column; columns: '
                f'{", ".join(map(shown, filter(None, head.cells)))}'))])
        columns[role] = names.index(name.lower())
    for role, usual in _NAMES.items():
        known = [names.index(name) for name in usual if name in names]
        if role not in columns and known:
            columns[role] = known[0]
    missing = [role for role in ('tag', 'address') if role not in columns]
    if len(missing) == 2:
        return None
    if missing:
        raise ConfigurationError([Problem(Place(path, head.line), (
            f'which column is the {missing[0]}? Say --{missing[0]} COLUMN; columns: '
            f'{", ".join(map(shown, filter(None, head.cells)))}'))])
    return columns


def _found(texts: Cells, access: str, description: str, wanted: Wanted) -> FoundRow:
    tag, kind = texts['tag'], texts.get('type', '').lower()
    command, remark = READ, 'the file has no column about access: made Read rows (--access COLUMN)'
    if access:
        told = command_of(texts['access'], access)
        command, remark = (told, '') if told else (
            READ, f'"{shown(texts["access"])}" says nothing of access: made Read rows')
    try:
        if kind not in _TYPES:
            raise Unusable(f'the type "{shown(texts["type"])}" has no counterpart; it can be '
                           f'{", ".join(filter(None, _TYPES))}')
        return FoundRow(cells_of(
            Tag=tag, Command=limited(command, wanted), Address=texts['address'],
            Length=whole_length(texts['address'], wanted.plc_type), Type=_TYPES[kind],
            Period=str(wanted.period or ''), Description=description),
            remark='' if wanted.read_only else remark)
    except Unusable as error:
        raise Unusable(str(error), tag) from None
