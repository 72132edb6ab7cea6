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

"""The map CSV: rows that clash or are left out, columns, defaults, ranges, texts of errors."""

from dataclasses import fields
import math
from pathlib import Path
import re

from abdf1_ros.errors import FormatError
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.families import dialect_of, parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.values import ValueType, WordOrder
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.columns import COLUMNS
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.mapping import Command, Publish
from abdf1_ros.settings.rows import Rows
from abdf1_ros.settings.scaling import Scaling
import pytest
from support.cases import for_all
from support.mappings import cell_of, fault, faults, load_rows, one, row

SLC, PLC5, PLC2, PLC3 = 'SLC', 'PLC5', 'PLC2', 'PLC3'


def test_bad_row_is_left_out_and_the_rest_stays() -> None:
    mappings, problems = load_rows(
        row(Tag='a'), '', row(Tag='b', Station='x'), '# c', row(Tag='d'), row(Tag='e', Min='?'))
    assert [(mapping.tag, mapping.item, mapping.place.line) for mapping in mappings] == [
        ('a', 1, 2), ('d', 3, 6)]
    assert [str(problem).split('map.csv:')[1].split(' ')[0] for problem in problems] == [
        '4:4', '7:11']
    assert 'Item: 2, ' in str(problems[0])
    assert 'Item: 4, ' in str(problems[1])


@for_all(('first', 'second'), [
    ({'Period': '1s'}, {'Address': 'N7:5'}), ({'Topic': 'a'}, {}), ({'Tag': 'b.'}, {'Min': '?'}),
    ({'Length': '0'}, {'Station': 'x'})])
def test_tag_of_a_bad_row_is_no_tag_of_a_later_row(
        first: dict[str, str], second: dict[str, str]) -> None:
    first, second = ({'Tag': 'b', 'Topic': ''} | cells for cells in (first, second))
    mappings, problems = load_rows(row(Tag='a', Topic='a'), row(**first), row(**second))
    said = [str(problem) for problem in problems if '4:1 (Tag)' in str(problem)]
    assert [text.partition(', tag')[0].partition(': ')[2] for text in said] == ['Item: 3']
    assert 'of item 2 (line 3, tag "b' in said[0]
    assert [mapping.tag for mapping in mappings] == ['a'] + ['b.'] * ('b.' in first.values())


def test_row_that_clashes_has_no_topic_and_no_words() -> None:
    mappings, problems = load_rows(
        row(Tag='a'), row(Tag='b', Topic='a'), row(Tag='c', Topic='c'),
        row(Tag='a', Command='Heartbeat', Address='N7:9'),
        row(Tag='d', Command='Write', Address='N7:9'))
    assert [(mapping.tag, mapping.topic) for mapping in mappings] == [
        ('a', 'a'), ('c', 'c'), ('d', 'd')]
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
    ({'Via': '8.0'}, 'Via = "8.0" should be a whole number from 0 to 254: 8'),
    ({'Via': '255.0'}, 'Via = "255.0" should be a whole number from 0 to 254'),
    ({'Via': '255'}, 'Via = "255" should be a whole number from 0 to 254'),
    ({'Via': 'KF3'}, 'Via = "KF3" should be a whole number from 0 to 254'),
    ({'Via': '3', 'Command': 'Serve'}, 'a Serve row has no Via: it is for Read, Write, ReadWrite '
     'and Heartbeat rows; leave the cell empty'),
    ({'Via': '3', 'Command': 'Write', 'Station': '255'},
     'what is written to station 255 goes to the stations of this line only')])
def test_via_that_cannot_be(cells: dict[str, str], text: str) -> None:
    assert text in fault(**cells)


T = {'Topic': 't', 'Command': 'Write'}
READ = {'PLC_Type': 'SLC', 'Command': 'Read'}
SERVE = {'Command': 'Serve'}
OF_A = ' of item 1 (line 2, tag "a")'
NEEDS = 'Item: 2, write topic "t" needs the message type (int16) and Length (1)' + OF_A


@for_all(('first', 'second', 'text'), [
    ({'Tag': 'a.b'}, {'Tag': 'a b', 'Topic': 'other'}, '3:1 (Tag): Item: 2, tag "a b" becomes '
     '"a_b", the name of item 1 (line 2, tag "a.b")'),
    *(({'Command': command}, {'Tag': 'a', 'Topic': '', 'Command': command, 'Length': '2'},
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
    (READ | {'Processor': '5/01'}, READ | {'Processor': 'ML1000'}, '3:17 (Processor): Item: 2, '
     f'Processor of station 1 is ML1000 here, but 5/01 in the row{OF_A}'),
    (READ, READ | {'Processor': '5/01'}, '3:17 (Processor): Item: 2, Processor of station 1 is '
     f'5/01 here, but 5/03 (an empty cell) in the row{OF_A}'),
    ({'Via': '0'}, {'Via': '11'}, '3:23 (Via): Item: 2, station 1 has Via 11 here, but Via 0 in '
     f'the row{OF_A}'),
    ({'Via': '10', 'Command': 'Write'}, {}, 'station 1 has no Via here, but Via 10 in the row'),
    ({}, {'Via': '10'}, 'station 1 has Via 10 here, but no Via in the row'),
    ({'Via': '2'}, {'Station': '2', 'Via': '0'}, 'station 2 is itself the gateway in the row'),
    ({'Via': '0'}, {'Station': '0', 'Via': '3'}, 'station 0 is itself the gateway in the row'),
    ({'Via': '0'}, {'Station': '3', 'Via': '1'}, 'station 1 is itself behind the gateway 0 in')])
def test_rows_that_clash(first: dict[str, str], second: dict[str, str], text: str) -> None:
    found, = faults(row(**first), row(**{'Tag': 'b', 'Topic': 'b'} | second))
    assert text in found


@for_all('rows', [
    [{'Topic': 't', 'Command': 'Read'}, T | {'Address': 'N7:9', 'Type': 'uint16'}],
    [T, T | {'Station': '2'}, T | {'Command': 'ReadWrite', 'Address': 'N7:50', 'PLC_Type': 'SLC'}],
    [{}, {}], [READ | {'Processor': 'ML1000'}, {}],
    [READ | cells for cells in (SERVE, {'Via': '10', 'Processor': 'ML1000'}, SERVE)],
    [READ, READ | {'Processor': '5/03'}, {}, READ | {'Station': '2', 'Processor': '5/01'},
     READ | {'Station': '255', 'Command': 'Write'},
     READ | {'Station': '255', 'Command': 'Write', 'Processor': '5/01'}]])
def test_rows_that_do_not_clash(rows: list[dict[str, str]]) -> None:
    mappings, problems = load_rows(*(
        row(**{'Tag': f'tag{number}'} | cells) for number, cells in enumerate(rows)))
    assert (len(mappings), problems) == (len(rows), [])
    assert len(faults(row(Topic='t'), row(Topic='t'))) == 2  # one tag and one topic


# One row


def test_row_with_every_column() -> None:
    mapping = one(Tag='Line speed', Command='readwrite', Address='n7:10', Station='254',
                  PLC_Type='slc', Length='4', Type='FLOAT32', Topic='cell/1 speed', Period='250',
                  Publish='change', Min='-1.5', Max='99', Description='"Roller, hall 3"')
    expected = {
        'item': 1, 'tag': 'Line speed', 'name': 'Line_speed', 'command': Command.READ_WRITE,
        'station': 254, 'plc_type': PlcType.SLC, 'length': 4, 'type': ValueType.FLOAT32,
        'topic': 'cell/t1_speed', 'period': 250, 'publish': Publish.CHANGE, 'minimum': -1.5,
        'maximum': 99.0, 'access': Access.SLOT, 'description': 'Roller, hall 3'}
    others = {'place', 'address', 'remarks'}
    assert {field.name: getattr(mapping, field.name) for field in fields(mapping)
            if field.init and field.name not in others} == {
        field.name: expected.get(field.name, field.default) for field in fields(mapping)
        if field.init and field.name not in others}
    assert str(mapping.address) == 'N7:10'


@for_all(('family', 'meant'), [
    ('PLC-5', PLC5), ('SLC 5/03', SLC), ('slc-500', SLC), ('MicroLogix', SLC)])
@for_all(('kind', 'right'), [
    ('DINT', 'int32'), ('Long', 'int32'), ('REAL', 'float32'), ('float', 'float32'),
    ('Word', 'uint16'), ('DWord', 'uint32'), ('INT', 'int16'), ('Bit', 'bool')])
def test_families_and_types_have_the_names_of_the_field(
        family: str, meant: str, kind: str, right: str) -> None:
    address = 'N7:0/0' if right == 'bool' else 'N7:0'
    mapping = one(Command='Read', Address=address, PLC_Type=family, Type=kind)
    assert (str(mapping.plc_type), mapping.type.value) == (meant, right)


@for_all(('family', 'processor', 'expected'), [
    ('MicroLogix 1400', '', Processor.ML1400), ('ML1100', '', Processor.ML1100),
    ('MLX1200', '', Processor.ML1200), ('SLC 5/04', '', Processor.SLC_5_04),
    ('1747-L532', '', Processor.SLC_5_03), ('1766-L32BXB', '', Processor.ML1400),
    ('1761-L32BWA', '', Processor.ML1000), ('SLC 5/04', '5/05', Processor.SLC_5_05),
    ('MicroLogix', '', None), ('SLC', '', None), ('PLC-5/40', '', None)])
def test_model_in_plc_type_is_the_processor(
        family: str, processor: str, expected: Processor | None) -> None:
    assert one(PLC_Type=family, Processor=processor).processor is expected
    served = one(PLC_Type=family, Command='Serve')
    assert served.processor is None


def test_file_of_the_model_in_plc_type_has_no_remark() -> None:
    cells = {'Command': 'Read', 'Address': 'L9:0'}
    assert one(PLC_Type='MicroLogix 1400', **cells).remarks == ()
    assert '5/04 has no file L9; ML1100, ML1200, ML1400' in fault(PLC_Type='SLC 5/04', **cells)


@for_all(('text', 'reads', 'writes'), [
    ('Read', True, False), ('Write', False, True), ('ReadWrite', True, True),
    ('READ', True, False), ('write', False, True), ('R/W', True, True), ('rw', True, True),
    ('Read/Write', True, True)])
def test_command_says_whether_a_row_reads_and_writes(text: str, reads: bool, writes: bool) -> None:
    mapping = one(Command=text)
    assert (mapping.reads, mapping.writes) == (reads, writes)


@for_all(('cells', 'expected'), [
    ({'Station': '255'},
     '4 (Station): 2501 ERR_BAD_STATION: Item: 1, Invalid station number (255) must be less than '
     '255'),
    ({'Station': 'PLC', 'Command': 'Read', 'While': 'run'}, '4 (Station): 2501 ERR_BAD_STATION: '
     'Item: 1, Station = "PLC" should be a whole number from 0 to 254'),
    ({'PLC_Type': 'S7'},
     '5 (PLC_Type): 2502 ERR_BAD_PLC_TYPE: Item: 1, Invalid or Unsupported PLC Type (S7) should '
     'be one of PLC2, PLC3, PLC5, SLC; a MicroLogix is SLC'),
    ({'PLC_Type': 'Micro850'},
     '5 (PLC_Type): 2502 ERR_BAD_PLC_TYPE: Item: 1, Invalid or Unsupported PLC Type (Micro850) '
     'should be one of PLC2, PLC3, PLC5, SLC; a Micro800 has no DF1 commands; it has Modbus RTU'),
    ({'Address': 'N7'}, '3 (Address): 2503 ERR_ADDRESS_SYNTAX: Item: 1, Invalid Address Syntax '
     '(N7); an element is missing, as in N7:0'),
    *(({'Address': 'N7:2000', 'Length': cell}, '3 (Address): 2504 ERR_ADDRESS_RANGE: Item: 1, '
       f'Address is out of range (N7:2000, len={told}); elements of N run from 0 to 1999')
      for cell, told in (('', 1), ('3', 3))),
    ({'Address': '018', 'PLC_Type': 'PLC2'}, '3 (Address): 2503 ERR_ADDRESS_SYNTAX: Item: 1, '
     'Invalid Address Syntax (018); PLC-2 words and bits are octal, as in 020 or 110/17'),
    ({'Command': 'Poll'}, '2 (Command): Item: 1, Command = "Poll" should be one of '
     + ', '.join(command.value for command in Command)),
    ({'Publish': 'Never'}, '10 (Publish): Item: 1, Publish = "Never" should be one of Always, '
     'Change'),
    ({'Type': 'int8'}, '7 (Type): Item: 1, Type = "int8" should be one of bool, int16, uint16, '
     'int32, uint32, float32, bcd16, bcd12, string'),
    ({'Length': '0'}, '6 (Length): Item: 1, Length = "0" should be a whole number from 1 to '
     '65535'),
    ({'Period': '86400001'}, '9 (Period): Item: 1, Period = "86400001" should be a whole number '
     'from 0 to 86400000 ms, or "on demand"'),
    ({'Min': 'low'}, '11 (Min): Item: 1, Min = "low" should be a number'),
    ({'Min': '1_000'}, '11 (Min): Item: 1, Min = "1_000" should be a number'),
    ({'Min': '\u0661'}, '11 (Min): Item: 1, Min = "\u0661" should be a number; '
     'character 1 is U+0661 ARABIC-INDIC DIGIT ONE'),
    ({'Max': 'inf'}, '12 (Max): Item: 1, Max = "inf" should be a number'),
    ({'Max': '1e999'}, '12 (Max): Item: 1, Max = "1e999" should be a number'),
    ({'Tag': '--'}, '1 (Tag): Item: 1, Tag = "--" has no letter or digit'),
    ({'Topic': '/'}, '8 (Topic): Item: 1, Topic = "/" has no letter or digit'),
    ({'Topic': 'x' * 151}, '8 (Topic): Item: 1, Topic has 151 characters, at most 150 are '
     'allowed'),
    *(({column: ''}, f'{COLUMNS.index(column) + 1} ({column}): Item: 1, {column} is missing')
      for column in ('Tag', 'Command', 'Address', 'Station', 'PLC_Type')),
    # Cells that do not fit each other.
    ({'Address': 'F8:0', 'Type': 'int16'}, '7 (Type): Item: 1, F8:0 can be float32'),
    *(({'Address': address, 'Type': 'string'},
       f'7 (Type): Item: 1, {address} can be {types}, bcd12, int32, uint32, float32')
      for address, types in (('B3:0', 'uint16, int16, bcd16'), ('D9:0', 'bcd16, uint16, int16'))),
    ({'Type': 'bool'}, '7 (Type): Item: 1, N7:0 can be int16, uint16, bcd16, bcd12, int32, '
     'uint32, float32, string; a bool needs a bit address such as B3:0/5'),
    ({'Address': 'B3:0/5', 'Type': 'int16'},
     '7 (Type): Item: 1, B3:0/5 can be bool: it is a bit; its word is B3:0'),
    ({'Address': 'T4:0.DN', 'Type': 'int16'}, '7 (Type): Item: 1, T4:0/DN can be bool: it is a '
     'bit; the values of this element are T4:0.PRE, T4:0.ACC'),
    *(({'Address': 'ST9:0', column: '4'},
       f'{number} ({column}): Item: 1, a string has no {column}; leave the cell empty')
      for number, column in ((11, 'Min'), (12, 'Max'))),
    ({'Address': 'ST9:0', 'Length': '2'},
     '6 (Length): Item: 1, a string mapping has Length 1: give each string its own address'),
    *(({'Min': '5', 'Max': '4'} | scale, '11 (Min): Item: 1, Min is greater than Max')
      for scale in ({}, {'Scale': '0.1'})),
    ({'Address': 'T4:0/13', 'Length': '4', 'Command': 'Read'},
     '6 (Length): 2504 ERR_ADDRESS_RANGE: Item: 1, Address is out of range (T4:0/13, len=4); bits '
     'of a structure end with their word'),
    ({'Address': 'PD9:0.SP', 'Length': '25', 'Command': 'Read'},
     '6 (Length): Item: 1, 25 float32 from PD9:0.SP reach to PD9:0.50, where words of 16 bits '
     'are'),
    ({'Address': 'HSC:0-1', 'PLC_Type': 'SLC', 'Command': 'Read'}, '3 (Address): Item: 1, 36 '
     'int16 from HSC:0 reach to HSC:0.ACC, where int32 values are'),
    ({'Address': 'MG9:0/EN', 'Command': 'Write'}, '3 (Address): Item: 1, MG9:0/EN belongs to the '
     'processor; of such an element can be written: TO, CO'),
    ({'Address': 'F8:0', 'Word_Order': 'High'}, '13 (Word_Order): Item: 1, Word_Order High is for '
     'int32, uint32 and float32 over words of 16 bits such as N7:0, not for float32 at F8:0'),
    ({'Word_Order': 'High'}, '13 (Word_Order): Item: 1, Word_Order High is for int32, uint32 and '
     'float32 over words of 16 bits such as N7:0, not for int16 at N7:0'),
    ({'Scale': '-0.0', 'Offset': '2'}, '14 (Scale): Item: 1, Scale should not be 0'),
    ({'Scale': 'x'}, '14 (Scale): Item: 1, Scale = "x" should be a number'),
    ({'Offset': '"1,000"'},
     '15 (Offset): Item: 1, Offset = "1,000" could be two numbers; write 1000 or 1.000'),
    ({'Address': 'B3:0/4', 'Scale': '2'},
     '14 (Scale): Item: 1, Scale and Offset are for numbers, not for bool'),
    ({'Offset': '1e9'},
     '15 (Offset): Item: 1, a float32 has too few digits to tell the values apart in 999967232 '
     'to 1000032767, the range of int16 with Scale 1, Offset 1000000000'),
    *(({'Access': access},
       f'16 (Access): Item: 1, Access = "{access}" of a PLC5 should be one of Typed, WordRange')
      for access in ('CIF', 'Read')),
    ({'Access': 'Typed', 'Command': 'Serve'}, '16 (Access): Item: 1, Access = "Typed" of a Serve '
     'row should be Read, for words that the other end cannot write, or empty'),
    *(({'PLC_Type': 'PLC2', 'Access': 'CIF'} | place, '3 (Address): Item: 1, Access CIF has no '
       'command that changes single bits; write the whole word, or only read')
      for place in ({'Address': '020/05'}, {'Address': '020', 'Type': 'bcd12'})),
    ({'PLC_Type': 'SLC', 'Processor': '5/06'}, '17 (Processor): Item: 1, Processor = "5/06" '
     'should be one of 5/01, 5/02, 5/03, 5/04, 5/05, ML1000, ML1100, ML1200, ML1400, ML1500'),
    ({'Processor': '5/03'}, '17 (Processor): Item: 1, Processor is for PLCs of type SLC that we '
     'read or write; leave the cell empty'),
    ({'PLC_Type': 'SLC', 'Processor': '5/03', 'Command': 'Serve'}, '17 (Processor): Item: 1, a '
     'Serve row has no Processor: it is for Read, Write, ReadWrite and Heartbeat rows; leave the '
     'cell empty'),
    ({'PLC_Type': 'SLC', 'Processor': '5/05', 'Address': 'L10:0'}, '3 (Address): Item: 1, 5/05 '
     'has no file L10; ML1100, ML1200, ML1400, ML1500 may have it'),
    ({'PLC_Type': 'SLC', 'Processor': 'ML1000', 'Address': 'N10:0/3'}, '3 (Address): Item: 1, '
     'ML1000 has no file N10; 5/01, 5/02, 5/03, 5/04, 5/05, ML1100, ML1200, ML1400, ML1500 may '
     'have it')])
def test_fault_is_told_word_for_word(cells: dict[str, str], expected: str) -> None:
    assert fault(**cells) == f'2:{expected}'


@for_all(('cells', 'length', 'last'), [
    ({'Address': 'N7:1990'}, 10, 'N7:1999'), ({'Address': 'F8:1999'}, 1, 'F8:1999'),
    ({'Address': 'N7:250', 'PLC_Type': 'SLC'}, 6, 'N7:255'),
    ({'Address': 'T4:1999', 'Command': 'Read'}, 3, 'T4:1999.ACC'),
    ({'Address': 'B3:1998/1'}, 31, 'B3:1999'), ({'Address': 'S:127'}, 1, 'S2:127'),
    ({'Address': 'I:277', 'Command': 'Read'}, 1, 'I:277'),
    ({'Address': 'I:30.255', 'PLC_Type': 'SLC'}, 1, 'I:30.255'),
    ({'Address': '077777', 'PLC_Type': 'PLC2'}, 1, '077777')])
def test_mapping_ends_with_its_file(cells: dict[str, str], length: int, last: str) -> None:
    assert one(**cells, Length=str(length))
    assert fault(**cells, Length=str(length + 1)) == (
        '2:6 (Length): 2504 ERR_ADDRESS_RANGE: Item: 1, Address is out of range '
        f'({cells["Address"]}, len={length + 1}); the last word there can be is {last}')


def test_cells_that_just_fit() -> None:
    assert one(Min='5', Max='5').maximum == 5
    assert one(Address='T4:0/13', Length='3', Command='Read')
    assert one(Address='F8:0', Word_Order='Low').word_order is WordOrder.LOW
    assert one(PLC_Type='PLC2', Address='020/05', Access='CIF', Command='Read')
    assert one(Address='N7:998', Type='int32') and one(Address='T4:0.PRE', Type='uint16')


LONG = 'x' * 5000


@for_all(('cells', 'text'), [
    ({'Command': LONG}, 'Command = "{}" should be one of Read'),
    ({'Station': LONG}, 'Item: 1, Station = "{}" should'),
    ({'PLC_Type': LONG}, 'PLC Type ({}) should be one of PLC2'),
    ({'Address': LONG}, 'Invalid Address Syntax ({}); an address has at most 100'),
    ({'Command': 'Write', 'Fallback': LONG, 'Fallback_After': '500'}, '"{}"'),
    ({'Command': 'Write', 'Fallback': '0', 'Fallback_After': LONG}, '"{}"'),
    ({'Command': 'Read', 'While': LONG}, '"{}"'),
    ({'Command': 'Heartbeat', 'While': 'a', 'While_Timeout': '9' * 5000}, f'"{100 * "9"}..."'),
    # In advice, too.
    ({'Length': "'" + '9' * 5000}, ''), ({'Min': f'"{"1" * 5000},000"'}, ''),
    ({'Address': f'T4:0.{80 * "x"}'}, '')])
def test_long_cell_is_shown_without_its_end(cells: dict[str, str], text: str) -> None:
    told = faults(row(**cells))
    assert text.format('x' * 100 + '...') in told[0]
    assert all(len(shown) < 600 for shown in told)


def test_remark_on_a_long_cell_is_without_its_end() -> None:
    remark, = one(Topic='a' + ' ' * 5000 + 'b').remarks
    assert len(str(remark)) < 500


@for_all(('column', 'texts'), [
    ('Station', ('0', '254')), ('Length', ('1', '1000')), ('Period', ('0', '86400000')),
    ('Min', ('0', '-3.5', '1e3', '-2,5')), ('Max', ('0', '1e300')), ('Topic', ('x' * 150,))])
def test_both_ends_of_a_range(column: str, texts: tuple[str, ...]) -> None:
    for text in texts:
        mappings, problems = load_rows(row(**{column: f'"{text}"'}))
        assert (len(mappings), problems) == (1, [])


@for_all('plc', ['PLC5', 'SLC'])
@for_all('address', ['A10:2', 'N7:2'])
def test_string_over_words_counts_words(address: str, plc: str) -> None:
    mapping = one(Address=address, PLC_Type=plc, Type='string', Length='20')
    assert (mapping.codec.words, mapping.codec.packed) == (20, True)
    assert mapping.codec.decode(mapping.codec.encode('odd')) == 'odd'
    assert not one(Address='ST9:0').codec.packed


@for_all('cells', [
    {'Address': 'N7:0', 'Type': 'int32'}, {'Address': 'N7:0', 'Type': 'uint32'},
    {'Address': 'B3:0', 'Type': 'float32'}, {'Address': 'D9:0', 'Type': 'float32'},
    {'Address': 'S:0', 'Type': 'int32'}, {'Address': 'A9:0', 'Type': 'int32'},
    {'Address': 'O:001', 'Type': 'uint32', 'Command': 'Serve'}])
def test_word_order_is_high_where_the_cell_says_so_and_low_without_it(
        cells: dict[str, str]) -> None:
    mapping = one(Word_Order='high', **cells)
    assert mapping.word_order is mapping.codec.word_order is WordOrder.HIGH
    assert cell_of(mapping, 'Word_Order') == 'High'
    low = one(**cells)
    assert low.word_order is low.codec.word_order is WordOrder.LOW
    assert mapping != low


@for_all(('cells', 'scaling'), [
    ({'Scale': '0.1'}, Scaling(0.1, 0.0)), ({'Offset': '-40'}, Scaling(1.0, -40.0)),
    ({'Scale': '-2', 'Offset': '1e3'}, Scaling(-2.0, 1000.0)),
    ({'Scale': '"0,25"', 'Offset': '0'}, Scaling(0.25, 0.0)),
    ({'Scale': '1'}, Scaling(1.0, 0.0)), ({}, None)])
def test_scale_or_offset_make_the_message_float32(
        cells: dict[str, str], scaling: Scaling | None) -> None:
    mapping = one(**cells)
    assert mapping.scaling == scaling
    assert (cell_of(mapping, 'Scale'), cell_of(mapping, 'Offset')) == (
        (f'{scaling.scale:g}', f'{scaling.offset:g}') if scaling else ('', ''))
    assert mapping.type is ValueType.INT16
    assert mapping.message_type is (ValueType.FLOAT32 if scaling else ValueType.INT16)


# Families and access


@for_all(('plc', 'text', 'access'), [
    ('PLC2', '', 'Unprotected'), ('PLC2', 'protected', 'Protected'), ('PLC2', 'cif', 'CIF'),
    ('PLC3', '', 'WordRange'), ('PLC5', '', 'Typed'), ('PLC5', 'WORDRANGE', 'WordRange'),
    ('SLC', '', 'Slot'), ('SLC', 'flat', 'Flat')])
def test_access_chooses_the_dialect(plc: str, text: str, access: str) -> None:
    mapping = one(PLC_Type=plc, Address='020' if plc == 'PLC2' else 'N7:0', Access=text)
    assert (mapping.access, cell_of(mapping, 'Access')) == (Access(access), access)
    assert mapping.dialect is dialect_of(PlcType(plc), Access(access))


# Structures, flat I/O and processors


def test_io_by_the_word_of_the_image() -> None:
    mapping = one(PLC_Type='SLC', Address='i:5/3', Access='Flat', Command='Read')
    assert (cell_of(mapping, 'Address'), mapping.address.is_flat) == ('I:5/3', True)
    text = fault(PLC_Type='SLC', Address='I:1.0', Access='Flat', Command='Read')
    assert text.endswith('with access Flat write the word of the whole image, as in I:5 or O:0/3')


@for_all('processor', Processor)
def test_processor_chooses_the_dialect(processor: Processor) -> None:
    mapping = one(PLC_Type='SLC', Processor=processor.value.lower())
    assert (mapping.processor, cell_of(mapping, 'Processor')) == (processor, processor.value)
    assert mapping.dialect is dialect_of(PlcType.SLC, None, processor)


def test_slc_without_a_processor_is_taken_for_a_5_03() -> None:
    mapping = one(PLC_Type='SLC', Address='L10:0', Type='uint32')  # or for a MicroLogix
    assert (mapping.processor, cell_of(mapping, 'Processor')) == (None, '')
    assert mapping.dialect is dialect_of(PlcType.SLC, None, Processor.SLC_5_03)


@for_all('place', ['T4:1', 'C5:1', 'R6:1', 'MG9:0/EN'])
def test_structures_that_we_serve_are_ours_to_write(place: str) -> None:
    assert str(one(Command='Serve', Address=place, Station='5').address).startswith(place[:4])
    assert 'belongs to the processor' in fault(Command='ReadWrite', Address=place)
    assert cell_of(one(Command='Serve', Station='5', Access='read'), 'Access') == 'Read'


def test_row_on_demand_has_no_period_and_promises_nothing() -> None:
    row = one(Period=' On  Demand', Command='Read')
    assert (row.is_on_demand, row.period, row.promise(3.0)) == (True, None, math.inf)
    assert cell_of(row, 'Period') == 'on demand'
    assert one(Publish='Change', Max_Silence='500').promise(3.0) == 3.5


@for_all(('cells', 'expected'), [
    ({'Command': 'Read'}, 'a Read row has no Write_Again: it is for Write and ReadWrite rows'),
    ({'Command': 'Heartbeat'}, 'a Heartbeat row has no Write_Again'),
    ({'Command': 'Write', 'Station': '255'}, 'no station confirms what is written to 255'),
    ({'Command': 'Write', 'Write_Again': '1'}, 'should be ms from 100 to 3600000'),
    *(({'Period': 'on demand', 'Command': command, 'Station': '5'},
       'Period "on demand" is for Read and ReadWrite rows') for command in ('Serve', 'Write')),
    ({'Period': 'on demand', 'Command': 'Heartbeat'},
     'Period = "on demand" should be ms from 100 to 60000'),
    ({'Period': 'on demand', 'Publish': 'Change'},
     'a row with Period "on demand" is published each time it is read; leave the cell empty'),
    *(({'Period': 'on demand', 'Address': 'B3:0/0', 'Command': 'Read', column: cell},
       f'{column} needs a row that is read again and again, not one with Period "on demand"')
      for column, cell in (('Alarm', 'WARN'), ('Confirms', 'beat')))])
def test_what_write_again_is_for_and_a_row_on_demand_cannot_have(
        cells: dict[str, str], expected: str) -> None:
    cells = cells if 'Period' in cells else {'Write_Again': '1000'} | cells
    assert any(expected in text for text in faults(row(**cells)))


# Ranges: what each form of an address means, and that each advice reads back as what it says


@for_all(('family', 'text', 'first', 'length', 'last'), [
    (SLC, 'N7:0-9', 'N7:0', 10, 'N7:9'), (SLC, 'N7:0 - N7:9', 'N7:0', 10, 'N7:9'),
    (SLC, 'n7:0..9', 'N7:0', 10, 'N7:9'), (SLC, 'N7:0...N7:9', 'N7:0', 10, 'N7:9'),
    (SLC, 'N7:5 to N7:9', 'N7:5', 5, 'N7:9'), (SLC, 'N7:5-5', 'N7:5', 1, 'N7:5'),
    (SLC, 'B3:1/0-7', 'B3:1/0', 8, 'B3:1/7'), (SLC, 'B3:1/8-15', 'B3:1/8', 8, 'B3:1/15'),
    (SLC, 'B3:1/0-B3:1/3', 'B3:1/0', 4, 'B3:1/3'), (SLC, 'B3:5/0-3', 'B3:5/0', 4, 'B3:5/3'),
    (SLC, 'N7:3/0-3', 'N7:3/0', 4, 'N7:3/3'), (SLC, 'B3/0-7', 'B3:0/0', 8, 'B3:0/7'),
    (SLC, 'B3/24-35', 'B3:1/8', 12, 'B3:2/3'), (SLC, 'T4:0/DN-T4:0/EN', 'T4:0/DN', 3, 'T4:0/EN'),
    (SLC, 'T4:0-3', 'T4:0', 12, 'T4:3.ACC'), (SLC, 'T4:2-2', 'T4:2', 3, 'T4:2.ACC'),
    (SLC, 'T4:0.PRE-T4:0.ACC', 'T4:0.PRE', 2, 'T4:0.ACC'), (SLC, 'F8:0-3', 'F8:0', 4, 'F8:3'),
    (SLC, 'L9:1-2', 'L9:1', 2, 'L9:2'), (SLC, 'S:37-42', 'S2:37', 6, 'S2:42'),
    (SLC, 'I:1.0/0-7', 'I:1.0/0', 8, 'I:1.0/7'), (SLC, 'I:1.0-3', 'I:1.0', 4, 'I:1.3'),
    (SLC, 'ST9:0-ST9:0', 'ST9:0', 1, 'ST9:0'),
    (PLC5, 'I:001/00-17', 'I:001/00', 16, 'I:001/17'), (PLC5, 'I:000-017', 'I:000', 16, 'I:017'),
    (PLC5, 'O:001-O:003', 'O:001', 3, 'O:003'), (PLC5, 'N7:90-999', 'N7:90', 910, 'N7:999'),
    (PLC5, 'PD10:0.SP-PD10:0.DB', 'PD10:0.SP', 8, 'PD10:0.DB'),
    (PLC2, '020-027', '020', 8, '027'), (PLC2, '110/00-17', '110/00', 16, '110/17'),
    (PLC2, '11000-11017', '110/00', 16, '110/17'),
    (PLC3, 'N7:0-9', 'N7:0', 10, 'N7:9'), (PLC3, 'B10:5/00-17', 'B10:5/00', 16, 'B10:5/17'),
    (PLC3, 'I:0000-0017', 'I:0000', 16, 'I:0017'),
    (PLC3, 'T:4.PRE-T:4.ACC', 'T:4.PRE', 2, 'T:4.ACC'),
    (PLC3, 'E3.1.8.10.0.5-E3.1.8.10.0.9', 'B10:5', 5, 'B10:9')])
def test_range_has_both_ends_in_the_counting_of_its_file(
        family: str, text: str, first: str, length: int, last: str) -> None:
    row = one(Address=text, PLC_Type=family, Command='Read')
    assert (str(row.address), row.length, str(row.place_of(length - 1))) == (first, length, last)
    assert one(Address=text, PLC_Type=family, Command='Read', Length=str(length)).length == length
    # The Length with which the same is written without a range.
    plain = one(Address=first, PLC_Type=family, Command='Read', Length=str(length))
    assert (plain.address, plain.codec) == (row.address, row.codec)


@for_all(('kind', 'length'), [('int32', 5), ('float32', 5), ('uint16', 10), ('string', 10)])
def test_length_of_a_range_counts_values_of_the_type(kind: str, length: int) -> None:
    row = one(Address='N7:0-9', Type=kind)
    assert (row.length, row.codec.words) == (length, 10)


@for_all(('family', 'text', 'words'), [
    (SLC, 'N7:9-0', ['N7:0-N7:9']), (SLC, 'B3:1/7-0', ['B3:1/0-B3:1/7']),
    (SLC, 'T4:3-0', ['T4:0-T4:3']), (SLC, 'C5:0.ACC-C5:0.PRE', ['C5:0.PRE-C5:0.ACC']),
    (SLC, 'B3:1/8-B3:2/3', ['B3:1/8, and Length 12']),
    (SLC, 'I:1.0/0-I:1.1/15', ['I:1.0/0, and Length 32']),
    (PLC5, 'I:001/10-I:002/07', ['I:001/10, and Length 16']),
    (SLC, 'N7:0{10}', ['N7:0, and Length 10']), (SLC, 'N7:10 [10]', ['N7:10, and Length 10']),
    (PLC5, 'N7:0,L10', ['N7:0, and Length 10']), (SLC, 'N7:0, 10', ['N7:0, and Length 10']),
    (SLC, 'N7:0 L10', ['N7:0, and Length 10']), (SLC, 'T4:0[4]', ['T4:0, and Length 12']),
    (SLC, 'B3:1/8{16}', ['B3:1/8, and Length 16']), (PLC3, 'N7:0{3}', ['N7:0, and Length 3']),
    (PLC5, 'I:001/00{16}', ['I:001/00, and Length 16']),
    (SLC, 'T4:0.ACC-T4:2.ACC', ['T4:0.ACC', 'T4:1.ACC', 'T4:2.ACC', 'T4:0, and Length 9']),
    (SLC, 'T4:0.ACC{3}', ['T4:0.ACC', 'T4:1.ACC', 'T4:2.ACC', 'T4:0, and Length 9']),
    (SLC, 'T4:0.0{3}', ['T4:0', 'T4:1', 'T4:2', 'T4:0, and Length 9']),
    (PLC3, 'T:0.PRE-T:1.PRE', ['T:0.PRE', 'T:1.PRE', 'T:0.CTL, and Length 6']),
    (SLC, 'HSC:0.ACC-HSC:1', ['HSC:0.ACC', 'HSC:1.ACC']),
    (SLC, 'ST9:0-4', ['ST9:0', 'ST9:1', 'ST9:2', '...', 'ST9:4']),
    (SLC, 'ST9:0{2}', ['ST9:0', 'ST9:1']), (SLC, 'I:1.1{3}', ['I:1.1, and Length 3']),
    (SLC, 'I:1-4', ['I:1.0', 'I:2.0', 'I:3.0', 'I:4.0']),
    (SLC, 'T4:0-T4:1.PRE', ['T4:0', 'T4:1', 'T4:0, and Length 6']),
    (SLC, 'I:1.0/3-I:2.0/3', ['I:1.0/3', 'I:2.0/3']), (SLC, 'I:3-I:1', ['I:3.0']),
    (SLC, 'N7:O-9', ['N7:0-9']), (SLC, 'B3:1.0-7', ['B3:1/0-7']),
    (SLC, 'B3:1.0-B3:1.7', ['B3:1/0-B3:1/7']), (SLC, 'N7:O', ['N7:0']), (PLC2, 'O20-O27', []),
    (SLC, 'N7:0-N10:9', []), (SLC, 'N7:0-N7:1/3', []), (SLC, 'T4:0.ACC-3', []),
    (SLC, 'T4:0.PRE/0-T4:0.ACC/3', []), (SLC, 'N7:0-', []), (SLC, 'N7:0-3-5', []),
    (SLC, 'N7:0-300', []), (SLC, 'N7:0{257}', []), (SLC, 'N7:0{0}', []), (SLC, 'N7:9-N7:O', []),
    (SLC, 'I:001/00-17', []), (PLC5, 'I:001/00-18', []), (PLC2, '018-020', []),
    (PLC2, '11000-17', []), (PLC3, 'T:4-7', []), (PLC3, 'N7:0-B7:9', [])])
def test_advice_about_a_range_is_read_as_what_it_says(
        family: str, text: str, words: list[str]) -> None:
    told = fault(Address=f'"{text}"', PLC_Type=family, Command='Read')
    assert told.startswith('2:3 (Address): 250')
    advised = re.search(r'(?:write|row:|for) (\S+:.*|\d.*)$', told)
    # An octal number of another family is only an example.
    found = re.split(', (?:or the whole elements with )?(?!and)', advised[1]) \
        if advised and ' as in ' not in told else []
    assert found == words
    for right in filter('...'.__ne__, found):
        address, _, length = right.partition(', and Length ')
        assert one(Address=address, PLC_Type=family, Command='Read', Length=length)


def test_length_beside_a_range_agrees_with_it() -> None:
    for length in (1, 9, 11):
        assert fault(Address='N7:0-9', Length=str(length)) == (
            f'2:6 (Length): Item: 1, N7:0-9 has Length 10, not {length}')
    assert fault(Address='N7:0-8', Type='int32') == (
        '2:3 (Address): 2503 ERR_ADDRESS_SYNTAX: Item: 1, Invalid Address Syntax (N7:0-8); '
        'N7:0-N7:8 are 9 words, and a int32 takes 2')
    assert fault(Address='N7:0-1', Command='Heartbeat') == (
        '2:3 (Address): Item: 1, a heartbeat is one word')
    with pytest.raises(FormatError, match='^write T4:0, and Length 12$'):
        parse_address('T4:0-3', PlcType.SLC)


def test_map_has_at_most_5000_rows() -> None:
    rows = [row(Tag=f'tag{number}', Command='Read', Address=f'N7:{number % 100}')
            for number in range(5001)]
    mappings, problems = load_rows(*rows[:5000])
    assert (len(mappings), problems) == (5000, [])
    with pytest.raises(ConfigurationError, match='map.csv:5002: a map has at most 5000 rows, '):
        load_rows(*rows)


def test_similar_tag_is_looked_for_a_limited_number_of_times() -> None:
    """Each search looks at all tags."""
    guarded = [row(Tag=f'a{number}', Command='Read', Address='N7:1', While='sped',
                   While_Timeout='9000')
               for number in range(30)]
    told = faults(row(Tag='speed', Command='Read'), *guarded)
    assert [text.endswith('did you mean speed?') for text in told] == 20 * [True] + 10 * [False]


def bits(names: str, **cells: str) -> str:
    """Return a row with names of bits."""
    return row(**{'Command': 'Read', 'Address': 'B3:0/0', 'Length': '3', 'Bits': names} | cells)


def told_of(mappings: Rows) -> list[str]:
    """Return the remarks on all rows, without the name of the file."""
    return [str(remark).partition('map.csv:')[2] for row in mappings for remark in row.remarks]


@for_all(('names', 'kept', 'text'), [
    ('doors closed|drive 3 fault|ready', ('doors closed', 'drive 3 fault', 'ready'),
     'doors closed | drive 3 fault | ready'),
    (' a  b | | c ', ('a b', '', 'c'), 'a b |  | c'), ('', (), '')])
def test_bits_have_names(names: str, kept: tuple[str, ...], text: str) -> None:
    mappings, problems = load_rows(bits(names))
    assert problems == []
    assert (mappings[0].bits, cell_of(mappings[0], 'Bits')) == (kept, text)
    assert [mappings[0].name_of(number) for number in range(3)] == [*(kept or ('', '', ''))]
    assert mappings[0].named_places() == [
        name or f'B3:0/{number}' for number, name in enumerate(kept or ('', '', ''))]
    assert mappings[0].remarks == ()


@for_all(('cells', 'text'), [
    ({'names': 'a|b'}, 'Bits has 2 names, Length is 3: write | between the names, and nothing '
     'between two | for a bit without a name'),
    ({'names': 'a b c'}, 'Bits has 1 name, Length is 3'),
    ({'names': 'a|b|c|d'}, 'Bits has 4 names'),
    ({'names': 'a|b|a'}, 'Bits has the name "a" twice'),
    ({'names': 'a|b|c', 'Address': 'N7:0'}, 'Bits names the bits of a bool row, not those of '
     'int16 values; leave the cell empty'),
    ({'names': 'a', 'Address': 'N7:0', 'Length': '', 'Command': 'Heartbeat'},
     'a Heartbeat row has no Bits')])
def test_names_that_are_not_one_for_each_bit_are_refused(cells: dict[str, str], text: str) -> None:
    found, = faults(bits(**cells))
    assert '(Bits): Item: 1, ' in found and text in found


def test_tag_of_a_row_of_one_bit_is_its_name() -> None:
    mappings, problems = load_rows(
        bits('doors closed|drive 3 fault|'), row(Tag='door', Command='Read', Address='B3:0/0'),
        row(Tag='Drive_3_fault', Command='Read', Address='B3:0/1'),
        row(Tag='ready', Command='Write', Address='B3:0/2'),
        row(Tag='there', Command='Read', Address='B3:0/1', Station='2'),
        row(Tag='word', Command='Read', Address='B3:0'),
        row(Tag='own', Command='Read', Address='B3:1/0', Bits='other'))
    assert problems == []
    assert mappings[0].bits == ('door', 'Drive_3_fault', 'ready')
    assert mappings[-1].bits == ('own',)
    assert told_of(mappings) == [
        '2 (Bits): B3:0/0 has two names: "doors closed", and "door", the Tag of its own row, '
        'which is shown',
        '8 (Bits): B3:1/0 has two names: "other", and "own", the Tag of its own row, which is '
        'shown']


def test_two_rows_that_give_a_bit_two_names_are_told() -> None:
    mappings, _ = load_rows(
        bits('a|b|c'), bits('B|d|', Tag='more', Address='B3:0/1'),
        bits('x|y|z', Tag='there', Station='2'))
    assert [row.bits for row in mappings] == [('a', 'b', 'c'), ('B', 'd', ''), ('x', 'y', 'z')]
    assert told_of(mappings) == ['3 (Bits): B3:0/2 has two names: "d", and "c" in the row a']
