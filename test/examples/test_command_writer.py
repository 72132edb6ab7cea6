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

"""The command writer, against a bridge with a simulator and against one that only listens."""

import argparse
from collections.abc import Callable, Iterator
import runpy
import sys
import threading

from abdf1_ros.driver.writes.packets import REWRITTEN
from abdf1_ros.ros.observer import graph_hint
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import pytest
from std_msgs.msg import Int16MultiArray
from support.cases import for_all
from support.commands import call, Output
from support.ptys import wait_until
from support.ros import Observer, Process
from support.ros_tools import SOURCE
from support.simulator_process import Files, make_files

EXAMPLE = SOURCE / 'examples' / 'command_writer.py'
OURS = 'the request that has been sent'


@pytest.fixture(scope='module')
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    return make_files(tmp_path_factory.mktemp('writer'))


@pytest.fixture(scope='module')
def bridge(files: Files) -> Iterator[Process]:
    with files.start_simulator(), Process('node', *files.args(), '-r', '__ns:=/writing') as node:
        node.wait_for(f'{files.port}: open')
        yield node
        node.end()


Write = Callable[..., tuple[int, list[str]]]


@pytest.fixture
def write(capsys: Output, monkeypatch: pytest.MonkeyPatch) -> Write:
    """Return what runs the example, and returns exit status and lines."""
    main = runpy.run_path(str(EXAMPLE))['main']

    def run(*args: str, node: str = '/writing/abdf1') -> tuple[int, list[str]]:
        monkeypatch.setattr(sys, 'argv', ['command_writer', '--timeout', '15', *args,
                                          '--node', node])
        said = call(lambda _: main(), capsys)
        return said.status, [*said.out.splitlines(), *said.err.splitlines()]

    return run


@pytest.mark.parametrize('words', [
    ('recipe', '1', '2', '3', '4'), ('setpoint', '0.1'), ('name', 'Tank', '5'), ('lamp', '1'),
    ('digits', '0x10', '99')])
def test_value_that_the_plc_has_taken_is_written(
        bridge: Process, write: Write, words: tuple[str, ...]) -> None:
    status, (line,) = write(*words)
    assert status == 0, line
    assert line.startswith(f'{words[0]}: written (')


def test_value_that_the_bridge_refuses_is_not_written(bridge: Process, write: Write) -> None:
    status, (line,) = write('recipe', '1', '2', '3', '5000')
    assert status == 1
    assert line.startswith('recipe: not written: refused: value 5000 at index 3')


def test_nobody_who_listens_is_not_written(write: Write) -> None:
    assert write('recipe', '1', '--timeout', '0.5', node='/nobody') == (
        1, ['not written: there is no node /nobody'])


@pytest.mark.parametrize('name', ['command_writer', 'recorder'])
def test_client_of_a_discovery_server_is_told_what_it_lacks(
        monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    hint = runpy.run_path(str(EXAMPLE.with_stem(name)))['hint']
    monkeypatch.setenv('ROS_DISCOVERY_SERVER', '127.0.0.1:11811')
    monkeypatch.delenv('ROS_SUPER_CLIENT', raising=False)
    assert hint() == graph_hint() == '; ROS_DISCOVERY_SERVER is set: set ROS_SUPER_CLIENT=TRUE too'
    monkeypatch.setenv('ROS_SUPER_CLIENT', 'TRUE')
    assert not hint()


@pytest.mark.parametrize('name', [
    'command_writer', 'handshake', 'interlock_consumer', 'night', 'recorder'])
def test_examples_wait_for_a_time_that_ends(name: str) -> None:
    seconds = runpy.run_path(str(EXAMPLE.with_stem(name)))['seconds']
    assert seconds('0.5') == 0.5
    for text in 'nan', 'inf', '-1', '0', 'x':
        with pytest.raises(argparse.ArgumentTypeError, match=f'"{text}" should be a number of'):
            seconds(text)


@pytest.mark.parametrize(('words', 'text'), [
    (('recipe', '1', '2', '3', 'x'), '1 2 3 x: cannot be sent: "x" should be a whole number'),
    (('recipe', '1', '2', '3', '70000'), '1 2 3 70000: cannot be sent: signed short integer'),
    (('a b', '1'), "1: cannot be sent: topic name '/writing/abdf1/write/a b' is invalid")])
def test_what_is_no_value_is_refused(
        bridge: Process, write: Write, words: tuple[str, ...], text: str) -> None:
    status, (line,) = write(*words)
    assert status == 2
    assert line.startswith(text)


# A bridge that answers as the test wants

Answer = Callable[[list[int]], list[tuple[str, str, str]]]

Answered = Callable[..., tuple[int, list[str]]]


@pytest.fixture
def answered(write: Write) -> Iterator[Answered]:
    """Return what writes 7 to lamps; its ``answer`` gives tag, text and value of each result."""
    with Observer() as observer:
        results = observer.node.create_publisher(DiagnosticStatus, '/fake/write_results', 10)
        diagnostics = observer.node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        stations = {'station 1': 'heartbeat counts (for 2.0 s)',
                    'station 2': 'not in control: no message of speed in time',
                    'station 4': 'in control for 1.0 s',
                    'station 5': 'unknown: in_control is stale'}
        status = DiagnosticStatus(name='fake: interlocks', values=[
            KeyValue(key=key, value=value) for key, value in stations.items()])
        other = DiagnosticStatus(name='other/fake: interlocks', values=[
            KeyValue(key=key, value='in control for 9.0 s') for key in stations])
        foreign = DiagnosticStatus(name='lamps', message='not written: refused', values=[
            KeyValue(key='request', value='/command_writer 1')])
        observer.node.create_timer(0.1, lambda: [
            diagnostics.publish(DiagnosticArray(status=[status, other])),
            results.publish(foreign)])
        answers: list[Answer] = []

        def take(message: Int16MultiArray) -> None:
            # DDS may find one end of a process later than the other, and nothing is kept for it.
            wait_until(lambda: results.get_subscription_count() > 0)
            label = message.layout.dim[0].label
            for tag, text, request in answers[-1](list(message.data)):
                pairs = [KeyValue(key='request', value=label if request == OURS else request),
                         KeyValue(key='latency_ms', value='1.0')]
                results.publish(DiagnosticStatus(name=tag, message=text, values=pairs))

        def run(answer: Answer, *args: str) -> tuple[int, list[str]]:
            answers.append(answer)
            return write('lamps', '7', *args, node='/fake')

        observer.node.create_subscription(Int16MultiArray, '/fake/write/lamps', take, 10)
        turning = threading.Thread(target=observer.executor.spin)
        turning.start()
        yield run
        observer.executor.shutdown()
        turning.join()


def test_results_of_other_mappings_and_other_writers_are_not_taken(answered: Answered) -> None:
    status, lines = answered(lambda data: [
        ('recipe', 'not written: refused', OURS), ('lamps', 'written', OURS),
        ('lamps', 'unknown whether written', OURS)])
    assert (status, lines) == (0, ['lamps: written (1.0 ms)'])


def test_every_mapping_of_the_topic_has_to_be_written(answered: Answered) -> None:
    tags = ('--tags', 'north', 'south')
    assert answered(lambda data: [('north', 'written', OURS), ('south', 'written', OURS)],
                    *tags)[0] == 0
    status, lines = answered(lambda data: [('north', 'written', OURS)], *tags, '--timeout', '1.5')
    assert (status, lines) == (
        3, ['north: written (1.0 ms)', 'unknown whether written: no result within 1.5 s'])


@for_all(('message', 'status'), [
    ('written', 0), (f'written: {REWRITTEN}', 0), ('not written: superseded by a newer value', 1),
    ('not written: the PLC refused it: STS 10', 1), ('only partly written: ...', 3),
    ('unknown whether written: ...', 3),
    ('sent to all stations; no station confirms a broadcast', 3)])
def test_text_of_a_result_decides_the_exit_status(message: str, status: int) -> None:
    assert runpy.run_path(str(EXAMPLE))['judge'](message) == status


@pytest.mark.parametrize(('station', 'expected'), [
    ('1', (0, ['lamps: written (1.0 ms)'])),
    ('2', (1, ['not written: ROS is not in control of station 2: no message of speed in time'])),
    ('3', (1, ['not written: ROS is not in control of station 3: the bridge has no heartbeat '
               'there'])),
    ('4', (0, ['lamps: written (1.0 ms)'])),
    ('5', (1, ['not written: ROS is not in control of station 5: unknown: in_control is stale']))])
def test_command_goes_only_to_a_plc_that_ros_is_in_control_of(
        answered: Answered, station: str, expected: tuple[int, list[str]]) -> None:
    assert answered(lambda data: [('lamps', 'written', OURS)], '--station', station) == expected
