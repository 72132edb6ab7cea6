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
Traffic out of recorded packets: DF1 that ``sniff`` has written, and PCCC inside EtherNet/IP.

PCCC goes through TCP port 44818 in CIP service 4B (Execute PCCC) of the PCCC object (class 67), as
it is or inside of an Unconnected Send (52). It has no frame, check, DST and SRC: the last numbers
of the IP addresses stand for these two. A response names no class: it is PCCC where its request
was seen.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
import struct

from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.packet_files import RecordedPacket
from abdf1_ros.sniffer.pcapng import DIRECTIONS, HEAD_SIZE, LINK_TYPE, VERSION

# A serial port recorded by an RTAC of SEL (link type RTAC_SERIAL): 12 bytes before the data, the
# ninth says what has happened; a beginning and an end of sending or receiving have data.
_RTAC = 250
_RTAC_EVENTS = {1: Direction.OUT, 2: Direction.IN, 3: Direction.OUT, 4: Direction.IN}

_DIRECTIONS = {number: way for way, number in DIRECTIONS.items()}

_PORT = 44818
CSP = 2222  # PCCC of older Ethernet processors, in a way of its own
# The bytes before an IPv4 header, and where among them its EtherType stands, by link type:
# loopback, Ethernet, raw IP, Linux cooked 1 and 2.
_LINKS = {0: (4, None), 1: (14, 12), 101: (0, None), 113: (16, 14), 276: (20, 0)}
_IP, _VLAN, _TCP = b'\x08\x00', b'\x81\x00', 6
_MOST_STREAMS = 1000

_SEND_RR, _SEND_UNIT = 0x6F, 0x70
_COMMANDS = (0x00, 0x01, 0x04, 0x63, 0x64, 0x65, 0x66, _SEND_RR, _SEND_UNIT, 0x72, 0x73)
_CONNECTED, _UNCONNECTED = 0xB1, 0xB2  # items
_EXECUTE_PCCC, _UNCONNECTED_SEND, _REPLY = 0x4B, 0x52, 0x80  # services
_PCCC_OBJECT = b'\x20\x67', b'\x21\x00\x67\x00'  # a path begins with its class


class _Stream:
    """The bytes of one direction of a TCP connection, in their order."""

    def __init__(self) -> None:
        self._next: int | None = None
        self._waiting = b''

    def feed(self, number: int, data: bytes) -> Iterator[bytes]:
        """Take a segment; yield the data of the EtherNet/IP messages that it completes."""
        known = 0 if self._next is None else self._next - number & 0xFFFFFFFF
        if known >= 1 << 31:  # bytes are missing
            known, self._waiting = 0, b''
        if known and known >= len(data):
            return  # they come again
        self._next = number + len(data) & 0xFFFFFFFF
        self._waiting += data[known:]
        while len(self._waiting) >= 24:
            command, size = struct.unpack_from('<HH', self._waiting)
            if command not in _COMMANDS:
                self._waiting = b''  # not the beginning of a message
            elif len(self._waiting) < 24 + size:
                return
            else:
                message, self._waiting = self._waiting[24:24 + size], self._waiting[24 + size:]
                if command in (_SEND_RR, _SEND_UNIT):
                    yield message


def chunks_of(packets: Iterable[RecordedPacket], ports: set[int]) -> Iterator[Chunk]:
    """
    Yield what DF1 and PCCC there is in packets, with times (s) from the first packet on.

    All TCP ports that were seen come into ``ports``.
    """
    streams: dict[bytes, _Stream] = {}
    asked: set[bytes] = set()  # connection and TNS of requests
    begun: float | None = None
    for time, link_type, data in packets:
        begun = time if begun is None else begun
        later = None if time is None or begun is None else time - begun
        if link_type == LINK_TYPE and data[:1] == bytes((VERSION,)) and len(data) > HEAD_SIZE:
            yield Chunk(later, _DIRECTIONS.get(data[1], Direction.UNKNOWN), data[HEAD_SIZE:])
        elif link_type == _RTAC and len(data) > 12 and data[8] in _RTAC_EVENTS:
            yield Chunk(later, _RTAC_EVENTS[data[8]], data[12:])
        elif (segment := _tcp(link_type, data)) is not None:
            ends, number, payload = segment
            both = {int.from_bytes(ends[8:10], 'big'), int.from_bytes(ends[10:], 'big')}
            ports |= both
            if _PORT not in both:
                continue
            if len(streams) > _MOST_STREAMS:
                streams.clear()
                asked.clear()
            way = Direction.OUT if ends[10:12] == _PORT.to_bytes(2, 'big') else Direction.IN
            for message in streams.setdefault(ends, _Stream()).feed(number, payload):
                for is_reply, pccc in _pccc(message):
                    key = (ends[4:8] + ends[:4] + ends[10:] + ends[8:10] if is_reply else ends) \
                        + pccc[2:4]
                    if not is_reply:
                        asked.add(key)
                    elif key not in asked:
                        continue
                    yield Chunk(later, way, bytes((ends[7], ends[3])) + pccc, is_message=True)


def _tcp(link_type: int, data: bytes) -> tuple[bytes, int, bytes] | None:
    """Return addresses and ports, sequence number and payload of a segment."""
    start, kind = _LINKS.get(link_type, (len(data), None))
    if kind is not None:
        while data[kind:kind + 2] == _VLAN:
            start, kind = start + 4, kind + 4
        if data[kind:kind + 2] != _IP:
            return None
    head = data[start:]
    if len(head) < 20 or head[0] >> 4 != 4 or head[9] != _TCP or head[6] & 0x3F or head[7]:
        return None  # also fragments, which EtherNet/IP has not
    size = 4 * (head[0] & 0x0F)
    segment = head[size:int.from_bytes(head[2:4], 'big')]
    if len(segment) < 20:
        return None
    ports, number = segment[:4], int.from_bytes(segment[4:8], 'big')
    is_first = segment[13] & 0x02
    payload = segment[4 * (segment[12] >> 4):]
    return head[12:20] + ports, number + bool(is_first), payload


def _pccc(message: bytes) -> Iterator[tuple[bool, bytes]]:
    """Yield whether it is a response, and CMD, STS, TNS and what follows of each Execute PCCC."""
    at = 8
    for _ in range(int.from_bytes(message[6:8], 'little')):
        item, size = int.from_bytes(message[at:at + 2], 'little'), int.from_bytes(
            message[at + 2:at + 4], 'little')
        data, at = message[at + 4:at + 4 + size], at + 4 + size
        if item == _CONNECTED:
            data = data[2:]  # after the sequence count
        if item in (_CONNECTED, _UNCONNECTED):
            found = _executed(data)
            if len(found) >= 4:
                yield bool(data[0] & _REPLY), found


def _executed(cip: bytes) -> bytes:
    """Return the PCCC of a CIP request or response, empty where it has none."""
    if len(cip) < 4:
        return b''
    if cip[0] == _EXECUTE_PCCC | _REPLY:
        body = cip[4 + 2 * cip[3]:]
    else:
        body = cip[2 + 2 * cip[1]:]
        if cip[0] == _UNCONNECTED_SEND and len(body) >= 4:
            return _executed(body[4:4 + int.from_bytes(body[2:4], 'little')])
        if cip[0] != _EXECUTE_PCCC or not cip[2:].startswith(_PCCC_OBJECT):
            return b''
    return body[body[0]:] if body else b''  # after the requestor, which begins with its length
