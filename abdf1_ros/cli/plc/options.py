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

"""The options of ``plc``: what it is asked to do, and on which line."""

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
    'access': 'the column that says what may be written: RO, R/W; or yes and no under "Read Only"'}
"""What the columns of a list may be, for the options of ``plc import``."""

# Names that the PLC's own software and its users have for types and families.
RADIXES = {'dec': Radix.DECIMAL, 'hex': Radix.HEXADECIMAL, 'oct': Radix.OCTAL, 'bin': Radix.BINARY}

_LINE_DEFAULTS = LineDefaults()
_Adder = Callable[[argparse.ArgumentParser], None]
_TRIED = 'all are tried'
_DETECT_DEFAULTS = LineDefaults(
    baud=f'{_TRIED}, but none at a URL', check=_TRIED, duplex=_TRIED,
    timeout='200',  # most attempts get no answer
    net='port, parity and own station')


def _complete_import(command: argparse.ArgumentParser) -> None:
    command.add_argument('file', metavar='FILE', help='the export or list: CSV, of Ignition JSON')
    _add_folder(command, 'map.csv is')
    command.add_argument('--station', metavar='LIST', type=_stations, dest='stations',
                         default=(DEFAULT_STATION,),
                         help='of the PLC, or of several with the same program, as in 1-4 '
                              f'(default: {DEFAULT_STATION})')
    command.add_argument('--read-only', action='store_true', help='make all rows Read rows')
    for role, text in COLUMN_ROLES.items():
        command.add_argument(f'--{role}', metavar='COLUMN', dest=f'{role}_column',
                             help=f'of a list: {text}')
    command.add_argument('--plc', metavar='NAME',
                         help='the PLC that is meant, by its name in a file with several')
    command.add_argument('--status', action='store_true',
                         help='also take words of the status file without a symbol')
    command.add_argument('--period', metavar='MS', default=0,
                         type=number_option(f'a whole number of ms up to {MAX_PERIOD}', 0,
                                            MAX_PERIOD, whole_number),
                         help='the shortest Period of a row (default: as the export has it)')
    _add_plc_type(command, 'of the PLC; a MicroLogix is SLC (default: %(default)s)', 'SLC')


def _add_station(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('station', metavar='STATION', nargs='?', type=_station,
                        help=f'default: {DEFAULT_STATION}')


def _add_plc_type(parser: argparse._ActionsContainer,
                  text: str = 'default: the PLC is asked what it is',
                  default: str | None = None) -> None:
    parser.add_argument('--plc-type', type=family_name, choices=[kind.value for kind in FAMILIES],
                        default=default, help=text)


def _add_folder(parser: argparse.ArgumentParser, what: str) -> None:
    parser.add_argument('--into', metavar='FOLDER', default='.',
                        help=f'where {what} to be (default: here)')


def _complete_ping(ping: argparse.ArgumentParser) -> None:
    _add_station(ping)
    ping.add_argument('--count', type=_COUNT, default=4, metavar='N',
                      help='how often (default: %(default)s)')


def _complete_scan(scan: argparse.ArgumentParser) -> None:
    scan.add_argument('stations', metavar='STATIONS', nargs='?', type=_stations,
                      default=tuple(range(32)), help='such as 1,5 or 0-254 (default: 0-31)')


def _complete_init(begin: argparse.ArgumentParser) -> None:
    _add_folder(begin, 'the files are')
    _complete_search(begin)


def _complete_clock(clock: argparse.ArgumentParser) -> None:
    _add_station(clock)
    _add_plc_type(clock)
    clock.add_argument('--set', action='store_true',
                       help="write this computer's local time; a terminal is asked")
    clock.add_argument('--yes', action='store_true', help='set it without a question')


def _complete_search(search: argparse.ArgumentParser) -> None:
    search.add_argument('--stations', metavar='LIST', type=_stations, default=tuple(range(8)),
                        help='who may be there in half duplex (default: 0-7)')
    search.set_defaults(timeout=_DETECT_DEFAULTS.timeout)


def _complete_files(found: argparse.ArgumentParser) -> None:
    _add_station(found)
    found.add_argument('--files', metavar='LIST', type=_numbers,
                       help='numbers up to 254 (default: all that the PLC lists, or 0-31)')
    _add_plc_type(found)
    found.add_argument('--map', metavar='FILE', nargs='?', const='',
                       help='print rows for a map CSV; with FILE, say which of its rows lie '
                            'outside of the files')


def _complete_write(write: argparse.ArgumentParser) -> None:
    _add_data_options(write, f'needed in half duplex (default in full: {DEFAULT_STATION})')
    write.add_argument('address', metavar='ADDRESS',
                       help='such as N7:10, B3:0/5, F8:2; with --map a tag')
    write.add_argument('values', metavar='VALUE', nargs='+',
                       help='numbers, 0x and 0b too; 0 and 1 for bits; one text for a string')
    write.add_argument('--map', metavar='FILE',
                       help='a map CSV: a row is written by its tag, scaled, within Min and Max, '
                            'to the station of the row')
    write.add_argument('--yes', action='store_true',
                       help='do it; without it, what is there now is shown, and a terminal '
                            'is asked')


def _complete_watch(watch: argparse.ArgumentParser) -> None:
    _add_addresses(watch)
    watch.add_argument('--period', default=0.5, metavar='S',
                       type=number_option('seconds from 0 to 60; 0.5 is 500 ms', 0, 60),
                       help='s between reads, up to 60 (default: %(default)s)')
    watch.add_argument('--csv', action='store_true',
                       help='print each value that is read as time,station,address,value')
    watch.add_argument('--count', type=_COUNT, metavar='N', help='end after so many reads')


def add_line_options(parser: argparse.ArgumentParser, defaults: LineDefaults,
                     duplex: bool = True) -> None:
    """Add the options of the line; ``duplex`` is left out where the command knows it."""
    group = parser.add_argument_group('line')
    group.add_argument('--port', metavar='NAME',
                       help='serial port, or URL such as socket://192.168.0.9:4001')
    group.add_argument('--net', metavar='FILE',
                       help=f'take {defaults.net} from this net CSV; other options go before it')
    group.add_argument('--baud', help=f'one of {", ".join(map(str, BAUD_RATES))} '
                                      f'(default: {defaults.baud})')
    group.add_argument('--check', type=str.upper, help=f'CRC or BCC (default: {defaults.check})')
    group.add_argument('--parity', help='None, Even or Odd (default: None)')
    if duplex:
        _add_duplex(group, defaults)
    group.add_argument('--own-station', metavar='N',
                       help=f'our own address, which no PLC has (default: {DEFAULTS.station})')
    group.add_argument('--timeout', metavar='MS',
                       help=f'to wait for each answer (default: {defaults.timeout})')


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
                        help='the same as --duplex slave: --own-station is a number that the '
                             'master polls')


def _add_data_options(parser: argparse.ArgumentParser,
                      note: str = f'(default: {DEFAULT_STATION})') -> None:
    group = parser.add_argument_group('data')
    group.add_argument('--station', metavar='N', type=_station, help=f'address of the PLC {note}')
    _add_plc_type(group)
    group.add_argument('--type', type=type_name, choices=[kind.value for kind in ValueType],
                       help='default: what is natural for the file')
    group.add_argument('--word-order', choices=[order.value for order in WordOrder],
                       help='which word of 32 bits comes first')
    group.add_argument('--processor', choices=[entry.value for entry in Processor],
                       help='of an SLC or MicroLogix (default: the one it says it is)')
    group.add_argument('--access', choices=[access.value for access in Access],
                       help='how the words are reached, where a family has several ways')


def _add_addresses(parser: argparse.ArgumentParser) -> None:
    _add_data_options(parser)
    parser.add_argument('addresses', metavar='ADDRESS', nargs='*',
                        help='such as N7:0, N7:0-9, B3:0/5, B3:0/0-7, T4:0.ACC, ST9:1; with '
                             '--map also a tag, whose values are scaled; none: all rows that read')
    parser.add_argument('--length', metavar='N',
                        help='elements of each address (default: 1, or those of the range)')
    parser.add_argument('--map', metavar='FILE',
                        help='a map CSV, whose tags are shown beside the addresses')
    parser.add_argument('--record', metavar='FILE',
                        help='keep all bytes of the line in a capture, for "sniff"')
    parser.add_argument('--radix', type=str.lower, choices=tuple(RADIXES), default='dec',
                        help='how whole numbers are written (default: %(default)s)')


def _stations(text: str, right: str = '') -> tuple[int, ...]:
    stations, faults = parse_stations(text)
    if faults or not stations:
        raise argparse.ArgumentTypeError(right or '; '.join(faults) or 'name a station')
    return stations


def _station(text: str) -> int:
    stations = _stations(text)
    if len(stations) != 1:
        raise argparse.ArgumentTypeError(f'"{text}" should be one station')
    return stations[0]


def _numbers(text: str) -> tuple[int, ...]:
    return _stations(text, f'"{text}" should be numbers of files from 0 to 254, as in 7,9-12')


def _on_line(add: _Adder, defaults: LineDefaults = _LINE_DEFAULTS) -> _Adder:
    """Return what adds the options of the line, too."""
    def complete(parser: argparse.ArgumentParser) -> None:
        add_line_options(parser, defaults)
        if defaults is not _DETECT_DEFAULTS:
            parser.add_argument('--via', metavar='N', type=_station, default=None,
                                help='in half duplex: the gateway on the line that the station '
                                     'is behind')
        add(parser)
    return complete


ADDERS: dict[str, _Adder] = {
    'read': _on_line(_add_addresses), 'write': _on_line(_complete_write),
    'watch': _on_line(_complete_watch), 'status': _on_line(_add_station),
    'ping': _on_line(_complete_ping), 'scan': _on_line(_complete_scan),
    'detect': _on_line(_complete_search, _DETECT_DEFAULTS),
    'init': _on_line(_complete_init, _DETECT_DEFAULTS), 'files': _on_line(_complete_files),
    'import': _complete_import, 'clock': _on_line(_complete_clock)}
"""What adds the options of each command that has some."""
