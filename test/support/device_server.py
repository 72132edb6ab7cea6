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

"""A serial device server for rfc2217:// URLs, whose line gives back what is sent."""

from __future__ import annotations

from contextlib import suppress
import os
import socket
import threading

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
