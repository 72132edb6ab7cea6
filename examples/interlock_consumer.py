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
A robot cell that reads one interlock and decides "not permitted" unless it knows better.

Run it beside the bridge; it prints every change of its decision::

    python3 examples/interlock_consumer.py --topic /abdf1/read/cell_interlocks --bit 0
    ros2 service call /interlock_consumer/reset std_srvs/srv/Trigger

At the start, and whenever values have stopped, a person has to reset. It is not a safety function:
emergency stops and guards stay hard-wired or safety-rated.

Exit status: 0 after Ctrl-C or SIGTERM, 2 for bad arguments.
"""

from __future__ import annotations

import argparse
import math
import signal
import sys
import threading
from typing import Any

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from std_msgs.msg import UInt8MultiArray
from std_srvs.srv import Trigger


class InterlockConsumer(Node):
    """
    Permit motion only while a fresh value says so, and a person has reset since values stopped.

    ``patience`` (s) is what the cell can live without a value; it is at least the stale time that
    the bridge promises (``check`` prints it), or nothing is received at all.
    """

    def __init__(self, topic: str, bit: int, patience: float) -> None:
        super().__init__('interlock_consumer')
        self._bit = bit
        self._patience = patience
        self._text = ''
        self._is_fresh = False
        self._is_reset = False
        self.permitted = False
        time = Duration(seconds=patience)
        qos = QoSProfile(
            depth=1, reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL, deadline=time,
            liveliness=LivelinessPolicy.MANUAL_BY_TOPIC, liveliness_lease_duration=time)
        self._subscription = self.create_subscription(
            UInt8MultiArray, topic, self._received, qos,
            event_callbacks=SubscriptionEventCallbacks(
                deadline=lambda event: self._stopped(),
                liveliness=self._liveliness,
                incompatible_qos=self._incompatible))
        # DDS reports no missed deadline before the first value, so the start has a timer. The
        # node's own clock may be a simulation's, which need not run.
        self._start_timer = self.create_timer(
            patience, self._still_silent, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.create_service(Trigger, '~/reset', self._reset)
        self._decide(False, 'no value yet')

    def _received(self, message: UInt8MultiArray) -> None:
        self._start_timer.cancel()
        self._is_fresh = True
        if len(message.data) <= self._bit:
            self._decide(False, f'the message has no bit {self._bit}; is its Length right?')
        elif message.data[self._bit] != 1:
            self._decide(False, 'the PLC does not permit')
        elif not self._is_reset:
            self._decide(False, 'the PLC permits; waiting for a reset')
        else:
            self._decide(True, 'the PLC permits')

    def _liveliness(self, event: Any) -> None:
        if event.alive_count == 0:
            self._stopped()

    def _stopped(self) -> None:
        """Withdraw the permit until a person resets; both events come for the same silence."""
        self._is_fresh = self._is_reset = False
        self._decide(False, 'values have stopped')

    def _incompatible(self, event: Any) -> None:
        # Another publisher of the topic may be meant: that one is not heard, and changes nothing.
        if not self._is_fresh:
            self._decide(False, f'the bridge does not promise a value every {self._patience:g} s')

    def _still_silent(self) -> None:
        self._start_timer.cancel()
        if self._text == 'no value yet':
            self._decide(False, 'nothing heard since the start')

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Take the reset of a person, who sees the cell; it counts from the next value on."""
        response.success = self._is_reset = self._is_fresh
        response.message = '' if self._is_fresh else f'not reset: {self._text}'
        return response

    def _decide(self, permitted: bool, text: str) -> None:
        if (permitted, text) != (self.permitted, self._text):
            self.permitted, self._text = permitted, text
            print(f'{"PERMITTED" if permitted else "not permitted"}: {text}', flush=True)


def index(text: str) -> int:
    """Return an index; Python would take -1 for the last bit."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f'"{text}" should be a whole number from 0')
    return int(text)


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
    parser.add_argument('--bit', type=index, default=0, help='index in the array, from 0')
    parser.add_argument('--patience', type=seconds, default=2.0,
                        help='seconds without a value after which motion is not permitted')
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    # rclpy's own handlers take the ground from under a spin that is under way.
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = InterlockConsumer(options.topic, options.bit, options.patience)
    except InvalidTopicNameException as error:
        parser.error(' '.join(str(error).split()))
    while not ended.is_set():
        rclpy.spin_once(node, timeout_sec=0.1)
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
