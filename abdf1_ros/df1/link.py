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

"""The common base of all links, and the details that diagnostics show of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Protocol

from abdf1_ros.df1.accounting import Accounting
from abdf1_ros.df1.frames import ACK, Frame, Symbol
from abdf1_ros.df1.machine import Machine, MIN_RESPONSE_TIME, Procedure
from abdf1_ros.df1.packet import Packet, REPLY_BIT
from abdf1_ros.df1.sender import Reflex
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import TaskSource
from abdf1_ros.messages import Event


@cache
def ack_on_reply(sender: int | None = None) -> Reflex:
    """Return the reflex: ACK to a good reply whose DST is not SRC, from ``sender`` if given."""
    def reflex(symbol: Symbol) -> bytes:
        if not isinstance(symbol, Frame) or symbol.fault is not None or symbol.station is not None:
            return b''
        dst, src, cmd = symbol.data[:3]
        return ACK if cmd & REPLY_BIT and dst != src and sender in (src, None) else b''
    return reflex


@dataclass(slots=True)
class ScanTimes:
    """Seconds that the last and the longest scan of a poll list took, None before the first."""

    last: float | None = None
    longest: float | None = None

    def add(self, seconds: float) -> None:
        """Record the time of a scan."""
        self.last = seconds
        self.longest = max(self.longest or 0.0, seconds)


@dataclass(frozen=True, slots=True)
class LinkState:
    """
    Details that only some kinds of links have.

    - ``last_poll``: clock value (s) of the last poll that a slave got, or of its start.
    - ``same_number``: clock value (s) of the last packet of another radio modem node with our
      number.
    - ``scans``: times of the poll lists of a master, by their names.
    """

    last_poll: float | None = None
    same_number: float | None = None
    scans: Mapping[str, ScanTimes] = field(default_factory=dict)


NO_STATUS = LinkState()

# Pause, in characters, that ends a message that has broken off. The time that the equipment may
# hold bytes back is added.
_QUIET_CHARACTERS = 10


def quiet_time(char_time: float) -> float:
    """Return the seconds of silence after which no more bytes of a broken message follow."""
    return MIN_RESPONSE_TIME + _QUIET_CHARACTERS * char_time


class Link(Protocol):
    """A node on a line: a master of either kind, a slave or a peer."""

    def run(self, source: TaskSource) -> Procedure:
        """Carry out the tasks of ``source``, and serve commands that come, for ever."""

    def status(self) -> LinkState:
        """Return the details of this link; may be called from any thread."""
        return NO_STATUS


class EqualNode(Link):
    """The base of nodes on a line without a master, where every node may send at any time."""

    def __init__(self, machine: Machine, stations: ActiveStationList,
                 serve: Callable[[Packet], Packet | None],
                 report: Callable[[Event], None], number: int | None) -> None:
        self._machine = machine
        self._counters = machine.counters
        self._stations = stations
        self._serve = serve
        self._accounting = Accounting(machine.counters, stations, report, number)
        self._note = self._accounting.note
