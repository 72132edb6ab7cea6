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


class Task(Protocol):
    """
    One command on its way, and whoever waits for its reply.

    The link sets ``sent`` when the command has been on the line: without a reply its outcome
    is then unknown. It ends the command by calling ``reply`` or ``fail``, once. ``reply_size``
    is the bytes after the header of a good reply, 0 where that is not known. After ``expires``
    (clock value in s) the command is neither sent nor repeated. ``blames`` tells that a failure
    says something about the station: that of a guest's command does not. No message has asked for
    one that ``is_own``: it goes to an inactive station without a poll before it, and once. The
    answer to that is waited for ``answer_within`` s at most.
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
        """Take note that there will be no reply."""


@dataclass(slots=True)
class Outstanding:
    """
    A task whose command is on its way or waits for its reply.

    ``deadline`` (clock value in s) is when the reply is overdue; it runs from the delivery
    (``is_delivered``), before that as each kind of link has it. ``passed_over`` counts other
    messages that came in its place.
    """

    task: Task
    deadline: float = math.inf
    is_delivered: bool = False
    passed_over: int = 0


class TaskSource(Protocol):
    """Where a link gets its tasks; by itself it has none."""

    def next_task(self, now: float, busy: Container[int] = ()) -> Task | None:
        """Return what has the line next, not for a ``busy`` station; None for nothing."""
        return None

    def next_due(self) -> float | None:
        """Return when something will be due (clock value in s), None for never."""
        return None
