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

from collections.abc import Mapping as MappingType
from enum import Enum
import math
from random import Random

from abdf1_ros.driver.flights import Flight, Words
from abdf1_ros.driver.write import Outcome, Write

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

    ``seen`` is when its last value was read (clock value, s).
    """

    def __init__(self, period: float, dice: Random) -> None:
        self.seen = -math.inf
        self._period = period
        self._dice = dice
        self._zeros = 0  # 0s written again while the other bridge continues
        self._extra_zero = 0.0  # s

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
        self._extra_zero = self._period * self._dice.randint(1, _SHIFTS)

    def take_extra_zero(self) -> float:
        """Return the extra seconds of the next 0, and set them to 0."""
        extra, self._extra_zero = self._extra_zero, 0.0
        return extra


class HeartbeatRow:
    """
    One Heartbeat row, and the known contents of the PLC.

    Times are clock values (s).

    - ``value``: the value sent last.
    - ``confirmed``: when the last reply confirmed a value.
    - ``reason``: why the heartbeat does not count, empty while it counts.
    - ``refusal``: why the last write was not confirmed; ``tried``: when it was sent.
    - ``due``: when to look at the row next.
    - ``first``: the number from which the row counts.
    - ``words``: the writes that may change this word.
    - ``dice``: random numbers, so that two bridges differ.
    """

    def __init__(self, words: Words, first: int, dice: Random) -> None:
        mapping = words.row
        assert mapping.period is not None
        self.mapping = mapping
        self.words = words
        self._before_first = first - 1
        self.state = BeatState.CONTACT
        self.value = 0
        self.confirmed: float | None = None
        self.reason = ''
        self.refusal = ''
        self.is_under_way = False
        self.is_first_try = True  # the 0 that is due has not been sent yet
        self.tried = -math.inf
        self.tries = 0  # writes since the last 0 became due
        self.due = math.inf
        self.topics = mapping.condition.names if mapping.condition else ()
        self._timeout = (mapping.condition and mapping.condition.timeout or 0) / 1000
        self._period = mapping.period / 1000
        self._is_confirmed = False
        self._stands = 0  # the value that was confirmed last
        self.next_beat = -math.inf
        self._other = OtherWriter(self._period, dice)
        self._holds_at = math.inf  # until when all ``topics`` have a message in time

    def why_not(self, now: float) -> str:
        """Return why no heartbeat counts in the PLC, empty if one counts or may count."""
        if self.reason or self.confirmed is None:
            return self.reason or self.refusal or 'the PLC has not confirmed it yet'
        if self.state is not BeatState.COUNTS:
            return self.refusal or self.state.value
        if not self.value:
            return BeatState.SHOWN.value
        silent = now - self.confirmed
        why = f': {self.refusal}' if self.refusal else ''
        return f'not confirmed for {silent:.1f} s{why}' if silent > 3 * self._period else ''

    @property
    def is_at_rest(self) -> bool:
        """Tell whether the PLC has confirmed 0."""
        return self.value == 0 and self._is_confirmed

    @property
    def is_confirmed(self) -> bool:
        """Tell whether the PLC has confirmed 0, and no second write of it is planned (rule 10)."""
        return self.is_at_rest and self.words.again_at == math.inf

    def begin(self, now: float, *, is_new: bool = False) -> None:
        """
        Start again with 0: the station may be a different PLC by now (rule 2).

        A conflict with another writer ends if the contact ``is_new``: an opened port, or a change
        to RUN.
        """
        if is_new or self.state is not BeatState.CONFLICT:
            self.state = BeatState.CONTACT
        self._write_zero(now)

    def ran(self, now: float) -> None:
        """Treat earlier foreign values as leftovers of a download: the PLC went to RUN."""
        self._other.seen = -math.inf
        self.begin(now, is_new=True)

    def _write_zero(self, now: float) -> None:
        self._is_confirmed, self.is_first_try = False, True
        self.next_beat = self.due = now

    def end(self, now: float) -> bool:
        """Make a 0 due at the end; return False if the PLC surely holds it already."""
        self.due = now
        self.words.end(now)
        is_due = not self.is_at_rest or self.words.lands_until > -math.inf
        if is_due:
            self._write_zero(now)
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
        if self.value and self._stands:
            return
        if self.state in (BeatState.SHOWN, BeatState.COUNTS):  # the 0 has to stand anew
            self.state = BeatState.CONTACT
        self._write_zero(now)

    def missing(self, messages: MappingType[str, float], now: float) -> str:
        """
        Return the first topic without a message in time, empty for none (rule 3 d).

        ``messages`` has the publication time of the last accepted message of each topic (clock
        value, s).
        """
        return next((topic for topic in self.topics
                     if now >= messages.get(topic, -math.inf) + self._timeout), '')

    def why_missing(self, messages: MappingType[str, float], now: float) -> str:
        """Return the text for a topic without a message in time, empty for none."""
        topic = self.missing(messages, now)
        return f'no message of {topic} in time' if topic else ''

    def topics_until(self, messages: MappingType[str, float]) -> float:
        """Return until when the heartbeat may count by rule 3 (d) without a further message."""
        return min((messages.get(topic, -math.inf) + self._timeout
                    for topic in self.topics), default=math.inf)

    def executor_until(self, executor: float) -> float:
        """Return until when rule 3 (c) lets it count; ``executor``: last run of the executor."""
        return executor + max(self._period, _LEAST_LIFE_SIGN)

    def judge(self, now: float, why_held: str, executor: float,
              messages: MappingType[str, float]) -> bool:
        """
        Return True if a write is due now; otherwise plan the next look.

        ``why_held`` is the reason why the heartbeat must not count (rule 3 b, d), empty if it may.
        ``executor`` is when the executor ran last.
        """
        self.reason, self._holds_at = why_held, self.topics_until(messages)
        if not why_held and self.state is BeatState.HELD and self.is_at_rest:
            self.state = BeatState.SHOWN
        if self.state is BeatState.SHOWN and now >= self.next_beat:
            self.state = BeatState.COUNTS
        if why_held:
            self.hold()
        if self.is_under_way:
            self.due = math.inf
        elif self.wants_zero and self.is_at_rest and now >= self.words.again_at:
            self.due = now
            return True
        elif self.state in (BeatState.HELD, BeatState.CONFLICT):
            again = self.next_beat if self.value == 0 else now
            self.due = self.words.again_at if self.is_at_rest else again
        elif self.state is BeatState.SHOWN:
            self.due = min(self.next_beat, self.words.again_at)
        elif self.state is not BeatState.COUNTS:
            self.due = self.next_beat
        else:
            self.due = self.next_beat
            if now >= self.executor_until(executor):
                self.reason = 'the executor of the node stands still'  # nothing is written then
                self.due = max(self.next_beat, now + _GLANCE)
            if self.value:
                self.due = min(self.due, self._holds_at)
        return self.due <= now and self.state is not BeatState.SHOWN

    def hold(self) -> None:
        """Write 0 at once, if the heartbeat counts (rule 3)."""
        if self.state is BeatState.COUNTS:
            self.state = BeatState.HELD
            self.is_first_try = not self.is_at_rest

    @property
    def first_due(self) -> float:
        """Return when the next look at the row may find a first try of a 0 (clock value in s)."""
        if self.state is not BeatState.COUNTS:
            return self.due if self.is_first_try else math.inf
        return self._holds_at if self.value and not self.is_under_way else math.inf

    def read_back(self, value: int, started: float, now: float) -> str:
        """
        Compare a value whose read began at ``started``; return a report of it, empty for none.

        The expected value is known only from the confirmation of our write until our next one. The
        first foreign value is treated as a download, the second as another writer. Then 0 stays
        until the port is opened again, or until a change to RUN. That change shows that the second
        value was a download as well (rule 19).
        """
        is_known = self._is_confirmed and not self.is_under_way
        if not is_known or started < (self.confirmed or 0.0) or value == self.value:
            return ''
        if self.words.may_hold(value):  # our own value, which a gateway has held
            self.overwritten(now)
            return ''
        text = f'{value} was read where {self.value} was written'
        was_known, is_again = self.state is BeatState.CONFLICT, self._other.note_value(now)
        if is_again:
            self.state = BeatState.CONFLICT
        self.begin(now)
        if was_known:
            self.next_beat = self.due = now + self._other.next_zero()
            return ''
        if is_again:
            return (f'another program writes this word: {text}; the bridge writes 0 until the '
                    'PLC goes from PROGRAM to RUN, you call ~/reload, or the port is opened again')
        self._other.differ()
        return f'{text}: probably a download'

    @property
    def wants_zero(self) -> bool:
        """Tell whether the value to be written is 0."""
        return self.state is not BeatState.COUNTS

    def take(self, now: float) -> Write:
        """Return the write of 0 or of the next value; its end has to be reported to ``ended``."""
        self.tries = 1 if self.is_first_try else self.tries + 1
        self.is_under_way, self.is_first_try, self.tried = True, False, now
        if self.state is BeatState.SHOWN:  # the 0 is written once more
            self.state = BeatState.CONTACT
        if self.wants_zero:
            self.value, self._is_confirmed = 0, False
        elif self._is_confirmed:  # otherwise it stays the same (rule 3 a)
            before = self.value or self._before_first
            self.value, self._is_confirmed = before % LARGEST + 1, False
        pause = min(self._period, _REPEAT_ZERO) if self.wants_zero else self._period
        self.next_beat = now + pause
        self.due = math.inf
        return Write(self.mapping, [self.value], now, is_own=True)

    def refresh(self, now: float) -> Write:
        """Return the write of a 0 that the PLC holds already: it stays confirmed in any case."""
        self.is_under_way, self.tried = True, now
        self.due = math.inf
        return Write(self.mapping, [0], now, is_own=True)

    def ended(self, outcome: Outcome, now: float) -> None:
        """Record how the write ended."""
        self.is_under_way = False
        self.due = now
        if outcome is not Outcome.WRITTEN:
            return
        self._is_confirmed, self.confirmed, self._stands = True, now, self.value
        if self.value:
            return
        self.words.plan_again(self.tried)
        if self.state is not BeatState.CONFLICT:
            self.next_beat = now + max(self._period, _LEAST_ZERO) + self._other.take_extra_zero()
        if self.state is BeatState.CONTACT:
            self.state = BeatState.SHOWN
        if self.words.are_guests:
            self.overwritten(now)
