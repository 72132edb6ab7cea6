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
Captures: the recorded bytes of a line, as text that can be read and mailed.

A capture is ASCII, one line for each chunk of bytes as it was read or written::

    # abdf1_ros capture 1
    # begun: 2026-03-01T14:05:09.120+01:00
    # baud: 19200
    # check: CRC
    # duplex: half
    0.000000 > 10 05 01 FF
    0.004210 < 10 04

The first line gives the version of the format. Other lines with ``#`` are settings ("name: value")
or remarks, at any place. The setting "guest: A40E pty:/tmp/hmi" says that the next command with
TNS A40E is from the guest at pty:/tmp/hmi (column Share). The setting "lines lost here" tells that
the recorder was too slow for all bytes before the next chunk.

A chunk has the seconds since ``begun``, its direction, and its bytes in hexadecimal. Directions:

- ``>``: sent by the recording program, or by the first port of a tap
- ``<``: received by the recording program, or sent by the second port of a tap
- ``?``: not known
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from enum import Enum
import errno
import fcntl
import math
from pathlib import Path
from typing import NamedTuple

from abdf1_ros.numbers import decimal_number
from abdf1_ros.problems import Problem
from abdf1_ros.text import printable

VERSION = 1
LOST = 'lines lost here'
_MAGIC = '# abdf1_ros capture'
_FIRST_LINE = f'{_MAGIC} {VERSION}'
# Times (s) from here on are refused; it is more than the seconds since 1970.
_LATEST = 1e10
# Most characters of a line that a Problem shows.
_SHOWN = 60


class Direction(Enum):
    """The direction of a chunk; the value is its character in a capture."""

    OUT = '>'
    IN = '<'
    UNKNOWN = '?'

    @property
    def opposite(self) -> Direction:
        """Return the opposite direction."""
        return {Direction.OUT: Direction.IN, Direction.IN: Direction.OUT}.get(self, self)


class Chunk(NamedTuple):
    """
    Bytes as they were read or written; ``time`` in seconds, None if not recorded.

    With ``is_message``, the bytes are the link data of one message without a frame. If a guest's
    command follows, in this chunk or a later chunk, ``guest`` is "TNS place".
    """

    time: float | None
    direction: Direction
    data: bytes
    is_message: bool = False
    guest: str = ''

    def __str__(self) -> str:
        """Return the line of a capture."""
        return f'{self.time or 0.0:.6f} {self.direction.value} {self.data.hex(" ").upper()}'


class CaptureWriter:
    """
    Write a capture to ``path``, and begin a new file when it has become too long.

    ``limit`` is the most bytes on the disk. At half of it, the file is renamed to ``<path>.1`` and
    replaces an older file of this name. A capture that exists already is renamed at the start.
    Every line is given to the operating system at once, whole or not at all. Raises OSError, also
    if ``path`` or ``<path>.1`` exists and is not a capture, or is being written by another; such a
    file is not changed.

    If another program has cut, moved or deleted the file, as logrotate does, the capture begins
    again with the next line; ``tell`` is called with what was done to it.
    """

    def __init__(self, path: Path, limit: float = math.inf,
                 settings: Mapping[str, str] | None = None,
                 tell: Callable[[str], None] = lambda text: None) -> None:
        self.path = path
        self._limit = limit / 2
        self._settings = dict(settings or {})
        self._tell = tell
        self._written = 0
        for place in (path, self._older):
            _check_free(place)
        self._begin()

    @property
    def _older(self) -> Path:
        return Path(f'{self.path}.1')

    def write(self, chunk: Chunk | str | dict[str, str]) -> None:
        """Write a chunk, a line from ``setting_line``, or settings of the next files too."""
        if isinstance(chunk, dict):
            self._settings |= chunk
            for name, value in chunk.items():
                self.write(setting_line(name, value))
            return
        self._follow()
        line = str(chunk)
        if self._written + len(line) + 1 > self._limit:
            self._file.close()
            self._begin()
        self._put(line)

    def close(self) -> None:
        self._file.close()

    def _follow(self) -> None:
        """Begin again if the file is no longer what was written."""
        size = self._size()
        if size is None:
            self._file.close()
            _check_free(self.path)
            self._begin()
            self._tell('was moved or deleted; the recording goes on in a new file')
        elif size < self._written:
            self._file.truncate(0)
            self._put_head()
            self._tell('was cut; the recording begins again in it')

    def _size(self) -> int | None:
        """Return the size of our file; None if the path leads to another file, or to none."""
        try:
            status = self.path.stat()
        except FileNotFoundError:
            return None
        return status.st_size if (status.st_dev, status.st_ino) == self._identity else None

    def _begin(self) -> None:
        if self.path.exists():
            if self.path.stat().st_size:
                _check_free(self._older)
                self.path.replace(self._older)
            else:
                self.path.unlink()
        self.path.touch(0o640)  # not for every user: it holds the values of a plant
        self._file = self.path.open('ab', buffering=0)
        status = self.path.stat()
        self._identity = status.st_dev, status.st_ino
        with suppress(OSError):  # not every network file system has locks
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._put_head()

    def _put_head(self) -> None:
        self._written = 0
        self._put('\n'.join([_FIRST_LINE, *(
            setting_line(name, value) for name, value in self._settings.items())]))

    def _put(self, text: str) -> None:
        left = line = f'{text}\n'.encode('ascii')
        try:
            while left:
                left = left[self._file.write(left):]
        except OSError:
            self._file.truncate(self._written)  # half a line would mean other bytes
            raise
        self._written += len(line)


def _check_free(place: Path) -> None:
    """Raise OSError if there is a file that a capture must not replace."""
    if place.exists() and not may_replace(place, _MAGIC.encode()):
        raise OSError(errno.EEXIST, 'exists and is not a capture; give another name', str(place))
    if place.exists() and _is_locked(place):
        raise OSError(errno.EBUSY, 'is being written by another; give another name', str(place))


def setting_line(name: str, value: str) -> str:
    """Return the line of a setting, in ASCII."""
    line = f'# {name}: {printable(value)}'
    return line.encode('ascii', 'backslashreplace').decode('ascii')


def may_replace(path: Path, head: bytes) -> bool:
    """Return True for a file that begins with ``head``, or is empty: it may be replaced."""
    if not path.is_file():
        return False
    with path.open('rb') as file:
        return file.read(len(head)) in (b'', head)


def _is_locked(path: Path) -> bool:
    """Return True if a CaptureWriter, maybe of another program, writes this file now."""
    with path.open('rb') as file, suppress(OSError):
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def is_capture_line(line: str) -> bool:
    """Return True if ``line`` is the first line of a capture of any version."""
    return line.startswith(_MAGIC)


def read_capture(name: str, lines: Iterable[str], settings: dict[str, str]) -> Iterator[Chunk]:
    """
    Yield the chunks of a capture, and put its settings into ``settings`` as they are read.

    Raises Problem for a line that does not belong in a capture; ``name`` is the file name in it.
    """
    guest = ''
    for number, text in enumerate(lines, 1):
        line = text.strip()
        if number == 1 and line != _FIRST_LINE:
            raise Problem(f'{name}:1', f'"{line[:_SHOWN]}" should be "{_FIRST_LINE}"')
        if line.startswith('#'):
            key, colon, value = line[1:].partition(':')
            if key.strip() == 'guest':
                guest = value.strip()
            elif colon:
                settings[key.strip()] = value.strip()
        elif line:
            yield _chunk(line, f'{name}:{number}')._replace(guest=guest)
            guest = ''


def _chunk(line: str, where: str) -> Chunk:
    time, _, rest = line.partition(' ')
    direction, _, data = rest.partition(' ')
    number = decimal_number(time)
    try:
        chunk = Chunk(number, Direction(direction), bytes.fromhex(data))
    except ValueError:
        number = None
    if number is None:
        raise Problem(where, f'"{line[:_SHOWN]}" should be seconds, ">", "<" or "?", and bytes, '
                      'as in 0.004210 < 10 04')
    if abs(number) >= _LATEST:
        raise Problem(where, f'"{time[:_SHOWN]}" is not a number of seconds')
    return chunk
