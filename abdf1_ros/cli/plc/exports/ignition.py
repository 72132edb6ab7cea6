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
Tags of Ignition: its JSON export has folders with tags; opcItemPath is ns=1;s=[PLC]N7:0.

Each tag becomes a record, so that it is read like the row of any other file. A tag has the data
type of its value in Ignition, not of the words in the PLC.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import json
import re

from abdf1_ros.cli.plc.exports.form import (
    Cells,
    cells_of,
    Format,
    FoundRow,
    Ignored,
    limited,
    READ,
    READ_WRITE,
    Reader,
    scaling,
    Unusable,
    Wanted,
)
from abdf1_ros.cli.plc.exports.records import one_line, Record
from abdf1_ros.text import shown

_MARK = 'opcItemPath'
_FIELDS = (_MARK, 'valueSource', 'readOnly', 'documentation', 'engUnit', 'scaleMode', 'rawLow',
           'rawHigh', 'scaledLow', 'scaledHigh')
_PATH = re.compile(r'(?:ns=\d+;s=)?\[(?P<node>[^]]+)\](?P<address>.+)')
_MOST_FOLDERS = 50  # folders inside each other


def records_of(text: str) -> list[Record]:
    """Return a record for each tag, after a record that names the cells; none for another file."""
    if not text.lstrip().startswith(('{', '[')) or _MARK not in text:
        return []
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return []
    records = [Record(1, ('ignition', *_FIELDS))]
    start = 0
    for name, tag in _tags(content, '', _MOST_FOLDERS):
        cells = [tag.get(field, '') for field in _FIELDS]
        found = text.find(f'"{_MARK}"', start) if _MARK in tag else -1
        start = start if found < 0 else found + 1
        records.append(Record(text.count('\n', 0, start) + 1, (one_line(name), *(
            one_line(cell) if isinstance(cell, str) else json.dumps(cell) for cell in cells))))
    return records


def _tags(node: object, folder: str, depth: int) -> Iterator[tuple[str, dict[str, object]]]:
    """Yield each tag with its name; the names of its folders are before it: folder/tag."""
    if isinstance(node, list):
        for part in node:
            yield from _tags(part, folder, depth)
    elif isinstance(node, dict) and depth:
        name = '/'.join(filter(None, (folder, str(node.get('name') or ''))))
        if 'tags' in node:
            yield from _tags(node['tags'], name, depth - 1)
        else:
            yield name, node


def _reader(path: str, records: Sequence[Record], wanted: Wanted) -> Reader | None:
    if not records or records[0].cells != ('ignition', *_FIELDS):
        return None
    return lambda record: Ignored() if record is records[0] else _found(
        dict(zip(('name', *_FIELDS), record.cells, strict=True)), wanted)


FORMAT = Format('tags of Ignition (Export Tags, JSON)', _reader)


def _found(tag: Cells, wanted: Wanted) -> FoundRow | Ignored:
    if tag['valueSource'] != 'opc':
        return Ignored('tags that are not of a PLC')
    match = _PATH.fullmatch(tag[_MARK])
    try:
        if match is None:
            raise Unusable(f'{_MARK} {shown(tag[_MARK])} has no address, as in ns=1;s=[PLC]N7:0')
        scale: Cells = {}
        if tag['scaleMode'] not in ('', 'Off'):
            if tag['scaleMode'] != 'Linear':
                raise Unusable(f'scaleMode {shown(tag["scaleMode"])} has no counterpart; Linear '
                               'has')
            scale = scaling([tag[end] for end in _FIELDS[-4:]])
        command = {'true': READ, 'false': READ_WRITE}.get(tag['readOnly'], '')
        return FoundRow(cells_of(
            Tag=tag['name'], Command=limited(command or READ, wanted), Address=match['address'],
            Period=str(wanted.period or ''), Description=' '.join(filter(None, (
                tag['documentation'], f'[{tag["engUnit"]}]' * bool(tag['engUnit'])))), **scale),
            match['node'], '' if command else 'readOnly is not in the file: made Read rows')
    except Unusable as error:
        raise Unusable(str(error), tag['name'], match and match['node']) from None
