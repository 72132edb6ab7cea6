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
The driver and a PLC that runs the ladder of the tutorial: who has control after what.

A PLC sees a word once in a scan, so the times of a scan matter. The numbers in the names are those
of the rules in docs/heartbeats.md.
"""

from collections.abc import Callable
from itertools import product
from random import Random

from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.pccc.emulated import Setting
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.ladder import Ladder, Lamp
import pytest
from support.cases import long_unless
from support.driver_bench import DriverBench, store, stored
from support.mappings import make_mapping

MODES = {'Message': {}, 'Standard': {'polling': 'Standard'}, 'Peer': {'mode': 'Peer'}}
PRESET = 150  # 1.5 s


class Cell:
    """A bridge whose publisher lives, and a PLC with its program."""

    def __init__(self, mode: str, scan_time: float, period: int = 200) -> None:
        self.speed = make_mapping('N10:1', 'Write', tag='speed', plc='SLC',
                                  fallback=Fallback((0,), 1000))
        self.gripper = make_mapping('N10:2', 'Write', tag='gripper', plc='SLC',
                                    fallback=Fallback((0,), 1000))
        self.publishes = True
        self.beat = make_mapping('N10:0', 'Heartbeat', tag='beat', plc='SLC', period=period)
        self.bench = DriverBench([self.beat, self.speed, self.gripper], network=Network(
            baud=19200, timeout=100, cmd_timeout=500, nak_retries=1, enq_retries=1,
            **MODES[mode]), settings=DriverSettings(), start=False)
        self.plc = self.bench.plc(1, 'SLC', ('S:0', 4), ('N7:0', 4))
        self.ladder = Ladder(self.plc.table, PRESET, scan_time=scan_time)
        self.plc.run_ladder(self.ladder)
        self._live()
        self.bench.open()

    def _live(self) -> None:
        self.bench.driver.kernel.executor_ran(self.bench.clock())
        if self.publishes:
            self.bench.write(self.speed, [self.ladder.is_on(Lamp.IN_CONTROL) and 7])
        self.bench.at(self.bench.clock() + 0.1, self._live)

    def word(self, text: str) -> int:
        """Return a word of the PLC, after the scans that are due."""
        self.plc.advance()
        return int.from_bytes(stored(self.plc, text), 'little')

    def take_control(self) -> None:
        """Press reset as soon as it is accepted."""
        for _ in range(40):
            self.bench.run(0.5)
            self.ladder.press_reset()
            self.plc.advance()
            if self.ladder.is_on(Lamp.IN_CONTROL):
                break
        self.bench.run(0.5)
        assert self.word('N11:2') == 7
        assert self.ladder.is_on(Lamp.IN_CONTROL)


def _open_again(cell: Cell) -> None:
    cell.bench.lose_port()
    cell.bench.open()


def _restart(cell: Cell) -> None:
    cell.bench.restart()


@pytest.mark.parametrize('mode, happens, scan_time', long_unless(
    lambda mode, happens, scan_time:
        [*MODES].index(mode) % 2 == (happens is _restart) ^ (scan_time > 0.1),
    product(MODES, (_open_again, _restart), (0.06, 0.25))))
def test_rule_2_every_plc_sees_a_restart_that_is_quicker_than_its_timer(
        mode: str, happens: Callable[[Cell], None], scan_time: float) -> None:
    cell, dice = Cell(mode, scan_time), Random(1)
    for _ in range(2):
        cell.take_control()
        cell.bench.run(dice.uniform(0.0, 0.5))
        happens(cell)
        cell.bench.run(1.4)
        cell.plc.advance()
        assert not cell.ladder.is_on(Lamp.IN_CONTROL)


@pytest.mark.parametrize('mode, stop', long_unless(
    lambda mode, stop: [*MODES].index(mode) % 2 == (stop > 0.7), product(MODES, (0.6, 0.9))))
def test_rule_8_commands_of_a_short_download_do_not_stay_where_fallbacks_stand(
        mode: str, stop: float) -> None:
    cell = Cell(mode, 0.06)
    for number in range(2):
        cell.publishes = True
        cell.take_control()
        cell.publishes = False
        cell.bench.run(2.5 + 1.3 * number)
        cell.plc.download()
        for word in ('N10:1', 'N10:2'):
            store(cell.plc, word, [888])
        cell.bench.run(stop)
        cell.plc.set_mode(Setting.REMOTE)
        for _ in range(40):  # somebody presses reset all the time
            cell.ladder.press_reset()
            cell.bench.run(0.1)
            assert (cell.word('N11:2'), cell.word('N11:4')) == (0, 0)
        assert (cell.word('N10:1'), cell.word('N10:2')) == (0, 0)
