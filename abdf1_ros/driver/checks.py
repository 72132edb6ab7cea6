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
Slow jobs of a driver: identity and mode of each station, and whether it still answers.

A station is asked for its diagnostic status at the start, when it comes back, and every
``processor_period``. A station without reads gets an echo when it has not been heard for a while,
because its silence would not be noticed otherwise. Link counters are read on request only.

Checks do not count as reads, nor in the poll cycle. A refusal is not a fault of the station.
``agenda`` decides when a check has the line.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
import math
from operator import attrgetter

from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.df1.tasks import LineTime
from abdf1_ros.driver.inbox import Inbox
from abdf1_ros.driver.job_tasks import Job
from abdf1_ros.errors import FormatError, LinkError, RemoteError
from abdf1_ros.pccc import diagnostics
from abdf1_ros.pccc.dialect import Steps
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.link_counters import decode_counters
from abdf1_ros.pccc.status import check_status
from abdf1_ros.pccc.steps import echo, identify

# Seconds of silence after which a station gets an echo, and between two echoes.
ECHO_PERIOD = 2.0

# Seconds before a question that has failed is sent again, unless the station has replied since.
_AGAIN = 2.0

# If an active station with an unknown processor does not reply to a question, the next one is this
# number of periods later. Questions that rows depend on are not delayed. Each such question costs
# Cmd_Timeout, and in Mode Master mostly a DLE NAK.
_UNANSWERED = 30

_NOT_ASKED = 'unknown (not asked yet)'
_NEVER_ASKED = 'unknown (not asked: processor_period is 0)'


class CheckKind(Enum):
    ECHO = 'echo'
    STATUS = 'diagnostic status'
    COUNTERS = 'link counters'


class Check(Job):
    """
    One slow job: ``due`` is the clock value (s) from which it wants the line.

    ``due`` is infinite while the job is under way (since ``begun``). While the station is inactive
    ``due`` is also infinite, unless the job is an echo. ``period`` is in seconds, infinite for a
    job that is done once. With ``is_planned`` rows depend on the check, and the forecast of the
    line counts it.
    """

    def __init__(self, checks: Checks, station: int, kind: CheckKind, period: float,
                 due: float = 0.0, *, is_planned: bool = False) -> None:
        self.station, self.kind, self.key = station, kind, (station, kind)
        self.period, self.due = period, due
        self.is_planned = is_planned
        self.begun = -math.inf
        self._checks = checks

    def steps(self, now: float) -> Steps[None]:
        """Ask, and take the answer."""
        self.begun = now
        return self._checks.question(self)

    def ended(self, error: Exception | None) -> None:
        """Plan the next check of this kind."""
        self._checks.ended(self, error)


@dataclass(frozen=True, slots=True)
class StationHealth:
    """
    The reports of a station about itself.

    - ``processor``: a readable text, also without an ``identity``.
    - ``told``: clock value (s) of the last diagnostic status.
    - ``counters``: link counters as last read; ``no_counters``: why that read failed.
    """

    processor: str = _NOT_ASKED
    identity: Identity | None = None
    told: float | None = None
    counters: Mapping[str, str] = field(default_factory=dict)
    no_counters: str = ''


class Checks:
    """
    The checks of all ``stations``; only stations in ``read`` have reads as well.

    - ``period``: seconds between two questions for the diagnostic status, 0 for never.
    - ``wanted``: longest period (s) of each station that has to be asked more often.
    - ``link_failed``: called for a transaction without a reply.
    - ``told``: called after each question for the diagnostic status, with the answer, None for
      none, and the clock value (s) of the question.
    - ``next_due``: when the next check is due (clock value in s), infinite for never.

    The objects that ``known`` returns never change. Only ``request_counters`` may be called from
    another thread.
    """

    def __init__(self, stations: ActiveStationList, read: Container[int], period: float,
                 line: LineTime, link_failed: Callable[[int, LinkError], None],
                 told: Callable[[int, Identity | None, float], None],
                 wanted: Mapping[int, float] | None = None) -> None:
        self.counters_wanted: set[int] = set()
        self._stations = stations
        self._link_failed = link_failed
        self._told = told
        self._line = line
        self._known: dict[int, StationHealth] = {}
        self.requests: Inbox[int] = Inbox(is_open=False)
        self._wanted = wanted or {}
        periods = {station.number: min(self._wanted.get(station.number, math.inf),
                                       period or math.inf) for station in stations}
        self.jobs = [Check(self, number, CheckKind.STATUS, often,
                           is_planned=number in self._wanted)
                     for number, often in periods.items() if not math.isinf(often)]
        self._asked = {check.station for check in self.jobs}
        self.jobs += [Check(self, station.number, CheckKind.ECHO, ECHO_PERIOD)
                      for station in stations if station.number not in read]
        self.next_due = 0.0

    def known(self, station: int) -> StationHealth:
        """Return the reports of a station about itself."""
        return self._known.get(station) or StationHealth(self._unknown(station, _NOT_ASKED))

    def _unknown(self, station: int, text: str) -> str:
        """Return a text for an unknown processor; another text if the station is never asked."""
        return text if station in self._asked else _NEVER_ASKED

    def request_counters(self, station: int) -> None:
        """
        Ask for the link counters of a station; may be called from any thread, then wake the link.

        The station is in ``counters_wanted`` until the request has ended. Without a port no
        request begins.
        """
        self.counters_wanted.add(station)
        if not self.requests.put(station):
            self.counters_wanted.discard(station)

    def begin(self, now: float) -> None:
        """Make all checks due: the port has been opened."""
        self.requests.open()
        for check in self.jobs:
            check.due = now
        self._plan()

    def end(self, reason: str) -> None:
        """Forget all that depends on the port: it is lost."""
        for station in self._stations:
            self._forget(station.number, reason)
        for number in {*self.requests.close(), *tuple(self.counters_wanted)}:
            self._take_counters(number, {}, reason)

    def ask_status(self, station: int, due: float) -> None:
        """Ask a station at a clock value (s): it may be a different PLC or in a different mode."""
        for check in self.jobs:
            if check.kind is CheckKind.STATUS and check.station == station:
                check.due = due
        self._plan()

    def went_away(self, station: int) -> None:
        """Forget the reports of a station that does not answer any more."""
        self._forget(station, 'the station does not answer')
        self.ask_status(station, math.inf)

    def take_requests(self, now: float) -> None:
        """Take the requests of other threads."""
        for station in self.requests.take():
            self._add_request(station, now)

    def next(self, now: float, busy: Container[int], probe_from: float,  # noqa: A003
             odd_from: float, may_go: Callable[[Check], bool]) -> Check | None:
        """
        Return the next check that is due and may be sent, None for none or if its station is busy.

        It may be a probe from the clock value ``probe_from`` (s) on. One that fails while its
        station replies to others may be sent from ``odd_from`` on.
        """
        due = [check for check in self.jobs if check.due <= now]
        for check in filter(may_go, sorted(due, key=attrgetter('due'))):
            if check.station in busy:
                return None  # no other check instead: the reads have their turn after each check
            check.due = self._wanted_from(check, probe_from, odd_from)
            if check.due <= now:
                check.due = math.inf
                check.is_probe = not self._stations[check.station].replies_in_time
                self._plan()
                return check
        self._plan()
        return None

    def question(self, check: Check) -> Steps[None]:
        """Return the question of a check."""
        station, known = check.station, self.known(check.station)
        if check.kind is CheckKind.ECHO:
            yield from echo(b'')
        elif check.kind is CheckKind.STATUS:
            identity = yield from identify()
            self._known[station] = replace(
                known, processor=str(identity), identity=identity, told=self._line.now)
        else:
            asked = known.identity or Identity(None, '')
            reply = check_status((yield diagnostics.CMD, asked.counters.encode()))
            self._take_counters(station, decode_counters(reply, asked.counter_layout))

    def ended(self, check: Check, error: Exception | None) -> None:
        """Record the end of a check: its answer is recorded already, or there is an error."""
        next_due = check.begun + check.period
        if isinstance(error, FormatError | RemoteError):
            self._take_refusal(check, str(error))
        elif isinstance(error, LinkError):
            self._link_failed(check.station, error)
            if check.kind is CheckKind.COUNTERS or self.known(check.station).identity is None:
                self._take_refusal(check, str(error))
                if not check.is_planned:
                    next_due += check.period * _UNANSWERED
        self._finish(check, next_due)
        self._stations.tried(
            check.station, check.begun, self._line.now, was_silent=check.is_probe)
        if check.kind is CheckKind.STATUS:
            known = self.known(check.station)
            is_answer = known.told is not None and known.told >= check.begun
            self._told(check.station, known.identity if is_answer else None, check.begun)

    def heard(self, station: int, identity: Identity, asked: float) -> None:
        """Take the answer to a question that another node has asked at a clock value (s)."""
        self._known[station] = replace(
            self.known(station), processor=str(identity), identity=identity, told=self._line.now)
        self._told(station, identity, asked)

    def _take_refusal(self, check: Check, reason: str) -> None:
        if check.kind is CheckKind.STATUS:
            self._known[check.station] = replace(
                self.known(check.station), processor=f'unknown ({reason})', identity=None,
                told=None)
        elif check.kind is CheckKind.COUNTERS:
            self._take_counters(check.station, {}, reason)

    def _take_counters(self, station: int, counters: Mapping[str, str],
                       reason: str = '') -> None:
        """Keep the answer to a request, or the reason why there is none."""
        self._known[station] = replace(
            self.known(station), counters=counters, no_counters=reason)
        self.counters_wanted.discard(station)

    def _finish(self, check: Check, next_due: float) -> None:
        """Plan the next check of this kind; a silent station gets only echoes until it answers."""
        if check.kind is CheckKind.COUNTERS:
            self.jobs.remove(check)
        elif self._stations[check.station].active:
            check.due = next_due
        elif check.kind is CheckKind.ECHO:
            check.due = self._line.now + check.period
        self._plan()

    def _wanted_from(self, check: Check, probe_from: float, odd_from: float) -> float:
        """Return the clock value (s) from which a check that is due wants the line."""
        station = self._stations[check.station]
        if station.is_left_alone:
            return self._line.now + _AGAIN
        if not station.replies_in_time:
            return probe_from if station.active or check.kind is CheckKind.ECHO else math.inf
        if self._stations.odd.is_odd(check.key):
            return max(check.due, odd_from)
        odd = self._stations.odd
        if odd.failures(check.key) and odd.is_doubtful(check.station):
            # Its failure may have made the station inactive. Others go first, or it would do so
            # again each time when the station comes back.
            return max(check.due, check.begun + min(check.period, _AGAIN))
        if check.kind is CheckKind.ECHO and station.last_heard is not None:
            return station.last_heard + check.period
        return check.due

    def _add_request(self, station: int, now: float) -> None:
        check = Check(self, station, CheckKind.COUNTERS, math.inf, now)
        record = self._stations[station]
        if not record.active or record.is_left_alone:
            self._take_counters(station, {}, 'the station does not answer')
        elif not any(other.station == station and other.kind is CheckKind.COUNTERS
                     for other in self.jobs):
            self.jobs.append(check)
            self._plan()

    def _forget(self, station: int, reason: str) -> None:
        """Drop the reports of a station, and end the requests that it will not answer."""
        known = self.known(station)
        self._known[station] = StationHealth(
            processor=self._unknown(station, f'unknown ({reason})'), counters=known.counters,
            no_counters=known.no_counters)
        for check in [check for check in self.jobs if check.station == station
                      and check.kind is CheckKind.COUNTERS and not math.isinf(check.due)]:
            self._take_counters(station, {}, reason)
            self.jobs.remove(check)
        self._plan()

    def _plan(self) -> None:
        self.next_due = min((check.due for check in self.jobs), default=math.inf)
