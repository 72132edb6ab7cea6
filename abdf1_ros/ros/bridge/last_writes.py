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

"""The writes that have come before the end of a node: each has its result."""

from __future__ import annotations

from collections.abc import Callable
import time

# A look that takes so long (s) without a write has found none. Only several in a row tell that no
# write from before the end still waits: another callback, held up by a busy host, takes as long.
_LOOK = 0.02
_LOOKS = 3

# A publisher that never pauses is not waited for longer than this (s).
LAST_WRITES = 1.5


def take_last_writes(look: Callable[[float], None], taken: Callable[[], int], give_up: float,
                     now: Callable[[], float] = time.monotonic) -> None:
    """
    Let a node take the writes that have come before its end, so that each has its result.

    ``look`` lets callbacks run for so long (s) at most, ``taken`` counts the writes; ``give_up``
    is a value of the clock ``now``.
    """
    empty = 0
    while empty < _LOOKS and (begun := now()) < give_up:
        before = taken()
        look(_LOOK)
        empty = empty + 1 if taken() == before and now() - begun >= _LOOK else 0
