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

"""Addresses: the grammar, ranges, where words lie, and advice for other forms."""

import re

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.address import Address, AddressRangeError, AddressSyntaxError, Area
from abdf1_ros.pccc.families import FAMILIES, parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
import pytest
from support.cases import for_all

PLC5, SLC = PlcType.PLC5, PlcType.SLC
BOTH = (PLC5, SLC)


@for_all('family', BOTH)
@for_all(('text', 'kind', 'file', 'element', 'word', 'bit'), [
    ('N7:0', 'N', 7, 0, 0, None), ('N:12', 'N', 7, 12, 0, None), ('N9;5', 'N', 9, 5, 0, None),
    ('n7:30/3', 'N', 7, 30, 0, 3), (' N7:1 ', 'N', 7, 1, 0, None), ('#N7:0', 'N', 7, 0, 0, None),
    ('$N10:255', 'N', 10, 255, 0, None), ('B3:1/5', 'B', 3, 1, 0, 5), ('B3/17', 'B', 3, 1, 0, 1),
    ('B/0', 'B', 3, 0, 0, 0), ('B10/4095', 'B', 10, 255, 0, 15), ('S:1/15', 'S', 2, 1, 0, 15),
    ('S2:4', 'S', 2, 4, 0, None), ('F8:9', 'F', 8, 9, 0, None), ('ST9:0', 'ST', 9, 0, 0, None),
    ('T4:0', 'T', 4, 0, 0, None), ('T4:0.ACC', 'T', 4, 0, 2, None),
    ('T4:0.PRE', 'T', 4, 0, 1, None), ('T4:0.DN', 'T', 4, 0, 0, 13),
    ('T4:0/DN', 'T', 4, 0, 0, 13), ('T4:0/EN', 'T', 4, 0, 0, 15), ('T4:0.2', 'T', 4, 0, 2, None),
    ('T4:0.1/3', 'T', 4, 0, 1, 3), ('T4:0.0/DN', 'T', 4, 0, 0, 13), ('t:3/tt', 'T', 4, 3, 0, 14),
    ('T4:0.ACC/7', 'T', 4, 0, 2, 7), ('C5:2.PRE', 'C', 5, 2, 1, None),
    ('C5:2/CU', 'C', 5, 2, 0, 15), ('R6:0.LEN', 'R', 6, 0, 1, None),
    ('R6:0/FD', 'R', 6, 0, 0, 8), ('A12:3', 'A', 12, 3, 0, None), ('D13:3/15', 'D', 13, 3, 0, 15)])
def test_address_has_the_parts_that_its_text_names(
        family: PlcType, text: str, kind: str, file: int, element: int, word: int,
        bit: int | None) -> None:
    assert parse_address(text, family) == Address(
        FAMILIES[family].addressing, FileType(kind), file, element, word, bit)


@for_all(('family', 'text', 'file', 'element', 'word', 'bit'), [
    # Octal words and bits.
    (PLC5, 'I:017/12', 1, 0o17, 0, 0o12), (PLC5, 'O:0', 0, 0, 0, None),
    (PLC5, 'I:277/17', 1, 0o277, 0, 15), (PLC5, 'O0:012', 0, 0o12, 0, None),
    (PLC5, 'I1:007/07', 1, 7, 0, 7),
    # Slot, word and bit.
    (SLC, 'I:1.0/3', 1, 1, 0, 3), (SLC, 'I:1/3', 1, 1, 0, 3), (SLC, 'O:30.255/15', 0, 30, 255, 15),
    (SLC, 'I1:8.2', 1, 8, 2, None), (SLC, 'O:2', 0, 2, 0, None)])
def test_inputs_and_outputs_are_numbered_as_in_their_family(
        family: PlcType, text: str, file: int, element: int, word: int, bit: int | None) -> None:
    address = parse_address(text, family)
    assert (address.file, address.element, address.word, address.bit) == (file, element, word, bit)
    slot, offset = (element, word) if family == SLC else (None, element)
    assert address.area == Area(family, address.file_type, file, slot)
    assert address.offset == offset


@for_all('family', BOTH)
@for_all('text', [
    '', ' ', 'N', 'N7', 'N7:', ':0', '7:0', 'X7:0', 'NN7:0', 'N7:0:1', 'N7:0/', 'N7:0.', 'N7:-1',
    'N7:0 /1', 'N7:0.1', 'N7:0.ACC', 'N7:0/DN', 'S/3', 'F8/3', 'T4/3', 'B3/DN', 'F8:0/1', 'L:0',
    'ST:0', 'A:0', 'D:0', 'ST9:0/1', 'T4:0.XYZ', 'T4:0/XYZ', 'T4:0.DN/3', 'T4:0.ACC/DN',
    'T4:0.LEN', 'R6:0.ACC', 'ST9:0.1', 'X9:0', '%N7:0', 'N7:0\n1', '##N7:0',
    'T4:0.2/DN', 'T4:0.1/PRE', 'T4:0.2/PRE', 'C5:0.1/CU', 'R6:0.2/EN', 'T4:0.PRE/ACC',
    'T4:0.EN/DN', 'N7:\u0663', 'I:\u0668', 'I:1/\u0668', 'N\u0667:0'])
def test_what_is_no_address(family: PlcType, text: str) -> None:
    with pytest.raises(AddressSyntaxError):
        parse_address(text, family)


@for_all(('family', 'last', 'beyond'), [
    (PLC5, 'N999:1999', 'N999:2000'), (SLC, 'N255:255', 'N255:256'),
    (SLC, 'N255:0', 'N256:0'), (PLC5, 'S:127', 'S:128'), (PLC5, 'ST9:779', 'ST9:780'),
    (PLC5, 'PD9:398', 'PD9:399'), (PLC5, 'MG9:584', 'MG9:585'),
    (SLC, 'PD9:255', 'PD9:256'), (SLC, 'PD9:0.22', 'PD9:0.23'), (SLC, 'MG9:0.24', 'MG9:0.25'),
    (PLC5, 'PD9:0.80', 'PD9:0.82'), (PLC5, 'MG9:0.55', 'MG9:0.56'),
    (PLC5, 'BT9:1999.5', 'BT9:0.6'),
    (PLC5, 'I:277', 'I:300'), (PLC5, 'O:277', 'O:300'), (PLC5, 'I:277/17', 'I:277/20'),
    (SLC, 'I:30', 'I:31'), (SLC, 'O:30', 'O:31'),
    (SLC, 'I:0.255', 'I:0.256'), (PLC5, 'B3/31999', 'B3/32000'), (SLC, 'B3/4095', 'B3/4096'),
    (SLC, 'I1:0', 'I2:0'), (PLC5, 'O0:0', 'O1:0'), (PLC5, 'N3:0', 'N2:0'),
    (SLC, 'T255:255.ACC', 'T256:0.ACC'), (SLC, 'HSC0:0', 'HSC3:0'),
    *((family, last, beyond) for family in BOTH for last, beyond in (
        ('N7:0/15', 'N7:0/16'), ('B3:0/15', 'B3:0/16'), ('B3:0', 'B0:0'), ('S2:0', 'S3:0'),
        ('T4:0.2', 'T4:0.3'), ('T4:0', 'T1:0'), ('N7/0', 'N7/32000'), ('N7:0', 'N1234567:0'))),
    # As many as a recorded MicroLogix 1400 has.
    *((SLC, f'{kind}:{last}', f'{kind}:{last + 1}') for kind, last in (
        ('HSC', 5), ('PTO', 2), ('PWM', 2), ('STI', 0), ('EII', 7)))])
def test_last_and_first_beyond(family: PlcType, last: str, beyond: str) -> None:
    parse_address(last, family)
    with pytest.raises(AddressRangeError):
        parse_address(beyond, family)


@for_all(('family', 'text', 'told'), [
    (SLC, 'B3/4096', 'bits of B3 run from 0 to 4095'),
    (PLC5, 'b10/32000', 'bits of B10 run from 0 to 31999'),
    *((family, 'S13:0', 'the S file is file 2; for a string write ST13:0') for family in BOTH)])
def test_number_beyond_is_told_with_what_there_is(family: PlcType, text: str, told: str) -> None:
    with pytest.raises(AddressRangeError, match=f'^{told}$'):
        parse_address(text, family)


@for_all(('text', 'family', 'shown'), [
    ('b/17', SLC, 'B3:1/1'), ('i:17/2', PLC5, 'I:017/02'), ('o:3', SLC, 'O:3.0'),
    ('I:3/3', SLC, 'I:3.0/3'), ('T4:1.2', SLC, 'T4:1.ACC'), ('T4:1/13', SLC, 'T4:1/DN'),
    ('T4:1.0/2', SLC, 'T4:1.0/2'), ('T4:1/13', PLC5, 'T4:1/DN'), ('N7/20', SLC, 'N7:1/4'),
    ('A10/20', PLC5, 'A10:1/4'), ('D10/20', SLC, 'D10:1/4'), ('T4:1.con', SLC, 'T4:1'),
    ('T4:1.1/3', SLC, 'T4:1.1/3'),
    ('#N7;3', PLC5, 'N7:3'), ('S:1', PLC5, 'S2:1')])
def test_str_is_the_plain_form(text: str, family: PlcType, shown: str) -> None:
    assert str(parse_address(text, family)) == shown


@for_all(('text', 'family', 'advice'), [
    ('S/26', SLC, 'the word of the status file comes first; write S:1/10'),
    (' s2/15 ', PLC5, 'the word of the status file comes first; write S:0/15'),
    ('N11[12]', SLC, 'an element stands after ":"; write N11:12'),
    ('I/3', SLC, 'write the word too, as in I:1/3'),
    ('O/5', PLC5, 'write the word too, as in O:017/12'),
    ('M0:1.0', SLC, 'M files (words of an I/O module, which COP brings into an N file)')])
def test_what_other_programs_write_leads_to_what_is_right(
        text: str, family: PlcType, advice: str) -> None:
    with pytest.raises(AddressSyntaxError, match=re.escape(advice)):
        parse_address(text, family)
    if right := re.search(r'(?:write|as in) ([A-Z]\d*:[\d/]+)$', advice):
        parse_address(right[1], family)


@pytest.mark.parametrize('family', BOTH)
def test_every_member_has_its_name_in_text(family: PlcType) -> None:
    for kind in FAMILIES[family].file_types:
        for name, member in FAMILIES[family].layout(kind).members.items():
            if (member.word, member.bit) == (0, None):
                continue  # T4:1 is that already
            sign = '.' if member.bit is None else '/'
            place = f'{kind.value}:0' if kind.is_function else f'{kind.value}10:1'
            address = parse_address(f'{place}.{name}', family)
            assert (address.word, address.bit) == (member.word, member.bit)
            assert str(address) == f'{place}{sign}{name}'
            assert parse_address(str(address), family) == address


@for_all(('family', 'text', 'word', 'bit', 'shown'), [
    (PLC5, 'PD12:10.SP', 2, None, 'PD12:10.SP'), (PLC5, 'PD12:10.26', 26, None, 'PD12:10.PV'),
    (PLC5, 'PD10:0.50', 50, None, 'PD10:0.50'), (PLC5, 'PD10:0.81/3', 81, 3, 'PD10:0.81/3'),
    (PLC5, 'PD10:0/MO', 0, 1, 'PD10:0/MO'), (PLC5, 'PD10:0/INI', 1, 12, 'PD10:0/INI'),
    (PLC5, 'PD10:0.1/INI', 1, 12, 'PD10:0/INI'), (PLC5, 'PD10:0.1/12', 1, 12, 'PD10:0/INI'),
    (PLC5, 'MG9:2.DLEN', 3, None, 'MG9:2.DLEN'), (PLC5, 'MG9:2/5', 0, 5, 'MG9:2/DN'),
    (PLC5, 'BT11:0.RGS', 5, None, 'BT11:0.RGS'), (PLC5, 'bt11:0.to', 0, 8, 'BT11:0/TO'),
    (PLC5, 'SC13:0.TIM', 2, None, 'SC13:0.TIM'), (PLC5, 'SC13:4/FS', 0, 14, 'SC13:4/FS'),
    (SLC, 'PD10:0.SPS', 2, None, 'PD10:0.SPS'), (SLC, 'PD10:0.2', 2, None, 'PD10:0.SPS'),
    (SLC, 'PD10:0.22', 22, None, 'PD10:0.22'), (SLC, 'PD10:0/AM', 0, 1, 'PD10:0/AM'),
    (SLC, 'PD10:0.3/2', 3, 2, 'PD10:0.3/2'), (SLC, 'MG11:0/DN', 17, 13, 'MG11:0/DN'),
    (SLC, 'MG11:0.17/13', 17, 13, 'MG11:0/DN'), (SLC, 'MG11:0.ERR', 18, None, 'MG11:0.ERR'),
    (SLC, 'MG11:0.16/15', 16, 15, 'MG11:0.16/15')])
def test_members_of_large_structures(family: PlcType, text: str, word: int, bit: int | None,
                                     shown: str) -> None:
    address = parse_address(text, family)
    assert (address.word, address.bit, str(address)) == (word, bit, shown)


@for_all(('text', 'reason'), [
    ('PD10:0.3', 'word 3 is the second half of a float32; write the first, 2'),
    ('PD10:0.SP/3', 'PD10:0.SP is a float32, which has no bits to address'),
    ('PD10:0.2/3', 'PD10:0.SP is a float32, which has no bits to address'),
    ('PD10:0.2/EN', 'EN is not a member'), ('PD10:0.1/EN', 'EN is not a member'),
    ('PD10:0.SP/INI', 'INI is not a member'), ('PD10:0.SPS', 'SPS is not a member'),
    ('BT9:0.ACC', 'ACC is not a member'), ('PD:0', 'give the file number, as in PD9:0'),
    ('SC:0', 'give the file number'), ('I:019', 'PLC-5 I/O words are octal'),
    ('I:018', 'PLC-5 I/O words are octal'), ('I:017/9', 'PLC-5 I/O bits are octal, 0 to 17')])
def test_what_is_no_part_of_a_structure(text: str, reason: str) -> None:
    with pytest.raises(AddressSyntaxError, match=f'^{reason}'):
        parse_address(text, PLC5)


@for_all(('letters', 'family'), [('L', PLC5), ('BT', SLC), ('SC', SLC), ('X', PLC5), ('X', SLC)])
def test_letters_of_no_file_of_the_family(letters: str, family: PlcType) -> None:
    known = ', '.join(kind.value for kind in FAMILIES[family].file_types)
    title = 'PLC-5' if family == PLC5 else 'SLC'
    with pytest.raises(AddressSyntaxError, match=(
            f'^{title} has no {letters} files; file types: {known}$')):
        parse_address(f'{letters}9:0', family)


@for_all(('text', 'element', 'bit', 'shown'), [
    ('I:5', 5, None, 'I:5'), ('o:0/3', 0, 3, 'O:0/3'), ('I1:300/15', 300, 15, 'I:300/15'),
    ('I:7935', 7935, None, 'I:7935')])
def test_flat_io_counts_the_words_of_the_image(text: str, element: int, bit: int | None,
                                               shown: str) -> None:
    address = parse_address(text, SLC, Access.FLAT)
    assert (address.element, address.word, address.bit) == (element, 0, bit)
    assert address.is_flat
    assert (address.offset, address.area_size) == (element, 7936)
    assert str(address) == shown
    assert parse_address(shown, SLC, Access.FLAT) == address
    assert address.area != parse_address('I:0', SLC).area
    assert address.at_offset(9).offset == 9


def test_flat_io_has_no_words_of_slots() -> None:
    assert not parse_address('N7:1', SLC, Access.FLAT).is_flat
    with pytest.raises(AddressSyntaxError, match='^with access Flat write the word'):
        parse_address('I:1.0', SLC, Access.FLAT)
    with pytest.raises(AddressRangeError, match='^elements of I run from 0 to 7935$'):
        parse_address('I:7936', SLC, Access.FLAT)


@for_all(('text', 'family', 'offset', 'size'), [
    ('N7:5', SLC, 5, 256), ('N7:5', PLC5, 5, 2000), ('T4:2.ACC', SLC, 8, 768),
    ('F8:3', PLC5, 6, 4000), ('ST9:1', SLC, 42, 256 * 42), ('I:3.2', SLC, 2, 256),
    ('I:012', PLC5, 10, 192), ('S:1', PLC5, 1, 128), ('L9:2', SLC, 4, 512),
    ('PD9:2.SP', PLC5, 166, 399 * 82), ('PD9:2.SPS', SLC, 48, 256 * 23),
    ('BT9:1.RGS', PLC5, 11, 12000), ('MG9:1/TO', PLC5, 56, 585 * 56)])
def test_offset_counts_words(text: str, family: PlcType, offset: int, size: int) -> None:
    address = parse_address(text, family)
    assert (address.offset, address.area_size) == (offset, size)
    assert parse_address(str(address.last_of_area), family) == address.last_of_area


def test_at_offset_names_a_word_and_no_bit() -> None:
    assert parse_address('B3:0/5', SLC).at_offset(2) == parse_address('B3:2', SLC)
    assert parse_address('T4:0/DN', SLC).at_offset(4) == parse_address('T4:1.PRE', SLC)
    assert parse_address('O:2.0/5', SLC).at_offset(1) == parse_address('O:2.1', SLC)


@for_all('family', BOTH)
@for_all(('text', 'right'), [
    ('T4;0/2', 'bit 2 of a T element has no name; word 2 is T4:0.ACC; bits: EN, TT, DN'),
    ('C5:3/1', 'bit 1 of a C element has no name; word 1 is C5:3.PRE; '
               'bits: CU, CD, DN, OV, UN, UA'),
    ('R6:0/7', 'bit 7 of a R element has no name; bits: EN, EU, DN, EM, ER, UL, IN, FD')])
def test_number_after_a_timer_is_no_bit_unless_it_has_a_name(
        family: PlcType, text: str, right: str) -> None:
    """The specification's own form of a sub-element, T4;0/2, means word 2."""
    with pytest.raises(AddressSyntaxError) as caught:
        parse_address(text, family)
    assert str(caught.value) == right


@for_all(('text', 'family', 'expected'), [
    ('ST9:0.LEN', SLC, 'the length is part of the string; read ST9:0, which is as long as that'),
    *((f'ST9:3.{part}', SLC, 'a string is read and written as a whole; write ST9:3')
      for part in ('1', 'DATA', 'DATA[0]')),
    ('L10:0/5', SLC, 'bits of an L file have no address; read L10:0 as int32 and take bit 5 '
                     'from it'),
    ('CT20:0', PLC5, 'CT files (ControlNet transfer) cannot be read or written here; file types '
                     'of PLC-5: O, I, S, B, T, C, R, N, F, ST, A, D, PD, MG, BT, SC'),
    ('PLS9:0', SLC, 'PLS files (programmable limit switch) cannot be read or written here; file '
                    'types of SLC: O, I, S, B, T, C, R, N, F, ST, A, D, L, PD, MG, HSC, PTO, PWM, '
                    'STI, EII'),
    ('I:1.0/3', PLC5, 'this is the form of an SLC; a PLC-5 has rack, group and bit in octal, as '
                      'in I:017/12'),
    ('O:2.0', PLC5, 'this is the form of an SLC; a PLC-5 has rack, group and bit in octal, as in '
                    'I:017/12'),
    *((text, SLC, 'this is the octal form of a PLC-5 (PLC_Type PLC5); an SLC has slot, word and '
       f'bit, as in {text[0].upper()}:1.0/3') for text in (
           'I:017/12', 'o:001', 'I:008/00', 'I:010/18', 'O:099')),
    *((f'{file}:0.5', SLC, f'a bit stands after "/"; write {file}:0/5') for file in (
        'B3', 'S2', 'A9', 'D9')),
    ('n7:12.03', PLC5, 'a bit stands after "/"; write N7:12/3'),
    ('N7:0,', SLC, '"," after it is too much; write N7:0'),
    ('B3:1/5;', PLC5, '";" after it is too much; write B3:1/5'),
    ('N7:O', SLC, 'that is the letter O where a digit should be; write N7:0'),
    ('N1O:1O-2O', PLC5, 'that is the letter O where a digit should be; write N10:10-20'),
    ('B3:0/O', PLC5, 'that is the letter O where a digit should be; write B3:0/0'),
    ('O:OO1/O0-O7', PLC5, 'that is the letter O where a digit should be; write O:001/00-07'),
    ('T4:O.ACC', SLC, 'that is the letter O where a digit should be; write T4:0.ACC'),
    ('HSC:0.6', SLC, 'word 6 is the second half of an int32; write the first, 5'),
    ('RTC:0.HR', SLC, 'RTC is a function file whose type code is not known (S:37 to S:42 may '
                      'show the clock, or 0); let the program copy what is needed into an N file'),
    *((f'{name}0:4', SLC, f'{name} is a function file whose type code is not known; let the '
       'program copy what is needed into an N file') for name in (
           'BHI', 'CS', 'DAT', 'DLS', 'ES', 'IOS', 'LCD', 'MMI', 'TPI'))])
def test_what_nothing_supports_and_other_forms_are_told_what_to_write(
        text: str, family: PlcType, expected: str) -> None:
    with pytest.raises(AddressSyntaxError) as fault:
        parse_address(text, family)
    assert str(fault.value) == expected


@for_all('text', ['T4:0.FOO', 'B3:0.16', 'XYZ:0', 'N7:0 10', 'N7:O.O'])
def test_what_nobody_can_mean_is_left_to_the_grammar(text: str) -> None:
    with pytest.raises(AddressSyntaxError, match='^(?!.*; write)'):
        parse_address(text, SLC)
