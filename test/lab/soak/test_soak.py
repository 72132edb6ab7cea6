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

"""A faulty line for a while; ``day.py`` is the same for a day."""

from __future__ import annotations

from collections import deque
from typing import Any

import pytest
from soak.faulty_line import FaultyLine, FLOOD, MODES
from soak.memory import container_lengths, kept_bytes
from support.cases import long_unless

# Bytes that tables with a bound (causes in the log, stations that messages name) still take.
MOST_GROWTH = 30_000

# The longest that is kept while nothing waits: what a radio has heard last.
MOST_AT_REST = 256


@pytest.mark.parametrize('mode', long_unless(
    lambda mode: mode == 'Peer', ((mode,) for mode in MODES)))
def test_faults_cannot_grow_memory(mode: str) -> None:
    rig = FaultyLine(mode, pause=2.0, longest=5.0)
    rig.disturb()  # fills caches, and what is learned at first
    rig.settle()
    before = kept_bytes(rig)
    rig.disturb()
    rig.settle()
    assert kept_bytes(rig) - before < MOST_GROWTH
    rig.check_bounds()
    assert [rig.faults[kind] for kind in rig.kinds] == [2] * len(rig.kinds)
    reads = rig.ear.reads
    rig.run(30.0)
    assert rig.ear.reads > reads + 20  # and then all is well again
    assert rig.asked > 2 * FLOOD
    assert max(container_lengths(rig.driver).values()) <= MOST_AT_REST


def test_long_containers_are_found() -> None:
    class Keeper:

        def __init__(self) -> None:
            self.inner: dict[str, Any] = {
                'a': deque(range(7)), 'b': [{1: set(range(9))}]}

    keeper = Keeper()
    lengths = container_lengths(keeper)
    assert (lengths['deque'], lengths['set'], lengths['list']) == (7, 9, 1)
    before = kept_bytes(keeper)
    keeper.inner['a'].extend(range(1000, 2000))
    keeper.inner['c'] = bytes(50_000)
    assert 80_000 < kept_bytes(keeper) - before < 100_000
