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

"""The picture of a plan: what is drawn, in a real browser too, and what cannot get into it."""

from pathlib import Path

from abdf1_ros.cli.check import main
from abdf1_ros.cli.lanes import Bar, drawing, Lane, Look, NAMES
import pytest
from support import browser
from support.commands import call, Output, Said
from support.ros import write_csv

NET_HEADER = 'Station,Mode,Baud,Com_Port'
MAP_HEADER = 'Tag,Command,Address,Station,PLC_Type,Length,Period,Description'
ROWS = ('speed,Read,N7:0,1,PLC5,2,1000,', 'level,Read,F8:0,1,PLC5,3,2000,',
        'parts,Read,C5:2.ACC,2,SLC,,500,')
HASTY = 'hasty,Read,N10:0,3,SLC,100,50,'
EVIL = '"<script>document.title=1</script><img src=x onerror=alert(1)>"'

RED, BLUE = (0xC6, 0x28, 0x28), (0x2F, 0x6D, 0xB5)


def drawn(folder: Path, capsys: Output, rows: tuple[str, ...] = ROWS,
          net: str = '5,Master,9600,1') -> tuple[Said, Path]:
    """Return what check says, and the page that it has written."""
    page = folder / 'plan.html'
    net_file = write_csv(folder / 'net.csv', NET_HEADER, [net])
    map_file = write_csv(folder / 'map.csv', MAP_HEADER, rows)
    return call(main, capsys, str(net_file), str(map_file), '--html', str(page)), page


def elements(page: Path) -> browser.Elements:
    return browser.Elements(page.read_text(encoding='utf-8'))


def test_each_station_has_a_lane_and_each_read_a_bar_as_long_as_it_takes(
        tmp_path: Path, capsys: Output) -> None:
    said, page = drawn(tmp_path, capsys)
    assert said.status == 0
    found = elements(page)
    assert {'station 1', 'station 2'} <= {*found.texts}
    assert found.bars('ask') == 2 * len(ROWS)  # in the cycle, and in what the Periods need
    assert found.bars('wait') == len(ROWS)
    asked, waited = ([each for _, each in found.found if each.get('class') == look and 'x' in each]
                     for look in ('ask', 'wait'))
    assert len({each['x'] for each in asked}) == 2 * len(ROWS) - 1  # both begin with a bar at 0
    assert float(asked[1]['x']) == pytest.approx(
        float(waited[0]['x']) + float(waited[0]['width']), abs=0.2)
    assert found.bars('bad') == found.bars('small') == 0
    assert not any(text.startswith('Reads with Period 0') for text in found.texts)
    assert ('p', {'class': 'verdict is-good'}) in found.found
    for begin in ('every Period can be kept; load', 'expected poll cycle: '):
        assert any(text.startswith(begin) for text in found.texts)
    (told,) = {text for text in found.texts if text.startswith('station 1, F8:0 to F8:2: ')}
    assert told.endswith(' of the time; level')


def test_shares_of_the_line_and_the_table_tell_all_reads(tmp_path: Path, capsys: Output) -> None:
    _, page = drawn(tmp_path, capsys, (
        'speed,Read,N7:0,1,PLC5,2,1000,', 'free,Read,N7:0,4,SLC,,0,',
        'alive,Heartbeat,N10:0,1,PLC5,,,'))
    found = elements(page)
    at = found.texts.index('What the Periods need of the time there is')
    told = [text for text in found.texts[at:] if text.strip()]
    heads = told.index('Reads')
    assert told[told.index('%') + 1:heads] == [
        'station 1, N10:0: 1 word in 72.1 ms; Period 500 ms; 14.4% of the time; alive', '1: N10:0',
        'station 1, N7:0 to N7:1: 2 words in 74.2 ms; Period 1000 ms; 7.4% of the time; speed',
        '1: N7:0', 'heartbeats and questions for the mode: 11.2 % of the time',
        'Reads with Period 0 have the time that is left.']
    assert ' '.join(told[heads:told.index('In words')]) == (
        'Reads station from to words packets line ms total ms Period ms expected ms line tags '
        '1 N7:0 N7:1 2 1 54.2 74.2 1000 1000 7.4% speed '
        '1 N10:0 N10:0 1 1 52.1 72.1 500 500 14.4% alive 4 N7:0 N7:0 1 1 44.8 64.8 0 97 0.0% free')
    assert 'station 4, N7:0: 1 word in 64.8 ms; Period 0; 0.0% of the time; free' in found.texts
    assert [(bar['x'], bar['width']) for tag, bar in found.found
            if tag == 'rect' and 'x' in bar][-3:] == [
        ('110.0', '148.5'), ('258.5', '76.4'), ('334.9', '115.7')]


def test_bars_are_in_proportion_to_their_times() -> None:
    svg = browser.Elements(drawing([Lane('a', [
        Bar(520, 540, Look.ASK, 'x', ('n' * 40, 'f' * 39)),
        Bar(540, 600, Look.WAIT, 'y', row=1)], rows=2)], 520, 600, 'ms', limit=540))
    (first,), (second,), (limit,) = ([rect for _, rect in svg.found if rect.get('class') == look]
                                     for look in ('ask', 'wait', 'limit'))
    assert (float(first['x']), svg.found[0][1]['height']) == (NAMES, '54')
    assert float(second['x']) == pytest.approx(NAMES + float(first['width']), abs=0.2)
    assert float(second['width']) == pytest.approx(3 * float(first['width']), abs=0.2)
    assert (int(second['y']) - int(first['y']), limit['x1']) == (14, second['x'])
    assert [text for text in svg.texts if text.strip()] == [
        'a', *map(str, range(520, 601, 10)), 'ms', 'x', 'f' * 39, 'y']
    assert [float(line['x1']) for _, line in svg.found if line.get('class') == 'grid'] == \
        pytest.approx([NAMES + 128.75 * number for number in range(9)], abs=0.1)


def test_periods_that_cannot_be_kept_are_red(tmp_path: Path, capsys: Output) -> None:
    said, page = drawn(tmp_path, capsys, (*ROWS, HASTY, 'free,Read,N7:0,4,SLC,,0,'))
    found = elements(page)
    assert found.bars('bad') == 2 * (len(ROWS) + 1)  # a line that is too busy keeps none
    assert found.bars('ask') == 1  # without a Period there is nothing to keep
    assert found.found.count(('b', {'class': 'is-bad'})) == len(ROWS) + 1  # in the table
    (limit,) = (float(each['x1']) for _, each in found.found if each.get('class') == 'limit')
    assert limit == pytest.approx(NAMES + 1030 / 5.67, abs=2)  # 100 of 567 %
    assert ('p', {'class': 'verdict is-bad'}) in found.found
    assert 'Reads with Period 0 have the time that is left.' in found.texts
    assert any(text.startswith('4 of 5 reads cannot keep the Period') for text in found.texts)
    said, page = drawn(tmp_path, capsys)  # it replaces its own page
    assert (said.status, elements(page).bars('bad')) == (0, 0)


def test_files_with_errors_have_a_picture_of_the_rest(tmp_path: Path, capsys: Output) -> None:
    said, page = drawn(tmp_path, capsys, (*ROWS, 'bad,Read,N7,1,PLC5,,,'))
    assert said.status == 2
    found = elements(page)
    assert found.bars('ask') == 2 * len(ROWS)
    assert ('p', {'class': 'verdict is-bad'}) in found.found
    assert any('map.csv:5:3' in text for text in found.texts)
    said, page = drawn(tmp_path, capsys, ROWS, '5,Nobody,9600,1')
    assert said.status == 2
    assert 'no plan without a good net file' in elements(page).texts


def test_line_of_another_master_has_no_cycle(tmp_path: Path, capsys: Output) -> None:
    said, page = drawn(tmp_path, capsys, ROWS, '5,Slave,9600,1')
    found = elements(page)
    assert any('the Periods need' in text for text in found.texts)
    assert found.bars('bad') == found.bars('wait') == 0


def test_line_that_is_only_listened_to_has_no_reads(tmp_path: Path, capsys: Output) -> None:
    said, page = drawn(tmp_path, capsys, ROWS, '5,Listen,9600,1')
    assert said.status == 0
    found = elements(page)
    assert 'the bridge only listens: it sends nothing' in found.texts
    assert 'svg' not in found.tags()
    assert not any('of the line' in text for text in found.texts)


def test_names_from_files_are_text_and_nothing_else(tmp_path: Path, capsys: Output) -> None:
    rows = [f'{EVIL},Read,N7:0,1,PLC5,2,1000,{EVIL}', f'b,Read,N7:x{EVIL},1,PLC5,,,']
    folder = tmp_path / '<b>&"\'>'
    folder.mkdir()
    _, page = drawn(folder, capsys, tuple(rows))
    found = elements(page)
    assert found.tags() <= {
        'html', 'head', 'meta', 'title', 'style', 'body', 'h1', 'h2', 'p', 'svg', 'rect', 'text',
        'line', 'table', 'tr', 'th', 'td', 'b'}
    assert ('b', {}) not in found.found
    assert not [name for _, attributes in found.found for name in attributes
                if name.startswith('on') or name in ('src', 'href')]
    assert '<script>document.title=1</script>' in ''.join(found.texts)


def test_folder_has_no_picture(tmp_path: Path, capsys: Output) -> None:
    said = call(main, capsys, str(tmp_path), '--html', 'x.html')
    assert said.status == 2
    assert '--html is for one net CSV and one map CSV' in said.err


def test_file_of_another_program_is_not_replaced(tmp_path: Path, capsys: Output) -> None:
    (tmp_path / 'plan.html').write_bytes(b'\x10\x02\xff\xfe')
    said, page = drawn(tmp_path, capsys)
    assert said.status == 2
    assert 'was not made by --html' in said.err
    assert page.read_bytes() == b'\x10\x02\xff\xfe'


def test_picture_that_cannot_be_written_is_told(tmp_path: Path, capsys: Output) -> None:
    write_csv(tmp_path / 'net.csv', NET_HEADER, ['5,Master,9600,1'])
    write_csv(tmp_path / 'map.csv', MAP_HEADER, ROWS)
    for more in ((), ('--json',)):
        said = call(main, capsys, str(tmp_path / 'net.csv'), str(tmp_path / 'map.csv'),
                    '--html', str(tmp_path / 'no' / 'plan.html'), *more)
        assert said.status == 2
        assert '--html: ' in said.err and 'No such file or directory' in said.err


@pytest.mark.long
def test_browser_shows_blocks_and_red_ones(tmp_path: Path, capsys: Output) -> None:
    _, page = drawn(tmp_path, capsys)
    shown = browser.colours(page, tmp_path)
    assert BLUE in shown and RED in shown  # red in the key alone
    _, page = drawn(tmp_path, capsys, (*ROWS, HASTY))
    assert browser.dom(page, tmp_path).bars('bad') == 8


def test_browser_runs_nothing_that_stands_in_a_file(tmp_path: Path, capsys: Output) -> None:
    _, page = drawn(tmp_path, capsys, (f'{EVIL},Read,N7:0,1,PLC5,2,1000,{EVIL}',))
    found = browser.dom(page, tmp_path)
    assert not {'script', 'img'} & found.tags()
    assert any(text.startswith('The plan of ') for text in found.texts)  # and not "1"
