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
Measure what a line notices of broken ones in its process.

Method. "lines" runs a sound line, as in many_lines.py at 19200 baud, and --neighbours others of
one kind, each with a device server of this table on a TCP port of its own:

  refuses    nobody listens
  closes     every connection is closed at once
  stalls     connections are accepted, and never written to or read
  dribbles   a byte every 10 ms
  noise      random bytes, as fast as the connection takes them
  enquiries  DLE ENQ, the same
  replies    good frames that nobody has asked for, the same
  commands   telnet commands that mean nothing, over rfc2217://, the same
  terminal   noise on a pseudo-terminal, as fast as that takes it; no serial port can do this

A row is the sound line's transactions a second, and the time from the end of a reply to its ACK,
for 50 and 99 % of them; "alone" is the same line without neighbours, before and after. Processor
time is that of the whole process, as part of one core. The neighbours are masters, or peers with
--mode Peer.

Run it as "python test/lab/benchmarks/hostile_neighbours.py"; it needs ROS, or the wheels of it.
"""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, ExitStack, suppress
import multiprocessing
import os
from random import Random
import select
import signal
import socket
import threading
import time
import tty

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ENQ, message_frame
from abdf1_ros.df1.packet import Packet
from many_lines import Rig, rigged
from node_rig import Running
from support.ros import Process, write_csv

FLOODS = {
    'noise': Random(1).randbytes(1 << 16),
    'enquiries': ENQ * (1 << 15),
    'replies': message_frame(Packet(5, 1, 0x4F, 0, 7, bytes(200)).encode(), Checksum.CRC) * 200,
    'commands': b'\xff\xf1' * (1 << 15)}

# DO COM-PORT, and the answers to 19200 baud, 8 data bits, no parity, 1 stop bit (RFC 2217).
_AGREED = bytes.fromhex('fffd2c fffa2c6500004b00fff0 fffa2c6608fff0 fffa2c6701fff0 fffa2c6801fff0')
KINDS = ('refuses', 'closes', 'stalls', 'dribbles', *FLOODS, 'terminal')


def serve(kind: str, listeners: Sequence[socket.socket]) -> None:
    """Be all neighbours."""
    for listener in listeners:
        threading.Thread(target=_serve, args=(kind, listener), daemon=True).start()
    signal.pause()


def _serve(kind: str, listener: socket.socket) -> None:
    while True:
        client, _ = listener.accept()
        with client, suppress(OSError):
            _behave(kind, client)


def _behave(kind: str, client: socket.socket) -> None:
    if kind == 'closes':
        return
    if kind == 'stalls':
        threading.Event().wait()
    while kind == 'dribbles':
        client.send(b'\x10')
        time.sleep(0.01)
    client.setblocking(True)
    threading.Thread(target=_swallow, args=(client,), daemon=True).start()
    if kind == 'commands':
        client.sendall(_AGREED)
    while True:
        client.sendall(FLOODS[kind])


def _swallow(client: socket.socket) -> None:
    with suppress(OSError):
        while client.recv(1 << 16):
            pass


def _flood(descriptors: Sequence[int]) -> None:
    while True:
        _, ready, _ = select.select([], descriptors, [])
        for descriptor in ready:
            os.write(descriptor, FLOODS['noise'][:256])


@contextmanager
def terminals(count: int) -> Iterator[list[str]]:
    """Run pseudo-terminals that are full of noise; yield their names."""
    pairs = [os.openpty() for _ in range(count)]
    for pair in pairs:
        for descriptor in pair:
            tty.setraw(descriptor)
    process = multiprocessing.Process(
        target=_flood, args=([far for far, _ in pairs],), daemon=True)
    process.start()
    try:
        yield [os.ttyname(near) for _, near in pairs]
    finally:
        process.kill()
        process.join()
        for pair in pairs:
            for descriptor in pair:
                os.close(descriptor)


@contextmanager
def neighbours(kind: str, count: int) -> Iterator[list[str]]:
    """Run neighbours of a kind; yield their ports."""
    if kind == 'terminal':
        with terminals(count) as ports:
            yield ports
        return
    listeners = [socket.create_server(('127.0.0.1', 0)) for _ in range(count)]
    scheme = 'rfc2217' if kind == 'commands' else 'socket'
    ports = [f'{scheme}://127.0.0.1:{listener.getsockname()[1]}' for listener in listeners]
    if kind == 'refuses':
        for listener in listeners:
            listener.close()
        yield ports
        return
    process = multiprocessing.Process(target=serve, args=(kind, listeners), daemon=True)
    process.start()
    for listener in listeners:
        listener.close()
    try:
        yield ports
    finally:
        process.kill()
        process.join()


def parameter_file(rig: Rig, ports: Sequence[str], mode: str) -> str:
    """Write the parameter file of the sound line and its neighbours."""
    net, table = rig.folder / 'bad_net.csv', rig.folder / 'bad_map.csv'
    write_csv(net, 'Baud,Timeout,Mode', [f'19200,1000,{mode}'])
    write_csv(table, 'Tag,Command,Address,Station,PLC_Type', ['w,Read,N7:0,1,SLC'])
    path = rig.parameters([0], 'lines.yaml')
    with open(path, 'a', encoding='utf-8') as file:
        for number, port in enumerate(ports):
            file.write(f'/bad/line_{number}:\n  ros__parameters:\n    port: {port}\n'
                       f'    net_file: {net}\n    map_file: {table}\n')
    return path


def measure(rig: Rig, ports: Sequence[str], options: argparse.Namespace) -> str:
    """Run the lines; return a row of the table."""
    path = parameter_file(rig, ports, options.mode)
    with Process('lines', '--ros-args', '--params-file', path, '--log-level', 'fatal',
                 '--log-level', 'lines:=info') as process:
        process.wait_for(f'{len(ports) + 1} of {len(ports) + 1} lines run')
        running = Running(process, 0.0)
        time.sleep(options.settle)
        rig.pipe.send('reset')
        used, begun = running.used(), time.monotonic()
        time.sleep(options.seconds)
        rig.pipe.send('tell')
        latencies, replies = rig.pipe.recv()[0]
        passed = time.monotonic() - begun
        used = running.used() - used
        begun = time.monotonic()
        process.send(signal.SIGINT)
        process.result()
        end = time.monotonic() - begun
    acks = sorted(latencies)
    text = ' / '.join(f'{acks[int(share * (len(acks) - 1))] * 1000:7.2f}'
                      for share in (0.5, 0.99) if acks)
    return (f'{replies / passed:8.1f} {text:>20} ms {used / passed:10.1%} {end:6.1f} s '
            f'{os.getloadavg()[0]:6.1f}')


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--kinds', nargs='+', default=KINDS, choices=KINDS)
    parser.add_argument('--neighbours', type=int, default=3)
    parser.add_argument('--mode', default='Master', choices=['Master', 'Peer'])
    parser.add_argument('--settle', type=float, default=3.0)
    parser.add_argument('--seconds', type=float, default=10.0)
    options = parser.parse_args()
    print(f'{options.neighbours} neighbours, Mode {options.mode}\n'
          'kind       trans/s     ACK 50 / 99 %      processor    end    load')
    for kind in ('alone', *options.kinds, 'alone'):
        with ExitStack() as stack:
            rig = stack.enter_context(rigged(1, 19200))
            ports = [] if kind == 'alone' else stack.enter_context(
                neighbours(kind, options.neighbours))
            print(f'{kind:10} {measure(rig, ports, options)}', flush=True)


if __name__ == '__main__':
    main()
