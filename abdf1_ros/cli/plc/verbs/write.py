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
Write values to an address or a tag.

  plc write N7:10 5 6 7 --station 1 --yes --net net.csv
  plc write F8:2 -1.5e3 --station 1 --yes --net net.csv
  plc write line_speed 12.5 --map map.csv --net net.csv
"""

from __future__ import annotations

import argparse
from functools import partial
import re
import sys
from typing import Any

from abdf1_ros.cli.plc import data
from abdf1_ros.cli.plc.asking import after_write, ask, check_type, failed, mappings_of
from abdf1_ros.cli.plc.options import add_data_options, DEFAULT_STATION
from abdf1_ros.cli.plc.session import complain, Session
from abdf1_ros.cli.plc.targets import no_value, Targets, to_write
from abdf1_ros.cli.terminal import colour, EXIT_UNKNOWN, EXIT_USAGE, GREEN, is_wanted
from abdf1_ros.errors import Abdf1Error
from abdf1_ros.paths import expanded

UNREAD_STATUS = EXIT_USAGE
"""Exit status if the output cannot be printed: the write has not begun, so nothing was written."""

_ASSIGNMENT = re.compile(r'[A-Z]{1,3}\d{0,3}:[^=]+=.+', re.ASCII | re.IGNORECASE)


class _AddressAction(argparse.Action):
    """Take an address; N7:10=5 is the first of the ``values`` too."""

    values: argparse.Action

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace,
                 values: Any, option_string: str | None = None) -> None:
        namespace.address = values
        if _ASSIGNMENT.fullmatch(values):
            namespace.address, value = values.split('=', 1)
            namespace.values = [value]
            self.values.required = False


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_data_options(
        parser, f'(required in half duplex; default in full duplex: {DEFAULT_STATION})')
    address = parser.add_argument(
        'address', metavar='ADDRESS', action=_AddressAction,
        help='PLC address such as N7:10, B3:0/5, F8:2; with --map: a tag')
    assert isinstance(address, _AddressAction)
    address.values = parser.add_argument(
        'values', metavar='VALUE', nargs='+', action='extend',
        help='numbers, also as 0x or 0b; 0 or 1 for bits; one text for a string; '
             'N7:10=5 stands for ADDRESS and VALUE')
    parser.add_argument('--map', metavar='FILE', type=expanded,
                        help='a map CSV: ADDRESS is then the tag of a row; Scale, Min, Max and '
                             'Station of the row apply')
    parser.add_argument('--yes', action='store_true',
                        help='write at once; without --yes: show the present values and ask on '
                             'the terminal')


def run(options: argparse.Namespace) -> int:
    """Write the values, after a question on the terminal or with --yes."""
    targets = to_write(options)
    return ask(options, partial(_write, targets=targets), targets, writes=True)


def _write(options: argparse.Namespace, session: Session, targets: Targets) -> int:
    mapping, = mappings_of(options, session, targets)
    with no_value(options.address):
        writing = data.Writing(mapping, options.values)
    for remark in data.remarks_of_write(mapping):
        complain(remark)
    if not options.yes and not _is_confirmed(options, session, writing):
        complain('nothing was written; --yes writes')
        return EXIT_USAGE
    result = writing.carry_out(session)
    if status := data.status_of(result):
        if status != EXIT_UNKNOWN:
            check_type(options, session, mapping.station)
        return status
    with after_write(str(result)):
        print(f'{data.named(mapping)} of station {mapping.station}: '
              f'{colour(str(result), GREEN, sys.stdout)}; now:', flush=True)
        data.print_values(mapping, data.read(session, mapping))
        check_type(options, session, mapping.station)
    return 0


def _is_confirmed(options: argparse.Namespace, session: Session, writing: data.Writing) -> bool:
    """Show the present values; return True if the user confirms the write."""
    mapping = writing.mapping
    try:
        print('now:')
        data.print_values(mapping, data.read(session, mapping))
    except Abdf1Error as error:
        failed(options, session, error, data.named(mapping), mapping)
    return is_wanted(f'write {writing} to {data.named(mapping)} of station {mapping.station}')
