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
Addresses of a PLC-2, whose data table is one stretch of words.

Grammar, as PLC-2 manuals write it (M 13-2), all octal::

    address  := word ["/" bit]          020, 110/17
              | five digits             11017 is bit 17 of word 110
              | six digits              011017 is word 11017
"""

from __future__ import annotations

import re

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address, Addressing, AddressRangeError, AddressSyntaxError
from abdf1_ros.pccc.file_types import FileType, Layout, PlcType

# The data table of a PLC-2: one stretch of words, which counts as a file of type B.
FILES = {FileType.BINARY: Layout()}

_LAST_WORD = 0o77777  # the byte address has 16 bits
_LAST_BIT = 0o17
_LAST_SHORT = 0o7777  # the last word that four digits can name
_FORM = re.compile(r'[#$]?(?P<word>\d{1,9})(?:/(?P<bit>\d{1,3}))?', re.ASCII)
_BIT_FORM = re.compile(r'[#$]?(?P<word>\d{3})(?P<bit>\d{2})', re.ASCII)


class _Plc2Addressing(Addressing):
    plc_type = PlcType.PLC2
    title = 'PLC-2'
    files = FILES

    def parse(self, text: str, access: Access | None = None) -> Address:
        """Read a word or bit; an error says what would be right."""
        text = text.strip()
        match = _BIT_FORM.fullmatch(text) or _FORM.fullmatch(text)
        if match is None:
            raise AddressSyntaxError('write the octal number of a word, as in 020 or 110/17')
        if set(text) & set('89'):
            raise AddressSyntaxError('PLC-2 words and bits are octal, as in 020 or 110/17')
        word, bit = int(match['word'], 8), int(match['bit'], 8) if match['bit'] else None
        if word > _LAST_WORD:
            raise AddressRangeError(f'words run from 0 to {_LAST_WORD:o} (octal)')
        if bit and bit > _LAST_BIT:
            raise AddressRangeError(f'bits run from 0 to {_LAST_BIT:o} (octal)')
        return Address(self, FileType.BINARY, 0, word, 0, bit)

    def show(self, address: Address) -> str:
        word = show_word(address.element)
        return word if address.bit is None else f'{word}/{address.bit:02o}'

    def last_element(self, kind: FileType, is_flat: bool = False) -> int:
        return _LAST_WORD


ADDRESSING = _Plc2Addressing()


def show_word(word: int) -> str:
    """Return the octal number of a word, in six digits where five would be a bit."""
    return f'{word:03o}' if word <= _LAST_SHORT else f'{word:06o}'
