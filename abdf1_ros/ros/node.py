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

"""One line in one process: ``node``."""

from __future__ import annotations

from collections.abc import Sequence

from abdf1_ros.ros.bridge.node import BridgeNode
from abdf1_ros.ros.parameters.arguments import Arguments
from abdf1_ros.ros.parameters.declared import NODE_NAME
from abdf1_ros.ros.process.main import make_parser, Program, run_ros
from abdf1_ros.ros.process.runner import Line, Runner

_USAGE = 'node --ros-args -p net_file:=net.csv -p map_file:=map.csv'

_HELP = """\
Read and write the data tables of PLCs over DF1, and show them as topics.

parameters, after --ros-args (docs/reference/parameters.md has all of them):
  -p net_file:=PATH   CSV with the settings of the line, needed
  -p map_file:=PATH   CSV with the rows to read and write, needed
  -p port:=DEVICE     a device path or URL instead of Com_Port in the net file

examples:
  node --ros-args -p net_file:=net.csv -p map_file:=map.csv
  node --ros-args --params-file line_1.yaml -r __node:=line_1

exit status: 0 after Ctrl-C, SIGTERM or SIGHUP, 2 for faulty files or parameters,
1 after internal errors, or if ROS does not start (log directory, network)
"""


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the node until SIGINT, SIGTERM or SIGHUP.

    Returns 0 after a signal, 2 if parameters or files are faulty. Returns 1 after internal errors,
    or if ROS does not start for a reason that may pass.
    """
    return run_ros(NODE_NAME, make_parser(_USAGE, _HELP), _make, args)


def _make(given: Sequence[str]) -> Program:
    return Runner([Line(BridgeNode(arguments=Arguments.of(given)))])
