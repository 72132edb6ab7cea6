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

"""What the sniffer says of a radio modem network, against what has happened there."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from random import Random

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, Duplex, ENQ, message_frame, NAK
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.entries import Entry, Kind, Mark
from abdf1_ros.sniffer.traffic import TrafficDecoder
import pytest

OUT, IN, UNKNOWN = Direction.OUT, Direction.IN, Direction.UNKNOWN
RECORDER = 9
READ = bytes.fromhex('A2 04 07 89 00 00')


@dataclass(frozen=True, slots=True)
class Said:
    """A packet on the air: when it ends (s), who sends it, as what, and whether it is good."""

    time: float
    sender: int
    packet: Packet
    mark: Mark | None = None
    is_good: bool = True


def happening(random: Random, count: int) -> Iterator[Said]:
    """Yield commands and replies that are sent on, lost, repeated, damaged."""
    now = 0.0

    def said(packet: Packet, sender: int, mark: Mark | None = None) -> Iterator[Said]:
        nonlocal now
        now += random.uniform(0.02, 0.2)
        yield Said(now, sender, packet, mark)
        for forwarder in random.sample((7, 8, RECORDER), random.choice((0, 0, 1, 2))):
            if forwarder not in (packet.src, packet.dst):
                now += random.uniform(0.05, 0.3)
                yield Said(now, forwarder, packet, Mark.FORWARDED)

    for tns in range(count):
        src = random.choice((5, RECORDER)) if tns else RECORDER  # its number is known then
        dst = BROADCAST if random.random() < 0.1 else random.choice((1, 2))
        command = Packet(dst, src, 0x0F, 0, tns, READ)
        if random.random() < 0.2:  # damaged, and sent again
            now += 0.1
            yield Said(now, src, command, is_good=False)
            now += 1.5
        yield from said(command, src)
        if random.random() < 0.2:  # nobody has heard it
            now += random.uniform(1.2, 3.0)
            yield from said(command, src, Mark.RETRANSMISSION)
        if dst != BROADCAST:
            yield from said(command.reply(bytes(4)), dst)
        if dst != BROADCAST and random.random() < 0.1:  # nobody has heard the reply
            now += random.uniform(1.2, 3.0)
            yield from said(command, src, Mark.RETRANSMISSION)
            yield from said(command.reply(bytes(4)), dst, Mark.RETRANSMISSION)
        now += random.choice((0.0, 0.3, 4.0))


def chunks(told: Iterable[Said], is_recorded: bool) -> Iterator[Chunk]:
    """Yield it as node 9 has recorded it, or as it was heard at an aerial."""
    for said in told:
        frame = message_frame(said.packet.encode(), Checksum.CRC)
        frame = frame if said.is_good else frame[:9] + bytes((frame[9] ^ 0x24,)) + frame[10:]
        way = (OUT if said.sender == RECORDER else IN) if is_recorded else UNKNOWN
        yield Chunk(said.time, way, frame)


def sniffed(heard: Iterable[Chunk], session: TrafficDecoder) -> list[Entry]:
    return [*[entry for chunk in heard for entry in session.feed(chunk)], *session.finish()]


@pytest.mark.parametrize('is_recorded', [True, False])
@pytest.mark.parametrize('seed', range(10))
def test_each_packet_is_told_as_what_it_was(seed: int, is_recorded: bool) -> None:
    told = list(happening(Random(seed), 60))
    entries = sniffed(chunks(told, is_recorded), TrafficDecoder(duplex=Duplex.RADIO))
    assert len(entries) == len(told)
    for entry, said in zip(entries, told):
        if not said.is_good:
            assert (entry.kind, entry.marks) == (Kind.DAMAGED, ())
            continue
        assert entry.packet == said.packet
        assert entry.marks == (() if said.mark is None else (said.mark,)), said
        by_us = is_recorded and said.mark is Mark.FORWARDED and said.sender == RECORDER
        assert (', sent on by 9: ' in entry.text) is by_us
        # Each reply is that of its command, and counts once.
        assert (entry.latency is not None) is (said.packet.is_reply and said.mark is None)


def plain(count: int, *between: bytes) -> Iterator[Chunk]:
    """Yield transactions with symbols after each message."""
    for tns in range(count):
        command = Packet(1, 5, 0x0F, 0, tns, READ)
        for at, (way, packet) in enumerate(((OUT, command), (IN, command.reply(bytes(4))))):
            yield Chunk(tns + at / 10, way, message_frame(packet.encode(), Checksum.CRC))
            for symbol in between:
                yield Chunk(tns + at / 10 + 0.05, way.opposite, symbol)


def test_mode_is_found_where_replies_come_without_symbols() -> None:
    session = TrafficDecoder()
    sniffed([*plain(2), [*plain(2)][-1]], session)  # the same reply again shows nothing
    assert session.kind.duplex is Duplex.FULL
    sniffed(plain(3), session)
    assert session.kind.duplex is Duplex.RADIO
    sniffed([Chunk(99.0, IN, b'\x10\x04')], session)  # noise that would be half duplex
    assert session.kind.duplex is Duplex.RADIO


@pytest.mark.parametrize('symbol', [ACK, NAK, ENQ])
def test_full_duplex_stays_what_it_is_though_some_symbols_are_lost(symbol: bytes) -> None:
    session = TrafficDecoder()
    sniffed([*plain(2, symbol), *plain(2)], session)
    assert session.kind.duplex is Duplex.FULL
    sniffed([*plain(4), *plain(1, symbol)], session)  # taken for radio, and given up again
    assert session.kind.duplex is Duplex.FULL
    given = TrafficDecoder(duplex=Duplex.RADIO)
    sniffed(plain(1, symbol), given)
    assert given.kind.duplex is Duplex.RADIO
    one_way = TrafficDecoder()
    sniffed((chunk for chunk in plain(9) if chunk.direction is OUT), one_way)
    assert one_way.kind.duplex is Duplex.FULL
