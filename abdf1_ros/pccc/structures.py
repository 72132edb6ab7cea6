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

"""Which type the words at an address have, and which words of a structure may be written."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from abdf1_ros.pccc.address import Address, BITS
from abdf1_ros.pccc.values import types_of, ValueType, WordOrder


def wrong_type(address: Address, kind: ValueType) -> str | None:
    """Return what would be right if an address has no values of this type, None if it has."""
    types = types_of(address)
    if kind in types:
        return None
    text = f'{address} can be {", ".join(right.value for right in types)}'
    if kind is ValueType.BOOL:
        return f'{text}; a bool needs a bit address such as B3:0/5'
    if address.bit is None:
        return text
    if values := ', '.join(value_addresses(address)):
        return f'{text}: it is a bit; the values of this element are {values}'
    return f'{text}: it is a bit; its word is {replace(address, bit=None)}'


def order_fault(address: Address, kind: ValueType, order: WordOrder) -> str | None:
    """Return why values at an address cannot have this order of words, None if they can."""
    if order is WordOrder.LOW or kind.words == 2 and types_of(address)[0].words == 1:
        return None
    return ('High is for int32, uint32 and float32 over words of 16 bits such as N7:0, not for '
            f'{kind.value} at {address}')


def value_addresses(address: Address) -> list[str]:
    """Return the values of an element of a structure, without its word of bits."""
    return [str(replace(address, word=member.word, bit=None))
            for member in address.layout.members.values() if member.word and member.bit is None]


def named_runs(address: Address) -> list[tuple[Address, int, int]]:
    """
    Return the named words of the element at an address: runs of values of one size.

    The result has for each run its first address, the number of values, and the words of a value.
    A word whose bits have names is a value of one word.
    """
    sizes = {member.word: member.words for member in address.layout.members.values()}
    runs: list[list[int]] = []
    for word, size in sorted(sizes.items()):
        if runs and runs[-1][2] == size and runs[-1][0] + runs[-1][1] * size == word:
            runs[-1][1] += 1
        else:
            runs.append([word, 1, size])
    return [(replace(address, word=word, bit=None), count, size) for word, count, size in runs]


def type_fault(address: Address, kind: ValueType, length: int) -> str | None:
    """Return the fault if one of ``length`` elements is not a ``kind``, None if all are."""
    if not address.file_type.is_structure or kind is ValueType.BOOL:
        return None
    for place in _places(address, kind, length):
        if not place.is_value(kind.words):
            right = 'words of 16 bits' if kind.words == 2 else f'{types_of(place)[0].value} values'
            return f'{length} {kind.value} from {address} reach to {place}, where {right} are'
    return None


def bits_fault(address: Address, kind: ValueType, length: int) -> str | None:
    """Return the fault if bits go on after their word of a structure, None if they do not."""
    if kind is ValueType.BOOL and address.file_type.is_structure and \
            (address.bit or 0) + length > BITS:
        return 'bits of a structure end with their word'
    return None


def elements_text(first: Address, last: Address) -> str:
    """Return how to name all words from element to element, empty if they have several types."""
    start = replace(first, word=0, bit=None)
    length = (last.element - start.element + 1) * start.layout.words
    return '' if type_fault(start, types_of(start)[0], length) else f'{start}, and Length {length}'


def write_fault(address: Address, kind: ValueType, length: int) -> str | None:
    """Return the fault if a part of a structure must not be written, None if all may."""
    if not address.file_type.is_structure:
        return None
    if kind is ValueType.BOOL:
        first = address.bit or 0
        wrong = [bit for bit in range(first, first + length)
                 if not address.layout.may_write(address.word, bit)]
        place = address.with_bit(wrong[0]) if wrong else None
    else:
        place = next((place for place in _places(address, kind, length)
                      if not place.layout.may_write(place.word)), None)
    if place is None:
        return None
    allowed = ', '.join(name for name, member in address.layout.members.items()
                        if member.writable) or 'nothing'
    return f'{place} belongs to the processor; of such an element can be written: {allowed}'


def _places(address: Address, kind: ValueType, length: int) -> Iterable[Address]:
    """Return where each element begins."""
    return (address.at_offset(address.offset + n * kind.words) for n in range(length))
