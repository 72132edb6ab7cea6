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

"""What a full-duplex peer does beside the rules, which are conversations (vectors/)."""

from collections.abc import Callable
from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, Duplex, ENQ, ETX, MAX_LINK_DATA, NAK, STX
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.errors import (
    CommandExpired,
    CommandTimeout,
    PortLost,
    ReplyHindered,
    StationInactive,
)
from abdf1_ros.messages import Message
import pytest
from support.cases import for_all
from support.peers import CommandTask, PeerBench, single_bytes
from support.vectors import MESSAGES, Vector
from support.virtual_line import Wire

TIMEOUT, CMD_TIMEOUT = 1.0, 2.5
COMMAND = Packet(dst=1, src=5, cmd=0x0F, sts=0, tns=0x1034, data=b'\x68\x10\x02\x10')
REPLY = COMMAND.reply(b'\x10\x03\x10')
THEIRS = Packet(dst=5, src=1, cmd=0x26, sts=0, tns=0x7710, data=b'\x00\x10hello')
OUR_REPLY = THEIRS.reply()


def bench(checksum: Checksum = Checksum.CRC, *, enq_retries: int = 3,
          timeout: float = TIMEOUT, timing: LineTiming | None = None,
          serve: Callable[[Packet], Packet] = Packet.reply) -> PeerBench:
    """Return a peer on a scripted line."""
    settings = LinkSettings(
        station=None, checksum=checksum, enq_retries=enq_retries, timeout=timeout,
        cmd_timeout=CMD_TIMEOUT)
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


def test_replies_that_do_not_come_in_time_are_counted_and_told_until_one_does() -> None:
    peer = bench()
    for number in range(3):
        peer.begin(later(COMMAND, number))
        peer.said()
        peer.hear(ACK)
        assert peer.stations[1].has_no_replies == (number > 1)
        peer.wait(CMD_TIMEOUT + 0.1)
        assert peer.stations[1].overdue == number + 1
    assert peer.stations[1].active
    peer.begin(later(COMMAND, 9))
    peer.said()
    peer.hear(ACK, peer.frame(later(REPLY, 9)))
    assert (peer.stations[1].has_no_replies, peer.stations[1].overdue) == (False, 0)


@pytest.mark.parametrize(('number', 'is_blamed'), [(0, True), (9, False)])
def test_damaged_reply_of_an_earlier_command_is_no_silence_of_the_station(
        number: int, *, is_blamed: bool) -> None:
    """The far end sends it again after each NAK, and the reply that we wait for only then."""
    peer, task = acknowledged()
    damaged = peer.frame(later(REPLY, number))
    damaged = damaged[:-1] + bytes((damaged[-1] ^ 1,))
    assert peer.hear(damaged) == NAK
    peer.wait(CMD_TIMEOUT + 0.1)
    assert peer.stations[1].overdue == is_blamed
    error = task.result
    assert isinstance(error, CommandTimeout if is_blamed else ReplyHindered)
    assert error.cause is (Message.ERR_BAD_CRC if is_blamed else None)
    assert peer.machine.counters.command_timeouts == 1


@pytest.mark.parametrize('response', [ACK, NAK])
def test_response_while_our_message_is_leaving_does_not_count(response: bytes) -> None:
    """M 4-5: WAIT follows SEND; what has still to leave is for the port to say."""
    peer = bench(timing=LineTiming(char_time=0.01))
    unsent = 1
    Wire(peer.machine, unsent=lambda: unsent).attach(peer.now)
    task = peer.begin(COMMAND)
    assert peer.wait(0.01 * len(peer.said()) - 0.01) == []
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


def test_whether_to_embed_is_found_out_anew_with_the_port() -> None:
    peer = bench(timing=LineTiming(char_time=0.001))
    frame = peer.frame(THEIRS)
    assert peer.hear(frame[:5] + ACK + bytes(10) + ETX + bytes(2)) == NAK
    assert not peer.machine.sender.embeds  # the ACK may be damage, too
    assert peer.hear(frame[:5] + ACK + frame[5:]) == ACK + peer.frame(OUR_REPLY)
    assert peer.machine.sender.embeds
    peer.start()
    assert not peer.machine.sender.embeds


def test_command_whose_ack_the_port_does_not_take_is_not_executed_later() -> None:
    def fail(data: bytes) -> None:
        raise PortLost('unplugged')

    peer = bench()
    Wire(peer.machine, fail).attach(peer.now)
    with pytest.raises(PortLost) as lost:
        peer.hear_packet(THEIRS)
    peer.machine.stop(lost.value, peer.now)
    peer.start()
    assert (peer.hear(ENQ), peer.served) == (NAK, [])


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


@for_all('begun', [2, 9, -3, -2, -1])
def test_message_that_just_stops_is_counted_once_and_gets_no_answer(begun: int) -> None:
    peer = bench()
    assert peer.hear(peer.frame(THEIRS)[:begun]) == b''
    assert peer.wait(60.0) == []
    counts = peer.counts()
    assert counts.get('invalid_messages', 0) + counts.get('crc_errors', 0) == 1
    assert [number for number, *_ in peer.numbers()] == [2506 if begun in (-2, -1) else 2518]
    assert peer.hear_packet(THEIRS).startswith(ACK)


def test_reply_to_another_node_does_not_make_ours_a_repetition() -> None:
    peer, task = acknowledged()
    assert peer.hear(peer.frame(REPLY._replace(dst=9)), NAK, ENQ) == ACK + ACK
    assert task.result is None
    assert peer.counts()['stale_messages'] == 1
    answer(peer, task)
    assert peer.counts().get('duplicate_messages', 0) == 0


def test_command_that_may_have_waited_while_this_process_stood_still_has_to_come_again() -> None:
    for pause, served in ((1.0, [THEIRS]), (1.01, [])):  # its sender waits for 1 s at least
        peer = bench()
        assert peer.hear_packet(REPLY) == ACK
        peer.now = (peer.machine.next_call or 0.0) + pause
        peer.machine.handle_timeout(peer.now)
        assert (peer.hear(peer.frame(THEIRS)) == b'', peer.served) == (not served, served)
    assert peer.hear(ENQ) == NAK
    peer.wait(0.5)
    assert (peer.hear_packet(THEIRS)[:2], peer.served) == (ACK, [THEIRS])


def test_command_with_a_status_is_told_and_not_accepted() -> None:
    peer = bench()
    assert (peer.hear_packet(THEIRS._replace(sts=1)), peer.served) == (NAK, [])
    assert [(event.message.number, event.station) for event in peer.events] == [
        (Message.ERR_WRONG_MESSAGE.number, THEIRS.src)]


@for_all('byte', [0x00, 0x10, 0x55])
@for_all('more', [1, 2, 3, 50, 700])
def test_message_too_long(byte: int, more: int) -> None:
    peer = bench()
    frame = peer.frame(THEIRS._replace(data=bytes((byte,)) * (MAX_LINK_DATA - 6 + more)))
    assert peer.hear(*single_bytes(frame[:-1])) == b''  # not in its middle (M 4-8)
    assert peer.hear(frame[-1:]) == NAK
    assert peer.numbers() == [(2512, MAX_LINK_DATA)]
    assert peer.counts()['invalid_messages'] == 1
    assert peer.hear(ENQ) == NAK
    assert peer.served == []
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


@for_all('timeout', [0.1, 2.0])
@for_all('is_counted', [True, False])
def test_repetition_of_a_command_whose_reply_was_acknowledged(timeout: float,
                                                              is_counted: bool) -> None:
    """AdvancedHMI repeats commands 0.95 to 1.06 s later; other programs always send TNS 0."""
    seconds = max(1.0, timeout) + 0.25 * is_counted
    for pause, executed in ((seconds - 0.01, 1), (seconds + 0.01, 2)):
        peer = bench(timeout=timeout)
        peer.hear_packet(REPLY)  # another TNS, but not that of a command
        for number in (0, -1) * is_counted:
            peer.hear_packet(later(THEIRS, number))
            peer.hear(ACK)
        peer.hear_packet(THEIRS)
        peer.hear(ACK)
        peer.wait(pause)
        assert peer.hear_packet(THEIRS).startswith(ACK)
        assert peer.served.count(THEIRS) == executed + is_counted


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


@pytest.mark.parametrize(('response', 'wait'), [(ACK, 2.1), (NAK, 2.1), (NAK, 0.6)])
def test_command_that_has_left_is_asked_after_however_old_it_is(response: bytes,
                                                                wait: float) -> None:
    peer = bench()
    task = peer.add(COMMAND)
    task.expires = peer.now + 0.5
    peer.machine.wake(peer.now)
    peer.said()
    assert peer.wait(wait) == [(at, ENQ) for at in (1.0, 2.0) if at < wait]
    assert peer.hear(response) == b''
    peer.wait(CMD_TIMEOUT + 0.05)  # from the ACK on, not from the pause after it
    error = CommandTimeout if response == ACK else CommandExpired
    assert (type(task.result), task.sent, peer.counts()['commands_sent']) == (error, True, 1)
    late = peer.add(later(COMMAND, 1))
    late.expires = peer.now - 0.001
    peer.machine.wake(peer.now)
    assert (type(late.result), late.sent) == (CommandExpired, False)


def test_reply_is_not_taken_after_its_time_although_nobody_has_looked() -> None:
    peer, task = acknowledged()
    peer.hear(*single_bytes(peer.frame(THEIRS)), ACK)
    peer.now += CMD_TIMEOUT + 3.0  # the process stood still
    assert peer.hear(*2 * [peer.frame(REPLY)]) == ACK + ACK
    assert isinstance(task.result, CommandTimeout)
    assert peer.counts()['stale_messages'] == 1


def test_reply_that_began_in_time_is_taken_although_nobody_has_looked_since() -> None:
    peer, task = acknowledged()
    frame = peer.frame(REPLY)
    peer.wait(CMD_TIMEOUT - 0.01)
    peer.hear(frame[:9])
    peer.now += 0.02
    assert peer.hear(frame[9:]) == ACK
    assert task.result == REPLY


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


def test_second_command_goes_out_and_has_its_reply_while_the_first_waits() -> None:
    for most, due in ((1, 1.0), (2, 0.5)):  # without room, a due task wakes nothing
        peer = PeerBench(LinkSettings(station=None, max_outstanding=most))
        peer.begin(COMMAND)
        peer.said()
        setattr(peer, 'next_due', lambda peer=peer: peer.now + 0.5)
        peer.hear(ACK)
        assert peer.machine.next_call == peer.now + due
    task = peer.begin(later(COMMAND, 1))
    peer.said()
    assert peer.hear_packet(later(REPLY, 1)) == ACK  # before the ACK to its command
    assert (task.result, peer.wait(1.5)) == (later(REPLY, 1), [])


def test_short_wait_is_for_an_inactive_station() -> None:
    """Timeout counts for the answer of an active station, as on a half-duplex line."""
    peer, task = acknowledged()
    answer(peer, task)
    peer.add(later(COMMAND, 1)).answer_within = 0.1
    peer.machine.wake(peer.now)
    assert peer.said() == peer.frame(later(COMMAND, 1))
    assert [round(at, 1) for at, data in peer.wait(1.05)] == [TIMEOUT]


def test_inactive_station_gets_one_try() -> None:
    peer = bench()
    peer.stations.lost(1, peer.now)
    task = peer.begin(COMMAND)
    assert (peer.said(), peer.hear(NAK), peer.wait(0.2)) == (peer.frame(COMMAND), b'', [])
    assert isinstance(task.result, StationInactive)
