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
Run a command and draw what it prints as a picture of a terminal.

From the root, as docs/demo.svg was made::

    python -m tools.picture --lines 32 docs/demo.svg 'make demo' python -m abdf1_ros demo
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
import re
import subprocess
import sys
from xml.sax.saxutils import escape

from abdf1_ros.text import cut

_CHARACTER = 7.25  # width of one in the font below, in pixels
_LINE = 16
_MARGIN = 14
_COLUMNS = 132  # longer lines are cut
_COLOURS = (
    (re.compile(r'^\$ '), '#8bd5ca'),
    (re.compile(r'^node: ERROR |ERROR:'), '#ed8796'),
    (re.compile(r'^node: WARN |WARN:'), '#eed49f'),
    (re.compile(r'^(node|simulator): '), '#939ab7'),
    (re.compile(r'^\S'), '#8aadf4'),
)


def picture(title: str, text: str) -> str:
    """Return an SVG of a terminal with ``text`` on it."""
    lines = [f'$ {title}', *(cut(line, _COLUMNS) for line in text.splitlines())]
    width = round(max(map(len, lines)) * _CHARACTER + 2 * _MARGIN)
    height = len(lines) * _LINE + 2 * _MARGIN
    rows = [
        f'<text x="{_MARGIN}" y="{_MARGIN + (number + 1) * _LINE - 4}" '
        f'fill="{_colour(line)}">{escape(line)}</text>'
        for number, line in enumerate(lines) if line]
    return '\n'.join([
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" '
        f'width="{width}" height="{height}">',
        f'<title>{escape(title)}</title>',
        f'<rect width="{width}" height="{height}" rx="8" fill="#1e2030"/>',
        '<g font-family="DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="12" '
        'xml:space="preserve">', *rows, '</g>', '</svg>', ''])


def _colour(line: str) -> str:
    return next((colour for pattern, colour in _COLOURS if pattern.search(line)), '#cad3f5')


def main(args: Sequence[str] | None = None) -> int:
    """Run the command; write the picture and return 0, or return the command's status."""
    parser = argparse.ArgumentParser(prog='picture', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--lines', type=int, help='show so many lines at most (default: all)')
    parser.add_argument('file', type=Path, help='SVG to write')
    parser.add_argument('title', help='what the first line shows after "$ "')
    parser.add_argument('command', nargs=argparse.REMAINDER, help='what is run')
    options = parser.parse_args(args)
    done = subprocess.run(options.command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          text=True, check=False)
    if done.returncode:
        print(done.stdout, end='')
        return done.returncode
    # Where the repository lies does not matter.
    text = done.stdout.replace(f'{Path.cwd()}/', '')
    shown = text.splitlines()[:options.lines]
    options.file.write_text(picture(options.title, '\n'.join(shown)), encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
