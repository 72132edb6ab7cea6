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

"""What an emulated SLC answers to its own commands."""

from abdf1_ros.pccc.file_types import PlcType
from support.cases import for_all
from support.tables import ask, counting, table, words_at

SLC = PlcType.SLC


@for_all(('data', 'sts'), [
    ('A2 02 09 89 00 00', 0x10), ('A2 02 07 85 00 00', 0x10), ('A2 02 07 7F 00 00', 0x10),
    ('A2 02 07 89 04 00', 0x50), ('A2 0A 07 89 00 00', 0x50), ('A2 00 07 89 00 00', 0x10),
    ('A2 03 07 89 00 00', 0x10), ('A2 EE 07 89 00 00', 0x10), ('AA 00 07 89 00 00', 0x10),
    ('AA 01 07 89 00 00 01', 0x10), ('AA 04 07 89 03 00 01 00 02 00', 0x50),
    ('AA EC 07 89 00 00' + ' 00' * 236, 0x10), ('AB 00 07 89 00 00 FF FF', 0x10),
    ('AB 04 07 89 03 00 FF FF 01 00 02 00', 0x50), ('AB 02 09 89 00 00 FF FF 01 00', 0x10),
    ('A1 02 09 89 00', 0x10), ('A1 02 07 89 04', 0x50), ('A1 02 07 89 00 01', 0x10),
    ('A9 02 07 89 04 01 00', 0x50), ('A9 04 07 89 03 01 00 02 00', 0x50),
    ('A2 02 00 82 00 00', 0x50), ('A2 02 01 82 00 00', 0x10), ('A2 02 07 83 00 00', 0x10)])
def test_command_that_an_slc_refuses_changes_nothing(data: str, sts: int) -> None:
    words = table(SLC, N7_0='00 00' * 4)
    assert ask(words, data) == (sts, '')
    assert words_at(words, 'N7:0', 4) == '00 00 ' * 3 + '00 00'


def test_commands_of_two_fields_begin_at_the_first_word() -> None:
    words = table(SLC, T4_0=counting(9))
    assert ask(words, 'A1 06 04 86 01') == (0, '03 00 04 00 05 00')
    assert ask(words, 'A9 02 04 86 02 FF 00') == (0, '')
    assert words_at(words, 'T4:2', 3) == 'FF 00 07 00 08 00'


def test_flat_image_is_slot_after_slot() -> None:
    words = table(SLC, I_3_0='31 00', I_1_0='11 00 12 00', O_2_0='22 00', I_10_0='A1 00')
    assert ask(words, 'A2 08 01 83 00 00') == (0, '11 00 12 00 31 00 A1 00')
    assert ask(words, 'A2 02 01 83 02 00') == (0, '31 00')
    assert ask(words, 'A2 02 01 83 01 01') == (0, '31 00')
    assert ask(words, 'A1 02 00 82 00') == (0, '22 00')
    assert ask(words, 'A2 04 01 83 03 00') == (0x50, '')


def test_flat_image_is_written_across_slots_or_not_at_all() -> None:
    words = table(SLC, O_0_0='00 00', O_5_0='00 00')
    assert ask(words, 'AA 04 00 82 00 00 01 00 02 00') == (0, '')
    assert (words_at(words, 'O:0'), words_at(words, 'O:5')) == ('01 00', '02 00')
    assert ask(words, 'AB 04 00 82 00 00 0F 00 FF 00 F0 00') == (0, '')
    assert (words_at(words, 'O:0'), words_at(words, 'O:5')) == ('0F 00', '00 00')
    assert ask(words, 'AA 04 00 82 01 00 07 00 07 00') == (0x50, '')
    assert words_at(words, 'O:5') == '00 00'


def test_slc_takes_typed_commands_on_files_that_a_plc5_has_too() -> None:
    """From operating system 303 on; the codes are those of a PLC-5."""
    words = table(SLC, N7_0='01 00 02 00', T4_0='00 20 0A 00 05 00', F8_0='00 00 7A 44',
                  L10_0='01 00 00 00', I_1_0='05 00')
    assert ask(words, '68 00 00 02 00 06 07 00 02 00') == (0, '95 09 42 01 00 02 00')
    assert ask(words, '68 00 00 01 00 0E 04 00 02 01 00') == (0, '93 09 42 05 00')
    assert ask(words, '68 00 00 01 00 06 08 00 01 00') == (0, '96 09 94 08 00 00 7A 44')
    assert ask(words, '67 00 00 01 00 06 07 01 93 09 42 07 00') == (0, '')
    assert words_at(words, 'N7:1') == '07 00'
    for data, ext_sts in (('06 0A 00', '06'), ('06 01 00', '06'), ('06 63 00', '06'),
                          ('06 07 02', '07')):
        assert ask(words, f'68 00 00 01 00 {data} 01 00') == (0xF0, ext_sts)
