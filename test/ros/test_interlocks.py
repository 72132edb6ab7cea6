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

"""Heartbeats, fallback values and guarded reads of a real node; named by the rules they show."""

from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path
import signal
import threading
import time
from typing import Any

from abdf1_ros.client import Client
from abdf1_ros.df1.echo import COMES_BACK
from abdf1_ros.df1.frames import Frame, NAK, Symbol
from abdf1_ros.df1.peer import PEER
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.errors import RemoteError
from abdf1_ros.open_line import OpenLine
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.steps import AddressedValues, echo, write
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.simulator.ladder import Lamp
import pytest
from rclpy.clock import ClockType
from std_msgs.msg import Int16MultiArray
from std_srvs.srv import SetBool, Trigger
from support import ros
from support.commands import Output, running_simulator
from support.fault_box import FaultBox
from support.ptys import PATIENCE
from support.rungs import PageLadder

NET = 'NAK_Retries,ENQ_Retries,Cmd_Timeout,Baud,Timeout\n1,1,500,115200,100\n'
MAP = """\
Tag,Command,Address,Station,PLC_Type,Period,Fallback,Fallback_After,While
speed,Write,N10:1,1,SLC,,7,400,
doors,Read,N7:0,1,SLC,50,,,RUN
beat,Heartbeat,N10:0,1,SLC,100,,,
"""
SIMULATOR = """\
Station,PLC_Type,Address,Length,Values,Motion,Period
1,SLC,S:0,8,,,
1,SLC,N7:0,4,5,,
1,SLC,N10:0,4,,,
"""

MARK = b'GUEST'  # what is easily known in a command

ATTEMPTS = 16  # to be seen by a host that is not busy


class Cell(ros.BridgeCell):
    """A bridge with a heartbeat."""

    def __init__(self, folder: Path, *assignments: str) -> None:
        super().__init__(folder, SIMULATOR, MAP, NET, *assignments)

    def word(self, address: str) -> int:
        return self.plcs.word(address)

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Wait for something; the executor runs meanwhile."""
        self.ros.until(lambda: condition() or None, what)

    def share(self, place: Path) -> Client:
        """Return a guest at a place of the bridge, which is there soon."""
        self.until(place.exists, 'the place')
        return Client(str(place), plc_type='SLC', timeout=3.0, cmd_timeout=3.0)

    def open_place(self, place: Path) -> OpenLine:
        """Return a guest that sends any command."""
        self.until(place.exists, 'the place')
        return OpenLine(PEER, LinkSettings(timeout=3.0, cmd_timeout=3.0),
                        PortSettings(str(place)))

    def until_counting(self) -> None:
        """Wait until the heartbeat counts."""
        self.until(lambda: self.word('N10:0') > 2, 'a heartbeat that counts')

    def until_beats(self, count: int) -> None:
        """Wait until the heartbeat has counted so many times, from wherever it begins again."""
        last = self.word('N10:0')

        def have_come() -> bool:
            nonlocal last, count
            before, last = last, self.word('N10:0')
            count -= last not in (0, before)
            return count <= 0

        self.until(have_come, f'{count} beats')

    def until_word(self, publisher: Any, value: int) -> None:
        """Publish a value until it is in the PLC, where it stays for Fallback_After."""
        def has_come() -> bool:
            publisher.publish(Int16MultiArray(data=[value]))
            time.sleep(0.01)  # a busy host would take messages of a flood when they are too old
            return self.word('N10:1') == value

        self.until(has_come, f'{value} in the PLC')


class ProcessCell(Cell):
    """The same with the bridge as a process."""

    def start(self) -> None:
        self.results = self.ros.results()
        self.process = ros.Process('node', *ros.ros_args(*self.assignments))

    def end(self, number: signal.Signals = signal.SIGTERM) -> int:
        self.process.send(number)
        return self.process.result()


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Cell]:
    with Cell(tmp_path) as made:
        yield made


def fallbacks(results: ros.Inbox) -> list[str]:
    """Return the causes of the fallback values that have been told."""
    return [result.message.partition(': ')[2] for result in results
            if result.message.startswith('fallback value written')]


def test_rule_3_heartbeat_stands_still_with_the_executor(cell: Cell) -> None:
    """How soon is shown in virtual time."""
    cell.until_counting()
    cell.ros.executor.remove_node(cell.node)
    changed, last = time.monotonic(), cell.word('N10:0')

    def stands() -> bool:
        nonlocal last, changed
        if cell.word('N10:0') != last:
            last, changed = cell.word('N10:0'), time.monotonic()
        return time.monotonic() > changed + 1.5

    cell.until(stands, 'a heartbeat that stands still')
    cell.ros.executor.add_node(cell.node)
    cell.until_beats(1)

    def clocks() -> list[ClockType]:
        return [timer.clock.clock_type for timer in cell.node.timers
                if timer.timer_period_ns == 10 ** 8]

    ours = [ClockType.STEADY_TIME]  # a step of the clock of the host counts for none
    assert clocks() == ours * 2
    cell.map.write_text(MAP[:MAP.index('beat')], encoding='utf-8')
    assert cell.call(Trigger, 'reload', Trigger.Request()).success
    assert clocks() == ours


def test_rule_3_simulated_time_that_does_not_run_holds_nothing_up(tmp_path: Path) -> None:
    with Cell(tmp_path, 'use_sim_time:=true') as cell:
        cell.until_counting()
        cell.until_word(cell.ros.publisher(Int16MultiArray, '/abdf1/write/speed'), 3)
        before = len(fallbacks(cell.results))
        # On a busy host a PLC may be lost for a moment: then it is that of its return.
        cell.until(lambda: len(fallbacks(cell.results)) > before, 'the fallback')
        cell.until(lambda: cell.word('N10:1') == 7, 'its value')


def test_rule_5_orderly_end_leaves_zero_and_fallback(cell: Cell) -> None:
    cell.until_counting()
    cell.until_word(cell.ros.publisher(Int16MultiArray, '/abdf1/write/speed'), 42)
    cell.end()
    assert (cell.word('N10:0'), cell.word('N10:1')) == (0, 7)


def test_rule_5_port_that_is_left_to_others_is_left_with_zero(
        cell: Cell, monkeypatch: pytest.MonkeyPatch, capfd: Output) -> None:
    cell.until_counting()
    assert cell.call(SetBool, 'polling', SetBool.Request(data=False)).success
    assert (cell.word('N10:0'), cell.word('N10:1')) == (0, 7)
    assert cell.call(SetBool, 'polling', SetBool.Request(data=True)).success
    cell.until_counting()
    cell.plcs.say('silent 1')
    monkeypatch.setattr('abdf1_ros.ros.bridge.node.HAND_OVER', 0.1)
    assert cell.call(SetBool, 'polling', SetBool.Request(data=False)).success
    assert 'the port is closed before the PLC has confirmed: beat' in capfd.readouterr().err


@pytest.mark.parametrize('is_end', [True, False])
@pytest.mark.parametrize('is_back', [True, False])
def test_rule_5_end_waits_for_a_port_that_was_lost_and_names_what_may_stand(
        is_back: bool, is_end: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capfd: Output) -> None:
    name = 'LONGEST_END' if is_end else 'HAND_OVER'
    monkeypatch.setattr(f'abdf1_ros.ros.bridge.node.{name}', PATIENCE if is_back else 0.1)
    cell = Cell(tmp_path, f'port:="{tmp_path / "line"}"')
    cell.map.write_text(MAP.replace(',400,', ',60000,'), encoding='utf-8')
    with FaultBox(Path(cell.plcs.port), tmp_path / 'line') as box, cell:
        cell.until_counting()
        cell.until_word(cell.ros.publisher(Int16MultiArray, '/abdf1/write/speed'), 42)
        box.unplug()
        cell.until(lambda: not cell.node.session.driver.is_online, 'the lost port')
        back = threading.Timer(0.2, box.plug)
        if is_back:
            back.start()
        if is_end:
            cell.end()
        else:
            answer = cell.call(SetBool, 'polling', SetBool.Request(data=False))
            assert answer.success
            named = 'the port is closed before the PLC has confirmed: beat, speed'
            assert answer.message.endswith(named) is not is_back
        assert cell.word('N10:1') == (7 if is_back else 42)
        assert (cell.word('N10:0') == 0) is is_back
    what = 'ends' if is_end else 'the port is closed'
    said = capfd.readouterr().err
    assert (f'{what} before the PLC has confirmed: beat, speed' in said) is not is_back


@pytest.mark.parametrize(('made', 'is_end', 'rows'), [
    (Cell, True, MAP.replace(',100,,,', ',1000,,,')),  # leaves time to guests
    (Cell, False, MAP[:MAP.index('beat')]),
    (ProcessCell, True, MAP[:MAP.index('beat')])])
def test_rule_5_guest_under_way_is_written_over_at_the_end(
        tmp_path: Path, made: type[Cell], is_end: bool, rows: str) -> None:
    place = tmp_path / 'hmi'
    with made(tmp_path, f'net.share:="pty:{place}"', 'net.share_access:=Write',
              'net.cmd_timeout:=3000') as cell:
        cell.until_counting()
        cell.map.write_text(rows, encoding='utf-8')
        before = len(fallbacks(cell.results))
        assert cell.call(Trigger, 'reload', Trigger.Request()).success
        cell.until(lambda: fallbacks(cell.results)[before:].count('start') > 0, 'the fallback')
        with cell.share(place) as hmi:
            cell.plcs.say('delay 1 250')  # it executes a command at once, and answers later
            writer = threading.Thread(target=hmi.write, args=('N10:1', 99))
            writer.start()
            cell.until(lambda: cell.word('N10:1') == 99, "the guest's value")
            if is_end:
                assert cell.end() == 0
            else:
                assert cell.call(SetBool, 'polling', SetBool.Request(data=False)).success
            writer.join()
        assert (cell.word('N10:0'), cell.word('N10:1')) == (0, 7)


def watched(cell: Cell, address: str,
            answer: Callable[[Symbol], bytes | None] = lambda symbol: None) -> list[int]:
    """Return the values of a word as they come; let the PLC ``answer`` some symbols otherwise."""
    plc = cell.plcs[1]
    handle, values = plc.handle, [cell.word(address)]

    def handled(symbol: Symbol) -> bytes:
        said = answer(symbol)
        said = handle(symbol) if said is None else said
        if (value := cell.word(address)) != values[-1]:
            values.append(value)
        return said

    plc.handle = handled  # type: ignore[method-assign]
    return values


@pytest.mark.parametrize('answer', [pytest.param(NAK, marks=pytest.mark.long), b''])
def test_rule_3_guests_command_that_the_plc_does_not_take_changes_no_heartbeat_and_no_read(
        tmp_path: Path, answer: bytes, capfd: Output) -> None:
    place = tmp_path / 'hmi'

    def answered(symbol: Symbol) -> bytes | None:
        return answer if isinstance(symbol, Frame) and MARK in symbol.data else None

    with Cell(tmp_path, f'net.share:="pty:{place}"') as cell:
        doors = cell.ros.listen(Int16MultiArray, '/abdf1/read/doors')
        beats, statuses = watched(cell, 'N10:0', answered), set[int]()

        def goes_on() -> bool:
            """Tell whether ours go on while a guest asks: on a busy host they may not."""
            cell.until_counting()
            cell.until_beats(3)
            first, reads = len(beats), len(doors)
            for _ in range(3):
                with pytest.raises(RemoteError) as failure:
                    hmi.ask(1, echo(MARK * 46))
                statuses.add(failure.value.sts)
                cell.until_beats(10)  # no guest has the line for a while
            return 0 not in beats[first:] and len(doors) - reads > len(beats) - first

        with cell.open_place(place) as hmi:
            assert any(goes_on() for _ in range(ATTEMPTS))
        assert statuses & {0x02, 0x05}  # it was sent
    assert capfd.readouterr().err.count(' gets no reply from station 1 to echo ') == 1


def test_rule_8_broadcast_of_a_guest_over_a_fallback_is_told_and_written_over(
        tmp_path: Path, capfd: Output) -> None:
    place = tmp_path / 'hmi'
    with Cell(tmp_path, f'net.share:="pty:{place}"', 'net.share_access:=All') as cell:
        cell.until_counting()
        written = watched(cell, 'N10:1')
        with cell.open_place(place) as hmi:
            for word, value in ('N10:0', 1), ('N10:1', 99):
                for _ in range(ATTEMPTS):
                    with pytest.raises(RemoteError) as caught:
                        hmi.ask(255, write(AddressedValues.of(word, PlcType.SLC), [value]))
                    if caught.value.sts == 0x05:  # sent; a busy host has no time for it
                        break
        cell.until(lambda: 7 in written[written.index(99):] if 99 in written else None,
                   'the fallback after it')
    said = capfd.readouterr().err
    for what in ('N10:0 = 1, words of beat', 'N10:1 = 99, words of speed'):
        assert (f'guest pty:{place} has sent to station 255: protected typed logical write '
                f'{what}') in said
    assert 'read_only' not in said


def test_rule_5_new_files_are_a_new_start(cell: Cell) -> None:
    cell.until_counting()
    cell.map.write_text(MAP[:MAP.index('beat')], encoding='utf-8')
    assert cell.call(Trigger, 'reload', Trigger.Request()).success
    assert (cell.word('N10:0'), len([*cell.node.timers])) == (0, 1)  # that of the cell
    cell.map.write_text(MAP, encoding='utf-8')
    assert cell.call(Trigger, 'reload', Trigger.Request()).success
    cell.until_counting()


def test_rule_8_fallback_comes_when_the_publisher_is_gone(cell: Cell) -> None:
    """How soon is shown in virtual time; here that it is no sooner."""
    cell.until_counting()
    publisher = cell.ros.publisher(Int16MultiArray, '/abdf1/write/speed')
    cell.until(lambda: fallbacks(cell.results)[:1] == ['start'], 'that of the start')
    numbers = count(42)

    def falls_back() -> bool:
        """Publish once; tell whether that was sent and the fallback value has come after it."""
        cell.results.clear()
        began, number = time.monotonic(), next(numbers)
        publisher.publish(Int16MultiArray(data=[number]))
        if cell.results.until(lambda result: ros.details(result)['value'] == f'[{number}]',
                              'its result').message != 'written':
            return False
        cell.until(lambda: cell.word('N10:1') == 7, 'the fallback value')
        assert time.monotonic() - began > 0.4  # Fallback_After
        cell.until(lambda: bool(fallbacks(cell.results)), 'its result')
        return fallbacks(cell.results) == ['timeout']

    cell.until(falls_back, 'a fallback value because of the time')  # a busy host may lose the PLC


def test_rules_13_and_15_guarded_row_is_withheld_and_named(cell: Cell) -> None:
    doors = cell.ros.listen(Int16MultiArray, '/abdf1/read/doors')
    assert doors.first().data[0] == 5
    cell.plcs.say('program 1')
    status = cell.ros.until(lambda: next((
        status for array in cell.diagnostics for status in array.status
        if status.name.endswith(': mappings') and 'withheld' in status.message), None),
        'a withheld row')
    assert 'withheld' in ros.details(status)['doors']
    assert 'not in RUN: it is in REM PROG' in ros.details(status)['doors']
    cell.until_beats(10)
    count = len(doors)
    cell.until_beats(10)
    assert len(doors) == count
    cell.plcs.say('run 1')
    count = len(doors)
    cell.until(lambda: len(doors) > count, 'a value after RUN')


def test_rule_18_read_only_writes_nothing_and_says_so(tmp_path: Path, capfd: Output) -> None:
    with Cell(tmp_path, 'read_only:=true') as cell:
        doors = cell.ros.listen(Int16MultiArray, '/abdf1/read/doors')
        cell.until(lambda: len(doors) > 10, 'values')
        assert (cell.word('N10:0'), cell.word('N10:1')) == (0, 0)
    said = capfd.readouterr().err
    assert said.count('read_only: no heartbeat and no fallback value is written: speed, beat') == 1


ECHO_NET = ('Station,Mode,PLC_Type,Cmd_Timeout,Timeout,Baud', ['5,Peer,PLC5,500,50,115200'])
ECHO_MAP = ('Tag,Command,Address,Station,PLC_Type,Period,While,While_Timeout', [
    'ours,Serve,N7:0,5,PLC5,,,', 'speed,Write,N7:0,1,PLC5,,,', 'doors,Read,N7:0,1,PLC5,50,RUN,',
    'counter,Read,N7:1,1,PLC5,50,,', 'lamps,Read,N7:2,1,PLC5,50,counter,1000',
    'beat,Heartbeat,N7:1,1,PLC5,100,,'])


def test_rule_21_an_echo_is_no_plc(tmp_path: Path) -> None:
    net = ros.write_csv(tmp_path / 'net.csv', *ECHO_NET)
    rows = ros.write_csv(tmp_path / 'map.csv', *ECHO_MAP)
    port = tmp_path / 'line'
    with running_simulator('--pty', str(port), '--echo', '--full-duplex', '1',
                           '--at', '0 silent 1'), ros.Observer() as observer:
        diagnostics, results = observer.diagnostics(str(port)), observer.results()
        heard = [observer.listen(Int16MultiArray, f'/abdf1/{topic}') for topic in (
            'read/ours', 'read/doors', 'read/counter', 'read/lamps')]
        with ros.Process('node', *ros.ros_args(f'net_file:={net}', f'map_file:={rows}',
                                               f'port:={port}')) as node:
            assert f'{port}: {COMES_BACK}' in node.wait_for('[ERROR]', COMES_BACK)
            speed = observer.publisher(Int16MultiArray, '/abdf1/write/speed')
            for value in range(1, 6):
                speed.publish(Int16MultiArray(data=[value]))
            observer.until(lambda: len(results) >= 5 or None, 'five results')
            ros.until_status(
                diagnostics, 'link', ros.ERROR, lambda status: COMES_BACK in status.message)
            assert 'inactive' in ros.until_status(diagnostics, 'station 1', ros.ERROR).message
            ros.until_status(diagnostics, 'mappings', ros.ERROR)
            status = ros.until_status(diagnostics, 'interlocks', ros.WARN)
            assert 'beat: heartbeat does not count' in status.message
            node.end()
    assert [list(inbox) for inbox in heard] == [[], [], [], []]
    assert not any('written' in result.message.split(':')[0].split()[:1] for result in results)


def test_rule_22_status_says_whether_ros_is_in_control_and_what_is_missing(cell: Cell) -> None:
    plc = cell.plcs[1]
    ladder = PageLadder(plc.table, 150)
    plc.run_ladder(ladder)
    head, *rows = MAP.replace(',7,400', ',0,400').splitlines()
    rows = [f'{head},Confirms', *(f'{row},' for row in rows),
            'ruled,Read,B12:0/2,1,SLC,50,,,,beat']
    cell.map.write_text('\n'.join(rows), encoding='utf-8')
    assert cell.call(Trigger, 'reload', Trigger.Request()).success
    ros.until_status(cell.diagnostics, 'interlocks', ros.WARN,
                     lambda status: 'ruled is 0: a person has to press reset' in
                     ros.details(status)['station 1'])

    def is_in_control() -> bool:
        ladder.press_reset()  # again after a lapse, as on a busy host
        plc.advance()
        status = ros.find_status(cell.diagnostics[-1], 'interlocks')
        return ladder.is_on(Lamp.IN_CONTROL) and status.level == ros.OK and \
            ros.details(status)['station 1'].startswith('in control for')

    cell.until(is_in_control, 'a reset that is accepted, and told')
