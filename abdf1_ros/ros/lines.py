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

Each line is a node as ``node`` has it, in one ROS context: one DDS participant for all. Each has
two threads, for its link and for its callbacks. One executor for all would need 17 ms for every
message to a hundred nodes, in which no link gets on (test/benchmarks/many_lines.py); an executor
a line needs 1.3 ms. What goes wrong with one line stays with it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
import os
from pathlib import Path
import sys
import threading
import time
from typing import Any

from abdf1_ros.errors import ConfigurationError, Problem
from abdf1_ros.ros.interlocks import END_LIMIT
from abdf1_ros.ros.node import BridgeNode, LEVEL_CHECK_PERIOD
from abdf1_ros.ros.process import (
    EXIT_CONFIGURATION,
    LAST_WRITES,
    make_parser,
    QUIET,
    run_ros,
)
from abdf1_ros.text import printable
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException
from rclpy.executors import SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
import yaml

NODE_NAME = 'lines'

_USAGE = 'lines --ros-args --params-file lines.yaml'

_HELP = """\
Run many bridges in one process, a node for each section of the parameter file.

  lines --ros-args --params-file lines.yaml
  lines --ros-args --params-file lines.yaml -p 'lines:=[press_plc, paint_plc]'

A line whose files have faults is told and left out; -p strict_lines:=true ends the process then.
A line that ends by an internal error is started again, the others notice nothing.

exit status: 0 after Ctrl-C, SIGTERM or SIGHUP, 2 for faulty parameters or where no line can
run, 1 where ROS does not start (log directory, network)
"""

# A line that has ended by an internal error is started again after so long (s).
_RESTART_AFTER = 2.0

_STATUS_PERIOD = 1.0

# A service that nobody uses, for memory and time to start: 13 MiB of 264 with a hundred nodes.
_NO_TYPE_DESCRIPTIONS = Parameter('start_type_description_service', value=False)

# The end takes no longer than this (s): what is not destroyed by then ends with the process.
_LAST_WORDS = 0.5
_DESTRUCTION = 1.0


@dataclass(frozen=True, slots=True, order=True)
class LineName:
    """Namespace and name of a node; the namespace begins with "/"."""

    namespace: str
    name: str

    def __str__(self) -> str:
        """Return the full name."""
        return f'{self.namespace.rstrip("/")}/{self.name}'


class Line:
    """
    One bridge with the thread of its callbacks.

    ``faults`` say why it does not run; ``restarts`` counts internal errors that ended it. All
    but that thread is called by one thread.
    """

    def __init__(self, name: LineName) -> None:
        self.name = name
        self.node: BridgeNode | None = None
        self.faults: tuple[str, ...] = ()
        self.restarts = 0
        self._executor: SingleThreadedExecutor | None = None
        self._thread: threading.Thread | None = None
        self._error: Exception | None = None
        self._again: float | None = None

    def start(self) -> None:
        """Begin; with faulty files there is no node after it."""
        self.faults = ()
        logger = get_logger(str(self.name).strip('/').replace('/', '.'))
        try:
            node = BridgeNode(self.name.name, namespace=self.name.namespace, has_timer=False,
                              parameter_overrides=[_NO_TYPE_DESCRIPTIONS])
        except ConfigurationError as error:
            self.faults = tuple(map(str, error.problems))
        except (NameValidationException, RuntimeError, ValueError) as error:
            self.faults = (' '.join(str(error).split()),)
        if self.faults:
            for fault in self.faults:
                logger.fatal(printable(fault))
            return
        self.node, self._error = node, None
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._thread = threading.Thread(target=self._spin, name='callbacks', daemon=True)
        self._thread.start()
        node.start()

    def _spin(self) -> None:
        assert self._executor is not None
        try:
            self._executor.spin()
        except Exception as error:  # a bug must not end the other lines
            self._error = error

    def check(self, now: float) -> None:
        """Publish what is due; begin again after an internal error (``now`` in s)."""
        node = self.node
        if node is None:
            if self._again is not None and now >= self._again:
                self._again = None
                self.start()
        elif node.link.has_failed or self._error is not None:
            self.restarts += 1
            error = self._error or node.link.state.text
            node.get_logger().error(f'ends by an internal error and begins again: {error!r}')
            self.close(time.monotonic() + _LAST_WORDS)
            self._again = now + _RESTART_AFTER
        else:
            try:
                node.check()
            except Exception as error:  # the same
                self._error = error

    def ask_to_stop(self) -> None:
        """Begin the end of the link."""
        if self.node is not None:
            self.node.link.ask_to_stop()

    def close(self, give_up: float) -> None:
        """End the link, tell the last state, and the thread; all of it waits up to ``give_up``."""
        node, self.node = self.node, None
        if node is None:
            return
        self._say_last_words(node, give_up)
        self._end_thread()
        node.destroy_node()

    def quit(self, give_up: float) -> BridgeNode | None:  # noqa: A003
        """Do the same, but return the node instead of destroying it."""
        node, self.node = self.node, None
        if node is not None:
            self._say_last_words(node, give_up)
            self._end_thread()
        return node

    def _say_last_words(self, node: BridgeNode, give_up: float) -> None:
        with suppress(Exception):  # it may be broken
            node.stop(Duration(seconds=max(0.0, give_up - time.monotonic())))

    def _end_thread(self) -> None:
        if self._executor is not None and self._thread is not None:
            self._executor.shutdown(timeout_sec=0)
            self._thread.join(_LAST_WORDS)


class LinesNode(Node):
    """Tell of all lines on /diagnostics; ``~/reload`` tries those again that do not run."""

    def __init__(self) -> None:
        super().__init__(NODE_NAME)
        names = self.declare_parameter('lines', Parameter.Type.STRING_ARRAY)
        self.wanted: list[str] = list(names.value or ())
        self.is_strict = bool(self.declare_parameter('strict_lines', False).value)
        self.is_asked_again = False
        self._publisher = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.create_service(Trigger, '~/reload', self._reload)

    def _reload(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.is_asked_again = True
        response.success, response.message = True, 'lines that do not run are tried again'
        return response

    def publish(self, lines: Sequence[Line]) -> None:
        """Publish which lines run, and why others do not."""
        faulty = [line for line in lines if line.node is None]
        level, text = DiagnosticStatus.OK, f'OK: {len(lines)} lines run'
        if faulty:
            level = DiagnosticStatus.ERROR
            text = f'ERROR: {len(faulty)} of {len(lines)} lines do not run'
        values = {'lines': str(len(lines)), 'running': str(len(lines) - len(faulty)),
                  'restarts': str(sum(line.restarts for line in lines))}
        values |= {str(line.name): '; '.join(line.faults) or 'begins again' for line in faulty}
        message = DiagnosticArray(status=[DiagnosticStatus(
            level=level, name=f'{self.get_fully_qualified_name().lstrip("/")}: lines',
            message=text, values=[KeyValue(key=key, value=printable(value))
                                  for key, value in values.items()])])
        message.header.stamp = self.get_clock().now().to_msg()
        self._publisher.publish(message)


class Lines:
    """All lines, from their start to their end."""

    def __init__(self, names: Sequence[LineName], node: LinesNode) -> None:
        self.lines = [Line(name) for name in names]
        self._node = node
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._next_status = 0.0

    def start(self, is_ended: Callable[[], bool]) -> None:
        """Start one after the other, until asked to end."""
        for line in self.lines:
            if is_ended():
                return
            line.start()
            self._look()

    def run(self, ended: threading.Event) -> None:
        """Look after all lines until the end."""
        while not ended.wait(LEVEL_CHECK_PERIOD):
            self._look()

    def _look(self) -> None:
        now = time.monotonic()
        self._executor.spin_once(timeout_sec=0)
        for line in self.lines:
            line.check(now)
        if self._node.is_asked_again:
            self._node.is_asked_again = False
            for line in self.lines:
                if line.faults:
                    line.start()
        if now >= self._next_status:
            self._next_status = now + _STATUS_PERIOD
            self._node.publish(self.lines)

    def end(self) -> bool:
        """End all links, then all nodes; return whether there was time for the latter."""
        nodes = [line.node for line in self.lines if line.node is not None]
        for node in nodes:
            node.begin_end()
        give_up = time.monotonic() + END_LIMIT  # for all of them together
        for node in nodes:
            node.finish_end(give_up)
        for line in self.lines:
            line.ask_to_stop()
        for node in nodes:
            node.link.stop()
        # Writes that have come already are refused now; whoever waits for a result gets it.
        give_up, taken = time.monotonic() + LAST_WRITES, -1
        while taken != (taken := sum(node.writes_taken for node in nodes)) and \
                time.monotonic() < give_up:
            time.sleep(QUIET)
        give_up = time.monotonic() + _LAST_WORDS
        left = [line.quit(give_up) for line in self.lines]
        give_up = time.monotonic() + _DESTRUCTION
        while left and time.monotonic() < give_up:
            node_or_none = left.pop()
            if node_or_none is not None:
                node_or_none.destroy_node()
        self._executor.shutdown()
        self._node.destroy_node()
        return not left


def sections(path: str) -> Iterator[LineName]:
    """
    Yield the nodes that a parameter file has a section for; those with wildcards are no nodes.

    Raises ConfigurationError where there is none that can be read.
    """
    try:
        tree = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise ConfigurationError([Problem(path, ' '.join(str(error).split()))]) from None
    yield from _sections_of('', tree)


def _sections_of(above: str, tree: Any) -> Iterator[LineName]:
    if not isinstance(tree, dict):
        return
    if 'ros__parameters' in tree:
        namespace, _, name = above.rpartition('/')
        if '*' not in above and name != NODE_NAME:
            yield LineName(namespace or '/', name)
        return
    for key, below in tree.items():
        yield from _sections_of(f'{above}/{str(key).strip("/")}', below)


def parameter_files(args: Sequence[str]) -> list[str]:
    """Return the parameter files among the arguments of a process."""
    return [path for option, path in zip(args, args[1:], strict=False)
            if option == '--params-file']


def chosen(names: Sequence[LineName], wanted: Sequence[str]) -> list[LineName]:
    """
    Return the lines that are wanted, by name or full name; all where nothing is.

    Raises ConfigurationError for a name that no section has, and where there is no line at all.
    """
    if not names:
        raise ConfigurationError([Problem(
            'arguments', 'no line to run: give a parameter file with a section for each, as in '
            '--ros-args --params-file lines.yaml; config/three_lines.yaml is an example')])
    if not wanted:
        return list(names)
    found = [name for name in names if name.name in wanted or str(name) in wanted]
    known = {text for name in found for text in (name.name, str(name))}
    if missing := [text for text in wanted if text not in known]:
        raise ConfigurationError([Problem(
            'parameter lines', f'no section is called {printable(", ".join(missing))}; there are '
            + printable(', '.join(map(str, names))))])
    return found


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the lines until SIGINT, SIGTERM or SIGHUP.

    Returns 0 after a signal, 2 when parameters are faulty or no line can run, 1 where ROS does
    not start for a reason that may pass.
    """
    return run_ros(NODE_NAME, make_parser(_USAGE, _HELP), _run, args)


def _run(given: Sequence[str], ended: threading.Event) -> int:
    if any(text.startswith(('__node:=', '__name:=', '__ns:=')) for text in given):
        raise ConfigurationError([Problem('arguments', (
            'the sections of the parameter file name the nodes; __node and __ns would give all '
            'of them one name'))])
    names = dict.fromkeys(name for path in parameter_files(given) for name in sections(path))
    node = LinesNode()
    lines = Lines(chosen([*names], node.wanted), node)
    lines.start(ended.is_set)
    running = sum(line.node is not None for line in lines.lines)
    node.get_logger().info(f'{running} of {len(lines.lines)} lines run')
    is_fit = running == len(lines.lines) if node.is_strict else running > 0
    if is_fit:
        lines.run(ended)
    status = 0 if is_fit or ended.is_set() else EXIT_CONFIGURATION
    if not lines.end():
        # To destroy what is left would take longer than whoever ends us may wait. Others find
        # these nodes gone when the lease of the participant is over.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    return status
