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

"""Which words of a PLC a guest's command writes, as far as its address can be read."""

from __future__ import annotations

from collections.abc import Iterable
import re

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.describe import describe
from abdf1_ros.pccc.extent import Extent
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType

# The addresses in what people are told of a command.
_ADDRESS = re.compile(r'\b[A-Z]{1,2}\d*:[\w.:/]+')
_TWO_WORDS = (FileType.FLOAT, FileType.LONG)


def written_extents(command: Packet, station: int, families: Iterable[PlcType]) -> list[Extent]:
    """Return the words that a command writes, by the addresses of ``families``; or none."""
    text = describe(command)
    values = max(1, len(text.partition('=')[2].split()))
    found = []
    for family in families:
        for word in _ADDRESS.findall(text):
            try:
                address = parse_address(word, family)
            except FormatError:
                continue
            size = values * (2 if address.file_type in _TWO_WORDS else 1)
            found.append(Extent(station, address.area, address.offset, address.offset + size))
    return found
