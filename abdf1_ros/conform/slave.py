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
Cases for a half-duplex slave; we are the master.

They send diagnostic echoes (CMD 06, FNC 00), which change nothing in the target.
"""

from __future__ import annotations

from abdf1_ros.conform import codec
from abdf1_ros.conform.case import case, Permission, Target
from abdf1_ros.conform.codec import SymbolKind
from abdf1_ros.conform.ends import check_reply, expect_limit, MasterEnd
from abdf1_ros.conform.wire import expect_same, Failed, Skipped

_SLAVE = Target.SLAVE
# Commands that are sent without a poll in between, to fill a slave's buffers.
_BURST = 8
_PAUSE = 0.1  # s


def _expect_nothing_held(end: MasterEnd) -> None:
    symbol = end.poll()
    if symbol is not None and symbol.kind is not SymbolKind.EOT:
        raise Failed('DLE EOT', str(symbol))


@case('A slave that has nothing to send answers a poll with DLE EOT.', 'KF2 4-31', _SLAVE)
def poll_idle(end: MasterEnd) -> None:
    symbol = end.poll()
    if symbol is None:
        raise Skipped('silence: EOT suppression may be on, or there is no station')
    if symbol.kind is not SymbolKind.EOT:
        raise Failed('DLE EOT', str(symbol))


@case('A good message is acknowledged with DLE ACK.', 'KF2 4-31', _SLAVE)
def message_acknowledged(end: MasterEnd) -> None:
    end.expect_acknowledged()


@case('A slave sends its reply as answer to a poll, not by itself.', 'KF2 4-31', _SLAVE)
def reply_waits_for_poll(end: MasterEnd) -> None:
    command = end.command()
    end.deliver(command)
    end.wire.expect_silence('the slave has not been polled')
    check_reply(command, end.collect())


@case('A poll of station 16 has its station doubled and its BCC not.', 'M 3-4, KF2 4-31', _SLAVE)
def poll_stuffing(end: MasterEnd) -> None:
    if end.station != codec.DLE:
        raise Skipped('only with station 16')
    if end.poll() is None:
        raise Failed('an answer to 10 05 10 10 F0', 'silence')


@case("The CRC of a master's message covers its station and STX.", 'M 5-6, 5-7', _SLAVE)
def crc_covers_station(end: MasterEnd) -> None:
    if end.wire.check is not codec.BlockCheck.CRC:
        raise Skipped('only with CRC')
    command = end.command()
    end.wire.send(end.frame(command)[:-2] + codec.check_bytes(command, end.wire.check))
    end.expect_nothing("the CRC was that of a slave's message")


@case('A poll with a wrong BCC is ignored.', 'KF2 4-31', _SLAVE)
def bad_poll_ignored(end: MasterEnd) -> None:
    end.wire.send(codec.damaged(codec.poll(end.station)))
    end.wire.expect_silence('the BCC was wrong')


@case('A message or poll of another station is ignored.', 'KF2 4-31', _SLAVE)
def other_station_ignored(end: MasterEnd) -> None:
    # Our own address: no slave has it.
    command = bytes((end.own,)) + end.command()[1:]
    end.wire.send(codec.master_message(end.own, command, end.wire.check))
    end.expect_nothing('the message was for another station')
    for station in (end.own, 0xFF):
        end.wire.send(codec.poll(station))
        end.wire.expect_silence('the poll was of another station')


@case('A reply that was not acknowledged is sent again at the next poll.', 'KF2 4-31', _SLAVE)
def unacknowledged_again(end: MasterEnd) -> None:
    end.deliver(end.command(body=b'\x00again'))
    first = end.collect(acknowledge=False)
    second = end.collect()
    expect_same(first, second)


@case('A reply that was acknowledged is not sent again.', 'KF2 4-31', _SLAVE)
def acknowledged_dropped(end: MasterEnd) -> None:
    end.deliver(end.command())
    end.collect()
    _expect_nothing_held(end)


@case('A message that is never acknowledged is dropped after some polls.', 'KF2 4-31', _SLAVE)
def repetitions_limited(end: MasterEnd) -> None:
    end.deliver(end.command())
    end.collect(acknowledge=False)

    def comes() -> bool:
        symbol = end.poll()
        return symbol is not None and symbol.kind is not SymbolKind.EOT

    expect_limit('the message again', comes)


@case('A slave that can take no more messages does not acknowledge; what it has acknowledged is '
      'answered.', 'KF2 4-31', _SLAVE)
def full_is_silent(end: MasterEnd) -> None:
    offered, accepted = {}, set()
    for _ in range(_BURST):
        command = end.command()
        offered[command[4:6]] = command
        symbol = end.offer(command)
        if symbol is not None and symbol.kind is not SymbolKind.ACK:
            raise Failed('DLE ACK or silence', str(symbol))
        if symbol is not None:
            accepted.add(command[4:6])
        elif accepted:
            break
    is_tried = symbol is None and bool(accepted)
    while accepted:
        reply = end.collect()
        check_reply(offered.get(reply[4:6], command), reply)
        accepted.discard(reply[4:6])
        end.wire.expect_silence('one message is the answer to a poll', _PAUSE)
    if not is_tried:
        raise Skipped(f'not tried: it has taken all of {_BURST} messages, or none')


@case('DLE ACK after the poll of another station is not for ours, and drops no reply.',
      'KF2 4-31', _SLAVE)
def other_ack_ignored(end: MasterEnd) -> None:
    def acknowledge_another() -> None:
        end.wire.send(codec.poll(end.own))
        end.wire.expect_silence('the poll was of another station')
        end.wire.send(codec.ACK)

    command = end.command(body=b'\x00kept')
    end.deliver(command)
    acknowledge_another()
    first = check_reply(command, end.collect(acknowledge=False))
    acknowledge_another()
    symbol = end.further(end.wire.answer_time)
    if symbol is None:
        raise Skipped('a reply that was sent is dropped at any DLE ACK, as KF2 4-31 has it')
    expect_same(first, end.taken(symbol))


@case('A message to station 255 is neither acknowledged nor answered.', 'M 3-4', _SLAVE)
def broadcast_unanswered(end: MasterEnd) -> None:
    command = bytes((0xFF,)) + end.command()[1:]
    end.wire.send(codec.master_message(0xFF, command, end.wire.check))
    end.wire.expect_silence('the message was a broadcast')
    symbol = end.further(end.wire.answer_time)
    if symbol is not None and symbol.kind is SymbolKind.MESSAGE:
        raise Failed('no reply to a broadcast', end.taken(symbol).hex(' '))


@case('DLE NAK makes every slave drop what it holds.',
      'M 2-7, 3-11', _SLAVE, permission=Permission.RESET)
def nak_resets(end: MasterEnd) -> None:
    end.deliver(end.command())
    end.collect(acknowledge=False)
    if end.further(end.reply_time) is None:
        raise Skipped('not tried: it does not hold what it has sent')
    end.wire.send(codec.NAK)
    end.wire.expect_silence('DLE NAK has no answer')
    _expect_nothing_held(end)
