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

"""What is said of a write whose reply was lost, after the PLC has been read."""

from collections.abc import Callable
import math

from abdf1_ros.df1.frames import STX
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.kernel.flights import Flights
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome, Write, WriteResult
from abdf1_ros.errors import CommandTimeout, RemoteError
from abdf1_ros.plan.forecast import line_model
from abdf1_ros.plan.planner import Block, Planner
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
import pytest
from support.cases import for_all
from support.clock import StillClock
from support.driver_bench import DriverBench
from support.mappings import make_mapping

PATIENCE = 2.0
EARLY = 10.0


def block_of(mapping: Mapping) -> Block:
    """Return the block that reads a mapping alone."""
    block, = Planner(line_model(Network()), 1.0).plan([mapping])
    return block


class Unconfirmed:
    """One write without a reply, which some block reads."""

    def __init__(self, read: Mapping, mapping: Mapping, values: list[float] | str) -> None:
        self.block = block_of(read)
        self.results: list[WriteResult] = []
        self.line = StillClock(EARLY)
        self.flights = Flights(
            self.line, 1.0, ActiveStationList(), PATIENCE, self.results.append)
        self.add(mapping, values)

    def add(self, mapping: Mapping, values: list[float] | str) -> None:
        write = Write(mapping, values, EARLY)
        lost = write.result(Outcome.UNKNOWN, 'lost', CommandTimeout())
        flight = self.flights.begin(mapping.station, [mapping.extent], write)
        self.flights.tell(flight, lost, is_read=self.block.extent.holds(mapping.extent))
        self.flights.ended(flight, lost.outcome, lost.error)

    def read(self, data: bytes, started: float = EARLY) -> None:
        self.line.now = EARLY + 1
        self.flights.words_read(self.block, data, started)

    @property
    def details(self) -> list[str]:
        """Return what was said; the outcome stays what it was."""
        assert all(result.outcome is Outcome.UNKNOWN for result in self.results)
        return [result.detail for result in self.results]


HELD = 'lost; read back: the PLC holds the value'
OVERTAKEN = 'lost; not read back: a newer write of these words has gone out'
OTHER = 'lost; read back: the PLC holds another value'


@for_all(('cells', 'values', 'data', 'detail'), [
    ({}, [-2], b'\xfe\xff', HELD), ({}, [-2], b'\xff\xff', OTHER),
    ({'kind': 'bcd16'}, [1234], b'\x34\x12', HELD),
    ({'kind': 'bcd16'}, [1234], b'\x3a\x12', OTHER),
    ({'text': 'F8:0'}, [0.1], b'\xcd\xcc\xcc\x3d', HELD),
    ({'text': 'B3:0/4', 'length': 2}, [1, 0], b'\xd7\xff', HELD),  # neighbours do not count
    ({'text': 'B3:0/4', 'length': 2}, [1, 0], b'\x20\x00', OTHER),
    ({'text': 'ST9:0'}, 'ab', b'\x02\x00ba' + bytes(82), HELD),
    ({'text': 'ST9:0'}, 'ab', b'\x02\x00ab' + bytes(82), OTHER),
    ({'text': 'ST9:0'}, 'ab', b'\xff\xff' + bytes(84), OTHER)])
def test_what_is_read_is_compared(cells: dict[str, str], values: list[float] | str, data: bytes,
                                  detail: str) -> None:
    mapping = make_mapping(command='ReadWrite', **cells)  # type: ignore[arg-type]
    unconfirmed = Unconfirmed(mapping, mapping, values)
    assert unconfirmed.details == []
    unconfirmed.read(data)
    assert unconfirmed.details == [detail]
    assert unconfirmed.results[0].latency == 1.0
    unconfirmed.read(data)
    assert len(unconfirmed.results) == 1


@for_all(('sts', 'expected'), [(0x02, True), (0x10, False)])
def test_status_of_a_gateway_confirms_nothing(sts: int, expected: bool) -> None:
    write = Write(make_mapping(command='Write'), [1], EARLY)
    assert write.result(Outcome.UNKNOWN, '', RemoteError(sts, None, '')).is_unconfirmed is expected


def test_words_are_found_within_a_larger_block() -> None:
    unconfirmed = Unconfirmed(make_mapping('N7:0', length=4), make_mapping('N7:2', 'Write'), [5])
    unconfirmed.read(b'\5\0\5\0\5\0\6\0')
    assert unconfirmed.details == [HELD]


@for_all(('text', 'length', 'station'), [
    ('N7:1', 2, 1), ('N7:0', 1, 2), ('N8:0', 1, 1), ('N7:2', 1, 1)])
def test_nothing_reads_all_of_the_words(text: str, length: int, station: int) -> None:
    mapping = make_mapping(text, 'Write', length=length, station=station)
    unconfirmed = Unconfirmed(make_mapping('N7:0', length=2), mapping, [1] * length)
    assert unconfirmed.details == ['lost; not read back: no row reads all of these words']
    assert unconfirmed.flights.next_expiry == math.inf


def test_read_that_began_before_the_write_ended_says_nothing() -> None:
    mapping = make_mapping('N7:0', 'ReadWrite')
    unconfirmed = Unconfirmed(mapping, mapping, [5])
    unconfirmed.read(b'\5\0', EARLY - 0.001)
    unconfirmed.flights.words_read(block_of(make_mapping('N9:0')), b'\5\0', EARLY)  # of others
    other = Unconfirmed(mapping, mapping, [5])
    other.flights.port_lost()  # the port of another line is lost
    assert (len(other.details), unconfirmed.details) == (1, [])


def test_read_back_that_does_not_come_ends_when_patience_does() -> None:
    mapping = make_mapping('N7:0', 'Write')
    unconfirmed = Unconfirmed(make_mapping('N7:0', length=2), mapping, [5])
    unconfirmed.line.now = EARLY + 1.5
    unconfirmed.add(make_mapping('N7:1', 'Write', tag='later'), [6])
    for number, end in enumerate((EARLY, EARLY + 1.5)):
        assert unconfirmed.flights.next_expiry == end + PATIENCE
        unconfirmed.flights.expire(end + PATIENCE - 0.001)
        assert len(unconfirmed.details) == number
        unconfirmed.flights.expire(end + PATIENCE)
    assert unconfirmed.details == 2 * ['lost; not read back within 2 s']
    assert unconfirmed.flights.next_expiry == math.inf


@pytest.mark.parametrize(('text', 'is_overtaken'), [('N7:0', True), ('N7:1', False)])
def test_newer_write_ends_the_wait_for_the_same_words(text: str, is_overtaken: bool) -> None:
    mapping = make_mapping('N7:0', 'ReadWrite')
    for newer in (Write(make_mapping(text, 'Write'), [6], EARLY), None):  # a guest's
        unconfirmed = Unconfirmed(mapping, mapping, [5])
        unconfirmed.flights.begin(1, [make_mapping(text).extent], newer)
        assert unconfirmed.details == ([OVERTAKEN] if is_overtaken else [])


def bench_of(text: str = 'N7:0', **cells: int) -> tuple[DriverBench, Mapping]:
    """Return a driver that reads and writes one address of a PLC-5, slowly."""
    mapping = make_mapping(text, 'ReadWrite', period=60_000, **cells)  # type: ignore[arg-type]
    bench = DriverBench([mapping], settings=DriverSettings(write_timeout=PATIENCE))
    bench.plc(1, 'PLC5', ('N7:0', 10), ('B3:0', 10))
    bench.run(1.0)
    return bench, mapping


@pytest.mark.parametrize(('which', 'through', 'detail', 'held'), [
    ('say', lambda data: b'' if data.startswith(STX) else data,
     'read back: the PLC holds the value', b'\7\0'),
    ('hear', lambda data: b'', 'read back: the PLC holds another value', b'\0\0')])
def test_lost_reply_and_lost_command_are_told_apart(
        which: str, through: Callable[[bytes], bytes], detail: str, held: bytes) -> None:
    bench, mapping = bench_of()
    setattr(bench.far, which, through)
    bench.driver.write([mapping], [7], bench.clock())
    bench.write(mapping, [7])  # both wait as one
    bench.at(bench.clock() + 0.75, lambda: setattr(bench.far, which, bytes))
    bench.run(1.5)
    result, _ = bench.listener.results
    assert (result.outcome, bench.driver.stations[1].failures) == (Outcome.UNKNOWN, 1)
    assert result.detail.endswith(f'; {detail}')
    assert result.latency < 1.2
    assert bench.listener.values(mapping)[-1] == [int.from_bytes(held, 'little')]


def test_lost_port_leaves_no_write_without_a_result() -> None:
    bench, mapping = bench_of()
    bench.far.say = lambda data: b'' if data.startswith(STX) else data
    for value in (7, 8):
        bench.write(mapping, [value], run=1.0)
    bench.lose_port()
    assert [result.detail.partition('; ')[2] for result in bench.listener.results] == [
        OVERTAKEN[6:], 'not read back before the line went down']
    assert bench.listener.results[0].latency >= 1.0
    bench.far.say = bytes
    bench.open(run=5.0)
    assert len(bench.listener.results) == 2
