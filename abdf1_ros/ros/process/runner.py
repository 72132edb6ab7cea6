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
What runs bridges until the end of their process: ``node`` has one, ``lines`` many.

Each has two threads, for its link and for its callbacks, and the main thread looks after all. One
executor for all would need 17 ms for every message to a hundred nodes, in which no link gets on
(`many_lines.py` of test/lab); an executor a line needs 1.3 ms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import itertools
import time

from abdf1_ros.ros.bridge.node import BridgeNode, end_together
from abdf1_ros.ros.callbacks import Callbacks
from abdf1_ros.ros.process.main import EXIT_FAULT
from abdf1_ros.ros.process.supervisor import Supervisor, Works
from abdf1_ros.signals import EndRequest

# How often (s) levels are compared, so that a change of one is published at once.
_LEVEL_CHECK_PERIOD = 0.1

# Lines are looked at in so many groups, one after the other: to look at a hundred at once would
# keep the interpreter lock from their links for a tenth of a second.
_GROUPS = 10

# How long (s) callbacks that run are waited for at the end.
_LAST_CALLBACKS = 0.5


class LinkFailed(Exception):
    """The link of a bridge is broken; the argument says how, and the log has it."""


class Line:
    """
    A bridge with the thread of its callbacks.

    All is called by one thread. ``node`` is None while it does not run.
    """

    def __init__(self, node: BridgeNode | None = None,
                 callbacks: Callbacks | None = None) -> None:
        self.node = node
        self._callbacks = callbacks

    def take_callbacks(self) -> None:
        """Begin to take callbacks, if there is a node."""
        if self.node is not None:
            self._callbacks = Callbacks(self.node)
            self._callbacks.start()

    def open_port(self) -> None:
        """Begin to read and write, if there is a node."""
        if self.node is not None:
            self.node.start()

    def check(self) -> None:
        """Publish what is due; raises LinkFailed, and why no callbacks can be taken any more."""
        if self.node is None:
            return
        if self.node.has_failed:
            raise LinkFailed(self.node.link.state.text)
        if self._callbacks is not None and self._callbacks.error is not None:
            raise self._callbacks.error
        self.node.check()

    def threads(self) -> list[Works]:
        """Return what has to go on, for the supervisor of the process."""
        if self.node is None or self._callbacks is None:
            return []
        return [self.node.link, self._callbacks]

    def end_callbacks(self, give_up: float) -> None:
        """Take no more callbacks; wait for one that runs up to a monotonic clock value."""
        if self._callbacks is not None:
            self._callbacks.end(give_up)

    def close(self) -> None:
        """End the line, alone."""
        if self.node is not None:
            end_together([self.node])
        self.end_callbacks(time.monotonic() + _LAST_CALLBACKS)
        self.destroy()

    def destroy(self) -> None:
        """Destroy the node, if it is no longer used."""
        is_used = self._callbacks is not None and self._callbacks.is_alive()
        if self.node is not None and not is_used:
            self.node.destroy_node()


class Runner:
    """All lines of a process; ``look`` is called ten times a second."""

    def __init__(self, lines: Sequence[Line], look: Callable[[], None] = lambda: None) -> None:
        self._lines = lines
        self._look = look

    def run(self, ended: EndRequest) -> int:
        """
        Run all lines until the end; return the exit status.

        All nodes have been made before: lines that run would have the interpreter lock most of the
        time that the others need: a hundred nodes took four times as long, and their threads half
        as long again. Threads that take callbacks would wake up at each node that is made.
        """
        try:
            for line in self._lines:
                line.take_callbacks()
            for line in self._lines:
                line.open_port()
            self._look_after(ended)
        except LinkFailed:
            return EXIT_FAULT
        finally:
            ended.set()
            end_together([line.node for line in self._lines if line.node is not None])
            give_up = time.monotonic() + _LAST_CALLBACKS
            for line in self._lines:
                line.end_callbacks(give_up)
        return 0

    def _look_after(self, ended: EndRequest) -> None:
        supervisor = Supervisor()
        groups = min(_GROUPS, len(self._lines))
        for group in itertools.cycle(range(groups)):
            if ended.wait(_LEVEL_CHECK_PERIOD / groups):
                return
            for line in self._lines[group::groups]:
                line.check()
            if group == 0:
                self._look()
                supervisor.look([thread for line in self._lines for thread in line.threads()])

    def destroy(self) -> None:
        """Destroy all nodes that are no longer used."""
        for line in self._lines:
            line.destroy()
