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

"""Services of rows over DDS: ~/set/<topic> and ~/read_now/<topic>."""

from collections.abc import Callable, Coroutine, Iterator
from datetime import datetime, UTC
import math
from pathlib import Path
import signal
import threading
import time
from typing import Any, cast

from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.reads.demands import ReadAnswer
from abdf1_ros.driver.write import Outcome, WriteResult
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ros.topics.interlocks import count_owners
from abdf1_ros.ros.topics.services import RowServices
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
import pytest
from rclpy.qos import QoSProfile
from std_msgs.msg import Int16MultiArray, UInt8MultiArray
from std_srvs.srv import SetBool, Trigger
from support.mappings import make_mapping
from support.ros import BridgeCell, details, Observer, Process, write_csv
from support.simulator_process import make_files

DATA = """Station,PLC_Type,Address,Length,Values
1,PLC5,N7:0,16,7 8 211 222 233
1,PLC5,B3:0,4,
2,PLC5,B3:0,4,
"""
HEADER = 'Tag,Command,Address,Station,PLC_Type,Length,Topic,Period,Fallback,Fallback_After,While'
ROWS = (
    'speed,Read,N7:0,1,PLC5,2,,5000,,,',
    'recipe,Read,N7:2,1,PLC5,3,,on demand,,,',
    'run_only,Read,N7:6,1,PLC5,,,on demand,,,RUN',
    'lamp,Write,B3:0/0,1,PLC5,,,,,,',
    'lamp_south,Write,B3:0/0,2,PLC5,,lamp,,,,',
    'horn,ReadWrite,B3:0/1,1,PLC5,,,,,,',
    'motor,Write,B3:1/0,1,PLC5,,,,0,1000,',
    'everybody,Write,B3:2/0,255,PLC5,,,,,,',
    'flags,Write,B3:0/4,1,PLC5,2,,,,,')
SET, READ = '/abdf1/set/', '/abdf1/read_now/'
HEARTBEAT = Trigger, f'{READ}heartbeat', Trigger.Request()


class Bench(BridgeCell):
    """A bridge on simulated PLCs with calls."""

    def start(self) -> None:
        super().start()
        self.ros.until(lambda: self.node.writes.is_open, 'writes are taken')

    def put(self, topic: str, data: bool) -> tuple[bool, str]:
        response = self.call(SetBool, f'set/{topic}', SetBool.Request(data=data))
        return response.success, response.message

    def read(self, topic: str) -> tuple[bool, str]:
        response = self.call(Trigger, f'read_now/{topic}', Trigger.Request())
        return response.success, response.message

    def services(self) -> set[str]:
        """Return the services of rows that there are."""
        found = self.ros.node.get_service_names_and_types_by_node('abdf1', '/')
        return {name for name, _ in found if name.startswith((SET, READ))}

    def hold(self, kind: Any, name: str, request: Any) -> Any:
        """Call a service; return the future of its answer."""
        client = self.ros.node.create_client(kind, name)
        self.ros.until(client.service_is_ready, name)
        return client.call_async(request)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with Bench(tmp_path, DATA, '\n'.join((HEADER, *ROWS)), 'Baud,Timeout\n115200,300',
               'most_services:=6') as bench:
        yield bench


def test_rows_of_one_bit_can_be_set_and_all_that_a_plc_has_can_be_read(bench: Bench) -> None:
    expected = {SET + topic for topic in ('lamp', 'horn', 'motor', 'everybody')} \
        | {READ + topic for topic in ('speed', 'recipe', 'run_only', 'horn')}
    bench.ros.until(lambda: bench.services() == expected, f'{expected}')


def test_set_is_answered_when_the_plc_has_confirmed(bench: Bench) -> None:
    assert bench.put('horn', True) == (True, 'written')
    assert bench.plcs.word('B3:0') == 2
    assert bench.put('horn', False) == (True, 'written')
    assert bench.plcs.word('B3:0') == 0
    results = [result for result in bench.results if result.name == 'horn']
    assert [details(result)['value'] for result in results] == ['[1]', '[0]']
    assert results[0].message == 'written'


def test_set_of_several_rows_waits_for_all_of_them(bench: Bench) -> None:
    assert bench.put('lamp', True) == (True, 'lamp: written; lamp_south: written')
    bench.plcs.say('error 2 10')
    success, text = bench.put('lamp', False)
    assert not success
    assert text.startswith('lamp: written; lamp_south: not written: the PLC refused it: ')


def test_broadcast_is_no_success_as_no_station_confirms_it(bench: Bench) -> None:
    assert bench.put('everybody', True) == (
        False, 'sent to all stations; no station confirms a broadcast')


def test_set_feeds_a_fallback_once(bench: Bench) -> None:
    bench.results.until(lambda result: result.message == 'fallback value written: start', 'start')
    # If the host stood still, calls count as too old for a moment.
    bench.ros.until(lambda: bench.put('motor', True) == (True, 'written'), 'a call in time')
    bench.results.until(lambda result: result.message == 'fallback value written: timeout', 'it')
    assert bench.plcs.word('B3:1') == 0


def test_read_now_publishes_and_answers_with_value_and_time(bench: Bench) -> None:
    recipes = bench.ros.listen(Int16MultiArray, '/abdf1/read/recipe')
    begun = datetime.now(UTC)
    success, text = bench.read('recipe')
    assert success, text
    values, _, moment = text.partition(' at ')
    assert values == '[211, 222, 233]'
    assert begun.timestamp() - 0.001 <= datetime.fromisoformat(moment).timestamp() <= time.time()
    assert recipes.first().data.tolist() == [211, 222, 233]
    bench.ros.wait(lambda: False, 1.0)
    assert len(recipes) == 1
    bench.plcs.set('N7:0', 70)
    for tag, value in ('speed', '[70, 8] at '), ('horn', '0 at '):
        bench.ros.until(  # if the host stood still, the station may be inactive before
            lambda: bench.read(tag)[1].startswith(value), tag)  # noqa: B023


def test_read_now_of_a_withheld_row_answers_withheld(bench: Bench) -> None:
    values = bench.ros.listen(Int16MultiArray, '/abdf1/read/run_only')
    bench.ros.until(lambda: bench.read('run_only')[0], 'a value while it runs')
    bench.plcs.say('mode 1 program')
    bench.ros.until(  # if the host stood still, the station may be inactive before
        lambda: bench.read('run_only')[1].startswith('withheld: not in RUN:'), 'the mode')
    del values[:]
    assert not bench.read('run_only')[0]
    bench.ros.wait(lambda: False, 0.5)
    assert not values


def test_hundred_callers_at_once_have_an_answer_each_and_more_are_refused(bench: Bench) -> None:
    bench.plcs.say('delay 1 300')
    client = bench.ros.node.create_client(
        Trigger, READ + 'recipe', qos_profile=QoSProfile(depth=1000))
    bench.ros.until(client.service_is_ready, 'the service')
    futures = [client.call_async(Trigger.Request()) for _ in range(150)]
    bench.ros.until(lambda: all(future.done() for future in futures), 'all answers')
    answers = [future.result() for future in futures]
    good = [answer for answer in answers if answer.success]
    refused = {answer.message for answer in answers if not answer.success}
    assert len(good) >= 100
    assert refused <= {'refused: 100 calls wait already'}
    assert not bench.node.surroundings.services.calls


def test_reload_answers_who_waits_and_closes_what_is_gone(bench: Bench) -> None:
    bench.plcs.say('delay 1 1500')
    calls = bench.node.surroundings.services.calls
    written = bench.hold(SetBool, SET + 'horn', SetBool.Request(data=True))
    bench.ros.until(lambda: len(calls) == 1, 'the write, which has the line from then on')
    read = bench.hold(Trigger, READ + 'recipe', Trigger.Request())
    bench.ros.until(lambda: len(calls) == 2, 'both calls')
    write_csv(bench.map, HEADER, ROWS[:1])
    assert bench.call(Trigger, 'reload', Trigger.Request()).success
    bench.ros.until(lambda: read.done() and written.done(), 'both answers')
    assert read.result().message == 'port lost: the files have been read again'
    assert written.result().message.startswith(('not written: not sent', 'unknown whether'))
    bench.ros.until(lambda: bench.services() == {READ + 'speed'}, 'the end of the others')
    bench.plcs.say('normal 1')
    assert bench.read('speed')[0]


def test_read_only_refuses_to_set_and_reads(tmp_path: Path) -> None:
    with Bench(tmp_path, DATA, '\n'.join((HEADER, *ROWS)), 'Baud,Timeout\n115200,300',
               'read_only:=true', f'net.share:="pty:{tmp_path}/hmi"',
               'net.share_access:=Write') as bench:
        assert bench.put('horn', True) == (False, 'not written: refused: this node is read_only')
        assert bench.read('recipe')[0]
        assert bench.node.session.guests.lines[0].guest.access is ShareAccess.READ


@pytest.mark.parametrize(('most', 'expected'), [
    (0, {READ + 'recipe', READ + 'run_only'}),
    (4, {READ + 'recipe', READ + 'run_only', SET + 'lamp', SET + 'horn', SET + 'motor',
         SET + 'everybody'})])
def test_map_of_many_rows_has_the_services_that_matter(
        tmp_path: Path, most: int, expected: set[str]) -> None:
    with Bench(tmp_path, DATA, '\n'.join((HEADER, *ROWS)), 'Baud,Timeout\n115200,300',
               f'most_services:={most}') as bench:
        bench.ros.until(lambda: bench.services() == expected, f'{expected}')


def test_publisher_and_caller_of_one_fallback_row_are_two_owners(bench: Bench) -> None:
    client = bench.ros.node.create_client(SetBool, SET + 'motor')
    bench.ros.until(lambda: count_owners(bench.node, 'motor') == 1, 'the caller')
    assert bench.node.session.owners.look(math.inf) == ()
    publisher = bench.ros.publisher(UInt8MultiArray, '/abdf1/write/motor')
    bench.ros.until(lambda: bench.node.session.owners.look(math.inf) == ('motor',), 'both owners')
    bench.ros.node.destroy_client(client)
    bench.ros.node.destroy_publisher(publisher)
    bench.ros.until(lambda: not count_owners(bench.node, 'motor'), 'none')
    assert [bench.node.session.owners.look(now) for now in (0.0, math.inf)] == [('motor',), ()]


def test_old_call_is_not_written_and_the_end_answers_who_waits(tmp_path: Path) -> None:
    """The process stands still for longer than a write may wait; later it ends with calls."""
    files = make_files(tmp_path)
    arguments = files.args('net.com_port:=2', 'write_timeout:=1.0')
    with Observer() as observer, files.start_simulator() as simulator, \
            Process('node', *arguments) as node:
        observer.call(Trigger, '/abdf1/read_now/heartbeat', Trigger.Request())
        answers = (observer.call(SetBool, '/abdf1/set/reset', SetBool.Request(data=True)).message
                   for _ in range(5))  # too old if the host stood still
        assert 'written' in answers
        client = observer.node.create_client(SetBool, '/abdf1/set/reset')
        observer.until(client.service_is_ready, 'the service')
        node.stop()
        late = client.call_async(SetBool.Request(data=False))
        goes_on = threading.Timer(2.5, node.go_on)
        goes_on.start()
        observer.until(late.done, 'the answer to the old call')
        goes_on.join()
        assert late.result().message.startswith('not written: refused: it came ')
        simulator.say('delay 2 4000')
        waiting = [client.call_async(SetBool.Request(data=True)), *(
            observer.node.create_client(Trigger, f'/abdf1/{name}').call_async(Trigger.Request())
            for name in ('read_now/heartbeat', 'read_link_counters'))]
        observer.wait(lambda: False, 0.5)
        node.end(signal.SIGINT)
        observer.until(lambda: all(future.done() for future in waiting), 'the last answers')
        assert [future.result().success for future in waiting] == [False] * 3
        simulator.say('normal 2')


def answer_of(observer: Observer, client: Any, request: Any) -> Any:
    """Call again until an answer comes: for 20 s DDS may send a call to a killed bridge alone."""
    def call() -> Any:
        future = client.call_async(request)
        observer.wait(future.done, 2.0)
        return future.result() if future.done() else None

    return observer.until(call, 'an answer')


def test_call_to_a_bridge_that_is_killed_is_not_executed_by_the_next(tmp_path: Path) -> None:
    files = make_files(tmp_path)
    with Observer() as observer, files.start_simulator():
        results = observer.results()
        client = observer.node.create_client(SetBool, '/abdf1/set/lamp')
        with Process('node', *files.args()) as node:
            observer.until(client.service_is_ready, 'the service')
            observer.until(lambda: observer.call(*HEARTBEAT).success, 'the PLC')
            node.stop()
            lost = client.call_async(SetBool.Request(data=True))
            observer.wait(lambda: False, 0.5)
            node.send(signal.SIGKILL)
        with Process('node', *files.args()) as node:
            observer.until(lambda: answer_of(  # at first its port may not be open
                observer, client, SetBool.Request(data=False)).message == 'written', 'a write')
        assert not lost.done()
        assert {details(result)['value'] for result in results} == {'[0]'}


def test_line_that_is_only_listened_to_has_no_services_of_rows(tmp_path: Path) -> None:
    rows = (HEADER, 'speed,Read,N7:0,1,PLC5,2,,500,,,')
    with Bench(tmp_path, DATA, '\n'.join(rows), 'Mode,Baud\nListen,115200') as bench:
        bench.ros.until(lambda: bench.ros.node.count_publishers('/abdf1/read/speed'), 'the topic')
        assert bench.services() == set()


class StandIn:
    """A node, a driver and a write topic in one, which only remember."""

    def __init__(self, *rows: Mapping) -> None:
        self.network, self.mappings = Network(polling='Standard'), Rows(rows)
        self.executor = self
        self.call_stamps = 1, 2
        self.made: dict[str, Callable[..., Coroutine[Any, Any, Any]]] = {}
        self.closed: list[str] = []
        self.takes: list[Callable[[ReadAnswer], None]] = []
        self.messages: list[Any] = []

    def create_service(self, kind: type, name: str, answer: Any, **options: object) -> str:
        assert name not in self.made
        self.made[name] = answer
        return name

    def destroy_service(self, name: str) -> None:
        self.closed.append(name)

    def create_task(self, task: Callable[[], None]) -> None:
        task()

    def read_now(self, row: Mapping, take: Callable[[ReadAnswer], None]) -> None:
        self.takes.append(take)

    def take(self, topic: str, *message: object, is_call: bool) -> None:
        assert is_call
        self.messages += message


def test_services_of_rows_that_are_gone_close_once_when_no_call_waits() -> None:
    rows = [make_mapping(f'N7:{number}', tag=f'n{number}') for number in range(3)]
    lamps = [make_mapping(f'B3:0/{bit}', 'Write', tag=f'l{bit}', topic='lamp') for bit in (0, 1)]
    node: Any = StandIn(*rows, *lamps)
    woken: list[object] = []
    services = RowServices(node, node, lambda: woken.append(
        [call.done.done() for call in services.calls.values()]))

    def reload(*left: Mapping) -> None:
        services.open(cast(Driver, StandIn(*left)), 100, 2.0, lambda: None)

    def ended(call: Coroutine[Any, Any, Any]) -> tuple[bool, str]:
        with pytest.raises(StopIteration) as end:
            call.send(None)
        return end.value.value.success, end.value.value.message

    services.open(node, 100, 2.0, lambda: woken.append('link'))
    begun = line_time()
    read = node.made['~/read_now/n0'](Trigger.Request(), Trigger.Response())
    puts = [node.made['~/set/lamp'](SetBool.Request(), SetBool.Response()) for _ in range(4)]
    for call, count in (read, 0), (puts[0], 0), (puts[1], 1), (puts[2], 2):
        call.send(None)
        for row in lamps[:count]:
            services.take(WriteResult(row, Outcome.STANDS, '', '', request=[*services.calls][-1]))
    assert woken == ['link', [False, False, False, True]]
    assert [*node.messages[1].values()] == [1, 2, None]
    assert ended(puts[2]) == (True, 'l0: stands in the PLC; l1: stands in the PLC')
    longest = 2 * (2.0 + node.network.line_mode.longest_transaction(
        node.network.line, 0.0, stations=1))
    services.look(begun + longest - 0.001)
    assert len(woken) == 2
    services.look(line_time() + longest)
    assert ended(puts[0]) == (False, 'unknown whether written: no result has come')
    assert ended(puts[1]) == (False, 'l0: stands in the PLC')
    *crowd, late = (node.made['~/read_now/n2'](Trigger.Request(), Trigger.Response())
                    for _ in range(100))
    for call in crowd:
        call.send(None)
    assert ended(late) == (False, 'refused: 100 calls wait already')
    for take in node.takes[1:]:
        take(ReadAnswer('Tank\x1b', line_time() - 3600.0))
    assert {(is_read, text[:12], round((datetime.fromisoformat(
        text[12:]).timestamp() - time.time()) / 3600)) for is_read, text in map(ended, crowd)} == {
            (True, r'Tank\x1b at ', -1)}
    puts[3].send(None)
    node.messages = None  # the write topic fails
    with pytest.raises(TypeError):
        node.made['~/set/lamp'](SetBool.Request(), SetBool.Response()).send(None)
    last = node.made['~/read_now/n1'](Trigger.Request(), Trigger.Response())
    last.send(None)
    reload(rows[1])
    reload()
    services.look(line_time())
    gone = node.made['~/set/lamp'](SetBool.Request(), SetBool.Response())
    assert ended(gone) == (False, 'refused: the map has no such row any more')
    reload(*rows)  # none of them has two services of one name
    assert node.closed == []
    node.takes[0](ReadAnswer(error='late'))
    assert ended(read) == (False, 'late')
    services.withdraw()
    assert ended(puts[3]) == (False, 'unknown whether written: no result has come')
    assert ended(last) == (False, 'this node ends')
    for _ in range(2):
        services.look(line_time())
    assert sorted(node.closed) == sorted(node.made)
