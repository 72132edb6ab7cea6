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
