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

"""The words of a PLC that a reply to another node's command has."""

from __future__ import annotations

from collections.abc import Sequence

from abdf1_ros.df1.packet import Packet, PRIORITY_BIT
from abdf1_ros.driver.guest_words import NotedTable, uses_common_file
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.address import Address, Area
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.plc5 import commands as plc5
from abdf1_ros.pccc.server import Server
from abdf1_ros.pccc.typed_data import TypedData
from abdf1_ros.settings.mapping import Mapping

ReplyWords = dict[tuple[Area, int], bytes]
"""Words by area and offset."""

# A word of the coded table has its number in both bytes: the low byte from 80 to BF, the high byte
# from C0 to FF. So no code can be found across two words, nor in a descriptor.
_DIGIT = 64


class _CodedTable(NotedTable):
    """A table that returns a different code for each word."""

    def __init__(self, plc_type: PlcType, rows: Sequence[Mapping]) -> None:
        super().__init__(plc_type, rows)
        self.places: list[Address] = []

    def read(self, address: Address, words: int) -> bytes:
        """Return codes for words, and note their places."""
        first = len(self.places)
        if first + words > _DIGIT**2:
            raise FormatError('more words than there are codes')
        self.places += (address.at_offset(address.offset + n) for n in range(words))
        return b''.join(map(_code, range(first, first + words)))


def _code(number: int) -> bytes:
    high, low = divmod(number, _DIGIT)
    return bytes((0x80 + low, 0xC0 + high))


def words_in_reply(command: Packet, reply: Packet, rows: Sequence[Mapping]) -> ReplyWords:
    """
    Return the words of files of ``rows`` that a good reply has; none if unknown.

    The rows have one PLC type of the station. A server of the family executes the command. Where
    its reply has the code of a word, the heard reply has the value of this word.
    """
    if uses_common_file(command, rows):
        return {}
    table = _CodedTable(rows[0].plc_type, rows)
    expected = Server(table).serve(command)
    if expected.sts or expected.cmd != reply.cmd or not table.places:
        return {}
    try:
        data = _same_form(command, reply.data)
    except FormatError:
        return {}
    places = {at: place for number, place in enumerate(table.places)
              if (at := expected.data.find(_code(number))) >= 0}
    begin = min(places, default=0)
    if len(data) != len(expected.data) or data[:begin] != expected.data[:begin]:
        return {}
    return {(place.area, place.offset): data[at:at + 2] for at, place in places.items()}


def _same_form(command: Packet, data: bytes) -> bytes:
    """Return the data of a reply; a typed read gets the descriptors of our server."""
    code = command.cmd & ~PRIORITY_BIT, *command.data[:1]
    return TypedData.decode(data).encode() if code == (plc5.CMD, plc5.TYPED_READ) else data
