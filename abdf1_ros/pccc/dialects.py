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
How each PLC family reads and writes words of its data table.

A dialect turns an address and a number of words into the bytes behind TNS, and a reply's data
back into words. Data are words in the order of ``Address.offset``, each low byte first.
"""

from __future__ import annotations

from typing import Protocol

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc import plc5, slc, typed_data
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.fields import word
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.typed_data import TypedData


class Dialect(Protocol):
    """What the driver needs of a family."""

    cmd: int

    def max_read(self, file_type: FileType) -> int:
        """Return the most words that one read of such a file brings, whole elements."""

    def max_write(self, file_type: FileType) -> int:
        """Return the most words that one write to such a file takes, whole elements."""

    def read(self, address: Address, words: int) -> bytes:
        """
        Return FNC and parameters of a read of ``words`` words.

        More than one word of a structure file has to be whole elements.
        """

    def reply_size(self, address: Address, words: int) -> int:
        """Return the bytes behind the header of the reply to that read."""

    def read_data(self, address: Address, words: int, data: bytes) -> bytes:
        """Return the words in the reply to that read; FormatError when they are not there."""

    def write(self, address: Address, data: bytes) -> bytes:
        """Return FNC and parameters of a write of whole words."""

    def write_bits(self, address: Address, mask: int, bits: int) -> bytes:
        """Return FNC and parameters that change the bits of ``mask`` in one word to ``bits``."""


class Plc5Dialect:
    """Typed read and write, read-modify-write for bits."""

    cmd = plc5.CMD

    def max_read(self, file_type: FileType) -> int:
        """Return the most words per read."""
        layout = file_type.layout
        wire_words = layout.plc5_words or layout.words
        return plc5.MAX_DATA // 2 // wire_words * layout.words

    def max_write(self, file_type: FileType) -> int:
        """Return the most words per write."""
        return self.max_read(file_type)

    def read(self, address: Address, words: int) -> bytes:
        """Return a typed read; one word of a structure is read as an integer (M 13-12)."""
        count = self._count(address, words)
        return plc5.TypedRead(self._address(address, words), count, 0, count).encode()

    def reply_size(self, address: Address, words: int) -> int:
        """Return descriptors and elements of the reply's array."""
        layout = address.file_type.layout
        size = 2 if words == 1 else 2 * (layout.plc5_words or layout.words)
        elements = bytes(size * self._count(address, words))
        return len(TypedData(layout.plc5_id or 0, size, elements).encode())

    def read_data(self, address: Address, words: int, data: bytes) -> bytes:
        """Check type and length of a typed read's reply and return its words."""
        typed = TypedData.decode(data)
        if (typed.type_id == typed_data.FLOAT) is not (address.file_type is FileType.FLOAT):
            raise FormatError(f'the reply holds type {typed.type_id}, '
                              f'not {address.file_type.value} elements')
        asked = self._count(address, words)
        size = words * 2 // asked
        if typed.element_size < size and len(typed.data) == words * 2:
            return typed.data  # bytes or characters: the same words in smaller elements
        layout = address.file_type.layout
        if typed.count != asked or typed.element_size not in (
                size, 2 * (layout.plc5_words or layout.words)):
            raise FormatError(f'the reply holds {typed.count} elements of '
                              f'{typed.element_size} bytes, asked were {asked} of {size}')
        if typed.element_size == size:
            return typed.data
        # Timers carry two internal words behind the three that have names.
        step = typed.element_size
        return b''.join(typed.data[at:at + size] for at in range(0, len(typed.data), step))

    def write(self, address: Address, data: bytes) -> bytes:
        """Return a typed write."""
        count = self._count(address, len(data) // 2)
        size = len(data) // count
        type_id = typed_data.INTEGER if size == 2 else address.file_type.layout.plc5_id
        if type_id is None:
            raise FormatError(f'a PLC-5 has no {address.file_type.value} files')
        values = TypedData(type_id, size, data)
        system_address = self._address(address, len(data) // 2)
        return plc5.TypedWrite(system_address, values, 0, count).encode()

    def write_bits(self, address: Address, mask: int, bits: int) -> bytes:
        """Return a read-modify-write of one word."""
        change = plc5.BitSet(self._address(address, 1), ~mask & 0xFFFF, bits & mask)
        return plc5.ReadModifyWrite((change,)).encode()

    @staticmethod
    def _address(address: Address, words: int) -> plc5.SystemAddress:
        one_word_of_many = words == 1 and address.file_type.is_structure
        sub_element = address.word if one_word_of_many else None
        return plc5.SystemAddress(address.file, address.element, sub_element)

    @staticmethod
    def _count(address: Address, words: int) -> int:
        """Return the number of elements, as typed commands count them."""
        if words == 1:
            return 1
        return words // address.file_type.layout.words


class SlcDialect:
    """Protected typed logical read, write and masked write with three address fields."""

    cmd = slc.CMD

    def max_read(self, file_type: FileType) -> int:
        """Return the most words per read."""
        words = file_type.layout.words
        return slc.MAX_READ // 2 // words * words

    def max_write(self, file_type: FileType) -> int:
        """Return the most words per write."""
        words = file_type.layout.words
        return slc.MAX_WRITE // 2 // words * words

    def read(self, address: Address, words: int) -> bytes:
        """Return a protected typed logical read."""
        return slc.LogicalRead(self._address(address), words * 2).encode()

    def reply_size(self, address: Address, words: int) -> int:
        """Return the bytes asked for."""
        return words * 2

    def read_data(self, address: Address, words: int, data: bytes) -> bytes:
        """Check the length of the reply and return it."""
        if len(data) != words * 2:
            raise FormatError(f'the reply holds {len(data)} bytes, asked were {words * 2}')
        return data

    def write(self, address: Address, data: bytes) -> bytes:
        """Return a protected typed logical write."""
        return slc.LogicalWrite(self._address(address), data).encode()

    def write_bits(self, address: Address, mask: int, bits: int) -> bytes:
        """Return a masked write of one word."""
        return slc.MaskedWrite(self._address(address), mask, word(bits & mask)).encode()

    @staticmethod
    def _address(address: Address) -> slc.LogicalAddress:
        code = address.file_type.layout.slc_code
        assert code is not None  # Address.parse lets no other type through
        return slc.LogicalAddress(address.file, code, address.element, address.word)


DIALECTS: dict[PlcType, Dialect] = {PlcType.PLC5: Plc5Dialect(), PlcType.SLC: SlcDialect()}
