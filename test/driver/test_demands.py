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

"""Reads that calls ask for, on a virtual line: at once, answered once, and no row starves."""

from dataclasses import replace
from functools import partial
from itertools import pairwise
import math

from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.df1.stations import MOST_OVERDUE
from abdf1_ros.driver.reads.demands import ReadAnswer, ReadCall, ReadCalls
from abdf1_ros.driver.reads.point import Freshness
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.settings.heartbeats import While
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.scaling import Scaling
import pytest
from support.driver_bench import DriverBench, store
from support.mappings import make_mapping

RECIPE = make_mapping('N7:0', length=10, is_on_demand=True)
TABLE = make_mapping('N9:0', length=300, is_on_demand=True)  # three packets
SPEED = make_mapping('N12:0', period=5000, scaling=Scaling(2.0, 1.0))
INACTIVE = '2509'
NETWORK = Network(baud=19200, timeout=200)


class Line(DriverBench):
    """A driver of some rows and a PLC-5; ``answers`` have all, with the time they came."""

    def __init__(self, *rows: Mapping, run: float = 1.0, network: Network = NETWORK,
                 **settings: float) -> None:
        super().__init__(rows, network=network, settings=DriverSettings(
            processor_period=0.0, **settings))  # type: ignore[arg-type]
        self.answers: list[tuple[float, Mapping, ReadAnswer]] = []
        self.there = self.plc(1, 'PLC5', ('N7:0', 500), ('N9:0', 400), ('N12:0', 50))
        store(self.there, 'N7:0', range(200, 210))
        self.run(run)

    def ask(self, mapping: Mapping, run: float = 0.0) -> None:
        self.driver.read_now(mapping, lambda answer: self.answers.append(
            (self.clock(), mapping, answer)))
        self.line.wake(self.driver.machine)
        if run:
            self.run(run)

    @property
    def errors(self) -> list[str]:
        return [answer.error for _, _, answer in self.answers]

    @property
    def packets(self) -> int:
        return self.driver.tasks.transactions


def values_of(answer: ReadAnswer) -> list[float] | str:
    assert answer.values is not None and not answer.error
    return answer.values if isinstance(answer.values, str) else [*answer.values]


def test_row_on_demand_takes_no_line_time_until_a_call_asks_for_it() -> None:
    line = Line(RECIPE, SPEED)
    line.run(20.0)
    before = line.packets
    assert line.listener.values(RECIPE) == []
    assert line.driver.points[RECIPE].freshness(line.clock()) is Freshness.FRESH
    line.ask(RECIPE, run=0.2)
    assert line.packets == before + 1
    (when, _, answer), = line.answers
    assert values_of(answer) == [*range(200, 210)]
    assert answer.read == when
    assert line.listener.values(RECIPE) == [[*range(200, 210)]]
    line.run(20.0)
    assert len(line.listener.values(RECIPE)) == len(line.answers) == 1
    assert line.driver.readings.blocks == [job.block for job in line.driver.readings.reads.jobs]


def test_row_that_was_asked_for_keeps_its_period_afterwards() -> None:
    line = Line(SPEED, make_mapping('N12:1', period=500), run=6.2)
    before = len(line.listener.values(SPEED))
    for seconds in (0.5, 4.0):  # it is published at once, and not again
        line.ask(SPEED, run=seconds) if seconds < 1 else line.run(seconds)
        assert len(line.listener.values(SPEED)) - before == 1
    line.there.faults.silent = True
    line.ask(SPEED, run=10.0)
    assert line.errors[-1][:4] == INACTIVE
    line.there.faults.silent = False
    line.run(10.0)
    before = len(line.listener.values(SPEED))
    line.run(10.0)
    assert len(line.listener.values(SPEED)) - before == 2


def test_answer_is_never_older_than_the_call() -> None:
    """A read that had begun does not count: the value may have changed since."""
    line = Line(SPEED, make_mapping('N12:1', period=5000), run=6.0)
    line.ask(line.mappings[1])  # it is read with the other
    line.ask(SPEED)
    line.run(0.02)  # the PLC has executed its command, and the reply is under way
    store(line.there, 'N12:0', [78])
    asked = line.clock()
    line.ask(SPEED, run=0.5)
    assert [values_of(answer) for _, _, answer in line.answers][-1] == [157.0]
    assert line.answers[0][2].read > asked
    assert len(line.driver.readings.blocks) == 1


def test_many_calls_for_one_row_are_one_read() -> None:
    line = Line(RECIPE)
    before = line.packets
    for _ in range(100):
        line.ask(RECIPE)
    line.driver.readings.station_lost(2)
    line.run(1.0)
    assert len(line.answers) == 100
    assert {*map(str, (values_of(answer) for _, _, answer in line.answers))} == {
        str([*range(200, 210)])}
    assert line.packets == before + 1


def test_long_table_is_read_packet_by_packet() -> None:
    line = Line(TABLE)
    before = line.packets
    store(line.there, 'N9:0', range(300))
    line.ask(TABLE)
    line.run_until(lambda: line.packets == before + 1)
    line.ask(TABLE, run=2.0)  # the first packet does not count for it
    assert [values_of(answer) for _, _, answer in line.answers] == [[*range(300)]] * 2
    assert line.packets == before + 6


@pytest.mark.parametrize('period', [0, 30])
def test_calls_do_not_starve_a_full_line(period: int) -> None:
    """However many calls come, all other rows keep three quarters of the line, and are fresh."""
    rows = [make_mapping(f'N12:{number * 15}', period=period, access='Typed', tag=f'r{number}')
            for number in range(3)]
    tables = [make_mapping(f'N7:{number * 100}', length=100, is_on_demand=True, tag=f't{number}')
              for number in range(5)]
    line = Line(*rows, *tables, run=5.0)
    alone = len(line.listener.reads)

    def ask_again(mapping: Mapping, answer: ReadAnswer) -> None:
        line.answers.append((line.clock(), mapping, answer))
        line.at(line.clock() + 0.001, lambda: line.driver.read_now(
            mapping, partial(ask_again, mapping)))

    for table in tables:
        line.driver.read_now(table, partial(ask_again, table))
    line.line.wake(line.driver.machine)
    before = len(line.listener.reads)
    states: set[Freshness] = set()
    for _ in range(50):
        line.run(0.1)
        states |= {line.driver.points[row].freshness(line.clock()) for row in rows}
    assert states <= {Freshness.FRESH, Freshness.LATE}
    assert len([row for _, row, _ in line.listener.reads[before:] if row in rows]) > 0.6 * alone
    assert {*line.errors} == {''} and len(line.answers) > 5


@pytest.mark.parametrize('network', [
    NETWORK, replace(NETWORK, polling='Standard'),
    replace(NETWORK, mode='Radio', collision_avoidance=True)])
def test_full_line_answers_a_call_soon(network: Network) -> None:
    """A turn in which the station is busy with another command costs a call nothing."""
    rows = [make_mapping(f'N7:{number * 100}', length=60, period=10, tag=f'r{number}')
            for number in range(5)]
    line = Line(*rows, SPEED, network=network)
    line.there.faults.slow = 6  # polls get EOT
    line.run(9.0)
    for _ in range(20):
        begun = line.clock()
        line.ask(SPEED, run=1.0)
        assert line.answers[-1][0] - begun < 0.4, line.answers[-1]


def test_call_that_comes_between_the_clock_and_its_look_is_answered() -> None:
    for row in (RECIPE, make_mapping('N9:0', period=60_000)):
        line, answers = Line(row), list[ReadAnswer]()
        line.driver.read_now(row, answers.append)
        line.driver.machine.wake(line.clock() - 0.001)  # the link thread lost the processor
        line.run(3.0)
        assert [answer.error for answer in answers] == ['']


def test_silent_station_is_answered_at_once_and_takes_nothing() -> None:
    line = Line(RECIPE, SPEED)
    line.there.faults.silent = True
    line.run(20.0)
    assert not line.driver.stations[1].active
    assert line.driver.points[RECIPE].freshness(line.clock()) is Freshness.FRESH
    begun, sent = line.clock(), line.driver.counters.chars_sent
    line.ask(RECIPE)
    line.ask(SPEED, run=0.01)
    assert [error[:4] for error in line.errors] == [INACTIVE] * 2
    assert {when for when, _, _ in line.answers} == {begun}
    assert line.driver.counters.chars_sent - sent < 40
    line.there.faults.silent = False
    line.run(20.0)
    assert line.listener.values(RECIPE) == []  # its call is over
    line.ask(RECIPE, run=0.5)
    assert line.errors[-1] == ''


def test_station_that_has_become_late_is_answered_at_once() -> None:
    line = Line(RECIPE)
    line.driver.stations[1].overdue = MOST_OVERDUE
    begun = line.clock()
    line.ask(RECIPE)
    assert [(when, answer.error[:4]) for when, _, answer in line.answers] == [(begun, '2508')]


def test_station_that_dies_during_the_read_is_told() -> None:
    for row, other in pairwise((RECIPE, SPEED, TABLE, RECIPE)):
        line = Line(row, other, run=6.0)
        line.there.faults.silent = True
        line.ask(other)
        line.ask(row, run=30.0)
        assert [each[:4] in (INACTIVE, '2508') for each in line.errors] == [True] * 2
        line.there.faults.silent = False
        line.run(10.0)
        assert bool(line.listener.values(row)) is not row.is_on_demand
        line.ask(row, run=1.0)
        assert line.errors[-1] == ''
        assert line.driver.points[row].freshness(line.clock()) is Freshness.FRESH


def test_refusal_is_told_with_its_number_and_the_row_stays_failed() -> None:
    missing = make_mapping('N99:0', length=4, is_on_demand=True)
    line = Line(missing, SPEED)
    line.ask(missing, run=1.0)
    assert 'STS' in line.errors[0]
    assert line.driver.points[missing].freshness(line.clock()) is Freshness.FAILED
    before = line.packets
    line.run(4.0)
    assert line.packets - before <= 1  # that of the other row


def test_call_is_told_its_own_failure_and_not_that_of_an_earlier_call() -> None:
    row = make_mapping('N99:0', is_on_demand=True, condition=While(('RUN',)))
    line = Line(row, run=6.0)
    line.ask(row, run=1.0)
    line.there.table.create(row.address, 1)
    line.there.processor.setting = Setting.PROGRAM
    line.run(20.0)
    line.ask(row, run=1.0)
    line.there.faults.slow = 100_000  # polls get EOT
    line.ask(row, run=30.0)
    assert [error[:4] for error in line.errors] == ['STS ', 'with', '2508']


def test_shorter_packets_of_a_small_processor_are_found() -> None:
    row = make_mapping('N7:0', plc='SLC', length=100, is_on_demand=True)  # as of a 5/03
    line = DriverBench([row], settings=DriverSettings(processor_period=0.0))
    plc = line.plc(1, 'SLC', ('N7:0', 100))
    serve = plc.serve

    def serve_short(command: Packet) -> Packet:
        reply = serve(command)
        if command.cmd == 0x0F and len(reply.data) > 82:
            return reply._replace(sts=0x10, data=b'')
        return reply

    plc.slave = HalfDuplexSlave(LinkSettings(station=1), serve_short)
    answers: list[ReadAnswer] = []
    line.run(1.0)
    line.driver.read_now(row, answers.append)
    line.line.wake(line.driver.machine)
    line.run(3.0)
    assert [len(values_of(answer)) for answer in answers] == [100]


def test_withheld_row_answers_withheld_and_publishes_nothing() -> None:
    run = While(('RUN',))
    rows = [make_mapping('N7:0', tag='now_and_then', is_on_demand=True, condition=run),
            make_mapping('N12:0', tag='often', period=200, condition=run)]
    line = Line(*rows, run=5.0)
    line.there.processor.setting = Setting.PROGRAM
    line.run(5.0)
    before = len(line.listener.reads)
    for row in rows:
        line.ask(row)
    line.run(0.5)
    assert [error[:22] for error in line.errors] == ['withheld: not in RUN: i'[:22]] * 2
    assert all(answer.values is None for _, _, answer in line.answers)
    assert len(line.listener.reads) == before
    line.there.processor.setting = Setting.RUN
    line.run(5.0)
    line.ask(rows[0], run=0.5)
    assert line.errors[-1] == ''
    assert line.listener.ends[-1][0] == 'often'


def test_that_a_row_on_demand_is_withheld_is_told_to_its_calls_alone() -> None:
    row = make_mapping('N7:0', is_on_demand=True, condition=While(('RUN',)))
    line = Line(row)
    line.there.processor.setting = Setting.PROGRAM
    for _ in range(2):
        line.run(20.0)
        line.ask(row)
    line.run(0.5)
    assert [error.partition(':')[0] for error in line.errors] == ['withheld'] * 2
    assert not line.listener.reasons
    assert line.driver.points[row].freshness(line.clock()) is Freshness.FRESH


def test_lost_port_and_the_end_answer_every_call() -> None:
    line = Line(RECIPE, TABLE, SPEED)
    for row in (RECIPE, TABLE, SPEED):
        line.ask(row)
    fresh: list[ReadAnswer] = []
    line.driver.read_now(SPEED, fresh.append)
    line.lose_port()
    assert [*line.errors, fresh[0].error] == ['port lost: unplugged'] * 4
    assert line.driver.points[RECIPE].freshness(line.clock()) is Freshness.FRESH
    line.ask(RECIPE)
    DriverBench([SPEED], start=False).driver.read_now(SPEED, fresh.append)
    assert [line.errors[-1], fresh[-1].error] == ['the port is not open'] * 2
    line.open(run=1.0)
    assert line.listener.values(RECIPE) == line.listener.values(TABLE) == []
    line.driver.kernel.end.wind_down()
    line.ask(RECIPE)
    assert line.errors[-1] == 'this node ends'
    line.lose_port()  # as at ~/polling
    line.ask(RECIPE)
    assert line.errors[-1] == 'the port is not open'


def test_each_call_ends_at_its_own_time_whatever_came_after_it() -> None:
    ended: list[str] = []
    demands = ReadCalls(1.0)
    for name, now in (('first', 0.0), ('second', 0.4), ('third', 0.8)):
        demands.add(ReadCall(RECIPE, lambda answer, name=name: ended.append(name)), now, 0.5)
    assert demands.next_expiry == 1.5
    demands.expire(demands.next_expiry)
    assert ended == ['first']
    assert demands.next_expiry == 1.9
    demands.expire(demands.next_expiry)
    demands.expire(demands.next_expiry)
    assert ended == ['first', 'second', 'third']
    assert demands.next_expiry == math.inf


def test_write_of_a_row_on_demand_is_not_read_back() -> None:
    """Nothing reads the row again and again, so the result does not wait for a read."""
    row = make_mapping('N7:0', 'ReadWrite', is_on_demand=True)
    line = Line(row)
    line.write(row, [5], run=1.0)
    assert line.listener.outcomes() == [Outcome.WRITTEN]
    assert line.listener.values(row) == []  # nor is it read for what the write has changed
    line.there.slave = HalfDuplexSlave(
        LinkSettings(station=1),
        lambda command: command.reply()._replace(tns=command.tns ^ 0x8000))
    line.write(row, [6], run=10.0)
    result = line.listener.results[-1]
    assert result.outcome is Outcome.UNKNOWN
    assert result.detail.endswith('not read back: no row reads all of these words')
