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

"""The verbs of ``plc`` and their help; only the file of the chosen verb is imported."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import difflib
from functools import cache, partial
from importlib import import_module
from keyword import iskeyword
from pathlib import Path
from types import ModuleType

from abdf1_ros.cli.terminal import command_parser
from abdf1_ros.settings.hints import looks_like_address

_STATUSES = """\
exit status:
  0    done: read, written and confirmed, answered, found
  1    no answer, or the PLC refused it; the port cannot be opened or was lost; rows left out
  2    wrong options, files, addresses or values; a write not confirmed with --yes. Nothing was
       written
  3    a write without a reply, or interrupted: the PLC may have all, a part or nothing of it
  130  interrupted by Ctrl-C; a running watch, log or ping ends with 0 or 1 instead
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
  plc log --map map.csv --net net.csv --to shift.csv
  plc plot shift.csv --html shift.html        curves of a log, for a browser

"plc COMMAND --help" explains each command.
"""

# The order of the help. A verb that is not named here comes after these.
_ORDER = ('read', 'write', 'watch', 'log', 'plot', 'status', 'ping', 'scan', 'detect', 'init',
          'files', 'import', 'clock', 'ports')


@cache
def _verbs() -> dict[str, str]:
    """Return the docstring of each verb's file by the name of the verb."""
    files = {path.stem.rstrip('_'): path for path in Path(__file__).parent.glob('verbs/[a-z]*.py')}
    names = [name for name in _ORDER if name in files] + sorted({*files} - {*_ORDER})
    return {name: files[name].read_text(encoding='utf-8').split('"""')[1] for name in names}


def verb(name: str) -> ModuleType:
    """Import the file of a verb."""
    return import_module(f'abdf1_ros.cli.plc.verbs.{name}{"_" * iskeyword(name)}')


def make_parser(description: str | None) -> argparse.ArgumentParser:
    """Return the parser; the name of the verb is in ``command``."""
    parser = command_parser('plc', description, _EPILOG)
    commands = parser.add_subparsers(metavar='COMMAND', dest='command', required=True)
    for name, text in _verbs().items():
        purpose, _, examples = text.strip().partition('\n\n')
        commands.add_parser(
            name, help=f'{purpose[0].lower()}{purpose[1:-1]}', description=purpose,
            epilog=f'example:\n{examples}\n\n{_STATUSES}', allow_abbrev=False,
            formatter_class=argparse.RawDescriptionHelpFormatter,
            complete=partial(_complete, name))
    return parser


def _complete(name: str, parser: argparse.ArgumentParser) -> None:
    verb(name).add_arguments(parser)


def help_asked(words: Sequence[str]) -> Sequence[str]:
    """Return the words to parse: "help" stands for --help."""
    if words[:1] == ['help']:
        return [*words[1:2], '--help']
    return [words[0], '--help'] if words[1:] == ['help'] else words


def check_order(parser: argparse.ArgumentParser, words: Sequence[str]) -> None:
    """End the program if the first word is neither a command nor --help or --version."""
    first = words[0] if words else ''
    if first in _verbs() or first in ('', '-h', '--help', '--version'):
        return
    named = next((word for word in words if word in _verbs()), None)
    if first.startswith('-') and named:
        parser.error(f'options come after the command, as in "plc {named} ... {first} ..."')
    meant = difflib.get_close_matches(
        first.lower(), (*_verbs(), '--help', '--version'), 1)
    if looks_like_address(first):
        meant = [f'plc read {first}']
    parser.error(f'"{first}" is not a command' + (f'; did you mean {meant[0]}?' if meant else ''))
