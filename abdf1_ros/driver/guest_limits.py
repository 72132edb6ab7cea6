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
The limits of values that guests write: Min and Max of the rows that have the words, and no NaN.

A value has to be whole: the bits, or the words, that a command leaves alone could make any value.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
import math
import struct

from abdf1_ros.df1.packet import BROADCAST, Packet, PRIORITY_BIT
from abdf1_ros.driver.foreign_words import WrittenWords
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.plc5 import commands as plc5
from abdf1_ros.pccc.slc import commands as slc
from abdf1_ros.pccc.slc.address import BY_CODE
from abdf1_ros.pccc.typed_data import FLOAT
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.settings.limits import check_foreign, has_limits
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.rows import Rows

_FLOAT_SIZE = 4
_PART = b'?'
_ALL_BITS = 0xFFFF


def limited(rows: Rows, station: int) -> list[Mapping]:
    """Return the rows of a station, or of all stations, that do not take every value."""
    return [row for row in rows.of_plcs
            if station in (row.station, BROADCAST) and has_limits(row)]


def check_values(rows: list[Mapping], words: list[WrittenWords]) -> None:
    """Check the values of ``rows`` in words that are written; FormatError names row and limit."""
    for row in rows:
        try:
            for index, data in _values(row, words):
                if data is None:
                    raise FormatError(f'the whole value at index {index} is not known')
                for raw in replace(row.codec, length=1).decode(data):
                    check_foreign(row, float(raw), index)
        except FormatError as error:
            raise FormatError(f'{row.tag}: {error}') from None


def _values(row: Mapping, words: list[WrittenWords]) -> Iterator[tuple[int, bytes | None]]:
    """Yield index and bytes of each value that is written, None for a part of a value."""
    known: dict[int, bytes | None] = {}
    for written in words:
        if written.extent.meets(row.extent):
            for number, offset in enumerate(range(written.extent.first, written.extent.end)):
                known[offset] = written.data and written.data[2 * number:2 * number + 2]
    size = row.codec.element_words
    for index in range(row.length):
        first = row.extent.first + index * size
        here = [known.get(offset) for offset in range(first, first + size)]
        if any(offset in known for offset in range(first, first + size)):
            yield index, None if None in here else b''.join(filter(None, here))


def check_floats(command: Packet) -> None:
    """Check the values of a command that names the type float; FormatError for NaN, infinity."""
    try:
        data = _floats_of(command)
    except FormatError:  # it is malformed, which needs All
        return
    if len(data) % _FLOAT_SIZE:
        raise FormatError('only a part of a float')
    for index, (value,) in enumerate(struct.iter_unpack('<f', data)):
        if not math.isfinite(value):
            raise ValueType.FLOAT32.refusal(value, index)


def _floats_of(command: Packet) -> bytes:
    """Return the values that a command writes as floats, one byte for a part of a float."""
    if command.cmd & ~PRIORITY_BIT != slc.CMD or not command.data:
        return b''
    function, reader = command.data[0], Reader(command.data[1:])
    if function == plc5.TYPED_WRITE:
        values = plc5.TypedWrite.read(reader).values
        if values.type_id != FLOAT:
            return b''
        return values.data if values.element_size == _FLOAT_SIZE else _PART
    if function == slc.MASKED_WRITE:
        masked = slc.MaskedWrite.read(reader)
        address, data = masked.address, masked.data if masked.mask == _ALL_BITS else _PART
    elif function in (slc.LOGICAL_WRITE, slc.SHORT_WRITE):
        written = slc.LogicalWrite.read(reader, function == slc.SHORT_WRITE)
        address, data = written.address, written.data
    else:
        return b''
    if BY_CODE.get(address.type_code) is not FileType.FLOAT:
        return b''
    return _PART if (address.sub_element or 0) % 2 else data
