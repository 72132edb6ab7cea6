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

"""
Read recorded bytes from files of several kinds: captures, packets, texts, raw bytes.

Any text that is not a capture is read by ``texts``.
"""

from __future__ import annotations

import codecs
from collections.abc import Iterator
from contextlib import suppress
from gzip import BadGzipFile, GzipFile
from io import BufferedReader, TextIOWrapper
from itertools import chain
from pathlib import Path
from typing import BinaryIO, cast
import zlib

from abdf1_ros.problems import Problem
from abdf1_ros.sniffer.capture import Chunk, Direction, is_capture_line, read_capture
from abdf1_ros.sniffer.ethernet_ip import chunks_of, CSP, DEVICE_SERVERS, SeenPackets
from abdf1_ros.sniffer.packet_files import is_packet_file, PacketFile
from abdf1_ros.sniffer.pcapng import LINK_TYPE
from abdf1_ros.sniffer.texts import TextProblem, TextReader
from abdf1_ros.text import counted, first, is_head_of_settings, is_head_of_values

_BLOCK = 4096
_HEAD = 9  # lines that are looked at, if those before the last are comments
_GZIP = b'\x1F\x8B'
# The longest text line in bytes: no program writes longer lines, and a file without line ends,
# such as /dev/zero, must not fill the memory.
_LONGEST_LINE = 1_000_000
# Characters of which a text has few.
_CONTROLS = [chr(code) for code in range(32) if code not in b'\t\r\n\x1b']


class Recording:
    """
    The chunks of a file; ``settings`` has the settings of a capture, as far as it has been read.

    ``servers`` are the TCP ports of device servers. ``told`` says how the text of another program
    is read, and ``begun`` is its first time in seconds. ``has_size`` tells whether the file has a
    known size; a pipe or device has none.
    Raises OSError if the file cannot be opened.
    """

    def __init__(self, path: Path, is_binary: bool = False,
                 servers: frozenset[int] = DEVICE_SERVERS) -> None:
        self.settings: dict[str, str] = {}
        self.told = ''
        self.begun: float | None = None
        self._size = path.stat().st_size
        self.has_size = self._size > 0
        self._position = 0
        self.name = str(path)
        self._is_binary, self._servers = is_binary, servers
        file = path.open('rb')
        is_packed = not is_binary and file.peek(2).startswith(_GZIP)
        self._file: BufferedReader | GzipFile = GzipFile(fileobj=file) if is_packed else file

    @property
    def percent(self) -> int:
        """Return how many percent of the file have been read; without a size it means nothing."""
        return min(100, 100 * self._position // max(1, self._size))

    def chunks(self) -> Iterator[Chunk]:
        """Yield the chunks; raises Problem, with the place, if something cannot be read."""
        try:
            yield from self._chunks()
        except (EOFError, zlib.error, BadGzipFile) as error:
            raise Problem(self.name, f'damaged gzip file: {error}') from None

    def _chunks(self) -> Iterator[Chunk]:
        with self._file:
            if self._is_binary:
                yield from self._binary()
            elif is_packet_file(self._file.peek(4)):
                yield from self._packets()
            else:
                yield from self._text()

    def _text(self) -> Iterator[Chunk]:
        lines = self._lines()
        begin = next(lines, '')
        head = [begin]
        while head[-1].startswith('#') and not is_capture_line(begin) and len(head) < _HEAD:
            head.append(next(lines, ''))
        lines = chain(head, lines)
        if is_head_of_settings(head[-1]):
            raise TextProblem(f'{self.name}:1', (
                'the settings of a line, or the rows of a map, and no bytes: "check" reads them'))
        if is_head_of_values(begin):
            raise TextProblem(f'{self.name}:1', 'values, not bytes: "plc plot" draws them')
        if is_capture_line(begin):
            yield from read_capture(self.name, lines, self.settings)
            return
        reader = TextReader(self.name)
        for chunk in reader.chunks(lines):
            self.told, self.begun = reader.told, reader.begun
            yield chunk

    def _packets(self) -> Iterator[Chunk]:
        file = PacketFile(self.name, cast(BinaryIO, self._file))
        is_empty, seen = True, SeenPackets(self._servers)
        try:
            for chunk in chunks_of(file.packets(), seen):
                is_empty, self._position = False, file.position
                yield chunk
        except ValueError as error:
            raise Problem(self.name, f'byte {file.position}: {error}') from None
        if seen.cut:
            raise Problem(self.name, (
                f'{counted(len(seen.cut), "packet")} cut by the recorder, at {max(seen.cut)} '
                'bytes: what was in them is missing; record whole packets, as "tcpdump -s 0" '
                'does'))
        if is_empty:
            csp = f'; TCP port {CSP} is CSP, which is not decoded' if CSP in seen.ports else ''
            others = first([str(port) for port in sorted(seen.ports - {CSP})])
            raise Problem(self.name, (
                f'byte {file.position}: no packet up to here has DF1 (link type {LINK_TYPE}, a '
                'device server, or USB) or PCCC in EtherNet/IP (CIP service 4B)' + csp + (
                    f'; seen are TCP ports {others}: give that of a device server with --tcp'
                    if others else '')))

    def _binary(self) -> Iterator[Chunk]:
        while data := self._file.read(_BLOCK):
            self._position += len(data)
            yield Chunk(None, Direction.UNKNOWN, data)

    def _lines(self) -> Iterator[str]:
        """Yield the lines; each has its own encoding, because two programs may have written it."""
        encoding = _wide_encoding(self._file.peek(4)[:4])
        wide = TextIOWrapper(cast(BinaryIO, self._file), encoding or 'ascii', 'replace', '\n')
        read = wide.readline if encoding else self._file.readline
        number = 0
        while line := read(_LONGEST_LINE + 1):
            number += 1
            self._position += len(line) * (2 if encoding else 1)
            text = line if isinstance(line, str) else _decoded(line)
            if 10 * sum(map(text.count, _CONTROLS)) > 3 * len(text):
                raise Problem(f'{self.name}:{number}',
                              'this is not text; for a file of raw bytes give --binary')
            if len(line) > _LONGEST_LINE:
                raise Problem(f'{self.name}:{number}', (
                    f'the line is longer than {_LONGEST_LINE // 1_000_000} MB; divide it, or for '
                    'a file of raw bytes give --binary'))
            yield text.rstrip('\r\n')
        wide.detach()


def _wide_encoding(begin: bytes) -> str:
    """Return the encoding of a text with two bytes for each character, with or without a mark."""
    if begin.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return 'utf-16'
    zeros = ''.join('0' if byte == 0 else 'x' for byte in begin)
    return {'x0x0': 'utf-16-le', '0x0x': 'utf-16-be'}.get(zeros, '')


def _decoded(line: bytes) -> str:
    """Return a line in the first encoding that fits; any bytes fit the last one."""
    if line.isascii():
        return line.decode('ascii')
    for encoding in ('utf-8-sig', 'gb18030'):
        with suppress(UnicodeDecodeError):
            return line.decode(encoding)
    return line.decode('latin-1')
