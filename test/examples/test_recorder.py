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

"""The recorder against a real bridge, and the rosbag2 commands that are shown beside it."""

from collections.abc import Iterator
import csv
from datetime import datetime, timedelta, UTC
from pathlib import Path
import re
import shlex
import signal

from abdf1_ros.cli.plc.command import main as plc
from abdf1_ros.paths import config_file
from abdf1_ros.settings.map_file import load_mappings
import pytest
from support.commands import call, Output
from support.ros import Observer, Process
from support.ros_tools import SOURCE
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


def test_every_read_topic_is_recorded_until_a_signal_and_drawn(
        bridge: Process, tmp_path: Path, capsys: Output) -> None:
    path = tmp_path / 'line.csv'
    with Observer() as observer, \
            Process(EXAMPLE, str(path), '--node', '/recorded/abdf1') as recorder:
        observer.until(lambda: has_topics(path), 'all topics')
        recorder.end(signal.SIGTERM)
    rows = rows_of(path)
    assert recorder.lines == [f'{len(rows)} messages in {path}']
    assert len({(row[0], row[1]) for row in rows}) == len(rows)
    last = {row[1]: row for row in rows}
    assert last.keys() == READS.keys()
    for topic, (_, address, values) in READS.items():
        shown = [values] if isinstance(values, str) else [str(value) for value in values]
        assert last[topic][2:] == [address, *shown]
        age = datetime.now(UTC) - datetime.fromisoformat(last[topic][0])
        assert timedelta(0) < age < timedelta(minutes=1)
    said = call(plc, capsys, 'plot', str(path), '--html', str(tmp_path / 'line.html'))
    assert said.status == 0 and said.err == ''
    page = (tmp_path / 'line.html').read_text(encoding='utf-8')
    assert all(f'>{topic}<' in page or f'>{topic}[0]<' in page for topic in READS)


def test_it_ends_after_the_time_it_is_given(bridge: Process, tmp_path: Path) -> None:
    path = tmp_path / 'line.csv'
    with Process(EXAMPLE, str(path), '--node', '/recorded/abdf1', '--seconds', '0.1') as recorder:
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
    # That a bridge has these topics is in test_bridge.py.
    mappings, _ = load_mappings(config_file('map.csv'))
    read = {f'/abdf1/read/{mapping.topic}' for mapping in mappings}
    ours = {'/diagnostics', '/abdf1/write_results', '/abdf1/active_stations', '/abdf1/snapshot',
            '/abdf1/write/any', *read}
    named = {topic for command in commands() for topic in topics_of(command)}
    patterns = [command[command.index('--regex') + 1]
                for command in commands() if '--regex' in command]
    assert named and named <= read
    assert patterns
    for pattern in patterns:
        assert {name for name in ours if re.fullmatch(pattern, name)} == ours


def test_nothing_that_would_be_executed_is_played_back() -> None:
    played = [command for command in commands() if command[:3] == ['ros2', 'bag', 'play']]
    assert played
    for command in played:
        assert topics_of(command)  # without names it would play everything
        assert not [topic for topic in topics_of(command) if '/write/' in topic]
