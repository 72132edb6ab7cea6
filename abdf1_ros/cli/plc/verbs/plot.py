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
Draw curves of a log: bits as lanes, gaps with their reasons, in one file for a browser.

  plc plot shift.csv --html shift.html
  plc plot shift.csv speed N7:10 --html speed.html
"""

from __future__ import annotations

import argparse
from pathlib import Path

from abdf1_ros.cli.lanes import write_page
from abdf1_ros.cli.plc.log_picture import ValuePicture
from abdf1_ros.cli.plc.log_reader import samples
from abdf1_ros.cli.plc.session import complain
from abdf1_ros.cli.terminal import EXIT_USAGE, page_option, Progress
from abdf1_ros.paths import expanded
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.text import counted, first

_OFTEN = 20_000  # rows


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument('file', metavar='FILE', type=expanded,
                        help='a CSV or JSON lines of "plc log", or a CSV of recorder.py')
    parser.add_argument('names', metavar='NAME', nargs='*', default=[],
                        help='tags and addresses to draw (default: all)')
    parser.add_argument('--html', metavar='OUT', type=page_option, required=True,
                        help='the page, new or of an earlier --html')


def run(options: argparse.Namespace) -> int:
    """Read the file, and write the page."""
    picture, progress = ValuePicture(options.names), Progress()
    try:
        for sample in samples(options.file, complain):
            picture.add(sample)
            if not picture.rows % _OFTEN:
                progress.show(f'{options.file}: {counted(picture.rows, "row")}')
    except Problem as problem:
        raise ConfigurationError([problem]) from None
    finally:
        progress.clear()
    if picture.unknown:
        raise ConfigurationError([Problem(options.file, (
            f'has no {" and no ".join(sorted(picture.unknown))}; it has '
            f'{first(picture.names) or "no values"}'))])
    if not picture.rows:
        raise ConfigurationError([Problem(options.file, 'has no row below its head')])
    if picture.remark:
        complain(f'{options.file}: {picture.remark}')
    try:
        write_page(options.html, Path(options.file).name, picture.parts())
    except OSError as error:
        complain(f'--html: {error.filename or options.html}: {error.strerror}')
        return EXIT_USAGE
    print(f'{options.html}: {counted(picture.rows, "row")}')
    return 0
