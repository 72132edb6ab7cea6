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
Make map.csv from tags of RSLogix, KEPServer, RSView, InTouch, Ignition or a list.

  plc import plant.csv --station 2 --plc-type SLC
  plc import plant.csv --station 1-4 --read-only --period 1000
"""

from __future__ import annotations

import argparse
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
import shlex

from abdf1_ros.cli.plc import init
from abdf1_ros.cli.plc.exports.form import Wanted
from abdf1_ros.cli.plc.exports.imported import import_map
from abdf1_ros.cli.plc.options import add_folder, add_plc_type, DEFAULT_STATION, stations_option
from abdf1_ros.cli.plc.session import complain
from abdf1_ros.cli.terminal import EXIT_FAILED, EXIT_USAGE, number_option
from abdf1_ros.df1.stations import MAX_STATION
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.numbers import whole_number
from abdf1_ros.paths import called, expanded
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.plan.report import make_report
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.settings.columns import MAX_PERIOD
from abdf1_ros.settings.map_file import load_mappings
from abdf1_ros.settings.network import load_network
from abdf1_ros.text import counted, shown

# Roles of the columns of a list.
_COLUMN_ROLES = {
    'tag': 'the column with the names', 'address': 'the column with the addresses',
    'type': 'the column with the types of the data', 'description': 'the column with descriptions',
    'access': 'the column with the access: RO, R/W; or yes and no under "Read Only"'}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    parser.add_argument('file', metavar='FILE', type=expanded,
                        help='the export or list: CSV; Ignition: JSON')
    add_folder(parser, 'map.csv')
    parser.add_argument('--station', metavar='LIST', type=stations_option, dest='stations',
                        default=(),
                        help='station of the PLC; or stations of several PLCs with the same '
                             f'program, such as 1-4 (default: {DEFAULT_STATION}, or the numbers '
                             'in a column Station of the file)')
    parser.add_argument('--read-only', action='store_true', help='make all rows Read rows')
    for role, text in _COLUMN_ROLES.items():
        parser.add_argument(f'--{role}', metavar='COLUMN', dest=f'{role}_column',
                            help=f'for a list: {text}')
    parser.add_argument('--plc', metavar='NAME',
                        help='name of the PLC, for a file with several PLCs')
    parser.add_argument('--station-of', metavar='NAME=N,...', type=_stations_by_name, default={},
                        help='stations of several PLCs, by the names that the file has for them')
    parser.add_argument('--ignore', metavar='COLUMN', action='append', default=[],
                        help='for a list: a column that says nothing about the words in the PLC; '
                             'may be given several times')
    parser.add_argument('--status', action='store_true',
                        help='also make rows for words of the status file without a symbol')
    parser.add_argument('--period', metavar='MS', default=0,
                        type=number_option(f'a whole number of ms up to {MAX_PERIOD}', 0,
                                           MAX_PERIOD, whole_number),
                        help='the shortest Period of a row (default: the Period of the export)')
    add_plc_type(parser, 'family of the PLC; a MicroLogix is SLC (default: %(default)s)', 'SLC')


def _stations_by_name(text: str) -> dict[str, int]:
    """Return the stations of NAME=N,NAME=N."""
    found: dict[str, int] = {}
    for part in text.split(','):
        name, _, number = (piece.strip() for piece in part.rpartition('='))
        station = whole_number(number)
        if not name or name in found or station is None or not 0 <= station <= MAX_STATION:
            raise argparse.ArgumentTypeError(
                f'"{shown(part)}" should be NAME=N, each name once, with a station from 0 to '
                f'{MAX_STATION}')
        found[name] = station
    return found


def _other_families(path: str, wanted: Wanted) -> str:
    """Return the families that can use all rows of a file, empty for none or an unclear file."""
    counts: dict[str, int] = {}
    for kind in FAMILIES:
        with suppress(ConfigurationError):
            found = import_map(path, replace(wanted, plc_type=kind))
            if found.count and not found.left_out and not found.notes:
                counts[kind.value] = found.count
    return f'--plc-type {" or ".join(counts)} can use {counted(max(counts.values()), "row")}' \
        if counts else ''


def run(options: argparse.Namespace) -> int:
    """Make map.csv of an export; print the rows that are left out."""
    if options.station_of and (options.stations or options.plc is not None):
        complain('--station-of gives the station of each PLC: not together with --station or '
                 '--plc')
        return EXIT_USAGE
    wanted = Wanted(
        PlcType(options.plc_type), options.stations, options.read_only, options.period,
        {role: name for role in _COLUMN_ROLES if (name := getattr(options, f'{role}_column'))},
        options.plc, options.status, options.station_of, options.ignore)
    result = import_map(options.file, wanted)
    for note in result.notes:
        complain(f'{options.file}: {note}')
    for problem in result.left_out:
        complain(str(problem))
    for text, count in (+result.ignored).items():
        print(f'ignored: {count} {text}')
    for text, count in (+result.remarks).items():
        complain(f'{counted(count, "row")}: {text}')
    left_out = f', {len(result.left_out)} left out' if result.left_out else ''
    others = _other_families(options.file, wanted) if result.left_out or not result.count else ''
    if not result.count:
        complain(f'{options.file}: no row can be used{left_out}; nothing was written'
                 f'{others and f"; {others}"}')
        return EXIT_FAILED
    if others:
        complain(f'{options.file}: {others}')
    file = init.NewFiles(Path(options.into), 'map.csv')
    file.write(result.text)
    target, = file.paths
    print(f'written: {target}: {counted(result.count, "row")}{left_out}')
    nets = (target.with_name('net.csv'), Path('net.csv'))
    net = next((path for path in nets if path.exists()), None)
    print(f'next: {called("check")} {shlex.quote(str(net or nets[1]))} '
          f'{shlex.quote(str(target))}')
    if net is None:
        print(f'net.csv is not there yet: {called("plc")} init --into ANOTHER_FOLDER makes one')
        return EXIT_FAILED if result.left_out else 0
    with suppress(ConfigurationError):  # "check" reports the fault
        report = make_report(load_network(str(net)), load_mappings(str(target))[0],
                             DriverSettings().default_period)
        if report.load > 1 and (period := report.needed_period()):
            print(f'these rows need {report.load:.0%} of the time of the line in {net}; '
                  f'--period {period} would be enough')
    return EXIT_FAILED if result.left_out else 0
