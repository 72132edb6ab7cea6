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

"""Ranges: what each form of an address means, and that each advice reads back as what it says."""

import re

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
import pytest
from support.cases import for_all
from support.mappings import fault, one

SLC, PLC5, PLC2, PLC3 = 'SLC', 'PLC5', 'PLC2', 'PLC3'


@for_all(('family', 'text', 'first', 'length', 'last'), [
    (SLC, 'N7:0-9', 'N7:0', 10, 'N7:9'), (SLC, 'N7:0 - N7:9', 'N7:0', 10, 'N7:9'),
    (SLC, 'n7:0..9', 'N7:0', 10, 'N7:9'), (SLC, 'N7:0...N7:9', 'N7:0', 10, 'N7:9'),
    (SLC, 'N7:5 to N7:9', 'N7:5', 5, 'N7:9'), (SLC, 'N7:5-5', 'N7:5', 1, 'N7:5'),
    (SLC, 'B3:1/0-7', 'B3:1/0', 8, 'B3:1/7'), (SLC, 'B3:1/8-15', 'B3:1/8', 8, 'B3:1/15'),
    (SLC, 'B3:1/0-B3:1/3', 'B3:1/0', 4, 'B3:1/3'), (SLC, 'B3:5/0-3', 'B3:5/0', 4, 'B3:5/3'),
    (SLC, 'N7:3/0-3', 'N7:3/0', 4, 'N7:3/3'), (SLC, 'B3/0-7', 'B3:0/0', 8, 'B3:0/7'),
    (SLC, 'B3/24-35', 'B3:1/8', 12, 'B3:2/3'), (SLC, 'T4:0/DN-T4:0/EN', 'T4:0/DN', 3, 'T4:0/EN'),
    (SLC, 'T4:0-3', 'T4:0', 12, 'T4:3.ACC'), (SLC, 'T4:2-2', 'T4:2', 3, 'T4:2.ACC'),
    (SLC, 'T4:0.PRE-T4:0.ACC', 'T4:0.PRE', 2, 'T4:0.ACC'), (SLC, 'F8:0-3', 'F8:0', 4, 'F8:3'),
    (SLC, 'L9:1-2', 'L9:1', 2, 'L9:2'), (SLC, 'S:37-42', 'S2:37', 6, 'S2:42'),
    (SLC, 'I:1.0/0-7', 'I:1.0/0', 8, 'I:1.0/7'), (SLC, 'I:1.0-3', 'I:1.0', 4, 'I:1.3'),
    (SLC, 'ST9:0-ST9:0', 'ST9:0', 1, 'ST9:0'),
    (PLC5, 'I:001/00-17', 'I:001/00', 16, 'I:001/17'), (PLC5, 'I:000-017', 'I:000', 16, 'I:017'),
    (PLC5, 'O:001-O:003', 'O:001', 3, 'O:003'), (PLC5, 'N7:90-999', 'N7:90', 910, 'N7:999'),
    (PLC5, 'PD10:0.SP-PD10:0.DB', 'PD10:0.SP', 8, 'PD10:0.DB'),
    (PLC2, '020-027', '020', 8, '027'), (PLC2, '110/00-17', '110/00', 16, '110/17'),
    (PLC2, '11000-11017', '110/00', 16, '110/17'),
    (PLC3, 'N7:0-9', 'N7:0', 10, 'N7:9'), (PLC3, 'B10:5/00-17', 'B10:5/00', 16, 'B10:5/17'),
    (PLC3, 'I:0000-0017', 'I:0000', 16, 'I:0017'),
    (PLC3, 'T:4.PRE-T:4.ACC', 'T:4.PRE', 2, 'T:4.ACC'),
    (PLC3, 'E3.1.8.10.0.5-E3.1.8.10.0.9', 'B10:5', 5, 'B10:9')])
def test_range_has_both_ends_in_the_counting_of_its_file(
        family: str, text: str, first: str, length: int, last: str) -> None:
    row = one(Address=text, PLC_Type=family, Command='Read')
    assert (str(row.address), row.length, str(row.place_of(length - 1))) == (first, length, last)
    assert one(Address=text, PLC_Type=family, Command='Read', Length=str(length)).length == length
    # The Length with which the same is written without a range.
    plain = one(Address=first, PLC_Type=family, Command='Read', Length=str(length))
    assert (plain.address, plain.codec) == (row.address, row.codec)


@for_all(('kind', 'length'), [('int32', 5), ('float32', 5), ('uint16', 10), ('string', 10)])
def test_length_of_a_range_counts_values_of_the_type(kind: str, length: int) -> None:
    row = one(Address='N7:0-9', Type=kind)
    assert (row.length, row.codec.words) == (length, 10)


@for_all(('family', 'text', 'words'), [
    (SLC, 'N7:9-0', ['N7:0-N7:9']), (SLC, 'B3:1/7-0', ['B3:1/0-B3:1/7']),
    (SLC, 'T4:3-0', ['T4:0-T4:3']), (SLC, 'C5:0.ACC-C5:0.PRE', ['C5:0.PRE-C5:0.ACC']),
    (SLC, 'B3:1/8-B3:2/3', ['B3:1/8, and Length 12']),
    (SLC, 'I:1.0/0-I:1.1/15', ['I:1.0/0, and Length 32']),
    (PLC5, 'I:001/10-I:002/07', ['I:001/10, and Length 16']),
    (SLC, 'N7:0{10}', ['N7:0, and Length 10']), (SLC, 'N7:10 [10]', ['N7:10, and Length 10']),
    (PLC5, 'N7:0,L10', ['N7:0, and Length 10']), (SLC, 'N7:0, 10', ['N7:0, and Length 10']),
    (SLC, 'N7:0 L10', ['N7:0, and Length 10']), (SLC, 'T4:0[4]', ['T4:0, and Length 12']),
    (SLC, 'B3:1/8{16}', ['B3:1/8, and Length 16']), (PLC3, 'N7:0{3}', ['N7:0, and Length 3']),
    (PLC5, 'I:001/00{16}', ['I:001/00, and Length 16']),
    (SLC, 'T4:0.ACC-T4:2.ACC', ['T4:0.ACC', 'T4:1.ACC', 'T4:2.ACC', 'T4:0-T4:2']),
    (SLC, 'T4:0.ACC{3}', ['T4:0.ACC', 'T4:1.ACC', 'T4:2.ACC', 'T4:0-T4:2']),
    (SLC, 'ST9:0-2', ['ST9:0', 'ST9:1', 'ST9:2']), (SLC, 'ST9:0{2}', ['ST9:0', 'ST9:1']),
    (SLC, 'I:1-3', ['I:1.0', 'I:2.0', 'I:3.0']),
    (SLC, 'I:1.0/3-I:2.0/3', ['I:1.0/3', 'I:2.0/3']),
    (SLC, 'N7:O-9', ['N7:0-9']), (SLC, 'B3:1.0-7', ['B3:1/0-7']),
    (SLC, 'B3:1.0-B3:1.7', ['B3:1/0-B3:1/7']), (SLC, 'N7:O', ['N7:0']), (PLC2, 'O20-O27', []),
    (SLC, 'N7:0-N10:9', []), (SLC, 'N7:0-N7:1/3', []), (SLC, 'T4:0.ACC-3', []),
    (SLC, 'T4:0.PRE/0-T4:0.ACC/3', []), (SLC, 'N7:0-', []), (SLC, 'N7:0-3-5', []),
    (SLC, 'N7:0-300', []), (SLC, 'N7:0{300}', []), (SLC, 'N7:0{0}', []), (SLC, 'N7:9-N7:O', []),
    (SLC, 'I:001/00-17', []), (PLC5, 'I:001/00-18', []), (PLC2, '018-020', []),
    (PLC2, '11000-17', []), (PLC3, 'T:4-7', [])])
def test_advice_about_a_range_is_read_as_what_it_says(
        family: str, text: str, words: list[str]) -> None:
    told = fault(Address=f'"{text}"', PLC_Type=family, Command='Read')
    assert told.startswith('2:3 (Address): 250')
    advised = re.search(r'(?:write|row:|for) (\S+:.*|\d.*)$', told)
    # An octal number of another family is only an example.
    found = re.split(', (?:or the whole elements with )?(?!and)', advised[1]) \
        if advised and ' as in ' not in told else []
    assert found == words
    for right in found:
        address, _, length = right.partition(', and Length ')
        assert one(Address=address, PLC_Type=family, Command='Read', Length=length)


def test_length_beside_a_range_agrees_with_it() -> None:
    for length in (9, 11):
        assert fault(Address='N7:0-9', Length=str(length)) == (
            f'2:6 (Length): Item: 1, N7:0-9 has Length 10, not {length}')
    assert fault(Address='N7:0-8', Type='int32') == (
        '2:3 (Address): 2503 ERR_ADDRESS_SYNTAX: Item: 1, Invalid Address Syntax (N7:0-8); '
        'N7:0-N7:8 are 9 words, and a int32 takes 2')
    assert fault(Address='N7:0-1', Command='Heartbeat') == (
        '2:3 (Address): Item: 1, a heartbeat is one word')


def test_range_where_one_address_is_meant_is_told_with_its_length() -> None:
    with pytest.raises(FormatError, match='^write T4:0, and Length 12$'):
        parse_address('T4:0-3', PlcType.SLC)
