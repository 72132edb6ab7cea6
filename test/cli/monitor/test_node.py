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

"""What the monitor hears, of a node that publishes as a bridge does."""

from collections.abc import Callable, Iterator
import time
from types import SimpleNamespace
from typing import Any

from abdf1_ros.cli.monitor import view
from abdf1_ros.cli.monitor.node import full_name, NodeWatch
from abdf1_ros.cli.monitor.view import NodeView, Style, TopicRow
from abdf1_ros.errors import FormatError
from abdf1_ros.ros.topics.messages import latched_qos, new_message, read_qos
from abdf1_ros.settings.mapping import Mapping
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import pytest
from rclpy.node import Node
from std_msgs.msg import Int16MultiArray, String, UInt16MultiArray
from support.cases import for_all
from support.mappings import make_mapping
from support.ros import Observer, PATIENCE

NAME = '/cell/line_a'
PROMISE = 30.0  # s; longer than any test


class Bridge:
    """A node that publishes what a test wants, under the names of a bridge."""

    def __init__(self, observer: Observer, namespace: str = '/cell') -> None:
        self.observer = observer
        self.node = Node('line_a', namespace=namespace, context=observer.context)
        self.active = self.node.create_publisher(
            UInt16MultiArray, '~/active_stations', latched_qos())
        self.diagnostics = self.node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.results = self.node.create_publisher(DiagnosticStatus, '~/write_results', 10)

    def read(self, row: Mapping, values: list[int] | str, topic: str = '') -> None:
        """Publish on a read topic, with the quality of service that the node's has."""
        message = new_message(row)
        message.data = values
        self.node.create_publisher(
            type(message), topic or f'~/read/{row.topic}', read_qos(row, PROMISE)
        ).publish(message)

    def status(self, name: str, message: str, level: bytes, **values: str) -> None:
        """Publish diagnostics of one status."""
        pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
        self.diagnostics.publish(DiagnosticArray(status=[DiagnosticStatus(
            name=name, message=message, level=level, values=pairs)]))


@pytest.fixture
def observer() -> Iterator[Observer]:
    with Observer() as observer:
        yield observer


@pytest.fixture
def bridge(observer: Observer) -> Iterator[Bridge]:
    bridge = Bridge(observer)
    yield bridge
    bridge.node.destroy_node()


@pytest.fixture
def watch() -> Iterator[NodeWatch]:
    with NodeWatch(NAME, []) as watch:
        yield watch


def until(watch: NodeWatch, condition: Callable[[NodeView], object]) -> NodeView:
    """Listen until the picture fulfils ``condition``; return it."""
    end = time.monotonic() + PATIENCE
    while not condition(watch.snapshot()):
        assert time.monotonic() < end, watch.snapshot()
        watch.spin_once(0.05)
    return watch.snapshot()


def heard(picture: NodeView) -> dict[str, TopicRow]:
    return {reading.topic: reading for reading in picture.readings if reading.values is not None}


def test_values_come_with_address_and_promise(bridge: Bridge, watch: NodeWatch) -> None:
    bridge.read(make_mapping('N7:0', length=2, tag='speeds'), [1200, -800])
    readings = heard(until(watch, lambda picture: len(heard(picture)) == 1))
    speeds = readings['speeds']
    assert (list(speeds.values or ()), speeds.address, speeds.promised) == (
        [1200, -800], 'N7:0', PROMISE)
    assert speeds.state(time.monotonic()) == ('fresh', Style.GOOD)
    bridge.read(make_mapping('N7:2', tag='found_later'), [1])
    readings = heard(until(watch, lambda picture: len(heard(picture)) == 2))
    assert readings['speeds'].curve is speeds.curve  # its subscription stays


def test_strings_and_topics_under_other_names_are_heard(bridge: Bridge, watch: NodeWatch) -> None:
    bridge.read(make_mapping('ST9:0', tag='name', kind='string'), 'Tank 4')
    bridge.read(make_mapping('N7:0', tag='door'), [1], '/elsewhere/door')
    bridge.read(make_mapping('B3:0/0', tag='bit'), [1])
    readings = heard(until(watch, lambda picture: {'name', '/elsewhere/door', 'bit'} <= {
        *heard(picture)}))  # topics of a test before may still be there
    assert readings['name'].values == 'Tank 4'
    assert list(readings['/elsewhere/door'].values or ()) == [1]
    assert [curve.draw(time.monotonic(), None)[-1] if (curve := readings[name].curve) else ''
            for name in ('name', '/elsewhere/door', 'bit')] == ['', '▁', '█']


def test_value_of_a_topic_that_promises_nothing_is_as_old_as_its_publishing(
        bridge: Bridge) -> None:
    published = time.monotonic()
    bridge.read(make_mapping('N7:0', tag='ready', publish='Change'), [1])
    bridge.read(make_mapping('N7:1', tag='speed'), [2])
    after = time.monotonic()
    bridge.observer.until(lambda: time.monotonic() - after > 0.3, 'it to become older')
    with NodeWatch(NAME, []) as watch:
        assert not any('parameter' in service.service_name for service in watch.node.services)
        picture = until(watch, lambda picture: len(heard(picture)) == 2)
    assert heard(picture)['ready'].promised is None
    assert heard(picture)['speed'].received > after + 0.3  # whatever the bridge's clock says
    assert published - 2.0 < heard(picture)['ready'].received <= after + 0.05


def test_complete_are_diagnostics_all_topics_and_every_promised_value(
        bridge: Bridge, watch: NodeWatch) -> None:
    bridge.node.create_publisher(
        Int16MultiArray, '~/read/later', read_qos(make_mapping('N7:0', publish='Change'), 1))
    bridge.read(make_mapping('N7:1', tag='speeds'), [7])
    until(watch, lambda picture: len(picture.readings) == 2 and heard(picture)
          and bridge.diagnostics.get_subscription_count())
    assert not watch.is_complete
    bridge.status('cell/line_a: mappings', 'OK: 3', DiagnosticStatus.OK, total='3')
    until(watch, lambda picture: picture.told)
    assert not watch.is_complete
    bridge.status('cell/line_a: mappings', 'OK: 2', DiagnosticStatus.OK, total='2')
    until(watch, lambda picture: picture.statuses[0].message == 'OK: 2')
    assert watch.is_complete
    promised = make_mapping('N7:2', tag='promised')
    bridge.node.create_publisher(Int16MultiArray, '~/read/promised', read_qos(promised, PROMISE))
    until(watch, lambda picture: len(picture.readings) == 3)
    assert not watch.is_complete


def test_only_the_statuses_of_the_node_count(bridge: Bridge, watch: NodeWatch) -> None:
    until(watch, lambda picture: picture.is_there and bridge.diagnostics.get_subscription_count())
    bridge.status('cell/lines: lines', 'ERROR', DiagnosticStatus.ERROR, **{NAME: 'no port'})
    until(watch, lambda picture: picture.stopped == 'does not run: no port')
    bridge.status('battery: level', 'OK', DiagnosticStatus.OK)
    watch.spin_once(0.2)
    assert watch.snapshot().stopped
    link = DiagnosticStatus(
        name='cell/line_a: link', message='WARN: slow', level=DiagnosticStatus.WARN,
        values=[KeyValue(key='settings', value='9600 baud')])
    others = [DiagnosticStatus(name=name)
              for name in ('line_a: link', 'cell/line_ab: link', 'other/line_a: link')]
    bridge.diagnostics.publish(DiagnosticArray(status=[*others, link]))
    bridge.diagnostics.publish(DiagnosticArray(status=others))
    picture = until(watch, lambda picture: picture.statuses)
    watch.spin_once(0.2)  # the others
    assert (picture.stopped, watch.snapshot().told) == ('', picture.told)
    found, = picture.statuses
    assert (found.section, found.message, found.style, found.values) == (
        'link', 'WARN: slow', Style.WARNING, {'settings': '9600 baud'})
    bridge.status('cell/line_a: station 1', 'ERROR: silent', DiagnosticStatus.ERROR)
    (station,) = until(watch, lambda picture: picture.statuses[0].section != 'link').statuses
    assert (station.section, station.style) == ('station 1', Style.BAD)


def test_spare_of_the_same_name_does_not_hide_the_owner_of_the_line(
        bridge: Bridge, watch: NodeWatch, monkeypatch: pytest.MonkeyPatch) -> None:
    until(watch, lambda picture: picture.is_there and bridge.diagnostics.get_subscription_count())
    bridge.status('cell/line_a: standby', 'OK: waits', DiagnosticStatus.OK)
    until(watch, lambda picture: [status.section for status in picture.statuses] == ['standby'])
    bridge.status('cell/line_a: standby', 'OK: still waits', DiagnosticStatus.OK)
    until(watch, lambda picture: picture.statuses[0].message == 'OK: still waits')
    monkeypatch.setattr(view, 'SILENCE', 0.0)  # but diagnostics of the owner come seldom
    seldom = {'diagnostics period': '10 s'}
    bridge.status('cell/line_a: link', 'OK: port open', DiagnosticStatus.OK, **seldom)
    bridge.status('cell/line_a: standby', 'OK: waits', DiagnosticStatus.OK)
    bridge.status('cell/line_ab: link', 'OK', DiagnosticStatus.OK)
    until(watch, lambda picture: [status.section for status in picture.statuses] == ['link'])
    watch.spin_once(0.2)
    assert [status.section for status in watch.snapshot().statuses] == ['link']
    bridge.status('cell/line_a: link', 'OK: silent for long', DiagnosticStatus.OK)
    until(watch, lambda picture: picture.statuses[0].message == 'OK: silent for long')
    bridge.status('cell/line_a: standby', 'OK: waits', DiagnosticStatus.OK)
    until(watch, lambda picture: [status.section for status in picture.statuses] == ['standby'])
    with Observer() as host:  # its node comes after that of the spare in the graph of ROS
        (owner := Bridge(host)).read(make_mapping('N7:0', tag='speed'), [7], '/elsewhere/speed')
        owner.read(make_mapping('N7:1', tag='own'), [8])
        until(watch, lambda picture: {'own', '/elsewhere/speed'} <= {*heard(picture)})
        owner.node.destroy_node()


def test_stations_are_taken_from_the_bits_of_the_active_node_table(
        bridge: Bridge, watch: NodeWatch) -> None:
    bridge.active.publish(UInt16MultiArray(data=[0b110, 1, *[0] * 13, 1 << 15]))
    assert until(watch, lambda picture: picture.active).active == [1, 2, 16, 255]


def test_results_of_writes_are_kept_newest_first(bridge: Bridge, watch: NodeWatch) -> None:
    until(watch, lambda picture: bridge.results.get_subscription_count())
    for number in range(12):
        bridge.results.publish(DiagnosticStatus(
            name='recipe', message=f'number {number}', level=DiagnosticStatus.ERROR))
    results = until(watch, lambda picture: picture.results
                    and picture.results[0].message == 'number 11').results
    assert [result.message for result in results] == [f'number {n}' for n in range(11, 3, -1)]
    assert results[0].style is Style.BAD and results[0].received > time.monotonic() - PATIENCE


def test_node_that_ends_is_gone_and_may_come_back_with_another_map(
        bridge: Bridge, watch: NodeWatch) -> None:
    for number in (2, 10, 11):
        bridge.read(make_mapping('N7:0', tag=f'row{number}'), [number])
    until(watch, lambda picture: len(heard(picture)) == 3)
    bridge.node.destroy_node()
    picture = until(watch, lambda picture: not picture.is_there)
    assert [*heard(picture)] == ['row2', 'row10', 'row11']
    again = Bridge(bridge.observer)
    again.read(make_mapping('ST9:0', tag='row2', kind='string'), 'text')
    again.read(make_mapping('N7:1', tag='row10', publish='Change'), [4])
    picture = until(watch, lambda picture: [
        [*(reading.values or ())] for reading in picture.readings] == [[*'text'], [4]])
    assert picture.is_there
    assert {reading.topic: reading.promised for reading in picture.readings} == {
        'row2': PROMISE, 'row10': None}
    again.node.destroy_node()


def test_node_of_the_same_name_in_another_namespace_is_another(
        bridge: Bridge, watch: NodeWatch) -> None:
    other = Bridge(bridge.observer, '/other')
    until(watch, lambda picture: watch.bridges() == [NAME, '/other/line_a'])
    other.node.destroy_node()


def test_nothing_is_asked_of_the_publishers(bridge: Bridge, watch: NodeWatch) -> None:
    bridge.node.create_publisher(String, '~/read/label', 1)  # volatile: offers the least
    until(watch, lambda picture: picture.readings)
    published = watch.published('/abdf1_monitor')  # its own graph, which lacks nothing
    assert published is not None
    assert not [name for name, _ in published if name != '/parameter_events']


@for_all(('text', 'name'), [
    ('abdf1', '/abdf1'), ('/abdf1', '/abdf1'), ('cell/line_a', NAME), ('/cell/line_a/', NAME)])
def test_names_may_lack_the_slash_in_front(text: str, name: str) -> None:
    assert full_name(text) == name


@for_all('text', ['', '/', 'a b', '7up', 'a//b', '~/x', 'line-1'])
def test_bad_names_are_refused_with_a_good_one(text: str) -> None:
    with pytest.raises(FormatError, match='it should be like /abdf1 or /cell/abdf1'):
        full_name(text)


def test_bridges_are_named_in_the_order_of_their_numbers() -> None:
    topics = [(f'/line{number}/active_stations', ['x']) for number in (10, 3, 2, 1)]
    watch: Any = SimpleNamespace(node=SimpleNamespace(
        get_topic_names_and_types=lambda: topics, count_publishers=lambda topic: '3' not in topic))
    assert NodeWatch.bridges(watch) == ['/line1', '/line2', '/line10']
