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

"""What an emulated PLC-5 answers to word range commands and bit writes."""

from abdf1_ros.pccc.file_types import PlcType
import pytest
from support.tables import ask, counting, table, words_at

PLC5 = PlcType.PLC5


def test_floats_have_their_high_word_first() -> None:
    memory = table(PLC5, F8_0='00 00 7A 44 00 00 C0 BF')
    assert ask(memory, '01 00 00 04 00 06 08 00 08') == (0, '7A 44 00 00 C0 BF 00 00')
    assert ask(memory, '01 01 00 04 00 06 08 00 04') == (0, '00 00 C0 BF')
    assert ask(memory, '00 02 00 04 00 06 08 00 20 41 00 01') == (0, '')
    assert words_at(memory, 'F8:0', 4) == '00 00 7A 44 00 01 20 41'


def test_each_word_of_a_float_can_be_read_alone() -> None:
    memory = table(PLC5, F8_0='01 00 02 00 03 00 04 00')
    assert ask(memory, '01 00 00 01 00 06 08 00 02') == (0, '02 00')
    assert ask(memory, '01 00 00 01 00 0E 08 00 01 02') == (0, '01 00')
    assert ask(memory, '01 01 00 02 00 06 08 00 02') == (0, '01 00')
    assert ask(memory, '01 01 00 02 00 0E 08 00 01 02') == (0, '04 00')


def test_structures_are_words_in_the_order_of_storage() -> None:
    memory = table(PLC5, T4_0=counting(9))
    assert ask(memory, '01 00 00 06 00 06 04 01 0C') == (0, '03 00 04 00 05 00 06 00 07 00 08 00')
    assert ask(memory, '01 00 00 01 00 0E 04 01 02 02') == (0, '05 00')
    assert ask(memory, '00 01 00 02 00 0E 04 01 01 FF 00') == (0, '')
    assert words_at(memory, 'T4:1', 3) == '03 00 04 00 FF 00'


@pytest.mark.parametrize(('data', 'sts', 'ext_sts'), [
    ('01 00 00 01 00 06 09 00 02', 0xF0, '06'), ('01 00 00 05 00 06 07 00 02', 0xF0, '0A'),
    ('01 00 00 01 00 06 07 04 02', 0xF0, '0A'), ('01 00 00 01 00 06 07 00 00', 0xF0, '01'),
    ('01 00 00 02 00 06 07 00 03', 0xF0, '01'), ('01 00 00 01 00 06 07 00 04', 0xF0, '01'),
    ('01 01 00 01 00 06 07 00 02', 0xF0, '01'), ('01 00 00 7B 00 06 07 00 F6', 0xF0, '01'),
    ('00 00 00 01 00 06 07 00', 0xF0, '01'), ('00 00 00 02 00 06 07 03 01 00 02 00', 0xF0, '0A'),
    ('00 00 00 77 00 06 07 00' + ' 00' * 238, 0xF0, '01'), ('02 06 07 04 01 00 00 00', 0xF0, '07'),
    ('02 06 07 00 01 00 01 00', 0x10, ''), ('01 00 00 01 00 06 07', 0x10, '')])
def test_command_that_is_refused_changes_nothing(data: str, sts: int, ext_sts: str) -> None:
    memory = table(PLC5, N7_0=counting(4))
    assert ask(memory, data) == (sts, ext_sts)
    assert words_at(memory, 'N7:0', 4) == '00 00 01 00 02 00 03 00'
