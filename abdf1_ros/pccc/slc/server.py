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

"""The answers of an SLC 500 or MicroLogix to commands."""

from __future__ import annotations

from functools import partial

from abdf1_ros.pccc import status
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable, NoSuchFile, OutOfRange
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.plc2.server import BasicService, Window
from abdf1_ros.pccc.plc5.server import TypedService
from abdf1_ros.pccc.processor import USUAL
from abdf1_ros.pccc.serving import Codes, Commands, Refusal
from abdf1_ros.pccc.slc import commands as slc
from abdf1_ros.pccc.slc.address import ADDRESSING, BY_CODE
from abdf1_ros.pccc.slc.file_search import directory_of, SLC_DIRECTORY

_ADDRESSING_MODE = Address(ADDRESSING, FileType.STATUS, 2, 2)
_BYTE_ADDRESSES = 8


class SlcCommands:
    """The commands an SLC 5/03 serves, from operating system 303 on (M 7-2, 7-3)."""

    no_such_file: Codes = status.STS_ILLEGAL_COMMAND, None
    out_of_range: Codes = status.STS_ADDRESS, None
    protected: Codes = status.STS_ADDRESS, None

    def __init__(self, table: DataTable, processor: EmulatedProcessor) -> None:
        self._table = table
        self._processor = processor
        self.basic_commands = BasicService(
            table, self._common_interface_file, slc.MAX_READ, slc.MAX_WRITE,
            takes_odd=True).reads_and_writes()
        own: Commands = {
            (slc.CMD, slc.LOGICAL_READ): self._read,
            (slc.CMD, slc.SHORT_READ): partial(self._read, is_short=True),
            (slc.CMD, slc.LOGICAL_WRITE): self._write,
            (slc.CMD, slc.SHORT_WRITE): partial(self._write, is_short=True),
            (slc.CMD, slc.MASKED_WRITE): self._masked_write,
        }
        self.commands = own | TypedService(table, ADDRESSING).commands()

    def _read(self, reader: Reader, is_short: bool = False) -> bytes:
        request = slc.LogicalRead.read(reader, is_short)
        self._check_size(request.size, slc.MAX_READ)
        if (request.address.file, request.address.type_code) == (0, SLC_DIRECTORY.type_code):
            return self._directory(request)
        return b''.join(self._table.read(*place)
                        for place in self._places(request.address, request.size))

    def _directory(self, request: slc.LogicalRead) -> bytes:
        at = 2 * (request.address.element + (request.address.sub_element or 0))
        data = directory_of(self._table)[at:at + request.size]
        if len(data) < request.size:
            raise OutOfRange('the file directory is shorter')
        return data

    def _write(self, reader: Reader, is_short: bool = False) -> bytes:
        request = slc.LogicalWrite.read(reader, is_short)
        self._check_size(len(request.data), slc.MAX_WRITE)
        data = Reader(request.data)
        for address, words in self._places(request.address, len(request.data)):
            self._table.write(address, data.take(2 * words))
        return b''

    def _masked_write(self, reader: Reader) -> bytes:
        request = slc.MaskedWrite.read(reader)
        self._check_size(len(request.data), slc.MAX_WRITE)
        data = Reader(request.data)
        for address, words in self._places(request.address, len(request.data)):
            for n in range(words):
                place = address.at_offset(address.offset + n)
                self._table.write_bits(place, request.mask, data.word())
        return b''

    def _common_interface_file(self, source: int) -> Window:
        """Return the file, addressed by words unless S:2/8 is set (M 7-31..7-40)."""
        file = (self._processor.processor or USUAL).common_interface_file
        start = Address(ADDRESSING, self._table.file_type(file), file, 0)
        try:
            flags = int.from_bytes(self._table.read(_ADDRESSING_MODE, 1), 'little')
        except (NoSuchFile, OutOfRange):
            flags = 0
        return Window(start, 1 if flags >> _BYTE_ADDRESSES & 1 else 2)

    @staticmethod
    def _check_size(size: int, largest: int) -> None:
        if size == 0 or size % 2 or size > largest:
            raise Refusal(status.STS_ILLEGAL_COMMAND)

    def _places(self, address: slc.LogicalAddress, size: int) -> list[tuple[Address, int]]:
        """Return the stretches of words of a command, after a check that all words exist."""
        words = size // 2
        kind = slc.BY_FLAT_CODE.get(address.type_code)
        if kind is not None and kind.default_file == address.file:
            places = self._in_slots(kind, address.element + (address.sub_element or 0), words)
        else:
            places = [(self._address(address), words)]
        for place in places:
            self._table.find(*place)
        return places

    def _in_slots(self, kind: FileType, first: int, words: int) -> list[tuple[Address, int]]:
        """Return words of the flat image, in which slot follows slot."""
        image = [Address(ADDRESSING, kind, area.file, area.slot or 0, word)
                 for area in sorted(self._table, key=lambda area: area.slot or 0)
                 if area.file_type is kind for word in range(self._table.length(area))]
        found = image[first:first + words]
        if len(found) < words:
            raise OutOfRange(f'the {kind.value} image has {len(image)} words')
        return [(address, 1) for address in found]

    def _address(self, address: slc.LogicalAddress) -> Address:
        kind = BY_CODE.get(address.type_code)
        if kind is None:
            raise Refusal(*self.no_such_file)
        place = Address(ADDRESSING, kind, address.file, address.element, address.sub_element or 0)
        if not place.is_by_type and self._table.file_type(address.file) is not kind:
            raise Refusal(*self.no_such_file)
        return place
