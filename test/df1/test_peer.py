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

"""The full-duplex peer, rule by rule: transmitter (M 4-5), receiver (M 4-7), transactions."""

from collections.abc import Callable
import itertools
from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, Duplex, ENQ, EOT, ETX, MAX_LINK_DATA, message_frame, NAK, STX
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.peer import MAX_WAITING_REPLIES
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.errors import CommandTimeout, StationInactive, WrongCommandCode
import pytest
from support.cases import for_all
from support.peers import CommandTask, PeerBench, single_bytes
from support.vectors import MESSAGES, Vector
from support.virtual_line import Wire

TIMEOUT, CMD_TIMEOUT = 1.0, 2.5
COMMAND = Packet(dst=1, src=5, cmd=0x0F, sts=0, tns=0x1034, data=b'\x68\x10\x02\x10')
REPLY = COMMAND.reply(b'\x10\x03\x10')
THEIRS = Packet(dst=5, src=1, cmd=0x06, sts=0, tns=0x7710, data=b'\x00\x10hello')
OUR_REPLY = THEIRS.reply()
UNKNOWN = b'\x10\x0F'


def bench(checksum: Checksum = Checksum.CRC, *, nak_retries: int = 3, enq_retries: int = 3,
          timeout: float = TIMEOUT, max_outstanding: int = 1, timing: LineTiming | None = None,
          duplicate_detection: bool = True,
          serve: Callable[[Packet], Packet] = Packet.reply) -> PeerBench:
    """Return a peer on a scripted line."""
    settings = LinkSettings(
        station=None, checksum=checksum, nak_retries=nak_retries, enq_retries=enq_retries,
        timeout=timeout, cmd_timeout=CMD_TIMEOUT, max_outstanding=max_outstanding,
        duplicate_detection=duplicate_detection)
    return PeerBench(settings, timing, serve)


def asked(*args: Checksum, **settings: Any) -> tuple[PeerBench, CommandTask]:
    """Return a peer that has said COMMAND, and the task."""
    peer = bench(*args, **settings)
    task = peer.begin(COMMAND)
    assert peer.said() == peer.frame(COMMAND)
    return peer, task


def acknowledged(*args: Checksum, **settings: Any) -> tuple[PeerBench, CommandTask]:
    """Return a peer whose COMMAND has got its ACK, and the task."""
    peer, task = asked(*args, **settings)
    assert peer.hear(ACK) == b''
    return peer, task


def answer(peer: PeerBench, task: CommandTask) -> None:
    """Let the reply to COMMAND come, and see that it is taken."""
    assert peer.hear_packet(REPLY) == ACK
    assert task.result == REPLY


def later(packet: Packet, number: int) -> Packet:
    """Return the same packet of a later transaction."""
    return packet._replace(tns=packet.tns + number & 0xFFFF)


@pytest.mark.parametrize(('dst', 'count'), [(5, 0), (6, 1), (255, 1)])
def test_command_to_another_station_is_executed_and_counted(dst: int, count: int) -> None:
    peer = PeerBench(LinkSettings(station=5))
    command = THEIRS._replace(dst=dst)
    assert peer.hear_packet(command) == ACK + peer.frame(command.reply())
    assert peer.served == [command]
    assert peer.counts().get('invalid_messages', 0) == count


def test_peer_that_acknowledges_and_never_replies_has_no_replies() -> None:
    peer = bench()
    for number in range(3):
        peer.begin(later(COMMAND, number))
        peer.said()
        peer.hear(ACK)
        assert peer.stations[1].has_no_replies == (number > 1)
        peer.wait(CMD_TIMEOUT)
    assert peer.stations[1].active
    peer.begin(later(COMMAND, 9))
    peer.said()
    peer.hear(ACK, peer.frame(later(REPLY, 9)))
    assert not peer.stations[1].has_no_replies


# Transmitter

@pytest.mark.parametrize('checksum', Checksum)
def test_command_is_acknowledged_and_answered_by_its_reply(checksum: Checksum) -> None:
    peer, task = acknowledged(checksum)
    assert peer.wait(0.3) == []
    assert task.result is None
    answer(peer, task)
    assert peer.wait(60) == []
    assert peer.numbers() == [(2523, 1)]
    assert peer.counts() == {
        'messages_sent': 1, 'commands_sent': 1, 'acks_received': 1, 'messages_received': 1,
        'replies_received': 1, 'acks_sent': 1}
    station = peer.stations[1]
    assert (station.replies, station.last_tns, station.last_heard) == (1, REPLY.tns, 100.3)


@pytest.mark.parametrize('heard', [[REPLY], [THEIRS], [REPLY, REPLY]])
def test_ack_of_a_reply_leaves_before_the_reply_is_looked_at(heard: list[Packet]) -> None:
    peer = bench()
    left: list[tuple[bytes, int]] = []
    Wire(peer.machine, lambda data: left.append(
        (data, peer.machine.counters.messages_received))).attach(peer.now)
    for packet in heard:
        peer.hear_packet(packet)
    assert left == [(ACK, number + (packet is THEIRS)) for number, packet in enumerate(heard)]


def test_next_command_follows_at_once() -> None:
    peer = bench()
    peer.begin(COMMAND)
    peer.begin(later(COMMAND, 1))
    assert peer.said() == peer.frame(COMMAND)
    assert peer.hear(ACK) == b''
    assert peer.hear_packet(REPLY) == ACK + peer.frame(later(COMMAND, 1))


@pytest.mark.parametrize('retries', [0, 1, 3])
def test_nak_is_answered_by_the_message_until_the_limit(retries: int) -> None:
    peer, task = asked(nak_retries=retries)
    message = peer.frame(COMMAND)
    for count in range(retries):
        pause = 0.25 * count
        answer = peer.hear(NAK)
        assert answer == (b'' if pause else message)
        assert peer.wait(pause) == ([(pause, message)] if pause else [])
        assert peer.wait(0.01) == []
    assert peer.hear(NAK) == b''
    assert peer.wait(TIMEOUT) == []
    assert isinstance(task.result, StationInactive)
    assert task.sent
    assert peer.numbers() == [
        *(entry for count in range(1, retries + 1)
          for entry in ((2517,), (2511,), (2521, count, 2511))),
        (2517,), (2511,), (2519, retries), (2509, 1)]
    assert peer.counts() == {name: count for name, count in {
        'messages_sent': 1 + retries, 'commands_sent': 1, 'naks_received': 1 + retries,
        'nak_retries': retries, 'nak_limit_exceeded': 1}.items() if count}
    assert peer.changes == [(1, False)]
    assert peer.wait(60) == []


@pytest.mark.parametrize('retries', [0, 1, 3])
def test_silence_is_answered_by_enq_until_the_limit(retries: int) -> None:
    peer, task = asked(enq_retries=retries)
    assert peer.wait(TIMEOUT * (retries + 1)) == [
        (TIMEOUT * count, ENQ) for count in range(1, retries + 1)]
    assert peer.wait(TIMEOUT) == []
    assert isinstance(task.result, StationInactive)
    assert peer.numbers() == [
        *(entry for count in range(1, retries + 1)
          for entry in ((2515, 0), (2522, count, 2515))), (2515, 0), (2520, retries), (2509, 1)]
    assert peer.counts() == {name: count for name, count in {
        'messages_sent': 1, 'commands_sent': 1, 'enq_retries': retries,
        'enq_limit_exceeded': 1}.items() if count}
    assert peer.changes == [(1, False)]
    assert peer.wait(60) == []


def test_what_was_heard_before_a_message_is_not_told_as_its_answer() -> None:
    peer = bench()
    assert peer.hear_packet(THEIRS)
    peer.hear(ACK)
    peer.begin(COMMAND)
    peer.said()
    peer.wait(TIMEOUT + 0.1)
    assert peer.only(2515) == [(2515, 0)]


def test_timer_runs_on_while_messages_and_enqs_come_in() -> None:
    peer, _ = asked()
    for number in range(4):
        assert peer.wait(0.2) == []
        assert peer.hear_packet(later(THEIRS, number)) == ACK
        assert peer.hear(ENQ) == ACK
    assert peer.wait(0.3) == [(0.2, ENQ)]
    assert len(peer.served) == 4


def test_reply_that_overtakes_its_ack_is_taken_as_one() -> None:
    peer, task = asked()
    assert peer.wait(0.5) == []
    answer(peer, task)
    assert peer.hear(ACK) == b''
    assert peer.wait(60) == []
    assert peer.counts()['acks_received'] == 1
    assert 'enq_retries' not in peer.counts()


def test_reply_of_another_command_is_no_ack() -> None:
    peer = bench(max_outstanding=2)
    first = peer.begin(COMMAND)
    peer.said()
    peer.hear(ACK)
    second = peer.begin(later(COMMAND, 1))
    peer.said()
    assert peer.hear_packet(REPLY) == ACK
    assert first.result == REPLY
    assert peer.wait(1.2) == [(1.0, ENQ)]
    assert second.result is None


def test_late_ack_of_an_overtaking_reply_does_not_acknowledge_the_next_message() -> None:
    peer = bench()
    peer.begin(COMMAND)
    peer.begin(later(COMMAND, 1))
    assert peer.said() == peer.frame(COMMAND)
    assert peer.hear_packet(REPLY) == ACK
    assert peer.wait(0.05) == []
    assert peer.hear(ACK) == b''
    said = peer.wait(3.0)
    assert said[0][1] == peer.frame(later(COMMAND, 1))
    assert said[1][1] == ENQ


def test_late_responses_after_an_enquiry_do_not_acknowledge_the_next_message() -> None:
    peer, _ = asked()
    assert peer.wait(1.0) == [(1.0, ENQ)]
    assert peer.hear(ACK) == b''
    assert peer.hear_packet(REPLY) == ACK
    peer.begin(later(COMMAND, 1))
    assert peer.said() == b''
    assert peer.wait(0.09) == []
    assert peer.hear(ACK, NAK) == b''  # the first response, late
    assert peer.wait(0.2) == [(0.01, peer.frame(later(COMMAND, 1)))]
    assert peer.wait(1.0) == [(0.81, ENQ)]
    assert peer.counts()['acks_received'] == 2


def test_replies_and_commands_do_not_wait_a_whole_timeout_after_an_enquiry() -> None:
    """The other end waits for our reply; the line is slow only once."""
    peer = bench(timeout=10.0)
    peer.begin(COMMAND)
    peer.begin(later(COMMAND, 1))
    peer.said()
    assert peer.wait(10.0) == [(10.0, ENQ)]
    assert peer.hear_packet(THEIRS) == ACK
    assert peer.hear(ACK) == b''
    assert peer.hear_packet(REPLY) == ACK
    assert peer.wait(1.0) == [(0.1, peer.frame(OUR_REPLY))]
    assert peer.hear(ACK) == peer.frame(later(COMMAND, 1))


def test_nothing_is_sent_at_the_start_that_a_response_to_a_process_before_us_would_suit() -> None:
    peer = bench()
    peer.machine.start(peer.now)
    peer.begin(COMMAND)
    assert peer.wait(0.09) == []
    assert peer.hear(ACK) == b''
    assert peer.wait(0.2) == [(0.01, peer.frame(COMMAND))]
    assert peer.wait(1.0) == [(0.81, ENQ)]


@pytest.mark.parametrize('response', [ACK, NAK])
def test_response_while_our_message_is_leaving_does_not_count(response: bytes) -> None:
    """M 4-5: WAIT follows SEND; what has still to leave is for the port to say."""
    peer = bench(timing=LineTiming(char_time=0.01))
    unsent = 1
    Wire(peer.machine, unsent=lambda: unsent).attach(peer.now)
    task = peer.begin(COMMAND)
    size = len(peer.said())
    assert peer.wait(0.01 * size - 0.01) == []
    assert peer.hear(response) == b''
    assert peer.wait(0.01) == []
    unsent = 0
    assert peer.wait(1.1) == [(1.0, ENQ)]  # of the time after the last byte nothing is lost
    assert peer.hear(ACK) == b''
    answer(peer, task)


def test_response_counts_while_only_our_answer_is_leaving() -> None:
    peer = bench()
    unsent = 0
    Wire(peer.machine, unsent=lambda: unsent).attach(peer.now)
    task = peer.begin(COMMAND)
    peer.said()
    assert peer.hear_packet(THEIRS) == ACK
    unsent = len(ACK)
    assert peer.hear(ACK) == peer.frame(OUR_REPLY)
    unsent = 0
    assert peer.hear(ACK) == b''
    answer(peer, task)


def test_ack_before_a_byte_of_our_message_is_handed_over_does_not_count() -> None:
    peer = bench()
    peer.begin(COMMAND)
    peer.machine.receive_data(ACK, peer.now)  # read before the message is taken for the port
    assert peer.said() == peer.frame(COMMAND)
    assert peer.wait(1.1) == [(1.0, ENQ)]


@pytest.mark.parametrize('checksum', Checksum)
@pytest.mark.parametrize('at', [0, 1, 2, 3, 4, 6, 7])
def test_embedded_ack_ends_the_transfer(checksum: Checksum, at: int) -> None:
    peer, task = asked(checksum)
    plain = message_frame(THEIRS.encode(), checksum)
    assert peer.hear(plain[:2 + at] + ACK) == b''
    assert peer.counts()['acks_received'] == 1
    assert peer.hear(plain[2 + at:]) == ACK + peer.frame(OUR_REPLY)
    assert peer.served == [THEIRS]
    assert peer.hear(ACK) == b''
    assert peer.wait(2.0) == []
    answer(peer, task)


def test_embedded_nak_brings_the_message_again() -> None:
    peer, _ = asked()
    message = peer.frame(COMMAND)
    plain = peer.frame(THEIRS)
    assert peer.hear(plain[:5] + NAK) == message
    assert peer.hear(plain[5:]) == ACK
    assert peer.served == [THEIRS]


LONG = Packet(dst=1, src=5, cmd=0x0F, sts=0, tns=0x2010, data=bytes(range(200)))


def embedding(peer: PeerBench) -> None:
    """Let the other end show that it embeds responses."""
    peer.begin(COMMAND)
    peer.said()
    frame = peer.frame(THEIRS)
    assert peer.hear(frame[:5] + ACK) == b''
    assert peer.hear(frame[5:]) == ACK + peer.frame(OUR_REPLY)
    assert peer.hear(ACK) == b''
    assert peer.hear_packet(REPLY) == ACK
    peer.wait(1.0)


def test_response_goes_into_our_message_where_the_other_end_does_so_too() -> None:
    """M 4-3; Embedded Responses = Auto-detect."""
    peer = bench(timing=LineTiming(char_time=0.001))
    embedding(peer)
    peer.begin(LONG)
    said = peer.said()
    plain = peer.frame(LONG)
    assert 16 <= len(said) < 40 and plain.startswith(said)
    begun = peer.now
    while (peer.machine.next_call or 0.0) < begun + 0.1:
        (after, more), = peer.wait((peer.machine.next_call or 0.0) - peer.now)
        said += more
    assert plain.startswith(said)
    assert peer.hear_packet(later(THEIRS, 1)) == ACK  # at once, before the rest
    rest = b''.join(data for _, data in peer.wait(0.3))
    assert said + rest == plain
    assert peer.hear(ACK) == peer.frame(later(OUR_REPLY, 1))
    assert peer.counts()['acks_sent'] == 3


def test_whether_to_embed_is_found_out_anew_with_the_port() -> None:
    peer = bench(timing=LineTiming(char_time=0.001))
    embedding(peer)
    assert peer.machine.sender.embeds
    peer.start()
    assert not peer.machine.sender.embeds


def test_reply_goes_out_before_the_next_command() -> None:
    peer = bench()
    peer.begin(COMMAND)
    peer.begin(later(COMMAND, 1))
    peer.said()
    assert peer.hear_packet(THEIRS) == ACK
    assert peer.hear_packet(REPLY) == ACK
    assert peer.wait(2.0)[0] == (0.1, peer.frame(OUR_REPLY))


def test_replies_and_commands_go_out_in_turns() -> None:
    peer = bench(max_outstanding=3)
    ours = [later(COMMAND, number) for number in range(3)]
    theirs = [later(THEIRS, number) for number in range(3)]
    peer.begin(ours[0])
    for packet in theirs:
        assert peer.hear_packet(packet).endswith(ACK)
    for packet in ours[1:]:
        peer.begin(packet)
    said = [peer.hear(ACK) for _ in range(6)]
    assert said == [*map(peer.frame, (
        theirs[0].reply(), ours[1], theirs[1].reply(), ours[2], theirs[2].reply())), b'']


def test_timers_run_from_the_last_byte() -> None:
    peer = bench(timing=LineTiming(char_time=0.01))
    peer.begin(COMMAND)
    size = len(peer.said())
    left = round(0.01 * size, 6)
    said = peer.wait(left + 2.5)
    assert said == [(round(left + 1.0, 6), ENQ), (round(left + 2.02, 6), ENQ)]


def test_response_that_was_sent_meanwhile_delays_our_message() -> None:
    peer = bench(timing=LineTiming(char_time=0.01))
    peer.hear(peer.frame(THEIRS))
    size = len(peer.frame(OUR_REPLY)) + len(ACK)
    assert peer.wait(2.0) == [(round(0.01 * size + 1.0, 6), ENQ)]


def test_tx_delay_comes_before_every_transmission() -> None:
    peer = bench(timing=LineTiming(tx_delay=0.2))
    peer.begin(COMMAND)
    assert peer.wait(0.5) == [(0.2, peer.frame(COMMAND))]
    assert peer.wait(0.3) == []
    assert peer.hear(NAK) == b''
    assert peer.wait(0.5) == [(0.2, peer.frame(COMMAND))]
    assert peer.hear(ACK) == b''
    assert peer.hear_packet(REPLY) == b''
    assert peer.wait(0.5) == [(0.2, ACK)]
    assert peer.wait(0.5) == []
    assert peer.hear_packet(THEIRS) == b''
    assert peer.wait(0.5) == [(0.2, ACK), (0.4, peer.frame(OUR_REPLY))]


def test_least_time_for_a_response() -> None:
    peer, _ = asked(timeout=0.0)
    assert peer.wait(0.021) == [(0.02, ENQ)]


def test_message_that_has_begun_when_the_time_is_up_is_heard_out() -> None:
    peer, task = asked()
    reply = peer.frame(REPLY)
    peer.wait(0.95)
    peer.hear(reply[:4])
    assert peer.wait(0.09) == []
    assert peer.hear(reply[4:]) == ACK
    assert task.result == REPLY


@pytest.mark.parametrize('begin', [STX, STX + bytes(261)])
def test_other_end_that_dribbles_does_not_keep_us_waiting(begin: bytes) -> None:
    """A message that has begun, and then a byte every 60 ms without end."""
    peer, task = asked(enq_retries=1, timing=LineTiming(char_time=0.001))
    said = [peer.hear(begin)]
    while task.result is None and peer.now < 200.0:
        said += [data for _, data in peer.wait(0.06)]
        said += [peer.hear(b'U')]
    assert isinstance(task.result, StationInactive)
    assert task.seconds < 2 * TIMEOUT + 1.0
    assert b''.join(said) == ENQ


# Receiver

def test_last_response_begins_as_nak() -> None:
    assert bench().hear(ENQ, ENQ) == NAK + NAK


@for_all('begun', [1, 2, 3, 9, -2, -1])
@for_all('pause', [0.05, 5.0])
@for_all('is_working', [False, True])
def test_part_of_a_message_is_no_old_ack(begun: int, pause: float, is_working: bool) -> None:
    peer = bench()
    assert peer.hear_packet(REPLY) == ACK
    if is_working:
        peer.begin(COMMAND)
        peer.said()
        peer.hear(ACK)
    assert peer.hear(peer.frame(THEIRS)[:begun]) == b''
    assert peer.wait(pause) == []
    # Bytes that are missing at the end may be taken from the first ENQ.
    assert ACK not in peer.hear(ENQ)
    assert peer.hear(ENQ) == NAK
    assert peer.served == []
    assert peer.hear_packet(THEIRS).startswith(ACK)


@pytest.mark.parametrize('damage', [
    b'\x10\x00', b'\x10\x03', b'\x02', b'\x90\x02', b'\x10\x42', b'\x10\x10', b''])
def test_damaged_stx_is_no_old_ack(damage: bytes) -> None:
    peer = bench()
    assert peer.hear_packet(REPLY) == ACK
    assert peer.hear(damage + peer.frame(THEIRS)[2:]) == b''
    assert peer.hear(ENQ) == NAK
    assert peer.served == []
    assert peer.hear_packet(THEIRS) == ACK + peer.frame(OUR_REPLY)


@pytest.mark.parametrize(('checksum', 'counter', 'event'), [
    (Checksum.CRC, 'crc_errors', 2506), (Checksum.BCC, 'bcc_errors', 2507)])
def test_message_with_a_wrong_check_gets_nak_and_is_counted(
        checksum: Checksum, counter: str, event: int) -> None:
    peer = bench(checksum)
    frame = peer.frame(THEIRS)
    damaged = frame[:-1] + bytes((frame[-1] ^ 0x20,))
    assert peer.hear(damaged) == NAK
    assert peer.hear(ENQ) == NAK
    assert peer.counts() == {'naks_sent': 2, counter: 1, 'enqs_received': 1}
    if checksum is Checksum.CRC:
        values = frame[-1] ^ 0x20, frame[-2], frame[-1], frame[-2]
    else:
        values = 0, frame[-1] ^ 0x20, 0, frame[-1]
    assert peer.numbers() == [(event, *values)]
    assert peer.hear(frame) == ACK + peer.frame(OUR_REPLY)


@pytest.mark.parametrize('checksum', Checksum)
@pytest.mark.parametrize('size', range(6))
def test_message_shorter_than_a_header(checksum: Checksum, size: int) -> None:
    peer = bench(checksum)
    assert peer.hear(message_frame(THEIRS.encode()[:size], checksum)) == NAK
    assert peer.numbers() == [(2513, 6)]
    assert peer.counts() == {'naks_sent': 1, 'invalid_messages': 1}


def test_longest_message_is_served() -> None:
    peer = bench()
    command = THEIRS._replace(data=b'\x10' * (MAX_LINK_DATA - 6))
    assert peer.hear_packet(command) == ACK + peer.frame(command.reply())


@pytest.mark.parametrize('byte', [0x00, 0x10, 0x55])
@pytest.mark.parametrize('more', [1, 2, 3, 50, 700])
def test_message_too_long(byte: int, more: int) -> None:
    peer = bench()
    command = THEIRS._replace(data=bytes((byte,)) * (MAX_LINK_DATA - 6 + more))
    frame = peer.frame(command)
    assert peer.hear(*single_bytes(frame[:-1])) == b''  # not in its middle (M 4-8)
    assert peer.hear(frame[-1:]) == NAK
    assert peer.numbers() == [(2512, MAX_LINK_DATA)]
    assert peer.counts()['invalid_messages'] == 1
    assert peer.hear(ENQ) == NAK
    assert peer.served == []
    assert peer.hear_packet(THEIRS) == ACK + peer.frame(OUR_REPLY)


def test_duplicate_is_acknowledged_and_not_executed() -> None:
    peer = bench()
    assert peer.hear_packet(THEIRS) == ACK + peer.frame(OUR_REPLY)
    assert peer.hear_packet(THEIRS._replace(dst=9, data=b'other')) == ACK
    assert peer.hear(ACK) == b''
    assert peer.wait(60) == []
    assert peer.served == [THEIRS]
    assert peer.numbers() == [(2524, 1)]
    assert peer.counts() == {
        'messages_received': 2, 'commands_received': 1, 'duplicate_messages': 1, 'acks_sent': 2,
        'messages_sent': 1, 'replies_sent': 1, 'acks_received': 1}


@pytest.mark.parametrize('asked_by', [ENQ, b'\xFF' + ENQ])
def test_duplicate_after_its_reply_is_known_when_the_sender_has_asked_again(
        asked_by: bytes) -> None:
    """Our ACK was lost, the reply was not: only the sender's receiver knows that we have it."""
    peer = bench()
    assert peer.hear_packet(THEIRS) == ACK + peer.frame(OUR_REPLY)
    assert peer.hear(ACK) == b''
    assert peer.hear(asked_by) in (ACK, NAK)
    assert peer.hear_packet(THEIRS) == ACK
    assert peer.served == [THEIRS]


@pytest.mark.parametrize('pause', [1.0, 3.0, 10.0])
def test_program_that_always_sends_tns_0_is_answered_each_time(pause: float) -> None:
    peer = bench()
    command = THEIRS._replace(tns=0)
    for _ in range(10):
        assert peer.hear_packet(command) == ACK + peer.frame(command.reply())
        assert peer.hear(ACK) == b''
        peer.wait(pause)
    assert peer.served == [command] * 10


def test_processor_that_counts_from_0_after_its_power_up_is_answered() -> None:
    """It went off before it could acknowledge our reply to its first and only command."""
    peer = bench()
    command = THEIRS._replace(tns=0)
    assert peer.hear_packet(command) == ACK + peer.frame(command.reply())
    assert [said for _, said in peer.wait(4.0)] == [ENQ] * 3
    assert peer.wait(1.0) == []
    assert peer.hear_packet(command) == ACK + peer.frame(command.reply())


def test_repetition_at_once_is_one_although_its_reply_is_acknowledged() -> None:
    peer = bench()
    assert peer.hear_packet(THEIRS) == ACK + peer.frame(OUR_REPLY)
    assert peer.hear(ACK) == b''
    peer.wait(0.99)
    assert peer.hear_packet(THEIRS) == ACK
    peer.wait(0.02)
    assert peer.hear_packet(THEIRS) == ACK + peer.frame(OUR_REPLY)


@pytest.mark.parametrize(('timeout', 'enq_retries', 'seconds'), [
    (0.1, 1, 4.0),  # as products come: 1 s and 3 ENQs
    (1.0, 3, 4.0), (3.2, 10, 35.2)])
def test_repetition_comes_within_the_time_of_the_retries(timeout: float, enq_retries: int,
                                                         seconds: float) -> None:
    for pause, served in ((seconds - 0.01, 1), (seconds + 0.01, 2)):
        peer = bench(timeout=timeout, enq_retries=enq_retries)
        peer.hear_packet(THEIRS)
        peer.wait(pause)
        peer.hear_packet(THEIRS)
        assert len(peer.served) == served


def test_duplicates_are_executed_when_nobody_looks_for_them() -> None:
    peer = bench(duplicate_detection=False)
    assert peer.hear_packet(THEIRS) == ACK + peer.frame(OUR_REPLY)
    assert peer.hear_packet(THEIRS) == ACK
    assert peer.served == [THEIRS, THEIRS]
    assert 'duplicate_messages' not in peer.counts()


def test_duplicate_reply_is_acknowledged_and_passed_over() -> None:
    peer = bench()
    task = peer.begin(COMMAND)
    peer.hear(ACK)
    assert peer.hear_packet(REPLY) + peer.hear_packet(REPLY) == peer.frame(COMMAND) + ACK + ACK \
        or task.result == REPLY
    assert peer.counts()['duplicate_messages'] == 1
    assert 'stale_messages' not in peer.counts()


def test_duplicates_are_forgotten_with_the_port() -> None:
    peer = bench()
    peer.hear_packet(THEIRS)
    peer.start()
    assert peer.hear(ENQ) == NAK
    assert peer.hear_packet(THEIRS) == ACK + peer.frame(OUR_REPLY)
    assert len(peer.served) == 2


def test_command_that_finds_no_room_gets_nak() -> None:
    peer, _ = asked()
    packets = [later(THEIRS, number) for number in range(MAX_WAITING_REPLIES + 1)]
    for packet in packets[:-1]:
        assert peer.hear_packet(packet) == ACK
    for _ in range(2):
        assert peer.hear_packet(packets[-1]) == NAK
        assert peer.hear(ENQ) == NAK
    assert peer.hear_packet(packets[-2]) == ACK  # its ACK was lost: still a duplicate
    assert peer.served == packets[:-1]
    for packet in packets[:-1]:
        assert peer.hear(ACK) == peer.frame(packet.reply())
    assert peer.hear_packet(packets[-1]) == ACK
    assert peer.hear(ACK) == peer.frame(packets[-1].reply())
    assert peer.served == packets
    assert peer.counts()['commands_received'] == MAX_WAITING_REPLIES + 1
    assert peer.counts()['duplicate_messages'] == 1
    assert peer.counts()['refused_for_memory'] == peer.counts()['enqs_received'] == 2


def test_reply_is_taken_with_the_sink_full() -> None:
    peer, task = asked()
    for number in range(MAX_WAITING_REPLIES):
        peer.hear_packet(later(THEIRS, number))
    answer(peer, task)


def test_stx_inside_a_message_begins_it_anew() -> None:
    peer = bench()
    frame = peer.frame(THEIRS)
    assert peer.hear(frame[:5]) == b''
    assert peer.hear(frame) == ACK + peer.frame(OUR_REPLY)
    assert peer.numbers() == [(2518,)]
    assert peer.counts()['invalid_messages'] == 1
    assert 'naks_sent' not in peer.counts()


@pytest.mark.parametrize('control', [UNKNOWN, EOT, b'\x10\x01', b'\x10\x42', ETX])
def test_other_control_between_messages_is_passed_over(control: bytes) -> None:
    peer = bench()
    assert peer.hear_packet(REPLY) == ACK
    assert peer.hear(control) == b''
    assert peer.counts().get('eots_received', 0) == (control == EOT)  # S0, counter 2538
    assert peer.hear(ENQ) == NAK
    assert peer.hear_packet(THEIRS) == ACK + peer.frame(OUR_REPLY)


def test_unknown_control_is_reported() -> None:
    peer = bench()
    peer.hear(ETX, b'\x10\x01', UNKNOWN)  # the first two are symbols, if not here
    assert peer.numbers() == [(2514, 0x0F)]


@pytest.mark.parametrize('checksum', Checksum)
def test_command_that_lost_its_leading_00_is_not_executed_and_comes_again(
        checksum: Checksum) -> None:
    peer = bench(checksum)
    command = Packet(0, 1, 0x0F, 0, 0x0107, bytes.fromhex('AA 02 07 89 01 00 05 00'))
    frame = peer.frame(command)
    damaged = frame[:2] + frame[3:]  # both checks begin at 0 and do not see it
    assert peer.hear(damaged) == NAK
    assert peer.served == []
    assert peer.numbers() == [(2510, 0x0F, 0x01, 0xAA01)]
    assert peer.counts()['invalid_messages'] == 1
    assert peer.hear(frame) == ACK + peer.frame(command.reply())
    assert peer.served == [command]


def test_command_with_a_status_gets_nak() -> None:
    peer = bench()
    assert peer.hear_packet(THEIRS._replace(sts=0x10)) == NAK
    assert peer.hear(ENQ) == NAK
    assert peer.served == []


def test_error_replies_are_counted() -> None:
    peer, _ = acknowledged(serve=lambda command: command.reply(b'\x06', 0xF0))
    assert peer.hear_packet(THEIRS) == ACK + peer.frame(THEIRS.reply(b'\x06', 0xF0))
    peer.hear(ACK)
    assert peer.hear_packet(COMMAND.reply(sts=0x10)) == ACK
    assert peer.counts()['error_messages_sent'] == 1
    assert peer.counts()['error_messages_received'] == 1


def test_reply_is_sent_again_like_a_command_and_given_up_without_a_failure() -> None:
    peer = bench()
    reply = peer.frame(OUR_REPLY)
    assert peer.hear_packet(THEIRS) == ACK + reply
    assert peer.hear(NAK) == reply
    assert peer.wait(4.0) == [(1.0, ENQ), (2.0, ENQ), (3.0, ENQ)]
    assert peer.wait(60) == []
    assert peer.counts()['replies_sent'] == 1
    assert peer.counts()['messages_sent'] == 2
    assert peer.counts()['enq_limit_exceeded'] == 1
    assert peer.changes == []
    assert peer.hear_packet(later(THEIRS, 1)) == ACK + peer.frame(later(OUR_REPLY, 1))


@for_all('entry', [
    entry for entry in MESSAGES
    if entry.duplex is Duplex.FULL and not entry.has_embedded_response])
@for_all('chunk', [1, 3, 1000])
def test_messages_of_the_vectors_get_their_response_and_commands_are_served(
        entry: Vector, chunk: int) -> None:
    peer = bench(entry.checksum)
    parts = [entry.frame[at:at + chunk] for at in range(0, len(entry.frame), chunk)]
    answer = peer.hear(*parts)
    if not entry.valid or len(entry.link_data) < 6:
        assert (answer, peer.served) == (NAK, [])
    elif entry.packet.is_reply:
        assert (answer, peer.served) == (ACK, [])
        assert peer.counts()['invalid_messages'] == 1  # of nobody that we have asked
    else:
        assert peer.served == [entry.packet]
        assert answer == ACK + peer.frame(entry.packet.reply())


# Transactions

def test_ack_is_no_reply() -> None:
    peer, task = asked()
    peer.wait(0.4)
    peer.hear(ACK)
    assert peer.wait(CMD_TIMEOUT - 1e-6) == []
    assert task.result is None
    assert peer.wait(2e-6) == []
    assert isinstance(task.result, CommandTimeout)
    assert task.sent
    assert peer.numbers() == [(2508,)]
    assert peer.counts()['command_timeouts'] == 1
    assert peer.changes == []


def test_late_reply_is_stale() -> None:
    peer, task = acknowledged()
    peer.wait(CMD_TIMEOUT)
    assert isinstance(task.result, CommandTimeout)
    assert peer.hear_packet(REPLY) == ACK
    assert isinstance(task.result, CommandTimeout)
    assert peer.counts()['stale_messages'] == 1
    assert peer.counts()['replies_received'] == 1
    assert peer.numbers() == [(2508,), (2510, 1, 5, COMMAND.tns)]
    assert peer.stations[1].replies == 0


@pytest.mark.parametrize(('other', 'counter'), [
    (REPLY._replace(tns=REPLY.tns ^ 0x0100), 'stale_messages'),
    (REPLY._replace(tns=REPLY.tns ^ 1, cmd=0x46), 'stale_messages'),
    (REPLY._replace(src=2), 'invalid_messages')])  # S0, counter 2550: incorrect addressing
def test_reply_of_another_transaction_or_station_is_dropped(other: Packet, counter: str) -> None:
    peer, task = acknowledged()
    assert peer.hear_packet(other) == ACK
    assert task.result is None
    assert peer.numbers() == [(2510, other.src, other.dst, other.tns)]
    counts = peer.counts()
    assert counts[counter] == counts.get('stale_messages', 0) + counts.get('invalid_messages', 0)
    answer(peer, task)


def test_reply_for_another_node_is_dropped() -> None:
    peer = PeerBench(LinkSettings(station=COMMAND.src, cmd_timeout=CMD_TIMEOUT))
    task = peer.begin(COMMAND)
    assert peer.said() == peer.frame(COMMAND)
    assert peer.hear(ACK, peer.frame(REPLY._replace(dst=0))) == ACK
    assert peer.numbers() == [(2510, 1, 0, REPLY.tns)]
    assert peer.counts()['invalid_messages'] == 1  # S0, counter 2550: incorrect addressing
    peer.wait(CMD_TIMEOUT)
    assert isinstance(task.result, CommandTimeout)


def test_reply_with_another_command_code() -> None:
    peer, task = acknowledged()
    assert peer.hear_packet(REPLY._replace(cmd=0x46)) == ACK
    assert isinstance(task.result, WrongCommandCode)
    assert task.result.args == (1, 0x46, 0x4F)
    assert peer.numbers() == [(2505, 1, 0x46, 0x4F)]
    assert peer.counts()['invalid_messages'] == 1
    assert peer.stations[1].replies == 0
    assert peer.hear_packet(REPLY) == ACK  # too late: stale
    assert peer.counts()['stale_messages'] == 1


def test_command_with_our_tns_is_no_reply() -> None:
    peer, task = acknowledged()
    theirs = Packet(5, 1, 0x0F, 0, COMMAND.tns, b'\x68')
    assert peer.hear_packet(theirs) == ACK + peer.frame(theirs.reply())
    assert task.result is None


@pytest.mark.parametrize('allowed', [1, 2, 3])
def test_as_many_commands_as_allowed_are_outstanding(allowed: int) -> None:
    peer = bench(max_outstanding=allowed)
    commands = [later(COMMAND, number) for number in range(6)]
    tasks = [peer.begin(command) for command in commands]
    said = peer.said()
    for command in commands[1:allowed]:
        assert said
        said = peer.hear(ACK)
        assert said == peer.frame(command)
    assert peer.hear(ACK) == b''
    assert peer.most_outstanding == allowed
    for at, command in enumerate(commands[allowed:], allowed):
        assert peer.hear_packet(commands[at - allowed].reply()) == ACK + peer.frame(command)
        assert peer.hear(ACK) == b''
    for command in commands[-allowed:]:
        peer.hear_packet(command.reply())
    assert [task.result for task in tasks] == [command.reply() for command in commands]
    assert peer.most_outstanding == allowed


@pytest.mark.parametrize('order', list(itertools.permutations(range(3))))
def test_replies_in_any_order_find_their_command(order: tuple[int, ...]) -> None:
    peer = bench(max_outstanding=3)
    commands = [later(COMMAND, number)._replace(dst=1 + number) for number in range(3)]
    tasks = [peer.begin(command) for command in commands]
    assert peer.said() + peer.hear(ACK) + peer.hear(ACK) + peer.hear(ACK) == b''.join(
        map(peer.frame, commands))
    for number in order:
        reply = commands[number].reply(bytes((number,)))
        assert tasks[number].result is None
        assert peer.hear_packet(reply) == ACK
        assert tasks[number].result == reply


def test_same_tns_at_two_stations() -> None:
    peer = bench(max_outstanding=2)
    tasks = [peer.begin(COMMAND._replace(dst=number)) for number in (1, 2)]
    peer.said()
    peer.hear(ACK, ACK)
    peer.hear_packet(REPLY._replace(src=2, data=b'two'))
    peer.hear_packet(REPLY._replace(src=1, data=b'one'))
    assert [task.result for task in tasks] == [
        REPLY._replace(src=1, data=b'one'), REPLY._replace(src=2, data=b'two')]


def test_each_outstanding_command_has_its_own_time() -> None:
    peer = bench(max_outstanding=2)
    first, second = peer.begin(COMMAND), peer.begin(later(COMMAND, 1))
    peer.said()
    assert peer.hear(ACK) == peer.frame(later(COMMAND, 1))
    peer.wait(0.5)
    assert peer.hear(ACK) == b''
    peer.wait(60)
    assert isinstance(first.result, CommandTimeout)
    assert isinstance(second.result, CommandTimeout)
    assert first.ended == pytest.approx(100.0 + CMD_TIMEOUT)
    assert second.ended == pytest.approx(100.5 + CMD_TIMEOUT)


def test_overdue_command_ends_while_another_one_waits_for_its_ack() -> None:
    peer = bench(max_outstanding=2, timeout=60.0)
    first, second = peer.begin(COMMAND), peer.begin(later(COMMAND, 1))
    peer.said()
    assert peer.hear(ACK) == peer.frame(later(COMMAND, 1))
    peer.wait(10.0)
    assert isinstance(first.result, CommandTimeout)
    assert first.seconds <= CMD_TIMEOUT + 0.25
    assert second.result is None
    assert peer.counts().get('enq_retries') is None


def test_reply_is_not_taken_after_its_time_although_nobody_has_looked() -> None:
    peer, task = acknowledged()
    peer.now += CMD_TIMEOUT + 3.0  # the process stood still
    assert peer.hear_packet(REPLY) == ACK
    assert isinstance(task.result, CommandTimeout)
    assert peer.counts()['stale_messages'] == 1


def lose(peer: PeerBench) -> None:
    """Let a command fail."""
    peer.begin(COMMAND)
    peer.said()
    peer.wait(60)
    assert peer.changes == [(1, False)]


def test_silent_station_is_probed_with_one_try() -> None:
    peer = bench()
    lose(peer)
    for number in range(1, 4):
        task = peer.begin(later(COMMAND, number))
        assert peer.said() == peer.frame(later(COMMAND, number))
        assert peer.wait(2 * TIMEOUT) == []
        assert isinstance(task.result, StationInactive)
        assert task.seconds <= 2 * TIMEOUT
    assert peer.changes == [(1, False)]
    assert peer.counts()['enq_limit_exceeded'] == len(peer.only(2520)) == 1  # not of a probe


def test_replies_that_do_not_come_in_time_are_counted_until_one_does() -> None:
    peer = bench()
    for number in range(1, 4):
        peer.begin(later(COMMAND, number))
        peer.said()
        peer.hear(ACK)
        peer.wait(CMD_TIMEOUT + 0.1)
        assert peer.stations[1].overdue == number
    peer.begin(COMMAND)
    peer.said()
    peer.hear(ACK)
    peer.hear_packet(REPLY)
    assert peer.stations[1].overdue == 0


def test_replies_of_a_gateway_in_place_of_a_station_are_counted_like_late_ones() -> None:
    """M 8-2: the low half of STS is for nodes on the way, the high half for the PLC."""
    peer = bench()
    seen = []
    for number, sts in enumerate((0x02, 0x07, 0x10, 0x02, 0x00), start=1):
        peer.begin(later(COMMAND, number))
        peer.said()
        peer.hear(ACK)
        peer.hear_packet(later(REPLY, number)._replace(sts=sts))
        seen.append((peer.stations[1].overdue, peer.stations[1].local_status))
    assert seen == [(1, 0x02), (2, 0x07), (0, 0), (1, 0x02), (0, 0)]


def test_station_comes_back_with_its_reply() -> None:
    peer = bench()
    lose(peer)
    task = peer.begin(later(COMMAND, 1))
    peer.said()
    assert peer.hear(ACK) == b''
    assert peer.changes == [(1, False)]  # an ACK names nobody
    assert peer.hear_packet(later(REPLY, 1)) == ACK
    assert task.result == later(REPLY, 1)
    assert peer.changes == [(1, False), (1, True)]
    task = peer.begin(later(COMMAND, 2))
    peer.said()
    assert len(peer.wait(60)) == 3  # a whole cycle of ENQs again
    assert isinstance(task.result, StationInactive)
