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

"""The timeline of a recorded line: bars, faults, overview; long recordings; no names in it."""

from pathlib import Path

from abdf1_ros.cli import sniff_picture
from abdf1_ros.cli.sniff import main
from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.packet import Packet
import pytest
from support import browser
from support.captures import FOLDER
from support.commands import call, Output

HEAD = '# abdf1_ros capture 1', '# begun: 2026-03-01T14:05:09.000+01:00', '# baud: 19200', \
    '# check: CRC', '# duplex: half'
EVIL = '<script>document.title=1</script>'

Said = list[tuple[float, str, bytes]]


def exchange(start: float, tns: int, station: int = 2, sts: int = 0) -> Said:
    """Return a read that is answered."""
    command = Packet(station, 5, 0x0F, 0, tns, bytes.fromhex('A2 04 07 89 00 00'))
    reply = command.reply(b'' if sts else bytes.fromhex('34 12 FE FF'))._replace(sts=sts)
    said = (('>', frames.master_frame(station, command.encode(), Checksum.CRC)),
            ('<', frames.ACK), ('>', frames.poll_frame(station)),
            ('<', frames.message_frame(reply.encode(), Checksum.CRC)), ('>', frames.ACK))
    return [(start + 0.01 * count, *part) for count, part in enumerate(said)]


def silence(start: float, station: int = 3) -> Said:
    """Return a poll that is not answered."""
    return [(start, '>', frames.poll_frame(station))]


def capture(path: Path, *parts: Said) -> str:
    lines = [f'{time:.6f} {way} {data.hex(" ")}' for part in parts for time, way, data in part]
    path.write_text('\n'.join([*HEAD, *lines, '']), encoding='ascii')
    return str(path)


def drawn(tmp_path: Path, capsys: Output, *args: str) -> browser.Elements:
    """Return the page of a recording."""
    page = tmp_path / 'line.html'
    said = call(main, capsys, '--summary', '--html', str(page), *args)
    assert (said.status, page.stat().st_mode & 0o007) == (0, 0)
    assert all(': read as ' in line for line in said.err.splitlines())
    return browser.Elements(page.read_text(encoding='utf-8'))


def messages(tmp_path: Path) -> browser.Elements:
    """Return the part of the page below the overview."""
    page = (tmp_path / 'line.html').read_text(encoding='utf-8')
    return browser.Elements(page.partition('<h2>Every message</h2>')[2])


def test_each_message_is_a_bar_in_the_lane_of_its_station(tmp_path: Path, capsys: Output) -> None:
    found = drawn(tmp_path, capsys, capture(
        tmp_path / 'line.cap', exchange(0.1, 1), exchange(0.14, 2, station=7)))
    of_messages = messages(tmp_path)
    assert [of_messages.bars(look) for look in ('ask', 'answer', 'small')] == [2, 2, 2 * 3]
    assert {'station 2', 'station 7', 'no fault'} <= {*found.texts}
    assert 'Recording 2' not in found.texts  # two chunks have one time
    assert '0.100000 command: 5 to 2, TNS 0001: protected typed logical read N7:0, 2 words ' \
        '| CRC good' in found.texts


def test_faults_come_as_episodes_that_lead_to_their_strip(tmp_path: Path, capsys: Output) -> None:
    found = drawn(tmp_path, capsys, capture(
        tmp_path / 'line.cap', exchange(0.1, 1), silence(1.2), exchange(2.0, 2, sts=0x10),
        silence(5.4), silence(9.6), silence(9.7, station=4),
        [(30.0, '>', 2 * frames.poll_frame(3))], exchange(30.1, 3), [(31.0, '<', b'\x55')],
        exchange(31.1, 4)))
    assert '8 faults on the line' in found.texts and 'None' not in found.texts
    links = [attributes['href'] for tag, attributes in found.found if tag == 'a']
    names = {attributes['id'] for tag, attributes in found.found
             if tag == 'svg' and 'id' in attributes}
    assert {link.removeprefix('#') for link in links} <= names
    told = [text for text in found.texts if text.strip()]
    at = told.index('the first of them')
    assert told[at + 1:at + 7] == ['1.202 s', '9.602 s', '14:05:10', '3', '3',
                                   'silence: no answer to the poll']
    assert [text for text in told[at + 7:] if text.startswith('reply: ')][0].startswith(
        'reply: 2 to 5, TNS 0002: STS 10')
    assert told.count('silence: no answer to the poll') == 3
    assert found.found.count(('td', {'class': 'number'})) == 4 * 5
    assert '30.000 s' in told  # two polls in one chunk
    radio, = FOLDER.glob('radio*.cap')  # 38 messages are forwarded, which is no fault
    assert '7 faults on the line' in drawn(tmp_path, capsys, str(radio)).texts


@pytest.mark.parametrize(('episodes', 'is_more'), [(3, False), (4, True)])
def test_table_of_episodes_tells_that_there_are_more(
        tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch, episodes: int,
        is_more: bool) -> None:
    monkeypatch.setattr(sniff_picture, 'MOST_EPISODES', 3)
    found = drawn(tmp_path, capsys, capture(
        tmp_path / 'line.cap', *(silence(8.0 * number) for number in range(1, 2 + episodes))))
    told = found.texts[:found.texts.index('In figures')]
    assert told.count('silence: no answer to the poll') == 3
    assert ('and more' in told) is is_more


def overview(found: browser.Elements) -> list[tuple[str, float, float, float, float]]:
    """Return class, left, width, top and height of the bars of the first picture."""
    drawings = [at for at, (tag, each) in enumerate(found.found)
                if tag == 'svg' and 'role' in each]
    return [(each['class'], *(float(each[name]) for name in ('x', 'width', 'y', 'height')))
            for _, each in found.found[drawings[0]:drawings[1]]
            if each.get('class', 'lane') != 'lane' and 'y' in each]


def test_overview_shows_the_share_of_the_time(tmp_path: Path, capsys: Output) -> None:
    # A frame of 20 bytes takes 10.4 ms. Ten minutes with one read each 100 ms are a load of 23 %.
    found = drawn(tmp_path, capsys, capture(
        tmp_path / 'line.cap', *(exchange(0.1 * n, n) for n in range(6000)), silence(600.2)))
    said = [text for text in found.texts if ' seen, ' in text]
    shares = [int(text.rpartition(', ')[2].partition('%')[0]) for text in said[:-9]]
    assert {*shares} <= {23, 24} and said[3].startswith('station 2, 4 to 8 s 14:05:13: ')
    bars = overview(found)
    assert len(bars) < 3 * 160
    assert 'The height of a lane is 50% of the time. Faults are drawn higher, so that they are ' \
        'seen.' in found.texts
    heights = {look: [tall for other, *_, tall in bars if other == look][5]
               for look in ('small', 'ask', 'answer')}
    assert sum(heights.values()) == pytest.approx(0.23 / 0.5 * 42, rel=0.05)
    # Two messages in half a second: the rest of the time is empty.
    bars = overview(drawn(tmp_path, capsys, capture(
        tmp_path / 'line.cap', exchange(0.1, 1), exchange(0.5, 2))))
    assert sum(width * tall for *_, width, _, tall in bars) < 0.3 * 1030 * 42
    assert not [left for _, left, *_ in bars if 300 < left < 800]


def test_overview_has_faults_higher_than_their_share_and_links_to_them(
        tmp_path: Path, capsys: Output) -> None:
    found = drawn(tmp_path, capsys, capture(
        tmp_path / 'line.cap', exchange(3610.1, 1, station=7), exchange(3615.1, 2, sts=0x10),
        exchange(3617.2, 3, station=7), exchange(3625.1, 4, station=7), silence(3625.9),
        exchange(5700.5, 5)), '--baud', '4800')
    # A strip has 4 s at this speed, and a moment 16 s.
    assert {'station 2, 3600 to 3616 s 15:05:09: 5 seen, 1 fault, 1% of the time',
            'station 7, 3616 to 3632 s 15:05:25: 10 seen, 0 faults, 1% of the time'} <= {
        *found.texts}
    links = {each['href'] for tag, each in found.found if tag == 'a'}
    assert {'#r1s903', '#r1s1425', '#r1s902'} <= links
    fault, = [bar for bar in overview(found) if bar[0] == 'bad']
    assert fault[4] >= 0.1 * 42
    assert '15:05:09' in found.texts


def test_overview_of_an_unknown_speed_shows_when_not_how_much(
        tmp_path: Path, capsys: Output) -> None:
    path = capture(tmp_path / 'line.cap', exchange(0.1, 1), exchange(0.5, 2))
    Path(path).write_text(Path(path).read_text('ascii').replace('# baud: 19200\n', ''), 'ascii')
    found = drawn(tmp_path, capsys, path)
    assert 'The speed is not known: --baud shows how much of the time the messages take.' in \
        found.texts
    assert {tall for *_, tall in overview(found)} == {42}


def test_no_answer_is_drawn_as_long_as_it_was_waited_for(tmp_path: Path, capsys: Output) -> None:
    found = drawn(tmp_path, capsys, capture(
        tmp_path / 'line.cap', silence(0.1), silence(0.6), silence(1.2)))
    widths = [float(rect['width']) for _, rect in found.found
              if rect.get('class') == 'missing' and 'x' in rect]
    assert max(widths[2:]) == pytest.approx(0.5 * 1030, rel=0.02)


def test_long_recording_keeps_its_faults(
        tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sniff_picture, 'MOST_DRAWN', 20)
    parts = [exchange(float(second), second) for second in range(1, 35)]
    found = drawn(tmp_path, capsys, capture(
        tmp_path / 'line.cap', *parts[:29], silence(30.5), *parts[30:]))
    assert messages(tmp_path).bars('ask') == 4 + 1
    assert [text for text in found.texts if 'not drawn' in text] == [
        '26 strips not drawn', '3 strips not drawn']
    assert messages(tmp_path).bars('missing') == 1
    assert ('a', {'href': '#r1s20'}) not in found.found  # there is no such strip
    for count, more in ((40, []), (41, ['and 1 station more'])):
        many = capture(tmp_path / 'line.cap', *(silence(0.1, number) for number in range(count)))
        assert [text for text in drawn(tmp_path, capsys, many).texts if ' more' in text] == more


def test_recordings_one_after_the_other_and_without_times(tmp_path: Path, capsys: Output) -> None:
    broken = b'\x10\x02'
    first = capture(tmp_path / 'line.cap.1', silence(0.1), exchange(50.0, 1), [(51, '>', broken)])
    second = capture(tmp_path / 'line.cap', silence(0.1), exchange(0.5, 2),
                     [(0.9, '<', broken), *silence(3.0), (3.1, '<', frames.EOT)])
    Path(second).write_text(Path(second).read_text('ascii').replace('19200', '2400'), 'ascii')
    found = drawn(tmp_path, capsys, first, second)
    assert {'All of it', 'Recording 2'} <= {*found.texts}
    half = capture(tmp_path / 'half', [(60, '>', b'\x10')])  # no entry before the next recording
    assert 'Recording 2' in drawn(tmp_path, capsys, half, second).texts
    assert [each['id'] for _, each in found.found if 'id' in each] == [
        'r1s0', 'r1s50', 'r2s0']  # at a lower speed a strip is longer
    (dump := tmp_path / 'dump').write_text('10 05 03 FD 10 02', 'ascii')
    mixed = drawn(tmp_path, capsys, first, str(dump), second, str(dump)).texts
    assert {'Recording 3', 'Recording 4'} <= {*mixed} and mixed.count('bytes') == 4
    assert found.texts.count('silence: no answer to the poll') == 2
    assert messages(tmp_path).bars('ask') == 2
    raw = tmp_path / 'raw'
    raw.write_bytes(b''.join(
        data for tns in range(45) for _, _, data in silence(0.0) + exchange(0.1, tns)))
    found = drawn(tmp_path, capsys, '--binary', str(raw))
    assert 'bytes' in found.texts
    assert [text for text in found.texts if text.startswith('byte ')] == ['byte 4', 'byte 2162']
    assert messages(tmp_path).bars('ask') == 45
    assert {'r1s0', 'r1s1'} <= {element.get('id') for _, element in found.found}
    raw.write_bytes(exchange(0.1, 1)[3][2])  # a reply without its command, in the lower row
    drawn(tmp_path, capsys, '--binary', '--duplex', 'full', str(raw))
    assert [each['y'] for _, each in messages(tmp_path).found if each.get('class') == 'odd'
            and 'y' in each] == ['15']


def test_values_of_addresses_are_curves_where_they_are_asked_for(
        tmp_path: Path, capsys: Output) -> None:
    said: Said = []
    for number in range(20):
        command = Packet(2, 5, 0x0F, 0, number, bytes.fromhex('A2 04 07 89 00 00'))
        reply = command.reply(bytes((number, 1, 1 + number // 10, 0)))
        said += [(0.1 * number, '>', frames.master_frame(2, command.encode(), Checksum.CRC)),
                 (0.1 * number + .03, '<', frames.message_frame(reply.encode(), Checksum.CRC))]
    file = capture(tmp_path / 'line.cap', said, exchange(4.0, 30, sts=0x10), exchange(
        5.0, 31, station=3), silence(6.0), exchange(9.0, 32, station=3))
    found = drawn(tmp_path, capsys, file, '--curve', 'N7:0', '--curve', 'N7:1/1')
    path, _ = (each['d'] for tag, each in found.found if tag == 'path')  # of both stations
    assert len([part for part in path if part in 'ML']) == 20
    assert 'N7:0: 256 to 275' in found.texts  # little-endian words: 00 01 to 13 01
    assert {'Station 2', 'Station 3', '14:05:10'} <= {*found.texts}
    assert any(text.startswith('N7:1/1, 2026-03-01 14:05:10') for text in found.texts)
    assert '2026-03-01 14:05:14, no value for 4.0 s: no answer' in found.texts
    assert 'N7:0: 256 to 275' in drawn(tmp_path, capsys, file, '--curve', 'N7:1/1,N7:0').texts
    missing = 'no reply has N9:0; answered is: protected typed logical read N7:0, 2 words'
    page = tmp_path / 'line.html'
    told = call(main, capsys, file, '--html', str(page), '--curve', 'N7:0', '--curve', 'N9:0')
    assert (told.status, told.err) == (0, f'sniff: --curve: {missing}\n')
    assert missing in page.read_text('utf-8')
    for args, told in ((('--curve', 'N7:0'), '--curve is for --html'),
                       (('--html', str(tmp_path / 'x'), '--curve', 'X7:0'), 'X7:0')):
        said_now = call(main, capsys, file, *args)
        assert said_now.status == 2 and told in said_now.err


def test_names_are_text_and_nothing_else(tmp_path: Path, capsys: Output) -> None:
    name = EVIL.replace('/', '')
    path = Path(capture(tmp_path / name, exchange(0.1, 1), exchange(9999.0, 2)))
    path.write_text(path.read_text('ascii').replace('2026-03-01T14', '9999-12-31T23'), 'ascii')
    found = drawn(tmp_path, capsys, str(path))
    assert 'script' not in found.tags()
    assert any(name in text for text in found.texts)


def test_anonymous_timeline_has_no_values_and_no_names(tmp_path: Path, capsys: Output) -> None:
    path = tmp_path / 'secret.cap'
    capture(path, exchange(0.1, 0x1234), silence(0.3), exchange(0.5, 0x1235, sts=0x10))
    text = path.read_text(encoding='ascii')
    path.write_text(text.replace('# baud', '# guest: 1234 pty:/home/me/hmi\n# ports: moxa:4001\n'
                                 '# baud'), encoding='ascii')
    drawn(tmp_path, capsys, str(path), '--anonymous')
    page = (tmp_path / 'line.html').read_text(encoding='utf-8')
    for name in ('secret', str(tmp_path), 'home', 'hmi', 'moxa', '4660', 'N7:0', '1234'):
        assert name not in page, name
    assert 'command: 0F/A2' in page
    assert 'STS 10' in page and 'STS 00' not in page


def test_messages_are_printed_where_they_are_asked_for(tmp_path: Path, capsys: Output) -> None:
    file = capture(tmp_path / 'line.cap', exchange(0.1, 1))
    page, bundle = ('--html', str(tmp_path / 'x.html')), ('--report', str(tmp_path / 'x.zip'))
    for args in (page, bundle, (*page, *bundle)):
        assert call(main, capsys, file, *args).out.startswith('summary: ')
    for args in ((), (*page, '--json')):
        assert len(call(main, capsys, file, *args).out.splitlines()) > 5


@pytest.mark.parametrize(('args', 'text'), [
    (('--anonymous',), '--anonymous is for --report and --html'),
    (('--html', 'line.html'), 'was not made by --html'),
    (('--html', 'no/line.html'), 'argument --html: no/line.html: No such file or directory'),
    (('--html', 'line.html/x'), 'argument --html: line.html/x: Not a directory'),
    (('--html', '.'), 'argument --html: .: Is a directory'),
    (('--html', '/dev/full'), 'sniff: --html: /dev/full: No space left on device'),
    (('--html', '/dev/full', '--seconds', '1e-9'), 'sniff: --html: /dev/full: No space')])
def test_timeline_that_cannot_be_written_is_told(
        tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch, args: tuple[str, ...],
        text: str) -> None:
    monkeypatch.chdir(tmp_path)
    Path('line.html').write_text('mine', encoding='utf-8')
    said = call(main, capsys, *args, capture(Path('line.cap'), exchange(0.1, 1)))
    assert said.status == 2
    assert text in said.err
    assert bool(said.out) == ('/dev/full' in args)  # all else is found before the decoding
    assert Path('line.html').read_text(encoding='utf-8') == 'mine'


def long_line(tmp_path: Path, capsys: Output, count: int) -> Path:
    """Return the page of ``count`` exchanges of five frames each, and of two faults."""
    parts = [exchange(0.06 * number, number, station=1 + number % 3) for number in range(count)]
    drawn(tmp_path, capsys, capture(tmp_path / 'line.cap', *parts, silence(121.0, station=9),
                                    exchange(121.5, 1)))
    page = tmp_path / 'line.html'
    assert messages(tmp_path).bars('ask') == count + 1
    assert messages(tmp_path).bars('missing') == 1
    shown, written = browser.dom(page, tmp_path), browser.Elements(page.read_text('utf-8'))
    for look in ('ask', 'answer', 'small', 'missing'):
        assert shown.bars(look) == written.bars(look)
    return page


def test_browser_shows_all_frames_with_their_faults(tmp_path: Path, capsys: Output) -> None:
    long_line(tmp_path, capsys, 100)


@pytest.mark.long
def test_browser_shows_ten_thousand_frames_in_their_colours(
        tmp_path: Path, capsys: Output) -> None:
    page = long_line(tmp_path, capsys, 2000)
    assert page.stat().st_size < 4_000_000
    assert {(0xFB, 0xE3, 0xE1), (0x2E, 0x8B, 0x57)} <= browser.colours(page, tmp_path)
