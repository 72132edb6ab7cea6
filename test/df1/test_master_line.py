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

"""What both kinds of master share beside the rules, which are conversations (vectors/)."""

from dataclasses import replace
import itertools

from abdf1_ros.df1 import frames
from abdf1_ros.df1.frames import Frame, Poll
from abdf1_ros.df1.master_line import MAX_FORWARDS
from abdf1_ros.df1.packet import BROADCAST, Packet
from abdf1_ros.df1.settings import LinkSettings, PollingSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.errors import CommandExpired, CommandTimeout, StationInactive
import pytest
from support.cases import long_unless
from support.multidrop import MasterBench, Slave

MASTER = 5
SETTINGS = LinkSettings(station=MASTER, nak_retries=1, enq_retries=1, timeout=0.1, cmd_timeout=0.5)
BOTH = pytest.mark.parametrize('standard', [False, True], ids=['message', 'standard'])


def bench(standard: bool, *numbers: int, dead: tuple[int, ...] = (),
          settings: LinkSettings = SETTINGS, serves: bool = True, retries: int = 3,
          tx_delay: float = 0.0) -> MasterBench:
    """Return a master of either kind and its stations."""
    polling = PollingSettings(numbers) if standard else None
    return MasterBench(*numbers, settings=settings, polling=polling, dead=dead, retries=retries,
                       serve=Packet.reply if serves else None, tx_delay=tx_delay)


def poll(rig: MasterBench, *numbers: int, times: int = 1) -> None:
    """Let the master poll stations, by commands of its own, so often."""
    for _ in range(times):
        for number in numbers:
            rig.ask(number, run=0.1)


@BOTH
def test_command_for_us_is_dropped_when_there_is_nobody_to_serve_it(standard: bool) -> None:
    rig = bench(standard, 7, serves=False)
    command = rig.message(7, MASTER)
    rig.start()
    poll(rig, 7)
    assert rig[7].heard == []
    assert (2510, 7, MASTER, command.tns) in rig.master.numbers()


def test_message_based_master_gives_up_a_slow_reply_in_silence() -> None:
    rig = bench(False, 7, 8)
    rig[8].delay = 1.0
    command = rig.message(7, 8)
    rig.start()
    rig.ask(7, run=1.2)
    assert 'NAK' not in rig.master.said
    assert rig[7].heard == []
    assert 'command_timeouts' not in rig.master.counts()
    assert rig.master.stations[8].overdue == 1
    rig[8].delay = 0.0
    second = rig.message(7, 8)
    poll(rig, 7)  # the late reply comes now, and is passed on all the same
    assert rig[7].heard == [command.reply(), second.reply()]
    assert rig.master.stations[8].overdue == 0
    assert rig.ask(BROADCAST, run=1.0).seconds == pytest.approx(0.058, abs=0.001)  # with its pause


@BOTH
def test_reply_that_cannot_be_passed_on_is_dropped(standard: bool) -> None:
    rig = bench(standard, 7, 8)
    rig.message(7, 8)
    rig.start()
    rig.ask(7)
    rig.line.run(lambda: bool(rig[8].served), 1.0)
    rig[7].silent = True
    rig.run(1.0)
    assert not rig.master.stations[7].active
    assert 'R8' not in rig.master.said
    poll(rig, 8)
    assert isinstance(rig.master.all[-1].result, Packet)


class CommandsFirst(HalfDuplexSlave):
    """A slave that ``holds_replies`` back for a while."""

    holds_replies = True

    def _next_packet(self) -> Packet | None:
        return self._initiator.next_command() if self.holds_replies else super()._next_packet()


@pytest.mark.parametrize('dst', [8, MASTER])
def test_no_ack_for_a_command_that_cannot_be_kept(dst: int) -> None:
    # Without the NAK, which would make the slave drop what it holds.
    rig = bench(False, 7, 8, settings=replace(SETTINGS, nak_on_command_timeout=False), retries=200)
    for _ in range(MAX_FORWARDS + 1):
        rig.message(7, dst)
    rig[7].delay = 0.0
    slave = rig[7].slave = CommandsFirst(
        LinkSettings(station=7, nak_retries=200), rig[7].serve, initiator=rig[7])
    rig.start()
    task = rig.ask(7, run=0.49)
    assert slave.counters.acks_received == MAX_FORWARDS
    assert slave.counters.nak_retries > 0
    assert task.result is None
    assert 'duplicate_messages' not in rig.master.counts()
    slave.holds_replies = False
    rig.run(0.5)  # the transaction ends, and what waits is passed on
    poll(rig, 7, times=3)
    assert slave.counters.acks_received > MAX_FORWARDS
    rig.run(1.0)
    served = rig.master.served if dst == MASTER else rig[dst].served
    assert len({packet.tns for packet in served}) == MAX_FORWARDS + 1


@BOTH
def test_replies_to_two_nodes_with_one_number_are_no_repetition(standard: bool) -> None:
    rig = bench(standard, 7, 8)
    rig.start()
    first = rig.ask(8, run=0.1)
    command = Packet(8, 7, 0x0F, 0, first.command.tns, b'\x67')
    rig[7].outbox.append(command)
    rig.ask(7, run=0.5)
    assert isinstance(first.result, Packet)
    assert rig[7].heard == [command.reply()]
    assert 'duplicate_messages' not in rig.master.counts()


def test_start_forgets_the_last_message_of_each_station() -> None:
    """A processor counts from 0 after it was without power, and some programs always send 0."""
    rig = bench(True, 7)
    for _ in range(2):
        rig[7].outbox.append(Packet(MASTER, 7, 0x0F, 0, 0, b'first'))
        rig.start()
        rig.run(0.2)
    assert [packet.tns for packet in rig.master.served] == [0, 0]


@BOTH
def test_start_forgets_what_waited_to_be_passed_on(standard: bool) -> None:
    rig = bench(standard, 7, 8)
    rig.message(7, 8)
    rig.start()
    rig.ask(7)
    rig.line.run(lambda: rig[7].slave.counters.acks_received > (not standard), 1.0)
    rig.master.machine.stop(None, rig.clock())
    rig.forget()
    rig.run(1.0)
    rig.master.machine.start(rig.clock())
    rig.line.wake(rig.master.machine)
    rig.run(0.3)
    assert 'C8' not in rig.master.said


@pytest.mark.parametrize('standard, listed', long_unless(
    lambda standard, listed: standard == listed, itertools.product((False, True), repeat=2)))
def test_messages_for_the_dead_do_not_slow_the_living(standard: bool, listed: bool) -> None:
    rig = bench(standard, 7, *[8] * listed, dead=(8,) if listed else ())
    for _ in range(2000):
        rig.message(7, 8)
    rig.start(8)
    while rig.clock() < 20.0:
        rig.ask(7, run=0.05)
    assert 0.02 < len(rig.master.times('P8')) * SETTINGS.timeout / 20.0 <= 1 / 8 + 0.01
    assert len(rig[7].heard) > 200
    assert all(reply.sts == 2 for reply in rig[7].heard)


@BOTH
def test_message_that_a_gateway_does_not_take_says_nothing_about_the_gateway(
        standard: bool) -> None:
    rig = bench(standard, 7, 9)
    rig.master.stations.routes[8] = 7
    rig.master.stations[8].replies = 1
    rig[7].deaf = True
    rig.message(9, 8)
    rig.message(9, 7)
    rig.start()
    poll(rig, 9, times=6)
    assert [(reply.src, reply.sts) for reply in rig[9].heard] == [(8, 2), (7, 2)]
    assert {(event.message.number, event.station) for event in rig.master.events} == {
        (2509, 8), (2515, 7), (2519, 7), (2521, 7), (2523, 9)}
    assert str(rig.ask(8, run=0.5).result) == str(StationInactive(8))
    assert rig.master.said.split().count('C7') == 5  # twice each, then once for the silent station
    assert isinstance(rig.ask(7, run=0.5).result, CommandTimeout)
    rig[7].deaf = False
    assert isinstance(rig.ask(8, cmd=0x06, run=0.5).result, Packet)  # perhaps the gateway's own
    assert not rig.master.stations[8].active
    assert (7, False) not in rig.master.changes
    assert rig.master.stations.probes.died_at > 0.0  # the PLC was not silent before


@BOTH
@pytest.mark.parametrize('is_there', [False, True])
def test_station_that_a_message_names_is_no_station_of_ours(
        standard: bool, is_there: bool) -> None:
    rig = bench(standard, 7)
    if is_there:
        rig.put(8)
    for number in range(8, 255):
        rig.message(7, number)
    rig.start()
    outcomes = {(number, 2) for number in range(9, 255)}
    if not is_there:
        outcomes.add((8, 2))
    elif not standard:  # which never polls a station outside of its lists for the reply
        outcomes.add((8, 0))
    while len(rig[7].heard) < len(outcomes) and rig.clock() < 200.0:
        rig.ask(7, run=0.5)
    assert {(reply.src, reply.sts) for reply in rig[7].heard} == outcomes
    assert [station.number for station in rig.master.stations] == [7]
    assert rig.master.stations.words() == [1 << 7, *[0] * 15]
    assert rig.master.changes == []


@BOTH
def test_reply_is_passed_on_once(standard: bool) -> None:
    rig = bench(standard, 7, 8)
    command = rig.message(7, 8)
    rig.start()
    poll(rig, 7, 8)
    assert rig[7].heard == [command.reply()]
    rig[8].outbox.append(command.reply())
    poll(rig, 7, 8)
    assert rig[7].heard == [command.reply()]
    assert rig.master.counts()['invalid_messages'] == 1


class Endless:
    """The outbox of a slave that has ``limit`` commands out at once, for ever."""

    def __init__(self, slave: Slave, others: tuple[int, ...], limit: int) -> None:
        self._slave = slave
        self._others = itertools.cycle(others)
        self._limit = limit
        self._tns = itertools.count()
        self._open: set[int] = set()

    def __bool__(self) -> bool:
        self._open.difference_update(packet.tns for packet in self._slave.heard)
        return len(self._open) < self._limit

    def popleft(self) -> Packet:
        """Return the next command."""
        tns = next(self._tns)
        self._open.add(tns)
        return Packet(next(self._others), self._slave.number, 0x0F, 0, tns, b'\x67')


@BOTH
@pytest.mark.parametrize('limit', [1, 4])
def test_slaves_that_never_stop_talking_leave_the_master_its_turns(
        standard: bool, limit: int) -> None:
    numbers = (7, 8, 9)
    rig = bench(standard, *numbers)
    for number in numbers:
        others = tuple(other for other in numbers if other != number)
        rig[number].outbox = Endless(rig[number], others, limit)  # type: ignore[assignment]
    rig.start()
    tasks = [rig.ask(number) for _ in range(50) for number in numbers]
    rig.run(15.0)
    ends = [task.ended for task in tasks]
    assert all(isinstance(task.result, Packet) for task in tasks)
    assert max(after - before for before, after in itertools.pairwise(sorted(ends))) < 0.3
    assert rig.master.changes == []
    assert {number for number, *_ in rig.master.numbers()} == {2523}
    assert all(len(rig[number].served) > 50 for number in numbers)


@BOTH
def test_slave_that_repeats_one_message_for_ever_leaves_the_line_to_others(standard: bool) -> None:
    rig = bench(standard, 7, 8)
    rig.start()
    old = frames.message_frame(rig.ask(7, run=0.3).command.reply().encode(), SETTINGS.checksum)
    setattr(rig[7], 'handle', lambda symbol: {Poll: old, Frame: frames.ACK}.get(
        type(symbol), b'') if getattr(symbol, 'station', None) == 7 else b'')
    tasks = [rig.ask(number) for number in (7, 8)]
    rig.run(2.0)
    assert [type(task.result) for task in tasks] == [CommandTimeout, Packet]


@BOTH
@pytest.mark.parametrize('dst', [7, BROADCAST])
def test_command_that_became_too_old_in_its_tx_delay_is_not_sent_and_not_counted(
        standard: bool, dst: int) -> None:
    rig = bench(standard, 7, tx_delay=0.3)
    rig.start(run=2.0)
    task = rig.master.add(Packet(dst, MASTER, 0x0F, 0, 9, b'\x68'))
    task.expires = rig.clock() + 0.1
    rig.line.wake(rig.master.machine)
    rig.run(3.0)
    assert isinstance(task.result, CommandExpired) and not task.result.sent
    assert (task.sent, f'C{dst}' in rig.master.said) == (False, False)
    counters = rig.master.machine.counters
    assert (counters.commands_sent, counters.messages_sent) == (0, 0)


@BOTH
def test_cmd_timeout_begins_when_the_command_goes_out_after_its_tx_delay(standard: bool) -> None:
    rig = bench(standard, 7, settings=replace(SETTINGS, cmd_timeout=1.0), tx_delay=0.5)
    rig[7].delay = 0.6
    rig.start()
    assert isinstance(rig.ask(7, run=6.0).result, Packet)


@pytest.mark.parametrize('retries', [3, 60])
def test_reply_to_another_slave_that_is_damaged_makes_no_station_silent(retries: int) -> None:
    """It may reply to ours all the time."""
    rig = bench(False, 7, 8, retries=retries)
    whole = rig[8].handle

    def damaged(symbol: frames.Symbol) -> bytes:
        data = whole(symbol)
        return data[:-1] + bytes((data[-1] ^ 1,)) if data.startswith(frames.STX) else data

    rig[8].handle = damaged  # type: ignore[method-assign]
    rig.message(7, 8)
    rig.start()
    rig.ask(7, run=2.0)
    assert rig[8].served and rig.master.counts()['enq_limit_exceeded']
    station = rig.master.stations[8]
    assert (station.active, station.overdue) == (True, 0)
