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

"""
A line with another master: we hear it, and never send anything.

The specification does not have this mode. ``driver.overheard`` uses the bytes that are heard.
"""

from __future__ import annotations

from collections.abc import Callable
import math
from typing import Protocol

from abdf1_ros.counters import Counters
from abdf1_ros.df1.link import Link
from abdf1_ros.df1.machine import Background, Listen, Machine, MOST_LATE, OLD, Procedure
from abdf1_ros.df1.mode import LineMode
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkSettings
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import TaskSource
from abdf1_ros.messages import Event

# Interval (s) of looks. A pause of this process that is longer than this interval plus MOST_LATE
# is noticed.
_LOOK = 0.1

# If the line needs more than these seconds for the bytes of some reads, they have waited in a
# buffer. But a device server may send a whole message at once: it has at most these characters.
_BUFFERED = 0.3
_LONGEST_MESSAGE = 300


class SecondPort(bytes):
    """Bytes of the second port of a line that is heard on two ports."""


class ByteListener(Protocol):
    """A user of the bytes of a line."""

    def hear(self, data: bytes, now: float) -> None:
        """Take bytes, read at a clock value (s)."""

    def forget(self, now: float) -> None:
        """Record that bytes are missing from here on."""

    def look(self, now: float) -> None:
        """Do what is due."""


class ListeningMachine(Machine):
    """
    Give all bytes to ``listener``, and send none.

    After a pause of this process the age of the first bytes is unknown: they are dropped. So are
    the bytes of a connection that come faster than the line brings them.
    """

    listener: ByteListener
    _line_until = -math.inf  # when the bytes of the last reads end on the line

    def came(self, count: int, now: float) -> None:
        """Judge whether the bytes of a read are old."""
        self._line_until = max(self._line_until, now) + count * self.timing.char_time
        if self._line_until > now + max(_BUFFERED, _LONGEST_MESSAGE * self.timing.char_time):
            if now >= self._old_until:
                self.listener.forget(now)
            # A network brings such bytes in pieces, with pauses between them.
            self._line_until, self._old_until = now, now + OLD

    def receive_data(self, data: bytes, now: float) -> None:
        """Take bytes from the line."""
        self.now = now
        self.counters.chars_received += len(data)
        if not self.may_be_old:
            self.listener.hear(data, now)
        elif self.is_behind:  # the bytes that still wait are as old as these
            self._old_until = now + OLD

    def handle_timeout(self, now: float) -> None:
        """Do what is due when the clock reads ``now``."""
        is_late = self.deadline is not None and now - self.deadline > MOST_LATE
        super().handle_timeout(now)
        if is_late:
            self._old_until = now + OLD
            self.listener.forget(now)
        self.listener.look(now)

    def data_to_send(self) -> bytes:
        """Return nothing."""
        return b''


class ListeningLink(Link):
    """The link of a line that we only hear; it does nothing."""

    def __init__(self, machine: Machine, settings: LinkSettings, stations: ActiveStationList,
                 serve: Callable[[Packet], Packet], report: Callable[[Event], None]) -> None:
        """Take the arguments of every link; this one needs none."""

    def run(self, source: TaskSource) -> Procedure:
        """Look at the clock again and again; never take a task."""
        while True:
            yield Listen(_LOOK)


class ListenMode(LineMode):
    """The mode in which another master asks, and we only listen."""

    name = 'Listen'
    link = ListeningLink
    only_listens = True
    is_polled = True
    why_unshared = 'in Mode Listen nothing is sent'

    def make_machine(self, line: LinkSettings, run: Callable[[], Procedure], counters: Counters,
                     background: Background | None = None) -> Machine:
        """Return the machine, whose ``listener`` is still to be set."""
        return ListeningMachine(lambda machine: run(), checksum=line.checksum, timing=line.timing,
                                counters=counters, background=background)


LISTEN = ListenMode()
