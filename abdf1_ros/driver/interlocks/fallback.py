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
Fallback values, which are written when messages no longer come (rules 7 to 12, 17 and 28).

The rules have the numbers of docs/heartbeats.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
import math

from abdf1_ros.driver.flights import Flight, Words
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.settings.heartbeats import LEAST_REFRESH
from abdf1_ros.settings.limits import raw_values

# Seconds after which a refused fallback value is written again.
_PAUSE_AFTER_REFUSAL = 1.0


class FallbackCause(Enum):
    """The reason why a fallback value is due (rule 17)."""

    TIMEOUT = 'timeout'
    START = 'start'
    RETURN = 'return'
    RUN = 'run'
    END = 'end'
    PUBLISHERS = 'publishers'


class FallbackState(Enum):
    """The known contents of the PLC for a row: a message, or the fallback."""

    MESSAGE = 'a message stands'
    DUE = 'the fallback value is due'
    STANDS = 'the fallback value stands'
    OVERWRITTEN = 'a guest has written over the fallback value'


@dataclass(frozen=True, slots=True)
class Crowd:
    """
    A topic has, or had, more than one publisher, and one of its rows allows one only (rule 28).

    Messages that were published up to ``until`` (clock value in s) are refused. It is infinite
    while more than one publisher is alive. ``why`` is the reason for the results, with names.
    """

    why: str
    until: float = math.inf


class FallbackRow:
    """
    One row with Fallback, and the known contents of the PLC.

    Times are clock values (s).

    - ``cause``: why the fallback is due, None if it is not.
    - ``refreshed``: when the last confirmed message was published.
    - ``sent``: when the fallback was last sent. A message that was published before that time is
      not sent any more.
    - ``due``: when to look at the row next.
    - ``has_failed``: the last message of the row that had the line was not confirmed.
    - ``refusal``: why the last write of the fallback was not confirmed.
    - ``words``: the writes that may change these words.
    - ``raw``: the fallback as the PLC gets it.
    - ``refused_until``: ``Crowd.until`` of the last crowd for which the fallback became due.
    """

    def __init__(self, words: Words) -> None:
        mapping = words.row
        assert mapping.fallback is not None
        self.mapping = mapping
        self.words = words
        self.after = mapping.fallback.after / 1000
        self.state = FallbackState.MESSAGE
        self.refreshed = -math.inf
        self.sent = -math.inf
        self.tried = -math.inf  # like ``sent``, but also set by ``refresh``
        self.tries = 0  # since the fallback became due
        self.due = math.inf
        self.cause: FallbackCause | None = None
        self.refusal = ''
        self.is_under_way = False
        # Fallback_After counts from the publication of the last confirmed message. After a
        # fallback it counts from the first message with an unknown outcome.
        self._counts_from = -math.inf
        self.has_failed = False
        self.refused_until = -math.inf
        self._values = mapping.fallback.values
        self.raw = raw_values(mapping, self._values)
        self._due_since = 0.0
        self._next_try = -math.inf
        # when to write it again, as a change may not have been seen (rule 8)
        self.refresh_at = math.inf

    @property
    def stands(self) -> bool:
        """Tell whether the PLC holds the fallback, and no message was sent after it."""
        return self.state is FallbackState.STANDS

    def make_due(self, cause: FallbackCause, now: float) -> None:
        """
        Make the fallback due at once; the first cause is reported.

        A download may have brought back the words of packets that went before a change to RUN. So
        a fallback that is under way is then written again.
        """
        if self.cause is None or self.is_under_way and cause is FallbackCause.RUN:
            self.cause, self._due_since = self.cause or cause, now
        self._due_since = min(self._due_since, now)  # a message may have set a later time
        self.state = FallbackState.DUE
        self._next_try = self.due = now

    def end(self, now: float) -> bool:
        """Make the fallback due at the end; return False if the PLC surely holds it already."""
        self.words.end(now)
        self.due = -math.inf
        is_due = not self.stands or self.words.lands_until > -math.inf
        if is_due:
            self.make_due(FallbackCause.END, now)
        return is_due

    @property
    def is_confirmed(self) -> bool:
        """Tell whether the PLC has confirmed it, and no second write is planned (rule 10)."""
        return self.stands and self.words.again_at == math.inf

    @property
    def is_first_try(self) -> bool:
        """Tell whether the fallback is due, or was written over, and was not sent since."""
        if self.state is FallbackState.OVERWRITTEN:
            return self.tried < self._due_since
        return self.cause is not None and self.sent < self._due_since

    @property
    def first_due(self) -> float:
        """Return when the next look at the row may find a first try (clock value in s)."""
        may_be = self.is_first_try or self.state is FallbackState.MESSAGE
        return self.due if may_be else math.inf

    def is_fresh(self, now: float) -> bool:
        """Tell whether a message younger than Fallback_After came after the last fallback."""
        return self.sent < self.refreshed and now < self.refreshed + self.after

    def deadline(self, youngest: float) -> float:
        """
        Return until when messages delay the fallback (clock value in s), infinite without one.

        ``youngest``: publication time of the youngest message that waits or is under way. It
        delays the fallback only while writes are confirmed. Otherwise a fast publisher whose
        messages the PLC refuses would delay the fallback for ever.
        """
        if self.state is not FallbackState.MESSAGE:
            return math.inf
        return self.after + (
            self._counts_from if self.has_failed else max(self._counts_from, youngest))

    def judge(self, now: float, youngest: float) -> bool:
        """Tell whether the fallback is to be written now; plan when to look again if it is not."""
        if self.state is FallbackState.MESSAGE and now >= self.deadline(youngest):
            self.make_due(FallbackCause.TIMEOUT, now)
        if self.is_under_way:
            self.due = math.inf
        elif self.state is FallbackState.DUE:
            self.due = max(self._due_since, self._next_try)
        elif self.state is FallbackState.OVERWRITTEN:
            self.due = self._next_try
        elif self.state is FallbackState.STANDS:
            self.due = self.words.again_at
        else:
            self.due = self.deadline(youngest)
        return self.due <= now

    def take(self, now: float) -> Write:
        """Return the write of the fallback; its end has to be reported to ``ended``."""
        if self.is_first_try:
            self.tries = 0
        self.sent = now
        return self.refresh(now)

    def refresh(self, now: float) -> Write:
        """Return the write of a fallback that the PLC holds already."""
        self.is_under_way, self.tried, self.tries = True, now, self.tries + 1
        self.due = math.inf
        return Write(self.mapping, self._values, now, is_own=True)

    def ended(self, outcome: Outcome, now: float) -> float | None:
        """
        Record how the write ended; return for how long (s) it was due, None for no report.

        The fallback is written once more as soon as no write that a gateway may hold can land any
        more (rule 10). It is also written again if it has become due since this write began.
        """
        self.is_under_way = False
        self.due = now
        if outcome is not Outcome.WRITTEN:
            refused = outcome in (Outcome.FAILED, Outcome.PARTLY)
            self._next_try = now + _PAUSE_AFTER_REFUSAL if refused else now
            self.refresh_at = now + _PAUSE_AFTER_REFUSAL
            self.words.try_again(self.refresh_at, now)
            return None
        self.refresh_at = now + max(self.after, LEAST_REFRESH)
        self.words.plan_again(self.tried)
        if self.cause is not None and self.tried < self._due_since:
            return None
        was_due, self.cause = self.cause is not None, None
        self.state = FallbackState.OVERWRITTEN if self.words.are_guests else FallbackState.STANDS
        return now - self._due_since if was_due else None

    def write_ended(self, flight: Flight, now: float) -> None:
        """Record how a message of this row, or a write of a guest to these words, ended."""
        if flight.write is not None:
            assert flight.outcome is not None
            self.message_ended(flight.write.requested, flight.outcome)
            if flight.outcome is Outcome.WRITTEN:
                # an unconfirmed message may have set a later time
                self._due_since = min(self._due_since, now)
        elif flight.has_changed and self.stands:
            if flight.extents is None:  # its words are unknown, hardly these
                self.refresh_at = now
            else:
                self.state = FallbackState.OVERWRITTEN
                self._due_since = self._next_try = now

    @property
    def why_held(self) -> str:
        """Return why no heartbeat of the station may count, empty if it may (rule 3 b)."""
        if self.state is FallbackState.OVERWRITTEN:
            return f'a guest has written over the fallback of {self.mapping.tag}'
        return f'the fallback of {self.mapping.tag} is not confirmed' if self.cause else ''

    def message_ended(self, requested: float, outcome: Outcome) -> None:
        """Record how a message that had the line ended (rule 7)."""
        self.due = -math.inf
        self.has_failed = outcome is not Outcome.WRITTEN
        if outcome is Outcome.WRITTEN:
            self._counts_from = self.refreshed = max(self.refreshed, requested)
        elif outcome in (Outcome.UNKNOWN, Outcome.PARTLY):
            if self.state in (FallbackState.STANDS, FallbackState.OVERWRITTEN):
                self._counts_from = requested
            elif self.state is FallbackState.DUE and not self.is_first_try:
                # The PLC may hold this message instead of the fallback, which it has not
                # confirmed.
                self._due_since = max(self._due_since, requested + self.after)
        else:
            return
        if self.state is not FallbackState.DUE:  # due until the PLC has confirmed it
            self.state = FallbackState.MESSAGE
