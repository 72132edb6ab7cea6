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

"""Topics that are published steadily: equal messages are one write, and no change is late."""

from collections.abc import Callable, Sequence
from itertools import count, groupby
from random import Random

from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.driver.kernel.waiting import MAX_WAITING_WRITES
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import pytest
from support.cases import long_unless
from support.driver_bench import DriverBench
from support.mappings import make_mapping

BIT = make_mapping('B3:0/0', 'Write')
NEIGHBOUR = make_mapping('B3:0/1', 'Write')
WORD = make_mapping('N7:0', 'Write')
ALL_STATIONS = make_mapping('N7:0', 'Write', station=255)

WRITTEN, SUPERSEDED = Outcome.WRITTEN.value, Outcome.SUPERSEDED.value
TOO_OLD = 'not written: not sent: waited longer than 2 s for the line'


class Line(DriverBench):
    """
    A driver of some rows and its PLC-5s, which answer late.

    ``shown`` is what the words of the first row have held after each write to its PLC.
    """

    def __init__(self, *rows: Mapping, write_timeout: float = 2.0) -> None:
        super().__init__(rows, network=Network(baud=19200, timeout=200), settings=DriverSettings(
            processor_period=0.0, write_timeout=write_timeout))
        self.shown: list[int] = []
        self.heard: list[int] = []  # for which station each of these was
        self._row = rows[0]
        self.plcs = {station: self._put(station) for station in (1, 2)}
        self.run(1.0)

    def _put(self, station: int) -> SimulatedPlc:
        plc = self.plc(station, 'PLC5', ('B3:0', 20), ('N7:0', 400), ('ST9:0', 84))
        plc.faults.delay = 0.02

        def serve(command: Packet) -> Packet:
            reply = plc.serve(command)
            if station == 1 and command.cmd == 0x0F and not reply.data:
                self.shown.append(self.value)
                self.heard.append(command.dst)
            return reply

        plc.slave = HalfDuplexSlave(LinkSettings(station=station), serve)
        return plc

    @property
    def value(self) -> int:
        """Return what the first word, or bit, of the first row holds."""
        word = int.from_bytes(self.plcs[1].table.read(self._row.address, 1), 'little')
        return word if self._row.address.bit is None else word >> self._row.address.bit & 1

    def say(self, row: Mapping, values: Sequence[float] | str, name: str = '') -> None:
        """Publish a message."""
        self.driver.write([row], values, self.clock(), name)
        self.line.wake(self.driver.machine)

    def keep_saying(self, row: Mapping, rate: float, seconds: float,
                    value: Callable[[], float]) -> None:
        """Publish so many messages a second for so long."""
        for number in range(int(rate * seconds)):
            self.at(self.clock() + number / rate, lambda: self.say(row, [value()] * row.length))

    def told(self) -> list[tuple[str, str]]:
        """Return the name of each message that has ended, and how."""
        return [(result.request, str(result)) for result in self.listener.results]


def test_bit_that_is_published_steadily_shows_its_change_at_once() -> None:
    """Where each message had a turn of its own, the change came after 2 s, or never."""
    reads = [make_mapping('B3:0', station=station, length=20, period=100) for station in (1, 2)]
    line = Line(BIT, *reads)
    begun = line.clock()
    line.keep_saying(BIT, 50, 10.0, lambda: float(line.clock() < begun + 5.0))
    line.run(10.1)
    values = [(when, values[0]) for when, row, values in line.listener.reads
              if row is reads[0] and when > begun + 5.0]
    assert next(when for when, value in values if not value) < begun + 5.5
    assert [*map(str, line.listener.results)] == [WRITTEN] * 500
    assert [value for value, _ in groupby(line.shown)] == [1, 0]


STEADY: list[tuple[str, dict[str, object]]] = [
    ('B3:0/0', {}), ('B3:0/0', {'length': 40}), ('N7:0', {}), ('N7:0', {'length': 200}),
    ('N7:0', {'command': 'ReadWrite'}), ('B3:0/3', {'command': 'ReadWrite'}),
    ('N7:0', {'fallback': Fallback((0,), 1000)})]


@pytest.mark.parametrize(('text', 'others', 'rate'), long_unless(
    lambda text, others, rate: rate == (5 if 'length' in others else 50),
    [(*topic, rate) for topic in STEADY for rate in (5, 50, 500)]))
def test_newest_state_of_a_steady_topic_always_arrives(
        text: str, others: dict[str, object], rate: int) -> None:
    row = make_mapping(text, **{'command': 'Write'} | others)  # type: ignore[arg-type]
    line, dice = Line(row), Random(1)
    for _ in range(5):
        last = 0.0

        def draw() -> float:
            nonlocal last
            last = float(dice.random() < 0.5)
            return last

        line.keep_saying(row, rate, 2.0, draw)
        line.run(2.0)
        line.run(1.7 if row.fallback is None else 0.7)
        assert line.value == last
    assert len(line.listener.results) >= 10 * rate


def test_each_change_and_back_is_written_in_its_order_between_equal_messages() -> None:
    line, said = Line(BIT, NEIGHBOUR), list[int]()
    for change in range(20):
        for _ in range(15):
            line.at(line.clock() + 0.3 * change, lambda change=change: (  # type: ignore[misc]
                line.say(BIT, [change % 2]), line.say(NEIGHBOUR, [1])))
        said.append(change % 2)
    line.run(10.0)
    assert [value for value, _ in groupby(line.shown)] == said
    assert {*map(str, line.listener.results)} == {WRITTEN}
    assert len(line.listener.results) == 600
    assert len(line.shown) < 90


def test_each_equal_message_has_its_own_result_with_its_own_time() -> None:
    line = Line(BIT)
    for name in 'abc':
        line.say(BIT, [1], name)
        line.run(0.001)
    line.run(1.0)
    assert line.told() == [('a', WRITTEN), ('b', WRITTEN), ('c', WRITTEN)]
    assert line.shown == [1, 1]  # the first was under way when the others came
    first, second, third = (result.latency for result in line.listener.results)
    assert second == pytest.approx(third + 0.001)
    assert second > first


def test_equal_messages_do_not_pass_another_write_of_the_same_words() -> None:
    pair = make_mapping('N7:0', 'Write', length=2)
    line = Line(WORD, pair)
    for row, values in ((WORD, [9]), (WORD, [1]), (pair, [2, 2]), (WORD, [1])):
        line.say(row, values)
    line.run(1.0)
    assert line.shown == [9, 1, 2, 1]


def test_message_after_a_broadcast_of_its_words_goes_after_it() -> None:
    line = Line(WORD, ALL_STATIONS)
    for row, value in ((WORD, 9), (WORD, 1), (ALL_STATIONS, 5), (WORD, 2)):
        line.say(row, [value])
    line.run(1.0)
    assert line.shown == [9, 1, 5, 2]
    for row, value in ((WORD, 9), (WORD, 2), (ALL_STATIONS, 5), (WORD, 2)):
        line.say(row, [value])
    line.run(1.0)
    assert line.shown[4:] == [9, 2, 5, 2]


def test_packets_of_a_broadcast_do_not_mix_with_those_of_a_station() -> None:
    long, to_all = (make_mapping('N7:0', 'Write', length=400, station=station)
                    for station in (1, 255))
    line = Line(long, to_all)
    for number in range(8):
        line.say([long, to_all][number % 2], [number] * 400)
        line.run(0.1)
    line.run(3.0)
    assert {len([*packets]) % 4 for _, packets in groupby(line.heard)} == {0}
    assert {*line.heard} == {1, 255}


def test_old_messages_end_though_a_young_one_stands_for_their_value() -> None:
    line = Line(BIT)
    line.plcs[1].faults.delay = 0.15
    line.say(BIT, [0], 'under way')
    for name, age in (('old', 1.9), ('young', 0.0)):
        line.driver.write([BIT], [1], line.clock() - age, name)
    line.run(1.0)
    assert line.told() == [('under way', WRITTEN), ('old', TOO_OLD), ('young', WRITTEN)]


def test_changes_that_the_line_does_not_carry_give_way_to_newer_ones() -> None:
    rows = [make_mapping(f'B3:{word}/0', 'Write', station=1 + word % 2) for word in range(16)]
    line = Line(*rows)
    for row in rows:
        line.keep_saying(row, 20, 5.0, lambda: float(int(line.clock() * 20) % 2))
    line.run(5.0)
    for row in rows:
        line.say(row, [1])
    line.run(2.0)
    for row in rows:
        assert line.plcs[row.station].table.read(row.address, 1) == b'\1\0'
    outcomes = line.listener.outcomes()
    assert {*outcomes} == {Outcome.WRITTEN, Outcome.SUPERSEDED}
    assert len(outcomes) == 16 * 101


def test_lone_pulse_is_not_lost_beside_topics_that_never_rest() -> None:
    line = Line(NEIGHBOUR, BIT)
    line.keep_saying(BIT, 50, 4.0, lambda: float(int(line.clock() * 50) % 2))
    line.run(2.0)
    line.say(NEIGHBOUR, [1])
    line.say(NEIGHBOUR, [0])
    line.run(3.0)
    assert [value for value, _ in groupby(line.shown)] == [0, 1, 0]


def test_more_changes_than_may_wait_never_keep_the_newest_out() -> None:
    line = Line(BIT, NEIGHBOUR)
    line.say(NEIGHBOUR, [1], 'lone')
    for number in range(2 * MAX_WAITING_WRITES + 1):
        line.say(BIT, [number % 2], str(number))
        line.run(0.0001)
    ended = [int(name) for name, how in line.told() if how == SUPERSEDED]
    assert len(ended) > MAX_WAITING_WRITES - 99 and ended[0] < 99  # the oldest
    line.say(BIT, [1], 'newest')
    line.run(4.0)
    assert line.value == 1
    assert {('lone', WRITTEN), ('newest', WRITTEN)} <= {*line.told()}
    assert len(line.listener.results) == 2 * MAX_WAITING_WRITES + 3


@pytest.mark.parametrize(('step', 'dropped'), [(0.0001, 2), (0.0, 0)])
def test_too_many_equal_messages_lose_the_oldest_unless_all_are_as_old(
        step: float, dropped: int) -> None:
    line = Line(BIT)
    moments = count(line.clock(), step)
    line.say(BIT, [0])
    for _ in range(2):
        line.run(0.001)
        for _ in range(MAX_WAITING_WRITES // 2 + 1):
            line.driver.write([BIT], [1], next(moments))
        line.line.wake(line.driver.machine)
    line.run(1.0)
    outcomes = [result.outcome for result in line.listener.results]
    assert outcomes[:dropped + 1].count(Outcome.SUPERSEDED) == dropped
    assert outcomes.count(Outcome.WRITTEN) == MAX_WAITING_WRITES + 3 - dropped


def test_message_that_is_too_old_takes_no_place_of_a_younger_one() -> None:
    row = make_mapping('N7:0', 'Write', fallback=Fallback((7,), 1000))
    line = Line(row)
    line.run(3.0)
    line.say(row, [1])
    line.driver.write([row], [2], line.clock(), 'young')
    line.driver.write([row], [3], line.clock() - 1.5, 'old')
    line.run(0.5)
    assert line.value == 2
    assert ('young', WRITTEN) in line.told()


def test_fallback_drops_every_message_that_waits() -> None:
    row = make_mapping('N7:0', 'Write', fallback=Fallback((7,), 1000))
    line = Line(row)
    line.plcs[1].faults.delay = 3.0
    for name in 'abcd':
        line.driver.write([row], [1], line.clock(), name)
    line.run(20.0)
    assert sorted(name for name, _ in line.told() if name) == [*'abcd']
    line.plcs[1].faults.delay = 0.0
    line.run(20.0)
    assert line.value == 7
