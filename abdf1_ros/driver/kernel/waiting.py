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
The messages that wait for the line.

Equal messages become one write. For words only the newest value waits; for bits each change waits,
unless the line cannot send all changes. The writes of a station keep their order, and two writes
of the same words are never under way together.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Container, Iterable, Iterator
import itertools
import math

from abdf1_ros.df1.packet import BROADCAST
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.driver.kernel.flights import Flights
from abdf1_ros.driver.write import key_of, Origin, Outcome, Write, WriteResult
from abdf1_ros.messages import Message
from abdf1_ros.plan.bounds import CARRIED_WITHIN
from abdf1_ros.settings.mapping import Mapping

MAX_WAITING_WRITES = 1000

_WAITED_LONGER = 'waited longer than %g s for the line'


class WaitingWrites:
    """
    Keep writes until they have the line, for ``patience`` seconds at most.

    Writes are in ``writes``. ``report`` gets the results of those that end here. ``tx_delay`` (s)
    passes before each transmission. A write to a silent station is a probe; if ``stations.probes``
    does not admit it, it ends unsent. So does a message of a row whose messages fail while the
    station replies to others, if ``stations.odd`` does not admit it. ``next_expiry`` is when
    ``expire`` has work (clock value in s).
    """

    def __init__(self, stations: ActiveStationList, flights: Flights, patience: float,
                 report: Callable[[WriteResult], None], tx_delay: float = 0.0) -> None:
        self._stations = stations
        self._flights = flights
        self._patience = patience
        self._report = report
        # TX_Delay is not waiting time; it occurs twice: before the probe and before the command.
        self._slack = 2 * tx_delay
        self.writes: deque[Write] = deque()
        self._begun: dict[Mapping, float] = {}  # when a write of a row had the line last
        self._shared: dict[tuple[Mapping, Mapping], bool] = {}
        self.next_expiry = math.inf

    def add(self, write: Write, now: float) -> None:
        """
        Let a write wait: in the place of an older value of its row, or merged with an equal one.

        If each new value went to the end of the queue, a topic that is published again and again
        would never have its turn. But the write must not overtake a later write of another mapping
        to the same words. In that case the older value is sent as well, because otherwise two such
        topics would delay each other for ever.
        """
        write.came = now
        self.next_expiry = min(self.next_expiry, self._expiry(write))
        older = [old for old in self.writes if old.mapping is write.mapping]
        if not older:
            self._append(write, now)
            return
        last = older[-1]
        at = self.writes.index(last)
        is_overlapped = any(self._share_words(write.mapping, later.mapping)
                            for later in itertools.islice(self.writes, at + 1, None))
        if not is_overlapped and last.equals(write) and not self.why_too_old(last, now):
            last.stand_for(write)
            if len(last.origins) > MAX_WAITING_WRITES and last.oldest < last.requested:
                self._tell(last, last.give_up(last.oldest), Outcome.SUPERSEDED, '', now)
        elif write.is_pulse:
            self._append(write, now)
        else:
            if len(older) > 1 or not is_overlapped:
                self.end(last, Outcome.SUPERSEDED, '', now)
            self.writes.insert(len(self.writes) if is_overlapped else at, write)

    def _append(self, write: Write, now: float) -> None:
        """Append a write; if too many wait, end the oldest write of the row with the most."""
        self.writes.append(write)
        if len(self.writes) > MAX_WAITING_WRITES:
            (row, count), = Counter(each.mapping for each in self.writes).most_common(1)
            if count > 1:
                oldest = next(each for each in self.writes if each.mapping is row)
                self.end(oldest, Outcome.SUPERSEDED, '', now)

    def _share_words(self, one: Mapping, other: Mapping) -> bool:
        """Tell whether two rows write the same words, or bits; the result is cached."""
        known = self._shared.get((one, other))
        if known is None:
            known = self._shared[one, other] = one.shares_words(other)
        return known

    def first(self, busy: Container[int]) -> Write | None:
        """
        Return the first write that may have the line, None for none.

        Writes to stations in ``busy`` keep waiting, and so do writes of words that are being
        written: the packets of two writes must not mix.
        """
        held_up: set[int] = set()
        for write in self.writes:
            station = write.mapping.station
            is_held_up = bool(held_up) if station == BROADCAST \
                else station in held_up or BROADCAST in held_up
            if station not in busy and not is_held_up \
                    and self._flights.may_begin(write.mapping):
                return write
            held_up.add(station)
        return None

    def begins(self, write: Write, now: float) -> None:
        """Record that a write has the line: it waits no longer."""
        self.writes.remove(write)
        self._begun[write.mapping] = now

    def good_within(self, row: Mapping) -> tuple[float, float]:
        """
        Return two times (s) from the publication of a message of a row.

        Within the first its first command has to be sent, within the second all of them: a
        fallback may be due then.
        """
        latest = row.fallback.after / 1000 + self._slack if row.fallback else math.inf
        return self.patience_of(row) + self._slack, latest

    def gives_way(self, write: Write, now: float) -> bool:
        """Tell whether a write is superseded: the line cannot send all changes of its row."""
        within = min(CARRIED_WITHIN, self.patience_of(write.mapping) / 2)
        return now > write.came + within \
            and self._begun.get(write.mapping, -math.inf) > write.came \
            and any(other.mapping is write.mapping and other is not write
                    for other in self.writes)

    def youngest(self) -> dict[Mapping, float]:
        """Return, by row, when the youngest message that waits or is under way was published."""
        found: dict[Mapping, float] = {}
        for write in itertools.chain(self.writes, self._flights.messages()):
            if write.mapping.fallback is not None:
                known = found.get(write.mapping, -math.inf)
                found[write.mapping] = max(write.requested, known)
        return found

    def expire(self, now: float) -> Iterator[Mapping]:
        """End writes and messages that must not be sent any more; yield the rows of writes."""
        stations = self._stations
        if now < self.next_expiry and stations.all_reply_in_time and not stations.odd.failed:
            return
        self.next_expiry = math.inf
        for write in list(self.writes):
            if reason := self._reject_reason(write, now):
                self.end(write, Outcome.NOT_SENT, reason, now)
                yield write.mapping
                continue
            patience = self.patience_of(write.mapping)
            if now >= write.oldest + patience:
                too_old = [each.published for each in write.origins
                           if now >= each.published + patience]
                self._tell(write, write.give_up(max(too_old)), Outcome.NOT_SENT,
                           _WAITED_LONGER % patience, now)
            self.next_expiry = min(self.next_expiry, write.oldest + patience)

    def patience_of(self, mapping: Mapping) -> float:
        """Return how long (s) a message may wait: less if a fallback is due earlier (rule 7)."""
        after = mapping.fallback.after / 1000 if mapping.fallback else math.inf
        return min(self._patience, after)

    def drop(self, reason: str, now: float, mapping: Mapping | None) -> list[Mapping]:
        """End the writes of one row or all, without sending them; return their rows."""
        dropped = [write for write in self.writes if mapping in (None, write.mapping)]
        for write in dropped:
            self.end(write, Outcome.NOT_SENT, reason, now)
        return [write.mapping for write in dropped]

    def end(self, write: Write, outcome: Outcome, detail: str, now: float) -> None:
        """End a write that waits, without sending it."""
        self.writes.remove(write)
        self._tell(write, write.origins, outcome, detail, now)

    def _tell(self, write: Write, origins: Iterable[Origin], outcome: Outcome, detail: str,
              now: float) -> None:
        """Report the same result for several messages of a write."""
        for result in write.result(outcome, detail).of(origins, now):
            self._report(result)

    def _expiry(self, write: Write) -> float:
        """Return the clock value (s) from which a write is too old."""
        return write.requested + self.patience_of(write.mapping)

    def why_too_old(self, write: Write, now: float) -> str:
        """Return the reason if a message has waited too long to be written, otherwise empty."""
        if now < self._expiry(write):
            return ''
        return _WAITED_LONGER % self.patience_of(write.mapping)

    def _reject_reason(self, write: Write, now: float) -> str:
        """Return why a write must not be sent any more, empty if it may."""
        if reason := self.why_too_old(write, now):
            return reason
        station, odd = write.mapping.station, self._stations.odd
        if self._stations.claim_message(station, now):
            key = key_of(write.mapping, is_own=False)
            is_early = odd.is_odd(key) and not odd.turns.claim_message(now)
            return f'{odd.why(key)}; its turn has not come' if is_early else ''
        is_late = self._stations[station].active
        return (Message.ERR_COMMAND_TIMEOUT.entry() if is_late
                else Message.ERR_INACTIVE_STATION.entry(station))
