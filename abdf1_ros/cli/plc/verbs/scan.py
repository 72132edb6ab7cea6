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
Look for stations.

  plc scan 0-31 --net net.csv
"""

from __future__ import annotations

import argparse

from abdf1_ros.cli.plc import presence
from abdf1_ros.cli.plc.inquiry import conclude, is_beside_master
from abdf1_ros.cli.plc.line import MODES, network_of
from abdf1_ros.cli.plc.options import add_line, stations_option
from abdf1_ros.cli.plc.session import complain, Session
from abdf1_ros.cli.terminal import EXIT_FAILED, Progress
from abdf1_ros.df1.peer import PEER
from abdf1_ros.df1.stations import MOST_IN_VAIN
from abdf1_ros.diagnosis.causes import diagnose
from abdf1_ros.diagnosis.traces import Traces

_ONE_PLC_ANSWERS_TO_ALL = (
    'in full duplex most PLCs answer to every station number, so these may be one PLC')


_LEFT_OUT = (
    '{} stations were not asked: each command without a reply may cost an SLC with passthru one '
    'of 30 buffers until it is switched off; --all asks them, too')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_line(parser)
    parser.add_argument('stations', metavar='STATIONS', nargs='?', type=stations_option,
                        default=tuple(range(32)),
                        help='stations to ask, such as 1,5 or 0-254 (default: 0-31)')
    parser.add_argument('--all', dest='asks_all', action='store_true', help=(
        f'full duplex: go on after {MOST_IN_VAIN} stations in a row of which only an ACK came'))


def run(options: argparse.Namespace) -> int:
    """Ask the stations, and print those that answer."""
    progress = Progress()
    found = acknowledged = count = 0
    asked = 1
    network = network_of(options)
    ended: list[Session] = []
    for there in presence.scan(
            network, options.stations, options.via, progress.show, ended.append,
            asks_all=options.asks_all, is_beside_master=is_beside_master):
        count += 1
        if there.is_there:
            if not found:
                print('station    answer  processor')
            found += 1
            progress.clear()
            print(f'{there.station:7}  {there.seconds * 1000:5.0f} ms  {there}'
                  f'{presence.again(there.asked)}', flush=True)
        elif there.other_number is not None:  # which is so for all stations
            progress.clear()
            complain(str(diagnose(Traces(PEER, other_number=there.other_number))))
            return EXIT_FAILED
        else:
            acknowledged += there.is_only_acknowledged
            asked = max(asked, there.asked)
    progress.clear()
    if not count:  # beside another master
        return EXIT_FAILED
    print(presence.tally(found, count, asked, acknowledged))
    if count < len(options.stations):
        print(_LEFT_OUT.format(len(options.stations) - count))
    if found > 1 and network.mode == MODES['full']:
        print(_ONE_PLC_ANSWERS_TO_ALL)
    for session in ended:
        conclude(session)
    return 0 if found else EXIT_FAILED
