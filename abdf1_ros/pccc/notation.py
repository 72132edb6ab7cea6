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

"""Addresses and values of commands, written as a controls engineer writes them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
import struct
from typing import Any

from abdf1_ros.pccc import typed_data
from abdf1_ros.pccc.address import Address, Addressing
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.plc2.address import show_word
from abdf1_ros.pccc.plc3 import commands as plc3
from abdf1_ros.pccc.plc3.address import ADDRESSING as PLC3
from abdf1_ros.pccc.plc3.address import BY_SECTION
from abdf1_ros.pccc.plc5 import commands as plc5
from abdf1_ros.pccc.plc5.address import ADDRESSING as PLC5
from abdf1_ros.pccc.slc import commands as slc
from abdf1_ros.pccc.slc.address import ADDRESSING as SLC
from abdf1_ros.pccc.slc.files import BY_CODE
from abdf1_ros.pccc.typed_data import TypedData
from abdf1_ros.text import value_text

_BY_PLC5_FILE = {
    kind.default_file: kind for kind in FileType
    if kind in PLC5.files and kind.default_file is not None}
# Types that a typed command names, with their size; 4 may be N, B, S, I or O (M 7-29).
_INTEGERS = (FileType.INTEGER, FileType.BINARY, FileType.STATUS, FileType.INPUT, FileType.OUTPUT)
_BY_PLC5_TYPE = {
    (element.type_id, element.wire_size // element.parts): kind
    for kind in PLC5.files if kind not in _INTEGERS
    for element in (plc5.element_of(Address(PLC5, kind, 0, 0), is_value=False),)}


def count_of(number: int, name: str) -> str:
    """Return e.g. "1 word" or "2 words"."""
    return f'{number} {name}' if number == 1 else f'{number} {name}s'


def part_of(offset: int, size: int, total: int) -> str:
    """Return where in a transaction of several packets this is, or nothing if it is all."""
    return '' if (offset, size) == (0, total) else f' (from {offset} of {total})'


def hexadecimal(data: bytes) -> str:
    """Return bytes as they stand on the line."""
    return data.hex(' ').upper()


def system_address(address: plc5.SystemAddress, values: TypedData | None = None) -> str:
    """
    Return a PLC-5 address.

    The type of a file above 8 is not in its address; where ``values`` do not tell it either,
    the file has its number only.
    """
    kind = _BY_PLC5_FILE.get(address.file)
    if kind is None and values is not None:
        kind = _BY_PLC5_TYPE.get((values.type_id, values.element_size))
    if kind is not None:
        return _place(PLC5, kind, address.file, address.element, address.sub_element or 0)
    text = f'file {address.file}:{address.element}'
    return text if address.sub_element is None else f'{text}.{address.sub_element}'


def extended_address(address: plc3.ExtendedAddress) -> str:
    """Return a PLC-3 address, by its levels where its section has no letter (M 13-5)."""
    kind = BY_SECTION.get(address.section)
    if kind is not None and not kind.is_structure and not address.structure:
        return str(Address(PLC3, kind, address.file, address.word))
    if kind is not None and kind.is_structure and address.word < 3:
        return str(Address(PLC3, kind, address.file, address.structure, address.word))
    return (f'E{plc3.DATA_TABLE}.{plc3.CONTEXT}.{address.section}.{address.file}.'
            f'{address.structure}.{address.word}')


def byte_address(address: int) -> str:
    """Return the octal word of a PLC-2 address, which an SLC may take for a word's number."""
    return f'{show_word(address // 2)} (ADDR {address})'


def logical_address(address: slc.LogicalAddress) -> str:
    """Return an SLC address, by its fields where its type is not known."""
    kind, word = BY_CODE.get(address.type_code), address.sub_element or 0
    if kind is not None:
        return _place(SLC, kind, address.file, address.element, word)
    text = f'file {address.file} type {address.type_code:02X} element {address.element}'
    return text + _beyond(word)


def logical_size(address: slc.LogicalAddress, size: int) -> str:
    """Return ``size`` bytes as elements where they are whole ones, as words, or as bytes."""
    kind = BY_CODE.get(address.type_code)
    words = SLC.files[kind].words if kind else 1
    if words > 1 and size and size % (2 * words) == 0 and not address.sub_element:
        return count_of(size // 2 // words, 'element')
    return count_of(size, 'byte') if size % 2 else count_of(size // 2, 'word')


def _place(addressing: Addressing, kind: FileType, file: int, element: int, word: int) -> str:
    """Return an address; a word that its element does not have is counted from there on."""
    start = Address(addressing, kind, file, element)
    is_inside = kind.is_structure and word < start.layout.words
    beyond = 0 if addressing.slot_of(start) is not None or is_inside else word
    return str(replace(start, word=word - beyond)) + _beyond(beyond)


def _beyond(words: int) -> str:
    return f' + {count_of(words, "word")}' if words else ''


def words_text(data: bytes) -> str:
    """Return words as hexadecimal numbers, their high byte first."""
    return hexadecimal(data) if len(data) % 2 else ' '.join(
        f'{value:04X}' for value in _unpack('H', data))


def _integers(data: bytes) -> str:
    return hexadecimal(data) if len(data) % 2 else ' '.join(map(str, _unpack('h', data)))


def _longs(data: bytes) -> str:
    return hexadecimal(data) if len(data) % 4 else ' '.join(map(str, _unpack('i', data)))


def _floats(data: bytes) -> str:
    return hexadecimal(data) if len(data) % 4 else ' '.join(
        map(value_text, _unpack('f', data)))


def _unpack(code: str, data: bytes) -> tuple[Any, ...]:
    return struct.unpack(f'<{len(data) // struct.calcsize(code)}{code}', data)


# Types whose values are numbers; all others are shown as words.
_NUMBERS: dict[FileType, Callable[[bytes], str]] = {
    FileType.INTEGER: _integers, FileType.TIMER: _integers, FileType.COUNTER: _integers,
    FileType.CONTROL: _integers, FileType.LONG: _longs, FileType.FLOAT: _floats}


def logical_values(address: slc.LogicalAddress, data: bytes) -> str:
    """Return the data of an SLC command or reply as its file type says."""
    kind = BY_CODE.get(address.type_code)
    if kind is None or kind.is_structure and not address.sub_element:
        return words_text(data)  # a structure begins with a word of flags
    return _NUMBERS.get(kind, words_text)(data)


def typed_values(address: plc5.SystemAddress, values: TypedData) -> str:
    """Return the elements of a PLC-5 typed command or reply as their type says."""
    if values.type_id == typed_data.FLOAT and values.element_size == 4:
        return _floats(values.data)
    kind = _BY_PLC5_FILE.get(address.file)
    if values.type_id == typed_data.INTEGER and values.element_size == 2 and (
            kind is None or kind in _NUMBERS):
        return _integers(values.data)
    return words_text(values.data)
