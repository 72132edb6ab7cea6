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
from abdf1_ros.ros.process.main import Program, run_ros
from abdf1_ros.ros.process.runner import Line, Runner
from abdf1_ros.ros.process.usage import parser_of


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the node until SIGINT, SIGTERM or SIGHUP.

    Returns 0 after a signal, 2 if parameters or files are faulty. Returns 1 after internal errors,
    or if ROS does not start for a reason that may pass.
    """
    return run_ros(NODE_NAME, parser_of('node'), _make, args)


def _make(given: Sequence[str]) -> Program:
    return Runner([Line(BridgeNode(arguments=Arguments.of(given)))])


if __name__ == '__main__':
    raise SystemExit(main())
