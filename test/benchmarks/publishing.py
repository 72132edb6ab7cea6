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
Measure what the promises of a read topic cost, by the number of topics in one process.

Method. --topics publishers of one int16 each are made as the node makes them, but with none, one,
or all of its three promises (lifespan, deadline, liveliness manual by topic). Each publishes three
times, spread over half a second, with nobody who listens. Printed is the processor time of the
whole process, the threads of DDS included, for one publish.

Run it as "python test/benchmarks/publishing.py" where rclpy is found.
"""

from __future__ import annotations

import argparse
from array import array
from pathlib import Path
import sys
import time

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:3])

from abdf1_ros.ros.messages import encoder, MESSAGES, read_qos  # noqa: E402
import rclpy  # noqa: E402
from rclpy.event_handler import PublisherEventCallbacks  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from support.mappings import make_mapping  # noqa: E402

ROUNDS, CHUNK = 3, 50
MAPPING = make_mapping(tag='level')
STALE_TIME = 3.1
PROMISES = {
    'none (Publish = Change)': (), 'lifespan': ('lifespan',), 'deadline': ('deadline',),
    'liveliness': ('liveliness', 'liveliness_lease_duration'),
    'all (Publish = Always)': ('lifespan', 'deadline', 'liveliness', 'liveliness_lease_duration')}


def qos_with(names: tuple[str, ...]) -> QoSProfile:
    """Return the QoS of a read topic with these of its promises only."""
    whole = read_qos(MAPPING, STALE_TIME)
    return QoSProfile(depth=whole.depth, reliability=whole.reliability,
                      durability=whole.durability,
                      **{name: getattr(whole, name) for name in names})


def cost(node: Node, topics: int, qos: QoSProfile) -> float:
    """Return the microseconds of processor time of one publish."""
    encode, values = encoder(MAPPING), array('h', [1])
    quiet = PublisherEventCallbacks(use_default_callbacks=False)
    publishers = [node.create_publisher(MESSAGES[MAPPING.message_type], f'~/read/t{number}', qos,
                                        event_callbacks=quiet) for number in range(topics)]
    for publisher in publishers:
        publisher.publish(encode(values))
    begun = time.process_time()
    for _ in range(ROUNDS):
        for first in range(0, topics, CHUNK):
            for publisher in publishers[first:first + CHUNK]:
                publisher.publish(encode(values))
            time.sleep(0.5 * CHUNK / topics)
    spent = time.process_time() - begun
    for publisher in publishers:
        node.destroy_publisher(publisher)
    return spent / ROUNDS / topics * 1e6


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--topics', type=int, nargs='+', default=[500, 2000, 5000])
    options = parser.parse_args()
    rclpy.init(args=[])
    node = rclpy.create_node('publishing')
    print('promises                  ' + ''.join(f'{topics:8}' for topics in options.topics))
    for name, names in PROMISES.items():
        costs = [cost(node, topics, qos_with(names)) for topics in options.topics]
        print(f'{name:26}' + ''.join(f'{spent:5.0f} us' for spent in costs), flush=True)


if __name__ == '__main__':
    main()
