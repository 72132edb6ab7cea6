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

from collections import defaultdict
from collections.abc import Callable, Sequence

from abdf1_ros.df1.packet import Packet
from abdf1_ros.pccc.address import Address, Area
from abdf1_ros.pccc.data_table import DataTable, OutOfRange, Protected
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.extent import Extent, OUR_TABLE
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.link_counters import ServedCounters
from abdf1_ros.pccc.server import Server
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.rows import Rows


class MappedTable(DataTable):
    """
    A data table that has only the mapped words, and remembers writes.

    ``changed`` has the address and the old data of each write. With ``is_guarded`` no protected
    word can be written.
    """

    def __init__(self, plc_type: PlcType) -> None:
        super().__init__(plc_type)
        self.changed: list[tuple[Address, bytes]] = []
        self.is_guarded = False
        self._mapped: defaultdict[Area, set[int]] = defaultdict(set)  # offsets of words
        self._read_only: defaultdict[Area, set[int]] = defaultdict(set)

    def create(self, address: Address, words: int) -> None:
        """Map these words."""
        super().create(address, words)
        self._mapped[address.area].update(_offsets(address, words))

    def protect(self, address: Address, words: int) -> None:
        """Keep these words from being written while the table is guarded."""
        self._read_only[address.area].update(_offsets(address, words))

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
        mapped word of each element is enough. All other words hold what the PLC wrote, or 0.
        """
        known = self._mapped[address.area]
        mapped = [offset in known for offset in _offsets(address, words)]
        size = address.layout.words
        if not address.file_type.is_structure or address.word or words % size:
            return all(mapped)
        return all(any(mapped[at:at + size]) for at in range(0, words, size))

    def write(self, address: Address, data: bytes) -> None:
        """Store whole words and remember the old ones; raise Protected where that is forbidden."""
        words = len(data) // 2
        if self.is_guarded and not self._read_only[address.area].isdisjoint(
                _offsets(address, words)):
            raise Protected(f'{words} words at {address} may only be read')
        before = self.read(address, words)
        super().write(address, data)
        self.changed.append((address, before))

    def take_back(self) -> None:
        """Undo all changes."""
        for address, before in reversed(self.changed):
            super().write(address, before)
        self.changed.clear()


def _offsets(address: Address, words: int) -> range:
    first = address.offset
    return range(first, first + words)


class Served:
    """
    The served mappings, and the commands that come for them.

    ``on_write`` is called with a mapping and its words after a PLC has written any of them.
    ``counters`` are the link counters that a PLC reads. Only the link thread may use this object.
    """

    def __init__(self, plc_type: PlcType, mappings: Rows,
                 on_write: Callable[[Mapping, bytes], None],
                 counters: ServedCounters | None = None, is_full_duplex: bool = False) -> None:
        self._mappings = mappings.served
        self._on_write = on_write
        self.table = MappedTable(plc_type)
        for mapping in self._mappings:
            self.table.create(_first_word(mapping), mapping.codec.words)
            if mapping.is_read_only:
                self.table.protect(_first_word(mapping), mapping.codec.words)
        self._server = Server(
            self.table, EmulatedProcessor(is_full_duplex=is_full_duplex), counters)

    def serve(self, command: Packet) -> Packet:
        """Execute a command from outside and return its reply."""
        table = self.table
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
                    OUR_TABLE, address.area, address.offset,
                    address.offset + len(before) // 2)) for address, before in table.changed):
                self._on_write(mapping, self.words_of(mapping))
        return reply

    def words_of(self, mapping: Mapping) -> bytes:
        """Return the words of a mapping as they are now."""
        return self.table.read(_first_word(mapping), mapping.codec.words)

    def store(self, mapping: Mapping, values: Sequence[float] | str) -> None:
        """Store checked raw values where a PLC reads them."""
        mapping.codec.store(self.table, _first_word(mapping), values)
        self.table.changed.clear()  # our own writes are not reported

    def clear(self) -> None:
        """Set all words to 0."""
        for words in self.table.words.values():
            words[:] = bytes(len(words))

    def take_over(self, before: Served) -> None:
        """Store what was served before, of the bits that both have a row for."""
        theirs = before._bits()
        for (area, offset), bits in self._bits().items():
            if bits := bits & theirs[area, offset]:
                place = slice(2 * offset, 2 * offset + 2)
                word = int.from_bytes(before.table.words[area][place], 'little')
                self.table.words[area][place] = (word & bits).to_bytes(2, 'little')

    def _bits(self) -> defaultdict[tuple[Area, int], int]:
        """Return the bits that rows have, by area and offset of their word."""
        found: defaultdict[tuple[Area, int], int] = defaultdict(int)
        for mapping in self._mappings:
            for offset, mask in enumerate(mapping.codec.masks(), mapping.extent.first):
                found[mapping.extent.area, offset] |= mask
        return found


def _first_word(mapping: Mapping) -> Address:
    return mapping.address.at_offset(mapping.address.offset)
