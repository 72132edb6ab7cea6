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
Entries as a pcapng file, which Wireshark reads with the dissector of this package.

The link type is USER0. Each packet is one symbol of DF1 (a message, a poll, DLE ACK, ...): four
bytes of ours, then the bytes of the symbol on the line. Noise, silence and missing replies have no
packets. The four bytes are:

- version: 1
- direction: 0 not known, 1 ">", 2 "<"
- check: 0 none, 1 BCC, 2 CRC
- verdict of the check: 0 none, 1 right, 2 wrong

The format follows draft-ietf-opsawg-pcapng, sections 4.1 to 4.3.
"""

from __future__ import annotations

from datetime import datetime
from pathlib import Path
import struct

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.sniffer.capture import Direction, may_replace
from abdf1_ros.sniffer.entries import Entry

VERSION = 1
LINK_TYPE = 147  # USER0
HEAD_SIZE = 4
_SECTION = 0x0A0D0D0A
_INTERFACE = 1
_PACKET = 6
_BYTE_ORDER = 0x1A2B3C4D
_NO_LENGTH = 0xFFFFFFFFFFFFFFFF
_NAME = 2  # option of an interface
_FLAGS = 2  # option of a packet; its lowest two bits are the direction
_SNAP_LENGTH = 0  # no limit
DIRECTIONS = {Direction.UNKNOWN: 0, Direction.OUT: 1, Direction.IN: 2}
# In pcapng, inbound is 1 and outbound is 2.
_FLAG = {Direction.UNKNOWN: 0, Direction.OUT: 2, Direction.IN: 1}
_CHECKS = {None: 0, Checksum.BCC: 1, Checksum.CRC: 2}
_VERDICTS = {None: 0, True: 1, False: 2}


class PcapngWriter:
    """
    Write entries to ``path``: a new file, an earlier file of ours, or a named pipe.

    An earlier file is replaced. With a pipe, the constructor waits for the reader. Raises OSError
    if ``path`` cannot be written, or if it is another file, which is not changed. A new file is
    not readable for all users, because it contains values of a plant.
    """

    def __init__(self, path: str) -> None:
        place = Path(path)
        if place.exists() and not place.is_fifo() and not may_replace(place, _head()):
            raise OSError(f'{path} exists and was not made by --pcapng; give another name')
        self.begun = 0.0
        place.touch(0o640)
        self.file = place.open('wb', buffering=0)
        self.file.write(_head())

    def begin(self, begun: str) -> None:
        """Set the date and time (ISO 8601) from which the times of the next entries count."""
        try:
            self.begun = datetime.fromisoformat(begun).timestamp()
        except ValueError:
            self.begun = 0.0

    def write(self, entry: Entry) -> None:
        """Write the bytes of an entry, if it has any."""
        if not entry.wire:
            return
        data = bytes((VERSION, DIRECTIONS[entry.direction], _CHECKS[entry.checksum],
                      _VERDICTS[entry.valid])) + entry.wire
        microseconds = round((self.begun + (entry.time or 0.0)) * 1e6)
        microseconds = min(max(0, microseconds), 0xFFFFFFFFFFFFFFFF)
        flags = struct.pack('<I', _FLAG[entry.direction])
        self.file.write(_block(_PACKET, struct.pack(
            '<IIIII', 0, microseconds >> 32, microseconds & 0xFFFFFFFF, len(data), len(data))
            + _padded(data) + _option(_FLAGS, flags) + _option(0, b'')))

    def close(self) -> None:
        self.file.close()


def _head() -> bytes:
    """Return the blocks with which each file of ours begins."""
    return _block(_SECTION, struct.pack('<IHHQ', _BYTE_ORDER, 1, 0, _NO_LENGTH)) + _block(
        _INTERFACE, struct.pack('<HHI', LINK_TYPE, 0, _SNAP_LENGTH)
        + _option(_NAME, b'DF1') + _option(0, b''))


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def _option(code: int, value: bytes) -> bytes:
    return struct.pack('<HH', code, len(value)) + _padded(value)


def _block(kind: int, body: bytes) -> bytes:
    size = struct.pack('<I', 12 + len(body))
    return struct.pack('<I', kind) + size + body + size
