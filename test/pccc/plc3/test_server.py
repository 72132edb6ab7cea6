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
from abdf1_ros.pccc.server import Server
import pytest
from support.tables import ask, counting, table, words_at
from support.vectors import pair, vector

PLC3 = PlcType.PLC3


@pytest.mark.parametrize('number', [1, 3])
def test_word_range_reads_of_the_vectors(number: int) -> None:
    memory = table(PLC3, B10_0='00 00' * 342)
    reply = Server(memory).serve(vector(f'516_fd_plc3_wrr_cmd{number}').packet)
    expected = vector(f'516_fd_plc3_wrr_rep{number}_zero_data').packet
    assert (reply.cmd, reply.sts, reply.tns, reply.data) == (
        expected.cmd, expected.sts, expected.tns, expected.data)


def test_offset_of_the_vectors_is_honoured() -> None:
    memory = table(PLC3, B10_0=counting(342))
    replies = [Server(memory).serve(vector(f'516_fd_plc3_wrr_cmd{number}').packet)
               for number in (1, 2, 3)]
    assert b''.join(reply.data for reply in replies).hex() == counting(342)


def test_file_read_of_the_vectors() -> None:
    command, reply = pair('plc3_file_read')
    assert Server(table(PLC3, B10_0='01 00 02 00 03 00 04 00 05 00')).serve(command) == reply


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


def test_bit_write_sets_and_resets() -> None:
    memory = table(PLC3, B10_0='00 00 FF 00 00 00')
    assert ask(memory, '02 2C 08 0A 01 00 80 0F 00') == (0, '')
    assert words_at(memory, 'B10:0', 3) == '00 00 F0 80 00 00'


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
