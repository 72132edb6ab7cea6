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

"""The help of ``node`` and ``lines``, which is shown without ROS, too."""

from __future__ import annotations

import argparse

from abdf1_ros.paths import as_called, ShowVersion

_NODE_USAGE = 'node --ros-args -p net_file:=net.csv -p map_file:=map.csv'

_NODE = """\
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

_LINES_USAGE = 'lines --ros-args --params-file lines.yaml'

_LINES = """\
Run many bridges in one process, a node for each section of the parameter file.

  lines --ros-args --params-file lines.yaml
  lines --ros-args --params-file lines.yaml -p 'lines:=[/press/abdf1, /paint/abdf1]'

A line whose files have faults is reported and left out; with -p strict_lines:=true the process
ends instead. After an internal error a line is started again, while all other lines go on.

exit status: 0 after Ctrl-C, SIGTERM or SIGHUP, 2 if parameters are faulty or no line can run,
1 after internal errors, or if ROS does not start (log directory, network)
"""

_TEXTS = {'node': (_NODE_USAGE, _NODE), 'lines': (_LINES_USAGE, _LINES)}


def parser_of(name: str) -> argparse.ArgumentParser:
    """Return the parser of a command for --help and --version; it has only ROS arguments."""
    usage, description = (as_called(name, text) for text in _TEXTS[name])
    parser = argparse.ArgumentParser(
        prog=name, usage=usage, description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--version', action=ShowVersion)
    return parser
