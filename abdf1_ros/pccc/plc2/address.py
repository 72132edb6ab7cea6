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

Grammar, as PLC-2 manuals write it (M 13-2)::

    address  := word ["/" bit]          020, 110/17; both octal
"""

from __future__ import annotations

import re

from abdf1_ros.pccc.address_errors import AddressRangeError, AddressSyntaxError

LAST_WORD = 0o77777  # the byte address has 16 bits
_LAST_BIT = 0o17
_FORM = re.compile(r'[#$]?(?P<word>\d{1,6})(?:/(?P<bit>\d{1,3}))?', re.ASCII)


def parse(text: str) -> tuple[int, int | None]:
    """Return word and bit; AddressSyntaxError or AddressRangeError for anything else."""
    match = _FORM.fullmatch(text)
    if match is None:
        raise AddressSyntaxError('write the octal number of a word, as in 020 or 110/17')
    if set(text) & set('89'):
        raise AddressSyntaxError('PLC-2 words and bits are octal, as in 020 or 110/17')
    word, bit = int(match['word'], 8), int(match['bit'], 8) if match['bit'] else None
    if word > LAST_WORD:
        raise AddressRangeError(f'words run from 0 to {LAST_WORD:o} (octal)')
    if bit and bit > _LAST_BIT:
        raise AddressRangeError(f'bits run from 0 to {_LAST_BIT:o} (octal)')
    return word, bit


def show(word: int, bit: int | None) -> str:
    """Return the text that ``parse`` reads."""
    return f'{word:03o}' if bit is None else f'{word:03o}/{bit:02o}'
