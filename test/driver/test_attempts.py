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
Attempts to move a machine that must not move, by the rules of docs/heartbeats.md.

Each is a row of test/lab/field.md. Attempts that a test of a rule makes already are there.
"""

from collections.abc import Sequence
import math

from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.reads.demands import ReadAnswer
from abdf1_ros.driver.write import Outcome
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.mapping import Mapping
import pytest
from support import interlocks
from support.driver_bench import ListeningBench, store
from support.mappings import make_mapping

OLD = 888  # a command of before
READ = make_mapping('N7:0', length=4, period=100)


def say(cell: interlocks.Cell, row: Mapping, values: Sequence[float], published: float) -> None:
    """Hand a message over that was published then."""
    cell.bench.driver.write([row], values, published)
    cell.bench.line.wake(cell.bench.driver.machine)


@pytest.mark.parametrize('age', [0.6, None])  # s; None: one message, again and again
def test_rule_7_old_messages_keep_no_output_alive(age: float | None) -> None:
    cell, speed = interlocks.speed_cell()
    cell.publish(speed, 3, run=0.1)
    died = cell.now
    for number in range(200):
        cell.bench.at(died + number / 100, lambda: say(
            cell, speed, [3], died if age is None else cell.now - age))
    cell.run(0.8)
    assert cell.word('N7:0') == 7
    cell.run(1.5)
    assert cell.written('N7:0', died + 0.8) == []
    assert cell.results().count(interlocks.TIMEOUT) == 1


def test_rule_8_guest_who_writes_over_a_fallback_all_the_time_moves_nothing_for_long() -> None:
    cell = interlocks.GuestCell(interlocks.beat_row(), interlocks.speed_row(), run=2.0)
    begun, seen = cell.now, list[tuple[int, int]]()
    for number in range(100):
        cell.bench.at(begun + number / 20, lambda: cell.ask('N7:0', OLD))
    for number in range(1000):
        cell.bench.at(begun + number / 200, lambda: seen.append(
            (cell.word('N7:0'), cell.word('N10:0'))))
    cell.run(5.0)
    assert len(cell.replies) >= 99
    assert 0 < sum(speed == OLD for speed, _ in seen) < 200
    # Each 0 stands for its time; between two writes of the guest nothing holds the next number up.
    assert sum(beat == 0 for _, beat in seen) > 800
    assert max(beat for _, beat in seen[100:]) <= 1
    cell.run(1.0)
    assert cell.word('N7:0') == 7
    assert cell.word('N10:0') > 0


def test_rules_5_and_8_port_given_away_and_taken_ten_times_has_its_fallback_each_time() -> None:
    cell, speed = interlocks.speed_cell()
    for _ in range(10):
        interlocks.end(cell)
        store(cell.plc, 'N7:0', [OLD])  # as the program that has the port does
        cell.bench.driver.kernel.end.resume()
        cell.bench.open(run=0.3)
        assert cell.word('N7:0') == 7
        cell.bench.write(speed, [3], run=0.1)
        assert cell.word('N7:0') == 3
    assert {*cell.results()} <= {interlocks.START, interlocks.RETURN, interlocks.END, 'written'}
    row, = cell.bench.driver.kernel.rows.fallbacks
    assert row.conditions.ended == math.inf  # the end does not bound a second write any more


def test_rule_3d_messages_of_the_wrong_length_keep_no_heartbeat_alive() -> None:
    speed = interlocks.speed_row(fallback=None)
    cell = interlocks.Cell(interlocks.beat_row(requires=('speed',), timeout=300), speed)
    cell.publish(speed, 3, times=20, run=2.0)
    assert cell.word('N10:0') > 0
    for number in range(20):
        cell.bench.at(cell.now + number / 10, lambda: cell.bench.write(speed, [3, 3]))
    cell.run(0.6)
    begun = cell.now
    cell.run(1.5)
    assert {*cell.written('N10:0', begun - 0.3), cell.word('N10:0')} == {0}


def test_rule_8_port_that_is_away_for_longer_than_fallback_after_brings_the_fallback() -> None:
    speed = interlocks.speed_row(Fallback((7,), 60_000))
    cell = interlocks.Cell(speed, run=1.0)
    cell.publish(speed, 3, run=0.5)
    cell.bench.lose_port()
    cell.run(61.0)
    assert cell.word('N7:0') == 3
    cell.bench.open(run=0.2)
    assert cell.word('N7:0') == 7
    assert cell.results()[-1] == interlocks.RETURN


@pytest.mark.parametrize('silent', [1.0, 0.05])  # s; in the second no read misses the PLC
def test_rule_8_another_plc_with_an_old_command_has_the_fallback(silent: float) -> None:
    cell = interlocks.Cell(interlocks.speed_row(), make_mapping('N11:0', period=200), run=1.0)
    cell.plc.faults.silent = True
    cell.run(silent)
    store(cell.plc, 'N7:0', [OLD])
    cell.plc.faults.silent = False
    cell.run(5.2)
    assert cell.word('N7:0') == 7


def test_rule_10_fallback_whose_packets_are_refused_in_turn_arrives_whole() -> None:
    row = interlocks.speed_row(Fallback((7,) * 200, 500), length=200)
    cell = interlocks.Cell(row, start=False)
    serve, count = cell.plc.serve, [0]

    def refuse_each_third(command: Packet) -> Packet:
        if command.cmd == 0x0F and command.data[0] == 0x67:
            count[0] += 1
            if count[0] % 3 == 1:  # the first of two, then the second, then none
                return command.reply(sts=0x10)
        return serve(command)

    cell.plc.serve = refuse_each_third  # type: ignore[method-assign]
    cell.bench.open(run=3.0)
    cell.plc.serve = serve  # type: ignore[method-assign]
    words = cell.plc.table.read(parse_address('N7:0', cell.plc.table.plc_type), 200)
    assert words == b'\7\0' * 200


def test_rule_27_value_that_stood_before_new_files_stands_no_more() -> None:
    row = make_mapping('N7:0', 'Write', write_again=60_000, fallback=Fallback((7,), 60_000))
    cell = interlocks.Cell(row, READ, run=1.0)
    for _ in range(2):
        cell.publish(row, 3, run=0.3)
    assert cell.bench.listener.outcomes()[-1] is Outcome.STANDS
    interlocks.end(cell)
    assert cell.word('N7:0') == 7
    store(cell.plc, 'N7:0', [3])  # as a download does
    cell.bench.restart()
    cell.run(0.3)
    assert cell.word('N7:0') == 7
    cell.publish(row, 3, run=0.3)
    assert cell.bench.listener.outcomes()[-2:] == [Outcome.FALLBACK, Outcome.WRITTEN]


def test_bridge_that_only_listens_sends_nothing_whatever_its_rows_ask_for() -> None:
    """The map may not have such rows in Mode Listen; see test/plan/test_usable_rows.py."""
    beat, speed = interlocks.beat_row(), interlocks.speed_row()
    bench = ListeningBench([beat, speed, READ])  # it looks at what is sent all the time
    for number in range(20):
        bench.driver.kernel.executor_ran(bench.now)
        bench.driver.write([speed], [number], bench.now)
        bench.driver.kernel.station_changed(1, bench.now, is_active=True)
        bench.run(0.5)
    bench.driver.kernel.end.wind_down()
    bench.run(5.0)
    assert Outcome.WRITTEN not in bench.listener.outcomes()


def test_rule_5_calls_at_the_end_move_nothing_and_each_has_its_answer() -> None:
    speed, asked = interlocks.speed_row(), make_mapping('N11:0', tag='asked', period=60_000)
    cell = interlocks.Cell(interlocks.beat_row(), speed, asked, run=2.0)
    answers: list[ReadAnswer] = []

    def call() -> None:
        cell.bench.driver.read_now(asked, answers.append)
        cell.bench.write(speed, [3])

    before = len(cell.results())
    for number in range(400):
        cell.bench.at(cell.now + number / 200, call)
    cell.run(0.5)
    assert cell.word('N7:0') == 3
    interlocks.end(cell, 0.2)
    assert [cell.word(name) for name in interlocks.WORDS] == [7, 0]
    results = cell.results()[before:]
    assert len(answers) == 400
    assert len(results) - results.count(interlocks.END) == 400


def test_rule_27_value_of_before_another_bridge_had_the_line_stands_no_more() -> None:
    row = make_mapping('N7:0', 'Write', write_again=60_000)
    cell = interlocks.Cell(row, READ, run=1.0)
    for _ in range(2):
        cell.publish(row, 3, run=0.3)
    cell.bench.write(row, [4])
    cell.bench.lose_port()  # before it is confirmed
    cell.run(1.0)
    store(cell.plc, 'N7:0', [5])
    cell.bench.open(run=0.3)
    assert cell.word('N7:0') == 5
    cell.publish(row, 3, run=0.1)
    assert cell.word('N7:0') == 3
    assert [outcome.name for outcome in cell.bench.listener.outcomes()] == [
        'WRITTEN', 'STANDS', 'UNKNOWN', 'WRITTEN']


def test_rule_8_changes_that_give_way_and_a_guest_keep_no_fallback_from_its_bit() -> None:
    bit = interlocks.speed_row(Fallback((0,), 1000), address='B3:0/0')
    cell = interlocks.GuestCell(bit, polling='Standard')
    begun = cell.now
    for number in range(400):  # more than the line carries
        cell.bench.at(begun + number / 100, lambda number=number: cell.bench.write(  # type: ignore
            bit, [(number + 1) % 2]))
        if number % 20 == 0:
            cell.bench.at(begun + number / 100, lambda: cell.ask('B3:0', 0xFF))
    cell.run(4.0)
    assert 'SUPERSEDED' in {outcome.name for outcome in cell.bench.listener.outcomes()}
    cell.run(1.5)
    assert cell.word('B3:0') & 1 == 0
    cell.ask('B3:0', 0xFF)
    cell.run(0.5)
    assert cell.word('B3:0') == 0xFE
    assert len(cell.results()) == 400 + cell.results().count(interlocks.TIMEOUT) + 1
