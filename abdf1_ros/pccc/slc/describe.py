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

"""The commands of an SLC 500 or MicroLogix, in words."""

from __future__ import annotations

from functools import partial

from abdf1_ros.pccc import notation
from abdf1_ros.pccc.notation import CommandCode, Effect, KnownCommand
from abdf1_ros.pccc.slc import commands as slc
from abdf1_ros.pccc.slc import targets
from abdf1_ros.pccc.slc.address import ADDRESSING, BY_CODE
from abdf1_ros.pccc.slc.commands import LogicalRead, LogicalWrite
from abdf1_ros.text import counted


def logical_address(address: slc.LogicalAddress) -> str:
    """Return an SLC address, by its fields where its type is not known."""
    kind, word = BY_CODE.get(address.type_code), address.sub_element or 0
    if kind is not None:
        return notation.place_text(ADDRESSING, kind, address.file, address.element, word)
    text = f'file {address.file} type {address.type_code:02X} element {address.element}'
    return text + notation.beyond(word)


def _size(address: slc.LogicalAddress, size: int) -> str:
    """Return ``size`` bytes as elements where they are whole ones, as words, or as bytes."""
    kind = BY_CODE.get(address.type_code)
    words = ADDRESSING.files[kind].words if kind else 1
    if words > 1 and size and size % (2 * words) == 0 and not address.sub_element:
        return counted(size // 2 // words, 'element')
    return counted(size, 'byte') if size % 2 else counted(size // 2, 'word')


def _values(address: slc.LogicalAddress, data: bytes) -> str:
    """Return the data of an SLC command or reply as its file type says."""
    kind = BY_CODE.get(address.type_code)
    if kind is None or kind.is_structure and not address.sub_element:
        return notation.words_text(data)  # a structure begins with a word of flags
    return notation.NUMBERS.get(kind, notation.words_text)(data)


def _read(request: LogicalRead) -> str:
    return (f'{logical_address(request.address)}, '
            f'{_size(request.address, request.size)}')


def _write(request: LogicalWrite) -> str:
    values = _values(request.address, request.data) or 'nothing'
    return f'{logical_address(request.address)} = {values}'


def _reply(request: LogicalRead, data: bytes) -> str:
    return _values(request.address, data)


def _masked_write(request: slc.MaskedWrite) -> str:
    return (f'{logical_address(request.address)} mask {request.mask:04X} = '
            f'{notation.words_text(request.data) or "nothing"}')


DESCRIBED: dict[CommandCode, KnownCommand] = {
    (slc.CMD, slc.SHORT_READ): KnownCommand(
        'protected typed logical read', Effect.READS,
        partial(LogicalRead.read, is_short=True), _read, _reply, targets.SHORT_READ),
    (slc.CMD, slc.LOGICAL_READ): KnownCommand(
        'protected typed logical read', Effect.READS, LogicalRead.read, _read, _reply,
        targets.LOGICAL_READ),
    (slc.CMD, slc.SHORT_WRITE): KnownCommand(
        'protected typed logical write', Effect.WRITES,
        partial(LogicalWrite.read, is_short=True), _write, reach=targets.SHORT_WRITE),
    (slc.CMD, slc.LOGICAL_WRITE): KnownCommand(
        'protected typed logical write', Effect.WRITES, LogicalWrite.read, _write,
        reach=targets.LOGICAL_WRITE),
    (slc.CMD, slc.MASKED_WRITE): KnownCommand(
        'masked write', Effect.WRITES, slc.MaskedWrite.read, _masked_write,
        reach=targets.MASKED_WRITE)}
