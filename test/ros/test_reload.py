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

"""A running bridge whose files are read again, and whose port is given away."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
import os
from pathlib import Path
import re
import threading
from typing import Any

from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.opening import open_port
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.ros.bridge.guests import GuestPlaces
from abdf1_ros.ros.bridge.port_owners import held_line
from abdf1_ros.ros.bridge.reload import changes, refuse_harm, rows_left_behind
from abdf1_ros.ros.bridge.session import BridgeSession
from abdf1_ros.ros.diagnostics.line import LineView
from abdf1_ros.ros.diagnostics.log import MOST_ENTRIES
from abdf1_ros.ros.parameters.declared import Configuration, Parameters
from abdf1_ros.ros.parameters.file_watch import FileWatch
from abdf1_ros.ros.parameters.shown import ShownFiles
from abdf1_ros.settings.heartbeats import Fallback
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.rows import Rows
import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from std_msgs.msg import Float32MultiArray, Int16MultiArray, String, UInt16MultiArray
from std_srvs.srv import SetBool, Trigger
from support import ros
from support.commands import Output
from support.mappings import make_mapping
from support.ptys import PATIENCE

DATA = 'Station,PLC_Type,Address,Length,Values\n1,PLC5,N7:0,16,7 8\n1,PLC5,F8:0,4,1.5\n'
HEADER = 'Tag,Command,Address,Station,PLC_Type,Length'
SPEED = 'speed,Read,N7:0,1,PLC5,2'
LEVEL = 'level,ReadWrite,F8:0,1,PLC5,1'
RECIPE = 'recipe,Write,N7:4,1,PLC5,2'


class Bench(ros.BridgeCell):
    """A bridge on simulated PLCs, whose files can be written anew."""

    def write_net(self, timeout: int, baud: int = 115200) -> None:
        ros.write_csv(self.net, 'Baud,Timeout', [f'{baud},{timeout}'])

    def write_map(self, *rows: str) -> None:
        ros.write_csv(self.map, HEADER, rows)

    def reload(self) -> tuple[bool, str]:
        """Ask for it; return what the service says."""
        response = self.call(Trigger, 'reload', Trigger.Request())
        return response.success, response.message

    def polling(self, wanted: bool) -> tuple[bool, str]:
        """Ask for it; return what the service says."""
        response = self.call(SetBool, 'polling', SetBool.Request(data=wanted))
        return response.success, response.message

    def parameter(self, name: str) -> Any:
        """Return the value of a parameter, None where there is none."""
        values = self.call(
            GetParameters, 'get_parameters', GetParameters.Request(names=[name])).values
        return parameter_value_to_python(values[0]) if values else None


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setattr('abdf1_ros.ros.parameters.file_watch.PERIOD', 0.3)
    with Bench(tmp_path, DATA, '\n'.join((HEADER, SPEED, RECIPE)),
               'Baud,Timeout\n115200,100', 'rs485:=true', 'low_latency:=false') as bench:
        yield bench


def test_rows_come_and_go_and_others_are_not_disturbed(bench: Bench, capfd: Output) -> None:
    speeds = bench.ros.listen(Int16MultiArray, '/abdf1/read/speed', ros.EVERYTHING)
    speeds.values([7, 8])
    publisher, = (each for each in bench.node.publishers if each.topic_name == speeds.topic)
    bench.write_map(SPEED, LEVEL)
    bench.node.session.driver.stations[1].has_gateway = True  # by an STS
    assert bench.reload() == (True, (
        f'{bench.node.session.configuration}; new: level; gone: recipe'))
    assert bench.node.session.driver.stations[1].has_gateway
    assert ros.values_in(bench.ros.listen(Float32MultiArray, '/abdf1/read/level').first()) == [1.5]
    assert ros.values_in(speeds.next()) == [7, 8]
    assert publisher in bench.node.publishers
    for port, station in ((bench.plcs.port, 77), (f'/.{bench.plcs.port}', 77)):
        publisher, = (each for each in bench.node.publishers if each.topic_name == speeds.topic)
        now = bench.node.session.configuration
        bench.node.hand_over(replace(
            now, port=str(port), network=replace(now.network, station=station)))
        assert publisher not in bench.node.publishers  # perhaps there are other PLCs, or words
    node = bench.ros.node
    bench.ros.until(lambda: node.count_subscribers('/abdf1/write/level'), 'a topic')
    bench.ros.until(lambda: not node.count_subscribers('/abdf1/write/recipe'), 'its end')
    assert ros.values_in(bench.ros.listen(Float32MultiArray, '/abdf1/read/level').first()) == [1.5]
    assert f'/.{bench.plcs.port}: open' in capfd.readouterr().err  # the new session is told
    bench.write_map(LEVEL)
    assert bench.reload()[0]
    bench.ros.until(lambda: not node.count_publishers('/abdf1/read/speed'), 'the end of a topic')


def test_service_in_a_loop_does_not_fill_the_log(bench: Bench, capfd: Output) -> None:
    """The log of the node is limited over all reloads, also of its line and of a faulty file."""
    bench.ros.listen(Int16MultiArray, '/abdf1/read/speed').first()
    capfd.readouterr()
    for _ in range(15):
        assert bench.reload()[0]
        assert bench.polling(False)[0] and bench.polling(True)[0]
    bench.write_map('speed,Read,N7:0,1,XXX')
    for _ in range(15):
        assert not bench.reload()[0]
    told = [line.partition(': ')[2] for line in capfd.readouterr().err.splitlines()]
    subjects = Counter(line.replace(str(bench.plcs.port), 'PORT').partition(' (')[0]
                       for line in told)
    assert max(subjects.values()) <= MOST_ENTRIES, subjects
    assert len(told) < 60


def test_type_that_a_row_had_before_is_not_told_of_another_node(
        bench: Bench, capfd: Output) -> None:
    said = ['']

    def is_told(kind: str) -> bool:
        said[0] += capfd.readouterr().err
        return f'/abdf1/read/speed is {kind}' in said[0]

    # Each is a participant of its own, as one has no topic with two types.
    with ros.Observer() as reader, ros.Observer() as another:
        reader.node.create_subscription(Int16MultiArray, '/abdf1/read/speed', print, 10)
        bench.write_map(SPEED.replace('N7:0', 'F8:0'))
        assert bench.reload()[0]
        bench.ros.until(lambda: is_told(
            'std_msgs/msg/Float32MultiArray; another node uses it as std_msgs/msg/Int16MultiArray'
        ), 'the reader')
        bench.write_map(SPEED)
        assert bench.reload()[0]
        another.node.create_subscription(String, '/abdf1/read/speed', print, 10)
        bench.ros.until(lambda: is_told(
            'std_msgs/msg/Int16MultiArray; another node uses it as std_msgs/msg/String'
        ), 'a later query')
    assert 'another node uses it as std_msgs/msg/Float32MultiArray' not in said[0]


def test_writes_go_to_the_new_map(bench: Bench) -> None:
    results = bench.results
    publisher = bench.ros.publisher(Int16MultiArray, '/abdf1/write/recipe')
    publisher.publish(Int16MultiArray(data=[1, 2]))
    assert results.next().message == 'written'
    bench.write_map(SPEED, 'recipe,Write,N7:8,1,PLC5,2')
    assert bench.reload()[0]
    bench.ros.until(lambda: bench.node.session.driver.is_online, 'the port')
    publisher.publish(Int16MultiArray(data=[3, 4]))
    result = results.next()
    assert (result.message, ros.details(result)['address']) == ('written', 'N7:8')
    writes = ros.until_status(bench.diagnostics, 'writes', ros.OK,
                              lambda status: ros.details(status)['confirmed'] == '1')
    assert writes.message == 'OK: 1 of 1 writes confirmed'


def test_words_that_plcs_read_stay(bench: Bench) -> None:
    bench.write_map('ours,Serve,N7:50,5,PLC5,1')
    for earlier in bytes(2), b'\7\0':
        assert bench.reload()[0]
        served, mapping = bench.node.session.driver.served, bench.node.session.driver.mappings[0]
        assert served.words_of(mapping) == earlier
        served.store(mapping, [7])


def test_row_of_another_message_type_or_address_has_a_new_topic(bench: Bench) -> None:
    for address, kind, values in (
            ('F8:0', Float32MultiArray, [1.5]), ('N7:1', Int16MultiArray, [8]),
            ('N7:0', Int16MultiArray, [7])):
        bench.write_map(f'speed,ReadWrite,{address},1,PLC5,1')
        assert bench.reload()[0]
        echo = bench.ros.listen(kind, '/abdf1/read/speed')
        assert echo.values(values)
        bench.ros.forget(echo)


def test_faulty_files_change_nothing(bench: Bench, capfd: Output) -> None:
    bench.write_map(LEVEL, *30 * ['speed,Read,N7:0,1,PLC5,none'])  # one row is enough
    bench.write_net(100, 9601)
    driver = bench.node.session.driver
    success, message = bench.reload()
    assert not success
    assert message.startswith(f'goes on as before: {bench.net}:2:1 (Baud): Baud = "9601" should')
    assert f'; {bench.map}:3:6 (Length): ' in message
    assert message.count(f'; {bench.map}:') == 19
    assert bench.node.session.driver is driver
    assert bench.parameter('net.baud') == 115200
    assert bench.parameter('map.recipe.address') == 'N7:4'
    assert bench.parameter('map.level.address') is None
    speeds = bench.ros.listen(Int16MultiArray, '/abdf1/read/speed', ros.EVERYTHING)
    assert ros.values_in(speeds.first()) == [7, 8]
    assert f'{bench.net}:2:1 (Baud): Baud = "9601"' in capfd.readouterr().err
    bench.write_map(LEVEL)
    bench.write_net(100)
    assert bench.reload()[0]  # the old faults are forgotten


def test_row_whose_topic_has_another_topics_name_changes_nothing(
        bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    session, resolve = bench.node.session, bench.node.resolve_topic_name
    remaps = {'~/write/level': '/abdf1/read/speed'}
    monkeypatch.setattr(
        bench.node, 'resolve_topic_name', lambda name: remaps.get(name) or resolve(name))
    bench.write_map(SPEED, RECIPE, LEVEL)
    assert bench.reload() == (False, (
        'goes on as before: remaps: ~/read/speed, ~/write/level have one name, /abdf1/read/speed; '
        'give each topic a name of its own'))
    assert bench.node.session is session


def test_files_that_would_stop_the_line_change_nothing(bench: Bench) -> None:
    session = bench.node.session
    bench.write_map()
    assert bench.reload() == (False, (
        f'goes on as before: {bench.map}: it has no row, so all topics would end; only a line '
        'with Share may have no row'))
    assert bench.node.session is session
    with pytest.raises(ConfigurationError, match='is the port of /abdf1'):
        bench.port_owners.hold('/other', *session.configuration.held)
    bench.end()
    bench.port_owners.hold('/other', *session.configuration.held)


def test_place_that_is_no_longer_shared_is_free_for_another_line(
        bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    places = [f'pty:{tmp_path}/{name}' for name in ('first', 'second')]
    for place in places:
        ros.write_csv(bench.net, 'Baud,Timeout,Share', [f'115200,100,{place}'])
        assert bench.reload()[0]
        bench.ros.until(Path(place.removeprefix('pty:')).is_symlink, 'the place')
    assert not (tmp_path / 'first').is_symlink()
    assert [thread.name for thread in threading.enumerate()].count('df1 link') == 3
    bench.port_owners.hold('/other', places[0])
    with pytest.raises(ConfigurationError):
        bench.port_owners.hold('/other', places[1])
    monkeypatch.setattr('abdf1_ros.ros.bridge.node.refuse_harm', lambda *files:
                        bench.port_owners.hold('/other', places[1]))  # it still has both
    ros.write_csv(bench.net, 'Baud,Timeout,Share', [f'115200,100,{places[0]}new'])
    assert bench.reload()[1] == f'goes on as before: port: {places[1]} is the place of /abdf1'
    bench.port_owners.hold('/other', f'{places[0]}new')


def test_link_that_does_not_take_the_files_is_the_end(
        bench: Bench, monkeypatch: pytest.MonkeyPatch, capfd: Output) -> None:
    monkeypatch.setattr(LinkThread, 'exchange', lambda *arguments, **others: False)
    bench.write_map(SPEED, RECIPE, LEVEL)
    assert bench.reload() == (False, 'ends: the link does not accept the new files')
    assert bench.node.has_failed
    monkeypatch.setattr(LinkThread, 'release', lambda link: False)
    assert not bench.polling(False)[0]
    assert '[abdf1]: ends: the link does not accept the new files' in capfd.readouterr().err


@pytest.mark.parametrize('step', ['tell_plcs', 'BridgeSession', 'LinkThread.exchange'])
def test_signal_that_comes_during_a_reload_is_no_failure(
        bench: Bench, step: str, monkeypatch: pytest.MonkeyPatch) -> None:
    place = bench.map.with_name('place')
    ros.write_csv(bench.net, 'Baud,Timeout,Share', [f'115200,100,pty:{place}'])
    assert bench.reload()[0]
    monkeypatch.setattr(f'abdf1_ros.ros.bridge.node.{step}', lambda *made, **_: (
        bench.node.begin_end(), step == 'BridgeSession' and BridgeSession(*made))[1])
    is_done, text = bench.reload()
    assert (is_done, text != 'this node ends') == (step == 'BridgeSession',) * 2
    assert bench.node.session.driver.kernel.end.is_asked
    monkeypatch.undo()
    bench.end()
    assert not (place.is_symlink() or bench.node.has_failed)


def test_files_that_cannot_be_taken_leave_topics_and_services_to_the_old_driver(
        bench: Bench) -> None:
    results, node = bench.results, bench.node
    publisher = bench.ros.publisher(Int16MultiArray, '/abdf1/write/recipe')
    node.create_publisher(String, '~/read/level', 1)  # DDS allows one type for a topic
    publishers = [*node.publishers]
    bench.write_map(SPEED, 'more,Read,N7:8,1,PLC5,3', LEVEL)
    ros.write_csv(bench.net, 'Baud,Timeout,Share', ['115200,100,tcp:4501'])
    assert bench.polling(False)[0]
    assert bench.reload()[1].startswith('refused: RCLError')
    assert ([*node.publishers], node.link.is_released) == (publishers, True)
    bench.port_owners.hold('/other', 'tcp:4501')
    bench.polling(True)
    assert bench.reload()[1].startswith('goes on as before: port: tcp:4501 is the place of /other')
    bench.port_owners.hold('/other')
    assert not bench.reload()[0]
    bench.ros.until(lambda: node.session.driver.is_online, 'the port')
    assert bench.call(Trigger, 'read_now/speed', Trigger.Request()).success
    bench.ros.until(publisher.get_subscription_count, 'its topic')
    publisher.publish(Int16MultiArray(data=[5, 6]))
    assert results.next().message == 'written'


# What a reload leaves: what is found and told then is what a fresh start would find and tell


CROWD = '~/write/recipe has more than one publisher'


def test_second_publisher_is_found_again(bench: Bench, capfd: Output) -> None:
    rows = [f'{RECIPE},,0 0,60000', 'south,Write,N7:8,1,PLC5,2,recipe,0 0,60000']
    ros.write_csv(bench.map, f'{HEADER},Topic,Fallback,Fallback_After', rows)
    publishers = []
    for _ in range(2):
        assert bench.reload()[0]
        bench.diagnostics.clear()
        while len(publishers) < 2:
            publishers.append(bench.ros.publisher(Int16MultiArray, '/abdf1/write/recipe'))
        ros.until_status(bench.diagnostics, 'interlocks', ros.WARN,
                         lambda status: 'recipe: more than one publisher' in status.message)
    assert capfd.readouterr().err.count(CROWD) == 2


def test_station_that_took_no_commands_does_not_answer_by_new_files(
        bench: Bench, monkeypatch: pytest.MonkeyPatch, capfd: Output) -> None:
    asked: list[LineView] = []

    def deaf_stations(line: LineView, now: float) -> list[int]:
        asked.append(line)
        return [1] if line is asked[0] else []  # not known yet

    monkeypatch.setattr(LineView, 'deaf_stations', deaf_stations)
    said = ''
    while 'station 1 answers polls, but no command' not in said:
        bench.diagnostics.next()
        said += capfd.readouterr().err
    assert bench.reload()[0]
    for _ in range(2):
        bench.diagnostics.next()
    assert 'answers commands' not in capfd.readouterr().err


def test_line_is_handed_over_in_order(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[str] = []

    def record(owner: Any, name: str, text: str) -> None:
        original = getattr(owner, name)

        def recorded(*arguments: Any, **named: Any) -> Any:
            calls.append(text)
            return original(*arguments, **named)
        monkeypatch.setattr(owner, name, recorded)

    for owner, name, text in (
            (BridgeSession, 'begin_end', 'tell the PLCs'),
            (BridgeSession, 'tell_unconfirmed', 'wait for them'),
            (BridgeSession, '__init__', 'make the new'), (LineView, 'attach', 'know the port'),
            (LinkThread, 'exchange', 'exchange'),
            (BridgeSession, 'end', 'end the old'), (BridgeSession, 'begin', 'begin the new'),
            (GuestPlaces, 'start', 'guests'), (ShownFiles, 'show', 'parameters')):
        record(owner, name, text)
    assert bench.reload()[0]
    assert calls == ['tell the PLCs', 'wait for them', 'make the new', 'know the port', 'exchange',
                     'end the old', 'begin the new', 'guests', 'parameters']


def test_other_node_of_our_name_stays_known(bench: Bench) -> None:
    other = Node('abdf1', context=bench.ros.context, use_global_arguments=False,
                 start_parameter_services=False)
    text = 'another node is called /abdf1 too'
    ros.until_status(bench.diagnostics, 'link', ros.WARN, lambda status: text in status.message)
    assert bench.reload()[0]
    for _ in range(2):
        bench.diagnostics.next()
        assert text in ros.find_status(bench.diagnostics[-1], 'link').message
    other.destroy_node()


def test_parameters_tell_what_is_in_the_files_now(bench: Bench) -> None:
    opener, capture = bench.node.surroundings.opener, Path(f'{bench.net}.cap')
    opener.trace(str(capture), 1e6, {}, print)
    ros.write_csv(bench.net, 'Baud,Timeout,Error_Code', ['115200,250,BCC'])
    bench.write_map(LEVEL)
    assert bench.reload()[0]
    opener.close()
    assert 'BCC' in capture.read_text()
    assert bench.parameter('net.timeout') == 250
    assert bench.parameter('map.level.address') == 'F8:0'
    assert bench.parameter('map.speed.address') is None
    assert bench.node.session.driver.network.timeout == 250


def test_other_speed_opens_the_port_anew(bench: Bench, capfd: Output) -> None:
    bench.write_net(100, 19200)
    assert bench.reload()[0]
    speeds = bench.ros.listen(Int16MultiArray, '/abdf1/read/speed', ros.EVERYTHING)
    assert ros.values_in(speeds.first()) == [7, 8]
    settings = bench.node.surroundings.opener.settings
    assert (settings.baud, settings.rs485, settings.low_latency) == (19200, True, False)
    assert re.search(rf'\[WARN\] .*: {bench.plcs.port}: rs485 has no effect: the port has no '
                     'RS-485 mode: ', capfd.readouterr().err)


def test_file_that_has_changed_is_told_once(bench: Bench, capfd: Output) -> None:
    assert ros.details(ros.until_status(bench.diagnostics, 'link', ros.OK))['files'] == 'as read'
    bench.write_net(250)
    bench.write_map(SPEED)
    text = 'net.csv, map.csv changed since read; call ~/reload to read again'
    ros.until_status(
        bench.diagnostics, 'link', ros.OK, lambda status: ros.details(status)['files'] == text)
    bench.diagnostics.clear()
    for _ in range(2):  # it has been looked at several times more
        bench.diagnostics.next()
    assert capfd.readouterr().err.count(text) == 1
    assert bench.reload()[0]
    ros.until_status(bench.diagnostics, 'link', ros.OK,
                     lambda status: ros.details(status)['files'] == 'as read')


def test_whoever_waits_for_link_counters_is_told_of_the_new_files(bench: Bench) -> None:
    bench.plcs.say('silent 1')
    client = bench.ros.node.create_client(Trigger, '/abdf1/read_link_counters')
    bench.ros.until(client.service_is_ready, 'the service')
    future = client.call_async(Trigger.Request())
    bench.ros.until(lambda: bench.node.session.driver.checks.counters_wanted, 'the question')
    active = bench.ros.listen(UInt16MultiArray, '/abdf1/active_stations')
    bench.write_map('speed,Read,N7:0,2,PLC5,2')
    assert bench.reload()[0]
    bench.ros.until(future.done, 'an answer')
    assert active.values([1 << 2] + [0] * 15)
    assert future.result() == Trigger.Response(
        success=False, message='station 1: port lost: the files have been read again')


def test_files_are_read_again_while_the_port_is_left_to_others(bench: Bench) -> None:
    assert bench.polling(False)[0]
    bench.write_map(SPEED, LEVEL)
    bench.write_net(100, 19200)
    assert bench.reload()[0]
    open_port(PortSettings(bench.plcs.port)).close()
    assert bench.polling(True)[0]
    assert ros.values_in(bench.ros.listen(Float32MultiArray, '/abdf1/read/level').first()) == [1.5]


def test_port_is_left_to_others_and_taken_again(bench: Bench, capfd: Output) -> None:
    text = 'polling is off, so other programs may use the port'
    ros.until_status(bench.diagnostics, 'link', ros.OK)
    assert bench.polling(False) == (True, f'{bench.plcs.port}: {text}')
    open_port(PortSettings(bench.plcs.port)).close()  # which is exclusive
    assert ros.until_status(bench.diagnostics, 'link', ros.WARN).message == f'WARN: {text}'
    line, = (line for line in capfd.readouterr().err.splitlines() if text in line)
    assert line.startswith('[INFO] ')
    active = bench.ros.listen(UInt16MultiArray, '/abdf1/active_stations')
    assert ros.values_in(active.first()) == 16 * [0]
    counters = bench.call(Trigger, 'read_link_counters', Trigger.Request())
    assert (counters.success, counters.message) == (
        False, 'no station to ask: the port is not open')
    results = bench.results
    publisher = bench.ros.publisher(Int16MultiArray, '/abdf1/write/recipe')
    publisher.publish(Int16MultiArray(data=[1, 2]))
    assert results.next().message == 'not written: refused: the port is not open'
    assert bench.polling(True) == (True, f'{bench.plcs.port} is being opened')
    speeds = bench.ros.listen(Int16MultiArray, '/abdf1/read/speed', ros.EVERYTHING)
    assert ros.values_in(speeds.first()) == [7, 8]
    ros.until_status(bench.diagnostics, 'link', ros.OK)


# Files


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / 'map.csv'
    path.write_text('a')
    os.utime(path, ns=(1, 1))
    return path


def _replaced(path: Path) -> None:
    other = path.with_suffix('.new')
    other.write_text('b')
    os.utime(other, ns=(1, 1))
    other.replace(path)


@pytest.mark.parametrize('change', [partial(os.utime, ns=(2, 2)), _replaced, Path.unlink])
def test_change_is_seen(file: Path, change: Callable[[Path], None]) -> None:
    watch = FileWatch([str(file), '/nowhere'])
    for now, found in (0.0, []), (1.9, []), *((10.0 * n, ['map.csv']) for n in (1, 2)):
        watch.changed(now)
        watch.looking.join(PATIENCE)
        assert watch.changed(now) == found
        if not now:
            change(file)


def test_mount_that_hangs_holds_up_nothing_else(
        file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    watch, answers = FileWatch([str(file)]), threading.Event()
    monkeypatch.setattr(Path, 'stat', lambda path: answers.wait(PATIENCE) and os.stat(path))
    assert len({(*watch.changed(now), watch.looking) for now in (0.0, 10.0)}) == 1
    answers.set()
    watch.looking.join(PATIENCE)


ROW = make_mapping(tag='speed')


def configured(*rows: Any, port: str = '/dev/ttyS0', **network: Any) -> Configuration:
    return Configuration(
        Parameters(map_file='map.csv'), Network(**network), port, Rows(rows), [], {})


def heard(first: str, second: str) -> Configuration:
    return configured(ROW, port=first, mode='Listen', listen_port=second)


def refusal(before: Configuration, after: Configuration, *, is_open: bool = True,
            reason: str = '') -> tuple[str, list[str]]:
    """Return the text of a refusal, empty where there is none, and which ports were tried."""
    tried = []

    def judge(settings: PortSettings) -> str:
        assert not settings.second, 'each port is tried alone'
        tried.append(settings.name)
        return reason

    try:
        refuse_harm(before, after, is_open, PortSettings.of(after.network, after.port), judge)
    except ConfigurationError as error:
        return str(error), tried
    return '', tried


def test_map_without_rows_would_end_all_topics() -> None:
    text = ('map.csv: it has no row, so all topics would end; only a line with Share may have '
            'no row')
    assert refusal(configured(ROW), configured()) == (text, [])
    assert refusal(configured(), configured()) == ('', [])
    assert refusal(configured(ROW), configured(share='pty:/tmp/hmi')) == ('', [])


def test_line_holds_its_ports_and_the_places_of_its_guests() -> None:
    assert configured(share='pty:/a tcp:5000').held == ('/dev/ttyS0', 'pty:/a', 'tcp:5000')
    place, = configured(share='eip:5000?station=1').held[1:]
    assert held_line(place) == held_line('tcp:127.0.0.1:5000')
    assert configured(listen_port='2').held == ('/dev/ttyS0',), 'it has no effect'
    assert heard('/dev/ttyS0', '2').held == ('/dev/ttyS0', '/dev/ttyS1')


def test_only_another_device_is_tried_and_only_by_a_line_that_runs() -> None:
    here, there = configured(ROW), configured(ROW, port='/dev/ttyS77')
    reason = 'No such file or directory'
    assert refusal(here, there, reason=reason) == (
        f'port: /dev/ttyS77 cannot be opened: {reason}', ['/dev/ttyS77'])
    assert refusal(here, there) == ('', ['/dev/ttyS77'])
    assert refusal(here, here, reason=reason) == ('', [])
    assert refusal(here, there, is_open=False, reason=reason) == ('', [])
    pair = heard('/dev/ttyS0', '/dev/ttyS1')
    assert refusal(pair, heard('/dev/ttyS0', '/dev/ttyS77'), reason=reason) == (
        f'port: /dev/ttyS77 cannot be opened: {reason}', ['/dev/ttyS77'])
    assert refusal(pair, heard('/dev/ttyS77', '/dev/ttyS1')) == ('', ['/dev/ttyS77'])
    assert refusal(pair, heard('/dev/ttyS1', '/dev/ttyS0'), reason=reason) == ('', [])
    shared = configured(ROW, share='/dev/ttyS77?baud=9600')
    assert refusal(shared, there, reason=reason) == ('', []), 'a guest has it'


def test_other_name_of_the_same_device_is_not_tried(tmp_path: Path) -> None:
    link = tmp_path / 'plc'
    link.symlink_to('/dev/null')
    assert refusal(configured(ROW, port='/dev/null'), configured(ROW, port=str(link))) == ('', [])


def test_rule_5_rows_are_left_behind_whose_words_have_no_or_another_safe_value() -> None:
    speed, other = (make_mapping(f'N7:{number}', 'Write', tag=tag, fallback=Fallback((7,), 500))
                    for number, tag in enumerate(('speed', 'other')))
    beat = make_mapping('N10:0', 'Heartbeat', tag='beat', period=500)
    before = configured(speed, other, beat, ROW)

    def left(*after: Mapping) -> list[str]:
        return sorted(row.tag for row in rows_left_behind(before, configured(*after)))

    longer = replace(speed, tag='renamed', topic='renamed', fallback=Fallback((7,), 900))
    assert left(longer, other, replace(beat, period=900)) == []
    assert left(other) == ['beat', 'speed']
    for changed in (replace(speed, fallback=Fallback((8,), 500)), replace(speed, fallback=None),
                    make_mapping('N7:5', 'Write', fallback=Fallback((7,), 500)),
                    replace(speed, station=2)):
        assert left(changed, other, beat) == ['speed']


def test_changes_are_named() -> None:
    before = configured(ROW, make_mapping('N7:9', tag='gone'))
    assert changes(before, before) == 'nothing has changed'
    after = configured(make_mapping('N7:1', tag='speed'), make_mapping('N7:2', tag='new'),
                       port='/dev/ttyS1', baud=19200, com_port='2', share='pty:/tmp/hmi',
                       timeout=0)
    assert changes(before, after) == (
        'port /dev/ttyS1 (was /dev/ttyS0); Baud 19200 (was 9600); Timeout 0 (was '
        '1000); Share pty:/tmp/hmi (was empty); new: new; gone: gone; changed: speed')
    moved = configured(replace(ROW, item=7))
    assert changes(configured(ROW), moved) == 'nothing has changed', 'its line in the file'
