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

"""The simulator as a process on a pseudo-terminal and on TCP, and its options."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
import errno
import os
from pathlib import Path
import select
import signal
import socket
import subprocess
import sys
import termios
import time
from unittest.mock import Mock

from abdf1_ros.cli.simulator import Cast, main, parse_options
from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.paths import config_file
from abdf1_ros.ports.port_thread import PortKind, PortState
from abdf1_ros.simulator.ladder import Lamp
import pytest
from support.cases import for_all
from support.commands import call, Output
from support.forked import Forked
from support.ptys import full_pipe, PATIENCE, read_exactly
from support.ros import Process
from support.scripted_line import ScriptedLine

DATA = """\
Station,PLC_Type,Address,Length,Values,Motion,Period
1,PLC5,N7:0,10,4660 -2,,
2,SLC,N7:0,10,4660 -2,,
"""
# Header and, with its FNC, what follows; then the reply to it.
PLC5_READ = '01 05 0f 00 10 02 68 00 00 02 00 07 00 07 00 02 00'
PLC5_REPLY = '05 01 4f 00 10 02 95 09 42 34 12 fe ff'
SLC_READ = '02 05 0f 00 10 02 a2 04 07 89 00 00'
SLC_REPLY = '05 02 4f 00 10 02 34 12 fe ff'
CASES = [(1, PLC5_READ, PLC5_REPLY), (2, SLC_READ, SLC_REPLY)]


@pytest.fixture
def data(tmp_path: Path) -> Path:
    path = tmp_path / 'data.csv'
    path.write_text(DATA, encoding='utf-8')
    return path


Start = Callable[..., Process]

LADDER_FILES = 'N10', 'N11', 'B12', 'T13'
READY = 'simulator: stations 1 (PLC5), 2 (SLC) on '


@pytest.fixture
def start(data: Path) -> Iterator[Start]:
    """Start simulators that end with the test."""
    with ExitStack() as running:
        yield lambda *options: running.enter_context(
            Process('simulator', '--data', str(data), *options))


def _ended(simulator: Process, *lines: str) -> None:
    """Check that it ends well, and has said these lines alone after the first."""
    assert simulator.result() == 0, simulator.text
    assert simulator.lines[0].startswith(READY)
    assert simulator.lines[1:] == [*lines]


def _converse(descriptor: int, checksum: Checksum, tns: str = '10 02') -> None:
    """Carry out a transaction with each station, byte by byte."""
    for station, *messages in CASES:
        command, reply = (text.replace('10 02', tns) for text in messages)
        os.write(descriptor, frames.master_frame(station, bytes.fromhex(command), checksum))
        assert read_exactly(descriptor, 2) == b'\x10\x06'
        os.write(descriptor, frames.poll_frame(station))
        expected = frames.message_frame(bytes.fromhex(reply), checksum)
        assert read_exactly(descriptor, len(expected)) == expected
        os.write(descriptor, b'\x10\x06')
        os.write(descriptor, frames.poll_frame(station))
        assert read_exactly(descriptor, 2) == b'\x10\x04'


@pytest.fixture
def descriptor() -> Iterator[Callable[[Path], int]]:
    opened: list[int] = []

    def opener(path: Path) -> int:
        opened.append(os.open(path, os.O_RDWR | os.O_NOCTTY))
        return opened[-1]

    yield opener
    for number in opened:
        os.close(number)


@pytest.mark.parametrize(('check', 'number'), [
    (Checksum.CRC, signal.SIGTERM), (Checksum.BCC, signal.SIGINT)])
def test_on_a_pty_until_a_signal(start: Start, tmp_path: Path, descriptor: Callable[[Path], int],
                                 check: Checksum, number: signal.Signals) -> None:
    name = tmp_path / 'plc'
    simulator = start('--pty', str(name), '--check', check.value)
    simulator.wait_for(f'{READY}{name}, {check.value}')
    line = descriptor(name)
    assert not termios.tcgetattr(line)[3] & termios.ECHO
    _converse(line, check)
    simulator.send(number)
    _ended(simulator)
    assert not name.is_symlink()


@pytest.mark.parametrize('address', ['127.0.0.1:0', ':0'])
def test_on_tcp_until_quit_one_client_after_the_other(start: Start, address: str) -> None:
    simulator = start('--tcp', address)
    where = simulator.wait_for(READY).removesuffix(', CRC').rpartition(':')[2]
    for tns in ('10 02', '11 02'):
        with socket.create_connection(('127.0.0.1', int(where)), PATIENCE) as client:
            _converse(client.fileno(), Checksum.CRC, tns)
    simulator.type('quit\n')
    assert simulator.result() == 0, simulator.text


def test_end_by_the_clock_with_its_input_closed(start: Start) -> None:
    simulator = start('--at', '0.3 quit', '--at', '0.2 silent 1')
    simulator.close_input()
    _ended(simulator, 'simulator: station 1: silent')
    assert simulator.lines[0].startswith(f'{READY}/dev/pts/')


def test_commands_on_input_several_at_once(
        start: Start, tmp_path: Path, descriptor: Callable[[Path], int]) -> None:
    simulator = start('--pty', str(tmp_path / 'plc'))
    simulator.type('error 2 50\n\nhush 1\nsilent 1\n')
    simulator.wait_for('simulator: station 1: silent')
    assert simulator.lines[1:3] == [
        'simulator: station 2: error 50', 'simulator: "hush 1" is not a command']
    line = descriptor(tmp_path / 'plc')
    for station, command, _ in CASES:
        os.write(line, frames.master_frame(station, bytes.fromhex(command), Checksum.CRC))
    assert read_exactly(line, 2) == b'\x10\x06'  # of station 2 only
    os.write(line, frames.poll_frame(1) + frames.poll_frame(2))
    reply = frames.message_frame(bytes.fromhex('05 02 4f 50 10 02'), Checksum.CRC)
    assert read_exactly(line, len(reply)) == reply
    simulator.type('normal 2\nqu')
    simulator.type('it')
    simulator.close_input()  # without a line end
    assert simulator.result() == 0


def test_message_goes_out_though_nothing_comes_in(
        start: Start, tmp_path: Path, descriptor: Callable[[Path], int]) -> None:
    simulator = start('--full-duplex', '1', '--pty', str(tmp_path / 'plc'))
    simulator.wait_for('on ')
    line = descriptor(tmp_path / 'plc')
    os.write(line, frames.ENQ)
    assert read_exactly(line, 2) == frames.NAK  # the simulator waits for bytes now
    simulator.type('full 1\n')
    simulator.wait_for('simulator: station 1: full')
    for sent in (frames.message_frame(bytes.fromhex(PLC5_READ), Checksum.CRC), frames.ENQ):
        os.write(line, sent)
        assert read_exactly(line, 2) == frames.NAK  # and nothing else
    time.sleep(0.2)
    simulator.type('msg 1 N7:50 11\n')
    assert read_exactly(line, 5) == frames.STX + bytes((5, 1, 0x0F))


def test_commands_by_the_clock_keep_their_order(start: Start) -> None:
    _ended(start('--at', '0.2  quit', '--at', '0.1 slow 1 2', '--at', '0 silent 2', '--at',
                 '0 delay 1 5'), *(f'simulator: station {text}' for text in (
                     '2: silent', '1: delay 5', '1: slow 2')))


def _refused(capsys: Output, *options: str, status: int = 2) -> str:
    said = call(main, capsys, *options)
    assert (said.status, said.out) == (status, '')
    assert said.err.startswith('simulator: ')
    return said.err


@for_all(('options', 'status', 'text'), [
    *(((f'--at={at}',), 2, f'--at "{at}" should be seconds from 0 and a command, as in "5 silent '
       '1"') for at in ('soon silent 1', 'silent 1', '', 'x', '-1 silent 1', 'nan silent 1',
                        'inf silent 1', '1_0 silent 1', '\u0661 silent 1', '5', '5  ')),
    *(((f'--tcp={where}',), 2, f'--tcp "{where}" should be HOST:PORT') for where in (
        '127.0.0.1', 'x', ':', '127.0.0.1:99999', ':-1', 'a:b', 'é..b:80')),
    (('--at', '5 hush 1'), 2, '--at: "hush 1" is not a command'),
    (('--at', '5 silent 3'), 2, '--at: name a station (1, 2); "simulator --help"'),
    (('--at', '5 msg 1 N7:0 5'), 2, '--at: "msg 1 N7:0 5" is not a command'),
    (('--at', '5 slow 1 x'), 2, '--at: slow 1 x: "x" should be'),
    (('--data', str(config_file('simulator.csv')), '--ladder', '2', '--at', '1 reset 2',
      '--at', '2 scan 2 x'), 2, '--at: scan 2 x: "x" should be'),
    (('--radio', '--at', '5 full 2'), 2, '--at: station 2 is behind a radio modem, where "full"'),
    (('--full-duplex', '1', '--at', '5 slow 1 2'), 2, '--at: station 1 is on a full-duplex line,'),
    *(((option, name), 2, f'{option}: name a station (1, 2)') for option, name in (
        ('--full-duplex', '7'), ('--full-duplex', ''), ('--ladder', '22'))),
    (('--data', '/nowhere'), 2, '/nowhere: cannot be read: No such file or directory'),
    (('--pty', '/nowhere/plc'), 1, '/nowhere/plc cannot be made: No such file or directory'),
    (('--pty', '/proc/stat'), 1, '/proc/stat exists already, and no simulator has made it; '
     'give another name'),
    (('--tcp', '192.0.2.1:0'), 1, '--tcp "192.0.2.1:0": Cannot assign requested address'),
    (('--port', '/nowhere/tty'), 1, '/nowhere/tty: No such file or directory'),
    (('--port', '/dev/null'), 1, '/dev/null: this is not a serial port'),
    (('--port', 'socket://x'), 2, '--port: Com_Port = "socket://x" should be '),
    (('--port', 'socket://127.0.0.1:1'), 1, 'socket://127.0.0.1:1: Connection refused')])
def test_what_cannot_be_had_is_told_at_once(
        capsys: Output, data: Path, options: tuple[str, ...], status: int, text: str) -> None:
    said = _refused(capsys, '--data', str(data), *options, status=status)
    assert said.startswith(f'simulator: {text}') and len(said.splitlines()) == 1


def test_faults_of_a_data_file_are_told_with_their_cells(capsys: Output, tmp_path: Path) -> None:
    path = tmp_path / 'data.csv'
    path.write_text(DATA + '3,PLC7,N7:0,,,,\n3,SLC,Q7:0,,,,\n', encoding='utf-8')
    assert _refused(capsys, '--data', str(path)).splitlines() == [
        f'simulator: {path}:4:2 (PLC_Type): PLC_Type = "PLC7" should be one of PLC2, PLC3, PLC5, '
        'SLC',
        f'simulator: {path}:5:3 (Address): SLC has no Q files; file types: O, I, S, B, T, C, R, '
        'N, F, ST, A, D, L, PD, MG, HSC, PTO, PWM, STI, EII']
    path.write_text(DATA.partition('1,')[0], encoding='utf-8')
    assert _refused(capsys, '--data', str(path)) == f'simulator: {path}: has no stations\n'
    path.write_text(DATA + '2,SLC,F10:0,,,,\n', encoding='utf-8')
    told = _refused(capsys, '--data', str(path), '--ladder', '2')
    assert told.startswith('simulator: --ladder 2: ') and 'it needs N10, ' in told


def test_name_is_not_shared_and_what_a_killed_simulator_left_is_taken_by_the_next_and_removed(
        capsys: Output, start: Start, data: Path, tmp_path: Path) -> None:
    name = tmp_path / 'plc'
    killed = start('--pty', str(name))
    killed.wait_for(READY)
    held = os.open(name, os.O_RDWR | os.O_NOCTTY)  # no other simulator is to get this number
    killed.send(signal.SIGKILL)
    killed.result()
    assert os.path.lexists(name)
    again = start('--pty', str(name))
    again.wait_for(READY)
    os.close(held)
    before = os.readlink(name)
    assert _refused(capsys, '--data', str(data), '--pty', str(name), status=1) == \
        f'simulator: {name} is in use by another bridge, simulator or sniff\n'
    assert os.readlink(name) == before
    again.send(signal.SIGTERM)
    _ended(again)
    assert not os.path.lexists(name)


@for_all('option', [
    '--check=XOR', '--baud=9601', '--baud=9_600', '--seconds=x', '--seconds=-1', '--what',
    '--pty=', '--port='])
def test_option_that_is_wrong_is_told_with_status_2(capsys: Output, option: str) -> None:
    said = call(main, capsys, option)
    assert said.status == 2
    assert said.err.startswith('simulator: error: ')


def _awaken(descriptor: int) -> None:
    """Poll until there is an answer: the simulator needs a moment to be there."""
    while not select.select([descriptor], [], [], 0.2)[0]:
        os.write(descriptor, frames.poll_frame(1))
    os.write(descriptor, frames.master_frame(1, bytes.fromhex(PLC5_READ), Checksum.CRC))
    while read_exactly(descriptor, 2) == frames.EOT:
        pass  # the answer to another poll; at last comes the ACK
    os.write(descriptor, frames.poll_frame(1))
    expected = frames.message_frame(bytes.fromhex(PLC5_REPLY), Checksum.CRC)
    assert read_exactly(descriptor, len(expected)) == expected
    os.write(descriptor, frames.ACK)


def test_on_a_port_of_a_device_server(start: Start) -> None:
    with socket.create_server(('127.0.0.1', 0)) as server:
        server.settimeout(PATIENCE)
        name = f'socket://127.0.0.1:{server.getsockname()[1]}'
        simulator = start('--port', name, '--baud', '115200')
        client, _ = server.accept()
        with client:
            _awaken(client.fileno())
            _converse(client.fileno(), Checksum.CRC, '11 02')
            simulator.send(signal.SIGTERM)
            _ended(simulator)
        assert simulator.lines == [f'{READY}{name}, CRC']


def test_timers_depend_on_the_speed_of_a_port_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.cli.simulator.LinkThread', links := Mock())
    monkeypatch.setattr('abdf1_ros.cli.simulator.SerialEndpoint', ports := Mock())
    for line in ('--port=/dev/ttyS0', '--tcp=127.0.0.1:0', '--baud=4800'):
        for duplex in ('--full-duplex=1', '--radio'):
            Cast(parse_options([line, duplex, '--baud=4800'])).close()
    assert [call.args[0].baud for call in ports.call_args_list] == [4800, 4800]
    assert [call.args[0].timing.char_time for call in links.call_args_list] == [
        10 / 4800, 10 / 4800, 0, 0, 0, 0]
    monkeypatch.setattr(sys, 'stdin', None)
    assert main(['--seconds', '0.1']) == 1  # the thread says that it has failed, for it is a Mock


def test_outage_is_told_once_and_faults_of_a_full_duplex_plc_are_those_of_its_line(
        monkeypatch: pytest.MonkeyPatch, data: Path) -> None:
    monkeypatch.setattr('abdf1_ros.cli.simulator.LinkThread', links := Mock())
    monkeypatch.setattr('abdf1_ros.cli.simulator.SerialEndpoint', lines := Mock())
    cast = Cast(parse_options(['--data', str(data), '--port=/dev/ttyS0', '--full-duplex=2']))
    said: list[str] = []
    cast.say = said.append
    is_open, lost = PortState(True, 'open'), PortState(False, 'lost')
    for state in (is_open, lost, lost, is_open, lost, PortState(False, 'x', PortKind.NO_CLIENT)):
        links.call_args.kwargs['on_state'](state)
    assert said == ['lost', 'lost']
    line, port = lines.return_value.open.return_value, links.call_args.args[1]()
    line.read.return_value = b'x'
    for fault, heard in (('silent 2', b''), ('normal 2', b'x'), ('noise 2 1', b'x')):
        cast.carry_out(fault)
        assert port.read(0.0, 0) == heard
        port.write(b'x')
    first, second = (call.args[0] for call in line.write.call_args_list)  # a silent PLC sends none
    assert first == b'x' != second
    cast.carry_out('power 2')  # waiting replies are lost
    links.return_value.exchange.assert_called_once()


def test_broadcast_by_radio_reaches_every_plc(
        monkeypatch: pytest.MonkeyPatch, data: Path) -> None:
    monkeypatch.setattr('abdf1_ros.cli.simulator.LinkThread', links := Mock())
    cast = Cast(parse_options(['--data', str(data), '--radio']))
    cast.close()
    line = ScriptedLine(links.call_args.args[0])
    texts = ('ff 05 0f 00 11 02 aa 02 07 89 00 00 2a 00', SLC_READ,
             '05 02 4f 00 10 02 2a 00 fe ff', 'ff 05 0f 00 12 02 aa 02 07 89 00 00 2b 00')
    write, read, reply, late = (
        frames.message_frame(bytes.fromhex(text), Checksum.CRC) for text in texts)
    line.write(write)
    for fault, heard in (('silent 2', b''), ('normal 2', reply)):  # a silent PLC executes nothing
        cast.carry_out(fault)
        line.write(read)
        assert line.read(1.0) == heard
        line.write(late)
    cast.say = (said := list[str]()).append
    for command in ('counters 1', 'counters 2'):
        cast.carry_out(command)
    assert said[0][10:] == said[1][10:] and '=3 ' in said[0]  # the modem counts for every PLC
    cast.carry_out('power 2')
    links.return_value.exchange.assert_not_called()  # the modem has power


def test_lamps_of_ladders_are_told_though_no_command_comes(
        monkeypatch: pytest.MonkeyPatch, data: Path) -> None:
    data.write_text(DATA.partition('1,')[0] + ''.join(
        f'{station},SLC,{name}:0,10,,,\n' for station in (3, 2) for name in LADDER_FILES), 'utf-8')
    now, said, lamps = [0.0], list[str](), list[tuple[str, Lamp, bool]]()
    monkeypatch.setattr('abdf1_ros.cli.simulator.LinkThread', links := Mock())
    monkeypatch.setattr('abdf1_ros.cli.simulator.time', Mock(monotonic=lambda: now[0]))
    options = parse_options(['--radio', '--ladder=3', '--ladder=2', '--data', str(data)])
    cast = Cast(options, lambda *lamp: lamps.append(lamp))
    cast.say = said.append
    cast.advance()
    now[0] = 1.0
    ScriptedLine(links.call_args.args[0]).write(frames.message_frame(bytes.fromhex(
        '02 05 0f 00 11 02 aa 02 0a 89 00 00 07 00'), Checksum.CRC))
    for now[0] in (1.1, 4.5):
        cast.advance()
    cast.close()
    changes = [(Lamp.STOPPED, True), (Lamp.ALIVE, True), (Lamp.STOPPED, False),
               (Lamp.ALIVE, False), (Lamp.LOST, True)]
    assert [lamp for lamp in lamps if lamp[0] == '2'] == [('2', *change) for change in changes]
    assert [lamp for lamp in lamps if lamp[0] == '3'] == [('3', *changes[0]), ('3', *changes[-1])]
    assert [text for text in said if text[8] == '2'] == [
        'station 2: ROS stopped (heartbeat 0) on', 'station 2: ROS alive on',
        'station 2: ROS stopped (heartbeat 0) off', 'station 2: ROS alive off',
        'station 2: ROS lost (heartbeat stands still) on']


def test_simulator_goes_on_when_nobody_reads_it_and_ends_when_told(data: Path) -> None:
    simulator = Forked('simulator', ['--data', str(data)])
    assert simulator.stdout.readline().startswith(READY)
    simulator.stdout.close()
    simulator.stdin.write('silent 1\nnormal 1\nquit\n')
    simulator.stdin.flush()
    assert simulator.stderr.read() == ''
    assert simulator.wait(PATIENCE) == 0


def test_simulator_answers_and_ends_while_its_output_is_not_taken(
        data: Path, tmp_path: Path, descriptor: Callable[[Path], int]) -> None:
    """After Ctrl-S, or with ``| less``, its PLCs stood still, and SIGTERM had no effect."""
    reader, writer = full_pipe()
    name = tmp_path / 'plc'
    with subprocess.Popen(
            [sys.executable, '-m', 'abdf1_ros', 'simulator', '--data', str(data), '--pty',
             str(name), '--at', '0 normal 1', '--at', '0 normal 1'],
            stdin=subprocess.DEVNULL, stdout=writer) as simulator:
        give_up = time.monotonic() + PATIENCE
        while not name.is_symlink() and time.monotonic() < give_up:
            time.sleep(0.01)
        _converse(descriptor(name), Checksum.CRC)
        simulator.terminate()
        assert simulator.wait(PATIENCE) == 0
    os.close(reader)
    os.close(writer)


def test_input_goes_on_when_a_job_comes_back_from_the_background(
        data: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    """The first EIO was taken for the end of the input, so "fg" led to a deaf terminal."""
    texts: list[bytes | OSError] = [OSError(errno.EIO, 'Input/output error'), b'\xFF\nquit\n']

    real_read = os.read

    def read(descriptor: int, size: int) -> bytes:
        text = texts.pop(0) if descriptor == reader else real_read(descriptor, size)
        if isinstance(text, OSError):
            raise text
        return text

    reader, writer = os.pipe()
    os.write(writer, b'typed')
    with os.fdopen(reader) as stdin:
        monkeypatch.setattr(sys, 'stdin', stdin)
        monkeypatch.setattr(os, 'read', read)
        assert main(['--data', str(data), '--pty', str(data.with_name('plc')), '--seconds', '5'
                     ]) == 0
    os.close(writer)
    assert not texts and 'simulator: name a station (1, 2)\n' in capfd.readouterr().out
