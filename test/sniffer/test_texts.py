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

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
import gzip
from itertools import count
from pathlib import Path
import re
from tempfile import TemporaryDirectory

from abdf1_ros.problems import Problem
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.dumps import Recording
from abdf1_ros.sniffer.marks import TextClock
from abdf1_ros.sniffer.texts import TextReader
from hypothesis import assume, given
from hypothesis import strategies as st
import pytest
from support.cases import for_all

DATA = bytes.fromhex('100501ff1004') + bytes(range(256))


def read(lines: Iterable[str]) -> list[Chunk]:
    return list(TextReader('x').chunks(iter(lines)))


def joined(lines: Iterable[str]) -> bytes:
    return b''.join(chunk.data for chunk in read(lines))


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
    assert joined(['00000000: 1005', '*', '00000006: 0601', '0601ff10']) == bytes.fromhex(
        '1005 1005 1005 0601 0601ff10')
    data = bytes(160)  # the last line is whole, so the offset alone ends the repetition
    assert hexdump(data)[1:] == ['*', '000000a0']
    assert joined(2 * hexdump(data)) == 2 * data


@for_all('offset', ['ffffffff', '0000000f', 'f' * 5000])
def test_offset_that_cannot_follow_what_was_left_out(offset: str) -> None:
    with pytest.raises(Problem, match='x:3: the offset does not fit: "[*]" stands for lines'):
        read([f'00000000  {"10 05 " * 8}', '*', offset])


def test_all_that_is_left_out_in_a_file_is_no_more_than_in_one_place() -> None:
    """Otherwise a few bytes of text would stand for hours of work each."""
    row = 5000 * '1005'
    lines = [f'00000000: {row}', '*', f'{60_000_000:08x}: {row}', '*']
    assert sum(len(chunk.data) for chunk in read(lines)) == 60_010_000
    with pytest.raises(Problem, match='x:5: the offset does not fit.* for at most 100 MB'):
        read([*lines, f'{120_000_000:08x}: {row}'])


@for_all('bad', [0, 2])
def test_line_with_half_a_byte_is_named_and_no_good_line_after_it(bad: int) -> None:
    cut = '14:03:05,123 TX 10 02 01 05 0F 00 A4 0E 68 00 00 01 00 07 00 42 10 03 4'
    lines = ['14:03:05,223 RX 10 06', '14:03:05,323 TX 10 05', '14:03:05,423 RX 10 06']
    lines.insert(bad, cut)
    with pytest.raises(Problem, match=(
            f'x:{bad + 1}: "14:03:05,.* 4" does not fit: its last byte has one digit; leave it '
            'out, or write 04 for 4')) as caught:
        read(lines)
    assert len(str(caught.value)) < 150


@for_all(('lines', 'told'), [
    (['ffff9c4a1 3575914555 S Bo:1:004:2 -115 14 = 10020105 0f00a40e 68000001 1003',
      'ffff9c4a1 3575914855 C Bo:1:004:2 0 14 >',
      'ffff9c4a2 3575924555 C Bi:1:004:1 0 4 = 01601006'],
     'x: usbmon as text shows at most 32 bytes of each packet: record with "tcpdump -i usbmon1'),
    (['d5ea89a0 3575914555 S Bi:004:01 -115 64 <'], 'x: usbmon as text'),
    (['=~=~=~=~=~=~= PuTTY log 2026.03.01 14:05:09 =~=~=~=~=~=~=', '10 06'],
     'x: a log of PuTTY: its "printable output" lacks the control characters of DF1')])
def test_log_without_all_bytes_is_refused_by_its_program(lines: list[str], told: str) -> None:
    with pytest.raises(Problem) as caught:
        read(lines)
    assert str(caught.value).startswith(told)


@for_all('line', ['10 05 and more', '*', '1 2 3 10 06', '00000000: 1x'])
def test_bad_line_is_named(line: str) -> None:
    with pytest.raises(Problem, match='does not fit: write bytes as in 10 05 01 FF') as caught:
        joined(['10 04', line])
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
    assert chunks(path, b'') == chunks(path, b'\n \n') == []
    assert chunks(path, b'10 05\n\xe9\n') == [Chunk(None, Direction.UNKNOWN, b'\x10\x05')]
    with pytest.raises(Problem, match='x:2: this is not text; for a file of raw bytes give --bin'):
        chunks(path, b'10 05\n\x10\x02\0\0\n')
    for text in (b'hello\n', b'# a remark\n', b'Port COM3 opened\nclosed\n'):
        with pytest.raises(Problem, match='no line has bytes; write them as in 10 05 01 FF'):
            chunks(path, text)


@pytest.mark.parametrize('head', [
    'Station,Mode,Com_Port,Baud', '# Our line\n# here\nMode;Com_Port', 'Tag\tCommand\tAddress',
    '\ufeffAddress,Tag'])
def test_net_file_and_map_lead_to_check(tmp_path: Path, head: str) -> None:
    with pytest.raises(Problem, match='x:1: the settings of a line, .*: "check" reads them'):
        chunks(tmp_path / 'x', f'{head}\n5,10 06,10 05\n'.encode())


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


@for_all(('unit', 'size'), [('', 1.0), (' s', 1.0), (' ms', 1e-3), ('us', 1e-6), (' µs', 1e-6),
                            ('ns', 1e-9), (' sent', 1.0)])
def test_time_has_the_unit_that_follows_it(unit: str, size: float) -> None:
    clock = TextClock()
    assert clock.read(f'1.500{unit},10') == 0.0
    assert clock.read(f'4.000{unit},02') == pytest.approx(2.5 * size)


# The same in good frames, of an exchange that all files of forms/ begin with.
LONG = [(way, bytes.fromhex(text)) for way, text in [
    (OUT, '100201050f003412a204078900001003855e'), (IN, '1006'),
    (IN, '100205014f003412e7003f0310030260'), (OUT, '1006'),
    (OUT, '100201050f003512a20207890500100398a9'), (IN, '1006'),
    (IN, '100205014f003512101000100388e0'), (OUT, '1006')]]
FORMS_FOLDER = Path(__file__).with_name('forms')
INDEX = [tuple(line.split(maxsplit=1))
         for line in (FORMS_FOLDER / 'index.txt').read_text('ascii').splitlines()]
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


WITH_WAYS = [terminal, docklight, monitor, driver, spy, python, relay, modem, two_ports]
WITH_TIMES = [docklight, monitor, driver, spy, relay, two_ports, analyser, modem]
FORMS = [*WITH_WAYS, array, dashes, analyser]


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
    """The bytes are noise, so no good frame helps."""
    # b'1006' may be four characters, or two bytes.
    assume(write is not python or not all(re.fullmatch(b'[0-9A-Fa-f]+', data) for _, data in said))
    with suppress(Problem):
        chunks = read(write(said))
        assert b''.join(chunk.data for chunk in chunks) == b''.join(data for _, data in said)


@for_all('offset', ['07x', '07o'])
def test_words_of_hexdump_and_od_give_back_their_bytes(offset: str) -> None:
    for data in (b''.join(data for _, data in LONG), LONG[0][1], LONG[0][1] + b'\x10'):
        lines = []
        for at, row in rows(data):
            pairs = [row[n:n + 2].ljust(2, b'\0')[::-1].hex() for n in range(0, len(row), 2)]
            lines.append(f'{at:{offset}} {" ".join(pairs)}')
        chunks = read([*lines, f'{len(data):{offset}}'])
        assert b''.join(chunk.data for chunk in chunks) == data
        assert {(chunk.time, chunk.direction) for chunk in chunks} == {(None, UNKNOWN)}


def test_a_long_text_is_never_in_the_memory_as_a_whole() -> None:
    """All that is read ahead are the first 64 kB."""
    lines = (f'{16 * number:07x} {"0210 " * 8}' for number in count())
    chunks = TextReader('x').chunks(lines)
    assert [next(chunks).data for _ in range(3000)] == 3000 * [8 * b'\x10\x02']
    assert int(next(lines)[:7], 16) == 16 * 3001  # one line ahead


def test_octal_words_of_od_give_back_their_bytes() -> None:
    data = b''.join(data for _, data in LONG) + b'\0'
    lines = [f'{at:07o} ' + ' '.join(
        f'{int.from_bytes(row[n:n + 2], "little"):06o}' for n in range(0, len(row), 2))
        for at, row in rows(data)]
    assert joined([*lines, f'{len(data):07o}']) == data
    with pytest.raises(Problem):  # more than 16 bits
        read(['0000000 777777', '0000002'])


@for_all(('lines', 'text'), [
    (['0000000 0210', '*', '0000040'], '"hexdump -v" makes no "[*]"'),
    (['0000000 0210 0310', '0000004 0310', '0000006 0310', '0000009 0310'],
     'x:4: the offset does not follow from the lines before')])
def test_words_whose_offsets_do_not_fit_are_refused(lines: list[str], text: str) -> None:
    with pytest.raises(Problem, match=text):
        read(lines)


@for_all('line', [
    '12:00:01 RX ' + 900_000 * '-' + ' 10 06', '12:00:01 ' + 900_000 * '<' + ' x 10 06',
    '12:00:01 RX ' + 200_000 * 'AA  ' + 'zz', '12:00:01 RX ' + 200_000 * '20  ' + 'zz',
    '12:00:01 RX ' + 200_000 * 'AA\t' + 'zz', "12:00:01 RX b'" + 900_000 * '\\'])
def test_no_line_takes_more_than_a_few_looks_at_each_sign(line: str) -> None:
    """Where each sign asked for a look at all others, this would take longer than any test may."""
    with suppress(Problem):
        read(iter([line]))


@for_all('line', [
    'TX 10 06    ABCD', 'TX  41 42 43  A-C', 'TX: 10 0', 'TX 10 06 and more', 'RX 1006 1',
    '10 5 TX', 'TX  10 06  XY', 'TX10 05 01 FF', 'TX100501FF', 'RX 10 0 04', r'RX \x10\x04',
    r"TX b'\x10' 06", r"TX b'\x10\x05' RX b'\x10\x04'", r"TX b'\x1'", "TX b'AG"])
def test_a_line_of_which_bytes_would_be_left_over_is_refused(line: str) -> None:
    with pytest.raises(Problem, match='x:2: .*does not fit'):
        read(['TX: 10 05', line])


@for_all(('line', 'said'), [
    ('12:00:01.000 TX 10 05 01 FF RX 10 04', ['> 100501ff', '< 1004']),
    ('10 06 [09:00:02] 10 05 01 FF', ['? 1006', '? 100501ff']),
    ('12:00:01 10 5 1 FF', ['? 100501ff']), ('TX 16 005 1 255', ['> 100501ff']),
    ('RX 10h 04h', ['< 1004']), ('RX 0X10|0X04', ['< 1004']), ('TX: 10:06', ['> 1006']),
    ('TX: [10][06]', ['> 1006']), ('RX <10><04>', ['< 1004']), ('TX $10$06', ['> 1006']),
    ('RX DLE ACK', ['< 1006']), ('RX: <DLE><STX>A', ['< 100241']), ('TX {DLE}{ACK}', ['> 1006']),
    (r'RX \x10\x02A', ['< 100241']), (r'read(3, "\20\6", 9) = 2', ['< 1006']),
    (r"Sent 2: b'\x10\x06' (2 bytes)", ['> 1006']), ("TX: b'1006'", ['> 1006']),
    ('TX ^P^F', ['> 1006']), ('TX\xa010\xa006', ['> 1006'])])
def test_bytes_come_in_many_notations(line: str, said: list[str]) -> None:
    assert [f'{chunk.direction.value} {chunk.data.hex()}' for chunk in read([line])] == said


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
    'in, out: 10 06'])
def test_direction_does_not_hold_beyond_a_line_that_does_not_say_which(line: str) -> None:
    chunks = read(iter(['TX: 10 02', line, '10 06']))
    assert [chunk.direction for chunk in chunks] == [OUT] + [UNKNOWN] * (len(chunks) - 1)
    assert chunks[-1].data == b'\x10\x06'


def merged(said: Iterable[tuple[Direction, bytes]]) -> list[tuple[Direction, bytes]]:
    """Return what was said with the bytes of one way after each other as one."""
    found: list[tuple[Direction, bytes]] = []
    for way, data in said:
        before = found.pop()[1] if found and found[-1][0] is way else b''
        found.append((way, before + data))
    return found


@for_all(('name', 'right'), INDEX)
def test_recordings_of_other_programs_are_read(name: str, right: str) -> None:
    recording = Recording(FORMS_FOLDER / name)
    if right.startswith('refused: '):
        with pytest.raises(Problem, match=right.removeprefix('refused: ')):
            list(recording.chunks())
        return
    chunks = list(recording.chunks())
    data = b''.join(chunk.data for chunk in chunks)
    said = next(LONG[:count] for count in range(1, 9)
                if b''.join(data for _, data in LONG[:count]) == data)
    ways, times = right.split(', ')
    known = merged((chunk.direction, chunk.data) for chunk in chunks)
    assert known == {
        'ways': merged(said), 'swapped': merged((way.opposite, data) for way, data in said),
        'no ways': [(UNKNOWN, data)]}[ways]
    seen = [chunk.time for chunk in chunks]
    assert (None not in seen and len(set(seen)) > 1) is (times == 'times')
    assert times == 'times' or set(seen) == {None}


@for_all(('names', 'ways'), [
    ('Alpha: Beta:', '><'), ('COM1->COM2 COM2->COM1', '><'), ('10.0.0.1:4001 10.0.0.5:9', '><'),
    ('Anfrage> Antwort>', '><'), ('RX: TXD:', '<>'), ('TX: RESP:', '><'), ('X: RX:', '><')])
def test_two_kinds_of_marks_are_two_directions(names: str, ways: str) -> None:
    """Without known words the first one is that which sends the commands."""
    one, other = names.split()
    for turned in (False, True):
        marks = (other, one) if turned else (one, other)
        said = LONG if not turned else [(way.opposite, data) for way, data in LONG]
        reader = TextReader('x')
        chunks = list(reader.chunks(iter(
            f'{marks[way is IN]} {data.hex(" ")}' for way, data in said)))
        assert [chunk.direction.value for chunk in chunks] == [
            ways[(way is IN) is not turned] if turned else ways[way is IN] for way, _ in said]


@for_all('count', [8, 16, 80])
def test_numbers_of_lines_and_their_alignment_are_neither_bytes_nor_marks(count: int) -> None:
    said = (LONG * 10)[:count]
    for form, names in ((' {:>2}. {} {}', '» «'), ('{}) {} {}', 'A: B:'), ('{:>4}. {}{}', '')):
        ways = [UNKNOWN if not names else way for way, _ in said]
        chunks = read(form.format(number, names and word(way, names), data.hex(' '))
                      for number, (way, data) in enumerate(said, 1))
        assert [*zip(ways, (data for _, data in said))] == [
            (chunk.direction, chunk.data) for chunk in chunks]


def test_three_kinds_of_marks_are_told_as_they_stand() -> None:
    reader = TextReader('x')
    lines = (f'{"ABC"[at % 3]}: {data.hex()}' for at, (_, data) in enumerate(LONG))
    assert {chunk.direction for chunk in reader.chunks(lines)} == {UNKNOWN}
    assert 'the direction of "A:", "B:", "C:" is not known' in reader.told


def test_how_a_text_is_read_is_told() -> None:
    for lines, told in (
            ([f'{"AB"[way is IN]}: {data.hex()}' for way, data in LONG],
             'read as bytes in hexadecimal, at the end of a line; > is "A:"; < is "B:"'),
            (['Baud: 9600', *(f'{word(way, "TX RX")} {data.hex()}' for way, data in LONG)],
             'read as bytes in hexadecimal, at the end of a line; line 1 has no bytes: '
             '"Baud: 9600"'),
            (['TX 55 AA', 'RX FF 00'], 'read as bytes in hexadecimal, at the end of a line; '
                                       'hardly a frame in its first part is good')):
        reader = TextReader('x')
        list(reader.chunks(iter(lines)))
        assert reader.told == told


def test_a_later_line_that_does_not_fit_ends_the_text_with_its_number() -> None:
    good = [f'12:00:01.000 {word(way, "TX RX")} {data.hex(" ")}' for way, data in LONG]
    for bad in ('12:00:02.000 TX 10 05 01 F', '10 06 and', '12:00:02 RX 10 06 ...',
                'b"\\x10"', '12:00:02.000 RX 10 0'):
        chunks = TextReader('x').chunks(iter([*500 * good, bad, *good]))
        with pytest.raises(Problem, match='x:4001: '):
            for _ in range(5000):
                next(chunks)


def test_times_of_one_line_are_not_given_to_all() -> None:
    lines = ['Connected at 10:00:00', *(f'{word(way, "TX: RX:")} {data.hex()}'
                                        for way, data in LONG)]
    assert {chunk.time for chunk in read(lines)} == {None}
    assert {chunk.time for chunk in read([lines[0], *(data.hex() for _, data in LONG)])} == {None}
    assert [chunk.time for chunk in read([
        '1:00:00 PM TX 10 05', '1:00:01 PM RX 10 04', '12:00:00 AM TX 10 05'])] == [0, 1, 39600]


@for_all('lines', [
    ['Station,Mode,Com_Port,Baud', '5,Master,/dev/ttyUSB0,9600'],
    ['Tag,Address,Max', 'Speed,N7:0,1000', 'Level,N7:1,2000'],
    ['{', '"name": "Run",', '"path": "N7:0"', '}']])
def test_other_texts_are_no_recordings(lines: list[str]) -> None:
    with pytest.raises(Problem):
        read(lines)


# Lines of public reports, which test/lab/field.md names.
@for_all(('lines', 'right'), [
    (['uart_packet-1:    0.103 RX: AD 0C', 'uart_packet-1:    0.203 TX: 10 06'],
     [(IN, b'\xAD\x0C'), (OUT, b'\x10\x06')]),
    (['0000: 10 02 08 09  ¿.¿.', '0004: 10 03 b5 41  ..¿A'],
     [(UNKNOWN, b'\x10\x02\x08\x09'), (UNKNOWN, b'\x10\x03\xB5A')]),
    (["2024-01-28 10:00:00,103 DEBUG A: b'1005'", "2024-01-28 10:00:00,203 DEBUG B: b'1006'"],
     [(OUT, b'\x10\x05'), (IN, b'\x10\x06')]),
    (['1005' * 9], [(UNKNOWN, 9 * b'\x10\x05')])])
def test_lines_of_public_reports_are_read(
        lines: list[str], right: list[tuple[Direction, bytes]]) -> None:
    assert [(chunk.direction, chunk.data) for chunk in read(lines)] == right


@for_all('cut', [r'write(3, "\20\2\1\5"..., 58) = 58', r'write(3, "\x10\x02"..., 20) = 20'])
@for_all('count', [1, 9])
def test_text_that_strace_has_cut_is_refused(cut: str, count: int) -> None:
    with pytest.raises(Problem, match=f'x:{count + 1}: the bytes are cut here'):
        read([*[r'read(3, "\x10\x06", 9) = 2'] * count, cut])


@for_all('encoding', ['utf-8-sig', 'utf-16', 'utf-16-le', 'utf-16-be', 'gb18030', 'latin-1'])
def test_texts_come_in_any_encoding(encoding: str) -> None:
    with TemporaryDirectory() as folder:
        text = '[10:00:00.5] \xd7TX: 10 06\xa0\r\n'
        assert chunks(Path(folder, 'x'), text.encode(encoding)) == [Chunk(0.0, OUT, b'\x10\x06')]
