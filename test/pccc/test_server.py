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

"""The emulated PLC: the replies of the vectors, and one reply to whatever it is asked."""

from __future__ import annotations

import traceback

from abdf1_ros.df1.packet import Packet
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.server import Refusal, Server
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.properties import PROPERTY
from support.vectors import pair

PLC5, SLC = PlcType.PLC5, PlcType.SLC
TEN = '64 00 FF FF 00 00 FF 7F 00 80 10 00 10 10 05 00 06 00 07 00'
HELLO = '05 00 45 48 4C 4C 00 4F' + ' 00' * 76


def table(family: PlcType, **files: str) -> DataTable:
    """Return a table; each keyword is an address with "_" for ":", its value the words."""
    result = DataTable(family)
    for name, words in files.items():
        address = Address.parse(name.replace('_', ':', 1).replace('_', '.'), family)
        data = bytes.fromhex(words)
        result.create(address, len(data) // 2)
        result.write(address, data)
    return result


def counting(words: int) -> str:
    """Return words 0, 1, 2..."""
    return b''.join(number.to_bytes(2, 'little') for number in range(words)).hex()


def words_at(words: DataTable, text: str, count: int = 1) -> str:
    """Return words of a table in hexadecimal."""
    address = Address.parse(text, words.plc_type)
    return words.read(address, count).hex(' ').upper()


def ask(words: DataTable, data: str, cmd: int = 0x0F) -> tuple[int, str]:
    """Return STS and data of the reply to a command."""
    reply = Server(words).serve(Packet(1, 5, cmd, 0, 7, bytes.fromhex(data)))
    assert (reply.dst, reply.src, reply.cmd, reply.tns) == (5, 1, cmd | 0x40, 7)
    return reply.sts, reply.data.hex(' ').upper()


@pytest.mark.parametrize(('name', 'words'), [
    ('plc5_typed_read_N7_0x10', table(PLC5, N7_0=TEN)),
    ('plc5_typed_read_N7_30_1_short', table(PLC5, N7_30='D2 04')),
    ('plc5_typed_read_F8', table(PLC5, F8_0='00 00 7A 44 00 00 C0 BF')),
    ('plc5_typed_read_ascii', table(PLC5, N10_360='FE FF')),
    ('plc5_typed_read_multi_1', table(PLC5, N7_0=counting(150))),
    ('plc5_typed_read_multi_2', table(PLC5, N7_0=counting(150))),
    ('plc5_typed_write_badtype', table(PLC5, F8_0='00 00 00 00' * 6)),
    ('plc5_rmw', table(PLC5, B3_4='FF 00')),
    ('slc_A2_N7_0', table(SLC, N7_0=TEN)),
    ('slc_A2_T4_0_whole', table(SLC, T4_0='00 E0 64 00 2A 00')),
    ('slc_A2_F8', table(SLC, F8_0='00 00 7A 44')),
    ('slc_A2_ST9', table(SLC, ST9_0=HELLO)),
    ('slc_A2_O0_slot', table(SLC, O_2_0='03 00')),
    ('slc_A2_I1_slot', table(SLC, I_1_0='10 00')),
    ('slc_A2_max_5_03', table(SLC, N7_0='00' * 236)),
    ('slc_AA_F8', table(SLC, F8_1='00 00 00 00')),
    ('slc_AA_T4_PRE', table(SLC, T4_0='00 00 00 00 00 00')),
    ('slc_AB', table(SLC, B3_4='08 00')),
    ('slc_err_address', table(SLC, N7_0='00 00')),
], ids=lambda value: value if isinstance(value, str) else '')
def test_reply_of_the_vectors(name: str, words: DataTable) -> None:
    command, reply = pair(name)
    assert Server(words).serve(command) == reply


def test_element_beyond_255_of_the_vectors() -> None:
    words = DataTable(SLC)
    place = Address.parse('N10:0', SLC).at_offset(300)
    words.create(place, 1)
    words.write(place, b'\xAA\x55')
    command, reply = pair('slc_A2_N10_300')
    assert Server(words).serve(command) == reply


@pytest.mark.parametrize(('name', 'words', 'place', 'value'), [
    ('plc5_rmw', table(PLC5, B3_4='FF 00'), 'B3:4', 'F7 01'),
    ('slc_AB', table(SLC, B3_4='FF 00'), 'B3:4', 'F7 01'),
    ('slc_AA_T4_PRE', table(SLC, T4_0='01 00 02 00 03 00'), 'T4:0.PRE', '2C 01')])
def test_writes_of_the_vectors(name: str, words: DataTable, place: str, value: str) -> None:
    command, reply = pair(name)
    assert Server(words).serve(command) == reply
    assert words_at(words, place) == value


def test_float_write_of_the_vectors() -> None:
    words = table(SLC, F8_0='00 00 00 00 00 00 00 00')
    assert Server(words).serve(pair('slc_AA_F8')[0]).sts == 0
    assert words_at(words, 'F8:0', 4) == '00 00 00 00 00 00 00 BF'


def test_refused_write_of_the_vectors_changes_nothing() -> None:
    words = table(PLC5, F8_0='00 00 00 00' * 6)
    Server(words).serve(pair('plc5_typed_write_badtype')[0])
    assert words_at(words, 'F8:5', 2) == '00 00 00 00'


# PLC-5

def test_plc5_timer_is_read_with_its_two_internal_words() -> None:
    words = table(PLC5, T4_0='00 E0 64 00 2A 00 01 00 02 00 03 00')
    assert ask(words, '68 00 00 02 00 07 00 04 00 02 00') == (
        0, '99 09 16 59 0A 00 E0 64 00 2A 00 00 00 00 00 01 00 02 00 03 00 00 00 00 00')


def test_plc5_timer_is_written_with_its_two_internal_words() -> None:
    words = table(PLC5, T4_0='00 00' * 9)
    assert ask(words, '67 00 00 02 00 07 00 04 01 99 09 16 59 0A 00 C2 0A 00 09 00 01 01 01 01 '
                      '00 C3 0B 00 08 00 01 01 01 01') == (0, '')
    assert words_at(words, 'T4:0', 9) == (
        '00 00 00 00 00 00 00 C2 0A 00 09 00 00 C3 0B 00 08 00')


def test_plc5_member_is_an_integer() -> None:
    words = table(PLC5, T4_0='00 E0 64 00 2A 00 01 00 02 00 03 00')
    assert ask(words, '68 00 00 01 00 0F 00 04 01 02 01 00') == (0, '93 09 42 03 00')
    assert ask(words, '67 00 00 01 00 0F 00 04 01 01 93 09 42 77 00') == (0, '')
    assert words_at(words, 'T4:1', 3) == '01 00 77 00 03 00'


def test_plc5_offset_counts_elements() -> None:
    words = table(PLC5, C5_0=counting(12), N7_0=counting(9))
    assert ask(words, '68 02 00 03 00 07 00 07 01 01 00') == (0, '93 09 42 03 00')
    assert ask(words, '68 01 00 03 00 07 00 05 01 01 00') == (0, '97 09 66 06 00 07 00 08 00')
    assert ask(words, '67 02 00 03 00 07 00 07 01 93 09 42 FF 00') == (0, '')
    assert words_at(words, 'N7:2', 3) == '02 00 FF 00 04 00'


@pytest.mark.parametrize(('data', 'ext_sts'), [
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
    ('26 07 00 09 00 FF FF 01 00', '06'), ('26 07 00 07 04 FF FF 01 00', '07'),
    ('26 07 00 07 00 FF FF 01 00 07 00 07 04 FF FF 01 00', '07')])
def test_plc5_refusals(data: str, ext_sts: str) -> None:
    words = table(PLC5, N7_0='00 00' * 4, T4_0='00 00' * 3)
    assert ask(words, data) == (0xF0, ext_sts)
    assert words_at(words, 'N7:0', 4) == '00 00 ' * 3 + '00 00'


def test_plc5_reply_beyond_240_bytes_is_refused() -> None:
    words = table(PLC5, N7_0='00 00' * 200)
    assert ask(words, '68 00 00 76 00 07 00 07 00 76 00')[0] == 0
    assert ask(words, '68 00 00 77 00 07 00 07 00 77 00') == (0xF0, '0A')


@pytest.mark.parametrize(('old', 'and_mask', 'or_mask', 'new'), [
    ('FF FF', 'F7 FF', '00 01', 'F7 FF'), ('00 00', 'FF FF', '00 01', '00 01'),
    ('34 12', '00 00', 'CD AB', 'CD AB'), ('34 12', 'FF FF', '00 00', '34 12'),
    ('0F 00', 'F0 FF', '01 00', '01 00')])
def test_plc5_read_modify_write_is_and_then_or(old: str, and_mask: str, or_mask: str,
                                               new: str) -> None:
    words = table(PLC5, B3_0=old)
    assert ask(words, f'26 07 00 03 00 {and_mask} {or_mask}') == (0, '')
    assert words_at(words, 'B3:0') == new


def test_plc5_read_modify_write_of_the_same_word_twice_runs_in_order() -> None:
    words = table(PLC5, B3_0='00 00')
    assert ask(words, '26 07 00 03 00 FF FF 03 00 07 00 03 00 FE FF 00 00') == (0, '')
    assert words_at(words, 'B3:0') == '02 00'


# SLC

@pytest.mark.parametrize(('data', 'sts'), [
    ('A2 02 09 89 00 00', 0x10), ('A2 02 07 85 00 00', 0x10), ('A2 02 07 7F 00 00', 0x10),
    ('A2 02 07 89 04 00', 0x50), ('A2 0A 07 89 00 00', 0x50), ('A2 00 07 89 00 00', 0x10),
    ('A2 03 07 89 00 00', 0x10), ('A2 EE 07 89 00 00', 0x10), ('AA 00 07 89 00 00', 0x10),
    ('AA 01 07 89 00 00 01', 0x10), ('AA 04 07 89 03 00 01 00 02 00', 0x50),
    ('AA EC 07 89 00 00' + ' 00' * 236, 0x10), ('AB 00 07 89 00 00 FF FF', 0x10),
    ('AB 04 07 89 03 00 FF FF 01 00 02 00', 0x50), ('AB 02 09 89 00 00 FF FF 01 00', 0x10),
    ('A1 02 07 89 00', 0x10), ('A2 02 00 82 00 00', 0x10)])
def test_slc_refusals(data: str, sts: int) -> None:
    words = table(SLC, N7_0='00 00' * 4)
    assert ask(words, data) == (sts, '')
    assert words_at(words, 'N7:0', 4) == '00 00 ' * 3 + '00 00'


def test_slc_sub_element_is_a_word_of_the_element() -> None:
    words = table(SLC, T4_0=counting(9), I_3_0=counting(4))
    assert ask(words, 'A2 04 04 86 01 02') == (0, '05 00 06 00')
    assert ask(words, 'A2 04 01 8C 03 02') == (0, '02 00 03 00')


def test_slc_masked_write_masks_every_word() -> None:
    words = table(SLC, N7_0='FF FF 00 00 FF FF')
    assert ask(words, 'AB 04 07 89 00 00 0F 00 05 00 FF FF') == (0, '')
    assert words_at(words, 'N7:0', 3) == 'F5 FF 0F 00 FF FF'


@pytest.mark.parametrize('family', [PLC5, SLC])
@pytest.mark.parametrize(('cmd', 'data'), [
    (0x0F, ''), (0x0F, '00'), (0x0F, 'FF'), (0x06, '02'), (0x00, ''), (0x4F, '68'),
    (0x0F, '68'), (0x0F, '67 00'), (0x0F, '26'), (0x0F, 'A2'), (0x0F, 'AA 02'), (0x0F, 'AB')])
def test_what_is_no_command_of_the_family(family: PlcType, cmd: int, data: str) -> None:
    assert ask(table(family), data, cmd) == (0x10, '')


def test_families_do_not_take_each_others_commands() -> None:
    assert ask(table(SLC, N7_0='00 00'), '68 00 00 01 00 07 00 07 00 01 00') == (0x10, '')
    assert ask(table(PLC5, N7_0='00 00'), 'A2 02 07 89 00 00') == (0x10, '')


requests = st.one_of(
    st.binary(max_size=30),
    st.builds(bytes.__add__, st.sampled_from([b'\x68', b'\x67', b'\x26']), st.builds(
        lambda offset, total, mask, levels, tail: (
            bytes((offset, 0, total, 0, mask)) + levels + tail),
        st.integers(0, 3), st.integers(0, 4), st.sampled_from([7, 15, 6, 2]),
        st.binary(min_size=3, max_size=4),
        st.one_of(st.binary(max_size=8), st.just(b'\x01\x00'), st.just(b'\x93\x09\x42\x01\x00')))),
    st.builds(
        lambda fnc, size, file, code, place, data: (
            bytes((fnc, size, file, code)) + place + data[:size]),
        st.sampled_from([0xA2, 0xAA, 0xAB]), st.sampled_from([0, 1, 2, 4, 236, 255]),
        st.sampled_from([0, 1, 4, 7, 8, 9]), st.integers(0x80, 0x95),
        st.binary(min_size=2, max_size=8), st.binary(max_size=8)))


@PROPERTY
@given(requests, st.sampled_from([PLC5, SLC]), st.one_of(st.just(0x0F), st.integers(0, 255)),
       st.integers(0, 0xFFFF))
def test_any_bytes_have_one_reply(data: bytes, family: PlcType, cmd: int, tns: int) -> None:
    words = table(family, N7_0='00 00' * 4, T4_0='00 00' * 6, F8_0='00 00' * 4,
                  ST9_0='00 00' * 42, I_0='00 00', O_1='00 00')
    files = set(words)
    reply = Server(words).serve(Packet(1, 5, cmd, 0, tns, data))
    assert (reply.dst, reply.src, reply.cmd, reply.tns) == (5, 1, cmd | 0x40, tns)
    assert len(reply.data) <= 240
    if reply.sts:
        assert len(reply.data) == (reply.sts == 0xF0)
    assert set(words) == files
    assert len(words.read(Address.parse('N7:0', family), 4)) == 8
    assert ask(words, '68 00 00 05 00 07 00 07 00 05 00' if family is PLC5
               else 'A2 0A 07 89 00 00')[0] != 0  # no file has grown


@pytest.mark.parametrize(('family', 'data'), [
    (PLC5, '68 00 00 01 00 07 00 09 00 01 00'), (PLC5, '68 00 00 01 00 07 00 07 04 01 00'),
    (SLC, 'A2 02 09 89 00 00'), (SLC, 'A2 02 07 85 00 00'), (SLC, 'A2 02 07 89 04 00')])
def test_refusals_leave_nothing_behind(family: PlcType, data: str,
                                       monkeypatch: pytest.MonkeyPatch) -> None:
    depths = []
    server = Server(table(family, N7_0='00 00'))
    execute = server._execute

    def spy(command: Packet) -> bytes:
        try:
            return execute(command)
        except Refusal as refusal:
            depths.append(len(list(traceback.walk_tb(refusal.__traceback__))))
            raise

    monkeypatch.setattr(server, '_execute', spy)
    for _ in range(10):
        server.serve(Packet(1, 5, 0x0F, 0, 7, bytes.fromhex(data)))
    assert depths == [depths[0]] * 10


@pytest.mark.parametrize('family', [PLC5, SLC])
@pytest.mark.parametrize('data', ['', '10', '10 01 02 03 10 10'])
def test_echo_gives_the_data_back(family: PlcType, data: str) -> None:
    assert ask(table(family), f'00 {data}', 0x06) == (0, data)


@pytest.mark.parametrize(('family', 'size', 'begin'), [
    (PLC5, 36, '06 EB 15'), (SLC, 24, '00 EE 34 49')])
def test_diagnostic_status_names_the_emulated_processor(
        family: PlcType, size: int, begin: str) -> None:
    sts, data = ask(table(family), '03', 0x06)
    assert sts == 0
    assert data.startswith(begin)
    assert len(bytes.fromhex(data)) == size
