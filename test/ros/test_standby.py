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

"""Two bridges of one name for one line: the spare is silent until the line is its own."""

from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock, Mock

from abdf1_ros.ports.port_thread import PortState
from abdf1_ros.ros.bridge.node import BridgeNode
from abdf1_ros.ros.bridge.session import BridgeSession
from abdf1_ros.ros.bridge.standby import Service, Standby
from diagnostic_msgs.msg import DiagnosticStatus
import pytest
from rclpy.task import Future
from std_msgs.msg import Int16MultiArray, UInt16MultiArray
from std_srvs.srv import SetBool, Trigger
from support.device_server import QueueingServer
from support.ros import BridgeCell, Observer, OK, ros_args, WARN, write_csv

NET = 'NAK_Retries,ENQ_Retries,Cmd_Timeout,Baud,Timeout\n1,1,5000,115200,3000\n'
ROWS = """\
Tag,Command,Address,Station,PLC_Type,Length,Publish,Fallback,Fallback_After
speed,Read,N7:0,1,PLC5,2,,,
state,Read,N7:8,1,PLC5,1,Change,,
recipe,Write,N7:4,1,PLC5,1,,,
motor,Write,N7:6,1,PLC5,1,,7,60000
start,Write,N7:9/0,1,PLC5,1,,,
"""
DATA = 'Station,PLC_Type,Address,Length,Values,Motion,Period\n1,PLC5,N7:0,16,,,\n'
SERVICES = ('reset_counters', 'reload', 'polling', 'read_link_counters', 'read_now/speed',
            'read_now/state', 'set/start')
TOPICS = ('read/speed', 'read/state', 'write_results', 'active_stations', 'snapshot')


class Pair(BridgeCell):
    """A bridge and a spare of one name at one port, both with ``standby``."""

    def __init__(self, folder: Path) -> None:
        self.places = folder / 'hmi', folder / 'panel'
        super().__init__(folder, DATA, ROWS, NET, 'standby:=true', 'write_timeout:=30.0',
                         f'net.share:="pty:{self.places[0]} pty:{self.places[1]}"')
        self.spare: BridgeNode | None = None

    def start(self) -> None:
        """Start the bridge, and the spare once the line is not free any more."""
        super().start()
        self.ros.until(lambda: self.counts == (1, 1), 'the bridge to have the line')
        self.spare = BridgeNode(context=self.ros.context, use_global_arguments=False,
                                cli_args=ros_args(*self.assignments))
        self.ros.run(self.spare)

    def end(self, *args: Any) -> int:
        if self.spare is not None:
            self.ros.end(self.spare)
        return super().end(*args)

    @property
    def counts(self) -> tuple[int, int]:
        """Return how many bridges publish values, and how many take commands."""
        node = self.ros.node
        return (node.count_publishers('/abdf1/read/speed'),
                node.count_subscribers('/abdf1/write/recipe'))

    def services(self) -> dict[str, int]:
        """Return how many bridges answer each service that only the owner of a line has."""
        found: Counter[str] = Counter()
        for bridge in (self.node, self.spare):
            names = [service.srv_name for service in bridge.services] if bridge else []
            found.update(name for name in SERVICES if f'~/{name}' in names)
        return dict(found)

    def publish(self, count: int) -> None:
        """Publish messages, as often as there are bridges that take them, and count results."""
        publisher = self.ros.publisher(Int16MultiArray, '/abdf1/write/recipe')
        told = len(self._told)
        for number in range(count):
            publisher.publish(Int16MultiArray(data=[number]))
            self.ros.until(lambda wanted=told + number + 1:  # type: ignore[misc]
                           len(self._told) >= wanted, 'a result')
        assert self._told[told:] == ['written'] * count

    @property
    def _told(self) -> list[str]:
        """Return the results of the messages; the fallback of another row has its own."""
        return [result.message for result in self.results if result.name == 'recipe']

    def until_status(self, name: str, level: bytes, end: str = '') -> None:
        """Wait until any bridge has a status at a level, with a text that ends so."""
        def matches(status: DiagnosticStatus) -> bool:
            return status.name == f'abdf1: {name}' and status.level == level \
                and status.message.endswith(end)

        self.diagnostics.until(lambda array: any(map(matches, array.status)), name)


@pytest.fixture
def pair(tmp_path: Path) -> Iterator[Pair]:
    with Pair(tmp_path) as pair:
        yield pair


def test_spare_is_silent_while_the_other_has_the_line(pair: Pair) -> None:
    pair.until_status('standby', OK, 'another program has it open')
    pair.publish(20)
    assert len(pair.results) == 21  # with the fallback of the start
    assert pair.counts == (1, 1)
    assert [pair.ros.node.count_publishers(f'/abdf1/{topic}') for topic in TOPICS] == [1] * 5
    assert pair.services() == dict.fromkeys(SERVICES, 1)
    assert [bridge.session.guests.lines[0].link.is_alive() for bridge in (pair.node, pair.spare)
            if bridge] == [True, False]
    pair.diagnostics.clear()
    pair.until_status('link', OK)  # nodes of one name are no fault here


def test_spare_takes_the_line_over_and_offers_everything(pair: Pair) -> None:
    state = pair.ros.listen(Int16MultiArray, '/abdf1/read/state')
    state.first()
    pair.ros.end(pair.node)
    del pair.results[:], state[:]
    pair.ros.until(lambda: pair.counts == (1, 1), 'the spare to have the line')
    assert state.first().data.tolist() == [0]  # of a row that publishes changes, too
    stations = pair.ros.listen(UInt16MultiArray, '/abdf1/active_stations')
    stations.until(lambda words: words.data[0] == 2, 'station 1 to be active')
    pair.ros.until(lambda: 'motor' in [result.name for result in pair.results],
                   'the result of the fallback that came before the spare was seen')
    pair.publish(3)
    pair.until_status('link', OK)
    assert pair.services() == dict.fromkeys(SERVICES, 1)


def test_line_that_is_left_goes_to_the_spare(pair: Pair) -> None:
    pair.ros.call(SetBool, '/abdf1/polling', SetBool.Request(data=False))
    pair.ros.until(lambda: pair.services() == dict.fromkeys(SERVICES, 1) | {'polling': 2},
                   'the spare to have the line')
    pair.publish(3)
    assert pair.node.link.is_released
    pair.ros.call(Trigger, '/abdf1/reset_counters', Trigger.Request())
    pair.node.set_polling(SetBool.Request(data=True), SetBool.Response())
    pair.ros.until(lambda: pair.services() == dict.fromkeys(SERVICES, 1), 'a spare without any')
    pair.ros.end(pair.spare)
    pair.spare = None
    pair.ros.until(lambda: pair.counts == (1, 1), 'the first bridge to have the line again')
    pair.ros.until(lambda: pair.results[-1].name == 'motor', 'the fallback')
    pair.publish(3)
    assert pair.services() == dict.fromkeys(SERVICES, 1)


def test_spare_says_that_its_files_have_changed(pair: Pair) -> None:
    pair.net.write_text(f'{NET}\n', encoding='utf-8')
    pair.map.write_text(ROWS.replace('N7:8', 'N7:9'), encoding='utf-8')
    pair.until_status('standby', WARN, 'net.csv, map.csv changed since read; restart this bridge')


def test_line_that_is_lost_is_offered_no_longer(pair: Pair) -> None:
    pair.plcs.lose()
    pair.ros.until(lambda: pair.counts == (0, 0), 'both to wait')
    pair.ros.until(lambda: not pair.services(), 'no services')
    count = pair.ros.node.count_publishers
    pair.ros.until(lambda: not any(count(f'/abdf1/{topic}') for topic in TOPICS), 'no topics')
    pair.ros.until(lambda: not any(map(Path.is_symlink, pair.places)), 'no place for a guest')


def test_line_that_was_lost_for_a_moment_has_its_active_stations_again(
        pair: Pair, capfd: pytest.CaptureFixture[str]) -> None:
    """The table is latched, and the new publisher has nothing of what the old one published."""
    bridge = pair.node
    pair.ros.until(lambda: bridge.surroundings.active_words == [2] + 15 * [0], 'station 1')
    left = bridge.executor.create_task(bridge.standby.leave_line)
    pair.ros.until(left.done, 'the line to be left')
    pair.ros.until(lambda: pair.counts == (1, 1), 'the bridge to have the line again')
    pair.ros.until(lambda: all(map(Path.is_symlink, pair.places)), 'the places for guests')
    pair.ros.listen(UInt16MultiArray, '/abdf1/active_stations').values([2] + 15 * [0])
    said = ''.join(capfd.readouterr())
    assert said.count('has lost the line: waits') == said.count('has got the line: begins') == 1


@pytest.mark.parametrize(('port', 'heard', 'has_line'), [
    ('/dev/ttyS0', [None], True), ('socket://a:1', [None, 5.0], True),
    ('socket://a:1', [], True), ('socket://a:1', [None, 4.0], False)])
def test_line_of_a_device_server_is_ours_when_any_station_has_answered_since_it_was_opened(
        port: str, heard: list[float | None], has_line: bool,
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.ros.bridge.session.line_time', lambda: 5.0)
    events, session, latest = Mock(), object.__new__(BridgeSession), dict[str, list[int]]()
    around = Mock(active_words=None)
    stations = MagicMock(**{'words.return_value': [6], '__iter__.side_effect': lambda: iter(
        [SimpleNamespace(last_heard=when) for when in heard])})
    # a station comes while the first table is published, maybe after that of the other thread
    around.active_stations.publish.side_effect = lambda table: setattr(
        stations.words, 'return_value', [7])
    vars(session).update(_surroundings=around, _port_text='', events=events, driver=Mock(
                         stations=stations), reads=Mock(latest=latest), diagnostics=Mock(),
                         configuration=Mock(port=port, **{'parameters.standby': has_line}))
    for is_open, is_released in (True, False), (False, False), (True, False), (False, True):
        around.link.is_released = is_released
        around.link.state = PortState(is_open, str(is_open))
        for _ in range(2):
            session.port_changed(around.link.state)
        assert session.has_line is (is_open and has_line)
        latest['speed'] = [1]
    tables = around.active_stations.publish.call_args_list
    assert [call.args[0].data[0] for call in tables] == [6, 7, 0, 7, 0]  # none without a port
    assert events.port_changed.call_count == 4  # late replies are no errors
    assert [*map(str, events.notes.mock_calls)] == [
        f"call.{level}('the port', '{port}: {is_open}')"
        for level, is_open in (
            ('info', True), ('error', False), ('info', True), ('info', False))]
    around.link.wake.reset_mock()
    session.begin_end()
    session.driver.kernel.end.wind_down.assert_called_once_with(is_final=False)
    session.go_on()
    for opened in around.services.open, around.writes.open:
        opened.call_args.args[3]()
    assert around.link.wake.call_count == 3  # the last commands do not wait for the next poll
    around.is_offered, around.results.waiting = False, ['fallback']
    session.port_changed(PortState(False, 'lost while it waits'))
    session.go_on()
    around.services.open.assert_called_once()
    assert not latest and not around.results.waiting
    assert session.driver.kernel.forget_served.called is has_line


def test_change_that_waits_for_the_executor_is_not_begun_again_before_it_ends() -> None:
    tasks: list[Any] = []
    around: Any = Mock(
        is_offered=True,
        node=Mock(**{'executor.create_task': lambda *task: tasks.append(task)}))
    session: Any = Mock(has_line=False, **{'withdraw.side_effect': KeyError})
    standby = Standby(around, lambda: session, [])
    for _ in range(2):
        standby.look()
    (change,), = tasks
    session.has_line = True
    change()  # a station has answered meanwhile
    session.has_line = False
    standby.look()
    with pytest.raises(KeyError):
        change()
    session.has_line = True
    session.withdraw.side_effect, session.offer.side_effect = None, (KeyError('x'), None)
    for is_offered, fault in ((False, 'KeyError()'), (False, "KeyError('x')"),
                              (False, "KeyError('x')"), (True, '')):
        standby.look()
        with suppress(KeyError):
            tasks[-1][0]()
        assert (around.is_offered, session.events.seen.take_over_fault) == (is_offered, fault)
    assert session.withdraw.call_count == 3  # all that was made is closed before the next try


def test_service_is_closed_after_the_answer_to_its_caller() -> None:
    node = Mock(**{'executor.create_task.side_effect': lambda task: task()})
    around: Any = Mock(node=node)
    session: Any = Mock(has_line=False)
    waits = Future()

    async def answer(request: str, response: str) -> str:
        await waits
        return request + response

    standby = Standby(around, lambda: session, [
        Service('~/slow', Trigger, answer), Service('~/polling', SetBool, Mock(), stays=True)])
    standby.offer()
    call = node.create_service.call_args_list[0].args[2]('a', 'b')
    call.send(None)
    for closed in 0, 1, 2, 2:
        standby.look()
        assert node.destroy_service.call_count == closed
        if not closed:
            waits.set_result(None)
            with pytest.raises(StopIteration, match='ab'):
                call.send(None)
        around.link.is_released = not closed


def test_spare_in_the_queue_of_a_device_server_waits_and_keeps_its_line_over_a_reload(
        tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    server = QueueingServer()
    write_csv(tmp_path / 'net.csv', 'Mode,Baud,Timeout,Cmd_Timeout', ['Peer,19200,200,500'])
    write_csv(tmp_path / 'map.csv', 'Tag,Command,Address,Station,PLC_Type',
              ['speed,Read,N7:0,1,SLC'])
    with Observer() as ros:
        diagnostics = ros.diagnostics(server.url)
        spare = BridgeNode(context=ros.context, use_global_arguments=False, cli_args=ros_args(
            f'net_file:={tmp_path / "net.csv"}', f'map_file:={tmp_path / "map.csv"}',
            f'port:={server.url}', 'standby:=true'))
        ros.run(spare)
        try:
            diagnostics.until(lambda array: array.status[0].message.endswith(
                'the port is open, and no station has answered'), 'the spare to wait')
            assert not ros.node.count_publishers('/abdf1/write_results')
            assert not {service.srv_name[2:] for service in spare.services} & {*SERVICES}
            server.take_over()
            ros.until(lambda: ros.node.count_publishers('/abdf1/read/speed') == 1, 'the line')
            assert ros.call(Trigger, '/abdf1/reload', Trigger.Request()).success
            assert spare.session.has_line  # its port is still open
            assert ros.node.count_publishers('/abdf1/read/speed') == 1
            write_csv(tmp_path / 'map.csv', 'Tag,Command,Address,Station,PLC_Type',
                      ['speed,Serve,N7:0,5,PLC5'])
            assert ros.call(Trigger, '/abdf1/reload', Trigger.Request()).success
        finally:
            ros.end(spare)
            server.close()
    said = capfd.readouterr().err
    assert 'before the PLC has confirmed' not in said and 'has lost the line' not in said
    assert said.count('standby: no row is of a PLC, so an open connection counts as the line') == 1
