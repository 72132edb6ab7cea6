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
A line of text for each bridge with a state on /diagnostics, the worst first.

``PlantWatch`` listens. ``render_plant`` makes the lines, and uses neither ROS nor a terminal.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
import time

from abdf1_ros.cli.monitor.node import Listening, shown_statuses, stopped_lines
from abdf1_ros.cli.monitor.view import LEVELS, ShownStatus, silence, Style, TextLine
from abdf1_ros.text import by_number, counted, cut, printable
from diagnostic_msgs.msg import DiagnosticArray

_NAME_WIDTH = 34
COLUMNS = ('state', 5, 'state'), ('load', 5, 'line load'), ('cycle', 8, 'poll cycle with Periods')


@dataclass(frozen=True, slots=True)
class LineState:
    """
    The last state of a bridge.

    - ``told``: clock value (s) of the state.
    - ``spares``: hosts on which another bridge waits for the line.
    """

    name: str
    told: float
    statuses: Sequence[ShownStatus]
    spares: Sequence[str] = ()

    def is_silent(self, now: float) -> bool:
        """Tell whether diagnostics are missing at the clock value ``now`` (s)."""
        return now - self.told > silence(self.statuses)

    def worst(self, now: float) -> ShownStatus:
        """Return the most important status at the clock value ``now`` (s)."""
        if self.is_silent(now):
            return ShownStatus('', Style.BAD, f'no diagnostics for {now - self.told:.0f} s')
        return min(self.statuses, key=lambda status: status.rank)

    def values(self) -> dict[str, str]:
        """Return the values of the link."""
        return {key: value for status in self.statuses if status.section == 'link'
                for key, value in status.values.items()}


class PlantWatch(Listening):
    """Listen to all bridges, until closed."""

    def __init__(self, ros_arguments: list[str]) -> None:
        super().__init__(ros_arguments)
        self._lines: dict[str, LineState] = {}
        # clock value up to which the last message counts, by line and host
        self._waiting: dict[str, dict[str, float]] = {}
        self.subscribe(DiagnosticArray, '/diagnostics', self._take, 1000)

    def lines(self) -> list[LineState]:
        """Return all bridges that were heard."""
        now = time.monotonic()
        found = {name: replace(line, spares=self._spares(name, now))
                 for name, line in self._lines.items()}
        for name in self._waiting:
            if (name not in found or found[name].is_silent(now)) \
                    and (spares := self._spares(name, now)):
                found[name] = LineState(name, now, [ShownStatus(
                    '', Style.BAD, f'no bridge has the line; waiting: {", ".join(spares)}')])
        return [*found.values()]

    @property
    def is_complete(self) -> bool:
        """Return True if all visible bridges were heard."""
        return {*self.bridges()} <= {*self._lines, *self._waiting}

    def _spares(self, name: str, now: float) -> list[str]:
        """Return the hosts that wait for a line."""
        return sorted(host for host, until in self._waiting.get(name, {}).items() if now <= until)

    def _take(self, message: DiagnosticArray) -> None:
        node = message.status[0].name.partition(': ')[0] if message.status else ''
        statuses = shown_statuses(message, node)
        sections = {status.section: status for status in statuses}
        now = time.monotonic()
        for name, reason in stopped_lines(message).items():
            self._lines[name] = LineState(name, now, [ShownStatus('', Style.BAD, reason)])
        if 'standby' in sections:
            host = sections['standby'].values.get('host', '')
            self._waiting.setdefault(f'/{node}', {})[host] = now + silence(statuses)
        elif 'link' in sections and 'mappings' in sections:
            self._lines[f'/{node}'] = LineState(f'/{node}', now, statuses)


def render_plant(lines: Iterable[LineState], now: float, width: int) -> list[TextLine]:
    """Return two lines of heading, and a line for each bridge; its name is the ``section``."""
    found = sorted(((line.worst(now), line) for line in lines),
                   key=lambda pair: (pair[0].rank[0], by_number(pair[1].name)))
    counts = Counter(status.style for status, _ in found)
    told = ', '.join(f'{counts[style]} {LEVELS[style]}' for style in reversed(LEVELS)
                     if counts[style])
    longest = min(_NAME_WIDTH, width // 3)
    names = [cut(printable(line.name), longest) for _, line in found]
    name_width = max(map(len, ['line', *names]))

    def row(name: str, values: dict[str, str], text: str) -> str:
        cells = '  '.join(f'{printable(values.get(key, "")):>{size}}' for _, size, key in COLUMNS)
        return cut(f'  {name:<{name_width}}  {cells}  {printable(text)}'.rstrip(), width)

    titles = {key: title for title, _, key in COLUMNS}
    title = f'{counted(len(found), "line")}: {told}' if found else \
        'no line is heard; diagnostics come every second'
    return [TextLine(cut(title, width), Style.TITLE),
            TextLine(row('line', titles, ''), Style.TITLE),
            *(TextLine(row(name, {**line.values(), 'state': LEVELS[status.style]},
                           _text(status, line.spares)), status.style, line.name)
              for name, (status, line) in zip(names, found, strict=True))]


def _text(status: ShownStatus, spares: Sequence[str]) -> str:
    return f'{status.short}; spare: {", ".join(spares)}' if spares else status.short
