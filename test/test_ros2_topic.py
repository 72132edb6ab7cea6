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

"""What the documentation says of ``ros2 topic`` and ``ros2 param``, with the real commands."""

from collections.abc import Iterator
from pathlib import Path
import re

from abdf1_ros.paths import config_file
import pytest
from support.documents import blocks, text
from support.ros import EXAMPLE_FILES, Process, ros_args
from support.ros_tools import needs, ros2

for name in ('ros2topic', 'ros2param'):
    needs(name)


# Without a daemon, which would stay; so there has to be time to find others.
DIRECT = ('--no-daemon', '--spin-time', '3')


@pytest.fixture(scope='module')
def bridge(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Process]:
    """Run the example on its simulator."""
    port = tmp_path_factory.mktemp('line') / 'plc'
    with Process('simulator', '--pty', str(port)) as simulator:
        simulator.wait_for('stations 1 (PLC5), 2 (SLC) on')
        with Process('node', *ros_args(*EXAMPLE_FILES, f'port:={port}')) as node:
            node.wait_for(f'{port}: open')
            yield node


def said(*args: str) -> list[str]:
    """Return the lines of a ``ros2`` command that ends by itself."""
    process = ros2(*args)
    assert process.result() == 0, process.text
    return process.lines


def without_numbers(lines: list[str]) -> list[str]:
    return [re.sub(r'\d+', '0', line) for line in lines]


def block_after(page: str, command: str) -> list[str]:
    """Return the lines that a page shows after a command."""
    block, = [block for block in blocks(text(page)) if command in block]
    return block.split(command, 1)[1].strip('\n').split('\n')


def test_echo_of_a_read_topic_is_what_the_reference_shows(bridge: Process) -> None:
    command = 'topic echo --once --flow-style /abdf1/read/cell_interlocks'
    shown = block_after('docs/reference/topics.md', f'$ ros2 {command}')
    lines = said(*command.split(), *DIRECT)
    message = lines[lines.index('layout:'):]  # before it may stand that one was lost
    assert without_numbers(message) == without_numbers(shown)


def test_state_of_all_is_a_few_lines(bridge: Process) -> None:
    shown = block_after('docs/reference/diagnostics.md',
                        "$ ros2 topic echo --once /diagnostics | grep '^  message'")
    for _ in range(10):  # the first ones may come before every mapping has been read
        lines = said('topic', 'echo', '--once', '/diagnostics', *DIRECT)
        messages = [line for line in lines if 'message' in line]
        if without_numbers(messages) == without_numbers(shown):
            return
    assert messages == shown


def test_result_names_the_request(bridge: Process) -> None:
    echo = ros2('topic', 'echo', '--once', '--flow-style', '/abdf1/write_results', *DIRECT)
    message = '{layout: {dim: [{label: robot_1 7}]}, data: [1, 2, 3, 4]}'
    for _ in range(10):  # the first ones may come before the echo listens
        said('topic', 'pub', '--once', '-w', '1', '/abdf1/write/recipe',
             'std_msgs/msg/Int16MultiArray', message)
        if echo.text:
            break
    assert echo.result() == 0
    assert 'message: written' in echo.text
    assert '{key: request, value: robot_1 7}' in echo.text


def test_parameter_shows_where_the_file_is(bridge: Process) -> None:
    line, = said('param', 'get', '/abdf1', 'net_file', *DIRECT)
    assert line == f'String value is: {Path(config_file("net.csv")).resolve()}'
