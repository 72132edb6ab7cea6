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

"""The map CSV: columns, defaults, clashes, and the numbered texts of its errors."""

from __future__ import annotations

from dataclasses import replace
import math
from pathlib import Path

from abdf1_ros.driver.mapping import COLUMNS, Command, load_mappings, Mapping, Publish
from abdf1_ros.driver.values import ValueType
from abdf1_ros.errors import ConfigurationError
from abdf1_ros.messages import Severity
from abdf1_ros.pccc.file_types import PlcType
import pytest
from support.mappings import load_rows, load_text

GOOD = {'Tag': 'a', 'Command': 'ReadWrite', 'Address': 'N7:0', 'Station': '1',
        'PLC_Type': 'PLC5'}


def row(**cells: str) -> str:
    """Return a row of these cells beside good ones."""
    return ','.join((GOOD | cells).get(column, '') for column in COLUMNS)


def one(**cells: str) -> Mapping:
    """Return the mapping of such a row, which has to be good."""
    mappings, problems = load_rows(row(**cells))
    assert problems == []
    return mappings[0]


def faults(*rows: str) -> list[str]:
    """Return the faults of rows as text, without the name of the file."""
    _, problems = load_rows(*rows)
    return [str(problem).split('map.csv:', 1)[1] for problem in problems]


def fault(**cells: str) -> str:
    """Return the one fault of a row."""
    text, = faults(row(**cells))
    return text


def test_columns_are_those_of_the_interface() -> None:
    assert COLUMNS == ('Tag', 'Command', 'Address', 'Station', 'PLC_Type', 'Length', 'Type',
                       'Topic', 'Period', 'Publish', 'Min', 'Max')


def test_row_with_every_column() -> None:
    mapping = one(Tag='Line speed', Command='readwrite', Address='n7:10', Station='254',
                  PLC_Type='slc', Length='4', Type='FLOAT32', Topic='cell/1 speed',
                  Period='250', Publish='change', Min='-1.5', Max='99')
    assert mapping == Mapping(
        1, 2, 'Line speed', 'Line_speed', Command.READ_WRITE, mapping.address, 254,
        PlcType.SLC, 4, ValueType.FLOAT32, 'cell/t1_speed', 250, Publish.CHANGE, -1.5, 99.0)
    assert str(mapping.address) == 'N7:10'


def test_defaults() -> None:
    mapping = one(Tag='x:y', Command='Read')
    assert (mapping.length, mapping.type, mapping.topic, mapping.period, mapping.publish) == (
        1, ValueType.INT16, 'x_y', None, Publish.ALWAYS)
    assert (mapping.minimum, mapping.maximum) == (-math.inf, math.inf)


@pytest.mark.parametrize('text, reads, writes', [
    ('Read', True, False), ('Write', False, True), ('ReadWrite', True, True),
    ('READ', True, False), ('write', False, True)])
def test_command(text: str, reads: bool, writes: bool) -> None:
    mapping = one(Command=text)
    assert (mapping.reads, mapping.writes) == (reads, writes)


@pytest.mark.parametrize('address, plc, kind', [
    ('N7:0', 'PLC5', 'int16'), ('B3:0', 'PLC5', 'uint16'), ('I:001', 'PLC5', 'uint16'),
    ('O:000', 'PLC5', 'uint16'), ('S:1', 'PLC5', 'uint16'), ('D9:0', 'PLC5', 'uint16'),
    ('A9:0', 'SLC', 'uint16'), ('F8:0', 'PLC5', 'float32'), ('L10:0', 'SLC', 'int32'),
    ('T4:0.ACC', 'PLC5', 'int16'), ('C5:0.PRE', 'SLC', 'int16'), ('R6:0.LEN', 'PLC5', 'int16'),
    ('ST9:0', 'PLC5', 'string'), ('B3:0/5', 'PLC5', 'bool'), ('T4:0/DN', 'SLC', 'bool'),
    ('I:017/12', 'PLC5', 'bool'), ('I:1.0/3', 'SLC', 'bool'), ('N7:0/1', 'SLC', 'bool')])
def test_natural_type(address: str, plc: str, kind: str) -> None:
    assert one(Address=address, PLC_Type=plc, Command='Read').type.value == kind


@pytest.mark.parametrize('address, kind', [
    ('N7:0', 'uint16'), ('N7:0', 'int32'), ('N7:0', 'uint32'), ('N7:0', 'float32'),
    ('N7:0', 'bcd16'), ('B3:0', 'int16'), ('D9:0', 'bcd16'), ('T4:0.ACC', 'uint16')])
def test_other_type_that_fits(address: str, kind: str) -> None:
    assert one(Address=address, Type=kind).type.value == kind


@pytest.mark.parametrize('address, kind, right', [
    ('F8:0', 'int16', 'F8:0 can be float32'),
    ('ST9:0', 'int16', 'ST9:0 can be string'),
    ('T4:0.ACC', 'int32', 'T4:0.ACC can be int16, uint16'),
    ('N7:0', 'string', 'N7:0 can be int16, uint16, bcd16, int32, uint32, float32'),
    ('N7:0', 'bool', 'N7:0 can be int16, uint16, bcd16, int32, uint32, float32; '
                     'a bool needs a bit address such as B3:0/5'),
    ('B3:0/5', 'int16', 'B3:0/5 can be bool')])
def test_type_that_does_not_fit(address: str, kind: str, right: str) -> None:
    assert fault(Address=address, Type=kind) == f'2:7 (Type): Item: 1, {right}'


@pytest.mark.parametrize('column, text, expected', [
    ('Station', '255',
     '2:4 (Station): 2501 ERR_BAD_STATION: Item: 1, Invalid station number (255) must be less '
     'than 255; Station = "255" should be a whole number from 0 to 254'),
    ('Station', 'PLC', '2:4 (Station): 2501 ERR_BAD_STATION: Item: 1, Invalid station number '
     '(PLC) must be less than 255; Station = "PLC" should be a whole number from 0 to 254'),
    ('PLC_Type', 'S7',
     '2:5 (PLC_Type): 2502 ERR_BAD_PLC_TYPE: Item: 1, Invalid or Unsupported PLC Type (S7) '
     'should be one of PLC2, PLC3, PLC5, SLC; this version has PLC5, SLC'),
    ('PLC_Type', 'PLC3',
     '2:5 (PLC_Type): 2502 ERR_BAD_PLC_TYPE: Item: 1, Invalid or Unsupported PLC Type (PLC3) '
     'should be one of PLC2, PLC3, PLC5, SLC; this version has PLC5, SLC'),
    ('Address', 'N7',
     '2:3 (Address): 2503 ERR_ADDRESS_SYNTAX: Item: 1, Invalid Address Syntax (N7); an element '
     'is missing, as in N7:0'),
    ('Address', 'L10:0',
     '2:3 (Address): 2503 ERR_ADDRESS_SYNTAX: Item: 1, Invalid Address Syntax (L10:0); a PLC5 '
     'has no L files'),
    ('Address', 'N7:1000',
     '2:3 (Address): 2504 ERR_ADDRESS_RANGE: Item: 1, Address is out of range (N7:1000, len=1);'
     ' elements of N run from 0 to 999'),
    ('Command', 'Poll',
     '2:2 (Command): Item: 1, Command = "Poll" should be one of '
     + ', '.join(command.value for command in Command)),
    ('Publish', 'Never',
     '2:10 (Publish): Item: 1, Publish = "Never" should be one of Always, Change'),
    ('Type', 'int8', '2:7 (Type): Item: 1, Type = "int8" should be one of bool, int16, uint16, '
     'int32, uint32, float32, bcd16, string'),
    ('Length', '0', '2:6 (Length): Item: 1, Length = "0" should be a whole number from 1 to '
     '65535'),
    ('Length', '1.5', '2:6 (Length): Item: 1, Length = "1.5" should be a whole number from 1 '
     'to 65535'),
    ('Period', '-1', '2:9 (Period): Item: 1, Period = "-1" should be a whole number from 0 to '
     '86400000'),
    ('Period', '86400001', '2:9 (Period): Item: 1, Period = "86400001" should be a whole number'
     ' from 0 to 86400000'),
    ('Min', 'low', '2:11 (Min): Item: 1, Min = "low" should be a number'),
    ('Min', 'nan', '2:11 (Min): Item: 1, Min = "nan" should be a number'),
    ('Max', 'inf', '2:12 (Max): Item: 1, Max = "inf" should be a number'),
    ('Max', '1e999', '2:12 (Max): Item: 1, Max = "1e999" should be a number'),
    ('Tag', '--', '2:1 (Tag): Item: 1, Tag = "--" has no letter, digit or underscore'),
    ('Topic', '/', '2:8 (Topic): Item: 1, Topic = "/" has no letter, digit or underscore'),
    ('Topic', 'x' * 151, '2:8 (Topic): Item: 1, Topic has 151 characters, at most 150 go'),
])
def test_exact_text(column: str, text: str, expected: str) -> None:
    assert fault(**{column: text}) == expected


@pytest.mark.parametrize('column', ['Tag', 'Command', 'Address', 'Station', 'PLC_Type'])
def test_needed_column(column: str) -> None:
    assert fault(**{column: ''}) == \
        f'2:{COLUMNS.index(column) + 1} ({column}): Item: 1, {column} is missing'


def test_needed_column_that_the_file_does_not_have() -> None:
    mappings, problems = load_text('Tag,Command,Address,Station\na,Read,N7:0,1\n')
    assert mappings == []
    assert str(problems[0]).endswith('map.csv:2 (PLC_Type): Item: 1, PLC_Type is missing')


@pytest.mark.parametrize('column, texts', [
    ('Station', ('0', '254')), ('Length', ('1', '1000')), ('Period', ('0', '86400000')),
    ('Min', ('0', '-3.5', '1e3', '-2,5')), ('Max', ('0', '1e300')), ('Topic', ('x' * 150,))])
def test_both_ends_of_a_range(column: str, texts: tuple[str, ...]) -> None:
    for text in texts:
        mappings, problems = load_rows(row(**{column: f'"{text}"'}))
        assert (len(mappings), problems) == (1, [])


def test_decimal_comma_of_a_limit() -> None:
    assert one(Min='"-2,5"').minimum == -2.5


def test_minimum_above_the_maximum() -> None:
    assert fault(Min='5', Max='4') == '2:11 (Min): Item: 1, Min is greater than Max'
    assert one(Min='5', Max='5').maximum == 5


def test_every_fault_of_a_row_is_reported() -> None:
    texts = faults(row(Station='999', Length='0', Address='??', Period='x', Command='z'))
    assert sorted(text.split(': ')[0] for text in texts) == [
        '2:2 (Command)', '2:3 (Address)', '2:4 (Station)', '2:6 (Length)', '2:9 (Period)']


def test_numbered_faults_are_errors() -> None:
    _, problems = load_rows(row(Station='999', Address='??'), row(PLC_Type='S7'))
    assert sorted(problem.message.number for problem in problems if problem.message) == [
        2501, 2502, 2503]
    assert all(problem.message and problem.message.severity is Severity.ERROR
               for problem in problems)


def test_bad_row_is_left_out_and_the_rest_stays() -> None:
    mappings, problems = load_rows(
        row(Tag='a'), '', row(Tag='b', Station='x'), '# c', row(Tag='d'), row(Tag='e', Min='?'))
    assert [(mapping.tag, mapping.item, mapping.line) for mapping in mappings] == [
        ('a', 1, 2), ('d', 3, 6)]
    assert [str(problem).split('map.csv:')[1].split(' ')[0] for problem in problems] == [
        '4:4', '7:11']
    assert 'Item: 2, ' in str(problems[0])
    assert 'Item: 4, ' in str(problems[1])


def test_bad_file_as_a_whole() -> None:
    with pytest.raises(ConfigurationError, match='did you mean Address'):
        load_text('Tag,Adress\na,N7:0\n')


def test_same_tag_twice() -> None:
    assert faults(row(Tag='Tank.Level'), row(Tag='Tank Level', Topic='other')) == [
        '3:1 (Tag): Item: 2, tag "Tank Level" becomes "Tank_Level", the name of item 1 (line 2,'
        ' tag "Tank.Level")']


def test_two_readers_of_one_topic() -> None:
    assert faults(row(Tag='a', Topic='x.y', Command='Read'), '# c',
                  row(Tag='b', Topic='x:y', Command='Read')) == [
        '4:8 (Topic): Item: 2, read topic "x_y" is the topic of item 1 (line 2, tag "a")']


def test_topic_that_is_the_tag_of_another_row() -> None:
    assert faults(row(Tag='a'), row(Tag='b', Topic='a', Command='Read')) == [
        '3:8 (Topic): Item: 2, read topic "a" is the topic of item 1 (line 2, tag "a")']


def test_row_that_clashes_counts_for_nothing() -> None:
    mappings, problems = load_rows(
        row(Tag='a'), row(Tag='b', Topic='a'), row(Tag='b', Topic='c'))
    assert [(mapping.tag, mapping.topic) for mapping in mappings] == [('a', 'a'), ('b', 'c')]
    assert len(problems) == 1


def test_one_topic_may_be_read_and_written_by_different_rows() -> None:
    mappings, problems = load_rows(
        row(Tag='a', Topic='t', Command='Read'),
        row(Tag='b', Topic='t', Command='Write', Address='N7:9', Type='uint16'))
    assert (len(mappings), problems) == (2, [])


def test_write_topic_fans_out_to_addresses_of_several_stations() -> None:
    mappings, problems = load_rows(
        row(Tag='a', Topic='t', Command='Write'),
        row(Tag='b', Topic='t', Command='Write', Station='2'),
        row(Tag='c', Topic='t', Command='ReadWrite', Address='N7:50', PLC_Type='SLC'))
    assert ([mapping.topic for mapping in mappings], problems) == (['t'] * 3, [])


@pytest.mark.parametrize('cells', [{'Length': '2'}, {'Type': 'uint16'}])
def test_write_topic_has_one_type_and_length(cells: dict[str, str]) -> None:
    assert faults(row(Tag='a', Topic='t', Command='Write'),
                  row(Tag='b', Topic='t', Command='Write', **cells)) == [
        '3:8 (Topic): Item: 2, write topic "t" needs the Type and Length of item 1 (line 2, tag '
        '"a")']


def test_one_address_may_be_read_into_several_topics() -> None:
    mappings, problems = load_rows(row(Tag='a'), row(Tag='b'))
    assert (len(mappings), problems) == (2, [])


@pytest.mark.parametrize('cells', [
    {'Address': 'T4:0'}, {'Address': 'T4:0', 'Length': '3'}, {'Address': 'C5:7'},
    {'Address': 'R6:0', 'PLC_Type': 'SLC'}, {'Address': 'T4:0.ACC', 'Length': '2'},
    {'Address': 'T4:0.PRE', 'Length': '4'}])
def test_control_word_of_a_structure_is_not_writable(cells: dict[str, str]) -> None:
    text = fault(Command='Write', **cells)
    assert text.startswith('2:3 (Address): Item: 1, the control word of ')
    assert text.endswith(
        ' belongs to the processor; write members such as PRE, or single named bits')
    assert one(**cells | {'Command': 'Read'})


@pytest.mark.parametrize('cells', [
    {'Address': 'T4:0.PRE'}, {'Address': 'T4:0.PRE', 'Length': '2'}, {'Address': 'C5:0.ACC'},
    {'Address': 'T4:0/DN'}, {'Address': 'T4:0/DN', 'Length': '3'}, {'Address': 'R6:0/FD'},
    {'Address': 'C5:0/UA'}, {'Address': 'N7:0/0', 'Length': '16'},
    {'Address': 'T4:0.ACC/3'}])
def test_members_and_named_bits_are_writable(cells: dict[str, str]) -> None:
    assert one(Command='Write', **cells).writes


@pytest.mark.parametrize('cells, shown', [
    ({'Address': 'T4:0/0'}, 'T4:0/0'), ({'Address': 'T4:0/12'}, 'T4:0/12'),
    ({'Address': 'T4:0/12', 'Length': '2'}, 'T4:0/12'), ({'Address': 'C5:0/9'}, 'C5:0/9'),
    ({'Address': 'R6:0/7', 'Length': '2'}, 'R6:0/7')])
def test_internal_bits_are_not_writable(cells: dict[str, str], shown: str) -> None:
    assert fault(Command='Write', **cells) == \
        f'2:3 (Address): Item: 1, the bits at {shown} are internal to the processor'
    assert one(**cells | {'Command': 'Read'})


@pytest.mark.parametrize('cells', [
    {'Address': 'N7:999'}, {'Address': 'N7:990', 'Length': '10'},
    {'Address': 'N7:998', 'Type': 'int32'}, {'Address': 'F8:999'},
    {'Address': 'N7:255', 'PLC_Type': 'SLC'}, {'Address': 'T4:999.ACC', 'Command': 'Read'},
    {'Address': 'T4:998', 'Length': '6', 'Command': 'Read'},
    {'Address': 'B3:999/15'}, {'Address': 'B3:998/1', 'Length': '31'},
    {'Address': 'I:277', 'Command': 'Read'}, {'Address': 'S:127'}, {'Address': 'ST9:779'},
    {'Address': 'I:30.255', 'PLC_Type': 'SLC'}])
def test_mapping_at_the_end_of_a_file(cells: dict[str, str]) -> None:
    assert one(**cells)


@pytest.mark.parametrize('cells, length, last', [
    ({'Address': 'N7:990', 'Length': '11'}, 11, 'N7:999'),
    ({'Address': 'N7:999', 'Type': 'int32'}, 1, 'N7:999'),
    ({'Address': 'F8:999', 'Length': '2'}, 2, 'F8:999.1'),
    ({'Address': 'N7:250', 'Length': '7', 'PLC_Type': 'SLC'}, 7, 'N7:255'),
    ({'Address': 'T4:999', 'Length': '4', 'Command': 'Read'}, 4, 'T4:999.ACC'),
    ({'Address': 'B3:998/1', 'Length': '32'}, 32, 'B3:999'),
    ({'Address': 'I:277', 'Length': '2', 'Command': 'Read'}, 2, 'I:277'),
    ({'Address': 'S:127', 'Length': '2'}, 2, 'S2:127'),
    ({'Address': 'I:30.255', 'Length': '2', 'PLC_Type': 'SLC'}, 2, 'I:30.255')])
def test_mapping_over_the_end_of_a_file(cells: dict[str, str], length: int, last: str) -> None:
    text = fault(**cells)
    assert text.startswith(
        '2:6 (Length): 2504 ERR_ADDRESS_RANGE: Item: 1, Address is out of range '
        f'({cells["Address"]}, len={length}); the last word there can be is ')
    assert text.endswith(last) or last == 'F8:999.1'


def test_bits_of_a_structure_end_with_their_word() -> None:
    assert fault(Address='T4:0/13', Length='4', Command='Read') == (
        '2:6 (Length): 2504 ERR_ADDRESS_RANGE: Item: 1, Address is out of range (T4:0/13, '
        'len=4); bits of a structure end with their word')
    assert one(Address='T4:0/13', Length='3', Command='Read')


def test_string_mapping_is_one_string() -> None:
    assert fault(Address='ST9:0', Length='2') == \
        '2:6 (Length): Item: 1, a string mapping has Length 1'


def test_codec_of_a_bit_mapping_begins_at_its_bit() -> None:
    codec = one(Address='B3:2/5', Length='20').codec
    assert (codec.bit, codec.length, codec.words) == (5, 20, 2)


def test_cells_as_text_with_defaults_filled_in() -> None:
    mapping = one(Tag='Line speed', Command='read', Address='n7;3', Station='07')
    assert {column: mapping.cell(column) for column in COLUMNS} == {
        'Tag': 'Line speed', 'Command': 'Read', 'Address': 'N7:3', 'Station': '7',
        'PLC_Type': 'PLC5', 'Length': '1', 'Type': 'int16', 'Topic': 'Line_speed', 'Period': '',
        'Publish': 'Always', 'Min': '', 'Max': ''}


@pytest.mark.parametrize('text, cell', [
    ('0', '0'), ('-5', '-5'), ('0.1', '0.1'), ('1000000', '1000000'),
    ('2147483647', '2147483647'), ('-3.25', '-3.25'), ('1234567.5', '1234567.5')])
def test_limits_as_text_lose_nothing(text: str, cell: str) -> None:
    assert one(Max=text).cell('Max') == cell
    assert replace(one(), minimum=float(text)).cell('Min') == cell


def test_period_of_zero_is_not_the_default() -> None:
    assert one(Period='0').period == 0
    assert one(Period='0').cell('Period') == '0'


def test_shipped_file_is_good() -> None:
    path = Path(__file__).resolve().parent.parent.parent / 'config' / 'map.csv'
    mappings, problems = load_mappings(str(path))
    assert (len(mappings), problems) == (10, [])
