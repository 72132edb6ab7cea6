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

"""Connections to device servers: a server that did not hear of the end of the last one."""

from collections.abc import Iterator
from errno import EPIPE, ETIMEDOUT
import socket
import threading
import time
from unittest.mock import Mock

from abdf1_ros.ports import socket_port
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
import pytest
from support.cases import for_all
from support.ptys import PATIENCE

_TCP_REPAIR = 19  # of Linux: a socket that is closed in this state sends nothing (CRIU)
_TRIES = 20


class NewestClientServer:
    """A server that throws its client out for the next one, as ser2net does with kickolduser."""

    def __init__(self) -> None:
        self.listening = socket.create_server(('127.0.0.1', 0))
        self.address = self.listening.getsockname()
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        client: socket.socket | None = None
        while True:
            try:
                newest, _ = self.listening.accept()
            except OSError:
                return
            newest.sendall(b'!')
            if client is not None:
                client.close()
            client = newest

    def close(self) -> None:
        self.listening.close()


class OneClientServer:
    """A server that takes one client, and closes the connections of all others at once."""

    def __init__(self) -> None:
        self.listening = socket.create_server(('127.0.0.1', 0))
        self.url = f'socket://127.0.0.1:{self.listening.getsockname()[1]}'
        self._client: socket.socket | None = None
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self.listening.accept()
            except OSError:
                return
            if self._client is None:
                self._client = connection
                threading.Thread(target=self._serve, args=(connection,), daemon=True).start()
            else:
                connection.close()

    def _serve(self, connection: socket.socket) -> None:
        try:
            while data := connection.recv(100):
                connection.sendall(data)
        except OSError:
            pass
        connection.close()
        self._client = None

    def close(self) -> None:
        self.listening.close()
        if self._client is not None:
            self._client.close()


@pytest.fixture
def server() -> Iterator[OneClientServer]:
    server = OneClientServer()
    yield server
    server.close()


def answers(server: OneClientServer) -> bool:
    """Connect; tell whether the server echoes, so the connection is its only one."""
    port = open_port(PortSettings(server.url))
    try:
        port.write(b'?')
        return bool(port.read(PATIENCE, port.fileno()))  # type: ignore[attr-defined]
    except OSError:
        return False
    finally:
        port.close()


def cut(server: OneClientServer) -> None:
    """Connect, and let the connection disappear without a packet, as a cut network does."""
    port = open_port(PortSettings(server.url))
    connection = socket.socket(fileno=port.fileno())  # type: ignore[attr-defined]
    try:
        connection.setsockopt(socket.IPPROTO_TCP, _TCP_REPAIR, 1)
    except PermissionError:
        pytest.skip('a connection can disappear only where CAP_NET_ADMIN is there')
    finally:
        connection.detach()
        port.close()


def test_connection_whose_end_the_server_did_not_hear_is_freed(server: OneClientServer) -> None:
    cut(server)
    with socket.create_connection(server.listening.getsockname()) as other:
        assert not other.recv(1)  # a stranger has no place
    # The server's thread may need a moment; more tries would hit the port of before by chance.
    assert any(answers(server) or time.sleep(0.1) for _ in range(_TRIES))


def test_local_port_that_is_not_free_yet_is_no_obstacle(server: OneClientServer) -> None:
    for _ in range(3):  # we close first, so the system keeps the local port for a minute
        give_up = time.monotonic() + PATIENCE
        while not answers(server):  # until the server has seen the end of the one before
            assert time.monotonic() < give_up


def test_client_that_is_thrown_out_again_and_again_is_told_of_the_other_one(
        monkeypatch: pytest.MonkeyPatch) -> None:
    server = NewestClientServer()
    url = 'socket://{}:{}'.format(*server.address)
    said = []
    moments = Mock(side_effect=[0.0, 1.0, 2.0, 11.0, 13.0, 14.0, 15.0])  # of all ends
    monkeypatch.setattr(socket_port, 'time', Mock(monotonic=moments))
    for _ in range(5):
        port = open_port(PortSettings(url))
        assert port.read(PATIENCE, port.fileno()) == b'!'  # type: ignore[attr-defined]
        with socket.create_connection(server.address), pytest.raises(OSError) as caught:
            port.read(PATIENCE, port.fileno())  # type: ignore[attr-defined]
        port.close()
        said.append(str(caught.value))
    port = open_port(PortSettings(url))
    monkeypatch.setattr('os.write', Mock(side_effect=BrokenPipeError(EPIPE, 'Broken pipe')))
    with pytest.raises(OSError, match='Broken pipe, 3 times within 10 s: another client'):
        port.write(b'?')
    monkeypatch.setattr('os.read', Mock(side_effect=TimeoutError(ETIMEDOUT, 'the network is cut')))
    with pytest.raises(TimeoutError, match='the network is cut$'):
        port.read(PATIENCE, port.fileno())  # type: ignore[attr-defined]
    port.close()
    server.close()
    assert [*said[:2], said[4]] == 3 * ['the other end has closed the connection']
    assert said[2:4] == 2 * [
        'the other end has closed the connection, 3 times within 10 s: another client has this '
        'line, or takes it each time (then let the device server refuse a second client), or the '
        'inactivity time of the server is too short']


def test_server_that_answers_nothing_is_given_up_after_a_second() -> None:
    with socket.socket() as full:
        full.bind(('127.0.0.1', 0))
        full.listen(0)
        others = [socket.socket() for _ in range(3)]  # more than it lets wait
        for other in others:
            other.setblocking(False)
            other.connect_ex(full.getsockname())
        begun = time.monotonic()
        with pytest.raises(OSError, match='timed out'):
            open_port(PortSettings(f'socket://127.0.0.1:{full.getsockname()[1]}'))
        assert time.monotonic() - begun < PATIENCE
        for other in others:
            other.close()


def test_host_is_tried_at_each_of_its_addresses(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(('127.0.0.1', 0)) as listening:
        addresses = [('127.0.0.1', 1), listening.getsockname()]
        monkeypatch.setattr(socket, 'getaddrinfo', lambda *args, **others: [
            (socket.AF_INET, socket.SOCK_STREAM, 0, '', address) for address in addresses])
        open_port(PortSettings('socket://plc-gate:4001')).close()


@for_all(('pieces', 'is_telnet'), [
    ([b'\xFF\xFD\x03\xFF\xFB\x01'], True), ([b'\xFF\xFB\x2C'], True),
    ([b'\x10\x06', b'\xFF\xFD\x03'], False), ([b'\xFF\xFF\x03'], False),
    ([b'\x10\x06\xFF\xFD\x03'], False)])
def test_telnet_port_is_named(pieces: list[bytes], is_telnet: bool) -> None:
    """A device server begins a telnet connection with options; DF1 has such bytes inside data."""
    with socket.create_server(('127.0.0.1', 0)) as listening:
        port = open_port(PortSettings(f'socket://127.0.0.1:{listening.getsockname()[1]}'))
        with listening.accept()[0] as server:
            for piece in pieces:
                server.sendall(piece)
                if is_telnet:
                    with pytest.raises(OSError, match='telnet port .its first bytes are FF F'):
                        port.read(PATIENCE, server.fileno())
                else:
                    assert port.read(PATIENCE, server.fileno()) == piece
        port.close()
