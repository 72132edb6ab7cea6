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

"""The tables of the Wireshark dissector, made from tables of the package."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
import re

from abdf1_ros.df1.frames import Code
from abdf1_ros.pccc.describe import command_codes, extended_address
from abdf1_ros.pccc.plc3.commands import ExtendedAddress
from abdf1_ros.pccc.plc5.commands import SystemAddress
from abdf1_ros.pccc.plc5.describe import system_address
from abdf1_ros.pccc.slc.commands import LogicalAddress
from abdf1_ros.pccc.slc.describe import logical_address
from abdf1_ros.pccc.status import status_text
from abdf1_ros.pccc.typed_data import TypedData

# Words of the longest structure (PD of a PLC-5), and bytes of the longest element.
_MOST_WORDS = 82
_MOST_BYTES = 164
_FILE, _ELEMENT = 77, 9  # file and element of sample addresses, to find their spelling


def lua() -> str:
    """Return the tables as Lua."""
    return '\n\n'.join((
        _table('SYMBOLS', {code.value: code.name for code in Code}),
        _commands(),
        _table('STS', {sts: text for sts in (*range(16), *range(16, 256, 16))
                       if (text := _meaning(status_text(sts)))}),
        _table('EXT_STS', {ext: text for ext in range(256)
                           if (text := _meaning(status_text(0xF0, ext)))}),
        _nested('PLC5_FILES', {file: _plc5(file) for file in range(9)}),
        _table('PLC5_TYPES', dict(_plc5_types()), '0x{:04X}'),
        _nested('SLC_FILES', dict(_slc())),
        _nested('PLC3_SECTIONS', dict(_plc3()))))


def _meaning(text: str) -> str:
    meaning = text.partition(': ')[2]
    return '' if meaning == 'unknown code' else meaning


def _string(text: str) -> str:
    escaped = text.replace('\\', '\\\\').replace("'", "\\'")
    return f"'{escaped}'"


def _table(name: str, entries: Mapping[int, str], key: str = '0x{:02X}') -> str:
    rows = (f'  [{key.format(number)}] = {_string(text)},' for number, text in entries.items())
    return '\n'.join((f'local {name} = {{', *rows, '}'))


def _nested(name: str, entries: Mapping[int, str]) -> str:
    rows = (f'  [0x{number:02X}] = {{{text}}},' for number, text in entries.items())
    return '\n'.join((f'local {name} = {{', *rows, '}'))


def _commands() -> str:
    """Return the names by CMD, and by CMD x 256 + FNC."""
    names = {cmd if function is None else cmd << 8 | function: name
             for (cmd, function), name in command_codes().items()}
    with_function = sorted({cmd for cmd, function in command_codes() if function is not None})
    return '\n'.join((
        f'local WITH_FNC = {{{", ".join(f"[0x{cmd:02X}] = true" for cmd in with_function)}}}', '',
        _table('COMMANDS', names, '0x{:04X}')))


def _members(shown: Iterator[str], start: str) -> str:
    """Return the names of the words of an element after its first."""
    names = (f'[{number}] = {_string(text[len(start):])}' for number, text in enumerate(shown, 1)
             if text.startswith(f'{start}.'))
    return ', '.join(names)


def _plc5(file: int) -> str:
    first, ninth = (system_address(SystemAddress(file, element)) for element in (0, _ELEMENT))
    letter = first.partition(':')[0]
    octal = ', octal = true' if ninth.endswith('011') else ''
    members = _members((system_address(SystemAddress(file, 0, word))
                        for word in range(1, _MOST_WORDS)), first)
    return f'name = {_string(letter)}{octal}, members = {{{members}}}'


def _plc5_types() -> Iterator[tuple[int, str]]:
    """Yield the file letter for a typed write to a file above 8, by type and size."""
    for kind in range(32):
        for size in range(1, _MOST_BYTES + 1):
            shown = system_address(SystemAddress(_FILE, 0), TypedData(kind, size, b''))
            if match := re.match(rf'([A-Z]+){_FILE}:', shown):
                yield kind << 8 | size, match[1]


def _slc() -> Iterator[tuple[int, str]]:
    for code in range(0x80, 0xA0):
        shown = [logical_address(LogicalAddress(_FILE, code, _ELEMENT, word))
                 for word in range(_MOST_WORDS)]
        if match := re.fullmatch(rf'([A-Z]+)({_FILE})?:{_ELEMENT}(\.0)?', shown[0]):
            slots = ', slots = true' if match[3] else ''
            members = '' if slots else _members(iter(shown[1:]), shown[0])
            yield code, f'name = {_string(match[1])}{slots}, members = {{{members}}}'


def _plc3() -> Iterator[tuple[int, str]]:
    for section in range(1, 16):
        first = extended_address(ExtendedAddress(section, _FILE))
        match = re.fullmatch(rf'([A-Z]+){_FILE}:(0+)(\.\w+)?', first)
        if match is None:
            continue
        if extended_address(ExtendedAddress(section, 0)).startswith(f'{match[1]}:'):
            bare = ', bare = true'  # file 0 is not written
        else:
            bare = ''
        if match[3]:
            words = (extended_address(ExtendedAddress(section, _FILE, 0, word))
                     for word in range(3))
            names = ', '.join(_string(text.partition('.')[2]) for text in words)
            yield section, f'name = {_string(match[1])}, words = {{{names}}}{bare}'
        else:
            octal = ', octal = true' if len(match[2]) > 1 else ''
            yield section, f'name = {_string(match[1])}{octal}{bare}'
