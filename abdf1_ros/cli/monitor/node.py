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

"""The node of the monitor, which subscribes to all topics of a bridge."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import time

from abdf1_ros.cli.monitor.curves import Curve
from abdf1_ros.cli.monitor.view import NodeView, ShownStatus, silence, Style, TopicRow
from abdf1_ros.errors import FormatError
from abdf1_ros.ros.observer import graph_hint, ObservingNode
from abdf1_ros.ros.topics.messages import latched_qos, MESSAGES
from abdf1_ros.ros.untyped import MessageInfo, RosMessage
from abdf1_ros.text import by_number
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.duration import Duration, Infinite
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import InvalidTopicNameException
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.validate_full_topic_name import validate_full_topic_name
from std_msgs.msg import String, UInt16MultiArray  # noqa: I101

# Period (s) of looking for topics of the node; they do not change while it lives.
_DISCOVERY_PERIOD = 0.5

_RESULTS_KEPT = 8

_TYPES = {f'std_msgs/msg/{message.__name__}': message for message in MESSAGES.values()}

_TEXT, _BITS = 'std_msgs/msg/String', 'std_msgs/msg/UInt8MultiArray'

_STYLES = {DiagnosticStatus.OK: Style.GOOD, DiagnosticStatus.WARN: Style.WARNING}

# With default callbacks, every subscription costs time on every turn of the executor.
_QUIET = SubscriptionEventCallbacks(use_default_callbacks=False)


def full_name(text: str) -> str:
    """Return the fully qualified name of a node; raises FormatError for a bad name."""
    name = f'/{text.strip("/")}'
    try:
        validate_full_topic_name(name)
    except InvalidTopicNameException as error:
        reason = str(error).splitlines()[0].removeprefix('Invalid topic name: ').rstrip(':')
        raise FormatError(f'node name "{text}": {reason}; it should be like /abdf1 '
                          'or /cell/abdf1') from None
    return name


@dataclass(slots=True)
class _Subscription:
    type_name: str
    handle: Subscription
    reading: TopicRow


class Listening(ObservingNode):
    """A node that subscribes, in a ROS context of its own; use it in a with statement."""

    def __init__(self, ros_arguments: list[str]) -> None:
        super().__init__('abdf1_monitor', args=ros_arguments, is_quiet=True)

    def subscribe(self, message_type: type, topic: str, callback: Callable[..., None],
                  qos: QoSProfile | int) -> Subscription:
        """Call ``callback`` with each message."""
        return self.node.create_subscription(
            message_type, topic, callback, qos, event_callbacks=_QUIET)

    def bridges(self) -> list[str]:
        """Return the full names of the visible bridges."""
        ending = '/active_stations'
        return sorted((topic.removesuffix(ending)
                       for topic, types in self.node.get_topic_names_and_types()
                       if topic.endswith(ending) and self.node.count_publishers(topic)),
                      key=by_number)


class NodeWatch(Listening):
    """
    Listen to the node with the full name ``name``, until closed.

    The bridge is not affected: subscriptions request only the QoS that every bridge offers, no
    service is called, and no message is published. Ages of topics without a promised time count
    from the publisher's time stamp. For these topics the clocks of the hosts must agree.

    ``stopped``: why its line does not run, as the process of many lines says; empty if unknown.
    """

    def __init__(self, name: str, ros_arguments: list[str]) -> None:
        super().__init__(ros_arguments)
        self.name = name
        self._subscriptions: dict[str, _Subscription] = {}
        self._statuses: list[ShownStatus] = []
        self._told: float | None = None
        self.stopped = ''
        self._active: list[int] | None = None
        self._results: deque[ShownStatus] = deque(maxlen=_RESULTS_KEPT)
        self._next_discovery = 0.0
        self.is_there = False
        self.subscribe(DiagnosticArray, '/diagnostics', self._take_diagnostics, 100)
        self.subscribe(DiagnosticStatus, f'{name}/write_results', self._take_result, 100)
        active = f'{name}/active_stations'
        self.subscribe(UInt16MultiArray, active, self._take_active, latched_qos())

    @property
    def is_complete(self) -> bool:
        """Return True if diagnostics, all topics and all promised values have arrived."""
        totals = [status.values.get('total', '') for status in self._statuses
                  if status.section == 'mappings']
        if not totals or not totals[0].isdecimal():
            return False
        return len(self._subscriptions) >= int(totals[0]) and all(
            subscription.reading.values is not None or subscription.reading.promised is None
            for subscription in self._subscriptions.values())

    def spin_once(self, seconds: float) -> None:
        """Take one message, or wait for ``seconds``; look for topics when it is time."""
        if time.monotonic() >= self._next_discovery:
            self._next_discovery = time.monotonic() + _DISCOVERY_PERIOD
            self._discover()
        super().spin_once(seconds)

    def snapshot(self) -> NodeView:
        """Return a snapshot of the present state."""
        readings = [self._subscriptions[topic].reading
                    for topic in sorted(self._subscriptions, key=by_number)]
        return NodeView(
            self.name, self.is_there, self._told, tuple(self._statuses), readings,
            self._active, tuple(self._results), graph_hint(), self.stopped)

    def _discover(self) -> None:
        """Subscribe to the read topics that the node publishes now."""
        topics = self.published(self.name)
        self.is_there = topics is not None
        if topics is None:
            return
        nodes = [_path(*node) for node in self.node.get_node_names_and_namespaces()]
        if nodes.count(self.name) > 1:  # with a spare, ``topics`` may be of the spare
            others = tuple(f'{name}/' for name in self.bridges() if name != self.name)
            topics = [(topic, types) for topic, types in self.node.get_topic_names_and_types()
                      if not topic.startswith(others)]
        reads = {topic: (types[0], endpoints) for topic, types in topics
                 if topic != f'{self.name}/active_stations' and types[0] in _TYPES
                 and (endpoints := self._endpoints(topic))}
        for topic, known in list(self._subscriptions.items()):
            if topic not in reads or reads[topic][0] != known.type_name:
                self.node.destroy_subscription(known.handle)  # the node has another map now
                del self._subscriptions[topic]
        for topic, (type_name, endpoints) in reads.items():
            self._listen(topic, type_name, endpoints[0].qos_profile.deadline)

    def _endpoints(self, topic: str) -> list[TopicEndpointInfo]:
        """Return what the node, or a spare of its name, publishes a topic with."""
        return [endpoint for endpoint in self.node.get_publishers_info_by_topic(topic)
                if _path(endpoint.node_name, endpoint.node_namespace) == self.name]

    def _listen(self, topic: str, type_name: str, deadline: Duration) -> None:
        known = self._subscriptions.get(topic)
        if known is None:
            handle = self.subscribe(_TYPES[type_name], topic, self._taker(topic), latched_qos())
            curve = None if type_name == _TEXT else Curve(is_bits=type_name == _BITS)
            known = _Subscription(
                type_name, handle, TopicRow(topic.removeprefix(f'{self.name}/read/'), curve=curve))
            self._subscriptions[topic] = known
        promised = None if deadline == Infinite else float(deadline.nanoseconds) / 1e9
        known.reading = replace(known.reading, promised=promised)

    def _taker(self, topic: str) -> Callable[[RosMessage, MessageInfo], None]:
        def take(message: RosMessage, info: MessageInfo) -> None:
            subscription = self._subscriptions[topic]
            reading, received = subscription.reading, time.monotonic()
            if reading.promised is None and info['source_timestamp']:
                received -= max(0.0, (time.time_ns() - info['source_timestamp']) / 1e9)
            address = ''
            if not isinstance(message, String) and message.layout.dim:
                address = message.layout.dim[0].label
            if reading.curve:
                reading.curve.take(message.data, received)
            subscription.reading = replace(
                reading, values=message.data, address=address, received=received)
        return take

    def _take_diagnostics(self, message: DiagnosticArray) -> None:
        statuses, now = shown_statuses(message, self.name.lstrip('/')), time.monotonic()
        self.stopped = '' if statuses else stopped_lines(message).get(self.name, self.stopped)
        is_owner_heard = self._told is not None and not is_spare(self._statuses) \
            and now - self._told <= silence(self._statuses)
        if statuses and not (is_spare(statuses) and is_owner_heard):
            self._statuses, self._told = statuses, now

    def _take_result(self, status: DiagnosticStatus) -> None:
        self._results.appendleft(
            replace(shown_status(status, self.name), received=time.monotonic()))

    def _take_active(self, message: UInt16MultiArray) -> None:
        self._active = [16 * word + bit for word, bits in enumerate(message.data)
                        for bit in range(16) if bits >> bit & 1]


def _path(name: str, namespace: str) -> str:
    return f'{namespace.rstrip("/")}/{name}'


def shown_statuses(message: DiagnosticArray, node: str) -> list[ShownStatus]:
    """Return the statuses of a node for the picture, not of other nodes."""
    return [shown_status(status, node) for status in message.status
            if status.name.startswith(f'{node}: ')]


def stopped_lines(message: DiagnosticArray) -> dict[str, str]:
    """Return the lines that do not run, with the reason, as the process of many lines tells."""
    return {pair.key: f'does not run: {pair.value}' for status in message.status
            if status.name.endswith(': lines') for pair in status.values
            if pair.key.startswith('/')}


def is_spare(statuses: Sequence[ShownStatus]) -> bool:
    """Return True if the bridge of this status waits for its line."""
    return [status.section for status in statuses] == ['standby']


def shown_status(status: DiagnosticStatus, node: str) -> ShownStatus:
    """Return a status of a node for the picture."""
    return ShownStatus(status.name.removeprefix(f'{node}: '), _STYLES.get(status.level, Style.BAD),
                       status.message, {pair.key: pair.value for pair in status.values})
