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

"""A case: one rule of the manual, how it is tried, and the result."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Protocol, TypeAlias

from abdf1_ros.conform.transcript import Sent
from abdf1_ros.conform.wire import Failed, Skipped, Wire


class Target(Enum):
    """The kind of the target."""

    SLAVE = 'slave'
    MASTER = 'master'
    PEER = 'peer'
    CLIENT = 'client'
    RADIO = 'radio'
    RADIO_CLIENT = 'radio-client'

    @property
    def is_half_duplex(self) -> bool:
        """Tell whether it is on a half-duplex line."""
        return self in (Target.SLAVE, Target.MASTER)

    @property
    def is_radio(self) -> bool:
        """Tell whether it is a node of a radio modem network."""
        return self in (Target.RADIO, Target.RADIO_CLIENT)


class Permission(Enum):
    """The permission that a case needs, with the option that gives it."""

    NOTHING = ''
    RESET = '--yes: every slave on the line drops its messages'
    WRITE = '--yes and --words: words that may be overwritten'


class Verdict(Enum):
    PASS = 'PASS'
    FAIL = 'FAIL'
    SKIP = 'SKIP'


class End(Protocol):
    """The end of the line that we play."""

    def settle(self) -> None:
        """Wait until the target has finished the work of the case before."""

    def check_target(self) -> None:
        """Raise Skipped if the case has ended without an answer, and the target gives none."""


CaseScript: TypeAlias = Callable[[Any], None]
"""Plays a case with the End for its targets; raises Failed or Skipped."""


@dataclass(frozen=True, slots=True)
class Case:
    """
    One rule.

    ``name`` is unique, ``rule`` is what the manual requires of the target, ``source`` is its page.
    """

    name: str
    rule: str
    source: str
    targets: tuple[Target, ...]
    run: CaseScript
    permission: Permission = Permission.NOTHING


@dataclass(frozen=True, slots=True)
class CaseResult:
    """The result of a case; ``seconds`` is its time, ``transcript`` has the bytes of the line."""

    case: Case
    verdict: Verdict
    seconds: float = 0.0
    expected: str = ''
    got: str = ''
    transcript: tuple[str, ...] = field(default=())


# Longest time (s) of a case, and of a run, so that it has a verdict in 15 minutes. No case begins
# that could take longer, with the time to restore the words of the target.
LONGEST_CASE = 290.0
LONGEST_RUN = 890.0


def case(rule: str, source: str, *targets: Target,
         permission: Permission = Permission.NOTHING) -> Callable[[CaseScript], Case]:
    """Make a function a case of ``targets``, named after the function."""
    def made(run: CaseScript) -> Case:
        return Case(run.__name__.replace('_', '-'), rule, source, targets, run, permission)
    return made


def run_cases(cases: Iterable[Case], wire: Wire, end: End,
              allowed: frozenset[Permission]) -> Iterator[CaseResult]:
    """
    Yield the result of each case, in their order.

    The caller handles OSError of the line.
    """
    last = wire.begun + LONGEST_RUN - LONGEST_CASE - wire.restoring_time
    for entry in cases:
        if entry.permission not in allowed:
            yield CaseResult(entry, Verdict.SKIP, got=f'needs {entry.permission.value}')
            continue
        begun = wire.now
        if begun > last:
            yield CaseResult(entry, Verdict.SKIP, got='not tried: the run has taken too long')
            continue
        verdict, expected, got = Verdict.PASS, '', ''
        wire.begin(LONGEST_CASE)
        try:
            end.settle()
            wire.begin(LONGEST_CASE + begun - wire.now)
            begun = wire.now
            entry.run(end)
            end.check_target()
        except Failed as failure:
            verdict, expected, got = Verdict.FAIL, failure.expected, failure.got
        except Skipped as reason:
            verdict, got = Verdict.SKIP, str(reason)
        yield CaseResult(entry, verdict, wire.now - begun, expected, got, _told(wire, begun))


def _told(wire: Wire, begun: float) -> tuple[str, ...]:
    return tuple(
        f'{(entry.at - begun) * 1000:9.1f} ms {"we  " if isinstance(entry, Sent) else "they"} '
        f'{entry.raw.hex(" ").upper()}' for entry in wire.transcript.entries)
