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

"""Slaves that share a line, and what one does beside its rules: these are conversations."""

from functools import partial

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, EOT, master_frame, message_frame, poll_frame
from abdf1_ros.df1.machine import LineTiming, Machine
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave, multidrop
from abdf1_ros.errors import CommandExpired, CommandTimeout, PortLost
import pytest
from support.multidrop import SlaveBench
from support.virtual_line import Wire

US, MASTER, OTHER = 7, 5, 8
SETTINGS = LinkSettings(station=US, nak_retries=2)
FROM_MASTER = Packet(US, MASTER, 0x0F, 0, 0x0102, b'\xA2\x01')


class Line:
    """A machine of several slaves, which reply their number."""

    def __init__(self, *numbers: int) -> None:
        self.slaves = [HalfDuplexSlave(
            LinkSettings(station=number), partial(self.reply, number=number))
            for number in numbers]
        self.machine = Machine(multidrop(self.slaves), checksum=Checksum.CRC)
        self.machine.start(0.0)

    def reply(self, command: Packet, number: int) -> Packet:
        """Return what a slave replies."""
        return command.reply(bytes((number,)))

    def say(self, data: bytes) -> bytes:
        """Put the master's bytes on the line; return what they answer."""
        self.machine.receive_data(data, 1.0)
        return self.machine.data_to_send()

    def send(self, command: Packet) -> bytes:
        """Send a command; return what they answer."""
        return self.say(master_frame(command.dst, command.encode(), Checksum.CRC))

    def frame(self, command: Packet) -> bytes:
        """Return the reply to a command as it stands on the line."""
        return message_frame(self.reply(command, command.dst).encode(), Checksum.CRC)


def test_ack_goes_to_the_station_that_spoke() -> None:
    line, other = Line(7, 8), FROM_MASTER._replace(dst=8)
    assert (line.send(FROM_MASTER), line.send(other)) == (ACK, ACK)
    assert line.say(poll_frame(7)) == line.frame(FROM_MASTER)
    assert line.say(poll_frame(8)) == line.frame(other)
    assert line.say(ACK) == b''
    assert [slave.counters.acks_received for slave in line.slaves] == [1, 1]
    assert (line.say(poll_frame(7)), line.say(poll_frame(8))) == (line.frame(FROM_MASTER), EOT)
    line.slaves[1].reset()  # after a loss of its port it executes the same command again
    assert (line.send(other), line.say(poll_frame(8))) == (ACK, line.frame(other))


def test_withdraw_does_not_touch_replies() -> None:
    line = Line(7)
    line.send(FROM_MASTER)
    line.say(poll_frame(7))
    line.slaves[0].withdraw()
    assert line.say(poll_frame(7)) == line.frame(FROM_MASTER)


def own(tns: int = 1, dst: int = OTHER) -> Packet:
    """Return a command of our own."""
    return Packet(dst, US, 0x0F, 0, tns, b'\x67')


def test_command_that_the_master_did_not_acknowledge_expires() -> None:
    bench = SlaveBench(SETTINGS)
    task = bench.add(own())
    task.expires = bench.now + 2.0
    assert bench.poll() == bench.own(own())
    bench.now += 2.0  # just in time
    assert bench.poll() == bench.own(own())
    bench.now += 0.1
    assert bench.hear(bench.frame(FROM_MASTER)) == ACK  # which does not expire
    assert bench.poll() == bench.own(FROM_MASTER.reply())
    assert isinstance(task.result, CommandExpired) and task.sent


@pytest.mark.parametrize('sent_before', [0, 1, 2])
def test_command_that_is_too_old_when_the_port_is_to_have_it_does_not_leave(
        sent_before: int) -> None:
    bench = SlaveBench(SETTINGS)
    task = bench.add(own())
    task.expires = bench.now + 2.0
    assert [bench.poll() for _ in range(sent_before)] == [bench.own(own())] * sent_before
    bench.machine.receive_data(poll_frame(US), bench.now)
    assert bench.machine.sender.send_before == task.expires
    bench.machine.withdraw(bench.now + 3.0)  # this process was stopped just then
    assert bench.machine.data_to_send() == b''
    assert isinstance(task.result, CommandExpired)
    assert task.sent is bool(sent_before)
    counts = bench.counts()
    assert [counts.get(name, 0) for name in ('messages_sent', 'commands_sent', 'nak_retries')] == [
        sent_before, min(sent_before, 1), max(sent_before - 1, 0)]
    bench.now += 3.0
    assert bench.poll() == EOT
    bench.hear(bench.frame(FROM_MASTER))
    assert bench.poll() == bench.own(FROM_MASTER.reply())


def test_command_whose_reply_has_come_is_not_sent_again() -> None:
    bench = SlaveBench(SETTINGS)
    task = bench.add(own())
    assert bench.poll() == bench.own(own())  # the master takes it, and its ACK gets lost
    assert bench.hear(bench.frame(own().reply(sts=0x02))) == ACK
    assert isinstance(task.result, Packet) and task.result.sts == 0x02
    assert bench.poll() == EOT


def test_poll_or_message_after_which_the_line_has_gone_on_is_not_answered() -> None:
    bench = SlaveBench(SETTINGS)
    for data in (poll_frame(US), bench.frame(FROM_MASTER)):
        for count in (1, 3, 4):
            assert bench.hear(data + bench.frame(FROM_MASTER, OTHER)[:count]) == b''
            bench.machine.start(bench.now)
        for bench.machine.is_behind, is_answered in ((True, False), (False, True)):
            assert (bench.hear(data) != b'') is is_answered


def test_ack_after_an_ignored_symbol_is_not_for_our_message() -> None:
    bench = SlaveBench(SETTINGS)
    bench.hear(bench.frame(FROM_MASTER))
    for pause, data in ((0.0, poll_frame(OTHER)), (30.0, bench.frame(FROM_MASTER, OTHER))):
        assert bench.poll() == bench.own(FROM_MASTER.reply())  # the master does not hear it
        bench.now += pause
        bench.machine.handle_timeout(bench.now)
        bench.hear(*([data + ACK] if not pause else [data, ACK]))
    assert bench.poll() == bench.own(FROM_MASTER.reply())


def test_reply_to_another_node_does_not_make_ours_a_repetition() -> None:
    bench = SlaveBench(SETTINGS)
    task = bench.add(own())
    bench.poll()
    bench.hear(ACK)
    assert bench.hear(bench.frame(own().reply()._replace(dst=9), US)) == ACK
    assert task.result is None
    assert bench.hear(bench.frame(own().reply())) == ACK
    assert task.result == own().reply()
    assert bench.counts().get('duplicate_messages', 0) == 0


def test_command_whose_ack_the_port_does_not_take_is_not_executed_later() -> None:
    def fail(data: bytes) -> None:
        raise PortLost('unplugged')

    bench = SlaveBench(SETTINGS)
    Wire(bench.machine, fail).attach(bench.now)
    with pytest.raises(PortLost) as lost:
        bench.hear(bench.frame(FROM_MASTER))
    bench.machine.stop(lost.value, bench.now)
    bench.machine.start(bench.now)
    assert (bench.poll(), bench.served) == (EOT, [])


def test_command_that_may_have_waited_while_this_process_stood_still_has_to_come_again() -> None:
    bench = SlaveBench(SETTINGS)
    bench.now += 30.0
    bench.machine.handle_timeout(bench.now)
    for dst, station in ((US, US), (BROADCAST, BROADCAST)):
        command = FROM_MASTER._replace(dst=dst)
        heard = poll_frame(US) + bench.frame(command, station)  # the poll is over, too
        assert (bench.hear(heard), bench.served) == (b'', [])
    assert bench.poll() == EOT
    bench.wait(0.5)
    assert (bench.hear(bench.frame(FROM_MASTER)), bench.served) == (ACK, [FROM_MASTER])


def test_command_for_a_node_behind_us_is_refused_and_counted() -> None:
    bench = SlaveBench(SETTINGS)
    astray = FROM_MASTER._replace(dst=OTHER)
    assert bench.hear(bench.frame(astray, US)) == ACK
    assert bench.poll() == bench.own(astray.reply(sts=0x02))
    assert bench.served == []
    assert bench.counts()['invalid_messages'] == 1
    bench = SlaveBench(SETTINGS, station=0)  # DST may have lost its place to another byte
    assert bench.hear(bench.frame(astray)) == b''


def test_broadcast_needs_no_answer_and_so_no_tx_delay() -> None:
    bench = SlaveBench(SETTINGS, timing=LineTiming(tx_delay=0.5))
    assert bench.hear(bench.frame(FROM_MASTER, BROADCAST), poll_frame(US)) == b''
    assert (len(bench.served), said_within(bench, 1.0)) == (1, [(0.5, EOT)])


def test_replies_and_commands_that_end_with_their_ack_take_turns() -> None:
    bench = SlaveBench(SETTINGS)
    first, second = own(1, BROADCAST), own(2, BROADCAST)
    for packet in (first, second):
        bench.add(packet)
    bench.hear(bench.frame(FROM_MASTER))
    assert [(bench.poll(), bench.hear(ACK))[0] for _ in range(3)] == [
        bench.own(packet) for packet in (first, FROM_MASTER.reply(), second)]


def said_within(bench: SlaveBench, seconds: float) -> list[tuple[float, bytes]]:
    """Return what the slave says by itself, each with the time from now."""
    start, end, said = bench.now, bench.now + seconds, []
    while bench.machine.deadline is not None and bench.machine.deadline <= end:
        bench.now = bench.machine.deadline
        bench.machine.handle_timeout(bench.now)
        if data := bench.machine.data_to_send():
            said.append((round(bench.now - start, 6), data))
    bench.now = end
    return said


def test_what_is_overdue_ends_in_time_during_a_long_tx_delay() -> None:
    bench = SlaveBench(SETTINGS, timing=LineTiming(tx_delay=30.0), cmd_timeout=1.0)
    task = bench.add(own())
    bench.poll()
    assert said_within(bench, 30.1) == [(30.0, bench.own(own()))]
    bench.hear(ACK)
    begun = bench.now
    bench.poll()
    assert said_within(bench, 29.0) == []
    assert isinstance(task.result, CommandTimeout)
    assert task.ended is not None and 1.0 <= task.ended - begun <= 1.26
