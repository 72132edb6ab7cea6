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

"""The interlock consumer, beside a bridge that loses its PLC and its life."""

from collections.abc import Callable, Iterator
import importlib.util
from pathlib import Path
import signal

import pytest
import rclpy
from rclpy import event_handler
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile
from std_msgs.msg import MultiArrayDimension, MultiArrayLayout, UInt8MultiArray
from std_srvs.srv import Trigger
from support.ros import Observer, Process
from support.ros_tools import SOURCE
from support.simulator_process import Files, make_files

EXAMPLE = SOURCE / 'examples' / 'interlock_consumer.py'
_SPEC = importlib.util.spec_from_file_location('interlock_consumer', EXAMPLE)
assert _SPEC is not None and _SPEC.loader is not None
EXAMPLE_MODULE = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(EXAMPLE_MODULE)
PATIENCE_ARGUMENTS = ('--patience', '1.5')

PERMITTED = 'PERMITTED: the PLC permits'
WAITING = 'not permitted: the PLC permits; waiting for a reset'
REFUSED = 'not permitted: bit 1 is 0'
STARTING = 'not permitted: no value yet'
SILENT = 'not permitted: nothing heard since the start: no node publishes /nobody/read/bits'
STOPPED = 'not permitted: values have stopped'


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return make_files(tmp_path)


@pytest.fixture
def simulator(files: Files) -> Iterator[Process]:
    with files.start_simulator() as simulator:
        yield simulator


def consumer(topic: str, bits: str = '0', name: str = 'cell', *more: str) -> Process:
    return Process(EXAMPLE, '--topic', topic, '--bits', bits, *PATIENCE_ARGUMENTS,
                   '--ros-args', '-r', f'__node:={name}', *more)


def reset(observer: Observer, name: str = 'cell') -> tuple[bool, str]:
    answer = observer.call(Trigger, f'/{name}/reset', Trigger.Request())
    return answer.success, answer.message


# A simulation's clock that does not run holds up nothing.
@pytest.mark.parametrize('more', [(), ('-p', 'use_sim_time:=true')])
def test_nothing_is_permitted_while_there_is_no_bridge(more: tuple[str, ...]) -> None:
    with Observer() as observer, consumer('/nobody/read/bits', '0', 'cell', *more) as cell:
        cell.wait_for(SILENT)
        assert reset(observer) == (False, SILENT.replace('permitted', 'reset'))
        cell.end(signal.SIGTERM)
    assert cell.lines == [STARTING, SILENT]


def test_bit_of_the_plc_decides(files: Files, simulator: Process) -> None:
    with Observer() as observer, \
            Process('node', *files.args(), '-r', '__node:=deciding') as node, \
            consumer('/deciding/read/bits', '0', 'set') as set_bit, \
            consumer('/deciding/read/bits', '0,1', 'clear') as clear_bit, \
            consumer('/deciding/read/bits', '0,6', 'beyond') as beyond:
        set_bit.wait_for(WAITING)
        clear_bit.wait_for(REFUSED)
        beyond.wait_for('not permitted: the message has no bit 6; is its Length right?')
        assert reset(observer, 'clear') == (False, 'not reset: bit 1 is 0')
        assert not reset(observer, 'beyond')[0]
        assert reset(observer, 'set') == (True, '')
        set_bit.wait_for(PERMITTED)
        for cell in (set_bit, clear_bit, beyond):
            cell.end()
            assert cell.lines[0] == STARTING
        node.end()
    assert PERMITTED not in clear_bit.lines + beyond.lines


def bits_of(*values: int, address: str = 'B3:0/0') -> UInt8MultiArray:
    dimension = MultiArrayDimension(label=address)
    return UInt8MultiArray(layout=MultiArrayLayout(dim=[dimension]), data=values)


@pytest.mark.parametrize('latches', [False, True])
def test_permit_comes_back_by_itself_only_where_that_is_wanted(latches: bool) -> None:
    rclpy.init(args=[])
    try:
        cell = EXAMPLE_MODULE.InterlockConsumer(
            '/nobody/read/bits', [0, 1], 2.0, latches=latches, address='B3:0/0')
        cell.receive(bits_of(1, 1))
        assert cell.reset(Trigger.Request(), Trigger.Response()).success
        cell.receive(bits_of(1, 1))
        assert cell.permitted
        cell.receive(bits_of(1, 0))
        assert not cell.permitted
        for other in (bits_of(1, 1, address='B3:20/0'), UInt8MultiArray(data=[1, 1])):
            cell.receive(other)
            assert not cell.permitted
        cell.receive(bits_of(1, 1))
        assert cell.permitted is not latches
        cell.publishers_changed(-1)  # its change to 1 went to others
        assert not cell.permitted
        cell.destroy_node()
    finally:
        rclpy.shutdown()


def test_subscriber_that_is_told_of_changes_only_notices_a_second_publisher_too() -> None:
    rclpy.init(args=[])
    try:
        cell = EXAMPLE_MODULE.InterlockConsumer('/nobody/read/bits', [0], 2.0)
        cell.receive(bits_of(1))
        assert cell.reset(Trigger.Request(), Trigger.Response()).success
        cell.receive(bits_of(1))
        assert cell.permitted
        cell.publishers_changed(1)  # of the bridge it was not told
        assert not cell.permitted
        assert not cell.reset(Trigger.Request(), Trigger.Response()).success
        cell.receive(bits_of(1))
        assert not cell.permitted, 'a person has to reset'
        cell.destroy_node()
    finally:
        rclpy.shutdown()


def unsupported(**kwargs: object) -> None:
    """Refuse an event, as rmw_zenoh refuses deadlines and liveliness."""
    raise event_handler.UnsupportedEventTypeError('not supported')


def test_silence_takes_the_permit_where_the_rmw_has_no_events(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(event_handler, 'EventHandler', unsupported)
    rclpy.init(args=[])
    try:
        cell = EXAMPLE_MODULE.InterlockConsumer('/nobody/read/bits', [0], 0.3)
        for _ in range(2):
            cell.receive(bits_of(1))
            assert not cell.permitted, 'a person has to reset'
            assert cell.reset(Trigger.Request(), Trigger.Response()).success
            cell.receive(bits_of(1))
            assert cell.permitted
            for _ in range(100):
                if not cell.permitted:
                    break
                rclpy.spin_once(cell, timeout_sec=0.1)
            assert not cell.permitted
        cell.destroy_node()
    finally:
        rclpy.shutdown()


def test_second_publisher_takes_the_permit_where_the_rmw_has_no_events(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(event_handler, 'EventHandler', unsupported)
    rclpy.init(args=[])
    try:
        cell = EXAMPLE_MODULE.InterlockConsumer('/nobody/read/bits', [0], 60.0)
        node = rclpy.create_node('stubs')
        bridge = stub_on(node, '/nobody/read/bits')

        def receives(condition: Callable[[], bool]) -> bool:
            for _ in range(400):
                bridge.publish(bits_of(1))
                rclpy.spin_once(cell, timeout_sec=0.1)
                if condition():
                    return True
            return False

        assert receives(lambda: cell.reset(Trigger.Request(), Trigger.Response()).success)
        assert receives(lambda: cell.permitted)
        stub = stub_on(node, '/nobody/read/bits')
        assert receives(lambda: not cell.permitted)
        assert not cell.reset(Trigger.Request(), Trigger.Response()).success
        node.destroy_publisher(stub)
        assert receives(lambda: cell.reset(Trigger.Request(), Trigger.Response()).success)
        node.destroy_node()
        cell.destroy_node()
    finally:
        rclpy.shutdown()


def test_loss_of_the_plc_takes_the_permit_until_a_person_resets(
        files: Files, simulator: Process) -> None:
    with Observer() as observer, \
            Process('node', *files.args(), '-r', '__node:=losing') as node, \
            consumer('/losing/read/bits') as cell:
        cell.wait_for(WAITING)
        assert reset(observer) == (True, '')
        cell.wait_for(PERMITTED)
        after = len(cell.lines)
        simulator.say('silent 1')
        assert cell.wait_for('not permitted', after=after) == STOPPED
        assert reset(observer) == (False, 'not reset: values have stopped')
        simulator.say('normal 1')
        cell.wait_for(WAITING, after=after)
        assert cell.lines[after:] == [STOPPED, WAITING]
        cell.end()
        node.end()


def stub_on(node: Node, topic: str) -> Publisher:
    """Return a publisher with the QoS of a bridge, as in a forgotten test or a recording."""
    second = Duration(seconds=1)
    return node.create_publisher(UInt8MultiArray, topic, QoSProfile(
        depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, deadline=second, lifespan=second,
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC, liveliness_lease_duration=second))


def test_second_publisher_takes_the_permit_until_it_has_gone_and_a_person_resets(
        files: Files, simulator: Process) -> None:
    crowd = 'the topic has 2 publishers'
    with Observer() as observer, \
            Process('node', *files.args(), '-r', '__node:=crowded') as node, \
            consumer('/crowded/read/bits', '0', 'open') as cell, \
            consumer('/crowded/read/bits', '0,1', 'shut') as shut:
        cell.wait_for(WAITING)
        shut.wait_for(REFUSED)
        assert reset(observer, 'open') == (True, '')
        cell.wait_for(PERMITTED)
        stub = stub_on(observer.node, '/crowded/read/bits')
        timer = observer.node.create_timer(
            0.1, lambda: stub.publish(bits_of(1, 1, 1, 1, 1, 1, address='B3:0/2')))
        observer.until(
            lambda: cell.lines[-1] == shut.lines[-1] == f'not permitted: {crowd}', crowd)
        for name in ('open', 'shut'):
            assert reset(observer, name) == (False, f'not reset: {crowd}')
        timer.cancel()  # its lease ends, as that of a program that was killed
        after = len(cell.lines)
        cell.wait_for(WAITING, after=after)
        assert reset(observer, 'open') == (True, '')
        cell.wait_for(PERMITTED, after=after)
        for process in (cell, shut, node):
            process.end()
    assert PERMITTED not in shut.lines
    assert cell.lines.count(PERMITTED) == 2
    assert cell.lines.count(WAITING) == 2


def test_kill_of_the_bridge_takes_the_permit_and_its_restart_does_not_give_it_back(
        files: Files, simulator: Process) -> None:
    arguments = (*files.args(), '-r', '__node:=restarted')
    with Observer() as observer, consumer('/restarted/read/bits') as cell:
        with Process('node', *arguments) as node:
            cell.wait_for(WAITING)
            reset(observer)
            cell.wait_for(PERMITTED)
            node.send(signal.SIGKILL)
            cell.wait_for(STOPPED)
        after = len(cell.lines)
        with Process('node', *arguments) as node:
            assert cell.wait_for('', after=after) == WAITING
            node.end()
        cell.end()


def test_bridge_that_does_not_promise_enough_permits_nothing(
        files: Files, simulator: Process) -> None:
    with Process('node', *files.args('stale_after:=30'), '-r', '__node:=slow') as node, \
            consumer('/slow/read/bits') as cell:
        reason = cell.wait_for('not permitted: the bridge does not promise a value every 1.5 s')
        cell.end()
        node.end()
    assert cell.lines[-1] == reason  # silence is no news then


@pytest.mark.parametrize(('args', 'text'), [
    (('--bits', '0,-1'), '"0,-1" should be whole numbers from 0, as in 0,1,2'),
    (('--patience', '0'), '"0" should be a number of seconds above 0'),
    (('--topic', 'a b'), 'topic name must not contain'),
])
def test_bad_arguments_are_refused(args: tuple[str, ...], text: str) -> None:
    with Process(EXAMPLE, *args) as cell:
        assert cell.result() == 2
    assert text in cell.text
    assert 'Traceback' not in cell.text
