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

"""Guarded reads on a virtual line; the numbers are those of the rules in docs/heartbeats.md."""

from dataclasses import replace
from functools import partial

from abdf1_ros.driver.reads.guards import CounterGuard, RunGuard
from abdf1_ros.driver.reads.point import Freshness, ReadPoint
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity, Mode
from abdf1_ros.settings.heartbeats import While
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
import pytest
from support.driver_bench import DriverBench, store
from support.interlocks import beat_row, Cell
from support.mappings import make_mapping


def test_rule_13_run_guards_a_row() -> None:
    read, other = (make_mapping(f'N11:{number}', period=100, condition=While(('RUN',)))
                   for number in (0, 1))
    cell = Cell(read, other, run=3.0)
    assert len(cell.bench.listener.reads) > 20
    cell.plc.processor.setting = Setting.PROGRAM
    cell.run(1.0)
    since = cell.now
    point = cell.bench.driver.points[read]
    cell.run(2.0)
    assert [when for when in cell.bench.listener.times(read) if when >= since] == []
    assert {each.freshness(cell.now) for each in cell.bench.driver.points.values()} == {
        Freshness.WITHHELD}
    assert point.withheld.startswith('not in RUN: it is in ')
    assert cell.bench.listener.reasons[-1][1] == (
        'withheld: not in RUN: it is in REM PROG; so are all 2 rows that depend on it')
    cell.plc.processor.setting = Setting.RUN
    cell.run(2.0)
    assert point.freshness(cell.now) is Freshness.FRESH


def test_rule_13_answer_about_the_mode_is_no_older_than_the_stale_time() -> None:
    row = make_mapping('N11:0', condition=While(('RUN',)))
    guard = RunGuard()
    why_not = partial(guard.why_not, ReadPoint(row, 1.0, 3.0, guard))
    running = Identity(PlcType.SLC, 'SLC 5/03', mode=Mode.RUN, mode_text='RUN')
    assert why_not(9.0, 9.0) == 'not in RUN: its mode is not known'
    guard.told(running, 10.0)
    begun = 'it has begun to run during this read'
    assert [why_not(10.0, 10.5), why_not(10.5, 13.0)] == [begun, '']
    assert (guard.told(running, 13.0), why_not(10.5, 13.0)) == (set(), '')  # just in time
    assert why_not(13.0, 16.5) == 'it has not reported its mode for 3.5 s'
    guard.told(running, 16.5)  # nobody knows what it did in between
    assert [why_not(16.5, 16.6), why_not(16.6, 16.6)] == [begun, '']
    assert not guard.told(replace(running, faults=('bad RAM', 'low battery')), 20.0)
    assert why_not(20.5, 20.5) == 'not in RUN: it is in RUN, bad RAM; low battery'
    guard.told(Identity(None, '1785-KE'), 14.6)
    assert why_not(14.7, 14.7) == (
        'not in RUN: 1785-KE has no mode; does a gateway answer for the PLC?')
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
    assert (len(bench.listener.times(read)), bench.driver.spent) == (3, {})  # of messages


def test_rule_13_questions_for_the_modes_of_many_plcs_have_their_share_of_a_full_line() -> None:
    stations = range(11, 23)
    rows = [make_mapping('N11:0', period=300, station=station, condition=condition,
                         tag=f'row_{station}_{number}')
            for station in stations
            for number, condition in enumerate((None, While(('RUN',))))]
    bench = DriverBench(rows, network=Network(baud=9600))
    for station in stations:
        bench.plc(station, 'PLC5', ('N11:0', 1))
    bench.run(120.0)
    assert bench.listener.reasons == []
    planned = bench.driver.points[rows[0]].stale_time / DriverSettings().stale_after
    counts = {mapping: len(bench.listener.values(mapping)) for mapping in rows}
    assert min(counts.values()) > 120.0 / planned > 0.6 * max(counts.values())


def test_rule_13_guarded_rows_come_on_a_line_that_is_slower_than_their_stale_time() -> None:
    """A round of reads takes longer: they were withheld for ever, as each answer was too old."""
    guarded = [make_mapping(f'N{file}:0', period=1000, tag=f'guarded{file}',
                            condition=While(('RUN',))) for file in (20, 21)]
    others = [make_mapping(text, period=1000)  # the last is read with a guarded row
              for text in (*(f'N{file}:0' for file in range(30, 46)), 'N20:1')]
    bench = DriverBench([*others[:8], *guarded, *others[8:]], network=Network(baud=19200))
    plc = bench.plc(1, 'PLC5', *((f'N{row.address.file}:0', 2) for row in (*others, *guarded)))
    plc.faults.delay = 0.4
    begun = 30.0
    bench.run(begun + 60.0)
    cycle = bench.driver.readings.reads.poll_cycle
    assert cycle is not None
    assert cycle > 2 * max(bench.driver.points[row].stale_time for row in guarded)
    counts = {row: sum(when > begun for when in bench.listener.times(row))
              for row in (*guarded, *others)}
    assert min(counts.values()) >= 60.0 // cycle - 1 > 2
    plc.processor.setting = Setting.PROGRAM
    bench.run(cycle + 1.0)
    since = bench.clock()
    bench.run(3 * cycle)
    assert not [row for row in guarded if bench.listener.times(row)[-1] > since]


def counter_cell(words: int = 1) -> tuple[Cell, Mapping]:
    """Return a cell whose rows depend on a counter, which stands still."""
    counter, beside = (make_mapping(f'N11:{number}', tag=tag, period=50)
                       for number, tag in ((3, 'alive'), (4, 'beside')))
    read, other = (make_mapping('N7:0', length=words, period=100, tag=tag,
                                condition=While(('alive',), 500)) for tag in ('read', 'other'))
    return Cell(counter, beside, other, read), read


def count(cell: Cell, times: int, gap: float = 0.15, word: str = 'N11:3') -> None:
    """Let the PLC's program count."""
    for number in range(times):
        cell.bench.at(cell.now + number * gap,
                      lambda number=number: store(cell.plc, word, [number + 1]))  # type: ignore


def test_rule_14_counter_has_to_change_twice_before_anything_is_published() -> None:
    cell, read = counter_cell()
    count(cell, 20, word='N11:4')
    cell.run(3.0)
    assert cell.bench.listener.times(read) == []
    begun = cell.now
    count(cell, 20)
    cell.run(3.0)
    times = cell.bench.listener.times(read)
    assert times[0] > begun + 0.15
    points = cell.bench.driver.points.values()
    assert {each.freshness(cell.now) for each in points} == {Freshness.FRESH}
    ended = cell.now
    cell.run(3.0)
    times = cell.bench.listener.times(read)
    assert ended < times[-1] < ended + 0.65
    assert cell.bench.driver.points[read].withheld == 'alive has not changed twice within 0.5 s'


def test_rule_14_late_change_ends_what_two_in_time_have_permitted() -> None:
    row = make_mapping('N7:0', condition=While(('alive',), 500))
    guard = CounterGuard('alive')
    point = ReadPoint(row, 0.1, 3.0, guard)
    for number, now in enumerate((0.0, 0.5, 1.0)):
        guard.read(bytes((number,)), now)
        assert bool(guard.why_not(point, now + 0.5, now + 0.5)) is (number < 2)
    guard.read(b'x', 5.0)  # late, and nobody has asked meanwhile
    assert guard.why_not(point, 5.1, 5.1) == 'alive has not changed twice within 0.5 s'
    guard.read(b'y', 5.2)
    assert [guard.why_not(point, 5.2, 5.3), guard.why_not(point, 5.3, 5.3)] == [
        'alive has begun to change during this read', '']


def test_rule_14_counter_that_changes_between_two_packets_permits_the_next_read() -> None:
    cell, read = counter_cell(200)
    cell.run(1.0)
    job, = (job for job in cell.bench.driver.readings.reads.jobs if read in job.block.mappings)
    for number in (1, 2):
        cell.bench.run_until(lambda: job.is_unfinished)
        for address, count in (('N7:0', 200), ('N11:3', 1)):
            store(cell.plc, address, [number] * count)
        cell.run(0.3)
    values = cell.bench.listener.values(read)
    assert values and all(value == [2] * 200 for value in values)


def test_rule_15_row_is_withheld_or_has_failed() -> None:
    guard = RunGuard()
    point = ReadPoint(make_mapping('N11:0', condition=While(('RUN',))), 1.0, 3.0, guard)
    point.fail('no reply')
    for now in (0.0, 9.0):
        point.withhold('its mode is not known', now)
    assert (point.freshness(9.0), guard.withheld) == (Freshness.WITHHELD, {point})
    point.fail('no reply')
    assert (point.freshness(9.0), guard.withheld) == (Freshness.FAILED, set())
    point.withhold('its mode is not known', 9.5)
    assert (point.freshness(9.5), guard.withheld) == (Freshness.WITHHELD, {point})


@pytest.mark.parametrize(('condition', 'patience'), [
    (While(('RUN',)), 3.0), (While(('alive',), 9000), 9.0), (While(('alive',), 500), 0.5)])
def test_rule_14_start_is_waited_for_as_long_as_the_condition_allows(
        condition: While, patience: float) -> None:
    point = ReadPoint(make_mapping('N11:0', condition=condition), 1.0, 3.0)
    for now in (0.0, patience - 0.1, patience):
        assert point.withhold(f'silent for {now} s', now) is (now == patience)
        assert point.freshness(now).value[:8] == ('withheld' if now == patience else 'waiting ')


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
