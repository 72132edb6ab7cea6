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


def _address(address: Address) -> ExtendedAddress:
    section = SECTIONS[address.file_type]
    if address.file_type.is_structure:
        return ExtendedAddress(section, address.file, address.element, address.word)
    return ExtendedAddress(section, address.file, 0, address.element)


def _bit_write(address: Address, set_bits: int, reset_bits: int) -> bytes:
    return WordBitWrite(_address(address), set_bits, reset_bits).encode()


# Flag and section, three bytes each for file, structure and word (M 13-5..13-8).
PLC3 = WordRangeDialect(FILES, 11, _address, _bit_write)
