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
Measure how long a value takes from the line to the callback of a subscriber.

Method. The node runs in a process of its own with --mappings rows of one word, a hundred to a
block, every --period ms each, and one row that is read by itself every --fast ms. The PLC
answers in a second process, on a pseudo-terminal that takes no time; after the last byte of
each message it has written, it notes the moment, and its words count the messages. The
subscriber is this process, the third: its callback notes the moment as well, and the value says
which message it came with. All processes read the same clock.

Three rows are listened to: the one by itself, and the first and the last of a block, which are
published one after the other from the same reply: what the last waits for are the 99 others.
"no node" is what ROS and this machine take by themselves: a bare publisher in a process, every
--fast ms, from just before it publishes. The goal is a median below 0.3 ms, and below 3 ms for
99 of 100.

Run it as "python test/lab/benchmarks/node_latency.py"; it needs ROS, or the wheels of it.
"""

import argparse
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
import itertools
import mmap
import os
import signal
from statistics import median
import time
from typing import Any

from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.slave import multidrop
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
from node_rig import files, IN_A_FILE, rows, running_node, STATION
from paced_line import answering_pty
from std_msgs.msg import Int16MultiArray
from support.ros import Observer

MESSAGES = 0x8000  # as many as an int16 counts
SHORTEST = 10  # bytes of a message; control symbols are shorter
ALONE = 'N9:0'


class CountingPlc:
    """A PLC whose ``counters`` show the number of its next message, and when those were sent."""

    def __init__(self, addresses: list[Address], counters: list[Address]) -> None:
        self.table = DataTable(PlcType.SLC)
        self.counters = counters
        for address in addresses:
            self.table.create(address, 1)
        plc = SimulatedPlc(STATION, self.table, Network().checksum, time.monotonic)
        self.machine = Machine(multidrop([plc]), checksum=Network().checksum)
        self.number = 0
        self.moments = shared_moments()

    def sent(self, data: bytes) -> None:
        """Note the moment, and count."""
        if len(data) >= SHORTEST:
            self.moments[self.number] = time.monotonic()
            self.number = (self.number + 1) % MESSAGES
            words = self.number.to_bytes(2, 'little')
            for address in self.counters:
                self.table.write(address, words)


def shared_moments() -> memoryview:
    """Return room for the moment of every message, for this process and its children."""
    return memoryview(mmap.mmap(-1, 8 * MESSAGES)).cast('d')


def listener(moments: memoryview, latencies: list[float]) -> Callable[[Any], None]:
    """Return a callback that notes how old a value is."""
    def take(message: Any) -> None:
        latencies.append(time.monotonic() - moments[message.data[0]])
    return take


def collect(observer: Observer, found: Iterable[list[float]], seconds: float) -> None:
    """Listen, from the first value of each topic on."""
    observer.until(lambda: all(found), 'a value on every topic')
    for latencies in found:
        latencies.clear()
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        observer.executor.spin_once(timeout_sec=0.1)


@contextmanager
def bare_publisher(moments: memoryview, period: float) -> Iterator[None]:
    """Publish the number of the message every ``period`` s, in a process."""
    process = os.fork()
    if process == 0:
        try:
            with Observer('publisher') as observer:
                publisher = observer.node.create_publisher(Int16MultiArray, '/bare', 10)
                for number in itertools.cycle(range(MESSAGES)):
                    time.sleep(period)
                    moments[number] = time.monotonic()
                    publisher.publish(Int16MultiArray(data=[number]))
        finally:
            os._exit(1)
    try:
        yield
    finally:
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)


def measure_without_node(options: argparse.Namespace) -> list[float]:
    """Return the latencies (s) from a bare publisher."""
    moments, latencies = shared_moments(), list[float]()
    with bare_publisher(moments, options.fast / 1000), Observer() as observer:
        observer.node.create_subscription(
            Int16MultiArray, '/bare', listener(moments, latencies), 10)
        collect(observer, [latencies], options.seconds / 3)
    return latencies


def measure(options: argparse.Namespace) -> dict[str, list[float]]:
    """Return the latencies (s) of each row that is listened to."""
    found: dict[str, list[float]] = {'alone': [], 'w0': [], f'w{IN_A_FILE - 1}': []}
    table_rows = [f'alone,Read,{ALONE},{STATION},SLC,{options.fast}',
                  *rows(options.mappings, options.period)]
    with files(table_rows, 115200) as (net, table, mappings), Observer() as observer:
        places = {mapping.tag: mapping.address for mapping in mappings}
        plc = CountingPlc(list(places.values()), [places[tag] for tag in found])
        for tag, latencies in found.items():
            observer.node.create_subscription(
                Int16MultiArray, f'/abdf1/read/{tag}', listener(plc.moments, latencies), 10)
        with answering_pty(plc.machine, 0.0, sent=plc.sent) as line, \
                running_node(net, table, os.ttyname(line)):
            collect(observer, found.values(), options.seconds)
    return found


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--mappings', type=int, default=500)
    parser.add_argument('--period', type=int, default=500, metavar='MS')
    parser.add_argument('--fast', type=int, default=10, metavar='MS')
    parser.add_argument('--seconds', type=float, default=30.0)
    options = parser.parse_args()
    print(f'{options.mappings} mappings, {options.period} ms each, one {options.fast} ms; '
          f'load of the machine {os.getloadavg()[0]:.1f}; in ms')
    print('row      values   least  median    99 %  longest')
    for tag, latencies in {'no node': measure_without_node(options), **measure(options)}.items():
        latencies.sort()
        figures = (latencies[0], median(latencies), latencies[int(0.99 * len(latencies))],
                   latencies[-1])
        print(f'{tag:7}  {len(latencies):6d}  '
              + '  '.join(f'{1000 * figure:6.3f}' for figure in figures), flush=True)


if __name__ == '__main__':
    main()
