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
Which data files a processor has, and how long they are, found by reading alone.

An element is there if a read of it succeeds. A PLC-5 says in its reply what the elements are; an
SLC is asked for every type that a file may have, because a read has to name it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from abdf1_ros.cli.plc.session import Session
from abdf1_ros.errors import FormatError, RemoteError
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.families import dialect_of, family_of, file_types_of, layout_of
from abdf1_ros.pccc.file_types import DEFAULT_FILES, FileType, PlcType
from abdf1_ros.pccc.status import check_status
from abdf1_ros.pccc.steps import Steps
from abdf1_ros.pccc.typed_data import BYTE_STRING, TypedData

_USUAL = {number: kind for kind, number in DEFAULT_FILES.items()}

# Types of user files of an SLC, the frequent ones first. The first three files have one type.
_SLC_TYPES = (FileType.INTEGER, FileType.BINARY, FileType.FLOAT, FileType.TIMER,
              FileType.COUNTER, FileType.CONTROL, FileType.LONG, FileType.STRING,
              FileType.ASCII, FileType.BCD)
_FIRST_OF_ANY_TYPE = 3

# Slots of an SLC that are tried for inputs and outputs: slot 0 is the processor's own.
_SLOTS_TRIED = 8

# Period of the proposed rows (ms): reading all files of a PLC is a lot for a slow line.
_DRAFT_PERIOD = 5000

_MOST_ELEMENTS = {PlcType.PLC5: 1000, PlcType.SLC: 256}
FAMILIES = tuple(_MOST_ELEMENTS)
"""Whose files can be found."""


@dataclass(frozen=True, slots=True)
class DataFile:
    """
    A file with its elements.

    The number is 0 for the images of inputs and outputs, which are addressed by rack or slot and
    cannot be counted.
    """

    type: FileType  # noqa: A003
    number: int
    elements: int

    def __str__(self) -> str:
        """Return type and number as in an address."""
        return f'{self.type.value}{self.number}'


def find_files(session: Session, station: int, plc_type: PlcType, numbers: Sequence[int],
               show: Callable[[str], None] = lambda text: None) -> Iterator[DataFile]:
    """
    Yield the files among ``numbers``; ``show`` gets a text about the file being asked for.

    Raises LinkError where the station does not answer any more.
    """
    for number in numbers:
        show(f'file {number}')
        kind = _type_of(session, station, plc_type, number)
        if kind is None:
            continue
        elements = 0 if kind.is_io else _count(session, station, plc_type, kind, number)
        yield DataFile(kind, number, elements)


def _type_of(session: Session, station: int, plc_type: PlcType, number: int) -> FileType | None:
    """Return the type of a file, None where there is none of a type that we can read."""
    if plc_type == PlcType.PLC5:
        return _type_by_reply(session, station, number)
    addressing = family_of(plc_type).addressing
    usual = _USUAL.get(number)
    candidates = [usual] if usual else []
    if number >= _FIRST_OF_ANY_TYPE:
        candidates += [kind for kind in _SLC_TYPES if kind is not usual]
    return next((kind for kind in candidates if any(
        _is_there(session, station, Address(addressing, kind, number, element))
        for element in range(_SLOTS_TRIED if kind.is_io else 1))), None)


def _type_by_reply(session: Session, station: int, number: int) -> FileType | None:
    """Return the type that a PLC-5 tells; words of N, B, O, I and S files are all integers."""
    try:
        data = session.ask(station, _first_element(number))
    except (RemoteError, FormatError):
        return None
    usual = _USUAL.get(number, FileType.INTEGER)
    if data.type_id == layout_of(usual, PlcType.PLC5).code:
        return usual
    if data.type_id == BYTE_STRING:
        return FileType.ASCII if data.element_size == 1 else FileType.STRING
    return next((kind for kind in file_types_of(PlcType.PLC5)
                 if layout_of(kind, PlcType.PLC5).code == data.type_id), None)


def _first_element(number: int) -> Steps[TypedData]:
    address = Address(family_of(PlcType.PLC5).addressing, FileType.INTEGER, number, 0)
    reply = yield dialect_of(PlcType.PLC5).read(address, 1)
    return TypedData.decode(check_status(reply))


def _element(address: Address) -> Steps[bytes]:
    dialect, words = dialect_of(address.plc_type), address.layout.words
    reply = yield dialect.read(address, words)
    return dialect.read_data(address, words, check_status(reply))


def _is_there(session: Session, station: int, address: Address) -> bool:
    try:
        session.ask(station, _element(address))
    except (RemoteError, FormatError):
        return False
    return True


def _count(session: Session, station: int, plc_type: PlcType, kind: FileType,
           number: int) -> int:
    """Return how many elements a file has, by halving: the first of them is there."""
    addressing = family_of(plc_type).addressing
    low, high = 1, _MOST_ELEMENTS[plc_type]
    while low < high:
        middle = (low + high + 1) // 2
        if _is_there(session, station, Address(addressing, kind, number, middle - 1)):
            low = middle
        else:
            high = middle - 1
    return low


def map_rows(found: Sequence[DataFile], station: int, plc_type: PlcType,
             processor: str, via: int | None = None) -> Iterator[str]:
    """Yield a row of a map CSV for each file, as long as one packet; others are comments."""
    for entry in found:
        kind = entry.type
        if kind.is_io:
            yield (f'# {entry}: inputs and outputs are addressed by '
                   f'{"rack and group" if plc_type == PlcType.PLC5 else "slot"}')
            continue
        per_element = layout_of(kind, plc_type).words
        packet = dialect_of(plc_type).max_read(kind)
        length = 1 if kind is FileType.STRING else min(
            entry.elements * per_element, packet // per_element * per_element)
        # Words of a structure are counted as words, other elements as such.
        if not kind.is_structure:
            length = max(1, length // per_element)
        if length < entry.elements and not kind.is_structure and kind is not FileType.STRING:
            yield (f'# {entry} has {entry.elements} elements; a row of one packet has {length} of '
                   'them')
        number = '' if kind is FileType.STATUS else entry.number
        yield (f'{kind.value.lower()}{entry.number},Read,{kind.value}{number}:0,{station},'
               f'{plc_type.value},{processor},{length},{_DRAFT_PERIOD}'
               f'{"" if via is None else f",{via}"}')
