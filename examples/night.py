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
Log all rows of a map into SQLite, every second, until Ctrl-C, SIGTERM or --seconds. Without ROS.

The table ``readings`` has time (s since 1970), tag, value and error. A list is JSON. NaN and
infinity are the texts nan, inf and -inf. A row without value is the beginning of a gap, and
``error`` its reason; the gap ends with the next value of the tag. A PLC that is silent or an
adapter that is unplugged costs only its own values.

Exit status: 0 at the end, 1 if the database cannot be written, 2 if files or port are wrong.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import closing
import json
import math
import signal
import sqlite3
import sys
import time

from abdf1_ros import Client, Reading
from abdf1_ros.problems import ConfigurationError, Problem

_TABLE = 'CREATE TABLE IF NOT EXISTS readings (time REAL, tag TEXT, value, error TEXT)'

_ENDS = {signal.SIGINT, signal.SIGTERM}

_EXAMPLES = """\
examples:
  night.py net.csv map.csv night.db
  sqlite3 night.db "SELECT datetime(time, 'unixepoch'), * FROM readings WHERE error IS NOT NULL"
"""


def stored(value: object) -> object:
    """Return what SQLite and JSON can hold of a value."""
    if isinstance(value, list):
        return json.dumps([stored(each) for each in value])
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def rows_of(readings: dict[str, Reading],
            gaps: dict[str, str]) -> Iterator[tuple[float, str, object, str | None]]:
    """Yield the rows of one round; ``gaps`` has the reason of each tag without a value."""
    for tag, reading in readings.items():
        if reading.error is None:
            gaps.pop(tag, None)
            yield reading.time, tag, stored(reading.value), None
        elif gaps.get(tag) != str(reading.error):
            gaps[tag] = str(reading.error)
            yield reading.time, tag, None, gaps[tag]


def log(options: argparse.Namespace) -> None:
    """Log until the end; raises ConfigurationError, OSError, or sqlite3.Error."""
    gaps: dict[str, str] = {}
    with closing(sqlite3.connect(options.database)) as base, \
            Client.from_files(options.net_file, options.map_file) as plant:
        if not plant.tags:
            raise ConfigurationError([Problem(options.map_file, 'no row reads: nothing to log')])
        base.execute('PRAGMA journal_mode = WAL')  # others may read meanwhile
        base.execute(_TABLE)
        due = time.monotonic()
        end, is_over = due + options.seconds, False
        while not is_over:
            readings = plant.read(plant.tags, partial=True)
            with base:  # one transaction
                base.executemany('INSERT INTO readings VALUES (?, ?, ?, ?)',
                                 rows_of(readings, gaps))
            # A round that took too long leaves out the next ones, and makes up for none.
            due = max(due + options.every, time.monotonic())
            wait = min(due, end) - time.monotonic()
            is_over = signal.sigtimedwait(_ENDS, max(0.0, wait)) is not None \
                or time.monotonic() >= end


def seconds(text: str) -> float:
    """Return a time above 0 s."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f'"{text}" should be a number of seconds above 0')
    return value


def main() -> int:
    """Log as the arguments say; return the exit status."""
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('net_file', help='net CSV of the line')
    parser.add_argument('map_file', help='map CSV; its Read and ReadWrite rows are logged')
    parser.add_argument('database', help='file of SQLite; it is continued if it exists')
    parser.add_argument('--every', type=seconds, default=1.0, metavar='S',
                        help='seconds from round to round (default: %(default)g)')
    parser.add_argument('--seconds', type=seconds, default=math.inf, help='end after this time')
    options = parser.parse_args()
    signal.pthread_sigmask(signal.SIG_BLOCK, _ENDS)  # they wait for the end of a round
    try:
        log(options)
    except (ConfigurationError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    except sqlite3.Error as error:
        print(f'{options.database}: {error}', file=sys.stderr)
        return 1
    return 0


if __name__ == '__main__':
    sys.exit(main())
