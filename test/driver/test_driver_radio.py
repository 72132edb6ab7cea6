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

"""The driver over radio modems: reads, writes, heartbeats and fallbacks of two PLCs."""

from __future__ import annotations

from dataclasses import replace
from random import Random

from abdf1_ros.plan.bounds import Times
from abdf1_ros.plan.report import make_report
from abdf1_ros.settings.heartbeats import Fallback, While
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
import pytest
from support.driver_bench import DriverBench, store
from support.mappings import make_mapping

FIRST, SECOND = 1, 2
NETWORK = Network(station=200, mode='Radio', baud=19200, cmd_timeout=500, nak_retries=1)


class RadioBench(DriverBench):
    """A driver, and SLCs behind one radio modem; a share ``loss`` of all packets is lost."""

    def __init__(self, network: Network = NETWORK, stations: int = SECOND) -> None:
        numbers = range(1, stations + 1)
        self.read = [make_mapping('N7:0', station=number, plc='SLC') for number in numbers]
        self.beat = make_mapping('N10:0', 'Heartbeat', station=FIRST, plc='SLC', period=2000)
        self.speed = make_mapping('N10:1', 'Write', station=FIRST, plc='SLC',
                                  fallback=Fallback((7,), 1000))
        rows = [*self.read, self.beat, self.speed]
        super().__init__(rows, network=network, start=False)
        self.loss = 0.0
        self.plcs = {number: self.plc(number, 'SLC', ('N7:0', 4), ('N10:0', 4))
                     for number in numbers}
        self.line.noise = self
        self.bound = next(bound for bound in Times(network, Rows(rows)).bounds()
                          if bound.mapping is self.speed)
        self.open()

    def damage(self, data: bytes, random: Random) -> bytes:
        """Return a packet, or nothing."""
        return b'' if random.random() < self.loss else data


def test_radios_that_avoid_collisions_carry_several_commands_as_forecast() -> None:
    cycles = []
    for several in (False, True):
        bench = RadioBench(replace(NETWORK, collision_avoidance=several), stations=8)
        bench.line.propagation = 0.1
        bench.run(60.0)
        cycle = 60.0 / len(bench.listener.values(bench.read[-1]))
        # The forecast leaves the heartbeat out, and counts waits that overlap in fact.
        assert 0.6 < cycle / make_report(bench.network, bench.read, 0.1, 0.2).poll_cycle < 1.6
        cycles.append(cycle)
    assert cycles[0] > 3 * cycles[1]


@pytest.mark.parametrize('several', [False, True])
@pytest.mark.parametrize('loss', [0.0, 0.3])
def test_guarded_value_ends_with_the_program_of_its_plc(several: bool, loss: float) -> None:
    network = replace(NETWORK, collision_avoidance=several)
    alive = make_mapping('N11:3', plc='SLC', station=FIRST, tag='alive', period=500)
    level = make_mapping('N7:0', plc='SLC', station=FIRST, tag='level', period=500,
                         condition=While(('alive',), 3000))
    bench = DriverBench([alive, level], network=network, start=False)
    plc = bench.plc(FIRST, 'SLC', ('N7:0', 4), ('N11:0', 4))
    dice = Random(1)
    bench.far.hear = bench.far.say = lambda data: b'' if dice.random() < loss else data
    bench.open()
    for count in range(1, 150):
        store(plc, 'N11:3', [count])
        bench.run(0.2)
    published = len(bench.listener.times(level))
    stopped = bench.clock()
    bench.run(60.0)
    assert published >= 10
    longest = network.line_mode.longest_transaction(network.line, 0.0)
    assert bench.listener.times(level)[-1] <= stopped + 3.0 + longest
