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

"""The options of the line, and a session whose port is lost."""

from collections.abc import Iterator
from pathlib import Path
import threading

from abdf1_ros.cli.plc.line import DEFAULTS, network_of
from abdf1_ros.cli.plc.parser import make_parser
from abdf1_ros.cli.plc.session import opened, Session
from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.errors import PortLost
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.steps import echo, identify
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.network import Network
import pytest
from support.ptys import Pty
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


def test_peer_is_full_duplex_and_by_radio_a_timeout_is_for_the_reply() -> None:
    assert line_of('--port', '1', '--peer') == line_of('--port', '1', '--duplex', 'full')
    radio = [line_of('--port', '1', '--radio', *timeout) for timeout in ((), ('--timeout', '150'))]
    assert [line.cmd_timeout for line in radio] == [Network().cmd_timeout, 150]


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


@pytest.fixture
def line(tmp_path: Path) -> Iterator[Pty]:
    pty = Pty(tmp_path / 'line')
    yield pty
    pty.close()


def network_on(line: Pty) -> Network:
    return Network(com_port=str(line.name), baud=115200, timeout=5000, mode='Peer',
                   error_code='BCC')


def test_port_that_is_not_there(tmp_path: Path) -> None:
    network = Network(com_port=str(tmp_path / 'nothing'))
    with pytest.raises(OSError):
        opened(network)
    with pytest.raises(OSError):
        Session(network)


def test_port_is_held_from_the_beginning(line: Pty) -> None:
    with Session(network_on(line)), pytest.raises(OSError):
        Session(network_on(line))
    with Session(network_on(line)) as session:
        assert session.counters.chars_sent == 0


def test_answer_to_an_echo_ends_the_request(line: Pty) -> None:
    with Session(network_on(line)) as session:
        pending = session.start(1, echo(b'\x05'))
        tns = line.read(13)[6:8]
        reply = b'\x05\x01\x46\x00' + tns + b'\x05'
        line.write(frames.ACK + frames.message_frame(reply, Checksum.BCC))
        assert session.wait(pending) is None
        assert session.counters.replies_received == 1


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
