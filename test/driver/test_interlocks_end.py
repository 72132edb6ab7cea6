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

"""The orderly end of a bridge on a virtual line: rule 5 of docs/heartbeats.md."""

from dataclasses import replace
import math

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.kernel.gate import Rank
from abdf1_ros.driver.kernel.kernel import Kernel
from abdf1_ros.driver.write import Write
from abdf1_ros.driver.writes.jobs import WriteJob
from abdf1_ros.settings.heartbeats import Fallback, LAST_ANSWER
from abdf1_ros.settings.mapping import Mapping
import pytest
from support.driver_bench import store
from support.interlocks import beat_row, Cell, END, end, FALLBACK, Line, speed_row
from support.mappings import make_mapping


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


def test_rule_5_orderly_end_is_0_then_the_fallbacks() -> None:
    speed = speed_row()
    cell = Cell(beat_row(), speed)
    cell.publish(speed, 3, times=20, run=1.95)
    since = cell.now
    driver = cell.bench.driver
    assert not driver.kernel.end.is_over
    driver.kernel.end.wind_down()
    cell.bench.line.wake(driver.machine)
    cell.bench.write(speed, [4], run=0.3)
    assert [(name, value) for when, name, value in cell.writes if when >= since] == [
        ('N10:0', 0), ('N7:0', 7)]
    assert driver.kernel.end.is_over
    assert driver.kernel.end.unconfirmed(cell.now) == []
    assert cell.results()[-2:] == ['not written: refused: this node ends', END]


@pytest.mark.parametrize('moment', [
    'waits', 'on the line', 'executed', 'after a fallback under way', 'after a refresh under way'])
def test_rule_5_message_does_not_outlive_the_end(moment: str) -> None:
    speed = speed_row()
    cell = Cell(beat_row(), speed, run=1.95)
    driver = cell.bench.driver
    row, = driver.kernel.rows.fallbacks
    if moment == 'after a fallback under way':
        cell.publish(speed, 3, run=0.1)
    if 'under way' in moment:
        cell.bench.run_until(lambda: row.is_under_way)
        assert row.stands is ('refresh' in moment)
        cell.run(0.001)
    cell.bench.write(speed, [42])
    if 'under way' in moment:
        driver.expire(cell.now)
    if moment == 'executed':
        cell.bench.run_until(lambda: cell.word('N7:0') == 42)
    elif moment == 'on the line':
        cell.bench.run_until(lambda: any(
            isinstance(job, WriteJob) and not job.is_own for job in driver.tasks.under_way))
        assert cell.word('N7:0') == 7
    end(cell, 0.3)
    assert (cell.word('N10:0'), cell.word('N7:0')) == (0, 7)
    assert driver.kernel.end.unconfirmed(cell.now) == []


@pytest.mark.parametrize('event', ['end', 'RUN', 'port'])
def test_rules_5_and_8_message_over_a_fallback_that_is_due_puts_none_off(event: str) -> None:
    speed = speed_row(Fallback((7,), 20_000))
    cell = Cell(beat_row(), speed, start=False)
    cell.refused, cell.spared = {'N7:0'}, 42
    cell.bench.open()
    cell.run(0.3)  # refused once
    cell.is_late = True
    cell.bench.write(speed, [42])  # carried out, and nobody knows
    cell.bench.run_until(lambda: cell.bench.driver.kernel.rows.fallbacks[0].has_failed)
    cell.is_late, cell.refused = False, set()
    assert cell.word('N7:0') == 42
    if event == 'end':
        end(cell)
    elif event == 'RUN':
        for is_running in (False, True):
            cell.bench.driver.kernel.mode_seen(1, cell.now, is_running=is_running)
    else:
        cell.bench.lose_port()
        cell.bench.open()
    cell.run(0.2)
    assert cell.word('N7:0') == 7


@pytest.mark.parametrize('is_followed', [False, True])
def test_rule_5_end_waits_for_the_second_write_of_rule_10(is_followed: bool) -> None:
    """A gateway delivers 0.9 s later what it has called undelivered; another PLC dies then."""
    speed = make_mapping('N7:0', 'Write', tag='speed', fallback=FALLBACK, via=7)
    cell = Cell(speed, make_mapping('N7:9', station=2, period=20), start=False)
    faults = cell.bench.plc(2, 'PLC5', ('N7:0', 20)).faults
    cell.put_behind_gateway(run=6.0)

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
    cell.bench.at(cell.now + 0.9, lambda: setattr(faults, 'silent', True))
    end(cell, 1.05)
    assert cell.word('N7:0') == 7


def test_rule_5_end_of_a_plc_that_never_answered_has_one_whole_try_of_each_row() -> None:
    cell = Cell(beat_row(), speed_row(), start=False)
    cell.plc.faults.silent = True
    cell.bench.open(run=5.0)
    sent = cell.bench.driver.counters.commands_sent
    end(cell, 5.0)
    assert cell.bench.driver.counters.commands_sent == sent + 2


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
    cell.bench.open(run=1.0)
    cell.publish(speed, 42, times=20, run=1.95)
    cell.plc.faults.silent = True
    cell.bench.at(cell.now + 1.0, lambda: setattr(cell.plc.faults, 'silent', False))
    cell.bench.driver.kernel.end.wind_down()
    cell.bench.line.wake(cell.bench.driver.machine)
    cell.run(1.5)
    assert (cell.word('N10:0'), cell.word('N7:0')) == (0, 7)


def test_rule_5_end_asks_a_silent_plc_too_where_another_has_its_own_rows() -> None:
    rows = [make_mapping('N7:0', 'Write', station=number, tag=f'speed{number}',
                         fallback=Fallback((7,), 5000)) for number in (1, 2)]
    line = Line([*rows, make_mapping('N7:9')], (1, 2))
    line.run(1.0)
    for row in rows:
        line.write(row, [3], run=0.1)
    line.far_stations[0].faults.silent = True
    line.run(1.0)
    line.driver.kernel.end.wind_down()
    line.line.wake(line.driver.machine)
    line.run_until(lambda: line.driver.kernel.end.is_over, 2.0)
    assert line.driver.kernel.end.unconfirmed(line.clock()) == ['speed1']


@pytest.mark.parametrize(('ends', 'is_silent', 'answer_within'), [
    (False, True, math.inf), (True, False, math.inf), (True, True, LAST_ANSWER)])
def test_rule_5_last_try_at_a_silent_plc_is_short(
        ends: bool, is_silent: bool, answer_within: float) -> None:
    driver = Cell(speed_row(), start=False).bench.driver
    driver.kernel.opened(0.0)
    if is_silent:
        driver.stations.lost(1, 0.0)
    assert driver.kernel.rows.is_put_off(Write(driver.mappings[0], [3], 0.0)) is is_silent
    if ends:
        driver.kernel.end.wind_down()
    job = driver.kernel.next(0.0, Rank.OWN)
    assert job is not None and (job.is_free, job.answer_within) == (True, answer_within)


def test_rule_5_silent_plc_is_not_due_at_the_end_while_another_has_not_answered() -> None:
    rows = speed_row(), make_mapping('N7:0', 'Write', station=2, fallback=FALLBACK)
    driver = Cell(*rows, start=False).bench.driver
    driver.kernel.opened(0.0)
    driver.stations.lost(2, 0.0)
    driver.kernel.end.wind_down()
    assert [turn and turn.flight.station for turn in (
        driver.kernel.next(0.0, Rank.OWN), driver.kernel.next(0.0, Rank.OWN))] == [1, None]
    assert driver.kernel.turns.next_due() == math.inf


def test_rule_5_plc_that_has_just_left_a_command_unanswered_goes_last_at_the_end() -> None:
    """Two waits for it would take all the time of ~/polling and ~/reload."""
    rows = speed_row(), make_mapping('N7:0', 'Write', station=2, fallback=FALLBACK)
    driver = Cell(*rows, start=False).bench.driver
    driver.kernel.opened(0.0)
    driver.stations[1].unanswered = 1
    driver.kernel.end.wind_down()
    first = driver.kernel.next(0.0, Rank.OWN)
    assert first is not None and first.flight.station == 2


def test_rule_5_what_was_not_confirmed_at_the_end_is_named() -> None:
    cell = Cell(beat_row(), speed_row(), start=False)
    assert cell.bench.driver.kernel.end.unconfirmed(cell.now) == ['beat', 'speed']
    cell.bench.open(run=1.0)
    cell.refused = {'N10:0'}
    cell.bench.driver.kernel.end.wind_down()
    cell.bench.line.wake(cell.bench.driver.machine)
    cell.run(2.0)
    assert not cell.bench.driver.kernel.end.is_over
    assert cell.bench.driver.kernel.end.unconfirmed(cell.now) == ['beat']


def begin_end(cell: Cell) -> Kernel:
    """Begin an orderly end."""
    driver = cell.bench.driver
    driver.kernel.end.wind_down()
    cell.bench.line.wake(driver.machine)
    return driver.kernel


@pytest.mark.parametrize('beats', [(beat_row(),), ()])
@pytest.mark.parametrize('is_lost_first', [True, False])
def test_rule_5_end_waits_for_a_lost_port_and_writes_what_it_can_when_it_is_back(
        beats: tuple[Mapping, ...], is_lost_first: bool) -> None:
    speed, other = speed_row(Fallback((7,), 20_000)), speed_row(address='N10:5', tag='other')
    cell = Cell(*beats, speed, other, run=1.95)
    cell.publish(speed, 42, run=0.2)
    if is_lost_first:
        cell.bench.lose_port()
        interlocks = begin_end(cell)
    else:
        interlocks = begin_end(cell)
        cell.bench.run_until(lambda: any(row.is_under_way for row in interlocks.rows.fallbacks))
        cell.bench.lose_port()
    tags = ['beat', 'speed'] if is_lost_first and beats else ['speed']
    assert interlocks.end.unconfirmed(cell.now) == tags
    assert interlocks.end.has_to_wait(is_open=False)
    cell.run(1.0)
    store(cell.plc, 'N10:5', [99])  # another program has the adapter for a moment
    cell.bench.open()
    since = cell.now
    while interlocks.end.has_to_wait(is_open=True):
        assert cell.now < since + 1.0
        cell.run(0.005)
    assert (cell.word('N10:0'), cell.word('N7:0'), cell.word('N10:5')) == (0, 7, 7)
    assert (interlocks.end.unconfirmed(cell.now), interlocks.end.not_repeated()) == ([], [])
    assert not interlocks.end.has_to_wait(is_open=False)


def test_rule_5_end_does_not_wait_for_a_lost_port_where_no_command_of_ours_may_stand() -> None:
    speed, other = speed_row(Fallback((7,), 20_000)), speed_row(tag='other', address='N10:5')
    cell = Cell(speed, other, start=False)
    interlocks = cell.bench.driver.kernel
    interlocks.end.wind_down()
    assert interlocks.end.unconfirmed(0.0) == ['speed', 'other']
    assert not interlocks.end.has_to_wait(is_open=False)  # nothing has gone out
    interlocks.end.resume()
    cell.bench.open(run=1.0)
    cell.bench.lose_port()
    interlocks.end.wind_down()
    assert not interlocks.end.has_to_wait(is_open=False)  # all are safe
    assert (interlocks.end.unconfirmed(cell.now), interlocks.end.not_repeated()) == (
        [], ['speed', 'other'])
    interlocks.end.resume()
    cell.bench.open(run=1.0)
    cell.publish(speed, 42, run=0.1)
    cell.bench.lose_port()
    interlocks.end.wind_down()
    assert interlocks.end.has_to_wait(is_open=False)
    assert not interlocks.end.has_to_wait(is_open=False, is_meant=lambda row: row is other)
    cell.bench.driver.take_over(cell.bench.driver)
    after = Cell(speed, other, start=False).bench.driver  # of new files, on the lost port
    assert not after.kernel.end.has_to_wait(is_open=False)
    after.take_over(cell.bench.driver)
    assert after.kernel.end.has_to_wait(is_open=False)


def test_rule_5_what_stands_is_written_once_more_at_the_end_after_all_else() -> None:
    rows = [speed_row(tag=f'speed{number}', address=f'N7:{number}') for number in range(3)]
    beat, beats = beat_row(requires=('speed0',), timeout=60_000), beat_row(address='N10:1')
    cell = Cell(beat, replace(beats, tag='beats'), *rows, run=1.95)
    cell.publish(rows[1], 42, run=0.1)
    store(cell.plc, 'N7:0', [98])  # by other programs, and not read since
    store(cell.plc, 'N7:2', [99])
    store(cell.plc, 'N10:0', [5000])
    asked, serve = list[int](), cell.plc.serve

    def keep(command: Packet) -> Packet:
        if command.data[:1] == b'\x67':
            asked.append(100 * command.data[6] + command.data[7])
        return serve(command)

    cell.plc.serve = keep  # type: ignore[method-assign]
    end(cell)
    assert [cell.word(f'N7:{number}') for number in range(3)] == [7, 7, 7]
    assert (cell.word('N10:0'), cell.word('N10:1')) == (0, 0)
    assert asked == [1001, 701, 1000, 700, 702]
    assert cell.results()[-1] == END and cell.results().count(END) == 1


@pytest.mark.parametrize('text', ['N7:0', 'N10:0'])
def test_rule_5_what_was_under_way_when_the_end_began_is_written_once_more(text: str) -> None:
    cell = Cell(beat_row() if text == 'N10:0' else speed_row(), start=False)
    store(cell.plc, text, [99])
    cell.bench.open()
    cell.bench.run_until(lambda: cell.word(text) != 99)  # its reply is not here yet
    interlocks = begin_end(cell)
    store(cell.plc, text, [98])
    while interlocks.end.has_to_wait(is_open=True):
        assert cell.now < 2.0
        cell.run(0.005)
    assert cell.word(text) == (0 if text == 'N10:0' else 7)
    assert (interlocks.end.unconfirmed(cell.now), interlocks.end.not_repeated()) == ([], [])


@pytest.mark.parametrize('fault', ['refused', 'silent', 'no answer'])
def test_rule_5_what_stands_has_one_try_and_is_named_where_it_is_not_written_again(
        fault: str) -> None:
    cell = Cell(beat_row(requires=('speed',), timeout=300), speed_row(), run=1.95)
    if fault == 'refused':
        cell.refused = {'N7:0', 'N10:0'}
    elif fault == 'silent':
        cell.plc.faults.silent = True
        cell.bench.driver.stations.lost(1, cell.now)
    else:
        cell.is_late = True
    interlocks, since = begin_end(cell), cell.now
    while interlocks.end.has_to_wait(is_open=True):
        assert cell.now < since + 2.0
        cell.run(0.005)
    assert (interlocks.end.unconfirmed(cell.now), interlocks.end.not_repeated()) == (
        [], ['beat', 'speed'])
    assert cell.refusals == (2 if fault == 'refused' else 0)


def test_rule_5_final_end_outlives_requests_and_new_files() -> None:
    speed = speed_row(Fallback((7,), 20_000))
    cell = Cell(speed, start=False)
    cell.bench.open(run=1.0)
    cell.publish(speed, 42, run=0.1)
    paused = cell.bench.driver.kernel.end
    paused.wind_down()
    cell.bench.hand_over([speed])
    assert not cell.bench.driver.kernel.end.is_asked  # new files are a start
    cell.run(1.0)
    final = cell.bench.driver.kernel.end
    final.wind_down(is_final=True)
    final.resume()
    assert final.is_asked
    cell.bench.hand_over([speed])
    cell.publish(speed, 43, run=1.0)
    assert cell.bench.driver.kernel.end.is_over
    assert cell.word('N7:0') == 7
