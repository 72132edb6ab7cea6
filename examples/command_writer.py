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
Write values to a PLC and wait for the result.

For one bit you do not need this program: the service ~/set/<topic> gives the same result.

For each message to ~/write/<topic> the bridge publishes exactly one result for each mapping of the
topic, on ~/write_results. The result repeats the label of the message as "request": so each of
several writers finds its own results. A text has no label: this program takes the first result
with its tag. So let only one program write to a topic of texts.

With --station the command is sent only if the bridge is in control of this station; otherwise the
reason is printed. The status "interlocks" of /diagnostics shows this. If no row of the map
Confirms the control, a counting heartbeat is enough: the PLC may still wait for a reset.

If no result comes, it is unknown whether the command was executed. Look at the read topic before
you send it again: a second pulse may do harm.

Exit status: 0 written, 1 not written, 2 bad arguments, 3 unknown whether written. 3 also means:
written only partly, or sent to all stations, which no station confirms.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import math
import os
import signal
import sys
import time
from typing import Any
import uuid

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import rclpy
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
import std_msgs.msg

WRITTEN, NOT_WRITTEN, BAD_ARGUMENTS, UNKNOWN = range(4)

_EXAMPLES = """\
examples:
  command_writer.py recipe 211 222 233 244
  command_writer.py setpoint 21.5 --node /cell/line_1
  command_writer.py name 'Tank 4'
  command_writer.py speeds 40 --tags speed_north speed_south   two mappings, one topic
  command_writer.py speed 40 --station 1                       while ROS is in control there
"""


class CommandWriter(Node):
    """Writes to one topic of the node ``bridge``; ``tags``: of the topic's mappings."""

    def __init__(self, bridge: str, topic: str, tags: list[str]) -> None:
        super().__init__('command_writer')
        self._topic = f'{bridge}/write/{topic}'
        self._tags = tags
        self._request: str | None = None  # the label; '' for a text, None before we have written
        self._publisher: Any = None
        self.results: dict[str, DiagnosticStatus] = {}
        self._listener = self.create_subscription(
            DiagnosticStatus, f'{bridge}/write_results', self._take, 100)
        self._interlocks = f'{bridge.lstrip("/")}: interlocks'
        self._control: dict[str, str] = {}

    def why_not_in_control(self, station: int, timeout: float) -> str:
        """Return why ROS is not in control of a station; empty if it is."""
        told = self.create_subscription(DiagnosticArray, '/diagnostics', self._take_control, 10)
        self._spin_until(lambda: self._control, timeout)
        self.destroy_subscription(told)
        text = self._control.get(f'station {station}', 'the bridge has no heartbeat there')
        is_good = text.startswith(('in control', 'heartbeat counts'))
        return '' if is_good else text.removeprefix('not in control: ')

    def _take_control(self, array: DiagnosticArray) -> None:
        for status in array.status:
            if status.name == self._interlocks:
                self._control = {pair.key: pair.value for pair in status.values}

    def connect(self, timeout: float) -> bool:
        """Find the bridge; return True if it listens and we hear its results."""
        if not self._spin_until(self._type, timeout):
            return False
        # Volatile, so that a bridge that starts later does not execute an old command.
        self._publisher = self.create_publisher(self._type(), self._topic, QoSProfile(depth=10))
        return self._spin_until(lambda: self._publisher.get_subscription_count() > 0
                                and self.has_bridge, timeout)

    @property
    def has_bridge(self) -> bool:
        return self._listener.get_publisher_count() > 0

    def write(self, words: list[str], timeout: float) -> bool:
        """Send the values once; return True if all results have come."""
        message = self._type()()
        if isinstance(message, std_msgs.msg.String):
            message.data = ' '.join(words)
        elif isinstance(message, std_msgs.msg.Float32MultiArray):
            message.data = [number(float, word, 'a number') for word in words]
        else:
            message.data = [number(lambda text: int(text, 0), word, 'a whole number')
                            for word in words]
        self._request = ''
        if not isinstance(message, std_msgs.msg.String):
            # The result repeats the label, so that we know our own result.
            self._request = f'{self.get_fully_qualified_name()} {uuid.uuid4()}'
            message.layout.dim = [std_msgs.msg.MultiArrayDimension(label=self._request)]
        self._publisher.publish(message)
        return self._spin_until(lambda: len(self.results) == len(self._tags), timeout)

    def _type(self) -> Any:
        """Return the message type of the write topic; None until the bridge is found."""
        found = self.get_subscriptions_info_by_topic(self._topic)
        return getattr(std_msgs.msg, found[0].topic_type.split('/')[-1]) if found else None

    def _take(self, result: DiagnosticStatus) -> None:
        request = next((pair.value for pair in result.values if pair.key == 'request'), '')
        if result.name in self._tags and self._request in ('', request):
            self.results.setdefault(result.name, result)

    def _spin_until(self, condition: Callable[[], Any], timeout: float) -> bool:
        end = time.monotonic() + timeout
        while not condition() and time.monotonic() < end:
            rclpy.spin_once(self, timeout_sec=0.05)
        return bool(condition())


def number(convert: Callable[[str], Any], text: str, what: str) -> Any:
    """Return a value; raise ValueError with a clear text if it is not valid."""
    try:
        return convert(text)
    except ValueError:
        raise ValueError(f'"{text}" should be {what}') from None


def hint() -> str:
    """Return why we may not see a bridge; empty if we know no reason."""
    is_client = os.environ.get('ROS_DISCOVERY_SERVER') \
        and os.environ.get('ROS_SUPER_CLIENT', '').upper() != 'TRUE'
    return '; ROS_DISCOVERY_SERVER is set: set ROS_SUPER_CLIENT=TRUE too' if is_client else ''


def judge(message: str) -> int:
    """Return the exit status for the text of a result."""
    if message.startswith(('written', 'stands')):
        return WRITTEN
    return NOT_WRITTEN if message.startswith('not written') else UNKNOWN


def run(node: CommandWriter, options: argparse.Namespace) -> int:
    """Write, print the results, and return the exit status."""
    if not node.connect(options.timeout):
        print(f'not written: {options.node} does not listen to write/{options.topic}'
              if node.has_bridge else f'not written: there is no node {options.node}{hint()}')
        return NOT_WRITTEN
    if options.station is not None and (
            why := node.why_not_in_control(options.station, options.timeout)):
        print(f'not written: ROS is not in control of station {options.station}: {why}')
        return NOT_WRITTEN
    complete = node.write(options.values, options.timeout)
    for tag, result in node.results.items():
        latency = {pair.key: pair.value for pair in result.values}['latency_ms']
        print(f'{tag}: {result.message} ({latency} ms)')
    statuses = [judge(result.message) for result in node.results.values()]
    if not complete:
        print(f'unknown whether written: no result within {options.timeout:g} s')
        statuses.append(UNKNOWN)
    return max(statuses)


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
    """Parse the arguments and write."""
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('topic', help='name below ~/write/')
    parser.add_argument('values', nargs='+', help='all values of the mapping; for bits 0 and 1')
    parser.add_argument('--node', default='/abdf1', help='the bridge (default: %(default)s)')
    parser.add_argument('--tags', nargs='+', help='tags of the mappings (default: the topic)')
    parser.add_argument('--station', type=int,
                        help='write only while ROS is in control of this station')
    parser.add_argument('--timeout', type=seconds, default=6.0,
                        help='seconds to wait for the bridge, then for the result; longer than '
                             'twice the write_timeout of the bridge, which may read back a write '
                             '(default: %(default)g)')
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    # With rclpy's own handlers we could not print that the result is unknown.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = None
    try:
        node = CommandWriter(options.node, options.topic, options.tags or [options.topic])
        return run(node, options)
    except (ValueError, OverflowError, InvalidTopicNameException) as error:
        reason = ' '.join(str(error).split())
        print(f'{" ".join(options.values)}: cannot be sent: {reason}', file=sys.stderr)
        return BAD_ARGUMENTS
    except KeyboardInterrupt:
        print('unknown whether written: interrupted')
        return UNKNOWN
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    sys.exit(main())
