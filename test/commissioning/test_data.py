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

"""Addresses and values of the command line."""

from __future__ import annotations

from array import array

from abdf1_ros.commissioning.data import (
    element,
    length_of,
    mapping_of,
    parse_values,
    processor_of,
    rows,
)
from abdf1_ros.driver.mapping import Mapping
from abdf1_ros.errors import ConfigurationError, FormatError
from abdf1_ros.pccc.identity import Identity
from hypothesis import given
from hypothesis import strategies as st
import pytest


def make(address: str, **cells: str) -> Mapping:
    common = {'Command': 'ReadWrite', 'Station': '1', 'PLC_Type': 'SLC'}
    return mapping_of(address, common | cells)


def test_columns_are_those_of_a_map_file() -> None:
    mapping = make('N7:0', Length='4', Type='int32', Word_Order='High', Station='7')
    assert (mapping.length, mapping.type.value, mapping.word_order.value, mapping.station) == (
        4, 'int32', 'High', 7)


def test_faults_name_the_address_by_its_number() -> None:
    with pytest.raises(ConfigurationError, match=r'command line:3 \(Address\): 2503 .* Item: 3'):
        mapping_of('N7', {'Command': 'Read', 'Station': '1', 'PLC_Type': 'SLC'}, 3)


@pytest.mark.parametrize('address, kind, number, expected', [
    ('N7:5', '', 3, 'N7:8'), ('N7:5', 'int32', 3, 'N7:11'), ('F8:2', '', 2, 'F8:4'),
    ('B3:0/5', '', 3, 'B3:0/8'), ('B3:0/5', '', 11, 'B3:1/0'), ('I:1.0/15', '', 1, 'I:1.1/0'),
    ('T4:0.PRE', '', 1, 'T4:0.ACC')])
def test_address_of_an_element(address: str, kind: str, number: int, expected: str) -> None:
    assert str(element(make(address, Type=kind, Command='Read'), number)) == expected


def test_rows_of_values() -> None:
    mapping = make('N7:3', Length='12')
    assert list(rows(mapping, array('h', [*range(11), -100]))) == [
        ('N7:3', '   0     1     2     3     4     5     6     7     8     9'),
        ('N7:13', '  10  -100')]
    assert list(rows(make('F8:0'), array('f', [0.1]))) == [('F8:0', '0.1')]
    assert list(rows(make('ST9:0'), 'a\nb')) == [('ST9:0', r"'a\nb'")]


@pytest.mark.parametrize('address, kind, texts, values', [
    ('N7:0', '', ['5', '-6', '0x1F', '0b11', '007'], [5, -6, 31, 3, 7]),
    ('F8:0', '', ['1.5', '1e3', '2,5'], [1.5, 1000, 2.5]), ('B3:0/0', '', ['1', '0'], [1, 0]),
    ('ST9:0', '', ['a b'], 'a b'), ('N7:0', 'bcd16', ['1234'], [1234])])
def test_values(address: str, kind: str, texts: list[str], values: object) -> None:
    assert parse_values(make(address, Type=kind), texts) == values


@pytest.mark.parametrize('address, texts', [
    ('N7:0', ['x']), ('N7:0', ['']), ('N7:0', ['0x']), ('N7:0', ['1.0']), ('F8:0', ['1.5.2']),
    ('ST9:0', ['a', 'b'])])
def test_no_values(address: str, texts: list[str]) -> None:
    with pytest.raises(FormatError):
        parse_values(make(address), texts)


@pytest.mark.parametrize('model, processor', [
    ('SLC 5/02', '5/02'), ('SLC 5/03', ''), ('SLC 5/05', '5/05'), ('MicroLogix 1000', 'ML1000'),
    ('MicroLogix 1500 LRP', 'ML1500'), ('SLC 500 fixed', ''), ('1763-LEC', '')])
def test_processor_that_says_what_it_is(model: str, processor: str) -> None:
    assert processor_of(Identity('SLC', model)) == processor


@given(st.integers(-32768, 32767))
def test_whole_numbers_in_every_notation(value: int) -> None:
    mapping = make('N7:0')
    assert parse_values(mapping, [str(value)]) == [value]
    if value >= 0:
        assert parse_values(mapping, [hex(value), bin(value), oct(value)]) == [value] * 3


@pytest.mark.parametrize('address, kind, texts, length', [
    ('N7:0', None, ['1', '2'], 2), ('ST9:0', 'string', ['Tank 5'], 1),
    ('N7:0', 'string', ['abcde'], 3), ('A10:0', 'string', [''], 1)])
def test_length_of_a_write(address: str, kind: str | None, texts: list[str], length: int) -> None:
    assert length_of(address, kind, texts) == length
