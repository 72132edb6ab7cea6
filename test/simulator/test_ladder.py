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

"""The ladder of the heartbeats in virtual time: the simulator's, and that of the tutorial."""

from random import Random

from abdf1_ros.pccc.data_table import DataTable, NoSuchFile
from abdf1_ros.pccc.families import parse_address
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.simulator.ladder import Ladder, Lamp
import pytest
from support.rungs import PageLadder, parse

BOTH = pytest.mark.parametrize('kind', [Ladder, PageLadder])
COMMANDS = {'N10:1': 'N11:2', 'N10:2': 'N11:4'}  # what the machine uses of each
EACH = pytest.mark.parametrize('command', COMMANDS)


class Program:
    """A ladder whose bridge counts every second, as long as ``is_counting``."""

    def __init__(self, kind: type[Ladder] = Ladder, preset: int = 300,
                 scan_time: float = 0.02) -> None:
        self.table = DataTable(PlcType.SLC)
        self.table.create(parse_address('S:0', PlcType.SLC), 4)
        self.lamps: list[tuple[float, Lamp, bool]] = []
        self.ladder = kind(self.table, preset,
                           lambda at, lamp, on: self.lamps.append((round(at, 3), lamp, on)),
                           scan_time)
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
        self.run(5.5)
        self.ladder.press_reset()
        self.run(1.0)
        assert self.ladder.is_on(Lamp.IN_CONTROL)

    def dropped(self) -> float:
        """Return when ROS lost control last."""
        return [at for at, lamp, on in self.lamps if lamp is Lamp.IN_CONTROL and not on][-1]


@BOTH
@EACH
def test_command_reaches_the_machine_only_while_ros_is_in_control(
        kind: type[Ladder], command: str) -> None:
    program = Program(kind)
    program.take_control()
    program.put(command, 42)
    program.run(1.0)
    assert {used: program.get(used) for used in COMMANDS.values()} == {
        used: 42 * (used == COMMANDS[command]) for used in COMMANDS.values()}
    program.put('N10:0', 0)
    program.is_counting = False
    program.run(0.05)
    assert program.get(COMMANDS[command]) == 0
    assert program.ladder.is_on(Lamp.STOPPED)


@BOTH
@EACH
def test_reset_is_refused_while_a_command_is_there_or_too_early(
        kind: type[Ladder], command: str) -> None:
    program = Program(kind)
    program.put(command, 7)
    program.run(5.0)
    program.ladder.press_reset()
    program.run(1.0)
    assert not program.ladder.is_on(Lamp.IN_CONTROL)
    early = Program(kind)
    early.run(2.0)
    early.ladder.press_reset()
    early.run(1.0)
    assert not early.ladder.is_on(Lamp.IN_CONTROL)


@pytest.mark.parametrize('preset', [150, 300])
@BOTH
def test_silence_is_lost_after_the_preset(kind: type[Ladder], preset: int) -> None:
    program = Program(kind, preset, 0.01)
    program.take_control()
    program.is_counting = False
    last = program.now - 1.0
    program.run(5.0)
    assert program.ladder.is_on(Lamp.LOST)
    assert program.dropped() == pytest.approx(last + preset * 0.01, abs=0.03)


@BOTH
def test_program_and_run_again_ends_tripped(kind: type[Ladder]) -> None:
    program = Program(kind)
    program.take_control()
    program.ladder.press_reset()
    program.ladder.enter_run(program.now)
    assert (program.dropped(), program.get('B12:0')) == (program.now, 0)
    program.ladder.advance(program.now)
    assert [program.get(text) for text in ('B12:0', 'T13:0.ACC', 'T13:2.ACC')] == [0, 0, 0]
    program.run(6.0)
    assert not program.ladder.is_on(Lamp.IN_CONTROL)


@BOTH
def test_program_has_a_heartbeat_of_its_own_that_begins_anew(kind: type[Ladder]) -> None:
    program = Program(kind, scan_time=0.01)
    program.run(2.0)
    count = program.get('N11:3')
    program.run(1.1)
    assert program.get('N11:3') - count == pytest.approx(10, abs=1)
    program.put('N11:3', 32000)
    program.run(0.02)
    assert program.get('N11:3') == 0


@BOTH
def test_first_pass_shows_in_the_status_file(kind: type[Ladder]) -> None:
    program = Program(kind)
    program.ladder.advance(0.0)
    assert program.get('S:1') >> 15 == 1
    program.run(0.1)
    assert program.get('S:1') >> 15 == 0


def test_file_of_another_type_is_refused() -> None:
    table = DataTable(PlcType.SLC)
    table.create(parse_address('B10:0', PlcType.SLC), 1)
    with pytest.raises(NoSuchFile, match='file 10 is of type B already'):
        Ladder(table)


@BOTH
@pytest.mark.parametrize('scan_time', [0.06, 0.25])
def test_one_beat_of_a_dead_bridge_and_a_reset_at_any_time_give_no_control(
        kind: type[Ladder], scan_time: float) -> None:
    program = Program(kind, 795, scan_time)
    program.is_counting = False
    program.run(1.0)
    program.put('N10:0', 4711)
    for _ in range(150):
        program.ladder.press_reset()
        program.run(0.1)
    assert (Lamp.ALIVE, True) in {(lamp, on) for _, lamp, on in program.lamps}
    assert Lamp.IN_CONTROL not in {lamp for _, lamp, _ in program.lamps}


@BOTH
def test_what_stands_for_less_than_a_scan_is_not_seen(kind: type[Ladder]) -> None:
    for stood, is_seen in ((0.05, False), (0.11, True)):
        program = Program(kind, scan_time=0.1)
        program.take_control()
        program.now = round(program.now, 1) + 0.02
        program.ladder.advance(program.now)
        program.put('N10:0', 0)
        program.ladder.advance(program.now + stood)
        program.put('N10:0', 1)
        program.ladder.advance(program.now + 1.0)
        assert program.ladder.is_on(Lamp.IN_CONTROL) is not is_seen
    program.ladder.advance(program.now + 500.0)
    assert 200 < program.get('N11:3') < 300  # of the last minute only


def test_page_and_simulator_are_the_same_program() -> None:
    for seed, scan_time in enumerate((0.06, 0.1, 0.25)):
        dice = Random(seed)
        pair = [Program(kind, 60, scan_time) for kind in (Ladder, PageLadder)]
        now, beat, is_counting = 0.0, 0, True
        seen = set()
        for _ in range(300):
            now += dice.choice([0.01, 0.1, 0.3])
            is_counting ^= dice.random() < 0.02
            beat = beat % 32767 + 1 if is_counting else dice.choice([beat, beat, beat, 0, -32768])
            commands = {word: dice.choice([0, 0, 7]) for word in COMMANDS if dice.random() < 0.2}
            is_pressed = dice.random() < 0.2
            is_begin = dice.random() < 0.005
            for program in pair:
                program.put('N10:0', beat & 0xFFFF)
                for word, value in commands.items():
                    program.put(word, value)
                if is_pressed:
                    program.ladder.press_reset()
                if is_begin:
                    program.ladder.enter_run(now)
                program.ladder.advance(now)
            words = [[program.get(text) for text in (
                'N11:0', 'N11:1', 'N11:2', 'N11:3', 'N11:4', 'B12:0', 'T13:0', 'T13:0.PRE',
                'T13:0.ACC', 'T13:1', 'T13:1.PRE', 'T13:1.ACC', 'T13:2', 'T13:2.ACC')]
                for program in pair]
            assert words[0] == words[1], (seed, now)
            seen |= {number for number in range(6) if words[0][5] >> number & 1}
        assert pair[0].lamps == pair[1].lamps
        assert seen == {lamp for _, lamp, _ in pair[0].lamps} == set(Lamp)


def test_a_rung_that_cannot_be_read_is_refused() -> None:
    for text in ('0 XIC B3:0/0 OTL B3:0/1', '0 OTE B3:0/1 lamp', '0 [XIC B3:0/0 | XIC B3:0/1]]'):
        with pytest.raises(ValueError, match='is not an instruction|is too much'):
            parse(text)


@pytest.mark.parametrize('rung', range(15))
def test_heartbeat_that_is_written_in_the_middle_of_a_scan_is_one_value_for_all_rungs(
        rung: int) -> None:
    program = Program(PageLadder, scan_time=0.1)
    program.take_control()
    assert isinstance(program.ladder, PageLadder)
    program.ladder.before_rung = lambda number: program.put('N10:0', 0) if number == rung else None
    program.ladder.advance(program.now + 0.1)
    is_seen = program.ladder.is_on(Lamp.STOPPED)
    assert is_seen is (rung == 0)
    assert program.ladder.is_on(Lamp.ALIVE) is not is_seen
    assert program.ladder.is_on(Lamp.IN_CONTROL) is not is_seen
