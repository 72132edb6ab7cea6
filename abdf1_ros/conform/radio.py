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

"""
Cases for a node of a DF1 radio modem network: one that answers commands, and one that sends them.

"SLC 13-76" is 1747-RM001G, page 13-76; "ML11 517" is 1763-RM001C, page 517. The target is alone on
the line. It may forward a packet for another node once, if its settings allow it.
"""

from __future__ import annotations

from abdf1_ros.conform import codec
from abdf1_ros.conform.case import case, Permission, Target
from abdf1_ros.conform.codec import Symbol, SymbolKind
from abdf1_ros.conform.data import changes_nothing
from abdf1_ros.conform.ends import header, PATIENCE, RadioEnd, RadioServerEnd
from abdf1_ros.conform.wire import expect_same, Failed, Skipped

_NODE, _SENDER = Target.RADIO, Target.RADIO_CLIENT
_RULES = 'SLC 13-76 to 13-80'
_SENDING_ON = 'ML11 517 to 522'

_BROADCAST = 0xFF
_ACK_TIMEOUT = 6.0  # s; the slowest full-duplex node sends DLE ENQ within this time
_MOMENT = 0.3  # s; a node that accepts a frame that it should drop sends within this time
_CUT = 6  # bytes of a frame
_COUNTERS = b'\x01\x00\x00\x1A'  # FNC, address and size of a read of diagnostic counters


def _sent_on(end: RadioEnd, command: bytes) -> int:
    """
    Send a message that is not for the target; return how often the target forwards it.

    Raises Failed for a reply, or any other symbol.
    """
    end.send(command)
    until, count = end.wire.now + 2 * end.wire.answer_time, 0
    while (symbol := end.wire.hear(max(until - end.wire.now, 0.0))) is not None:
        if symbol.data != command:
            raise Failed('silence, or the packet sent on as it was', str(symbol))
        count += 1
    return count


@case('A command is answered by its reply, and by nothing before or after it.', _RULES, _NODE)
def reply_alone(end: RadioEnd) -> None:
    end.ask(0x06, b'\x00')
    end.wire.expect_silence('the reply needs no response', _ACK_TIMEOUT)


@case('DLE ACK, NAK, ENQ and EOT are noise here: they get no answer.', _RULES, _NODE)
def symbols_ignored(end: RadioEnd) -> None:
    end.ask(0x06, b'\x00')
    end.wire.expect_silence('one reply, which may be sent on')
    for symbol in (codec.NAK, codec.ENQ, codec.ACK, codec.EOT):
        end.wire.forget_reply()
        end.wire.send(symbol)
        end.wire.expect_silence('symbols mean nothing here')
    end.ask(0x06, b'\x00')


@case('A command for another DST gets no reply.', _RULES, _NODE)
def other_destination_ignored(end: RadioEnd) -> None:
    _sent_on(end, bytes((end.another,)) + end.command()[1:])


@case('A command for another DST is not executed.', _RULES, _NODE, permission=Permission.WRITE)
def other_destination_not_executed(end: RadioEnd) -> None:
    changes_nothing(end, lambda command: _sent_on(
        end, bytes((end.another,)) + command[1:]))


@case('A command for station 255 gets no reply.', _RULES, _NODE)
def broadcast_unanswered(end: RadioEnd) -> None:
    _sent_on(end, bytes((_BROADCAST,)) + end.command()[1:])


@case('A command that comes again is dropped, or gets the same reply: it is executed once.',
      _RULES, _NODE)
def duplicate_executed_once(end: RadioEnd) -> None:
    before = end.ask(0x06, _COUNTERS)
    command = end.command(0x06, _COUNTERS)
    first = end.carry_out(command)
    if first[3] or first[codec.HEADER_SIZE:] == before[codec.HEADER_SIZE:]:
        raise Skipped('only counters that count (CMD 06, FNC 01) show what is executed')
    again = end.attempt(command)
    if again not in (None, first):
        raise Failed('silence, or the same reply', again.hex(' '))


@case('A packet for another node is sent on once at most, though it is heard again.',
      _SENDING_ON, _NODE)
def sent_on_once(end: RadioEnd) -> None:
    command = bytes((end.another,)) + end.command()[1:]
    count = sum(_sent_on(end, command) for _ in range(3))
    if count > 1:
        raise Failed('the packet once, or not at all', f'{count} times')
    if not count:
        raise Skipped('not tried: the node forwards nothing')


@case('A packet whose SRC is the number of the node comes back to it: it is dropped.',
      _SENDING_ON, _NODE)
def own_packet_dropped(end: RadioEnd) -> None:
    reply = end.ask(0x06, b'\x00')
    # With another TNS: the wire passes over a reply that comes again as it was.
    for packet in (reply[:4] + bytes((reply[4] ^ 0x55,)) + reply[5:],
                   header(end.another, end.station, 0x06, 1)):
        end.send(packet)
        end.wire.expect_silence('it is a packet of its own', 2 * end.wire.answer_time)


@case('A reply is taken without DLE ACK or any other response.', _RULES, _SENDER)
def reply_taken(end: RadioServerEnd) -> None:
    command = end.next_command()
    end.finish(command)
    end.expect_taken(command)


@case('A command without a reply gets no DLE ENQ. Sent again, it is as it was.', _RULES, _SENDER)
def silence_not_enquired(end: RadioServerEnd) -> None:
    first = end.next_command()
    second = end.expect(SymbolKind.MESSAGE, 'no symbol before the next message', PATIENCE)
    if second.data[4:6] == first.data[4:6]:
        expect_same(first.data, second.data)
    end.finish(second)


def _not_taken(end: RadioServerEnd, command: Symbol, *frames: bytes) -> None:
    """
    Send frames before the reply to a command, then the reply.

    Before the reply the target may only forward frames that have the SRC of another node, and ask
    another station. Raises Skipped if it also waits that long after the reply.
    """
    for frame in frames:
        end.wire.send(frame)
    while (symbol := end.hear(_MOMENT)) is not None:
        if symbol.raw not in frames or symbol.data[1] == command.data[1]:
            raise Failed('silence: the reply has not come', str(symbol))
    end.finish(command)
    end.expect_taken(command, _MOMENT)


@case('A reply with a wrong check is dropped in silence.', _RULES, _SENDER)
def bad_reply_ignored(end: RadioServerEnd) -> None:
    command = end.next_command()
    reply = codec.message(end.serve(command.data), end.wire.check)
    _not_taken(end, command, codec.damaged(reply))


@case('A reply that breaks off, or has fewer than six bytes, is dropped in silence.', _RULES,
      _SENDER)
def cut_reply_ignored(end: RadioServerEnd) -> None:
    def broken(reply: bytes) -> bytes:
        return codec.message(reply, end.wire.check)[:_CUT]

    def short(reply: bytes) -> bytes:
        return codec.message(reply[:codec.HEADER_SIZE - 1], end.wire.check)

    for cut in (broken, short):
        command = end.next_command()
        _not_taken(end, command, cut(end.serve(command.data)))


@case('A reply to another node, or to another command, is not taken.', _RULES, _SENDER)
def other_reply_ignored(end: RadioServerEnd) -> None:
    command = end.next_command()
    dst, *middle, low, high = end.serve(command.data)[:codec.HEADER_SIZE]
    _not_taken(end, command, *(codec.message(bytes(reply), end.wire.check) for reply in (
        (dst ^ 0x55, *middle, low, high), (dst, *middle, low ^ 0x55, high))))


@case('A reply that comes again, as a node has sent it on, is dropped in silence.',
      _SENDING_ON, _SENDER)
def duplicate_reply_ignored(end: RadioServerEnd) -> None:
    command = end.next_command()
    end.finish(command)
    end.finish(command)
    end.expect_taken(command)


@case('A packet whose SRC is the number of the node comes back to it: it is dropped.',
      _SENDING_ON, _SENDER)
def own_command_dropped(end: RadioServerEnd) -> None:
    command = end.next_command()
    _not_taken(end, command, command.raw)
