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
Callbacks of a node: a bad message or call from outside never ends the node or its line.

If rclpy or one of our callbacks fails on a message or a call, only this callback ends, with an
entry in the log. A call that fails is still answered.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
import threading
import time
import traceback
from typing import TypedDict, Unpack

from abdf1_ros.ros.diagnostics.log import LimitedLog
from abdf1_ros.ros.untyped import RosEntity, RosMessage, RosType
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import CallbackGroup
from rclpy.context import Context
from rclpy.executors import (
    await_or_execute,
    ShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
)
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_services_default, QoSProfile
from rclpy.service import Service

# An executor that fails while it waits for callbacks tries again after a pause (s).
# ``_MOST_FAILED_WAITS`` failures in a row end the executor.
_MOST_FAILED_WAITS = 3
_PAUSE = 0.1


def failure_text(error: BaseException) -> str:
    """Return an exception in one line, with the place where it was raised."""
    place = traceback.extract_tb(error.__traceback__)[-1:]
    return repr(error) + ''.join(f' in {frame.filename}:{frame.lineno}' for frame in place)


class NodeOptions(TypedDict, total=False):
    """The options of a node of rclpy that we use."""

    automatically_declare_parameters_from_overrides: bool
    cli_args: list[str]
    context: Context
    namespace: str
    parameter_overrides: list[Parameter]
    use_global_arguments: bool


class AnsweringNode(Node):
    """
    A node whose services answer each call: without success if the callback fails.

    When a callback begins, ``call_stamps`` has the times when its call was sent and received (ns);
    0 means unknown.
    """

    def __init__(self, name: str, **options: Unpack[NodeOptions]) -> None:
        super().__init__(name, **options)
        self.call_stamps = 0, 0
        self._failures = LimitedLog(self.get_logger(), time.monotonic)

    def create_service(self, srv_type: RosType, srv_name: str, callback: Callable[..., object], *,
                       qos_profile: QoSProfile = qos_profile_services_default,
                       callback_group: CallbackGroup | None = None) -> Service:
        """Create a service; rclpy uses this method for the services of parameters too."""
        async def answer(request: RosMessage, response: RosMessage) -> RosMessage:
            try:
                return await await_or_execute(callback, request, response)
            except Exception as error:  # a call from outside caused it
                self.tell_failure(f'a call of {srv_name}', error)
                return _refusal(srv_type, request, f'refused: {error!r}')

        return super().create_service(srv_type, srv_name, answer, qos_profile=qos_profile,
                                      callback_group=callback_group)

    def tell_failure(self, what: str, error: BaseException) -> None:
        """Log that a message, a call, a periodic check or a status has failed."""
        self._failures.error('what comes from outside', (
            f'{what} has failed, all else goes on: {failure_text(error)}'))


def _refusal(srv_type: RosType, request: RosMessage, reason: str) -> RosMessage:
    """Return the response to a failed call, with the reason if the type has a field for it."""
    response = srv_type.Response()
    if hasattr(response, 'message'):
        response.message = reason
    elif hasattr(response, 'result') and hasattr(response.result, 'reason'):
        response.result.reason = reason
    elif hasattr(response, 'results'):
        response.results = [SetParametersResult(reason=reason) for _ in request.parameters]
    return response


class Executor(SingleThreadedExecutor):
    """
    Runs callbacks of ``node``; if a callback fails, only this callback ends.

    ``spin_once`` raises an error only if it cannot wait for callbacks at all.
    """

    def __init__(self, node: AnsweringNode) -> None:
        super().__init__(context=node.context)
        self._node = node
        self.add_node(node)

    def spin_once(self, timeout_sec: float | None = None) -> None:
        entity: RosEntity
        try:
            handler, entity, _ = self.wait_for_ready_callbacks(timeout_sec)
        except (ShutdownException, TimeoutException):
            return
        handler()
        if (error := handler.exception()) is not None:
            _give_back(entity)
            name = getattr(entity, 'srv_name', None) or getattr(entity, 'topic_name', None)
            self._node.tell_failure(f'a message on {name}' if name else 'a callback', error)

    def _take_service(self, srv: RosEntity) -> Callable[[], Awaitable[None]] | None:
        """Take a call as rclpy does, but keep its stamps for the callback."""
        try:
            with srv.handle:
                request, header = srv.handle.service_take_request(srv.srv_type.Request)
        except rclpy_implementation.InvalidHandle:
            return None

        async def execute() -> None:
            if header is None:
                return
            self._node.call_stamps = header.source_timestamp, header.received_timestamp
            response = await await_or_execute(srv.callback, request, srv.srv_type.Response())
            srv.send_response(response, header)
        return execute


def _give_back(entity: RosEntity) -> None:
    """Let the executor wait for an entity again: rclpy does not, if a take has failed."""
    if entity is not None and entity._executor_event:  # noqa: SLF001
        entity._executor_event = False  # noqa: SLF001
        entity.callback_group.ending_execution(entity)


class Callbacks(threading.Thread):
    """Runs the callbacks of a node until ``end``, or until an error of the executor: ``error``."""

    def __init__(self, node: AnsweringNode) -> None:
        super().__init__(name='callbacks', daemon=True)
        self.error: Exception | None = None
        self.has_turned = True
        self._ends = False
        self._executor = Executor(node)

    def run(self) -> None:
        """Run callbacks."""
        failures = 0
        while not self._ends and failures < _MOST_FAILED_WAITS:
            try:
                self._executor.spin_once()
                failures = 0
            except Exception as error:  # an error must not end the lines of other bridges
                failures += 1
                if failures == _MOST_FAILED_WAITS:
                    self.error = error
                time.sleep(_PAUSE)

    def wake(self) -> None:
        """Queue a callback that sets ``has_turned``."""
        self._executor.create_task(setattr, self, 'has_turned', True)

    def end(self, give_up: float) -> None:
        """Run no more callbacks; wait for a running one, at most to a monotonic clock value."""
        self._ends = True
        self.wake()
        if self.is_alive():
            self.join(max(0.0, give_up - time.monotonic()))
        if not self.is_alive():  # a living thread may wait on objects that a shutdown destroys
            self._executor.shutdown()
