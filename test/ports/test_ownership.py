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

"""One line, one owner, however its port is written."""

from collections.abc import Iterator
import os
from pathlib import Path
import socket

from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.ownership import line_of
from abdf1_ros.ports.settings import PortSettings
import pytest
from support.cases import for_all
from support.forked import Forked
from support.ptys import Pty


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
    open_port(PortSettings(f'socket://127.1:{server}')).close()


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
