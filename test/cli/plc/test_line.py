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

"""The line that options and a net CSV describe together."""

from pathlib import Path

from abdf1_ros.cli.plc.line import DEFAULTS, network_of
from abdf1_ros.cli.plc.parser import make_parser
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.network import Network
import pytest
from support.ros import write_csv


def line_of(*options: str) -> Network:
    return network_of(make_parser('').parse_args(['status', *options]))


def test_defaults_are_those_of_a_net_file_with_a_shorter_timeout() -> None:
    assert line_of('--port', '/dev/ttyUSB0') == Network(com_port='/dev/ttyUSB0', timeout=300)
    assert DEFAULTS == Network(timeout=300)


def test_every_option_sets_its_field_of_the_network() -> None:
    assert line_of('--port', '3', '--baud', '19200', '--check', 'bcc', '--parity', 'even',
                   '--timeout', '150', '--own-station', '9', '--duplex', 'FULL') == Network(
        com_port='3', baud=19200, error_code='BCC', parity='Even', timeout=150, station=9,
        mode='Peer')


def test_peer_is_full_duplex() -> None:
    assert line_of('--port', '1', '--peer') == line_of('--port', '1', '--duplex', 'full')


def test_gateway_in_full_duplex_has_no_address() -> None:
    with pytest.raises(ConfigurationError, match='--via: in full duplex a gateway has no address'):
        line_of('--port', '1', '--peer', '--via', '8')


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


def test_port_that_is_missing_is_asked_for() -> None:
    with pytest.raises(ConfigurationError, match='name the port, such as --port /dev/ttyUSB0'):
        line_of('--baud', '1200')
