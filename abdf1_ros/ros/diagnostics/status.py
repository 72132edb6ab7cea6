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

"""The parts of each status of /diagnostics: levels, and texts of times."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from abdf1_ros.messages import Event
from abdf1_ros.pccc.values import Values
from abdf1_ros.text import age_text, printable
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
WORDS = {OK: 'OK', WARN: 'WARN', ERROR: 'ERROR', DiagnosticStatus.STALE: 'STALE'}

Judgement = tuple[bytes, str]
"""Level and text of a status."""

Moment = tuple[Event | str, float]
"""An event, and its clock value (s)."""


class Status(Protocol):
    """One status of a node; ``judge`` is cheap, ``values`` is not."""

    name: str
    hardware_id: str

    def judge(self, now: float) -> Judgement:
        """Return level and text at the clock value ``now`` (s)."""

    def values(self, now: float) -> dict[str, str]:
        """Return the details at the clock value ``now`` (s)."""


@dataclass(slots=True)
class Seen:
    """Findings of the watches and events of the line, for the statuses to show."""

    duplicate_name: Callable[[], str] = str
    """Returns a text if another node has our name, otherwise an empty text."""
    is_waiting: Callable[[], bool] = bool
    """Returns True if this is a spare, and another bridge may have the line."""
    take_over_fault: str = ''
    """The reason why a spare that has got the line offers nothing."""
    changed_files: Sequence[str] = ()
    """Names of files that have changed since they were read."""
    dds_fault: str = ''
    """The reason why other programs cannot hear this process; empty if none is known."""
    crowded: Sequence[str] = ()
    """Topics with a Fallback and more than one publisher."""
    other_publishers: dict[str, Sequence[str]] = field(default_factory=dict)
    """The other nodes that publish a topic of ours, by topic."""
    strays: Mapping[str, str] = field(default_factory=dict)
    """Who uses names beside our topics and services, and what is missing, by name."""
    refused: Mapping[str, str] = field(default_factory=dict)
    """Topics with Single_Publisher and more than one publisher, with their names."""
    conflicts: dict[str, str] = field(default_factory=dict)
    """
    Text on the value that another program has written over a heartbeat, by tag of the heartbeat.
    """
    latest: Mapping[str, Values] = field(default_factory=dict)
    """The last values that were published, by topic."""
    last_error: Moment | None = None
    last_events: dict[int | None, Moment] = field(default_factory=dict)
    """The last unusual event of each station."""
    last_fallbacks: dict[int, Moment] = field(default_factory=dict)
    """The last fallback value of each station."""
    diagnostics_period: float = 1.0
    """Seconds between two messages of all statuses."""


def message_of(name: str, level: bytes, text: str, place: str,
               values: Mapping[str, str]) -> DiagnosticStatus:
    """Return a status as a message; unprintable characters are made visible."""
    return DiagnosticStatus(
        level=level, name=printable(name), message=printable(text), hardware_id=printable(place),
        values=[KeyValue(key=printable(key), value=printable(value))
                for key, value in values.items()])


def period_of(seen: Seen) -> dict[str, str]:
    """Return the value that tells how soon the next message comes."""
    return {'diagnostics period': f'{seen.diagnostics_period:g} s'}


def with_age(moment: Moment | None, now: float) -> str:
    """Return an event, and how long ago it happened."""
    return 'none' if moment is None else f'{moment[0]} ({age_text(moment[1], now)} ago)'
