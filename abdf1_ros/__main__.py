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

from abdf1_ros.cli.main import COMMANDS, run

_HELP = ('-h', '--help', 'help')


def main() -> int:
    """Run the command that the first argument names; return its exit status, or 2 without one."""
    program, name = os.path.basename(sys.argv[0]), ''.join(sys.argv[1:2])
    if name in COMMANDS:
        sys.argv[:2] = [name]
        return run(name)
    return _help(name, 'abdf1' if program == 'abdf1' else 'python3 -m abdf1_ros')


def _help(name: str, called: str) -> int:
    """Print the version or the help, and the fault of an unknown name; return the exit status."""
    from difflib import get_close_matches  # commands do not need it

    from abdf1_ros.paths import package_version
    from abdf1_ros.text import printable
    if name == '--version':
        print(f'abdf1_ros {package_version()}')
        return 0
    if name and name not in _HELP:
        meant = get_close_matches(name, COMMANDS, 1)
        print(f'{called}: "{printable(name)}" is not a command'
              + (f'; did you mean {meant[0]}?' if meant else ''), file=sys.stderr)
    listed = '\n'.join(f'  {command:10} {purpose}' for command, (_, purpose) in COMMANDS.items())
    print(f'usage: {called} COMMAND ...\n\n{listed}\n\neach has --help',
          file=sys.stdout if name in _HELP else sys.stderr)
    return 0 if name in _HELP else 2


if __name__ == '__main__':
    sys.exit(main())
