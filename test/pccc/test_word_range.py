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

"""Word range commands of PLC-3 and PLC-5: bytes, order of words, requests, and answers."""

from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import FileType, PlcType
from abdf1_ros.pccc.plc3.dialect import PLC3
from abdf1_ros.pccc.plc5.dialect import PLC5_WORD_RANGE
from abdf1_ros.pccc.word_range.commands import in_line_order, word_on_line
from abdf1_ros.pccc.word_range.dialect import WordRangeDialect
import pytest
from support.cases import for_all
from support.tables import ask, counting, table, words_at

PLC5 = PlcType.PLC5
FAMILIES = {PlcType.PLC3: PLC3, PLC5: PLC5_WORD_RANGE}


def at(text: str, family: str = 'PLC3') -> Address:
    return parse_address(text, PlcType(family))


@for_all(('text', 'family', 'encoded'), [
    ('N7:5', 'PLC3', '2C 05 07 05'), ('B260:300', 'PLC3', '2C 08 FF 04 01 FF 2C 01'),
    ('T:9.ACC', 'PLC3', '3C 03 00 09 02'), ('C:0.PRE', 'PLC3', '2C 04 00 01'),
    ('I:017', 'PLC3', '2C 02 00 0F'), ('S:3', 'PLC3', '2C 0D 00 03'),
    ('T4:2.ACC', 'PLC5', '0E 04 02 02'), ('T4:2', 'PLC5', '06 04 02'),
    ('B3:300', 'PLC5', '06 03 FF 2C 01'), ('I:012', 'PLC5', '06 01 0A')])
def test_address_is_encoded_for_its_family(text: str, family: str, encoded: str) -> None:
    dialect: WordRangeDialect = FAMILIES[PlcType(family)]
    assert dialect.read(at(text, family), 1) == (
        0x0F, bytes.fromhex(f'01 00 00 01 00 {encoded} 02'))


@for_all(('family', 'letters', 'read', 'write'), [
    ('PLC3', 'N', 122, 114), ('PLC3', 'T', 120, 114), ('PLC5', 'N', 122, 116),
    ('PLC5', 'F', 122, 116), ('PLC5', 'T', 120, 114), ('PLC5', 'ST', 84, 84)])
def test_limits_are_whole_elements(family: str, letters: str, read: int, write: int) -> None:
    dialect, kind = FAMILIES[PlcType(family)], FileType(letters)
    assert (dialect.max_read(kind), dialect.max_write(kind)) == (read, write)


@for_all('text', ['N7:0', 'T4:0', 'B3:0', 'ST9:0', 'MG9:0'])
def test_other_words_keep_their_order(text: str) -> None:
    assert in_line_order(at(text, 'PLC5'), b'\1\2\3\4\5\6') == b'\1\2\3\4\5\6'
    assert word_on_line(at(text, 'PLC5')) == at(text, 'PLC5')


def test_only_the_floats_of_a_pid_block_are_exchanged() -> None:
    words = [bytes((n, 0)) for n in range(82)]
    order = [data[0] for data in words]
    for first in (*range(2, 50, 2),):
        order[first], order[first + 1] = order[first + 1], order[first]
    assert list(in_line_order(at('PD10:1', 'PLC5'), b''.join(words))[::2]) == order


@pytest.mark.parametrize('text', ['F8:2', 'PD10:1', 'N7:0'])
def test_one_word_and_many_agree(text: str) -> None:
    address = at(text, 'PLC5')
    data = bytes(range(164))
    line = in_line_order(address, data)
    for n in range(82):
        ours = word_on_line(address.at_offset(address.offset + n)).offset - address.offset
        assert line[2 * n:2 * n + 2] == data[2 * ours:2 * ours + 2]


def test_floats_have_their_high_word_first_and_each_word_can_be_read_alone() -> None:
    memory = table(PLC5, F8_0='00 00 7A 44 00 00 C0 BF')
    assert ask(memory, '01 00 00 04 00 06 08 00 08') == (0, '7A 44 00 00 C0 BF 00 00')
    assert ask(memory, '01 01 00 04 00 06 08 00 04') == (0, '00 00 C0 BF')
    assert ask(memory, '00 02 00 04 00 06 08 00 20 41 00 01') == (0, '')
    assert words_at(memory, 'F8:0', 4) == '00 00 7A 44 00 01 20 41'
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


@for_all(('data', 'sts', 'ext_sts'), [
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
