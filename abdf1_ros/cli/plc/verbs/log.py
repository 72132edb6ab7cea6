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
Log values to a file that is continued: each read, and the reason of each gap.

  plc log --map map.csv --net net.csv --to shift.csv
  plc log N7:0-3 B3:0/2 --period 1 --net net.csv --to shift.csv
  plc log --map map.csv --net net.csv --format jsonl | jq .value
"""

from __future__ import annotations

import argparse
from pathlib import Path
import re

from abdf1_ros.cli.plc.log import log_values
from abdf1_ros.cli.plc.log_file import FORMS, LogFile, LogOutput
from abdf1_ros.cli.plc.options import add_addresses, add_repetition
from abdf1_ros.cli.plc.session import complain
from abdf1_ros.cli.plc.targets import to_read
from abdf1_ros.paths import expanded
from abdf1_ros.problems import ConfigurationError, Problem

_FILE = re.compile(r'[^:]+\.(csv|jsonl?|txt|log|influx)', re.IGNORECASE)


_WORKBOOKS = '.xls', '.xlsx', '.xlsm', '.ods'
_ENDINGS = {'.csv': 'csv', '.jsonl': 'jsonl', '.ndjson': 'jsonl', '.json': 'jsonl',
            '.influx': 'influx', '.lp': 'influx'}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_addresses(parser, has_radix=False)
    add_repetition(parser)
    parser.add_argument('--to', metavar='FILE', type=expanded,
                        help='the file, new or of an earlier "plc log" (default, also "-": '
                             'standard output)')
    parser.add_argument('--format', choices=tuple(FORMS), default='csv',
                        help='csv; jsonl: one JSON object a line; influx: line protocol of '
                             'InfluxDB (default: %(default)s)')


def _misnamed(path: str, form: str) -> str:
    """Return what the name of a file has against a form, empty for nothing."""
    ending = Path(path).suffix.lower()
    if ending in _WORKBOOKS:
        return f'is a name of a workbook, and "plc log" writes text: name it {Path(path).stem}.csv'
    meant = _ENDINGS.get(ending, form)
    return f'is a name of another form: give --format {meant}' if meant != form else ''


def run(options: argparse.Namespace) -> int:
    """Log the values of addresses or rows; in Mode Listen those that another master reads."""
    if file := next((word for word in options.addresses if _FILE.fullmatch(word)), None):
        raise ConfigurationError([Problem(file, f'give the file as --to {file}')])
    targets, form = to_read(options), FORMS[options.format]
    if options.to and (fault := _misnamed(options.to, options.format)):
        raise ConfigurationError([Problem('--to', f'{options.to}: {fault}')])
    if options.to in (None, '-'):
        return log_values(options, targets, LogOutput(form), may_listen=True)
    file = LogFile(options.to, form)
    if file.remark:
        complain(file.remark)
    return log_values(options, targets, file, may_listen=True)
