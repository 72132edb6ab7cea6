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

"""A node that looks at others: what tests, the demo and the monitor have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
import os
import time
from typing import Any, Self, TypeVar

from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node, NodeNameNonExistentError

_Result = TypeVar('_Result')


def graph_hint() -> str:
    """
    Return why the topics of other nodes may not be seen, empty where nothing is known.

    A client of a discovery server learns only of the endpoints that match its own.
    """
    is_client = os.environ.get('ROS_DISCOVERY_SERVER') \
        and os.environ.get('ROS_SUPER_CLIENT', '').upper() != 'TRUE'
    return '; ROS_DISCOVERY_SERVER is set: set ROS_SUPER_CLIENT=TRUE too' if is_client else ''


class Observer:
    """
    A node with an executor of its own; it also runs nodes that are added to that.

    It ends a context that it has made of ``args``. ``options`` are the node's.
    """

    def __init__(self, name: str, context: Context | None = None, args: Sequence[str] = (),
                 **options: Any) -> None:
        self._owns_context = context is None
        self.context = context or Context()
        if self._owns_context:
            self.context.init(args=[*args])
        self.node = Node(name, context=self.context, **options)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        """
        End what spins, then the node, then the context, whatever fails on the way.

        The executor keeps a wait set with what its nodes have until it is shut down; rclpy should
        not have to take away what something still waits for. What is left is a race of Fast DDS
        2.14 with its own thread of discovery, which finds the listener of a reader gone (issue
        3303 there).
        """
        with ExitStack() as stack:
            if self._owns_context:
                stack.callback(self.context.try_shutdown)
            stack.callback(self.node.destroy_node)
            stack.callback(self.executor.shutdown)
            for node in self.executor.get_nodes():
                self.executor.remove_node(node)

    def spin_once(self, seconds: float) -> None:
        """Take one message, or wait so long."""
        self.executor.spin_once(timeout_sec=seconds)

    def published(self, name: str) -> list[tuple[str, list[str]]] | None:
        """Return what the node ``name`` publishes, with types; None where it is not known yet."""
        namespace, _, base = name.rpartition('/')
        try:
            return self.node.get_publisher_names_and_types_by_node(base, namespace or '/')
        except NodeNameNonExistentError:
            return None

    def wait(self, condition: Callable[[], _Result | None], seconds: float) -> _Result | None:
        """Spin until ``condition`` gives something true, or so long; return what it gives."""
        end = time.monotonic() + seconds
        while not (result := condition()) and (left := end - time.monotonic()) > 0:
            self.spin_once(min(left, 0.05))
        return result
