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
A cell for tests, with ROS: simulated PLCs, a bridge on their line, and an observer of its topics.

Importing this module keeps all topics on this machine, in a ROS domain that no other session of
tests on this machine has.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, ExitStack
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import TypeVar

from abdf1_ros.cli.check import examine
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.ros import observer
from abdf1_ros.ros.topics.messages import latched_qos
from abdf1_ros.ros.untyped import RosMessage
from abdf1_ros.testing.plcs import Plcs
from rcl_interfaces.srv import GetParameters
import rclpy
from rclpy.context import Context
from rclpy.publisher import Publisher
from rclpy.qos import HistoryPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

PATIENCE = 40.0  # s; longest wait for an event
EVERYTHING = QoSProfile(history=HistoryPolicy.KEEP_ALL)

_Result = TypeVar('_Result')


_DOMAIN, _CLAIM = observer.claim_domain()

# ROS reads these variables for the first context, here and in every child process.
os.environ |= {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', 'ROS_DOMAIN_ID': str(_DOMAIN)}


class Messages(list[RosMessage]):
    """The messages that a subscription has got."""

    subscription: Subscription

    def __init__(self, observer: Observer, topic: str) -> None:
        super().__init__()
        self.topic = topic
        self.observer = observer

    def until(self, condition: Callable[[RosMessage], bool], what: str) -> RosMessage:
        """Wait for a message that fulfils ``condition``; return it."""
        return self.observer.until(
            lambda: next((message for message in self if condition(message)), None),
            lambda: f'{what} on {self.topic}; got {list(self)[-3:]}, '
                    f'publishers: {self.observer.node.count_publishers(self.topic)}')

    def first(self) -> RosMessage:
        """Wait for the first message."""
        return self.until(lambda message: True, 'a message')


class Bridge:
    """A bridge as a process, with its output in the file ``log``."""

    def __init__(self, assignments: Sequence[str], log: Path) -> None:
        self.words = [word for text in assignments for word in ('-p', text)]
        self.log = log
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start the process, also again after its end."""
        with self.log.open('ab') as log:
            self.process = subprocess.Popen(
                [sys.executable, '-m', 'abdf1_ros', 'node', '--ros-args', *self.words],
                stdout=log, stderr=log)

    @property
    def is_running(self) -> bool:
        """Tell whether the process has been started and has not ended."""
        return self.process is not None and self.process.poll() is None

    def end(self, number: signal.Signals) -> int:
        """End the process by a signal, if it runs; return its exit status."""
        if self.process is None:
            return 0
        if self.is_running:
            self.process.send_signal(number)
        process, self.process = self.process, None
        return process.wait(PATIENCE)

    def check(self) -> None:
        """Raise AssertionError if the process has ended by itself."""
        if self.process is not None and (status := self.process.poll()) is not None:
            raise AssertionError(f'the bridge has ended with {status}{self.last_words()}')

    def report(self) -> str:
        """Return what to know of the bridge when something has not come."""
        return ('' if self.process else '; the test has ended the bridge') + self.last_words()

    def last_words(self) -> str:
        """Return the last lines of the log."""
        lines = self.log.read_text(errors='replace').splitlines() if self.log.exists() else []
        return '; its last words:\n' + '\n'.join(lines[-10:]) if lines else ''


class Observer(observer.ObservingNode):
    """
    A ROS node that observes other nodes from outside; it also runs nodes that are added.

    While the observer waits it checks that ``bridge`` still runs. It ends a context that it has
    made.
    """

    def __init__(self, name: str = 'observer', context: Context | None = None,
                 bridge: Bridge | None = None) -> None:
        super().__init__(name, context)
        self._bridge = bridge

    def until(self, condition: Callable[[], _Result | None],
              what: str | Callable[[], str]) -> _Result:
        """Spin until ``condition`` returns a true value; return this value."""
        def is_over() -> _Result | None:
            result = condition()
            if not result and self._bridge is not None:
                self._bridge.check()
            return result

        if not (result := self.wait(is_over, PATIENCE)):
            raise AssertionError(f'waited for {what() if callable(what) else what}'
                                 + (self._bridge.report() if self._bridge else ''))
        return result

    def listen(self, message_type: type, topic: str, qos: QoSProfile | None = None) -> Messages:
        """Subscribe; the default profile also gets messages that were published before."""
        inbox = Messages(self, topic)
        inbox.subscription = self.node.create_subscription(
            message_type, topic, inbox.append, qos or latched_qos())
        return inbox

    def publisher(self, message_type: type, topic: str) -> Publisher:
        """Return a publisher for <node>/write/... when that node knows all our endpoints."""
        publisher = self.node.create_publisher(message_type, topic, EVERYTHING)
        self.until(publisher.get_subscription_count, f'a subscriber of {topic}')
        self.meet(topic.partition('/write/')[0])
        return publisher

    def meet(self, node: str) -> None:
        """
        Wait until a node knows all publishers and subscriptions that were made here before.

        Finding the node is not enough: messages that it publishes before it has found us are lost.
        DDS announces endpoints in the order of their creation. So a node that answers a client
        knows all endpoints that we made before this client.
        """
        client = self.node.create_client(GetParameters, f'{node}/get_parameters')
        self.until(client.service_is_ready, f'the parameters of {node}')
        answers, asked = [], 0.0

        def is_answered() -> bool:
            nonlocal asked
            # ask again: a node drops its answer to a client that it does not know yet
            if time.monotonic() > asked + 1.0:
                asked = time.monotonic()
                answers.append(client.call_async(GetParameters.Request()))
            return any(answer.done() for answer in answers)

        self.until(is_answered, f'an answer of {node}')
        self.node.destroy_client(client)


class SimulatedCell:
    """
    Simulated PLCs, a bridge on their line as a process, and ``ros``, which observes its topics.

    ``data``, ``rows`` and ``net`` are the texts of a simulator CSV, a map CSV and a net CSV, which
    go into ``folder``. ``ladders`` are stations with the program of docs/tutorials/heartbeats.md.
    ``parameters`` are the bridge's, as ``'write_timeout:=1.0'``; ``context`` is for ``ros`` and
    nodes that are added to it. Raises ConfigurationError with every fault of net and map CSV, and
    for parameters that are not such texts. The end raises AssertionError if the bridge has ended
    by itself: otherwise a test that nothing comes would pass without a bridge.
    """

    observer: type[Observer] = Observer

    def __init__(self, folder: Path, data: str, rows: str,
                 net: str = 'Com_Port,Baud,Timeout\n/dev/plc,115200,200', *,
                 ladders: Sequence[int] = (), parameters: Sequence[str] = (),
                 context: Context | None = None) -> None:
        for name, text in (('data', data), ('map', rows), ('net', net)):
            (folder / f'{name}.csv').write_text(text, encoding='utf-8')
        _check_parameters(parameters)
        net_file, map_file = str(folder / 'net.csv'), str(folder / 'map.csv')
        found = examine(net_file, map_file)
        line = found.network
        if line and not line.line_mode.only_listens and not (
                line.line_mode.is_master and line.checksum is Checksum.CRC):
            found.problems.append(Problem(
                net_file, 'the simulated PLCs answer only Mode Master with Error_Code CRC'))
        if found.problems:
            raise ConfigurationError(found.problems)
        self.plcs = Plcs(folder / 'data.csv', ladders)
        self.assignments = [f'net_file:={net_file}', f'map_file:={map_file}',
                            f'port:={self.plcs.port}', *parameters]
        self._bridge = Bridge(self.assignments, folder / 'bridge.log')
        self.ros = self.observer(context=context, bridge=self._bridge)

    def __enter__(self) -> SimulatedCell:
        with ExitStack() as stack:  # a failure here, or at the end, leaves no thread and no node
            stack.enter_context(self.ros)
            stack.enter_context(self.plcs)
            stack.callback(self.end)
            self.start()
            self._ends = stack.pop_all()
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        with self._ends:
            if error is None:
                self._bridge.check()

    def start(self) -> None:
        """Start the bridge, also again after its end."""
        self._bridge.start()

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        """
        End the bridge by a signal, if it runs; return its exit status.

        Unless it is killed, return only when the bridge has left the ROS graph, at most 1 s later.
        Fast DDS 2.14 may crash if a subscription ends while another process removes its publishers
        (its issue 3303).
        """
        takes_leave = (self._bridge.is_running and number != signal.SIGKILL
                       and self.ros.context.ok())
        status = self._bridge.end(number)
        give_up = time.monotonic() + (1.0 if takes_leave else 0.0)
        while time.monotonic() < give_up and 'abdf1' in self.ros.node.get_node_names():
            time.sleep(0.005)
        return status


def _check_parameters(parameters: object) -> None:
    if not isinstance(parameters, list | tuple) or not all(
            isinstance(text, str) for text in parameters):
        raise ConfigurationError([Problem('parameters', (
            f"{parameters!r} should be a list of texts, as in ['write_timeout:=1.0']"))])


@contextmanager
def default_context() -> Iterator[Context]:
    """Initialize ROS unless the test has; yield the default context."""
    if rclpy.ok():
        yield rclpy.get_default_context()
        return
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield rclpy.get_default_context()
    finally:
        rclpy.try_shutdown()
