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

"""The words of Serve rows, which the PLC reads and writes with its own commands."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import islice

from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.errors import Place, Problem
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable, NoSuchFile, OutOfRange, Protected
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.extent import Extent
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.link_counters import ServedCounters
from abdf1_ros.pccc.server import Server
from abdf1_ros.plan.forecast import line_model
from abdf1_ros.plan.interlocks import guard_faults
from abdf1_ros.plan.planner import Planner
from abdf1_ros.settings.map_file import broken_links
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network


class _MappedTable(DataTable):
    """
    A data table that has only the mapped words, and remembers what was written.

    ``changed`` has the address and the old data of each write. With ``is_guarded`` the words that
    are ``read_only`` cannot be written.
    """

    def __init__(self, plc_type: PlcType) -> None:
        super().__init__(plc_type)
        self.changed: list[tuple[Address, bytes]] = []
        self.read_only: set[Address] = set()
        self.is_guarded = False
        self._mapped: set[Address] = set()

    def create(self, address: Address, words: int) -> None:
        """Map these words."""
        super().create(address, words)
        self._mapped.update(_words(address, words))

    def protect(self, address: Address, words: int) -> None:
        """Keep these words from being written while the table is guarded."""
        self.read_only.update(_words(address, words))

    def find(self, address: Address, words: int) -> tuple[bytearray, int]:
        """Return where the words are, if all of them are mapped."""
        place = super().find(address, words)
        if not self._has_all(address, words):
            raise OutOfRange(f'not all of {words} words at {address} are mapped')
        return place

    def _has_all(self, address: Address, words: int) -> bool:
        """
        Tell whether these words are mapped.

        A command that moves whole elements of a structure cannot leave out single words. There one
        mapped word of each element is enough; the others hold what the other end wrote, or 0.
        """
        mapped = (place in self._mapped for place in _words(address, words))
        size = address.layout.words
        if not address.file_type.is_structure or address.word or words % size:
            return all(mapped)
        return all(any(list(islice(mapped, size))) for _ in range(words // size))

    def write(self, address: Address, data: bytes) -> None:
        """Store whole words and remember what was there; Protected where that is forbidden."""
        words = len(data) // 2
        if self.is_guarded and not self.read_only.isdisjoint(_words(address, words)):
            raise Protected(f'{words} words at {address} may only be read')
        before = self.read(address, words)
        super().write(address, data)
        self.changed.append((address, before))

    def take_back(self) -> None:
        """Undo what has changed."""
        for address, before in reversed(self.changed):
            super().write(address, before)
        self.changed.clear()


def _words(address: Address, words: int) -> Iterable[Address]:
    return (address.at_offset(address.offset + n) for n in range(words))


class Served:
    """
    The served mappings, and the commands that come for them.

    ``on_write`` is called with a mapping and its words after the other end has written any of
    them; ``counters`` are what it reads as ours. All of it belongs to the link thread.
    """

    def __init__(self, plc_type: PlcType, mappings: Sequence[Mapping],
                 on_write: Callable[[Mapping, bytes], None],
                 counters: ServedCounters | None = None, is_full_duplex: bool = False) -> None:
        self._mappings = [mapping for mapping in mappings if mapping.serves]
        self._on_write = on_write
        self._table = _MappedTable(plc_type)
        for mapping in self._mappings:
            self._table.create(_first_word(mapping), mapping.codec.words)
            if mapping.is_read_only:
                self._table.protect(_first_word(mapping), mapping.codec.words)
        processor = EmulatedProcessor(plc_type, is_full_duplex=is_full_duplex)
        self._server = Server(self._table, processor, counters)

    def serve(self, command: Packet) -> Packet:
        """Execute a command from outside and return its reply."""
        table = self._table
        table.changed.clear()
        table.is_guarded = True
        try:
            reply = self._server.serve(command)
        finally:
            table.is_guarded = False
        if reply.sts:
            table.take_back()  # all or nothing
        for mapping in self._mappings:
            if any(mapping.extent.meets(Extent(
                    mapping.station, address.area, address.offset,
                    address.offset + len(before) // 2)) for address, before in table.changed):
                self._on_write(mapping, self.words_of(mapping))
        return reply

    def words_of(self, mapping: Mapping) -> bytes:
        """Return the words of a mapping as they are now."""
        return self._table.read(_first_word(mapping), mapping.codec.words)

    def store(self, mapping: Mapping, values: Sequence[float] | str) -> None:
        """Store checked raw values where the other end reads them."""
        mapping.codec.store(self._table, _first_word(mapping), values)
        self._table.changed.clear()  # our own writes are not reported


def line_problems(mappings: Sequence[Mapping], network: Network,
                  path: str) -> list[tuple[Mapping, Problem]]:
    """Return the rows that clash with ``network`` or an earlier Serve row, and why."""
    found: list[tuple[Mapping, Problem]] = []
    table = _MappedTable(PlcType(network.plc_type))
    for mapping in mappings:
        text = None
        if mapping.serves:
            text = _fault(mapping, network, table)
        elif mapping.station == BROADCAST and network.mode == 'Peer':
            text = 'Station 255 is for a line with many stations, not for Mode Peer'
        elif mapping.station == network.station and network.mode != 'Peer':
            text = (f'Station {mapping.station} is our own in the net file; here belongs the '
                    'station to read or write')
        elif mapping.via == network.station and network.mode == 'Master':
            text = f'Via {mapping.via} is our own Station in the net file, not a gateway'
        if text is not None:
            where = Place(path, mapping.file_line)
            found.append((mapping, Problem(where, f'Item: {mapping.item}, {text}')))
    return found


def usable_rows(mappings: Sequence[Mapping], network: Network, default_period: float,
                path: str) -> tuple[list[Mapping], list[Problem]]:
    """
    Return the rows that can be used on this line, and the faults of the others.

    ``default_period`` (s) is for rows without Period. A row whose counter is not read often enough
    for its Heartbeat_Timeout cannot be used, nor a row that depends on one that cannot
    (docs/heartbeats.md, rules 14 and 15).
    """
    found = line_problems(mappings, network, path)
    problems = [problem for _, problem in found]
    left = [mapping for mapping in mappings if mapping not in dict(found)]
    planner = Planner(line_model(network), default_period)
    faults = [(mapping, 'Heartbeat_Timeout', text)
              for mapping, text in guard_faults(left, planner)] or _broken(left)
    while faults:
        for mapping, column, text in faults:
            where = Place(path, mapping.file_line, column=column)
            problems.append(Problem(where, f'Item: {mapping.item}, {text}'))
            left = [other for other in left if other is not mapping]
        faults = _broken(left)
    return left, problems


def _broken(mappings: Sequence[Mapping]) -> list[tuple[Mapping, str, str]]:
    return [(mapping, fault.column, fault.text) for mapping, fault in broken_links(mappings)]


def _fault(mapping: Mapping, network: Network, table: DataTable) -> str | None:
    if mapping.plc_type.value != network.plc_type:
        return (f'a Serve row has the PLC_Type we emulate, which is {network.plc_type} '
                'in the net file')
    if mapping.station != network.station:
        return f'a Serve row has our own Station, which is {network.station} in the net file'
    try:
        table.create(_first_word(mapping), mapping.codec.words)
    except NoSuchFile as error:
        return f'{mapping.address} does not fit an earlier Serve row: {error}'
    return None


def _first_word(mapping: Mapping) -> Address:
    return mapping.address.at_offset(mapping.address.offset)
