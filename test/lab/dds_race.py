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
Tell whether this Fast DDS crashes where a subscription ends while its publishers go away.

Fast DDS 2.14.5 did so 4 times of 4, within 120 s (eProsima/Fast-DDS#3303): its thread of discovery
finds no listener any more. Another process makes and destroys publishers of a topic, this one its
subscriptions; nothing spins. With --other-topic nothing matches, and nothing crashes.
"""

import argparse
import os
import subprocess
import sys
import time

import rclpy
from rclpy.node import Node
from std_msgs.msg import String


def churn(node: Node, topic: str, end: float) -> None:
    """Make and destroy publishers until a monotonic clock value."""
    while time.monotonic() < end:
        for publisher in [node.create_publisher(String, topic, 10) for _ in range(3)]:
            node.destroy_publisher(publisher)


def main() -> int:
    """Run; return 1 after a crash."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--seconds', type=float, default=120.0)
    parser.add_argument('--other-topic', action='store_true')
    parser.add_argument('--part', choices=['publishers', 'subscriptions'], help='for itself')
    wanted = parser.parse_args()
    if wanted.part is None:
        ends = [subprocess.Popen([sys.executable, __file__, *sys.argv[1:], '--part', part])
                for part in ('publishers', 'subscriptions')]
        status = [end.wait() for end in ends][1]
        print('no crash' if status == 0 else f'crashed: {status}')
        return int(status != 0)
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    rclpy.init()
    node, end = Node(wanted.part), time.monotonic() + wanted.seconds
    if wanted.part == 'publishers':
        churn(node, 'other' if wanted.other_topic else 'race', end)
    while time.monotonic() < end:
        made = [node.create_subscription(String, 'race', print, 10) for _ in range(5)]
        time.sleep(0.002)
        for subscription in made:
            node.destroy_subscription(subscription)
    return 0


if __name__ == '__main__':
    sys.exit(main())
