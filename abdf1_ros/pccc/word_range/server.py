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

"""The answers of a PLC-3 or PLC-5 to word range commands, file reads and bit writes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable, OutOfRange
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.serving import Codes, Commands, Refusal
from abdf1_ros.pccc.word_range import commands as word_range
from abdf1_ros.pccc.word_range.commands import (
    WireAddress,
    word_on_line,
    WordBitWrite,
    WordRangeRead,
    WordRangeWrite,
)

_Place = TypeVar('_Place', bound=WireAddress)


@dataclass(frozen=True, slots=True)
class RangeCodes:
    """
    The answers of a family to word range commands that cannot be executed.

    - ``bad_size``: sizes, offsets and totals that do not fit each other.
    - ``missing``: a first word that does not exist.
    - The remaining codes: a transaction that ends after its file.
    """

    bad_size: Codes
    missing: Codes
    read_past_end: Codes
    write_past_end: Codes


@dataclass(frozen=True, slots=True)
class WordRangeService(Generic[_Place]):
    """
    Execute word range commands on ``table``.

    ``read_address`` reads the address in a command, ``find`` returns its place in the table. With
    ``takes_padding`` zeros may follow a command.
    """

    table: DataTable
    read_address: Callable[[Reader], _Place]
    find: Callable[[_Place], Address]
    codes: RangeCodes
    takes_padding: bool = True

    def commands(self) -> Commands:
        """Return the functions by CMD and FNC."""
        return {
            (word_range.CMD, word_range.READ): self.read,
            (word_range.CMD, word_range.WRITE): self._write,
            (word_range.CMD, word_range.BIT_WRITE): self._write_bits,
        }

    def read(self, reader: Reader) -> bytes:
        """Execute a word range read, or a file read, which looks the same."""
        reader.takes_padding = self.takes_padding
        request = WordRangeRead.read(reader, self.read_address)
        if request.size > word_range.MAX_READ:
            raise Refusal(*self.codes.bad_size)
        start = self.find(request.address)
        words = self._words(start, request.offset, request.size, request.total,
                            self.codes.read_past_end)
        whole = self.table.read(start, request.total)
        places = [word.offset - start.offset for word in words]
        return b''.join(
            whole[2 * at:2 * at + 2] if 0 <= at < request.total else self.table.read(word, 1)
            for at, word in zip(places, words, strict=True))

    def _write(self, reader: Reader) -> bytes:
        request = WordRangeWrite.read(reader, self.read_address)
        if len(request.address.encode()) + len(request.data) > word_range.MAX_WRITE:
            raise Refusal(*self.codes.bad_size)
        words = self._words(self.find(request.address), request.offset, len(request.data),
                            request.total, self.codes.write_past_end)
        values = {word.offset: request.data[2 * number:2 * number + 2]
                  for number, word in enumerate(words)}
        if max(values) - min(values) < len(values):  # one stretch: all of it or nothing
            first = words[0].at_offset(min(values))
            self.table.write(first, b''.join(values[at] for at in sorted(values)))
        else:
            for word in words:
                self.table.write(word, values[word.offset])
        return b''

    def _write_bits(self, reader: Reader) -> bytes:
        reader.takes_padding = self.takes_padding
        request = WordBitWrite.read(reader, self.read_address)
        place = word_on_line(self.find(request.address))
        self.table.write_bits(place, request.set | request.reset, request.set)
        return b''

    def _words(self, start: Address, offset: int, size: int, total: int,
               past_end: Codes) -> list[Address]:
        """Return the words of one packet, after a check that the whole transaction exists."""
        if size == 0 or size % 2 or offset + size // 2 > total:
            raise Refusal(*self.codes.bad_size)
        if not self._is_there(start, total):
            is_missing = not self._is_there(start, 1)
            raise Refusal(*(self.codes.missing if is_missing else past_end))
        first = start.offset + offset
        return [word_on_line(start.at_offset(first + n)) for n in range(size // 2)]

    def _is_there(self, start: Address, words: int) -> bool:
        try:
            self.table.find(start, words)
        except OutOfRange:
            return False
        return True
