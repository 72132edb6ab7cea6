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

"""What passes a port is recorded, and nothing else changes."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path
import threading
from types import SimpleNamespace
from unittest.mock import Mock

from abdf1_ros.df1.packet import Packet
from abdf1_ros.ports import trace as trace_module
from abdf1_ros.ports.settings import Lack, PortSettings
from abdf1_ros.ports.trace import PortOpener, Trace, TracedPort
from abdf1_ros.sniffer.capture import CaptureWriter, Chunk, Direction, read_capture
import pytest
from support.counting import open_files
from support.link_threads import NoLine
from support.ptys import no_file_longer_than, PATIENCE, Pty


class Loop(NoLine):
    """A port that gives back what it is given."""

    def __init__(self) -> None:
        self.data = b''
        self.closed = False

    def read(self, timeout: float | None, wake: int) -> bytes:
        data, self.data = self.data, b''
        return data

    def write(self, data: bytes) -> None:
        self.data += data

    def close(self) -> None:
        self.closed = True


def chunks_of(path: Path, settings: dict[str, str] | None = None) -> list[Chunk]:
    lines = path.read_text(encoding='ascii').splitlines()
    return list(read_capture(str(path), lines, {} if settings is None else settings))


def test_both_directions_with_their_times(tmp_path: Path) -> None:
    now = iter((100.5, 101.25))
    loop = Loop()
    trace = Trace(str(tmp_path / 'x'), {}, pytest.fail)
    port = TracedPort(loop, trace, 100.0, lambda: next(now))
    port.write(b'\x10\x05')
    assert port.read(None, 0) == b'\x10\x05'
    assert port.read(None, 0) == b''
    port.close()
    assert loop.closed
    port = TracedPort(inner := Mock(), trace, 0.0)
    assert [port.has_more, port.is_terminal, port.unsent(), port.errors()] == [
        inner.has_more, inner.is_terminal, inner.unsent(), inner.errors()]
    trace.close()
    assert chunks_of(tmp_path / 'x') == [
        Chunk(0.5, Direction.OUT, b'\x10\x05'), Chunk(1.25, Direction.IN, b'\x10\x05')]


def test_trace_takes_no_more_than_its_limit(tmp_path: Path) -> None:
    trace = Trace(str(tmp_path / 'x'), {}, pytest.fail, 200)
    for _ in range(20):
        trace.write(Chunk(0.0, Direction.OUT, b'\x10\x05'))
    trace.close()
    assert sum(file.stat().st_size for file in tmp_path.iterdir()) <= 200


def test_trace_that_cannot_grow_costs_neither_the_port_nor_its_whole_lines(tmp_path: Path) -> None:
    errors: list[str] = []
    trace = Trace(str(tmp_path / 'x'), {}, errors.append)
    port = TracedPort(Loop(), trace, 0.0, lambda: 0.0)
    with no_file_longer_than(100):
        for _ in range(20):
            port.write(b'\x10\x05')
            assert port.read(None, 0) == b'\x10\x05'
        trace.close()
    assert errors == [f'{tmp_path}/x: File too large; nothing more is recorded']
    assert f'{tmp_path}/x' not in {name for _, name in open_files()}
    assert [chunk.data for chunk in chunks_of(tmp_path / 'x')] == [b'\x10\x05'] * 4
    assert (tmp_path / 'x').read_bytes().endswith(b'10 05\n')


@pytest.mark.parametrize('has_ended', [False, True])
def test_line_does_not_wait_for_a_disk_that_stands_still(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_ended: bool) -> None:
    errors: list[str] = []
    is_stuck, goes_on, is_told = threading.Event(), threading.Event(), threading.Event()
    write = CaptureWriter.write

    def slow(writer: CaptureWriter, chunk: Chunk | str) -> None:
        is_stuck.set()
        goes_on.wait(PATIENCE)
        write(writer, chunk)

    def tell(text: str) -> None:
        errors.append(text)
        is_told.set()

    monkeypatch.setattr(CaptureWriter, 'write', slow)
    trace = Trace(str(tmp_path / 'x'), {}, tell)
    port = TracedPort(Loop(), trace, 0.0, lambda: 0.0)
    port.write(b'\x01')
    assert is_stuck.wait(PATIENCE)
    all_lost = [2] if has_ended else [1, 2]
    for lost in all_lost:
        for most, written in (3, (3 + lost) * b'\x02'), (9, (lost - 1) * b'\x03'):  # none waits
            monkeypatch.setattr(trace_module, 'MOST_WAITING', most)
            for byte in written:
                port.write(bytes([byte]))
        if has_ended:
            monkeypatch.setattr(trace_module, 'MOST_WAITING', 0)
            port.write(b'\x04')
            monkeypatch.setattr(trace_module, 'LAST_CHUNKS', 0.0)
            trace.close()
            monkeypatch.undo()
        goes_on.set()
        assert is_told.wait(PATIENCE)  # and once: not when it ends
        if lost is not all_lost[-1]:
            for event in (is_stuck, goes_on, is_told):
                event.clear()
            port.write(b'\x01')
            assert is_stuck.wait(PATIENCE)
    trace.close()
    assert [chunk.data for chunk in chunks_of(tmp_path / 'x')] == \
        [*len(all_lost) * [b'\x01', *[b'\x02'] * 3], b'\x03']
    assert (tmp_path / 'x').read_text().endswith(
        f'# lines lost here: {lost}; the disk was too slow\n0.000000 > 03\n'
        + has_ended * '# lines lost here: 1; the disk was too slow\n')
    assert errors == [f'{tmp_path}/x: the disk was too slow; lines lost: {lost}'
                      for lost in (*all_lost, *[1] * has_ended)]


def test_opener_records_across_openings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # the clock is asked once for the beginning
    monkeypatch.setattr(trace_module, 'time', SimpleNamespace(monotonic=iter([-1e9]).__next__))
    pty = Pty(tmp_path / 'line')
    opener = PortOpener(PortSettings(str(pty.name), baud=19200))
    opener.trace(str(tmp_path / 'x'), 1e6, {'check': 'BCC', 'duplex': 'half'}, pytest.fail)
    for data, check in ((b'\x01', 'BCC'), (b'\x02', 'CRC')):
        opener.use(opener.settings, {'check': check, 'duplex': 'full'})  # as new files have it
        port = opener.open()
        opener.note_guest('tcp:4501', Packet(1, 0, 0x0F, 0, data[0]))
        port.write(data)
        assert pty.read(1) == data
        port.close()
        with pytest.raises(OSError):
            port.write(b'this has not left')
    opener.close()
    assert 'trace' not in {thread.name for thread in threading.enumerate()}
    settings: dict[str, str] = {}
    assert [(chunk.data, chunk.guest, (chunk.time or 0.0) > 1e9)
            for chunk in chunks_of(tmp_path / 'x', settings)] == [
        (b'\x01', '0001 tcp:4501', True), (b'\x02', '0002 tcp:4501', True)]
    assert (tmp_path / 'x').read_text().count(f'# port: {pty.name}\n# baud: 19200\n') == 3
    assert (settings['baud'], settings['check'], settings['duplex'], settings['port']) == (
        '19200', 'CRC', 'full', str(pty.name))
    assert settings['begun'][:2] == '20'
    pty.close()


def test_opener_tells_once_what_a_port_lacks(tmp_path: Path) -> None:
    told: list[Lack] = []
    with closing(Pty(tmp_path / 'a')) as first, closing(Pty(tmp_path / 'b')) as second:
        settings = PortSettings(str(first.name), low_latency=False, rs485=True)
        opener = PortOpener(settings, told.append)
        for pty, count in ((first, 1), (first, 1), (second, 2)):
            opener.use(replace(settings, name=str(pty.name)), {})
            opener.open().close()
            assert [lack.option for lack in told] == ['rs485'] * count


def test_opener_that_cannot_record_opens_all_the_same(tmp_path: Path) -> None:
    pty = Pty(tmp_path / 'line')
    errors: list[str] = []
    opener = PortOpener(PortSettings(str(pty.name)))
    (tmp_path / 'x.1').write_text('mine')
    opener.trace(str(tmp_path / 'x'), 1e6, {}, errors.append)
    assert errors == [f'{tmp_path}/x.1: exists and is not a capture; give another name; '
                      'nothing is recorded']
    port = opener.open()
    assert not isinstance(port, TracedPort)
    port.write(b'\x01')
    assert pty.read(1) == b'\x01'
    port.close()
    opener.close()
    pty.close()
