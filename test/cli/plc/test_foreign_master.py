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

"""A line that has a master: it is heard before anything is sent, and asked through."""

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import select
import socket
import threading
from types import SimpleNamespace
from unittest.mock import call, Mock

from abdf1_ros import client
from abdf1_ros.cli import check
from abdf1_ros.cli.overhearing import map_of, texts_of
from abdf1_ros.cli.plc import detect, line, overhear
from abdf1_ros.cli.plc.command import main
from abdf1_ros.cli.plc.init import listening_csv
from abdf1_ros.cli.plc.verbs import init
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.listen import SecondPort
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver import requests
from abdf1_ros.driver.overheard import Carried
from abdf1_ros.paths import called
from abdf1_ros.pccc.describe import describe
from abdf1_ros.settings.network import Network
import pytest
from support.cases import for_all
from support.clock import Clock
from support.commands import Output
from support.odd_device import frame
from support.ptys import Pty

POLL = b'\x10\x05\x01\xFF'


@pytest.fixture
def listening_is_short() -> None:
    """Listen as long as a user would."""


class Master(threading.Thread):
    """
    A master, by hand: it polls ``stations``, and gives what they say to a PLC that is itself.

    The PLC is an SLC whose N7:0 is 42, as station 1; it says no more.
    """

    def __init__(self, line: Pty, *stations: int) -> None:
        super().__init__(daemon=True)
        self._line, self._stations = line, stations
        self.heard = b''
        self.over = threading.Event()
        os.set_blocking(line.fileno(), False)

    def run(self) -> None:
        while not self.over.wait(0.02):
            for station in self._stations:
                self._line.write(bytes((0x10, 0x05, station, -station & 0xFF)))
                if self.over.wait(0.02):
                    return
                self._take(station)

    def _take(self, station: int) -> None:
        try:
            data = os.read(self._line.fileno(), 300)
        except BlockingIOError:
            return
        self.heard += data
        _, begins, message = data.partition(b'\x10\x02')  # after EOTs, if the host stood still
        if not begins:
            return
        dst, src, cmd, _, *tns = message.replace(b'\x10\x10', b'\x10')[:6]
        value = b'\x2a\x00' if dst == 1 else b''
        reply = bytes((src, dst, cmd | 0x40, 0 if dst == 1 else 2, *tns)) + value
        self._line.write(b'\x10\x06')
        data = b''
        while b'\x10\x06' not in data and not self.over.wait(0.02):
            self._line.write(frame(reply, station))
            if select.select([self._line], [], [], 0.5)[0]:
                data = os.read(self._line.fileno(), 300)


@contextmanager
def master_on(path: Path, *stations: int) -> Iterator[tuple[str, Master]]:
    """Put a master on a pseudo-terminal."""
    line = Pty(path)
    master = Master(line, *stations)
    master.start()
    try:
        yield str(line.name), master
    finally:
        master.over.set()
        master.join()
        line.close()


@pytest.mark.parametrize('command', ['detect', 'init'])
def test_line_that_has_a_master_is_only_listened_to(
        tmp_path: Path, capsys: Output, command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(overhear, 'LISTENED_FOR_READS', 0.2)
    into = ['--into', str(tmp_path / 'new')] if command == 'init' else []
    monkeypatch.setattr(detect, 'Progress', progress := Mock())
    with master_on(tmp_path / 'line', 1, 3, 7) as (port, master):
        assert main([command, '--port', port, *into]) == 1
        assert master.heard == b''
    assert progress.return_value.mock_calls[-1] == call.clear()  # before it is told
    what = 'Next: "plc init" writes net.csv and map.csv for Mode Listen' \
        if command == 'detect' else 'No read with its reply was heard, so no file was written'
    assert capsys.readouterr().err.splitlines()[-2:] == [
        'plc: another master polls stations 1, 3, 7, 19200 baud, check unknown: nothing was sent. '
        f'{what}',
        f'plc: "sniff --port {port} --baud 19200" shows what the master reads. "plc read N7:0 '
        '--slave --own-station N" asks through the master, if it polls a number N that no PLC has']
    assert not (tmp_path / 'new').exists()


def test_silent_line_is_listened_to_at_one_speed(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(overhear, 'LISTENED', 0.05)
    line = Pty(tmp_path / 'line')
    shown: list[str] = []
    assert overhear.overhear(Network(com_port=str(line.name)), (19200, 9600), shown.append) is None
    line.close()
    assert shown == ['listening at 19200 baud']
    # A device server takes its speed only from a port that may write.
    assert [overhear.silent(Network(com_port=f'{scheme}://x:1')).mode
            for scheme in ('rfc2217', 'socket')] == ['Master', 'Listen']


@pytest.mark.parametrize(('said', 'later', 'told'), [
    (POLL, b'', 'None'), (POLL, POLL, 'polls station 1, 9600 baud, check unknown'),
    (POLL + b'\x10\x05\x03\xFD', b'', 'polls stations 1, 3, 9600 baud, check unknown'),
    (POLL + frame(bytes(6), 1), b'', 'polls station 1, 9600 baud, CRC'),
    (2 * frame(bytes(6)), POLL, 'None'), (3 * b'\x10\x05\x01\xFE', POLL, 'None'),
    (POLL + b'\x10\x05\x03\xFE', b'', 'None')])
def test_two_polls_or_messages_with_a_good_check_show_a_master(
        monkeypatch: pytest.MonkeyPatch, said: bytes, later: bytes, told: str) -> None:
    heard = {(38400, False): b'\x10\x05\x09\xF7', (9600, False): said, (9600, True): later}
    clock = Clock()
    monkeypatch.setattr(overhear, 'time', SimpleNamespace(monotonic=clock))

    def read(network: Network, wait: float) -> bytes:
        assert network.mode == 'Listen'
        data = heard.pop((network.baud, wait > overhear.LISTENED), b'')
        clock.now += 0.0 if data else wait
        return data

    monkeypatch.setattr(overhear, 'opened', lambda network: lambda: SimpleNamespace(
        read=lambda wait, wake: read(network, wait), close=lambda: None))
    found = str(overhear.overhear(Network(), [38400, 19200, 9600]))
    assert found.removeprefix('another master ') == told


def test_plc_asks_through_the_master_of_a_line(
        tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    # The host may stand still while a command waits for its reply.
    monkeypatch.setattr(line, 'DEFAULTS', Network(timeout=5000, cmd_timeout=5000))
    slave = '--slave', '--own-station', '7', '--plc-type', 'SLC'
    with master_on(tmp_path / 'line', 7) as (port, master):
        assert main(['read', 'N7:0', '--station', '1', '--port', port, *slave]) == 0
        assert capsys.readouterr().out.split() == ['N7:0', '42']
        assert main(['read', 'N7:0', '--station', '2', '--port', port, *slave]) == 1
        assert 'STS 02' in capsys.readouterr().err
        with client.Client(port, plc_type='SLC', station=1, duplex='slave', own_station=7,
                           cmd_timeout=5.0) as plc:
            assert plc.read('N7:0') == 42


def test_slave_that_nobody_polls_says_so(
        tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(requests, 'LONGEST_UNPOLLED', 0.3)
    with master_on(tmp_path / 'line', 3) as (port, master):
        assert main(['ping', '1', '--count', '1', '--slave', '--port', port]) == 1
    assert 'no master has polled us, station 5. Next: "plc detect" lists the stations' in (
        capsys.readouterr().err)


def test_slave_that_searches_is_refused(capsys: Output) -> None:
    assert main(['detect', '--port', '/dev/ttyS0', '--slave']) == 2
    assert 'a slave cannot try settings' in capsys.readouterr().err


def test_init_offers_a_map_of_what_another_master_reads(
        tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(overhear, 'LISTENED_FOR_READS', 2.0)
    monkeypatch.setattr(overhear, 'LISTENED', 0.3)
    line, new = Pty(tmp_path / 'line'), tmp_path / 'new'
    # The same line has its PLC on it: what a master says is heard like what the PLC says.
    master = Asking(line)
    master.start()
    try:
        assert main(['init', '--port', str(line.name), '--into', str(new)]) == 0
    finally:
        master.over.set()
        master.join()
    assert 'station 1: protected typed logical read N7:0, 2 words: ' in capsys.readouterr().out
    assert (new / 'net.csv').read_text('utf-8').splitlines() == [
        'Mode,Error_Code,Com_Port,Listen_Port,Baud,Parity', f'Listen,CRC,{line.name},,19200,None']
    rows = [row for row in (new / 'map.csv').read_text('utf-8').splitlines() if row[0] != '#']
    assert rows[0] == 'Tag,Command,Address,Station,PLC_Type,Length,Period'
    tells, _, period = rows[1].rpartition(',')
    assert tells == 'n7_0_2_of_1,Read,N7:0,1,SLC,2' and int(period) in (200, 500)  # on a busy host
    assert check.main([str(new / 'net.csv'), str(new / 'map.csv')]) == 0
    assert not select.select([line.fileno()], [], [], 0.1)[0]
    # By the files themselves, as a full-duplex line needs: they name both ports.
    assert main(['init', '--net', str(new / 'net.csv'), '--into', str(tmp_path / 'again')]) == 1
    assert 'No read with its reply was heard, so no file was written' in capsys.readouterr().err
    line.close()


@pytest.mark.parametrize(('check', 'right'), [(Checksum.BCC, 'BCC'), (None, 'CRC')])
def test_files_of_a_line_that_is_heard_have_its_speed_and_its_check_if_that_is_known(
        tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch,
        check: Checksum | None, right: str) -> None:
    command = Packet(3, 0, 0x0F, 0, 7, bytes.fromhex('A1 04 07 89 00'))
    read = Carried(3, describe(command), command, 2.0, 4.4, 2)
    heard: list[Network] = []
    monkeypatch.setattr(init, 'found_settings', lambda *_: overhear.ForeignMaster(
        1200, [3], check))
    monkeypatch.setattr(overhear, 'heard_reads', lambda network, seconds: (
        heard.append(network), [read])[1])
    assert main(['init', '--port', '/dev/x', '--parity', 'Even', '--into', str(tmp_path)]) == 0
    net, rows = (str(tmp_path / name) for name in ('net.csv', 'map.csv'))
    assert capsys.readouterr().out.splitlines() == [
        f'another master polls station 3, 1200 baud, {check.value if check else "check unknown"}: '
        'we send nothing', *texts_of([read]), f'written: {net}, {rows}',
        f'next: {called("check")} {net} {rows}']
    assert Path(net).read_text('utf-8').splitlines()[1] == f'Listen,{right},/dev/x,,1200,Even'
    assert main(['init', '--port', 'rfc2217://x:1', '--into', str(tmp_path / 'far')]) == 1
    assert 'Mode Listen works with a device or socket://, not with' in capsys.readouterr().err
    assert [(line.mode, line.baud, line.error_code) for line in heard] == [('Listen', 1200, right)]


def test_reads_of_a_full_duplex_line_are_heard_on_two_ports(
        monkeypatch: pytest.MonkeyPatch) -> None:
    ask, answer = (frame(bytes.fromhex(text)) for text in (
        '01 00 0F 00 07 00 A2 04 07 89 00 00', '00 01 4F 00 07 00 2A 00 2B 00'))
    # The next command begins while the reply comes.
    heard = [ask, SecondPort(b'\x10\x06' + answer[:6]), b'\x10\x02\x01', SecondPort(answer[6:])]
    monkeypatch.setattr(overhear, 'opened', lambda network: lambda: SimpleNamespace(
        read=lambda wait, wake: heard.pop(0) if heard else b'', close=lambda: None))
    network = Network(mode='Listen', com_port='/dev/a', listen_port='/dev/b')
    assert listening_csv(network).endswith('\nListen,CRC,/dev/a,/dev/b,9600,None\n')
    assert [read.text for read in overhear.heard_reads(network, 0.05)] == [
        'protected typed logical read N7:0, 2 words']


@for_all(('cmd', 'data', 'times', 'row'), [
    (0x0F, 'A1 04 07 89 00', 1, 'n7_0_2_of_3,Read,N7:0,3,SLC,2,50000'),
    (0x0F, 'A2 08 0A 91 00 00', 2, 'l10_0_2_of_3,Read,L10:0,3,SLC,2,50000'),
    (0x2F, '68 00 00 02 00 06 07 00 02 00', 3, 'n7_0_2_of_3,Read,N7:0,3,PLC5,2,5000'),
    (0x01, '20 00 04', 4, '020_2_of_3,Read,020,3,PLC2,2,5000'),
    *((0x01, data, 1, f'# station 3: unprotected read 020 (ADDR {text} bytes: 1 time')
      for data, text in (('20 00 03', '32), 3'), ('21 00 02', '33), 2'))),
    (0x0F, 'A2 06 04 86 00 02', 1, '# station 3: protected typed logical read T4:0.ACC, 3 words: '
     '1 time'), (0x0F, '01 00 00 04 00 06 08 00 08', 2, '# station 3: word range read F8:0, 4 '
                 'words: 2 times'), (0x06, '03', 1, '# station 3: diagnostic status: 1 time'),
    *((0x0F, f'A2 {code} 00 00', 1, f'# station 3: protected typed logical read {address}, '
       '1 element: 1 time') for code, address in (('54 09 8D', 'ST9:0'), ('06 05 87', 'C5:0')))])
def test_row_of_a_read_has_type_length_and_twice_the_interval(
        cmd: int, data: str, times: int, row: str) -> None:
    command = Packet(3, 0, cmd, 0, 7, bytes.fromhex(data))
    last = {1: 2.0, 2: 99.0}.get(times, 7.0)
    carried = Carried(3, describe(command), command, 2.0, last, times)
    first, second = map_of([carried, carried]).splitlines()[-2:]
    assert first == row and second.startswith(f'# station 3: {carried.text}: ')


class Asking(threading.Thread):
    """A master that reads N7:0 and N7:1 of station 1, and that PLC, on a line that we hear."""

    def __init__(self, line: Pty) -> None:
        super().__init__(daemon=True)
        self._line = line
        self.over = threading.Event()

    def run(self) -> None:
        tns = 0x20
        while not self.over.wait(0.05):
            tns = tns % 90 + 0x21
            ask = bytes((1, 0, 0x0F, 0, tns, 0, 0xA2, 4, 7, 0x89, 0, 0))
            answer = bytes((0, 1, 0x4F, 0, tns, 0, 42, 0, 43, 0))
            for said in (frame(ask, 1), b'\x10\x06', b'\x10\x05\x01\xFF', frame(answer),
                         b'\x10\x06'):
                self._line.write(said)


@pytest.mark.parametrize(('first', 'reason'), [
    (b'', 'the other end has closed'), (b'\xFF\xFD\x03', 'is a telnet port')])
def test_device_server_that_ends_the_listening_is_named(
        first: bytes, reason: str, capsys: Output) -> None:
    with socket.create_server(('127.0.0.1', 0)) as server:
        def serve() -> None:
            with server.accept()[0] as connection:
                connection.sendall(first)
                connection.shutdown(socket.SHUT_WR)
                connection.recv(1)
        threading.Thread(target=serve, daemon=True).start()
        port = f'socket://127.0.0.1:{server.getsockname()[1]}'
        assert main(['detect', '--port', port]) == 1
    said = capsys.readouterr().err
    assert 'port lost: the' in said and reason in said
