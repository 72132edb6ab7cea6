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

"""The ladder of the heartbeats, rung by rung, in virtual time."""

from __future__ import annotations

from abdf1_ros.pccc.data_table import DataTable, NoSuchFile
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.simulator.ladder import Ladder, Lamp
import pytest


class Program:
    """A ladder whose bridge counts every second, as long as ``is_counting``."""

    def __init__(self, preset: int = 300) -> None:
        self.table = DataTable(PlcType.SLC)
        self.table.create(parse_address('S:0', PlcType.SLC), 4)
        self.lamps: list[tuple[float, Lamp, bool]] = []
        self.ladder = Ladder(self.table, preset,
                             lambda at, lamp, on: self.lamps.append((round(at, 3), lamp, on)))
        self.now = 0.0
        self.is_counting = True
        self._beat = 0

    def put(self, text: str, value: int) -> None:
        self.table.write(parse_address(text, PlcType.SLC), value.to_bytes(2, 'little'))

    def get(self, text: str) -> int:
        return int.from_bytes(self.table.read(parse_address(text, PlcType.SLC), 1), 'little')

    def run(self, seconds: float) -> None:
        """Let time pass, with a heartbeat at every full second."""
        end = self.now + seconds
        while self.now < end - 1e-9:
            if self.is_counting:
                self._beat = self._beat % 32767 + 1
                self.put('N10:0', self._beat)
            self.now = min(end, self.now + 1.0)
            self.ladder.advance(self.now)

    def take_control(self) -> None:
        """Count until a reset is accepted."""
        self.run(5.0)
        self.ladder.press_reset()
        self.run(1.0)
        assert self.ladder.is_on(Lamp.IN_CONTROL)

    def dropped(self) -> float:
        """Return when ROS lost control last."""
        return [at for at, lamp, on in self.lamps if lamp is Lamp.IN_CONTROL and not on][-1]


def test_nothing_is_in_control_before_a_person_has_reset() -> None:
    program = Program()
    program.put('N10:1', 0)
    program.run(10.0)
    assert program.ladder.is_on(Lamp.ALIVE)
    assert not program.ladder.is_on(Lamp.IN_CONTROL)
    program.ladder.press_reset()
    program.run(1.0)
    assert program.ladder.is_on(Lamp.IN_CONTROL)


def test_command_reaches_the_machine_only_while_ros_is_in_control() -> None:
    program = Program()
    program.take_control()
    program.put('N10:1', 42)
    program.run(1.0)
    assert program.get('N11:2') == 42
    program.put('N10:0', 0)
    program.is_counting = False
    program.run(0.05)
    assert program.get('N11:2') == 0
    assert program.ladder.is_on(Lamp.STOPPED)


def test_reset_is_refused_while_a_command_is_there_or_too_early() -> None:
    program = Program()
    program.put('N10:1', 7)
    program.run(5.0)
    program.ladder.press_reset()
    program.run(1.0)
    assert not program.ladder.is_on(Lamp.IN_CONTROL)
    early = Program()
    early.run(2.0)
    early.ladder.press_reset()
    early.run(1.0)
    assert not early.ladder.is_on(Lamp.IN_CONTROL)


@pytest.mark.parametrize('preset', [150, 300])
def test_silence_is_lost_after_the_preset(preset: int) -> None:
    program = Program(preset)
    program.take_control()
    program.is_counting = False
    last = program.now - 1.0
    program.run(5.0)
    assert program.ladder.is_on(Lamp.LOST)
    assert program.dropped() == pytest.approx(last + preset * 0.01, abs=0.03)


def test_control_does_not_come_back_by_itself() -> None:
    program = Program()
    program.take_control()
    program.is_counting = False
    program.run(5.0)
    program.is_counting = True
    program.run(10.0)
    assert program.ladder.is_on(Lamp.ALIVE)
    assert not program.ladder.is_on(Lamp.IN_CONTROL)


def test_negative_heartbeat_is_not_alive() -> None:
    program = Program()
    program.is_counting = False
    for value in (0x8000, 0xFFFF, 0x8001):
        program.put('N10:0', value)
        program.run(0.1)
        assert not program.ladder.is_on(Lamp.ALIVE)


def test_program_and_run_again_ends_tripped() -> None:
    program = Program()
    program.take_control()
    program.ladder.stand_still()
    program.ladder.enter_run(program.now)
    assert not program.ladder.is_on(Lamp.IN_CONTROL)
    program.run(10.0)
    assert not program.ladder.is_on(Lamp.IN_CONTROL)


def test_program_has_a_heartbeat_of_its_own_that_begins_anew() -> None:
    program = Program()
    program.run(2.0)
    count = program.get('N11:3')
    program.run(1.1)
    assert program.get('N11:3') - count == pytest.approx(10, abs=1)
    program.put('N11:3', 32000)
    program.run(0.2)
    assert program.get('N11:3') < 5


def test_first_pass_shows_in_the_status_file() -> None:
    program = Program()
    program.ladder.advance(0.0)
    assert program.get('S:1') >> 15 == 1
    program.run(0.1)
    assert program.get('S:1') >> 15 == 0


def test_file_of_another_type_is_refused() -> None:
    table = DataTable(PlcType.SLC)
    table.create(parse_address('B10:0', PlcType.SLC), 1)
    with pytest.raises(NoSuchFile, match='file 10 is of type B already'):
        Ladder(table)
