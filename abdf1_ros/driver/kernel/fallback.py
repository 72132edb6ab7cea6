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

from enum import Enum
import math
from typing import NamedTuple

from abdf1_ros.driver.kernel.flights import Flight, Words
from abdf1_ros.driver.kernel.own import Conditions, SelfWritten
from abdf1_ros.driver.write import Outcome, Write
from abdf1_ros.settings.heartbeats import LEAST_REFRESH
from abdf1_ros.settings.limits import raw_values

# Seconds after which a refused fallback value is written again.
_PAUSE_AFTER_REFUSAL = 1.0

_REFUSED = (Outcome.FAILED, Outcome.PARTLY)


class FallbackCause(Enum):
    """The reason why a fallback value is due (rule 17)."""

    TIMEOUT = 'timeout'
    START = 'start'
    RETURN = 'return'
    RUN = 'run'
    END = 'end'
    PUBLISHERS = 'publishers'


class Confirmed(NamedTuple):
    """A fallback has been confirmed: why it was due, and for how long (s)."""

    cause: FallbackCause
    seconds: float


class FallbackState(Enum):
    """The known contents of the PLC for a row: a message, or the fallback."""

    MESSAGE = 'a message stands'
    DUE = 'the fallback value is due'
    STANDS = 'the fallback value stands'
    OVERWRITTEN = 'a guest has written over the fallback value'


class FallbackRow(SelfWritten):
    """
    One row with Fallback.

    Times are clock values (s).

    - ``cause``: why the fallback is due, None if it is not.
    - ``refreshed``: when the last confirmed message was published.
    - ``sent``: when the fallback was last sent because it was due. A message that was published
      before that time is not sent any more.
    - ``has_failed``: the last message of the row that had the line was not confirmed.
    - ``raw``: the fallback as the PLC gets it.
    - ``refused_until``: ``Crowd.until`` of the last crowd for which the fallback became due.
    """

    def __init__(self, words: Words, conditions: Conditions) -> None:
        super().__init__(words, conditions)
        fallback = self.mapping.fallback
        assert fallback is not None
        self.after = fallback.after / 1000
        self.refreshed = -math.inf
        self.sent = -math.inf
        self.cause: FallbackCause | None = None
        # Fallback_After counts from the publication of the last confirmed message. After a
        # fallback it counts from the first message with an unknown outcome.
        self._counts_from = -math.inf
        self.has_failed = False
        self.refused_until = -math.inf
        self._values = fallback.values
        self.raw = raw_values(self.mapping, self._values)
        self._due_since = 0.0

    @property
    def state(self) -> FallbackState:
        """Return the known contents of the PLC."""
        if self.cause is not None:
            return FallbackState.DUE
        if not self.words.are_ours():
            return FallbackState.MESSAGE
        return FallbackState.OVERWRITTEN if self.words.are_guests else FallbackState.STANDS

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
        self.asked = now

    def end(self, now: float) -> bool:
        """Make the fallback due at the end; return False if the PLC surely holds it already."""
        is_due = not self.stands or self.words.lands_until > -math.inf
        if is_due:
            self.make_due(FallbackCause.END, now)
        return is_due

    @property
    def is_confirmed(self) -> bool:
        """Tell whether the PLC has confirmed it, and no second write is planned (rule 10)."""
        return self.stands and self.again_at == math.inf

    @property
    def is_first_try(self) -> bool:
        """Tell whether the fallback is due, or was written over, and was not sent since."""
        if self.cause is not None:
            return self.sent < self._due_since
        return self.tried < self._due_since and self.state is FallbackState.OVERWRITTEN

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

    def look(self, now: float, youngest: float) -> float:
        """Return from when on the fallback is to be written; infinite: an event is needed."""
        state = self.state
        if state is FallbackState.MESSAGE:
            if now < (deadline := self.deadline(youngest)):
                return deadline
            self.make_due(FallbackCause.TIMEOUT, now)
            state = FallbackState.DUE
        if self.is_under_way:
            return math.inf
        if state is FallbackState.STANDS:
            return self._again
        return max(self._due_since, self._next_try) if state is FallbackState.DUE \
            else self._next_try

    @property
    def _next_try(self) -> float:
        """Return when a fallback that is due, or overwritten, is tried: after a refusal later."""
        trial = self.trial
        if trial is not None and trial.outcome in _REFUSED and trial.done >= self.asked:
            return trial.done + _PAUSE_AFTER_REFUSAL
        return self.asked

    @property
    def _again(self) -> float:
        """Return when a fallback that stands is written again, not only refreshed (rule 10)."""
        again, failed = self.again_at, self._failed_at
        return again if failed < again < math.inf or failed == -math.inf \
            else failed + _PAUSE_AFTER_REFUSAL

    @property
    def _failed_at(self) -> float:
        """Return when the last write of a fallback that stands failed, -inf if it did not."""
        trial, last = self.trial, self.words.last
        has_failed = trial is not None and last is not None and trial.begun > last.begun
        return trial.done if trial is not None and has_failed else -math.inf

    @property
    def refresh_at(self) -> float:
        """Return when a fallback that stands is written again: a change may be unseen (8)."""
        last, failed = self.words.last, self._failed_at
        if failed > -math.inf:
            return failed + _PAUSE_AFTER_REFUSAL
        somewhere = self.words.guest_somewhere
        if somewhere > -math.inf:  # its words are unknown, hardly these
            return somewhere
        return (last.done if last is not None else -math.inf) + max(self.after, LEAST_REFRESH)

    def take(self, now: float) -> Write:
        """Return the write of a fallback that is due; its end has to be reported to ``ended``."""
        if self.is_first_try:
            self.tries = 0
        self.sent = now
        return self.refresh(now)

    def refresh(self, now: float) -> Write:
        """Return the write of a fallback that the PLC holds already."""
        self.tries += 1
        return Write(self.mapping, self._values, now, is_own=True)

    def ended(self, outcome: Outcome, now: float) -> Confirmed | None:
        """
        Record how a write of ours ended; return what it has confirmed, None for no report.

        It is written again if it has become due since this write began.
        """
        cause = self.cause
        if outcome is not Outcome.WRITTEN or cause is None or self.tried < self._due_since:
            return None
        self.cause = None
        return Confirmed(cause, now - self._due_since)

    def write_ended(self, flight: Flight, now: float) -> None:
        """Record how a message of this row, or a write of a guest to these words, ended."""
        if flight.write is not None:
            assert flight.outcome is not None
            self.message_ended(flight.write.requested, flight.outcome,
                               stood=self.words.are_ours(but=flight))
            if flight.outcome is Outcome.WRITTEN:
                # an unconfirmed message may have set a later time
                self._due_since = min(self._due_since, now)
        elif flight.has_changed and flight.extents is not None and self.has_confirmed \
                and self.state is FallbackState.OVERWRITTEN:
            self._due_since = self.asked = now

    @property
    def why_held(self) -> str:
        """Return why no heartbeat of the station may count, empty if it may (rule 3 b)."""
        if self.cause is not None:
            return f'the fallback of {self.mapping.tag} is not confirmed'
        if self.state is FallbackState.OVERWRITTEN:
            return f'a guest has written over the fallback of {self.mapping.tag}'
        return ''

    def message_ended(self, requested: float, outcome: Outcome, *, stood: bool = False) -> None:
        """Record how a message that had the line ended; the fallback ``stood`` before (7)."""
        self.has_failed = outcome is not Outcome.WRITTEN
        if outcome is Outcome.WRITTEN:
            self._counts_from = self.refreshed = max(self.refreshed, requested)
        elif outcome in (Outcome.UNKNOWN, Outcome.PARTLY):
            if self.cause is None:
                self._counts_from = requested if stood else self._counts_from
            elif not self.is_first_try:
                # The PLC may hold this message instead of the fallback, which it has not
                # confirmed.
                self._due_since = max(self._due_since, requested + self.after)
