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

"""How words of a PLC-3 are read and written."""

from __future__ import annotations

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.plc3.address import FILES, SECTIONS
from abdf1_ros.pccc.plc3.commands import ExtendedAddress
from abdf1_ros.pccc.word_range.commands import WordBitWrite
from abdf1_ros.pccc.word_range.dialect import WordRangeDialect


class _Plc3Range:
    """The extended address and the bit write."""

    files = FILES
    # Flag and section, three bytes each for file, structure and word (M 13-5..13-8).
    address_size = 11

    def address(self, address: Address) -> ExtendedAddress:
        section = SECTIONS[address.file_type]
        if address.file_type.is_structure:
            return ExtendedAddress(section, address.file, address.element, address.word)
        return ExtendedAddress(section, address.file, 0, address.element)

    def write_bits(self, address: Address, set_bits: int, reset_bits: int) -> bytes:
        return WordBitWrite(self.address(address), set_bits, reset_bits).encode()


PLC3 = WordRangeDialect(_Plc3Range())
