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

"""The one way to open a port, a trial before a change, and that a line has one owner."""

from collections.abc import Iterator
from contextlib import closing
import os
from pathlib import Path
import pty
import socket
import sys
import threading
from types import ModuleType
from unittest.mock import Mock

from abdf1_ros.ports import trial
from abdf1_ros.ports.descriptor import DescriptorPort, Port
from abdf1_ros.ports.opening import name_port, open_port
from abdf1_ros.ports.ownership import line_of, own
from abdf1_ros.ports.settings import Lack, PortSettings
from abdf1_ros.ports.trial import why_not
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings import network
import pytest
from support.cases import for_all
from support.forked import Forked
from support.ptys import PATIENCE, Pty


@pytest.fixture
def made_up(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[PortSettings]]:
    """Add a scheme: its module, and its name in the settings; yield what it is asked to open."""
    asked: list[PortSettings] = []
    module = ModuleType('abdf1_ros.ports.pigeon_port')
    module.open_port = lambda settings: (  # type: ignore[attr-defined]
        asked.append(settings), DescriptorPort(0, lambda: None))[1]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(network, 'DEVICE_SERVERS', (*network.DEVICE_SERVERS, 'pigeon'))
    yield asked


def test_scheme_is_a_file_and_a_word(made_up: list[PortSettings]) -> None:
    cells = {'com_port': 'pigeon://loft:7', 'baud': '19200', 'data_bits': '7', 'parity': 'Even',
             'stop_bits': '2', 'handshake': 'Yes'}
    open_port(PortSettings.of(network.make_network(
        {name: (cell, 'test') for name, cell in cells.items()}))).close()
    assert made_up == [PortSettings('pigeon://loft:7', 19200, 7, 'Even', 2, handshake=True)]


@pytest.mark.parametrize('rs485', [True, False])
def test_transmitter_of_a_device_server_is_not_switched_from_here(
        made_up: list[PortSettings], rs485: bool) -> None:
    told: list[Lack] = []
    open_port(PortSettings('pigeon://loft:7', rs485=rs485), told.append).close()
    assert told == [Lack('rs485', 'rs485 has no effect: only the device server can switch its '
                                  'transmitter')] * rs485


@pytest.mark.parametrize('name', ['loop://', 'pigeon://loft:7'])  # pyserial knows the first
def test_scheme_that_nobody_knows_is_no_port(name: str) -> None:
    with pytest.raises(ConfigurationError):
        network.make_network({'com_port': (name, 'test')})
    with pytest.raises(OSError, match='No such file'):
        open_port(PortSettings(name))


@pytest.mark.parametrize(('error', 'text'), [
    (OSError('the device server refuses RFC 2217'),
     "[Errno 5] the device server refuses RFC 2217: 'rfc2217://loft:7'"),
    (OSError(2, 'No such file', '/lock'), "[Errno 2] No such file: '/lock'")])
def test_error_that_gets_the_name_of_the_port_keeps_its_text(error: OSError, text: str) -> None:
    name_port(error, 'rfc2217://loft:7')
    assert str(error) == text


def test_scheme_that_lacks_what_it_needs_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, 'abdf1_ros.ports.rfc2217_port', raising=False)
    monkeypatch.setitem(sys.modules, 'struct', None)
    with pytest.raises(ModuleNotFoundError, match='struct'):
        open_port(PortSettings('rfc2217://host:1'))


def test_device_that_opens_is_left_free(monkeypatch: pytest.MonkeyPatch) -> None:
    master, slave = pty.openpty()
    settings = PortSettings(os.ttyname(slave))
    kept: dict[str, Port] = {}  # so that nobody but close() closes it
    monkeypatch.setattr(
        trial, 'open_port', lambda asked: kept.setdefault(asked.name, open_port(asked)))
    assert why_not(settings, 10.0) == ''
    port = open_port(settings)
    assert why_not(settings, 10.0) == 'another program has it open'
    assert why_not(PortSettings('/dev/ttyS_none'), 10.0) == 'No such file or directory'
    port.close()
    os.close(slave)
    os.close(master)


@pytest.mark.parametrize(('scheme', 'error', 'expected'), [
    ('socket', socket.gaierror(socket.EAI_NONAME, 'Name or service not known'),
     'Name or service not known'),
    ('rfc2217', socket.gaierror(socket.EAI_AGAIN, 'Temporary failure in name resolution'), '')])
def test_host_is_looked_up_and_not_connected_to(
        monkeypatch: pytest.MonkeyPatch, scheme: str, error: OSError, expected: str) -> None:
    asked = []

    def look_up(*arguments: object) -> None:
        asked.append(arguments)
        raise error

    monkeypatch.setattr(trial.socket, 'getaddrinfo', look_up)
    monkeypatch.setattr(trial.socket.socket, 'connect', lambda *arguments: pytest.fail('connects'))
    assert why_not(PortSettings(f'{scheme}://plc-gate:4001'), 10.0) == expected
    assert asked == [('plc-gate', None)]


def test_port_that_does_not_say_in_time_is_not_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    ended = threading.Event()
    monkeypatch.setattr(trial, 'try_port', lambda settings: ended.wait())
    assert why_not(PortSettings('/dev/ttyS0'), 0.0) == ''
    ended.set()


Sockets = tuple[DescriptorPort, socket.socket]


def test_write_to_a_line_that_takes_no_more_does_not_hang(
        sockets: Sockets, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.ports.descriptor.WRITE_TIMEOUT', 0.05)
    with pytest.raises(OSError, match='the line takes no data; is Handshake right'):
        sockets[0].write(bytes(10_000_000))


def test_write_waits_for_a_line_that_is_slow(
        sockets: Sockets, monkeypatch: pytest.MonkeyPatch) -> None:
    port, other = sockets
    received = bytearray()

    def read_all() -> None:
        while len(received) < 1_000_000:
            received.extend(other.recv(65536))

    def now() -> float:  # is asked for when there is no room
        if not reader.ident:
            reader.start()
        return 100.0

    reader = threading.Thread(target=read_all)
    monkeypatch.setattr('abdf1_ros.ports.descriptor.time', Mock(monotonic=now))
    port.write(bytes(1_000_000))
    reader.join(PATIENCE)
    assert len(received) == 1_000_000


def test_port_tells_that_bytes_have_still_to_leave(sockets: Sockets) -> None:
    port, other = sockets
    assert port.unsent() == 0
    port.write(bytes(300))
    assert port.unsent() >= 300
    other.recv(300)
    assert port.unsent() == 0


def test_port_that_cannot_tell_what_has_still_to_leave_says_none(pipe: tuple[int, int]) -> None:
    assert DescriptorPort(pipe[1], lambda: None).unsent() == 0


@for_all('url', [
    'socket://127.0.0.1:4001', 'SOCKET://127.1:4001', 'socket://127.0.0.1:04001',
    'rfc2217://localhost:4001', 'socket://LocalHost:4001', 'socket://[::1]:4001',
    'socket://[::ffff:127.0.0.1]:4001', 'socket://0.0.0.0:4001', 'socket://2130706433:4001'])
def test_device_server_is_one_port_under_all_its_names(url: str) -> None:
    assert line_of(url) == '127.0.0.1:4001'


@for_all('url', [
    'socket://127.0.0.1:4002', 'socket://127.0.0.2:4001', 'socket://10.0.0.1:4001',
    'socket://[fe80::1]:4001', 'socket://moxa.plant:4001'])
def test_other_device_servers_are_others(url: str) -> None:
    assert line_of(url) != '127.0.0.1:4001'
    assert line_of(url) == line_of(url.upper())


@pytest.mark.parametrize('host', ['192.168.0..9', 64 * 'a'])
def test_name_that_no_host_can_have_is_itself(host: str) -> None:
    assert line_of(f'socket://{host}:4001') == f'{host}:4001'


def test_device_is_known_by_its_number(tmp_path: Path) -> None:
    line, other = Pty(tmp_path / 'line'), Pty(tmp_path / 'other')
    (tmp_path / 'link').symlink_to('line')
    assert line_of(str(tmp_path / 'link')) == line_of(os.path.realpath(line.name))
    assert line_of(str(line.name)) != line_of(str(other.name))
    line.close()
    other.close()


def test_port_that_is_not_there_is_known_by_its_path(tmp_path: Path) -> None:
    (tmp_path / 'link').symlink_to('nothing')
    assert line_of(str(tmp_path / 'link')) == line_of(str(tmp_path / 'nothing'))
    (tmp_path / 'loop').symlink_to('loop')
    assert line_of(str(tmp_path / 'loop')) == str(tmp_path / 'loop')
    assert line_of('socket://host:99999'[:-1]) == 'host:9999'


@pytest.fixture
def server() -> Iterator[int]:
    """Return the port of a device server that takes any number of connections."""
    with socket.create_server(('127.0.0.1', 0)) as listener:
        yield listener.getsockname()[1]


def test_port_of_a_device_server_has_one_owner_until_he_leaves_it(server: int) -> None:
    port = open_port(PortSettings(f'socket://localhost:{server}'))
    for url in (f'socket://127.1:{server}', f'rfc2217://127.0.0.1:0{server}'):
        with pytest.raises(OSError, match='this program has it open, or has not ended its last'):
            open_port(PortSettings(url))
    port.close()
    with closing(own(f'127.0.0.1:{server}')), pytest.raises(OSError, match='another program has'):
        open_port(PortSettings(url))
    open_port(PortSettings(f'SOCKET://127.1:{server}')).close()


def test_port_of_a_device_server_is_refused_to_another_process(server: int) -> None:
    port = open_port(PortSettings(f'socket://localhost:{server}'))
    other = Forked('plc', ('status', '1', '--port', f'socket://127.0.0.1:{server}'))
    assert 'another program has it open' in other.stderr.read()
    assert other.wait(60) == 1
    port.close()


def test_connection_that_fails_leaves_the_port_to_others() -> None:
    with socket.socket() as nobody:  # listens, and nobody else can
        nobody.bind(('127.0.0.1', 0))
        for _ in range(2):
            with pytest.raises(ConnectionRefusedError):
                open_port(PortSettings(f'socket://127.0.0.1:{nobody.getsockname()[1]}'))
