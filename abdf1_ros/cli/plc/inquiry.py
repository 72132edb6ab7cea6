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

"""The cause if a station does not answer: from the bytes so far, and questions that decide."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
import time
from typing import Protocol

from abdf1_ros.cli.plc import overhear, presence
from abdf1_ros.cli.plc.line import free_station, MODES
from abdf1_ros.cli.plc.session import complain, Session, Witness
from abdf1_ros.cli.terminal import EXIT_FAILED
from abdf1_ros.counters import Counters
from abdf1_ros.df1.stations import ActiveStationList
from abdf1_ros.diagnosis.causes import Decider, diagnose, Diagnosis
from abdf1_ros.diagnosis.traces import SURE, Traces
from abdf1_ros.errors import PortLost
from abdf1_ros.pccc.steps import echo
from abdf1_ros.settings.network import Network

_MOST_QUESTIONS = 3

# Seconds for all questions, and what must be left to begin one.
_BUDGET = 3.0
_LEAST_LEFT = 1.2

_LONGEST_WAIT = 600  # ms; for one answer to a question
_CMD_TIMEOUT = 500  # ms; the shortest there is
_LATER = 1.0  # s

# Bytes that flow control swallows, and a byte that a telnet port changes.
_HINDERED = (b'\x11\x13', b'\xFF')

Neighbours = Callable[[], Sequence[int]]
"""Returns other stations that should be on the line."""


class Judged(Protocol):
    """Use of a line that is judged; ``silent`` is the station without an answer, or None."""

    silent: int | None
    witness: Witness

    network: Network
    stations: ActiveStationList
    counters: Counters

    @property
    def stray(self) -> str: ...

    def traces(self, station: int) -> Traces: ...


def conclude(session: Judged, neighbours: Neighbours = tuple) -> None:
    """Tell the cause if a station gave no reply, or of another user; the session has ended."""
    network = session.network
    if session.silent is not None:
        examination = Examination(session, session.silent, neighbours)
        facts = presence.facts(network, session.counters, session.stray, examination.traces)
        complain(str(examination.cause()))
        then = ', '.join(question.value for question in examination.asked)
        complain(f'{facts}; then asked: {then}' if then else facts)
    elif (heard := session.traces(network.station)).has_other_user:
        complain(str(diagnose(heard)))


def concluded(reads: Judged, failed: int) -> int:
    """Tell the cause, or else the traffic, if reads have ``failed``; return the exit status."""
    if reads.silent is not None:
        conclude(reads)
    elif failed and not reads.network.line_mode.only_listens:
        complain(presence.traffic(reads.counters))
    return EXIT_FAILED if failed else 0


def is_beside_master(session: Session) -> bool:
    """
    Listen on a half-duplex line before the first command; tell of another master.

    Returns True if there is one. The session itself listens, so the port is opened only once: some
    device servers reset the PLC, or refuse the next client for a while.
    """
    network = session.network
    if not network.line_mode.is_master:
        return False
    session.settle()
    time.sleep(overhear.LISTENED)
    heard = session.traces(network.station)
    if 0 < heard.foreign_polls < SURE:  # more may come from a slow master
        time.sleep(overhear.LISTENED_ON - overhear.LISTENED)
        heard = session.traces(network.station)
    if heard.masters:
        complain(f'nothing was sent: {diagnose(Traces(masters=heard.masters))}')
    return bool(heard.masters)


class Examination:
    """
    Questions about a station that has not answered; none of them writes to a PLC.

    ``session`` has ended. There are at most three questions, without a retry, in 3 s. None is
    asked after polls of another master, at a gateway, as a slave and by radio. ``asked`` has the
    questions that were asked.
    """

    def __init__(self, session: Judged, station: int, neighbours: Neighbours) -> None:
        self._session, self._neighbours = session, neighbours
        self._ends = time.monotonic() + _BUDGET
        self.asked: list[Decider] = []
        self.traces = session.traces(station)
        if session.network.line_mode.is_master and self.traces.gateway is None:
            self._look_at_others()

    def _look_at_others(self) -> None:
        """Take a station that has answered for a neighbour, or else one that was asked as well."""
        for record in sorted(self._session.stations.records.values(),
                             key=lambda record: not record.replies):
            if record.number != self.traces.station and (record.replies or not record.active):
                self.traces = replace(self.traces, neighbour=record.number,
                                      neighbour_answers=record.replies > 0)
                return

    def _may_ask(self, question: Decider) -> bool:
        traces, mode = self.traces, self._session.network.line_mode
        is_alone = mode.has_one_plc or mode.is_master and not traces.foreign_polls
        return (is_alone and traces.gateway is None and question not in self.asked
                and len(self.asked) < _MOST_QUESTIONS
                and self._ends - time.monotonic() >= _LEAST_LEFT)

    def cause(self) -> Diagnosis:
        """Ask what decides; return the cause. A lost port and Ctrl-C only end the questions."""
        found = diagnose(self.traces)
        try:
            while (question := found.rule.asks) is not None and self._may_ask(question):
                if (answered := self._answered(question)) is self.traces:
                    break  # there is no other station to ask
                self.asked.append(question)
                self.traces = answered
                found = diagnose(answered)
        except (PortLost, OSError, KeyboardInterrupt):
            pass
        return found

    def _answered(self, question: Decider) -> Traces:
        """Return the traces with the answer to a question."""
        traces, station = self.traces, self.traces.station
        network = self._session.network
        if question is Decider.POLL:
            return self._with(self._ask(network, station, witness=self._session.witness))
        if question is Decider.LATER:
            return self._with(self._ask(network, None, witness=self._session.witness))
        if question is Decider.HALF_DUPLEX:
            half = replace(network, mode=MODES['half'],
                           station=free_station(network.station, {station}))
            return replace(traces, is_polled_port=self._ask(half, station).polls_answered > 0)
        if question is Decider.OTHER_CHECK:
            seen = self._ask(replace(network, error_code=traces.other_check), station)
            return replace(traces, takes_other_check=seen.acks > 0)
        if question is Decider.ECHOES:
            return self._with_echoes(network)
        other = next((number for number in self._neighbours() if number not in (
            station, network.station)), None)
        if other is None:
            return traces
        return replace(traces, neighbour=other,
                       neighbour_answers=self._ask(network, other).polls_answered > 0)

    def _with(self, seen: Traces) -> Traces:
        """Return new traces of the line, with the answers so far."""
        before = self.traces
        return replace(
            seen, takes_other_check=seen.takes_other_check or before.takes_other_check,
            neighbour=before.neighbour, neighbour_answers=before.neighbour_answers,
            is_garbled=before.is_garbled, is_acknowledged=before.is_acknowledged)

    def _with_echoes(self, network: Network) -> Traces:
        """Return the traces with the bytes that do not pass, though others do."""
        with Session(_quick(network), [self.traces.station]) as session:
            errors = [session.attempt(self.traces.station, echo(data))[1] for data in _HINDERED]
        lost = [data for data, error in zip(_HINDERED, errors, strict=True) if error is not None]
        return replace(self.traces, swallowed=lost[0] if len(lost) == 1 else b'')

    def _ask(self, network: Network, station: int | None,
             witness: Witness | None = None) -> Traces:
        """Send an echo to a station as to a silent one, or only listen; return the traces."""
        with Session(_quick(network), [] if station is None else [station],
                     witness=witness) as session:
            session.settle()
            if station is None:
                time.sleep(_LATER)
            else:
                session.attempt(station, echo(b''))
            return session.traces(self.traces.station if station is None else station)


def _quick(network: Network) -> Network:
    """Return the line with one try for each message, and short waits."""
    return replace(network, nak_retries=0, enq_retries=0, cmd_timeout=_CMD_TIMEOUT,
                   timeout=min(network.timeout, _LONGEST_WAIT))
