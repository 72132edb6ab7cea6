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

"""Nothing that is from before a take-over reaches the line of a server that keeps it (rule 26)."""

from collections.abc import Iterator
from pathlib import Path
import time

from abdf1_ros.client import Client
from abdf1_ros.errors import LinkError
import pytest
from std_msgs.msg import Int16MultiArray
from support.fault_rig import HeardNode, NOT_SENT
from support.queueing_server import QueueingServer
from support.ros import Observer, Process, ros_args, write_csv

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
        bridge = HeardNode(observer, 'abdf1', server.url, 'order', order=Int16MultiArray)
        with Process('node', *ros_args(f'net_file:={net}', f'map_file:={rows}')):
            for number in range(100, 115):
                bridge.publish(number)
                time.sleep(0.2)
            assert server.stored
            observer.until(lambda: len(bridge.results) == 15, 'all results')
            assert {result.message for result in bridge.results} == {
                NOT_SENT + 'nothing has been heard on this connection'}
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
