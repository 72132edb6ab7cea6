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

"""The commands of ``plc`` and their help; options are added for the chosen command only."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import difflib
from functools import partial
import re

from abdf1_ros.cli.terminal import command_parser

_ASSIGNMENT = re.compile(r'[A-Z]{1,3}\d{0,3}:[^=]+=.+', re.ASCII | re.IGNORECASE)

_STATUSES = """\
exit status:
  0    done: read, written and confirmed, answered, found
  1    no answer, or the PLC refused it; the port cannot be opened or was lost; rows left out
  2    wrong options, files, addresses or values; a write not confirmed with --yes. Nothing was
       written
  3    a write without a reply, or interrupted: the PLC may have all, a part or nothing of it
  130  interrupted by Ctrl-C; a running watch or ping ends with 0 or 1 instead
"""
_EPILOG = _STATUSES + """
examples:
  plc ports                                   which ports are there?
  plc init                                    find all, and write net.csv and map.csv
  plc detect --port /dev/ttyUSB0              which settings does this line have?
  plc scan 0-31 --net net.csv                 which stations answer?
  plc files 1 --net net.csv                   which data files does it have?
  plc status 1 --port /dev/ttyUSB0 --baud 19200
  plc read N7:0-9 B3:1/0-7 --peer --port /dev/ttyUSB0
  plc write N7:10 5 6 7 --station 1 --yes --net net.csv
  plc write F8:2 -1.5e3 --station 1 --yes --net net.csv
  plc watch B3:0 N7:0 T4:0.ACC --net net.csv
  plc watch --map map.csv --net net.csv

"plc COMMAND --help" explains each command.
"""


# Each command: its purpose, then examples.
_COMMANDS = {
    'read': ('read addresses once', 'read N7:0-9 F8:2 --net net.csv'),
    'write': ('write values to an address or a tag',
              'write N7:10 5 6 7 --station 1 --yes --net net.csv',
              'write F8:2 -1.5e3 --station 1 --yes --net net.csv',
              'write line_speed 12.5 --map map.csv --net net.csv'),
    'watch': ('show values live until Ctrl-C', 'watch B3:0 N7:0 --period 0.5 --net net.csv',
              'watch I:1.0 --radix bin --net net.csv', 'watch --map map.csv --net net.csv',
              'watch F8:0 --csv --net net.csv > curve.csv'),
    'status': ('show model, mode and faults of a PLC', 'status 1 --net net.csv'),
    'ping': ('measure the time that a PLC needs to return an echo',
             'ping 1 --count 10 --net net.csv'),
    'scan': ('look for stations', 'scan 0-31 --net net.csv'),
    'detect': ('find out the settings of a line by trying them',
               'detect --port /dev/ttyUSB0 --stations 1-4'),
    'init': ('find port, settings and stations, and write net.csv and map.csv',
             'init --into line1', 'init --port /dev/ttyUSB0 --stations 1-4'),
    'files': ('list the data files of a PLC and their lengths', 'files 1 --net net.csv',
              'files 1 --map --net net.csv', 'files 1 --map map.csv --net net.csv'),
    'import': ('make map.csv from tags of RSLogix, KEPServer, RSView, InTouch, Ignition or a list',
               'import plant.csv --station 2 --plc-type SLC',
               'import plant.csv --station 1-4 --read-only --period 1000'),
    'clock': ("show a PLC's time and its drift, or set it", 'clock 1 --net net.csv',
              'clock 1 --set --yes --net net.csv'),
    'ports': ('list serial ports and adapters', 'ports')}


def make_parser(description: str | None) -> argparse.ArgumentParser:
    """Return the parser; the name of the command is in ``command``."""
    parser = command_parser('plc', description, _EPILOG)
    commands = parser.add_subparsers(metavar='COMMAND', dest='command', required=True)
    for name, (text, *examples) in _COMMANDS.items():
        shown = '\n'.join(f'  plc {example}' for example in examples)
        commands.add_parser(
            name, help=text, description=f'{text[0].upper()}{text[1:]}.',
            epilog=f'example:\n{shown}\n\n{_STATUSES}', allow_abbrev=False,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            complete=partial(_complete, name))
    return parser


def _complete(name: str, parser: argparse.ArgumentParser) -> None:
    from abdf1_ros.cli.plc.options import ADDERS
    if name in ADDERS:
        ADDERS[name](parser)


def help_asked(words: Sequence[str]) -> Sequence[str]:
    """Return the words to parse: "help" stands for --help, N7:10=5 for two words."""
    if words[:1] == ['help']:
        return [*words[1:2], '--help']
    if [*words[:1]] == ['write']:  # N7:10=5
        words = [part for word in words for part in (
            word.split('=', 1) if _ASSIGNMENT.fullmatch(word) else [word])]
    return [words[0], '--help'] if words[1:] == ['help'] else words


def check_order(parser: argparse.ArgumentParser, words: Sequence[str]) -> None:
    """End the program if the first word is neither a command nor --help or --version."""
    first = words[0] if words else ''
    if first in _COMMANDS or first in ('', '-h', '--help', '--version'):
        return
    named = next((word for word in words if word in _COMMANDS), None)
    if first.startswith('-') and named:
        parser.error(f'options come after the command, as in "plc {named} ... {first} ..."')
    meant = difflib.get_close_matches(first, _COMMANDS, 1)
    parser.error(f'"{first}" is not a command' + (f'; did you mean {meant[0]}?' if meant else ''))
