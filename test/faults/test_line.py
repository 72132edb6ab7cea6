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

"""What happens to a line, done to a real node and simulator; see docs/troubleshooting.md."""

from collections.abc import Iterator
from itertools import count
from pathlib import Path
from random import Random
import struct
import time

from abdf1_ros.client import Client
from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import LinkError
import pytest
from std_msgs.msg import Int16MultiArray
from support import fault_rig
from support.device_server import QueueingServer
from support.fault_box import FaultBox
from support.ros import ERROR, Observer, Process, ros_args, write_csv

TOO_LATE = 'not written: refused: it came '  # from a process that a busy host let stand still

US, OTHER_MASTER = 5, 6

Boxed = tuple[fault_rig.Rig, FaultBox]


@pytest.fixture(scope='module')
def shared(observer: Observer, tmp_path_factory: pytest.TempPathFactory
           ) -> Iterator[fault_rig.Renewed[Boxed]]:
    names = count(1)
    renewed = fault_rig.Renewed(lambda: fault_rig.boxed(
        observer, tmp_path_factory.mktemp('line'), name=f'shared_{next(names)}'))
    yield renewed
    renewed.close()


@pytest.fixture
def line(shared: fault_rig.Renewed[Boxed], request: pytest.FixtureRequest) -> Iterator[Boxed]:
    """Return a rig that is well, with its box."""
    with shared.lent(request) as (rig, box):
        box.mend()
        rig.begin()
        yield rig, box


def foreign_traffic(random: Random) -> bytes:
    """Return what another master says and hears; some of it looks as if it were for us."""
    wrong_value = struct.pack('<f', 99.0)  # as long as a reply with the set point
    replies = [Packet(station, 2, 0x4F, 0, random.randrange(0x10000), wrong_value).encode()
               for station in (OTHER_MASTER, US)]
    return random.choice([
        frames.poll_frame(7), frames.EOT, frames.ACK,
        frames.master_frame(2, replies[0], Checksum.CRC),
        *(frames.message_frame(reply, Checksum.CRC) for reply in replies)])


def test_second_master_on_the_line(line: Boxed) -> None:
    rig, box = line
    random, said = Random(1), []

    def talk(data: bytes) -> bytes:
        if random.random() > 0.3:
            return b''
        said.append(foreign_traffic(random))
        return said[-1]

    box.overhear = talk
    rig.told('[ERROR]', '2510 ERR_WRONG_MESSAGE')  # the first of this line, or it is not logged
    results = [rig.write(3.0 + number) for number in range(5)]
    assert all(text == 'written' or text.startswith(
        (fault_rig.UNKNOWN, fault_rig.NOT_SENT, TOO_LATE)) for text in results)
    rig.observer.until(lambda: len(said) > 100, 'more traffic')
    assert 'unusable reply' not in rig.said  # no reply of others was taken for ours
    assert rig.has_read_only(fault_rig.SETPOINT, 3.0, 4.0, 5.0, 6.0, 7.0)
    box.overhear = lambda data: b''
    rig.recovers()  # after two late replies in a row a station is tried less often


def test_plc_loses_power_in_the_middle_of_a_write(line: Boxed) -> None:
    rig, box = line
    command = struct.pack('<f', 3.0)
    sent: list[bytes] = []

    def cut(data: bytes) -> bytes:
        if sent:  # the poll for the reply, so the command was acknowledged
            rig.kill_simulator()
        elif command in data:
            sent.append(data)
        return b''

    box.overhear = cut
    result = rig.write(3.0)
    assert result.startswith(fault_rig.UNKNOWN) and fault_rig.is_unanswered(result)
    box.overhear = lambda data: b''
    rig.status('link', ERROR, 'port open, but none of 2 stations answers')
    rig.restart_simulator()
    rig.recovers()
    assert rig.has_read_only(fault_rig.SETPOINT)  # it is not written again


_TIMES = {'timeout': 0.1, 'cmd_timeout': 0.2, 'retries': 0}


@pytest.fixture
def server() -> Iterator[QueueingServer]:
    server = QueueingServer()
    yield server
    server.close()


def test_message_to_a_bridge_that_waits_never_reaches_the_line(
        server: QueueingServer, tmp_path: Path) -> None:
    net = write_csv(tmp_path / 'net.csv', 'Com_Port,Mode,Baud,Timeout,Cmd_Timeout',
                    [f'{server.url},Peer,19200,200,500'])
    rows = write_csv(tmp_path / 'map.csv', 'Tag,Command,Address,Station,PLC_Type,Period',
                     ['order,ReadWrite,N7:0,1,SLC,200'])
    with Observer() as observer:
        bridge = fault_rig.HeardNode(observer, 'abdf1', server.url, 'order', order=Int16MultiArray)
        with Process('node', *ros_args(f'net_file:={net}', f'map_file:={rows}')):
            for number in range(100, 115):
                bridge.publish(number)
                time.sleep(0.2)
            assert server.stored
            observer.until(lambda: len(bridge.results) == 15, 'all results')
            assert {result.message for result in bridge.results} == {
                fault_rig.NOT_SENT + 'nothing has been heard on this connection'}
            server.take_over()
            bridge.until_well()
            assert server.written() == []
            bridge.publish(7)
            observer.until(lambda: bridge.results[-1].message == 'written', 'a write')
    assert server.written() == [7]


def test_write_of_a_client_is_asked_for_first(server: QueueingServer) -> None:
    with Client(server.url, plc_type='SLC', **_TIMES) as plc:  # type: ignore[arg-type]
        for number in (100, 101):
            with pytest.raises(LinkError) as error:
                plc.write('N7:0', number)
            assert not error.value.sent
        assert server.stored
        server.take_over()
        plc.write('N7:0', 7)
        plc.write('N7:0', 8)
    assert server.written() == [7, 8]


def test_client_asks_again_after_a_request_without_an_answer(server: QueueingServer) -> None:
    server.take_over()
    with Client(server.url, plc_type='SLC', **_TIMES) as plc:  # type: ignore[arg-type]
        plc.write('N7:0', 7)
        server.block()
        with pytest.raises(LinkError):
            plc.read('N7:0')
        with pytest.raises(LinkError) as error:
            plc.write('N7:0', 8)
        assert not error.value.sent
        server.take_over()
        plc.write('N7:0', 9)
    assert server.written() == [7, 9]
