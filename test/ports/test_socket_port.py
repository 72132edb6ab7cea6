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

"""Ports of device servers: plain connections, and the client of RFC 2217."""

from collections.abc import Iterator
from dataclasses import replace
from errno import ECONNRESET, EPIPE, ETIMEDOUT
import os
import socket
import threading
import time
from unittest.mock import Mock

from abdf1_ros.ports import repeated_ends, rfc2217_port
from abdf1_ros.ports.descriptor import READ_SIZE
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.rfc2217_port import Rfc2217Port
from abdf1_ros.ports.settings import PortSettings
import pytest
from support.cases import for_all
from support.device_server import DeviceServer
from support.ptys import PATIENCE

_TCP_REPAIR = 19  # of Linux: a socket that is closed in this state sends nothing (CRIU)
_TRIES = 20


class NewestClientServer:
    """A server that throws its client out for the next one, as ser2net does with kickolduser."""

    def __init__(self) -> None:
        self.listening = socket.create_server(('127.0.0.1', 0))
        self.address = self.listening.getsockname()
        self.url = f'socket://127.0.0.1:{self.address[1]}'
        self._client: socket.socket | None = None
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self.listening.accept()
            except OSError:
                return
            self._take(connection)

    def _take(self, connection: socket.socket) -> None:
        connection.sendall(b'!')
        if self._client is not None:
            self._client.close()
        self._client = connection

    def close(self) -> None:
        self.listening.close()
        if self._client is not None:
            self._client.close()


class OneClientServer(NewestClientServer):
    """A server that takes one client, and closes the connections of all others at once."""

    def _take(self, connection: socket.socket) -> None:
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


def test_local_port_is_that_of_the_last_connection_unless_it_is_not_free_yet() -> None:
    came = []
    with socket.create_server(('127.0.0.1', 0)) as listening:
        for is_ours_first in (True, False, False):
            port = open_port(PortSettings(f'socket://127.0.0.1:{listening.getsockname()[1]}'))
            connection, address = listening.accept()
            came.append(address)
            if is_ours_first:  # so the system keeps the local port for a minute
                port.close()
            connection.close()
            port.close()
    assert came[0] != came[1] == came[2]


def test_client_that_is_thrown_out_again_and_again_is_told_of_the_other_one(
        monkeypatch: pytest.MonkeyPatch) -> None:
    server, other = NewestClientServer(), NewestClientServer()
    said = []
    moments = Mock(side_effect=[0.0, 0.5, 1.0, 2.0, 11.0, 13.0, 14.0, 15.0, 16.0])  # of all ends
    monkeypatch.setattr(repeated_ends, 'time', Mock(monotonic=moments))
    for each in (server, other, *4 * [server]):
        port = open_port(PortSettings(each.url))
        assert port.read(PATIENCE, port.fileno()) == b'!'  # type: ignore[attr-defined]
        with socket.create_connection(each.address), pytest.raises(OSError) as caught:
            port.read(PATIENCE, port.fileno())  # type: ignore[attr-defined]
        port.close()
        said.append(str(caught.value))
    port = open_port(PortSettings(server.url))
    for number in (ECONNRESET, EPIPE):
        monkeypatch.setattr('os.write', Mock(side_effect=OSError(number, 'it has ended')))
        with pytest.raises(OSError, match='it has ended, 3 times within 10 s: another client'):
            port.write(b'?')
    monkeypatch.setattr('os.read', Mock(side_effect=TimeoutError(ETIMEDOUT, 'the network is cut')))
    with pytest.raises(TimeoutError, match='the network is cut$'):
        port.read(PATIENCE, port.fileno())  # type: ignore[attr-defined]
    port.close()
    server.close()
    other.close()
    assert [*said[:3], said[5]] == 4 * ['the other end has closed the connection']
    assert said[3:5] == 2 * [
        'the other end has closed the connection, 3 times within 10 s: another client has this '
        'line, or takes it each time (then let the device server refuse a second client), or the '
        'inactivity time of the server is too short']


@for_all(('said', 'text'), [
    (b'Port already in use by 10.0.0.7\r\n', '; it said "Port already in use by 10.0.0.7"'),
    (b'', ''), (b'\r\n', ''), (b'\x10\x06', ''), (b'x' * 300, ''), (b'caf\xe9', '')])
def test_text_of_a_server_before_its_end_is_told(said: bytes, text: str) -> None:
    with socket.create_server(('127.0.0.1', 0)) as listening:
        port = open_port(PortSettings(f'socket://127.0.0.1:{listening.getsockname()[1]}'))
        with listening.accept()[0] as server:
            server.sendall(said)
        with pytest.raises(OSError) as caught:
            while port.read(PATIENCE, port.fileno()):  # type: ignore[attr-defined]
                pass
        port.close()
    assert str(caught.value) == f'the other end has closed the connection{text}'


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


# The client of RFC 2217


# As RFC 854 and RFC 2217 have them.
WILL_COM_PORT = bytes([255, 251, 44])
DO_COM_PORT = bytes([255, 253, 44])
DONT_COM_PORT = bytes([255, 254, 44])
BAUD_115200 = bytes([255, 250, 44, 101, 0, 1, 0xC2, 0, 255, 240])
REST = b''.join(bytes([255, 250, 44, command, value, 255, 240])
                for command, value in ((102, 8), (103, 3), (104, 1)))
EVEN = PortSettings('', 115200, parity='Even')
Ends = tuple[Rfc2217Port, socket.socket]


@pytest.fixture
def ends() -> Iterator[Ends]:
    ours, theirs = socket.socketpair()
    theirs.settimeout(PATIENCE)
    yield Rfc2217Port(ours, 'rfc2217://here'), theirs
    ours.close()
    theirs.close()


def test_connection_sends_at_once_and_notices_a_lost_host() -> None:
    options = (socket.TCP_NODELAY, socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL,
               socket.TCP_USER_TIMEOUT)
    with DeviceServer() as server:
        port = open_port(PortSettings(f'rfc2217://127.0.0.1:{server.port}', 19200))
        assert isinstance(port, Rfc2217Port)
        assert server.baud == 19200
        with socket.socket(fileno=os.dup(port.fileno())) as connection:
            assert [connection.getsockopt(socket.IPPROTO_TCP, option) for option in options] == [
                1, 5, 1, 5000]
            assert connection.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
        port.close()


def test_host_that_can_have_no_name() -> None:
    with pytest.raises(OSError, match='^x{70}.local is not the name of a host'):
        open_port(PortSettings(f'socket://{"x" * 70}.local:4001'))


@pytest.mark.parametrize('handshake', [False, True])
def test_settings_are_sent_and_their_answers_taken(ends: Ends, handshake: bool) -> None:
    port, server = ends
    accepts = WILL_COM_PORT if handshake else (  # one way is enough, and not each option
        DO_COM_PORT + bytes([255, 252, 44, 255, 254, 3]))
    server.sendall(accepts + b'old data' + BAUD_115200 + REST)
    port.negotiate(replace(EVEN, handshake=handshake))
    said = server.recv(4096)
    offers = bytes([255, 251, 0, 255, 251, 3]) + WILL_COM_PORT
    assert said == offers + offers.replace(b'\xfb', b'\xfd') + b''.join(
        bytes([255, 250, 44, *command, 255, 240]) for command in (
            [1, 0, 1, 0xC2, 0], [2, 8], [3, 3], [4, 1],
            *([[5, 3], [5, 8]] if handshake else [[5, 1], [5, 8], [5, 11]]), [12, 3]))


@pytest.mark.parametrize('short', [
    bytes([255, 250, 255, 240]), bytes([255, 250, 44, 255, 240]),
    bytes([255, 250, 44, 101, 255, 240]), bytes([255, 250, 1, 101, 5, 255, 240])])
def test_option_that_is_short_or_another_answers_nothing(ends: Ends, short: bytes) -> None:
    port, server = ends
    baud = bytes([0, 0, 255, 255, 240])  # 255 is doubled
    server.sendall(DO_COM_PORT + BAUD_115200.replace(b'\0\1\xC2\0', baud) + REST + short)
    port.negotiate(replace(EVEN, baud=0xFFF0))
    assert baud in server.recv(4096)


@pytest.mark.parametrize(('answer', 'text'), [
    (DO_COM_PORT + BAUD_115200.replace(b'\x01\xc2\x00', b'\x00\x25\x80') + REST,
     'does not take Baudrate 115200, its port has 9600'),
    (DO_COM_PORT + BAUD_115200 + REST.replace(b'\x66\x08', b'\x66\x07'),
     'does not take Datasize 8, its port has 7'),
    (DONT_COM_PORT, 'the device server refuses RFC 2217'),
    (b'login: ', 'the other end does not speak RFC 2217'),
    (DO_COM_PORT[:2] + b'\1', 'the other end does not speak RFC 2217'),
    (DO_COM_PORT + BAUD_115200, 'does not answer to settings of its port')])
def test_server_that_refuses_or_does_not_answer(
        ends: Ends, monkeypatch: pytest.MonkeyPatch, answer: bytes, text: str) -> None:
    monkeypatch.setattr(rfc2217_port, 'NEGOTIATION_TIMEOUT', 1.0)
    port, server = ends
    server.sendall(answer)
    with pytest.raises(OSError, match=text):
        port.negotiate(EVEN)


def test_server_that_says_something_else_for_ever_is_given_up(
        ends: Ends, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rfc2217_port, 'NEGOTIATION_TIMEOUT', 0.2)
    port, server = ends
    is_over = threading.Event()

    def drip() -> None:
        while not is_over.wait(0.02):
            server.sendall(b'.')

    dripping = threading.Timer(PATIENCE, is_over.set)
    dripping.start()
    threading.Thread(target=drip, daemon=True).start()
    with pytest.raises(OSError, match='does not speak RFC 2217'):
        port.negotiate(EVEN)
    assert not is_over.is_set()
    is_over.set()
    dripping.cancel()


def test_connection_to_a_server_that_does_not_answer_is_closed(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rfc2217_port, 'NEGOTIATION_TIMEOUT', 0.05)
    with socket.create_server(('127.0.0.1', 0)) as server:
        with pytest.raises(OSError) as error:  # it keeps the port from being thrown away
            open_port(PortSettings(f'rfc2217://127.0.0.1:{server.getsockname()[1]}'))
        connection, _ = server.accept()
        with connection:
            connection.settimeout(PATIENCE)
            while connection.recv(4096):
                pass
    assert 'the other end is silent: another host may have its port' in str(error.value)


def read(port: Rfc2217Port, wake: int, size: int) -> bytes:
    """Return so many bytes of the line."""
    data = b''
    while len(data) < size:
        data += port.read(PATIENCE, wake)
    return data


@pytest.mark.parametrize('stream', [b'\xff\xf1' * READ_SIZE, b'\xff\xff' * READ_SIZE])
def test_commands_count_for_whether_there_is_more(ends: Ends, wake: int, stream: bytes) -> None:
    port, server = ends
    server.sendall(stream)
    for _ in range(2):
        assert len(port.read(PATIENCE, wake)) in (0, READ_SIZE // 2)
        assert port.has_more
    assert port.read(0, wake) == b'' and not port.has_more
    server.sendall(bytes(READ_SIZE - 1))
    assert port.read(PATIENCE, wake) == bytes(READ_SIZE - 1)
    assert not port.has_more


@pytest.mark.parametrize('chunk', [1, 2, 3, 1000])
def test_data_are_what_is_no_command(ends: Ends, wake: int, chunk: int) -> None:
    port, server = ends
    stream = b'a\xff\xffb' + bytes([255, 253, 1]) + b'c' + bytes([255, 241]) + \
        bytes([255, 250, 44, 107, 255, 255, 240, 255, 240]) + b'd\xff\xff'
    data = b''
    for at in range(0, len(stream), chunk):
        server.sendall(stream[at:at + chunk])
        data += port.read(PATIENCE, wake)
    assert data == b'a\xffbcd\xff'
    assert server.recv(100) == bytes([255, 252, 1])  # WONT ECHO


def test_offer_that_is_not_ours_is_refused_once(ends: Ends, wake: int) -> None:
    port, server = ends
    server.sendall(bytes([255, 251, 1, 255, 252, 5, 255, 251, 3]) + b'x')
    assert read(port, wake, 1) == b'x'
    assert server.recv(100) == bytes([255, 254, 1])  # DONT ECHO; SGA was asked for


def test_data_that_look_like_commands_are_doubled(ends: Ends) -> None:
    port, server = ends
    port.write(b'\x10\xff\x02')
    assert server.recv(100) == b'\x10\xff\xff\x02'


def test_suboption_without_an_end_is_given_up(ends: Ends, wake: int) -> None:
    port, server = ends
    server.sendall(bytes([255, 250, 44]) + bytes(400))
    with pytest.raises(OSError, match='sends bytes that are not RFC 2217'):
        for _ in range(2):
            port.read(PATIENCE, wake)


def test_data_that_nobody_reads_stay_with_the_server(ends: Ends) -> None:
    port, server = ends
    server.settimeout(0.2)
    sent = 0
    with pytest.raises(TimeoutError):
        while sent < 100_000_000:
            sent += server.send(bytes(65536))
    assert sent < 10_000_000
