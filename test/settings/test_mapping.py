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

"""A mapping as the rest of the program sees it."""

from dataclasses import replace

from abdf1_ros.settings.columns import COLUMNS
import pytest
from support.mappings import make_mapping, one


@pytest.mark.parametrize('cells, scale, offset', [
    ({'Scale': '0.1'}, '0.1', '0'), ({'Offset': '-40.5'}, '1', '-40.5'), ({}, '', '')])
def test_scale_and_offset_as_text(cells: dict[str, str], scale: str, offset: str) -> None:
    mapping = one(**cells)
    assert (mapping.cell('Scale'), mapping.cell('Offset')) == (scale, offset)


def test_codec_of_a_bit_mapping_begins_at_its_bit() -> None:
    codec = one(Address='B3:2/5', Length='20').codec
    assert (codec.bit, codec.length, codec.words) == (5, 20, 2)


def test_cells_as_text_with_defaults_filled_in() -> None:
    mapping = one(Tag='Line speed', Command='read', Address='n7;3', Station='07')
    cells = {column: mapping.cell(column) for column in COLUMNS}
    assert {column: cell for column, cell in cells.items() if cell} == {
        'Tag': 'Line speed', 'Command': 'Read', 'Address': 'N7:3', 'Station': '7',
        'PLC_Type': 'PLC5', 'Length': '1', 'Type': 'int16', 'Topic': 'Line_speed',
        'Publish': 'Always', 'Word_Order': 'Low', 'Access': 'Typed'}


@pytest.mark.parametrize('text, cell', [
    ('0', '0'), ('-5', '-5'), ('0.1', '0.1'), ('1000000', '1000000'),
    ('2147483647', '2147483647'), ('-3.25', '-3.25'), ('1234567.5', '1234567.5')])
def test_limits_as_text_lose_nothing(text: str, cell: str) -> None:
    assert one(Max=text).cell('Max') == cell
    assert replace(one(), minimum=float(text)).cell('Min') == cell


def test_period_of_zero_is_not_the_default() -> None:
    assert one(Period='0').period == 0
    assert one(Period='0').cell('Period') == '0'


def test_function_file_of_a_micrologix_is_no_file_of_that_number() -> None:
    binary, function = (make_mapping(text, plc='SLC') for text in ('B3:0', 'STI:0.PFN'))
    assert function.address.file == binary.address.file
    assert not binary.shares_words(function) and not function.shares_words(binary)
    assert function.shares_words(make_mapping('STI:0.PFN', 'Write', plc='SLC'))
