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

"""Commands and replies in words, with addresses as a controls engineer writes them."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from functools import partial
from typing import Any

from abdf1_ros.df1.packet import Packet, PRIORITY_BIT, REPLY_BIT
from abdf1_ros.errors import FormatError, RemoteError
from abdf1_ros.pccc import diagnostics, notation
from abdf1_ros.pccc.address_errors import AddressRefusal
from abdf1_ros.pccc.diagnostic_status import decode_identity
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.notation import count_of, hexadecimal, part_of, words_text
from abdf1_ros.pccc.plc2 import commands as plc2
from abdf1_ros.pccc.plc3.commands import ExtendedAddress
from abdf1_ros.pccc.plc5 import commands as plc5
from abdf1_ros.pccc.plc5.commands import SystemAddress
from abdf1_ros.pccc.slc import commands as slc
from abdf1_ros.pccc.slc.commands import LogicalRead, LogicalWrite
from abdf1_ros.pccc.status import check_status, EXT_BAD_SYMBOL, EXT_NO_SUCH_SYMBOL
from abdf1_ros.pccc.typed_data import TypedData
from abdf1_ros.pccc.word_range import commands as word_range
from abdf1_ros.text import printable

# Commands that carry a function code (M 7-2, 7-3).
_WITH_FUNCTION = (0x06, 0x07, 0x0F)


def describe(packet: Packet, command: Packet | None = None) -> str:
    """
    Return what a command asks, or what a reply says.

    ``command`` is the one that a reply answers; without it the data of a reply are bytes. Unknown
    or malformed parts are given in hexadecimal.
    """
    if not packet.is_reply:
        return _describe_command(packet)
    try:
        data = check_status(packet)
    except RemoteError as error:
        return str(error)
    if not data:
        return 'done'
    entry = _COMMANDS.get(_code(command)) if command else None
    if command is not None and entry is not None:
        try:
            return entry.values(entry.read(_parameters(command)), data)
        except FormatError:
            pass
    return hexadecimal(data)


def command_codes() -> dict[tuple[int, int | None], str]:
    """Return the name of every command that we know, by CMD and FNC (None: it has none)."""
    named = {code: entry.name for code, entry in _COMMANDS.items()}
    return dict(sorted((named | _NAMES).items(), key=lambda item: (item[0][0], item[0][1] or 0)))


def command_name(packet: Packet) -> str:
    """Return CMD and, where there is one, FNC, e.g. "0F/68"."""
    cmd, function = _code(packet)
    if function is None or packet.is_reply:
        return f'{cmd:02X}'
    return f'{cmd:02X}/{function:02X}'


_CommandCode = tuple[int, int | None]  # CMD and FNC


@dataclass(frozen=True, slots=True)
class _KnownCommand:
    """A command: how it is read, what it says, and what its reply's data are."""

    name: str
    read: Callable[[Reader], Any]
    words: Callable[[Any], str]
    values: Callable[[Any, bytes], str] = lambda request, data: hexadecimal(data)


def _describe_command(packet: Packet) -> str:
    code = _code(packet)
    parameters = packet.data[code[1] is not None:]
    entry = _COMMANDS.get(code)
    if entry is None:
        name = _NAMES.get(code) or f'command {command_name(packet)}'
        return f'{name} {hexadecimal(parameters)}'.rstrip()
    try:
        return f'{entry.name} {entry.words(entry.read(Reader(parameters)))}'.rstrip()
    except FormatError as error:
        return f'{entry.name}, malformed ({error}): {hexadecimal(packet.data)}'


def _code(packet: Packet) -> _CommandCode:
    cmd = packet.cmd & ~REPLY_BIT & ~PRIORITY_BIT
    return cmd, packet.data[0] if cmd in _WITH_FUNCTION and packet.data else None


def _parameters(packet: Packet) -> Reader:
    return Reader(packet.data[_code(packet)[1] is not None:])


def _typed_read(request: plc5.TypedRead) -> str:
    return (f'{notation.system_address(request.address)}, {count_of(request.size, "element")}'
            f'{part_of(request.offset, request.size, request.total)}')


def _typed_write(request: plc5.TypedWrite) -> str:
    values = request.values
    return (f'{notation.system_address(request.address, values)} = '
            f'{notation.typed_values(request.address, values) or "nothing"}'
            f'{part_of(request.offset, values.count, request.total)}')


def _typed_reply(request: plc5.TypedRead, data: bytes) -> str:
    return notation.typed_values(request.address, TypedData.decode(data))


def _read_modify_write(request: plc5.ReadModifyWrite) -> str:
    return ', '.join(
        f'{notation.system_address(entry.address)} AND {entry.and_mask:04X} '
        f'OR {entry.or_mask:04X}' for entry in request.sets)


def _logical_read(request: LogicalRead) -> str:
    return (f'{notation.logical_address(request.address)}, '
            f'{notation.logical_size(request.address, request.size)}')


def _logical_write(request: LogicalWrite) -> str:
    values = notation.logical_values(request.address, request.data) or 'nothing'
    return f'{notation.logical_address(request.address)} = {values}'


def _logical_reply(request: LogicalRead, data: bytes) -> str:
    return notation.logical_values(request.address, data)


def _masked_write(request: slc.MaskedWrite) -> str:
    return (f'{notation.logical_address(request.address)} mask {request.mask:04X} = '
            f'{words_text(request.data) or "nothing"}')


@dataclass(frozen=True, slots=True)
class _SymbolicName:
    """A symbol of a PLC-3 for an address (M 13-8), which only that PLC knows."""

    name: str

    def encode(self) -> bytes:
        """Return it as it stands in a command."""
        return b'\0' + self.name.encode('latin-1', 'replace') + b'\0'


_Range = SystemAddress | ExtendedAddress | _SymbolicName


def _range_address(reader: Reader) -> _Range:
    """Take an address of a PLC-5 or a PLC-3; only the former has bit 1 (file) and none above 3."""
    flag = copy(reader).byte()
    if flag == 0:
        return _named(reader)
    if flag & 0xF2 == 0x02:
        return SystemAddress.read(reader)
    return ExtendedAddress.read(reader)


def _named(reader: Reader) -> SystemAddress | _SymbolicName:
    """Take what is written in ASCII: an address of a PLC-5 after "$", or a symbol, "$" or not."""
    ahead = copy(reader)
    try:
        return SystemAddress.read(reader)
    except AddressRefusal as error:
        name = _text(ahead).removeprefix('$')
        if error.ext_sts not in (EXT_NO_SUCH_SYMBOL, EXT_BAD_SYMBOL) or not name:
            raise
        return _SymbolicName(name)


def _text(reader: Reader) -> str:
    """Take 00, characters, and 00."""
    reader.byte()
    text = bytearray()
    while byte := reader.byte():
        text.append(byte)
    return printable(text.decode('latin-1'))


def _range_text(address: _Range) -> str:
    if isinstance(address, _SymbolicName):
        return f'symbol {address.name}'
    if isinstance(address, SystemAddress):
        return notation.system_address(address)
    return notation.extended_address(address)


def _range_read(request: word_range.WordRangeRead[_Range]) -> str:
    words = request.size // 2
    return (f'{_range_text(request.address)}, {count_of(words, "word")}'
            f'{part_of(request.offset, words, request.total)}')


def _range_write(request: word_range.WordRangeWrite[_Range]) -> str:
    return (f'{_range_text(request.address)} = {words_text(request.data) or "nothing"}'
            f'{part_of(request.offset, len(request.data) // 2, request.total)}')


def _bit_write(request: word_range.WordBitWrite[_Range]) -> str:
    return f'{_range_text(request.address)} set {request.set:04X} reset {request.reset:04X}'


def _basic_read(request: plc2.BasicRead) -> str:
    return f'{notation.byte_address(request.address)}, {count_of(request.size, "byte")}'


def _basic_write(request: plc2.BasicWrite) -> str:
    return f'{notation.byte_address(request.address)} = {words_text(request.data) or "nothing"}'


def _basic_bit_write(request: plc2.BasicBitWrite) -> str:
    return ', '.join(
        f'{notation.byte_address(change.address)} {"high" if change.address % 2 else "low"} byte '
        f'set {change.set:02X} reset {change.reset:02X}' for change in request.changes)


def _identity_reply(request: object, data: bytes) -> str:
    identity = decode_identity(data)
    if identity.interface is None and not identity.family:
        raise FormatError('nothing is known of this processor')
    text = str(identity)
    notes = [] if identity.name in text else [f'name {identity.name}']
    return '; '.join([text, *notes, *identity.faults, *identity.remarks])


def _no_parameters(reader: Reader) -> None:
    reader.end()


def _words_reply(request: object, data: bytes) -> str:
    return words_text(data)


def _ranged(read: Callable[[Reader, Callable[[Reader], _Range]], Any]) -> Callable[[Reader], Any]:
    return lambda reader: read(reader, _range_address)


_COMMANDS: dict[_CommandCode, _KnownCommand] = {
    (plc2.READ, None): _KnownCommand(
        'unprotected read', plc2.BasicRead.read, _basic_read, _words_reply),
    (plc2.UNPROTECTED_WRITE, None): _KnownCommand(
        'unprotected write', plc2.BasicWrite.read, _basic_write),
    (plc2.PROTECTED_WRITE, None): _KnownCommand(
        'protected write', plc2.BasicWrite.read, _basic_write),
    (plc2.UNPROTECTED_BIT_WRITE, None): _KnownCommand(
        'unprotected bit write', plc2.BasicBitWrite.read, _basic_bit_write),
    (plc2.PROTECTED_BIT_WRITE, None): _KnownCommand(
        'protected bit write', plc2.BasicBitWrite.read, _basic_bit_write),
    (diagnostics.CMD, diagnostics.STATUS): _KnownCommand(
        'diagnostic status', _no_parameters, lambda request: '', _identity_reply),
    (diagnostics.CMD, diagnostics.READ_COUNTERS): _KnownCommand(
        'read diagnostic counters', diagnostics.ReadCounters.read,
        lambda request: f'at {request.address}, {count_of(request.size, "byte")}', _words_reply),
    (word_range.CMD, word_range.WRITE): _KnownCommand(
        'word range write', _ranged(word_range.WordRangeWrite.read), _range_write),
    (word_range.CMD, word_range.READ): _KnownCommand(
        'word range read', _ranged(word_range.WordRangeRead.read), _range_read, _words_reply),
    (word_range.CMD, word_range.BIT_WRITE): _KnownCommand(
        'bit write', _ranged(word_range.WordBitWrite.read), _bit_write),
    (word_range.CMD, word_range.FILE_READ): _KnownCommand(
        'file read', _ranged(word_range.WordRangeRead.read), _range_read, _words_reply),
    (plc5.CMD, plc5.READ_MODIFY_WRITE): _KnownCommand(
        'read-modify-write', plc5.ReadModifyWrite.read, _read_modify_write),
    (plc5.CMD, plc5.TYPED_WRITE): _KnownCommand('typed write', plc5.TypedWrite.read, _typed_write),
    (plc5.CMD, plc5.TYPED_READ): _KnownCommand(
        'typed read', plc5.TypedRead.read, _typed_read, _typed_reply),
    (slc.CMD, slc.SHORT_READ): _KnownCommand(
        'protected typed logical read', partial(LogicalRead.read, is_short=True), _logical_read,
        _logical_reply),
    (slc.CMD, slc.LOGICAL_READ): _KnownCommand(
        'protected typed logical read', LogicalRead.read, _logical_read, _logical_reply),
    (slc.CMD, slc.SHORT_WRITE): _KnownCommand(
        'protected typed logical write', partial(LogicalWrite.read, is_short=True),
        _logical_write),
    (slc.CMD, slc.LOGICAL_WRITE): _KnownCommand(
        'protected typed logical write', LogicalWrite.read, _logical_write),
    (slc.CMD, slc.MASKED_WRITE): _KnownCommand(
        'masked write', slc.MaskedWrite.read, _masked_write),
}

# All other commands (M 7-2, 7-3; 0F/94 is from practice); their parameters are given as bytes.
_NAMES: dict[_CommandCode, str] = {
    (0x03, None): 'physical write', (0x04, None): 'physical read',
    (0x06, 0x00): 'echo', (0x06, 0x02): 'set variables',
    (0x06, 0x04): 'set timeout', (0x06, 0x05): 'set NAKs', (0x06, 0x06): 'set ENQs',
    (0x06, 0x07): 'reset diagnostic counters', (0x06, 0x08): 'set data table size',
    (0x06, 0x09): 'read link parameters', (0x06, 0x0A): 'set link parameters',
    (0x07, 0x00): 'disable outputs', (0x07, 0x01): 'enable outputs',
    (0x07, 0x03): 'enable scan', (0x07, 0x04): 'enter download mode',
    (0x07, 0x05): 'exit download or upload mode', (0x07, 0x06): 'enter upload mode',
    (0x0F, 0x03): 'file write', (0x0F, 0x05): 'download request', (0x0F, 0x06): 'upload request',
    (0x0F, 0x07): 'shut down', (0x0F, 0x08): 'physical write', (0x0F, 0x09): 'physical read',
    (0x0F, 0x0A): 'restart', (0x0F, 0x11): 'get edit resource',
    (0x0F, 0x12): 'return edit resource', (0x0F, 0x17): 'read bytes physical',
    (0x0F, 0x18): 'write bytes physical', (0x0F, 0x29): 'read section size',
    (0x0F, 0x3A): 'set CPU mode', (0x0F, 0x41): 'disable forces', (0x0F, 0x50): 'download all',
    (0x0F, 0x52): 'download completed', (0x0F, 0x53): 'upload all',
    (0x0F, 0x55): 'upload completed', (0x0F, 0x57): 'initialize memory',
    (0x0F, 0x5E): 'modify compatibility file', (0x0F, 0x80): 'change mode',
    (0x0F, 0x81): 'open file', (0x0F, 0x82): 'close file',
    (0x0F, 0x88): 'execute command list', (0x0F, 0x8F): 'apply port configuration',
    (0x0F, 0x94): 'read file information', (0x0F, 0xA7): 'protected typed file read',
    (0x0F, 0xAF): 'protected typed file write',
}
