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

"""The answers of a PLC-5 to commands."""

from __future__ import annotations

from collections.abc import Callable

from abdf1_ros.pccc import status
from abdf1_ros.pccc.address import Address, Addressing
from abdf1_ros.pccc.data_table import DataTable, NoSuchFile, OutOfRange
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.plc2.server import BasicService, Window
from abdf1_ros.pccc.plc5 import commands as plc5
from abdf1_ros.pccc.plc5.address import ADDRESSING
from abdf1_ros.pccc.serving import Codes, Commands, extended, Refusal
from abdf1_ros.pccc.word_range.server import RangeCodes, WordRangeService

_NO_SUCH_FILE: Codes = status.EXTENDED, status.EXT_BAD_ADDRESS
_OUT_OF_RANGE: Codes = status.EXTENDED, status.EXT_WRONG_SIZE
_TOO_LARGE: Codes = status.EXTENDED, status.EXT_TOO_LARGE
_RANGE_CODES = RangeCodes((status.EXTENDED, status.EXT_ILLEGAL_FIELD), _TOO_LARGE, _TOO_LARGE,
                          _TOO_LARGE)


class TypedService:
    """
    Typed read and write of ``table``, whose places follow ``addressing``.

    A PLC-5 has these commands, and so has an SLC 5/03 or later from operating system 303 on. An
    SLC serves only files that a PLC-5 has in the same form.
    """

    def __init__(self, table: DataTable, addressing: Addressing) -> None:
        self._table = table
        self._addressing = addressing

    def commands(self) -> Commands:
        """Return the functions by CMD and FNC."""
        return {(plc5.CMD, plc5.TYPED_READ): self._answering(self._typed_read),
                (plc5.CMD, plc5.TYPED_WRITE): self._answering(self._typed_write)}

    @staticmethod
    def _answering(execute: Callable[[Reader], bytes]) -> Callable[[Reader], bytes]:
        """Return a command that answers with a PLC-5's codes, also in an SLC."""
        def command(reader: Reader) -> bytes:
            try:
                return execute(reader)
            except NoSuchFile:
                raise Refusal(*_NO_SUCH_FILE) from None
            except OutOfRange:
                raise Refusal(*_OUT_OF_RANGE) from None
        return command

    def _typed_read(self, reader: Reader) -> bytes:
        request = plc5.TypedRead.read(reader)
        if request.offset + request.size > request.total or request.size == 0:
            raise extended(status.EXT_ILLEGAL_FIELD)
        address = self.place(request.address, request.offset)
        element = _element(address, request.address)
        size = element.size
        data = self._table.read(address, request.size * size // 2)
        padding = bytes(element.wire_size - size)
        elements = (data[at:at + size] + padding for at in range(0, len(data), size))
        reply = element.typed(b''.join(elements)).encode()
        if len(reply) > plc5.MAX_REPLY:
            raise extended(status.EXT_TOO_LARGE)
        return reply

    def _typed_write(self, reader: Reader) -> bytes:
        request = plc5.TypedWrite.read(reader)
        values = request.values
        if len(request.address.encode()) + len(values.encode()) > plc5.MAX_WRITE:
            raise extended(status.EXT_TOO_LARGE)
        address = self.place(request.address, request.offset)
        element = _element(address, request.address)
        step = element.wire_size
        if values.type_id != element.type_id or values.element_size * element.parts != step:
            raise extended(status.EXT_TYPE_MISMATCH)
        count, left = divmod(len(values.data), step)
        if left or count == 0 or request.offset + count > request.total:
            raise extended(status.EXT_ILLEGAL_FIELD)
        elements = (values.data[at:at + element.size] for at in range(0, len(values.data), step))
        self._table.write(address, b''.join(elements))
        return b''

    def place(self, address: plc5.SystemAddress, offset: int = 0) -> Address:
        """Return the place ``offset`` elements (values, with a sub-element) after ``address``."""
        kind = self._table.file_type(address.file)
        if self._is_other(kind):
            raise extended(status.EXT_BAD_ADDRESS)
        if address.sub_element is None:
            return Address(self._addressing, kind, address.file, address.element + offset)
        start = Address(self._addressing, kind, address.file, address.element, address.sub_element)
        if address.sub_element >= start.layout.words:
            raise extended(status.EXT_TOO_MANY_LEVELS)
        return start.at_offset(start.offset + offset * _element(start, address).size // 2)

    def _is_other(self, kind: FileType) -> bool:
        """Tell whether files of this type differ from files of a PLC-5, or consist of slots."""
        theirs, ours = self._addressing.files[kind], ADDRESSING.files.get(kind)
        has_slots = kind.is_io and self._addressing is not ADDRESSING
        return ours is None or ours.words != theirs.words or has_slots


class Plc5Commands:
    """The commands a PLC-5 serves."""

    no_such_file = _NO_SUCH_FILE
    out_of_range = _OUT_OF_RANGE
    protected: Codes = status.EXTENDED, status.EXT_NO_PRIVILEGE

    def __init__(self, table: DataTable, processor: EmulatedProcessor) -> None:
        self._table = table
        self.basic_commands = BasicService(table, self._compatibility_file).everything()
        typed = TypedService(table, ADDRESSING)
        self._place = typed.place
        self.commands: Commands = typed.commands() | {
            (plc5.CMD, plc5.READ_MODIFY_WRITE): self._read_modify_write,
        } | WordRangeService(
            table, plc5.SystemAddress.read, self._place, _RANGE_CODES).commands()

    def _read_modify_write(self, reader: Reader) -> bytes:
        request = plc5.ReadModifyWrite.read(reader)
        changes = [(self._place(entry.address), entry) for entry in request.sets]
        for address, _ in changes:  # all or nothing
            self._table.read(address, 1)
        for address, entry in changes:
            mask = ~entry.and_mask & 0xFFFF | entry.or_mask
            self._table.write_bits(address, mask, entry.or_mask)
        return b''

    def _compatibility_file(self, source: int) -> Window:
        """Return the file whose number is the station of the sender (M 6-4)."""
        return Window(Address(ADDRESSING, self._table.file_type(source), source, 0))


def _element(address: Address, asked: plc5.SystemAddress) -> plc5.Element:
    """Return the unit that a typed command with this address moves."""
    is_value = asked.sub_element is not None and address.file_type.is_structure
    return plc5.element_of(address, is_value)
