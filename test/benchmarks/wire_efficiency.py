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
Measure how much of the line's time the driver makes use of.

Method. The driver reads one block of an SLC again and again, half duplex (Mode Master) and full
duplex (Mode Peer), on a line of each speed whose other end answers at once (``answering_line``
in ``paced_line``). "byte time" is that of all characters of a transaction, in both directions
one after the other: the planner's ``line_time``, which a test compares with real frames. Then
--transactions are timed, from value to value; the first three do not count. The table gives
what they took as a multiple of the byte time: all of them, the one in the middle, and the
fastest, which the other work of the machine disturbs least. The goal is 1.02 up to 38400 baud
and 1.05 at 115200; "over" marks where the middle one misses it. "bare" is the middle one of as
many exchanges on the same line of bytes that are known beforehand: write, wait, read. No driver
can do better on this machine in this minute.

Run it as "python test/benchmarks/wire_efficiency.py"; it needs nothing but the package.
"""

import argparse
from itertools import pairwise
import os
from pathlib import Path
import statistics
import sys
import time

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:3])

from abdf1_ros.df1 import frames  # noqa: E402
from abdf1_ros.df1.packet import Packet  # noqa: E402
from abdf1_ros.driver.driver import Driver  # noqa: E402
from abdf1_ros.driver.links import DriverSettings  # noqa: E402
from abdf1_ros.pccc.families import parse_address  # noqa: E402
from abdf1_ros.pccc.file_types import PlcType  # noqa: E402
from abdf1_ros.pccc.slc.dialect import SlcDialect  # noqa: E402
from abdf1_ros.pccc.values import Values  # noqa: E402
from abdf1_ros.settings.mapping import Mapping  # noqa: E402
from abdf1_ros.settings.network import BAUD_RATES, Network  # noqa: E402
from paced_line import (  # noqa: E402
    answering_line,
    answering_pty,
    BareLine,
    BITS,
    far_end,
    Listener,
)
from support.mappings import make_mapping  # noqa: E402

SIZES = (1, 10, 50, 110)
SPEEDS = (9600, 19200, 38400, 115200)
STATION = 1
WARM_UP = 3


class Watch(Listener):
    """Notes when values come."""

    def __init__(self) -> None:
        super().__init__()
        self.times: list[float] = []

    def read(self, mapping: Mapping, values: Values) -> None:
        """Note the time."""
        self.times.append(time.monotonic())


def measure(mode: str, baud: int, words: int, count: int) -> tuple[float, list[float], int]:
    """Return byte time and times of transactions (s), and troubles."""
    network = Network(mode=mode, baud=baud, timeout=2000)
    mapping = make_mapping(station=STATION, plc='SLC', length=words, period=0)
    watch = Watch()
    driver = Driver(network, [mapping], DriverSettings(processor_period=0.0), watch)
    with answering_line(driver.machine, far_end(network, STATION, [mapping]), baud):
        while len(watch.times) < count + WARM_UP + 1:
            time.sleep(0.02)
    times = watch.times[WARM_UP:]
    steps = [later - earlier for earlier, later in zip(times, times[1:], strict=False)]
    block, = driver.blocks
    return block.line_time, steps, watch.troubles


def measure_bare(mode: str, baud: int, words: int, count: int) -> list[float]:
    """Return the times (s) that the same bytes take without a driver."""
    network = Network(mode=mode, baud=baud, timeout=2000)
    address = parse_address('N7:0', PlcType.SLC)
    mapping = make_mapping(station=STATION, plc='SLC', length=words)
    cmd, body = SlcDialect().read(address, words)
    ack, check = len(frames.ACK), network.checksum
    times = []
    with answering_pty(far_end(network, STATION, [mapping]), BITS / baud) as descriptor:
        line, acknowledgement = BareLine(descriptor), b''
        for tns in range(count + WARM_UP):
            command = Packet(STATION, network.station, cmd, 0, tns, body)
            data = command.encode()
            reply = len(frames.message_frame(command.reply(bytes(2 * words)).encode(), check))
            if mode == 'Master':
                line.ask(acknowledgement + frames.master_frame(STATION, data, check), ack)
                line.ask(frames.poll_frame(STATION), reply)
            else:
                line.ask(acknowledgement + frames.message_frame(data, check), ack + reply)
            times.append(time.monotonic())
            acknowledgement = frames.ACK
    return [later - earlier for earlier, later in pairwise(times[WARM_UP - 1:])]


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--baud', type=int, nargs='+', choices=BAUD_RATES, default=SPEEDS)
    parser.add_argument('--transactions', type=int, default=12)
    options = parser.parse_args()
    print(f'{options.transactions} reads each; load of the machine {os.getloadavg()[0]:.1f}')
    print('mode      baud  words  byte time      bare       all    middle   fastest'
          '        troubles')
    for mode in ('Master', 'Peer'):
        for baud in options.baud:
            for words in SIZES:
                byte_time, steps, troubles = measure(mode, baud, words, options.transactions)
                middle = statistics.median(steps)
                bare = statistics.median(measure_bare(mode, baud, words, options.transactions))
                goal = 1.02 if baud <= 38400 else 1.05
                print(f'{mode:6}  {baud:6d}  {words:5d}  {1000 * byte_time:6.1f} ms'
                      f'  {bare / byte_time:8.3f}  {statistics.mean(steps) / byte_time:8.3f}'
                      f'  {middle / byte_time:8.3f}  {min(steps) / byte_time:8.3f}'
                      f'  {"over" if middle / byte_time > goal else "    "}  {troubles:8d}',
                      flush=True)


if __name__ == '__main__':
    main()
