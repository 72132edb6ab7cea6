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

"""Alarms: which state of a bit is reported as a fault of the plant."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from abdf1_ros.numbers import ValueKind


class AlarmLevel(Enum):
    """How bad an alarm is, in the words of /diagnostics."""

    WARN = 'WARN'
    ERROR = 'ERROR'


@dataclass(frozen=True, slots=True)
class Alarm:
    """The ``state`` of a bit (0 or 1) that is an alarm, and the ``level`` of the alarm."""

    level: AlarmLevel
    state: int = 1

    def __str__(self) -> str:
        return self.level.value if self.state else f'{self.level.value} 0'


def _read(text: str) -> Alarm | None:
    known = {str(alarm): alarm for alarm in (
        Alarm(level, state) for level in AlarmLevel for state in (0, 1))}
    return known.get(' '.join(text.upper().removesuffix(' 1').split()))


ALARM = ValueKind(_read, 'WARN or ERROR, for a 1; WARN 0 or ERROR 0, for a 0')
