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

"""Which words of a PLC a foreign command writes, and which words its reply has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from abdf1_ros.df1.packet import BROADCAST, Packet, PRIORITY_BIT
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address, Area
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.extent import Extent
from abdf1_ros.pccc.fields import word
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.plc2 import commands as plc2
from abdf1_ros.pccc.plc5 import commands as plc5
from abdf1_ros.pccc.processor import CIF_FILES
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.typed_data import TypedData
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.rows import Rows

ReplyWords = dict[tuple[Area, int], bytes]
"""Words by area and offset."""

# A word of the coded table has its number in both bytes: the low byte from 80 to BF, the high byte
# from C0 to FF. So no code can be found across two words, nor in a descriptor.
_DIGIT = 64

_ALL_BITS = 0xFFFF

_BASIC = (plc2.READ, plc2.UNPROTECTED_WRITE, plc2.PROTECTED_WRITE, plc2.PROTECTED_BIT_WRITE,
          plc2.UNPROTECTED_BIT_WRITE)


@dataclass(frozen=True, slots=True)
class WrittenWords:
    """
    Words that a command writes, and their new bytes; None if some of their bits stay.

    ``is_certain`` is False for words that it only may write.
    """

    extent: Extent
    data: bytes | None
    is_certain: bool = True


class _NotedTable(DataTable):
    """
    The files of some rows, each of unlimited size; writes are noted, and their data dropped.

    ``is_elsewhere`` tells that a command named a file of no row. Such a file has the type
    ``others``; with None there is no such file. ``files`` are all files that were written.
    """

    def __init__(self, plc_type: PlcType, rows: Sequence[Mapping],
                 others: FileType | None = None) -> None:
        super().__init__(plc_type)
        self._others = others
        self._types = {row.address.file: row.address.file_type for row in rows
                       if not row.address.is_by_type}
        self.written: list[tuple[Address, int, bytes | None]] = []
        self.files: set[int] = set()
        self.is_elsewhere = False

    def file_type(self, file: int) -> FileType:
        """Return the type of a file, or record that no row is in it."""
        self.is_elsewhere = file not in self._types
        if self.is_elsewhere and self._others is not None:
            return self._others
        return super().file_type(file)

    def find(self, address: Address, words: int) -> tuple[bytearray, int]:
        """Return a place for data, which are dropped."""
        return bytearray(2 * words), 0

    def write(self, address: Address, data: bytes) -> None:
        """Note which words of files of rows are written."""
        self._note(address, len(data) // 2, data)

    def write_bits(self, address: Address, mask: int, bits: int) -> None:
        """Note which word of a file of rows is written; its new bytes if no bit stays."""
        self._note(address, 1, word(bits) if mask == _ALL_BITS else None)

    def _note(self, address: Address, words: int, data: bytes | None) -> None:
        self.files.add(address.file)
        if address.is_by_type or address.file in self._types:
            self.written.append((address, words, data))


def _uses_common_file(command: Packet, rows: Sequence[Mapping]) -> bool:
    """
    Tell whether a command uses the common interface file of an SLC.

    Bit S:2/8 of the SLC decides whether such a command counts words or bytes, and so which words
    it means. The rows have one PLC type of the station.
    """
    return command.cmd & ~PRIORITY_BIT in _BASIC and any(map(_is_slc, rows))


def _is_slc(row: Mapping) -> bool:
    return row.plc_type == PlcType.SLC or row.access is Access.CIF


def _may_be_common(row: Mapping) -> bool:
    return row.access is Access.CIF or row.address.file in CIF_FILES


def written_extents(command: Packet, station: int, mappings: Rows) -> list[Extent] | None:
    """Return the places of the words that ``written_words`` returns, None if they are unknown."""
    words = written_words(command, station, mappings)
    return None if words is None else [written.extent for written in words]


def written_words(command: Packet, station: int, mappings: Rows) -> list[WrittenWords] | None:
    """
    Return the words of the files of ``mappings`` that a command to a station writes.

    The result is None if no family of the rows knows the command: it may write any words. A server
    of each family executes the command, because the address of a PLC-5 does not tell the type of
    its file. A command to all stations writes the words of each station.
    """
    rows = [mapping for mapping in mappings.of_plcs
            if station in (mapping.station, BROADCAST)]
    found: list[WrittenWords] = []
    is_known = not rows
    for number, plc_type in {(row.station, row.plc_type): None for row in rows}:
        there = [row for row in rows if row.station == number]
        if _uses_common_file(command, there):
            found += [WrittenWords(row.extent, None, is_certain=False)
                      for row in there if _may_be_common(row)]
            is_known = True
            continue
        # A command may name files with and without rows.
        table = _NotedTable(plc_type, there, FileType.INTEGER)
        reply = Server(table).serve(command)
        if not reply.sts or table.is_elsewhere:
            found += [WrittenWords(
                Extent(number, address.area, address.offset, address.offset + words), data)
                for address, words, data in table.written]
            if table.files & CIF_FILES:
                found += [WrittenWords(row.extent, None, is_certain=False)
                          for row in there if row.access is Access.CIF]
            is_known = True
    return found if is_known else None


class _CodedTable(_NotedTable):
    """A table that returns a different code for each word."""

    def __init__(self, plc_type: PlcType, rows: Sequence[Mapping]) -> None:
        super().__init__(plc_type, rows)
        self.places: list[Address] = []

    def read(self, address: Address, words: int) -> bytes:
        """Return codes for words, and note their places."""
        first = len(self.places)
        if first + words > _DIGIT**2:
            raise FormatError('more words than there are codes')
        self.places += (address.at_offset(address.offset + n) for n in range(words))
        return b''.join(map(_code, range(first, first + words)))


def _code(number: int) -> bytes:
    high, low = divmod(number, _DIGIT)
    return bytes((0x80 + low, 0xC0 + high))


def words_in_reply(command: Packet, reply: Packet, rows: Sequence[Mapping]) -> ReplyWords:
    """
    Return the words of files of ``rows`` that a good reply has; none if unknown.

    The rows have one PLC type of the station. A server of the family executes the command. Where
    its reply has the code of a word, the heard reply has the value of this word.
    """
    if _uses_common_file(command, rows):
        return {}
    table = _CodedTable(rows[0].plc_type, rows)
    expected = Server(table).serve(command)
    if expected.sts or expected.cmd != reply.cmd or not table.places:
        return {}
    try:
        data = _same_form(command, reply.data)
    except FormatError:
        return {}
    places = {at: place for number, place in enumerate(table.places)
              if (at := expected.data.find(_code(number))) >= 0}
    begin = min(places, default=0)
    if len(data) != len(expected.data) or data[:begin] != expected.data[:begin]:
        return {}
    return {(place.area, place.offset): data[at:at + 2] for at, place in places.items()}


def _same_form(command: Packet, data: bytes) -> bytes:
    """Return the data of a reply; a typed read gets the descriptors of our server."""
    code = command.cmd & ~PRIORITY_BIT, *command.data[:1]
    return TypedData.decode(data).encode() if code == (plc5.CMD, plc5.TYPED_READ) else data
