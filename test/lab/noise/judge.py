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
The judge: what was heard against what was sent, published against held, reported against done.

Only what a check cannot see excuses a wrong value: the frame that brought it was damaged, its
check was right all the same, and so were its stations, command, TNS and length.
"""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from dataclasses import dataclass, field

from abdf1_ros.df1.checksum import Checksum
from abdf1_ros.df1.frames import Duplex, Frame, FrameDecoder, FrameFault, Symbol
from abdf1_ros.df1.machine import Machine
from abdf1_ros.df1.packet import Packet
from abdf1_ros.driver.write import Outcome
from abdf1_ros.pccc.values import Values
from abdf1_ros.settings.mapping import Mapping
from noise.wire import Wire

_VERSIONS = 500
_COMMANDS = 300

# How often a write with this result may have been executed.
_TRUE = {
    Outcome.WRITTEN: {1}, Outcome.UNKNOWN: {0, 1}, Outcome.NOT_SENT: {0},
    Outcome.SUPERSEDED: {0}, Outcome.REFUSED: {0}, Outcome.FAILED: {0}}

# The same for what a read has shown after an unsure one; nobody else writes these words.
_READ_BACK = {'the PLC holds the value': {1}, 'the PLC holds another value': {0}}


def content_of(values: Values) -> bytes:
    """Return values as bytes that can be compared."""
    return values.encode() if isinstance(values, str) else values.tobytes()


class Ear(FrameDecoder):
    """
    A decoder that knows whether the last good frame is one that nobody has sent.

    ``refused`` and ``unseen`` count damaged frames with a wrong and with a right check.
    """

    def __init__(self, checksum: Checksum, duplex: Duplex, wire: Wire) -> None:
        super().__init__(checksum, duplex)
        self.refused = 0
        self.unseen = 0
        self.is_deceived = False
        self._wire = wire

    @classmethod
    def of(cls, machine: Machine, checksum: Checksum, duplex: Duplex, wire: Wire) -> Ear:
        """Give a machine that has not begun such an ear."""
        ear = cls(checksum, duplex, wire)
        machine.receiver.decoder = ear
        return ear

    def next_symbol(self) -> Symbol | None:
        """Return the next symbol and judge it."""
        symbol = super().next_symbol()
        if isinstance(symbol, Frame):
            self.refused += symbol.fault is FrameFault.BAD_CHECK
            self.is_deceived = symbol.fault is None and self._is_forged(symbol)
        return symbol

    def _is_forged(self, frame: Frame) -> bool:
        """Tell a frame that nobody has sent, or that somebody only passes on."""
        if self._wire.has_sent(frame):
            return frame.data in self._wire.forged
        self._wire.forged.append(frame.data)
        self.unseen += 1
        return True


@dataclass(slots=True)
class _Request:
    """
    A write that was asked for: how often it was ``done``, and how often by its ``results``.

    ``unseen`` and ``unseen_until`` count what no check has seen, when it was asked for and when
    it was last heard of.
    """

    unseen: int
    done: int = 0
    results: list[set[int]] = field(default_factory=list)
    unseen_until: int = 0


class Judge:
    """
    Compare everything; ``counts`` are what was found.

    Faults of ours are ``wrong values``, ``twice``, ``false results`` and ``results missing``;
    what a check did not see is counted beside them as ``deceived ...``.
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.ears: list[Ear] = []
        self._held: defaultdict[tuple[int, str], deque[tuple[float, bytes]]] = defaultdict(
            lambda: deque(maxlen=_VERSIONS))
        self._requests: dict[bytes, _Request] = {}
        self._executed: defaultdict[int, deque[tuple[int, int] | None]] = defaultdict(
            lambda: deque(maxlen=_COMMANDS))  # None: a command that nobody has sent

    @property
    def unseen(self) -> int:
        """Return how many damaged frames had a right check."""
        return sum(ear.unseen for ear in self.ears)

    @property
    def faults(self) -> int:
        """Return how much was wrong that no check excuses."""
        return sum(self.counts[name] for name in (
            'wrong values', 'twice', 'false results', 'results missing'))

    def holds(self, mapping: Mapping, content: bytes, now: float) -> None:
        """Take note of what the owner of these words holds from now on."""
        versions = self._held[mapping.station, str(mapping.address)]
        if not versions or versions[-1][1] != content:
            versions.append((now, content))

    def published(self, mapping: Mapping, content: bytes, since: float, ear: Ear) -> None:
        """Judge a value whose read began at ``since``: it must have been held after that."""
        self.counts['values'] += 1
        until = float('inf')
        for begun, held in reversed(self._held[mapping.station, str(mapping.address)]):
            if until < since:
                break
            if held == content:
                return
            until = begun
        self.counts['deceived values' if ear.is_deceived else 'wrong values'] += 1

    def asked(self, content: bytes) -> None:
        """Take note of a write that is asked for; each has another content."""
        assert content not in self._requests
        self.counts['writes'] += 1
        self._requests[content] = _Request(self.unseen)

    def executed(self, station: int, command: Packet, ear: Ear) -> None:
        """Judge a command that a station executes."""
        self.counts['commands'] += 1
        executed = self._executed[station]
        if ear.is_deceived:
            self.counts['deceived commands'] += 1
            executed.append(None)
            return
        key = command.src, command.tns
        if key in executed:
            # A station knows its last command only: a forged one has made it forget this one.
            since = list(executed)[executed.index(key):]
            self.counts['deceived commands' if None in since else 'twice'] += 1
        executed.append(key)

    def written(self, content: bytes, ear: Ear) -> None:
        """Take note that a station has stored values."""
        request = self._requests.get(content)
        if request is not None:
            request.done += 1
            request.unseen_until = self.unseen
        else:
            self.counts['deceived writes' if ear.is_deceived else 'wrong values'] += 1

    def resulted(self, content: bytes, outcome: Outcome, detail: str = '') -> None:
        """Take note of the result of a write."""
        self.counts[outcome.name] += 1
        finding = detail.rpartition('read back: ')[2]
        self.counts[finding] += finding in _READ_BACK
        request = self._requests[content]
        request.results.append(_READ_BACK.get(finding, _TRUE[outcome]))
        request.unseen_until = self.unseen

    def settle(self) -> None:
        """Judge the results of all writes, now that everything has come to its end."""
        for request in self._requests.values():
            if len(request.results) != 1:
                self.counts['results missing'] += 1
            elif request.done not in request.results[0]:
                is_deceived = request.unseen_until > request.unseen
                self.counts['deceived results' if is_deceived else 'false results'] += 1
        self._requests.clear()
