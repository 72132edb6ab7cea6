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
Measure what a read takes at an eip: place and at a raw tcp: place, beside the line itself.

Method. A driver in Mode Peer has a line at whose other end a PLC answers in another process, each
byte at the moment at which a port would have sent it. One row is read each second. Two programs,
one at each place, read 20 words in turns, so both meet the same moments of this host. "line" is
the time of the characters of command and reply, and of their ACKs.

Run it as "python test/lab/benchmarks/ethernet_place.py"; it needs nothing but the package.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import socket
import struct
import sys
import time

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:4])

from abdf1_ros.driver.driver import Driver  # noqa: E402
from abdf1_ros.driver.guests import GuestListener  # noqa: E402
from abdf1_ros.driver.settings import DriverSettings  # noqa: E402
from abdf1_ros.plan.forecast import line_model  # noqa: E402
from abdf1_ros.ports.clock import line_time  # noqa: E402
from abdf1_ros.ports.descriptor import DescriptorPort  # noqa: E402
from abdf1_ros.ports.link_thread import LinkThread  # noqa: E402
from abdf1_ros.settings.network import Network  # noqa: E402
from abdf1_ros.settings.share import share_places  # noqa: E402
from abdf1_ros.share.guest_line import guest_place  # noqa: E402
from benchmarks.paced_line import answering_pty, far_end  # noqa: E402
from support.driver_bench import Recorder  # noqa: E402
from support.ethernet_ip import EthernetClient  # noqa: E402
from support.mappings import make_mapping  # noqa: E402
from support.odd_device import ACK, frame  # noqa: E402

WORDS = 20
_COMMAND = bytes((0xA2, 2 * WORDS, 7, 0x89, 0, 0))
_HOST = '127.0.0.1'


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--reads', type=int, default=300, help='at each place (300)')
    parser.add_argument('--baud', type=int, nargs='+', default=[9600, 19200, 115200])
    options = parser.parse_args()
    print(f'{"baud":>6}{"line":>9}{"tcp: 50, 99 %":>20}{"eip: 50, 99 %":>20}'
          f'{"eip - line":>13}   ms')
    for baud in options.baud:
        with places(baud) as (network, ports):
            tcp, eip = _measured(ports, options.reads)
        line = line_model(network).transaction_time(len(_COMMAND), 2 * WORDS) * 1000
        print(f'{baud:6}{line:9.2f}' + ''.join(f'{_part(each, 0.5):11.2f}{_part(each, 0.99):9.2f}'
                                               for each in (tcp, eip))
              + f'{_part(eip, 0.5) - line:12.2f}', flush=True)


def _part(times: list[float], share: float) -> float:
    """Return the time (ms) that this share of reads does not exceed."""
    return sorted(times)[int(share * (len(times) - 1))] * 1000


def _measured(ports: list[int], reads: int) -> tuple[list[float], list[float]]:
    with socket.create_connection((_HOST, ports[0])) as raw, \
            EthernetClient(_HOST, ports[1]) as client:
        raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        tcp, eip = list[float](), list[float]()
        for tns in range(1, reads + 6):
            for ask, times in ((lambda command: _by_df1(raw, command), tcp),
                               (client.execute, eip)):
                begun = time.monotonic()
                told = ask(struct.pack('<BBH', 0x0F, 0, tns << 8 & 0xFF00 | 0x22) + _COMMAND)
                times.append(time.monotonic() - begun)
                assert told[1] == 0 and len(told) == 4 + 2 * WORDS
        return tcp[5:], eip[5:]  # the first ones wait for the first read of the line


def _by_df1(raw: socket.socket, command: bytes) -> bytes:
    """Send a command in a frame; return the reply, from CMD on."""
    raw.sendall(frame(bytes((1, 0)) + command))
    data = b''
    while b'\x10\x03' not in data or len(data) < data.index(b'\x10\x03') + 4:
        data += raw.recv(4096)
    raw.sendall(ACK)
    assert data.startswith(ACK + b'\x10\x02')
    return data[6:data.index(b'\x10\x03')].replace(b'\x10\x10', b'\x10')


@contextmanager
def places(baud: int) -> Iterator[tuple[Network, list[int]]]:
    """Give the ports of a raw place and one that speaks EtherNet/IP, of one line."""
    ports = []
    for _ in range(2):
        with socket.create_server((_HOST, 0)) as free:
            ports.append(free.getsockname()[1])
    network = Network(mode='Peer', baud=baud, timeout=3000, cmd_timeout=5000,
                      share=f'tcp:{ports[0]} eip:{ports[1]}')
    rows = [make_mapping('N7:0', plc='SLC', length=WORDS, period=1000)]
    driver = Driver(network, rows, DriverSettings(), Recorder(line_time))
    with answering_pty(far_end(network, 1, rows), network.timing.char_time) as descriptor:
        near = LinkThread(driver.machine, lambda: DescriptorPort(
            ours := os.dup(descriptor), lambda: os.close(ours)))
        guests = [guest_place(place, (1,), network, driver.guests, near.wake, GuestListener(),
                              _refuse) for place in share_places(network.share)]
        for thread in near, *guests:
            thread.start()
        _wait_for(lambda: near.state.is_open and all(
            guest.state == 'waiting for a client' for guest in guests))
        try:
            yield network, ports
        finally:
            for thread in *guests, near:
                thread.stop()


def _refuse(error: Exception) -> None:
    raise error


def _wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


if __name__ == '__main__':
    main()
