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
Ranges of addresses: N7:0-9, B3:1/0-7, T4:0-3 or B3:1/0-B3:1/3, both ends included.

The second end may be only the number that differs; the parser of the family reads both, so
octal numbers stay octal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
import re

from abdf1_ros.pccc.address import Address, AddressRangeError, AddressSyntaxError, BITS
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.structures import elements_text
from abdf1_ros.pccc.values import types_of, ValueType

_RANGE = re.compile(r'(?P<first>.+?)\s*(?:-|\.\.+|\s+TO\s+)\s*(?P<last>.+)', re.ASCII)
_COUNT = re.compile(r'(?P<first>.+?)\s*(?:\{(?P<braces>\d{1,5})\}|\[(?P<brackets>\d{1,5})\]'
                    r'|(?:,\s*L?|\s+L)(?P<comma>\d{1,5}))', re.ASCII)
_NUMBER = re.compile(r'\d+$', re.ASCII)
# Addresses that an error names one by one.
_MOST_NAMED = 4


@dataclass(frozen=True, slots=True)
class AddressRange:
    """
    Neighbours in a data table, from ``first`` to ``last``.

    With ``is_whole`` both are whole elements of a structure, such as timers. With ``is_short`` the
    text had only a number as its last end: bits may then be in several words.
    """

    first: Address
    last: Address
    is_whole: bool = False
    is_short: bool = False

    def length(self, kind: ValueType | None = None) -> int:
        """
        Return the Length with which the same words or bits are read from ``first`` on.

        ``kind`` is the type of the values, None for the natural one. Raises AddressSyntaxError if
        they are not neighbours; its text says what would be right.
        """
        first, last = self.first, self.last
        if (first.bit is None) != (last.bit is None):
            raise AddressSyntaxError(f'of {first} and {last} only one is a bit')
        if first.area != last.area:
            raise AddressSyntaxError(self._apart())
        if _position(first) > _position(last):
            raise AddressSyntaxError(f'the lower end comes first; write {last}-{first}')
        kind = kind or types_of(first)[0]
        if first.bit is not None:
            return self._bits()
        if first.file_type is FileType.STRING and first != last:
            raise AddressSyntaxError(f'each string needs its own row: {self._each()}')
        if first.file_type.is_structure and not self.is_whole and first.element != last.element:
            whole = elements_text(first, last)
            raise AddressSyntaxError(
                f'{first} and {last} are not neighbours; a row each for {self._each()}'
                f'{whole and f", or the whole elements with {whole}"}')
        return self._values(kind)

    def _bits(self) -> int:
        first, count = self.first, _position(self.last) - _position(self.first) + 1
        if first.offset == self.last.offset or self.is_short:
            return count
        if first.file_type.is_structure:
            raise AddressSyntaxError('bits of a structure end with their word; '
                                     f'{first} and {self.last} are in two')
        raise AddressSyntaxError(f'these are bits of several words; write {first}, and Length '
                                 f'{count}')

    def _values(self, kind: ValueType) -> int:
        layout, last = self.last.layout, self.last
        size = layout.value_words(last.word) if last.file_type.is_structure and not self.is_whole \
            else layout.words
        words = last.offset + size - self.first.offset
        if kind is ValueType.STRING and last.file_type is not FileType.STRING:
            return words
        count, rest = divmod(words, max(kind.words, 1))
        if rest:
            raise AddressSyntaxError(
                f'{self.first}-{last} are {words} words, and a {kind.value} takes {kind.words}')
        return count

    def _apart(self) -> str:
        first, last = self.first, self.last
        if first.file_type is last.file_type and first.file == last.file:
            return f'each slot needs its own row: {self._each()}'
        return f'{first} and {last} are not in the same file'

    def _each(self) -> str:
        """Return the same place of each element, as a list."""
        elements = range(self.first.element, self.last.element + 1) or (self.first.element,)
        places = [str(replace(self.first, element=element)) for element in elements]
        if len(places) > _MOST_NAMED:
            places = [*places[:_MOST_NAMED - 1], '...', places[-1]]
        return ', '.join(places)


def read_range(text: str, parse: Callable[[str], Address]) -> Address | AddressRange:
    """
    Read an address or a range with the ``parse`` of a family.

    Raises AddressSyntaxError or AddressRangeError, whose text says what would be right.
    """
    plain = text.strip().upper()
    if match := _COUNT.fullmatch(plain):
        counted = _of_count(parse(match['first']), names_word(match['first']), int(
            match['braces'] or match['brackets'] or match['comma']))
        raise AddressSyntaxError(f'write {counted.first}, and Length {counted.length()}')
    match = _RANGE.fullmatch(plain)
    if match is None:
        return parse(text)
    start, end = match['first'], match['last']
    is_short = end.isdigit()
    if is_short:
        if not _NUMBER.search(start):
            parse(start)  # raises an error if nothing stands before the "-" of a number below 0
            raise AddressSyntaxError(f'{start} does not end with a number, so write the whole '
                                     'last address, too')
        end = _NUMBER.sub(end, start)
    first, last = parse(start), parse(end)
    found = AddressRange(first, last, is_element(first, start) and is_element(last, end), is_short)
    found.length()  # raises an error if the ends do not fit each other
    return found


def _of_count(first: Address, is_word: bool, count: int) -> AddressRange:
    """Return the range of ``count`` elements or bits from ``first``, as other programs count."""
    if count < 1:
        raise AddressSyntaxError('a range has at least one element')
    if first.bit is not None:
        words, bit = divmod(first.bit + count - 1, BITS)
        last = replace(first.at_offset(first.offset + words), bit=bit)
    elif first.addressing.slot_of(first) is not None:
        last = replace(first, word=first.word + count - 1)
    else:
        last = replace(first, element=first.element + count - 1)
    if last.offset >= first.area_size:
        raise AddressRangeError(f'the last word there can be is {first.last_of_area}')
    is_whole = first.file_type.is_structure and not first.word and not is_word
    return AddressRange(first, last, is_whole, is_short=True)


def is_element(address: Address, text: str) -> bool:
    """Tell whether a text names an element of a structure without a word of it."""
    return address.file_type.is_structure and address.bit is None and not names_word(text)


def names_word(text: str) -> bool:
    """Tell whether the address of a structure names a word or bit of it, as in T4:0/ACC."""
    return re.search('[./]', text) is not None


def _position(address: Address) -> int:
    """Return the number of the first bit of an address in its area."""
    return address.offset * BITS + (address.bit or 0)
