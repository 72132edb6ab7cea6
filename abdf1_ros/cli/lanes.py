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
Pictures for a browser: blocks of time in lanes, and curves, as SVG in one HTML file.

The file needs no network and runs no program: its Content-Security-Policy forbids both. All texts
from outside go through ``text_of``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from html import escape
from itertools import accumulate, pairwise
import math
from pathlib import Path

from abdf1_ros.text import cut, printable

WIDTH = 1160  # pixels; the names of lanes take the first NAMES pixels
NAMES = 110
_RIGHT = 20
_GAP = 6
_LETTER = 6.3  # pixels of a letter in a bar
_LEAST = 1.6  # pixels: least width of a bar, so that it can be seen
TICKS = 10  # about, on an axis
_BARE = ' style="stroke: none"'  # of a bar that may be thin
_MARGIN = 4  # pixels above and below a curve
_MOST_LETTERS = 17  # of a name
_MARK = '<meta name="generator" content="abdf1_ros">'

_STYLE = """
:root { color-scheme: light; }
body { font: 14px/1.45 system-ui, "DejaVu Sans", sans-serif; color: #1b1f24; background: #fff;
  max-width: 1200px; margin: 1.5em auto; padding: 0 1em; }
h1 { font-size: 1.4em; margin-bottom: .2em; } h2 { font-size: 1.1em; margin: 1.8em 0 .4em; }
h3 { font-size: 1em; margin: 1.2em 0 0; font-weight: 600; }
svg { display: block; max-width: 100%; height: auto; margin: .5em 0; }
svg:target { outline: 3px solid #d9860a; outline-offset: 3px; }
svg text { font: 11px "DejaVu Sans", system-ui, sans-serif; fill: #1b1f24; }
svg .in { fill: #fff; pointer-events: none; }
.lane { fill: #f2f4f7; } .grid { stroke: #d5dae1; } .limit { stroke: #111; stroke-width: 2; }
svg rect { stroke: #fff; stroke-width: .6; } svg .lane, svg .small { stroke: none; }
.ask { fill: #2f6db5; } .answer { fill: #2e8b57; } .small { fill: #9aa5b1; }
.wait { fill: #c9dcf2; } .odd { fill: #d9860a; }
.bad { fill: #c62828; stroke: #6d0f0f; } .missing { fill: #fbe3e1; stroke: #c62828; }
.curve { fill: none; stroke: #2f6db5; stroke-width: 1.3; stroke-linejoin: round; }
table { border-collapse: collapse; margin: .6em 0; }
td, th { padding: .15em .7em .15em 0; text-align: left; vertical-align: top;
  border-bottom: 1px solid #e3e7ec; } td.number, th.number { text-align: right; }
p { margin: .35em 0; } .verdict { font-size: 1.1em; font-weight: 600; } .is-bad { color: #b3261e; }
.is-odd { color: #9a5b00; } .is-good { color: #1f6b41; } .quiet { color: #5a6572; }
.key { display: inline-block; width: 1.1em; height: .8em; margin: 0 .35em 0 1em; }
@media print { svg, tr { break-inside: avoid; } }
"""


class Look(Enum):
    """The kind of a bar; the value is its class in the style."""

    ASK = 'ask'
    ANSWER = 'answer'
    SMALL = 'small'
    WAIT = 'wait'
    ODD = 'odd'
    BAD = 'bad'
    MISSING = 'missing'


@dataclass(frozen=True, slots=True)
class Bar:
    """
    An event from ``start`` to ``end``, in a ``row`` of its lane.

    - ``title``: shown under the mouse.
    - ``labels``: the bar shows the first label that fits.
    - ``link``: the name of a drawing.
    - ``low``, ``high``: the part of the row's height that it takes.
    """

    start: float
    end: float
    look: Look
    title: str
    labels: Sequence[str] = ()
    row: int = 0
    link: str = ''
    low: float = 0.0
    high: float = 1.0


@dataclass(frozen=True, slots=True)
class Scale:
    """The axis: ``start`` is at the left, and one unit has ``pixels``."""

    start: float
    pixels: float

    def place(self, value: float) -> float:
        """Return the horizontal place of a value."""
        return NAMES + (value - self.start) * self.pixels


@dataclass(frozen=True, slots=True)
class Lane:
    """
    Bars in one row or several rows; each bar has the number of its row.

    ``most``: what the full height means; ``tall``: a height of rows other than the usual one.
    """

    name: str
    bars: Sequence[Bar]
    rows: int = 1
    most: str = ''
    tall: int = 0

    @property
    def row_height(self) -> int:
        return self.tall or (22 if self.rows == 1 else 14)

    @property
    def height(self) -> int:
        return self.rows * self.row_height

    def ground(self, top: int) -> str:
        """Return what is below the grid."""
        return _label(self.name, top + self.height / 2 + 4) + _ground(top, self.height) \
            + _limit(self.most, top + 10)

    def drawn(self, top: int, scale: Scale) -> Iterator[str]:
        """Yield what is above the grid."""
        for bar in self.bars:
            yield from _bar(bar, top + bar.row * self.row_height, self.row_height, scale)


@dataclass(frozen=True, slots=True)
class CurveLane:
    """
    A number over time, on a scale from ``low`` to ``high``.

    - ``pieces``: parts without a gap; a moment is its place on the axis, and its values in the
      order in which they came: first, least, greatest, last.
    - ``texts``: the lowest and the highest value as text.
    - ``gaps``: bars for the time without a value.
    """

    name: str
    title: str
    pieces: Sequence[Sequence[tuple[float, Sequence[float]]]]
    low: float
    high: float
    texts: tuple[str, str]
    gaps: Sequence[Bar] = ()
    height: int = 70

    def ground(self, top: int) -> str:
        """Return what is below the grid."""
        low, high = self.texts
        return _label(self.name, top + self.height / 2 + 4, self.title) \
            + _ground(top, self.height) + _limit(high, top + 10) \
            + _limit(low if low != high else '', top + self.height - 3)

    def drawn(self, top: int, scale: Scale) -> Iterator[str]:
        """Yield what is above the grid."""
        for gap in self.gaps:
            yield from _bar(gap, top, self.height, scale)
        path = ''.join(self._piece(piece, top, scale) for piece in self.pieces)
        yield f'<path class="curve" d="{path}"><title>{text_of(self.title)}</title></path>'

    def _piece(self, piece: Sequence[tuple[float, Sequence[float]]], top: int,
               scale: Scale) -> str:
        span, room = (self.high - self.low) or 1.0, self.height - 2 * _MARGIN
        bottom = top + self.height - (_MARGIN if self.high > self.low else self.height / 2)
        parts: list[str] = []
        for place, values in piece:
            heights = [f'{bottom - (value - self.low) / span * room:.1f}' for value in values]
            parts.append(f'{"L" if parts else "M"}{scale.place(place):.1f} {heights[0]}')
            parts += [f'V{now}' for before, now in pairwise(heights) if now != before]
        # One moment alone has to be seen too.
        return ''.join(parts) + (f'h{_LEAST}' if len(piece) == 1 else '')


def text_of(text: str) -> str:
    """Return any text as HTML: all of it visible, none of it markup."""
    return escape(printable(text))


def drawing(lanes: Sequence[Lane | CurveLane], start: float, end: float, unit: str,
            limit: float | None = None, name: str = '',
            ticks: Sequence[tuple[float, str]] | None = None) -> str:
    """
    Return an SVG of lanes from ``start`` to ``end``, below them the axis with ``unit``.

    ``limit`` gets a thick line. ``name`` is the target of links. ``ticks`` are the places of the
    grid with their texts; without them these are numbers.
    """
    scale = Scale(start, (WIDTH - NAMES - _RIGHT) / ((end - start) or 1.0))
    height = sum(lane.height + _GAP for lane in lanes)
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height + 20}" '
             f'width="{WIDTH}" height="{height + 20}" role="img"'
             + (f' id="{text_of(name)}">' if name else '>')]
    tops = [*accumulate((lane.height + _GAP for lane in lanes), initial=0)]
    parts += [lane.ground(top) for lane, top in zip(lanes, tops, strict=False)]
    parts += _axis(numbers(start, end) if ticks is None else ticks, scale, height, unit)
    for lane, top in zip(lanes, tops, strict=False):
        parts += lane.drawn(top, scale)
    if limit is not None:
        place = scale.place(limit)
        parts.append(f'<line class="limit" x1="{place:.1f}" x2="{place:.1f}" y1="0" '
                     f'y2="{height}"/>')
    return '\n'.join([*parts, '</svg>'])


def _ground(top: int, height: int) -> str:
    return (f'<rect class="lane" x="{NAMES}" y="{top}" width="{WIDTH - NAMES - _RIGHT}" '
            f'height="{height}"/>')


def _label(name: str, y: float, title: str = '') -> str:
    known = cut(name, _MOST_LETTERS)
    told = f'<title>{text_of(title or name)}</title>' if title or known != name else ''
    return f'<text x="0" y="{y:.1f}">{text_of(known)}{told}</text>'


def _limit(text: str, y: float) -> str:
    return text and f'<text x="{NAMES - 4}" y="{y}" text-anchor="end">{text_of(text)}</text>'


def _bar(bar: Bar, top: int, height: int, scale: Scale) -> Iterator[str]:
    left, width = scale.place(bar.start), (bar.end - bar.start) * scale.pixels
    room = height - 2
    y, tall = top + 1 + room * (1 - bar.high), room * (bar.high - bar.low)
    drawn = (f'<rect class="{bar.look.value}" x="{left:.1f}" y="{y:.4g}" '
             f'width="{max(width, _LEAST):.1f}" height="{tall:.4g}"{_BARE * (tall < room)}>'
             f'<title>{text_of(bar.title)}</title></rect>')
    yield f'<a href="#{text_of(bar.link)}">{drawn}</a>' if bar.link else drawn
    label = next((text for text in bar.labels if len(text) * _LETTER + 6 < width), '')
    if label:
        yield (f'<text class="in" x="{left + 4:.1f}" y="{top + height / 2 + 4:.1f}">'
               f'{text_of(label)}</text>')


def _axis(ticks: Iterable[tuple[float, str]], scale: Scale, top: int, unit: str) -> Iterator[str]:
    for at, text in ticks:
        place = scale.place(at)
        yield (f'<line class="grid" x1="{place:.1f}" x2="{place:.1f}" y1="0" y2="{top + 4}"/>'
               f'<text x="{place:.1f}" y="{top + 16}" text-anchor="middle">{text_of(text)}</text>')
    yield f'<text x="0" y="{top + 16}">{text_of(unit)}</text>'


def numbers(start: float, end: float) -> Iterator[tuple[float, str]]:
    """Yield about ten round numbers from ``start`` to ``end``, each with its text."""
    step = _step((end - start) / TICKS)
    for number in range(math.ceil(start / step), math.floor(end / step + 1e-9) + 1):
        yield number * step, f'{number * step:.10g}'


def _step(least: float) -> float:
    """Return the smallest step that is at least ``least``, as 1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(least)) if least > 0 else 1.0
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= least * 0.999)


def key(entries: Iterable[tuple[Look, str]]) -> str:
    """Return the legend of the colours."""
    return '<p class="quiet">' + ' '.join(
        f'<svg class="key" viewBox="0 0 10 8"><rect class="{look.value}" width="10" height="8"/>'
        f'</svg>{text_of(text)}' for look, text in entries) + '</p>'


def cells(head: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[int] = ()) -> str:
    """Return a table of HTML; the columns in ``right`` hold numbers."""
    looks = [' class="number"' if number in right else '' for number in range(len(head))]

    def line(tag: str, row: Sequence[str]) -> str:
        return '<tr>' + ''.join(f'<{tag}{look}>{cell}</{tag}>'
                                for look, cell in zip(looks, row, strict=True)) + '</tr>'
    return '\n'.join(['<table>', line('th', head), *(line('td', row) for row in rows), '</table>'])


def write_page(path: str, title: str, parts: Iterable[str]) -> None:
    """Write a page of HTML parts; raises OSError."""
    Path(path).touch(0o640)  # not for every user: it may hold the values of a plant
    with open(path, 'w', encoding='utf-8') as file:
        file.write('<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
                   f'{_MARK}\n<meta http-equiv="Content-Security-Policy" '
                   'content="default-src \'none\'; style-src \'unsafe-inline\'">\n'
                   f'<title>{text_of(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n'
                   f'<h1>{text_of(title)}</h1>\n')
        for part in parts:
            file.write(f'{part}\n')
        file.write('</body>\n</html>\n')


def is_page(path: Path) -> bool:
    """Return True if a file is one of these pages, so that a new page may replace it."""
    with path.open('rb') as file:
        return _MARK.encode() in file.read(1000)
