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
A snapshot of a running bridge, and the lines of text that show it.

This module uses neither ROS nor a terminal: ``monitor.node`` fills a ``NodeView``, and
``monitor.command`` prints the lines. All text from topics is made printable here.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
import textwrap

from abdf1_ros.cli.monitor import curves
from abdf1_ros.numbers import decimal_number
from abdf1_ros.settings.columns import BETWEEN_NAMES
from abdf1_ros.text import BARS, counted, cut, printable, value_text

# A bridge without diagnostics for this time (s) counts as silent. By default they come every
# second; else they may be late by so many seconds.
SILENCE = 3.0
_LATE = 2.0
_DIAGNOSTICS_PERIOD = 'diagnostics period'

# Most characters of names and addresses; the values get the rest of the line.
_NAME_WIDTH = 30
_ADDRESS_WIDTH = 12
_STATE_WIDTH = 16
_SHORT_STATE = 8
_WORD = 5
_LOAD_WIDTH = 5
_AGE_WIDTH = 7
_GOOD_VALUE_WIDTH = 16
_LEAST_VALUE_WIDTH = 12

_STATION = 'station '
# Words for values of the link in the second line.
_FACTS = (('load', 'line load'), ('cycle', 'poll cycle with Periods'))
LINK_KEYS = ('settings', 'transactions per second', 'line load', 'poll cycle with Periods',
             'longest poll cycle with Periods', 'expected poll cycle, 10 ms an answer')
_PERIOD = 'period '  # beginning of keys of the link about a Period
LOAD_BY_TOPIC = 'line load by topic'
NAMES_OF_BITS = 'names of bits, '  # beginning of keys of the mappings; the topic follows
STATION_KEYS = ('last answer', 'transactions without reply', 'error replies', 'processor',
                'mode', 'faults')


class Style(Enum):
    """The style of a line on a terminal."""

    PLAIN = 'plain'
    TITLE = 'title'
    GOOD = 'good'
    WARNING = 'warning'
    BAD = 'bad'


LEVELS = {Style.BAD: 'ERROR', Style.WARNING: 'WARN', Style.GOOD: 'OK'}
"""The names of these styles in diagnostics, the worst first."""

_RANKS = [*LEVELS]


@dataclass(frozen=True, slots=True)
class TextLine:
    """One line of the picture; ``section`` names the part that begins with it."""

    text: str
    style: Style = Style.PLAIN
    section: str = ''


@dataclass(frozen=True, slots=True)
class TopicRow:
    """
    The last message of a read topic; ``values`` is None before the first.

    - ``received``: clock value (s).
    - ``promised``: longest pause (s) between two values that the topic promises; None if it
      promises nothing.
    """

    topic: str
    values: Sequence[float] | str | None = None
    address: str = ''
    received: float = 0.0
    promised: float | None = None
    curve: curves.Curve | None = None

    @property
    def is_missing(self) -> bool:
        """Return True if a topic that promises values has none."""
        return self.values is None and self.promised is not None

    def is_stale(self, now: float) -> bool:
        """Return True if the value is older than the topic promises."""
        return self.values is not None and self.promised is not None \
            and now - self.received > self.promised

    def state(self, now: float) -> tuple[str, Style]:
        """Return the state of the values as text, at the clock value ``now`` (s)."""
        if self.values is None:
            return 'no value', Style.BAD
        if self.promised is None:
            return 'any age', Style.PLAIN
        if self.is_stale(now):
            return f'STALE (>{self.promised:.3g} s)', Style.BAD
        return 'fresh', Style.GOOD


@dataclass(frozen=True, slots=True)
class ShownStatus:
    """
    One status of the diagnostics, or the result of one write.

    - ``section``: name without the node's name; for a result the tag.
    - ``received``: clock value (s), for results.
    """

    section: str
    style: Style
    message: str
    values: Mapping[str, str] = field(default_factory=dict)
    received: float = 0.0

    @property
    def rank(self) -> tuple[int, bool]:
        """Return a sort key: the worst first, then the most informative."""
        says_most = 'mappings' if self.style is Style.GOOD else 'link'
        return _RANKS.index(self.style), self.section not in ('', says_most)

    @property
    def short(self) -> str:
        """Return the message without its level; with the section if the message needs it."""
        text = self.message.removeprefix(f'{LEVELS[self.style]}: ')
        is_plain = self.section in ('', 'link', 'mappings')
        return text if is_plain else f'{self.section}: {text}'


def silence(statuses: Iterable[ShownStatus]) -> float:
    """Return the time (s) without diagnostics after which the bridge of these counts as silent."""
    told = (status.values.get(_DIAGNOSTICS_PERIOD, '') for status in statuses)
    periods = (decimal_number(text.removesuffix(' s')) for text in told)
    return max([SILENCE, *(period + _LATE for period in periods if period is not None)])


@dataclass(frozen=True, slots=True)
class NodeView:
    """
    All facts about one node.

    - ``told``: clock value (s) of the last diagnostics; None before the first.
    - ``active``: stations of the Active Node Table; None before the first message.
    - ``results``: the newest first.
    - ``stopped``: why its line does not run, as the process of many lines says; empty if unknown.
    """

    node: str
    is_there: bool
    told: float | None
    statuses: Sequence[ShownStatus]
    readings: Sequence[TopicRow]
    active: Sequence[int] | None
    results: Sequence[ShownStatus]
    hint: str = ''
    """The reason why topics may not be seen; empty for none."""
    stopped: str = ''


def render(snapshot: NodeView, now: float, width: int,
           bars: str = BARS) -> list[TextLine]:
    """
    Return the lines that show ``snapshot`` at the clock value ``now`` (s), cut to ``width``.

    The most important parts come first: the verdict, the values, the faults. ``bars`` are the
    characters of curves.
    """
    parts = {
        'values': [*_head(snapshot, now), *_values(snapshot, now, width, bars)],
        'reasons': _reasons(snapshot, width), 'writes': _writes(snapshot, now, width),
        'link': _link(snapshot, width), 'stations': _stations(snapshot, width),
        'counters': _counters(snapshot, width)}
    return [TextLine(cut(line.text, width), line.style, '' if number else name)
            for name, lines in parts.items() for number, line in enumerate(lines)]


def show(values: Sequence[float] | str, width: int) -> str:
    """Return values as text of at most ``width`` characters, with the number of omitted values."""
    if isinstance(values, str):
        return cut(f'"{printable(values)}"', width)
    # An element needs two characters or more, so later elements cannot fit.
    texts = [value_text(value) for value in values[:width // 2 + 1]]
    for count in range(len(texts), 0, -1):
        rest = len(values) - count
        text = ' '.join(texts[:count]) + (f' and {rest} more' if rest else '')
        if len(text) <= width:
            return text
    return cut(' '.join(texts), width)


def _head(snapshot: NodeView, now: float) -> Iterator[TextLine]:
    """Yield the verdict, and the state of line and PLCs."""
    found = sorted([*_heard(snapshot, now), *snapshot.statuses, *_missing(snapshot, now)],
                   key=lambda status: status.rank)
    worst, bad = found[0], sum(status.style is not Style.GOOD for status in found)
    more = f' (1 of {bad})' if bad > 1 else ''
    yield TextLine(printable(f'{snapshot.node}  {LEVELS[worst.style]}{more}: {worst.short}'),
                   worst.style)
    link = next(_section(snapshot, 'link'), None)
    facts = [f'{name} {link.values[key]}' for name, key in _FACTS if key in link.values] \
        if link else []
    stations = [status for status in snapshot.statuses if status.section.startswith(_STATION)]
    if stations:
        facts.append('stations ' + ', '.join(map(_mode, stations)))
    if facts:
        is_good = all(status.style is Style.GOOD for status in stations)
        yield TextLine(printable('  ' + '   '.join(facts)),
                       Style.PLAIN if is_good else Style.WARNING)


def _heard(snapshot: NodeView, now: float) -> Iterator[ShownStatus]:
    """Yield faults of the connection to the node."""
    if not snapshot.is_there:
        yield ShownStatus('', Style.BAD, snapshot.stopped or (
            'the node is not found yet' if snapshot.told is None else
            'the node is gone; these are its last messages'))
    if snapshot.told is None:
        remapped = '; if /diagnostics is remapped, monitor needs the same -r' \
            if snapshot.is_there else ''
        yield ShownStatus('', Style.WARNING, f'no diagnostics yet{remapped}')
    elif now - snapshot.told > silence(snapshot.statuses):
        yield ShownStatus('', Style.BAD, f'no diagnostics for {now - snapshot.told:.1f} s')


def _missing(snapshot: NodeView, now: float) -> Iterator[ShownStatus]:
    """Yield the number of topics without a fresh value here; the bridge may not know them."""
    missing = sum(reading.is_missing or reading.is_stale(now) for reading in snapshot.readings)
    topics = counted(len(snapshot.readings), 'topic')
    if missing:
        yield ShownStatus('topics', Style.BAD, f'{missing} of {topics} without a fresh value here')
    elif not snapshot.statuses:
        yield ShownStatus('', Style.GOOD, topics)


def _mode(status: ShownStatus) -> str:
    """Return the number of a station and the mode of its processor, or "silent"."""
    mode = status.values.get('mode', '').partition(' (')[0] or LEVELS[status.style]
    number = status.section.removeprefix(_STATION)
    return f'{number} {"silent" if status.style is Style.BAD else mode}'


def _link(snapshot: NodeView, width: int) -> Iterator[TextLine]:
    for status in _section(snapshot, 'link'):
        yield from _summary('link', status, width)
        periods = [key for key in status.values if key.startswith(_PERIOD)]
        yield from _table(status.values, [*LINK_KEYS, *periods], width)
        for key in ('last error', 'cause', 'next step'):
            if (text := status.values.get(key, 'none')) != 'none':
                yield from _wrapped(f'{key}: {text}', width, Style.WARNING)
    for status in _section(snapshot, 'standby'):
        yield from _summary('standby', status, width)


def _stations(snapshot: NodeView, width: int) -> Iterator[TextLine]:
    if snapshot.active is not None:
        numbers = ', '.join(map(str, snapshot.active)) or 'none'
        yield TextLine(f'  active stations: {numbers}')
    for status in snapshot.statuses:
        if status.section.startswith(_STATION):
            yield from _summary(status.section, status, width)
            yield from _table(status.values, STATION_KEYS, width)


@dataclass(frozen=True, slots=True)
class _Widths:
    """The widths of the columns of values; 0 for a column that does not fit."""

    topic: int
    state: int
    value: int
    address: int = 0
    load: int = 0
    curve: int = 0

    @classmethod
    def of(cls, topic: int, width: int) -> _Widths:
        """Divide a width among the columns; the column of values has priority."""
        left = width - topic - _AGE_WIDTH - _WORD - 8 - _GOOD_VALUE_WIDTH
        sizes = []
        for size in (_SHORT_STATE - _WORD - 2, curves.WIDTH, _LOAD_WIDTH,
                     _STATE_WIDTH - _SHORT_STATE - 2, _ADDRESS_WIDTH):
            fits = left >= size + 2
            left -= (size + 2) * fits
            sizes.append((size + 2) * fits)
        short, curve, load, long, address = sizes
        return cls(topic, _WORD + short + long, max(_LEAST_VALUE_WIDTH, _GOOD_VALUE_WIDTH + left),
                   address and _ADDRESS_WIDTH, load and _LOAD_WIDTH, curve and curves.WIDTH)

    def row(self, topic: str, address: str, age: str, state: str, load: str, curve: str,
            value: str) -> str:
        """Return a line of the table."""
        state = state if len(state) <= self.state else state.split()[0]
        cells = [f'{topic:<{self.topic}}', f'{cut(address, self.address):<{self.address}}',
                 f'{age:>{_AGE_WIDTH}}', f'{state:<{self.state}}', f'{load:>{self.load}}',
                 f'{curve:<{self.curve}}', value]
        sizes = self.topic, self.address, _AGE_WIDTH, self.state, self.load, self.curve, 1
        shown = (cell for cell, size in zip(cells, sizes, strict=True) if size)
        return ('  ' + '  '.join(shown)).rstrip()


def _values(snapshot: NodeView, now: float, width: int, bars: str) -> Iterator[TextLine]:
    longest = min(_NAME_WIDTH, width // 3)
    names = [cut(printable(reading.topic), longest) for reading in snapshot.readings]
    widths = _Widths.of(max(map(len, ['topic', *names])), width)
    loads, bits = _loads(snapshot), _names_of_bits(snapshot)
    heads = 'topic', 'address', 'age', 'state', 'load', f'last {curves.SECONDS:g} s', 'value'
    yield TextLine(widths.row(*heads), Style.TITLE)
    for name, reading in zip(names, snapshot.readings, strict=True):
        state, style = reading.state(now)
        age = value = curve = ''
        if reading.values is not None:
            age = f'{now - reading.received:.1f} s'
            value = _show_bits(reading.values, bits.get(reading.topic, ()), widths.value) \
                or show(reading.values, widths.value)
        if reading.curve and widths.curve:
            curve = reading.curve.draw(now, reading.promised, bars)
        yield TextLine(widths.row(name, printable(reading.address), age, state,
                                  loads.get(reading.topic, ''), curve, value), style)
    if not snapshot.readings:
        yield TextLine(f'  no read topic found{snapshot.hint}', Style.WARNING)


def _loads(snapshot: NodeView) -> dict[str, str]:
    """Return the part of the line's time for each topic, by its name."""
    told = ', '.join(status.values.get(LOAD_BY_TOPIC, '')
                     for status in _section(snapshot, 'link'))
    pairs = (entry.rpartition(' ') for entry in printable(told).split(', '))
    return {topic: load for topic, _, load in pairs}


def _names_of_bits(snapshot: NodeView) -> dict[str, Sequence[str]]:
    """Return the names of the bits of each topic that has such names."""
    return {key.removeprefix(NAMES_OF_BITS): printable(value).split(BETWEEN_NAMES)
            for status in _section(snapshot, 'mappings') for key, value in status.values.items()
            if key.startswith(NAMES_OF_BITS)}


def _show_bits(values: Sequence[float] | str, names: Sequence[str], width: int) -> str:
    """Return the names of the bits that are 1; empty if the bits have no names."""
    if isinstance(values, str) or not names or len(values) != len(names):
        return ''
    return cut(', '.join(name for name, value in zip(names, values, strict=True) if value)
               or f'all {len(names)} are 0', width)


def _reasons(snapshot: NodeView, width: int) -> Iterator[TextLine]:
    """Yield the faults, the worst first, with each bad row of the map."""
    shown = (status for status in snapshot.statuses if status.style is not Style.GOOD
             or status.section in ('mappings', 'interlocks'))
    for status in sorted(shown, key=lambda status: status.rank):
        yield from _summary(status.section, status, width)
        if status.section == 'mappings':
            for key, value in status.values.items():
                # The counts are in the summary, and the names beside the values.
                if not value.isdecimal() and not key.startswith(NAMES_OF_BITS):
                    yield from _wrapped(f'{key}: {value}', width, status.style)


def _writes(snapshot: NodeView, now: float, width: int) -> Iterator[TextLine]:
    for status in _section(snapshot, 'writes'):
        if status.style is not Style.GOOD or any(map(_says_something, status.values.values())):
            yield from _summary('writes', status, width)
    for result in snapshot.results:
        value, latency = (result.values.get(key, '?') for key in ('value', 'latency_ms'))
        yield from _wrapped(f'{now - result.received:.1f} s ago: {result.section} {value} '
                            f'{result.message} ({latency} ms)', width, result.style)


def _counters(snapshot: NodeView, width: int) -> Iterator[TextLine]:
    """Yield the counters that are not 0, in as many columns as fit."""
    for status in _section(snapshot, 'counters'):
        yield from _summary('counters', status, width)
        cells = [f'{printable(key):<24} {printable(value):>9}'
                 for key, value in status.values.items() if value != '0']
        columns = max(1, (width - 2) // 38)
        for start in range(0, len(cells), columns):
            yield TextLine('      ' + '    '.join(cells[start:start + columns]))


def _section(snapshot: NodeView, name: str) -> Iterator[ShownStatus]:
    return (status for status in snapshot.statuses if status.section == name)


def _summary(name: str, status: ShownStatus, width: int) -> Iterator[TextLine]:
    """Yield the name and the message of a status; the message is never cut."""
    return _wrapped(status.message, width, status.style, f'  {printable(name):<12} ')


def _wrapped(text: str, width: int, style: Style = Style.PLAIN,
             head: str = '      ') -> Iterator[TextLine]:
    """Yield a text in as many lines as it needs; ``head`` stands before the first."""
    room = max(_LEAST_VALUE_WIDTH, width - len(head))
    for part in textwrap.wrap(printable(text), room) or ['']:
        yield TextLine(head + part, style)
        head = ' ' * len(head)


def _says_something(value: str) -> bool:
    return value not in ('', '0', '0.0')


def _table(values: Mapping[str, str], keys: Sequence[str], width: int) -> Iterator[TextLine]:
    """Yield the values of ``keys`` as a column of names and a column of values, without zeros."""
    known = [key for key in keys if _says_something(values.get(key, ''))]
    longest = max(map(len, known), default=0)
    for key in known:
        yield from _wrapped(values[key], width, head=f'      {key:<{longest}}  ')
