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

"""All clients of one place: how many there may be, and whose command is next."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from itertools import count

from abdf1_ros.cip.identity import CipIdentity
from abdf1_ros.cip.session import EipSession, PcccCommand

MOST_SESSIONS = 32
SILENT = 120.0
"""After this time (s) without a byte a client loses its session to another, if there are 32."""

MOST_OF_SESSION = 16
"""Most commands of a session that wait. All have this many: none fills the place of another."""


class EipSessions:
    """
    The sessions of a place, and their commands, in turns.

    A command that has waited ``patience`` s, or as long as its client waits, is too old.
    """

    def __init__(self, identity: CipIdentity, patience: float) -> None:
        self._identity = identity
        self._patience = patience
        self._numbers = count(1)  # of sessions and connections
        self._turns: deque[EipSession] = deque()  # those with commands, the next one first
        self.all: list[EipSession] = []

    @property
    def waiting(self) -> int:
        """Return how many commands wait."""
        return sum(len(session.waiting) for session in self._turns)

    def came(self, address: str, place: tuple[str, int], now: float) -> EipSession | None:
        """
        Return the session of a new client, None if there are too many.

        The session that has been silent for longest may end for it.
        """
        if len(self.all) >= MOST_SESSIONS:
            oldest = min(self.all, key=lambda session: session.heard)
            if now - oldest.heard <= SILENT:
                return None
            self.ended(oldest)
        session = EipSession(
            address, place, next(self._numbers), self._identity, self._numbers, now)
        self.all.append(session)
        return session

    def ended(self, session: EipSession) -> None:
        """Forget a client and its commands."""
        session.is_over = True
        session.waiting.clear()
        if session in self._turns:
            self._turns.remove(session)
        if session in self.all:
            self.all.remove(session)

    def receive(self, session: EipSession, data: bytes, now: float, came: float
                ) -> Iterator[PcccCommand]:
        """Take bytes of a client that came after ``came``; yield commands that cannot wait."""
        for command in session.receive(data, now, came):
            if len(session.waiting) >= MOST_OF_SESSION:
                yield command
                continue
            session.waiting.append(command)
            if session not in self._turns:
                self._turns.append(session)
        if session.is_over:
            self.ended(session)

    def next(self) -> PcccCommand | None:  # noqa: A003
        """Return the next command, in turns."""
        if not self._turns:
            return None
        session = self._turns.popleft()
        command = session.waiting.popleft()
        if session.waiting:
            self._turns.append(session)
        return command

    def expiry(self, command: PcccCommand) -> float:
        """Return the clock value (s) from which a command is too old."""
        return command.came + min(self._patience, command.patience)

    def expire(self, now: float) -> Iterator[PcccCommand]:
        """Yield the commands that have waited too long; they wait no more."""
        for session in list(self._turns):
            old = [command for command in session.waiting if now >= self.expiry(command)]
            for command in old:
                session.waiting.remove(command)
            if old and not session.waiting:
                self._turns.remove(session)
            yield from old
