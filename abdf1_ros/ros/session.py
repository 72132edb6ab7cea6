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
What is made of one pair of files, and dropped with it: nothing of it survives a reload.

The driver, its topics, what watches over them, and what has been told so far. Values and results
are published from the link's thread itself, without the executor in between; publishers may be
used from any thread.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
import random
from typing import Any

from abdf1_ros.df1.packet import Packet
from abdf1_ros.df1.stations import Station
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.guests import Guest
from abdf1_ros.driver.write import Outcome, WriteResult
from abdf1_ros.messages import Event, Message
from abdf1_ros.pccc.describe import describe
from abdf1_ros.pccc.extent import Extent
from abdf1_ros.plan.report import setting_remarks
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ports.link_thread import LinkThread, PortState
from abdf1_ros.ports.trace import PortOpener
from abdf1_ros.ros.diagnostics.graph import DuplicateNameWatch, Graph, TypeWatch
from abdf1_ros.ros.diagnostics.log import EventLog, LimitedLog, UnreadableRows, where
from abdf1_ros.ros.diagnostics.stations import LinkCounterService
from abdf1_ros.ros.diagnostics.statuses import changed_text, deaf_text, Diagnostics
from abdf1_ros.ros.diagnostics.writes import is_usual_fallback
from abdf1_ros.ros.parameters.declared import Configuration
from abdf1_ros.ros.topics.interlocks import InterlockWatch, wait_for_end
from abdf1_ros.ros.topics.messages import ACTIVE_LAYOUT
from abdf1_ros.ros.topics.reads import ReadTopic, ReadTopics
from abdf1_ros.ros.topics.snapshot import Snapshot
from abdf1_ros.ros.topics.writes import WriteTopics
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.share import share_places
from abdf1_ros.share.guest_line import GuestLine
from abdf1_ros.text import first, printable
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import UInt16MultiArray

# How often (s) it is looked whether the files have changed.
_FILE_PERIOD = 2.0

_MOST_REMARKS = 20  # about both files, in the log

_RESULT_LEVELS = {
    Outcome.WRITTEN: DiagnosticStatus.OK, Outcome.BROADCAST: DiagnosticStatus.WARN,
    Outcome.SUPERSEDED: DiagnosticStatus.WARN, Outcome.FALLBACK: DiagnosticStatus.WARN}


@dataclass(slots=True)
class Surroundings:
    """
    What belongs to the process and outlives the files.

    ``published`` and ``subscriptions`` are those of the topics, kept where the next files have the
    same row. ``link`` is there once the first session has a machine for it.
    """

    node: Node
    graph: Graph
    duplicate_names: DuplicateNameWatch
    opener: PortOpener
    results: Any
    active_stations: Any
    diagnostics: Any
    snapshot: Any
    writes: WriteTopics
    published: dict[str, ReadTopic] = field(default_factory=dict)
    active_words: Sequence[int] = ()
    link: LinkThread = field(init=False)

    def wake_executor(self) -> None:
        if self.node.executor is not None:
            self.node.executor.wake()


class Session:
    """
    The bridge between one pair of files and ROS; the listener of its driver.

    It is made before its driver is on the line, ``begin`` is called afterwards, and ``end`` when
    another one has taken its place: all three by the executor's thread, or before that runs.
    ``check`` is to be called every 0.1 s, in any one thread.
    """

    def __init__(self, surroundings: Surroundings, configuration: Configuration) -> None:
        self.configuration = configuration
        self._surroundings = surroundings
        node, parameters = surroundings.node, configuration.parameters
        self._logger = node.get_logger()
        self._log = EventLog(self._logger, line_time)
        self.notes = LimitedLog(self._logger, line_time)
        self._unreadable = UnreadableRows(self.notes)
        self.reads = ReadTopics(node, surroundings.published)
        self.read = self.reads.read
        self.driver = Driver(configuration.network, configuration.mappings,
                             configuration.driver_settings(), self)
        # Subscriptions first: where there are thousands of publishers, each takes DDS 5 ms.
        self._writers = surroundings.writes.open(
            self.driver, parameters.write_timeout, self._lost, self._wake_link)
        self.reads.open(self.driver.points)
        self.diagnostics = Diagnostics(
            node.get_fully_qualified_name().lstrip('/'), self.driver, configuration.port,
            configuration.map_problems)
        self.diagnostics.interlocks.latest = self.reads.latest
        self.guest_lines = self._make_guest_lines()
        self.diagnostics.show_guests(self.guest_lines)
        self._interlocks = InterlockWatch(node, self.driver)
        self._types = TypeWatch(
            surroundings.graph, node.resolve_topic_name, configuration.mappings)
        self.link_counters = LinkCounterService(
            self.driver, self._wake_link, surroundings.wake_executor)
        # A station may have a reply ready for a command from before.
        self._may_have_left_over = {station.number for station in self.driver.stations}
        self._told: dict[str, Sequence[object]] = {}
        self._has_told_tools = False
        self._port_text = ''
        self._levels: list[bytes] = []
        self._next_diagnostics = self._next_look = self._next_snapshot = 0.0
        self._snapshot: Snapshot | None = None
        # The nodes of a process are not to publish all at the same moment.
        self._phase = random.uniform(0.0, parameters.diagnostics_period)

    @property
    def port(self) -> str:
        return self.configuration.port

    def begin(self) -> None:
        """Tell of the files; the driver is on the line, or is about to be."""
        self._tell_files()
        self.diagnostics.attach(self._surroundings.link, self._surroundings.opener)
        self.reads.take_over()
        if self._surroundings.link.state.is_open:  # otherwise it is told when it has been tried
            self._publish_active()

    def start_guests(self) -> None:
        """Let guests connect."""
        for line in self.guest_lines:
            line.start()

    def stop_guests(self) -> None:
        """Let go of the guests."""
        for line in self.guest_lines:
            line.stop()

    def end(self) -> None:
        """End what waits and watches; another session has taken over the topics."""
        self._unreadable.tell()
        self.stop_guests()
        self.link_counters.end()
        self._interlocks.end()

    def begin_end(self) -> None:
        """Have heartbeats set to 0 and fallbacks written; ``finish_end`` waits for it (rule 5)."""
        self._unreadable.tell()
        self.driver.wind_down()
        self._wake_link()

    def finish_end(self, give_up: float, what: str) -> None:
        """
        Wait until the PLCs know, up to a monotonic clock value; name what is not confirmed.

        ``what`` says in the log what goes on then.
        """
        tags = wait_for_end(self.driver, self._surroundings.link, give_up)
        if tags:
            self._logger.error(f'{what} before the PLC has confirmed: {first(tags)}')

    def _wake_link(self) -> None:
        self._surroundings.link.wake()

    # Guests

    def _make_guest_lines(self) -> list[GuestLine]:
        network = self.configuration.network
        if self.configuration.parameters.read_only:
            network = replace(network, share_access='Read')
        lines = [GuestLine(place, network, self.driver.guests, self._wake_link, self._guest_fault)
                 for place in share_places(network.share)]
        for line in lines:
            line.guest.sends = partial(self._surroundings.opener.note_guest, line.guest.name)
            line.guest.wrote = partial(self._guest_wrote, line.guest)
            line.guest.was_refused = partial(self._guest_refused, line.guest)
        return lines

    def _guest_wrote(self, guest: Guest, command: Packet, station: int,
                     words: list[Extent]) -> None:
        rows = [row for row in self.driver.mappings if (row.writes or row.heartbeat)
                and any(row.extent.meets(extent) for extent in words)]
        if rows:
            guest.collisions += 1
            self.notes.warning(
                f'writes of {guest.name}', f'guest {guest.name} has sent to station {station}: '
                f'{describe(command)}, words of {first([row.tag for row in rows])}')

    def _guest_refused(self, guest: Guest, command: Packet) -> None:
        if guest.refused == 1:
            self.notes.warning(f'guest {guest.name}', (
                f'guest {guest.name} is refused: {describe(command)}: Share_Access is '
                f'{guest.access.value}'))

    def _guest_fault(self, error: Exception) -> None:
        self._logger.error(f'internal error in the line of a guest: {error!r}; please report it')

    # Files

    def _tell_files(self) -> None:
        """Log a summary of both files."""
        configuration = self.configuration
        self._logger.info(str(configuration))
        for problem in configuration.map_problems:
            self._logger.error(f'{problem} (row left out)')
        remarks = [*setting_remarks(configuration.network, configuration.mappings)]
        for remark in remarks[:_MOST_REMARKS]:
            self._logger.warning(printable(remark.text))
        if len(remarks) > _MOST_REMARKS:
            self._logger.warning(
                f'and {len(remarks) - _MOST_REMARKS} more remarks; "check" has them all')
        silent = [mapping.tag for mapping in configuration.mappings
                  if mapping.heartbeat or mapping.fallback]
        if silent and configuration.parameters.read_only:
            self._logger.warning(
                f'read_only: no heartbeat and no fallback value is written: {first(silent)}')
        if not configuration.mappings:
            self._logger.warning('the map has no usable row: nothing is read or written')
        if configuration.ignored:
            self._logger.warning(
                'parameters without effect, as the map comes from its file alone: '
                + first(configuration.ignored))

    # Writes

    def write(self, topic: str, message: Any, info: Any) -> None:
        """Take a message of a write topic."""
        self._writers[topic].take(message, info)

    def _lost(self, topic: str, count: int) -> None:
        self.diagnostics.lost(topic, count, line_time())
        self.notes.warning(f'lost writes to {topic}', f'~/write/{topic}: {count} messages were '
                           'lost on their way here, and have no result: they come faster than '
                           'they can be taken')

    def written(self, result: WriteResult) -> None:
        """Publish the result of a write."""
        self.diagnostics.written(result, line_time())
        mapping = result.mapping
        level = _RESULT_LEVELS.get(result.outcome, DiagnosticStatus.ERROR)
        if level == DiagnosticStatus.ERROR or result.outcome is Outcome.FALLBACK:
            tell = self.notes.info if is_usual_fallback(result) else self.notes.warning
            tell(f'writes to {mapping.tag}', f'write to {mapping.tag} {result.value}: {result}')
        values = {'address': str(mapping.address), 'station': str(mapping.station),
                  'value': result.value, 'latency_ms': f'{result.latency * 1000:.1f}',
                  'request': result.request}
        self._surroundings.results.publish(DiagnosticStatus(
            level=level, name=printable(mapping.tag), message=printable(str(result)),
            hardware_id=printable(self.port),
            values=[KeyValue(key=key, value=value) for key, value in values.items()]))

    # Events of the line

    def unreadable(self, mapping: Mapping, reason: str) -> None:
        """Have it logged why a read of a station that answers has no value."""
        self._unreadable.add(line_time(), mapping, reason)

    def published_again(self, mapping: Mapping, seconds: float) -> None:
        """Log that a row is not withheld any more, nor are those that depend on the same."""
        self._unreadable.tell()
        self.notes.info(
            mapping.tag, f'{where(mapping)}: published again after {seconds:.1f} s')

    def foreign_value(self, mapping: Mapping, text: str, is_conflict: bool) -> None:
        """Log that a heartbeat is not the one that we have written (rule 19)."""
        log = self.notes.error if is_conflict else self.notes.warning
        if is_conflict:
            self.diagnostics.interlocks.conflicts[mapping.tag] = f'{mapping.address}: {text}'
        log(mapping.tag, f'{where(mapping)}: {text}')

    def happened(self, event: Event) -> None:
        """Log a numbered event and remember it for the diagnostics."""
        if self._is_left_over(event):
            self.notes.info(
                f'station {event.station}',
                f'{event}; it may answer a command from before the port was opened')
            return
        self.diagnostics.happened(event, line_time())
        is_change = event.message is Message.ERR_INACTIVE_STATION \
            and event.station in self.driver.stations
        if not is_change:  # that is logged by station_changed
            self._log.add(event)

    def _is_left_over(self, event: Event) -> bool:
        """Tell whether a station gives us, first of all, what it had ready for an earlier run."""
        is_wrong = event.message is Message.ERR_WRONG_MESSAGE
        if event.station not in self._may_have_left_over or not (
                is_wrong or event.message is Message.NTC_REPLY_MSG_RCVD):
            return False
        self._may_have_left_over.discard(event.station)
        return is_wrong

    def station_changed(self, station: Station) -> None:
        """Publish the Active Node Table and log the change."""
        self._publish_active()
        if station.takes_no_commands:
            return  # it comes and goes, and that is told once
        self._log.forget(station.number)
        about = f'station {station.number}'
        if station.active:
            self.notes.info(about, f'{about} answers again')
        else:
            self.notes.error(about, Message.ERR_INACTIVE_STATION.entry(station.number))
            if station.last_heard is None:
                self._tell_tools(about)

    def _tell_tools(self, about: str) -> None:
        """Name, once, what finds out why a station has never been heard."""
        if self._has_told_tools:
            return
        self._has_told_tools = True
        scan = '' if self.driver.network.mode == 'Peer' else ', "plc scan" which stations answer'
        self._logger.info(
            f'{about} has never been heard: with the node stopped, "plc detect" finds the '
            f'settings of the line{scan}')

    def _publish_active(self) -> None:
        """Publish the Active Node Table if it changes; with a closed port no station is active."""
        surroundings = self._surroundings
        words = self.driver.stations.words() if surroundings.link.state.is_open else [0] * 16
        if words != surroundings.active_words:
            surroundings.active_words = words
            surroundings.active_stations.publish(
                UInt16MultiArray(layout=ACTIVE_LAYOUT, data=words))

    def port_changed(self, state: PortState) -> None:
        """Log the state of the port."""
        if state.text == self._port_text:
            return  # an attempt that failed like the one before
        self._port_text = state.text
        self._may_have_left_over = {station.number for station in self.driver.stations}
        self._publish_active()
        is_meant = state.is_open or self._surroundings.link.is_released
        tell = self.notes.info if is_meant else self.notes.error
        tell('the port', f'{self.port}: {state.text}')

    # What is looked at

    def check(self) -> None:
        """Publish diagnostics when they are due or a level has changed; end what waits."""
        now = line_time()
        diagnostics = self.diagnostics
        self.link_counters.check(now)
        self._look_at_files(now)
        self._look_at_names(now)
        self._unreadable.look(now)
        for text in self._types.look(now):
            self.notes.warning('types of topics', text)
        crowded = diagnostics.interlocks.crowded = self._interlocks.look(now)
        self._tell_news('publishers', [
            f'~/write/{topic} has more than one publisher: its fallback value is not written '
            'while any of them goes on (a forgotten "ros2 topic pub -r"?)'
            for topic in crowded], self.notes.warning)
        self._tell_news('guests', [f'guest {line.guest.name}: {line.fault}'
                                   for line in self.guest_lines if line.fault], self.notes.error)
        self._tell_news('types of PLCs', diagnostics.wrong_types(), self.notes.warning)
        self._tell_deaf_stations(diagnostics.deaf_stations(now))
        fault = diagnostics.line_fault(now)
        self._tell_news('line', [f'{self.port}: {fault}'] if fault else [], self.notes.error)
        levels = diagnostics.levels(now)
        if now >= self._next_diagnostics or levels != self._levels:
            self._levels = levels
            self.publish_diagnostics(now)
        self._publish_snapshot(now)

    def _tell_news(self, about: str, texts: Sequence[str],
                   tell: Callable[[str, str], None]) -> None:
        """Log what was not there at the last look."""
        for text in texts:
            if text not in self._told.get(about, ()):
                tell(about, text)
        self._told[about] = texts

    def _tell_deaf_stations(self, numbers: list[int]) -> None:
        """Log once that a station takes no commands, and once that it does again."""
        before = self._told.get('deaf', ())
        for number in numbers:
            if number not in before:
                self.notes.warning(f'commands to {number}', f'{deaf_text(number)} "plc detect" '
                                   'finds it, with the node stopped')
        for station in self.driver.stations:
            if station.number in before and station.number not in numbers and station.active:
                self.notes.info(f'commands to {station.number}',
                                f'station {station.number} answers commands')
        self._told['deaf'] = numbers

    def _look_at_files(self, now: float) -> None:
        """Log once that a file has changed since it was read."""
        if now < self._next_look:
            return
        self._next_look = now + _FILE_PERIOD
        names = self.diagnostics.changed_files = self.configuration.files.changed()
        self._tell_news('the files', [changed_text(names)] if names else [], self.notes.warning)

    def _look_at_names(self, now: float) -> None:
        """Log once that another node has our name, and once that it has gone."""
        watch = self._surroundings.duplicate_names
        is_news = watch.look(now)
        self.diagnostics.has_duplicate_name = watch.has_found
        if not is_news:
            return
        name = self._surroundings.node.get_fully_qualified_name()
        if watch.has_found:
            self.notes.warning(
                'the name', f'another node is called {name} too: both publish and take the same '
                            'topics; give one another name, as in -r __node:=line_2')
        else:
            self.notes.info('the name', f'no other node is called {name} any more')

    def publish_diagnostics(self, now: float) -> None:
        """Publish all statuses at the clock value ``now`` (s)."""
        period = self.configuration.parameters.diagnostics_period
        self._next_diagnostics = now + period - (now - self._phase) % period
        self._publish(self._surroundings.diagnostics,
                      DiagnosticArray(status=self.diagnostics.statuses(now)))

    def _publish_snapshot(self, now: float) -> None:
        """Publish all values where that is due and somebody wants to see them."""
        period = self.configuration.parameters.snapshot_period
        if not period or now < self._next_snapshot:
            return
        self._next_snapshot = now + period
        if self._surroundings.snapshot.get_subscription_count():
            self._snapshot = self._snapshot or Snapshot(self.driver.points, self.reads.latest)
            self._publish(self._surroundings.snapshot, self._snapshot.message(now))

    def _publish(self, publisher: Any, message: DiagnosticArray) -> None:
        # Simulated time may still be 0, which would sort before all other messages.
        now = self._surroundings.node.get_clock().now()
        stamped = now if now.nanoseconds else Clock(clock_type=ClockType.SYSTEM_TIME).now()
        message.header.stamp = stamped.to_msg()
        publisher.publish(message)
