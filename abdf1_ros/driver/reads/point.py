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

"""The state of a row that reads, and the guard that may withhold its values."""

from __future__ import annotations

from abc import ABC, abstractmethod
from enum import Enum
import math

from abdf1_ros.pccc.values import Values
from abdf1_ros.settings.mapping import Mapping, Publish

# Relative allowance for rounding: 0.3 / 0.1 is a little less than 3.
_ROUNDING = 1e-9

# Weight of the newest interval in the usual interval.
SMOOTHING = 0.125


class Freshness(Enum):
    """The freshness of the last value of a point."""

    FRESH = 'fresh'
    LATE = 'late'
    STALE = 'stale'
    FAILED = 'failed'
    WITHHELD = 'withheld'
    WAITING = 'waiting for the first read'

    @property
    def is_usable(self) -> bool:
        """Tell whether the last value is still valid."""
        return self in (Freshness.FRESH, Freshness.LATE)


class _Changes:
    """Keeps values back that differ too little from the published ones (Publish Change)."""

    def __init__(self, mapping: Mapping) -> None:
        scale = 1.0 if mapping.scaling is None else abs(mapping.scaling.scale)
        self._deadband = (mapping.deadband or 0.0) / scale * (1 + _ROUNDING)
        silence = mapping.max_silence
        self._max_silence = math.inf if silence is None else silence / 1000
        self._published: Values | None = None
        self._published_at = -math.inf

    def keeps_back(self, values: Values, now: float, *, is_due: bool) -> bool:
        """Tell whether values are kept back: nothing has changed, and Max_Silence is not over."""
        if not is_due and now - self._published_at < self._max_silence \
                and not self._is_change(values):
            return True
        self._published, self._published_at = values, now
        return False

    def forget(self) -> None:
        """Let the next values count as changed."""
        self._published = None

    def _is_change(self, values: Values) -> bool:
        """Tell whether any value differs from the published one by more than the deadband."""
        before = self._published
        # Compare bytes of values: other bits of the same words are not a change, and a NaN equals
        # itself.
        if before is None or _content(values) == _content(before):
            return before is None
        if not self._deadband or isinstance(values, str) or isinstance(before, str):
            return True
        return not all(abs(new - old) <= self._deadband
                       for new, old in zip(values, before, strict=True))


class ReadPoint:
    """
    The state of one row that reads.

    A value is late if it is older than one and a half periods and older than half of
    ``stale_time``. It is stale if it is older than ``stale_time``.

    - ``period``, ``stale_time``: in seconds.
    - ``raw``: values of the last good read, as the PLC has them.
    - ``interval``: seconds between the last two good reads, None if a failed or withheld read was
      between them.
    - ``kept``: usual interval (s), None before it is known. A single long interval does not count,
      as when the port was left to another program.
    - ``error``: why the last read gave no value.
    - ``withheld``: why its value was not published; ``withheld_since``: since when (clock value,
      s).
    - ``withholdings``: how often values were withheld.
    - ``guard``: the guard of the row, if it has one; ``patience``: greatest allowed age (s) of the
      state that its condition depends on.
    """

    def __init__(self, mapping: Mapping, period: float, stale_time: float,
                 guard: Guard | None = None) -> None:
        self.mapping = mapping
        self.period = period
        self.stale_time = stale_time
        self.raw: Values | None = None
        self.last_good: float | None = None
        self.interval: float | None = None
        self.kept: float | None = None
        self.error: str | None = None
        self.failures = 0
        self.guard = guard
        self.withheld = ''
        self.withheld_since = 0.0
        self.withholdings = 0
        self._is_told = False
        timeout = mapping.condition.timeout if mapping.condition else None
        self.patience = stale_time if timeout is None else timeout / 1000
        if guard is not None:
            guard.add(self)
        self._decode = mapping.codec.decoder()
        self._scaling = mapping.scaling
        self._usual_age = min(max(1.5 * period, stale_time / 2), stale_time)
        is_on_change = mapping.publish is Publish.CHANGE
        self._changes = _Changes(mapping) if is_on_change else None

    def update(self, words: bytes, now: float) -> Values | None:
        """
        Take the words of a good read; return the values to publish, or None when unchanged.

        Raises FormatError when the words are no value of the mapping's type.
        """
        values = self._decode(words)
        is_same = self._changes is not None and self._changes.keeps_back(
            values, now, is_due=self.error is not None)
        before, self.interval = self.interval, None
        if self.last_good is not None and self.error is None and not self.withheld:
            self.interval = now - self.last_good
            if before is not None:
                least = before if before < self.interval else self.interval
                self.kept = least if self.kept is None else \
                    self.kept + SMOOTHING * (least - self.kept)
        if self.withheld and self.guard is not None:
            self.guard.withheld.discard(self)
        self.raw = values  # before its time, which other threads look at first
        self.last_good, self.error, self.withheld = now, None, ''
        if is_same:
            return None
        return values if self._scaling is None else self._published(values)

    def forget_published(self) -> None:
        """Publish the next value even if it has not changed: the topic may be a new one."""
        if self._changes is not None:
            self._changes.forget()

    @property
    def values(self) -> Values | None:
        """Return the values of the last good read, in the unit of the topic."""
        return None if self.raw is None else self._published(self.raw)

    def values_of(self, words: bytes) -> Values:
        """Return the values of words, as they are published."""
        return self._published(self._decode(words))

    def _published(self, values: Values) -> Values:
        if self._scaling is None or isinstance(values, str):
            return values
        return self._scaling.publish(values)

    def fail(self, error: str) -> bool:
        """Record that a read gave no value; return True if the reason is new."""
        is_news = error != self.error
        if self.guard is not None:
            self.guard.withheld.discard(self)
        self.error = error
        self.failures += 1
        return is_news

    def withhold(self, reason: str, now: float) -> bool:
        """
        Record that a value is withheld; return True, once for each cause, to report it.

        At the start no condition holds yet. That is reported only after ``patience``: the stale
        time for RUN, While_Timeout for a counter.
        """
        if not self.withheld:
            self.withheld_since, self._is_told = now, False
        self.withheld, self.error = reason, None
        is_start = self.last_good is None and now - self.withheld_since < self.patience
        is_news = not self._is_told and not is_start
        if is_news:
            self._is_told = True
            self.withholdings += 1
        if self._is_told and self.guard is not None:
            self.guard.withheld.add(self)
        return is_news

    @property
    def is_withheld(self) -> bool:
        """Tell whether its values are withheld, and this has been reported."""
        return bool(self.withheld) and self._is_told and self.error is None

    def is_due(self, now: float, block_period: float) -> bool:
        """
        Tell whether a read made now is for this point.

        Its block is read every ``block_period`` seconds, more often than its Period asks.
        """
        if self.last_good is None or self.error is not None:
            return True
        return now - self.last_good >= self.period - 0.5 * block_period

    def age(self, now: float) -> float | None:
        """Return the seconds since the last good read, None before the first."""
        return None if self.last_good is None else now - self.last_good

    def freshness(self, now: float) -> Freshness:
        """Judge the last value."""
        if self.error is not None:
            return Freshness.FAILED
        if self.is_withheld:
            return Freshness.WITHHELD
        if self.mapping.is_on_demand:
            return Freshness.FRESH
        if self.last_good is None:
            return Freshness.WAITING if self.stale_time < math.inf else Freshness.FRESH
        age = now - self.last_good
        if age <= self._usual_age:
            return Freshness.FRESH
        return Freshness.STALE if age > self.stale_time else Freshness.LATE


def _content(values: Values) -> bytes | str:
    return values if isinstance(values, str) else values.tobytes()


class Guard(ABC):
    """
    One condition of a station, and the ``points`` that may be published while it holds.

    ``withheld`` are the points that are withheld and reported.
    """

    def __init__(self) -> None:
        self.points: list[ReadPoint] = []
        self.withheld: set[ReadPoint] = set()
        # From when on the condition holds (clock value in s), by the patience of points.
        self._since: dict[float, float] = {}

    def add(self, point: ReadPoint) -> None:
        """Take a point that depends on the condition."""
        self.points.append(point)
        self._since[point.patience] = math.inf

    @abstractmethod
    def why_not(self, point: ReadPoint, started: float, now: float) -> str:
        """Return why a value whose read began at ``started`` is withheld, empty if it is not."""
