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

"""What the statuses of /diagnostics are made of: levels, and texts of times."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from abdf1_ros.messages import Event
from abdf1_ros.pccc.values import Values
from abdf1_ros.text import printable
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
WORDS = {OK: 'OK', WARN: 'WARN', ERROR: 'ERROR', DiagnosticStatus.STALE: 'STALE'}

Judgement = tuple[bytes, str]
"""Level and text of a status."""

Moment = tuple[Event | str, float]
"""What has happened, and when (clock value in s)."""


class Status(Protocol):
    """One status of a node: its level and text are cheap to ask for, the details are not."""

    name: str
    hardware_id: str

    def judge(self, now: float) -> Judgement:
        """Return level and text at the clock value ``now`` (s)."""

    def values(self, now: float) -> dict[str, str]:
        """Return the details at the clock value ``now`` (s)."""


@dataclass(slots=True)
class Seen:
    """What watches and the events of the line have shown, for the statuses."""

    duplicate_name: Callable[[], str] = str
    """Tells that another node has our name, empty while none has."""
    changed_files: Sequence[str] = ()
    """Names of files that have changed since they were read."""
    crowded: Sequence[str] = ()
    """Topics with a Fallback and more than one publisher."""
    conflicts: dict[str, str] = field(default_factory=dict)
    """What another program has written over a heartbeat, by its tag."""
    latest: Mapping[str, Values] = field(default_factory=dict)
    """The last values that were published, by topic."""
    last_error: Moment | None = None
    last_events: dict[int | None, Moment] = field(default_factory=dict)
    """The last thing unusual at each station."""
    last_fallbacks: dict[int, Moment] = field(default_factory=dict)
    """The last fallback value of each station."""


def message_of(name: str, level: bytes, text: str, place: str,
               values: Mapping[str, str]) -> DiagnosticStatus:
    """Return a status as a message, in which all characters are visible."""
    return DiagnosticStatus(
        level=level, name=printable(name), message=printable(text), hardware_id=printable(place),
        values=[KeyValue(key=printable(key), value=printable(value))
                for key, value in values.items()])


def with_age(moment: Moment | None, now: float) -> str:
    """Return the last event, and how long ago it was."""
    return 'none' if moment is None else f'{moment[0]} ({now - moment[1]:.1f} s ago)'
