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

"""The descriptions of the map CSV's columns agree with what the columns take."""

from enum import Enum
import re

from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor, USUAL
from abdf1_ros.pccc.values import ValueType, WordOrder
from abdf1_ros.settings.columns import COLUMNS, MAP_COLUMNS
from abdf1_ros.settings.mapping import Command, Publish
import pytest

BY_NAME = {column.name: column for column in MAP_COLUMNS}


def test_columns_are_those_of_the_interface() -> None:
    assert COLUMNS == ('Tag', 'Command', 'Address', 'Station', 'PLC_Type', 'Length', 'Type',
                       'Topic', 'Period', 'Publish', 'Min', 'Max', 'Word_Order', 'Scale',
                       'Offset', 'Access', 'Processor', 'Fallback', 'Fallback_After',
                       'Requires', 'Requires_Timeout', 'Publish_While', 'Heartbeat_Timeout',
                       'Confirms', 'Via', 'Description')


def test_every_column_is_there_once_and_described() -> None:
    assert len(BY_NAME) == len(MAP_COLUMNS)
    assert [name for name, column in BY_NAME.items() if not column.description] == []


@pytest.mark.parametrize(('name', 'choices'), [
    ('Command', Command), ('Publish', Publish), ('Type', ValueType), ('Word_Order', WordOrder),
    ('PLC_Type', FAMILIES), ('Access', Access), ('Processor', Processor)])
def test_every_choice_is_named(name: str, choices: type[Enum]) -> None:
    words = set(re.findall(r'[\w/]+', BY_NAME[name].description))
    named = {choice.value for choice in choices}
    assert named <= words


@pytest.mark.parametrize('plc_type', [PlcType.PLC2, PlcType.PLC5, PlcType.SLC])
def test_accesses_stand_in_their_order(plc_type: PlcType) -> None:
    ways = ', '.join(way.value for way in FAMILIES[plc_type].accesses)
    assert f'{plc_type.value}: {ways}' in BY_NAME['Access'].description


def test_the_usual_processor_is_the_default() -> None:
    assert BY_NAME['Processor'].default == USUAL.value
