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
EtherNet/IP byte by byte, for tests: what a client sends, and what it hears.

Nothing here comes from the package: a mistake there would not show in a far end that shares it.
"""

from __future__ import annotations

import json
from pathlib import Path
import socket
import struct
from typing import NamedTuple

_VECTORS = Path(__file__).resolve().parent.parent / 'vectors' / 'ethernet_ip.json'
_HEADER = struct.Struct('<HHII8sI')
CONTEXT = b'\x01who\xff\x00\x7f2'
REQUESTOR = bytes.fromhex('07 4D 00 78 56 34 12')
TO_PCCC = bytes.fromhex('02 20 67 24 01')
MANAGER = bytes.fromhex('02 20 06 24 01')
KEY = bytes.fromhex('34 12 4D 00 78 56 34 12')  # of a connection: serial, vendor, client


class Heard(NamedTuple):
    """A message as it lies on the connection."""

    command: int
    session: int
    status: int
    context: bytes
    data: bytes

    @property
    def cip(self) -> bytes:
        """Return the second item; on a connection it begins with the sequence count."""
        first, = struct.unpack_from('<H', self.data, 10)
        size, = struct.unpack_from('<H', self.data, 14 + first)
        told = self.data[16 + first:]
        assert len(told) == size
        return told


def message(command: int, data: bytes = b'', session: int = 0, *, context: bytes = CONTEXT,
            status: int = 0, options: int = 0, length: int | None = None) -> bytes:
    """Return a message."""
    size = len(data) if length is None else length
    return _HEADER.pack(command, size, session, status, context, options) + data


def heard(data: bytes) -> list[Heard]:
    """Return whole messages."""
    found = []
    while data:
        command, length, session, status, context, options = _HEADER.unpack_from(data)
        assert options == 0 and len(data) >= 24 + length
        found.append(Heard(command, session, status, context, data[24:24 + length]))
        data = data[24 + length:]
    return found


def recorded() -> dict[str, list[list[bytes]]]:
    """Return what clients of others have sent: by client, its connections and their segments."""
    clients = json.loads(_VECTORS.read_text('utf-8'))['clients']
    return {name: [[bytes.fromhex(segment) for segment in segments] for segments in connections]
            for name, connections in clients.items()}


REGISTER = message(0x65, bytes((1, 0, 0, 0)))


def unconnected(cip: bytes, session: int, seconds: int = 0, context: bytes = CONTEXT) -> bytes:
    """Return SendRRData with a request."""
    return message(0x6F, struct.pack('<IHHHHHH', 0, seconds, 2, 0, 0, 0xB2, len(cip)) + cip,
                   session, context=context)


def connected(cip: bytes, session: int, connection: int, count: int) -> bytes:
    """Return SendUnitData with a request."""
    return message(0x70, struct.pack('<IHHHHIHHH', 0, 0, 2, 0xA1, 4, connection, 0xB1,
                                     len(cip) + 2, count) + cip, session)


def execute(pccc: bytes, requestor: bytes = REQUESTOR) -> bytes:
    """Return Execute PCCC."""
    return b'\x4B' + TO_PCCC + requestor + pccc


def routed(cip: bytes, route: bytes = b'', ticks: bytes = bytes((10, 9))) -> bytes:
    """Return Unconnected Send around a request."""
    return b''.join((b'\x52', MANAGER, ticks, struct.pack('<H', len(cip)), cip,
                     bytes(len(cip) % 2), bytes((len(route) // 2, 0)), route))


def forward_open(path: bytes = bytes.fromhex('20 02 24 01'), *, key: bytes = KEY,
                 is_large: bool = False, interval: int = 1_000_000, multiplier: int = 0,
                 transport: int = 0xA3, size: int = 500, kind: int = 2) -> bytes:
    """Return Forward Open."""
    direction = struct.pack('<IH', interval, kind << 13 | size)
    if is_large:
        direction = struct.pack('<II', interval, kind << 29 | size)
    return b''.join((
        b'\x5B' if is_large else b'\x54', MANAGER, bytes((10, 14)), bytes(4),
        bytes.fromhex('EF BE AD DE'), key, bytes((multiplier, 0, 0, 0)), direction, direction,
        bytes((transport, len(path) // 2)), path))


def forward_close(key: bytes = KEY, path: bytes = bytes.fromhex('20 02 24 01')) -> bytes:
    """Return Forward Close."""
    return b'\x4E' + MANAGER + bytes((10, 14)) + key + bytes((len(path) // 2, 0)) + path


class EthernetClient:
    """A client on a socket, registered; it sends PCCC commands (from CMD on) and hears replies."""

    def __init__(self, host: str, port: int, *, is_connected: bool = False) -> None:
        self._socket = socket.create_connection((host, port), timeout=30.0)
        self._count = 0
        self.connection = 0
        self.session = 0
        self.session = self.ask(REGISTER).session
        if is_connected:
            told = self.ask(unconnected(forward_open(), self.session)).cip
            assert told[:4] == bytes((0xD4, 0, 0, 0))
            self.connection, = struct.unpack_from('<I', told, 4)

    def ask(self, data: bytes) -> Heard:
        """Send bytes; return the next message."""
        self.send(data)
        return self.hear()

    def send(self, data: bytes) -> None:
        """Send bytes."""
        self._socket.sendall(data)

    def hear(self) -> Heard:
        """Return the next message; EOFError if the other end has closed."""
        head = self._exactly(24)
        return heard(head + self._exactly(int.from_bytes(head[2:4], 'little')))[0]

    def _exactly(self, size: int) -> bytes:
        data = b''
        while len(data) < size:
            part = self._socket.recv(size - len(data))
            if not part:
                raise EOFError
            data += part
        return data

    def execute(self, pccc: bytes) -> bytes:
        """Send a command; return its reply, both from CMD on."""
        if not self.connection:
            told = self.ask(unconnected(execute(pccc), self.session)).cip
        else:
            self._count += 1
            told = self.ask(connected(
                execute(pccc), self.session, self.connection, self._count)).cip
            assert told[:2] == self._count.to_bytes(2, 'little')
            told = told[2:]
        assert told[:4 + len(REQUESTOR)] == bytes((0xCB, 0, 0, 0)) + REQUESTOR
        return told[4 + len(REQUESTOR):]

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def __enter__(self) -> EthernetClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
