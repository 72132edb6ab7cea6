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

"""Lines that are made or opened here: their names, who gets them, and what they leave behind."""

from contextlib import closing, suppress
import fcntl
from functools import partial
import os
from pathlib import Path
import socket
import termios
import time

from abdf1_ros.line_names import device_of
from abdf1_ros.ports import endpoints
from abdf1_ros.ports.descriptor import DescriptorPort, NoClient
from abdf1_ros.ports.endpoints import PtyEndpoint, PtyPlace, PtyWire, SerialEndpoint, TcpEndpoint
from abdf1_ros.ports.link_thread import Port
from abdf1_ros.ports.ownership import own
from abdf1_ros.ports.settings import PortSettings
import pytest
from support.counting import open_files
from support.device_server import OWN_HOST
from support.ptys import PATIENCE, Pty, read_exactly

_TIOCGEXCL = 0x80045440  # of Linux: whether TIOCEXCL is set


def exchange(port: Port, other: int, wake: int) -> None:
    """Say something in both directions, every byte that a terminal might change."""
    every = bytes(range(256))
    port.write(every)
    assert read_exactly(other, 256) == every
    os.write(other, every[::-1])
    heard = b''
    while len(heard) < 256 and (data := port.read(PATIENCE, wake)):
        heard += data
    assert heard == every[::-1]


def test_pseudo_terminal_one_client_after_the_other(tmp_path: Path, wake: int) -> None:
    name = str(tmp_path / 'plc')
    with closing(PtyEndpoint(name)) as line:
        assert line.name == name
        for _ in range(2):
            client = os.open(name, os.O_RDWR | os.O_NOCTTY)
            with closing(line.open()) as port:
                exchange(port, client, wake)
            os.close(client)
    assert not os.path.lexists(name)
    PtyEndpoint(name).close()  # the name is free again


def test_place_has_nothing_of_the_program_before(tmp_path: Path, wake: int) -> None:
    name = str(tmp_path / 'plc')
    with closing(PtyPlace(name)) as line:
        with pytest.raises(NoClient):
            line.open()
        for _ in range(3):
            client = os.open(name, os.O_RDWR | os.O_NOCTTY)
            assert fcntl.ioctl(client, _TIOCGEXCL, bytes(4)) == bytes(4)
            port = line.open()
            exchange(port, client, wake)
            port.write(b'never read')
            os.close(client)
            with pytest.raises(OSError, match='Input/output error'):
                port.read(PATIENCE, wake)
            port.close()
            client = os.open(name, os.O_RDWR | os.O_NOCTTY)  # at once
            os.set_blocking(client, False)
            with pytest.raises(BlockingIOError):
                os.read(client, 99)
            os.close(client)
            # Another one that comes and goes before anybody looks.
            client = os.open(name, os.O_RDWR | os.O_NOCTTY)
            os.write(client, b'never to be executed')
            fcntl.ioctl(client, termios.TIOCEXCL)  # but the next one need not be root
            os.close(client)
            with pytest.raises(NoClient):
                line.open()
    assert not os.path.lexists(name)


def test_place_that_a_program_keeps_for_itself_for_ever_is_made_again(
        tmp_path: Path, wake: int, monkeypatch: pytest.MonkeyPatch) -> None:
    name, files, came = str(tmp_path / 'plc'), open_files(), list[int]()
    with closing(PtyPlace(name)) as line:
        client, before = os.open(name, os.O_RDWR | os.O_NOCTTY), os.readlink(name)
        with monkeypatch.context() as patch:  # TIOCEXCL, which does not keep out root
            patch.setattr(line, 'drop_unread', partial(os.open, '/none', 0))
            port = line.open()
            os.close(client)
            port.close()
            with pytest.raises(NoClient), monkeypatch.context() as later:
                later.setattr(line, 'drop_unread', lambda: (  # the next program comes just then
                    came.append(os.open(name, os.O_RDWR | os.O_NOCTTY)), os.open('/none', 0)))
                line.open()
            assert os.readlink(name) == before
            os.close(came[0])
            with pytest.raises(NoClient):
                line.open()
        client = os.open(name, os.O_RDWR | os.O_NOCTTY)
        with closing(line.open()) as port:
            exchange(port, client, wake)
        assert os.readlink(name) != before
        os.close(client)
    assert not open_files() - files


def test_wire_loses_what_no_program_takes(tmp_path: Path, wake: int) -> None:
    name = str(tmp_path / 'plc')
    with closing(PtyWire(name)) as line, closing(line.open()) as port:
        for looks in (0, 1):  # at first the program comes before we look
            port.write(bytes(100_000))
            begun = time.monotonic()
            assert [port.read(0.03, wake) for _ in range(looks)] == [b''] * looks
            assert time.monotonic() - begun >= looks * 0.029  # it waits asleep
            client = os.open(name, os.O_RDWR | os.O_NOCTTY)
            exchange(port, client, wake)
            port.write(bytes(100_000))  # it does not read
            os.write(client, b'last')
            os.close(client)
            assert port.read(PATIENCE, wake) == b'last'


def test_wire_that_a_program_keeps_for_itself_for_ever_is_made_again(
        tmp_path: Path, wake: int, monkeypatch: pytest.MonkeyPatch) -> None:
    name = str(tmp_path / 'plc')
    with closing(PtyWire(name)) as line, closing(line.open()) as port:
        before = os.readlink(name)
        with monkeypatch.context() as patch:  # as above
            patch.setattr(line, 'drop_unread', partial(os.open, '/none', 0))
            with open(name, 'wb'):
                line.forget(-1)  # too late: the next program is here
                assert os.readlink(name) == before
            assert port.read(0.0, wake) == b''
        exchange(port, os.open(name, os.O_RDWR | os.O_NOCTTY), wake)
        assert os.readlink(name) != before
        ours = port.fileno()  # type: ignore[attr-defined]
        assert not os.get_blocking(ours) and not os.get_inheritable(ours)


def test_wire_may_wait_for_its_first_program(tmp_path: Path) -> None:
    with closing(PtyWire(str(tmp_path / 'plc'), is_awaited=True)) as line:
        for _ in range(2):  # also after a loss
            with pytest.raises(NoClient):
                line.open()
            with open(line.name, 'wb'):
                line.open().close()


def test_name_of_an_earlier_pty_is_taken_over(tmp_path: Path) -> None:
    name = tmp_path / 'plc'
    # One that is gone, and one whose number another program has by now.
    with closing(Pty(tmp_path / 'other')) as other:
        for earlier in ('/dev/pts/does-not-exist', os.readlink(other.name)):
            name.symlink_to(earlier)
            with closing(PtyEndpoint(str(name))):
                assert os.readlink(name) not in (earlier, os.readlink(other.name))
                assert name.is_char_device()


def test_link_that_has_been_replaced_stays_at_the_end(tmp_path: Path) -> None:
    name = tmp_path / 'plc'
    line = PtyEndpoint(str(name))
    name.unlink()
    name.symlink_to('/dev/ttyUSB0')
    line.close()
    others = os.pipe()
    line.close()  # closes nothing of others
    assert os.readlink(name) == '/dev/ttyUSB0'
    for descriptor in others:
        os.close(descriptor)


@pytest.mark.parametrize('kind', [PtyEndpoint, PtyPlace])
@pytest.mark.parametrize('link, text', [
    ('taken', 'taken exists already'), ('adapter', 'adapter exists already'),
    ('none/plc', 'none/plc cannot be made: No such file'),
    ('loop/plc', 'loop/plc cannot be made: Too many levels')])
def test_name_that_cannot_be_had_leaves_no_terminal_open(
        tmp_path: Path, kind: type[PtyEndpoint], link: str, text: str) -> None:
    (tmp_path / 'taken').touch()
    (tmp_path / 'adapter').symlink_to('/dev/ttyUSB0')
    (tmp_path / 'loop').symlink_to('loop')
    before = open_files()
    with pytest.raises(OSError, match=text) as error:
        kind(str(tmp_path / link))
    assert not open_files() - before, error  # which keeps all from being thrown away
    assert sorted(os.listdir(tmp_path)) == ['adapter', 'loop', 'taken']


def test_bridge_that_looks_for_a_port_does_not_keep_its_name_from_a_pty(tmp_path: Path) -> None:
    with closing(own(device_of(f'{tmp_path}/plc'))):  # as at each attempt to open it
        PtyEndpoint(f'{tmp_path}/plc').close()


def test_link_is_one_however_it_is_written(tmp_path: Path) -> None:
    (tmp_path / 'folder').mkdir()
    (tmp_path / 'same').symlink_to('folder')
    names = [f'{tmp_path}/folder/plc', f'{tmp_path}//folder/plc', f'{tmp_path}/same/plc',
             f'{tmp_path}/same/../folder/./plc']
    for first in names:
        with closing(PtyEndpoint(first)):
            before = os.readlink(names[0])
            for other in names:
                with pytest.raises(OSError, match='is in use by another bridge, simulator'):
                    PtyEndpoint(other)
            assert os.readlink(names[0]) == before


def test_tcp_one_client_after_the_other(wake: int) -> None:
    with closing(TcpEndpoint(OWN_HOST, 0)) as line:
        scheme, _, address = line.name.partition('://')
        host, _, number = address.partition(':')
        assert (scheme, host) == ('socket', OWN_HOST)
        begun = time.monotonic()
        with pytest.raises(NoClient):
            line.open()
        assert time.monotonic() - begun >= 0.19  # it waits asleep
        for _ in range(2):
            with socket.create_connection((host, int(number)), PATIENCE) as client, \
                    closing(line.open()) as port:
                exchange(port, client.fileno(), wake)
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((host, int(number)), PATIENCE)


@pytest.mark.parametrize('is_busy', [False, True])
def test_tcp_second_client_is_closed_at_once_and_nothing_of_it_comes_later(
        is_busy: bool, wake: int) -> None:
    told: list[str] = []
    with closing(TcpEndpoint(OWN_HOST, 0, told.append)) as line:
        address = OWN_HOST, int(line.name.rpartition(':')[2])
        first = socket.create_connection(address, PATIENCE)
        with closing(line.open()) as port, socket.create_connection(address, PATIENCE) as second:
            second.sendall(b'late')
            if is_busy:
                first.sendall(b'first')
            assert port.read(PATIENCE, wake) == (b'first' if is_busy else b'')
            with suppress(ConnectionResetError):
                assert second.recv(1) == b''
            first.close()
            with pytest.raises(OSError, match='closed'):
                port.read(PATIENCE, wake)
        with pytest.raises(NoClient):
            line.open()
        who, = told
        assert who.startswith('127.0.0.1:')


@pytest.mark.parametrize('is_ended', [False, True])
def test_tcp_client_that_comes_right_after_another_has_left_is_not_turned_away(
        is_ended: bool, wake: int) -> None:
    told: list[str] = []
    with closing(TcpEndpoint(OWN_HOST, 0, told.append)) as line:
        address = OWN_HOST, int(line.name.rpartition(':')[2])
        first = socket.create_connection(address, PATIENCE)
        with closing(line.open()) as port:
            first.sendall(b'last')
            first.close()
            with socket.create_connection(address, PATIENCE) as second:
                with pytest.raises(OSError, match='closed'):
                    port.read(PATIENCE, wake)  # what it said last, and with it both events
                if is_ended:
                    line.close()
                    assert second.recv(1) == b''
                    return
                second.sendall(b'first')
                with closing(line.open()) as again:
                    assert again.read(PATIENCE, wake) == b'first'
    assert told == []


@pytest.mark.parametrize(('said', 'seconds', 'is_taken'), [
    (b'', 29.9, False), (b'said', 29.9, False), (b'said', 30.1, True)])
def test_tcp_client_that_says_nothing_gives_its_place_to_the_next(
        said: bytes, seconds: float, is_taken: bool, wake: int,
        monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(endpoints, 'monotonic', lambda: now)
    with closing(TcpEndpoint(OWN_HOST, 0)) as line:
        address = OWN_HOST, int(line.name.rpartition(':')[2])
        with socket.create_connection(address, PATIENCE) as silent:
            port = line.open()
            now += 29.0 * bool(said)
            silent.sendall(said)
            assert port.read(PATIENCE if said else 0.0, wake) == said
            now += seconds
            with socket.create_connection(address, PATIENCE) as other:
                other.sendall(b'of the other')
                if not is_taken:
                    assert port.read(PATIENCE, wake) == b''
                    port.close()
                    return
                with pytest.raises(OSError, match='no sign of life for 30 s'):
                    port.read(PATIENCE, wake)
                port.close()
                with closing(line.open()) as taken:
                    assert taken.read(PATIENCE, wake) == b'of the other'
                with pytest.raises(NoClient):
                    line.open()


def test_tcp_client_that_has_vanished_is_missed_within_ten_seconds() -> None:
    with closing(TcpEndpoint(OWN_HOST, 0)) as line, socket.create_connection(
            (OWN_HOST, int(line.name.rpartition(':')[2])), PATIENCE), closing(line.open()) as port:
        assert isinstance(port, DescriptorPort)
        with socket.socket(fileno=os.dup(port.fileno())) as ours:
            ask = ours.getsockopt
            assert ask(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
            idle, pause, most = (ask(socket.IPPROTO_TCP, option) for option in (
                socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT))
            assert idle + pause * most == 10
            assert ask(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == 10_000


def test_serial_port_is_opened_at_once_and_again_when_it_was_lost(
        tmp_path: Path, wake: int) -> None:
    with closing(Pty(tmp_path / 'port')) as pty, \
            closing(SerialEndpoint(PortSettings(str(pty.name)))) as line:
        assert line.name == str(pty.name)
        for _ in range(2):
            with closing(line.open()) as port:
                exchange(port, pty.fileno(), wake)
                with pytest.raises(OSError, match='Errno 16'):  # it is open already
                    line.open()
        pty.close()
        with pytest.raises(OSError, match='No such file'):
            line.open()


def test_serial_port_that_nobody_has_taken_is_closed(tmp_path: Path) -> None:
    with closing(Pty(tmp_path / 'port')) as pty:
        lines = []  # kept, so that nobody but close() closes them
        for _ in range(2):
            lines.append(SerialEndpoint(PortSettings(str(pty.name))))
            lines[-1].close()
