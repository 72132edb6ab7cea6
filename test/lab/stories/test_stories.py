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

"""Short stories of tiny plants, what they reach, and the mistakes that they find."""

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
import math
from pathlib import Path
from typing import Any
from unittest import mock

from abdf1_ros.driver.kernel.end import OrderlyEnd
from abdf1_ros.driver.kernel.flights import Flights, Words
from abdf1_ros.driver.kernel.heartbeat import HeartbeatRow
from abdf1_ros.driver.kernel.rows import OwnRows
import pytest
from stories.scenes import Kind, kinds_of, SCENES, SMALL
from stories.walk import Ledger, shortest, story_of, tell, text_of, Walk
from support.cases import compare_stored, long_unless

_STORED = Path(__file__).parent / 'stored'


def _walked(name: str, deviations: int) -> Walk:
    walk = Walk(SCENES[name])
    assert [*walk.to(deviations)] == [*range(deviations + 1)]
    assert [(text_of(one.story), one.broken) for one in walk.broken] == []
    return walk


# All pairs of the others take minutes: "make long" walks through them.
_PAIRS = ('little end', 'little gets', 'little again', 'little again via', 'little bits',
          'little clocks', 'little refreshed', 'little stored', 'little radio', 'little standard',
          'little slave')


@pytest.mark.parametrize(('name', 'deviations'), long_unless(
    lambda name, deviations: deviations == 1,
    [*((name, 1) for name in SMALL), *((name, 2) for name in _PAIRS)]))
def test_all_stories_keep_the_rules_and_reach_what_is_stored(name: str, deviations: int) -> None:
    walk = _walked(name, deviations)
    reached = ''.join(f'{line}\n' for line in (f'{walk.stories} stories', *sorted(walk.reached)))
    compare_stored(_STORED / f'{name} {deviations}.txt'.replace(' ', '_'), reached)


def test_each_pair_of_kinds_is_in_a_scene_that_is_walked_through() -> None:
    found = {pair for name in SMALL for pair in combinations(Kind, 2)
             if kinds_of(SCENES[name]).issuperset(pair)}
    assert {*combinations(Kind, 2)} - found == set()


@pytest.mark.parametrize(('name', 'text'), [
    *((name, '') for name in SCENES if name not in SMALL),
    # A guest writes the word of a row that new files do not have.
    ('direct', 'at 0.35: reload speed gone\nat 0.95: guest speed'),
    # The number of a process that is killed while it is on the line.
    ('direct', 'at 0.05: message\nat 0.65: kill 0.3')])
def test_story_of_a_large_scene_can_be_told(name: str, text: str) -> None:
    assert tell_broken(name, text) == ''


@pytest.mark.parametrize(('name', 'text'), [
    # A lost port and an end: the log has to name the row, also where no heartbeat is mapped.
    ('little end', 'at 0.95: unplug 0.5\nat 1.25: end 0.3'),
    # A late command counts from the end of its write, also where the port is lost.
    ('little sts', 'write 3: kept last\nat 1.75: polling 0.4'),
    # A guest over a 0 whose next number was refused.
    ('sts', 'write 3: refused\nat 0.95: guest beat'),
    # Our own late number after new files.
    ('sts', 'at 1.25: reload speed gone\nwrite 6: kept last'),
    # A row without Fallback in new files takes what came before the last Fallback of the old ones.
    ('direct', 'at 0.05: still 0.4\nat 0.65: reload speed bare'),
    # New files without the heartbeat of one station, and with that of another.
    ('two', 'at 0.05: reload beat gone'),
    # A process that is killed in the moment in which its number goes out.
    ('little crowd', 'at 1.3: kill 0.3'),
    # A late number may have landed after the last 0 of an end: the end names the word.
    ('little last', 'write 5: kept last\nwrite 7: refused')])
def test_story_that_was_told_wrongly_once(name: str, text: str) -> None:
    assert tell_broken(name, text) == ''


def test_end_whose_last_write_shows_a_gateway_writes_once_more() -> None:
    """The gateway may deliver what others sent before the port was opened (rule 10)."""
    one = tell(SCENES['little sts'], story_of('during 1: reload same\nwrite 2: sts last'))
    assert one is not None
    assert one.came[3:6] == ('beat_1 = 0', 'w0_1 = 32000', 'w0_1 = 32000 late')


def _always(value: object) -> Callable[..., object]:
    return lambda *arguments, **named: value


@pytest.mark.parametrize(('owner', 'name', 'made', 'scene', 'story', 'check'), [
    (Words, '_lands', _always(-math.inf), 'little sts', 'write 2: kept last', 'Belief'),
    (Flights, 'take_over', _always(None), 'little gets',
     'write 1: kept last\nduring 1: reload same', 'Belief'),
    (Flights, 'has_gateway', _always(False), 'little free',
     'at 0.5: before speed last\nwrite 3: not delivered', 'Belief'),
    (Words, 'again_at', _always(math.inf), 'little beat', 'write 2: kept last', 'Belief'),
    (OrderlyEnd, 'unconfirmed', _always([]), 'little end', 'write 2: kept 2\nat 0.95: end 0.3',
     'Named'),
    (Words, 'are_ours', lambda self, but=None: self.last is not None, 'little sts', '',
     'Belief'),
    (Words, 'may_hold', _always(True), 'little run', 'at 0.9: foreign', 'Noticed'),
    (OrderlyEnd, 'keeps_line', property(_always(False)), 'little last', 'write 3: no reply',
     'Unread'),
    (OwnRows, 'is_overruled', _always(False), 'little race', 'at 0.53: slow 0.04', 'Named'),
    (Words, '_is_settled', _always(True), 'little again via', 'at 0.05: before speed last',
     'Stands'),
    (HeartbeatRow, 'is_at_rest', property(_always(False)), 'little calls', '', 'Counts')])
def test_story_shows_a_mistake(owner: type, name: str, made: Any, scene: str, story: str,
                               check: str) -> None:
    assert tell_broken(scene, story) == ''
    with mock.patch.object(owner, name, made):
        assert tell_broken(scene, story).startswith(check)


def tell_broken(scene: str, story: str) -> str:
    one = tell(SCENES[scene], story_of(story))
    assert one is not None
    return one.broken


def test_story_is_its_text_and_is_shortened() -> None:
    text = 'at 1.2: message\nwrite 2: kept last'
    assert text_of(story_of(text)) == text
    with mock.patch.object(Words, '_lands', _always(-math.inf)):
        longest = {'at 1.2': 'guest speed', 'write 2': 'kept last'}
        assert shortest(SCENES['little sts'], longest) == {'write 2': 'kept last'}


def test_stories_of_another_tree_are_compared(tmp_path: Path) -> None:
    one = tell(SCENES['little end'], {})
    assert one is not None
    kept = Ledger(None)
    kept.add(one)
    kept.write(tmp_path / 'kept.json')
    before = Ledger(tmp_path / 'kept.json')
    assert not before.differs(one)
    assert before.differs(replace(one, came=one.came[1:]))
    assert before.differs(replace(one, story={'at 0.95': 'message'}))
