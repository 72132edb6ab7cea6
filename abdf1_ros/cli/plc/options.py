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

"""The options that verbs of ``plc`` share, and the options of the line."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from enum import Enum
import os

from abdf1_ros.cli.plc.data import Radix
from abdf1_ros.cli.plc.line import DEFAULTS, MODES
from abdf1_ros.cli.terminal import number_option
from abdf1_ros.numbers import whole_number
from abdf1_ros.paths import expanded
from abdf1_ros.pccc.access import Access
from abdf1_ros.pccc.families import FAMILIES
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.pccc.spellings import family_advice, family_name, processor_name, type_name
from abdf1_ros.pccc.values import ValueType, WordOrder
from abdf1_ros.settings import BAUD_RATES
from abdf1_ros.settings.station_lists import parse_stations

DEFAULT_STATION = 1
COUNT = number_option('a whole number from 1', 1, parse=whole_number)


@dataclass(frozen=True, slots=True)
class LineDefaults:
    """The defaults of a command about its line, in words for --help."""

    baud: str = str(DEFAULTS.baud)
    check: str = DEFAULTS.error_code
    duplex: str = 'half'
    timeout: str = str(DEFAULTS.timeout)
    net: str = 'the line'


_FAMILY_NAMES = [kind.value for kind in FAMILIES]
RADIXES = {'dec': Radix.DECIMAL, 'hex': Radix.HEXADECIMAL, 'oct': Radix.OCTAL, 'bin': Radix.BINARY}

_TRIED = 'tries all'
DETECT_DEFAULTS = LineDefaults(
    baud=f'{_TRIED}; none for a URL', check=_TRIED, duplex=_TRIED,
    timeout='200',  # most attempts get no answer
    net='port, parity, bits and own station')


def add_station(parser: argparse.ArgumentParser) -> None:
    """Add the options of the line, and an argument for the station."""
    add_line(parser)
    parser.add_argument('station', metavar='STATION', nargs='?', type=_station,
                        help=f'station of the PLC (default: {DEFAULT_STATION})')


def add_plc_type(parser: argparse._ActionsContainer,
                 text: str = 'family of the PLC (default: the PLC is asked)',
                 default: str | None = None) -> None:
    """Add the option for the family of the PLC."""
    parser.add_argument('--plc-type', type=_family, default=default,
                        metavar=f'{{{",".join(_FAMILY_NAMES)}}}', help=text)


def add_folder(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the option for the folder of new files."""
    parser.add_argument('--into', metavar='FOLDER', type=expanded, default='.',
                        help=f'the folder for {what} (default: the current folder)')


def add_stations_to_try(parser: argparse.ArgumentParser) -> None:
    """Add the option for the stations to try settings with."""
    parser.add_argument('--stations', metavar='LIST', type=stations_option,
                        default=tuple(range(8)),
                        help='half duplex: stations to look for (default: 0-7)')


def add_line(parser: argparse.ArgumentParser) -> None:
    """Add the options of the line, and of a gateway; without ``add_plc_type`` no type is given."""
    parser.set_defaults(plc_type=None)
    add_line_options(parser, LineDefaults())
    parser.add_argument('--via', metavar='N', type=_station, default=None,
                        help='half duplex: station of the gateway, if the PLC is behind a gateway')


def add_line_options(parser: argparse.ArgumentParser, defaults: LineDefaults,
                     has_link: bool = True) -> None:
    """Add the options of the line; ``has_link`` False leaves out duplex and --timeout."""
    group = parser.add_argument_group('line')
    group.add_argument('--port', metavar='NAME', type=_port,
                       help='serial port, or URL such as socket://192.168.0.9:4001')
    group.add_argument('--net', metavar='FILE', type=expanded,
                       help=f'take {defaults.net} from this net CSV; options override the file')
    group.add_argument('--baud', help=f'baud rate: {", ".join(map(str, BAUD_RATES))} '
                                      f'(default: {defaults.baud})')
    group.add_argument('--check', type=str.upper,
                       help=f'check of messages: CRC or BCC (default: {defaults.check})')
    group.add_argument('--parity', help='None, Even or Odd (default: None)')
    group.add_argument('--data-bits', metavar='N', help='5 to 8 (default: 8, as DF1 needs)')
    group.add_argument('--stop-bits', metavar='N', help='1 or 2 (default: 1)')
    if has_link:
        _add_duplex(group, defaults)
    group.add_argument('--own-station', metavar='N',
                       help=f'our own station, which no PLC may have (default: '
                            f'{DEFAULTS.station})')
    if has_link:
        group.add_argument('--timeout', metavar='MS',
                           help=f'time to wait for each answer (default: {defaults.timeout})')


def _port(text: str) -> str:
    """Return the name of a port; ./line and ../line are paths of this folder."""
    return os.path.abspath(text) if text.startswith(('./', '../')) else expanded(text)


def _add_duplex(group: argparse._ArgumentGroup, defaults: LineDefaults) -> None:
    either = group.add_mutually_exclusive_group()
    either.add_argument('--duplex', type=str.lower, choices=tuple(MODES),
                        help='half: several stations on a line; full: one PLC; radio: DF1 radio '
                             'modem; slave: another master polls us '
                             f'(default: {defaults.duplex})')
    for name, duplex, note in (('--peer', 'full', ''), ('--radio', 'radio', ''),
                               ('--slave', 'slave', '; the master must poll our --own-station')):
        either.add_argument(name, action='store_const', const=duplex, dest='duplex',
                            help=f'the same as --duplex {duplex}{note}')


def add_data_options(parser: argparse.ArgumentParser,
                     note: str = f'(default: {DEFAULT_STATION})') -> None:
    """Add the options of line and data; ``note`` says the default of --station."""
    add_line(parser)
    group = parser.add_argument_group('data')
    group.add_argument('--station', metavar='N', type=_station, help=f'station of the PLC {note}')
    add_plc_type(group)
    group.add_argument('--type', type=type_name, choices=[kind.value for kind in ValueType],
                       help='type of the values (default: the natural type of the file)')
    _add_choice(group, '--word-order', WordOrder, '32-bit values: the word that comes first')
    group.add_argument('--processor', type=processor_name,
                       choices=[member.value for member in Processor], help=(
                           'processor of an SLC or MicroLogix (default: the PLC is asked)'))
    _add_choice(group, '--access', Access,
                'commands that reach the words, if a family has several ways')


def _add_choice(group: argparse._ArgumentGroup, name: str, kind: type[Enum],
                text: str) -> None:
    """Add an option for a value of an enumeration, in any letter case as in a map file."""
    values = {member.value.lower(): member.value for member in kind}
    group.add_argument(name, type=lambda word: values.get(word.lower(), word),
                       choices=[*values.values()], help=text)


def add_addresses(parser: argparse.ArgumentParser, has_radix: bool = True) -> None:
    """Add addresses to read, and the options of line and data."""
    add_data_options(parser)
    parser.add_argument('addresses', metavar='ADDRESS', nargs='*',
                        help='PLC address such as N7:0, N7:0-9, B3:0/5, B3:0/0-7, T4:0.ACC, '
                             'ST9:1; with --map: also a tag, with scaled values; no ADDRESS: all '
                             'rows that are read')
    parser.add_argument('--length', metavar='N',
                        help='elements of each address (default: 1, or the size of the range)')
    parser.add_argument('--map', metavar='FILE', type=expanded,
                        help='a map CSV; its tags are shown beside the addresses')
    parser.add_argument('--record', metavar='FILE', type=expanded,
                        help='record all bytes of the line in a capture file, for "sniff"')
    if has_radix:
        parser.add_argument('--radix', type=str.lower, choices=tuple(RADIXES), default='dec',
                            help='number base of whole numbers (default: %(default)s)')


def add_repetition(parser: argparse.ArgumentParser) -> None:
    """Add the options of reads that are repeated."""
    parser.add_argument('--period', default=0.5, metavar='S',
                        type=number_option('seconds from 0 to 60; 0.5 is 500 ms', 0, 60),
                        help='s between reads of addresses and of rows without Period, up to 60 '
                             '(default: %(default)s)')
    parser.add_argument('--count', type=COUNT, metavar='N',
                        help='end when each address has been read N times; a failed read counts')


def stations_option(text: str, right: str = '') -> tuple[int, ...]:
    """Return the numbers of a list such as 1,5-9; ``right`` describes a good list."""
    stations, faults = parse_stations(text)
    if faults or not stations:
        raise argparse.ArgumentTypeError(right or '; '.join(faults) or 'give a station')
    return stations


def _family(text: str) -> str:
    name = family_name(text)
    if name not in _FAMILY_NAMES:
        raise argparse.ArgumentTypeError(
            f'"{text}" should be one of {", ".join(_FAMILY_NAMES)}; {family_advice(text)}')
    return name


def _station(text: str) -> int:
    right = f'"{text}" should be one station, a number from 0 to 254'
    stations = stations_option(text, right)
    if len(stations) != 1:
        raise argparse.ArgumentTypeError(right)
    return stations[0]
