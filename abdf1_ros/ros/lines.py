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
Many lines in one process: ``lines``.

Each line is a node as in the command ``node``. All lines share one ROS context, and so one DDS
participant. A fault of one line does not affect the other lines.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
import math
from operator import attrgetter
import re
import resource
import threading
import time

from abdf1_ros.paths import config_file
from abdf1_ros.ports.clock import line_time
from abdf1_ros.problems import ConfigurationError, Place, Problem
from abdf1_ros.ros.bridge.node import BridgeNode
from abdf1_ros.ros.bridge.port_owners import PortOwners
from abdf1_ros.ros.callbacks import AnsweringNode, Executor
from abdf1_ros.ros.diagnostics.graph import Graph
from abdf1_ros.ros.diagnostics.log import bug_text, LimitedLog
from abdf1_ros.ros.diagnostics.status import ERROR, message_of, OK, WARN, WORDS
from abdf1_ros.ros.parameters.arguments import Arguments
from abdf1_ros.ros.parameters.declared import take_given, wrong_names
from abdf1_ros.ros.parameters.files import node_sections, parameter_files, parameter_tree
from abdf1_ros.ros.parameters.values import usable
from abdf1_ros.ros.process.main import Program, run_ros
from abdf1_ros.ros.process.refusals import EXIT_CONFIGURATION, REFUSALS
from abdf1_ros.ros.process.runner import Line, LinkFailed, Runner
from abdf1_ros.ros.process.usage import parser_of
from abdf1_ros.settings.heartbeats import LONGEST_END
from abdf1_ros.signals import EndRequest
from abdf1_ros.text import printable
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

NODE_NAME = 'lines'

# The parameters of /lines, with their defaults.
OPTIONS: dict[str, object] = {'lines': [], 'strict_lines': False}

# Pause (s) before a line is started again after an internal error.
RESTART_AFTER = 2.0

# Longest time (s) that the end of a line with an internal error takes, until its PLCs have been
# told and its writes have their results (``end_together``).
_CLOSED_AFTER = LONGEST_END + 2.0

_STATUS_PERIOD = 1.0

# We do not need this service; without it, a hundred nodes take 251 instead of 264 MiB.
_NO_TYPE_DESCRIPTIONS = Parameter('start_type_description_service', value=False)


class RestartedLine(Line):
    """
    A line that is started again after an internal error, while all other lines go on.

    - ``name``: the full name of the node
    - ``make``: makes the node
    - ``faults``: why the line cannot run; empty if it can
    - ``restarts``: number of internal errors that have ended the line
    - ``due``: the monotonic clock value of its next start; infinite if none is planned
    """

    def __init__(self, name: str, make: Callable[[], BridgeNode]) -> None:
        super().__init__()
        self.name = name
        self.faults: tuple[str, ...] = ()
        self.restarts = 0
        self._make = make
        self.closing: threading.Thread | None = None
        self.due, self._closed_by = math.inf, -math.inf
        self._logger = get_logger(printable(name).strip('/').replace('/', '.'))

    def start(self) -> None:
        """Make the node and run it."""
        self.due = math.inf
        self.make()
        self.take_callbacks()
        self.open_port()

    def make(self) -> None:
        """Make the node, if its files have no faults and no other line has its port."""
        self.faults = ()
        try:
            self.node = self._make()
        except ConfigurationError as error:
            self.faults = tuple(map(str, error.problems))
        except REFUSALS as error:
            self.faults = (' '.join(str(error).split()),)
        except Exception as error:  # a bug must not end the other lines
            self._begin_again(error)
        for fault in self.faults:
            self._logger.fatal(printable(fault))

    def take_callbacks(self) -> None:
        self._take(super().take_callbacks)

    def open_port(self) -> None:
        self._take(super().open_port)

    def check(self) -> None:
        self._take(super().check)

    def _take(self, step: Callable[[], None]) -> None:
        """Take a step; end and restart the line after an internal error."""
        try:
            step()
        except Exception as error:  # a bug, or no thread for the line, ends only this line
            self._begin_again(error)

    @property
    def _is_closing(self) -> bool:
        return self.closing is not None and self.closing.is_alive()

    @property
    def is_due(self) -> bool:
        """Return True if the line has to be started now."""
        return time.monotonic() >= self.due and not self._is_closing

    @property
    def reason(self) -> str:
        """Return why a line without a node does not run."""
        if self._is_closing and time.monotonic() >= self._closed_by:  # its link hangs, maybe
            return 'its old node does not end: restart the process'
        return '; '.join(self.faults) or 'is started again'

    def _begin_again(self, error: Exception) -> None:
        """End the node in a thread, as this may take seconds; plan its restart."""
        self.restarts += 1
        text = printable(str(error)) if isinstance(error, LinkFailed) else bug_text(error)
        self._logger.error(f'has ended by an internal error and is started again: {text}')
        now = time.monotonic()
        self.due, self._closed_by = now + RESTART_AFTER, now + _CLOSED_AFTER
        if self.node is not None:
            gone = Line(self.node, self._callbacks)
            self.node, self._callbacks = None, None
            closing = threading.Thread(target=gone.close, name='closing', daemon=True)
            try:
                closing.start()
            except RuntimeError:  # there is no thread for that either
                gone.close()
            else:
                self.closing = closing

    def end_callbacks(self, give_up: float) -> None:
        """End the callbacks; wait also for an old node: it may still have to tell its PLCs."""
        if self.closing is not None:
            self.closing.join(max(0.0, max(give_up, self._closed_by) - time.monotonic()))
        super().end_callbacks(give_up)


def start_one(lines: Sequence[RestartedLine]) -> None:
    """Start the line that is due for longest: each start holds up the checks of all lines."""
    if waiting := [line for line in lines if line.is_due]:
        min(waiting, key=attrgetter('due')).start()


def _options(node: Node, arguments: Arguments) -> tuple[list[str], bool]:
    """Return the wanted lines, and whether all have to run; raises ConfigurationError."""
    problems = wrong_names(node, take_given(node), arguments, OPTIONS, NODE_NAME)
    anything = ParameterDescriptor(dynamic_typing=True)
    wanted, is_strict = (node.declare_parameter(name, default, anything).value
                         for name, default in OPTIONS.items())
    if not isinstance(wanted, list) or not all(isinstance(name, str) for name in wanted):
        problems.append(Problem('parameter lines', (
            f"{wanted!r} should be a list of names, as in -p 'lines:=[/press/abdf1]'")))
    try:
        usable('strict_lines', is_strict, default=False)
    except ValueError as error:
        problems.append(Problem('parameter strict_lines', str(error)))
    if problems:
        raise ConfigurationError(problems)
    return list(wanted), is_strict


class LinesNode(AnsweringNode):
    """Shows all lines on /diagnostics; ``~/reload`` starts faulty lines again."""

    def __init__(self, arguments: Arguments) -> None:
        super().__init__(NODE_NAME, automatically_declare_parameters_from_overrides=True)
        self.wanted, self.is_strict = _options(self, arguments)
        self.is_asked_again = False
        self.graph = Graph(self)
        self._notes = LimitedLog(self.get_logger(), line_time)
        self._names = self.graph.name_watch(self, f'-r {NODE_NAME}:__node:=lines_2')
        self._publisher = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.create_service(Trigger, '~/reload', self._reload)

    def _reload(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.is_asked_again = True
        response.success, response.message = True, 'lines that do not run are tried again'
        return response

    def look(self) -> None:
        """Look for another node with our name: it would answer calls meant for us."""
        for news in self._names.look(line_time()):
            self._notes.tell(news)

    def publish(self, lines: Sequence[RestartedLine]) -> None:
        """Publish which lines run, and why the other lines do not."""
        faulty = [line for line in lines if line.node is None]
        level, text = (ERROR, f'{len(faulty)} of {len(lines)} lines do not run') \
            if faulty else (OK, f'{len(lines)} of {len(lines)} lines run')
        if self._names.text:
            level, text = max(level, WARN), f'{text}; {self._names.text}'
        values = {'lines': str(len(lines)), 'running': str(len(lines) - len(faulty)),
                  'restarts': str(sum(line.restarts for line in lines))}
        values |= {line.name: line.reason for line in faulty}
        name = f'{self.get_fully_qualified_name().lstrip("/")}: lines'
        message = DiagnosticArray(status=[
            message_of(name, level, f'{WORDS[level]}: {text}', '', values)])
        message.header.stamp = self.get_clock().now().to_msg()
        self._publisher.publish(message)


class Lines:
    """The program ``lines``: all lines, from their start to their end."""

    def __init__(self, names: Sequence[str], node: LinesNode, arguments: Arguments) -> None:
        port_owners = PortOwners()
        self._lines = [RestartedLine(name, partial(
            BridgeNode, _short(name), namespace=name.rpartition('/')[0] or '/', graph=node.graph,
            port_owners=port_owners, arguments=arguments,
            parameter_overrides=[_NO_TYPE_DESCRIPTIONS]))
            for name in names]
        self._runner = Runner(self._lines, self._look)
        self._node = node
        self._executor = Executor(node)
        self._next_status = 0.0
        for line in self._lines:
            line.make()

    def run(self, ended: EndRequest) -> int:
        """Run all lines until the end, if enough lines can run; return the exit status."""
        running = sum(line.node is not None for line in self._lines)
        told = f'{running} of {len(self._lines)} lines run'
        if running == len(self._lines):
            self._node.get_logger().info(told)
        else:
            self._node.get_logger().warning(told)
        if running < (len(self._lines) if self._node.is_strict else 1):
            return EXIT_CONFIGURATION
        return self._runner.run(ended)

    def _look(self) -> None:
        """Answer calls to the process; publish the status of all lines."""
        now = time.monotonic()
        try:
            self._node.look()
            self._executor.spin_once(timeout_sec=0)
        except Exception as error:  # the lines go on: they have executors of their own
            self._node.tell_failure('a periodic check', error)
        if self._node.is_asked_again:
            self._node.is_asked_again = False
            for line in self._lines:
                if line.faults:
                    line.due = min(line.due, now)
        start_one(self._lines)
        if now >= self._next_status:
            self._next_status = now + _STATUS_PERIOD
            self._node.publish(self._lines)

    def destroy(self) -> None:
        """Destroy all nodes, unless a callback still uses them."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._runner.destroy()


def sections(files: Sequence[str], own_name: str = NODE_NAME) -> dict[str, list[Place]]:
    """
    Return the full names of the lines in parameter files, with the places of their sections.

    A section with a wildcard is not a line, nor is the section of the process (``own_name``).
    Raises ConfigurationError if a file cannot be read, or has a section twice: only one of the two
    would run.
    """
    found: dict[str, list[Place]] = {}
    problems = []
    for path in dict.fromkeys(files):
        for name, line, _ in node_sections(parameter_tree(path)):
            if name in (f'/{NODE_NAME}', f'/{own_name}') or '*' in name:
                continue
            places = found.setdefault(name, [])
            if places and places[-1].file == path:
                problems.append(Problem(Place(path, line), (
                    f'{printable(name)} has a section already, in line {places[-1].line}; '
                    'give each DF1 line a name of its own')))
            else:
                places.append(Place(path, line))
    if problems:
        raise ConfigurationError(problems)
    return found


def chosen(names: Sequence[str], wanted: Sequence[str]) -> list[str]:
    """
    Return the wanted lines, by name or full name; all lines if ``wanted`` is empty.

    A part of a full name is enough, if only one line has this part.

    Raises ConfigurationError for a name without a section, or if there is no line at all.
    """
    if not names:
        raise ConfigurationError([Problem(
            'arguments', 'no line to run: give a parameter file with a section for each line, '
            'as in --ros-args --params-file lines.yaml; an example is '
            f'{config_file("three_lines.yaml")}')])
    if not wanted:
        return list(names)
    meant = {text: [name for name in names if text in (name, _short(name))] for text in wanted}
    for text in [text for text, found in meant.items() if not found]:
        parts = [name for name in names if text in name.split('/')]
        meant[text] = parts if len(parts) == 1 else []
    if missing := [text for text, found in meant.items() if not found]:
        raise ConfigurationError([Problem(
            'parameter lines', f'no section is called {printable(", ".join(missing))}; the '
            'sections are ' + printable(', '.join(names)))])
    return [name for name in names if any(name in found for found in meant.values())]


def _short(name: str) -> str:
    return name.rpartition('/')[2]


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the lines until SIGINT, SIGTERM or SIGHUP.

    Returns 0 after a signal, 2 if parameters are faulty or no line can run. Returns 1 after
    internal errors, or if ROS does not start for a reason that may pass.
    """
    return run_ros(NODE_NAME, parser_of('lines'), _make, args, leaves_out=True)


def _allow_files() -> None:
    """Raise the limit of open files: a line needs 7, and the usual limit is 1024."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    with suppress(OSError, ValueError):  # then the limit stays as it is
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def _own_name(given: Sequence[str]) -> str:
    """Return the name of the process; ConfigurationError if an argument would name all nodes."""
    own = NODE_NAME
    for text in given:
        if renamed := re.fullmatch(rf'/?{NODE_NAME}:__(?:node|name):=(\w+)', text):
            own = renamed[1]
        elif any(word in text for word in ('__node:=', '__name:=', '__ns:=')):
            raise ConfigurationError([Problem('arguments', (
                f'{printable(text)} would give all nodes one name: the sections of the parameter '
                f'file name the lines, and -r {NODE_NAME}:__node:=NAME the process'))])
    return own


def _make(given: Sequence[str]) -> Program:
    own_name, files = _own_name(given), parameter_files(given)
    names = sections(files, own_name)
    _allow_files()
    arguments = Arguments.of(given, names)
    node = LinesNode(arguments)
    for name, (first, *others) in names.items():
        for place in others:
            node.get_logger().warning(printable(
                f'{place}: {name} has a section in {first} too: it is one line, with the later of '
                'two values'))
    return Lines(chosen([*names], node.wanted), node, arguments)


if __name__ == '__main__':
    raise SystemExit(main())
