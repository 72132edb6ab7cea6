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
Read recorded bytes from files of several kinds: captures, packets, dumps, logs, raw bytes.

A hex dump is bytes in hexadecimal, with or without spaces. It may have the offsets and characters
of ``xxd`` and ``hexdump -C``. It has neither times nor directions. ``hexdump`` without options,
and ``od -x``, write words of two bytes, with the low byte last. All other lines are read by
``logs``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from gzip import BadGzipFile, GzipFile
from io import BufferedReader
from itertools import chain, repeat
from pathlib import Path
import re
from typing import BinaryIO, cast
import zlib

from abdf1_ros.problems import Problem
from abdf1_ros.sniffer.capture import Chunk, Direction, is_capture_line, read_capture
from abdf1_ros.sniffer.ethernet_ip import chunks_of, CSP, SeenPackets
from abdf1_ros.sniffer.logs import LogReader
from abdf1_ros.sniffer.packet_files import is_packet_file, PacketFile
from abdf1_ros.sniffer.pcapng import LINK_TYPE
from abdf1_ros.text import counted, is_head_of_values

_BLOCK = 4096
_GZIP = b'\x1F\x8B'
# The longest text line in bytes: no program writes longer lines, and a file without line ends,
# such as /dev/zero, must not fill the memory.
_LONGEST_LINE = 1_000_000
# The bytes, and after two spaces the same bytes as characters.
_XXD = re.compile(r'(?P<offset>[0-9a-f]{6,}): (?P<bytes>\S.*?)(?:  .*)?', re.IGNORECASE)
_HEXDUMP = re.compile(r'(?P<offset>[0-9a-f]{7,})  (?P<bytes>[0-9a-f ]+)(?:\|.*)?', re.IGNORECASE)
_WORDS = re.compile(r'(?P<offset>[0-9a-f]{7,})(?P<words>(?: +[0-9a-f]{4}){1,8})?', re.IGNORECASE)
_REPEATED = '*'
# Bytes that a dump may leave out, all together: hours of the same byte on the fastest line.
_MOST_LEFT_OUT = 100_000_000


class Recording:
    """
    The chunks of a file; ``settings`` has the settings of a capture, as far as it has been read.

    ``has_size`` tells whether the file has a known size; a pipe or device has none. Raises OSError
    if the file cannot be opened.
    """

    def __init__(self, path: Path, is_binary: bool = False) -> None:
        self.settings: dict[str, str] = {}
        self._size = path.stat().st_size
        self.has_size = self._size > 0
        self._position = 0
        self._name = str(path)
        self._is_binary = is_binary
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
            raise Problem(self._name, f'damaged gzip file: {error}') from None

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
        first = next(lines, '')
        lines = chain([first], lines)
        if is_head_of_values(first):
            raise Problem(f'{self._name}:1', 'values, not bytes: "plc plot" draws them')
        if is_capture_line(first):
            return read_capture(self._name, lines, self.settings)
        if _WORDS.fullmatch(first.strip()) and ' ' in first.strip():
            return read_words(self._name, lines)
        return read_hex(self._name, lines)

    def _packets(self) -> Iterator[Chunk]:
        file = PacketFile(self._name, cast(BinaryIO, self._file))
        is_empty, seen = True, SeenPackets()
        for chunk in chunks_of(file.packets(), seen):
            is_empty, self._position = False, file.position
            yield chunk
        if seen.cut:
            raise Problem(self._name, (
                f'{counted(len(seen.cut), "packet")} cut by the recorder, at {max(seen.cut)} '
                'bytes: what was in them is missing; record whole packets, as "tcpdump -s 0" '
                'does'))
        if is_empty:
            csp = f'; TCP port {CSP} is CSP, which is not decoded' if CSP in seen.ports else ''
            raise Problem(self._name, f'byte {file.position}: no packet up to here has DF1 (link '
                          f'type {LINK_TYPE}) or PCCC in EtherNet/IP (CIP service 4B)' + csp)

    def _binary(self) -> Iterator[Chunk]:
        while data := self._file.read(_BLOCK):
            self._position += len(data)
            yield Chunk(None, Direction.UNKNOWN, data)

    def _lines(self) -> Iterator[str]:
        limited = iter(lambda: self._file.readline(_LONGEST_LINE + 1), b'')
        for number, line in enumerate(limited, 1):
            self._position += len(line)
            where = f'{self._name}:{number}'
            if not line.isascii() or b'\0' in line:
                raise Problem(where, 'this is not text; for a file of raw bytes give --binary')
            if len(line) > _LONGEST_LINE:
                raise Problem(where, f'the line is longer than {_LONGEST_LINE // 1_000_000} MB; '
                              'divide it, or for a file of raw bytes give --binary')
            yield line.decode('ascii').rstrip('\r\n')


def read_hex(name: str, lines: Iterable[str]) -> Iterator[Chunk]:
    """Yield the chunks of a hex dump or log; raises Problem, with the line, for other texts."""
    log = LogReader()
    end = 0  # offset after the bytes of the last line that has an offset
    last = b''
    is_repeated = False
    left_out = 0
    for number, text in enumerate(lines, 1):
        line = text.strip()
        if line == _REPEATED and last:
            is_repeated = True
            continue
        if not line or line.startswith('#'):
            continue
        match = _XXD.fullmatch(line) or _HEXDUMP.fullmatch(line)
        offset = int(match['offset'], 16) if match else _bare_offset(line, end, is_repeated)
        if match is None and offset is None:
            yield from _of_log(log, line, f'{name}:{number}')
            continue
        data = _bytes(match['bytes'], f'{name}:{number}') if match else b''
        if is_repeated and offset is not None:
            left_out += (count := offset - end)
            if not 0 <= count <= left_out <= _MOST_LEFT_OUT:
                raise Problem(f'{name}:{number}', (
                    f'the offset does not fit: "{_REPEATED}" stands for lines like the one above, '
                    f'in a file for at most {_MOST_LEFT_OUT // 1_000_000} MB of them'))
            yield from repeat(Chunk(None, Direction.UNKNOWN, last), count // len(last))
        is_repeated = False
        if match:
            end, last = (offset or 0) + len(data), data
        if data:
            yield Chunk(None, Direction.UNKNOWN, data)


def read_words(name: str, lines: Iterable[str]) -> Iterator[Chunk]:
    """
    Yield the chunks of a dump in words, whose offsets are hexadecimal or octal.

    The next offset shows whether the last word of a line has only one byte. Raises Problem if the
    offsets do not fit.
    """
    size, last = 0, b''  # the number of all bytes, and the bytes of the line before
    is_first = True
    for number, line in enumerate(lines, 1):
        where, match = f'{name}:{number}', _WORDS.fullmatch(line.strip())
        if line.strip() == _REPEATED and not is_first:
            raise Problem(where, 'lines are left out here, and offsets of words may be octal; use '
                                 '"hexdump -v" or "hexdump -C"')
        if match is None:
            raise Problem(where, f'"{line[:60]}" is not an offset and words as in those before')
        places = {int(match['offset'], base) for base in (8, 16)
                  if base == 16 or re.fullmatch('[0-7]+', match['offset'])}
        if not places & {size, size - bool(last)}:
            raise Problem(where, f'the offset does not follow {size} bytes')
        if size not in places:
            size, last = size - 1, last[:-1]
        if last:
            yield Chunk(None, Direction.UNKNOWN, last)
        last = b''.join(bytes.fromhex(word)[::-1] for word in (match['words'] or '').split())
        size, is_first = size + len(last), False
    if last:
        yield Chunk(None, Direction.UNKNOWN, last)


def _of_log(log: LogReader, line: str, where: str) -> Iterator[Chunk]:
    try:
        chunk = log.read(line)
    except ValueError:
        raise Problem(where, f'"{line[:60]}" is not a hexadecimal dump; write bytes as in '
                      '10 05 01 FF, after a direction such as TX or RX, or give --binary for a '
                      'file of raw bytes') from None
    if chunk is not None:
        yield chunk


def _bare_offset(line: str, end: int, is_repeated: bool) -> int | None:
    """Return the offset that ``hexdump -C`` puts alone on the last line."""
    if not end or not re.fullmatch('[0-9a-fA-F]{7,}', line):
        return None
    offset = int(line, 16)
    return offset if is_repeated or offset == end else None


def _bytes(text: str, where: str) -> bytes:
    try:
        return bytes.fromhex(re.sub(r'0x|,', ' ', text))
    except ValueError:
        raise Problem(where, f'"{text[:60]}" is not a hexadecimal dump; write bytes as in '
                      '10 05 01 FF, or give --binary for a file of raw bytes') from None
