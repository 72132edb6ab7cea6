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

"""Numbers of PCCC and the reader of fields."""

from collections.abc import Callable

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.fields import number, Reader
from hypothesis import given
from hypothesis import strategies as st
import pytest


@pytest.mark.parametrize(('value', 'encoded'), [
    (0, '00'), (1, '01'), (254, 'FE'), (255, 'FF FF 00'), (256, 'FF 00 01'), (300, 'FF 2C 01'),
    (65535, 'FF FF FF')])
def test_number_is_short_up_to_254(value: int, encoded: str) -> None:
    assert number(value) == bytes.fromhex(encoded)
    assert Reader(bytes.fromhex(encoded)).number() == value


@given(st.lists(st.integers(0, 0xFFFF), max_size=8))
def test_numbers_are_read_back(values: list[int]) -> None:
    reader = Reader(b''.join(map(number, values)))
    assert [reader.number() for _ in values] == values
    assert reader.is_empty


def test_reader_takes_fields_in_order() -> None:
    reader = Reader(bytes(range(8)))
    assert (reader.byte(), reader.word(), reader.take(2)) == (0, 0x0201, b'\x03\x04')
    assert not reader.is_empty
    assert reader.rest() == b'\x05\x06\x07'
    assert reader.is_empty
    assert reader.rest() == b''
    reader.end()


@pytest.mark.parametrize(('data', 'take'), [
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
