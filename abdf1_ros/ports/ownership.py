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
One owner for each line: which port a name means, and whether a program of this host has it.

The system reserves a device for the program that has opened it. Devices and ports of device
servers are also reserved by a name in the abstract namespace of Unix sockets. Such a name needs no
file, counts for all users, and ends with its process.
"""

from __future__ import annotations

import errno
from hashlib import sha256
import socket
from typing import Any, ClassVar
from urllib.parse import urlsplit
from weakref import WeakValueDictionary

from abdf1_ros.line_names import address_of, device_of, LOOPBACK

BUSY = 'another program has it open'
_OURS = 'this program has it open, or has not ended its last attempt to connect'

_LOCK = '\0abdf1_ros.port.'


def line_of(port: str) -> str:
    """
    Return the same text for all names of one port, if no name server is needed for it.

    The text is the number of a device, or address and port of a device server for any scheme.
    """
    if '://' in port:
        url = urlsplit(port)
        return address_of(_number_of(url.hostname or ''), url.port or 0)
    return device_of(port)


def _number_of(host: str) -> str:
    """Return the address of a host if it follows from the name alone, otherwise the name."""
    try:
        found = socket.getaddrinfo(host, None, flags=socket.AI_NUMERICHOST)
    except (OSError, UnicodeError):  # a name with an empty or a long part has no address
        return LOOPBACK if host == 'localhost' else host
    return str(found[0][4][0])


def own(name: str) -> socket.socket:
    """Reserve a line until the socket is closed; raise OSError if a process has it already."""
    lock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        lock.bind(_LOCK + sha256(name.encode()).hexdigest())  # a path may be too long for a name
    except OSError:
        lock.close()
        raise OSError(errno.EBUSY, BUSY) from None
    return lock


class OwnedConnection(socket.socket):
    """A TCP connection to a device server's port, which is ours until it is closed."""

    _locks: ClassVar[WeakValueDictionary[str, socket.socket]] = WeakValueDictionary()

    def __init__(self, family: int, address: tuple[Any, ...]) -> None:
        """Reserve the port; raise OSError if this or another program of this host has it."""
        super().__init__(family, socket.SOCK_STREAM)
        name = address_of(*address[:2])
        try:
            self._lock = self._locks[name] = own(name)
        except OSError as error:
            super().close()
            ours = self._locks.get(name)
            if ours is not None and ours.fileno() >= 0:
                error.strerror = _OURS
            raise

    def close(self) -> None:
        super().close()
        self._lock.close()
