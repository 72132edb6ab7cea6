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
Read the values in a file of ``plc log``, as CSV or JSON lines, or of ``examples/recorder.py``.

A last line without its end was cut off by a power failure, and is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
import csv
from datetime import datetime
import json
import math
from pathlib import Path
import re
from typing import NamedTuple, TextIO

from abdf1_ros.cli.plc.log_file import COLUMNS, is_end_of_gap
from abdf1_ros.numbers import decimal_number
from abdf1_ros.problems import Problem
from abdf1_ros.sniffer.capture import is_capture_line
from abdf1_ros.text import shown

_RECORDED = ('time', 'topic', 'address', 'values')
_WATCHED = re.compile(r'\d\d:\d\d:\d\d\.\d{3}  \S')
_STRING_FILE = 'ST'
_JOINED = 'another file was joined here'
_NOT_FINITE = {'nan', 'inf', '-inf'}


class ValuePlace(NamedTuple):
    """Where a value comes from; a file of recorder.py knows no station, and few addresses."""

    station: str
    address: str
    tag: str

    @property
    def name(self) -> str:
        """Return the tag, or the address."""
        return self.tag or self.address


class Sample(NamedTuple):
    """
    A row: a value, or None and the ``reason``; without ``place`` it is about all values.

    ``when`` has a UTC offset.
    """

    when: datetime
    place: ValuePlace | None
    value: float | str | None
    reason: str


def samples(path: str, remark: Callable[[str], None]) -> Iterator[Sample]:
    """
    Yield the rows of a file; ``remark`` gets what was left out.

    Raises Problem, with the line, for other files and rows, and OSError.
    """
    with Path(path).open(encoding='utf-8-sig', errors='replace', newline='') as file:
        lines = _whole_lines(file, lambda: remark(
            f'{path}: its last line has no end, and is left out'))
        first = next(lines, '').strip()
        if first.startswith('{'):
            yield from _json(path, [first], 1)
            yield from _json(path, lines, 2)
        elif delimiter := _delimiter(first, COLUMNS):
            yield from _rows(path, lines, _logged, delimiter)
        elif delimiter := _delimiter(first, _RECORDED):
            yield from _rows(path, lines, _recorded, delimiter)
        else:
            if is_capture_line(first):
                raise Problem(f'{path}:1', 'bytes, not values: "sniff --html" draws them')
            if _WATCHED.match(first):
                raise Problem(f'{path}:1', (
                    'has the text of "plc watch" for a screen; log with "plc log --to FILE", and '
                    'draw that file'))
            raise Problem(f'{path}:1', (
                'is not a CSV or JSON lines of "plc log", nor a CSV of recorder.py: it begins '
                f'with "{shown(first)}"' if first else 'the file is empty'))


def _delimiter(head: str, columns: Sequence[str]) -> str:
    """Return what divides a head of these columns, empty for another; a spreadsheet may choose."""
    return next((sign for sign in ',;\t' if head == sign.join(columns)), '')


def _whole_lines(file: TextIO, tell_cut: Callable[[], None]) -> Iterator[str]:
    for line in file:
        if not line.endswith('\n'):
            tell_cut()
        else:
            yield line


def _rows(path: str, lines: Iterable[str],
          read: Callable[[Sequence[str]], Iterable[Sample]], delimiter: str) -> Iterator[Sample]:
    reader = csv.reader(lines, delimiter=delimiter)
    is_joined = False
    while True:
        try:
            row = next(reader, None)
            if row is None:
                return
            if row and row[0] == 'time':  # the head again, where files were joined
                is_joined = True
            elif row:
                for sample in read(row):
                    if is_joined:
                        yield Sample(sample.when, None, None, _JOINED)
                    is_joined = False
                    yield sample
        except (ValueError, csv.Error) as error:
            raise Problem(f'{path}:{reader.line_num + 1}', _fault(error)) from None


def _fault(error: Exception) -> str:
    return f'this row cannot be read: {error}'


def _logged(row: Sequence[str]) -> Iterator[Sample]:
    if len(row) != len(COLUMNS):
        raise ValueError(f'it has {len(row)} columns in place of {len(COLUMNS)}')
    time, station, address, tag, text, reason = row
    yield _sample(_moment(time), station, address, tag, _value(text, address), reason)


def _sample(when: datetime, station: str, address: str, tag: str, value: float | str | None,
            reason: str) -> Sample:
    if not address:
        return Sample(when, None, None, reason)
    return _at(when, ValuePlace(station, address, tag), value, reason)


def _at(when: datetime, place: ValuePlace, value: float | str | None, reason: str) -> Sample:
    if isinstance(value, float) and not math.isfinite(value):  # as in the other forms of a log
        value, reason = None, f'the value is {value}'
    # An empty text is a value, if no reason says that there is none.
    missing = value is None or value == '' and reason and not is_end_of_gap(reason)
    return Sample(when, place, None if missing else value, reason)


def _value(text: str, address: str) -> float | str:
    if text.lower() in _NOT_FINITE:
        return float(text)
    number = None if address.startswith(_STRING_FILE) else decimal_number(text.replace(',', '.'))
    return text if number is None else number


def _recorded(row: Sequence[str]) -> Iterator[Sample]:
    if len(row) < len(_RECORDED) - 1:
        raise ValueError(f'it has {len(row)} columns')
    time, topic, address, *values = row
    when = _moment(time)
    for number, text in enumerate(values):
        name = topic if len(values) == 1 else f'{topic}[{number}]'
        yield _at(when, ValuePlace('', address if not number else '', name),
                  _value(text, address or _STRING_FILE), '')


def _json(path: str, lines: Iterable[str], first: int) -> Iterator[Sample]:
    for number, line in enumerate(lines, first):
        try:
            yield _of_json(json.loads(line))
        except (ValueError, KeyError, TypeError) as error:
            raise Problem(f'{path}:{number}', _fault(error)) from None


def _of_json(row: Mapping[str, object]) -> Sample:
    time, station, address, tag, value, reason = (row[name] for name in COLUMNS)
    if not isinstance(value, int | float | str | None):
        raise TypeError(f'{value} is not a value')
    return _sample(_moment(str(time)), '' if station is None else str(station), str(address),
                   str(tag), value, str(reason))


def _moment(text: str) -> datetime:
    try:
        when = datetime.fromisoformat(text)
    except ValueError:
        raise ValueError(f'"{shown(text)}" is not a time as "plc log" writes it; if a spreadsheet '
                         'has saved the file again, draw the original') from None
    if when.tzinfo is None:
        raise ValueError(f'{text} has no UTC offset')
    return when
