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

"""Files of recorded bytes, as several programs write them."""

import gzip
from pathlib import Path

from abdf1_ros.problems import Problem
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.dumps import read_hex, Recording
from hypothesis import given, strategies
import pytest
from support.cases import for_all

DATA = bytes.fromhex('100501ff1004') + bytes(range(256))


def joined(lines: list[str]) -> bytes:
    return b''.join(chunk.data for chunk in read_hex('x', lines))


def xxd(data: bytes) -> list[str]:
    """Return what xxd prints."""
    return [f'{at:08x}: {part.hex(" ", -2):<39}  {_characters(part)}' for at, part in _parts(data)]


def hexdump(data: bytes) -> list[str]:
    """Return what hexdump -C prints, lines that repeat left out."""
    lines, last = [], b''
    for at, part in _parts(data):
        if part != last or len(part) < 16:
            left, right = part[:8].hex(' '), part[8:].hex(' ')
            lines.append(f'{at:08x}  {left:<23}  {right:<23}  |{_characters(part)}|')
        elif lines[-1] != '*':
            lines.append('*')
        last = part
    return [*lines, f'{len(data):08x}'] if data else []


def _parts(data: bytes) -> list[tuple[int, bytes]]:
    return [(at, data[at:at + 16]) for at in range(0, len(data), 16)]


def _characters(data: bytes) -> str:
    return ''.join(chr(byte) if 32 <= byte < 127 else '.' for byte in data)


@for_all('text', [
    '10 05 01 FF', '100501ff', '1005 01ff', '0x10, 0x05, 0x01, 0xFF', '10,05,01,FF',
    '  10 05 01 FF  ', '# a poll\n10 05\n\n01 FF\n'])
def test_bytes_alone_are_read_in_any_notation(text: str) -> None:
    assert joined(text.splitlines()) == b'\x10\x05\x01\xff'


@given(strategies.one_of(
    strategies.binary(max_size=70),
    strategies.tuples(strategies.binary(min_size=1, max_size=2), strategies.integers(1, 80)).map(
        lambda pair: pair[0] * pair[1])))
def test_dumps_with_offsets_give_back_their_bytes(data: bytes) -> None:
    assert joined(xxd(data)) == data
    assert joined(hexdump(data)) == data


def test_lines_left_out_by_hexdump() -> None:
    data = b'\x10\x05' + bytes(100)
    assert '*' in hexdump(data)
    assert joined(hexdump(data)) == data
    assert joined(['00000000']) == bytes(4)  # there is no offset without bytes before it
    assert joined([*xxd(b'\x10\x05'), '0601ff10']) == bytes.fromhex('1005 0601ff10')
    data = bytes(160)  # the last line is whole, so the offset alone ends the repetition
    assert hexdump(data)[1:] == ['*', '000000a0']
    assert joined(2 * hexdump(data)) == 2 * data


@pytest.mark.parametrize('offset', ['ffffffff', '0000000f', 'f' * 5000])
def test_offset_that_cannot_follow_what_was_left_out(offset: str) -> None:
    for line in (offset, f'{offset}  10 05'):
        chunks = read_hex('x', [f'00000000  {"10 05 " * 8}', '*', line])
        next(chunks)
        with pytest.raises(Problem, match='x:3: the offset does not fit: "[*]" stands for lines'):
            next(chunks)


@for_all('line', ['10 5', 'hello', '0000000 0510 ff01', '1 2 3', '*', '00000000: 1x'])
def test_bad_line_is_named(line: str) -> None:
    for before in {'10 04', '00000000: 1004  ..'} if line != '*' else {'10 04'}:
        with pytest.raises(Problem, match='is not a hexadecimal dump; write bytes as') as caught:
            joined([before, line])
        assert str(caught.value).startswith('x:2: ')


def chunks(path: Path, content: bytes, is_binary: bool = False) -> list[Chunk]:
    path.write_bytes(content)
    return list(Recording(path, is_binary).chunks())


def test_kinds_of_files_are_told_apart(tmp_path: Path) -> None:
    path = tmp_path / 'x'
    poll = Chunk(None, Direction.UNKNOWN, b'\x10\x05\x01\xff')
    assert chunks(path, b'10 05 01 FF\r\n') == [poll]
    assert chunks(path, b'# abdf1_ros capture 1\r\n0.5 > 10 05 01 FF\r\n') == [
        Chunk(0.5, Direction.OUT, poll.data)]
    assert chunks(path, b'\x1f\x8b', True)[0].data == b'\x1f\x8b'  # though gzip begins so
    assert chunks(path, b'0000000 0510 ff01\n0000004\n') == [poll]
    assert chunks(path, b'') == []
    with pytest.raises(Problem, match='x:2: this is not text; for a file of raw bytes give --bin'):
        chunks(path, b'10 05\n\xe9\n')


def test_binary_of_any_size_is_read_whole(tmp_path: Path) -> None:
    assert b''.join(chunk.data for chunk in chunks(tmp_path / 'x', DATA * 100, True)) == DATA * 100
    recording = Recording(tmp_path / 'x', is_binary=True)
    first, *_, last = (recording.percent for _ in recording.chunks())
    assert (first, last) == (15, 100)


def test_line_of_1_mb_is_read_and_a_longer_one_refused(tmp_path: Path) -> None:
    longest = b'10' * 500_000
    assert [len(chunk.data) for chunk in chunks(tmp_path / 'x', b'10\n' + longest)] == [1, 500_000]
    with pytest.raises(Problem, match='x:2: the line is longer than 1 MB; divide it, or for a '
                                      'file of raw bytes give --binary'):
        chunks(tmp_path / 'x', b'10\n' + longest + b'1')


@pytest.fixture
def recording(tmp_path: Path) -> Recording:
    path = tmp_path / 'x'
    path.write_text('# abdf1_ros capture 1\n# check: BCC\n0 > 10\n1 > 20\n', encoding='ascii')
    return Recording(path)


def test_settings_of_a_capture_are_known_once_it_is_read(recording: Recording) -> None:
    assert len(list(recording.chunks())) == 2
    assert recording.settings == {'check': 'BCC'}


def test_percent_tells_how_much_has_been_read(recording: Recording) -> None:
    percents = [recording.percent for _ in recording.chunks()]
    assert 0 < percents[0] < percents[1] == 100


def test_percent_of_a_packed_file_ends_at_100(tmp_path: Path) -> None:
    path = tmp_path / 'x.gz'
    lines = (f'{second} > 10\n' for second in range(1000))
    path.write_bytes(gzip.compress(b'# abdf1_ros capture 1\n' + ''.join(lines).encode()))
    recording = Recording(path)
    assert max(recording.percent for _ in recording.chunks()) == 100


def test_file_has_a_size_and_a_device_has_none(recording: Recording) -> None:
    assert recording.has_size
    assert not Recording(Path('/dev/zero')).has_size


def test_recording_that_is_missing_is_file_not_found(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        Recording(tmp_path / 'nothing')
