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
The commands of a PLC-2, which have no FNC (M 7-15, 7-19, 7-30..7-40).

PLC-3 and PLC-5 execute them on a compatibility file. An SLC or MicroLogix executes them on its
common interface file: 9, or 7 on a MicroLogix 1000 (M 7-31). ``address`` counts bytes, two for
each word, low byte first; only an SLC may be set to count words.
"""

from __future__ import annotations

from dataclasses import dataclass

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import Reader, word

PROTECTED_WRITE = 0x00
READ = 0x01
PROTECTED_BIT_WRITE = 0x02
UNPROTECTED_BIT_WRITE = 0x05
UNPROTECTED_WRITE = 0x08

# Bytes of data in one packet, and bytes to modify in one bit write (M 7-30..7-40). KF2 allows 242
# bytes in a write, M 244. Our writes have at most 242 bytes, received writes may have 244.
MAX_READ = 244
MAX_WRITE = 242
MAX_SERVED_WRITE = 244
MAX_SETS = 60

# An SLC 5/01 or 5/02 accepts at most 95 bytes in a read and 94 in a write (M 7-31..7-40).
MAX_CIF = 94


@dataclass(frozen=True, slots=True)
class BasicRead:
    """Unprotected read, 01; ``size`` is bytes, 1-244."""

    address: int
    size: int

    def encode(self) -> bytes:
        """Return the bytes after TNS."""
        return word(self.address) + bytes((self.size,))

    @classmethod
    def read(cls, reader: Reader) -> BasicRead:
        """Take the parameters off ``reader``."""
        address, size = reader.word(), reader.byte()
        reader.end()
        return cls(address, size)


@dataclass(frozen=True, slots=True)
class BasicWrite:
    """Protected or unprotected write, 00 or 08."""

    address: int
    data: bytes

    def encode(self) -> bytes:
        """Return the bytes after TNS."""
        return word(self.address) + self.data

    @classmethod
    def read(cls, reader: Reader) -> BasicWrite:
        """Take the parameters off ``reader``."""
        return cls(reader.word(), reader.rest())


@dataclass(frozen=True, slots=True)
class ByteChange:
    """Bits of one byte to set and to reset; ``address`` is odd for the high byte of a word."""

    address: int
    set: int  # noqa: A003
    reset: int

    def __post_init__(self) -> None:
        """Check that no bit is in both masks."""
        if self.set & self.reset:
            raise FormatError(f'bits {self.set & self.reset:02X} are to be set and reset')

    def encode(self) -> bytes:
        """Return address and both masks."""
        return word(self.address) + bytes((self.set, self.reset))

    @classmethod
    def read(cls, reader: Reader) -> ByteChange:
        """Take address and masks off ``reader``."""
        return cls(reader.word(), reader.byte(), reader.byte())


@dataclass(frozen=True, slots=True)
class BasicBitWrite:
    """Protected or unprotected bit write, 02 or 05: up to 60 bytes, each by its masks."""

    changes: tuple[ByteChange, ...]

    def encode(self) -> bytes:
        """Return the bytes after TNS."""
        return b''.join(change.encode() for change in self.changes)

    @classmethod
    def read(cls, reader: Reader) -> BasicBitWrite:
        """Take the parameters off ``reader``; FormatError when there are more than 60."""
        changes = [ByteChange.read(reader)]
        while not reader.is_empty:
            changes.append(ByteChange.read(reader))
        if len(changes) > MAX_SETS:
            raise FormatError(f'{len(changes)} bytes to modify, {MAX_SETS} are allowed')
        return cls(tuple(changes))
