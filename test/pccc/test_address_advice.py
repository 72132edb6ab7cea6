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

"""What is said to those who write an address in another way than these commands need it."""

from abdf1_ros.pccc.address import AddressSyntaxError
from abdf1_ros.pccc.address_advice import advice
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
import pytest
from support.cases import for_all

SLC, PLC5 = PlcType.SLC, PlcType.PLC5


@for_all(('text', 'family', 'expected'), [
    ('I:1.0/3', PLC5, 'this is the form of an SLC; a PLC-5 has rack, group and bit in octal, as '
                      'in I:017/12'),
    ('O:2.0', PLC5, 'this is the form of an SLC; a PLC-5 has rack, group and bit in octal, as in '
                    'I:017/12'),
    ('I:017/12', SLC, 'this is the octal form of a PLC-5; an SLC has slot, word and bit, as in '
                      'I:1.0/3'),
    ('o:001', SLC, 'this is the octal form of a PLC-5; an SLC has slot, word and bit, as in '
                   'O:1.0/3'),
    ('B3:0.5', SLC, 'a bit stands after "/"; write B3:0/5'),
    ('n7:12.03', PLC5, 'a bit stands after "/"; write N7:12/3'),
    ('N7:0{10}', SLC, 'write N7:0, and Length 10'),
    ('N7:0[10]', SLC, 'write N7:0, and Length 10'),
    ('N7:0,L10', PLC5, 'write N7:0, and Length 10'),
    ('N7:0, 10', PLC5, 'write N7:0, and Length 10'),
    ('N7:0-9', SLC, 'write N7:0, and Length 10'),
    ('N7:5-N7:9', SLC, 'write N7:5, and Length 5'),
    ('T4:0.ACC{3}', SLC, 'write T4:0.ACC, and Length 3'),
    ('N7:O', SLC, 'that is the letter O where a digit should be; write N7:0'),
    ('N1O:1O', PLC5, 'that is the letter O where a digit should be; write N10:10'),
    ('B3:0/O', PLC5, 'that is the letter O where a digit should be; write B3:0/0'),
    ('O:OO1/O0', PLC5, 'that is the letter O where a digit should be; write O:001/00'),
    ('T4:O.ACC', SLC, 'that is the letter O where a digit should be; write T4:0.ACC'),
    ('RTC:0.HR', SLC, 'RTC is a function file whose type code is not known (the clock is S:37 to '
                      'S:42); let the program copy what is needed into an N file'),
    ('CS0:4', SLC, 'CS is a function file whose type code is not known; let the program copy what '
                   'is needed into an N file'),
])
def test_other_forms_are_told_what_to_write(text: str, family: PlcType, expected: str) -> None:
    with pytest.raises(AddressSyntaxError) as fault:
        parse_address(text, family)
    assert str(fault.value) == expected


@pytest.mark.parametrize(('text', 'family'), [
    ('N7:0', SLC), ('O:1.0/3', SLC), ('I:17/12', SLC), ('O:017/12', PLC5), ('O:0', PLC5),
    ('R6:0.POS', SLC), ('C5:0/OV', PLC5), ('T4:0.2', PLC5), ('T4:0.0/DN', SLC), ('S:1/5', SLC),
    ('B3/21', SLC), ('L10:0', SLC), ('#N7:0', PLC5)])
def test_what_is_written_well_gets_no_advice(text: str, family: PlcType) -> None:
    assert advice(text) is None
    parse_address(text, family)


@pytest.mark.parametrize('text', ['N7:9-0', 'T4:0.FOO', 'N7:0{0}', 'B3:0.16', 'XYZ:0', 'N7:0 10'])
def test_what_nobody_can_mean_is_left_to_the_grammar(text: str) -> None:
    assert advice(text) is None
    with pytest.raises(AddressSyntaxError):
        parse_address(text, SLC)


@pytest.mark.parametrize('family', [PlcType.PLC2, PlcType.PLC3])
def test_families_with_forms_of_their_own_are_not_looked_at(family: PlcType) -> None:
    with pytest.raises(AddressSyntaxError, match='^(?!.*and Length 10)'):
        parse_address('N7:0-9', family)
