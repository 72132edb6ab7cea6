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

"""The driver against simulated PLCs on a virtual line."""

import math
import random

from abdf1_ros.df1 import frames
from abdf1_ros.df1.frames import Frame, Poll, Symbol
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.reads.demands import ReadAnswer
from abdf1_ros.driver.reads.point import Freshness
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.driver.writes import packets
from abdf1_ros.messages import Event
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.values import Values
from abdf1_ros.plan.forecast import block_time
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import InjectedFaults, SimulatedPlc
import pytest
from support.driver_bench import DriverBench, store, stored
from support.mappings import make_mapping

FILES = (('N7:0', 256), ('N9:0', 10), ('F8:0', 64), ('B3:0', 16), ('T4:0', 30))


class RecordingPlc:
    """A PLC, in its place on the line, whose commands are kept, with the time they came."""

    def __init__(self, bench: DriverBench, plc: SimulatedPlc) -> None:
        self.commands: list[tuple[float, Packet]] = []
        self._bench, self._plc = bench, plc
        bench.far_stations[bench.far_stations.index(plc)] = self

    def handle(self, symbol: Symbol) -> bytes:
        """Answer as the PLC does."""
        if isinstance(symbol, Frame) and symbol.station == self._plc.station \
                and symbol.fault is None:
            self.commands.append((self._bench.clock(), Packet.decode(symbol.data)))
        return self._plc.handle(symbol)

    def functions(self) -> list[int]:
        """Return the function code of every command."""
        return [packet.data[0] for _, packet in self.commands]


def make_bench(*mappings: Mapping, network: Network | None = None, start: bool = True,
               run: float = 0.0, **settings: float) -> tuple[DriverBench, SimulatedPlc]:
    """Return a bench with one PLC-5, station 1, of all files, after so many seconds."""
    bench = DriverBench(mappings, network=network,
                        settings=DriverSettings(**settings), start=start)  # type: ignore
    plc = bench.plc(1, 'PLC5', *FILES)
    if run:
        bench.run(run)
    return bench, plc


def test_long_mapping_comes_in_several_packets_and_is_published_once_a_period() -> None:
    mapping = make_mapping('N7:0', length=250, period=1000)
    bench, plc = make_bench(mapping)
    recording = RecordingPlc(bench, plc)
    store(plc, 'N7:0', range(250))
    bench.run(1.5)
    assert bench.listener.values(mapping) == [list(range(250))] * 2
    assert recording.functions() == [0x68] * 6


def test_read_soon_after_a_late_one_is_published_too() -> None:
    mapping = make_mapping('N7:0', period=100)
    bench, plc = make_bench(mapping, network=Network(baud=115200, timeout=200))
    recording = RecordingPlc(bench, plc)
    bench.run(0.05)
    plc.faults.delay = 0.08
    bench.run(0.1)
    plc.faults.delay = 0.0
    bench.run(0.1)
    assert bench.listener.values(mapping) == [[0]] * 3
    assert [when for when, _ in recording.commands] == pytest.approx([0.0, 0.1, 0.2], abs=0.02)


@pytest.mark.parametrize('plc, function', [('PLC5', 0x26), ('SLC', 0xAB)])
def test_bit_write_leaves_alone_what_the_plc_changes_meanwhile(plc: str, function: int) -> None:
    mapping = make_mapping('B3:0/4', 'ReadWrite', plc=plc)
    bench = DriverBench([mapping])
    machine = bench.plc(1, plc, ('B3:0', 4))
    recording = RecordingPlc(bench, machine)
    bench.run(0.5)

    def change_neighbours(data: bytes) -> bytes:
        if data.startswith(b'\x10\x01'):  # while the command is on the line
            store(machine, 'B3:0', [0xFFEF])
        return data

    bench.far.hear = change_neighbours
    bench.write(mapping, [1])
    bench.run_until(lambda: bool(bench.listener.results))
    assert stored(machine, 'B3:0') == b'\xff\xff'
    assert function in recording.functions()
    assert set(recording.functions()) <= {function, 0x68, 0xA2}


class BrokenList(list[Event]):
    """A list that takes nothing."""

    def append(self, event: Event) -> None:
        """Fail."""
        raise ZeroDivisionError


def write_results(bench: DriverBench) -> list[str]:
    return [str(result) for result in bench.listener.results]


def written(bench: DriverBench, row: Mapping, values: list[float], seconds: float) -> list[str]:
    """Write, let time pass, and return all results."""
    bench.write(row, values, run=seconds)
    return write_results(bench)


def test_not_sent_to_an_inactive_station() -> None:
    mapping = make_mapping('N7:0', 'ReadWrite')
    bench, plc = make_bench(mapping)
    plc.faults.silent = True
    bench.run_until(lambda: bench.listener.changes == [(1, False)])
    assert written(bench, mapping, [1], 1.0) == [
        'not written: not sent: 2509 ERR_INACTIVE_STATION: Slave Station (1) Inactive']
    assert stored(plc, 'N7:0') == b'\0\0'


def test_unknown_when_the_driver_itself_fails_meanwhile() -> None:
    mapping, waiting = make_mapping('N7:0', 'Write'), make_mapping('N7:1', 'Write')
    bench, _ = make_bench(mapping, waiting, run=0.5)
    bench.write(mapping, [1])
    bench.write(waiting, [1])

    bench.listener.events = BrokenList()
    with pytest.raises(ZeroDivisionError):
        bench.run(5.0)
    bench.lose_port('internal error, see the log')  # as the thread of the link does
    assert sorted(write_results(bench)) == [
        'not written: not sent: port lost: internal error, see the log',
        'unknown whether written: port lost: internal error, see the log; not read back: no row '
        'reads all of these words']
    assert not bench.driver.is_online


def test_message_has_a_result_where_the_driver_fails_in_its_write(
        monkeypatch: pytest.MonkeyPatch) -> None:
    mapping = make_mapping('N7:0', 'Write')
    bench, _ = make_bench(mapping, run=0.5)

    def fail(reply: Packet, address: Address) -> bytes:
        raise ZeroDivisionError

    monkeypatch.setattr(packets, 'data_of', fail)
    bench.write(mapping, [1])
    with pytest.raises(ZeroDivisionError):
        bench.run(1.0)
    bench.lose_port('internal error, see the log')
    assert write_results(bench) == [
        'unknown whether written: port lost: internal error, see the log; not read back: no row '
        'reads all of these words']


def test_read_goes_on_after_the_driver_itself_has_failed() -> None:
    mapping, other = make_mapping('N7:0'), make_mapping('F8:0')
    bench, _ = make_bench(mapping, other)
    take = bench.listener.read

    def break_down(mapping: Mapping, values: Values) -> None:
        raise ZeroDivisionError

    bench.listener.read = break_down  # type: ignore[method-assign]
    with pytest.raises(ZeroDivisionError):
        bench.run(5.0)
    bench.lose_port('internal error, see the log')  # as the thread of the link does
    assert bench.driver.points[mapping].freshness(bench.clock()) is Freshness.FAILED
    bench.listener.read = take  # type: ignore[method-assign]
    bench.open(run=1.0)
    assert len(bench.listener.values(mapping)) >= 9
    assert len(bench.listener.values(other)) >= 9


def test_points_have_failed_when_the_port_is_lost_and_the_first_read_is_published() -> None:
    mapping, slow = make_mapping('N7:0', publish='Change'), make_mapping('F8:0', period=60_000)
    own = make_mapping('N9:0', 'Serve', station=0, publish='Change')
    bench, _ = make_bench(mapping, slow, own, run=1.0)
    bench.driver.readings.served(own, bytes(2))
    bench.lose_port('unplugged')
    point = bench.driver.points[mapping]
    assert (point.freshness(bench.clock()), point.error) == (
        Freshness.FAILED, 'port lost: unplugged')
    assert bench.driver.points[own].error is None  # its words are here
    bench.open(run=1.0)
    bench.driver.readings.served(own, bytes(2))
    for row in (mapping, slow, own):
        assert bench.listener.values(row) == [[0], [0]]


def test_every_write_ends_once_on_a_line_that_fails_in_every_way() -> None:
    mappings = [
        make_mapping(text, 'ReadWrite', length=length, write_again=5000) for text, length in (
            ('N7:0', 1), ('N7:10', 150), ('B3:0/3', 2), ('F8:2', 1))]
    bench, plc = make_bench(*mappings, write_timeout=0.4)
    dice = random.Random(7)
    asked = 0

    def damage(data: bytes) -> bytes:
        return data if dice.random() > 0.08 else data[:-1]

    bench.far.hear = bench.far.say = damage
    for _ in range(600):
        mapping = dice.choice(mappings)
        bench.write(mapping, [dice.randrange(2)] * (mapping.length + (dice.random() < 0.05)))
        asked += 1
        bench.run(dice.choice([0.0, 0.0, 0.01, 0.05, 0.3]))
        if dice.random() < 0.05:
            bench.lose_port()
            bench.run(dice.random())
            bench.open()
        plc.faults.silent = dice.random() < 0.02
        plc.faults.status = (0x50,) if dice.random() < 0.05 else ()
    plc.faults.silent = False
    bench.far.hear = bench.far.say = bytes
    bench.run(10.0)
    assert len(bench.listener.results) == asked
    assert set(bench.listener.outcomes()) == set(Outcome) - {Outcome.BROADCAST, Outcome.FALLBACK}


def test_address_that_the_plc_refuses_takes_down_only_its_own_mapping() -> None:
    good = [make_mapping(f'N9:{n}') for n in (0, 1, 2, 3, 5)]
    bad = make_mapping('N9:12')  # the file has ten words
    bench, _ = make_bench(*good[:3], bad, *good[3:], start=False)
    assert len(bench.driver.readings.blocks) == 1
    bench.open(run=2.0)
    assert all(len(bench.listener.values(mapping)) >= 15 for mapping in good)
    assert bench.listener.values(bad) == []
    point = bench.driver.points[bad]
    assert point.freshness(bench.clock()) is Freshness.FAILED
    assert point.error == 'STS F0 EXT STS 07: file has the wrong size'
    assert bench.listener.reasons == [('N9:12', point.error)]
    assert all(bench.driver.points[mapping].error is None for mapping in good)
    assert sorted(block.span.words for block in bench.driver.readings.blocks) == [1, 6]
    assert any(block.mappings == (bad,) for block in bench.driver.readings.blocks)


@pytest.mark.parametrize(('words', 'beat'), [(6, 8), (7, 6), (7, 7)])
def test_address_that_comes_into_being_is_read_with_its_neighbours_again(
        words: int, beat: int) -> None:
    """A Heartbeat row has no value that fails, yet its word is read like all others."""
    bench = DriverBench([make_mapping(f'N9:{n}', 'Heartbeat' if n == beat else 'Read', plc='SLC',
                                      period=200) for n in range(8)])
    plc = bench.plc(1, 'SLC', ('N9:0', words))
    bench.run(2.0)
    assert len(bench.driver.readings.blocks) == 9 - words
    plc.table.create(parse_address('N9:0', PlcType.SLC), 8)
    bench.run(2.0)
    assert len(bench.driver.readings.blocks) == 1
    assert all(point.error is None for point in bench.driver.points.values())


def test_slow_mapping_that_is_read_with_fast_ones_is_published_at_its_own_pace() -> None:
    fast, slow = make_mapping('N7:0', period=100), make_mapping('N7:1', 'ReadWrite', period=1000)
    bench, _ = make_bench(fast, slow, run=5.05)
    assert len(bench.driver.readings.blocks) == 1
    assert len(bench.listener.values(fast)) == 51
    assert len(bench.listener.values(slow)) == 6
    bench.write(slow, [5], run=0.1)
    assert bench.listener.values(slow)[6:] == [[5]]


def test_plc_that_acknowledges_and_does_not_reply_has_no_row_that_looks_well() -> None:
    rows = [make_mapping('N7:0', period=100), make_mapping('F8:0', period=3_600_000)]
    bench, plc = make_bench(*rows, run=1.0)
    plc.faults.slow = 10**9  # ACK of each command, EOT for each poll
    bench.run(5.0)
    assert bench.driver.stations[1].active
    assert [bench.driver.points[row].error is None for row in rows] == [False] * 2


def test_plc_in_trouble_fails_the_points_and_divides_nothing() -> None:
    mappings = [make_mapping('N7:0'), make_mapping('N7:1')]
    bench, plc = make_bench(*mappings, run=1.0)
    plc.faults.status = (0x70,)
    bench.run(1.0)
    assert len(bench.driver.readings.blocks) == 1
    assert [bench.driver.points[mapping].error for mapping in mappings] == [
        'STS 70: processor is in program mode'] * 2
    assert [address for address, _ in bench.listener.reasons] == ['N7:0', 'N7:1']
    assert bench.driver.readings.reads.poll_cycle is None
    plc.faults.status = ()
    bench.run(1.0)
    assert all(bench.driver.points[mapping].error is None for mapping in mappings)


def test_value_that_is_none_fails_only_its_own_mapping() -> None:
    digits, word = make_mapping('N7:0', kind='bcd16'), make_mapping('N7:1')
    bench, plc = make_bench(digits, word)
    store(plc, 'N7:0', [0x0A])
    bench.run(1.0)
    assert bench.listener.values(digits) == []
    assert bench.driver.points[digits].error == 'word 000A is not BCD'
    assert len(bench.listener.values(word)) >= 9
    answers: list[ReadAnswer] = []
    bench.driver.read_now(digits, answers.append)
    bench.run(1.0)
    assert [answer.error for answer in answers] == ['word 000A is not BCD']


def test_all_points_of_a_station_fail_with_it_and_are_read_again_with_it() -> None:
    living = make_mapping('N7:0', station=1)
    mappings = [make_mapping(f'N{file}:0', station=2) for file in (7, 9, 10)]
    bench, _ = make_bench(living, *mappings)
    plc = bench.plc(2, 'PLC5', ('N7:0', 4), ('N9:0', 4), ('N10:0', 4))
    bench.run(1.0)
    plc.faults.silent = True
    bench.run_until(lambda: bool(bench.listener.changes))
    assert all(bench.driver.points[mapping].freshness(bench.clock()) is Freshness.FAILED
               for mapping in mappings)
    assert bench.driver.stations[2].failures == 1
    assert bench.driver.points[living].error is None
    bench.run(5.0)
    assert bench.driver.stations.words()[0] == 0b10
    bench.listener.reads.clear()
    plc.faults.silent = False
    bench.run_until(lambda: bool(bench.listener.values(mappings[0])), limit=1.7)
    assert bench.listener.changes == [(2, False), (2, True)]
    bench.run(0.1)
    assert all(bench.listener.values(mapping) for mapping in mappings)


def test_transaction_number_never_repeats_the_last_of_a_station() -> None:
    mappings = [make_mapping('N7:0', station=1), make_mapping('N7:0', station=2)]
    bench = DriverBench(mappings, settings=DriverSettings(first_tns=0xFFFD), start=False)
    plcs = [RecordingPlc(bench, bench.plc(number, 'PLC5', ('N7:0', 4))) for number in (1, 2)]
    bench.open(run=1.0)
    numbers = [packet.tns for _, packet in sorted(
        plcs[0].commands + plcs[1].commands, key=lambda entry: entry[0])]
    assert numbers[:4] == [0xFFFE, 0xFFFF, 0, 1]
    assert len(set(numbers)) == len(numbers)


@pytest.mark.parametrize('nak', [None, True])
def test_station_that_is_never_ready_leaves_the_line_to_the_others(nak: bool | None) -> None:
    late = [make_mapping(f'N{file}:0', station=1) for file in (7, 9)]
    living = make_mapping('N7:0', station=2)
    bench = DriverBench([*late, living], network=Network(baud=115200, cmd_timeout=500),
                        settings=DriverSettings(nak_on_command_timeout=nak))
    stuck = bench.plc(1, 'PLC5', *FILES)
    bench.plc(2, 'PLC5', *FILES)
    bench.run(1.0)
    stuck.faults.delay = 60.0
    bench.run(4.0)
    bench.listener.reads.clear()
    bench.run(40.0)
    assert len(bench.listener.times(living)) > 0.85 * 400  # of one each 100 ms
    assert all(bench.driver.points[mapping].error is not None for mapping in late)
    # Without a reset it has no room for a fifth command, so it acknowledges none (M 3-8).
    assert bench.driver.stations[1].active is bool(nak)
    stuck.faults = InjectedFaults()
    bench.run_until(lambda: {*late} <= {mapping for _, mapping, _ in bench.listener.reads},
                    8.0 if nak else 30.0)


def test_reply_of_the_wrong_length_or_type_is_not_published() -> None:
    mapping = make_mapping('N7:0', length=2)
    bench = DriverBench([mapping, make_mapping('N7:5')])
    answers = [b'', b'\x00', b'\x42\1\0', bytes.fromhex('97 09 42 01 00 02 00 03 00'),
               bytes.fromhex('96 09 94 08 00 00 c0 3f'), b'\xff' * 20]

    class Odd:
        """Give one of the answers after the other."""

        def __init__(self) -> None:
            self.ready: bytes = b''

        def handle(self, symbol: Symbol) -> bytes:
            """Answer what is no integer array of two."""
            if isinstance(symbol, Frame) and symbol.station == 1:
                packet = Packet.decode(symbol.data)
                self.ready = frames.message_frame(
                    packet.reply(answers[packet.tns % len(answers)]).encode(),
                    bench.network.checksum)
                return frames.ACK
            return self.ready if isinstance(symbol, Poll) else b''

    bench.connect(Odd())
    bench.run(3.0)
    assert bench.driver.tasks.transactions >= len(answers)
    assert bench.listener.reads == []
    assert str(bench.driver.points[mapping].error).startswith('unusable reply: ')
    assert len(bench.driver.readings.blocks) == 1  # it was no refusal of one of them


def test_write_does_not_wait_for_all_packets_of_a_long_read() -> None:
    long = make_mapping('N7:0', length=256, plc='SLC')
    mapping = make_mapping('B3:0/0', 'Write', plc='SLC')
    bench = DriverBench([long, mapping], network=Network(baud=9600), start=False)
    recording = RecordingPlc(bench, bench.plc(1, 'SLC', ('N7:0', 256), ('B3:0', 16)))
    bench.open(run=0.05)
    bench.write(mapping, [1])
    bench.run_until(lambda: bool(bench.listener.reads))
    assert recording.functions() == [0xA2, 0xAB, 0xA2, 0xA2]
    assert bench.listener.outcomes() == [Outcome.WRITTEN]


def test_stale_time_follows_the_period_or_the_line() -> None:
    fast, slow = make_mapping('N7:0', period=10), make_mapping('F8:0', period=1000)
    wanted = make_mapping('N9:0', is_on_demand=True)
    own = make_mapping('N10:0', 'Serve', station=0, period=1000)
    bench, _ = make_bench(
        fast, slow, wanted, own, stale_after=5.0, network=Network(baud=1200), start=False)
    scan = bench.driver.readings.expected_poll_cycle
    blocks = bench.driver.readings.blocks
    assert scan == pytest.approx(sum(block.line_time + 0.02 for block in blocks))
    assert 0.4 < scan < 1.0
    times = {block.period: block_time(block) for block in blocks}
    needed = times[0.01] / 0.01 + times[1.0] / 1.0
    longest = max(times.values())
    assert bench.driver.points[fast].stale_time == pytest.approx(5 * 0.01 * needed + longest)
    assert bench.driver.points[slow].stale_time == pytest.approx(5 * (1.0 + scan) + longest)
    assert bench.driver.points[wanted].stale_time == 5.0  # as if it were read once a second
    assert bench.driver.points[own].stale_time == 5.0


def test_slow_rows_do_not_make_the_stale_time_of_fast_ones_longer() -> None:
    fast = make_mapping('N7:0', period=200)
    slow = [make_mapping(f'N{file}:0', length=20, period=20_000) for file in range(9, 39)]
    bench, _ = make_bench(fast, *slow, stale_after=3.0, network=Network(baud=9600), start=False)
    assert bench.driver.readings.expected_poll_cycle > 2.5
    wait = max(map(block_time, bench.driver.readings.blocks))
    assert bench.driver.points[fast].stale_time == pytest.approx(0.6 + wait)
    assert wait < 0.2
    assert bench.driver.points[slow[0]].stale_time == pytest.approx(60 + wait)


def test_slow_row_that_is_read_with_a_fast_one_keeps_its_own_stale_time() -> None:
    fast, slow = make_mapping('N7:0', period=200), make_mapping('N7:1', period=400)
    bench, _ = make_bench(fast, slow, stale_after=3.0, start=False)
    block, = bench.driver.readings.blocks
    assert bench.driver.points[fast].stale_time == pytest.approx(0.6 + block_time(block))
    assert bench.driver.points[slow].stale_time == pytest.approx(1.2 + block_time(block))


def test_long_read_that_a_lost_port_has_broken_off_begins_anew() -> None:
    fast, long = make_mapping('N9:0', period=20), make_mapping('N7:0', length=250, period=1000)
    bench, plc = make_bench(fast, long, network=Network(baud=115200, timeout=200))
    job, = (job for job in bench.driver.readings.reads.jobs if job.block.mappings == (long,))
    bench.run_until(lambda: job.is_unfinished)  # while the fast one has the line
    bench.lose_port()
    store(plc, 'N7:0', [1] * 250)
    bench.run(60.0)
    bench.open(run=0.5)
    values = bench.listener.values(long)
    assert values and all(entry == [1] * 250 for entry in values)
    assert (bench.driver.readings.reads.longest_poll_cycle or 0) < 1


@pytest.mark.parametrize('baud', [1200, 9600, 38400])
def test_poll_cycle_is_close_to_the_expected_one_on_a_saturated_line(baud: int) -> None:
    mappings = [make_mapping(f'{text}', length=length, period=0) for text, length in (
        ('N7:0', 40), ('F8:0', 10), ('B3:0', 4), ('T4:0', 9))]
    bench, _ = make_bench(*mappings, network=Network(baud=baud), run=20.0)
    assert bench.driver.readings.reads.poll_cycle is not None
    expected = bench.driver.readings.expected_poll_cycle - 4 * 0.02  # our PLC answers at once
    assert bench.driver.readings.reads.poll_cycle == pytest.approx(expected, rel=0.03, abs=0.002)


def test_driver_without_stations_rests_until_a_write_comes() -> None:
    mapping = make_mapping('N7:0', 'Write', station=255)
    bench, plc = make_bench(mapping)
    assert bench.driver.machine.deadline == math.inf
    bench.run(100.0)
    assert bench.driver.counters.chars_sent == 0
    bench.write(mapping, [3], run=0.1)
    assert stored(plc, 'N7:0') == b'\3\0'


def test_settings_of_the_net_file_reach_the_line() -> None:
    mapping = make_mapping('N7:0')
    network = Network(baud=115200, station=77, timeout=50, nak_retries=2, cmd_timeout=500)
    bench, plc = make_bench(mapping, network=network)
    recording = RecordingPlc(bench, plc)
    bench.run(0.05)
    assert recording.commands[0][1].src == 77
    plc.faults.silent = True
    began = len(recording.commands)
    bench.run_until(lambda: bool(bench.listener.changes))
    times = [when for when, _ in recording.commands[began:]]
    assert len(times) == 3  # one and two retries
    gaps = [after - before for before, after in zip(times, times[1:])]
    assert gaps == pytest.approx([0.05] * 2, abs=0.005)


@pytest.mark.parametrize('nak', [True, False])
def test_nak_after_a_command_timeout_is_a_setting(nak: bool) -> None:
    bench, plc = make_bench(make_mapping('N7:0'), nak_on_command_timeout=nak)
    plc.faults.slow = 10_000
    bench.run(2.0)
    assert (bench.driver.counters.naks_sent > 0) is nak
    assert 2508 in bench.listener.numbers()


class DeafPlc:
    """A PLC with another Error_Code: it takes polls, whose check is always a BCC, alone."""

    def __init__(self, plc: SimulatedPlc) -> None:
        self.is_deaf = True
        self._plc = plc

    def handle(self, symbol: Symbol) -> bytes:
        """Answer polls as the PLC does."""
        return b'' if self.is_deaf and isinstance(symbol, Frame) else self._plc.handle(symbol)


@pytest.mark.parametrize('polling', ['Message', 'Standard'])
def test_station_that_answers_polls_alone_is_told_from_one_that_comes_back(polling: str) -> None:
    bench, plc = make_bench(make_mapping('N7:0'), network=Network(baud=115200, polling=polling))
    deaf = DeafPlc(plc)
    bench.far_stations[:] = [deaf]
    station = bench.driver.stations[1]
    bench.run_until(lambda: station.takes_no_commands)
    assert bench.listener.changes == [(1, False), (1, True)] * 2
    assert not bench.listener.reads
    deaf.is_deaf = False
    bench.run_until(lambda: bool(bench.listener.reads))
    assert not station.takes_no_commands
