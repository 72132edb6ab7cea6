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

"""The command ``plc write`` on a simulated line."""

import os
from pathlib import Path
import pty
import signal
import subprocess
import sys
from unittest.mock import Mock

from abdf1_ros.cli.plc.command import main
from abdf1_ros.errors import FormatError, PortLost
import pytest
from support.cases import for_all
from support.commands import Output, PATIENT, Plc, Said
from support.ptys import PATIENCE, Pty, wait_until
from support.ros import Process, write_csv

MAP_TO_WRITE = ('Tag,Command,Address,Station,PLC_Type,Max,Fallback,Fallback_After,Scale', [
    'Level,ReadWrite,N7:55,2,SLC,10,,,0.5', 'speed,Read,N7:0,1,PLC5,,,,',
    'all,Write,N7:9,255,SLC,,,,', 'beat,Heartbeat,N7:56,2,SLC,,,,',
    'valve,Write,N7:57,2,SLC,,0,1000,', 'last,Write,N7:0,254,SLC,,,,'])


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
    (('level', '5'), '"level" is not a tag of this map; tags that can be written: Level, valve, '
                     'last; did you mean Level?'),
    (('speed', '5'), '"speed" is a Read row of station 1; tags'),
    (('beat', '5'), '"beat" is a Heartbeat row of station 2; tags'),
    (('all', '5'), '"all" is a Write row of station 255; tags'),
    (('N7:55', '5'), '"N7:55" is an address; with --map give a tag, so that the limits'),
    (('Level', '11'), 'Level: value 11 at index 0 is outside Min -inf, Max 10'),
    (('Level', '1', '2'), 'Level: 2 values, the mapping has 1'),
    (('Level', 'full'), 'Level: "full" is not a valid float32'),
    (('Level', '1', '--station', '1'), '--station: the map has Level at station 2'),
    (('Level', '1', '--type', 'int32'), '--type: is for addresses; for tags the map')])
def test_what_a_row_does_not_allow_is_told_before_the_port_is_opened(
        tmp_path: Path, capsys: Output, args: tuple[str, ...], text: str) -> None:
    path = write_csv(tmp_path / 'map.csv', *MAP_TO_WRITE)
    assert main(['write', *args, '--yes', '--map', str(path), '--port', '/nowhere/plc']) == 2
    assert text in capsys.readouterr().err


def test_write_with_an_equals_sign(plc: Plc) -> None:
    assert plc('write', 'N7:58=6', '--station', '2', '--yes').lines[-1] == 'N7:58 6'


def test_write_over_a_fallback_is_told(plc: Plc, tmp_path: Path) -> None:
    path = write_csv(tmp_path / 'map.csv', *MAP_TO_WRITE)
    said = plc('write', 'valve', '0', '--map', str(path), '--yes')
    assert said.status == 0 and said.err == (
        'plc: valve (N7:57) has a Fallback, which only the bridge writes: no Fallback '
        'follows this write\n')


def test_write_to_an_output_is_told(plc: Plc) -> None:
    for args in ((), ('--yes',)):
        said = plc('write', 'O:2.0/3', '0', '--station', '2', *args)
        assert said.err.splitlines()[0] == (
            'plc: O:2.0/3 is an output: this write may move a machine')


def test_write_to_an_input_is_told(plc: Plc) -> None:
    said = plc('write', 'I:1.0', '5', '--station', '2')
    assert said.err.splitlines()[0] == (
        'plc: I:1.0 is an input: the PLC overwrites what is written there with its next scan')
    assert plc('write', 'B3:1', '5', '--station', '2').err == (
        'plc: B3:1 is a word: this writes its 16 bits; a bit is B3:1/0\n'
        'plc: nothing was written; --yes writes\n')


@pytest.mark.parametrize('address, values, options, lines', [
    ('N7:10', ('5', '-6', '0x10'), (), ['N7:10 5 -6 16']),
    ('F8:6', ('-1.5', '2'), (), ['F8:6 -1.5 2']), ('ST9:0', ('Tank 5',), (), ["ST9:0 'Tank 5'"]),
    ('B3:2/3', ('1', '0', '1'), (), ['B3:2/3 /3=1 /4=0 /5=1']),
    ('N7:50', ('70000',), ('--type', 'int32'), ['N7:50 70000']),
    ('N7:52', ('abcde',), ('--type', 'string'), ["N7:52 'abcde'"]),
    ('C5:2.PRE', ('9',), (), ['C5:2.PRE 9'])])
def test_write_is_read_back_and_shown(plc: Plc, address: str, values: tuple[str, ...],
                                      options: tuple[str, ...], lines: list[str]) -> None:
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


def test_write_of_what_cannot_be_read(plc: Plc, monkeypatch: pytest.MonkeyPatch) -> None:
    fault = FormatError('too short')
    monkeypatch.setattr('abdf1_ros.cli.plc.data.read', Mock(side_effect=[
        fault, fault, KeyboardInterrupt, (5,), (5,)]))
    monkeypatch.setattr('abdf1_ros.cli.plc.presence.type_hint', Mock(side_effect=[
        KeyboardInterrupt, PortLost('gone')]))
    write, written = ('write', 'N7:22', '5', '--station', '2'), 'N7:22 of station 2: written; now:'
    for words, status, line, err in (
            ((), 2, 'would write [5] to N7:22 of station 2', 'plc: N7:22 of station 2: too short\n'
             'plc: nothing was written; --yes writes\n'),
            (('--yes',), 0, written, 'plc: cannot be read back: too short\n'),
            (('--yes',), 0, written, ''),
            *[(('--yes', '--plc-type', 'SLC'), 0, 'N7:22 5', '')] * 2):
        said = plc(*write, *words)
        assert (said.status, said.lines[-1], said.err) == (status, line, err)


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


def test_write_that_does_not_fit_the_family_of_the_plc(plc: Plc) -> None:
    said = plc('write', 'N7:9999', '5', '--yes', '--station', '2')
    assert (said.status, said.err) == (
        2, 'plc: ADDRESS "N7:9999": elements of N run from 0 to 255\n')


@for_all(('args', 'text'), [
    (('read', 'N7:0', '--length', 'x'), '--length: "x" should be a whole number from 1 to 65535'),
    (('watch', 'N7:0', '--length', '0'), '--length: "0" should be a whole number from 1 to 65535'),
    (('read', 'N7:0', 'ST9:0', '--length', '3'),
     '--length of ST9:0: a string mapping has Length 1: give each string its own address'),
    (('watch', 'line_speed'), 'ADDRESS "line_speed": write type, file, ":", element, as in N7:0, '
                              'B3:1/5, T4:0.ACC or I:1.0/3\nplc: --map: if line_speed is a tag, '
                              'give its map with --map FILE'),
    (('read', 'N7:0', '/dev/ttyUSB0'),
     'ADDRESS "/dev/ttyUSB0": write type, file, ":", element, as in N7:0, B3:1/5, T4:0.ACC or '
     'I:1.0/3; a port is given with --port /dev/ttyUSB0'),
    (('read', 'N7:0', 'COM1', '--plc-type', 'PLC5'),
     'ADDRESS "COM1": PLC-5 has no COM files; file types: O, I, S, B, T, C, R, N, F, ST, A, D, '
     'PD, MG, BT, SC; a port is given with --port, as in --port /dev/ttyUSB0'),
    (('write', 'N7:0', '=', '5'), 'N7:0: "=" is not a valid int16, a whole number from -32768 to '
     '32767; the values follow the address without it'),
    (('write', 'N7:0', '1000', 'N7:1=2'),
     'N7:0: "N7:1=2" is not a valid int16, a whole number from -32768 to 32767; a write has one '
     'address, and the values of the places after it follow'),
    (('write', 'cmd', '5', '--plc-type', 'SLC'),
     'ADDRESS "cmd": SLC has no CMD files; file types: O, I, S, B, T, C, R, N, F, ST, A, D, L, '
     'PD, MG, HSC, PTO, PWM, STI, EII\n'
     'plc: --map: if cmd is a tag, give its map with --map FILE'),
    (('write', 'B3:0/1=on'), 'B3:0/1: "on" is not a valid bool, 0 or 1'),
    (('read', 'N7:0', 'B3:O'), 'ADDRESS "B3:O": that is the letter O where a digit should be; '
                               'write B3:0'),
    (('write', 'N7:0', '99999'), 'N7:0: "99999" is not a valid int16, a whole number from -32768 '
                                 'to 32767'),
    (('write', 'F8:0', '1,000'), 'F8:0: "1,000" could be two numbers; write 1000 or 1.000'),
    (('write', 'ST9:0', 'Tank', '5', '--plc-type', 'SLC'),
     'ST9:0: takes one text; quote it if it has spaces'),
    (('write', 'T4:0', '5', '--plc-type', 'SLC'), 'ADDRESS "T4:0": T4:0 belongs to the processor; '
     'of such an element can be written: PRE, ACC, EN, TT, DN'),
    (('write', 'N7:250', *'0123456', '--plc-type', 'SLC'),
     'VALUE: 7 elements do not fit at N7:250; the last word there can be is N7:255')])
def test_what_no_plc_could_take_is_told_before_the_port_is_opened(
        capsys: Output, args: tuple[str, ...], text: str) -> None:
    assert main([*args, '--port', '/nowhere/plc', '--station', '1']) == 2
    assert capsys.readouterr().err == f'plc: {text}\n'


@pytest.mark.parametrize(('fault', 'what', 'status', 'text'), [
    ('error 2 F0 0B', 'N7:0 1', 1, 'not written: the PLC refused it: STS F0 EXT STS 0B'),
    ('normal 2', 'B3:3/15 1 1', 3, 'only partly written: '),  # its file has words 0 to 3
    ('slow 2 100000', 'N7:0 1', 3, 'unknown whether written: 2508 ERR_COMMAND_TIMEOUT')])
def test_write_that_fails_says_what_came_of_it(
        plc: Plc, simulator: Process, fault: str, what: str, status: int, text: str) -> None:
    simulator.say(fault)
    said = plc('write', *what.split(), '--yes', '--station', '2', '--plc-type', 'SLC')
    assert said.status == status
    assert text in said.err


@pytest.mark.parametrize('write', ['write N7:0 1 --station 1', 'clock 1 --set'])
def test_write_broken_off_is_unknown(tmp_path: Path, write: str) -> None:
    line = Pty(tmp_path / 'line')
    with Process('plc', *write.split(), '--yes', '--plc-type', 'SLC', '--port', str(line.name),
                 '--timeout', '9000') as process:
        line.read(10)  # the command is on its way
        wait_until(lambda: process.catches(signal.SIGTERM))
        process.send(*[signal.SIGINT] * 3)
        assert process.result() == 3
    line.close()
    assert 'unknown whether written: port lost: ' in process.text
    assert 'Traceback' not in process.text


def test_write_names_its_station_where_there_may_be_several(plc: Plc) -> None:
    for mode in ((), ('--radio',), ('--slave',)):
        assert plc('write', 'N7:21', '5', '--yes', *mode) == Said(2, '', (
            'plc: --station: give the station to write to: this line may have several stations\n'))
    assert plc('write', 'N7:21', '5', '--yes', '--station', '2').lines == [
        'N7:21 of station 2: written; now:', 'N7:21 5']
