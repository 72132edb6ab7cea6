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

"""The data table of an emulated PLC: files of words."""

from __future__ import annotations

from collections.abc import Iterator

from abdf1_ros.errors import Abdf1Error
from abdf1_ros.pccc.address import Address, Area
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.text import counted


class NoSuchFile(Abdf1Error):
    """The table has no such file, or its file of this number has another type."""


class OutOfRange(Abdf1Error):
    """The file ends before the last word of the request."""


class Protected(Abdf1Error):
    """The words must not be written."""


class DataTable:
    """
    Words by address, each low byte first.

    A file is as long as ``create`` has made it. A read or write past its end raises OutOfRange, of
    a missing file NoSuchFile. Neither changes anything.
    """

    def __init__(self, plc_type: PlcType) -> None:
        self.plc_type = plc_type
        self.words: dict[Area, bytearray] = {}
        self._types: dict[int, FileType] = {}

    def __iter__(self) -> Iterator[Area]:
        """Iterate over the files (for SLC I/O, the slots)."""
        return iter(self.words)

    def create(self, address: Address, words: int) -> None:
        """Make the file of ``address`` long enough for ``words`` words from there on."""
        known = address.file_type if address.is_by_type \
            else self._types.setdefault(address.file, address.file_type)
        if known is not address.file_type:
            raise NoSuchFile(f'file {address.file} is of type {known.value} already')
        store = self.words.setdefault(address.area, bytearray())
        per_element = address.layout.words
        end = -(-(address.offset + words) // per_element) * per_element  # whole elements
        store.extend(bytes(max(0, 2 * end - len(store))))

    def length(self, area: Area) -> int:
        """Return how many words a file (for SLC I/O, a slot) has."""
        return len(self.words[area]) // 2

    def file_type(self, file: int) -> FileType:
        """Return the type of a file by its number, which is not that of a function file."""
        try:
            return self._types[file]
        except KeyError:
            raise NoSuchFile(f'there is no file {file}') from None

    def read(self, address: Address, words: int) -> bytes:
        store, start = self.find(address, words)
        return bytes(store[start:start + 2 * words])

    def write(self, address: Address, data: bytes) -> None:
        """Store whole words."""
        store, start = self.find(address, len(data) // 2)
        store[start:start + len(data)] = data

    def write_bits(self, address: Address, mask: int, bits: int) -> None:
        """Change the bits of ``mask`` in one word to ``bits``."""
        old = int.from_bytes(self.read(address, 1), 'little')
        self.write(address, (old & ~mask | bits & mask).to_bytes(2, 'little'))

    def restore(self, saved: DataTable) -> None:
        """Take over all words of a copy of this table."""
        for area, words in saved.words.items():
            self.words[area][:len(words)] = words

    def find(self, address: Address, words: int) -> tuple[bytearray, int]:
        """Return the bytes of the area and where in them the words begin."""
        store = self.words.get(address.area)
        if store is None:
            raise NoSuchFile(f'there is no {address}')
        start = 2 * address.offset
        if start + 2 * words > len(store):
            has = counted(len(store) // 2, 'word')
            raise OutOfRange(f'{counted(words, "word")} at {address} would end after the file, '
                             f'which has {has}')
        return store, start
