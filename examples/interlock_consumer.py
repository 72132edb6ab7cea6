#!/usr/bin/env python3
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
A robot cell that permits motion only while interlock bits are fresh and 1.

Run it beside the bridge; it prints every change of its decision::

    python3 examples/interlock_consumer.py --topic /abdf1/read/cell_interlocks --bits 0,1,2
    ros2 service call /interlock_consumer/reset std_srvs/srv/Trigger

All bits have to be 1, and only one publisher may be alive. A person has to reset at the start, and
each time after values have stopped or a second publisher has come; with --latch also after a bit
was 0. This is not a safety function: emergency stops and guards stay hard-wired or safety-rated.

Exit status: 0 after Ctrl-C or SIGTERM, 2 for bad arguments.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
import math
import signal
import sys
from typing import Any

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from std_msgs.msg import UInt8MultiArray
from std_srvs.srv import Trigger


class InterlockConsumer(Node):
    """
    Permits motion only while values are fresh and 1, after a person has pressed reset.

    While two publishers are alive it permits nothing: a forgotten test or a recording that is
    played looks like the bridge. It counts by liveliness, because the ROS graph has a killed node
    for 20 s more.

    - ``bits``: indexes in the array; all these bits have to be 1
    - ``latches``: a person has to reset also after a bit was 0
    - ``address``: address in the PLC that the topic has to come from; empty: any
    - ``patience``: longest time (s) that the cell accepts without a value. It has to be at least
      the stale time that ``check`` prints; otherwise DDS delivers no value at all.
    """

    def __init__(self, topic: str, bits: Sequence[int], patience: float, *, latches: bool = False,
                 address: str = '') -> None:
        super().__init__('interlock_consumer')
        self._bits = bits
        self._latches = latches
        self._address = address
        self._patience = patience
        self._text = ''
        self._is_fresh = False
        self._is_reset = False
        self._alive = 0  # number of living publishers
        self._why_not = 'no value yet'  # why the PLC does not permit motion; empty if it does
        self.permitted = False
        time = Duration(seconds=patience)
        qos = QoSProfile(
            depth=1, reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL, deadline=time,
            liveliness=LivelinessPolicy.MANUAL_BY_TOPIC, liveliness_lease_duration=time)
        self._has_events = True
        try:
            self._subscribe(topic, qos, SubscriptionEventCallbacks(
                deadline=lambda event: self._stopped(), incompatible_qos=self._incompatible,
                liveliness=lambda event: self.publishers_changed(event.alive_count)))
        except UnsupportedEventTypeError:  # rmw_zenoh lacks these events
            self._has_events = False
            self._subscribe(topic, qos, SubscriptionEventCallbacks())
        # DDS reports no missed deadline before the first value, and some RMWs never report one.
        # The node's own clock may be simulated and stop, so the timer uses a steady clock.
        self._silence = self.create_timer(
            patience, self._silent, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.create_service(Trigger, '~/reset', self.reset)
        self._decide(False, self._why_not)

    def _subscribe(self, topic: str, qos: QoSProfile, events: SubscriptionEventCallbacks) -> None:
        self._subscription = self.create_subscription(
            UInt8MultiArray, topic, self.receive, qos, event_callbacks=events)

    def receive(self, message: UInt8MultiArray) -> None:
        if not self._has_events:
            self.publishers_changed(max(1, self._subscription.get_publisher_count()))
        self._silence.reset()
        self._is_fresh = True
        self._why_not = self._crowd() or self._missing_in(message)
        if self._why_not:
            self._is_reset = self._is_reset and not self._latches
            self._decide(False, self._why_not)
        elif not self._is_reset:
            self._decide(False, 'the PLC permits; waiting for a reset')
        else:
            self._decide(True, 'the PLC permits')

    def _missing_in(self, message: UInt8MultiArray) -> str:
        """Return why a message does not permit motion; empty if it does."""
        address = message.layout.dim[0].label if message.layout.dim else ''
        if self._address and address != self._address:
            return f'the topic comes from {address or "nowhere"}, not from {self._address}'
        for bit in self._bits:
            if bit >= len(message.data):
                return f'the message has no bit {bit}; is its Length right?'
            if message.data[bit] != 1:
                return f'bit {bit} is 0'
        return ''

    def publishers_changed(self, alive: int) -> None:
        """Withdraw the permit until a person resets: the publisher has died, or is not alone."""
        has_come, self._alive = alive > self._alive, alive
        if alive <= 0:  # -1 if another subscriber of this process came before (Fast DDS)
            self._stopped()
        elif has_come and (self._is_reset or self._crowd()):
            self._is_reset = False
            self._why_not = self._crowd() or 'another publisher has come'
            self._decide(False, self._why_not)

    def _crowd(self) -> str:
        return f'the topic has {self._alive} publishers' if self._alive > 1 else ''

    def _stopped(self) -> None:
        """Withdraw the permit until a person resets; may be called twice for one silence."""
        self._is_fresh = self._is_reset = False
        self._decide(False, 'values have stopped')

    def _incompatible(self, event: Any) -> None:
        # The event may be about a second publisher; it does not change a fresh value.
        if not self._is_fresh:
            self._decide(False, f'the bridge does not promise a value every {self._patience:g} s')

    def _silent(self) -> None:
        self._silence.cancel()  # until the next value
        if self._text == 'no value yet':
            self._decide(False, f'nothing heard since the start{self._why_nothing()}')
        elif self._is_fresh:
            self._stopped()

    def _why_nothing(self) -> str:
        """Return what the publishers of the topic show of the reason, empty if nothing."""
        topic = self._subscription.topic_name
        types = {found.topic_type for found in self.get_publishers_info_by_topic(topic)}
        if not types:
            return f': no node publishes {topic}'
        wrong = types - {'std_msgs/msg/UInt8MultiArray'}
        return f': {topic} has no bits, but {", ".join(sorted(wrong))}' if wrong else ''

    def reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """
        Accept the reset of a person who sees the cell; it holds from the next value on.

        It is refused until all bits are 1: otherwise the cell would start later by itself.
        """
        response.success = self._is_reset = self._is_fresh and not self._why_not
        response.message = '' if response.success else f'not reset: {self._text}'
        return response

    def _decide(self, permitted: bool, text: str) -> None:
        if (permitted, text) != (self.permitted, self._text):
            self.permitted, self._text = permitted, text
            print(f'{"PERMITTED" if permitted else "not permitted"}: {text}', flush=True)


def indexes(text: str) -> list[int]:
    """Return the indexes in a text; -1 is refused, as Python would use the last bit."""
    if not all(part.isdecimal() for part in text.split(',')):
        raise argparse.ArgumentTypeError(f'"{text}" should be whole numbers from 0, as in 0,1,2')
    return [int(part) for part in text.split(',')]


def seconds(text: str) -> float:
    """Return a time above 0 s."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise argparse.ArgumentTypeError(f'"{text}" should be a number of seconds above 0')
    return value


def main() -> int:
    """Run until Ctrl-C or SIGTERM."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--topic', default='/abdf1/read/cell_interlocks')
    parser.add_argument('--bits', type=indexes, default=[0],
                        help='indexes in the array, from 0, as in 0,1,2')
    parser.add_argument('--address', default='',
                        help='address that the topic has to come from, as in B3:0/0')
    parser.add_argument('--latch', action='store_true',
                        help='a person has to reset also after a bit was 0')
    parser.add_argument('--patience', type=seconds, default=2.0,
                        help='seconds without a value after which motion is not permitted')
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    # rclpy's own handlers would destroy the context while we spin.
    ended: list[int] = []  # not a threading.Event: a second signal during its set() may deadlock
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: ended.append(number))
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = InterlockConsumer(options.topic, options.bits, options.patience,
                                 latches=options.latch, address=options.address)
    except InvalidTopicNameException as error:
        parser.error(' '.join(str(error).split()))
    while not ended:
        rclpy.spin_once(node, timeout_sec=0.1)
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
