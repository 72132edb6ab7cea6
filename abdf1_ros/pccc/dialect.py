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

"""How the driver reads and writes the words of the data table of a PLC family."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Generator
from dataclasses import dataclass
from typing import TypeVar

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.file_types import FileType, Layout

Request = tuple[int, bytes]
"""CMD, and the bytes after TNS."""

_Result = TypeVar('_Result')

Steps = Generator[Request, Packet, _Result]
"""A procedure with a station: yields requests, gets the replies, returns the result."""


@dataclass(frozen=True, slots=True)
class Transfer:
    """
    The words that one packet moves, or several together: ``words`` words from ``start`` on.

    Commands with an offset and a total name the whole transfer of several packets. All other
    commands have only the address and size of their own packet.
    """

    start: Address
    words: int


def exactly(words: int, data: bytes) -> bytes:
    """Return the data of a reply; FormatError unless they are ``words`` words."""
    if len(data) != words * 2:
        raise FormatError(f'the reply holds {len(data)} bytes, asked were {words * 2}')
    return data


def whole_elements(layout: Layout, size: int) -> int:
    """Return the words of the whole elements that fit into ``size`` bytes, at least of one."""
    return max(1, size // 2 // layout.words) * layout.words


class Dialect(ABC):
    """
    Turn an address and a number of words into a request, and a reply's data into words.

    Data are words in the order of ``Address.offset``, each low byte first. If a packet is only a
    part of a transfer, the transfer is an argument too. ``writes_bits`` is False where a family
    has no command that changes single bits; ``write_bits`` then raises FormatError.
    """

    writes_bits = True

    @abstractmethod
    def max_read(self, file_type: FileType) -> int:
        """Return the most words, in whole elements, that one read of such a file can return."""

    def sure_read(self, file_type: FileType) -> int:
        """Return the most words that every processor of the family can return for one read."""
        return self.max_read(file_type)

    @abstractmethod
    def max_write(self, file_type: FileType) -> int:
        """Return the most words, in whole elements, that one write to such a file can contain."""

    @abstractmethod
    def read(self, address: Address, words: int, transfer: Transfer | None = None) -> Request:
        """
        Return a read of ``words`` words.

        Words of a structure file have to be one value or whole elements.
        """

    def reply_size(self, address: Address, words: int) -> int:
        """Return the number of bytes after the header of the reply to that read."""
        return 2 * words

    def read_data(self, address: Address, words: int, data: bytes) -> bytes:
        """Return the words in the reply to that read; FormatError when they are missing."""
        return exactly(words, data)

    @abstractmethod
    def write(self, address: Address, data: bytes, transfer: Transfer | None = None) -> Request:
        """Return a write of whole words."""

    @abstractmethod
    def write_bits(self, address: Address, mask: int, bits: int) -> Request:
        """Return a request that changes the bits of ``mask`` in one word to ``bits``."""
