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
The addresses of PLC-5 and SLC, which are by file and element.

Grammar (S0, "Mapping Address Formatting Rules"; P5A), letters in any case::

    address  := ["#" | "$"] type [file] (":" | ";") element ["." member] ["/" bit]
              | ("B" | "N" | "A" | "D") file "/" bit          B3/17 is B3:1/1
    member      a name (T4:0.ACC, T4:0/DN) or the number of a word (T4:0.2); a float32 of a
                PLC-5 PD element has the number of its first word (PD10:0.2 is PD10:0.SP)
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import replace
import re
from typing import ClassVar

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address, Addressing, AddressRangeError, AddressSyntaxError, BITS
from abdf1_ros.pccc.file_types import FileType, FUNCTION_FILES
from abdf1_ros.text import shown

_FORM = re.compile(
    r'[#$]?(?P<type>[A-Z]{1,3})(?P<file>\d{1,9})?'
    r'(?:[:;](?P<element>\d{1,9})(?:\.(?P<member>[A-Z]+|\d{1,9}))?)?'
    r'(?:/(?P<bit>[A-Z]+|\d{1,9}))?', re.ASCII)

_FIXED_FILES = {FileType.OUTPUT: 0, FileType.INPUT: 1, FileType.STATUS: 2, **FUNCTION_FILES}
_FIRST_FREE_FILE = 3
# Files of words whose bits may be numbered from the first word on.
_FLAT_BITS = (FileType.BINARY, FileType.INTEGER, FileType.ASCII, FileType.BCD)
# S0 writes "/" before a word of such an element; other programs write it before a bit.
_NAMED_BITS = (FileType.TIMER, FileType.COUNTER, FileType.CONTROL)
# Files that exist, but that we do not know well enough to read.
_OTHER_FILES = {'CT': 'ControlNet transfer', 'PLS': 'programmable limit switch',
                'M': 'words of an I/O module, which COP brings into an N file'}


class FileAddressing(Addressing):
    """The common part of the addresses of both families."""

    last_file: ClassVar[int]
    is_by_file = True

    def parse(self, text: str, access: Access | None = None) -> Address:
        """Read an address; an error says what would be right."""
        text = text.strip().upper()
        if found := self.mistaken(text):
            raise AddressSyntaxError(found)
        match = _FORM.fullmatch(text)
        if match is None:
            raise AddressSyntaxError(
                'write type, file, ":", element, as in N7:0, B3:1/5, T4:0.ACC or I:1.0/3')
        kind = self._kind(match['type'])
        file = self._file(match['file'], kind)
        if match['element'] is None:
            return self._flat_bit(match['bit'], kind, file)
        is_flat = access is Access.FLAT and kind.is_io
        element = self._element(match['element'], kind, is_flat)
        address = Address(self, kind, file, element, is_flat=is_flat)
        member, bit = match['member'], match['bit']
        if member:
            address = (self._with_word(address, int(member)) if member.isdigit()
                       else _with_member(address, member))
        if bit:
            address = (self._with_bit(address, bit, names_word=bool(member))
                       if bit.isdigit() else _with_member(address, bit))
        return address

    def show(self, address: Address) -> str:
        kind = address.file_type
        file = '' if kind.is_io or kind.is_function else str(address.file)
        return f'{kind.value}{file}:{self._element_text(address)}{self._rest_text(address)}'

    @abstractmethod
    def mistaken(self, text: str) -> str | None:
        """
        Return the fault of a text in capitals, None for none.

        Such a text is an address of another family, or of a file that we cannot read.
        """

    def is_octal(self, kind: FileType) -> bool:
        """Tell whether elements and bits of such a file are octal."""
        return False

    def elements_name(self, kind: FileType, is_flat: bool) -> str:
        """Return the name of the elements of such a file."""
        return 'elements'

    def _kind(self, letters: str) -> FileType:
        for kind in self.files:
            if kind.value == letters:
                return kind
        known = ', '.join(kind.value for kind in FileType if kind in self.files)
        if letters in _OTHER_FILES:
            raise AddressSyntaxError(f'{letters} files ({_OTHER_FILES[letters]}) cannot be read '
                                     f'or written here; file types of {self.title}: {known}')
        raise AddressSyntaxError(f'{self.title} has no {letters} files; file types: {known}')

    def _file(self, text: str | None, kind: FileType) -> int:
        fixed = _FIXED_FILES.get(kind)
        if text is None:
            if kind.default_file is None:
                raise AddressSyntaxError(f'give the file number, as in {kind.value}9:0')
            return kind.default_file
        file = int(text)
        if fixed is not None and file != fixed:
            string = f'; for a string write ST{file}:0' if kind is FileType.STATUS else ''
            raise AddressRangeError(f'the {kind.value} file is file {fixed}{string}')
        if fixed is None and not _FIRST_FREE_FILE <= file <= self.last_file:
            raise AddressRangeError(
                f'files of type {kind.value} run from {_FIRST_FREE_FILE} to {self.last_file}')
        return file

    def _element(self, text: str, kind: FileType, is_flat: bool) -> int:
        octal = self.is_octal(kind)
        if octal and set(text) & set('89'):
            raise AddressSyntaxError('PLC-5 I/O words are octal, as in I:017')
        element, last = int(text, 8 if octal else 10), self.last_element(kind, is_flat)
        if element > last:
            shown = f'{last:o} (octal)' if octal else str(last)
            raise AddressRangeError(f'{self.elements_name(kind, is_flat)} of {kind.value} run '
                                    f'from 0 to {shown}')
        return element

    def _flat_bit(self, bit: str | None, kind: FileType, file: int) -> Address:
        if kind.is_io and bit is not None:
            example = f'{kind.value}:017/12' if self.is_octal(kind) else f'{kind.value}:1/3'
            raise AddressSyntaxError('bits are not counted through the file, as its words belong '
                                     f'to slots or racks: write the word too, as in {example}')
        if bit is None or not bit.isdigit() or kind not in _FLAT_BITS:
            raise AddressSyntaxError('an element is missing, as in N7:0')
        last = (self.last_element(kind) + 1) * BITS - 1
        if int(bit) > last:
            raise AddressRangeError(f'bits of {kind.value}{file} run from 0 to {last}')
        element, bit_number = divmod(int(bit), BITS)
        return Address(self, kind, file, element, 0, bit_number)

    def _with_word(self, address: Address, word: int) -> Address:
        kind, layout = address.file_type, address.layout
        if kind is FileType.STRING:
            raise AddressSyntaxError(_whole_string(address))
        if not kind.is_structure:
            raise AddressSyntaxError(f'elements of {kind.value} files have no numbered words')
        if word >= layout.words:
            raise AddressRangeError(
                f'words of a {kind.value} element run from 0 to {layout.words - 1}')
        if not layout.value_words(word):
            raise AddressSyntaxError(
                f'word {word} is the second half of {_two_words(kind)}; write the first, '
                f'{word - 1}')
        return replace(address, word=word)

    def _with_bit(self, address: Address, text: str, names_word: bool) -> Address:
        kind, layout = address.file_type, address.layout
        if kind is FileType.LONG:
            raise AddressSyntaxError(f'bits of an L file have no address; read {address} as '
                                     f'int32 and take bit {text} from it')
        if not kind.has_bits or address.bit is not None:
            size = '; the length of a string is not written here' \
                if kind is FileType.STRING else ''
            raise AddressSyntaxError(f'{kind.value} files have no bits to address{size}')
        if layout.value_words(address.word) != 1:
            raise AddressSyntaxError(
                f'{address} is {_two_words(kind)}, which has no bits to address')
        octal = self.is_octal(kind)
        if octal and set(text) & set('89'):
            raise AddressSyntaxError('PLC-5 I/O bits are octal, 0 to 17')
        bit = int(text, 8 if octal else 10)
        if bit >= BITS:
            raise AddressRangeError(f'bits run from 0 to {"17 (octal)" if octal else "15"}')
        if kind in _NAMED_BITS and not names_word:
            _check_named(address, bit)
        return replace(address, bit=bit)

    def _element_text(self, address: Address) -> str:
        octal = self.is_octal(address.file_type)
        return f'{address.element:03o}' if octal else str(address.element)

    def _rest_text(self, address: Address) -> str:
        """Return member and bit."""
        bit = address.bit
        if address.word or bit is not None:
            for name, member in address.layout.members.items():
                if (member.word, member.bit) == (address.word, bit):
                    return f'.{name}' if bit is None else f'/{name}'
        # A bit without a name needs its word.
        needs_word = address.word or bit is not None and address.file_type in _NAMED_BITS
        word = f'.{address.word}' if needs_word else ''
        if bit is None:
            return word
        return f'{word}/{bit:02o}' if self.is_octal(address.file_type) else f'{word}/{bit}'


def _two_words(kind: FileType) -> str:
    return 'an int32' if kind.is_function else 'a float32'


def _whole_string(address: Address) -> str:
    return f'a string is read and written as a whole; write {address}'


def _with_member(address: Address, name: str) -> Address:
    members = address.layout.members
    member = members.get(name)
    # The name of a bit may follow the number of its word; the name of a value may not.
    if member is None or address.bit is not None or (
            address.word and (member.bit is None or member.word != address.word)):
        if address.file_type is FileType.STRING:
            raise AddressSyntaxError(
                f'the length is part of the string; read {address}, which is as long as that'
                if name == 'LEN' else _whole_string(address))
        known = ', '.join(members) or 'none'
        raise AddressSyntaxError(
            f'{shown(name)} is not a member; members of {address.file_type.value} files: {known}')
    return replace(address, word=member.word, bit=member.bit)


def _check_named(address: Address, bit: int) -> None:
    """Refuse an unnamed bit of the first word: the text may mean the word of this number."""
    members = address.layout.members
    if any((member.word, member.bit) == (0, bit) for member in members.values()):
        return
    words = {member.word: name for name, member in members.items() if member.bit is None}
    hint = f'; word {bit} is {address}.{words[bit]}' if words.get(bit) else ''
    bits = ', '.join(name for name, member in members.items() if member.bit is not None)
    raise AddressSyntaxError(
        f'bit {bit} of a {address.file_type.value} element has no name{hint}; bits: {bits}')
