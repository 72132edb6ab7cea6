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

"""Let a guest's command wait longer each time that its station does not answer it."""

from __future__ import annotations

from dataclasses import dataclass
import math

from abdf1_ros.df1.packet import Packet

# The pause after each try in a row without an answer, in times of the line time of the last one.
# The first changes nothing: noise may have taken the reply.
_PAUSES = (0, 8, 16, 32, 64)
_LONGEST = 60.0  # s

_MOST = 64  # commands that are remembered


@dataclass(frozen=True, slots=True)
class _Tries:
    """The number of tries in a row without an answer, and when the next may be (clock, s)."""

    count: int = 0
    next: float = -math.inf  # noqa: A003


class UnansweredCommands:
    """
    Remember the commands without an answer, and when each may be sent again.

    Commands are equal if their station, CMD and data are. An answer ends the pauses of a command.
    The 64 commands that were tried last are remembered.
    """

    def __init__(self) -> None:
        self._tries: dict[tuple[int, int, bytes], _Tries] = {}  # the latest is the last

    def may_be_sent(self, station: int, command: Packet, now: float) -> bool:
        """Tell whether the pause of a command is over."""
        tries = self._tries.get(_key(station, command))
        return tries is None or now >= tries.next

    def tried(self, station: int, command: Packet, took: float, now: float, *,
              is_answered: bool) -> None:
        """Record the end of a try, which has used the line for ``took`` seconds."""
        key = _key(station, command)
        before = self._tries.pop(key, _Tries())
        if is_answered:
            return
        pause = took * _PAUSES[min(before.count, len(_PAUSES) - 1)]
        self._tries[key] = _Tries(before.count + 1, now + min(pause, _LONGEST))
        if len(self._tries) > _MOST:
            del self._tries[next(iter(self._tries))]


def _key(station: int, command: Packet) -> tuple[int, int, bytes]:
    return station, command.cmd, command.data
