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

"""Values become words and words become values; which types a place has."""

from array import array
import math
import struct

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.strings import decode_counted, encode_counted, encode_packed, is_string_element
from abdf1_ros.pccc.structures import named_runs, type_fault, write_fault
from abdf1_ros.pccc.typed_data import TypedData
from abdf1_ros.pccc.values import Codec, types_of, ValueType, WordOrder
from hypothesis import example, given, settings
from hypothesis import strategies as st
import pytest
from support.cases import for_all

PLC3, PLC5, SLC = PlcType.PLC3, PlcType.PLC5, PlcType.SLC


@settings(max_examples=40)
@example('a\0b\0')
@given(st.text(st.characters(max_codepoint=255), max_size=82))
def test_strings_survive_a_round_trip(text: str) -> None:
    for codec in (Codec(ValueType.STRING, 1), Codec(ValueType.STRING, 41, packed=True)):
        codec.check(text)
        words = codec.encode(text)
        assert len(words) == 2 * codec.words
        assert codec.decoder()(words) == (text.rstrip('\0') if codec.packed else text)


@for_all(('kind', 'order', 'words', 'values'), [
    (ValueType.INT16, 'Low', '01 00 ff ff 00 80', [1, -1, -32768]),
    (ValueType.UINT16, 'Low', '01 00 ff ff 34 12', [1, 65535, 0x1234]),
    (ValueType.BCD16, 'Low', '34 12 99 99', [1234, 9999]),
    (ValueType.BCD12, 'Low', '34 02 99 09', [234, 999]),
    (ValueType.INT32, 'Low', '02 00 01 00 ff ff ff ff', [0x10002, -1]),
    (ValueType.UINT32, 'Low', '02 00 01 00 ff ff ff ff', [0x10002, 2**32 - 1]),
    (ValueType.FLOAT32, 'Low', '00 00 c0 3f 00 00 20 c1', [1.5, -10.0]),
    (ValueType.INT32, 'High', '01 00 02 00 ff ff fe ff', [0x10002, -2]),
    (ValueType.UINT32, 'High', '01 00 02 00 ff ff fe ff', [0x10002, 2**32 - 2]),
    (ValueType.FLOAT32, 'High', 'c0 3f 00 00 7a 44 00 00', [1.5, 1000.0])])
def test_order_of_bytes_and_words(kind: ValueType, order: str, words: str,
                                  values: list[float]) -> None:
    codec = Codec(kind, len(values), word_order=WordOrder(order))
    for decode in codec.decode, codec.decoder():
        assert decode(bytes.fromhex(words)) == array(kind.array_code, values)
    assert codec.encode(values) == codec.encode([*map(float, values)]) == bytes.fromhex(words)


@pytest.mark.parametrize('word, text', [
    ('0a 00', 'word 000A is not BCD'), ('00 a0', 'word A000 is not BCD'),
    ('f0 12', 'word 12F0 is not BCD')])
def test_word_that_is_not_bcd(word: str, text: str) -> None:
    with pytest.raises(FormatError, match=f'^{text}$'):
        Codec(ValueType.BCD16, 2).decode(bytes.fromhex('34 12' + word))


@for_all(('kind', 'values', 'error'), [
    (ValueType.INT16, [1], '1 value, the mapping has 2'),
    (ValueType.INT16, [1, 2, 3], '3 values, the mapping has 2'),
    (ValueType.INT16, [], '0 values, the mapping has 2'),
    (ValueType.INT16, [0, 32768], 'value 32768 at index 1 is not a valid int16, '
     'a whole number from -32768 to 32767'),
    (ValueType.INT16, [-32769, 0], 'value -32769 at index 0 is not a valid int16, '
     'a whole number from -32768 to 32767'),
    (ValueType.UINT16, [0, -1], 'value -1 at index 1 is not a valid uint16, '
     'a whole number from 0 to 65535'),
    (ValueType.BCD16, [0, 10000], 'value 10000 at index 1 is not a valid bcd16, '
     'a whole number from 0 to 9999'),
    (ValueType.BOOL, [0, 2], 'value 2 at index 1 is not a valid bool, '
     '0 or 1'),
    (ValueType.FLOAT32, [0.0, math.nan], 'value nan at index 1 is not a valid float32, '
     'a number such as -1.5 or 2e3, at most 3.4e38'),
    (ValueType.FLOAT32, [math.inf, 0.0], 'value inf at index 0 is not a valid float32, '
     'a number such as -1.5 or 2e3, at most 3.4e38'),
    (ValueType.FLOAT32, [-math.inf, 0.0], 'value -inf at index 0 is not a valid float32, '
     'a number such as -1.5 or 2e3, at most 3.4e38'),
    (ValueType.INT16, [math.nan, 0], 'value nan at index 0 is not a valid int16, '
     'a whole number from -32768 to 32767'),
    (ValueType.INT16, [1.0, 1.5], 'value 1.5 at index 1 is not a valid int16, '
     'a whole number from -32768 to 32767'),
    (ValueType.INT16, 'ab', "the text 'ab' is not a valid int16, "
     'a whole number from -32768 to 32767'),
    (ValueType.STRING, [65, 66], 'the value [65, 66] is not a valid string, '
     'a text (str)')])
def test_values_that_cannot_be_written(
        kind: ValueType, values: list[float] | str, error: str) -> None:
    with pytest.raises(FormatError) as caught:
        Codec(kind, 2).check(values)
    assert str(caught.value) == error


@for_all(('kind', 'least', 'greatest'), [
    (ValueType.BOOL, 0, 1), (ValueType.INT16, -0x8000, 0x7FFF), (ValueType.UINT16, 0, 0xFFFF),
    (ValueType.INT32, -0x80000000, 0x7FFFFFFF), (ValueType.UINT32, 0, 0xFFFFFFFF),
    (ValueType.BCD16, 0, 9999), (ValueType.BCD12, 0, 999),
    (ValueType.FLOAT32, *struct.unpack('<2f', bytes.fromhex('FFFF7FFF FFFF7F7F')))])
def test_least_and_greatest_value_can_be_written(
        kind: ValueType, least: float, greatest: float) -> None:
    codec = Codec(kind, 2)
    assert kind.range == (least, greatest)
    codec.check([least, greatest])
    if kind is not ValueType.BOOL:
        assert codec.decode(codec.encode([least, greatest])) == array(
            kind.array_code, [least, greatest])


@for_all(('kind', 'length', 'bit', 'words'), [
    (ValueType.BOOL, 1, 0, 1), (ValueType.BOOL, 16, 0, 1), (ValueType.BOOL, 17, 0, 2),
    (ValueType.BOOL, 1, 15, 1), (ValueType.BOOL, 2, 15, 2), (ValueType.BOOL, 33, 15, 3),
    (ValueType.INT16, 7, 0, 7), (ValueType.BCD16, 7, 0, 7), (ValueType.INT32, 7, 0, 14),
    (ValueType.UINT32, 1, 0, 2), (ValueType.FLOAT32, 3, 0, 6), (ValueType.STRING, 1, 0, 42)])
def test_words_that_elements_take(kind: ValueType, length: int, bit: int, words: int) -> None:
    assert Codec(kind, length, bit).words == words


@for_all('status', ['0', '2', 'A', 'F'])
def test_three_digits_below_the_status_bits_of_a_plc2(status: str) -> None:
    codec = Codec(ValueType.BCD12, 1)
    word = int(f'{status}123', 16)
    for decode in codec.decode, codec.decoder():
        assert list(decode(word.to_bytes(2, 'little'))) == [123]
    start = parse_address('030', PlcType.PLC2)
    assert codec.bit_changes(start, [50]) == [(start, 0x0FFF, 0x050)]
    table = DataTable(PlcType.PLC2)
    table.create(start, 1)
    table.write(start, word.to_bytes(2, 'little'))
    codec.store(table, start, [50])
    assert table.read(start, 1).hex() == f'50{status}0'.lower()
    with pytest.raises(FormatError, match='^word 0A23 is not BCD$'):
        codec.decode(bytes.fromhex('23 1A'))


def test_bits_across_words() -> None:
    codec = Codec(ValueType.BOOL, 4, 14)
    assert list(codec.decode(bytes.fromhex('00 40 02 00'))) == [1, 0, 0, 1]
    assert codec.decoder()(bytes.fromhex('00 40 02 00')) == array('B', [1, 0, 0, 1])
    start = parse_address('B3:0/14', PlcType.SLC)
    assert [(str(address), mask, bits)
            for address, mask, bits in codec.bit_changes(start, [1, 0, 0, 1])] == [
        ('B3:0', 0xC000, 0x4000), ('B3:1', 0x0003, 0x0002)]
    assert [mask for _, mask, _ in Codec(ValueType.BOOL, 20, 14).bit_changes(
        start, [1] * 20)] == [0xC000, 0xFFFF, 0x0003]


@for_all(('text', 'family', 'natural'), [
    ('N7:0', 'PLC5', 'int16'), ('B3:0', 'PLC5', 'uint16'), ('I:000', 'PLC5', 'uint16'),
    ('O:000', 'PLC5', 'uint16'), ('S:0', 'PLC5', 'uint16'), ('D9:0', 'PLC5', 'bcd16'),
    ('A9:0', 'PLC5', 'uint16'), ('F8:0', 'PLC5', 'float32'), ('L9:0', 'SLC', 'int32'),
    ('T4:0.ACC', 'PLC5', 'int16'), ('HSC:0.ACC', 'SLC', 'int32'), ('R6:0.LEN', 'PLC5', 'int16'),
    ('ST9:0', 'PLC5', 'string'), ('PD9:0.SP', 'PLC5', 'float32'), ('PD9:0', 'PLC5', 'int16'),
    ('PD9:0.50', 'PLC5', 'int16'), ('PD9:0.SPS', 'SLC', 'int16'), ('MG9:0.ERR', 'PLC5', 'int16'),
    ('BT9:0.RLEN', 'PLC5', 'int16'), ('SC9:0.TIM', 'PLC5', 'int16')])
def test_natural_type_of_a_place(text: str, family: str, natural: str) -> None:
    types = types_of(parse_address(text, PlcType(family)))
    assert types[0].value == natural
    assert ValueType.BOOL not in types


@for_all('text', ['N7:0/3', 'T4:0/DN', 'PD9:0/INI', 'O:000/17'])
def test_bits_are_bool_only(text: str) -> None:
    assert types_of(parse_address(text, PlcType.PLC5)) == (ValueType.BOOL,)


@for_all(('text', 'words'), [
    ('', '00 00 00 00'), ('a', '01 00 00 61'), ('\0' * 5, '05 00'), ('ä', '01 00 00 e4'),
    ('abc', '03 00 62 61 00 63'),  # the first character is the high byte of the first word
    ('abcd', '04 00 62 61 64 63'), ('HELLO', '05 00 45 48 4c 4c 00 4f'),
    ('\x1b\x07', '02 00 07 1b')])
def test_string_in_a_plc(text: str, words: str) -> None:
    data = bytes.fromhex(words).ljust(84, b'\0')
    assert (decode_counted(data), encode_counted(text)) == (text, data)


@for_all(('text', 'words', 'error'), [
    ('x' * 83, 0, '83 characters, a PLC string has 82'),
    ('5 \u20ac', 0, "character '\u20ac' does not exist in a PLC"),
    ('\ud800', 0, r"character '\ud800' does not exist in a PLC"),
    ('x' * 7, 3, '7 characters, the mapping has room for 6'),
    ('\u0142', 3, "character '\u0142' does not exist in a PLC")])
def test_string_that_cannot_be_written(text: str, words: int, error: str) -> None:
    with pytest.raises(FormatError) as caught:
        Codec(ValueType.STRING, words or 1, packed=words > 0).check(text)
    assert str(caught.value) == error
    assert len(encode_packed('x' * 6, 3)) == 6


def test_string_ends_with_its_length_which_is_at_most_82() -> None:
    assert decode_counted(bytes.fromhex('01 00 62 61 64 63').ljust(84, b'\0')) == 'a'
    with pytest.raises(FormatError, match='^string length 83 is more than 82$'):
        decode_counted(b'\x53\0' + bytes(82))
    assert len(decode_counted(b'\x52\0' + bytes(82))) == 82
    assert is_string_element(' #st9;0') and not is_string_element('S:9')


def at(text: str, family: PlcType = PLC5) -> Address:
    return parse_address(text, family)


@for_all(('text', 'kind', 'length', 'fault'), [
    ('PD9:0.SP', 'float32', 24, None), ('PD9:0.TIE', 'float32', 1, None),
    ('PD9:0', 'int16', 2, None), ('PD9:0.50', 'uint16', 34, None), ('T4:0', 'int16', 30, None),
    ('N7:0', 'float32', 50, None), ('F8:0', 'float32', 9, None), ('PD9:0/EN', 'bool', 1, None),
    ('PD9:0.SP', 'float32', 25,
     '25 float32 from PD9:0.SP reach to PD9:0.50, where words of 16 bits are'),
    ('PD9:0', 'int16', 3, '3 int16 from PD9:0 reach to PD9:0.SP, where float32 values are'),
    ('PD9:0.80', 'uint16', 5,
     '5 uint16 from PD9:0.80 reach to PD9:1.SP, where float32 values are')])
def test_range_is_of_one_type(text: str, kind: str, length: int, fault: str | None) -> None:
    assert type_fault(at(text), ValueType(kind), length) == fault
    assert named_runs(at('PD9:1/EN')) == [(at('PD9:1'), 2, 1), (at('PD9:1.SP'), 24, 2)]


@for_all(('text', 'family', 'kind', 'length', 'wrong'), [
    ('T4:0.PRE', PLC5, 'int16', 2, ''), ('T4:0/DN', PLC5, 'bool', 3, ''),
    ('T4:0.ACC/3', SLC, 'bool', 13, ''), ('PD9:0.SP', PLC5, 'float32', 12, ''),
    ('PD9:0/MO', PLC5, 'bool', 2, ''), ('MG9:0/TO', PLC5, 'bool', 1, ''),
    ('BT9:0/CO', PLC5, 'bool', 1, ''), ('PD9:0.SPS', SLC, 'int16', 4, ''),
    ('PD9:0/TM', SLC, 'bool', 4, ''), ('N7:0', SLC, 'int16', 100, ''),
    ('ST9:0', SLC, 'string', 1, ''), ('N7:0/0', SLC, 'bool', 16, ''),
    ('T4:0', PLC5, 'int16', 1, 'T4:0'), ('T4:0.PRE', SLC, 'int16', 3, 'T4:1'),
    ('T4:0.0/12', SLC, 'bool', 2, 'T4:0.0/12'), ('T:4.CTL', PLC3, 'int16', 1, 'T:4.CTL'),
    ('PD9:0.SP', PLC5, 'float32', 13, 'PD9:0.PV'), ('PD9:0/INI', PLC5, 'bool', 1, 'PD9:0/INI'),
    ('PD9:0/SWM', PLC5, 'bool', 2, 'PD9:0/5'), ('PD9:0.54', PLC5, 'int16', 1, 'PD9:0.54'),
    ('MG9:0/ST', PLC5, 'bool', 2, 'MG9:0/ST'), ('BT9:0.RLEN', PLC5, 'int16', 1, 'BT9:0.RLEN'),
    ('MG9:0.RBL', SLC, 'int16', 1, 'MG9:0.RBL'), ('PD9:0.SPS', SLC, 'int16', 5, 'PD9:0.6')])
def test_what_may_be_written_and_what_belongs_to_the_processor(
        text: str, family: PlcType, kind: str, length: int, wrong: str) -> None:
    fault = write_fault(at(text, family), ValueType(kind), length) or ''
    assert fault.partition(' belongs to the processor; of such an element can be written: ')[0] \
        == wrong


def test_fault_says_what_may_be_written() -> None:
    assert str(write_fault(at('SC9:0.TIM'), ValueType.INT16, 1)).endswith('be written: PRE')
    assert str(write_fault(at('MG9:0.0', SLC), ValueType.INT16, 1)).endswith('written: nothing')


@for_all(('type_id', 'size', 'data', 'encoded'), [
    (4, 2, 'D2 04', '93 09 42 D2 04'),
    (4, 2, '01 00 02 00', '95 09 42 01 00 02 00'),
    (4, 2, '00 00 FE FF FF 00', '97 09 42 00 00 FE FF FF 00'),
    (4, 2, '01 00 02 00 03 00 04 00', '99 09 09 42 01 00 02 00 03 00 04 00'),
    (8, 4, '00 00 2A 42', '96 09 94 08 00 00 2A 42'),
    (8, 4, '00 00 7A 44 00 00 C0 BF', '99 09 0A 94 08 00 00 7A 44 00 00 C0 BF'),
    (5, 10, '00 C2 0A 00 09 00 00 00 00 00',
     '99 09 0C 59 0A 00 C2 0A 00 09 00 00 00 00 00'),
    (6, 6, '01 02 03 04 05 06', '97 09 66 01 02 03 04 05 06'),
    (7, 6, '01 02 03 04 05 06', '97 09 76 01 02 03 04 05 06')])
def test_encode_and_decode(type_id: int, size: int, data: str, encoded: str) -> None:
    values = TypedData(type_id, size, bytes.fromhex(data))
    assert values.encode() == bytes.fromhex(encoded)
    for padding in (0, 2):
        assert TypedData.decode(bytes.fromhex(encoded) + bytes(padding)) == values


def test_long_array_has_a_two_byte_size() -> None:
    values = TypedData(4, 2, bytes(300))
    assert values.encode()[:5] == bytes.fromhex('9A 09 2D 01 42')
    assert TypedData.decode(values.encode()) == values
    assert values.count == 150
    assert TypedData.decode(b'\x9C\t\3\0\0\0\x42\xD2\4') == TypedData(4, 2, b'\xD2\4')


@for_all('encoded', [
    '', '93', '93 09', '93 09 42 D2', '99 09', '99 09 05 42 D2 04', '9A 09 03', '42 D2',
    '42 D2 04 00', '40 D2', '90 09 42', '94 09 42 D2 04 00', '91 09 40', '9F 09 01', 'FF',
    '93 09 40 D2 04', '93 09 42 D2 04 00 01', '93 09 42 D2 04 FF'])
def test_what_does_not_add_up_is_a_format_error(encoded: str) -> None:
    with pytest.raises(FormatError):
        TypedData.decode(bytes.fromhex(encoded))
