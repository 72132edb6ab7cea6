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

"""A node that observes other nodes, for tests, the demo and the monitor."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from contextlib import ExitStack, suppress
import os
import socket
import time
from typing import Self, TypeVar

from abdf1_ros.ros.untyped import RosEntity
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.logging import get_logger
from rclpy.node import Node, NodeNameNonExistentError

_Result = TypeVar('_Result')

_LOG = get_logger('observer')


def claim_domain() -> tuple[int, socket.socket]:
    """
    Return a ROS domain for tests or a demo, and the socket that keeps it until it is closed.

    No other test session or demo on this machine has this domain. Raises RuntimeError if all 100
    domains are claimed.
    """
    claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    for number in range(os.getpid(), os.getpid() + 100):
        with suppress(OSError):  # another process has it
            # an abstract name, without a file
            claim.bind(f'\0abdf1_ros.test.domain.{1 + number % 100}')
            return 1 + number % 100, claim
    raise RuntimeError('all ROS domains are in use by other test sessions and demos')


def graph_hint() -> str:
    """
    Return why we may not see topics of other nodes; empty if we know no reason.

    A client of a discovery server learns only of endpoints that match its own endpoints.
    """
    is_client = os.environ.get('ROS_DISCOVERY_SERVER') \
        and os.environ.get('ROS_SUPER_CLIENT', '').upper() != 'TRUE'
    return '; ROS_DISCOVERY_SERVER is set: set ROS_SUPER_CLIENT=TRUE too' if is_client else ''


class _PatientExecutor(SingleThreadedExecutor):
    """Passes over a message that rclpy cannot take, for example one that DDS has damaged."""

    def _take_subscription(self, sub: RosEntity) -> Callable[[], Awaitable[None]] | None:
        try:
            return super()._take_subscription(sub)  # type: ignore[no-any-return, no-untyped-call]
        except RuntimeError as error:
            _LOG.warning(f'a message on {sub.topic_name} cannot be taken: {error}', once=True)
            return None


class ObservingNode:
    """
    A node with an executor of its own; nodes that are added to the executor run too.

    Without ``context``, it makes a context from ``args``, and ends it too. If ``is_quiet``, the
    node has no services and no /rosout.
    """

    def __init__(self, name: str, context: Context | None = None, args: Sequence[str] = (),
                 is_quiet: bool = False) -> None:
        self._owns_context = context is None
        self.context = context or Context()
        if self._owns_context:
            self.context.init(args=[*args])
        self.node = Node(name, context=self.context, enable_rosout=not is_quiet,
                         start_parameter_services=not is_quiet)
        self.executor = _PatientExecutor(context=self.context)
        self.executor.add_node(self.node)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        """
        End the executor, then the node, then the context, even if one of these steps fails.

        Until its shutdown the executor has a wait set with the parts of its nodes. So the executor
        ends before rclpy destroys these parts. One race remains, inside Fast DDS 2.14: its
        discovery thread may use the listener of a deleted reader (issue 3303 of Fast DDS).
        """
        with ExitStack() as stack:
            if self._owns_context:
                stack.callback(self.context.try_shutdown)
            stack.callback(self.node.destroy_node)
            stack.callback(self.executor.shutdown)
            for node in self.executor.get_nodes():
                self.executor.remove_node(node)

    def spin_once(self, seconds: float) -> None:
        """Take one message, or wait at most ``seconds``."""
        self.executor.spin_once(timeout_sec=seconds)

    def published(self, name: str) -> list[tuple[str, list[str]]] | None:
        """Return the topics that the node ``name`` publishes, and types; None if not known yet."""
        namespace, _, base = name.rpartition('/')
        try:
            return self.node.get_publisher_names_and_types_by_node(base, namespace or '/')
        except NodeNameNonExistentError:
            return None

    def wait(self, condition: Callable[[], _Result | None], seconds: float) -> _Result | None:
        """Spin until ``condition`` returns a true value, or for ``seconds``; return the value."""
        end = time.monotonic() + seconds
        while not (result := condition()) and (left := end - time.monotonic()) > 0:
            self.spin_once(min(left, 0.05))
        return result
