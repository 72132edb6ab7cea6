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

"""What an emulated PLC-5 answers to its own commands."""

from abdf1_ros.pccc.file_types import PlcType
import pytest
from support.cases import for_all
from support.tables import ask, counting, table, words_at

PLC5 = PlcType.PLC5


def test_plc5_timer_is_read_with_its_two_internal_words() -> None:
    words = table(PLC5, T4_0='00 E0 64 00 2A 00 01 00 02 00 03 00')
    assert ask(words, '68 00 00 02 00 07 00 04 00 02 00') == (
        0, '99 09 16 59 0A 00 E0 64 00 2A 00 00 00 00 00 01 00 02 00 03 00 00 00 00 00')


def test_plc5_timer_is_written_with_its_two_internal_words() -> None:
    words = table(PLC5, T4_0='00 00' * 9)
    assert ask(words, '67 00 00 02 00 07 00 04 01 99 09 16 59 0A 00 C2 0A 00 09 00 01 01 01 01 '
                      '00 C3 0B 00 08 00 01 01 01 01') == (0, '')
    assert words_at(words, 'T4:0', 9) == ('00 00 00 00 00 00 00 C2 0A 00 09 00 00 C3 0B 00 08 00')


def test_plc5_float_of_a_pid_is_a_float() -> None:
    words = table(PLC5, PD12_10='00 00' * 82)
    assert ask(words, '67 00 00 02 00 0F 00 0C 0A 02 99 09 0A 94 08 00 00 2A 42 00 00 80 3F') == (
        0, '')
    assert words_at(words, 'PD12:10.SP', 4) == '00 00 2A 42 00 00 80 3F'
    assert ask(words, '68 00 00 01 00 0F 00 0C 0A 02 01 00') == (0, '96 09 94 08 00 00 2A 42')
    assert ask(words, '68 01 00 02 00 0F 00 0C 0A 02 01 00') == (0, '96 09 94 08 00 00 80 3F')
    assert ask(words, '68 00 00 01 00 0F 00 0C 0A 00 01 00') == (0, '93 09 42 00 00')
    assert ask(words, '67 00 00 01 00 0F 00 0C 0A 02 93 09 42 01 00') == (0xF0, '17')


@pytest.mark.parametrize(('name', 'words', 'number', 'descriptor'), [
    ('PD9_0', 82, 1, '99 09 A7 99 15 A4'), ('MG9_0', 56, 2, '99 09 E3 99 16 70'),
    ('SC9_0', 3, 2, '99 09 0E 96 1D'), ('BT9_0', 6, 2, '99 09 1B 99 20 0C'),
    ('ST9_0', 42, 2, '99 09 AA 39 54')])
def test_plc5_structures_as_a_whole(name: str, words: int, number: int, descriptor: str) -> None:
    data = bytes.fromhex(counting(words * number)).hex(' ').upper()
    full = table(PLC5, **{name: data})
    assert ask(full, f'68 00 00 0{number} 00 07 00 09 00 0{number} 00') == (
        0, f'{descriptor} {data}')
    empty = table(PLC5, **{name: '00 00' * words * number})
    assert ask(empty, f'67 00 00 0{number} 00 07 00 09 00 {descriptor} {data}') == (0, '')
    assert words_at(empty, name.replace('_', ':'), words * number) == data


def test_plc5_takes_members_in_logical_ascii() -> None:
    words = table(PLC5, PD12_10='00 00' * 82, BT9_0=counting(6))
    sp, rgs = b'\0$PD12:10.SP\0'.hex(), b'\0$BT9:0.RGS\0'.hex()
    assert ask(words, f'67 00 00 01 00 {sp} 96 09 94 08 00 00 2A 42') == (0, '')
    assert ask(words, f'68 00 00 01 00 {sp} 01 00') == (0, '96 09 94 08 00 00 2A 42')
    assert ask(words, f'68 00 00 01 00 {rgs} 01 00') == (0, '93 09 42 05 00')


@for_all(('data', 'ext_sts'), [
    ('68 00 00 01 00 07 00 09 00 01 00', '06'), ('68 00 00 01 00 07 00 07 04 01 00', '07'),
    ('68 00 00 05 00 07 00 07 00 05 00', '07'), ('68 00 00 01 00 07 00 07 00 02 00', '01'),
    ('68 01 00 01 00 07 00 07 00 01 00', '01'), ('68 00 00 00 00 07 00 07 00 00 00', '01'),
    ('68 00 00 01 00 0F 00 07 00 01 01 00', '03'), ('68 00 00 01 00 0F 00 04 00 03 01 00', '03'),
    ('67 00 00 01 00 07 00 07 00 95 09 42 01 00 02 00', '01'),
    ('67 00 00 01 00 07 00 07 00 91 09 42', '01'),
    ('67 00 00 01 00 07 00 07 00 96 09 94 08 00 00 00 00', '17'),
    ('67 00 00 01 00 07 00 04 00 97 09 56 01 00 02 00 03 00', '17'),
    ('67 00 00 01 00 07 00 09 00 93 09 42 01 00', '06'),
    ('67 00 00 02 00 07 00 07 03 95 09 42 01 00 02 00', '07'),
    # More levels than there are, another memory area; symbols (M 8-4).
    ('68 00 00 01 00 17 00 07 00 00 01 00', '03'), ('68 00 00 01 00 07 01 07 00 01 00', '06'),
    ('68 00 00 01 00 00 4E 37 00 01 00', '04'),
    ('68 00 00 01 00 00 24 58 37 3A 30 00 01 00', '05'),
    ('68 00 00 01 00 00 24 4E 37 00 01 00', '05'),
    ('68 00 00 01 00 00 24 4E 37 3A 39 39 39 39 00 01 00', '06'),
    ('26 07 00 09 00 FF FF 01 00', '06'), ('26 07 00 07 04 FF FF 01 00', '07'),
    ('26 07 00 07 00 FF FF 01 00 07 00 07 04 FF FF 01 00', '07')])
def test_command_that_a_plc5_refuses_changes_nothing(data: str, ext_sts: str) -> None:
    words = table(PLC5, N7_0='00 00' * 4, T4_0='00 00' * 3)
    assert ask(words, data) == (0xF0, ext_sts)
    assert words_at(words, 'N7:0', 4) == '00 00 ' * 3 + '00 00'


def test_plc5_reply_beyond_240_bytes_is_refused() -> None:
    words = table(PLC5, N7_0='00 00' * 200)
    assert ask(words, '68 00 00 76 00 07 00 07 00 76 00')[0] == 0
    assert ask(words, '68 00 00 77 00 07 00 07 00 77 00') == (0xF0, '0A')


def test_plc5_read_modify_write_of_the_same_word_twice_runs_in_order() -> None:
    words = table(PLC5, B3_0='00 00')
    assert ask(words, '26 07 00 03 00 FF FF 03 00 07 00 03 00 FE FF 00 00') == (0, '')
    assert words_at(words, 'B3:0') == '02 00'
