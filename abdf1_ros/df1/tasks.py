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

"""The tasks of a link, which are commands with their replies, and their source."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass
import math
from typing import Protocol

from abdf1_ros.df1.packet import Packet
from abdf1_ros.errors import LinkError
from abdf1_ros.messages import Message


class Task(Protocol):
    """
    One command on its way, and the receiver of its reply.

    The link ends the command by calling ``reply`` or ``fail``, once.

    - ``sent``: set by the link when the command may have been on the line. If no reply comes then,
      it is unknown whether the command was executed.
    - ``reply_size``: bytes after the header of a good reply, 0 if unknown.
    - ``expires``: clock value (s) after which the command is neither sent nor repeated.
    - ``blames``: a failure counts against the station. This is False for commands of guests, and
      for commands that failed before while the station replied to others.
    - ``is_own``: a heartbeat or a fallback, which no message has asked for. It is sent to an
      inactive station once, without a poll before it.
    - ``answer_within``: most seconds that the link waits for the answer of an inactive station.
    """

    command: Packet
    sent: bool
    reply_size: int
    expires: float
    blames: bool
    is_own: bool
    answer_within: float

    def reply(self, packet: Packet) -> None:
        """Take the reply."""

    def fail(self, error: LinkError) -> None:
        """Record that there will be no reply."""


class LineTime(Protocol):
    """The clock of a line, such as its machine: see ``df1.machine.Machine``."""

    now: float
    late: float

    def took(self, begun: float, now: float) -> float: ...


@dataclass(slots=True)
class Outstanding:
    """
    A task whose command is on its way or waits for its reply.

    ``deadline`` is when the reply is overdue (clock value in s), counted from the delivery
    (``is_delivered``). Before the delivery, its value depends on the kind of link. ``passed_over``
    counts other messages that came in place of the reply. ``is_probe``: its station was inactive.
    ``cause`` is what was wrong with its reply, None for nothing. It ``is_hindered`` if another
    damaged reply came meanwhile: the far end sends that one again first.
    """

    task: Task
    deadline: float = math.inf
    is_delivered: bool = False
    passed_over: int = 0
    is_probe: bool = False
    cause: Message | None = None
    is_hindered: bool = False


class TaskSource(Protocol):
    """The source of the tasks of a link; this base class has none."""

    def next_task(self, now: float, busy: Container[int] = ()) -> Task | None:
        """Return the next task that is not for a ``busy`` station, or None."""
        return None

    def next_due(self) -> float:
        """Return when the next task will be due (clock value in s), infinite for never."""
        return math.inf
