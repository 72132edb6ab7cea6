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

"""What the diagnostics say, status by status, from the state of a real driver."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
import re
import time
from types import SimpleNamespace
from typing import Any

from abdf1_ros.cli.monitor import plant, view
from abdf1_ros.df1.echo import COMES_BACK
from abdf1_ros.df1.frames import message_frame
from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.slave_link import SlaveLink
from abdf1_ros.df1.stations import Station
from abdf1_ros.driver.checks import StationHealth
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.guests import Guest
from abdf1_ros.driver.kernel.fallback import FallbackCause, FallbackRow
from abdf1_ros.driver.kernel.flights import Flight
from abdf1_ros.driver.kernel.heartbeat import HeartbeatRow
from abdf1_ros.driver.kernel.plc import OwnRow
from abdf1_ros.driver.overheard import Carried
from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome, Write, WriteResult
from abdf1_ros.errors import CommandTimeout
from abdf1_ros.messages import Event, Message
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity, Mode
from abdf1_ros.pccc.values import Values
from abdf1_ros.plan.bounds import Times
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.port_thread import PortState, RELEASED
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.trace import PortOpener
from abdf1_ros.ros.diagnostics.dds import LOST
from abdf1_ros.ros.diagnostics.events import LineEvents
from abdf1_ros.ros.diagnostics.line import LineView, takes_in_silence
from abdf1_ros.ros.diagnostics.link import LinkStatus
from abdf1_ros.ros.diagnostics.load import FullLine
from abdf1_ros.ros.diagnostics.log import NodeLog
from abdf1_ros.ros.diagnostics.status import message_of, Seen
from abdf1_ros.ros.diagnostics.statuses import Diagnostics
from abdf1_ros.ros.diagnostics.watches import watches_of
from abdf1_ros.ros.diagnostics.writes import WriteLog
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.mapping import Command, Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.simulator.simulated_plc import InjectedFaults
from diagnostic_msgs.msg import DiagnosticStatus
import pytest
from rclpy.logging import get_logger
from support.driver_bench import DriverBench, simulated_plc
from support.mappings import make_mapping
from support.ros import details, ERROR, OK, WARN, write_csv

PORT = '/dev/ttyUSB0'
HEADER = 'Tag,Command,Address,Station,PLC_Type,Period'
ROWS = ('speed,Read,N7:0,1,PLC5,1000', 'level,ReadWrite,F8:4,2,SLC,1000',
        'lamp,Write,B3:0/1,2,SLC,')

# A moment after the start, when the rates begin to be counted.
NOW = float(int(time.monotonic()) + 1000)


class Bench:
    """Diagnostics of a driver that no port moves; tests set its state."""

    def __init__(self, folder: Path, rows: tuple[str, ...] = ROWS, mode: str = 'Master',
                 header: str = HEADER) -> None:
        mappings, left_out = load_mappings(str(write_csv(folder / 'map.csv', header, rows)))
        self.folder = folder
        self.seen = Seen()
        self.now = NOW
        self.results: list[DiagnosticStatus] = []
        self.tables = 0  # how often the Active Node Table has changed
        self.events = LineEvents(
            NodeLog(get_logger('line_a'), lambda: self.now), PORT, mappings.asked,
            scans=mode != 'Peer', seen=self.seen, read=lambda mapping, values: None, results=self,
            table_changed=self._count, clock=lambda: self.now)
        self.driver = Driver(Network(mode=mode), mappings, DriverSettings(), self.events)
        self.link = LinkThread(self.driver.machine, lambda: pytest.fail('no port here'))
        self.diagnostics = Diagnostics('line_a', self.driver, PORT, self.events, left_out)
        self.opener = PortOpener(PortSettings.of(Network(), PORT))
        self.diagnostics.line.attach(self.link, self.opener)
        self.set_port(True, 'open')

    def _count(self) -> None:
        self.tables += 1

    def publish(self, result: DiagnosticStatus) -> None:
        """Take the result of a write, as its publisher does."""
        self.results.append(result)

    def happened(self, message: Message, args: tuple[Any, ...], station: int,
                 now: float = NOW) -> None:
        """Have the driver tell of a numbered event."""
        self.now = now
        self.events.happened(Event(message, args, station))

    def written(self, result: WriteResult, now: float = NOW) -> None:
        """Have the driver tell what came of a write."""
        self.now = now
        self.events.written(result)

    def set_port(self, is_open: bool, text: str) -> None:
        self.link.state = PortState(is_open, text)

    def point(self, tag: str) -> ReadPoint:
        return next(point for mapping, point in self.driver.points.items() if mapping.tag == tag)

    def mapping(self, tag: str) -> Mapping:
        return next(mapping for mapping in self.driver.mappings if mapping.tag == tag)

    def status(self, name: str, now: float = NOW) -> DiagnosticStatus:
        statuses = self.diagnostics.statuses(now)
        assert [status.level for status in statuses] == self.diagnostics.levels(now)
        return next(status for status in statuses if status.name == f'line_a: {name}')

    def says(self, name: str, now: float = NOW) -> tuple[bytes, str]:
        status = self.status(name, now)
        return status.level, status.message

    def details(self, name: str, now: float = NOW) -> dict[str, str]:
        return details(self.status(name, now))

    def close(self) -> None:
        self.link.stop()


Benches = Callable[..., Bench]


@pytest.fixture
def make_bench(tmp_path: Path, request: pytest.FixtureRequest) -> Benches:
    def make(*rows: str, mode: str = 'Master', header: str = HEADER) -> Bench:
        bench = Bench(tmp_path, rows or ROWS, mode, header)
        request.addfinalizer(bench.close)
        return bench
    return make


@pytest.fixture
def bench(make_bench: Benches) -> Bench:
    return make_bench()


def test_each_event_is_logged_once_with_its_level(
        bench: Bench, capfd: pytest.CaptureFixture[str]) -> None:
    events, level = bench.events, bench.mapping('level')
    bench.happened(Message.NTC_REPLY_MSG_RCVD, (7,), 2)
    for station in (1, 1, 2):
        bench.happened(Message.ERR_WRONG_MESSAGE, (station, 0, 7), station)
    events.port_changed()
    bench.happened(Message.NTC_NAK_LIMIT_EXCEEDED, (3,), 2)
    bench.happened(Message.ERR_WRONG_MESSAGE, (2, 0, 8), 2)
    for station, heard in ((1, 0.0), (8, None), (9, None)):
        bench.happened(Message.ERR_INACTIVE_STATION, (station,), station)
        events.station_changed(Station(station, False, heard))
    for returns in (5, 1):
        events.station_changed(Station(1, True, returns=returns))
    for tns in (8, 9, 10):
        bench.happened(Message.ERR_WRONG_MESSAGE, (1, 0, tns), 1)
    assert bench.tables == 5
    for _ in range(10):
        events.lost('level', 3)
    events.ahead('level', 1.9, ['/a', '/b', '/c', '/d', '/e'])
    events.ahead('lamp', 1.9, [])
    bench.now = NOW + 3.0
    events.unreadable(level, 'no file')
    events.unreadable_rows.look(NOW + 3.9)
    events.published_again(level, 2.5)
    for is_conflict in (False, True):
        events.foreign_value(level, 'odd', is_conflict)
    wrong, early = '2510 ERR_WRONG_MESSAGE: Wrong Message Received Src:0x0', (
        '; it may answer a command sent before the port was opened')
    clock = 'is 1.90 s ahead of the clock here, so old messages look new'
    logged = re.sub(r' \[[0-9.]+\] \[line_a\]:', '', ''.join(capfd.readouterr()))
    assert logged.splitlines() == [
        f'[INFO] {wrong}1, Dst:0x00, Tns:0x0007 [station 1]{early}',
        f'[ERROR] {wrong}1, Dst:0x00, Tns:0x0007 [station 1]',
        f'[ERROR] {wrong}2, Dst:0x00, Tns:0x0007 [station 2]',
        '[INFO] 2519 NTC_NAK_LIMIT_EXCEEDED: NAK Retry Limit (3) exceeded [station 2]',
        f'[INFO] {wrong}2, Dst:0x00, Tns:0x0008 [station 2]{early}',
        '[ERROR] 2509 ERR_INACTIVE_STATION: Slave Station (1) Inactive',
        '[ERROR] 2509 ERR_INACTIVE_STATION: Slave Station (8) Inactive [station 8]',
        '[ERROR] 2509 ERR_INACTIVE_STATION: Slave Station (8) Inactive',
        '[INFO] station 8 has never been heard: stop the node and run "plc detect" to find the '
        'settings of the line, or "plc scan" to find the stations that answer',
        '[ERROR] 2509 ERR_INACTIVE_STATION: Slave Station (9) Inactive [station 9]',
        '[ERROR] 2509 ERR_INACTIVE_STATION: Slave Station (9) Inactive',
        '[INFO] station 1 answers again',
        f'[INFO] {wrong}1, Dst:0x00, Tns:0x0008 [station 1]{early}',
        f'[ERROR] {wrong}1, Dst:0x00, Tns:0x0009 [station 1]',
        *['[WARN] ~/write/level: 3 messages were lost on their way here and have no result: the '
          'publisher is too fast for this node, or the network was cut'] * 10,
        f'[WARN] ~/write/level: the clock of /a or /b or /c or /d {clock}',
        f'[WARN] ~/write/lamp: the clock of a node that is gone {clock}',
        '[ERROR] level (F8:4 at station 2): no file',
        '[INFO] level (F8:4 at station 2): published again after 2.5 s',
        '[WARN] level (F8:4 at station 2): odd', '[ERROR] level (F8:4 at station 2): odd']


@pytest.mark.parametrize(('mode', 'shown'), [('Master', [None] * 2), ('Radio', ['2', '3'])])
def test_counters_of_a_radio_modem_port_without_a_number_are_shown(
        make_bench: Benches, mode: str, shown: list[str | None]) -> None:
    bench = make_bench(mode=mode)
    bench.driver.counters.unsent_messages, bench.driver.counters.refused_for_memory = 2, 3
    values = bench.details('link')
    assert [values.get(f'messages {name}') for name in (
        'undelivered for lack of handshake', 'refused for lack of memory')] == shown


def test_node_on_the_air_with_our_number_is_an_error_for_a_minute(make_bench: Benches) -> None:
    bench = make_bench(mode='Radio')
    machine, packet = bench.driver.machine, Packet(2, Network().station, 0x0F, 0, 1, b'\x68')
    machine.start(NOW - 20)
    machine.receive_data(message_frame(packet.encode(), Network().checksum), NOW)
    level, text = bench.says('link', NOW + 59)
    assert (level, text.split(':')[:2]) == (
        ERROR, ['ERROR', ' another node on the air has our number, 5'])
    assert 'our number' not in bench.says('link', NOW + 60)[1]


def test_names_and_hardware_ids(bench: Bench) -> None:
    assert [(status.name, status.hardware_id)
            for status in bench.diagnostics.statuses(NOW)] == [
        ('line_a: link', PORT), ('line_a: counters', PORT),
        ('line_a: station 1', f'{PORT} station 1'), ('line_a: station 2', f'{PORT} station 2'),
        ('line_a: mappings', PORT), ('line_a: writes', PORT), ('line_a: topics', PORT)]


# link


def test_status_shows_each_character_of_what_comes_from_outside() -> None:
    status = message_of('a\n', OK, 'b\x1b', 'c\u202e', {'d\n': 'e\r'})
    assert (status.name, status.message, status.hardware_id) == (r'a\n', r'b\x1b', r'c\u202e')
    assert details(status) == {r'd\n': r'e\r'}


def test_link_before_there_is_one(bench: Bench) -> None:
    link = Diagnostics('line_a', bench.driver, PORT, bench.events).statuses(NOW)[0]
    assert (link.level, link.message) == (ERROR, 'ERROR: not started yet')
    assert details(link)['port'] == 'closed'


def test_link_without_a_port(bench: Bench) -> None:
    bench.set_port(False, 'cannot open the port: No such file or directory')
    assert bench.says('link') == (ERROR, 'ERROR: cannot open the port: No such file or directory')
    assert bench.details('link')['port'] == 'closed'
    bench.link.is_released = True
    assert bench.says('link') == (WARN, f'WARN: {RELEASED}')


def test_link_is_as_good_as_its_stations(bench: Bench) -> None:
    assert bench.says('link') == (OK, 'OK: port open, 0 of 2 stations have answered')
    bench.driver.stations.lost(2, NOW)
    assert bench.says('link') == (WARN, 'WARN: port open, 1 of 2 stations do not answer')
    bench.driver.stations.lost(1, NOW)
    assert bench.says('link') == (ERROR, 'ERROR: port open, but none of 2 stations answers')
    behind = Diagnostics('line_a', bench.driver, 'socket://gate:4000', bench.events)
    behind.line.attach(bench.link, bench.opener)
    assert behind.statuses(NOW)[0].message.endswith(
        ' answers, or the device server keeps this connection waiting')
    bench.driver.stations.heard(1, NOW)
    bench.driver.stations.heard(2, NOW)
    assert bench.says('link')[0] == OK


def test_line_without_a_station_is_well(make_bench: Benches) -> None:
    bench = make_bench('all,Write,N7:0,255,PLC5,')
    assert bench.says('link') == (OK, 'OK: port open, 0 of 0 stations have answered')
    assert bench.says('mappings') == (OK, 'OK: no mapping reads')


def test_station_that_takes_commands_and_never_replies_is_told(bench: Bench) -> None:
    for number in (1, 2):
        bench.driver.stations.heard(number, NOW)
    bench.driver.stations[2].unanswered = 5
    assert bench.says('link') == (
        WARN, 'WARN: port open, 1 of 2 stations take commands and do not reply')
    bench.driver.stations[1].unanswered = 5
    assert bench.says('link') == (
        ERROR, 'ERROR: port open, but none of 2 stations replies to commands')
    bench.driver.stations.lost(1, NOW)  # and the other one is gone
    assert bench.says('link')[0] == ERROR


def test_acknowledgement_without_a_reply_is_told_as_what_it_is(make_bench: Benches) -> None:
    bench = make_bench('speed,Read,N7:0,1,SLC,1000', mode='Peer')
    stations = bench.driver.stations
    told = 'commands to station 1 are acknowledged, and no reply comes: is the number right? '
    stations[1].unanswered = 1  # may be late once
    assert bench.says('link')[0] == OK
    stations[1].unanswered = 2
    assert bench.says('station 1')[1].startswith(f'WARN: {told}')
    level, text = bench.says('link')
    assert level == ERROR
    assert text.startswith(
        f'ERROR: port open, but none of 1 stations replies to commands; {told}')
    stations[1].replies = 1  # it is there
    assert told not in bench.says('link')[1] + bench.says('station 1')[1]


def test_number_to_which_a_gateway_replies_is_told_also_where_all_works(
        make_bench: Benches) -> None:
    bench = make_bench('speed,Read,N7:0,1,SLC,1000', 'load,Read,N7:0,2,SLC,1000', mode='Peer')
    watches = watches_of(bench.diagnostics.line, PORT, bench.seen, [], lambda now: [],
                         lambda now: [], lambda now: {}, lambda now: '')
    command = Packet(1, 5, 0x0F, 0, 1, b'')
    stations = bench.driver.stations
    assert not stations.answers(command.reply()._replace(dst=8), command, None)
    for _ in range(2):
        stations.heard(1, NOW)
    told = ('replies come to number 8, not to ours: a gateway such as the 1770-KF2 and KF3 '
            'replies to its own number. Next: make it our Station: 8 in net.csv, or --own-station '
            '8 of "plc"')
    assert bench.says('link') == (WARN, f'WARN: port open; {told}')
    assert '. Next: '.join(cause_of(bench)) == told
    assert bench.says('station 1')[0] == OK
    assert [[news.text for watch in watches for news in watch.look(NOW)] for _ in range(2)] == [
        [told], []]


@pytest.mark.parametrize('polling', ['Message', 'Standard'])
def test_plc_that_acknowledges_and_has_nothing_to_say_for_ever_takes_in_silence(
        polling: str) -> None:
    bench = DriverBench([make_mapping('N7:0', plc='SLC')], network=Network(polling=polling))
    plc = simulated_plc(1, 'SLC', bench.clock, ('N7:0', 4))
    bench.connect(plc)
    link = LinkStatus(LineView(bench.driver), PORT, Seen())
    assert 'normal poll scan' not in link.values(NOW)  # before the first has ended
    bench.run(1.0)
    station = bench.driver.stations[1]
    assert station.active and not takes_in_silence(station)
    plc.faults = InjectedFaults(slow=10**9)  # ACK of each command, EOT for each poll
    bench.run(5.0)
    assert station.active and takes_in_silence(station)
    assert ('normal poll scan' in link.values(NOW)) is (polling == 'Standard')


def test_link_of_a_node_with_a_duplicate_name(bench: Bench) -> None:
    bench.seen.duplicate_name = lambda: 'another node is called /line_a too'
    assert bench.says('link') == (WARN, 'WARN: port open, 0 of 2 stations have answered; '
                                        'another node is called /line_a too')
    bench.set_port(False, 'gone')
    bench.seen.dds_fault = 'deaf'
    assert bench.says('link') == (ERROR, 'ERROR: gone; another node is called /line_a too; deaf')


def test_link_and_standby_tell_how_often_diagnostics_come(bench: Bench) -> None:
    bench.seen.diagnostics_period = 10.0
    for is_waiting, count in (False, 7), (True, 1):
        assert len(bench.diagnostics.levels(NOW, is_waiting=is_waiting)) == count
        status = bench.diagnostics.statuses(NOW, is_waiting=is_waiting)[0]
        assert details(status)['diagnostics period'] == '10 s'
    bench.seen.take_over_fault = 'no memory'
    status, = bench.diagnostics.statuses(NOW, is_waiting=True)
    assert status.message.startswith('ERROR: has got the line on ')
    assert status.message.endswith(', but cannot offer its topics and services: no memory')


def test_fault_is_logged_when_it_begins_and_again_after_it_was_over(bench: Bench) -> None:
    faults, stations = ['', LOST, LOST, '', LOST], bench.driver.stations
    guests: Any = [SimpleNamespace(guest=Guest(name), fault='') for name in ('pty:b', 'pty:a')]
    watches = watches_of(
        bench.diagnostics.line, PORT, bench.seen, guests, lambda now: ['a'] * (now == NOW + 17),
        lambda now: ['b'] * (now == NOW + 17),
        lambda now: {'c': '/e, /f'} if now == NOW + 17 else {}, lambda now: faults[int(now - NOW)])

    def look(now: float) -> list[str]:
        return [news.text for watch in watches for news in watch.look(NOW + now)]

    assert [look(now) for now in range(5)] == [[], [LOST], [], [], [LOST]]
    assert bench.says('link') == (WARN, f'WARN: port open, 0 of 2 stations have answered; {LOST}')
    for _ in range(2):  # it answers polls, and no command
        stations.lost(1, NOW)
        stations.heard(1, NOW + 4)
    text, = look(4.0)
    stations.lost(1, NOW + 4)
    assert (text[:24], look(4.0)) == ('station 1 answers polls,', [])
    faults[4:] = [''] * 20
    assert look(15.0) == ['2509 ERR_INACTIVE_STATION: Slave Station (1) Inactive']
    stations.heard(1, NOW + 16)
    stations[1].returns = 0
    assert look(16.0) == ['station 1 answers commands']
    guests[1].fault = 'in use'
    bench.driver.checks.heard(1, Identity(PlcType.SLC, 'SLC 5/03'), NOW)
    command = Packet(5, 2, 0x0F, 0, 7, b'\xAA')
    for sent in command, command._replace(src=1):
        bench.driver.refused.add(sent, command.reply(sts=0x10), NOW)
    stations.lost(2, NOW)  # which the events tell
    assert [text[:24] for text in look(17.0)] == [
        'a changed since read; ca', '~/write/b has more than ', '~/write/c has more than ',
        'guest pty:a: in use',
        'refused a command of sta', 'refused a command of sta', 'station 1 is an SLC 5/03']
    assert look(18.0) == bench.seen.changed_files == bench.seen.crowded == [*bench.seen.dds_fault]
    bench.seen.is_waiting = lambda: True  # it offers no ~/reload
    assert look(17.0)[0] == 'a changed since read; restart this bridge'
    assert bench.says('station 1', NOW + 17.0) == (
        WARN, 'WARN: station 1 is an SLC 5/03, map.csv:2 says PLC5')


@pytest.mark.parametrize(('mode', 'silent', 'is_fault'), [
    ('Peer', 0, True), ('Master', 1, False), ('Master', 2, True), ('Radio', 2, False)])
def test_echo_is_a_fault_where_it_does_harm(
        mode: str, silent: int, is_fault: bool, make_bench: Benches,
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Machine, 'echoes', True)
    bench = make_bench(mode=mode)
    for number in range(1, silent + 1):
        bench.driver.stations.lost(number, NOW)
    assert (COMES_BACK in bench.says('link')[1]) is is_fault


def test_slave_that_nobody_polls_is_a_warning(make_bench: Benches) -> None:
    bench = make_bench(mode='Slave')
    link = bench.driver.link
    assert isinstance(link, SlaveLink)
    link.last_poll = 0.0
    assert bench.says('link', 5.0)[0] == OK
    assert bench.says('link', 6.0) == (WARN, 'WARN: port open, but not polled for 6 s')
    bench.set_port(False, 'gone')
    assert bench.says('link') == (ERROR, 'ERROR: gone')


def test_last_numbered_error_has_its_age(bench: Bench) -> None:
    def last_error(now: float) -> str:
        return bench.details('link', now)['last error']

    assert last_error(NOW) == 'none'
    bench.happened(Message.ERR_COMMAND_TIMEOUT, (), 2, NOW)
    expected = '2508 ERR_COMMAND_TIMEOUT: Command Timed Out [station 2]'
    assert last_error(NOW + 2.5) == f'{expected} (2.5 s ago)'
    bench.happened(Message.NTC_ENQ_LIMIT_EXCEEDED, (3,), 2, NOW + 3)
    assert last_error(NOW + 100) == f'{expected} (100.0 s ago)'  # a notice is no error


def test_rates_are_those_since_the_last_look(
        make_bench: Benches, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.ros.diagnostics.link.line_time', lambda: NOW - 4.0)
    bench = make_bench()
    bench.driver.tasks.transactions = bench.driver.counters.chars_sent = 96
    values = bench.details('link', NOW)
    assert (values['transactions per second'], values['line load']) == ('24.0', '2 %')
    bench.driver.tasks.transactions += 30
    bench.driver.counters.chars_sent += 480
    bench.driver.counters.chars_received += 960
    values = bench.details('link', NOW + 2)
    assert (values['port'], values['transactions per second']) == ('open', '15.0')
    assert values['line load'] == '75 %'  # 1440 characters of 10 bits at 9600 baud, in 2 s
    assert values['settings'] == '9600 baud, 8 data bits, parity None, 1 stop bits, CRC'
    monkeypatch.setattr(bench.opener, 'errors', lambda: {'framing errors': 3})
    values = bench.details('link', NOW + 3)
    assert (values['transactions per second'], values['line load']) == ('0.0', '0 %')
    assert values['framing errors'] == '3'


def test_load_of_the_line_is_told_by_topic_the_largest_first(tmp_path: Path) -> None:
    bench = Bench(tmp_path, ('slow,Read,N9:0,1,PLC5,1000,1', 'short,Read,N7:0,1,PLC5,100,1',
                             'long,Read,N7:2,1,PLC5,100,3'), header=f'{HEADER},Length')
    assert bench.details('link')['line load by topic'] == ''  # nothing was read twice
    for job in bench.driver.readings.reads.jobs:
        for now in (NOW, NOW + job.block.period):
            job.done(now)
    fast, = (job.block for job in bench.driver.readings.reads.jobs if job.block.period < 1)
    slow, = (job.block for job in bench.driver.readings.reads.jobs if job.block.period >= 1)
    assert bench.details('link')['line load by topic'] == (
        f'long {fast.line_time / 0.1 * 3 / 4:.1%}, short {fast.line_time / 0.1 / 4:.1%}, '
        f'slow {slow.line_time / 1.0:.1%}')


def test_load_by_topic_names_no_more_than_forty(tmp_path: Path) -> None:
    bench = Bench(tmp_path, tuple(f't{n},Read,N{n}:0,1,PLC5,1000' for n in range(10, 90)))
    for job in bench.driver.readings.reads.jobs:
        job.done(NOW)
        job.done(NOW + 1)
    assert bench.details('link')['line load by topic'].count('%') == 40


def test_poll_cycle_is_unknown_before_the_second_read(bench: Bench) -> None:
    values = bench.details('link')
    assert values['poll cycle with Periods'] == \
        values['longest poll cycle with Periods'] == 'unknown'
    expected = round(bench.driver.readings.expected_poll_cycle * 1000)
    assert values['expected poll cycle, 10 ms an answer'] == f'{expected} ms'


def test_link_tells_how_far_behind_each_period_is(bench: Bench) -> None:
    def periods() -> dict[str, str]:
        values = bench.details('link')
        return {key: value for key, value in values.items() if key.startswith('period')}

    points = list(bench.driver.points.values())
    first, second = points[:2]
    for point in points:
        point.period = 0.1
    assert periods() == {'period 100 ms': 'wanted 100 ms, not yet read twice'}
    first.interval, second.interval = 0.128, 0.136
    assert periods() == {'period 100 ms': 'wanted 100 ms, kept 132 ms'}
    second.period = 0.0
    assert periods() == {
        'period 0 ms': 'as often as the line allows, kept 136 ms',
        'period 100 ms': 'wanted 100 ms, kept 128 ms'}
    second.mapping = replace(second.mapping, command=Command.SERVE)
    first.mapping = replace(first.mapping, is_on_demand=True)
    assert periods() == {}  # neither what the PLC writes nor what is asked for has our pace


def test_latest_reads_of_other_nodes_are_shown_by_station(make_bench: Benches) -> None:
    overheard = (bench := make_bench(mode='Listen')).driver.overheard
    assert overheard is not None
    overheard.carried = {(n % 2, f'{n}'): Carried(
        n % 2, f'N{n:02}', Packet(5, 1, 6, 0, 7), 0.0, NOW - n, n) for n in range(31)}
    heard = [pair for pair in bench.details('link').items() if pair[0].startswith('heard')]
    assert heard == [(f'heard of station {n % 2}: N{n:02}', f'{n} times, last {n}.0 s ago')
                     for n in (*range(0, 30, 2), *range(1, 30, 2))]


# counters


def test_counters_begin_again_after_a_reset(bench: Bench) -> None:
    counters = bench.driver.counters
    counters.commands_sent, counters.replies_received, counters.crc_errors = 7, 6, 2
    assert bench.says('counters') == (OK, 'OK: 7 commands sent, 6 replies received')
    bench.diagnostics.counters.reset()
    assert set(bench.details('counters').values()) == {'0'}
    counters.commands_sent += 1
    assert bench.says('counters') == (OK, 'OK: 1 command sent, 0 replies received')
    values = bench.details('counters')
    assert (values['CNT_CMD_MSGS_SENT'], values['CNT_CRC_ERRORS']) == ('1', '0')


# stations


def test_station_before_its_first_answer(bench: Bench) -> None:
    assert bench.says('station 1') == (OK, 'OK: station 1 not heard yet')
    assert bench.details('station 1') == {
        'active': 'yes', 'last answer': 'none yet', 'last TNS': 'none yet', 'replies': '0',
        'transactions without reply': '0', 'error replies': '0', 'last event': 'none',
        'processor': 'unknown (not asked: processor_period is 0)', 'mode': 'unknown',
        'faults': 'unknown'}


def test_station_that_answers_is_ok_and_tells_its_last_answer(bench: Bench) -> None:
    bench.driver.stations.heard(1, NOW - 0.3)
    station = bench.driver.stations[1]
    station.last_tns, station.replies, station.failures, station.remote_errors = 0, 4, 2, 1
    assert bench.says('station 1') == (OK, 'OK: station 1 active')
    assert [*bench.details('station 1').values()][1:6] == ['0.3 s ago', '0x0000', '4', '2', '1']


def test_station_that_is_silent(bench: Bench) -> None:
    bench.driver.stations.heard(2, NOW - 20)
    bench.driver.stations.lost(2, NOW - 12.3)
    bench.happened(Message.NTC_ENQ_LIMIT_EXCEEDED, (3,), 2, NOW - 12.3)
    bench.happened(Message.NTC_REPLY_MSG_RCVD, (1,), 2, NOW - 12.3)  # this is routine
    bench.happened(Message.ERR_INACTIVE_STATION, (2,), 2, NOW - 12.3)
    assert bench.says('station 2') == (ERROR, 'ERROR: station 2 inactive for 12.3 s')
    values = bench.details('station 2')
    assert (values['active'], values['last answer']) == ('no', '20.0 s ago')
    assert values['last event'] == (  # what it has become inactive by
        '2520 NTC_ENQ_LIMIT_EXCEEDED: ENQ Retry Limit (3) exceeded [station 2] (12.3 s ago)')
    assert bench.says('station 1')[0] == OK


def test_station_that_answers_polls_and_no_command(bench: Bench) -> None:
    stations = bench.driver.stations
    for _ in range(2):
        stations.lost(1, NOW)
        stations.heard(1, NOW)
    told = WARN, 'WARN: station 1 answers polls, but no command: is Error_Code right?'
    assert bench.says('station 1') == told
    assert bench.says('link') == (
        WARN, 'WARN: port open, but 1 of 2 stations answer polls and no command')
    stations[2].unanswered = 5
    assert bench.says('link')[0] == ERROR  # no station replies to commands
    stations.lost(2, NOW)
    assert bench.says('link')[0] == ERROR
    stations.lost(1, NOW)  # it comes and goes
    assert bench.says('station 1', NOW + 9.9) == told
    assert bench.says('station 1', NOW + 10) == (ERROR, 'ERROR: station 1 inactive for 10.0 s')
    stations.heard(1, NOW + 12)
    stations[1].returns = 0  # by a reply
    assert bench.says('station 1', NOW + 12)[0] == OK


def cause_of(bench: Bench) -> tuple[str, str]:
    values = bench.details('link')
    return values.get('cause', ''), values.get('next step', '')


def test_link_tells_cause_and_next_step_of_a_missing_answer(bench: Bench,
                                                            make_bench: Benches) -> None:
    stations, counters = bench.driver.stations, bench.driver.counters
    assert cause_of(bench) == ('', '')
    counters.polls_sent = 1
    for number in (1, 2):
        stations.lost(number, NOW)
    assert cause_of(bench)[0].startswith('not one character came, not even to a poll: no station')
    counters.chars_received = 40
    assert cause_of(bench) == (
        '40 characters came, and no answer that makes sense: another baud rate or parity, noise, '
        'or another protocol', '"plc detect" tries other settings; another parity only with '
        '--parity')
    stations.heard(1, NOW)
    stations[1].replies = 3
    assert cause_of(bench)[0] == (
        'station 2 is silent, and station 1 answers: port and settings are right')
    stations.lost(1, NOW)
    assert cause_of(bench)[0] == 'station 1 has answered before, and is silent now'
    stations[1].replies = 0
    for _ in range(2):
        stations.heard(1, NOW)
        stations.lost(1, NOW)
    assert cause_of(bench)[0] == (
        'station 1 answers polls, but no command: is Error_Code right?')
    peer = make_bench('speed,Read,N7:0,1,SLC,1000', mode='Peer')
    peer.driver.stations.lost(1, NOW)
    peer.driver.counters.naks_received = 4
    assert cause_of(peer) == ('the PLC answers DLE NAK to all: is Error_Code right?',
                              'try Error_Code BCC')
    listening = make_bench('speed,Read,N7:0,1,SLC,1000', mode='Listen')
    listening.driver.stations.lost(1, NOW)
    assert cause_of(listening) == ('', '')


@pytest.mark.parametrize('is_full_duplex', [False, True])
def test_station_whose_replies_never_arrive_whole_is_not_said_to_take_no_command(
        bench: Bench, *, is_full_duplex: bool) -> None:
    stations = bench.driver.stations
    stations[1].unanswered_by = Message.ERR_BAD_CRC
    assert bench.says('link')[0] == OK  # once
    for _ in range(2):
        if is_full_duplex:
            stations.heard(1, NOW)
            stations[1].overdue += 1
        else:
            stations.lost(1, NOW)
            stations.heard(1, NOW)
    assert bench.says('station 1') == (
        WARN, 'WARN: station 1 replies, but each reply has a wrong check or breaks off: something '
        'on the way changes or drops bytes. Next: look for flow control, a telnet port and long '
        'messages, then for noise')
    assert bench.says('link') == (
        WARN, 'WARN: port open, but no reply of 1 of 2 stations arrives whole')


@pytest.mark.parametrize(('mode', 'acks', 'why'), [
    ('Peer', 0, '; it answers DLE NAK to all: is Error_Code right?'), ('Peer', 1, ''),
    ('Master', 0, '')])
def test_full_duplex_plc_that_refuses_all_has_another_check(
        mode: str, acks: int, why: str, make_bench: Benches,
        capfd: pytest.CaptureFixture[str]) -> None:
    bench = make_bench('speed,Read,N7:0,1,PLC5,1000', mode=mode)
    bench.driver.counters.naks_received += 3
    bench.driver.counters.acks_received += acks
    bench.driver.stations.lost(1, NOW - 2)
    assert bench.says('station 1') == (ERROR, f'ERROR: station 1 inactive for 2.0 s{why}')
    said = capfd.readouterr().err
    assert '"plc detect"' in said and ('"plc scan"' in said) is (mode == 'Master')


@pytest.mark.parametrize('counter', ['overdue', 'unanswered'])
@pytest.mark.parametrize('is_heard', [False, True])
def test_station_that_does_not_reply_in_time(bench: Bench, counter: str, is_heard: bool) -> None:
    if is_heard:
        bench.driver.stations.heard(1, NOW)
    setattr(bench.driver.stations[1], counter, 2)
    assert bench.says('station 1') == (
        WARN, 'WARN: station 1 takes commands, but does not reply in time')


def test_station_that_its_gateway_does_not_reach_is_not_called_silent(bench: Bench) -> None:
    bench.driver.stations[1].local_status = 0x02  # and has not been heard yet
    assert bench.says('station 1') == (WARN, (
        'WARN: commands do not get to station 1: '
        'STS 02: destination does not acknowledge, delivery not guaranteed'))
    for number in (1, 2):
        bench.driver.stations.heard(number, NOW)
    bench.driver.stations[1].overdue = 2  # late refusals count so
    assert bench.says('link') == (
        WARN, 'WARN: port open, 1 of 2 stations are not reached by their gateway')
    bench.driver.stations[2].local_status = 0x02
    assert bench.says('link')[0] == ERROR


def test_refused_command_of_a_plc_is_told_for_a_minute(bench: Bench) -> None:
    for number in (1, 2):
        bench.driver.stations.heard(number, NOW)
    # An MSG of station 1: write one word to N7:10, as an SLC writes to an SLC (M 7-28).
    command = Packet(5, 1, 0x0F, 0, 7, bytes.fromhex('AA 02 07 89 0A 00 39 30'))
    bench.driver.refused.add(command._replace(src=2), command.reply(sts=0x10), NOW + 1.5)
    for number in range(3):
        bench.driver.refused.add(command, command.reply(sts=0x10), NOW + number)
    text = ('station 1: protected typed logical write N7:10: STS 10: illegal command, format or '
            'length, or the file does not exist')
    assert bench.says('link', NOW + 61.0) == (
        WARN, f'WARN: port open, but the bridge has refused a command of {text}')
    assert bench.says('link', NOW + 62.1)[0] == OK
    assert bench.details('link', NOW + 62.1)[f'refused: {text}'] == '3 times'


# mappings


def test_rows_left_out_of_the_map_stay_visible(make_bench: Benches) -> None:
    bench = make_bench(ROWS[0], 'pump,Read,N7:0,300,PLC5,-1', 'fan,Read,N7:0,1,PLC6,')
    file = bench.folder / 'map.csv'
    bench.point('speed').update(b'\x01\x00', NOW)
    assert bench.says('mappings', NOW + 0.1) == (
        WARN, f'WARN: of 1 mappings 1 fresh; 2 rows left out of the map, the first at {file}:3:4 '
              '(Station)')
    values = bench.details('mappings', NOW + 0.1)
    assert values['left out 1'].startswith(f'{file}:3:4 (Station): 2501 ERR_BAD_STATION')
    assert values['left out 2'].startswith(f'{file}:3:6 (Period): Item: 2, Period = "-1" should')
    assert values['left out 3'].startswith(f'{file}:4:5 (PLC_Type): 2502 ERR_BAD_PLC_TYPE')
    assert bench.says('mappings', NOW + 4.0)[0] == ERROR


def test_many_faults_of_the_map_are_not_all_repeated(make_bench: Benches) -> None:
    bench = make_bench(*[f'pump{number},Read,N7:0,300,PLC5,' for number in range(21)])
    level, text = bench.says('mappings')
    assert level == WARN
    assert text.startswith('WARN: no mapping reads; 21 rows left out of the map, the first at')
    values = bench.details('mappings')
    assert [*values][-2:] == ['left out 20', 'left out, more']
    assert values['left out, more'] == '1 more fault; the log and "check" have them all'


def test_names_of_bits_are_told_by_topic(tmp_path: Path) -> None:
    bench = Bench(tmp_path, ('plain,Read,B3:1/0,1,PLC5,1000,2,,',
                             'words,Read,N7:0,1,PLC5,1000,2,,',
                             'cell,Read,B3:0/0,1,PLC5,1000,3,doors,closed | | fault'),
                  header=f'{HEADER},Length,Topic,Bits')
    values = bench.details('mappings')
    found = {key: text for key, text in values.items() if key.startswith(view.NAMES_OF_BITS)}
    assert found == {'names of bits, doors': 'closed | B3:0/1 | fault'}


def test_mappings_from_the_start_until_they_are_stale(bench: Bench) -> None:
    assert bench.says('mappings') == (WARN, 'WARN: of 2 mappings 2 waiting for the first read')
    assert bench.details('mappings')['speed'] == \
        'waiting for the first read: N7:0 at station 1, never read'
    bench.point('speed').update(b'\x01\x00', NOW)
    bench.point('level').update(bytes(4), NOW)
    assert bench.says('mappings', NOW + 1.0) == (OK, 'OK: of 2 mappings 2 fresh')
    assert bench.details('mappings', NOW + 1.0) == {
        'total': '2', 'fresh': '2', 'late': '0', 'stale': '0', 'failed': '0', 'withheld': '0',
        'waiting': '0'}
    bench.point('level').update(bytes(4), NOW + 1.0)
    assert bench.says('mappings', NOW + 2.0) == (WARN, 'WARN: of 2 mappings 1 fresh, 1 late')
    assert bench.details('mappings', NOW + 2.0)['speed'] == \
        'late: N7:0 at station 1, last read 2.0 s ago'
    assert bench.says('mappings', NOW + 3.1) == (ERROR, 'ERROR: of 2 mappings 1 late, 1 stale')


def test_rows_that_cannot_keep_their_period_are_named_with_one_that_would_do(
        make_bench: Benches) -> None:
    bench = make_bench('fast,Read,N7:0,1,PLC5,100', 'slow,Read,N7:100,1,PLC5,1000',
                       'free,Read,N9:0,1,PLC5,0', 'faster,Read,N9:100,1,PLC5,50',
                       'asked,Read,N9:200,1,PLC5,on demand')

    def read_until(end: float, intervals: dict[str, float]) -> None:
        for tag, interval in intervals.items():
            for number in range(40, -1, -1):
                bench.point(tag).update(b'\x01\x00', end - number * interval)

    read_until(NOW, {'fast': 0.405, 'slow': 1.3, 'free': 2.0, 'faster': 0.206, 'asked': 9.0})
    assert bench.says('mappings', NOW) == (WARN, (
        'WARN: of 5 mappings 5 fresh; Period not kept: faster (Period 50 ms, kept 206 ms), '
        'fast (Period 100 ms, kept 405 ms); the line can keep Period 1000'))
    odd = bench.driver.stations.odd
    odd.judge('another', 1, CommandTimeout(sent=True), NOW, is_counted=True)
    assert bench.says('mappings', NOW)[1].endswith(
        'kept 405 ms); commands that get no whole reply take time of the line')
    odd.passed('another')
    read_until(NOW + 45, {'fast': 0.14, 'slow': 1.3, 'free': 1.0, 'faster': 0.06})
    bench.point('asked').fail('no reply')
    bench.driver.spent[bench.mapping('fast')] = 36.0
    assert bench.says('mappings', NOW + 45) == (ERROR, (
        'ERROR: of 5 mappings 1 failed, 4 fresh; Period not kept: fast (Period 100 ms, kept '
        '141 ms); the line can keep Period 200; messages fill 80% of the line: fast (80%); set '
        'Write_Again to leave out unchanged values'))
    assert 'Period' not in bench.says('mappings', NOW + 95)[1]  # no row is read any more


def test_failed_and_withheld_mappings_tell_why_since_when_and_how_often(bench: Bench) -> None:
    speed, level = bench.point('speed'), bench.point('level')
    level.update(bytes(4), NOW)
    level.fail('STS 10: illegal command or format')
    speed.update(b'\x01\x00', NOW)
    speed.withhold('not in RUN', NOW)
    speed.update(b'\x01\x00', NOW + 1)
    speed.withhold('not in RUN', NOW + 2)
    assert bench.says('mappings', NOW + 2)[1] == 'ERROR: of 2 mappings 1 failed, 1 withheld'
    values = bench.details('mappings', NOW + 5)
    assert (values['level'], values['speed']) == (
        'failed: F8:4 at station 2, last read 5.0 s ago; STS 10: illegal command or format',
        'withheld: N7:0 at station 1, last read 4.0 s ago; not in RUN, for 3.0 s; '
        'times withheld: 2')


def test_tag_does_not_stand_in_for_a_count(make_bench: Benches) -> None:
    values = make_bench('total,Read,N7:0,1,PLC5,1000').details('mappings')
    assert values['total'] == '1'
    assert values['tag total'] == 'waiting for the first read: N7:0 at station 1, never read'


def test_blocks_may_be_divided_while_the_poll_cycle_is_asked_for(bench: Bench) -> None:
    # That is what the link thread does when a PLC refuses an address.
    jobs: Any = bench.driver.readings.reads.queue.jobs

    class Part:
        """A job that has not been done yet."""

        intervals = SimpleNamespace(last=None, usual=None, longest=None)

    class Divided:
        """A job that gives way to two others while it is looked at."""

        @property
        def intervals(self) -> SimpleNamespace:
            jobs.add(Part())
            return SimpleNamespace(last=0.25, usual=None, longest=None)

    jobs.clear()
    jobs.add(Divided())
    assert bench.details('link')['poll cycle with Periods'] == '250 ms'


# writes


def result(bench: Bench, outcome: Outcome, detail: str = '') -> WriteResult:
    return WriteResult(bench.mapping('level'), outcome, detail, '[1]', 0.01234)


OUTCOMES: list[tuple[Outcome, dict[str, str]]] = [
    (Outcome.WRITTEN, {'accepted': '1', 'confirmed': '1'}),
    (Outcome.STANDS, {'accepted': '1', 'not written again': '1'}),
    (Outcome.BROADCAST, {'accepted': '1'}),
    (Outcome.SUPERSEDED, {'accepted': '1', 'superseded': '1'}),
    (Outcome.REFUSED, {'refused': '1'}),
    (Outcome.NOT_SENT, {'accepted': '1', 'failed': '1'}),
    (Outcome.FAILED, {'accepted': '1', 'failed': '1'}),
    (Outcome.PARTLY, {'accepted': '1', 'failed': '1'}),
    (Outcome.UNKNOWN, {'accepted': '1', 'unknown': '1'}),
    (Outcome.FALLBACK, {'fallback values': '1'})]


@pytest.mark.parametrize(('outcome', 'expected'), OUTCOMES,
                         ids=[outcome.name for outcome, _ in OUTCOMES])
def test_every_outcome_is_counted_in_its_place(
        bench: Bench, outcome: Outcome, expected: dict[str, Any],
        capfd: pytest.CaptureFixture[str]) -> None:
    log = WriteLog(PORT)
    log.add(result(bench, outcome, 'why'), NOW)
    values = log.values(NOW + 1)
    last = values.pop('last failure')
    assert values.pop('last loss') == values.pop('clock ahead') == 'none'
    assert {key: value for key, value in values.items() if value != '0'} == expected
    is_failure = outcome not in (
        Outcome.WRITTEN, Outcome.STANDS, Outcome.BROADCAST, Outcome.SUPERSEDED)
    assert last == (f'level {outcome.value}: why (1.0 s ago)' if is_failure else 'none')
    level, text = log.judge(NOW)
    is_good = outcome in (Outcome.WRITTEN, Outcome.STANDS)
    assert (level, text[0]) == (WARN if is_failure else OK, '01'[is_good])
    bench.written(result(bench, outcome))
    assert bool(''.join(capfd.readouterr())) == is_failure
    assert bench.results[0].level == (
        OK if is_good else WARN if not is_failure or outcome is Outcome.FALLBACK else ERROR)


@pytest.mark.parametrize(('cause', 'level'), [
    (FallbackCause.START, OK), (FallbackCause.END, OK), (FallbackCause.TIMEOUT, WARN),
    (FallbackCause.RETURN, WARN), (FallbackCause.RUN, WARN)])
def test_fallback_value_is_no_message_and_usual_at_start_and_end(
        bench: Bench, cause: FallbackCause, level: bytes,
        capfd: pytest.CaptureFixture[str]) -> None:
    bench.written(result(bench, Outcome.FALLBACK, cause.value), NOW)
    told, text = bench.says('writes')
    assert told == level
    assert '0 of 0 writes confirmed' in text
    bench.written(result(bench, Outcome.WRITTEN), NOW)
    logged, = ''.join(capfd.readouterr()).splitlines()
    assert logged.startswith('[INFO] ' if level == OK else '[WARN] ')
    assert logged.endswith(f': fallback value written: {cause.value}')


def confirm(row: OwnRow, value: int) -> None:
    """Let a PLC have confirmed a value of ours now."""
    write = Write(row.mapping, [value], NOW, is_own=True)
    row.trial = Flight(row.mapping.station, [row.mapping.extent], write, NOW)
    row.trial.end(Outcome.WRITTEN, NOW, 0.0)
    row.words.flights = [row.trial]
    row.asked = NOW
    if isinstance(row, HeartbeatRow):
        row.counts = value > 0


def test_heartbeat_that_the_plc_does_not_confirm_does_not_count(make_bench: Benches) -> None:
    bench = make_bench('alive,Heartbeat,N10:0,1,PLC5,500')
    assert bench.says('interlocks')[1] == (
        'WARN: 0 of 1 heartbeats count; alive: heartbeat does not count')
    beat = bench.driver.kernel.rows.heartbeats[0]
    confirm(beat, 1)
    assert bench.says('interlocks', NOW) == (OK, 'OK: 1 of 1 heartbeats count')
    values = bench.details('interlocks', NOW + 1.5)
    assert values['station 1'] == 'heartbeat counts (for 1.5 s)'
    assert values['alive'] == 'heartbeat 1, 1.5 s ago; counts'
    assert bench.says('interlocks', NOW + 1.6)[0] == WARN
    values = bench.details('interlocks', NOW + 4)
    assert values['alive'] == 'heartbeat 1, 4.0 s ago; does not count: not confirmed for 4.0 s'
    assert values['station 1'] == 'not in control: not confirmed for 4.0 s'
    assert values['bound of alive'].startswith('PLC timer presets ')


@pytest.mark.parametrize('text', ['the port was lost: No such device', RELEASED])
def test_no_heartbeat_counts_while_the_port_is_closed(make_bench: Benches, text: str) -> None:
    bench = make_bench('alive,Heartbeat,N10:0,1,PLC5,500')
    beat = bench.driver.kernel.rows.heartbeats[0]
    confirm(beat, 1)
    assert bench.says('interlocks', NOW + 0.1) == (OK, 'OK: 1 of 1 heartbeats count')
    bench.set_port(False, text)
    assert bench.says('interlocks', NOW + 0.1) == (
        WARN, 'WARN: 0 of 1 heartbeats count; alive: heartbeat does not count')
    values = bench.details('interlocks', NOW + 0.1)
    assert values['alive'] == f'heartbeat 1, 0.1 s ago; does not count: {text}'
    assert values['station 1'] == f'not in control: {text}'
    bench.set_port(True, 'open')
    assert bench.details('interlocks', NOW + 0.1)['station 1'] == 'heartbeat counts (for 0.0 s)'


def test_bit_of_the_plc_confirms_control_while_it_is_fresh_and_1(
        make_bench: Benches, monkeypatch: pytest.MonkeyPatch) -> None:
    bench = make_bench('alive,Heartbeat,N10:0,1,PLC5,60000,,8',
                       'ruled,Read,B12:0/2,1,PLC5,1000,alive,8', header=f'{HEADER},Confirms,Via')
    beat, bit = bench.driver.kernel.rows.heartbeats[0], bench.point('ruled')
    latest: dict[str, Values] = {}
    bench.seen.latest = latest

    def station(value: int | None, now: float) -> tuple[bytes, str]:
        if value is not None:
            latest['ruled'] = bit.update(bytes([value << 2, 0]), now)
        status = bench.status('interlocks', now)
        return status.level, details(status)['station 1']

    assert station(1, NOW - 1) == (WARN, 'not in control: the PLC has not confirmed it yet')
    confirm(beat, 1)
    assert station(None, NOW) == (
        WARN, 'unknown: ruled has not been read since the heartbeat counts')
    assert station(1, NOW + 1) == (OK, 'in control for 0.0 s')
    latest.clear()  # the port was lost
    assert station(None, NOW + 1) == (WARN, 'unknown: ruled is fresh')
    assert station(1, NOW + 1) == (OK, 'in control for 0.0 s')
    assert station(1, NOW + 2.5) == (OK, 'in control for 1.5 s')
    assert station(0, NOW + 3) == (
        WARN, 'not in control: the heartbeat counts, but ruled is 0: a person has to press reset '
        '(docs/tutorials/heartbeats.md)')
    assert bench.says('interlocks', NOW + 3)[1] == (
        'WARN: 1 of 1 heartbeats count; alive: the PLC does not confirm that ROS is in control')
    assert station(1, NOW + 4) == (OK, 'in control for 0.0 s')
    assert station(None, NOW + 30) == (WARN, 'unknown: ruled is stale')
    bit.fail('no reply')
    assert station(None, NOW + 30) == (WARN, 'unknown: ruled is failed: no reply')
    assert station(1, NOW + 31) == (OK, 'in control for 0.0 s')
    beat.reason = 'no message'
    assert station(None, NOW + 31) == (WARN, 'not in control: no message')
    beat.reason = ''
    assert station(1, NOW + 32) == (OK, 'in control for 0.0 s')
    stopped = Identity(PlcType.PLC5, 'PLC-5/40', mode=Mode.REMOTE_PROGRAM, mode_text='REM PROG')
    monkeypatch.setattr(bench.driver.checks, 'known', {
        1: StationHealth('PLC-5/40', stopped, NOW + 33), 8: StationHealth('gateway')}.get)
    assert station(1, NOW + 33) == (
        WARN, 'not in control: ruled is 1, but the PLC is in program mode (REM PROG)')


def test_guests_are_counted_and_told_of(bench: Bench) -> None:
    guests = [Guest('pty:a', is_connected=True, commands=1, slowest=0.25), Guest('tcp:7')]
    lines: Any = [SimpleNamespace(guest=guest, fault='', state='open', waiting=0)
                  for guest in guests]
    bench.diagnostics = Diagnostics('line_a', bench.driver, PORT, bench.events, guests=lines)
    status = bench.status('guests')
    assert (status.level, status.message, status.hardware_id) == (
        OK, 'OK: 1 of 2 guests are connected', PORT)
    guests[1].commands = guests[1].refused = guests[1].collisions = 1
    guests[0].refused = guests[0].unanswered = 2
    guests[0].outside = 3
    lines[0].waiting = 3
    assert bench.says('guests') == (WARN, (
        'WARN: 1 of 2 guests are connected; 3 commands not allowed; 3 writes outside of limits; '
        '1 write to words of this bridge'))
    assert bench.details('guests') == {
        'pty:a': 'open; 1 command, 2 not allowed, 3 outside of limits, 2 without reply, '
                 '3 waiting, slowest 250 ms',
        'tcp:7': 'open; 1 command, 1 not allowed, 0 outside of limits, 0 without reply, '
                 '0 waiting, slowest unknown'}
    lines[0].fault, lines[1].fault = 'gone', 'in use'
    assert bench.says('guests') == (ERROR, 'ERROR: pty:a: gone; tcp:7: in use')


def test_value_of_a_guest_over_a_fallback_is_a_warning(
        make_bench: Benches, monkeypatch: pytest.MonkeyPatch) -> None:
    line = partial(make_bench, 'speed,Write,N10:1,1,PLC5,7,500',
                   header='Tag,Command,Address,Station,PLC_Type,Fallback,Fallback_After')
    assert line(mode='Slave').details('interlocks') == {
        'speed': 'a message stands', 'bound of speed': 'none: the master of the line decides'}
    bench = line()
    row, = bench.driver.kernel.rows.fallbacks
    confirm(row, 7)
    assert bench.says('interlocks')[0] == OK
    guest = Flight(1, [row.mapping.extent])
    guest.end(Outcome.WRITTEN, NOW + 1, 0.0)
    row.words.ended(guest)
    assert bench.says('interlocks') == (WARN, (
        'WARN: 0 of 0 heartbeats count; speed: a guest has written over the fallback value'))
    row.cause = FallbackCause.TIMEOUT
    assert bench.says('interlocks') == (
        WARN, 'WARN: 0 of 0 heartbeats count; speed: fallback value is due')
    bound, = Times(bench.driver.network, bench.driver.mappings).bounds()
    row.refusal = 'STS 10'
    assert bench.details('interlocks') == {
        'speed': 'the fallback value is due (timeout): STS 10',
        'bound of speed': str(bound).partition(': ')[2]}

    class Confirmed:  # by the thread of the link at this moment
        value = property(lambda self: setattr(row, 'cause', None) or 'due')

    monkeypatch.setattr(FallbackRow, 'state', Confirmed())
    assert details(bench.diagnostics.statuses(NOW)[-1])['speed'] == 'due (timeout): STS 10'


def test_station_is_told_by_the_worst_of_its_heartbeats(make_bench: Benches) -> None:
    bench = make_bench(*(f'beat_{word},Heartbeat,N10:{word},1,PLC5,1000' for word in range(3)))
    beats = bench.driver.kernel.rows.heartbeats
    for beat in beats[::2]:
        confirm(beat, 1)
    assert bench.details('interlocks')['station 1'].startswith('not in control: ')
    confirm(beats[1], 1)
    assert bench.details('interlocks')['station 1'].startswith('heartbeat counts (for ')


def test_heartbeat_that_another_program_writes_is_an_error_with_what_it_wrote(
        make_bench: Benches) -> None:
    bench = make_bench('alive,Heartbeat,N10:0,1,PLC5,500,', 'other,Heartbeat,N10:1,2,PLC5,500,',
                       'ruled,Read,B12:0/2,2,PLC5,1000,other', header=f'{HEADER},Confirms')
    beat, other = bench.driver.kernel.rows.heartbeats
    confirm(beat, 0)
    beat.is_taken = True
    confirm(other, 1)
    assert bench.says('interlocks') == (ERROR, (
        'ERROR: 1 of 2 heartbeats count; alive: heartbeat does not count; other: the PLC does not '
        'confirm that ROS is in control'))
    bench.events.foreign_value(beat.mapping, 'one strange word', is_conflict=False)
    assert not bench.seen.conflicts
    text = 'N10:0: another program writes this word: 7 was read where 3 was written'
    for row, said in ((other, '5'), (beat, '6'), (beat, text.removeprefix('N10:0: '))):
        bench.events.foreign_value(row.mapping, said, is_conflict=True)
    assert bench.details('interlocks')['station 1'] == f'not in control: {text}'
    beat.is_taken = False
    confirm(beat, 1)
    assert bench.details('interlocks')['station 1'].startswith('heartbeat counts')


def test_last_fallback_value_of_a_station_is_told_with_its_cause(make_bench: Benches) -> None:
    bench = make_bench('speed,Write,N10:1,1,PLC5,')
    row, = bench.driver.mappings
    assert 'line_a: interlocks' not in [status.name for status in bench.diagnostics.statuses(NOW)]
    told = Write(row, [0], NOW).result(Outcome.FALLBACK, FallbackCause.TIMEOUT.value)
    for now in (NOW - 1, NOW):
        bench.written(told, now)
    bench.written(Write(row, [0], NOW).result(Outcome.WRITTEN), NOW + 1)
    assert bench.seen.last_fallbacks == {1: ('speed: timeout', NOW)}

    class Another(str):  # what the thread of the link does at this moment

        def __format__(self, kind: str) -> str:
            bench.seen.last_fallbacks[2] = self, NOW
            return str(self)

    bench = make_bench('alive,Heartbeat,N10:0,1,PLC5,500')
    bench.seen.last_fallbacks[1] = Another('speed: timeout'), NOW
    assert bench.details('interlocks')['station 1 last fallback'] == 'speed: timeout (0.0 s ago)'


def test_publisher_whose_clock_is_ahead_is_named_for_ten_seconds(bench: Bench) -> None:
    bench.events.ahead('level', 1.9, ['/panel'])
    text = '~/write/level: the clock of /panel is 1.90 s ahead of the clock here'
    assert bench.says('writes') == (WARN, f'WARN: 0 of 0 writes confirmed; {text}')
    assert bench.details('writes')['clock ahead'] == f'{text} (0.0 s ago)'
    assert bench.says('writes', NOW + 10)[0] == OK


def test_lost_message_is_counted_and_a_warning_for_ten_seconds(bench: Bench) -> None:
    bench.events.lost('level', 3)
    bench.now = NOW + 1
    bench.events.lost('pulses', 1)
    assert bench.says('writes', NOW + 10.9) == (
        WARN, 'WARN: 0 of 0 writes confirmed; 4 messages were lost on their way here')
    assert bench.says('writes', NOW + 11) == (OK, 'OK: 0 of 0 writes confirmed')
    values = bench.details('writes', NOW + 11)
    assert values['lost on their way'] == '4'
    assert values['last loss'] == '1 to ~/write/pulses (10.0 s ago)'


def test_failed_write_is_a_warning_for_ten_seconds(bench: Bench) -> None:
    bench.written(result(bench, Outcome.WRITTEN), NOW)
    bench.written(result(bench, Outcome.UNKNOWN, 'no reply'), NOW)
    bench.written(result(bench, Outcome.WRITTEN), NOW + 1)
    warning = 'WARN: 2 of 3 writes confirmed; level unknown whether written: no reply'
    assert bench.says('writes', NOW + 1) == (WARN, warning)
    assert bench.says('writes', NOW + 9.9) == (WARN, warning)
    assert bench.says('writes', NOW + 10) == (OK, 'OK: 2 of 3 writes confirmed')
    assert bench.details('writes', NOW + 10)['last failure'] == \
        'level unknown whether written: no reply (10.0 s ago)'
    assert details(bench.results[1])['latency_ms'] == '12.3'


def test_monitor_looks_for_values_that_there_are(bench: Bench) -> None:
    columns = {key for *_, key in plant.COLUMNS} - {'state'}
    expected = {*view.LINK_KEYS, view.LOAD_BY_TOPIC, *columns, 'last error'}
    assert expected <= bench.details('link').keys()
    assert {*view.STATION_KEYS} <= bench.details('station 1').keys()
    assert 'total' in bench.details('mappings')


def test_rows_whose_messages_fill_the_line_are_named_the_fullest_first() -> None:
    rows = [make_mapping(f'N7:{number}', 'Write', tag=f'w{number}') for number in range(2)]
    spent = dict.fromkeys(rows, 0.0)
    line = FullLine(spent)
    assert line.text(100.0) == ''
    spent[rows[0]], spent[rows[1]] = 1.0, 2.75
    assert line.text(104.0) == ''  # it is not looked at all the time
    assert line.text(105.0) == (
        'messages fill 75% of the line: w1 (55%), w0 (20%); set Write_Again to leave out '
        'unchanged values')
    spent[rows[1]] = 11.0
    assert line.text(120.0) == ''
    spent[make_mapping('N7:2', 'Write', tag='again', write_again=1000)] = 6.0
    assert line.text(125.0) == 'messages fill 100% of the line: again (120%), w0 (0%), w1 (0%)'


def test_gateway_of_a_station_is_named(make_bench: Benches) -> None:
    bench = make_bench('speed,Read,N7:0,1,PLC5,1000,0', 'level,Read,N7:0,2,PLC5,1000,',
                       'all,Write,N7:0,255,PLC5,,',
                       header='Tag,Command,Address,Station,PLC_Type,Period,Via')
    bench.happened(Message.NTC_ENQ_LIMIT_EXCEEDED, (3,), 1)
    assert bench.details('station 1')['last event'].startswith('2520 NTC_ENQ_LIMIT_EXCEEDED')
    assert bench.details('station 1')['gateway'] == '0'
    assert 'gateway' not in bench.details('station 2')
    assert bench.driver.mappings.asked == {0, 1, 2}
    said = []
    for number in (1, 0):
        bench.driver.stations.lost(number, NOW)
        said.append(bench.says('station 1', NOW + 2)[1])
    text = 'ERROR: station 1 inactive for 2.0 s'
    assert said == [f'{text}; its gateway, station 0, answers', text]
