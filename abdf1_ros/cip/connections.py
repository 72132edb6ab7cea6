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

"""The connections of a session: how they are opened, closed, and known again."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import IntEnum

from abdf1_ros.cip.requests import (
    check_route,
    CipClass,
    CipRefusal,
    CipService,
    CipStatus,
    logical_path,
    response,
    ticks,
)
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import Reader

MOST_CONNECTIONS = 8
"""Most connections of a session."""

_MOST_SEEN = 16  # requests of a connection that are known again if they are repeated
_FIRST_MESSAGE = 10.0  # s; least time until the first message on a connection
_MOST_MULTIPLIER = 7  # it stands for 4 << 7
_EXPLICIT = 3  # transport class
_POINT_TO_POINT = 2


class _Extended(IntEnum):
    """The extended statuses of a connection that is not opened or closed."""

    IN_USE = 0x0100
    NO_TRANSPORT = 0x0103
    NOT_FOUND = 0x0107
    NO_INTERVAL = 0x0111
    OUT_OF_CONNECTIONS = 0x0113
    NO_TYPE_TO_US = 0x0123
    NO_TYPE_FROM_US = 0x0124
    NO_SIZE_TO_US = 0x0127
    NO_SIZE_FROM_US = 0x0128
    NO_PATH = 0x0315


@dataclass(slots=True)
class _Repeatable:
    """A request on a connection, and its response as soon as there is one."""

    request: bytes
    response: bytes | None = None


@dataclass(slots=True, eq=False)
class CipConnection:
    """
    A connection: ``number`` of ours, ``their_number`` in messages to the client.

    - ``key``: serial number, vendor and serial number of the client, by which it closes this.
    - ``size``: most bytes of a message to the client.
    - ``patience``: longest time (s) without a message from the client; it ends at ``expires``.
    """

    number: int
    their_number: int
    key: bytes
    size: int
    patience: float
    expires: float
    _seen: dict[int, _Repeatable] = field(default_factory=dict)

    def has_expired(self, now: float) -> bool:
        """Tell whether the client has been silent too long; not while we owe it a response."""
        return now >= self.expires and all(
            seen.response is not None for seen in self._seen.values())

    def repeated(self, count: int, request: bytes, now: float) -> _Repeatable | None:
        """Take a request with its sequence count; return the one that it repeats, if any."""
        self.expires = now + self.patience
        seen = self._seen.get(count)
        if seen is not None and seen.request == request:
            return seen
        self._seen.pop(count, None)
        self._seen[count] = _Repeatable(request)
        answered = [number for number, seen in self._seen.items() if seen.response is not None]
        if answered and len(self._seen) > _MOST_SEEN:
            del self._seen[answered[0]]
        return None

    def answered(self, count: int, request: bytes, told: bytes, now: float) -> bool:
        """
        Keep a response, in case the request is repeated.

        Return False if the client has used the count for another request since.
        """
        self.expires = max(self.expires, now + self.patience)
        seen = self._seen.get(count)
        if seen is None or seen.request != request:
            return False
        seen.response = told
        return True


class CipConnections:
    """The connections of a session, by our numbers, of which ``numbers`` has the next."""

    def __init__(self, numbers: Iterator[int]) -> None:
        self._numbers = numbers
        self._open: dict[int, CipConnection] = {}

    def __len__(self) -> int:
        """Return how many connections are open."""
        return len(self._open)

    def get(self, number: int, now: float) -> CipConnection | None:
        """Return a connection that is open."""
        self._expire(now)
        return self._open.get(number)

    def open(self, service: int, data: bytes, now: float) -> bytes:  # noqa: A003
        """Carry out a Forward Open; return the response, or raise CipRefusal."""
        self._expire(now)
        request = _OpenRequest.decode(data, is_large=service == CipService.LARGE_FORWARD_OPEN)
        fault = request.fault
        if fault is None and any(each.key == request.key for each in self._open.values()):
            fault = _Extended.IN_USE
        if fault is None and len(self._open) >= MOST_CONNECTIONS:
            fault = _Extended.OUT_OF_CONNECTIONS
        if fault is not None:
            raise _refused(fault, request.key)
        number = next(self._numbers)
        self._open[number] = CipConnection(
            number, request.their_number, request.key, request.from_us.size, request.patience,
            now + max(_FIRST_MESSAGE, request.patience))
        return response(service, b''.join((
            number.to_bytes(4, 'little'), request.their_number.to_bytes(4, 'little'), request.key,
            request.to_us.interval_field, request.from_us.interval_field, bytes(2))))

    def close(self, service: int, data: bytes, now: float) -> bytes:
        """Carry out a Forward Close; return the response, or raise CipRefusal."""
        self._expire(now)
        key = _key_to_close(data)
        for number, connection in self._open.items():
            if connection.key == key:
                del self._open[number]
                return response(service, key + bytes(2))
        raise _refused(_Extended.NOT_FOUND, key)

    def _expire(self, now: float) -> None:
        for number in [number for number, connection in self._open.items()
                       if connection.has_expired(now)]:
            del self._open[number]


def _refused(extended: int, key: bytes) -> CipRefusal:
    return CipRefusal(CipStatus.CONNECTION_FAILURE, extended, key + bytes(2))


@dataclass(frozen=True, slots=True)
class _OneWay:
    """What is asked for one direction: the time between messages (us), the type and the size."""

    interval: int
    type: int  # noqa: A003
    size: int

    @classmethod
    def read(cls, reader: Reader, *, is_large: bool) -> _OneWay:
        interval = int.from_bytes(reader.take(4), 'little')
        if is_large:
            parameters = int.from_bytes(reader.take(4), 'little')
            return cls(interval, parameters >> 29 & 3, parameters & 0xFFFF)
        parameters = reader.word()
        return cls(interval, parameters >> 13 & 3, parameters & 0x1FF)

    @property
    def interval_field(self) -> bytes:
        """Return the interval as it stands in a message."""
        return self.interval.to_bytes(4, 'little')


@dataclass(frozen=True, slots=True)
class _OpenRequest:
    """The data of a Forward Open."""

    their_number: int
    key: bytes
    multiplier: int
    to_us: _OneWay
    from_us: _OneWay
    transport: int
    path: bytes

    @classmethod
    def decode(cls, data: bytes, *, is_large: bool) -> _OpenRequest:
        """Read the data; CipRefusal if it is too short or too long."""
        reader = Reader(data)
        try:
            ticks(reader)
            reader.take(4)  # our number, which we choose
            their_number = int.from_bytes(reader.take(4), 'little')
            key = reader.take(_KEY)
            multiplier = reader.take(4)[0]
            to_us = _OneWay.read(reader, is_large=is_large)
            from_us = _OneWay.read(reader, is_large=is_large)
            transport = reader.byte()
            path = reader.take(2 * reader.byte())
        except FormatError:
            raise CipRefusal(CipStatus.NOT_ENOUGH_DATA) from None
        if not reader.is_empty:
            raise CipRefusal(CipStatus.TOO_MUCH_DATA)
        return cls(their_number, key, multiplier, to_us, from_us, transport, path)

    @property
    def patience(self) -> float:
        """Return the longest time (s) between two messages of the client."""
        return self.to_us.interval * (4 << self.multiplier) / 1e6

    @property
    def fault(self) -> int | None:
        """Return the extended status of the first thing that we cannot do, None if we can."""
        faults = (
            (_Extended.NO_TRANSPORT, self.transport & 0x0F != _EXPLICIT),
            (_Extended.NO_INTERVAL, self.multiplier > _MOST_MULTIPLIER or not self.to_us.interval),
            (_Extended.NO_TYPE_TO_US, self.to_us.type != _POINT_TO_POINT),
            (_Extended.NO_TYPE_FROM_US, self.from_us.type != _POINT_TO_POINT),
            (_Extended.NO_SIZE_TO_US, not self.to_us.size),
            (_Extended.NO_SIZE_FROM_US, not self.from_us.size))
        found = next((int(extended) for extended, is_wrong in faults if is_wrong), None)
        return _path_fault(self.path) if found is None else found


_KEY = 8  # bytes: serial number of the connection, vendor and serial number of the client
_LOGICAL = 0x20  # a path begins with this bit if no way to a slot stands before it


def _path_fault(path: bytes) -> int | None:
    """Return the extended status of a path that does not lead to our Message Router."""
    route, rest = (b'', path) if path[:1] and path[0] & _LOGICAL else (path[:2], path[2:])
    try:
        check_route(route)
        return None if logical_path(rest) == (CipClass.MESSAGE_ROUTER, 1) else _Extended.NO_PATH
    except CipRefusal as refusal:
        return _Extended.NO_PATH if refusal.extended is None else refusal.extended


def _key_to_close(data: bytes) -> bytes:
    """Return which connection a Forward Close names; CipRefusal if a length lies."""
    reader = Reader(data)
    try:
        ticks(reader)
        key = reader.take(_KEY)
        reader.take(2 * reader.take(2)[0])
    except FormatError:
        raise CipRefusal(CipStatus.NOT_ENOUGH_DATA) from None
    if not reader.is_empty:
        raise CipRefusal(CipStatus.TOO_MUCH_DATA)
    return key
