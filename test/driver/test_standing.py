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

"""Write_Again: a message is not written again while reads show that its value stands."""

from collections.abc import Sequence
from itertools import pairwise

from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.kernel.flights import Flight, Flights
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.pccc.families import dialect_of
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
import pytest
from support.clock import StillClock
from support.driver_bench import DriverBench, store, stored
from support.interlocks import Cell
from support.mappings import make_mapping

WORD = make_mapping('N7:0', 'Write', write_again=1000)
READ = make_mapping('N7:0', length=4, period=100)
WRITTEN, STANDS = Outcome.WRITTEN, Outcome.STANDS


def flights_of(*rows: Mapping) -> tuple[Flights, StillClock, ActiveStationList]:
    """Return the flights of rows of station 1, and their clock; a read holds for 0.5 s."""
    clock, stations = StillClock(1.0), ActiveStationList([1])
    flights = Flights(clock, 1.0, stations, 0.5)
    for row in rows:
        flights.words_of(row)
    return flights, clock, stations


class Line(DriverBench):
    """A driver of some rows and a PLC-5; ``executed`` has the time of each write to it."""

    def __init__(self, *rows: Mapping) -> None:
        super().__init__(rows, network=Network(baud=19200, timeout=200, cmd_timeout=1500),
                         settings=DriverSettings(processor_period=0.0))
        self.there = self.plc(1, 'PLC5', ('N7:0', 200), ('B3:0', 4), ('ST9:0', 84))
        self.executed: list[float] = []
        self.there.slave = HalfDuplexSlave(LinkSettings(station=1), self._serve)
        self.is_late = False
        self.run(1.0)

    def _serve(self, command: Packet) -> Packet:
        reply = self.there.serve(command)
        if command.cmd == 0x0F and not reply.data:
            self.executed.append(self.clock())
        return reply._replace(tns=reply.tns ^ 0x8000) if self.is_late else reply

    def keep_saying(self, row: Mapping, values: Sequence[float] | str, seconds: float,
                    rate: float = 50.0) -> None:
        for number in range(int(rate * seconds)):
            self.at(self.clock() + number / rate, lambda: self.write(row, values))

    def load(self, seconds: float) -> float:
        """Let time pass; return the part of it in which characters were on the line."""
        counters = self.driver.counters
        before = counters.chars_sent + counters.chars_received
        self.run(seconds)
        after = counters.chars_sent + counters.chars_received
        return (after - before) * self.network.timing.char_time / seconds

    @property
    def outcomes(self) -> list[Outcome]:
        return self.listener.outcomes()


def test_unchanged_value_is_written_again_after_its_time_only() -> None:
    line = Line(WORD, READ, make_mapping('B3:0', period=100))
    line.keep_saying(WORD, [7], 10.0)
    line.run(10.2)
    assert len(line.outcomes) == 500 and {*line.outcomes} == {WRITTEN, STANDS}
    # The first few until a read has shown the value, then one a second.
    assert 10 <= line.outcomes.count(WRITTEN) <= 25
    gaps = [later - earlier for earlier, later in pairwise(line.executed[-5:])]
    assert all(1.0 <= gap < 1.2 for gap in gaps), gaps
    text = str(line.listener.results[-1])
    assert text.startswith('stands in the PLC: conf') and text.endswith('; not written again')
    assert float(text[29:33]) < 1.1  # since the last of them


@pytest.mark.parametrize(('again', 'least', 'most'), [
    (None, 0.7, 1.1), (1000, 0.0, 0.55), (5000, 0.0, 0.4)])
def test_four_words_at_50_hz_leave_the_line_to_others(
        again: int | None, least: float, most: float) -> None:
    rows = [make_mapping(f'N7:{number}', 'Write', write_again=again, tag=f'w{number}')
            for number in range(4)]
    line = Line(*rows, READ)
    for row in rows:
        line.keep_saying(row, [5], 12.0)
    line.run(2.0)
    assert least < line.load(10.0) < most


def test_change_goes_at_once() -> None:
    line = Line(WORD, READ)
    line.keep_saying(WORD, [7], 3.0)
    line.run(3.0)
    assert line.outcomes[-1] is STANDS
    begun = line.clock()
    line.write(WORD, [8], run=0.2)
    assert line.outcomes[-1] is WRITTEN
    assert line.executed[-1] - begun < 0.1
    line.write(WORD, [7], run=0.2)
    assert line.outcomes[-1] is WRITTEN


def test_word_that_the_plc_clears_is_back_within_one_read() -> None:
    line = Line(make_mapping('N7:0', 'Write', write_again=60_000), READ)
    line.keep_saying(line.mappings[0], [7], 6.0)
    line.run(3.0)
    store(line.there, 'N7:0', [0])
    line.run(0.3)
    assert stored(line.there, 'N7:0') == b'\x07\x00'
    assert line.executed[-1] > line.clock() - 0.3


def test_without_a_read_every_message_is_written() -> None:
    line = Line(WORD)
    line.keep_saying(WORD, [7], 1.0, rate=10)
    line.run(1.2)
    assert line.outcomes == [WRITTEN] * 10


@pytest.mark.parametrize(('fallback', 'holds'), [(None, 2.0), (Fallback((0,), 1000), 1.0)])
def test_read_that_is_too_old_proves_nothing(fallback: Fallback | None, holds: float) -> None:
    row = make_mapping('N7:0', 'Write', write_again=60_000, fallback=fallback)
    line = Line(row, make_mapping('N7:0', length=4, period=10_000))  # write_timeout is 2 s
    line.keep_saying(row, [7], 9.0, rate=10)
    line.run(9.2)
    # The read after each write holds for 2 s, or for Fallback_After.
    gaps = [later - earlier for earlier, later in pairwise(line.executed)]
    assert len(gaps) >= 3 and holds < max(gaps) < holds + 0.3, gaps
    assert line.outcomes.count(STANDS) > 60


@pytest.mark.parametrize('other', [
    make_mapping('N7:0', 'Write', tag='o'), make_mapping('N7:0', 'Write', length=3, tag='o'),
    make_mapping('N7:0', 'Write', station=255, tag='o')])
def test_other_write_of_the_words_ends_it(other: Mapping) -> None:
    line = Line(WORD, other, READ)
    line.keep_saying(WORD, [7], 1.0)
    line.run(1.1)
    assert line.outcomes[-1] is STANDS
    line.write(other, [9] * other.length)
    line.write(WORD, [7], run=0.5)
    assert line.outcomes[-1] is WRITTEN
    assert stored(line.there, 'N7:0') == b'\x07\x00'


def test_neighbour_bits_do_not_disturb_each_other() -> None:
    rows = [make_mapping(f'B3:0/{bit}', 'Write', write_again=60_000, tag=f'b{bit}')
            for bit in range(2)]
    line = Line(*rows, make_mapping('B3:0', period=100))
    line.keep_saying(rows[0], [1], 4.0)
    line.keep_saying(rows[1], [0], 2.0)
    line.run(2.0)
    del line.listener.results[:]
    line.write(rows[1], [1], run=0.5)
    assert [result.outcome for result in line.listener.results if result.mapping is rows[0]][
        5:] == [STANDS] * (len(line.listener.results) - 6)


def test_word_that_may_be_written_back_late_disturbs_its_other_bits() -> None:
    rows = [make_mapping(f'B3:0/{bit}', 'Write', plc='SLC', processor='5/01', write_again=1000)
            for bit in range(2)]
    flights, clock, _ = flights_of(*rows)
    line = DriverBench([make_mapping('B3:0', plc='SLC')])
    for row, outcome in zip(rows, (WRITTEN, Outcome.UNKNOWN), strict=True):
        flight = flights.begin(1, [row.extent], Write(row, [1], 1.0))
        clock.now = 1.1
        flights.ended(flight, outcome)
        flights.words_read(*line.driver.readings.blocks, b'\1\0', 1.2)
        assert bool(flights.proof(Write(rows[0], [1], 1.3), 1.3)) is (outcome is WRITTEN)


def test_unconfirmed_write_and_what_follows_prove_nothing() -> None:
    line = Line(WORD, READ)
    line.keep_saying(WORD, [7], 1.0)
    line.run(1.1)
    line.is_late = True
    line.write(WORD, [8], run=2.5)
    line.is_late = False
    line.run(2.0)
    line.write(WORD, [8], run=0.3)
    assert line.outcomes[-1] is WRITTEN


def test_unconfirmed_write_may_land_over_the_confirmed_one_that_follows() -> None:
    block, = Line(WORD, READ).driver.readings.blocks
    flights, clock, stations = flights_of(WORD)

    def end(value: int, begun: float, outcome: Outcome = WRITTEN) -> Write:
        """Let a message end 0.1 s after it began; without an answer it may land for 1 s more."""
        write, clock.now = Write(WORD, [value], begun), begun
        flight = flights.begin(1, [WORD.extent], write)
        clock.now = begun + 0.1
        flights.ended(flight, outcome)
        flights.words_read(block, bytes((value, *7 * [0])), clock.now)
        return write

    end(8, 1.0, Outcome.UNKNOWN)
    assert not flights.proof(end(9, 2.05), 2.2)
    late = end(9, 2.1)  # confirmed at 2.2
    flights.words_read(block, bytes(8), 2.1)
    assert flights.proof(late, 2.69) and not flights.proof(late, 2.7)
    flights.words_read(block, bytes((9, *7 * [0])), 2.75)
    assert flights.proof(late, 3.1995) and not flights.proof(late, 3.2)
    clock.now = 2.8
    guest = flights.begin(1, [WORD.extent])
    assert not flights.proof(late, 2.8)
    meanwhile = end(9, 2.8)
    flights.ended(guest, WRITTEN)
    assert not flights.proof(meanwhile, 2.9)
    end(8, 3.0, Outcome.UNKNOWN)
    end(7, 3.2, Outcome.UNKNOWN)
    assert not flights.proof(end(9, 4.0), 4.2)
    end(8, 4.4)
    last = end(9, 4.6)
    for station, is_kept in ((2, True), (1, False)):
        flights.forget(station)
        assert bool(flights.proof(last, 4.7)) is is_kept
    before = Flights(clock, 1.0, ActiveStationList())  # of the driver before ~/reload
    clock.now = 9.0
    before.ended(before.begin(1, [WORD.extent]), Outcome.UNKNOWN)
    flights.take_over(before)
    assert not flights.proof(last, 9.0)
    assert not flights.proof(end(9, 9.9), 10.0)
    last = end(9, 10.0)
    assert flights.proof(last, 10.2)
    flights.opened()  # at 10.1: nobody knows of a gateway yet
    assert flights.proof(last, 10.2)
    stations[1].has_gateway = True
    assert not flights.proof(last, 10.2)
    assert not flights.proof(end(9, 11.0), 11.2)
    assert flights.proof(end(9, 11.1), 11.3)


def test_write_that_has_ended_may_have_changed_words_unless_it_cannot_land() -> None:
    flight = Flight(1, [WORD.extent, make_mapping('N9:0').extent])
    assert flight.meets(WORD.extent) and not Flight(2, None).meets(WORD.extent)
    found = [flight.has_changed]
    for outcome in (Outcome.FAILED, WRITTEN, Outcome.UNKNOWN):
        flight.end(outcome, 1.0, 9.0)
        found.append(flight.has_changed)
    assert found == [False, False, True, True]
    assert flight.lands_until == 10.0


def test_write_between_two_packets_of_a_read_stands_all_the_same() -> None:
    row = make_mapping('N7:0', 'Write', write_again=60_000)
    line = Line(row, make_mapping('N7:0', length=200, period=500))
    line.run_until(lambda: bool(line.driver.tasks.under_way))
    line.write(row, [7], run=2.0)  # the first packet has the old value
    line.write(row, [7], run=0.5)
    assert line.outcomes == [WRITTEN, STANDS]


def test_station_that_was_away_gets_the_value_again() -> None:
    line = Line(make_mapping('N7:0', 'Write', write_again=60_000), READ)
    row = line.mappings[0]
    line.keep_saying(row, [7], 1.0)
    line.run(1.1)
    line.there.faults.silent = True
    line.run(5.0)
    line.there.faults.silent = False
    line.run(10.0)
    line.write(row, [7], run=0.5)
    assert line.outcomes[-1] is WRITTEN


def test_text_and_read_write_rows_stand_too() -> None:
    text = make_mapping('ST9:0', 'ReadWrite', write_again=60_000, period=100)
    line = Line(text)
    line.keep_saying(text, 'on', 2.0)
    line.run(2.1)
    assert line.outcomes[-1] is STANDS
    line.write(text, 'off', run=0.5)
    assert line.outcomes[-1] is WRITTEN


def test_message_that_stands_feeds_its_fallback() -> None:
    row = make_mapping('N7:0', 'Write', write_again=60_000, fallback=Fallback((0,), 1000))
    cell = Cell(row, READ, run=3.0)
    bench = cell.bench
    store(cell.plc, 'N7:0', [0])
    begun = cell.now
    for number in range(50):
        bench.at(begun + number / 10, lambda: bench.write(row, [7]))
    cell.run(5.0)
    assert bench.listener.outcomes().count(STANDS) > 35
    assert bench.listener.outcomes().count(Outcome.FALLBACK) == 1  # of the start
    assert stored(cell.plc, 'N7:0') == b'\x07\x00'
    cell.run(1.5)  # the last message was published at 4.9 s
    assert bench.listener.results[-1].outcome is Outcome.FALLBACK
    assert stored(cell.plc, 'N7:0') == b'\x00\x00'
    bench.write(row, [7], run=0.5)
    assert bench.listener.outcomes()[-1] is WRITTEN


def test_message_that_stands_feeds_its_fallback_from_when_it_was_published() -> None:
    row = make_mapping('N7:0', 'Write', write_again=60_000, fallback=Fallback((0,), 1000))
    cell = Cell(row, READ, run=3.0)
    bench = cell.bench
    bench.write(row, [7], run=0.5)
    bench.write(row, [7], run=0.5, age=0.4)
    assert bench.listener.outcomes()[-1] is STANDS
    cell.refused, cell.spared = {'N7:0'}, 7
    cell.run(0.2)  # the fallback is due, and tried once a second
    for _ in range(2):
        bench.write(row, [7], run=0.3)
    assert bench.listener.outcomes()[-2:] == [WRITTEN, WRITTEN]
    cell.refused.clear()
    cell.run(1.0)
    assert bench.listener.outcomes()[-1] is Outcome.FALLBACK


def test_stopped_program_and_lost_port_end_it() -> None:
    row = make_mapping('N7:0', 'Write', write_again=60_000, fallback=Fallback((0,), 5000))
    other = make_mapping('N7:0', 'Write', write_again=60_000, station=2)
    for how in ('program', 'port', 'gateway'):
        cell = Cell(row, READ, other, make_mapping(station=2, period=100), start=False)
        bench = cell.bench
        bench.plc(2, 'PLC5', ('N7:0', 200))
        bench.open(run=3.0)
        bench.driver.stations[1].has_gateway = how == 'gateway'
        bench.write(other, [7])
        bench.write(row, [7], run=0.5)
        bench.write(row, [7], run=0.5)
        assert bench.listener.outcomes()[-1] is STANDS
        if how == 'program':
            cell.plc.processor.setting = Setting.PROGRAM
            cell.run(2.5)
        else:
            bench.lose_port()
            bench.open(run=0.5)
        bench.write(other, [7])
        bench.write(row, [7], run=0.5)
        are_known = [outcome is STANDS for outcome in bench.listener.outcomes()[-2:]]
        assert are_known == [how == 'program', False]
        bench.write(row, [7], run=0.5)  # a gateway may deliver another value until now
        assert (bench.listener.outcomes()[-1] is STANDS) is (how != 'gateway')


def test_equal_values_are_equal_whatever_packets_a_station_takes() -> None:
    """A station that names an old processor gets a long row in shorter packets."""
    row = make_mapping('N7:0', 'Write', plc='SLC', length=60, write_again=1000)
    sent, new = (Write(row, range(60), now) for now in (1.0, 2.0))
    packets = len(sent.commands)
    sent.speak(dialect_of(PlcType.SLC, processor=Processor.SLC_5_01))
    assert len(sent.commands) > packets
    assert sent.equals(new) and not sent.equals(Write(row, [*range(59), 0], 2.0))
