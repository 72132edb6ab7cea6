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
The driver of one line: carries out reads, writes and checks, and reports their results.

It does no input or output itself, like the link layer below it. ``Driver.machine`` takes bytes and
a clock value, and a ``Listener`` gets values, results and events.
``abdf1_ros.ports.link_thread.LinkThread`` gives it a port and a clock; the tests give it a virtual
line.

Where each fact lives:

==================================================  ============================================
what may still land, what stands, unread results    ``kernel.flights``: ``Flights``, ``Words``
messages that wait                                  ``kernel.waiting.WaitingWrites``
commands of guests that wait                        ``guests.Guest.waiting``
calls that wait for a read                          ``reads.demands.ReadCalls.waiting``
until when a command may be sent                    ``job_tasks.Job.expires``
commands of jobs under way                          ``job_tasks.JobTasks``
when an own row has to be looked at                 its ``look``; ``kernel.plc.Looks`` keep it
how a PLC answers our own writes, a change to RUN   ``kernel.plc.Plc``
last message of a topic, executor, the end          ``kernel.own.Conditions``
whether a topic has more than one publisher         ``kernel.own.Conditions``
mode and type of a PLC                              ``checks.Checks.known``
whether a station answers                           ``df1.stations.Station``
last value, freshness, withheld                     ``reads.point.ReadPoint``
==================================================  ============================================
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Protocol

from abdf1_ros.counters import Counters
from abdf1_ros.df1.frames import Duplex
from abdf1_ros.df1.listen import ListeningMachine
from abdf1_ros.df1.machine import Procedure
from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.settings import LinkOptions
from abdf1_ros.df1.stations import ActiveStationList, Station
from abdf1_ros.df1.tasks import Task
from abdf1_ros.driver.agenda import Agenda, QUESTION_PERIOD
from abdf1_ros.driver.checks import Checks
from abdf1_ros.driver.guest_rules import GuestRules
from abdf1_ros.driver.guests import GuestQueue
from abdf1_ros.driver.inbox import Inbox
from abdf1_ros.driver.job_tasks import JobTasks
from abdf1_ros.driver.kernel.kernel import ForeignValue, Kernel, NOT_HEARD, Refused
from abdf1_ros.driver.kernel.reasons import WriteReasons
from abdf1_ros.driver.kernel.waiting import MAX_WAITING_WRITES
from abdf1_ros.driver.overheard import Overheard
from abdf1_ros.driver.reads.demands import ReadAnswer, ReadCall
from abdf1_ros.driver.reads.readings import Readings, ValueListener
from abdf1_ros.driver.refused import RefusedCommands
from abdf1_ros.driver.served import Served
from abdf1_ros.driver.settings import DriverSettings
from abdf1_ros.driver.write import Outcome, show, Write, WriteResult
from abdf1_ros.driver.writes.jobs import is_message_of, WritesUnderWay
from abdf1_ros.errors import FormatError, INTERNAL_ERROR, PortLost
from abdf1_ros.messages import Event
from abdf1_ros.pccc.families import served_counters
from abdf1_ros.pccc.file_types import PlcType
from abdf1_ros.pccc.identity import Identity
from abdf1_ros.pccc.processor import Processor
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.network import Network
from abdf1_ros.settings.resets import lost_by_reset
from abdf1_ros.settings.rows import Rows

_NOT_OPEN = 'the port is not open'
ENDS = 'this node ends'
TOO_MANY = 'too many writes are waiting'


class Listener(ValueListener, Protocol):
    """A listener to all results, in the link thread; ``write`` may also call ``written``."""

    def happened(self, event: Event) -> None:
        """Take a numbered error or notice."""

    def foreign_value(self, mapping: Mapping, text: str, is_conflict: bool) -> None:
        """Take a heartbeat value that is not ours; ``is_conflict`` if not the first lately."""

    def station_changed(self, station: Station) -> None:
        """Take the news that a station has become active or inactive."""


def _routes(network: Network, mappings: Iterable[Mapping]) -> dict[int, int]:
    """Return the gateway of each station that is behind one; only a master addresses them."""
    return {mapping.station: mapping.via for mapping in mappings
            if mapping.via is not None and network.line_mode.is_master}


def _options(settings: DriverSettings, network: Network, mappings: Rows) -> LinkOptions:
    """Return the options of the link: a DLE NAK of ours destroys nothing that others miss."""
    is_open = settings.nak_on_command_timeout is None
    return replace(settings, nak_on_command_timeout=False) \
        if is_open and lost_by_reset(network, mappings) else settings


class Driver:
    """Read and write the mapped addresses over one line, and serve the words of our own table."""

    def __init__(self, network: Network, mappings: Sequence[Mapping], settings: DriverSettings,
                 listener: Listener) -> None:
        self.network = network
        self.mappings = Rows(mappings)
        self.counters = Counters()
        self.machine = network.line_mode.make_machine(
            network.line, self._run, self.counters, self)
        self.stations = ActiveStationList(
            self.mappings.stations, self._station_changed,
            _routes(network, mappings), network.line_mode.longest_probe(network.line),
            self.machine.took, QUESTION_PERIOD if settings.may_store else 0.0,
            self._gateway_replied)
        # Only a gateway answers for several stations in full duplex.
        are_behind = network.line_mode.has_one_plc and len(self.mappings.stations) > 1
        for row in self.mappings.of_plcs:
            self.stations[row.station].has_gateway |= are_behind or row.via is not None
        self._settings = settings
        self._listener = listener
        self._inbox: Inbox[Write] = Inbox(is_open=False)
        self._make_queues()
        self.link = network.line_mode.make_link(
            self.machine, network.link(_options(settings, network, self.mappings)),
            self.stations, self.serve, listener.happened)
        self.overheard: Overheard | None = None
        if isinstance(self.machine, ListeningMachine):
            self.overheard = self.machine.listener = Overheard(
                network, self.mappings, self.readings, self.stations, self.checks, self.tasks)

    @property
    def is_online(self) -> bool:
        """Tell whether the port is open, so that messages are taken."""
        return self._inbox.is_open

    def _make_queues(self) -> None:
        """Make the queues of jobs, and the agenda that decides between them."""
        network, settings, machine = self.network, self._settings, self.machine
        own = Rows() if settings.read_only else self.mappings
        active = self.mappings.without(self.mappings.own) if settings.read_only else self.mappings
        self.tasks = JobTasks(network.station, settings.first_tns, machine, self.stations.odd)
        self.served = self._make_served()
        self.kernel = Kernel(
            self.mappings, own, self.stations, machine, self.tasks, self.served,
            settle_time=2 * network.cmd_timeout / 1000, patience=settings.write_timeout,
            tx_delay=network.timing.tx_delay, seed=settings.first_tns)
        self.readings = Readings(
            network, active, settings, self.stations, machine, self._listener, self.kernel)
        self.points = self.readings.points
        self.refused = RefusedCommands(PlcType(network.plc_type))
        writing = WritesUnderWay(self.stations, machine, self.kernel, self.readings)
        self.spent = writing.spent
        self.checks = Checks(
            self.stations, {block.station for block in self.readings.blocks},
            settings.processor_period, machine, self.readings.link_failed,
            self._station_told, self.readings.mode_periods)
        self.guests = GuestQueue(
            self.stations, machine, network.cmd_timeout / 1000,
            GuestRules(network, self.mappings, self._processor_of), writing, self._fell_silent)
        self._agenda = Agenda(self.stations, self.kernel, writing, self.checks,
                              self.readings.reads, self.guests, self.tasks)

    def take_over(self, before: Driver) -> None:
        """Take what the driver of the old files knows: new files change nothing on the line."""
        self.served.take_over(before.served)
        self.kernel.take_over(before.kernel)
        for station in before.stations:
            if station.number in self.stations:
                self.stations[station.number].has_gateway |= station.has_gateway

    def write(self, mappings: Sequence[Mapping], values: Sequence[float] | str,
              now: float, request: str = '') -> None:
        """
        Ask for values to be written to all ``mappings``, or to none if one of them refuses.

        May be called from any thread, followed by ``LinkThread.wake``. Exactly one WriteResult
        follows for each mapping, at once when the request is refused; each contains ``request``.
        """
        if refused := self._reasons_at_once(len(mappings)).first:
            self.refuse(mappings, refused[1], values, request)
            return
        writes, reasons = [], {}
        for mapping in mappings:
            try:
                writes.append(Write(mapping, values, now, request))
            except FormatError as error:
                reasons[mapping] = str(error)
        if reasons:
            tags = ', '.join(mapping.tag for mapping in reasons)
            for mapping in mappings:
                self.refuse([mapping], reasons.get(mapping, f'{tags} cannot take it'), values,
                            request)
            return
        for write in writes:
            if not self._inbox.put(write):
                self.refuse([write.mapping], _NOT_OPEN, values, request)

    def _reasons_at_once(self, count: int) -> WriteReasons:
        """Return what is against all writes of ``count`` mappings now, in any thread."""
        return WriteReasons(
            read_only='this node is read_only' if self._settings.read_only else '',
            closed='' if self.is_online else _NOT_OPEN,
            ends=ENDS if self.kernel.end.is_asked else '',
            crowded=TOO_MANY if len(self._inbox) + count > MAX_WAITING_WRITES else '')

    def read_now(self, mapping: Mapping, answer: Callable[[ReadAnswer], None]) -> None:
        """
        Ask for a row that a PLC has to be read at once.

        May be called from any thread, followed by ``LinkThread.wake``. Exactly one ``answer``
        follows, mostly in the link thread.
        """
        if self.overheard is not None:
            answer(ReadAnswer(error=f'Mode {self.network.mode}: nothing is sent'))
        elif self.is_online and self.kernel.end.is_asked:
            answer(ReadAnswer(error=ENDS))
        elif not self.readings.demands.inbox.put(ReadCall(mapping, answer)):
            answer(ReadAnswer(error=_NOT_OPEN))

    def refuse(self, mappings: Iterable[Mapping], reason: str,
               values: Sequence[float] | str, request: str) -> None:
        """Report that values were not taken for any of ``mappings``."""
        for mapping in mappings:
            self._listener.written(
                WriteResult(mapping, Outcome.REFUSED, reason, show(values), request=request))

    def _make_served(self) -> Served:
        plc_type, mode = PlcType(self.network.plc_type), self.network.mode
        counters = served_counters(self.counters, plc_type, mode)
        return Served(
            plc_type, self.mappings, self._written_by_plc, counters,
            self.network.duplex is Duplex.FULL)

    def _written_by_plc(self, mapping: Mapping, words: bytes) -> None:
        self.readings.served(mapping, words)

    def next_task(self, now: float, busy: Container[int] = ()) -> Task | None:
        """Return the command that has the line next, not for a ``busy`` station."""
        if self._inbox.items:
            self._sort_inbox(now)  # the machine has expired jobs that have waited too long
        if self.readings.demands.inbox.items:
            self.readings.take_demands(now)
        if self.checks.requests.items:
            self.checks.take_requests(now)
        job = self._agenda.next(now, busy)
        if self.kernel.out:
            self._take_news()
        return job

    def next_due(self) -> float:
        """Return when the next job is due (clock value in s), infinite for never."""
        return self._agenda.next_due()

    def expire(self, now: float) -> None:
        """Do the work that needs no line: store values that we serve, end expired jobs."""
        self._sort_inbox(now)
        self.readings.take_demands(now)
        self.kernel.expire(now)
        self.tasks.expire(now)
        self.guests.expire(now)
        if now >= self.readings.demands.next_expiry:
            self.readings.demands.expire(now)
        self._take_news()

    def next_expiry(self) -> float:
        """Return when ``expire`` has work (clock value in s), infinite for never."""
        if self.kernel.out:
            return self.machine.now
        return min(self.kernel.next_expiry, self.tasks.next_expiry, self.guests.next_expiry,
                   self.readings.demands.next_expiry)

    def _take_news(self) -> None:
        """Hand on what has come of the events of the kernel."""
        news, listener = self.kernel.out, self._listener
        while news:
            match news.popleft():
                case WriteResult() as result:
                    listener.written(result)
                case Refused(mapping, text):
                    listener.unreadable(mapping, text)
                case ForeignValue(mapping, text, is_conflict):
                    # A PLC with a download is not in RUN.
                    self.checks.ask_status(mapping.station, self.machine.now)
                    listener.foreign_value(mapping, text, is_conflict)

    def _gateway_replied(self, number: int) -> None:
        self.kernel.gateway_replied(number)

    def _station_changed(self, station: Station) -> None:
        self.kernel.station_changed(
            station.number, self.machine.now, is_active=station.active)
        if station.active:
            self.readings.reads.release(station.number, self.machine.now)
            self.checks.ask_status(station.number, self.machine.now)
        else:
            self.checks.went_away(station.number)
            self.readings.station_lost(station.number)
            self._fell_silent()
        self._take_news()
        self._listener.station_changed(station)

    def _fell_silent(self) -> None:
        """Treat the connection as unheard again if no station of our rows answers (rule 26)."""
        if not any(station.active for station in self.stations):
            self._connect()

    def _processor_of(self, station: int) -> Processor | None:
        """Return the processor that a station reports, None if unknown."""
        identity = self.checks.known(station).identity
        return None if identity is None else identity.processor

    def _sort_inbox(self, now: float) -> None:
        """Store messages of Serve rows in our table; let all others wait for the line."""
        for mapping, why in self.kernel.new_crowds(now):
            self.tasks.stop(partial(is_message_of, mapping), why)
        for write in self._inbox.take():
            self.kernel.asked(write, now)

    def serve(self, command: Packet) -> Packet:
        """Execute a command of a PLC or master, after all messages that came before it."""
        self._sort_inbox(self.machine.now)
        self._take_news()
        reply = self.served.serve(command)
        if reply.sts:
            self.refused.add(command, reply, self.machine.now)
        return reply

    def _connect(self) -> None:
        """
        Send no message until a reply comes: the port may store it for long.

        On a line without stations to ask, only writes of guests need a reply. A line whose master
        polls us needs none.
        """
        network = self.network
        if self._settings.may_store and not network.line_mode.is_polled \
                and (network.share or any(self.stations)):
            self.tasks.connect()
            if any(self.stations):
                self.kernel.drop(NOT_HEARD, self.machine.now)
                self.tasks.end_messages()

    def _run(self) -> Procedure:
        """Open the queues; return the procedure of the link, which ends with the port."""
        self._connect()
        if self._settings.may_store:  # it may also have kept commands of PLCs
            self.machine.treat_as_old()
        if self.overheard is not None:
            self.overheard.begin(self.machine.now)
        self.readings.begin(self.machine.now)
        self.checks.begin(self.machine.now)
        self.kernel.opened(self.machine.now)
        self._inbox.open()
        self.readings.demands.inbox.open()
        self.guests.begin()
        return self.link.run(self)

    def ended(self, error: Exception | None) -> None:
        """Give every job a result, so that no old command is sent later: the port is gone."""
        if not isinstance(error, PortLost):
            error = PortLost(INTERNAL_ERROR)
        messages = [*self._inbox.close()]
        self.tasks.fail(error)
        self._agenda.port_lost(self.machine.now)
        self.guests.end()
        self.checks.end(str(error))
        self.readings.port_lost(str(error))
        self.kernel.lost(messages, str(error), self.machine.now)
        self._take_news()

    def _station_told(self, station: int, identity: Identity | None, asked: float) -> None:
        """Use the answer of a station: its mode, and the packets that it accepts."""
        if identity is not None and identity.is_running is not None:
            self.kernel.mode_seen(station, self.machine.now,
                                  is_running=identity.is_running and not identity.faults)
        self.readings.told(station, identity, asked)
