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

"""The two ends of a mapping: the point that is read, and the write that is to be done."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import Enum
import math

from abdf1_ros.df1.packet import is_local_status
from abdf1_ros.errors import FormatError, LinkError, RemoteError
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.dialect import Dialect
from abdf1_ros.pccc.steps import write_requests
from abdf1_ros.pccc.values import Values, ValueType
from abdf1_ros.settings.limits import raw_values
from abdf1_ros.settings.mapping import Mapping, Publish
from abdf1_ros.text import value_text

_SHOWN_VALUES = 16
_SHOWN_CHARACTERS = 100  # more than a PLC string has


class Freshness(Enum):
    """How good the last value of a point is."""

    FRESH = 'fresh'
    LATE = 'late'
    STALE = 'stale'
    FAILED = 'failed'
    WITHHELD = 'withheld'
    WAITING = 'waiting for the first read'


class ReadPoint:
    """
    What is known about one mapping that reads.

    ``period`` and ``stale_time`` are in seconds. A value is late when it is older than one and a
    half periods and older than half of ``stale_time``; it is stale when older than ``stale_time``.
    ``interval`` is the seconds between the last two good reads, None if a failed one was between
    them. ``error`` says why the last read gave no value, ``withheld`` why its value was not
    published. Values are withheld since ``withheld_since`` (clock value in s), and this is the
    ``withholdings``-th time. ``guard`` decides that, where the row has one; what its condition
    rests on may be as old as ``patience``, in seconds.
    """

    def __init__(self, mapping: Mapping, period: float, stale_time: float) -> None:
        self.mapping = mapping
        self.period = period
        self.stale_time = stale_time
        self.last_good: float | None = None
        self.interval: float | None = None
        self.error: str | None = None
        self.failures = 0
        self.guard: Guard | None = None
        self.withheld = ''
        self.withheld_since = 0.0
        self.withholdings = 0
        self._is_told = False
        timeout = mapping.publish_while.timeout if mapping.publish_while else None
        self.patience = stale_time if timeout is None else timeout / 1000
        self._decode = mapping.codec.decoder()
        self._scaling = mapping.scaling
        self._usual_age = min(max(1.5 * period, stale_time / 2), stale_time)
        self._is_on_change = mapping.publish is Publish.CHANGE
        self._published: bytes | str | None = None

    def update(self, words: bytes, now: float) -> Values | None:
        """
        Take the words of a good read; return the values to publish, or None when unchanged.

        Raises FormatError when the words are no value of the mapping's type.
        """
        values = self._decode(words)
        is_same = self._is_on_change and not self._is_change(values) and self.error is None
        if self.withheld and self.guard is not None:
            self.guard.withheld.discard(self)
        if self.last_good is not None:
            self.interval = now - self.last_good if self.error is None else None
        self.last_good, self.error, self.withheld = now, None, ''
        if is_same:
            return None
        return values if self._scaling is None else self._scaling.publish(values)

    def _is_change(self, values: Values) -> bool:
        """Remember values; return whether they differ from the last ones."""
        # Compare bytes of values: other bits of the same words are not a change, and a NaN equals
        # itself.
        content = values if isinstance(values, str) else values.tobytes()
        is_change: bool = content != self._published
        self._published = content
        return is_change

    def fail(self, error: str) -> bool:
        """Take note that a read gave no value; return whether the reason is a new one."""
        is_news = error != self.error
        if self.guard is not None:
            self.guard.withheld.discard(self)
        self.error = error
        self.failures += 1
        return is_news

    def withhold(self, reason: str, now: float) -> bool:
        """
        Take note that a value is not published; return whether that is to be told, once a cause.

        At the start nothing holds; that is told when it has had its time to begin.
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
        """Tell whether its values are read and not published, and that has been told."""
        return bool(self.withheld) and self._is_told and self.error is None

    def is_due(self, now: float, block_period: float) -> bool:
        """
        Tell whether a read that is made now is for this point.

        Its block is read every ``block_period`` seconds, more often than it wants.
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
        if self.last_good is None:
            return Freshness.WAITING
        age = now - self.last_good
        if age <= self._usual_age:
            return Freshness.FRESH
        return Freshness.STALE if age > self.stale_time else Freshness.LATE


class Guard:
    """
    One condition of a station, and the ``points`` whose values may be published while it holds.

    ``withheld`` are those of them that are withheld, which has been told.
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
        point.guard = self

    def why_not(self, point: ReadPoint, started: float, now: float) -> str:
        """Return why a value read from ``started`` on is not to be published, empty if it is."""
        raise NotImplementedError


class Outcome(Enum):
    """How a write ended."""

    WRITTEN = 'written'
    BROADCAST = 'sent to all stations; nobody confirms a broadcast'
    SUPERSEDED = 'not written: superseded by a newer value'
    REFUSED = 'not written: refused'
    NOT_SENT = 'not written: not sent'
    FAILED = 'not written: the PLC refused it'
    PARTLY = 'only partly written'
    UNKNOWN = 'unknown whether written'
    FALLBACK = 'fallback value written'


@dataclass(frozen=True, slots=True)
class WriteResult:
    """
    The one result of one write to one mapping.

    ``detail`` is empty for a write that went well; that of an unconfirmed one says what a read has
    found afterwards, or why there was none. ``latency`` is seconds from the request. ``request``
    is what the requester calls it. ``packets_done`` of its packets were confirmed before ``error``
    ended it.
    """

    mapping: Mapping
    outcome: Outcome
    detail: str
    value: str
    latency: float
    request: str = ''
    packets_done: int = 0
    error: LinkError | RemoteError | None = field(default=None, compare=False)

    @property
    def is_unconfirmed(self) -> bool:
        """Tell whether the PLC may have executed a packet that it has not confirmed."""
        if isinstance(self.error, RemoteError):
            return is_local_status(self.error.sts)
        return self.error is not None and self.error.sent

    def __str__(self) -> str:
        """Return outcome and detail."""
        return f'{self.outcome.value}: {self.detail}' if self.detail else self.outcome.value


class Write:
    """
    Values on their way to one mapping.

    Raises FormatError, saying what is wrong, when they cannot or must not be written.
    ``value`` is their text, ``raw`` is what the PLC gets, ``commands`` are the requests that write
    it. ``is_probe`` tells that the station was inactive when the write got the line, ``is_own``
    that no message has asked for it. ``request`` goes into the result.
    """

    def __init__(self, mapping: Mapping, values: Sequence[float] | str, now: float,
                 request: str = '') -> None:
        self.mapping = mapping
        self.request = request
        self.requested = now
        self.is_probe = self.is_own = False
        self.value = show(values)
        self.raw = raw_values(mapping, values)
        self.commands = write_requests(
            mapping.address, mapping.codec, self.raw, mapping.dialect)

    def speak(self, dialect: Dialect) -> None:
        """Keep to the packets of another dialect of the family, before anything has been sent."""
        if dialect is not self.mapping.dialect:
            self.commands = write_requests(
                self.mapping.address, self.mapping.codec, self.raw, dialect)

    @property
    def may_rewrite(self) -> bool:
        """Tell whether bits may be changed by writing back their word after a refusal."""
        processor = self.mapping.processor
        return self.is_pulse and processor is not None and processor.may_lack_masked_write

    def bit_change(self, packet: int) -> tuple[Address, int, int]:
        """Return word, mask and bits of a packet that changes bits."""
        assert not isinstance(self.raw, str)
        return self.mapping.codec.bit_changes(self.mapping.address, self.raw)[packet]

    @property
    def is_pulse(self) -> bool:
        """Tell whether each write counts by itself, not only the newest."""
        return self.mapping.type is ValueType.BOOL

    def overlaps(self, other: Write) -> bool:
        """Tell whether both write to the same words, or to bits of them."""
        return self.mapping.extent.meets(other.mapping.extent)

    def is_held(self, words: bytes) -> bool:
        """Tell whether the mapping's ``words`` hold the values of this write."""
        codec = self.mapping.codec
        if isinstance(self.raw, str) or self.is_pulse:
            try:
                held = codec.decode(words)
            except FormatError:
                return False
            return held == self.raw if isinstance(held, str) else [*held] == [*self.raw]
        return words == codec.encode(self.raw)

    def result(self, outcome: Outcome, detail: str, now: float, packets_done: int = 0,
               error: LinkError | RemoteError | None = None) -> WriteResult:
        """Return how this write ended."""
        return WriteResult(self.mapping, outcome, detail, self.value, now - self.requested,
                           self.request, packets_done, error)


def show(values: Sequence[float] | str) -> str:
    """Return values as text for people, cut short when there are many."""
    if isinstance(values, str):
        rest = len(values) - _SHOWN_CHARACTERS
        more = f' and {rest} more characters' if rest > 0 else ''
        return repr(values[:_SHOWN_CHARACTERS]) + more
    text = ', '.join(map(value_text, values[:_SHOWN_VALUES]))
    rest = len(values) - _SHOWN_VALUES
    return f'[{text}, and {rest} more]' if rest > 0 else f'[{text}]'
