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

"""Tables, colours and progress."""

import argparse
from collections.abc import Callable, Iterator
import errno
import io
import os
from pathlib import Path
import signal
import sys
from unittest.mock import Mock

from abdf1_ros.cli import terminal
from abdf1_ros.cli.plc.command import main as plc_main
from abdf1_ros.errors import PortLost
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.network import load_network
import pytest
from support.cases import for_all


class Screen(io.StringIO):

    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('TERM', 'xterm')
    monkeypatch.delenv('NO_COLOR', raising=False)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [100.0]
    monkeypatch.setattr(terminal.time, 'monotonic', lambda: now[0])
    return now


def test_colour_is_for_terminals_that_want_it(monkeypatch: pytest.MonkeyPatch) -> None:
    assert terminal.colour('bad', terminal.RED, Screen()) == '\x1b[31mbad\x1b[0m'
    assert terminal.colour('bad', terminal.RED, io.StringIO()) == 'bad'
    monkeypatch.setenv('NO_COLOR', '')
    assert terminal.colour('bad', terminal.RED, Screen()) == 'bad'
    assert terminal.is_terminal(Screen())
    monkeypatch.setenv('TERM', 'dumb')
    assert not terminal.is_terminal(Screen())


def test_question_without_a_terminal_is_only_told_and_text_has_its_colour(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr('sys.stdin', io.StringIO('y\n'))
    monkeypatch.setattr('sys.stderr', Screen())
    assert not terminal.is_wanted('set it')
    terminal.tell('tool', 'text')
    terminal.tell('tool', 'bad', terminal.RED)
    assert (capsys.readouterr().out, sys.stderr.getvalue()) == (
        'would set it\n', 'tool: text\n\x1b[31mtool: bad\x1b[0m\n')
    for text, wanted in (('y\n', True), (' YES\n', True), ('yet\n', False), ('', False)):
        monkeypatch.setattr('sys.stdin', Screen(text))
        assert terminal.is_wanted('set it') is wanted


def test_empty_file_may_be_replaced(tmp_path: Path) -> None:
    (tmp_path / 'new').touch()
    for path in (tmp_path / 'new', tmp_path):  # a folder is refused later
        assert terminal.may_replace(str(path), lambda place: False)
    assert not terminal.may_replace(__file__, lambda place: False)
    assert not terminal.may_replace(__file__, Mock(side_effect=PermissionError))


def test_file_with_the_name_of_a_port_is_a_file(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path('ttyS1.cap').touch()
    assert [*map(terminal.is_port, ('ttyS1.cap', 'ttyS1', 'ttyS2.cap', 'tcp://x'))] == [
        False, True, True, True]


def test_columns_of_a_table_are_aligned() -> None:
    assert terminal.table(('name', 'n'), [('a', '10'), ('long name', '5')], right=(1,)) == (
        'name        n\n'
        'a          10\n'
        'long name   5')


def test_progress_on_a_terminal_is_one_line(monkeypatch: pytest.MonkeyPatch,
                                            clock: list[float]) -> None:
    screen = Screen()
    monkeypatch.setattr('sys.stderr', screen)
    progress = terminal.Progress()
    progress.show('1 of 9')
    progress.clear()
    assert screen.getvalue() == ''  # what takes no time needs none
    clock[0] = 102.5
    progress.show('2 of 9')
    progress.show('3 of 9')
    progress.clear()
    progress.clear()
    assert screen.getvalue() == '\r\x1b[K2 of 9\r\x1b[K3 of 9\r\x1b[K'


def test_progress_elsewhere_comes_every_two_seconds(monkeypatch: pytest.MonkeyPatch,
                                                    clock: list[float]) -> None:
    file = io.StringIO()
    monkeypatch.setattr('sys.stderr', file)
    progress = terminal.Progress()
    for tenth in (*range(45), *range(85, 111)):
        clock[0] = 100 + tenth / 10
        progress.show(f'{tenth}')
    progress.clear()
    assert file.getvalue() == '20\n40\n85\n105\n'


@pytest.mark.parametrize('say', [
    lambda progress: progress.show('2 of 9'), lambda progress: terminal.tell('tool', 'text')])
def test_messages_without_room_or_reader_do_not_end_the_work(
        say: Callable[[terminal.Progress], None], monkeypatch: pytest.MonkeyPatch,
        clock: list[float]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    for place in ('/dev/full', writer):
        with open(place, 'w', encoding='utf-8') as stderr:  # its close would raise what is left
            monkeypatch.setattr('sys.stderr', stderr)
            progress = terminal.Progress()
            clock[0] += 2.5
            say(progress)


@pytest.mark.parametrize('place', [os.devnull, '/dev/full', 'file'])
def test_output_without_a_reader_is_never_left(
        place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with open(tmp_path / place, 'w') as stdout:
        monkeypatch.setattr('sys.stdout', stdout)
        terminal.check_reader()
    monkeypatch.setattr('sys.stdout', io.StringIO())
    terminal.check_reader()


def test_output_that_is_closed_takes_all(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('sys.stdout', None)
    monkeypatch.setattr('sys.stderr', None)
    terminal.prepare_output()
    for stream in (sys.stdout, sys.stderr):
        print('text', file=stream, flush=True)
        assert not terminal.is_terminal(stream)
        stream.close()


def test_plc_says_that_its_output_is_closed(
        monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr('sys.stdout', None)
    assert plc_main(['ports']) == 0
    assert capsys.readouterr().err == (
        'plc: standard output is closed, so nothing that it prints can be seen\n')


def test_output_that_knows_few_characters_shows_escapes(monkeypatch: pytest.MonkeyPatch) -> None:
    raw = io.BytesIO()
    monkeypatch.setattr('sys.stdout', io.TextIOWrapper(raw, encoding='ascii'))
    terminal.prepare_output()
    print('h\xe9llo', flush=True)
    assert raw.getvalue() == b'h\\xe9llo\n'


@pytest.fixture
def handlers() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def _interrupts(number: signal.Signals) -> bool:
    try:
        signal.raise_signal(number)
    except KeyboardInterrupt:
        return True
    return False


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.usefixtures('handlers')
def test_only_the_first_signal_interrupts(number: signal.Signals) -> None:
    with terminal.interruptible():
        assert _interrupts(number)
        assert not _interrupts(number)
        assert not _interrupts(signal.SIGINT)
    assert not _interrupts(number)


@pytest.mark.usefixtures('handlers')
def test_no_signal_interrupts_what_comes_after_the_block() -> None:
    with terminal.interruptible():
        pass
    assert not _interrupts(signal.SIGINT)
    assert not _interrupts(signal.SIGTERM)


@pytest.mark.usefixtures('handlers')
@pytest.mark.parametrize(('end', 'status', 'told'), [
    (None, 3, ''), (KeyboardInterrupt(), 130, ''),
    (ConfigurationError([Problem('a.csv', 'is wrong'), Problem('b.csv', 'too')]), 2,
     'tool: a.csv: is wrong\ntool: b.csv: too\n'),
    (terminal.NoPort('/tmp/x', OSError(2, 'No such file')), 1, 'tool: /tmp/x: No such file\n'),
    (PortLost('the cable is gone'), 1, 'tool: port lost: the cable is gone\n'),
    (BrokenPipeError(), 7, ''),
    (OSError(28, 'No space left on device'), 2, 'tool: cannot print: No space left on device\n'),
    (OSError(36, 'Name too long', 'a.csv'), 2, 'tool: a.csv: Name too long\n')])
def test_end_of_a_command_is_told_and_is_its_status(
        end: BaseException | None, status: int, told: str, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    def work() -> int:
        if end:
            raise end
        return 3

    dropped, flushed = [], []
    monkeypatch.setattr(terminal, 'drop_output', lambda: dropped.append(True))
    monkeypatch.setattr(sys.stdout, 'flush', lambda: flushed.append(True))
    assert terminal.run_command('tool', work, interrupted=130, unread=7) == status
    assert bool(flushed) is (end is None)  # or a full disk would not be told
    assert capsys.readouterr().err == told
    assert bool(dropped) is (type(end) in (OSError, BrokenPipeError))


@for_all(('option', 'good', 'bad', 'right'), [
    (terminal.seconds_option, ['0.5'], ['0', '-1', 'nan', 'inf', 'soon', '1_0', '\u0661'],
     'a number of seconds above 0'),
    (terminal.whole_option, ['9600'], ['', '96.5', '9_600', '\u0661', '9' * 5000],
     'a whole number'),
    (terminal.number_option('0 to 60', 0, 60), ['0', '60'], ['-0.1', '60.1'], '0 to 60')])
def test_number_of_an_option(option: Callable[[str], float], good: list[str], bad: list[str],
                             right: str) -> None:
    assert [option(text) for text in good] == [float(text) for text in good]
    for text in bad:
        with pytest.raises(argparse.ArgumentTypeError, match=f'should be {right}$'):
            option(text)


@pytest.mark.parametrize(('error', 'text'), [
    (OSError(2, 'No such file'), '/tmp/x: No such file'), (OSError('taken'), '/tmp/x: taken'),
    (OSError(2, 'could not open port /tmp/x: gone'), 'could not open port /tmp/x: gone')])
def test_reason_has_the_name_once(error: OSError, text: str) -> None:
    assert terminal.reason_of('/tmp/x', error) == text


@pytest.mark.parametrize(('number', 'text'), [
    (errno.EACCES, 'usermod -aG dialout'), (errno.ENOENT, 'plc ports')])
def test_port_that_cannot_be_opened_leads_to_the_cure(number: int, text: str) -> None:
    error = OSError(number, os.strerror(number))
    assert text in terminal.reason_of('/dev/ttyUSB0', error)
    assert text not in terminal.reason_of('net.csv', error)


@pytest.mark.parametrize(('name', 'is_told'), [
    ('/dev/ttyUSB0', True), ('/tmp/plc', True), ('socket://10.0.0.5:4001', False)])
def test_program_that_has_the_port_can_be_found(name: str, is_told: bool) -> None:
    told = terminal.reason_of(name, OSError(errno.EBUSY, 'another program has it open'))
    assert told == f'{name}: another program has it open' + (
        f'; "fuser -v {name}" shows the program; end it, or let a bridge release the port by '
        '~/polling with false') * is_told


@pytest.mark.parametrize(('name', 'advice'), [
    ('/dev/ttyUSB0:19200', '--baud 19200'), ('/dev/ttyS1,9600,n,8,1', '--baud 9600'),
    ('/dev/pts/12', 'plc ports')])
def test_speed_after_the_name_of_a_port_leads_to_its_option(name: str, advice: str) -> None:
    assert terminal.reason_of(name, FileNotFoundError(errno.ENOENT, 'No file')).count(advice) == 1


@pytest.mark.parametrize(('given', 'fault'), [
    (['a', '--station', '1', '2', 'b'], '2 b; --station takes one value'),
    (['a', '--set', '12:00'], '12:00; --set takes no value'),
    (['a', '--set', '--station', '1', 'x'], 'x; --station takes one value'),
    (['a', 'b'], 'b; it takes one FILE')])
def test_word_after_the_value_of_an_option_is_told_as_such(
        given: list[str], fault: str, capsys: pytest.CaptureFixture[str]) -> None:
    parser = terminal.command_parser('tool', None)
    parser.add_argument('file', metavar='FILE')
    parser.add_argument('--station')
    parser.add_argument('--set', action='store_true')
    with pytest.raises(SystemExit):
        parser.parse_args(given)
    assert f'unrecognized arguments: {fault}\n' in capsys.readouterr().err


@pytest.mark.parametrize(('given', 'fault'), [
    (['a', '--htm', 'b'], '--html; --htm is not an option; did you mean --html?'),
    (['a', '--5'], '--html; --5 is not an option'),
    (['a', '--htm=b'], '--html; --htm is not an option; did you mean --html?'),
    (['a'], '--html'), ([], 'FILE, --html'), (['a', '--', '--5'], '--html')])
def test_unknown_option_is_named_beside_what_is_missing(
        given: list[str], fault: str, capsys: pytest.CaptureFixture[str]) -> None:
    parser = terminal.command_parser('tool', None)
    parser.add_argument('file', metavar='FILE', nargs='+')
    parser.add_argument('--html', required=True)
    with pytest.raises(SystemExit):
        parser.parse_args(given)
    assert f'arguments are required: {fault}\n' in capsys.readouterr().err


@pytest.mark.parametrize(('given', 'meant'), [
    (['--sation', '1'], '--sation 1; did you mean --station?'),
    (['-s', '1'], '-s 1; did you mean --station?'),
    (['--baudrate=9600'], '--baudrate=9600; did you mean --baud?'),
    (['-p'], '-p; did you mean --port or --parity?'), (['--zzz'], '--zzz'),
    (['more'], 'more; it takes only options'), (['--porty'], '--porty; did you mean --port or '
                                                '--parity?'),
    (['/dev/x'], '/dev/x; did you mean --port /dev/x?'),
    (['ttyS0'], 'ttyS0; did you mean --port ttyS0?')])
def test_option_that_may_be_meant(
        given: list[str], meant: str, capsys: pytest.CaptureFixture[str]) -> None:
    parser = terminal.command_parser('tool', None)
    read = parser.add_subparsers().add_parser('read', allow_abbrev=False)
    for name in ('station', 'port', 'parity', 'baud'):
        read.add_argument(f'--{name}')
    with pytest.raises(SystemExit) as ending:
        parser.parse_args(['read', *given])
    assert ending.value.code == 2
    assert capsys.readouterr().err == (f'tool read: error: unrecognized arguments: {meant}\n'
                                       '"tool read --help" lists the arguments\n')


@pytest.mark.parametrize(('given', 'named'), [
    (['--count', '１'], '"１" is U+FF11 FULLWIDTH DIGIT ONE, not "1"'),
    (['--count', '−5'], '"−" is U+2212 MINUS SIGN, not "-"'),
    (['−−count', '5'], '"−" is U+2212 MINUS SIGN, not "-"'),
    (['--kind', '“SLC”'], '"“" is U+201C LEFT DOUBLE QUOTATION MARK, not """'),
    (['--kind', 'SLC\xa0'], '"\\xa0" is U+00A0 NO-BREAK SPACE, not " "'),
    (['--kind', 'Öl'], '(choose from SLC)')])
def test_character_that_was_pasted_is_named(
        given: list[str], named: str, capsys: pytest.CaptureFixture[str]) -> None:
    parser = terminal.command_parser('tool', None)
    read = parser.add_subparsers().add_parser('read', allow_abbrev=False)
    read.add_argument('--count', type=terminal.whole_option)
    read.add_argument('--kind', choices=['SLC'])
    with pytest.raises(SystemExit):
        parser.parse_args(['read', *given])
    assert capsys.readouterr().err.splitlines()[0].replace("'SLC')", 'SLC)').endswith(named)


def test_character_that_was_pasted_is_named_in_faults_and_names_of_files(
        capsys: pytest.CaptureFixture[str]) -> None:
    def fail() -> int:
        raise ConfigurationError([Problem('N7:0', '"−5" is not a valid int16'),
                                  Problem('a', 'character 1 is U+2212 MINUS SIGN: "−"')])

    assert terminal.run_command('plc', fail) == terminal.EXIT_USAGE
    assert capsys.readouterr().err.splitlines() == [
        'plc: N7:0: "−5" is not a valid int16; "−" is U+2212 MINUS SIGN, not "-"',
        'plc: a: character 1 is U+2212 MINUS SIGN: "−"']  # it is named already
    for name in ('“net.csv”', 'net.csv\xa0'):
        assert 'not ' in terminal.reason_of(name, OSError(errno.ENOENT, 'No such file'))
        with pytest.raises(ConfigurationError, match='U[+]'):
            load_network(name)


@pytest.mark.parametrize(('nargs', 'name', 'given', 'hint'), [
    ('?', 'STATIONS', ['1', '2', '3'], '2 3; it takes one STATIONS; a list has commas, as '
                                       'in 1,2,3'),
    ('?', 'STATION', ['1', '2'], '2; it takes one STATION'),
    ('?', 'STATION', ['--station', '1'], '--station; did you mean STATION without --station?'),
    ('?', 'STATIONS', ['1', '--station', '1'], '--station 1; did you mean STATIONS without '
                                               '--station?'),
    *((many, 'ADDRESS', ['a', '--net', 'n', 'b'], 'b; --net takes one value; each ADDRESS stands '
       'beside the others, before or after all options') for many in '+*')])
def test_words_that_are_too_many_are_told_where_they_belong(
        nargs: str, name: str, given: list[str], hint: str,
        capsys: pytest.CaptureFixture[str]) -> None:
    parser = terminal.command_parser('tool', None)
    parser.add_argument(name.lower(), metavar=name, nargs=nargs)
    parser.add_argument('--net')
    with pytest.raises(SystemExit):
        parser.parse_args(given)
    assert f'unrecognized arguments: {hint}\n' in capsys.readouterr().err


def test_number_with_an_exponent_and_a_sign_is_no_option() -> None:
    parser = terminal.command_parser('tool', None)
    parser.add_argument('values', nargs='+')
    assert parser.parse_args(['-1.5e3', '-2', '-.5', '-1E-3']).values == [
        '-1.5e3', '-2', '-.5', '-1E-3']
