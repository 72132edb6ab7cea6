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

"""Take the writes that came before the end of a node, so that each gets its result."""

from __future__ import annotations

from collections.abc import Callable
import time

# Length (s) of a look for writes. A single look that finds no write proves nothing: on a busy
# host, another callback may run during the whole look. Only several empty looks in a row show that
# no write still waits.
_LOOK = 0.02
_LOOKS = 3

# Longest time (s) for all looks together. A limit is needed, because a publisher may never pause.
LAST_WRITES = 1.5


def take_last_writes(look: Callable[[float], None], taken: Callable[[], int], give_up: float,
                     now: Callable[[], float] = time.monotonic) -> None:
    """
    Let a node take the writes that came before its end, so that each gets its result.

    - ``look``: lets callbacks run for at most the given time (s)
    - ``taken``: returns the number of writes taken
    - ``give_up``: latest end, as a value of the clock ``now`` (s)
    """
    empty = 0
    while empty < _LOOKS and (begun := now()) < give_up:
        before = taken()
        look(_LOOK)
        empty = empty + 1 if taken() == before and now() - begun >= _LOOK else 0
