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

"""A line of text for each bridge."""

from collections.abc import Callable, Iterator
from dataclasses import replace
import signal
import time
from unittest.mock import Mock

from abdf1_ros.cli.monitor import view
from abdf1_ros.cli.monitor.command import main
from abdf1_ros.cli.monitor.node import Listening
from abdf1_ros.cli.monitor.plant import LineState, PlantWatch, render_plant
from abdf1_ros.cli.monitor.view import ShownStatus, SILENCE, Style
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import pytest
from rclpy.node import Node
from support.commands import call, Output, Said
from support.ros import ERROR, Observer, OK, PATIENCE

NOW = 1000.0
LINK = ShownStatus('link', Style.GOOD, 'OK: port open',
                   {'line load': '93 %', 'poll cycle with Periods': '34 ms'})
FRESH = ShownStatus('mappings', Style.GOOD, 'OK: of 10 mappings 10 fresh', {'line load': '0 %'})
SILENT = ShownStatus('station 3', Style.BAD, 'ERROR: station 3 inactive for 4.0 s')
REFUSED = ShownStatus('writes', Style.WARNING, 'WARN: 3 of 4 writes confirmed')


def line(name: str, *statuses: ShownStatus, told: float = NOW) -> LineState:
    return LineState(name, told, (LINK, *statuses, FRESH))


def texts(*lines: LineState, width: int = 80) -> list[str]:
    return [' '.join(found.text.split()) for found in render_plant(lines, NOW, width)]


def test_worst_come_first_and_say_why() -> None:
    assert texts(line('/10'), line('/b', SILENT, REFUSED), line('/c', REFUSED), line('/2'),
                 line('/d', told=NOW - 5.0)) == [
        '5 lines: 2 OK, 1 WARN, 2 ERROR', 'line state load cycle',
        '/b ERROR 93 % 34 ms station 3: station 3 inactive for 4.0 s',
        '/d ERROR 93 % 34 ms no diagnostics for 5 s',
        '/c WARN 93 % 34 ms writes: 3 of 4 writes confirmed',
        '/2 OK 93 % 34 ms of 10 mappings 10 fresh', '/10 OK 93 % 34 ms of 10 mappings 10 fresh']


def test_line_that_is_not_heard_any_more_is_bad() -> None:
    seldom = replace(LINK, section='link', values={'diagnostics period': '10 s'})
    assert [texts(line('/a', seldom, told=NOW - age))[0] for age in (12.0, 12.1)] == [
        '1 line: 1 OK', '1 line: 1 ERROR']


def test_no_line_at_all() -> None:
    assert texts() == ['no line is heard; diagnostics come every second', 'line state load cycle']


@pytest.mark.parametrize(('width', 'name'), [
    (20, '/a_...'), (40, '/a_hall_of...'), (80, '/a_hall_of_some_size/an...'),
    (120, '/a_hall_of_some_size/and_a_pres...')])
def test_lines_are_no_longer_than_the_terminal_is_wide(width: int, name: str) -> None:
    found = render_plant([line('/a_hall_of_some_size/and_a_press_of_a_name', SILENT)], NOW, width)
    assert max(len(shown.text) for shown in found) <= width
    assert found[-1].text.startswith(f'  {name}  ')
    assert found[-1].section == '/a_hall_of_some_size/and_a_press_of_a_name'


def array(node: str, **sections: bytes) -> DiagnosticArray:
    return DiagnosticArray(status=[DiagnosticStatus(name=f'{node}: {section}', level=level)
                                   for section, level in sections.items()])


Publish = Callable[..., None]


@pytest.fixture
def publish() -> Iterator[Publish]:
    """Publish diagnostics until a watch has told what a test waits for."""
    with Observer() as observer:
        node = Node('bridges', context=observer.context)
        publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)

        def until(watch: PlantWatch, condition: Callable[[dict[str, LineState]], object],
                  *arrays: DiagnosticArray) -> None:
            def look() -> bool:
                for message in arrays:
                    publisher.publish(message)
                watch.spin_once(0.05)
                return bool(condition({line.name: line for line in watch.lines()}))

            observer.until(look, lambda: str(watch.lines()))

        yield until
        node.destroy_node()


def test_bridges_are_heard_and_others_are_not(
        publish: Publish, monkeypatch: pytest.MonkeyPatch) -> None:
    down = array('lines', lines=ERROR)
    down.status[0].values = [KeyValue(key='running', value='1'), KeyValue(key='/hall/c'),
                             KeyValue(key='/hall/b', value='b_net.csv:2:1: Baud')]
    with PlantWatch([]) as watch:
        publish(watch, lambda lines: set(lines) == {'/hall/a', '/hall/b', '/hall/c'} and
                'not run' in str(lines['/hall/b']), DiagnosticArray(), array('battery', link=OK),
                *(array(f'hall/{name}', link=OK, mappings=ERROR) for name in 'ab'), down)
        lines = {line.name: line.worst(line.told) for line in watch.lines()}
        for name in 'ad':
            monkeypatch.setattr(watch, 'bridges', lambda: [f'/hall/{name}'])  # noqa: B023
            assert watch.is_complete is (name == 'a')
    assert lines['/hall/a'] == ShownStatus('mappings', Style.BAD, '')
    assert lines['/hall/b'] == ShownStatus('', Style.BAD, 'does not run: b_net.csv:2:1: Baud')


def test_spares_stand_beside_the_line_that_has_an_owner(
        publish: Publish, monkeypatch: pytest.MonkeyPatch) -> None:
    waiting = [array(f'hall/{name}', standby=OK) for name in 'abb']
    for message, host in zip(waiting, ('beta', 'gamma', 'alpha'), strict=True):
        message.status[0].values = [KeyValue(key='host', value=host)]
    nobody = 'no bridge has the line; waiting: '
    with PlantWatch([]) as watch:
        publish(watch, lambda lines: f'{nobody}alpha, gamma' in str(lines.get('/hall/b'))
                and nobody not in str(lines.get('/hall/a', nobody)) and lines['/hall/a'].spares,
                array('hall/a', link=OK, mappings=OK), *waiting)
        lines = {line.name: line for line in watch.lines()}
        assert lines['/hall/a'].spares == ['beta']
        monkeypatch.setattr(watch, 'bridges', lambda: ['/hall/b'])
        assert watch.is_complete
        assert lines['/hall/a'].worst(lines['/hall/a'].told).style is Style.GOOD
        monkeypatch.setattr(view, 'SILENCE', 0.3)  # for so long there is no owner
        publish(watch, lambda lines: f'{nobody}beta' in str(lines['/hall/a']), waiting[0])
        before = time.monotonic
        monkeypatch.setattr(time, 'monotonic', lambda: before() + SILENCE)
        assert {line.name: line.spares for line in watch.lines()} == {'/hall/a': []}
        publish(watch, lambda lines: f'{nobody}beta' in str(lines['/hall/a']), waiting[0])


def test_spare_is_named() -> None:
    assert texts(replace(line('/a'), spares=['beta']))[2] == \
        '/a OK 93 % 34 ms of 10 mappings 10 fresh; spare: beta'


def test_nobody_is_heard(capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    give_up = time.monotonic() + PATIENCE  # a bridge of a test before may not have left yet
    while (said := call(main, capsys, '--all', '--wait', '0.1', '--seconds', '0.2')
           ).status == 0 and time.monotonic() < give_up:
        pass
    assert (said.status, said.out.splitlines()[0]) == (
        1, 'no line is heard; diagnostics come every second')
    monkeypatch.setattr('abdf1_ros.cli.monitor.command.limit_output', limited := Mock())
    monkeypatch.setattr(Listening, 'wait', lambda self, until, seconds: seconds in (9, 0.1) and
                        signal.raise_signal(signal.SIGINT))  # between two pictures, in the search
    said = call(main, capsys, '--all', '--period', '9')
    assert (said.status, said.out.count('no line'), limited.call_count) == (0, 1, 1)
    assert call(main, capsys, '--node', '/x') == Said(0, '', '')
    monkeypatch.setattr('abdf1_ros.cli.terminal.drop_output', Mock())
    for error, status in ((BrokenPipeError(), 0), (OSError(28, 'full'), 2)):
        monkeypatch.setattr('builtins.print', Mock(side_effect=error))
        assert call(main, capsys, '--all', '--once').status == status


def test_one_picture_waits_for_visible_bridges(
        capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    waits = []
    monkeypatch.setattr(PlantWatch, 'bridges', lambda self: ['/seldom'])
    monkeypatch.setattr(PlantWatch, 'wait', lambda self, until, seconds: waits.append(
        (until(), seconds)))
    call(main, capsys, '--all', '--once', '--wait', '7')
    assert waits == [(False, 7), (False, 3), (False, 7)]
