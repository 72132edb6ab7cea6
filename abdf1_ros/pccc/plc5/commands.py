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

"""The commands of a PLC-5: typed read, typed write, read-modify-write (M 7-20, 7-28..7-30)."""

from __future__ import annotations

from dataclasses import dataclass

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc import status
from abdf1_ros.pccc.address import Address, AddressRangeError, AddressRefusal, AddressSyntaxError
from abdf1_ros.pccc.fields import number, Reader, word
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.plc5.address import ADDRESSING
from abdf1_ros.pccc.typed_data import FLOAT, INTEGER, TypedData

CMD = 0x0F
READ_MODIFY_WRITE = 0x26
TYPED_WRITE = 0x67
TYPED_READ = 0x68

# A reply has at most 240 bytes of descriptors and data. A write has at most 240 bytes of address,
# descriptors and data (M 7-28, 7-30).
MAX_REPLY = 240
MAX_WRITE = 240
MAX_INTEGERS = 110  # 118 would fit, but without room for descriptors that are padded
# Mask, file and element in three bytes each (M 13-10..13-12).
MAX_ELEMENT_ADDRESS = 7

_AREA, _FILE, _ELEMENT, _SUB_ELEMENT = 1, 2, 4, 8
_MAX_SETS = 243
_DEFAULT_FILE = 1  # of an address without a file level (M 13-10..13-15)


@dataclass(frozen=True, slots=True)
class Element:
    """
    The unit in which a typed command counts.

    ``type_id`` is the data type (M 7-29), ``wire_size`` the bytes of a unit on the line, ``size``
    the bytes among them that have an address. On the line a unit is ``parts`` pieces of that type.
    In an A file one element is one byte (1785-6.5.9 6-12), so one word holds two characters.
    """

    type_id: int
    wire_size: int
    size: int
    parts: int = 1

    def typed(self, data: bytes) -> TypedData:
        """Return whole elements, as they stand on the line, with their type."""
        return TypedData(self.type_id, self.wire_size // self.parts, data)


def element_of(address: Address, is_value: bool) -> Element:
    """Return the unit that is moved at ``address``: a value of a structure, or whole elements."""
    layout = ADDRESSING.files[address.file_type]  # an SLC serves these commands too
    if not is_value:
        parts = 2 if address.file_type is FileType.ASCII else 1
        return Element(layout.code, 2 * layout.wire_words, 2 * layout.words, parts)
    is_float = layout.value_words(address.word) == 2
    return Element(FLOAT, 4, 4) if is_float else Element(INTEGER, 2, 2)


@dataclass(frozen=True, slots=True)
class SystemAddress:
    """A PLC-5 system address: file, element and, for one word of a structure, sub-element."""

    file: int
    element: int
    sub_element: int | None = None

    def encode(self) -> bytes:
        """
        Return the logical binary form (M 13-10..13-12).

        The form has no memory area, which means the data table. Some servers refuse an address
        that names the area; ``read`` accepts both forms.
        """
        mask = _FILE | _ELEMENT
        levels = number(self.file) + number(self.element)
        if self.sub_element is not None:
            mask |= _SUB_ELEMENT
            levels += number(self.sub_element)
        return bytes((mask,)) + levels

    @classmethod
    def read(cls, reader: Reader) -> SystemAddress:
        """
        Take an address off ``reader``, logical binary or logical ASCII (M 13-10..13-15).

        Raises AddressRefusal for an address that does not exist, FormatError when bytes run out.
        """
        mask = reader.byte()
        if mask == 0:
            return cls._read_ascii(reader)
        if mask & ~(_AREA | _FILE | _ELEMENT | _SUB_ELEMENT):
            raise AddressRefusal(status.EXT_TOO_MANY_LEVELS,
                                 f'address mask {mask:02X} has more levels than a PLC-5')
        area = reader.number() if mask & _AREA else 0
        if area:
            raise AddressRefusal(status.EXT_BAD_ADDRESS,
                                 f'memory area {area} is not the data table')
        file = reader.number() if mask & _FILE else _DEFAULT_FILE
        element = reader.number() if mask & _ELEMENT else 0
        return cls(file, element, reader.number() if mask & _SUB_ELEMENT else None)

    @classmethod
    def _read_ascii(cls, reader: Reader) -> SystemAddress:
        text = reader.text()
        if text[:1] != b'$':
            raise AddressRefusal(status.EXT_NO_SUCH_SYMBOL,
                                 'a symbol; an address in ASCII begins with "$"')
        try:
            address = ADDRESSING.parse(text[1:].decode('ascii', 'replace'))
        except AddressSyntaxError as error:
            raise AddressRefusal(status.EXT_BAD_SYMBOL, str(error)) from None
        except AddressRangeError as error:
            raise AddressRefusal(status.EXT_BAD_ADDRESS, str(error)) from None
        if address.bit is not None:
            raise AddressRefusal(status.EXT_BAD_SYMBOL, 'a system address names no bit')
        return cls(address.file, address.element, address.word or None)


@dataclass(frozen=True, slots=True)
class TypedRead:
    """
    Typed read, 0F/68 (M 7-28).

    A transaction of ``total`` elements begins at ``address``. This packet asks for ``size`` of
    these elements, from element ``offset`` on.
    """

    address: SystemAddress
    size: int
    offset: int
    total: int

    def encode(self) -> bytes:
        """Return FNC and parameters."""
        return (bytes((TYPED_READ,)) + word(self.offset) + word(self.total)
                + self.address.encode() + word(self.size))

    @classmethod
    def read(cls, reader: Reader) -> TypedRead:
        """Take the parameters off ``reader``."""
        offset, total = reader.word(), reader.word()
        address = SystemAddress.read(reader)
        size = reader.word()
        reader.end()
        return cls(address, size, offset, total)


@dataclass(frozen=True, slots=True)
class TypedWrite:
    """Typed write, 0F/67 (M 7-30); ``offset`` and ``total`` as in TypedRead."""

    address: SystemAddress
    values: TypedData
    offset: int
    total: int

    def encode(self) -> bytes:
        """Return FNC and parameters."""
        return (bytes((TYPED_WRITE,)) + word(self.offset) + word(self.total)
                + self.address.encode() + self.values.encode())

    @classmethod
    def read(cls, reader: Reader) -> TypedWrite:
        """Take the parameters off ``reader``."""
        offset, total = reader.word(), reader.word()
        address = SystemAddress.read(reader)
        return cls(address, TypedData.decode(reader.rest()), offset, total)


@dataclass(frozen=True, slots=True)
class BitSet:
    """One word to modify: new = (old AND ``and_mask``) OR ``or_mask``."""

    address: SystemAddress
    and_mask: int
    or_mask: int

    def encode(self) -> bytes:
        """Return address and masks."""
        return self.address.encode() + word(self.and_mask) + word(self.or_mask)

    @classmethod
    def read(cls, reader: Reader) -> BitSet:
        """Take address and masks off ``reader``."""
        return cls(SystemAddress.read(reader), reader.word(), reader.word())


@dataclass(frozen=True, slots=True)
class ReadModifyWrite:
    """Read-modify-write, 0F/26: one or more words, each by its masks (M 7-20)."""

    sets: tuple[BitSet, ...]

    def encode(self) -> bytes:
        """Return FNC and parameters; FormatError when they are more than 243 bytes."""
        body = b''.join(entry.encode() for entry in self.sets)
        _check_sets(body)
        return bytes((READ_MODIFY_WRITE,)) + body

    @classmethod
    def read(cls, reader: Reader) -> ReadModifyWrite:
        """Take the parameters off ``reader``; FormatError when they are more than 243 bytes."""
        body = reader.rest()
        _check_sets(body)
        reader = Reader(body)
        sets = [BitSet.read(reader)]
        while not reader.is_empty:
            sets.append(BitSet.read(reader))
        return cls(tuple(sets))


def _check_sets(body: bytes) -> None:
    if len(body) > _MAX_SETS:
        raise FormatError(f'{len(body)} bytes of words to modify, {_MAX_SETS} are allowed')
