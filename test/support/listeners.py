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

"""What the codec of conform and the sniffer hear of a conversation."""

from __future__ import annotations

from collections.abc import Iterator

from abdf1_ros.conform import codec
from abdf1_ros.conform.codec import Symbol, SymbolKind
from abdf1_ros.df1.frames import Duplex, MAX_LINK_DATA
from abdf1_ros.df1.packet import REPLY_BIT
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.entries import Entry, Kind, Mark
from abdf1_ros.sniffer.traffic import TrafficDecoder
from support.conversations import Conversation, Line

_PAUSE = 150  # ms that end what has broken off
_PART = 'part of a message'
_AGAIN = {Mark.RETRANSMISSION, Mark.DUPLICATE, Mark.FORWARDED}


def said_by_codec(conversation: Conversation) -> Iterator[tuple[Line, list[str]]]:
    """Yield what the codec of conform reads in each line."""
    check = codec.BlockCheck(conversation.entry['check'])
    is_half = conversation.mode.duplex is Duplex.HALF
    begun = {'we': (b'', 0, 0.0), 'they': (b'', 0, 0.0)}  # bytes, responses inside, time
    for line, data in conversation.said():
        side = 'we' if 'we' in line else 'they'
        buffer, told, last = begun[side]
        if line['at'] - last > _PAUSE:
            buffer, told = b'', 0
        buffer, words = buffer + data, []
        while (symbol := codec.next_symbol(buffer, check, is_half)) is not None:
            buffer = buffer[len(symbol.raw):]
            words += [*(kind.value for kind in symbol.embedded[told:]), _word(symbol)]
            told = 0
        # What a message has inside when it breaks off here.
        begin = codec.next_symbol(buffer + b'\x10\x03\0\0', check, is_half)
        inside = begin.embedded if begin else ()
        words += [_PART] * bool(buffer) + [kind.value for kind in inside[told:]]
        begun[side] = buffer, len(inside), line['at']
        yield line, words


def _word(symbol: Symbol) -> str:
    if symbol.kind is SymbolKind.NOISE:
        return 'noise'
    if symbol.kind is SymbolKind.POLL:
        return 'poll' if symbol.is_good else 'damaged poll'
    if symbol.kind not in (SymbolKind.MESSAGE, SymbolKind.MASTER_MESSAGE):
        return str(symbol.kind.value)
    if not symbol.is_good:
        return 'damaged'
    if not codec.HEADER_SIZE <= len(symbol.data) <= MAX_LINK_DATA:
        return 'too short' if len(symbol.data) < codec.HEADER_SIZE else 'too long'
    return 'reply' if symbol.data[2] & REPLY_BIT else 'command'


def heard_by_sniffer(conversation: Conversation) -> list[tuple[str, Entry]]:
    """Return what the sniffer hears, and who has said it."""
    decoder = TrafficDecoder(conversation.checksum, conversation.mode.duplex)
    sides = {Direction.OUT: 'we', Direction.IN: 'they', Direction.UNKNOWN: ''}
    heard = [entry for line, data in conversation.said() for entry in decoder.feed(Chunk(
        line['at'] / 1000, Direction.OUT if 'we' in line else Direction.IN, data))]
    return [(sides[entry.direction], entry) for entry in (*heard, *decoder.finish())]


def said_by_sniffer(conversation: Conversation) -> Iterator[tuple[str, str]]:
    """Yield who says what, as the sniffer hears it, but for what is no symbol."""
    for side, entry in heard_by_sniffer(conversation):
        if entry.kind in (Kind.ACK, Kind.NAK, Kind.EOT, Kind.ENQ):
            yield side, f'DLE {entry.kind.value}'
        elif entry.kind in (Kind.POLL, Kind.COMMAND, Kind.REPLY, Kind.DAMAGED):
            again = ' again' * bool(_AGAIN & {*entry.marks})
            is_bad_poll = entry.kind is Kind.POLL and not entry.valid
            yield side, 'damaged ' * is_bad_poll + entry.kind.value + again
