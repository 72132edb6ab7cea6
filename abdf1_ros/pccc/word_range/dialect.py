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

"""How words of a PLC-3, or a PLC-5 without typed commands, are read and written."""

from __future__ import annotations

from typing import Protocol

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.dialect import exactly, Request, Transfer
from abdf1_ros.pccc.file_types import FileType, layout_of, PlcType
from abdf1_ros.pccc.line_order import in_line_order
from abdf1_ros.pccc.plc3.address import SECTIONS
from abdf1_ros.pccc.plc3.commands import ExtendedAddress
from abdf1_ros.pccc.plc5 import commands as plc5
from abdf1_ros.pccc.plc5.commands import SystemAddress
from abdf1_ros.pccc.word_range import commands as word_range
from abdf1_ros.pccc.word_range.commands import (
    WireAddress,
    WordBitWrite,
    WordRangeRead,
    WordRangeWrite,
)


class _Family(Protocol):
    """What differs: the address, and how bits are changed."""

    plc_type: PlcType
    address_size: int

    def address(self, address: Address) -> WireAddress:
        """Return the address as it stands in a command."""

    def write_bits(self, address: Address, set_bits: int, reset_bits: int) -> bytes:
        """Return FNC and parameters."""


class WordRangeDialect:
    """
    Word range read and write; several packets of one transfer carry their offset in it.

    Structures are the words they are stored as, floats travel high word first (M 13-17).
    """

    writes_bits = True

    def __init__(self, family: _Family) -> None:
        self._family = family

    def max_read(self, file_type: FileType) -> int:
        """Return the most words per read."""
        words = layout_of(file_type, self._family.plc_type).words
        return word_range.MAX_READ // 2 // words * words

    sure_read = max_read

    def max_write(self, file_type: FileType) -> int:
        """Return the most words per write."""
        words = layout_of(file_type, self._family.plc_type).words
        return (word_range.MAX_WRITE - self._family.address_size) // 2 // words * words

    def read(self, address: Address, words: int, transfer: Transfer | None = None) -> Request:
        """Return a word range read."""
        whole = transfer or Transfer(address, words)
        return word_range.CMD, WordRangeRead(
            self._family.address(whole.start), 2 * words, address.offset - whole.start.offset,
            whole.words).encode()

    def reply_size(self, address: Address, words: int) -> int:
        """Return the bytes asked for."""
        return words * 2

    def read_data(self, address: Address, words: int, data: bytes) -> bytes:
        """Check the length of the reply and return its words."""
        return in_line_order(address, exactly(words, data))

    def write(self, address: Address, data: bytes, transfer: Transfer | None = None) -> Request:
        """Return a word range write."""
        whole = transfer or Transfer(address, len(data) // 2)
        return word_range.CMD, WordRangeWrite(
            self._family.address(whole.start), in_line_order(address, data),
            address.offset - whole.start.offset, whole.words).encode()

    def write_bits(self, address: Address, mask: int, bits: int) -> Request:
        """Return what changes the bits of one word."""
        return word_range.CMD, self._family.write_bits(address, bits & mask, ~bits & mask)


class _Plc5:
    """Read-modify-write for bits, as with typed commands."""

    plc_type = PlcType.PLC5
    # Mask, file and element in three bytes each, sub-element (M 13-10..13-12).
    address_size = 8

    def address(self, address: Address) -> SystemAddress:
        """Return the system address."""
        return SystemAddress(address.file, address.element, address.word or None)

    def write_bits(self, address: Address, set_bits: int, reset_bits: int) -> bytes:
        """Return a read-modify-write."""
        change = plc5.BitSet(self.address(address), ~(set_bits | reset_bits) & 0xFFFF, set_bits)
        return plc5.ReadModifyWrite((change,)).encode()


class _Plc3:
    """The extended address and the bit write."""

    plc_type = PlcType.PLC3
    # Flag and section, three bytes each for file, structure and word (M 13-5..13-8).
    address_size = 11

    def address(self, address: Address) -> ExtendedAddress:
        """Return the extended address."""
        section = SECTIONS[address.file_type]
        if address.file_type.is_structure:
            return ExtendedAddress(section, address.file, address.element, address.word)
        return ExtendedAddress(section, address.file, 0, address.element)

    def write_bits(self, address: Address, set_bits: int, reset_bits: int) -> bytes:
        """Return a bit write."""
        return WordBitWrite(self.address(address), set_bits, reset_bits).encode()


PLC5_WORD_RANGE = WordRangeDialect(_Plc5())
PLC3 = WordRangeDialect(_Plc3())
