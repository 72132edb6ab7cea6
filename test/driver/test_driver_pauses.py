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
A process that stands still for a while: no value is older than it looks, no command goes out late.

Every word of the station is its clock (ms, modulo 65536), so each value tells its own age.
"""

from itertools import product

from abdf1_ros.df1.frames import Symbol
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.slave import HalfDuplexSlave
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network, POLLING_MODES
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import pytest
from support.cases import long_unless
from support.driver_bench import DriverBench, store
from support.mappings import make_mapping

WORDS = 250
PAUSE = 3.1
STEP = 0.016
USUAL_AGE = 0.75  # Timeout, and what one transaction takes


class ClockPlc:
    """A PLC-5 that puts its clock into all words before it does anything, and keeps its writes."""

    def __init__(self, bench: DriverBench) -> None:
        self.executed: list[tuple[float, bytes]] = []
        self._bench = bench
        self._plc = SimulatedPlc(1, bench.plc(1, 'PLC5', ('N7:0', WORDS), ('N9:0', WORDS)).table,
                                 bench.network.checksum, bench.clock)
        self._plc.slave = HalfDuplexSlave(LinkSettings(station=1), self._serve)
        bench.far_stations[:] = [self]

    def handle(self, symbol: Symbol) -> bytes:
        """Answer as the PLC does."""
        return self._plc.handle(symbol)

    def _serve(self, command: Packet) -> Packet:
        words = [milliseconds(self._bench.clock())] * WORDS
        store(self._plc, 'N7:0', [word - 65536 if word > 32767 else word for word in words])
        reply = self._plc.serve(command)
        if command.cmd == 0x0F and not reply.data:
            self.executed.append((self._bench.clock(), command.data))
        return reply


def milliseconds(seconds: float) -> int:
    """Return a clock value as a word of the station."""
    return int(seconds * 1000) % 65536


def bench_of(*mappings: Mapping, polling: str) -> tuple[DriverBench, ClockPlc]:
    bench = DriverBench(mappings, network=Network(
        baud=19200, timeout=300, cmd_timeout=500, polling=polling),
        settings=DriverSettings(default_period=0.3))
    return bench, ClockPlc(bench)


@pytest.mark.parametrize('polling', POLLING_MODES)
@pytest.mark.parametrize('length', [1, WORDS])
def test_no_value_is_older_than_it_looks_and_no_array_mixes_ages(
        polling: str, length: int) -> None:
    read = make_mapping('N7:0', length=length)
    bench, _ = bench_of(read, polling=polling)
    for number in range(12):
        bench.run(1.0 + 2 * number * STEP)
        bench.line.pause(bench.driver.machine, PAUSE)
        bench.run(PAUSE)
    for when, _, values in bench.listener.reads:
        ages = [(milliseconds(when) - value) % 65536 / 1000 for value in values]  # type: ignore
        assert max(ages) < USUAL_AGE + 0.5 * (length > 1), when
    assert len(bench.listener.reads) > 25
    assert bench.driver.points[read].error is None
    assert bench.driver.points[read].failures  # each read that was too old


@pytest.mark.parametrize('polling, length', long_unless(
    lambda polling, length: length == 1 or polling != 'Standard',
    product(POLLING_MODES, (1, WORDS))))
def test_no_command_of_a_write_goes_out_after_it_has_become_too_old(
        polling: str, length: int) -> None:
    write = make_mapping('N9:0', 'Write', length=length)
    bench, plc = bench_of(make_mapping('N7:0'), write, polling=polling)
    asked = []
    for number in range(0, 20 if length > 1 else 8, 2):  # until a write has come to its end
        bench.run(1.0)
        asked.append(bench.clock())
        bench.write(write, [number] * length)
        bench.run(number * STEP)
        bench.line.pause(bench.driver.machine, PAUSE)
        bench.run(PAUSE + 2.5)
    assert (len(bench.listener.results), bench.driver.stations[1].failures) == (len(asked), 0)
    for when, _ in plc.executed:
        began = max(moment for moment in asked if moment <= when)
        assert when < began + 2.0 + 0.3  # what the line itself takes
    details = {result.outcome: result.detail for result in bench.listener.results}
    if length > 1:
        assert details[Outcome.PARTLY].startswith('too old to be sent')


def test_repetition_of_a_lost_command_is_too_old_after_a_pause() -> None:
    write = make_mapping('N9:0', 'Write')
    bench, plc = bench_of(write, polling='Message')
    bench.run(1.0)
    bench.far.hear = lambda data: b''
    bench.write(write, [1], run=0.05)
    bench.line.pause(bench.driver.machine, 6.0)
    bench.far.hear = bytes
    bench.run(10.0)
    counters = bench.driver.machine.counters
    assert counters.messages_sent == counters.commands_sent  # none of them twice
    assert plc.executed == []
    assert [str(result) for result in bench.listener.results] == [
        'unknown whether written: too old to be sent once more; '
        'not read back: no row reads all of these words']


@pytest.mark.parametrize('polling', POLLING_MODES)
def test_write_that_waits_too_long_has_its_result_while_a_transaction_runs(polling: str) -> None:
    slow, other = make_mapping('N7:0', 'Write', station=2), make_mapping('N9:0', 'Write')
    bench = DriverBench([slow, other], network=Network(baud=19200, timeout=3000, polling=polling))
    ClockPlc(bench)
    bench.run(0.05)  # station 2 is being asked for its reply, in vain, for 12 s
    bench.write(slow, [1])
    bench.write(other, [1], run=2.001)
    assert {str(result): result.latency for result in bench.listener.results} == {
        'not written: not sent: waited longer than 2 s for the line': pytest.approx(2.0)}
    assert len(bench.listener.results) == 2
