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

"""One write: the values of a message, or of the bridge itself, and the result."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import NamedTuple

from abdf1_ros.df1.packet import BROADCAST, is_local_status
from abdf1_ros.errors import FormatError, LinkError, RemoteError
from abdf1_ros.pccc.address import Address
from abdf1_ros.pccc.dialect import Dialect
from abdf1_ros.pccc.steps import write_requests
from abdf1_ros.pccc.values import ValueType
from abdf1_ros.settings.limits import raw_values
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.text import value_text

_SHOWN_VALUES = 16
_SHOWN_CHARACTERS = 100  # more than a PLC string has


class Outcome(Enum):
    """The outcome of a write."""

    WRITTEN = 'written'
    STANDS = 'stands in the PLC'
    BROADCAST = 'sent to all stations; no station confirms a broadcast'
    SUPERSEDED = 'not written: superseded by a newer value'
    REFUSED = 'not written: refused'
    NOT_SENT = 'not written: not sent'
    FAILED = 'not written: the PLC refused it'
    PARTLY = 'only partly written'
    UNKNOWN = 'unknown whether written'
    FALLBACK = 'fallback value written'


def outcome_of(station: int, error: RemoteError | LinkError | None) -> Outcome:
    """Return how a command that writes has ended: the one judge of whether it has landed."""
    if error is None:
        return Outcome.BROADCAST if station == BROADCAST else Outcome.WRITTEN
    if isinstance(error, RemoteError):
        return Outcome.UNKNOWN if is_local_status(error.sts) else Outcome.FAILED
    return Outcome.UNKNOWN if error.sent else Outcome.NOT_SENT


class Origin(NamedTuple):
    """The message that asks for a write: its name, and when it was published (clock, s)."""

    request: str
    published: float


@dataclass(frozen=True, slots=True)
class WriteResult:
    """
    The one result of one message to one mapping.

    - ``detail``: why the write failed, or a remark on a confirmed write, mostly empty. For an
      unconfirmed write it also says what a later read has found, or why there was no read.
    - ``latency``: seconds from the request; ``of`` sets it.
    - ``request``: the name that the requester gave; ``of`` sets it.
    """

    mapping: Mapping
    outcome: Outcome
    detail: str
    value: str
    latency: float = 0.0
    request: str = ''
    error: LinkError | RemoteError | None = field(default=None, compare=False)

    @property
    def is_unconfirmed(self) -> bool:
        """Tell whether the PLC may have executed a packet that it has not confirmed."""
        return outcome_of(self.mapping.station, self.error) is Outcome.UNKNOWN

    def of(self, origins: Iterable[Origin], now: float) -> Iterator[WriteResult]:
        """Return the same result for each of these messages, as it is ``now`` (clock, s)."""
        return (replace(self, request=origin.request, latency=now - origin.published)
                for origin in origins)

    def __str__(self) -> str:
        """Return outcome and detail."""
        return f'{self.outcome.value}: {self.detail}' if self.detail else self.outcome.value


class Write:
    """
    Values on their way to one mapping.

    Raises FormatError, saying what is wrong, if the values cannot or must not be written. Times
    are clock values (s).

    - ``value``: the values as text; ``raw``: the values for the PLC.
    - ``commands``: the requests that write them.
    - ``is_probe``: the station was silent when the write got the line.
    - ``is_rewriting``: a word is read and then written back changed; no write may go between.
    - ``is_own``: a heartbeat or fallback, which no message has asked for.
    - ``origins``: the equal messages that it stands for, in their order.
    - ``oldest``, ``requested``: when the oldest and the youngest of them were published.
    - ``came``: when the first of them began to wait for the line.
    """

    def __init__(self, mapping: Mapping, values: Sequence[float] | str, now: float,
                 request: str = '', *, is_own: bool = False) -> None:
        self.mapping = mapping
        self.origins = [Origin(request, now)]
        self.requested = self.oldest = self.came = now
        self.is_probe, self.is_own = False, is_own
        self.is_rewriting = False
        self.value = show(values)
        self.raw = raw_values(mapping, values)
        self.commands = self._usual = write_requests(
            mapping.address, mapping.codec, self.raw, mapping.dialect)

    def equals(self, other: Write) -> bool:
        """Tell whether both write the same values to a row, in the same packets."""
        return self.mapping is other.mapping and self._usual == other._usual

    def stand_for(self, other: Write) -> None:
        """Take over the messages of an equal write."""
        self.origins += other.origins
        self.requested = max(self.requested, other.requested)
        self.oldest = min(self.oldest, other.oldest)

    def give_up(self, until: float) -> list[Origin]:
        """Remove and return the messages published up to ``until``; at least one is younger."""
        old = [origin for origin in self.origins if origin.published <= until]
        self.origins = [origin for origin in self.origins if origin.published > until]
        self.oldest = min(origin.published for origin in self.origins)
        return old

    def speak(self, dialect: Dialect) -> None:
        """Change to the packets of another dialect of the family, before anything is sent."""
        if dialect is not self.mapping.dialect:
            self.commands = write_requests(
                self.mapping.address, self.mapping.codec, self.raw, dialect)

    def bit_change(self, packet: int) -> tuple[Address, int, int]:
        """Return word, mask and bits of a packet that changes bits."""
        assert not isinstance(self.raw, str)
        return self.mapping.codec.bit_changes(self.mapping.address, self.raw)[packet]

    @property
    def is_pulse(self) -> bool:
        """Tell whether each write counts, not only the newest."""
        return self.mapping.type is ValueType.BOOL

    def is_held(self, words: bytes) -> bool:
        """Tell whether the mapping's ``words`` hold the values of this write."""
        codec = self.mapping.codec
        if isinstance(self.raw, str) or self.mapping.type.is_part:
            try:
                held = codec.decode(words)
            except FormatError:
                return False
            return held == self.raw if isinstance(held, str) else [*held] == [*self.raw]
        return words == codec.encode(self.raw)

    def result(self, outcome: Outcome, detail: str = '',
               error: LinkError | RemoteError | None = None) -> WriteResult:
        """Return how this write ended, for all its messages."""
        return WriteResult(self.mapping, outcome, detail, self.value, error=error)


def key_of(mapping: Mapping, *, is_own: bool) -> Hashable:
    """Return what is odd if messages of a row, or our own writes of it, are never confirmed."""
    return mapping, is_own


def show(values: Sequence[float] | str) -> str:
    """Return values as text, cut short when there are many."""
    if isinstance(values, str):
        rest = len(values) - _SHOWN_CHARACTERS
        more = f' and {rest} more characters' if rest > 0 else ''
        return repr(values[:_SHOWN_CHARACTERS]) + more
    text = ', '.join(map(value_text, values[:_SHOWN_VALUES]))
    rest = len(values) - _SHOWN_VALUES
    return f'[{text}, and {rest} more]' if rest > 0 else f'[{text}]'
