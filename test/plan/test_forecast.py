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

"""Forecasts of poll cycle and load, before anything is connected."""

from dataclasses import replace

from abdf1_ros.plan.forecast import block_time, intervals, line_model, load, PATIENCE, poll_cycle
from abdf1_ros.plan.planner import Planner
from abdf1_ros.settings.network import Network
import pytest
from support.cases import for_all
from support.driver_bench import DriverBench
from support.mappings import make_mapping

NETWORK = Network(baud=9600)
ROWS = [make_mapping('N7:0', length=40, period=500), make_mapping('F8:0', length=10, period=0),
        make_mapping('T4:0', length=9, period=2000)]


def blocks_of(network: Network) -> list:  # type: ignore[type-arg]
    return Planner(line_model(network), 0.1).plan(ROWS)


def test_poll_cycle_is_characters_and_two_answers_a_transaction() -> None:
    blocks = blocks_of(NETWORK)
    characters = sum(block.line_time for block in blocks)
    assert poll_cycle(blocks, 0.0) == pytest.approx(characters)
    assert poll_cycle(blocks, 0.01) == pytest.approx(characters + 6 * 0.01)
    assert poll_cycle(blocks) == poll_cycle(blocks, 0.01)


def test_mapping_of_several_packets_has_answers_for_each() -> None:
    block, = Planner(line_model(NETWORK), 0.1).plan([make_mapping('N7:0', length=250)])
    assert len(block.requests) == 3
    assert block_time(block, 0.01) - block_time(block, 0.0) == pytest.approx(6 * 0.01)


def test_load_is_what_periods_need_and_leaves_out_those_without() -> None:
    times = {block.period: block_time(block, 0.01) for block in blocks_of(NETWORK)}
    assert load(blocks_of(NETWORK), 0.01) == pytest.approx(times[0.5] / 0.5 + times[2.0] / 2)


def expected(*rows: tuple[int, int], own: tuple[tuple[float, float], ...] = (),
             ) -> tuple[dict[float, float], float]:
    """Return the intervals for so many reads of a period (ms) each, and the time of one."""
    mappings = [make_mapping(f'N{9 + 20 * group + number}:0', period=period)
                for group, (period, count) in enumerate(rows) for number in range(count)]
    blocks = Planner(line_model(NETWORK), 0.1).plan(mappings)
    return intervals(blocks, own), block_time(blocks[0])


def test_periods_are_longer_by_the_load_of_the_line_but_by_no_more_than_a_scan() -> None:
    found, time = expected((100, 1), (1000, 20))
    needed = time / 0.1 + 20 * time / 1.0
    assert 1.5 < needed < 2.5
    assert found[0.1] == pytest.approx(0.1 * needed)
    assert found[1.0] == pytest.approx(1.0 * needed)
    found, time = expected((10, 10), (1000, 1))
    assert found[0.01] == pytest.approx(0.01 * (10 * time / 0.01 + time / 1.0), rel=0.01)
    assert found[1.0] == pytest.approx(1.0 + 11 * time, rel=0.01)
    found, time = expected((1000, 1), own=((0.5, 0.1),))
    assert found == {1.0: pytest.approx(1.0 + time + 0.5)}


def test_reads_without_a_period_are_expected_to_have_what_is_left() -> None:
    found, time = expected((0, 2), (500, 2))
    left = 1 - 2 * time / 0.5
    assert found == {0.0: pytest.approx(2 * time / left), 0.5: 0.5}
    found, time = expected((0, 2))
    assert found == {0.0: pytest.approx(2 * time)}


@for_all(('period', 'is_full'), [(100, True), (300, False)])
def test_reads_without_a_period_are_expected_to_have_little_of_a_full_line(
        period: int, is_full: bool) -> None:
    found, time = expected((0, 2), (period, 4))
    once, needed, short = 6 * time, 4 * time / period * 1000, period / 1000
    assert needed > 1 if is_full else 0.95 < needed < 1
    stretch = needed + 2 * time / (PATIENCE * once)
    assert found[0.0] == pytest.approx(min(PATIENCE * once * stretch, (PATIENCE + 1) * once))
    assert found[short] == pytest.approx(min(short * stretch, short + once))


@pytest.mark.parametrize('tx_delay', [0, 20])
@pytest.mark.parametrize('baud', [1200, 19200])
def test_forecast_is_what_a_line_does_whose_station_answers_at_once(
        baud: int, tx_delay: int) -> None:
    rows = [replace(row, period=0) for row in ROWS]
    bench = DriverBench(rows, network=Network(baud=baud, tx_delay=tx_delay), start=False)
    bench.plc(1, 'PLC5', ('N7:0', 40), ('F8:0', 20), ('T4:0', 9))
    bench.open(run=20.0)
    measured = bench.driver.readings.reads.poll_cycle
    assert measured == pytest.approx(poll_cycle(bench.driver.readings.blocks, 0.0), rel=0.03)
