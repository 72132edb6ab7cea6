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

"""The program that judges ``conform`` by mutations draws them fairly and judges them rightly."""

from __future__ import annotations

import ast
import sys

from abdf1_ros.conform import codec
from abdf1_ros.conform.case import Target
import pytest
from support import mutated_ends
from support.cases import for_all
from targets import traffic
from targets.mutations import load, Mutation, SOURCES
from targets.run import draw, ENDS, judge, main, Outcome, Setting
from targets.traffic import first_difference, Line

PEER = Setting(Target.PEER, 'CRC', 'SLC')
STEPS = 300


def changed(at: int, old: str, new: str) -> Mutation:
    """Return a mutation of source ``at`` that was written by hand."""
    trees = list(SOURCES)
    text = ast.unparse(trees[at])
    assert text.count(old) == 1, old
    trees[at] = ast.parse(text.replace(old, new))
    return Mutation('by hand', '', old, new, (trees[0], trees[1]))


@for_all('target', [*ENDS])
@for_all(('check', 'family'), [('BCC', 'SLC'), ('CRC', 'PLC5')])
def test_folded_end_says_the_same_as_one_without_habits(
        target: Target, check: str, family: str) -> None:
    setting = Setting(target, check, family)
    lines: list[Line] = []
    for names in (load(), vars(mutated_ends)):
        lines.append(setting.line(names))
        setting.talk(lines[-1], STEPS)
        assert lines[-1].death == ''
    assert first_difference(*lines) == ''
    assert sum(is_said for _, _, is_said in lines[0].log) > STEPS / 8


def test_seed_draws_the_same_mutations_from_each_kind_of_end() -> None:
    first, again, other = draw(5, 8), draw(5, 8), draw(6, 8)
    told = [[(str(setting), mutation.before, mutation.after) for setting, mutation in drawn]
            for drawn in (first, again, other)]
    assert told[0] == told[1] != told[2]
    assert {setting.target for setting, _ in first} == {*ENDS}
    assert all(mutation.before != mutation.after for _, mutation in first)
    assert all(ast.unparse(tree) for _, mutation in first for tree in mutation.trees)


@for_all(('target', 'at', 'old', 'new', 'outcome', 'why'), [
    (Target.PEER, 1, 'code = self._last_response', 'code = _ACK', Outcome.CAUGHT,
     'enquiry-after-nak: expected DLE NAK, got DLE ACK, and 1 more cases'),
    (Target.SLAVE, 1, 'self.say(bytes((_DLE, _EOT)))', 'pass', Outcome.OPEN,
     'poll-idle: silence: EOT suppression may be on, or there is no station'),
    (Target.PEER, 0, 'begin = 2 * element', 'begin = element * 2', Outcome.WITHOUT_EFFECT, ''),
    (Target.PEER, 1, '_ack_timeout = _ACK_TIMEOUT', '_ack_timeout = 2 * _ACK_TIMEOUT',
     Outcome.NOT_CAUGHT, 'to conform, after 10 02'),
    (Target.PEER, 0, '_DONE + bytes(rest[2])', '_DONE', Outcome.NOT_CAUGHT,
     'to anything else, after 10'),
])
def test_what_becomes_of_a_mutation(
        target: Target, at: int, old: str, new: str, outcome: Outcome, why: str) -> None:
    judged = judge(Setting(target, 'CRC', 'SLC'), changed(at, old, new), STEPS)
    assert (judged.outcome, judged.why[:len(why) or None], judged.has_died) == (
        outcome, why, False)


@for_all(('code', 'death'), [
    ('self._no_such', "AttributeError: 'MutatedPeer' object has no attribute '_no_such'"),
    ('[0 for _ in iter(int, 1)]', 'Ended: it is busy for more than 0.05 s')])
def test_end_that_raises_or_does_not_come_back_is_dead(code: str, death: str) -> None:
    before, traffic.LONGEST_TURN = traffic.LONGEST_TURN, 0.05
    try:
        names = load(changed(1, 'code = self._last_response', f'code = {code}').trees)
        line = PEER.line(names)
        line.write(codec.ENQ)
        assert (line.read(3.0), line.clock(), line.death) == (b'', 3.0, death)
    finally:
        traffic.LONGEST_TURN = before


def test_figure_is_printed(capsys: pytest.CaptureFixture[str],
                           monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, 'argv', ['run.py', '--seed', '3', '--count', '2', '--steps', '100'])
    assert main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line[:3] for line in lines] == [' 1 ', '   ', '   ', ' 2 ', '   ', '   ', 'see']
