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
Run a bridge with simulated PLCs; draw the line, the monitor and two curves as one picture.

From the root, as docs/demo.svg was made::

    python -m tools.picture docs/demo.svg

Station 1 is silent for some seconds, so that the picture shows the effect on its values.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import NamedTuple
from xml.sax.saxutils import escape

from abdf1_ros.cli.monitor.view import NodeView, render, Style, TextLine
from abdf1_ros.ros.observer import claim_domain

_ROOT = Path(__file__).resolve().parent.parent
_NET, _MAP = 'config/net.csv', 'config/map.csv'
_BLANK = '\N{NO-BREAK SPACE}'  # viewers do not collapse these blanks
_CHARACTER = 7.25  # width of a character in the font below, in pixels
_LINE = 16
_MARGIN = 14
_SCREEN = 79, 23  # columns and rows of a terminal of 80 by 24 without its line of keys
_LEFT, _TOP = 16, 128  # position of the terminal, in pixels
_CURVE = 300, 120
_SECONDS = 30.0  # length of the curves
_COLOURS = {Style.PLAIN: '#cad3f5', Style.TITLE: '#ffffff', Style.GOOD: '#a6da95',
            Style.WARNING: '#eed49f', Style.BAD: '#ed8796'}

# Commands to the simulator (s after its start), and the time of the picture.
STORY = ('22 silent 1', '28 normal 1')
SHOT = 40.0


class Point(NamedTuple):
    """A value and the clock value (s) at which it was fresh."""

    time: float
    value: float


@dataclass(slots=True)
class Curve:
    """The values of a topic over time, with the title of its curve."""

    topic: str
    title: str
    pieces: list[list[Point]] = field(default_factory=list)
    _is_interrupted: bool = True

    def take(self, snapshot: NodeView, now: float) -> None:
        """Add the first value of the topic if it is fresh; begin a new piece after a pause."""
        for reading in snapshot.readings:
            if reading.topic != self.topic or reading.values is None:
                continue
            if reading.is_stale(now):
                self._is_interrupted = True
                continue
            if self._is_interrupted:
                self.pieces.append([])
            self._is_interrupted = False
            self.pieces[-1].append(Point(now, float(reading.values[0])))


def picture(lines: Sequence[TextLine], stations: Sequence[str], curves: Sequence[Curve],
            now: float) -> str:
    """Return an SVG of the line with its stations, the monitor, and curves up to ``now`` (s)."""
    columns, rows = _SCREEN
    wide = round(columns * _CHARACTER + 2 * _MARGIN)
    right = _LEFT + wide + 24
    width, height = right + _CURVE[0] + 20, _TOP + rows * _LINE + 2 * _MARGIN + 16
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
             f'width="{width}" height="{height}" font-family="DejaVu Sans, sans-serif" '
             'font-size="13">',
             '<title>Simulated PLCs, the monitor of the bridge, and curves of two topics</title>',
             f'<rect width="{width}" height="{height}" rx="8" fill="#f6f7fa"/>']
    parts += _line(stations, width)
    parts += _terminal(lines[:rows], wide, rows * _LINE + 2 * _MARGIN)
    for number, curve in enumerate(curves):
        parts += _graph(curve, right, _TOP + 24 + number * (_CURVE[1] + 72), now)
    return '\n'.join([*parts, '</svg>', ''])


def _box(x: float, y: float, wide: float, texts: Sequence[str], colour: str) -> Iterator[str]:
    yield (f'<rect x="{x:.0f}" y="{y}" width="{wide:.0f}" height="44" rx="5" fill="{colour}"/>')
    for row, text in enumerate(texts):
        yield (f'<text x="{x + wide / 2:.0f}" y="{y + 18 + 17 * row}" fill="#fff" '
               f'text-anchor="middle">{escape(text)}</text>')


def _line(stations: Sequence[str], width: int) -> Iterator[str]:
    """Yield the wire with the PLCs at one end, and the bridge and ROS at the far end."""
    wide, bus = 190, 92
    bridge = width - 2 * wide - 60
    yield (f'<path d="M{_LEFT} {bus}H{bridge + 95}V66" fill="none" stroke="#39424e" '
           'stroke-width="3"/>')
    for number, text in enumerate(stations):
        x = _LEFT + number * (wide + 20)
        yield (f'<path d="M{x + wide / 2:.0f} 66V{bus}" stroke="#39424e" stroke-width="3"/>')
        yield from _box(x, 22, wide, (f'station {text.partition(": ")[0]}',
                                      text.partition(': ')[2]), '#5a6572')
    yield (f'<text x="{_LEFT + len(stations) * (wide + 20):.0f}" y="{bus - 8}" fill="#39424e">'
           'one serial line, DF1</text>')
    yield from _box(bridge, 22, wide, ('bridge', 'net.csv, map.csv'), '#2f6db5')
    yield (f'<path d="M{bridge + wide} 44h40" stroke="#2e8b57" stroke-width="3"/>')
    yield from _box(bridge + wide + 40, 22, wide, ('ROS 2', 'a topic for each row'), '#2e8b57')


def _terminal(lines: Sequence[TextLine], wide: int, high: int) -> Iterator[str]:
    yield f'<rect x="{_LEFT}" y="{_TOP}" width="{wide}" height="{high}" rx="6" fill="#1e2030"/>'
    yield ('<g font-family="DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="12">')
    for number, line in enumerate(lines):
        if line.text:
            yield (f'<text x="{_LEFT + _MARGIN}" y="{_TOP + _MARGIN + (number + 1) * _LINE - 4}" '
                   f'fill="{_COLOURS[line.style]}">{escape(line.text.replace(" ", _BLANK))}'
                   '</text>')
    yield '</g>'


def _graph(curve: Curve, left: int, top: int, now: float) -> Iterator[str]:
    """Yield a curve with its range; between its pieces no value was fresh."""
    wide, high = _CURVE
    shown = [[point for point in piece if now - point.time <= _SECONDS]
             for piece in curve.pieces]
    pieces = [piece for piece in shown if piece]
    values = [point.value for piece in pieces for point in piece] or [0.0]
    low, high_value = min(values), max(values)
    span = (high_value - low) or 1.0
    yield (f'<text x="{left}" y="{top - 8}" fill="#1b1f24">{escape(curve.title)}</text>'
           f'<rect x="{left}" y="{top}" width="{wide}" height="{high}" fill="#fff" '
           'stroke="#c5ccd5"/>')

    def x(time: float) -> float:
        return left + wide - (now - time) / _SECONDS * wide

    for part in pieces:
        places = ' '.join(
            f'{x(time):.1f},{top + high - 8 - (value - low) / span * (high - 16):.1f}'
            for time, value in part)
        yield f'<polyline points="{places}" fill="none" stroke="#2f6db5" stroke-width="2"/>'
    for before, after in pairwise(pieces):
        yield (f'<text x="{(x(before[-1].time) + x(after[0].time)) / 2:.0f}" '
               f'y="{top + high - 14}" fill="#b3261e" font-size="11" text-anchor="middle">'
               'silent</text>')
    yield (f'<text x="{left + 4}" y="{top + 15}" fill="#5a6572" font-size="11">{high_value:g}'
           f'</text><text x="{left + 4}" y="{top + high - 5}" fill="#5a6572" font-size="11">'
           f'{low:g}</text>'
           f'<text x="{left}" y="{top + high + 15}" fill="#5a6572" font-size="11">'
           f'{_SECONDS:g} s ago</text><text x="{left + wide}" y="{top + high + 15}" '
           'fill="#5a6572" font-size="11" text-anchor="end">now</text>')


def stations_of(snapshot: NodeView) -> list[str]:
    """Return the number and the processor of each station."""
    return [f'{status.section.removeprefix("station ")}: '
            f'{status.values.get("processor", "").partition(" series")[0]}'
            for status in snapshot.statuses if status.section.startswith('station ')]


@contextmanager
def _running(*command: str) -> Iterator[None]:
    """Run a command of the package until the end of the block."""
    process = subprocess.Popen([sys.executable, '-m', 'abdf1_ros', *command], cwd=_ROOT,
                               stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.terminate()
        process.wait(30)


def watch(seconds: float, story: Sequence[str]) -> str:
    """Return the picture ``seconds`` after the start of a story of the simulator."""
    from abdf1_ros.cli.monitor.node import NodeWatch
    curves = [Curve('line_speed', '/abdf1/read/line_speed.data[0]'),
              Curve('part_counter', '/abdf1/read/part_counter.data[0]')]
    with tempfile.TemporaryDirectory() as folder:
        line, net = f'{folder}/line', Path(folder, 'net.csv')
        text = (_ROOT / _NET).read_text(encoding='utf-8')
        net.write_text(text.replace(',1,19200,', f',{line},19200,'), encoding='utf-8')
        commands = [word for command in story for word in ('--at', command)]
        with _running('simulator', '--pty', line, *commands), _running(
                'node', '--ros-args', '-p', f'net_file:={net}', '-p',
                f'map_file:={_ROOT / _MAP}'), NodeWatch('/abdf1', ['picture']) as node:
            end = time.monotonic() + seconds
            while (now := time.monotonic()) < end:
                node.wait(lambda: False, 0.2)
                for curve in curves:
                    curve.take(node.snapshot(), now)
            snapshot, now = node.snapshot(), time.monotonic()
    return picture(render(snapshot, now, _SCREEN[0]), stations_of(snapshot), curves, now)


def main(args: Sequence[str] | None = None) -> int:
    """Write the picture; return 0."""
    parser = argparse.ArgumentParser(prog='picture', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('file', type=Path, help='SVG to write')
    options = parser.parse_args(args)
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    domain, claim = claim_domain()
    os.environ.setdefault('ROS_DOMAIN_ID', str(domain))
    with claim:
        options.file.write_text(watch(SHOT, STORY), encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
