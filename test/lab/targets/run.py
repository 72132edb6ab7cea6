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
Judge ``conform``: mutate its targets, and print which mutations it catches.

Each seed draws 20 mutations over the six kinds of end (``mutations.py``) and lets the cases of
``conform`` judge each of them. A mutation is

- caught, if a case fails that passes without it, or no case can be tried any more (both end
  ``conform`` with status 1);
- open, if a case that passes without it is skipped: the user reads why;
- without effect, if the end says the same, byte for byte and at the same times, to all cases and
  to --steps random pieces (``traffic.py``);
- not caught otherwise; then the first difference is printed.

A place is drawn only where random pieces get to. The same seed and code give the same lines.
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import dataclass
from enum import Enum
from functools import cache
from pathlib import Path
from random import Random
import sys

if __name__ == '__main__':  # pytest has its own paths
    sys.path[:0] = [str(Path(__file__).parents[number]) for number in (1, 2, 3)]

from abdf1_ros.conform.case import CaseResult, Target, Verdict
from support.conformance import results_of
from targets.mutations import FILES, load, mutate, Mutation
from targets.traffic import first_difference, Line, reached, Stranger

ENDS = {Target.SLAVE: 'MutatedSlave', Target.PEER: 'MutatedPeer', Target.MASTER: 'MutatedMaster',
        Target.CLIENT: 'MutatedClient', Target.RADIO: 'MutatedRadioNode',
        Target.RADIO_CLIENT: 'MutatedRadioClient'}

_ANSWERING = (Target.SLAVE, Target.PEER, Target.RADIO)
_STEPS_TO_REACH = 1000  # as many lines as 6000 reach


class Outcome(Enum):
    """What became of a mutation."""

    CAUGHT = 'caught'
    OPEN = 'open'
    WITHOUT_EFFECT = 'without effect'
    NOT_CAUGHT = 'NOT CAUGHT'


@dataclass(frozen=True, slots=True)
class Setting:
    """A kind of end, the check of its line, and the family of the PLC behind it."""

    target: Target
    check: str
    family: str

    def line(self, names: dict[str, type]) -> Line:
        """Return a line to such an end."""
        options = {'family': self.family} if self.target in _ANSWERING else {}
        return Line(lambda: names[ENDS[self.target]](self.check, **options))

    def conform(self, line: Line) -> dict[str, CaseResult]:
        """Return how the cases of conform end, by their names."""
        return {result.case.name: result for result in results_of(
            line, self.target, self.check, self.family)}

    def talk(self, line: Line, steps: int, seed: int = 1) -> None:
        """Let a stranger say anything to the end."""
        Stranger(line, self.target, self.check, self.family, seed).talk(steps)

    def __str__(self) -> str:
        """Return it in words."""
        family = f', {self.family}' if self.target in _ANSWERING else ''
        return f'{self.target.value}, {self.check}{family}'


@dataclass(frozen=True, slots=True)
class Judgement:
    """One mutation, what became of it, and why."""

    setting: Setting
    mutation: Mutation
    outcome: Outcome
    why: str
    has_died: bool


def judge(setting: Setting, mutation: Mutation, steps: int) -> Judgement:
    """Let conform judge a mutation; where it catches nothing, look for any difference."""
    right, line = setting.line(load()), setting.line(load(mutation.trees))
    before, after = setting.conform(right), setting.conform(line)
    outcome, why = _told(before, after)
    if outcome is None:
        why = first_difference(right, line)
        if not why:
            right, line = setting.line(load()), setting.line(load(mutation.trees))
            setting.talk(right, steps)
            setting.talk(line, steps)
            why = first_difference(right, line)
            outcome = Outcome.NOT_CAUGHT if why else Outcome.WITHOUT_EFFECT
            why = f'to anything else, {why}' if why else ''
        else:
            outcome, why = Outcome.NOT_CAUGHT, f'to conform, {why}'
    return Judgement(setting, mutation, outcome, why, bool(line.death))


def _told(before: dict[str, CaseResult], after: dict[str, CaseResult]
          ) -> tuple[Outcome | None, str]:
    """Return what the cases have told that they do not tell without the mutation."""
    if {result.verdict for result in after.values()} == {Verdict.SKIP}:
        return Outcome.CAUGHT, f'no rule was tried: {next(iter(after.values())).got}'
    news = [result for name, result in after.items()
            if result.verdict is not before[name].verdict]
    for verdict, outcome in ((Verdict.FAIL, Outcome.CAUGHT), (Verdict.SKIP, Outcome.OPEN)):
        cases = [result for result in news if result.verdict is verdict]
        if cases:
            first, more = cases[0], f', and {len(cases) - 1} more cases' * (len(cases) > 1)
            expected = f'expected {first.expected}, got ' if first.expected else ''
            return outcome, f'{first.case.name}: {expected}{first.got}{more}'
    return None, ''


@cache
def _reached(setting: Setting) -> frozenset[tuple[str, int]]:
    """Return the lines of an end that random pieces get to."""
    with reached(*FILES) as lines:
        setting.talk(setting.line(load()), _STEPS_TO_REACH)
    return frozenset(lines)


def draw(seed: int, count: int) -> list[tuple[Setting, Mutation]]:
    """Draw mutations, the kinds of end in turns."""
    random, drawn = Random(seed), []
    targets = [target for _ in range(-(-count // len(ENDS)))
               for target in random.sample([*ENDS], len(ENDS))]
    for target in targets[:count]:
        setting = Setting(target, random.choice(('BCC', 'CRC')), random.choice(('SLC', 'PLC5')))
        drawn.append((setting, mutate(random, ENDS[target], _reached(setting))))
    return drawn


def main() -> int:
    """Run; return the exit status: 1 if an end fails without a mutation."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--seed', type=int, action='append', required=True,
                        help='of the mutations; more than one is possible')
    parser.add_argument('--count', type=int, default=20, help='mutations a seed (%(default)s)')
    parser.add_argument('--steps', type=int, default=5000,
                        help='random pieces that show that nothing differs (%(default)s)')
    options = parser.parse_args()
    for target in ENDS:
        for check, family in (('BCC', 'SLC'), ('CRC', 'PLC5')):
            setting = Setting(target, check, family)
            wrong = [result for result in setting.conform(setting.line(load())).values()
                     if result.verdict is Verdict.FAIL]
            if wrong:
                print(f'{setting}, without a mutation: {wrong[0].case.name} fails')
                return 1
    for seed in options.seed:
        _report(seed, [judge(setting, mutation, options.steps) for setting, mutation in draw(
            seed, options.count)])
    return 0


def _report(seed: int, judgements: list[Judgement]) -> None:
    for number, judged in enumerate(judgements, 1):
        mutation = judged.mutation
        print(f'{number:2} {judged.setting}: {mutation.operator} in {mutation.owner}\n'
              f'   {mutation.before or "nothing"}  ->  {mutation.after or "nothing"}\n'
              f'   {judged.outcome.value}{": " * bool(judged.why)}{judged.why}')
    counts = Counter(judged.outcome for judged in judgements)
    dead = sum(judged.outcome is Outcome.CAUGHT and judged.has_died for judged in judgements)
    seen = len(judgements) - counts[Outcome.WITHOUT_EFFECT]
    print(f'seed {seed}: {counts[Outcome.CAUGHT]} of {seen} caught ({dead} of them as the end has '
          f'died), {counts[Outcome.OPEN]} open, {counts[Outcome.NOT_CAUGHT]} not caught; '
          f'{counts[Outcome.WITHOUT_EFFECT]} of {len(judgements)} without effect', flush=True)


if __name__ == '__main__':
    sys.exit(main())
