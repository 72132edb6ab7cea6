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

"""What an emulated PLC-3 answers to its own commands."""

from abdf1_ros.pccc.file_types import PlcType
import pytest
from support.tables import ask, counting, table, words_at

PLC3 = PlcType.PLC3


def test_file_read_begins_at_the_first_word() -> None:
    assert ask(table(PLC3, B10_0=counting(4)), '04 00 00 01 00 2C 08 0A 01 02') == (0xF0, '06')


def test_files_are_numbered_in_each_section() -> None:
    memory = table(PLC3, B10_0='01 00', N10_0='02 00', O_0='03 00', I_0='04 00')
    assert [ask(memory, f'01 00 00 01 00 0C {section} 02') for section in (
        '08 0A', '05 0A', '01 00', '02 00')] == [
        (0, '01 00'), (0, '02 00'), (0, '03 00'), (0, '04 00')]


def test_timer_is_three_words_of_a_structure() -> None:
    memory = table(PLC3, **{'T_2_CTL': '00 E0 64 00 2A 00'})
    assert ask(memory, '01 00 00 03 00 3C 03 00 02 00 06') == (0, '00 E0 64 00 2A 00')
    assert ask(memory, '01 00 00 01 00 3C 03 00 02 02 02') == (0, '2A 00')
    assert ask(memory, '00 00 00 01 00 3C 03 00 02 01 77 00') == (0, '')
    assert words_at(memory, 'T:2.PRE') == '77 00'


@pytest.mark.parametrize(('data', 'ext_sts'), [
    ('01 00 00 01 00 2C 10 0A 00 02', '01'), ('01 00 00 01 00 04 08 02', '02'),
    ('01 00 00 01 00 6C 08 0A 00 00 02', '03'), ('01 00 00 01 00 00 41 42 00 02', '04'),
    ('01 00 00 01 00 00 00 02', '05'), ('01 00 00 01 00 00 414243444546474849 00 02', '05'),
    ('01 00 00 01 00 2C 08 0B 00 02', '06'), ('01 00 00 01 00 2C 08 0A 04 02', '06'),
    ('01 00 00 01 00 2C 06 0A 00 02', '06'), ('01 00 00 01 00 2D 02 08 0A 00 02', '06'),
    ('02 2C 08 0A 04 01 00 00 00', '06'), ('00 00 00 02 00 2C 08 0A 03 01 00 02 00', '07'),
    ('00 00 00 01 00 2C 08 0A 04 01 00', '06'), ('01 00 00 05 00 2C 08 0A 00 02', '09')])
def test_addresses_that_lead_nowhere(data: str, ext_sts: str) -> None:
    """The codes of M 8-8 (writes), 8-9 (reads) and 8-10 (bit write)."""
    memory = table(PLC3, B10_0=counting(4))
    assert ask(memory, data) == (0xF0, ext_sts)
    assert words_at(memory, 'B10:0', 4) == '00 00 01 00 02 00 03 00'


@pytest.mark.parametrize('data', [
    '01 00 00 01 00 2C 08 0A 00 00', '01 00 00 01 00 2C 08 0A 00 01',
    '01 00 00 01 00 2C 08 0A 00 04', '01 01 00 01 00 2C 08 0A 00 02',
    '01 00 00 00 00 2C 08 0A 00 02', '00 00 00 01 00 2C 08 0A 00',
    '02 2C 08 0A 00 01 00 01 00', '68 00 00 01 00 07 00 07 00 01 00',
    '26 2C 08 0A 00 FF FF 01 00', '03 00 00 01 00 0C 08 0A 01 00'])
def test_what_is_malformed_or_unknown(data: str) -> None:
    memory = table(PLC3, B10_0=counting(4))
    assert ask(memory, data) == (0x10, '')
    assert words_at(memory, 'B10:0', 4) == '00 00 01 00 02 00 03 00'
