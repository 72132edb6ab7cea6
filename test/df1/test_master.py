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

"""The half-duplex master: one script for each rule of the manual (M 3-12..3-17) and of S0."""

from dataclasses import replace
from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, EOT, master_frame, message_frame, NAK, poll_frame, STX
from abdf1_ros.df1.machine import LineTiming, MIN_RESPONSE_TIME
from abdf1_ros.df1.master_line import MOST_QUEUED
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.errors import CommandTimeout, StationInactive, WrongCommandCode
import pytest
from support.script import Answer, Expect, MasterScript, Murmur, Silence
from support.virtual_line import Wire

SLAVE, MASTER = 17, 5
COMMAND = Packet(SLAVE, MASTER, 0x0F, 0, 0x0102, bytes.fromhex('A2 02 07 89 00 00'))
REPLY = COMMAND.reply(b'\x34\x12')
STALE = REPLY._replace(tns=0x0101)
SETTINGS = LinkSettings(
    station=MASTER, nak_retries=2, enq_retries=2, timeout=0.5, cmd_timeout=2.0, poll_pause=0.005)

SENT = Expect(master_frame(SLAVE, COMMAND.encode(), Checksum.CRC))
POLLED = Expect(poll_frame(SLAVE))
POLLED_AGAIN = Expect(poll_frame(SLAVE), after=0.005)
ACKED, NAKED = Expect(ACK), Expect(NAK)
ACKED_AND_SENT = Expect(ACK + SENT.data)
SAYS_ACK, SAYS_EOT, SAYS_NAK = Answer(ACK, 0.1), Answer(EOT, 0.1), Answer(NAK, 0.1)
TIMEOUT = Silence(0.5)

DELIVERED = {'commands_sent': 1, 'messages_sent': 1, 'acks_received': 1}
REPLIED = DELIVERED | {
    'messages_received': 1, 'replies_received': 1, 'polls_sent': 1, 'acks_sent': 1}


def frame(packet: Packet) -> bytes:
    """Return the slave's frame around ``packet``."""
    return message_frame(packet.encode(), Checksum.CRC)


def says(packet: Packet) -> Answer:
    """Return the answer that is a slave's message."""
    return Answer(frame(packet), 0.1)


def damaged(packet: Packet) -> bytes:
    """Return the slave's frame with one data bit flipped."""
    data = bytearray(frame(packet))
    data[4] ^= 0x20
    return bytes(data)


SAYS_REPLY = says(REPLY)


def inactive_script() -> MasterScript:
    """Return a master that knows the slave as inactive, with everything else at zero."""
    script = MasterScript(SETTINGS)
    script.stations.lost(SLAVE, 0.0)
    script.forget()
    return script


def replied(*parts: Expect | Answer | Silence, settings: LinkSettings = SETTINGS,
            timing: LineTiming | None = None) -> MasterScript:
    """Play COMMAND with these parts, see that it brings REPLY, and return the script."""
    script = MasterScript(settings, timing)
    assert script.run(COMMAND, *parts) == REPLY
    return script


def test_command_is_acknowledged_and_its_reply_polled_for() -> None:
    script = MasterScript(SETTINGS)
    reply = script.run(
        COMMAND,
        Expect(bytes.fromhex('10 01 11 10 02 11 05 0F 00 02 01 A2 02 07 89 00 00 10 03 57 DE')),
        Answer(bytes.fromhex('10 06')),
        Expect(bytes.fromhex('10 05 11 EF')),
        Answer(bytes.fromhex('10 02 05 11 4F 00 02 01 34 12 10 03 34 07')),
        Expect(bytes.fromhex('10 06')))
    assert reply == REPLY
    assert script.numbers() == [(2523, SLAVE)]
    assert script.counts() == {
        'messages_sent': 1, 'messages_received': 1, 'commands_sent': 1, 'replies_received': 1,
        'polls_sent': 1, 'acks_sent': 1, 'acks_received': 1}
    assert script.task.sent
    assert script.changes == []
    station = script.stations[SLAVE]
    assert (station.replies, station.last_tns, station.last_heard) == (1, 0x0102, 100.0)


def test_poll_and_ack_of_the_reply_leave_before_anything_else_is_done() -> None:
    script = MasterScript(SETTINGS)
    script.begin(COMMAND)
    counters, left = script.machine.counters, []
    Wire(script.machine, lambda data: left.append(
        (data, counters.acks_received, counters.messages_received))).attach(script.now)
    for part in SENT, SAYS_ACK, SAYS_REPLY:
        script.step(part)
    assert left == [(POLLED.data, 0, 0), (ACK, 1, 0)]


@pytest.mark.parametrize('heard', [
    frame(REPLY._replace(dst=SLAVE)), frame(REPLY._replace(src=SLAVE + 1)),
    frame(REPLY._replace(cmd=0x0F)), damaged(REPLY),
    master_frame(MASTER, REPLY.encode(), Checksum.CRC)])
def test_only_a_reply_of_the_polled_slave_has_its_ack_before_it_is_looked_at(heard: bytes) -> None:
    script = MasterScript(SETTINGS)
    looked_at: list[int] = []
    script.begin(COMMAND, SENT, SAYS_ACK, POLLED)
    Wire(script.machine, lambda data: looked_at.append(
        script.machine.counters.messages_received)).attach(script.now)
    script.machine.receive_data(heard, script.now)
    assert 0 not in looked_at


def test_slow_slave_is_polled_until_it_replies() -> None:
    script = replied(SENT, SAYS_ACK, POLLED, SAYS_EOT, POLLED_AGAIN, SAYS_EOT, POLLED_AGAIN,
                     SAYS_REPLY, ACKED)
    assert script.numbers() == [(2523, SLAVE)]
    assert script.counts() == REPLIED | {'polls_sent': 3, 'eots_received': 2}


def test_command_lost_is_sent_again() -> None:
    script = replied(SENT, TIMEOUT, SENT, SAYS_ACK, POLLED, SAYS_REPLY, ACKED)
    assert script.numbers() == [(2515, 0), (2521, 1, 2515), (2523, SLAVE)]
    assert script.counts() == REPLIED | {'messages_sent': 2, 'nak_retries': 1}


@pytest.mark.parametrize(('garbage', 'last'), [
    (b'\x10\x16', 0x16), (b'\x10', 0x10), (b'\x06', 0x06), (b'\x55\x66', 0x66)])
def test_ack_lost_or_damaged_the_command_is_sent_again(garbage: bytes, last: int) -> None:
    script = replied(SENT, Answer(garbage), TIMEOUT, SENT, SAYS_ACK, POLLED, SAYS_REPLY, ACKED)
    invalid = [(2514, 0x16)] if garbage == b'\x10\x16' else []
    assert script.numbers() == [*invalid, (2515, last), (2521, 1, 2515), (2523, SLAVE)]
    assert script.counts()['nak_retries'] == 1


def test_reply_damaged_is_polled_for_again_without_nak() -> None:
    script = MasterScript(SETTINGS)
    bad = damaged(REPLY)
    expected = Checksum.CRC.of_message(b'\x05\x11\x6F' + REPLY.encode()[3:])
    assert script.run(COMMAND, SENT, SAYS_ACK, POLLED, Answer(bad), POLLED, SAYS_REPLY,
                      ACKED) == REPLY
    check = int.from_bytes(bad[-2:], 'little')
    assert script.numbers() == [
        (2506, *divmod(check, 256), *divmod(expected, 256)), (2522, 1, 2506), (2523, SLAVE)]
    assert script.counts() == REPLIED | {'polls_sent': 2, 'crc_errors': 1, 'enq_retries': 1}


def test_poll_lost_is_sent_again() -> None:
    script = replied(SENT, SAYS_ACK, POLLED, TIMEOUT, POLLED, TIMEOUT, POLLED, SAYS_REPLY, ACKED)
    assert script.numbers() == [
        (2516, 0), (2522, 1, 2516), (2516, 0), (2522, 2, 2516), (2523, SLAVE)]
    assert script.counts() == REPLIED | {'polls_sent': 3, 'enq_retries': 2}


def test_master_ack_lost_the_duplicate_is_acknowledged_and_passed_over() -> None:
    script = MasterScript(SETTINGS)
    script.run(COMMAND, SENT, SAYS_ACK, POLLED, SAYS_REPLY, ACKED)
    script.forget()
    command = COMMAND._replace(tns=0x0103)
    reply = command.reply(b'\x35\x12')
    assert script.run(
        command, Expect(master_frame(SLAVE, command.encode(), Checksum.CRC)), SAYS_ACK,
        POLLED, SAYS_REPLY, Expect(ACK), Expect(poll_frame(SLAVE), after=0.005), says(reply),
        ACKED) == reply
    assert script.numbers() == [(2524, SLAVE), (2523, SLAVE)]
    assert script.counts() == REPLIED | {
        'messages_received': 2, 'duplicate_messages': 1, 'polls_sent': 2, 'acks_sent': 2}
    assert script.stations[SLAVE].replies == 2


@pytest.mark.parametrize('retries', [0, 1, 3, 10])
def test_dead_slave_becomes_inactive_after_its_retries(retries: int) -> None:
    script = MasterScript(replace(SETTINGS, nak_retries=retries))
    error = script.run(COMMAND, *(SENT, TIMEOUT) * (retries + 1))
    assert isinstance(error, StationInactive)
    assert error.args == (SLAVE,)
    noticed = []
    for number in range(1, retries + 1):
        noticed += [(2515, 0), (2521, number, 2515)]
    assert script.numbers() == [*noticed, (2515, 0), (2519, retries), (2509, SLAVE)]
    counts = {'commands_sent': 1, 'messages_sent': retries + 1, 'nak_retries': retries,
              'nak_limit_exceeded': 1}
    assert script.counts() == {name: count for name, count in counts.items() if count}
    assert script.changes == [(SLAVE, False)]
    assert script.stations[SLAVE].silent_since == script.now
    assert script.now == pytest.approx(100.0 + 0.5 * (retries + 1))
    assert script.task.sent


def test_inactive_station_gets_exactly_one_poll() -> None:
    script = inactive_script()
    error = script.run(COMMAND, POLLED, TIMEOUT)
    assert isinstance(error, StationInactive)
    assert not script.task.sent
    assert script.numbers() == [(2509, SLAVE)]
    assert script.counts() == {'polls_sent': 1}
    assert script.changes == []
    assert isinstance(script.run(COMMAND, POLLED, TIMEOUT), StationInactive)


def test_eot_makes_an_inactive_station_active() -> None:
    script = inactive_script()
    assert script.run(COMMAND, POLLED, SAYS_EOT, SENT, SAYS_ACK, POLLED, SAYS_REPLY,
                      ACKED) == REPLY
    assert script.changes == [(SLAVE, True)]
    assert script.numbers() == [(2523, SLAVE)]
    assert script.counts() == REPLIED | {'polls_sent': 2, 'eots_received': 1}


def test_stale_message_makes_an_inactive_station_active() -> None:
    script = inactive_script()
    assert script.run(COMMAND, POLLED, says(STALE), ACKED_AND_SENT, SAYS_ACK, POLLED,
                      SAYS_REPLY, ACKED) == REPLY
    assert script.changes == [(SLAVE, True)]
    assert script.numbers() == [(2510, SLAVE, MASTER, 0x0101), (2523, SLAVE)]
    assert script.counts() == REPLIED | {
        'messages_received': 2, 'replies_received': 2, 'polls_sent': 2, 'acks_sent': 2,
        'stale_messages': 1}


@pytest.mark.parametrize(('answer', 'numbers', 'counter'), [
    (damaged(REPLY), [2506], 'crc_errors'),
    (message_frame(b'abc', Checksum.CRC), [2513], 'invalid_messages'),
    (NAK, [2517, 2511], 'naks_received')])
def test_bad_answer_leaves_an_inactive_station_inactive_and_is_told(
        answer: bytes, numbers: list[int], counter: str) -> None:
    script = inactive_script()
    assert isinstance(script.run(COMMAND, POLLED, Answer(answer, 0.1)), StationInactive)
    assert (script.changes, script.counts()) == ([], {'polls_sent': 1, counter: 1})
    assert [number for number, *_ in script.numbers()] == [*numbers, 2509]
    assert not script.task.sent


@pytest.mark.parametrize('retries', [0, 1, 3])
def test_station_is_inactive_after_the_last_poll_without_an_answer(retries: int) -> None:
    script = MasterScript(replace(SETTINGS, enq_retries=retries))
    error = script.run(COMMAND, SENT, SAYS_ACK, *(POLLED, TIMEOUT) * (retries + 1))
    assert isinstance(error, StationInactive)
    noticed = []
    for number in range(1, retries + 1):
        noticed += [(2516, 0), (2522, number, 2516)]
    assert script.numbers() == [*noticed, (2516, 0), (2520, retries), (2509, SLAVE)]
    counts = DELIVERED | {
        'polls_sent': retries + 1, 'enq_retries': retries, 'enq_limit_exceeded': 1}
    assert script.counts() == {name: count for name, count in counts.items() if count}
    assert script.changes == [(SLAVE, False)]
    assert script.task.sent


def test_enq_retries_count_afresh_after_an_eot() -> None:
    script = replied(SENT, SAYS_ACK, *(POLLED, TIMEOUT) * 2, POLLED, SAYS_EOT, POLLED_AGAIN,
                     TIMEOUT, POLLED, TIMEOUT, POLLED, SAYS_REPLY, ACKED,
                     settings=replace(SETTINGS, cmd_timeout=5.0))
    assert script.counts()['enq_retries'] == 4
    assert 'enq_limit_exceeded' not in script.counts()


@pytest.mark.parametrize('nak', [True, False])
def test_command_timeout_by_eots(nak: bool) -> None:
    script = MasterScript(replace(SETTINGS, cmd_timeout=1.0, nak_on_command_timeout=nak))
    busy = Answer(EOT, 0.4)
    last = [NAKED] if nak else []
    error = script.run(COMMAND, SENT, SAYS_ACK, POLLED, busy, POLLED_AGAIN, busy, POLLED_AGAIN,
                       busy, *last)
    assert isinstance(error, CommandTimeout)
    assert script.numbers() == [(2508,)]
    assert script.counts() == DELIVERED | {
        'polls_sent': 3, 'eots_received': 3, 'command_timeouts': 1} | (
        {'naks_sent': 1} if nak else {})
    assert script.changes == []
    assert script.stations[SLAVE].active
    assert script.task.sent


def test_late_replies_in_a_row_are_counted_until_one_comes_in_time() -> None:
    script = MasterScript(replace(SETTINGS, cmd_timeout=0.25))
    station = script.stations[SLAVE]
    for late in (1, 2):
        script.run(COMMAND, SENT, SAYS_ACK, POLLED, Answer(EOT, 0.25), NAKED)
        assert station.overdue == late
    script.run(COMMAND, SENT, SAYS_ACK, POLLED, SAYS_REPLY, ACKED)
    assert station.overdue == 0


def test_command_timeout_counts_from_the_transmission_that_was_acknowledged() -> None:
    """S0: the time of a cycle of command, ACK, poll and reply; what repetitions cost is not in."""
    script = MasterScript(replace(SETTINGS, cmd_timeout=0.5))
    error = script.run(COMMAND, SENT, TIMEOUT, SENT, Answer(ACK, 0.375), POLLED,
                       Answer(EOT, 0.12), POLLED_AGAIN, Answer(EOT), NAKED)
    assert isinstance(error, CommandTimeout)
    assert script.now == pytest.approx(101.0)


def test_command_timeout_by_stale_messages() -> None:
    script = MasterScript(replace(SETTINGS, cmd_timeout=0.0625))
    stale = [REPLY._replace(tns=0x0090 + n) for n in range(MOST_QUEUED + 1)]
    steps = [step for packet in stale for step in (POLLED_AGAIN, says(packet), ACKED)][1:-1]
    error = script.run(COMMAND, SENT, Answer(ACK), POLLED, *steps, Expect(ACK + NAK))
    assert isinstance(error, CommandTimeout)
    assert script.numbers() == [*((2510, SLAVE, MASTER, packet.tns) for packet in stale), (2508,)]


def test_reply_behind_stale_messages_is_taken_even_after_the_command_timeout() -> None:
    script = replied(SENT, Answer(ACK), POLLED, says(STALE), ACKED, POLLED_AGAIN, SAYS_REPLY,
                     ACKED, settings=replace(SETTINGS, cmd_timeout=0.0625))
    assert 'command_timeouts' not in script.counts()


def test_reply_at_the_last_poll_is_taken_even_after_the_command_timeout() -> None:
    script = replied(SENT, Answer(ACK, 0.4), POLLED, Answer(frame(REPLY), 0.4), ACKED,
                     settings=replace(SETTINGS, cmd_timeout=0.5))
    assert 'command_timeouts' not in script.counts()


def test_late_reply_after_a_command_timeout_is_stale() -> None:
    script = MasterScript(replace(SETTINGS, cmd_timeout=0.5))
    script.run(COMMAND, SENT, SAYS_ACK, POLLED, Answer(EOT, 0.45), NAKED)
    script.forget()
    command = COMMAND._replace(tns=0x0103)
    assert script.run(
        command, Expect(master_frame(SLAVE, command.encode(), Checksum.CRC)), SAYS_ACK, POLLED,
        SAYS_REPLY, ACKED, POLLED_AGAIN, says(command.reply()), ACKED) == command.reply()
    assert script.numbers() == [(2510, SLAVE, MASTER, 0x0102), (2523, SLAVE)]
    assert script.counts()['stale_messages'] == 1


def test_nak_received_the_command_is_sent_again() -> None:
    script = replied(SENT, SAYS_NAK, SENT, SAYS_ACK, POLLED, SAYS_REPLY, ACKED)
    assert script.numbers() == [(2517,), (2511,), (2521, 1, 2511), (2523, SLAVE)]
    assert script.counts() == REPLIED | {'messages_sent': 2, 'naks_received': 1, 'nak_retries': 1}


def test_nak_instead_of_an_answer_to_a_poll_is_told_and_the_poll_repeated() -> None:
    script = replied(SENT, SAYS_ACK, POLLED, SAYS_NAK, POLLED, SAYS_REPLY, ACKED)
    assert script.numbers() == [(2517,), (2511,), (2522, 1, 2511), (2523, SLAVE)]
    assert script.counts()['naks_received'] == script.counts()['enq_retries'] == 1


def test_message_instead_of_an_ack_is_no_ack() -> None:
    script = replied(SENT, says(STALE), SENT, SAYS_ACK, POLLED, SAYS_REPLY, ACKED)
    assert script.numbers() == [(2515, STX[1]), (2521, 1, 2515), (2523, SLAVE)]
    assert script.counts() == REPLIED | {'messages_sent': 2, 'nak_retries': 1}


def test_reply_with_a_wrong_command_code_fails_the_command_alone() -> None:
    script = MasterScript(SETTINGS)
    error = script.run(COMMAND, SENT, SAYS_ACK, POLLED, says(REPLY._replace(cmd=0x41)), ACKED)
    assert isinstance(error, WrongCommandCode)
    assert error.args == (SLAVE, 0x41, 0x4F)
    assert script.numbers() == [(2505, SLAVE, 0x41, 0x4F)]
    assert script.counts() == REPLIED | {'invalid_messages': 1}
    assert script.stations[SLAVE].active
    assert script.task.sent


def test_stale_reply_is_acknowledged_and_counted() -> None:
    script = replied(SENT, SAYS_ACK, POLLED, says(STALE), ACKED, POLLED_AGAIN, SAYS_REPLY, ACKED)
    assert script.numbers() == [(2510, SLAVE, MASTER, 0x0101), (2523, SLAVE)]
    assert script.counts() == REPLIED | {
        'messages_received': 2, 'replies_received': 2, 'polls_sent': 2, 'acks_sent': 2,
        'stale_messages': 1}
    assert script.stations[SLAVE].replies == 1


def test_reply_to_another_station_is_invalid() -> None:
    script = MasterScript(replace(SETTINGS, accept_slave_messages=False))
    wrong = REPLY._replace(dst=6)
    assert script.run(COMMAND, SENT, SAYS_ACK, POLLED, says(wrong), ACKED, POLLED_AGAIN,
                      Answer(frame(REPLY._replace(tns=0x0101))), ACKED, POLLED_AGAIN,
                      says(REPLY), ACKED) == REPLY
    assert script.numbers() == [
        (2510, wrong.src, wrong.dst, wrong.tns), (2510, SLAVE, MASTER, 0x0101), (2523, SLAVE)]
    assert script.counts()['invalid_messages'] == 1
    assert script.counts()['stale_messages'] == 1


@pytest.mark.parametrize('change', [{'src': 18}, {'src': MASTER}, {'dst': SLAVE}])
def test_message_that_cannot_be_the_stations_gets_no_ack_and_comes_again(
        change: dict[str, Any]) -> None:
    script = MasterScript(SETTINGS)
    wrong = REPLY._replace(**change)
    assert script.run(COMMAND, SENT, SAYS_ACK, POLLED, says(wrong), POLLED_AGAIN, SAYS_REPLY,
                      ACKED) == REPLY
    assert script.numbers() == [(2510, wrong.src, wrong.dst, wrong.tns), (2523, SLAVE)]
    assert script.counts() == REPLIED | {
        'messages_received': 2, 'invalid_messages': 1, 'polls_sent': 2}


def test_message_that_cannot_be_the_stations_is_acknowledged_when_it_insists() -> None:
    script = MasterScript(SETTINGS)
    wrong = REPLY._replace(src=18)
    assert script.run(COMMAND, SENT, SAYS_ACK, POLLED, says(wrong), POLLED_AGAIN, says(wrong),
                      ACKED, POLLED_AGAIN, SAYS_REPLY, ACKED) == REPLY
    assert script.counts()['invalid_messages'] == 1


@pytest.mark.parametrize('checksum', Checksum)
def test_reply_that_lost_its_leading_00_is_not_taken_for_a_command(checksum: Checksum) -> None:
    """The CRC of M 3-6 begins with 0: neither check sees it; what is left begins with SLAVE 4F."""
    command = COMMAND._replace(src=0)
    script = MasterScript(replace(SETTINGS, station=0, checksum=checksum))
    whole = command.reply(b'\x34\x12')
    shorter = message_frame(whole.encode()[1:], checksum)
    poll = [POLLED, Answer(shorter, 0.1)]
    assert script.run(
        command, Expect(master_frame(SLAVE, command.encode(), checksum)), SAYS_ACK, *poll,
        POLLED_AGAIN, Answer(message_frame(whole.encode(), checksum), 0.1), ACKED) == whole
    assert script.counts()['invalid_messages'] == 1
    assert 'commands_received' not in script.counts()
    assert [station.number for station in script.stations] == [SLAVE]


def test_message_too_short_is_told_and_polled_for_again() -> None:
    script = MasterScript(SETTINGS)
    short = Answer(message_frame(b'abcde', Checksum.CRC))
    assert script.run(COMMAND, SENT, SAYS_ACK, POLLED, short, POLLED, SAYS_REPLY, ACKED) == REPLY
    assert script.numbers() == [(2513, 6), (2522, 1, 2513), (2523, SLAVE)]
    assert script.counts()['invalid_messages'] == 1
    assert script.counts()['messages_received'] == 1


def test_message_without_etx_ends_by_a_pause() -> None:
    script = MasterScript(SETTINGS, LineTiming(char_time=0.001))
    leaving = len(SENT.data) * 0.001
    begun = Answer(frame(REPLY)[:-3], 0.4)
    assert script.run(
        COMMAND, SENT, Answer(ACK, leaving), POLLED, begun, Silence(0.02 + 0.1), POLLED,
        SAYS_REPLY, ACKED) == REPLY
    assert script.numbers() == [(2518,), (2522, 1, 2518), (2523, SLAVE)]
    assert script.counts()['invalid_messages'] == 1


@pytest.mark.parametrize(('checksum', 'number', 'counter'), [
    (Checksum.CRC, 2506, 'crc_errors'), (Checksum.BCC, 2507, 'bcc_errors')])
def test_message_without_the_end_of_its_check_has_a_wrong_check(
        checksum: Checksum, number: int, counter: str) -> None:
    whole = message_frame(REPLY.encode(), checksum)
    received = whole[-2] if checksum is Checksum.CRC else 0
    expected = divmod(checksum.of_message(REPLY.encode()), 256)
    script = MasterScript(replace(SETTINGS, checksum=checksum))
    sent = Expect(master_frame(SLAVE, COMMAND.encode(), checksum))
    assert script.run(COMMAND, sent, SAYS_ACK, POLLED, Answer(whole[:-1], 0.1), Silence(0.4),
                      POLLED, Answer(whole, 0.1), ACKED) == REPLY
    assert script.numbers()[:2] == [(number, 0, received, *expected), (2522, 1, number)]
    assert script.counts()[counter] == 1  # S0, messages 2506 and 2507, not 2518


def test_nothing_is_said_over_a_slave_that_goes_on_after_what_looks_like_a_symbol() -> None:
    """A bit of a 00 turns over: DLE 00 inside of a message is no symbol (S0, message 2514)."""
    script = MasterScript(SETTINGS, LineTiming(char_time=0.001))
    reply = COMMAND.reply(bytes(40))
    whole = frame(reply)
    broken = whole.replace(bytes(8), b'\0\0\x10\0\0\0\0\0', 1)
    assert script.run(
        COMMAND, SENT, SAYS_ACK, POLLED, Answer(broken[:30], 0.1), Murmur(broken[30:40], 0.02),
        Murmur(broken[40:], 0.02), Silence(MIN_RESPONSE_TIME + 0.01), POLLED, Answer(whole, 0.1),
        ACKED) == reply
    assert script.numbers() == [(2514, 0), (2518,), (2522, 1, 2518), (2523, SLAVE)]
    assert script.counts()['invalid_messages'] == 1


def test_station_that_never_falls_quiet_is_not_listened_to_for_ever() -> None:
    script = MasterScript(SETTINGS, LineTiming(char_time=0.001))
    babble = [Murmur(b'\x55' * 10, 0.01)] * 29
    longest = 0.02 + (10 + 261) * 0.001
    assert script.run(
        COMMAND, SENT, Answer(ACK, 0.1), POLLED, Answer(STX + EOT, 0.1), *babble,
        Silence(longest - 0.29), POLLED, SAYS_REPLY, ACKED) == REPLY


def test_invalid_symbol_is_told_and_passed_over() -> None:
    script = replied(SENT, Answer(b'\x10\x07'), SAYS_ACK, POLLED, Answer(b'\x10\xFE'), TIMEOUT,
                     POLLED, SAYS_REPLY, ACKED)
    assert script.numbers() == [
        (2514, 0x07), (2514, 0xFE), (2516, 0xFE), (2522, 1, 2516), (2523, SLAVE)]


def test_echo_of_our_own_frames_is_passed_over() -> None:
    script = replied(SENT, Answer(SENT.data), SAYS_ACK, POLLED, Answer(POLLED.data), SAYS_EOT,
                     POLLED_AGAIN, Answer(POLLED.data), SAYS_REPLY, ACKED)
    assert script.numbers() == [(2523, SLAVE)]
    assert script.counts() == REPLIED | {'polls_sent': 2, 'eots_received': 1}


@pytest.mark.parametrize('size', [1, 3, 1000])
def test_answer_in_place_of_the_echo_is_heard(size: int) -> None:
    """An adapter ceases to echo between two frames, whatever bytes come at a time."""
    script = MasterScript(SETTINGS)
    reply = SAYS_REPLY.data
    parts = [Answer(reply[at:at + size]) for at in range(0, len(reply), size)]
    assert script.run(COMMAND, SENT, Answer(SENT.data), SAYS_ACK, POLLED, *parts, ACKED) == REPLY
    assert script.numbers() == [(2523, SLAVE)]


def test_answer_of_before_the_transmission_is_none() -> None:
    script = replied(SENT, Answer(ACK + EOT + frame(REPLY)), POLLED, TIMEOUT, POLLED, SAYS_REPLY,
                     ACKED)
    assert script.counts()['polls_sent'] == 2


def test_tx_delay_passes_before_each_transmission() -> None:
    replied(Expect(SENT.data, 0.05), SAYS_ACK, Expect(POLLED.data, 0.05), SAYS_EOT,
            Expect(POLLED.data, 0.05), TIMEOUT, Expect(POLLED.data, 0.05), SAYS_REPLY,
            Expect(ACK, 0.05), timing=LineTiming(tx_delay=0.05))


def test_station_behind_a_gateway() -> None:
    """STN is the gateway, DST the station (M 3-7)."""
    script = MasterScript(SETTINGS, routes={99: SLAVE, 98: SLAVE})
    command = COMMAND._replace(dst=99)
    reply = command.reply(b'\x34\x12')
    assert script.run(
        command, Expect(master_frame(SLAVE, command.encode(), Checksum.CRC)), SAYS_ACK, POLLED,
        says(reply), ACKED) == reply
    assert script.numbers() == [(2523, 99)]
    assert script.stations[99].replies == 1
    assert script.stations[SLAVE].replies == 0


def test_reply_of_another_station_behind_the_same_gateway_is_stale() -> None:
    script = MasterScript(SETTINGS, routes={99: SLAVE, 98: SLAVE})
    command = COMMAND._replace(dst=99)
    other = COMMAND._replace(dst=98).reply(b'\x77')
    assert script.run(
        command, Expect(master_frame(SLAVE, command.encode(), Checksum.CRC)), SAYS_ACK, POLLED,
        says(other), ACKED, POLLED_AGAIN, says(command.reply()), ACKED
    ) == command.reply()
    assert script.numbers() == [(2510, 98, command.src, command.tns), (2523, 99)]


def test_stations_behind_a_gateway_share_its_state() -> None:
    script = MasterScript(SETTINGS, routes={99: SLAVE, 98: SLAVE})
    script.stations.add((98, 99))
    command, other = COMMAND._replace(dst=99), COMMAND._replace(dst=98)
    frame = Expect(master_frame(SLAVE, command.encode(), Checksum.CRC))
    assert isinstance(script.run(command, *(frame, TIMEOUT) * 3), StationInactive)
    assert sorted(script.changes) == [(SLAVE, False), (98, False), (99, False)]
    assert script.numbers()[-1] == (2509, SLAVE)
    script.changes.clear()
    # One poll of the gateway, and all behind it are back.
    assert script.run(
        other, POLLED, SAYS_EOT, Expect(master_frame(SLAVE, other.encode(), Checksum.CRC)),
        SAYS_ACK, POLLED, says(other.reply()), ACKED) == other.reply()
    assert sorted(script.changes) == [(SLAVE, True), (98, True), (99, True)]


def test_station_that_its_gateway_does_not_reach_is_not_heard() -> None:
    script = MasterScript(SETTINGS, routes={99: SLAVE})
    command = COMMAND._replace(dst=99)
    reply = command.reply(sts=0x02)
    assert script.run(
        command, Expect(master_frame(SLAVE, command.encode(), Checksum.CRC)), SAYS_ACK, POLLED,
        says(reply), ACKED) == reply
    assert script.stations[SLAVE].last_heard is not None
    assert script.stations[99].last_heard is None


def test_task_is_told_when_its_command_has_been_on_the_line() -> None:
    script = inactive_script()
    script.begin(COMMAND, POLLED)
    assert not script.task.sent
    script = inactive_script()
    script.begin(COMMAND, POLLED, SAYS_EOT, SENT)
    assert script.task.sent


def test_slaves_command_instead_of_the_reply_is_acknowledged_and_polling_goes_on() -> None:
    script = MasterScript(SETTINGS)
    foreign = Packet(MASTER, SLAVE, 0x0F, 0, 0x0777, b'\xAA')
    assert script.run(COMMAND, SENT, SAYS_ACK, POLLED, says(foreign), ACKED, POLLED_AGAIN,
                      SAYS_REPLY, ACKED) == REPLY
    # Nobody serves here: it is told and dropped.
    assert script.numbers() == [(2510, SLAVE, MASTER, 0x0777), (2523, SLAVE)]
    assert script.counts() == REPLIED | {
        'messages_received': 2, 'commands_received': 1, 'polls_sent': 2, 'acks_sent': 2}


def test_repetition_is_known_by_its_dst_too() -> None:
    script = MasterScript(SETTINGS)
    others = REPLY._replace(dst=9)
    assert script.run(COMMAND, SENT, SAYS_ACK, POLLED, says(others), ACKED, POLLED_AGAIN,
                      SAYS_REPLY, ACKED) == REPLY
    assert 'duplicate_messages' not in script.counts()
