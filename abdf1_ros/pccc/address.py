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
PLC addresses: places in a data table, and how a family writes and counts them.

``file_address`` has the grammar that PLC-5 and SLC share. The module ``address`` in the folder of
a family has the grammar of this family. ``families`` reads the text of an address of any family.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.file_types import FileType, Layout, PlcType

BITS = 16


class AddressSyntaxError(FormatError):
    """The text is not an address of this family."""


class AddressRangeError(FormatError):
    """The address is well formed, but outside the ranges of the family."""


class AddressRefusal(FormatError):
    """The address in a command does not exist; a PLC answers with ``ext_sts`` (M 8-4)."""

    def __init__(self, ext_sts: int, text: str) -> None:
        super().__init__(text)
        self.ext_sts = ext_sts


class Addressing(ABC):
    """
    How the places of one family's data table are written and counted.

    ``title`` is the usual name of the family, ``files`` are the file types that it can have.
    ``has_sections`` tells whether each type has file numbers of its own. If two families have
    ``is_by_file``, the commands of both find a file by the same number.
    """

    plc_type: ClassVar[PlcType]
    title: ClassVar[str]
    files: ClassVar[Mapping[FileType, Layout]]
    has_sections: ClassVar[bool] = False
    is_by_file: ClassVar[bool] = False

    @abstractmethod
    def parse(self, text: str, access: Access | None = None) -> Address:
        """
        Read an address, reached by ``access`` where that makes a difference.

        Raises AddressSyntaxError or AddressRangeError, whose text says what would be right.
        """

    @abstractmethod
    def show(self, address: Address) -> str:
        """Return the text that ``parse`` reads."""

    @abstractmethod
    def last_element(self, kind: FileType, is_flat: bool = False) -> int:
        """Return the number of the last element that a file of this type can have."""

    def slot_of(self, address: Address) -> int | None:
        """Return the I/O slot if words are numbered in each slot, None for a file."""
        return None

    def area_size(self, address: Address) -> int:
        """Return how many words the area of an address can have at most."""
        last = self.last_element(address.file_type, address.is_flat)
        return (last + 1) * address.layout.words


@dataclass(frozen=True, slots=True)
class Area:
    """A stretch of data table with words numbered from 0: a file, or one I/O slot."""

    plc_type: PlcType
    file_type: FileType
    file: int
    slot: int | None = None


@dataclass(frozen=True, slots=True)
class Address:
    """
    One place in a data table.

    ``element`` is the element number; for PLC-5 I/O it is rack x 8 + group, for SLC I/O the slot.
    ``word`` is the word inside the element or slot, ``bit`` 0-15 or None for a whole word. The one
    stretch of words that a PLC-2 has counts as file 0 of type B. ``is_flat`` is for SLC I/O whose
    ``element`` is the word in the whole image.
    """

    addressing: Addressing
    file_type: FileType
    file: int
    element: int
    word: int = 0
    bit: int | None = None
    is_flat: bool = False

    @property
    def plc_type(self) -> PlcType:
        """Return the family."""
        return self.addressing.plc_type

    @property
    def layout(self) -> Layout:
        """Return how the elements of its file are built."""
        return self.addressing.files[self.file_type]

    @property
    def area(self) -> Area:
        """Return the stretch of data table that contains the address."""
        return Area(self.plc_type, self.file_type, self.file, self.addressing.slot_of(self))

    @property
    def offset(self) -> int:
        """Return the number of this word within its area."""
        if self.addressing.slot_of(self) is not None:
            return self.word
        return self.element * self.layout.words + self.word

    @property
    def area_size(self) -> int:
        """Return how many words the area can have at most."""
        return self.addressing.area_size(self)

    @property
    def last_of_area(self) -> Address:
        """Return the last word of the area; of elements without named words, the last element."""
        words = 1 if self.file_type.is_structure else self.layout.words
        return self.at_offset(self.area_size - words)

    @property
    def is_by_type(self) -> bool:
        """Tell whether the number of its file is free for files of other types, too."""
        return self.addressing.has_sections or self.file_type.is_function

    def may_share_file(self, other: Address) -> bool:
        """
        Tell whether both addresses may lie in one file, or slot, of a PLC.

        A PLC finds a file by its number, whatever type or family a command names. If this is not
        sure, return True.
        """
        mine, others = self.area, other.area
        if None not in (mine.slot, others.slot) and mine.slot != others.slot:
            return False
        if not self._is_found_like(other):
            return True
        is_by_type = self.is_by_type or other.is_by_type
        return mine.file == others.file and (not is_by_type or mine.file_type is others.file_type)

    def counts_like(self, other: Address) -> bool:
        """Tell whether equal offsets are the same word if both addresses are in one file."""
        return self._is_found_like(other) and self.layout.words == other.layout.words \
            and self.area.slot == other.area.slot

    def _is_found_like(self, other: Address) -> bool:
        return self.plc_type == other.plc_type \
            or self.addressing.is_by_file and other.addressing.is_by_file

    def at_offset(self, offset: int) -> Address:
        """Return the address of word ``offset`` of the same area."""
        if self.addressing.slot_of(self) is not None:
            return replace(self, word=offset, bit=None)
        element, word = divmod(offset, self.layout.words)
        return replace(self, element=element, word=word, bit=None)

    def with_bit(self, bit: int) -> Address:
        """Return the address of a bit of this word."""
        return replace(self, bit=bit)

    def is_value(self, words: int) -> bool:
        """Tell whether ``words`` words from here on are one value of a structure."""
        return self.file_type.is_structure and self.layout.value_words(self.word) == words

    def __str__(self) -> str:
        """Return the address in the form that its family reads."""
        return self.addressing.show(self)
