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
Commands that get no whole reply although their station replies to others (rule 29).

Some bytes never pass: a device server swallows 11 and 13 or doubles FF, a modem damages long
messages. Then one read, write or question fails whenever it is sent. This is not a fault of its
station, and must not take the line from its other commands.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, replace
import math

from abdf1_ros.df1.probes import Asker, Probes
from abdf1_ros.errors import CommandTimeout, LinkError, NoWholeReply, StationInactive
from abdf1_ros.messages import Message

# After this many failures in a row a command is odd: fewer are mostly noise.
_ODD = 3

# With these causes a reply came.
DAMAGED = frozenset((
    Message.ERR_BAD_BCC, Message.ERR_BAD_CRC, Message.NTC_NO_ETX_RCVD,
    Message.NTC_RCVD_MSG_TOO_SHORT, Message.NTC_RCVD_MSG_TOO_LONG))

# Shortest pause (s) before the next try of an odd 0 or fallback. It gets more than an eighth.
_LEAST_PAUSE = 1.0


@dataclass(slots=True)
class _Failures:
    """
    The failures of a command in a row: ``count``, and the last ``error``.

    The ``first`` failure and the failure that ended at ``when`` are clock values (s). The last one
    took ``took`` seconds of the line; ``others`` is ``OddCommands.others`` by then. ``replies`` is
    the number of replies of its ``station`` at the last failure.
    """

    error: LinkError
    station: int
    first: float
    count: int = 0
    replies: int = -1
    when: float = -math.inf
    took: float = 0.0
    others: float = 0.0


class OddCommands:
    """
    The commands that have ``failed``, by any key, until they get a whole reply.

    A failure counts if the station has replied to another command since the failure before, or if
    a damaged reply came. After three failures in a row the command is odd. ``turns`` limits all
    odd commands together to an eighth of the line's time. Before, reads that fail get half of the
    time that other reads want. ``replies`` returns the number of replies of a station.

    These are clock values (s):

    - ``next_suspect``: from when on a read that fails goes before others, which had the line since
      the last failure as long as the failure took.
    - ``message_failed_at``: when a message got no whole reply last.
    """

    def __init__(self, replies: Callable[[int], int]) -> None:
        self.turns = Probes(0.0)
        self.next_suspect = self.message_failed_at = -math.inf
        self.others = 0.0  # seconds of the line that failed reads and messages have had
        self._replies = replies
        self.failed: dict[Hashable, _Failures] = {}

    def failures(self, key: Hashable) -> int:
        """Return how often a command has failed in a row, without failures of its station."""
        found = self.failed.get(key)
        return found.count if found else 0

    def is_suspect(self, key: Hashable, station: int) -> bool:
        """Tell whether the station has replied to another command since a command failed."""
        found = self.failed.get(key)
        return found is not None and self._replies(station) > found.replies

    def is_doubtful(self, station: int) -> bool:
        """Tell whether a command to a station has failed, and it has replied to none since."""
        replies = self._replies(station)
        return any(found.station == station and found.replies == replies
                   for found in self.failed.values())

    def since(self, station: int) -> float:
        """
        Return since when (clock value, s) commands of a station fail that are not odd yet.

        It is infinite if there are none. Those that have passed since are good.
        """
        return min((found.first for found in self.failed.values()
                    if found.station == station and found.count < _ODD), default=math.inf)

    def is_odd(self, key: Hashable) -> bool:
        """Tell whether a command has failed so often that the fault is its own."""
        return self.failures(key) >= _ODD

    def rank(self, key: Hashable) -> int:
        """Return the rank of a command by its failures, the least goes first."""
        return min(self.failures(key), _ODD + 1)

    def next(self, key: Hashable) -> float:  # noqa: A003
        """Return from when on (clock value, s) a read goes before those that do not fail."""
        return max(self.next_suspect, self.turns.next if self.is_odd(key) else -math.inf)

    def why(self, key: Hashable) -> str:
        """Return why a command has failed last, empty if it has not."""
        found = self.failed.get(key)
        return str(found.error) if found else ''

    def next_own(self, key: Hashable, share: int) -> float:
        """
        Return from when on (clock value, s) an own write may be tried again.

        After a try that took t it waits ``share`` times t, and a second at least. Tries of others
        that fail do not count: commands that pass shall have this time.
        """
        found = self.failed.get(key)
        if found is None or found.count < _ODD:
            return -math.inf
        pause = max(_LEAST_PAUSE, share * found.took)
        return found.when + pause + self.others - found.others

    def judge(self, key: Hashable, station: int, error: LinkError, now: float, *,
              is_counted: bool) -> LinkError:
        """
        Record that a command got no whole reply; return the error for its sender.

        A failure ``is_counted`` once for all packets of a write.
        """
        if not isinstance(error, CommandTimeout | StationInactive) or not error.sent:
            return error
        replies = self._replies(station)
        found = self.failed.setdefault(key, _Failures(error, station, now))
        is_its_own = replies > found.replies or error.cause in DAMAGED
        found.count += is_its_own and is_counted
        if is_its_own and found.count >= _ODD:
            error = NoWholeReply(cause=error.cause)
        found.replies, found.error = replies, error
        return error

    def spent(self, key: Hashable, seconds: float, now: float, asker: Asker, *,
              was_odd: bool) -> None:
        """Record that a command had the line for ``seconds`` until now, and has failed."""
        if was_odd:
            found = self.failed[key]
            found.when, found.took, found.others = now, seconds, self.others
        if asker is Asker.OWN:
            return
        self.others += seconds
        if asker is Asker.MESSAGE:
            self.message_failed_at = now
        else:
            self.next_suspect = now + seconds
        if was_odd:
            self.turns.spent(seconds, now, asker)

    def passed(self, key: Hashable) -> None:
        """Forget the failures of a command: it got a whole reply, or is not sent any more."""
        self.failed.pop(key, None)

    def divided(self, key: Hashable, parts: Iterable[Hashable]) -> None:
        """Let each part of a command be odd after one failure more."""
        found = self.failed.pop(key)
        for part in parts:
            self.failed[part] = replace(found, count=_ODD - 1)

    def forget(self) -> None:
        """Forget all failures: the port is a new one."""
        self.failed.clear()
