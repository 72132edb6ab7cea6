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

"""What a slave does beside the rules, which are conversations (vectors/)."""


from abdf1_ros.df1.frames import ACK, EOT, poll_frame
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.errors import CommandExpired, CommandTimeout
import pytest
from support.multidrop import SlaveBench

US, MASTER, OTHER = 7, 5, 8
SETTINGS = LinkSettings(station=US, nak_retries=2)
FROM_MASTER = Packet(US, MASTER, 0x0F, 0, 0x0102, b'\xA2\x01')


def own(tns: int = 1, dst: int = OTHER) -> Packet:
    """Return a command of our own."""
    return Packet(dst, US, 0x0F, 0, tns, b'\x67')


@pytest.mark.parametrize('sent_before', [0, 1])
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
        sent_before, sent_before, 0]
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


def test_message_that_just_stops_is_counted_once() -> None:
    bench = SlaveBench(SETTINGS)
    assert bench.hear(bench.frame(FROM_MASTER)[:9]) == b''
    bench.wait(60.0)
    assert bench.counts()['invalid_messages'] == 1
    assert bench.hear(bench.frame(FROM_MASTER)) == ACK


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


def test_command_for_a_node_behind_us_is_refused_and_counted() -> None:
    bench = SlaveBench(SETTINGS)
    astray = FROM_MASTER._replace(dst=OTHER)
    assert bench.hear(bench.frame(astray, US)) == ACK
    assert bench.poll() == bench.own(astray.reply(sts=0x02))
    assert bench.served == []
    assert bench.counts()['invalid_messages'] == 1


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
