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

"""The handshake of a job, against a PLC as this test plays it on the topics of a bridge."""

from collections.abc import Callable
from pathlib import Path
import re
import runpy
import signal
import threading

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
import pytest
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile
from std_msgs.msg import Int16MultiArray, UInt8MultiArray
from support.cases import for_all
from support.ros import Observer, Process

EXAMPLE = Path(__file__).resolve().parents[2] / 'examples' / 'handshake.py'
HANDSHAKE = runpy.run_path(str(EXAMPLE))

STATES = QoSProfile(
    depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL,
    liveliness=LivelinessPolicy.MANUAL_BY_TOPIC, liveliness_lease_duration=Duration(seconds=1))

Plc = Callable[[int, list[int]], None]
"""Is given a request and changes the words busy and done."""


def run(plc: Plc, state: list[int], *args: str, result: str = 'written',
        control: list[int] | None = None, stub: list[int] | None = None,
        ) -> tuple[int, list[str], list[int]]:
    """
    Return exit status and lines of the example, and the requests that came.

    ``result`` is that of each; what is not written does not come to the PLC. ``control`` is the
    bit that says whether the PLC uses what is written. ``stub`` is the state that a second node
    publishes: from the begin on, or from the first request on if it says that job 5 is done. An
    empty ``state`` is not published.
    """
    requests: list[int] = []
    with Observer() as observer:
        states = observer.node.create_publisher(Int16MultiArray, '/fake/read/job_state', STATES)
        results = observer.node.create_publisher(DiagnosticStatus, '/fake/write_results', 10)
        controls = observer.node.create_publisher(UInt8MultiArray, '/fake/read/control', STATES)
        controls.publish(UInt8MultiArray(data=control or [1]))

        def publish() -> None:
            if state:
                states.publish(Int16MultiArray(data=state))
            if stub is not None and (stub != [5, 5] or requests):
                stubs.publish(Int16MultiArray(data=stub))

        if stub is not None:
            stubs = observer.node.create_publisher(Int16MultiArray, states.topic_name, STATES)
        publish()
        observer.node.create_timer(0.1, publish)

        def take(message: Int16MultiArray) -> None:
            requests.append(message.data[0])
            if result != 'written' and len(requests) == 3:  # its host stands still
                example.stop()
                threading.Timer(3.0, example.go_on).start()
            before = [*state]
            if control == [1]:  # it is lost as soon as something is asked for
                controls.publish(UInt8MultiArray(data=[0]))
            told = [('recipe', 'written', 0), ('job_request', result, message.data[0])]
            if result == 'written':
                plc(message.data[0], state)
            else:  # what comes late confirms nothing
                late = ('fallback value written', 0) if message.data[0] else ('written', 5)
                told.insert(1, ('job_request', *late))
            for name, text, value in told:
                results.publish(DiagnosticStatus(name=name, message=text, values=[
                    KeyValue(key='value', value=f'[{value}]')]))
            if before:
                states.publish(Int16MultiArray(data=before))  # the bridge had read it already

        observer.node.create_subscription(Int16MultiArray, '/fake/write/job_request', take, 10)
        with Process(EXAMPLE, '--node', '/fake', '--patience', '1', *args) as example:
            observer.until(lambda: not example.is_running, 'the example to end')
            observer.until(lambda: not requests or not requests[-1], 'its last request, a 0')
            return example.result(), example.lines, requests


def test_job_is_done_when_the_plc_has_its_number() -> None:
    def work(request: int, state: list[int]) -> None:
        if request and state[0] != request:
            state[0] = request
        elif request:
            state[1] = request

    status, lines, requests = run(work, [4, 4], '--begin-within', '10')
    assert (status, lines) == (0, ['job 5 requested', 'job 5 has begun', 'job 5: done'])
    assert requests[0] == 5


def test_done_of_the_job_before_counts_for_nothing() -> None:
    status, lines, requests = run(lambda request, state: None, [4, 4], '--begin-within', '2')
    assert (status, lines[-2:]) == (1, [
        'job 5: the PLC has not begun; request: written', 'job 5: the PLC has not begun'])
    assert requests[-1] == 0  # the request has been taken back
    assert requests.count(5) > 2  # it is steady until then


def test_job_that_begins_when_it_is_given_up_is_not_lost() -> None:
    def begin_late(request: int, state: list[int]) -> None:
        if not request:
            state[:] = [5, 5]

    status, lines, _ = run(begin_late, [4, 4], '--begin-within', '2')
    assert (status, lines[-1]) == (0, 'job 5: done')


def test_request_that_nobody_confirms_leaves_it_unknown() -> None:
    status, lines, _ = run(lambda request, state: None, [4, 4], '--begin-within', '2',
                           result='unknown whether written: no reply')
    assert (status, lines[-2:]) == (3, [
        'job 5: the PLC has not begun; request: unknown whether written: no reply',
        'job 5: unknown whether it begins: the request is not taken back'])


def test_nothing_is_asked_for_while_another_job_is_under_way() -> None:
    status, lines, requests = run(lambda request, state: None, [1, 32767])
    assert (status, lines, requests) == (1, ['not begun: the PLC is busy with job 1'], [])


def test_nothing_is_asked_for_while_ros_is_not_in_control() -> None:
    status, lines, requests = run(
        lambda request, state: None, [4, 4], '--control', 'control', '--begin-within', '0.5',
        control=[0])
    assert (status, requests) == (1, [])
    assert lines == ['not begun: ROS is not in control of the PLC. If /diagnostics says that the '
                     'heartbeat counts, a person has to press reset there; otherwise it says why '
                     'not']


@pytest.mark.parametrize(('state', 'said'), [
    ([], (1, ['not begun: interrupted'])),
    ([4, 4], (3, ['job 5 requested', 'unknown: interrupted']))])
def test_interrupt_tells_whether_a_job_may_begin(
        state: list[int], said: tuple[int, list[str]]) -> None:
    asked: list[Int16MultiArray] = []
    with Observer() as observer:
        states = observer.node.create_publisher(Int16MultiArray, '/fake/read/job_state', STATES)
        if state:
            states.publish(Int16MultiArray(data=state))
        observer.node.create_subscription(
            Int16MultiArray, '/fake/write/job_request', asked.append, 10)
        with Process(EXAMPLE, '--node', '/fake', '--begin-within', '30') as example:
            observer.until(lambda: asked if state else states.get_subscription_count(),
                           'a request, or the example')
            example.send(signal.SIGINT)
            assert (example.result(), example.lines) == said


def test_job_whose_control_is_lost_is_taken_back() -> None:
    status, lines, requests = run(
        lambda request, state: None, [4, 4], '--control', 'control', '--begin-within', '10',
        control=[1])
    assert (status, requests[0], requests[-1]) == (1, 5, 0)
    assert lines[:2] == ['job 5 requested', 'ROS has lost control of the PLC']
    assert requests.count(5) < 20  # of fifty in the time that it has to begin


def test_nothing_is_asked_for_while_two_nodes_publish_the_state() -> None:
    status, lines, requests = run(lambda request, state: None, [4, 4], stub=[3, 3])
    assert (status, lines, requests) == (
        1, ['not begun: /fake/read/job_state has 2 publishers'], [])


def test_job_is_unknown_if_a_second_node_says_that_it_is_done() -> None:
    status, lines, requests = run(
        lambda request, state: None, [4, 4], '--begin-within', '10', stub=[5, 5])
    assert (status, lines[0], lines[-1]) == (
        3, 'job 5 requested', 'job 5: unknown: /fake/read/job_state has 2 publishers')
    assert requests[-1] == 0
    assert 'job 5: done' not in lines


def test_job_that_is_not_done_in_time_is_unknown() -> None:
    def begin(request: int, state: list[int]) -> None:
        state[0] = request or state[0]

    status, lines, _ = run(begin, [0, 0], '--begin-within', '10', '--done-within', '0.5')
    assert (status, lines[-1]) == (3, 'job 1: the PLC is busy with it')


def test_job_is_unknown_if_its_state_does_not_come_any_more() -> None:
    """As when the bridge has died."""
    def begin_and_die(request: int, state: list[int]) -> None:
        state[:] = [] if state[:1] != [0] else [request, 0]

    status, lines, _ = run(begin_and_die, [0, 0], '--begin-within', '10', '--done-within', '4')
    assert (status, lines[1]) == (3, 'job 1 has begun')
    assert re.fullmatch(r'job 1: unknown: no job_state has come for [2-9] s', lines[-1])


@for_all(('busy', 'done', 'number'), [
    (0, 0, 1), (4, 4, 5), (5, 4, 6), (32767, 32767, 1), (32767, 1, 2), (-5, -5, 1)])
def test_number_is_one_that_was_not_used_last(busy: int, done: int, number: int) -> None:
    assert HANDSHAKE['next_number'](busy, done) == number
