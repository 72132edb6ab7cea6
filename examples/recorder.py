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
Record the values that a bridge reads from PLCs, in a CSV file for a spreadsheet.

A row is one message: time of publication (UTC), topic below ~/read/, PLC address, and values. An
array has a cell for each value, so rows differ in length: read them with Python's csv.reader. For
replay, plots, or topics of other nodes use rosbag2: docs/recording.md has the commands.

Exit status: 0 after Ctrl-C or --seconds, 1 if the bridge is not found, 2 for bad arguments or a
file that cannot be written.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
import csv
from datetime import datetime, UTC
import math
import os
import signal
import sys
import time
from typing import Any, TextIO

import rclpy
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
import std_msgs.msg

_EXAMPLES = """\
examples:
  recorder.py line.csv
  recorder.py line.csv --node /cell/line_1 --seconds 3600
"""

_PROGRESS_PERIOD = 2.0

# The bridge keeps one value for late subscribers. 100 values may wait here while the disk is busy.
_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE,
                  durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Recorder(Node):
    """Writes every message on the read topics of ``bridge`` to ``file``."""

    def __init__(self, bridge: str, file: TextIO) -> None:
        super().__init__('recorder')
        self._bridge = bridge
        self._file = file
        self._writer = csv.writer(file)
        self._writer.writerow(['time', 'topic', 'address', 'values'])
        self._known: set[str] = set()
        self.rows = 0
        self.create_timer(0.5, self._look_for_topics)
        self.create_timer(1.0, file.flush)

    def _look_for_topics(self) -> None:
        namespace, _, name = self._bridge.rpartition('/')
        try:
            topics = self.get_publisher_names_and_types_by_node(name, namespace or '/')
        except NodeNameNonExistentError:
            return
        for topic, (type_name, *_) in topics:
            if topic.startswith(f'{self._bridge}/read/') and topic not in self._known:
                self._known.add(topic)
                message_type = getattr(std_msgs.msg, type_name.split('/')[-1])
                self.create_subscription(message_type, topic, self._taker(topic), _QOS)

    @property
    def has_found_topics(self) -> bool:
        return bool(self._known)

    def _taker(self, topic: str) -> Callable[..., None]:
        short = topic.removeprefix(f'{self._bridge}/read/')

        def take(message: Any, info: Any) -> None:
            published = datetime.fromtimestamp(info['source_timestamp'] / 1e9, UTC)
            is_text = isinstance(message, std_msgs.msg.String)
            address = '' if is_text or not message.layout.dim else message.layout.dim[0].label
            values = [message.data] if is_text else message.data
            self._writer.writerow([published.isoformat(), short, address, *values])
            self.rows += 1
        return take


def record(node: Recorder, seconds: float, wait: float, ended: list[int]) -> bool:
    """
    Record for ``seconds`` or until a signal comes; return False if the bridge was not found.

    The time begins when the bridge is found, within ``wait`` s.
    """
    begin = said = time.monotonic()
    end = math.inf
    while (now := time.monotonic()) < end and not ended:
        rclpy.spin_once(node, timeout_sec=0.1)
        if not node.has_found_topics and now > begin + wait:
            return False
        if node.has_found_topics and end == math.inf:
            end = now + seconds
        if sys.stderr.isatty() and now > said + _PROGRESS_PERIOD:
            said = now
            print(f'\r{node.rows} messages', end='', file=sys.stderr, flush=True)
    return True


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
    """Record until Ctrl-C, SIGTERM or --seconds."""
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('file', help='CSV file to write; must not exist yet')
    parser.add_argument('--node', default='/abdf1', help='the bridge (default: %(default)s)')
    parser.add_argument('--seconds', type=seconds, default=math.inf,
                        help='end this many seconds after the bridge was found')
    parser.add_argument('--wait', type=seconds, default=10.0,
                        help='seconds to look for the bridge (default: %(default)g)')
    options = parser.parse_args(remove_ros_args(sys.argv)[1:])
    # With rclpy's own handlers the file would not be closed cleanly.
    ended: list[int] = []  # not a threading.Event: a second signal during its set() may deadlock
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: ended.append(number))
    try:
        with open(options.file, 'x', newline='', encoding='utf-8') as file:
            return run(options, file, ended)
    except OSError as error:
        print(f'{options.file}: cannot be written: {error.strerror}', file=sys.stderr)
        return 2


def run(options: argparse.Namespace, file: TextIO, ended: list[int]) -> int:
    """Record into ``file``; return the exit status."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Recorder(f'/{options.node.lstrip("/")}', file)
    try:
        found = record(node, options.seconds, options.wait, ended)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    if not found:
        os.unlink(options.file)  # it has no messages, and would block the next try
    print(f'{node.rows} messages in {options.file}' if found else
          f'{options.node} is not there, or has no read topic{hint()}')
    return 0 if found else 1


def hint() -> str:
    """Return why we may not see a bridge; empty if we know no reason."""
    is_client = os.environ.get('ROS_DISCOVERY_SERVER') \
        and os.environ.get('ROS_SUPER_CLIENT', '').upper() != 'TRUE'
    return '; ROS_DISCOVERY_SERVER is set: set ROS_SUPER_CLIENT=TRUE too' if is_client else ''


if __name__ == '__main__':
    sys.exit(main())
