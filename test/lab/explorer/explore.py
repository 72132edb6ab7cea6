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
Walk through every story of a tiny plant of the kernel, in breadth; equal states are entered once.

``explore.py 'gateway' --steps 5 --faults 2`` prints the number of states and the first broken
story of each kind. Without a name it explores all plants. A story is text, one line for each step:
its event, and its writes with their ends. ``--mistakes`` makes each mistake of the simulation that
concerns the kernel, and prints the first story that shows it.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Hashable, Iterator, Sequence, Set
from collections.abc import Mapping as MappingType
from dataclasses import dataclass, field, fields, is_dataclass, replace
from enum import Enum
from functools import partial
import math
from pathlib import Path
from random import Random
import re
import sys
import time
from unittest import mock

if __name__ == '__main__':  # pytest has its own paths
    sys.path[:0] = [str(Path(__file__).parents[number]) for number in (1, 2, 3)]

from abdf1_ros.driver.write import Write
from abdf1_ros.settings.mapping import Mapping
from explorer.plants import PLANTS
from explorer.tiny import Broken, Plant, Tiny
from simulate.mistakes import Mistake, MISTAKES

Choices = tuple[int, ...]

_DECIDES = 'abdf1_ros.driver.kernel', 'abdf1_ros.driver.write'
_FAR = 8.0  # s; two times that are further away from now are alike
_MOST = 3  # larger counts are alike
_PASSED_OVER = frozenset((  # statistics, caches of constants, and what is the same in all states
    'plant', 'line', 'mapping', 'row', 'out', 'said', 'asks', 'executed', 'events',
    'replies', 'last_heard', 'last_key', 'remote_errors', 'returns', 'silent_since',
    '_meeting', '_sharing', '_shared', '_names', '_choose', '_blocks', 'step_number'))


class Told:
    """
    A story that was told: its choices, how many there were at each, and its text.

    ``is_long``: its end is told, too, until all is at rest.
    """

    def __init__(self, plant: Plant, choices: Choices, steps: int, *,
                 is_long: bool = False) -> None:
        self.choices: list[int] = []
        self.counts: list[int] = []
        self.lines: list[str] = []
        self._given = choices
        self.broken = ''
        self.tiny = Tiny(plant, self._choose)
        try:
            for number in range(steps):
                self.lines.append(f'step {number + 1}')
                self.tiny.step()
            if is_long:
                self.tiny.rest()
        except Broken as error:
            self.broken = str(error)

    def _choose(self, where: str, options: Sequence[str]) -> str:
        at = len(self.choices)
        which = self._given[at] if at < len(self._given) else 0
        self.choices.append(which)
        self.counts.append(len(options))
        if options[which]:
            self.lines.append(f'  {where}: {options[which]}')
        return options[which]

    def others(self, since: int) -> Iterator[Choices]:
        """Return the stories that go another way at one choice from ``since`` on."""
        for at in range(since, len(self.choices)):
            for which in range(1, self.counts[at]):
                yield (*self.choices[:at], which)


class Digest:
    """A state as a value: all times relative to now, all names of messages left out."""

    def __init__(self, tiny: Tiny) -> None:
        self._now = tiny.now
        self._seen: dict[int, int] = {}
        self.value = hash((self._of(tiny), len(tiny.asks), tiny.events, tiny.faults))

    def _of(self, it: object) -> Hashable:  # noqa: C901
        if it is None or isinstance(it, str | bool | bytes | Enum | complex):
            return it
        if isinstance(it, int):
            return min(it, 1000)
        if isinstance(it, float):
            away = it - self._now
            return round(away, 3) if -_FAR < away < _FAR else away > 0
        if isinstance(it, Mapping):
            return it.tag
        if isinstance(it, Write):
            return it.mapping.tag, str(it.raw), self._of(it.requested), self._of(it.oldest)
        if id(it) in self._seen:
            return self._seen[id(it)]
        self._seen[id(it)] = len(self._seen)
        if isinstance(it, MappingType):
            return tuple((self._of(key), self._of(value)) for key, value in it.items())
        if isinstance(it, Set):
            return tuple(sorted(map(str, map(self._of, it))))
        if isinstance(it, Sequence):  # also a deque
            return tuple(map(self._of, it))
        if callable(it) or isinstance(it, Random):
            return None
        return type(it).__name__, *self._parts(it)

    def _parts(self, it: object) -> Iterator[Hashable]:
        names = [each.name for each in fields(it)] if is_dataclass(it) else vars(it)
        for name in names:
            if name not in _PASSED_OVER:
                value = getattr(it, name)
                if isinstance(value, int) and not isinstance(value, bool):
                    value = min(value, _MOST) if name in (
                        'tries', 'failures', 'unanswered', 'overdue', 'in_vain') else value
                yield self._of(value)


@dataclass(slots=True)
class Exploration:
    """All stories of a plant, by the number of their steps."""

    plant: Plant
    states: int = 0
    stories: int = 0
    reached: set[str] = field(default_factory=set)
    broken: dict[str, Told] = field(default_factory=dict)  # by the demand, without numbers

    def run(self, *, is_enough: Callable[[], bool] = lambda: False) -> None:
        """
        Explore all states up to the depth of the plant; then let each story come to rest.

        It ends early if it ``is_enough``.
        """
        layer: list[Choices] = [()]
        known: set[Hashable] = set()
        for steps in range(1, self.plant.steps + 1):
            following: list[Choices] = []
            for begun in layer:
                if is_enough():
                    return
                for told in self._step(begun, steps):
                    state = Digest(told.tiny).value
                    if state not in known:
                        known.add(state)
                        following.append(tuple(told.choices))
            layer = following
        self.states = len(known)
        for choices in layer:
            if is_enough():
                return
            self._judge(Told(self.plant, choices, self.plant.steps, is_long=True))

    def _step(self, begun: Choices, steps: int) -> Iterator[Told]:
        """Tell all stories that go on from ``begun`` for one step; yield those that hold."""
        waiting: list[Choices] = [begun]
        while waiting:
            told = Told(self.plant, choices := waiting.pop(), steps)
            waiting += told.others(max(len(begun), len(choices)))
            if self._judge(told):
                yield told

    def _judge(self, told: Told) -> bool:
        self.stories += 1
        self.reached.update(told.tiny.said)
        if told.broken:
            kind = re.sub(r'[0-9.]+', '#', told.broken)
            self.broken.setdefault(kind, told)
        return not told.broken


def find(mistake: Mistake) -> tuple[str, Told] | None:
    """Return the plant and the first story that breaks a demand with a mistake, None for none."""
    made = mistake.make(getattr(mistake.owner, mistake.name))
    with mock.patch.object(mistake.owner, mistake.name, made):
        for name, plant in PLANTS.items():
            exploration = Exploration(plant)
            exploration.run(is_enough=partial(bool, exploration.broken))
            if exploration.broken:
                return name, next(iter(exploration.broken.values()))
    return None


def of_kernel() -> list[Mistake]:
    """Return the mistakes in what the kernel decides."""
    return [mistake for mistake in MISTAKES
            if getattr(mistake.owner, '__module__', '').startswith(_DECIDES)]


def _find_all() -> int:
    found, chosen = 0, of_kernel()
    for mistake in chosen:
        begun = time.process_time()
        told = find(mistake)
        found += told is not None
        how = 'NOT FOUND' if told is None else f'{told[0]}, {told[1].broken}'
        print(f'{mistake.rule}, {mistake.text}: {how} ({time.process_time() - begun:.1f} s)',
              flush=True)
    print(f'{found} of {len(chosen)} found')
    return 0


def _is_over(end: float) -> bool:
    return time.process_time() >= end


def main() -> int:
    """Explore; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('plant', nargs='?', choices=[*PLANTS], help='without it all, or by seed')
    parser.add_argument('--steps', type=int, help='length of each story, in quarters of a second')
    parser.add_argument('--events', type=int, help='at most, in each story')
    parser.add_argument('--faults', type=int, help='at most, in each story')
    parser.add_argument('--seed', type=int, help='one plant that it draws')
    parser.add_argument('--seconds', type=float, default=math.inf, help='of a processor, at most')
    parser.add_argument('--mistakes', action='store_true', help='make each mistake, and find it')
    asked = parser.parse_args()
    if asked.mistakes:
        return _find_all()
    changes = {name: value for name, value in (
        ('steps', asked.steps), ('most_events', asked.events), ('most_faults', asked.faults))
        if value is not None}
    broken, names = 0, [asked.plant] if asked.plant else [*PLANTS]
    if asked.seed is not None:
        names = [Random(asked.seed).choice(names)]
    for name in names:
        begun = time.process_time()
        exploration = Exploration(replace(PLANTS[name], **changes))
        exploration.run(is_enough=partial(_is_over, begun + asked.seconds))
        seconds = time.process_time() - begun
        print(f'{name}: {exploration.states} states, {exploration.stories} stories, '
              f'{seconds:.1f} s, {len(exploration.broken)} kinds broken', flush=True)
        for told in exploration.broken.values():
            print(f'  {told.broken}')
            print('\n'.join(f'    {line}' for line in told.lines))
        broken += len(exploration.broken)
    return 1 if broken else 0


if __name__ == '__main__':
    sys.exit(main())
