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

"""What a PLC-3 or PLC-5 answers to word range commands, file reads and bit writes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Generic, TypeVar

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable, OutOfRange
from abdf1_ros.pccc.family import Codes, Commands, Refusal
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.line_order import word_on_line
from abdf1_ros.pccc.word_range import commands as word_range
from abdf1_ros.pccc.word_range.commands import (
    WireAddress,
    WordBitWrite,
    WordRangeRead,
    WordRangeWrite,
)

_Place = TypeVar('_Place', bound=WireAddress)


@dataclass(frozen=True, slots=True)
class WordRangeService(Generic[_Place]):
    """
    Execute word range commands on ``table``.

    ``read_address`` takes an address off a command, ``find`` says where it is. ``bad_size`` is
    the answer to sizes, offsets and totals that do not fit each other, ``too_long`` the one to
    a transaction that ends behind the file.
    """

    table: DataTable
    read_address: Callable[[Reader], _Place]
    find: Callable[[_Place], Address]
    bad_size: Codes
    too_long: Codes

    def commands(self) -> Commands:
        """Return the functions by CMD and FNC."""
        return {
            (word_range.CMD, word_range.READ): self.read,
            (word_range.CMD, word_range.WRITE): self._write,
            (word_range.CMD, word_range.BIT_WRITE): self._write_bits,
        }

    def read(self, reader: Reader) -> bytes:
        """Execute a word range read, or a file read, which looks the same."""
        request = WordRangeRead.read(reader, self.read_address)
        if request.size > word_range.MAX_READ:
            raise Refusal(*self.bad_size)
        words = self._words(self.find(request.address), request.offset, request.size,
                            request.total)
        return b''.join(self.table.read(word, 1) for word in words)

    def _write(self, reader: Reader) -> bytes:
        request = WordRangeWrite.read(reader, self.read_address)
        if len(request.address.encode()) + len(request.data) > word_range.MAX_WRITE:
            raise Refusal(*self.bad_size)
        words = self._words(self.find(request.address), request.offset, len(request.data),
                            request.total)
        for number, word in enumerate(words):
            self.table.write(word, request.data[2 * number:2 * number + 2])
        return b''

    def _write_bits(self, reader: Reader) -> bytes:
        request = WordBitWrite.read(reader, self.read_address)
        place = word_on_line(self.find(request.address))
        self.table.write_bits(place, request.set | request.reset, request.set)
        return b''

    def _words(self, start: Address, offset: int, size: int, total: int) -> Iterator[Address]:
        """Return the words of one packet, after a look at all of the transaction."""
        if size == 0 or size % 2 or offset + size // 2 > total:
            raise Refusal(*self.bad_size)
        try:
            self.table.find(start, total)
        except OutOfRange:
            raise Refusal(*self.too_long) from None
        first = start.offset + offset
        return (word_on_line(start.at_offset(first + n)) for n in range(size // 2))
