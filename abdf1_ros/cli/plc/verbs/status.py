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
Show model, mode and faults of a PLC.

  plc status 1 --net net.csv
"""

from __future__ import annotations

import argparse

from abdf1_ros.cli.plc import presence
from abdf1_ros.cli.plc.asking import ask
from abdf1_ros.cli.plc.options import add_station
from abdf1_ros.cli.plc.session import Session


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_station(parser)


def run(options: argparse.Namespace) -> int:
    """Ask the station for its status, and print it."""
    return ask(options, _status)


def _status(options: argparse.Namespace, session: Session) -> int:
    there = presence.look_at(session, options.station)
    if there.error is not None:
        raise there.error
    print('\n'.join(presence.describe(there)))
    return 0
