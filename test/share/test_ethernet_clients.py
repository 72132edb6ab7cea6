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
Clients of others, and bytes of our own, at an eip: place.

The PLC at the end of the line is a device that shares no code with the package.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import random
import select
import struct
import threading

from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.guests import GuestListener
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.share import share_places
from abdf1_ros.share.guest_line import guest_place
import pytest
from share.test_guest_line import free_port, wait_for
from support.device_server import OWN_HOST
from support.driver_bench import Recorder
from support.ethernet_ip import EthernetClient
from support.mappings import make_mapping
from support.odd_device import OddDevice, Wiring
from support.ptys import Pty

STATION, BESIDE, GATEWAY = 1, 2, 8


def _devices(way: str) -> OddDevice:
    if way == 'full duplex':
        return OddDevice(Wiring.FULL, STATION)
    device = OddDevice(Wiring.HALF, GATEWAY if way == 'gateway' else STATION, (STATION, BESIDE))
    if way == 'two stations':
        device.stations = device.nodes
    return device


@contextmanager
def place(folder: Path, way: str) -> Iterator[tuple[int, OddDevice]]:
    """Give the port of a place for station 1, and what is at the end of the line."""
    device, pty, is_over = _devices(way), Pty(folder / 'plc'), threading.Event()

    def serve() -> None:
        poll = select.poll()
        poll.register(pty.fileno(), select.POLLIN)
        while not is_over.is_set():
            if poll.poll(20):
                device.receive_data(pty.read(1), 0.0)
                if data := device.data_to_send():
                    pty.write(data)

    port = free_port()
    text = f'eip:{OWN_HOST}:{port}?station={STATION}'
    network = Network(mode='Peer' if way == 'full duplex' else 'Master', timeout=3000,
                      cmd_timeout=5000, baud=115200, share=text, share_access='Write')
    via = GATEWAY if way == 'gateway' else None
    stations = (STATION,) if way == 'full duplex' else (STATION, BESIDE)
    rows = [make_mapping('N10:0', plc='SLC', station=station, period=200, via=via, item=station)
            for station in stations]
    driver = Driver(network, rows, DriverSettings(), Recorder(line_time))
    near = LinkThread(driver.machine, lambda: open_port(PortSettings(str(pty.name))))
    faults: list[Exception] = []
    guests = guest_place(*share_places(text), stations, network, driver.guests, near.wake,
                         GuestListener(), faults.append)
    thread = threading.Thread(target=serve)
    for started in thread, near, guests:
        started.start()
    try:
        wait_for(lambda: near.state.is_open and guests.state == 'waiting for a client')
        yield port, device
    finally:
        guests.stop()
        near.stop()
        is_over.set()
        thread.join()
        pty.close()
    assert faults == []


def words_of(device: OddDevice, first: int, count: int) -> list[int]:
    return [device.words.get((STATION, 7, first + number), 0) for number in range(count)]


WAYS = pytest.mark.parametrize('way', ['full duplex', 'two stations', 'gateway'])


@WAYS
def test_pycomm3_reads_and_writes(way: str, tmp_path: Path) -> None:
    slc_driver = pytest.importorskip('pycomm3').SLCDriver
    chance = random.Random(way)
    with place(tmp_path, way) as (port, device), slc_driver(f'{OWN_HOST}:{port}') as plc:
        device.words |= {(BESIDE, 7, number): 0x5555 for number in range(40)}
        for first in range(0, 40, 4):
            words = [chance.choice((0x1010, chance.randrange(-32768, 32768))) for _ in range(4)]
            device.words |= {(STATION, 7, first + number): word & 0xFFFF
                             for number, word in enumerate(words)}
            tag = plc.read(f'N7:{first}{{4}}')
            assert (tag.value, tag.error) == (words, None)
        tags = plc.read('N7:0', 'N7:39', 'N7:8{2}')
        assert [tag.value & 0xFFFF for tag in tags[:2]] == [
            *words_of(device, 0, 1), *words_of(device, 39, 1)]
        assert [value & 0xFFFF for value in tags[2].value] == words_of(device, 8, 2)
        # it writes with a mask, which this device does not know, and hears that
        tag = plc.write(('N7:1', 5))
        assert tag.error and 'Illegal Command' in tag.error


@WAYS
def test_bytes_of_our_own_read_and_write(way: str, tmp_path: Path) -> None:
    chance, tns = random.Random(way), 0
    with place(tmp_path, way) as (port, device), EthernetClient(
            OWN_HOST, port) as one, EthernetClient(OWN_HOST, port, is_connected=True) as two:
        device.words |= {(BESIDE, 7, number): 0x5555 for number in range(60)}
        for number in range(20):
            reader, writer = (one, two) if number % 2 else (two, one)
            first, size, tns = 3 * number, chance.randrange(1, 30), tns + 1
            data = chance.randbytes(2 * size).replace(b'\x03', b'\x10')
            head = struct.pack('<BBH', 0x0F, 0, tns)
            address = bytes((2 * size, 7, 0x89, first, 0))
            good = struct.pack('<BBH', 0x4F, 0, tns)
            assert writer.execute(head + b'\xAA' + address + data) == good
            assert struct.pack(f'<{size}H', *words_of(device, first, size)) == data
            assert reader.execute(head + b'\xA2' + address) == good + data
        assert all(device.words.get((BESIDE, 7, number), 0x5555) == 0x5555 for number in range(60))
