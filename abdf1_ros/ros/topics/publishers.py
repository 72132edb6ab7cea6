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
The publishers of a write topic: their number, their names, and how many of them are alive.

rclpy does not tell which publisher a message is from. So if a row has Single_Publisher, the driver
refuses all its messages while more than one publisher is alive (rule 28 of docs/heartbeats.md).
An executor of rclpy handles the events of subscriptions before their messages, so a publisher is
counted before its first message.

Fast DDS watches the lease that a subscription asks for, not the lease that a publisher offers. But
a subscription with a lease gets no message of a publisher without one. So if a publisher offers a
lease, a second subscription asks for it, and takes no message. This subscription is not made
before: rclpy warns each publisher without a lease that it does not reach such a subscription.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol

from abdf1_ros.driver.kernel.own import Crowd
from abdf1_ros.ports.clock import line_time
from abdf1_ros.ros.diagnostics.graph import node_of, UNKNOWN_NODE
from abdf1_ros.ros.topics.messages import lease_qos, write_qos
from abdf1_ros.settings.heartbeats import LONGEST_LEASE
from abdf1_ros.text import first
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.waitable import Waitable


class Matched(Protocol):
    """The event that a publisher has been connected or has gone."""

    total_count: int
    current_count: int


class LivelinessChanged(Protocol):
    """The event that a publisher has kept its lease no more, keeps it again, or has gone."""

    not_alive_count: int


class LivingPublishers:
    """
    The publishers of a topic that are alive, by the events of two subscriptions.

    For the thread of the executor.

    - ``connected``: returns how many publishers the subscription for messages has now
    - ``names``: returns the names of their nodes
    - ``tell``: is called with each new crowd
    - ``alive``: number of living publishers
    - ``crowd``: the crowd, None while at most one is alive
    """

    def __init__(self, connected: Callable[[], int], names: Callable[[], list[str]],
                 tell: Callable[[Crowd], None]) -> None:
        self.alive = 0
        self.crowd: Crowd | None = None
        self._connected, self._names, self._tell = connected, names, tell
        self._matched = self._ever_matched = self._dead = 0

    def matched(self, event: Matched) -> None:
        """
        Record publishers that have come or gone.

        If some have come and others have gone since the last event, their order is unknown. They
        count as a crowd, because a message of each may wait.
        """
        came = event.total_count - self._ever_matched
        self._ever_matched, self._matched = event.total_count, event.current_count
        self._judge(self.alive + came)

    def liveliness_changed(self, event: LivelinessChanged) -> None:
        """Record publishers that do not keep their lease, or keep it again."""
        self._dead = event.not_alive_count
        # If DDS drops a dead publisher, it is neither dead nor connected any more. The event
        # ``matched`` of that publisher may come later.
        self._matched = min(self._matched, self._connected())
        self._judge(self.alive)

    def end(self) -> None:
        """Record that the subscriptions end."""
        self._matched = self._dead = 0
        self._judge(0)

    def ask_names_again(self) -> None:
        """Tell a crowd again if a name was unknown."""
        if self.crowd is not None and UNKNOWN_NODE in self.crowd.why:
            self._judge(self.alive)

    @property
    def why_no_call(self) -> str:
        """Return why a call that writes is refused, empty if it is not."""
        return f'the topic has a publisher: {self._name_text()}' if self.alive else ''

    def _judge(self, most: int) -> None:
        """Tell a crowd that is there, has ended, or was there since the last event."""
        self.alive = max(0, self._matched - self._dead)
        before, self.crowd = self.crowd, None
        if self.alive > 1:
            self.crowd = Crowd(f'more than one publisher: {self._name_text()}')
            self._tell(self.crowd)
        elif before is not None:
            self._tell(Crowd(before.why, line_time()))
        elif most > 1:
            self._tell(Crowd(f'more than one publisher for a moment: {self._name_text()}',
                             line_time()))

    def _name_text(self) -> str:
        try:
            return first(self._names())
        except Exception:  # DDS may report a name that rclpy cannot read
            return UNKNOWN_NODE


class _EventsOnly(ReentrantCallbackGroup):
    """Lets an executor handle the events of a subscription, but not its messages."""

    def can_execute(self, entity: object) -> bool:
        """Tell whether the executor may handle this."""
        return isinstance(entity, Waitable)


class PublisherWatch:
    """
    The subscription of a topic, and if a publisher offers a lease, one that asks for it.

    ``living`` counts the living publishers. A publisher that DDS drops has to disappear from the
    subscription for messages first, which is the case because this is made first.
    """

    def __init__(self, node: Node, kind: type, topic: str, callback: Callable[..., None],
                 tell: Callable[[Crowd], None]) -> None:
        self._node, self._kind, self._topic = node, kind, topic
        self.living = LivingPublishers(
            self._connected, partial(publisher_names, node, topic), tell)
        self._leases: Subscription | None = None
        self._messages: Subscription = node.create_subscription(
            kind, full_name(topic), callback, write_qos(),
            event_callbacks=SubscriptionEventCallbacks(matched=self._matched))

    def _connected(self) -> int:
        return self._messages.get_publisher_count()

    def _matched(self, event: Matched) -> None:
        self.living.matched(event)
        if self._leases is None and any(
                0 < end.qos_profile.liveliness_lease_duration.nanoseconds <= LONGEST_LEASE * 1e9
                for end in _publishers(self._node, self._topic)):
            self._leases = self._node.create_subscription(
                self._kind, full_name(self._topic), lambda message: None, lease_qos(),
                callback_group=_EventsOnly(), event_callbacks=SubscriptionEventCallbacks(
                    liveliness=self.living.liveliness_changed, use_default_callbacks=False))

    def end(self) -> None:
        """End all subscriptions."""
        for subscription in filter(None, (self._messages, self._leases)):
            self._node.destroy_subscription(subscription)
        self.living.end()


def full_name(topic: str) -> str:
    """Return the name of a write topic, before remaps."""
    return f'~/write/{topic}'


def count_publishers(node: Node, topic: str) -> int:
    """Return how many publishers a write topic has; its name is remapped here, not by rclpy."""
    return node.count_publishers(node.resolve_topic_name(full_name(topic)))


def publisher_names(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that publish on a write topic, in their order."""
    return sorted(map(node_of, _publishers(node, topic)))


def _publishers(node: Node, topic: str) -> list[TopicEndpointInfo]:
    return node.get_publishers_info_by_topic(full_name(topic))
