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

"""A listening TCP port for many clients, and the thread that serves them all."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
import math
import select
import socket
from typing import Generic, Protocol, TypeVar

from abdf1_ros.ports.clock import line_time
from abdf1_ros.ports.descriptor import READ_SIZE
from abdf1_ros.ports.endpoints import listening, TCP_OPTIONS
from abdf1_ros.ports.port_thread import PortKind, PortState, PortThread, RELEASED

GLANCE = 0.1
"""Longest wait (s); it also limits the error of the age of what a client sends."""

_RETRY_PERIOD = 0.5  # s between two attempts to listen
_CHARACTER = 10 / 115200  # s; a client that sends more is read as fast as the fastest line
BURST = 4096 * _CHARACTER
"""A client may send 4096 bytes faster; this is their time (s) on such a line."""

_PAUSE = 0.01  # s between two clients that come
STUCK = 10.0
"""After this time (s) without a byte taken, or with bytes left at each read, a client is gone."""


class Talk(Protocol):
    """What is said to one client: bytes to send, and whether that is all."""

    outgoing: bytearray
    is_over: bool


_Talk = TypeVar('_Talk', bound=Talk)


class ClientsHandler(Protocol[_Talk]):
    """What the thread serves; each method is called in this thread."""

    def came(self, address: str, place: tuple[str, int], now: float) -> _Talk | None:
        """Take a client from ``address`` that has reached us at ``place``; None refuses it."""

    def receive(self, talk: _Talk, data: bytes, now: float, came: float) -> None:
        """Take bytes that came after ``came`` (clock value in s)."""

    def gone(self, talk: _Talk) -> None:
        """Forget a client."""

    def turn(self, now: float) -> None:
        """Do the work that came from other threads; called after each wait of at most GLANCE."""


class _ClientEnd(Generic[_Talk]):
    """
    A connected client; ``came_after`` is the last clock value at which all its bytes were read.

    It is not read while it does not take what is sent to it, or while it rests.
    """

    def __init__(self, connection: socket.socket, talk: _Talk, now: float) -> None:
        self.connection = connection
        self.talk = talk
        self.came_after = now
        self.rests_until = -math.inf
        self.waits_for = select.POLLIN
        self._line_until = now
        self._stuck_since = self._full_since = math.inf

    def look_ahead(self, now: float) -> int:
        """Return what to wait for: room for bytes, bytes, or its end while it rests."""
        self.waits_for = select.POLLOUT if self.talk.outgoing else \
            select.POLLIN if now >= self.rests_until else select.POLLRDHUP
        return self.waits_for

    def read(self, now: float) -> bytes:
        """Return bytes; raise OSError when the client has gone, also with bytes left to read."""
        if self.waits_for == select.POLLRDHUP:
            raise OSError('the client has left while it had to rest')
        try:
            data = self.connection.recv(READ_SIZE)
        except BlockingIOError:
            return b''
        if not data:
            raise OSError('the client has closed the connection')
        self._full_since = min(self._full_since, now) if len(data) == READ_SIZE else math.inf
        if now - self._full_since > STUCK:  # it may have left long ago
            raise OSError('the client sends without end')
        self._line_until = max(self._line_until, now) + len(data) * _CHARACTER
        self.rests_until = self._line_until - BURST
        return data

    def send(self, now: float) -> None:
        """Send what the client takes at once; raise OSError when it has gone, or is stuck."""
        outgoing = self.talk.outgoing
        if not outgoing:
            return
        try:
            del outgoing[:self.connection.send(outgoing)]
            self._stuck_since = math.inf
        except BlockingIOError:
            self._stuck_since = min(self._stuck_since, now)
            if now - self._stuck_since > STUCK:
                raise OSError('the client takes no data') from None


class ClientsPort(Generic[_Talk]):
    """A listening TCP port, and the clients that have come; OSError if it cannot listen."""

    def __init__(self, host: str, port: int) -> None:
        self._listener = listening(host, port)
        self._rests_until = -math.inf
        self._clients: dict[int, _ClientEnd[_Talk]] = {}

    def wait(self, wake: int, clock: Callable[[], float]) -> tuple[list[_ClientEnd[_Talk]], bool]:
        """Wait for bytes, for a client, or until ``wake`` is readable; return which came."""
        poll, asked = select.poll(), clock()
        poll.register(wake, select.POLLIN)
        if asked >= self._rests_until:
            poll.register(self._listener, select.POLLIN)
        for number, client in self._clients.items():
            poll.register(number, client.look_ahead(asked))
        ends = [end - asked for end in (self._rests_until, *(
            client.rests_until for client in self._clients.values())) if end > asked]
        events = dict(poll.poll(math.ceil(min([GLANCE, *ends]) * 1000)))
        now, ready = clock(), []
        for number, client in self._clients.items():
            if number in events and client.waits_for != select.POLLOUT:
                ready.append(client)
            elif client.waits_for == select.POLLIN:
                client.came_after = now
        return ready, self._listener.fileno() in events

    def accept(self, now: float) -> tuple[socket.socket, str, tuple[str, int]] | None:
        """Return a client that has come, its address, and where it has reached us."""
        self._rests_until = now + _PAUSE
        try:
            connection, address = self._listener.accept()
        except OSError:  # it has gone again, or this process has too many files
            return None
        try:
            for level, option, value in TCP_OPTIONS:
                connection.setsockopt(level, option, value)
            connection.setblocking(False)
            host, port = connection.getsockname()[:2]
        except OSError:
            connection.close()
            return None
        name = f'[{address[0]}]' if ':' in address[0] else address[0]
        return connection, f'{name}:{address[1]}', (host, port)

    def add(self, connection: socket.socket, talk: _Talk, now: float) -> None:
        """Serve a client."""
        self._clients[connection.fileno()] = _ClientEnd(connection, talk, now)

    def send(self, now: float) -> Iterator[_ClientEnd[_Talk]]:
        """Send what there is to send; yield the clients that have gone or are over."""
        for client in [*self._clients.values()]:
            try:
                client.send(now)
            except OSError:
                yield client
                continue
            if client.talk.is_over:
                yield client

    def drop(self, client: _ClientEnd[_Talk]) -> None:
        """Close the connection of a client."""
        if self._clients.pop(client.connection.fileno(), None) is not None:
            client.connection.close()

    def close(self) -> Iterator[_Talk]:
        """Stop listening, and close all connections; yield what was said on them."""
        self._listener.close()
        for client in [*self._clients.values()]:
            self.drop(client)
            yield client.talk


class ClientsThread(PortThread, Generic[_Talk]):
    """
    Serve the clients at ``host`` and ``port`` until ``stop``; ``release`` closes the port.

    ``on_fault`` is called with an exception that is a bug. It costs its client the connection; if
    it has no client, it ends the thread, and ``has_failed`` becomes True.
    """

    def __init__(self, host: str, port: int, server: ClientsHandler[_Talk],
                 on_fault: Callable[[Exception], None],
                 clock: Callable[[], float] = line_time) -> None:
        super().__init__('clients', on_fault)
        self.daemon = True  # a client never keeps the process alive
        self._address = host, port
        self._server = server
        self._clock = clock

    def _keep_open(self) -> None:
        while not self._stopping:
            self._open()
        self.state = PortState(False, 'closed')

    def _open(self) -> None:
        """Serve as long as the port may be open; or wait until it may."""
        if self.is_released:
            self.state = PortState(False, RELEASED)
            self._is_free.set()
            self._wait(None)
            return
        try:
            port = ClientsPort[_Talk](*self._address)
        except OSError as error:
            self.state = PortState(False, f'cannot open the port: {error.strerror or error}',
                                   PortKind.UNAVAILABLE)
            self._wait(_RETRY_PERIOD)
            return
        self.state = PortState(True, 'open')
        try:
            while not (self._stopping or self.is_released):
                self._serve(port)
        finally:
            for talk in port.close():
                self._server.gone(talk)

    def _wait(self, seconds: float | None) -> None:
        self._wake.wait(None if seconds is None else int(seconds * 1000))
        self._wake.take()

    def _serve(self, port: ClientsPort[_Talk]) -> None:
        """Wait, read, do the work of other threads, and send."""
        ready, has_come = port.wait(self._wake.descriptor, self._clock)
        now = self._clock()
        self._wake.take()
        if has_come and (accepted := port.accept(now)) is not None:
            connection, address, place = accepted
            talk = self._server.came(address, place, now)
            if talk is None:
                connection.close()
            else:
                port.add(connection, talk, now)
        for client in ready:
            self._read(port, client, now)
        self._server.turn(now)
        for client in port.send(now):
            self._drop(port, client)

    def _read(self, port: ClientsPort[_Talk], client: _ClientEnd[_Talk], now: float) -> None:
        try:
            data = client.read(now)
            if data:
                self._server.receive(client.talk, data, now, client.came_after)
            if len(data) < READ_SIZE:
                client.came_after = now
        except OSError:
            self._drop(port, client)
        except Exception as error:  # a bug must end only this client
            self._drop(port, client)
            self._on_fault(error)

    def _drop(self, port: ClientsPort[_Talk], client: _ClientEnd[_Talk]) -> None:
        with suppress(OSError):
            port.drop(client)
        self._server.gone(client.talk)
