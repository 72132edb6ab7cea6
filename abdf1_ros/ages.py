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
The age of a message, as far as clocks can be trusted (rule 7 of docs/heartbeats.md).

The time stamp comes from the clock of the publisher. An old message looks new in three cases: the
publisher's clock is ahead, our clock was set back, or this process was stopped while the message
waited.
"""

from __future__ import annotations

from collections.abc import Iterable
import math

from abdf1_ros.errors import FormatError
from abdf1_ros.settings.mapping import Mapping

# A stamp may be ahead by this many seconds, or by a quarter of the time after which a fallback or
# a 0 is written.
MOST_AHEAD = 0.2
_SHARE = 4

# A clock that was ahead is remembered for at least this many seconds, and for at most twice as
# many.
REMEMBERED = 5.0

# Longest time (s) between two looks of a running process. While it has run for less than _DRAINED
# seconds after a longer pause, messages that come may have waited during the whole pause.
_LOOKS = 0.25
_DRAINED = 0.5


def most_ahead(topic: str, mappings: Iterable[Mapping]) -> float | None:
    """Return by how much (s) stamps may be ahead, None without a fallback or heartbeat."""
    times = [mapping.fallback.after for mapping in mappings
             if mapping.fallback and mapping.topic == topic]
    times += [mapping.condition.timeout or 0 for mapping in mappings
              if mapping.is_heartbeat and mapping.condition and topic in mapping.condition.names]
    return min([MOST_AHEAD, *(after / 1000 / _SHARE for after in times)]) if times else None


class RecentMax:
    """
    The ``greatest`` number of the last ``seconds``, or of at most twice that time.

    Old numbers are forgotten only when a new number is added.
    """

    def __init__(self, seconds: float) -> None:
        self.seconds = seconds
        self._since = -math.inf
        self._earlier = self._latest = -math.inf

    @property
    def greatest(self) -> float:
        return max(self._latest, self._earlier)

    def add(self, number: float, now: float) -> float:
        """Take a number at a clock value (s); return the greatest."""
        if now >= self._since + self.seconds:
            self._earlier, self._latest, self._since = self._latest, -math.inf, now
        self._latest = max(self._latest, number)
        return self.greatest


class HostClock:
    """
    Tells when this process stood still, and by how much its clock was set back.

    One thread calls ``look`` ten times a second, so pauses without messages count as well.
    ``offsets``: how far this clock was ahead of the clock that is never set (s).
    """

    def __init__(self, patience: float) -> None:
        self.offsets = RecentMax(patience)
        self._looked = math.inf
        self._ran = 0.0  # without pauses
        self._pauses: list[tuple[float, float]] = []  # length, and ``_ran`` until which it counts

    def look(self, now: float, wall: float) -> None:
        """Take the values (s) of the clock that is never set, and of the clock of stamps."""
        self._see_pause(now)
        self.offsets.add(wall - now, now)

    def _see_pause(self, now: float) -> None:
        took, self._looked = now - self._looked, now
        if took <= _LOOKS:
            self._ran += max(0.0, took)
            return
        self._pauses = [*((length, until) for length, until in self._pauses
                          if length > took and self._ran < until), (took, self._ran + _DRAINED)]

    def least_age(self, now: float) -> float:
        """Return the age (s) that a message received now may have, whatever its stamp."""
        self._see_pause(now)
        return max((length for length, until in self._pauses if self._ran < until), default=0.0)


class Ages:
    """
    The ages of the messages of one topic, which have to be younger than ``patience`` (s).

    Stamps may be ahead by ``allowed`` s; None where no fallback or heartbeat depends on them.
    ``lead`` is by how much stamps were ahead lately (s). ``leads`` remembers it for ``REMEMBERED``
    s, also over a reload, which changes no clock of a publisher.
    """

    def __init__(self, patience: float, host_clock: HostClock, allowed: float | None,
                 leads: RecentMax | None = None) -> None:
        self._patience = patience
        self._host_clock = host_clock
        self._allowed = allowed
        self._leads = leads or RecentMax(REMEMBERED)
        self.lead = 0.0

    @property
    def is_ahead(self) -> bool:
        """Tell whether the clock of a publisher is ahead."""
        return self.lead > (MOST_AHEAD if self._allowed is None else self._allowed)

    def of(self, stamps: Iterable[float], wall: float, now: float) -> float:
        """
        Return the age (s) of a message with these times of publication and reception (s).

        ``wall`` is the present time of the clock that stamps are compared with, ``now`` the time
        of a clock that is never set. Raises FormatError if the message is too old, or if its age
        is unknown.
        """
        ages = [wall - stamp for stamp in stamps]
        ahead = -min([0.0, *ages])
        self.lead = max(0.0, self._leads.add(ahead, now))
        behind = max(0.0, self._host_clock.offsets.greatest - (wall - now))  # it was set back
        least = self._host_clock.least_age(now)
        waited = max([0.0, *ages])
        if self._allowed is not None:
            waited = max([least, *(age + behind for age in ages)])
        if waited >= self._patience:
            raise FormatError(
                f'it came {waited:.1f} s after it was published, write_timeout is '
                f'{self._patience:g} s; the network is slow, this node stood still or had '
                'just begun, or the clocks differ')
        if self._allowed is not None and self.lead > self._allowed:
            raise FormatError(
                f'time stamps of this topic were {self.lead:.2f} s ahead of the clock here, '
                f'{self._allowed:g} s are allowed where a fallback value or a heartbeat depends '
                'on it; the clocks differ, so its age is unknown')
        if ahead > self._patience:
            raise FormatError(
                f'its time stamp is {ahead:.1f} s ahead of the clock here, write_timeout is '
                f'{self._patience:g} s; the clocks differ, so its age is unknown')
        return waited
