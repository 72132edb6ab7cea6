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
Tags of RSView32 and FactoryTalk View: CSV of the tag database.

A line that begins with a semicolon names the columns. FactoryTalk View names the PLC by a shortcut
before the address, [PLC1]N7:0. RSView32 names it in the column Node Name.
"""

from __future__ import annotations

from collections.abc import Sequence
import re

from abdf1_ros.cli.plc.exports.form import (
    Cells,
    cells_of,
    command_of,
    Format,
    FoundRow,
    Ignored,
    limited,
    number_text,
    READ,
    Reader,
    Unusable,
    Wanted,
)
from abdf1_ros.cli.plc.exports.records import Record
from abdf1_ros.text import shown

_SHORTCUT = re.compile(r'\{?(?:::)?\[(?P<node>[^\]]+)\](?P<address>[^}]+)\}?')
_TYPES = {'': '', 'd': '', 'i': 'int16', 'u': 'uint16', 'l': 'int32', 'f': 'float32'}


def _reader(path: str, records: Sequence[Record], wanted: Wanted) -> Reader | None:
    head = next((record for record in records if record.first.lower() == ';tag type'), None)
    if head is None:
        return None
    names = [name.lower().lstrip(';') for name in head.cells]

    def read(record: Record) -> FoundRow | Ignored:
        if record.first.startswith(';') or record.first.upper() == 'F':
            return Ignored()  # a comment, a folder
        return _found(dict(zip(names, record.cells, strict=False)), wanted)
    return read


FORMAT = Format('tags of RSView32 or FactoryTalk View', _reader)


def _found(record: Cells, wanted: Wanted) -> FoundRow | Ignored:
    tag = record.get('tag name', '').replace('\\', '/')
    if record.get('data source', '').upper() != 'D':
        return Ignored('tags without a PLC (memory and system)')
    address, node = record.get('address', ''), record.get('node name', '')
    if match := _SHORTCUT.fullmatch(address):
        address, node = match['address'], match['node']
    try:
        return FoundRow(_cells(tag, address, record, wanted), node)
    except Unusable as error:
        raise Unusable(str(error), tag, node) from None


def _cells(tag: str, address: str, record: Cells, wanted: Wanted) -> Cells:
    command = limited(command_of(record.get('read only', ''), 'read only') or READ, wanted)
    kind, unit = record.get('native type', '').lower(), record.get('units', '')
    if kind not in _TYPES:
        raise Unusable(f'Native Type "{shown(kind)}" has no counterpart')
    return cells_of(
        Tag=tag, Command=command, Address=address, Type=_TYPES[kind],
        Period=str(wanted.period or ''), Description=' '.join(filter(None, (
            record.get('tag description', ''), f'[{unit}]' * bool(unit)))),
        **_numbers(record, command))


def _numbers(record: Cells, command: str) -> Cells:
    """Return the scaling of an analog tag, and its limits if it is written."""
    if record.get('tag type', '').upper() != 'A':
        return {}
    columns = {'Scale': ('scale', '1'), 'Offset': ('offset', '0')}
    if command != READ:
        columns |= {'Min': ('min analog', ''), 'Max': ('max analog', '')}
    cells = {column: number_text(text) for column, (name, _) in columns.items()
             if (text := record.get(name, ''))}
    return {column: text for column, text in cells.items() if text != columns[column][1]}
