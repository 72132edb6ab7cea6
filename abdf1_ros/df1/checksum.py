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

"""The two block checks of DF1: BCC and CRC-16."""

from __future__ import annotations

from enum import Enum


class Checksum(Enum):
    """The check after DLE ETX; the value is its name in the net CSV (S0, Error_Code)."""

    BCC = 'BCC'
    CRC = 'CRC'

    def __init__(self, name: str) -> None:
        self.size = 1 if name == 'BCC' else 2  # check bytes

    def of_message(self, data: bytes | bytearray, station: int | None = None) -> int:
        """
        Return the check of a message frame as a number.

        ``data`` is the unstuffed link data. ``station`` is the STN of a master frame, or None for
        a slave's or a full-duplex frame. A BCC covers STN and data (M 5-4, 5-5). A CRC covers STN,
        STX, data and ETX in a master frame, data and ETX in any other frame (M 5-6, 5-7). Only
        this rule gives the check in the example of M 14-2.
        """
        if self is Checksum.BCC:
            return bcc(data, station or 0)
        covered = data + b'\x03'
        return crc16(covered if station is None else bytes((station, 0x02)) + covered)

    def encode(self, value: int) -> bytes:
        """Return the check bytes as they are sent: of a CRC the low byte first (M 5-6)."""
        return value.to_bytes(self.size, 'little')


def bcc(data: bytes | bytearray, start: int = 0) -> int:
    """Return the two's complement of the 8-bit sum of ``start`` and ``data`` (M 5-2)."""
    return -(start + sum(data)) & 0xFF


def _table_entry(value: int) -> int:
    for _ in range(8):
        value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value


_CRC_TABLE = tuple(_table_entry(value) for value in range(256))
_CRC_LOW = tuple(entry & 0xFF for entry in _CRC_TABLE)
_CRC_HIGH = tuple(entry >> 8 for entry in _CRC_TABLE)


def crc16(data: bytes | bytearray) -> int:
    """Return CRC-16 x^16+x^15+x^2+1, reflected (A001), begun with 0 (M 5-6)."""
    # The two bytes are computed apart, because Python makes no new objects for small numbers.
    low = high = 0
    for byte in data:
        index = low ^ byte
        low = high ^ _CRC_LOW[index]
        high = _CRC_HIGH[index]
    return high << 8 | low
