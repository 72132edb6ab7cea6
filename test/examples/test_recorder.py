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

"""The recorder, and the rosbag2 commands that are shown beside it, against a real bridge."""

from collections.abc import Iterator
import csv
from datetime import datetime, timedelta, UTC
import importlib
from pathlib import Path
import re
import shlex
import signal
import time
from typing import Any

from abdf1_ros.testing import latched_qos
import pytest
from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from std_msgs.msg import Int16MultiArray
from support.ros import EXAMPLE_FILES, Observer, Process, ros_args
from support.ros_tools import needs, SOURCE
from support.simulator_process import Files, make_files, READS

EXAMPLE = SOURCE / 'examples' / 'recorder.py'
COMMANDS = SOURCE / 'docs' / 'recording.md'


@pytest.fixture(scope='module')
def files(tmp_path_factory: pytest.TempPathFactory) -> Files:
    return make_files(tmp_path_factory.mktemp('recorder'))


@pytest.fixture(scope='module')
def bridge(files: Files) -> Iterator[Process]:
    with files.start_simulator(), Process('node', *files.args(), '-r', '__ns:=/recorded') as node:
        yield node
        node.end()


def rows_of(path: Path) -> list[list[str]]:
    with path.open(newline='', encoding='utf-8') as file:
        head, *rows = csv.reader(file)
    assert head == ['time', 'topic', 'address', 'values']
    return rows


def has_topics(path: Path) -> bool:
    """Tell whether every topic has come into the file, which may be written to."""
    return path.exists() and all(
        f',{topic},' in path.read_text(encoding='utf-8') for topic in READS)


def test_every_read_topic_is_recorded_until_a_signal(bridge: Process, tmp_path: Path) -> None:
    path = tmp_path / 'line.csv'
    with Observer() as observer, \
            Process(EXAMPLE, str(path), '--node', '/recorded/abdf1') as recorder:
        observer.until(lambda: has_topics(path), 'all topics')
        recorder.end(signal.SIGTERM)
    rows = rows_of(path)
    assert recorder.lines == [f'{len(rows)} messages in {path}']
    last = {row[1]: row for row in rows}
    assert last.keys() == READS.keys()
    for topic, (_, address, values) in READS.items():
        shown = [values] if isinstance(values, str) else [str(value) for value in values]
        assert last[topic][2:] == [address, *shown]
        age = datetime.now(UTC) - datetime.fromisoformat(last[topic][0])
        assert timedelta(0) < age < timedelta(minutes=1)


def test_it_ends_after_the_time_it_is_given(bridge: Process, tmp_path: Path) -> None:
    path = tmp_path / 'line.csv'
    with Process(EXAMPLE, str(path), '--node', '/recorded/abdf1', '--seconds', '1') as recorder:
        assert recorder.result() == 0, recorder.text
    assert recorder.lines == [f'{len(rows_of(path))} messages in {path}']


def test_bridge_that_is_not_there_is_said(tmp_path: Path) -> None:
    with Process(EXAMPLE, str(tmp_path / 'x.csv'), '--node', '/x', '--wait', '0.5') as recorder:
        assert recorder.result() == 1
    assert recorder.lines == ['/x is not there, or has no read topic']
    assert not (tmp_path / 'x.csv').exists()


def test_file_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    path = tmp_path / 'none' / 'x.csv'
    with Process(EXAMPLE, str(path)) as recorder:
        assert recorder.result() == 2
    assert recorder.lines == [f'{path}: cannot be written: No such file or directory']


def test_file_that_is_there_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / 'yesterday.csv'
    path.write_text('mine', encoding='utf-8')
    with Process(EXAMPLE, str(path)) as recorder:
        assert recorder.result() == 2
    assert recorder.lines == [f'{path}: cannot be written: File exists']
    assert path.read_text(encoding='utf-8') == 'mine'


# rosbag2


def commands() -> list[list[str]]:
    blocks = re.findall('```\n(.*?)```', COMMANDS.read_text(encoding='utf-8'), re.DOTALL)
    return [shlex.split(line) for block in blocks for line in block.splitlines()]


def topics_of(command: list[str]) -> list[str]:
    """Return the topics that a command names after ``--topics``."""
    if '--topics' not in command:
        return []
    return command[command.index('--topics') + 1:]


def test_topics_of_the_rosbag2_commands_exist() -> None:
    named = {topic for command in commands() for topic in topics_of(command)}
    patterns = [command[command.index('--regex') + 1]
                for command in commands() if '--regex' in command]
    assert named
    assert patterns
    arguments = ros_args(*EXAMPLE_FILES, 'port:=/dev/ttyS99')
    with Observer() as observer, Process('node', *arguments) as node:
        def topics() -> set[str]:
            return {name for name, _ in observer.node.get_topic_names_and_types()}

        observer.until(lambda: named <= topics(), lambda: f'{named - topics()}')
        ours = {name for name in topics() if name.startswith('/abdf1/')} | {'/diagnostics'}
        node.end()
    for pattern in patterns:
        assert {name for name in ours if re.fullmatch(pattern, name)} == ours


def test_nothing_that_would_be_executed_is_played_back() -> None:
    played = [command for command in commands() if command[:3] == ['ros2', 'bag', 'play']]
    assert played
    for command in played:
        assert topics_of(command)  # without names it would play everything
        assert not [topic for topic in topics_of(command) if '/write/' in topic]


# What rosbag2 does with the quality of service, by another program for its files


def as_recorded(offered: QoSProfile) -> Any:
    """Return what a bag keeps of the quality of service that a publisher offers."""
    types = importlib.import_module('rosbags.interfaces')

    def time_of(duration: Duration) -> Any:
        return types.QosTime(*divmod(duration.nanoseconds, 1_000_000_000))

    return types.Qos(
        types.QosHistory(int(offered.history)), offered.depth,
        types.QosReliability(int(offered.reliability)),
        types.QosDurability(int(offered.durability)), time_of(offered.deadline),
        time_of(offered.lifespan), types.QosLiveliness(int(offered.liveliness)),
        time_of(offered.liveliness_lease_duration), False)


def as_played(recorded: Any) -> QoSProfile:
    """Return what ``ros2 bag play`` offers for it: the same, with a history of 10."""
    def duration(time: Any) -> Duration:
        return Duration(seconds=time.sec, nanoseconds=time.nsec)

    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=10,
        reliability=ReliabilityPolicy(recorded.reliability.value),
        durability=DurabilityPolicy(recorded.durability.value),
        deadline=duration(recorded.deadline), lifespan=duration(recorded.lifespan),
        liveliness=LivelinessPolicy(recorded.liveliness.value),
        liveliness_lease_duration=duration(recorded.liveliness_lease_duration))


def test_recorded_topic_plays_back_with_its_quality_of_service(tmp_path: Path) -> None:
    rosbag2 = needs('rosbags.rosbag2')
    typesys = importlib.import_module('rosbags.typesys')
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    topic, bag, files = '/played/abdf1/read/speeds', tmp_path / 'line', make_files(tmp_path)
    with files.start_simulator(), Observer() as observer, \
            Process('node', *files.args(), '-r', '__ns:=/played') as node, \
            rosbag2.Writer(bag, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        observer.until(lambda: observer.node.get_publishers_info_by_topic(topic), topic)
        offered, = observer.node.get_publishers_info_by_topic(topic)
        recorded = writer.add_connection(
            topic, 'std_msgs/msg/Int16MultiArray', typestore=store,
            offered_qos_profiles=[as_recorded(offered.qos_profile)])
        # rosbag2 asks for what all publishers offer in reliability and durability, no more.
        taken: list[bytes] = []
        subscription = observer.node.create_subscription(
            Int16MultiArray, topic, taken.append, latched_qos(), raw=True)
        observer.until(lambda: len(taken) >= 3, 'three messages')
        for data in taken:
            writer.write(recorded, time.time_ns(), data)
        observer.node.destroy_subscription(subscription)
        node.end()
    with rosbag2.Reader(bag) as reader, Observer() as observer:
        (connection,) = reader.connections
        (kept,) = connection.ext.offered_qos_profiles
        played = as_played(kept)
        stale = offered.qos_profile.deadline
        assert played.deadline == played.lifespan == played.liveliness_lease_duration == stale
        assert 0 < stale.nanoseconds < 10_000_000_000
        publisher = observer.node.create_publisher(Int16MultiArray, topic, played)
        inbox = observer.listen(Int16MultiArray, topic, QoSProfile(
            depth=10, reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL, deadline=stale,
            liveliness=LivelinessPolicy.MANUAL_BY_TOPIC, liveliness_lease_duration=stale))
        messages = [data for _, _, data in reader.messages()]
        assert messages == taken
        for data in messages:
            publisher.publish(data)
        observer.until(lambda: len(inbox) == len(taken), 'what was recorded')
        assert {tuple(message.data) for message in inbox} == {tuple(READS['speeds'][2])}
        # The recording has ended: the consumer is told as it would be of a lost line.
        observer.until(lambda: inbox.deadlines and inbox.liveliness[-1].alive_count == 0,
                       'the end of the values')
        assert not inbox.incompatible
