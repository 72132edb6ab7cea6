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

"""How often a station that does not answer is asked whether it is there again."""

from __future__ import annotations

from enum import auto, Enum
import math

# After a probe that has taken the line for t, 7 t are left to the other stations.
OTHERS_SHARE = 7


class Asker(Enum):
    """What asks a silent station whether it is there again."""

    IN_TURN = auto()  # reads, checks and polls, one silent station after the other
    MESSAGE = auto()
    OWN = auto()  # a 0 or a fallback


class Probes:
    """
    Keep what is spent on silent stations to an eighth of the line's time, whoever asks them.

    The kinds of askers take turns: ``next`` is the clock value (s) from which on silent stations
    may be asked in their order. A message cannot wait; one that comes too early gets nowhere, but
    the next turn is then kept free for one like it.
    ``pause`` is the seconds that are left to others after the last probe; before the first one
    ``usual`` stands for what that takes. ``died_at`` is when a station died last (clock value, s),
    until all that waited for that has had its turn: then minus infinity. Where no station
    answers, ``rest`` seconds are left between two probes.
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
        """Take note of a message to a silent station; tell whether it may go now."""
        is_admitted = now >= self.next_message
        self._is_kept_for_message |= not is_admitted and self._last is not Asker.MESSAGE
        return is_admitted

    def spent(self, seconds: float, now: float, asker: Asker = Asker.IN_TURN) -> None:
        """Take note that a silent station has had the line for so long until now."""
        self.pause = OTHERS_SHARE * seconds
        self._free = max(self._free, now) + self.pause
        self._is_kept_for_message, self._last = False, asker

    def died(self, seconds: float, now: float) -> None:
        """
        Take note that a station does not answer any more, which took ``seconds`` until now.

        Only a message asks it at once. Silence that a gateway reports quickly, costs little.
        """
        self._put_off = now + min(self.pause, OTHERS_SHARE * seconds)
        self.died_at = now

    def caught_up(self) -> None:
        """Take note that nothing waits any more that did when a station died."""
        self.died_at = -math.inf

    def none_waits(self, now: float, asker: Asker = Asker.IN_TURN) -> None:
        """Take note that probes keep no station waiting: then messages have no turns."""
        self._free = self._put_off = now + self._rest
        self._is_kept_for_message = False
        self._last = Asker.OWN if asker is Asker.OWN else Asker.IN_TURN
