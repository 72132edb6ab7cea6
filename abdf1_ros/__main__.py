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

"""``python3 -m abdf1_ros COMMAND``: the commands where no ROS has installed them."""

from __future__ import annotations

import sys

from abdf1_ros.cli.main import COMMANDS, run


def main() -> int:
    """Run the command that the first argument names; return its exit status, 2 for none."""
    name = sys.argv[1] if len(sys.argv) > 1 else ''
    if name not in COMMANDS:
        print(f'usage: python3 -m abdf1_ros {{{",".join(COMMANDS)}}} ...', file=sys.stderr)
        return 0 if name in ('-h', '--help') else 2
    sys.argv[:2] = [name]
    return run(name)


if __name__ == '__main__':
    sys.exit(main())
