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
Serial ports of device servers, ``rfc2217://host:port``.

RFC 2217 sets speed and character format of the far port by telnet options (RFC 854, 856 and 858).
This is a client for one connection. It never keeps more than 300 bytes of an incomplete command,
even if the server goes on sending.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
import math
import socket
import struct
import time

from abdf1_ros.ports.descriptor import DescriptorPort
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.socket_port import connected, ServerPort

NEGOTIATION_TIMEOUT = 3.0


class _Telnet(IntEnum):
    """Commands after IAC (RFC 854)."""

    SE = 240
    SB = 250
    WILL = 251
    WONT = 252
    DO = 253
    DONT = 254
    IAC = 255


class _Option(IntEnum):
    """Telnet options that we use."""

    BINARY = 0
    SUPPRESS_GO_AHEAD = 3
    COM_PORT = 44


class _Com(IntEnum):
    """Commands of the COM-PORT option (RFC 2217); the server answers with 100 more."""

    SET_BAUDRATE = 1
    SET_DATASIZE = 2
    SET_PARITY = 3
    SET_STOPSIZE = 4
    SET_CONTROL = 5
    PURGE_DATA = 12


_ANSWER = 100
_PARITIES = {'None': 1, 'Odd': 2, 'Even': 3}
_NO_FLOW_CONTROL, _HARDWARE_FLOW_CONTROL = 1, 3
_DTR_ON, _RTS_ON = 8, 11
_PURGE_BOTH = 3

_IAC = bytes([_Telnet.IAC])
_NEGOTIATIONS = (_Telnet.WILL, _Telnet.WONT, _Telnet.DO, _Telnet.DONT)

# Most bytes of a suboption. Those of RFC 2217 have at most 6 bytes, except a signature.
_MOST_SUBOPTION = 300


def open_port(settings: PortSettings) -> DescriptorPort:
    """Connect to a device server and set its serial port; raises OSError."""
    connection = connected(settings.name)
    port = Rfc2217Port(connection, settings.name)
    try:
        port.negotiate(settings)
    except OSError:
        port.close()
        raise
    return port


class Rfc2217Port(ServerPort):
    """The port of a device server; call ``negotiate`` first, which sets speed and format."""

    def __init__(self, connection: socket.socket, url: str) -> None:
        super().__init__(connection, url)
        self._offered = {_Option.COM_PORT, _Option.BINARY, _Option.SUPPRESS_GO_AHEAD}
        self._asked = set(self._offered)
        self._is_accepted = False
        self._answers: dict[int, bytes] = {}
        self._left = b''  # the beginning of an incomplete command

    def negotiate(self, settings: PortSettings) -> None:
        """Set speed and format, in two steps of at most 3 s; raise OSError if a step fails."""
        for option in sorted(self._offered):
            self._send(_Telnet.WILL, option)
        for option in sorted(self._asked):
            self._send(_Telnet.DO, option)
        self._wait(lambda: self._is_accepted, 'the other end does not speak RFC 2217', (
            'the other end is silent: another host may have its port, or it does not speak RFC '
            '2217'))
        wanted = {
            _Com.SET_BAUDRATE: struct.pack('!I', settings.baud),
            _Com.SET_DATASIZE: bytes([settings.data_bits]),
            _Com.SET_PARITY: bytes([_PARITIES[settings.parity]]),
            _Com.SET_STOPSIZE: bytes([settings.stop_bits])}
        for command, value in wanted.items():
            self._command(command, value)
        flow = _HARDWARE_FLOW_CONTROL if settings.handshake else _NO_FLOW_CONTROL
        lines = (flow, _DTR_ON) if settings.handshake else (flow, _DTR_ON, _RTS_ON)
        for line in lines:  # not every server answers to these
            self._command(_Com.SET_CONTROL, bytes([line]))
        self._command(_Com.PURGE_DATA, bytes([_PURGE_BOTH]))
        self._wait(lambda: wanted.keys() <= self._answers.keys(),
                   'the device server does not answer to settings of its port')
        for command, value in wanted.items():
            if self._answers[command] != value:
                name = command.name.removeprefix('SET_').capitalize()
                raise OSError(f'the device server does not take {name} '
                              f'{int.from_bytes(value, "big")}, its port has '
                              f'{int.from_bytes(self._answers[command], "big")}')

    def _wait(self, condition: Callable[[], bool], failure: str, silence: str = '') -> None:
        """
        Take commands of the server until ``condition`` is true; drop all data.

        Raises OSError with ``failure`` after 3 s, or with ``silence`` if no byte came at all.
        """
        has_come = False
        give_up = time.monotonic() + NEGOTIATION_TIMEOUT
        while not condition():
            left = give_up - time.monotonic()
            if left <= 0:
                raise OSError(failure if has_come or not silence else silence)
            if self._poll.poll(math.ceil(left * 1000)):
                has_come = True
                self._take()

    def _take(self) -> bytes:
        data = super()._take()
        if not self._left and _Telnet.IAC not in data:
            return data
        return self._without_commands(self._left + data)

    def _without_commands(self, data: bytes) -> bytes:
        """Carry out the commands among ``data``; return the other bytes, with 255 for IAC IAC."""
        rest = bytearray()
        at = 0
        while (start := data.find(_IAC, at)) >= 0:
            rest += data[at:start]
            at = start
            size = _size_of_command(data[start:start + _MOST_SUBOPTION])
            if size is None:
                break
            self._obey(data[start:start + size])
            if data[start + 1] == _Telnet.IAC:
                rest += _IAC
            at = start + size
        else:
            rest += data[at:]
            at = len(data)
        self._left = data[at:]
        if len(self._left) >= _MOST_SUBOPTION:
            raise OSError('the device server sends bytes that are not RFC 2217')
        return bytes(rest)

    def _obey(self, command: bytes) -> None:
        kind = command[1]
        if kind == _Telnet.SB:
            body = command[2:-2].replace(_IAC + _IAC, _IAC)
            if len(body) > 2 and body[0] == _Option.COM_PORT:
                self._answers[body[1] - _ANSWER] = body[2:]
        elif kind in _NEGOTIATIONS:
            self._agree(kind, command[2])

    def _agree(self, kind: int, option: int) -> None:
        """Refuse options that we do not use, and record whether the server accepts RFC 2217."""
        self._is_accepted |= option == _Option.COM_PORT and kind in (_Telnet.DO, _Telnet.WILL)
        if kind == _Telnet.DO and option not in self._offered:
            self._send(_Telnet.WONT, option)
        elif kind == _Telnet.WILL and option not in self._asked:
            self._send(_Telnet.DONT, option)
        elif kind == _Telnet.DONT and option == _Option.COM_PORT:
            raise OSError('the device server refuses RFC 2217')

    def _send(self, kind: _Telnet, option: int) -> None:
        super().write(bytes([_Telnet.IAC, kind, option]))

    def _command(self, command: _Com, value: bytes) -> None:
        super().write(bytes([_Telnet.IAC, _Telnet.SB, _Option.COM_PORT, command])
                      + value.replace(_IAC, _IAC + _IAC) + bytes([_Telnet.IAC, _Telnet.SE]))

    def write(self, data: bytes) -> None:
        super().write(data.replace(_IAC, _IAC + _IAC))


def _size_of_command(data: bytes) -> int | None:
    """Return the size of the command at the beginning of ``data``; None if it is incomplete."""
    if len(data) < 2:
        return None
    if data[1] in _NEGOTIATIONS:
        return 3 if len(data) > 2 else None
    if data[1] != _Telnet.SB:
        return 2
    at = 2
    while (at := data.find(_IAC, at)) >= 0 and at + 1 < len(data):
        if data[at + 1] == _Telnet.SE:
            return at + 2
        at += 2
    return None
