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

"""A log of values: its forms, the file that is continued, gaps, other masters."""

from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
import csv
from datetime import datetime, timedelta, timezone
import io
from itertools import count
import json
import os
from pathlib import Path
import select
import signal
import subprocess
import sys
from unittest.mock import Mock

from abdf1_ros.cli.plc.command import main
from abdf1_ros.cli.plc.data import mapping_of
from abdf1_ros.cli.plc.log import ValueLog
from abdf1_ros.cli.plc.log_file import Cell, FORMS, LogFile, LogLost, LogOutput, LogRow
from abdf1_ros.cli.plc.reading import NewReads, WatchedRead
from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.packet import Packet
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.testing import Plcs
import pytest
from support.commands import call, Output, PATIENT, Plc, Said
from support.driver_bench import store
from support.ptys import no_file_longer_than, Pty, wait_until
from support.ros import Process, write_csv

HEAD = 'time,station,address,tag,value,reason'
WHEN = datetime(2026, 3, 1, 14, 5, 9, 250_000, timezone(timedelta(hours=1)))
SLC = {'Command': 'Read', 'Station': '1', 'PLC_Type': 'SLC'}

ROWS = [
    LogRow(WHEN, 1, 'N7:0', 'speed', Cell.INTEGER, '-12'),
    LogRow(WHEN, 1, 'F8:1', 'a "level", [%]=\\', Cell.FLOAT, '1.5e-07', 'answers again'),
    LogRow(WHEN, 2, 'ST9:0', '', Cell.TEXT, 'he said "so", \\n', ''),
    LogRow(WHEN, 2, 'F8:2', '', Cell.FLOAT, 'nan'),
    LogRow(WHEN, 2, 'N7:1', '', Cell.NONE, '', '2509 "x", y'),
    LogRow(WHEN, None, '', '', Cell.NONE, '', 'the log goes on'),
]


def test_rows_of_csv_are_read_by_the_reader_of_python() -> None:
    lines = [FORMS['csv'].head, *map(FORMS['csv'].line, ROWS)]
    found = [*csv.DictReader(io.StringIO('\n'.join(lines)))]
    assert [*found[0]] == HEAD.split(',')
    time = '2026-03-01T14:05:09.250+01:00'
    assert [tuple(row.values()) for row in found] == [
        (time, '' if row.station is None else str(row.station), row.address, row.tag, row.text,
         row.reason) for row in ROWS]
    assert lines[1] == f'{time},1,N7:0,"speed",-12,'


def test_rows_of_jsonl_are_read_by_the_reader_of_python() -> None:
    found = [json.loads(FORMS['jsonl'].line(row), parse_constant=pytest.fail) for row in ROWS]
    assert all([*row] == HEAD.split(',') for row in found)
    assert [row['value'] for row in found] == [-12, 1.5e-07, 'he said "so", \\n', None, None, None]
    assert isinstance(found[0]['value'], int)
    assert [row['reason'] for row in found] == [
        '', 'answers again', '', 'the value is nan', '2509 "x", y', 'the log goes on']
    assert (found[1]['station'], found[1]['tag']) == (1, 'a "level", [%]=\\')


def test_text_of_jsonl_is_that_of_the_plc_on_one_visible_line() -> None:
    text = 'a\nb\x9b\\n'
    line = FORMS['jsonl'].line(LogRow(WHEN, 2, 'ST9:0', '', Cell.TEXT, text))
    assert line.isprintable() and json.loads(line)['value'] == text


def test_rows_of_line_protocol_are_read_by_a_parser_of_another_project() -> None:
    parse_line = pytest.importorskip('line_protocol_parser').parse_line
    found = [parse_line(FORMS['influx'].line(row)) for row in ROWS]
    assert all((row['measurement'], row['time']) == ('plc', 1772370309250000000) for row in found)
    assert [row['fields'] for row in found] == [
        {'integer': -12}, {'float': 1.5e-07, 'reason': 'answers again'},
        {'text': 'he said "so", \\n'}, {'reason': 'the value is nan'},
        {'reason': '2509 "x", y'}, {'reason': 'the log goes on'}]
    assert type(found[0]['fields']['integer']) is int
    assert [row['tags'] for row in found] == [
        {'station': '1', 'address': 'N7:0', 'tag': 'speed'},
        {'station': '1', 'address': 'F8:1', 'tag': 'a "level", [%]=\\ '},  # blank: see its code
        *({'station': '2', 'address': address} for address in ('ST9:0', 'F8:2', 'N7:1')), {}]


def log_of(path: Path, form: str = 'csv') -> LogFile:
    return LogFile(str(path), FORMS[form])


def written(path: Path, form: str = 'csv') -> list[str]:
    """Write two rows as one run of "plc log"; return the lines of the file."""
    log = log_of(path, form)
    log.begin()
    log.write(ROWS[:1])
    log.write(ROWS[2:3])
    log.close()
    return path.read_text(encoding='utf-8').splitlines()


@pytest.mark.parametrize('form', FORMS)
def test_log_is_continued_after_a_row_that_says_so(tmp_path: Path, form: str) -> None:
    path = tmp_path / 'shift'
    begun = written(path, form)
    assert path.stat().st_mode & 0o007 == 0
    again = written(path, form)
    rows = begun[bool(FORMS[form].head):]
    assert again[:len(begun)] == begun and again[len(begun) + 1:] == rows
    assert 'the log goes on' in again[len(begun)]
    assert again.count(HEAD) == (form == 'csv')


@pytest.mark.parametrize('form', FORMS)
@pytest.mark.parametrize('rest', [b'2026-03-01T1', b'pl', b'{"ti', b'2026\0\0\0', b'\0', b'\xc3'])
def test_rest_of_a_row_is_removed_with_a_remark(tmp_path: Path, form: str, rest: bytes) -> None:
    path = tmp_path / 'shift'
    begun = written(path, form)
    path.write_bytes(path.read_bytes() + rest)
    log = log_of(path, form)
    log.close()
    assert path.read_text(encoding='utf-8').splitlines() == begun
    assert log.remark.startswith(f'{path}: removed the rest of a row that was not written')


@pytest.mark.parametrize('rest', [b'', b'time,sta', HEAD.encode(), b'\0\0\0'])
def test_file_without_a_row_is_begun_anew(tmp_path: Path, rest: bytes) -> None:
    path = tmp_path / 'shift'
    path.write_bytes(rest)
    assert written(path)[0] == HEAD and len(written(path)) == 6


@pytest.mark.parametrize(('form', 'content'), [
    ('csv', 'time,station,address,tag,value\n'), ('csv', 'Tag,Address'), ('csv', 'x' * 70_000),
    ('csv', '{"time": "x", "reason": ""}\n'), ('jsonl', HEAD), ('jsonl', '{"time": "x"}\n'),
    ('influx', f'{HEAD}\n'), ('influx', 'cpu,host=a load=1 1\n')])
def test_other_file_is_refused_and_stays(tmp_path: Path, form: str, content: str) -> None:
    path = tmp_path / 'other'
    path.write_text(content)
    with pytest.raises(ConfigurationError, match='is not a log of this form: it begins with') \
            as caught:
        log_of(path, form)
    assert str(path) in str(caught.value) and path.read_text() == content


@pytest.mark.parametrize('content', [
    f'{HEAD}\r\n29.11.2026 01:43,1,N7:0,,213,\r\n', f'{HEAD}\n11/29/2026 1:43,1,N7:0,,213,\n\n',
    f'{HEAD}\n43:59.5,1,N7:0,,213,\n', f'{HEAD}\n2026-03-01T14:05:09.250+01:00,1,N7:0\n',
    f'{HEAD}\n29.11.2026 01:43,1,N7:0,,213,\n2026-0'])
def test_log_that_a_spreadsheet_saved_again_is_refused_and_stays(
        tmp_path: Path, content: str) -> None:
    path = tmp_path / 'shift.csv'
    path.write_bytes(content.encode())
    with pytest.raises(ConfigurationError) as caught:
        log_of(path, 'csv')
    last = content.splitlines()[1]
    assert str(caught.value) == (
        f'--to: {path} was changed, perhaps saved again by a spreadsheet: its last row is '
        f'"{last}"; give another name')
    assert path.read_bytes() == content.encode()


def test_log_whose_line_ends_a_program_has_changed_goes_on(tmp_path: Path) -> None:
    path = tmp_path / 'shift.csv'
    begun = written(path)
    path.write_bytes(path.read_bytes().replace(b'\n', b'\r\n'))
    assert len(written(path)) == 2 * len(begun)


def test_second_writer_is_refused(tmp_path: Path) -> None:
    path = tmp_path / 'shift'
    first = log_of(path)
    with pytest.raises(ConfigurationError, match='is being written by another program'):
        log_of(path)
    first.close()
    assert not path.exists()  # nothing was written
    for bad in (tmp_path, tmp_path / 'no' / 'shift'):
        with pytest.raises(ConfigurationError, match=f'--to: {bad}'):
            log_of(bad)


def test_full_disk_leaves_whole_rows(tmp_path: Path) -> None:
    path = tmp_path / 'shift'
    log = log_of(path)
    log.begin()
    log.write(ROWS[:1])
    with no_file_longer_than(path.stat().st_size + 20), pytest.raises(LogLost) as caught:
        log.write(ROWS[:2])
    log.close()
    assert path.read_text().splitlines() == [HEAD, FORMS['csv'].line(ROWS[0])]
    assert str(caught.value) == f'{path}: File too large; the log ends here, after 1 rows of ' \
                                'this run'


def test_file_that_is_emptied_begins_again_with_its_head(tmp_path: Path) -> None:
    path = tmp_path / 'shift'
    log = log_of(path)
    log.begin()
    log.write(ROWS[:1])
    os.truncate(path, 0)
    log.write(ROWS[2:3])
    log.write(ROWS[:1])
    assert path.read_text().splitlines() == [HEAD, *map(FORMS['csv'].line, (ROWS[2], ROWS[0]))]
    path.unlink()
    with pytest.raises(LogLost, match=f'^{path} was removed; the log ends here, after 3 rows'):
        log.write(ROWS[:1])
    log.close()


SIMULATED = 'Station,PLC_Type,Address,Length,Values', [
    '1,SLC,N7:0,4,5', '1,SLC,ST9:0,1,Tank', '1,SLC,F8:0,2,1.5']


@pytest.fixture
def plcs(tmp_path: Path) -> Iterator[Plcs]:
    path = write_csv(tmp_path / 'simulator.csv', *SIMULATED)
    with Plcs(path) as line:
        yield line


def test_log_without_a_new_row_ends_with_its_reader(monkeypatch: pytest.MonkeyPatch) -> None:
    reader, writer = os.pipe()
    with open(writer, 'w') as output:
        monkeypatch.setattr(sys, 'stdout', output)
        log = LogOutput(FORMS['csv'])
        log.write([])
        os.close(reader)
        with pytest.raises(BrokenPipeError):
            log.write([])


class Kept(LogOutput):
    """Keep the rows."""

    def __init__(self) -> None:
        super().__init__(FORMS['csv'])
        self.rows: list[LogRow] = []

    def write(self, rows: list[LogRow]) -> None:  # type: ignore[override]
        self.rows += rows

    @property
    def told(self) -> list[tuple[str, str, str]]:
        """Return address, value and reason of each row."""
        return [(row.address, row.text, row.reason) for row in self.rows]


def network_on(plcs: Plcs, timeout: int = 1000) -> Network:
    return Network(com_port=plcs.port, baud=115200, timeout=timeout, nak_retries=0)


def test_each_read_is_a_row_for_each_value(plcs: Plcs) -> None:
    kept = Kept()
    words, name = mapping_of('N7:0-1', SLC), mapping_of('ST9:0', SLC)
    mixed = mapping_of('F8:0', SLC)
    tags = {'N7:0': 'speed', 'ST9:0': 'name'}
    assert ValueLog(network_on(plcs), [words, name, mixed], 0.01, kept, tags=tags).run(3) == 0
    assert {(row.station, row.address, row.tag, row.cell, row.text, row.reason)
            for row in kept.rows} == {
        (1, 'N7:0', 'speed', Cell.INTEGER, '5', ''), (1, 'N7:1', '', Cell.INTEGER, '0', ''),
        (1, 'ST9:0', 'name', Cell.TEXT, 'Tank', ''), (1, 'F8:0', '', Cell.FLOAT, '1.5', '')}
    times = [row.when for row in kept.rows if row.address == 'N7:0']
    assert len(times) >= 3 and times == sorted({*times})
    assert all(row.when.utcoffset() is not None for row in kept.rows)


class Acting(ValueLog):
    """A log that acts each time when all addresses have a row with a value, or all without."""

    def __init__(self, network: Network, mappings: Sequence[Mapping], kept: Kept,
                 *acts: Callable[[], object]) -> None:
        super().__init__(network, mappings, 0.01, kept)
        self._kept, self._seen, self._acts = kept, 0, [*acts]

    def show(self, news: Sequence[WatchedRead], lost: int) -> None:
        super().show(news, lost)
        latest = {row.address: row.cell for row in self._kept.rows[self._seen:]}
        is_gap = len(self._acts) % 2 == 0
        if len(latest) == 3 and all((cell is Cell.NONE) == is_gap for cell in latest.values()):
            self._seen = len(self._kept.rows)
            self._acts.pop(0)()


def stop() -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize(('first', 'reason'), [
    ('silent 1', '2509 ERR_INACTIVE_STATION: Slave Station (1) Inactive'), ('', 'port lost: '),
    ('error 1 10', 'STS 10')])
def test_each_gap_has_its_reason_once_and_its_end(
        tmp_path: Path, first: str, reason: str) -> None:
    path, kept = write_csv(tmp_path / 'simulator.csv', *SIMULATED), Kept()
    mappings = mapping_of('N7:0-1', SLC), mapping_of('ST9:0', SLC)
    with Plcs(path) as plcs, ExitStack() as later:
        Acting(network_on(plcs, 100), mappings, kept,
               lambda: plcs.say(first) if first else plcs.lose(),
               lambda: plcs.say('normal 1') if first else later.enter_context(Plcs(path)),
               stop).run(None)
    for address in ('N7:0', 'N7:1', 'ST9:0'):
        told = [(text, why) for place, text, why in kept.told if place == address]
        gap = [number for number, (text, _) in enumerate(told) if not text]
        assert gap == [*range(gap[0], gap[-1] + 1)] and told[gap[0]][1].startswith(reason), told
        assert len({why for text, why in told if not text}) == len(gap)
        assert [number for number, (_, why) in enumerate(told) if why == 'answers again'] == [
            gap[-1] + 1]


def test_reads_that_were_lost_and_a_pause_of_the_host_are_rows(
        plcs: Plcs, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.cli.plc.reading.MAX_NEWS', 2)
    kept, speed = Kept(), mapping_of('N7:0', SLC)
    log = ValueLog(network_on(plcs), [speed], 0.01, kept)
    news = NewReads()
    for value in range(5):
        news.add(speed, array('h', [value]))
    news.hand_over(log.show)
    assert kept.told == [('', '', '3 reads lost: this output was too slow'),
                         ('N7:0', '3', ''), ('N7:0', '4', '')]
    later = datetime.now().astimezone() + timedelta(hours=2)
    log.show([WatchedRead(later, speed, array('h', [6]))], 0)
    assert kept.told[3:] == [
        ('N7:0', '', 'not read for 7200 s: this computer or program stood still, or its clock '
                     'was set'), ('N7:0', '6', 'answers again')]


def test_control_characters_of_a_plc_stay_in_one_row(plcs: Plcs) -> None:
    store(plcs[1], 'ST9:0', 'a\n\x1b"')
    kept = Kept()
    ValueLog(network_on(plcs), [mapping_of('ST9:0', SLC)], 0.01, kept).run(1)
    assert FORMS['csv'].line(kept.rows[0]).partition(',')[2] == r'1,ST9:0,,"a\n\x1b""",'


def test_log_goes_to_a_file_and_to_the_output(plc: Plc, tmp_path: Path) -> None:
    path = tmp_path / 'shift.csv'
    for _ in range(2):
        assert plc('log', 'N7:0-1', '--count', '1', '--to', str(path)) == Said(0, '', '')
    lines = path.read_text().splitlines()
    assert lines[0] == HEAD and lines.count(HEAD) == 1
    assert [line.partition(',')[2] for line in lines if '1200' in line][0] == '1,N7:0,,1200,'
    assert sum('the log goes on' in line for line in lines) == 1
    for words in (('watch', '--csv'), ('log',)):
        said = plc(*words, 'N7:0', '--count', '1')
        assert (said.status, said.lines[0]) == (0, HEAD)
        assert said.lines[1].partition(',')[2] == '1,N7:0,,1200,'
    assert plc('watch', 'N7:0', '--csv', '--radix', 'hex') == Said(
        2, '', 'plc: --radix: is for a table; --csv has decimal numbers\n')
    assert plc('log', 'N7:0', '--count', '1', '--to', '-').lines[0] == HEAD
    row = json.loads(plc('log', 'N7:0', '--count', '1', '--format', 'jsonl').lines[0])
    assert (row['address'], row['value'], row['reason']) == ('N7:0', 1200, '')


def test_terminal_shows_the_progress_of_a_file(
        plc: Plc, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    progress = Mock()
    monkeypatch.setattr('abdf1_ros.cli.plc.log.is_terminal', lambda stream: True)
    monkeypatch.setattr('abdf1_ros.cli.plc.log.Progress', lambda: progress)
    path = tmp_path / 'shift.csv'
    plc('log', 'N7:0-1', 'N99:0', '--count', '1', '--to', str(path))
    assert progress.show.call_args.args[0].endswith(
        ' rows, 1 of 2 addresses without a value; Ctrl-C ends')
    progress.clear.assert_called_once_with()
    progress.show.reset_mock()
    assert plc('log', 'N7:0', '--count', '1').status == 0
    assert not progress.show.called  # beside the rows


def test_log_ends_with_one_line_and_status_1_when_the_disk_is_full(plc: Plc) -> None:
    assert plc('log', 'N7:0', '--to', '/dev/full') == Said(
        1, '', 'plc: /dev/full: No space left on device; the log ends here, after 0 rows of '
               'this run\n')


def test_log_refuses_what_it_cannot_do_before_it_asks_a_plc(tmp_path: Path, capsys: Output
                                                            ) -> None:
    path = write_csv(tmp_path / 'other.csv', 'a,b', [])
    port = ('--port', str(tmp_path / 'none'))
    for to, text in ((path, 'is not a log of this form'), (tmp_path, 'Is a directory')):
        said = call(main, capsys, 'log', 'N7:0', '--to', str(to), *port)
        assert said.status == 2 and text in said.err and said.err.count('\n') == 1
    assert call(main, capsys, 'log', 'N7:0', 'shift.csv', *port) == Said(
        2, '', 'plc: shift.csv: give the file as --to shift.csv\n')
    for name, form, text in (
            ('shift.XLSX', 'csv', 'is a name of a workbook, and "plc log" writes text: name it '
             'shift.csv'),
            ('shift.json', 'csv', 'is a name of another form: give --format jsonl'),
            ('shift.csv', 'influx', 'is a name of another form: give --format csv')):
        asked = '--to', name, '--format', form
        assert call(main, capsys, 'log', 'N7:0', *asked, *port) == Said(
            2, '', f'plc: --to: {name}: {text}\n')
    to = tmp_path / 'new.csv'
    said = call(main, capsys, 'log', 'N7:0', '--to', str(to), *port)
    assert said.status == 1 and not to.exists()


def test_output_that_the_shell_appends_has_one_head(line: str, tmp_path: Path) -> None:
    path = tmp_path / 'shift.csv'
    for _ in range(2):
        with path.open('a') as file:
            subprocess.run([sys.executable, '-m', 'abdf1_ros', 'plc', 'watch', 'N7:0', '--csv',
                            '--count', '1', '--port', line, *PATIENT], stdout=file, check=True)
    lines = path.read_text().splitlines()
    assert lines[0] == HEAD and lines.count(HEAD) == 1
    assert sum(',the log goes on' in line.replace('"', '') for line in lines) == 1


@pytest.mark.parametrize('form', ['csv', 'jsonl', 'influx'])
def test_output_is_in_utf_8_as_a_file_is(form: str) -> None:
    """Where the terminal is ASCII, too: an escape would be another text, and no JSON."""
    program = (
        'from datetime import datetime\n'
        'from abdf1_ros.cli.plc.log_file import Cell, FORMS, LogOutput, LogRow\n'
        'from abdf1_ros.cli.terminal import prepare_output\n'
        'prepare_output()\n'
        'now = datetime.now().astimezone()\n'
        f'LogOutput(FORMS[{form!r}]).write([LogRow(now, 1, "ST9:0", "T\u00fcr", Cell.TEXT, '
        '"\u00c4\u20ac")])\n')
    said = subprocess.run(
        [sys.executable, '-c', program], check=True, capture_output=True, timeout=60,
        env=os.environ | {'PYTHONIOENCODING': 'ascii', 'PYTHONUTF8': '1'}).stdout
    assert 'T\u00fcr'.encode() in said and '\u00c4\u20ac'.encode() in said


def exchange(tns: int, words: str = '34 12 FE FF') -> bytes:
    """Return what another master and station 2 say for one read of N7:0 and N7:1."""
    command = Packet(2, 5, 0x0F, 0, tns, bytes.fromhex('A2 04 07 89 00 00'))
    reply = command.reply(bytes.fromhex(words))
    return b''.join((
        frames.master_frame(2, command.encode(), Checksum.CRC), frames.ACK, frames.poll_frame(2),
        frames.message_frame(reply.encode(), Checksum.CRC), frames.ACK))


def text_of(path: Path) -> str:
    return path.read_text() if path.exists() else ''


NET = 'Mode,Error_Code,Com_Port,Baud'


def test_log_listens_beside_another_master_and_sends_nothing(tmp_path: Path) -> None:
    line = Pty(tmp_path / 'line')
    net = write_csv(tmp_path / 'net.csv', NET, [f'Listen,CRC,{line.name},115200'])
    rows = write_csv(tmp_path / 'map.csv', 'Tag,Command,Address,Station,PLC_Type,Length,Period', [
        'speed,Read,N7:0,2,SLC,2,100', 'other,Read,N7:50,2,SLC,,100'])
    path = tmp_path / 'shift.csv'
    with Process('plc', 'log', '--map', str(rows), '--net', str(net), '--to', str(path)) as log:
        def said(text: str) -> None:
            wait_until(lambda: text in text_of(path))
        numbers = count(1)
        wait_until(lambda: line.write(exchange(next(numbers))) or '4660' in text_of(path))
        said('N7:1,"speed[1]",-2,')
        said('N7:0,"speed[0]",,"not heard for ')
        line.write(exchange(200, '01 00 02 00'))
        said('N7:0,"speed[0]",1,"heard again"')
        said('N7:50,"other",,"no other node reads it"')
        log.send(signal.SIGINT)
        assert log.result() == 1  # a row has no value
    assert not select.select([line], [], [], 0)[0]
    line.close()


def test_log_needs_a_map_in_mode_listen_and_rows_that_can_be_heard(
        tmp_path: Path, capsys: Output) -> None:
    net = write_csv(tmp_path / 'net.csv', NET, [f'Listen,CRC,{tmp_path}/none,115200'])
    rows = write_csv(tmp_path / 'map.csv', 'Tag,Command,Address,Station,PLC_Type,Period', [
        'speed,Read,N7:0,2,SLC,', 'level,ReadWrite,N7:1,2,SLC,100'])
    asked = '--net', str(net), '--to', str(tmp_path / 'shift.csv')
    said = call(main, capsys, 'log', 'N7:0', *asked)
    assert said.status == 2 and said.err.startswith('plc: --map: in Mode Listen give a map')
    said = call(main, capsys, 'log', '--map', str(rows), *asked)
    assert said.status == 2
    assert 'Mode Listen needs a Period' in said.err and 'only Read rows are possible' in said.err
    write_csv(rows, 'Tag,Command,Address,Station,PLC_Type,Period', ['speed,Read,N7:0,2,SLC,100'])
    for words in (('read',), ('watch',), ('watch', '--csv')):
        said = call(main, capsys, *words, '--map', str(rows), '--net', str(net))
        assert said.status == 2 and 'in Mode Listen nothing may be sent' in said.err
