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

"""What heartbeats and fallbacks promise; the numbers in the names are those of the rules."""

from dataclasses import replace
import math

from abdf1_ros.df1.frames import MAX_LINK_DATA
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.plan.bounds import (
    conditions,
    guard_faults,
    MODE_PERIOD,
    mode_periods,
    own_work,
    remarks,
    Times,
)
from abdf1_ros.plan.forecast import line_model
from abdf1_ros.plan.planner import Planner
from abdf1_ros.plan.report import make_report
from abdf1_ros.settings.heartbeats import Fallback, LONGEST_END, While
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
from abdf1_ros.text import milliseconds
import pytest
from support.cases import for_all
from support.counting import lines_run
from support.driver_bench import DriverBench, store, stored
from support.mappings import make_mapping

QUICK = Network(timeout=200, cmd_timeout=500, nak_retries=1, enq_retries=1, baud=19200)
QUIET = 0.02 + 10 * 10 / 19200


def beat(period: int = 1000, tag: str = 'beat') -> Mapping:
    """Return a Heartbeat row."""
    return make_mapping('N10:0', 'Heartbeat', tag=tag, period=period)


def speed(after: int = 3000, command: str = 'Write', station: int = 1) -> Mapping:
    """Return a row with Fallback."""
    return make_mapping('N7:0', command, tag='speed', station=station,
                        fallback=Fallback((0,), after))


@for_all(('network', 'seconds'), [
    # Timeout for each try, Cmd_Timeout from the last of a command on, and for each try the pause
    # after which a frame has broken off.
    (Network(), 8.0 + 4 * (0.02 + 10 * 10 / 9600)), (QUICK, 1.1 + 2 * QUIET),
    (replace(QUICK, enq_retries=5), 1.9 + 6 * QUIET),
    (replace(QUICK, cmd_timeout=50), 3 * 0.2 + 0.2 + 2 * QUIET),  # Timeout is longer
    (replace(QUICK, timeout=0), 3 * 0.02 + 0.5 + 2 * QUIET),  # not less is waited than that
    (replace(QUICK, mode='Peer', nak_retries=3), 1.5 + 4 * QUIET + 0.1 + 3 * 0.25),
    # Two tries: Cmd_Timeout and what comes in then; before it, as often as there are turns, 2 s of
    # waiting, a frame of 0.14 s, and what comes in.
    (replace(QUICK, mode='Radio'), 2 * (0.5 + 0.25052 + 2 * (2.0 + 0.14010 + 0.25052))),
    (replace(QUICK, mode='Radio', collision_avoidance=True),
     2 * (0.5 + 0.25052 + 12 * (0.14010 + 0.25052)))])
def test_longest_transaction_is_that_of_the_settings(network: Network, seconds: float) -> None:
    longest = network.line_mode.longest_transaction(network.line, 0.0)
    assert longest == pytest.approx(seconds, rel=1e-4)


def write_time(network: Network, mapping: Mapping, response_time: float = 0.01) -> float:
    """Return the seconds that a write of a word takes, with its two answers."""
    # DLE SOH STN DLE STX, header (6), body, DLE ETX CRC; ACK; poll; a reply of a header; ACK.
    size = len(mapping.dialect.write(mapping.address, bytes(2))[1])
    characters = 5 + 6 + size + 4 + 2 + 4 + 2 + 6 + 4 + 2
    return characters * 10 / network.baud + 2 * response_time


def at_most(line_time: float) -> float:
    """Return the seconds of a transaction on QUICK: three waits, all frames twice."""
    return 1.1 + 2 * (line_time + QUIET)


@pytest.mark.parametrize('others, reads', [(0, 1), (5, 1), (6, 2)])
def test_rule_16_bound_counts_all_that_may_go_before_a_fallback(others: int, reads: int) -> None:
    more = [make_mapping(f'N7:{number}', 'Write', fallback=Fallback((0,), 500), station=2)
            for number in range(1, others + 1)]
    rows = [speed(), beat(), *more]
    blocks = Planner(line_model(QUICK), 0.1).plan(
        [make_mapping('N7:0'), make_mapping('N9:0', length=50)])
    question = blocks[1].line_time  # as long as any here
    first = next(Times(QUICK, Rows(rows), blocks).bounds())
    own = at_most(write_time(QUICK, rows[0], 0.0))
    # What is under way, reads that have a turn, and our own writes, heartbeat 0 among them.
    assert first.seconds == pytest.approx(
        3.0 + (1 + reads) * at_most(question) + (2 + others) * own)
    assert first.usual == pytest.approx(3.0 + (1 + reads) * (question + 0.02) + sum(
        write_time(QUICK, row) for row in rows))
    assert str(first) == (f'fallback of speed, station 1: written after '
                          f'{first.seconds * 1000:.0f} ms at most, {first.usual * 1000:.0f} ms '
                          'where no frame gets lost')


@for_all(('element', 'value', 'doubled'), [(16, 0, 1), (15, 0x1010, 200), (16, 0x1010, 201)])
def test_rule_16_counts_doubled_bytes_of_a_fallback(
        element: int, value: int, doubled: int) -> None:
    rows = [make_mapping(f'N7:{first}', 'Write', length=100, fallback=Fallback((word,) * 100, 500))
            for first, word in ((15, 0), (element, value))]
    plain, other = (next(Times(QUICK, Rows([row])).bounds()).usual or 0.0 for row in rows)
    # What is under way, a read and the fallback may each be as long.
    assert other - plain == pytest.approx(3 * doubled * 10 / 19200)


def test_rule_16_row_of_a_processor_that_is_not_named_may_need_the_most_packets() -> None:
    long, short, unknown = (Times(QUICK, Rows([make_mapping(
        'N7:0', 'Write', plc='SLC', processor=processor, length=100,
        fallback=Fallback((0,) * 100, 500))])).worst for processor in ('5/05', '5/02', None))
    assert long + 2 < short < unknown  # what is under way may be a longer packet


def test_rule_16_counts_that_words_of_bits_may_be_read_and_written_back() -> None:
    masked, rewritten = (next(Times(QUICK, Rows([make_mapping(
        'B3:0/0', 'Write', plc='SLC', processor=processor, length=32,
        fallback=Fallback((0,) * 32, 500))])).bounds()).usual or 0.0
        for processor in ('5/03', 'ML1000'))
    word = make_mapping('B3:0', 'ReadWrite', plc='SLC')
    read = Planner(line_model(QUICK), 0.1).alone(word).line_time + 0.02
    back = write_time(QUICK, word) + 2 * 10 / 19200  # both bytes may be 10 hex
    assert rewritten - masked == pytest.approx(2 * (read + back))


def test_rule_16_longest_packet_of_any_read_counts_also_of_one_on_demand() -> None:
    """And the remarks on the times count the same transactions."""
    slow = Network(baud=1200, timeout=300)
    reports = [make_report(slow, Rows([speed(), make_mapping('N10:0'), make_mapping(
        'N9:0', plc='SLC', length=length, is_on_demand=is_on_demand)]), 0.1)
               for length, is_on_demand in ((118, False), (119, False), (118, True))]
    assert len({report.times.longest for report in reports}) == 1
    for report in reports:
        end = report.times.end
        assert end and end > 2.0
        assert any(remark.text.startswith(f'an orderly end needs {milliseconds(end)}; ~/polling')
                   for remark in report.remarks())


def test_rule_16_standard_polling_adds_its_scans_and_slave_has_no_bound() -> None:
    rows = [speed(), *(make_mapping('N7:9', station=station) for station in range(2, 12))]
    message, = Times(QUICK, Rows(rows)).bounds()
    rows.append(speed(station=2))  # in standard polling it has its own turn
    standard, _ = Times(replace(QUICK, polling='Standard'), Rows(rows)).bounds()
    assert message.seconds and standard.seconds and message.usual and standard.usual
    # A scan for each of the three transactions below, in which every station has a command.
    question = line_model(QUICK).transaction_time(1, 26)
    assert standard.usual - message.usual == pytest.approx(
        3 * 11 * (60 / 19200 + 0.01 + question + 0.02))
    # Of each station a poll and a command with all their retries, in two scans a transaction;
    # three transactions: what is under way, a read and the fallback.
    assert standard.seconds - message.seconds > 3 * 2 * 11 * 4 * 0.2
    rows.append(make_mapping('N7:1', 'Write', fallback=Fallback((0,), 3000)))
    one, _ = Times(replace(QUICK, polling='Standard'), Rows(rows[:-2] + rows[-1:])).bounds()
    two, other, _ = Times(replace(QUICK, polling='Standard'), Rows(rows)).bounds()
    assert one.usual and two.usual and two.usual > one.usual  # a read between the writes of one
    assert other.usual == standard.usual  # the other has no more to wait for
    slave, = Times(Network(mode='Slave'), Rows(rows[:1])).bounds()
    assert (slave.seconds, str(slave)) == (
        None, 'fallback of speed, station 1: no bound, because the master of '
              'the line decides when the bridge writes')


def test_rule_16_what_plcs_ask_of_us_takes_turns_with_our_commands() -> None:
    served, long = (make_mapping('N7:50', 'Serve', station=5, length=length)
                    for length in (1, 200))
    alone, = Times(QUICK, Rows([speed()])).bounds()
    beside, = Times(QUICK, Rows([speed(), served, served])).bounds()
    longer, = Times(QUICK, Rows([speed(), served, long, served])).bounds()
    assert alone.seconds and beside.seconds
    # Each may come after a reply of ours: two tries of the longest frame, and of the wait.
    tries = QUICK.line_mode.longest_reply(
        QUICK.line, line_model(QUICK).transaction_time(0, MAX_LINK_DATA))
    assert beside.seconds - alone.seconds == pytest.approx(3 * tries)
    shared, = Times(replace(QUICK, share='/tmp/guests'), Rows([speed()])).bounds()
    assert shared.seconds and shared.seconds - alone.seconds > 2 * 2 * 400 * 10 / 19200
    assert alone.usual and shared.usual and shared.usual - alone.usual > 2 * 400 * 10 / 19200
    reply = line_model(QUICK).transaction_time(0, 2)
    assert beside.usual and longer.usual
    assert beside.usual - alone.usual == pytest.approx(3 * (reply + 0.01))
    assert longer.usual - beside.usual == pytest.approx(3 * (MAX_LINK_DATA - 2) * 10 / 19200)
    peer = Times(replace(QUICK, mode='Peer'), Rows([speed()]))
    assert peer.at_most(peer.any_frames) > peer.longest


def test_rule_16_bounds_of_twice_the_rows_take_twice_the_work() -> None:
    def work(count: int) -> int:
        rows = [make_mapping(f'N7:{number}', 'Write', fallback=Fallback((0,), 500))
                for number in range(count)]
        return lines_run(lambda: [*Times(QUICK, Rows(rows)).bounds()], 'plan')

    assert work(100) < 2.2 * work(50)


def test_rule_16_fallback_of_our_own_table_needs_no_line() -> None:
    for mode in ('Master', 'Slave'):
        bound, other = Times(Network(mode=mode), Rows([
            speed(500, 'Serve', station=5), beat()])).bounds()
        assert (bound.seconds, other.seconds is None) == (0.5, mode == 'Slave')


@pytest.mark.parametrize('period, factor, other', [(100, None, 1), (60_000, 3, 1), (100, None, 2)])
def test_rule_16_preset_of_the_timer(period: int, factor: int | None, other: int) -> None:
    mapping, fallback = beat(period), speed(station=other)  # that of the same PLC comes after it
    bound, _ = Times(QUICK, Rows([mapping, fallback]), (), 0.01).bounds()
    own = write_time(QUICK, mapping, 0.0)
    question = line_model(QUICK).transaction_time(1, 26)  # as long as any here
    longer = period / 1000 + at_most(question) + at_most(own) + 0.01
    longer += (at_most(question) + write_time(QUICK, fallback)) * (other == 2)
    assert bound.seconds == pytest.approx(factor * period / 1000 if factor else longer)
    watchdog = 18_000 if factor else math.ceil(longer * 100)
    assert bound.presets == (watchdog, watchdog + 100)
    assert str(bound) == (f'heartbeat beat, station 1: PLC timer presets {watchdog} (watchdog, '
                          f'rung 3) and {watchdog + 100} (rung 5), time base 0.01 s')


@for_all(('network', 'way'), [
    (Network(baud=19200), 'Timeout 100'), (replace(QUICK, cmd_timeout=5000), 'Cmd_Timeout 500'),
    (replace(QUICK, timeout=100, nak_retries=9), 'NAK_Retries 1'),
    (replace(QUICK, timeout=100, enq_retries=9), 'ENQ_Retries 1'),
    (replace(QUICK, timeout=100, baud=1200), 'Baud 19200'),
    (replace(QUICK, timeout=100, polling='Standard'), 'Polling Message'),
    (replace(QUICK, timeout=105), '')])
def test_rule_16_says_which_setting_shortens_the_times_most(network: Network, way: str) -> None:
    for row, length in ((speed(200), 1), (speed(200), 100), (beat(100), 100)):
        rows = [row, make_mapping('N9:0', length=length)]
        advice = list(make_report(network, rows, 0.1, 0.05).times.advice())
        assert len(advice) == bool(way)
        for text in advice:
            assert text.startswith(f'{way} would shorten the longest of these times most, from ')
            name, value = way.split()
            kind = type(getattr(network, name.lower()))
            other = replace(network, **{name.lower(): kind(value)})
            better = make_report(other, rows, 0.1, 0.05).times.worst
            assert text.endswith(f' to {milliseconds(better)}')


def test_rule_16_conditions_of_bounds_by_radio_are_told_where_there_are_bounds() -> None:
    assert [len([*conditions(replace(QUICK, mode='Radio'), Rows([row]))])
            for row in (speed(), beat(), make_mapping('N7:0'))] == [1, 1, 0]


def test_rule_16_period_shorter_than_a_scan_is_warned_of() -> None:
    rows = [beat(150), beat(200, 'slow'), make_mapping('N7:0', period=100)]
    (text,) = [text for text in remarks(QUICK, Rows(rows), ()) if 'shorter than a scan' in text]
    assert text.startswith('beat: a Period of 150 ms')


def test_rule_16_transactions_longer_than_period_or_fallback_after_are_warned_of() -> None:
    of_beat, of_speed = remarks(Network(), Rows([beat(), speed(16_000)]), ())
    assert 'one transaction may take 8380 ms' in of_beat
    assert 'its Period is 1000 ms' in of_beat
    assert 'Fallback_After 16000 ms is shorter than two transactions' in of_speed
    long = [make_mapping('N7:0', 'Write', length=1000, fallback=Fallback((0,) * 1000, after))
            for after in (1490, 1500)]
    (cut,) = [text for text in remarks(QUICK, Rows(long), ()) if 'a write of all its' in text]
    assert ' 1490 ms ' in cut and cut.endswith('; 2988 ms would be enough')


def plant(stations: int, rows: int) -> list[Mapping]:
    """Return rows with Fallback and a heartbeat of so many PLCs."""
    return [row for station in range(11, 11 + stations) for row in (
        make_mapping('N10:0', 'Heartbeat', station=station, tag=f'beat{station}', period=1000),
        *(make_mapping(f'N7:{number}', 'Write', station=station, fallback=Fallback((7,), 3000))
          for number in range(rows)))]


@pytest.mark.parametrize('stands', [False, True])  # then it is written once more
def test_rule_5_orderly_end_has_the_time_that_is_printed(stands: bool) -> None:
    """Until now it had 2 s: of these 25 rows three kept their command."""
    network, rows = replace(QUICK, baud=9600), plant(5, 5)
    end = Times(network, Rows(rows)).end
    assert end is not None
    assert 2.0 < end < LONGEST_END
    bench = DriverBench(rows, network=network)
    plcs = [bench.plc(number, 'PLC5', ('N7:0', 5), ('N10:0', 1)) for number in range(11, 16)]
    bench.breathe()
    bench.run(10.0)
    for row in rows:
        if row.fallback and not stands:
            bench.write(row, [42], 0.2)
    for plc in plcs if stands else ():
        store(plc, 'N7:0', [42] * 5)  # by another program
    begun, interlocks = bench.line.now, bench.driver.kernel
    interlocks.end.wind_down()
    bench.line.wake(bench.driver.machine)
    bench.run_until(lambda: interlocks.end.is_over, LONGEST_END)
    assert bench.line.now - begun < end
    assert interlocks.end.unconfirmed(bench.clock()) == interlocks.end.not_repeated() == []
    assert [stored(plc, 'N7:0', 5) for plc in plcs] == [bytes([7, 0] * 5)] * 5


@pytest.mark.parametrize(('mode', 'stations'), [
    ({}, 3), ({'polling': 'Standard'}, 3), ({'mode': 'Peer'}, 1), ({'mode': 'Radio'}, 1)])
@pytest.mark.parametrize('timeout', [pytest.param(100, marks=pytest.mark.long), 1000])
def test_rules_5_and_16_end_where_no_plc_answers_has_the_time_that_is_printed(
        mode: dict[str, str], stations: int, timeout: int) -> None:
    """Polls came in between: with Timeout 1000 most rows had no try within 6 s."""
    network = replace(QUICK, timeout=timeout, cmd_timeout=500, **mode)  # type: ignore[arg-type]
    rows = plant(stations, 5)
    bench = DriverBench(rows, network=network)
    numbers = range(11, 11 + stations)
    for number in numbers:
        bench.plc(number, 'PLC5', ('N7:0', 5), ('N10:0', 1))
    bench.breathe()
    bench.run(10.0)
    for row in rows:
        if row.fallback:
            bench.write(row, [42])
    bench.run(2.5)
    assert {result.outcome for result in bench.listener.results[-5 * stations:]} == {
        Outcome.WRITTEN}
    hear, heard = bench.far.hear, bytearray()
    bench.far.hear = lambda data: (heard.extend(data), hear(data))[1]
    bench.far.say = lambda data: b''
    interlocks = bench.driver.kernel
    bench.run_until(lambda: not any(
        bench.driver.stations[number].active for number in numbers), 20.0)
    printed = Times(network, Rows(rows)).end_in_silence
    assert printed is not None
    heard.clear()
    interlocks.end.wind_down()
    bench.line.wake(bench.driver.machine)
    bench.run_until(lambda: interlocks.end.is_over, printed)
    tries = [row.dialect.write(row.address, bytes([7, 0]))[1] for row in rows if row.fallback]
    assert [heard.count(body) for body in tries] == [stations] * len(tries)


@for_all(('mode', 'rows', 'text'), [
    ('Radio', 5, 'and has 6000 ms: the bridge does not try the last rows'),
    ('Master', 10, '~/reload have 2000 ms, and the bridge does not try the last rows'),
    ('Master', 5, '')])
def test_rule_5_end_that_is_too_long_where_no_plc_answers_is_warned_of(
        mode: str, rows: int, text: str) -> None:
    found = [warning for warning in remarks(replace(QUICK, mode=mode), Rows(plant(2, rows)), ())
             if 'where no PLC answers' in warning]
    assert [text in warning for warning in found] == [True] * bool(text)


@pytest.mark.parametrize(('stations', 'rows', 'text'), [
    (1, 5, ''), (5, 5, '~/polling has 2000 ms, and the last rows keep their values'),
    (5, 30, 'and has 6000 ms: the last rows keep their values')])
def test_rule_5_end_that_takes_longer_than_it_has_is_warned_of(
        stations: int, rows: int, text: str) -> None:
    network = replace(QUICK, baud=9600)
    found = [warning for warning in remarks(network, Rows(plant(stations, rows)), ())
             if 'orderly end' in warning]
    assert [text in warning for warning in found] == ([True] if text else [])


def test_rule_5_mode_slave_has_no_time_for_an_end() -> None:
    assert Times(Network(mode='Slave'), Rows([speed()])).end is None
    for row in (make_mapping('N7:0'), speed(500, 'Serve', station=5)):
        times = Times(QUICK, Rows([row]))
        assert times.end == times.end_in_silence == 0.0


def test_rule_16_rows_that_are_fast_enough_are_not_warned_of() -> None:
    assert list(remarks(QUICK, Rows([
        beat(2000), speed(2500), speed(500, 'Serve', station=5)]), ())) == []


def test_rule_14_timeout_is_three_planned_intervals() -> None:
    near, counter = (make_mapping(f'N11:{word}', tag=tag, period=100)
                     for word, tag in ((2, 'near'), (3, 'alive')))
    for busy, enough in ([], 300), ([beat(100)], 575):
        late, good = (make_mapping('N7:0', tag='level', period=1000, condition=While(
            ('alive',), timeout)) for timeout in (enough - 1, enough))
        rows = Rows([near, counter, late, good, *busy])
        interval, = {time for block, time in make_report(QUICK, rows, 0.1).intervals().items()
                     if near in block.mappings}
        assert 3000 * interval == pytest.approx(enough, abs=1.0)
        (mapping, fault), = guard_faults(line_model(QUICK), rows, 0.1)
        assert (mapping, fault.column, fault.text) == (
            late, 'While_Timeout', f'While_Timeout {enough - 1} ms is shorter than 3 reads of '
            f'alive on this line; {enough} ms would be enough')


def test_heartbeats_fallbacks_and_questions_for_run_are_counted_in_the_load() -> None:
    plain = make_mapping('N7:0', period=1000)
    guarded = make_mapping('N7:0', period=1000, condition=While(('RUN',)))
    model = line_model(QUICK)
    assert own_work(model, Rows([plain]), 0.1) == []
    written, asked = own_work(model, Rows([beat(100)]), 0.1)
    assert (*written, asked.period) == (
        pytest.approx(write_time(QUICK, beat())), 0.1, 1, MODE_PERIOD)
    assert [own.period for after in (3000, 9000) for own in own_work(
        model, Rows([speed(after), speed(after, station=2), speed(after, 'Serve')]), 0.1)] == [
        5.0, 5.0, 2.0, 2.0, 9.0, 9.0, 2.0, 2.0]
    asked, = own_work(model, Rows([guarded]), 0.1)
    assert (0.02 < asked.seconds < 0.1, asked.period) == (True, 1.0)
    assert make_report(QUICK, [guarded], 0.1).load > make_report(QUICK, [plain], 0.1).load


@pytest.mark.parametrize(('stale_after', 'period'), [(3.0, 1.0), (1.5, 0.5), (100.0, 100 / 3)])
def test_rule_13_three_answers_about_the_mode_fit_into_the_stale_time(
        stale_after: float, period: float) -> None:
    rows = Rows([make_mapping('N7:0', period=period, condition=While(('RUN',)))
                 for period in (5000, 1000, 5000)])
    assert mode_periods(rows, 0.1, stale_after) == {1: pytest.approx(period)}
    asked, = own_work(line_model(QUICK), rows, 0.1, stale_after)
    bench = DriverBench(rows, settings=DriverSettings(stale_after=stale_after))
    assert asked.period == bench.driver.readings.mode_periods[1] == pytest.approx(period)


def test_rule_8_mode_of_a_plc_that_we_write_to_by_ourselves_is_asked_every_two_seconds() -> None:
    guarded = make_mapping('N7:0', period=9000, condition=While(('RUN',)))
    assert mode_periods(Rows([guarded, speed()]), 0.1, 3.0) == {1: MODE_PERIOD}
    usual = make_mapping('N7:0', condition=While(('RUN',)))
    assert mode_periods(Rows([usual]), 0.1, 3.0) == {1: pytest.approx(0.1)}
    without = make_mapping('N7:0', period=5, condition=While(('RUN',)))
    asked = make_mapping(condition=While(('RUN',)), is_on_demand=True, station=2)
    assert mode_periods(Rows([without, asked]), 0.1, 3.0) == {1: 0.01, 2: 1.0}
    assert mode_periods(Rows([make_mapping(), make_mapping(command='Write')]), 0.1, 3.0) == {}


@for_all(('rows', 'command', 'after', 'is_late'), [
    (5, 'Write', None, False), (7, 'Write', None, True), (5, 'Write', 3000, False),
    (4, 'Write', 300, True), (3, 'Write', 300, False), (40, 'Serve', None, False)])
def test_newest_state_that_may_be_too_old_on_a_full_line_is_named(
        rows: int, command: str, after: int | None, is_late: bool) -> None:
    map_rows = Rows([beat(), *(make_mapping(
        f'N7:{number}', command, tag=f'w{number}', length=1 if after else 100,
        fallback=Fallback((0,), after) if after and number == rows - 1 else None)
        for number in range(rows))])
    texts = [text for text in remarks(QUICK, map_rows, ()) if 'newest value may be older' in text]
    assert [text.partition(':')[0] for text in texts] == [
        f'w{rows - 1}' if after else 'w0'] * is_late
