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

"""What a transaction costs the driver, in instructions: no more for a larger map."""

import importlib
from pathlib import Path

from abdf1_ros.driver.write import Outcome
from abdf1_ros.settings.heartbeats import Fallback, While
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
import pytest
from support.counting import lines_run
from support.driver_bench import DriverBench, store
from support.mappings import make_mapping

ROWS, FILES = 2000, 10


def read_rows(condition: While | None, rows: int) -> list[Mapping]:
    """Return rows of one word each, in ten files."""
    return [make_mapping(f'N{20 + number % FILES}:{number // FILES}', tag=f'row{number}',
                         period=1000, condition=condition) for number in range(rows)]


def work_of_reads(condition: While | None, rows: int) -> int:
    """Return the lines run for reading all rows while their condition ends and comes back."""
    counter = make_mapping('N7:0', tag='alive', period=100)
    bench = DriverBench([counter, *read_rows(condition, rows)],
                        network=Network(baud=115200, timeout=200))
    plc = bench.plc(1, 'PLC5', ('N7:0', 4), *(
        (f'N{20 + number}:0', rows // FILES) for number in range(FILES)))
    for beat in range(1, 25):
        bench.at(0.15 * beat, lambda beat=beat: store(plc, 'N7:0', [beat]))  # type: ignore[misc]
    for beat in range(1, 10):
        bench.at(7.0 + 0.15 * beat,
                 lambda beat=beat: store(plc, 'N7:0', [beat]))  # type: ignore[misc]
    bench.run(2.5)
    work = lines_run(lambda: bench.run(6.5), 'driver')
    if condition is not None:
        assert [reason for _, reason in bench.listener.reasons] == [
            'withheld: alive has not changed twice within 0.5 s; '
            f'so are all {rows} rows that depend on it']
        assert len(bench.listener.ends) == 1
    return work


@pytest.mark.long
def test_guarded_rows_cost_little_more_than_others() -> None:
    plain = work_of_reads(None, ROWS)
    guarded = work_of_reads(While(('alive',), 500), ROWS)
    assert guarded < 1.6 * plain  # lines; of the time less


STATIONS, COMMANDS = range(11, 26), 30


def work_of_a_transaction(fallback: Fallback | None) -> float:
    """Return the lines run for reading 15 stations, and writing to them now and then."""
    reads = [make_mapping('N9:0', station=station, tag=f'read{station}') for station in STATIONS]
    writes = [make_mapping(f'N7:{number}', 'Write', station=station, fallback=fallback,
                           tag=f'speed{station}_{number}')
              for station in STATIONS for number in range(COMMANDS)]
    bench = DriverBench([*reads, *writes], network=Network(baud=115200, timeout=200))
    for station in STATIONS:
        bench.plc(station, 'PLC5', ('N7:0', COMMANDS), ('N9:0', 1))
    fallbacks = 0 if fallback is None else len(writes)
    bench.run_until(lambda: len(bench.listener.results) == fallbacks)
    bench.run(2.0)  # what comes at the start is over
    begun = bench.clock()
    for number in range(30):
        bench.at(begun + 0.02 * number, lambda number=number: bench.write(  # type: ignore[misc]
            writes[7 * number % len(writes)], [number]))
    before = bench.driver.tasks.transactions
    work = lines_run(lambda: bench.run(0.8), 'driver')
    assert bench.listener.outcomes().count(Outcome.WRITTEN) == 30
    assert bench.driver.tasks.transactions - before > 80
    return work / (bench.driver.tasks.transactions - before)


@pytest.mark.long
def test_transaction_costs_little_more_with_450_fallbacks() -> None:
    assert work_of_a_transaction(Fallback((7,), 60_000)) < 2 * work_of_a_transaction(None)


def test_read_in_a_loop_without_waiting_is_128_calls_at_most(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1] / 'lab' / 'benchmarks'))
    assert importlib.import_module('cpu_time').measure_without_waiting(1, 500)[1] <= 128
