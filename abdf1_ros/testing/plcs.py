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

"""Simulated PLCs in the process of a test, and clients on their line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
import threading
import time
from typing import Any, SupportsIndex

from abdf1_ros.client import Client
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.slave import multidrop
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.values import types_of
from abdf1_ros.ports.endpoints import PtyEndpoint
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.simulator.commands import execute
from abdf1_ros.simulator.gateway import stations_of
from abdf1_ros.simulator.ladder import Ladder
from abdf1_ros.simulator.simulated_plc import load_plcs, SimulatedPlc

_BAUD = 115200


class Plcs:
    """
    Simulated PLCs in this process, on a pseudo-terminal; ``data`` is a simulator CSV.

    The name ``port`` disappears with the line. The number of the terminal may soon belong to
    another test.
    """

    def __init__(self, data: Path | str, ladders: Sequence[int] = ()) -> None:
        self._plcs = load_plcs(str(data), Checksum.CRC, time.monotonic, threading.RLock)
        for station in ladders:
            self[station].run_ladder(Ladder(self[station].table))
        self._folder = Path(data).absolute().parent
        self._line = PtyEndpoint(str(self._folder / 'plcs'))
        self.port = self._line.name
        self.faults: list[Exception] = []
        machine = Machine(
            multidrop(stations_of(self._plcs, Checksum.CRC)), checksum=Checksum.CRC)
        self.link = LinkThread(machine, self._line.open, on_fault=self.faults.append)

    def __enter__(self) -> Plcs:
        self.link.start()
        return self

    def __exit__(self, *exception: object) -> None:
        if self.link.is_alive():
            self.lose()
        assert not self.faults

    def __getitem__(self, station: int) -> SimulatedPlc:
        if not isinstance(station, int):
            raise TypeError(f'station {station!r} should be a whole number')
        for plc in self._plcs:
            if plc.station == station:
                return plc
        raise LookupError(f'there is no station {station}; the data has '
                          f'{", ".join(str(plc.station) for plc in self._plcs)}')

    def client(self, **arguments: Any) -> Client:
        """Return a client on the line, with further ``arguments``; ``with`` closes it."""
        if not self.link.is_alive():
            raise RuntimeError('the simulated line has not begun, or has ended: use '
                               '"with Plcs(...) as plcs:"')
        if given := {'port', 'duplex', 'baud'}.intersection(arguments):
            raise TypeError(f'{", ".join(sorted(given))}: the simulated line decides that')
        return Client(self.port, duplex='half', baud=_BAUD, **arguments)

    def files(self, rows: str) -> tuple[Path, Path]:
        """Return a net CSV for the line, and a map CSV with the text ``rows``."""
        net, mappings = (self._folder / name for name in ('net.csv', 'map.csv'))
        net.write_text(f'Com_Port,Baud,Timeout\n{self.port},{_BAUD},200\n', encoding='utf-8')
        mappings.write_text(rows, encoding='utf-8')
        return net, mappings

    def lose(self) -> None:
        """Take the line away, as when an adapter is unplugged."""
        self.link.stop()
        self._line.close()

    def say(self, command: str) -> None:
        """Carry out a command of the simulator, such as ``delay 1 300`` or ``silent 1``."""
        execute(command, self._plcs)

    def word(self, address: str, station: int = 1) -> int:
        """Return a word of a PLC, from 0 to 65535; raises ValueError for a bit, or more words."""
        place = self._word_place(address, station)
        self[station].advance()
        return int.from_bytes(self[station].table.read(place, 1), 'little')

    def set(self, address: str, *words: SupportsIndex, station: int = 1) -> None:  # noqa: A003
        """Set words of a PLC, as its program does; each from -32768 to 65535."""
        place = self._word_place(address, station)
        for word in words or [None]:
            if not isinstance(word, SupportsIndex) or not -0x8000 <= word.__index__() <= 0xFFFF:
                raise ValueError(f'{word!r} is not a word, from -32768 to 65535')
        self[station].advance()
        with self[station].lock:
            self[station].table.write(place, b''.join(
                (word.__index__() & 0xFFFF).to_bytes(2, 'little') for word in words))

    def _word_place(self, address: str, station: int) -> Address:
        found = parse_address(address, self[station].table.plc_type)
        if found.bit is not None:
            raise ValueError(f'{address} is a bit of the word {replace(found, bit=None)}; a '
                             'client() reads and writes single bits')
        if (kind := types_of(found)[0]).words != 1:
            raise ValueError(f'{address} is a {kind.value} of {kind.words} words; a client() '
                             'reads and writes it')
        return found
