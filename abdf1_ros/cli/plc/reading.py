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

"""Reads again and again for ``plc watch`` and ``plc log``: the driver, without ROS."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Sequence
from datetime import datetime
from functools import partial
import random
from typing import NamedTuple

from abdf1_ros.cli.plc.session import opened, Witness
from abdf1_ros.cli.terminal import tell
from abdf1_ros.df1.stations import Station
from abdf1_ros.diagnosis.traces import Traces
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.reads.point import Freshness
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.open_line import traced
from abdf1_ros.pccc.values import Values
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ports.descriptor import Port
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.wake import Wake
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network

# Period (ms) to look without news.
_GLANCE = 250

# Longest time (s) until the link's thread finds that no other node reads a row any more.
_LONGEST_WAIT = 0.5

# Most results that wait to be shown; older ones are dropped and counted.
MAX_NEWS = 1000


class NoValue(NamedTuple):
    """The reason for a missing value."""

    error: str


class WatchedRead(NamedTuple):
    """The result of a read, with its time of day."""

    when: datetime
    mapping: Mapping
    what: Values | NoValue


class NewReads:
    """
    The results that the thread of the link has, on their way to the thread that shows them.

    At most MAX_NEWS wait. The thread of the link calls ``add``, and sets ``wake`` if there is
    something else to show.
    """

    def __init__(self) -> None:
        self._waiting: deque[WatchedRead] = deque(maxlen=MAX_NEWS)
        self._taken: list[WatchedRead] = []  # that may not have been shown to the end
        self._lost = self._lost_reported = 0
        self.wake = Wake()  # not an Event: an interrupt in it may leave its lock locked

    def add(self, mapping: Mapping, what: Values | NoValue) -> None:
        """Add a result of this moment; if too many wait, the oldest is dropped."""
        self._lost += len(self._waiting) == MAX_NEWS
        self._waiting.append(WatchedRead(datetime.now().astimezone(), mapping, what))
        self.wake.set()

    def wait(self, milliseconds: int) -> None:
        """Wait until ``wake`` is set, but at most for this time."""
        self.wake.wait(milliseconds)
        self.wake.take()

    def hand_over(self, show: Callable[[Sequence[WatchedRead], int], None]) -> None:
        """
        Call ``show`` with the results, and with the number of those dropped since the last call.

        If ``show`` raises an exception, it gets the same results again.
        """
        while self._waiting:
            self._taken.append(self._waiting.popleft())
        lost, self._lost_reported = self._lost - self._lost_reported, self._lost
        show(self._taken, lost)
        self._taken = []


def _pass_over(reads: RepeatedReads, *args: object) -> None:
    """Do nothing: the point has the reason, and no other event can happen here."""


class RepeatedReads(ABC):
    """
    Read ``mappings`` every ``period`` seconds; ``show`` of a subclass gets the results.

    A read that fails for the same reason as the one before has no result of its own. In Mode
    Listen the values come from the replies to another master; nothing is sent.
    ``processor_period`` is the time (s) between two questions for the mode of a PLC, 0 for none.
    All bytes go into the capture ``record``.

    This class is the driver's ``Listener``; ``counters`` are the counters of the line. After the
    end ``silent`` is a station whose last command had no reply, None for none and after Ctrl-C.
    Raises OSError if the port cannot be opened.
    """

    def __init__(self, network: Network, mappings: Sequence[Mapping], period: float,
                 record: str | None = None, processor_period: float = 0.0) -> None:
        self._mappings = mappings
        self._is_listening = network.line_mode.only_listens
        settings = DriverSettings(
            default_period=period, read_only=True, first_tns=random.randrange(0x10000),
            processor_period=processor_period)
        self._driver = Driver(network, mappings, settings, self)
        self._points = [self._driver.points[mapping] for mapping in mappings]
        self.network, self.stations = network, self._driver.stations
        self.counters = self._driver.counters
        self.silent: int | None = None
        self.stray, self._echoes = '', False
        self.witness = Witness()
        self._port, self._trace = opened(network, self.witness.around), None
        port: Callable[[], Port] = self._port
        if record is not None:
            port, self._trace = traced(record, PortSettings.of(network), network.error_code,
                                       network.duplex, port, partial(tell, 'plc'))
        self._link = LinkThread(self._driver.machine, port, while_sending=self._note_failures,
                                longest_wait=_LONGEST_WAIT)
        self._news = NewReads()
        # Good and failed reads; each is counted after its result was given to NewReads.
        self._reads: Counter[Mapping] = Counter()
        self._failures: dict[Mapping, int] = {}
        self._noted: dict[Mapping, str] = {}

    def run(self, count: int | None) -> int:
        """
        Show results until each address has been read ``count`` times, or KeyboardInterrupt.

        A failed read counts too. Returns the number of addresses without a value at the end.
        """
        try:
            self.begin()
            self._link.start()  # inside the try block: the thread would keep the process alive
            while not self._link.has_failed and not self._is_done(count):
                self._news.wait(_GLANCE)
                self._news.hand_over(self.show)
            self._news.hand_over(self.show)
            self.silent = self._first_silent()
        except KeyboardInterrupt:
            self._news.hand_over(self.show)
        finally:
            # Count before the stop, because the end of the line causes more errors.
            failed = sum(point.error is not None for point in self._points)
            self._echoes = self._driver.machine.echoes
            self._link.stop()
            self._port.close()  # the thread may not have come to it
            self._news.wake.close()
            if self._trace is not None:
                self._trace.close()
        return failed

    def traces(self, station: int) -> Traces:
        """Return what the line has shown while a station was asked."""
        return self.witness.traces(self.network, self.stations, station, echoes=self._echoes)

    def _first_silent(self) -> int | None:
        """Return the first station whose last command had no reply, though the port is open."""
        if self._is_listening or not self._link.state.is_open:
            return None
        asked = (self.stations[point.mapping.station] for point in self._points)
        return next((station.number for station in asked
                     if not station.active or station.unanswered), None)

    @abstractmethod
    def begin(self) -> None:
        """Do what comes before the first result."""

    @abstractmethod
    def show(self, news: Sequence[WatchedRead], lost: int) -> None:
        """Show results; ``lost`` results before them were dropped."""

    def read(self, mapping: Mapping, values: Values) -> None:
        """Record the values of a read; called in the link thread."""
        self._noted.pop(mapping, None)
        self._news.add(mapping, values)
        self._reads[mapping] += 1

    unreadable = published_again = written = foreign_value = happened = _pass_over

    def station_changed(self, station: Station) -> None:
        """Wake the thread that shows the news."""
        self._news.wake.set()

    def _note_failures(self) -> None:
        """Record the reads that have failed since the last call; called in the link thread."""
        if self._is_listening:
            self._note_unheard()
        failures = {point.mapping: point.failures for point in self._points}
        if failures == self._failures:
            return
        for point in self._points:
            self._note_gap(point.mapping, point.error)
        self._failures = failures

    def _note_gap(self, mapping: Mapping, reason: str | None) -> None:
        if reason is not None and self._noted.get(mapping) != reason:
            self._noted[mapping] = reason
            self._news.add(mapping, NoValue(reason))

    def _note_unheard(self) -> None:
        """Record the rows that no other node reads any more."""
        now = line_time()
        for point in self._points:
            if point.freshness(now) is Freshness.STALE:
                self._note_gap(point.mapping, f'not heard for {point.stale_time:g} s')

    def _is_done(self, count: int | None) -> bool:
        if count is None:
            return False
        failures = self._failures
        return all(self._reads[point.mapping] + failures.get(point.mapping, 0) >= count
                   for point in self._points)
