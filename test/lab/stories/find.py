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
Make each mistake of the simulation, and find a story that shows it.

``find.py`` tells all stories of the small scenes with one deviation; it prints the story, or that
there is none. Mistakes in what the stories leave out (values, other modes) are not found.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
import sys
import time
from unittest import mock

if __name__ == '__main__':  # pytest has its own paths
    sys.path[:0] = [str(Path(__file__).parents[number]) for number in (1, 2, 3)]

from simulate.mistakes import Mistake, MISTAKES
from stories.scenes import SCENES, SMALL
from stories.walk import shortest, text_of, Told, Walk


def find(mistake: Mistake, deviations: int) -> tuple[str, Told] | None:
    """Return the scene and the first story that breaks a rule with a mistake, None for none."""
    made = mistake.make(getattr(mistake.owner, mistake.name))
    with mock.patch.object(mistake.owner, mistake.name, made):
        for name in SMALL:
            walk = Walk(SCENES[name])
            for _ in walk.to(deviations, partial(bool, walk.broken)):
                pass
            if walk.broken:
                one = walk.broken[0]
                story = shortest(SCENES[name], one.story)
                return name, Told(story, one.points, one.broken, one.came, one.seconds)
    return None


def main() -> int:
    """Make each mistake; return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--deviations', type=int, default=1, help='at most, in each story (1)')
    parser.add_argument('--only', default='', help='rules or texts that hold this')
    wanted = parser.parse_args()
    found = 0
    chosen = [each for each in MISTAKES if wanted.only in f'{each.rule} {each.text}']
    for mistake in chosen:
        begun = time.process_time()
        told = find(mistake, wanted.deviations)
        found += told is not None
        how = 'NOT FOUND' if told is None else (
            f'{told[0]}, {text_of(told[1].story)!r}: {told[1].broken.partition(":")[0]}')
        print(f'{mistake.rule}, {mistake.text}: {how} ({time.process_time() - begun:.1f} s)',
              flush=True)
    print(f'{found} of {len(chosen)} found')
    return 0


if __name__ == '__main__':
    sys.exit(main())
