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

"""Cases for a full-duplex node that sends commands, such as a driver; we answer them."""

from __future__ import annotations

from collections.abc import Callable

from abdf1_ros.conform import codec
from abdf1_ros.conform.asking import expect_not_used
from abdf1_ros.conform.case import case, Target
from abdf1_ros.conform.codec import Symbol, SymbolKind
from abdf1_ros.conform.ends import (
    ack_timeout,
    expect_end_of_enquiries,
    expect_end_of_naks,
    PATIENCE,
    ServerEnd,
)
from abdf1_ros.conform.wire import expect_same, Failed, Skipped

_CLIENT = Target.CLIENT


@case('A message answered with DLE NAK is sent again.', 'M 4-5', _CLIENT)
def nak_repeated(end: ServerEnd) -> None:
    first = end.next_command()
    end.wire.send(codec.NAK)
    second = end.next_command('the message again')
    expect_same(first.data, second.data)
    end.finish(second)


@case('A message that is always answered with DLE NAK is given up.', 'M 4-5', _CLIENT)
def nak_limit(end: ServerEnd) -> None:
    expect_end_of_naks(end.wire, end.next_command().data, PATIENCE)


@case('Silence is answered with DLE ENQ, not with the message; DLE ACK then ends the message.',
      'M 4-5', _CLIENT)
def silence_enquired(end: ServerEnd) -> None:
    command = end.next_command()
    end.wire.expect(SymbolKind.ENQ, within=PATIENCE)
    end.finish(command)


@case('DLE ENQ is for a message without a response, not for one that was acknowledged.',
      'M 4-5', _CLIENT)
def no_needless_enquiry(end: ServerEnd) -> None:
    command = end.next_command()
    end.wire.send(codec.ACK)
    symbol = end.hear(ack_timeout(end.wire), answers=False)
    if symbol is None:
        end.reply_and_hear(command)
        return
    end.reply_to(command)
    if symbol.kind is SymbolKind.ENQ:
        raise Failed('no DLE ENQ after DLE ACK', str(symbol))
    raise Skipped('not judged: the time for a reply ends before the time for DLE ACK')


@case('DLE NAK as answer to DLE ENQ has the message sent again.', 'M 4-5, 4-13', _CLIENT)
def enquiry_nak_repeated(end: ServerEnd) -> None:
    command = end.next_command()
    end.wire.expect(SymbolKind.ENQ, within=PATIENCE)
    end.wire.send(codec.NAK)
    again = end.wire.expect(SymbolKind.MESSAGE, 'the message again')
    expect_same(command.data, again.data)
    end.finish(again)


@case('A good reply is acknowledged with DLE ACK.', 'M 4-7 to 4-9', _CLIENT)
def reply_acknowledged(end: ServerEnd) -> None:
    end.finish(end.next_command())


@case('A reply with a wrong check is answered with DLE NAK.', 'M 4-7 to 4-9', _CLIENT)
def bad_reply_refused(end: ServerEnd) -> None:
    _refuse(end)


def _refuse(end: ServerEnd, *then: bytes) -> None:
    """Send damaged replies and ``then``, each answered with DLE NAK; then send the good reply."""
    command = end.next_command()
    end.wire.send(codec.ACK)
    reply = codec.message(end.serve(command.data), end.wire.check)
    for raw in (*codec.all_damaged(reply, end.wire.check), *then):
        end.wire.send(raw)
        end.expect(SymbolKind.NAK)
    end.reply_and_hear(command, 'DLE ACK for the good reply')


def _expect_refused(end: ServerEnd, broken: Callable[[bytes], bytes]) -> None:
    """Send ``broken`` of a reply, which is answered with DLE NAK; then send the good reply."""
    command = end.next_command()
    end.wire.send(codec.ACK)
    end.wire.send(broken(end.serve(command.data)))
    end.expect(SymbolKind.NAK)
    end.reply_and_hear(command, 'DLE ACK for the good reply')


@case('A reply of fewer than six bytes is answered with DLE NAK.', 'M 4-4, 4-7 to 4-9', _CLIENT)
def short_reply_refused(end: ServerEnd) -> None:
    _expect_refused(end, lambda reply: codec.message(
        reply[:codec.HEADER_SIZE - 1], end.wire.check))


@case('DLE ENQ inside a reply ends it; the answer is DLE NAK.', 'M 4-7 to 4-9', _CLIENT)
def broken_reply_refused(end: ServerEnd) -> None:
    _expect_refused(end, lambda reply: codec.divided(
        codec.message(reply, end.wire.check))[0] + codec.ENQ)


@case('DLE ACK and DLE NAK that answer nothing, and DLE EOT, are ignored.', 'M 4-5, 4-7 to 4-9',
      _CLIENT)
def stray_symbols_ignored(end: ServerEnd) -> None:
    command = end.next_command()
    for raw in (codec.EOT, codec.ACK, codec.NAK, codec.ACK, codec.EOT):
        end.wire.send(raw)
    symbol = end.hear()
    if symbol is not None:
        raise Failed('silence: the message has been acknowledged', str(symbol))
    end.reply_and_hear(command)


@case('A reply that was answered with DLE NAK is not used.', 'M 4-7 to 4-9', _CLIENT)
def bad_reply_not_used(end: ServerEnd) -> None:
    def answer(command: Symbol) -> None:
        end.wire.send(codec.ACK)
        end.wire.send(codec.damaged(codec.message(end.serve(command.data), end.wire.check)))
        end.expect(SymbolKind.NAK)

    expect_not_used(end, answer)


@case('A message that never gets a response is given up after some DLE ENQ.', 'M 4-5', _CLIENT)
def enquiry_limit(end: ServerEnd) -> None:
    expect_end_of_enquiries(end.wire, end.next_command().data, PATIENCE)


def _expect_ack(end: ServerEnd, what: str) -> None:
    """Wait for the next response, whatever comes before it; it has to be DLE ACK."""
    symbol = end.wire.until(lambda heard: heard.kind in (SymbolKind.ACK, SymbolKind.NAK), what,
                            end.wire.answer_time)
    if symbol.kind is not SymbolKind.ACK:
        raise Failed(what, str(symbol))


@case('DLE ENQ has the last response repeated.', 'M 4-13', _CLIENT)
def enquiry_repeats_response(end: ServerEnd) -> None:
    end.finish(end.next_command())
    end.wire.send(codec.ENQ)
    _expect_ack(end, 'DLE ACK again')


@case('DLE ENQ after DLE NAK has DLE NAK repeated.', 'M 4-13', _CLIENT)
def enquiry_repeats_refusal(end: ServerEnd) -> None:
    _refuse(end, codec.ENQ)


@case('A reply that comes again is acknowledged again.', 'M 4-8', _CLIENT)
def duplicate_acknowledged(end: ServerEnd) -> None:
    command = end.next_command()
    end.finish(command)
    end.reply_to(command)
    _expect_ack(end, 'DLE ACK for a reply that came before')


@case('A response inside our reply counts, and is not part of it.', 'M 4-3', _CLIENT)
def embedded_response(end: ServerEnd) -> None:
    command = end.next_command()
    begun, rest = codec.divided(codec.message(end.serve(command.data), end.wire.check))
    end.wire.send(begun + codec.ACK + rest)
    end.expect(SymbolKind.ACK, 'DLE ACK for a reply with an embedded response')
