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
Serial device servers.

One for rfc2217:// URLs, whose line gives back what is sent. The other has a second client that has
to wait, while the server keeps what it sends; some terminal servers answer so. The connection
stands at once, and all that came on it goes to the line when the first client has gone. It shares
no code with the package.
"""

from __future__ import annotations

from contextlib import suppress
import os
import socket
import threading
import time

import serial
import serial.rfc2217
from support.odd_device import OddDevice, Wiring

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
            manager = serial.rfc2217.PortManager(self._line, self)  # type: ignore[arg-type]
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


class QueueingServer:
    """One client, in front of ``device``; it waits until ``take_over``."""

    def __init__(self, *, waits: bool = True) -> None:
        self.device = OddDevice(Wiring.FULL)
        self.stored = b''
        self._waits = waits
        self._listening = socket.create_server(('127.0.0.1', 0))
        self._lock = threading.Lock()
        self._client: socket.socket | None = None
        self.url = f'socket://127.0.0.1:{self._listening.getsockname()[1]}'
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        while True:
            try:
                client, _ = self._listening.accept()
            except OSError:
                return
            with client, suppress(OSError):  # it may go at any time
                self._client = client
                while data := client.recv(4096):
                    with self._lock:
                        self._pass_on(data)

    def _pass_on(self, data: bytes) -> None:
        if self._waits:
            self.stored += data
        else:
            self.device.receive_data(data, time.monotonic())
            if self._client is not None:
                self._client.sendall(self.device.data_to_send())

    def take_over(self) -> None:
        """Give the client the line, and first all that it has sent before."""
        with self._lock:
            stored, self.stored, self._waits = self.stored, b'', False
            self._pass_on(stored)

    def block(self) -> None:
        """Keep what comes from now on, as while another client has the line."""
        with self._lock:
            self._waits = True

    def written(self) -> list[int]:
        """Return the words that writes of one word have brought to the device, in order."""
        with self._lock:
            return [int.from_bytes(data[-2:], 'little') for data in self.device.executed
                    if data[6:7] == b'\xAA']

    def close(self) -> None:
        """End."""
        for end in (self._listening, self._client):
            if end is not None:
                with suppress(OSError):  # it has gone
                    end.shutdown(socket.SHUT_RDWR)
        self._thread.join(5.0)
        self._listening.close()
