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
Show values live until Ctrl-C.

  plc watch B3:0 N7:0 --period 0.5 --net net.csv
  plc watch I:1.0 --radix bin --net net.csv
  plc watch --map map.csv --net net.csv
  plc watch F8:0 --csv --net net.csv > curve.csv
"""

from __future__ import annotations

import argparse
from functools import partial

from abdf1_ros.cli.plc.asking import ask, mappings_of
from abdf1_ros.cli.plc.inquiry import concluded
from abdf1_ros.cli.plc.log import log_values
from abdf1_ros.cli.plc.log_file import FORMS, LogOutput
from abdf1_ros.cli.plc.options import add_addresses, add_repetition, RADIXES
from abdf1_ros.cli.plc.session import Session
from abdf1_ros.cli.plc.targets import Targets, to_read
from abdf1_ros.cli.plc.watch import LiveValues
from abdf1_ros.problems import ConfigurationError, Problem


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_addresses(parser)
    add_repetition(parser)
    parser.add_argument('--csv', action='store_true',
                        help='print each read as "plc log" does')


def run(options: argparse.Namespace) -> int:
    """Read the addresses again and again, and show their values."""
    targets = to_read(options)
    if options.csv and options.radix != 'dec':
        raise ConfigurationError([Problem('--radix', 'is for a table; --csv has decimal numbers')])
    if options.csv:
        return log_values(options, targets, LogOutput(FORMS['csv']))
    return ask(options, partial(_watch, targets=targets), targets)


def _watch(options: argparse.Namespace, session: Session, targets: Targets) -> int:
    mappings = mappings_of(options, session, targets)
    session.close()  # the driver opens the port itself
    watch = LiveValues(session.network, mappings, options.period, RADIXES[options.radix],
                       targets.tags, options.record)
    return concluded(watch, watch.run(options.count))
