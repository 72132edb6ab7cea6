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
Device servers with one port each, of the kinds that are sold.

``device_servers.py LISTEN:UPSTREAM:KIND:IDLE:ALIVE...`` runs until it is ended. KIND tells what
becomes of a second client: it is refused (``refuse``), accepted and closed (``close``), left in
the backlog, where the system keeps what it sends (``queue``), accepted and not listened to
(``discard``), it throws the first out (``newest``), or both are served (``share``). A client that
has sent nothing for IDLE s is let go, as its host may have gone; with ALIVE, TCP asks for it after
so many seconds. 0 is for none. Each client that is taken is printed, with the port.
"""

from __future__ import annotations

import select
import socket
import sys
import threading
import time

_GLANCE = 0.1
_PATIENCE = 60.0


class DeviceServer:
    """A port in front of a PLC."""

    def __init__(self, port: int, upstream: int, kind: str, idle: float, alive: int) -> None:
        self._port, self._kind, self._idle, self._alive = port, kind, idle, alive
        self._plc = _connected(upstream)
        self._listening: socket.socket | None = self._listen()
        self._clients: dict[socket.socket, float] = {}  # and when each was heard last
        self._waiting: list[socket.socket] = []

    def _listen(self) -> socket.socket:
        return socket.create_server(('0.0.0.0', self._port))

    def serve(self) -> None:
        """Pass bytes on between the PLC and the clients, without an end."""
        while True:
            if self._listening is None and not self._clients:
                self._listening = self._listen()
            readable, _, _ = select.select(
                [self._plc, *self._clients, *self._waiting, *self._doors()], [], [], _GLANCE)
            for connection in readable:
                if connection is self._listening:
                    self._accept(connection)
                elif connection is self._plc:
                    self._pass_back(self._plc.recv(4096))
                else:
                    self._pass_on(connection)
            self._let_go()

    def _doors(self) -> list[socket.socket]:
        """Return the listening socket while clients are accepted."""
        is_closed = self._kind == 'queue' and self._clients
        return [] if self._listening is None or is_closed else [self._listening]

    def _accept(self, listening: socket.socket) -> None:
        client, _ = listening.accept()
        if self._alive:
            for option, value in ((socket.TCP_KEEPIDLE, self._alive), (socket.TCP_KEEPINTVL, 1),
                                  (socket.TCP_KEEPCNT, 3)):
                client.setsockopt(socket.IPPROTO_TCP, option, value)
            client.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        if self._clients and self._kind == 'close':
            client.close()
        elif self._clients and self._kind == 'discard':
            self._waiting.append(client)
        else:
            if self._kind == 'newest':
                for other in [*self._clients]:
                    self._end(other)
            self._take(client)

    def _take(self, client: socket.socket) -> None:
        try:
            address = client.getpeername()[0]
        except OSError:  # it has gone while it waited
            client.close()
            return
        client.setblocking(False)
        sys.stdout.write(f'{self._port} {address}\n')  # at once, as others print, too
        sys.stdout.flush()
        self._clients[client] = time.monotonic()
        if self._kind == 'refuse' and self._listening is not None:
            self._listening.close()
            self._listening = None

    def _pass_on(self, client: socket.socket) -> None:
        """Give what a client has sent to the PLC; nothing of one that waits."""
        try:
            data = client.recv(4096) if client.fileno() >= 0 else b''
        except OSError:
            data = b''
        if not data:
            self._end(client)
        elif client in self._clients:
            self._clients[client] = time.monotonic()
            self._plc.sendall(data)

    def _pass_back(self, data: bytes) -> None:
        if not data:
            sys.exit('the PLC has gone')
        for client in [*self._clients]:
            try:
                client.send(data)
            except BlockingIOError:  # its host has gone, and the buffer is full
                pass
            except OSError:
                self._end(client)

    def _let_go(self) -> None:
        """End silent clients; the first that waits takes the place."""
        if self._idle:
            for client, heard in [*self._clients.items()]:
                if time.monotonic() - heard > self._idle:
                    self._end(client)
        if self._waiting and not self._clients:
            self._take(self._waiting.pop(0))

    def _end(self, client: socket.socket) -> None:
        self._clients.pop(client, None)
        if client in self._waiting:
            self._waiting.remove(client)
        client.close()


def _connected(upstream: int) -> socket.socket:
    """Return a connection to a PLC, which may still be starting."""
    give_up = time.monotonic() + _PATIENCE
    while True:
        try:
            return socket.create_connection(('127.0.0.1', upstream))
        except ConnectionRefusedError:
            if time.monotonic() > give_up:
                raise
            time.sleep(_GLANCE)


def main() -> None:
    """Serve all ports until the process is ended."""
    for text in sys.argv[1:]:
        port, upstream, kind, idle, alive = text.split(':')
        server = DeviceServer(int(port), int(upstream), kind, float(idle), int(alive))
        threading.Thread(target=server.serve, daemon=True).start()
    print('ready', flush=True)
    threading.Event().wait()


if __name__ == '__main__':
    main()
