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
A device server whose second client has to wait, while the server keeps what it sends.

Some terminal servers answer so: the connection stands at once, and all that came on it goes to
the line when the first client has gone. Nothing here shares code with the package.
"""

from __future__ import annotations

from contextlib import suppress
import socket
import threading
import time

from support.odd_device import OddDevice, Wiring


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
