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
Device servers with one port each: one client at a time, and a timer for silence.

``device_servers.py IDLE LISTEN:UPSTREAM...`` runs until it is ended. A second client is
refused. One that has sent nothing for IDLE s is let go, as its host may have gone. Each
client that is taken is printed, with the port.
"""

from __future__ import annotations

import socket
import sys
import threading
import time

_GLANCE = 0.1


def serve(listening: socket.socket, upstream: int, idle: float) -> None:
    """Pass bytes on between a PLC and one client after the other."""
    plc = socket.create_connection(('127.0.0.1', upstream))
    plc.settimeout(_GLANCE)
    clients: list[socket.socket] = []
    threading.Thread(target=_pass_back, args=(plc, clients), daemon=True).start()
    while True:
        client, address = listening.accept()
        if clients:
            client.close()
            continue
        print(listening.getsockname()[1], address[0], flush=True)
        clients.append(client)
        threading.Thread(target=_pass_on, args=(client, clients, plc, idle), daemon=True).start()


def _pass_on(client: socket.socket, clients: list[socket.socket], plc: socket.socket,
             idle: float) -> None:
    """Pass on what a client sends, until it goes or has been silent for too long."""
    client.settimeout(_GLANCE)
    heard = time.monotonic()
    try:
        while time.monotonic() - heard < idle:
            try:
                data = client.recv(4096)
            except TimeoutError:
                continue
            if not data:
                break
            heard = time.monotonic()
            plc.sendall(data)
    except OSError:
        pass
    clients.remove(client)
    client.close()


def _pass_back(plc: socket.socket, clients: list[socket.socket]) -> None:
    """Give what the PLC sends to the client of that moment."""
    while True:
        try:
            data = plc.recv(4096)
        except TimeoutError:
            continue
        if not data:
            return
        for client in clients[:]:
            try:
                client.sendall(data)
            except OSError:  # its own thread notices
                pass


def main() -> None:
    """Serve all ports until the process is ended."""
    idle = float(sys.argv[1])
    for pair in sys.argv[2:]:
        listen, upstream = map(int, pair.split(':'))
        listening = socket.create_server(('0.0.0.0', listen))
        threading.Thread(target=serve, args=(listening, upstream, idle), daemon=True).start()
    print('ready', flush=True)
    threading.Event().wait()


if __name__ == '__main__':
    main()
