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

"""From values on topics to words in a PLC, and back."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial
import math
import struct
import sys
from typing import TypeAlias

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc import strings
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.text import counted, shown

FLOAT_MAX = 3.4028234663852886e38  # the greatest float32


class ValueType(Enum):
    """
    A type of values; its value is the text in the column Type of a mapping.

    - ``words``: words of one element in a PLC, 0 for a bit.
    - ``message``: name of the message in std_msgs that carries such values.
    - ``array_code``: type code of the ``array.array`` that holds them.
    - ``range``: least and greatest value. A word of a ``bcd12`` has three digits in its lower 12
      bits: the upper four are status bits of a PLC-2 (1772-6.8.3 p. 5-1), and a write leaves them
      alone.
    """

    words: int
    message: str
    array_code: str
    range: tuple[float, float]  # noqa: A003

    BOOL = 'bool', 0, 'UInt8MultiArray', 'B', (0, 1)
    INT16 = 'int16', 1, 'Int16MultiArray', 'h', (-32768, 32767)
    UINT16 = 'uint16', 1, 'UInt16MultiArray', 'H', (0, 65535)
    INT32 = 'int32', 2, 'Int32MultiArray', 'i', (-2**31, 2**31 - 1)
    UINT32 = 'uint32', 2, 'UInt32MultiArray', 'I', (0, 2**32 - 1)
    FLOAT32 = 'float32', 2, 'Float32MultiArray', 'f', (-FLOAT_MAX, FLOAT_MAX)
    BCD16 = 'bcd16', 1, 'UInt16MultiArray', 'H', (0, 9999)
    BCD12 = 'bcd12', 1, 'UInt16MultiArray', 'H', (0, 999)
    STRING = 'string', strings.COUNTED_WORDS, 'String', '', (-math.inf, math.inf)

    def __new__(cls, name: str, words: int, message: str, array_code: str,
                limits: tuple[float, float]) -> ValueType:
        """Return a member whose value is the text in the column."""
        member = object.__new__(cls)
        member._value_, member.words, member.message = name, words, message
        member.array_code, member.range = array_code, limits
        return member

    @property
    def is_part(self) -> bool:
        """Tell whether a value has only some bits of its words; a write keeps all other bits."""
        return self in (ValueType.BOOL, ValueType.BCD12)

    @property
    def form(self) -> str:
        """Return what a value has to be, for users."""
        if self is ValueType.STRING:
            return 'a text (str)'
        if self is ValueType.BOOL:
            return '0 or 1'
        if self is ValueType.FLOAT32:
            return 'a number such as -1.5 or 2e3, at most 3.4e38'
        low, high = self.range
        return f'a whole number from {low:.0f} to {high:.0f}'

    def refusal(self, value: float, index: int) -> FormatError:
        """Return the error about a number that cannot be such a value."""
        return FormatError(
            f'value {value} at index {index} is not a valid {self.value}, {self.form}')


class WordOrder(Enum):
    """Which word of a 32-bit value over 16-bit words comes first."""

    LOW = 'Low'
    HIGH = 'High'


_WORD_TYPES = (ValueType.INT16, ValueType.UINT16, ValueType.BCD16, ValueType.BCD12,
               ValueType.INT32, ValueType.UINT32, ValueType.FLOAT32)
_UNSIGNED_FIRST = (ValueType.UINT16, ValueType.INT16, *_WORD_TYPES[2:])
_TYPES: dict[FileType, tuple[ValueType, ...]] = {
    FileType.FLOAT: (ValueType.FLOAT32,),
    FileType.LONG: (ValueType.INT32, ValueType.UINT32),
    FileType.STRING: (ValueType.STRING,),
    FileType.INTEGER: (*_WORD_TYPES, ValueType.STRING),
    FileType.ASCII: (*_UNSIGNED_FIRST, ValueType.STRING),
    FileType.BCD: (ValueType.BCD16, *(kind for kind in _UNSIGNED_FIRST
                                      if kind is not ValueType.BCD16))}
_BCD = (ValueType.BCD16, ValueType.BCD12)


def types_of(address: Address) -> tuple[ValueType, ...]:
    """Return the types that may be read from there, the natural one first."""
    if address.bit is not None:
        return (ValueType.BOOL,)
    if address.is_value(2):
        return _TYPES[FileType.LONG if address.file_type.is_function else FileType.FLOAT]
    if address.file_type.is_structure:
        return ValueType.INT16, ValueType.UINT16
    return _TYPES.get(address.file_type, _UNSIGNED_FIRST)


Values: TypeAlias = 'array[int] | array[float] | str'
"""An ``array.array`` with the type code of its ValueType, or a str."""


@dataclass(frozen=True, slots=True)
class Codec:
    """
    Turn ``length`` elements into words and back.

    Words are bytes, each word low byte first. ``bit`` is the number of the first bit, for bits
    only; ``word_order`` is for elements of two words. A ``packed`` string is the characters in
    ``length`` words, without the length word of an ST element.
    """

    type: ValueType  # noqa: A003
    length: int
    bit: int = 0
    word_order: WordOrder = WordOrder.LOW
    packed: bool = False

    @property
    def element_words(self) -> int:
        """Return the number of words of one value, which packets must not divide."""
        return 1 if self.packed else max(1, self.type.words)

    @property
    def words(self) -> int:
        """Return the number of words in which the elements have bits."""
        if self.type is ValueType.BOOL:
            return (self.bit + self.length + 15) // 16
        return self.element_words * self.length

    def decoder(self) -> Callable[[bytes], Values]:
        """Return ``decode``, or for plain numbers an equal function in a third of its time."""
        is_plain = self.word_order is WordOrder.LOW and sys.byteorder == 'little' and \
            self.type not in (ValueType.STRING, ValueType.BOOL, *_BCD)
        return partial(array, self.type.array_code) if is_plain else self.decode

    def decode(self, data: bytes) -> Values:
        """Return the values in ``data``; FormatError where the words are not such a value."""
        if self.type is ValueType.STRING:
            return strings.decode_packed(data) if self.packed else strings.decode_counted(data)
        if self.type is ValueType.BOOL:
            number = int.from_bytes(data, 'little') >> self.bit
            return array('B', ((number >> n) & 1 for n in range(self.length)))
        if self.word_order is WordOrder.HIGH:
            data = _exchange_words(data)
        values = array(self.type.array_code, data)
        if sys.byteorder == 'big':
            values.byteswap()
        if self.type in _BCD:
            mask = self._mask
            return array('H', [_from_bcd(int(value) & mask) for value in values])
        return values

    def check(self, values: Sequence[float] | str) -> None:
        """Raise FormatError, which names the wrong value, unless all values can be written."""
        if isinstance(values, str) is not (self.type is ValueType.STRING):
            what = 'text' if isinstance(values, str) else 'value'
            raise FormatError(f'the {what} {shown(repr(values))} is not a valid '
                              f'{self.type.value}, {self.type.form}')
        if isinstance(values, str):
            self._encode_string(values)
            return
        if len(values) != self.length:
            raise FormatError(f'{counted(len(values), "value")}, the mapping has {self.length}')
        low, high = self.type.range
        for index, value in enumerate(values):
            is_whole = self.type is ValueType.FLOAT32 or value % 1 == 0
            if not low <= value <= high or not is_whole:  # also NaN
                raise self.type.refusal(value, index)

    def encode(self, values: Sequence[float] | str) -> bytes:
        """Return whole words for ``values`` that ``check`` has passed; not for parts of words."""
        if isinstance(values, str):
            return self._encode_string(values)
        data = self._encode_numbers(values)
        return _exchange_words(data) if self.word_order is WordOrder.HIGH else data

    def _encode_string(self, text: str) -> bytes:
        if self.packed:
            return strings.encode_packed(text, self.length)
        return strings.encode_counted(text)

    def _encode_numbers(self, values: Sequence[float]) -> bytes:
        if self.type is ValueType.FLOAT32:
            return struct.pack(f'<{self.length}f', *values)
        if self.type in _BCD:
            values = [*map(_to_bcd, values)]
        size = self.type.words * 2
        mask = (1 << 8 * size) - 1
        return b''.join((int(value) & mask).to_bytes(size, 'little') for value in values)

    def store(self, table: DataTable, start: Address, values: Sequence[float] | str) -> None:
        """Write values into a data table; values that are parts of words keep all other bits."""
        if not self.type.is_part:
            table.write(start, self.encode(values))
            return
        assert not isinstance(values, str)
        for change in self.bit_changes(start, values):
            table.write_bits(*change)

    def masks(self) -> list[int]:
        """Return the bits of each word that belong to the values."""
        if self.type is ValueType.BOOL:
            return _words((1 << self.length) - 1 << self.bit, self.words)
        return [self._mask] * self.words

    @property
    def _mask(self) -> int:
        return 0x0FFF if self.type is ValueType.BCD12 else 0xFFFF

    def bit_changes(self, start: Address,
                    values: Sequence[float]) -> list[tuple[Address, int, int]]:
        """Return address, mask and bits of each word in which the values have some of the bits."""
        if self.type is ValueType.BOOL:
            number = sum(int(value) << n for n, value in enumerate(values)) << self.bit
            words = _words(number, self.words)
        else:
            words = [*map(_to_bcd, values)]
        return [(start.at_offset(start.offset + n), mask, bits)
                for n, (mask, bits) in enumerate(zip(self.masks(), words, strict=True))]


def _words(number: int, count: int) -> list[int]:
    return [number >> 16 * n & 0xFFFF for n in range(count)]


def _to_bcd(value: float) -> int:
    return int(str(int(value)), 16)


def _from_bcd(word: int) -> int:
    try:
        return int(f'{word:x}')
    except ValueError:
        raise FormatError(f'word {word:04X} is not BCD') from None


def _exchange_words(data: bytes) -> bytes:
    """Put the second word of each pair before the first."""
    words = array('H', data)
    words[0::2], words[1::2] = words[1::2], words[0::2]
    return words.tobytes()
