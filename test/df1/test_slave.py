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

"""The half-duplex slave, rule by rule (M 3-4, 3-5; KF2 4-31)."""

from collections.abc import Callable
from dataclasses import asdict

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import (
    ACK,
    Code,
    Control,
    EOT,
    Frame,
    FrameFault,
    master_frame,
    message_frame,
    Poll,
    poll_frame,
    Symbol,
    Unknown,
)
from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave, multidrop
import pytest

STATION = 7
COMMAND = Packet(dst=STATION, src=5, cmd=0x0F, sts=0, tns=0x0102, data=b'\xA2\x01')
POLL = Poll(STATION, True)
HEARD_ACK, HEARD_NAK = Control(Code.ACK), Control(Code.NAK)


class Bench:
    """A slave, and the commands it has executed."""

    def __init__(self, sts: int = 0, settings: LinkSettings | None = None) -> None:
        self.served: list[Packet] = []
        self._sts = sts
        self.slave = HalfDuplexSlave(settings or LinkSettings(station=STATION), self._serve)

    def _serve(self, command: Packet) -> Packet:
        self.served.append(command)
        return command.reply(b'', self._sts)

    def hear(self, *symbols: Symbol) -> list[bytes]:
        """Return what the slave answers to each symbol."""
        return [self.slave.handle(symbol) for symbol in symbols]

    def counts(self) -> dict[str, int]:
        """Return the counters that are not zero."""
        return {name: count for name, count in asdict(self.slave.counters).items() if count}


def sent(packet: Packet, station: int | None = STATION, fault: FrameFault | None = None) -> Frame:
    """Return the symbol of a master's frame."""
    return Frame(packet.encode(), station, fault)


def reply_frame(command: Packet, sts: int = 0, checksum: Checksum = Checksum.CRC) -> bytes:
    """Return the frame of the reply to ``command``."""
    return message_frame(command.reply(b'', sts).encode(), checksum)


def later(number: int) -> Packet:
    """Return a command of a later transaction."""
    return COMMAND._replace(tns=COMMAND.tns + number)


def test_command_is_acknowledged_and_its_reply_waits_for_a_poll() -> None:
    bench = Bench()
    assert bench.hear(sent(COMMAND), POLL, HEARD_ACK, POLL) == [
        ACK, reply_frame(COMMAND), b'', EOT]
    assert bench.served == [COMMAND]
    assert bench.counts() == {
        'messages_received': 1, 'commands_received': 1, 'acks_sent': 1, 'polls_received': 2,
        'messages_sent': 1, 'replies_sent': 1, 'acks_received': 1, 'eots_sent': 1}


def test_poll_without_a_message_is_answered_by_eot() -> None:
    bench = Bench()
    assert bench.hear(POLL, POLL) == [EOT, EOT]
    assert bench.counts() == {'polls_received': 2, 'eots_sent': 2}


@pytest.mark.parametrize('poll', [Poll(STATION, False), Poll(8, True), Poll(BROADCAST, True)])
def test_poll_of_another_or_damaged_is_passed_over(poll: Poll) -> None:
    bench = Bench()
    assert bench.hear(sent(COMMAND), poll) == [ACK, b'']
    assert 'polls_received' not in bench.counts()


@pytest.mark.parametrize('station', [8, None])
def test_frame_of_another_is_passed_over(station: int | None) -> None:
    bench = Bench()
    assert bench.hear(sent(COMMAND, station)) == [b'']
    assert (bench.served, bench.counts()) == ([], {})


@pytest.mark.parametrize(('fault', 'checksum', 'counter'), [
    (FrameFault.BAD_CHECK, Checksum.CRC, 'crc_errors'),
    (FrameFault.BAD_CHECK, Checksum.BCC, 'bcc_errors'),
    (FrameFault.TOO_SHORT, Checksum.CRC, 'invalid_messages'),
    (FrameFault.TOO_LONG, Checksum.CRC, 'invalid_messages'),
    (FrameFault.NO_ETX, Checksum.BCC, 'invalid_messages')])
def test_bad_frame_is_met_with_silence(fault: FrameFault, checksum: Checksum,
                                       counter: str) -> None:
    bench = Bench(settings=LinkSettings(station=STATION, checksum=checksum))
    assert bench.hear(sent(COMMAND, fault=fault)) == [b'']
    assert (bench.served, bench.counts()) == ([], {counter: 1})


@pytest.mark.parametrize('checksum', Checksum)
@pytest.mark.parametrize('tns', [0x0107, 0x0100])
def test_command_that_lost_its_leading_00_is_met_with_silence(checksum: Checksum,
                                                              tns: int) -> None:
    bench = Bench(settings=LinkSettings(station=0, checksum=checksum))
    command = COMMAND._replace(dst=0, tns=tns)
    moved = Frame(command.encode()[1:], 0)
    assert bench.hear(moved, sent(command, 0)) == [b'', ACK]
    assert bench.served == [command]
    assert bench.counts()['invalid_messages'] == 1


def test_command_with_a_status_is_met_with_silence() -> None:
    bench = Bench()
    assert bench.hear(sent(COMMAND._replace(sts=0x10)), sent(COMMAND)) == [b'', ACK]
    assert bench.served == [COMMAND]


def test_ack_lost_duplicate_command_is_acknowledged_and_not_executed() -> None:
    bench = Bench()
    assert bench.hear(sent(COMMAND), sent(COMMAND), POLL) == [ACK, ACK, reply_frame(COMMAND)]
    assert bench.served == [COMMAND]
    assert bench.counts() == {
        'messages_received': 2, 'commands_received': 1, 'duplicate_messages': 1, 'acks_sent': 2,
        'polls_received': 1, 'messages_sent': 1, 'replies_sent': 1}


def test_duplicate_is_known_after_its_reply_too() -> None:
    bench = Bench()
    assert bench.hear(sent(COMMAND), POLL, HEARD_ACK, sent(COMMAND), POLL)[3:] == [ACK, EOT]
    assert bench.served == [COMMAND]


def test_master_ack_lost_reply_is_held_and_sent_again() -> None:
    bench = Bench()
    reply = reply_frame(COMMAND)
    assert bench.hear(sent(COMMAND), POLL, POLL, HEARD_ACK, POLL) == [ACK, reply, reply, b'', EOT]
    assert bench.counts() == {
        'messages_received': 1, 'commands_received': 1, 'acks_sent': 1, 'polls_received': 3,
        'messages_sent': 2, 'replies_sent': 1, 'nak_retries': 1, 'acks_received': 1,
        'eots_sent': 1}


@pytest.mark.parametrize('retries', [0, 1, 3])
def test_reply_is_given_up_after_its_retries(retries: int) -> None:
    bench = Bench(settings=LinkSettings(station=STATION, nak_retries=retries))
    bench.hear(sent(COMMAND))
    reply = reply_frame(COMMAND)
    assert bench.hear(*[POLL] * (retries + 2)) == [reply] * (retries + 1) + [EOT]
    assert bench.slave.counters.nak_limit_exceeded == 1
    assert bench.slave.counters.nak_retries == retries
    assert bench.slave.counters.replies_sent == 1


@pytest.mark.parametrize('between', [
    POLL, Poll(8, True), Poll(STATION, False), sent(later(1), 8), Control(Code.EOT), Unknown(0)])
def test_ack_is_ours_only_straight_after_our_message(between: Symbol) -> None:
    bench = Bench(settings=LinkSettings(station=STATION, nak_retries=9))
    reply = reply_frame(COMMAND)
    bench.hear(sent(COMMAND), POLL, between)
    if between == POLL:
        bench.hear(Unknown(0))
    assert bench.hear(HEARD_ACK, POLL) == [b'', reply]
    assert bench.slave.counters.acks_received == 0


def test_sink_full_command_is_neither_acknowledged_nor_executed_nor_remembered() -> None:
    bench = Bench(settings=LinkSettings(station=STATION, queue_size=2))
    commands = [sent(later(number)) for number in range(3)]
    assert bench.hear(*commands) == [ACK, ACK, b'']
    assert len(bench.served) == 2
    assert bench.hear(POLL, HEARD_ACK, commands[2]) == [reply_frame(COMMAND), b'', ACK]
    assert bench.served[2] == later(2)
    assert bench.slave.counters.duplicate_messages == 0
    assert bench.slave.counters.refused_for_memory == 1


def test_duplicate_is_acknowledged_by_a_full_sink_too() -> None:
    bench = Bench(settings=LinkSettings(station=STATION, queue_size=1))
    assert bench.hear(sent(COMMAND), sent(COMMAND)) == [ACK, ACK]
    assert len(bench.served) == 1


def test_nak_resets_the_slave() -> None:
    bench = Bench()
    assert bench.hear(sent(COMMAND), sent(later(1)), POLL, HEARD_NAK, POLL)[3:] == [b'', EOT]
    assert bench.slave.counters.naks_received == 1


def test_command_is_still_known_as_duplicate_after_a_nak() -> None:
    bench = Bench()
    bench.hear(sent(COMMAND), HEARD_NAK, sent(COMMAND))
    assert bench.served == [COMMAND]


def test_broadcast_is_executed_but_neither_acknowledged_nor_answered() -> None:
    bench = Bench()
    command = COMMAND._replace(dst=BROADCAST)
    assert bench.hear(sent(command, BROADCAST), sent(command, BROADCAST), POLL) == [b'', b'', EOT]
    assert bench.served == [command]
    assert bench.slave.counters.acks_sent == 0


def test_reply_from_the_master_is_acknowledged_and_not_executed() -> None:
    bench = Bench()
    assert bench.hear(sent(COMMAND.reply()), POLL) == [ACK, EOT]
    assert bench.served == []
    assert bench.slave.counters.replies_received == 1
    assert bench.slave.counters.commands_received == 0


def test_reply_with_an_error_is_counted_once() -> None:
    bench = Bench(sts=0x10)
    assert bench.hear(sent(COMMAND), POLL, POLL)[1:] == [reply_frame(COMMAND, 0x10)] * 2
    assert bench.slave.counters.error_messages_sent == 1


class Line:
    """A machine of several slaves; ``say`` returns what they answer."""

    def __init__(self, *slaves: HalfDuplexSlave) -> None:
        self.machine = Machine(multidrop(slaves), checksum=Checksum.CRC)
        self.machine.start(0.0)

    def say(self, data: bytes) -> bytes:
        """Put the master's bytes on the line."""
        self.machine.receive_data(data, 1.0)
        return self.machine.data_to_send()


def echo(data: bytes) -> Callable[[Packet], Packet]:
    """Return a server that always replies ``data``."""
    return lambda command: command.reply(data)


def test_multidrop_only_the_addressed_station_answers() -> None:
    line = Line(*(HalfDuplexSlave(LinkSettings(station=number), echo(bytes((number,))))
                  for number in (1, 7, 8)))
    assert line.say(master_frame(7, COMMAND.encode(), Checksum.CRC)) == ACK
    assert line.say(poll_frame(8)) == EOT
    assert line.say(poll_frame(7)) == message_frame(COMMAND.reply(b'\x07').encode(), Checksum.CRC)
    assert line.say(poll_frame(9)) == b''
    assert line.machine.deadline is None


def test_multidrop_ack_goes_to_the_station_that_spoke() -> None:
    slaves = [HalfDuplexSlave(LinkSettings(station=number), echo(b'')) for number in (7, 8)]
    line = Line(*slaves)
    for number in (7, 8):
        command = COMMAND._replace(dst=number)
        assert line.say(master_frame(number, command.encode(), Checksum.CRC)) == ACK
    assert line.say(poll_frame(7)) == reply_frame(COMMAND)
    assert line.say(poll_frame(8)) == reply_frame(COMMAND._replace(dst=8))
    assert line.say(ACK) == b''
    assert [slave.counters.acks_received for slave in slaves] == [0, 1]
    assert (line.say(poll_frame(7)), line.say(poll_frame(8))) == (reply_frame(COMMAND), EOT)


def test_multidrop_broadcast_reaches_every_station() -> None:
    benches = [Bench(settings=LinkSettings(station=number)) for number in (7, 8)]
    line = Line(*(bench.slave for bench in benches))
    command = COMMAND._replace(dst=BROADCAST)
    assert line.say(master_frame(BROADCAST, command.encode(), Checksum.CRC)) == b''
    assert [bench.served for bench in benches] == [[command], [command]]


def test_duplicates_are_executed_when_nobody_looks_for_them() -> None:
    bench = Bench(settings=LinkSettings(station=STATION, duplicate_detection=False))
    assert bench.hear(sent(COMMAND), sent(COMMAND)) == [ACK, ACK]
    assert bench.served == [COMMAND, COMMAND]
    assert bench.slave.counters.duplicate_messages == 0


def test_eot_suppression_leaves_messages_as_they_are() -> None:
    bench = Bench(settings=LinkSettings(station=STATION, eot_suppression=True))
    assert bench.hear(POLL, sent(COMMAND), POLL, HEARD_ACK, POLL) == [
        b'', ACK, reply_frame(COMMAND), b'', b'']
    assert bench.slave.counters.eots_sent == 0
    assert bench.slave.counters.polls_received == 3


def test_broadcast_and_reply_need_no_room() -> None:
    bench = Bench(settings=LinkSettings(station=STATION, queue_size=1))
    broadcast = later(1)._replace(dst=BROADCAST)
    assert bench.hear(sent(COMMAND), sent(broadcast, BROADCAST), sent(later(2).reply())) == [
        ACK, b'', ACK]
    assert bench.served == [COMMAND, broadcast]
    assert bench.slave.counters.replies_received == 1


def test_bad_broadcast_is_not_executed() -> None:
    bench = Bench()
    assert bench.hear(sent(COMMAND, BROADCAST, FrameFault.BAD_CHECK)) == [b'']
    assert (bench.served, bench.counts()) == ([], {'crc_errors': 1})


@pytest.mark.parametrize('heard', [
    Frame(later(1).reply().encode()), Frame(COMMAND.reply().encode(), None, FrameFault.BAD_CHECK),
    Frame(COMMAND.reply().encode(), STATION)])
def test_message_of_another_takes_the_ack_away(heard: Frame) -> None:
    bench = Bench()
    bench.hear(sent(COMMAND), POLL, heard)
    assert bench.hear(HEARD_ACK, POLL)[-1] == reply_frame(COMMAND)
    assert bench.slave.counters.acks_received == 0


def test_withdraw_does_not_touch_replies() -> None:
    bench = Bench()
    bench.hear(sent(COMMAND), POLL)
    bench.slave.withdraw()
    assert bench.hear(POLL) == [reply_frame(COMMAND)]
