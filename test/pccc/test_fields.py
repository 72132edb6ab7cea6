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

"""Numbers of PCCC, the reader of fields, and the type/data parameter of typed commands."""

from collections.abc import Callable

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import number, Reader
from abdf1_ros.pccc.typed_data import TypedData
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all


@for_all(('value', 'encoded'), [
    (0, '00'), (1, '01'), (254, 'FE'), (255, 'FF FF 00'), (256, 'FF 00 01'), (300, 'FF 2C 01'),
    (65535, 'FF FF FF')])
def test_number_is_short_up_to_254(value: int, encoded: str) -> None:
    assert number(value) == bytes.fromhex(encoded)
    assert Reader(bytes.fromhex(encoded)).number() == value


def test_reader_takes_fields_in_order() -> None:
    reader = Reader(bytes(range(8)))
    assert (reader.byte(), reader.word(), reader.take(2)) == (0, 0x0201, b'\x03\x04')
    assert not reader.is_empty
    assert reader.rest() == b'\x05\x06\x07'
    assert reader.is_empty
    assert reader.rest() == b''
    reader.end()


@for_all(('data', 'take'), [
    (b'', Reader.byte), (b'\x01', Reader.word), (b'', Reader.number), (b'\xFF', Reader.number),
    (b'\xFF\x01', Reader.number), (b'ab', lambda reader: reader.take(3))])
def test_missing_bytes_are_a_format_error(data: bytes, take: Callable[[Reader], object]) -> None:
    with pytest.raises(FormatError, match='missing'):
        take(Reader(data))


def test_end_names_what_is_too_much() -> None:
    reader = Reader(b'abc')
    reader.byte()
    with pytest.raises(FormatError, match='^2 bytes too many'):
        reader.end()


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
    (7, 6, '01 02 03 04 05 06', '97 09 76 01 02 03 04 05 06'),
])
def test_encode_and_decode(type_id: int, size: int, data: str, encoded: str) -> None:
    values = TypedData(type_id, size, bytes.fromhex(data))
    assert values.encode() == bytes.fromhex(encoded)
    assert TypedData.decode(bytes.fromhex(encoded)) == values


def test_long_array_has_a_two_byte_size() -> None:
    values = TypedData(4, 2, bytes(300))
    assert values.encode()[:5] == bytes.fromhex('9A 09 2D 01 42')
    assert TypedData.decode(values.encode()) == values
    assert values.count == 150


def test_padding_behind_an_array_is_passed_over() -> None:
    assert TypedData.decode(bytes.fromhex('93 09 42 D2 04 00 00')) == TypedData(4, 2, b'\xD2\x04')


@for_all('encoded', [
    '', '93', '93 09', '93 09 42 D2', '99 09', '99 09 05 42 D2 04', '9A 09 03', '42 D2',
    '42 D2 04 00', '40 D2', '90 09 42', '94 09 42 D2 04 00', '91 09 40', '9F 09 01', 'FF',
    '93 09 40 D2 04', '93 09 42 D2 04 00 01', '93 09 42 D2 04 FF'])
def test_what_does_not_add_up_is_a_format_error(encoded: str) -> None:
    with pytest.raises(FormatError):
        TypedData.decode(bytes.fromhex(encoded))


@given(st.one_of(st.binary(max_size=40), st.builds(
    bytes.__add__, st.sampled_from([b'\x99\x09', b'\x9A\x09', b'\x93\x09', b'\x42']),
    st.binary(max_size=20))))
def test_any_bytes_are_elements_or_a_format_error(parameter: bytes) -> None:
    try:
        values = TypedData.decode(parameter)
    except FormatError:
        return
    assert values.element_size > 0
    assert values.count * values.element_size == len(values.data)
