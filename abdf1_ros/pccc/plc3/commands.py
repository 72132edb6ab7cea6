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
The extended address of a PLC-3 (M 13-5..13-8).

A flag byte says which of six levels follow: area, context, section, file, structure, word. A level
that is left out has its default: area 3, which is the data table, context 1, and 0 for all other
levels.
"""

from __future__ import annotations

from dataclasses import dataclass

from abdf1_ros.pccc import status
from abdf1_ros.pccc.address import AddressRefusal
from abdf1_ros.pccc.fields import number, Reader

DATA_TABLE = 3
CONTEXT = 1
_DEFAULTS = (DATA_TABLE, CONTEXT, 0, 0, 0, 0)
_ALWAYS_THERE = (2, 3, 5)  # section, file, and word, because it is the last
_LEAST_LEVELS = 4  # three or fewer are too few for a word (M 8-8..8-10)
_LONGEST_SYMBOL = 8


@dataclass(frozen=True, slots=True)
class ExtendedAddress:
    """A place in the data table of context 1."""

    section: int
    file: int
    structure: int = 0
    word: int = 0

    def encode(self) -> bytes:
        """Return flag byte and levels; area, context and structure only if not the default."""
        levels = (DATA_TABLE, CONTEXT, self.section, self.file, self.structure, self.word)
        sent = [n for n, value in enumerate(levels) if n in _ALWAYS_THERE or value != _DEFAULTS[n]]
        flag = sum(1 << n for n in sent)
        return bytes((flag,)) + b''.join(number(levels[n]) for n in sent)

    @classmethod
    def read(cls, reader: Reader) -> ExtendedAddress:
        """
        Take an address off ``reader``.

        Raises AddressRefusal for symbols and other memory, FormatError when bytes run out.
        """
        area, context, *levels = read_levels(reader)
        if (area, context) != (DATA_TABLE, CONTEXT):
            raise AddressRefusal(status.EXT_BAD_ADDRESS, (
                f'E{area}.{context} is not the data table of context {CONTEXT}'))
        return cls(*levels)


def read_levels(reader: Reader) -> list[int]:
    """
    Take the six levels of an address in any memory off ``reader``.

    Raises AddressRefusal for symbols, FormatError when bytes run out.
    """
    flag = reader.byte()
    if flag == 0:
        raise _no_symbol(reader)
    if flag >> len(_DEFAULTS):
        raise AddressRefusal(status.EXT_TOO_MANY_LEVELS,
                             f'address flag {flag:02X} has more levels than a PLC-3')
    if flag.bit_length() < _LEAST_LEVELS:
        raise AddressRefusal(status.EXT_TOO_FEW_LEVELS,
                             f'address flag {flag:02X} does not reach a file')
    return [reader.number() if flag >> n & 1 else default for n, default in enumerate(_DEFAULTS)]


def _no_symbol(reader: Reader) -> AddressRefusal:
    """Return the refusal of the symbol that follows: wrong length, or no symbols here."""
    length = len(reader.text())
    if not 0 < length <= _LONGEST_SYMBOL:
        return AddressRefusal(status.EXT_BAD_SYMBOL, f'a symbol of {length} characters')
    return AddressRefusal(status.EXT_NO_SUCH_SYMBOL, 'symbols cannot be looked up here')
