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
The commands of an SLC 500 or MicroLogix: protected typed logical read and write (M 7-17, 7-18).

Their address is file number, file type, element, and sub-element. The sub-element is the word
inside the element at which the data begin. A1 is a read and A9 a write without the sub-element.
Both are older than the manual and still in use (1756-PM020).
"""

from __future__ import annotations

from dataclasses import dataclass

from abdf1_ros.pccc.fields import number, Reader, word
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.processor import USUAL

CMD = 0x0F
SHORT_READ = 0xA1
LOGICAL_READ = 0xA2
SHORT_WRITE = 0xA9
LOGICAL_WRITE = 0xAA
MASKED_WRITE = 0xAB

# Bytes of data in one packet of an SLC 5/03 or later (M 7-17, 7-18).
MAX_READ = USUAL.max_read
MAX_WRITE = USUAL.max_write

# The words of the whole output and input image, without slots. The manual reserves these types; an
# SLC 5/05 answers them.
FLAT_CODES = {FileType.OUTPUT: 0x82, FileType.INPUT: 0x83}
BY_FLAT_CODE = {code: kind for kind, code in FLAT_CODES.items()}


@dataclass(frozen=True, slots=True)
class LogicalAddress:
    """
    File number, file type code (M 7-17), element, and word inside the element.

    ``sub_element`` is None in the short commands, which begin at the first word.
    """

    file: int
    type_code: int
    element: int
    sub_element: int | None

    def encode(self) -> bytes:
        """Return the fields."""
        fields = number(self.file) + bytes((self.type_code,)) + number(self.element)
        return fields if self.sub_element is None else fields + number(self.sub_element)

    @classmethod
    def read(cls, reader: Reader, is_short: bool = False) -> LogicalAddress:
        """Take the fields off ``reader``."""
        file, type_code, element = reader.number(), reader.byte(), reader.number()
        return cls(file, type_code, element, None if is_short else reader.number())


@dataclass(frozen=True, slots=True)
class LogicalRead:
    """Protected typed logical read, 0F/A2 (M 7-17) or A1; ``size`` is bytes, 1-255."""

    address: LogicalAddress
    size: int

    def encode(self) -> bytes:
        """Return FNC and parameters."""
        function = SHORT_READ if self.address.sub_element is None else LOGICAL_READ
        return bytes((function, self.size)) + self.address.encode()

    @classmethod
    def read(cls, reader: Reader, is_short: bool = False) -> LogicalRead:
        """Take the parameters off ``reader``."""
        size = reader.byte()
        address = LogicalAddress.read(reader, is_short)
        reader.end()
        return cls(address, size)


@dataclass(frozen=True, slots=True)
class LogicalWrite:
    """Protected typed logical write, 0F/AA (M 7-18) or A9."""

    address: LogicalAddress
    data: bytes

    def encode(self) -> bytes:
        """Return FNC and parameters."""
        function = SHORT_WRITE if self.address.sub_element is None else LOGICAL_WRITE
        return bytes((function, len(self.data))) + self.address.encode() + self.data

    @classmethod
    def read(cls, reader: Reader, is_short: bool = False) -> LogicalWrite:
        """Take the parameters off ``reader``."""
        size = reader.byte()
        address = LogicalAddress.read(reader, is_short)
        return cls(address, _sized(reader, size))


@dataclass(frozen=True, slots=True)
class MaskedWrite:
    """
    Protected typed logical write with mask, 0F/AB (M 7-18).

    In every word of ``data`` only the bits set in ``mask`` change.
    """

    address: LogicalAddress
    mask: int
    data: bytes

    def encode(self) -> bytes:
        """Return FNC and parameters; the size counts the data, not the mask."""
        return (bytes((MASKED_WRITE, len(self.data))) + self.address.encode()
                + word(self.mask) + self.data)

    @classmethod
    def read(cls, reader: Reader) -> MaskedWrite:
        """Take the parameters off ``reader``."""
        size = reader.byte()
        address = LogicalAddress.read(reader)
        mask = reader.word()
        return cls(address, mask, _sized(reader, size))


def _sized(reader: Reader, size: int) -> bytes:
    data = reader.take(size)
    reader.end()
    return data
