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
The data files of an SLC 500 or MicroLogix.

Newer processors have a list, the file directory, in file 0; its type code depends on the
processor. The list has rows for programs, configuration, the data files in the order of their
numbers, forces, and function files. No manual that was read has this list. Layout and commands are
from a recording of a MicroLogix 1400 and its programming software (vectors/processors.json).
pycomm3, which was tried with an SLC 5/05 and a MicroLogix 1100, has the same rows at the same
places. Processors without the list are asked for every type that a file may have, because a read
has to name the type.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.fields import word
from abdf1_ros.pccc.file_search import counted, DataFile, is_there
from abdf1_ros.pccc.file_types import DEFAULT_FILES, FileType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.slc import commands as slc
from abdf1_ros.pccc.slc.address import ADDRESSING, BY_CODE, FILES
from abdf1_ros.pccc.slc.dialect import SlcDialect
from abdf1_ros.pccc.status import check_status

_PACKET = 80  # bytes, as the programming software reads it
_ROW = 10  # type, length in bytes, address, and unknown bytes
_MOST = 8192
_RESERVED = 0x81  # a number without a file
_FORCES = 0xA0  # types from here on are not data files

_USUAL = {number: kind for kind, number in DEFAULT_FILES.items()}
# Types of user files, the frequent ones first. Each of the first three files has a fixed type.
_TYPES = (FileType.INTEGER, FileType.BINARY, FileType.FLOAT, FileType.TIMER, FileType.COUNTER,
          FileType.CONTROL, FileType.LONG, FileType.STRING, FileType.ASCII, FileType.BCD,
          FileType.PID, FileType.MESSAGE)
_FIRST_OF_ANY_TYPE = 3
_SLOTS_TRIED = 8  # slot 0 is the processor's own
_MOST_ELEMENTS = 256


@dataclass(frozen=True, slots=True)
class Directory:
    """
    The place and form of a processor's list of files.

    ``own_row`` is the byte at which the first row begins, which is about the list itself. Recorded
    commands count the words as elements (``is_short``), or as sub-elements of element 0.
    """

    type_code: int
    own_row: int
    is_short: bool = False

    def request(self, at: int, size: int) -> slc.LogicalRead:
        """Return the read of ``size`` bytes from byte ``at`` on."""
        place = (at // 2, None) if self.is_short else (0, at // 2)
        return slc.LogicalRead(slc.LogicalAddress(0, self.type_code, *place), size)


SLC_DIRECTORY = Directory(0x01, 69, is_short=True)
_MICROLOGIX = Directory(0x02, 103)
_DIRECTORIES = {
    Processor.SLC_5_03: SLC_DIRECTORY, Processor.SLC_5_04: SLC_DIRECTORY,
    Processor.SLC_5_05: SLC_DIRECTORY, Processor.ML1100: _MICROLOGIX,
    Processor.ML1200: _MICROLOGIX, Processor.ML1500: _MICROLOGIX,
    Processor.ML1400: Directory(0x03, 103)}


def list_codes(processor: Processor | None) -> tuple[int, ...]:
    """
    Return the types that file 0 of a processor may have as its file directory.

    The type of a MicroLogix 1400 is left out where the processor is not known: that file has the
    passwords, too (CVE-2017-14466).
    """
    if processor is None:
        return SLC_DIRECTORY.type_code, _MICROLOGIX.type_code
    layout = _DIRECTORIES.get(processor)
    return () if layout is None else (layout.type_code,)


class SlcFileSearch:
    """Search in the file directory if the processor is known to have one, else by reads."""

    def directory(self, processor: Processor | None) -> Steps[list[DataFile]] | None:
        layout = _DIRECTORIES.get(processor) if processor else None
        return None if layout is None else _read(layout)

    def look_for(self, number: int) -> Steps[DataFile | None]:
        dialect, usual = SlcDialect(), _USUAL.get(number)
        candidates = [usual] if usual else []
        if number >= _FIRST_OF_ANY_TYPE:
            candidates += [kind for kind in _TYPES if kind is not usual]
        for kind in candidates:
            for element in range(_SLOTS_TRIED if kind.is_io else 1):
                place = Address(ADDRESSING, kind, number, element)
                if (yield from is_there(place, dialect)):
                    if kind.is_io:
                        return DataFile(kind, number, 0)
                    return (yield from counted(ADDRESSING, dialect, kind, number, _MOST_ELEMENTS))
        return None


def _read(layout: Directory) -> Steps[list[DataFile]]:
    data, size = b'', layout.own_row + _ROW
    while len(data) < size:
        count = min(_PACKET, size - len(data)) if len(data) > layout.own_row + 2 else _PACKET
        request = layout.request(len(data), count + count % 2)
        part = check_status((yield slc.CMD, request.encode()))
        if len(part) != request.size:
            raise FormatError(f'a part of the file directory has {len(part)} bytes, asked were '
                              f'{request.size}')
        data += part
        if len(data) > layout.own_row + 2:
            size = _length(data, layout.own_row)
            if data[layout.own_row] != layout.type_code or not layout.own_row < size <= _MOST:
                raise FormatError('the file directory is not built as known')
    return [*_data_files(data, layout)]


def _data_files(data: bytes, layout: Directory) -> Iterator[DataFile]:
    number = None
    for at in range(layout.own_row, len(data) - 2, _ROW):
        code, size = data[at], _length(data, at)
        kind = slc.BY_FLAT_CODE.get(code) or BY_CODE.get(code)
        if number is None and kind is FileType.OUTPUT:
            number = 0
        if number is None:
            continue
        if kind is not None and size:
            elements = size // (2 * FILES[kind].words)
            default = kind.default_file if kind.is_function else number
            yield DataFile(kind, number if default is None else default, elements)
        if code < _FORCES:
            number += 1


def _length(data: bytes, row: int) -> int:
    return int.from_bytes(data[row + 1:row + 3], 'little')


def directory_of(table: DataTable) -> bytes:
    """Return the file directory of an emulated SLC 5/03."""
    sizes: dict[int, tuple[FileType, int]] = {}
    for area in table:
        if area.file_type.is_function:
            continue  # an SLC 5/03 has none
        _, size = sizes.get(area.file, (area.file_type, 0))
        sizes[area.file] = area.file_type, size + 2 * table.length(area)
    rows = b''
    for number in range(max(sizes, default=-1) + 1):
        kind, size = sizes.get(number, (_USUAL[number] if number < 2 else None, 0))
        code = _RESERVED if kind is None else slc.FLAT_CODES.get(kind, FILES[kind].code)
        rows += bytes((code,)) + word(size).ljust(_ROW - 1, b'\0')
    layout = SLC_DIRECTORY
    total = layout.own_row + _ROW + len(rows)
    own = bytes((layout.type_code,)) + word(total).ljust(_ROW - 1, b'\0')
    return bytes(layout.own_row) + own + rows + b'\0'
