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

"""Offer topics and services: a spare does this only while it has the line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

from abdf1_ros.ros.bridge.session import BridgeSession, Surroundings
from rclpy.callback_groups import CallbackGroup
from rclpy.executors import await_or_execute
from rclpy.service import Service as Offered


class Service(NamedTuple):
    """A service of the node; ``stays``: kept while the port is released, to take the port back."""

    name: str
    kind: type
    answer: Callable[..., object]
    group: CallbackGroup | None = None
    stays: bool = False


class Standby:
    """
    Makes and closes the topics and services of the bridge; the session has the map's topics.

    If the bridge is a spare, call ``look`` ten times a second.
    """

    def __init__(self, surroundings: Surroundings, session: Callable[[], BridgeSession],
                 services: Sequence[Service]) -> None:
        self._surroundings = surroundings
        self._session = session
        self._services = services
        self._publishers = (
            surroundings.results, surroundings.active_stations, surroundings.snapshot)
        self._made: dict[Service, Offered] = {}
        self._calls: list[Service] = []  # the service of each call that has no answer yet
        self._is_changing = self._is_half = False

    def offer(self) -> None:
        """Make all topics and services except the map's."""
        self._surroundings.is_offered = True
        for publisher in self._publishers:
            publisher.offer()
        for service in self._services:
            if service not in self._made:
                self._made[service] = self._surroundings.node.create_service(
                    service.kind, service.name, partial(self._answer, service),
                    callback_group=service.group)

    async def _answer(self, service: Service, request: object, response: object) -> object:
        self._calls.append(service)
        try:
            return await await_or_execute(service.answer, request, response)
        finally:
            self._calls.remove(service)

    def look(self) -> None:
        """
        Begin to offer if the bridge has got the line; begin to wait if it has lost the line.

        After a released port is taken back, a bridge without the line closes its last services.
        """
        executor = self._surroundings.node.executor
        if not self._is_changing and self._step() is not None and executor is not None:
            self._is_changing = True
            executor.create_task(self._change)

    def _step(self) -> Callable[[], None] | None:
        """Return the change that is due."""
        if self._is_half:
            return self.leave_line
        has_line, is_offered = self._session().has_line, self._surroundings.is_offered
        if has_line is not is_offered:
            return self._take_line if has_line else self.leave_line
        return self._close if not is_offered and self._to_close() else None

    def _change(self) -> None:
        """
        Make the change that is due now; if it fails, the next look closes all that was made.

        The executor may come to it late, as during a reload, when a new connection was heard.
        """
        seen = self._session().events.seen
        try:
            if (step := self._step()) is not None:
                step()
                self._is_half = False
            if self._step() is None:  # else the take-over is tried again
                seen.take_over_fault = ''
        except Exception as error:
            self._is_half, self._surroundings.is_offered = True, False
            seen.take_over_fault = repr(error)
            raise
        finally:
            self._is_changing = False

    def _take_line(self) -> None:
        """Offer everything: the bridge has the line."""
        self.offer()
        self._session().offer()
        self._surroundings.log.notes.info(
            'the line', 'has got the line: begins to publish and to accept writes')

    def leave_line(self) -> None:
        """Withdraw all but the services that ``stays`` keeps: another bridge may have the line."""
        if not self._is_half:
            self._surroundings.log.notes.warning(
                'the line', 'has lost the line: waits, and offers no topics and services')
        self._surroundings.is_offered = False
        self._session().withdraw()
        for publisher in self._publishers:
            publisher.withdraw()
        self._close()

    def _close(self) -> None:
        """Close services; ``look`` closes all others later."""
        for service in self._to_close():
            self._surroundings.node.destroy_service(self._made.pop(service))

    def _to_close(self) -> list[Service]:
        """Return the services without a caller that do not have to take a released port back."""
        keeps = self._surroundings.link.is_released
        return [service for service in self._made
                if service not in self._calls and not (service.stays and keeps)]
