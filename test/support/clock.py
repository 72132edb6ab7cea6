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

"""Clocks that stand still until a test sets them."""


class Clock:
    """A clock that stands still at `now`, in seconds, until a test sets it."""

    def __init__(self, now: float = 50.0) -> None:
        self.now = now

    def __call__(self) -> float:
        return self.now


class StillClock:
    """The time of a line, which stands still until a test sets it."""

    late = 0.0

    def __init__(self, now: float = 0.0) -> None:
        self.now = now

    def took(self, begun: float, now: float) -> float:
        """Return the seconds between two clock values."""
        return now - begun
