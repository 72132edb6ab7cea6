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

"""Standard polling beside its rules, which are conversations (vectors/)."""

from collections.abc import Collection
from dataclasses import replace
from itertools import cycle, pairwise
from random import Random
import struct
from typing import Any

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import ACK, EOT, message_frame
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings, PollingSettings
from abdf1_ros.errors import CommandTimeout, PortLost, StationInactive
import hypothesis
from hypothesis import given, strategies
import pytest
from support.multidrop import MasterBench
from support.peers import CommandTask

SETTINGS = LinkSettings(station=5, nak_retries=1, enq_retries=2, timeout=0.1, cmd_timeout=0.5)


# Of a line with three stations: delivery and Cmd_Timeout, then a scan until the next answer, one
# before it, and all tries of every command and poll in them; 0.02 s for the longest frame.
_TRY = 0.1 + 0.02
LONGEST = 2 * _TRY + 0.5 + 2 * (3 * (2 + 3) + 1) * _TRY


def bench(polling: PollingSettings, *, dead: tuple[int, ...] = (),
          settings: LinkSettings = SETTINGS, **options: Any) -> MasterBench:
    """Return a master and the stations of its lists."""
    numbers = sorted({*polling.priority, *polling.normal} - {settings.station})
    return MasterBench(*numbers, settings=settings, polling=polling, dead=dead, **options)


def ended(task: CommandTask) -> bool:
    """Tell whether a command has its end."""
    return task.result is not None


def share_of(rig: MasterBench, names: Collection[str], count: int) -> float:
    """Return the share of the line's time that these frames take until there are so many."""
    log = rig.master.machine.log

    def spans() -> list[tuple[float, float]]:
        return [(when, after) for (when, name), (after, _) in pairwise(log) if name in names]

    # The pause after the last one belongs to it.
    rig.line.run(lambda: len(spans()) > count, 1e9)
    begun, end = spans()[0][0], spans()[count][0]
    return sum(after - when for when, after in spans()[:count]) / (end - begun)


@hypothesis.settings(max_examples=25)
@given(timeout=strategies.integers(0, 360_000), tx_delay=strategies.integers(0, 65_535),
       retries=strategies.integers(0, 10), dead=strategies.integers(1, 253),
       priority=strategies.integers(0, 253), group_size=strategies.integers(0, 254))
def test_inactive_stations_get_an_eighth_at_most_whatever_the_settings(
        timeout: int, tx_delay: int, retries: int, dead: int, priority: int,
        group_size: int) -> None:
    """The ranges of the specification, and 1 to 254 stations of which one is there."""
    numbers = [number for number in range(255) if number != SETTINGS.station][:dead + 1]
    polling = PollingSettings(tuple(numbers[priority:]), tuple(numbers[:priority]), group_size)
    settings = replace(SETTINGS, timeout=timeout / 1000, nak_retries=retries, enq_retries=retries)
    # So slow a line that a run has few polls; an answer takes a tenth of Timeout.
    rig = bench(polling, dead=tuple(numbers[:-1]), settings=settings,
                baud=200 / max(settings.timeout, 0.02), tx_delay=tx_delay / 1000)
    rig.start(*numbers[:-1])
    assert share_of(rig, [f'P{number}' for number in numbers[:-1]], 5) <= 1 / 8


def test_station_that_answers_polls_and_takes_no_command_gets_an_eighth_at_most() -> None:
    rig = bench(PollingSettings((1, 2)))
    rig[1].deaf = True
    rig.start(1)
    while rig.clock() < 8.0:
        rig.ask(1, run=0.05)
    assert share_of(rig, ['C1'], 3 * (SETTINGS.nak_retries + 1)) <= 1 / 8
    rig, answers = bench(PollingSettings((1, 2))), cycle((EOT, b'', b'', b''))
    setattr(rig[1], 'handle', lambda symbol: (
        next(answers) if getattr(symbol, 'station', None) == 1 else b''))
    rig.start(1)
    assert share_of(rig, ['P1'], 12) <= 1 / 8 + 0.01


def test_dead_priority_station_does_not_keep_normal_ones_from_coming_back() -> None:
    rig = bench(PollingSettings((1, 2), priority=(9, 8)), dead=(8,))
    rig.start(1, 2, 8, run=20.0)
    assert {(1, True), (2, True)} <= set(rig.master.changes)
    assert rig.master.times('P8')


class Losses:
    """A line that loses a share of its frames, commands as well as replies and ACKs."""

    def __init__(self, share: float) -> None:
        self._share = share

    def damage(self, data: bytes, random: Random) -> bytes:
        """Return a frame, or nothing."""
        return b'' if random.random() < self._share else data


@pytest.mark.parametrize('share', [0.3, 0.6])
@pytest.mark.parametrize('polling', [PollingSettings((1, 2, 3)), None])
def test_value_is_never_older_than_its_transaction(
        share: float, polling: PollingSettings | None) -> None:
    """The PLC executes the first copy of a command; ACKs, polls and reply may be lost later."""
    rig = MasterBench(1, 2, 3, settings=SETTINGS, polling=polling)
    for slave in rig.slaves.values():
        slave.execute = lambda command: command.reply(struct.pack('<d', rig.clock()))
    rig.line.noise = Losses(share)
    rig.start()
    tasks = {number: rig.ask(number) for number in rig.slaves}
    count = 0
    while rig.clock() < 75.0:
        rig.run(0.05)
        for number, task in tasks.items():
            if isinstance(task.result, Packet):
                count += 1
                assert task.ended is not None
                age = task.ended - struct.unpack('<d', task.result.data)[0]
                assert age <= task.seconds < LONGEST
            if ended(task):
                tasks[number] = rig.ask(number)
    assert count


def test_each_reply_is_not_found_behind_the_one_before_it_for_ever() -> None:
    rig = bench(PollingSettings((1, 2)), settings=replace(SETTINGS, cmd_timeout=0.001))
    rig[1].delay = 0.1  # the first reply comes late, on a line too slow for Cmd_Timeout
    tasks = [rig.ask(1) for _ in range(4)]
    rig.start()
    rig.line.run(lambda: ended(tasks[0]), 2.0)
    assert isinstance(tasks[0].result, CommandTimeout)
    rig[1].delay = 0.0
    rig.run(1.0)
    assert [task.result for task in tasks[1:]] == [task.command.reply() for task in tasks[1:]]
    assert rig.master.counts()['stale_messages'] == 1


def test_nak_is_never_sent_to_a_station_that_never_replies() -> None:
    rig = bench(PollingSettings((1, 2)), settings=replace(SETTINGS, nak_on_command_timeout=True))
    rig[1].delay = 9.0
    rig.start()
    for _ in range(4):
        rig.ask(1)
    rig.run(5.0)
    assert rig.master.counts()['command_timeouts'] == 4
    assert 'naks_sent' not in rig.master.counts()
    station = rig.master.stations[1]
    # The others are polled meanwhile: it is asked on as before, but its silence is told.
    assert station.has_no_replies and station.replies_in_time


def test_last_and_longest_scan_of_each_list_are_known() -> None:
    rig = bench(PollingSettings((1, 2, 3), priority=(9,), group_size=1))
    scans = rig.master.link.status().scans
    priority, normal = scans['priority'], scans['normal']
    rig.start()
    assert (normal.last, priority.last) == (None, None)
    rig.run(1.0)
    assert priority.last == priority.longest == pytest.approx(12 * 10 / 19200)
    assert normal.last == normal.longest == pytest.approx(3 * 12 * 10 / 19200)
    rig.ask(2, run=1.0)
    assert priority.longest is not None and priority.last is not None
    assert priority.longest > 1.5 * priority.last
    assert normal.longest is not None and normal.last is not None
    assert normal.longest > 1.2 * normal.last


def test_longest_scan_does_not_contain_the_time_without_a_port() -> None:
    rig = bench(PollingSettings((1,), priority=(2,)))
    lists = rig.master.link.status().scans.values()
    rig.start(run=1.0)
    rig.master.machine.stop(PortLost('unplugged'), rig.clock())
    rig.run(30.0)
    rig.master.machine.start(rig.clock())
    rig.line.wake(rig.master.machine)
    rig.run(1.0)
    assert [0.0 < (scans.longest or 0.0) < 1.0 for scans in lists] == [True, True]


def test_line_without_a_speed_is_polled_no_faster_than_the_set_one() -> None:
    rig = bench(PollingSettings((1, 2)), baud=19200)
    rig.line.char_time = 0.0  # as TCP: what is written is there
    rig.start(run=1.0)
    assert 0.8 < rig.master.counts()['polls_sent'] * 6 * 10 / 19200 <= 1.01


@pytest.mark.parametrize('is_waited_for', [True, False])
def test_message_that_is_late_for_its_poll_belongs_to_the_station_that_sends_it(
        is_waited_for: bool) -> None:
    rig = bench(PollingSettings((1, 2)), dead=(2,))
    rig[1].delay = 9.0
    task = rig.ask(1)
    rig.start()
    rig.line.run(lambda: 'P2' in rig.master.said, 1.0)
    begun, deadline = rig.clock(), rig.master.machine.deadline
    late = task.command.reply() if is_waited_for else Packet(5, 1, 0x4F, 0, 0x77)
    for packet in (late, late, late._replace(dst=9, tns=0x88)):  # the last is for another node
        heard = message_frame(packet.encode(), Checksum.CRC) + ACK
        rig.master.machine.receive_data(heard, begun + 0.05)
    assert rig.master.stations[1].last_heard == begun + 0.05
    assert rig.master.machine.deadline == deadline  # station 2 gets no longer time
    assert rig.master.stations[2].last_heard is None
    assert rig.master.machine.data_to_send() == b''  # its ACK would be taken for station 2's
    assert ended(task) is is_waited_for
    counts = rig.master.counts()
    assert (counts['messages_received'], counts['replies_received']) == (3, 1)
    assert counts.get('stale_messages', 0) == (not is_waited_for)
    assert 'invalid_messages' not in counts
    if not is_waited_for:
        assert (2510, 1, 5, 0x77) in rig.master.numbers()


def test_command_that_was_late_for_its_poll_is_executed_when_it_comes_again() -> None:
    rig = bench(PollingSettings((1, 2)), dead=(2,))
    rig.start()
    rig.line.run(lambda: 'P2' in rig.master.said, 1.0)
    message = rig.message(1, 5)
    late = message_frame(message.encode(), Checksum.CRC)
    rig.master.machine.receive_data(late, rig.clock() + 0.05)
    assert rig.master.served == []
    rig.run(3.0)
    assert rig.master.served == [message]


def test_late_error_reply_of_a_gateway_does_not_prove_the_station_behind_it() -> None:
    rig = bench(PollingSettings((1, 2)), dead=(2,))
    rig.master.stations.routes[3] = 1
    rig.master.stations.add((3,))
    rig.start(3)
    rig.line.run(lambda: 'P2' in rig.master.said, 1.0)
    late = message_frame(Packet(5, 3, 0x4F, 0x02, 0x77).encode(), Checksum.CRC)
    rig.master.machine.receive_data(late, rig.clock() + 0.05)
    assert rig.master.stations[1].last_heard == rig.clock() + 0.05
    behind = rig.master.stations[3]
    assert (behind.active, behind.has_gateway) == (False, True)


def test_reply_to_a_guest_that_cannot_be_fetched_does_not_make_its_station_inactive() -> None:
    rig = bench(PollingSettings((1, 2)))
    rig.master.stations.routes[3] = 1
    rig[1].delay = 0.1
    tasks = [rig.ask(number) for number in (1, 3)]
    tasks[0].blames = tasks[1].blames = False
    rig.start()
    rig.line.run(lambda: len(rig[1].served) == 2, 1.0)
    rig[1].silent = True
    rig.line.run(lambda: any(map(ended, tasks)), 1.0)
    rig[1].silent = False
    assert [type(task.result) for task in tasks] == 2 * [StationInactive]
    rig.run(1.0)
    assert rig.master.changes == []


def test_nodes_behind_a_gateway_get_one_message_at_a_time() -> None:
    rig = bench(PollingSettings((7, 9)))
    rig.master.stations.routes.update({1: 7, 2: 7})
    rig[7].delay = 0.2
    first, second, other = (rig.message(9, dst) for dst in (1, 1, 2))
    rig.start(run=0.1)
    assert rig[7].served == [first, other]
    rig.run(0.3)  # its reply has come
    assert rig[7].served == [first, other, second]
    rig.run(0.3)
    assert rig[9].heard == [packet.reply() for packet in (first, other, second)]
    rig[7].delay = 9.0
    for number in (1, 2):
        rig.ask(number)
    rig.run(0.7)  # both too late: now it gets one command of ours at a time, too
    tasks = [rig.ask(number) for number in (1, 2, 9, 9)]
    rig.run(0.3)
    assert ([*map(ended, tasks)], rig[7].served[-1].dst) == ([False, False, True, True], 1)


def test_reply_that_was_taken_late_is_acknowledged_when_it_comes_again() -> None:
    rig = bench(PollingSettings((1, 2)), settings=replace(SETTINGS, enq_retries=3))
    setattr(rig.line, 'propagation', 0.06)
    tasks = [rig.ask(1), rig.ask(2)]
    rig.start(run=3.0)
    assert [task.result for task in tasks] == [task.command.reply() for task in tasks]
    assert [rig[number].slave.counters.acks_received for number in (1, 2)] == [2, 2]  # of the line
    assert [len(rig[number].served) for number in (1, 2)] == [1, 1]


@pytest.mark.parametrize('number', [3, 5])
def test_command_to_a_station_that_is_never_polled_ends_by_the_clock(number: int) -> None:
    rig = bench(PollingSettings((1, 2, 5)))
    rig.put(number)  # another with our address, or unlisted
    task = rig.ask(number)
    rig.start()
    rig.line.run(lambda: ended(task), 2.0)
    assert isinstance(task.result, CommandTimeout)
    assert SETTINGS.cmd_timeout <= task.seconds < SETTINGS.cmd_timeout + 0.1
    assert rig.master.numbers() == [(2508,)]


def test_group_is_filled_with_active_stations() -> None:
    rig = bench(PollingSettings((1, 2, 3, 4), (9,), group_size=2), dead=(1, 2))
    rig.start(1, 2, run=4.0)
    polls = [text for text in rig.master.said.split() if text not in ('P1', 'P2')]
    assert polls[:9] == 3 * ['P9', 'P3', 'P4']
    silent = [text for text in rig.master.said.split() if text in ('P1', 'P2')]
    assert silent[:4] == 2 * ['P1', 'P2']
    rig = bench(PollingSettings((1, 2, 5), group_size=1), dead=(2,))
    rig.start(2, run=1.0)
    assert rig[1].polls > 150  # groups of a silent station, or of the master, make no pause
    rig = bench(PollingSettings((1, 5, 2), in_sequence=True))
    for number in (1, 2) * 2:
        rig.ask(number)
    rig.start(run=0.2)
    assert rig.master.said.split()[:8] == 2 * ['P1', 'C1', 'C2', 'P2']


def test_fault_heard_while_probing_is_counted_and_told() -> None:
    rig = bench(PollingSettings((1, 2)), dead=(1,))
    rig.start(1, run=5.0)
    good = message_frame(Packet(5, 1, 0x4F, 0, 7).encode(), Checksum.CRC)
    for heard in (b'\x10\x55\x33', good[:-4], good[:-1] + bytes((good[-1] ^ 1,)),
                  good[:8] + EOT + good):
        assert not rig.master.stations[1].active
        polls = len(rig.master.times('P1'))
        while len(rig.master.times('P1')) == polls:
            rig.run(0.01)
        rig.master.machine.receive_data(heard, rig.clock())
        rig.line.wake(rig.master.machine)
    counts = rig.master.counts()
    names = ('crc_errors', 'invalid_messages', 'stale_messages')
    assert [counts[name] for name in names] == [1, 2, 1]
    assert rig.master.numbers() == [
        (2514, 0x55), (2516, 0x55), (2518,), (2506, 222, 240, 223, 240), (2518,), (2510, 1, 5, 7)]
    assert rig.master.changes == [(1, True)]


def test_command_ends_when_its_station_is_lost_over_a_message_of_another() -> None:
    rig = bench(PollingSettings((1, 2)))
    rig[2].delay = 0.4
    task = rig.ask(2)
    rig.start(run=0.1)
    rig[2].deaf = True  # takes no more commands, and then dies
    rig.message(1, 2)
    rig.line.run(lambda: (2, False) in rig.master.changes, 5.0)
    rig[2].silent = True
    rig.run(1.0)
    assert isinstance(task.result, StationInactive)
    assert [reply.sts for reply in rig[1].heard] == [2]
