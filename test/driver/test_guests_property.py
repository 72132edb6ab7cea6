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

"""Any guests, with any commands: ours have their time, and no guest changes what we know."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from random import Random

from abdf1_ros.df1.frames import EOT
from abdf1_ros.driver.guest_rules import ShareAccess
from abdf1_ros.driver.kernel.heartbeat import BeatState
from abdf1_ros.settings.network import Network
import pytest
from support.driver_bench import DriverBench, Program, READ_N7
from support.mappings import make_mapping

SECONDS = 10.0
MARKS = b'NoAck', b'NoRep', b'NakIt'  # what becomes of the commands that have them


def echo(mark: bytes, size: int = 0) -> bytes:
    return b'\0' + mark + bytes(size)


def hear(data: bytes) -> bytes:
    """Lose some commands on their way to the PLC, and damage others."""
    return b'' if MARKS[0] in data else data.replace(MARKS[2], b'Nack!')


def say(data: bytes, is_polled: bool) -> bytes:
    """Lose some replies: they are never ready."""
    return data if MARKS[1] not in data else EOT if is_polled else b''


def made(mode: str, polling: str) -> DriverBench:
    """Return a driver with more to read than the line can carry, and a heartbeat."""
    rows = [make_mapping(f'N{20 + row}:0', station=1, plc='SLC', period=1) for row in range(6)]
    beat = make_mapping('N10:0', 'Heartbeat', station=1, plc='SLC', period=500)
    bench = DriverBench([beat, *rows], network=Network(
        mode=mode, polling=polling, baud=19200, timeout=100, cmd_timeout=500))
    bench.plc(1, 'SLC', ('N7:0', 20), ('N10:0', 4), *((f'N{20 + row}:0', 4) for row in range(6)))
    bench.far.hear, bench.far.say = hear, partial(say, is_polled=mode == 'Master')
    if mode == 'Peer':
        bench.open()

    def executor_runs() -> None:
        bench.driver.kernel.executor_ran(bench.clock())
        bench.at(bench.clock() + 0.1, executor_runs)

    executor_runs()
    bench.run(5.0)
    return bench


def begin(bench: DriverBench, random: Random, counts: list[Program]) -> None:
    """Let some guests ask, each something else whenever it has its reply, or now and then."""
    kinds: list[Callable[[Program], object]] = [
        lambda program: program.ask(READ_N7),
        lambda program: program.ask(echo(b'good', 200), cmd=6),
        *(lambda program, mark=mark: program.ask(echo(mark, random.choice((0, 200))), cmd=6)
          for mark in MARKS),
        lambda program: program.ask(READ_N7, dst=random.randrange(2, 254))]
    for number in range(random.randint(1, 16)):
        program = Program(bench, ShareAccess.READ, src=10 + number)
        mine = random.sample(kinds, random.randint(1, len(kinds)))
        pause = random.choice((0.001, 0.001, 0.05, 1.0))
        program.go_on(lambda program=program, mine=mine: random.choice(mine)(program), pause)
        counts.append(program)


@pytest.mark.parametrize(('mode', 'polling'), [
    ('Master', 'Message'), pytest.param('Master', 'Standard', marks=pytest.mark.long),
    ('Peer', 'Message')])
def test_ours_have_their_time_and_no_guest_changes_what_we_know(mode: str, polling: str) -> None:
    alone = made(mode, polling)
    before = len(alone.listener.reads)
    alone.run(SECONDS)
    usual = len(alone.listener.reads) - before
    for seed in range(2):
        random, guests = Random(seed), list[Program]()
        bench = made(mode, polling)
        begin(bench, random, guests)
        before, states = len(bench.listener.reads), set()
        for _ in range(round(SECONDS / 0.01)):  # so that programs ask again at once
            bench.run(0.01)
            states.add(bench.driver.kernel.rows.heartbeats[0].state)
        reads, station = len(bench.listener.reads) - before, bench.driver.stations[1]
        case = f'{mode} {polling} {seed}'
        assert bench.listener.changes == [], case
        assert states == {BeatState.COUNTS}, case
        assert (station.active, station.overdue, station.local_status) == (True, 0, 0), case
        # A quarter for commands, an eighth for silent stations, and one of each that has begun.
        assert reads > 0.6 * usual, (case, reads, usual)
        assert sum(len(program.replies) for program in guests) > 0, case
