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

"""One client on its own TCP connection: its session, its connections, and its PCCC commands."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
import math

from abdf1_ros.cip.connections import CipConnection, CipConnections
from abdf1_ros.cip.encapsulation import (
    EipCommand,
    EipItem,
    EipMessage,
    EipStatus,
    encode_items,
    items_of,
    MessageReader,
)
from abdf1_ros.cip.identity import CipIdentity, services
from abdf1_ros.cip.requests import (
    CipClass,
    CipRefusal,
    CipRequest,
    CipService,
    CipStatus,
    Pccc,
    response,
    unpack,
)
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import Reader, word

_VERSION = 1
_REGISTRATION = 4  # bytes: version and options
_UNIT_HEADER = 6  # bytes before the items: interface and time
_CIP = 0  # the only interface

_Respond = Callable[[bytes, float], None]
"""Send a response of CIP to where the request came from; the clock value in s."""


@dataclass(frozen=True, slots=True, eq=False)
class PcccCommand:
    """
    A PCCC command of a client: CMD, STS, TNS and data.

    - ``came``: when it came at the earliest (clock value in s).
    - ``patience``: how long (s) the client waits for a reply, infinite if it does not tell.
    - ``respond``: takes CMD, STS, TNS and data of the reply, and the clock value. It has no effect
      after session or connection have ended.
    """

    session: EipSession
    pccc: bytes
    came: float
    patience: float
    respond: Callable[[bytes, float], None]


@dataclass(frozen=True, slots=True)
class _Asked:
    """A request on its way to the object: how long it may take (s), and who gets the response."""

    request: CipRequest
    patience: float
    respond: _Respond
    is_connected: bool
    is_inside: bool = False  # of an Unconnected Send


@dataclass(slots=True, eq=False)
class EipSession:
    """
    A client from its TCP connection on; ``address`` is HOST:PORT of it.

    - ``handle``: what the client has to name from its registration on.
    - ``place``: host and port where it has reached us.
    - ``is_over``: the connection has to be closed.
    - ``outgoing``: bytes for the client. The caller takes them, and reads no more bytes of a
      client that does not take them.
    - ``asker``: vendor and serial number of its last PCCC command.
    - ``heard``: when its last bytes came (clock value in s).
    - ``waiting``: its commands that wait for the line.
    """

    address: str
    place: tuple[str, int]
    handle: int
    identity: CipIdentity
    numbers: Iterator[int]
    heard: float
    is_registered: bool = False
    is_over: bool = False
    outgoing: bytearray = field(default_factory=bytearray)
    asker: tuple[int, int] | None = None
    commands: int = 0
    waiting: deque[PcccCommand] = field(default_factory=deque)
    connections: CipConnections = field(init=False)
    _reader: MessageReader = field(default_factory=MessageReader)
    _came: float = 0.0

    def __post_init__(self) -> None:
        self.connections = CipConnections(self.numbers)

    def receive(self, data: bytes, now: float, came: float) -> Iterator[PcccCommand]:
        """Take bytes that came after ``came``; answer requests, and yield PCCC commands."""
        self.heard, self._came = now, came
        for message in self._reader.feed(data):
            yield from self._take(message, now)
            if self.is_over:
                return

    def _take(self, message: EipMessage, now: float) -> Iterator[PcccCommand]:
        """Take a message; a message with a status is not a request."""
        if message.status or message.command == EipCommand.NOP:
            return
        try:
            if message.is_cut:
                raise _Wrong(EipStatus.WRONG_LENGTH)
            if message.options:
                raise _Wrong(EipStatus.MALFORMED)
            match message.command:
                case EipCommand.REGISTER_SESSION:
                    self._register(message)
                case EipCommand.UNREGISTER_SESSION:
                    self.is_over = self._is_ours(message)
                case EipCommand.SEND_RR_DATA:
                    yield from self._take_unconnected(message, now)
                case EipCommand.SEND_UNIT_DATA:
                    yield from self._take_connected(message, now)
                case _:
                    self._send(message.reply(self._listed(message.command)))
        except _Wrong as wrong:
            self._send(message.reply(wrong.data, wrong.fault))
        except FormatError:
            self._send(message.reply(status=EipStatus.MALFORMED))

    def _listed(self, command: int) -> bytes:
        """Return the answer to one of the commands that need no session."""
        match command:
            case EipCommand.LIST_SERVICES:
                return services()
            case EipCommand.LIST_IDENTITY:
                return self.identity.listed(*self.place)
            case EipCommand.LIST_INTERFACES:
                return encode_items()
        raise _Wrong(EipStatus.UNSUPPORTED)

    def _register(self, message: EipMessage) -> None:
        if self.is_registered:
            raise _Wrong(EipStatus.UNSUPPORTED)
        if len(message.data) != _REGISTRATION:
            raise _Wrong(EipStatus.WRONG_LENGTH)
        if message.data != word(_VERSION) + word(0):
            raise _Wrong(EipStatus.WRONG_VERSION, word(_VERSION) + word(0))
        self.is_registered = True
        self._send(EipMessage(message.command, self.handle, 0, message.context, 0, message.data))

    def _is_ours(self, message: EipMessage) -> bool:
        return self.is_registered and message.session == self.handle

    def _items(self, message: EipMessage, *kinds: EipItem) -> tuple[bytes, bytes, float]:
        """Return the data of the two items that a message needs, and its time (s)."""
        if not self._is_ours(message):
            raise _Wrong(EipStatus.NO_SESSION)
        reader = Reader(message.data)
        interface, seconds = reader.word() | reader.word(), reader.word()
        items = items_of(reader)
        if interface != _CIP or [kind for kind, _ in items[:2]] != [*kinds]:
            raise _Wrong(EipStatus.MALFORMED)
        return items[0][1], items[1][1], seconds or math.inf

    def _take_unconnected(self, message: EipMessage, now: float) -> Iterator[PcccCommand]:
        address, data, patience = self._items(
            message, EipItem.NULL_ADDRESS, EipItem.UNCONNECTED_DATA)
        if address:
            raise _Wrong(EipStatus.MALFORMED)
        yield from self._serve(data, patience, partial(self._respond, message), now)

    def _take_connected(self, message: EipMessage, now: float) -> Iterator[PcccCommand]:
        """Take a request on a connection; a repeated request gets the response that is known."""
        address, data, patience = self._items(
            message, EipItem.CONNECTED_ADDRESS, EipItem.CONNECTED_DATA)
        if len(address) != 4 or len(data) < 2:
            raise _Wrong(EipStatus.MALFORMED)
        connection = self.connections.get(int.from_bytes(address, 'little'), now)
        if connection is None:
            return
        count, request = int.from_bytes(data[:2], 'little'), data[2:]
        respond = partial(self._respond_connected, message, connection, count, request)
        repeated = connection.repeated(count, request, now)
        if repeated is None:
            yield from self._serve(request, patience, respond, now, is_connected=True)
        elif repeated.response is not None:
            respond(repeated.response, now)

    def _serve(self, data: bytes, patience: float, respond: _Respond, now: float, *,
               is_connected: bool = False) -> Iterator[PcccCommand]:
        """Answer a request of CIP, or yield the command in it."""
        try:
            call = _Asked(CipRequest.decode(data), patience, respond, is_connected)
        except CipRefusal as refusal:
            respond(refusal.response(data[0] if data else 0), now)
        else:
            yield from self._carry_out(call, now)

    def _carry_out(self, call: _Asked, now: float) -> Iterator[PcccCommand]:
        request = call.request
        try:
            match request.is_for:
                case CipClass.IDENTITY:
                    call.respond(self.identity.serve(request), now)
                case CipClass.PCCC:
                    yield self._command(call)
                case CipClass.CONNECTION_MANAGER if not call.is_inside and not call.is_connected:
                    yield from self._manage(call, now)
                case None:
                    raise CipRefusal(CipStatus.PATH_UNKNOWN)
                case _:
                    raise CipRefusal(CipStatus.NO_SERVICE)
        except CipRefusal as refusal:
            call.respond(refusal.response(request.service), now)

    def _manage(self, call: _Asked, now: float) -> Iterator[PcccCommand]:
        """Carry out a service of the Connection Manager."""
        service, data = call.request.service, call.request.data
        match service:
            case CipService.FORWARD_OPEN | CipService.LARGE_FORWARD_OPEN:
                call.respond(self.connections.open(service, data, now), now)
            case CipService.FORWARD_CLOSE:
                call.respond(self.connections.close(service, data, now), now)
            case CipService.UNCONNECTED_SEND:
                inside = unpack(data)
                try:
                    request = CipRequest.decode(inside.request)
                except CipRefusal as refusal:
                    call.respond(refusal.response((inside.request or b'\0')[0]), now)
                else:
                    patience = min(call.patience, inside.patience)
                    yield from self._carry_out(
                        _Asked(request, patience, call.respond, False, is_inside=True), now)
            case _:
                raise CipRefusal(CipStatus.NO_SERVICE)

    def _command(self, call: _Asked) -> PcccCommand:
        """Return the command in an Execute PCCC."""
        if call.request.service != CipService.EXECUTE_PCCC:
            raise CipRefusal(CipStatus.NO_SERVICE)
        asked = Pccc.decode(call.request.data)
        self.commands += 1
        self.asker = asked.asker or self.asker
        return PcccCommand(self, asked.command, self._came, call.patience,
                           partial(_respond_pccc, call.respond, asked.requestor))

    def _respond(self, message: EipMessage, told: bytes, now: float) -> None:
        self._send(message.reply(bytes(_UNIT_HEADER) + encode_items(
            (EipItem.NULL_ADDRESS, b''), (EipItem.UNCONNECTED_DATA, told))))

    def _respond_connected(self, message: EipMessage, connection: CipConnection, count: int,
                           request: bytes, told: bytes, now: float) -> None:
        if self.connections.get(connection.number, now) is not connection:
            return
        if len(told) + 2 > connection.size:
            told = CipRefusal(CipStatus.REPLY_TOO_LARGE).response(told[0])
        if not connection.answered(count, request, told, now):
            return
        self._send(message.reply(bytes(_UNIT_HEADER) + encode_items(
            (EipItem.CONNECTED_ADDRESS, connection.their_number.to_bytes(4, 'little')),
            (EipItem.CONNECTED_DATA, word(count) + told))))

    def _send(self, message: EipMessage) -> None:
        if not self.is_over:
            self.outgoing += message.encode()


def _respond_pccc(respond: _Respond, requestor: bytes, pccc: bytes, now: float) -> None:
    respond(response(CipService.EXECUTE_PCCC, requestor + pccc), now)


class _Wrong(Exception):
    """A message that gets a status of the encapsulation, and data in the reply."""

    def __init__(self, fault: EipStatus, data: bytes = b'') -> None:
        super().__init__(fault)
        self.fault, self.data = fault, data
