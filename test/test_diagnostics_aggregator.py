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

"""The example for diagnostic_aggregator knows every status that a bridge publishes."""

from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
import pytest
from support.cases import long_unless
from support.ros import EVERYTHING, EXAMPLE_FILES, Observer, Process, ros_args
from support.ros_tools import SOURCE
from support.simulator_process import OFTEN
import yaml

FILE = SOURCE / 'config' / 'diagnostics_aggregator.yaml'
NODES = ['abdf1', 'press/abdf1', 'paint/abdf1', 'packing/abdf1']


def analyzers() -> dict[str, Any]:
    """Return the entries of the file that are analyzers."""
    parameters = yaml.safe_load(FILE.read_text(encoding='utf-8'))['analyzers']['ros__parameters']
    return {name: entry for name, entry in parameters.items() if isinstance(entry, dict)}


def takers(status: str) -> list[str]:
    """Return the analyzers that take a status of this name."""
    return [name for name, entry in analyzers().items()
            if any(status.startswith(prefix) for prefix in entry['find_and_remove_prefix'])]


def test_entries_are_complete() -> None:
    prefixes = [entry['find_and_remove_prefix'] for entry in analyzers().values()]
    assert prefixes == [[f'{node}: '] for node in NODES]
    for entry in analyzers().values():
        assert entry['type'] == 'diagnostic_aggregator/GenericAnalyzer'
        assert entry['path']
        assert isinstance(entry['timeout'], float)  # an integer is of the wrong type to ROS


@pytest.mark.parametrize('node', long_unless(lambda node: node in NODES[:2], zip(NODES)))
def test_every_status_of_a_node_belongs_to_its_entry(node: str) -> None:
    with Observer() as observer:
        inbox = observer.listen(DiagnosticArray, '/diagnostics', EVERYTHING)
        arguments = ros_args(*EXAMPLE_FILES, 'port:=/dev/ttyS99', OFTEN)
        namespace = node.rpartition('/')[0]
        with Process('node', *arguments, '-r', f'__ns:=/{namespace}') as process:
            names = [status.name for status in inbox.first().status]
            process.end()
    assert {f'{node}: {what}' for what in ('link', 'counters', 'mappings', 'writes')} < set(names)
    assert [takers(name) for name in names] == [[namespace or 'abdf1']] * len(names)
