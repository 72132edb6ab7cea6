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
Strings in a PLC: the form of an ST element, and of a string in a stretch of words.

Characters are Latin-1, two in a word, the first of them in the high byte.
"""

from __future__ import annotations

import re

from abdf1_ros.errors import FormatError

COUNTED_CHARACTERS = 82  # of an ST element, after its length word
COUNTED_WORDS = 1 + COUNTED_CHARACTERS // 2

_ELEMENT = re.compile(r'[#$]?ST\d*[:;]', re.ASCII | re.IGNORECASE)


def is_string_element(address: str) -> bool:
    """Tell whether an address, in any family, is that of an ST element."""
    return _ELEMENT.match(address.strip()) is not None


def decode_counted(data: bytes) -> str:
    """Return the text of an ST element; FormatError when its length is more than 82."""
    length = int.from_bytes(data[:2], 'little')
    if length > COUNTED_CHARACTERS:
        raise FormatError(f'string length {length} is more than {COUNTED_CHARACTERS}')
    return _swap(data[2:])[:length].decode('latin-1')


def encode_counted(text: str) -> bytes:
    """Return an ST element; FormatError for more than 82 characters or not Latin-1."""
    characters = _characters(text)
    if len(characters) > COUNTED_CHARACTERS:
        raise FormatError(f'{len(characters)} characters, a PLC string has {COUNTED_CHARACTERS}')
    length = len(characters).to_bytes(2, 'little')
    return length + _swap(characters.ljust(COUNTED_CHARACTERS, b'\0'))


def decode_packed(data: bytes) -> str:
    """Return the text in words without a length word; NULs at its end are removed."""
    return _swap(data).rstrip(b'\0').decode('latin-1')


def encode_packed(text: str, words: int) -> bytes:
    """Return words of characters, NULs after ``text``; FormatError when it is too long."""
    characters = _characters(text)
    if len(characters) > 2 * words:
        raise FormatError(f'{len(characters)} characters, the mapping has room for {2 * words}')
    return _swap(characters.ljust(2 * words, b'\0'))


def _characters(text: str) -> bytes:
    try:
        return text.encode('latin-1')
    except UnicodeEncodeError as error:
        raise FormatError(f'character {text[error.start]!r} does not exist in a PLC') from None


def _swap(data: bytes) -> bytes:
    """Exchange the bytes of each word."""
    swapped = bytearray(data)
    swapped[0::2], swapped[1::2] = data[1::2], data[0::2]
    return bytes(swapped)
