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
Fallback values: what is written when messages no longer come (rules 7 to 12 and 17).

The numbers of rules are those of docs/heartbeats.md.
"""

from __future__ import annotations

from enum import Enum
import math

from abdf1_ros.driver.record import Claim, OwnWords
from abdf1_ros.driver.write import Outcome, Write

# A fallback value that the PLC refuses is written again after so many seconds.
_PAUSE_AFTER_REFUSAL = 1.0

# One that stands is written again after so many seconds at least (rule 8).
_LEAST_REFRESH = 5.0


class FallbackCause(Enum):
    """Why a fallback value is due (rule 17)."""

    TIMEOUT = 'timeout'
    START = 'start'
    RETURN = 'return'
    RUN = 'run'
    END = 'end'


class FallbackState(Enum):
    """What the PLC holds of a row: a message, or the fallback, as far as one knows."""

    MESSAGE = 'a message stands'
    DUE = 'the fallback value is due'
    STANDS = 'the fallback value stands'
    OVERWRITTEN = 'a guest has written over the fallback value'


class FallbackRow:
    """
    One row with Fallback, and what the PLC holds of it.

    ``cause`` says why the fallback is due, None where it is not. ``refreshed`` is when the last
    confirmed message was published, ``sent`` when the fallback was last sent: a message published
    before that is not sent any more. ``due`` is when the row has to be looked at. All are clock
    values (s). ``has_failed`` tells that a message has ended otherwise since the last that was
    confirmed. ``refusal`` says why the last write of the fallback was not confirmed. ``words``
    tells what others may have written.
    """

    def __init__(self, words: OwnWords) -> None:
        mapping = words.row
        assert mapping.fallback is not None
        self.mapping = mapping
        self.words = words
        self.after = mapping.fallback.after / 1000
        self.state = FallbackState.MESSAGE
        self.refreshed = -math.inf
        self.sent = -math.inf
        self.tried = -math.inf  # like ``sent``, also when it is written again
        self.tries = 0  # since it became due
        self.due = math.inf
        self.cause: FallbackCause | None = None
        self.refusal = ''
        self.is_under_way = False
        # From when the time counts: the last confirmed message, or, after a fallback, the first
        # whose outcome is unknown.
        self._counts_from = -math.inf
        self.has_failed = False
        self._values = mapping.fallback.values
        self._due_since = 0.0
        self._next_try = -math.inf
        self.refresh_at = math.inf  # for what was not seen (rule 8)

    @property
    def stands(self) -> bool:
        """Tell whether the PLC holds the fallback, and no message was sent since."""
        return self.state is FallbackState.STANDS

    def make_due(self, cause: FallbackCause, now: float) -> None:
        """Make the fallback due at once; the first cause is the one that is reported."""
        if self.cause is None:
            self.cause, self._due_since = cause, now
        self._due_since = min(self._due_since, now)  # a message may have put it off
        self.state = FallbackState.DUE
        self._next_try = self.due = now

    def end(self, now: float) -> None:
        """Take note that there is an end: write it unless nothing else can stand any more."""
        self.words.end(now)
        self.due = -math.inf
        if not self.stands or self.words.lands_until > -math.inf:
            self.make_due(FallbackCause.END, now)

    @property
    def is_confirmed(self) -> bool:
        """Tell whether nothing is left to be written of what is due."""
        is_left = self.stands and self.words.again_at < math.inf
        return self.cause is None and self.state is not FallbackState.OVERWRITTEN and not is_left

    @property
    def is_first_try(self) -> bool:
        """Tell whether the fallback is due, or written over, and was not sent since."""
        if self.state is FallbackState.OVERWRITTEN:
            return self.tried < self._due_since
        return self.cause is not None and self.sent < self._due_since

    @property
    def first_due(self) -> float:
        """Return when the next look at it may find a first try (clock value in s)."""
        may_be = self.is_first_try or self.state is FallbackState.MESSAGE
        return self.due if may_be else math.inf

    def is_fresh(self, now: float) -> bool:
        """Tell whether the last confirmed message is young enough."""
        return now < self.refreshed + self.after

    def deadline(self, youngest: float) -> float:
        """
        Return when the fallback becomes due (clock value in s), infinite for never.

        ``youngest`` is when the youngest message was published that waits or is under way. It is
        waited for while all goes well: there is always one where they come faster than the PLC
        refuses them.
        """
        if self.state is FallbackState.DUE:
            return self._due_since
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
        """Return the write of the fallback, which ends with ``ended``."""
        if self.is_first_try:
            self.tries = 0
        self.sent = now
        return self.refresh(now)

    def refresh(self, now: float) -> Write:
        """Return the write of a fallback that stands already."""
        self.is_under_way, self.tried, self.tries = True, now, self.tries + 1
        return Write(self.mapping, self._values, now)

    def ended(self, outcome: Outcome, now: float) -> float | None:
        """
        Take note how it ended; return the seconds that it was due, None where none is reported.

        It is written once more when nothing that a gateway may hold can land any more (rule 10),
        and where it has become due since this write began.
        """
        self.is_under_way = False
        self.due = now
        if outcome is not Outcome.WRITTEN:
            refused = outcome in (Outcome.FAILED, Outcome.PARTLY)
            self._next_try = now + _PAUSE_AFTER_REFUSAL if refused else now
            self.refresh_at = now + _PAUSE_AFTER_REFUSAL
            self.words.try_again(self.refresh_at, now)
            return None
        self.refresh_at = now + max(self.after, _LEAST_REFRESH)
        self.words.plan_again(self.tried)
        if self.cause is not None and self.tried < self._due_since:
            return None
        was_due, self.cause = self.cause is not None, None
        self.state = FallbackState.OVERWRITTEN if self.words.are_guests else FallbackState.STANDS
        return now - self._due_since if was_due else None

    def write_ended(self, claim: Claim, now: float) -> None:
        """Take note how a write to these words ended, of a message or a guest."""
        if claim.write is not None:
            if claim.write.mapping is self.mapping and not claim.write.is_own:
                assert claim.outcome is not None
                self.message_ended(claim.write.requested, claim.outcome)
        elif claim.has_changed and self.stands:
            if claim.extents is None:  # it was hardly meant for these
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
        """Take note how a message of the row ended that had the line (rule 7)."""
        self.due = -math.inf
        self.has_failed = outcome is not Outcome.WRITTEN
        if outcome is Outcome.WRITTEN:
            self._counts_from = self.refreshed = max(self.refreshed, requested)
        elif outcome in (Outcome.UNKNOWN, Outcome.PARTLY):
            if self.state in (FallbackState.STANDS, FallbackState.OVERWRITTEN):
                self._counts_from = requested
            elif self.state is FallbackState.DUE and not self.is_first_try:
                # It may have been written over a fallback that the PLC has not confirmed.
                self._due_since = max(self._due_since, requested + self.after)
        else:
            return
        if self.state is not FallbackState.DUE:  # until the PLC has confirmed the fallback
            self.state = FallbackState.MESSAGE
