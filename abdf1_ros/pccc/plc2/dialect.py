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

"""How words are read and written with the commands of a PLC-2."""

from __future__ import annotations

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.dialect import Dialect, Request, Transfer
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.plc2 import commands as plc2
from abdf1_ros.pccc.plc2.commands import BasicBitWrite, BasicRead, BasicWrite, ByteChange


class Plc2Dialect(Dialect):
    """
    Read, write and bit write without FNC.

    With access CIF an address counts words, packets are as short as the oldest SLC needs them,
    and there is no bit write.
    """

    def __init__(self, access: Access) -> None:
        is_protected = access is Access.PROTECTED
        self._write = plc2.PROTECTED_WRITE if is_protected else plc2.UNPROTECTED_WRITE
        self._bit_write = plc2.PROTECTED_BIT_WRITE if is_protected else plc2.UNPROTECTED_BIT_WRITE
        self._is_cif = access is Access.CIF
        self.writes_bits = not self._is_cif

    def max_read(self, file_type: FileType) -> int:
        return (plc2.MAX_CIF if self._is_cif else plc2.MAX_READ) // 2

    def max_write(self, file_type: FileType) -> int:
        return (plc2.MAX_CIF if self._is_cif else plc2.MAX_WRITE) // 2

    def read(self, address: Address, words: int, transfer: Transfer | None = None) -> Request:
        """Return an unprotected read; there is no protected read."""
        return plc2.READ, BasicRead(self._first(address), 2 * words).encode()

    def write(self, address: Address, data: bytes, transfer: Transfer | None = None) -> Request:
        return self._write, BasicWrite(self._first(address), data).encode()

    def write_bits(self, address: Address, mask: int, bits: int) -> Request:
        """Return a bit write of the bytes that ``mask`` touches."""
        if not self.writes_bits:
            raise FormatError('a common interface file has no bit write')
        changes = (ByteChange(self._first(address) + high, bits >> at & mask >> at & 0xFF,
                              ~bits >> at & mask >> at & 0xFF)
                   for high, at in enumerate((0, 8)) if mask >> at & 0xFF)
        return self._bit_write, BasicBitWrite(tuple(changes)).encode()

    def _first(self, address: Address) -> int:
        """Return the address of a word as the command counts."""
        return address.offset if self._is_cif else 2 * address.offset
