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

"""How often a silent station is asked whether it answers again."""

from __future__ import annotations

from enum import auto, Enum
import math

# After a probe that has used the line for a time t, the other stations get 7 t.
OTHERS_SHARE = 7


class Asker(Enum):
    """The kinds of probes, which ask a silent station whether it answers again."""

    IN_TURN = auto()  # reads, checks and polls, which ask the silent stations in their order
    MESSAGE = auto()
    OWN = auto()  # a 0 or a fallback


class Probes:
    """
    Limit the time of all probes to an eighth of the line's time.

    The kinds of probes take turns. Each kind has the clock value (s) from which it may be sent:

    - ``next``: the round of silent stations.
    - ``next_message``: messages to silent stations.
    - ``next_own``: a 0 or a fallback.

    A message cannot wait: if it comes before its turn, it is refused. The next turn is then
    reserved for a message, unless the last probe was a message.

    - ``pause``: seconds for active stations after the last probe. Before the first probe it is
      computed from ``usual``, the usual seconds of a probe.
    - ``died_at``: when a station became silent last (clock value, s). It is minus infinity after
      all commands that waited at that time have had their turn.
    - ``rest``: seconds between two probes if no station answers.
    """

    def __init__(self, usual: float, rest: float = 0.0) -> None:
        self._rest = rest
        self.pause = OTHERS_SHARE * usual
        self._free = self._put_off = 0.0
        self.died_at = -math.inf
        self._is_kept_for_message = False
        self._last = Asker.IN_TURN

    @property
    def next(self) -> float:  # noqa: A003
        """Return from when on (clock value, s) silent stations may be asked in their order."""
        free = self._free + self.pause if self._is_kept_for_message else self._free
        return max(free, self._put_off)

    @property
    def next_message(self) -> float:
        """Return from when on (clock value, s) a message may go to a silent station."""
        return self._free + self.pause if self._last is Asker.MESSAGE else self._free

    @property
    def next_own(self) -> float:
        """Return from when on (clock value, s) a 0 or a fallback may be written again."""
        return self._free + self.pause if self._last is Asker.OWN else self.next

    def claim_message(self, now: float) -> bool:
        """Claim a turn for a message to a silent station; return True if it may go now."""
        is_admitted = now >= self.next_message
        self._is_kept_for_message |= not is_admitted and self._last is not Asker.MESSAGE
        return is_admitted

    def spent(self, seconds: float, now: float, asker: Asker = Asker.IN_TURN) -> None:
        """Record that a silent station has had the line for ``seconds`` until now."""
        self.pause = OTHERS_SHARE * seconds
        self._free = max(self._free, now) + self.pause
        self._is_kept_for_message, self._last = False, asker

    def died(self, seconds: float, now: float) -> None:
        """
        Record that a station has become silent, which took ``seconds`` until now.

        Only a message may be sent to it at once. If a gateway reports the silence quickly, the
        pause is short.
        """
        self._put_off = now + min(self.pause, OTHERS_SHARE * seconds)
        self.died_at = now

    def caught_up(self) -> None:
        """Record that all commands which waited when a station died have had their turn."""
        self.died_at = -math.inf

    def keep_none_waiting(self, now: float, asker: Asker = Asker.IN_TURN) -> None:
        """Record that probes keep no station waiting, so that messages need no turns."""
        self._free = self._put_off = now + self._rest
        self._is_kept_for_message = False
        self._last = Asker.OWN if asker is Asker.OWN else Asker.IN_TURN
