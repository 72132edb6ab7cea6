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

"""
The threads of callbacks, and the one sequence of an end, for one bridge or many.

And the signs of life that systemd waits for (WatchdogSec of the units in deploy/).
"""

from collections.abc import Callable, Iterator
from itertools import groupby, pairwise
from pathlib import Path
from queue import SimpleQueue
import socket
import threading
import time
from typing import Any
from unittest.mock import call, Mock

from abdf1_ros.ros.bridge.last_writes import LAST_WRITES
from abdf1_ros.ros.bridge.node import BridgeNode, end_together
from abdf1_ros.ros.bridge.session import BridgeSession, tell_plcs
from abdf1_ros.ros.callbacks import AnsweringNode, Callbacks
from abdf1_ros.ros.diagnostics.log import MOST_ENTRIES
from abdf1_ros.ros.process.runner import Line, Runner
from abdf1_ros.ros.process.supervisor import Supervisor
import pytest
from rclpy.executors import SingleThreadedExecutor, TimeoutException
from rclpy.logging import get_logger
from std_msgs.msg import Bool
from support.cases import for_all
from support.ros import EXAMPLE_FILES, Observer, PATIENCE, Process, ros_args


class Recorder:
    """Stand in for a bridge, its session and its link: write down what is called."""

    def __init__(self, calls: list[str], fails: str = '') -> None:
        self._calls = calls
        self._fails = fails
        self.taken, self.limit = 0, 0.0
        self.session = self.link = self.writes = self

    def _record(self, name: str) -> None:
        self._calls.append(name)
        if name == self._fails:
            raise KeyError('a bug')

    def begin_end(self) -> None:
        self._record('begin')

    def has_to_wait(self, is_meant: object) -> bool:
        return False

    def tell_unconfirmed(self, what: str) -> list[str]:
        self._record(f'PLCs: {what}')
        return []

    def close_line(self) -> None:
        self._record('close line')

    def is_alive(self) -> bool:
        return True

    def stop(self) -> None:
        self._record('stop link')

    def end_calls(self) -> None:
        self._record('answer calls')

    def publish_last_diagnostics(self, give_up: float) -> None:
        self.limit = give_up
        self._record('last words')

    def get_logger(self) -> Any:
        return get_logger('ending')


def order(calls: list[str]) -> list[str]:
    return [name for name, _ in groupby(calls)]


@pytest.mark.parametrize('count', [1, 3, 10, 25])
def test_each_line_is_checked_ten_times_a_second_and_looks_come_as_often(
        count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: dict[object, list[float]] = {}
    limits: set[float] = set()

    class Ended:
        now = 0.0

        def wait(self, seconds: float) -> bool:
            self.now += seconds
            return self.now > 1.04

        def set(self) -> None:  # noqa: A003
            pass

    class Told(Line):

        def check(self) -> None:
            calls.setdefault(self, []).append(ended.now)

        def threads(self) -> Any:  # a line that starts again has others
            return [ended.now]

        def end_callbacks(self, give_up: float) -> None:
            limits.add(give_up)

    ended: Any = Ended()
    monkeypatch.setattr(Supervisor, 'look', lambda _, threads: calls.setdefault(
        'threads', []).append(threads[0]))
    lines = [Told() for _ in range(count)]
    Runner(lines, lambda: calls.setdefault('look', []).append(ended.now)).run(ended)
    assert calls.keys() == {*lines, 'look', 'threads'}
    assert len(limits) == 1
    for times in calls.values():
        assert [later - time for time, later in pairwise(times[:10])] == pytest.approx([0.1] * 9)


def test_failed_link_ends_all_by_the_clock_but_no_node_that_a_callback_uses(
        monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[object] = []
    nodes: Any = [Mock(has_failed=failed) for failed in (True, False)]
    callbacks = [Mock(**{'is_alive.return_value': is_used}) for is_used in (True, False)]
    monkeypatch.setattr('abdf1_ros.ros.process.runner.Callbacks', Mock(side_effect=callbacks))
    monkeypatch.setattr('abdf1_ros.ros.process.runner.end_together', calls.append)
    ended: Any = Mock(**{'wait.return_value': False, 'set.side_effect': lambda: calls.append('')})
    runner = Runner([*map(Line, nodes)])
    assert runner.run(ended) == 1
    runner.destroy()
    assert calls == ['', nodes]
    assert [each.end.call_count for each in callbacks] == [1, 1]
    assert [node.destroy_node.called for node in nodes] == [False, True]


@pytest.mark.parametrize(('passed', 'words'), [(7.9, 3), (8.0, 0)])
def test_plcs_are_told_before_their_link_stops_and_results_come_before_the_last_words(
        passed: float, words: int, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []
    nodes: Any = [Recorder(calls) for _ in range(3)]
    clock = Mock(monotonic=Mock(return_value=0.0))

    def take(look: object, taken: Callable[[], int], give_up: float) -> None:
        assert give_up == LAST_WRITES
        nodes[0].taken, nodes[2].taken = 1, 2
        calls.append(f'{taken()} last writes')
        clock.monotonic.return_value = passed

    monkeypatch.setattr('abdf1_ros.ros.bridge.node.take_last_writes', take)
    monkeypatch.setattr('abdf1_ros.ros.bridge.node.time', clock)
    nodes[1].is_alive = lambda: False  # its link has failed
    end_together(nodes, 5.0)
    assert order(calls) == [
        'begin', *('PLCs: ends', 'close line') * 2, *('stop link', 'answer calls') * 3,
        '3 last writes', *['last words'] * (words > 0)]
    assert [calls.count(what) for what in ('begin', 'PLCs: ends', 'stop link', 'last words')] == [
        3 + 2, 2, 3, words]  # nodes, and sessions whose link is alive
    assert [node.limit for node in nodes] == 3 * [passed + 5.0 if words else 0.0]


def test_each_line_ends_when_its_own_plcs_have_confirmed_and_all_have_one_limit(
        monkeypatch: pytest.MonkeyPatch) -> None:
    calls, now = list[str](), [100.0]

    class Ending(Recorder):

        def __init__(self, name: str, over: float) -> None:
            super().__init__(calls)
            self._name, self._over = name, over

        def has_to_wait(self, is_meant: object) -> bool:
            return now[0] < self._over

        def _record(self, name: str) -> None:
            if name != 'begin':
                calls.append(f'{self._name}: {name} at {now[0]:g}')

    def sleep(seconds: float) -> None:
        now[0] += 1.0

    monkeypatch.setattr('abdf1_ros.ros.bridge.session.time', Mock(
        monotonic=lambda: now[0], sleep=sleep))
    sessions: Any = [Ending(*each) for each in (('dead', 999.0), ('a', 0.0), ('b', 102.0))]
    tell_plcs(sessions, 'ends', 6.0, closes_lines=True)
    assert calls == [f'{name}: {what} at {when}' for name, when in (
        ('a', 100), ('b', 102), ('dead', 106)) for what in ('PLCs: ends', 'close line')]


@for_all(('is_alive', 'is_open', 'is_released', 'is_spare', 'waits'), [
    (True, True, False, False, True), (True, True, False, True, True),
    (False, True, False, False, False), (True, False, False, False, True),
    (True, False, True, False, False), (True, False, False, True, False)])
def test_end_waits_for_a_port_that_was_lost_unless_it_was_left_or_is_of_a_spare(
        is_alive: bool, is_open: bool, is_released: bool, is_spare: bool, waits: bool) -> None:
    link = Mock(is_released=is_released, **{'is_alive.return_value': is_alive})
    link.state.is_open = is_open
    session: Any = Mock(is_waiting=False, _surroundings=Mock(link=link))
    session.configuration.parameters.standby = is_spare
    interlocks = session.driver.kernel
    interlocks.end.has_to_wait.return_value = True
    assert BridgeSession.has_to_wait(session, bool) is waits
    end = interlocks.end
    assert end.has_to_wait.call_args_list == [call(is_open=is_open, is_meant=bool)] * waits
    end.unconfirmed.return_value, end.not_repeated.return_value = ['beat'], ['speed']
    told = BridgeSession.tell_unconfirmed(session, 'ends')
    notes = session.events.notes
    assert len(told) == notes.error.call_count + notes.warning.call_count
    assert [notes.error.call_count, notes.warning.call_count] == (
        [0, 0] if is_spare and not is_open else [1, 1])


def test_spare_does_not_look_for_the_line_while_it_ends() -> None:
    node: Any = Mock()
    node.session.is_ending = True
    BridgeNode.check(node)
    assert node.session.check.called
    assert not node.standby.look.called


def test_failures_of_the_executor_end_it_only_in_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    with Observer() as observer:
        node = AnsweringNode('fails', context=observer.context)
        callbacks = Callbacks(node)
        bug = KeyError('a bug')
        idle = TimeoutException()
        waits = Mock(side_effect=[bug, bug, idle, bug, bug, idle, bug, bug, bug])
        monkeypatch.setattr(SingleThreadedExecutor, 'wait_for_ready_callbacks', waits)
        errors: list[object] = []
        monkeypatch.setattr('abdf1_ros.ros.callbacks.time', Mock(
            sleep=lambda seconds: errors.append(callbacks.error)))
        callbacks.run()
        assert (waits.call_count, errors) == (9, [*6 * [None], bug])
        node.destroy_node()


def test_bridge_that_fails_at_its_end_keeps_no_other_from_it(
        capfd: pytest.CaptureFixture[str]) -> None:
    calls: list[str] = []
    nodes: Any = [Recorder(calls, 'last words'), Recorder(calls)]
    end_together(nodes)
    assert calls[-2:] == ['last words', 'last words']
    assert "the end of this node has failed: KeyError('a bug')" in capfd.readouterr().err


def test_executor_is_shut_down_when_its_thread_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[bool] = []
    with Observer() as observer:
        node = AnsweringNode('ends', context=observer.context)
        callbacks = Callbacks(node)
        monkeypatch.setattr(SingleThreadedExecutor, 'shutdown',
                            lambda executor, **options: ended.append(not callbacks.is_alive()))
        callbacks.start()
        with monkeypatch.context() as patch:
            patch.setattr(callbacks, 'is_alive', lambda: True)  # as a callback hangs
            callbacks.end(0.0)
        assert ended == []
        callbacks.end(time.monotonic() + PATIENCE)
        assert ended == [True]
        monkeypatch.undo()
        node.destroy_node()


def test_thread_of_callbacks_turns_when_it_is_woken_unless_a_callback_hangs() -> None:
    hangs, goes_on = threading.Event(), threading.Event()
    with Observer() as observer:
        node = AnsweringNode('hangs', context=observer.context)
        callbacks = Callbacks(node)
        callbacks.start()
        callbacks.has_turned = False
        callbacks.wake()
        observer.until(lambda: callbacks.has_turned, 'a turn')
        bridge: Any = Mock(link='link')
        assert Line(bridge, callbacks).threads() == ['link', callbacks]

        def hang() -> None:
            hangs.set()
            goes_on.wait(PATIENCE)

        timer = node.create_timer(0.01, hang)
        assert hangs.wait(PATIENCE)
        callbacks.has_turned = False
        callbacks.wake()
        assert not callbacks.has_turned
        timer.cancel()
        goes_on.set()
        observer.until(lambda: callbacks.has_turned, 'a turn')
        callbacks.end(time.monotonic() + PATIENCE)
        node.destroy_node()


@pytest.fixture
def node() -> Iterator[AnsweringNode]:
    with Observer() as observer:
        node = AnsweringNode('takes', context=observer.context)
        callbacks = Callbacks(node)
        callbacks.start()
        yield node
        callbacks.end(time.monotonic() + PATIENCE)
        assert callbacks.error is None
        node.destroy_node()


def test_callback_that_fails_ends_alone_and_is_logged_a_few_times(
        node: AnsweringNode, capfd: pytest.CaptureFixture[str]) -> None:
    done = threading.Event()
    turns = iter(range(40))

    def fail() -> None:
        if next(turns) == 30:
            done.set()
        raise ValueError('from outside')

    node.create_timer(0.002, fail)
    assert done.wait(PATIENCE)
    said = capfd.readouterr().err
    assert f"all else goes on: ValueError('from outside') in {__file__}" in said
    assert said.count('from outside') == MOST_ENTRIES


@pytest.fixture
def loses_two(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let rclpy fail to take the first two messages."""
    take = SingleThreadedExecutor._take_subscription  # noqa: SLF001  # rclpy has no other way
    broken = iter([True, True])

    def take_or_fail(executor: SingleThreadedExecutor, subscription: Any) -> Any:
        callback = take(executor, subscription)
        if next(broken, False):
            raise RuntimeError('cannot be taken')
        return callback

    monkeypatch.setattr(SingleThreadedExecutor, '_take_subscription', take_or_fail)


@pytest.mark.usefixtures('loses_two')
def test_subscription_is_heard_again_after_a_message_that_cannot_be_taken(
        node: AnsweringNode, capfd: pytest.CaptureFixture[str]) -> None:
    heard: SimpleQueue[bool] = SimpleQueue()
    node.create_subscription(Bool, 'odd', lambda message: heard.put(message.data), 10)
    publisher = node.create_publisher(Bool, 'odd', 10)
    for value in (True, True, False):
        publisher.publish(Bool(data=value))
    assert heard.get(timeout=PATIENCE) is False
    assert capfd.readouterr().err.count('a message on /odd has failed') == 2


@pytest.mark.usefixtures('loses_two')
def test_monitor_and_demo_pass_over_a_message_that_cannot_be_taken(
        capfd: pytest.CaptureFixture[str]) -> None:
    with Observer() as observer:
        heard = observer.listen(Bool, 'odd', 10)
        publisher = observer.node.create_publisher(Bool, 'odd', 10)
        for value in (True, True, False):
            publisher.publish(Bool(data=value))
        assert heard.first().data is False
    assert capfd.readouterr().err.count('a message on /odd cannot be taken') == 1


class Link:
    """A link whose thread stands still."""

    has_turned = True
    alive = True

    def is_alive(self) -> bool:
        return self.alive

    def wake(self) -> None:
        pass


@pytest.fixture
def systemd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
            request: pytest.FixtureRequest) -> Iterator[socket.socket]:
    path, is_abstract = str(tmp_path / 'notify'), hasattr(request, 'param')
    monkeypatch.setenv('NOTIFY_SOCKET', '@' * is_abstract + path)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind('\0' * is_abstract + path)
        receiver.settimeout(PATIENCE)
        yield receiver


@pytest.mark.parametrize('systemd', ['@'], indirect=True)
def test_no_sign_while_a_link_stands_still(
        systemd: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('WATCHDOG_USEC', '3')
    link, other = Link(), Link()
    supervisor = Supervisor()
    supervisor.look([link, other])
    assert [systemd.recv(99), systemd.recv(99)] == [b'READY=1', b'WATCHDOG=1']
    other.has_turned = True
    supervisor.look([link, other])
    systemd.setblocking(False)
    link.alive = False
    supervisor.look([link, other])
    with pytest.raises(BlockingIOError):
        systemd.recv(99)
    other.has_turned = True
    supervisor.look([link, other])
    assert systemd.recv(99) == b'WATCHDOG=1'


@pytest.mark.parametrize(('period', 'signs'), [
    ('', []), ('3000000000', 2 * [b'WATCHDOG=1'])])
def test_a_sign_comes_once_in_the_period_of_the_watchdog_if_there_is_one(
        systemd: socket.socket, monkeypatch: pytest.MonkeyPatch, period: str,
        signs: list[bytes]) -> None:
    if period:
        monkeypatch.setenv('WATCHDOG_USEC', period)
    monkeypatch.setattr('abdf1_ros.ros.process.supervisor.time', Mock(
        **{'monotonic.side_effect': [50.0, 1049.0, 1050.0]}))  # a sign can get lost
    supervisor, link = Supervisor(), Link()
    for _ in range(3):
        link.has_turned = True
        supervisor.look([link])
    assert [systemd.recv(99) for _ in ('ready', *signs)] == [b'READY=1', *signs]
    systemd.setblocking(False)
    with pytest.raises(BlockingIOError):
        systemd.recv(99)
    for _ in range(1000):
        supervisor.say('READY=1')  # a systemd that hangs holds up nobody


@pytest.mark.parametrize('address', ['', '/nowhere/notify', '@abdf1_nobody'])
def test_nobody_has_to_listen(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv('NOTIFY_SOCKET', address)
    monkeypatch.setenv('WATCHDOG_USEC', '3')
    Supervisor().look([Link()])


def test_a_bridge_without_its_port_gives_signs(
        systemd: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between two signs its link has turned: it was woken, and tries the port again."""
    monkeypatch.setenv('WATCHDOG_USEC', '300000')
    with Process('node', *ros_args(*EXAMPLE_FILES, 'port:=/dev/ttyS99')) as node:
        assert systemd.recv(99) == b'READY=1'
        assert [systemd.recv(99) for _ in range(5)] == [b'WATCHDOG=1'] * 5
        node.end()
