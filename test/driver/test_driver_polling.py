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

"""The driver as a master with standard polling, and broadcast rows with either polling."""

from unittest.mock import Mock

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.df1.polling import StandardPollingMaster
from abdf1_ros.df1.settings import PollingSettings
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.plan.forecast import longest_wait, USUAL_RESPONSE_TIME
from abdf1_ros.settings.network import Network, POLLING_MODES
from abdf1_ros.simulator.gateway import SimulatedGateway
from abdf1_ros.simulator.simulated_plc import InjectedFaults
import pytest
from support.cases import for_all
from support.driver_bench import DriverBench, simulated_plc, store, stored
from support.mappings import load_rows, make_mapping

STANDARD = Network(baud=115200, timeout=200, polling='Standard')
FILES = tuple((f'N{number}:0', 20) for number in range(7, 15) if number != 8)
NUMBERS = [int(text[1:].split(':')[0]) for text, _ in FILES]
BOTH = pytest.mark.parametrize('polling', POLLING_MODES)


def network(polling: str) -> Network:
    """Return a fast line; polled without a pause, a slower one shows the same."""
    return Network(baud=115200 if polling == 'Message' else 19200, timeout=200, polling=polling)


@pytest.mark.parametrize('delay', [0.0, 0.05])
def test_many_blocks_of_several_stations(delay: float) -> None:
    mappings = [make_mapping(f'N{number}:0', station=station, length=10, period=0)
                for station in (1, 2, 3) for number in NUMBERS]
    bench = DriverBench(mappings, network=STANDARD)
    assert isinstance(bench.driver.link, StandardPollingMaster)
    for station in (1, 2, 3):
        plc = bench.plc(station, 'PLC5', *FILES)
        plc.faults.delay = delay
        for number in NUMBERS:
            store(plc, f'N{number}:0', [100 * station + number] * 10)
    bench.run(3.0)
    for mapping in mappings:
        file = int(str(mapping.address).split(':')[0][1:])
        values = bench.listener.values(mapping)
        assert {tuple(entry) for entry in values} == {(100 * mapping.station + file,) * 10}
        # A station thinks about one command at a time, all of them do so at once.
        assert len(values) >= (3.0 / (len(NUMBERS) * (0.06 if delay else 0.03))) - 2
    counts = [len(bench.listener.values(mapping)) for mapping in mappings]
    assert max(counts) - min(counts) <= 1
    assert bench.listener.numbers() == {2523}
    assert bench.listener.changes == []


@BOTH
@pytest.mark.parametrize('plc', ['SLC', 'PLC5'])
def test_long_reply_is_not_looked_at_while_it_cannot_be_complete(
        polling: str, plc: str, monkeypatch: pytest.MonkeyPatch) -> None:
    words = make_mapping('N7:0', plc=plc, length=100)
    bench = DriverBench([words], network=network(polling), chunk=8)
    store(bench.plc(1, plc, ('N7:0', 100)), 'N7:0', list(range(100)))
    sizes: list[int] = []
    take = bench.driver.machine.receive_data

    def receive_data(data: bytes, now: float) -> None:
        sizes.append(len(data))
        take(data, now)

    monkeypatch.setattr(bench.driver.machine, 'receive_data', receive_data)
    bench.run_until(lambda: bool(bench.listener.reads))
    assert bench.listener.values(words) == [list(range(100))]
    assert len([size for size in sizes if size == 8]) <= 4  # the reply has more than 200 bytes


def test_read_of_several_commands_is_put_together_in_order_and_others_are_read_beside_it() -> None:
    long, other = make_mapping('N7:0', length=300), make_mapping('N7:0', station=2)
    bench = DriverBench([long, other], network=STANDARD)
    plc = bench.plc(1, 'PLC5', ('N7:0', 300))
    bench.plc(2, 'PLC5', ('N7:0', 1))
    store(plc, 'N7:0', list(range(300)))
    bench.run(2.0)
    assert {tuple(entry) for entry in bench.listener.values(long)} == {tuple(range(300))}
    assert len(bench.listener.values(other)) > 5


def test_station_that_goes_and_comes_again_has_its_reads_released_at_once() -> None:
    mappings = [make_mapping(f'N{number}:0', station=station)
                for station in (1, 2) for number in (7, 9)]
    bench = DriverBench(mappings, network=STANDARD)
    bench.plc(1, 'PLC5', *FILES)
    plc = bench.plc(2, 'PLC5', *FILES)
    bench.run(1.0)
    plc.faults = InjectedFaults(silent=True)
    bench.run(5.0)
    assert bench.listener.changes == [(2, False)]
    assert [bench.driver.points[mapping].error is None for mapping in mappings] == [
        True, True, False, False]
    plc.faults = InjectedFaults()
    bench.run_until(lambda: (2, True) in bench.listener.changes, 5.0)
    back = bench.clock()
    bench.run(0.1)
    for mapping in mappings[2:]:
        assert back <= bench.listener.times(mapping)[-1]


def test_mapped_station_that_is_in_no_list_is_polled_all_the_same() -> None:
    read = make_mapping('N7:0', station=6, period=0)
    settings = DriverSettings(polling=PollingSettings((4, 1), priority=(3,)))
    rows = [make_mapping(), read, make_mapping(station=3), make_mapping(station=2, via=15)]
    bench = DriverBench(rows, network=STANDARD, settings=settings)
    heard = bench.far.hear = Mock(side_effect=bytes)
    for station in (1, 3, 4, 6, 15):
        bench.plc(station, 'PLC5', *FILES)
    bench.run(2.0)
    assert len(bench.listener.values(read)) > 20
    polls = b''.join(data for (data,), _ in heard.call_args_list).split(b'\x10\x05')
    assert [poll[0] for poll in polls[1:7]] == [3, 4, 1, 15, 6, 3]  # rows by number


@pytest.mark.parametrize(('count', 'length', 'behind', 'others'), [
    (5, 30, (), (2, 3)), (1, 600, (), (2,)), (3, 9, (6, 7), (2, 3))])
def test_station_with_many_packets_gets_one_in_a_scan_and_its_stale_times_allow_for_it(
        count: int, length: int, behind: tuple[int, ...], others: tuple[int, ...]) -> None:
    via = 9 if behind else None
    rows = [*(make_mapping(f'N{number}:0', station=station, length=length, period=500, via=via)
              for station in behind or (1,) for number in NUMBERS[:count]),
            *(make_mapping('N7:0', station=station, period=500) for station in others)]
    bench = DriverBench(rows, network=Network(baud=9600, station=20, polling='Standard'))
    bench.line.propagation = USUAL_RESPONSE_TIME / 2
    areas = [(f'N{number}:0', length) for number in NUMBERS[:count]]
    bench.connect(SimulatedGateway(9, [
        simulated_plc(station, 'PLC5', bench.clock, *areas) for station in behind], Checksum.CRC))
    for station in (1, *others):
        bench.plc(station, 'PLC5', *areas)
    times = bench.listener.times
    bench.run_until(lambda: all(len(times(row)) > 3 for row in rows))
    for row in rows:
        interval = (times(row)[-1] - times(row)[1]) / (len(times(row)) - 2)
        assert bench.driver.points[row].stale_time == pytest.approx(
            3 * interval + longest_wait(bench.driver.readings.blocks), rel=0.1)


@pytest.mark.parametrize('others', [0, 19])
def test_packets_of_a_long_read_may_have_cmd_timeout_or_a_scan_each(others: int) -> None:
    net = Network(baud=9600, polling='Standard') if others else Network(baud=115200)
    rows = [make_mapping('N7:0', length=110 if station else 900, station=station)
            for station in range(1 + others)]
    job = max(DriverBench(rows, network=net, start=False).driver.readings.reads.jobs,
              key=lambda job: job.block.words)
    each = max(net.cmd_timeout / 1000, len(rows) * job.block.line_times[0])
    assert job.longest_read >= net.line_mode.longest_transaction(net.line, 0.0) \
        + len(job.block.requests) * each


@BOTH
def test_broadcast_row_is_written_to_every_station(polling: str) -> None:
    everybody = make_mapping('N7:0', 'Write', station=BROADCAST)
    read = make_mapping('N7:0', station=1)
    bench = DriverBench([everybody, read], network=network(polling))
    plcs = [bench.plc(station, 'PLC5', *FILES) for station in (1, 2)]
    bench.run(0.5)
    bench.write(everybody, [7], run=0.5)
    result, = bench.listener.results
    assert result.outcome is Outcome.BROADCAST
    assert str(result) == 'sent to all stations; no station confirms a broadcast'
    assert [stored(plc, 'N7:0') for plc in plcs] == [b'\7\0'] * 2
    assert bench.listener.values(read)[-1] == [7]
    assert [station.number for station in bench.driver.stations] == [1]
    assert bench.listener.numbers() == {2523}


@for_all(('command', 'good'), [
    ('Write', True), ('Read', False), ('ReadWrite', False), ('Serve', False)])
def test_only_a_write_row_may_name_station_255(command: str, good: bool) -> None:
    mappings, problems = load_rows(f'a,{command},N7:0,255,SLC,,,,,,,')
    assert len(mappings) == good
    assert [problem.message.number for problem in problems if problem.message] == (
        [] if good else [2501])
