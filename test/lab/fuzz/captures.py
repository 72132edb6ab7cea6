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

"""Fuzz target: files of recorded bytes, and all that ``sniff`` says about them."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import redirect_stdout
import io
from itertools import islice
import json
from pathlib import Path
from typing import Any

from abdf1_ros.cli import sniff
from abdf1_ros.df1 import frames
from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.problems import Problem
from abdf1_ros.sniffer.capture import CaptureWriter, Chunk, Direction
from abdf1_ros.sniffer.dumps import Recording
from abdf1_ros.sniffer.entries import Entry
from abdf1_ros.sniffer.traffic import TrafficDecoder
from abdf1_ros.text import printable
from fuzz.files import path_of

# A few characters can stand for megabytes that a dump has left out; these are enough of them.
_MOST_CHUNKS = 200

_WAYS, _CHECKSUMS = list(Direction), list(Checksum)
_AS_TEXT, _AS_JSON = (sniff.parse([*words, 'x']) for words in ([], ['--json']))


def one_input(data: bytes) -> None:
    """Check a file taken for a capture or a dump, for raw bytes, and for good frames."""
    path = path_of(data)
    binary, text = Recording(Path(path), is_binary=True), Recording(Path(path))
    whole = list(binary.chunks())
    assert b''.join(chunk.data for chunk in whole) == data
    _check_told(whole, {})
    assert _entries([data]) == _entries([data[at:at + 3] for at in range(0, len(data), 3)])
    chunks = _chunks(text, path)
    _check_told(chunks, text.settings)
    _check_written([chunk for chunk in chunks if not chunk.is_message], text.settings)
    _check_told(_said(data), {})


def _said(data: bytes) -> list[Chunk]:
    """Return what a script says: for each chunk how, when, a length, and link data."""
    chunks: list[Chunk] = []
    script = io.BytesIO(data)
    time = 0.0
    while len(head := script.read(3)) == 3:
        how, later, length = head
        time += (later - 20) / 100
        way, kind = _WAYS[how % len(_WAYS)], how // len(_WAYS)
        chunks.append(Chunk(time, way, _symbol(kind, script.read(length))))
    return chunks


def _symbol(kind: int, link_data: bytes) -> bytes:
    checksum = _CHECKSUMS[kind // 4 % len(_CHECKSUMS)]
    match kind % 4:
        case 0:
            return frames.message_frame(link_data, checksum)
        case 1:
            return frames.master_frame(sum(link_data[:1]), link_data, checksum)
        case 2:
            return frames.poll_frame(len(link_data))
    return frames.ACK


def _chunks(recording: Recording, path: str) -> list[Chunk]:
    """Return what can be read, and check what is said of the rest."""
    chunks = []
    try:
        for chunk in islice(recording.chunks(), _MOST_CHUNKS):
            chunks.append(chunk)
    except Problem as problem:
        assert str(problem).isprintable() and len(str(problem)) < 600
        name, line, _ = str(problem).split(':', 2)
        assert name == path and int(line.removeprefix(' byte ')) > 0
    assert 0 <= recording.percent <= 100
    return chunks


def _check_written(chunks: Sequence[Chunk], settings: dict[str, str]) -> None:
    """Check that chunks and settings are the same when they are written and read again."""
    path = Path(path_of(b''))
    writer = CaptureWriter(path, settings=settings)
    for chunk in chunks:
        writer.write(chunk)
    writer.close()
    again = Recording(path)
    assert list(again.chunks()) == [
        chunk._replace(time=round(chunk.time or 0.0, 6), guest='') for chunk in chunks]
    assert again.settings == {
        _ascii(name): _ascii(printable(value)) for name, value in settings.items()}


def _ascii(text: str) -> str:
    """Return a text as a capture has it, which is ASCII."""
    return text.encode('ascii', 'backslashreplace').decode()


def _check_told(chunks: Sequence[Chunk], settings: dict[str, str]) -> None:
    """Check what is printed, as text and as JSON."""
    assert all(line.isprintable() for line in _told(chunks, settings, _AS_TEXT))
    *entries, summary = (json.loads(line, parse_constant=_refuse)
                         for line in _told(chunks, settings, _AS_JSON))
    count = sum(len(chunk.data) for chunk in chunks)
    assert sum(summary['bytes'].values()) == count
    assert summary['noise'] == sum(entry.get('bytes', 0) for entry in entries) <= count
    assert summary['seconds'] is None or summary['seconds'] >= 0
    assert summary['load'] is None or 0 <= summary['load'] <= 1
    assert all(entry.get('latency_ms', 0) >= 0 for entry in entries)


def _told(chunks: Sequence[Chunk], settings: dict[str, str], options: Any) -> list[str]:
    """Return the lines that are printed."""
    output = sniff.Output(options)
    with redirect_stdout(io.StringIO()) as told:
        for chunk in chunks:
            output.take(chunk, settings)
        output.end()
    *lines, rest = told.getvalue().split('\n')
    assert not rest
    return lines


def _entries(parts: Sequence[bytes]) -> list[Entry]:
    """Return what is seen in bytes that come in parts, of which little is kept."""
    session = TrafficDecoder()
    entries: list[Entry] = []
    for part in parts:
        entries += session.feed(Chunk(None, Direction.UNKNOWN, part))
        for wire in session.wires.values():
            assert len(wire.decoder.waiting) <= 2
            assert len(wire.decoder.link_data) <= frames.MAX_LINK_DATA + 1
    return [*entries, *session.finish()]


def _refuse(constant: str) -> None:
    raise AssertionError(f'{constant} is no JSON')
