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

"""Values live, against PLCs on a pseudo-terminal."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from datetime import datetime
import io
from math import inf, nan
import os
from pathlib import Path
import re
import threading
import time

from abdf1_ros.cli.plc.data import mapping_of, Radix, Tags
from abdf1_ros.cli.plc.reading import NewReads, NoValue, WatchedRead
from abdf1_ros.cli.plc.watch import curve_of, LiveValues
from abdf1_ros.driver.checks import Checks, StationHealth
from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity, Mode
from abdf1_ros.pccc.values import Values
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.scaling import Scaling
from abdf1_ros.sniffer.dumps import Recording
from abdf1_ros.testing.plcs import Plcs
import pytest
from support.cases import for_all
from support.commands import Output
from support.driver_bench import store
from support.mappings import make_mapping
from support.ros import write_csv

SPEED = make_mapping('N7:0', item=1)
NOW = datetime(2026, 3, 1)
NAME = make_mapping('ST9:0', item=2)


@pytest.fixture
def plcs(tmp_path: Path) -> Iterator[Plcs]:
    path = write_csv(tmp_path / 'simulator.csv', 'Station,PLC_Type,Address,Length,Values',
                     ['1,PLC5,N7:0,4,', '1,PLC5,ST9:0,1,Tank'])
    with Plcs(path) as line:
        yield line


def network_on(plcs: Plcs, timeout: int = 1000) -> Network:
    return Network(com_port=plcs.port, baud=115200, timeout=timeout, nak_retries=0)


class Counting(LiveValues):
    """A watch that raises N7:0 by one after each read, and loses the line after some."""

    def __init__(self, plcs: Plcs, reads: int = 1000) -> None:
        super().__init__(network_on(plcs), [SPEED], 0.01)
        self._plcs = plcs
        self._left = reads

    def read(self, mapping: Mapping, values: Values) -> None:
        super().read(mapping, values)
        store(self._plcs[1], 'N7:0', [values[0] + 1])
        self._left -= 1
        if self._left == 0:
            self._plcs.lose()


def shown(capsys: Output) -> list[str]:
    """Return the lines without their times, which have milliseconds."""
    lines = capsys.readouterr().out.splitlines()
    assert all(re.match(r'\d\d:\d\d:\d\d\.\d{3}  ', line) for line in lines)
    return [line[14:] for line in lines]


def test_every_change_is_shown_with_its_time(plcs: Plcs, capsys: Output) -> None:
    assert Counting(plcs).run(5) == 0
    assert shown(capsys)[:5] == [f'N7:0  {number}' for number in range(5)]


def test_what_stays_is_shown_once(plcs: Plcs, capsys: Output) -> None:
    assert LiveValues(network_on(plcs), [SPEED, NAME], 0.01).run(4) == 0
    assert sorted(shown(capsys)) == ['N7:0  0', "ST9:0  'Tank'"]


def test_reads_that_the_output_does_not_take_are_counted(
        plcs: Plcs, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.cli.plc.reading.MAX_NEWS', 2)
    news = NewReads()
    for value in range(5):
        news.add(SPEED, array('h', [value]))
    news.hand_over(LiveValues(network_on(plcs), [SPEED], 0.01).show)
    assert capsys.readouterr().err == 'plc: 3 reads lost: this output was too slow\n'


def test_control_characters_of_a_plc_do_not_reach_the_screen(plcs: Plcs, capsys: Output) -> None:
    store(plcs[1], 'ST9:0', 'a\x1b[2J\x9b')
    assert LiveValues(network_on(plcs), [NAME], 0.01).run(1) == 0
    assert shown(capsys) == [r"ST9:0  'a\x1b[2J\x9b'"]


def test_lost_line_is_shown(plcs: Plcs, capsys: Output) -> None:
    assert Counting(plcs, reads=3).run(4) == 1  # the loss counts like a read that fails
    lines = shown(capsys)
    assert lines[:3] == [f'N7:0  {number}' for number in range(3)]
    assert lines[3].startswith('N7:0  no value: ')
    assert len(lines) == 4


def test_loss_is_shown_also_if_the_thread_of_the_link_is_late(
        plcs: Plcs, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    add = NewReads.add

    def add_late(news: NewReads, mapping: Mapping, what: Values | NoValue) -> None:
        if isinstance(what, NoValue):
            time.sleep(0.3)
        add(news, mapping, what)

    monkeypatch.setattr(NewReads, 'add', add_late)
    assert Counting(plcs, reads=3).run(4) == 1
    assert [line.partition(': ')[0] for line in shown(capsys)] == [
        'N7:0  0', 'N7:0  1', 'N7:0  2', 'N7:0  no value']


def test_silent_station_is_shown(plcs: Plcs, capsys: Output) -> None:
    plcs.say('silent 1')
    assert LiveValues(network_on(plcs, 100), [SPEED], 0.01).run(2) == 1
    assert shown(capsys) == [
        'N7:0  no value: 2509 ERR_INACTIVE_STATION: Slave Station (1) Inactive']


def test_interrupt_of_the_start_leaves_no_thread(
        plcs: Plcs, monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[LinkThread] = []

    class Interrupted(LinkThread):

        def start(self) -> None:
            begun.append(self)
            self.daemon = True  # or a thread that is left would hold up the end of all tests
            super().start()
            raise KeyboardInterrupt

    monkeypatch.setattr('abdf1_ros.cli.plc.reading.LinkThread', Interrupted)
    watch = LiveValues(network_on(plcs), [SPEED], 0.01)
    with suppress(KeyboardInterrupt):
        watch.run(1)
    assert not any(thread.is_alive() for thread in begun)


Draw = Callable[..., list[str]]


@pytest.fixture
def draw(monkeypatch: pytest.MonkeyPatch) -> Draw:
    """Return what gives the lines of the table of a watch after some news."""
    def lines_of(mappings: Sequence[Mapping], *news: tuple[Mapping, Values | NoValue],
                 size: tuple[int, int] = (100, 9), encoding: str = 'utf-8',
                 tags: Tags | None = None, radix: Radix = Radix.DECIMAL) -> list[str]:
        screen = io.TextIOWrapper(io.BytesIO(), encoding, errors='backslashreplace')
        with monkeypatch.context() as patch:
            patch.setattr('abdf1_ros.cli.plc.reading.opened', lambda *args: None)
            watch = LiveValues(Network(), mappings, 0.01, radix, tags=tags)
            patch.setattr('sys.stdout', screen)
            patch.setattr('shutil.get_terminal_size', lambda: os.terminal_size(size))
            for each in news:
                watch.note_changes([WatchedRead(NOW, *each)])
            watch.redraw()
            screen.flush()
        text = screen.buffer.getvalue().decode(encoding)  # type: ignore[attr-defined]
        return text.replace('\x1b[K', '').removesuffix('\x1b[J').splitlines()
    return lines_of


class Screen:
    """The lines of a terminal after text with the sequences that move, erase to the end, home."""

    def __init__(self, *lines: str) -> None:
        self.lines = [*lines, '']
        self._row = len(lines)

    def take(self, text: str) -> None:
        for part in re.split('(\x1b\\[\\d*[A-Z]|\n)', text):
            if part == '\n':
                self._row += 1
                self.lines += [''] * (self._row == len(self.lines))
            elif match := re.fullmatch(r'\x1b\[(\d*)([A-Z])', part):
                self._move(int(match[1] or 1), match[2])
            elif part:
                self.lines[self._row] = part + self.lines[self._row][len(part):]

    def _move(self, count: int, final: str) -> None:
        self._row = {'A': max(self._row - count, 0), 'H': 0}.get(final, self._row)
        if final in 'KJ':
            self.lines[self._row] = ''
        if final == 'J':
            del self.lines[self._row + 1:]


def test_age_counts_on_while_the_port_is_lost(
        draw: Draw, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('abdf1_ros.cli.plc.watch.line_time', lambda: 110.5)
    monkeypatch.setattr(ReadPoint, 'age', lambda self, now: now - 100.0)
    assert any(' 10.5 ' in line for line in draw([SPEED], (SPEED, NoValue('port lost'))))


def test_nothing_old_stays_below_a_table_that_shrinks(
        monkeypatch: pytest.MonkeyPatch, capsys: Output) -> None:
    screen = Screen('$ plc watch N7:0 C5:0.ACC')
    monkeypatch.setattr('abdf1_ros.cli.plc.reading.opened', lambda *args: None)
    rows = SPEED, make_mapping('C5:0.ACC', item=2)

    def show(size: tuple[int, int], *news: tuple[Mapping, Values | NoValue]) -> list[str]:
        monkeypatch.setattr('shutil.get_terminal_size', lambda **_: os.terminal_size(size))
        watch.note_changes([WatchedRead(NOW, *each) for each in news])
        watch.redraw()
        screen.take(capsys.readouterr().out)
        return [' '.join(line.split()) for line in screen.lines if line.strip()]

    watch = LiveValues(Network(), rows, 0.01)
    fault = NoValue('2509 ERR_INACTIVE_STATION: Slave Station (1) Inactive')
    assert show((60, 5), *((row, fault) for row in rows))[2:] == [
        'N7:0 1 int16 no value: 2509', 'ERR_INACTIVE_STATION:',
        '+6 more; a higher window shows them']
    healed = show((60, 5), *((row, array('h', [5])) for row in rows))
    assert healed[1:] == [
        'address station type age s value', 'N7:0 1 int16 * 5', 'C5:0.ACC 1 int16 * 5']
    assert show((60, 5)) == healed
    # What a narrower window did with the lines before is not known: it begins at its top.
    assert show((52, 9)) == healed[1:]
    watch.counters.nak_retries, watch.counters.enq_retries = 1, 2
    assert show((52, 4))[-2:] == [
        '+2 more; a higher window shows them', 'line: 3 repeated, 0 damaged']
    watch.counters.bcc_errors, watch.counters.crc_errors = 3, 4
    monkeypatch.setattr('abdf1_ros.cli.plc.watch.MARKED', 0.0)  # as after its second
    assert show((60, 9))[-2:] == ['C5:0.ACC 1 int16 5', 'line: 3 repeated, 7 damaged']


def test_table_marks_changes_and_says_what_does_not_fit(draw: Draw) -> None:
    words = make_mapping('N7:0', length=4), make_mapping('N7:9', item=2), SPEED
    news = [(words[0], array('h', [1, 2, 3, 4])), (words[0], array('h', [-200, 2, 3, 4])),
            *((words[1], array('h', [5])) for _ in range(2))]
    _, *lines = draw(words, *news, size=(52, 6))
    assert lines == ['N7:0           1  int16         *  -200     2     3',
                     'N7:3                                  4',
                     'N7:9           1  int16            5', 'N7:0           1  int16']
    assert draw(words, *news, size=(52, 5))[1:] == [
        *lines[:2], '+2 more; a higher window shows them']
    assert draw(words, *news, size=(52, 1)) == ['+5 more; a higher window shows them']


def test_table_has_tags_beside_addresses(draw: Draw) -> None:
    cells = {'Command': 'Read', 'Station': '1', 'PLC_Type': 'PLC5'}
    words, speed = mapping_of('N7:8-10', cells), mapping_of('N7:0', cells, 2)
    lines = draw([words, speed], (words, array('h', [9, 2, 3])), (words, array('h', [1, 2, 3])),
                 tags={'N7:0': 'speed', 'N7:10': 'a_long_tag'}, size=(100, 6))
    assert [(line[:16], line[18:].split()[-1:]) for line in lines] == [
        ('address         ', ['value']), ('N7:8            ', ['1']), ('N7:9            ', ['2']),
        ('N7:10 a_long_tag', ['3']), ('N7:0 speed      ', ['int16'])]


def test_description_stands_where_there_is_room(draw: Draw) -> None:
    level = make_mapping('N7:0', tag='level', description='Tank level [%]')
    for width, title, end in ((100, 'description', 'Tank level [%]'), (48, 'value', '5 %'),
                              (54, 'description', 'Tank leve...')):
        head, line, _ = draw([level, SPEED], (level, array('h', [5])), size=(width, 9))
        assert head.endswith(title) and line.endswith(end), width


def test_number_has_a_curve_where_it_fits_and_can_be_shown(draw: Draw) -> None:
    news = [(SPEED, array('h', [value])) for value in (9, *range(1, 25), 12)]
    silence = (SPEED, NoValue('silent'))
    news = [*news[:-1], silence, (SPEED, NoValue('lost')), news[-1]]
    other = make_mapping('N7:99')
    head, line, _ = draw([SPEED, other], *news[:-1], (other, array('h', [99])), news[-1],
                         size=(75, 9))
    assert head.endswith('value, and its last 24 reads')
    assert line.endswith('*  12        3 ▁▁▂▂▂▃▃▃▄▄▄▅▅▅▆▆▆▇▇▇██ ▄ 24')
    for other in ({'size': (74, 9)}, {'encoding': 'latin-1'}):
        head, line = draw([SPEED], *news, **other)
        assert (head.split()[-1], line.split()[-1]) == ('value', '12')
    line = draw([SPEED], *news, radix=Radix.HEXADECIMAL)[1]
    assert (line.split()[-4], line[-4:]) == ('0003', '0018')


@for_all(('numbers', 'curve'), [
    ([], ''), ([5], ''), ([5, 5.0, 5], ''), ([nan, inf, -inf], ''), ([nan, 5, inf, 5], ''),
    ([1.0, 1.00000001], ''),  # the same as far as it is shown
    ([0, 7, 1], '0 ▁█▂ 7'), ([-32768, 32767, 0], '-32768 ▁█▅ 32767'),
    ([1, nan, 2, inf, -inf, 1], '1 ▁ █  ▁ 2'), ([True, False], '0 █▁ 1'),
    ([-3.4e38, 3.4e38], '-3.4e+38 ▁█ 3.4e+38')])
def test_curve_lies_between_its_lowest_and_highest_number(
        numbers: list[float], curve: str) -> None:
    assert curve_of(numbers, lambda number: f'{number:.7g}') == curve


def test_rows_of_a_map_have_their_own_tags_and_scaled_values(
        plcs: Plcs, tmp_path: Path, capsys: Output) -> None:
    store(plcs[1], 'N7:1', [125])
    row = make_mapping('N7:1', tag='height', scaling=Scaling(0.1, -2.0))
    capture = tmp_path / 'line.cap'
    watch = LiveValues(
        network_on(plcs), [row], 0.01, tags={'N7:1': 'another'}, record=str(capture))
    assert watch.run(1) == 0
    assert shown(capsys) == ['N7:1 height  10.5']
    assert capture.read_text('ascii').startswith('# abdf1_ros capture 1\n')
    assert list(Recording(capture).chunks())
    assert not [thread for thread in threading.enumerate() if thread.name == 'trace']


@pytest.mark.parametrize(('mode', 'text'), [
    (Mode.PROGRAM, 'PROG: its program does not run, values may stand still; memory lost'),
    (Mode.RUN, 'RUN'), (None, 'mode 0x0E; memory lost')])
def test_mode_of_each_plc_and_faults_of_the_line_stand_around_the_values(
        draw: Draw, monkeypatch: pytest.MonkeyPatch, mode: Mode | None, text: str) -> None:
    stopped = Identity(PlcType.PLC5, 'PLC-5/40', mode=mode,
                       faults=() if mode is Mode.RUN else ('memory lost',),
                       mode_text=mode.value if mode else 'mode 0x0E')
    monkeypatch.setattr(Checks, 'known', lambda self, station: StationHealth(
        str(stopped), stopped if station else None))
    lines = draw([SPEED, NAME], (SPEED, array('h', [5])), (NAME, 'Tank'))
    assert lines[0] == f'station 1: PLC-5/40, {text}'
    assert lines[1].startswith('address') and len(lines) == 4
    other = make_mapping('N7:0', station=0, item=3)  # of a PLC that has not told its mode yet
    assert draw([other, SPEED, NAME], size=(100, 2)) == lines[:1]
    monkeypatch.setattr(LiveValues, 'faults_of_line', lambda self: ['line: 3 repeated, 1 damaged'])
    assert draw([SPEED], (SPEED, array('h', [5])))[-1] == 'line: 3 repeated, 1 damaged'
