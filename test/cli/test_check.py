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

"""The command ``check``: every error of both files, the plan, and the exit status."""

from collections.abc import Callable, Sequence
import json
from pathlib import Path
import re
import shlex
import subprocess
import sys
from unittest.mock import Mock

from abdf1_ros.cli.check import main
from abdf1_ros.paths import config_file
import pytest
from support.cases import for_all
from support.commands import Output
from support.ros import write_csv
from support.vectors import VECTOR_FOLDER

NET_HEADER = 'Station,Mode,Baud,Cmd_Timeout,Timeout,Com_Port'
MAP_HEADER = 'Tag,Command,Address,Station,PLC_Type,Length,Period'
GOOD_NET = '5,Master,9600,500,300,1'
GOOD_ROW = 'speed,Read,N7:0,1,PLC5,2,1000'
Paths = tuple[Path, Path]
BAD_ROWS = ('a,Read,N7,1,PLC5,,', 'b,Rad,N7:1,256,PLC5,,', 'c,Serve,N7:0,6,PLC5,,',
            'a,Read,N7:9999,1,PLC5,,')


@pytest.fixture
def files(tmp_path: Path) -> Paths:
    return tmp_path / 'net.csv', tmp_path / 'map.csv'


Check = Callable[..., str]


@pytest.fixture
def check(files: Paths, capsys: Output) -> Check:
    """Return what checks a net file of one row and a map, and returns the output."""
    def run(net: str, rows: Sequence[str], *options: str, status: int = 0) -> str:
        write_csv(files[0], NET_HEADER, [net])
        write_csv(files[1], MAP_HEADER, rows)
        assert main([*map(str, files), *options]) == status
        return capsys.readouterr().out

    return run


def test_names_of_bits_are_listed(files: Paths, capsys: Output) -> None:
    write_csv(files[0], NET_HEADER, [GOOD_NET])
    write_csv(files[1], f'{MAP_HEADER},Bits', [
        'cell,Read,B3:0/0,1,PLC5,3,,closed | | drive 3 fault', f'{GOOD_ROW},',
        'fault,Read,B3:0/2,1,PLC5,,,'])
    assert main([*map(str, files)]) == 0
    out = capsys.readouterr().out
    assert ('bit     address  station  of the row\nclosed  B3:0/0         1  cell\n'
            'fault   B3:0/2         1  cell\n\n') in out
    assert 'map.csv:2 (Bits): B3:0/2 has two names: "drive 3 fault", and "fault", the Tag' in out
    assert main(['--json', *map(str, files)]) == 0
    rows = json.loads(capsys.readouterr().out)['rows']
    assert [row.get('bits') for row in rows] == [
        {'B3:0/0': 'closed', 'B3:0/2': 'fault'}, None, None]


def test_good_files_show_their_plan_and_no_error(check: Check) -> None:
    out = check(GOOD_NET, (GOOD_ROW,))
    assert 'error' not in out.replace('no errors', '')
    assert 'Mode Master, 9600 baud' in out
    cells = out.splitlines()[7].split()
    assert '\n'.join(out.splitlines()[3:5]) == (
        'tag    address  station  topic         message          Length  value  stale ms\n'
        # Three Periods, and the 74.2 ms below.
        'speed  N7:0           1  ~/read/speed  Int16MultiArray       2  int16      3075')
    # 52 characters of 10 bits at 9600 baud, and two answers of 10 ms.
    assert cells == ['1', 'PLC5', 'N7:0', 'N7:1', '2', '4', '1', '54.2', '74.2', '1000.0', 'speed']
    assert 'expected poll cycle: 74.2 ms' in out
    assert 'load of the line: 7%' in out
    assert out.endswith('no errors, no warnings\n')


@pytest.mark.parametrize('prefix', ['', 'peer_', 'heartbeat_'])
def test_files_of_the_package_are_good_and_follow_our_own_advice(
        prefix: str, capsys: Output) -> None:
    names = [str(config_file(f'{prefix}{kind}.csv')) for kind in ('net', 'map')]
    assert main([*names, '--json']) == 0
    content = json.loads(capsys.readouterr().out)
    assert content['errors'] == content['warnings'] == []
    assert {block['station'] for block in content['blocks']} <= {1, 2}
    assert not [note for note in content['notes'] if 'without While' in note]
    assert main(names) == 0
    said = capsys.readouterr().out
    assert ('orderly end: {end_ms:.0f} ms where no frame gets lost, {end_in_silence_ms:.0f} ms '
            'where no PLC answers' if content['end_ms'] else '').format(**content) in said
    assert ('orderly end' in said) is bool(content['end_ms'])
    for bound in content['bounds']:  # presets, or both times
        assert ('presets {presets[0]} (watchdog, rung 3) and {presets[1]} '
                if bound['presets'] else
                'after {ms:.0f} ms at most, {usual_ms:.0f} ms where').format(**bound) in said


def test_every_error_of_both_files_at_once(check: Check, files: Paths) -> None:
    lines = check('5,Mastr,9601,100', BAD_ROWS, status=2).splitlines()
    net, rows = (str(path) for path in files)
    beginnings = [
        f'error: {net}:2:2 (Mode): 2553 CRT_BAD_DRIVER_MODE: ',
        f'error: {net}:2:4 (Cmd_Timeout): 2559 CRT_BAD_CMD_TIMEOUT: ',
        f'error: {net}:2:3 (Baud): Baud = "9601" should be one of 300, 600, 1200, ',
        f'error: {rows}:2:3 (Address): 2503 ERR_ADDRESS_SYNTAX: Item: 1, ',
        f'error: {rows}:3:2 (Command): Item: 2, Command = "Rad" should be one of Read, ',
        f'error: {rows}:3:4 (Station): 2501 ERR_BAD_STATION: Item: 2, ',
        f'error: {rows}:5:1 (Tag): Item: 4, tag "a" is already the tag of item 1 (line 2',
        f'error: {rows}:5:3 (Address): 2504 ERR_ADDRESS_RANGE: Item: 4, ']
    for beginning, line in zip(beginnings, lines[:8], strict=True):
        assert line.startswith(beginning)
    assert lines[8:] == ['no plan without a good net file']


def test_plan_of_the_good_rows(check: Check, files: Paths) -> None:
    out = check(GOOD_NET, (GOOD_ROW, *BAD_ROWS), status=2)
    assert f'error: {files[1]}:5: Item: 4, a Serve row has our own Station, which is 5' in out
    assert 'this plan has only the rows without errors' in out
    assert '1 mapping is read with 1 block' in out and 'no errors' not in out
    assert 'this plan' not in check(GOOD_NET, BAD_ROWS, status=2)


def test_files_in_the_wrong_order_are_told_once_each(
        check: Check, files: Paths, capsys: Output) -> None:
    check(GOOD_NET, (GOOD_ROW,))
    assert main([*map(str, reversed(files))]) == 2
    told = [line for line in capsys.readouterr().out.splitlines() if 'error: ' in line]
    assert ['is this the right file?' in line for line in told] == [True, True]


def test_notes_are_no_warnings(check: Check) -> None:
    bits = 'bits,Read,B3:0/0,1,PLC5,3,1000'
    note = 'bits without While: bits; their values go on when the program of the PLC stops'
    assert check(GOOD_NET, (bits,)).endswith(f'\nnote: {note}\nno errors, no warnings\n')
    content = json.loads(check(GOOD_NET, (bits,), '--json'))
    assert (content['notes'], content['warnings']) == ([note], [])


def test_warnings_come_first_and_long_tables_are_folded(
        check: Check, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = tuple(f't{number},Read,N7:{number},1,PLC5,,100' for number in range(90))
    lines = check(GOOD_NET, (*rows, 't90,Read,B3:0,1,PLC5,,20')).splitlines()
    assert lines[0].startswith('warning: ') and 'no errors, no warnings' not in lines
    folded = lines.index('... and 51 more; --json has them all')
    assert lines[folded - 1].startswith('t39 ') and len(lines) < 70
    assert 'more; ' not in check(GOOD_NET, rows[:40])
    assert '... and 1 more; ' in check(GOOD_NET, rows[:41])
    monkeypatch.setattr(sys.stdout, 'isatty', lambda: True)
    monkeypatch.setenv('COLUMNS', '40')
    assert max(len(line) for line in check(GOOD_NET, rows).splitlines() if line[0:1] == 't') == 40


def test_row_without_a_period_has_the_default_one(
        check: Check, files: Paths, capsys: Output) -> None:
    row = GOOD_ROW.removesuffix('1000')
    for options, period in (((), 100), (('--default-period', '2000'), 2000)):
        block, = json.loads(check(GOOD_NET, (row,), '--json', *options))['blocks']
        assert block['period_ms'] == period
    write_csv(files[1], MAP_HEADER + ',While,While_Timeout', [  # the counter is read as often
        'count,Read,N7:0,1,PLC5,,,,', 'door,Read,B3:0/0,1,PLC5,,,count,1000'])
    for paths in ([*map(str, files)], [str(files[0].parent)]):
        assert main([*paths, '--default-period', '2000']) == 2
        assert '6000 ms would be enough' in capsys.readouterr().out


def test_odd_settings_are_warnings_with_their_places(check: Check, files: Paths) -> None:
    row = 'N7:0,Write,I:1.0,017,SLC,1,'
    warnings = [line for line in check(GOOD_NET, (row,)).splitlines() if 'warning: ' in line]
    assert [warning.removeprefix('warning: ') for warning in warnings] == [
        f'{files[1]}:2:4 (Station): Station = "017" is 17, decimal; an octal 017 would be 15',
        f'{files[1]}:2:1 (Tag): Tag "N7:0" becomes the topic N7_0',
        f'{files[1]}:2:2 (Command): I:1.0 is an input: the PLC overwrites what is written there '
        'with its next scan']


def test_both_files_that_are_missing_are_named(tmp_path: Path, capsys: Output) -> None:
    assert main([str(tmp_path / 'a.csv'), str(tmp_path / 'b.csv')]) == 2
    out = capsys.readouterr().out
    assert 'a.csv: cannot be read' in out
    assert 'b.csv: cannot be read' in out


def test_what_stands_in_files_forges_no_line(check: Check) -> None:
    out = check(GOOD_NET, ('"a\x1b[2J\u2028error: x",Read,N7:0,1,PLC5,2,10',))
    assert '\x1b' not in out
    assert '\u2028' not in out


@for_all('option', ['--default-period', '--response-time'])
@for_all('text', ['x', '-1', 'nan', '1e12', '1_0', '\u0661'])
def test_time_that_is_no_number_of_ms_is_told(option: str, text: str, capsys: Output) -> None:
    with pytest.raises(SystemExit) as ending:
        main(['net.csv', 'map.csv', f'{option}={text}'])
    assert ending.value.code == 2
    assert f'"{text}" should be ms from 0 to 86400000' in capsys.readouterr().err


def test_output_that_cannot_take_it_is_no_traceback(
        files: Paths, monkeypatch: pytest.MonkeyPatch) -> None:
    write_csv(files[0], NET_HEADER, ['5,Master,9600,500'])
    write_csv(files[1], MAP_HEADER, [GOOD_ROW])
    command = shlex.join([sys.executable, '-m', 'abdf1_ros', 'check', *map(str, files)])
    closed = subprocess.run(f'{command} >&-', shell=True, text=True, capture_output=True,
                            timeout=30, check=False)
    assert (closed.returncode, closed.stderr) == (0, '')
    full = subprocess.run(f'{command} >/dev/full', shell=True, text=True, capture_output=True,
                          timeout=30, check=False)
    assert (full.returncode, full.stderr) == (2, 'check: cannot print: No space left on device\n')
    write_csv(files[1], MAP_HEADER, BAD_ROWS)
    left = subprocess.run(['bash', '-c', f'{command} | true; exit ${{PIPESTATUS[0]}}'], text=True,
                          capture_output=True, timeout=30, check=False)
    assert (left.returncode, left.stderr) == (2, '')  # the files are bad, also without a reader
    monkeypatch.setattr('builtins.print', Mock(side_effect=KeyboardInterrupt))
    assert main([*map(str, files)]) == 130


# A folder


def test_lines_stand_in_the_order_of_their_numbers(tmp_path: Path, capsys: Output) -> None:
    for port, name in enumerate(('line10_', 'line2.', 'line1-'), 1):
        write_csv(tmp_path / f'{name}net.csv', NET_HEADER, [f'{GOOD_NET[:-1]}{port}'])
        write_csv(tmp_path / f'{name}map.csv', MAP_HEADER, [GOOD_ROW])
    (tmp_path / 'line1_map.csv').write_text('one too many')
    (tmp_path / 'line2.map.csv').rename(tmp_path / 'line2_map.csv')
    main([str(tmp_path)])
    *lines, total = capsys.readouterr().out.splitlines()
    assert [line.partition(':')[0] for line in lines] == ['line1', 'line2', 'line10']
    assert total.endswith(' 0 with errors; not part of a line: line1_map.csv')


def test_ethernet_place_needs_a_station_where_the_map_has_several(
        tmp_path: Path, capsys: Output) -> None:
    rows = [f'{name},Read,N7:0,{name[1]},SLC,2,1000' for name in ('a1', 'b2')]
    write_csv(tmp_path / 'net.csv', f'{NET_HEADER},Share', [f'{GOOD_NET},eip:44818'])
    write_csv(tmp_path / 'map.csv', MAP_HEADER, rows)
    assert main([str(tmp_path)]) == 2
    assert (f'error: {tmp_path}/net.csv:2:7 (Share): Share: "eip:44818": which station answers '
            'there? the map has rows of 1, 2; write eip:44818?station=1'
            ) in capsys.readouterr().out
    write_csv(tmp_path / 'map.csv', MAP_HEADER, rows[:1])
    assert main([str(tmp_path)]) == 0


def test_two_lines_of_a_folder_on_one_port_are_an_error(tmp_path: Path, capsys: Output) -> None:
    for name, port in (('dryer', '1'), ('glue', '/dev/ttyUSB0'), ('oven', '/dev/ttyS0'),
                       ('paint', 'socket://localhost:4001,tcp:7'),
                       ('press', 'rfc2217://127.1:4001,tcp:7')):
        header = NET_HEADER + ',Share' * (',' in port)
        write_csv(tmp_path / f'{name}_net.csv', header, [f'{GOOD_NET[:-1]}{port}'])
        write_csv(tmp_path / f'{name}_map.csv', MAP_HEADER, [GOOD_ROW.replace('1000', '10')])
    write_csv(tmp_path / 'tap_net.csv', 'Mode,Com_Port,Listen_Port', ['Listen,7,/dev/ttyUSB0'])
    write_csv(tmp_path / 'tap_map.csv', MAP_HEADER, [GOOD_ROW])
    assert main([str(tmp_path)]) == 2
    times = 'poll cycle 74 ms, load 742%, 2 warnings'
    assert capsys.readouterr().out.splitlines() == [
        f'dryer: 1 row, port /dev/ttyS0, {times}',
        f'glue: 1 row, port /dev/ttyUSB0, {times}',
        f'oven: error: {tmp_path}/oven_net.csv: /dev/ttyS0 is the port of dryer too',
        f'oven: 1 row, port /dev/ttyS0, {times}',
        f'paint: 1 row, port socket://localhost:4001, {times[:-10]}3 warnings',
        f'press: error: {tmp_path}/press_net.csv: rfc2217://127.1:4001 is the port of paint too',
        f'press: error: {tmp_path}/press_net.csv: tcp:7 (Share) is used by paint too',
        f'press: 1 row, port rfc2217://127.1:4001, {times[:-10]}3 warnings',
        f'tap: error: {tmp_path}/tap_net.csv: /dev/ttyUSB0 is the port of glue too',
        'tap: 1 row, port /dev/ttyS6, nothing is sent',
        '6 lines: 3 good (3 of them with warnings), 3 with errors']


def test_folder_without_lines_is_refused(tmp_path: Path, capsys: Output) -> None:
    assert main([str(tmp_path)]) == 2
    assert 'no files NAME_net.csv and NAME_map.csv' in capsys.readouterr().out


def test_one_file_is_not_enough(files: Paths, capsys: Output) -> None:
    write_csv(files[0], NET_HEADER, [GOOD_NET])
    net = str(files[0])
    wanted = 'is not a folder: give both files of a line, as in "check net.csv map.csv"\n'
    for args, told in (([net], f'{net} {wanted}'), (['long' * 99], f'longlong {wanted}'),
                       ([net, '--heard', 'x.cap'], '--heard is for one line')):
        with pytest.raises(SystemExit):
            main(args)
        assert told in capsys.readouterr().err


def test_folder_of_this_place_has_its_own_name(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Output) -> None:
    write_csv(tmp_path / 'net.csv', 'Com_Port', ['/dev/ttyUSB0'])
    write_csv(tmp_path / 'map.csv', 'Tag,Command,Address,Station,PLC_Type', ['a,Read,N7:0,1,SLC'])
    monkeypatch.chdir(tmp_path)
    main(['.'])
    assert capsys.readouterr().out.startswith(f'{tmp_path.name}: 1 row, port /dev/ttyUSB0')


@pytest.mark.parametrize(('recorded', 'why'), [
    ('', 'nothing was recorded'), ('# abdf1_ros capture 1\n', 'nothing was recorded'),
    # Modbus ASCII; then a message of DF1 whose check is a BCC
    ('# abdf1_ros capture 1\n0.1 > 3A 30 31 30 33 30 30 46 43 0D 0A\n',
     'no message in 11 bytes: another Error_Code, baud rate or protocol'),
    ('# abdf1_ros capture 1\n0.1 > 10 02 01 05 0F 00 2A 00 A2 02 07 89 00 00 10 03 8D\n',
     'no message in 17 bytes: another Error_Code, baud rate or protocol'),
    # a write
    ('# abdf1_ros capture 1\n0.1 > 10 02 01 05 0F 00 2A 00 AA 02 07 89 00 00 63 00 10 03 84 EA\n',
     'no other node reads it')])
def test_recording_without_any_read_is_told_with_its_cause(
        tmp_path: Path, capsys: Output, recorded: str, why: str) -> None:
    net, rows, cap = (tmp_path / name for name in ('net.csv', 'map.csv', 'line.cap'))
    net.write_text('Mode,Com_Port\nListen,/dev/ttyS0\n', encoding='utf-8')
    rows.write_text('Tag,Command,Address,Station,PLC_Type,Period\na,Read,N7:0,1,SLC,500\n'
                    'b,Read,N7:1,1,SLC,500\n', encoding='utf-8')
    cap.write_text(recorded, encoding='utf-8')
    assert main([str(net), str(rows), '--heard', str(cap)]) == 0
    said = capsys.readouterr().out
    assert said.endswith(f'\nwarning: no row is filled: {why}\nthe recording fills 0 of 2 rows, '
                         'and has no read that was answered\n')
    assert 'no warnings' not in said
    assert main([str(net), str(rows)]) == 0
    assert 'no errors, no warnings' in capsys.readouterr().out


def test_rows_that_a_recording_fills_are_told(tmp_path: Path, capsys: Output) -> None:
    net, rows = tmp_path / 'net.csv', tmp_path / 'map.csv'
    net.write_text('Mode,Com_Port,Listen_Port\nListen,/dev/ttyS0,/dev/ttyS1\n', encoding='utf-8')
    rows.write_text(
        'Tag,Command,Address,Station,PLC_Type,Length,Period,While\n'
        'read,Read,N7:8,2,PLC5,2,500\nlonger,Read,N7:8,2,PLC5,3,500\n'
        'guarded,Read,N7:8,2,PLC5,2,500,Run\nunread,Read,N10:0,2,PLC5,1,500\n', encoding='utf-8')
    half, full = (VECTOR_FOLDER / 'captures' / f'libplctag_client_crc_plc5{duplex}.cap'
                  for duplex in ('_half_duplex', ''))
    said = full.read_text('ascii')
    at_once, dump = tmp_path / 'both_ends_at_once.cap', tmp_path / 'without_times.hex'
    at_once.write_text(re.sub(r'(\S+) < ((?:\S\S ){4})(.+)\n(\S+) (> .+)\n',
                              r'\1 < \2\n\4 \5\n\4 < \3\n', said), 'ascii')
    dump.write_text(re.sub(r'(?m)^\S+ [<>] ', '', said.partition('\n')[2]), 'ascii')
    at_zero, damaged = tmp_path / 'begins_at_zero.cap', tmp_path / 'damaged_later.cap'
    at_zero.write_text(re.sub(r'(?m)^\d+\.\d+', lambda found: f'{float(found[0]) - 57.855753:.6f}',
                              said), 'ascii')
    damaged.write_text('# abdf1_ros capture 1\n600.0 > 10 02 02 00 0F 10 03 00 00\n', 'ascii')
    for recordings in ((half,), (at_once,), (dump,), (full,), (at_zero,), (damaged, half),
                       (full, half)):
        heard = [word for path in recordings for word in ('--heard', str(path))]
        assert main([str(net), str(rows), *heard]) == 0
        said = capsys.readouterr().out
        assert '/dev/ttyS0 and /dev/ttyS1: Mode Listen, ' in said
        assert 'warning: unread is not filled: no other node reads it' in said
        assert 'warning: guarded is not filled: not in RUN: its mode is not' in said
        assert 'warning: longer is not filled: no reply has all of its words; "word range read' \
            in said
        assert 'warning: read is' not in said
        assert 'the recording fills 1 of 4 rows; it has:' in said
        assert re.search('station 2: word range read N7:7, 3 words: (5|10) times', said)
    assert main([str(net), str(rows), '--json', *heard]) == 0
    content = json.loads(capsys.readouterr().out)['heard']
    assert content['rows']['read'] == '' and content['reads'] == sorted(content['reads'])
    assert content['rows']['unread'] == 'no other node reads it'
    assert any('word range read N7:7, 3 words' in text for text in content['reads'])
    assert main([str(net), str(rows), '--heard', str(tmp_path / 'none.cap')]) == 2
    said = capsys.readouterr().out
    assert f'error: {tmp_path}/none.cap: No such file' in said and 'fills' not in said
    assert main([str(rows), str(rows), *heard]) == 2  # without a net file
    net.write_text('Com_Port,Error_Code\n/dev/ttyS0,BCC\n', encoding='utf-8')
    rows.write_text(rows.read_text('utf-8').replace('unread,Read,', 'unread,ReadWrite,'), 'utf-8')
    assert main([str(net), str(rows), *heard]) == 0
    assert 'the recording fills 0 of 3 rows' in capsys.readouterr().out
