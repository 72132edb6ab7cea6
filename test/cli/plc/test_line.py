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

"""The command line of plc, the options of the line, and a session whose port is lost."""

import argparse
from collections.abc import Iterator
from pathlib import Path
import subprocess
import sys
import threading

from abdf1_ros.cli.plc.line import DEFAULTS, network_of
from abdf1_ros.cli.plc.parser import help_asked, make_parser
from abdf1_ros.cli.plc.session import Session
from abdf1_ros.errors import PortLost
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.steps import identify
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.network import Network
import pytest
from support.cases import for_all
from support.ptys import Pty
from support.ros import write_csv


def line_of(*options: str) -> Network:
    return network_of(make_parser('').parse_args(['status', *options]))


def test_defaults_are_those_of_a_net_file_with_a_shorter_timeout() -> None:
    assert line_of('--port', '/dev/ttyUSB0') == Network(com_port='/dev/ttyUSB0', timeout=300)
    assert DEFAULTS == Network(timeout=300)


def test_every_option_sets_its_field_of_the_network() -> None:
    assert line_of('--port', '3', '--baud', '19200', '--check', 'bcc', '--parity', 'even',
                   '--data-bits', '7', '--stop-bits', '2', '--timeout', '150', '--own-station',
                   '9', '--duplex', 'FULL') == Network(
        com_port='3', baud=19200, error_code='BCC', parity='Even', data_bits=7, stop_bits=2,
        timeout=150, station=9, mode='Peer')


def test_peer_is_full_duplex_and_by_radio_a_timeout_is_for_the_reply() -> None:
    assert line_of('--port', '1', '--peer') == line_of('--port', '1', '--duplex', 'full')
    radio = [line_of('--port', '1', '--radio', *timeout) for timeout in ((), ('--timeout', '150'))]
    radio += [network_of(parse('init', '--port', '1', '--radio', *timeout), timeout='200')
              for timeout in ((), ('--timeout', '90'))]
    assert [(line.timeout, line.cmd_timeout) for line in radio] == [
        (300, Network().cmd_timeout), (150, 150), (200, Network().cmd_timeout), (90, 90)]


def test_options_go_before_the_file(tmp_path: Path) -> None:
    path = write_csv(tmp_path / 'net.csv', 'Mode,Baud,Error_Code,Com_Port,Polling',
                     ['Peer,19200,BCC,/dev/ttyS7,Standard'])
    assert line_of('--net', str(path)) == Network(
        mode='Peer', baud=19200, error_code='BCC', com_port='/dev/ttyS7')
    assert line_of('--net', str(path), '--baud', '1200', '--duplex', 'half') == Network(
        baud=1200, error_code='BCC', com_port='/dev/ttyS7')


def test_line_of_another_master_makes_us_a_slave_unless_duplex_is_given(tmp_path: Path) -> None:
    path = write_csv(tmp_path / 'net.csv', 'Mode,Com_Port', ['Slave,/dev/ttyS7'])
    assert line_of('--net', str(path)).mode == 'Slave'
    assert line_of('--port', '1', '--slave') == line_of('--port', '1', '--duplex', 'slave')
    assert line_of('--net', str(path), '--duplex', 'half').mode == 'Master'


def test_every_wrong_option_is_told() -> None:
    with pytest.raises(ConfigurationError) as caught:
        line_of('--port', 'x', '--baud', '1', '--check', 'sum', '--own-station', '255')
    assert [str(problem.place) for problem in caught.value.problems] == [
        '--port', '--baud', '--check', '--own-station']


@pytest.fixture
def line(tmp_path: Path) -> Iterator[Pty]:
    pty = Pty(tmp_path / 'line')
    yield pty
    pty.close()


def network_on(line: Pty) -> Network:
    return Network(com_port=str(line.name), baud=115200, timeout=5000, mode='Peer',
                   error_code='BCC')


def test_port_is_held_from_the_beginning(line: Pty) -> None:
    with Session(network_on(line)), pytest.raises(OSError):
        Session(network_on(line))
    with Session(network_on(line)) as session:
        assert session.counters.chars_sent == 0


def test_lost_port_ends_the_order_and_those_after_it(line: Pty) -> None:
    with Session(network_on(line)) as session:
        pending = session.start(1, identify())
        line.read(5)
        line.close()
        with pytest.raises(PortLost):
            session.wait(pending)
        for ask in (session.ask, session.attempt):
            with pytest.raises(PortLost):
                ask(1, identify())


def test_close_ends_what_is_under_way(line: Pty) -> None:
    session = Session(network_on(line))
    under_way = session.start(1, identify())
    waiting = session.start(1, identify())
    line.read(5)
    session.close()
    for pending in (under_way, waiting):
        assert isinstance(pending.error, PortLost)
    assert not any(thread.name == 'df1 link' for thread in threading.enumerate())


def test_bug_in_a_request_is_raised_to_who_asks(line: Pty) -> None:
    def broken() -> Steps[None]:
        raise ZeroDivisionError
        yield 0, b''  # makes it a generator

    with Session(network_on(line)) as session, pytest.raises(ZeroDivisionError):
        session.ask(1, broken())


def parse(*args: str) -> argparse.Namespace:
    return make_parser('').parse_args(args)


def test_options_that_are_left_out_have_defaults() -> None:
    read = parse('read', 'N7:0')
    assert (read.command, read.addresses) == ('read', ['N7:0'])
    assert (read.length, read.radix) == (None, 'dec')
    assert read.plc_type is read.type is read.access is read.word_order is None
    assert read.station is parse('status').station is parse('files').station is None
    assert parse('scan').stations == tuple(range(32))
    assert parse('detect').stations == tuple(range(8))
    assert parse('ping', '3').count == 4
    assert parse('watch', 'N7:0').period == 0.5
    assert parse('watch', 'N7:0').count is None
    assert not parse('write', 'N7:0', '1').yes


def test_negative_values_are_no_options() -> None:
    assert parse('write', 'F8:0', '-1', '-2.5', '--yes').values == ['-1', '-2.5']


def test_value_that_looks_like_an_option_goes_last() -> None:
    options = parse('write', 'F8:2', '--yes', '--net', 'x', '--', '-1.5e3')
    assert (options.values, options.yes, options.net) == (['-1.5e3'], True, 'x')


def test_value_may_come_after_options() -> None:
    for words, values in ((('N7:10', '--station', '2', '5'), ['5']), (('N7:10=5',), ['5']),
                          (('--net', 'a:1=3', 'N7:10=5', '6'), ['5', '6']),
                          (('N7:10=a=b',), ['a=b']),
                          (('--yes', 'N7:10', 'LOT:12=3'), ['LOT:12=3'])):
        options = parse('write', *words)
        assert (options.address, options.values) == ('N7:10', values)
        assert options.net in (None, 'a:1=3')


def help_of(capsys: pytest.CaptureFixture[str], *args: str) -> str:
    with pytest.raises(SystemExit):
        parse(*args, '--help')
    return ' '.join(capsys.readouterr().out.split())


def test_help_tells_what_detect_does_by_default(capsys: pytest.CaptureFixture[str]) -> None:
    text = help_of(capsys, 'detect')
    assert text.count('(default: tries all') == 3
    assert 'to wait for each answer (default: 200)' in text
    assert 'take port, parity, bits and own station from this net CSV' in text
    text = help_of(capsys, 'scan')
    for default in (9600, 'CRC', 'half', 300):
        assert f'(default: {default})' in text
    assert 'take the line from this net CSV' in text


@for_all('args', [
    ('scan', ''), ('scan', '1,300'), ('ping', '1-2'), ('ping', '1', '--count', '-1'),
    ('watch', 'N7:0', '--period', '-1'), ('watch', 'N7:0', '--period', 'nan'),
    ('watch', 'N7:0', '--count', '1.5'), ('watch', 'N7:0', '--count', '\u0661'),
    ('watch', 'N7:0', '--period', '1_0'), ('ping', '\u0661'),
    ('scan', '1', '--peer', '--duplex', 'half'), ('scan', '1', '--duplex', 'half', '--peer'),
    ('write', 'N7:0'), ('fly',), ('write', 'N7:0', '1', '--ye'),
    *(('read', 'N7:0', f'--{option}', value) for option, value in (
        ('type', 'int8'), ('radix', '9'), ('plc-type', 'S7'), ('processor', '5/99'),
        ('access', 'x'), ('word-order', 'x'), ('station', '300'), ('via', '1-2')))])
def test_command_line_that_is_wrong_ends_with_status_2(args: tuple[str, ...]) -> None:
    with pytest.raises(SystemExit) as ending:
        parse(*args)
    assert ending.value.code == 2


@pytest.mark.parametrize(('args', 'hint'), [
    (('files', '--station', '2'), 'did you mean STATION without --station?'),
    (('status', '--station=2'), 'did you mean STATION without --station?'),
    (('scan', '--stations', '0-7'), 'did you mean STATIONS without --stations?')])
def test_place_that_is_written_as_an_option_is_told(
        args: tuple[str, ...], hint: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parse(*args)
    assert hint in capsys.readouterr().err


def test_help_of_all_commands_loads_next_to_nothing() -> None:
    program = ('import sys; from abdf1_ros.cli.plc.command import main\n'
               'try: main(["--help"])\nexcept SystemExit: print(*sys.modules, sep="\\n")')
    said = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True,
                          check=True, timeout=60).stdout.splitlines()
    ours = [name for name in said if name.startswith('abdf1_ros.')]
    assert 'abdf1_ros.cli.plc.command' in ours and len(ours) < 16
    assert not {'serial', 'decimal', 'csv', 'concurrent.futures'} & set(said)


@for_all(('words', 'parsed'), [
    (['help'], ['--help']), (['help', 'read', 'N7:0'], ['read', '--help']),
    (['read', 'help'], ['read', '--help']), (['read', 'N7:0'], ['read', 'N7:0']), ([], [])])
def test_help_is_also_a_word(words: list[str], parsed: list[str]) -> None:
    assert help_asked(words) == parsed


def test_no_time_for_an_answer_is_refused() -> None:
    with pytest.raises(ConfigurationError, match='--timeout: 0 ms leaves no time for an answer'):
        network_of(parse('read', 'N7:0', '--port', '/dev/x', '--timeout', '0'))


@for_all(('said', 'kind', 'family'), [
    ('INT SLC500', 'int16', 'SLC'), ('REAL PLC-5', 'float32', 'PLC5'),
    ('DINT MicroLogix', 'int32', 'SLC'), ('uint16 plc2', 'uint16', 'PLC2')])
def test_types_and_families_have_the_names_of_the_field(said: str, kind: str, family: str) -> None:
    words = said.split()
    options = make_parser(None).parse_args([
        'read', 'N7:0', '--type', words[0], '--plc-type', words[1]])
    assert (options.type, options.plc_type) == (kind, family)


def test_family_that_is_none_leads_to_what_to_choose(capsys: pytest.CaptureFixture[str]) -> None:
    assert parse('read', 'N7:0', '--plc-type', 'SLC 5/04').plc_type == 'SLC'
    with pytest.raises(SystemExit):
        parse('read', 'N7:0', '--plc-type', 'logix')
    assert ('argument --plc-type: "logix" should be one of PLC2, PLC3, PLC5, SLC; a Logix '
            'controller has only') in capsys.readouterr().err
