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
Let the PLC do a job once, and know whether it has done it.

The handshake has three numbers, each an int16 word. ROS writes REQUEST, the number of the job. The
program of the PLC copies this number to BUSY when the job begins, and to DONE when it has
finished::

    EQU busy done  NEQ request done  GRT request 0   MOV request busy, begin the job
    (the job has finished)                           MOV busy done

Without numbers there is a race: a robot sets a bit "start" and waits for a bit "done". "Done" is
still set by the job before, so the robot goes on before this job has begun. A new number cannot be
confused with an old one. There is a second race at the end. The robot gives up a job that has not
begun in time, and the job begins later without a robot. So ROS takes the request back: it writes
0, and ~/write_results has to confirm this write. Only a state that was read after this
confirmation counts.

The map needs a Write row and a Read row with the tags ``job_request`` and ``job_state``. The Read
row has two words, busy and done. The request is published at a steady rate while the job runs. So
its row may have a Fallback of 0: then the PLC also learns when this program dies. With
``--control TAG`` a Read row of one bit shows whether the PLC uses the values from ROS (rung 7 of
the tutorial on heartbeats). While this bit is 0, the program neither requests a job nor waits for
one. With two living publishers of one of these topics it is unknown which of them is the bridge:
the program requests no job, and the end of a requested job is unknown. The bridge has to publish
these topics at least every ``--patience`` seconds.

Exit status: 0 done, 1 not done and not begun, 3 unknown.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from enum import Enum
import math
import signal
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
import rclpy
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from std_msgs.msg import Int16MultiArray, UInt8MultiArray

DONE, NOT_BEGUN, UNKNOWN = 0, 1, 3

_LAST_NUMBER = 32767
_CONFIRMED = 'written', 'stands in the PLC', 'fallback value written'
_PERIOD = 0.2  # s between two messages of a request; the first comes at once


class Step(Enum):
    """The progress of a job."""

    WAITING = 'the PLC has not begun'
    BUSY = 'the PLC is busy with it'
    DONE = 'done'


def next_number(busy: int, done: int) -> int:
    """Return a number that differs from the running job's and the last job's."""
    number = max(busy, done, 0) % _LAST_NUMBER + 1
    while number in (busy, done):
        number = number % _LAST_NUMBER + 1
    return number


def step_of(number: int, busy: int, done: int) -> Step:
    """Return the progress of job ``number``, from the PLC's words."""
    if done == number:
        return Step.DONE
    return Step.BUSY if busy == number else Step.WAITING


class Handshake(Node):
    """
    Requests jobs over the bridge ``bridge``.

    ``patience`` is the time (s) within which the bridge has to publish each topic again. A
    publisher that has not done so is not alive. ``has_requested`` tells that a job may begin.
    """

    def __init__(self, bridge: str, control: str = '', patience: float = 2.0) -> None:
        super().__init__('handshake')
        # A late subscriber gets the last value, unless it is older than the bridge's stale time.
        self._qos = QoSProfile(
            depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL,
            liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
            liveliness_lease_duration=Duration(seconds=patience))
        self.has_requested = False
        self._patience = patience
        self._crowd = ''  # which topic has had two living publishers
        self._state: tuple[int, int] | None = None
        self._states = 0  # number of received states
        self._heard = 0.0  # when the last one came
        self._result = 'no result has come'
        self._is_at_rest = False  # a 0 has been confirmed
        self.create_subscription(
            DiagnosticStatus, f'{bridge}/write_results', self._take_result, 100)
        self._listen(Int16MultiArray, f'{bridge}/read/job_state', self._take)
        self._is_in_control = not control
        if control:
            self._listen(UInt8MultiArray, f'{bridge}/read/{control}', self._take_control)
        self._requests = self.create_publisher(Int16MultiArray, f'{bridge}/write/job_request', 1)

    def _listen(self, kind: type, topic: str, callback: Callable[..., None]) -> None:
        """Subscribe to a read topic, and count its living publishers."""
        def count(alive: int) -> None:
            if alive > 1:
                self._crowd = f'{topic} has {alive} publishers'

        def take(message: Any) -> None:
            count(subscription.get_publisher_count())
            callback(message)

        try:
            self.create_subscription(
                kind, topic, callback, self._qos, event_callbacks=SubscriptionEventCallbacks(
                    liveliness=lambda event: count(event.alive_count)))
        except UnsupportedEventTypeError:  # rmw_zenoh lacks this event
            subscription = self.create_subscription(kind, topic, take, self._qos)

    def run(self, begin_within: float, done_within: float) -> int:
        """Let one job be done (times in s); return the exit status."""
        if not self._spin(lambda: self._state is not None
                          and self._requests.get_subscription_count() > 0, begin_within):
            print('not begun: no job_state from the PLC within --patience, or no bridge takes '
                  'job_request')
            return NOT_BEGUN
        assert self._state is not None
        # Within this time each living publisher publishes again.
        if self._spin(lambda: bool(self._crowd), self._patience):
            print(f'not begun: {self._crowd}')
            return NOT_BEGUN
        if not self._spin(lambda: self._is_in_control, begin_within):
            print('not begun: ROS is not in control of the PLC. If /diagnostics says that the '
                  'heartbeat counts, a person has to press reset there; otherwise it says why not')
            return NOT_BEGUN
        if self._state[0] != self._state[1]:
            print(f'not begun: the PLC is busy with job {self._state[0]}')
            return NOT_BEGUN
        number = next_number(*self._state)
        self.has_requested = True
        print(f'job {number} requested', flush=True)
        step = self._request(number, begin_within, lambda step: step is not Step.WAITING)
        if step is Step.WAITING and not self._crowd:
            print(f'job {number}: {step.value}; request: {self._result}', flush=True)
            if not self._take_back(begin_within):
                print(f'job {number}: unknown whether it begins: the request is not taken back')
                return UNKNOWN
            step = step_of(number, *self._state)
        if step is Step.BUSY and not self._crowd:
            print(f'job {number} has begun', flush=True)
            step = self._request(number, done_within, lambda step: step is Step.DONE)
        self._requests.publish(Int16MultiArray(data=[0]))
        # The last message would be lost with its publisher if the program ended at once.
        self._requests.wait_for_all_acked(Duration(seconds=1))
        # The event of a second publisher comes after its message.
        self._spin(lambda: bool(self._crowd), _PERIOD)
        if self._crowd:
            print(f'job {number}: unknown: {self._crowd}')
            return UNKNOWN
        silence = time.monotonic() - self._heard
        if step is Step.BUSY and silence > self._patience:
            print(f'job {number}: unknown: no job_state has come for {silence:.0f} s')
            return UNKNOWN
        print(f'job {number}: {step.value}')
        return {Step.DONE: DONE, Step.WAITING: NOT_BEGUN, Step.BUSY: UNKNOWN}[step]

    def _request(self, number: int, seconds: float, is_enough: Callable[[Step], bool]) -> Step:
        """Request job ``number`` until ``is_enough`` accepts its step."""
        def step() -> Step:
            assert self._state is not None
            return step_of(number, *self._state)

        def is_over() -> bool:
            return bool(self._crowd) or not self._is_in_control or is_enough(step())

        self._publish_until(number, is_over, seconds)
        if not self._is_in_control:
            print('ROS has lost control of the PLC', flush=True)
        return step()

    def _take_back(self, seconds: float) -> bool:
        """Write 0; return True if it stands confirmed and a state has been read after it."""
        self._is_at_rest = False
        if not self._publish_until(0, lambda: self._is_at_rest, seconds):
            return False
        # The next state may be older than the confirmation: the bridge may have read it before.
        states = self._states
        has_state = self._spin(lambda: self._states >= states + 2, seconds)
        return has_state and self._is_at_rest  # a result of the time before may have come late

    def _publish_until(self, value: int, condition: Callable[[], bool], seconds: float) -> bool:
        """Publish at a steady rate until the condition holds; return False if time is over."""
        end, due = time.monotonic() + seconds, 0.0
        while not condition() and time.monotonic() < end:
            if time.monotonic() >= due:
                due = time.monotonic() + _PERIOD
                self._requests.publish(Int16MultiArray(data=[value]))
            rclpy.spin_once(self, timeout_sec=0.05)
        return condition()

    def _take(self, message: Int16MultiArray) -> None:
        busy, done = message.data
        self._state = busy, done
        self._states += 1
        self._heard = time.monotonic()

    def _take_control(self, message: UInt8MultiArray) -> None:
        self._is_in_control = bool(message.data[0])

    def _take_result(self, result: DiagnosticStatus) -> None:
        if result.name != 'job_request':
            return
        self._result = result.message
        value = next((pair.value for pair in result.values if pair.key == 'value'), '')
        if not result.message.startswith('not written'):  # that changes nothing
            self._is_at_rest = value == '[0]' and result.message.startswith(_CONFIRMED)

    def _spin(self, condition: Callable[[], bool], seconds: float) -> bool:
        end = time.monotonic() + seconds
        while not condition() and time.monotonic() < end:
            rclpy.spin_once(self, timeout_sec=0.05)
        return condition()


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
    """Parse the arguments and let one job be done."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--node', default='/abdf1', help='the bridge (default: %(default)s)')
    parser.add_argument('--begin-within', type=seconds, default=5.0, metavar='S',
                        help='the PLC has to begin within this time (s) (default: %(default)g)')
    parser.add_argument('--done-within', type=seconds, default=60.0, metavar='S',
                        help='the job has to be done within this time (s) (default: %(default)g)')
    parser.add_argument('--patience', type=seconds, default=2.0, metavar='S',
                        help='the bridge has to publish each topic within this time (s) again; '
                        'at least the stale time that check prints (default: %(default)g)')
    parser.add_argument('--control', default='', metavar='TAG',
                        help='tag of a Read row of one bit: 1 if ROS is in control of the PLC')
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Handshake(options.node, options.control, options.patience)
    try:
        return node.run(options.begin_within, options.done_within)
    except KeyboardInterrupt:
        print('unknown: interrupted' if node.has_requested else 'not begun: interrupted')
        return UNKNOWN if node.has_requested else NOT_BEGUN
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    sys.exit(main())
