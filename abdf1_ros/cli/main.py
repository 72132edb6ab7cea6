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
The commands by their names, for the executables and for ``python3 -m abdf1_ros``.

The imports of a command take a while. Until ``main`` of the command handles signals, Ctrl-C and
SIGTERM end the process at once, without a traceback. The status is the same as later. No port or
file is open at that time. This module imports little, because Ctrl-C during its own imports prints
a traceback.
"""

from __future__ import annotations

from importlib import import_module
import os
import signal
import sys

TYPE_CHECKING = False  # mypy takes it as true; the module typing takes long to import
if TYPE_CHECKING:
    from collections.abc import Callable  # noqa: I300
    from types import FrameType
    from typing import NoReturn

_NOT_INSTALLED = _NOT_PRINTED = 2
_INTERRUPTED = 130  # for commands whose exit status means success or failure

COMMANDS = {
    'plc': ('abdf1_ros.cli.plc.command', 'read, write and look for PLCs, without ROS'),
    'sniff': ('abdf1_ros.cli.sniff', 'record and decode a line'),
    'check': ('abdf1_ros.cli.check', 'check net.csv and map.csv, and forecast'),
    'simulator': ('abdf1_ros.cli.simulator', 'PLCs to try things with'),
    'conform': ('abdf1_ros.cli.conform', 'check a PLC or a driver against the manual'),
    'node': ('abdf1_ros.ros.node', 'the bridge: a ROS 2 node'),
    'lines': ('abdf1_ros.ros.lines', 'bridges for several lines in one process'),
    'monitor': ('abdf1_ros.cli.monitor.command', 'show a running bridge'),
    'demo': ('abdf1_ros.cli.demo', 'all together, without a PLC'),
}
"""The module with the ``main`` of each command, and its purpose, in the order of the help."""

_TELLING = ('check', 'plc', 'conform')

# After ``main`` of these commands, all work is done, and signals have no effect. So the process
# ends at once: the objects and threads of rclpy could block the interpreter's shutdown for ever.
_LEAVING = ('node', 'lines', 'simulator')


def run(name: str) -> int:
    """Run a command with the arguments of this process; return its exit status."""
    _end_quietly(_INTERRUPTED if name in _TELLING else 0)
    _open_standard_streams()
    module, _ = COMMANDS[name]
    try:
        status: int = import_module(module).main()
    except ModuleNotFoundError as error:  # also a module that a command imports later
        if error.name is None or error.name.startswith('abdf1_ros'):
            raise
        from abdf1_ros.cli.usage import show_help
        show_help(name, sys.argv[1:])
        print(f'{os.path.basename(sys.argv[0])}: the Python module {error.name} is missing; '
              f'{_cure(error.name)}', file=sys.stderr)
        return _NOT_INSTALLED
    except SystemExit as end:
        if end.code:
            raise
        sys.exit(written(name, 0))  # of --help or --version
    if name in _LEAVING:
        _leave(status)
    return _ended(status)


def written(name: str, status: int) -> int:
    """
    Return ``status`` after the output is written, or 2 and print the reason if that fails.

    Otherwise the interpreter would complain at its end, and exit with status 120. That the reader
    has left is not a failure.
    """
    try:
        sys.stdout.flush()
    except OSError as error:
        from abdf1_ros.signals import drop  # slow
        drop(sys.stdout.fileno())
        if not isinstance(error, BrokenPipeError):
            print(f'{name}: cannot print: {error.strerror}', file=sys.stderr)
            return _NOT_PRINTED
    return status


def __getattr__(name: str) -> Callable[[], int]:
    """Return the function that the executable of this name calls."""
    if name not in COMMANDS:
        raise AttributeError(name)
    return lambda: run(name)


def _end_quietly(status: int) -> None:
    """End with ``status`` if a signal comes before the command has its own handlers."""
    def leave(number: int, frame: FrameType | None) -> None:
        os._exit(status)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, leave)


def _open_standard_streams() -> None:
    """
    Open each of standard input, output and error that is closed, on /dev/null.

    Otherwise the next opened file gets the number of the closed stream. If that file is the port,
    DDS writes its messages to the PLC.
    """
    for number, name in enumerate(('stdin', 'stdout', 'stderr')):
        try:
            os.fstat(number)
        except OSError:
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)  # gets the lowest number
            setattr(sys, name, os.fdopen(number, 'w' if number else 'r'))


def _cure(module: str) -> str:
    if module.partition('.')[0] != 'serial':
        return 'is ROS 2 sourced, as by ". /opt/ros/jazzy/setup.bash"?'
    from abdf1_ros.ports import cure_of
    return cure_of(module)


def _ended(status: int) -> int:
    """Return the status; ignore signals, so that a second Ctrl-C cannot change the status."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    return status


def _leave(status: int) -> NoReturn:
    """End the process at once, after its output is flushed."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):  # the reader has left
            pass
    os._exit(status)
