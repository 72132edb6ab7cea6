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
duplex (Mode Peer), on a line of each speed whose other end answers at once (``answering_socket``
in ``paced_line``). "byte time" is that of all characters of a transaction, in both directions
one after the other: the planner's ``line_time``, which a test compares with real frames. Then
--transactions are timed, from value to value; the first three do not count. "bare" is as many
exchanges on the same line of bytes that are known beforehand: write, wait, read. No driver can
do better on this machine in this minute. Both take turns, --rounds times, and both run before all
other work of the machine where that is allowed (as root). The table gives the one in the middle of
each and the limit of the fastest tenth, as a multiple of the byte time, and by how much the middle
of the driver's is above that of bare. The goal is 1 % up to 38400 baud and 2.5 % at 115200; "over"
marks where it is missed.

Run it as "python test/lab/benchmarks/wire_efficiency.py"; it needs nothing but the package.
"""

import argparse
from collections.abc import Sequence
from itertools import pairwise
import os
from pathlib import Path
import statistics
import sys
import threading
import time

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:4])

from abdf1_ros.df1 import frames  # noqa: E402
from abdf1_ros.df1.packet import Packet  # noqa: E402
from abdf1_ros.driver.driver import Driver  # noqa: E402
from abdf1_ros.driver.settings import DriverSettings  # noqa: E402
from abdf1_ros.pccc.families import parse_address  # noqa: E402
from abdf1_ros.pccc.file_types import PlcType  # noqa: E402
from abdf1_ros.pccc.slc.dialect import SlcDialect  # noqa: E402
from abdf1_ros.pccc.values import Values  # noqa: E402
from abdf1_ros.ports.descriptor import DescriptorPort  # noqa: E402
from abdf1_ros.ports.link_thread import LinkThread  # noqa: E402
from abdf1_ros.settings import BAUD_RATES  # noqa: E402
from abdf1_ros.settings.mapping import Mapping  # noqa: E402
from abdf1_ros.settings.network import Network  # noqa: E402
from paced_line import (  # noqa: E402
    answering_socket,
    BareLine,
    BITS,
    far_end,
    Listener,
)
from support.mappings import make_mapping  # noqa: E402

MODES = ('Master', 'Peer')
SIZES = (1, 10, 50, 110)
SPEEDS = (9600, 19200, 38400, 115200)
STATION = 1
WARM_UP = 3
LONGEST_READ = 2.0  # s


class Watch(Listener):
    """Notes when values come, up to so many; then ``is_full``."""

    def __init__(self, count: int) -> None:
        super().__init__()
        self.times: list[float] = []
        self.is_full = threading.Event()
        self._count = count

    def read(self, mapping: Mapping, values: Values) -> None:
        """Note the time."""
        self.times.append(time.monotonic())
        if len(self.times) == self._count:
            self.is_full.set()


def measure(network: Network, words: int, count: int) -> tuple[float, list[float], int]:
    """Return byte time and times of transactions (s), and troubles."""
    mapping = make_mapping(station=STATION, plc='SLC', length=words, period=0)
    watch = Watch(count + WARM_UP)
    driver = Driver(network, [mapping], DriverSettings(processor_period=0.0), watch)
    with answering_socket(far_end(network, STATION, [mapping]), BITS / network.baud) as near:
        port = DescriptorPort(near, lambda: None)
        port.is_terminal = True
        link = LinkThread(driver.machine, lambda: port)
        link.start()
        is_full = watch.is_full.wait(LONGEST_READ * (count + WARM_UP))
        link.stop()
    if not is_full:
        raise SystemExit(f'{len(watch.times)} of {count + WARM_UP} reads came')
    block, = driver.readings.blocks
    return block.line_time, _steps(watch.times, count), watch.troubles


def measure_bare(network: Network, words: int, count: int) -> list[float]:
    """Return the times (s) that the same bytes take without a driver."""
    mapping = make_mapping(station=STATION, plc='SLC', length=words)
    known = [_exchanges(network, words, tns) for tns in range(count + WARM_UP)]
    times = []
    with answering_socket(far_end(network, STATION, [mapping]), BITS / network.baud) as near:
        line = BareLine(near)
        for exchanges in known:
            for sent, expected in exchanges:
                line.ask(sent, expected)
            times.append(time.monotonic())
    return _steps(times, count)


def _exchanges(network: Network, words: int, tns: int) -> list[tuple[bytes, int]]:
    """Return what is sent in a transaction, and how many bytes come after each."""
    cmd, body = SlcDialect().read(parse_address('N7:0', PlcType.SLC), words)
    command, check = Packet(STATION, network.station, cmd, 0, tns, body), network.checksum
    data, acknowledgement = command.encode(), frames.ACK if tns else b''
    reply = len(frames.message_frame(command.reply(bytes(2 * words)).encode(), check))
    if network.mode == 'Master':
        return [(acknowledgement + frames.master_frame(STATION, data, check), len(frames.ACK)),
                (frames.poll_frame(STATION), reply)]
    return [(acknowledgement + frames.message_frame(data, check), len(frames.ACK) + reply)]


def _steps(times: Sequence[float], count: int) -> list[float]:
    return [later - earlier for earlier, later in pairwise(times[-count - 1:])]


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--mode', nargs='+', choices=MODES, default=MODES)
    parser.add_argument('--baud', type=int, nargs='+', choices=BAUD_RATES, default=SPEEDS)
    parser.add_argument('--words', type=int, nargs='+', default=SIZES)
    parser.add_argument('--transactions', type=int, default=12)
    parser.add_argument('--rounds', type=int, default=3)
    options = parser.parse_args()
    print(f'{options.rounds} times {options.transactions} reads each; load of the machine '
          f'{os.getloadavg()[0]:.1f}')
    print('                                middle      fastest tenth')
    print('mode      baud  words  byte time    bare  driver    bare  driver   above      troubles')
    for mode in options.mode:
        for baud in options.baud:
            for words in options.words:
                _print_row(Network(mode=mode, baud=baud, timeout=2000), words, options)


def _print_row(network: Network, words: int, options: argparse.Namespace) -> None:
    bare: list[float] = []
    ours: list[float] = []
    troubles = 0
    for _ in range(options.rounds):
        bare += measure_bare(network, words, options.transactions)
        byte_time, steps, more = measure(network, words, options.transactions)
        ours += steps
        troubles += more
    middle = [statistics.median(times) / byte_time for times in (bare, ours)]
    fast = [statistics.quantiles(times, n=10)[0] / byte_time for times in (bare, ours)]
    above = 100 * (middle[1] / middle[0] - 1)
    is_over = above > (1 if network.baud <= 38400 else 2.5)
    print(f'{network.mode:6}  {network.baud:6d}  {words:5d}  {1000 * byte_time:6.1f} ms'
          f'  {middle[0]:6.3f}  {middle[1]:6.3f}  {fast[0]:6.3f}  {fast[1]:6.3f}'
          f'  {above:4.1f} %  {"over" if is_over else "    "}  {troubles:4d}', flush=True)


if __name__ == '__main__':
    main()
