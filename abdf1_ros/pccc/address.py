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
PLC addresses: what a controls engineer writes, and where it lies in the data table.

Grammar (S0, "Mapping Address Formatting Rules"; P5A), letters in any case::

    address  := ["#" | "$"] type [file] (":" | ";") element ["." member] ["/" bit]
              | "B" file "/" bit                            B3/17 is B3:1/1
    PLC-5 I/O   I:017/12      rack and group octal, bit octal
    SLC I/O     I:1.0/3       slot, word, bit decimal; ".0" may be left out
                I:5/3         with access Flat the word of the whole image
    member      a name (T4:0.ACC, T4:0/DN) or the number of a word (T4:0.2); a float32 of a
                PLC-5 PD element has the number of its first word (PD10:0.2 is PD10:0.SP)

Those of a PLC-2 and a PLC-3 are described in ``plc2_address`` and ``plc3_address``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
import re

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address_advice import advice
from abdf1_ros.pccc.address_errors import AddressRangeError, AddressSyntaxError
from abdf1_ros.pccc.file_types import file_types_of, FileType, Layout, layout_of, PlcType
from abdf1_ros.pccc.plc2 import address as plc2_address
from abdf1_ros.pccc.plc3 import address as plc3_address

BITS = 16


_FORM = re.compile(
    r'[#$]?(?P<type>[A-Z]{1,2})(?P<file>\d{1,3})?'
    r'(?:[:;](?P<element>\d{1,5})(?:\.(?P<member>[A-Z]+|\d{1,3}))?)?'
    r'(?:/(?P<bit>[A-Z]+|\d{1,5}))?', re.ASCII)

_FIXED_FILES = {FileType.OUTPUT: 0, FileType.INPUT: 1, FileType.STATUS: 2}
_FIRST_FREE_FILE = 3

# Last file and last element of each family; last word of a slot for SLC I/O (M 13-13, P5A).
_LAST_FILE = {PlcType.PLC5: 999, PlcType.SLC: 255}
_LAST_ELEMENT = {PlcType.PLC5: 999, PlcType.SLC: 255}
_LAST_PLC5 = {
    FileType.OUTPUT: 0o277, FileType.INPUT: 0o277, FileType.STATUS: 127, FileType.STRING: 779,
    FileType.PID: 398, FileType.MESSAGE: 584}
_LAST_SLC_SLOT = 30
_LAST_SLC_SLOT_WORD = 255
_LAST_SLC_FLAT_WORD = (_LAST_SLC_SLOT + 1) * (_LAST_SLC_SLOT_WORD + 1) - 1


@dataclass(frozen=True, slots=True)
class Area:
    """A stretch of data table whose words are numbered through: a file, or one I/O slot."""

    plc_type: PlcType
    file_type: FileType
    file: int
    slot: int | None = None


@dataclass(frozen=True, slots=True)
class Address:
    """
    One place in a data table.

    ``element`` is the element number (for PLC-5 I/O rack x 8 + group, for SLC I/O the slot),
    ``word`` the word inside the element or slot, ``bit`` 0-15 or None for a whole word. The
    one stretch of words that a PLC-2 has counts as file 0 of type B. ``is_flat`` is for SLC I/O
    whose ``element`` is the word in the whole image.
    """

    plc_type: PlcType
    file_type: FileType
    file: int
    element: int
    word: int = 0
    bit: int | None = None
    is_flat: bool = False

    @classmethod
    def parse(cls, text: str, plc_type: PlcType, access: Access | None = None) -> Address:
        """
        Read an address; with ``access`` FLAT, SLC I/O is counted through the whole image.

        Raises AddressSyntaxError or AddressRangeError, whose text says what would be right.
        """
        text = text.strip().upper()
        if plc_type is PlcType.PLC2:
            word, bit_number = plc2_address.parse(text)
            return cls(plc_type, FileType.BINARY, 0, word, 0, bit_number)
        if plc_type is PlcType.PLC3:
            return cls(plc_type, *plc3_address.parse(text))
        if found := advice(text, plc_type):
            raise AddressSyntaxError(found)
        match = _FORM.fullmatch(text)
        if match is None:
            raise AddressSyntaxError(
                'write type, file, ":", element, as in N7:0, B3:1/5, T4:0.ACC or I:1.0/3')
        file_type = _file_type(match['type'], plc_type)
        file = _file(match['file'], file_type, plc_type)
        if match['element'] is None:
            return cls._flat_bit(match['bit'], file_type, file, plc_type)
        is_flat = access is Access.FLAT and file_type.is_io
        element = _element(match['element'], file_type, plc_type, is_flat)
        address = cls(plc_type, file_type, file, element, is_flat=is_flat)
        member, bit = match['member'], match['bit']
        if member:
            address = (address._with_word(int(member)) if member.isdigit()
                       else address._with_member(member))
        if bit:
            address = address._with_bit(bit) if bit.isdigit() else address._with_member(bit)
        return address

    @classmethod
    def _flat_bit(cls, bit: str | None, file_type: FileType, file: int,
                  plc_type: PlcType) -> Address:
        if bit is None or not bit.isdigit() or file_type is not FileType.BINARY:
            raise AddressSyntaxError('an element is missing, as in N7:0')
        last = (_last_element(file_type, plc_type) + 1) * BITS - 1
        if int(bit) > last:
            raise AddressRangeError(f'bits of {file_type.value}{file} run from 0 to {last}')
        element, bit_number = divmod(int(bit), BITS)
        return cls(plc_type, file_type, file, element, 0, bit_number)

    def _with_member(self, name: str) -> Address:
        members = self.layout.members
        member = members.get(name)
        # A bit may be named behind the number of its word, a value behind nothing.
        if member is None or self.bit is not None or (
                self.word and (member.bit is None or member.word != self.word)):
            known = ', '.join(members) or 'none'
            raise AddressSyntaxError(
                f'{name} is no member here; members of {self.file_type.value} files: {known}')
        return replace(self, word=member.word, bit=member.bit)

    def _with_word(self, word: int) -> Address:
        if self.is_flat:
            raise AddressSyntaxError(
                'with access Flat write the word of the whole image, as in I:5 or O:0/3')
        if self._is_slot:
            if word > _LAST_SLC_SLOT_WORD:
                raise AddressRangeError(f'words of a slot run from 0 to {_LAST_SLC_SLOT_WORD}')
        elif not self.file_type.is_structure:
            raise AddressSyntaxError(
                f'elements of {self.file_type.value} files have no numbered words')
        elif word >= self.layout.words:
            raise AddressRangeError(
                f'words of a {self.file_type.value} element run from 0 to '
                f'{self.layout.words - 1}')
        elif not self.layout.value_words(word):
            raise AddressSyntaxError(
                f'word {word} is the second half of a float32; write the first, {word - 1}')
        return replace(self, word=word)

    def _with_bit(self, text: str) -> Address:
        if not self.file_type.has_bits or self.bit is not None:
            raise AddressSyntaxError(f'{self.file_type.value} files have no bits to address')
        if self.layout.value_words(self.word) != 1:
            raise AddressSyntaxError(f'{self} is a float32, which has no bits to address')
        octal = self._is_octal
        if octal and set(text) & set('89'):
            raise AddressSyntaxError('PLC-5 I/O bits are octal, 0 to 17')
        bit = int(text, 8 if octal else 10)
        if bit >= BITS:
            raise AddressRangeError(f'bits run from 0 to {"17 (octal)" if octal else "15"}')
        return replace(self, bit=bit)

    @property
    def _is_octal(self) -> bool:
        return self.file_type.is_io and self.plc_type is PlcType.PLC5

    @property
    def _is_slot(self) -> bool:
        return self.file_type.is_io and self.plc_type is PlcType.SLC and not self.is_flat

    @property
    def layout(self) -> Layout:
        """Return how the elements of its file are built."""
        return layout_of(self.file_type, self.plc_type)

    @property
    def area(self) -> Area:
        """Return the stretch of data table this lies in."""
        slot = self.element if self._is_slot else None
        return Area(self.plc_type, self.file_type, self.file, slot)

    @property
    def offset(self) -> int:
        """Return the number of this word within its area."""
        if self._is_slot:
            return self.word
        return self.element * self.layout.words + self.word

    @property
    def area_size(self) -> int:
        """Return how many words the area can have at most."""
        if self._is_slot:
            return _LAST_SLC_SLOT_WORD + 1
        last = _last_element(self.file_type, self.plc_type, self.is_flat)
        return (last + 1) * self.layout.words

    def at_offset(self, offset: int) -> Address:
        """Return the address of word ``offset`` of the same area."""
        if self._is_slot:
            return replace(self, word=offset, bit=None)
        element, word = divmod(offset, self.layout.words)
        return replace(self, element=element, word=word, bit=None)

    def with_bit(self, bit: int) -> Address:
        """Return the address of a bit of this word."""
        return replace(self, bit=bit)

    def is_value(self, words: int) -> bool:
        """Tell whether so many words from here on are one value of a structure."""
        return self.file_type.is_structure and self.layout.value_words(self.word) == words

    def __str__(self) -> str:
        """Return the address in the form that ``parse`` reads."""
        kind = self.file_type
        if self.plc_type is PlcType.PLC2:
            return plc2_address.show(self.element, self.bit)
        if self.plc_type is PlcType.PLC3:
            return plc3_address.show(kind, self.file, self.element, self.word, self.bit)
        file = '' if kind.is_io else str(self.file)
        if self._is_slot:
            place = f'{self.element}.{self.word}'
        elif self._is_octal:
            place = f'{self.element:03o}'
        else:
            place = str(self.element)
        return f'{kind.value}{file}:{place}{self._member_text()}'

    def _member_text(self) -> str:
        bit = f'{self.bit:02o}' if self._is_octal and self.bit is not None else self.bit
        if self.word and not self._is_slot or self.bit is not None:
            for name, member in self.layout.members.items():
                if (member.word, member.bit) == (self.word, self.bit):
                    return f'.{name}' if self.bit is None else f'/{name}'
        word = f'.{self.word}' if self.word and not self._is_slot else ''
        return word if bit is None else f'{word}/{bit}'


def _file_type(letters: str, plc_type: PlcType) -> FileType:
    known = file_types_of(plc_type)
    for kind in known:
        if kind.value == letters:
            return kind
    raise AddressSyntaxError(f'{plc_type.value} has no {letters} files; file types: '
                             f'{", ".join(kind.value for kind in known)}')


def _file(text: str | None, kind: FileType, plc_type: PlcType) -> int:
    fixed = _FIXED_FILES.get(kind)
    if text is None:
        if kind.default_file is None:
            raise AddressSyntaxError(f'give the file number, as in {kind.value}9:0')
        return kind.default_file
    file = int(text)
    if fixed is not None and file != fixed:
        raise AddressRangeError(f'the {kind.value} file is file {fixed}')
    if fixed is None and not _FIRST_FREE_FILE <= file <= _LAST_FILE[plc_type]:
        raise AddressRangeError(
            f'files of type {kind.value} run from {_FIRST_FREE_FILE} to {_LAST_FILE[plc_type]}')
    return file


def _element(text: str, kind: FileType, plc_type: PlcType, is_flat: bool) -> int:
    octal = kind.is_io and plc_type is PlcType.PLC5
    if octal and set(text) & set('89'):
        raise AddressSyntaxError('PLC-5 I/O words are octal, as in I:017')
    element = int(text, 8 if octal else 10)
    _check_element(element, kind, plc_type, is_flat)
    return element


def _last_element(kind: FileType, plc_type: PlcType, is_flat: bool = False) -> int:
    if plc_type is PlcType.PLC2:
        return plc2_address.LAST_WORD
    if plc_type is PlcType.PLC3:
        return plc3_address.last_element(kind)
    if plc_type is PlcType.PLC5:
        return _LAST_PLC5.get(kind, _LAST_ELEMENT[plc_type])
    if kind.is_io:
        return _LAST_SLC_FLAT_WORD if is_flat else _LAST_SLC_SLOT
    return _LAST_ELEMENT[plc_type]


def _check_element(element: int, kind: FileType, plc_type: PlcType,
                   is_flat: bool = False) -> None:
    last = _last_element(kind, plc_type, is_flat)
    if element > last:
        octal = kind.is_io and plc_type is PlcType.PLC5
        shown = f'{last:o} (octal)' if octal else str(last)
        name = 'slots' if kind.is_io and not octal and not is_flat else 'elements'
        raise AddressRangeError(f'{name} of {kind.value} run from 0 to {shown}')
