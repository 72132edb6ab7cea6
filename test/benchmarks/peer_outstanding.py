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
Measure what more than one outstanding command brings on a full-duplex line.

Method. Two pseudo-terminals, and between them a thread for each direction that hands on every
byte at the moment it would have left a port of --baud (10 bits a character). At one end the
simulator's peer with a PLC-5 table: responses (ACK) go out at once, each reply --think ms
after it was ready, one after the other, as a PLC that serves its port once in a program scan.
At the other end the driver in Mode Peer, with a map of ten blocks of ten words in ten files
that are all read as often as the line allows. For each setting of max_outstanding the driver
runs --seconds; the first second does not count. "poll cycle" is how long the slowest block
waited between its last two reads, averaged over ten looks a second; "troubles" counts errors
and retries, of which there should be none.

Run it as "python test/benchmarks/peer_outstanding.py"; it needs nothing but the package.
"""

from __future__ import annotations

import argparse
from collections import deque
import math
from pathlib import Path
import sys
import threading
import time

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:3])

from abdf1_ros.df1.frames import Duplex, STX  # noqa: E402
from abdf1_ros.df1.machine import LineTiming, Machine  # noqa: E402
from abdf1_ros.df1.peer import FullDuplexPeer, PeerSettings  # noqa: E402
from abdf1_ros.df1.stations import ActiveStationList  # noqa: E402
from abdf1_ros.driver.driver import Driver  # noqa: E402
from abdf1_ros.driver.links import DriverSettings  # noqa: E402
from abdf1_ros.pccc.data_table import DataTable  # noqa: E402
from abdf1_ros.pccc.file_types import PlcType  # noqa: E402
from abdf1_ros.ports.link_thread import Port  # noqa: E402
from abdf1_ros.settings.mapping import Mapping  # noqa: E402
from abdf1_ros.settings.network import BAUD_RATES, Network  # noqa: E402
from abdf1_ros.simulator.simulated_plc import SimulatedPlc  # noqa: E402
from paced_line import BITS, Listener, paced_line  # noqa: E402
from support.mappings import make_mapping  # noqa: E402

BLOCKS = range(20, 30)  # file numbers
WORDS = 10


class ThinkingPort:
    """A port on which messages leave later than responses."""

    def __init__(self, port: Port, think: float) -> None:
        self._port = port
        self._think = think
        self._waiting: deque[bytes] = deque()
        self._news = threading.Condition()
        self._closed = False
        threading.Thread(target=self._run, daemon=True).start()

    def read(self, timeout: float | None, wake: int) -> bytes:
        """Wait for bytes."""
        return self._port.read(timeout, wake)

    def write(self, data: bytes) -> None:
        """Send the responses, and put the message after them aside."""
        start = data.find(STX)
        start = len(data) if start < 0 or not self._think else start
        if start:
            self._port.write(data[:start])
        if data[start:]:
            with self._news:
                self._waiting.append(data[start:])
                self._news.notify()

    def _run(self) -> None:
        while not self._closed:
            with self._news:
                self._news.wait_for(lambda: bool(self._waiting) or self._closed)
            time.sleep(self._think)
            with self._news:
                if self._closed:
                    return
                self._port.write(self._waiting.popleft())

    def unsent(self) -> int:
        """Return 0: all has left."""
        return 0

    def close(self) -> None:
        """Close the port."""
        with self._news:
            self._closed = True
            self._news.notify()
        self._port.close()


def mappings() -> list[Mapping]:
    """Return ten rows that no command can read together."""
    return [make_mapping(f'N{number}:0', length=WORDS, item=number, period=0)
            for number in BLOCKS]


def measure(outstanding: int, baud: int, think: float,
            seconds: float) -> tuple[float, float, int, float]:
    """Return transactions per second, poll cycle, troubles, and line time of a transaction."""
    network = Network(mode='Peer', baud=baud)
    table = DataTable(PlcType.PLC5)
    for mapping in mappings():
        table.create(mapping.address, WORDS)
    plc = SimulatedPlc(1, table, network.checksum, time.monotonic)
    listener = Listener()
    driver = Driver(network, mappings(), DriverSettings(max_outstanding=outstanding), listener)
    far = Machine(
        lambda machine: FullDuplexPeer(
            machine, PeerSettings(network.checksum), ActiveStationList(), plc.serve).run(plc),
        checksum=network.checksum, duplex=Duplex.FULL, timing=LineTiming(BITS / baud))
    with paced_line(driver.machine, far, baud, lambda port: ThinkingPort(port, think)):
        time.sleep(1.0)
        began, before, scans = time.monotonic(), driver.transactions, []
        while time.monotonic() - began < seconds:
            time.sleep(0.1)
            scans.append(driver.poll_cycle or math.nan)
        passed, done = time.monotonic() - began, driver.transactions - before
    line_time = driver.blocks[0].line_time
    return done / passed, sum(scans) / len(scans), listener.troubles, line_time


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--baud', type=int, choices=BAUD_RATES, default=19200)
    parser.add_argument('--think', type=float, default=20.0, metavar='MS')
    parser.add_argument('--seconds', type=float, default=10.0)
    parser.add_argument('--outstanding', type=int, nargs='+', default=[1, 2, 3])
    options = parser.parse_args()
    print(f'{len(BLOCKS)} blocks of {WORDS} words, {options.baud} baud, '
          f'{options.think:g} ms of thinking per command, {options.seconds:g} s each')
    print('outstanding  transactions/s  poll cycle   ratio  troubles')
    first = math.nan
    for outstanding in options.outstanding:
        rate, scan, troubles, line_time = measure(
            outstanding, options.baud, options.think / 1000, options.seconds)
        first = rate if math.isnan(first) else first
        print(f'{outstanding:11d}  {rate:14.1f}  {1000 * scan:6.0f} ms  {rate / first:6.2f}'
              f'  {troubles:8d}', flush=True)
    print(f'characters of one transaction take {1000 * line_time:.1f} ms in both directions')


if __name__ == '__main__':
    main()
