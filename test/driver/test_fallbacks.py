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

"""Fallback values on a virtual line; the numbers are those of the rules in docs/heartbeats.md."""

from collections import Counter
import math
from random import Random

from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.kernel.fallback import FallbackCause, FallbackRow, FallbackState
from abdf1_ros.driver.kernel.flights import Flight, Flights, Words
from abdf1_ros.driver.kernel.gate import Rank
from abdf1_ros.driver.kernel.own import Conditions
from abdf1_ros.driver.kernel.plc import Plc
from abdf1_ros.driver.kernel.waiting import WaitingWrites
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.emulated import EmulatedProcessor, Setting
from abdf1_ros.pccc.identity import Mode
from abdf1_ros.plan.bounds import MODE_PERIOD
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
import pytest
from support.cases import for_all
from support.clock import StillClock
from support.driver_bench import DriverBench, store, stored
from support.interlocks import (
    AFTER,
    beat_row,
    Cell,
    end,
    FALLBACK,
    GuestCell,
    Line,
    RUN,
    speed_cell,
    speed_row,
    START,
    TIMEOUT,
)
from support.mappings import make_mapping
from support.own_rows import OneBeat, OneRow


@pytest.mark.parametrize(('begun', 'again'), [(1.5, 2.0), (2.0, math.inf)])
def test_rule_10_write_that_may_land_after_the_begin_of_a_fallback_has_it_written_again(
        begun: float, again: float) -> None:
    one = OneRow()
    one.message(0.5, 1.0, Outcome.UNKNOWN)  # may land until 2.0
    one.row.make_due(FallbackCause.TIMEOUT, begun)
    one.fallback(one.row.take(begun), begun + 1.0)
    assert one.row.again_at == again
    assert one.row.is_confirmed is (again == math.inf)
    assert one.is_due(begun + 1.0) is (again < math.inf)


@for_all(('is_guests', 'now', 'until'), [
    (False, 1.9, 2.0), (True, 1.9, 2.0), (True, 2.0, -math.inf)])
def test_rule_10_write_may_land_after_reloads_of_files_that_had_no_fallback_for_its_words(
        is_guests: bool, now: float, until: float) -> None:
    row, clock = speed_row(None), StillClock()
    before, between, after = (
        Flights(clock, 1.0, ActiveStationList()) for _ in range(3))
    flight = before.begin(1, [row.extent], None if is_guests else Write(row, [3], 0.0))
    clock.now = 1.0
    before.ended(flight, Outcome.UNKNOWN)
    before.ended(before.begin(1, [row.extent]), Outcome.WRITTEN)
    words, clock.now = after.words_of(speed_row()), now
    between.take_over(before)
    after.take_over(between)
    assert words.lands_until == until


def test_rule_19_each_value_of_ours_that_may_land_is_ours_after_reloads() -> None:
    clock = StillClock()
    before, after = (Flights(clock, 1.0, ActiveStationList()) for _ in range(2))
    row = beat_row()
    for value in (3, 0):
        write = Write(row, [value], 0.0, is_own=True)
        before.ended(before.begin(1, [row.extent], write), Outcome.UNKNOWN)
    words, others = (after.words_of(made) for made in (beat_row(), beat_row(address='N10:1')))
    after.take_over(before)
    assert [words.may_hold(value) for value in (3, 0, 4)] == [True, True, False]
    assert not others.may_hold(3)


@pytest.mark.parametrize('is_lost', [True, False])  # else it gives way to a machine of new files
def test_rule_10_write_that_ends_with_the_port_may_land_for_its_time_from_then_on(
        is_lost: bool) -> None:
    """A gateway says nothing and keeps a write, so nothing comes until the port is lost."""
    speed = speed_row(Fallback((7,), 600))
    bench = DriverBench([speed], network=Network(
        mode='Peer', baud=115200, timeout=100, cmd_timeout=500), start=False)
    plc = bench.plc(1, 'PLC5', ('N7:0', 20))
    serve, kept = plc.serve, list[Packet]()

    def keep(command: Packet) -> Packet | None:
        if not command.data.endswith(b'\x2a\0'):
            return serve(command)
        kept.append(command)
        return None

    plc.serve = keep  # type: ignore[assignment]
    bench.open(run=1.0)
    bench.write(speed, [42], run=0.45)
    if is_lost:
        bench.lose_port()
        bench.at(bench.clock() + 0.3, bench.open)
    else:
        bench.hand_over([speed])
    bench.at(bench.clock() + 0.99, lambda: serve(kept[0]))
    bench.run(1.2)
    assert len(kept) == 1
    assert stored(plc, 'N7:0') == b'\7\0'


@pytest.mark.parametrize(('processor', 'again'), [('ML1000', 1.0), ('5/03', math.inf)])
def test_rule_10_word_that_may_be_written_back_late_has_old_values_of_other_bits(
        processor: str, again: float) -> None:
    flights = Flights(clock := StillClock(), 1.0, ActiveStationList())
    row, other = (make_mapping(f'B3:0/{bit}', 'Write', plc='SLC', processor=processor)
                  for bit in range(2))
    words, flight = flights.words_of(row), flights.begin(1, [other.extent], Write(other, [1], 0.0))
    flights.ended(flight, Outcome.UNKNOWN)
    clock.now = 0.5
    ours = flights.begin(1, [row.extent], Write(row, [0], 0.5, is_own=True))
    flights.ended(ours, Outcome.WRITTEN)
    assert words.again_at() == again


def test_rule_11_only_the_first_try_over_a_guest_is_not_held_up_by_a_pause() -> None:
    row = (one := OneRow()).row
    row.make_due(FallbackCause.START, 0.0)
    assert one.is_due(0.0) and row.is_first_try
    one.fallback(row.take(0.0), 0.1)
    one.guest(1.0)
    assert one.is_due(1.0) and row.is_first_try
    one.begin(again := row.refresh(1.0))
    assert not one.is_due(1.1)
    one.fallback(again, 1.2, Outcome.UNKNOWN)
    assert one.is_due(1.2) and not row.is_first_try
    one.begin(again := row.refresh(2.0))
    row.make_due(FallbackCause.RUN, 2.1)  # a new PLC, maybe: what went out before is no answer
    assert one.fallback(again, 2.2) is None and row.why_held
    assert one.fallback(row.take(2.3), 2.4, Outcome.PARTLY) is None
    assert not one.is_due(2.5)  # after a refusal there is a pause


def test_rule_11_answered_write_of_a_guest_ends_the_pause() -> None:
    one = OneRow()
    plc = Plc(1, [one.row], ActiveStationList([1], probe_time=1.0), one.flights, Conditions())

    def ended(now: float, outcome: Outcome, write: Write | None = None) -> None:
        flight = Flight(1, [one.mapping.extent], write, now - 0.5)
        flight.end(outcome, now, 0.0)
        plc.write_ended(flight, now)

    one.row.make_due(FallbackCause.START, 0.0)
    own = one.row.take(0.0)
    one.fallback(own, 0.1, Outcome.UNKNOWN)
    plc.look_again()
    for _ in range(2):
        ended(0.1, Outcome.UNKNOWN, own)
    assert plc.rank(one.row, 0.2) is None
    assert plc.ready({}, 0.2) == [one.row]
    assert plc.next_due(math.inf) == 1.1
    ended(0.2, Outcome.WRITTEN)
    assert plc.next_due(math.inf) < 0.2
    ended(0.3, Outcome.UNKNOWN, own)  # one failure is no reason for a pause
    for write in None, Write(one.mapping, [3], 0.3):
        ended(0.3, Outcome.UNKNOWN, write)  # nor is one of a guest or a message
    assert plc.rank(one.row, 0.3) is not None
    one.fallback(one.row.take(0.4), 0.5)
    plc.pause_end = 9.0
    one.row.make_due(FallbackCause.RUN, 1.0)
    plc.look_again(one.row)
    assert plc.next_due(math.inf) < 9.0  # a first try does not wait for the end of a pause


def test_rule_5_waiting_row_of_a_silent_plc_hides_no_earlier_time() -> None:
    one, stations = OneRow(), ActiveStationList([1], probe_time=1.0)
    plc = Plc(1, [one.row], stations, one.flights, Conditions(ended=0.0))
    stations.lost(1, 0.0)
    plc.look_again()
    one.begin(one.row.take(1.0))
    plc.begins(one.row)
    assert plc.next_due(2.0) == 2.0
    assert plc.rank(one.row, 1.0) is None  # that was its try


def test_rule_11_first_tries_go_first_then_plcs_that_answer() -> None:
    one = OneRow()
    stations = ActiveStationList([1], probe_time=1.0)
    plc = Plc(1, [one.row], stations, one.flights, conditions := Conditions())
    one.row.make_due(FallbackCause.START, 0.0)
    stations.heard(1, 0.0)
    first = plc.rank(one.row, 0.0)
    own = one.row.take(0.0)
    one.fallback(own, 0.1, Outcome.FAILED)
    answers = plc.rank(one.row, 2.0)
    silent = Flight(1, [one.mapping.extent], own, 2.0)
    silent.end(Outcome.UNKNOWN, 2.1, 0.0)
    plc.write_ended(silent, 2.1)
    left_alone = plc.rank(one.row, 4.0)
    assert (first, answers, left_alone) == (
        (0, False, True), (1, 0, True, 0.0), (3, False, 1, 0.0))
    one.fallback(one.row.take(4.0), 4.1)
    one.row.make_due(FallbackCause.RUN, 5.0)
    one.fallback(one.row.take(5.0), 5.1, Outcome.UNKNOWN)
    assert plc.rank(one.row, 8.0) == (3, False, 1, 5.0)  # its first try again
    one.row.tries, plc.pause_end = 7, 99.0
    for conditions.is_paused in (False, True):
        assert bool(plc.rank(one.row, 8.0)) is conditions.is_ending
    conditions.is_paused = False
    stations.lost(1, 8.0)  # probes have a pause of their own
    assert plc.rank(one.row, 90.0) == (3, False, 3, 5.0)
    stations.heard(1, 91.0)
    plc.failures = 0
    one.now = 91.0
    one.flights.ended(one.flights.begin(1, None), Outcome.UNKNOWN)  # it may land until 92.0
    one.fallback(one.row.take(91.0), 91.1)
    for conditions.gave_way, conditions.is_beats_turn, least in (
            (91.5, False, 92.0), (92.5, False, 92.5), (92.5, True, 93.0)):
        assert plc.rank(one.row, 93.0) == (2, least, 91.0)


def test_rule_7_message_refreshes_from_its_own_time_when_it_is_confirmed() -> None:
    cell, speed = speed_cell()
    cell.bench.write(speed, [3], age=0.3)
    begun = cell.now
    cell.run(1.0)
    assert cell.written('N7:0') == [7, 3, 7]
    when = cell.writes[-1][0]
    assert begun - 0.3 + AFTER <= when < begun - 0.3 + AFTER + 0.05
    assert cell.results() == [START, 'written', TIMEOUT]


def test_rule_7_time_of_a_message_after_an_unconfirmed_fallback_counts_once() -> None:
    one = OneRow()
    one.row.make_due(FallbackCause.TIMEOUT, 1.0)
    one.fallback(one.row.take(1.0), 1.5, Outcome.UNKNOWN)
    for begun in 2.0, 2.2:
        one.message(begun, begun + 0.1, Outcome.UNKNOWN)
    assert [one.is_due(2.0 + AFTER + late) for late in (-0.1, 0.0)] == [False, True]
    one.fallback(one.row.take(2.5), 2.6, Outcome.UNKNOWN)
    for begun, outcome in (2.7, Outcome.UNKNOWN), (2.8, Outcome.WRITTEN):
        one.message(begun, begun, outcome)
    assert one.is_due(2.8)  # not later over a message of a PLC that is well again


@pytest.mark.parametrize('gap', [0.1, 0.002])  # s; slower, and faster, than transactions are
def test_rule_7_messages_that_the_plc_refuses_do_not_keep_an_output_alive(gap: float) -> None:
    cell, speed = speed_cell()
    cell.publish(speed, 3, run=0.1)
    cell.refused, cell.spared = {'N7:0'}, 7
    cell.publish(speed, 99, times=round(2.0 / gap), gap=gap, run=AFTER + 0.1)
    assert cell.word('N7:0') == 7
    assert cell.results().count(TIMEOUT) == 1
    cell.run(1.0)
    assert cell.results().count(TIMEOUT) == 1  # it stands, whatever is refused after it


def test_rule_7_fallback_waits_for_a_message_that_waits() -> None:
    cell, speed = speed_cell()
    cell.publish(speed, 3, run=0.1)
    plc, (row,) = cell.bench.driver.kernel.rows.plcs[1], cell.bench.driver.kernel.rows.fallbacks
    due = row.refreshed + AFTER
    assert plc.ready({speed: due - 0.1}, due) == []
    assert plc.next_due(math.inf) == due - 0.1 + AFTER
    plc.look_again()
    assert plc.ready({}, due) == [row]


def test_rule_7_fallback_waits_no_longer_for_a_message_that_has_expired(
        monkeypatch: pytest.MonkeyPatch) -> None:
    speed = speed_row(Fallback((7,), 2000))
    cell = Cell(speed, run=1.0, write_timeout=0.5)
    cell.publish(speed, 3, run=1.9)
    monkeypatch.setattr(WaitingWrites, 'first', lambda waiting, busy: None)
    cell.publish(speed, 4, run=0.2)
    assert cell.word('N7:0') == 3  # the fallback waits for it
    cell.run(0.35)
    assert cell.written('N7:0') == [7, 3, 7]
    assert cell.results()[-2:] == [
        'not written: not sent: waited longer than 0.5 s for the line', TIMEOUT]


def test_rule_7_fallback_waits_no_longer_for_a_message_that_an_unheard_connection_ends(
        monkeypatch: pytest.MonkeyPatch) -> None:
    speed = speed_row(Fallback((7,), 2000))
    cell = Cell(speed, make_mapping('N7:9'), run=1.0, may_store=True)
    cell.publish(speed, 3, run=1.9)
    monkeypatch.setattr(WaitingWrites, 'first', lambda waiting, busy: None)
    cell.publish(speed, 4, run=0.2)
    cell.bench.far.say = lambda data: b''
    cell.run(1.0)
    assert cell.written('N7:0') == [7, 3, 7]


def test_rule_7_message_that_is_older_than_fallback_after_is_not_sent() -> None:
    cell, speed = speed_cell()
    cell.bench.write(speed, [3], run=1.0, age=0.6)
    assert cell.written('N7:0') == [7]
    assert cell.results() == [
        START, 'not written: not sent: waited longer than 0.5 s for the line']


@for_all('beats', [(), (beat_row(),)])
def test_rule_8_change_to_run_is_a_first_contact(beats: tuple[Mapping, ...]) -> None:
    speed = speed_row(Fallback((7,), 60_000))
    cell = Cell(*beats, speed, run=1.0)
    cell.publish(speed, 3, run=1.0)
    cell.plc.processor.setting = Setting.PROGRAM
    cell.run(2 * MODE_PERIOD)
    since = cell.now
    cell.plc.processor.setting = Setting.RUN
    cell.run(2 * MODE_PERIOD)
    assert cell.written('N7:0') == [7, 3, 7]
    assert cell.results()[-1] == RUN
    after = [(name, value) for when, name, value in cell.writes if when >= since]
    contact = [('N10:0', 0), ('N7:0', 7), ('N10:0', 1)] if beats else [('N7:0', 7)]
    at = after.index(contact[0])
    assert after[at:at + len(contact)] == contact


def test_rule_8_end_of_a_fault_is_a_change_to_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(EmulatedProcessor, 'mode', Mode.RUN)  # where the key stays meanwhile
    cell, speed = speed_cell()
    cell.publish(speed, 3, run=1.0)
    for setting in (Setting.FAULT, Setting.RUN):
        cell.plc.processor.setting = setting
        cell.run(2 * MODE_PERIOD)
    assert cell.results()[-1] == RUN


def test_rule_8_change_to_run_while_a_fallback_is_under_way_has_it_written_again() -> None:
    row = (one := OneRow()).row
    row.make_due(FallbackCause.START, 0.0)
    one.begin(write := row.take(1.0))
    row.make_due(FallbackCause.RUN, 2.0)  # between two packets
    one.fallback(write, 3.0)
    assert row.cause is FallbackCause.START and one.is_due(3.0)
    row.make_due(FallbackCause.RUN, 3.1)  # none is under way: it is due since 2.0 all the same
    one.begin(write := row.take(3.2))
    one.guest(3.5)
    assert one.fallback(write, 4.0) == 2.0
    assert row.state is FallbackState.OVERWRITTEN
    one.fallback(row.refresh(4.0), 4.1, Outcome.FAILED)
    assert [one.is_due(now) for now in (5.0, 5.1)] == [False, True]


def test_rule_2_message_before_the_last_fallback_makes_no_row_fresh() -> None:
    speed = speed_row(Fallback((7,), 20_000))
    cell = Cell(beat_row(), speed, run=1.0)
    cell.publish(speed, 42, run=0.5)
    end(cell)
    store(cell.plc, 'N7:0', [1234])  # by another program, while the port is released
    cell.bench.driver.kernel.end.resume()
    since = cell.now
    cell.bench.open(run=1.0)
    assert cell.word('N7:0') == 7
    after = [(name, bool(value)) for when, name, value in cell.writes if when >= since]
    assert after.index(('N7:0', True)) < after.index(('N10:0', True))
    cell.publish(speed, 5, run=0.5)
    assert cell.results()[-1] == 'written'


@for_all('outcome', [Outcome.UNKNOWN, Outcome.PARTLY])
@for_all('is_overwritten', [False, True])
def test_rule_8_row_is_fresh_by_a_confirmed_message_only(
        outcome: Outcome, is_overwritten: bool) -> None:
    row = (one := OneRow()).row
    row.make_due(FallbackCause.START, 0.0)
    one.fallback(row.take(0.0), 0.1)
    if is_overwritten:
        one.guest(0.5)
    one.message(1.0, 1.0, outcome)  # counts once for the time that it stands (rule 7)
    assert row.deadline(-math.inf) == 1.0 + AFTER
    assert not row.is_fresh(1.1)
    one.message(1.2, 1.3, Outcome.WRITTEN)
    one.message(1.1, 1.4, Outcome.WRITTEN)  # of another publisher
    assert row.is_fresh(1.2 + AFTER - 0.001) and not row.is_fresh(1.2 + AFTER)
    one.guest(1.5)  # over a message, not over a fallback
    assert not row.why_held


def test_rule_4_message_asks_a_silent_plc_whose_fallback_is_not_due() -> None:
    speed = speed_row(Fallback((7,), 60_000))
    cell = Cell(speed, run=3.0)
    cell.publish(speed, 3, run=0.2)
    cell.plc.faults.silent = True
    cell.publish(speed, 4, run=0.8)
    cell.plc.faults.silent = False
    cell.publish(speed, 5, run=0.5)
    assert (cell.results()[-1], cell.word('N7:0')) == ('written', 5)


@pytest.mark.parametrize('silent', [0.4, 1.0])
def test_rule_8_plc_that_comes_back_with_an_old_word_has_its_fallback_first(silent: float) -> None:
    beat, speed = beat_row(), speed_row(Fallback((7,), 800))
    cell = Cell(beat, speed, run=3.0)
    cell.publish(speed, 3, run=0.2)
    cell.plc.faults.silent = True
    cell.run(silent)  # the station is lost after 0.4 s; the message is 0.6 or 1.2 s old
    cell.plc.faults.silent = False
    came_back = cell.now
    cell.run(3.0)
    last_3 = max(when for when, name, value in cell.writes if (name, value) == ('N7:0', 3))
    fallback = next(when for when, name, value in cell.writes
                    if (name, value) == ('N7:0', 7) and when > last_3)
    counts = [when for when, name, value in cell.writes
              if name == 'N10:0' and value and max(came_back, last_3 + 0.8) < when < fallback]
    assert counts == []


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


def test_rule_8_earliest_fallback_that_stands_of_a_station_that_is_not_busy_goes_first() -> None:
    stations = (1, 2, 3)
    line = Line([make_mapping('N7:0', 'Write', station=number, fallback=FALLBACK)
                 for number in stations], stations)
    line.run(4.0)
    kernel = line.driver.kernel
    for number, row in enumerate(kernel.rows.fallbacks, 1):
        assert row.trial is not None
        row.trial.done -= number
        kernel.rows.plcs[number].look_again(row)
    first, second = (kernel.next(9.0, Rank.REFRESH, busy) for busy in ({3}, set()))
    assert first is not None and first.flight.station == 2
    assert second is not None and second.flight.station == 3


@pytest.mark.parametrize(('event', 'waits'), [
    ('', False), ('message', True), ('message after a failure', False),
    ('write of its words', True), ('silence', True), ('late replies', True)])
@pytest.mark.parametrize(('after', 'put_off'), [(0.5, 0.5), (60.0, 5.0)])
def test_rule_8_fallback_that_stands_is_put_off(
        event: str, waits: bool, after: float, put_off: float) -> None:
    one, stations = OneRow(), ActiveStationList([1], probe_time=1.0)
    row, row.after = one.row, after
    plc = Plc(1, [row], stations, one.flights, Conditions())
    row.make_due(FallbackCause.START, 0.0)
    one.fallback(row.take(0.0), 1.0)
    row.has_failed = 'failure' in event
    if event == 'write of its words':
        one.flights.begin(1, [one.mapping.extent])
    elif event == 'silence':
        stations.lost(1, 2.0)
    stations[1].overdue = 2 * (event == 'late replies')
    youngest = {one.mapping: 5.0} if 'message' in event else {}
    plc.look_again()
    due = row.refresh_at
    assert plc.to_refresh(youngest, due + 0.25) is (None if waits else row)
    if waits:
        assert plc.refreshes.first == due + 0.25 + put_off


def test_rule_8_message_that_is_lost_with_the_port_is_not_waited_for() -> None:
    speed = speed_row(Fallback((7,), 5000))
    recipe = make_mapping('N7:1', 'Write', length=150)
    cell = Cell(speed, recipe, run=1.0)
    cell.publish(speed, 3, run=0.5)
    row, = cell.bench.driver.kernel.rows.fallbacks
    cell.run(3.0)
    hear, cell.bench.far.hear = cell.bench.far.hear, lambda data: b''
    cell.bench.write(recipe, [1] * 150)
    cell.bench.write(speed, [4])  # waits
    cell.run(0.1)
    assert row.look(cell.now, cell.now) > cell.now  # it is waited for
    cell.bench.lose_port()
    cell.bench.far.hear = hear
    cell.bench.open(run=row.refreshed + 5.0 - cell.now - 0.05)
    assert cell.word('N7:0') == 3
    cell.run(0.1)
    assert cell.word('N7:0') == 7


def test_rule_9_messages_that_wait_end_when_the_fallback_goes_out(
        monkeypatch: pytest.MonkeyPatch) -> None:
    speed = speed_row(Fallback((7,), 60_000))
    cell = Cell(speed, start=False)
    driver, run = cell.bench.driver, cell.bench.driver.link.run
    monkeypatch.setattr(driver.link, 'run', lambda source: (
        driver.write([speed], [3], 0.0), run(source))[1])
    cell.bench.open(run=1.0)
    assert cell.written('N7:0') == [7]
    assert cell.results() == ['not written: not sent: fallback', START]


@pytest.mark.parametrize(('after', 'results'), [
    (int(AFTER * 1000),
     ['only partly written: too old to be sent (after 1 of 2 packets were written)', TIMEOUT]),
    (20_000, ['written'])])
def test_rule_9_second_packet_of_a_message_is_not_sent_when_its_fallback_is_due(
        after: int, results: list[str]) -> None:
    speed = speed_row(Fallback((7,) * 200, after), length=200)
    cell = Cell(speed, run=1.0, write_timeout=AFTER)
    cell.bench.write(speed, [3] * 200, run=1.0, age=AFTER - 0.01)
    assert cell.results()[1:] == results


@for_all('station', [1, 255])
def test_rule_9_write_of_another_row_to_the_same_words_holds_up_for_its_own_time_only(
        station: int) -> None:
    recipe = make_mapping('N7:0', 'Write', station=station, length=200)  # of several packets
    speed = speed_row()
    cell = Cell(recipe, speed, run=1.0)
    cell.bench.write(speed, [3], run=AFTER - 0.01)
    assert cell.word('N7:0') == 3
    cell.bench.write(recipe, [4] * 200)  # under way when the fallback is due
    row, = cell.bench.driver.kernel.rows.fallbacks
    tasks = cell.bench.driver.tasks
    cell.bench.run_until(lambda: row.cause is not None and bool(tasks.under_way))
    assert cell.bench.driver.kernel.turns.next_due() > cell.now
    cell.run(0.5)
    assert cell.results()[-1] == TIMEOUT
    assert cell.word('N7:0') == 7


def test_rule_9_fallbacks_that_became_due_during_a_write_follow_it_together() -> None:
    flights = (one := OneRow()).flights
    rows = [one.row, FallbackRow(flights.words_of(speed_row(address='N7:1')), Conditions())]
    plc = Plc(1, rows, ActiveStationList([1], probe_time=1.0), flights, Conditions())
    flight = flights.begin(1, [make_mapping('N7:0', length=2).extent])
    for now, row in enumerate(rows):
        row.make_due(FallbackCause.TIMEOUT, now)
        plc.look_again(row)
        assert plc.ready({}, now) == []
    flights.ended(flight, Outcome.WRITTEN)
    plc.look_again()
    assert plc.ready({}, 2.0) == rows


@pytest.mark.parametrize('polling', ['Message', 'Standard'])  # here a station is often busy
def test_rule_11_eighth_turn_is_a_read_where_fallbacks_have_several_packets(polling: str) -> None:
    rows = [speed_row(Fallback((7,) * 200, 2000), f'N2{number}:0', f'w{number}', 200)
            for number in range(5)]
    bench = DriverBench([*rows, make_mapping('N9:0', period=1)], start=False,
                        network=Network(baud=115200, timeout=200, polling=polling))
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


def test_rule_10_after_an_unknown_write_it_is_written_once_more() -> None:
    cell, speed = speed_cell()
    say, cell.bench.far.say = cell.bench.far.say, lambda data: b''
    cell.publish(speed, 3, run=0.05)
    cell.run(0.5)
    cell.bench.far.say = say
    cell.run(15.0)
    assert cell.written('N7:0')[:5] == [7, 3, 7, 7, 7]  # unconfirmed, as a probe, once more
    unknown, *_, second = [when for when, name, value in cell.writes if name == 'N7:0'][1:5]
    # The message ended when station 1 had not answered its two frames of 0.2 s each.
    assert second == pytest.approx(unknown + 2 * 0.2 + 2 * 0.5, abs=0.05)
    assert len([result for result in cell.results() if result.startswith('fallback')]) == 2
    assert cell.bench.listener.reasons == []  # no PLC has refused it


def test_rule_10_plc_that_answers_has_its_fallback_before_those_that_do_not() -> None:
    stations = range(11, 19)
    rows = [make_mapping('N10:0', 'Heartbeat', station=number, tag=f'beat{number}', period=500)
            for number in stations]
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


@for_all(('outcome', 'done', 'again'), [
    (Outcome.PARTLY, 1.9, True), (Outcome.UNKNOWN, 1.9, True), (Outcome.FAILED, 1.9, False),
    (Outcome.UNKNOWN, 1.0, False)])  # nothing can land any more
def test_rule_10_once_more_after_a_message_that_may_have_been_written(
        outcome: Outcome, done: float, again: bool) -> None:
    one = OneRow()
    row = one.row
    one.message(1.0, done, outcome)
    assert one.is_due(2.0)
    assert one.fallback(row.take(2.0), 2.1) is not None
    assert one.is_due(2.8) is False
    assert one.is_due(2.9) is again  # 2 x Cmd_Timeout after the message ended
    assert one.is_due(60.0) is again


@for_all(('is_known', 'done', 'is_again'), [  # the words of its command; others are hardly these
    (True, 0.1, True), (False, 0.1, False), (True, 0.0, False)])  # 0.0: ours began just after it
def test_rule_8_0_that_a_guest_may_have_written_over_meanwhile_is_written_once_more(
        is_known: bool, done: float, is_again: bool) -> None:
    beat = (one := OneBeat()).beat
    beat.begin(0.0, is_new=True)
    one.begin(0.0)
    guest = Flight(1, [one.mapping.extent] if is_known else None)
    guest.end(Outcome.UNKNOWN, done, 1.0)
    beat.words.ended(guest)
    one.end(0.2)
    assert one.is_due(0.2) is is_again
    assert beat.is_first_try is is_again


def test_rule_10_heartbeat_counts_after_a_0_that_is_written_once_more() -> None:
    beat = (one := OneBeat()).beat
    one.flights.ended(one.flights.begin(1, None), Outcome.UNKNOWN)  # it may land until 1.0
    beat.begin(0.1, is_new=True)
    for now, outcome in ((0.1, Outcome.WRITTEN), (1.0, Outcome.UNKNOWN), (1.2, Outcome.WRITTEN)):
        assert one.is_due(now, 'not yet')
        assert one.begin(now).value == '[0]'
        one.end(now + 0.1, outcome)
    assert not beat.read_back(5, 1.29, 1.4)  # that read began before the 0 was confirmed
    assert not one.is_due(1.7)  # the 0 stands for half a second
    assert one.is_due(1.85)
    assert one.begin(1.85).value == '[1]' and beat.tries == 4
    assert not one.is_due(9.0)  # under way
    one.end(9.0)
    assert beat.read_back(5, 9.0, 9.0).endswith('probably a download')
    one.begin(9.0)
    one.end(9.0)
    assert one.look(9.0) == 9.0 + 0.5 + 0.2 * Random(0).randint(1, 7)  # unlike another bridge


def test_rule_10_0_is_written_once_more_also_where_the_heartbeat_may_count_by_then() -> None:
    one = OneBeat(5000, cmd_timeout=1.0)
    one.beat.begin(0.0, is_new=True)
    for begun, why in (0.0, ''), (5.2, ''), (6.0, 'no message'):  # 0, a number, and 0 again
        assert one.is_due(begun, why)
        one.begin(begun)
        one.flights.ended(one.flights.begin(1, None), Outcome.UNKNOWN)  # may land for 2 s
        one.end(begun + 0.1)
    assert [one.is_due(now) for now in (6.5, 7.9, 8.0)] == [False, False, True]


def test_rule_10_why_the_plc_refuses_is_told_once() -> None:
    cell = Cell(beat_row(), speed_row())
    cell.refused = {'N7:0', 'N10:0'}
    cell.run(5.0)
    reasons = cell.bench.listener.reasons
    assert sorted(address for address, _ in reasons) == ['N10:0', 'N7:0']
    assert all(reason.startswith('not written: STS 10: ') for _, reason in reasons)
    own = cell.bench.driver.kernel.rows
    assert own.fallbacks[0].refusal.startswith('STS 10: ')
    cell.refused = set()
    cell.run(2.0)
    assert [own.fallbacks[0].refusal, own.heartbeats[0].refusal] == ['', '']


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


def test_rule_8_messages_go_before_fallbacks_that_stand_where_nothing_is_read() -> None:
    rows = [speed_row(Fallback((7,), 5000), f'N7:{number}', f'w{number}') for number in range(14)]
    bench = DriverBench(rows, network=Network(baud=1200, timeout=300))
    bench.plc(1, 'PLC5', ('N7:0', 14))
    bench.run(12.0)
    for _ in range(9):
        bench.write(rows[0], [3], run=2.7)
    assert bench.listener.outcomes()[14:] == [Outcome.WRITTEN] * 9


def test_rule_8_packets_of_a_fallback_that_stands_wait_for_reads_in_most_cases(
        monkeypatch: pytest.MonkeyPatch) -> None:
    lamps = make_mapping('B3:0/0', 'Write', plc='SLC', length=320,
                         fallback=Fallback((0,) * 320, 2000))
    bench = DriverBench([lamps, make_mapping('B3:99', plc='SLC', period=0)])
    bench.plc(1, 'SLC', ('B3:0', 100))
    row, = bench.driver.kernel.rows.fallbacks

    def again(words: Words, ended: float) -> float:
        return 0.0 if row.is_under_way else math.inf

    for begin, reads in ((lambda: None), 18), ((lambda: bench.write(lamps, [1] * 320)), 2), (
            (lambda: monkeypatch.setattr(Words, 'again_at', again)), 2):
        bench.run_until(lambda: row.stands and row.is_under_way)
        count = len(bench.listener.reads)
        begin()
        bench.run_until(lambda: not row.is_under_way)
        assert len(bench.listener.reads) - count == reads


@pytest.mark.parametrize(('outcome', 'next_refresh'), [
    (Outcome.WRITTEN, 12.0), (Outcome.UNKNOWN, 8.0), (Outcome.FAILED, 8.0)])
def test_rule_10_refresh_is_not_the_second_write(outcome: Outcome, next_refresh: float) -> None:
    one = OneRow(cmd_timeout=4.0)
    row = one.row
    one.message(1.0, 2.0, Outcome.UNKNOWN)
    assert one.is_due(2.0)
    one.fallback(row.take(2.0), 2.0)
    one.fallback(row.refresh(7.0), 7.0, outcome)
    assert row.look(7.0, -math.inf) == 10.0
    assert row.refresh_at == next_refresh
    one.fallback(row.take(10.0), 10.5, Outcome.UNKNOWN)  # nor is it tried all the time
    assert row.look(10.5, -math.inf) == 11.5


def test_rule_10_first_try_is_not_held_up_by_the_pause_of_another_row() -> None:
    speeds = [make_mapping(f'N7:{2 * number}', 'Write', tag=f'speed{number}', via=7,
                           fallback=Fallback((7,), 500 + 100 * number)) for number in range(2)]
    for offset in range(10):  # the pauses begin with the retries, a second before they end
        cell = Cell(*speeds, start=False)
        cell.put_behind_gateway(run=7.0 + 0.1 * offset)
        for speed in speeds:
            cell.bench.write(speed, [5], run=0.1)
        _, second = cell.bench.driver.kernel.rows.fallbacks
        cell.is_undelivered = lambda command: command.data[7:8] == b'\0'
        cell.bench.run_until(lambda row=second: row.sent > row.refreshed)
        assert second.sent < second.refreshed + second.after + 0.15


def test_rule_10_pause_of_this_process_is_no_pause_of_a_gateway() -> None:
    speed = make_mapping('N7:0', 'Write', tag='speed', fallback=FALLBACK, via=7)
    cell = Cell(speed, start=False)
    cell.put_behind_gateway(run=6.0)
    cell.publish(speed, 42, run=0.1)
    row, = cell.bench.driver.kernel.rows.fallbacks
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
    line.write(speed, [42], run=0.1)
    line.far_stations[1].faults.silent = True
    line.run(4.0)
    line.run_until(lambda: any(task.station == 2 for task in line.driver.tasks.under_way))
    line.line.pause(line.driver.machine, 600.0)
    line.far_stations[1].faults.silent = False
    asked = len(line.asked)
    line.run(603.0)
    assert (2, 0) in [(station, word) for _, station, word in line.asked[asked:]]
    assert line.driver.stations[2].active


def test_rule_11_first_tries_at_a_silent_plc_and_reads_take_turns_on_a_full_line() -> None:
    speeds = [make_mapping(f'N7:{number}', 'Write', tag=f'speed{number}', fallback=FALLBACK)
              for number in range(3)]
    line = Line([*speeds, read := make_mapping('N7:0', station=2, period=0)], (1, 2))
    line.run(1.0)
    for speed in speeds:
        line.write(speed, [3])
    line.run(0.3)
    line.far_stations[0].faults.silent = True
    line.run(2.0)
    assert all(row.sent > row.refreshed for row in line.driver.kernel.rows.fallbacks)
    first, second, _ = sorted(row.sent for row in line.driver.kernel.rows.fallbacks)
    assert any(first < when <= second for when in line.listener.times(read))


def test_rule_11_heartbeat_of_a_living_plc_goes_between_packets_for_a_silent_one() -> None:
    lamps = make_mapping('N7:0/0', 'Write', length=320, fallback=Fallback((0,) * 320, 2000))
    line = Line([lamps, make_mapping('N7:30', 'Heartbeat', station=2, period=200)], (1, 2))
    line.run(1.0)
    line.write(lamps, [1] * 320, run=1.0)
    line.far_stations[0].faults.silent = True
    line.run(6.0)
    beats = [when for when, _, word in line.asked if word == 30]
    assert max(map(float.__sub__, beats[1:], beats)) < 0.7


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
    bench.driver.expire(bench.clock())
    assert bench.driver.served.words_of(row) == b'\7\0'
    assert bench.listener.results[-1].outcome is Outcome.NOT_SENT


@pytest.mark.parametrize(('ours', 'theirs'), [(5, 255), (1, 1)])
def test_rule_12_fallback_of_a_serve_row_goes_into_our_own_table(ours: int, theirs: int) -> None:
    served = make_mapping('N7:0', 'Serve', station=ours, fallback=FALLBACK)
    plain = make_mapping('N9:1', 'Serve', station=ours)
    other = make_mapping('N7:2', 'Serve', station=ours, fallback=Fallback((8,), 60_000))
    cell = GuestCell(served, plain, other, make_mapping('N7:0', 'Write', station=theirs), run=0.1)
    words = cell.bench.driver.served.words_of
    assert words(served) == b'\7\0'
    cell.publish(served, 3, run=0.2)
    cell.ask('N7:0', 99, theirs)  # words of a PLC with the same address
    cell.run(0.1)
    assert words(served) == b'\3\0'
    cell.run(0.3)
    assert words(served) == b'\7\0'
    assert cell.results() == [START, START, 'written', TIMEOUT]
    for row in (served, plain, other):
        cell.publish(row, 3, run=0.01)
    cell.bench.driver.kernel.forget_served()
    assert words(served) + words(plain) + words(other) == b'\7\0\0\0\x08\0'
    cell.publish(other, 3, run=0.01)
    cell.bench.driver.kernel.end.wind_down()
    cell.bench.line.wake(cell.bench.driver.machine)
    assert words(other) == b'\x08\0'  # at the end at once


def test_rule_12_fallback_of_a_serve_row_is_stored_once_when_it_is_due(
        monkeypatch: pytest.MonkeyPatch) -> None:
    bench = DriverBench([make_mapping('N7:0', 'Serve', station=0, fallback=FALLBACK)],
                        start=False)
    stored: list[object] = []
    monkeypatch.setattr(bench.driver.served, 'store', lambda row, values: stored.append(values))
    bench.open(run=3.0)
    assert len(stored) == 1


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
    assert 3.0 < result.latency < 5.0


def test_rule_18_read_only_writes_nothing() -> None:
    cell = Cell(beat_row(), speed_row(), read_only=True, run=3.0)
    assert cell.writes == cell.bench.driver.readings.blocks == []
    assert cell.bench.driver.kernel.end.is_over
