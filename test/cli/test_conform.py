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

"""The command ``conform``, against a simulated PLC on a pseudo-terminal."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from itertools import cycle
import json
from pathlib import Path
import re
import threading
import time
from unittest.mock import Mock

from abdf1_ros.cli.conform import main
from abdf1_ros.client import Client
from abdf1_ros.conform.case import Case, CaseResult, Permission, Verdict
from abdf1_ros.conform.ends import AskingEnd, RadioEnd, RadioServerEnd, Words
from abdf1_ros.conform.wire import Wire
from abdf1_ros.df1.frames import Damaged
from abdf1_ros.errors import Abdf1Error
from abdf1_ros.pccc.families import decode_identity
import pytest
from support.cases import for_all
from support.commands import Output, running_simulator
from support.driver_bench import simulated_plc
from support.odd_device import Answer, frame, OddDevice, Wiring
from support.plc_line import odd_line, plc_line
from support.ptys import Pty

OF_WORDS = ('read-words', 'element-too-high', 'write-and-read', 'word-order', 'masked-write',
            'bad-check-not-executed')
QUICK = ('--only', 'poll-idle', '--only', 'message-acknowledged', '--only', 'nak-resets')


@pytest.fixture
def port(tmp_path: Path) -> Iterator[str]:
    """Return a pseudo-terminal with a simulated SLC 1 at its other end."""
    with plc_line(tmp_path / 'plc', simulated_plc(1, 'SLC', time.monotonic, ('N7:0', 4))) as name:
        yield name


def test_run_in_which_nothing_was_tried_has_not_passed(port: str, capsys: Output) -> None:
    options = ('--only', 'nak-resets', '--only', 'write-and-read', '--words', 'N7:0')
    assert main(['slave', '--port', port, *options]) == 1  # without --yes
    assert 'conform: no rule was tried: each case has its reason' in capsys.readouterr().err


@pytest.mark.parametrize(('options', 'sent', 'got'), [
    ('--station 5 --answer-time 0.05 --only message-acknowledged', '10 01 05 10 02 05 0A 06 00',
     'silence'),  # below, the family that the user names goes before that of the target
    ('--family PLC5 --words N7:255 --only read-words',  # a DLE in the TNS comes twice
     '10 01 01 10 02 01 05 0F 00 (10 10|..) (10 10|..) 68 00 00 01 00 06 07 FF FF 00 01 00',
     'STS F0 07')])
def test_failure_is_the_exit_status_and_shows_the_bytes(
        port: str, options: str, sent: str, got: str, capsys: Output) -> None:
    assert main(['slave', '--port', port, *options.split(), '--json']) == 1
    run = json.loads(capsys.readouterr().out)
    case, = run['cases']
    assert (run['target'], case['verdict'], case['got']) == ('slave', 'FAIL', got)
    assert re.match('we   ' + sent, case['transcript'][0].split(' ms ')[1])


def test_report_is_markdown(port: str, capsys: Output) -> None:
    with open(port, 'wb', buffering=0) as line:  # its reply lies there
        line.write(frame(b'\1\0\6\0\7\7\3', 1))
    assert main(['slave', '--port', port, '--report', *QUICK]) == 0
    text = capsys.readouterr().out
    assert text.startswith(
        '### Conformance run\n\n- target: slave\n- processor: SLC 5/03 series A revision 1, REM '
        'RUN\n- station: 1\n- check: CRC\n- port: serial\n- baud: 9600\n- parity: None\n'
        '- answer time: 1 s\n- abdf1_ros: ')
    row = text.splitlines()[-1]
    assert row.startswith('| SLC 5/0') and row.count('|') == 8
    assert '| serial | CRC, 9600 | conform slave: 2 passed, 0 failed, 1 skipped |' in row
    assert port not in text
    assert '| PASS | poll-idle | KF2 4-31 |  |' in text


def test_failures_skips_noise_and_early_enquiries_are_told(
        port: str, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    def results(cases: Sequence[Case], wire: Wire, end: AskingEnd,
                allowed: frozenset[Permission]) -> Iterator[CaseResult]:
        assert (allowed, wire.answer_time, end.words) == (permissions, 1.5, words)
        wire.noise, wire.enquired_after, wire.reader.has_heard = 3, 1.78, True
        yield CaseResult(cases[0], Verdict.FAIL, 0.1, 'ACK', 'NAK', ('we   10 05',))
        yield CaseResult(cases[0], Verdict.SKIP, got='needs a word')

    monkeypatch.setattr('abdf1_ros.cli.conform.run_cases', results)
    unknown = Mock(return_value=decode_identity(b'\2\x14' + bytes(8)))
    monkeypatch.setattr('abdf1_ros.cli.conform.decode_identity', unknown)
    permissions, words = {*Permission}, Words(999, 9, 41)
    for options, missing, *told in (
            (['--yes', '--words', 'n999:9', '--count', '41'], set(), 'we   10 05\n',
             ' skipped: needs a word\n'),
            (['--yes', '--report'], {Permission.WRITE}, ' | expected ACK, got NAK |'),
            (['--report'], {Permission.RESET}, ' | needs a word |', ': PLC-2 at 1771-KG series')):
        permissions -= missing
        assert main(['slave', '--port', port, '--answer-time', '1.5', *options]) == 1
        said = capsys.readouterr()
        assert all(text in said.out for text in told)
        assert 'conform: 3 bytes outside of any symbol were' in said.err
        assert '--answer-time 1.5 that may look like a fault: try --answer-time 0.8\n' in said.err
        words = Words(7, 0, 1)


def test_damaged_character_is_not_an_answer(
        capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    said = cycle([b'\x10', Damaged(b'\x04')])
    port = Mock(read=lambda *wait: next(said))
    monkeypatch.setattr('abdf1_ros.cli.conform.open_port', lambda settings: port)
    options = ['slave', '--port=socket://joe:4001', '--only=poll-idle', '--answer-time=0.01']
    assert main([*options, '--report']) == 1
    out = capsys.readouterr().out
    assert '| FAIL | poll-idle |' in out and '- port: socket\n' in out and port.close.called


def test_echo_that_comes_byte_by_byte_is_not_an_answer(
        capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    sent = bytearray()
    monkeypatch.setattr('abdf1_ros.cli.conform.open_port', lambda settings: Mock(
        write=sent.extend, read=lambda *wait: bytes([sent.pop(0)]) if sent else b''))
    assert main(['slave', '--port=/x', '--only=poll-idle', '--answer-time=0.01', '--echo']) == 1
    assert 'no byte was received' in capsys.readouterr().err


def test_cases_end_early_if_nobody_answers_any_of_them(tmp_path: Path, capsys: Output) -> None:
    dead = Pty(tmp_path / 'dead')
    assert main(['slave', '--port', str(dead.name), '--answer-time', '0.02']) == 1
    said = capsys.readouterr()
    assert said.out.count('FAIL ') == 5 and '0 passed, 5 failed' in said.out
    assert 'no byte was received' in said.err


def test_nobody_there_is_said(tmp_path: Path, capsys: Output) -> None:
    dead = Pty(tmp_path / 'dead')
    assert main(['slave', '--port', str(dead.name), '--answer-time', '0.05', '--only',
                 'poll-idle', '--report']) == 1
    said = capsys.readouterr()
    assert said.err == (
        'conform: no byte was received: check cable, port, speed, power and --station\n')
    assert '\n- processor: not known\n' in said.out
    dead.close()


def test_run_begins_when_a_program_has_opened_the_pseudo_terminal(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def wait(_: float) -> None:
        raise KeyboardInterrupt
    monkeypatch.setattr('abdf1_ros.cli.conform.time.sleep', wait)
    assert main(['slave', '--pty', str(tmp_path / 'line'), '--only', 'poll-idle']) == 130


def test_slave_behind_an_adapter_that_echoes(tmp_path: Path, capsys: Output) -> None:
    port = str(tmp_path / 'line')
    with running_simulator('--pty', port, '--echo'):
        options = ['slave', '--port', port, *QUICK]
        # The ACK of a case and the command of the next one are heard as one echo.
        assert main([*options, '--echo', '--only', 'echo-sizes']) == 0
        assert '3 passed, 0 failed, 1 skipped' in capsys.readouterr().out
        assert main(options) == 1
        assert 'FAIL  poll-idle' in capsys.readouterr().out
    with running_simulator('--pty', port):
        assert main([*options, '--echo', '--report']) == 1
    said = capsys.readouterr()
    assert 'leave out --echo' in said.err and '### Conformance run' in said.out


def test_simulator_is_a_node_of_a_radio_network_and_not_a_peer(
        tmp_path: Path, capsys: Output) -> None:
    port = str(tmp_path / 'plc')
    options = ('--port', port, '--only')
    with running_simulator('--pty', port, '--radio') as simulator:
        assert main(['radio', *options, 'read-words']) == 0
        assert '1 passed, 0 failed, 0 skipped' in capsys.readouterr().out
        assert main(['peer', *options, 'message-acknowledged', '--answer-time', '0.1']) == 1
        assert 'FAIL  message-acknowledged' in capsys.readouterr().out
        simulator.type('silent 1\n')
        simulator.wait_for('simulator: station 1: silent')
        assert main(['radio', *options, 'read-words', '--answer-time', '0.1']) == 1
        assert 'no byte was received' in capsys.readouterr().err


@pytest.mark.parametrize(('target', 'duplex', 'case'), [
    ('master', 'half', 'poll-form'), ('client', 'full', 'reply-acknowledged')])
def test_program_that_reads_is_answered_as_a_plc_answers(
        tmp_path: Path, target: str, duplex: str, case: str, capsys: Output,
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.cli.conform.Wire', made := Mock(side_effect=Wire))
    link, over, read = str(tmp_path / 'line'), threading.Event(), list[object]()

    def ask() -> None:
        while not over.wait(0.02):
            with suppress(Abdf1Error, OSError), Client(link, plc_type='SLC', station=2,
                                                       duplex=duplex) as plc:
                while not over.is_set():
                    read.append(plc.read('N7:0'))

    asking = threading.Thread(target=ask)
    asking.start()
    try:
        assert main([target, '--pty', link, '--station', '2', '--report', '--only', case]) == 0
    finally:
        over.set()
        asking.join()
    said = capsys.readouterr()
    assert '- result: 1 passed, 0 failed, 0 skipped\n' in said.out and link in said.err
    assert '- port: pty\n' in said.out and made.call_args.kwargs['char_time'] == 0
    assert read and not Path(link).is_symlink()  # it would lead to another program's terminal


@for_all(('target', 'kind'), [('radio', RadioEnd), ('radio-client', RadioServerEnd)])
def test_end_of_a_radio_network_has_the_number_of_the_user(
        target: str, kind: type, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, part in (('open_port', lambda settings: Mock(read=lambda *wait: b'')),
                       ('Wire', made := Mock(side_effect=Wire)),
                       ('run_cases', run := Mock(return_value=[]))):
        monkeypatch.setattr(f'abdf1_ros.cli.conform.{name}', part)
    assert main([target, '--port=/x', '--station=2', '--answer-time=0.01']) == 1
    end = run.call_args.args[2]
    assert (type(end), end.station, made.call_args.kwargs['is_radio']) == (kind, 2, True)


@pytest.mark.parametrize(('args', 'status', 'text'), [
    (['slave', '--port', '/nowhere/at/all'], 1, '/nowhere/at/all: No such file'),
    (['peer', '--port', '/no/where', '--own-station', '1'], 1, '/no/where: No such file'),
    (['slave'], 2, '--port'), (['master', '--pty', '/proc/stat'], 1, '/proc/stat'),
    (['master', '--tcp', '127.0.0.1:0', '--data', '/none'], 2, '/none: cannot be read'),
    (['radio', '--port', '/', '--own-station', '1'], 2, '1 is our own Station'),
    (['client', '--tcp', '[::1]:0', '--station', '9'], 2, 'the example data has stations')])
def test_port_that_cannot_be_opened_is_one_and_what_is_wrong_in_options_two(
        args: list[str], status: int, text: str, capsys: Output) -> None:
    assert main(args) == status
    assert text in capsys.readouterr().err


@for_all('args', [
    ['slave', '--only', 'nothing'], ['slave', '--only', 'nak-limit'],  # which is one of a peer
    ['slave', '--station', '255'], ['slave', '--count', '0'], ['slave', '--count', '42'],
    ['slave', '--answer-time', '30.1'], ['slave', '--timeout', '300'],
    ['slave', '--tcp', 'nowhere'], ['slave', '--tcp', 'a:99999'], ['slave', '--pty=x', '--port=y'],
    ['slave', '--tcp=a:1', '--port=/x'],
    ['peer', '--words', 'F8:0'], ['peer', '--echo'], ['slave', '--duplex', 'half'], []])
def test_usage_is_shown_for_impossible_options(args: list[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(args)
    assert end.value.code == 2


@for_all('args', [('--station', '0'), ('--station', '254'), ('--count', '41')])
def test_cases_are_listed_and_numbers_up_to_their_bounds_are_taken(
        args: tuple[str, str], capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    assert main(['client', '--list', *args]) == 0
    assert 'silence-enquired' in capsys.readouterr().out
    with monkeypatch.context() as reader_left:
        reader_left.setattr('abdf1_ros.cli.terminal.drop_output', Mock())
        reader_left.setattr('builtins.print', Mock(side_effect=BrokenPipeError))
        assert main(['client', '--list', *args]) == 1


def test_device_without_the_typed_commands_of_its_family_has_one_sentence_and_no_failure(
        tmp_path: Path, capsys: Output) -> None:
    device = OddDevice(Wiring.FULL)
    device.takes = lambda data: Answer.ACK if data[2] & 0x4F == 6 else Answer.REFUSES
    with odd_line(tmp_path / 'line', device) as name:
        status = main([
            'peer', '--port', name, '--family', 'SLC', '--words', 'N7:0', '--yes', *(
                word for case in ('identity', *OF_WORDS) for word in ('--only', case))])
    said = capsys.readouterr()
    why = ('STS 10 for a typed read of N7:0: the target does not have the typed commands of '
           '--family SLC, or not this file (--words)')
    assert said.err.count(why) == 1
    assert said.out.count(f'skipped: {why}\n') == len(OF_WORDS)
    assert (status, said.out.splitlines()[-1]) == (0, '1 passed, 0 failed, 6 skipped')
