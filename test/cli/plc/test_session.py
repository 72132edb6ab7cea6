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

"""A session on a pseudo-terminal: what becomes of requests when the port is lost."""

from collections.abc import Iterator
from pathlib import Path
import threading

from abdf1_ros.cli.plc.session import opened, Session
from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.errors import PortLost
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.steps import echo, identify
from abdf1_ros.settings.network import Network
import pytest
from support.ptys import Pty


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
        with pytest.raises(PortLost):
            session.ask(1, identify())


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
