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

"""Another node of our name, told from an earlier run of ours."""

from __future__ import annotations

from collections.abc import Sequence

from abdf1_ros.ros.name_watch import DuplicateNameWatch


def changes_of(counts: Sequence[int]) -> list[tuple[int, bool]]:
    """Return when a watch that counts these nodes, one a second, changes its mind."""
    rest = iter(counts)
    watch = DuplicateNameWatch(lambda: next(rest))
    return [(now, watch.has_found) for now in range(len(counts))
            if any([watch.look(now), watch.look(now + 0.9)])]


def test_duplicate_name_is_found_when_it_stays() -> None:
    assert changes_of([1] * 5 + [2] * 40 + [1] * 5) == [(34, True), (45, False)]
    assert changes_of([3] * 30) == [(29, True)]


def test_earlier_run_that_was_killed_is_not_a_duplicate() -> None:
    assert changes_of([2] * 25 + [1] + [2] * 25 + [0] + [2] * 29) == []
