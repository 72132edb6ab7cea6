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
Rows whose cells do not fit the words of their Tag and Description.

A Length of words where bits were meant, a forgotten Length, a Max in another unit, a Fallback that
goes on requesting: such rows are valid, and only a person can say what was meant.
"""

from __future__ import annotations

from collections.abc import Iterator
import math
import re

from abdf1_ros.pccc.address import BITS
from abdf1_ros.pccc.file_types import FileType
from abdf1_ros.problems import Problem
from abdf1_ros.settings.csv_table import Row
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.text import shown

# "12 bits" or "4 values", and the end of "0 to 100" or "0-1500 rpm", in a Description.
_COUNTED = re.compile(r'\b(\d{1,4}) (bit|word|value|element)s?\b', re.IGNORECASE)
_SPAN = re.compile(r'(?<![\w.:/])(?:0|-\d+)(?:\.\d+)?\s*(?:-|to|\.\.+|–)\s*(\d+(?:\.\d+)?)'
                   r'(?![\w.:/-])', re.IGNORECASE)
_PERCENT = 100.0
_REQUEST = re.compile(r'(?<![a-z])(?:req|request|cmd|command|start|run|enable|go|move|jog)'
                      r'(?![a-z])', re.IGNORECASE)


def described_otherwise(row: Row, mapping: Mapping) -> Iterator[Problem]:
    """Yield remarks on cells that do not fit what Tag and Description say."""
    text, length, address = mapping.description, mapping.length, mapping.address
    if address.file_type is FileType.BINARY and address.bit is None and row.get('Length') \
            and not row.get('Type') and 1 < length <= BITS:
        yield Problem(row.where('Length'), (
            f'Length {length} from {address} on is {length} words; {length} bits are {address}/0 '
            f'with Length {length}. If words are meant, say so with Type {mapping.type.value}'))
    counted = _COUNTED.search(text)
    if counted and not _fits(int(counted[1]), counted[2].lower() == 'bit', mapping):
        yield Problem(row.where('Length'), f'Length is {length}, and the Description says '
                                           f'"{shown(counted[0])}"')
    if not mapping.writes:
        return
    if mapping.fallback and any(mapping.fallback.values) \
            and _REQUEST.search(f'{mapping.tag} {text}'):
        yield Problem(row.where('Fallback'), (
            'by its name this row requests something; after the last message its Fallback goes on '
            'requesting, and 0 would not'))
    ends = [*map(float, _SPAN.findall(text)), *[_PERCENT] * ('[%]' in text)]
    if ends and max(ends) < mapping.maximum < math.inf:
        yield Problem(row.where('Max'), (
            f'Max {mapping.maximum:.10g} is in the unit of the topic, where the Description ends '
            f'at {max(ends):.10g}'))


def _fits(count: int, counts_bits: bool, mapping: Mapping) -> bool:
    """Tell whether a mapping has ``count`` bits, or ``count`` values or words."""
    words = mapping.length * mapping.type.words
    if counts_bits:
        return count <= words * BITS if words else count == mapping.length
    return count in (mapping.length, words)
