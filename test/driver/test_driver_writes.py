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

"""What holds for every write: one result that is true, and no command executed late or twice."""

from collections import Counter
import itertools
import sys
import threading

from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.kernel.waiting import MAX_WAITING_WRITES
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network, POLLING_MODES
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import pytest
from support.driver_bench import DriverBench, stored
from support.mappings import make_mapping


def bench_of(*mappings: Mapping, **settings: bool) -> tuple[DriverBench, SimulatedPlc]:
    """Return a driver of these mappings that has found its PLC-5."""
    bench = DriverBench(mappings, settings=DriverSettings(**settings))  # type: ignore[arg-type]
    plc = bench.plc(1, 'PLC5', ('N7:0', 20), ('F8:0', 4), ('B3:0', 4))
    bench.run(1.0)
    return bench, plc


class Executed:
    """What a PLC has executed, of writes."""

    def __init__(self, plc: SimulatedPlc, is_watchful: bool = True) -> None:
        self.writes: list[Packet] = []
        self._plc = plc
        plc.slave = HalfDuplexSlave(
            LinkSettings(station=plc.station, duplicate_detection=is_watchful), self._serve)

    def _serve(self, command: Packet) -> Packet:
        reply = self._plc.serve(command)
        if command.cmd == 0x0F and not reply.data:
            self.writes.append(command)
        return reply


def test_one_message_for_several_rows_is_written_to_all_or_none() -> None:
    wide = make_mapping('N7:0', 'Write', tag='wide', maximum=100.0)
    narrow = make_mapping('N7:1', 'Write', tag='narrow', maximum=10.0)
    flag = make_mapping('N7:2', 'Write', tag='upper', minimum=20.0)
    bench, plc = bench_of(wide, narrow, flag)
    executed = Executed(plc)
    bench.driver.write([wide, narrow, flag], [15], bench.clock())
    bench.driver.write([wide, narrow], [5], bench.clock(), 'r7')
    bench.run(2.0)
    assert [(result.mapping.tag, str(result)) for result in bench.listener.results] == [
        ('wide', 'not written: refused: narrow, upper cannot take it'),
        ('narrow', 'not written: refused: value 15 at index 0 is outside Min -inf, Max 10'),
        ('upper', 'not written: refused: value 15 at index 0 is outside Min 20, Max inf'),
        ('wide', 'written'), ('narrow', 'written')]
    assert [result.request for result in bench.listener.results] == ['', '', '', 'r7', 'r7']
    assert len(executed.writes) == 2
    assert stored(plc, 'N7:0', 3) == b'\5\0\5\0\0\0'


def test_message_for_several_rows_waits_as_a_whole_or_not_at_all() -> None:
    rows = [make_mapping(f'B3:0/{bit}', 'Write') for bit in range(3)]
    bench, _ = bench_of(*rows)
    for _ in range(MAX_WAITING_WRITES // 3):
        bench.driver.write(rows, [1], bench.clock())
    assert bench.listener.results == []
    bench.driver.write(rows, [1], bench.clock())
    assert [str(result) for result in bench.listener.results] == [
        'not written: refused: too many writes are waiting'] * 3


def test_write_that_comes_just_when_the_port_is_lost_is_refused(
        monkeypatch: pytest.MonkeyPatch) -> None:
    row = make_mapping('N7:0', 'Write')
    bench, _ = bench_of(row)
    bench.lose_port()
    monkeypatch.setattr(Driver, 'is_online', True)  # as another thread saw it a moment ago
    bench.driver.write([row], [1], bench.clock(), 'r7')
    assert [(str(result), result.request) for result in bench.listener.results] == [
        ('not written: refused: the port is not open', 'r7')]


def test_every_write_has_one_result_while_the_port_comes_and_goes() -> None:
    rows = [make_mapping('N7:0', 'Write'), make_mapping('B3:0/1', 'Write'),
            make_mapping('N9:0', 'Serve', station=5)]
    bench, _ = bench_of(*rows)
    before, count = sys.getswitchinterval(), 1000

    def ask(mapping: Mapping) -> None:
        for number in range(count):
            bench.driver.write([mapping], [number % 2], bench.clock())

    senders = [threading.Thread(target=ask, args=(mapping,)) for mapping in rows]
    sys.setswitchinterval(1e-6)
    try:
        for sender in senders:
            sender.start()
        while any(sender.is_alive() for sender in senders):
            bench.run(0.01)
            bench.lose_port()
            bench.open()
    finally:
        sys.setswitchinterval(before)
    bench.run(10.0)
    assert Counter(result.mapping for result in bench.listener.results) == dict.fromkeys(
        rows, count)


@pytest.mark.parametrize('polling', POLLING_MODES)
@pytest.mark.parametrize(('text', 'length'), [('N10:0', 200), ('B3:0/0', 40)])
def test_writes_of_several_packets_leave_reads_their_turns(
        polling: str, text: str, length: int) -> None:
    read = make_mapping('N7:0', plc='SLC', period=200)
    write = make_mapping(text, 'Write', plc='SLC', length=length)
    bench = DriverBench([read, write], network=Network(baud=19200, timeout=300, polling=polling))
    bench.plc(1, 'SLC', ('N7:0', 10), ('N10:0', 200), ('B3:0', 10))
    for number in range(200):
        bench.at(number / 20, lambda number=number: bench.write(  # type: ignore[misc]
            write, [number % 2] * length))
    bench.run(10.0)
    times = bench.listener.times(read)
    assert len(times) > 13
    assert max(after - before for before, after in itertools.pairwise(times)) < 1.0
    assert Outcome.WRITTEN in bench.listener.outcomes()


def test_read_that_was_under_way_is_repeated_after_a_write() -> None:
    read = make_mapping('N7:0', plc='SLC', length=240, period=30_000)
    write = make_mapping('N7:0', 'Write', plc='SLC')
    bench = DriverBench([read, write], network=Network(baud=9600, timeout=300))
    bench.plc(1, 'SLC', ('N7:0', 240))
    bench.at(30.4, lambda: bench.write(write, [77]))  # between the packets of the second read
    bench.run(33.0)
    assert bench.listener.outcomes() == [Outcome.WRITTEN]
    assert bench.listener.values(read)[-1][0] == 77
