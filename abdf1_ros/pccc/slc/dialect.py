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

"""How words of an SLC 500 or MicroLogix are read and written."""

from __future__ import annotations

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.dialect import Dialect, Request, Transfer, whole_elements
from abdf1_ros.pccc.fields import word
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.processor import Processor, USUAL
from abdf1_ros.pccc.slc import commands as slc
from abdf1_ros.pccc.slc.address import FILES


class SlcDialect(Dialect):
    """
    Protected typed logical read, write and masked write with three address fields.

    ``processor`` sets the longest packets.
    """

    def __init__(self, processor: Processor = USUAL) -> None:
        self._processor = processor

    def max_read(self, file_type: FileType) -> int:
        return whole_elements(FILES[file_type], self._processor.max_read)

    def sure_read(self, file_type: FileType) -> int:
        """Return the most words that one read of the oldest processor brings."""
        return whole_elements(FILES[file_type], Processor.SLC_5_01.max_read)

    def max_write(self, file_type: FileType) -> int:
        return whole_elements(FILES[file_type], self._processor.max_write)

    def read(self, address: Address, words: int, transfer: Transfer | None = None) -> Request:
        return slc.CMD, slc.LogicalRead(_logical_address(address), words * 2).encode()

    def write(self, address: Address, data: bytes, transfer: Transfer | None = None) -> Request:
        return slc.CMD, slc.LogicalWrite(_logical_address(address), data).encode()

    def write_bits(self, address: Address, mask: int, bits: int) -> Request:
        """Return a masked write of one word."""
        return slc.CMD, slc.MaskedWrite(
            _logical_address(address), mask, word(bits & mask)).encode()


def _logical_address(address: Address) -> slc.LogicalAddress:
    code = slc.FLAT_CODES[address.file_type] if address.is_flat else address.layout.code
    return slc.LogicalAddress(address.file, code, address.element, address.word)


# One dialect for Access Slot and Flat: each address tells which of them it is.
BY_PROCESSOR = {processor: SlcDialect(processor) for processor in Processor}
