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

"""A real browser without a screen: what it makes of a page, and what it shows."""

from __future__ import annotations

from html.parser import HTMLParser
from pathlib import Path
import shutil
import struct
import subprocess
import zlib

import pytest

_NAMES = ('chromium', 'chromium-browser', 'google-chrome', 'chrome')
_PATIENCE = 100  # s

Colour = tuple[int, int, int]


class Elements(HTMLParser):
    """The elements of a page, with their attributes, and the text below each title of SVG."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str]]] = []
        self.texts: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, {name: value or '' for name, value in attrs}))

    def handle_data(self, data: str) -> None:
        self.texts.append(data)

    def tags(self) -> set[str]:
        """Return which elements there are."""
        return {tag for tag, _ in self.found}

    def bars(self, look: str) -> int:
        """Return how many bars of a class there are."""
        return sum(tag == 'rect' and attributes.get('class') == look and 'x' in attributes
                   for tag, attributes in self.found)


def _run(page: Path, folder: Path, *options: str) -> bytes:
    program = next(filter(None, map(shutil.which, _NAMES)), None)
    if program is None:
        pytest.skip('there is no chromium')
    done = subprocess.run(
        [program, '--headless', '--no-sandbox', '--disable-gpu', '--disable-dev-shm-usage',
         f'--user-data-dir={folder / "profile"}', *options, page.as_uri()],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, timeout=_PATIENCE, check=True)
    return done.stdout


def dom(page: Path, folder: Path) -> Elements:
    """Return what a browser has made of a page."""
    return Elements(_run(page, folder, '--dump-dom').decode())


def colours(page: Path, folder: Path, width: int = 1240, height: int = 900) -> set[Colour]:
    """Return the colours that a browser shows of a page."""
    shot = folder / 'shot.png'
    _run(page, folder, '--hide-scrollbars', f'--window-size={width},{height}',
         f'--screenshot={shot}')
    return set(_pixels(shot.read_bytes()))


def _pixels(png: bytes) -> list[Colour]:
    """Return the pixels of a PNG that is not interlaced, with 8 bits each of RGB or RGBA."""
    width, height, depth, kind = struct.unpack('>IIBB', png[16:26])
    assert depth == 8 and kind in (2, 6)
    size, at, packed = (3 if kind == 2 else 4), 8, b''
    while at < len(png):
        length, name = struct.unpack('>I4s', png[at:at + 8])
        packed += png[at + 8:at + 8 + length] if name == b'IDAT' else b''
        at += 12 + length
    data, found = zlib.decompress(packed), []
    above = bytearray(width * size)
    for row in range(height):
        start = row * (width * size + 1)
        line = bytearray(data[start + 1:start + 1 + width * size])
        _unfilter(data[start], line, above, size)
        found += [tuple(line[x:x + 3]) for x in range(0, len(line), size)]
        above = line
    return found  # type: ignore[return-value]


def _unfilter(kind: int, line: bytearray, above: bytearray, size: int) -> None:
    """Undo what a PNG does to each line (PNG 9.2)."""
    for x in range(len(line)):
        left = line[x - size] if x >= size else 0
        up, corner = above[x], above[x - size] if x >= size else 0
        nearest = min((left, up, corner), key=lambda side: abs(left + up - corner - side))
        line[x] = (line[x] + (0, left, up, (left + up) // 2, nearest)[kind]) & 0xFF
