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
What every exchange has in it: addresses, the values before, and the values that are written.

Words of T, C and R are control word, PRE or LEN, ACC or POS, as they lie in the PLC. Some values
have bytes 10 (DLE) in them, because those are doubled on the line.
"""

from __future__ import annotations

from dataclasses import dataclass

Values = list[float] | str


@dataclass(frozen=True, slots=True)
class Case:
    """An address, what stands there, and what is written there; both have the same length."""

    address: str
    before: Values
    after: Values

    @property
    def count(self) -> int:
        """Return the elements: of a string 1, of a timer, counter or control its words."""
        return 1 if isinstance(self.before, str) else len(self.before)

    @property
    def is_structure(self) -> bool:
        """Tell whether this is a whole element of three words."""
        return self.address[0] in 'TCR' and '.' not in self.address


CASES = (
    Case('N7:0', [1, -2, 32767, -32768], [-1, 2, -32768, 32767]),
    Case('N7:20', [0x1010, 0x0310, 0x1003, 16], [0x0610, 0x1006, 0x1010, 4112]),
    Case('N7:30', [5], [4112]),
    Case('B3:0', [0x8001, 0x1010], [0x7FFE, 0x0110]),
    Case('B3:4/5', [0], [1]),
    Case('N7:40/3', [0], [1]),
    Case('F8:0', [1.5, -2.25], [1e10, -0.0625]),
    Case('F8:6', [3.5], [-16.0]),
    Case('T4:1', [0x2200, 500, 120], [0x8000, 900, 16]),
    Case('T4:2.ACC', [120], [4112]),
    Case('C5:1', [0x8000, 10, -3], [0x2000, 16, 4112]),
    Case('C5:2.PRE', [-17], [272]),
    Case('R6:1', [0x0200, 8, 3], [0x8000, 16, 5]),
    Case('ST9:1', 'Tank 4', 'a\x10b'),
    Case('S:10', [7], [16]),
)

# Those that an EtherNet/IP client has more, by family. In an SLC slot 1 is the only one with
# inputs, and slot 2 the only one with outputs: some clients count the words of the whole image.
ETHERNET_CASES = {
    'SLC': (
        Case('I:1', [0x1010, 5], [4112, -2]),
        Case('O:2', [-3, 16], [0x0310, 1]),
        Case('L10:0', [0x10101010, -0x80000000], [0x7FFFFFFF, -70000]),
        Case('L10:5', [123456789], [-0x10101011]),
    ),
    'PLC5': (
        Case('I:017', [0x1010], [4112]),
        Case('O:003', [-3, 16], [0x0310, 1]),
    ),
}

# Those of ab_server, whose files have these numbers.
AB_SERVER_CASES = (
    *(case for case in CASES if case.address in ('N7:0', 'N7:20', 'F8:0')),
    Case('L19:2', [0x10101010, -0x80000000], [0x7FFFFFFF, -70000]),
    Case('ST18:1', 'Tank 4', 'a\x10b'),
)


def same(expected: Values, got: object) -> bool:
    """Tell whether values are the same; a word may come signed or not, a long is signed."""
    if isinstance(expected, str):
        return got == expected
    if not isinstance(got, list) or len(got) != len(expected):
        return False
    if all(isinstance(value, int) for value in expected):
        return [*map(_unsigned, got)] == [*map(_unsigned, expected)]
    return got == expected


def _unsigned(value: float) -> float:
    return int(value) & 0xFFFF if -0x8000 <= value <= 0xFFFF else value
