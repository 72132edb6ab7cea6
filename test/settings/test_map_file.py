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

"""The map CSV as a whole: rows that clash, and rows that are left out."""

from pathlib import Path

from abdf1_ros.pccc.values import ValueType
from abdf1_ros.settings.map_file import load_mappings
from support.cases import for_all
from support.mappings import fault, faults, load_rows, row


def test_bad_row_is_left_out_and_the_rest_stays() -> None:
    mappings, problems = load_rows(
        row(Tag='a'), '', row(Tag='b', Station='x'), '# c', row(Tag='d'), row(Tag='e', Min='?'))
    assert [(mapping.tag, mapping.item, mapping.place.line) for mapping in mappings] == [
        ('a', 1, 2), ('d', 3, 6)]
    assert [str(problem).split('map.csv:')[1].split(' ')[0] for problem in problems] == [
        '4:4', '7:11']
    assert 'Item: 2, ' in str(problems[0])
    assert 'Item: 4, ' in str(problems[1])


def test_row_that_clashes_counts_for_nothing() -> None:
    mappings, problems = load_rows(
        row(Tag='a'), row(Tag='b', Topic='a'), row(Tag='b', Topic='c'),
        row(Tag='a', Command='Heartbeat', Address='N7:9'),
        row(Tag='d', Command='Write', Address='N7:9'))
    assert [(mapping.tag, mapping.topic) for mapping in mappings] == [
        ('a', 'a'), ('b', 'c'), ('d', 'd')]
    assert len(problems) == 2


def test_write_topic_of_engineering_values_fans_out_to_different_raw_types() -> None:
    mappings, problems = load_rows(
        row(Tag='a', Topic='t', Command='Write', Scale='0.1'),
        row(Tag='b', Topic='t', Command='Write', Type='uint16', Scale='0.5', Offset='-10'),
        row(Tag='c', Topic='t', Command='Write', Address='F8:0'))
    assert ([mapping.message_type for mapping in mappings], problems) == (
        [ValueType.FLOAT32] * 3, [])


def test_shipped_file_is_good() -> None:
    path = Path(__file__).resolve().parent.parent.parent / 'config' / 'map.csv'
    mappings, problems = load_mappings(str(path))
    assert (len(mappings), problems) == (10, [])


def test_two_stations_behind_one_gateway() -> None:
    mappings, problems = load_rows(
        row(Station='1', Via='10'), row(Tag='b', Topic='b', Station='10'),
        row(Tag='c', Topic='c', Station='2', Via='10'),
        row(Tag='d', Topic='d', Station='4', Via='4'))
    assert problems == []
    assert [mapping.via for mapping in mappings] == [10, None, 10, None]


@for_all(('cells', 'text'), [
    ({'Via': '255'}, 'Via = "255" should be a whole number from 0 to 254'),
    ({'Via': 'KF3'}, 'Via = "KF3" should be a whole number from 0 to 254'),
    ({'Via': '3', 'Command': 'Serve'}, 'a Serve row has no Via: it is for Read, Write, ReadWrite '
     'and Heartbeat rows; leave the cell empty'),
    ({'Via': '3', 'Command': 'Write', 'Station': '255'},
     'what is written to station 255 goes to the stations of this line only')])
def test_via_that_cannot_be(cells: dict[str, str], text: str) -> None:
    assert text in fault(**cells)


T = {'Topic': 't', 'Command': 'Write'}
SLC = {'PLC_Type': 'SLC', 'Command': 'Read'}
OF_A = ' of item 1 (line 2, tag "a")'
NEEDS = 'Item: 2, write topic "t" needs the message type (int16) and Length (1)' + OF_A


@for_all(('first', 'second', 'text'), [
    ({'Tag': 'a.b'}, {'Tag': 'a b', 'Topic': 'other'}, '3:1 (Tag): Item: 2, tag "a b" becomes '
     '"a_b", the name of item 1 (line 2, tag "a.b")'),
    *(({'Command': command}, {'Tag': 'a', 'Command': command, 'Length': '2'},
       f'3:1 (Tag): Item: 2, tag "a" is already the tag{OF_A}')
      for command in ('Read', 'ReadWrite', 'Write')),
    ({'Topic': 'x.y', 'Command': 'Read'}, {'Topic': 'x:y', 'Command': 'Read'},
     f'3:8 (Topic): Item: 2, read topic "x_y" is the topic{OF_A}'),
    ({'Topic': 'b', 'Command': 'Read'}, {'Command': 'Read'},
     f'3:8 (Topic): Item: 2, read topic "b" is the topic{OF_A}'),
    ({}, {'Topic': 'a', 'Command': 'Read'},
     f'3:8 (Topic): Item: 2, read topic "a" is the topic{OF_A}'),
    (T, T | {'Length': '2'}, f'3:8 (Topic): {NEEDS}'),
    (T, T | {'Type': 'uint16'}, f'3:8 (Topic): {NEEDS}'),
    (T, T | {'Scale': '0.1'}, f'3:8 (Topic): {NEEDS}'),
    (T, T | {'Offset': '0'}, f'3:8 (Topic): {NEEDS}'),
    (SLC | {'Processor': '5/01'}, SLC | {'Processor': 'ML1000'}, '3:17 (Processor): Item: 2, '
     f'Processor of station 1 is ML1000 here, but 5/01 in the row{OF_A}'),
    (SLC, SLC | {'Processor': '5/01'}, '3:17 (Processor): Item: 2, Processor of station 1 is 5/01 '
     f'here, but 5/03 (an empty cell) in the row{OF_A}'),
    ({'Via': '10'}, {'Via': '11'}, '3:23 (Via): Item: 2, station 1 has Via 11 here, but Via 10 in '
     f'the row{OF_A}'),
    ({'Via': '10'}, {}, '3:23 (Via): Item: 2, station 1 has no Via here, but Via 10 in the row'),
    ({}, {'Via': '10'}, 'station 1 has Via 10 here, but no Via in the row'),
    ({'Via': '2'}, {'Station': '2', 'Via': '3'}, 'station 2 is itself the gateway in the row'),
    ({'Via': '2'}, {'Station': '3', 'Via': '1'},
     'station 1 is itself behind the gateway 2 in the row')])
def test_rows_that_clash(first: dict[str, str], second: dict[str, str], text: str) -> None:
    found, = faults(row(**first), row(**{'Tag': 'b', 'Topic': 'b'} | second))
    assert text in found


@for_all('rows', [
    [{'Topic': 't', 'Command': 'Read'}, T | {'Address': 'N7:9', 'Type': 'uint16'}],
    [T, T | {'Station': '2'}, T | {'Command': 'ReadWrite', 'Address': 'N7:50', 'PLC_Type': 'SLC'}],
    [{}, {}], [SLC | {'Processor': 'ML1000'}, {}],
    [SLC, SLC | {'Processor': '5/03'}, {}, SLC | {'Station': '2', 'Processor': '5/01'},
     SLC | {'Station': '255', 'Command': 'Write'},
     SLC | {'Station': '255', 'Command': 'Write', 'Processor': '5/01'}]])
def test_rows_that_do_not_clash(rows: list[dict[str, str]]) -> None:
    mappings, problems = load_rows(*(
        row(**{'Tag': f'tag{number}'} | cells) for number, cells in enumerate(rows)))
    assert (len(mappings), problems) == (len(rows), [])
    assert len(faults(row(Topic='t'), row(Topic='t'))) == 2  # one tag and one topic
