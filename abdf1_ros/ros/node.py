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
The ROS node: mapped reads as topics, writes as subscriptions, state as diagnostics.

Values and results are published from the link thread itself, without the executor in between;
publishers may be used from any thread. Everything is created before that thread starts and
destroyed after it has ended.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
import random
import time
from typing import Any

from abdf1_ros.df1.stations import Station
from abdf1_ros.driver.driver import Driver
from abdf1_ros.driver.points import Outcome, WriteResult
from abdf1_ros.driver.writes import MAX_WAITING_WRITES
from abdf1_ros.messages import Event, Message
from abdf1_ros.pccc.values import Values
from abdf1_ros.plan.report import setting_remarks
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ports.link_thread import LinkThread, PortState
from abdf1_ros.ports.settings import PortSettings
from abdf1_ros.ports.trace import PortOpener
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.ros.diagnostics import changed_text, deaf_text, Diagnostics
from abdf1_ros.ros.graph import DuplicateNameWatch, Graph, TypeWatch
from abdf1_ros.ros.interlocks import begin_end, END_LIMIT, InterlockWatch, wait_for_end
from abdf1_ros.ros.line_figures import speed_seen
from abdf1_ros.ros.log import EventLog, LimitedLog
from abdf1_ros.ros.messages import ACTIVE_LAYOUT, latched_qos
from abdf1_ros.ros.parameters import Configuration, configure, declare_again, read_again
from abdf1_ros.ros.port_owners import PortOwners
from abdf1_ros.ros.process import (
    EXIT_FAULT,
    LAST_WRITES,
    make_parser,
    Program,
    run_ros,
    take_last_writes,
)
from abdf1_ros.ros.reads import ReadTopics
from abdf1_ros.ros.station_health import LinkCounterService
from abdf1_ros.ros.write_log import is_usual_fallback
from abdf1_ros.ros.writes import WriteTopics
from abdf1_ros.settings.mapping import Mapping
from abdf1_ros.signals import EndRequest
from abdf1_ros.text import printable
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import UInt16MultiArray
from std_srvs.srv import SetBool, Trigger

NODE_NAME = 'abdf1'

_USAGE = 'node --ros-args -p net_file:=net.csv -p map_file:=map.csv'

_HELP = """\
Read and write the data tables of PLCs over DF1, and show them as topics.

parameters, after --ros-args (docs/reference/parameters.md has all of them):
  -p net_file:=PATH   the line, needed
  -p map_file:=PATH   what is read and written, needed
  -p port:=DEVICE     a device path or URL instead of the file's Com_Port

examples:
  node --ros-args -p net_file:=net.csv -p map_file:=map.csv
  node --ros-args --params-file line_1.yaml -r __node:=line_1

exit status: 0 after Ctrl-C, SIGTERM or SIGHUP, 2 for faulty files or parameters,
1 after internal errors, and where ROS does not start (log directory, network)
"""

# How often (s) levels are compared, so that a change of one is published at once.
LEVEL_CHECK_PERIOD = 0.1

# How often (s) the node looks whether its files have changed.
_FILE_PERIOD = 2.0

# How long the end waits for its last diagnostics to arrive, where a subscriber is stuck.
_LAST_WORDS = Duration(seconds=0.5)

_MOST_NAMES = 5  # in a line of the log
_MOST_REMARKS = 20  # about both files, in the log

_RESULT_LEVELS = {
    Outcome.WRITTEN: DiagnosticStatus.OK, Outcome.BROADCAST: DiagnosticStatus.WARN,
    Outcome.SUPERSEDED: DiagnosticStatus.WARN, Outcome.FALLBACK: DiagnosticStatus.WARN}


@dataclass(frozen=True, slots=True)
class _NodeListener:
    """The listener of one driver; its values go to the topics of its map."""

    read: Callable[[Mapping, Values], None]
    unreadable: Callable[[Mapping, str], None]
    published_again: Callable[[Mapping, float], None]
    written: Callable[[WriteResult], None]
    happened: Callable[[Event], None]
    station_changed: Callable[[Station], None]


class BridgeNode(Node):
    """
    The bridge; raises ConfigurationError when parameters or files are not fit to run with.

    ``check`` is to be called every 0.1 s, in any one thread; with ``has_timer`` the executor
    does it. ``graph`` and ``port_owners`` are those of all lines of the process.
    """

    def __init__(self, name: str = NODE_NAME, *, has_timer: bool = True,
                 graph: Graph | None = None, port_owners: PortOwners | None = None,
                 **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        self._hold_ports = partial(
            (port_owners or PortOwners()).hold, self.get_fully_qualified_name())
        try:
            configuration = configure(self)
            self._hold_ports(configuration.port)
            self._set_up(configuration, graph or Graph(self), has_timer)
        except Exception:  # other lines of this process go on
            self.destroy_node()
            raise

    def destroy_node(self) -> None:
        self._hold_ports()
        super().destroy_node()

    def _set_up(self, configuration: Configuration, graph: Graph, has_timer: bool) -> None:
        self._tell(configuration)
        self._log = EventLog(self.get_logger(), line_time)
        self._notes = LimitedLog(self.get_logger(), line_time)
        # All writes that wait can end at once, faster than a subscriber takes their results.
        self._results = self.create_publisher(
            DiagnosticStatus, '~/write_results', MAX_WAITING_WRITES)
        self._active = self.create_publisher(
            UInt16MultiArray, '~/active_stations', latched_qos())
        self._diagnostics_publisher = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        parameters, network = configuration.parameters, configuration.network
        self._configuration = configuration
        self._wrong_types: list[str] = []
        self._deaf_stations: list[int] = []
        self._echo_text = ''
        self._has_told_tools = False
        self._may_have_left_over: set[int | None] = set()
        self._duplicate_names = DuplicateNameWatch(
            lambda now: graph.nodes(self.get_name(), self.get_namespace(), now))
        self._next_diagnostics = self._next_look = 0.0
        # The nodes of a process are not to publish all at the same moment.
        self._phase = random.uniform(0.0, parameters.diagnostics_period)
        self._levels: list[bytes] = []
        self._port_text = ''
        self._told_speed: float | None = None
        self._opener = PortOpener(
            self._port_settings(),
            lambda text: self.get_logger().debug(f'{printable(self.port)}: {text}'))
        if parameters.trace_file:
            self._opener.trace(
                parameters.trace_file, parameters.trace_limit * 1e6,
                {'check': network.checksum.value, 'duplex': network.duplex.name.lower()},
                lambda text: self._notes.error('trace_file', f'trace_file: {text}'))
        self.driver, self._reads = self._make_driver(None)
        self.link = LinkThread(
            self.driver.machine, self._opener.open, on_state=self._port_changed,
            on_fault=self._fault, while_sending=self._reads.publish_later_values)
        self._diagnostics = self._make_diagnostics(None)
        self._writes = WriteTopics(self, parameters.write_timeout, self._lost, self.link.wake)
        self._writes.use(self.driver)
        self._interlocks = InterlockWatch(self)
        self._interlocks.use(self.driver)
        self._type_watch = TypeWatch(graph, self.resolve_topic_name)
        self._type_watch.use(self.driver.mappings)
        self._link_counters = LinkCounterService(self.driver, self.link, self._wake_executor)
        self._create_services()
        if has_timer:
            # Not the node's clock, which may be a simulated one that stands still.
            self.create_timer(LEVEL_CHECK_PERIOD, self.check,
                              clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _wake_executor(self) -> None:
        if self.executor is not None:
            self.executor.wake()

    @property
    def port(self) -> str:
        return self._configuration.port

    def _port_settings(self) -> PortSettings:
        parameters = self._configuration.parameters
        return PortSettings.of(
            self._configuration.network, self.port, low_latency=parameters.low_latency,
            rs485=parameters.rs485)

    def _make_driver(self, before: ReadTopics | None) -> tuple[Driver, ReadTopics]:
        """Return a driver for the files, and the topics that it publishes to."""
        reads = ReadTopics(self)
        listener = _NodeListener(
            reads.read, self.unreadable, self.published_again, self.written, self.happened,
            self.station_changed)
        configuration = self._configuration
        driver = Driver(configuration.network, configuration.mappings,
                        configuration.driver_settings(), listener)
        reads.open(driver.points, before)
        return driver, reads

    def _make_diagnostics(self, before: Diagnostics | None) -> Diagnostics:
        configuration = self._configuration
        diagnostics = Diagnostics(
            self.get_fully_qualified_name().lstrip('/'), self.driver, configuration.port,
            configuration.map_problems, Path(configuration.parameters.map_file).name,
            before.writes if before else None)
        diagnostics.attach(self.link, self._opener)
        return diagnostics

    def _create_services(self) -> None:
        self.create_service(Trigger, '~/reset_counters', self._reset_counters)
        self.create_service(Trigger, '~/reload', self._reload)
        self.create_service(SetBool, '~/polling', self._set_polling)
        self.create_service(Trigger, '~/read_link_counters', self._link_counters.answer,
                            callback_group=MutuallyExclusiveCallbackGroup())

    def _tell(self, configuration: Configuration) -> None:
        """Log a summary of both files."""
        self.get_logger().info(str(configuration))
        for problem in configuration.map_problems:
            self.get_logger().error(f'{problem} (row left out)')
        self._tell_remarks(configuration)
        silent = [mapping.tag for mapping in configuration.mappings
                  if mapping.heartbeat or mapping.fallback]
        if silent and configuration.parameters.read_only:
            self.get_logger().warning(
                f'read_only: no heartbeat and no fallback value is written: {_few(silent)}')
        if not configuration.mappings:
            self.get_logger().warning('the map has no usable row: nothing is read or written')
        if configuration.ignored:
            self.get_logger().warning(
                'parameters without effect, as the map comes from its file alone: '
                + _few(configuration.ignored))

    def _tell_remarks(self, configuration: Configuration) -> None:
        remarks = [*setting_remarks(configuration.network, configuration.mappings)]
        for remark in remarks[:_MOST_REMARKS]:
            self.get_logger().warning(printable(remark.text))
        if len(remarks) > _MOST_REMARKS:
            self.get_logger().warning(
                f'and {len(remarks) - _MOST_REMARKS} more remarks; "check" has them all')

    @property
    def writes_taken(self) -> int:
        """Return how many messages to write topics have come."""
        return self._writes.taken

    def start(self) -> None:
        """Open the port and begin to read."""
        self.link.start()

    def begin_end(self) -> None:
        """Have heartbeats set to 0 and fallbacks written; ``finish_end`` waits for it."""
        begin_end(self.driver, self.link)

    def finish_end(self, give_up: float, what: str = 'ends') -> None:
        """
        Wait until the PLCs know, up to a monotonic clock value; name what is not confirmed.

        ``what`` says in the log what goes on then (docs/heartbeats.md, rule 5).
        """
        tags = wait_for_end(self.driver, self.link, give_up)
        if tags:
            self.get_logger().error(f'{what} before the PLC has confirmed: {_few(tags)}')

    def stop(self, patience: Duration = _LAST_WORDS) -> None:
        """
        End the link thread, then tell the last state; the node may be destroyed after it.

        Where the link still runs, PLCs are told of the end first. ``patience`` is for a subscriber
        that is stuck.
        """
        if self.link.is_alive():
            self.begin_end()
            self.finish_end(time.monotonic() + END_LIMIT)
        self.link.stop()
        self._opener.close()
        self._publish_diagnostics(line_time())
        # Messages that are still under way would be lost with their publisher.
        give_up = time.monotonic() + patience.nanoseconds / 1e9
        for publisher in (self._results, self._diagnostics_publisher):
            publisher.wait_for_all_acked(Duration(seconds=max(0.0, give_up - time.monotonic())))

    def _lost(self, topic: str, count: int) -> None:
        self._diagnostics.lost(topic, count, line_time())
        self._notes.warning(f'lost writes to {topic}', f'~/write/{topic}: {count} messages were '
                            'lost on their way here, and have no result: they come faster than '
                            'they can be taken')

    def unreadable(self, mapping: Mapping, reason: str) -> None:
        """Log why a read of a station that answers has no value."""
        self._notes.error(mapping.tag, f'{mapping.tag} ({mapping.address} at station '
                                       f'{mapping.station}): {reason}')

    def published_again(self, mapping: Mapping, seconds: float) -> None:
        """Log that a row is not withheld any more, nor are those that depend on the same."""
        self._notes.info(mapping.tag, f'{mapping.tag} ({mapping.address} at station '
                                      f'{mapping.station}): published again after {seconds:.1f} s')

    def written(self, result: WriteResult) -> None:
        """Publish the result of a write."""
        self._diagnostics.written(result, line_time())
        mapping = result.mapping
        level = _RESULT_LEVELS.get(result.outcome, DiagnosticStatus.ERROR)
        if level == DiagnosticStatus.ERROR or result.outcome is Outcome.FALLBACK:
            tell = self._notes.info if is_usual_fallback(result) else self._notes.warning
            tell(f'writes to {mapping.tag}', f'write to {mapping.tag} {result.value}: {result}')
        values = {'address': str(mapping.address), 'station': str(mapping.station),
                  'value': result.value, 'latency_ms': f'{result.latency * 1000:.1f}',
                  'request': result.request}
        self._results.publish(DiagnosticStatus(
            level=level, name=printable(mapping.tag), message=printable(str(result)),
            hardware_id=printable(self.port),
            values=[KeyValue(key=key, value=value) for key, value in values.items()]))

    def happened(self, event: Event) -> None:
        """Log a numbered event and remember it for the diagnostics."""
        if self._may_have_left_over and self._is_left_over(event):
            self._notes.info(
                f'station {event.station}', f'station {event.station}: a reply to a command from '
                'before the port was opened is dropped')
            return
        self._diagnostics.happened(event, line_time())
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
            self._notes.info(about, f'{about} answers again')
        else:
            self._notes.error(about, Message.ERR_INACTIVE_STATION.entry(station.number))
            if station.last_heard is None:
                self._tell_tools(about)

    def _tell_tools(self, about: str) -> None:
        """Name, once, what finds out why a station has never been heard."""
        if self._has_told_tools:
            return
        self._has_told_tools = True
        scan = '' if self.driver.network.mode == 'Peer' else ', "plc scan" which stations answer'
        self.get_logger().info(
            f'{about} has never been heard: with the node stopped, "plc detect" finds the '
            f'settings of the line{scan}')

    def _publish_active(self) -> None:
        """Publish the Active Node Table; with a closed port no station is active."""
        words = self.driver.stations.words() if self.link.state.is_open else [0] * 16
        self._active.publish(UInt16MultiArray(layout=ACTIVE_LAYOUT, data=words))

    def _port_changed(self, state: PortState) -> None:
        if state.text == self._port_text:
            return  # an attempt that failed like the one before
        self._port_text = state.text
        self._may_have_left_over = {station.number for station in self.driver.stations}
        self._publish_active()
        is_meant = state.is_open or self.link.is_released
        tell = self._notes.info if is_meant else self._notes.error
        tell('the port', f'{self.port}: {state.text}')

    def _fault(self, error: Exception) -> None:
        self.get_logger().error(f'internal error: {error!r}; please report it')

    def check(self) -> None:
        """Publish diagnostics when they are due or a level has changed; end what waits."""
        now = line_time()
        self._look_at_files(now)
        self._link_counters.check(now)
        if self._duplicate_names.look(now):
            self._duplicate_name_came_or_went(self._duplicate_names.has_found)
        self._tell_speed(self.driver.machine.rate.seen)
        for text in self._type_watch.look(now):
            self._notes.warning('types of topics', text)
        if self._interlocks.look(now):
            self._tell_crowd()
        wrong_types = self._diagnostics.wrong_types()
        for text in wrong_types:
            if text not in self._wrong_types:
                self._notes.warning('types of PLCs', text)
        self._wrong_types = wrong_types
        self._tell_deaf_stations(self._diagnostics.deaf_stations(now))
        self._tell_echo(self._diagnostics.echo_text())
        levels = self._diagnostics.levels(now)
        if now >= self._next_diagnostics or levels != self._levels:
            self._levels = levels
            self._publish_diagnostics(now)

    def _tell_echo(self, text: str) -> None:
        """Log once that the line gives back what is sent, where that does harm."""
        if text and text != self._echo_text:
            self._notes.error('echo', f'{self.port}: {text}')
        self._echo_text = text

    def _tell_deaf_stations(self, numbers: list[int]) -> None:
        """Log once that a station takes no commands, and once that it does again."""
        for number in numbers:
            if number not in self._deaf_stations:
                self._notes.warning(f'commands to {number}', f'{deaf_text(number)} "plc detect" '
                                    'finds it, with the node stopped')
        for number in self._deaf_stations:
            if number not in numbers and self.driver.stations[number].active:
                self._notes.info(f'commands to {number}', f'station {number} answers commands')
        self._deaf_stations = numbers

    def _look_at_files(self, now: float) -> None:
        """Log once that a file has changed since it was read."""
        if now < self._next_look:
            return
        self._next_look = now + _FILE_PERIOD
        names = self._configuration.files.changed()
        if names and not self._diagnostics.changed_files:
            self._notes.warning('the files', changed_text(names))
        self._diagnostics.changed_files = names

    def _tell_crowd(self) -> None:
        """Warn of topics with a Fallback that more than one publisher feeds (rule 17)."""
        self._diagnostics.crowded = self._interlocks.crowded
        for topic in self._interlocks.crowded:
            self._notes.warning(f'publishers of {topic}', (
                f'~/write/{topic} has more than one publisher: its fallback value is not written '
                'while any of them goes on (a forgotten "ros2 topic pub -r"?)'))

    def _tell_speed(self, seen: float | None) -> None:
        """Log once that the line is faster, or slower, than it is set."""
        if seen is None or self._told_speed is not None and (seen > 1) is (self._told_speed > 1) \
                or not self._opener.has_speed:
            return
        self._told_speed = seen
        text = f'{self.port}: Baud is {self.driver.network.baud}, ' \
               f'but the line shows {speed_seen(self.driver, has_speed=True)}'
        if seen > 1:
            self._notes.info('the speed', text)
        else:
            self._notes.warning('the speed', f'{text}: time-outs begin before frames have left')

    def _duplicate_name_came_or_went(self, is_there: bool) -> None:
        self._diagnostics.has_duplicate_name = is_there
        name = self.get_fully_qualified_name()
        if is_there:
            self._notes.warning(
                'the name', f'another node is called {name} too: both publish and take the same '
                            'topics; give one another name, as in -r __node:=line_2')
        else:
            self._notes.info('the name', f'no other node is called {name} any more')

    def _publish_diagnostics(self, now: float) -> None:
        period = self._configuration.parameters.diagnostics_period
        self._next_diagnostics = now + period - (now - self._phase) % period
        message = DiagnosticArray(status=self._diagnostics.statuses(now))
        # Simulated time may still be 0, which would sort before all other messages.
        now_ros = self.get_clock().now()
        stamped = now_ros if now_ros.nanoseconds else Clock(clock_type=ClockType.SYSTEM_TIME).now()
        message.header.stamp = stamped.to_msg()
        self._diagnostics_publisher.publish(message)

    def _reload(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Use the files as they are now, or go on as before where these have faults."""
        try:
            configuration = read_again(self, self._configuration.parameters)
            self._hold_ports(self.port, configuration.port)
        except ConfigurationError as error:
            for problem in error.problems:
                self.get_logger().error(f'{problem} (goes on as before)')
            texts = [printable(str(problem)) for problem in error.problems]
            response.message = 'goes on as before: ' + '; '.join(texts[:_MOST_REMARKS])
            return response
        response.success = self._go_on_with(configuration)
        self._hold_ports(self.port)
        response.message = printable(str(configuration))
        if not response.success:
            response.message = 'goes on as before: the link does not take the new files'
            self.get_logger().error(response.message)
        return response

    def _go_on_with(self, configuration: Configuration) -> bool:
        """Use the new files; return False where the link does not take them."""
        before, old_reads, old = self.driver, self._reads, self._configuration
        # For heartbeats and fallbacks new files count as a start.
        self.begin_end()
        self.finish_end(time.monotonic() + END_LIMIT, 'goes on with new files')
        self._configuration = configuration
        driver, reads = self._make_driver(old_reads)
        reopen = self._opener.use(self._port_settings())
        if not self.link.exchange(driver.machine, reads.publish_later_values, reopen):
            self._configuration = old
            self._opener.use(self._port_settings())
            reads.end(old_reads)
            before.resume()
            return False
        self._tell(configuration)
        declare_again(self, configuration)
        self.driver, self._reads = driver, reads
        self._diagnostics = self._make_diagnostics(self._diagnostics)
        self._link_counters.use(driver)
        self._writes.use(driver)
        old_reads.end(reads)
        reads.complete()
        self._interlocks.use(driver)
        self._type_watch.use(driver.mappings)
        self._log.forget_all()
        if before.stations.words() != driver.stations.words():
            self._publish_active()
        return True

    def _set_polling(self, request: SetBool.Request,
                     response: SetBool.Response) -> SetBool.Response:
        """Leave the port to others, or take it again."""
        if request.data:
            self.driver.resume()
            self.link.take()
            response.success, response.message = True, f'{self.port} is being opened'
        else:
            self.begin_end()
            self.finish_end(time.monotonic() + END_LIMIT, 'the port is left')
            response.success = self.link.release()
            response.message = f'{self.port}: {self.link.state.text}'
        return response

    def _reset_counters(self, request: Trigger.Request,
                        response: Trigger.Response) -> Trigger.Response:
        self._diagnostics.reset_counters()
        response.success, response.message = True, 'all counters begin again at 0'
        return response


def main(args: Sequence[str] | None = None) -> int:
    """
    Run the node until SIGINT, SIGTERM or SIGHUP.

    Returns 0 after a signal, 2 when parameters or files are faulty, 1 after internal errors and
    where ROS does not start for a reason that may pass.
    """
    return run_ros(NODE_NAME, make_parser(_USAGE, _HELP), _make, args)


def _make(given: Sequence[str]) -> Program:
    node = BridgeNode()
    return Program(partial(_run, node), node.destroy_node)


def _run(node: BridgeNode, ended: EndRequest) -> int:
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        node.start()
        while not ended.is_set() and not node.link.has_failed:
            executor.spin_once(timeout_sec=0.1)
    finally:
        ended.set()
        try:
            _end(node, executor)
        finally:
            node.stop()
    return EXIT_FAULT if node.link.has_failed else 0


def _end(node: BridgeNode, executor: SingleThreadedExecutor) -> None:
    node.begin_end()
    node.finish_end(time.monotonic() + END_LIMIT)
    node.link.stop()
    take_last_writes(executor.spin_once, lambda: node.writes_taken,
                     time.monotonic() + LAST_WRITES)
    executor.shutdown()


def _few(names: Sequence[str]) -> str:
    """Return names as text, the first of them where there are many."""
    more = f' and {len(names) - _MOST_NAMES} more' if len(names) > _MOST_NAMES else ''
    return printable(', '.join(names[:_MOST_NAMES])) + more
