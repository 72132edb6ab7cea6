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

"""The monitor as a process, beside a bridge and its simulator."""

import codecs
from collections.abc import Callable, Iterator
from contextlib import contextmanager
import curses
import os
import pty
import re
import select
import signal
import termios
import time
from typing import Any
from unittest.mock import MagicMock, Mock

from abdf1_ros.cli.monitor.command import main, Screen
from abdf1_ros.cli.monitor.node import NodeWatch
from abdf1_ros.cli.monitor.view import Style, TextLine
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import pytest
from std_msgs.msg import UInt16MultiArray
from support.commands import call, Output
from support.forked import Forked
from support.ros import Observer, PATIENCE, Process
from support.simulator_process import Files, IMPATIENT_ROW, make_files, READS, STATUSES

NODE = '/cell/line_a'
ARGUMENTS = ('-r', '__ns:=/cell', '-r', '__node:=line_a')

# These would say how large a terminal is, whatever it is.
_SIZES = ('LINES', 'COLUMNS')


@pytest.fixture(scope='module')
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    return make_files(tmp_path_factory.mktemp('monitor'), IMPATIENT_ROW, period=500)


@pytest.fixture(scope='module')
def simulator(files: Files) -> Iterator[Process]:
    with files.start_simulator() as simulator, Process('node', *files.args(), *ARGUMENTS) as node:
        with Observer() as observer:
            observer.diagnostics(files.port).until_fresh()
        yield simulator
        node.end()


def test_one_picture_shows_every_topic_and_status(simulator: Process, capsys: Output) -> None:
    give_up = time.monotonic() + PATIENCE
    said = call(main, capsys, '--node', NODE, '--once')
    while re.search('STALE|WARN: |ERROR: |unknown', said.out) and time.monotonic() < give_up:
        said = call(main, capsys, '--node', NODE, '--once')  # the simulator stood still
    assert said.status == 0, said
    lines = said.out.splitlines()
    assert lines[0] == f'{NODE}  OK: of {len(READS)} mappings {len(READS)} fresh'
    assert re.fullmatch(r'  load \d+ %   cycle \d+ ms   stations 1 REM RUN, 2 REM RUN', lines[1])
    assert '\x1b' not in said.out  # no terminal, no colours
    for topic, (_, address, values) in READS.items():
        (line,) = [line for line in lines if line.split()[:1] == [topic]]
        shown = f'"{values}"' if isinstance(values, str) else ' '.join(map(str, values))
        assert line.endswith(shown.replace('.0', '')), line
        assert address in line
        assert ('any age' if topic == 'recipe' else 'fresh') in line
    # How much of the line's time a row takes is known when it has been read twice.
    assert len(re.findall(r'^  \S+ .* \d+\.\d%  ', said.out, re.MULTILINE)) > 0
    assert STATUSES[-1] == 'topics'  # shown only where another node publishes
    for status in STATUSES[:-1]:
        assert any(re.match(f' *{status} +OK: ', line) for line in lines), status
    assert re.search(r'\n +settings +115200 baud, 8 data bits, .*CRC', said.out)
    assert re.search(r'\n +line load +\d+ %\n', said.out)
    assert 'active stations: 1, 2' in said.out
    assert 'CNT_REPLY_MSGS_RCVD' in said.out


def test_pictures_follow_the_loss_of_a_station(simulator: Process) -> None:
    with Process('monitor', '--node', NODE, '--period', '0.2') as monitor:
        monitor.wait_for('heartbeat', 'fresh')
        simulator.say('silent 2')
        after = len(monitor.lines)
        monitor.wait_for('parts', 'STALE (>', after=after)
        monitor.wait_for('ERROR: station 2 inactive', after=after)
        monitor.wait_for('parts: ', 'failed: C5:2.ACC at station 2', after=after)
        monitor.wait_for('active stations: 1', after=after)
        after = len(monitor.lines)
        simulator.say('normal 2')
        monitor.wait_for('parts', 'fresh', after=after)
        monitor.end(signal.SIGTERM)


def test_it_ends_after_the_time_it_is_given(simulator: Process, capsys: Output) -> None:
    began = time.monotonic()
    assert call(main, capsys, '--node', NODE, '--seconds', '1', '--period', '0.1').status == 0
    assert time.monotonic() - began > 0.9
    # The time counts from when the bridge is found.
    assert NODE in call(main, capsys, '--node', NODE, '--seconds', '0.01').out


# On a terminal

PAGE_UP, PAGE_DOWN, CONTROL_L = '\x1b[5~', '\x1b[6~', '\x0c'


class Terminal:
    """A terminal that remembers what was drawn, and can press keys."""

    def __init__(self, *args: str, term: str = 'xterm-256color',
                 size: tuple[int, int] = (60, 120)) -> None:
        self._ours, theirs = pty.openpty()
        termios.tcsetwinsize(theirs, size)
        with pytest.MonkeyPatch.context() as environment:
            environment.setenv('TERM', term)
            for name in _SIZES:
                environment.delenv(name, raising=False)
            self.process = Forked('monitor', args, theirs)
        os.close(theirs)
        self.drawn = ''
        self._decoder = codecs.getincrementaldecoder('utf-8')()

    def _read(self) -> None:
        # What is read may end within a character.
        self.drawn += self._decoder.decode(os.read(self._ours, 65536))

    def wait_for(self, text: str) -> None:
        """Wait until ``text`` has been drawn after what has been waited for before."""
        end = time.monotonic() + PATIENCE
        while text not in self.drawn:
            left = max(0.0, end - time.monotonic())
            assert select.select([self._ours], [], [], left)[0], self.drawn
            self._read()
        self.drawn = self.drawn.partition(text)[2]

    def new(self) -> str:
        """Return what has been drawn since the last call, after waiting a little for it."""
        if select.select([self._ours], [], [], 0.1)[0]:
            self._read()
        drawn, self.drawn = self.drawn, ''
        return drawn

    def redraw_until(self, text: str, keys: str = '') -> None:
        """Wait until ``text`` is there when, after keys, all is drawn anew."""
        self.drawn, end = '', time.monotonic() + PATIENCE
        while text not in self.drawn:
            assert time.monotonic() < end, self.drawn
            self.drawn = ''
            self.press(keys + CONTROL_L)
            again = time.monotonic() + 1.0  # values that change are drawn without an end
            while text not in self.drawn and time.monotonic() < again:
                if select.select([self._ours], [], [], 0.1)[0]:
                    self._read()

    def press(self, keys: str) -> None:
        os.write(self._ours, keys.encode())

    def resize(self, rows: int, columns: int) -> None:
        termios.tcsetwinsize(self._ours, (rows, columns))
        self.process.send_signal(signal.SIGWINCH)

    def result(self) -> int:
        """Read until the process closes the terminal; return its exit status."""
        while select.select([self._ours], [], [], PATIENCE)[0]:
            try:
                self._read()
            except OSError:  # nobody has the other end open any more
                break
        return self.process.wait(PATIENCE)

    def close(self) -> None:
        self.process.kill()
        self.process.wait(PATIENCE)
        os.close(self._ours)


@contextmanager
def terminal(*args: str, **options: Any) -> Iterator[Terminal]:
    screen = Terminal(*args, **options)
    try:
        yield screen
    finally:
        screen.close()


def test_picture_is_drawn_in_place_and_keys_lead_to_its_parts(simulator: Process) -> None:
    with terminal('--node', NODE) as screen:
        screen.wait_for('\x1b[?1049h')  # the screen beside that of the shell
        screen.redraw_until('CRD_CHAR_RECV')
        screen.resize(8, 60)
        screen.wait_for(NODE)
        # As often as it takes, for the picture may grow meanwhile.
        screen.redraw_until('CRD_CHAR_RECV', 10 * PAGE_DOWN)
        screen.redraw_until(NODE, 10 * PAGE_UP)
        screen.resize(1, 1)
        screen.resize(8, 60)
        screen.redraw_until(NODE)
        screen.redraw_until('counters', 'c')
        screen.redraw_until('115200 baud', 'l')
        screen.redraw_until('active stations', 's')
        screen.redraw_until(NODE, 'v')
        screen.press('q')
        assert screen.result() == 0
        assert '\x1b[?1049l' in screen.drawn
        assert 'Traceback' not in screen.drawn


def test_what_counts_is_on_a_screen_of_80_by_24(simulator: Process) -> None:
    pyte = pytest.importorskip('pyte')
    screen = pyte.Screen(80, 24)
    stream = pyte.Stream(screen)
    with terminal('--node', NODE, term='vt220', size=(24, 80)) as shown:
        end = time.monotonic() + PATIENCE
        while not ('any age' in '\n'.join(screen.display) and '▁▁' in '\n'.join(screen.display)
                   and screen.display[1].startswith('  load ')  # diagnostics come later
                   and all(line.strip() for line in screen.display)):  # the picture is whole
            assert time.monotonic() < end, screen.display
            stream.feed(shown.new())
        told = [line.rstrip() for line in screen.display]
    assert told[0].startswith(f'{NODE}  ')
    assert told[1].startswith('  load ') and 'stations 1 REM RUN, 2 REM RUN' in told[1]
    assert told[2].split() == ['topic', 'age', 'state', 'load', 'last', '24', 's', 'value']
    # The topics of this bridge are 25, in their order.
    assert [line.split()[0] for line in told[3:23]] == sorted(READS)[:20]
    assert re.fullmatch(r'1-23 of \d+  q:end .* c:counters', told[23])


def test_line_is_chosen_from_all_and_q_leads_back(simulator: Process) -> None:
    with terminal('--all') as screen:
        screen.wait_for(f'{NODE} ')
        screen.press('\r')
        screen.wait_for('115200 baud')
        screen.press('q')
        screen.wait_for('Return shows a line')
        screen.wait_for(f'{NODE} ')
        screen.press('q')
        assert screen.result() == 0
        assert 'Traceback' not in screen.drawn


class Window:
    """As much of a curses window as a list needs; ``keys`` are pressed one after the other."""

    def __init__(self) -> None:
        self.keys: list[int] = []
        self.calls: list[str] = []
        self.drawn: dict[int, tuple[str, int]] = {}

    def addnstr(self, row: int, column: int, text: str, width: int, look: int) -> None:
        self.drawn[row] = text, look
        self.calls.append('addnstr')

    def getmaxyx(self) -> tuple[int, int]:
        return 24, 80

    def getch(self) -> int:
        return self.keys.pop(0) if self.keys else -1

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *args: self.calls.append(name)


def test_keys_move_the_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('curses.has_colors', lambda: False)
    window = Window()
    screen = Screen(window)  # type: ignore[arg-type]
    names = {30: 'link', 31: 'reasons', 34: 'writes'}
    picture = [TextLine(f'line {row}', section=names.get(row, '')) for row in range(60)]
    for keys, first, last in (
            ([], 0, 22), ([curses.KEY_DOWN, curses.KEY_DOWN], 2, 24), ([curses.KEY_UP], 1, 23),
            ([curses.KEY_NPAGE], 23, 45), ([ord(' ')], 37, 59), ([curses.KEY_PPAGE], 15, 37),
            ([ord('l')], 30, 52), ([ord('r')], 31, 53), ([ord('w')], 34, 56), ([ord('l')], 30, 52),
            ([ord('v'), ord('x'), -1, ord('q')], 30, 52),
            ([curses.KEY_END], 37, 59), ([curses.KEY_HOME, curses.KEY_DOWN], 1, 23)):
        window.keys = keys
        assert not screen.wants_end()
        screen.show(picture)
        assert [window.drawn[row][0] for row in (0, 22, 23)] == [
            f'line {first}', f'line {last}', f'{first + 1}-{last + 1} of 60  q:end v:values '
            'r:reasons w:writes l:link s:stations c:counters']
    for count, shown in ((0, '0-0 of 0  '), (3, '1-3 of 3  ')):
        window.calls = []
        screen.show(picture[:count])
        assert window.calls == ['erase', *(count + 1) * ['addnstr'], 'refresh']
        assert window.drawn[23][0].startswith(shown)
    window.keys = [12, curses.KEY_RESIZE, ord('l'), ord('q')]  # the part is not there any more
    assert screen.wants_end() and window.calls[-2:] == 2 * ['clearok']
    screen.show(picture)
    assert window.drawn[0][0] == 'line 0'


def test_lines_have_the_colours_of_their_styles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv('NO_COLOR', raising=False)
    for name in ('has_colors', 'use_default_colors', 'init_pair'):
        monkeypatch.setattr(f'curses.{name}', pairs := Mock())
    monkeypatch.setattr('curses.color_pair', lambda number: number << 8)
    looks, window = [], Window()
    for _ in range(2):
        screen = Screen(window)  # type: ignore[arg-type]
        screen.show([TextLine(style.value, style) for style in Style])
        looks.append([window.drawn[row][1] for row in range(len(Style))])
        monkeypatch.setenv('NO_COLOR', '')
    green, yellow, red = 2, 3, 1
    assert looks == [[0, curses.A_BOLD, green << 8, yellow << 8, red << 8],
                     [0, curses.A_BOLD, 0, 0, 0]]
    assert [call.args for call in pairs.call_args_list] == [
        (number, number, -1) for number in (green, yellow, red)]


def test_mark_stays_at_its_line_where_others_come(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('curses.has_colors', lambda: False)
    window = Window()
    screen = Screen(window, marked='paint')  # type: ignore[arg-type]

    def chosen(names: str, *keys: int) -> str | None:
        screen.show_list([TextLine('heading'), *(
            TextLine(name, Style.TITLE, name) for name in names.split())])
        window.keys = [*keys]
        return screen.chosen if screen.wants_other_list() else None

    assert chosen('', ord('\n')) is None
    assert chosen('packing paint press', ord('\n')) == 'paint'
    assert chosen('glue packing paint press', ord('\n')) == 'paint'
    assert chosen('glue packing paint press', *3 * [curses.KEY_UP]) is None
    assert chosen('glue packing paint press', ord('\n')) == 'glue'
    assert chosen('packing paint', ord('\n')) == 'packing'
    plant = ' '.join(f'line{number}' for number in range(60))  # 22 of them fit
    for key in (curses.KEY_HOME, curses.KEY_NPAGE):
        assert chosen(plant, key) is None
    assert chosen(plant, ord('\n')) == 'line21'
    bold, marked = curses.A_BOLD, curses.A_BOLD | curses.A_REVERSE
    assert {('line20', bold), ('line21', marked)} <= {*window.drawn.values()}
    assert [chosen(plant, key) for key in (curses.KEY_END, ord('\n'), curses.KEY_UP, ord('\n'))
            ] == [None, 'line59', None, 'line58']
    assert {('line58', marked), ('line59', bold)} <= {*window.drawn.values()}
    assert [chosen(plant, key) for key in (curses.KEY_HOME, ord('\n'))] == [None, 'line0']
    assert window.drawn[1] == ('line0', marked)


def test_line_stays_marked_while_its_picture_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ('PlantWatch', 'NodeWatch', 'is_screen'):
        monkeypatch.setattr(f'abdf1_ros.cli.monitor.command.{name}', MagicMock())
    monkeypatch.setattr('curses.wrapper', drawn := Mock(side_effect=['/b', None, '']))
    monkeypatch.setattr('abdf1_ros.cli.monitor.command.time', clock := Mock())
    clock.monotonic.side_effect = [5.0]  # --seconds count from the start
    assert main(['--all', '--seconds', '9']) == 0
    assert [call.args[3:] for call in drawn.call_args_list] == [('',), (), ('/b',)]


def test_signal_ends_each_wait_for_all_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    heard = list[bool]()
    plant = MagicMock(lines=list, is_complete=False, wait=lambda has_ended, limit: heard.append(
        signal.raise_signal(signal.SIGINT) or has_ended()))
    watch = MagicMock(return_value=MagicMock(__enter__=lambda _: plant))
    monkeypatch.setattr('abdf1_ros.cli.monitor.command.PlantWatch', watch)
    monkeypatch.setattr('abdf1_ros.cli.monitor.command.limit_output', lambda: None)
    assert (main(['--all', '--once']), heard) == (0, 3 * [True])


def test_signal_gives_the_terminal_back(simulator: Process) -> None:
    with terminal('--node', NODE) as screen:
        screen.wait_for('1 0 0 1 1 0')
        screen.process.send_signal(signal.SIGTERM)
        assert screen.result() == 0
        assert '\x1b[?1049l' in screen.drawn


def test_terminal_that_cannot_move_its_cursor_gets_plain_pictures(simulator: Process) -> None:
    with terminal('--node', NODE, '--period', '0.1', term='no-such-terminal') as screen:
        screen.wait_for(f'{NODE}  ')
        screen.process.send_signal(signal.SIGINT)
        assert screen.result() == 0


def test_one_picture_has_colours_on_a_terminal(
        simulator: Process, monkeypatch: pytest.MonkeyPatch) -> None:
    with terminal('--node', NODE, '--once') as screen:
        assert screen.result() == 0
        shown = re.search(r'\x1b\[(\d+)m  link +(OK|WARN|ERROR): ', screen.drawn)
        assert shown  # a busy host may let the simulator stand still
        assert shown[1] == {'OK': '32', 'WARN': '33', 'ERROR': '31'}[shown[2]]
        assert '▁' in screen.drawn
    monkeypatch.setenv('NO_COLOR', '1')
    with terminal('--node', NODE, '--once', term='linux') as screen:
        assert screen.result() == 0
        assert 'OK: ' in screen.drawn
        assert screen.drawn.isascii()
        assert '\x1b' not in screen.drawn


# What is refused


Refused = Callable[..., list[str]]


@pytest.fixture
def refused(capsys: Output) -> Refused:
    """Return what runs a monitor that refuses, and returns all that it says."""
    def run(status: int, *args: str) -> list[str]:
        said = call(main, capsys, *args)
        assert said.status == status, said
        return said.err.splitlines()

    return run


def test_a_node_that_is_not_there_is_said_with_those_that_are(
        simulator: Process, refused: Refused, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.cli.monitor.command.PROGRESS_PERIOD', 0.2)
    monkeypatch.setattr(NodeWatch, 'bridges', lambda self: ['/a', NODE])
    *progress, told = refused(1, '--node', '/abdf1', '--wait', '3')
    assert 1 <= len(progress) <= 15  # one in 0.2 s
    assert all('monitor: looking for /abdf1, ' in line for line in progress)
    assert told.endswith('there is no node /abdf1 within 3 s: --node may be one of /a, ' + NODE)
    monkeypatch.setattr('abdf1_ros.cli.monitor.command.limit_output', lambda: None)
    monkeypatch.setattr(NodeWatch, 'wait', lambda *_: signal.raise_signal(signal.SIGINT))
    assert refused(0, '--node', '/abdf1') == []  # the user ends the search


def test_reason_is_told_for_a_node_that_is_not_heard(
        refused: Refused, monkeypatch: pytest.MonkeyPatch) -> None:
    with Observer() as observer:
        observer.node.create_publisher(UInt16MultiArray, '/ghost/active_stations', 1)
        assert refused(1, '--node', 'ghost', '--wait', '4')[-1] == (
            'monitor: /ghost is visible, but sent no message within 4 s: programs on one '
            'machine must run as the same user')
        publisher = observer.node.create_publisher(DiagnosticArray, '/diagnostics', 1)
        status = DiagnosticStatus(name='lines: lines', values=[KeyValue(key='/gone', value='why')])

        def wait(watch: NodeWatch, *_: object) -> None:
            publisher.publish(DiagnosticArray(status=[status]))
            watch.spin_once(0.1)
            return None if watch.stopped else wait(watch)

        monkeypatch.setattr(NodeWatch, 'wait', wait)
        assert refused(1, '--node', 'gone', '--wait', '0.1')[-1] == (
            'monitor: /gone does not run: why')


@pytest.mark.parametrize(('args', 'text'), [
    (('--node', 'a b'), 'it should be like /abdf1'),
    (('--seconds', 'soon'), '"soon" should be a number of seconds above 0'),
    (('--period', '0'), '"0" should be a number of seconds above 0'),
    (('--wait', 'nan'), '"nan" should be a number of seconds above 0'),
    (('--ros-args', '-p', 'x'), "Couldn't parse"),
    (('--ros-args', '--log-lvl', 'x'), 'did you mean --log-level?'),
    (('--ros-args', 'a:=b'), '-p is missing before'),
])
def test_bad_options_are_refused_in_one_line(
        args: tuple[str, ...], text: str, refused: Refused) -> None:
    assert text in refused(2, *args)[0]
