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
The services of rows: ~/set/<topic> writes a bit, ~/read_now/<topic> reads a row at once.

A call of ~/set is handled like a message to the write topic, with the same rules and result. A
callback never blocks the executor while it waits for the link (rule 3 c of docs/heartbeats.md).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
import math
import time
import uuid

from abdf1_ros.driver.driver import Driver, ENDS
from abdf1_ros.driver.reads.demands import ReadAnswer
from abdf1_ros.driver.write import Outcome, WriteResult
from abdf1_ros.pccc.values import Values, ValueType
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ros.callbacks import AnsweringNode
from abdf1_ros.ros.topics.writes import WriteTopics
from abdf1_ros.ros.untyped import RosMessage
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.rows import Rows
from abdf1_ros.text import printable, utc_text, value_text
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.qos import QoSProfile
from rclpy.service import Service
from rclpy.task import Future
from std_msgs.msg import MultiArrayDimension, MultiArrayLayout, UInt8MultiArray
from std_srvs.srv import SetBool, Trigger

MOST_CALLS = 100
"""Most waiting calls; more calls are refused, because each call slows down every turn of rclpy."""

# The queue needs room for calls that arrive at the same moment. Unused places take no memory.
_DEPTH = 1000

_TOO_MANY = f'{MOST_CALLS} calls wait already'
_GONE = 'the map has no such row any more'


class _Call:
    """A call that waits for ``count`` results, at the longest until a clock value (s)."""

    def __init__(self, count: int, until: float, wake: Callable[[], None]) -> None:
        self.results: list[WriteResult | ReadAnswer] = []
        self.until = until
        self.done = Future()
        self._count = count
        self._wake = wake

    def take(self, result: WriteResult | ReadAnswer) -> None:
        """Take a result, in any thread."""
        self.results.append(result)
        if len(self.results) == self._count:
            self.end()

    def end(self) -> None:
        """Let the callback continue, with the results that have arrived."""
        if not self.done.done():
            self.done.set_result(None)
            self._wake()


class RowServices:
    """
    All services of rows.

    - ``take``, ``end``: may be called in any thread
    - ``look``: is called ten times a second, always by the same thread
    - all other methods: only in the thread of the executor
    - ``wake_executor``: makes the executor continue calls that have their results
    """

    def __init__(self, node: AnsweringNode, writes: WriteTopics,
                 wake_executor: Callable[[], None]) -> None:
        self._node = node
        self._writes = writes
        self._wake_executor = wake_executor
        self._group = ReentrantCallbackGroup()
        self._services: dict[str, Service] = {}
        self._retired: dict[str, Service] = {}
        self._rows: dict[str, tuple[Mapping, ...]] = {}
        self.calls: dict[str, _Call] = {}

    def open(self, driver: Driver, most: int, patience: float,  # noqa: A003
             wake_link: Callable[[], None]) -> None:
        """
        Offer the services of the rows of a driver; keep those that exist already.

        A retired service that still waits for calls is kept, too: two services of one name would
        both execute the next call.
        """
        self._driver, self._wake_link = driver, wake_link
        network = driver.network
        # A write waits for the line, and may then wait to be read back. A transaction follows each
        # wait.
        self._longest = 2 * (patience + network.line_mode.longest_transaction(
            network.line, 0.0, stations=len(driver.mappings.stations)))
        self._rows = {} if network.line_mode.only_listens \
            else dict(_offered(driver.mappings, most))
        self._retire()
        for name in self._rows:
            if name in self._retired:
                self._services[name] = self._retired.pop(name)
            elif name not in self._services:
                kind, answer = (SetBool, self._set) if name.startswith('~/set/') \
                    else (Trigger, self._read)
                self._services[name] = self._node.create_service(
                    kind, name, partial(answer, name), callback_group=self._group,
                    qos_profile=QoSProfile(depth=_DEPTH))

    def withdraw(self) -> None:
        """Answer all calls; ``look`` closes all services once no call waits."""
        self._rows = {}
        self.end()
        self._retire()

    def end(self) -> None:
        """Answer all calls now: no more results come from the link."""
        for call in [*self.calls.values()]:
            call.end()

    def take(self, result: WriteResult) -> None:
        """Hand the result of a write to the call that waits for it, if any."""
        if call := self.calls.get(result.request):
            call.take(result)

    def look(self, now: float) -> None:
        """End calls that have waited too long; close retired services once no call waits."""
        for call in [*self.calls.values()]:
            if now >= call.until:
                call.end()
        if self._retired and not self.calls and self._node.executor is not None:
            self._node.executor.create_task(self._close_retired)

    def _retire(self) -> None:
        """Mark services without a row; they are closed once all calls are answered."""
        self._retired |= {name: self._services.pop(name) for name in [*self._services]
                          if name not in self._rows}

    def _close_retired(self) -> None:
        retired, self._retired = self._retired, {}
        for service in retired.values():
            self._node.destroy_service(service)

    async def _set(self, name: str, request: SetBool.Request,
                   response: SetBool.Response) -> SetBool.Response:
        """Write a bit as a message to the write topic does, and answer with the result."""
        rows = self._rows.get(name, ())
        published, received = self._node.call_stamps
        until = line_time() + self._longest
        if (call := self._new(len(rows), until, response)) is None:
            return response
        # The label is unique: no publisher uses the same one.
        with self._waiting(f'set {uuid.uuid4()}', call) as label:
            self._writes.take(rows[0].topic, UInt8MultiArray(
                layout=MultiArrayLayout(dim=[MultiArrayDimension(label=label)]),
                data=[int(request.data)]), {
                    'source_timestamp': published, 'received_timestamp': received,
                    'publication_sequence_number': None}, is_call=True)
            await call.done
        results = [result for result in call.results if isinstance(result, WriteResult)]
        response.success = len(results) == len(rows) and all(
            result.outcome in (Outcome.WRITTEN, Outcome.STANDS) for result in results)
        response.message = '; '.join(
            printable(str(result) if len(rows) == 1 else f'{result.mapping.tag}: {result}')
            for result in results) or f'{Outcome.UNKNOWN.value}: no result has come'
        return response

    async def _read(self, name: str, request: Trigger.Request,
                    response: Trigger.Response) -> Trigger.Response:
        """Read a row at once, publish it, and answer with its values."""
        rows = self._rows.get(name, ())
        # the driver ends the call in time
        if (call := self._new(len(rows), math.inf, response)) is None:
            return response
        with self._waiting(f'read {uuid.uuid4()}', call):
            self._driver.read_now(rows[0], call.take)
            self._wake_link()
            await call.done
        answer = next((result for result in call.results if isinstance(result, ReadAnswer)),
                      ReadAnswer(error=ENDS))
        response.success = answer.values is not None
        response.message = printable(answer.error) if answer.values is None else \
            f'{_text(answer.values)} at {_moment(answer.read)}'
        return response

    @contextmanager
    def _waiting(self, label: str, call: _Call) -> Iterator[str]:
        """Let a call wait under a label, until its results have come or an error ends it."""
        self.calls[label] = call
        try:
            yield label
        finally:
            del self.calls[label]

    def _new(self, count: int, until: float, response: RosMessage) -> _Call | None:
        """Return a call that waits for ``count`` results; None if it is refused."""
        if not count or len(self.calls) >= MOST_CALLS:
            response.message = f'refused: {_TOO_MANY if count else _GONE}'
            return None
        return _Call(count, until, self._wake_executor)


def _offered(mappings: Rows, most: int) -> Iterator[tuple[str, tuple[Mapping, ...]]]:
    """
    Yield the services of a map, and the rows of each.

    A row on demand always has its ~/read_now service. All ~/set services are offered if they are
    at most ``most``, otherwise none. All ~/read_now services of other rows are offered if,
    together with the ~/set services, they are at most ``most``.
    """
    bits: dict[str, tuple[Mapping, ...]] = {}
    for row in mappings.messages:
        if row.type is ValueType.BOOL and row.length == 1:
            name = f'~/set/{row.topic}'
            bits[name] = (*bits.get(name, ()), row)
    yield from _reading(mappings.on_demand).items()
    for services in (bits, _reading(Rows(row for row in mappings.repeated if row.polls))):
        most -= len(services)
        if most >= 0:
            yield from services.items()


def _reading(mappings: Rows) -> dict[str, tuple[Mapping, ...]]:
    return {f'~/read_now/{row.topic}': (row,) for row in mappings}


def _text(values: Values) -> str:
    if isinstance(values, str):
        return printable(values)
    texts = [value_text(value) for value in values]
    return texts[0] if len(texts) == 1 else f'[{", ".join(texts)}]'


def _moment(read: float) -> str:
    """Return a clock value (s) as a time in UTC."""
    return utc_text(time.time() - line_time() + read)
