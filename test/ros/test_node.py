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

"""The bridge node in this process, against simulated PLCs on a pseudo-terminal."""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
import math
import os
from pathlib import Path
import re
import signal
import threading
import time
from typing import Any
from unittest.mock import Mock

from abdf1_ros.driver.kernel import waiting
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.ports.port_thread import PortState
from abdf1_ros.ros.bridge.node import end_together
from abdf1_ros.ros.diagnostics import graph
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.duration import Duration
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from std_msgs import msg
from std_srvs.srv import SetBool, Trigger
from support import ros
from support.commands import Output

# On a busy host this process may stand still for longer than PLCs are usually given time.
NET = 'NAK_Retries,ENQ_Retries,Cmd_Timeout,Baud,Timeout\n1,1,5000,115200,3000\n'
MAP_HEADER = 'Tag,Command,Address,Station,PLC_Type,Length,Topic'
SIMULATOR = """\
Station,PLC_Type,Address,Length,Values,Motion,Period
1,PLC5,N7:0,16,,,
1,PLC5,B3:0,4,,,
1,PLC5,F8:0,4,,,
2,SLC,B3:0,4,,,
2,SLC,N7:0,16,,,
"""

SPEED = 'speed,Read,N7:0,1,PLC5,2,'
LAMPS = ('lamp_a,Write,B3:0/1,1,PLC5,2,lamps', 'lamp_b,Write,B3:2/8,2,SLC,2,lamps')
PULSES = 'pulses,Write,B3:1/0,1,PLC5,8,'
RECIPE = 'recipe,Write,N7:4,1,PLC5,2,'


class Bench(ros.BridgeCell):
    """A bridge that has a port, with a map that may have faults."""

    def __init__(self, folder: Path, rows: tuple[str, ...], *assignments: str) -> None:
        super().__init__(folder, SIMULATOR, f'{MAP_HEADER}\n{SPEED}\n', NET,
                         'write_timeout:=30.0', *assignments)
        ros.write_csv(self.map, MAP_HEADER, rows)

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        """End the bridge, unless it has ended."""
        status = super().end(number)
        assert not self.node.link.is_alive()
        return status

    def publisher(self, kind: Any, topic: str) -> Callable[..., None]:
        """Return what publishes values, once they cannot get lost any more."""
        publisher = self.ros.publisher(kind, f'/abdf1/write/{topic}')
        return lambda *values: publisher.publish(kind(data=values))

    def until_results(self, count: int) -> ros.Inbox:
        """Wait for so many results; there must not be more."""
        self.ros.until(
            lambda: len(self.results) >= count,
            lambda: f'{count} results; got {len(self.results)}: {messages(self.results)}')
        assert len(self.results) == count
        return self.results

    def words(self, address: str, count: int = 1, station: int = 1) -> list[int]:
        table = self.plcs[station].table
        data = table.read(parse_address(address, table.plc_type), count)
        return [int.from_bytes(data[at:at + 2], 'little') for at in range(0, 2 * count, 2)]


def messages(results: list[DiagnosticStatus]) -> Counter[str]:
    return Counter(result.message for result in results)


def link_threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == 'df1 link']


def times_open(path: str) -> int:
    """Return how often this process has a file open."""
    opened = [os.path.realpath(entry) for entry in Path('/proc/self/fd').iterdir()]
    return opened.count(os.path.realpath(path))


@pytest.fixture
def make_bench(tmp_path: Path) -> Iterator[Callable[..., Bench]]:
    with ExitStack() as stack:
        yield lambda *rows, parameters=(): stack.enter_context(Bench(tmp_path, rows, *parameters))


Benches = Callable[..., Bench]


# One message, several results


def test_each_mapping_of_a_topic_has_a_result_of_its_own(make_bench: Benches) -> None:
    bench = make_bench(*LAMPS)
    bench.plcs.say('error 2 60')
    bench.publisher(msg.UInt8MultiArray, 'lamps')(1, 0)
    results = {result.name: result for result in bench.until_results(2)}
    assert (results['lamp_a'].level, results['lamp_a'].message) == (ros.OK, 'written')
    assert results['lamp_b'].level == ros.ERROR
    assert results['lamp_b'].message.startswith('not written: the PLC refused it: STS 60: ')
    assert bench.words('B3:0') == [0b010]
    assert bench.words('B3:2', station=2) == [0]


# Bursts


def test_every_pulse_of_a_burst_is_sent_in_order(
        make_bench: Benches, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(waiting, 'CARRIED_WITHIN', 15.0)  # the host may stand still
    bench = make_bench(PULSES, SPEED)
    speed = bench.ros.listen(msg.Int16MultiArray, '/abdf1/read/speed')
    publish = bench.publisher(msg.UInt8MultiArray, 'pulses')
    speed.first()
    patterns = [tuple(number >> bit & 1 for bit in range(8)) for number in range(60)]
    speed.clear()
    for begin in range(0, 60, 10):
        for pattern in patterns[begin:begin + 10]:
            publish(*pattern)
        results = bench.until_results(begin + 10)
    assert messages(results) == {'written': 60}
    assert [ros.details(result)['value'] for result in results] == [
        str(list(pattern)) for pattern in patterns]
    assert bench.words('B3:1') == [59]
    assert speed, 'no read went between 60 writes'
    status = ros.until_status(bench.diagnostics, 'writes', ros.OK,
                              lambda status: ros.details(status)['confirmed'] == '60')
    assert status.message == 'OK: 60 of 60 writes confirmed'
    assert ros.details(status)['accepted'] == '60'


def test_messages_that_dds_drops_are_counted(
        make_bench: Benches, monkeypatch: pytest.MonkeyPatch, capfd: Output) -> None:
    monkeypatch.setattr('abdf1_ros.ros.topics.messages.WRITE_DEPTH', 50)
    bench = make_bench(RECIPE)
    publish = bench.publisher(msg.Int16MultiArray, 'recipe')
    publish(0, 0)
    bench.until_results(1)
    for number in range(70):  # while nobody takes them
        publish(number, number)
    bench.until_results(51)
    writes = ros.until_status(bench.diagnostics, 'writes', ros.WARN,
                              lambda status: ros.details(status)['lost on their way'] == '20')
    assert writes.message.endswith('; 20 messages were lost on their way here')
    assert '~/write/recipe: 20 messages were lost on their way here' in capfd.readouterr().err


# Writes that do not go well

def test_results_of_all_writes_that_wait_fit_into_their_queue(make_bench: Benches) -> None:
    node = make_bench(PULSES).node
    depths = {each.topic_name: each.qos_profile.depth for each in node.publishers}
    assert depths['/abdf1/write_results'] == node.surroundings.results.waiting.maxlen == \
        waiting.MAX_WAITING_WRITES


def test_station_with_another_error_code_is_told_once(make_bench: Benches, capfd: Output) -> None:
    bench = make_bench(SPEED, parameters=('net.error_code:=BCC', 'net.timeout:=100'))
    ros.until_status(bench.diagnostics, 'station 1', ros.WARN)
    stations = bench.node.session.driver.stations
    # It goes on to come and go.
    bench.ros.until(lambda: stations[1].returns >= 5, 'more returns')
    lines = [line.partition('[abdf1]: ')[2] for line in ''.join(capfd.readouterr()).splitlines()]
    told = Counter(re.split(r'[:,]', line)[0] for line in lines
                   if line.startswith(('25', 'station')))
    assert told == {
        '2519 NTC_NAK_LIMIT_EXCEEDED': 3, '2509 ERR_INACTIVE_STATION': 2,
        'station 1 has never been heard': 1, 'station 1 answers again': 1,
        'station 1 answers polls': 1}


def test_level_that_changes_is_published_at_once(
        make_bench: Benches, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make_bench(PULSES, parameters=('snapshot_period:=0.0',))
    bench.node.link.stop()
    session, published, looks, checks = bench.node.session, [], [], []
    publisher = session.status_publisher
    publisher.publish(7.0, is_waiting=False)
    following = publisher.next_publication
    publisher.publish(following + 0.3, is_waiting=False)
    assert 7.0 < following <= 8.0
    assert publisher.next_publication == pytest.approx(following + 1.0)
    monkeypatch.setattr(publisher, 'publish', lambda *now, is_waiting: published.append(now))
    monkeypatch.setattr(session.link_counters, 'check', checks.append)
    monkeypatch.setattr(bench.node.writes.host_clock, 'look', lambda *now: looks.append(now))
    monkeypatch.setattr(bench.node.surroundings.snapshot, 'has_subscribers', pytest.fail)
    publisher.levels = session.diagnostics.levels(7.0)[::-1]
    publisher.next_publication = math.inf
    for _ in range(2):
        session.check()
    assert (len(published), len(checks), [now < wall for now, wall in looks]) == (
        1, 2, [True, True])


def test_end_waits_until_results_and_diagnostics_have_arrived(
        make_bench: Benches, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    bench = make_bench(PULSES, parameters=(f'trace_file:={tmp_path / "line.cap"}',))
    waits: list[tuple[str, float]] = []

    def wait(publisher: Publisher, timeout: Duration) -> bool:
        waits.append((publisher.topic_name, timeout.nanoseconds / 1e9))
        time.sleep(0.1)
        return False

    monkeypatch.setattr(Publisher, 'wait_for_all_acked', wait)
    end_together([bench.node], 5.0)
    (first, patience), (second, rest) = waits
    assert (first, second) == ('/abdf1/write_results', '/diagnostics')
    assert 0.0 < rest <= patience - 0.1 <= 4.9  # of a subscriber that is stuck, for both
    assert 'trace' not in {thread.name for thread in threading.enumerate()}


def test_trace_that_is_moved_goes_on_and_is_told(
        make_bench: Benches, tmp_path: Path, capfd: Output) -> None:
    trace = tmp_path / 'line.cap'
    bench = make_bench(SPEED, parameters=(f'trace_file:={trace}',))
    bench.ros.until(trace.exists, 'the capture')
    trace.rename(tmp_path / 'moved.cap')
    bench.ros.until(trace.exists, 'the next capture')
    assert bench.end() == 0
    assert re.search(rf'\[INFO\] .*: trace_file: {trace} was moved or deleted; the recording goes '
                     'on in a new file', capfd.readouterr().err)


# Maps with faults


def test_bad_row_is_told_and_left_out_and_the_rest_runs(
        make_bench: Benches, capfd: Output) -> None:
    bench = make_bench('bad_station,Read,N7:0,255,SLC,1,', 'bad_type,Read,N7:0,2,PLC9,1,',
                       'missing,Read,N99:0,1,PLC5,1,', SPEED)
    speed = bench.ros.listen(msg.Int16MultiArray, '/abdf1/read/speed')
    assert ros.values_in(speed.first()) == [0, 0]
    # What only the PLC can know shows in the diagnostics, mapping by mapping, and in the log.
    status = ros.until_status(bench.diagnostics, 'mappings', ros.ERROR, lambda status: (
        'of 2 mappings 1 failed, 1 fresh; 2 rows left out of the map, the first at '
        in status.message))
    reason = 'STS F0 EXT STS 06: address does not point to something usable'
    assert ros.details(status)['missing'] == f'failed: N99:0 at station 1, never read; {reason}'
    errors: list[str] = []

    def are_all_told() -> bool:  # the log may come after the diagnostics
        errors.extend(line for line in ''.join(capfd.readouterr()).splitlines()
                      if '[ERROR]' in line)
        return len(errors) >= 3

    bench.ros.until(are_all_told, lambda: f'three errors; got {errors}')
    *lines, told = errors
    assert told.endswith(f'missing (N99:0 at station 1): {reason}')
    assert ':2:4 (Station): 2501 ERR_BAD_STATION: Item: 1, ' in lines[0]
    assert ':3:5 (PLC_Type): 2502 ERR_BAD_PLC_TYPE: Item: 2, ' in lines[1]
    assert all(line.endswith(' (row left out)') for line in lines)
    read_topics = {name for name, _ in bench.node.get_topic_names_and_types()
                   if name.startswith('/abdf1/read/')}
    assert read_topics == {'/abdf1/read/missing', '/abdf1/read/speed'}


def test_tag_cannot_forge_lines_or_statuses(make_bench: Benches, capfd: Output) -> None:
    tag, shown = 'lamp\x0b[FATAL] all is lost\x1b[2J', r'lamp\x0b[FATAL] all is lost\x1b[2J'
    bench = make_bench(f'"{tag}",ReadWrite,N99:0,1,PLC5,1,recipe')
    assert shown in ros.details(ros.until_status(bench.diagnostics, 'mappings', ros.ERROR))
    bench.publisher(msg.Int16MultiArray, 'recipe')(1, 2)
    (result,) = bench.until_results(1)
    assert result.name == shown
    bench.node.session.end()  # rows without a value are told together, a little later
    lines = [line for line in ''.join(capfd.readouterr()).splitlines() if 'all is lost' in line]
    assert [line.split(' ')[0] for line in lines] == ['[WARN]', '[ERROR]']
    assert all(shown in line for line in lines)


# Reads


def test_every_value_of_a_long_block_is_published(make_bench: Benches) -> None:
    bench = make_bench(*[f'w{number},Read,N7:{number},1,PLC5,1' for number in range(9)])
    inboxes = [bench.ros.listen(msg.Int16MultiArray, f'/abdf1/read/w{number}')
               for number in range(9)]
    assert len(bench.node.session.driver.readings.blocks) == 1
    bench.plcs[1].table.write(parse_address('N7:0', PlcType.PLC5), bytes(range(18)))
    for number, inbox in enumerate(inboxes):
        inbox.values([0x202 * number + 0x100])


# Ends


def test_stop_ends_all_threads_and_gives_the_port_back(make_bench: Benches) -> None:
    bench = make_bench(SPEED)
    link = bench.node.link
    speed = bench.ros.listen(msg.Int16MultiArray, '/abdf1/read/speed')
    speed.first()
    assert (len(link_threads()), times_open(bench.plcs.port)) == (2, 2)
    bench.end()
    assert not link.is_alive()
    assert (len(link_threads()), times_open(bench.plcs.port)) == (1, 1)  # those of the PLCs
    assert link.state == PortState(False, 'closed')
    ros.until_status(bench.diagnostics, 'link', ros.ERROR,
                     lambda status: status.message == 'ERROR: closed')
    bench.start()  # the port is free for another one
    speed.next()


def test_bytes_that_come_are_judged_anew_at_each_opening_of_the_port(
        make_bench: Benches, monkeypatch: pytest.MonkeyPatch) -> None:
    session = make_bench(SPEED).node.session
    opened: list[bool] = []
    monkeypatch.setattr(session.diagnostics.line, 'port_opened', lambda: opened.append(True))
    for state in (PortState(False, 'lost'), PortState(True, 'open')):
        session.port_changed(state)
    assert opened == [True]


def test_end_is_not_taken_back_by_a_request(
        make_bench: Benches, monkeypatch: pytest.MonkeyPatch, capfd: Output) -> None:
    bench = make_bench(SPEED)
    session, resume = bench.node.session, bench.node.session.driver.kernel.end.resume
    session.events.unreadable(session.driver.mappings[0], 'no such file')
    monkeypatch.setattr(session.driver.kernel.end, 'resume',
                        lambda: (bench.node.begin_end(), resume()))  # it ends meanwhile
    bench.node.set_polling(SetBool.Request(data=True), SetBool.Response())
    assert 'no such file' in capfd.readouterr().err
    polling = bench.call(SetBool, 'polling', SetBool.Request(data=True))
    assert (polling.success, polling.message) == (False, 'this node ends')
    reload = bench.call(Trigger, 'reload', Trigger.Request())
    assert (reload.success, reload.message) == (False, 'this node ends')
    assert session.driver.kernel.end.is_asked
    assert not bench.node.hand_over(session.configuration)
    assert bench.node.session is session


def test_internal_errors_are_told_and_the_third_is_the_end(
        make_bench: Benches, capfd: Output) -> None:
    bench = make_bench(SPEED)
    bench.node.session.events.read = None  # a bug
    bench.ros.until(lambda: bench.node.link.has_failed, 'the third fault')
    bench.node.link.join()
    ros.until_status(bench.diagnostics, 'link', ros.ERROR, lambda status:
                     status.message.startswith('ERROR: internal error: TypeError('))
    assert ''.join(capfd.readouterr()).count('; please report it\nTraceback') == 3


# Starts that are refused


@pytest.mark.parametrize('kind', [10, 200, 255])
def test_call_that_no_client_library_would_send_is_refused_and_ends_nothing(
        make_bench: Benches, kind: int) -> None:
    bench = make_bench(SPEED)
    odd = Parameter(name='read_only', value=ParameterValue(type=kind))
    one, two = bench.call(SetParameters, 'set_parameters', SetParameters.Request(
        parameters=[odd, odd])).results
    whole = bench.call(SetParametersAtomically, 'set_parameters_atomically',
                       SetParametersAtomically.Request(parameters=[odd])).result
    for result in (one, two, whole):
        assert not result.successful
        assert f'{kind} is not a valid Parameter.Type' in result.reason


def test_service_that_fails_answers_without_success_and_a_status_that_fails_is_told(
        make_bench: Benches, monkeypatch: pytest.MonkeyPatch, capfd: Output) -> None:
    bench = make_bench(SPEED)
    monkeypatch.setattr(bench.node.session.diagnostics, 'levels', None)
    bench.node.check()
    assert 'a status has failed, all else goes on: TypeErr' in capfd.readouterr().err
    monkeypatch.setattr(bench.node.session.diagnostics.counters, 'reset', None)
    for _ in range(5):
        answer = bench.call(Trigger, 'reset_counters', Trigger.Request())
        assert (answer.success, answer.message[:17]) == (False, 'refused: TypeErro')


def test_node_whose_name_cannot_be_read_keeps_no_message_back(
        make_bench: Benches, monkeypatch: pytest.MonkeyPatch, capfd: Output) -> None:
    def names(node: Node) -> None:
        raise UnicodeDecodeError('utf-8', b'/\xff', 1, 2, 'invalid start byte')

    monkeypatch.setattr(Node, 'get_node_names_and_namespaces', names)
    bench = make_bench(RECIPE)
    bench.publisher(msg.Int16MultiArray, 'recipe')(5, 6)
    bench.until_results(1)
    assert bench.words('N7:4', 2) == [5, 6]
    assert 'a periodic check has failed, all else goes on: UnicodeDe' in capfd.readouterr().err


def test_duplicate_name_is_told_and_forgotten(make_bench: Benches, capfd: Output) -> None:
    bench = make_bench(SPEED)
    ros.until_status(bench.diagnostics, 'link', ros.OK)
    other = Node('abdf1', context=bench.ros.context, use_global_arguments=False)
    status = ros.until_status(bench.diagnostics, 'link', ros.WARN)
    assert '; another node is called /abdf1 too' in status.message
    other.destroy_node()
    bench.diagnostics.clear()
    ros.until_status(bench.diagnostics, 'link', ros.OK)
    told = ''.join(capfd.readouterr())
    assert '[abdf1]: another node is called /abdf1 too' in told
    assert 'no other node is called /abdf1 any more' in told


def test_other_node_of_our_name_is_told_before_the_first_write_is_taken(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Output) -> None:
    monkeypatch.setattr(graph, 'DISCOVERY', 2.0)
    bench = Bench(tmp_path, (RECIPE,))
    other = Node('abdf1', context=bench.ros.context, use_global_arguments=False,
                 start_parameter_services=False)
    with bench:
        bench.publisher(msg.Int16MultiArray, 'recipe')(1, 2)
        bench.ros.until(lambda: bench.node.writes.taken, 'the write')
        assert '[abdf1]: another node is called /abdf1 too' in ''.join(capfd.readouterr())
        assert bench.until_results(1)[0].message == 'written'
        other.destroy_node()


def test_messages_wait_for_the_first_look_and_have_a_result_at_an_end_before_it(
        make_bench: Benches, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(graph, 'DISCOVERY', math.inf)
    bench = make_bench(RECIPE)
    bench.publisher(msg.Int16MultiArray, 'recipe')(1, 2)
    refuse = bench.node.session.begin_end

    def refuse_after_a_while(*, is_final: bool) -> None:
        for _ in range(3):
            assert ros.get_parameters(bench.ros, 'port') == [bench.plcs.port]
        assert not bench.node.writes.taken
        refuse(is_final=is_final)

    monkeypatch.setattr(bench.node.session, 'begin_end', refuse_after_a_while)
    bench.node.begin_end()
    assert bench.until_results(1)[0].message.startswith('not written: ')


def test_end_of_another_type_on_a_topic_is_told(make_bench: Benches, capfd: Output) -> None:
    bench = make_bench(SPEED)
    said = ['']

    def is_told() -> bool:
        said[0] += capfd.readouterr().err
        return 'std_msgs/msg/Bool,' in said[0] and 'std_srvs/srv/Trigger,' in said[0]

    with ros.Observer() as other:  # a participant of its own, as one has no topic with two types
        other.node.create_subscription(msg.Bool, '/abdf1/read/speed', print, 10)
        other.node.create_client(Trigger, '/abdf1/polling')
        bench.ros.until(is_told, 'a line of the log')
    (line,) = [line for line in said[0].splitlines() if 'std_msgs/msg/Bool' in line]
    assert line.startswith('[WARN] ')
    assert '/abdf1/read/speed is std_msgs/msg/Int16MultiArray; another node uses it as' in line
    assert '/abdf1/polling is std_srvs/srv/SetBool; another node uses it as std_srvs' in said[0]


def test_publisher_of_our_topics_or_beside_them_is_told(
        make_bench: Benches, capfd: Output) -> None:
    bench = make_bench(SPEED, RECIPE)
    assert ros.until_status(bench.diagnostics, 'topics', ros.OK).message == (
        'OK: no other node publishes topics of this bridge')
    with ros.Observer('twin') as twin, ros.Observer('stub') as stub:
        # of our own name, as an earlier run that was killed
        ours = Node('abdf1', context=twin.context, use_global_arguments=False)
        ours.create_publisher(msg.Int16MultiArray, '/abdf1/read/speed', 1)
        ros.until_status(bench.diagnostics, 'link', ros.WARN)
        foreign = stub.node.create_publisher(msg.Int16MultiArray, '/abdf1/read/speed', 1)
        for topic in '/abdf1/write/speed', '/write/recipe':
            stub.node.create_publisher(msg.Int16MultiArray, topic, 1)
        status = ros.until_status(
            bench.diagnostics, 'topics', ros.ERROR, lambda status: 'recipe' in status.message)
        assert status.message == (
            'ERROR: /stub publishes /abdf1/read/speed too; used, but not there: '
            '/abdf1/write/speed, /write/recipe')
        assert ros.details(status) == {
            '/abdf1/read/speed': 'is published by /stub too',
            '/abdf1/write/speed': 'is published by /stub, but not written: speed is only read',
            '/write/recipe': 'is published by /stub, but not written: this bridge takes '
                             '/abdf1/write/recipe'}
        stub.node.destroy_publisher(foreign)
        ros.until_status(bench.diagnostics, 'topics', ros.WARN)
        ours.destroy_node()
    ros.until_status(bench.diagnostics, 'topics', ros.OK)
    told = [line for line in capfd.readouterr().err.splitlines() if '/stub' in line]
    assert [line.partition(' ')[0] for line in told] == ['[ERROR]', '[WARN]', '[WARN]']


def test_subscriber_and_client_of_what_there_is_not_are_told(
        make_bench: Benches, capfd: Output) -> None:
    bench = make_bench(SPEED, RECIPE)
    with ros.Observer('stub') as stub:
        for topic in '/abdf1/read/speed', '/abdf1/read/sped', '/abdf1/read/recipe':
            stub.node.create_subscription(msg.Int16MultiArray, topic, Mock(), 1)
        for name in '/abdf1/read_now/speed', '/abdf1/read_now/sped':
            stub.node.create_client(Trigger, name)
        status = ros.until_status(
            bench.diagnostics, 'topics', ros.WARN, lambda status: len(status.values) == 3)
        assert ros.details(status) == {
            '/abdf1/read/sped': 'is subscribed to by /stub, but not published: no row reads this '
                                'topic',
            '/abdf1/read/recipe': 'is subscribed to by /stub, but not published: recipe is only '
                                  'written',
            '/abdf1/read_now/sped': 'is called by /stub, but not offered: only rows that are read '
                                    'have it, within most_services; none has in Mode Listen'}
    ros.until_status(bench.diagnostics, 'topics', ros.OK)
    told = [line for line in capfd.readouterr().err.splitlines() if '/stub' in line]
    assert [line.split()[0] for line in told] == 3 * ['[WARN]']


def test_two_writers_of_a_topic_can_tell_their_results_apart(make_bench: Benches) -> None:
    bench = make_bench(RECIPE)
    publisher = bench.ros.publisher(msg.Int16MultiArray, '/abdf1/write/recipe')
    for label, values in ((200 * 'robot', [1, 2]), ('robot_2\x07', [1])):
        layout = msg.MultiArrayLayout(dim=[msg.MultiArrayDimension(label=label)])
        publisher.publish(msg.Int16MultiArray(layout=layout, data=values))
    before = time.time_ns()
    publisher.publish(msg.Int16MultiArray(data=[3, 4]))
    requests = [ros.details(result)['request'] for result in bench.until_results(3)]
    number, = {*requests} - {200 * 'robot', r'robot_2\x07'}
    assert len(requests) == 3
    assert before <= int(number) <= time.time_ns()


def test_simulated_time_that_has_not_begun_is_not_put_into_stamps(make_bench: Benches) -> None:
    bench = make_bench(SPEED, parameters=('use_sim_time:=true',))
    stamp = bench.diagnostics.next().header.stamp
    assert abs(stamp.sec - time.time()) < 60


def test_simulated_time_is_put_into_stamps_once_it_has_begun(make_bench: Benches) -> None:
    bench = make_bench(SPEED, parameters=('use_sim_time:=true',))
    clock = bench.ros.node.create_publisher(Clock, '/clock', 10)

    def is_simulated() -> bool:
        clock.publish(Clock(clock=Time(sec=100)))
        return bool(bench.diagnostics) and bench.diagnostics[-1].header.stamp.sec == 100

    bench.ros.until(is_simulated, 'a stamp of simulated time')


def test_odd_settings_are_told_in_the_log_but_not_without_end(
        make_bench: Benches, capfd: Output) -> None:
    make_bench(*(f'N7:{number},Read,N7:{number},1,PLC5,1,' for number in range(23)))
    warnings = [line for line in ''.join(capfd.readouterr()).splitlines() if 'WARN' in line]
    assert warnings[0].endswith('map.csv:2:1 (Tag): Tag "N7:0" becomes the topic N7_0')
    assert len(warnings) == 21
    assert warnings[-1].endswith('and 3 more remarks; "check" has them all')


def test_load_that_the_line_cannot_carry_is_told_before_other_remarks(
        make_bench: Benches, capfd: Output) -> None:
    rows = [f'N{number}:7,Read,N{number}:0,1,PLC5,1,' for number in range(10, 29)]
    make_bench(*rows, parameters=('default_period:=50',))
    warnings = [line for line in ''.join(capfd.readouterr()).splitlines() if 'WARN' in line]
    assert re.search(r'the periods need \d+% of the time of the line at \d+ baud', warnings[0])
    assert '; or Period ' in warnings[0] and len(warnings) == 20


@pytest.mark.parametrize(('given', 'is_told'), [((), False), (('true',), True)])
def test_reset_of_all_slaves_is_told_where_it_is_forced(
        make_bench: Benches, capfd: Output, given: tuple[str, ...], is_told: bool) -> None:
    make_bench('a,Read,N7:0,1,PLC5,1,', 'b,Serve,N7:9,5,PLC5,1,', parameters=tuple(
        f'nak_on_command_timeout:={value}' for value in given))
    told = ''.join(capfd.readouterr())
    assert ('nak_on_command_timeout: each overdue reply makes all slaves drop what they have '
            'queued: messages of slaves for b\n' in told) is is_told


def test_map_without_a_row_is_told(make_bench: Benches, capfd: Output) -> None:
    make_bench(parameters=('map.gate.max:=7', 'read_only:=true'))
    told = ''.join(capfd.readouterr())
    assert 'the map has no usable row' in told and 'read_only: no heartbeat' not in told
    assert 'without effect, because only the map file counts: map.gate.max\n' in told


def test_each_faulty_parameter_is_told_in_one_line(refusal: Callable[..., list[str]]) -> None:
    lines = refusal(*ros.ros_args(
        *ros.EXAMPLE_FILES, 'net_file:=/nowhere/net.csv', 'diagnostics_period:=abc', 'gain:=3'))
    assert [re.sub(r' \[[0-9.]+\]', '', line) for line in lines] == [
        f'[FATAL] [abdf1]: {text}' for text in (
            'parameter gain: there is no such parameter; another version may have it',
            "parameter diagnostics_period: diagnostics_period = 'abc' should be a number from 0.1 "
            'to 60', '/nowhere/net.csv: cannot be read: No such file or directory')]


def test_two_topics_that_remaps_give_one_name_are_told_at_the_start(
        refusal: Callable[..., list[str]]) -> None:
    line, = refusal(*ros.ros_args(*ros.EXAMPLE_FILES), '-r', '~/read/door_closed:=/cell/bits',
                    '-r', '/abdf1/read/cell_interlocks:=/cell/bits')
    assert re.sub(r' \[[0-9.]+\]', '', line) == (
        '[FATAL] [abdf1]: remaps: ~/read/cell_interlocks, ~/read/door_closed have one name, '
        '/cell/bits; give each topic a name of its own')


@pytest.mark.parametrize(('arguments', 'expected'), [
    (['--ros-args', '-r', '__node:=a-b'], 'a node name has letters, digits and underscores; '),
    (['--ros-args', '-p', 'net_file=net.csv'], 'a parameter is NAME:=VALUE, with a colon; '),
    (['--ros-args', '-p', 'net_file:='],
     "a parameter has no value; for an empty text write NAME:=''; "),
    (['--ros-args', 'net_file:=x'], '-p is missing before '),
    (['--ros-args', '-p', 'net.share:=[pty:/tmp/a]'],
     'put quotes around a text with [ or :; '),
    (['--ros-args', '--help'], 'write this before --ros-args: '),
    (['--ros-args', '-r', '__ns:=cell'], 'a namespace begins with "/"; '),
    (['--ros-args', '-r', '__ns:=/cell//x'], 'a namespace has names of letters, digits and '
     'underscores, each after one "/", and no "/" at its end; '),
    (['--ros-args', '-r', '__ns:=/cell/'], 'a namespace has names of letters, digits and '
     'underscores, each after one "/", and no "/" at its end; '),
    (['--ros-args', '__ns:=/cell'], '-r is missing before '),
    (['--ros-args', '--log-level', 'verbose'],
     'a level is debug, info, warn, error or fatal, for one logger NAME:=LEVEL; '),
    (['--ros-args', '-p'], ''),
    (['--ros-args', '--bogus'], ''),
    (['--ros-args', '-r', f'__ns:=/{240 * "n"}'], ''),
    (['--ros-args', '-r', f'__ns:=/{300 * "n"}'], ''),
    (['--ros-args', '-r', f'__node:={256 * "n"}'], '')],
    ids=['remap', 'colon', 'empty', 'bare', 'list', 'help', 'namespace', 'slashes', 'end',
         'bare_name', 'level', 'parameter', 'unknown', 'topic', 'long', 'name'])
def test_unusable_arguments_are_told_in_one_line(
        refusal: Callable[..., list[str]], arguments: list[str], expected: str) -> None:
    """What follows our words is a text of rcl, which differs between versions of ROS."""
    lines = refusal(*arguments)
    (line,) = [line for line in lines if line.startswith('abdf1: ')]
    assert line.startswith(f'abdf1: bad arguments: {expected}')
    assert 'Traceback' not in ' '.join(lines)


def test_file_of_parameters_without_ros_parameters_is_told_its_first_lines(
        refusal: Callable[..., list[str]], tmp_path: Path) -> None:
    file = tmp_path / 'parameters.yaml'
    file.write_text('abdf1:\n  net_file: net.csv\n')
    assert refusal('--ros-args', '--params-file', str(file))[0].startswith(
        'abdf1: bad arguments: a file of parameters begins with the lines "/**:" and '
        '"  ros__parameters:"; ')


@pytest.mark.parametrize(('option', 'hint'), [
    ('--log-lvl', '; did you mean --log-level?'),
    ('--params-flie', '; did you mean --params-file?'),
    ('--disable-rosout-log', '; did you mean --disable-rosout-logs?'), ('--bogus', '')])
def test_unknown_option_of_ros_is_told_with_the_option_that_may_be_meant(
        refusal: Callable[..., list[str]], option: str, hint: str) -> None:
    assert refusal('--ros-args', option, 'x') == [f"abdf1: bad arguments: ['{option}', 'x']{hint}"]


def test_security_that_ros_may_leave_out_is_told(
        refusal: Callable[..., list[str]], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('ROS_SECURITY_ENABLE', 'true')
    monkeypatch.setenv('ROS_SECURITY_KEYSTORE', '')
    first, *_ = refusal(*ros.ros_args(*ros.EXAMPLE_FILES, 'gain:=3'))
    assert first.startswith('[WARN] [')
    assert 'ROS_SECURITY_STRATEGY is not Enforce: if ROS finds no keys, it starts without' in first
    monkeypatch.setenv('ROS_SECURITY_STRATEGY', 'Enforce')
    assert refusal(status=1) == [
        'abdf1: ROS does not start: failed to initialize rcl: error not set; ROS_SECURITY_ENABLE '
        'is true: set ROS_SECURITY_KEYSTORE, too']


def test_what_may_pass_at_the_start_has_the_status_of_a_fault(
        refusal: Callable[..., list[str]], monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**named: object) -> None:
        raise rclpy_implementation.RCLError('error creating participant:\n  no network')

    monkeypatch.setattr('rclpy.init', refuse)
    monkeypatch.setenv('ROS_SECURITY_ENABLE', 'true')
    assert refusal(status=1) == [
        'abdf1: ROS does not start: error creating participant: no network']
