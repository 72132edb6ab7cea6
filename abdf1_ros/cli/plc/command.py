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
Read, write and look for PLCs on a DF1 line from the command line.

This tool is for commissioning and needs no ROS. No other program may have the port, so stop the
node first. On a half-duplex line plc is the master, so there must be no other master. With
--slave there must be a master that polls us.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
import sys

from abdf1_ros.cli.plc.parser import check_order, help_asked, make_parser, verb
from abdf1_ros.cli.terminal import EXIT_INTERRUPTED, prepare_output, run_command, tell, YELLOW


def main(args: Sequence[str] | None = None) -> int:
    """Carry out one command; return one of the exit statuses that --help lists."""
    is_closed = sys.stdout is None
    prepare_output()
    parser = make_parser(__doc__)
    words = help_asked(sys.argv[1:] if args is None else args)
    check_order(parser, words)
    options = parser.parse_args(words)
    if is_closed:
        tell('plc', 'standard output is closed, so nothing that it prints can be seen', YELLOW)
    chosen = verb(options.command)
    return run_command('plc', partial(chosen.run, options), EXIT_INTERRUPTED,
                       getattr(chosen, 'UNREAD_STATUS', 0))


if __name__ == '__main__':
    raise SystemExit(main())
