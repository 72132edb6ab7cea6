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
Symbols of RSLogix 500 and 5: no header; address, scope, symbol, five lines of description.

The file also has rows about files and rungs, and a row for every word of the status file.
"""

from __future__ import annotations

from collections.abc import Sequence
import re

from abdf1_ros.cli.plc.exports.form import (
    cells_of,
    Format,
    FoundRow,
    Ignored,
    READ,
    Reader,
    Unusable,
    Wanted,
    whole_length,
)
from abdf1_ros.cli.plc.exports.records import Record
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.settings.hints import looks_like_address
from abdf1_ros.settings.names import sanitise

_SCOPE = re.compile(r'global|local.*', re.IGNORECASE)
_OTHER_ROWS = re.compile(r'(?P<what>DFILE|PFILE|LAD|RUNG)', re.IGNORECASE)


def _reader(path: str, records: Sequence[Record], wanted: Wanted) -> Reader | None:
    scopes = [record.cells[1:2] for record in records
              if looks_like_address(record.first.replace('/', ':'))]
    # A list without a scope comes from another program, whose columns may mean anything.
    if not any(scope and _SCOPE.fullmatch(scope[0]) for scope in scopes) or not all(
            not scope or not scope[0] or _SCOPE.fullmatch(scope[0]) for scope in scopes):
        return None
    return lambda record: _found(record, wanted)


FORMAT = Format('symbols of RSLogix 500 or 5 (rows of address, scope, symbol)', _reader)


def _found(record: Record, wanted: Wanted) -> FoundRow | Ignored:
    address, _, symbol, *descriptions = (*record.cells, '', '', '')
    if match := _OTHER_ROWS.match(address):
        return Ignored(f'{match["what"].upper()} rows')
    if not address:
        raise Unusable('Address is missing', symbol)
    try:
        place = parse_address(address, wanted.plc_type)
    except FormatError as error:
        raise Unusable(str(error), symbol or address) from None
    if place.file_type is FileType.STATUS and not symbol and not wanted.has_status:
        return Ignored('rows of the status file without a symbol (--status takes them)')
    return FoundRow(cells_of(
        Tag=symbol or sanitise(address), Command=READ, Address=address,
        Length=whole_length(address, wanted.plc_type),
        Period=str(wanted.period or ''), Description=' '.join(filter(None, descriptions[:5]))))
