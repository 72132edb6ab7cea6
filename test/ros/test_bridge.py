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

"""A running bridge seen over DDS: node and simulator are processes of their own."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
import re
import signal
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
import pytest
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile
from std_msgs.msg import String, UInt8MultiArray, UInt16MultiArray  # noqa: I101
from std_srvs.srv import Trigger
from support import ros
from support.simulator_process import make_files, NET_HEADER, READS, WRITES
from support.vectors import load_tables

COUNTERS = [name for _, name in load_tables()['counters']]


def _kind(tag: str) -> Any:
    return READS[tag][0] if tag in READS else UInt8MultiArray


class Bridge:
    """A node that runs against a simulator, and what it says of itself."""

    simulator: ros.Process
    node: ros.Process

    def __init__(self, port: Path, observer: ros.Observer) -> None:
        self.port = port
        self.observer = observer
        self.diagnostics = observer.diagnostics(port)
        self.results = observer.results()
        self.active = observer.listen(UInt16MultiArray, '/abdf1/active_stations')
        self._publishers: dict[str, Any] = {}

    def open_publishers(self) -> None:
        """Find the node's subscribers; it has time to find these publishers, too."""
        for tag in WRITES:
            self._publishers[tag] = self.observer.publisher(_kind(tag), f'/abdf1/write/{tag}')

    def listen(self, tag: str, qos: QoSProfile | None = None) -> ros.Inbox:
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
            self.diagnostics.until_well()
            self.diagnostics.clear()

    def write(self, tag: str, values: list[float] | str) -> DiagnosticStatus:
        """Write once, and return the one result."""
        self.results.clear()
        self._publishers[tag].publish(_kind(tag)(data=values))
        result = self.results.first()
        assert [result.name for result in self.results] == [tag]
        return result


@pytest.fixture(scope='module')
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bridge]:
    files = make_files(tmp_path_factory.mktemp('bridge'))
    # On a busy host a process may stand still: no station is lost by it, and no write too old.
    ros.write_csv(files.net, NET_HEADER, ['2,2,1000,115200,300'])
    arguments = files.args('net.com_port:=2', 'diagnostics_period:=0.25', 'write_timeout:=4.0',
                           'processor_period:=0.3')
    with ros.Observer() as observer:
        bridge = Bridge(files.port, observer)
        with files.start_simulator() as bridge.simulator, \
                ros.Process('node', *arguments) as bridge.node:
            bridge.open_publishers()
            bridge.diagnostics.until_fresh()
            yield bridge
            bridge.node.end(signal.SIGINT)
            bridge.simulator.end(signal.SIGTERM)


# Reading


def test_late_subscriber_gets_the_value_with_its_type_and_layout(bridge: Bridge) -> None:
    for tag, inbox in {tag: bridge.listen(tag) for tag in READS}.items():
        kind, label, values = READS[tag]
        message = inbox.first()
        assert ros.values_in(message) == values, tag
        if kind is not String:
            (dimension,) = message.layout.dim
            assert message.layout.data_offset == 0
            assert (dimension.label, dimension.size, dimension.stride) == (
                label, len(values), len(values))
        bridge.observer.forget(inbox)


def test_topics_are_those_of_the_map_and_no_others(bridge: Bridge) -> None:
    node = bridge.observer.node
    expected = {f'/abdf1/read/{tag}' for tag in READS} | {f'/abdf1/write/{tag}' for tag in WRITES}
    expected |= {'/abdf1/write_results', '/abdf1/active_stations', '/abdf1/snapshot'}
    bridge.observer.until(
        lambda: expected <= {name for name, _ in node.get_topic_names_and_types()}, 'all topics')
    found = dict(node.get_topic_names_and_types())
    assert {name for name in found if name.startswith('/abdf1/')} == expected
    for tag, (kind, _, _) in READS.items():
        assert found[f'/abdf1/read/{tag}'] == [f'std_msgs/msg/{kind.__name__}']
    assert found['/abdf1/write/name'] == ['std_msgs/msg/String']
    assert found['/abdf1/write_results'] == ['diagnostic_msgs/msg/DiagnosticStatus']
    assert found['/abdf1/active_stations'] == ['std_msgs/msg/UInt16MultiArray']


# Stations that fail


def test_silent_station_is_seen_by_every_means(bridge: Bridge) -> None:
    (endpoint,) = bridge.observer.until(
        lambda: bridge.observer.node.get_publishers_info_by_topic('/abdf1/read/parts'),
        'the publisher')
    stale_time = endpoint.qos_profile.deadline
    careful = bridge.listen('parts', QoSProfile(
        depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, deadline=stale_time,
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC, liveliness_lease_duration=stale_time))
    plain = bridge.listen('speeds')
    # Fast DDS tells a change to all readers of that moment: one that matches then may not get it.
    careful.first()
    careful.deadlines.clear()
    bridge.active.values([0b110] + 15 * [0])
    bridge.active.clear()
    with bridge.fault('silent 2'):
        # The subscriber that asked for it is told.
        bridge.observer.until(lambda: careful.deadlines, 'a missed deadline')
        bridge.observer.until(
            lambda: careful.liveliness and careful.liveliness[-1].not_alive_count == 1,
            'no liveliness')
        # The Active Node Table and the diagnostics tell it to all.
        bridge.active.values([0b010] + 15 * [0])
        status = ros.until_status(bridge.diagnostics, 'station 2', ros.ERROR)
        assert re.fullmatch(
            r'ERROR: station 2 inactive for \d+\.\d s', status.message), status.message
        assert ros.details(status)['active'] == 'no'
        status = ros.until_status(bridge.diagnostics, 'link', ros.WARN)
        assert status.message == 'WARN: port open, 1 of 2 stations do not answer'
        assert ros.details(status)['diagnostics period'] == '0.25 s'
        status = ros.until_status(
            bridge.diagnostics, 'mappings', ros.ERROR, lambda status: [
                ros.details(status)[key] for key in ('failed', 'late', 'stale')] == [
                    '12', '0', '0'])
        assert re.fullmatch(
            r'failed: C5:2\.ACC at station 2, last read \d+\.\d s ago; '
            r'2509 ERR_INACTIVE_STATION: Slave Station \(2\) Inactive',
            ros.details(status)['parts']), status
        assert 'speeds' not in ros.details(status)
        # A late subscriber gets no dead value, while the other station goes on.
        late = bridge.listen('parts')
        living = bridge.listen('speeds')
        bridge.observer.until(lambda: len(living) > 3, 'values of the living station')
        assert not late
        assert plain.next()
    # Values come back by themselves.
    assert ros.values_in(late.first()) == [-17]
    bridge.active.clear()
    assert ros.values_in(careful.next()) == [-17]
    bridge.observer.until(lambda: not careful.liveliness[-1].not_alive_count, 'liveliness again')
    for inbox in (careful, plain, late, living):
        bridge.observer.forget(inbox)
    bridge.node.wait_for('[ERROR]', '2509 ERR_INACTIVE_STATION: Slave Station (2) Inactive')
    bridge.node.wait_for('[INFO]', 'station 2 answers again')


def test_active_stations_are_latched_and_published_on_change_only(bridge: Bridge) -> None:
    late = bridge.observer.listen(UInt16MultiArray, '/abdf1/active_stations')
    assert ros.values_in(late.first()) == [0b110] + 15 * [0]
    with bridge.fault('silent 1', station=1):
        late.values([0b100] + 15 * [0])
    bridge.observer.until(lambda: late[-1].data[0] == 0b110, 'station 1 again')
    heartbeat = bridge.listen('heartbeat')
    bridge.observer.until(lambda: len(heartbeat) > 1, 'values')
    assert all(one.data != other.data for one, other in pairwise(late))
    bridge.observer.forget(late)
    bridge.observer.forget(heartbeat)


# Writing


@pytest.mark.parametrize(('tag', 'values', 'shown', 'address', 'station'), [
    ('temperatures', [125.0, -39.5], '[125, -39.5]', 'N7:4', '1'),
    ('label', 'a\x1b\n', r"'a\x1b\n'", 'A10:0', '1'),
    ('flags', [1, 0, 1], '[1, 0, 1]', 'B3:4/1', '1'),
    ('total', [-2147483648, 70000], '[-2147483648, 70000]', 'L10:0', '2'),
    ('name', 'Käfig 7', "'Käfig 7'", 'ST9:1', '2'),
    ('digits', [9999, 0], '[9999, 0]', 'N7:30', '2'),
    ('recipe', [0, 999, 1, 2], '[0, 999, 1, 2]', 'N7:10', '2')])
def test_what_is_written_is_confirmed_and_comes_back(
        bridge: Bridge, tag: str, values: list[float] | str, shown: str, address: str,
        station: str) -> None:
    inbox = bridge.listen(tag)
    before = ros.values_in(inbox.first())
    assert before != values
    result = next(result for result in (bridge.write(tag, values) for _ in range(4))
                  if result.message == 'written')  # unknown if the host stood still
    assert result.level == ros.OK
    said = ros.details(result)
    assert 0 < float(said.pop('latency_ms')) < 5000
    assert int(said.pop('request')) > 0
    assert said == {'address': address, 'station': station, 'value': shown}
    inbox.values(values)
    inbox.clear()  # of what it was at first
    assert bridge.write(tag, before).message == 'written'
    inbox.values(before)
    bridge.observer.forget(inbox)


# Diagnostics


def test_all_counters_are_there_by_mnemonic_in_order_and_start_afresh(bridge: Bridge) -> None:
    before = ros.details(ros.find_status(bridge.diagnostics.fresh(), 'counters'))
    assert list(before) == COUNTERS
    assert len(COUNTERS) == 29
    for name in ('CNT_MSG_PACKETS_SENT', 'CNT_CMD_MSGS_SENT', 'CNT_REPLY_MSGS_RCVD',
                 'CNT_POLL_MSGS_SENT', 'CNT_ACKS_SENT', 'CNT_ACKS_RCVD', 'CRD_CHAR_SENT',
                 'CRD_CHAR_RECV'):
        assert int(before[name]) > 0, name
    assert bridge.observer.call(Trigger, '/abdf1/reset_counters', Trigger.Request()).success
    after = ros.details(ros.find_status(bridge.diagnostics.fresh(), 'counters'))
    assert list(after) == COUNTERS
    assert 0 <= int(after['CNT_CMD_MSGS_SENT']) < int(before['CNT_CMD_MSGS_SENT'])
    assert int(after['CRD_CHAR_SENT']) < int(before['CRD_CHAR_SENT'])


def test_processor_that_runs_no_program_is_a_warning(bridge: Bridge) -> None:
    with bridge.fault('mode 2 program'):
        status = ros.until_status(
            bridge.diagnostics, 'station 2', ros.WARN, lambda status: status.message ==
            'WARN: station 2 active, but in program mode (REM PROG)')
        assert ros.details(status)['processor'] == 'SLC 5/03 series A revision 1, REM PROG'
        bridge.simulator.say('mode 2 run')
