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

"""From bytes to entries: on vectors, conversations, recordings, and a radio modem network."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from random import Random

from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, Duplex, ENQ, message_frame, NAK
from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.entries import Entry, Kind, Mark
from abdf1_ros.sniffer.traffic import TrafficDecoder
import pytest
from support.captures import Capture, CAPTURES, FOLDER
from support.cases import for_all
from support.conversations import Conversation, CONVERSATIONS, heard_by_sniffer, said_by_sniffer
from support.multidrop import MasterBench
from support.vectors import Vector, VECTORS
from support.virtual_line import Noise, QUIET

OUT, IN, UNKNOWN = Direction.OUT, Direction.IN, Direction.UNKNOWN
COMMAND = Packet(1, 5, 0x0F, 0, 0x1234, bytes.fromhex('A2 04 07 89 00 00'))
REPLY = COMMAND.reply(bytes.fromhex('34 12 FE FF'))
WORDS = 'protected typed logical read N7:0, 2 words'
_BAD = (Kind.DAMAGED, Kind.UNKNOWN, Kind.NOISE)


def master(packet: Packet, checksum: Checksum = Checksum.CRC) -> bytes:
    return frames.master_frame(packet.dst, packet.encode(), checksum)


def message(packet: Packet, checksum: Checksum = Checksum.CRC) -> bytes:
    return frames.message_frame(packet.encode(), checksum)


TRANSACTION = [(OUT, master(COMMAND)), (IN, frames.ACK), (OUT, frames.poll_frame(1)),
               (IN, message(REPLY)), (OUT, frames.ACK), (OUT, frames.poll_frame(1)),
               (IN, frames.EOT)]


def decode(said: Iterable[tuple[Direction, bytes]], session: TrafficDecoder | None = None,
           pause: float = 0.01) -> list[Entry]:
    """Return the entries of a conversation in which something is said every ``pause`` s."""
    session = session or TrafficDecoder()
    found: list[Entry] = []
    for count, (direction, data) in enumerate(said):
        found += session.feed(Chunk(count * pause, direction, data))
    return [*found, *session.finish()]


def kinds(entries: Iterable[Entry]) -> list[Kind]:
    return [entry.kind for entry in entries]


def one_wire(said: Iterable[tuple[Direction, bytes]]) -> Iterator[tuple[Direction, bytes]]:
    """Yield the same, heard on a line where nobody can tell who speaks."""
    for _, data in said:
        yield UNKNOWN, data


@pytest.mark.parametrize('directions', [list, one_wire])
def test_transaction_is_told_symbol_by_symbol(
        directions: type[list[tuple[Direction, bytes]]]) -> None:
    entries = decode(directions(TRANSACTION))
    assert kinds(entries) == [Kind.COMMAND, Kind.ACK, Kind.POLL, Kind.REPLY, Kind.ACK, Kind.POLL,
                              Kind.EOT]
    assert [entry.direction for entry in entries] == [OUT, IN, OUT, IN, OUT, OUT, IN]
    assert [entry.station for entry in entries] == [1] * 7
    command, reply = entries[0], entries[3]
    assert command.text == f'5 to 1, TNS 1234: {WORDS}'
    assert reply.text == '1 to 5, TNS 1234: 4660 -2'
    assert (reply.packet, reply.checksum, reply.valid) == (REPLY, Checksum.CRC, True)
    assert reply.latency == pytest.approx(0.03)
    assert entries[2].valid
    assert not any(entry.marks for entry in entries)


@for_all('checksum', list(Checksum))
@for_all('given', [False, True])
def test_check_is_found_or_given(checksum: Checksum, given: bool) -> None:
    said = [(OUT, master(COMMAND, checksum)), (IN, frames.ACK), (OUT, frames.poll_frame(1)),
            (IN, message(REPLY, checksum)), (OUT, frames.ACK)]
    session = TrafficDecoder(checksum if given else None, Duplex.HALF if given else None)
    entries = decode(one_wire(said), session)
    assert kinds(entries) == [Kind.COMMAND, Kind.ACK, Kind.POLL, Kind.REPLY, Kind.ACK]
    assert {entry.checksum for entry in entries if entry.packet} == {checksum}
    assert (session.kind.checksum, session.kind.duplex) == (checksum, Duplex.HALF)
    assert [entry.direction for entry in decode(said)] == [OUT, IN, OUT, IN, OUT]


def test_wrong_check_is_marked_and_taken_no_further() -> None:
    damaged = bytearray(master(COMMAND._replace(data=b'')))
    damaged[7] ^= 0x01
    bad, silence, good = decode([(OUT, bytes(damaged)), (OUT, master(COMMAND))],
                                TrafficDecoder(Checksum.CRC))[:3]
    assert (bad.kind, bad.valid, bad.checksum, bad.station) == (
        Kind.DAMAGED, False, Checksum.CRC, 1)
    assert bad.text == 'wrong check: B2C5, right is 72F8; reads like 5 to 1, TNS 1234'
    assert silence.kind is Kind.SILENCE
    assert (good.kind, good.marks) == (Kind.COMMAND, ())


def test_repetitions_are_marked() -> None:
    command, reply = (OUT, master(COMMAND)), (IN, message(REPLY))
    ack, answer, poll = (IN, frames.ACK), (OUT, frames.ACK), (OUT, frames.poll_frame(1))
    entries = decode([command, poll, (IN, frames.EOT), command, ack, command, ack, poll, reply,
                      poll, reply, answer, poll, reply, answer])
    marks = [entry.marks for entry in entries if entry.packet]
    assert marks == [(), (Mark.RETRANSMISSION,), (Mark.DUPLICATE,), (), (Mark.RETRANSMISSION,),
                     (Mark.DUPLICATE,)]
    sent = COMMAND._replace(dst=0)  # by a slave to station 0
    assert decode([poll, (IN, message(sent)), (OUT, master(sent))])[2].marks == (Mark.RELAYED,)


def test_slaves_that_do_not_answer() -> None:
    poll = (OUT, frames.poll_frame(2))
    entries = decode([poll, poll, (OUT, master(COMMAND)), (OUT, master(COMMAND)), poll,
                      (IN, frames.EOT), (OUT, master(COMMAND._replace(dst=BROADCAST))), poll])
    silent = [(entry.text, entry.station) for entry in entries if entry.kind is Kind.SILENCE]
    assert silent == [('no answer to the poll', 2), ('no answer to the poll', 2),
                      ('no answer to the message', 1), ('no answer to the message', 1)]


def test_command_without_a_reply_is_told_at_the_end() -> None:
    for pause in (0.01, 4.0):  # also when it has waited for too long
        entries = decode([(OUT, master(COMMAND)), (IN, frames.ACK), (OUT, frames.poll_frame(1)),
                          (IN, frames.EOT)], pause=pause)
        assert (entries[-1].kind, entries[-1].station, entries[-1].text) == (
            Kind.UNANSWERED, 1, f'5 to 1, TNS 1234: {WORDS}')
        assert entries[-1].time == pytest.approx(3 * pause)


def test_full_duplex_traffic_is_told_in_both_directions() -> None:
    whole = message(REPLY)
    back = Packet(5, 1, 0x0F, 0, 0x0001, bytes.fromhex('AA 02 07 89 00 00 05 00'))
    session = TrafficDecoder()
    entries = decode([(OUT, message(COMMAND)), (IN, frames.ACK), (IN, whole[:9]),
                      (IN, frames.ACK + whole[9:]), (OUT, frames.NAK), (OUT, frames.ENQ),
                      (IN, message(back))], session)
    assert session.kind.duplex is Duplex.FULL
    assert kinds(entries) == [Kind.COMMAND, Kind.ACK, Kind.ACK, Kind.REPLY, Kind.NAK, Kind.ENQ,
                              Kind.COMMAND, Kind.UNANSWERED]
    assert [entry.text for entry in entries[4:6]] == [
        'refuses the message', 'asks for the last answer']
    assert [entry.station for entry in entries if entry.packet] == [1, 1, 5, 5]
    entries = decode(one_wire([*2 * [(OUT, message(COMMAND)), (IN, frames.ACK)], (IN, whole)]))
    assert [entry.direction for entry in entries] == [UNKNOWN] * 5
    assert entries[2].marks == (Mark.DUPLICATE,)


# Full duplex with CRC, as public pages print what real processors said: triplc.com, forum topic
# 691 (PLC-5); industrialmonitordirect.com, "SLC 504 DF1 three byte addressing";
# bradley2106.rssing.com, article 3705 (MicroLogix 1400), without the last byte of the first CRC.
@for_all(('said', 'told'), [
    (('10 02 00 00 0F 00 3A 00 68 00 00 01 00 0F 00 03 0A 00 01 00 10 03 89 7E',
      '10 02 00 00 4F 00 3A 00 99 09 03 42 10 10 00 10 03 57 58'),
     ['0 to 0, TNS 003A: typed read B3:10, 1 element', '0 to 0, TNS 003A: 0010']),
    (('10 06 10 02 00 00 0F 00 41 00 A2 02 07 89 FF A7 00 00 10 03 3B 74',),
     ['', '0 to 0, TNS 0041: protected typed logical read N7:167, 1 word',
      '0 to 0, TNS 0041: protected typed logical read N7:167, 1 word']),
    (('10 06 10 02 01 00 0F 00 FB 6F A3 FF A8 4F FF AC 51 FF AE 51 FF 9C 4F FF 94 51 FF 96 51 10 '
      '03 4B', '10 06 10 02 00 01 4F 00 FB 6F 00 00 00 00 00 00 00 FF FF 00 00 00 00 00 00 00 '
      'FF FF 10 03 BE 07'),
     ['', '', '1 to 0, TNS 6FFB: ', 'broken off before the end of its check; reads like 0 to 1'])])
def test_frames_of_real_processors(said: tuple[str, ...], told: list[str]) -> None:
    entries = decode(zip((OUT, IN), map(bytes.fromhex, said)), TrafficDecoder(Checksum.CRC))
    assert all(entry.text.startswith(text) for entry, text in zip(entries, told, strict=True))


def test_noise_is_counted_and_told_once() -> None:
    entries = decode([(IN, b'\x01\x02'), (IN, b'\x03'), (IN, frames.EOT), (IN, b'\x10')])
    assert [(entry.kind, entry.size, entry.text) for entry in entries] == [
        (Kind.NOISE, 3, '3 bytes outside of any frame'), (Kind.EOT, 0, 'nothing to send'),
        (Kind.NOISE, 1, 'a byte outside of any frame')]


def test_frame_that_breaks_off_does_not_swallow_what_comes_after_a_pause() -> None:
    said = [(OUT, master(COMMAND)[:12]), (OUT, frames.poll_frame(1))]
    assert kinds(decode(said, pause=1.0)) == [Kind.DAMAGED, Kind.SILENCE, Kind.POLL]
    last, = decode(said[:1])
    assert (last.time, last.kind, last.station, last.text, last.wire) == (
        0.0, Kind.DAMAGED, 1, 'broken off before DLE ETX', said[0][1])
    assert kinds(decode(said, pause=0.1)) == [Kind.DAMAGED, Kind.SILENCE, Kind.POLL]
    for check in (b'', b'\x12'):
        whole = message(COMMAND)[:-2] + check
        last, = decode([(OUT, whole)], TrafficDecoder(Checksum.CRC))
        assert (last.kind, last.text, last.valid, last.wire) == (
            Kind.DAMAGED, 'broken off before the end of its check; reads like 5 to 1, TNS 1234',
            None, whole)
    assert kinds(decode([(OUT, b'\x10'), said[1]], pause=-1.0)) == [
        Kind.NOISE, Kind.POLL]


def test_unknown_symbol_is_shown_with_its_code() -> None:
    (entry,) = decode([(IN, b'\x10\x1b')])
    assert (entry.kind, entry.text, entry.station) == (Kind.UNKNOWN, 'DLE 1B', None)
    *_, entry = decode([(UNKNOWN, frames.poll_frame(1)), (UNKNOWN, b'\x10\x1b')])
    assert (entry.direction, entry.station) == (UNKNOWN, 1)


def test_master_resets_the_line() -> None:
    entries = decode([(UNKNOWN, frames.poll_frame(1)), (UNKNOWN, frames.NAK)])
    assert (entries[-1].text, entries[-1].direction) == ('resets all slaves', OUT)
    entries = decode([(UNKNOWN, frames.poll_frame(1)), (UNKNOWN, message(COMMAND))])
    assert entries[1].station == 5  # a slave that sends a command


@for_all('vector', [vector for vector in VECTORS if vector.frame])
def test_every_vector_is_told_as_what_it_is(vector: Vector) -> None:
    entries = [entry for entry in decode([(UNKNOWN, vector.frame)],
                                         TrafficDecoder(vector.checksum, vector.duplex))
               if entry.kind is not Kind.UNANSWERED]
    if not vector.is_message:
        assert kinds(entries) in ([Kind.POLL], [Kind.EOT], [Kind.ACK], [Kind.NAK], [Kind.ENQ])
        return
    entry = entries[-1]
    if not vector.valid:
        assert (entry.kind, entry.valid) == (Kind.DAMAGED, False)
    elif vector.header is None:  # shorter than a header, or with nothing to compare
        assert entry.kind in (Kind.COMMAND, Kind.REPLY, Kind.DAMAGED)
    else:
        assert entry.valid
        assert entry.packet == vector.packet


def listen(bench: MasterBench) -> list[Chunk]:
    """Keep, from now on, what arrives at both ends of a line, damaged as it is."""
    heard: list[Chunk] = []

    def keep(machine: Machine, direction: Direction) -> None:
        receive = machine.receive_data

        def received(data: bytes, now: float) -> None:
            heard.append(Chunk(now, direction, data))
            receive(data, now)

        setattr(machine, 'receive_data', received)

    keep(bench.far, OUT)
    keep(bench.master.machine, IN)
    return heard


@pytest.mark.parametrize('noise', [QUIET, Noise(0.002, 0.002, 0.002, 0.002)])
def test_conversation_of_a_master_and_two_slaves(noise: Noise) -> None:
    bench = MasterBench(1, 2, settings=LinkSettings(station=5, checksum=Checksum.CRC, timeout=0.2))
    bench.line.noise = noise
    heard = listen(bench)
    bench.start()
    for _ in range(60):
        for number in (1, 2):
            task = bench.ask(number)
            bench.line.run(lambda task=task: task.result is not None, 60.0)
    session = TrafficDecoder()
    entries = [entry for chunk in heard for entry in session.feed(chunk)]
    entries += session.finish()
    assert (session.kind.checksum, session.kind.duplex) == (Checksum.CRC, Duplex.HALF)
    for number in (1, 2):
        new = [entry for entry in entries if entry.kind is Kind.COMMAND
               and entry.station == number and not entry.marks]
        assert [entry.packet for entry in new] == bench[number].served
    if noise is QUIET:
        assert set(kinds(entries)) == {Kind.COMMAND, Kind.ACK, Kind.POLL, Kind.REPLY}
        assert sum(entry.latency is not None for entry in entries) == 120
    else:
        assert {Kind.DAMAGED, Kind.NOISE, Kind.SILENCE} <= set(kinds(entries))
        assert any(Mark.DUPLICATE in entry.marks or Mark.RETRANSMISSION in entry.marks
                   for entry in entries)


@for_all('checksum', Checksum)
@for_all('guess', [None, *Checksum])
def test_check_is_found_though_silence_follows_each_message(
        guess: Checksum | None, checksum: Checksum) -> None:
    """A dead PLC: with BCC the pause came before a second byte of check that never comes."""
    commands = [COMMAND._replace(tns=count) for count in range(20)]
    session = TrafficDecoder(guess, is_certain=False)
    entries = decode([(OUT, message(command, checksum)) for command in commands], session, 1.0)
    assert [(entry.packet, entry.wire) for entry in entries if entry.kind is Kind.COMMAND] == [
        (command, message(command, checksum)) for command in commands]
    assert session.kind.checksum is checksum
    assert Kind.NOISE not in kinds(entries)


@for_all('conversation', CONVERSATIONS)
def test_conversations_are_heard_as_they_say(conversation: Conversation) -> None:
    """What breaks off is damaged to the sniffer, with or without what follows it."""
    said = [('we' if 'we' in line else 'they', word)
            for line, _ in conversation.said() for word in line['says'].split(' + ')]
    kinds = {word for _, word in said}
    passed_over = {'noise', 'part of a message'}
    if kinds & passed_over:
        passed_over |= {'damaged', 'too short'}
    as_damaged = {'too short': 'damaged', 'too long': 'damaged'}
    heard = [entry for entry in said_by_sniffer(conversation) if entry[1] not in passed_over]
    assert heard == [(side, as_damaged.get(word, word)) for side, word in said
                     if word not in passed_over]
    replies = {entry.packet.encode() for _, entry in heard_by_sniffer(conversation)
               if entry.kind is Kind.REPLY and entry.packet and Mark.STRAY not in entry.marks}
    assert replies >= {bytes.fromhex(line['gets'])
                       for line in conversation.lines if 'gets' in line}


def test_command_of_a_guest_and_its_reply_name_him() -> None:
    session = TrafficDecoder()
    note = f'{COMMAND.tns:04X} pty:/tmp/hmi'
    found = sniffed((
        Chunk(0.0, OUT, master(COMMAND), guest=note), Chunk(0.1, IN, message(REPLY)),
        Chunk(0.2, OUT, master(COMMAND._replace(tns=1)), guest='0001 tcp:a')), session)
    assert [(entry.guest, entry.request) for entry in found] == [
        ('pty:/tmp/hmi', None), ('pty:/tmp/hmi', COMMAND), *2 * [('tcp:a', None)]]


@for_all('capture', CAPTURES)
def test_everything_is_understood_and_the_check_is_found(capture: Capture) -> None:
    session = TrafficDecoder()
    entries = [entry for chunk in capture.chunks for entry in session.feed(chunk)]
    assert session.kind.checksum is capture.check
    by_radio = capture.name.startswith('radio')
    assert (session.kind.duplex is Duplex.RADIO) is by_radio
    bad = [entry for entry in entries if entry.kind in _BAD or entry.valid is False]
    assert len(bad) == (2 if by_radio else 0)


def test_who_sent_what_on_by_radio() -> None:
    capture, = (entry for entry in CAPTURES if entry.name.startswith('radio'))
    marked = {mark: [entry for entry in capture.entries if mark in entry.marks] for mark in Mark}
    assert {mark.name: len(found) for mark, found in marked.items() if found} == {
        'RETRANSMISSION': 5, 'FORWARDED': 38}  # one came before the mode was known
    for entry in marked[Mark.FORWARDED]:
        assert ', sent on by 9: ' in entry.text
    assert {entry.packet and entry.packet.src for entry in marked[Mark.RETRANSMISSION]} == {5}


def test_every_recorded_file_is_in_the_index() -> None:
    assert {path.stem for path in FOLDER.glob('*.cap')} == {entry.name for entry in CAPTURES}


# A radio modem network, against what has happened there


RECORDER = 0
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
    """Yield it as node 0 has recorded it, or as it was heard at an aerial."""
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
        assert (', sent on by 0: ' in entry.text) is by_us
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
