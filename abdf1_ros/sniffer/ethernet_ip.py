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
Traffic in recorded packets: DF1 of ``sniff``, RTAC, device server or USB, and PCCC in EtherNet/IP.

Inside EtherNet/IP (TCP port 44818), PCCC is the data of CIP service 4B (Execute PCCC) of the PCCC
object (class 67). The service may be inside an Unconnected Send (52). There, PCCC has no frame,
check, DST or SRC. We use the last numbers of the IP addresses as DST and SRC. A second address
with the same last number gets a free number. A response does not contain the class, so it counts
as PCCC only if its request was seen.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
import struct

from abdf1_ros.cip.encapsulation import COMMANDS, EipCommand, EipItem, HEADER_SIZE, PORT
from abdf1_ros.cip.requests import CipService, REPLY
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.packet_files import RecordedPacket
from abdf1_ros.sniffer.pcapng import DIRECTIONS, HEAD_SIZE, LINK_TYPE, VERSION
from abdf1_ros.sniffer.serial_packets import DeviceServers, USB_HEADS, UsbDevices
from abdf1_ros.sniffer.tcp import TcpWay

# A serial port recorded by an RTAC of SEL (link type RTAC_SERIAL): 12 bytes before the data. The
# ninth byte is the event; only the begin and the end of sending or receiving have data.
_RTAC = 250
_RTAC_EVENTS = {1: Direction.OUT, 2: Direction.IN, 3: Direction.OUT, 4: Direction.IN}

_DIRECTIONS = {number: way for way, number in DIRECTIONS.items()}

# Data port of Moxa NPort (TCP server mode) and of Lantronix and Digi, for the first serial port.
DEVICE_SERVERS = frozenset((4001, 2101))
CSP = 2222  # PCCC of older Ethernet processors, in a format of its own
# Number of bytes before an IPv4 header, and the position of its EtherType in them, by link type:
# loopback, Ethernet, raw IP, Linux cooked 1 and 2.
_LINKS = {0: (4, None), 1: (14, 12), 101: (0, None), 113: (16, 14), 276: (20, 0)}
_IP, _TCP = b'\x08\x00', 6
_TAGS = b'\x81\x00', b'\x88\xA8'  # 802.1Q and 802.1ad
_MOST_STREAMS = 1000

_SENDS = EipCommand.SEND_RR_DATA, EipCommand.SEND_UNIT_DATA
_PCCC_OBJECT = b'\x20\x67', b'\x21\x00\x67\x00'  # a path begins with its class


class _Stations(dict[bytes, int]):
    """Station numbers for IP addresses: the last number of the address, or a free number."""

    def __missing__(self, address: bytes) -> int:
        taken = set(self.values())
        free = (number for number in (address[3], *range(254, 0, -1)) if number not in taken)
        return self.setdefault(address, next(free, address[3]))


class _Stream:
    """
    The messages of one direction of a TCP connection, in their order.

    An early segment waits for the segments before it. A segment of whole messages does not wait,
    because its messages must come before their answers. ``asked`` has the TNS of its requests.
    """

    def __init__(self) -> None:
        self.asked: set[bytes] = set()
        self._way = TcpWay()
        self._end = 0  # number of the byte after the last part
        self._waiting = b''
        self._taken: set[int] = set()  # segments of whole messages that came early

    def feed(self, number: int, data: bytes) -> Iterator[bytes]:
        """Take a segment; yield the data of the EtherNet/IP messages that it completes."""
        number &= 0xFFFFFFFF
        if self._way.is_early(number) and number not in self._taken and (
                messages := _whole(data)):
            self._taken.add(number)
            yield from messages
        yield from self._take(self._way.feed(number, data))

    def flush(self) -> Iterator[bytes]:
        """Yield what is complete although bytes before it are missing."""
        while parts := [*self._way.flush()]:
            yield from self._take(parts)

    def _take(self, parts: Iterable[tuple[int, bytes]]) -> Iterator[bytes]:
        for number, data in parts:
            if number != self._end:
                self._waiting = b''
            self._end = number + len(data) & 0xFFFFFFFF
            is_taken = number in self._taken
            self._taken = {each for each in self._taken
                           if each == self._end or self._way.is_early(each)}
            if not is_taken:
                messages, self._waiting = _messages(self._waiting + data)
                yield from _sent(messages)


def _whole(data: bytes) -> list[bytes]:
    """Return the data of the messages of a segment; empty if it has more than whole messages."""
    messages = [*_sent(_messages(data)[0])]
    is_whole = sum(map(len, messages)) == len(data) - HEADER_SIZE * len(messages)
    return messages if is_whole else []


def _messages(data: bytes) -> tuple[list[bytes], bytes]:
    """Return the whole messages that data begins with, and bytes that may begin the next one."""
    found: list[bytes] = []
    while len(data) >= HEADER_SIZE:
        command, size = struct.unpack_from('<HH', data)
        if command not in COMMANDS:
            return found, b''  # not the beginning of a message
        end = HEADER_SIZE + size
        if len(data) < end:
            break
        found.append(data[:end])
        data = data[end:]
    return found, data


def _sent(messages: Iterable[bytes]) -> Iterator[bytes]:
    """Yield the data of messages that contain CIP."""
    return (message[HEADER_SIZE:] for message in messages
            if struct.unpack_from('<H', message)[0] in _SENDS)


class _Connections:
    """The TCP connections of EtherNet/IP, each with two streams."""

    def __init__(self) -> None:
        self._streams: defaultdict[bytes, _Stream] = defaultdict(_Stream)
        self._stations = _Stations()

    def feed(self, ends: bytes, number: int, payload: bytes, time: float | None, *,
             is_first: bool) -> Iterator[Chunk]:
        """Take a segment between these addresses and ports; yield the PCCC that it completes."""
        if is_first and ends in self._streams:  # an earlier connection had the same ports
            yield from self._flush(ends, time)
            del self._streams[ends]
        if len(self._streams) > _MOST_STREAMS:
            self._streams.clear()
        for message in self._streams[ends].feed(number, payload):
            yield from self._chunks(ends, message, time)

    def flush(self, time: float | None) -> Iterator[Chunk]:
        """Yield what is complete although bytes before it are missing."""
        for ends in [*self._streams]:
            yield from self._flush(ends, time)

    def _flush(self, ends: bytes, time: float | None) -> Iterator[Chunk]:
        for message in self._streams[ends].flush():
            yield from self._chunks(ends, message, time)

    def _chunks(self, ends: bytes, message: bytes, time: float | None) -> Iterator[Chunk]:
        way = Direction.OUT if ends[10:12] == PORT.to_bytes(2, 'big') else Direction.IN
        for is_reply, pccc in _pccc(message):
            if not is_reply:
                self._streams[ends].asked.add(pccc[2:4])
            elif pccc[2:4] not in self._streams[_opposite(ends)].asked:
                continue
            ours = bytes((self._stations[ends[4:8]], self._stations[ends[:4]]))
            yield Chunk(time, way, ours + pccc, is_message=True)


def _opposite(ends: bytes) -> bytes:
    return ends[4:8] + ends[:4] + ends[10:] + ends[8:10]


@dataclass(slots=True)
class SeenPackets:
    """
    The TCP ports of packets, and the sizes (bytes) of packets that the recorder has cut.

    ``servers`` are the ports of device servers: what comes from and to them is DF1.
    """

    servers: frozenset[int] = DEVICE_SERVERS
    ports: set[int] = field(default_factory=set)
    cut: list[int] = field(default_factory=list)


def chunks_of(packets: Iterable[RecordedPacket], seen: SeenPackets) -> Iterator[Chunk]:
    """
    Yield the DF1 and PCCC of packets, with times (s) from the first packet on.

    ``seen`` gets the TCP ports, and the sizes of packets that were cut and are not decoded. Raises
    ValueError if the bytes of the line cannot be found.
    """
    connections, servers, usb = _Connections(), DeviceServers(seen.servers), UsbDevices()
    begun: float | None = None
    later: float | None = None
    for time, link_type, data in packets:
        begun = time if begun is None else begun
        later = None if time is None or begun is None else time - begun
        if link_type == LINK_TYPE and data[:1] == bytes((VERSION,)) and len(data) > HEAD_SIZE:
            yield Chunk(later, _DIRECTIONS.get(data[1], Direction.UNKNOWN), data[HEAD_SIZE:])
        elif link_type == _RTAC and len(data) > 12 and data[8] in _RTAC_EVENTS:
            yield Chunk(later, _RTAC_EVENTS[data[8]], data[12:])
        elif link_type in USB_HEADS:
            yield from usb.feed(data, USB_HEADS[link_type], later)
        elif (segment := _tcp(link_type, data)) is not None:
            ends, number, payload, is_first, is_cut = segment
            both = {int.from_bytes(ends[8:10], 'big'), int.from_bytes(ends[10:], 'big')}
            seen.ports |= both
            is_serial = bool(both & seen.servers)
            if is_cut and (PORT in both or is_serial):
                seen.cut.append(len(data))
            elif PORT in both:
                yield from connections.feed(ends, number, payload, later, is_first=is_first)
            elif is_serial:
                yield from servers.feed(ends, number, payload, later, is_first=is_first)
    yield from servers.flush(later)
    yield from connections.flush(later)


def _tcp(link_type: int, data: bytes) -> tuple[bytes, int, bytes, bool, bool] | None:
    """
    Return addresses with ports, sequence number and payload.

    Also return whether the segment begins a connection, and whether it is cut.
    """
    start, kind = _LINKS.get(link_type, (len(data), None))
    if kind is not None:
        while data[kind:kind + 2] in _TAGS:
            start, kind = start + 4, kind + 4
        if data[kind:kind + 2] != _IP:
            return None
    head = data[start:]
    if len(head) < 20 or head[0] >> 4 != 4 or head[9] != _TCP or head[6] & 0x3F or head[7]:
        return None  # also fragments, because EtherNet/IP has none
    size = 4 * (head[0] & 0x0F)
    end = int.from_bytes(head[2:4], 'big')
    segment = head[size:end]
    if len(segment) < 20:
        return None
    ports, number = segment[:4], int.from_bytes(segment[4:8], 'big')
    is_first = bool(segment[13] & 0x02)
    payload = segment[4 * (segment[12] >> 4):]
    return head[12:20] + ports, number + is_first, payload, is_first, len(head) < end


def _pccc(message: bytes) -> Iterator[tuple[bool, bytes]]:
    """Yield, for each Execute PCCC, whether it is a response, and its bytes from CMD on."""
    at = 8
    for _ in range(int.from_bytes(message[6:8], 'little')):
        item, size = int.from_bytes(message[at:at + 2], 'little'), int.from_bytes(
            message[at + 2:at + 4], 'little')
        data, at = message[at + 4:at + 4 + size], at + 4 + size
        if item == EipItem.CONNECTED_DATA:
            data = data[2:]  # after the sequence count
        if item in (EipItem.CONNECTED_DATA, EipItem.UNCONNECTED_DATA):
            found = _executed(data)
            if len(found) >= 4:
                yield bool(data[0] & REPLY), found


def _executed(cip: bytes) -> bytes:
    """Return the PCCC of a CIP request or response; empty if it has none."""
    while len(cip) >= 4 and cip[0] == CipService.UNCONNECTED_SEND:
        body = cip[2 + 2 * cip[1]:]
        cip = body[4:4 + int.from_bytes(body[2:4], 'little')]
    if len(cip) < 4:
        return b''
    if cip[0] == CipService.EXECUTE_PCCC | REPLY:
        body = cip[4 + 2 * cip[3]:]
    else:
        body = cip[2 + 2 * cip[1]:]
        if cip[0] != CipService.EXECUTE_PCCC or not cip[2:].startswith(_PCCC_OBJECT):
            return b''
    return body[body[0]:] if body else b''  # after the requestor, which begins with its length
