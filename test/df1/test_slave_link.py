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

"""The slave that is a driver of its own: its commands, its polls, its time limits."""

from dataclasses import replace
from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, EOT, master_frame, message_frame, NAK, poll_frame
from abdf1_ros.df1.machine import LineTiming
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.errors import CommandExpired, CommandTimeout, PortLost, WrongCommandCode
import pytest
from support.multidrop import SlaveBench
from support.peers import CommandTask
from support.virtual_line import Wire

US, MASTER, OTHER = 7, 5, 8
SETTINGS = LinkSettings(station=US, nak_retries=2)
FROM_MASTER = Packet(US, MASTER, 0x0F, 0, 0x0102, b'\xA2\x01')
OTHERS_TRAFFIC = poll_frame(OTHER) + EOT


def own(tns: int = 1, dst: int = OTHER) -> Packet:
    """Return a command of our own."""
    return Packet(dst, US, 0x0F, 0, tns, b'\x67')


def polled(settings: LinkSettings = SETTINGS, **options: Any) -> tuple[SlaveBench, CommandTask]:
    """Return a slave that has sent own(1), and the task."""
    bench = SlaveBench(settings, **options)
    task = bench.add(own())
    assert bench.poll() == bench.own(own())
    return bench, task


def acknowledged(*args: LinkSettings, **options: Any) -> tuple[SlaveBench, CommandTask]:
    """Return a slave whose own(1) has got its ACK, and the task."""
    bench, task = polled(*args, **options)
    assert bench.hear(ACK) == b''
    return bench, task


def test_command_leaves_at_a_poll_and_its_reply_ends_it() -> None:
    bench = SlaveBench(SETTINGS)
    task = bench.add(own())
    bench.wait(1.0)
    assert bench.poll() == bench.own(own())
    assert task.sent and task.result is None
    assert bench.hear(ACK) == b''
    assert bench.poll() == EOT
    assert bench.hear(bench.frame(own().reply(b'\x01'))) == ACK
    assert task.result == own().reply(b'\x01')
    assert bench.numbers() == [(2523, OTHER)]
    assert bench.counts() == {
        'polls_received': 2, 'messages_sent': 1, 'commands_sent': 1, 'acks_received': 1,
        'eots_sent': 1, 'messages_received': 1, 'replies_received': 1, 'acks_sent': 1}
    assert bench.stations[OTHER].replies == 1
    assert bench.stations[OTHER].last_heard == bench.now
    assert bench.events[0].station == OTHER


@pytest.mark.parametrize('tx_delay', [0.0, 0.2])
def test_ack_leaves_before_the_message_is_made_use_of(tx_delay: float) -> None:
    order: list[bytes] = []

    def serve(command: Packet) -> Packet:
        order.append(b'served')
        return command.reply()

    bench = SlaveBench(SETTINGS, serve=serve, timing=LineTiming(tx_delay=tx_delay))
    Wire(bench.machine, order.append).attach(bench.now)
    bench.hear(bench.frame(FROM_MASTER))
    bench.wait(tx_delay)
    assert order == [ACK, b'served']


def test_one_command_is_outstanding() -> None:
    bench = SlaveBench(SETTINGS)
    first, second = bench.add(own(1)), bench.add(own(2))
    assert bench.poll() == bench.own(own(1))
    assert bench.hear(ACK) + bench.poll() == EOT
    assert not second.sent
    bench.hear(bench.frame(own(1).reply()))
    assert first.result == own(1).reply()
    assert bench.poll() == bench.own(own(2))


def test_commands_and_replies_take_turns() -> None:
    bench = SlaveBench(SETTINGS)
    tasks = [bench.add(own(number)) for number in (1, 2)]
    served = [FROM_MASTER._replace(tns=tns) for tns in (0x11, 0x12, 0x13)]
    for command in served:
        assert bench.hear(bench.frame(command)) == ACK
    said = []
    for number in (1, 2):
        said += [bench.poll()]
        bench.hear(ACK)
        said += [bench.poll()]
        bench.hear(ACK, bench.frame(own(number).reply()))
    assert said == [bench.own(own(1)), bench.own(served[0].reply()),
                    bench.own(own(2)), bench.own(served[1].reply())]
    assert all(task.result is not None for task in tasks)
    assert bench.poll() == bench.own(served[2].reply())


def test_held_command_is_sent_again_until_its_limit_and_then_returned_with_an_error() -> None:
    bench = SlaveBench(SETTINGS)
    first, second = bench.add(own(1)), bench.add(own(2))
    assert [bench.poll() for _ in range(3)] == [bench.own(own(1))] * 3
    assert first.result is None
    assert bench.poll() == bench.own(own(2))
    assert str(first.result) == '2519 NTC_NAK_LIMIT_EXCEEDED: NAK Retry Limit (2) exceeded'
    assert second.result is None
    assert bench.numbers() == [(2519, 2)]
    assert bench.counts() == {
        'polls_received': 4, 'messages_sent': 4, 'commands_sent': 2, 'nak_retries': 2,
        'nak_limit_exceeded': 1}


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


def test_nak_fails_the_command_that_is_held() -> None:
    bench = SlaveBench(SETTINGS)
    first, second = bench.add(own(1)), bench.add(own(2))
    bench.hear(bench.frame(FROM_MASTER))
    bench.poll()
    assert bench.hear(NAK) == b''
    assert str(first.result) == '2511 ERR_RCVD_NAK_SYMBOL: Received NAK Symbol'
    assert bench.numbers() == [(2517,)]
    assert bench.poll() == bench.own(own(2))  # the reply is gone with the reset
    assert second.result is None
    counts = bench.counts()
    assert counts['naks_received'] == 1
    assert not {'command_timeouts', 'nak_limit_exceeded'} & counts.keys()


@pytest.mark.parametrize(('sts', 'heard'), [(0x00, True), (0x10, True), (0x12, True),
                                            (0x02, False)])
def test_error_of_a_node_on_the_way_is_no_answer_of_the_station(sts: int, heard: bool) -> None:
    bench = SlaveBench(SETTINGS)
    bench.add(own())
    bench.stations.lost(OTHER, 0.0)
    bench.poll()
    bench.hear(ACK, bench.frame(own().reply(sts=sts)))
    assert bench.stations[OTHER].active is heard


def test_what_is_wrong_with_messages_for_us_is_told_by_number() -> None:
    bench = SlaveBench(SETTINGS)
    frame = bench.frame(FROM_MASTER)
    damaged = frame[:-1] + bytes((frame[-1] ^ 1,))
    bench.hear(damaged, frame, frame, b'\x10\x07', b'\x10\x03')
    assert [number for number, *_ in bench.numbers()] == [2506, 2524, 2514]


@pytest.mark.parametrize('traffic', [poll_frame(OTHER), EOT, message_frame(
    FROM_MASTER.reply().encode(), Checksum.CRC), poll_frame(US)[:-1] + b'\x01'])
def test_ack_after_any_other_traffic_is_another_stations(traffic: bytes) -> None:
    bench, task = polled()
    bench.hear(traffic, ACK)
    assert bench.poll() == bench.own(own())
    assert bench.counts()['nak_retries'] == 1
    assert task.result is None


def test_our_own_voice_on_a_two_wire_adapter_is_no_other_traffic() -> None:
    bench = SlaveBench(SETTINGS)
    task = bench.add(own())
    said = bench.poll()
    assert bench.hear(said) == b''
    bench.hear(ACK)
    assert bench.poll() == EOT
    assert bench.hear(EOT) == b''
    assert bench.hear(bench.frame(own().reply())) == ACK
    assert bench.hear(ACK) == b''  # that was us, too
    assert task.result == own().reply()
    assert bench.counts()['acks_received'] == 1


def test_reply_with_a_wrong_command_code() -> None:
    bench, task = acknowledged()
    assert bench.hear(bench.frame(own().reply()._replace(cmd=0x46))) == ACK
    assert isinstance(task.result, WrongCommandCode)
    assert task.result.args == (OTHER, 0x46, 0x4F)
    assert bench.numbers() == [(2505, OTHER, 0x46, 0x4F)]
    assert bench.counts()['invalid_messages'] == 1


@pytest.mark.parametrize(('reply', 'counter'), [
    (own(2).reply(), 'stale_messages'),
    (own().reply()._replace(src=9), 'invalid_messages'),  # S0, counter 2550
    (own().reply()._replace(dst=9), 'invalid_messages')])
def test_reply_that_fits_nothing_is_dropped(reply: Packet, counter: str) -> None:
    bench, task = acknowledged()
    bench.stations.add((OTHER,))
    assert bench.hear(bench.frame(reply)) == ACK
    assert task.result is None
    assert bench.numbers() == [(2510, reply.src, reply.dst, reply.tns)]
    assert bench.counts()[counter] == 1


def test_reply_is_taken_by_a_sink_that_is_full_of_others() -> None:
    bench, task = acknowledged(replace(SETTINGS, queue_size=1))
    assert bench.hear(bench.frame(FROM_MASTER)) == ACK
    assert bench.hear(bench.frame(FROM_MASTER._replace(tns=9))) == b''
    assert bench.hear(bench.frame(own().reply())) == ACK
    assert task.result == own().reply()


@pytest.mark.parametrize('busy', [False, True])
def test_command_timeout_runs_from_the_masters_ack(busy: bool) -> None:
    bench = SlaveBench(SETTINGS, cmd_timeout=1.0)
    task = bench.add(own())
    bench.wait(3.0)
    for _ in range(2):  # it is still held, and waits for its ACK as long as the master polls
        bench.poll()
        bench.wait(0.7)
    assert task.result is None
    bench.poll()
    bench.hear(ACK)
    begun = bench.now
    if busy:
        bench.listen(2.0, OTHERS_TRAFFIC, 0.01)
    else:
        bench.wait(2.0)
    assert isinstance(task.result, CommandTimeout)
    assert task.ended is not None
    assert 1.0 <= task.ended - begun <= 1.26
    assert bench.numbers() == [(2508,)]
    assert bench.counts()['command_timeouts'] == 1


def test_command_without_ack_is_not_kept_for_a_master_that_is_gone() -> None:
    bench, task = polled(cmd_timeout=1.0)
    bench.wait(1.3)
    assert isinstance(task.result, CommandTimeout)
    assert bench.numbers() == [(2508,)]
    assert EOT in bench.poll()


@pytest.mark.parametrize('busy', [False, True])
def test_poll_timeout_fails_what_waits(busy: bool) -> None:
    bench = SlaveBench(SETTINGS, poll_timeout=2.0)
    bench.wait(1.0)
    assert bench.poll() == EOT
    tasks = [bench.add(own(number)) for number in range(3)]
    polled = bench.now
    if busy:
        bench.listen(1.9, OTHERS_TRAFFIC, 0.01)
    else:
        bench.wait(1.9)
    assert [task.result for task in tasks] == [None] * 3
    if busy:
        bench.listen(0.5, OTHERS_TRAFFIC, 0.01)
    else:
        bench.wait(0.5)
    for task in tasks:
        assert isinstance(task.result, CommandTimeout)
        assert not task.sent
        assert task.ended is not None and 2.0 <= task.ended - polled <= 2.26
    assert bench.poll() == EOT


def test_poll_timeout_zero_is_never() -> None:
    bench = SlaveBench(SETTINGS, poll_timeout=0.0)
    task = bench.add(own())
    bench.wait(10_000.0)
    assert task.result is None
    assert bench.poll() == bench.own(own())


def test_held_command_is_not_sent_any_more_after_the_poll_timeout() -> None:
    bench, task = polled(poll_timeout=2.0)
    bench.wait(3.0)
    assert isinstance(task.result, CommandTimeout)
    assert task.sent
    assert bench.poll() == EOT


def test_poll_timeout_fails_a_command_that_waits_for_its_reply() -> None:
    bench, task = acknowledged(poll_timeout=2.0, cmd_timeout=100.0)
    bench.wait(3.0)
    assert isinstance(task.result, CommandTimeout)


@pytest.mark.parametrize('busy', [False, True])
def test_waiting_commands_expire_although_we_are_never_polled(busy: bool) -> None:
    bench = SlaveBench(SETTINGS, poll_timeout=60.0, patience=1.0)
    task = bench.add(own())
    if busy:
        bench.listen(1.5, OTHERS_TRAFFIC, 0.01)
    else:
        bench.wait(1.5)
    assert isinstance(task.result, CommandTimeout)
    assert not task.sent


def test_broadcast_of_ours_is_done_when_the_master_has_it() -> None:
    bench = SlaveBench(SETTINGS)
    command = own(dst=BROADCAST)
    task, later = bench.add(command), bench.add(own(2))
    assert bench.poll() == bench.own(command)
    assert task.result is None
    bench.hear(ACK)
    assert task.result == command.reply()
    # The master sends it to all, and we are one of them.
    assert bench.hear(bench.frame(command, BROADCAST)) == b''
    assert bench.served == [command]
    assert bench.poll() == bench.own(own(2))
    assert later.result is None


def test_start_is_a_clean_one() -> None:
    bench = SlaveBench(SETTINGS, cmd_timeout=1.0)
    task = bench.add(own(1))
    bench.hear(bench.frame(FROM_MASTER))
    bench.poll()
    bench.machine.stop(PortLost('unplugged'))
    bench.wait(5.0)
    bench.machine.start(bench.now)
    assert task.result is None  # whoever has the tasks ends them
    later = bench.add(own(2))
    assert bench.poll() == bench.own(own(2))
    assert bench.hear(ACK, bench.frame(own(2).reply())) == ACK
    assert later.result == own(2).reply()


def test_tx_delay_passes_before_each_answer() -> None:
    bench = SlaveBench(SETTINGS, timing=LineTiming(tx_delay=0.02))
    assert bench.hear(poll_frame(US)) == b''
    assert bench.machine.deadline == pytest.approx(bench.now + 0.02)
    bench.now += 0.02
    bench.machine.handle_timeout(bench.now)
    assert bench.machine.data_to_send() == EOT
    bench.now += 0.01
    assert bench.hear(bench.frame(FROM_MASTER)) == b''
    bench.now += 0.02
    bench.machine.handle_timeout(bench.now)
    assert bench.machine.data_to_send() == ACK


SLOW = LineTiming(tx_delay=0.2)


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


@pytest.mark.parametrize('later', [poll_frame(OTHER), master_frame(
    OTHER, FROM_MASTER.encode(), Checksum.CRC), NAK, EOT])
def test_poll_that_has_expired_during_tx_delay_is_not_answered(later: bytes) -> None:
    """The master has turned to another station, which is to speak now (M 3-13)."""
    bench = SlaveBench(SETTINGS, timing=SLOW)
    bench.poll()
    assert said_within(bench, 0.15) == []
    bench.hear(later)
    assert said_within(bench, 5.0) == []
    assert 'polls_received' not in bench.counts()
    bench.poll()
    assert said_within(bench, 5.0) == [(0.2, EOT)]


def test_only_the_last_of_repeated_polls_is_answered() -> None:
    bench = SlaveBench(SETTINGS, timing=SLOW)
    bench.add(own())
    for _ in range(5):
        bench.poll()
        assert said_within(bench, 0.1) == []
    assert said_within(bench, 1.0) == [(0.1, bench.own(own()))]
    assert 'nak_retries' not in bench.counts()  # what was not sent is no try


def test_command_that_has_expired_during_tx_delay_is_executed_when_it_comes_again() -> None:
    bench = SlaveBench(SETTINGS, timing=SLOW)
    bench.hear(bench.frame(FROM_MASTER))
    assert said_within(bench, 0.1) == []
    bench.hear(bench.frame(FROM_MASTER))
    assert bench.served == []
    assert said_within(bench, 1.0) == [(0.2, ACK)]
    assert bench.served == [FROM_MASTER]
    assert 'duplicate_messages' not in bench.counts()


def test_broadcast_is_executed_whatever_follows_it() -> None:
    bench = SlaveBench(SETTINGS, timing=SLOW)
    command = FROM_MASTER._replace(dst=BROADCAST)
    bench.hear(bench.frame(command, BROADCAST) + poll_frame(US))
    assert bench.served == [command]
    assert said_within(bench, 1.0) == [(0.2, EOT)]


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


def test_suppressed_eot_leaves_a_poll_without_an_answer() -> None:
    bench, task = polled(replace(SETTINGS, eot_suppression=True))
    bench.hear(ACK)
    assert bench.poll() == b''
    assert task.result is None
    assert bench.counts()['polls_received'] == 2
    assert 'eots_sent' not in bench.counts()
