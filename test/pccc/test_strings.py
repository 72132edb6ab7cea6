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

"""Strings become words and words become strings."""

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.strings import (
    COUNTED_WORDS,
    decode_counted,
    decode_packed,
    encode_counted,
    encode_packed,
)
from hypothesis import given
from hypothesis import strategies as st
import pytest

_TEXTS = st.text(st.characters(max_codepoint=255), max_size=82)


@given(_TEXTS)
def test_counted_strings_survive_a_round_trip(text: str) -> None:
    words = encode_counted(text)
    assert len(words) == 2 * COUNTED_WORDS == 84
    assert decode_counted(words) == text


@given(_TEXTS, st.integers(0, 5))
def test_packed_strings_survive_a_round_trip_but_for_nuls_behind_them(
        text: str, more: int) -> None:
    count = (len(text) + 1) // 2 + more
    words = encode_packed(text, count)
    assert len(words) == 2 * count
    assert decode_packed(words) == text.rstrip('\0')


@pytest.mark.parametrize('words, text', [
    ('05 00', '\0' * 5), ('00 00', ''),
    ('03 00 62 61 00 63', 'abc'),  # the first character is the high byte of the first word
    ('04 00 62 61 64 63', 'abcd'),
    ('05 00 45 48 4c 4c 00 4f', 'HELLO'),
    ('01 00 62 61 64 63', 'a'), ('01 00 00 e4', 'ä'), ('02 00 07 1b', '\x1b\x07')])
def test_string_of_a_plc(words: str, text: str) -> None:
    assert decode_counted(bytes.fromhex(words).ljust(84, b'\0')) == text


@pytest.mark.parametrize('text, words', [
    ('', '00 00 00 00'), ('a', '01 00 00 61'), ('abc', '03 00 62 61 00 63'),
    ('HELLO', '05 00 45 48 4c 4c 00 4f')])
def test_string_for_a_plc(text: str, words: str) -> None:
    assert encode_counted(text) == bytes.fromhex(words).ljust(84, b'\0')


def test_string_length_that_no_plc_has() -> None:
    with pytest.raises(FormatError, match='^string length 83 is more than 82$'):
        decode_counted(b'\x53\0' + bytes(82))
    assert len(decode_counted(b'\x52\0' + bytes(82))) == 82


@pytest.mark.parametrize('text, error', [
    ('x' * 83, '83 characters, a PLC string has 82'),
    ('5 \u20ac', "character '\u20ac' does not exist in a PLC"),
    ('\ud800', r"character '\ud800' does not exist in a PLC")])
def test_string_that_cannot_be_written(text: str, error: str) -> None:
    with pytest.raises(FormatError) as caught:
        encode_counted(text)
    assert str(caught.value) == error


@pytest.mark.parametrize('text, error', [
    ('x' * 7, '7 characters, the mapping has room for 6'),
    ('\u0142', "character '\u0142' does not exist in a PLC")])
def test_characters_that_cannot_be_written(text: str, error: str) -> None:
    assert len(encode_packed('x' * 6, 3)) == 6
    with pytest.raises(FormatError) as caught:
        encode_packed(text, 3)
    assert str(caught.value) == error
