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

"""A pseudo-terminal with simulated PLCs at its other end, in this process."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import select
import threading
import time

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.slave import multidrop
from abdf1_ros.ports.descriptor import Port, PortAround
from abdf1_ros.ports.endpoints import PtyEndpoint
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.gateway import stations_of
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
from support.odd_device import OddDevice
from support.ptys import Pty

Leap = Callable[[float], None]
LOSSY = Network(timeout=30_000)  # on which no host stands still for too long


@contextmanager
def machine_line(path: Path, machine: Machine,
                 around: Callable[[Port], Port] = lambda port: port) -> Iterator[str]:
    """Run a machine on a line, ``around`` its port; yield the name of ours."""
    line = PtyEndpoint(str(path))
    link = LinkThread(machine, lambda: around(line.open()))
    link.start()
    try:
        yield line.name
    finally:
        link.stop()
        line.close()


@contextmanager
def plc_line(path: Path, *plcs: SimulatedPlc,
             around: Callable[[Port], Port] = lambda port: port) -> Iterator[str]:
    """Put PLCs on a half-duplex line with CRC, ``around`` their port; yield the name of ours."""
    machine = Machine(multidrop(stations_of(plcs, Checksum.CRC)), checksum=Checksum.CRC)
    with machine_line(path, machine, around) as name:
        yield name


@contextmanager
def odd_line(path: Path, device: OddDevice) -> Iterator[str]:
    """Put a device that shares no code with the package on a line; yield the name of ours."""
    line = Pty(path)
    ended, end = os.pipe()

    def live() -> None:
        while ended not in (ready := select.select([line.fileno(), ended], [], [], 0.01)[0]):
            if ready:
                device.receive_data(os.read(line.fileno(), 4096), time.monotonic())
            if device.next_call is not None:
                device.handle_timeout(time.monotonic())
            if data := device.data_to_send():
                line.write(data)

    thread = threading.Thread(target=live)
    thread.start()
    try:
        yield str(path)
    finally:
        os.close(end)
        thread.join()
        os.close(ended)
        line.close()


class LosesPolls(PortAround):
    """A line that loses a poll of each of ``stations``, as often as named; its Timeout is over."""

    def __init__(self, port: Port, stations: list[int], leap: Leap) -> None:
        super().__init__(port)
        self._stations, self._leap = stations, leap

    def read(self, timeout: float | None, wake: int) -> bytes:
        data = super().read(timeout, wake)
        for station in {*self._stations}:
            at = data.find(bytes((0x10, 0x05, station)))  # an ACK may stand before it
            if at >= 0:
                self._stations.remove(station)
                self._leap(LOSSY.timeout / 1000)
                return data[:at] + data[at + 4:]
        return data
