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
Tags of KEPServerEX: File, Export CSV of a device.

Kepware ("CSV Import/Export") and PTC list its columns. Data types and addresses are described in
the help of its driver for Allen-Bradley DF1.
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
    scaling,
    Unusable,
    Wanted,
    WRITE,
)
from abdf1_ros.cli.plc.exports.records import Record
from abdf1_ros.numbers import whole_number
from abdf1_ros.text import shown

_NEEDED = {'tag name', 'address', 'data type', 'client access'}

_TYPES = {
    'default': '', 'boolean': 'bool', 'short': 'int16', 'word': 'uint16', 'long': 'int32',
    'dword': 'uint32', 'float': 'float32', 'bcd': 'bcd16', 'string': 'string'}
_ARRAY = re.compile(r'(?P<address>[^\[]+?)\s*(?P<sizes>(?:\s*\[\d{1,5}\])+)')
# Addresses in A files count characters, two in a word; a string has its length after "/".
_CHARACTERS = re.compile(r'A(?P<file>\d{1,3}):(?P<first>\d{1,5})(?:/(?P<count>\d{1,3}))?',
                         re.IGNORECASE)
# For a MicroLogix the number may name a word of the file, for an SLC a slot.
_SLOT_OR_WORD = re.compile(r'[IO]\d?:\d+(?:/\d+)?', re.IGNORECASE)
_UNSURE = ('an input or output without its word, such as I:4, is slot 4 of an SLC; of a '
           'MicroLogix it may be word 4: made a Read row, compare its value with the PLC')


def _reader(path: str, records: Sequence[Record], wanted: Wanted) -> Reader | None:
    names = [name.lower() for name in records[0].cells] if records else []
    if not set(names) >= _NEEDED:
        return None

    def read(record: Record) -> FoundRow | Ignored:
        if record is records[0]:
            return Ignored()
        return _found(dict(zip(names, record.cells, strict=False)), wanted)
    return read


FORMAT = Format('tags of KEPServerEX (File, Export CSV)', _reader)


def _found(record: Cells, wanted: Wanted) -> FoundRow:
    # A dot separates the names of a group and its tags.
    tag = record.get('tag name', '').replace('.', '/')
    try:
        address, length, kind = _place(record)
        command, remark = _command(record, wanted)
        if _SLOT_OR_WORD.fullmatch(address) and wanted.plc_type.value == 'SLC':
            command, remark = READ, _UNSURE
        period = record.get('scan rate', '')
        if (whole_number(period) or 0) < wanted.period:
            period = str(wanted.period)
        unit = record.get('eng units') or record.get('engineering units', '')
        return FoundRow(cells_of(
            Tag=tag, Command=command, Address=address, Type=kind,
            Length=str(length) if length > 1 else '', Period='' if command == WRITE else period,
            Description=' '.join(filter(None, (
                record.get('description', ''), f'[{unit}]' * bool(unit)))),
            **_scaling(record, command)), remark=remark)
    except Unusable as error:
        raise Unusable(str(error), tag) from None


def _place(record: Cells) -> tuple[str, int, str]:
    """Return address, Length and Type."""
    address, length = record.get('address', ''), 1
    if match := _ARRAY.fullmatch(address):
        address = match['address']
        for size in re.findall(r'\d+', match['sizes']):
            length *= int(size)
    kind = record.get('data type', '').lower().removesuffix(' array')
    if match := _CHARACTERS.fullmatch(address):
        return _characters(match, kind)
    if kind not in _TYPES:
        raise Unusable(f'Data Type "{shown(record.get("data type", ""))}" has no counterpart')
    return address, length, _TYPES[kind]


def _characters(match: re.Match[str], kind: str) -> tuple[str, int, str]:
    first, count = int(match['first']), int(match['count'] or 0)
    word = f'A{match["file"]}:{first // 2}'
    if kind == 'string' and count and not first % 2 and not count % 2:
        return word, count // 2, 'string'
    raise Unusable(f'{match[0]} counts characters, two in a word; read {word} as uint16 instead'
                   + (', or an even number of characters from an even one on' if count else ''))


def _command(record: Cells, wanted: Wanted) -> tuple[str, str]:
    """Return the Command, and a remark if the file has no access cell."""
    text = record.get('client access', '')
    if not text:
        return READ, 'Client Access is empty: made Read rows'
    command = command_of(text)
    if command is None:
        raise Unusable(f'Client Access "{shown(text)}" has no counterpart')
    return limited(command, wanted), ''


def _scaling(record: Cells, command: str) -> Cells:
    """Return Scale and Offset of a straight line through both ends, and limits of writes."""
    mode, sign = record.get('scaling', '').lower(), 1.0
    if record.get('negate value', '') not in ('', '0'):
        sign = -1.0
    if mode in ('', 'none'):
        return {'Scale': '-1'} if sign < 0 else {}
    if mode != 'linear':
        raise Unusable(f'Scaling "{shown(record["scaling"])}" has no counterpart; Linear has')
    ends = [record.get(name, '') for name in ('raw low', 'raw high', 'scaled low', 'scaled high')]
    cells = scaling(ends, sign)
    if command != READ:
        for name, column, end in zip(
                ('clamp low', 'clamp high'), ('Min', 'Max') if sign > 0 else ('Max', 'Min'),
                ends[2:], strict=True):
            if record.get(name) == '1':
                cells[column] = f'{sign * float(number_text(end)) + 0.0:.12g}'  # 0, not -0
    return cells
