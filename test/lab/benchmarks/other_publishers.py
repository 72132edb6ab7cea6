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
Measure what the look for other publishers of our topics costs, by number of topics.

Method. A node with so many publishers, each with the QoS of a read topic, and the watch of the
bridge, which looks ten times a second and counts each topic once a second. "a second" is the
processor time of ten such looks, "longest" the longest single look; each is the least of --rounds
rounds. "alone" is without another publisher, "crowded" with a second node that publishes all the
topics, so that the names of the nodes are asked for, too. The goal: 1000 topics take less than 3 %
of a core while they are alone.

Run it as "python test/lab/benchmarks/other_publishers.py"; it needs ROS, or the wheels of it.
"""

import argparse
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import sys
import time

sys.path[:0] = map(str, Path(__file__).resolve().parents[1:4])

from abdf1_ros.ros.diagnostics.graph import Graph  # noqa: E402
from abdf1_ros.ros.diagnostics.other_publishers import OtherPublisherWatch  # noqa: E402
from abdf1_ros.ros.diagnostics.status import Seen  # noqa: E402
from abdf1_ros.ros.topic_names import TopicNames  # noqa: E402
from abdf1_ros.ros.topics.messages import MESSAGES, read_qos  # noqa: E402
from abdf1_ros.settings.mapping import Mapping  # noqa: E402
from rclpy.event_handler import PublisherEventCallbacks  # noqa: E402
from rclpy.node import Node  # noqa: E402
from support.mappings import make_mapping  # noqa: E402
from support.ros import Observer  # noqa: E402

LOOKS = 10  # a second
PATIENCE = 30.0  # s


@contextmanager
def publishing(name: str, rows: Sequence[Mapping], topics: Sequence[str]) -> Iterator[Node]:
    """Publish the topics of rows from a participant of its own."""
    with Observer(name) as observer:
        for row, topic in zip(rows, topics, strict=True):
            observer.node.create_publisher(
                MESSAGES[row.message_type], topic, read_qos(row, 1.0),
                event_callbacks=PublisherEventCallbacks(use_default_callbacks=False))
        yield observer.node


def seconds_of(watch: OtherPublisherWatch, rounds: int) -> tuple[float, float]:
    """Return the processor time of the looks of a second, and that of the longest look."""
    found = []
    for number in range(rounds):
        times = []
        for look in range(LOOKS):
            begun = time.thread_time()
            watch.look(number + look / LOOKS)
            times.append(time.thread_time() - begun)
        if number:  # the first look is for all topics
            found.append((sum(times), max(times)))
    return min(found)


def measure(count: int, rounds: int) -> None:
    """Print a line for so many topics."""
    rows = [make_mapping(f'N{7 + number // 1000}:{number % 1000}', topic=f'row_{number}')
            for number in range(count)]
    names = TopicNames.of(lambda topic: f'/abdf1{topic[1:]}', rows)
    topics = [*names.read.values()]
    with publishing('abdf1', rows, topics) as node:
        seen = Seen()
        figures = [*seconds_of(OtherPublisherWatch(Graph(node), '/abdf1', names, seen), rounds)]
        with publishing('stub', rows, topics):
            begun = time.monotonic()
            while any(node.count_publishers(topic) < 2 for topic in topics):
                assert time.monotonic() < begun + PATIENCE, 'DDS does not show the second node'
                time.sleep(0.1)
            figures += seconds_of(OtherPublisherWatch(Graph(node), '/abdf1', names, seen), rounds)
            assert len(seen.other_publishers) == count
    print(f'{count:6d}  ' + '  '.join(f'{1e3 * figure:8.2f} ms' for figure in figures), flush=True)


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--topics', type=int, nargs='+', default=[10, 100, 1000])
    parser.add_argument('--rounds', type=int, default=6)
    options = parser.parse_args()
    print(f'load of the machine {os.getloadavg()[0]:.1f}')
    print('topics  alone: a second   longest  crowded: a second  longest')
    for count in options.topics:
        measure(count, options.rounds)


if __name__ == '__main__':
    main()
