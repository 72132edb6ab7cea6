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
The type/data parameter of the PLC-5 typed commands (M 7-28, 7-29).

A descriptor is a flag byte, then the type ID and the size if they do not fit into the flag. Bits
6-4 of the flag are the ID, or with bit 7 the number of ID bytes that follow; bits 2-0 are the
size, or with bit 3 the number of size bytes. An array (ID 9) holds one inner descriptor and its
elements; its size counts both. Zero padding is legal, so 43, 49 03 and 4A 03 00 are the same.
"""

from __future__ import annotations

from dataclasses import dataclass

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import Reader

BYTE_STRING = 3
INTEGER = 4
FLOAT = 8
ARRAY = 9
_LAST_SHORT = 7


@dataclass(frozen=True, slots=True)
class TypedData:
    """
    Elements of one type.

    ``type_id`` is the data type (M 7-29), ``element_size`` the bytes of one element, ``data`` the
    bytes of all elements in their order.
    """

    type_id: int
    element_size: int
    data: bytes

    @property
    def count(self) -> int:
        """Return the number of elements."""
        return len(self.data) // self.element_size

    def encode(self) -> bytes:
        """Return the elements as an array, with the shortest descriptors."""
        inner = _descriptor(self.type_id, self.element_size)
        return _descriptor(ARRAY, len(inner) + len(self.data)) + inner + self.data

    @classmethod
    def decode(cls, parameter: bytes) -> TypedData:
        """
        Read an array or a bare element, in every legal form.

        Padding after the declared size of an array is ignored. Raises FormatError if any other
        length is wrong.
        """
        reader = Reader(parameter)
        type_id, size = _read_descriptor(reader)
        if type_id == ARRAY:
            array = reader.take(size)
            reader.end()
            reader = Reader(array)
            type_id, size = _read_descriptor(reader)
        data = reader.rest()
        if size == 0 or len(data) % size:
            raise FormatError(f'{len(data)} bytes are not whole elements of {size} bytes')
        return cls(type_id, size, data)


def _descriptor(type_id: int, size: int) -> bytes:
    flag_id, more_id = _field(type_id)
    flag_size, more_size = _field(size)
    return bytes((flag_id << 4 | flag_size,)) + more_id + more_size


def _field(value: int) -> tuple[int, bytes]:
    """Return four flag bits and the bytes that follow for an ID or a size."""
    if value <= _LAST_SHORT:
        return value, b''
    more = value.to_bytes((value.bit_length() + 7) // 8, 'little')
    return 8 | len(more), more


def _read_descriptor(reader: Reader) -> tuple[int, int]:
    flag = reader.byte()
    return _read_field(flag >> 4, reader), _read_field(flag & 0x0F, reader)


def _read_field(bits: int, reader: Reader) -> int:
    if not bits & 8:
        return bits
    return int.from_bytes(reader.take(bits & 7), 'little')
