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

"""Ports that end again and again: these ends have a common cause."""

from __future__ import annotations

from collections import deque
import time

# If a port ends this number of times within this time (s), the ends have a common cause.
_MOST, _PERIOD = 3, 10.0
OFTEN = f'{_MOST} times within {_PERIOD:.0f} s'

# By name of the port: the times (s) of its last ends.
_ends: dict[str, deque[float]] = {}


def has_often_ended(name: str) -> bool:
    """Record that a port has ended now; return True if it ends again and again."""
    ends = _ends.setdefault(name, deque(maxlen=_MOST))
    ends.append(time.monotonic())
    return len(ends) == _MOST and ends[-1] - ends[0] <= _PERIOD
