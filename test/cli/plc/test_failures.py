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

"""Each verb of ``plc`` with each way in which a PLC, a port or an output can fail."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import signal
import sys
import threading

from abdf1_ros.cli.plc import verbs
from abdf1_ros.cli.plc.command import main
import pytest
from support.cases import for_all
from support.commands import call, Output, Said
from support.odd_device import OddDevice, Wiring
from support.plc_line import odd_line
from support.ptys import no_file_longer_than, Pty, read_exactly, wait_until
from support.ros import Process, write_csv

# Each verb that uses a line, in words without the line; "SLC": it does not ask for the type.
VERBS = {
    'read': 'read N7:0 --station 2', 'read SLC': 'read N7:0 --station 2 --plc-type SLC',
    'write': 'write N7:0 1 --station 2 --yes',
    'write SLC': 'write N7:0 1 --station 2 --yes --plc-type SLC',
    'watch': 'watch N7:0 --station 2 --count 1 --period 0.05',
    'watch SLC': 'watch N7:0 --station 2 --count 1 --period 0.05 --plc-type SLC',
    'log': 'log N7:0 --station 2 --count 1 --period 0.05',
    'log SLC': 'log N7:0 --station 2 --count 1 --period 0.05 --plc-type SLC',
    'status': 'status 2', 'ping': 'ping 2 --count 1', 'scan': 'scan 2',
    'detect': 'detect --baud 9600 --duplex half --check CRC --stations 2',
    'init': 'init --baud 9600 --duplex half --check CRC --stations 2 --into {}/new',
    'files': 'files 2 --files 7', 'files SLC': 'files 2 --files 7 --plc-type SLC',
    'clock': 'clock 2', 'clock SLC': 'clock 2 --plc-type SLC',
    'set': 'clock 2 --set --yes', 'set SLC': 'clock 2 --set --yes --plc-type SLC'}
WITHOUT_LINE = {'ports', 'import', 'plot'}
FINDING = 'scan', 'detect', 'init'  # a station that refuses is one that is there
SENDING = 'write SLC', 'set SLC'  # the write is the first command
PATIENT, IMPATIENT = ('--timeout', '3000'), ('--timeout', '20')

_PROGRESS = 'trying ', 'station ', 'listening ', 'file '


def slc() -> OddDevice:
    """Return station 2 of a half-duplex line, with a clock."""
    device = OddDevice(Wiring.HALF, 2)
    device.words.update({(2, 2, 37 + at): 1 + at for at in range(6)})
    return device


def words(verb: str, port: str, folder: Path) -> list[str]:
    return [*VERBS[verb].format(folder).split(), '--port', port]


def told(said: Said) -> list[str]:
    """Return what is told of failures: each line is one of ours, and comes once."""
    lines = [line for line in said.err.splitlines() if not line.startswith(_PROGRESS)]
    assert all(line.startswith('plc: ') for line in lines), said
    assert max(Counter(lines).values(), default=1) == 1, said
    return lines


def test_no_verb_is_left_out() -> None:
    files = Path(verbs.__path__[0]).glob('[a-z]*.py')
    assert {text.split()[0] for text in VERBS.values()} | WITHOUT_LINE == {
        file.stem.rstrip('_') for file in files}


@pytest.mark.parametrize(('status', 'data', 'reason'), [
    (0x10, b'', 'STS 10'), (0xF0, b'\x1A', 'STS F0 EXT STS 1A: file is open, owned by'),
    (0x02, b'', 'STS 02: destination does not acknowledge')])
def test_refusal_is_told(tmp_path: Path, capsys: Output, status: int, data: bytes,
                         reason: str) -> None:
    device = slc()
    device.answer = lambda command: (status, data)
    is_of_gateway = status == 0x02  # which does not reach the station

    @for_all('verb', VERBS)
    def each(verb: str) -> None:
        said = call(main, capsys, *words(verb, name, tmp_path), *PATIENT)
        is_found = verb in FINDING and not (verb == 'scan' and is_of_gateway)
        is_unknown = verb in SENDING and is_of_gateway
        assert said.status == (0 if is_found else 3 if is_unknown else 1), said
        text = 'no file was found' if verb == 'files SLC' and status == 0x10 else \
            '0 of 1 stations answer' if verb == 'scan' and is_of_gateway else reason
        assert sum(text in line for line in (*told(said), *said.lines)) == 1, said

    with odd_line(tmp_path / 'line', device) as name:
        each()


def test_silence_is_told(tmp_path: Path, capsys: Output) -> None:
    line = Pty(tmp_path / 'line')

    @for_all('verb', VERBS)
    def each(verb: str) -> None:
        said = call(main, capsys, *words(verb, str(line.name), tmp_path), *IMPATIENT)
        assert said.status == (3 if verb in SENDING else 1), said
        text = 'nothing answers' if verb in ('detect', 'init') else '0 of 1 stations answer' \
            if verb == 'scan' else '(2) Inactive'
        assert sum(text in shown for shown in (*told(said), *said.lines)) == 1, said

    each()
    line.close()


@for_all('verb', VERBS)
def test_port_that_is_not_there_is_told(tmp_path: Path, capsys: Output, verb: str) -> None:
    said = call(main, capsys, *words(verb, '/dev/ttyNOWHERE', tmp_path))
    assert (said.status, said.out, told(said)) == (1, '', [
        'plc: /dev/ttyNOWHERE: No such file or directory; "plc ports" lists the ports of this '
        'machine'])


@contextmanager
def vanishing(path: Path) -> Iterator[str]:
    """Yield the name of a port that vanishes at the first bytes that are sent."""
    line = Pty(path)
    thread = threading.Thread(target=lambda: (read_exactly(line.fileno(), 2), line.close()))
    thread.start()
    try:
        yield str(path)
    finally:
        thread.join()


@for_all('verb', VERBS)
def test_lost_port_is_told(tmp_path: Path, capsys: Output, verb: str) -> None:
    with vanishing(tmp_path / 'line') as name:
        said = call(main, capsys, *words(verb, name, tmp_path), *PATIENT)
    assert said.status == (3 if verb in SENDING else 1), said
    assert sum('port lost' in line for line in (*told(said), *said.lines)) == 1, said
    assert len(told(said)) == 1


def test_output_that_takes_nothing(tmp_path: Path, capsys: Output,
                                   monkeypatch: pytest.MonkeyPatch) -> None:
    @for_all('verb', VERBS)
    @for_all('is_full', [True, False])
    def each(verb: str, is_full: bool) -> None:
        reader, writer = os.pipe()
        os.close(reader)
        with open('/dev/full' if is_full else os.dup(writer), 'w') as output, \
                monkeypatch.context() as here:
            here.setattr(sys, 'stdout', output)
            said = call(main, capsys, *words(verb, name, tmp_path / f'{is_full}'), *PATIENT)
        os.close(writer)
        reason = 'No space left on device' if is_full else 'Broken pipe'
        if verb.split()[0] in ('write', 'set'):
            expected = 0, [f'plc: written, but that cannot be printed: {reason}']
        elif verb.startswith('log') and is_full:
            expected = 1, [f'plc: the output: {reason}; the log ends here, after 0 rows of this '
                           'run']
        else:
            expected = (2, [f'plc: cannot print: {reason}']) if is_full else (0, [])
        warnings = [line for line in told(said) if 'file directory cannot be read' in line]
        assert (said.status, told(said)[len(warnings):]) == expected

    with odd_line(tmp_path / 'line', slc()) as name:
        each()


def test_watch_of_a_value_that_stays_ends_with_its_reader(
        tmp_path: Path, capsys: Output, monkeypatch: pytest.MonkeyPatch) -> None:
    reader, writer = os.pipe()

    def leave() -> None:
        assert b'N7:0' in os.read(reader, 1000)
        os.close(reader)

    leaving = threading.Thread(target=leave)
    leaving.start()
    with odd_line(tmp_path / 'line', slc()) as name, open(writer, 'w') as output, \
            monkeypatch.context() as here:
        here.setattr(sys, 'stdout', output)
        said = call(main, capsys, 'watch', 'N7:0', '--station', '2', '--port', name)
    leaving.join()
    assert (said.status, told(said)) == (0, [])


@for_all(('text', 'name'), [
    ('read N7:0 --station 2 --record {}/line.cap', 'line.cap'),
    (VERBS['init'], 'net.csv'), ('import {}/list.csv --into {}', 'map.csv')])
def test_full_disk_is_told(tmp_path: Path, capsys: Output, text: str, name: str) -> None:
    write_csv(tmp_path / 'list.csv', 'Tag,Address,Access', ['speed,N7:0,RO'])
    with odd_line(tmp_path / 'line', slc()) as port, no_file_longer_than(10):
        line = [] if text.startswith('import') else ['--port', port, *PATIENT]
        said = call(main, capsys, *text.format(tmp_path, tmp_path).split(), *line)
    assert said.status in (1, 2), said
    assert [name in line and 'File too large' in line for line in told(said)] == [True]
    assert name == 'line.cap' or not [*tmp_path.glob(f'**/{name}')]


@for_all('verb', VERBS)
def test_interrupt_ends_it_at_once(tmp_path: Path, verb: str) -> None:
    line = Pty(tmp_path / 'line')
    with Process('plc', *words(verb, str(line.name), tmp_path), '--timeout', '9000') as process:
        line.read(2)
        wait_until(lambda: process.catches(signal.SIGINT))
        process.send(signal.SIGINT)
        status = process.result()
    line.close()
    is_told = verb in ('ping', 'log SLC', *SENDING)
    expected = {'ping': 1, 'watch SLC': 0, 'log SLC': 0, 'write SLC': 3, 'set SLC': 3}.get(
        verb, 130)
    assert (status, len(process.lines)) == (expected, is_told), process.text
