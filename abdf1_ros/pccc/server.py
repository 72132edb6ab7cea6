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
Answer commands from a data table, as a PLC of the table's family does.

What a real one answers to a bad request is in M 8-2..8-4 only in part; the choices here are
those that drivers in the field report.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc import diagnostics, plc5, slc, status, typed_data
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable, NoSuchFile, OutOfRange
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import BY_SLC_CODE, PlcType
from abdf1_ros.pccc.typed_data import TypedData


class Refusal(Exception):
    """A command is answered with this STS (and EXT STS) instead of data."""

    def __init__(self, sts: int, ext_sts: int | None = None) -> None:
        super().__init__(status.status_text(sts, ext_sts))
        self.sts = sts
        self.ext_sts = ext_sts


_Commands = dict[tuple[int, int], Callable[[Reader], bytes]]
_Codes = tuple[int, int | None]  # STS and EXT STS


class _Family(Protocol):
    """The commands of a family by CMD and FNC, and how it refuses bad addresses."""

    commands: _Commands
    no_such_file: _Codes
    out_of_range: _Codes


class Server:
    """Execute commands on ``table``; ``serve`` is what a link hands its commands to."""

    def __init__(self, table: DataTable) -> None:
        self._family = _FAMILIES[table.plc_type](table)
        identity = diagnostics.identity(table.plc_type)
        self._commands: _Commands = self._family.commands | {
            (diagnostics.CMD, diagnostics.ECHO): Reader.rest,
            (diagnostics.CMD, diagnostics.STATUS): lambda reader: identity,
        }

    def serve(self, command: Packet) -> Packet:
        """Return the reply to ``command``; every command has one."""
        try:
            return command.reply(self._execute(command))
        except Refusal as refusal:
            data = b'' if refusal.ext_sts is None else bytes((refusal.ext_sts,))
            return command.reply(data, refusal.sts)

    def _execute(self, command: Packet) -> bytes:
        reader = Reader(command.data)
        try:
            function = self._commands.get((command.cmd, reader.byte()))
            if function is None:
                raise Refusal(status.STS_ILLEGAL_COMMAND)
            return function(reader)
        except NoSuchFile:
            raise Refusal(*self._family.no_such_file) from None
        except OutOfRange:
            raise Refusal(*self._family.out_of_range) from None
        except FormatError:
            raise Refusal(status.STS_ILLEGAL_COMMAND) from None


def _extended(ext_sts: int) -> Refusal:
    return Refusal(status.EXTENDED, ext_sts)


class _Plc5:
    """The commands a PLC-5 serves."""

    no_such_file: _Codes = status.EXTENDED, status.EXT_BAD_ADDRESS
    out_of_range: _Codes = status.EXTENDED, status.EXT_WRONG_SIZE

    def __init__(self, table: DataTable) -> None:
        self._table = table
        self.commands: _Commands = {
            (plc5.CMD, plc5.TYPED_READ): self._typed_read,
            (plc5.CMD, plc5.TYPED_WRITE): self._typed_write,
            (plc5.CMD, plc5.READ_MODIFY_WRITE): self._read_modify_write,
        }

    def _typed_read(self, reader: Reader) -> bytes:
        request = plc5.TypedRead.read(reader)
        if request.offset + request.size > request.total or request.size == 0:
            raise _extended(status.EXT_ILLEGAL_FIELD)
        address = self._address(request.address, request.offset)
        type_id, size, stored = _element(address, request.address)
        data = self._table.read(address, request.size * stored // 2)
        padding = bytes(size - stored)
        elements = (data[at:at + stored] + padding for at in range(0, len(data), stored))
        reply = TypedData(type_id, size, b''.join(elements)).encode()
        if len(reply) > plc5.MAX_REPLY:
            raise _extended(status.EXT_TOO_LARGE)
        return reply

    def _typed_write(self, reader: Reader) -> bytes:
        request = plc5.TypedWrite.read(reader)
        values = request.values
        if request.offset + values.count > request.total or values.count == 0:
            raise _extended(status.EXT_ILLEGAL_FIELD)
        address = self._address(request.address, request.offset)
        type_id, size, stored = _element(address, request.address)
        if (values.type_id, values.element_size) != (type_id, size):
            raise _extended(status.EXT_TYPE_MISMATCH)
        elements = (values.data[at:at + stored] for at in range(0, len(values.data), size))
        self._table.write(address, b''.join(elements))
        return b''

    def _read_modify_write(self, reader: Reader) -> bytes:
        request = plc5.ReadModifyWrite.read(reader)
        changes = [(self._address(entry.address), entry) for entry in request.sets]
        for address, _ in changes:  # all or nothing
            self._table.read(address, 1)
        for address, entry in changes:
            mask = ~entry.and_mask & 0xFFFF | entry.or_mask
            self._table.write_bits(address, mask, entry.or_mask)
        return b''

    def _address(self, address: plc5.SystemAddress, offset: int = 0) -> Address:
        """Return the place ``offset`` elements (words, with a sub-element) behind ``address``."""
        kind = self._table.file_type(address.file)
        if address.sub_element is None:
            return Address(PlcType.PLC5, kind, address.file, address.element + offset)
        if address.sub_element >= kind.layout.words:
            raise _extended(status.EXT_TOO_MANY_LEVELS)
        start = Address(PlcType.PLC5, kind, address.file, address.element, address.sub_element)
        return start.at_offset(start.offset + offset)


def _element(address: Address, asked: plc5.SystemAddress) -> tuple[int, int, int]:
    """Return type ID, bytes on the line and bytes in the table of one element."""
    layout = address.file_type.layout
    if asked.sub_element is not None and address.file_type.is_structure:
        return typed_data.INTEGER, 2, 2
    assert layout.plc5_id is not None  # a PLC-5 table has no other files
    return layout.plc5_id, 2 * (layout.plc5_words or layout.words), 2 * layout.words


class _Slc:
    """The commands an SLC 5/03 serves."""

    no_such_file: _Codes = status.STS_ILLEGAL_COMMAND, None
    out_of_range: _Codes = status.STS_ADDRESS, None

    def __init__(self, table: DataTable) -> None:
        self._table = table
        self.commands: _Commands = {
            (slc.CMD, slc.LOGICAL_READ): self._read,
            (slc.CMD, slc.LOGICAL_WRITE): self._write,
            (slc.CMD, slc.MASKED_WRITE): self._masked_write,
        }

    def _read(self, reader: Reader) -> bytes:
        request = slc.LogicalRead.read(reader)
        self._check_size(request.size, slc.MAX_READ)
        return self._table.read(self._address(request.address), request.size // 2)

    def _write(self, reader: Reader) -> bytes:
        request = slc.LogicalWrite.read(reader)
        self._check_size(len(request.data), slc.MAX_WRITE)
        self._table.write(self._address(request.address), request.data)
        return b''

    def _masked_write(self, reader: Reader) -> bytes:
        request = slc.MaskedWrite.read(reader)
        self._check_size(len(request.data), slc.MAX_WRITE)
        address = self._address(request.address)
        self._table.read(address, len(request.data) // 2)  # all or nothing
        for at in range(0, len(request.data), 2):
            bits = int.from_bytes(request.data[at:at + 2], 'little')
            place = address.at_offset(address.offset + at // 2)
            self._table.write_bits(place, request.mask, bits)
        return b''

    @staticmethod
    def _check_size(size: int, largest: int) -> None:
        if size == 0 or size % 2 or size > largest:
            raise Refusal(status.STS_ILLEGAL_COMMAND)

    def _address(self, address: slc.LogicalAddress) -> Address:
        kind = BY_SLC_CODE.get(address.type_code)
        if kind is None or self._table.file_type(address.file) is not kind:
            raise Refusal(*self.no_such_file)
        return Address(
            PlcType.SLC, kind, address.file, address.element, address.sub_element)


_FAMILIES: dict[PlcType, Callable[[DataTable], _Family]] = {
    PlcType.PLC5: _Plc5, PlcType.SLC: _Slc}

SERVED_FAMILIES = tuple(_FAMILIES)
