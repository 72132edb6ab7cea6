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
Heartbeats on a virtual line: when they count, stand still and are 0, and who else writes them.

The numbers in the names are those of the rules in docs/heartbeats.md.
"""

import gc
from random import Random

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.driver.kernel.gate import Rank
from abdf1_ros.driver.kernel.heartbeat import BeatState, LARGEST, OtherWriter
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.pccc.data_table import DataTable
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.settings.heartbeats import Fallback, While
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network, POLLING_MODES
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import pytest
from support.driver_bench import DriverBench, store
from support.interlocks import AFTER, beat_row, Cell, FALLBACK, Line, speed_row, START
from support.mappings import make_mapping
from support.own_rows import OneBeat


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
    plc, = cell.bench.driver.kernel.rows.plcs.values()
    before = len(gc.get_referrers(plc))
    cell.run(20.0)
    assert len(gc.get_referrers(plc)) <= before


def test_rule_1_counts_to_32767_and_begins_again_with_1() -> None:
    cell = Cell(beat_row(), run=1.0)
    beat = cell.bench.driver.kernel.rows.heartbeats[0]
    assert beat.trial is not None
    beat.trial.write = Write(beat.mapping, [LARGEST - 1], cell.now, is_own=True)
    store(cell.plc, 'N10:0', [beat.value])
    since = cell.now
    cell.run(0.7)
    assert cell.written('N10:0', since)[:3] == [LARGEST, 1, 2]


@pytest.mark.parametrize('period', [200, 700])
def test_rule_2_the_0_of_a_first_contact_stands_for_a_period_and_half_a_second(
        period: int) -> None:
    cell = Cell(beat_row(period))
    beat, = cell.bench.driver.kernel.rows.heartbeats
    assert beat.why_not(cell.now) == 'the PLC has not confirmed it yet'
    cell.run(2.0)
    zero, one = [when for when, _, value in cell.writes if value in (0, 1)]
    assert max(period / 1000, 0.5) < one - zero < max(period / 1000, 0.5) + 0.05
    assert cell.bench.driver.kernel.rows.heartbeats[0].why_not(cell.now) == ''


def test_rule_3a_value_that_is_not_confirmed_is_repeated() -> None:
    cell = Cell(beat_row(), start=False)
    cell.refused = {'N10:0'}
    cell.bench.open(run=0.15)
    beat, = cell.bench.driver.kernel.rows.heartbeats
    assert beat.why_not(cell.now).startswith('STS 10: ')
    cell.refused = set()
    cell.run(1.05)
    cell.refused = {'N10:0'}
    cell.run(1.0)
    last = cell.written('N10:0')[-1]
    assert beat.why_not(cell.now).startswith('not confirmed for 1.1 s: STS 10: ')
    assert beat.confirmed is not None
    assert [bool(beat.why_not(beat.confirmed + silent)) for silent in (0.59, 0.61)] == [0, 1]
    cell.refused = set()
    since = cell.now
    cell.run(0.5)
    assert cell.written('N10:0', since)[0] == last + 1
    assert beat.value > last + 1


def test_rule_3b_no_beat_while_a_fallback_is_not_confirmed() -> None:
    speed = speed_row()
    elsewhere = make_mapping('N7:0', 'Write', station=2, fallback=FALLBACK)  # it never answers
    cell = Cell(beat_row(), speed_row(address='N11:0', tag='first'), speed, elsewhere, run=1.0)
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
    assert cell.bench.driver.kernel.end.unconfirmed(cell.now)[1:] == [elsewhere.tag]


@pytest.mark.parametrize('polling', POLLING_MODES)
def test_rule_3c_hung_executor_stops_the_beat_where_it_is(polling: str) -> None:
    cell = Cell(beat_row(), polling=polling, run=2.0)
    cell.bench.is_alive = False
    cell.run(1.2)
    last, count = cell.word('N10:0'), len(cell.writes)
    cell.run(5.0)
    assert last > 1
    assert (cell.word('N10:0'), len(cell.writes)) == (last, count)
    assert cell.bench.driver.kernel.rows.heartbeats[0].why_not(cell.now) == \
        'the executor of the node stands still'
    cell.bench.is_alive = True
    cell.run(1.0)
    assert cell.word('N10:0') > last


def test_rule_3d_topic_that_falls_silent_is_0_at_once_though_the_executor_stands_still() -> None:
    speed = speed_row()
    cell = Cell(beat_row(200, ['speed', 'later'], 2000), speed)
    cell.bench.driver.kernel.rows.conditions.messages['later'] = cell.now + 9.0
    cell.run(2.0)
    lapses = cell.now + 2.0
    cell.publish(speed, 3, run=0.3)
    cell.bench.is_alive = False
    cell.run(lapses - cell.now - 0.01)
    beat, = cell.bench.driver.kernel.rows.heartbeats
    assert cell.word('N10:0') and beat.reason == 'the executor of the node stands still'
    assert beat.look(cell.now, '') <= beat.topics_until == lapses  # or nothing would happen
    cell.run(0.05)
    assert cell.word('N10:0') == 0


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
    slow = speed_row(Fallback((7,), 60_000), 'N7:5', 'slow')
    cell = Cell(beat_row(2000, requires=['speed'], timeout=5000), slow, speed)
    cell.publish(slow, 3, times=2)
    cell.publish(speed, 3, times=100, run=5.0)
    kernel, now = cell.bench.driver.kernel, cell.now
    own = kernel.rows
    beat = own.heartbeats[0]

    def expires(executor: float, message: float) -> float:
        """Return until when a beat may be sent that is due now."""
        kernel.executor_ran(executor)
        own.conditions.messages['speed'] = message
        assert beat.trial is not None
        beat.trial.begun = now - 2.0
        own.plcs[1].look_again(beat)
        kernel.turns.beats_gave_way()
        turn = kernel.next(now, Rank.OWN)
        assert turn is not None and not own.conditions.is_beats_turn
        assert turn.write.mapping is beat.mapping
        kernel.ended(turn.flight, Outcome.NOT_SENT)
        return turn.expires

    assert expires(now - 0.5, now) == now + 1.5  # of the executor
    assert expires(now, now - 4.0) == now + 1.0  # of the topic
    assert expires(now + 9.0, now + 9.0) == now + 3.0  # of the fallback: a message waits
    own.message_came(Write(speed, [3], now), now)  # an older one that came late
    assert own.conditions.messages['speed'] == now + 9.0
    own.conditions.messages['speed'] = now - 5.01
    own.message_came(Write(speed, [3], now - 0.02), now)  # published in time
    assert beat.state is BeatState.COUNTS
    beat.take(now)
    kernel.station_changed(1, now, is_active=True)
    assert kernel.next(now, Rank.OWN) is None  # the 0 waits for the end of the beat


@pytest.mark.parametrize(('period', 'lost'), [(100, 0.0), (100, 0.35), (200, 0.2), (500, 0.2)])
def test_rule_3d_the_0_stands_for_half_a_second(period: int, lost: float) -> None:
    speed = speed_row(None)
    cell = Cell(beat_row(period, requires=(speed.topic,), timeout=600), speed)
    cell.publish(speed, 3, times=20, run=1.95)
    beat, = cell.bench.driver.kernel.rows.heartbeats
    cell.bench.run_until(lambda: beat.state is BeatState.HELD)
    hear, since = cell.bench.far.hear, cell.now
    cell.bench.far.hear = lambda data: hear(data) if cell.now >= since + lost else b''
    why: list[str] = []
    cell.bench.at(since + lost + 0.4, lambda: why.append(beat.why_not(cell.now)))
    cell.publish(speed, 3, times=30, run=2.5)  # the topic is back at once
    assert why == ['the PLC has to see the 0 first']
    first = next(when for when, _, value in cell.writes if when >= since and value == 0)
    after = next(when for when, name, value in cell.writes
                 if when > first and name == 'N10:0' and value)
    assert after >= first + 0.5
    assert cell.word('N10:0') > 2


def test_rule_3d_lapse_that_nobody_saw_is_0_as_well() -> None:
    """Another station's 0 has the line until the topic is back."""
    speed = speed_row(None)
    beats = [make_mapping('N10:0', 'Heartbeat', station=number, tag=f'beat{number}', period=1000,
                          condition=While((speed.topic,), 1000 + number)) for number in (1, 2)]
    line = Line([speed, *beats], (1, 2))
    for number in range(40):
        line.at(0.1 * number, lambda: line.write(speed, [3]))
    line.run(4.88)
    first, second = line.driver.kernel.rows.heartbeats
    line.far_stations[0].faults.silent = True
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
    cell.bench.run_until(lambda: stations.next_own(1) > cell.now + 0.5)
    cell.publish(speed, 3, run=0.1)
    assert driver.kernel.rows.heartbeats[0].state is BeatState.COUNTS
    assert driver.next_task(cell.now) is None
    assert driver.next_due() > cell.now
    driver.kernel.turns.beats_gave_way()
    assert not driver.kernel.turns.is_beats_turn(cell.now)


def test_rule_3d_message_that_a_fallback_has_overruled_does_not_count() -> None:
    speed = speed_row()
    cell = Cell(beat_row(requires=['speed'], timeout=5000), speed, run=2.0)
    assert set(cell.written('N10:0')) == {0}
    cell.bench.driver.kernel.rows.fallbacks[0].sent = cell.now
    cell.bench.write(speed, [3], run=1.0)  # at the same moment
    assert cell.results()[-1] == 'not written: not sent: fallback'
    assert set(cell.written('N10:0')) == {0}


def test_rule_4_inactive_station_is_not_probed_with_heartbeats() -> None:
    cell = Cell(beat_row(), run=1.0)
    cell.plc.faults.silent = True
    cell.run(5.0)
    sent = cell.bench.driver.counters.commands_sent
    cell.run(30.0)
    assert cell.bench.driver.counters.commands_sent == sent


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
                bench.driver.kernel.executor_ran(bench.clock())
                bench.run(self._step)

    def store(self, value: int) -> None:
        """Let somebody else write the word."""
        self.table.write(self.word, value.to_bytes(2, 'little'))

    def states(self) -> list[BeatState]:
        """Return what each bridge makes of its row."""
        return [bench.driver.kernel.rows.heartbeats[0].state for bench in self.benches]

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
        assert bench.listener.foreign[-1][1].startswith('another program writes this word: ')
        assert bench.driver.kernel.rows.heartbeats[0].why_not(bench.clock())
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
        bench.run_until(lambda value=value: len(cell.told()) == value - 887)
        bench.run(0.1)
        told = bench.driver.checks.known(1).told
        assert told is not None and told > bench.listener.foreign[-1][0]  # its mode, at once
        cell.run(5.0)
    assert (cell.told(), cell.value, cell.states()) == ([False, True], 0, [BeatState.CONFLICT])
    text = bench.listener.foreign[-1][1]
    assert text == (
        'another program writes this word: 889 was read where 3 was written; the '
        'bridge writes 0 until the PLC goes from PROGRAM to RUN, you call ~/reload, or the port '
        'is opened again')
    cell.run(100.0)
    cell.store(890)
    cell.run(5.0)
    bench.driver.kernel.station_changed(1, bench.clock(), is_active=True)
    cell.run(2.0)
    assert cell.value == 0
    if event == 'port':
        bench.lose_port()
        bench.open()
    else:
        for is_running in (False, True):
            bench.driver.kernel.mode_seen(1, bench.clock(), is_running=is_running)
    cell.run(3.0)
    assert cell.value > 1
    assert cell.told() == [False, True]
    cell.store(891)
    cell.run(5.0)
    assert cell.told() == [False, True, event == 'port']  # after RUN it is a download again


def test_rule_19_second_foreign_value_is_one_within_a_minute_or_20_periods() -> None:
    for period, time in ((0.5, 60.0), (10.0, 200.0)):
        other = OtherWriter(period, Random(0))
        told = [other.note_value(now) for now in (0.0, time - 1.0, 2 * time)]
        assert told == [False, True, False]
        zeros = {other.next_zero() / period for _ in range(9)}
        assert len(zeros) == 9 and 0.5 <= min(zeros) < max(zeros) < 1.5
        other.differ()
        assert other.extra_zero >= period


def test_rule_19_0_that_stays_is_written_at_the_end_and_repeated_like_any_other() -> None:
    beat = (one := OneBeat(60_000)).beat
    beat.begin(0.0)
    for now in (0.0, 2.0, 4.0):
        one.begin(now)
        one.end(now)
        beat.read_back(5, now, now)
    beat.end(5.0)  # not as late as the next 0 over a foreign value
    assert one.is_due(5.0)
    one.begin(5.0)
    one.end(5.5, Outcome.UNKNOWN)
    assert one.is_due(6.0)


@pytest.mark.parametrize('polling', POLLING_MODES)
def test_rule_19_own_values_are_never_taken_for_those_of_another(polling: str) -> None:
    cell = Cell(beat_row(100), speed_row(), make_mapping('N10:1', period=100), polling=polling)
    cell.publish(cell.bench.driver.mappings[1], 3, times=150)
    for number in range(8):
        cell.bench.at(2.0 + number, lambda number=number: setattr(  # type: ignore[misc]
            cell, 'is_late', number % 3 == 1))
        cell.bench.at(2.5 + number, lambda number=number: cell.refused.update(  # type: ignore
            {'N10:0'} if number % 2 else set()) or cell.refused.intersection_update(
                {'N10:0'} if number % 2 else set()))
    cell.run(15.0)
    assert cell.bench.listener.foreign == []
    assert cell.word('N10:0') > 3  # after each 0 it stands for half a second


def test_rule_19_0_of_a_new_contact_is_not_longer_for_an_earlier_foreign_value() -> None:
    beat = (one := OneBeat()).beat
    beat.begin(0.0)
    one.begin(0.0)
    one.end(0.1)
    assert beat.read_back(5, 0.1, 0.2)
    beat.begin(1.0, is_new=True)
    one.begin(1.0)
    one.end(1.1)
    assert one.look(1.1) == 1.1 + 0.5
