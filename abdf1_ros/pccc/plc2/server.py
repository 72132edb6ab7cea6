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
The answers of a PLC-2, and of other PLCs to the commands of a PLC-2.

If a word does not exist or is protected, the reply has STS 50, also if the compatibility file is
missing (M 8-5). For an odd byte address of a word the reply has STS 10.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from abdf1_ros.pccc import status
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable, NoSuchFile, OutOfRange, Protected
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.plc2 import commands as plc2
from abdf1_ros.pccc.plc2.address import ADDRESSING
from abdf1_ros.pccc.plc2.commands import BasicBitWrite, BasicRead, BasicWrite
from abdf1_ros.pccc.serving import BasicCommand, BasicCommands, Codes, Commands, Refusal


@dataclass(frozen=True, slots=True)
class Window:
    """The words that commands reach, from ``start`` on; addresses count ``unit`` bytes each."""

    start: Address
    unit: int = 1


class BasicService:
    """
    Execute commands without FNC; ``window`` gives the words for the SRC of a command.

    With ``takes_odd`` a read may have an odd number of bytes; only an SLC allows this (M
    7-31..7-40).
    """

    def __init__(self, table: DataTable, window: Callable[[int], Window],
                 max_read: int = plc2.MAX_READ, max_write: int = plc2.MAX_SERVED_WRITE,
                 takes_odd: bool = False) -> None:
        self._table = table
        self._window = window
        self._max_read = max_read
        self._max_write = max_write
        self._takes_odd = takes_odd

    def reads_and_writes(self) -> BasicCommands:
        """Return the commands that every PLC has."""
        return {plc2.READ: self._in_window(self._read),
                plc2.UNPROTECTED_WRITE: self._in_window(self._write)}

    def everything(self) -> BasicCommands:
        """Return all commands: also the protected write and the bit writes."""
        return self.reads_and_writes() | {
            plc2.PROTECTED_WRITE: self._in_window(self._write),
            plc2.PROTECTED_BIT_WRITE: self._in_window(self._write_bits),
            plc2.UNPROTECTED_BIT_WRITE: self._in_window(self._write_bits),
        }

    def _in_window(self, function: Callable[[Reader, Window], bytes]) -> BasicCommand:
        def execute(reader: Reader, source: int) -> bytes:
            try:
                return function(reader, self._window(source))
            except (NoSuchFile, OutOfRange, Protected):
                raise Refusal(status.STS_ADDRESS) from None
        return execute

    def _read(self, reader: Reader, window: Window) -> bytes:
        request = BasicRead.read(reader)
        is_odd = request.size % 2 and not self._takes_odd
        if not 0 < request.size <= self._max_read or is_odd:
            raise Refusal(status.STS_ILLEGAL_COMMAND)
        words = self._table.read(_word(window, request.address), (request.size + 1) // 2)
        return words[:request.size]

    def _write(self, reader: Reader, window: Window) -> bytes:
        request = BasicWrite.read(reader)
        if len(request.data) % 2 or not 0 < len(request.data) <= self._max_write:
            raise Refusal(status.STS_ILLEGAL_COMMAND)
        self._table.write(_word(window, request.address), request.data)
        return b''

    def _write_bits(self, reader: Reader, window: Window) -> bytes:
        changes = [(_word(window, change.address & ~1), 8 * (change.address & 1), change)
                   for change in BasicBitWrite.read(reader).changes]
        for place, _, _ in changes:  # all or nothing
            self._table.find(place, 1)
        for place, at, change in changes:
            self._table.write_bits(place, (change.set | change.reset) << at, change.set << at)
        return b''


def _word(window: Window, address: int) -> Address:
    """Return the word at an address of a command; refuse an odd byte address."""
    number, odd = divmod(address * window.unit, 2)
    if odd:
        raise Refusal(status.STS_ILLEGAL_COMMAND)
    return window.start.at_offset(number)


class Plc2Commands:
    """The commands that a PLC-2 serves; it does not know the FNCs of other families."""

    no_such_file: Codes = status.STS_ADDRESS, None
    out_of_range: Codes = status.STS_ADDRESS, None
    protected: Codes = status.STS_ADDRESS, None

    def __init__(self, table: DataTable, processor: EmulatedProcessor) -> None:
        everything = Window(Address(ADDRESSING, FileType.BINARY, 0, 0))
        self.commands: Commands = {}
        self.basic_commands = BasicService(table, lambda source: everything).everything()
