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

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.dialect import Dialect, exactly, Request, Transfer, whole_elements
from abdf1_ros.pccc.file_types import FileType, Layout
from abdf1_ros.pccc.word_range import commands as word_range
from abdf1_ros.pccc.word_range.commands import (
    in_line_order,
    WireAddress,
    WordRangeRead,
    WordRangeWrite,
)


@dataclass(frozen=True, slots=True, eq=False)
class WordRangeDialect(Dialect):
    """
    Word range read and write; each packet of a transfer contains its offset.

    A structure is moved as the words that the PLC stores; a float is sent high word first (M
    13-17). The families differ in ``files``, ``address_size`` (bytes of the longest address), the
    form of an address in a command, and the bit write. The bit write has FNC and parameters for a
    word and the bits to set and to reset.
    """

    files: Mapping[FileType, Layout]
    address_size: int
    to_line: Callable[[Address], WireAddress]
    bit_write: Callable[[Address, int, int], bytes]

    def max_read(self, file_type: FileType) -> int:
        return whole_elements(self.files[file_type], word_range.MAX_READ)

    def max_write(self, file_type: FileType) -> int:
        return whole_elements(
            self.files[file_type], word_range.MAX_WRITE - self.address_size)

    def read(self, address: Address, words: int, transfer: Transfer | None = None) -> Request:
        whole = transfer or Transfer(address, words)
        return word_range.CMD, WordRangeRead(
            self.to_line(whole.start), 2 * words, address.offset - whole.start.offset,
            whole.words).encode()

    def read_data(self, address: Address, words: int, data: bytes) -> bytes:
        """Check the length of the reply and return its words."""
        return in_line_order(address, exactly(words, data))

    def write(self, address: Address, data: bytes, transfer: Transfer | None = None) -> Request:
        whole = transfer or Transfer(address, len(data) // 2)
        return word_range.CMD, WordRangeWrite(
            self.to_line(whole.start), in_line_order(address, data),
            address.offset - whole.start.offset, whole.words).encode()

    def write_bits(self, address: Address, mask: int, bits: int) -> Request:
        """Return a request that changes bits of one word."""
        return word_range.CMD, self.bit_write(address, bits & mask, ~bits & mask)
