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

"""Captures: written, read again, limited, refused."""

from collections.abc import Callable
import os
from pathlib import Path
import stat
from types import MappingProxyType

from abdf1_ros.problems import Problem
from abdf1_ros.sniffer import capture
import pytest
from support.cases import for_all

CHUNKS = [capture.Chunk(0.0, capture.Direction.OUT, b'\x10\x05\x01\xff'),
          capture.Chunk(0.00421, capture.Direction.IN, b'\x10\x04'),
          capture.Chunk(1772000000.5, capture.Direction.UNKNOWN, b'\x00')]
TEXT = """\
# abdf1_ros capture 1
# baud: 19200
0.000000 > 10 05 01 FF
0.004210 < 10 04
1772000000.500000 ? 00
"""


def lines_of(path: Path) -> list[str]:
    return path.read_text(encoding='ascii').splitlines()


def chunks_of(path: Path) -> list[capture.Chunk]:
    return list(capture.read_capture(str(path), lines_of(path), {}))


def test_capture_is_text_that_is_there_before_it_is_closed(tmp_path: Path) -> None:
    writer = capture.CaptureWriter(tmp_path / 'x', settings={'baud': '19200'})
    for chunk in CHUNKS:
        writer.write(chunk)
    assert (tmp_path / 'x').read_text(encoding='ascii') == TEXT  # before it is closed
    writer.close()
    settings: dict[str, str] = {}
    assert list(capture.read_capture('x', TEXT.splitlines(), settings)) == CHUNKS
    assert settings == {'baud': '19200'}


def test_guest_is_told_with_the_next_chunk() -> None:
    text = ['# abdf1_ros capture 1', '# guest: 0001 tcp:a', '# guest: A40E pty:/tmp/hmi',
            '0.0 > 10', '0.1 > 05']
    guests = [chunk.guest for chunk in capture.read_capture('x', text, {})]
    assert guests == ['A40E pty:/tmp/hmi', '']


def test_blank_lines_remarks_and_a_second_head_may_stand_anywhere() -> None:
    head, *rest = TEXT.splitlines()
    text = [head, '', '# port lost', '# baud: 9600', *rest, head, '# check: BCC', '   ', *rest]
    settings: dict[str, str] = {}
    assert list(capture.read_capture('x', text, settings)) == CHUNKS * 2
    assert settings == {'baud': '19200', 'check': 'BCC'}


def test_it_never_takes_more_than_the_limit(tmp_path: Path) -> None:
    path, old = tmp_path / 'x', tmp_path / 'x.1'
    writer = capture.CaptureWriter(path, 992, MappingProxyType({'baud': '1200'}))
    writer.write({'baud': '9600'})
    for count in range(200):
        writer.write(capture.Chunk(count / 10, capture.Direction.IN, bytes((count,))))
        assert path.stat().st_size + (old.stat().st_size if old.exists() else 0) <= 992
    with pytest.raises(OSError, match='is being written by another'):
        capture.CaptureWriter(path)
    writer.close()
    last = chunks_of(old) + chunks_of(path)
    assert [chunk.data[0] for chunk in last] == list(range(200 - len(last), 200))
    assert len(last) > 20
    assert lines_of(path)[:2] == ['# abdf1_ros capture 1', '# baud: 9600']
    assert sorted(file.name for file in tmp_path.iterdir()) == ['x', 'x.1']


def test_the_limit_counts_escapes(tmp_path: Path) -> None:
    path, old = tmp_path / 'x', tmp_path / 'x.1'
    writer = capture.CaptureWriter(path, 1000, {'port': '/dev/s' + 41 * '\xe9'})
    for count in range(50):
        writer.write(capture.Chunk(count / 10, capture.Direction.IN, b'\x10\x04'))
    writer.close()
    assert max(path.stat().st_size, old.stat().st_size) <= 500
    assert lines_of(path)[1] == r'# port: /dev/s' + 41 * r'\xe9'


def test_older_capture_is_put_aside(tmp_path: Path) -> None:
    path = tmp_path / 'x.1'
    for chunk in CHUNKS:
        writer = capture.CaptureWriter(path)
        with pytest.raises(OSError, match='is being written by another; give another name'):
            capture.CaptureWriter(tmp_path / 'x')  # such as that of another line
        writer.write(chunk)
        writer.close()
    assert chunks_of(path) == CHUNKS[2:]
    assert chunks_of(tmp_path / 'x.1.1') == CHUNKS[1:2]
    path.unlink()
    capture.CaptureWriter(path).close()
    assert chunks_of(tmp_path / 'x.1.1') == CHUNKS[1:2]


def test_others_cannot_read_a_capture(tmp_path: Path) -> None:
    (tmp_path / 'x').touch()
    before = os.umask(0)
    try:
        capture.CaptureWriter(tmp_path / 'x').close()
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / 'x').stat().st_mode) == 0o640


def test_other_files_are_left_alone(tmp_path: Path) -> None:
    path = tmp_path / 'x'
    path.write_text('important', encoding='ascii')
    with pytest.raises(OSError, match='is not a capture; give another name'):
        capture.CaptureWriter(path)
    assert path.read_text(encoding='ascii') == 'important'
    path.rename(tmp_path / 'y.1')  # where an older part of a capture y goes
    with pytest.raises(OSError, match=r'exists and is not a capture.*y\.1'):
        capture.CaptureWriter(tmp_path / 'y')
    assert (tmp_path / 'y.1').read_text(encoding='ascii') == 'important'
    (tmp_path / 'device').symlink_to('/dev/null')  # a fault here must not rename that of the host
    for place in (tmp_path / 'device', tmp_path):
        with pytest.raises(OSError, match='is not a capture'):
            capture.CaptureWriter(place)
    with pytest.raises(FileNotFoundError):
        capture.CaptureWriter(tmp_path / 'nowhere' / 'x')


def rotated_by_copy(path: Path, to: Path) -> None:
    """Do what logrotate does with ``copytruncate``."""
    to.write_bytes(path.read_bytes())
    os.truncate(path, 0)


def rotated_by_move(path: Path, to: Path) -> None:
    """Do what logrotate does with ``create``."""
    path.rename(to)
    path.touch()


@pytest.mark.parametrize(('take_away', 'told'), [
    (rotated_by_copy, ['was cut; the recording begins again in it']),
    (lambda path, to: os.truncate(path, 30), ['was cut; the recording begins again in it']),
    (rotated_by_move, ['was moved or deleted; the recording goes on in a new file']),
    (lambda path, to: path.rename(to), ['was moved or deleted; the recording goes on in a new '
                                        'file']),
    (lambda path, to: path.unlink(), ['was moved or deleted; the recording goes on in a new '
                                      'file'])])
def test_capture_that_others_take_away_begins_again(
        tmp_path: Path, take_away: Callable[[Path, Path], None], told: list[str]) -> None:
    path, copy = tmp_path / 'x', tmp_path / 'x.1'
    news: list[str] = []
    writer = capture.CaptureWriter(path, settings={'baud': '19200'}, tell=news.append)
    before, *after = CHUNKS
    writer.write(before)
    for _ in range(2):
        take_away(path, copy)
        for chunk in after:
            writer.write(chunk)
        assert (news, chunks_of(path)) == (told, after)
        assert lines_of(path)[:2] == ['# abdf1_ros capture 1', '# baud: 19200']
        assert stat.S_IMODE(path.stat().st_mode) == 0o640
        news.clear()
        if copy.exists():
            assert chunks_of(copy) == [before]
            copy.unlink()
        before, after = CHUNKS[2], [CHUNKS[2]]
        writer.close()
        writer = capture.CaptureWriter(path, settings={'baud': '19200'}, tell=news.append)
        writer.write(before)  # a start after it finds captures only
        copy.unlink(missing_ok=True)
    writer.close()


def test_what_others_have_put_in_the_place_of_a_capture_stays(tmp_path: Path) -> None:
    path = tmp_path / 'x'
    writer = capture.CaptureWriter(path)
    writer.write(CHUNKS[0])
    path.rename(tmp_path / 'y')
    path.write_text('important', encoding='ascii')
    with pytest.raises(OSError, match='exists and is not a capture'):
        writer.write(CHUNKS[1])
    writer.close()
    assert path.read_text(encoding='ascii') == 'important'
    assert chunks_of(tmp_path / 'y') == CHUNKS[:1]
    path.rename(tmp_path / 'z.1')
    writer = capture.CaptureWriter(tmp_path / 'y', 100)
    (tmp_path / 'z.1').replace(tmp_path / 'y.1')
    with pytest.raises(OSError, match=r'exists and is not a capture.*y\.1'):
        writer.write(capture.Chunk(0.0, capture.Direction.IN, bytes(20)))
    writer.close()
    assert (tmp_path / 'y.1').read_text(encoding='ascii') == 'important'


def test_empty_file_does_not_replace_a_rotated_capture(tmp_path: Path) -> None:
    (tmp_path / 'x.1').write_text(TEXT, encoding='ascii')
    (tmp_path / 'x').touch()
    capture.CaptureWriter(tmp_path / 'x').close()
    assert (tmp_path / 'x.1').read_text(encoding='ascii') == TEXT


@for_all('line', [
    '0.1 > 10 0', '0.1 > zz', '0.1 = 10 04', '0.1', 'soon > 10 04', '> 10 04', 'x',
    'nan > 10 04', '-inf > 10 04', '1_0.5 > 10 04'])
def test_bad_line_is_named(line: str) -> None:
    with pytest.raises(Problem, match='should be seconds, ">", "<" or "[?]", and bytes') as caught:
        list(capture.read_capture('a.cap', ['# abdf1_ros capture 1', '', line], {}))
    assert str(caught.value).startswith('a.cap:3: ')


def test_other_version_is_refused() -> None:
    assert capture.is_capture_line('# abdf1_ros capture 2')
    assert not capture.is_capture_line('# baud: 9600')
    with pytest.raises(Problem, match='a.cap:1: ".* capture 2" should be ".* capture 1"'):
        list(capture.read_capture('a.cap', ['# abdf1_ros capture 2'], {}))


def test_only_the_beginning_of_a_long_line_is_shown() -> None:
    for lines in (['# abdf1_ros capture' + 'x' * 500], [TEXT.splitlines()[0], 'x' * 500],
                  *([TEXT.splitlines()[0], f'{sign}{10 ** 10:0300} > 10'] for sign in ('', '-'))):
        with pytest.raises(Problem) as caught:
            list(capture.read_capture('a.cap', lines, {}))
        assert len(str(caught.value)) < 200
