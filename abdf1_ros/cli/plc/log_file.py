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
The rows of ``plc log``: their forms, and a file that is continued.

A row is one value, or the reason why there is none: time with UTC offset, station, address, tag,
value, reason. The first value after a gap has a reason too (``is_end_of_gap``). A row without a
station is about all addresses.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, timedelta, UTC
from enum import Enum
import errno
import fcntl
import io
import json
import os
import re
import stat
import sys
from typing import NamedTuple

from abdf1_ros.cli.terminal import check_reader, drop_output, reason_of
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.text import printable, shown

COLUMNS = 'time', 'station', 'address', 'tag', 'value', 'reason'

ANSWERS_AGAIN, HEARD_AGAIN = 'answers again', 'heard again'

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_CONTINUED = 'the log goes on'

# Most bytes of a last line that are looked at: no row is longer.
_LONGEST_ROW = 65536

_MEASUREMENT = 'plc'


class Cell(Enum):
    """What a row has as its value; the value is the name of the field in line protocol."""

    INTEGER = 'integer'
    FLOAT = 'float'
    TEXT = 'text'
    NONE = ''


class LogRow(NamedTuple):
    """One value as ``text``, or a ``reason`` why there is none; ``when`` has a UTC offset."""

    when: datetime
    station: int | None
    address: str
    tag: str
    cell: Cell
    text: str
    reason: str = ''


@dataclass(frozen=True, slots=True)
class LogForm:
    """
    A form of the rows.

    - ``head``: the first line of a file, empty for none.
    - ``line``: the line of a row.
    - ``first_line``: what the first line of such a file looks like; ``any_row``: each row.
    """

    head: str
    line: Callable[[LogRow], str]
    first_line: re.Pattern[str]
    any_row: re.Pattern[str]


def is_end_of_gap(reason: str) -> bool:
    """Return True for the reason of the first value after a gap."""
    return reason in (ANSWERS_AGAIN, HEARD_AGAIN)


def _csv_line(row: LogRow) -> str:
    value = _quoted(printable(row.text)) if row.cell is Cell.TEXT else row.text
    return ','.join((_time(row), '' if row.station is None else str(row.station), row.address,
                     row.tag and _quoted(row.tag), value, row.reason and _quoted(row.reason)))


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"'


def _time(row: LogRow) -> str:
    return row.when.isoformat(timespec='milliseconds')


def _json_line(row: LogRow) -> str:
    number, reason = _finite(row)
    value = row.text if row.cell is Cell.TEXT else None if number is None else \
        int(number) if row.cell is Cell.INTEGER else float(number)
    line = json.dumps(dict(zip(COLUMNS, (
        _time(row), row.station, row.address, row.tag, value, reason), strict=True)),
        ensure_ascii=False)
    return ''.join(one if one.isprintable() else json.dumps(one)[1:-1] for one in line)


def _finite(row: LogRow) -> tuple[str | None, str]:
    """Return the number of a row, None for none, and its reason: no form but CSV has NaN."""
    if row.cell is Cell.FLOAT and row.text.lstrip('-') in ('nan', 'inf'):
        return None, row.reason or f'the value is {row.text}'
    return (row.text if row.cell in (Cell.INTEGER, Cell.FLOAT) else None), row.reason


def _line_protocol(row: LogRow) -> str:
    """
    Return a point of InfluxDB's line protocol.

    A field of InfluxDB keeps its type for all series, so each type has a field of its own.
    """
    number, reason = _finite(row)
    tags = [('station', '' if row.station is None else str(row.station)),
            ('address', row.address), ('tag', row.tag)]
    fields = []
    if row.cell is Cell.TEXT:
        fields.append(f'{row.cell.value}={_field_text(printable(row.text))}')
    elif number is not None:
        fields.append(f'{row.cell.value}={number}{"i" * (row.cell is Cell.INTEGER)}')
    if reason:
        fields.append(f'reason={_field_text(reason)}')
    series = ''.join(f',{name}={_tag_text(text)}' for name, text in tags if text)
    nanoseconds = (row.when - _EPOCH) // timedelta(microseconds=1) * 1000
    return f'{_MEASUREMENT}{series} {",".join(fields)} {nanoseconds}'


def _field_text(text: str) -> str:
    return '"' + text.replace('\\', r'\\').replace('"', r'\"') + '"'


def _tag_text(text: str) -> str:
    # A backslash at the end would escape the comma or blank after it.
    return re.sub('([,= ])', r'\\\1', text + ' ' * text.endswith('\\'))


_HEAD = ','.join(COLUMNS)

_JSON_ROW = re.compile(r'\{"time": ".*"reason": ".*"\}')
_POINT = re.compile(rf'{_MEASUREMENT}[, ].* \d+')

FORMS = {
    'csv': LogForm(_HEAD, _csv_line, re.compile(re.escape(_HEAD)), re.compile(
        r'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}[+-]\d\d:\d\d(?:,.*){5}')),
    'jsonl': LogForm('', _json_line, _JSON_ROW, _JSON_ROW),
    'influx': LogForm('', _line_protocol, _POINT, _POINT),
}


class LogLost(Exception):
    """The log cannot be written any more; the text says why, and how much is in it."""


class Log(ABC):
    """A log, row by row; a continued log has no second head. ``count`` is the number of rows."""

    def __init__(self, form: LogForm) -> None:
        self._form = form
        self.count = 0
        self._is_continued = False

    def begin(self) -> None:
        """Write what stands before the first row of this run."""
        if self._is_continued:
            self._put(self._form.line(_continued()))
        elif self._form.head:
            self._put(self._form.head)

    def write(self, rows: Iterable[LogRow]) -> None:
        """Write rows; raises LogLost, and BrokenPipeError if the reader has left."""
        if lines := [*map(self._form.line, rows)]:
            self._put('\n'.join(lines))
            self.count += len(lines)

    @abstractmethod
    def _put(self, text: str) -> None:
        """Write lines at once; raises LogLost, and BrokenPipeError if the reader has left."""

    @abstractmethod
    def close(self) -> None:
        """End the log."""


class LogOutput(Log):
    """
    The log on standard output; a file that ``>>`` continues keeps its one head.

    It is in UTF-8, as a file is: a program reads it, and an escape would be another value.
    """

    def __init__(self, form: LogForm) -> None:
        super().__init__(form)
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(encoding='utf-8', errors='backslashreplace')
        self._is_continued = _is_our_output(form)

    def write(self, rows: Iterable[LogRow]) -> None:
        """Write rows; raises BrokenPipeError also without a row, as in a long gap."""
        super().write(rows)
        check_reader()

    def _put(self, text: str) -> None:
        try:
            print(text, flush=True)
        except BrokenPipeError:
            raise
        except OSError as error:
            drop_output()
            raise LogLost(_lost('the output', error, self.count)) from None

    def close(self) -> None:
        """Do nothing: the output stays open."""


def _is_our_output(form: LogForm) -> bool:
    """Return True if standard output is a file that already begins as ours do."""
    with suppress(OSError, ValueError):
        status = os.fstat(sys.stdout.fileno())
        if stat.S_ISREG(status.st_mode) and status.st_size:
            with open(f'/proc/self/fd/{sys.stdout.fileno()}', 'rb') as file:
                return bool(form.first_line.fullmatch(_first_line(file.read(_LONGEST_ROW))))
    return False


def _continued() -> LogRow:
    return LogRow(datetime.now().astimezone(), None, '', '', Cell.NONE, '', _CONTINUED)


def _first_line(data: bytes) -> str:
    return data.partition(b'\n')[0].decode('utf-8', 'replace').rstrip('\r')


def _lost(name: str, error: OSError, count: int) -> str:
    return f'{reason_of(name, error)}; the log ends here, after {count} rows of this run'


class LogFile(Log):
    """
    A log on the disk that is continued, row by row.

    ``count`` is the number of rows of this run. The file never has half a row: the rest of one,
    after a power failure, is removed, and ``remark`` says so. If another program empties the file,
    it begins again with its head. Raises ConfigurationError if the
    file is not a log of this form, if another program writes to it, or if it cannot be opened.
    """

    def __init__(self, path: str, form: LogForm) -> None:
        super().__init__(form)
        self.path = path
        self._size = 0
        self.remark = ''
        self._is_new = not os.path.exists(path)
        try:
            self._is_regular = self._is_new or os.path.isfile(path)
            flags = os.O_RDWR | os.O_CREAT | os.O_APPEND if self._is_regular else os.O_WRONLY
            # not for every user: it holds the values of a plant
            self._file = os.open(path, flags | os.O_CLOEXEC, 0o640)
        except OSError as error:
            raise ConfigurationError([Problem('--to', reason_of(path, error))]) from None
        if self._is_regular:
            try:
                self._check()
            except (ConfigurationError, OSError) as error:
                os.close(self._file)
                if isinstance(error, OSError):
                    error = ConfigurationError([Problem('--to', reason_of(path, error))])
                raise error from None

    def _check(self) -> None:
        """Lock the file, and cut off the rest of a row at its end."""
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno == errno.EWOULDBLOCK:  # not every network file system has locks
                raise self._fault('is being written by another program') from None
        self._size = os.fstat(self._file).st_size
        head = os.pread(self._file, _LONGEST_ROW, 0)
        if b'\n' not in head and self._form.head.encode().startswith(head.rstrip(b'\r\0')):
            self._size = 0
        elif not self._form.first_line.fullmatch(_first_line(head)):
            raise self._fault(f'is not a log of this form: it begins with '
                              f'"{shown(_first_line(head))}"')
        else:
            self._size = self._end_of_rows()
        os.ftruncate(self._file, self._size)
        self._is_continued = self._size > 0

    def _end_of_rows(self) -> int:
        """Return the size without the rest of a row, if the last row is one of this form."""
        start = max(0, self._size - _LONGEST_ROW)
        whole, _, rest = os.pread(self._file, _LONGEST_ROW, start).rpartition(b'\n')
        if len(rest) > self._size - start - 1:
            raise self._fault('has no line end in its last 64 kB')
        last = whole.rstrip().rpartition(b'\n')[2].decode('utf-8', 'replace').rstrip('\r')
        if not (self._form.any_row.fullmatch(last) or self._form.first_line.fullmatch(last)):
            raise self._fault('was changed, perhaps saved again by a spreadsheet: its last row is '
                              f'"{shown(last)}"')
        if rest:
            self.remark = (f'{self.path}: removed the rest of a row that was not written to its '
                           f'end: "{shown(rest.decode("utf-8", "replace"))}"')
        return self._size - len(rest)

    def _fault(self, text: str) -> ConfigurationError:
        return ConfigurationError([Problem('--to', f'{self.path} {text}; give another name')])

    def _put(self, text: str) -> None:
        left = data = f'{self._head_anew()}{text}\n'.encode()
        try:
            while left:
                left = left[os.write(self._file, left):]
        except OSError as error:
            if self._is_regular:
                os.ftruncate(self._file, self._size)  # half a row would mean another value
            raise LogLost(_lost(self.path, error, self.count)) from None
        self._size += len(data)

    def _head_anew(self) -> str:
        """Return the head if another program has emptied the file; LogLost if it is removed."""
        status = os.fstat(self._file)
        if not self._is_regular:
            return ''
        if not status.st_nlink:
            raise LogLost(f'{self.path} was removed; the log ends here, after {self.count} rows '
                          'of this run')
        was_emptied = self._size and not status.st_size
        self._size = status.st_size
        return f'{self._form.head}\n' if was_emptied and self._form.head else ''

    def close(self) -> None:
        """Close the file; remove it if it is new and nothing was written to it."""
        os.close(self._file)
        if self._is_new and not self._size:
            with suppress(OSError):
                os.unlink(self.path)
