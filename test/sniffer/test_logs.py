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

"""Files of recorded bytes, as several programs write them, and logs of serial port monitors."""

from collections.abc import Callable, Iterator
from contextlib import suppress
import gzip
from itertools import count
from pathlib import Path

from abdf1_ros.problems import Problem
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.dumps import read_hex, read_words, Recording
from hypothesis import given
from hypothesis import strategies as st
import pytest
from support.cases import for_all

DATA = bytes.fromhex('100501ff1004') + bytes(range(256))


def joined(lines: list[str]) -> bytes:
    return b''.join(chunk.data for chunk in read_hex('x', lines))


def characters(data: bytes) -> str:
    return ''.join(chr(byte) if 32 <= byte < 127 else '.' for byte in data)


def rows(data: bytes) -> Iterator[tuple[int, bytes]]:
    return ((at, data[at:at + 16]) for at in range(0, len(data), 16))


def xxd(data: bytes) -> list[str]:
    """Return what xxd prints."""
    return [f'{at:08x}: {part.hex(" ", -2):<39}  {characters(part)}' for at, part in rows(data)]


def hexdump(data: bytes) -> list[str]:
    """Return what hexdump -C prints, lines that repeat left out."""
    lines, last = [], b''
    for at, part in rows(data):
        if part != last or len(part) < 16:
            left, right = part[:8].hex(' '), part[8:].hex(' ')
            lines.append(f'{at:08x}  {left:<23}  {right:<23}  |{characters(part)}|')
        elif lines[-1] != '*':
            lines.append('*')
        last = part
    return [*lines, f'{len(data):08x}'] if data else []


@for_all('text', [
    '10 05 01 FF', '100501ff', '1005 01ff', '0x10, 0x05, 0x01, 0xFF', '000000: 10,05,01,FF',
    '  10 05 01 FF  ', '# a poll\n10 05\n\n01 FF\n', '2024-05-01T10:00:00.120 10 05 01 FF'])
def test_bytes_alone_are_read_in_any_notation(text: str) -> None:
    assert joined(text.splitlines()) == b'\x10\x05\x01\xff'


@given(st.one_of(
    st.binary(max_size=70),
    st.tuples(st.binary(min_size=1, max_size=2), st.integers(1, 80)).map(
        lambda pair: pair[0] * pair[1])))
def test_dumps_with_offsets_give_back_their_bytes(data: bytes) -> None:
    assert joined(xxd(data)) == data
    assert joined(hexdump(data)) == data


def test_lines_left_out_by_hexdump() -> None:
    data = b'\x10\x05' + bytes(100)
    assert '*' in hexdump(data)
    assert joined(hexdump(data)) == data
    assert joined(['00000000']) == bytes(4)  # there is no offset without bytes before it
    assert joined([*xxd(b'\x10\x05'), '*', '00000006: 0601', '0601ff10']) == bytes.fromhex(
        '1005 1005 1005 0601 0601ff10')
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


def test_all_that_is_left_out_in_a_file_is_no_more_than_in_one_place() -> None:
    """Otherwise a few bytes of text would stand for hours of work each."""
    row = 5000 * '1005'
    chunks = read_hex('x', [f'00000000: {row}', '*', f'{60_000_000:08x}: {row}', '*',
                            f'{120_000_000:08x}: {row}'])
    assert sum(len(next(chunks).data) for _ in range(6001)) == 60_010_000
    with pytest.raises(Problem, match='x:5: the offset does not fit.* for at most 100 MB'):
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
    assert chunks(path, b'100501FF\r\n') == [poll]
    assert chunks(path, b'# abdf1_ros capture 1\r\n0.5 > 10 05 01 FF\r\n') == [
        Chunk(0.5, Direction.OUT, poll.data)]
    assert chunks(path, b'\x1f\x8b', True)[0].data == b'\x1f\x8b'  # though gzip begins so
    assert chunks(path, b' 0000000 0510 ff01\n0000004\n') == [poll]
    assert chunks(path, b'') == []
    with pytest.raises(Problem, match='x:2: this is not text; for a file of raw bytes give --bin'):
        chunks(path, b'10 05\n\xe9\n')


@pytest.mark.parametrize('head', [
    'time,station,address,value', 'time,station,address,tag,value',
    'time,station,address,tag,value,reason', 'time,topic,address,values'])
def test_file_of_values_leads_to_the_program_that_draws_them(tmp_path: Path, head: str) -> None:
    row = b'2026-03-01T14:05:09.000,1,N7:0,100501FF'  # a value that could be bytes
    with pytest.raises(Problem, match='x:1: values, not bytes: "plc plot" draws them'):
        chunks(tmp_path / 'x', head.encode() + b'\r\n' + row)


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


# Logs: what each form says comes back, or the line is refused


OUT, IN, UNKNOWN = Direction.OUT, Direction.IN, Direction.UNKNOWN
# A read of an SLC, its ACK, the reply and its ACK: what went out first.
SAID = [(OUT, '10 02 02 05 0F 00 34 12 A2 04 07 89 00 00 10 03 B7 2A'), (IN, '10 06'),
        (IN, '10 02 05 02 4F 00 34 12 41 42 43 44 10 03 11 22'), (OUT, '10 06')]
Writer = Callable[[list[tuple[Direction, bytes]]], Iterator[str]]


def word(way: Direction, names: str) -> str:
    return names.split()[way is IN]


def terminal(said: list[tuple[Direction, bytes]]) -> Iterator[str]:
    for way, data in said:
        yield f'{word(way, "TX: RX:")} {data.hex(" ").upper()}'


def array(said: list[tuple[Direction, bytes]]) -> Iterator[str]:
    for _, data in said:
        yield '{ ' + ', '.join(f'0x{byte:02x}' for byte in data) + ' },'


def dashes(said: list[tuple[Direction, bytes]]) -> Iterator[str]:
    for _, data in said:
        yield data.hex('-').upper()


def docklight(said: list[tuple[Direction, bytes]]) -> Iterator[str]:
    for number, (way, data) in enumerate(said):
        yield (f'25.11.2026 19:00:00.{number:03} {word(way, "[TX] [RX]")} - '
               f'{data.hex(" ").upper()} ')


def monitor(said: list[tuple[Direction, bytes]]) -> Iterator[str]:
    for number, (way, data) in enumerate(said):
        yield f'[25/11/2026 19:00:{number:02}] {word(way, "Written Read")} data (COM12)'
        for _, row in rows(data):
            yield f'    {row.hex(" "):<47}   {characters(row)}'


def driver(said: list[tuple[Direction, bytes]]) -> Iterator[str]:
    yield '0\t0.00000000\tapp.exe\tIRP_MJ_CREATE\tSerial10\tSUCCESS\tOptions: Open '
    yield '1\t0.00001000\tapp.exe\tIOCTL_SERIAL_SET_CHARS\tSerial10\tSUCCESS\tXON:11 XOFF: 13'
    for number, (way, data) in enumerate(said, 2):
        yield (f'{number}\t{number / 1000:.8f}\tapp.exe\tIRP_MJ_{word(way, "WRITE READ")}'
               f'\tSerial10\tSUCCESS\tLength {len(data)}: {data.hex(" ").upper()} \t')


def spy(said: list[tuple[Direction, bytes]]) -> Iterator[str]:
    for number, (way, data) in enumerate(said):
        for at, row in rows(data):
            left, right = row[:8].hex(' ').upper(), row[8:].hex(' ').upper()
            yield (f'{number / 1000:010.3f} {word(way, "TX RX")}   {at:04X}  {left:<23}  '
                   f'{right:<23}  {characters(row)}')


def python(said: list[tuple[Direction, bytes]]) -> Iterator[str]:
    for way, data in said:
        yield f'{word(way, "Sent: Received:")} {data!r}'


def analyser(said: list[tuple[Direction, bytes]]) -> Iterator[str]:
    yield 'Time [s],Value,Parity Error,Framing Error'
    for number, byte in enumerate(b''.join(data for _, data in said)):
        yield f'{number / 1000:.6f},0x{byte:02X},,'


def relay(said: list[tuple[Direction, bytes]]) -> Iterator[str]:
    at = 0
    for number, (way, data) in enumerate(said):
        yield (f'{way.value} 2026/11/25 19:00:00.{number:06}  length={len(data)} from={at} '
               f'to={at + len(data) - 1}')
        yield f' {data.hex(" ")}'
        at += len(data)


def two_ports(said: list[tuple[Direction, bytes]]) -> Iterator[str]:
    for number, (way, data) in enumerate(said):
        yield f'2026-11-25 19:00:00.{number:06}: {word(way, "ttyS0 ttyS1")}'
        for _, row in rows(data):
            yield f'{row.hex(" ").upper():<47}       {characters(row)}'


def modem(said: list[tuple[Direction, bytes]]) -> Iterator[str]:
    for number, (way, data) in enumerate(said):
        yield f'13:33:33.{number:03} {word(way, "tx rx;i"):<4}   {len(data):>3} | S00'
        text = data.hex().upper()
        yield ' '.join(text[at:at + 4] for at in range(0, len(text), 4)) + ' '


WITH_WAYS = [terminal, docklight, monitor, driver, spy, python, relay, modem]
WITH_TIMES = [docklight, monitor, driver, spy, relay, two_ports, analyser, modem]
FORMS = [*WITH_WAYS, array, dashes, analyser, two_ports]


def read(lines: Iterator[str]) -> list[Chunk]:
    return list(read_hex('x', lines))


@for_all('write', FORMS)
def test_each_form_gives_back_bytes_directions_and_times(write: Writer) -> None:
    said = [(way, bytes.fromhex(text)) for way, text in SAID]
    chunks = read(write(said))
    assert b''.join(chunk.data for chunk in chunks) == b''.join(data for _, data in said)
    if write in WITH_WAYS:
        merged: list[tuple[Direction, bytes]] = []
        for chunk in chunks:  # rows of one message, and messages of one way after each other
            before = merged.pop() if merged and merged[-1][0] is chunk.direction else (
                chunk.direction, b'')
            merged.append((chunk.direction, before[1] + chunk.data))
        assert merged == [said[0], (IN, said[1][1] + said[2][1]), said[3]]
    else:
        assert {chunk.direction for chunk in chunks} == {UNKNOWN}
    times = [chunk.time for chunk in chunks]
    if write in WITH_TIMES:
        known = [time for time in times if time is not None]
        assert times == sorted(known)
        assert known[-1] > known[0] >= 0
    else:
        assert set(times) == {None}


@given(st.sampled_from(FORMS), st.lists(st.tuples(
    st.sampled_from([OUT, IN]), st.binary(min_size=1, max_size=40)), min_size=1, max_size=5))
def test_whatever_the_bytes_are_none_is_misread(
        write: Writer, said: list[tuple[Direction, bytes]]) -> None:
    with suppress(Problem):
        chunks = read(write(said))
        assert b''.join(chunk.data for chunk in chunks) == b''.join(data for _, data in said)


@given(st.binary(min_size=1, max_size=70), st.sampled_from(['07x', '07o']))
def test_words_of_hexdump_and_od_give_back_their_bytes(data: bytes, offset: str) -> None:
    lines = []
    for at, row in rows(data):
        pairs = [row[n:n + 2].ljust(2, b'\0')[::-1].hex() for n in range(0, len(row), 2)]
        lines.append(f'{at:{offset}} {" ".join(pairs)}')
    chunks = list(read_words('x', [*lines, f'{len(data):{offset}}']))
    assert b''.join(chunk.data for chunk in chunks) == data
    assert {(chunk.time, chunk.direction) for chunk in chunks} == {(None, UNKNOWN)}


def test_words_are_given_out_line_by_line() -> None:
    """A dump of 100 MB is never in the memory as a whole."""
    lines = (f'{16 * number:07x} {"0210 " * 8}' for number in count())
    chunks = read_words('x', lines)
    assert [next(chunks).data for _ in range(100)] == 100 * [8 * b'\x10\x02']
    assert int(next(lines)[:7], 16) == 16 * 101  # one line ahead


@pytest.mark.parametrize(('lines', 'text'), [
    (['0000000 0210', '*', '0000040'], 'use "hexdump -v" or "hexdump -C"'),
    (['0000000 0210', '0000003 0310'], 'the offset does not follow 2 bytes'),
    (['0000000 0210', 'TX 10'], 'is not an offset and words')])
def test_words_whose_offsets_do_not_fit_are_refused(lines: list[str], text: str) -> None:
    with pytest.raises(Problem, match=text):
        list(read_words('x', lines))


@for_all('line', [
    '12:00:01 RX ' + 900_000 * '-' + ' 10 06', '12:00:01 ' + 900_000 * '<' + ' x 10 06',
    '12:00:01 RX ' + 200_000 * 'AA  ' + 'zz', '12:00:01 RX ' + 200_000 * '20  ' + 'zz',
    '12:00:01 RX ' + 200_000 * 'AA\t' + 'zz', "12:00:01 RX b'" + 900_000 * '\\'])
def test_no_line_takes_more_than_a_few_looks_at_each_sign(line: str) -> None:
    """Where each sign asked for a look at all others, this would take longer than any test may."""
    with suppress(Problem):
        read(iter([line]))


@for_all('line', [
    'TX 02 10 06',  # a count and two bytes, or three bytes
    'TX 10 06    ABCD', 'TX  41 42 43  A-C', 'TX: 10 0', 'TX 10 06 and more', 'COM1, opened',
    'TX: 10:06', 'RX 1006 1', 'port 10 06', '10 5 TX', 'TX  10 06  XY',
    # what would be left over
    '12:00:01.000 TX 10 05 01 FF RX 10 04', 'TX 10 05 01 FF BCC 0A', 'TX: 10 05 01 FF len: 04',
    'TX10 05 01 FF', 'TX100501FF', '>10 05 01', 'TX 10 5 01 FF', 'RX 10 0 04', 'TX 5 tx FF',
    '12:00:01 10 5 01 FF', 'TX 100501FF 0A', 'TX 100501FF', 'RX 10h 04h', 'RX 0X10|0X04',
    r'RX \x10\x04', r"TX b'\x10\x05' RX b'\x10\x04'", r"TX b'\x10' 06", r"TX b'\x1'", "TX b'AG"])
def test_what_can_be_read_in_two_ways_is_refused(line: str) -> None:
    with pytest.raises(Problem, match='is not a hexadecimal dump'):
        assert read(iter(['TX: 10 05', line])) == []


def test_characters_that_look_like_bytes_staycharacters() -> None:
    data = b'41 42  4'
    for line in (f'TX  {data.hex(" ")}  {characters(data)}',
                 f'TX   0000  {data.hex(" ")}   {characters(data)}'):
        chunk, = read(iter([line]))
        assert (chunk.data, chunk.direction) == (data, OUT)
    lines = 'TX  41 10 20 7F 43 44  A___C.', 'TX  34 31 20 2B  41 +', 'TX  41 10 20  A_'
    assert [chunk.data for chunk in read(iter(lines))] == [b'A\x10 \x7fCD', b'41 +', b'A\x10 ']


@for_all('line', [
    'TX1 10 06', 'TX (2) 10 06', 'TX #17 10 06', 'TX 2 bytes: 10 06', 'RX a bad reply: 10 06',
    'RX 12.5 ms: 10 06', '7 12:00:01 10 06', 'uint8_t tx[2] = { 0X10, 0X06 };',
    '"data",0.0005,0.0001,0x10,0x06', r"Sent 2: b'\x10\x06' (2 bytes)"])
def test_counts_labels_and_words_are_not_left_over_bytes(line: str) -> None:
    assert [chunk.data for chunk in read(iter([line]))] == [b'\x10\x06']


def test_time_of_day_goes_on_after_midnight() -> None:
    times = ['23:59:59.900', '00:00:00.100', '00:00:01,100', '00:00:00.600', '20:00:00.000',
             '00:00:00.100']
    chunks = read(iter(f'{time} TX: 10 05' for time in times))
    assert [chunk.time for chunk in chunks] == pytest.approx(
        [0.0, 0.2, 1.2, 0.7, 72000.1, 86400.2])
    chunks = read(iter(f'{time} TX: 10 05' for time in ('1732700000123456.000', '0.000', '0.250')))
    assert [chunk.time for chunk in chunks][1:] == [0.0, 0.25]  # the clock began again


def test_direction_holds_for_lines_without_one_until_the_next() -> None:
    lines = ['TX 1.250 10 02', '01 02', 'RX 23:59:59 10 06', '[00:00:01] 01 15',
             'uint8_t tx[] = { 0x10, 0x04 };']
    assert [(chunk.direction, chunk.data.hex()) for chunk in read(iter(lines))] == [
        (OUT, '1002'), (OUT, '0102'), (IN, '1006'), (IN, '0115'), (OUT, '1004')]
    for way, known in (
            (OUT, 'send sending write wrote out transmit Transmitted > >> >>> -> -->'),
            (IN, 'receive recv receiving read in < << <<< <- <--')):
        assert {read(iter([f'{name} 10 06']))[0].direction for name in known.split()} == {way}


@for_all('line', [
    '19:00:00.100', '19:00:00.100 ttyS1', 'written and read:', 'in, out: 10 06',
    'uint8_t data[] = { 0x10, 0x06 };'])
def test_direction_does_not_hold_beyond_a_line_that_does_not_say_which(line: str) -> None:
    chunks = read(iter(['TX: 10 02', line, '10 06']))
    assert [chunk.direction for chunk in chunks] == [OUT] + [UNKNOWN] * (len(chunks) - 1)
    assert chunks[-1].data == b'\x10\x06'
