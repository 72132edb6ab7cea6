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

"""The kernel by itself: all stories of its tiny plants, and the mistakes that they find."""

import math
from pathlib import Path
from typing import Any

from abdf1_ros.driver.kernel.flights import Flights, Words
from abdf1_ros.driver.kernel.gate import Gate
from abdf1_ros.driver.kernel.rows import OwnRows
from explorer.explore import Exploration, Told
from explorer.plants import PLANTS
import pytest
from support.cases import compare_stored

_STORED = Path(__file__).parent / 'stored'


@pytest.mark.parametrize('name', [*PLANTS])
def test_each_story_of_the_kernel_is_sound_and_comes_to_rest(name: str) -> None:
    exploration = Exploration(PLANTS[name])
    exploration.run()
    assert {told.broken: told.lines for told in exploration.broken.values()} == {}
    reached = ''.join(f'{line}\n' for line in (
        f'{exploration.states} states, {exploration.stories} stories',
        *sorted(exploration.reached)))
    compare_stored(_STORED / f'{name}.txt', reached)


@pytest.mark.parametrize(('owner', 'name', 'made', 'plant', 'demand'), [
    (Words, 'again_at', lambda words, ended=0.0: math.inf, 'gateway', 'hold'),
    (Flights, 'take_over', lambda flights, before: None, 'direct', 'holds'),
    (Flights, 'forget', lambda flights, station=None: None, 'repeated', 'does not stand'),
    (OwnRows, 'is_overruled', lambda rows, write: False, 'cell', '(9)'),
    (OwnRows, 'why_refused', lambda rows, write: '', 'single', '(28)'),
    (Gate, '_proof', lambda gate, write, now: 'it', 'cell', 'does not stand')])
def test_story_of_the_kernel_shows_a_mistake(
        owner: type, name: str, made: Any, plant: str, demand: str,
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(owner, name, made)
    exploration = Exploration(PLANTS[plant])
    exploration.run(is_enough=lambda: bool(exploration.broken))
    assert [told.broken for told in exploration.broken.values() if demand in told.broken]


def test_story_is_told_again_by_its_choices() -> None:
    first = Told(PLANTS['cell'], (2,), 3)
    again = Told(PLANTS['cell'], tuple(first.choices), 3)
    assert first.lines == again.lines
    assert first.lines[:2] == ['step 1', '  event: old speed']
    assert (1,) in [*first.others(0)]
