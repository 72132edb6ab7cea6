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
Tags of Ignition: its JSON export has folders with tags.

Each tag becomes a record, so that it is read like the row of any other file.
"""

from __future__ import annotations

from collections.abc import Iterator
import json

from abdf1_ros.cli.plc.exports.records import one_line, Record

_MARK = 'opcItemPath'
_FIELDS = (_MARK, 'valueSource', 'readOnly', 'documentation', 'engUnit', 'scaleMode', 'rawLow',
           'rawHigh', 'scaledLow', 'scaledHigh')
_MOST_FOLDERS = 50  # folders inside each other


def records_of(text: str) -> list[Record]:
    """Return a record for each tag, after a record that names the cells; none for another file."""
    if not text.lstrip().startswith(('{', '[')) or _MARK not in text:
        return []
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        return []
    records = [Record(1, ('name', *_FIELDS))]
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
