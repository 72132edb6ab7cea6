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

# After a probe that has taken the line for t, 7 t are left to the other stations.
_OTHERS_SHARE = 7


class Probes:
    """
    Keep probes to an eighth of the line's time.

    ``usual`` is the seconds that a probe takes at least; ``next`` is the clock value (s) from
    which there may be another.
    """

    def __init__(self, usual: float) -> None:
        self.next = 0.0
        self._usual = usual

    @property
    def interval(self) -> float:
        """Return the seconds left to the other stations after a usual probe."""
        return _OTHERS_SHARE * self._usual

    def spend(self, seconds: float, now: float) -> None:
        """Take note that a probe had the line for so many seconds until now."""
        self.wait(_OTHERS_SHARE * max(seconds, self._usual), now)

    def wait(self, seconds: float, now: float) -> None:
        """Allow no probe before ``seconds`` have passed."""
        self.next = now + seconds
