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
Read addresses once.

  plc read N7:0-9 F8:2 --net net.csv
"""

from __future__ import annotations

import argparse
from functools import partial

from abdf1_ros.cli.plc import data
from abdf1_ros.cli.plc.asking import ask, check_type, failed, mappings_of
from abdf1_ros.cli.plc.options import add_addresses, RADIXES
from abdf1_ros.cli.plc.session import complain, Session
from abdf1_ros.cli.plc.targets import Targets, to_read
from abdf1_ros.errors import Abdf1Error


class _Elsewhere(argparse.Action):
    """Name the verb that has an option."""

    def __call__(self, parser: argparse.ArgumentParser, *args: object) -> None:
        parser.error(f'"plc {self.const}" prints values for programs')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_addresses(parser)
    for name, words in (('--csv', 'watch --csv --count 1'),
                        ('--json', 'log --format jsonl --count 1'),
                        ('--format', 'log --format jsonl --count 1')):
        parser.add_argument(name, action=_Elsewhere, const=words, nargs=0, help=argparse.SUPPRESS)


def run(options: argparse.Namespace) -> int:
    """Read the addresses, and print their values."""
    targets = to_read(options)
    return ask(options, partial(_read, targets=targets), targets, record=options.record)


def _read(options: argparse.Namespace, session: Session, targets: Targets) -> int:
    status, is_read = 0, False
    for mapping in mappings_of(options, session, targets):
        for remark in mapping.remarks if mapping.address.file_type.is_structure else ():
            complain(remark.text)
        try:
            values = data.read(session, mapping)
        except Abdf1Error as error:
            status = failed(options, session, error, data.named(mapping), mapping)
        else:
            is_read = True
            data.print_values(mapping, values, RADIXES[options.radix], targets.tags)
    if is_read:  # a PLC may answer commands of another family
        check_type(options, session, options.station)
    return status
