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
Tags of InTouch, as DBDump writes them.

A line such as :IOInt names the columns of the tags after it. AccessName is the PLC, ItemName the
address.
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
    scaling,
    Unusable,
    Wanted,
)
from abdf1_ros.cli.plc.exports.records import Record
from abdf1_ros.text import shown

# Sections of tags in a PLC; all other sections have memory, groups and servers.
_IN_PLC = ('iodisc', 'ioint', 'ioreal', 'iomsg')
_LIMITS = {'Min': 'mineu', 'Max': 'maxeu'}


def _reader(path: str, records: Sequence[Record], wanted: Wanted) -> Reader | None:
    if not any(record.first.lower().startswith((':iodisc', ':ioint', ':ioreal', ':iomsg'))
               for record in records):
        return None
    names: list[str] = []

    def read(record: Record) -> FoundRow | Ignored:
        if record.first.startswith(':'):
            names[:] = [name.lower().lstrip(':') for name in record.cells]
            return Ignored()
        section = names[0] if names else ''
        if section not in _IN_PLC:
            return Ignored('' if section in ('ioaccess', 'alarmgroup') else
                           'tags without a PLC (memory, groups, trends)')
        return _found(dict(zip(names, record.cells, strict=False)), section, wanted)
    return read


FORMAT = Format('tags of InTouch (DBDump)', _reader)


def _found(record: Cells, section: str, wanted: Wanted) -> FoundRow:
    tag = record[section]
    try:
        command = limited(command_of(record.get('readonly', ''), 'readonly') or READ, wanted)
        address = tag if record.get('itemusetagname', '').lower() == 'yes' \
            else record.get('itemname', '')
        return FoundRow(cells_of(
            Tag=tag, Command=command, Address=address, Period=str(wanted.period or ''),
            Description=record.get('comment', ''), **_scaling(record, command)),
            record.get('accessname', ''))
    except Unusable as error:
        raise Unusable(str(error), tag, record.get('accessname', '')) from None


def _scaling(record: Cells, command: str) -> Cells:
    """Return Scale and Offset if raw and engineering units differ, and limits of writes."""
    if not record.get('minraw') and not record.get('maxraw'):
        return {}
    if (conversion := record.get('conversion', '')).lower() not in ('', 'linear'):
        raise Unusable(f'Conversion "{shown(conversion)}" has no counterpart; Linear has')
    cells = scaling([record.get(name, '') for name in ('minraw', 'maxraw', 'mineu', 'maxeu')])
    if cells == {'Scale': '1', 'Offset': '0'}:
        cells = {}
    if command != READ:
        cells |= {column: record[name] for column, name in _LIMITS.items() if record.get(name)}
    return cells
