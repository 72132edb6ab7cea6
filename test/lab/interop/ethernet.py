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
EtherNet/IP and DF1, one put into the other, as far as PCCC needs it.

``serve`` lets clients of an EtherNet/IP processor (pycomm3, libplctag) reach a PLC at the end of
a full-duplex line; ``ask`` lets a client on such a line reach an EtherNet/IP processor. The
application data are the other product's; the frames of the line are ours. Only loopback
addresses, one client at a time.

CIP: a request "Execute PCCC" is service 4B for object 67, instance 1; it begins with the
requestor's identity, which the reply (CB) repeats. It comes unconnected (SendRRData) or on a
connection (SendUnitData), which has to be opened first (Forward Open).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import os
import select
import socket
import struct
import threading
import time
import tty

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, Duplex, Frame, FrameDecoder, message_frame, NAK
from abdf1_ros.df1.packet import Packet

_HEADER = struct.Struct('<HHII8sI')  # command, length, session, status, context, options
_REGISTER, _UNREGISTER, _UNCONNECTED, _CONNECTED = 0x65, 0x66, 0x6F, 0x70
_PCCC, _FORWARD_OPEN, _LARGE_OPEN, _FORWARD_CLOSE = 0x4B, 0x54, 0x5B, 0x4E
_REPLY = 0x80
_NOT_SUPPORTED = 0x08  # general status of CIP
_TO_TARGET = 0x11223344  # our number of a connection
_PCCC_PATH = bytes((2, 0x20, 0x67, 0x24, 1))
_REQUESTOR = bytes((7, 0x3D, 0xF3, 0x45, 0x43, 0x50, 0x21))  # the one that ab_server knows
_SESSION = 1

Execute = Callable[[bytes], bytes]
"""CMD, STS, TNS and data of a command into those of its reply."""


class DuplexLine:
    """A full-duplex DF1 line, one command at a time; TimeoutError where nothing comes."""

    def __init__(self, port: str, check: Checksum, timeout: float = 3.0) -> None:
        self._descriptor = os.open(port, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._descriptor)
        self._check = check
        self._timeout = timeout
        self._decoder = FrameDecoder(check, Duplex.FULL)

    def execute(self, command: bytes, source: int = 0, destination: int = 1) -> bytes:
        """Send CMD, STS, TNS and data; return those of the reply."""
        message = bytes((destination, source)) + command
        os.write(self._descriptor, message_frame(message, self._check))
        while True:
            packet = self.receive(time.monotonic() + self._timeout)
            if packet is not None and packet.encode()[4:6] == message[4:6] and packet.is_reply:
                return packet.encode()[2:]

    def receive(self, end: float) -> Packet | None:
        """
        Return the next message, acknowledged; TimeoutError at ``end``.

        None stands for a symbol, or a damaged message, which is refused with NAK.
        """
        while (symbol := self._decoder.next_symbol()) is None:
            seconds = end - time.monotonic()
            if seconds <= 0 or not select.select([self._descriptor], [], [], seconds)[0]:
                raise TimeoutError('nothing comes')
            self._decoder.feed(os.read(self._descriptor, 4096))
        if isinstance(symbol, Frame):
            os.write(self._descriptor, ACK if symbol.fault is None else NAK)
            return Packet.decode(symbol.data) if symbol.fault is None else None
        return None

    def reply(self, packet: Packet) -> None:
        """Send a message."""
        os.write(self._descriptor, message_frame(packet.encode(), self._check))

    def close(self) -> None:
        """Close the port."""
        os.close(self._descriptor)


def serve(listening: socket.socket, execute: Execute) -> None:
    """Answer the clients of a listening socket, one after the other, until it is closed."""
    while True:
        try:
            connection, _ = listening.accept()
        except OSError:
            return
        with connection:
            connection.settimeout(60)
            try:
                _Client(connection, execute).run()
            except (ConnectionError, TimeoutError, EOFError):
                pass


@dataclass(slots=True)
class _Client:
    """One EtherNet/IP client."""

    connection: socket.socket
    execute: Execute
    to_client: int = 0  # the client's number of the connection

    def run(self) -> None:
        """Answer until it goes."""
        while True:
            command, length, _, _, context, _ = _HEADER.unpack(self._exactly(_HEADER.size))
            data = self._exactly(length)
            if command == _UNREGISTER:
                return
            if command == _REGISTER:
                answer = data
            elif command in (_UNCONNECTED, _CONNECTED):
                answer = self._encapsulated(data)
            else:
                answer = b''
            status = 0 if answer else 1  # 1: the command is not supported
            self.connection.sendall(_HEADER.pack(
                command, len(answer), _SESSION, status, context, 0) + answer)

    def _exactly(self, count: int) -> bytes:
        data = b''
        while len(data) < count:
            part = self.connection.recv(count - len(data))
            if not part:
                raise EOFError
            data += part
        return data

    def _encapsulated(self, data: bytes) -> bytes:
        """Answer the two items of a CPF: address, then data."""
        kind, size = struct.unpack_from('<HH', data, 8)
        request = data[8 + 4 + size + 4:]
        if kind == 0:  # no connection
            answer = self._service(request)
            return data[:8] + struct.pack('<HHHH', 0, 0, 0xB2, len(answer)) + answer
        answer = request[:2] + self._service(request[2:])  # with its sequence number
        return data[:8] + struct.pack(
            '<HHIHH', 0xA1, 4, self.to_client, 0xB1, len(answer)) + answer

    def _service(self, request: bytes) -> bytes:
        service, path_words = request[0], request[1]
        data = request[2 + 2 * path_words:]
        if service == _PCCC:
            identity = data[:data[0]]
            return bytes((_PCCC | _REPLY, 0, 0, 0)) + identity + self.execute(
                data[len(identity):])
        if service in (_FORWARD_OPEN, _LARGE_OPEN):
            self.to_client, = struct.unpack_from('<I', data, 6)
            interval = struct.pack('<I', 2_000_000)  # microseconds
            return bytes((service | _REPLY, 0, 0, 0)) + struct.pack(
                '<I', _TO_TARGET) + data[6:10] + data[10:18] + interval * 2 + b'\0\0'
        if service == _FORWARD_CLOSE:
            return bytes((service | _REPLY, 0, 0, 0)) + data[2:10] + b'\0\0'
        return bytes((service | _REPLY, 0, _NOT_SUPPORTED, 0))


class EthernetPlc:
    """A processor that is reached over EtherNet/IP."""

    def __init__(self, host: str, port: int) -> None:
        self._lock = threading.Lock()
        self._connection = socket.create_connection((host, port), timeout=3)
        _, answer = self._ask(_REGISTER, bytes((1, 0, 0, 0)), 0)
        self._session = answer

    def execute(self, command: bytes) -> bytes:
        """Send CMD, STS, TNS and data; return those of the reply."""
        request = bytes((_PCCC,)) + _PCCC_PATH + _REQUESTOR + command
        body = struct.pack('<IHHHHHH', 0, 5, 2, 0, 0, 0xB2, len(request)) + request
        with self._lock:
            data, _ = self._ask(_UNCONNECTED, body, self._session)
        reply = data[16:]
        if reply[0] != _PCCC | _REPLY or reply[2]:
            # CIP refuses it; ab_server answers a command that it finds too short with less.
            return bytes((command[0] | 0x40, 0x10)) + command[2:4]
        return reply[4 + len(_REQUESTOR):]

    def _ask(self, command: int, data: bytes, session: int) -> tuple[bytes, int]:
        self._connection.sendall(
            _HEADER.pack(command, len(data), session, 0, bytes(8), 0) + data)
        head = self._exactly(_HEADER.size)
        _, length, answered, status, _, _ = _HEADER.unpack(head)
        if status:
            raise OSError(f'encapsulation status {status}')
        return self._exactly(length), answered

    def _exactly(self, count: int) -> bytes:
        data = b''
        while len(data) < count:
            part = self._connection.recv(count - len(data))
            if not part:
                raise EOFError
            data += part
        return data

    def close(self) -> None:
        """End it."""
        self._connection.close()


def ask(line: DuplexLine, execute: Execute, is_ended: Callable[[], bool]) -> None:
    """Answer what comes on the line by asking an EtherNet/IP processor, until ``is_ended``."""
    while not is_ended():
        try:
            packet = line.receive(time.monotonic() + 0.1)
        except TimeoutError:
            continue
        if packet is None or packet.is_reply:
            continue
        command = packet.encode()
        answer = bytes((command[1], command[0])) + execute(command[2:])
        line.reply(Packet.decode(answer))
