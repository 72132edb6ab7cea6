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

"""The SROS2 policy: well formed, and neither more nor less than the nodes need."""

from collections.abc import Callable, Iterator
from fnmatch import fnmatchcase
import importlib.util
import os
from pathlib import Path
import re
import subprocess
from typing import Any
from xml.etree import ElementTree

from abdf1_ros.paths import config_file
from abdf1_ros.ros.bridge.node import BridgeNode
from abdf1_ros.ros.lines import LinesNode, sections
from abdf1_ros.ros.parameters.arguments import Arguments
import pytest
import rclpy
from rclpy.node import Node
import rclpy.utilities
from support.ros import EXAMPLE_FILES, Observer, ros_args
from support.ros_tools import needs

ROOT = Path(__file__).resolve().parent.parent
POLICY = ROOT / 'config' / 'sros2' / 'policy.xml'
TWO_ROBOTS = POLICY.with_name('two_robots.xml')
THREE_LINES = POLICY.with_name('three_lines.xml')
SECURITY = ROOT / 'docs' / 'security.md'


def allowed(node: str, kind: str, qualifier: str, policy: Path = POLICY,
            namespace: str = '/') -> set[str]:
    """Return the names that the profile of a node allows, ``~`` written out."""
    names: set[str] = set()
    for profile in ElementTree.parse(policy).getroot().iter('profile'):
        if (profile.attrib['ns'], profile.attrib['node']) != (namespace, node):
            continue
        own = f'{profile.attrib["ns"].rstrip("/")}/{node}'
        for group in profile.iter(kind):
            if group.attrib.get(qualifier) == 'ALLOW':
                names |= {(entry.text or '').replace('~', own) for entry in group}
    return names


def uncovered(names: set[str], patterns: set[str]) -> set[str]:
    """Return the names that no pattern matches."""
    return {name for name in names if not any(fnmatchcase(name, pattern) for pattern in patterns)}


def unused(names: set[str], patterns: set[str]) -> set[str]:
    """Return the patterns that match no name."""
    return {pattern for pattern in patterns
            if not any(fnmatchcase(name, pattern) for name in names)}


# What is asked of the graph of a node, and where the policy allows it.
ASKED = [('publisher', 'topics', 'publish'), ('subscriber', 'topics', 'subscribe'),
         ('service', 'services', 'reply'), ('client', 'services', 'request')]

Graph = Callable[[str], set[str]]


@pytest.fixture
def graph(tmp_path: Path) -> Iterator[Graph]:
    """Return what a running bridge publishes, subscribes to and serves, as the graph tells."""
    with Observer() as observer:
        node = BridgeNode(context=observer.context, use_global_arguments=False,
                          cli_args=ros_args(*with_bit(tmp_path), 'port:=/nowhere/port'))
        yield lambda what: _names(node, what)
        node.destroy_node()


def with_bit(folder: Path) -> tuple[str, str]:
    """Return the example files, with a row of one bit more."""
    rows = config_file('map.csv').read_text('utf-8') + 'horn,Write,B3:1/8,1,PLC5,,,,,,,,\n'
    (folder / 'map.csv').write_text(rows, encoding='utf-8')
    return EXAMPLE_FILES[0], f'map_file:={folder / "map.csv"}'


def _names(node: Node, what: str) -> set[str]:
    ask: Any = getattr(node, f'get_{what}_names_and_types_by_node')
    return {name for name, _ in ask(node.get_name(), node.get_namespace())}


def test_enclaves_are_those_of_the_documentation() -> None:
    root = ElementTree.parse(POLICY).getroot()
    assert [enclave.attrib['path'] for enclave in root.findall('enclaves/enclave')] == [
        '/abdf1', '/interlock_consumer']


def keys_of(folder: Path, policy: Path) -> subprocess.CompletedProcess[str]:
    """Make a keystore in ``folder`` with the commands that the documentation shows."""
    blocks = re.findall(r'^```\n(.*?)^```$', SECURITY.read_text('utf-8'), re.DOTALL | re.MULTILINE)
    block, = [block for block in blocks if 'create_keystore' in block]
    lines = [line for line in block.splitlines() if not line.startswith(('sudo ', 'POLICY='))]
    if policy == TWO_ROBOTS:
        other, = [block for block in blocks if policy.name in block]
        change, = [line for line in other.splitlines() if line.startswith('ENCLAVES=')]
        lines = [change if line.startswith('ENCLAVES=') else line for line in lines]
    return subprocess.run(
        ['bash', '-c', '\n'.join(lines)], cwd=folder, env=os.environ | {'POLICY': str(policy)},
        capture_output=True, text=True, timeout=60, check=False)


def topics_of(permissions: Path, what: str) -> set[str]:
    """Return the DDS topics that an enclave may publish or subscribe to."""
    rule = ElementTree.parse(permissions).getroot().findall('.//allow_rule')[0]
    return {topic.text or '' for topic in rule.findall(f'{what}/topics/topic')}


def test_commands_of_the_documentation_make_keys_that_allow_what_the_policy_says(
        tmp_path: Path) -> None:
    needs('sros2')
    made = keys_of(tmp_path, POLICY)
    assert made.returncode == 0, made.stderr
    assert {'abdf1', 'interlock_consumer'} <= set(made.stdout.split())
    folder = tmp_path / 'keystore' / 'enclaves'
    ours = folder / 'abdf1' / 'permissions.xml'
    assert topics_of(ours, 'publish') == {
        *(f'rt{name}' for name in allowed('abdf1', 'topics', 'publish')),
        *(f'rr{name}Reply' for name in allowed('abdf1', 'services', 'reply'))}
    assert topics_of(ours, 'subscribe') == {
        *(f'rt{name}' for name in allowed('abdf1', 'topics', 'subscribe')),
        *(f'rq{name}Request' for name in allowed('abdf1', 'services', 'reply'))}
    theirs = folder / 'interlock_consumer' / 'permissions.xml'
    assert not [topic for topic in topics_of(theirs, 'publish') if '/write/' in topic]
    assert ElementTree.parse(ours).getroot().findtext('.//default') == 'DENY'
    assert (folder / 'abdf1' / 'permissions.p7s').stat().st_size > 0


def test_policy_that_is_refused_leaves_no_keys_that_allow_everything(tmp_path: Path) -> None:
    needs('sros2')
    bad = tmp_path / 'policy.xml'
    bad.write_text(POLICY.read_text('utf-8').replace('enclave', 'context'), encoding='utf-8')
    assert "Element 'contexts': This element is not expected" in keys_of(tmp_path, bad).stderr
    assert not list((tmp_path / 'keystore' / 'enclaves').glob('*/permissions.p7s'))


@pytest.mark.parametrize(('what', 'kind', 'qualifier'), ASKED)
def test_policy_allows_the_node_exactly_what_it_does(
        graph: Graph, what: str, kind: str, qualifier: str) -> None:
    names, patterns = graph(what), allowed('abdf1', kind, qualifier)
    assert uncovered(names, patterns) == set()
    assert unused(names, patterns) == set()
    assert bool(names) is (what != 'client')


def test_consumer_can_neither_write_nor_call() -> None:
    node = 'interlock_consumer'
    assert allowed(node, 'services', 'request') == set()
    published = allowed(node, 'topics', 'publish')
    assert published == {'/rosout', '/parameter_events'}
    writes = allowed('abdf1', 'topics', 'subscribe')
    assert writes == {'/abdf1/write/*'}
    assert not any(fnmatchcase(write, name) for write in writes for name in published)
    assert uncovered({'/abdf1/write/x'}, allowed(node, 'topics', 'subscribe'))


Consumer = Callable[..., Node]


@pytest.fixture
def consumer() -> Iterator[Consumer]:
    """Return what makes a node of the example, in a namespace."""
    spec = importlib.util.spec_from_file_location(
        'interlock_consumer', ROOT / 'examples' / 'interlock_consumer.py')
    assert spec is not None and spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)

    def make(namespace: str = '/') -> Node:
        rclpy.init(args=['--ros-args', '-r', f'__ns:={namespace}'])
        node: Node = example.InterlockConsumer('abdf1/read/cell_interlocks', [0], 2.0)
        return node

    yield make
    rclpy.utilities.try_shutdown()


def test_consumer_can_do_what_the_example_does(consumer: Consumer) -> None:
    node = consumer()
    for what, kind, qualifier in ASKED:
        names = _names(node, what)
        assert uncovered(names, allowed('interlock_consumer', kind, qualifier)) == set()
    node.destroy_node()


# Two robots


def dds_names(node: Node, what: str) -> set[str]:
    """Return the DDS topics that a node publishes or subscribes to, as its graph tells."""
    if what == 'publish':
        return {f'rt{name}' for name in _names(node, 'publisher')} \
            | {f'rr{name}Reply' for name in _names(node, 'service')}
    return {f'rt{name}' for name in _names(node, 'subscriber')} \
        | {f'rq{name}Request' for name in _names(node, 'service')}


def test_two_robots_have_keys_for_their_own_namespace_and_no_more(
        tmp_path: Path, consumer: Consumer) -> None:
    needs('sros2')
    made = keys_of(tmp_path, TWO_ROBOTS)
    assert made.returncode == 0, made.stderr
    assert made.stdout.splitlines()[-2:] == ['robot_1', 'robot_2'], made.stderr
    for robot, other in (('robot_1', 'robot_2'), ('robot_2', 'robot_1')):
        folder = tmp_path / 'keystore' / 'enclaves' / robot
        bridge, cell = folder / 'abdf1' / 'permissions.xml', folder / 'cell' / 'permissions.xml'
        observed = consumer(f'/{robot}')
        node = BridgeNode(use_global_arguments=False, cli_args=[
            *ros_args(*with_bit(tmp_path), 'port:=/nowhere/port'), '-r', f'__ns:=/{robot}'])
        for what in ('publish', 'subscribe'):
            assert uncovered(dds_names(node, what), topics_of(bridge, what)) == set()
            assert unused(dds_names(node, what), topics_of(bridge, what)) == set()
            assert uncovered(dds_names(observed, what), topics_of(cell, what)) == set()
            for permissions in (bridge, cell):
                assert ElementTree.parse(permissions).getroot().findtext('.//default') == 'DENY'
                assert not [name for name in topics_of(permissions, what) if other in name]
        assert not [name for name in topics_of(cell, 'publish') if '/write/' in name]
        node.destroy_node()
        observed.destroy_node()
        rclpy.utilities.try_shutdown()


# Many lines in a process


def test_process_of_three_lines_is_allowed_exactly_what_its_nodes_do() -> None:
    """A bridge in such a process has no service for the descriptions of types."""
    names = sections([str(ROOT / 'config' / 'three_lines.yaml')])
    profiles = ElementTree.parse(THREE_LINES).getroot().iter('profile')
    assert [f'{entry.attrib["ns"].rstrip("/")}/{entry.attrib["node"]}' for entry in profiles] == [
        '/lines', *names]
    for _, kind, qualifier in ASKED:
        own = {name for name in allowed('abdf1', kind, qualifier)
               if not name.endswith('/get_type_description')}
        for name in names:
            namespace, _, node = name.rpartition('/')
            assert allowed(node, kind, qualifier, THREE_LINES, namespace) == {
                entry.replace('/abdf1/', f'{name}/') for entry in own}


def test_node_of_the_process_is_allowed_exactly_what_it_does() -> None:
    rclpy.init(args=[])
    try:
        node = LinesNode(Arguments())
        for what, kind, qualifier in ASKED:
            assert _names(node, what) == allowed('lines', kind, qualifier, THREE_LINES)
        node.destroy_node()
    finally:
        rclpy.try_shutdown()


# Where the code is checked


def test_workflows_may_read_only_and_name_actions_by_commit() -> None:
    for path in (ROOT / '.github' / 'workflows').iterdir():
        text = path.read_text(encoding='utf-8')
        assert '\npermissions: {contents: read}\n' in text
        assert re.findall(r'uses: (?!\S+@[0-9a-f]{40}(?: |$))(.*)', text, re.MULTILINE) == []
