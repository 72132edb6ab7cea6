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

"""Numbers as people write them, and what Python alone takes for one."""

from abdf1_ros.numbers import decimal_number, two_readings, whole_number
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all


@pytest.mark.parametrize('text, value', [
    ('0', 0), ('-7', -7), ('+7', 7), ('007', 7), ('65535', 65535),
    ('', None), ('1.0', None), ('1e3', None), ('0x10', None), ('1 0', None), ('1_0', None),
    ('²', None), ('٣', None), ('-', None), ('5\n', None), ('9' * 5000, None)])
def test_whole_number_is_decimal_digits_with_a_sign_at_most(text: str, value: int | None) -> None:
    assert whole_number(text) == value


@pytest.mark.parametrize(('text', 'value'), [
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


@pytest.mark.parametrize(('text', 'right'), [
    ('1,000', '1000 or 1.000'), ('-12,500', '-12500 or -12.500'), ('1,5', ''), ('1,0000', ''),
    ('1000', ''), ('1.000', ''), ('', '')])
def test_comma_that_may_be_of_thousands(text: str, right: str) -> None:
    assert two_readings(text) == right
