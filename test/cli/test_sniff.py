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

"""The command: files, a tap between the simulator and a master, and what it refuses."""

from collections.abc import Iterator
from contextlib import suppress
from io import BytesIO
from itertools import count
import os
from pathlib import Path
import re
import resource
import signal
import subprocess
import sys
import time
from unittest.mock import MagicMock, Mock

from abdf1_ros.cli import sniff
from abdf1_ros.cli.sniff import main
from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.packet import Packet
from abdf1_ros.sniffer.capture import Chunk, Direction, read_capture
from abdf1_ros.sniffer.packet_files import PacketFile
import pytest
from support.captures import write_capture
from support.cases import for_all
from support.commands import Output, running_simulator
from support.forked import Forked
from support.ptys import full_pipe, no_file_longer_than, PATIENCE, Pty, read_exactly, wait_until
from support.ros import Process
from support.vectors import VECTOR_FOLDER

COMMAND = Packet(2, 5, 0x0F, 0, 0x1234, bytes.fromhex('A2 04 07 89 00 00'))
REPLY = COMMAND.reply(bytes.fromhex('34 12 FE FF'))
SAID = (frames.master_frame(2, COMMAND.encode(), Checksum.CRC), frames.ACK,
        frames.poll_frame(2), frames.message_frame(REPLY.encode(), Checksum.CRC), frames.ACK)
WAYS = '><><>'
LINES = [
    '     0.000000 >   2 command  5 to 2, TNS 1234: protected typed logical read N7:0, 2 words '
    '| CRC good',
    '     0.010000 <   2 ACK',
    '     0.020000 >   2 poll     BCC good',
    '     0.030000 <   2 reply    2 to 5, TNS 1234: 4660 -2 | CRC good | 30.0 ms',
    '     0.040000 >   2 ACK']


@pytest.fixture(autouse=True)
def _signal_handlers() -> Iterator[None]:
    """Give the handlers back that ``main`` has replaced."""
    numbers = signal.SIGINT, signal.SIGTERM
    handlers = [signal.getsignal(number) for number in numbers]
    yield
    for number, handler in zip(numbers, handlers):
        signal.signal(number, handler)


@pytest.fixture
def capture(tmp_path: Path) -> str:
    return write_capture(tmp_path / 'line.cap', zip(WAYS, SAID))


def lines_of(capsys: Output, *args: str) -> list[str]:
    assert main(args) == 0
    return capsys.readouterr().out.splitlines()


def refused(capsys: Output, *args: str) -> str:
    assert main(args) == 2
    return capsys.readouterr().err


def test_hex_and_binary_files_say_the_same_without_times(capsys: Output, tmp_path: Path) -> None:
    expected = [re.sub(r'^ +[0-9.]+| \| [0-9.]+ ms', '', line) for line in LINES]
    (tmp_path / 'bin').write_bytes(b''.join(SAID))
    (tmp_path / 'hex').write_text(b''.join(SAID).hex(' '), encoding='ascii')
    for args in (('--binary', str(tmp_path / 'bin')), (str(tmp_path / 'hex'),)):
        assert [re.sub(r'^ +-', '', line) for line in lines_of(capsys, *args)[:5]] == expected


def test_capture_with_other_settings_is_of_another_line(capsys: Output, tmp_path: Path) -> None:
    """As after a change of net.csv: a start of the node renames the trace to ``.1``."""
    paths = []
    for duplex, baud, name in (('full', 19200, ''), ('half', 9600, '_half_duplex')):
        _, _, lines = (VECTOR_FOLDER / 'captures' / f'libplctag_client_crc_plc5{name}.cap'
                       ).read_text('ascii').partition('\n')
        paths.append(tmp_path / duplex)
        paths[-1].write_text(f'# abdf1_ros capture 1\n# baud: {baud}\n# duplex: {duplex}\n{lines}'
                             f'999.0 > 10 02 31\n', 'ascii')  # broken off
    for files in (paths, paths[::-1]):
        assert main(['--summary', *map(str, files)]) == 0
        head, seen, faults, *_ = capsys.readouterr().out.splitlines()
        assert seen == ('  seen: 148 commands, 148 replies, 66 of them with an error, 48 polls, '
                        '295 ACK')
        assert (faults, 'load' in head) == ('  faults: 2 damaged', False)  # it has two speeds


def test_options_and_bytes_win_over_the_head_of_a_capture(capsys: Output, capture: str) -> None:
    assert 'BCC BAD' in lines_of(capsys, '--check', 'bcc', capture)[0]
    assert 'full duplex' in lines_of(capsys, '--summary', '--duplex', 'FULL', capture)[0]
    path = Path(capture)
    path.write_text(path.read_text('ascii').replace('check: CRC', 'check: BCC'), 'ascii')
    assert lines_of(capsys, capture)[:5] == LINES


def test_bad_line_ends_with_file_and_line_and_the_summary_so_far(
        capsys: Output, capture: str) -> None:
    with open(capture, 'a', encoding='ascii') as file:
        file.write('0.05 > 1\x1b\n')
    assert main([capture]) == 2
    captured = capsys.readouterr()
    assert captured.out.splitlines()[:5] == LINES
    assert 'summary: ' in captured.out
    assert captured.err == (
        f'sniff: {capture}:10: "0.05 > 1\\x1b" should be seconds, ">", "<" or "?", and bytes, '
        'as in 0.004210 < 10 04\n')


def test_how_a_log_is_read_is_told_and_a_bad_line_ends_it_without_summary(
        capsys: Output, tmp_path: Path) -> None:
    path = tmp_path / 'log'
    lines = [f'{"AB"[way == "<"]}: {data.hex()}' for way, data in zip(WAYS, SAID)]
    path.write_text('\n'.join(lines), encoding='ascii')
    assert main(['--summary', str(path)]) == 0
    captured = capsys.readouterr()
    assert captured.err == f'sniff: {path}: read as bytes in hexadecimal, at the end of a line; ' \
                           '> is "A:"; < is "B:"\n'
    assert captured.out.startswith('summary: 45 bytes (27 >, 18 <), half duplex, CRC')
    path.write_text('\n'.join([*2000 * lines, 'A: 10 0']), encoding='ascii')
    assert main(['--summary', str(path)]) == 2
    captured = capsys.readouterr()
    told = f'sniff: {path}:10001: "A: 10 0" does not fit: its last byte has one digit'
    assert told in captured.err
    assert captured.out == ''


def test_logs_of_one_side_each_are_put_together_by_their_times(
        capsys: Output, tmp_path: Path) -> None:
    asks = ['100101100201050F00EEFE680000040006070004001003E24E', '100501FF', '1006']
    answers = ['1006', '100205014F00EEFE99090942D5002D030000000010035AC6']
    sent, received = tmp_path / 'sent.log', tmp_path / 'received.log'
    # Within each second all has the same time.
    sent.write_text(''.join(f'[06:00:0{second}.001] {data}\n' for second in range(3)
                            for data in asks), 'ascii')

    def receive(hour: str) -> None:
        received.write_text(''.join(f'{hour}:00:0{second}.001] {data}\n' for second in range(3)
                                    for data in answers), 'ascii')
    receive('[06')
    for names in ((sent, received), (received, sent)):
        assert [line.split()[1:4:2] for line in lines_of(capsys, *map(str, names))[:5]] == [
            ['>', 'command'], ['<', 'ACK'], ['>', 'poll'], ['<', 'reply'], ['>', 'ACK']]
        said = lines_of(capsys, '--summary', *map(str, names))
        assert said[0].startswith('summary: 2.0 s')
        assert '  seen: 3 commands, 3 replies, 3 polls, 6 ACK' in said
        assert not any('without' in line for line in said)
    receive('[07')
    assert 'one side of the line each, without a common time' in refused(
        capsys, str(sent), str(received))


def test_port_of_a_device_server_is_an_option(capsys: Output) -> None:
    path = str(Path(__file__).parents[1] / 'sniffer/forms/moxa_4001.pcap')
    for options in ([], ['--tcp', '4001'], ['--tcp', '950', '--tcp', '4001']):
        assert '  seen: 2 commands, 2 replies, 4 ACK' in lines_of(
            capsys, '--summary', *options, path)
    assert 'seen are TCP ports 4001, 50000: give that of' in refused(capsys, '--tcp', '950', path)


@pytest.mark.parametrize('options, status, err, ends_with_summary', [
    ([], 2, 'sniff: /dev/zero:1: this is not text; for a file of raw bytes give --binary\n',
     False),
    (['--binary', '--seconds', '1'], 0, '', True)])
def test_endless_file_does_not_fill_the_memory(
        options: list[str], status: int, err: str, ends_with_summary: bool) -> None:
    limit = 400_000_000
    said = subprocess.run(
        [sys.executable, '-m', 'abdf1_ros', 'sniff', *options, '/dev/zero'], text=True,
        capture_output=True, timeout=PATIENCE, check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)))
    assert (said.returncode, said.stderr) == (status, err)
    assert ('summary: ' in said.stdout) is ends_with_summary


def test_progress_has_a_percentage_where_the_size_is_known(
        capsys: Output, capture: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.stdout, 'isatty', lambda: True)
    for period, is_terminal, number in ((9.0, True, 0), (0.0, False, 0), (0.0, True, 5)):
        monkeypatch.setattr(sniff, 'PROGRESS_PERIOD', period)
        monkeypatch.setattr(sys.stderr, 'isatty', lambda: is_terminal)  # noqa: B023
        assert main(['--summary', capture]) == 0
        told = capsys.readouterr().err.splitlines()
        assert len(told) == number
    assert told[-1] == f'sniff: {capture}: 100 %, 45 bytes so far'
    monkeypatch.setattr(sys.stdout, 'isatty', lambda: False)
    output = sniff.Output(sniff.parse([capture]))
    monkeypatch.setattr(sniff, 'PROGRESS_PERIOD', 9.0)
    for done in 'ab':
        output.show_progress(done)
    assert capsys.readouterr().err == 'sniff: a, 0 bytes so far\n'
    monkeypatch.setattr(sniff, 'PROGRESS_PERIOD', 0.0)
    assert main(['--summary', '--binary', '--seconds', '0.2', '/dev/zero']) == 0
    assert re.match('sniff: /dev/zero, [0-9]+ bytes so far\n', capsys.readouterr().err)


def test_file_that_cannot_be_read_is_an_error_without_an_empty_summary(
        capsys: Output, tmp_path: Path, capture: str) -> None:
    none = tmp_path / 'none'
    for path, reason in ((none, 'No such file or directory'), (tmp_path, 'Is a directory')):
        assert main([str(path)]) == 2
        assert capsys.readouterr() == ('', f'sniff: {path}: cannot be read: {reason}\n')
    assert main([capture, str(none)]) == 2
    captured = capsys.readouterr()
    assert captured.out.splitlines()[:5] == LINES
    assert 'summary: 0.0 s, 45 bytes' in captured.out
    assert captured.err.startswith(f'sniff: {none}: cannot be read: ')


@pytest.mark.parametrize('text', ['', '# abdf1_ros capture 1\n# baud: 9600\n', ' \n'])
def test_file_without_bytes_is_told(
        capsys: Output, tmp_path: Path, capture: str, text: str) -> None:
    path = tmp_path / 'empty'
    path.write_text(text, encoding='ascii')
    assert main([capture, str(path)]) == 0
    captured = capsys.readouterr()
    assert captured.err == f'sniff: {path}: the file has no bytes\n'
    assert captured.out.splitlines()[:5] == LINES


def test_end_of_the_time_is_no_empty_file(
        capsys: Output, capture: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sniff, 'time', Mock(monotonic=count(5).__next__))
    for seconds, size in (('1', '0 bytes'), ('7', '0.0 s, 66 bytes')):  # of both files
        assert main(['--summary', '--seconds', seconds, capture, capture]) == 0
        captured = capsys.readouterr()
        assert captured.out.startswith(f'summary: {size}') and not captured.err


def test_ctrl_c_shows_what_was_read_so_far(
        capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    def chunks() -> Iterator[Chunk]:
        yield Chunk(0.5, Direction.OUT, SAID[0][:-1])
        raise KeyboardInterrupt

    monkeypatch.setattr(sniff, 'Recording', Mock(return_value=Mock(chunks=chunks, settings={})))
    assert lines_of(capsys, 'x')[1].startswith('summary: ')


@pytest.mark.parametrize('baud', ['9' * 5000, '-9600', '\\u0661', '0', 'fast'])
def test_speed_in_a_capture_that_is_none(capsys: Output, tmp_path: Path, baud: str) -> None:
    path = tmp_path / 'line.cap'
    path.write_text(f'# abdf1_ros capture 1\n# baud: {baud}\n0.0 > 10 05\n1.0 > 10 05\n',
                    encoding='ascii')
    assert not any('load' in line for line in lines_of(capsys, str(path)))


def test_port_or_file_that_cannot_be_opened_is_named(capsys: Output, tmp_path: Path) -> None:
    none = tmp_path / 'none'
    for args in (['--port', str(none)], ['--tap', 'pty', str(none)]):
        assert main(args) == 1
        assert capsys.readouterr().err == f'sniff: {none}: No such file or directory\n'
    assert refused(capsys, '--port', 'pty', '--save', '/nowhere/x').endswith(
        'sniff: --save: /nowhere/x: No such file or directory\n')
    assert 'is not a capture; give another name' in refused(
        capsys, '--port', 'pty', '--save', str(tmp_path))


def test_packets_go_nowhere_else_than_into_pcapng(
        capsys: Output, capture: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert refused(capsys, '--pcapng', '/nowhere/x', capture).endswith(
        'sniff: --pcapng: /nowhere/x: No such file or directory\n')
    assert 'exists and was not made by --pcapng' in refused(
        capsys, '--pcapng', str(Path(capture).parent), capture)
    with no_file_longer_than(200), monkeypatch.context() as reader_left:
        reader_left.setattr(sys.stdout, 'flush', Mock(side_effect=[None, BrokenPipeError, None]))
        reader_left.setattr(sniff, 'has_reader_left', lambda *_: True)
        assert main(['--pcapng', f'{capture}.pcapng', capture]) == 2
    assert capsys.readouterr().err == (
        f'sniff: {capture}.pcapng: File too large; no more packets are written\n')
    with open(capture, 'a', encoding='ascii') as file:
        file.write('0.05 > 10 02 31\n')  # broken off: it is told at the end
    whole = f'{capture}.whole'
    assert lines_of(capsys, '--pcapng', whole, capture)[5].endswith('DLE ETX')
    with pytest.raises(SystemExit):  # it would be replaced before it is read
        main(['--pcapng', whole, capture, whole])
    assert f'{whole} is named twice; give the output' in capsys.readouterr().err
    assert len([*PacketFile(whole, BytesIO(Path(whole).read_bytes())).packets()]) == 6


@for_all('args', [
    [], ['x', '--port', 'y'], ['--port', 'x', '--tap', 'y', 'z'], ['x', '--binary', '--save', 'y'],
    ['--port', 'x', '--binary'], ['--tap', 'x'], ['--tap', 'x', 'x'],
    ['--port', 'x', '--tcp', '950'], ['x', '--tcp', 'moxa'],
    ['--port', 'x', '--save', 'y', '--html', './y'],
    ['x', '--report', 'r', '--conformance', 'y', '--html', 'y'],
    ['x', '--check', 'md5'], ['x', '--baud', '7'], ['x', '--conformance', 'y'],
    ['--report', 'z', '--port', 'pty'], ['--anonymous', 'x'], ['--report', 'z', '--binary', 'x'],
    ['x', '--seconds', 'many'], ['x', '--seconds', '1_0'], ['x', '--baud', '9_600']])
def test_option_that_is_wrong_is_told_with_status_2(capsys: Output, args: list[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(args)
    assert caught.value.code == 2
    assert 'sniff: error: ' in capsys.readouterr().err


def _printed(sniff: Process) -> list[str]:
    """Return the lines of its standard output."""
    return [line for line in sniff.lines if not line.startswith('sniff: ')]


def _told(sniff: Process) -> list[str]:
    """Return the lines of its standard error."""
    return [line for line in sniff.lines if line.startswith('sniff: ')]


def test_tap_between_the_simulator_and_a_master(tmp_path: Path, capsys: Output) -> None:
    plc, tap, saved, packets = (str(tmp_path / name) for name in ('plc', 'tap', 'saved', 'pcapng'))
    with running_simulator('--pty', plc), Process(
            'sniff', '--tap', f'pty:{tap}', plc, '--save', saved, '--pcapng', packets) as sniff:
        sniff.wait_for('sniff: ')
        line = os.open(tap, os.O_RDWR | os.O_NOCTTY)
        os.write(line, SAID[0])
        assert read_exactly(line, 2) == frames.ACK
        os.write(line, SAID[2])
        reply = frames.message_frame(COMMAND.reply(bytes(4)).encode(), Checksum.CRC)
        heard = read_exactly(line, len(reply))
        os.write(line, frames.ACK)
        wait_until(lambda: len(_printed(sniff)) == 5)
        os.close(line)
        sniff.end(signal.SIGTERM)
    said = _printed(sniff)
    assert [entry.split()[1:4] for entry in said[:5]] == [
        ['>', '2', 'command'], ['<', '2', 'ACK'], ['>', '2', 'poll'], ['<', '2', 'reply'],
        ['>', '2', 'ACK']]
    assert heard[:2] == frames.STX
    assert _told(sniff) == [f'sniff: listening on {tap} and {plc}; Ctrl-C ends']
    assert '  seen: 1 command, 1 reply, 1 poll, 2 ACK' in said
    assert not os.path.lexists(tap)
    assert lines_of(capsys, saved, '--pcapng', f'{packets}2')[:5] == said[:5]
    for path in (packets, f'{packets}2'):  # but for microseconds that a capture rounds
        content = Path(path).read_bytes()
        assert all(entry in content for entry in (SAID[0], SAID[2], heard))
        packets = PacketFile(path, BytesIO(content)).packets()
        assert min(packet.time for packet in packets) > time.time() - 600


@pytest.mark.parametrize(('way', 'number'), [
    ('file', signal.SIGTERM), ('--tap', signal.SIGINT),
    pytest.param('--port', signal.SIGINT, marks=pytest.mark.long)])
def test_signal_ends_it_while_its_output_is_not_taken(
        tmp_path: Path, capture: str, way: str, number: signal.Signals) -> None:
    """After Ctrl-S, or with ``| less``, it printed for ever."""
    names = [str(tmp_path / name) for name in 'ab']
    ports = [f'pty:{name}' for name in names[:1 + (way == '--tap')]]
    reader, writer = full_pipe()
    arguments = [names[0]] if way == 'file' else [way, *ports]
    if way == 'file':
        os.mkfifo(names[0])
    with subprocess.Popen([sys.executable, '-m', 'abdf1_ros', 'sniff', *arguments], text=True,
                          stdout=writer, stderr=subprocess.PIPE) as sniff:
        assert sniff.stderr is not None
        if way == 'file':
            line = os.open(names[0], os.O_WRONLY)  # waits until it is opened there
            os.write(line, Path(capture).read_bytes())
        else:
            sniff.stderr.readline()
            line = os.open(names[0], os.O_RDWR | os.O_NOCTTY)
            for data in SAID:
                os.write(line, data)
        time.sleep(0.5)
        sniff.send_signal(number)
        assert sniff.wait(PATIENCE) == 0
        assert sniff.stderr.read().splitlines()[-1:] == [
            'standard output was not read after the signal: the rest of it is lost']
    for descriptor in (line, reader, writer):
        os.close(descriptor)


def test_lost_port_ends_with_the_summary(tmp_path: Path) -> None:
    pty = Pty(tmp_path / 'line')
    saved = tmp_path / 'saved'
    options = '--port', str(pty.name), '--save', str(saved), '--html', '/dev/full'
    with Process('sniff', *options) as sniff:
        sniff.wait_for('sniff: ')
        pty.write(SAID[1])
        sniff.wait_for('? ')
        pty.close()
        assert sniff.result() == 1
    assert saved.read_text('ascii').endswith(' ? 10 06\n')
    assert _told(sniff)[1].startswith('sniff: a port was lost: ')
    assert _printed(sniff)[1].startswith('summary: ')


def test_what_a_slow_output_has_lost_is_told_and_saved(
        tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    tap = MagicMock(names=['x'], new_losses=Mock(side_effect=[1, 3, 0, 0]))
    tap.chunks = lambda *args: iter(
        Chunk(time, Direction.UNKNOWN, frames.poll_frame(2)) for time in (0.0, 0.1, 0.2))
    monkeypatch.setattr(sniff, 'Tap', made := Mock(return_value=tap))
    saved, page = tmp_path / 'saved', tmp_path / 'page'
    options = '--save', str(saved), '--html', str(page)
    assert main(['--tap', 'x', 'pty', '--parity', 'Even', *options]) == 0
    assert '>x, pty</' in page.read_text(encoding='utf-8')
    first, told = (f'{lost} of traffic lost: this output was too slow\n'
                   for lost in ('1 piece', '3 pieces'))
    assert capsys.readouterr().err.endswith(f'sniff: {first}sniff: {told}')
    assert f'{told}0.100000 ? ' in saved.read_text('ascii')
    assert main([str(saved)]) == 0
    assert re.findall('lines before (.*) s: ([13]) piece.*Faults', capsys.readouterr().err) == [
        ('0.0', '1'), ('0.1', '3')]
    assert made.call_args.args[1].parity == 'Even'
    assert saved.read_text('ascii').splitlines()[2:6] == [
        '# ports: x pty', '# check: auto', '# duplex: auto', '# baud: 9600']
    tap.new_losses = Mock(return_value=0)
    with monkeypatch.context() as full:
        full.setattr(sys.stdout, 'flush', Mock(side_effect=[None, OSError, *5 * [None]]))
        full.setattr(sniff, 'has_reader_left', lambda *_: False)
        assert main(['--tap', 'pty', 'pty', '--save', str(tmp_path / 'of_pty')]) == 2  # no speed
    assert 'baud' not in (tmp_path / 'of_pty').read_text('ascii')
    monkeypatch.setattr('abdf1_ros.sniffer.capture.CaptureWriter.write', Mock(side_effect=OSError))
    assert main(['--port', 'x', '--baud', '19200', '--save', str(tmp_path / 'full')]) == 2
    assert made.call_args.args[1].baud == 19200
    monkeypatch.setattr(sniff, 'PROGRESS_PERIOD', 0.0)
    monkeypatch.setattr(sys.stderr, 'isatty', lambda: True)
    capsys.readouterr()
    assert main(['--port', 'x', '--summary']) == 0  # also while the line is never idle
    assert re.findall('listening, ([0-9]+) bytes', capsys.readouterr().err) == ['4', '8', '12']


def test_colour_is_for_terminals_only(
        capsys: Output, capture: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv('NO_COLOR', raising=False)
    assert '\x1b' not in ''.join(lines_of(capsys, capture))
    monkeypatch.setattr(sys.stdout, 'isatty', lambda: True)
    assert '\x1b[2m' in ''.join(lines_of(capsys, capture))
    monkeypatch.setenv('NO_COLOR', '1')
    assert '\x1b' not in ''.join(lines_of(capsys, capture))


def test_full_disk_does_not_cut_a_tap(tmp_path: Path) -> None:
    """Neither what is printed nor what is saved can be written, and the bytes go on."""
    names = [tmp_path / name for name in ('a', 'b', 'saved', 'packets')]
    with open('/dev/full', 'w') as full, subprocess.Popen(
            [sys.executable, '-m', 'abdf1_ros', 'sniff', '--tap', f'pty:{names[0]}',
             f'pty:{names[1]}', '--save', str(names[2]), '--pcapng', str(names[3])], text=True,
            stdout=full, stderr=subprocess.PIPE) as sniff:
        assert sniff.stderr is not None
        sniff.stderr.readline()
        resource.prlimit(sniff.pid, resource.RLIMIT_FSIZE, (1000, 1000))
        ends = [os.open(name, os.O_RDWR | os.O_NOCTTY) for name in names[:2]]
        for _ in range(20):  # each time they are written, twice as much as fits
            os.write(ends[0], SAID[0])
            assert read_exactly(ends[1], len(SAID[0])) == SAID[0]
            os.write(ends[1], frames.ACK)
            assert read_exactly(ends[0], 2) == frames.ACK
        for end in ends:
            os.close(end)
        sniff.send_signal(signal.SIGINT)
        told = sorted(sniff.stderr.read().splitlines())
        assert sniff.wait(PATIENCE) == 2
    assert told == [
        f'sniff: {names[3]}: File too large; no more packets are written',
        f'sniff: {names[2]}: File too large; nothing more is recorded',
        'sniff: cannot print: No space left on device']
    saved = names[2].read_text(encoding='ascii')
    assert saved.endswith('\n') and len([*read_capture('saved', saved.splitlines(), {})]) > 5


@pytest.mark.parametrize(('way', 'goes_on', 'is_saved'), [
    ('--tap', True, True), ('--tap', True, False), ('--port', False, True)])
def test_reader_that_leaves_does_not_cut_a_tap(
        tmp_path: Path, way: str, goes_on: bool, is_saved: bool) -> None:
    names = [str(tmp_path / name) for name in 'ab']
    saved = tmp_path / 'saved'
    sniff = Forked('sniff', [way, *[f'pty:{name}' for name in names[:1 + goes_on]],
                             *['--save', str(saved)] * is_saved])
    sniff.stderr.readline()
    sniff.stdout.close()
    near, far = (os.open(name, os.O_RDWR | os.O_NOCTTY) for name in (names[0], names[goes_on]))
    for _ in range(3 * goes_on):
        os.write(near, SAID[0] + SAID[1])
        assert read_exactly(far, len(SAID[0] + SAID[1])) == SAID[0] + SAID[1]
    if goes_on:
        assert sniff.stderr.readline() == (
            'sniff: this output is no longer read; the bytes are passed on until Ctrl-C\n')
        sniff.send_signal(signal.SIGINT)
    else:
        os.write(near, SAID[0] + SAID[1])
    assert sniff.wait(PATIENCE) == 0
    if not is_saved:
        return
    chunks = read_capture('saved', saved.read_text(encoding='ascii').splitlines(), {})
    assert b''.join(chunk.data for chunk in chunks) == (1 + 2 * goes_on) * (SAID[0] + SAID[1])


def test_files_are_whole_though_nobody_reads_the_output(tmp_path: Path, capture: str) -> None:
    page, packets = str(tmp_path / 'line.html'), str(tmp_path / 'packets')
    for option, path in (('--html', page), ('--pcapng', packets)):
        sniff = Forked('sniff', [option, path, *[capture] * 99])
        sniff.stdout.close()
        assert sniff.wait(PATIENCE) == 0
    assert '</html>' in Path(page).read_text('utf-8')
    assert len([*PacketFile(packets, BytesIO(Path(packets).read_bytes())).packets()]) == 5 * 99


@pytest.mark.parametrize('args, text', [
    (('ttyUSB0',), 'did you mean --port ttyUSB0? A FILE is a recording'),
    (('/dev/tty',), 'did you mean --port /dev/tty? A FILE is a recording'),
    (('socket://127.0.0.1:1',), 'did you mean --port socket://127.0.0.1:1?'),
    (('--port', 'ttyUSB99'), 'ttyUSB99: No such file or directory; a device path is '
                             '/dev/ttyUSB99')])
def test_port_that_is_named_in_another_way(
        args: tuple[str, ...], text: str, capsys: Output) -> None:
    with suppress(SystemExit):
        main(args)
    assert text in capsys.readouterr().err
