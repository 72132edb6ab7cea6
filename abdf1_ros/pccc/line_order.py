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
The order of words in word range commands, where it is not that of the addresses.

Such commands move words as a PLC-5 stores them: the high word of a float comes first (M 13-17).
Everywhere else in this package, as in typed commands, the low word does.
"""

from __future__ import annotations

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.file_types import FileType

_WITH_FLOATS = (FileType.FLOAT, FileType.PID)


def word_on_line(address: Address) -> Address:
    """Return which of our words is the one that the line has at ``address``."""
    return address.at_offset(address.offset + _step(address))


def in_line_order(address: Address, data: bytes) -> bytes:
    """Return whole values from ``address`` on in the line's order, or from it in ours."""
    if address.file_type not in _WITH_FLOATS:
        return data
    words = [data[at:at + 2] for at in range(0, len(data), 2)]
    places = (address.at_offset(address.offset + n) for n in range(len(words)))
    return b''.join(words[n + _step(place)] for n, place in enumerate(places))


def _step(address: Address) -> int:
    """Return 1 for the first word of a float, -1 for the second, 0 for any other word."""
    if address.file_type is FileType.FLOAT:
        return -1 if address.word else 1
    if address.file_type is FileType.PID:
        return {2: 1, 0: -1}.get(address.layout.value_words(address.word), 0)
    return 0
