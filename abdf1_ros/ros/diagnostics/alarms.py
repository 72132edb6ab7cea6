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
Statuses of alarms: bits of the PLC that mean a fault of the plant.

If a bit was an alarm only between two statuses, the next status still shows it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from abdf1_ros.driver.reads.point import ReadPoint
from abdf1_ros.pccc.values import Values
from abdf1_ros.ros.diagnostics.mappings import FRESHNESS_LEVELS
from abdf1_ros.ros.diagnostics.status import ERROR, Judgement, OK, WARN
from abdf1_ros.settings.alarms import AlarmLevel
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.text import age_text, counted, first

_LEVELS = {AlarmLevel.WARN: WARN, AlarmLevel.ERROR: ERROR}


@dataclass(slots=True)
class Bit:
    """
    One bit of an alarm row, and its history.

    - ``name``: its name, or its address
    - ``is_on``: the bit is an alarm now
    - ``since``: clock value (s) of its last change; None if it never changed
    - ``times``: how often the alarm began
    - ``reads``: in how many reads it was an alarm
    - ``judged``, ``told``: ``reads`` when it was judged last, and as a status has shown it
    """

    name: str
    is_on: bool = False
    since: float | None = None
    times: int = 0
    reads: int = 0
    judged: int = 0
    told: int = 0

    def take(self, is_on: bool, now: float) -> None:
        """Record whether the bit, as read at ``now``, is an alarm."""
        if is_on is not self.is_on:
            self.is_on, self.since = is_on, now
            self.times += is_on
        self.reads += is_on

    def judge(self) -> bool:
        """Return True if the bit is an alarm, or was one since the last status."""
        self.judged = self.reads
        return self.is_on or self.judged > self.told

    def text(self, now: float) -> str:
        """Return the history of the bit as a text."""
        if self.since is None:
            return 'never'
        times = counted(self.times, 'time')
        return f'for {age_text(self.since, now)}, {times}' if self.is_on else \
            f'{times}, gone {age_text(self.since, now)} ago'


class AlarmStatus:
    """The status of one row with an alarm; ``point`` knows how fresh its bits are."""

    def __init__(self, point: ReadPoint, port: str) -> None:
        mapping = self._mapping = point.mapping
        assert mapping.alarm is not None
        self.name = f'alarm {mapping.tag}'
        self.hardware_id = port
        self._alarm = mapping.alarm
        self._point = point
        self._bits = [*map(Bit, mapping.named_places())]

    def take(self, values: Values, now: float) -> None:
        """Record the values of a good read."""
        for bit, value in zip(self._bits, values, strict=True):
            bit.take(value == self._alarm.state, now)

    def judge(self, now: float) -> Judgement:
        state = self._point.freshness(now)
        if not state.is_usable:
            return FRESHNESS_LEVELS[state], f'unknown: its row is {state.value}{self._description}'
        shown = [f'{bit.name} {bit.text(now)}' for bit in self._bits if bit.judge()]
        if not shown:
            return OK, f'no alarm{self._description}'
        return _LEVELS[self._alarm.level], f'{first(shown)}{self._description}'

    @property
    def _description(self) -> str:
        return f': {self._mapping.description}' if self._mapping.description else ''

    def values(self, now: float) -> dict[str, str]:
        return {bit.name: bit.text(now) for bit in self._bits}

    def forget(self) -> None:
        """Forget alarms that are over: a status has shown all that were judged."""
        for bit in self._bits:
            bit.told = bit.judged


class Alarms:
    """The statuses of all rows with an alarm; ``read`` runs in the thread of the link."""

    def __init__(self, points: Iterable[ReadPoint], port: str,
                 clock: Callable[[], float]) -> None:
        self._clock = clock
        self._by_mapping = {point.mapping: AlarmStatus(point, port) for point in points
                            if point.mapping.alarm is not None}

    @property
    def statuses(self) -> Sequence[AlarmStatus]:
        return [*self._by_mapping.values()]

    def read(self, mapping: Mapping, values: Values) -> None:
        """Record the values of a good read, if the row has an alarm."""
        if status := self._by_mapping.get(mapping):
            status.take(values, self._clock())

    def forget(self) -> None:
        """Forget alarms that are over, in all rows: the statuses have shown them."""
        for status in self._by_mapping.values():
            status.forget()
