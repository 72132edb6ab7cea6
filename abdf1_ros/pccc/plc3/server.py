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

"""The answers of a PLC-3 to commands (M 8-6..8-10)."""

from __future__ import annotations

from abdf1_ros.pccc import status
from abdf1_ros.pccc.address import Address, AddressRefusal
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.emulated import EmulatedProcessor
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.pccc.plc2.server import BasicService, Window
from abdf1_ros.pccc.plc3.address import ADDRESSING, BY_SECTION
from abdf1_ros.pccc.plc3.commands import ExtendedAddress
from abdf1_ros.pccc.serving import Codes
from abdf1_ros.pccc.word_range import commands as word_range
from abdf1_ros.pccc.word_range.server import RangeCodes, WordRangeService

_LAST_SECTION = 15  # of the data table; above that an address cannot be converted (M 8-8)


class Plc3Commands:
    """
    The commands a PLC-3 serves.

    A PLC-2 command reads and writes the input file whose number is the station of the sender.
    """

    no_such_file: Codes = status.EXTENDED, status.EXT_BAD_ADDRESS
    out_of_range: Codes = status.EXTENDED, status.EXT_BAD_ADDRESS
    protected: Codes = status.EXTENDED, status.EXT_PROTECTED

    def __init__(self, table: DataTable, processor: EmulatedProcessor) -> None:
        # A 1775-KA takes no byte too many (its manual, B-5).
        words = WordRangeService(table, ExtendedAddress.read, _place, _CODES, takes_padding=False)
        files = WordRangeService(table, _read_file_address, _place, _CODES, takes_padding=False)
        self.commands = words.commands() | {(word_range.CMD, word_range.FILE_READ): files.read}
        self.basic_commands = BasicService(table, _compatibility_file).everything()


# M 8-8, 8-9: for sizes that do not fit each other there is an STS without EXT STS.
_CODES = RangeCodes(
    bad_size=(status.STS_ILLEGAL_COMMAND, None),
    missing=(status.EXTENDED, status.EXT_BAD_ADDRESS),
    read_past_end=(status.EXTENDED, status.EXT_PAST_THE_END),
    write_past_end=(status.EXTENDED, status.EXT_WRONG_SIZE))


def _place(address: ExtendedAddress) -> Address:
    kind = BY_SECTION.get(address.section)
    if kind is None:
        number = address.section
        raise AddressRefusal(
            status.EXT_ILLEGAL_FIELD if number > _LAST_SECTION else status.EXT_BAD_ADDRESS,
            f'section {number} is not known')
    if kind.is_structure:
        return Address(ADDRESSING, kind, address.file, address.structure, address.word)
    return Address(ADDRESSING, kind, address.file, address.word)


def _read_file_address(reader: Reader) -> ExtendedAddress:
    """Take an address off ``reader`` that has to be a file, not a word in it."""
    address = ExtendedAddress.read(reader)
    if address.structure or address.word:
        raise AddressRefusal(status.EXT_BAD_ADDRESS,
                             'a file read begins at the first word of a file')
    return address


def _compatibility_file(source: int) -> Window:
    return Window(Address(ADDRESSING, FileType.INPUT, source, 0))
