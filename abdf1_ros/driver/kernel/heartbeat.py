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

The rules have the numbers of docs/heartbeats.md.
"""

from __future__ import annotations

from enum import Enum
import math
from random import Random

from abdf1_ros.driver.kernel.flights import Flight, Words
from abdf1_ros.driver.kernel.own import Conditions, SelfWritten
from abdf1_ros.driver.write import Write

LARGEST = 32_767

_LEAST_LIFE_SIGN = 1.0  # s

# Shortest time (s) for which the PLC holds a 0, as a PLC sees a word once in a scan (rule 2).
_LEAST_ZERO = 0.5

# An unconfirmed 0 is written again after this many seconds, or after a Period if that is shorter.
_REPEAT_ZERO = 1.0

# Interval (s) of the link's own looks at the executor: a stopped executor does not wake the link.
_GLANCE = 0.1

# A second foreign value within this many seconds, or Periods if these are longer, means another
# writer, not a download.
_CONFLICT_TIME = 60.0
_CONFLICT_PERIODS = 20

_SHIFTS = 7
_GOLDEN = 0.618  # the fractions of its multiples are spread evenly


class BeatState(Enum):
    """The value that the PLC is to see: 0, or a value that counts."""

    CONTACT = 'first contact: 0 has to be confirmed'
    SHOWN = 'the PLC has to see the 0 first'
    COUNTS = 'counts'
    HELD = '0, because it must not count now'
    CONFLICT = '0, because another program writes this word'


class OtherWriter:
    """
    What we know of another writer of our heartbeat word, mostly a bridge (rule 19).

    ``seen`` is when its last value was read (clock value, s); ``extra_zero`` prolongs the next 0.
    """

    def __init__(self, period: float, dice: Random) -> None:
        self.seen = -math.inf
        self._period = period
        self._dice = dice
        self._zeros = 0  # 0s written again while the other bridge continues
        self.extra_zero = 0.0  # s, until the heartbeat counts or begins again

    def note_value(self, now: float) -> bool:
        """Record a foreign value; return True if one was seen recently before."""
        before, self.seen = self.seen, now
        return now - before < max(_CONFLICT_TIME, _CONFLICT_PERIODS * self._period)

    def next_zero(self) -> float:
        """Return the seconds until 0 is written again, so that the other bridge reads our 0."""
        self._zeros += 1  # at a different moment of the other bridge's period each time
        return self._period * (0.5 + self._zeros * _GOLDEN % 1)

    def differ(self) -> None:
        """
        Extend the next 0 by a random number of Periods.

        If both bridges counted from 1 at the same time, neither would see foreign values any more.
        """
        self.extra_zero = self._period * self._dice.randint(1, _SHIFTS)


class HeartbeatRow(SelfWritten):
    """
    One Heartbeat row.

    Times are clock values (s).

    - ``counts``: the next value to be written is a number, not 0.
    - ``is_taken``: another program writes the word (rule 19).
    - ``reason``: why the heartbeat does not count, empty while it counts.
    - ``first``: the number from which the row counts.
    - ``dice``: random numbers, so that two bridges differ.
    """

    def __init__(self, words: Words, conditions: Conditions, first: int, dice: Random) -> None:
        super().__init__(words, conditions)
        mapping = self.mapping
        assert mapping.period is not None
        self._before_first = first - 1
        self.counts = self.is_taken = False
        self.reason = ''
        self.topics = mapping.condition.names if mapping.condition else ()
        self._timeout = (mapping.condition and mapping.condition.timeout or 0) / 1000
        self._period = mapping.period / 1000
        self._other = OtherWriter(self._period, dice)

    @property
    def value(self) -> int:
        """Return the value sent last."""
        write = self.trial.write if self.trial is not None else None
        return int(write.raw[0]) if write is not None else 0

    @property
    def state(self) -> BeatState:
        """Return what the PLC is to see."""
        if self.is_taken:
            return BeatState.CONFLICT
        if self.counts:
            return BeatState.COUNTS
        if self.reason:
            return BeatState.HELD
        return BeatState.SHOWN if self.is_at_rest else BeatState.CONTACT

    def why_not(self, now: float) -> str:
        """Return why no heartbeat counts in the PLC, empty if one counts or may count."""
        confirmed = self.confirmed
        if self.reason or confirmed is None:
            return self.reason or self.refusal or 'the PLC has not confirmed it yet'
        if self.state is not BeatState.COUNTS:
            return self.refusal or self.state.value
        if not self.value:
            return BeatState.SHOWN.value
        silent = now - confirmed
        why = f': {self.refusal}' if self.refusal else ''
        return f'not confirmed for {silent:.1f} s{why}' if silent > 3 * self._period else ''

    @property
    def is_at_rest(self) -> bool:
        """Tell whether the PLC has confirmed the 0 that was asked for last."""
        return self.value == 0 and self.has_confirmed and not self.is_first_try

    @property
    def is_confirmed(self) -> bool:
        """Tell whether the PLC has confirmed 0, and no second write of it is planned (rule 10)."""
        return self.is_at_rest and self.again_at == math.inf

    @property
    def is_first_try(self) -> bool:
        """Tell whether the 0 that is due has not been sent yet."""
        return self.tried < self.asked

    def begin(self, now: float, *, is_new: bool = False) -> None:
        """
        Start again with 0: the station may be a different PLC by now (rule 2).

        A conflict with another writer ends if the contact ``is_new``: an opened port, or a change
        to RUN. Otherwise the reply to a 0 may be the contact; this 0 need not be written again.
        """
        self.is_taken &= not is_new
        self._other.extra_zero = 0.0
        self.counts, latest = False, self.latest
        is_reply = latest is not None and (latest.outcome is None or latest.done == now)
        if is_new or self.value or not is_reply:
            self.asked = now

    def ran(self, now: float) -> None:
        """Treat earlier foreign values as leftovers of a download: the PLC went to RUN."""
        self._other.seen = -math.inf
        self.begin(now, is_new=True)

    def end(self, now: float) -> bool:
        """Make a 0 due at the end; return False if the PLC surely holds it already."""
        is_due = not self.is_at_rest or self.words.lands_until > -math.inf
        if is_due:
            self.asked = now
        return is_due

    def write_ended(self, flight: Flight, now: float) -> None:
        """Record the end of a write to this word: a guest may have overwritten our 0."""
        if flight.write is None and flight.has_changed and flight.extents is not None:
            self.overwritten(now)

    def overwritten(self, now: float) -> None:
        """
        Write 0 again at once if the PLC may hold 0: another value may have replaced it.

        Until a number is confirmed, the PLC may still hold the 0 before it.
        """
        last = self.words.last
        stands = last is not None and last.write is not None and last.write.raw[0]
        if not self.value or not stands:
            self.counts, self.asked = False, now

    def missing(self, now: float) -> str:
        """Return the first topic without a message in time, empty for none (rule 3 d)."""
        messages = self.conditions.messages
        return next((topic for topic in self.topics
                     if now >= messages.get(topic, -math.inf) + self._timeout), '')

    def why_missing(self, now: float) -> str:
        """Return the text for a topic without a message in time, empty for none."""
        topic = self.missing(now)
        return f'no message of {topic} in time' if topic else ''

    @property
    def topics_until(self) -> float:
        """Return until when the heartbeat may count by rule 3 (d) without a further message."""
        messages = self.conditions.messages
        return min((messages.get(topic, -math.inf) + self._timeout
                    for topic in self.topics), default=math.inf)

    @property
    def executor_until(self) -> float:
        """Return until when rule 3 (c) lets it count."""
        return self.conditions.executor + max(self._period, _LEAST_LIFE_SIGN)

    def look(self, now: float, why_held: str) -> float:
        """
        Return from when on a write is due; infinite: an event is needed (clock values, s).

        ``why_held`` is the reason why the heartbeat must not count (rule 3 b, d), empty if it may.
        """
        self.reason = why_held
        if why_held:
            self.hold(now)
        elif not self.is_taken and not self.counts and self.is_at_rest and now >= self._seen_at:
            self.counts, self._other.extra_zero = True, 0.0
        if self.is_under_way:
            return math.inf
        if self.counts:
            return self._look_at_count(now)
        if not self.is_at_rest:
            return self.asked if self.is_first_try \
                else self.tried + min(self._period, _REPEAT_ZERO)
        again = self.again_at
        return again if why_held or self.is_taken else min(again, self._seen_at)

    def _look_at_count(self, now: float) -> float:
        due = self.tried + self._period if self.value else now
        if now >= self.executor_until:
            self.reason = 'the executor of the node stands still'  # nothing is written then
            due = max(due, now + _GLANCE)
        return min(due, self.topics_until) if self.value else due

    @property
    def _seen_at(self) -> float:
        """Return when the PLC has seen the 0 that stands for long enough (rule 2)."""
        confirmed = self.confirmed
        return (math.inf if confirmed is None else confirmed) \
            + max(self._period, _LEAST_ZERO) + self._other.extra_zero

    def hold(self, now: float) -> None:
        """Write 0 at once, if the heartbeat counts (rule 3)."""
        if self.counts:
            self.counts = False
            if not self.is_at_rest:
                self.asked = now

    def read_back(self, value: int, started: float, now: float) -> str:
        """
        Compare a value whose read began at ``started``; return a report of it, empty for none.

        The expected value is known only from the confirmation of our write until our next one. The
        first foreign value is treated as a download, the second as another writer. Then 0 stays
        until the port is opened again, or until a change to RUN. That change shows that the second
        value was a download as well (rule 19).
        """
        last = self.words.last
        is_known = last is not None and last is self.trial and not self.is_under_way \
            and not self.is_first_try
        if not is_known or started < (self.confirmed or 0.0) or value == self.value:
            return ''
        if self.words.may_hold(value):  # our own value, which a gateway has held
            self.overwritten(now)
            return ''
        text = f'{value} was read where {self.value} was written'
        was_known, is_again = self.is_taken, self._other.note_value(now)
        self.is_taken |= is_again
        self.begin(now)
        if was_known:
            self.asked = now + self._other.next_zero()
            return ''
        if is_again:
            return (f'another program writes this word: {text}; the bridge writes 0 until the '
                    'PLC goes from PROGRAM to RUN, you call ~/reload, or the port is opened again')
        self._other.differ()
        return f'{text}: probably a download'

    @property
    def wants_zero(self) -> bool:
        """Tell whether the value to be written is 0."""
        return not self.counts

    def take(self, now: float) -> Write:
        """Return the write of 0 or of the next value; its end has to be reported to ``ended``."""
        self.tries = 1 if self.is_first_try else self.tries + 1
        value = 0
        if self.counts:  # an unconfirmed number stays the same (rule 3 a)
            value = self.value
            if self.has_confirmed:
                value = (value or self._before_first) % LARGEST + 1
        return Write(self.mapping, [value], now, is_own=True)

    def refresh(self, now: float) -> Write:
        """Return the write of a 0 that the PLC holds already: it stays confirmed in any case."""
        return Write(self.mapping, [0], now, is_own=True)

    def ended(self, now: float) -> None:
        """Record that a write of ours has ended: a guest may have written over a 0 meanwhile."""
        if self.value == 0 and self.has_confirmed and self.words.are_guests:
            self.overwritten(now)
