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
Packets of files that Wireshark and tcpdump write: pcap and pcapng.

The formats follow draft-ietf-opsawg-pcap and draft-ietf-opsawg-pcapng, sections 4.1 to 4.4. Dumps
of packets as text are only found, because such texts leave out the kind of link.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import re
import struct
from typing import BinaryIO, NamedTuple

from abdf1_ros.problems import Problem

_PCAPNG = b'\x0A\x0D\x0D\x0A'
# Byte order and length of a tick, by the first four bytes of a pcap.
_PCAP = {b'\xD4\xC3\xB2\xA1': ('<', 1e-6), b'\xA1\xB2\xC3\xD4': ('>', 1e-6),
         b'\x4D\x3C\xB2\xA1': ('<', 1e-9), b'\xA1\xB2\x3C\x4D': ('>', 1e-9)}
_BYTE_ORDERS = {b'\x4D\x3C\x2B\x1A': '<', b'\x1A\x2B\x3C\x4D': '>'}
_INTERFACE, _SIMPLE, _ENHANCED = 1, 3, 6
_RESOLUTION = 9  # option of an interface
_LONGEST = 1_000_000  # bytes of a packet or block; no network has longer packets

# A line of "tshark -x" or "tcpdump -X": the offset in its packet, and bytes.
_DUMPED = re.compile(r'\s*(?:0[xX])?([0-9A-Fa-f]{4,8}):?\s+((?:[0-9A-Fa-f]{2}\s{0,2})+)')
# What stands before an IPv4 header on the usual links, and where: Ethernet with two tags at most,
# cooked 1 and 2, loopback, nothing.
_HEADS = {14: (12, b'\x08\0'), 16: (14, b'\x08\0'), 18: (16, b'\x08\0'), 22: (20, b'\x08\0'),
          20: (0, b'\x08\0'), 4: (0, b'\2\0\0\0'), 0: (0, b'')}
_LONGEST_HEAD = 22 + 60  # bytes, with IPv4
_PROTOCOLS = (1, 6, 17)  # ICMP, TCP, UDP


class RecordedPacket(NamedTuple):
    """A packet: seconds since 1970 (None: not recorded), link type, and the recorded bytes."""

    time: float | None
    link_type: int
    data: bytes


def is_packet_file(start: bytes) -> bool:
    """Return True if a file that begins with these bytes is pcap or pcapng."""
    return start[:4] == _PCAPNG or start[:4] in _PCAP


def shows_packets(lines: Iterable[str]) -> bool:
    """Return True if a text shows the bytes of whole packets, with their IPv4 headers."""
    packet = b''
    for match in filter(None, map(_DUMPED.match, lines)):
        offset = int(match[1], 16)
        packet = packet[:offset] + bytes.fromhex(match[2])
        if offset < _LONGEST_HEAD and any(
                packet.startswith(mark, at) and _is_ip(packet[size:], bool(mark))
                for size, (at, mark) in _HEADS.items()):
            return True
    return False


def _is_ip(data: bytes, may_lack_check: bool) -> bool:
    """Return True if bytes begin with an IPv4 header; a network card may add its check later."""
    size = 4 * (data[0] & 0x0F) if data else 0
    if size < 20 or len(data) < size or data[0] >> 4 != 4 or data[9] not in _PROTOCOLS:
        return False
    total = sum(struct.unpack_from(f'>{size // 2}H', data))
    return total % 0xFFFF == 0 or may_lack_check and data[10:12] == b'\0\0'


class PacketFile:
    """Reads the packets of ``file``; raises Problem, which names ``name`` and the byte."""

    def __init__(self, name: str, file: BinaryIO) -> None:
        self.position = 0
        self._name = name
        self._file = file

    def packets(self) -> Iterator[RecordedPacket]:
        """Yield the packets in the order of the file."""
        magic = self._take(4)
        if magic == _PCAPNG:
            yield from self._pcapng()
        else:
            yield from self._pcap(*_PCAP[magic])

    def _pcap(self, order: str, tick: float) -> Iterator[RecordedPacket]:
        link_type = struct.unpack(f'{order}I', self._take(20)[16:])[0] & 0xFFFF
        while head := self._take(16, may_end=True):
            seconds, ticks, kept, _ = struct.unpack(f'{order}4I', head)
            yield RecordedPacket(seconds + ticks * tick, link_type, self._take(kept))

    def _pcapng(self) -> Iterator[RecordedPacket]:
        order, interfaces = '<', list[tuple[int, float]]()
        head = _PCAPNG + self._take(4)
        while head:
            if head.startswith(_PCAPNG):  # a section, which has its own byte order
                mark = self._take(4)
                order, interfaces = _BYTE_ORDERS.get(mark, '<'), []
                size = struct.unpack(f'{order}I', head[4:])[0] - 16
                kind = 0
            else:
                kind, size = struct.unpack(f'{order}2I', head)
                size -= 12
            body = self._take(size)
            self._take(4)  # the size again
            if kind == _INTERFACE:
                interfaces.append((struct.unpack_from(f'{order}H', body.ljust(2, b'\0'))[0],
                                   _tick(order, body[8:])))
            elif kind in (_ENHANCED, _SIMPLE):
                yield self._packet(order, kind, body, interfaces)
            head = self._take(8, may_end=True)

    def _packet(self, order: str, kind: int, body: bytes,
                interfaces: list[tuple[int, float]]) -> RecordedPacket:
        try:
            if kind == _SIMPLE:
                length, = struct.unpack_from(f'{order}I', body)  # the rest fills up a word
                return RecordedPacket(None, interfaces[0][0], body[4:4 + length])
            which, high, low, kept, _ = struct.unpack_from(f'{order}5I', body)
            link_type, tick = interfaces[which]
        except (struct.error, IndexError):
            raise self._damaged('a packet without its interface') from None
        return RecordedPacket((high << 32 | low) * tick, link_type, body[20:20 + kept])

    def _take(self, size: int, may_end: bool = False) -> bytes:
        if not 0 <= size <= _LONGEST:
            raise self._damaged(f'a size of {size} bytes')
        data = self._file.read(size)
        self.position += len(data)
        if len(data) < size and not (may_end and not data):
            raise self._damaged('the file ends inside a packet')
        return data

    def _damaged(self, reason: str) -> Problem:
        return Problem(self._name, f'byte {self.position}: {reason}; what stands before it has '
                                   'been read')


def _tick(order: str, options: bytes) -> float:
    """Return the length (s) of a tick in the time stamps of an interface."""
    while len(options) >= 5:
        code, size = struct.unpack_from(f'{order}HH', options)
        if code == _RESOLUTION:
            value = options[4]
            return 2.0 ** -(value & 0x7F) if value & 0x80 else 10.0 ** -value
        options = options[4 + size + -size % 4:]
    return 1e-6
