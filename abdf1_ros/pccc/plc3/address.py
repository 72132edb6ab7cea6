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
Addresses of a PLC-3.

Grammar, letters in any case::

    address  := type [file] ":" number ["." member] ["/" bit]       B10:5/03, T:4.ACC
              | "E3.1." section "." file "." structure "." word ["/" bit]

The second form is the manuals' own (M 13-5). Both name the same places: T:4.ACC is E3.1.3.0.4.2.
Bits are octal in every section, words of the I/O image too. Sections and ranges come from
publication 1775-6.5.5 A-15, and 1779-KFM B-5 confirms them. Floats, high-order integers and
pointers are left out: neither publication describes their words.
"""

from __future__ import annotations

import re

from abdf1_ros.pccc import members
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address, Addressing, AddressRangeError, AddressSyntaxError
from abdf1_ros.pccc.file_types import FileType, Layout, PlcType
from abdf1_ros.pccc.members import Members
from abdf1_ros.pccc.plc3.commands import CONTEXT, DATA_TABLE

# The files of a PLC-3. Only timers and counters are structures.
FILES = {kind: Layout() for kind in (
    FileType.OUTPUT, FileType.INPUT, FileType.INTEGER, FileType.BCD, FileType.BINARY,
    FileType.ASCII, FileType.STATUS)} | {
    FileType.TIMER: Layout(3, members=members.PLC3_TIMER),
    FileType.COUNTER: Layout(3, members=members.PLC3_COUNTER)}

SECTIONS = {
    FileType.OUTPUT: 1, FileType.INPUT: 2, FileType.TIMER: 3, FileType.COUNTER: 4,
    FileType.INTEGER: 5, FileType.BCD: 7, FileType.BINARY: 8, FileType.ASCII: 9,
    FileType.STATUS: 13}
BY_SECTION = {section: kind for kind, section in SECTIONS.items()}

_LAST_FILE = 999
_LAST_NUMBER = 9999
_LAST_IO_WORD = 0o7777
_LAST_BIT = 0o17
_NO_FILE_NEEDED = (
    FileType.OUTPUT, FileType.INPUT, FileType.TIMER, FileType.COUNTER, FileType.STATUS)

_LETTERS = re.compile(
    r'[#$]?(?P<type>[A-Z]{1,2})(?P<file>\d{1,9})?[:;](?P<number>\d{1,9})'
    r'(?:\.(?P<member>[A-Z]{2,3}|\d))?(?:/(?P<bit>[A-Z]{2}|\d{1,3}))?', re.ASCII)
_LEVELS = re.compile(r'[#$]?E(\d{1,5}(?:\.\d{1,5}){5})(?:/(\d{1,3}))?', re.ASCII)


class _Plc3Addressing(Addressing):
    plc_type = PlcType.PLC3
    title = 'PLC-3'
    files = FILES
    has_sections = True

    def parse(self, text: str, access: Access | None = None) -> Address:
        """Read an address; an error says what would be right."""
        text = text.strip().upper()
        if levels := _LEVELS.fullmatch(text):
            return self._at_levels(levels[1].split('.'), levels[2])
        match = _LETTERS.fullmatch(text)
        if match is None:
            raise AddressSyntaxError(
                'write type, file, ":", word, as in N7:0 or B10:5/03, or E3.1.8.10.0.5')
        kind = next((entry for entry in SECTIONS if entry.value == match['type']), None)
        if kind is None:
            known = ', '.join(entry.value for entry in SECTIONS)
            raise AddressSyntaxError(
                f'{match["type"]} is not a file type of a PLC-3; file types: {known}')
        if match['file'] is None and kind not in _NO_FILE_NEEDED:
            raise AddressSyntaxError(f'give the file number, as in {kind.value}7:0')
        return self._place(kind, int(match['file'] or 0), match['number'], match['member'],
                           match['bit'])

    def _at_levels(self, levels: list[str], bit: str | None) -> Address:
        area, context, section, file, structure, word = map(int, levels)
        if (area, context) != (DATA_TABLE, CONTEXT):
            raise AddressRangeError(f'only the data table, E{DATA_TABLE}.{CONTEXT}, can be read')
        kind = BY_SECTION.get(section)
        if kind is None:
            known = ', '.join(f'{number} ({entry.value})' for number, entry in BY_SECTION.items())
            raise AddressRangeError(f'section {section} is not known; sections: {known}')
        if not kind.is_structure:
            if structure:
                raise AddressRangeError(f'section {section} has no structures; write 0 for it')
            return self._place(kind, file, levels[-1], None, bit)
        if word >= FILES[kind].words:
            raise AddressRangeError('words of a timer or counter are 0, 1 and 2')
        return self._place(kind, file, levels[-2], levels[-1], bit)

    def _place(self, kind: FileType, file: int, number: str, member: str | None,
               bit: str | None) -> Address:
        if kind.is_structure and file:
            raise AddressRangeError(f'the {kind.value} file of a PLC-3 is file 0')
        if file > _LAST_FILE:
            raise AddressRangeError(f'files run from 0 to {_LAST_FILE}')
        if kind.is_io and set(number) & set('89'):
            raise AddressSyntaxError('words of the I/O image are octal, as in I:017')
        element, last = int(number, 8 if kind.is_io else 10), self.last_element(kind)
        if element > last:
            shown = f'{last:o} (octal)' if kind.is_io else str(last)
            raise AddressRangeError(f'elements of {kind.value} run from 0 to {shown}')
        if kind.is_structure:
            return Address(self, kind, file, element, *_part(kind, member, bit))
        if member:
            raise AddressSyntaxError(f'words of {kind.value} files have no members')
        return Address(self, kind, file, element, 0, _bit(bit))

    def show(self, address: Address) -> str:
        kind, file = address.file_type, address.file
        number = f'{address.element:04o}' if kind.is_io else str(address.element)
        place = f'{kind.value}{"" if not file and kind in _NO_FILE_NEEDED else file}:{number}'
        if kind.is_structure:
            names = (name for name, member in FILES[kind].members.items()
                     if (member.word, member.bit) == (address.word, None))
            place += f'.{next(names, address.word)}'
        return place if address.bit is None else f'{place}/{address.bit:02o}'

    def last_element(self, kind: FileType, is_flat: bool = False) -> int:
        """Return the last word of a file, or the last timer or counter."""
        return _LAST_IO_WORD if kind.is_io else _LAST_NUMBER


ADDRESSING = _Plc3Addressing()


def _part(kind: FileType, member: str | None, bit: str | None) -> tuple[int, int | None]:
    """Return word and bit of a part of a timer or counter."""
    members = FILES[kind].members
    if member is None and bit is None:
        raise AddressSyntaxError(f'say which word, as in {kind.value}:0.ACC')
    place = next((entry for name, entry in members.items()
                  if (member or 'CTL') in (name, str(entry.word))), None)
    if place is None:
        raise AddressSyntaxError(f'{member} is not a member; members of {kind.value}: '
                                 f'{", ".join(members)}')
    named = members.get(bit or '')
    if named is not None and named.word == place.word and place.bit is None:
        return named.word, named.bit
    if place.bit is not None and bit is not None:
        raise AddressSyntaxError(f'{member} is a bit already')
    if bit is not None and member is None:
        _check_named(kind, members, _bit(bit))
    return place.word, place.bit if bit is None else _bit(bit)


def _check_named(kind: FileType, members: Members, bit: int | None) -> None:
    """Refuse a bit without a name: the text may mean the word of this number."""
    bits = {name: member.bit for name, member in members.items() if member.bit is not None}
    if bit not in bits.values():
        raise AddressSyntaxError(f'bit {bit:02o} of a {kind.value} element has no name; bits: '
                                 f'{", ".join(bits)}; words: {kind.value}:0.ACC')


def _bit(text: str | None) -> int | None:
    if text is None:
        return None
    if not text.isdigit() or set(text) & set('89'):
        raise AddressSyntaxError('PLC-3 bits are octal, 0 to 17')
    bit = int(text, 8)
    if bit > _LAST_BIT:
        raise AddressRangeError('bits run from 0 to 17 (octal)')
    return bit
