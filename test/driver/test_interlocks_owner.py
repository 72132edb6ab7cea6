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
Two bridges on one heartbeat word (rule 19 of docs/heartbeats.md), and who has control then.

The PLC has two ports, one for each bridge, and runs the rungs of the tutorial.
"""

from __future__ import annotations

import math

from abdf1_ros.driver.interlocks.heartbeat import BeatState, HeartbeatRow
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.plan.bounds import MODE_PERIOD
from abdf1_ros.settings.heartbeats import Fallback, Heartbeat
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.ladder import Lamp
from abdf1_ros.simulator.simulated_plc import SimulatedPlc
import pytest
from support.driver_bench import DriverBench, simulated_plc
from support.mappings import make_mapping
from support.rungs import PageLadder

STEP = 0.01
PRESET = 300
NETWORK = Network(baud=115200, timeout=100, cmd_timeout=500, nak_retries=1, enq_retries=1)


class Bridge:
    """A bridge with a heartbeat in N10:0, and perhaps a command in N10:1 that is published."""

    def __init__(self, cell: Cell, period: int, has_command: bool) -> None:
        self.cell = cell
        self.speed = make_mapping('N10:1', 'Write', tag='speed', plc='SLC',
                                  fallback=Fallback((0,), 1000))
        beat = make_mapping('N10:0', 'Heartbeat', tag='beat', plc='SLC', period=period,
                            heartbeat=Heartbeat())
        # The first number is by chance in a node.
        self.bench = DriverBench([beat, self.speed] if has_command else [beat], network=NETWORK,
                                 settings=DriverSettings(first_tns=len(cell.bridges) * 4000),
                                 start=False)
        self.plc = SimulatedPlc(1, cell.table, NETWORK.checksum, lambda: cell.now)
        self.plc.advance = cell.plc.advance  # type: ignore[method-assign]
        self.plc._server = cell.plc._server  # which tells the mode
        self.bench.connect(self.plc)
        self.has_command = has_command
        self.is_alive = self.publishes = True
        self.bench.line.now = cell.now
        self.bench.open()

    @property
    def beat(self) -> HeartbeatRow:
        return self.bench.driver.interlocks.heartbeats[0]

    def step(self, end: float, speed: int) -> None:
        """Let time pass up to a moment."""
        if not self.is_alive:
            self.bench.line.now = end
            return
        now = self.bench.clock()
        self.bench.driver.interlocks.executor_ran(now)
        if self.has_command and self.publishes and math.floor(end * 5) != math.floor(now * 5):
            self.bench.write(self.speed, [speed])
        self.bench.run(end - now)

    def kill(self) -> None:
        """End it as kill -9 does: nothing is written any more."""
        self.is_alive = False


class Cell:
    """A PLC with its program, and bridges that come and go."""

    def __init__(self, scan_time: float = 0.05) -> None:
        self.now = 0.0
        self.plc = simulated_plc(1, 'SLC', lambda: self.now, ('S:0', 4), ('N7:0', 4))
        self.table = self.plc.table
        self.ladder = PageLadder(self.table, PRESET, scan_time=scan_time)
        self.plc.run_ladder(self.ladder)
        self.bridges: list[Bridge] = []

    def add(self, period: int = 200, has_command: bool = False) -> Bridge:
        """Start another bridge."""
        self.bridges.append(Bridge(self, period, has_command))
        return self.bridges[-1]

    def run(self, seconds: float) -> None:
        """Let time pass for all of them."""
        end = self.now + seconds
        while self.now < end - 1e-9:
            self.now = min(end, self.now + STEP)
            for bridge in self.bridges:
                bridge.step(self.now, 800 if self.is_in_control else 0)
        self.plc.advance()

    def download(self, seconds: float) -> None:
        """Load the program, which takes so long."""
        self.plc.download()
        self.run(seconds)
        self.plc.set_mode(Setting.REMOTE)

    @property
    def is_in_control(self) -> bool:
        return self.ladder.is_on(Lamp.IN_CONTROL)

    def word(self, text: str) -> int:
        return self.ladder._word(text)

    def take_control(self) -> None:
        """Press reset until it is accepted, and see that the command is used."""
        for _ in range(20):
            self.run(0.5)
            self.ladder.press_reset()
            if self.is_in_control:
                break
        self.run(0.5)
        assert self.is_in_control
        assert self.word('N11:2') == 800


PAIRS = pytest.mark.parametrize('periods', [(200, 200), (230, 200), (200, 1000), (1000, 1000)])


@PAIRS
@pytest.mark.parametrize('offset', [0.11])
def test_rule_19_two_bridges_on_one_word_end_with_0_and_the_plc_without_ros(
        periods: tuple[int, int], offset: float) -> None:
    cell = Cell()
    bridges = [cell.add(periods[0], has_command=True)]
    cell.take_control()
    cell.run(offset)
    bridges.append(cell.add(periods[1]))
    cell.run(20 * max(periods) / 1000)
    for _ in range(5):  # and it stays so
        assert (cell.word('N10:0'), cell.is_in_control, cell.word('N11:2')) == (0, False, 0)
        cell.ladder.press_reset()
        cell.run(3.0)
    for bridge in bridges:
        assert [is_conflict for *_, is_conflict in bridge.bench.listener.foreign] == [False, True]


@PAIRS
@pytest.mark.parametrize('moment', [0.7, 5.0])
def test_rule_19_command_of_a_dead_bridge_is_not_kept_alive_by_another(
        periods: tuple[int, int], moment: float) -> None:
    cell = Cell()
    first = cell.add(periods[0], has_command=True)
    cell.add(periods[1])
    until = 4.0 + moment
    while cell.now < until:  # somebody presses reset all the time
        cell.ladder.press_reset()
        cell.run(0.1)
    first.kill()
    cell.run(max(PRESET / 100, 20 * max(periods) / 1000))
    for _ in range(40):
        assert cell.word('N11:2') == 0
        cell.ladder.press_reset()
        cell.run(0.5)


@pytest.mark.parametrize('stop', [0.6, 1.5, 4.0])
@pytest.mark.parametrize('times', [1, 3])
def test_rule_19_downloads_are_first_contacts_and_no_other_writer(
        stop: float, times: int) -> None:
    cell = Cell()
    cell.add(200, has_command=True)
    cell.take_control()
    cell.plc.run_ladder(cell.ladder)  # what it holds now is what a download brings back
    cell.run(20.0)
    for _ in range(times):  # all within a minute
        cell.download(stop)
        cell.run(10.0)
        assert not cell.is_in_control
        count = cell.word('N10:0')
        cell.run(1.0)
        assert cell.word('N10:0') > count > 0
    cell.take_control()


def test_rule_19_two_bridges_find_each_other_again_after_a_change_to_run() -> None:
    cell = Cell()
    bridges = [cell.add(200, has_command=True), cell.add(300)]
    for _ in range(3):
        cell.run(20 * 0.3)
        assert [bridge.beat.state for bridge in bridges] == 2 * [BeatState.CONFLICT]
        assert (cell.word('N10:0'), cell.is_in_control, cell.word('N11:2')) == (0, False, 0)
        cell.download(5.0)
        cell.run(2 * MODE_PERIOD)


def test_rule_19_bridge_that_takes_the_port_again_finds_out_too() -> None:
    cell = Cell()
    first = cell.add(200, has_command=True)
    cell.take_control()
    driver = first.bench.driver
    driver.interlocks.wind_down()
    first.bench.line.wake(driver.machine)
    cell.run(0.5)
    first.bench.lose_port('polling is off')
    assert (cell.word('N10:0'), cell.word('N10:1')) == (0, 0)
    second = cell.add(300, has_command=True)
    cell.take_control()
    driver.interlocks.resume()
    first.bench.open()
    cell.run(6.0)
    assert (cell.word('N10:0'), cell.is_in_control, cell.word('N11:2')) == (0, False, 0)
    second.bench.lose_port('polling is off')
    first.bench.lose_port('polling is off')
    first.bench.open()  # whoever opens the port again is alone now
    cell.take_control()
