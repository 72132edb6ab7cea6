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

"""The node as a process, against the simulator as a process, seen over DDS."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
import re
import signal
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters
from rclpy.duration import Duration, Infinite
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import (
    Float32MultiArray, Int16MultiArray, Int32MultiArray, MultiArrayLayout, String,
    UInt16MultiArray, UInt32MultiArray, UInt8MultiArray)
from std_srvs.srv import Trigger
from support.ros import (
    details, ERROR, find_status, Inbox, Observer, OK, Process, ros_args, until_status, values_in,
    WARN, write_csv)
from support.vectors import load_json

NET_HEADER = 'NAK_Retries,ENQ_Retries,Cmd_Timeout,Baud,Timeout'
NET_ROW = '2,2,500,115200,200'

MAP_HEADER = 'Tag,Command,Address,Station,PLC_Type,Length,Type,Period,Publish,Min,Max'
MAP_ROWS = (
    'bits,Read,B3:0/2,1,PLC5,6,,,,,',
    'door,Read,I:017/12,1,PLC5,,,,,,',
    'rack,Read,I:017,1,PLC5,,,,,,',
    'speeds,Read,N7:0,1,PLC5,2,,,,,',
    'levels,ReadWrite,F8:0,1,PLC5,3,,,,-50,150',
    'timer,Read,T4:1,1,PLC5,3,,,,,',
    'timer/done,Read,T4:1/DN,1,PLC5,,,,,,',
    'counts,Read,C5:0,1,PLC5,6,,,,,',
    'flags,ReadWrite,B3:4/1,1,PLC5,3,,,,,',
    'flag_word,Read,B3:4,1,PLC5,,,,,,',
    'parts,Read,C5:2.ACC,2,SLC,,,,,,',
    'preset,ReadWrite,C5:2.PRE,2,SLC,,,,,,',
    'gripper,Read,I:1.0,2,SLC,2,,,,,',
    'lamp,ReadWrite,O:2.0/3,2,SLC,,,,,,',
    'lamps,Read,O:2.0,2,SLC,,,,,,',
    'total,ReadWrite,L10:0,2,SLC,2,,,,,',
    'unsigned,Read,N7:40,2,SLC,,uint32,,,,',
    'name,ReadWrite,ST9:1,2,SLC,,,,,,',
    'digits,ReadWrite,N7:30,2,SLC,2,bcd16,,,,',
    'setpoint,ReadWrite,F8:4,2,SLC,,,,,-50,150',
    'recipe,ReadWrite,N7:10,2,SLC,4,,,Change,0,999',
    'heartbeat,Read,N7:60,2,SLC,,,1000,,,',
    'reset,Write,B3:1/5,2,SLC,,,,,,',
)

SIMULATOR_HEADER = 'Station,PLC_Type,Address,Length,Values,Motion,Period'
SIMULATOR_ROWS = (
    '1,PLC5,I:000,16,,,',
    '1,PLC5,I:017/12,1,1,,',
    '1,PLC5,B3:0,8,,,',
    '1,PLC5,B3:0/2,6,1 0 0 1 1 0,,',
    '1,PLC5,B3:4,1,65521,,',
    '1,PLC5,N7:0,16,1200 -800,,',
    '1,PLC5,F8:0,8,12.5 40.25 -3.5,,',
    '1,PLC5,T4:0,9,,,',
    '1,PLC5,T4:1.PRE,2,500 120,,',
    '1,PLC5,T4:1/DN,1,1,,',
    '1,PLC5,C5:0,6,,,',
    '1,PLC5,C5:1.PRE,2,9 8,,',
    '2,SLC,I:1.0,2,5 40960,,',
    '2,SLC,O:2.0,1,240,,',
    '2,SLC,B3:0,4,,,',
    '2,SLC,C5:0,9,,,',
    '2,SLC,C5:2.ACC,1,-17,,',
    '2,SLC,N7:0,64,,,',
    '2,SLC,N7:10,4,101 102 103 104,,',
    '2,SLC,N7:30,2,4660 153,,',
    '2,SLC,N7:40,2,-1 1,,',
    '2,SLC,N7:60,1,7,,',
    '2,SLC,F8:0,8,,,',
    '2,SLC,F8:4,1,21.5,,',
    '2,SLC,L10:0,2,-70000 2000000000,,',
    '2,SLC,ST9:0,1,,,',
    '2,SLC,ST9:1,1,Tank 4,,',
)

# Topic: type, label, values.
READS: dict[str, tuple[Any, str, list[float] | str]] = {
    'bits': (UInt8MultiArray, 'B3:0/2', [1, 0, 0, 1, 1, 0]),
    'door': (UInt8MultiArray, 'I:017/12', [1]),
    'rack': (UInt16MultiArray, 'I:017', [1 << 0o12]),
    'speeds': (Int16MultiArray, 'N7:0', [1200, -800]),
    'levels': (Float32MultiArray, 'F8:0', [12.5, 40.25, -3.5]),
    'timer': (Int16MultiArray, 'T4:1', [1 << 13, 500, 120]),
    'timer/done': (UInt8MultiArray, 'T4:1/DN', [1]),
    'counts': (Int16MultiArray, 'C5:0', [0, 0, 0, 0, 9, 8]),
    'flags': (UInt8MultiArray, 'B3:4/1', [0, 0, 0]),
    'flag_word': (UInt16MultiArray, 'B3:4', [0xFFF1]),
    'parts': (Int16MultiArray, 'C5:2.ACC', [-17]),
    'preset': (Int16MultiArray, 'C5:2.PRE', [0]),
    'gripper': (UInt16MultiArray, 'I:1.0', [5, 40960]),
    'lamp': (UInt8MultiArray, 'O:2.0/3', [0]),
    'lamps': (UInt16MultiArray, 'O:2.0', [0x00F0]),
    'total': (Int32MultiArray, 'L10:0', [-70000, 2000000000]),
    'unsigned': (UInt32MultiArray, 'N7:40', [0x1FFFF]),
    'name': (String, '', 'Tank 4'),
    'digits': (UInt16MultiArray, 'N7:30', [1234, 99]),
    'setpoint': (Float32MultiArray, 'F8:4', [21.5]),
    'recipe': (Int16MultiArray, 'N7:10', [101, 102, 103, 104]),
    'heartbeat': (Int16MultiArray, 'N7:60', [7]),
}
WRITES = {'levels', 'flags', 'preset', 'lamp', 'total', 'name', 'digits', 'setpoint', 'recipe',
          'reset'}

COUNTERS = [name for _, name in load_json('driver_tables.json')['counters']]
STATUSES = ['link', 'counters', 'station 1', 'station 2', 'mappings', 'writes']
WORDS = {OK: 'OK: ', WARN: 'WARN: ', ERROR: 'ERROR: '}

NOTHING = QoSProfile(depth=1)


@dataclass(frozen=True, slots=True)
class Files:
    """The files of a bridge; ``args`` are the node's arguments for them."""

    folder: Path
    net: Path
    map: Path
    simulator: Path
    port: Path

    def args(self, *assignments: str) -> list[str]:
        return ros_args(f'net_file:={self.net}', f'map_file:={self.map}',
                        f'port:={self.port}', *assignments)

    def start_simulator(self) -> Process:
        simulator = Process('simulator', '--pty', str(self.port), '--data', str(self.simulator))
        simulator.wait_for('stations 1 (PLC5), 2 (SLC) on')
        return simulator


def make_files(folder: Path) -> Files:
    return Files(
        folder,
        write_csv(folder / 'net.csv', NET_HEADER, [NET_ROW]),
        write_csv(folder / 'map.csv', MAP_HEADER, MAP_ROWS),
        write_csv(folder / 'simulator.csv', SIMULATOR_HEADER, SIMULATOR_ROWS),
        folder / 'plc')


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return make_files(tmp_path)


@pytest.fixture(scope='module')
def observer() -> Iterator[Observer]:
    with Observer() as observer:
        yield observer


@dataclass(slots=True)
class Bridge:
    """A node that runs against a simulator, and what it says of itself."""

    port: Path
    simulator: Process
    node: Process
    observer: Observer
    diagnostics: Inbox
    active: Inbox

    def listen(self, tag: str, qos: QoSProfile | None = None) -> Inbox:
        return self.observer.listen(READS[tag][0], f'/abdf1/read/{tag}', qos)

    @contextmanager
    def fault(self, command: str, station: int = 2) -> Iterator[None]:
        """Switch a fault on, and afterwards off until all is well again."""
        self.diagnostics.clear()
        self.simulator.say(command)
        try:
            yield
        finally:
            self.simulator.say(f'normal {station}')
            self.diagnostics.clear()
            until_status(self.diagnostics, 'mappings', OK)
            until_status(self.diagnostics, 'link', OK)
            self.diagnostics.clear()

    def write(self, tag: str, values: list[float] | str,
              layout: MultiArrayLayout | None = None) -> DiagnosticStatus:
        """Write once, and return the one result."""
        kind = READS[tag][0] if tag in READS else UInt8MultiArray
        message = kind(data=values)
        if layout is not None:
            message.layout = layout
        results = self.observer.results()
        publisher = self.observer.publisher(kind, f'/abdf1/write/{tag}')
        publisher.publish(message)
        result = results.first()
        self.observer.node.destroy_publisher(publisher)
        self.observer.forget(results)
        assert len(results) == 1
        assert result.name == tag
        return result


@pytest.fixture(scope='module')
def bridge(observer: Observer, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bridge]:
    files = make_files(tmp_path_factory.mktemp('bridge'))
    diagnostics = observer.diagnostics()
    active = observer.listen(UInt16MultiArray, '/abdf1/active_stations')
    with files.start_simulator() as simulator, \
            Process('node', *files.args('net.com_port:=2')) as node:
        bridge = Bridge(files.port, simulator, node, observer, diagnostics, active)
        until_status(diagnostics, 'mappings', OK)
        yield bridge
        node.end(signal.SIGINT)
        simulator.end(signal.SIGTERM)
    observer.forget(diagnostics)
    observer.forget(active)


# Reading


@pytest.mark.parametrize('tag', READS)
def test_late_subscriber_gets_the_value_with_its_type_and_layout(
        bridge: Bridge, tag: str) -> None:
    kind, label, values = READS[tag]
    inbox = bridge.listen(tag)
    message = inbox.first()
    assert values_in(message) == values
    if kind is not String:
        (dimension,) = message.layout.dim
        assert message.layout.data_offset == 0
        assert (dimension.label, dimension.size, dimension.stride) == (
            label, len(values), len(values))
    bridge.observer.forget(inbox)


def test_topics_are_those_of_the_map_and_no_others(bridge: Bridge) -> None:
    node = bridge.observer.node
    expected = {f'/abdf1/read/{tag}' for tag in READS} | {f'/abdf1/write/{tag}' for tag in WRITES}
    expected |= {'/abdf1/write_results', '/abdf1/active_stations'}
    found = dict(node.get_topic_names_and_types())
    assert {name for name in found if name.startswith('/abdf1/')} == expected
    for tag, (kind, _, _) in READS.items():
        assert found[f'/abdf1/read/{tag}'] == [f'std_msgs/msg/{kind.__name__}']
    assert found['/abdf1/write/name'] == ['std_msgs/msg/String']
    assert found['/abdf1/write_results'] == ['diagnostic_msgs/msg/DiagnosticStatus']
    assert found['/abdf1/active_stations'] == ['std_msgs/msg/UInt16MultiArray']


def read_qos(bridge: Bridge, tag: str) -> Any:
    (endpoint,) = bridge.observer.node.get_publishers_info_by_topic(f'/abdf1/read/{tag}')
    return endpoint.qos_profile


def test_read_topic_offers_its_stale_time(bridge: Bridge) -> None:
    qos = read_qos(bridge, 'heartbeat')
    assert qos.reliability is ReliabilityPolicy.RELIABLE
    assert qos.durability is DurabilityPolicy.TRANSIENT_LOCAL
    assert qos.liveliness is LivelinessPolicy.MANUAL_BY_TOPIC
    three_periods = Duration(seconds=3)
    assert qos.lifespan == qos.deadline == qos.liveliness_lease_duration == three_periods


def test_stale_time_is_never_less_than_what_the_line_can_do(bridge: Bridge) -> None:
    link = find_status(bridge.diagnostics.first(), 'link')
    scan_time = int(details(link)['expected scan time'].removesuffix(' ms'))
    assert scan_time > 100  # the period of this mapping, which the line cannot keep
    qos = read_qos(bridge, 'speeds')
    assert qos.lifespan == qos.deadline == qos.liveliness_lease_duration
    assert qos.lifespan.nanoseconds / 1e6 == pytest.approx(3 * scan_time, abs=3)


def test_topic_published_on_change_promises_no_heartbeat(bridge: Bridge) -> None:
    qos = read_qos(bridge, 'recipe')
    assert qos.reliability is ReliabilityPolicy.RELIABLE
    assert qos.durability is DurabilityPolicy.TRANSIENT_LOCAL
    assert qos.lifespan == qos.deadline == qos.liveliness_lease_duration == Infinite
    assert qos.liveliness is LivelinessPolicy.AUTOMATIC


@pytest.mark.parametrize('tag', sorted(WRITES))
def test_write_topic_takes_nothing_sent_before_its_time(bridge: Bridge, tag: str) -> None:
    (endpoint,) = bridge.observer.node.get_subscriptions_info_by_topic(f'/abdf1/write/{tag}')
    assert endpoint.qos_profile.reliability is ReliabilityPolicy.RELIABLE
    assert endpoint.qos_profile.durability is DurabilityPolicy.VOLATILE


def test_values_are_a_heartbeat_unless_published_on_change(bridge: Bridge) -> None:
    always, change = bridge.listen('parts'), bridge.listen('recipe')
    change.first()
    always.first()
    bridge.observer.until(lambda: len(always) > 5, 'six values of a topic that never changes')
    assert all(values_in(message) == [-17] for message in always)
    assert len(change) == 1
    bridge.observer.forget(always)
    bridge.observer.forget(change)


# Stations that fail


def test_silent_station_is_seen_by_every_means(bridge: Bridge) -> None:
    stale_time = read_qos(bridge, 'parts').deadline
    careful = bridge.listen('parts', QoSProfile(
        depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, deadline=stale_time,
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC, liveliness_lease_duration=stale_time))
    plain = bridge.listen('speeds')
    careful.first()
    bridge.observer.until(lambda: careful.liveliness, 'the publisher to be alive')
    assert careful.liveliness[-1].alive_count == 1
    assert not careful.deadlines
    bridge.active.values([0b110] + 15 * [0])
    with bridge.fault('silent 2'):
        # The subscriber that asked for it is told.
        bridge.observer.until(lambda: careful.deadlines, 'a missed deadline')
        bridge.observer.until(lambda: not careful.liveliness[-1].alive_count, 'no liveliness')
        assert careful.liveliness[-1].not_alive_count == 1
        # The Active Node Table and the diagnostics tell it to all.
        bridge.active.values([0b010] + 15 * [0])
        status = until_status(bridge.diagnostics, 'station 2', ERROR)
        assert re.fullmatch(
            r'ERROR: station 2 inactive since \d+\.\d s', status.message), status.message
        assert details(status)['active'] == 'no'
        status = until_status(bridge.diagnostics, 'link', WARN)
        assert status.message == 'WARN: port open, 1 of 2 stations do not answer'
        status = until_status(bridge.diagnostics, 'mappings', ERROR,
                              lambda status: details(status)['failed'] == '12')
        assert re.fullmatch(
            r'failed: C5:2\.ACC at station 2, last read \d+\.\d s ago; '
            r'2509 ERR_INACTIVE_STATION: Slave Station \(2\) Inactive',
            details(status)['parts']), status
        assert 'speeds' not in details(status)
        # A late subscriber gets no dead value, while the other station goes on.
        late = bridge.listen('parts')
        living = bridge.listen('speeds')
        bridge.observer.until(lambda: len(living) > 3, 'values of the living station')
        assert not late
        assert plain.next()
    # Values come back by themselves.
    assert values_in(late.first()) == [-17]
    bridge.active.clear()
    assert values_in(careful.next()) == [-17]
    bridge.observer.until(lambda: careful.liveliness[-1].alive_count == 1, 'liveliness again')
    for inbox in (careful, plain, late, living):
        bridge.observer.forget(inbox)
    bridge.node.wait_for('[ERROR]', '2509 ERR_INACTIVE_STATION: Slave Station (2) Inactive')
    bridge.node.wait_for('[INFO]', 'station 2 answers again')


def test_active_stations_are_latched_and_published_on_change_only(bridge: Bridge) -> None:
    late = bridge.observer.listen(UInt16MultiArray, '/abdf1/active_stations')
    assert values_in(late.first()) == [0b110] + 15 * [0]
    with bridge.fault('silent 1', station=1):
        late.values([0b100] + 15 * [0])
    late.until(lambda message: message.data[0] == 0b110, 'station 1 again')
    heartbeat = bridge.listen('heartbeat')
    bridge.observer.until(lambda: len(heartbeat) > 1, 'values')
    assert [message.data[0] for message in late] == [0b110, 0b100, 0b110]
    bridge.observer.forget(late)
    bridge.observer.forget(heartbeat)


def test_first_good_read_after_an_outage_is_published_even_on_change_only(
        bridge: Bridge) -> None:
    recipe = bridge.listen('recipe')
    recipe.first()
    with bridge.fault('silent 2'):
        until_status(bridge.diagnostics, 'station 2', ERROR)
        assert len(recipe) == 1
    bridge.observer.until(lambda: len(recipe) == 2, 'the value after the outage')
    bridge.observer.forget(recipe)


def counter(bridge: Bridge, name: str) -> int:
    bridge.diagnostics.clear()
    return int(details(find_status(bridge.diagnostics.first(), 'counters'))[name])


def test_slow_station_costs_polls_but_no_values(bridge: Bridge) -> None:
    eots = counter(bridge, 'CNT_EOTS_RCVD')
    parts = bridge.listen('parts')
    with bridge.fault('slow 2 3'):
        parts.clear()
        bridge.observer.until(lambda: len(parts) > 3, 'values of a slow station')
        assert all(values_in(message) == [-17] for message in parts)
        assert counter(bridge, 'CNT_EOTS_RCVD') >= eots + 9
        assert find_status(bridge.diagnostics.first(), 'station 2').level == OK
    bridge.observer.forget(parts)


def test_noise_damages_no_value(bridge: Bridge) -> None:
    parts, total = bridge.listen('parts'), bridge.listen('total')
    damaged = counter(bridge, 'CNT_CRC_ERRORS')
    with bridge.fault('noise 2 0.02'):
        bridge.observer.until(
            lambda: counter(bridge, 'CNT_CRC_ERRORS') > damaged + 3, 'damaged frames')
        assert all(values_in(message) == [-17] for message in parts)
        assert all(values_in(message) == [-70000, 2000000000] for message in total)
    bridge.node.wait_for('[ERROR]', '2506 ERR_BAD_CRC: Response with wrong CRC', '[station 2]')
    bridge.observer.forget(parts)
    bridge.observer.forget(total)


def test_error_replies_are_shown_with_their_meaning(bridge: Bridge) -> None:
    with bridge.fault('error 2 10'):
        status = until_status(bridge.diagnostics, 'mappings', ERROR,
                              lambda status: details(status)['failed'] == '12')
        assert re.fullmatch(r'failed: L10:0 at station 2, last read \d+\.\d s ago; STS 10: .+',
                            details(status)['total']), status
        station = find_status(bridge.diagnostics[-1], 'station 2')
        assert station.level == OK  # it answers
        assert int(details(station)['error replies']) >= 8
        assert find_status(bridge.diagnostics[-1], 'link').level == OK


# Writing


@pytest.mark.parametrize(('tag', 'values', 'shown', 'address', 'station'), [
    ('levels', [-50.0, 150.0, 0.5], '[-50, 150, 0.5]', 'F8:0', '1'),
    ('flags', [1, 0, 1], '[1, 0, 1]', 'B3:4/1', '1'),
    ('preset', [-32768], '[-32768]', 'C5:2.PRE', '2'),
    ('lamp', [1], '[1]', 'O:2.0/3', '2'),
    ('total', [-2147483648, 70000], '[-2.14748e+09, 70000]', 'L10:0', '2'),
    ('name', 'Käfig 7', "'Käfig 7'", 'ST9:1', '2'),
    ('digits', [9999, 0], '[9999, 0]', 'N7:30', '2'),
    ('recipe', [0, 999, 1, 2], '[0, 999, 1, 2]', 'N7:10', '2')])
def test_what_is_written_is_confirmed_and_comes_back(
        bridge: Bridge, tag: str, values: list[float] | str, shown: str, address: str,
        station: str) -> None:
    inbox = bridge.listen(tag)
    before = values_in(inbox.first())
    assert before != values
    result = bridge.write(tag, values)
    assert (result.level, result.message) == (OK, 'written')
    said = details(result)
    assert 0 < float(said.pop('latency_ms')) < 5000
    assert said == {'address': address, 'station': station, 'value': shown}
    inbox.values(values)
    assert bridge.write(tag, before).message == 'written'
    inbox.values(before)
    bridge.observer.forget(inbox)


@pytest.mark.parametrize(('tag', 'bits', 'word_tag', 'word'), [
    ('flags', [1, 0, 1], 'flag_word', 0xFFFB), ('lamp', [1], 'lamps', 0x00F8)])
def test_bits_leave_the_other_bits_of_their_word_alone(
        bridge: Bridge, tag: str, bits: list[float], word_tag: str, word: int) -> None:
    inbox = bridge.listen(word_tag)
    before = values_in(inbox.first())
    assert bridge.write(tag, bits).message == 'written'
    inbox.values([word])
    assert bridge.write(tag, [0] * len(bits)).message == 'written'
    inbox.clear()
    inbox.values(list(before))
    bridge.observer.forget(inbox)


@pytest.mark.parametrize(('tag', 'values', 'reason'), [
    ('recipe', [1, 2, 3], '3 values, the mapping has 4'),
    ('recipe', [1, 2, 3, 4, 5], '5 values, the mapping has 4'),
    ('recipe', [1, 2, 1000, 4], 'value 1000 at index 2 is outside Min 0, Max 999'),
    ('recipe', [-1, 2, 3, 4], 'value -1 at index 0 is outside Min 0, Max 999'),
    ('levels', [150.5, 0.0, 0.0], 'value 150.5 at index 0 is outside Min -50, Max 150'),
    ('setpoint', [float('nan')], 'value nan at index 0 is no float32'),
    ('setpoint', [float('inf')], 'value inf at index 0 is no float32'),
    ('lamp', [2], 'value 2 at index 0 is no bool'),
    ('lamp', [], '0 values, the mapping has 1'),
    ('digits', [10000, 0], 'value 10000 at index 0 is no bcd16'),
    ('name', 83 * 'x', '83 characters, a PLC string has 82'),
    ('name', '5 €', "character '€' does not exist in a PLC")])
def test_unfit_write_is_refused_with_the_reason(
        bridge: Bridge, tag: str, values: list[float] | str, reason: str) -> None:
    sent = counter(bridge, 'CNT_ERROR_MSGS_RCVD')
    result = bridge.write(tag, values)
    assert result.level == ERROR
    assert result.message == f'not written: refused: {reason}'
    inbox = bridge.listen(tag)
    assert values_in(inbox.next()) == READS[tag][2]
    bridge.observer.forget(inbox)
    assert counter(bridge, 'CNT_ERROR_MSGS_RCVD') == sent


def test_write_with_data_offset_is_refused(bridge: Bridge) -> None:
    result = bridge.write('setpoint', [1.0], MultiArrayLayout(data_offset=1))
    assert result.level == ERROR
    assert result.message == 'not written: refused: layout.data_offset should be 0'


def test_write_that_the_plc_refuses_has_failed(bridge: Bridge) -> None:
    bridge.diagnostics.clear()
    with bridge.fault('error 2 60'):
        result = bridge.write('setpoint', [3.0])
        assert result.level == ERROR
        assert result.message.startswith('not written: the PLC refused it: STS 60: ')
        status = until_status(bridge.diagnostics, 'writes', WARN)
        assert re.fullmatch(
            r'WARN: \d+ of \d+ writes confirmed; setpoint not written: the PLC refused it: '
            r'STS 60: .+', status.message), status.message
    with bridge.fault('error 2 F0 0B'):
        result = bridge.write('setpoint', [3.0])
        assert 'STS F0 EXT STS 0B: no access: privilege missing' in result.message
    setpoint = bridge.listen('setpoint')
    assert values_in(setpoint.first()) == [21.5]
    bridge.observer.forget(setpoint)


def test_write_whose_reply_does_not_come_is_unknown(bridge: Bridge) -> None:
    with bridge.fault('slow 2 100000'):
        result = bridge.write('setpoint', [21.5])
        assert result.level == ERROR
        assert result.message == 'unknown whether written: 2508 ERR_COMMAND_TIMEOUT: ' \
                                 'Command Timed Out'


def test_write_to_an_inactive_station_is_not_sent(bridge: Bridge) -> None:
    with bridge.fault('silent 2'):
        until_status(bridge.diagnostics, 'station 2', ERROR)
        result = bridge.write('setpoint', [3.0])
        assert result.level == ERROR
        assert result.message == 'not written: not sent: 2509 ERR_INACTIVE_STATION: ' \
                                 'Slave Station (2) Inactive'
        assert bridge.write('levels', [12.5, 40.25, -3.5]).message == 'written'  # station 1
    setpoint = bridge.listen('setpoint')
    assert values_in(setpoint.next()) == [21.5]
    bridge.observer.forget(setpoint)


# Diagnostics


def test_statuses_have_names_order_and_words(bridge: Bridge) -> None:
    bridge.diagnostics.clear()
    array_ = bridge.diagnostics.first()
    assert [status.name for status in array_.status] == [f'abdf1: {name}' for name in STATUSES]
    assert array_.header.stamp.sec == pytest.approx(time.time(), abs=10)
    for status in array_.status:
        assert status.message.startswith(WORDS[status.level]), status.message
        assert str(bridge.port) in status.hardware_id
