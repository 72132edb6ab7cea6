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

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass
from typing import TypeVar

from abdf1_ros.df1.packet import Packet, PRIORITY_BIT, REPLY_BIT
from abdf1_ros.errors import FormatError, RemoteError
from abdf1_ros.pccc import diagnostics, notation, range_targets
from abdf1_ros.pccc.address import Address, AddressRefusal
from abdf1_ros.pccc.families import decode_identity, FAMILIES
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.notation import CommandCode, Effect, KnownCommand
from abdf1_ros.pccc.plc3 import commands as plc3
from abdf1_ros.pccc.plc3.address import ADDRESSING as PLC3
from abdf1_ros.pccc.plc3.address import BY_SECTION
from abdf1_ros.pccc.plc3.commands import ExtendedAddress
from abdf1_ros.pccc.plc5.commands import SystemAddress
from abdf1_ros.pccc.plc5.describe import system_address
from abdf1_ros.pccc.status import check_status, EXT_BAD_ADDRESS, EXT_BAD_SYMBOL, EXT_NO_SUCH_SYMBOL
from abdf1_ros.pccc.targets import Partner, Reach, Target
from abdf1_ros.pccc.word_range import commands as word_range
from abdf1_ros.text import counted, printable

# Commands that have a function code (M 7-2, 7-3).
_WITH_FUNCTION = (0x06, 0x07, 0x0F)


def describe(packet: Packet, command: Packet | None = None) -> str:
    """
    Return the contents of a command or reply in words.

    ``command`` is the command that a reply answers; without it the data of a reply are shown as
    bytes. Bytes, and unknown or malformed parts, are in hexadecimal.
    """
    if not packet.is_reply:
        return _describe_command(packet)
    try:
        data = check_status(packet)
    except RemoteError as error:
        return str(error)
    if not data:
        return 'done'
    if command is not None:
        entry = _entry(command)
        try:
            return entry.values(entry.read(Reader(_parameters(command))), data)
        except FormatError:
            pass
    return notation.hexadecimal(data)


def known_commands() -> dict[CommandCode, KnownCommand]:
    """Return every command that we know, by CMD and FNC (None: it has none), in their order."""
    return dict(sorted(_known().items(), key=lambda item: (item[0][0], item[0][1] or 0)))


def command_codes() -> dict[CommandCode, str]:
    """Return the name of every command that we know, by CMD and FNC."""
    return {code: entry.name for code, entry in known_commands().items()}


def effect_of(packet: Packet) -> Effect:
    """Return what a command does, as far as we know."""
    return _entry(packet).effect


def targets_of(packet: Packet, partner: Partner) -> frozenset[Target]:
    """Return what a command addresses, in each form that its address may have there."""
    try:
        found = frozenset(_entry(packet).reach.find(Reader(_parameters(packet)), partner))
    except FormatError:  # also an AddressRefusal
        found = frozenset()
    return found if found and packet.is_sound else frozenset((Target.OTHER,))


def command_name(packet: Packet) -> str:
    """Return CMD and, where there is one, FNC, e.g. "0F/68"."""
    cmd, function = _code(packet)
    if function is None or packet.is_reply:
        return f'{cmd:02X}'
    return f'{cmd:02X}/{function:02X}'


def _known() -> dict[CommandCode, KnownCommand]:
    own = {code: command for family in FAMILIES.values()
           for code, command in family.described.items()}
    return _NAMED | own | _SHARED


def _entry(packet: Packet) -> KnownCommand:
    return _known().get(_code(packet)) or KnownCommand(f'command {command_name(packet)}')


def _describe_command(packet: Packet) -> str:
    entry = _entry(packet)
    try:
        return f'{entry.name} {entry.words(entry.read(Reader(_parameters(packet))))}'.rstrip()
    except FormatError as error:
        # An address of program files or the like is well formed, though our servers lack such
        # files.
        is_elsewhere = isinstance(error, AddressRefusal) and error.ext_sts == EXT_BAD_ADDRESS
        fault = error if is_elsewhere else f'malformed ({error})'
        return f'{entry.name}, {fault}: {notation.hexadecimal(packet.data)}'


def _code(packet: Packet) -> CommandCode:
    cmd = packet.cmd & ~REPLY_BIT & ~PRIORITY_BIT
    return cmd, packet.data[0] if cmd in _WITH_FUNCTION and packet.data else None


def _parameters(packet: Packet) -> bytes:
    return packet.data[_code(packet)[1] is not None:]


@dataclass(frozen=True, slots=True)
class _SymbolicName:
    """A symbol of a PLC-3 for an address (M 13-8), which only that PLC knows."""

    name: str

    def encode(self) -> bytes:
        """Return the symbol in the form that a command contains."""
        return b'\0' + self.name.encode('latin-1', 'replace') + b'\0'


_Request = TypeVar('_Request')
_Range = SystemAddress | ExtendedAddress | _SymbolicName


def _range_address(reader: Reader) -> _Range:
    """Read an address of a PLC-5, whose flag has bit 1 (file) and none above 3, or of a PLC-3."""
    flag = copy(reader).byte()
    if flag == 0:
        return _named(reader)
    if flag & 0xF2 == 0x02:
        return SystemAddress.read(reader)
    return ExtendedAddress.read(reader)


def _named(reader: Reader) -> SystemAddress | _SymbolicName:
    """Read ASCII: a PLC-5 address, which begins with "$", or a symbol with or without "$"."""
    ahead = copy(reader)
    ahead.byte()
    try:
        return SystemAddress.read(reader)
    except AddressRefusal as error:
        name = printable(ahead.text().decode('latin-1')).removeprefix('$')
        if error.ext_sts not in (EXT_NO_SUCH_SYMBOL, EXT_BAD_SYMBOL) or not name:
            raise
        return _SymbolicName(name)


def _range_text(address: _Range) -> str:
    if isinstance(address, _SymbolicName):
        return f'symbol {address.name}'
    if isinstance(address, SystemAddress):
        return system_address(address)
    return extended_address(address)


def extended_address(address: ExtendedAddress) -> str:
    """Return a PLC-3 address, by its levels where its section has no letter (M 13-5)."""
    kind = BY_SECTION.get(address.section)
    if kind is not None and not kind.is_structure and not address.structure:
        return str(Address(PLC3, kind, address.file, address.word))
    if kind is not None and kind.is_structure and address.word < 3:
        return str(Address(PLC3, kind, address.file, address.structure, address.word))
    return (f'E{plc3.DATA_TABLE}.{plc3.CONTEXT}.{address.section}.{address.file}.'
            f'{address.structure}.{address.word}')


def _range_read(request: word_range.WordRangeRead[_Range]) -> str:
    words = request.size // 2
    return (f'{_range_text(request.address)}, {counted(words, "word")}'
            f'{notation.part_of(request.offset, words, request.total)}')


def _range_write(request: word_range.WordRangeWrite[_Range]) -> str:
    return (f'{_range_text(request.address)} = {notation.words_text(request.data) or "nothing"}'
            f'{notation.part_of(request.offset, len(request.data) // 2, request.total)}')


def _bit_write(request: word_range.WordBitWrite[_Range]) -> str:
    return f'{_range_text(request.address)} set {request.set:04X} reset {request.reset:04X}'


def _identity_reply(request: object, data: bytes) -> str:
    identity = decode_identity(data)
    if identity.interface is None and identity.plc_type is None:
        raise FormatError('nothing is known of this processor')
    text = str(identity)
    notes = [] if identity.name in text else [f'name {identity.name}']
    return '; '.join([text, *notes, *identity.faults, *identity.remarks])


def _words_reply(request: object, data: bytes) -> str:
    return notation.words_text(data)


def _ranged(read: Callable[[Reader, Callable[[Reader], _Range]], _Request],
            ) -> Callable[[Reader], _Request]:
    return lambda reader: read(reader, _range_address)


def _port(take: Callable[[Reader], object]) -> Reach:
    """Return the reach of a command to the port, whose parameters ``take`` reads."""
    def find(reader: Reader, partner: Partner) -> Iterator[Target]:
        take(reader)
        yield Target.PORT

    return Reach('', (Target.PORT,), find)


# Commands of all families, or of several.
_SHARED: dict[CommandCode, KnownCommand] = {
    (diagnostics.CMD, diagnostics.STATUS): KnownCommand(
        'diagnostic status', Effect.READS, Reader.end, lambda request: '', _identity_reply,
        _port(Reader.end)),
    (diagnostics.CMD, diagnostics.READ_COUNTERS): KnownCommand(
        'read diagnostic counters', Effect.READS, diagnostics.ReadCounters.read,
        lambda request: f'at {request.address}, {counted(request.size, "byte")}',
        _words_reply, _port(diagnostics.ReadCounters.read)),
    (word_range.CMD, word_range.WRITE): KnownCommand(
        'word range write', Effect.WRITES, _ranged(word_range.WordRangeWrite.read), _range_write,
        reach=range_targets.WRITE),
    (word_range.CMD, word_range.READ): KnownCommand(
        'word range read', Effect.READS,
        _ranged(word_range.WordRangeRead.read), _range_read, _words_reply, range_targets.READ),
    (word_range.CMD, word_range.BIT_WRITE): KnownCommand(
        'bit write', Effect.WRITES, _ranged(word_range.WordBitWrite.read), _bit_write,
        reach=range_targets.BIT_WRITE),
    (word_range.CMD, word_range.FILE_READ): KnownCommand(
        'file read', Effect.READS,
        _ranged(word_range.WordRangeRead.read), _range_read, _words_reply, range_targets.READ),
}

# All other commands (M 7-2, 7-3; 0F/94 is from practice); their parameters are given as bytes.
_NAMED: dict[CommandCode, KnownCommand] = {
    (0x06, 0x00): KnownCommand('echo', Effect.READS, reach=_port(Reader.rest)),
    (0x06, 0x09): KnownCommand(
        'read link parameters', Effect.READS, reach=_port(diagnostics.ReadCounters.read)),
    (0x0F, 0x03): KnownCommand('file write', Effect.WRITES, reach=range_targets.WRITE),
    (0x0F, 0x29): KnownCommand('read section size', Effect.READS, reach=range_targets.SIZE),
    (0x0F, 0x94): KnownCommand('read file information', Effect.READS),
    # In no manual, but in a recording of a MicroLogix 1400. Each item is FF and an address.
    (0x0F, 0xA3): KnownCommand('read of words by physical address', Effect.READS),
} | {code: KnownCommand(name, Effect.READS) for code, name in {
    (0x04, None): 'physical read',
    (0x0F, 0x09): 'physical read', (0x0F, 0x17): 'read bytes physical',
    (0x0F, 0xA7): 'protected typed file read',
}.items()} | {code: KnownCommand(name, Effect.KEEPS) for code, name in {
    (0x06, 0x02): 'set variables', (0x06, 0x04): 'set timeout', (0x06, 0x05): 'set NAKs',
    (0x06, 0x06): 'set ENQs', (0x06, 0x07): 'reset diagnostic counters',
    (0x0F, 0x06): 'upload request', (0x0F, 0x11): 'get edit resource',
    (0x0F, 0x12): 'return edit resource', (0x0F, 0x53): 'upload all',
    (0x0F, 0x55): 'upload completed', (0x0F, 0x81): 'open file', (0x0F, 0x82): 'close file',
}.items()} | {code: KnownCommand(name) for code, name in {
    (0x03, None): 'physical write',
    # CIP of a Logix controller on its serial port (1756-PM020F p. 75).
    (0x0A, None): 'connected CIP message', (0x0B, None): 'unconnected CIP message',
    (0x06, 0x08): 'set data table size', (0x06, 0x0A): 'set link parameters',
    (0x07, 0x00): 'disable outputs', (0x07, 0x01): 'enable outputs',
    (0x07, 0x03): 'enable scan', (0x07, 0x04): 'enter download mode',
    (0x07, 0x05): 'exit download or upload mode', (0x07, 0x06): 'enter upload mode',
    (0x0F, 0x05): 'download request', (0x0F, 0x07): 'shut down',
    (0x0F, 0x08): 'physical write', (0x0F, 0x0A): 'restart',
    (0x0F, 0x18): 'write bytes physical', (0x0F, 0x3A): 'set CPU mode',
    (0x0F, 0x41): 'disable forces', (0x0F, 0x50): 'download all',
    (0x0F, 0x52): 'download completed', (0x0F, 0x57): 'initialize memory',
    (0x0F, 0x5E): 'modify compatibility file', (0x0F, 0x80): 'change mode',
    (0x0F, 0x88): 'execute command list', (0x0F, 0x8F): 'apply port configuration',
    (0x0F, 0xAF): 'protected typed file write',
}.items()}
