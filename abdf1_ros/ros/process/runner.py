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
Run bridges until the process ends: one bridge for ``node``, many for ``lines``.

Each bridge has a thread for its link and a thread for its callbacks; the main thread checks all
bridges. With one executor for a hundred nodes, each message would take 17 ms, and meanwhile all
links would wait. With an executor for each line, a message takes 1.3 ms (`many_lines.py` of
test/lab).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import itertools
import time

from abdf1_ros.ros.bridge.node import BridgeNode, end_together
from abdf1_ros.ros.callbacks import Callbacks
from abdf1_ros.ros.process.refusals import EXIT_FAULT
from abdf1_ros.ros.process.supervisor import Supervisor, Works
from abdf1_ros.signals import EndRequest

# Seconds between two checks of a line; a check publishes a changed level at once.
_LEVEL_CHECK_PERIOD = 0.1

# Number of groups of lines; the groups are checked in turn. A check of a hundred lines in one go
# would hold the GIL for a tenth of a second, and their links would wait.
_GROUPS = 10

# Longest wait (s) at the end for callbacks that still run.
_LAST_CALLBACKS = 0.5


class LinkFailed(Exception):
    """The link of a bridge is broken; the argument says how, and has been logged."""


class Line:
    """
    A bridge with the thread of its callbacks.

    One thread calls all methods. ``node`` is None while the bridge does not run.
    """

    def __init__(self, node: BridgeNode | None = None,
                 callbacks: Callbacks | None = None) -> None:
        self.node = node
        self._callbacks = callbacks

    def take_callbacks(self) -> None:
        """Begin to run callbacks, if there is a node."""
        if self.node is not None:
            self._callbacks = Callbacks(self.node)
            self._callbacks.start()

    def open_port(self) -> None:
        """Open the port and begin to read and write, if there is a node."""
        if self.node is not None:
            self.node.start()

    def check(self) -> None:
        """Publish what is due; raises LinkFailed, or the error that has ended the callbacks."""
        if self.node is None:
            return
        if self.node.has_failed:
            raise LinkFailed(self.node.link.state.text)
        if self._callbacks is not None and self._callbacks.error is not None:
            raise self._callbacks.error
        self.node.check()

    def threads(self) -> list[Works]:
        """Return the threads that the supervisor of the process has to watch."""
        if self.node is None or self._callbacks is None:
            return []
        return [self.node.link, self._callbacks]

    def end_callbacks(self, give_up: float) -> None:
        """Run no more callbacks; wait for a running one, at most to a monotonic clock value."""
        if self._callbacks is not None:
            self._callbacks.end(give_up)

    def close(self) -> None:
        """End this line only."""
        if self.node is not None:
            end_together([self.node])
        self.end_callbacks(time.monotonic() + _LAST_CALLBACKS)
        self.destroy()

    def destroy(self) -> None:
        """Destroy the node, unless a callback still uses it."""
        is_used = self._callbacks is not None and self._callbacks.is_alive()
        if self.node is not None and not is_used:
            self.node.destroy_node()


class Runner:
    """Runs all lines of a process; ``look`` is called ten times a second."""

    def __init__(self, lines: Sequence[Line], look: Callable[[], None] = lambda: None) -> None:
        self._lines = lines
        self._look = look

    def run(self, ended: EndRequest) -> int:
        """
        Run all lines until the end; return the exit status.

        All nodes exist before the first line starts. Running lines hold the GIL most of the time.
        While lines ran, a hundred nodes took four times as long to make, and their threads 1.5
        times as long to start. The threads of callbacks start late too, because each new node
        would wake them all.
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
        """Destroy all nodes, unless a callback still uses them."""
        for line in self._lines:
            line.destroy()
