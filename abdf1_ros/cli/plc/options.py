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

"""The options of ``plc``: of its commands, and of the line."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass

from abdf1_ros.cli.plc.data import Radix
from abdf1_ros.cli.plc.line import DEFAULTS, MODES
from abdf1_ros.cli.terminal import number_option
from abdf1_ros.numbers import whole_number
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.spellings import family_name, type_name
from abdf1_ros.pccc.values import ValueType, WordOrder
from abdf1_ros.settings import BAUD_RATES
from abdf1_ros.settings.columns import MAX_PERIOD
from abdf1_ros.settings.station_lists import parse_stations

DEFAULT_STATION = 1
_COUNT = number_option('a whole number from 1', 1, parse=whole_number)


@dataclass(frozen=True, slots=True)
class LineDefaults:
    """The defaults of a command about its line, in words for --help."""

    baud: str = str(DEFAULTS.baud)
    check: str = DEFAULTS.error_code
    duplex: str = 'half'
    timeout: str = str(DEFAULTS.timeout)
    net: str = 'the line'


COLUMN_ROLES = {
    'tag': 'the column with the names', 'address': 'the column with the addresses',
    'type': 'the column with the types of the data', 'description': 'the column with descriptions',
    'access': 'the column with the access: RO, R/W; or yes and no under "Read Only"'}
"""Roles of the columns of a list, for the options of ``plc import``."""

RADIXES = {'dec': Radix.DECIMAL, 'hex': Radix.HEXADECIMAL, 'oct': Radix.OCTAL, 'bin': Radix.BINARY}

_LINE_DEFAULTS = LineDefaults()
_Adder = Callable[[argparse.ArgumentParser], None]
_TRIED = 'tries all'
_DETECT_DEFAULTS = LineDefaults(
    baud=f'{_TRIED}; none for a URL', check=_TRIED, duplex=_TRIED,
    timeout='200',  # most attempts get no answer
    net='port, parity and own station')


def _complete_import(command: argparse.ArgumentParser) -> None:
    command.add_argument('file', metavar='FILE', help='the export or list: CSV; Ignition: JSON')
    _add_folder(command, 'map.csv')
    command.add_argument('--station', metavar='LIST', type=_stations, dest='stations',
                         default=(DEFAULT_STATION,),
                         help='station of the PLC; or stations of several PLCs with the same '
                              f'program, such as 1-4 (default: {DEFAULT_STATION})')
    command.add_argument('--read-only', action='store_true', help='make all rows Read rows')
    for role, text in COLUMN_ROLES.items():
        command.add_argument(f'--{role}', metavar='COLUMN', dest=f'{role}_column',
                             help=f'for a list: {text}')
    command.add_argument('--plc', metavar='NAME',
                         help='name of the PLC, for a file with several PLCs')
    command.add_argument('--status', action='store_true',
                         help='also make rows for words of the status file without a symbol')
    command.add_argument('--period', metavar='MS', default=0,
                         type=number_option(f'a whole number of ms up to {MAX_PERIOD}', 0,
                                            MAX_PERIOD, whole_number),
                         help='the shortest Period of a row (default: the Period of the export)')
    _add_plc_type(command, 'family of the PLC; a MicroLogix is SLC (default: %(default)s)', 'SLC')


def _add_station(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('station', metavar='STATION', nargs='?', type=_station,
                        help=f'station of the PLC (default: {DEFAULT_STATION})')


def _add_plc_type(parser: argparse._ActionsContainer,
                  text: str = 'family of the PLC (default: the PLC is asked)',
                  default: str | None = None) -> None:
    parser.add_argument('--plc-type', type=family_name, choices=[kind.value for kind in FAMILIES],
                        default=default, help=text)


def _add_folder(parser: argparse.ArgumentParser, what: str) -> None:
    parser.add_argument('--into', metavar='FOLDER', default='.',
                        help=f'the folder for {what} (default: the current folder)')


def _complete_ping(ping: argparse.ArgumentParser) -> None:
    _add_station(ping)
    ping.add_argument('--count', type=_COUNT, default=4, metavar='N',
                      help='number of echoes (default: %(default)s)')


def _complete_scan(scan: argparse.ArgumentParser) -> None:
    scan.add_argument('stations', metavar='STATIONS', nargs='?', type=_stations,
                      default=tuple(range(32)),
                      help='stations to ask, such as 1,5 or 0-254 (default: 0-31)')


def _complete_init(begin: argparse.ArgumentParser) -> None:
    _add_folder(begin, 'net.csv and map.csv')
    _complete_search(begin)


def _complete_clock(clock: argparse.ArgumentParser) -> None:
    _add_station(clock)
    _add_plc_type(clock)
    clock.add_argument('--set', action='store_true',
                       help="write this computer's local time into the PLC, after a question on "
                            'the terminal')
    clock.add_argument('--yes', action='store_true', help='set the clock without a question')


def _complete_search(search: argparse.ArgumentParser) -> None:
    search.add_argument('--stations', metavar='LIST', type=_stations, default=tuple(range(8)),
                        help='half duplex: stations to look for (default: 0-7)')
    search.set_defaults(timeout=_DETECT_DEFAULTS.timeout)


def _complete_files(found: argparse.ArgumentParser) -> None:
    _add_station(found)
    found.add_argument('--files', metavar='LIST', type=_numbers,
                       help='file numbers up to 254 (default: the list of the PLC, or 0-31)')
    _add_plc_type(found)
    found.add_argument('--map', metavar='FILE', nargs='?', const='',
                       help="print rows for a new map CSV; with FILE, check that map CSV against "
                            "the PLC's files")


def _complete_write(write: argparse.ArgumentParser) -> None:
    _add_data_options(write, f'(required in half duplex; default in full duplex: '
                             f'{DEFAULT_STATION})')
    write.add_argument('address', metavar='ADDRESS',
                       help='PLC address such as N7:10, B3:0/5, F8:2; with --map: a tag')
    write.add_argument('values', metavar='VALUE', nargs='+',
                       help='numbers, also as 0x or 0b; 0 or 1 for bits; one text for a string')
    write.add_argument('--map', metavar='FILE',
                       help='a map CSV: ADDRESS is then the tag of a row; Scale, Min, Max and '
                            'Station of the row apply')
    write.add_argument('--yes', action='store_true',
                       help='write at once; without --yes: show the present values and ask on the '
                            'terminal')


def _complete_watch(watch: argparse.ArgumentParser) -> None:
    _add_addresses(watch)
    watch.add_argument('--period', default=0.5, metavar='S',
                       type=number_option('seconds from 0 to 60; 0.5 is 500 ms', 0, 60),
                       help='s between reads, up to 60 (default: %(default)s)')
    watch.add_argument('--csv', action='store_true',
                       help='print each value as time,station,address,value')
    watch.add_argument('--count', type=_COUNT, metavar='N', help='end after N reads')


def add_line_options(parser: argparse.ArgumentParser, defaults: LineDefaults,
                     duplex: bool = True) -> None:
    """Add the options of the line; ``duplex`` False leaves the duplex options out."""
    group = parser.add_argument_group('line')
    group.add_argument('--port', metavar='NAME',
                       help='serial port, or URL such as socket://192.168.0.9:4001')
    group.add_argument('--net', metavar='FILE',
                       help=f'take {defaults.net} from this net CSV; options override the file')
    group.add_argument('--baud', help=f'baud rate: {", ".join(map(str, BAUD_RATES))} '
                                      f'(default: {defaults.baud})')
    group.add_argument('--check', type=str.upper,
                       help=f'check of messages: CRC or BCC (default: {defaults.check})')
    group.add_argument('--parity', help='None, Even or Odd (default: None)')
    if duplex:
        _add_duplex(group, defaults)
    group.add_argument('--own-station', metavar='N',
                       help=f'our own station, which no PLC may have (default: '
                            f'{DEFAULTS.station})')
    group.add_argument('--timeout', metavar='MS',
                       help=f'time to wait for each answer (default: {defaults.timeout})')


def _add_duplex(group: argparse._ArgumentGroup, defaults: LineDefaults) -> None:
    either = group.add_mutually_exclusive_group()
    either.add_argument('--duplex', type=str.lower, choices=tuple(MODES),
                        help='half: several stations on a line; full: one PLC; radio: DF1 radio '
                             'modem; slave: another master polls us '
                             f'(default: {defaults.duplex})')
    either.add_argument('--peer', action='store_const', const='full', dest='duplex',
                        help='the same as --duplex full')
    either.add_argument('--radio', action='store_const', const='radio', dest='duplex',
                        help='the same as --duplex radio')
    either.add_argument('--slave', action='store_const', const='slave', dest='duplex',
                        help='the same as --duplex slave; the master must poll our --own-station')


def _add_data_options(parser: argparse.ArgumentParser,
                      note: str = f'(default: {DEFAULT_STATION})') -> None:
    group = parser.add_argument_group('data')
    group.add_argument('--station', metavar='N', type=_station, help=f'station of the PLC {note}')
    _add_plc_type(group)
    group.add_argument('--type', type=type_name, choices=[kind.value for kind in ValueType],
                       help='type of the values (default: the natural type of the file)')
    group.add_argument('--word-order', choices=[order.value for order in WordOrder],
                       help='32-bit values: the word that comes first')
    group.add_argument('--processor', choices=[entry.value for entry in Processor],
                       help='processor of an SLC or MicroLogix (default: the PLC is asked)')
    group.add_argument('--access', choices=[access.value for access in Access],
                       help='commands that reach the words, if a family has several ways')


def _add_addresses(parser: argparse.ArgumentParser) -> None:
    _add_data_options(parser)
    parser.add_argument('addresses', metavar='ADDRESS', nargs='*',
                        help='PLC address such as N7:0, N7:0-9, B3:0/5, B3:0/0-7, T4:0.ACC, '
                             'ST9:1; with --map: also a tag, with scaled values; no ADDRESS: all '
                             'rows that are read')
    parser.add_argument('--length', metavar='N',
                        help='elements of each address (default: 1, or the size of the range)')
    parser.add_argument('--map', metavar='FILE',
                        help='a map CSV; its tags are shown beside the addresses')
    parser.add_argument('--record', metavar='FILE',
                        help='record all bytes of the line in a capture file, for "sniff"')
    parser.add_argument('--radix', type=str.lower, choices=tuple(RADIXES), default='dec',
                        help='number base of whole numbers (default: %(default)s)')


def _stations(text: str, right: str = '') -> tuple[int, ...]:
    stations, faults = parse_stations(text)
    if faults or not stations:
        raise argparse.ArgumentTypeError(right or '; '.join(faults) or 'give a station')
    return stations


def _station(text: str) -> int:
    stations = _stations(text)
    if len(stations) != 1:
        raise argparse.ArgumentTypeError(f'"{text}" should be one station')
    return stations[0]


def _numbers(text: str) -> tuple[int, ...]:
    return _stations(text, f'"{text}" should be numbers of files from 0 to 254, as in 7,9-12')


def _on_line(add: _Adder, defaults: LineDefaults = _LINE_DEFAULTS) -> _Adder:
    """Return a function that adds the options of the line and of ``add``."""
    def complete(parser: argparse.ArgumentParser) -> None:
        add_line_options(parser, defaults)
        if defaults is not _DETECT_DEFAULTS:
            parser.add_argument('--via', metavar='N', type=_station, default=None,
                                help='half duplex: station of the gateway, if the PLC is behind '
                                     'a gateway')
        add(parser)
    return complete


ADDERS: dict[str, _Adder] = {
    'read': _on_line(_add_addresses), 'write': _on_line(_complete_write),
    'watch': _on_line(_complete_watch), 'status': _on_line(_add_station),
    'ping': _on_line(_complete_ping), 'scan': _on_line(_complete_scan),
    'detect': _on_line(_complete_search, _DETECT_DEFAULTS),
    'init': _on_line(_complete_init, _DETECT_DEFAULTS), 'files': _on_line(_complete_files),
    'import': _complete_import, 'clock': _on_line(_complete_clock)}
"""Functions that add the options of a command, by its name."""
