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

"""The summary of traffic: counts, latencies, the load of the line."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field

from abdf1_ros.df1.frames import Duplex
from abdf1_ros.sniffer.capture import Chunk, Direction
from abdf1_ros.sniffer.entries import Entry, Kind, Mark

BITS_PER_CHARACTER = 10
MISSING = Kind.SILENCE, Kind.UNANSWERED


@dataclass(slots=True)
class Latency:
    """Seconds from commands to their replies."""

    count: int = 0
    total: float = 0.0
    longest: float = 0.0

    def add(self, seconds: float) -> None:
        """Add a latency (s)."""
        self.count += 1
        self.total += seconds
        self.longest = max(self.longest, seconds)

    @property
    def mean(self) -> float:
        """Return the mean in seconds; 0 if there was no latency."""
        return self.total / self.count if self.count else 0.0


@dataclass(slots=True)
class Counts:
    """
    The counts of entries, of the whole line or of one station.

    - ``errors``: replies with an STS that is not 0
    - ``damaged``: entries with a wrong check or a broken frame
    - ``noise``: bytes of noise
    """

    kinds: Counter[Kind] = field(default_factory=Counter)
    marks: Counter[Mark] = field(default_factory=Counter)
    errors: int = 0
    damaged: int = 0
    noise: int = 0
    latency: Latency = field(default_factory=Latency)

    def add(self, entry: Entry) -> None:
        self.kinds[entry.kind] += 1
        self.marks.update(entry.marks)
        self.noise += entry.size
        self.damaged += entry.kind is Kind.DAMAGED or entry.valid is False
        if entry.kind is Kind.REPLY and entry.packet is not None:
            self.errors += entry.packet.sts != 0
        if entry.latency is not None:
            self.latency.add(entry.latency)

    def leave_out_answers(self) -> None:
        """Do not count what is missing because its side of the line was not recorded."""
        for kind in MISSING:
            del self.kinds[kind]
        del self.marks[Mark.STRAY]


class Summary:
    """
    Count the entries of a ``TrafficDecoder``; ``baud`` is needed for the load of the line.

    If the times go back, another recording has begun.
    """

    def __init__(self, baud: int | None = None) -> None:
        self.baud = baud
        self.all = Counts()
        self.stations: defaultdict[int, Counts] = defaultdict(Counts)
        self.bytes: Counter[Direction] = Counter()
        self._senders: set[Direction] = set()
        self._has_answers = False
        self._earlier = 0.0  # seconds of the recordings before this one
        self._first: float | None = None
        self._last: float | None = None

    def take(self, chunk: Chunk) -> None:
        """Count the bytes of a chunk."""
        self.bytes[chunk.direction] += len(chunk.data)
        if chunk.time is None:
            return
        if self._last is None or chunk.time < self._last:
            self._earlier, self._first = self.seconds or 0.0, chunk.time
        self._last = chunk.time

    def add(self, entry: Entry) -> None:
        """Count an entry."""
        self.all.add(entry)
        if entry.station is not None:
            self.stations[entry.station].add(entry)
        if entry.kind not in MISSING:
            self._senders.add(entry.direction)
        self._has_answers |= entry.request is not None

    @property
    def is_one_sided(self) -> bool:
        """
        Return True if only one side of the line was recorded.

        A recorded ACK or reply proves that something was said before it. If that is not in the
        recording, the far side was not recorded.
        """
        kinds = self.all.kinds
        if not kinds[Kind.COMMAND] + kinds[Kind.POLL]:
            return kinds[Kind.REPLY] > 0
        if self._has_answers or kinds[Kind.EOT]:
            return False
        return len(self._senders) == 1 and Direction.UNKNOWN not in self._senders and (
            kinds[Kind.ACK] + kinds[Kind.REPLY] > 0)

    def end(self) -> None:
        """Count no missing answers if their side of the line was not recorded."""
        if self.is_one_sided:
            for counts in (self.all, *self.stations.values()):
                counts.leave_out_answers()

    @property
    def seconds(self) -> float | None:
        """Return the seconds from first to last byte of all recordings; None without times."""
        if self._first is None or self._last is None:
            return None
        return self._earlier + self._last - self._first

    def load(self, duplex: Duplex | None) -> float | None:
        """
        Return the share of its time (0 to 1) in which the line transmits; None if unknown.

        Full duplex has a wire for each direction; the busier wire counts. A share above 1 comes
        from a pseudo-terminal or a network. Their speed is not known, so the result is None.
        """
        if not self.baud or not self.seconds:
            return None
        busiest = max(self.bytes.values(), default=0) if duplex is Duplex.FULL else (
            self.bytes.total())
        load = busiest * BITS_PER_CHARACTER / self.baud / self.seconds
        return load if load <= 1 else None
