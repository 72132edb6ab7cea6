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

"""The command line of ``plc``."""

import argparse
import subprocess
import sys

from abdf1_ros.cli.plc.line import network_of
from abdf1_ros.cli.plc.parser import help_asked, make_parser
from abdf1_ros.problems import ConfigurationError
import pytest
from support.cases import for_all


def parse(*args: str) -> argparse.Namespace:
    return make_parser('').parse_args(args)


def test_options_that_are_left_out_have_defaults() -> None:
    read = parse('read', 'N7:0')
    assert (read.command, read.addresses) == ('read', ['N7:0'])
    assert (read.length, read.radix) == (None, 'dec')
    assert read.plc_type is read.type is read.access is read.word_order is None
    assert read.station is parse('status').station is parse('files').station is None
    assert parse('scan').stations == tuple(range(32))
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
    for words in (['write', 'N7:10', '--station', '2', '5'], ['write', 'N7:10=5']):
        options = parse(*help_asked(words))
        assert (options.address, options.values) == ('N7:10', ['5'])


def help_of(capsys: pytest.CaptureFixture[str], *args: str) -> str:
    with pytest.raises(SystemExit):
        parse(*args, '--help')
    return ' '.join(capsys.readouterr().out.split())


def test_help_tells_what_detect_does_by_default(capsys: pytest.CaptureFixture[str]) -> None:
    text = help_of(capsys, 'detect')
    assert text.count('(default: tries all') == 3
    assert 'to wait for each answer (default: 200)' in text
    assert 'take port, parity and own station from this net CSV' in text
    text = help_of(capsys, 'scan')
    for default in (9600, 'CRC', 'half', 300):
        assert f'(default: {default})' in text
    assert 'take the line from this net CSV' in text


def test_detect_waits_for_a_short_time_only() -> None:
    assert parse('detect').timeout == '200'
    assert parse('detect').stations == tuple(range(8))
    assert parse('detect', '--timeout', '500').timeout == '500'
    assert parse('scan', '1').timeout is None


def test_list_of_stations_has_ranges_and_numbers() -> None:
    assert parse('scan', '0-3,9').stations == (0, 1, 2, 3, 9)


@for_all('args', [
    ('scan', ''), ('scan', '300'), ('ping', '1-2'), ('ping', '1', '--count', '-1'),
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
    (['help'], ['--help']), (['help', 'read'], ['read', '--help']),
    (['read', 'help'], ['read', '--help']), (['read', 'N7:0'], ['read', 'N7:0']), ([], []),
    (['write', 'ST9:0=a=b'], ['write', 'ST9:0', 'a=b'])])
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
