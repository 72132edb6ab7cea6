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

"""A line that is shared: real ports and threads, good guests and bad ones."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
import select
import socket
import threading
import time
from types import SimpleNamespace

from abdf1_ros.cli.conform import main as conform
from abdf1_ros.cli.plc.command import main as plc
from abdf1_ros.client import Client
from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.guests import GuestCommand, GuestListener, GuestQueue
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.ports import endpoints
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ports.descriptor import NoClient, READ_SIZE
from abdf1_ros.ports.endpoints import PtyEndpoint
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.share import share_places
from abdf1_ros.share.guest_line import guest_place, GuestLine
import pytest
from support.cases import for_all
from support.device_server import OWN_HOST
from support.driver_bench import FarEnd, Recorder, simulated_plc, store, stored
from support.mappings import make_mapping
from support.odd_device import frame as odd_frame
from support.ptys import Pty

# The rules themselves are those of a peer, played in test/conform; here that a place is one.
QUICK = ('bad-check-refused', 'enquiry-after-ack', 'masked-write')


class Shared:
    """A driver that reads an SLC all the time, and the places of its line."""

    def __init__(self, folder: Path, places: str, access: str, mode: str) -> None:
        self.plc = simulated_plc(1, 'SLC', line_time, ('N7:0', 50), ('N10:0', 20))
        store(self.plc, 'N7:0', range(50))
        if mode == 'Peer':
            self.plc.be_full_duplex()
        # All are threads of this process, which a busy host may let stand still for 2 s.
        network = Network(mode=mode, timeout=3000, cmd_timeout=5000, baud=115200, share=places,
                          share_access=access)
        self._line = PtyEndpoint(str(folder / 'plc'))
        self._far = LinkThread(FarEnd([self.plc], network), self._line.open)
        self.listener = Recorder(line_time)
        rows = [make_mapping('N10:0', plc='SLC', period=50), make_mapping(
            'N10:10', 'Heartbeat', plc='SLC', period=200)]
        self.driver = Driver(network, rows, DriverSettings(), self.listener)
        name = self._line.name
        self.near = LinkThread(self.driver.machine, lambda: open_port(PortSettings(name)))
        self.faults: list[Exception] = []
        self.guests = [guest_place(place, (1,), network, self.driver.guests, self.near.wake,
                                   GuestListener(), self.faults.append)
                       for place in share_places(places)]

    def start(self) -> None:
        for thread in (self._far, self.near, *self.guests):
            thread.start()

    def stop(self) -> None:
        for thread in (*self.guests, self.near, self._far):
            thread.stop()
        self._line.close()


@contextmanager
def shared(folder: Path, places: str, access: str = 'Read',
           mode: str = 'Master') -> Iterator[Shared]:
    """Run a shared line; a guest may do what it likes, there is no internal error."""
    line = Shared(folder, places, access, mode)
    line.start()
    try:
        wait_for(lambda: line.near.state.is_open and all(
            guest.state != 'not opened yet' for guest in line.guests))
        yield line
    finally:
        line.stop()
    assert line.faults == []


def free_port() -> int:
    with socket.create_server((OWN_HOST, 0)) as listener:
        return int(listener.getsockname()[1])


def wait_for(condition: Callable[[], object], limit: float = 30.0) -> None:
    give_up = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < give_up
        time.sleep(0.02)


def client_at(port: Path | str) -> Client:
    """Return a client at a place."""
    if isinstance(port, Path):
        wait_for(port.exists)
    return Client(str(port), plc_type='SLC', timeout=8.0, cmd_timeout=10.0)


@pytest.mark.parametrize('mode', ['Master', 'Peer'])
def test_two_guests_read_and_write_and_none_gets_the_other_ones_values(
        mode: str, tmp_path: Path) -> None:
    port = free_port()
    with shared(tmp_path, f'pty:{tmp_path}/hmi tcp:{OWN_HOST}:{port}', 'Write', mode) as line:
        wrong: list[object] = []

        def work(client: Client, first: int) -> None:
            for number in range(40):
                at = first + number % 20
                if client.read(f'N7:{first}', 3) != [*range(first, first + 3)]:
                    wrong.append(number)
                client.write(f'N10:{first // 5 + 1}', number)
                if client.read(f'N10:{first // 5 + 1}') != number:
                    wrong.append((at, number))

        with client_at(tmp_path / 'hmi') as one, client_at(f'socket://{OWN_HOST}:{port}') as two:
            threads = [threading.Thread(target=work, args=(client, first))
                       for client, first in ((one, 0), (two, 25))]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join(60)
        assert wrong == []
        assert [line.guest.commands for line in line.guests] == [120, 120]
        assert [line.guest.unanswered for line in line.guests] == [0, 0]
        assert stored(line.plc, 'N10:1') == b'\x27\x00'
    assert not (tmp_path / 'hmi').is_symlink()


def test_place_is_a_peer_of_the_manual(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The link rules at a place, judged by the kit; BCC there, CRC on the line."""
    with shared(tmp_path, f'pty:{tmp_path}/hmi?check=BCC', 'All'):
        wait_for((tmp_path / 'hmi').exists)
        status = conform(['peer', '--port', str(tmp_path / 'hmi'), '--check', 'BCC',
                          '--answer-time', '1', '--words', 'N7:0', '--yes',
                          *(word for case in QUICK for word in ('--only', case))])
    said = capsys.readouterr().out
    assert status == 0, said
    assert '0 failed' in said


def test_files_are_listed_with_read_and_the_clock_is_set_with_write(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for access, is_set in ('Read', False), ('Write', True):
        with shared(tmp_path, f'pty:{tmp_path}/hmi', access) as line:
            line.plc.table.create(parse_address('S:0', PlcType.SLC), 66)
            wait_for((tmp_path / 'hmi').exists)
            port = ('1', '--port', str(tmp_path / 'hmi'), '--peer', '--timeout', '3000')
            assert plc(['files', *port]) == 0
            listed = [row.split() for row in capsys.readouterr().out.splitlines()]
            assert listed == [[file, size, 'elements'] for file, size in (
                ('S2', '66'), ('N7', '50'), ('N10', '20'))]
            assert plc(['clock', *port, '--set', '--yes']) == (0 if is_set else 1)
            assert any(stored(line.plc, 'S:37', 6)) is is_set
            capsys.readouterr()


def test_place_on_a_serial_device(tmp_path: Path) -> None:
    device = Pty(tmp_path / 'hmi')
    try:
        with shared(tmp_path, f'{device.name}?baud=9600&check=BCC') as line:
            wait_for(lambda: line.guests[0].guest.is_connected)
            device.write(frames.message_frame(
                Packet(1, 9, 0x06, 0, 1, b'\0ab').encode(), Checksum.BCC))
            reply = frames.message_frame(Packet(9, 1, 0x46, 0, 1, b'ab').encode(), Checksum.BCC)
            assert device.read(2 + len(reply)) == frames.ACK + reply
            assert all(guest.link.daemon for guest in line.guests)
    finally:
        device.close()


def test_place_of_ipv6(tmp_path: Path) -> None:
    try:
        with socket.create_server(('::1', 0), family=socket.AF_INET6) as listener:
            port = listener.getsockname()[1]
    except OSError:
        pytest.skip('this machine has no IPv6')
    with shared(tmp_path, f'tcp:[::1]:{port}') as line, \
            client_at(f'socket://[::1]:{port}') as client:
        assert client.read('N7:1', 2) == [1, 2]
        assert line.guests[0].guest.name == f'tcp:[::1]:{port}'


def test_place_that_cannot_be_opened_says_why_until_it_can(tmp_path: Path) -> None:
    (tmp_path / 'hmi').write_text('mine')
    with shared(tmp_path, f'pty:{tmp_path}/hmi tcp:{OWN_HOST}:{free_port()}') as line:
        taken, waiting = line.guests
        assert 'exists already' in taken.fault
        assert (waiting.state, waiting.fault) == ('waiting for a client', '')
        assert (tmp_path / 'hmi').read_text() == 'mine'
        (tmp_path / 'hmi').unlink()
        wait_for(lambda: not taken.fault)
        for _ in range(2):  # also after a pause
            with client_at(tmp_path / 'hmi') as client:
                assert client.read('N7:1') == 1
            wait_for(lambda: not taken.guest.is_connected)
            taken.pause()
            taken.start()


class Waits:
    """A port whose reads take what they take, and bring what they bring."""

    is_terminal = False

    def __init__(self, *reads: tuple[float, bytes]) -> None:
        self.now, self.has_more = 100.0, False
        self.end = lambda: None
        self._reads = iter(reads)

    def open(self) -> Waits:  # noqa: A003
        return self

    def clock(self) -> float:
        return self.now

    def read(self, timeout: float | None, wake: int) -> bytes:
        seconds, data = next(self._reads, (0.0, None))
        if data is None:
            self.end()
            raise OSError('the end')
        assert data or timeout is not None and timeout <= 0.1
        self.now += seconds if data else timeout or 0.0
        self.has_more = len(data) == READ_SIZE
        return data

    def write(self, data: bytes) -> None:
        pass

    def unsent(self) -> int:
        return 0

    def close(self) -> None:
        pass


class Queue(GuestQueue):

    def __init__(self, put: Callable[[GuestCommand], None]) -> None:
        self.put = put


def guest_line(place: str, put: Callable[[GuestCommand], None] = lambda command: None,
               wake: Callable[[], None] = lambda: None, clock: Callable[[], float] = line_time,
               fault: Callable[[Exception], None] = lambda error: None) -> GuestLine:
    network = Network(share=place, parity='Odd', stop_bits=2)
    return GuestLine(*share_places(place), network, Queue(put), wake, GuestListener(), fault,
                     clock)


def requested(*reads: tuple[float, bytes]) -> list[tuple[float, float]]:
    """Return when each command may have come at the earliest, and when it was here."""
    port, found = Waits(*((0.1, b''),) * 5, *reads), list[tuple[float, float]]()
    woken: list[int] = []
    line = guest_line('tcp:4501', lambda command: found.append((
        round(command.requested - 100.5, 3), round(port.now - 100.5, 3))),
        lambda: woken.append(len(found)), port.clock)
    port.end = line.link.ask_to_stop
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr('abdf1_ros.share.guest_line.TcpEndpoint', lambda *_: port)
        line.link.run()
    line.link.stop()
    assert woken == [*range(1, len(found) + 1)]
    return found


def framed(tns: int) -> bytes:
    return frames.message_frame(
        Packet(1, 9, 0x0F, 0, tns, bytes.fromhex('A2 02 07 89 00 00')).encode(), Checksum.CRC)


def test_command_is_as_old_as_it_can_be_where_this_process_stood_still() -> None:
    idle = (0.1, b'')
    assert requested((0.05, framed(1)), (3.0, framed(2)), idle, (0.05, framed(3)), idle,
                     (0.29, framed(4)), idle, (0.31, framed(5))) == [
        (0.05, 0.05), (0.0, 3.05), (3.2, 3.2), (3.59, 3.59), (3.59, 4.0)]


def test_command_in_a_flood_is_as_old_as_the_flood() -> None:
    noise = (0.1, bytes(READ_SIZE))
    (came, here), = requested((0.1, framed(1)), *(noise,) * 20, (0.1, framed(2)))[1:]
    assert came <= 0.1 and here >= 2.0


def test_reply_to_a_program_that_has_left_does_not_go_to_the_next() -> None:
    asked: list[GuestCommand] = []
    line = guest_line('tcp:4501', asked.append)
    for now in 100.0, 200.0:  # the second program connects
        line.machine.start(now)
        line.machine.handle_timeout(now + 1.0)
        line.machine.receive_data(framed(int(now)), now + 1.0)
    assert line.machine.data_to_send() == frames.ACK
    for command in asked:
        command.answer(command.packet.reply())
    line.machine.wake(202.0)
    assert line.machine.data_to_send() == frames.message_frame(
        asked[1].packet.reply().encode(), Checksum.CRC)
    line.stop()


@pytest.mark.parametrize('is_frame', [False, True])
def test_place_is_kept_by_good_frames_not_by_bytes(
        is_frame: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A program sends something each 8 s, up to 32 s; then another program comes."""
    command = odd_frame(bytes.fromhex('01 09 0F 00 01 00 A2 02 07 89 00 00'))
    now, asked = 100.0, list[GuestCommand]()
    monkeypatch.setattr(endpoints, 'monotonic', lambda: now)
    line = guest_line(f'tcp:{OWN_HOST}:{(port := free_port())}', asked.append)

    def say(client: socket.socket, data: bytes) -> None:
        heard = line.machine.counters.chars_received + len(data)
        client.sendall(data)
        wait_for(lambda: line.machine.counters.chars_received == heard)

    line.start()
    wait_for(lambda: line.state == 'waiting for a client')
    with socket.create_connection((OWN_HOST, port), 30.0) as first:
        for said in (b'A', b'\x10\x05', command[:-1] + b'!', command if is_frame else b'A'):
            say(first, said)
            now += 8.0
        with socket.create_connection((OWN_HOST, port), 30.0) as second:
            if is_frame:
                assert second.recv(1) == b''
            else:
                second.sendall(command)
                assert second.recv(2) == b'\x10\x06'
                while first.recv(100):
                    pass
    line.stop()
    assert len(asked) == 1


def test_internal_error_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    faults: list[Exception] = []
    line = guest_line('tcp:4501', lambda command: 1 / 0, fault=faults.append)
    monkeypatch.setattr('abdf1_ros.share.guest_line.TcpEndpoint', lambda *_: SimpleNamespace(
        open=lambda: Waits((0.0, framed(1))), close=lambda: None))
    line.link.run()
    assert [*map(type, faults)] == 3 * [ZeroDivisionError]
    assert line.fault.startswith('internal error: ZeroDivisionError')


@for_all(('place', 'bits', 'baud'), [
    ('/dev/ttyS9?baud=1200&parity=None', 11, 1200), ('/dev/ttyS9?parity=Even', 12, 9600),
    ('/dev/ttyS9', 12, 9600), ('pty:/tmp/hmi', 0, 1), ('tcp:4501', 0, 1)])
def test_characters_take_time_on_a_serial_device(place: str, bits: int, baud: int) -> None:
    """A reply that leaves slowly is not asked for with ENQ before it can have come."""
    line = guest_line(place)
    line.stop()
    assert line.machine.timing.char_time == pytest.approx(bits / baud)


def test_looks_for_a_program_are_frequent_and_without_a_wait(
        monkeypatch: pytest.MonkeyPatch) -> None:
    """The time between them counts into the age of a program's first command."""
    waits: list[float] = []
    monkeypatch.setattr(select, 'poll', lambda: SimpleNamespace(
        register=lambda *of: None, poll=waits.append))
    line = guest_line(f'tcp:{OWN_HOST}:{(port := free_port())}')
    monkeypatch.setattr(line.link, 'release', lambda: pytest.raises(NoClient, line.open_port))
    line.pause()  # the thread may look once more until it has released the place
    assert (waits, line.link.retry_period) == ([0], 0.1)
    socket.create_server((OWN_HOST, port)).close()
    line.stop()
