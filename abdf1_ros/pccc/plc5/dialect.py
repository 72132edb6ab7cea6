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

"""How words of a PLC-5 are read and written with its typed commands."""

from __future__ import annotations

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc import typed_data
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.dialect import Dialect, Request, Transfer
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.plc5 import commands as plc5
from abdf1_ros.pccc.plc5.address import FILES
from abdf1_ros.pccc.typed_data import TypedData
from abdf1_ros.pccc.word_range.dialect import WordRangeDialect


class Plc5Dialect(Dialect):
    """
    Typed read and write, read-modify-write for bits.

    One value of a structure, a word or a float32, is moved by itself (M 13-12); all larger
    requests are whole elements.
    """

    def max_read(self, file_type: FileType) -> int:
        return _most_words(file_type, plc5.MAX_REPLY)

    def max_write(self, file_type: FileType) -> int:
        return _most_words(file_type, plc5.MAX_WRITE - plc5.MAX_ELEMENT_ADDRESS)

    def read(self, address: Address, words: int, transfer: Transfer | None = None) -> Request:
        count = 2 * words // _element(address, words).size
        return plc5.CMD, plc5.TypedRead(_system_address(address, words), count, 0, count).encode()

    def reply_size(self, address: Address, words: int) -> int:
        """Return the number of bytes of the reply's array, with its descriptors."""
        element = _element(address, words)
        data = bytes(2 * words // element.size * element.wire_size)
        return len(element.typed(data).encode())

    def read_data(self, address: Address, words: int, data: bytes) -> bytes:
        """Check type and length of a typed read's reply and return its words."""
        typed = TypedData.decode(data)
        element = _element(address, words)
        if (typed.type_id == typed_data.FLOAT) is not (element.type_id == typed_data.FLOAT):
            raise FormatError(
                f'file {address.file} of this PLC holds floats: write F{address.file}:'
                f'{address.element}' if typed.type_id == typed_data.FLOAT else
                f'file {address.file} of this PLC holds no floats (type {typed.type_id}), so '
                f'{address} is not there; "plc files" lists the files')
        if typed.element_size < element.size and len(typed.data) == words * 2:
            return typed.data  # bytes or characters: the same words in smaller elements
        size = element.size
        asked = 2 * words // size
        if typed.count != asked or typed.element_size not in (size, element.wire_size):
            raise FormatError(f'the reply holds {typed.count} elements of '
                              f'{typed.element_size} bytes, asked were {asked} of {size}')
        if typed.element_size == size:
            return typed.data
        # A timer in a reply has two internal words after its three named words.
        step = typed.element_size
        return b''.join(typed.data[at:at + size] for at in range(0, len(typed.data), step))

    def write(self, address: Address, data: bytes, transfer: Transfer | None = None) -> Request:
        words = len(data) // 2
        element = _element(address, words)
        values = element.typed(data)
        return plc5.CMD, plc5.TypedWrite(
            _system_address(address, words), values, 0, values.count).encode()

    def write_bits(self, address: Address, mask: int, bits: int) -> Request:
        """Return a read-modify-write of one word."""
        change = plc5.BitSet(_system_address(address, 1), ~mask & 0xFFFF, bits & mask)
        return plc5.CMD, plc5.ReadModifyWrite((change,)).encode()


def _system_address(address: Address, words: int) -> plc5.SystemAddress:
    sub_element = address.word if address.is_value(words) else None
    return plc5.SystemAddress(address.file, address.element, sub_element)


def _element(address: Address, words: int) -> plc5.Element:
    """Return the unit in which ``words`` words at an address are counted."""
    return plc5.element_of(address, address.is_value(words))


def _most_words(file_type: FileType, room: int) -> int:
    """Return the words of as many whole elements as fit into ``room`` with their descriptors."""
    layout = FILES[file_type]
    size = 2 * layout.wire_words
    # an array so long that its size needs a byte of its own, as in the largest packet
    some = bytes(8 * size)
    descriptors = len(TypedData(layout.code, size, some).encode()) - len(some)
    count = (room - descriptors) // size
    return min(count, plc5.MAX_INTEGERS) * layout.words


def _range_address(address: Address) -> plc5.SystemAddress:
    return plc5.SystemAddress(address.file, address.element, address.word or None)


def _bit_write(address: Address, set_bits: int, reset_bits: int) -> bytes:
    change = plc5.BitSet(_range_address(address), ~(set_bits | reset_bits) & 0xFFFF, set_bits)
    return plc5.ReadModifyWrite((change,)).encode()


PLC5_TYPED = Plc5Dialect()
# Mask, file and element in three bytes each, sub-element (M 13-10..13-12).
PLC5_WORD_RANGE = WordRangeDialect(FILES, 8, _range_address, _bit_write)
