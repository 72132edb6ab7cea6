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

"""One cause and one next step after "no answer", each against a far end byte by byte."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import re
import select
import threading
import time
from unittest.mock import Mock

from abdf1_ros import open_line
from abdf1_ros.cli.plc import inquiry
from abdf1_ros.cli.plc.command import main
from abdf1_ros.ports.descriptor import Port
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
import pytest
from support.cases import for_all
from support.commands import call, Output, Said
from support.odd_device import Answer, ENQ, EOT, frame, OddDevice, Wiring
from support.plc_line import odd_line
from support.ptys import Pty
from support.ros import write_csv

READ = ('read', 'N7:0', '--plc-type', 'SLC')


def quick(folder: Path) -> tuple[str, str]:
    """Return options for few tries, each long enough for a busy host."""
    return '--net', str(write_csv(
        folder / 'quick.csv', 'Timeout,NAK_Retries,ENQ_Retries', ['500,0,0']))


def told(said: Said) -> list[str]:
    """Return the lines about failures, without the progress."""
    return [line.removeprefix('plc: ') for line in said.err.splitlines()
            if line.startswith('plc: ')]


def cause(said: Said) -> str:
    """Return the only line with a next step."""
    line, = (line for line in told(said) if ' Next: ' in line)
    return line


@contextmanager
def far_end(path: Path, live: Callable[[Pty, bytes], None]) -> Iterator[str]:
    """Call ``live`` with all bytes that come, and with none ten times a second."""
    line = Pty(path)
    over, end = os.pipe()

    def run() -> None:
        while over not in (ready := select.select([line.fileno(), over], [], [], 0.1)[0]):
            live(line, os.read(line.fileno(), 4096) if ready else b'')

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield str(path)
    finally:
        os.close(end)
        thread.join()
        os.close(over)
        line.close()


def answering(answer: bytes) -> Callable[[Pty, bytes], None]:
    return lambda line, data: line.write(answer) if data else None


def says_by_itself(text: bytes) -> Callable[[Pty, bytes], None]:
    return lambda line, data: None if data else line.write(text)


def with_bcc(device: OddDevice) -> OddDevice:
    """Let a device have BCC: a message with a CRC is none for it, and none from it has one."""
    def hear(data: bytes) -> bytes:
        start = data.find(b'\x10\x01' if device.wiring is Wiring.HALF else b'\x10\x02')
        end = data.find(b'\x10\x03', start)
        if start < 0 or end < 0:
            return data
        text = data[start + (5 if device.wiring is Wiring.HALF else 2):end]
        bare = text.replace(b'\x10\x10', b'\x10')
        station = data[start + 2] if device.wiring is Wiring.HALF else None
        if len(data) == end + 3 and data[-1] == -(sum(bare) + (station or 0)) & 0xFF:
            return data[:start] + frame(bare, station)
        return data[:start] + frame(bare, station)[:-1] + b'\x00'

    def say(data: bytes) -> bytes:
        start = data.find(b'\x10\x02')
        if start < 0:
            return data
        bare = data[start + 2:-4].replace(b'\x10\x10', b'\x10')
        return data[:-2] + bytes((-sum(bare) & 0xFF,))

    device.hear, device.say = hear, say
    return device


@for_all('verb', [
    READ, ('read', 'N7:0'), ('status', '1'), ('ping', '1', '--count', '1'), ('files', '1'),
    ('clock', '1'), ('watch', 'N7:0', '--plc-type', 'SLC', '--count', '1'),
    ('log', 'N7:0', '--plc-type', 'SLC', '--count', '1'), ('scan', '1')])
def test_wrong_check_in_half_duplex_is_found_by_a_poll_and_a_command(
        tmp_path: Path, capsys: Output, verb: tuple[str, ...]) -> None:
    device = with_bcc(OddDevice(Wiring.HALF, 1))
    with odd_line(tmp_path / 'line', device) as name:
        said = call(main, capsys, *verb, '--port', name, *quick(tmp_path))
        assert cause(said) == (
            'station 1 answers polls, and takes commands with BCC only. Next: Error_Code is BCC '
            'in net.csv, --check BCC of "plc"')
        assert call(main, capsys, 'ping', '1', '--count', '1', '--port', name, '--check',
                    'BCC').status == 0
    assert all(command[2] == 6 or command[2:7:4] == b'\x0F\xA2' for command in device.executed)


def test_check_of_a_reply_to_a_question_is_not_called_noise(tmp_path: Path,
                                                            capsys: Output) -> None:
    device, polls = with_bcc(OddDevice(Wiring.HALF, 1)), list[bytes]()

    def hear(data: bytes) -> bytes:  # one of 256 messages with a CRC has a right BCC, too
        polls.extend([data] if ENQ in data else [])
        return data if polls else b''

    device.hear = hear
    with odd_line(tmp_path / 'line', device) as name:
        said = call(main, capsys, *READ, '--port', name, *quick(tmp_path))
    assert cause(said).startswith('station 1 answers polls, and takes commands with BCC only')


def test_wrong_check_in_full_duplex_is_found_by_a_command_with_the_other(
        tmp_path: Path, capsys: Output) -> None:
    with odd_line(tmp_path / 'line', with_bcc(OddDevice(Wiring.FULL, 1))) as name:
        said = call(main, capsys, *READ, '--peer', '--port', name, *quick(tmp_path))
    assert cause(said).startswith(
        'the PLC answers DLE NAK to all with CRC, and takes commands with BCC. Next: Error_Code')


def test_nak_to_all_with_both_checks_is_a_plc_without_room(tmp_path: Path,
                                                           capsys: Output) -> None:
    device = OddDevice(Wiring.FULL, 1)
    device.takes = lambda data: Answer.NAK
    with odd_line(tmp_path / 'line', device) as name:
        for verb in (READ, ('detect', '--baud', '9600')):
            said = call(main, capsys, *verb, *['--peer'] * (verb is READ), '--port', name,
                        *quick(tmp_path))
            assert 'DLE NAK to all, with CRC and with BCC: it has no room' in cause(said)


def test_silent_station_beside_one_that_answers(tmp_path: Path, capsys: Output) -> None:
    net = write_csv(tmp_path / 'net.csv', 'Com_Port,Timeout,NAK_Retries',
                    [f'{tmp_path / "line"},500,0'])
    write_csv(tmp_path / 'map.csv', 'Tag,Command,Address,Station,PLC_Type',
              ['a,Read,N7:0,2,SLC', 'b,Read,N7:0,1,SLC'])
    device = OddDevice(Wiring.HALF, 1)
    with odd_line(tmp_path / 'line', device) as name:
        for line in (('--net', str(net)), ('--port', name, '--map', str(tmp_path / 'map.csv'))):
            said = call(main, capsys, *READ, '--station', '2', *line)
            assert cause(said).startswith(
                'station 2 is silent, and station 1 answers: port and settings are right. Next: '
                'look at station 2: power')
            assert said.err.endswith(
                '0 NAK; then asked: one poll of the station, one poll of another station\n')
        said = call(main, capsys, *READ, '--station', '2', '--port', name)
    assert cause(said).startswith('not one character came, not even to a poll: no station 2 (a')
    assert '"plc scan 0-31" shows whether other stations answer' in cause(said)
    assert said.err.endswith('0 NAK; then asked: one poll of the station\n')


def test_silence_in_full_duplex_blames_no_number(tmp_path: Path, capsys: Output) -> None:
    line = Pty(tmp_path / 'line')
    said = call(main, capsys, *READ, '--peer', '--port', str(line.name), *quick(tmp_path))
    line.close()
    assert cause(said).startswith('not one character came: cable (data lines not crossed')
    assert 'number' not in cause(said)


def test_port_with_the_other_duplex_is_named(tmp_path: Path, capsys: Output) -> None:
    device = OddDevice(Wiring.HALF, 1)
    # It passes over symbols of full duplex.
    device.hear = lambda data: b'' if data == ENQ or data.startswith(b'\x10\x02') else data
    with odd_line(tmp_path / 'half', device) as name:
        said = call(main, capsys, *READ, '--peer', '--port', name, *quick(tmp_path))
        assert 'answers a poll: its channel is set to half duplex. Next: use Mode Master' in (
            cause(said))
    with far_end(tmp_path / 'full', answering(b'\x10\x15')) as name:
        said = call(main, capsys, *READ, '--port', name, *quick(tmp_path))
        assert 'the channel of the PLC is set to full duplex. Next: use Mode Peer' in cause(said)


@pytest.mark.parametrize('wiring', [Wiring.HALF, Wiring.FULL])
def test_slow_reply_is_told_with_its_time(tmp_path: Path, capsys: Output,
                                          wiring: Wiring) -> None:
    device = OddDevice(wiring, 1)
    device.seconds = lambda data: 1.4
    peer = ['--peer'] * (wiring is Wiring.FULL)
    with odd_line(tmp_path / 'line', device) as name:
        said = call(main, capsys, *READ, *peer, '--port', name)
    assert '2508' in said.err
    assert cause(said).startswith(
        'station 1 takes commands, but does not reply in time: a reply came after 1.')
    assert 'Cmd_Timeout' in cause(said)


def test_noise_is_called_noise(tmp_path: Path, capsys: Output) -> None:
    device, count = OddDevice(Wiring.HALF, 1), iter(range(1000))
    device.say = lambda data: data if len(data) < 5 or next(count) % 5 else data[:-1] + b'\x99'
    with odd_line(tmp_path / 'line', device) as name:
        said = call(main, capsys, 'ping', '1', '--count', '5', '--port', name, *quick(tmp_path))
    assert said.status == 1 and 'damaged: noise on the line. Next: check shield' in cause(said)


@pytest.mark.parametrize(('lost', 'text'), [
    (b'\x11\x13', 'bytes 11 and 13 hex do not pass: flow control'),
    (b'\xFF', 'byte FF hex does not pass: a telnet port')])
def test_bytes_that_do_not_pass_are_found_by_echoes(
        tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch, lost: bytes,
        text: str) -> None:
    monkeypatch.setattr('random.randrange', lambda end: 0x2020)  # TNS without these bytes
    device = OddDevice(Wiring.FULL, 1)
    device.words[1, 7, 0] = int.from_bytes(lost * 2 if len(lost) == 1 else lost, 'little')

    def say(data: bytes) -> bytes:
        start = data.find(b'\x10\x02')
        if start < 0:
            return data
        became = b'' if len(lost) == 2 else 2 * lost
        return data[:start] + b''.join(
            became if byte in lost else bytes((byte,)) for byte in data[start:-2]) + data[-2:]

    device.say = say
    with odd_line(tmp_path / 'line', device) as name:
        said = call(main, capsys, *READ, '--peer', '--port', name, *quick(tmp_path))
    assert said.status == 1 and cause(said).startswith(text)


@pytest.mark.parametrize(('sent', 'text', 'first'), [
    (b'TEMP 23.4 C\r\n', 'text comes, and no DF1: the channel of the PLC is in User (ASCII) mode',
     '54 45 4D 50 20 32 33 2E 34 20 43 0D 0A '),
    (bytes.fromhex('01 83 02 C0 F1'), 'a device that speaks Modbus RTU is at the far end',
     '01 83 02 C0 F1 ')])
def test_text_and_modbus_are_named_and_shown(
        tmp_path: Path, capsys: Output, sent: bytes, text: str, first: str) -> None:
    for number, live in enumerate((says_by_itself(sent), answering(sent))):
        one = '--baud', '9600', '--timeout', '100', '--stations', '1'
        verbs = ((*READ, '--peer'), ('init', *one, '--into', str(tmp_path / 'new'))), (
            READ, ('scan', '1-2'), ('detect', *one))
        with far_end(tmp_path / 'line', live) as name:
            for verb in verbs[number]:
                said = call(main, capsys, *verb, '--port', name, *quick(tmp_path))
                assert said.status == 1 and text in cause(said)
                assert f'first bytes {first}' in said.err


def test_noise_at_all_settings_is_one_conclusion(tmp_path: Path, capsys: Output) -> None:
    noise = bytes((0xA7, 0x31, 0xE0, 0x5B, 0x99, 0xC4, 0x80))
    for name, live in (('hum', says_by_itself(noise)), ('noise', answering(noise))):
        with far_end(tmp_path / name, live) as port:
            said = call(main, capsys, 'detect', '--port', port, '--stations', '1', '--baud',
                        '9600', '--timeout', '100')
            assert re.match(r'characters come with \d of 3 settings, and none of', cause(said))
            assert len(told(said)) == 4 and 'first bytes A7 31' in said.err
            said = call(main, capsys, *READ, '--port', port, *quick(tmp_path))
            assert 'noise' in cause(said) and 'first bytes A7 31' in said.err


def test_replies_to_another_device_on_a_splitter_are_named(tmp_path: Path,
                                                           capsys: Output) -> None:
    foreign = b'\x10\x06' + frame(bytes.fromhex('00 01 4F 00 77 33 0F 27'))
    with far_end(tmp_path / 'line', says_by_itself(foreign)) as name:
        said = call(main, capsys, *READ, '--peer', '--port', name, *quick(tmp_path))
    assert cause(said).startswith('replies to number 0 come, to commands that are not ours: a sec')
    device = OddDevice(Wiring.FULL)
    device.say = lambda data: data + foreign if b'\x10\x02' in data else data
    with odd_line(tmp_path / 'other', device) as name:
        said = call(main, capsys, *READ, '--peer', '--port', name)
    assert said.status == 0  # the value has come all the same
    assert cause(said).startswith('replies to number 0 come, to commands that are not ours: a sec')


class Master:
    """A master that polls station 3, and counts the messages of others."""

    def __init__(self) -> None:
        self.heard = b''
        self._next = 0.0

    def __call__(self, line: Pty, data: bytes) -> None:
        self.heard += data
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + 0.1
            line.write(ENQ + b'\x03\xFD')
            line.write(EOT)


def test_commands_that_do_harm_send_nothing_beside_another_master(
        tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.cli.plc.overhear.LISTENED', 1.0)
    for verb in (('scan', '1-2'), ('write', 'N7:0', '1', '--station', '1', '--yes'),
                 ('clock', '1', '--set', '--yes')):
        with far_end(tmp_path / 'line', master := Master()) as name:
            said = call(main, capsys, *verb, '--port', name, *quick(tmp_path))
        assert (said.status, said.out, master.heard) == (1, '', b'')
        assert told(said) == [
            'nothing was sent: another master polls station 3 of this line, and two masters '
            'destroy their messages. Next: end one of them, or only listen: "plc init" writes '
            'files for Mode Listen']


def test_commands_that_listen_first_open_the_port_once(
        tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    """A device server with one client, and one that resets at DTR, notice each time."""
    opened: list[str] = []

    def open_counted(settings: PortSettings) -> Port:
        opened.append(settings.name)
        return open_port(settings)

    monkeypatch.setattr(open_line, 'open_port', open_counted)
    with odd_line(tmp_path / 'line', OddDevice(Wiring.HALF, 1)) as name:
        for verb in (('scan', '1'), ('write', 'N7:0', '1', '--station', '1', '--yes',
                                     '--plc-type', 'SLC')):
            assert call(main, capsys, *verb, '--port', name).status == 0
    assert opened == [name, name]


def test_other_commands_tell_of_another_master_that_they_hear(
        tmp_path: Path, capsys: Output) -> None:
    device, master = OddDevice(Wiring.HALF, 1), Master()
    device.seconds = lambda data: 0.5
    device.say = lambda data: data + ENQ + b'\x03\xFD'
    with odd_line(tmp_path / 'line', device) as name:
        said = call(main, capsys, 'status', '1', '--port', name)
    assert said.status == 0 and cause(said).startswith('another master polls station 3')
    with far_end(tmp_path / 'other', master) as name:
        said = call(main, capsys, *READ, '--port', name, '--timeout', '300')
    assert said.status == 1 and cause(said).startswith('another master polls station 3')
    assert master.heard.count(ENQ) == 0  # no question after foreign polls


@pytest.mark.parametrize('line', [('--radio',), ('--slave',), ('--via', '8')])
def test_no_question_where_it_might_do_harm(
        tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch,
        line: tuple[str, ...]) -> None:
    monkeypatch.setattr('abdf1_ros.driver.requests.LONGEST_UNPOLLED', 0.2)
    monkeypatch.setattr(inquiry, 'Session', Mock(side_effect=AssertionError))
    port = Pty(tmp_path / 'line')
    said = call(main, capsys, 'ping', '1', '--count', '1', '--port', str(port.name), *line,
                *quick(tmp_path))
    port.close()
    causes = {'--radio': 'not one character came: no station 1, or cable',
              '--slave': 'no master has polled us, station 5', '--via': 'not one character came, '}
    assert said.status == 1 and cause(said).startswith(causes[line[0]])
    assert '--via' not in line or 'no station 8 (a PLC-5' in cause(said)
