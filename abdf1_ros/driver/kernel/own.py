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

"""What rows that the bridge writes by itself have in common, and what all of them depend on."""

from __future__ import annotations

from dataclasses import dataclass, field
import math

from abdf1_ros.driver.kernel.flights import Flight, Words
from abdf1_ros.driver.write import Outcome
from abdf1_ros.errors import RemoteError
from abdf1_ros.settings.mapping import Mapping


@dataclass(frozen=True, slots=True)
class Crowd:
    """
    A topic has, or had, more than one publisher, and one of its rows allows one only (rule 28).

    Messages that were published up to ``until`` (clock value in s) are refused. It is infinite
    while more than one publisher is alive. ``why`` is the reason for the results, with names.
    """

    why: str
    until: float = math.inf


@dataclass(slots=True)
class Conditions:
    """
    Conditions that all PLCs of a line depend on.

    Times are clock values (s).

    - ``executor``: when the ROS executor ran last.
    - ``messages``: publication time of the last accepted message of each topic.
    - ``crowds``: the last crowd of each topic of rows with Single_Publisher. The thread of the
      callbacks sets it before it hands on a message that came since.
    - ``is_final``: the bridge ends; ``is_paused``: it gives up the port, or its files. Each of
      them has one thread that sets it.
    - ``ended``: when the end began, infinite before it.
    - ``gave_way``: when heartbeats last gave way to a fallback that stands.
    - ``is_beats_turn``: they have just given way to such a fallback, or to a read.
    """

    executor: float = -math.inf
    messages: dict[str, float] = field(default_factory=dict)
    crowds: dict[str, Crowd] = field(default_factory=dict)
    is_final: bool = False
    is_paused: bool = False
    ended: float = math.inf
    gave_way: float = -math.inf
    is_beats_turn: bool = False

    @property
    def is_ending(self) -> bool:
        """Tell whether the bridge is to end, for good or for a while."""
        return self.is_final or self.is_paused

    @property
    def are_all_due(self) -> bool:
        """Tell whether the end has begun."""
        return self.ended < math.inf


class SelfWritten:
    """
    One row that the bridge writes by itself.

    - ``words``: the writes that may change its words.
    - ``trial``: its last write, None before the first.
    - ``repeat``: the write at the end of a value that stood.
    - ``tries``: number of writes since a value became due.
    - ``asked``: when a value became due last (clock value in s).
    - ``refusal``: why the last write was not confirmed.
    """

    def __init__(self, words: Words, conditions: Conditions) -> None:
        self.mapping: Mapping = words.row
        self.words = words
        self.conditions = conditions
        self.trial: Flight | None = None
        self.repeat: Flight | None = None
        self.tries = 0
        self.asked = math.inf
        self.refusal = ''

    @property
    def latest(self) -> Flight | None:
        """Return the last write of the row, a ``trial`` or a ``repeat``."""
        trial, repeat = self.trial, self.repeat
        return repeat if repeat is not None and (
            trial is None or repeat.begun > trial.begun) else trial

    @property
    def is_under_way(self) -> bool:
        """Tell whether a write of the row is under way."""
        latest = self.latest
        return latest is not None and latest.outcome is None

    @property
    def tried(self) -> float:
        """Return when the last write of the row had its turn (clock value in s)."""
        latest = self.latest
        return latest.begun if latest is not None else -math.inf

    @property
    def confirmed(self) -> float | None:
        """Return when the last reply confirmed a value of the row, None before the first."""
        last = self.words.last
        return last.done if last is not None else None

    @property
    def has_confirmed(self) -> bool:
        """Tell whether the last write of the row was confirmed."""
        return self.trial is not None and self.trial.outcome is Outcome.WRITTEN

    def note_refusal(self, flight: Flight) -> str:
        """Record why a write of the row was not confirmed; return a new refusal of the PLC."""
        if flight.outcome is Outcome.NOT_SENT:
            return ''
        before, error = self.refusal, flight.error
        self.refusal = '' if flight.outcome is Outcome.WRITTEN else str(error)
        return self.refusal if isinstance(error, RemoteError) and self.refusal != before else ''

    @property
    def again_at(self) -> float:
        """Return when a confirmed value is written a second time (clock value in s; rule 10)."""
        return self.words.again_at(self.conditions.ended)
