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

from pathlib import Path
import sys

from abdf1_ros.cli.main import COMMANDS, run


def main() -> int:
    """Run the command that the first argument names; return its exit status, 2 for none."""
    program, name = Path(sys.argv[0]).name, ''.join(sys.argv[1:2])
    if name in COMMANDS:
        sys.argv[:2] = [name]
        return run(name)
    is_help = name in ('-h', '--help')
    print(f'usage: {"abdf1" if program == "abdf1" else "python3 -m abdf1_ros"} '
          f'{{{",".join(COMMANDS)}}} ...\neach has --help',
          file=sys.stdout if is_help else sys.stderr)
    return 0 if is_help else 2


if __name__ == '__main__':
    sys.exit(main())
