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
The bytes of a serial line in recorded packets: of TCP to a device server, and of USB.

USB is recorded by usbmon of Linux (its mon_usb_packet, link types 189 and 220). An adapter of FTDI
begins each packet to the host with two status bytes. Only the descriptors of the device tell
whether it is one, so a recording without them is refused.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
import struct

from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.tcp import TcpWay

USB_HEADS = {189: 48, 220: 64}  # bytes before the data, by link type
_MOST_WAYS = 1000

_CONTROL, _BULK = 2, 3
_GET_DESCRIPTOR = b'\x80\x06'
_DEVICE, _CONFIGURATION, _ENDPOINT = 1, 2, 5
_MOST_ASKED = 100
_FTDI = 0x0403
_STATUS_BYTES = 2
# Packets have 512 bytes on the fast chips (bcdDevice of FT2232H, FT4232H, FT232H), 64 on others.
_FAST, _FAST_SIZE, _SIZE = (0x0700, 0x0800, 0x0900), 512, 64


class DeviceServers:
    """The TCP connections of a device server at one of ``ports``, which is one line."""

    def __init__(self, ports: frozenset[int]) -> None:
        self._ports = ports
        self._ways: defaultdict[bytes, TcpWay] = defaultdict(TcpWay)
        self._server = b''

    def feed(self, ends: bytes, number: int, data: bytes, time: float | None, *,
             is_first: bool) -> Iterator[Chunk]:
        """Take a segment between these addresses and ports; yield the bytes that are in order."""
        if is_first or len(self._ways) > _MOST_WAYS:
            yield from self.flush(time)
            self._ways.clear()
        if data:
            parts = self._ways[ends].feed(number & 0xFFFFFFFF, data)
            yield from self._chunk(ends, _joined(parts), time)

    def flush(self, time: float | None) -> Iterator[Chunk]:
        """Yield the bytes after those that were lost."""
        for ends, way in self._ways.items():
            while data := _joined(way.flush()):
                yield from self._chunk(ends, data, time)

    def _chunk(self, ends: bytes, data: bytes, time: float | None) -> Iterator[Chunk]:
        if not data:
            return
        is_to = int.from_bytes(ends[10:12], 'big') in self._ports
        server = ends[4:8] + ends[10:12] if is_to else ends[:4] + ends[8:10]
        self._server = self._server or server
        if server != self._server:
            raise ValueError(f'device servers {_named(self._server)} and {_named(server)} are two '
                             'lines; keep the packets of one, or choose its port with --tcp')
        yield Chunk(time, Direction.OUT if is_to else Direction.IN, data)


def _joined(parts: Iterable[tuple[int, bytes]]) -> bytes:
    return b''.join(part for _, part in parts)


def _named(server: bytes) -> str:
    return '.'.join(map(str, server[:4])) + f':{int.from_bytes(server[4:], "big")}'


@dataclass(slots=True)
class _Device:
    """A USB device: its maker and version, and the packet sizes of its ends; None if unknown."""

    vendor: int | None = None
    version: int = 0
    sizes: dict[int, int] = field(default_factory=dict)

    def describe(self, data: bytes, kind: int) -> None:
        """Take a descriptor."""
        if kind == _DEVICE and len(data) >= 14:
            self.vendor, _, self.version = struct.unpack_from('<3H', data, 8)
        while kind == _CONFIGURATION and len(data) > 1 and data[0]:
            if data[1] == _ENDPOINT and len(data) > 5:
                self.sizes[data[2]] = int.from_bytes(data[4:6], 'little') & 0x07FF
            data = data[data[0]:]

    def without_status(self, end: int, data: bytes) -> bytes:
        """Return what a device has sent to the host, without the status bytes of FTDI."""
        if self.vendor != _FTDI:
            return data
        size = self.sizes.get(end) or (_FAST_SIZE if self.version in _FAST else _SIZE)
        return b''.join(data[at + _STATUS_BYTES:at + size] for at in range(0, len(data), size))


class UsbDevices:
    """The devices of a recording, of which one is the adapter with the line."""

    def __init__(self) -> None:
        self._devices: defaultdict[tuple[int, int], _Device] = defaultdict(_Device)
        self._asked: dict[bytes, int] = {}  # kinds of descriptors
        self._line: tuple[int, int] | None = None

    def feed(self, packet: bytes, head: int, time: float | None) -> Iterator[Chunk]:
        """Take a packet; yield the bytes of the line."""
        if len(packet) < head:
            return
        urb, event, transfer, end, number, bus = struct.unpack_from('<8s4BH', packet)
        place, data = (bus, number), packet[head:]
        is_in = bool(end & 0x80)
        if transfer == _CONTROL and event == ord('S'):
            if packet[14] == 0 and packet[40:42] == _GET_DESCRIPTOR:
                self._asked[urb] = packet[43]
                if len(self._asked) > _MOST_ASKED:
                    del self._asked[next(iter(self._asked))]
        elif transfer == _CONTROL and event == ord('C'):
            self._devices[place].describe(data, self._asked.pop(urb, 0))
        elif transfer == _BULK and data and event == ord('C' if is_in else 'S'):
            device = self._checked(place)
            data = device.without_status(end, data) if is_in else data
            if data:
                yield Chunk(time, Direction.IN if is_in else Direction.OUT, data)

    def _checked(self, place: tuple[int, int]) -> _Device:
        """Return the device with the line; raise ValueError if it is not known."""
        self._line = self._line or place
        if self._line != place:
            names = [f'{bus}.{number}' for bus, number in (self._line, place)]
            raise ValueError(f'the USB devices {" and ".join(names)} both have bulk data; keep '
                             'the packets of the adapter, as "usb.device_address == N" does')
        device = self._devices[place]
        if device.vendor is None:
            raise ValueError(
                f'USB device {place[0]}.{place[1]}: its descriptors are not in the recording, so '
                'it is not known whether two status bytes of FTDI begin each packet; begin the '
                'recording before you plug the adapter in')
        return device
