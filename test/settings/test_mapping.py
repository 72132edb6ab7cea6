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

"""A mapping as the rest of the program sees it, its columns, and names for ROS."""

from dataclasses import replace
from enum import Enum
from pathlib import Path
import re

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor, USUAL
from abdf1_ros.pccc.values import ValueType, WordOrder
from abdf1_ros.settings.columns import BY_NAME, COLUMNS, MAP_COLUMNS
from abdf1_ros.settings.heartbeats import While
from abdf1_ros.settings.mapping import Command, Publish
from abdf1_ros.settings.names import sanitise
from abdf1_ros.settings.rows import Rows
import pytest
from support.cases import for_all
from support.mappings import cell_of, make_mapping, one


def test_cells_as_text_with_defaults_filled_in() -> None:
    mapping = one(Tag='Line speed', Command='read', Address='n7;3', Station='07')
    cells = {column: cell_of(mapping, column) for column in COLUMNS}
    assert {column: cell for column, cell in cells.items() if cell} == {
        'Tag': 'Line speed', 'Command': 'Read', 'Address': 'N7:3', 'Station': '7',
        'PLC_Type': 'PLC5', 'Length': '1', 'Type': 'int16', 'Topic': 'Line_speed',
        'Publish': 'Always', 'Word_Order': 'Low', 'Access': 'Typed'}


@for_all(('text', 'cell'), [
    ('0', '0'), ('-5', '-5'), ('0.1', '0.1'), ('1000000', '1000000'),
    ('2147483647', '2147483647'), ('-3.25', '-3.25'), ('1234567.5', '1234567.5')])
def test_limits_as_text_lose_nothing(text: str, cell: str) -> None:
    assert cell_of(one(Max=text), 'Max') == cell
    assert cell_of(replace(one(), minimum=float(text)), 'Min') == cell


def test_period_of_zero_is_not_the_default() -> None:
    row = one(Command='Read', Publish='Change', Period='0', Deadband='0')
    assert (row.period, cell_of(row, 'Period'), row.deadband) == (0, '0', 0)


def test_function_file_of_a_micrologix_is_no_file_of_that_number() -> None:
    binary, function = (make_mapping(text, plc='SLC') for text in ('B3:0', 'STI:0.PFN'))
    assert function.address.file == binary.address.file
    assert not binary.shares_words(function) and not function.shares_words(binary)
    assert function.shares_words(make_mapping('STI:0.PFN', 'Write', plc='SLC'))


def test_groups_of_rows_and_the_stations_of_the_plcs() -> None:
    rows = Rows(make_mapping(command=command, station=station, condition=condition,
                             is_on_demand=command == 'ReadWrite')
                for command, station, condition in (
        ('Write', 255, None), ('Serve', 5, None), ('Read', 2, None), ('Write', 1, None),
        ('Read', 2, While(('RUN',))), ('ReadWrite', 3, None), ('Heartbeat', 4, While(('a',), 9))))
    assert rows.stations == (2, 1, 3, 4)
    assert {name: [row.station for row in getattr(rows, name)] for name in (
        'served', 'published', 'messages', 'written', 'own', 'heartbeats', 'guarded', 'on_demand',
        'repeated')} == {
        'served': [5], 'published': [5, 2, 2, 3], 'messages': [255, 5, 1, 3],
        'written': [255, 1, 3, 4], 'own': [4], 'heartbeats': [4], 'guarded': [2],
        'on_demand': [3], 'repeated': [255, 5, 2, 1, 2, 4]}


@for_all(('text', 'kind', 'is_shared'), [
    ('030/14', None, False), ('030/17', None, False), ('030/13', None, True),
    ('027/17', None, False), ('030', 'bcd12', True), ('030', 'uint16', True),
    ('031', 'bcd12', False)])
def test_digits_share_no_bit_with_the_status_bits_above_them(
        text: str, kind: str | None, is_shared: bool) -> None:
    digits = make_mapping('030', 'Write', plc='PLC2', kind='bcd12')
    other = make_mapping(text, 'Write', plc='PLC2', kind=kind)
    assert digits.shares_words(other) is other.shares_words(digits) is is_shared


def test_columns_are_those_of_the_interface_each_once_and_described() -> None:
    shown = [' | '.join((column.name, column.kind.right if column.kind else '', *(
        ' '.join(command.value for command in commands)
        for commands in (column.commands, column.idle)))).rstrip(' |') for column in MAP_COLUMNS]
    assert shown == (Path(__file__).parent / 'expected' / 'columns.txt').read_text().splitlines()
    assert BY_NAME['Processor'].default == USUAL.value
    assert [name for name, column in BY_NAME.items() if not column.description] == []


@for_all(('name', 'choices'), [
    ('Command', Command), ('Publish', Publish), ('Type', ValueType), ('Word_Order', WordOrder),
    ('PLC_Type', FAMILIES), ('Access', Access), ('Processor', Processor)])
def test_every_choice_is_named(name: str, choices: type[Enum]) -> None:
    words = set(re.findall(r'[\w/]+', BY_NAME[name].description))
    assert {choice.value for choice in choices} <= words


@pytest.mark.parametrize('plc_type', [PlcType.PLC2, PlcType.PLC5, PlcType.SLC])
def test_accesses_stand_in_their_order(plc_type: PlcType) -> None:
    ways = ', '.join(way.value for way in FAMILIES[plc_type].accesses)
    assert f'{plc_type.value}: {ways}' in BY_NAME['Access'].description


@for_all(('text', 'name'), [
    ('line_speed', 'line_speed'), ('N7:0', 'N7_0'), ('B3/12', 'B3/t12'), ('7seg', 't7seg'),
    ('a-b', 'a_b'), ('a b', 'a_b'), ('Tank.Level', 'Tank_Level'), ('Füllstand', 'F_llstand'),
    ('cell/2/guard', 'cell/t2/guard'), ('a//b', 'a/b'), ('/a/', 'a'), ('a / b', 'a/b'),
    ('__a__b__', 'a_b'), ('_hidden', 'hidden'), ('~private', 'private'), ('{node}', 'node'),
    ('a:::b', 'a_b'), ('a/_/b', 'a/b'), ('0', 't0'), ('_7', 't7'), ('CamelCase', 'CamelCase'),
    *((text, '') for text in ('', '_', '__', '/', '///', ':', 'ü', '日本', ' - / - '))])
def test_name_of_a_text(text: str, name: str) -> None:
    assert sanitise(text) == name
