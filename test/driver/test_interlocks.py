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

"""
Heartbeats, fallback values and guarded reads on a virtual line.

The numbers in the names are those of the rules in docs/heartbeats.md.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
import gc
import math
from random import Random

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.driver.guests import Guest, GuestCommand, ShareAccess
from abdf1_ros.driver.interlocks.fallback import FallbackCause, FallbackRow, FallbackState
from abdf1_ros.driver.interlocks.heartbeat import (
    _OtherWriter,
    BeatState,
    HeartbeatRow,
    LARGEST,
)
from abdf1_ros.driver.reads.guards import CounterGuard, RunGuard
from abdf1_ros.driver.reads.point import Freshness, ReadPoint
from abdf1_ros.driver.record import Claim, WriteRecord
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity, Mode
from abdf1_ros.plan.bounds import MODE_PERIOD
from abdf1_ros.settings.heartbeats import Fallback, Heartbeat, PublishWhile
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network, POLLING_MODES
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import pytest
from support.driver_bench import DriverBench, store
from support.mappings import make_mapping

AFTER = 0.5
FALLBACK = Fallback((7,), int(AFTER * 1000))
START, TIMEOUT, RETURN, RUN, END = (
    f'fallback value written: {cause}' for cause in ('start', 'timeout', 'return', 'run', 'end'))


def beat_row(period: int = 200, requires: Sequence[str] = (), timeout: int | None = None,
             address: str = 'N10:0') -> Mapping:
    """Return a Heartbeat row."""
    return make_mapping(address, 'Heartbeat', tag='beat', period=period,
                        heartbeat=Heartbeat(tuple(requires), timeout))


def speed_row(fallback: Fallback | None = FALLBACK, address: str = 'N7:0', tag: str = 'speed',
              length: int = 1) -> Mapping:
    """Return a Write row with Fallback."""
    return make_mapping(address, 'Write', tag=tag, fallback=fallback, length=length)


class Cell:
    """A driver, a PLC whose writes are kept, and a ROS executor that can stand still."""

    def __init__(self, *rows: Mapping, polling: str = 'Message', start: bool = True,
                 run: float = 0.0, **settings: object) -> None:
        self.bench = DriverBench(rows, network=Network(
            # Polled without a pause, a slow line shows the same with fewer polls.
            baud=115200 if polling == 'Message' else 19200, timeout=200, cmd_timeout=500,
            nak_retries=1, enq_retries=1, polling=polling),
            settings=DriverSettings(**settings), start=False)  # type: ignore
        self.plc = self.bench.plc(1, 'PLC5', ('N7:0', 200), ('N10:0', 20), ('N11:0', 20),
                                  ('B3:0', 4))
        self.plc.slave = HalfDuplexSlave(LinkSettings(station=1), self._serve)
        self.refused: set[str] = set()
        self.refusals = 0
        self.spared: int | None = None  # this value is taken all the same
        self.is_late = False  # commands are carried out, and no reply comes in time
        self.is_undelivered: Callable[[Packet], bool] = lambda command: False  # by a gateway
        self.writes: list[tuple[float, str, int]] = []
        self.bench.breathe()
        if start:
            self.bench.open()
            self.run(run)

    @property
    def now(self) -> float:
        """Return the clock."""
        return self.bench.clock()

    def put_behind_gateway(self) -> None:
        """Let station 7 answer for the PLC, and open the port."""
        self.plc.slave, self.plc.station = HalfDuplexSlave(LinkSettings(station=7), self._serve), 7
        self.bench.open()

    def _serve(self, command: Packet) -> Packet:
        if self.is_undelivered(command):
            return command.reply(sts=0x02)
        before = self._words()
        is_spared = int.from_bytes(command.data[-2:], 'little') == self.spared
        if command.cmd == 0x0F and command.data[0] == 0x67 and not is_spared \
                and self.refused & self._named(command):
            self.refusals += 1
            return command.reply(sts=0x10)
        reply = self.plc.serve(command)
        if self.is_late:  # nobody waits for this one
            reply = reply._replace(tns=reply.tns ^ 0x8000)
        after = self._words()
        if command.cmd == 0x0F and command.data[0] == 0x67:
            for name in self._named(command):
                self.writes.append((self.now, name, after[name]))
        elif before != after:
            for name in after:
                if before[name] != after[name]:
                    self.writes.append((self.now, name, after[name]))
        return reply

    def _named(self, command: Packet) -> set[str]:
        """Return the word that a typed write goes to."""
        files = {7: 'N7:0', 10: 'N10:0'}
        return {files[number] for number in files if bytes((6, number)) in command.data[:9]
                or bytes((7, 0, number)) in command.data[:10]}

    def _words(self) -> dict[str, int]:
        return {name: self.word(name) for name in ('N7:0', 'N10:0')}

    def word(self, text: str) -> int:
        """Return a word of the PLC."""
        return int.from_bytes(
            self.plc.table.read(parse_address(text, self.plc.table.plc_type), 1), 'little')

    def written(self, text: str, since: float = 0.0) -> list[int]:
        """Return what was written to a word."""
        return [value for when, name, value in self.writes if name == text and when >= since]

    def results(self) -> list[str]:
        """Return the results of writes."""
        return [str(result) for result in self.bench.listener.results]

    def run(self, seconds: float) -> None:
        """Let time pass."""
        self.bench.run(seconds)

    def publish(self, row: Mapping, value: int, times: int = 1, gap: float = 0.1,
                run: float = 0.0) -> None:
        """Publish a value, so many times, while so many seconds pass."""
        for number in range(times):
            self.bench.at(self.now + number * gap, lambda: self.bench.write(row, [value]))
        if run:
            self.run(run)


def hold(cell: Cell, seconds: float, is_meant: Callable[[Packet], bool]) -> None:
    """Let a gateway say that a command was not delivered, and deliver it later."""
    serve = cell.plc.serve

    def keep(command: Packet) -> Packet:
        if not is_meant(command):
            return serve(command)
        cell.bench.at(cell.now + seconds, lambda: serve(command))
        return command.reply(sts=0x02)

    cell.plc.serve = keep  # type: ignore[method-assign]


class OneRow:
    """A row with Fallback by itself, and writes of it that end as they are told."""

    now = late = 0.0

    def __init__(self, cmd_timeout: float = 0.5) -> None:
        self.mapping = speed_row()
        self.record = WriteRecord(self, 2 * cmd_timeout)
        self.row = FallbackRow(self.record.words_of(self.mapping))

    def took(self, begun: float, now: float) -> float:
        """Return the time between two clock values."""
        return now - begun

    def message(self, begun: float, done: float, outcome: Outcome) -> None:
        """Let a message end that was published when it began."""
        self._write(Write(self.mapping, [3], begun), done, outcome)
        self.row.message_ended(begun, outcome)

    def fallback(self, write: Write, done: float, outcome: Outcome = Outcome.WRITTEN
                 ) -> float | None:
        """Let a write of the fallback end."""
        write.is_own = True
        self._write(write, done, outcome)
        return self.row.ended(outcome, done)

    def _write(self, write: Write, done: float, outcome: Outcome) -> None:
        self.now = write.requested
        claim = self.record.begin(1, [self.mapping.extent], write)
        self.now = done
        self.record.ended(claim, outcome,
                          may_land=outcome in (Outcome.UNKNOWN, Outcome.PARTLY))


def speed_cell() -> tuple[Cell, Mapping]:
    """Return a cell with one Write row, whose first fallback has been written, and the row."""
    speed = speed_row()
    return Cell(speed, run=1.0), speed


@pytest.mark.parametrize('polling', POLLING_MODES)
def test_rule_2_first_contact_is_0_then_the_fallbacks_then_1(polling: str) -> None:
    cell = Cell(beat_row(), speed_row(), polling=polling)
    store(cell.plc, 'N10:0', [123])
    cell.run(1.0)
    assert [(name, value) for _, name, value in cell.writes][:4] == [
        ('N10:0', 0), ('N7:0', 7), ('N10:0', 1), ('N10:0', 2)]
    assert cell.results() == [START]


def test_rule_1_nothing_is_kept_of_beats_that_have_been_written() -> None:
    cell = Cell(beat_row(), speed_row(), run=2.0)
    plc, = cell.bench.driver.interlocks._plcs.values()
    before = len(gc.get_referrers(plc))
    cell.run(20.0)
    assert len(gc.get_referrers(plc)) <= before


def test_rule_1_counts_to_32767_and_begins_again_with_1() -> None:
    cell = Cell(beat_row(), run=0.5)
    beat = cell.bench.driver.interlocks.heartbeats[0]
    beat.value = LARGEST - 1
    store(cell.plc, 'N10:0', [beat.value])
    since = cell.now
    cell.run(0.7)
    assert cell.written('N10:0', since)[:3] == [LARGEST, 1, 2]


@pytest.mark.parametrize('period', [200, 700])
def test_rule_2_the_0_of_a_first_contact_stands_for_a_period_and_half_a_second(
        period: int) -> None:
    cell = Cell(beat_row(period), run=2.0)
    zero, one = [when for when, _, value in cell.writes if value in (0, 1)]
    assert max(period / 1000, 0.5) < one - zero < max(period / 1000, 0.5) + 0.05
    assert cell.bench.driver.interlocks.heartbeats[0].why_not(cell.now) == ''


def test_rule_3a_value_that_is_not_confirmed_is_repeated() -> None:
    cell = Cell(beat_row(), run=1.05)
    cell.refused = {'N10:0'}
    cell.run(1.0)
    last = cell.written('N10:0')[-1]
    beat, = cell.bench.driver.interlocks.heartbeats
    assert beat.why_not(cell.now).startswith('not confirmed for 1.1 s: STS 10: ')
    cell.refused = set()
    since = cell.now
    cell.run(0.5)
    assert cell.written('N10:0', since)[0] == last + 1
    assert beat.value > last + 1


def test_rule_3b_no_beat_while_a_fallback_is_not_confirmed() -> None:
    speed = speed_row()
    elsewhere = make_mapping('N7:0', 'Write', station=2, fallback=FALLBACK)  # it never answers
    cell = Cell(beat_row(), speed, elsewhere, run=1.0)
    cell.publish(speed, 3, run=0.2)
    cell.refused = {'N7:0'}
    cell.run(AFTER)
    since = cell.now
    cell.run(2.0)
    assert cell.word('N10:0') == 0
    assert cell.written('N10:0', since) == []
    assert cell.refusals in (2, 3)  # it is tried again once a second
    cell.refused = set()
    cell.run(2.0)
    assert cell.word('N7:0') == 7
    assert cell.word('N10:0') > 1
    assert cell.bench.driver.interlocks.unconfirmed()[1:] == [elsewhere.tag]


@pytest.mark.parametrize('polling', POLLING_MODES)
def test_rule_3c_hung_executor_stops_the_beat_where_it_is(polling: str) -> None:
    cell = Cell(beat_row(), polling=polling, run=2.0)
    cell.bench.is_alive = False
    cell.run(1.2)
    last, count = cell.word('N10:0'), len(cell.writes)
    cell.run(5.0)
    assert last > 1
    assert (cell.word('N10:0'), len(cell.writes)) == (last, count)
    assert cell.bench.driver.interlocks.heartbeats[0].reason == \
        'the executor of the node stands still'
    cell.bench.is_alive = True
    cell.run(1.0)
    assert cell.word('N10:0') > last


@pytest.mark.parametrize('polling', POLLING_MODES)
def test_rule_3d_required_topic_that_falls_silent_is_0_at_once(polling: str) -> None:
    speed = speed_row(None)
    cell = Cell(beat_row(period=1000, requires=['speed'], timeout=300), speed, polling=polling)
    cell.run(1.0)
    assert cell.written('N10:0') == [0]
    cell.publish(speed, 5, times=40, run=4.0)
    assert cell.word('N10:0') >= 3
    begun = cell.now
    cell.run(1.0)
    assert cell.word('N10:0') == 0
    zero = next(when for when, name, value in cell.writes if when >= begun - 0.1 and not value
                and name == 'N10:0')
    assert zero < begun + 0.3 + 0.05


def test_rule_3_beat_is_not_sent_when_it_may_be_wrong_by_then() -> None:
    speed = speed_row(Fallback((7,), 3000))
    cell = Cell(beat_row(2000, requires=['speed'], timeout=5000), speed)
    cell.publish(speed, 3, times=100, run=5.0)
    interlocks, now = cell.bench.driver.interlocks, cell.now
    beat = interlocks.heartbeats[0]

    def expires(executor: float, message: float) -> float:
        """Return until when a beat may be sent that is due now."""
        interlocks.executor_ran(executor)
        interlocks._conditions.messages['speed'] = message
        beat._next = now
        interlocks._plcs[1].look_again(beat)
        own = interlocks.next(now)
        assert own is not None
        assert own.row is beat
        own.result = own.write.result(Outcome.NOT_SENT, '', now)
        own.ended(None)
        return own.expires

    assert expires(now - 0.5, now) == now + 1.5  # of the executor
    assert expires(now, now - 4.0) == now + 1.0  # of the topic
    assert expires(now + 9.0, now + 9.0) == now + 3.0  # of the fallback: a message waits


@pytest.mark.parametrize(('period', 'lost'), [(100, 0.0), (100, 0.35), (200, 0.2), (500, 0.2)])
def test_rule_3d_the_0_stands_for_half_a_second(period: int, lost: float) -> None:
    speed = speed_row(None)
    cell = Cell(beat_row(period, requires=(speed.topic,), timeout=600), speed)
    cell.publish(speed, 3, times=20, run=1.95)
    beat, = cell.bench.driver.interlocks.heartbeats
    cell.bench.run_until(lambda: beat.state is BeatState.HELD)
    hear, since = cell.bench.far.hear, cell.now
    cell.bench.far.hear = lambda data: hear(data) if cell.now >= since + lost else b''
    why: list[str] = []
    cell.bench.at(since + lost + 0.4, lambda: why.append(beat.why_not(cell.now)))
    cell.publish(speed, 3, times=30, run=2.5)  # the topic is back at once
    assert why == ['0 stands, for the PLC to see it']
    first = next(when for when, _, value in cell.writes if when >= since and value == 0)
    after = next(when for when, name, value in cell.writes
                 if when > first and name == 'N10:0' and value)
    assert after >= first + 0.5
    assert cell.word('N10:0') > 2


def test_rule_3d_lapse_that_nobody_saw_is_0_as_well() -> None:
    """Another station's 0 has the line until the topic is back."""
    speed = speed_row(None)
    beats = [make_mapping('N10:0', 'Heartbeat', station=number, tag=f'beat{number}', period=1000,
                          heartbeat=Heartbeat((speed.topic,), 1000)) for number in (1, 2)]
    line = Line([speed, *beats], (1, 2))
    for number in range(40):
        line.at(0.1 * number, lambda: line.write(speed, [3]))
    line.run(4.88)
    first, second = line.driver.interlocks.heartbeats
    line._stations[0].faults.silent = True
    before = second.value
    for number in range(12, 30):
        line.at(line.clock() + 0.01 * number, lambda: line.write(speed, [3]))
    line.run(0.5)
    assert before > 0
    assert second.value == 0


def late_cell(timeout: int) -> tuple[Cell, Mapping]:
    """Return a cell beside a PLC that answers, and the topic without which there is no beat."""
    speed = speed_row(None)
    cell = Cell(beat_row(requires=(speed.topic,), timeout=timeout), speed,
                make_mapping('N7:9', period=200), make_mapping('N7:9', station=2, period=20_000),
                start=False)
    cell.bench.plc(2, 'PLC5', ('N7:0', 20))
    cell.bench.open()
    return cell, speed


def test_rule_3d_0_of_a_late_plc_is_sent_at_once() -> None:
    cell, speed = late_cell(4000)
    cell.publish(speed, 3, times=30, run=3.0)
    cell.is_late = True
    cell.run(3.8)
    assert cell.word('N10:0') > 0
    cell.run(0.2)
    assert cell.word('N10:0') == 0


def test_rule_3d_topic_that_comes_wakes_nobody_while_a_late_plc_has_to_wait() -> None:
    cell, speed = late_cell(2000)
    cell.run(2.0)
    cell.is_late = True
    stations, driver = cell.bench.driver.stations, cell.bench.driver
    cell.bench.run_until(lambda: stations.next_message(1) > cell.now + 0.5)
    cell.publish(speed, 3, run=0.1)
    assert driver.interlocks.heartbeats[0].state is BeatState.COUNTS
    assert driver.next_task(cell.now) is None
    assert (driver.next_due() or math.inf) > cell.now


@pytest.mark.parametrize('is_end', [True, False])
def test_rules_3_and_5_a_0_that_is_refused_is_written_again_before_a_long_period_is_over(
        is_end: bool) -> None:
    speed = speed_row(None)
    cell = Cell(beat_row(5000, requires=(speed.topic,), timeout=2000), speed)
    cell.publish(speed, 3, times=100, run=11.5 if is_end else 11.85)
    assert cell.word('N10:0') > 0
    cell.refused = {'N10:0'}
    cell.bench.at(cell.now + 0.3, cell.refused.clear)
    if is_end:
        end(cell)
    cell.run(1.3)
    assert cell.refusals == 1
    assert cell.word('N10:0') == 0


def test_rule_3d_message_that_a_fallback_has_overruled_does_not_count() -> None:
    speed = speed_row()
    cell = Cell(beat_row(requires=['speed'], timeout=5000), speed, run=2.0)
    assert set(cell.written('N10:0')) == {0}
    row = cell.bench.driver.interlocks.fallbacks[0]
    row.sent = cell.now
    cell.bench.driver.write([speed], [3], cell.now - 0.1)
    cell.bench.line.wake(cell.bench.driver.machine)
    cell.run(1.0)
    assert cell.results()[-1] == 'not written: not sent: fallback'
    assert set(cell.written('N10:0')) == {0}


def test_rule_4_inactive_station_is_not_probed_with_heartbeats() -> None:
    cell = Cell(beat_row(), run=1.0)
    cell.plc.faults.silent = True
    cell.run(5.0)
    sent = cell.bench.driver.counters.commands_sent
    cell.run(30.0)
    assert cell.bench.driver.counters.commands_sent == sent


def test_rule_5_orderly_end_is_0_then_the_fallbacks() -> None:
    speed = speed_row()
    cell = Cell(beat_row(), speed)
    cell.publish(speed, 3, times=20, run=1.95)
    since = cell.now
    driver = cell.bench.driver
    assert not driver.interlocks.is_over
    driver.interlocks.wind_down()
    cell.bench.line.wake(driver.machine)
    cell.bench.write(speed, [4])
    cell.run(0.3)
    assert [(name, value) for when, name, value in cell.writes if when >= since] == [
        ('N10:0', 0), ('N7:0', 7)]
    assert driver.interlocks.is_over
    assert driver.interlocks.unconfirmed() == []
    assert cell.results()[-2:] == ['not written: refused: this node ends', END]


def end(cell: Cell, seconds: float = 2.0) -> None:
    """End in order: within so many seconds all has to be confirmed, and then the port closes."""
    driver = cell.bench.driver
    driver.interlocks.wind_down()
    cell.bench.line.wake(driver.machine)
    give_up = cell.now + seconds
    while not driver.interlocks.is_over:
        assert cell.now < give_up
        cell.run(0.005)
    cell.bench.lose_port()
    cell.run(2.0)


@pytest.mark.parametrize('moment', [
    'waits', 'on the line', 'executed', 'after a fallback under way', 'after a refresh under way'])
def test_rule_5_message_does_not_outlive_the_end(moment: str) -> None:
    speed = speed_row()
    cell = Cell(beat_row(), speed, run=1.95)
    driver = cell.bench.driver
    row, = driver.interlocks.fallbacks
    if moment == 'after a fallback under way':
        cell.publish(speed, 3, run=0.1)
    if 'under way' in moment:
        cell.bench.run_until(lambda: row.is_under_way)
        assert row.stands is ('refresh' in moment)
        cell.run(0.001)
    cell.bench.write(speed, [42])
    if 'under way' in moment:
        driver._sort_inbox(cell.now)
    if moment == 'executed':
        cell.bench.run_until(lambda: cell.word('N7:0') == 42)
    elif moment == 'on the line':
        cell.bench.run_until(lambda: bool(driver.interlocks._writes.youngest()))
        assert cell.word('N7:0') == 7
    end(cell, 0.3)
    assert (cell.word('N10:0'), cell.word('N7:0')) == (0, 7)
    assert driver.interlocks.unconfirmed() == []


@pytest.mark.parametrize('event', ['end', 'RUN', 'port'])
def test_rules_5_and_8_message_over_a_fallback_that_is_due_puts_none_off(event: str) -> None:
    speed = speed_row(Fallback((7,), 20_000))
    cell = Cell(beat_row(), speed, start=False)
    cell.refused, cell.spared = {'N7:0'}, 42
    cell.bench.open()
    cell.run(0.3)  # refused once
    cell.is_late = True
    cell.bench.write(speed, [42])  # carried out, and nobody knows
    cell.bench.run_until(lambda: cell.bench.driver.interlocks.fallbacks[0].has_failed)
    cell.is_late, cell.refused = False, set()
    assert cell.word('N7:0') == 42
    if event == 'end':
        end(cell)
    elif event == 'RUN':
        for is_running in (False, True):
            cell.bench.driver.interlocks.mode_seen(1, is_running, cell.now)
    else:
        cell.bench.lose_port()
        cell.bench.open()
    cell.run(0.2)
    assert cell.word('N7:0') == 7


@pytest.mark.parametrize('is_followed', [False, True])
def test_rule_5_end_waits_for_the_second_write_of_rule_10(is_followed: bool) -> None:
    """A gateway delivers 0.9 s later what it has called undelivered."""
    speed = make_mapping('N7:0', 'Write', tag='speed', fallback=FALLBACK, via=7)
    cell = Cell(speed, start=False)
    cell.put_behind_gateway()
    cell.run(6.0)

    def is_held(command: Packet) -> bool:
        if command.data[-2:] != b'\x2a\x00':
            return False
        cell.bench.at(cell.now + 0.9, lambda: cell.plc.serve(command))
        return True

    cell.is_undelivered = is_held
    cell.publish(speed, 42, run=0.05)
    if is_followed:
        cell.publish(speed, 5, run=0.05)
        assert cell.results()[-1] == 'written'
    end(cell)
    assert cell.word('N7:0') == 7


def test_rule_5_end_waits_for_a_plc_that_does_not_answer_for_a_moment() -> None:
    speed = speed_row()
    cell = Cell(beat_row(), speed)
    cell.publish(speed, 42, times=20, run=1.95)
    hear, since = cell.bench.far.hear, cell.now
    cell.bench.far.hear = lambda data: hear(data) if cell.now > since + 0.7 else b''
    end(cell)
    assert (cell.word('N10:0'), cell.word('N7:0')) == (0, 7)


def test_rule_5_end_asks_a_silent_plc_at_once_where_another_answers() -> None:
    speed = speed_row(Fallback((7,), 5000))
    cell = Cell(beat_row(), speed, make_mapping('N7:9', station=2, period=100),
                polling='Standard', start=False)
    cell.bench.plc(2, 'PLC5', ('N7:0', 20))
    cell.bench.open()
    cell.run(1.0)
    cell.publish(speed, 42, times=20, run=1.95)
    cell.plc.faults.silent = True
    cell.bench.at(cell.now + 1.0, lambda: setattr(cell.plc.faults, 'silent', False))
    cell.bench.driver.interlocks.wind_down()
    cell.bench.line.wake(cell.bench.driver.machine)
    cell.run(1.5)
    assert (cell.word('N10:0'), cell.word('N7:0')) == (0, 7)


class GuestCell(Cell):
    """A cell with a guest who writes there."""

    def __init__(self, *rows: Mapping, start: bool = True, run: float = 1.0,
                 polling: str = 'Message') -> None:
        super().__init__(*rows, start=False, polling=polling)
        self.replies: list[int] = []
        if start:
            self.bench.open()
            self.run(run)

    def ask(self, text: str, value: int, dst: int = 1) -> None:
        """Let the guest write a word."""
        row = make_mapping(text, 'Write')
        cmd, data = row.dialect.write(row.address, value.to_bytes(2, 'little'))
        self.bench.driver.guests.put(GuestCommand(
            Guest('pty:hmi', ShareAccess.ALL), Packet(dst, 9, cmd, 0, 1, data), self.now,
            lambda reply: self.replies.append(reply.sts)))
        self.bench.line.wake(self.bench.driver.machine)

    def hold_guests(self, seconds: float) -> None:
        """Let a gateway keep the guest's 99."""
        hold(self, seconds, lambda command: command.data.endswith(b'\x63\0'))


WORDS = ('N7:0', 'N10:0')


@pytest.mark.parametrize('dst', [1, 255])
@pytest.mark.parametrize('polling', POLLING_MODES)
@pytest.mark.parametrize('text', WORDS)
def test_rule_5_write_of_a_guest_on_the_line_when_the_end_begins_does_not_stay(
        text: str, polling: str, dst: int) -> None:
    # Alone: nothing else keeps the end waiting.
    row = speed_row() if text == 'N7:0' else beat_row(requires=('speed',), timeout=300)
    cell = GuestCell(row, polling=polling)
    cell.ask(text, 99, dst)
    cell.bench.run_until(lambda: cell.word(text) == 99)  # its reply is not here yet
    end(cell)
    assert cell.word(text) == (7 if text == 'N7:0' else 0)


@pytest.mark.parametrize('text', WORDS)
@pytest.mark.parametrize('held', [0.3, 0.9])
def test_rule_5_write_of_a_guest_that_a_gateway_holds_does_not_stay(
        text: str, held: float) -> None:
    speed = make_mapping('N7:0', 'Write', tag='speed', fallback=FALLBACK, via=7)
    beat = make_mapping('N10:0', 'Heartbeat', tag='beat', period=200, heartbeat=Heartbeat(), via=7)
    cell = GuestCell(beat, speed, start=False)
    cell.put_behind_gateway()
    cell.run(4.0)
    cell.hold_guests(held)
    cell.ask(text, 99)
    cell.run(0.02)
    assert cell.replies == [0x02]
    end(cell)
    assert [cell.word(name) for name in WORDS] == [7, 0]


def test_rule_5_what_may_still_land_after_the_end_is_named() -> None:
    speed = make_mapping('N7:0', 'Write', tag='speed', fallback=FALLBACK, via=7)
    cell = GuestCell(speed, start=False)
    cell.bench.driver._record._settle_time = 20.0  # as with a Cmd_Timeout of 10 s
    cell.put_behind_gateway()
    cell.run(30.0)
    cell.hold_guests(1.9)
    cell.ask('N7:0', 99)
    cell.run(0.02)
    end(cell)
    unconfirmed, = cell.bench.driver.interlocks.unconfirmed()
    assert unconfirmed.startswith('speed (a gateway may hold a write to it for ')


@pytest.mark.parametrize('dst', [1, 255])
def test_rule_8_guests_write_over_a_fallback_is_written_over_at_once(dst: int) -> None:
    cell = GuestCell(beat_row(), speed_row())
    row, = cell.bench.driver.interlocks.fallbacks
    cell.run(1.0)
    since = cell.now
    cell.ask('N7:0', 99, dst)
    cell.bench.run_until(lambda: cell.word('N7:0') == 99)
    cell.bench.run_until(lambda: not row.stands)
    assert row.state is FallbackState.OVERWRITTEN
    cell.run(0.1)
    assert row.stands
    assert cell.written('N7:0', since)[-1:] == [7]
    assert cell.written('N10:0', since)[-1:] == [0]  # rule 3 b
    cell.run(2.0)
    assert cell.word('N10:0') > 0
    assert cell.results() == [START]


def test_rule_11_only_the_first_try_over_a_guest_is_not_held_up_by_a_pause() -> None:
    one = OneRow()
    row = one.row
    row.make_due(FallbackCause.START, 0.0)
    assert row.first_due == 0.0
    one.fallback(row.take(0.0), 0.1)
    guest = Claim(1, [one.mapping.extent])
    guest.done = guest.lands_until = 1.0
    row.write_ended(guest, 1.0)
    assert row.judge(1.0, -math.inf)
    assert row.first_due == 1.0
    one.fallback(row.refresh(1.0), 1.2, Outcome.UNKNOWN)
    assert row.judge(1.2, -math.inf)
    assert row.first_due == math.inf


@pytest.mark.parametrize('held', [0.5, 0.7, 0.9])
@pytest.mark.parametrize('count', [1, 2, 3])
def test_rule_19_own_heartbeats_that_a_gateway_holds_are_no_other_program(
        held: float, count: int) -> None:
    beat = make_mapping('N10:0', 'Heartbeat', tag='beat', period=200, heartbeat=Heartbeat(), via=7)
    cell = Cell(beat, start=False)
    cell.put_behind_gateway()
    cell.run(5.0)
    left = [count]

    def is_meant(command: Packet) -> bool:
        left[0] -= command.data[-2:] != b'\0\0' and 'N10:0' in cell._named(command)
        return 0 <= left[0] < count

    hold(cell, held, is_meant)
    cell.run(5.0)
    assert left[0] < 0
    assert cell.bench.listener.foreign == []
    assert cell.bench.driver.interlocks.heartbeats[0].why_not(cell.now) == ''


def test_rule_8_guests_write_over_a_0_is_written_over_at_once() -> None:
    cell = GuestCell(beat_row(2000, requires=('speed',), timeout=300))
    cell.ask('N10:0', 99)
    cell.bench.run_until(lambda: cell.word('N10:0') == 99)
    cell.run(0.1)
    assert cell.word('N10:0') == 0
    assert cell.bench.listener.foreign == []


def test_rule_8_command_that_nobody_knows_refreshes_and_holds_no_heartbeat() -> None:
    cell = GuestCell(beat_row(), speed_row())
    cell.run(1.0)
    since = cell.now
    store(cell.plc, 'N7:0', [99])
    cell.bench.driver.guests.put(GuestCommand(
        Guest('pty:hmi', ShareAccess.ALL), Packet(1, 9, 0x0F, 0, 1, b'\x3A'), cell.now,
        lambda reply: None))
    cell.plc.serve = partial(_confirm_3a, cell.plc.serve)  # type: ignore[method-assign]
    cell.run(0.3)
    assert cell.word('N7:0') == 7
    assert 0 not in cell.written('N10:0', since)


def _confirm_3a(serve: Callable[[Packet], Packet], command: Packet) -> Packet:
    return command.reply() if command.data == b'\x3A' else serve(command)


def test_rule_5_commands_of_guests_are_not_sent_while_the_bridge_ends() -> None:
    cell = Cell(speed_row(), run=1.0)
    driver, sts = cell.bench.driver, []
    cell.refused = {'N7:0'}  # so that the end lasts
    driver.interlocks.wind_down()
    command = Packet(1, 9, 0x0F, 0, 1, bytes.fromhex('67 00 00 01 00 07 00 07 00 42 2A 00'))
    driver.guests.put(GuestCommand(Guest('pty:hmi', ShareAccess.ALL), command, cell.now,
                                   lambda reply: sts.append(reply.sts)))
    cell.bench.line.wake(driver.machine)
    cell.run(1.0)
    assert sts == [0x01]  # no room; the PLC would have answered 10


def test_rule_5_what_was_not_confirmed_at_the_end_is_named() -> None:
    cell = Cell(beat_row(), speed_row(), run=1.0)
    cell.refused = {'N10:0'}
    cell.bench.driver.interlocks.wind_down()
    cell.bench.line.wake(cell.bench.driver.machine)
    cell.run(2.0)
    assert not cell.bench.driver.interlocks.is_over
    assert cell.bench.driver.interlocks.unconfirmed() == ['beat']


@pytest.mark.parametrize('delay', [0.0, 0.05, 0.12, 0.19])
def test_rule_6_pause_of_the_process_lets_no_beat_out_that_vouches_for_the_past(
        delay: float) -> None:
    cell = Cell(beat_row())
    cell.run(2.0 + delay)
    cell.bench.is_alive = False
    resumed = cell.now + 3.0
    cell.bench.line.pause(cell.bench.driver.machine, 3.0)
    cell.run(6.0)
    assert cell.written('N10:0', resumed) == []


def test_rule_7_message_refreshes_from_its_own_time_when_it_is_confirmed() -> None:
    cell, speed = speed_cell()
    cell.bench.driver.write([speed], [3], cell.now - 0.3)
    cell.bench.line.wake(cell.bench.driver.machine)
    begun = cell.now
    cell.run(1.0)
    assert cell.written('N7:0') == [7, 3, 7]
    when = cell.writes[-1][0]
    assert begun - 0.3 + AFTER <= when < begun - 0.3 + AFTER + 0.05
    assert cell.results() == [START, 'written', TIMEOUT]


@pytest.mark.parametrize('gap', [0.1, 0.002])  # s; slower, and faster, than transactions are
def test_rule_7_messages_that_the_plc_refuses_do_not_keep_an_output_alive(gap: float) -> None:
    cell, speed = speed_cell()
    cell.publish(speed, 3, run=0.1)
    cell.refused, cell.spared = {'N7:0'}, 7
    cell.publish(speed, 99, times=round(2.0 / gap), gap=gap)
    cell.run(AFTER + 0.1)
    assert cell.word('N7:0') == 7
    assert cell.results().count(TIMEOUT) == 1
    cell.run(1.0)
    assert cell.results().count(TIMEOUT) == 1  # it stands, whatever is refused after it


def test_rule_7_fallback_waits_for_a_message_that_waits() -> None:
    cell, speed = speed_cell()
    cell.publish(speed, 3, run=0.1)
    plc, (row,) = cell.bench.driver.interlocks._plcs[1], cell.bench.driver.interlocks.fallbacks
    row.due = due = row.refreshed + AFTER
    assert plc.ready({speed: due - 0.1}, due) == []
    assert row.due == due - 0.1 + AFTER
    row.due = due
    assert plc.ready({}, due) == [row]


def test_rule_7_message_that_is_older_than_fallback_after_is_not_sent() -> None:
    cell, speed = speed_cell()
    cell.bench.driver.write([speed], [3], cell.now - 0.6)
    cell.bench.line.wake(cell.bench.driver.machine)
    cell.run(1.0)
    assert cell.written('N7:0') == [7]
    assert cell.results() == [
        START, 'not written: not sent: waited longer than 0.5 s for the line']


def test_rule_8_change_to_run_is_a_first_contact() -> None:
    speed = speed_row(Fallback((7,), 60_000))
    cell = Cell(beat_row(), speed, run=1.0)
    cell.publish(speed, 3, run=1.0)
    cell.plc.processor.setting = Setting.PROGRAM
    cell.run(2 * MODE_PERIOD)
    since = cell.now
    cell.plc.processor.setting = Setting.RUN
    cell.run(2 * MODE_PERIOD)
    after = [(name, value) for when, name, value in cell.writes if when >= since]
    at = after.index(('N10:0', 0))
    assert after[at:at + 3] == [('N10:0', 0), ('N7:0', 7), ('N10:0', 1)]
    assert cell.results()[-1] == RUN


def test_rule_8_row_is_fresh_by_a_confirmed_message_only() -> None:
    one = OneRow()
    row = one.row
    row.make_due(FallbackCause.START, 0.0)
    one.fallback(row.take(0.0), 0.1)
    one.message(1.0, 1.0, Outcome.UNKNOWN)  # counts once for the time that it stands (rule 7)
    assert row.deadline(-math.inf) == 1.0 + AFTER
    assert not row.is_fresh(1.1)
    one.message(1.2, 1.2, Outcome.WRITTEN)
    assert row.is_fresh(1.2 + 0.9 * AFTER)


def test_rule_8_fallback_that_stands_is_written_again_without_a_result() -> None:
    cell = Cell(speed_row(), speed_row(address='N7:1', tag='slow', fallback=Fallback((5,), 7000)))
    cell.run(1.0)
    store(cell.plc, 'N7:0', [888, 888])  # a download in a short time of PROGRAM
    cell.run(4.5)
    assert (cell.word('N7:0'), cell.word('N7:1')) == (7, 888)
    cell.run(2.0)
    assert (cell.word('N7:0'), cell.word('N7:1')) == (7, 5)
    cell.run(20.0)
    assert len(cell.written('N7:0')) == 6 + 4  # of both: every 5 s, every 7 s
    assert cell.results() == [START, START]


def test_rule_8_fallback_that_stands_does_not_wait_for_one_of_a_busy_station() -> None:
    speeds = [make_mapping('N7:0', 'Write', station=number, fallback=FALLBACK)
              for number in (1, 2)]
    line = Line(speeds, (1, 2))
    line.run(4.0)
    interlocks = line.driver.interlocks
    first, second = (interlocks.refresh(9.0, busy) for busy in ({1}, set()))
    assert first is not None and first.row.mapping is speeds[1]
    assert second is not None and second.row.mapping is speeds[0]


def test_rule_8_message_that_is_lost_with_the_port_is_not_waited_for() -> None:
    speed = speed_row(Fallback((7,), 5000))
    recipe = make_mapping('N7:1', 'Write', length=150)
    cell = Cell(speed, recipe, run=1.0)
    cell.publish(speed, 3, run=0.5)
    row, = cell.bench.driver.interlocks.fallbacks
    cell.run(3.0)
    hear, cell.bench.far.hear = cell.bench.far.hear, lambda data: b''
    cell.bench.write(recipe, [1] * 150)
    cell.bench.write(speed, [4])  # waits
    cell.run(0.1)
    assert row.judge(cell.now, cell.now) is False  # it is waited for
    cell.bench.lose_port()
    cell.bench.far.hear = hear
    cell.bench.open()
    cell.run(row.refreshed + 5.0 - cell.now - 0.05)
    assert cell.word('N7:0') == 3
    cell.run(0.1)
    assert cell.word('N7:0') == 7


def test_rule_9_messages_that_wait_end_when_the_fallback_goes_out() -> None:
    speed = speed_row(Fallback((7,), 60_000))
    cell = Cell(speed, start=False)
    cell.bench.driver.is_online = True
    cell.bench.driver._inbox.open()
    cell.bench.driver.write([speed], [3], 0.0)
    cell.bench.open()
    cell.run(1.0)
    assert cell.written('N7:0') == [7]
    assert cell.results() == ['not written: not sent: fallback', START]


def test_rule_9_write_of_another_row_to_the_same_words_holds_up_for_its_own_time_only() -> None:
    recipe = speed_row(None, length=200, tag='recipe')  # of several packets
    speed = speed_row()
    cell = Cell(recipe, speed, run=1.0)
    cell.bench.write(speed, [3])
    cell.run(AFTER - 0.01)
    assert cell.word('N7:0') == 3
    cell.bench.write(recipe, [4] * 200)  # under way when the fallback is due
    row, = cell.bench.driver.interlocks.fallbacks
    record = cell.bench.driver._record
    cell.bench.run_until(lambda: row.cause is not None and not record.may_begin(speed))
    cell.run(0.5)
    assert cell.results()[-1] == TIMEOUT
    assert cell.word('N7:0') == 7


def test_rule_11_eighth_turn_is_a_read_where_fallbacks_have_several_packets() -> None:
    rows = [speed_row(Fallback((7,) * 200, 2000), f'N2{number}:0', f'w{number}', 200)
            for number in range(5)]
    bench = DriverBench([*rows, make_mapping('N9:0', period=1)], start=False,
                        network=Network(baud=115200, timeout=200))
    plc = bench.plc(1, 'PLC5', ('N9:0', 1), *((f'N2{number}:0', 200) for number in range(5)))
    said = ''

    def serve(command: Packet) -> Packet:
        nonlocal said
        said += {b'\x67': 'w', b'\x68': 'r'}.get(command.data[:1], '')
        return plc.serve(command)

    plc.slave = HalfDuplexSlave(LinkSettings(station=1), serve)
    bench.open(run=1.0)
    for row in rows:
        bench.write(row, [3] * 200)
    bench.run(1.5)
    said = ''
    bench.run(1.0)  # all fallbacks are due
    assert said.strip('r') == 7 * 'w' + 'r' + 3 * 'w'


def test_rule_10_fallback_of_two_packets_does_not_wait_for_itself() -> None:
    cell = Cell(speed_row(Fallback((7,) * 200, int(AFTER * 1000)), length=200), run=1.0)
    cell.bench.lose_port()
    cell.run(1.0)
    cell.bench.open()
    cell.run(1.0)
    assert cell.results() == [START, RETURN]


def test_rule_10_after_an_unknown_write_it_is_written_once_more() -> None:
    cell, speed = speed_cell()
    say, cell.bench.far.say = cell.bench.far.say, lambda data: b''
    cell.publish(speed, 3, run=0.05)
    cell.run(0.5)
    cell.bench.far.say = say
    cell.run(15.0)
    assert cell.written('N7:0')[:4] == [7, 3, 7, 7]
    unknown, _, second = [when for when, name, value in cell.writes if name == 'N7:0'][1:4]
    # The message ended when station 1 had not answered its two frames of 0.2 s each.
    assert second == pytest.approx(unknown + 2 * 0.2 + 2 * 0.5, abs=0.05)
    assert len([result for result in cell.results() if result.startswith('fallback')]) == 2


class Line(DriverBench):
    """PLCs of which some carry out what they are told and do not reply; who was asked for what."""

    def __init__(self, rows: Sequence[Mapping], stations: Sequence[int]) -> None:
        super().__init__(rows, network=Network(
            baud=115200, timeout=100, cmd_timeout=500, nak_retries=1, enq_retries=1))
        self.mute: set[int] = set()
        self.asked: list[tuple[float, int, int]] = []
        for number in stations:
            plc = self.plc(number, 'PLC5', ('N7:0', 40), ('N10:0', 4))
            plc.slave = HalfDuplexSlave(LinkSettings(station=number), partial(self._serve, plc))
        self.breathe()

    def _serve(self, plc: SimulatedPlc, command: Packet) -> Packet:
        reply = plc.serve(command)
        if command.cmd == 0x0F and command.data[0] == 0x67 and command.data[6] == 7:
            self.asked.append((self.clock(), plc.station, command.data[7]))
        if plc.station in self.mute:
            reply = reply._replace(tns=reply.tns ^ 0x8000)  # which nobody waits for
        return reply


def test_rule_10_plc_that_answers_has_its_fallback_before_those_that_do_not() -> None:
    stations = range(11, 19)
    rows = [make_mapping('N10:0', 'Heartbeat', station=number, tag=f'beat{number}', period=500,
                         heartbeat=Heartbeat()) for number in stations]
    speeds = [make_mapping('N7:0', 'Write', station=number, tag=f'speed{number}',
                           fallback=Fallback((7,), 8000)) for number in stations]
    line = Line([*rows, *speeds], stations)
    line.run(2.0)
    for speed in speeds:
        line.write(speed, [3])
    begun = line.clock()
    line.run(0.4)
    line.mute = {*stations[:-1]}
    line.run(7.5)
    line.asked.clear()
    line.run(30.0)
    when, first = line.asked[0][:2]
    assert (first, {station for _, station, _ in line.asked}) == (18, {*stations})
    assert when - begun < 8.0 + 1.3  # what was under way


def test_rule_10_first_try_of_each_row_goes_before_the_second_of_any() -> None:
    rows = [make_mapping(f'N7:{number}', 'Write', tag=f'speed{number}',
                         fallback=Fallback((7,), 1000)) for number in range(8)]
    line = Line(rows, [1])
    line.run(1.0)
    for row in rows:
        line.write(row, [3])
    line.run(0.3)
    line.mute, begun = {1}, line.clock()
    line.asked.clear()
    line.run(30.0)
    assert {element for _, _, element in line.asked[:8]} == {*range(8)}
    assert line.asked[7][0] - begun < 1.0 + 8 * (0.5 + 0.1)


@pytest.mark.parametrize(('outcome', 'done', 'again'), [
    (Outcome.PARTLY, 1.9, True), (Outcome.UNKNOWN, 1.9, True), (Outcome.FAILED, 1.9, False),
    (Outcome.UNKNOWN, 1.0, False)])  # nothing can land any more
def test_rule_10_once_more_after_a_message_that_may_have_been_written(
        outcome: Outcome, done: float, again: bool) -> None:
    one = OneRow()
    row = one.row
    one.message(1.0, done, outcome)
    assert row.judge(2.0, -math.inf)
    assert one.fallback(row.take(2.0), 2.1) is not None
    assert row.judge(2.8, -math.inf) is False
    assert row.judge(2.9, -math.inf) is again  # 2 x Cmd_Timeout after the message ended
    assert row.judge(60.0, -math.inf) is again


def test_rule_10_heartbeat_counts_after_a_0_that_is_written_once_more() -> None:
    beat = HeartbeatRow(OneRow().record.words_of(beat_row()), 1, Random(0))
    beat.begin(0.0, is_new=True)
    for now in (0.0, 0.3):
        assert beat.judge(now, '', now, {})
        assert beat.take(now).value == '[0]'
        beat.ended(Outcome.WRITTEN, now + 0.1)
        beat.words.try_again(0.3 if now < 0.3 else math.inf, now + 0.1)
    assert not beat.judge(0.8, '', 0.8, {})  # the 0 stands for half a second
    assert beat.judge(0.95, '', 0.95, {})
    assert beat.take(0.95).value == '[1]'


def test_rule_10_why_the_plc_refuses_is_told_once() -> None:
    cell = Cell(beat_row(), speed_row())
    cell.refused = {'N7:0', 'N10:0'}
    cell.run(5.0)
    reasons = cell.bench.listener.reasons
    assert sorted(address for address, _ in reasons) == ['N10:0', 'N7:0']
    assert all(reason.startswith('not written: STS 10: ') for _, reason in reasons)
    interlocks = cell.bench.driver.interlocks
    assert interlocks.fallbacks[0].refusal.startswith('STS 10: ')
    cell.refused = set()
    cell.run(2.0)
    assert [interlocks.fallbacks[0].refusal, interlocks.heartbeats[0].refusal] == ['', '']


def test_rule_8_fallbacks_that_stand_and_reads_take_turns_on_a_full_line() -> None:
    reads = [make_mapping(f'N{file}:0', period=100, tag=f'read_{file}') for file in range(20, 30)]
    outputs = [make_mapping(f'N7:{number}', 'Write', fallback=FALLBACK, tag=f'w_{number}')
               for number in range(60)]
    bench = DriverBench([*reads, *outputs], network=Network(baud=9600))
    plc = bench.plc(1, 'PLC5', ('N7:0', 60), *((f'N{file}:0', 1) for file in range(20, 30)))
    bench.run(20.0)
    before, written = len(bench.listener.reads), []
    write = plc.table.write

    def note(address: Address, data: bytes) -> None:
        written.append(str(address))
        write(address, data)

    plc.table.write = note  # type: ignore[method-assign]
    bench.run(30.0)
    times = Counter(written)
    assert len(times) == 60 and min(times.values()) >= 3
    assert len(written) == pytest.approx(len(bench.listener.reads) - before, abs=5)


@pytest.mark.parametrize(('outcome', 'next_refresh'), [
    (Outcome.WRITTEN, 12.0), (Outcome.UNKNOWN, 8.0), (Outcome.FAILED, 8.0)])
def test_rule_10_refresh_is_not_the_second_write(outcome: Outcome, next_refresh: float) -> None:
    one = OneRow(cmd_timeout=4.0)
    row = one.row
    one.message(1.0, 2.0, Outcome.UNKNOWN)
    assert row.judge(2.0, -math.inf)
    one.fallback(row.take(2.0), 2.0)
    one.fallback(row.refresh(7.0), 7.0, outcome)
    assert not row.judge(7.0, -math.inf)
    assert row.due == 10.0
    assert row.refresh_at == next_refresh


def test_rule_10_first_try_is_not_held_up_by_the_pause_of_another_row() -> None:
    speeds = [make_mapping(f'N7:{2 * number}', 'Write', tag=f'speed{number}', via=7,
                           fallback=Fallback((7,), 500 + 100 * number)) for number in range(2)]
    for offset in range(10):  # the pauses begin with the retries, a second before they end
        cell = Cell(*speeds, start=False)
        cell.put_behind_gateway()
        cell.run(7.0 + 0.1 * offset)
        for speed in speeds:
            cell.bench.write(speed, [5])
            cell.run(0.1)
        _, second = cell.bench.driver.interlocks.fallbacks
        cell.is_undelivered = lambda command: command.data[7:8] == b'\0'
        cell.bench.run_until(lambda row=second: row.sent > row.refreshed)
        assert second.sent < second.refreshed + second.after + 0.15


def test_rule_10_pause_of_this_process_is_no_pause_of_a_gateway() -> None:
    speed = make_mapping('N7:0', 'Write', tag='speed', fallback=FALLBACK, via=7)
    cell = Cell(speed, start=False)
    cell.put_behind_gateway()
    cell.run(6.0)
    cell.publish(speed, 42, run=0.1)
    row, = cell.bench.driver.interlocks.fallbacks
    cell.is_undelivered = lambda command: True
    cell.bench.run_until(lambda: not row.stands and row.tried > row.refreshed
                         and not row.is_under_way)
    cell.bench.run_until(lambda: row.is_under_way)  # the second try
    cell.bench.line.pause(cell.bench.driver.machine, 600.0)
    cell.run(601.0)
    cell.is_undelivered = lambda command: False
    cell.run(1.5)
    assert cell.word('N7:0') == 7


def test_rule_10_pause_of_this_process_does_not_put_off_a_silent_plc() -> None:
    rows = [make_mapping('N7:1', station=number, period=500) for number in (1, 2)]
    speed = make_mapping('N7:0', 'Write', station=2, fallback=FALLBACK)
    line = Line([*rows, speed], (1, 2))
    line.run(2.0)
    line.write(speed, [42])
    line.run(0.1)
    line._stations[1].faults.silent = True
    line.run(4.0)
    line.run_until(lambda: any(task.station == 2 for task in line.driver.tasks.under_way))
    line.line.pause(line.driver.machine, 600.0)
    line._stations[1].faults.silent = False
    asked = len(line.asked)
    line.run(603.0)
    assert (2, 0) in [(station, word) for _, station, word in line.asked[asked:]]
    assert line.driver.stations[2].active


def test_rule_11_flood_of_bits_does_not_delay_beats_nor_starve_reads() -> None:
    bit, read = make_mapping('B3:0/0', 'Write'), make_mapping('N11:0', period=100)
    cell = Cell(beat_row(period=200), bit, read, run=1.0)
    for number in range(400):
        cell.bench.write(bit, [number % 2])
    since = cell.now
    cell.run(3.0)
    beats = [when for when, name, _ in cell.writes if name == 'N10:0' and when >= since]
    assert max(after - before for before, after in zip(beats, beats[1:], strict=False)) < 0.25
    assert len([when for when in cell.bench.listener.times(read) if when >= since]) > 20


def test_rule_11_plc_is_not_left_alone_any_more_once_it_answers_a_write_of_anybody() -> None:
    speed = speed_row()
    cell = GuestCell(speed, start=False)
    cell.is_undelivered = lambda command: command.data.endswith(b'\7\0')
    cell.bench.open()
    plc = cell.bench.driver.interlocks._plcs[1]
    cell.bench.run_until(lambda: plc.is_lost)
    cell.is_undelivered = lambda command: False
    assert cell.now < 0.2 < plc.pause_end
    cell.ask('N7:0', 99)
    cell.bench.run_until(lambda: cell.word('N7:0') == 99)
    cell.run(0.1)
    assert cell.word('N7:0') == 7


def test_rule_11_first_try_of_a_fallback_does_not_wait_for_the_turn_of_late_plcs() -> None:
    speed = speed_row(Fallback((7,), 3000))
    cell = Cell(beat_row(), speed, run=2.0)
    cell.publish(speed, 3, run=0.1)
    cell.is_late, begun = True, cell.now
    cell.run(6.0)
    assert not cell.bench.driver.stations[1].replies_in_time
    tried, = (when - begun for when, _, value in cell.writes if value == 7 and when > begun)
    assert 2.8 < tried < 2.9 + 0.5 + 1.0 + 0.1  # a heartbeat has the line, and a pause follows it


def test_rule_7_old_message_of_a_serve_row_is_not_stored() -> None:
    row = make_mapping('N7:0', 'Serve', station=0, fallback=FALLBACK)
    bench = DriverBench([row])
    bench.run(3.0)
    bench.driver.write([row], [42], bench.clock() - 2 * AFTER)
    bench.driver._sort_inbox(bench.clock())
    assert bench.driver._served.words_of(row) == b'\7\0'
    assert bench.listener.results[-1].outcome is Outcome.NOT_SENT


def test_rule_12_fallback_of_a_serve_row_goes_into_our_own_table() -> None:
    served = make_mapping('N9:0', 'Serve', station=5, fallback=FALLBACK)
    cell = Cell(served, run=0.1)
    words = cell.bench.driver._served.words_of
    assert words(served) == b'\7\0'
    cell.publish(served, 3, run=0.3)
    assert words(served) == b'\3\0'
    cell.run(0.3)
    assert words(served) == b'\7\0'
    assert cell.results() == [START, 'written', TIMEOUT]


def test_rule_13_run_guards_a_row() -> None:
    read = make_mapping('N11:0', period=100, publish_while=PublishWhile(None, None))
    cell = Cell(read, run=3.0)
    assert len(cell.bench.listener.reads) > 20
    cell.plc.processor.setting = Setting.PROGRAM
    cell.run(1.0)
    since = cell.now
    point = cell.bench.driver.points[read]
    cell.run(2.0)
    assert [when for when in cell.bench.listener.times(read) if when >= since] == []
    assert point.freshness(cell.now) is Freshness.WITHHELD
    assert point.withheld.startswith('not in RUN: it is in ')
    assert cell.bench.listener.reasons[-1][1] == 'withheld: not in RUN: it is in REM PROG'
    cell.plc.processor.setting = Setting.RUN
    cell.run(2.0)
    assert point.freshness(cell.now) is Freshness.FRESH


def test_rule_13_answer_about_the_mode_is_no_older_than_the_stale_time() -> None:
    row = make_mapping('N11:0', publish_while=PublishWhile(None, None))
    guard = RunGuard()
    point = ReadPoint(row, 1.0, 3.0, guard)
    why_not = partial(guard.why_not, point)
    running = Identity(PlcType.SLC, 'SLC 5/03', mode=Mode.RUN, mode_text='RUN')
    assert why_not(9.0, 9.0) == 'not in RUN: its mode is not known'
    guard.told(running, 10.0)
    begun = 'it has begun to run during this read'
    assert [why_not(10.0, 10.5), why_not(10.5, 13.0)] == [begun, '']
    assert why_not(13.0, 13.5) == 'it has not reported its mode for 3.5 s'
    guard.told(running, 13.5)  # nobody knows what it did in between
    assert [why_not(13.5, 13.6), why_not(13.6, 13.6)] == [begun, '']
    guard.told(replace(running, faults=('bad RAM', 'low battery')), 14.0)
    assert why_not(14.5, 14.5) == 'not in RUN: it is in RUN, bad RAM; low battery'
    guard.told(None, 15.0)
    assert why_not(15.5, 15.5) == 'not in RUN: its mode is not known'


def test_rule_11_mode_is_asked_for_though_heartbeats_take_the_whole_line() -> None:
    read = make_mapping('N11:0', period=1000)
    beats = [beat_row(100, address=f'N10:{number}') for number in range(6)]
    bench = DriverBench([read, *beats], network=Network(baud=2400, timeout=200))
    bench.plc(1, 'PLC5', ('N10:0', 6), ('N11:0', 1))
    bench.breathe()
    bench.run(30.0)
    told = bench.driver.checks.known(1).told
    assert told is not None and told > bench.clock() - 10.0
    assert len(bench.listener.times(read)) == 3


def test_rule_13_questions_for_the_modes_of_many_plcs_have_their_share_of_a_full_line() -> None:
    stations = range(11, 23)
    rows = [make_mapping('N11:0', period=300, station=station, publish_while=condition,
                         tag=f'row_{station}_{number}')
            for station in stations
            for number, condition in enumerate((None, PublishWhile(None, None)))]
    bench = DriverBench(rows, network=Network(baud=9600))
    for station in stations:
        bench.plc(station, 'PLC5', ('N11:0', 1))
    bench.run(120.0)
    assert bench.listener.reasons == []
    points = bench.driver.points
    planned = points[rows[0]].stale_time / DriverSettings().stale_after
    counts = {mapping: len(bench.listener.values(mapping)) for mapping in rows}
    assert min(counts.values()) > 120.0 / planned > 0.6 * max(counts.values())


def counter_cell() -> tuple[Cell, Mapping]:
    """Return a cell whose rows depend on a counter, which stands still."""
    counter = make_mapping('N11:3', tag='alive', period=100)
    read = make_mapping('N7:0', period=100, publish_while=PublishWhile('alive', 500))
    return Cell(counter, read), read


def count(cell: Cell, times: int, gap: float = 0.15) -> None:
    """Let the PLC's program count."""
    for number in range(times):
        cell.bench.at(cell.now + number * gap,
                      lambda number=number: store(cell.plc, 'N11:3', [number + 1]))  # type: ignore


def test_rule_14_counter_has_to_change_twice_before_anything_is_published() -> None:
    cell, read = counter_cell()
    cell.run(3.0)
    assert cell.bench.listener.times(read) == []
    begun = cell.now
    count(cell, 20)
    cell.run(3.0)
    times = cell.bench.listener.times(read)
    assert times[0] > begun + 0.15
    assert cell.bench.driver.points[read].freshness(cell.now) is Freshness.FRESH
    ended = cell.now
    cell.run(3.0)
    times = cell.bench.listener.times(read)
    assert ended < times[-1] < ended + 0.65
    assert cell.bench.driver.points[read].withheld == 'alive has not changed twice within 0.5 s'


def test_rule_14_late_change_ends_what_two_in_time_have_permitted() -> None:
    row = make_mapping('N7:0', publish_while=PublishWhile('alive', 500))
    guard = CounterGuard('alive')
    point = ReadPoint(row, 0.1, 3.0, guard)
    for number, now in enumerate((0.0, 0.3, 0.6)):
        guard.read(bytes((number,)), now)
    assert guard.why_not(point, 0.7, 0.7) == ''
    guard.read(b'x', 5.0)  # late, and nobody has asked meanwhile
    assert guard.why_not(point, 5.1, 5.1) == 'alive has not changed twice within 0.5 s'
    guard.read(b'y', 5.2)
    assert [guard.why_not(point, 5.2, 5.3), guard.why_not(point, 5.3, 5.3)] == [
        'alive has begun to change during this read', '']


def withheld(cell: Cell) -> list[str]:
    """Return what was told of withheld rows."""
    return [reason for _, reason in cell.bench.listener.reasons if reason.startswith('withheld')]


def test_rule_15_withholding_is_counted_and_told_once_a_cause() -> None:
    cell, read = counter_cell()
    for _ in range(3):
        count(cell, 5)
        cell.run(3.0)
    assert cell.bench.driver.points[read].withholdings == len(withheld(cell)) == 3
    assert [tag for tag, _ in cell.bench.listener.ends] == 2 * [read.tag]
    assert all(2.0 < seconds < 3.0 for _, seconds in cell.bench.listener.ends)


def test_rule_15_start_is_told_when_the_program_has_had_its_time_to_count() -> None:
    cell, read = counter_cell()
    cell.run(0.4)
    point = cell.bench.driver.points[read]
    assert (withheld(cell), point.withholdings) == ([], 0)
    assert point.freshness(cell.now) is Freshness.WAITING
    cell.run(0.4)
    assert (len(withheld(cell)), point.withholdings) == (1, 1)
    assert point.freshness(cell.now) is Freshness.WITHHELD


class Bridges:
    """Bridges with a heartbeat in the same word of a PLC, each on a port of its own."""

    def __init__(self, *periods: int) -> None:
        table = DataTable(PlcType.PLC5)
        table.create(parse_address('N10:0', PlcType.PLC5), 4)
        self.word, self.table = parse_address('N10:0', PlcType.PLC5), table
        self.benches = []
        for number, period in enumerate(periods):
            # Both count from 1: nothing but their dice is different.
            bench = DriverBench(
                [beat_row(period)], settings=DriverSettings(first_tns=number * LARGEST),
                network=Network(baud=19200, timeout=200, cmd_timeout=500))
            bench.connect(SimulatedPlc(1, table, Checksum.CRC, bench.clock))
            self.benches.append(bench)
        self.running = list(self.benches)
        self._step = max(0.005, min(periods) / 50_000)

    def run(self, seconds: float) -> None:
        """Let time pass for those that run."""
        for _ in range(round(seconds / self._step)):
            for bench in self.running:
                bench.driver.interlocks.executor_ran(bench.clock())
                bench.run(self._step)

    def store(self, value: int) -> None:
        """Let somebody else write the word."""
        self.table.write(self.word, value.to_bytes(2, 'little'))

    def states(self) -> list[BeatState]:
        """Return what each bridge makes of its row."""
        return [bench.driver.interlocks.heartbeats[0].state for bench in self.benches]

    def told(self) -> list[bool]:
        """Return what the first has told: whether it was a conflict."""
        return [is_conflict for _, _, is_conflict in self.benches[0].listener.foreign]

    @property
    def value(self) -> int:
        """Return the word."""
        return int.from_bytes(self.table.read(self.word, 1), 'little')


@pytest.mark.parametrize(('periods', 'shift'), [
    ((500, 500), 0.0), ((500, 500), 0.26), ((500, 700), 0.11), ((200, 2000), 0.4),
    ((2000, 300), 0.26), ((30_000, 30_000), 0.11)])
def test_rule_19_two_bridges_end_with_0_and_say_who(
        periods: tuple[int, int], shift: float) -> None:
    cell = Bridges(*periods)
    cell.running = cell.benches[:1]
    cell.run(2.0 + shift)
    cell.running = cell.benches
    cell.run(20 * max(periods) / 1000)
    assert cell.states() == 2 * [BeatState.CONFLICT]
    for bench in cell.benches:
        assert [conflict for _, _, conflict in bench.listener.foreign] == [False, True]
        text = bench.listener.foreign[-1][1]
        assert text.startswith('another program writes this word: ')
        assert bench.driver.interlocks.heartbeats[0].why_not(bench.clock())
    cell.running = cell.benches[1:]  # nobody takes over what the other leaves
    cell.run(10.0)
    assert cell.value == 0


@pytest.mark.parametrize('event', ['port', 'RUN'])
def test_rule_19_second_foreign_value_stays_until_a_new_start(event: str) -> None:
    cell = Bridges(500)
    bench, = cell.benches
    cell.run(3.0)
    for value in (888, 889):
        cell.store(value)
        cell.run(5.0)
    assert (cell.told(), cell.value, cell.states()) == ([False, True], 0, [BeatState.CONFLICT])
    text = bench.listener.foreign[-1][1]
    assert text == (
        'another program writes this word: 889 was read where 2 was written; 0 stays until the '
        'PLC goes from PROGRAM to RUN, ~/reload, or the port is opened again')
    cell.run(100.0)
    cell.store(890)
    cell.run(5.0)
    bench.driver.interlocks.contact(1, bench.clock())
    cell.run(2.0)
    assert cell.value == 0
    if event == 'port':
        bench.lose_port()
        bench.open()
    else:
        for is_running in (False, True):
            bench.driver.interlocks.mode_seen(1, is_running, bench.clock())
    cell.run(3.0)
    assert cell.value > 1
    assert cell.told() == [False, True]
    cell.store(891)
    cell.run(5.0)
    assert cell.told() == [False, True, event == 'port']  # after RUN it is a download again


def test_rule_19_second_foreign_value_is_one_within_a_minute_or_20_periods() -> None:
    for period, time in ((0.5, 60.0), (10.0, 200.0)):
        other = _OtherWriter(period, Random(0))
        told = [other.note_value(now) for now in (0.0, time - 1.0, 2 * time)]
        assert told == [False, True, False]


@pytest.mark.parametrize('polling', POLLING_MODES)
def test_rule_19_own_values_are_never_taken_for_those_of_another(polling: str) -> None:
    cell = Cell(beat_row(100), speed_row(), make_mapping('N10:1', period=100), polling=polling)
    speed = cell.bench.driver.mappings[1]
    cell.publish(speed, 3, times=150)
    for number in range(8):
        cell.bench.at(2.0 + number, lambda number=number: setattr(  # type: ignore[misc]
            cell, 'is_late', number % 3 == 1))
        cell.bench.at(2.5 + number, lambda number=number: cell.refused.update(  # type: ignore
            {'N10:0'} if number % 2 else set()) or cell.refused.intersection_update(
                {'N10:0'} if number % 2 else set()))
    cell.run(15.0)
    assert cell.bench.listener.foreign == []
    assert cell.word('N10:0') > 3  # after each 0 it stands for half a second


def test_rule_17_fallback_has_one_result_and_its_retries_have_none() -> None:
    cell, speed = speed_cell()
    cell.publish(speed, 3, run=0.1)
    cell.refused = {'N7:0'}
    cell.run(4.0)
    cell.refused = set()
    cell.run(3.0)
    assert cell.results().count(TIMEOUT) == 1
    result = cell.bench.listener.results[-1]
    assert (result.outcome, result.value) == (Outcome.FALLBACK, '[7]')
    assert result.latency > 3.0


def test_rule_18_read_only_writes_nothing() -> None:
    cell = Cell(beat_row(), speed_row(), read_only=True, run=3.0)
    assert cell.writes == []
    assert cell.bench.driver.interlocks.is_over
