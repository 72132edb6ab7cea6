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

"""Another node of our name."""

from __future__ import annotations

from collections.abc import Callable

# A node that was killed stays visible for up to 20 s, the lease of its DDS participant. A node of
# our name that is seen in so many looks in a row, a second apart, is not an earlier run of ours.
_LOOKS_FOR_DUPLICATES = 30


class DuplicateNameWatch:
    """
    Find out when another node has our name, so that topics and services of both are one.

    ``count`` tells how many nodes of the name there are; ours is one of them.
    """

    def __init__(self, count: Callable[[], int]) -> None:
        self.has_found = False
        self._count = count
        self._looks = 0
        self._next_look = 0.0

    def look(self, now: float) -> bool:
        """Look once a second; return whether ``has_found`` has changed."""
        if now < self._next_look:
            return False
        self._next_look = now + 1.0
        self._looks = self._looks + 1 if self._count() > 1 else 0
        before, self.has_found = self.has_found, self._looks >= _LOOKS_FOR_DUPLICATES
        return self.has_found != before
