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

"""Which words of a PLC a foreign command writes."""

from __future__ import annotations

from collections.abc import Sequence

from abdf1_ros.df1.packet import BROADCAST, Packet, PRIORITY_BIT
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.extent import Extent
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.plc2 import commands as plc2
from abdf1_ros.pccc.processor import CIF_FILES
from abdf1_ros.pccc.server import Server
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.rows import Rows

_BASIC = (plc2.READ, plc2.UNPROTECTED_WRITE, plc2.PROTECTED_WRITE, plc2.PROTECTED_BIT_WRITE,
          plc2.UNPROTECTED_BIT_WRITE)


class NotedTable(DataTable):
    """
    The files of some rows, each of unlimited size; writes are noted, and their data dropped.

    ``is_elsewhere`` tells that a command named a file of no row.
    """

    def __init__(self, plc_type: PlcType, rows: Sequence[Mapping]) -> None:
        super().__init__(plc_type)
        self._types = {row.address.file: row.address.file_type for row in rows}
        self.written: list[tuple[Address, int]] = []
        self.is_elsewhere = False

    def file_type(self, file: int) -> FileType:
        """Return the type of a file, or record that no row is in it."""
        self.is_elsewhere = file not in self._types
        return super().file_type(file)

    def find(self, address: Address, words: int) -> tuple[bytearray, int]:
        """Return a place for data, which are dropped."""
        return bytearray(2 * words), 0

    def write(self, address: Address, data: bytes) -> None:
        """Note which words are written."""
        self.written.append((address, len(data) // 2))


def uses_common_file(command: Packet, rows: Sequence[Mapping]) -> bool:
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


def written_extents(command: Packet, station: int,
                    mappings: Rows) -> list[Extent] | None:
    """
    Return the words of the files of ``mappings`` that a command to a station writes.

    The result is None if the command may write any words. A server of the family executes the
    command, because the address of a PLC-5 does not tell the type of its file. A command to all
    stations writes the words of each station.
    """
    rows = [mapping for mapping in mappings.of_plcs
            if station in (mapping.station, BROADCAST)]
    found: list[Extent] = []
    for number, plc_type in {(row.station, row.plc_type): None for row in rows}:
        there = [row for row in rows if row.station == number]
        if uses_common_file(command, there):
            found += [row.extent for row in there if _may_be_common(row)]
            continue
        table = NotedTable(plc_type, there)
        reply = Server(table).serve(command)
        if reply.sts and not table.is_elsewhere:
            return None
        found += [Extent(number, address.area, address.offset, address.offset + words)
                  for address, words in table.written]
    return found
