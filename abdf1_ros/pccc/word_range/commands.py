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
Word range read and write, file read and bit write of PLC-3 and PLC-5 (M 7-4, 7-34, 7-35).

``offset`` and ``total`` count words. A transaction of ``total`` words begins at ``address``. A
packet has some of these words, from word ``offset`` on (M 14-6).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.fields import Reader, word
from abdf1_ros.pccc.file_types import FileType

CMD = 0x0F
WRITE = 0x00
READ = 0x01
BIT_WRITE = 0x02
FILE_READ = 0x04

# Bytes of data in a reply; bytes of address and data in a write (M 7-34, 7-35).
MAX_READ = 244
MAX_WRITE = 240


class WireAddress(Protocol):
    """The address of a PLC-5 or PLC-3 as it stands in a command."""

    def encode(self) -> bytes:
        """Return its bytes."""


_Place = TypeVar('_Place', bound=WireAddress)


@dataclass(frozen=True, slots=True)
class WordRangeRead(Generic[_Place]):
    """Word range read, 0F/01; ``size`` is bytes, even, at most 244."""

    address: _Place
    size: int
    offset: int
    total: int

    def encode(self) -> bytes:
        """Return FNC and parameters."""
        return (bytes((READ,)) + word(self.offset) + word(self.total) + self.address.encode()
                + bytes((self.size,)))

    @classmethod
    def read(cls, reader: Reader,
             read_address: Callable[[Reader], _Place]) -> WordRangeRead[_Place]:
        """Take the parameters off ``reader``; a file read, 0F/04, has the same parameters."""
        offset, total = reader.word(), reader.word()
        address = read_address(reader)
        size = reader.byte()
        reader.end()
        return cls(address, size, offset, total)


@dataclass(frozen=True, slots=True)
class WordRangeWrite(Generic[_Place]):
    """Word range write, 0F/00; address and data are at most 240 bytes together."""

    address: _Place
    data: bytes
    offset: int
    total: int

    def encode(self) -> bytes:
        """Return FNC and parameters."""
        return (bytes((WRITE,)) + word(self.offset) + word(self.total) + self.address.encode()
                + self.data)

    @classmethod
    def read(cls, reader: Reader,
             read_address: Callable[[Reader], _Place]) -> WordRangeWrite[_Place]:
        """Take the parameters off ``reader``."""
        offset, total = reader.word(), reader.word()
        return cls(read_address(reader), reader.rest(), offset, total)


@dataclass(frozen=True, slots=True)
class WordBitWrite(Generic[_Place]):
    """Bit write, 0F/02: bits of one word to set and to reset (M 7-4)."""

    address: _Place
    set: int  # noqa: A003
    reset: int

    def __post_init__(self) -> None:
        """Check that no bit is in both."""
        if self.set & self.reset:
            raise FormatError(f'bits {self.set & self.reset:04X} are to be set and reset')

    def encode(self) -> bytes:
        """Return FNC and parameters."""
        return bytes((BIT_WRITE,)) + self.address.encode() + word(self.set) + word(self.reset)

    @classmethod
    def read(cls, reader: Reader,
             read_address: Callable[[Reader], _Place]) -> WordBitWrite[_Place]:
        """Take the parameters off ``reader``."""
        change = cls(read_address(reader), reader.word(), reader.word())
        reader.end()
        return change


# Such commands move words as a PLC-5 stores them: the high word of a float comes first (M 13-17).
# Everywhere else in this package, as in typed commands, the low word comes first.
_WITH_FLOATS = (FileType.FLOAT, FileType.PID)


def word_on_line(address: Address) -> Address:
    """Return the address at which we have the word that the line has at ``address``."""
    return address.at_offset(address.offset + _step(address))


def in_line_order(address: Address, data: bytes) -> bytes:
    """Turn whole values from ``address`` on from our word order into the line's, or back."""
    if address.file_type not in _WITH_FLOATS:
        return data
    words = [data[at:at + 2] for at in range(0, len(data), 2)]
    places = (address.at_offset(address.offset + n) for n in range(len(words)))
    return b''.join(words[n + _step(place)] for n, place in enumerate(places))


def _step(address: Address) -> int:
    """Return 1 for the first word of a float, -1 for the second, 0 for any other word."""
    if address.file_type is FileType.FLOAT:
        return -1 if address.word else 1
    if address.file_type is FileType.PID:
        return {2: 1, 0: -1}.get(address.layout.value_words(address.word), 0)
    return 0
