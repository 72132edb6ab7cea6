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
Heartbeats: a word that we count up while all conditions hold (rules 1 to 6).

The numbers of rules are those of docs/heartbeats.md.
"""

from __future__ import annotations

from collections.abc import Mapping as MappingType
import math

from abdf1_ros.driver.points import Outcome, Write
from abdf1_ros.settings.mapping import Mapping

LARGEST = 32_767

_LEAST_LIFE_SIGN = 1.0  # s


class HeartbeatRow:
    """
    One Heartbeat row, and what the PLC holds of it.

    ``value`` was sent last; ``confirmed`` is the clock value (s) of the last reply that confirmed
    one. ``reason`` says why it does not count, empty while it does; ``is_held`` tells that the PLC
    has to get 0. ``refusal`` says why the last write was not confirmed.
    """

    def __init__(self, mapping: Mapping) -> None:
        assert mapping.heartbeat is not None
        assert mapping.period is not None
        self.mapping = mapping
        self.value = 0
        self.confirmed: float | None = None
        self.reason = ''
        self.refusal = ''
        self.is_held = False
        self.is_under_way = False
        self._period = mapping.period / 1000
        self._requires = mapping.heartbeat.requires
        self._requires_timeout = (mapping.heartbeat.requires_timeout or 0) / 1000
        self._is_confirmed = False
        self._must_begin = True  # 0 has to be confirmed before it counts (rule 2)
        self._next = -math.inf

    def why_not(self, now: float) -> str:
        """Return why the PLC has no heartbeat that counts, empty if it has, or may have."""
        if self.reason or self.confirmed is None:
            return self.reason or self.refusal or 'the PLC has not confirmed it yet'
        silent = now - self.confirmed
        why = f': {self.refusal}' if self.refusal else ''
        return f'not confirmed for {silent:.1f} s{why}' if silent > 3 * self._period else ''

    @property
    def is_at_rest(self) -> bool:
        """Tell whether the PLC has confirmed 0."""
        return self.value == 0 and self._is_confirmed

    def begin(self, now: float) -> None:
        """Start again with 0: the PLC may be another one by now (rule 2)."""
        self._must_begin, self._is_confirmed, self._next = True, False, now

    def missing(self, messages: MappingType[str, float], now: float) -> str:
        """
        Return the first topic without a message in time, empty for none (rule 3 d).

        ``messages`` tells when the last accepted message of each was published (clock value in s).
        """
        return next((topic for topic in self._requires
                     if now >= messages.get(topic, -math.inf) + self._requires_timeout), '')

    def topics_until(self, messages: MappingType[str, float]) -> float:
        """Return until when it may count by rule 3 (d) without a further message."""
        return min((messages.get(topic, -math.inf) + self._requires_timeout
                    for topic in self._requires), default=math.inf)

    def executor_until(self, executor: float) -> float:
        """Return until when it may count by rule 3 (c); ``executor`` is when that ran last."""
        return executor + max(self._period, _LEAST_LIFE_SIGN)

    def wants_zero(self, is_held: bool, now: float) -> bool:
        """Tell whether 0 is to be written now; ``is_held`` tells that it must not count."""
        if self.is_under_way or self.is_at_rest and not self._must_begin:
            return False
        return (self._must_begin or is_held) and (now >= self._next or self.value != 0)

    def wants_beat(self, now: float) -> bool:
        """Tell whether the next value is due."""
        return not self.is_under_way and not self._must_begin and now >= self._next

    def put_off(self, until: float) -> None:
        """Write nothing before that clock value (s)."""
        self._next = until

    def next_due(self, messages: MappingType[str, float]) -> float:
        """Return when it wants the line (clock value in s), infinite for never by itself."""
        if self.is_under_way or self.is_held and self.is_at_rest and not self._must_begin:
            return math.inf
        if self._must_begin or self.is_held or self.value == 0:
            return self._next
        return min(self._next, self.topics_until(messages))

    def take(self, now: float, is_zero: bool) -> Write:
        """Return the write of 0, or of the next value, which ends with ``ended``."""
        self.is_under_way = True
        if is_zero:
            self.value, self._is_confirmed = 0, False
        elif self._is_confirmed:  # otherwise the same value again (rule 3 a)
            self.value, self._is_confirmed = self.value % LARGEST + 1, False
        self._next = now + self._period
        return Write(self.mapping, [self.value], now)

    def ended(self, outcome: Outcome, now: float) -> None:
        """Take note how it ended."""
        self.is_under_way = False
        if outcome is not Outcome.WRITTEN:
            return
        self._is_confirmed, self.confirmed = True, now
        if self.value == 0 and self._must_begin:
            self._must_begin, self._next = False, now
