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

"""The common parts of all formats: the user's options, the result of a row, common words."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import re

from abdf1_ros.cli.plc.exports.records import Record
from abdf1_ros.errors import FormatError
from abdf1_ros.numbers import decimal_number, two_readings
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.text import shown

Cells = dict[str, str]

READ, WRITE, READ_WRITE = 'Read', 'Write', 'ReadWrite'

_ACCESS = {'ro': READ, 'r': READ, 'read': READ, 'read only': READ, 'readonly': READ,
           'read-only': READ, 'rw': READ_WRITE, 'r/w': READ_WRITE, 'read/write': READ_WRITE,
           'readwrite': READ_WRITE, 'read-write': READ_WRITE, 'w': WRITE, 'wo': WRITE,
           'write': WRITE, 'write only': WRITE, 'write-only': WRITE}
_YES, _NO = ('yes', 'true', 't', 'y', '1'), ('no', 'false', 'f', 'n', '0')
_READ_ONLY = re.compile(r'read.?only|ro', re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Wanted:
    """
    The rows to make of each row of a file: one for each station.

    - ``period``: the least Period (ms) of a row.
    - ``stations``: if there are several, the tags begin with ``station_N/``.
    - ``read_only``: all rows are Read rows.
    - ``columns``: names of columns that the user gives by options.
    - ``node``: the PLC to take if a file has several.
    - ``has_status``: take words of the status file without a symbol, too.
    """

    plc_type: PlcType = PlcType.SLC
    stations: Sequence[int] = (1,)
    read_only: bool = False
    period: int = 0
    columns: Cells = field(default_factory=dict)
    node: str | None = None
    has_status: bool = False


@dataclass(frozen=True, slots=True)
class FoundRow:
    """The cells of a row, the PLC that the file names for it, and remarks for the user."""

    cells: Cells
    node: str = ''
    remark: str = ''


@dataclass(frozen=True, slots=True)
class Ignored:
    """A row that is skipped; ``what`` is its kind, empty for a row that is not counted."""

    what: str = ''


class Unusable(ValueError):
    """
    The reason why a row that should have an address cannot be used; ``tag`` names the row.

    ``node`` is the PLC that the file names for it, None if that is not known.
    """

    def __init__(self, text: str, tag: str = '', node: str | None = None) -> None:
        super().__init__(text)
        self.tag, self.node = tag, node


Reader = Callable[[Record], FoundRow | Ignored]
"""Reads one record of a file; raises Unusable."""


@dataclass(frozen=True, slots=True)
class Format:
    """
    A form of file: its name, and its reader.

    ``reader`` returns None for records of another form. It raises ConfigurationError for records
    of this form that cannot be used.
    """

    title: str
    reader: Callable[[str, Sequence[Record], Wanted], Reader | None]


def cells_of(**texts: str) -> Cells:
    """Return the cells of a row that are not empty."""
    return {column: text for column, text in texts.items() if text}


def whole_length(address: str, plc_type: PlcType) -> str:
    """Return the Length of a whole element, such as a timer, at an address; otherwise empty."""
    if re.search('[./-]', address):
        return ''
    try:
        place = parse_address(address, plc_type)
    except FormatError:
        return ''
    is_plain = place.file_type.is_structure and all(
        member.words == 1 for member in place.layout.members.values())
    return str(place.layout.words) if is_plain else ''


def command_of(text: str, column: str = '') -> str | None:
    """Return the Command that an access cell stands for; None if the cell is unknown."""
    word = text.lower()
    if _READ_ONLY.fullmatch(column):
        return READ if word in _YES else READ_WRITE if word in _NO else _ACCESS.get(word)
    return _ACCESS.get(word)


def limited(command: str, wanted: Wanted) -> str:
    """Return the Command that the user wants; raise Unusable for a row that is only written."""
    if not wanted.read_only:
        return command
    if command == WRITE:
        raise Unusable('cannot be read, and --read-only is given')
    return READ


def scaling(ends: Sequence[str], sign: float = 1.0) -> Cells:
    """Return Scale and Offset that make raw low and raw high the values low and high."""
    raw_low, raw_high, low, high = map(_number, ends)
    if raw_low is None or raw_high is None or low is None or high is None or raw_low == raw_high:
        raise Unusable('the ends of its scale should be numbers, and both raw ones differ: '
                       f'{", ".join(map(shown, ends))}')
    scale = sign * (high - low) / (raw_high - raw_low)
    return {'Scale': f'{scale:.12g}', 'Offset': f'{sign * low - raw_low * scale + 0.0:.12g}'}


def number_text(text: str) -> str:
    """Return a number as a map writes it; raise Unusable if the text is not a number."""
    value = _number(text)
    if value is None:
        raise Unusable(f'"{shown(text)}" should be a number')
    return f'{value:.12g}'


def _number(text: str) -> float | None:
    """Return a number, which may have a decimal comma; None for other texts."""
    if right := two_readings(text):
        raise Unusable(f'"{shown(text)}" could be two numbers; write {right}')
    return decimal_number(text.replace(',', '.'))
