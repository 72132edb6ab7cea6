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
Ports for listening only: devices opened for reading, and pairs of such devices.

This module sets no line signal. But the system itself raises RTS and DTR whenever a program opens
a serial port. docs/listening.md says what this means for the cable.
"""

from __future__ import annotations

from collections import Counter
from contextlib import ExitStack
from dataclasses import replace
import errno
import fcntl
import math
import os
import select
import termios

from abdf1_ros.df1.listen import SecondPort
from abdf1_ros.ports.descriptor import Port
from abdf1_ros.ports.ownership import BUSY
from abdf1_ros.ports.serial_device import hold_device, NOT_SERIAL, SerialDevice
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.socket_port import open_port as open_socket

_SIZES = {5: termios.CS5, 6: termios.CS6, 7: termios.CS7, 8: termios.CS8}
_PARITY = termios.PARENB | termios.PARODD
_KEPT = termios.HUPCL  # this flag stays as it was: it drops RTS and DTR when a program ends


class _SilentPort:
    """A port to which no byte is written."""

    def write(self, data: bytes) -> None:
        """Raise OSError: no caller may write to this port."""
        raise OSError(errno.EBADF, 'the bridge only listens to this port')

    def unsent(self) -> int:
        return 0


class ListeningDevice(_SilentPort, SerialDevice):
    """A device that is open for reading only."""


class TwoPorts(_SilentPort):
    """Two ports as one port; bytes of the second port are ``SecondPort``."""

    is_terminal = True
    has_more = False

    def __init__(self, first: ListeningDevice, second: ListeningDevice) -> None:
        self._first, self._second = first, second
        self._poll = select.poll()
        for port in (first, second):
            self._poll.register(port.fileno(), select.POLLIN)
        self._wake = -1

    def read(self, timeout: float | None, wake: int) -> bytes:
        if wake != self._wake:
            self._poll.register(wake, select.POLLIN)
            self._wake = wake
        longest = min(self._first.look(), self._second.look())
        milliseconds = math.ceil(min(longest, longest if timeout is None else timeout) * 1000)
        ready = {port.fileno() for port in (self._first, self._second) if port.has_pieces} or {
            descriptor for descriptor, _ in self._poll.poll(milliseconds)}
        if self._first.fileno() in ready and (data := self._first.read(0, wake)):
            return data
        if self._second.fileno() not in ready:
            return b''
        data = self._second.read(0, wake)
        return SecondPort(data) if type(data) is bytes else data

    def errors(self) -> dict[str, int]:
        counts = Counter(self._first.errors())
        counts.update(self._second.errors())
        return counts

    def close(self) -> None:
        self._first.close()
        self._second.close()


def open_port(settings: PortSettings) -> Port:
    """Open the port, or both ports, for reading only; raises OSError."""
    if '://' in settings.name:
        return open_socket(settings)
    with ExitStack() as stack:
        first = open_device(settings)
        stack.callback(first.close)
        if not settings.second:
            stack.pop_all()
            return first
        pair = TwoPorts(first, open_device(replace(settings, name=settings.second)))
        stack.pop_all()
        return pair


def open_device(settings: PortSettings) -> ListeningDevice:
    """Open a device exclusively, for reading only; raises OSError."""
    def opened(stack: ExitStack) -> int:
        descriptor = os.open(settings.name, os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        stack.callback(os.close, descriptor)
        _set_up(descriptor, settings)
        return descriptor

    return hold_device(settings, opened, ListeningDevice)


def _set_up(descriptor: int, settings: PortSettings) -> None:
    """Keep other programs away, and set speed and character format."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        attributes = termios.tcgetattr(descriptor)
        speed, flags = getattr(termios, f'B{settings.baud}'), _flags(settings)
        termios.tcsetattr(descriptor, termios.TCSANOW, [
            0, 0, attributes[2] & _KEPT | flags, 0, speed, speed, attributes[6]])
        if termios.tcgetattr(descriptor)[2] & _PARITY != flags & _PARITY:
            raise OSError(errno.EINVAL, 'this port has no such parity: Parity None')
        termios.tcflush(descriptor, termios.TCIFLUSH)
    except BlockingIOError as error:
        raise OSError(errno.EBUSY, BUSY) from error
    except (OSError, termios.error) as error:
        number, text = error.args
        raise OSError(number, NOT_SERIAL if number == errno.ENOTTY else text) from None


def _flags(settings: PortSettings) -> int:
    """Return the control flags of a character format, without a handshake."""
    flags = termios.CREAD | termios.CLOCAL | _SIZES[settings.data_bits]
    if settings.stop_bits == 2:
        flags |= termios.CSTOPB
    if settings.parity != 'None':
        flags |= termios.PARENB | (termios.PARODD if settings.parity == 'Odd' else 0)
    return flags
