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

"""``abdf1 COMMAND``, or ``python3 -m abdf1_ros COMMAND``: all commands by one name."""

from __future__ import annotations

import os
import sys

from abdf1_ros.cli.main import COMMANDS, run, written

_HELP = ('-h', '--help', 'help')


def main() -> int:
    """Run the command that the first argument names; return its exit status, or 2 without one."""
    program, name = os.path.basename(sys.argv[0]), ''.join(sys.argv[1:2])
    if name in COMMANDS:
        sys.argv[:2] = [name]
        return run(name)
    called = 'abdf1' if program == 'abdf1' else 'python3 -m abdf1_ros'
    return written(called, _help(name, called))


def _help(name: str, called: str) -> int:
    """Print the version or the help, and the fault of an unknown name; return the exit status."""
    from contextlib import suppress  # commands need none of these
    from difflib import get_close_matches

    from abdf1_ros.paths import package_version
    from abdf1_ros.text import printable
    said, fault = name == '--version' or name in _HELP, ''
    if name and not said:
        meant = get_close_matches(name, (*COMMANDS, '--help', '--version'), 1)
        fault = f'{called}: "{printable(name)}" is not a command' \
            f'{f"; did you mean {meant[0]}?" if meant else ""}\n'
    listed = '\n'.join(f'  {command:10} {purpose}' for command, (_, purpose) in COMMANDS.items())
    text = f'abdf1_ros {package_version()}' if name == '--version' else \
        f'{fault}usage: {called} COMMAND ...\n\n{listed}\n\neach has --help'
    with suppress(OSError):  # as argparse does for its help
        print(text, file=sys.stdout if said else sys.stderr)
    return 0 if said else 2


if __name__ == '__main__':
    sys.exit(main())
