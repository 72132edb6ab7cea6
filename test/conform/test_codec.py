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

"""The second codec against bytes that manuals print."""

from abdf1_ros.conform import codec
from abdf1_ros.conform.codec import BlockCheck, Symbol, SymbolKind
import pytest
from support.cases import for_all
from support.conversations import Conversation, CONVERSATIONS
from support.listeners import said_by_codec

# M 5-4 and 5-5: DST 08 ... with a byte 10, which is doubled; to station 20 (hex) as a master.
LINK_DATA = bytes.fromhex('08 09 06 00 10 04 03')


def test_crc_has_the_check_value_of_its_polynomial() -> None:
    assert codec.crc(b'123456789') == 0xBB3D


@for_all(('frame', 'printed'), [
    (codec.message(LINK_DATA, BlockCheck.BCC), '10 02 08 09 06 00 10 10 04 03 10 03 D2'),
    (codec.master_message(0x20, LINK_DATA, BlockCheck.BCC),
     '10 01 20 10 02 08 09 06 00 10 10 04 03 10 03 B2'),
    (codec.message(bytes.fromhex('07 11 41 00 53 B9' + '00' * 12), BlockCheck.CRC),  # M 5-7
     '10 02 07 11 41 00 53 B9' + '00' * 12 + '10 03 6B 4C'),
    # M 14-2
    (codec.master_message(0x11, bytes.fromhex('11 07 01 00 41 00 12 00 0C'), BlockCheck.CRC),
     '10 01 11 10 02 11 07 01 00 41 00 12 00 0C 10 03 CF 40'),
    (codec.poll(0x11), '10 05 11 EF'),  # M 14-2
    (codec.poll(0x10), '10 05 10 10 F0'),
])
def test_frames_are_those_of_the_manual(frame: bytes, printed: str) -> None:
    assert frame == bytes.fromhex(printed)


@for_all(('raw', 'is_half_duplex', 'symbol'), [
    ('10 06 10', True, Symbol(SymbolKind.ACK, codec.ACK)),
    ('10 05', False, Symbol(SymbolKind.ENQ, codec.ENQ)),
    ('10 05 11 EF', True, Symbol(SymbolKind.POLL, bytes.fromhex('100511EF'), station=0x11)),
    ('10 05 11 EE', True, Symbol(SymbolKind.POLL, bytes.fromhex('100511EE'), station=0x11,
                                 is_good=False)),
    ('55 00 10 06', True, Symbol(SymbolKind.NOISE, b'\x55\x00')),
    ('10 02 08 10 10 10 03 E8', True,
     Symbol(SymbolKind.MESSAGE, bytes.fromhex('1002081010 1003E8'), b'\x08\x10')),
    ('10 02 08 10 06 09 10 03 EF', False,
     Symbol(SymbolKind.MESSAGE, bytes.fromhex('10020810060910 03EF'), b'\x08\x09',
            embedded=(SymbolKind.ACK,))),
    ('10 02 08 10 03 F9', True,
     Symbol(SymbolKind.MESSAGE, bytes.fromhex('100208 1003F9'), b'\x08', is_good=False)),
    ('10 02 08 10 05', False, Symbol(SymbolKind.NOISE, b'\x10\x02\x08')),
    ('10 02 08 10 03', True, None),
    ('10', True, None),
    ('', True, None),
])
def test_bytes_become_symbols(raw: str, is_half_duplex: bool, symbol: Symbol | None) -> None:
    assert codec.next_symbol(bytes.fromhex(raw), BlockCheck.BCC, is_half_duplex) == symbol


@pytest.mark.parametrize('is_half_duplex', [True, False])
def test_frame_is_awaited_to_its_last_byte(is_half_duplex: bool) -> None:
    master = [codec.master_message(0x10, LINK_DATA, BlockCheck.CRC), codec.poll(0x10),
              codec.poll(0x11)] if is_half_duplex else []
    for frame in (codec.message(LINK_DATA, BlockCheck.CRC), codec.EOT, *master):
        found = [codec.next_symbol(frame[:size], BlockCheck.CRC, is_half_duplex)
                 for size in range(len(frame) + 1)]
        assert found[:-1] == [None] * len(frame)
        assert found[-1] is not None and (found[-1].raw, found[-1].is_good) == (frame, True)


def test_frame_is_divided_and_damaged_where_a_case_says() -> None:
    for data in (b'\x08\x09', b'\x10\x09'):
        frame = codec.message(data, BlockCheck.CRC)
        begun, rest = codec.divided(frame)
        assert codec.next_symbol(begun + codec.ACK + rest, BlockCheck.CRC, False) == Symbol(
            SymbolKind.MESSAGE, begun + codec.ACK + rest, data, embedded=(SymbolKind.ACK,))
        assert [[at - len(frame) for at, byte in enumerate(other) if byte != frame[at]]
                for other in codec.all_damaged(frame, BlockCheck.CRC)] == [[-2], [-1]]


def test_symbol_is_shown_in_words() -> None:
    assert [str(codec.next_symbol(codec.damaged(frame), BlockCheck.BCC, True)) for frame in (
        codec.message(LINK_DATA, BlockCheck.BCC), codec.poll(1))] == [
        'a message with a wrong check', 'a poll with a wrong check']


@for_all('conversation', CONVERSATIONS)
def test_conversations_are_read_as_they_say(conversation: Conversation) -> None:
    for line, words in said_by_codec(conversation):
        assert ' + '.join(words) == line['says'].replace(' again', '')
