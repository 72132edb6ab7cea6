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
Serial device servers for rfc2217:// URLs.

The line of ``DeviceServer`` gives back what is sent; ``LineServer`` has a port for its line.
"""

from __future__ import annotations

from contextlib import suppress
import os
from pathlib import Path
import select
import socket
import threading

from abdf1_ros.ports.descriptor import DescriptorPort
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
import serial
import serial.rfc2217

# Of this process: a port that is free here stays so until we take it, or take it again.
OWN_HOST = f'127.1.{os.getpid() >> 8 & 255}.{os.getpid() & 255 or 255}'


class DeviceServer:
    """One connection on 127.0.0.1; ``port`` is where, ``connection`` our end of it."""

    def __init__(self) -> None:
        self._listener = socket.create_server(('127.0.0.1', 0))
        self.port: int = self._listener.getsockname()[1]
        self.connection: socket.socket
        self._line = serial.serial_for_url('loop://', timeout=0.01)
        self._lock = threading.Lock()
        self._is_open = True
        self._threads = [threading.Thread(target=self._serve)]

    @property
    def baud(self) -> int:
        """Return the speed that the client has asked for."""
        return int(self._line.baudrate)

    def __enter__(self) -> DeviceServer:
        """Wait for the client, in a thread."""
        self._threads[0].start()
        return self

    def __exit__(self, *error: object) -> None:
        """Hang up."""
        self._is_open = False
        self._listener.close()
        for thread in self._threads:
            thread.join()

    def write(self, data: bytes) -> None:
        """Send to the client; what ``PortManager`` answers comes this way too."""
        with self._lock, suppress(OSError):  # it has gone, and the next turn finds that out
            self.connection.sendall(data)

    def _serve(self) -> None:
        self.connection, _ = self._listener.accept()
        with self.connection:
            self.connection.settimeout(0.01)
            manager = serial.rfc2217.PortManager(self._line, self)
            while self._is_open:
                try:
                    data = self.connection.recv(1024)
                except TimeoutError:
                    data = None
                if data == b'':
                    return
                self._line.write(b''.join(manager.filter(data or b'')))
                back = self._line.read(self._line.in_waiting)
                if back:
                    self.write(b''.join(manager.escape(back)))


_TURN = 0.01  # s; so long the server listens before it looks at what it has been told


class LineServer:
    """
    A device server on 127.0.0.1 with one client at a time, for the port ``line``.

    ``start`` and ``stop`` are its power switch; it comes back with the same ``url``.
    """

    def __init__(self, line: Path) -> None:
        self._line_name = str(line)
        self._port = 0
        self._line: DescriptorPort
        self._listener: socket.socket
        self._client: socket.socket | None = None
        self._manager: serial.rfc2217.PortManager
        self._thread: threading.Thread | None = None

    @property
    def url(self) -> str:
        """Return what the node calls its port."""
        return f'rfc2217://127.0.0.1:{self._port}'

    def __enter__(self) -> LineServer:
        line = open_port(PortSettings(self._line_name))
        assert isinstance(line, DescriptorPort)
        self._line = line
        self.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.stop()
        self._line.close()

    def start(self) -> None:
        """Be there."""
        self._listener = socket.create_server(('127.0.0.1', self._port))
        self._port = self._listener.getsockname()[1]
        self._thread = threading.Thread(target=self._run, name='device server')
        self._is_working = True
        self._thread.start()

    def stop(self) -> None:
        """Go away, with all connections."""
        thread, self._thread = self._thread, None
        if thread is not None:
            self._is_working = False
            thread.join()

    def write(self, data: bytes) -> None:
        """Send to the client; what ``PortManager`` answers comes this way too."""
        if self._client is not None:
            with suppress(OSError):  # it has gone, and the next turn finds that out
                self._client.sendall(data)

    def _run(self) -> None:
        with self._listener:
            while self._is_working:
                self._turn()
            self._drop_client()

    def _turn(self) -> None:
        near = self._listener if self._client is None else self._client
        ready = select.select([near, self._line], [], [], _TURN)[0]
        if self._line in ready:
            self._take_from_line()
        if self._listener in ready:
            self._accept()
        elif near in ready:
            self._take_from_client()

    def _accept(self) -> None:
        self._client = self._listener.accept()[0]
        self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        # It keeps the settings that are asked for; a pseudo-terminal has no modem lines.
        self._manager = serial.rfc2217.PortManager(serial.serial_for_url('loop://'), self)

    def _take_from_line(self) -> None:
        data = b''
        with suppress(OSError):  # the PLC has ended
            data = os.read(self._line.fileno(), 1024)
        if data and self._client is not None:
            self.write(b''.join(self._manager.escape(data)))

    def _take_from_client(self) -> None:
        assert self._client is not None
        data = b''
        with suppress(OSError):
            data = self._client.recv(1024)
        if data:
            self._tell_line(b''.join(self._manager.filter(data)))
        else:
            self._drop_client()

    def _tell_line(self, data: bytes) -> None:
        with suppress(OSError):
            self._line.write(data)

    def _drop_client(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()
