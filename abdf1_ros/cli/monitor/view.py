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
What is known of a running bridge, and the lines of text that show it.

This module knows neither ROS nor a terminal: ``monitor.node`` fills a ``Snapshot``, and
``monitor.command`` prints the lines. All text from topics is made printable here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
import textwrap

from abdf1_ros.text import cut, printable, value_text

# After so many seconds without diagnostics the picture says so; by default they come every second.
SILENCE = 3.0

# Characters that names and addresses get at most; the values have the rest of the line.
_NAME_WIDTH = 30
_ADDRESS_WIDTH = 12
_STATE_WIDTH = 16
_SHORT_STATE = 6
_AGE_WIDTH = 7
_GOOD_VALUE_WIDTH = 24
_LEAST_VALUE_WIDTH = 12

_LINK_KEYS = ('settings', 'transactions per second', 'line load', 'poll cycle with Periods',
              'longest poll cycle with Periods', 'expected poll cycle, line time alone')
_PERIOD = 'period '  # how keys of the link begin that tell of a Period
_STATION_KEYS = ('last answer', 'transactions without reply', 'error replies', 'processor',
                 'mode', 'faults')


class Style(Enum):
    """How a line is to be shown, where a terminal can."""

    PLAIN = 'plain'
    TITLE = 'title'
    GOOD = 'good'
    WARNING = 'warning'
    BAD = 'bad'


@dataclass(frozen=True, slots=True)
class TextLine:
    """One line to be shown; ``section`` is the part of the picture that begins with it."""

    text: str
    style: Style = Style.PLAIN
    section: str = ''


@dataclass(frozen=True, slots=True)
class Reading:
    """
    The last message of a read topic; ``values`` is None before the first.

    ``received`` is a clock value (s). ``promised`` is the longest pause (s) between two values
    that the topic offers, None for one that promises nothing.
    """

    topic: str
    values: Sequence[float] | str | None = None
    address: str = ''
    received: float = 0.0
    promised: float | None = None

    def state(self, now: float) -> tuple[str, Style]:
        """Return the state of the values in a word, at the clock value ``now`` (s)."""
        if self.values is None:
            return 'no value', Style.BAD
        if self.promised is None:
            return 'no promise', Style.PLAIN
        if now - self.received > self.promised:
            return f'STALE (>{self.promised:.3g} s)', Style.BAD
        return 'fresh', Style.GOOD


@dataclass(frozen=True, slots=True)
class Status:
    """
    One status of the diagnostics, or the result of one write.

    ``section`` is its name without that of the node, of a result the tag. ``received`` is a clock
    value (s), for results.
    """

    section: str
    style: Style
    message: str
    values: Mapping[str, str] = field(default_factory=dict)
    received: float = 0.0


@dataclass(frozen=True, slots=True)
class Snapshot:
    """
    All that is known of one node.

    ``told`` is the clock value (s) of the last diagnostics, ``active`` the stations of the
    Active Node Table; each is None before the first message. ``results`` begin with the newest.
    """

    node: str
    is_there: bool
    told: float | None
    statuses: Sequence[Status]
    readings: Sequence[Reading]
    active: Sequence[int] | None
    results: Sequence[Status]
    hint: str = ''
    """Why topics may not be seen, empty where nothing is known."""


def render(snapshot: Snapshot, now: float, width: int) -> list[TextLine]:
    """Return the lines that show ``snapshot`` at the clock value ``now`` (s), cut to ``width``."""
    parts = {
        'link': [*_head(snapshot, now), *_link(snapshot, width)],
        'stations': _stations(snapshot, width), 'values': _values(snapshot, now, width),
        'reasons': _mappings(snapshot, width), 'writes': _writes(snapshot, now, width),
        'counters': _counters(snapshot, width)}
    return [TextLine(cut(line.text, width), line.style, '' if number else name)
            for name, lines in parts.items() for number, line in enumerate(lines)]


def show(values: Sequence[float] | str, width: int) -> str:
    """Return values as text of at most ``width`` characters; what is left out is counted."""
    if isinstance(values, str):
        return cut(f'"{printable(values)}"', width)
    # An element takes two characters or more: no need to write out what cannot fit.
    texts = [value_text(value) for value in values[:width // 2 + 1]]
    for count in range(len(texts), 0, -1):
        rest = len(values) - count
        text = ' '.join(texts[:count]) + (f' and {rest} more' if rest else '')
        if len(text) <= width:
            return text
    return cut(' '.join(texts), width)


def _head(snapshot: Snapshot, now: float) -> Iterator[TextLine]:
    yield TextLine(printable(snapshot.node), Style.TITLE)
    if not snapshot.is_there:
        yield TextLine('  the node is gone; these are its last words', Style.BAD)
    if snapshot.told is None:
        remapped = '; where /diagnostics is remapped, monitor needs the same -r' \
            if snapshot.is_there else ''
        yield TextLine(f'  no diagnostics yet{remapped}', Style.WARNING)
    elif now - snapshot.told > SILENCE:
        yield TextLine(f'  no diagnostics for {now - snapshot.told:.1f} s', Style.BAD)


def _link(snapshot: Snapshot, width: int) -> Iterator[TextLine]:
    for status in _section(snapshot, 'link'):
        yield from _summary('link', status, width)
        periods = [key for key in status.values if key.startswith(_PERIOD)]
        yield from _table(status.values, [*_LINK_KEYS, *periods], width)
        error = status.values.get('last error', 'none')
        if error != 'none':
            yield from _wrapped(f'last error: {error}', width, Style.WARNING)
    for status in _section(snapshot, 'standby'):
        yield from _summary('standby', status, width)


def _stations(snapshot: Snapshot, width: int) -> Iterator[TextLine]:
    if snapshot.active is not None:
        numbers = ', '.join(map(str, snapshot.active)) or 'none'
        yield TextLine(f'  active stations: {numbers}')
    for status in snapshot.statuses:
        if status.section.startswith('station '):
            yield from _summary(status.section, status, width)
            yield from _table(status.values, _STATION_KEYS, width)


def _values(snapshot: Snapshot, now: float, width: int) -> Iterator[TextLine]:
    longest = min(_NAME_WIDTH, width // 3)
    names = [cut(printable(reading.topic), longest) for reading in snapshot.readings]
    name_width = max(map(len, ['topic', *names]))
    # The value is kept longest: a narrow terminal first drops the address, then cuts the state.
    left = width - name_width - _AGE_WIDTH - 6
    state_width = _STATE_WIDTH if left - _STATE_WIDTH - 2 >= _GOOD_VALUE_WIDTH else _SHORT_STATE
    left -= state_width + 2
    has_address = left - _ADDRESS_WIDTH - 2 >= _GOOD_VALUE_WIDTH
    value_width = max(_LEAST_VALUE_WIDTH, left - (_ADDRESS_WIDTH + 2) * has_address)

    def row(topic: str, age: str, state: str, value: str, address: str) -> str:
        state = f'{state[:state_width]:<{state_width}}'
        place = f'  {address:<{_ADDRESS_WIDTH}}' if has_address else ''
        return f'  {topic:<{name_width}}{place}  {age:>{_AGE_WIDTH}}  {state}  {value}'

    yield TextLine(row('topic', 'age', 'state', 'value', 'address').rstrip(), Style.TITLE)
    for name, reading in zip(names, snapshot.readings, strict=True):
        state, style = reading.state(now)
        age, value = '', ''
        if reading.values is not None:
            age = f'{now - reading.received:.1f} s'
            value = show(reading.values, value_width)
        address = cut(printable(reading.address), _ADDRESS_WIDTH)
        yield TextLine(row(name, age, state, value, address).rstrip(), style)
    if not snapshot.readings:
        yield TextLine(f'  no read topic found{snapshot.hint}', Style.WARNING)


def _mappings(snapshot: Snapshot, width: int) -> Iterator[TextLine]:
    for status in _section(snapshot, 'mappings'):
        yield from _summary('mappings', status, width)
        for key, value in status.values.items():
            if not value.isdecimal():  # the counts are in the summary
                yield from _wrapped(f'{key}: {value}', width, status.style)


def _writes(snapshot: Snapshot, now: float, width: int) -> Iterator[TextLine]:
    for name in ('writes', 'interlocks'):
        for status in _section(snapshot, name):
            if status.style is not Style.GOOD or any(map(_says_something, status.values.values())):
                yield from _summary(name, status, width)
    for result in snapshot.results:
        value, latency = (result.values.get(key, '?') for key in ('value', 'latency_ms'))
        yield from _wrapped(f'{now - result.received:.1f} s ago: {result.section} {value} '
                            f'{result.message} ({latency} ms)', width, result.style)


def _counters(snapshot: Snapshot, width: int) -> Iterator[TextLine]:
    """Yield the counters that are not 0, as many columns as fit."""
    for status in _section(snapshot, 'counters'):
        yield from _summary('counters', status, width)
        cells = [f'{printable(key):<24} {printable(value):>9}'
                 for key, value in status.values.items() if value != '0']
        columns = max(1, (width - 2) // 38)
        for start in range(0, len(cells), columns):
            yield TextLine('      ' + '    '.join(cells[start:start + columns]))


def _section(snapshot: Snapshot, name: str) -> Iterator[Status]:
    return (status for status in snapshot.statuses if status.section == name)


def _summary(name: str, status: Status, width: int) -> Iterator[TextLine]:
    """Yield the name and the message of a status, which is never cut."""
    room = max(_LEAST_VALUE_WIDTH, width - 15)
    for number, part in enumerate(textwrap.wrap(printable(status.message), room) or ['']):
        yield TextLine(f'  {"" if number else printable(name):<12} {part}', status.style)


def _wrapped(text: str, width: int, style: Style = Style.PLAIN) -> Iterator[TextLine]:
    for part in textwrap.wrap(printable(text), max(_LEAST_VALUE_WIDTH, width - 6)):
        yield TextLine(f'      {part}', style)


def _says_something(value: str) -> bool:
    return value not in ('', '0', '0.0')


def _table(values: Mapping[str, str], keys: Sequence[str], width: int) -> Iterator[TextLine]:
    """Yield what is known of ``keys`` as a column of names and one of values, without zeros."""
    known = [key for key in keys if _says_something(values.get(key, ''))]
    longest = max(map(len, known), default=0)
    for key in known:
        room = max(_LEAST_VALUE_WIDTH, width - longest - 8)
        for number, part in enumerate(textwrap.wrap(printable(values[key]), room)):
            yield TextLine(f'      {"" if number else key:<{longest}}  {part}')
