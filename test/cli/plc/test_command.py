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

"""The command ``plc`` on simulated lines: every subcommand, its output and exit status."""

from collections.abc import Callable, Iterator
import os
from pathlib import Path
import pty
import shlex
import signal
import subprocess
import sys
import time

from abdf1_ros.cli.check import examine
from abdf1_ros.cli.plc.command import main
from abdf1_ros.df1.echo import COMES_BACK
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.plan.report import make_report
from abdf1_ros.ports.endpoints import PtyEndpoint
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.settings.network import Network
import pytest
from support.cases import for_all
from support.commands import call, running_simulator, Said
from support.driver_bench import Recorder
from support.mappings import make_mapping
from support.ptys import PATIENCE, Pty, wait_until
from support.ros import Process, write_csv
from support.simulator_process import Files, make_files

FAST = ('--timeout', '250')  # ms; for who is silent
PATIENT = ('--timeout', '3000')  # for who is there, but may be late on a busy host

Plc = Callable[..., Said]


@pytest.fixture(scope='module')
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    return make_files(tmp_path_factory.mktemp('line'))


@pytest.fixture(scope='module')
def simulator(files: Files) -> Iterator[Process]:
    with files.start_simulator() as process:
        yield process


@pytest.fixture
def line(simulator: Process, files: Files) -> str:
    """Return the port of a line on which every station works."""
    for station in (1, 2):
        simulator.say(f'normal {station}')
    return str(files.port)


@pytest.fixture
def plc(line: str, capsys: pytest.CaptureFixture[str]) -> Plc:
    return lambda command, *args: call(main, capsys, command, '--port', line, *PATIENT, *args)


@pytest.mark.parametrize('station, address, options, lines', [
    (1, 'B3:0/2', ('--length', '6'), ['B3:0/2 /2=1 /3=0 /4=0 /5=1 /6=1 /7=0']),
    (1, 'I:017/12', (), ['I:017/12 1']), (1, 'I:017', (), ['I:017 1024']),
    (1, 'N7:0', ('--length', '2'), ['N7:0 1200 -800']),
    (1, 'F8:0', ('--length', '3'), ['F8:0 12.5 40.25 -3.5']),
    (1, 'A10:0', ('--type', 'string', '--length', '3'), ["A10:0 'abc'"]),
    (1, 'N7:6', ('--type', 'uint32', '--word-order', 'High'), ['N7:6 65538']),
    (1, 'T4:1-1', (), ['T4:1 8192 DN', 'T4:1.PRE 500', 'T4:1.ACC 120']),
    (1, 'T4:1', (), ['T4:1 8192 DN', 'T4:1.PRE 500', 'T4:1.ACC 120']),
    (1, 'T4:1.ACC', (), ['T4:1.ACC 120']),
    (1, 'N7:0', ('--radix', 'bin'), ['N7:0 0000010010110000 /4 /5 /7 /10']),
    (1, 'I:017', ('--radix', 'bin'), ['I:017 0000010000000000 /12']),
    (1, 'T4:1/DN', (), ['T4:1/DN 1']), (2, 'C5:2.ACC', (), ['C5:2.ACC -17']),
    (2, 'I:1.0', ('--length', '2'), ['I:1.0 5 40960']), (2, 'O:2.0/4', (), ['O:2.0/4 1']),
    (2, 'L10:0', ('--length', '2'), ['L10:0 -70000 2000000000']),
    (2, 'N7:40', ('--type', 'int32'), ['N7:40 131071']),
    (2, 'N7:30', ('--type', 'bcd16', '--length', '2'), ['N7:30 1234 99']),
    (2, 'ST9:1', (), ["ST9:1 'Tank 4'"]), (2, 'F8:4', (), ['F8:4 21.5'])])
def test_read_shows_address_and_values(
        plc: Plc, station: int, address: str, options: tuple[str, ...], lines: list[str]) -> None:
    said = plc('read', address, '--station', str(station), *options)
    assert (said.status, said.lines, said.err) == (0, lines, '')


def test_read_shows_rows_with_their_addresses(plc: Plc) -> None:
    said = plc('read', 'N7:10', 'B3:0/15', '--length', '18', '--station', '2')
    assert [line.split()[0] for line in said.lines] == ['N7:10', 'N7:20', 'B3:0/15', 'B3:1/15']
    assert said.lines[0] == 'N7:10 101 102 103 104 0 0 0 0 0 0'


def test_tags_of_a_map_stand_beside_addresses(plc: Plc, tmp_path: Path) -> None:
    path = write_csv(tmp_path / 'map.csv', 'Tag,Command,Address,Station,PLC_Type',
                     ['speed,Read,N7:0,1,PLC5', 'wrong,Read,N7:999999,1,PLC5'])
    said = plc('read', 'N7:0', '--map', str(path))
    assert (said.status, said.lines) == (0, ['N7:0 speed 1200'])
    assert said.err.startswith(f'plc: {path}:3:3 (Address): ')
    said = plc('watch', 'N7:0', '--count', '1', '--map', str(path))
    assert said.lines[-1].split()[1:] == ['N7:0', 'speed', '1200']
    assert plc('read', 'N7:0', '--map', str(tmp_path / 'none.csv')).status == 2


MAP_OF_TAGS = ('Tag,Command,Address,Station,PLC_Type,Length,Scale,Min,Max,Description', [
    'speed,Read,N7:0-1,1,PLC5,,0.1,,,', 'level,ReadWrite,N7:30,2,SLC,,0.5,0,10,Tank 4 [%]',
    'order,Write,N7:31,2,SLC,,,,,'])


def test_rows_of_a_map_are_read_by_their_tags(plc: Plc, tmp_path: Path) -> None:
    path = write_csv(tmp_path / 'map.csv', *MAP_OF_TAGS)
    capture = tmp_path / 'line.cap'
    said = plc('read', 'speed', 'N7:0', '--map', str(path), '--record', str(capture))
    assert (said.status, said.lines) == (0, ['N7:0 speed[0] 120', 'N7:1 speed[1] -80',
                                             'N7:0 speed[0] (raw) 1200'])
    assert capture.read_text('ascii').startswith('# abdf1_ros capture 1\n')
    assert [line.split()[:2] for line in plc('read', '--map', str(path)).lines] == [
        ['N7:0', 'speed[0]'], ['N7:1', 'speed[1]'], ['N7:30', 'level']]
    said = plc('watch', 'speed', '--count', '1', '--map', str(path))
    assert [line.split()[1:] for line in said.lines] == [
        ['N7:0', 'speed[0]', '120'], ['N7:1', 'speed[1]', '-80']]
    said = plc('read', 'sped', '--map', str(path))
    assert said.status == 2 and f'{path}: tags that are read: speed, level' in said.err
    said = plc('read')
    assert said.status == 2 and 'ADDRESS: name one such as N7:0, or a map with --map' in said.err


def test_map_says_of_each_tag_what_options_say_of_addresses(plc: Plc, tmp_path: Path) -> None:
    path = str(write_csv(tmp_path / 'map.csv', *MAP_OF_TAGS))
    assert plc('read', 'level', '--length', '2', '--map', path).err == (
        'plc: --length: is for an address; the map says it of each tag\n')
    assert plc('read', 'level', '--station', '1', '--map', path).err == (
        'plc: --station: level is of station 2 in the map\n')
    assert plc('read', '--station', '2', '--map', path).lines == ['N7:30 level 2330 % Tank 4 [%]']
    assert plc('read', '--station', '3', '--map', path).err == (
        f'plc: {path}: has no row of station 3 that is read\n')
    assert plc('read', 'Level', '--map', path).err.endswith(
        'tags that are read: speed, level; did you mean level?\n')
    assert plc('read', 'level', '--map', path, '--own-station', '2').err == (
        f'plc: {path}:3: Item: 2, Station 2 is our own in the net file; here belongs the station '
        'to read or write\n')


@pytest.mark.parametrize('args', [
    ('read', 'far'), ('read', 'N7:1', '--station', '7', '--plc-type', 'SLC'),
    ('write', 'far', '1', '--yes')])
def test_row_behind_a_gateway_is_asked_through_it(tmp_path: Path, args: tuple[str, ...]) -> None:
    path = write_csv(tmp_path / 'map.csv', 'Tag,Command,Address,Station,PLC_Type,Via',
                     ['far,ReadWrite,N7:0,7,SLC,9'])
    line = Pty(tmp_path / 'line')
    with Process('plc', *args, '--map', str(path), '--port', str(line.name), '--timeout',
                 '9000') as process:
        assert line.read(6) == bytes.fromhex('10 01 09 10 02 07')  # to 9, for 7
        wait_until(lambda: process.catches(signal.SIGTERM))
        process.send(signal.SIGTERM)
        process.result()
    line.close()


MAP_TO_WRITE = ('Tag,Command,Address,Station,PLC_Type,Max,Fallback,Fallback_After,Scale', [
    'Level,ReadWrite,N7:55,2,SLC,10,,,0.5', 'speed,Read,N7:0,1,PLC5,,,,',
    'all,Write,N7:9,255,SLC,,,,', 'beat,Heartbeat,N7:56,2,SLC,,,,',
    'valve,Write,N7:57,2,SLC,,0,1000,'])


def test_row_of_a_map_is_written_by_its_tag(plc: Plc, tmp_path: Path) -> None:
    path = str(write_csv(tmp_path / 'map.csv', *MAP_TO_WRITE))
    said = plc('write', 'Level', '5.5', '--map', path)
    assert (said.status, said.lines) == (
        2, ['now:', 'N7:55 0', 'would write [5.5] (raw [11]) to Level (N7:55) of station 2'])
    said = plc('write', 'Level', '5.5', '--map', path, '--yes')
    assert (said.status, said.lines, said.err) == (
        0, ['Level (N7:55) of station 2: written; now:', 'N7:55 5.5'], '')
    assert plc('read', 'N7:55', '--station', '2').lines == ['N7:55 11']


@for_all(('args', 'text'), [
    (('level', '5'), '"level" is not a tag of this map; tags that can be written: Level, valve; '
                     'did you mean Level?'),
    (('speed', '5'), '"speed" is a Read row of station 1; tags'),
    (('beat', '5'), '"beat" is a Heartbeat row of station 2; tags'),
    (('all', '5'), '"all" is a Write row of station 255; tags'),
    (('N7:55', '5'), '"N7:55" is an address; with --map a tag is written, within the limits'),
    (('Level', '11'), 'Level: value 11 at index 0 is outside Min -inf, Max 10'),
    (('Level', '1', '2'), 'Level: 2 values, the mapping has 1'),
    (('Level', 'full'), 'Level: "full" is not a valid float32'),
    (('Level', '1', '--station', '1'), '--station: Level is of station 2 in the map'),
    (('Level', '1', '--type', 'int32'), '--type: is for an address; the map says it')])
def test_what_a_row_does_not_allow_is_told_before_the_port_is_opened(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], args: tuple[str, ...],
        text: str) -> None:
    path = write_csv(tmp_path / 'map.csv', *MAP_TO_WRITE)
    assert main(['write', *args, '--yes', '--map', str(path), '--port', '/nowhere/plc']) == 2
    assert text in capsys.readouterr().err


def test_write_with_an_equals_sign(plc: Plc) -> None:
    assert plc('write', 'N7:58=6', '--station', '2', '--yes').lines[-1] == 'N7:58 6'


STRUCTURES = """\
Station,PLC_Type,Address,Length,Values
1,PLC5,PD10:0,164,
1,PLC5,PD10:0/EN,1,1
1,PLC5,PD10:0.SP,2,350 1.5
1,PLC5,PD10:1.TIE,1,7.5
1,PLC5,MG11:0,56,
1,PLC5,MG11:0.ERR,1,-3
2,SLC,PD10:0,23,
2,SLC,PD10:0.SPS,1,12
"""


def test_element_of_a_structure_is_a_block_of_its_named_words(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'data.csv').write_text(STRUCTURES)
    port = str(tmp_path / 'line')
    with running_simulator('--pty', port, '--data', str(tmp_path / 'data.csv')):
        def read(*args: str) -> list[str]:
            return call(main, capsys, 'read', *args, '--port', port, *PATIENT).lines
        lines = read('PD10:0-1')
        assert lines[:4] == ['PD10:0 -32768 EN', 'PD10:0.1 0', 'PD10:0.SP 350', 'PD10:0.KP 1.5']
        assert len(lines) == 2 * 26 and lines[-1] == 'PD10:1.TIE 7.5'
        assert read('MG11:0') == ['MG11:0 0', 'MG11:0.ERR -3', 'MG11:0.RLEN 0', 'MG11:0.DLEN 0']
        assert read('PD10:0', '--station', '2')[:3] == ['PD10:0 0', 'PD10:0.SPS 12', 'PD10:0.KC 0']
        watched = call(main, capsys, 'watch', 'MG11:0', '--count', '1', '--port', port, *PATIENT)
        assert [line.split()[1:] for line in watched.lines] == [
            ['MG11:0', '0'], ['MG11:0.ERR', '-3'], ['MG11:0.RLEN', '0'], ['MG11:0.DLEN', '0']]


def test_write_over_a_fallback_is_told(plc: Plc, tmp_path: Path) -> None:
    path = write_csv(tmp_path / 'map.csv', *MAP_TO_WRITE)
    said = plc('write', 'valve', '0', '--map', str(path), '--yes')
    assert said.status == 0 and said.err == (
        'plc: valve (N7:57) has a Fallback, which only the bridge writes: after this write '
        'nothing brings the value of rest back\n')


def test_family_that_is_given_is_compared_with_what_the_plc_says(plc: Plc) -> None:
    said = plc('read', 'N7:0', '--plc-type', 'plc5')
    assert (said.lines, said.err) == (['N7:0 1200'], '')
    told = 'plc: station 2 is SLC 5/03 series A revision 1, REM RUN; --plc-type says PLC5\n'
    said = plc('read', 'N7:10', 'N7:11', '--plc-type', 'PLC5', '--station', '2')
    assert (said.status, said.lines, said.err) == (0, ['N7:10 101', 'N7:11 102'], told)
    said = plc('write', 'N7:19', '4', '--plc-type', 'PLC5', '--station', '2', '--yes')
    assert (said.status, said.err) == (0, told)


def test_type_that_is_not_that_of_the_plc_is_named_once(plc: Plc) -> None:
    said = plc('read', 'N7:0', 'N7:1', '--plc-type', 'SLC')
    assert (said.status, said.lines) == (1, [])
    assert [said.err.count(f'plc: N7:{word} of station 1: STS ') for word in (0, 1)] == [1, 1]
    assert said.err.count('plc: station 1 is PLC-5/40') == 1
    assert said.err.splitlines()[1].endswith('; --plc-type says SLC')


def test_read_goes_on_after_a_refusal(plc: Plc) -> None:
    said = plc('read', 'N99:0', 'N7:0')
    assert (said.status, said.lines) == (1, ['N7:0 1200'])
    assert said.err.startswith('plc: N99:0 of station 1: STS F0 EXT STS')
    assert '"plc files 1" tells which data files it has' in said.err
    said = plc('read', 'N99:0', 'N98:0')
    assert said.err.count('of station 1: STS F0') == 2 and said.err.count('"plc files 1"') == 1


def test_silence_of_a_station_that_nobody_named(plc: Plc, simulator: Process) -> None:
    told = 'no station was given, so 1 was asked; "plc scan" tells who is there'
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
    said = plc('read', 'N7:0', '--own-station', '1')
    assert (said.status, said.err) == (
        2, 'plc: --station: say which station to ask; 1 is our own\n')


def test_scan_asks_a_plc_that_has_our_number(plc: Plc) -> None:
    said = plc('scan', '1-2', '--own-station', '2')
    assert said.lines[-1] == '2 of 2 stations answer'


def test_write_to_an_input_is_told(plc: Plc) -> None:
    said = plc('write', 'I:1.0', '5', '--station', '2')
    assert said.err.splitlines()[0] == (
        'plc: I:1.0 is an input: the PLC overwrites what is written there with its next scan')


def test_read_in_another_radix(plc: Plc) -> None:
    said = plc('read', 'N7:10', '--length', '3', '--station', '2', '--radix', 'hex')
    assert said.lines == ['N7:10 0065 0066 0067']


def test_read_over_a_net_file(line: str, files: Files, capsys: pytest.CaptureFixture[str]) -> None:
    net = write_csv(files.folder / 'plc.csv', 'Com_Port,Baud,Timeout', [f'{line},115200,1000'])
    assert call(main, capsys, 'read', 'N7:0', '--net', str(net)).lines == ['N7:0 1200']


@pytest.mark.parametrize('address, values, options, lines', [
    ('N7:10', ('5', '-6', '0x10'), (), ['N7:10 5 -6 16']),
    ('F8:6', ('-1.5', '2'), (), ['F8:6 -1.5 2']), ('ST9:0', ('Tank 5',), (), ["ST9:0 'Tank 5'"]),
    ('B3:2/3', ('1', '0', '1'), (), ['B3:2/3 /3=1 /4=0 /5=1']),
    ('N7:50', ('70000',), ('--type', 'int32'), ['N7:50 70000']),
    ('N7:52', ('abcde',), ('--type', 'string'), ["N7:52 'abcde'"]),
    ('C5:2.PRE', ('9',), (), ['C5:2.PRE 9'])])
def test_write_is_read_back_and_shown(
        plc: Plc, address: str, values: tuple[str, ...], options: tuple[str, ...], lines:
        list[str]) -> None:
    said = plc('write', address, *values, '--yes', '--station', '2', *options)
    assert (said.status, said.lines, said.err) == (
        0, [f'{address} of station 2: written; now:', *lines], '')


def test_write_without_yes_writes_nothing(plc: Plc) -> None:
    before = plc('read', 'N7:20', '--length', '2', '--station', '2').lines
    said = plc('write', 'N7:20', '55', '66', '--station', '2')
    assert said.status == 2
    assert said.lines == ['now:', *before, 'would write [55, 66] to N7:20 of station 2']
    assert said.err == 'plc: nothing was written; --yes writes\n'
    assert plc('read', 'N7:20', '--length', '2', '--station', '2').lines == before


def _into(path: str, line: str, *args: str) -> tuple[int, str]:
    """Run it with an output that takes nothing; return exit status and standard error."""
    with open(path, 'w') as output:
        said = subprocess.run(
            [sys.executable, '-m', 'abdf1_ros', 'plc', *args, '--port', line, *PATIENT],
            stdout=output, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, timeout=30,
            check=False)
    return said.returncode, said.stderr


def test_output_that_is_full_hides_no_write(plc: Plc, line: str) -> None:
    write = 'write', 'N7:27', '71', '--station', '2'
    assert _into('/dev/full', line, *write, '--yes') == (
        0, 'plc: written, but that cannot be printed: No space left on device\n')
    assert plc('read', 'N7:27', '--station', '2').lines == ['N7:27 71']
    assert _into('/dev/full', line, 'read', 'N7:27', '--station', '2') == (
        2, 'plc: cannot print: No space left on device\n')


def test_write_of_which_nobody_reads_what_would_happen(plc: Plc, line: str) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    said = subprocess.run(
        [sys.executable, '-m', 'abdf1_ros', 'plc', 'write', 'N7:27', '72', '--station', '2',
         '--port', line, *PATIENT], stdout=writer, stdin=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True, timeout=30, check=False)
    os.close(writer)
    assert said.returncode == 2 and 'Traceback' not in said.stderr
    assert plc('read', 'N7:27', '--station', '2').lines != ['N7:27 72']


@pytest.mark.parametrize('answer, status, value', [('y', 0, '61'), ('', 2, '60')])
def test_write_asks_who_sits_at_a_terminal(line: str, plc: Plc, answer: str, status: int,
                                           value: str) -> None:
    plc('write', 'N7:25', '60', '--yes', '--station', '2')
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [sys.executable, '-m', 'abdf1_ros', 'plc', 'write', 'N7:25', '61', '--station', '2',
         '--port', line, *PATIENT], stdin=theirs, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True)
    os.write(ours, f'{answer}\n'.encode())
    out, _ = process.communicate(timeout=PATIENCE)
    os.close(ours)
    os.close(theirs)
    assert process.returncode == status
    assert 'N7:25  60\nwrite [61] to N7:25 of station 2? [y/N]' in out
    assert plc('read', 'N7:25', '--station', '2').lines == [f'N7:25 {value}']


@pytest.mark.parametrize('args, text', [
    (('N7:0', '40000'), '"40000" is not a valid int16'),
    (('N7:0', '1_000'), '"1_000" is not a valid int16'),
    (('N7:0', 'ten'), '"ten" is not a valid int16'),
    (('N7:0', '1.5'), '"1.5" is not a valid int16'),
    (('B3:0/0', '2'), '"2" is not a valid bool'),
    (('ST9:0', 'Tank', '5'), 'ST9:0 takes one text; quote it if it has spaces'),
    (('T4:0', '5'), 'belongs to the processor'), (('N7', '5'), 'ADDRESS "N7": an element is'),
    (('N7:9999', '5'), 'ADDRESS "N7:9999": elements of N run from 0 to 255')])
def test_write_of_what_cannot_be_written(plc: Plc, args: tuple[str, ...], text: str) -> None:
    said = plc('write', *args, '--yes', '--station', '2')
    assert said.status == 2
    assert text in said.err


@for_all(('args', 'text'), [
    (('read', 'N7:0', '--length', 'x'), '--length: "x" should be a whole number from 1 to 65535'),
    (('watch', 'N7:0', '--length', '0'), '--length: "0" should be a whole number from 1 to 65535'),
    (('read', 'N7:0', 'ST9:0', '--length', '3'),
     '--length of ST9:0: a string mapping has Length 1'),
    (('watch', 'line_speed'), 'ADDRESS "line_speed": write type, file, ":", element, as in N7:0, '
                              'B3:1/5, T4:0.ACC or I:1.0/3\nplc: --map: if line_speed is a tag, '
                              'name its map with --map FILE'),
    (('write', 'B3:0/1=on'), 'B3:0/1: "on" is not a valid bool, 0 or 1'),
    (('read', 'N7:0', 'B3:O'), 'ADDRESS "B3:O": that is the letter O where a digit should be; '
                               'write B3:0'),
    (('write', 'N7:0', '99999'), 'N7:0: "99999" is not a valid int16, a whole number from -32768 '
                                 'to 32767'),
    (('write', 'F8:0', '1,000'), 'F8:0: "1,000" could be two numbers; write 1000 or 1.000'),
    (('write', 'N7:250', *'0123456', '--plc-type', 'SLC'),
     'VALUE: 7 elements do not fit at N7:250; the last word there can be is N7:255')])
def test_what_no_plc_could_take_is_told_before_the_port_is_opened(
        capsys: pytest.CaptureFixture[str], args: tuple[str, ...], text: str) -> None:
    assert main([*args, '--port', '/nowhere/plc', '--station', '1']) == 2
    assert capsys.readouterr().err == f'plc: {text}\n'


def test_write_that_the_plc_refuses_says_why(plc: Plc, simulator: Process) -> None:
    simulator.say('error 2 F0 0B')
    said = plc('write', 'N7:0', '1', '--yes', '--station', '2', '--plc-type', 'SLC')
    assert said.status == 1
    assert 'not written: the PLC refused it: STS F0 EXT STS 0B' in said.err


def test_write_without_a_reply_is_unknown(plc: Plc, simulator: Process) -> None:
    simulator.say('slow 2 100000')
    said = plc('write', 'N7:0', '1', '--yes', '--station', '2', '--plc-type', 'SLC')
    assert said.status == 3
    assert 'unknown whether written: 2508 ERR_COMMAND_TIMEOUT' in said.err


def test_write_broken_off_is_unknown(tmp_path: Path) -> None:
    line = Pty(tmp_path / 'line')
    with Process('plc', 'write', 'N7:0', '1', '--yes', '--plc-type', 'SLC', '--station', '1',
                 '--port', str(line.name), '--timeout', '9000') as process:
        line.read(10)  # the command is on its way
        wait_until(lambda: process.catches(signal.SIGTERM))
        process.send(*[signal.SIGINT] * 3)
        assert process.result() == 3
    line.close()
    assert 'unknown whether written: port lost: ' in process.text
    assert 'Traceback' not in process.text


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
    assert said.err.count('not one character came') == said.err.count('plc: sent: ') == 1
    assert said.err.endswith('plc: sent: 1 command, 1 poll, 3 repetitions of them; received: '
                             '0 damaged frames, 0 NAK\n')


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
    assert 'answers, but not who it is: STS 10' in said.lines[1]


def test_plc_without_diagnostic_status_is_not_called_a_missing_file(
        plc: Plc, simulator: Process) -> None:
    simulator.say('error 2 10')
    said = plc('read', 'N7:0', '--station', '2')
    assert said.status == 1
    assert 'station 2: does not say what it is (STS 10 to that question); say --plc-type' in (
        said.err)
    assert 'file' not in said.err


def test_scan_of_nobody_has_status_1(plc: Plc) -> None:
    said = plc('scan', '8,9', *FAST)
    assert (said.status, said.lines) == (
        1, ['0 of 2 stations answer; the others were asked 2 times'])


def test_watch_prints_changes_and_ends_by_count(plc: Plc) -> None:
    said = plc('watch', 'N7:0', 'F8:0', '--period', '0.05', '--count', '20')
    assert said.status == 0
    shown = [line.split(maxsplit=2)[1:] for line in said.lines]
    assert sorted(map(tuple, shown)) == [('F8:0', '12.5'), ('N7:0', '1200')]


def test_watch_tells_why_there_is_no_value(plc: Plc) -> None:
    said = plc('watch', 'N99:0', 'N7:0', '--period', '0.05', '--count', '2')
    assert said.status == 1
    assert any('N99:0 no value: STS F0' in line for line in said.lines)
    assert any(line.endswith('N7:0 1200') for line in said.lines)


def test_watch_goes_on_until_it_is_interrupted(line: str) -> None:
    with Process('plc', 'watch', 'N7:10', '--station', '2', '--period', '0.05', '--timeout',
                 '5000', '--port', line) as process:
        process.wait_for('N7:10  ')
        process.send(signal.SIGINT)
        assert process.result() == 0


def test_ping_goes_on_until_it_is_interrupted(line: str) -> None:
    with Process('plc', 'ping', '2', '--count', '1000000', '--timeout', '5000', '--port',
                 line) as process:
        process.wait_for('station 2: ')
        process.send(signal.SIGINT)
        assert process.result() == 0
    assert ' answered; shortest ' in process.text


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
    assert screen.endswith(b'1200\r\n\x1b[J')


def test_write_names_its_station_where_there_may_be_several(plc: Plc) -> None:
    said = plc('write', 'N7:21', '5', '--yes')
    assert (said.status, said.lines) == (2, [])
    assert said.err == (
        'plc: --station: say which station to write to: this line may have several\n')
    assert plc('write', 'N7:21', '5', '--yes', '--station', '2').lines == [
        'N7:21 of station 2: written; now:', 'N7:21 5']


@pytest.fixture(scope='module')
def peer(files: Files) -> Iterator[str]:
    """Return the port of a full-duplex line with BCC."""
    port = str(files.folder / 'peer')
    with running_simulator('--pty', port, '--data', str(files.simulator), '--full-duplex', '2',
                           '--check', 'BCC'):
        yield port


FULL_DUPLEX = ('--peer', '--check', 'bcc', *PATIENT)


def test_write_and_read_in_full_duplex(peer: str, capsys: pytest.CaptureFixture[str]) -> None:
    line = ('--port', peer, *FULL_DUPLEX, '--station', '2')
    assert call(main, capsys, 'write', 'N7:10', '7', '--yes', *line).status == 0
    assert call(main, capsys, 'read', 'N7:10', *line).good_lines == ['N7:10 7']


def test_init_does_not_call_a_full_duplex_port_0_that_answers_to_all(
        peer: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = call(main, capsys, 'init', '--port', peer, '--into', str(tmp_path), *FULL_DUPLEX)
    assert said.status == 0 and 'watch S:0 --station 1 --net' in said.out
    found = examine(str(tmp_path / 'net.csv'), str(tmp_path / 'map.csv'))
    assert found.problems == [] and found.network is not None
    assert [mapping.station for mapping in found.mappings] == [1]
    assert make_report(found.network, found.mappings, 0.1).remarks() == []


def test_scan_in_full_duplex_tells_what_it_cannot_know(
        peer: str, capsys: pytest.CaptureFixture[str]) -> None:
    scanned = call(main, capsys, 'scan', '2-3', '--port', peer, *FULL_DUPLEX)
    assert scanned.good_lines[-2:] == [
        '2 of 2 stations answer', 'full duplex tells no addresses apart: most PLCs answer to '
        'every station, so these may be one']


def test_detect_finds_a_full_duplex_port(peer: str, capsys: pytest.CaptureFixture[str]) -> None:
    found = call(main, capsys, 'detect', '--port', peer, '--stations', '2', '--baud', '9600',
                 *PATIENT)
    assert found.status == 0, found.err
    assert found.lines[0].partition(':')[0] == '9600 baud, full duplex, BCC'


@pytest.mark.usefixtures('half_duplex_only')
def test_detect_shows_what_it_has_found_and_how_to_go_on(
        tmp_path: Path, files: Files, capsys: pytest.CaptureFixture[str]) -> None:
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
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = Pty(tmp_path / 'line')
    said = call(main, capsys, 'detect', '--port', str(line.name), '--stations', '1', '--timeout',
                '30', '--baud', '9600')
    line.close()
    assert said.status == 1
    assert told(said) == [
        'plc: nothing answers with any of these settings, tried 2 times',
        'plc: not one character came: cable, port, power? Or a station that was '
        'not asked (--stations; a PLC-5 shows its own in octal)',
        'plc: --baud: nothing else was tried; leave it out to try all']


def test_detect_of_what_is_not_understood(tmp_path: Path, files: Files,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    port = str(tmp_path / 'line')
    with running_simulator('--pty', port, '--data', str(files.simulator), '--check', 'BCC'):
        said = call(main, capsys, 'detect', '--port', port, '--stations', '2', '--check', 'CRC',
                    '--duplex', 'half', '--baud', '9600', '--timeout', '2000')
    assert said.status == 1
    assert told(said) == ['plc: nothing answers with any of these settings, tried 2 times',
                          'plc: 9600 baud, half duplex, CRC: 4 characters came',
                          'plc: --duplex and --baud and --check: nothing else was '
                          'tried; leave it out to try all']


@pytest.fixture(scope='module')
def echoing(tmp_path_factory: pytest.TempPathFactory, files: Files) -> Iterator[Process]:
    """Run a simulator on a line that echoes; ``name`` in its ``args`` is the port."""
    port = str(tmp_path_factory.mktemp('echoing') / 'line')
    with running_simulator('--pty', port, '--data', str(files.simulator), '--echo') as process:
        yield process


def echoing_port(process: Process) -> str:
    """Return the port of the line that echoes."""
    return process.wait_for(' on ').partition(' on ')[2].partition(',')[0]


def call_in_echo(capsys: pytest.CaptureFixture[str], *args: str) -> Said:
    """Run a command that nobody answers; wait longer where the echo came too late."""
    said = call(main, capsys, *args, '--timeout', '50')
    return said if COMES_BACK in said.err else call(main, capsys, *args, *PATIENT)


def test_detect_tells_of_the_echo_and_finds_the_plcs_behind_it(
        echoing: Process, capsys: pytest.CaptureFixture[str]) -> None:
    for station in (1, 2):
        echoing.say(f'normal {station}')
    port = echoing_port(echoing)
    said = call(main, capsys, 'detect', '--port', port, '--stations', '1,2', '--timeout',
                '2000')
    assert (said.status, said.err.splitlines()[-1]) == (0, f'plc: {COMES_BACK}')
    assert said.lines[0].startswith('19200 baud, half duplex, CRC: station 1 PLC-5/40')
    assert call(main, capsys, 'read', 'N7:0', '--port', port, *PATIENT).good_lines == ['N7:0 1200']


@pytest.mark.parametrize('args', [('ping', '1'), ('write', 'N7:0', '1', '--station', '1')])
@pytest.mark.parametrize('duplex', ['full', 'half'])
def test_echo_alone_is_no_plc(echoing: Process, capsys: pytest.CaptureFixture[str],
                              args: tuple[str, ...], duplex: str) -> None:
    for station in (1, 2):
        echoing.say(f'silent {station}')
    said = call_in_echo(capsys, *args, '--port', echoing_port(echoing), '--duplex', duplex)
    assert (said.status, said.out.strip()) == (1, '4 sent, 0 answered' if 'ping' in args else '')
    assert f'plc: {COMES_BACK}\n' in said.err


@pytest.mark.parametrize('args', [('detect',), ('init', '--into', 'new')])
def test_detect_finds_nobody_in_an_echo(
        echoing: Process, capsys: pytest.CaptureFixture[str], args: tuple[str, ...],
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


def test_plcs_behind_a_radio_modem(
        tmp_path: Path, files: Files, capsys: pytest.CaptureFixture[str]) -> None:
    port = str(tmp_path / 'line')
    net = write_csv(tmp_path / 'net.csv', 'Mode,Cmd_Timeout', ['Radio,1000'])
    line = '--radio', '--port', port
    with running_simulator('--pty', port, '--data', str(files.simulator), '--radio') as process:
        assert call(main, capsys, 'read', 'N7:0', '--net', str(net),
                    '--port', port).good_lines == ['N7:0 1200']
        assert call(main, capsys, 'write', 'N7:0', '7', '--yes', *line).err == (
            'plc: --station: say which station to write to: this line may have several\n')
        write = 'write', 'N7:0', '7', '--yes', '--station', '1'
        assert call(main, capsys, *write, *line).status == 0
        watched = call(main, capsys, 'watch', 'N7:0', '--count', '2', '--period', '0.1', *line)
        assert (watched.status, watched.lines[-1].split()[1:]) == (0, ['N7:0', '7'])
        assert call(main, capsys, 'status', '2', *line).lines[0].startswith('station 2: SLC 5/03')
        # 5 is ours usually.
        found = call(main, capsys, 'scan', '1-2,5', '--timeout', '2000', *line)
        assert found.lines[-1] == '2 of 3 stations answer; the others were asked 2 times'
        process.say('silent 2')
        process.wait_for('station 2: silent')
        silent = call(main, capsys, 'status', '2', '--timeout', '500', *line)
        assert silent.status == 1
        assert 'Slave Station (2) Inactive' in silent.err and 'radio modem, CRC' in silent.err


def test_words_of_a_node_on_a_radio_modem(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = PtyEndpoint(str(tmp_path / 'line'))
    network = Network(mode='Radio', plc_type='SLC', station=9)
    words = make_mapping('N7:0', 'Serve', station=9, length=2, plc='SLC')
    driver = Driver(network, [words], DriverSettings(), Recorder(time.monotonic))
    thread = LinkThread(driver.machine, line.open)
    thread.start()
    options = '--radio', '--port', line.name
    try:
        write = call(main, capsys, 'write', 'N7:1', '5', '--yes', '--station', '9', *options)
        assert write.good_lines[-1] == 'N7:1 5'
        read = call(main, capsys, 'read', 'N7:0', '--length', '2', '--station', '9', *options)
        assert read.good_lines == ['N7:0 0 5']
        assert call(main, capsys, 'ping', '9', '--count', '1', *options).status == 0
    finally:
        thread.stop()
        line.close()


@pytest.mark.usefixtures('half_duplex_only')
def test_commands_work_over_a_tcp_connection(
        files: Files, capsys: pytest.CaptureFixture[str]) -> None:
    with running_simulator('--tcp', '127.0.0.1:0', '--data', str(files.simulator)) as process:
        url = process.wait_for('socket://').partition(' on ')[2].partition(',')[0]
        assert call(main, capsys, 'read', 'N7:0', '--port', url, *PATIENT).lines == ['N7:0 1200']
        said = call(main, capsys, 'detect', '--port', url, '--parity', 'Even', '--stations',
                    '1', *PATIENT)
    assert said.lines[1].endswith(f'--port {url} --baud 9600 --check CRC --parity Even')


def test_signal_ends_it(tmp_path: Path) -> None:
    line = Pty(tmp_path / 'line')
    with Process('plc', 'status', '1', '--port', str(line.name), '--timeout', '9000') as process:
        line.read(5)
        wait_until(lambda: process.catches(signal.SIGTERM))  # the bytes may be of another process
        process.send(signal.SIGTERM)
        assert process.result() == 130
    line.close()
    assert process.text == ''


@pytest.mark.parametrize('args, text', [
    (('read', 'N7:0'), 'name the port, such as --port /dev/ttyUSB0'),
    (('read', 'N7:0', '--port', 'x', '--peer', '--duplex', 'half'), 'not allowed with'),
    (('read', 'N7:0', '--port', 'x', '--baud', '1'), '--baud: Baud = "1" should be one of 1200'),
    (('read', 'N7:0', '--port', 'x'), '--port: Com_Port = "x" should be'),
    (('read', 'N7:0', '--net', '/nowhere/net.csv'), '/nowhere/net.csv: cannot be read'),
    (('scan', '0-300', '--port', 'x'), '"0-300" should be a station from 0 to 254'),
    (('status', '1,2', '--port', 'x'), '"1,2" should be one station'),
    (('ping', '1', '--count', '0', '--port', 'x'), '"0" should be a whole number from 1'),
    (('watch', 'N7:0', '--period', '500'), '"500" should be seconds from 0 to 60; 0.5 is 500 ms'),
    (('files', '--files', '300'), '"300" should be numbers of files from 0 to 254, as in 7,9-12'),
    (('--port', '/dev/x', 'read', 'N7:0'),
     'options come after the command, as in "plc read ... --port ..."'),
    (('raed', 'N7:0'), '"raed" is not a command; did you mean read?'),
    (('init', '/dev/x'), 'unrecognized arguments: /dev/x; did you mean --port /dev/x?'),
    (('read', 'N7:0', '--len', '5'), 'unrecognized arguments: --len 5; did you mean --length?'),
    (('write', 'N7:0', '5', '--force'), 'unrecognized arguments: --force\n'),
    ((), 'the following arguments are required: COMMAND')])
def test_option_that_is_wrong_is_told_with_status_2(
        args: tuple[str, ...], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    said = call(main, capsys, *args)
    assert said.status == 2
    assert text in said.err


@pytest.mark.parametrize('port', ['/nowhere/tty', '/dev/null'])
def test_port_that_cannot_be_opened_is_told_with_status_1(
        port: str, capsys: pytest.CaptureFixture[str]) -> None:
    for args in (['read', 'N7:0'], ['watch', 'N7:0'], ['detect']):
        said = call(main, capsys, *args, '--port', port)
        assert said.status == 1 and said.err.startswith(f'plc: {port}: ')


@pytest.mark.parametrize('command', [
    '', 'read', 'write', 'watch', 'status', 'ping', 'scan', 'detect', 'import', 'ports'])
def test_help_has_examples_and_exit_statuses(command: str,
                                             capsys: pytest.CaptureFixture[str]) -> None:
    said = call(main, capsys, *command.split(), '--help')
    assert said.status == 0
    assert 'exit status:' in said.out
    assert f'plc {command}' in said.out.partition('example')[2]
    assert 'watch and ping, once they have begun, end by it with 0 or 1' in said.out


def test_process_needs_no_ros() -> None:
    program = ('import sys; sys.modules["rclpy"] = None; '
               'from abdf1_ros.cli.plc.command import main; sys.exit(main())')
    said = subprocess.run([sys.executable, '-c', program, 'read', 'N7:0'], text=True,
                          capture_output=True, timeout=30, check=False)
    assert (said.returncode, said.stdout) == (2, '')
    assert said.stderr.startswith('plc: --port: name the port')
