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
Serial ports of device servers, over plain TCP: ``socket://host:port``.

If a network is interrupted, a server may never learn that a connection has ended. If it accepts
only one client, it then refuses all other clients, for ever if it has no timer. So a process
connects again from the local port that it had before. The server then asks about its old
connection. Our host answers that there is none, and the port of the server is free (RFC 9293,
section 3.5.2).
"""

from __future__ import annotations

import errno
import re
import socket
from urllib.parse import urlsplit

from abdf1_ros.ports.descriptor import DescriptorPort
from abdf1_ros.ports.ownership import OwnedConnection
from abdf1_ros.ports.repeated_ends import has_often_ended, OFTEN
from abdf1_ros.ports.settings import PortSettings

# An attempt to connect ends after this time (s), so that we soon notice a repaired network.
_CONNECT_TIMEOUT = 1.0

# Seconds without an answer from the far host after which a TCP connection counts as lost. The
# limit of the operating system is a quarter of an hour.
_SILENCE_LIMIT = 5

# Errors if we cannot have the same local port: another program has it, or it is not yet free.
_LOCAL_PORT_TAKEN = (errno.EADDRINUSE, errno.EADDRNOTAVAIL)

# Our port of the last connection to each far address.
_local_ports: dict[tuple[object, ...], int] = {}

_ENDS_CAUSE = (
    f'{OFTEN}: another client has this line, or takes it '
    'each time (then let the device server refuse a second client), or the inactivity time of the '
    'server is too short')

# Bytes of a connection that may be a text of the server.
_LEAST_TEXT, _LONGEST_TEXT = 5, 200

# How a telnet server begins: IAC, WILL to DONT, and the number of an option (RFC 854).
_NEGOTIATION = re.compile(b'\xFF[\xFB-\xFE][\0-\x31]')
_TELNET = ('the port of the device server is a telnet port (its first bytes are %s), which '
           'doubles each byte FF: set it to raw TCP, or write rfc2217:// if the server has '
           'RFC 2217')


class ServerPort(DescriptorPort):
    """A port of a device server; its error names the cause if connections end repeatedly."""

    def __init__(self, connection: socket.socket, url: str) -> None:
        super().__init__(connection.fileno(), connection.close)
        self._url = url

    def _take(self) -> bytes:
        try:
            return super()._take()
        except OSError as error:
            raise self._ended(error) from None

    def write(self, data: bytes) -> None:
        try:
            super().write(data)
        except (ConnectionResetError, BrokenPipeError) as error:
            raise self._ended(error) from None

    def _ended(self, error: OSError) -> OSError:
        """Record the end of a connection; return the error, with the cause if it is known."""
        if not has_often_ended(self._url) or error.errno == errno.ETIMEDOUT:
            return error
        return OSError(f'{error.strerror or error}, {_ENDS_CAUSE}')


class RawPort(ServerPort):
    """
    A port of raw TCP; it is lost if the server begins with a negotiation of telnet.

    If all that came on a connection is a short text, such as "Port already in use", the error at
    its end has this text.
    """

    _said = b''

    def _take(self) -> bytes:
        data = super()._take()
        if not self._said and (found := _NEGOTIATION.match(data)):
            raise OSError(_TELNET % found[0].hex(' ').upper())
        self._said += data[:_LONGEST_TEXT + 1 - len(self._said)]
        return data

    def _ended(self, error: OSError) -> OSError:
        error = super()._ended(error)
        text = self._said.decode('latin-1').strip()
        is_text = text.isascii() and text.isprintable()
        if not is_text or len(text) < _LEAST_TEXT or len(self._said) > _LONGEST_TEXT:
            return error
        return OSError(f'{error.strerror or error}; it said "{text}"')


def open_port(settings: PortSettings) -> DescriptorPort:
    """Connect to a device server; raises OSError."""
    return RawPort(connected(settings.name), settings.name)


def connected(url: str) -> socket.socket:
    """Return a connection to the host and port of a URL; raises OSError."""
    parts = urlsplit(url)
    try:
        found = socket.getaddrinfo(parts.hostname, parts.port, type=socket.SOCK_STREAM)
    except UnicodeError:
        raise OSError(f'{parts.hostname} is not the name of a host') from None
    errors = []
    for family, _, _, _, address in found:
        try:
            return _connection(family, address)
        except OSError as error:
            errors.append(error)
    raise errors[-1]


def _connection(family: int, address: tuple[object, ...]) -> socket.socket:
    """Connect, from the local port of the last connection to this address if there was one."""
    local = _local_ports.get(address, 0)
    try:
        connection = _connection_from(local, family, address)
    except OSError as error:
        if not local or error.errno not in _LOCAL_PORT_TAKEN:
            raise
        connection = _connection_from(0, family, address)
    _local_ports[address] = connection.getsockname()[1]
    return connection


def _connection_from(local: int, family: int, address: tuple[object, ...]) -> socket.socket:
    """Connect from a local port; with 0, the system chooses the port."""
    connection = OwnedConnection(family, address)
    try:
        if local:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            connection.bind(('', local))
        connection.settimeout(_CONNECT_TIMEOUT)
        connection.connect(address)
        # Without TCP_NODELAY, a short frame waits until TCP has acknowledged the frame before it.
        # TCP_USER_TIMEOUT is for bytes that we send. The KEEP options are for a line on which we
        # only listen.
        for option, value in (
                (socket.TCP_NODELAY, 1), (socket.TCP_KEEPIDLE, _SILENCE_LIMIT),
                (socket.TCP_KEEPINTVL, 1), (socket.TCP_USER_TIMEOUT, _SILENCE_LIMIT * 1000)):
            connection.setsockopt(socket.IPPROTO_TCP, option, value)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    except OSError:
        connection.close()
        raise
    return connection
