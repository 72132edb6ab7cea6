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

"""Commands of ``plc`` in full duplex, beside an echo and by radio; ``plc detect``."""

from collections.abc import Iterator
from pathlib import Path
import re
import shlex
import time

from abdf1_ros.cli.check import examine
from abdf1_ros.cli.plc.command import main
from abdf1_ros.df1.echo import COMES_BACK
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.plan.report import make_report
from abdf1_ros.settings.network import Network
import pytest
from support.commands import call, Output, PATIENT, running_simulator, Said
from support.driver_bench import Recorder
from support.mappings import make_mapping
from support.plc_line import machine_line
from support.ptys import Pty
from support.ros import Process, write_csv
from support.simulator_process import Files


@pytest.fixture(scope='module')
def peer(files: Files) -> Iterator[str]:
    """Return the port of a full-duplex line with BCC."""
    port = str(files.folder / 'peer')
    with running_simulator('--pty', port, '--data', str(files.simulator), '--full-duplex', '2',
                           '--check', 'BCC'):
        yield port


FULL_DUPLEX = ('--peer', '--check', 'bcc', *PATIENT)


def test_write_and_read_in_full_duplex(peer: str, capsys: Output) -> None:
    line = ('--port', peer, *FULL_DUPLEX, '--station', '2')
    assert call(main, capsys, 'write', 'N7:10', '7', '--yes', *line).status == 0
    assert call(main, capsys, 'read', 'N7:10', *line).good_lines == ['N7:10 7']


def test_init_does_not_call_a_full_duplex_port_0_that_answers_to_all(
        peer: str, tmp_path: Path, capsys: Output) -> None:
    said = call(main, capsys, 'init', '--port', peer, '--into', str(tmp_path), '--peer', *PATIENT)
    assert said.status == 0 and 'watch S:0 --station 1 --net' in said.out
    found = examine(str(tmp_path / 'net.csv'), str(tmp_path / 'map.csv'))
    assert found.problems == [] and found.network is not None
    assert [mapping.station for mapping in found.mappings] == [1]
    assert make_report(found.network, found.mappings, 0.1).remarks() == []
    assert '\n# n7_1,Read,N7:0,' in (tmp_path / 'map.csv').read_text('utf-8')  # its own list


def test_scan_in_full_duplex_tells_what_it_cannot_know(peer: str, capsys: Output) -> None:
    scanned = call(main, capsys, 'scan', '2-3', '--port', peer, *FULL_DUPLEX)
    assert scanned.good_lines[-2:] == [
        '2 of 2 stations answer', 'in full duplex most PLCs answer to every station '
        'number, so these may be one PLC']
    alone = call(main, capsys, 'scan', '2', '--port', peer, *FULL_DUPLEX)
    assert alone.good_lines[-1] == '1 of 1 stations answer'


def test_detect_finds_a_full_duplex_port(peer: str, capsys: Output) -> None:
    found = call(main, capsys, 'detect', '--port', peer, '--stations', '2', '--baud', '9600',
                 *PATIENT)
    assert found.status == 0, found.err
    assert found.lines[0].partition(':')[0] == '9600 baud, full duplex, BCC'
    assert f'plc read N7:0 --peer --station 2 --port {peer} --baud 9600' in found.out


@pytest.mark.usefixtures('half_duplex_only')
def test_detect_shows_what_it_has_found_and_how_to_go_on(
        tmp_path: Path, files: Files, capsys: Output) -> None:
    port = str(tmp_path / 'line')
    with running_simulator('--pty', port, '--data', str(files.simulator), '--check', 'BCC'):
        said = call(main, capsys, 'detect', '--port', port, '--stations', '2', '--duplex', 'half',
                    '--timeout', '2000')
    assert said.status == 0, said.err
    assert said.lines[0].startswith('19200 baud, half duplex, BCC: station 2 SLC 5/03')
    assert said.lines[1] == 'inputs and outputs: Access Slot or Flat'
    assert said.lines[2].startswith('next: ')
    assert ' '.join(shlex.split(said.lines[2])).endswith(
        f'plc read N7:0 --station 2 --port {port} --baud 19200 --check BCC')
    assert said.lines[3:] == [
        'net.csv:', 'Station,Mode,Error_Code,Com_Port,Baud,Parity,Timeout',
        f'5,Master,BCC,{port},19200,None,300']


def told(said: Said) -> list[str]:
    """Return what is told in the end; on a busy host a search also tells how far it is."""
    return [line for line in said.err.splitlines() if not line.startswith('trying ')]


def test_detect_of_nobody_has_status_1_and_says_what_was_tried(
        tmp_path: Path, capsys: Output) -> None:
    line = Pty(tmp_path / 'line')
    said = call(main, capsys, 'detect', '--port', str(line.name), '--stations', '1', '--timeout',
                '30', '--baud', '9600')
    line.close()
    assert said.status == 1
    assert told(said) == [
        'plc: nothing answers with any of these settings, tried 2 times',
        'plc: not one character came: cable (data lines not crossed, the wrong port), port or '
        'power; or a station that was not asked (a PLC-5 shows its own in octal). Next: look at '
        'the cable, then give other numbers with --stations',
        'plc: --baud: no other value was tried; leave the option out to try all']


def test_detect_of_what_is_not_understood(tmp_path: Path, files: Files, capsys: Output) -> None:
    port = str(tmp_path / 'line')
    with running_simulator('--pty', port, '--data', str(files.simulator), '--check', 'BCC'):
        said = call(main, capsys, 'detect', '--port', port, '--stations', '2', '--check', 'CRC',
                    '--duplex', 'half', '--baud', '9600', '--timeout', '1000')
    assert said.status == 1
    # Of 256 CRCs one is a good BCC, too: then the PLC replies, and the check is certain.
    first, cause, *rest = told(said)
    assert first == 'plc: nothing answers with any of these settings, tried 2 times'
    assert re.match('plc: 9600 baud, half duplex, CRC: station 2 answers polls, .*BCC', cause)
    assert rest == [
        'plc: --duplex and --baud and --check: no other value was tried; leave the option out to '
        'try all']


@pytest.fixture(scope='module')
def echoing(tmp_path_factory: pytest.TempPathFactory, files: Files) -> Iterator[Process]:
    """Run a simulator on a line that echoes; ``name`` in its ``args`` is the port."""
    port = str(tmp_path_factory.mktemp('echoing') / 'line')
    with running_simulator('--pty', port, '--data', str(files.simulator), '--echo') as process:
        yield process


def echoing_port(process: Process) -> str:
    """Return the port of the line that echoes."""
    return process.wait_for(' on ').partition(' on ')[2].partition(',')[0]


_COMES_BACK = COMES_BACK.partition(';')[0]
_COME_BACK = 'our own bytes come back'


def call_in_echo(capsys: Output, *args: str) -> Said:
    """Run a command that nobody answers; wait longer where the echo came too late."""
    said = call(main, capsys, *args, '--timeout', '50')
    return said if _COME_BACK in said.err else call(main, capsys, *args, *PATIENT)


def test_detect_tells_of_the_echo_and_finds_the_plcs_behind_it(
        echoing: Process, capsys: Output) -> None:
    for station in (1, 2):
        echoing.say(f'normal {station}')
    port = echoing_port(echoing)
    said = call(main, capsys, 'detect', '--port', port, '--stations', '1,2', '--timeout', '2000')
    assert (said.status, said.err.splitlines()[-1]) == (0, f'plc: {COMES_BACK}')
    assert said.lines[0].startswith('19200 baud, half duplex, CRC: station 1 PLC-5/40')
    # On a busy host the echo of detect's last ACK may come so late that it answers for the PLC.
    assert ['N7:0 1200'] in (
        call(main, capsys, 'read', 'N7:0', '--port', port, *PATIENT).lines for _ in range(4))


@pytest.mark.parametrize('args', [('ping', '1'), ('write', 'N7:0', '1', '--station', '1')])
@pytest.mark.parametrize('duplex', ['full', 'half'])
def test_echo_alone_is_no_plc(echoing: Process, capsys: Output,
                              args: tuple[str, ...], duplex: str) -> None:
    for station in (1, 2):
        echoing.say(f'silent {station}')
    said = call_in_echo(capsys, *args, '--port', echoing_port(echoing), '--duplex', duplex)
    assert (said.status, said.out.strip()) == (1, '4 sent, 0 answered' if 'ping' in args else '')
    # In half duplex an adapter may echo beside a silent PLC.
    assert {'full': f'plc: {_COMES_BACK}. Next: check the cable', 'half': (
        'plc: our own bytes come back, and nothing else: TX and RX are connected, or the adapter '
        'echoes and station 1 is silent. Next: take the cable off the PLC')}[duplex] in said.err


@pytest.mark.parametrize('args', [('detect',), ('init', '--into', 'new')])
def test_detect_finds_nobody_in_an_echo(echoing: Process, capsys: Output, args: tuple[str, ...],
                                        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for station in (1, 2):
        echoing.say(f'silent {station}')
    said = call_in_echo(capsys, *args, '--port', echoing_port(echoing), '--stations', '1,2',
                        '--baud', '9600')
    assert (said.status, said.out) == (1, '')
    assert told(said)[:2] == [
        f'plc: {COMES_BACK}', 'plc: nothing answers with any of these settings, tried 2 times']
    assert 'character' not in said.err  # what came was our own


def test_plcs_behind_a_radio_modem(tmp_path: Path, files: Files, capsys: Output) -> None:
    port = str(tmp_path / 'line')
    net = write_csv(tmp_path / 'net.csv', 'Mode,Cmd_Timeout', ['Radio,1000'])
    line = '--radio', '--port', port
    with running_simulator('--pty', port, '--data', str(files.simulator), '--radio') as process:
        assert call(main, capsys, 'read', 'N7:0', '--net', str(net),
                    '--port', port).good_lines == ['N7:0 1200']
        assert call(main, capsys, 'write', 'N7:0', '7', '--yes', *line).err == (
            'plc: --station: give the station to write to: this line may have several stations\n')
        write = 'write', 'N7:0', '7', '--yes', '--station', '1'
        assert call(main, capsys, *write, *line).status == 0
        watched = call(main, capsys, 'watch', 'N7:0', '--count', '2', '--period', '0.1', *line)
        assert (watched.status, watched.lines[-1].split()[1:]) == (0, ['N7:0', '7'])
        assert call(main, capsys, 'status', '2', *line).lines[0].startswith('station 2: SLC 5/03')
        # 5 is ours usually.
        found = call(main, capsys, 'scan', '1-2,5', '--timeout', '1000', *line)
        assert found.lines[-1] == '2 of 3 stations answer; silent stations were asked 2 times'
        process.say('silent 2')
        process.wait_for('station 2: silent')
        silent = call(main, capsys, 'status', '2', '--timeout', '500', *line)
        assert silent.status == 1
        assert 'Slave Station (2) Inactive' in silent.err and 'radio modem, CRC' in silent.err


def test_words_of_a_node_on_a_radio_modem(tmp_path: Path, capsys: Output) -> None:
    network = Network(mode='Radio', plc_type='SLC', station=9)
    words = make_mapping('N7:0', 'Serve', station=9, length=2, plc='SLC')
    driver = Driver(network, [words], DriverSettings(), Recorder(time.monotonic))
    with machine_line(tmp_path / 'line', driver.machine) as name:
        options = '--radio', '--port', name
        write = call(main, capsys, 'write', 'N7:1', '5', '--yes', '--station', '9', *options)
        assert write.good_lines[-1] == 'N7:1 5'
        read = call(main, capsys, 'read', 'N7:0', '--length', '2', '--station', '9', *options)
        assert read.good_lines == ['N7:0 0 5']
        assert call(main, capsys, 'ping', '9', '--count', '1', *options).status == 0
