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
Measure the time that a PLC needs to return an echo.

  plc ping 1 --count 10 --net net.csv
"""

from __future__ import annotations

import argparse

from abdf1_ros.cli.plc import presence
from abdf1_ros.cli.plc.asking import ask, failed
from abdf1_ros.cli.plc.options import add_station, COUNT
from abdf1_ros.cli.plc.session import Session
from abdf1_ros.cli.terminal import EXIT_FAILED
from abdf1_ros.errors import Abdf1Error


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_station(parser)
    parser.add_argument('--count', type=COUNT, default=4, metavar='N',
                        help='number of echoes (default: %(default)s)')


def run(options: argparse.Namespace) -> int:
    """Send the echoes; print the time of each, and a summary."""
    return ask(options, _ping)


def _ping(options: argparse.Namespace, session: Session) -> int:
    times: list[float] = []
    failures = 0
    try:
        for _ in range(options.count):
            try:
                times.append(presence.ping(session, options.station))
            except Abdf1Error as error:
                failures += 1
                failed(options, session, error)
            else:
                print(f'station {options.station}: {times[-1] * 1000:.1f} ms', flush=True)
    except KeyboardInterrupt:
        session.silent = None  # the user waits no longer; the interrupted echo does not count
    text = f'{failures + len(times)} sent, {len(times)} answered'
    if times:
        text += (f'; shortest {min(times) * 1000:.1f}, mean '
                 f'{sum(times) / len(times) * 1000:.1f}, longest {max(times) * 1000:.1f} ms')
    print(text)
    return 0 if times and not failures else EXIT_FAILED
