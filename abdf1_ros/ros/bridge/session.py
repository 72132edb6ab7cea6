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
The session of one pair of files: a reload drops it and makes a new session.

A session has the driver, its topics, watches and statuses. The link's thread publishes values and
results directly, without the executor: rclpy allows any thread to use a publisher.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
import math
import time

from abdf1_ros.driver.driver import Driver
from abdf1_ros.pccc.values import Values
from abdf1_ros.plan.forecast import USUAL_RESPONSE_TIME
from abdf1_ros.plan.report import Remark, Report, setting_remarks
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.port_thread import PortState
from abdf1_ros.ports.trace import PortOpener
from abdf1_ros.ros.bridge.guests import GuestPlaces
from abdf1_ros.ros.bridge.offer import OfferedPublisher
from abdf1_ros.ros.bridge.status_publisher import StatusPublisher
from abdf1_ros.ros.callbacks import AnsweringNode
from abdf1_ros.ros.diagnostics.alarms import Alarms
from abdf1_ros.ros.diagnostics.events import LineEvents
from abdf1_ros.ros.diagnostics.graph import Graph, NameWatch, TypeWatch
from abdf1_ros.ros.diagnostics.log import ERROR, INFO, NodeLog, WARN
from abdf1_ros.ros.diagnostics.other_publishers import OtherPublisherWatch, StrayWatch
from abdf1_ros.ros.diagnostics.stations import LinkCounterService
from abdf1_ros.ros.diagnostics.status import Seen
from abdf1_ros.ros.diagnostics.statuses import Diagnostics
from abdf1_ros.ros.diagnostics.watches import Watch, watches_of
from abdf1_ros.ros.parameters.declared import Configuration
from abdf1_ros.ros.topic_names import TopicNames
from abdf1_ros.ros.topics.interlocks import InterlockWatch
from abdf1_ros.ros.topics.messages import ACTIVE_LAYOUT
from abdf1_ros.ros.topics.reads import ReadTopic, ReadTopics
from abdf1_ros.ros.topics.services import RowServices
from abdf1_ros.ros.topics.writes import WriteTopic, WriteTopics
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.settings.resets import lost_by_reset
from abdf1_ros.text import first
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.publisher import Publisher
from std_msgs.msg import UInt16MultiArray

_MOST_REMARKS = 20  # most remarks on both files in the log

_GLANCE = 0.005  # s between two checks whether the PLCs have confirmed


@dataclass(slots=True)
class Surroundings:
    """
    The parts of a bridge that a reload keeps.

    - ``published``: the read topics, kept if the next files have the same row
    - ``is_offered``: the topics and services exist
    - ``link``: set when the first session has made its machine
    """

    node: AnsweringNode
    graph: Graph
    names: NameWatch
    opener: PortOpener
    results: OfferedPublisher
    active_stations: OfferedPublisher
    diagnostics: Publisher
    snapshot: OfferedPublisher
    writes: WriteTopics
    services: RowServices = field(init=False)
    is_offered: bool = False
    published: dict[str, ReadTopic] = field(default_factory=dict)
    active_words: Sequence[int] = ()
    log: NodeLog = field(init=False)
    link: LinkThread = field(init=False)

    def __post_init__(self) -> None:
        """Make the log and the services of rows."""
        self.log = NodeLog(self.node.get_logger(), line_time)
        self.services = RowServices(self.node, self.writes, self.wake_executor)

    def wake_executor(self) -> None:
        if self.node.executor is not None:
            self.node.executor.wake()


class BridgeSession:
    """
    The bridge between one pair of files and ROS.

    Make the session before its driver is on the line. Then call ``begin``, and call ``end`` after
    a new session has replaced it. Only the executor's thread does this; before the executor runs,
    any thread may. One thread calls ``check`` every 0.1 s.
    """

    def __init__(self, surroundings: Surroundings, configuration: Configuration) -> None:
        self.configuration = configuration
        self._surroundings = surroundings
        node, parameters = surroundings.node, configuration.parameters
        network, mappings = configuration.network, configuration.mappings
        self.reads = ReadTopics(
            node, surroundings.published,
            (configuration.port, *network.ports[1:], f'as station {network.station}'))
        seen = Seen(lambda: surroundings.names.text, latest=self.reads.latest,
                    diagnostics_period=parameters.diagnostics_period,
                    is_waiting=lambda: self.is_waiting)
        self.events = LineEvents(
            surroundings.log, self.port, mappings.asked,
            scans=not network.line_mode.has_one_plc, seen=seen, read=self._reader(),
            results=surroundings.results, table_changed=self._publish_active,
            answer=surroundings.services.take)
        self.driver = Driver(network, mappings, configuration.driver_settings(), self.events)
        self._alarms = Alarms(self.driver.points.values(), self.port, line_time)
        self.writers: dict[str, WriteTopic] = {}
        self.guests = GuestPlaces(configuration, self.driver, surroundings.opener,
                                  self.events.notes, self._wake_link)
        self.diagnostics = Diagnostics(
            node.get_fully_qualified_name().lstrip('/'), self.driver, self.port,
            self.events, configuration.map_problems, self.guests.lines, self._alarms.statuses)
        self.status_publisher = StatusPublisher(
            node, surroundings.diagnostics, surroundings.snapshot, parameters, self.diagnostics,
            self._alarms, self.driver.points)
        self.owners = InterlockWatch(node, self.driver)
        our_name, names = node.get_fully_qualified_name(), TopicNames.of(
            node.resolve_topic_name, mappings)
        self._watches: list[Watch] = [
            surroundings.names,
            TypeWatch(surroundings.graph, our_name, names, mappings),
            OtherPublisherWatch(surroundings.graph, our_name, names, seen),
            StrayWatch(surroundings.graph, our_name, names, seen),
            *watches_of(self.diagnostics.line, self.port, seen, self.guests.lines,
                        configuration.files.changed, self.owners.look, self.owners.refusing,
                        surroundings.graph.dds.look)]
        self.link_counters = LinkCounterService(
            self.driver, self._wake_link, surroundings.wake_executor)
        self._port_text = ''
        # Of an open port that a reload keeps: our line if it was, or from the first answer on.
        self._is_ours, self._opened = surroundings.is_offered, -math.inf
        if surroundings.is_offered:
            # Subscriptions first: after thousands of publishers, each subscription takes DDS 5 ms.
            self.writers = self._open_writers()
            self.reads.open(self.driver.points)

    @property
    def port(self) -> str:
        return self.configuration.port

    def _reader(self) -> Callable[[Mapping, Values], None]:
        """Return the function that gets the values of good reads, in the thread of the link."""
        if any(mapping.alarm for mapping in self.configuration.mappings):
            return self._read_with_alarms
        return self.reads.read

    def _read_with_alarms(self, mapping: Mapping, values: Values) -> None:
        self.reads.read(mapping, values)
        self._alarms.read(mapping, values)

    def _open_writers(self) -> dict[str, WriteTopic]:
        parameters, surroundings = self.configuration.parameters, self._surroundings
        surroundings.services.open(
            self.driver, parameters.most_services, parameters.write_timeout, self._wake_link)
        return surroundings.writes.open(
            self.driver, parameters.write_timeout, self.events, self._wake_link)

    @property
    def is_waiting(self) -> bool:
        """Return True if this is a spare, and another bridge may have the line."""
        return not self._surroundings.is_offered

    @property
    def has_line(self) -> bool:
        """
        Return True if no other program can have the line.

        A device belongs to us while it is open. A device server may accept our connection and
        still keep us waiting; so with a device server, a station has to answer first.
        A reload on the same connection changes nothing in that.
        """
        stations = [*self.driver.stations]
        return self._surroundings.link.state.is_open and (
            '://' not in self.port or not stations or self._is_ours
            or any(station.last_heard is not None and station.last_heard >= self._opened
                   for station in stations))

    def offer(self) -> None:
        """Make the topics of the map, while the driver has the line."""
        self.writers = self._open_writers()
        self._surroundings.writes.give_to(self.writers)
        self.reads.offer(self.driver.points)
        self._surroundings.active_words = ()
        self._publish_active()
        self.guests.start()

    def go_on(self) -> None:
        """Take back write topics and services: the session of new files could not be made."""
        if not self.is_waiting:
            self.writers = self._open_writers()
            self._surroundings.writes.give_to(self.writers)

    def withdraw(self) -> None:
        """Close the topics of the map, and the places of guests: the bridge has lost the line."""
        self.guests.pause()
        self._surroundings.services.withdraw()
        self._surroundings.writes.withdraw()
        self.reads.withdraw()

    def begin(self) -> None:
        """Log a summary of the files; the driver is on the line, or soon will be."""
        configuration = self.configuration
        # Load remarks first, because dozens of setting remarks may follow.
        remarks = [*self._plan().load_remarks(), *setting_remarks(
            configuration.network, configuration.mappings)]
        self._surroundings.log.tell_files(
            [*_about_files(configuration), *_about_remarks(remarks)])
        self.reads.take_over()
        # with a closed port, port_changed publishes the table after the first attempt to open it
        if self._surroundings.link.state.is_open:
            self._publish_active()

    def _plan(self) -> Report:
        return Report(self.configuration.network, self.driver.mappings,
                      tuple(self.driver.readings.blocks),
                      self.configuration.driver_settings().default_period, USUAL_RESPONSE_TIME)

    def end(self) -> None:
        """End all calls and watches; a new session has taken over the topics."""
        self.events.unreadable_rows.tell()
        self.guests.stop()
        self.link_counters.end()
        self.owners.end()

    @property
    def is_ending(self) -> bool:
        """Return True if the bridge ends for good."""
        return self.driver.kernel.end.is_final

    def begin_end(self, *, is_final: bool = False) -> None:
        """Begin to set heartbeats to 0 and write fallbacks (rule 5); ``tell_plcs`` waits."""
        self.events.unreadable_rows.tell()
        self.driver.kernel.end.wind_down(is_final=is_final)
        self._wake_link()

    def has_to_wait(self, is_meant: Callable[[Mapping], bool]) -> bool:
        """
        Tell whether PLCs have still to confirm what the end writes.

        A lost port may come back, for the rows that ``is_meant``. With standby, another bridge may
        have the line by then.
        """
        link = self._surroundings.link
        is_open = link.state.is_open
        is_gone = link.is_released or self.configuration.parameters.standby
        return link.is_alive() and (is_open or not is_gone) \
            and self.driver.kernel.end.has_to_wait(is_open=is_open, is_meant=is_meant)

    def tell_unconfirmed(self, what: str) -> list[str]:
        """
        Log the rows that the PLCs have not confirmed, and those that were not written again.

        Return the same as texts. A spare without the line has none: these rows belong to the
        bridge that has the line.
        """
        has_line = self._surroundings.link.state.is_open
        if self.is_waiting or self.configuration.parameters.standby and not has_line:
            return []
        end, notes, told = self.driver.kernel.end, self.events.notes, list[str]()
        if tags := end.unconfirmed(line_time()):
            told.append(f'{what} before the PLC has confirmed: {first(tags)}')
            notes.error(f'rows as it {what}', told[-1])
        if tags := end.not_repeated():
            told.append(f'{what}; confirmed before, but not written again: {first(tags)}')
            notes.warning(f'rows as it {what}', told[-1])
        return told

    def close_line(self) -> None:
        """Let the link end: all is written, or there is no time left."""
        self._surroundings.link.ask_to_stop()

    def _wake_link(self) -> None:
        self._surroundings.link.wake()

    def _publish_active(self) -> None:
        """Publish the Active Node Table if it changes; with a closed port no station is active."""
        surroundings, published = self._surroundings, self._surroundings.active_words
        # Again if the other thread, executor or link, has published a newer table meanwhile.
        while (words := self._active_words()) != published:
            published = surroundings.active_words = words
            surroundings.active_stations.publish(
                UInt16MultiArray(layout=ACTIVE_LAYOUT, data=words))

    def _active_words(self) -> Sequence[int]:
        return self.driver.stations.words() if self._surroundings.link.state.is_open else [0] * 16

    def port_changed(self, state: PortState) -> None:
        """Log the state of the port."""
        if state.text == self._port_text:
            return  # the attempt has failed for the same reason as the last one
        self._port_text = state.text
        self._is_ours, self._opened = False, line_time()
        if state.is_open:
            self.diagnostics.line.port_opened()
        self._forget_connection()
        self.events.port_changed()
        self._publish_active()
        # a spare does not log this: a device server may accept and close its connection every
        # second; the status shows it
        if self.is_waiting:
            return
        is_meant = state.is_open or self._surroundings.link.is_released
        notes = self.events.notes
        tell = notes.info if is_meant else notes.error
        tell('the port', f'{self.port}: {state.text}')

    def _forget_connection(self) -> None:
        """Drop old values and results: a bridge may get the line again hours later."""
        self.events.seen.take_over_fault = ''
        self.reads.latest.clear()
        if self.configuration.parameters.standby:
            self.driver.kernel.forget_served()
        if self.is_waiting:
            self._surroundings.results.waiting.clear()

    def check(self) -> None:
        """Publish diagnostics if due or if a level has changed; end calls that wait no longer."""
        wall, now = time.time(), line_time()
        self._surroundings.writes.host_clock.look(now, wall)
        self.link_counters.check(now)
        self._surroundings.services.look(now)
        self.events.unreadable_rows.look(now)
        for watch in self._watches:
            self._look(watch, now)
        try:
            self.status_publisher.look(now, is_waiting=self.is_waiting)
        except Exception as error:  # a status must not end a bridge
            self._surroundings.node.tell_failure('a status', error)

    def _look(self, watch: Watch, now: float) -> None:
        """Log the news of a watch; a watch fails if DDS reports a name that rclpy cannot read."""
        try:
            for news in watch.look(now):
                self.events.notes.tell(news)
        except Exception as error:
            self._surroundings.node.tell_failure('a periodic check', error)


def tell_plcs(sessions: Sequence[BridgeSession], what: str, limit: float, *,
              is_meant: Callable[[Mapping], bool] = lambda mapping: True,
              closes_lines: bool = False) -> list[str]:
    """
    Set heartbeats to 0 and write fallbacks in all sessions, and wait for all (rule 5).

    Return what the log tells of rows that are not safe. The wait takes at most ``limit`` s.
    ``what``: what the bridge does next, for the log. ``is_meant``: the rows for which a lost port
    is waited for. With ``closes_lines`` the link of each session ends when its own end is over: no
    line waits for another.
    """
    give_up = time.monotonic() + limit
    for session in sessions:
        session.begin_end()
    left, told = [*sessions], list[str]()
    while left:
        is_late = time.monotonic() >= give_up
        for session in [each for each in left if is_late or not each.has_to_wait(is_meant)]:
            left.remove(session)
            told += session.tell_unconfirmed(what)
            if closes_lines:
                session.close_line()
        if left:
            time.sleep(_GLANCE)
    return told


def _about_files(configuration: Configuration) -> Iterator[tuple[LoggingSeverity, str]]:
    """Yield a summary of both files."""
    yield INFO, str(configuration)
    for problem in configuration.map_problems:
        yield ERROR, f'{problem} (row left out)'
    silent = [mapping.tag for mapping in configuration.mappings if mapping.is_alone]
    if silent and configuration.parameters.read_only:
        yield WARN, (
            f'read_only: no heartbeat and no fallback value is written: {first(silent)}')
    if not configuration.mappings:
        yield WARN, 'the map has no usable row: nothing is read or written'
    if configuration.parameters.standby and '://' in configuration.port \
            and not configuration.mappings.stations:
        yield WARN, ('standby: no row is of a PLC, so an open connection counts as the line; '
                     'the device server must refuse a second client')
    if configuration.idle:
        yield WARN, (f'{first(configuration.idle)} without effect: only for Mode Master with '
                     'Polling Standard')
    lost = lost_by_reset(configuration.network, configuration.mappings)
    if configuration.driver_settings().nak_on_command_timeout and lost:
        yield WARN, ('nak_on_command_timeout: each overdue reply makes all slaves drop what '
                     f'they have queued: {"; ".join(lost)}')
    if configuration.ignored:
        yield WARN, (
            'parameters without effect, because only the map file counts: '
            + first(configuration.ignored))


def _about_remarks(remarks: Sequence[Remark]) -> Iterator[tuple[LoggingSeverity, str]]:
    """Yield the remarks of ``check`` on both files, in the same order."""
    for remark in remarks[:_MOST_REMARKS]:
        yield WARN, remark.text
    if len(remarks) > _MOST_REMARKS:
        yield WARN, (
            f'and {len(remarks) - _MOST_REMARKS} more remarks; "check" has them all')
