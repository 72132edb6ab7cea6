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

"""The header of every message."""

from typing import Any

from abdf1_ros.df1.packet import begins_good_reply, HEADER_SIZE, Packet
from abdf1_ros.errors import FormatError
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all
from support.vectors import MESSAGES, Vector

COMMAND = Packet(dst=17, src=5, cmd=0x0F, sts=0, tns=0x0102, data=b'\xA2')


@for_all('vector', [entry for entry in MESSAGES if entry.header is not None])
def test_header_of_every_vector(vector: Vector) -> None:
    packet = vector.packet
    assert (packet.dst, packet.src, packet.cmd, packet.sts, packet.tns) == vector.header
    assert packet.data == vector.link_data[6:]
    assert packet.encode() == vector.link_data
    assert packet.is_reply is bool(vector.header is not None and vector.header[2] & 0x40)
    if vector.fnc is not None:
        assert packet.data[0] == vector.fnc


def test_tns_stands_low_byte_first() -> None:
    assert COMMAND.encode() == bytes.fromhex('11 05 0F 00 02 01 A2')


@given(st.binary(min_size=HEADER_SIZE, max_size=300))
def test_decode_and_encode_are_inverse(link_data: bytes) -> None:
    assert Packet.decode(link_data).encode() == link_data


@for_all('size', range(6))
def test_less_than_a_header_is_a_format_error(size: int) -> None:
    with pytest.raises(FormatError, match=f'^{size} bytes'):
        Packet.decode(bytes(size))


def test_bare_header_is_a_message() -> None:
    assert Packet.decode(b'\x01\x02\x4F\x00\x34\x12') == Packet(1, 2, 0x4F, 0, 0x1234)


def test_reply_swaps_the_addresses_and_copies_tns() -> None:
    assert COMMAND.reply(b'\x07', 0xF0) == Packet(5, 17, 0x4F, 0xF0, 0x0102, b'\x07')
    assert COMMAND.reply() == Packet(5, 17, 0x4F, 0, 0x0102)


def test_reply_answers_its_command() -> None:
    assert COMMAND.reply(b'data', 0x10).answers(COMMAND)


@for_all('change', [{'dst': 6}, {'src': 18}, {'tns': 0x0103}, {'tns': 0x0202}, {'cmd': 0x0F}])
def test_other_messages_do_not_answer(change: dict[str, Any]) -> None:
    assert not COMMAND.reply()._replace(**change).answers(COMMAND)


def test_answers_leaves_the_command_code_to_the_caller() -> None:
    assert COMMAND.reply()._replace(cmd=0x41).answers(COMMAND)


@for_all('change', [{'src': 6}, {'cmd': 0x0E}, {'tns': 0x0103}, {'tns': 0x0202}])
def test_duplicate_key_tells_messages_apart_by_src_cmd_and_tns(change: dict[str, Any]) -> None:
    assert COMMAND._replace(**change).duplicate_key != COMMAND.duplicate_key


def test_duplicate_key_passes_over_dst_sts_and_data() -> None:
    other = COMMAND._replace(dst=99, sts=0x10, data=b'other')
    assert other.duplicate_key == COMMAND.duplicate_key


@for_all(('packet', 'size', 'begins'), [
    (COMMAND.reply(b'words'), 11, True), (COMMAND.reply(b'words'), 6, True),
    (COMMAND.reply(b'words'), 5, False), (COMMAND.reply(b'words'), 0, False),
    (COMMAND.reply(sts=0x10), 6, False), (COMMAND, 7, False)])
def test_header_of_a_good_reply_is_known_before_its_end(
        packet: Packet, size: int, begins: bool) -> None:
    assert begins_good_reply(packet.encode()[:size]) is begins


def test_command_whose_fields_have_moved_is_not_sound() -> None:
    for tns in range(1, 0x10000, 0x101):
        command = COMMAND._replace(dst=0, tns=tns)
        assert command.is_sound
        assert command.reply(sts=0xF0).is_sound
        assert not Packet.decode(command.encode()[1:]).is_sound  # its leading 00 is lost
        assert not Packet.decode(b'\0' + command.encode()).is_sound  # or has come twice
