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
Measure how much processor time a read transaction costs, and how many there are a second.

Method. The driver reads ten words of one SLC as often as it can, half duplex, through
``LinkThread`` on a pseudo-terminal without any pacing. At the other end a process of its own
answers at once with frames that were made beforehand, so that its work does not count. After
a warm-up --seconds are measured: transactions, and the processor time of this process
(``time.process_time``, which does not see what else runs on the machine, unlike the rate).
"system calls" does nothing but what a transaction asks of the operating system (two writes, two
polls, two reads), with frames made beforehand: the time that no driver in Python can go below, on
this machine in this minute. "calls and publish" publishes a message encoded beforehand after each
of them: what rclpy and DDS take when they are woken from time to time. "driver" has a listener
that only counts; "driver and publish" publishes every value with rclpy, as the node does. Both
rows with "publish" are left out where there is no ROS.
They take turns, as the machine is faster in some seconds than in others: the last columns are
the median and the least of what each round has shown as a multiple of its own system calls.

"without waiting" is the driver alone, on a line in memory: the best of several loops, and how many
calls of Python functions (entries of generators included) and of C functions a transaction is.
"troubles" counts errors and retries.

Run it as "python test/lab/benchmarks/cpu_time.py"; without ROS it needs nothing but the package.
"""

import argparse
from array import array
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, partial
from importlib.util import find_spec
import itertools
import os
from pathlib import Path
import signal
from statistics import median
import sys
import time
import tty

sys.path[:0] = [str(Path(__file__).resolve().parents[3])]

from abdf1_ros.df1 import frames  # noqa: E402
from abdf1_ros.df1.machine import Machine  # noqa: E402
from abdf1_ros.df1.packet import Packet  # noqa: E402
from abdf1_ros.driver.driver import Driver  # noqa: E402
from abdf1_ros.driver.settings import DriverSettings  # noqa: E402
from abdf1_ros.pccc.slc.dialect import SlcDialect  # noqa: E402
from abdf1_ros.pccc.values import Values  # noqa: E402
from abdf1_ros.ports.descriptor import DescriptorPort  # noqa: E402
from abdf1_ros.ports.link_thread import LinkThread  # noqa: E402
from abdf1_ros.settings.mapping import Mapping  # noqa: E402
from abdf1_ros.settings.network import Network  # noqa: E402
from paced_line import BareLine, block_of, Listener, WORDS  # noqa: E402

STATION = 1
MAPPING = block_of(STATION)
NETWORK = Network(baud=115200)
TRANSACTIONS = 0x10000


class Memory:
    """An outlet that keeps what is written."""

    def __init__(self) -> None:
        self.write = list[bytes]().append

    def unsent(self) -> int:
        """Return that all has left."""
        return 0


class Publisher(Listener):
    """Publishes what is read, as the node does."""

    def __init__(self) -> None:
        super().__init__()
        os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
        os.environ.setdefault('ROS_DOMAIN_ID', '83')
        from abdf1_ros.ros.topics import messages as node_messages
        import rclpy
        from rclpy.event_handler import PublisherEventCallbacks
        rclpy.init()
        node = rclpy.create_node('abdf1_benchmark')
        self._encode = node_messages.encoder(MAPPING)
        self._publisher = node.create_publisher(
            node_messages.MESSAGES[MAPPING.type], 'words', node_messages.read_qos(MAPPING, 1.0),
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False))

        self._message = self._encode(array('h', range(WORDS)))

    def publish(self) -> None:
        """Publish the same again."""
        self._publisher.publish(self._message)

    def read(self, mapping: Mapping, values: Values) -> None:
        """Publish values."""
        self._publisher.publish(self._encode(values))


@cache
def _all_frames() -> list[tuple[bytes, bytes]]:
    """Return the frames of each transaction number."""
    return list(map(_frames, range(TRANSACTIONS)))


def _frames(tns: int) -> tuple[bytes, bytes]:
    """Return the command frame with that transaction number, and the reply to it."""
    cmd, body = SlcDialect().read(MAPPING.address, WORDS)
    command = Packet(STATION, NETWORK.station, cmd, 0, tns, body)
    return (frames.master_frame(STATION, command.encode(), NETWORK.checksum),
            frames.message_frame(command.reply(bytes(range(2 * WORDS))).encode(),
                                 NETWORK.checksum))


def _respond(descriptor: int) -> None:
    """Answer command after command, poll after poll, for ever."""
    talk = [(len(command), reply) for command, reply in _all_frames()]
    first = talk.pop(0)  # a driver begins with 1
    poll = len(frames.poll_frame(STATION))
    acknowledged = 0
    os.write(descriptor, b'r')
    while True:
        for command, reply in talk:
            _take(descriptor, acknowledged + command)
            os.write(descriptor, frames.ACK)
            _take(descriptor, poll)
            os.write(descriptor, reply)
            acknowledged = len(frames.ACK)  # it comes together with the next command
        talk = [first, *talk] if len(talk) < TRANSACTIONS else talk


def measure_system_calls(warm_up: float, seconds: float,
                         after: Callable[[], None] = lambda: None) -> tuple[float, float]:
    """
    Return what ``measure`` does, of a master that knows beforehand what will be said.

    ``after`` is called after each transaction.
    """
    poll = frames.poll_frame(STATION)
    first, *known = _all_frames()
    known.append(first)
    talk = itertools.cycle([
        [(poll, len(reply)), (frames.ACK + following, len(frames.ACK))]
        for (_, reply), (following, _) in zip(known, known[1:] + known[:1], strict=True)])
    with responder() as descriptor:
        line = BareLine(descriptor)
        line.ask(known[0][0], len(frames.ACK))
        _take_turns(line, talk, after, warm_up)
        used = time.process_time()
        done, passed = _take_turns(line, talk, after, seconds)
        return done / passed, (time.process_time() - used) / done


def _take_turns(line: BareLine, talk: Iterator[list[tuple[bytes, int]]],
                after: Callable[[], None], seconds: float) -> tuple[int, float]:
    """Carry out transactions for a time; return how many, and the time."""
    begun, done = time.monotonic(), 0
    while time.monotonic() < begun + seconds:
        for sent, expected in next(talk):
            line.ask(sent, expected)
        after()
        done += 1
    return done, time.monotonic() - begun


def measure_without_waiting(loops: int = 7, count: int = 2000) -> tuple[float, float, float]:
    """Return s of processor time, calls of Python functions and of C functions of each."""
    replies = [reply for _, reply in map(_frames, range(1, count + 2))]
    best = min(_time_in_memory(_machine(), replies) for _ in range(loops))
    calls: Counter[str] = Counter()
    machine = _machine()
    sys.setprofile(lambda frame, event, argument: calls.update((event,)))
    try:
        _time_in_memory(machine, replies)
    finally:
        sys.setprofile(None)
    return best, calls['call'] / count, calls['c_call'] / count


def _machine() -> Machine:
    return Driver(NETWORK, [MAPPING], DriverSettings(), Listener()).machine


def _time_in_memory(machine: Machine, replies: list[bytes]) -> float:
    """Return s of processor time of a transaction."""
    outlet = Memory()
    used = time.process_time()
    machine.start(0.0, outlet)
    machine.sender.data_to_send()
    for number, reply in enumerate(replies[:-1]):
        now = 0.001 * number
        for heard in frames.ACK, reply:
            machine.receive_data(heard, now)
            machine.sender.data_to_send()
            assert machine.next_call is not None
    return (time.process_time() - used) / (len(replies) - 1)


def _take(descriptor: int, count: int) -> None:
    while count > 0:
        count -= len(os.read(descriptor, count))


@contextmanager
def responder() -> Iterator[int]:
    """Run a process that answers; give the descriptor of our end of its line."""
    far, near = os.openpty()
    tty.setraw(near)
    process = os.fork()
    if process == 0:
        try:
            os.close(near)
            _respond(far)
        finally:
            os._exit(0)
    os.read(near, 1)  # its frames are made
    try:
        yield near
    finally:
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)
        os.close(far)


def measure(listener: Listener, warm_up: float, seconds: float) -> tuple[float, float]:
    """Return transactions per second, and s of processor time of each."""
    driver = Driver(NETWORK, [MAPPING], DriverSettings(), listener)
    with responder() as descriptor:
        link = LinkThread(driver.machine,
                          lambda: DescriptorPort(descriptor, lambda: os.close(descriptor)))
        link.start()
        time.sleep(warm_up)
        began, used, before = time.monotonic(), time.process_time(), driver.tasks.transactions
        time.sleep(seconds)
        used, done = time.process_time() - used, driver.tasks.transactions - before
        passed = time.monotonic() - began
        link.stop()
    return done / passed, used / max(done, 1)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--warm-up', type=float, default=0.2, metavar='SECONDS')
    parser.add_argument('--seconds', type=float, default=0.5)
    parser.add_argument('--rounds', type=int, default=15)
    options = parser.parse_args()
    print(f'reads of {WORDS} words, half duplex; {options.rounds} rounds of '
          f'{options.seconds:g} s each; load of the machine {os.getloadavg()[0]:.1f}')
    used, calls, c_calls = measure_without_waiting()
    print(f'without waiting: {1e6 * used:.1f} us, {calls:.0f} calls of Python functions and '
          f'{c_calls:.0f} of C functions')
    listeners = [Listener()]
    kinds: dict[str, Callable[[float, float], tuple[float, float]]] = {
        'system calls': measure_system_calls, 'driver': partial(measure, listeners[0])}
    if find_spec('rclpy') is not None:
        publisher = Publisher()
        listeners.append(publisher)
        kinds['calls and publish'] = partial(measure_system_calls, after=publisher.publish)
        kinds['driver and publish'] = partial(measure, publisher)
    rounds = [{name: kind(options.warm_up, options.seconds) for name, kind in kinds.items()}
              for _ in range(options.rounds)]
    print('                     transactions/s  processor time of each  median ratio   least')
    for name in kinds:
        rate, used = (median(one[name][column] for one in rounds) for column in (0, 1))
        ratios = [one[name][1] / one['system calls'][1] for one in rounds]
        print(f'{name:19}  {rate:14.0f}  {1e6 * used:19.1f} us  {median(ratios):12.2f}'
              f'  {min(ratios):6.2f}')
    print('troubles:', sum(listener.troubles for listener in listeners))


if __name__ == '__main__':
    main()
