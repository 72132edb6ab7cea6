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
The executables that take a while to import what they need.

Until their ``main`` handles signals, Ctrl-C and SIGTERM end them as they do later: at once, with
the same status and without a traceback. There is nothing yet that wants to be closed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import signal
import sys
from types import FrameType

_NOT_INSTALLED = 2
_INTERRUPTED = 130  # of the commands whose status tells whether they have done what they should


def node() -> int:
    """Run the node."""
    with _ending_quietly():
        from abdf1_ros.node import main
    return _ended(main())


def monitor() -> int:
    """Run the monitor."""
    with _ending_quietly():
        from abdf1_ros.monitor import main
    return _ended(main())


def demo() -> int:
    """Run the demonstration."""
    with _ending_quietly():
        from abdf1_ros.demo import main
    return _ended(main())


def simulator() -> int:
    """Run the simulator."""
    with _ending_quietly():
        from abdf1_ros.simulator import main
    return _ended(main())


def sniff() -> int:
    """Run the sniffer."""
    with _ending_quietly():
        from abdf1_ros.sniff import main
    return _ended(main())


def check() -> int:
    """Check files."""
    with _ending_quietly(_INTERRUPTED):
        from abdf1_ros.check import main
    return _ended(main())


def plc() -> int:
    """Ask a PLC."""
    with _ending_quietly(_INTERRUPTED):
        from abdf1_ros.plc import main
    return _ended(main())


@contextmanager
def _ending_quietly(status: int = 0) -> Iterator[None]:
    def leave(number: int, frame: FrameType | None) -> None:
        os._exit(status)

    usual = {number: signal.signal(number, leave)
             for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name is None or error.name.startswith('abdf1_ros'):
            raise
        print(f'{Path(sys.argv[0]).name}: the Python module {error.name} is missing; '
              'is ROS 2 sourced, as by ". /opt/ros/jazzy/setup.bash"?', file=sys.stderr)
        sys.exit(_NOT_INSTALLED)
    for number, handler in usual.items():
        signal.signal(number, handler)


def _ended(status: int) -> int:
    """Return the status, which a second Ctrl-C while Python ends is not to change."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    return status
