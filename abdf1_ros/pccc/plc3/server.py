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

"""What a PLC-3 answers to commands (M 8-6..8-10)."""

from __future__ import annotations

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc import status
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.family import Codes
from abdf1_ros.pccc.fields import Reader
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.plc2.server import BasicService, Window
from abdf1_ros.pccc.plc3 import address as plc3_address
from abdf1_ros.pccc.plc3.commands import ExtendedAddress
from abdf1_ros.pccc.word_range import commands as word_range
from abdf1_ros.pccc.word_range.server import WordRangeService


class Plc3Commands:
    """
    The commands a PLC-3 serves.

    A PLC-2 command works on the input file whose number is the station it comes from.
    """

    no_such_file: Codes = status.STS_ADDRESS, None
    out_of_range: Codes = status.STS_ADDRESS, None

    def __init__(self, table: DataTable) -> None:
        words = WordRangeService(table, ExtendedAddress.read, _place,
                                 bad_size=(status.STS_ILLEGAL_COMMAND, None),
                                 too_long=self.out_of_range)
        files = WordRangeService(table, _read_file_address, _place,
                                 bad_size=(status.STS_ILLEGAL_COMMAND, None),
                                 too_long=self.out_of_range)
        self.commands = words.commands() | {
            (word_range.CMD, word_range.FILE_READ): files.read}
        self.basic_commands = BasicService(table, _compatibility_file).everything()


def _place(address: ExtendedAddress) -> Address:
    kind = plc3_address.BY_SECTION.get(address.section)
    if kind is None:
        raise FormatError(f'section {address.section} is not known')
    if kind.is_structure:
        return Address(PlcType.PLC3, kind, address.file, address.structure, address.word)
    return Address(PlcType.PLC3, kind, address.file, address.word)


def _read_file_address(reader: Reader) -> ExtendedAddress:
    """Take an address off ``reader`` that has to be a file, not a word in it."""
    address = ExtendedAddress.read(reader)
    if address.structure or address.word:
        raise FormatError('a file read begins at the first word of a file')
    return address


def _compatibility_file(source: int) -> Window:
    return Window(Address(PlcType.PLC3, FileType.INPUT, source, 0))
