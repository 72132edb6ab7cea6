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
Real rclpy over the loopback: processes, an observer of topics, and PLCs on a pseudo-terminal.

Importing this module keeps everything on this machine and in a domain of its own, so that
test sessions side by side do not hear each other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import version
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import threading
import time
from typing import Any

from abdf1_ros.paths import config_file
from abdf1_ros.ros.bridge.node import BridgeNode, end_together
from abdf1_ros.ros.bridge.port_owners import PortOwners
from abdf1_ros.ros.topics.messages import latched_qos
from abdf1_ros.testing import cell
from abdf1_ros.testing.cell import EVERYTHING, PATIENCE
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rcl_interfaces.srv import GetParameters
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile
from support.forked import Forked

HAS_FAST_DDS_3 = int(version('rclpy').partition('.')[0]) >= 9  # of ROS Kilted
PROFILES_VARIABLE = f'{"FASTDDS" if HAS_FAST_DDS_3 else "FASTRTPS"}_DEFAULT_PROFILES_FILE'


def profiles_text() -> str:
    """Return the profiles of the tests as the Fast DDS of this ROS spells them."""
    text = Path(__file__).with_name('dds.xml').read_text(encoding='utf-8')
    return text.replace('heartbeatPeriod', 'heartbeat_period') if HAS_FAST_DDS_3 else text


# Read when the first context is made, here and in every child process. The profile keeps all on
# 127.0.0.1, without shared memory, which rmw_fastrtps adds wherever the range is LOCALHOST.
_LOGS = tempfile.TemporaryDirectory(prefix='abdf1_log_')  # goes away with this process
os.environ |= {
    'ROS_LOG_DIR': _LOGS.name, 'RCUTILS_COLORIZED_OUTPUT': '0',
    'RMW_IMPLEMENTATION': 'rmw_fastrtps_cpp', 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SYSTEM_DEFAULT',
    PROFILES_VARIABLE: f'{_LOGS.name}/dds.xml'}
Path(_LOGS.name, 'dds.xml').write_text(profiles_text(), encoding='utf-8')

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class Process:
    """
    A command of the package, or a file, as a process; all it says is kept, line by line.

    In tests it is a fork, unless ``is_forked`` is false; what measures starts interpreters.
    """

    def __init__(self, program: str | Path, *args: str, is_forked: bool = True) -> None:
        self.lines: list[str] = []
        self._said = threading.Condition()
        self._goes_on = threading.Event()
        self._keeper: threading.Thread | None = None
        self._process: Any
        if is_forked and 'PYTEST_CURRENT_TEST' in os.environ:
            self._process = Forked(program, args)
        else:
            before = ['-m', 'abdf1_ros'] if isinstance(program, str) else []
            self._process = subprocess.Popen(
                [sys.executable, *before, program, *args], text=True,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self._readers = [
            threading.Thread(target=self._read, args=(stream,))
            for stream in (self._process.stdout, self._process.stderr)]
        for reader in self._readers:
            reader.start()

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *exception: object) -> None:
        """End the process in any case, also one that a failed test has left."""
        if self.is_running:
            self.go_on()
            self.send(signal.SIGINT)
        self.result()

    @property
    def text(self) -> str:
        """Return all that it has said."""
        with self._said:
            return '\n'.join(self.lines)

    @property
    def number(self) -> int:
        """Return the number that the operating system has for it."""
        return int(self._process.pid)

    @property
    def is_running(self) -> bool:
        return self._process.poll() is None

    def catches(self, number: signal.Signals) -> bool:
        """Tell whether it has a handler for a signal."""
        status = Path(f'/proc/{self.number}/status').read_text(encoding='utf-8')
        return bool(int(status.partition('SigCgt:')[2].split()[0], 16) >> number - 1 & 1)

    def _read(self, stream: Any) -> None:
        with stream:
            for line in stream:
                with self._said:
                    self.lines.append(line.rstrip('\n'))
                    self._said.notify_all()
        with self._said:
            self._said.notify_all()

    def wait_for(self, *texts: str, after: int = 0) -> str:
        """Wait for a line, not one of the first ``after``, that holds all ``texts``."""
        def found() -> str | None:
            return next((line for line in self.lines[after:]
                         if all(text in line for text in texts)), None)

        with self._said:
            line = self._said.wait_for(found, PATIENCE)
        assert line is not None, f'nothing with {texts} in:\n{self.text}'
        return line

    def say(self, line: str) -> str:
        """Give a line to its standard input; return the answer of the simulator to it."""
        after = len(self.lines)
        self.type(f'{line}\n')
        return self.wait_for('simulator: station', after=after)

    def type(self, text: str) -> None:  # noqa: A003
        """Give text to its standard input."""
        self._process.stdin.write(text)
        self._process.stdin.flush()

    def close_input(self) -> None:
        """End its standard input."""
        self._process.stdin.close()

    def send(self, *numbers: signal.Signals) -> None:
        """Send signals, one straight after the other."""
        for number in numbers:
            self._process.send_signal(number)

    def stop(self) -> None:
        """Let it stand still, all of it, until ``go_on``, whoever else lets it continue."""
        self._goes_on.clear()
        self.send(signal.SIGSTOP)
        threads = Path(f'/proc/{self.number}/task')
        while any(' T ' not in status.read_text() for status in threads.glob('*/stat')):
            time.sleep(0.001)
        self._keeper = threading.Thread(target=self._keep_stopped, daemon=True)
        self._keeper.start()

    def _keep_stopped(self) -> None:
        while not self._goes_on.wait(0.005):
            self.send(signal.SIGSTOP)

    def go_on(self) -> None:
        self._goes_on.set()
        if self._keeper is not None:  # its last SIGSTOP has to come before
            self._keeper.join()
        self.send(signal.SIGCONT)

    def result(self) -> int:
        """Wait for the end; return the exit status, once all that was said has been read."""
        end = time.monotonic() + PATIENCE
        for reader in self._readers:  # tells the end at once, where wait() looks every 50 ms
            reader.join(end - time.monotonic())
        try:
            status = self._process.wait(max(0.0, end - time.monotonic()))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            raise AssertionError(f'does not end; it has said:\n{self.text}') from None
        for reader in self._readers:
            reader.join()
        if self._process.stdin is not None:
            self._process.stdin.close()
        return int(status)

    def end(self, *numbers: signal.Signals) -> None:
        """End it by signals, and check that it ends as it should."""
        self.send(*numbers or (signal.SIGINT,))
        assert self.result() == 0, self.text
        assert 'Traceback' not in self.text, self.text


class Inbox(cell.Messages):
    """The messages that a subscription has got, and the events that it has seen."""

    def __init__(self, observer: Observer, topic: str) -> None:
        super().__init__(observer, topic)
        self.deadlines: list[Any] = []
        self.liveliness: list[Any] = []
        self.incompatible: list[Any] = []

    def next(self) -> Any:  # noqa: A003
        """Wait for a message that is not here yet."""
        self.clear()
        return self.first()

    def fresh(self) -> DiagnosticArray:
        """
        Wait for diagnostics that were made after now.

        What DDS still holds is older than a clear(), and a stamp comes after what it stamps; so
        they are the second with a later stamp.
        """
        self.clear()
        now = time.time()
        return self.observer.until(
            lambda: [array for array in self if stamp(array) > now][1:], 'new diagnostics')[0]

    def until_well(self) -> None:
        """Wait until the last diagnostics say that every mapping is read."""
        self.observer.until(lambda: self and is_fresh(find_status(self[-1], 'mappings'))
                            and find_status(self[-1], 'link').level == OK, 'all well')

    def until_fresh(self) -> None:
        """Wait until diagnostics say that every mapping is read."""
        self.until(lambda array: is_fresh(find_status(array, 'mappings')), 'fresh mappings')

    def values(self, expected: Sequence[float] | str) -> Any:
        """Wait for a message with these values."""
        return self.until(lambda message: values_in(message) == expected, f'{expected}')


def is_fresh(mappings: DiagnosticStatus) -> bool:
    """Tell whether every row is read, though a busy host may not keep the Periods."""
    counts = details(mappings)
    return counts['fresh'] == counts['total']


def values_in(message: Any) -> list[float] | str:
    """Return the values of a std_msgs message as something to compare."""
    return message.data if isinstance(message.data, str) else list(message.data)


class Observer(cell.Observer):
    """A ROS node that looks at others from outside; also runs nodes that are added to it."""

    def __enter__(self) -> Observer:
        return self

    def listen(self, message_type: Any, topic: str, qos: QoSProfile | None = None) -> Inbox:
        """Subscribe; the default profile also gets what has been published before."""
        inbox = Inbox(self, topic)
        events = SubscriptionEventCallbacks(
            deadline=inbox.deadlines.append, liveliness=inbox.liveliness.append,
            incompatible_qos=inbox.incompatible.append)
        inbox.subscription = self.node.create_subscription(
            message_type, topic, inbox.append, qos or latched_qos(), event_callbacks=events)
        return inbox

    def run(self, bridge: BridgeNode) -> None:
        """Run a bridge in this process until ``end``, as ``Runner`` does."""
        bridge.create_timer(0.1, bridge.check, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.executor.add_node(bridge)
        bridge.start()

    def end(self, bridge: BridgeNode) -> None:
        """End a bridge that runs here, in order; do nothing with one that has ended."""
        if bridge in self.executor.get_nodes():
            self.executor.remove_node(bridge)
            try:
                end_together([bridge])
            finally:
                bridge.destroy_node()

    def forget(self, inbox: Inbox) -> None:
        """End a subscription."""
        self.node.destroy_subscription(inbox.subscription)

    def results(self, name: str = '/abdf1') -> Inbox:
        """Listen to the results of writes; begin before the node does, to miss none."""
        return self.listen(DiagnosticStatus, f'{name}/write_results', EVERYTHING)

    def diagnostics(self, port: object) -> Inbox:
        """Listen to what the node on ``port`` says on /diagnostics."""
        inbox = Inbox(self, '/diagnostics')

        def take(array: DiagnosticArray) -> None:
            if array.status[0].hardware_id == str(port):
                inbox.append(array)

        inbox.subscription = self.node.create_subscription(
            DiagnosticArray, '/diagnostics', take, EVERYTHING)
        return inbox

    def call(self, service_type: Any, name: str, request: Any) -> Any:
        client = self.node.create_client(service_type, name)
        self.until(client.service_is_ready, f'the service {name}')
        future = client.call_async(request)
        self.until(future.done, f'an answer of {name}')
        self.node.destroy_client(client)
        return future.result()


def get_parameters(observer: Observer, *names: str, node: str = '/abdf1') -> list[Any]:
    """Return the values of a node's parameters."""
    response = observer.call(
        GetParameters, f'{node}/get_parameters', GetParameters.Request(names=names))
    assert len(response.values) == len(names)
    return [parameter_value_to_python(value) for value in response.values]


def stamp(array: DiagnosticArray) -> float:
    """Return the time in the header of an array, in s."""
    return float(array.header.stamp.sec + array.header.stamp.nanosec / 1e9)


def find_status(array: DiagnosticArray, name: str) -> DiagnosticStatus:
    """Return the status ``<node>: <name>`` of an array."""
    return next(status for status in array.status if status.name.partition(': ')[2] == name)


def details(status: DiagnosticStatus) -> dict[str, str]:
    return {value.key: value.value for value in status.values}


def until_status(
        inbox: Inbox, name: str, level: bytes,
        condition: Callable[[DiagnosticStatus], bool] = lambda status: True, ) -> DiagnosticStatus:
    """Wait until a status has a level and fulfils ``condition``; return it."""
    def matches(array: DiagnosticArray) -> bool:
        status = find_status(array, name)
        return status.level == level and condition(status)

    return find_status(inbox.until(matches, f'{name} at level {level!r}'), name)


def write_csv(path: Path, header: str, rows: Iterable[str]) -> Path:
    """Write a CSV file and return its path."""
    path.write_text('\n'.join([header, *rows, '']), encoding='utf-8')
    return path


# What makes the node run with the example of this package.
EXAMPLE_FILES = tuple(f'{name}_file:={config_file(f"{name}.csv")}' for name in ('net', 'map'))


def ros_args(*assignments: str) -> list[str]:
    """Return the arguments that set parameters, each given as ``name:=value``."""
    return ['--ros-args', *(word for text in assignments for word in ('-p', text))]


class BridgeCell(cell.SimulatedCell):
    """What ``abdf1_cell`` makes, with the bridge in the executor of ``ros``."""

    observer = Observer
    ros: Observer

    def __init__(self, folder: Path, data: str, rows: str, net: str, *assignments: str) -> None:
        super().__init__(folder, data, rows, net, parameters=assignments)
        self.net, self.map = folder / 'net.csv', folder / 'map.csv'

    def start(self) -> None:
        """Start the bridge; wait for its port."""
        self.results = self.ros.results()
        self.diagnostics = self.ros.diagnostics(self.plcs.port)
        self.port_owners = PortOwners()
        self.node = BridgeNode(context=self.ros.context, use_global_arguments=False,
                               port_owners=self.port_owners, cli_args=ros_args(*self.assignments))
        self.ros.run(self.node)
        self.ros.until(lambda: self.node.session.driver.is_online, 'the port')

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        """End the bridge in order, if it runs."""
        self.ros.end(self.node)
        return 0

    def call(self, kind: Any, name: str, request: Any) -> Any:
        return self.ros.call(kind, f'/abdf1/{name}', request)
