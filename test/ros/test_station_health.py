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

"""What the node says of its PLCs' processors and counters, first by itself, then in reality."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import count
import time

from abdf1_ros.driver.checks import StationHealth
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity, Mode
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.ros.diagnostics.line import LineView, SHARED_BY_SPLITTER, SWALLOWED
from abdf1_ros.ros.diagnostics.stations import health_values, LinkCounterService, processor_fault
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
import pytest
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from std_srvs.srv import Trigger
from support.cases import for_all
from support.driver_bench import DriverBench, Recorder
from support.mappings import make_mapping
from support.odd_device import frame, OddDevice, Wiring
from support.ros import Observer

NOW = 1000.0
SLC = Identity(PlcType.SLC, 'SLC 5/03', 'B', '3', Mode.REMOTE_RUN, 'REM RUN')


def with_mode(mode: Mode | None, text: str, *faults: str) -> Identity:
    """Return an SLC in that mode."""
    return Identity(PlcType.SLC, 'SLC 5/03', 'B', '3', mode, text, faults)


@for_all(('identity', 'text'), [
    (None, None), (SLC, None), (with_mode(Mode.RUN, 'RUN'), None),
    (with_mode(None, 'mode 0x05'), None), (Identity(None, '1770-KF2'), None),
    (with_mode(Mode.REMOTE_PROGRAM, 'REM PROG'), 'in program mode (REM PROG)'),
    (with_mode(Mode.REMOTE_TEST_SCAN, 'REM TEST, single scan'),
     'in test mode (REM TEST, single scan)'),
    (with_mode(Mode.PROGRAM, 'PROG', 'major error 0x0020, processor halted'),
     'major error 0x0020, processor halted (PROG)'),
    (with_mode(Mode.RUN, 'RUN', 'bad RAM', 'bad ROM'), 'bad RAM, bad ROM (RUN)')])
def test_what_keeps_a_processor_from_its_work(identity: Identity | None, text: str | None) -> None:
    assert processor_fault(identity) == text


PLC5 = Identity(PlcType.PLC5, 'PLC-5/40')
LEVEL = make_mapping('N7:0', plc='SLC', item=6)


@for_all(('identity', 'rows', 'text'), [
    (PLC5, [LEVEL, make_mapping('N7:1', plc='SLC', item=9)],
     'station 1 is a PLC-5/40, map.csv:7 says SLC'), (SLC, [LEVEL], None),
    (SLC, [LEVEL, make_mapping('N7:0', plc='PLC5', item=2)],
     'station 1 is an SLC 5/03, map.csv:3 says PLC5'),
    (PLC5, [make_mapping('020', plc='PLC2'), make_mapping('N7:0', 'Serve', plc='SLC')], None),
    (Identity(None, '1770-KF2'), [LEVEL], None),
    (None, [LEVEL], None), (PLC5, [], None),
    (replace(SLC, processor=Processor.SLC_5_03),
     [LEVEL, make_mapping('N7:1', plc='SLC', processor='5/03')], None),
    (replace(SLC, processor=Processor.SLC_5_03),
     [make_mapping('N7:0', plc='SLC', item=6, processor='5/02')],
     'station 1 is an SLC 5/03, map.csv:7 says 5/02 in the column Processor'),
    (SLC, [make_mapping('N7:0', plc='SLC', item=6, processor='5/02')], None),
    (replace(SLC, model='SLC 5/02', processor=Processor.SLC_5_02),
     [LEVEL, make_mapping('N7:1', plc='SLC', processor='5/03')],  # fits the empty cell of LEVEL
     'station 1 is an SLC 5/02, map.csv:2 says 5/03 in the column Processor')])
def test_plc_of_another_family_than_its_rows(
        identity: Identity | None, rows: list[Mapping], text: str | None) -> None:
    driver = Driver(Network(), rows, DriverSettings(), Recorder(lambda: NOW))
    if identity is not None:
        driver.checks.heard(1, identity, NOW)
    assert LineView(driver).wrong_type(1) == text


MODES = pytest.mark.parametrize(('mode', 'wiring'), [
    ('Master', Wiring.HALF), ('Peer', Wiring.FULL)])


class Slc(OddDevice):
    """An SLC that gives up a reply after three repetitions, its Message Retries."""

    polls = 0

    def _polled(self, station: int) -> None:
        super()._polled(station)
        self.polls = self.polls + 1 if self._polled_station is not None else 0
        if self.polls > 3:
            self._replies[station].popleft()
            self.polls, self._polled_station = 0, None


def line_to(device: OddDevice, mode: str) -> tuple[DriverBench, LineView]:
    """Return a line with two rows, of which one has bytes 11 and 13 hex."""
    device.words = {(1, 7, 0): 4321, (1, 9, 0): 0x1311}
    rows = [make_mapping(f'N{file}:0', plc='SLC', period=200) for file in (7, 9)]
    bench = DriverBench(rows, far=device, network=Network(mode=mode, baud=19200, timeout=300))
    return bench, LineView(bench.driver)


@MODES
def test_flow_control_that_swallows_bytes_is_named(mode: str, wiring: Wiring) -> None:
    device = Slc(wiring)
    device.say = lambda data: data.translate(None, b'\x11\x13')
    bench, line = line_to(device, mode)
    assert line.evidence() == []
    bench.run(250.0)
    assert SWALLOWED in line.evidence()
    line.port_opened()  # as after a cut of the connection
    assert SWALLOWED not in line.evidence()
    device.say = bytes
    bench.run(250.0)
    assert line.evidence() == []


@MODES
@pytest.mark.parametrize('is_one_row', [False, True])
def test_other_damage_is_not_taken_for_flow_control(
        mode: str, wiring: Wiring, is_one_row: bool) -> None:
    device, numbers = Slc(wiring), count()

    def say(data: bytes) -> bytes:
        is_hit = b'\x11\x13' in data if is_one_row else next(numbers) % 9 == 0
        return data[:-1] + bytes((data[-1] ^ 1,)) if is_hit and len(data) > 8 else data

    device.say = say
    bench, line = line_to(device, mode)
    for _ in range(250):
        bench.run(1.0)
        assert SWALLOWED not in line.evidence()
    assert bench.driver.counters.damaged_frames > 10


def test_second_user_of_the_port_of_a_plc_is_named() -> None:
    device, answers = OddDevice(Wiring.FULL), count()
    bench, line = line_to(device, 'Peer')
    bench.run(20.0)
    assert line.evidence() == []
    hmi = frame(bytes.fromhex('00 01 4f 00 77 77 0f 27'))  # a reply to station 0
    device.say = lambda data: data + hmi if next(answers) % 2 else data
    bench.run(20.0)
    assert line.evidence() == [SHARED_BY_SPLITTER]
    values = bench.listener.values(bench.mappings[0])
    assert values and {tuple(value) for value in values} == {(4321,)}
    device.say = bytes
    line.port_opened()
    bench.run(20.0)
    assert line.evidence() == []


def test_values_of_a_processor() -> None:
    assert health_values(StationHealth(), NOW) == {
        'processor': 'unknown (not asked yet)', 'mode': 'unknown', 'faults': 'unknown'}
    identity = Identity(PlcType.SLC, 'SLC 5/03', 'B', '3', Mode.RUN, 'RUN', ('halted',),
                        ('forces active', 'testing edits'))
    health = StationHealth(str(identity), identity, NOW - 2.5, {'messages sent': '7'})
    assert health_values(health, NOW) == {
        'processor': 'SLC 5/03 series B revision 3, RUN', 'mode': 'RUN (2.5 s ago)',
        'faults': 'halted; forces active; testing edits', 'link counter messages sent': '7'}


def test_values_without_faults_and_without_counters() -> None:
    values = health_values(StationHealth(str(SLC), SLC, NOW, no_counters='STS 10: illegal'), NOW)
    assert (values['faults'], values['link counters']) == ('none', 'STS 10: illegal')
    gateway = Identity(None, '1770-KF2')
    assert health_values(StationHealth('x', gateway, NOW), NOW)['mode'] == 'none (0.0 s ago)'


# The service, with a driver that nothing moves


class Desk:
    """A node that has the service, and a client that has called it."""

    def __init__(self, observer: Observer) -> None:
        self.observer = observer
        mappings = [make_mapping('N7:0', 'Write', station=station) for station in (1, 2)]
        self.driver = Driver(Network(), mappings, DriverSettings(), Recorder(time.monotonic))
        self.driver._inbox.open()  # noqa: SLF001
        self.driver.checks.begin(0.0)
        self.woken: list[str] = []
        self.service = LinkCounterService(self.driver, lambda: self.woken.append('link'),
                                          lambda: self.woken.append('executor'))
        observer.node.create_service(Trigger, '~/read', self.service.answer,
                                     callback_group=MutuallyExclusiveCallbackGroup())
        self.client = observer.node.create_client(Trigger, '~/read')
        observer.until(self.client.service_is_ready, 'the service')
        self.answer = self.client.call_async(Trigger.Request())
        self.ticks: list[float] = []
        observer.node.create_timer(0.01, lambda: self.ticks.append(time.monotonic()))

    def work(self, replies: dict[int, bytes]) -> None:
        """Let stations answer; the service looks for it afterwards."""
        wanted = self.driver.checks.counters_wanted
        self.observer.until(lambda: len(wanted) == 2, 'requests')
        while not wanted.isdisjoint(replies):
            task = self.driver.next_task(self.driver.machine.now)
            assert task is not None
            is_echo = task.command.data[0] == 0
            task.reply(task.command.reply(b'' if is_echo else replies[task.command.dst]))
        self.service.check(time.monotonic())

    def result(self) -> tuple[bool, str]:
        """Return what the client gets."""
        self.observer.until(self.answer.done, 'an answer')
        return self.answer.result().success, self.answer.result().message

    def ticks_pass(self) -> None:
        """Wait until the node has done something else a few times."""
        self.ticks.clear()
        self.observer.until(lambda: len(self.ticks) > 3, 'ticks')


@pytest.fixture
def desk() -> Iterator[Desk]:
    with Observer('desk') as observer:
        yield Desk(observer)


def test_service_waits_without_holding_up_the_node(desk: Desk) -> None:
    desk.work({})
    desk.ticks_pass()
    assert not desk.answer.done()
    assert desk.woken == ['link']
    desk.work({1: b'\1\2', 2: b'\3\4'})
    assert desk.woken == ['link', 'executor']
    assert desk.result() == (True, 'station 1: bytes 01 02; station 2: bytes 03 04')


def test_service_gives_up(desk: Desk) -> None:
    desk.work({1: b'\1\2', 2: b'\3\4'})
    assert desk.result()[0]
    desk.answer = desk.client.call_async(Trigger.Request())
    desk.work({1: b'\1\2'})
    desk.service.check(time.monotonic() + 4.0)
    desk.ticks_pass()
    assert not desk.answer.done()
    desk.service.check(time.monotonic() + 6.0)
    assert desk.result() == (False, 'station 1: bytes 01 02; station 2: no answer yet')


def test_service_ends_with_the_port(desk: Desk) -> None:
    desk.work({1: b'\1\2'})
    desk.driver.checks.end('port lost: unplugged')
    desk.service.check(time.monotonic())
    assert desk.result() == (False, 'station 1: bytes 01 02; station 2: port lost: unplugged')
    for number in (1, 2):
        desk.driver.stations.lost(number, 0.0)
    desk.answer = desk.client.call_async(Trigger.Request())
    assert desk.result() == (False, 'no station to ask: no station is active')
