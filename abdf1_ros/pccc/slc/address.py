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
Addresses of an SLC 500 or MicroLogix, as in ``file_address``; its I/O is by slot and word.

::

    I:1.0/3       slot, word, bit; ".0" may be left out
    I:5/3         with access Flat the word of the whole image
"""

from __future__ import annotations

from dataclasses import replace
import re

from abdf1_ros.pccc import members
from abdf1_ros.pccc.address import Address, AddressRangeError, AddressSyntaxError
from abdf1_ros.pccc.file_address import FileAddressing
from abdf1_ros.pccc.file_types import FileType, Layout, PlcType

# The files of an SLC 500 or MicroLogix, and their codes (M 7-17; 8D and above from practice).
FILES = {
    FileType.OUTPUT: Layout(code=0x8B),
    FileType.INPUT: Layout(code=0x8C),
    FileType.STATUS: Layout(code=0x84),
    FileType.BINARY: Layout(code=0x85),
    FileType.TIMER: Layout(3, 0x86, members.TIMER),
    FileType.COUNTER: Layout(3, 0x87, members.COUNTER),
    FileType.CONTROL: Layout(3, 0x88, members.CONTROL),
    FileType.INTEGER: Layout(code=0x89),
    FileType.FLOAT: Layout(2, 0x8A),
    FileType.STRING: Layout(42, 0x8D),
    FileType.ASCII: Layout(code=0x8E),
    FileType.BCD: Layout(code=0x8F),
    FileType.LONG: Layout(2, 0x91),
    FileType.MESSAGE: Layout(25, 0x92, members.SLC_MESSAGE),
    FileType.PID: Layout(23, 0x93, members.SLC_PID),
    FileType.HSC: Layout(18, 0xE0, members.HSC),
    FileType.STI: Layout(4, 0xE2, members.STI),
    FileType.EII: Layout(4, 0xE3, members.EII),
    FileType.PTO: Layout(15, 0xED, members.PULSES),
    FileType.PWM: Layout(10, 0xEE, members.PULSES)}

BY_CODE = {layout.code: kind for kind, layout in FILES.items()}

# An 8 or 9 in such a number is a fault there, too, but three digits with a 0 are no slot.
_PLC5_IO = re.compile(r'[#$]?(?P<type>[IO])\d?[:;]0\d{2}(?:/\d{1,2})?', re.ASCII)
# Function files of the MicroLogix whose type code is not known.
_UNKNOWN_FILES = re.compile(
    r'(?P<name>BHI|CS|DAT|DLS|ES|IOS|LCD|MMI|RTC|TPI)\d*(?:[:;/.].*)?', re.ASCII)
_LAST_OF_FUNCTION = {
    FileType.HSC: 5, FileType.STI: 0, FileType.EII: 7, FileType.PTO: 2, FileType.PWM: 2}

# Last elements and slots, and last words of a slot (M 13-13).
_LAST_ELEMENT = 255
_LAST_SLOT = 30
_LAST_SLOT_WORD = 255
_LAST_FLAT_WORD = (_LAST_SLOT + 1) * (_LAST_SLOT_WORD + 1) - 1


class _SlcAddressing(FileAddressing):
    plc_type = PlcType.SLC
    files = FILES
    title = 'SLC'
    last_file = 255

    def mistaken(self, text: str) -> str | None:
        """Recognise function files that cannot be read, and the octal I/O of a PLC-5."""
        if match := _UNKNOWN_FILES.fullmatch(text):
            clock = ' (S:37 to S:42 may show the clock, or 0)' if match['name'] == 'RTC' else ''
            return (f'{match["name"]} is a function file whose type code is not known{clock}; let '
                    'the program copy what is needed into an N file')
        if match := _PLC5_IO.fullmatch(text):
            return ('this is the octal form of a PLC-5 (PLC_Type PLC5); an SLC has slot, word and '
                    f'bit, as in {match["type"]}:1.0/3')
        return None

    def last_element(self, kind: FileType, is_flat: bool = False) -> int:
        if not kind.is_io:
            return _LAST_OF_FUNCTION.get(kind, _LAST_ELEMENT)
        return _LAST_FLAT_WORD if is_flat else _LAST_SLOT

    def elements_name(self, kind: FileType, is_flat: bool) -> str:
        return 'slots' if kind.is_io and not is_flat else 'elements'

    def slot_of(self, address: Address) -> int | None:
        """Return the slot, None outside of the I/O."""
        return address.element if address.file_type.is_io and not address.is_flat else None

    def area_size(self, address: Address) -> int:
        """Return how many words a file or slot can have at most."""
        if self.slot_of(address) is not None:
            return _LAST_SLOT_WORD + 1
        return super().area_size(address)

    def _with_word(self, address: Address, word: int) -> Address:
        if address.is_flat:
            raise AddressSyntaxError(
                'with access Flat write the word of the whole image, as in I:5 or O:0/3')
        if self.slot_of(address) is None:
            return super()._with_word(address, word)
        if word > _LAST_SLOT_WORD:
            raise AddressRangeError(f'words of a slot run from 0 to {_LAST_SLOT_WORD}')
        return replace(address, word=word)

    def _rest_text(self, address: Address) -> str:
        if self.slot_of(address) is None:
            return super()._rest_text(address)
        return f'.{address.word}' + ('' if address.bit is None else f'/{address.bit}')


ADDRESSING = _SlcAddressing()

CLOCK = ADDRESSING.parse('S:37')
"""The first of six words: year, month, day, hour, minute, second (1747-RM001G B-54)."""
