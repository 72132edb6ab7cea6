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

"""Text that is shown cannot pass for something else; numbers as people write them."""

from abdf1_ros.numbers import decimal_number, two_readings, whole_number
from abdf1_ros.text import by_number, first, printable
from hypothesis import given
from hypothesis import strategies as st
from support.cases import ANY_CHARACTER, for_all


@for_all('text', ['', 'N7:0', 'Größe 5 °C', 'скорость', '速度', 'a "b" \\n'])
def test_what_can_be_seen_stays(text: str) -> None:
    assert printable(text) == text


@for_all(('text', 'shown'), [
    ('one\n[FATAL] two', r'one\n[FATAL] two'),
    ('one\r\ntwo', r'one\r\ntwo'),
    ('\x1b[2J', r'\x1b[2J'),          # a terminal would clear its screen
    ('a\x00b\x7fc\x9bd', r'a\x00b\x7fc\x9bd'),
    ('a\u2028b\u2029c\x85d', r'a\u2028b\u2029c\x85d'),  # line ends to some viewers
    ('\u202eabc\u2066', r'\u202eabc\u2066'),            # turns the direction of writing
    ('\u200b\ufeff\xad', r'\u200b\ufeff\xad'),          # shows nothing
    ('\udc80', r'\udc80'),            # what no encoding takes
    ('\U000e0001', r'\U000e0001'),
])
def test_what_cannot_be_seen_is_escaped(text: str, shown: str) -> None:
    assert printable(text) == shown


@given(st.text(ANY_CHARACTER))
def test_any_text_is_one_visible_line(text: str) -> None:
    shown = printable(text)
    assert shown.isprintable() and len(shown.splitlines()) <= 1
    assert shown.encode().decode() == shown
    assert printable(shown) == shown


def test_names_are_sorted_by_their_numbers() -> None:
    names = ['line10', 'line2', 'Line1', 'line2b', 'hall/3/press', 'hall/20/press', '7', 'x', '']
    assert sorted(names, key=by_number) == [
        '', '7', 'Line1', 'hall/3/press', 'hall/20/press', 'line2', 'line2b', 'line10', 'x']


def test_of_many_names_the_first_are_shown_and_the_others_counted() -> None:
    assert first(['a', 'b\n'], 2) == r'a, b\n'
    assert first(['a', 'b', 'c', 'd'], 2) == 'a, b and 2 more'


@for_all(('text', 'value'), [
    ('0', 0), ('-7', -7), ('+7', 7), ('007', 7), ('65535', 65535),
    ('', None), ('1.0', None), ('1e3', None), ('0x10', None), ('1 0', None), ('1_0', None),
    ('²', None), ('٣', None), ('-', None), ('5\n', None), ('9' * 5000, None)])
def test_whole_number_is_decimal_digits_with_a_sign_at_most(text: str, value: int | None) -> None:
    assert whole_number(text) == value


@for_all(('text', 'value'), [
    ('0', 0.0), ('-1.5', -1.5), ('+2', 2.0), ('.5', 0.5), ('5.', 5.0), ('1e3', 1000.0),
    ('2.5E-1', 0.25), ('007', 7.0), ('1e-400', 0.0)])
def test_decimal_number_is_read_as_people_write_it(text: str, value: float) -> None:
    assert decimal_number(text) == value


@for_all('text', [
    '', ' 1', '1 ', '1_000', '1_0.5', 'nan', 'inf', '-Infinity', '1e999', '\u0661', '\uff11',
    '1,5', '1e', 'e3', '.', '0x10', '1.2.3', '--1', '1\n'])
def test_text_that_is_no_number_is_none(text: str) -> None:
    assert decimal_number(text) is None


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_every_number_in_the_form_of_python(value: float) -> None:
    assert decimal_number(repr(value)) == value


@for_all(('text', 'right'), [
    ('1,000', '1000 or 1.000'), ('-12,500', '-12500 or -12.500'), ('1,5', ''), ('1,0000', ''),
    ('1000', ''), ('1.000', ''), ('', '')])
def test_comma_that_may_be_of_thousands(text: str, right: str) -> None:
    assert two_readings(text) == right
