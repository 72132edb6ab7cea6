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

"""Rows with Single_Publisher while their topic has more than one (rule 28), on a virtual line."""

from collections.abc import Sequence
import math

from abdf1_ros.driver.kernel.own import Crowd
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.mapping import Mapping
from support.cases import for_all
from support.driver_bench import DriverBench
from support.interlocks import beat_row, Cell, END, RETURN, START
from support.mappings import make_mapping

WHY = 'more than one publisher: /player, /robot'
REFUSED = f'not written: refused: {WHY}'
TWO = 'fallback value written: publishers'
LONG_AFTER = 20_000  # ms: no fallback comes because of time


def single_row(address: str = 'N7:0', command: str = 'Write', station: int = 1, length: int = 1,
               after: int = LONG_AFTER, *, is_single: bool = True) -> Mapping:
    """Return a row that takes messages of one publisher only."""
    return make_mapping(address, command, tag='speed', station=station, length=length,
                        fallback=Fallback((7,) * length, after), single_publisher=is_single)


def crowd(cell: Cell, until: float = math.inf, *, is_told: bool = True) -> None:
    """Let a second publisher come; it is alive until then."""
    bench = cell.bench
    bench.driver.kernel.crowd('speed', Crowd(WHY, until))
    if is_told:
        bench.line.wake(bench.driver.machine)


def test_rule_28_messages_of_both_are_refused_and_the_fallback_goes_out_at_once() -> None:
    speed = single_row()
    cell = Cell(speed, run=1.0)
    cell.bench.write(speed, [3], run=0.5)
    crowd(cell)
    cell.run(0.2)
    assert cell.results() == [START, 'written', TWO]
    cell.publish(speed, 4, times=20, run=10.0)  # also while the fallback is written again
    assert cell.results()[3:] == [REFUSED] * 20
    assert {*cell.written('N7:0', since=1.5)} == {7}
    crowd(cell, cell.now)
    cell.bench.write(speed, [5], age=0.01)
    cell.run(0.1)
    assert cell.results()[23:] == [REFUSED]
    cell.bench.write(speed, [6], run=0.1)  # nothing has to be reset
    assert (cell.results()[24:], cell.word('N7:0')) == (['written'], 6)


@for_all(('is_single', 'results'), [(True, [REFUSED, TWO]), (False, ['written'])])
def test_rule_28_message_that_waits_for_the_link_does_not_go_out(
        is_single: bool, results: Sequence[str]) -> None:
    speed = single_row(is_single=is_single)
    cell = Cell(speed, run=1.0)
    cell.bench.driver.write([speed], [3], cell.now)
    crowd(cell)
    cell.run(0.5)
    assert cell.results()[1:] == results
    assert (3 in cell.written('N7:0')) is not is_single


def test_rule_28_message_that_waits_for_the_line_does_not_go_out() -> None:
    speed = single_row()
    cell = Cell(speed, make_mapping('N7:1', length=100, period=1), run=1.0)
    cell.bench.run_until(lambda: bool(cell.bench.driver.tasks.under_way))
    cell.bench.write(speed, [3])  # a read has the line
    crowd(cell)
    cell.run(0.5)
    assert cell.results()[1:] == [f'not written: not sent: {WHY}', TWO]
    assert cell.written('N7:0') == [7, 7]


def test_rule_28_message_under_way_sends_no_further_packet() -> None:
    speed = single_row(length=200)
    cell = Cell(speed, run=1.0)
    cell.bench.write(speed, [3] * 200)  # in two packets
    cell.bench.run_until(lambda: cell.word('N7:0') == 3)
    crowd(cell)
    cell.run(1.0)
    assert cell.results()[1:] == [
        f'only partly written: {WHY} (after 1 of 2 packets were written)', TWO]
    assert (cell.word('N7:0'), cell.word('N7:199')) == (7, 7)


def test_rule_28_other_rows_take_messages_meanwhile() -> None:
    speed, recipe = single_row(), make_mapping('N7:1', 'Write', length=190)
    cell = Cell(speed, recipe, run=1.0)
    cell.bench.write(recipe, [3] * 190, run=0.02)  # in two packets, one is under way
    cell.bench.write(recipe, [4] * 190)
    crowd(cell)
    cell.run(1.0)
    assert cell.results()[1:] == [TWO, 'written', 'written']
    assert (cell.word('N7:0'), cell.word('N7:190')) == (7, 4)


def test_rule_28_second_publisher_that_has_gone_before_the_link_looks_counts() -> None:
    speed = single_row()
    cell = Cell(speed, run=1.0)
    cell.bench.write(speed, [3], run=0.5)
    crowd(cell, is_told=False)
    cell.bench.driver.write([speed], [4], cell.now)
    crowd(cell, cell.now)
    cell.run(0.2)
    assert cell.results()[2:] == [REFUSED, TWO]
    crowd(cell, cell.now)
    cell.run(0.2)
    assert cell.results()[4:] == [TWO]


def test_rule_28_holds_at_the_first_contact_with_a_port_that_was_lost_meanwhile() -> None:
    speed = single_row()
    cell = Cell(speed, run=1.0)
    cell.bench.write(speed, [3], run=0.1)
    cell.bench.lose_port()
    crowd(cell)
    cell.bench.open(run=0.5)
    assert cell.results()[2:] == [TWO]  # else the row would be fresh, and have none
    cell.bench.lose_port()
    cell.bench.open(run=0.5)
    cell.bench.write(speed, [4], run=0.1)
    assert cell.results()[3:] == [RETURN, REFUSED]


def test_rule_28_begins_with_the_first_message_of_a_bridge() -> None:
    speed = single_row()
    cell = Cell(speed, start=False)
    crowd(cell, is_told=False)
    cell.bench.open(run=0.5)
    cell.bench.write(speed, [3], run=0.5)
    assert cell.results() == [START, REFUSED]


def test_rule_28_holds_for_words_that_we_serve() -> None:
    served = single_row(command='Serve', station=0)
    bench = DriverBench([served])
    bench.run(0.1)
    bench.write(served, [3], run=0.1)
    bench.driver.kernel.crowd('speed', Crowd(WHY))
    bench.write(served, [4], run=0.1)
    assert [str(result) for result in bench.listener.results] == [START, 'written', REFUSED, TWO]
    assert bench.driver.served.words_of(served) == b'\x07\0'


def test_rule_28_heartbeat_is_0_until_the_fallback_is_confirmed_and_its_while_has_no_message(
        ) -> None:
    speed, beat = single_row(), beat_row(requires=['speed'], timeout=1000)
    cell = Cell(speed, beat)
    cell.publish(speed, 3, times=25, run=2.5)
    assert cell.word('N10:0')
    begun = cell.now
    crowd(cell)
    cell.publish(speed, 4, times=40, run=0.3)
    assert cell.written('N10:0', begun)[0] == 0
    cell.run(3.5)
    assert cell.written('N10:0', begun + 1.5) == []
    assert cell.word('N10:0') == 0


def test_rule_28_end_is_over_while_two_publish() -> None:
    speed = single_row()
    cell = Cell(speed, run=1.0)
    cell.bench.write(speed, [3], run=0.5)
    cell.bench.driver.kernel.end.wind_down()
    crowd(cell)
    cell.run(0.3)
    assert cell.bench.driver.kernel.end.is_over
    assert cell.results()[2:] == [END]
    assert cell.word('N7:0') == 7
