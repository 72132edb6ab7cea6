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

"""The signs of life that systemd waits for (WatchdogSec of the units in deploy/)."""

from collections.abc import Iterator
from pathlib import Path
import socket

from abdf1_ros.ros.process.supervisor import Supervisor
import pytest
from support.ros import EXAMPLE_FILES, PATIENCE, Process, ros_args


class Link:
    """A link whose thread stands still."""

    has_turned = True
    alive = True

    def is_alive(self) -> bool:
        return self.alive

    def wake(self) -> None:
        pass


@pytest.fixture
def systemd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    path = str(tmp_path / 'notify')
    monkeypatch.setenv('NOTIFY_SOCKET', path)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(path)
        receiver.settimeout(PATIENCE)
        yield receiver


def test_no_sign_while_a_link_stands_still(
        systemd: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('WATCHDOG_USEC', '3')
    link, other = Link(), Link()
    supervisor = Supervisor()
    supervisor.look([link, other])
    assert [systemd.recv(99), systemd.recv(99)] == [b'READY=1', b'WATCHDOG=1']
    other.has_turned = True
    supervisor.look([link, other])
    systemd.setblocking(False)
    with pytest.raises(BlockingIOError):
        systemd.recv(99)
    link.alive, other.has_turned = False, True
    supervisor.look([link, other])
    assert systemd.recv(99) == b'WATCHDOG=1'


@pytest.mark.parametrize(('period', 'signs'), [('', []), ('3000000000', [b'WATCHDOG=1'])])
def test_a_sign_comes_once_in_the_period_of_the_watchdog_if_there_is_one(
        systemd: socket.socket, monkeypatch: pytest.MonkeyPatch, period: str,
        signs: list[bytes]) -> None:
    if period:
        monkeypatch.setenv('WATCHDOG_USEC', period)
    supervisor, link = Supervisor(), Link()
    for _ in range(2):
        link.has_turned = True
        supervisor.look([link])
    assert [systemd.recv(99) for _ in ('ready', *signs)] == [b'READY=1', *signs]
    systemd.setblocking(False)
    with pytest.raises(BlockingIOError):
        systemd.recv(99)


@pytest.mark.parametrize('address', ['', '/nowhere/notify', '@abdf1_nobody'])
def test_nobody_has_to_listen(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('NOTIFY_SOCKET', address)
    monkeypatch.setenv('WATCHDOG_USEC', '3')
    Supervisor().look([Link()])


def test_a_bridge_without_its_port_gives_signs(
        systemd: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between two signs its link has turned: it was woken, and tries the port again."""
    monkeypatch.setenv('WATCHDOG_USEC', '300000')
    with Process('node', *ros_args(*EXAMPLE_FILES, 'port:=/dev/ttyS99')) as node:
        assert systemd.recv(99) == b'READY=1'
        assert [systemd.recv(99) for _ in range(5)] == [b'WATCHDOG=1'] * 5
        node.end()
