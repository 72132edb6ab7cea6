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

"""
Walk through all short stories of a tiny plant, and judge each by the rules of the simulation.

A story is a conversation in which a few things go another way than usual. It is a text with one
line for each of them::

    at 1.6: polling 0.4
    write 3: sts last
    during 5: reload same

- ``at``: an event, at a time (s);
- ``write``: what becomes of the write with this number that comes to a PLC or its gateway;
- ``during``: an event 1 ms after that write has come.

``walk.py 'little end' --deviations 2`` tells all stories with up to two such lines, fewest first.
``--story FILE`` tells one, with all that came of it. ``--keep FILE`` keeps what came of each
story, and ``--against FILE`` compares with what was kept by another commit.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
import hashlib
from itertools import combinations
import json
import math
from pathlib import Path
import re
import secrets
import sys
import time
from unittest import mock

if __name__ == '__main__':  # pytest has its own paths
    sys.path[:0] = [str(Path(__file__).parents[number]) for number in (1, 2, 3)]

from abdf1_ros.driver.kernel import fallback, plc
from abdf1_ros.driver.kernel.heartbeat import HeartbeatRow
from simulate.rules import Broken
from stories.scenes import Scene, SCENES
from stories.telling import Pointless, Telling

Story = dict[str, str]

_MOST_SHOWN = 10
_NEVER, _OFTEN = 1e6, 1.0  # s, between two writes of a Fallback that stands


def text_of(story: Story) -> str:
    """Return a story as text, one line for each deviation."""
    return '\n'.join(f'{where}: {what}' for where, what in story.items()) or '(as usual)'


def story_of(text: str) -> Story:
    """Return the story of a text."""
    lines = [line.partition(':') for line in text.splitlines() if ':' in line]
    return {where.strip(): what.strip() for where, _, what in lines}


@dataclass(frozen=True, slots=True)
class Told:
    """What came of a story: the rule that it breaks, and all that was written and told."""

    story: Story
    points: tuple[tuple[str, tuple[str, ...]], ...]  # where it could have gone another way
    broken: str
    came: tuple[str, ...]  # what PLCs have executed, and the results, in their order
    seconds: float  # of the plant


def tell(scene: Scene, story: Story) -> Told | None:
    """
    Tell a story; None if a deviation of it changes nothing.

    Only where the scene says so are Fallbacks that stand written again, and heartbeats read back
    (rules 8 and 19): both hide for seconds what a word must not hold.
    """
    broken = ''
    with ExitStack() as stack:
        for module in (fallback, plc):
            stack.enter_context(mock.patch.object(
                module, 'LEAST_REFRESH', _OFTEN if scene.is_refreshed else _NEVER))
        if not scene.is_read_back:
            stack.enter_context(mock.patch.object(
                HeartbeatRow, 'read_back', lambda self, *arguments: ''))
        telling = Telling(scene, story)
        try:
            telling.tell()
        except Pointless:
            return None
        except Broken as error:
            broken = str(error)
    return Told(story, tuple(telling.points), broken, tuple(telling.came()),
                telling.world.line.now)


@dataclass(slots=True)
class Walk:
    """All stories of a scene, fewest deviations first."""

    scene: Scene
    stories: int = 0
    seconds: float = 0.0
    broken: list[Told] = field(default_factory=list)
    reached: set[str] = field(default_factory=set)  # results, without their numbers
    is_complete: bool = True

    def to(self, deviations: int, is_enough: Callable[[], bool] = lambda: False,
           told: Callable[[Told], None] = lambda one: None) -> Iterator[int]:
        """Tell all stories up to so many deviations; yield each number of them when it is done."""
        layer: list[tuple[Story, int]] = [({}, 0)]
        for number in range(deviations + 1):
            following: list[tuple[Story, int]] = []
            for story, first in layer:
                if is_enough():
                    self.is_complete = False
                    return
                one = tell(self.scene, story)
                if one is None:
                    continue
                self._add(one)
                told(one)
                if not one.broken and number < deviations:
                    following += [
                        (story | {where: what}, at + 1)
                        for at, (where, options) in enumerate(one.points[first:], first)
                        for what in options if where not in story]
            yield number
            layer = following

    def _add(self, one: Told) -> None:
        self.stories += 1
        self.seconds += one.seconds
        self.reached.update(re.sub(r'[0-9.]+', '#', line) for line in one.came)
        if one.broken:
            self.broken.append(one)


def shortest(scene: Scene, story: Story) -> Story:
    """Return a part of a story that breaks a rule, too, and no part of which does."""
    for count in range(len(story)):
        for part in combinations(story.items(), count):
            one = tell(scene, dict(part))
            if one is not None and one.broken:
                return dict(part)
    return story


def signature(broken: str) -> str:
    """Return which rule is broken, and how, without numbers."""
    return re.sub(r'[0-9.]+', '#', broken)[:90]


class Ledger:
    """
    What came of each story, as a short hash, by its text; of this tree, or of another.

    ``reached`` is what all of them have reached.
    """

    def __init__(self, path: Path | None) -> None:
        kept = json.loads(path.read_text(encoding='utf-8')) if path is not None else {}
        self._hashes: dict[str, str] = kept.get('stories', {})
        self.reached: set[str] = {*kept.get('reached', ())}

    def add(self, one: Told) -> None:
        """Keep what came of a story."""
        self._hashes[text_of(one.story)] = _hash_of(one)

    def has(self, one: Told) -> bool:
        """Tell whether a story is kept."""
        return text_of(one.story) in self._hashes

    def differs(self, one: Told) -> bool:
        """Tell whether something else came of a story."""
        return self._hashes.get(text_of(one.story)) != _hash_of(one)

    def write(self, path: Path) -> None:
        kept = {'stories': self._hashes, 'reached': sorted(self.reached)}
        path.write_text(json.dumps(kept, indent=0), encoding='utf-8')


def _hash_of(one: Told) -> str:
    return hashlib.sha256('\n'.join((*one.came, one.broken)).encode()).hexdigest()[:16]


def _show(scene: Scene, path: Path) -> int:
    one = tell(scene, story_of(path.read_text(encoding='utf-8')))
    print('it changes nothing' if one is None else '\n'.join((*one.came, one.broken)))
    return int(one is not None and bool(one.broken))


def main() -> int:
    """Walk; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('scene', nargs='?', choices=SCENES, help='without it one is drawn')
    parser.add_argument('--seed', type=int, default=secrets.randbelow(len(SCENES)))
    parser.add_argument('--deviations', type=int, default=1, help='at most, in each story (1)')
    parser.add_argument('--seconds', type=float, default=math.inf, help='of a processor, at most')
    parser.add_argument('--story', type=Path, help='tell the story of this file')
    parser.add_argument('--keep', type=Path, help='keep here what came of each story')
    parser.add_argument('--against', type=Path, help='print stories of which something else came')
    wanted = parser.parse_args()
    scene = SCENES[wanted.scene or [*SCENES][wanted.seed % len(SCENES)]]
    print(f'scene {scene.name}', flush=True)
    if wanted.story:
        return _show(scene, wanted.story)
    kept, before = Ledger(None), Ledger(wanted.against)
    walk, begun, others = Walk(scene), time.process_time(), 0

    def take(one: Told) -> None:
        nonlocal others
        kept.add(one)
        if wanted.against and before.differs(one):
            others += 1
            if others <= _MOST_SHOWN:
                print(f'something else came of\n{text_of(one.story)}', flush=True)

    for number in walk.to(wanted.deviations,
                          lambda: time.process_time() - begun > wanted.seconds, take):
        took = time.process_time() - begun
        print(f'{number} deviations: {walk.stories} stories, {took:.1f} s, '
              f'{walk.stories / took:.0f} a second, {walk.seconds / took:.0f} times real',
              flush=True)
    print(f'{walk.stories} stories, {"all" if walk.is_complete else "not all"} of '
          f'{wanted.deviations} deviations at most')
    if wanted.keep:
        kept.write(wanted.keep)
    found = Counter(signature(one.broken) for one in walk.broken)
    for text, count in found.most_common():
        first = next(one for one in walk.broken if signature(one.broken) == text)
        print(f'{count} x {first.broken}\n{text_of(shortest(scene, first.story))}', flush=True)
    return int(bool(walk.broken) or others > 0)


if __name__ == '__main__':
    sys.exit(main())
