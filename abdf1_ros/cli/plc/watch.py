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

"""Show values live: a table that changes on a terminal, elsewhere a line for each change."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Callable, Collection, Iterator, Sequence
import math
import shutil
import sys
import textwrap

from abdf1_ros.cli.plc.data import labels, Radix, rows, Tags, value_texts
from abdf1_ros.cli.plc.reading import NoValue, RepeatedReads, WatchedRead
from abdf1_ros.cli.terminal import check_reader, is_terminal, table, tell
from abdf1_ros.pccc.values import Values
from abdf1_ros.ports.clock import line_time
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.text import bar, BARS, counted, cut, printable

# Period (s) of questions for the mode of a PLC.
_MODE_PERIOD = 3.0

# Time (s) that a changed value stays marked.
MARKED = 1.0

# Least width of a row of values, in characters; also in a narrow window.
_LEAST_ROOM = 16

# Number of reads in a curve.
_CURVE = 24
_VALUE_AND_CURVE = f'value, and its last {_CURVE} reads'


class LiveValues(RepeatedReads):
    """
    Show the values of ``mappings``; ``tags`` are shown beside the addresses.

    On a terminal the mode of each PLC is shown above the values.
    """

    def __init__(self, network: Network, mappings: Sequence[Mapping], period: float,
                 radix: Radix = Radix.DECIMAL, tags: Tags | None = None,
                 record: str | None = None) -> None:
        self._is_live = is_terminal(sys.stdout)
        self._radix = radix
        self._names = {mapping: labels(mapping, tags) for mapping in mappings}
        self._changed: dict[Mapping, float] = {}
        self._past: dict[Mapping, deque[float]] = defaultdict(lambda: deque(maxlen=_CURVE))
        self._shown: dict[Mapping, Values | NoValue] = {}
        self._height = 0
        self._size: tuple[int, int] | None = None
        super().__init__(network, mappings, period, record,
                         processor_period=_MODE_PERIOD if self._is_live else 0.0)

    def begin(self) -> None:
        """Print nothing before the first values."""

    def show(self, news: Sequence[WatchedRead], lost: int) -> None:
        """Draw the table again, or print what has changed."""
        if self._is_live:
            self.note_changes(news)
            self.redraw()
            return
        if lost:
            tell('plc', lost_reads(lost))
        self._print(news)
        check_reader()  # values that stay print nothing

    def _print(self, changed: Sequence[WatchedRead]) -> None:
        """Print the rows of each mapping that changed since the last call."""
        for when, mapping, what in changed:
            if mapping not in self._shown or self._shown[mapping] != what:
                self._shown[mapping] = what
                time = when.time().isoformat(timespec='milliseconds')
                for address, text in self._rows(mapping):
                    print(f'{time}  {address}  {text}', flush=True)

    def note_changes(self, news: Sequence[WatchedRead]) -> None:
        """Record the values to show, and the times of their last changes."""
        for _, mapping, what in news:
            before = self._shown.get(mapping)
            if before is not None and before != what:
                self._changed[mapping] = line_time()
            self._shown[mapping] = what
            if isinstance(what, NoValue):
                # one gap per silence, so that the curve keeps the values before it
                if not isinstance(before, NoValue):
                    self._past[mapping].append(math.nan)
            elif mapping.length == 1 and not isinstance(what, str):
                self._past[mapping].append(what[0])

    def _rows(self, mapping: Mapping, room: int | None = None) -> list[tuple[str, str]]:
        """Return the value or the reason of an address, in rows of up to ``room`` characters."""
        what, names = self._shown.get(mapping), self._names[mapping]
        if what is None:
            return [(names[0], '')]
        if isinstance(what, NoValue):
            text = f'no value: {printable(what.error)}'
            lines = textwrap.wrap(text, room) if room else [text]
            return [(names[0] if line is lines[0] else '', line) for line in lines]
        return [(name, printable(text))
                for name, text in rows(mapping, what, names, self._radix, room)]

    def _head(self, mapping: Mapping) -> tuple[str, ...]:
        """Return the text between an address and its values."""
        now = line_time()  # the clock of the machine stands still while the port is lost
        age = self._driver.points[mapping].age(now)
        is_new = now - self._changed.get(mapping, -math.inf) < MARKED
        return (str(mapping.station), mapping.type.value,
                '' if age is None else f'{max(age, 0.0):.1f}', '*' if is_new else '')

    def _curve(self, mapping: Mapping) -> str:
        """Return the curve of a number; empty if the output cannot show it."""
        try:
            BARS.encode(sys.stdout.encoding or 'ascii')
        except UnicodeError:
            return ''
        return curve_of(self._past[mapping], lambda number: value_texts(
            mapping, [number], self._radix)[0])

    def _modes(self) -> Iterator[str]:
        """Yield a line for each PLC that was asked: identity, mode and faults."""
        for station in dict.fromkeys(mapping.station for mapping in self._mappings):
            health = self._driver.checks.known(station)
            if health.identity is None:
                continue
            faults = '; '.join(health.identity.faults)
            stands = '' if health.identity.is_running in (None, True) else \
                ': its program does not run, values may stand still'
            yield printable(f'station {station}: {health.processor}{stands}'
                            + (f'; {faults}' if faults else ''))

    def faults_of_line(self) -> list[str]:
        """Return the repetitions and damaged frames so far; empty if there were none."""
        counters = self.counters
        repeated = counters.nak_retries + counters.enq_retries
        damaged = counters.bcc_errors + counters.crc_errors
        return [f'line: {repeated} repeated, {damaged} damaged'] if repeated or damaged else []

    def redraw(self) -> None:
        """Draw the table over the table before."""
        size = width, height = shutil.get_terminal_size()
        heads = [self._head(mapping) for mapping in self._mappings]
        # The other columns keep their widths; the values get the rest of the line.
        titles = ('station', 'type', 'age s', '')
        names = ['address', *(name for names in self._names.values() for name in names)]
        taken = sum(max(map(len, column)) + 2
                    for column in (names, *zip(titles, *heads, strict=True)))
        room = max(width - 1 - taken, _LEAST_ROOM)
        cells, value = [], 'value'
        for mapping, head in zip(self._mappings, heads, strict=True):
            (name, text), *more = self._rows(mapping, room)
            curve = self._curve(mapping)
            with_curve = f'{text:8}  {curve}'
            if curve and len(with_curve) <= room:  # never a part of a curve
                text, value = with_curve, _VALUE_AND_CURVE
            cells.append((name, *head, text, printable(mapping.description)))
            cells += [(name, *[''] * len(head), text, '') for name, text in more]
        lines = _with_descriptions(('address', *titles, value), cells, width - taken)
        above, below = [*self._modes()], self.faults_of_line()
        left = max(height - 1 - len(above) - len(below), 1)
        if len(lines) > left:
            hidden = len(lines) - (left - 1)
            lines = [*lines[:left - 1], f'+{hidden} more; a higher window shows them']
        lines = [*above, *lines, *below]
        picture = [cut(line, width - 1) for line in lines[:max(height - 1, 1)]]
        # After a change of the window's size the old lines have moved.
        start = '' if self._size is None else \
            f'\x1b[{self._height}A' if size == self._size else '\x1b[H'
        print(start + '\n'.join(f'\x1b[K{line}' for line in picture), end='\n\x1b[J', flush=True)
        self._height, self._size = len(picture), size


def _with_descriptions(titles: Sequence[str], cells: Sequence[tuple[str, ...]],
                       left: int) -> list[str]:
    """Return the lines of the table; with the descriptions only if they fit."""
    title = 'description'
    if not any(row[-1] for row in cells) \
            or left - max(len(row[-2]) for row in cells) < len(title) + 2:
        cells, title = [(*row[:-1], '') for row in cells], ''
    return table((*titles, title), cells, right=(1, 3)).split('\n')


def lost_reads(count: int) -> str:
    """Return how many reads were dropped as text."""
    return f'{counted(count, "read")} lost: this output was too slow'


def curve_of(numbers: Collection[float], text: Callable[[float], str]) -> str:
    """
    Return a bar for each number; the scale is from the lowest to the highest.

    NaN and infinity are gaps. If ``text`` returns the same text for both limits, there is no
    curve.
    """
    known = [number for number in numbers if math.isfinite(number)]
    low, high = min(known, default=0), max(known, default=0)
    if text(low) == text(high):
        return ''
    bars = ''.join(bar(number, low, high) for number in numbers)
    return f'{text(low)} {bars} {text(high)}'
