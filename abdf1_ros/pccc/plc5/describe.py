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

"""The typed commands of a PLC-5, in words."""

from __future__ import annotations

from abdf1_ros.pccc import notation, typed_data
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.notation import CommandCode, Effect, KnownCommand
from abdf1_ros.pccc.plc5 import commands as plc5
from abdf1_ros.pccc.plc5 import targets
from abdf1_ros.pccc.plc5.address import ADDRESSING
from abdf1_ros.pccc.typed_data import TypedData
from abdf1_ros.text import counted

_BY_FILE = {
    kind.default_file: kind for kind in FileType
    if kind in ADDRESSING.files and kind.default_file is not None}
# Types that a typed command names, with their size; 4 may be N, B, S, I or O (M 7-29).
_INTEGERS = (FileType.INTEGER, FileType.BINARY, FileType.STATUS, FileType.INPUT, FileType.OUTPUT)
_BY_TYPE = {
    (element.type_id, element.wire_size // element.parts): kind
    for kind in ADDRESSING.files if kind not in _INTEGERS
    for element in (plc5.element_of(Address(ADDRESSING, kind, 0, 0), is_value=False),)}


def system_address(address: plc5.SystemAddress, values: TypedData | None = None) -> str:
    """
    Return a PLC-5 address.

    The address of a file above 8 has no type. If ``values`` have none either, the file is shown by
    its number only.
    """
    kind = _BY_FILE.get(address.file)
    if kind is None and values is not None:
        kind = _BY_TYPE.get((values.type_id, values.element_size))
    if kind is not None:
        return notation.place_text(
            ADDRESSING, kind, address.file, address.element, address.sub_element or 0)
    text = f'file {address.file}:{address.element}'
    return text if address.sub_element is None else f'{text}.{address.sub_element}'


def _values(address: plc5.SystemAddress, values: TypedData) -> str:
    """Return the elements of a PLC-5 typed command or reply as their type says."""
    if values.type_id == typed_data.FLOAT and values.element_size == 4:
        return notation.floats_text(values.data)
    kind = _BY_FILE.get(address.file)
    if values.type_id == typed_data.INTEGER and values.element_size == 2 and (
            kind is None or kind in notation.NUMBERS):
        return notation.integers_text(values.data)
    return notation.words_text(values.data)


def _typed_read(request: plc5.TypedRead) -> str:
    return (f'{system_address(request.address)}, {counted(request.size, "element")}'
            f'{notation.part_of(request.offset, request.size, request.total)}')


def _typed_write(request: plc5.TypedWrite) -> str:
    values = request.values
    return (f'{system_address(request.address, values)} = '
            f'{_values(request.address, values) or "nothing"}'
            f'{notation.part_of(request.offset, values.count, request.total)}')


def _typed_reply(request: plc5.TypedRead, data: bytes) -> str:
    return _values(request.address, TypedData.decode(data))


def _read_modify_write(request: plc5.ReadModifyWrite) -> str:
    return ', '.join(
        f'{system_address(entry.address)} AND {entry.and_mask:04X} '
        f'OR {entry.or_mask:04X}' for entry in request.sets)


DESCRIBED: dict[CommandCode, KnownCommand] = {
    (plc5.CMD, plc5.READ_MODIFY_WRITE): KnownCommand(
        'read-modify-write', Effect.WRITES, plc5.ReadModifyWrite.read, _read_modify_write,
        reach=targets.READ_MODIFY_WRITE),
    (plc5.CMD, plc5.TYPED_WRITE): KnownCommand(
        'typed write', Effect.WRITES, plc5.TypedWrite.read, _typed_write,
        reach=targets.TYPED_WRITE),
    (plc5.CMD, plc5.TYPED_READ): KnownCommand(
        'typed read', Effect.READS, plc5.TypedRead.read, _typed_read, _typed_reply,
        reach=targets.TYPED_READ),
    (plc5.CMD, 0x79): KnownCommand(
        'read-modify-write N', Effect.WRITES, reach=targets.READ_MODIFY_WRITE_N)}
