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

"""The message in a frame; commands and replies have the same header."""

from __future__ import annotations

import struct
from typing import NamedTuple

from abdf1_ros.errors import FormatError

_HEADER = struct.Struct('<BBBBH')
HEADER_SIZE = _HEADER.size
REPLY_BIT = 0x40
# The bit of high priority, which does not change the command (M 6-5).
PRIORITY_BIT = 0x20
BROADCAST = 255

STS_NOT_DELIVERED = 0x02
"""STS of a gateway: the destination does not acknowledge (M 8-2)."""


DIAGNOSTIC_REPLY = 0x46
"""CMD of replies to echo, status and counters. A gateway may send them in place of a node."""


def is_local_status(sts: int) -> bool:
    """Tell whether a node on the way has set STS: the command may not have arrived (M 8-2)."""
    return 0 < sts < 0x10


def begins_good_reply(link_data: bytes | bytearray) -> bool:
    """Tell whether the data begin with the header of a reply without an error."""
    return len(link_data) >= HEADER_SIZE and link_data[2] & REPLY_BIT != 0 and link_data[3] == 0


class Packet(NamedTuple):
    """
    A message: DST SRC CMD STS TNS and the bytes after them (M 6-3).

    - ``dst``, ``src``: station addresses (0-255).
    - ``cmd``: bit 6 is set in a reply (M 6-5).
    - ``tns``: 16-bit transaction number, low byte first on the line (M 6-7).
    - ``data``: FNC and parameters of a command, or EXT STS or data of a reply.
    """

    dst: int
    src: int
    cmd: int
    sts: int
    tns: int
    data: bytes = b''

    @classmethod
    def decode(cls, link_data: bytes) -> Packet:
        """Read link data; raise FormatError when it is shorter than a header (M 3-7, 4-4)."""
        if len(link_data) < HEADER_SIZE:
            raise FormatError(f'{len(link_data)} bytes of link data, a header has {HEADER_SIZE}')
        dst, src, cmd, sts, tns = _HEADER.unpack_from(link_data)
        return cls(dst, src, cmd, sts, tns, link_data[HEADER_SIZE:])

    def encode(self) -> bytes:
        """Return the unstuffed link data."""
        return _HEADER.pack(self.dst, self.src, self.cmd, self.sts, self.tns) + self.data

    @property
    def is_reply(self) -> bool:
        """Tell whether this is a reply, not a command."""
        return bool(self.cmd & REPLY_BIT)

    @property
    def is_sound(self) -> bool:
        """
        Tell whether the header can be whole: a command has STS 0 (M 6-3..6-8).

        A leading 00 that is lost or inserted is invisible to BCC and CRC, which both begin at 0.
        All fields then move by one byte, and a byte of TNS or CMD is read as STS.
        """
        return self.is_reply or self.sts == 0

    @property
    def duplicate_key(self) -> tuple[int, int, int]:
        """Return SRC, CMD and TNS, by which a repeated message is known (M 3-4, 4-4)."""
        return self.src, self.cmd, self.tns

    @property
    def key_of_command(self) -> tuple[int, int, int]:
        """Return the ``duplicate_key`` of the command that this reply answers."""
        return self.dst, self.cmd & ~REPLY_BIT, self.tns

    def answers(self, command: Packet) -> bool:
        """Tell whether this is a reply to ``command``; the command code is not compared."""
        return self.cmd & REPLY_BIT != 0 and (self.src, self.dst, self.tns) == (
            command.dst, command.src, command.tns)

    def reply(self, data: bytes = b'', sts: int = 0) -> Packet:
        """Return the reply to this command: DST and SRC swapped, TNS copied (M 6-3..6-8)."""
        return Packet(self.src, self.dst, self.cmd | REPLY_BIT, sts, self.tns, data)
