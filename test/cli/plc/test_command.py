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

"""The command ``plc`` on simulated lines: output and exit status of the other verbs."""

from collections.abc import Sequence
import os
from pathlib import Path
import pty
import re
import signal
import subprocess
import sys
from unittest import mock
from unittest.mock import Mock

from abdf1_ros.cli.plc.command import main
from abdf1_ros.cli.plc.verbs import scan
from abdf1_ros.errors import FormatError, PortLost
import pytest
from support.cases import for_all
from support.commands import call, FAST, Output, PATIENT, Plc, running_simulator, Said
from support.ptys import Pty, wait_until
from support.ros import Process
from support.simulator_process import Files


def test_silence_of_a_station_that_nobody_named(plc: Plc, simulator: Process) -> None:
    told = 'no station was given, so 1 was asked; "plc scan" lists the stations that'
    simulator.say('silent 1')
    assert told in plc('read', 'N7:0', *FAST).err
    assert told in plc('status', *FAST).err
    assert told not in plc('read', 'N7:0', '--station', '1', *FAST).err


@pytest.mark.parametrize('args', [
    ('read', 'N7:0', '--station', '1'), ('status', '1'), ('ping', '1'),
    ('write', 'N7:0', '1', '--station', '1')])
def test_own_station_is_not_asked(plc: Plc, args: tuple[str, ...]) -> None:
    said = plc(*args, '--own-station', '1')
    assert said.status == 2
    assert said.err.startswith('plc: --own-station: 1 is our own Station, so no PLC can answer')


def test_own_station_is_not_taken_for_one_that_nobody_named(plc: Plc) -> None:
    said = plc('status', '5', '--slave')  # the number that we have without an option
    assert said.err.startswith('plc: --own-station: 5 is our own Station, so no PLC can answer')
    said = plc('read', 'N7:0', '--own-station', '1')
    assert (said.status, said.err) == (
        2, 'plc: --station: give the station to ask; 1 is our own Station\n')


def test_scan_asks_a_plc_that_has_our_number(plc: Plc) -> None:
    assert plc('scan', '1-2', '--own-station', '2').lines[-1] == '2 of 2 stations answer'


def test_status_names_processor_mode_and_faults(plc: Plc) -> None:
    said = plc('status', '2')
    assert said.status == 0
    assert said.lines[0].startswith('station 2: SLC 5/03')
    assert 'mode REM RUN' in said.lines
    assert 'faults none' in said.lines
    assert plc('status').lines[0].startswith('station 1: PLC-5/40')


def test_ping_shows_each_answer_and_sums_up(plc: Plc) -> None:
    said = plc('ping', '2', '--count', '3')
    assert said.status == 0
    assert len(said.lines) == 4
    assert said.lines[0].startswith('station 2: ')
    times = [float(line.split()[2]) for line in said.lines[:3]]
    assert said.lines[3] == (
        f'3 sent, 3 answered; shortest {min(times)}, mean {said.lines[3].split()[-4]} longest '
        f'{max(times)} ms')
    assert min(times) <= float(said.lines[3].split()[-4].rstrip(',')) <= max(times)


def test_ping_of_nobody_has_status_1_and_says_that_nothing_came(plc: Plc) -> None:
    said = plc('ping', '9', '--count', '2', *FAST)
    assert (said.status, said.lines) == (1, ['2 sent, 0 answered'])
    assert said.err.count('2509 ERR_INACTIVE_STATION: Slave Station (9) Inactive') == 2
    assert said.err.count('not one character came, not even to a poll') == 1
    assert said.err.endswith(
        'plc: 9600 baud, parity None, half duplex, CRC; sent: 1 command, 1 poll, 3 repetitions '
        'included; received: 0 characters, 0 damaged frames, 0 NAK\n')


def test_ping_of_which_one_fails_is_a_failure(plc: Plc, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.cli.plc.presence.ping', Mock(side_effect=[
        FormatError('other bytes came'), 0.001, *[KeyboardInterrupt] * 2, PortLost('gone')]))
    said = plc('ping', '1', '--count', '9')
    assert (said.status, said.lines[1][:42]) == (1, '2 sent, 1 answered; shortest 1.0, mean 1.0')
    assert plc('ping', '1') == Said(1, '0 sent, 0 answered\n', '')
    assert plc('ping', '1') == Said(1, '', 'plc: port lost: gone\n')


def test_scan_lists_who_answers_and_counts_them(plc: Plc) -> None:
    said = plc('scan', '1-2')
    assert said.status == 0
    assert said.lines[0].split() == ['station', 'answer', 'processor']
    assert [line.split()[0] for line in said.lines[1:]] == ['1', '2', '2']
    assert 'PLC-5/40' in said.lines[1]
    assert said.lines[3] == '2 of 2 stations answer'


def test_scan_finds_who_does_not_say_what_it_is(plc: Plc, simulator: Process) -> None:
    simulator.say('error 2 10')
    said = plc('scan', '2')
    assert said.status == 0
    assert 'answers, but does not identify itself: STS 10' in said.lines[1]


def test_plc_without_diagnostic_status_is_not_called_a_missing_file(
        plc: Plc, simulator: Process) -> None:
    simulator.say('error 2 10')
    said = plc('read', 'N7:0', '--station', '2')
    assert said.status == 1
    assert 'station 2: does not identify itself (STS 10 to the question); give --plc-type' in (
        said.err)
    assert 'file' not in said.err
    simulator.say('error 2 20')
    said = plc('read', 'N7:0', '--station', '2', '--plc-type', 'SLC')
    assert 'N7:0 of station 2: STS 20' in said.err and 'file' not in said.err


def test_scan_of_nobody_has_status_1(plc: Plc, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scan, 'Progress', progress := Mock())
    said = plc('scan', '8,9', *FAST)
    assert progress.return_value.mock_calls[-1] == mock.call.clear()  # before the tally
    assert (said.status, said.lines) == (
        1, ['0 of 2 stations answer; silent stations were asked 2 times'])
    assert 'not one character came, from station 8 or from station 9: cable' in said.err


def test_watch_prints_changes_and_ends_by_count(plc: Plc) -> None:
    said = plc('watch', 'N7:0', 'F8:0', '--period', '0.05', '--count', '20')
    assert said.status == 0
    shown = [line.split(maxsplit=2)[1:] for line in said.lines]
    assert sorted(map(tuple, shown)) == [('F8:0', '12.5'), ('N7:0', '1200')]


def test_watch_tells_why_there_is_no_value(plc: Plc) -> None:
    said = plc('watch', 'N7:0', 'N99:0', '--period', '0.05', '--count', '2')
    assert (said.status, said.err[:11]) == (1, 'plc: sent: ')  # no station is silent
    assert any('N99:0 no value: STS F0' in line for line in said.lines)
    assert any(line.endswith('N7:0 1200') for line in said.lines)


@pytest.mark.parametrize(('args', 'begin', 'end'), [
    (('watch', 'N7:10', '--station', '2', '--period', '0.05'), 'N7:10  ', ''),
    (('ping', '2', '--count', '1000000'), 'station 2: ', ' answered; shortest ')])
def test_watch_and_ping_go_on_until_they_are_interrupted(
        line: str, args: Sequence[str], begin: str, end: str) -> None:
    with Process('plc', *args, '--timeout', '5000', '--port', line) as process:
        process.wait_for(begin)
        process.send(signal.SIGINT)
        assert process.result() == 0
    assert end in process.text


def test_watch_redraws_a_table_on_a_terminal(line: str) -> None:
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, '-m', 'abdf1_ros', 'plc', 'watch', 'N7:0', '--count', '3', '--period',
         '0.05', '--port', line, *PATIENT], stdin=subprocess.DEVNULL, stdout=theirs, stderr=theirs,
        env=os.environ | {'TERM': 'xterm', 'COLUMNS': '60', 'LINES': '10'})
    os.close(theirs)
    screen = b''
    try:
        while part := os.read(ours, 4096):
            screen += part
    except OSError:  # the other end is closed
        pass
    os.close(ours)
    assert process.wait(20) == 0
    assert b'\x1b[3A\x1b[Kstation 1: ' in screen and b'\x1b[Kaddress' in screen
    assert re.search(rb'N7:0 +1 +int16 +\d+\.\d .*1200\r\n\x1b\[J\Z', screen)


@pytest.mark.usefixtures('half_duplex_only')
def test_commands_work_over_a_tcp_connection(files: Files, capsys: Output) -> None:
    with running_simulator('--tcp', '127.0.0.1:0', '--data', str(files.simulator)) as process:
        url = process.wait_for('socket://').partition(' on ')[2].partition(',')[0]
        assert call(main, capsys, 'read', 'N7:0', '--port', url, *PATIENT).lines == ['N7:0 1200']
        said = call(main, capsys, 'detect', '--port', url, '--parity', 'Even', '--stop-bits', '2',
                    '--stations', '1', *PATIENT)
    assert said.lines[1].endswith(
        f' 1 --port {url} --baud 9600 --check CRC --parity Even --stop-bits 2')
    assert said.lines[-2:] == ['Station,Mode,Error_Code,Com_Port,Baud,Parity,Stop_Bits,Timeout',
                               f'5,Master,CRC,{url},9600,Even,2,300']


def test_signal_ends_it(tmp_path: Path) -> None:
    line = Pty(tmp_path / 'line')
    with Process('plc', 'status', '1', '--port', str(line.name), '--timeout', '9000') as process:
        line.read(5)
        wait_until(lambda: process.catches(signal.SIGTERM))  # the bytes may be of another process
        process.send(signal.SIGTERM)
        assert process.result() == 130
    line.close()
    assert process.text == ''


@for_all(('args', 'text'), [
    (('read', 'N7:0'), 'name the port, such as --port /dev/ttyUSB0'),
    (('read', 'N7:0', '--port', 'x', '--peer', '--duplex', 'half'), 'not allowed with'),
    (('read', 'N7:0', '--port', 'x', '--baud', '1'), '--baud: Baud = "1" should be one of 300'),
    (('read', 'N7:0', '--port', 'x'), '--port: Com_Port = "x" should be'),
    (('read', 'N7:0', '--net', '/nowhere/net.csv'), '/nowhere/net.csv: cannot be read'),
    (('scan', '0-300', '--port', 'x'), '"0-300" should be a station from 0 to 254'),
    (('status', '1,2', '--port', 'x'), '"1,2" should be one station, a number from 0 to 254'),
    (('read', 'N7:0', '--station', '0o12', '--port', 'x'),
     '"0o12" should be one station, a number from 0 to 254\n'),
    (('ping', '1', '--count', '0', '--port', 'x'), '"0" should be a whole number from 1'),
    (('watch', 'N7:0', '--period', '500'), '"500" should be seconds from 0 to 60; 0.5 is 500 ms'),
    (('files', '--files', '300'), '"300" should be numbers of files from 0 to 254, as in 7,9-12'),
    (('--port', '/dev/x', 'read', 'N7:0'),
     'options come after the command, as in "plc read ... --port ..."'),
    (('raed', 'N7:0'), '"raed" is not a command; did you mean read?'),
    (('READ', 'N7:0'), '"READ" is not a command; did you mean read?'),
    (('N7:0',), '"N7:0" is not a command; did you mean plc read N7:0?'),
    (('read', 'N7:0', '--port', './nowhere'), f'{Path("nowhere").absolute()}: No such file'),
    (('init', '/dev/x'), 'unrecognized arguments: /dev/x; did you mean --port /dev/x?'),
    (('read', 'N7:0', '--len', '5'), 'unrecognized arguments: --len 5; did you mean --length?'),
    (('write', 'N7:0', '5', '--force'), 'unrecognized arguments: --force\n'),
    ((), 'the following arguments are required: COMMAND')])
def test_option_that_is_wrong_is_told_with_status_2(
        args: tuple[str, ...], text: str, capsys: Output) -> None:
    said = call(main, capsys, *args)
    assert said.status == (1 if 'No such file' in text else 2)
    assert text in said.err


@pytest.mark.parametrize('port', ['/nowhere/tty', '/dev/null'])
def test_port_that_cannot_be_opened_is_told_with_status_1(port: str, capsys: Output) -> None:
    for args in (['read', 'N7:0'], ['watch', 'N7:0'], ['detect']):
        said = call(main, capsys, *args, '--port', port)
        assert said.status == 1 and said.err.startswith(f'plc: {port}: ')


@for_all('command', [
    '', 'read', 'write', 'watch', 'status', 'ping', 'scan', 'detect', 'import', 'ports'])
def test_help_has_examples_and_exit_statuses(command: str, capsys: Output) -> None:
    said = call(main, capsys, *command.split(), '--help')
    assert said.status == 0
    assert 'exit status:' in said.out
    assert f'plc {command}' in said.out.partition('example')[2]
    assert 'a running watch, log or ping ends with 0 or 1 instead' in said.out
