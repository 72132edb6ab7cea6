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
A line for benchmarks: two pseudo-terminals, paced as a port of that speed would be.

Between them a thread for each direction hands on every byte at the moment it would have left
the port (10 bits a character). ``measure`` runs the driver at one end against simulated
stations at the other, and counts what it does in a time.

``answering_socket`` is for measuring the driver alone: line and stations are one process, which
knows what it will answer while the question is still "on the line". So its answers begin at
the exact time, and all that is lost is lost by the driver and the operating system.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, ExitStack, suppress
from dataclasses import dataclass
import math
import os
import select
import signal
import socket
import threading
import time
import traceback
import tty

from abdf1_ros.df1.frames import ACK, Duplex
from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.peer import FullDuplexPeer
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import multidrop
from abdf1_ros.df1.stations import ActiveStationList, Station
from abdf1_ros.driver import driver
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.messages import Event, Severity
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import parse_address  # noqa: E402
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.ports.descriptor import DescriptorPort, Port
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.problems import Place
from abdf1_ros.settings.mapping import Command, Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import SimulatedPlc

BITS = 10
WORDS = 10


class Wire(threading.Thread):
    """One direction of the line: hands on bytes at the speed of a port."""

    def __init__(self, source: int, target: int, char_time: float) -> None:
        super().__init__(daemon=True)
        self._source, self._target, self._char_time = source, target, char_time
        self.stopping = False

    def run(self) -> None:
        """Hand on bytes, each when it has left."""
        free = time.monotonic()
        while not self.stopping:
            if not select.select([self._source], [], [], 0.1)[0]:
                continue
            data = os.read(self._source, 4096)
            free = max(free, time.monotonic())
            for byte in data:
                free += self._char_time
                time.sleep(max(0.0, free - time.monotonic()))
                os.write(self._target, bytes((byte,)))


class Listener(driver.Listener):
    """Counts what should not happen."""

    def __init__(self) -> None:
        self.troubles = 0

    def unreadable(self, mapping: Mapping, reason: str) -> None:
        """Count a read without a value."""
        self.troubles += 1

    def happened(self, event: Event) -> None:
        """Count errors and retries."""
        self.troubles += event.message.severity is Severity.ERROR or event.message.number in (
            2519, 2520, 2521, 2522)

    def station_changed(self, station: Station) -> None:
        """Count a lost station."""
        self.troubles += not station.active


def block_of(station: int) -> Mapping:
    """Return the row that reads ten words of a station, as often as the line allows."""
    name = f's{station}'
    return Mapping(
        item=station, place=Place('map.csv', station), tag=name, name=name, command=Command.READ,
        address=parse_address('N7:0', PlcType.SLC), station=station, plc_type=PlcType.SLC,
        length=WORDS, type=ValueType.INT16, topic=name, period=0)


def simulated(station: int, network: Network, delay: float = 0.0) -> SimulatedPlc:
    """Return a PLC whose replies are ready ``delay`` s after the command."""
    table = DataTable(PlcType.SLC)
    table.create(parse_address('N7:0', PlcType.SLC), WORDS)
    plc = SimulatedPlc(station, table, network.checksum, time.monotonic)
    plc.faults.delay = delay
    return plc


def far_end(network: Network, station: int, mappings: Sequence[Mapping]) -> Machine:
    """Return a PLC that has all words of ``mappings`` and answers at once."""
    table = DataTable(mappings[0].plc_type)
    for mapping in mappings:
        table.create(mapping.address, mapping.codec.words)
    plc = SimulatedPlc(station, table, network.checksum, time.monotonic)
    if network.duplex is Duplex.HALF:
        return Machine(multidrop([plc]), checksum=network.checksum)
    return Machine(
        lambda machine: FullDuplexPeer(
            machine, LinkSettings(station=None, checksum=network.checksum), ActiveStationList(),
            plc.serve).run(plc),
        checksum=network.checksum, duplex=Duplex.FULL)


@dataclass(frozen=True, slots=True)
class Measured:
    """What a run has shown: per second, in seconds, and counts."""

    transactions: float
    poll_cycle: float
    slowest_scan: float
    troubles: int
    polls: float


@contextmanager
def paced_line(near: Machine, far: Machine, baud: int,
               far_end: Callable[[Port], Port] = lambda port: port) -> Iterator[None]:
    """Run two machines at the ends of a paced line; ``far_end`` may wrap the far port."""
    with ExitStack() as stack:
        pairs = [os.openpty(), os.openpty()]
        for pair in pairs:
            tty.setraw(pair[1])
            for descriptor in pair:
                stack.callback(os.close, descriptor)

        def open_port(side: int) -> DescriptorPort:
            descriptor = os.dup(pairs[side][1])
            return DescriptorPort(descriptor, lambda: os.close(descriptor))

        wires = [Wire(pairs[0][0], pairs[1][0], BITS / baud),
                 Wire(pairs[1][0], pairs[0][0], BITS / baud)]
        links = [LinkThread(far, lambda: far_end(open_port(1))),
                 LinkThread(near, lambda: open_port(0))]
        for thread in [*wires, *links]:
            thread.start()
        yield
        for link in links:
            link.stop()
        for wire in wires:
            wire.stopping = True
            wire.join()


class BareLine:
    """
    The line as one must use it with any driver: write, wait, read.

    What it takes is what the operating system and Python take, and no driver can do without.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self._ready = select.poll()
        self._ready.register(descriptor, select.POLLIN)

    def ask(self, data: bytes, count: int) -> None:
        """Send ``data``, wait for so many bytes."""
        os.write(self._descriptor, data)
        while count > 0:
            self._ready.poll()
            count -= len(os.read(self._descriptor, 4096))


class _AnsweringLine:
    """
    A half-duplex line, or two wires, with ``far`` at its other end, on ``descriptor``.

    Each answer begins ``response_time`` s after the last character of what it answers. Where
    it is allowed to, the process runs before all others, as the hardware it stands for does.
    """

    # A process that sleeps comes back late by up to this; the rest of a wait it stays awake.
    _LATE = 0.0002
    # Bytes that a UART hands over at a time.
    _CHUNK = 8

    def __init__(self, descriptor: int, far: Machine, char_time: float,
                 response_time: float, sent: Callable[[bytes], None]) -> None:
        self._descriptor = descriptor
        self._sent = sent
        self._far = far
        self._char_time = char_time
        self._response_time = response_time
        self._free = 0.0

    def run(self) -> None:
        """Answer for ever."""
        _go_ahead()
        self._far.start(time.monotonic())
        while True:
            deadline = self._far.next_call
            timeout = None if deadline is None else max(0.0, deadline - time.monotonic())
            if select.select([self._descriptor], [], [], timeout)[0]:
                data = os.read(self._descriptor, 4096)
                self._free = max(self._free, time.monotonic()) + len(data) * self._char_time
                self._far.receive_data(data, self._free)
            else:
                self._far.handle_timeout(time.monotonic())
            data = self._far.data_to_send()
            if data:
                self._send(data)
                self._sent(data)

    def _send(self, data: bytes) -> None:
        if data.startswith(ACK) and len(data) > len(ACK):  # a peer's, and its reply behind it
            self._send(ACK)
            data = data[len(ACK):]
        self._free += self._response_time
        for at in range(0, len(data), self._CHUNK):
            chunk = data[at:at + self._CHUNK]
            self._free += len(chunk) * self._char_time
            time.sleep(max(0.0, self._free - time.monotonic() - self._LATE))
            while time.monotonic() < self._free:
                pass
            os.write(self._descriptor, chunk)


@contextmanager
def answering_socket(far: Machine, char_time: float) -> Iterator[int]:
    """
    Give the near end of a line that has no pseudo-terminal, else as ``answering_pty``.

    What is written to a pseudo-terminal is handed on by a thread of the kernel, which mostly waits
    until the writer leaves the processor. A port sends at once, and so does a socket. Where there
    are several processors each end has its own, and is ahead of all others if that is allowed.
    """
    processors = os.sched_getaffinity(0)
    theirs, ours = socket.socketpair()
    with ours, theirs, _answering(theirs.fileno(), ours.fileno(), far, char_time) as process:
        os.sched_setaffinity(process, {max(processors)})
        os.sched_setaffinity(0, processors - {max(processors)} or processors)
        _go_ahead()
        try:
            yield ours.fileno()
        finally:
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
            os.sched_setaffinity(0, processors)


def _go_ahead() -> None:
    """Run before all other processes, where that is allowed."""
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))


@contextmanager
def answering_pty(far: Machine, char_time: float, response_time: float = 0.0,
                  sent: Callable[[bytes], None] = lambda data: None) -> Iterator[int]:
    """
    Give the near end of a line at whose other end ``far`` answers, in a process.

    There ``sent`` is called with whatever has been sent.
    """
    theirs, ours = os.openpty()
    tty.setraw(ours)
    tty.setraw(theirs)
    try:
        with _answering(theirs, ours, far, char_time, response_time, sent):
            os.close(theirs)
            yield ours
    finally:
        os.close(ours)


@contextmanager
def _answering(theirs: int, ours: int, far: Machine, char_time: float, response_time: float = 0.0,
               sent: Callable[[bytes], None] = lambda data: None) -> Iterator[int]:
    """Answer in another process, for as long as this lasts; give its number."""
    process = os.fork()
    if process == 0:
        try:
            os.close(ours)
            _AnsweringLine(theirs, far, char_time, response_time, sent).run()
        except Exception:
            traceback.print_exc()
        finally:
            os._exit(1)
    try:
        yield process
    finally:
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)


def measure(network: Network, mappings: list[Mapping], stations: list[SimulatedPlc],
            settle: float, seconds: float) -> Measured:
    """Run a master with ``mappings`` against ``stations``; the time to settle does not count."""
    listener = Listener()
    driver = Driver(network, mappings, DriverSettings(), listener)
    far = Machine(multidrop(stations), checksum=network.checksum)
    with paced_line(driver.machine, far, network.baud):
        time.sleep(settle)
        troubles = listener.troubles
        began, polls = time.monotonic(), driver.counters.polls_sent
        before = driver.tasks.transactions
        scans: list[float] = []
        while time.monotonic() - began < seconds:
            time.sleep(0.05)
            if (scan := driver.readings.reads.poll_cycle) is not None:
                scans.append(scan)
        passed = time.monotonic() - began
        done, polled = driver.tasks.transactions - before, driver.counters.polls_sent - polls
    mean = sum(scans) / len(scans) if scans else math.nan
    return Measured(done / passed, mean, max(scans, default=math.nan),
                    listener.troubles - troubles, polled / passed)
