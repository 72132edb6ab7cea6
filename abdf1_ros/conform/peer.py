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

"""Cases for a full-duplex node that answers commands, such as a PLC; we send them."""

from __future__ import annotations

from abdf1_ros.conform import codec
from abdf1_ros.conform.case import case, Target
from abdf1_ros.conform.codec import Symbol, SymbolKind
from abdf1_ros.conform.ends import (
    ack_timeout,
    check_reply,
    expect_end_of_enquiries,
    expect_end_of_naks,
    LONGEST_ACK_TIMEOUT,
    MOST_TRIES,
    PeerEnd,
)
from abdf1_ros.conform.wire import expect_same, Failed

_PEER = Target.PEER
_MOMENT = 0.3  # s


def _answer(end: PeerEnd, frame: bytes, kind: SymbolKind) -> None:
    end.wire.send(frame)
    end.wire.expect(kind)


@case('A good message is acknowledged with DLE ACK.', 'M 4-7 to 4-9', _PEER)
def message_acknowledged(end: PeerEnd) -> None:
    end.expect_acknowledged()


@case('A message with a wrong check is answered with DLE NAK.', 'M 4-7 to 4-9', _PEER)
def bad_check_refused(end: PeerEnd) -> None:
    for raw in codec.all_damaged(end.frame(end.command()), end.wire.check):
        _answer(end, raw, SymbolKind.NAK)


@case('A message of fewer than six bytes is answered with DLE NAK.', 'M 4-4, 4-7 to 4-9', _PEER)
def short_message_refused(end: PeerEnd) -> None:
    _answer(end, end.frame(end.command()[:5]), SymbolKind.NAK)


@case('DLE ENQ inside a message ends it; the answer is DLE NAK.', 'M 4-7 to 4-9', _PEER)
def broken_message_refused(end: PeerEnd) -> None:
    end.ask(0x06, b'\x00')  # so that the last response is DLE ACK
    begun, rest = codec.divided(end.frame(end.command()))
    _answer(end, begun + codec.ENQ, SymbolKind.NAK)
    end.wire.expect_silence('the message has its response', _MOMENT)
    end.wire.send(rest)
    symbol = end.wire.hear()
    if symbol is not None and symbol.kind is not SymbolKind.NAK:
        raise Failed('no answer to the rest of a message that has ended', str(symbol))


@case('DLE ENQ has the last response repeated: DLE ACK.', 'M 4-5, 4-13', _PEER)
def enquiry_after_ack(end: PeerEnd) -> None:
    end.ask(0x06, b'\x00')
    _answer(end, codec.ENQ, SymbolKind.ACK)


@case('DLE ENQ has the last response repeated: DLE NAK.', 'M 4-5, 4-13', _PEER)
def enquiry_after_nak(end: PeerEnd) -> None:
    _answer(end, codec.damaged(end.frame(end.command())), SymbolKind.NAK)
    _answer(end, codec.ENQ, SymbolKind.NAK)


@case('After bytes that are no message DLE ENQ gets DLE NAK, not an earlier DLE ACK.',
      'M 4-7 to 4-9', _PEER)
def enquiry_after_noise(end: PeerEnd) -> None:
    end.ask(0x06, b'\x00')
    end.wire.send(b'\x55\x00')
    _answer(end, codec.ENQ, SymbolKind.NAK)


@case('DLE ACK and DLE NAK that answer nothing, and DLE EOT, are ignored.', 'M 4-5, 4-7 to 4-9',
      _PEER)
def stray_symbols_ignored(end: PeerEnd) -> None:
    end.ask(0x06, b'\x00')
    for raw in (codec.ACK, codec.NAK, codec.EOT):
        end.wire.send(raw)
        end.wire.expect_silence('all messages have their responses')
    end.ask(0x06, b'\x00')


@case('A message answered with DLE NAK is sent again.', 'M 4-5', _PEER)
def reply_repeated_after_nak(end: PeerEnd) -> None:
    end.deliver(end.command(body=b'\x00again'))
    first = end.collect(acknowledge=False)
    end.wire.send(codec.NAK)
    second = end.collect()
    expect_same(first, second)


@case('A message that is always answered with DLE NAK is given up.', 'M 4-5', _PEER)
def nak_limit(end: PeerEnd) -> None:
    end.deliver(end.command())
    expect_end_of_naks(end.wire, end.collect(acknowledge=False), ack_timeout(end.wire))


@case('A message without any response is followed by DLE ENQ; DLE ACK ends it.', 'M 4-5', _PEER)
def silence_is_enquired(end: PeerEnd) -> None:
    end.deliver(end.command())
    end.collect(acknowledge=False)
    end.wire.expect(SymbolKind.ENQ, within=LONGEST_ACK_TIMEOUT)
    end.wire.send(codec.ACK)
    _expect_no_enquiry(end)


def _expect_no_enquiry(end: PeerEnd) -> None:
    symbol = end.wire.hear(ack_timeout(end.wire), answers=False)
    if symbol is not None:
        raise Failed('silence: the message has been acknowledged', str(symbol))


@case('DLE ENQ is for a message without a response, not for one that was acknowledged.',
      'M 4-5', _PEER)
def no_needless_enquiry(end: PeerEnd) -> None:
    end.ask(0x06, b'\x00')
    _expect_no_enquiry(end)


@case('A message that never gets a response is given up after some DLE ENQ.', 'M 4-5', _PEER)
def enquiry_limit(end: PeerEnd) -> None:
    end.deliver(end.command())
    message = end.collect(acknowledge=False)
    expect_end_of_enquiries(end.wire, message, ack_timeout(end.wire))


def _embed(end: PeerEnd, command: bytes, response: bytes) -> Symbol | None:
    """Send a command with ``response`` inside, again after DLE NAK; return the symbol heard."""
    begun, rest = codec.divided(end.frame(command))
    symbol = None
    for _ in range(MOST_TRIES):
        for part in (begun, response, rest):
            end.wire.send(part)
        symbol = end.wire.hear(answers=False)
        if symbol is None or symbol.kind is not SymbolKind.NAK:
            break
    return symbol


def _hear_next(end: PeerEnd) -> Symbol | None:
    """Return what comes after the answer to ``_embed``, which may be a reply."""
    return end.wire.hear(max(ack_timeout(end.wire), end.reply_time), answers=False)


@case('A response inside a message counts, and is not part of the message.', 'M 4-3', _PEER)
def embedded_response(end: PeerEnd) -> None:
    first, second = end.command(body=b'\x00one'), end.command(body=b'\x00two')
    end.deliver(first)
    check_reply(first, end.collect(acknowledge=False))
    heard = _embed(end, second, codec.ACK), _hear_next(end)
    kinds = {symbol.kind: symbol for symbol in heard if symbol}  # the reply may be the first
    if SymbolKind.ACK not in kinds:
        raise Failed('DLE ACK for a message with an embedded response', str(heard[0] or 'silence'))
    if SymbolKind.MESSAGE not in kinds:
        raise Failed('the next reply: the first has been acknowledged', str(heard[1] or 'silence'))
    check_reply(second, end.taken(kinds[SymbolKind.MESSAGE]))


@case('DLE NAK inside a message has the reply that it is for sent again.', 'M 4-3, 4-5', _PEER)
def embedded_nak(end: PeerEnd) -> None:
    first, second = end.command(body=b'\x00one'), end.command(body=b'\x00two')
    end.deliver(first)
    refused = check_reply(first, end.collect(acknowledge=False))
    response = _embed(end, second, codec.NAK)
    heard = {symbol.kind: symbol for symbol in (response, _hear_next(end)) if symbol}
    again = heard.get(SymbolKind.MESSAGE)
    if again is None or again.data != refused:
        raise Failed('the reply again that was refused', again.data.hex(' ') if again else
                     ', '.join(kind.value for kind in heard) or 'silence')
    end.taken(again)
    if SymbolKind.ACK in heard:
        check_reply(second, end.collect())
