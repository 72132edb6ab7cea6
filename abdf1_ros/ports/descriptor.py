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
Ports with a file descriptor: serial device, pseudo-terminal, or network connection.

They are read with poll(2) and read(2). This costs a half to a tenth of a read by pyserial.
"""

from __future__ import annotations

from collections.abc import Callable
import fcntl
import math
import os
import select
import struct
import termios
import time
from typing import Protocol

_INT = struct.Struct('i')

READ_SIZE = 512
"""Most bytes of one read. Fewer bytes arrive while the thread of a line sleeps."""

WRITE_TIMEOUT = 2.0
NO_DATA_TAKEN = 'the line takes no data; is Handshake right?'


class NoClient(OSError):
    """Our end of a line exists, but no program has opened the far end."""

    def __str__(self) -> str:
        """Return this text for every such error."""
        return 'waiting for a client'


class Port(Protocol):
    """
    An open line. Every method raises OSError when the line is gone.

    ``has_more`` tells that the last ``read`` may have left bytes unread. A port that
    ``is_terminal`` is a device of this machine, not a connection.
    """

    @property
    def has_more(self) -> bool: ...

    @property
    def is_terminal(self) -> bool: ...

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Wait for bytes up to ``timeout`` s, or until the descriptor ``wake`` is readable."""

    def write(self, data: bytes) -> None:
        """Hand all of ``data`` to the operating system."""

    def unsent(self) -> int:
        """Return how many written bytes have not been sent yet, 0 if unknown."""

    def errors(self) -> dict[str, int]:
        """Return the error counts of the UART since the port was opened; empty if it has none."""

    def close(self) -> None:
        """Close the port, so that other programs may open it."""


class PortAround:
    """A port that changes or watches the bytes of another port."""

    def __init__(self, port: Port) -> None:
        self._port = port

    @property
    def has_more(self) -> bool:
        return self._port.has_more

    @property
    def is_terminal(self) -> bool:
        return self._port.is_terminal

    def read(self, timeout: float | None, wake: int) -> bytes:
        return self._port.read(timeout, wake)

    def write(self, data: bytes) -> None:
        self._port.write(data)

    def unsent(self) -> int:
        return self._port.unsent()

    def errors(self) -> dict[str, int]:
        return self._port.errors()

    def close(self) -> None:
        self._port.close()


class DescriptorPort:
    """A port with a file descriptor, which is set to non-blocking; ``close`` closes it."""

    no_bytes = 'the other end has closed the connection'  # why none come though the port is ready

    def __init__(self, descriptor: int, close: Callable[[], None]) -> None:
        self._descriptor = descriptor
        self._close = close
        self.has_more = False
        self.is_terminal = os.isatty(descriptor)
        self._poll = select.poll()
        self._poll.register(descriptor, select.POLLIN)
        self._wake = -1
        os.set_blocking(descriptor, False)

    def read(self, timeout: float | None, wake: int) -> bytes:
        self.has_more = False
        if wake != self._wake:
            self._poll.register(wake, select.POLLIN)
            self._wake = wake
        milliseconds = None if timeout is None else math.ceil(timeout * 1000)
        for descriptor, _ in self._poll.poll(milliseconds):
            if descriptor == self._descriptor:
                return self._take()
        return b''

    def _take(self) -> bytes:
        """Read the bytes that have come."""
        try:
            data = os.read(self._descriptor, READ_SIZE)
        except BlockingIOError:
            return b''
        self.has_more = len(data) == READ_SIZE
        if not data:
            raise OSError(self.no_bytes)
        return data

    def fileno(self) -> int:
        return self._descriptor

    def write(self, data: bytes) -> None:
        give_up = math.inf
        while data:
            try:
                data = data[os.write(self._descriptor, data):]
            except BlockingIOError:
                give_up = min(give_up, time.monotonic() + WRITE_TIMEOUT)
                poll = select.poll()
                poll.register(self._descriptor, select.POLLOUT)
                left = give_up - time.monotonic()
                if left <= 0:
                    raise OSError(NO_DATA_TAKEN) from None
                poll.poll(math.ceil(left * 1000))

    def errors(self) -> dict[str, int]:
        return {}

    def unsent(self) -> int:
        """Return how many bytes the operating system still has."""
        try:
            answer = fcntl.ioctl(self._descriptor, termios.TIOCOUTQ, bytes(_INT.size))
        except OSError:  # the driver of this device has no such request
            return 0
        count: int = _INT.unpack(answer)[0]
        return count

    def close(self) -> None:
        self._close()
