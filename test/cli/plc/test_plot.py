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

"""The picture of a log: curves, lanes, gaps, of any length; files that it reads, and others."""

from collections.abc import Callable
from datetime import datetime, timedelta, timezone
import math
from pathlib import Path
import re

from abdf1_ros.cli.plc import log_picture
from abdf1_ros.cli.plc.command import main
from abdf1_ros.cli.plc.log_file import Cell, FORMS, LogRow
from abdf1_ros.cli.plc.log_picture import ValuePicture
from abdf1_ros.cli.plc.log_reader import Sample, ValuePlace
import pytest
from support import browser
from support.commands import call, Output, Said

HEAD = 'time,station,address,tag,value,reason'
BEGIN = datetime(2026, 3, 1, 14, 5, 0, 0, timezone(timedelta(hours=1)))
SILENT = '2509 ERR_INACTIVE_STATION: Slave Station (1) Inactive'
EVIL = '<script>document.title=1</script>'
PINK, BLUE, GREEN = (0xFB, 0xE3, 0xE1), (0x2F, 0x6D, 0xB5), (0x2E, 0x8B, 0x57)


def row(seconds: float, place: str, value: object = '', reason: str = '', tag: str = '',
        station: int | None = 1) -> LogRow:
    cell = Cell.NONE if value == '' else Cell.TEXT if isinstance(value, str) else \
        Cell.INTEGER if isinstance(value, int) else Cell.FLOAT
    when = BEGIN + timedelta(seconds=seconds)
    return LogRow(when, station, place, tag, cell, str(value), reason)


SHIFT = [
    *(row(n, 'N7:0', 100 + n, tag='speed') for n in range(10)),
    *(row(n, 'B3:0/2', int(n in (3, 4, 5)), tag='door') for n in range(10)),
    *(row(n, 'ST9:0', 'Tank 4', station=2) for n in range(0, 20, 2)),
    row(10.5, 'N7:0', reason=SILENT, tag='speed'), row(10.5, 'B3:0/2', reason=SILENT, tag='door'),
    row(20, 'N7:0', 500, 'answers again', tag='speed'),
    row(20, 'B3:0/2', 1, 'answers again', tag='door'),
    row(30, 'N7:0', 400, tag='speed'), row(30, 'B3:0/2', 1, tag='door'),
]


def logged(path: Path, rows: list[LogRow], form: str = 'csv') -> Path:
    lines = [FORMS[form].head] * bool(FORMS[form].head) + [*map(FORMS[form].line, rows)]
    path.write_text('\n'.join([*lines, '']), encoding='utf-8')
    return path


def plotted(tmp_path: Path, capsys: Output, file: Path, *names: str) -> tuple[Said, Path]:
    page = tmp_path / 'shift.html'
    return call(main, capsys, 'plot', str(file), *names, '--html', str(page)), page


def elements(page: Path) -> browser.Elements:
    return browser.Elements(page.read_text(encoding='utf-8'))


def paths(found: browser.Elements) -> list[str]:
    return [attributes['d'] for tag, attributes in found.found if tag == 'path']


@pytest.mark.parametrize('form', ['csv', 'jsonl'])
def test_values_are_curves_and_lanes_with_their_gaps(
        tmp_path: Path, capsys: Output, form: str) -> None:
    said, page = plotted(tmp_path, capsys, logged(tmp_path / 'shift', SHIFT, form))
    assert said == Said(0, f'{page}: {len(SHIFT)} rows\n', '')
    assert page.stat().st_mode & 0o007 == 0
    found = elements(page)
    path, = paths(found)  # of speed alone
    assert path.count('M') == 2  # it is broken at the gap
    assert 'speed N7:0: 100 to 500' in found.texts
    assert found.bars('answer') == 2 and found.bars('ask') == 1
    missing = [float(each['width']) for _, each in found.found if each.get('class') == 'missing'
               and 'x' in each]
    assert missing == [pytest.approx(11 / 30 * 1030, abs=0.2)] * 2
    assert '2026-03-01 14:05:09, no value for 11.0 s: ' + SILENT in found.texts
    assert '1 gap, the longest 11.0 s' in found.texts
    told = found.texts[found.texts.index('reason'):]
    assert [text for text in told if text.strip()][1:6] == [
        '2026-03-01 14:05:09', '11.0 s', '1', 'speed, door', SILENT]
    told = [text for text in told[told.index('In figures'):] if text.strip()]
    at = told.index('speed')
    assert told[at - 2:at + 8] == [
        '1', 'N7:0', 'speed', '12', '100', '500', '400', '11', '1', '11.0 s']
    assert {'14:05:10', '14:05:30', 'UTC+01:00', 'Station 1', 'Station 2'} <= {*found.texts}


def test_log_that_goes_on_has_a_gap_of_all_values(tmp_path: Path, capsys: Output) -> None:
    rows = [row(0, 'N7:0', 1), row(1, 'N7:1', 5),
            row(100, '', reason='the log goes on', station=None), row(101, 'N7:0', 7),
            row(102, 'N7:1', 5)]
    _, page = plotted(tmp_path, capsys, logged(tmp_path / 'shift', rows))
    assert [path.count('M') for path in paths(elements(page))] == [2, 2]
    assert elements(page).texts.count('the log goes on') == 1
    # So do a gap that begins, and one that ends, with the file.
    _, page = plotted(tmp_path, capsys, logged(tmp_path / 'shift', [
        row(0, 'N7:0', reason=SILENT), row(5, 'N7:0', 7), row(6, 'N7:1', 8),
        row(9, 'N7:1', reason=SILENT), row(12, 'N7:0', 7)]))
    assert elements(page).texts.count('5.0 s') == 1 + 1 and '6.0 s' in elements(page).texts


def test_file_of_the_recorder_is_read(tmp_path: Path, capsys: Output) -> None:
    (tmp_path / 'line.csv').write_text(
        'time,topic,address,values\r\n2026-03-01T13:05:09.1+00:00,speeds,N7:0,1200,-800\r\n'
        '2026-03-01T13:05:10.1+00:00,speeds,N7:0,1300,-700\r\n'
        '2026-03-01T13:05:10.2+00:00,name,,"Tank, 4"\r\n', encoding='utf-8')
    said, page = plotted(tmp_path, capsys, tmp_path / 'line.csv')
    assert said.status == 0
    found = elements(page)
    assert {'speeds[0] N7:0: 1200 to 1300', 'speeds[1]: -800 to -700', 'no gap', 'Tank, 4',
            'UTC'} <= {*found.texts}


def test_names_choose_what_is_drawn(tmp_path: Path, capsys: Output) -> None:
    rows = [row(n, f'N7:{place}', n, tag=f'speed[{place}]') for n in (0, 2) for place in (0, 1)]
    file = logged(tmp_path / 'shift', [*rows, *SHIFT])
    for names, count in ((('Speed',), 3), (('n7:1',), 1), (('speed[1]', 'N7:0'), 3)):
        assert len(paths(elements(plotted(tmp_path, capsys, file, *names)[1]))) == count, names
    said, _ = plotted(tmp_path, capsys, file, 'sped', 'door')
    assert said == Said(2, '', f'plc: {file}: has no sped; it has door, speed[0], speed[1], '
                               'speed, ST9:0\n')


def test_missing_words_are_named(capsys: Output) -> None:
    assert 'arguments are required: FILE, --html\n' in call(main, capsys, 'plot').err


@pytest.mark.parametrize(('content', 'told'), [
    ('', ':1: the file is empty'), (f'{HEAD}\n', ': has no row below its head'),
    ('time,station,address,value\n', ':1: is not a CSV or JSON lines of "plc log", nor a CSV of '
     'recorder.py: it begins with "time,station,address,value"'),
    ('plc,station=1 integer=1i 1\n', ':1: is not a CSV or JSON lines'),
    ('\x10\x02\xff', ':1: the file is empty'),
    (f'{HEAD}\n2026-03-01 14:05,1,N7:0,,5,\n', ':2: this row cannot be read: 2026-03-01 14:05 has '
     'no UTC offset'),
    (f'{HEAD}\n2026-03-01T14:05+01:00,1,N7:0,,5,\n01.03.26,1,N7:0,,5,\n', ':3: this row cannot'),
    (f'{HEAD}\n2026-03-01T14:05+01:00;1;N7:0;;5;\n', ':2: this row cannot be read: it has 1 col'),
    ('{"time": "2026-03-01T14:05+01:00", "value": 1}\n', ":1: this row cannot be read: 'station'"),
    ('14:05:09.250  N7:0  889\n', ':1: has the text of "plc watch" for a screen; log with'),
    ('# abdf1_ros capture 1\n', ':1: bytes, not values: "sniff --html" draws them'),
    ('time,topic,address,values\n1,2\n', ':2: this row cannot be read: it has 2 columns')])
def test_other_file_is_refused(tmp_path: Path, capsys: Output, content: str, told: str) -> None:
    (tmp_path / 'x').write_text(content, encoding='latin-1')
    said, page = plotted(tmp_path, capsys, tmp_path / 'x')
    assert (said.status, said.out) == (2, '') and said.err.splitlines()[-1].startswith(
        f'plc: {tmp_path}/x{told}') and not page.exists()


def test_row_that_was_cut_off_is_left_out(tmp_path: Path, capsys: Output) -> None:
    file = logged(tmp_path / 'shift', SHIFT)
    file.write_text(file.read_text()[:-3])  # it could be 4, and was 400
    said, page = plotted(tmp_path, capsys, file)
    assert (said.status, said.err) == (
        0, f'plc: {file}: its last line has no end, and is left out\n')
    assert said.out == f'{page}: {len(SHIFT) - 1} rows\n'


def test_page_is_found_bad_before_the_file_is_read(tmp_path: Path, capsys: Output) -> None:
    mine = tmp_path / 'mine.html'
    mine.write_text('mine')
    for page, told in ((mine, 'exists and was not made by --html'),
                       (tmp_path / 'no' / 'x', 'No such file or directory'),
                       (tmp_path, 'Is a directory')):
        said = call(main, capsys, 'plot', str(tmp_path / 'none'), '--html', str(page))
        assert said.status == 2 and told in said.err, page
    assert mine.read_text() == 'mine'
    said = call(main, capsys, 'plot', str(logged(tmp_path / 'x', SHIFT)), '--html', '/dev/full')
    assert said == Said(2, '', 'plc: --html: /dev/full: No space left on device\n')


def drawn(picture: ValuePicture) -> str:
    return '\n'.join(picture.parts())


def week_of(values: Callable[[int], float], count: int = 40_000) -> ValuePicture:
    """Return the picture of a week with values in equal intervals."""
    picture, place = ValuePicture(), ValuePlace('1', 'N7:0', '')
    for number in range(count):
        when = BEGIN + timedelta(days=7) * number / count
        picture.add(Sample(when, place, values(number), ''))
    return picture


def test_week_has_a_page_of_bounded_size_with_each_extreme() -> None:
    page = drawn(week_of(lambda n: 5000 if n == 12_345 else -5000 if n == 23_456 else n * n % 997))
    assert len(page) < 100_000
    path, = re.findall('<path class="curve" d="([^"]*)"', page)
    heights = [float(text) for text in re.findall(r'[V ](\d+\.\d)', path)]
    assert min(heights) == 4.0 and max(heights) == 66.0  # a spike of one read is seen
    lefts = [float(text) for text in re.findall(r'[ML](\d+\.\d)', path)]
    assert lefts == sorted(lefts) and 110 <= lefts[0] and lefts[-1] <= 1140
    assert '<text' in page and '03-05 00:00' in page


def test_bits_that_change_within_a_pixel_are_shown_as_several() -> None:
    found = browser.Elements(drawn(week_of(lambda n: n % 2)))
    assert found.bars('wait') == 1 and not found.bars('answer')
    found = browser.Elements(drawn(week_of(lambda n: n > 20_000)))
    bar, = [each for _, each in found.found if each.get('class') == 'answer' and 'x' in each]
    assert float(bar['x']) == pytest.approx(110 + 1030 / 2, abs=1)


def test_clock_that_is_set_back_and_values_that_are_no_numbers_are_drawn(
        tmp_path: Path, capsys: Output) -> None:
    rows = [row(0, 'F8:0', 1.5), row(100, 'F8:0', math.nan), row(-50, 'F8:0', 2.5),
            row(-40, 'F8:0', math.inf), row(10, 'F8:0', 0.5)]
    said, page = plotted(tmp_path, capsys, logged(tmp_path / 'shift', rows))
    assert said.status == 0 and 'F8:0: 0.5 to 2.5' in elements(page).texts
    assert said.err == (
        f'plc: {tmp_path / "shift"}: the time goes back from 2026-03-01 14:06:40 to 2026-03-01 '
        '14:04:10: a clock was set, or files were joined in another order; each value stands at '
        'its own time\n')
    assert not [text for text in elements(page).texts if '-' in text and text.endswith(' s')]
    assert '2026-03-01 14:04:10 to 2026-03-01 14:06:40' in ' '.join(elements(page).texts)


EARLY = [row(n, 'N7:0', n) for n in range(60)]
LATE = [row(28800 + n, 'N7:0', 1000 + n) for n in range(60)]


@pytest.mark.parametrize(('parts', 'reason'), [
    ((EARLY, LATE), 'another file was joined here'),
    ((LATE, EARLY), 'between two parts of the file, where its time goes back')])
def test_files_that_were_joined_have_a_gap_between_them_in_any_order(
        tmp_path: Path, capsys: Output, parts: tuple[list[LogRow], ...], reason: str) -> None:
    joined = ''.join(logged(tmp_path / 'part', part).read_text() for part in parts)
    (tmp_path / 'shift.csv').write_text(joined)
    said, page = plotted(tmp_path, capsys, tmp_path / 'shift.csv')
    found = elements(page)
    assert (said.status, said.err != '') == (0, parts[0] is LATE)
    assert [path.count('M') for path in paths(found)] == [2]
    told = [text for text in found.texts if text.strip()]
    assert '1 gap, the longest 7:59:01' in told and told.count(reason) == 1
    at = told.index('In figures')
    assert told[told.index('N7:0', at):][1:8] == [
        '120', '0', '1059', '1059', '118' if parts[0] is LATE else '119', '1', '7:59:01']


def test_clock_that_is_set_back_in_a_gap_makes_no_gap_of_less_than_nothing(
        tmp_path: Path, capsys: Output) -> None:
    rows = [*(row(n, 'N7:0', n) for n in range(30)), row(31, 'N7:0', reason=SILENT),
            *(row(n, 'N7:0', n) for n in range(12, 25))]
    said, page = plotted(tmp_path, capsys, logged(tmp_path / 'shift', rows))
    texts = elements(page).texts
    assert said.err.count('the time goes back') == 1 == ' '.join(texts).count('the time goes back')
    assert '1 gap, the longest 2.0 s' in texts
    # A row about all values, and files that overlap, make none either.
    rows = [row(60, '', reason='the log goes on', station=None), row(61, 'N7:0', 70)]
    whole = [row(n, 'N7:0', n) for n in range(100)]
    _, page = plotted(tmp_path, capsys, logged(tmp_path / 'shift', [*whole, *rows]))
    assert 'no gap' in elements(page).texts


@pytest.mark.parametrize('form', ['csv', 'jsonl'])
def test_value_that_is_no_number_is_a_gap(tmp_path: Path, capsys: Output, form: str) -> None:
    rows = [row(0, 'F8:0', 1.5), row(10, 'F8:0', math.nan), row(20, 'F8:0', 2.5)]
    _, page = plotted(tmp_path, capsys, logged(tmp_path / 'shift', rows, form))
    found = elements(page)
    assert 'the value is nan' in found.texts and '1 gap, the longest 20.0 s' in found.texts


def test_log_that_a_spreadsheet_has_saved_is_drawn_while_its_times_are_kept(
        tmp_path: Path, capsys: Output) -> None:
    file = tmp_path / 'shift.csv'
    time = BEGIN.isoformat(timespec='milliseconds')
    file.write_bytes(b'\xef\xbb\xbf' + f'{HEAD.replace(",", ";")}\r\n{time};1;F8:0;;2,5;\r\n'
                     f'{time};1;ST9:0;;a,5;\r\n'.encode())
    said, page = plotted(tmp_path, capsys, file)
    assert said.status == 0
    assert {'2.5', 'a,5'} <= {*elements(page).texts}
    file.write_text(f'{HEAD.replace(",", ";")}\n01.03.2026 14:05;1;F8:0;;2,5;\n')
    said, _ = plotted(tmp_path, capsys, file)
    assert said.status == 2 and said.err == (
        f'plc: {file}:2: this row cannot be read: "01.03.2026 14:05" is not a time as "plc log" '
        'writes it; if a spreadsheet has saved the file again, draw the original\n')


def test_gaps_without_number_are_joined_and_still_counted() -> None:
    picture, place = ValuePicture(), ValuePlace('1', 'N7:0', '')
    for number in range(6000):
        picture.add(Sample(BEGIN + timedelta(seconds=3 * number), place, 5, ''))
        picture.add(Sample(BEGIN + timedelta(seconds=3 * number + 1), place, None, 'silent'))
    page = drawn(picture)
    assert len(page) < 600_000 and 'and more' in page and 'at least ' in page
    assert page.count('class="missing" x=') <= 2060
    assert '<td class="number">6000</td><td class="number">4:59:58</td>' in page


def test_values_beyond_those_drawn_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_picture, 'MOST_DRAWN', 3)
    picture = ValuePicture()
    for number in range(8):
        picture.add(Sample(BEGIN, ValuePlace('1', f'N7:{number % 4}', ''), number, ''))
    assert 'and 1 value more: name those to draw after the file' in drawn(picture)


def test_texts_of_a_plc_are_no_markup(tmp_path: Path, capsys: Output) -> None:
    rows = [row(0, EVIL, EVIL, EVIL, tag=EVIL), row(0, 'N7:0', 1, tag=EVIL),
            row(1, 'N7:0', 2, tag=EVIL), row(2, 'N7:0', reason=EVIL, tag=EVIL)]
    said, page = plotted(tmp_path, capsys, logged(tmp_path / EVIL[1:7], rows))
    assert said.status == 0
    found = elements(page)
    assert 'script' not in found.tags() and EVIL in ''.join(found.texts)


@pytest.mark.long
def test_browser_shows_curves_lanes_and_gaps(tmp_path: Path, capsys: Output) -> None:
    _, page = plotted(tmp_path, capsys, logged(tmp_path / 'shift', SHIFT))
    assert {PINK, BLUE, GREEN} <= browser.colours(page, tmp_path)
    assert browser.dom(page, tmp_path).bars('missing') == 2
