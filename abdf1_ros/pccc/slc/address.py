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
Addresses of an SLC 500 or MicroLogix: those of ``file_address``; its I/O is by slot and word.

::

    I:1.0/3       slot, word, bit; ".0" may be left out
    I:5/3         with access Flat the word of the whole image
"""

from __future__ import annotations

from dataclasses import replace

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.address_errors import AddressRangeError, AddressSyntaxError
from abdf1_ros.pccc.file_address import FileAddressing
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.slc.files import FILES

# Last elements and slots, and last words of a slot (M 13-13).
_LAST_ELEMENT = 255
_LAST_SLOT = 30
_LAST_SLOT_WORD = 255
_LAST_FLAT_WORD = (_LAST_SLOT + 1) * (_LAST_SLOT_WORD + 1) - 1


class _SlcAddressing(FileAddressing):
    plc_type = PlcType.SLC
    files = FILES
    last_file = 255

    def last_element(self, kind: FileType, is_flat: bool = False) -> int:
        if not kind.is_io:
            return _LAST_ELEMENT
        return _LAST_FLAT_WORD if is_flat else _LAST_SLOT

    def elements_name(self, kind: FileType, is_flat: bool) -> str:
        return 'slots' if kind.is_io and not is_flat else 'elements'

    def slot_of(self, address: Address) -> int | None:
        """Return the slot, None outside of the I/O."""
        return address.element if address.file_type.is_io and not address.is_flat else None

    def area_size(self, address: Address) -> int:
        """Return how many words a file or slot can have at most."""
        if self.slot_of(address) is not None:
            return _LAST_SLOT_WORD + 1
        return FileAddressing.area_size(self, address)

    def _with_word(self, address: Address, word: int) -> Address:
        if address.is_flat:
            raise AddressSyntaxError(
                'with access Flat write the word of the whole image, as in I:5 or O:0/3')
        if self.slot_of(address) is None:
            return FileAddressing._with_word(self, address, word)
        if word > _LAST_SLOT_WORD:
            raise AddressRangeError(f'words of a slot run from 0 to {_LAST_SLOT_WORD}')
        return replace(address, word=word)

    def _rest_text(self, address: Address) -> str:
        if self.slot_of(address) is None:
            return FileAddressing._rest_text(self, address)
        return f'.{address.word}' + ('' if address.bit is None else f'/{address.bit}')


ADDRESSING = _SlcAddressing()
