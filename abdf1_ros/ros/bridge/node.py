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
The ROS node of a bridge: its link, the session of a pair of files, services, start and end.

The link's thread starts after the first session is made, and ends before the node is destroyed.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
import time
from typing import Unpack

from abdf1_ros.driver.driver import ENDS
from abdf1_ros.driver.kernel.waiting import MAX_WAITING_WRITES
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ports.link_thread import LinkThread
from abdf1_ros.ports.port_thread import PortState
from abdf1_ros.ports.settings import Lack, PortSettings
from abdf1_ros.ports.trace import PortOpener
from abdf1_ros.problems import ConfigurationError
from abdf1_ros.ros.bridge.last_writes import LAST_WRITES, take_last_writes
from abdf1_ros.ros.bridge.offer import OfferedPublisher
from abdf1_ros.ros.bridge.port_owners import PortOwners
from abdf1_ros.ros.bridge.reload import changes, refuse_harm, rows_left_behind
from abdf1_ros.ros.bridge.session import BridgeSession, Surroundings, tell_plcs
from abdf1_ros.ros.bridge.standby import Service, Standby
from abdf1_ros.ros.callbacks import AnsweringNode, NodeOptions
from abdf1_ros.ros.diagnostics.graph import Graph
from abdf1_ros.ros.diagnostics.log import bug_text, ERROR
from abdf1_ros.ros.parameters.arguments import Arguments
from abdf1_ros.ros.parameters.declared import (
    Configuration,
    configure,
    NO_ARGUMENTS,
    NODE_NAME,
    read_again,
)
from abdf1_ros.ros.parameters.shown import ShownFiles
from abdf1_ros.ros.topic_names import TopicNames
from abdf1_ros.ros.topics.messages import latched_qos, results_qos
from abdf1_ros.ros.topics.writes import WriteTopics
from abdf1_ros.settings.heartbeats import HAND_OVER, LONGEST_END
from abdf1_ros.settings.network import Network
from abdf1_ros.text import printable
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.duration import Duration
from rclpy.validate_node_name import validate_node_name
from std_msgs.msg import UInt16MultiArray
from std_srvs.srv import SetBool, Trigger

# Limits of the shutdown (s). The first two count from its start: the end of the look for last
# writes, and the latest begin of a node's last diagnostics. The third is the longest wait for a
# stuck subscriber.
_LATEST_WRITES = LONGEST_END + 1.0
_LATEST_DIAGNOSTICS = LONGEST_END + 2.0
_LONGEST_PUBLISH = 0.5

_MOST_PROBLEMS = 20  # most faults in the answer of ~/reload


class BridgeNode(AnsweringNode):
    """
    The bridge; raises ConfigurationError if it cannot run with its parameters or files.

    One thread calls ``check`` every 0.1 s. All lines of a process share ``graph`` and
    ``port_owners``. ``arguments``: the arguments of the process.
    """

    def __init__(self, name: str = NODE_NAME, *, graph: Graph | None = None,
                 port_owners: PortOwners | None = None,
                 arguments: Arguments = NO_ARGUMENTS, **options: Unpack[NodeOptions]) -> None:
        validate_node_name(name)  # if rclpy refuses the name, it also warns about its own cleanup
        options['automatically_declare_parameters_from_overrides'] = True
        super().__init__(name, **options)
        self._is_stuck = False
        self._hold_ports = partial(
            (port_owners or PortOwners()).hold, self.get_fully_qualified_name())
        try:
            configuration = configure(self, arguments)
            names = TopicNames.of(self.resolve_topic_name, configuration.mappings)
            our_name = self.get_fully_qualified_name()
            for text in names.idle(our_name, arguments.remapped_for(our_name)):
                self.get_logger().warning(text)
            self._shown = ShownFiles(self)
            self._shown.show(configuration.network, configuration.shown_rows())
            self._hold_ports(*configuration.held)
            self._set_up(configuration, graph or Graph(self))
        except Exception:  # the process may go on with other lines
            self.destroy_node()
            raise

    def destroy_node(self) -> None:
        self._hold_ports()
        super().destroy_node()

    def _set_up(self, configuration: Configuration, graph: Graph) -> None:
        self._opener = PortOpener(_port_settings(configuration), self._port_lacks)
        self.writes = WriteTopics(self)
        names = graph.name_watch(self, is_spare=configuration.parameters.standby)
        self.surroundings = Surroundings(
            self, graph, names, self._opener,
            OfferedPublisher(self, DiagnosticStatus, '~/write_results', results_qos(),
                             most=MAX_WAITING_WRITES),
            OfferedPublisher(self, UInt16MultiArray, '~/active_stations', latched_qos(), most=1),
            self.create_publisher(DiagnosticArray, '/diagnostics', 10),
            OfferedPublisher(self, DiagnosticArray, '~/snapshot', 1, most=1), self.writes)
        self.standby = Standby(self.surroundings, lambda: self.session, (
            Service('~/reset_counters', Trigger, self._reset_counters),
            Service('~/reload', Trigger, self._reload),
            Service('~/polling', SetBool, self.set_polling, stays=True),
            Service('~/read_link_counters', Trigger, self._read_link_counters,
                    MutuallyExclusiveCallbackGroup())))
        if configuration.parameters.standby:
            self.get_logger().info('waits for the line; offers no topics and services until then')
        else:
            self.standby.offer()
        self.session = BridgeSession(self.surroundings, configuration)
        self.writes.give_to(self.session.writers)
        self.link = self.surroundings.link = LinkThread(
            self.session.driver.machine, self._opener.open,
            on_state=self._port_changed, on_fault=self._fault,
            while_sending=self.session.reads.publish_later_values)
        self.session.diagnostics.line.attach(self.link, self._opener)
        self.session.begin()

    @property
    def has_failed(self) -> bool:
        """Return True if the link is broken, so that the node has to end."""
        return self._is_stuck or self.link.has_failed

    def start(self) -> None:
        """Open the port and begin to read."""
        parameters = self.session.configuration.parameters
        if parameters.trace_file:
            self._opener.trace(
                parameters.trace_file, parameters.trace_limit * 1e6,
                _head(self.session.configuration.network),
                lambda text: self.get_logger().error(f'trace_file: {printable(text)}'),
                lambda text: self.session.events.notes.info('trace_file', f'trace_file: {text}'))
        # First, because ~/reload starts guests, too, as soon as the link runs.
        if self.surroundings.is_offered:
            self.session.guests.start()
        self.link.start()

    def begin_end(self) -> None:
        """
        Begin the end of the bridge and its session; no request can cancel it.

        If ~/reload puts in a new session meanwhile, the new session has to end as well.
        """
        told: BridgeSession | None = None
        while told is not self.session:  # first, so that messages that have waited are refused
            told = self.session
            told.begin_end(is_final=True)
        self.writes.begin()

    def end_calls(self) -> None:
        """Answer all waiting calls: the link has ended."""
        self.surroundings.services.end()
        self.session.link_counters.end()

    def publish_last_diagnostics(self, give_up: float) -> None:
        """Disconnect guests, publish the last state, wait for acks until a monotonic time."""
        self.session.guests.stop()
        self._opener.close()
        self.session.status_publisher.publish(
            line_time(), is_waiting=self.session.is_waiting)
        # DDS would lose messages that are still under way when their publisher ends.
        self.surroundings.results.wait_for_all_acked(max(0.0, give_up - time.monotonic()))
        self.surroundings.diagnostics.wait_for_all_acked(
            Duration(seconds=max(0.0, give_up - time.monotonic())))

    def check(self) -> None:
        """Publish what is due; take writes after the first look for a node of our name."""
        self.session.check()
        if self.session.configuration.parameters.standby and not self.session.is_ending:
            self.standby.look()
        if self.surroundings.names.has_looked:
            self.writes.begin()

    def _port_changed(self, state: PortState) -> None:
        self.session.port_changed(state)

    def _port_lacks(self, lack: Lack) -> None:
        """Log an option that the port does not have; rs485 has to be asked for."""
        text = f'{printable(self.session.port)}: {lack.text}'
        if lack.option == 'rs485':
            self.surroundings.log.notes.warning('rs485', text)
        else:
            self.get_logger().debug(text)

    def _fault(self, error: Exception) -> None:
        self.get_logger().error(f'internal error: {bug_text(error)}')

    def _reload(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Read both files again and use them; if they have faults, go on with the old files."""
        if self.session.is_ending:
            response.message = ENDS
            return response
        before = self.session.configuration
        try:
            configuration = read_again(before)
            TopicNames.of(self.resolve_topic_name, configuration.mappings)
            self._hold_ports(*before.held, *configuration.held)
            refuse_harm(before, configuration, self.link.state.is_open,
                        _port_settings(configuration))
        except ConfigurationError as error:
            self._hold_ports(*before.held)
            self.surroundings.log.tell_files(
                [(ERROR, f'{problem} (goes on as before)') for problem in error.problems])
            texts = [printable(str(problem)) for problem in error.problems]
            response.message = 'goes on as before: ' + '; '.join(texts[:_MOST_PROBLEMS])
            return response
        if self.hand_over(configuration):
            response.success = True
            response.message = f'{printable(str(configuration))}; {changes(before, configuration)}'
        elif self.session.is_ending:  # the end has begun meanwhile
            response.message = ENDS
        else:
            response.message = 'ends: the link does not accept the new files'
            self.get_logger().fatal(response.message)
            self._is_stuck = True
        return response

    def hand_over(self, configuration: Configuration) -> bool:
        """
        Hand the line over to new files; return False if the link does not accept them, or ends.

        If the new session cannot be made, the old one goes on, after the port was opened again.

        The order matters:
        1. Inform the PLCs: to a PLC, new files are an end and a start.
        2. Make the new session while the old session has the line: topics of unchanged rows stay.
        3. Put the machine of the new session on the line, with what the old driver knows, end
           the old session, begin the new one.
        4. Let guests connect, and give up the old port.
        """
        before = self.session
        left_behind = rows_left_behind(before.configuration, configuration)
        tell_plcs([before], 'goes on with new files', HAND_OVER,
                  is_meant=left_behind.__contains__)
        if before.is_ending:  # the end has begun meanwhile
            return False
        try:
            session = BridgeSession(self.surroundings, configuration)
        except Exception:
            self._hold_ports(*before.configuration.held)
            if not self.link.is_released:  # after the end that the PLCs know, a start
                for wanted in (False, True):
                    self.set_polling(SetBool.Request(data=wanted), SetBool.Response())
            before.go_on()
            raise
        session.diagnostics.line.attach(self.link, self._opener)
        self.session = session  # from now on, ``check`` judges its statuses
        self.writes.give_to(session.writers)
        is_done = self.link.exchange(
            session.driver.machine, session.reads.publish_later_values,
            self._opener.use(_port_settings(configuration), _head(configuration.network)),
            take_over=partial(session.driver.take_over, before.driver))
        before.end()
        if not is_done:
            return False
        self.session.begin()
        self.session.guests.start()
        self._shown.show(configuration.network, configuration.shown_rows())
        self._hold_ports(*configuration.held)
        return True

    def set_polling(self, request: SetBool.Request,
                    response: SetBool.Response) -> SetBool.Response:
        """Release the port for other programs, or take it back."""
        if self.session.is_ending:
            response.message = ENDS
        elif request.data:
            self.session.driver.kernel.end.resume()
            self.link.take()
            response.success, response.message = True, f'{self.session.port} is being opened'
        else:
            told = tell_plcs([self.session], 'the port is closed', HAND_OVER)
            response.success = self.link.release()
            response.message = '; '.join(
                (f'{self.session.port}: {self.link.state.text}', *told))
        return response

    def _reset_counters(self, request: Trigger.Request,
                        response: Trigger.Response) -> Trigger.Response:
        self.session.diagnostics.counters.reset()
        response.success, response.message = True, 'all counters begin again at 0'
        return response

    async def _read_link_counters(self, request: Trigger.Request,
                                  response: Trigger.Response) -> Trigger.Response:
        return await self.session.link_counters.answer(request, response)


def _port_settings(configuration: Configuration) -> PortSettings:
    parameters = configuration.parameters
    return PortSettings.of(
        configuration.network, configuration.port, low_latency=parameters.low_latency,
        rs485=parameters.rs485)


def _head(network: Network) -> dict[str, str]:
    """Return the settings for the head of a capture; sniff finds out missing settings."""
    return {'check': network.checksum.value,
            'duplex': 'auto' if network.line_mode.only_listens else network.duplex.name.lower()}


def end_together(nodes: Sequence[BridgeNode], patience: float = _LONGEST_PUBLISH) -> None:
    """
    End all nodes together: PLCs, links, results of pending writes, last diagnostics.

    Callbacks may still run: a message that they take now is not sent, and its result says so. If a
    node fails here, all other nodes still end. The end takes at most 8 s, plus ``patience`` s if a
    subscriber is stuck.
    """
    begun = time.monotonic()
    for node in nodes:
        node.begin_end()
    tell_plcs([node.session for node in nodes if node.link.is_alive()], 'ends', LONGEST_END,
              closes_lines=True)
    for node in nodes:
        node.link.stop()
        node.end_calls()
    take_last_writes(time.sleep, lambda: sum(node.writes.taken for node in nodes),
                     min(time.monotonic() + LAST_WRITES, begun + _LATEST_WRITES))
    give_up = time.monotonic() + patience
    for node in nodes:
        # a hundred nodes on a busy host take seconds
        if time.monotonic() >= begun + _LATEST_DIAGNOSTICS:
            break
        try:
            node.publish_last_diagnostics(give_up)
        except Exception as error:  # the node may be broken; go on with the other nodes
            node.get_logger().error(f'the end of this node has failed: {bug_text(error)}')
