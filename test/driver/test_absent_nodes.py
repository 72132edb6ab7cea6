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
A node that is not there, behind a gateway, takes no other node with it.

Half duplex: reports of Yokogawa ACM11 and 1770-KF2 users, where a gateway answers a command for
an absent node with DLE NAK, or not at all, or with STS 02.
"""

from collections.abc import Sequence
from functools import cache
from itertools import pairwise, product

from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.network import Network
import pytest
from support.cases import long_unless
from support.driver_bench import DriverBench
from support.mappings import make_mapping
from support.odd_device import Answer, EOT, OddDevice, Wiring

GATEWAY, LIVING, SECONDS, TIMEOUT = 8, 1, 20.0, 0.3
ABSENT = (11, 12, 13)
MESSAGES = 15
NAK, NOTHING, STATUS = Answer.NAK, Answer.NOTHING, Answer.ACK
LOSES, LATE = Answer.LOSES, Answer.LATE
_MODES = {'Peer': (Wiring.FULL, {'mode': 'Peer'}), 'Radio': (Wiring.RADIO, {'mode': 'Radio'})}
# Each node is a station of the line (1747-UM005B 3-8, 1785-KE 5-13).
_REMOTE = {'Remote Message': 'Message', 'Remote Standard': 'Standard'}
KINDS = [('Message', STATUS), ('Message', NOTHING), ('Message', NAK), ('Standard', STATUS),
         ('Standard', NOTHING), ('Standard', NAK), ('Peer', STATUS), ('Peer', NOTHING),
         ('Peer', NAK), ('Peer', LOSES), ('Message', LOSES), ('Standard', LOSES),
         ('Radio', STATUS), ('Radio', NOTHING), ('Message', LATE), ('Standard', LATE),
         ('Peer', LATE), ('Radio', LATE), *(
             (mode, answer) for mode in _REMOTE for answer in (STATUS, NAK, LOSES, LATE))]
# Three absent nodes behind each gateway, and a single one of some. Standard polling takes longest.
CASES = long_unless(
    lambda polling, answer, count: count == 3 and polling in ('Message', *_MODES) or (
        polling, answer, count) in (
            ('Remote Standard', NAK, 3), ('Remote Message', LOSES, 3), ('Message', NAK, 1),
            ('Peer', STATUS, 1), ('Radio', LATE, 1)),
    [(*kind, count) for kind, count in product(KINDS, (1, 3))])


class Plant(DriverBench):
    """A living node that is read and written to, and ``absent`` ones, behind a gateway."""

    def __init__(self, polling: str, answer: Answer, absent: Sequence[int] = (),
                 *, has_own: bool = False, executes_diagnostics: bool = False) -> None:
        via = None if polling in _MODES or polling in _REMOTE else GATEWAY
        self.read = make_mapping('N7:0', station=LIVING, plc='SLC', via=via, period=200)
        self.order = make_mapping(
            'N7:20', 'Write', station=LIVING, plc='SLC', via=via, tag='order',
            fallback=Fallback((0,), 3000) if has_own else None)
        beat = make_mapping('N10:0', 'Heartbeat', station=LIVING, plc='SLC', via=via, period=500)
        rows = [self.read, self.order, *([beat] if has_own else []), *(
            make_mapping('N7:0', station=number, plc='SLC', via=via, period=200)
            for number in absent)]
        wiring, mode = _MODES.get(
            polling, (Wiring.HALF, {'polling': _REMOTE.get(polling, polling)}))
        self.device = OddDevice(wiring, GATEWAY, (LIVING,))
        if polling in _REMOTE:
            self.device.stations = frozenset((LIVING, *ABSENT))
        self.device.takes = lambda data: Answer.ACK if data[0] not in ABSENT or (
            executes_diagnostics and data[2] == 6) else answer
        self.device.executes_diagnostics = executes_diagnostics
        super().__init__(
            rows, network=Network(
                station=5, baud=19200, timeout=int(TIMEOUT * 1000), cmd_timeout=1000,
                **mode),  # type: ignore[arg-type]
            settings=DriverSettings(processor_period=1.0 if executes_diagnostics else 0.0),
            start=False, far=self.device)
        for number in range(MESSAGES):
            self.at(1.25 * number + 0.5, lambda number=number: self.write(  # type: ignore[misc]
                self.order, [number + 1]))
        self.breathe()
        self.open(run=SECONDS)

    @property
    def longest_gap(self) -> float:
        """Return the longest time (s) between two values of the living node."""
        times = [0.0, *self.listener.times(self.read), SECONDS]
        return max(after - before for before, after in pairwise(times))

    @property
    def silent(self) -> set[int]:
        """Return the stations that do not answer."""
        return {station.number for station in self.driver.stations
                if not station.replies_in_time or station.has_no_replies or station.local_status}


@cache
def plant_with(polling: str, answer: Answer, count: int) -> Plant:
    """Return a plant that has heartbeats and so many absent nodes, after its time."""
    return Plant(polling, answer, ABSENT[:count], has_own=True)


@pytest.mark.parametrize('polling, answer, count', CASES)
def test_living_node_keeps_its_reads_writes_and_heartbeat(
        polling: str, answer: Answer, count: int) -> None:
    plant, alone = plant_with(polling, answer, count), plant_with(polling, STATUS, 0)
    reads = [len(bench.listener.times(bench.read)) for bench in (alone, plant)]
    assert reads[1] >= 0.75 * reads[0], reads
    assert plant.listener.outcomes() == [Outcome.FALLBACK, *MESSAGES * [Outcome.WRITTEN]]
    assert plant.longest_gap <= alone.longest_gap + 4 * TIMEOUT + 0.1
    assert plant.silent == {*ABSENT[:count]}
    assert plant.device.words[LIVING, 10, 0] >= 30  # of 40
    assert plant.device.words[LIVING, 7, 20] == MESSAGES


@pytest.mark.parametrize('polling, answer', long_unless(
    lambda polling, answer: (polling == 'Standard') == (answer is NAK),
    product(('Message', 'Standard'), (NAK, NOTHING))))
def test_node_that_comes_back_is_read_again(polling: str, answer: Answer) -> None:
    plant = Plant(polling, answer, ABSENT[:1])
    plant.device.takes = lambda data: Answer.ACK
    plant.device.nodes = frozenset((LIVING, *ABSENT))
    plant.device.say = lambda data: EOT if data[:4] == b'\x10\x02\x05\x0B' \
        and plant.clock() < SECONDS + 0.5 else data  # the node takes its time at first
    plant.run(3.0)  # seven Timeouts after the last probe at most
    assert plant.listener.changes == [(11, False), (11, True)]
    assert plant.silent == set()
    assert plant.driver.counters.stale_messages == 0  # the reply to the first probe is taken


@pytest.mark.parametrize('polling, answer', long_unless(
    lambda polling, answer: polling != 'Standard' or answer is STATUS,
    product(('Message', 'Standard', 'Peer'), (STATUS, NAK))))
def test_node_is_not_proven_by_a_diagnostic_command_that_its_gateway_executes(
        polling: str, answer: Answer) -> None:
    plant = Plant(polling, answer, ABSENT[:1], executes_diagnostics=True)
    for _ in range(20):
        plant.run(0.1)
        assert plant.silent == {11}
    assert len(plant.listener.times(plant.read)) >= 90
    assert plant.listener.changes in ([], [(11, False)])
    assert plant.driver.checks.known(11).processor


@pytest.mark.parametrize('polling', ['Message', 'Standard'])
def test_gateway_that_takes_no_command_for_itself_passes_others_on(polling: str) -> None:
    plant = Plant(polling, NAK)
    plant.device.takes = lambda data: NAK if data[0] == GATEWAY else Answer.ACK
    before = len(plant.listener.times(plant.read))
    plant.run(20.0)
    assert len(plant.listener.times(plant.read)) >= before + 95
    assert plant.listener.changes == []


@pytest.mark.parametrize('polling', ['Message', 'Standard'])
def test_gateway_that_answers_no_poll_either_is_silent_with_all_behind_it(polling: str) -> None:
    plant = Plant(polling, NAK, ABSENT[:1])
    plant.device.takes = lambda data: NOTHING
    plant.device.say = lambda data: b''
    plant.run(5.0)
    assert {station.number for station in plant.driver.stations if not station.active} \
        == {GATEWAY, LIVING, 11}
    plant.device.say = bytes
    plant.device.takes = lambda data: Answer.ACK
    plant.run(5.0)
    assert plant.driver.stations[LIVING].active
