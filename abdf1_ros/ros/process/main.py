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
The process of a node: signals, arguments, a ROS context, and the exit status.

Both commands, ``node`` and ``lines``, run in it.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
import faulthandler
import os
from pathlib import Path
import signal
import sys
import threading
import time
from typing import Protocol

from abdf1_ros.console import Console
from abdf1_ros.problems import ConfigurationError, Problem
from abdf1_ros.ros.diagnostics.log import bug_text
from abdf1_ros.ros.parameters.files import usable_files, with_home
from abdf1_ros.ros.process.refusals import (
    EXIT_CONFIGURATION,
    EXIT_FAULT,
    refusal,
    REFUSALS,
    unknown_argument,
    wants_security,
)
from abdf1_ros.settings.heartbeats import LONGEST_END
from abdf1_ros.signals import EndRequest
import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.logging import get_logger, get_logging_directory
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

# Times (s) after a signal by which the process has ended, and by which its nodes have left the
# network. Before that, PLCs, pending writes and the last diagnostics take at most 8 s. systemd,
# launch and Docker kill a process only after 10 s.
_END_LIMIT = LONGEST_END + 3.0
_DESTRUCTION_LIMIT = LONGEST_END + 2.5

# ROS arguments about the log file.
_NO_LOG_FILE, _LOG_FILE_NAME = '--disable-external-lib-logs', '--log-file-name'

_NOT_ENFORCED = (
    'ROS_SECURITY_STRATEGY is not Enforce: if ROS finds no keys, it starts without security, and '
    'any program on the network can write to the PLC')


class Program(Protocol):
    """A program that a process makes first and then runs."""

    def run(self, ended: EndRequest) -> int:
        """
        Run until ``ended``, inform the PLCs, publish results of writes; return the exit status.

        It sets ``ended`` itself if it ends for another reason.
        """

    def destroy(self) -> None:
        """Destroy the nodes; the end of the process may skip this."""


def run_ros(name: str, parser: argparse.ArgumentParser,
            make: Callable[[Sequence[str]], Program], args: Sequence[str] | None = None,
            leaves_out: bool = False) -> int:
    """
    Run in a ROS context until SIGINT, SIGTERM or SIGHUP, and return the exit status.

    ``make`` gets the arguments (``args``, by default from the command line); it opens no port.
    With ``leaves_out``, sections of parameter files are left out if ROS refuses their names. If
    ``make`` fails, the reason is reported under ``name``. The exit status is EXIT_CONFIGURATION if
    the user has to change arguments, parameters or files. It is EXIT_FAULT for a reason that may
    pass. An error while the program runs is a bug: a traceback is logged, and the exit status is
    EXIT_FAULT.
    """
    program: Program | None = None

    def begin_end() -> None:
        if program is None:  # no port is open yet, so no PLC has to be informed
            os._exit(0)
        end_by_the_clock()

    given = with_home(sys.argv if args is None else args)
    with EndRequest(_ending_signals(), begin_end) as ended, ExitStack() as stack:
        try:
            with usable_files(given, leaves_out) as usable:
                _check_arguments(parser, usable)
                stack.enter_context(Console(log_file(name, usable)))
                _begin(usable)
            if wants_security() and os.environ.get('ROS_SECURITY_STRATEGY') != 'Enforce':
                get_logger(name).warning(_NOT_ENFORCED)
            made = _made(make, given)
        except ConfigurationError as error:
            for problem in error.problems:
                get_logger(name).fatal(str(problem))
            return EXIT_CONFIGURATION
        except REFUSALS as error:
            status, text = refusal(error)
            print(f'{name}: {text}', file=sys.stderr)
            return status
        program = made
        try:
            status = program.run(ended)
        except Exception as error:
            get_logger(name).fatal(f'internal error: {bug_text(error)}')
            status = EXIT_FAULT
        ended.set()
        destroy(program, ended.when + _DESTRUCTION_LIMIT)
        faulthandler.cancel_dump_traceback_later()
        return status


def _ending_signals() -> Iterator[signal.Signals]:
    yield from (signal.SIGINT, signal.SIGTERM)
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # it is ignored under nohup
        yield signal.SIGHUP


def _check_arguments(parser: argparse.ArgumentParser, given: list[str]) -> None:
    """End the process if there are arguments that are not for ROS."""
    if unknown := parser.parse_known_args(remove_ros_args(given)[1:])[1]:
        parser.error(unknown_argument(unknown))


def log_file(name: str, given: Sequence[str]) -> int | None:
    """
    Return the descriptor of a new log file; None if the user wants no log file.

    The file has the name that rclpy would give it. We write it ourselves, because rclpy holds the
    GIL while it waits for the disk.
    """
    if _NO_LOG_FILE in given:
        return None
    _check_log_directory()
    if _LOG_FILE_NAME in given[:-1]:
        name = given[given.index(_LOG_FILE_NAME) + 1]
    folder = Path(get_logging_directory())
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return os.open(folder / f'{name}_{os.getpid()}_{time.time_ns() // 1_000_000}.log',
                       os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    except OSError as error:
        raise rclpy_implementation.RCLError(
            f'Failed opening file in log directory {folder}: {error.strerror}') from error


def _begin(given: list[str]) -> None:
    """Begin the ROS context."""
    try:
        rclpy.init(args=[*given, '--ros-args', _NO_LOG_FILE],
                   signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # for example an error of the log
        raise rclpy_implementation.RCLError(str(error)) from error


def _made(make: Callable[[Sequence[str]], Program], given: list[str]) -> Program:
    try:
        return make(given)
    except BaseException:
        rclpy.try_shutdown()
        raise


def end_by_the_clock() -> None:
    """Set a timer that prints all threads and ends the process, even if the process hangs."""
    # A Python thread could not do this: C code that hangs may hold the GIL.
    faulthandler.dump_traceback_later(_END_LIMIT, exit=True, file=2)


def destroy(program: Program, give_up: float) -> None:
    """
    Take the nodes off the network; give up at a monotonic clock value.

    With thousands of topics this takes seconds. If the time is not enough, other nodes see ours
    until the lease of the participant ends.
    """
    def destroy() -> None:
        program.destroy()
        rclpy.try_shutdown()

    thread = threading.Thread(target=destroy, name='destroying', daemon=True)
    thread.start()
    thread.join(max(0.0, give_up - time.monotonic()))


def _check_log_directory() -> None:
    """Raise ConfigurationError if rclpy would find no log directory; its own error is unclear."""
    if not any(os.environ.get(name) for name in ('ROS_LOG_DIR', 'ROS_HOME', 'HOME')):
        raise ConfigurationError([Problem('environment', (
            'HOME is not set, so there is no directory for the log; set ROS_LOG_DIR to a '
            'directory that this user may write to'))])
