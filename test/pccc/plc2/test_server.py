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

"""What emulated PLCs answer to the commands of a PLC-2."""

from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.file_types import PlcType
import pytest
from support.cases import for_all
from support.tables import ask, counting, table, words_at

PLC2, PLC3, PLC5, SLC = PlcType.PLC2, PlcType.PLC3, PlcType.PLC5, PlcType.SLC


def words(count: int = 16) -> DataTable:
    """Return a PLC-2 whose words are their numbers."""
    return table(PLC2, **{'000': counting(count)})


def test_largest_packets_are_served_and_larger_ones_refused() -> None:
    memory = words(200)
    assert len(ask(memory, '00 00 F4', 0x01)[1].split()) == 244
    assert ask(memory, '00 00' + ' 01' * 244, 0x08) == (0, '')
    assert ask(memory, '00 00' + ' 00 00 01 00' * 60 + ' 00', 0x05)[0] == 0x10


@for_all(('cmd', 'data', 'sts'), [
    (0x01, '00 00 00', 0x10), (0x01, '00 00 03', 0x10), (0x01, '00 00 F6', 0x10),
    (0x01, '01 00 02', 0x10), (0x01, '20 00 02', 0x50), (0x01, '1E 00 04', 0x50),
    (0x01, '00 00', 0x10), (0x08, '00 00', 0x10), (0x08, '00 00 01', 0x10),
    (0x08, '1E 00 01 00 02 00', 0x50), (0x08, '00 00' + ' 00' * 246, 0x10),
    (0x00, '20 00 01 00', 0x50), (0x05, '00 00 01 01', 0x10), (0x05, '', 0x10),
    (0x05, '20 00 01 00', 0x50), (0x05, '00 00 FF 00 20 00 01 00', 0x50),
    (0x02, '00 00 01', 0x10), (0x0F, '01 00 00 01 00 2C 08 0A 00 02', 0x10), (0x03, '', 0x10)])
def test_command_that_is_refused_changes_nothing(cmd: int, data: str, sts: int) -> None:
    memory = words()
    assert ask(memory, data, cmd) == (sts, '')
    assert words_at(memory, '000', 16) == words_at(words(), '000', 16)


def test_compatibility_file_of_a_plc5_has_the_number_of_the_station_that_asks() -> None:
    memory = table(PLC5, N5_0=counting(8), N6_0='FF FF')
    assert ask(memory, '04 00 04', 0x01) == (0, '02 00 03 00')  # the tests ask as station 5
    assert ask(memory, '04 00 AA BB', 0x00) == (0, '')
    assert ask(memory, '07 00 01 02', 0x02) == (0, '')
    assert words_at(memory, 'N5:2', 2) == 'AA BB 03 01'
    assert words_at(memory, 'N6:0') == 'FF FF'


def test_structures_of_a_compatibility_file_are_words() -> None:
    memory = table(PLC5, C5_0=counting(9))
    assert ask(memory, '08 00 04', 0x01) == (0, '04 00 05 00')


@pytest.mark.parametrize('family', [PLC3, PLC5, SLC])
@pytest.mark.parametrize(('cmd', 'data'), [(0x01, '00 00 02'), (0x08, '00 00 01 00')])
def test_without_a_compatibility_file(family: PlcType, cmd: int, data: str) -> None:
    assert ask(table(family, N7_0='00 00'), data, cmd) == (0x50, '')


def test_compatibility_file_of_a_plc3_is_an_input_file() -> None:
    memory = table(PLC3, I5_0=counting(8), N5_0='FF FF')
    assert ask(memory, '04 00 04', 0x01) == (0, '02 00 03 00')
    assert ask(memory, '05 00 80 00', 0x05) == (0, '')
    assert words_at(memory, 'I5:2') == '02 80'


@pytest.mark.parametrize(('flags', 'read', 'write'), [
    ('00 00', '03 00 04', '02 00 AA BB'), ('00 01', '06 00 04', '04 00 AA BB'),
    ('FF FE', '03 00 04', '02 00 AA BB')])
def test_common_interface_file_counts_words_or_bytes(flags: str, read: str, write: str) -> None:
    memory = table(SLC, N9_0=counting(8), S_0=f'00 00 00 00 {flags}')
    assert ask(memory, read, 0x01) == (0, '03 00 04 00')
    assert ask(memory, write, 0x08) == (0, '')
    assert words_at(memory, 'N9:1', 3) == '01 00 AA BB 03 00'


def test_common_interface_file_gives_an_odd_number_of_bytes() -> None:
    memory = table(SLC, N9_0='01 02 03 04')
    assert ask(memory, '00 00 03', 0x01) == (0, '01 02 03')
    assert ask(memory, '00 00 01 02 03', 0x08) == (0x10, '')
    assert ask(memory, '00 00 05', 0x01) == (0x50, '')


@pytest.mark.parametrize(('cmd', 'data'), [
    (0x00, '00 00 01 00'), (0x02, '00 00 01 00'), (0x05, '00 00 01 00'),
    (0x01, '00 00 ED'), (0x08, '00 00' + ' 00' * 236)])
def test_what_an_slc_has_not(cmd: int, data: str) -> None:
    assert ask(table(SLC, N9_0=counting(200)), data, cmd) == (0x10, '')
