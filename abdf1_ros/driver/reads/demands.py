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
Reads on demand: each call ends in one answer, and all calls of one row share one read.

A row that is read periodically is due at once. A row with Period "on demand" has a read of its own
as long as a call waits for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
import math

from abdf1_ros.driver.inbox import Inbox
from abdf1_ros.pccc.values import Values
from abdf1_ros.settings.mapping import Mapping


@dataclass(frozen=True, slots=True)
class ReadAnswer:
    """The ``values`` of a reply that came at ``read`` (clock, s), or the ``error``."""

    values: Values | None = None
    read: float = -math.inf
    error: str = ''


@dataclass(frozen=True, slots=True, eq=False)
class ReadCall:
    """A call for the values of a row, from a read that begins after the call."""

    mapping: Mapping
    answer: Callable[[ReadAnswer], None]


class ReadCalls:
    """
    The calls that wait for a read, for ``patience`` s plus the longest time of the read.

    ``inbox`` takes calls from any thread. All else belongs to the link thread. ``waiting`` has the
    calls of each row, each with two clock values (s): when the link thread took it, and until when
    it waits. ``next_expiry`` is not later than any of these ends.
    """

    def __init__(self, patience: float) -> None:
        self.inbox: Inbox[ReadCall] = Inbox(is_open=False)
        self.waiting: dict[Mapping, list[tuple[float, float, ReadCall]]] = {}
        self.next_expiry = math.inf
        self._patience = patience

    def add(self, demand: ReadCall, now: float, longest: float) -> None:
        """Let a call wait for a read that takes ``longest`` s at most."""
        until = now + self._patience + longest
        self.waiting.setdefault(demand.mapping, []).append((now, until, demand))
        self.next_expiry = min(self.next_expiry, until)

    def settle(self, mapping: Mapping, answer: ReadAnswer, started: float) -> None:
        """Answer the calls for a row that were taken before its read ``started`` (clock, s)."""
        self._end(mapping, answer, lambda taken, until: taken <= started)

    def fail(self, mappings: Iterable[Mapping], error: str) -> None:
        """Answer all calls for some rows with an error."""
        for mapping in mappings:
            self._end(mapping, ReadAnswer(error=error), lambda taken, until: True)

    def expire(self, now: float) -> None:
        """Answer the calls that have waited too long."""
        answer = ReadAnswer(error=f'not read in time: no turn on the line for {self._patience:g} '
                                  's, or the read was broken off')
        for mapping in [*self.waiting]:
            self._end(mapping, answer, lambda taken, until: now >= until)
        self.next_expiry = min((until for calls in self.waiting.values() for _, until, _ in calls),
                               default=math.inf)

    def close(self, error: str) -> None:
        """Answer all calls: there is no port."""
        for demand in self.inbox.close():
            demand.answer(ReadAnswer(error=error))
        self.fail([*self.waiting], error)

    def _end(self, mapping: Mapping, answer: ReadAnswer,
             is_over: Callable[[float, float], bool]) -> None:
        calls = self.waiting.pop(mapping, ())
        if kept := [call for call in calls if not is_over(*call[:2])]:
            self.waiting[mapping] = kept
        for taken, until, demand in calls:
            if is_over(taken, until):
                demand.answer(answer)
