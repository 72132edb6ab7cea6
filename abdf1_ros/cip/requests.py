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

"""Requests and responses of CIP: a service, the path of an object, and data."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
import math

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import Reader, word

REPLY = 0x80


class CipService(IntEnum):
    """The services that we know."""

    GET_ATTRIBUTES_ALL = 0x01
    GET_ATTRIBUTE_SINGLE = 0x0E
    EXECUTE_PCCC = 0x4B
    FORWARD_CLOSE = 0x4E
    UNCONNECTED_SEND = 0x52
    FORWARD_OPEN = 0x54
    LARGE_FORWARD_OPEN = 0x5B


class CipClass(IntEnum):
    """The classes of objects that we have, each with instance 1 alone."""

    IDENTITY = 0x01
    MESSAGE_ROUTER = 0x02
    CONNECTION_MANAGER = 0x06
    PCCC = 0x67


class CipStatus(IntEnum):
    """General statuses of CIP."""

    CONNECTION_FAILURE = 0x01
    PATH_SEGMENT = 0x04
    PATH_UNKNOWN = 0x05
    NO_SERVICE = 0x08
    REPLY_TOO_LARGE = 0x11
    NOT_ENOUGH_DATA = 0x13
    NO_ATTRIBUTE = 0x14
    TOO_MUCH_DATA = 0x15
    BAD_PARAMETER = 0x20


class CipRefusal(Exception):
    """A request that is refused: general and extended status, and what the response has in it."""

    def __init__(self, status: CipStatus, extended: int | None = None, data: bytes = b'') -> None:
        super().__init__(status, extended)
        self.status, self.extended, self.data = status, extended, data

    def response(self, service: int) -> bytes:
        """Return the response to a request of this service."""
        extended = b'' if self.extended is None else word(self.extended)
        return bytes((service | REPLY, 0, self.status, len(extended) // 2)) + extended + self.data


def response(service: int, data: bytes = b'') -> bytes:
    """Return a good response."""
    return bytes((service | REPLY, 0, 0, 0)) + data


@dataclass(frozen=True, slots=True)
class CipRequest:
    """A request; ``path`` has the class, the instance and, if it names one, the attribute."""

    service: int
    path: tuple[int, ...]
    data: bytes

    @classmethod
    def decode(cls, data: bytes) -> CipRequest:
        """Read a request; CipRefusal if its path cannot be read."""
        if len(data) < 2 or len(data) < 2 + 2 * data[1]:
            raise CipRefusal(CipStatus.PATH_SEGMENT)
        end = 2 + 2 * data[1]
        return cls(data[0], logical_path(data[2:end]), data[end:])

    @property
    def is_for(self) -> CipClass | None:
        """Return the class of the object that this is for; None if we have no such object."""
        if self.path[1:2] != (1,) or self.path[0] not in [*CipClass]:
            return None
        return CipClass(self.path[0])


# The first byte of a logical segment says what it names (in the order of a path), and how long
# the number is.
_KINDS = 0x20, 0x24, 0x30


def logical_path(path: bytes) -> tuple[int, ...]:
    """Return class, instance and attribute of a path; CipRefusal for any other segments."""
    numbers = []
    reader = Reader(path)
    try:
        for kind in _KINDS:
            if reader.is_empty:
                break
            match reader.byte() - kind:
                case 0:
                    numbers.append(reader.byte())
                case 1:
                    reader.byte()
                    numbers.append(reader.word())
                case _:
                    raise CipRefusal(CipStatus.PATH_SEGMENT)
    except FormatError:
        raise CipRefusal(CipStatus.PATH_SEGMENT) from None
    if not reader.is_empty or not numbers:
        raise CipRefusal(CipStatus.PATH_SEGMENT)
    return tuple(numbers)


_NO_PORT, _NO_LINK = 0x0311, 0x0312  # extended statuses of a way that leads nowhere
_BACKPLANE = 1


def check_route(route: bytes) -> None:
    """Check that a way to a processor is empty, or is slot 0; CipRefusal otherwise."""
    if route and route != bytes((_BACKPLANE, 0)):
        extended = _NO_LINK if route[0] == _BACKPLANE else _NO_PORT
        raise CipRefusal(CipStatus.CONNECTION_FAILURE, extended, bytes((len(route) // 2,)))


@dataclass(frozen=True, slots=True)
class Unpacked:
    """The request inside an Unconnected Send, and the time (s) that it has, infinite if none."""

    request: bytes
    patience: float


def unpack(data: bytes) -> Unpacked:
    """Read the data of an Unconnected Send; CipRefusal if a length lies, or the way is unknown."""
    reader = Reader(data)
    try:
        patience = ticks(reader)
        size = reader.word()
        request = reader.take(size)
        reader.take(size % 2)
        route = reader.take(2 * reader.take(2)[0])
    except FormatError:
        raise CipRefusal(CipStatus.NOT_ENOUGH_DATA) from None
    if not reader.is_empty:
        raise CipRefusal(CipStatus.TOO_MUCH_DATA)
    check_route(route)
    return Unpacked(request, patience)


def ticks(reader: Reader) -> float:
    """Return a time (s) that is given as a number of ticks of a power of two in ms."""
    exponent = reader.byte() & 0x0F
    return (reader.byte() << exponent) / 1000 or math.inf


@dataclass(frozen=True, slots=True)
class Pccc:
    """The data of an Execute PCCC: who asks, as bytes that the reply repeats, and the command."""

    requestor: bytes
    command: bytes

    @classmethod
    def decode(cls, data: bytes) -> Pccc:
        """Read the data; CipRefusal if the header is missing or belongs to a reply."""
        size = data[0] if data else 0
        if data and not size:
            raise CipRefusal(CipStatus.BAD_PARAMETER)
        if len(data) < size + _PCCC_HEADER or not data:
            raise CipRefusal(CipStatus.NOT_ENOUGH_DATA)
        command = data[size:]
        if command[0] & _REPLY_BIT or command[1]:
            raise CipRefusal(CipStatus.BAD_PARAMETER)
        return cls(data[:size], command)

    @property
    def asker(self) -> tuple[int, int] | None:
        """Return vendor and serial number of the requestor; None if it tells none."""
        if len(self.requestor) < _REQUESTOR:
            return None
        reader = Reader(self.requestor[1:_REQUESTOR])
        return reader.word(), int.from_bytes(reader.rest(), 'little')


_PCCC_HEADER = 4  # CMD, STS and TNS
_REPLY_BIT = 0x40  # in CMD; only a reply has an STS
_REQUESTOR = 7  # its own length, vendor and serial number
