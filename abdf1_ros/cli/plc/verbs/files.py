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
List the data files of a PLC and their lengths.

  plc files 1 --net net.csv
  plc files 1 --map --net net.csv
  plc files 1 --map map.csv --net net.csv
"""

from __future__ import annotations

import argparse
from functools import partial

from abdf1_ros.cli.plc import files
from abdf1_ros.cli.plc.asking import ask, family_of
from abdf1_ros.cli.plc.options import add_plc_type, add_station, stations_option
from abdf1_ros.cli.plc.session import complain, Session
from abdf1_ros.cli.plc.targets import check_via, routes_of, rows_of_map, Targets
from abdf1_ros.cli.terminal import EXIT_FAILED, Progress
from abdf1_ros.paths import expanded
from abdf1_ros.pccc.file_search import DataFile
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.settings.rows import Rows


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments."""
    add_station(parser)
    parser.add_argument('--files', metavar='LIST', type=_numbers,
                        help='file numbers up to 254 (default: the list of the PLC, or 0-31; with '
                             '--map FILE the files of its rows)')
    add_plc_type(parser)
    parser.add_argument('--map', metavar='FILE', type=expanded, nargs='?', const='',
                        help='print rows for a new map CSV; with FILE, check that map CSV against '
                             "the PLC's files")


def run(options: argparse.Namespace) -> int:
    """Ask the station for its files; print them, rows for them, or faults of a map."""
    mappings = rows_of_map(options.map)
    routes = routes_of(mappings)
    check_via(options, routes)
    return ask(options, partial(_files, mappings=mappings), Targets([], {}, routes=routes))


def _files(options: argparse.Namespace, session: Session, mappings: Rows) -> int:
    numbers, rows = options.files, files.in_files(mappings, options.station)
    if options.map and not rows:
        raise ConfigurationError([Problem(
            options.map, f'has no row of a file of station {options.station}')])
    family, processor = family_of(options, session)
    if options.map:  # only these files are looked for, and only their rows are judged
        rows = [row for row in rows if numbers is None or row.address.file in numbers]
        numbers = sorted({row.address.file for row in rows})
    progress = Progress()
    found = []
    for entry in files.find_files(session, options.station, family, processor, numbers,
                                  progress.show, complain):
        found.append(entry)
        if options.map is None:
            progress.clear()
            print(f'{str(entry):6} {_extent(entry)}', flush=True)
    progress.clear()
    if not found and not options.map:
        complain(f'station {options.station}: no file was found: the PLC refuses to read each')
    if options.map:
        faults = [*files.outside(found, rows)]
        which = '' if options.files is None else ' in these files'
        print('\n'.join(map(str, faults))
              or f'all rows of station {options.station}{which} lie inside')
        return EXIT_FAILED if faults else 0
    if options.map is not None:
        print('Tag,Command,Address,Station,PLC_Type,Processor,Length,Period'
              + ('' if options.via is None else ',Via'))
        for row in files.map_rows(found, options.station, family, processor, options.via):
            print(row)
    return 0 if found else EXIT_FAILED


def _extent(entry: DataFile) -> str:
    if entry.type.is_io:
        return f'{entry.elements:4} words' if entry.elements else '     by rack or slot'
    return f'{entry.elements:4} elements'


def _numbers(text: str) -> tuple[int, ...]:
    return stations_option(
        text, f'"{text}" should be numbers of files from 0 to 254, as in 7,9-12')
